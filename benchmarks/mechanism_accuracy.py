"""Error and cost of Drake's scheme ``cenic`` with a mechanism, against the compiled engine.

    python -m benchmarks.mechanism_accuracy

Ten random designs, operating points and relative angles for each mechanism, with the published
contact set. ``off`` is the deviation of a shift's time from that of the compiled engine with finer
steps, percent: median, 90 % quantile, largest; the last column is processor time a shift. A shift
that does not engage counts with the time-out. Takes some three minutes of one processor.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from benchmarks.common import paper_study
from dogshape.sim.engines import engage
from dogshape.sim.errors import DogshapeError
from dogshape.sim.shift.actuation import ForceProfile
from dogshape.sim.shift.clutch import Clutch, OperatingPoint, solver_for
from dogshape.sim.shift.contact import contact_set
from dogshape.sim.shift.mechanism import Mechanism
from dogshape.sim.units import DEG, MM, RPM

ACCURACIES = (1e-7, 1e-8, 1e-9)
SHIFTS = 10
MECHANISMS = {
    "none": Mechanism(),
    "spline friction": Mechanism(spline_friction=0.1, spline_radius=17.6 * MM),
    "linkage": Mechanism(compliance=3e-6, added_mass=0.3),
    "free play": Mechanism(free_play=0.5 * MM),
    "shaft with play": Mechanism(ring_inertia=2e-3, input_stiffness=5e3, backlash=0.3 * DEG),
}


def drawn(clutch: Clutch, rng: np.random.Generator) -> Clutch:
    """Draw a design that can be made."""
    while True:
        chamfer, traction, braking = rng.uniform([3, 4, 8], [18, 25, 28]) * DEG
        count, height = int(rng.integers(8, 30)), float(rng.uniform(2.5, 5)) * MM
        try:
            dog = replace(
                clutch.dog, chamfer=chamfer, traction=traction, braking=braking, count=count,
                height=height,
            )  # fmt: skip
        except DogshapeError:
            continue
        if dog.tip_width > 1.0 * MM:
            return clutch.with_dog(dog)


def measured(clutch: Clutch) -> dict[str, tuple[list[float], float]]:
    """Return deviations of shifts from the limit and processor time a shift, s, by solver."""
    solvers: dict[str, Callable[[Clutch], Clutch]] = {
        "compiled": lambda one: one.with_engine("planar")
    }
    for accuracy in ACCURACIES:
        solvers[f"Drake {accuracy:.0e}"] = lambda one, a=accuracy: replace(  # type: ignore[misc]
            one, solver=replace(one.solver, accuracy=a)
        )
    rng, off = np.random.default_rng(11), {name: list[float]() for name in solvers}
    spent = dict.fromkeys(solvers, 0.0)
    for _ in range(SHIFTS):
        own = drawn(clutch, rng)
        speed, force = rng.choice([-60, 25, 60, 149, 249]), rng.choice([235.2, 469.0, 641.5])
        angle = float(rng.uniform(0, own.dog.pitch_angle))
        point = OperatingPoint(float(speed) * RPM, ForceProfile(float(force), 0.15))
        limit = _time(own.with_engine("planar").refined(), point, angle)
        for name, made in solvers.items():
            start = time.process_time()
            off[name].append(abs(_time(made(own), point, angle) / limit - 1.0))
            spent[name] += (time.process_time() - start) / SHIFTS
    return {name: (off[name], spent[name]) for name in solvers}


def _time(clutch: Clutch, point: OperatingPoint, angle: float) -> float:
    return engage(clutch, point, angle).shift_time or clutch.timeout


def main() -> None:
    """Print the table."""
    study, contact = paper_study(), contact_set("adams2019")
    base = replace(study.clutch, contact=contact, solver=solver_for(contact))
    engage(base.with_engine("planar"), study.points[0], 0.1)  # compiled before it is timed
    print(
        f"{'mechanism':<17}{'solver':<13}{'off: median':>12}{'90 %':>8}{'largest':>9}{'CPU s':>9}"
    )
    for name, mechanism in MECHANISMS.items():
        for solver, (off, spent) in measured(replace(base, mechanism=mechanism)).items():
            median, most = (100 * float(np.quantile(off, q)) for q in (0.5, 0.9))
            print(
                f"{name:<17}{solver:<13}{median:12.4f}{most:8.3f}{100 * max(off):9.2f}{spent:9.3f}",
                flush=True,
            )


if __name__ == "__main__":
    main()
