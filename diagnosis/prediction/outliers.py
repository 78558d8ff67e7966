"""Outliers: shifts whose dogs pass slot after slot, a rare tail far behind a narrow bulk.

At 100 1/min and more nearly all shifts of an operating point take the same time within some ms. A
few in a hundred take a tenth of a second more, with hardly anything between. Mixed into one mean
and one standard deviation they would hide the bulk. An outlier lies behind the median of its level
by more than ``FAR`` times the distance of the 80 % quantile. So a wait that many shifts have makes
no outliers.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dogshape.diagnosis.prediction.angle_means import engaged_mean

Array = NDArray[np.float64]

FAR = 5.0  #: times the distance of both quantiles behind the median; 4.2 normal deviations
MIDDLE, MOST = 0.5, 0.8  #: quantiles
LEAST = 8e-3  #: s behind the median, at least
ENOUGH = 3  #: outliers from which their times are known
PRIOR = 10.0  #: shifts that the share of all levels of an operating point counts as


@dataclass(frozen=True)
class Outliers:
    """Outliers of C operating points: share, mean and deviation of their delay in s, (C,).

    Mean and deviation are NaN where too few shifts were outliers.
    """

    share: Array
    mean: Array
    sd: Array


def bulk(times: Array) -> Array:
    """Replace outliers among times (..., n) by NaN."""
    known = np.where(np.isfinite(times), times, np.nan)
    # Where nothing engages nothing is an outlier, and quantiles of nothing would warn.
    known = np.where(np.isfinite(known).any(axis=-1, keepdims=True), known, 0.0)
    middle, most = np.nanquantile(known, (MIDDLE, MOST), axis=-1, keepdims=True)
    outlying = np.isfinite(times) & (times > middle + np.maximum(FAR * (most - middle), LEAST))
    return np.where(outlying, np.nan, times)


def outlier_counts(times: Array, bulk_times: Array) -> tuple[Array, Array]:
    """Count the outliers of times (..., n), and the shifts that engaged, (...).

    ``bulk_times`` is their bulk.
    """
    ended = np.isfinite(times).sum(axis=-1) * 1.0
    return ended - np.isfinite(bulk_times).sum(axis=-1), ended


def outlier_statistics(every: list[tuple[Array, Array]]) -> Outliers:
    """Estimate share and delay of outliers from times (..., C, n) with their bulks."""
    count, whole, parts = 0.0, 0.0, []
    for times, bulk_times in every:
        some, of = outlier_counts(times, bulk_times)
        levels = tuple(range(some.ndim - 1))
        count, whole = count + some.sum(axis=levels), whole + of.sum(axis=levels)
        outlying = np.isfinite(times) & np.isnan(bulk_times)
        excess = np.where(outlying, times - engaged_mean(bulk_times)[..., None], np.nan)
        parts.append(np.moveaxis(excess, -2, 0).reshape(excess.shape[-2], -1))
    rows = [row[np.isfinite(row)] for row in np.concatenate(parts, axis=1)]
    mean = [row.mean() if row.size >= ENOUGH else np.nan for row in rows]
    sd = [row.std(ddof=1) if row.size >= ENOUGH else np.nan for row in rows]
    return Outliers((count + 0.5) / (np.asarray(whole) + 1.0), np.array(mean), np.array(sd))


def outlier_shares(times: Array, bulk_times: Array, share: Array) -> Array:
    """Estimate shares of outliers (C, N), drawn towards the ``share`` (C,) of all levels."""
    outlying, ended = outlier_counts(times, bulk_times)
    return (outlying + PRIOR * share[:, None]) / (ended + PRIOR)


def added(outlying: Array, behind: Array, behind_sd: Array) -> tuple[Array, Array]:
    """Compute mean and variance that outliers add to those of the others, s and s^2.

    ``outlying`` is their share, ``behind`` and ``behind_sd`` are mean and deviation of their delay,
    s; NaN counts as no delay.
    """
    far, wide = np.nan_to_num(behind), np.nan_to_num(behind_sd)
    return outlying * far, outlying * wide**2 + outlying * (1.0 - outlying) * far**2
