"""From a design to what is simulated of it: blocks out, expectation and landing back."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from pipeline.config import Study
from pipeline.executor import Executor
from sim.blocks import even_blocks
from sim.clutch import OperatingPoint
from sim.expectation import Expectation, expect, expect_point
from sim.geometry import Dog
from sim.landing import hardest
from sim.loads import Landing
from sim.manufacture import require_makeable
from sim.numerical import numerical_error
from sim.records import Record, landing_of, result_of
from surrogate.covariance import Array
from surrogate.dataset import rows_of

FRESH = 7919  #: added to the seed of the search for angles that it did not use


@dataclass(frozen=True)
class Simulated:
    """What the shifts of a design gave.

    Expected shift time, hardest landing, and a row for the surrogate from each operating point,
    as ``surrogate.dataset.rows_of`` gives them.
    """

    expectation: Expectation
    landing: Landing
    rows: Array


def evaluate(
    study: Study,
    dogs: Sequence[Dog],
    executor: Executor,
    angles: int,
    seed: int,
    *,
    checked: bool = False,
) -> list[Simulated]:
    """Return what the shifts of several designs give, simulated side by side.

    ``checked`` adds the numerical error, from an eighth of the shifts repeated.
    Raises GeometryError for a dog that cannot be made, before anything is simulated.
    """
    for dog in dogs:
        require_makeable(dog, study.limits.manufacturing)
    clutches = [study.clutch.with_dog(dog) for dog in dogs]
    blocks = [even_blocks(clutch, study.points, angles, seed) for clutch in clutches]
    rows = executor.run([block for group in blocks for block in group])
    results = []
    for group in blocks:
        mine, rows = rows[: len(group)], rows[len(group) :]
        result = expectation_of(study, [b.point for b in group], mine)
        if checked:
            result = replace(result, numerical_error=numerical_error(group, mine, executor.run))
        landing = hardest(landing_of(row) for block in mine for row in block)
        found = rows_of(tuple(study.variables), [row for block in mine for row in block])
        results.append(Simulated(result, landing, found))
    return results


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
