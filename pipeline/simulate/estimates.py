"""Objectives that follow from the shifts of a design, each with its standard error.

``expected_shift_time_s``
    mean time over the mix, retries included (``sim.statistics.expectation``).
``shift_time_quantile_s``
    time within which the share ``search.quantile`` of all shifts engages
    (``sim.statistics.estimate``).
``peak_impact_force_N``
    mean over the mix of each shift's peak contact force: the root of the squares of its largest
    axial and its largest tangential force, which need not come at one time, so it is at
    least their resultant. The forces are those of the whole ring, means over one step of the
    integration, of rigid rings on the stiffness of the dogs, with which they grow. A shift that
    does not engage counts with what it struck; one whose integration failed is left out. Where all
    failed it is NaN: the design counts as not simulated.
``smallest_margin``
    of all checks, the hardest simulated landing among them. Most margins are exact and the
    landing's is an extreme, so no standard error is given: it is zero.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from dogshape.pipeline.config.study_file import Study
from dogshape.pipeline.simulate.design import SIMULATED, Design, objectives_of
from dogshape.sim.shift.outcome import Outcome
from dogshape.sim.statistics.estimate import Estimate, mean_over, time_quantile
from dogshape.sim.statistics.expectation import Expectation
from dogshape.sim.statistics.shift_records import Record, result_of
from dogshape.sim.strength.checks import smallest_margin


@dataclass(frozen=True)
class Shifts:
    """All shifts of a design: records of each operating point and what they gave.

    ``design`` knows its hardest landing.
    """

    study: Study
    design: Design
    expectation: Expectation
    rows: Sequence[Sequence[Record]]

    @property
    def weights(self) -> list[float]:
        """Weights of the operating points."""
        return [found.point.weight for found in self.expectation.points]


def _expected_time(shifts: Shifts) -> Estimate:
    found = shifts.expectation
    errors = (p.standard_error for p in found.points)
    parts = tuple((w * error) ** 2 for w, error in zip(shifts.weights, errors, strict=True))
    return Estimate(found.mean, found.standard_error, parts)


def _quantile(shifts: Shifts) -> Estimate:
    study = shifts.study
    results = [[result_of(row) for row in mine] for mine in shifts.rows]
    share, timeout = study.file.search.quantile, study.clutch.timeout
    return time_quantile(shifts.weights, results, share, timeout, study.retraction)


def _peak_force(shifts: Shifts) -> Estimate:
    peaks = [
        [
            math.hypot(row["peak_axial_force_N"], row["peak_tangential_force_N"])
            for row in mine
            if Outcome(row["outcome"]) is not Outcome.DIVERGED
        ]
        for mine in shifts.rows
    ]
    return mean_over(shifts.weights, peaks)


def _smallest_margin(shifts: Shifts) -> Estimate:
    return Estimate(smallest_margin(shifts.design.checks).margin, 0.0)


#: What each simulated objective is worked out by.
ESTIMATORS: dict[str, Callable[[Shifts], Estimate]] = {
    SIMULATED: _expected_time,
    "shift_time_quantile_s": _quantile,
    "peak_impact_force_N": _peak_force,
    "smallest_margin": _smallest_margin,
}


def estimates_of(shifts: Shifts) -> dict[str, Estimate]:
    """Return the expected shift time and all simulated objectives of the study, by name."""
    named = [objective.name for objective in objectives_of(shifts.study) if objective.simulated]
    return {name: ESTIMATORS[name](shifts) for name in dict.fromkeys([SIMULATED, *named])}
