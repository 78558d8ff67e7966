"""Compare the mass behind a linkage with that of a rigid one.

    python -m benchmarks.linkage_mass

The effect ``linkage_compliance`` has a tenth of the ring's mass on the actuator's side
(``sim.shift.mechanism.FORK``) and a mass of its own, from that of a thin cable to that of an arm
behind a ratio; without compliance it acts as ``moving_mass``. Means of the published clutch at some
mismatches and all forces, 16 even angles each, by the compiled engine, read at the ring and at the
actuator. Takes a minute.
"""

from __future__ import annotations

import numpy as np

from dogshape.diagnosis.bench.bench_data import load_bench
from dogshape.diagnosis.prediction.simulations import read_time, settings_of
from dogshape.sim.effects import load
from dogshape.sim.setting import Sensor, Setting
from dogshape.sim.statistics.batch import run_block
from dogshape.sim.statistics.blocks import even_block
from dogshape.sim.units import RPM

MISMATCHES, ANGLES = (10, 50, 149), 16  #: 1/min
COMPLIANCES = (0.0, 0.3, 3.0, 10.0, 35.0)  #: mm/kN
SENSORS: tuple[Sensor, ...] = ("sleeve", "actuator")
MASSES = (0.0, 0.03, 0.1, 0.3, 1.0, 3.0)  #: kg


def mean_of(settings: list[Setting]) -> float:
    """Return the mean time that the bench reads, ms; what does not engage is left out."""
    every = []
    for one in settings:
        rows = run_block(even_block(one.clutch, one.point, ANGLES, (1, 0)))
        every.append([read_time(one, row) for row in rows])
    times = np.array(every)
    return 1e3 * float(times[np.isfinite(times)].mean())


def main() -> None:
    """Simulate and print."""
    effects, bench = load(), load_bench("mq200_stand")
    known = [s for s in settings_of(bench, "sleeve") if round(s.point.mismatch / RPM) in MISMATCHES]
    for sensor in SENSORS:
        print(f"read at the {sensor}: mean in ms, and what a mass of the linkage in kg adds to it")
        print("mm/kN     none" + "".join(f"{mass:8g}" for mass in MASSES[1:]))
        for compliance in COMPLIANCES:
            means = []
            for mass in MASSES:
                made = []
                for one in known:
                    quick = Setting(one.clutch.with_engine("planar"), one.point, sensor=sensor)
                    given = {"compliance_mm_kN": compliance, "mass_behind_kg": mass}
                    made.append(effects["linkage_compliance"].apply(quick, given))
                means.append(mean_of(made))
            added = "".join(f"{mean - means[0]:+8.2f}" for mean in means[1:])
            print(f"{compliance:<7g}{means[0]:7.2f}{added}", flush=True)


if __name__ == "__main__":
    main()
