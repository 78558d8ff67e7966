"""Error of an expected time from even angles, and from angles that lie closer where times jump.

    python -m benchmarks.halved_angles

Designs that fill the space of ``mq200_paper``, at its operating points in the compiled engine. Each
point has 64 even angles, whose mean is the yardstick, and 16 as a fit in two levels has them: eight
even ones of a start of their own and eight that halve intervals (``sim.statistics.bisection``).
Even angles are some of the 64. Errors are root-mean-squares over the designs, of the expected time
over all points; what each says of its own error stands beside.
"""

from __future__ import annotations

import numpy as np

from dogshape.pipeline.config.study_file import Setup, load_study
from dogshape.pipeline.train.mix_rows import ROUNDS
from dogshape.pipeline.train.reference_designs import reference_designs
from dogshape.pipeline.train.training_rows import study_mix
from dogshape.pipeline.train.two_level_rows import compiled
from dogshape.sim.engines import engage
from dogshape.sim.shift.clutch import Clutch, OperatingPoint
from dogshape.sim.statistics.bisection import halves, mean_round_the_pitch
from dogshape.sim.statistics.expectation import even_phases, variance_of_mean
from dogshape.surrogate.covariance import Array

DESIGNS, MANY, FEW = 24, 64, 8
EVEN = (8, 16, 32)
HALVED = "8 even, 8 halving"


def times(clutch: Clutch, point: OperatingPoint, phases: Array) -> Array:
    """Simulate shifts at fractions of a pitch (n,); NaN for a time where none engaged, (n,), s."""
    angles = (phases * clutch.dog.pitch_angle).tolist()
    found = [engage(clutch, point, angle).shift_time for angle in angles]
    return np.array([np.nan if time is None else time for time in found])


def of_even(shifts: Array) -> tuple[float, float]:
    """Return mean, s, and its variance, s2, of even angles (n,)."""
    engaged = shifts[np.isfinite(shifts)]
    return float(engaged.mean()), variance_of_mean(engaged, even=len(engaged) == len(shifts))


def of_halved(clutch: Clutch, point: OperatingPoint, draw: tuple[int, int]) -> tuple[float, float]:
    """Return the same of angles that lie closer where the time jumps."""
    phases = even_phases(FEW, *draw)
    shifts = times(clutch, point, phases)
    for count in ROUNDS:
        nearer = halves(phases, shifts, count)
        phases = np.append(phases, nearer)
        shifts = np.append(shifts, times(clutch, point, nearer))
    return mean_round_the_pitch(phases, shifts)


def measured(study: Setup) -> dict[str, Array]:
    """Return mean and variance of each way to take angles, of designs at points, (k, m, 2)."""
    names = (f"{MANY} even", *(f"{n} even" for n in EVEN), HALVED)
    found = {name: np.zeros((DESIGNS, len(study.points), 2)) for name in names}
    for index, design in enumerate(reference_designs(study, DESIGNS)):
        clutch = study.clutch.with_dog(study.dog_with(design))
        for place, point in enumerate(study.points):
            whole = times(clutch, point, even_phases(MANY, index, place))
            for n in (MANY, *EVEN):
                found[f"{n} even"][index, place] = of_even(whole[:: MANY // n])
            found[HALVED][index, place] = of_halved(clutch, point, (DESIGNS + index, place))
    return found


def main() -> None:
    """Print the table."""
    study = compiled(load_study("mq200_paper"))
    weights = study_mix(study).weights
    found = measured(study)
    known = found[f"{MANY} even"][:, :, 0] @ weights
    print(f"{DESIGNS} designs at {len(study.points)} operating points; ms")
    print("angles of a point    error  said of it   mean error")
    for name, rows in found.items():
        apart = 1e3 * (rows[:, :, 0] @ weights - known)
        said = 1e3 * float(np.sqrt((rows[:, :, 1] @ weights**2).mean()))
        error = "     -" if name == f"{MANY} even" else f"{np.sqrt((apart**2).mean()):6.2f}"
        mean = "" if name == f"{MANY} even" else f"{apart.mean():+12.2f}"
        print(f"{name:18s}  {error}  {said:10.2f} {mean}")


if __name__ == "__main__":
    main()
