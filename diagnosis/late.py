"""Late shifts: dogs that pass slot after slot, a rare tail far behind a narrow bulk.

At 100 1/min and more nearly all shifts of an operating point take within some ms, and a few in a
hundred take a tenth of a second more, with hardly anything between. Mixed into one mean and one
standard deviation they would hide what the bulk tells. A shift counts as late that lies behind the
median of its level by more than ``FAR`` times what four fifths of all lie behind it, so that a wait
that many shifts have is none.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

FAR = 5.0  #: times the distance of both quantiles behind the median; 4.2 normal deviations
MIDDLE, MOST = 0.5, 0.8  #: quantiles
LEAST = 8e-3  #: s behind the median, at least
ENOUGH = 3  #: late shifts from which their times are known
PRIOR = 10.0  #: shifts that the share of all levels of an operating point counts as


@dataclass(frozen=True)
class Lateness:
    """How late the late shifts of C operating points are: share, mean and deviation in s, (C,).

    Mean and deviation are NaN where too few shifts were late.
    """

    share: Array
    mean: Array
    sd: Array


def limit(times: Array) -> Array:
    """Return from when on a shift of times (..., n) is late, s, (..., 1)."""
    known = np.where(np.isfinite(times), times, np.nan)
    having = np.isfinite(known).any(axis=-1, keepdims=True)
    filled = np.where(having, known, 0.0)
    middle, most = np.nanquantile(filled, (MIDDLE, MOST), axis=-1, keepdims=True)
    found: Array = middle + np.maximum(FAR * (most - middle), LEAST)
    return found


def bulk(times: Array) -> Array:
    """Return times (..., n) with NaN for late shifts."""
    late = np.isfinite(times) & (times > limit(times))
    found: Array = np.where(late, np.nan, times)
    return found


def late_counts(times: Array) -> tuple[Array, Array]:
    """Return how many shifts of times (..., n) are late, and of how many that engaged, (...)."""
    ended = np.isfinite(times)
    late = ended & (times > limit(times))
    return late.sum(axis=-1) * 1.0, ended.sum(axis=-1) * 1.0


def lateness(every: list[Array]) -> Lateness:
    """Return how late shifts are over arrays (..., C, n) that share their operating points."""
    count, whole, parts = 0.0, 0.0, []
    for times in every:
        some, of = late_counts(times)
        axes = tuple(range(some.ndim - 1))
        count, whole = count + some.sum(axis=axes), whole + of.sum(axis=axes)
        known = np.where(np.isfinite(bulk(times)), times, np.nan)
        having = np.isfinite(known).any(axis=-1, keepdims=True)
        middle = np.nanmean(np.where(having, known, 0.0), axis=-1, keepdims=True)
        excess = np.where(np.isfinite(times) & (times > limit(times)), times - middle, np.nan)
        parts.append(np.moveaxis(excess, -2, 0).reshape(excess.shape[-2], -1))
    joined = np.concatenate(parts, axis=1)
    rows = [row[np.isfinite(row)] for row in joined]
    mean = [row.mean() if row.size >= ENOUGH else np.nan for row in rows]
    sd = [row.std(ddof=1) if row.size >= ENOUGH else np.nan for row in rows]
    return Lateness((count + 0.5) / (np.asarray(whole) + 1.0), np.array(mean), np.array(sd))


def late_shares(times: Array, share: Array) -> Array:
    """Return shares late of times (C, N, n), drawn towards the ``share`` (C,) of all, (C, N)."""
    late, ended = late_counts(times)
    found: Array = (late + PRIOR * share[:, None]) / (ended + PRIOR)
    return found
