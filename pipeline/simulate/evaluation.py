"""From a design to what is simulated of it: blocks out, expectation and measured checks back.

Simulated objectives, each with its standard error:

``expected_shift_time_s``
    mean time over the mix, retries included (``sim.statistics.expectation``).
``shift_time_quantile_s``
    time within which the share ``search.quantile`` of all shifts engages
    (``sim.statistics.expectation``).
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

An expected shift time to a wanted standard error, with as few shifts as that needs.

Evenly spaced angles at every operating point; each round has twice the angles of the one
before and holds them. A standard error from few shifts may be small by luck, so none is
believed before there are 24.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field

from dogshape.pipeline.config.operating import OPERATED
from dogshape.pipeline.config.study_file import VARIABLES, Setup
from dogshape.pipeline.progress import WorkCounter
from dogshape.pipeline.simulate.design import (
    REFERRED,
    SIMULATED,
    Design,
    Measured,
    objectives_of,
    simulated_limits,
)
from dogshape.pipeline.simulate.executor import Executor
from dogshape.sim.errors import InputError, did_you_mean
from dogshape.sim.shift.clutch import OperatingPoint
from dogshape.sim.shift.conclusion import Outcome
from dogshape.sim.shift.geometry import Dog
from dogshape.sim.statistics.blocks import Block, even_blocks
from dogshape.sim.statistics.expectation import (
    Estimate,
    Expectation,
    expect,
    expect_point,
    mean_over,
    time_quantile,
)
from dogshape.sim.statistics.shift_records import Record, landing_of, result_of, unfinished
from dogshape.sim.strength.checks import smallest_margin
from dogshape.sim.strength.dog_strength import strength_checks
from dogshape.sim.strength.landing import Demand, demand_checks, demand_of, exceeded, hardest
from dogshape.sim.strength.manufacture import require_makeable
from dogshape.sim.units import RPM
from dogshape.surrogate.covariance import Array
from dogshape.surrogate.dataset import rows_of


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


def _peak_force(row: Record) -> float:
    return math.hypot(row["peak_axial_force_N"], row["peak_tangential_force_N"])


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
    "peak_impact_force_N": lambda shifts: _mean_of(shifts, _peak_force),
    "smallest_margin": lambda shifts: Estimate(smallest_margin(shifts.design.checks).margin, 0.0),
}


def estimates_of(shifts: Shifts) -> dict[str, Estimate]:
    """Compute the expected shift time, all simulated objectives and all limited quantities."""
    return {name: ESTIMATORS[name](shifts) for name in estimated(shifts.study)}


def estimated(study: Setup) -> list[str]:
    """Return the names of what the shifts of a design are to say, each once."""
    named = [objective.name for objective in objectives_of(study) if objective.simulated]
    return list(dict.fromkeys([SIMULATED, *named, *simulated_limits(study)]))


NEW_ANGLES = 7919  #: added to the seed of the search for relative angles that it did not use

Params = dict[str, float]  #: searched keys of a design, edge units


@dataclass(frozen=True)
class Simulated:
    """Expectation and loads from the shifts of a design.

    Parameters
    ----------
    expectation : shift time over all operating points.
    measured : values that the checks are judged by.
    rows : for the surrogate, one for each operating point, as ``surrogate.dataset.rows_of``.
    estimates : all simulated objectives, by name.
    shifts : number of shifts; ``unfinished`` of them the clock ended.
    failed : number of shifts whose integration failed, by reason.
    """

    expectation: Expectation
    measured: Measured
    rows: Array
    estimates: dict[str, Estimate]
    shifts: int
    unfinished: int = 0
    failed: Mapping[str, int] = field(default_factory=dict)

    @property
    def known(self) -> bool:
        """Whether the shifts say every simulated objective: not where all of them failed."""
        return all(math.isfinite(estimate.value) for estimate in self.estimates.values())


def design_blocks(study: Setup, params: Params, angles: int, seed: int) -> list[Block]:
    """Return the shifts of a design at even angles, a block for each of its operating points."""
    own, clutch = study.operated(params), study.clutch.with_dog(study.dog_with(params))
    return even_blocks(clutch, own.points, angles, seed, uncertainty=study.uncertainty)


def reference_blocks(study: Setup, angles: int, seed: int) -> list[Block]:
    """Return the shifts of ``search.reference``; none where no objective or limit refers to it."""
    if REFERRED not in estimated(study):
        return []
    clutch = study.clutch.with_dog(reference_of(study))
    return even_blocks(clutch, study.points, angles, seed, uncertainty=study.uncertainty)


def evaluate(
    study: Setup,
    designs: Sequence[Params],
    executor: Executor,
    angles: int,
    seed: int,
    *,
    require_made: bool = True,
) -> list[Simulated]:
    """Simulate designs side by side, ``angles`` at every operating point, and evaluate them.

    Raises GeometryError for a dog that cannot be made, before anything is simulated; not without
    ``require_made``.
    """
    for params in designs if require_made else []:
        require_makeable(study.dog_with(params), study.limits.manufacturing)
    blocks = [design_blocks(study, params, angles, seed) for params in designs]
    referred = reference_blocks(study, angles, seed)
    found = iter(executor.run([block for group in (*blocks, referred) for block in group]))
    shifts = [[next(found) for _ in group] for group in blocks]
    others = [next(found) for _ in referred]
    beside = expectation_of(study, [b.point for b in referred], others) if referred else None
    return [
        _simulated(study, params, [b.point for b in group], rows, beside)
        for params, group, rows in zip(designs, blocks, shifts, strict=True)
    ]


def _simulated(
    nominal: Setup,
    params: Params,
    points: Sequence[OperatingPoint],
    rows: Sequence[Sequence[Record]],
    reference: Expectation | None,
) -> Simulated:
    study, dog = nominal.operated(params), nominal.dog_with(params)
    expectation = expectation_of(study, points, rows)
    demand = demand_over(study, dog, expectation, rows)
    checks = strength_checks(dog, study.limits) + demand_checks(demand, study.limits)
    design = Design({}, dog, checks, "")
    estimates = estimates_of(Shifts(study, design, expectation, rows, reference))
    limited = {name: estimates[name].value for name in simulated_limits(study)}
    # Shifts whose integration failed say nothing of engagement.
    share = min((p.engaged for p in expectation.points if p.n), default=1.0)
    shifts = [shift for mine in rows for shift in mine]
    return Simulated(
        expectation,
        Measured(demand, limited, share),
        rows_of(tuple(study.variables), _as_searched(nominal, study.operation, rows)),
        estimates,
        len(shifts),
        sum(map(unfinished, shifts)),
        failures(shifts),
    )


def failures(shifts: Iterable[Record]) -> dict[str, int]:
    """Count the shifts whose integration failed, by the reason; they have no time."""
    failed = [row for row in shifts if row["outcome"] == Outcome.DIVERGED.value]
    reasons = (str(row.get("reason", Outcome.DIVERGED.message)) for row in failed)
    return dict(Counter(reason.partition(", at ")[0] for reason in reasons))


def _as_searched(
    study: Setup, operation: Mapping[str, float], rows: Sequence[Sequence[Record]]
) -> list[Record]:
    """Rewrite shifts of a design that is operated in its own way as the search sees them.

    Set-point, force and rise are variables of the design to it, and an operating point is one of
    the study's own, so that designs that are operated differently meet at the same points. A shift
    has the moved point in its record instead.
    """
    if not study.searches_operation:
        return [shift for mine in rows for shift in mine]
    keys = [key for key in study.variables if key in OPERATED]
    own = {key: operation.get(key, study.prototype[key]) for key in keys}
    return [
        {**shift, "mismatch_rpm": point.mismatch / RPM, **point.profile.record, **own}
        for point, mine in zip(study.points, rows, strict=True)
        for shift in mine
    ]


def reference_of(study: Setup) -> Dog:
    """Build the dog that ``search.reference`` names; the study's own without it."""
    given = study.file.search.reference or {}
    for key in given:
        if key not in VARIABLES:
            hint = did_you_mean(key, VARIABLES)
            raise InputError(f"search.reference has '{key}', which is no key of the dog; {hint}")
    return study.dog_with(dict(given))


def demand_over(
    study: Setup, dog: Dog, expectation: Expectation, rows: Sequence[Sequence[Record]]
) -> Demand:
    """Compute what landings make the dogs bear: the hardest, or what a share of them exceeds."""
    limits, share = study.limits, study.limits.load.landing_share
    if share is None:
        return demand_of(dog, hardest(landing_of(row) for mine in rows for row in mine), limits)
    weights = [
        found.point.weight / len(mine)
        for found, mine in zip(expectation.points, rows, strict=True)
        for _ in mine
    ]
    every = [demand_of(dog, landing_of(row), limits) for mine in rows for row in mine]
    return exceeded(every, weights, share)


def expectation_of(
    study: Setup,
    points: Sequence[OperatingPoint],
    rows: Sequence[Sequence[Record]],
    even: bool = True,
) -> Expectation:
    """Return the expectation over points from the records of each."""
    timeout = study.clutch.timeout
    return expect(
        [
            expect_point(point, [result_of(r) for r in mine], timeout, study.retraction, even=even)
            for point, mine in zip(points, rows, strict=True)
        ]
    )


FIRST = 6  #: angles of the first round
ENOUGH = 24  #: shifts from which a standard error is believed
MOST = 96  #: angles of the last round


@dataclass(frozen=True)
class Precise:
    """An expectation with the blocks and records it came from."""

    expectation: Expectation
    blocks: list[Block]
    rows: list[list[Record]]


def expect_to(
    study: Setup,
    points: Sequence[OperatingPoint],
    precision: float,
    executor: Executor,
    progress: WorkCounter,
) -> Precise:
    """Return the expectation over ``points`` to a relative standard error ``precision``.

    Where that cannot be reached, the last round is returned and progress says why.
    """
    count, seed = FIRST, study.file.expectation.seed
    while True:
        unsure = study.uncertainty
        blocks = even_blocks(study.clutch, points, count, seed, FIRST, uncertainty=unsure)
        rows = executor.run(blocks)
        found = expectation_of(study, points, rows)
        share = found.standard_error / found.mean
        shifts = len(points) * count
        if any(p.mean_engaged is None for p in found.points):
            progress.say("nothing engages at some operating point: no precision can be reached")
        elif share > precision and count >= MOST:
            progress.say(f"{share:.1%} is what {MOST} angles at each operating point give")
        elif share > precision or shifts < ENOUGH:
            few = ", from too few to trust" if share <= precision else ""
            progress.say(f"standard error {share:.1%} from {shifts} shifts{few}; twice the angles")
            count *= 2
            progress.extend(shifts)
            continue
        return Precise(found, blocks, rows)
