r"""Likelihood of a cell of bench data under the prediction of a hypothesis.

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
Their number of outliers is beta-binomial, and each of these has a heavy tail,
:math:`(1/\tau)(1 + (t - t_0)/\tau)^{-2}` from the least quantile on.

What cells err in common (``diagnosis.likelihood.discrepancy``) need slope and curvature of all
this over an offset, at one that is likely (``diagnosis.likelihood.likely_offsets``). Shares engaged
are beta-binomial with the error of the emulated share. Unknown shifts are left out, or counted as
failed on request.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Self

import numpy as np
from scipy.special import betaln, digamma, gammaln, log_ndtr, ndtri, polygamma
from scipy.stats import binom

from dogshape.diagnosis.likelihood.discrepancy import Slopes
from dogshape.diagnosis.likelihood.observations import LEAST, Observed
from dogshape.diagnosis.prediction.outliers import added
from dogshape.diagnosis.prediction.prediction import Prediction
from dogshape.diagnosis.settings import Rules
from dogshape.diagnosis.terms import Array

LEAST_FREEDOM = 0.5  #: degrees of freedom
HIDDEN = 3  #: outliers that can hide among single shifts
RARE = 1e-6  #: probability of more outliers than a mean's density counts
CROWD = 12.0  #: expected outliers of a mean from which their number counts as normal
ROOT = float(np.sqrt(2.0 * np.pi))


@dataclass(frozen=True)
class CellPredictions(Prediction):
    """Prediction of all cells, (cells, m), with the error that any simulation has.

    Parameters
    ----------
    mean, sd : of shifts that are no outliers, s.
    model : part of ``error`` that any simulation of the operating points has, s.
    shape : error of the logarithm of ``sd``.
    kurtosis : of ``times``.
    missed, jump : share of cells that are odd, and by how much their mean is off, s.
    rules : errors that are assumed of any simulation.
    """

    mean: Array
    sd: Array
    model: Array
    shape: Array
    kurtosis: Array
    missed: Array
    jump: Array
    rules: Rules

    @classmethod
    def of(cls, cells: list[Prediction], rules: Rules, setting: Array | float = 0.0) -> Self:
        """Gather predictions, one a cell; the model's own error joins the emulator's.

        ``setting`` is the error of each mean by those of its nominal values, s, (cells,).
        """
        every = {f.name: np.stack([getattr(c, f.name) for c in cells]) for f in fields(Prediction)}
        times = every["times"]
        mean = times.mean(axis=2)
        square = (times - mean[..., None]) ** 2
        moment = square.mean(axis=2)
        count = times.shape[2]
        sd = np.maximum(LEAST, np.sqrt(moment * (count / (count - 1.0))))
        simulated = mean - every["delay"]
        model = np.hypot(rules.model_error * simulated, rules.least_error)
        if np.any(setting):
            model = np.hypot(model, np.reshape(setting, (-1, 1)))
        every["error"] = np.maximum(np.hypot(every["error"], model), 1e-5)
        least = max(rules.late_share, 1.0 / (count + 2.0)) * np.isnan(every["behind"])
        share = np.maximum(every["outlier_share"], least)
        every["outlier_share"] = np.clip(share, rules.late_least, 1.0 - rules.late_least)
        shape = np.hypot(rules.spread_share, rules.spread_error * simulated / sd)
        # A square of squares: numpy takes a fourth power by logarithms, 20 times as slow.
        kurtosis = (square**2).mean(axis=2) / np.maximum(moment, 1e-12) ** 2
        odd = np.full_like(mean, rules.odd_share), rules.odd_size * simulated
        return cls(
            **every, mean=mean, sd=sd, model=model, shape=shape, kurtosis=kurtosis,
            missed=odd[0], jump=odd[1], rules=rules,
        )  # fmt: skip

    def moved(self, offsets: Array) -> CellPredictions:
        """Move the prediction of one value (cells, 1) by offsets, s, (cells, m)."""
        one = np.ones_like(offsets[:1])
        every = {f.name: getattr(self, f.name) for f in fields(self) if f.name != "rules"}
        wide = {n: part * (one if part.ndim == 2 else one[..., None]) for n, part in every.items()}
        times = {"times": self.times + offsets[..., None], "mean": self.mean + offsets}
        return type(self)(**{**wide, **times}, rules=self.rules)

    def at_value(self, place: int) -> CellPredictions:
        """Select one of the values, (cells, 1)."""
        every = {f.name: getattr(self, f.name) for f in fields(self) if f.name != "rules"}
        return type(self)(**{n: part[:, [place]] for n, part in every.items()}, rules=self.rules)

    @property
    def whole(self) -> tuple[Array, Array]:
        """Mean and standard deviation with outliers, s."""
        mean, variance = added(self.outlier_share, self.behind, self.behind_sd)
        return self.mean + mean, np.sqrt(self.sd**2 + variance)


def log_sum(logs: Array, axis: int) -> Array:
    """Return the logarithm of a sum of exponentials, quicker than scipy's for small arrays."""
    top = np.max(logs, axis=axis, keepdims=True)
    return np.log(np.exp(logs - top).sum(axis=axis)) + np.squeeze(top, axis=axis)


def log_as_failed(seen: Observed, predicted: CellPredictions, engaged: Array) -> Array:
    """Compute the change of the log probability if unknown shifts are failures, (cells, m).

    ``engaged`` is the log probability of the numbers engaged where they are left out.
    """
    if not seen.unknown.any():
        return np.zeros_like(predicted.engaged)
    return log_engaged(seen, predicted, seen.failed + seen.unknown) - engaged


@dataclass(frozen=True)
class Timed:
    """Log densities of cells' times, (cells, m), and how they change with a cell's offset."""

    log: Array
    first: Array
    second: Array

    @property
    def slopes(self) -> Slopes:
        """Slope and curvature, value by value."""
        return Slopes(self.first.T.copy(), self.second.T.copy())


def timed(
    seen: Observed,
    predicted: CellPredictions,
    of_means: tuple[Array, Array, Array] | None = None,
) -> Timed:
    """Return the logarithm of the density of each cell's times, with its slopes.

    ``of_means`` are log density, slope and curvature of the means, (cells, m) each, those without
    an offset by default (``diagnosis.likelihood.likely_offsets`` has others).
    """
    having = (seen.n > 0)[:, None]
    parts = MeanDensity.of(seen, predicted).at() if of_means is None else of_means
    log, first, second = (np.where(having, part, 0.0) for part in parts)
    log = log + _log_outliers(seen, predicted)
    # A hypothesis by which nothing engages has no times; any time is then as good as another.
    anyhow = seen.shifts[:, None] * np.log(predicted.rules.late_anything / seen.timeout)
    known = np.isfinite(predicted.mean)
    first, second = (np.where(known, np.nan_to_num(part), 0.0) for part in (first, second))
    return Timed(np.where(known, log, anyhow), first, second)


def log_times(seen: Observed, predicted: CellPredictions) -> Array:
    """Return the logarithm of the density of each cell's times, (cells, m)."""
    return timed(seen, predicted).log


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


def _log_spread(seen: Observed, predicted: CellPredictions, sampled: tuple[Array, Array]) -> Array:
    """Return log densities of the logarithm of single shifts' spread, (cells, m, parts)."""
    score, variance = _spread_parts(seen, predicted, sampled)
    log: Array = -0.5 * score**2 - 0.5 * np.log(np.maximum(variance, 1e-12)) - np.log(ROOT)
    return np.where(seen.freedom[:, None, None] > 0, log, 0.0)


def _spread(seen: Observed, predicted: CellPredictions, sampled: tuple[Array, Array]) -> Array:
    """Combine the spreads of the simulation and of the sample, s, (cells, m)."""
    bias, own = sampled
    share = predicted.shape**2 / np.maximum(predicted.shape**2 + own, 1e-12)
    share = np.where(seen.freedom[:, None] > 0, share, 0.0)
    log: Array = (1.0 - share) * np.log(predicted.sd) + share * (seen.log_sd[:, None] - bias)
    return np.exp(log)


def _log_outliers(seen: Observed, predicted: CellPredictions) -> Array:
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


@dataclass(frozen=True)
class MeanDensity:
    """Densities of cells' means, mixtures of normal parts, over an offset of the prediction.

    Parameters
    ----------
    log_share, score, width : of each part, (cells, m, parts): with the density of the spread beside
        it, residual in its widths without an offset, and width, s.
    chance : logarithm of the share of the first part, (cells, m).
    found : logarithm that is taken off, (cells, m).
    """

    log_share: Array
    score: Array
    width: Array
    chance: Array
    found: Array

    @classmethod
    def of(cls, seen: Observed, predicted: CellPredictions) -> Self:
        """Gather the parts of all cells: 0, 1, ... late shifts, and last an odd cell."""
        sampled = _sampled(seen, predicted)
        share, score, width = _waits(seen, predicted, sampled)
        logs = share
        if seen.freedom.any():
            logs = share + _log_spread(seen, predicted, sampled)
        # The number of outliers that are found already implies that there are no more.
        missed = np.log1p(-np.clip(predicted.missed, 1e-12, 0.5)) if predicted.missed.any() else 0.0
        found = ((seen.freedom > 0) & (seen.in_means == 0))[:, None]
        chance = share[..., 0]
        return cls(logs, score, width, chance, np.where(found, chance - missed, 0.0))

    def at(self, offset: Array | None = None) -> tuple[Array, Array, Array]:
        """Return the log density with slope and curvature at an offset, s, (cells, m) each."""
        score = self._score(offset)
        parts = self.log_share - 0.5 * score**2 - np.log(self.width * ROOT)
        log = log_sum(parts, axis=2)
        weight, steep = np.exp(parts - log[..., None]), score / self.width
        first = (weight * steep).sum(axis=2)
        second = (weight * (self.width**-2.0 - (steep - first[..., None]) ** 2)).sum(axis=2)
        # Between two modes the curve bends upwards; a parabola must not rise above the modes.
        most = parts[..., 0] - self.chance + 0.5 * score[..., 0] ** 2
        below = np.maximum(most - log, 0.5)
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


def spread_score(seen: Observed, predicted: CellPredictions) -> Array:
    """Score the residuals of the spreads of single shifts, (cells, m)."""
    sampled = _sampled(seen, predicted)
    share, _, _ = _waits(seen, predicted, sampled)
    return _normal(share, _spread_parts(seen, predicted, sampled)[0])


def outlier_beta(predicted: CellPredictions) -> tuple[Array, Array]:
    """Compute the Beta parameters of the share of single outliers, (cells, m) each."""
    known = predicted.rules.late_known
    return known * predicted.outlier_share, known * (1.0 - predicted.outlier_share)


def log_engaged(seen: Observed, predicted: CellPredictions, failed: Array) -> Array:
    """Return the log probability of the numbers engaged, (cells, m), beta-binomial."""
    a, b = beta_of(predicted)
    engaged, missed = seen.engaged[:, None], failed[:, None]
    tried = engaged + missed
    ways = gammaln(tried + 1) - gammaln(engaged + 1) - gammaln(missed + 1)
    return ways + betaln(a + engaged, b + missed) - betaln(a, b)


def beta_of(predicted: CellPredictions) -> tuple[Array, Array]:
    """Return the parameters of the Beta with the emulated share and its error, (cells, m) each."""
    # A share of exactly one with no error would make one failure impossible.
    share = np.clip(predicted.engaged, 2e-3, 1.0 - 2e-3)
    most = share * (1.0 - share)
    size = most / np.clip(predicted.engaged_error**2, 1e-6, 0.9 * most) - 1.0
    return share * size, (1.0 - share) * size


def time_score(seen: Observed, predicted: CellPredictions) -> Array:
    """Score the residuals of the means as normal deviates, (cells, m).

    Zero without times.
    """
    share, residual, _ = _waits(seen, predicted, _sampled(seen, predicted))
    scores = np.where((seen.n > 0)[:, None], _normal(share, residual), 0.0)
    return np.nan_to_num(scores, nan=20.0)


def _normal(share: Array, residual: Array) -> Array:
    """Return the normal scores of a mixture's parts, (cells, m, parts) to (cells, m)."""
    below, above = (log_sum(share + log_ndtr(sign * residual), axis=2) for sign in (1.0, -1.0))
    # The smaller tail keeps its digits far out.
    low = np.maximum(np.minimum(below, above), -700.0)
    return np.where(below < above, 1.0, -1.0) * ndtri(np.exp(low))
