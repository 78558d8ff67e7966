"""From a design to what is simulated of it: blocks out, expectation and measured checks back."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from dogshape.pipeline.config.operating import OPERATED
from dogshape.pipeline.config.study_file import VARIABLES, Setup
from dogshape.pipeline.simulate.design import (
    REFERRED,
    SIMULATED,
    Design,
    Measured,
    simulated_limits,
)
from dogshape.pipeline.simulate.estimates import Shifts, estimated, estimates_of
from dogshape.pipeline.simulate.executor import Executor
from dogshape.pipeline.simulate.level_times import (
    LevelTimes,
    common_squares,
    level_times,
    parts_of,
)
from dogshape.pipeline.simulate.operated_shifts import as_searched
from dogshape.pipeline.simulate.point_plans import Plan, blocks_of, whole_plan
from dogshape.sim.errors import InputError, did_you_mean
from dogshape.sim.shift.clutch import OperatingPoint
from dogshape.sim.shift.geometry import Dog
from dogshape.sim.statistics.blocks import Block
from dogshape.sim.statistics.estimate import Estimate
from dogshape.sim.statistics.expectation import Expectation, expect, expect_point
from dogshape.sim.statistics.numerical_error import numerical_error
from dogshape.sim.statistics.shift_records import Record, landing_of, result_of, unfinished
from dogshape.sim.strength.dog_strength import strength_checks
from dogshape.sim.strength.landing import Demand, demand_checks, demand_of, exceeded, hardest
from dogshape.sim.strength.manufacture import require_makeable
from dogshape.surrogate.covariance import Array
from dogshape.surrogate.dataset import rows_of

NEW_ANGLES = 7919  #: added to the seed of the search for relative angles that it did not use


@dataclass(frozen=True)
class Simulated:
    """Expectation and loads from the shifts of a design.

    Expected shift time over the operating points that were simulated, what checks are judged by, a
    row for the surrogate from each, as ``surrogate.dataset.rows_of`` gives them, all simulated
    objectives by name, and how many of the shifts the clock ended. ``parts`` are the shifts of each
    operating point (``pipeline.simulate.level_times.parts_of``), ``levels`` those of both engines
    where all of this rests on both.
    """

    expectation: Expectation
    measured: Measured
    rows: Array
    estimates: dict[str, Estimate]
    unfinished: int = 0
    parts: tuple[Array, ...] = ()
    levels: LevelTimes | None = None

    @property
    def known(self) -> bool:
        """Whether the shifts say every simulated objective: not where all of them failed."""
        return all(math.isfinite(estimate.value) for estimate in self.estimates.values())


def evaluate(
    study: Setup,
    dogs: Sequence[Dog],
    executor: Executor,
    plans: Sequence[Plan],
    seed: int,
    *,
    base: int | None = None,
    checked: bool = False,
    operated: Sequence[Setup] | None = None,
    referred: Sequence[Block] | None = None,
) -> list[Simulated]:
    """Simulate the shifts of several designs side by side and evaluate them.

    ``plans`` say what is simulated of each, with ``base`` as for
    ``sim.statistics.expectation.even_phases``. ``checked`` adds the numerical error, from an eighth
    of the shifts repeated. ``operated`` is the study as each design is operated, itself if not
    given. ``referred`` are the blocks of the reference at the plan that all designs have, where
    they are at hand. Raises GeometryError for a dog that cannot be made, before anything is
    simulated; not with ``checked``, where the prototype is compared with, whatever it breaks.
    """
    each = operated or [study] * len(dogs)
    for dog in [] if checked else dogs:
        require_makeable(dog, study.limits.manufacturing)
    blocks = [
        blocks_of(own, study.clutch.with_dog(dog), plan, seed, base)
        for own, dog, plan in zip(each, dogs, plans, strict=True)
    ]
    # The same shifts of the reference belong to several designs: the journal holds each once.
    alike = {
        plan: _referred(study, [*plan], seed, base) if referred is None else referred
        for plan in dict.fromkeys(map(tuple, plans))
    }
    asked = [block for groups in (blocks, alike.values()) for group in groups for block in group]
    taken = iter(executor.run(asked))
    of_designs = [[next(taken) for _ in group] for group in blocks]
    of_reference = {plan: [next(taken) for _ in group] for plan, group in alike.items()}
    results = []
    for k, (dog, group, mine) in enumerate(zip(dogs, blocks, of_designs, strict=True)):
        plan = tuple(plans[k])
        result = expectation_of(study, [b.point for b in group], mine)
        others, where = of_reference[plan], [b.point for b in alike[plan]]
        beside = expectation_of(study, where, others) if others else None
        if checked:
            result = replace(result, numerical_error=numerical_error(group, mine, executor.run))
        learned = _learned(study, each[k].operation, plans[k], mine)
        results.append(_simulated(each[k], dog, result, mine, beside, learned=learned))
    return results


def screen(
    study: Setup,
    dogs: Sequence[Dog],
    executor: Executor,
    seed: int,
    operated: Sequence[Setup] | None = None,
    *,
    angles: int | None = None,
    base: int | None = None,
) -> list[Simulated | None]:
    """Simulate by the compiled engine what checks are judged by; None where the study does not.

    At ``search.screen_angles`` relative angles of every operating point, far more than Drake could
    simulate: landings are rare events, and the loss on a reference is the largest of many numbers.
    Its shifts are not kept: a design takes seconds. ``angles`` are other than the study's, which
    hold ``base`` of a coarser draw (``sim.statistics.expectation.even_phases``).
    """
    angles = angles or study.file.search.screen_angles
    if angles is None:
        return [None] * len(dogs)
    quick = replace(study, clutch=study.clutch.with_engine("planar"))
    plans = [whole_plan(quick, angles)] * len(dogs)
    own = None if operated is None else [replace(one, clutch=quick.clutch) for one in operated]
    referred = _referred(quick, whole_plan(quick, angles), seed, base)
    with executor.apart(referred) as running:
        found = evaluate(
            quick, dogs, running, plans, seed, base=base, operated=own, referred=referred
        )
    return [*found]


def in_two_levels(
    study: Setup, screened: Sequence[Simulated], found: Sequence[Simulated], seed: int, base: int
) -> list[Simulated]:
    """Correct screened designs by their shifts of Drake at some of the same angles.

    Expected times then rest on both engines (``pipeline.simulate.level_times``), checks and rows
    of the surrogate on the compiled one's many shifts. ``base`` angles of ``seed`` are those that
    all counts of angles hold.
    """
    return [
        _both(study, quick, one, seed, base) for quick, one in zip(screened, found, strict=True)
    ]


def _both(study: Setup, quick: Simulated, one: Simulated, seed: int, base: int) -> Simulated:
    levels = level_times(study, quick.parts, one.parts, seed, base)
    squares = common_squares(study, levels.squares)
    variances = levels.compiled_variances + levels.correction_variances(squares)
    shifted = levels.apart.mean(axis=1)
    points = []
    for k, (alone, beside) in enumerate(
        zip(one.expectation.points, quick.expectation.points, strict=True)
    ):
        engaged = None if beside.mean_engaged is None else beside.mean_engaged + float(shifted[k])
        points.append(
            replace(
                alone,
                mean=float(levels.means[k] + shifted[k]),
                mean_engaged=engaged,
                standard_error=math.sqrt(variances[k]),
                sd=beside.sd,
                n_planar=levels.many,
            )
        )
    found = replace(expect(points), numerical_error=one.expectation.numerical_error)
    parts = tuple((levels.weights**2 * variances).tolist())
    time = Estimate(found.mean, found.standard_error, parts)
    return replace(
        quick,
        expectation=found,
        estimates={**quick.estimates, SIMULATED: time},
        unfinished=one.unfinished,
        levels=levels,
    )


def _referred(study: Setup, plan: Plan, seed: int, base: int | None = None) -> list[Block]:
    """Return the blocks of the reference at a design's angles; none where nothing refers to it."""
    if REFERRED not in estimated(study):
        return []
    return blocks_of(study, study.clutch.with_dog(reference_of(study)), plan, seed, base)


def reference_of(study: Setup) -> Dog:
    """Build the dog that ``search.reference`` names; the study's own without it."""
    given = study.file.search.reference or {}
    for key in given:
        if key not in VARIABLES:
            hint = did_you_mean(key, VARIABLES)
            raise InputError(f"search.reference has '{key}', which is no key of the dog; {hint}")
    return study.dog_with(dict(given))


def _simulated(
    study: Setup,
    dog: Dog,
    expectation: Expectation,
    rows: Sequence[Sequence[Record]],
    reference: Expectation | None,
    *,
    learned: Array,
) -> Simulated:
    shifts = [row for mine in rows for row in mine]
    demand = demand_over(study, dog, expectation, rows)
    checks = strength_checks(dog, study.limits) + demand_checks(demand, study.limits)
    found = Shifts(study, Design({}, dog, checks, ""), expectation, rows, reference)
    estimates = estimates_of(found)
    limited = {n: estimates[n].value for n in simulated_limits(study)}
    # Shifts whose integration failed say nothing of engagement.
    share = min((p.engaged for p in expectation.points if p.n), default=1.0)
    measured = Measured(demand, limited, share)
    ended = sum(map(unfinished, shifts))
    lost = study.clutch.timeout + study.retraction
    parts = tuple(parts_of([result_of(row) for row in mine], lost) for mine in rows)
    return Simulated(expectation, measured, learned, estimates, ended, parts)


def _learned(
    study: Setup, operation: Mapping[str, float], plan: Plan, rows: Sequence[Sequence[Record]]
) -> Array:
    """Compute what the surrogate learns from the shifts of a plan, by operating point."""
    points = [point for point, count in zip(study.points, plan, strict=True) if count]
    keys = [key for key in study.variables if key in OPERATED]
    whole = {key: operation.get(key, study.prototype[key]) for key in keys}
    told = [as_searched(whole, *pair) for pair in zip(points, rows, strict=True)]
    return rows_of(tuple(study.variables), [shift for shifts in told for shift in shifts])


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
