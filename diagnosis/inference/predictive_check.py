"""Posterior predictive p-value of a hypothesis: can it have made the data at all.

For values drawn from the posterior, each cell gives normal scores: of its mean, of the spread of
its single shifts, of its number of outliers and of its share engaged. Each force profile gives one
for the marks of its flight. The p-value is the posterior mean of the probability of a larger sum
of squares (Gelman, Meng and Stern 1996, realised discrepancies). Squares of means, spreads and
marks are chi-square. Counts take few values, so replicated counts give the distribution of theirs.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import ndtri
from scipy.stats import betabinom, chi2

from dogshape.diagnosis.likelihood.cell_likelihood import beta_of
from dogshape.diagnosis.likelihood.cell_predictions import CellPredictions
from dogshape.diagnosis.likelihood.discrepancy import Marginals, Slopes, marginals
from dogshape.diagnosis.likelihood.flight_likelihood import flight_scores
from dogshape.diagnosis.likelihood.likely_offsets import likely_offset
from dogshape.diagnosis.likelihood.mean_density import outlier_beta, time_scores
from dogshape.diagnosis.likelihood.scores import Problem, Scored
from dogshape.diagnosis.settings import USUAL
from dogshape.diagnosis.terms import Array

DRAWN = 2000  #: values drawn from the posterior
REPLICATES = 20_000  #: of the counts, over all values
FEW = 100  #: shifts up to which counts are replicated; of more their scores are normal
ADEQUATE = USUAL.decision.adequate  #: p-value below which a hypothesis fails
MOST = 1e-12  #: least probability that is told from none


def p_value(problem: Problem, found: Scored) -> float:
    """Return the posterior predictive p-value of a hypothesis."""
    generator = np.random.default_rng(1)
    rows, weights = np.unique(found.draw(DRAWN, generator), return_counts=True)
    values = found.space.values(found.rows.shares[rows])
    predicted = problem.predictions(found.hypothesis, values)
    seen = problem.seen
    few, alone = seen.tried <= FEW, seen.single <= FEW
    # All of them: only those where a shift failed would be the worst of them.
    telling, single = seen.tried > 0, seen.single > 0
    offset = likely_offset(seen, predicted, problem.discrepancy)
    means, spreads, late = time_scores(seen, predicted, offset)
    timely, off = _of_means(problem, predicted, means, offset)
    engaged = (seen.tried, seen.engaged[:, None], *beta_of(predicted))
    outliers = (seen.single, late, *outlier_beta(predicted))
    scores = np.vstack(
        [
            timely,
            spreads[seen.freedom > 0],
            _count_score(*(a[telling & ~few] for a in engaged)),
            _count_score(*(a[single & ~alone] for a in outliers)),
            _marks(problem, found, values),
        ]
    )
    counts = [
        _counted(*(a[telling & few] for a in engaged)),
        _counted(*(a[single & alone] for a in outliers)),
    ]
    if not len(scores) and not any(len(one.seen) for one in counts):
        return 1.0
    rest: Array = np.zeros((len(values), 1))
    for one in counts:
        mine: Array = (one.seen**2).sum(axis=0)
        rest = rest + mine.reshape(-1, 1) - one.squares(generator)
    chance = np.zeros(len(values))
    for taken, weight in zip(off.squares.T, off.weights.T, strict=True):
        left = (scores**2).sum(axis=0)[:, None] - taken[:, None] + rest
        tails = chi2.sf(left, len(scores)) if len(scores) else (left <= 0.0) * 1.0
        chance += weight * tails.mean(axis=1)
    return float(np.average(chance, weights=weights))


def _marks(problem: Problem, found: Scored, values: Array) -> Array:
    """Score the marks of the flights at values (m, p), (profiles, m)."""
    flown = problem.flown(found.hypothesis, values)
    freedom = problem.settings.likelihood.flight_freedom
    return flight_scores(problem.flights, flown, len(values), freedom)


@dataclass(frozen=True)
class _Counted:
    """Normal scores of counts: of those seen, and of all that could be, (cells, m, counts)."""

    seen: Array
    every: Array
    chances: Array

    def squares(self, generator: np.random.Generator) -> Array:
        """Draw sums of squared scores where the hypothesis holds, (m, replicates)."""
        total = np.zeros((self.seen.shape[1], -(-REPLICATES // self.seen.shape[1])))
        for scores, chances in zip(self.every, self.chances, strict=True):
            edges = np.cumsum(chances, axis=1)
            drawn: Array = np.asarray(generator.random(total.shape))
            place = (np.expand_dims(drawn, 2) > edges[:, None, :-1]).sum(axis=2)
            total += np.take_along_axis(scores, place, axis=1) ** 2
        return total


def _count_score(tried: Array, seen: Array, a: Array, b: Array) -> Array:
    """Score counts (cells, m) or (cells, 1) at the middle of their probability, (cells, m)."""
    law = betabinom(tried[:, None], a, b)
    middle = law.cdf(seen) - 0.5 * law.pmf(seen)
    return ndtri(np.clip(middle, MOST, 1.0 - MOST))


def _counted(tried: Array, seen: Array, a: Array, b: Array) -> _Counted:
    """Score beta-binomial counts (cells, m) or (cells, 1) at the middle of their probability."""
    numbers = np.arange(int(tried.max(initial=0.0)) + 1.0)
    law = betabinom(tried[:, None, None], a[..., None], b[..., None])
    chances = np.where(numbers <= tried[:, None, None], law.pmf(numbers), 0.0)
    middle = np.cumsum(chances, axis=2) - 0.5 * chances
    every = ndtri(np.clip(middle, MOST, 1.0 - MOST))
    place = np.broadcast_to(seen.astype(int)[..., None], (*every.shape[:2], 1))
    return _Counted(np.take_along_axis(every, place, axis=2)[..., 0], every, chances)


def _of_means(
    problem: Problem, predicted: CellPredictions, scores: Array, offset: Array
) -> tuple[Array, Marginals]:
    """Score the means of cells with times, (cells, m), with what the discrepancy explains of it.

    A mean far off is an odd one, whose score says little of how far it is. So scores are taken
    where the offsets are that the data leave, and carried back along a straight line.
    """
    seen = problem.seen
    having = seen.shifts > 0
    squares = predicted.sd[having] ** 2 / seen.shifts[having, None] + predicted.error[having] ** 2
    # What says nothing of a cell's times errs there with nothing in common.
    precision = np.nan_to_num(1.0 / squares)
    root = np.sqrt(precision)
    at_none = scores[having] + root * offset[having]
    joint = np.broadcast_to(np.nan_to_num(predicted.common[having]), at_none.shape)
    slopes = Slopes((at_none * root).T, precision.T)
    return at_none, marginals(slopes, problem.discrepancy.of(having), joint.T)
