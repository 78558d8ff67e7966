r"""Mean time of further shifts at each operating point, given all that was seen.

A hypothesis that misses an operating point has an explanation for it, where it is not refused: what
the simulation is off by. That comes again with further shifts at the same point. So after the data
all that are left predict much the same mean there, and what more shifts can tell is what the first
ones left to chance.

For a value of the parameters the mean of a cell is off by the discrepancy :math:`\delta`, of which
the data leave a distribution (``diagnosis.likelihood.discrepancy``), and by all other errors
*u* of the covariance :math:`K = B B^T + j j^T + \mathrm{diag}(e^2)`. These are seen as
:math:`r = \bar t - \mu - \delta` with the variance *N* of a mean of the shifts that were made,
so that

.. math:: u \,|\, \delta \sim N\left(K (K + N)^{-1} r,\; K - K (K + N)^{-1} K\right).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dogshape.diagnosis.inference.unknown import Unknown
from dogshape.diagnosis.likelihood.discrepancy import Slopes, posterior_draws
from dogshape.diagnosis.likelihood.observations import Observed
from dogshape.diagnosis.likelihood.scores import PredictionSummary, Scored
from dogshape.diagnosis.terms import Array

DRAWN = 200  #: values of the parameters, each with a discrepancy


@dataclass(frozen=True)
class MeanPrediction:
    """Mean times of the cells that a hypothesis predicts given all data, (cells,); s, s^2.

    ``variance`` is that of the mean (parameters, simulation), ``single`` that of single shifts.
    """

    mean: Array
    variance: Array
    single: Array


def further_means(one: Scored, seen: Observed) -> MeanPrediction:
    """Predict the mean time of more shifts at each cell by a hypothesis.

    NaN where some of what is plausible engages nothing.
    """
    generator = np.random.default_rng(1)
    picks, rows = one.draw(DRAWN, generator), one.rows
    slopes = Slopes(rows.slopes.first[picks], rows.slopes.second[picks])
    common, _ = posterior_draws(slopes, rows.discrepancy, rows.joint[picks], generator)
    beside = rows.discrepancy.beside
    predicted, single = rows.predicted.mean[picks] + common, rows.predicted.sd[picks] ** 2
    rest = []
    for k, pick in enumerate(picks):
        columns = [rows.joint[pick][:, None], *([] if beside is None else [beside])]
        own = rows.predicted.error[pick]
        noise = single[k] / np.maximum(seen.n, 1)
        left = np.where(seen.n > 0, seen.mean - predicted[k], np.nan)
        rest.append(others_given(left, noise, np.hstack(columns), own))
    mean = predicted + np.array([found for found, _ in rest])
    spread = np.array([found for _, found in rest])
    variance = mean.var(axis=0) + spread.mean(axis=0)
    return MeanPrediction(mean.mean(axis=0), variance, single.mean(axis=0))


def others_given(left: Array, noise: Array, columns: Array, error: Array) -> tuple[Array, Array]:
    """Compute mean and variance of all errors but the discrepancy of one value, given the data.

    Parameters
    ----------
    left : what the means that were measured differ by, s, (cells,); NaN without one.
    noise : variance of these by the scatter of shifts, s^2, (cells,).
    columns : of errors in common, s, (cells, q).
    error : of each cell by itself, s, (cells,).
    """
    prior = columns @ columns.T + np.diag(error**2)
    seen = np.flatnonzero(np.isfinite(left))
    matrix = prior[np.ix_(seen, seen)] + np.diag(noise[seen])
    gain = np.linalg.solve(matrix, prior[seen]).T
    return gain @ left[seen], np.diag(prior) - (gain * prior[:, seen]).sum(axis=1)


def further_unknown(
    unlisted: Unknown, seen: Observed, baseline: PredictionSummary
) -> MeanPrediction:
    """Predict the same by an unknown cause, whose offsets are known from all data."""
    mean, variance = unlisted.predict(np.ones(seen.cells, dtype=bool))
    error, single = baseline.error[0] ** 2, baseline.sd[0] ** 2
    share = np.where(seen.n > 0, error / (error + single / np.maximum(seen.n, 1)), 0.0)
    left = np.where(seen.n > 0, seen.time - mean, 0.0)
    rest = (1.0 - share) ** 2 * variance + error * (1.0 - share)
    return MeanPrediction(mean + share * left, rest, single)
