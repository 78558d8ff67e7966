"""What each effect does to the mean shift time, by the compiled engine and by Drake.

    python -m benchmarks.engine_effects

Each effect at the middle of its prior, on the prototype: eight even angles at four operating
points in either engine, the same without it, and the change of the mean. Effects of the sensor
alone are left out. One process; takes five minutes.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from benchmarks.common import paper_study, point_of
from dogshape.sim.effects import load
from dogshape.sim.engines import engage
from dogshape.sim.setting import Setting

POINTS = ((10.0, 235.2), (25.0, 469.0), (50.0, 641.5), (149.0, 315.5))
ANGLES = 8
QUIET = ("actuation_delay", "relative_angle")  # no simulation of their own


def times(setting: Setting, engine: str) -> NDArray[np.float64]:
    """Simulate even angles; shift times in s, (n,), the time-out where a shift does not engage."""
    clutch = setting.clutch if engine == "drake" else setting.clutch.with_engine(engine)
    angles = (np.arange(ANGLES) + 0.5) / ANGLES * clutch.dog.pitch_angle
    found = [engage(clutch, setting.point, float(angle)).shift_time for angle in angles]
    return np.array([clutch.timeout if one is None else one for one in found])


def main() -> None:
    """Simulate and print."""
    study, effects = paper_study(), load()
    settings = [Setting(study.clutch, point_of(study, *given)) for given in POINTS]
    base = {name: [times(one, name) for one in settings] for name in ("drake", "planar")}
    print(f"change of the mean over {len(POINTS)} operating points and {ANGLES} angles, ms")
    print(f"{'effect':<22}{'Drake':>9}{'planar':>9}{'differ':>9}{'of Drake':>10}")
    for name, effect in effects.items():
        if name in QUIET:
            continue
        values = {p.name: p.at(0.5) for p in effect.parameters}
        changed = [effect.apply(one, values) for one in settings]
        moved = {
            engine: 1e3 * float(np.mean([times(one, engine) - before for one, before in
                                         zip(changed, base[engine], strict=True)]))
            for engine in base
        }  # fmt: skip
        off = moved["planar"] - moved["drake"]
        share = f"{abs(off / moved['drake']):10.2%}" if moved["drake"] else f"{'-':>10}"
        print(f"{name:<22}{moved['drake']:9.2f}{moved['planar']:9.2f}{off:9.3f}{share}", flush=True)


if __name__ == "__main__":
    main()
