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
    # Where nothing engages nothing is an outlier.
    middle, most = (finite_quantile(times, share)[..., None] for share in (MIDDLE, MOST))
    outlying = np.isfinite(times) & (times > middle + np.maximum(FAR * (most - middle), LEAST))
    return np.where(outlying, np.nan, times)


def finite_quantile(times: Array, share: float) -> Array:
    """Compute a quantile of the finite times (..., n), (...); 0 where none is.

    It is numpy's ``nanquantile``, which takes row by row where some are not finite.
    """
    ordered = np.sort(np.where(np.isfinite(times), times, np.inf), axis=-1)
    count = np.isfinite(ordered).sum(axis=-1)
    place = share * np.maximum(count - 1, 0)
    below = np.floor(place).astype(int)
    above = np.minimum(below + 1, np.maximum(count - 1, 0))
    ends = np.stack([below, above], axis=-1)
    low, high = np.moveaxis(np.take_along_axis(ordered, ends, axis=-1), -1, 0)
    known, part = count > 0, place - below
    step = np.where(known, high, 0.0) - np.where(known, low, 0.0)
    # From the nearer end, as numpy does, so that digits are the same.
    nearer = np.where(part < 0.5, low + step * part, high - step * (1.0 - part))
    return np.where(known, nearer, 0.0)


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
