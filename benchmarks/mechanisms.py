"""Effects and mechanisms in both engines: change of the mean shift time, error and cost.

    python -m benchmarks.mechanisms

The first table has each effect at the middle of its prior, on the prototype: the change of the mean
over eight even angles at four operating points in either engine. Effects of the sensor alone are
left out.

The second has ten random designs, operating points and relative angles for each mechanism, with the
published contact set, which Drake simulates by its scheme ``cenic``. ``off`` is the deviation of a
shift's time from that of the compiled engine with finer steps, percent: median, 90 % quantile,
largest; the last column is processor time a shift. A shift that does not engage counts with the
time-out. One process; takes some eight minutes.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from benchmarks.common import paper_study, point_of
from dogshape.sim.effects import load
from dogshape.sim.errors import DogshapeError
from dogshape.sim.setting import Setting
from dogshape.sim.shift.actuation import ForceProfile
from dogshape.sim.shift.clutch import Clutch, OperatingPoint, contact_set, solver_for
from dogshape.sim.shift.mechanism import Mechanism
from dogshape.sim.statistics.blocks import engage
from dogshape.sim.units import DEG, MM, RPM

POINTS = ((10.0, 235.2), (25.0, 469.0), (50.0, 641.5), (149.0, 315.5))
ANGLES = 8
UNSIMULATED_EFFECTS = ("actuation_delay", "relative_angle")  # no simulation of their own
ENGINES = ("drake", "planar")
ACCURACIES = (1e-7, 1e-8, 1e-9)
SHIFTS = 10
MECHANISMS = {
    "none": Mechanism(),
    "spline friction": Mechanism(spline_friction=0.1, spline_radius=17.6 * MM),
    "linkage": Mechanism(compliance=3e-6, added_mass=0.3),
    "free play": Mechanism(free_play=0.5 * MM),
    "shaft with play": Mechanism(ring_inertia=2e-3, input_stiffness=5e3, backlash=0.3 * DEG),
}


def simulate_times(setting: Setting, engine: str) -> NDArray[np.float64]:
    """Simulate shift times at even angles, the time-out without engagement, s, (n,)."""
    clutch = setting.clutch if engine == "drake" else setting.clutch.with_engine(engine)
    angles = (np.arange(ANGLES) + 0.5) / ANGLES * clutch.dog.pitch_angle
    times = []
    for angle in angles:
        shift_time = engage(clutch, setting.point, float(angle)).shift_time
        times.append(clutch.timeout if shift_time is None else shift_time)
    return np.array(times)


def print_effects() -> None:
    """Print the change of the mean by each effect in both engines."""
    study = paper_study()
    effects = load()
    settings = [Setting(study.clutch, point_of(study, *point)) for point in POINTS]
    base = {}
    for engine in ENGINES:
        base[engine] = [simulate_times(setting, engine) for setting in settings]
    print(f"change of the mean over {len(POINTS)} operating points and {ANGLES} angles, ms")
    print(f"{'effect':<22}{'Drake':>9}{'planar':>9}{'differ':>9}{'of Drake':>10}")
    for name, effect in effects.items():
        if name in UNSIMULATED_EFFECTS:
            continue
        values = {p.name: p.at(0.5) for p in effect.parameters}
        settings_with_effect = [effect.apply(setting, values) for setting in settings]
        changes = {}
        for engine in ENGINES:
            times = [simulate_times(setting, engine) for setting in settings_with_effect]
            changes[engine] = 1e3 * float(np.mean(np.subtract(times, base[engine])))
        difference = changes["planar"] - changes["drake"]
        share = f"{abs(difference / changes['drake']):10.2%}" if changes["drake"] else f"{'-':>10}"
        print(
            f"{name:<22}{changes['drake']:9.2f}{changes['planar']:9.2f}{difference:9.3f}{share}",
            flush=True,
        )


def draw_clutch(clutch: Clutch, rng: np.random.Generator) -> Clutch:
    """Draw a design that can be made."""
    while True:
        chamfer, traction, braking = rng.uniform([3, 4, 8], [18, 25, 28]) * DEG
        count = int(rng.integers(8, 30))
        height = float(rng.uniform(2.5, 5)) * MM
        try:
            dog = replace(
                clutch.dog,
                chamfer=chamfer,
                traction=traction,
                braking=braking,
                count=count,
                height=height,
            )
        except DogshapeError:
            continue
        if dog.tip_width > 1.0 * MM:
            return replace(clutch, dog=dog)


def measure_solvers(clutch: Clutch) -> dict[str, tuple[list[float], float]]:
    """Return deviations of shifts from the limit and processor time a shift, s, by solver."""
    solvers: dict[str, Callable[[Clutch], Clutch]] = {
        "compiled": lambda base: base.with_engine("planar")
    }
    for accuracy in ACCURACIES:
        solvers[f"Drake {accuracy:.0e}"] = lambda base, a=accuracy: replace(  # type: ignore[misc]
            base, solver=replace(base.solver, accuracy=a)
        )
    rng = np.random.default_rng(11)
    deviations = {name: list[float]() for name in solvers}
    cpu = dict.fromkeys(solvers, 0.0)
    for _ in range(SHIFTS):
        design = draw_clutch(clutch, rng)
        speed = rng.choice([-60, 25, 60, 149, 249])
        force = rng.choice([235.2, 469.0, 641.5])
        angle = float(rng.uniform(0, design.dog.pitch_angle))
        point = OperatingPoint(float(speed) * RPM, ForceProfile(float(force), 0.15))
        reference = _time(design.with_engine("planar").refined(), point, angle)
        for name, with_solver in solvers.items():
            start = time.process_time()
            deviations[name].append(abs(_time(with_solver(design), point, angle) / reference - 1.0))
            cpu[name] += (time.process_time() - start) / SHIFTS
    return {name: (deviations[name], cpu[name]) for name in solvers}


def _time(clutch: Clutch, point: OperatingPoint, angle: float) -> float:
    return engage(clutch, point, angle).shift_time or clutch.timeout


def print_solver_errors() -> None:
    """Print error and cost of Drake with each mechanism."""
    study = paper_study()
    contact = contact_set("adams2019")
    base = replace(study.clutch, contact=contact, solver=solver_for(contact))
    engage(base.with_engine("planar"), study.points[0], 0.1)  # compiled before it is timed
    print(
        f"\n{'mechanism':<17}{'solver':<13}{'off: median':>12}{'90 %':>8}{'largest':>9}{'CPU s':>9}"
    )
    for name, mechanism in MECHANISMS.items():
        results = measure_solvers(replace(base, mechanism=mechanism))
        for solver, (deviations, cpu) in results.items():
            median, quantile_90 = (100 * float(np.quantile(deviations, q)) for q in (0.5, 0.9))
            print(
                f"{name:<17}{solver:<13}{median:12.4f}{quantile_90:8.3f}"
                f"{100 * max(deviations):9.2f}{cpu:9.3f}",
                flush=True,
            )


if __name__ == "__main__":
    print_effects()
    print_solver_errors()
