r"""Likelihood of a data set under a hypothesis, common errors integrated in closed form.

The mean of the shifts at an operating point *k* is

.. math:: \bar t_k = \mu_k + s\, m_k\, (B z)_k + (F u)_k + \epsilon_k,
          \qquad z, u \sim N(0, 1),\; \epsilon_k \sim N(0, \sigma_k^2/n_k + e_k^2),

with :math:`m_k` the predicted time without dead time, *B* the root of the discrepancy's covariance
and *s* its amplitude, summed over a grid, and *F* all other common errors: of nuisances, nominal
values, drift, clock, emulation and combined effects. The observed variance of single shifts over
the predicted one follows Fisher's F distribution.

A mean may contain a number of late shifts, or be an outlier (*odd*). Each such option of a point
has a probability. The residual of the point is that of its most probable option; its probability is
the sum over all options.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple, Self

import numpy as np
from scipy.special import betaln, expit, gammaln, logit, logsumexp
from scipy.stats import f as f_distribution
from scipy.stats import norm

from dogshape.bench.bench_data import Bench
from dogshape.bench.stand_file import Tolerance
from dogshape.diagnosis.likelihood.observed import Observations
from dogshape.diagnosis.prediction.model import Model, Prediction
from dogshape.diagnosis.prediction.moments import LOG_MEAN, MIN_SD_S
from dogshape.diagnosis.settings import Settings
from dogshape.diagnosis.terms import Array
from dogshape.sim.units import RPM

NODES = np.array([0.1, 0.4, 0.8, 1.3, 2.0, 3.0])  #: amplitudes over the scale of their prior
#: Prior probabilities of the nodes: half-normal, by their midpoints.
WEIGHTS = np.diff([0.0, *(2.0 * norm.cdf(np.sqrt(NODES[1:] * NODES[:-1])) - 1.0), 1.0])
MIN_EIGENVALUE_SHARE = 0.02  #: of the largest; smaller components of a covariance are left out
MAX_MAIN_PROBABILITY = 0.99  #: that all shifts of a point lie in the main mode
ODD_SPREAD_VARIANCE = 1.0  #: of ln of a spread that is an outlier, added to the usual variance
MAX_LATE_COUNTS = 6  #: numbers of late shifts within one mean that are tried beside 0
MIN_FORCE_SPREAD = 0.1  #: least deviation of ln force that scales the slope of a discrepancy
IMPOSSIBLE_LOG = -1e6  #: log probability of a number of late shifts that a point cannot have
TABLE_SIZE = 257  #: shares at which probabilities of numbers of shifts are computed
DIFFERENCE_STEP = 0.15  #: of force and mismatch, by which times are differentiated
QUANTILES = norm.ppf((np.arange(9) + 0.5) / 9)  #: deviates at which a nuisance is evaluated
MAX_DEVIATE = 4.0  #: of a nuisance, up to which it is read from a coefficient
DEVIATE_STEPS = 33  #: of these
MIN_SQUARED_CHANGE = 1e-18  #: of a nuisance without effect, to divide by
NUISANCE_DIRECTIONS = 2  #: principal components of the errors of each nuisance


class Terms(NamedTuple):
    """Log likelihood of m predictions, with residuals and variances of the means."""

    log_likelihood: Array  #: (m,)
    log_by_amplitude: Array  #: the same with the prior of each amplitude, (m, nodes)
    residual: Array  #: of the means given their late shifts, s, (m, c)
    variance: Array  #: s^2, (m, c)


class PointOptions(NamedTuple):
    """Predicted options for the mean of each point, (K, m, c) each; ``_OptionList`` lists them."""

    shift: Array  #: of the mean, s
    scatter: Array  #: variance of the mean by its shifts, s^2
    log_prior: Array  #: log prior probability
    log_weight: Array  #: log prior probability plus log density of the observed spread


class _PredictedMeans(NamedTuple):
    """Predicted means of m predictions at c points, with their errors."""

    q: Prediction
    options: PointOptions
    variance: Array  #: of each mean from its independent errors, s^2, (m, c)
    discrepancy: Array  #: error in common, s, (m, c, r)
    common: Array  #: other errors in common, s, (m, c, e)
    log_engaged: Array  #: log probability of the numbers that engaged, (m,)


class ModeOptions(NamedTuple):
    """Shifts of a point by mode of their times, (2, m, c) each.

    First some shifts lie in the smaller mode, then all lie in the larger (main) mode.
    """

    log_probability: Array
    offset: Array  #: of their mean, s
    variance: Array  #: of single shifts, s^2


class ChosenMeans(NamedTuple):
    """Most probable options of each point."""

    residual: Array  #: s, (m, c)
    variance: Array  #: s^2, (m, c)
    log_probability: Array  #: log of the sum of all options over the density of the chosen, (m,)


class Sensitivity(NamedTuple):
    """Changes of ln time, (C,) each."""

    force: Array  #: with ln force
    mismatch: Array  #: with mismatch in rad/s


class CommonErrors(NamedTuple):
    """Common errors drawn with m predictions given the data."""

    amplitude: Array  #: of the discrepancy, as a share of the predicted time, (m,)
    offset: Array  #: all errors in common, s, (m, C)
    nuisance: Array  #: the part of ``offset`` by nuisances, s, (m, C)
    deviates: Array  #: normal deviates of the nuisances from their stated values, (m, nuisances)


class NuisanceErrors(NamedTuple):
    """Relative errors in common from one nuisance, as principal components of its changes."""

    columns: Array  #: (C, r)
    deviates: Array  #: normal deviates within the range of the nuisance, (k,)
    scores: Array  #: of the first component at these, increasing, (k,)

    def deviate(self, coefficients: Array) -> Array:
        """Compute the deviate of the nuisance from coefficients (m, r) of the components, (m,)."""
        return np.interp(coefficients[:, 0], self.scores, self.deviates)


def _covariance_root(covariance: Array) -> Array:
    """Compute a root (n, r) of a covariance without its smallest principal components."""
    values, vectors = np.linalg.eigh(covariance)
    is_large = values > MIN_EIGENVALUE_SHARE * values.max()
    return np.asarray(vectors[:, is_large] * np.sqrt(values[is_large]))


def _central_difference(moments: Array) -> Array:
    """Compute the slope of ln mean from moments at both ends of the step (2, C, MOMENTS), (C,)."""
    return np.asarray((moments[1, :, LOG_MEAN] - moments[0, :, LOG_MEAN]) / (2.0 * DIFFERENCE_STEP))


def freedom_of(variance: Array) -> Array:
    """Compute degrees of freedom of a spread from the variance of its logarithm (second order)."""
    return 0.5 / variance + 1.0


def _late_numbers(count: Array, max_count: int) -> tuple[Array, Array]:
    """List numbers of late shifts from 0 to ``count`` (c, 1), and their widths, (c, K) each.

    A small number has the width 1. A large number represents as many numbers as its width.
    """
    k = np.arange(max_count + 1.0)[None]
    small = max_count // 2
    large_width = np.maximum(1.0, (count - small) / max(max_count - small, 1))
    numbers = np.where(k > small, small + 0.5 + (k - small - 0.5) * large_width, k)
    return numbers, np.where(k > small, large_width, 1.0)


class SpreadDensity(NamedTuple):
    """Density of ln of a ratio of variances by Fisher's F with two degrees of freedom."""

    observed_freedom: Array
    predicted_freedom: Array
    log_constant: Array

    @classmethod
    def of(cls, observed_freedom: Array, predicted_freedom: Array) -> Self:
        """Build the density for degrees of freedom that broadcast together."""
        half_sum = 0.5 * (observed_freedom + predicted_freedom)
        log = gammaln(half_sum) - gammaln(0.5 * predicted_freedom) - gammaln(0.5 * observed_freedom)
        return cls(*np.broadcast_arrays(observed_freedom, predicted_freedom, log))

    def log(self, ratio: Array) -> Array:
        """Compute the log density of ln ``ratio``."""
        x = self.observed_freedom * ratio / self.predicted_freedom
        half_sum = 0.5 * (self.observed_freedom + self.predicted_freedom)
        log = self.log_constant + 0.5 * self.observed_freedom * np.log(np.maximum(x, 1e-300))
        return np.asarray(log - half_sum * np.log1p(x))


def _log_count(shares: Array, count: Array, total: Array, share_shifts: float) -> Array:
    """Compute the log beta-binomial probability of ``count`` in ``total`` shifts, (s, ...).

    ``shares`` (s,) are as certain as those from ``share_shifts`` simulated shifts. Many points have
    the same numbers, which are computed once.
    """
    numbers = np.stack(np.broadcast_arrays(count, total))
    distinct, index = np.unique(numbers.reshape(2, -1), axis=1, return_inverse=True)
    distinct_count, distinct_total = distinct
    alpha = share_shifts * shares[:, None]
    beta = share_shifts * (1.0 - shares[:, None])
    log = betaln(distinct_count + alpha, distinct_total - distinct_count + beta)
    log = log - betaln(alpha, beta)
    log_choose = gammaln(distinct_total + 1.0) - gammaln(distinct_count + 1.0)
    remainder = np.maximum(distinct_total - distinct_count, 0.0)
    log = log + log_choose - gammaln(remainder + 1.0)
    return np.asarray(log[:, index.ravel()].reshape(len(shares), *numbers.shape[1:]))


def _table_shares(low: float, high: float) -> Array:
    """List the shares of a table, even in the logarithm of the odds, (TABLE_SIZE,)."""
    return np.asarray(expit(np.linspace(logit(low), logit(high), TABLE_SIZE)))


@dataclass(frozen=True)
class _ShareTable:
    """Functions of a share, tabulated at ``_table_shares``."""

    low: float
    high: float
    values: Array  #: (..., TABLE_SIZE)

    @cached_property
    def _starts(self) -> np.ndarray:
        """Index of the first value of each function among all values, (...)."""
        shape = self.values.shape[:-1]
        return TABLE_SIZE * np.arange(np.prod(shape, dtype=int)).reshape(shape)

    def interpolate(self, share: Array) -> Array:
        """Interpolate the functions at shares that broadcast with them."""
        low = logit(self.low)
        high = logit(self.high)
        odds = logit(np.clip(share, self.low, self.high))
        position = (odds - low) * ((TABLE_SIZE - 1) / (high - low))
        row = np.clip(position.astype(int), 0, TABLE_SIZE - 2)
        place = row + self._starts
        values = self.values.ravel()
        lower = values[place]
        place += 1
        return np.asarray(lower + (position - row) * (values[place] - lower))


@dataclass(frozen=True)
class _OptionList:
    """Options for the mean of each point: numbers of late shifts, an odd mean, the main mode.

    All points have K options in this order; they do not depend on the prediction.
    """

    late_share: Array  #: of the shifts within the mean, (K, 1, c)
    log_count: _ShareTable  #: log probability by the share of late shifts, (K, 1, c)

    @property
    def odd(self) -> int:
        """Index of the odd mean."""
        return len(self.late_share) - 2

    @property
    def is_main(self) -> np.ndarray:
        """Whether all shifts lie in the larger mode, (K, 1, 1)."""
        return (np.arange(len(self.late_share)) > self.odd)[:, None, None]

    def by_mode(self, pair: Array) -> Array:
        """Select for each option the value of its mode (``ModeOptions``) from (2, m, c)."""
        return np.where(self.is_main, pair[1], pair[0])

    def choose(
        self,
        options: PointOptions,
        variance: Array,
        residual: Array,
        fitted: Array,
        fitted_variance: Array,
    ) -> ChosenMeans:
        """Choose the most probable option of each point, given fitted errors in common.

        Parameters
        ----------
        options : predicted options
        variance : of each option without errors in common, s^2, (K, m, c)
        residual : of the means, s, (m, c)
        fitted, fitted_variance : errors in common, s and s^2, (m, c)
        """
        deviation = residual - fitted - options.shift
        total_variance = variance + fitted_variance
        deviation *= deviation
        deviation /= total_variance
        log = np.log(2.0 * np.pi * total_variance)
        log += deviation
        log *= -0.5
        log += options.log_weight
        best = len(log) - 1 - log[::-1].argmax(axis=0)[None]  # the last one of several
        log -= log.max(axis=0)
        log_sum = np.log(np.exp(log, out=log).sum(axis=0))
        shift, chosen_variance, log_weight = (
            np.take_along_axis(values, best, axis=0)[0]
            for values in (options.shift, variance, options.log_weight)
        )
        return ChosenMeans(
            residual=residual - shift,
            variance=chosen_variance,
            log_probability=(log_sum + log_weight).sum(axis=1),
        )


@dataclass(frozen=True)
class Likelihood:
    """Likelihood of the observations of a data set, for predictions of a model.

    Of C operating points c have a mean time: ``p`` are m predictions at all points, ``q`` the same
    at those with a mean. Errors in common have e columns, a discrepancy r. The means have K options
    (``_OptionList``).
    """

    bench: Bench
    observed: Observations
    model: Model
    settings: Settings

    @cached_property
    def measured_points(self) -> np.ndarray:
        """Indices of the points that have a mean, (c,)."""
        return np.flatnonzero(self.observed.count > 0)

    def at_measured(self, p: Prediction) -> Prediction:
        """Select the points that have a mean from a prediction (m, C)."""
        return p.select((slice(None), self.measured_points))

    @cached_property
    def discrepancy_root(self) -> Array:
        """Root *B* of the discrepancy's correlation over all points, (C, r)."""
        log_mismatch = np.log(abs(self.observed.mismatch) + RPM)
        x = log_mismatch / self.settings.discrepancy_length
        log_force = np.log(self.observed.force)
        force = (log_force - log_force.mean()) / max(float(log_force.std()), MIN_FORCE_SPREAD)
        correlation = np.exp(-0.5 * (x[:, None] - x[None]) ** 2)
        constant, curve, slope = self.settings.discrepancy_shape
        covariance = constant + curve * correlation + slope * correlation * np.outer(force, force)
        return _covariance_root(covariance)

    @cached_property
    def relative_errors(self) -> Array:
        """Relative errors in common from nuisances, then from nominal values, (C, e)."""
        nominal = self._nominal_errors(self.bench.errors.systematic)
        return np.hstack([self.nuisance_errors, nominal])

    @cached_property
    def nuisance_errors(self) -> Array:
        """Relative errors in common from nuisances, principal components of each, (C, e)."""
        none = np.zeros((self.model.cell_count, 0))
        return np.hstack([none, *(errors.columns for errors in self.errors_by_nuisance.values())])

    @cached_property
    def errors_by_nuisance(self) -> dict[str, NuisanceErrors]:
        """Relative errors in common from each nuisance."""
        return {name: self._errors_of(name) for name in self.model.nuisances}

    def _errors_of(self, name: str) -> NuisanceErrors:
        """Compute the relative errors in common from a nuisance."""
        (parameter,) = self.model.nuisances[name].parameters
        neutral = parameter.neutral_of(self.model.setting)
        factor = self.settings.nuisance[name]
        values = np.clip(neutral * factor**QUANTILES, parameter.low, parameter.high)
        moments = self.model.changes(name, values[:, None]).moments
        changes = moments[..., LOG_MEAN] / len(QUANTILES) ** 0.5
        _, sizes, directions = np.linalg.svd(changes, full_matrices=False)
        components = (sizes[:, None] * directions)[:NUISANCE_DIRECTIONS]
        first = components[0] / max(float(components[0] @ components[0]), MIN_SQUARED_CHANGE)
        ends = np.log(np.array([parameter.low, parameter.high]) / neutral) / np.log(factor)
        low, high = np.clip(ends, -MAX_DEVIATE, MAX_DEVIATE).tolist()
        deviates = np.linspace(low, high, DEVIATE_STEPS)
        moments = self.model.changes(name, (neutral * factor**deviates)[:, None]).moments
        scores = moments[..., LOG_MEAN] @ first
        order = np.argsort(scores)
        return NuisanceErrors(components.T, deviates[order], scores[order])

    @cached_property
    def sensitivity(self) -> Sensitivity:
        """Changes of ln time with force and mismatch, by central differences."""
        ends = np.array([1.0 - DIFFERENCE_STEP, 1.0 + DIFFERENCE_STEP])
        force_moments = self.model.changes("force_scale", ends[:, None]).moments
        no_offset = np.zeros_like(ends)
        mismatch_values = np.stack([no_offset, ends], axis=1)  # offset and factor
        mismatch_moments = self.model.changes("mismatch_speed", mismatch_values).moments
        slip = np.maximum(abs(self.observed.mismatch), RPM)
        slip = slip * np.sign(self.observed.mismatch + 1e-12)  # a mismatch of 0 counts as positive
        return Sensitivity(
            force=_central_difference(force_moments),
            mismatch=_central_difference(mismatch_moments) / slip,
        )

    def _nominal_errors(self, tolerance: Tolerance) -> Array:
        """Compute relative errors of the means from errors of nominal values, (C, e)."""
        if not tolerance:
            return np.zeros((self.model.cell_count, 0))
        force, mismatch = self.sensitivity
        slopes = (
            force,
            force / self.observed.force,
            mismatch * self.observed.mismatch,
            mismatch,
        )
        columns = [slope * size for slope, size in zip(slopes, tolerance.sizes, strict=True)]
        return np.stack([column for column in columns if column.any()], axis=1)

    @cached_property
    def nominal_variance(self) -> Array:
        """Relative variance of each point's mean from errors of its nominal values, (C,)."""
        errors = self._nominal_errors(self.bench.errors.each_point)
        return np.asarray((errors**2).sum(axis=1))

    @cached_property
    def absolute_errors(self) -> Array:
        """Errors in common, s, (C, e): drift, and an offset of half a step of the clock."""
        columns = []
        if self.observed.drift is not None:
            columns.append(self.observed.drift.offsets)
        if self.bench.clock_step:
            columns.append(np.full(self.model.cell_count, 0.5 * self.bench.clock_step))
        return np.array(columns).reshape(-1, self.model.cell_count).T

    def mean_variance(self, p: Prediction) -> Array:
        """Compute the variance of each mean from its independent errors, s^2, (m, C).

        The scatter of the shifts is left out.
        """
        simulated = p.mean - p.delay
        model_error = np.maximum(self.settings.model_error * simulated, self.settings.least_error)
        step_variance = (self.bench.clock_step or 0.0) ** 2 / 12.0
        clock_variance = step_variance / np.maximum(self.observed.count, 1.0)
        nominal_variance = self.nominal_variance * simulated**2
        return np.asarray(p.error**2 + model_error**2 + nominal_variance + clock_variance)

    def all_common_errors(self, p: Prediction, amplitude: Array | float) -> Array:
        """Compute discrepancy of amplitude (m,) and other errors in common, s, (m, C, r + e)."""
        size = np.asarray(amplitude).reshape(-1, 1, 1)
        discrepancy = size * (p.mean - p.delay)[..., None] * self.discrepancy_root
        return np.concatenate([discrepancy, self.common_errors(p)], axis=2)

    def common_errors(self, p: Prediction) -> Array:
        """Compute all errors in common except the discrepancy, *F*, s, (m, C, e)."""
        simulated = (p.mean - p.delay)[..., None]
        absolute = np.broadcast_to(self.absolute_errors, (len(p.mean), *self.absolute_errors.shape))
        relative = simulated * self.relative_errors
        return np.concatenate([relative, absolute, p.common_error[..., None]], axis=2)

    def terms(self, p: Prediction) -> Terms:
        """Compute the log likelihood of predictions (m, C)."""
        return self._terms(self._predicted_means(p))

    def unlisted_terms(self, p: Prediction, gaps: Sequence[tuple[float, float]]) -> Iterator[Terms]:
        """Yield the log likelihood of predictions (m, C) with each gap that no effect explains.

        ``gaps`` are pairs of amplitude and length.
        """
        predicted = self._predicted_means(p)
        simulated = predicted.q.mean - predicted.q.delay
        roots = {length: self.unlisted_root(length) for _, length in gaps}
        for size, length in gaps:
            independent_variance = (1.0 - self.settings.unlisted_smooth) * (size * simulated) ** 2
            unlisted_errors = size * (simulated[..., None] * roots[length])
            gapped = predicted._replace(
                variance=predicted.variance + independent_variance,
                common=np.concatenate([predicted.common, unlisted_errors], axis=2),
            )
            yield self._terms(gapped)

    def _predicted_means(self, p: Prediction) -> _PredictedMeans:
        """Predict options and errors of each point that has a mean."""
        points = self.measured_points
        q = self.at_measured(p)
        return _PredictedMeans(
            q=q,
            options=self._point_options(q),
            variance=self.mean_variance(p)[:, points],
            discrepancy=(q.mean - q.delay)[..., None] * self.discrepancy_root[points],
            common=self.common_errors(p)[:, points],
            log_engaged=self.log_engaged(p),
        )

    def _terms(self, predicted: _PredictedMeans) -> Terms:
        """Integrate all errors in common of predicted means over their priors."""
        means = self._choose_means(predicted)
        log, nodes = integrate_common_errors(
            means.residual,
            means.variance,
            predicted.discrepancy,
            predicted.common,
            self.settings.discrepancy,
        )
        log_options = means.log_probability + predicted.log_engaged
        return Terms(
            log_likelihood=log + log_options,
            log_by_amplitude=nodes + log_options[:, None],
            residual=means.residual,
            variance=means.variance,
        )

    def unlisted_root(self, length: float) -> Array:
        """Compute the root of the correlation of a gap that no effect explains, (c, r)."""
        x = np.log([self.observed.force, abs(self.observed.mismatch) + RPM])
        x = x[:, self.measured_points]
        square = ((x[:, :, None] - x[:, None]) ** 2).sum(axis=0)
        root = _covariance_root(np.exp(-0.5 * square / length**2))
        return self.settings.unlisted_smooth**0.5 * root

    def _choose_means(self, predicted: _PredictedMeans) -> ChosenMeans:
        """Choose the most probable option of each point."""
        option_list = self._option_list
        q, options, variance, discrepancy, common, _ = predicted
        residual = self.observed.mean[self.measured_points] - q.mean
        columns = np.concatenate([self.settings.discrepancy * discrepancy, common], axis=2)
        option_variance = options.scatter + variance
        option_variance[option_list.odd] += (self.settings.odd_size * q.mean) ** 2
        # The first fit of the errors in common takes prior mean and variance of a point's options.
        probability = np.exp(options.log_prior)
        probability[option_list.odd] = 0.0
        shift = (probability * options.shift).sum(axis=0)
        square = (probability * (options.shift**2 + options.scatter)).sum(axis=0)
        fitted = fit_common_errors(residual - shift, variance + square - shift**2, columns)
        means = option_list.choose(options, option_variance, residual, *fitted)
        # The second fit takes the chosen options, as late shifts distort the first.
        fitted = fit_common_errors(means.residual, means.variance, columns)
        return option_list.choose(options, option_variance, residual, *fitted)

    def _point_options(self, q: Prediction) -> PointOptions:
        """Predict the options of each point that has a mean.

        ``scatter`` is the variance of a mean with a known number of late shifts; the spread has
        the variance of the mixture of timely and late shifts.
        """
        option_list = self._option_list
        late_share = option_list.late_share
        timely_share = 1.0 - late_share
        count = self.observed.count[self.measured_points]
        delay = self.model.baseline.late_delay.mean[self.measured_points]
        delay_sd = self.model.baseline.late_delay.sd[self.measured_points]
        modes = self._mode_options(q)
        single_variance = option_list.by_mode(modes.variance)
        updated_variance = option_list.by_mode(self._updated_variance(q, modes.variance))
        timely_variance = np.where(late_share == 0.0, updated_variance, single_variance)
        scatter = timely_variance * timely_share + late_share * delay_sd**2
        mixed_variance = single_variance * timely_share + late_share * delay_sd**2
        mixed_variance = mixed_variance + late_share * timely_share * delay**2
        log_prior = option_list.log_count.interpolate(q.late_share)
        log_prior = log_prior + option_list.by_mode(modes.log_probability)
        return PointOptions(
            shift=late_share * delay + option_list.by_mode(modes.offset),
            scatter=scatter / count,
            log_prior=log_prior,
            log_weight=log_prior + self._log_spread(q, mixed_variance),
        )

    def _mode_options(self, q: Prediction) -> ModeOptions:
        """Divide the shifts of a point by whether some lie in the smaller mode.

        Both options together have the predicted mean and variance of all shifts.
        """
        count = self.observed.count[self.measured_points]
        log_main = count * np.log1p(-np.minimum(q.minor_share, 1.0 - 1e-9))
        # Probability that all shifts lie in the main mode.
        main = np.minimum(np.exp(log_main), MAX_MAIN_PROBABILITY)
        log_main = np.minimum(log_main, np.log(MAX_MAIN_PROBABILITY))
        main_variance = np.maximum(q.main_sd, MIN_SD_S) ** 2
        mixed_variance = (q.sd**2 - main * main_variance) / (1.0 - main)
        mixed_variance = np.maximum(mixed_variance, MIN_SD_S**2)
        return ModeOptions(
            log_probability=np.stack([np.log1p(-main), log_main]),
            offset=np.stack([-main * q.main_offset / (1.0 - main), q.main_offset]),
            variance=np.stack([mixed_variance, main_variance]),
        )

    @cached_property
    def _option_list(self) -> _OptionList:
        """Options of each mean: its possible numbers of late shifts, odd, and main mode."""
        points = self.measured_points
        count = self.observed.count[points]
        late_count = self.observed.late_count[points]
        hides_late = self.observed.hides_late[points]
        max_count = 0
        if hides_late.any():
            max_count = int(min(MAX_LATE_COUNTS, count[hides_late].max()))
        numbers, widths = _late_numbers(count[:, None], max_count)
        hidden = np.where(hides_late[:, None], numbers, 0.0)
        is_possible = (numbers <= count[:, None]) & (hides_late[:, None] | (numbers == 0))
        low = self.settings.late_least
        log = _log_count(
            _table_shares(low, self.settings.late_most),
            count=hidden + late_count[:, None],
            total=(count + late_count)[:, None],
            share_shifts=self.settings.late_known,
        )
        log = np.where(is_possible, log + np.log(widths), IMPOSSIBLE_LOG)
        # Probabilities add up to 1 only approximately, as large numbers represent several.
        only_mean = (hides_late & (late_count == 0))[:, None]
        log = log - np.where(only_mean, logsumexp(log, axis=2, keepdims=True), 0.0)
        # Two more options have no late shift: an odd mean, and all shifts in the main mode.
        log_odd = log[..., :1] + np.log(self.settings.odd_share)
        table = np.concatenate([log, log_odd, log[..., :1]], axis=2)
        hidden_share = np.minimum(hidden / count[:, None], 1.0)
        late_share = np.hstack([hidden_share, np.zeros((len(count), 2))])
        values = np.ascontiguousarray(table.T[:, None])
        return _OptionList(
            late_share=late_share.T[:, None],
            log_count=_ShareTable(low, self.settings.late_most, values),
        )

    def _updated_variance(self, q: Prediction, predicted: Array) -> Array:
        """Estimate variances of timely shifts from predicted (2, m, c) and observed ones, s^2.

        With uncertain variances the means follow Student's distribution; the estimate is that of
        its variance, which has the factor freedom / (freedom - 2).
        """
        points = self.measured_points
        predicted_freedom = freedom_of(self._spread_variance(q))
        freedom = self._spread_freedom(q.kurtosis, 0.0)
        freedom = np.where(self.observed.freedom[points] > 0.0, freedom, 0.0)
        total = predicted_freedom + freedom
        divisor = np.maximum(total - 2.0, 0.5 * total)
        square_sum = predicted_freedom * predicted + freedom * self.observed.variance[points]
        return np.asarray(square_sum / divisor)

    def _log_spread(self, q: Prediction, variance: Array) -> Array:
        """Compute the log density of the observed variance with each option, (K, m, c).

        ``variance`` of single shifts is s^2, (K, m, c). A small share of the spreads are outliers.
        """
        log = np.zeros_like(variance)
        points = self.measured_points
        has_spread = self.observed.freedom[points] > 0.0
        ratio = self.observed.variance[points][has_spread] / variance[..., has_spread]
        kurtosis = np.stack(np.broadcast_arrays(q.kurtosis, self.model.baseline.kurtosis[points]))
        freedom = self._spread_freedom(kurtosis, q.log_sd_error)[..., has_spread]
        error = self._spread_variance(q, blur_share=0.5)[..., has_spread]
        logs = []
        for spread_variance in (error, error + ODD_SPREAD_VARIANCE):
            mixed, main = (SpreadDensity.of(f, freedom_of(spread_variance)) for f in freedom)
            logs.append(np.concatenate([mixed.log(ratio[:-1]), main.log(ratio[-1:])]))
        log_usual, log_odd = logs
        odd_share = self.settings.odd_spread
        log[..., has_spread] = np.logaddexp(
            np.log1p(-odd_share) + log_usual, np.log(odd_share) + log_odd
        )
        return log

    def _spread_variance(self, q: Prediction, blur_share: float = 1.0) -> Array:
        """Compute the variance of ln of a predicted spread, (m, c).

        ``blur_share`` of the squared error from interpolation and uneven angles is included.
        """
        relative_error = self.settings.spread_error * (q.mean - q.delay) / q.sd
        added_error = np.log1p(relative_error)
        blur = blur_share * q.log_sd_error**2
        return np.asarray(self.settings.spread_share**2 + added_error**2 + blur)

    def _spread_freedom(self, kurtosis: Array, blur: Array | float) -> Array:
        """Compute degrees of freedom of observed variances, (..., c).

        They are reduced by half of the squared error ``blur`` of ln deviation, whose other half
        reduces those of the predicted variance.
        """
        observed_freedom = self.observed.freedom[self.measured_points]
        n = np.maximum(observed_freedom + 1.0, 2.0)
        log_variance = 2.0 / (n - 1.0) + kurtosis / n  # of ln of the observed variance
        log_variance = log_variance + 2.0 * blur**2
        freedom = np.maximum(2.0 / np.maximum(log_variance, 1e-3), 0.5)
        return np.where(observed_freedom > 0.0, freedom, 1e-9)

    def spread_scores(self, p: Prediction) -> Array:
        """Compute normal deviates of the observed spreads, (m, c); NaN for none."""
        points = self.measured_points
        q = self.at_measured(p)
        error = self._spread_variance(q, blur_share=0.5)
        odd_share = self.settings.odd_spread
        modes = self._mode_options(q)
        probability = np.zeros_like(q.sd)
        kurtoses = (q.kurtosis, self.model.baseline.kurtosis[points])
        ratios = self.observed.variance[points] / modes.variance
        shares = np.exp(modes.log_probability)
        for share, ratio, kurtosis in zip(shares, ratios, kurtoses, strict=True):
            freedom = self._spread_freedom(kurtosis, q.log_sd_error)
            freedom = np.broadcast_to(freedom, ratio.shape)
            usual = f_distribution.cdf(ratio, freedom, freedom_of(error))
            odd = f_distribution.cdf(ratio, freedom, freedom_of(error + ODD_SPREAD_VARIANCE))
            probability += share * ((1.0 - odd_share) * usual + odd_share * odd)
        score = norm.ppf(np.clip(probability, 1e-12, 1.0 - 1e-12))
        has_spread = self._spread_freedom(q.kurtosis, 0.0) > 1.0
        return np.where(has_spread & ~self.observed.hides_late[points], score, np.nan)

    def log_engaged(self, p: Prediction) -> Array:
        """Compute the log probability of the numbers that engaged, (m,)."""
        return np.asarray(self._engaged_table.interpolate(p.engaged_share).sum(axis=1))

    @cached_property
    def _engaged_table(self) -> _ShareTable:
        """Log probability of each point's number that engaged, by the share that engages."""
        low, high = self.settings.engaged_range
        log = _log_count(
            _table_shares(low, high),
            count=self.observed.engaged_count,
            total=self.observed.engaged_count + self.observed.failed_count,
            share_shifts=self.settings.late_known,
        )
        return _ShareTable(low, high, np.ascontiguousarray(log.T))

    def mean_with_late(self, p: Prediction) -> Array:
        """Compute the mean of all shifts, including late ones, s, (m, C)."""
        late_share = np.clip(p.late_share, 0.0, self.settings.late_most)
        return np.asarray(p.mean + late_share * self.model.baseline.late_delay.mean)

    def draw_common_errors(self, p: Prediction, generator: np.random.Generator) -> CommonErrors:
        """Draw common errors of each prediction given the data."""
        terms = self.terms(p)
        log_total = logsumexp(terms.log_by_amplitude, axis=1, keepdims=True)
        weights = np.exp(terms.log_by_amplitude - log_total)
        node = (generator.random((len(weights), 1)) > weights.cumsum(axis=1)).sum(axis=1)
        amplitude = self.settings.discrepancy * NODES[np.minimum(node, len(NODES) - 1)]
        columns = self.all_common_errors(p, amplitude)
        measured = columns[:, self.measured_points]
        scaled = (measured / terms.variance[..., None]).swapaxes(1, 2)
        # Coefficients of the columns are normal with the precision I + F^T V^-1 F = L L^T.
        precision = np.eye(columns.shape[2]) + scaled @ measured
        root = np.linalg.inv(np.linalg.cholesky(precision))
        mean = root @ scaled @ terms.residual[..., None]  # of L^T times the coefficients
        noise = generator.standard_normal(mean.shape[:2])[..., None]
        coefficients = root.swapaxes(1, 2) @ (mean + noise)
        parts = columns * coefficients.swapaxes(1, 2)
        start = self.discrepancy_root.shape[1]
        nuisances = parts[..., start : start + self.nuisance_errors.shape[1]]
        deviates = np.zeros((len(parts), len(self.errors_by_nuisance)))
        for k, errors in enumerate(self.errors_by_nuisance.values()):
            end = start + errors.columns.shape[1]
            deviates[:, k] = errors.deviate(coefficients[:, start:end, 0])
            start = end
        return CommonErrors(
            amplitude,
            offset=parts.sum(axis=2),
            nuisance=nuisances.sum(axis=2),
            deviates=deviates,
        )


def fit_common_errors(residual: Array, variance: Array, columns: Array) -> tuple[Array, Array]:
    """Fit errors in common (m, c, e) to residuals: values, s, and variance, s^2, (m, c) each."""
    scaled = (columns / variance[..., None]).swapaxes(1, 2)
    precision = np.eye(columns.shape[2]) + scaled @ columns
    gain = columns @ np.linalg.inv(precision)
    values = gain @ (scaled @ residual[..., None])
    return values[..., 0], np.einsum("mce,mce->mc", gain, columns)


def integrate_common_errors(
    residual: Array, variance: Array, discrepancy: Array, common: Array, scale: float
) -> tuple[Array, Array]:
    """Integrate all errors in common over their priors.

    The errors ``common`` are eliminated from the normal equations; in the principal axes of the
    remaining ones each axis of the discrepancy is a factor with the amplitude as parameter.

    Parameters
    ----------
    residual, variance : s and s^2, (m, c)
    discrepancy, common : errors with unit variance, s, (m, c, r) and (m, c, e)
    scale : of the discrepancy's amplitude

    Returns
    -------
    log : log density, (m,)
    nodes : log density with each amplitude and its prior, (m, nodes)
    """
    rank = discrepancy.shape[2]
    # Normal equations of discrepancy, common errors and residual, in this order.
    columns = np.concatenate([discrepancy, common, residual[..., None]], axis=2)
    scaled = columns / np.sqrt(variance)[..., None]
    gram = scaled.swapaxes(1, 2) @ scaled
    inner = np.eye(common.shape[2]) + gram[:, rank:-1, rank:-1]
    cross = np.concatenate([gram[:, rank:-1, :rank], gram[:, rank:-1, -1:]], axis=2)
    solved = cross.swapaxes(1, 2) @ np.linalg.solve(inner, cross)
    information = gram[:, :rank, :rank] - solved[:, :rank, :rank]
    projection = gram[:, :rank, -1] - solved[:, :rank, -1]
    values, vectors = np.linalg.eigh(information)
    square = (projection[:, None] @ vectors)[:, 0] ** 2
    log_fixed = -0.5 * (gram[:, -1, -1] + np.log(2.0 * np.pi * variance).sum(axis=1))
    log_fixed = log_fixed - 0.5 * np.linalg.slogdet(inner)[1] + 0.5 * solved[:, -1, -1]
    sizes = (scale * NODES[:, None, None]) ** 2
    growth = 1.0 + sizes * np.maximum(values, 0.0)
    logs = 0.5 * (sizes * square / growth - np.log(growth)).sum(axis=2)
    nodes = (logs + np.log(WEIGHTS)[:, None] + log_fixed).T
    return np.asarray(logsumexp(nodes, axis=1)), np.asarray(nodes)


def squared_distance(residual: Array, variance: Array, common: Array) -> Array:
    """Compute squared distances of residuals (m, c) under errors in common (m, c, e), (m,)."""
    covariance = common @ common.swapaxes(1, 2) + variance[..., None] * np.eye(variance.shape[1])
    solved = np.linalg.solve(covariance, residual[..., None])[..., 0]
    return np.asarray((residual * solved).sum(axis=1))
