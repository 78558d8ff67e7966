"""Objectives that follow from the shifts of a design, each with its standard error.

``expected_shift_time_s``
    mean time over the mix, retries included (``sim.statistics.expectation``).
``shift_time_quantile_s``
    time within which the share ``search.quantile`` of all shifts engages
    (``sim.statistics.estimate``).
``worst_shift_time_s``
    largest expected time of any operating point, with that point's standard error. Of many points
    with errors alike the largest is too large by one to two of them.
``slower_than_reference_s``
    largest difference of the expected times of design and ``search.reference`` at any operating
    point, both at the same relative angles; errors count as independent.
``first_try_share``
    share of all shifts that engage within ``search.within_s``, retries left out.
``peak_axial_force_N``, ``strike_torque_Nm``, ``impact_impulse_Ns``, ``impact_energy_J``
    means over the mix of each shift's largest axial force and torque of the contact, hardest
    impulse within a millisecond and energy that the contact took (``sim.shift.loads``).
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

from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.simulate.design import (
    REFERRED,
    SIMULATED,
    Design,
    objectives_of,
    simulated_limits,
)
from dogshape.sim.shift.conclusion import Outcome
from dogshape.sim.statistics.estimate import Estimate, mean_over, time_quantile
from dogshape.sim.statistics.expectation import Expectation
from dogshape.sim.statistics.shift_records import Record, result_of
from dogshape.sim.strength.checks import smallest_margin


@dataclass(frozen=True)
class Shifts:
    """All shifts of a design: records of each operating point and what they gave.

    ``design`` knows its hardest landing; ``reference`` is the expectation of ``search.reference``
    at the same points, None where nothing refers to it.
    """

    study: Setup
    design: Design
    expectation: Expectation
    rows: Sequence[Sequence[Record]]
    reference: Expectation | None = None

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


def _worst_time(shifts: Shifts) -> Estimate:
    slowest = max(shifts.expectation.points, key=lambda point: point.mean)
    return Estimate(slowest.mean, slowest.standard_error)


def _slower(shifts: Shifts) -> Estimate:
    if shifts.reference is None:
        raise ValueError("the reference was not simulated")
    pairs = zip(shifts.expectation.points, shifts.reference.points, strict=True)
    one, other = max(pairs, key=lambda pair: pair[0].mean - pair[1].mean)
    error = math.hypot(one.standard_error, other.standard_error)
    return Estimate(one.mean - other.mean, error)


def _first_try(shifts: Shifts) -> Estimate:
    within = shifts.study.file.search.within_s or shifts.study.clutch.timeout
    engaged = [
        [
            float(row["shift_time_s"] is not None and row["shift_time_s"] <= within)
            for row in mine
            if Outcome(row["outcome"]) is not Outcome.DIVERGED
        ]
        for mine in shifts.rows
    ]
    return mean_over(shifts.weights, engaged)


def _peak_force(shifts: Shifts) -> Estimate:
    return _mean_of(
        shifts, lambda row: math.hypot(row["peak_axial_force_N"], row["peak_tangential_force_N"])
    )


def _strike_torque(shifts: Shifts) -> Estimate:
    dog = shifts.design.dog
    radius = 0.0 if dog is None else dog.mean_radius
    return _mean_of(shifts, lambda row: radius * row["peak_tangential_force_N"])


def _mean_of(shifts: Shifts, value: Callable[[Record], float]) -> Estimate:
    """Compute the mean over the mix of what each shift that did not fail has."""
    values = [
        [value(row) for row in mine if Outcome(row["outcome"]) is not Outcome.DIVERGED]
        for mine in shifts.rows
    ]
    return mean_over(shifts.weights, values)


def _mean_key(name: str) -> Callable[[Shifts], Estimate]:
    return lambda shifts: _mean_of(shifts, lambda row: float(row[name]))


def _smallest_margin(shifts: Shifts) -> Estimate:
    return Estimate(smallest_margin(shifts.design.checks).margin, 0.0)


#: What each simulated objective is worked out by.
ESTIMATORS: dict[str, Callable[[Shifts], Estimate]] = {
    SIMULATED: _expected_time,
    "shift_time_quantile_s": _quantile,
    "worst_shift_time_s": _worst_time,
    REFERRED: _slower,
    "first_try_share": _first_try,
    "peak_axial_force_N": _mean_key("peak_axial_force_N"),
    "strike_torque_Nm": _strike_torque,
    "impact_impulse_Ns": _mean_key("impact_impulse_Ns"),
    "impact_energy_J": _mean_key("energy_dissipated_J"),
    "peak_impact_force_N": _peak_force,
    "smallest_margin": _smallest_margin,
}


def estimates_of(shifts: Shifts) -> dict[str, Estimate]:
    """Compute the expected shift time, all simulated objectives and all limited quantities."""
    return {name: ESTIMATORS[name](shifts) for name in estimated(shifts.study)}


def estimated(study: Setup) -> list[str]:
    """Return the names of what the shifts of a design are to say, each once."""
    named = [objective.name for objective in objectives_of(study) if objective.simulated]
    return list(dict.fromkeys([SIMULATED, *named, *simulated_limits(study)]))
