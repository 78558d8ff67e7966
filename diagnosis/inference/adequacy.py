r"""Adequacy of a hypothesis: p-values of its fit to a data set, by parts.

At one draw of a posterior, errors in common among what is drawn, the deviates of a true hypothesis
are distributed as at the true values (Johnson 2004, Annals of Statistics 32), however wide the
priors of these errors are. Of the mean of each operating point that is

.. math:: z_k = (r_k - c_k) / \sigma_k \sim N(0, 1),

with residual *r*, common error *c* and single error :math:`\sigma`. Each part has a p-value at each
draw. Draws depend on each other and are combined by Cauchy's distribution:

.. math:: p = 1/2 - \arctan(\overline{\tan(\pi (1/2 - p_i))}) / \pi

(Liu and Xie 2020, J. Am. Stat. Assoc. 115), with no :math:`p_i` above 0.99, so that one good draw
hides no bad one (Fang et al. 2023, Statistica Sinica 33). Parts nearly do not, and the least of
*n* is combined: :math:`1 - (1 - p_{\min})^n` (Tippett 1931).
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from scipy.stats import chi2, combine_pvalues, norm, rankdata, spearmanr

from dogshape.diagnosis.likelihood.likelihood import CommonErrors, Likelihood, Terms
from dogshape.diagnosis.likelihood.observed import single_series
from dogshape.diagnosis.prediction.model import Prediction
from dogshape.diagnosis.terms import Array

MAX_P = 0.99  #: of a draw that is combined
MIN_P = 1e-15  #: of a draw that is combined
MIN_RANKED = 5  #: points of a rank test
PERMUTATIONS = 400  #: of the order of shifts


def combine_draws(p_values: Array) -> float:
    """Combine p-values (m,) at draws of a posterior; NaN does not count, NaN for none."""
    finite = p_values[np.isfinite(p_values)]
    if finite.size == 0:
        return float("nan")
    scores = np.tan(np.pi * (0.5 - np.clip(finite, MIN_P, MAX_P)))
    return float(0.5 - np.arctan(scores.mean()) / np.pi)


def combine_parts(p_values: Iterable[float]) -> float:
    """Combine the p-values of parts by the least of them."""
    return float(combine_pvalues([*p_values], method="tippett").pvalue)


def check_parts(
    likelihood: Likelihood, p: Prediction, errors: CommonErrors, marks: Array
) -> dict[str, float]:
    """Compute the p-value of each part that has data, over m draws of a posterior.

    ``marks`` are normal deviates of the marks of each profile, (m, profiles).

    means, spreads, marks
        sum of the squared deviates of all points or profiles, chi-square
    worst
        largest deviate of means and spreads
    direction
        smooth gap over the points that is known best
    spreads_by_force, spreads_by_mismatch
        rank correlation of the deviates of spreads with force and mismatch; deviates of means have
        the smooth scatter of drawn errors in common, which correlates by itself
    order
        alternation of successive shifts
    """
    points = likelihood.measured_points
    terms = likelihood.terms(p)
    mean_scores = (terms.residual - errors.offset[:, points]) / np.sqrt(terms.variance)
    spread_scores = likelihood.spread_scores(p)
    all_scores = np.hstack([mean_scores, spread_scores])
    force = likelihood.observed.force[points]
    mismatch = abs(likelihood.observed.mismatch[points])
    parts = {
        "means": sum_of_squares_p(mean_scores),
        "spreads": sum_of_squares_p(spread_scores),
        "marks": sum_of_squares_p(marks),
        "worst": worst_p(all_scores),
        "direction": best_direction_p(likelihood, p, terms, errors.amplitude),
        "spreads_by_force": rank_p(spread_scores, force),
        "spreads_by_mismatch": rank_p(spread_scores, mismatch),
        "order": np.array([order_p(likelihood)]),
    }
    combined = {name: combine_draws(p_values) for name, p_values in parts.items()}
    return {name: p_value for name, p_value in combined.items() if np.isfinite(p_value)}


def sum_of_squares_p(scores: Array) -> Array:
    """Compute p-values (m,) of the sums of squared finite normal deviates (m, n)."""
    count = np.isfinite(scores).sum(axis=1)
    p_values = chi2.sf(np.nansum(scores**2, axis=1), np.maximum(count, 1))
    return np.where(count > 0, p_values, np.nan)


def worst_p(scores: Array) -> Array:
    """Compute p-values (m,) of the largest finite normal deviate in each row (m, n)."""
    count = np.isfinite(scores).sum(axis=1)
    largest = np.nan_to_num(abs(scores)).max(axis=1)
    return np.asarray(-np.expm1(count * np.log1p(-2.0 * norm.sf(largest))))


def best_direction_p(
    likelihood: Likelihood, p: Prediction, terms: Terms, amplitude: Array
) -> Array:
    """Compute p-values of the residuals' smooth gap that is largest over its error, (m,).

    Of all directions of a gap that no effect explains, errors in common hide this one least.
    """
    points = likelihood.measured_points
    simulated = (p.mean - p.delay)[:, points]
    columns = likelihood.all_common_errors(p, amplitude)[:, points]
    covariance = columns @ columns.swapaxes(1, 2) + terms.variance[..., None] * np.eye(points.size)
    root = np.linalg.cholesky(covariance)
    gaps = simulated[..., None] * likelihood.unlisted_root(likelihood.settings.unlisted_lengths[0])
    directions = np.linalg.svd(np.linalg.solve(root, gaps), full_matrices=False)[0][..., 0]
    scores = np.linalg.solve(root, terms.residual[..., None])[..., 0]
    return np.asarray(2.0 * norm.sf(abs((directions * scores).sum(axis=1))))


def rank_p(scores: Array, values: Array) -> Array:
    """Compute p-values of Spearman's correlation of scores (m, n) with values (n,), (m,).

    NaN where fewer than ``MIN_RANKED`` points have scores or all values are the same.
    """
    has_scores = np.isfinite(scores).all(axis=0)
    ranked_values = values[has_scores]
    if ranked_values.size < MIN_RANKED or np.ptp(ranked_values) == 0.0:
        return np.full(len(scores), np.nan)
    rows = np.vstack([ranked_values, scores[:, has_scores]])
    return np.asarray(spearmanr(rows, axis=1).pvalue)[0, 1:]


def order_p(likelihood: Likelihood) -> float:
    """Compute the p-value of the alternation of successive shifts, NaN without a series.

    Ranks are those among the single shifts of an operating point. Without a cause that changes
    from shift to shift their order is random, so permutations within each point give mean and
    standard deviation of the sum of products (Wald and Wolfowitz 1943, Ann. Math. Stat. 14).
    One-sided: any drift that is not linear makes successive shifts alike, whatever the cause.
    """
    generator = np.random.default_rng(likelihood.settings.seed)
    places = list[Array]()
    ranks = list[Array]()
    for series in single_series(likelihood.bench, likelihood.model, likelihood.observed.drift):
        centred_ranks = (rankdata(series.times) - 0.5 * (series.times.size + 1)) / series.times.size
        copies = np.tile(centred_ranks, (PERMUTATIONS, 1))
        places.append(series.places)
        ranks.append(np.vstack([centred_ranks, generator.permuted(copies, axis=1)]))
    if not places:
        return float("nan")
    order = np.argsort(np.concatenate(places))
    ordered_ranks = np.hstack(ranks)[:, order]
    sums = (ordered_ranks[:, 1:] * ordered_ranks[:, :-1]).sum(axis=1)
    observed_sum, permuted_sums = sums[0], sums[1:]
    sd = permuted_sums.std()
    if sd == 0.0:
        return float("nan")
    return float(norm.cdf((observed_sum - permuted_sums.mean()) / sd))
