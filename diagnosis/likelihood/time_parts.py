"""Parts of the density of a cell's mean and spread: late shifts, an odd cell, both modes.

``diagnosis.likelihood.mean_density`` says what they mean and adds them up.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.special import digamma, gammaln, ndtr, ndtri, polygamma
from scipy.stats import binom

from dogshape.diagnosis.likelihood.cell_predictions import CellPredictions
from dogshape.diagnosis.likelihood.modes import Modes
from dogshape.diagnosis.likelihood.observations import ROUNDING, Observed
from dogshape.diagnosis.prediction.outliers import FAR, LEAST, MOST
from dogshape.diagnosis.terms import Array

LEAST_FREEDOM = 0.5  #: degrees of freedom
HIDDEN = 3  #: outliers that can hide among single shifts
RARE = 1e-6  #: probability of more outliers than a mean's density counts
CROWD = 12.0  #: expected outliers of a mean from which their number counts as normal
ROOT = float(np.sqrt(2.0 * np.pi))
PARTS = "log_share", "score", "width", "spread", "variance"  # fields of ``Parts``


def _waits(
    seen: Observed, predicted: CellPredictions, sampled: tuple[Array, Array]
) -> tuple[Array, Array, Array]:
    """Compute the parts of a mean's density: log share, score, width, (cells, m, parts).

    They are 0, 1, ... outliers within it, and last an odd cell.
    """
    n, share = np.maximum(1.0, seen.n)[:, None], predicted.outlier_share[..., None]
    hidden = np.maximum(0.0, seen.n)[:, None, None]
    waits = _outlier_numbers(seen, predicted)
    ways = gammaln(hidden + 1) - gammaln(waits + 1) - gammaln(np.maximum(hidden - waits, 0.0) + 1)
    log_share = ways + waits * np.log(share) + (hidden - waits) * np.log1p(-share)
    log_share = np.where((waits <= hidden) & seen.hides(waits), log_share, -1e9)
    log_share = log_share - log_sum(log_share, axis=2)[..., None]
    behind, wide = outlier_delay(seen, predicted)
    own, error = _spread(seen, predicted, sampled) ** 2, predicted.error**2
    whole = (own / n + error)[..., None]
    late = _late_beside(seen, predicted, waits)
    if late.any():
        # A standard deviation that late shifts made says nothing of the others' spread.
        own = np.where(late, predicted.sd[..., None] ** 2, own[..., None])
        whole = own / n[..., None] + error[..., None]
    # Of very many outliers the number is normal: one part with its mean and variance.
    expected = seen.in_means[:, None] * predicted.outlier_share
    crowded = _crowded(seen, predicted)
    number = np.where(crowded, expected[..., None], waits)
    varied = np.where(crowded, (expected * (1.0 - predicted.outlier_share))[..., None], 0.0)
    log_share = np.where(crowded, np.where(waits == 0.0, 0.0, -1e9), log_share)
    outliers = number * (wide[..., None] ** 2) + varied * behind[..., None] ** 2
    width = np.sqrt(whole + outliers / (n**2)[..., None])
    centre = predicted.mean[..., None] + number * (behind / n)[..., None]
    if predicted.missed.any():
        missed = np.clip(predicted.missed, 1e-12, 0.5)[..., None]
        log_share = np.concatenate([log_share + np.log1p(-missed), np.log(missed)], axis=2)
        odd = np.sqrt(whole[..., :1] + predicted.jump[..., None] ** 2)
        width = np.concatenate([width, odd], axis=2)
        centre = np.concatenate([centre, predicted.mean[..., None]], axis=2)
    return log_share, (seen.mean[:, None, None] - centre) / width, width


def _crowded(seen: Observed, predicted: CellPredictions) -> np.ndarray:
    """Mark means with so many outliers that their number is normal, (cells, m, 1)."""
    crowded: np.ndarray = (seen.in_means[:, None] * predicted.outlier_share > CROWD)[..., None]
    return crowded


def _late_beside(seen: Observed, predicted: CellPredictions, waits: Array) -> np.ndarray:
    """Mark parts whose outliers hide in a standard deviation beside a mean, (cells, m, parts)."""
    beside = (seen.beside > 0)[:, None, None]
    marked: np.ndarray = beside & ((waits > 0) | _crowded(seen, predicted))
    return marked


def _outlier_numbers(seen: Observed, predicted: CellPredictions) -> Array:
    """List the numbers of outliers that the density of a mean counts, 0, 1, ..., (parts,).

    Outliers among single shifts are found, but for few.
    """
    number = seen.in_means[:, None]
    share = np.where(number * predicted.outlier_share > CROWD, 0.0, predicted.outlier_share)
    # More with a larger share: the largest of each cell has the most.
    most = binom.isf(RARE, number[:, 0], share.max(axis=1)).max(initial=0.0)
    return np.arange(max(float(HIDDEN), most) + 1.0)


def outlier_delay(seen: Observed, predicted: CellPredictions) -> tuple[Array, Array]:
    """Compute mean and deviation of the delay of outliers, s, (cells, m).

    Without simulated outliers, the wait for the next slot beyond the simulated range.
    """
    seen_range = predicted.times[..., -1] - predicted.times[..., 0]
    wait = np.maximum(0.0, np.minimum(seen.wait[:, None], predicted.mean) - seen_range)
    known = np.isfinite(predicted.behind)
    return np.where(known, predicted.behind, wait), np.where(known, predicted.behind_sd, wait)


def log_sum(logs: Array, axis: int) -> Array:
    """Return the logarithm of a sum of exponentials, quicker than scipy's for small arrays."""
    top = np.max(logs, axis=axis, keepdims=True)
    return np.log(np.exp(logs - top).sum(axis=axis)) + np.squeeze(top, axis=axis)


def sample_spread(freedom: Array) -> tuple[Array, Array]:
    """Return bias and variance of the logarithm of a sample's standard deviation.

    They are those of normal times; both are 0 without ``freedom``.
    """
    half = np.maximum(freedom, LEAST_FREEDOM) / 2.0
    bias, variance = 0.5 * (digamma(half) - np.log(half)), 0.25 * polygamma(1, half)
    return np.where(freedom > 0, bias, 0.0), np.where(freedom > 0, variance, 0.0)


def freedom_of(freedom: Array, kurtosis: Array) -> Array:
    """Return the degrees of freedom of samples (cells, 1) at a kurtosis (cells, m), (cells, m)."""
    n = freedom + 1.0
    ratio = (kurtosis - (n - 3.0) / np.maximum(freedom, 1.0)) / n
    whole = 2.0 / np.maximum(ratio, 1e-12)
    return np.where(freedom > 0, np.clip(whole, LEAST_FREEDOM, 2.0 * freedom), 0.0)


def _sampled(seen: Observed, predicted: CellPredictions) -> tuple[Array, Array]:
    """Return bias and variance of the logarithm of the cells' spreads, (cells, m) or (cells, 1)."""
    freedom = seen.freedom[:, None]
    return sample_spread(freedom_of(freedom, predicted.kurtosis) if freedom.any() else freedom)


@dataclass(frozen=True)
class Parts:
    """Parts of the density of means and spreads, (cells, m, parts) each.

    Parameters
    ----------
    log_share : logarithms of their shares.
    score, width : residual of the mean in widths, and width, s.
    spread, variance : residual of the logarithm of the spread in deviations, and their squares.
    chance : logarithm of the share of those without late shifts, (cells, m).
    """

    log_share: Array
    score: Array
    width: Array
    spread: Array
    variance: Array
    chance: Array

    def log_spread(self, freedom: Array) -> Array:
        """Return log densities of the logarithm of single shifts' spread; 0 without freedom."""
        wide = np.log(np.maximum(self.variance, 1e-12))
        log: Array = -0.5 * self.spread**2 - 0.5 * wide - np.log(ROOT)
        return np.where(freedom[:, None, None] > 0, log, 0.0)

    @property
    def fast(self) -> Parts:
        """The part whose shifts are all of the faster mode, which is the last but one."""
        return replace(self, **{name: getattr(self, name)[..., -2:-1] for name in PARTS})

    def joined(self, other: Parts) -> Parts:
        """Add other parts of the same cells."""
        both = {n: np.concatenate([getattr(self, n), getattr(other, n)], axis=2) for n in PARTS}
        return replace(self, **both)


def parts_of(seen: Observed, predicted: CellPredictions) -> Parts:
    """Gather the parts: 0, 1, ... late shifts, and an odd cell.

    Where spreads are seen there are two more, whose shifts are all of one mode.
    """
    sampled = _sampled(seen, predicted)
    share, score, width = _waits(seen, predicted, sampled)
    if not seen.freedom.any():
        nothing = np.zeros_like(share)
        return Parts(share, score, width, nothing, nothing, share[..., 0])
    spread, variance = _spread_parts(seen, predicted, sampled)
    found = Parts(share, score, width, spread, variance, share[..., 0])
    return _with_modes(found, seen, predicted)


def _with_modes(found: Parts, seen: Observed, predicted: CellPredictions) -> Parts:
    """Add the parts whose shifts are all of one mode, in cells that tell a spread.

    Only those shifts whose spread is seen have to be; means beside them are as they are.
    """
    modes = predicted.modes
    count = np.minimum(seen.n, seen.freedom + 1.0)[:, None, None]
    rest = np.maximum(1.0, seen.n)[:, None, None] - count
    there = (seen.freedom > 0)[:, None] & ~_crowded(seen, predicted)[..., 0]
    rare = count * np.log(modes.share)
    taken = np.exp(rare).sum(axis=2) + _divided_share(seen, modes)
    share = found.log_share.copy()
    share[..., 0] += np.where(there, np.log1p(-np.minimum(taken, 1.0 - 1e-9)), 0.0)
    rare = np.where(there[..., None], found.chance[..., None] + rare, -1e9)
    bias, own = (part[..., None] for part in sample_spread(seen.freedom[:, None]))
    shape = np.stack([_shape(predicted, sd) for sd in np.moveaxis(modes.sd, 2, 0)], axis=2)
    variance = np.maximum(own + shape**2, 1e-12)
    off = np.where(there[..., None], seen.log_sd[:, None, None] - bias - np.log(modes.sd), 0.0)
    both = np.exp(np.log(modes.sd) + shape**2 / variance * off)
    mean, sd = predicted.mean[..., None], predicted.sd[..., None]
    # By as much as spreads are wrong both modes lie nearer to each other, or farther apart.
    place = predicted.shape[..., None] * (modes.mean - mean)
    number = count + rest
    scatter = (count * both**2 + rest * sd**2) / number**2
    width = np.sqrt(scatter + place**2 + predicted.error[..., None] ** 2)
    score = (seen.mean[:, None, None] - (count * modes.mean + rest * mean) / number) / width
    modal = Parts(rare, score, width, off / np.sqrt(variance), variance, found.chance)
    return replace(found, log_share=share).joined(modal)


def _divided_share(seen: Observed, modes: Modes) -> Array:
    """Return the probability of slow shifts that would have looked like outliers, (cells, m).

    Zero where outliers are seen, or where not all are single shifts.
    """
    alone = (seen.n == seen.single) & (seen.freedom > 0) & (seen.beside == 0)
    n = np.where(alone, seen.n, 0.0)
    most = np.floor((1.0 - MOST) * (n - 1.0) + ROUNDING)
    fast, slow = np.moveaxis(np.log(modes.share), 2, 0)
    # The quantile of a normal faster mode, by which outliers are told.
    far = np.maximum(FAR * ndtri(MOST) * modes.sd[..., 0], LEAST)
    told = ndtr((modes.mean[..., 1] - modes.mean[..., 0] - far) / modes.sd[..., 1])
    found = np.zeros_like(fast)
    for k in range(1, int(most.max(initial=0.0)) + 1):
        size = n[:, None]
        ways = gammaln(size + 1.0) - gammaln(k + 1.0) - gammaln(np.maximum(size - k, 0.0) + 1.0)
        found += np.where(k <= most[:, None], np.exp(ways + (size - k) * fast + k * slow), 0.0)
    return found * told


def _spread_parts(
    seen: Observed, predicted: CellPredictions, sampled: tuple[Array, Array]
) -> tuple[Array, Array]:
    r"""Score the logarithm of the spread, with variances, (cells, m, parts) each.

    Parts are those of the density of the mean: *j* outliers among *n* that are not found as such
    add :math:`\tau^2 j(n-j)/(n(n-1))` to the variance, and an odd cell any amount.
    """
    bias, own = sampled
    n, waits = np.maximum(2.0, seen.freedom + 1.0)[:, None, None], _outlier_numbers(seen, predicted)
    behind, _ = outlier_delay(seen, predicted)
    among = np.maximum(0.0, waits * (n - waits)) / (n * (n - 1.0))
    square = predicted.sd[..., None] ** 2 + among * behind[..., None] ** 2
    late = _late_beside(seen, predicted, waits)
    if late.any():
        crowded = late & _crowded(seen, predicted)
        square = np.where(crowded, predicted.whole[1][..., None] ** 2, square)
    spread = 0.5 * np.log(square)
    shape = np.where((waits > 0) | late, predicted.rules.late_spread, predicted.shape[..., None])
    if predicted.missed.any():
        last = np.ones_like(spread[..., :1])
        spread = np.concatenate([spread, np.log(predicted.sd)[..., None]], axis=2)
        shape = np.concatenate([shape, predicted.rules.odd_spread * last], axis=2)
    variance = own[..., None] + shape**2
    residual = (seen.log_sd[:, None] - bias)[..., None] - spread
    return residual / np.sqrt(np.maximum(variance, 1e-12)), variance


def _spread(seen: Observed, predicted: CellPredictions, sampled: tuple[Array, Array]) -> Array:
    """Combine the spreads of the simulation and of the sample, s, (cells, m)."""
    bias, own = sampled
    share = predicted.shape**2 / np.maximum(predicted.shape**2 + own, 1e-12)
    share = np.where(seen.freedom[:, None] > 0, share, 0.0)
    log: Array = (1.0 - share) * np.log(predicted.sd) + share * (seen.log_sd[:, None] - bias)
    return np.exp(log)


def slow_parts(parts: Parts, seen: Observed, predicted: CellPredictions) -> Parts:
    """Return the part by which outliers are all of the slower mode, and all others of the faster.

    It is a normal density of the offset that outliers and the mean of the others leave together:
    the error of the simulated mean is one for all of them.
    """
    modes, fast = predicted.modes, parts.fast
    common = predicted.error**2
    own = fast.width[..., 0] ** 2 - common
    place = modes.mean[..., 1] - predicted.mean
    each = modes.sd[..., 1] ** 2 * (1.0 + _shape(predicted, modes.sd[..., 1]) ** 2)
    each = each + (predicted.shape * place) ** 2
    residual = fast.score[..., 0] * fast.width[..., 0]
    sums, weights = residual / own, 1.0 / own
    squares, logs = residual**2 / own, -0.5 * np.log(own)
    for cell in np.flatnonzero(seen.divided):
        apart = seen.outlier_times[cell] - modes.mean[cell, :, 1:]
        wide, share = each[cell], np.log(modes.share[cell, :, 1])
        sums[cell] += apart.sum(axis=1) / wide
        weights[cell] += apart.shape[1] / wide
        squares[cell] += (apart**2).sum(axis=1) / wide
        logs[cell] += apart.shape[1] * (share - 0.5 * np.log(wide) - np.log(ROOT))
    centre, width = sums / weights, np.sqrt(1.0 / weights + common)
    logs = logs - 0.5 * np.log(weights) - 0.5 * (squares - sums**2 / weights)
    return replace(
        fast,
        log_share=fast.log_share + logs[..., None],
        score=(centre / width)[..., None],
        width=width[..., None],
    )


def _shape(predicted: CellPredictions, sd: Array) -> Array:
    """Return the error of the logarithm of the deviation of some shifts alone, (cells, m)."""
    beside = (predicted.rules.spread_error * predicted.simulated) ** 2
    more = beside * (1.0 / sd**2 - 1.0 / predicted.sd**2)
    return np.sqrt(predicted.shape**2 + np.maximum(more, 0.0))
