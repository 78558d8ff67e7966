r"""Likelihood of a data set under a hypothesis, common errors integrated in closed form.

The mean of the shifts at an operating point *k* is

.. math:: \bar t_k = \mu_k + s\, m_k\, (B z)_k + (F u)_k + \epsilon_k,
          \qquad z, u \sim N(0, 1),\; \epsilon_k \sim N(0, \sigma_k^2/n_k + e_k^2),

with :math:`m_k` the predicted time without dead time, *B* the root of the discrepancy's covariance,
whose amplitude *s* is summed over, and *F* all other errors in common. A variance of single shifts
over the predicted one follows Fisher's *F*. Any number of late shifts may hide in a mean, and a
mean may be odd: each point takes the most probable of these, with the probability of all.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from scipy.special import betaln, expit, gammaln, logit, logsumexp
from scipy.stats import f as f_distribution
from scipy.stats import norm

from dogshape.diagnosis.bench.bench_data import Bench
from dogshape.diagnosis.bench.stand_file import Tolerance
from dogshape.diagnosis.likelihood.observed import Observed
from dogshape.diagnosis.prediction.model import Model, Predicted
from dogshape.diagnosis.prediction.moments import LEAST_SD
from dogshape.diagnosis.settings import Settings
from dogshape.diagnosis.terms import Array
from dogshape.sim.units import RPM

NODES = np.array([0.1, 0.4, 0.8, 1.3, 2.0, 3.0])  #: amplitudes over the scale of their prior
#: Prior probabilities of the nodes: half-normal, by their midpoints.
WEIGHTS = np.diff([0.0, *(2.0 * norm.cdf(np.sqrt(NODES[1:] * NODES[:-1])) - 1.0), 1.0])
KEPT = 0.02  #: of the largest eigenvalue, from which a direction of the discrepancy counts
MOST_LATE = 6  #: numbers of late shifts within one mean that are tried beside 0
TABLE = 257  #: shares at which probabilities of numbers of shifts are computed
STEP = 0.05  #: of force and mismatch, by which times are differentiated
QUANTILES = norm.ppf((np.arange(9) + 0.5) / 9)  #: of a nuisance


class Terms(NamedTuple):
    """Log likelihood of m values, and what it rests on."""

    log: Array  #: (m,)
    nodes: Array  #: of each amplitude, (m, nodes)
    residual: Array  #: of the means given their late shifts, s, (m, c)
    variance: Array  #: s^2, (m, c)


def _root(covariance: Array) -> Array:
    """Compute a root (n, r) of a covariance without its least directions."""
    values, vectors = np.linalg.eigh(covariance)
    kept = values > KEPT * values.max()
    return np.asarray(vectors[:, kept] * np.sqrt(values[kept]))


@dataclass(frozen=True)
class Likelihood:
    """Likelihood of what a data set shows, for predictions of a model."""

    bench: Bench
    seen: Observed
    model: Model
    settings: Settings

    @cached_property
    def having(self) -> np.ndarray:
        """Places of the points that have a mean, (c,)."""
        return np.flatnonzero(self.seen.count > 0)

    @cached_property
    def smooth(self) -> Array:
        """Root *B* of the discrepancy's correlation over all points, (C, r)."""
        where = np.log(abs(self.seen.mismatch) + RPM) / self.settings.discrepancy_length
        force = np.log(self.seen.force)
        force = (force - force.mean()) / max(float(force.std()), 0.1)
        near = np.exp(-0.5 * (where[:, None] - where[None]) ** 2)
        shape = self.settings.discrepancy_shape
        return _root(shape[0] + shape[1] * near + shape[2] * near * np.outer(force, force))

    @cached_property
    def shared(self) -> Array:
        """Relative errors in common, (C, q): those of nuisances, then of nominal values."""
        return np.hstack([self.nuisances, self._nominal(self.bench.errors.systematic)])

    @cached_property
    def nuisances(self) -> Array:
        """Relative errors in common by nuisances, the first two directions of each, (C, q)."""
        parts = [np.zeros((self.model.cells, 0))]
        for name, effect in self.model.nuisances.items():
            (only,) = effect.parameters
            factors = self.settings.nuisance[name] ** QUANTILES
            values = np.clip(only.neutral_of(self.model.setting) * factors, only.low, only.high)
            moments = self.model.changes(name, values[:, None]).moments
            changes = moments[..., 0] / len(QUANTILES) ** 0.5
            _, sizes, directions = np.linalg.svd(changes, full_matrices=False)
            parts.append((sizes[:2, None] * directions[:2]).T)
        return np.hstack(parts)

    @cached_property
    def sensitivity(self) -> tuple[Array, Array]:
        """Changes of ln time with ln force and with mismatch in rad/s, (C,) each."""
        ends = np.array([1.0 - STEP, 1.0 + STEP])
        force = self.model.changes("force_scale", ends[:, None]).moments
        speed = self.model.changes("mismatch_speed", np.stack([0.0 * ends, ends], axis=1)).moments
        slopes = [(one[1, :, 0] - one[0, :, 0]) / (2.0 * STEP) for one in (force, speed)]
        slip = np.maximum(abs(self.seen.mismatch), RPM) * np.sign(self.seen.mismatch + 1e-12)
        return slopes[0], slopes[1] / slip

    def _nominal(self, size: Tolerance) -> Array:
        """Compute relative errors of the mean by errors of nominal values, (C, q)."""
        if not size:
            return np.zeros((self.model.cells, 0))
        force, mismatch = self.sensitivity
        slopes = force, force / self.seen.force, mismatch * self.seen.mismatch, mismatch
        every = [slope * one for slope, one in zip(slopes, size.sizes, strict=True)]
        return np.stack([one for one in every if one.any()], axis=1)

    @cached_property
    def each(self) -> Array:
        """Relative variance of each point's mean by errors of its nominal values, (C,)."""
        return np.asarray((self._nominal(self.bench.errors.each_point) ** 2).sum(axis=1))

    @cached_property
    def absolute(self) -> Array:
        """Errors in common in s, (C, q): drift, half a step of the clock."""
        drift = [] if self.seen.drift is None else [self.seen.drift.offsets]
        step = self.bench.clock_step or 0.0
        columns = [*drift, *([np.full(self.model.cells, 0.5 * step)] if step else [])]
        return np.array(columns).reshape(-1, self.model.cells).T

    def own_variance(self, p: Predicted) -> Array:
        """Compute the variance of each mean by errors of its own but scatter, s^2, (m, C)."""
        simulated = p.mean - p.delay
        model = np.maximum(self.settings.model_error * simulated, self.settings.least_error)
        clock = (self.bench.clock_step or 0.0) ** 2 / 12.0 / np.maximum(self.seen.count, 1.0)
        return np.asarray(p.error**2 + model**2 + self.each * simulated**2 + clock)

    def all_columns(self, p: Predicted, amplitude: Array | float) -> Array:
        """Compute all errors in common with a discrepancy of amplitude (m,), s, (m, C, r + q)."""
        size = np.asarray(amplitude).reshape(-1, 1, 1)
        smooth = size * (p.mean - p.delay)[..., None] * self.smooth
        return np.concatenate([smooth, self.columns(p)], axis=2)

    def columns(self, p: Predicted) -> Array:
        """Compute all errors in common but the discrepancy, s, (m, C, q)."""
        simulated = (p.mean - p.delay)[..., None]
        absolute = np.broadcast_to(self.absolute, (len(p.mean), *self.absolute.shape))
        return np.concatenate([simulated * self.shared, absolute, p.common[..., None]], axis=2)

    def terms(self, p: Predicted, unlisted: tuple[float, float] | None = None) -> Terms:
        """Compute the log likelihood of predictions.

        ``unlisted`` are amplitude and length of what no effect explains; None without.
        """
        some = self.having
        q = p.only((slice(None), some))
        simulated = q.mean - q.delay
        own, fixed = self.own_variance(p)[:, some], self.columns(p)[:, some]
        basis = simulated[..., None] * self.smooth[some]
        if unlisted is not None:
            size, length = unlisted
            own = own + (1.0 - self.settings.unlisted_smooth) * (size * simulated) ** 2
            free = simulated[..., None] * self._unlisted_root(length)
            fixed = np.concatenate([fixed, size * free], axis=2)
        residual, variance, other = self._chosen(q, own, basis, fixed)
        log, nodes = _integrated(residual, variance, basis, fixed, self.settings.discrepancy)
        other = other + self.log_engaged(p)
        return Terms(log + other, nodes + other[:, None], residual, variance)

    def _unlisted_root(self, length: float) -> Array:
        """Compute the root of the covariance of what no effect explains, (c, r)."""
        where = np.log([self.seen.force, abs(self.seen.mismatch) + RPM])[:, self.having]
        square = ((where[:, :, None] - where[:, None]) ** 2).sum(axis=0)
        return self.settings.unlisted_smooth**0.5 * _root(np.exp(-0.5 * square / length**2))

    def _chosen(
        self, q: Predicted, own: Array, basis: Array, fixed: Array
    ) -> tuple[Array, Array, Array]:
        """Choose late and odd means: residual, variance (m, c), log probability beside (m,)."""
        options, seen = self._options, self.seen.mean[self.having]
        at, part = options.point, options.part
        behind, behind_sd = (one[self.having][at] for one in self.model.behind)
        log_part, offset, variance = self._modes(q)

        def of(pair: Array) -> Array:
            return np.where(options.main, pair[1][:, at], pair[0][:, at])

        shift, single = part * behind + of(offset), of(variance)
        timely = np.where(part == 0.0, of(self._scatter(q, variance)), single)
        scatter = timely * (1.0 - part) + part * behind_sd**2
        scatter = scatter / self.seen.count[self.having][at]
        number = options.log_number.at(q.late, at) + of(log_part)
        mixed = single * (1.0 - part) + part * behind_sd**2 + part * (1.0 - part) * behind**2
        weight = number + self._spread(q, mixed)

        usual = np.where(options.odd, 0.0, np.exp(number))
        rough = options.summed(usual * shift)
        wide = own + options.summed(usual * (shift**2 + scatter)) - rough**2
        columns = np.concatenate([self.settings.discrepancy * basis, fixed], axis=2)

        oddly = np.where(options.odd, self.settings.odd_size * q.mean[:, at], 0.0) ** 2
        variance = scatter + own[:, at] + oddly
        rows = np.arange(len(weight))[:, None]

        def chosen(fitted: Array, left: Array) -> tuple[Array, Array, Array]:
            gap, beside = (seen - q.mean - fitted)[:, at] - shift, variance + left[:, at]
            scored = weight - 0.5 * (gap**2 / beside + np.log(2.0 * np.pi * beside))
            best, among = options.best(scored)
            log = (among + weight[rows, best]).sum(axis=1)
            return seen - q.mean - shift[rows, best], variance[rows, best], log

        # Late shifts bend the first fit of the errors in common.
        residual, own, _ = chosen(*_fitted(seen - q.mean - rough, wide, columns))
        return chosen(*_fitted(residual, own, columns))

    def _modes(self, q: Predicted) -> tuple[Array, Array, Array]:
        """Part the shifts of a point by whether some lie in the smaller mode, (2, m, c) each.

        Log probability, offset of their mean, s, and variance of single ones, s^2: with some, and
        with none.
        """
        log = self.seen.count[self.having] * np.log1p(-np.minimum(q.minor, 1.0 - 1e-9))
        none = np.minimum(np.exp(log), 0.99)
        narrow = np.maximum(q.narrow, LEAST_SD) ** 2
        wide = np.maximum((q.sd**2 - none * narrow) / (1.0 - none), LEAST_SD**2)
        offset = np.stack([-none * q.main / (1.0 - none), q.main])
        log = np.stack([np.log1p(-none), np.minimum(log, np.log(0.99))])
        return log, offset, np.stack([wide, narrow])

    @cached_property
    def _options(self) -> _Options:
        """Numbers of late shifts that each mean may have within, and an odd mean."""
        some, seen = self.having, self.seen
        n, late, hidden = seen.count[some], seen.late[some], seen.hidden[some]
        most = int(min(MOST_LATE, n[hidden].max())) if hidden.any() else 0
        k, width = _late_numbers(n[:, None], most)
        within = np.where(hidden[:, None], k, 0.0)
        more, whole = within + late[:, None], (n + late)[:, None]
        possible = (k <= n[:, None]) & (hidden[:, None] | (k == 0))
        share = _shares(self.settings.late_least, 0.9)[:, None, None]
        log = _log_number(share, more, whole, self.settings.late_known) + np.log(width)
        log = np.where(possible, log, -np.inf)
        # Numbers that stand for several have the probability 1 together only about.
        means = (hidden & (late == 0))[:, None]
        log = log - np.where(means, logsumexp(log, axis=2, keepdims=True), 0.0)
        odd = log[..., :1] + np.log(self.settings.odd_share)
        kept = np.hstack([possible, np.ones((len(n), 2), dtype=bool)])
        part = np.hstack([np.minimum(within / n[:, None], 1.0), np.zeros((len(n), 2))])
        table = np.concatenate([log, odd, log[..., :1]], axis=2)[:, kept]
        point, place = np.nonzero(kept)
        ends = (self.settings.late_least, 0.9)
        odd_mean, main = place == most + 1, place == most + 2
        return _Options(point, part[kept], odd_mean, main, _Table(*ends, table))

    def _scatter(self, q: Predicted, predicted: Array) -> Array:
        """Estimate variances of timely shifts from predicted and observed ones, (2, m, c).

        Both are uncertain, so means scatter as Student's distribution: theirs is its variance.
        """
        seen, some, other = self.seen, self.having, freedom_of(self._spread_error(q))
        freedom = np.where(seen.freedom[some] > 0.0, self._freedom(q.shape, 0.0), 0.0)
        whole = np.maximum(other + freedom - 2.0, 0.5 * (other + freedom))
        return np.asarray((other * predicted + freedom * seen.variance[some]) / whole)

    def _spread(self, q: Predicted, variance: Array) -> Array:
        """Compute the log density of the variance with each option, (m, P); some are odd."""
        found = np.zeros_like(variance)
        known = np.flatnonzero(self.seen.freedom[self.having][self._options.point] > 0.0)
        at = self._options.point[known]
        shape = np.where(
            self._options.main[known], self.model.shape[self.having][at], q.shape[:, at]
        )
        freedom = self._freedom(shape, q.blur[:, at], at)
        ratio = self.seen.variance[self.having][at] / variance[:, known]
        error, odd = self._spread_error(q, 0.5)[:, at], self.settings.odd_spread
        usual, wide = (_log_f(ratio, freedom, freedom_of(e)) for e in (error, error + 1.0))
        found[:, known] = np.logaddexp(np.log1p(-odd) + usual, np.log(odd) + wide)
        return found

    def _spread_error(self, q: Predicted, part: float = 1.0) -> Array:
        """Compute the variance of ln of a predicted spread, (m, c), with a ``part`` of its blur."""
        more = np.log1p(self.settings.spread_error * (q.mean - q.delay) / q.sd)
        return np.asarray(self.settings.spread_share**2 + more**2 + part * q.blur**2)

    def _freedom(self, shape: Array, blur: Array | float, at: Any = slice(None)) -> Array:
        """Compute degrees of freedom of observed variances, less by half of a blur, (m, n)."""
        seen = self.seen.freedom[self.having][at]
        n = np.maximum(seen + 1.0, 2.0)
        spread = 2.0 / (n - 1.0) + shape / n + 2.0 * blur**2
        freedom = np.maximum(2.0 / np.maximum(spread, 1e-3), 0.5)
        return np.where(seen > 0.0, freedom, 1e-9)

    def spread_scores(self, p: Predicted) -> Array:
        """Compute normal deviates of the observed spreads; NaN for none, (m, c)."""
        seen, some = self.seen, self.having
        q = p.only((slice(None), some))
        error, odd = self._spread_error(q, 0.5), self.settings.odd_spread
        log_part, _, variance = self._modes(q)
        below = np.zeros_like(q.sd)
        shapes = q.shape, self.model.shape[some]
        ratios = seen.variance[some] / variance
        for share, ratio, shape in zip(np.exp(log_part), ratios, shapes, strict=True):
            freedom = np.broadcast_to(self._freedom(shape, q.blur), ratio.shape)
            usual, wide = (
                f_distribution.cdf(ratio, freedom, freedom_of(e)) for e in (error, error + 1.0)
            )
            below += share * ((1.0 - odd) * usual + odd * wide)
        score = norm.ppf(np.clip(below, 1e-12, 1.0 - 1e-12))
        known = (self._freedom(q.shape, 0.0) > 1.0) & ~seen.hidden[some]
        return np.where(known, score, np.nan)

    def log_engaged(self, p: Predicted) -> Array:
        """Compute the log probability of the numbers that engaged, (m,)."""
        return np.asarray(self._engaged.at(p.engaged).sum(axis=1))

    @cached_property
    def _engaged(self) -> _Table:
        shares, engaged = _shares(0.01, 0.99)[:, None], self.seen.engaged
        known = self.settings.late_known
        return _Table(0.01, 0.99, _log_number(shares, engaged, engaged + self.seen.failed, known))

    def late_mean(self, p: Predicted) -> Array:
        """Compute the mean of all shifts, late ones too, s, (m, C)."""
        return np.asarray(p.mean + np.clip(p.late, 0.0, 0.9) * self.model.behind[0])

    def drawn(self, p: Predicted, generator: np.random.Generator) -> tuple[Array, Array, Array]:
        """Draw common errors of each prediction given the data.

        Amplitudes of the discrepancy, (m,); the errors, s, (m, C); the part of them by nuisances.
        """
        found = self.terms(p)
        weights = np.exp(found.nodes - logsumexp(found.nodes, axis=1, keepdims=True))
        pick = (generator.random((len(weights), 1)) > weights.cumsum(axis=1)).sum(axis=1)
        amplitude = self.settings.discrepancy * NODES[np.minimum(pick, len(NODES) - 1)]
        every = self.all_columns(p, amplitude)
        some = every[:, self.having]
        scaled = (some / found.variance[..., None]).swapaxes(1, 2)
        root = np.linalg.inv(np.linalg.cholesky(np.eye(every.shape[2]) + scaled @ some))
        mean = root @ scaled @ found.residual[..., None]
        noise = generator.standard_normal(mean.shape[:2])[..., None]
        parts = every * (root.swapaxes(1, 2) @ (mean + noise)).swapaxes(1, 2)
        first = self.smooth.shape[1]
        nuisances = parts[..., first : first + self.nuisances.shape[1]]
        return amplitude, parts.sum(axis=2), nuisances.sum(axis=2)


def freedom_of(error: Array) -> Array:
    """Compute degrees of freedom by which ln of a spread has a variance, to second order."""
    return 0.5 / error + 1.0


def _late_numbers(n: Array, most: int) -> tuple[Array, Array]:
    """List numbers of late shifts for 0 to n, and how many each stands for, (c, K)."""
    k, single = np.arange(most + 1.0)[None], most // 2
    wide = np.maximum(1.0, (n - single) / max(most - single, 1))
    width = np.where(k > single, wide, 1.0)
    return np.where(k > single, single + 0.5 + (k - single - 0.5) * wide, k), width


def _log_f(ratio: Array, one: Array, other: Array) -> Array:
    """Compute the log density of the logarithm of Fisher's F of given degrees of freedom."""
    x = one * ratio / other
    log = gammaln(0.5 * (one + other)) - gammaln(0.5 * other) - gammaln(0.5 * one)
    log = log + 0.5 * one * np.log(np.maximum(x, 1e-300)) - 0.5 * (one + other) * np.log1p(x)
    return np.asarray(log)


def _log_number(share: Array, count: Array, whole: Array, known: float) -> Array:
    """Compute the log beta-binomial probability of a count; ``known`` shifts gave its share."""
    alpha, beta = known * share, known * (1.0 - share)
    log = betaln(count + alpha, whole - count + beta) - betaln(alpha, beta)
    choose = gammaln(whole + 1.0) - gammaln(count + 1.0)
    return np.asarray(log + choose - gammaln(np.maximum(whole - count, 0.0) + 1.0))


def _shares(low: float, high: float) -> Array:
    """List the shares of a table, even in the logarithm of the odds, (TABLE,)."""
    return np.asarray(expit(np.linspace(logit(low), logit(high), TABLE)))


@dataclass(frozen=True)
class _Table:
    """Functions of a share from ``low`` to ``high``: values at ``_shares``, (TABLE, P)."""

    low: float
    high: float
    values: Array

    def at(self, share: Array, which: np.ndarray | slice = slice(None)) -> Array:
        """Interpolate at shares (m, c), of which each function has the one at ``which``, (m, P)."""
        low, high = logit(self.low), logit(self.high)
        place = (logit(np.clip(share, self.low, self.high)) - low) * ((TABLE - 1) / (high - low))
        place = place[:, which]
        below = np.clip(place.astype(int), 0, TABLE - 2)
        columns = np.arange(place.shape[1])
        first, second = self.values[below, columns], self.values[below + 1, columns]
        return np.asarray(first + (place - below) * (second - first))


@dataclass(frozen=True)
class _Options:
    """Possible means: the options of all points one after the other, P in all."""

    point: np.ndarray  #: place among the points with a mean, ascending
    part: Array  #: share of late shifts within the mean
    odd: np.ndarray  #: whether the mean is odd
    main: np.ndarray  #: whether all shifts lie in the larger mode
    log_number: _Table  #: log probability by the share of late shifts

    @cached_property
    def _starts(self) -> np.ndarray:
        return np.flatnonzero(np.diff(self.point, prepend=-1))

    def summed(self, values: Array) -> Array:
        """Sum the options (m, P) of each point, (m, c)."""
        return np.asarray(np.add.reduceat(values, self._starts, axis=1))

    def best(self, log: Array) -> tuple[np.ndarray, Array]:
        """Find the best option of each point, and the log of the sum of all over it, (m, c)."""
        top = np.maximum.reduceat(log, self._starts, axis=1)[:, self.point]
        places = np.where(log == top, np.arange(self.point.size), 0)
        best = np.maximum.reduceat(places, self._starts, axis=1)
        return best, np.log(self.summed(np.exp(log - top)))


def _fitted(residual: Array, variance: Array, columns: Array) -> tuple[Array, Array]:
    """Fit errors in common to residuals: values and their variance, (m, c) each."""
    scaled = (columns / variance[..., None]).swapaxes(1, 2)
    along = columns @ np.linalg.inv(np.eye(columns.shape[2]) + scaled @ columns)
    return (along @ (scaled @ residual[..., None]))[..., 0], (along * columns).sum(axis=2)


def _integrated(
    residual: Array, variance: Array, basis: Array, fixed: Array, scale: float
) -> tuple[Array, Array]:
    """Integrate all errors in common: log density (m,), and of each amplitude (m, nodes)."""
    root = np.sqrt(variance)
    rank = basis.shape[2]
    every = np.concatenate([basis, fixed, residual[..., None]], axis=2) / root[..., None]
    gram = every.swapaxes(1, 2) @ every
    inner = np.eye(fixed.shape[2]) + gram[:, rank:-1, rank:-1]
    others = np.concatenate([gram[:, rank:-1, :rank], gram[:, rank:-1, -1:]], axis=2)
    solved = others.swapaxes(1, 2) @ np.linalg.solve(inner, others)
    smooth = gram[:, :rank, :rank] - solved[:, :rank, :rank]
    along = gram[:, :rank, -1] - solved[:, :rank, -1]
    values, vectors = np.linalg.eigh(smooth)
    square = (along[:, None] @ vectors)[:, 0] ** 2
    plain = -0.5 * (gram[:, -1, -1] + np.log(2.0 * np.pi * variance).sum(axis=1))
    plain = plain - 0.5 * np.linalg.slogdet(inner)[1] + 0.5 * solved[:, -1, -1]
    sizes = (scale * NODES[:, None, None]) ** 2
    grown = 1.0 + sizes * np.maximum(values, 0.0)
    logs = 0.5 * (sizes * square / grown - np.log(grown)).sum(axis=2)
    nodes = (logs + np.log(WEIGHTS)[:, None] + plain).T
    return np.asarray(logsumexp(nodes, axis=1)), np.asarray(nodes)


def squared_distance(residual: Array, variance: Array, fixed: Array) -> Array:
    """Compute squared distances of residuals (m, c) under errors in common (m, c, q), (m,)."""
    covariance = fixed @ fixed.swapaxes(1, 2) + variance[..., None] * np.eye(variance.shape[1])
    solved = np.linalg.solve(covariance, residual[..., None])[..., 0]
    return np.asarray((residual * solved).sum(axis=1))
