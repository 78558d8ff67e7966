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

from dogshape.diagnosis.prediction.angle_means import engaged_mean

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


def bulk(times: Array) -> Array:
    """Return times (..., n) with NaN for late shifts."""
    known = np.where(np.isfinite(times), times, np.nan)
    # Where nothing engages nothing is late, and quantiles of nothing would warn.
    known = np.where(np.isfinite(known).any(axis=-1, keepdims=True), known, 0.0)
    middle, most = np.nanquantile(known, (MIDDLE, MOST), axis=-1, keepdims=True)
    late = np.isfinite(times) & (times > middle + np.maximum(FAR * (most - middle), LEAST))
    found: Array = np.where(late, np.nan, times)
    return found


def late_counts(times: Array, soon: Array) -> tuple[Array, Array]:
    """Return how many shifts of times (..., n) are late, and of how many that engaged, (...).

    ``soon`` is their bulk.
    """
    ended = np.isfinite(times).sum(axis=-1) * 1.0
    return ended - np.isfinite(soon).sum(axis=-1), ended


def lateness(every: list[tuple[Array, Array]]) -> Lateness:
    """Return how late shifts are, from times (..., C, n) that share their points, with bulks."""
    count, whole, parts = 0.0, 0.0, []
    for times, soon in every:
        some, of = late_counts(times, soon)
        levels = tuple(range(some.ndim - 1))
        count, whole = count + some.sum(axis=levels), whole + of.sum(axis=levels)
        late = np.isfinite(times) & np.isnan(soon)
        excess = np.where(late, times - engaged_mean(soon)[..., None], np.nan)
        parts.append(np.moveaxis(excess, -2, 0).reshape(excess.shape[-2], -1))
    rows = [row[np.isfinite(row)] for row in np.concatenate(parts, axis=1)]
    mean = [row.mean() if row.size >= ENOUGH else np.nan for row in rows]
    sd = [row.std(ddof=1) if row.size >= ENOUGH else np.nan for row in rows]
    return Lateness((count + 0.5) / (np.asarray(whole) + 1.0), np.array(mean), np.array(sd))


def late_shares(times: Array, soon: Array, share: Array) -> Array:
    """Return shares late of times (C, N, n), drawn towards the ``share`` (C,) of all, (C, N)."""
    late, ended = late_counts(times, soon)
    found: Array = (late + PRIOR * share[:, None]) / (ended + PRIOR)
    return found


def added(late: Array, behind: Array, behind_sd: Array) -> tuple[Array, Array]:
    """Return what late shifts add to mean and variance of the others, s and s^2.

    ``late`` is their share, ``behind`` and ``behind_sd`` by how much they are later, s; nothing is
    added where that is NaN.
    """
    far, wide = np.nan_to_num(behind), np.nan_to_num(behind_sd)
    return late * far, late * wide**2 + late * (1.0 - late) * far**2
