"""Whether a hypothesis can have made the data at all: its posterior predictive p-value.

Of values drawn from the posterior, each cell gives a normal score for its times and one for its
share engaged; the sum of their squares is chi-square where the hypothesis holds. The p-value is
the mean over the posterior (Gelman, Meng and Stern 1996, realised discrepancies).
"""

from __future__ import annotations

import numpy as np
from scipy.special import ndtri
from scipy.stats import betabinom, chi2

from diagnosis.likelihood import Observed, beta_of, time_score
from diagnosis.scoring import Problem, Scored
from diagnosis.spread import Array, Spread

DRAWN = 32
ADEQUATE = 0.01  #: p-value below which a hypothesis fails
MOST = 1e-12  #: least probability that is told from none


def p_value(problem: Problem, found: Scored) -> float:
    """Return the posterior predictive p-value of a hypothesis."""
    rows = np.unique(found.draw(DRAWN, np.random.default_rng(1)), return_counts=True)
    values = found.space.values(found.rows.shares[rows[0]])
    spreads = problem.spreads(found.hypothesis, values)
    total, count = np.zeros(len(values)), 0
    for seen, spread in zip(problem.seen, spreads, strict=True):
        if seen.shifts:
            total += np.nan_to_num(time_score(seen, spread, problem.rules), nan=20.0) ** 2
            count += 1
        if seen.engaged + seen.failed and (seen.failed or spread.engaged.min() < 0.98):
            total += _engaged_score(seen, spread) ** 2
            count += 1
    tails = chi2.sf(total, count) if count else np.ones(len(values))
    return float(np.average(tails, weights=rows[1]))


def _engaged_score(seen: Observed, spread: Spread) -> Array:
    """Return the normal score of a number engaged, at the middle of its probability, (m,)."""
    a, b = beta_of(spread)
    number = betabinom(seen.engaged + seen.failed, a, b)
    middle = number.cdf(seen.engaged) - 0.5 * number.pmf(seen.engaged)
    scores: Array = ndtri(np.clip(middle, MOST, 1.0 - MOST))
    return scores
