r"""Means over simulated angles: their covariance between levels, and spreads at even shares.

Times are (..., n) in the order of n even angles; ``inf`` for a shift that did not engage and NaN
for one whose integration failed. With mean *M* of the share *p* that engages, the error of M is
that of the mean of :math:`r_k = (t_k - M)/p`, 0 where the shift did not engage. The variance
*v* of such a mean is that of ``sim.statistics.expectation``. All levels share their angles, hence

.. math:: cov(M_i, M_j) = [v(r_i) + v(r_j) - v(r_i - r_j)]/2.

A few angles may miss the tail of fast shifts, and then show less variance along with a smaller
mean; half of each variance is therefore that of all levels on average.

So few angles also show correlations that they do not have. Times run in slopes with jumps, a jump
lies somewhere between two angles, and what that errs by changes unseen while a level moves the jump
within the gap: moved by the share :math:`\delta` of it, the errors correlate by
:math:`1 - 6 \delta (1 - \delta)` (a saw-tooth at a random place). The rings turn by
:math:`\delta` between the flights of two levels; correlations are taken times
:math:`e^{-6 \delta}`, negative ones as none, and a small share of each variance as the level's own
(``OWN``).
Relative errors of means are those of their logarithms.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dogshape.diagnosis.prediction.level_curves import FLOOR

Array = NDArray[np.float64]

OWN = 0.005  #: share of a level's variance that no other level shares, at least


def engaged_mean(times: Array) -> Array:
    """Return the mean over shifts that engaged, s, (...); NaN where none did."""
    ended = np.isfinite(times)
    count = ended.sum(axis=-1)
    total = np.where(ended, times, 0.0).sum(axis=-1)
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)


def residuals(times: Array) -> Array:
    """Compute the share of each angle in the relative error of the mean, (..., n)."""
    mean = engaged_mean(times)[..., None]
    ended = np.isfinite(times)
    share = ended.mean(axis=-1, keepdims=True)
    apart = np.where(ended, times, 0.0) - np.where(ended, mean, 0.0)
    return apart / np.where(share > 0.0, mean * share, 1.0)


def even_variance(series: Array) -> Array:
    """Return the variance of the mean of series (..., n) over even angles, (...)."""
    n = series.shape[-1]
    steps = np.roll(series, -1, axis=-1) - series
    scatter = np.maximum(0.0, -(steps * np.roll(steps, -1, axis=-1)).mean(axis=-1))
    return (steps**2).sum(axis=-1) / (12.0 * n * n) + 5.0 * scatter / (6.0 * n)


def mean_covariance(times: Array, speeds: Array) -> Array:
    """Return the covariance of the relative errors of means of times (..., N, n), (..., N, N).

    ``speeds`` (..., N) are those at which the rings pass each other, pitches a second.
    """
    series = residuals(times)
    own = even_variance(series)
    apart = even_variance(series[..., :, None, :] - series[..., None, :, :])
    shared = 0.5 * (own[..., :, None] + own[..., None, :] - apart)
    scale = np.sqrt(np.maximum(own, FLOOR**2))
    like = (1.0 - OWN) * np.maximum(0.0, shared / (scale[..., :, None] * scale[..., None, :]))
    turned = times.shape[-1] * speeds * _flight(times)
    like *= np.exp(-6.0 * abs(turned[..., :, None] - turned[..., None, :]))
    taken = np.sqrt(0.5 * own + 0.5 * own.mean(axis=-1, keepdims=True))
    values, vectors = np.linalg.eigh(like * taken[..., :, None] * taken[..., None, :])
    whole: Array = (vectors * np.maximum(values, 0.0)[..., None, :]) @ np.swapaxes(vectors, -1, -2)
    # The correlation of what hardly varies is lost to the floor; its variance is not.
    lost = np.maximum(0.0, taken**2 - np.diagonal(whole, axis1=-2, axis2=-1))
    whole += np.eye(times.shape[-2]) * (lost + FLOOR**2)[..., None, :]
    return whole


def _flight(times: Array) -> Array:
    """Return the mean of the faster half of times (..., n), s, (...): those that hardly wait."""
    fast = np.sort(times, axis=-1)[..., : times.shape[-1] // 2]
    return np.nan_to_num(engaged_mean(fast))


def with_dense(covariance: Array, dense: Array, share: float) -> Array:
    """Return a covariance (C, N, N) with a first row for level 0 at more angles, (C, N+1, N+1).

    The mean of level 0 over all its angles has the relative variance ``dense`` (C,) and is what its
    levels' angles err about; ``share`` is the ratio of numbers of angles. The ratio of both
    variances is kept between that of a saw-tooth (square) and that of scatter.
    """
    ratio = np.clip(dense / covariance[:, 0, 0], share**2, share)
    cells, size, _ = covariance.shape
    whole = np.empty((cells, size + 1, size + 1))
    whole[:, 1:, 1:] = covariance
    whole[:, 0, 1:] = whole[:, 1:, 0] = ratio[:, None] * covariance[:, 0]
    whole[:, 0, 0] = ratio * covariance[:, 0, 0] + FLOOR**2
    return whole


def binned(times: Array, count: int, weights: Array | None = None) -> Array:
    """Return the times that engaged as means over ``count`` equal shares of them, ascending, s.

    Times (n,) with weights (m, n), one for each if None; (m, count). The mean is kept. All
    NaN where no shift engaged.
    """
    given = np.ones((1, times.size)) if weights is None else weights
    order = np.argsort(times)
    ended = order[np.isfinite(times[order])]
    if ended.size == 0:
        return np.full((len(given), count), np.nan)
    mass = given[:, ended]
    mass = mass / mass.sum(axis=1, keepdims=True)
    return shared_out(mass, mass * times[ended], count) * count


def shared_out(mass: Array, amount: Array, count: int) -> Array:
    """Sum amounts (m, n) over ``count`` equal shares of their mass (m, n), (m, count).

    The mass of a row adds to one, and lies evenly within each of the n.
    """
    shares, whole = from_zero(mass), from_zero(amount)
    # Rows stand behind each other on one axis, since one call is much quicker than one a row.
    behind = 2.0 * np.arange(len(shares))[:, None]
    edges = behind + np.linspace(0.0, 1.0, count + 1)
    found = np.interp(edges.ravel(), (shares + behind).ravel(), whole.ravel())
    return np.diff(found.reshape(edges.shape), axis=1)


def engaged_count(times: Array) -> tuple[Array, Array]:
    """Count the engaged and all finished shifts of times (..., n)."""
    return np.isfinite(times).sum(axis=-1).astype(float), (~np.isnan(times)).sum(axis=-1) * 1.0


def from_zero(values: Array) -> Array:
    """Sum rows (m, n) up from zero, (m, n + 1)."""
    return np.concatenate([np.zeros((len(values), 1)), np.cumsum(values, axis=1)], axis=1)
