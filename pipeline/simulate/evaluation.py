"""From a design to what is simulated of it: blocks out, expectation and measured checks back."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

from dogshape.pipeline.config.set_point import OPERATED
from dogshape.pipeline.config.study_file import VARIABLES, Setup
from dogshape.pipeline.simulate.design import REFERRED, Design, Measured, simulated_limits
from dogshape.pipeline.simulate.estimates import Shifts, estimated, estimates_of
from dogshape.pipeline.simulate.executor import Executor
from dogshape.sim.errors import InputError, did_you_mean
from dogshape.sim.shift.clutch import OperatingPoint
from dogshape.sim.shift.geometry import Dog
from dogshape.sim.shift.outcome import Outcome
from dogshape.sim.statistics.blocks import Block, even_blocks
from dogshape.sim.statistics.estimate import Estimate
from dogshape.sim.statistics.expectation import Expectation, expect, expect_point
from dogshape.sim.statistics.shift_records import Record, landing_of, result_of, unfinished
from dogshape.sim.strength.dog_strength import strength_checks
from dogshape.sim.strength.landing import Demand, demand_checks, demand_of, exceeded, hardest
from dogshape.sim.strength.manufacture import require_makeable
from dogshape.sim.units import RPM
from dogshape.surrogate.covariance import Array
from dogshape.surrogate.dataset import rows_of

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
