"""From a design to what is simulated of it: blocks out, expectation and landing back."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from dogshape.pipeline.config.study_file import Study
from dogshape.pipeline.simulate.design import Design
from dogshape.pipeline.simulate.estimates import Shifts, estimates_of
from dogshape.pipeline.simulate.executor import Executor
from dogshape.pipeline.simulate.point_plans import Plan, blocks_of
from dogshape.sim.shift.clutch import OperatingPoint
from dogshape.sim.shift.geometry import Dog
from dogshape.sim.shift.loads import Landing
from dogshape.sim.statistics.estimate import Estimate
from dogshape.sim.statistics.expectation import Expectation, expect, expect_point
from dogshape.sim.statistics.numerical_error import numerical_error
from dogshape.sim.statistics.shift_records import Record, landing_of, result_of, unfinished
from dogshape.sim.strength.dog_strength import strength_checks
from dogshape.sim.strength.landing import hardest, landing_checks
from dogshape.sim.strength.manufacture import require_makeable
from dogshape.surrogate.covariance import Array
from dogshape.surrogate.dataset import rows_of

NEW_ANGLES = 7919  #: added to the seed of the search for relative angles that it did not use


@dataclass(frozen=True)
class Simulated:
    """Expectation and loads from the shifts of a design.

    Expected shift time over the operating points that were simulated, hardest landing, a row for
    the surrogate from each, as ``surrogate.dataset.rows_of`` gives them, all simulated
    objectives by name, and how many of the shifts the clock ended.
    """

    expectation: Expectation
    landing: Landing
    rows: Array
    estimates: dict[str, Estimate]
    unfinished: int = 0

    @property
    def known(self) -> bool:
        """Whether the shifts say every simulated objective: not where all of them failed."""
        return all(math.isfinite(estimate.value) for estimate in self.estimates.values())


def evaluate(
    study: Study,
    dogs: Sequence[Dog],
    executor: Executor,
    plans: Sequence[Plan],
    seed: int,
    *,
    base: int | None = None,
    checked: bool = False,
) -> list[Simulated]:
    """Simulate the shifts of several designs side by side and evaluate them.

    ``plans`` say what is simulated of each, with ``base`` as for
    ``sim.statistics.expectation.even_phases``. ``checked`` adds the numerical error, from an eighth
    of the shifts repeated. Raises GeometryError for a dog that cannot be made, before anything is
    simulated.
    """
    for dog in dogs:
        require_makeable(dog, study.limits.manufacturing)
    blocks = [
        blocks_of(study, study.clutch.with_dog(dog), plan, seed, base)
        for dog, plan in zip(dogs, plans, strict=True)
    ]
    rows = executor.run([block for group in blocks for block in group])
    results = []
    for dog, group in zip(dogs, blocks, strict=True):
        mine, rows = rows[: len(group)], rows[len(group) :]
        result = expectation_of(study, [b.point for b in group], mine)
        if checked:
            result = replace(result, numerical_error=numerical_error(group, mine, executor.run))
        results.append(_simulated(study, dog, result, mine))
    return results


def _simulated(
    study: Study, dog: Dog, expectation: Expectation, rows: Sequence[Sequence[Record]]
) -> Simulated:
    shifts = [row for mine in rows for row in mine]
    landing = hardest(landing_of(row) for row in shifts)
    checks = strength_checks(dog, study.limits) + landing_checks(dog, landing, study.limits)
    found = Shifts(study, Design({}, dog, checks, ""), expectation, rows)
    learned, ended = rows_of(tuple(study.variables), shifts), sum(map(unfinished, shifts))
    return Simulated(expectation, landing, learned, estimates_of(found), ended)


def expectation_of(
    study: Study,
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
