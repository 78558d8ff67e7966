"""Whether a hypothesis can have made the data at all: its posterior predictive p-value.

Of values drawn from the posterior, each cell gives a normal score for its mean and one for its
share engaged, and each force profile one for the marks of its flight; the sum of their squares is
chi-square where the hypothesis holds. The p-value is the mean over the posterior (Gelman, Meng and
Stern 1996, realised discrepancies).
"""

from __future__ import annotations

import numpy as np
from scipy.special import ndtri
from scipy.stats import betabinom, chi2

from diagnosis.common_error import Slopes, explained, shared_errors
from diagnosis.flight_likelihood import flight_scores
from diagnosis.likelihood import Said, beta_of, time_score
from diagnosis.observed import Observed
from diagnosis.scoring import Problem, Scored
from diagnosis.spread import Array

DRAWN = 32
ADEQUATE = 0.01  #: p-value below which a hypothesis fails
MOST = 1e-12  #: least probability that is told from none


def p_value(problem: Problem, found: Scored) -> float:
    """Return the posterior predictive p-value of a hypothesis."""
    rows, counts = np.unique(found.draw(DRAWN, np.random.default_rng(1)), return_counts=True)
    values = found.space.values(found.rows.shares[rows])
    said = problem.said(found.hypothesis, values)
    seen = problem.seen
    telling = (seen.tried > 0) & ((seen.failed > 0) | (said.engaged.min(axis=1) < 0.98))
    timely = time_score(seen, said)[seen.shifts > 0]
    scores = np.vstack(
        [
            timely,
            _engaged_score(seen, said)[telling],
            flight_scores(problem.flights, problem.flown(found.hypothesis, values), len(values)),
        ]
    )
    if not len(scores):
        return 1.0
    taken = explained(*_in_common(seen, said, timely, problem.common))
    tails = chi2.sf((scores**2).sum(axis=0) - taken, len(scores))
    return float(np.average(tails, weights=counts))


def _in_common(seen: Observed, said: Said, scores: Array, common: Array) -> tuple[Slopes, Array]:
    """Return what scores of cells with times (cells, m) are as slopes, and errors in common."""
    having = seen.shifts > 0
    squares = said.sd[having] ** 2 / seen.shifts[having, None] + said.error[having] ** 2
    # What says nothing of a cell's times errs there with nothing in common.
    precision = np.nan_to_num(1.0 / squares.T)
    slopes = Slopes(scores.T * np.sqrt(precision), precision)
    return slopes, shared_errors(common[having], np.nan_to_num(said.common[having].T))


def _engaged_score(seen: Observed, said: Said) -> Array:
    """Return normal scores of numbers engaged, at the middle of their probability, (cells, m)."""
    number = betabinom(seen.tried[:, None], *beta_of(said))
    engaged = seen.engaged[:, None]
    middle = number.cdf(engaged) - 0.5 * number.pmf(engaged)
    scores: Array = ndtri(np.clip(middle, MOST, 1.0 - MOST))
    return scores
