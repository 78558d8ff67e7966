"""An expected shift time of Drake's to a wanted standard error, most of it by the compiled engine.

Each operating point begins with ``MANY`` angles in the compiled engine, since times rise steeply
before a slot is missed, at a thirtieth of the angles: fewer would often have none there, and look
exact. Of these Drake has ``FEW``, or up to ``SURE``: a shift in another slot differs by about a
mean time, so fewer pairs than ``RARE`` over the precision say too little of those that none has.

Each round gives more angles where they take most of the variance for their cost, as many as the
precision should need: twice as many of one engine at one operating point, which hold those before.
The variance of the compiled engine's mean is expected to fall as 1/N2, that of the differences
as 1/n (``sim.statistics.two_levels``).

Where ``SURE`` pairs say that the compiled engine does not halve the variance of Drake's own mean,
the operating point goes on with Drake alone, and its even angles count as in one level.

A shift that does not engage costs ten times one that does. So where one pair engages in one engine
alone, every operating point gets ``SURE`` pairs, whatever its own say.

Rounds follow from the shifts alone, so a run that was stopped goes on as it would have.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.forecast import Kind
from dogshape.pipeline.progress import WorkCounter
from dogshape.pipeline.simulate.block_cost import FINE
from dogshape.pipeline.simulate.executor import Executor
from dogshape.pipeline.simulate.precision import ENOUGH, FIRST, MOST, Precise
from dogshape.sim.shift.clutch import Clutch, OperatingPoint
from dogshape.sim.statistics.blocks import Block, even_block
from dogshape.sim.statistics.expectation import (
    PointExpectation,
    expect,
    expect_point,
    nested,
)
from dogshape.sim.statistics.numerical_error import repeated
from dogshape.sim.statistics.shift_records import Record, result_of
from dogshape.sim.statistics.two_levels import TwoLevelPoint, common_spreads, two_level_point

FEW = 3  #: angles of the first round in Drake: the fewest that tell an error
MANY = 48  #: angles of the first round in the compiled engine, at least
MOST_MANY = 16 * MOST  #: angles of the last round in the compiled engine
RARE = 0.8  #: mean shift times by which a shift of both engines differs where it does at all
SURE = 24  #: pairs of an operating point that are believed, and from which it may turn to Drake
HELPS = 0.5  #: of the variance of Drake's own mean, the most that the compiled engine may leave
COST = 1.0 / 25.0  #: of a shift, compiled over Drake's (docs/evidence/engines.txt)

#: What is left of a variance with twice the angles.
SMOOTH, SCATTERED = 0.25, 0.5

#: Variance that the second round usually leaves over the wanted one; only the time left uses it.
#: It takes shifts of the compiled engine: more of Drake are seldom asked for.
AGAIN = 1.1


@dataclass(frozen=True)
class Angles:
    """Numbers of angles at one operating point: Drake's, and the compiled engine's, 0 for none."""

    few: int
    many: int

    @property
    def more_few(self) -> Angles:
        """The same with twice Drake's, and no fewer of the compiled engine."""
        return Angles(2 * self.few, max(self.many, 2 * self.few) if self.many else 0)

    @property
    def more_many(self) -> Angles:
        """The same with twice the compiled engine's."""
        return replace(self, many=2 * self.many)


@dataclass(frozen=True)
class Step:
    """Twice the angles of one engine at one operating point.

    ``gain`` is what the variance of the mean loses by it, s2, ``cost`` in shifts of Drake; ``few``
    are those of Drake.
    """

    place: int
    gain: float
    cost: float
    few: bool

    @property
    def worth(self) -> float:
        """Gain for the cost."""
        return self.gain / self.cost

    def angles(self, before: Angles) -> Angles:
        """Give the angles after it."""
        return before.more_few if self.few else before.more_many


@dataclass(frozen=True)
class Part:
    """An operating point in a round: its angles, Drake's shifts, and what all shifts say.

    ``levels`` is what both engines say, None where no shift engaged; where Drake stands alone it is
    that of the pairs which decided so. ``spread`` is that of differences, s2.
    """

    angles: Angles
    block: Block
    rows: list[Record]
    alone: PointExpectation
    levels: TwoLevelPoint | None
    spread: float = 0.0

    @property
    def two(self) -> TwoLevelPoint | None:
        """Both levels, None where Drake stands alone."""
        return self.levels if self.angles.many else None

    @property
    def expectation(self) -> PointExpectation:
        """Expectation of the point in both levels, or by Drake alone."""
        return self.two.expectation(self.spread) if self.two else self.alone

    @property
    def variances(self) -> tuple[float, float]:
        """Variances of the compiled engine's mean, or Drake's alone, and of the differences, s2."""
        if self.two is None:
            return self.alone.standard_error**2, 0.0
        return self.two.cheap_variance, self.spread / self.angles.few

    @property
    def helped(self) -> bool:
        """Test that the compiled engine is worth its shifts, or that it is too early to say."""
        if self.angles.few < SURE or self.two is None:
            return True
        # Drake's own few angles look exact where they miss what the many of the other show.
        own = max(self.alone.standard_error**2, self.two.coarse_variance)
        return sum(self.variances) < HELPS * own

    @property
    def drake_alone(self) -> Part:
        """The same point in one level."""
        return replace(self, angles=Angles(self.angles.few, 0))

    @property
    def barren(self) -> bool:
        """Test that none of enough shifts engaged."""
        return self.alone.mean_engaged is None and self.angles.few >= FIRST

    def steps(self, place: int, factor: float) -> list[Step]:
        """List what more angles take from the variance of the mean, and cost.

        ``factor`` is that of the point's variance in it.
        """
        angles, (first, second) = self.angles, (factor * v for v in self.variances)
        found = []
        if self.two is None and angles.few < MOST:
            found.append(Step(place, (1.0 - SMOOTH) * first, angles.few, few=True))
        if self.two is not None and angles.many < MOST_MANY:
            found.append(Step(place, (1.0 - SMOOTH) * first, COST * angles.many, few=False))
        if self.two is not None and angles.few < MOST:
            found.append(Step(place, (1.0 - SCATTERED) * second, angles.few, few=True))
        return found


def expect_in_two_levels(
    study: Setup,
    points: Sequence[OperatingPoint],
    precision: float,
    executor: Executor,
    progress: WorkCounter,
) -> Precise:
    """Return the expectation over ``points`` to a relative standard error ``precision``.

    The study's engine is Drake. Blocks and records are Drake's. Where the precision cannot be
    reached, the last round is returned and progress says why.
    """
    first = [first_angles(len(points), precision)] * len(points)
    progress.rounds(_counts(first), _later(first, 1.0, AGAIN))
    parts, again = _simulated(study, points, first, executor, progress), AGAIN
    while True:
        found = expect([part.expectation for part in parts])
        share = found.standard_error / found.mean
        plan = _next(parts, precision * found.mean)
        if any(part.barren for part in parts):
            progress.say("nothing engages at some operating point: no precision can be reached")
        elif plan != [part.angles for part in parts]:
            counts = f"{found.shifts} shifts of Drake and {found.planar_shifts} compiled ones"
            progress.say(f"standard error {share:.2%} from {counts}; more where they tell most")
            goal = precision * found.mean
            ratio = max(1.0, _expected_variance(parts, plan) / goal**2)
            progress.rounds(_counts(plan, parts), _later(plan, ratio, max(ratio, again)))
            again = 1.0
            parts = _simulated(study, points, plan, executor, progress, before=parts)
            continue
        elif share > precision:
            progress.say(f"{share:.1%} is what {MOST} angles of Drake at each operating point give")
        progress.rounds({"shift": repeated(found.shifts)}, {"shift": _finer(found.shifts)})
        return Precise(found, [part.block for part in parts], [part.rows for part in parts])


def first_angles(points: int, precision: float) -> Angles:
    """Choose the angles of the first round at each of ``points`` operating points."""
    few, pairs = FEW, max(ENOUGH, RARE / precision)
    while few * points < pairs and few < SURE:
        few *= 2
    return Angles(few, max(MANY, 2 * few))


def first_shifts(points: int, precision: float) -> int:
    """Count the shifts of the first round, of both engines."""
    angles = first_angles(points, precision)
    return points * (angles.few + angles.many)


def _counts(plan: Sequence[Angles], before: Sequence[Part] = ()) -> dict[Kind, int]:
    """Count the shifts of each engine that a plan has and the round before had not."""
    few = sum(angles.few for angles in plan) - sum(part.angles.few for part in before)
    had = [part.angles.many for part in before] or [0] * len(plan)
    many = sum(max(0, a.many - b) for a, b in zip(plan, had, strict=True))
    return {"shift": few, "quick": many}


def _later(plan: Sequence[Angles], ratio: float, ratio_many: float) -> dict[Kind, float]:
    """Foresee what follows a plan: further rounds, and what is repeated for the numerical error.

    The ratios are the variance that the plan should leave over the wanted one, of differences,
    which falls as 1/n, and of the compiled engine's mean, which falls as 1/N2. Repeated shifts
    count by their cost.
    """
    few = sum(min(MOST, a.few * ratio) for a in plan)
    many = sum(min(MOST_MANY, a.many * math.sqrt(ratio_many)) for a in plan)
    fine = repeated(round(few))
    more = few - sum(a.few for a in plan) + fine + _finer(round(few))
    return {"shift": more, "quick": many - sum(a.many for a in plan)}


def _finer(shifts: int) -> float:
    """Weigh the shifts repeated of so many: what each costs more than a usual one."""
    return (FINE - 1.0) * repeated(shifts)


def _expected_variance(parts: Sequence[Part], plan: Sequence[Angles]) -> float:
    """Expect the variance of the mean that a plan leaves, s2."""
    weights = np.array([part.alone.point.weight for part in parts])
    left = []
    for part, angles in zip(parts, plan, strict=True):
        first, second = part.variances
        few = part.angles.few / angles.few
        many = part.angles.many / angles.many if angles.many else few
        left.append(first * many**2 + second * few)
    return float((weights / weights.sum()) ** 2 @ np.array(left))


def _simulated(
    study: Setup,
    points: Sequence[OperatingPoint],
    plan: Sequence[Angles],
    executor: Executor,
    progress: WorkCounter,
    *,
    before: Sequence[Part] = (),
) -> list[Part]:
    """Simulate a round and say what it tells; where Drake stands alone it did ``before``."""
    few = [_block(study, study.clutch, k, points[k], a.few) for k, a in enumerate(plan)]
    compiled = study.clutch.with_engine("planar")
    both = [k for k, angles in enumerate(plan) if angles.many]
    many = {k: _block(study, compiled, k, points[k], plan[k].many) for k in both}
    with progress.counting("quick"):
        cheap = dict(zip(both, executor.run(list(many.values())), strict=True))
    rows = executor.run(few)
    lost, parts = study.clutch.timeout + study.retraction, []
    for k, (angles, block) in enumerate(zip(plan, few, strict=True)):
        dear = [result_of(row) for row in rows[k]]
        alone = expect_point(block.point, dear, study.clutch.timeout, study.retraction)
        if angles.many:
            beside = [result_of(row) for row in cheap[k]]
            places = nested(angles.few, angles.many, study.file.expectation.seed, k, FEW)
            levels = two_level_point(alone, beside, dear, places, lost)
        else:
            levels = before[k].levels
        parts.append(Part(angles, block, rows[k], alone, levels))
    return _pooled(parts)


def _block(study: Setup, clutch: Clutch, index: int, point: OperatingPoint, count: int) -> Block:
    draw = (study.file.expectation.seed, index)
    return even_block(clutch, point, count, draw, FEW, uncertainty=study.uncertainty)


def _pooled(parts: Sequence[Part]) -> list[Part]:
    """Give each point its spread of differences, and leave Drake alone where that is better."""
    known = [part.levels for part in parts if part.levels is not None]
    spreads = iter(common_spreads(known))
    found = [replace(p, spread=next(spreads)) if p.levels is not None else p for p in parts]
    return [part if part.helped else part.drake_alone for part in found]


def _next(parts: Sequence[Part], goal: float) -> list[Angles]:
    """Choose the angles of the next round for a standard error ``goal`` in s.

    As they are where that is reached, or no more are to be had.
    """
    weights = np.array([part.alone.point.weight for part in parts])
    factors = (weights / weights.sum()) ** 2
    plan = [part.angles for part in parts]
    parted = any(part.levels and part.levels.parted for part in parts)
    for k, part in enumerate(parts):
        least = SURE if parted else FIRST if part.alone.mean_engaged is None else FEW
        if part.angles.few < least:
            plan[k] = plan[k].more_few
    if plan != [part.angles for part in parts]:
        return plan
    every = [step for k, part in enumerate(parts) for step in part.steps(k, float(factors[k]))]
    useful = sorted((step for step in every if step.gain > 0.0), key=lambda step: -step.worth)
    variance = sum(f * sum(part.variances) for f, part in zip(factors, parts, strict=True))
    for step in useful:
        if variance <= goal**2:
            break
        plan[step.place] = step.angles(plan[step.place])
        variance -= step.gain
    return plan
