"""Likelihood of all operating points together: how exact it is, and what intervals make of it.

    python -m benchmarks.common_errors [--sets N] [--intervals N]

Data are drawn as in ``benchmarks.self_consistency``, of one effect. At the true size the logarithm
of the likelihood is compared with importance sampling over all that the operating points err in
common: once with slopes of the cells' log likelihoods without an offset, and once at the offsets
that the data leave (``diagnosis.likelihood.likely_offsets``), which the diagnosis takes. Then sizes
are fitted, of the true effects, one or two, and it is counted how often the 90 % intervals hold
what was drawn. Some six minutes of processor time.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from unittest import mock

import numpy as np
from scipy.special import logsumexp
from scipy.stats import t as student

from benchmarks.self_consistency import told, world
from dogshape.diagnosis.inference import evidence as evidences
from dogshape.diagnosis.inference.parameter_intervals import intervals
from dogshape.diagnosis.likelihood import scores
from dogshape.diagnosis.likelihood.cell_likelihood import Timed, timed
from dogshape.diagnosis.likelihood.cell_predictions import CellPredictions
from dogshape.diagnosis.likelihood.discrepancy import Discrepancy, marginals
from dogshape.diagnosis.likelihood.likely_offsets import timed_together
from dogshape.diagnosis.likelihood.observations import Observed
from dogshape.diagnosis.terms import Array
from dogshape.validation.blind.intervals import share
from dogshape.validation.self_consistency import draw, problem_of

DRAWS = 800  #: of a member, by importance
FREEDOM = 6.0  #: of the Student distributions that they come from
WIDER = 1.5  #: than the normal approximation, in variance
FOLLOWED = 8  #: steps of Newton to the offset that a member leaves
FIRST = 1000  #: seed of the first set

Timing = Callable[[Observed, CellPredictions, Discrepancy], tuple[Timed, Array]]


def without_offset(
    seen: Observed, predicted: CellPredictions, prior: Discrepancy
) -> tuple[Timed, Array]:
    """Expand the log likelihoods of cells where they err in nothing."""
    cells = timed(seen, predicted)
    return cells, marginals(cells.slopes, prior, np.nan_to_num(predicted.common.T)).log


def by_importance(
    seen: Observed, predicted: CellPredictions, prior: Discrepancy, generator: np.random.Generator
) -> float:
    """Sum the likelihood of times over the offsets in common, at one value (cells, 1)."""
    logs = []
    for root, chances in zip(prior.narrow_roots, prior.prior, strict=True):
        for amplitude, chance in zip(prior.amplitudes, chances, strict=True):
            axes = amplitude * root
            size = axes.shape[1]
            place: Array = np.zeros(size)
            precision = np.eye(size)
            for _ in range(FOLLOWED):
                here = timed(seen, predicted.moved((axes @ place)[:, None]))
                first, second = here.first[:, 0], here.second[:, 0]
                precision = np.eye(size) + axes.T @ (second[:, None] * axes)
                pull = axes.T @ (first + second * (axes @ place))
                place = np.linalg.solve(precision, pull)
            spread = np.linalg.cholesky(WIDER * np.linalg.inv(precision))
            steps = generator.standard_t(FREEDOM, (DRAWS, size))
            drawn = place + steps @ spread.T
            log = timed(seen, predicted.moved(axes @ drawn.T)).log.sum(axis=0)
            log = log - 0.5 * (drawn**2).sum(axis=1) - 0.5 * size * np.log(2.0 * np.pi)
            proposed = student.logpdf(steps, FREEDOM).sum(axis=1)
            proposed = proposed - np.log(np.diag(spread)).sum()
            logs.append(np.log(chance / DRAWS) + logsumexp(log - proposed))
    return float(logsumexp(logs))


def expanded(how: Timing, seen: Observed, predicted: CellPredictions, prior: Discrepancy) -> float:
    """Compute the same by parabolas."""
    cells, together = how(seen, predicted, prior)
    return float(cells.log.sum() + together[0])


def differences(count: int) -> Array:
    """Compare both expansions, and a second sampling, with a first one, (sets, 3)."""
    found, generator = [], np.random.default_rng(1)
    seed = FIRST
    while len(found) < count:
        one = draw(world(), np.random.default_rng(seed))
        seed += 1
        if len(one.cause) != 1:
            continue
        problem = problem_of(world(), one)
        predicted = problem.predictions(one.cause, one.values[None])
        parts = problem.seen, predicted, problem.discrepancy
        once, again = (by_importance(*parts, generator) for _ in range(2))
        both = [expanded(how, *parts) - once for how in (without_offset, timed_together)]
        found.append([*both, again - once])
    return np.array(found)


def held(count: int, how: Timing) -> tuple[list[bool], list[bool]]:
    """Test whether 90 % intervals of one effect, and of two, hold the values drawn."""
    spaces = {space.hypothesis: space for space in world().spaces}
    found: tuple[list[bool], list[bool]] = [], []
    with mock.patch.object(scores, "timed_together", how):  # where all cells are scored
        for seed in range(FIRST, FIRST + count):
            one = draw(world(), np.random.default_rng(seed))
            if not one.cause:
                continue
            space = spaces[one.cause]
            ranges = intervals(evidences.evidence(problem_of(world(), one), space))
            for parameter, value in zip(space.parameters, one.values, strict=True):
                inside = ranges[parameter.name]
                found[len(one.cause) - 1].append(bool(inside.low <= value <= inside.high))
    return found


def main() -> None:
    """Compare and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sets", type=int, default=250)
    parser.add_argument("--intervals", type=int, default=1200)
    given = parser.parse_args()
    table = differences(given.sets)
    names = "without an offset", "at likely offsets", "a second sampling"
    print(
        f"log likelihood at the true size minus that by importance sampling, nat, {len(table)} sets"
    )
    print(f"{'':20}{'mean':>8}{'rms':>8}{'largest':>9}{'beyond 0.3':>12}{'beyond 3':>10}")
    for name, off in zip(names, table.T, strict=True):
        size = abs(off)
        print(
            f"{name:20}{off.mean():8.2f}{np.sqrt((off**2).mean()):8.2f}{size.max():9.1f}"
            f"{(size > 0.3).mean():12.1%}{(size > 3.0).mean():10.1%}"
        )
    print(f"\n90 % intervals that hold the value drawn, {given.intervals} sets, 95 % interval")
    print(f"{'':20}{'of one effect':>29}{'of two':>29}")
    for name, how in zip(names, (without_offset, timed_together), strict=False):
        print(
            f"{name:20}"
            + "".join(f"{told(share(part)):>29}" for part in held(given.intervals, how))
        )


if __name__ == "__main__":
    main()
