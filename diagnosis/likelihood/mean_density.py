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

from dataclasses import dataclass
from enum import IntEnum
from typing import Self

import numpy as np
from scipy.special import betaln, gammaln, log_ndtr, ndtri

from dogshape.diagnosis.likelihood.cell_predictions import CellPredictions
from dogshape.diagnosis.likelihood.observations import Observed
from dogshape.diagnosis.likelihood.time_parts import ROOT, Parts, log_sum, parts_of, slow_parts
from dogshape.diagnosis.terms import Array


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
        parts = parts_of(seen, predicted)
        found = cls._read(parts, seen, predicted)
        if not seen.divided.any():
            return found
        one = seen.undivided
        whole = cls._read(parts_of(one, predicted), one, predicted)
        slow = cls._read(slow_parts(parts, seen, predicted), seen, predicted, plain=False)
        none_late = log_outliers(one, predicted) - log_outliers(seen, predicted)
        of_one_kind = none_late + (log_sphere(seen) - log_sphere(one))[:, None]
        return found._or(whole, seen.divided, of_one_kind)._or(slow, seen.divided, none_late)

    @classmethod
    def _read(
        cls, parts: Parts, seen: Observed, predicted: CellPredictions, *, plain: bool = True
    ) -> Self:
        logs = parts.log_share
        if seen.freedom.any():
            logs = logs + parts.log_spread(seen.freedom)
        # The number of outliers that are found already implies that there are no more.
        missed = np.log1p(-np.clip(predicted.missed, 1e-12, 0.5)) if predicted.missed.any() else 0.0
        found = ((seen.freedom > 0) & (seen.in_means == 0))[:, None]
        most = logs - parts.log_share - np.log(parts.width * ROOT)
        # Of other parts than the plain first one the share counts, which may be tiny.
        shared = most + parts.log_share
        most = np.maximum(
            most[..., 0] if plain else shared[..., 0], shared[..., 1:].max(axis=2, initial=-np.inf)
        )
        chance = np.where(found, parts.chance - missed, 0.0)
        return cls(logs, parts.score, parts.width, most, chance)

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


def log_sphere(seen: Observed) -> Array:
    r"""Return the logarithm of how many times have one mean and one logarithm of *s*, (cells,).

    Normal times with one mean and deviation *s* lie anywhere on a sphere, so that

    .. math:: \ln f(t_1 \dots t_n) = \ln f(\bar t, \ln s) - \tfrac12 \ln n
              - \ln\frac{2\pi^{(n-1)/2}}{\Gamma(\tfrac{n-1}2)} - (n-1)\ln(s\sqrt{n-1}),

    where the last three terms are this with its sign changed. It makes densities by mean and
    deviation of all shifts, and of some of them, densities of the same times.
    """
    freedom = np.maximum(seen.freedom, 1.0)
    area = np.log(2.0) + 0.5 * freedom * np.log(np.pi) - gammaln(0.5 * freedom)
    radius = seen.log_sd + 0.5 * np.log(freedom)
    whole = 0.5 * np.log(freedom + 1.0) + area + freedom * radius
    return np.where(seen.freedom > 0, whole, 0.0)


def log_outliers(seen: Observed, predicted: CellPredictions) -> Array:
    """Compute the log density of number and times of single outliers, (cells, m)."""
    outliers = np.array([times.size for times in seen.outlier_times], dtype=float)[:, None]
    # A single shift alone may be late unseen, as a mean of one: its density has that already.
    core = (seen.single[:, None] - outliers) * (seen.freedom > seen.beside)[:, None]
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
    parts, none_late = parts_of(seen, predicted), np.zeros_like(predicted.mean)
    found = (*_scores(seen, parts, offset), number + none_late)
    if not seen.divided.any():
        return found
    reading = MeanDensity.of(seen, predicted).reading(offset)
    reading = np.where(seen.divided[:, None], reading, OutlierReading.LATE)
    whole = _scores(seen, parts_of(seen.undivided, predicted), offset)
    slow = _scores(seen, slow_parts(parts, seen, predicted), offset)
    every = zip(found, (*whole, none_late), (*slow, none_late), strict=True)
    means, spreads, late = (np.choose(reading, three) for three in every)
    return means, spreads, late


def _scores(seen: Observed, parts: Parts, offset: Array) -> tuple[Array, Array]:
    """Score means and spreads by some parts, (cells, m) each."""
    share = parts.log_share - log_sum(parts.log_share, axis=2)[..., None]
    means = _normal(share, parts.score - offset[..., None] / parts.width)
    means = np.nan_to_num(np.where((seen.n > 0)[:, None], means, 0.0), nan=20.0)
    return means, np.nan_to_num(_normal(share, parts.spread), nan=20.0)


def _normal(share: Array, residual: Array) -> Array:
    """Return the normal scores of a mixture's parts, (cells, m, parts) to (cells, m)."""
    below, above = (log_sum(share + log_ndtr(sign * residual), axis=2) for sign in (1.0, -1.0))
    # The smaller tail keeps its digits far out.
    low = np.maximum(np.minimum(below, above), -700.0)
    return np.where(below < above, 1.0, -1.0) * ndtri(np.exp(low))
