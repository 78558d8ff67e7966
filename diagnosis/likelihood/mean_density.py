r"""Density of the times of cells over an offset of their means.

A mean of *n* shifts, *j* of which are outliers (``diagnosis.prediction.outliers``) of the share
:math:`\lambda` with the delay :math:`\tau` and its deviation *w*, has the density

.. math:: f(\bar t) = (1 - \epsilon) \sum_j B(j; n, \lambda) N(\bar t; \mu + j\tau/n,
          \sigma^2/n + j w^2/n^2 + e^2) + \epsilon N(\bar t; \mu, \sigma^2/n + e^2 + m^2).

:math:`\mu, \sigma` are mean and spread of simulated shifts without outliers. The error *e* of the
emulated mean is common to all shifts of a cell and does not average out over *n*. In few cells
(:math:`\epsilon`) the mean is off by much more, *m*: times jump between two simulated levels, or an
entry of the table is wrong. That is so under every hypothesis alike. Of single shifts without
outliers mean and standard deviation *s* count,

.. math:: \ln s \sim N(\ln\sigma + \tfrac12(\psi(\tfrac\nu2) - \ln\tfrac\nu2),
          \tfrac14\psi'(\tfrac\nu2) + \kappa^2),

with :math:`\nu` degrees of freedom, those with which :math:`s^2` has its variance at the simulated
kurtosis: a few shifts far off, which a sample may miss, hardly constrain *s*. The error of the
simulated spread :math:`\kappa` is large of an odd cell; finer shapes are those of few
simulated angles. Given *s*, the spread in the density of their mean is the one of both together.
With the probability that *n* shifts are all of the faster or all of the slower mode
(``diagnosis.likelihood.modes``) mean and spread are those of that mode.

The number of outliers among single shifts is beta-binomial, and each of these has a heavy tail,
:math:`(1/\tau)(1 + (t - t_0)/\tau)^{-2}` from the least quantile on. What looks like outliers of
few shifts may be the slower part of a wide bulk, so that all shifts are read as of one kind, too.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import IntEnum
from typing import Self

import numpy as np
from scipy.special import betaln, digamma, gammaln, log_ndtr, ndtri, polygamma
from scipy.stats import binom

from dogshape.diagnosis.likelihood.cell_predictions import CellPredictions
from dogshape.diagnosis.likelihood.modes import modes_of
from dogshape.diagnosis.likelihood.observations import LEAST, Observed
from dogshape.diagnosis.terms import Array

LEAST_FREEDOM = 0.5  #: degrees of freedom
HIDDEN = 3  #: outliers that can hide among single shifts
RARE = 1e-6  #: probability of more outliers than a mean's density counts
CROWD = 12.0  #: expected outliers of a mean from which their number counts as normal
ROOT = float(np.sqrt(2.0 * np.pi))
PARTS = "log_share", "score", "width", "spread", "variance"  # fields of ``Parts``


@dataclass(frozen=True)
class MeanDensity:
    """Densities of cells' means, mixtures of normal parts, over an offset of the prediction.

    Parameters
    ----------
    log_share, score, width : of each part, (cells, m, parts): with the density of the spread beside
        it, residual in its widths without an offset, and width, s.
    most : logarithm of the largest density of a first part, (cells, m).
    found : logarithm that is taken off, (cells, m).
    """

    log_share: Array
    score: Array
    width: Array
    most: Array
    found: Array

    @classmethod
    def of(cls, seen: Observed, predicted: CellPredictions) -> Self:
        """Gather the parts of all cells: 0, 1, ... late shifts, an odd cell, and both modes.

        Of single shifts with outliers those of two other readings follow (``OutlierReading``).
        """
        parts = _parts_of(seen, predicted)
        found = cls._read(parts, seen, predicted)
        if not seen.divided.any():
            return found
        one = seen.undivided
        whole = cls._read(_parts_of(one, predicted), one, predicted)
        slow = cls._read(parts.fast, seen, predicted)
        of_one_kind, of_slow = _readings(seen, predicted)
        return found._or(whole, seen.divided, of_one_kind)._or(slow, seen.divided, of_slow)

    @classmethod
    def _read(cls, parts: Parts, seen: Observed, predicted: CellPredictions) -> Self:
        logs = parts.log_share
        if seen.freedom.any():
            logs = logs + parts.log_spread(seen.freedom)
        # The number of outliers that are found already implies that there are no more.
        missed = np.log1p(-np.clip(predicted.missed, 1e-12, 0.5)) if predicted.missed.any() else 0.0
        found = ((seen.freedom > 0) & (seen.in_means == 0))[:, None]
        most = logs - parts.log_share - np.log(parts.width * ROOT)
        # Of other parts than the first the share counts, which may be tiny.
        others = (most + parts.log_share)[..., 1:].max(axis=2, initial=-np.inf)
        chance = np.where(found, parts.chance - missed, 0.0)
        return cls(logs, parts.score, parts.width, np.maximum(most[..., 0], others), chance)

    def _or(self, other: MeanDensity, there: np.ndarray, more: Array) -> Self:
        """Add the parts of another reading of some cells, (cells,), ``more`` likely before."""
        more = more + self.found - other.found
        share = np.where(there[:, None, None], other.log_share + more[..., None], -1e9)
        most = np.where(there[:, None], np.maximum(self.most, other.most + more), self.most)
        score = np.concatenate([self.score, other.score], axis=2)
        width = np.concatenate([self.width, other.width], axis=2)
        logs = np.concatenate([self.log_share, share], axis=2)
        return type(self)(logs, score, width, most, self.found)

    def reading(self, offset: Array) -> np.ndarray:
        """Return the likeliest ``OutlierReading`` of outliers at an offset, s, (cells, m)."""
        parts = self.log_share - 0.5 * self._score(offset) ** 2 - np.log(self.width)
        each = parts.shape[2] // 2
        logs = [log_sum(one, axis=2) for one in np.split(parts, [each, 2 * each], axis=2)]
        found: np.ndarray = np.argmax(logs, axis=0)
        return found

    def at(self, offset: Array | None = None) -> tuple[Array, Array, Array]:
        """Return the log density with slope and curvature at an offset, s, (cells, m) each."""
        score = self._score(offset)
        parts = self.log_share - 0.5 * score**2 - np.log(self.width * ROOT)
        log = log_sum(parts, axis=2)
        weight, steep = np.exp(parts - log[..., None]), score / self.width
        first = (weight * steep).sum(axis=2)
        second = (weight * (self.width**-2.0 - (steep - first[..., None]) ** 2)).sum(axis=2)
        # Between two modes the curve bends upwards; a parabola must not rise above the modes.
        below = np.maximum(self.most - log, 0.5)
        return log - self.found, first, np.maximum(second, 0.5 * first**2 / below)

    def near(self, offset: Array, variance: Array) -> tuple[Array, Array]:
        """Return slope and curvature at an offset that is known within a variance, (cells, m) each.

        Each part counts by its probability with such an error of the offset, s^2, (cells, m): a
        cell that it may explain is not odd.
        """
        score = self._score(offset)
        wide = np.sqrt(self.width**2 + variance[..., None])
        parts = self.log_share - 0.5 * (score * self.width / wide) ** 2 - np.log(wide)
        weight = np.exp(parts - log_sum(parts, axis=2)[..., None])
        first: Array = (weight * score / self.width).sum(axis=2)
        return first, (weight * self.width**-2.0).sum(axis=2)

    def _score(self, offset: Array | None) -> Array:
        return self.score if offset is None else self.score - offset[..., None] / self.width


class OutlierReading(IntEnum):
    """Reading of outliers among single shifts."""

    LATE = 0  #: late ones, told by themselves
    ONE_KIND = 1  #: of one kind with all others
    SLOW = 2  #: all of the slower mode, and all others of the faster


def _readings(seen: Observed, predicted: CellPredictions) -> tuple[Array, Array]:
    r"""Return the log odds of the other readings of outliers, (cells, m) each.

    They lack what depends on mean and deviation of the shifts that are none. One kind: few shifts
    that look like outliers may be the tail of a wide bulk. That reading says how probable the same
    times are by mean and deviation of all of them, the others by those of some and the densities of
    the rest. Normal times with one mean and deviation *s* lie anywhere on a sphere, so that

    .. math:: \ln f(t_1 \dots t_n) = \ln f(\bar t, \ln s) - \tfrac12 \ln n
              - \ln\frac{2\pi^{(n-1)/2}}{\Gamma(\tfrac{n-1}2)} - (n-1)\ln(s\sqrt{n-1}).
    """
    one = seen.undivided
    none_late = log_outliers(one, predicted) - log_outliers(seen, predicted)
    of_one_kind = none_late + (log_sphere(seen) - log_sphere(one))[:, None]
    modes = modes_of(predicted.times, LEAST)
    shape = _shape(predicted, modes.sd[..., 1])
    width = np.sqrt(modes.sd[..., 1] ** 2 * (1.0 + shape**2) + predicted.error**2)
    of_slow = none_late
    for place in np.flatnonzero(seen.divided):
        score = (seen.outlier_times[place] - modes.mean[place, :, 1:]) / width[place][:, None]
        each = np.log(modes.share[place, :, 1] / width[place] / ROOT)
        of_slow[place] += (each[:, None] - 0.5 * score**2).sum(axis=1)
    return of_one_kind, of_slow


def _shape(predicted: CellPredictions, sd: Array) -> Array:
    """Return the error of the logarithm of a deviation, (cells, m), of some shifts alone."""
    rules, simulated = predicted.rules, predicted.mean - predicted.delay
    return np.hypot(rules.spread_share, rules.spread_error * simulated / sd)


def log_sphere(seen: Observed) -> Array:
    """Return the logarithm of how many times have one mean and one logarithm of *s*, (cells,)."""
    freedom = np.maximum(seen.freedom, 1.0)
    area = np.log(2.0) + 0.5 * freedom * np.log(np.pi) - gammaln(0.5 * freedom)
    radius = seen.log_sd + 0.5 * np.log(freedom)
    whole = 0.5 * np.log(freedom + 1.0) + area + freedom * radius
    return np.where(seen.freedom > 0, whole, 0.0)


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


def _parts_of(seen: Observed, predicted: CellPredictions) -> Parts:
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
    """Add the parts whose shifts are all of one mode, in cells that tell a spread."""
    modes = modes_of(predicted.times, LEAST)
    rare = seen.n[:, None, None] * np.log(modes.share)
    others = np.log1p(-np.minimum(np.exp(rare).sum(axis=2), 1.0 - 1e-9))
    there = (seen.freedom > 0)[:, None]
    share = found.log_share.copy()
    share[..., 0] += np.where(there, others, 0.0)
    rare = np.where(there[..., None], found.chance[..., None] + rare, -1e9)
    bias, own = (part[..., None] for part in sample_spread(seen.freedom[:, None]))
    shape = np.stack([_shape(predicted, sd) for sd in np.moveaxis(modes.sd, 2, 0)], axis=2)
    variance = own + shape**2
    off = seen.log_sd[:, None, None] - bias - np.log(modes.sd)
    both = np.exp(np.log(modes.sd) + shape**2 / variance * off)
    width = np.sqrt(
        both**2 / np.maximum(1.0, seen.n)[:, None, None] + predicted.error[..., None] ** 2
    )
    score = (seen.mean[:, None, None] - modes.mean) / width
    modal = Parts(rare, score, width, off / np.sqrt(variance), variance, found.chance)
    return replace(found, log_share=share).joined(modal)


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


def log_outliers(seen: Observed, predicted: CellPredictions) -> Array:
    """Compute the log density of number and times of single outliers, (cells, m)."""
    outliers = np.array([times.size for times in seen.outlier_times], dtype=float)[:, None]
    core = seen.single[:, None] - outliers
    a, b = outlier_beta(predicted)
    log: Array = betaln(a + outliers, b + core) - betaln(a, b)
    for place in np.flatnonzero(outliers[:, 0]):
        log[place] += _log_tail(seen, predicted, int(place))
    return log


def _log_tail(seen: Observed, predicted: CellPredictions, place: int) -> Array:
    """Compute the log density of the outlier times of a cell, (m,)."""
    first, last = predicted.times[place, :, :1], predicted.times[place, :, -1:]
    behind = np.nan_to_num(predicted.behind[place], nan=seen.wait[place])[:, None]
    scale = np.maximum(behind, last - first)
    after = np.maximum(0.0, seen.outlier_times[place] - first)
    tail = (1.0 + after / scale) ** -2 / scale
    anything = predicted.rules.late_anything
    return np.log((1.0 - anything) * tail + anything / seen.timeout).sum(axis=1)


def outlier_beta(predicted: CellPredictions) -> tuple[Array, Array]:
    """Compute the Beta parameters of the share of single outliers, (cells, m) each."""
    known = predicted.rules.late_known
    return known * predicted.outlier_share, known * (1.0 - predicted.outlier_share)


def time_scores(
    seen: Observed, predicted: CellPredictions, offset: Array
) -> tuple[Array, Array, Array]:
    """Score means and spreads at an offset, s, and count late shifts, (cells, m) each.

    Scores of means, and of spreads of single shifts, are normal deviates, zero without any, by the
    likeliest ``OutlierReading`` of outliers.
    """
    number = np.array([times.size for times in seen.outlier_times], dtype=float)[:, None]
    parts, none_late = _parts_of(seen, predicted), np.zeros_like(predicted.mean)
    found = (*_scores(seen, parts, offset), number + none_late)
    if not seen.divided.any():
        return found
    reading = MeanDensity.of(seen, predicted).reading(offset)
    reading = np.where(seen.divided[:, None], reading, OutlierReading.LATE)
    whole = _scores(seen, _parts_of(seen.undivided, predicted), offset)
    slow = _scores(seen, parts.fast, offset)
    every = zip(found, (*whole, none_late), (*slow, none_late), strict=True)
    means, spreads, late = (np.choose(reading, three) for three in every)
    return means, spreads, late


def _scores(seen: Observed, parts: Parts, offset: Array) -> tuple[Array, Array]:
    """Score means and spreads by some parts, (cells, m) each."""
    share = parts.log_share - log_sum(parts.log_share, axis=2)[..., None]
    means = _normal(share, parts.score - offset[..., None] / parts.width)
    means = np.nan_to_num(np.where((seen.n > 0)[:, None], means, 0.0), nan=20.0)
    return means, _normal(share, parts.spread)


def _normal(share: Array, residual: Array) -> Array:
    """Return the normal scores of a mixture's parts, (cells, m, parts) to (cells, m)."""
    below, above = (log_sum(share + log_ndtr(sign * residual), axis=2) for sign in (1.0, -1.0))
    # The smaller tail keeps its digits far out.
    low = np.maximum(np.minimum(below, above), -700.0)
    return np.where(below < above, 1.0, -1.0) * ndtri(np.exp(low))
