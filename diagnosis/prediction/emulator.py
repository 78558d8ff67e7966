r"""Changes that an effect makes to the moments of shift times, between its levels.

A Gaussian process over the effect's coordinates, zero at neutral values, for each moment of each
operating point. Level *i*, and the baseline at the levels' angles as the last, show

.. math:: y_i = f(x_i) + u + \epsilon_i, \qquad f \sim GP(0, a^2 k), \; u \sim N(0, s_u^2),
          \; \epsilon_i \sim N(0, s^2),

with Matern's kernel of 3/2 conditioned on :math:`f = 0`, the error *u* of the angles that all
levels have in common, and that of each level, since shifts are chaotic. The amplitude *a* is the
one of most likelihood for each moment, the length of the kernel the one for all together
(Rasmussen and Williams, *Gaussian Processes for Machine Learning*, 2006, chapter 5).
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.special import logsumexp

from dogshape.diagnosis.terms import Array

LENGTHS = (0.25, 0.5, 1.0, 2.0)  #: of the kernel, over the range of an effect
AMPLITUDES = (0.3, 0.95, 3.0, 9.5, 30.0)  #: of the changes over the error of one level
MISSING_VARIANCE = 1e6  #: of a moment that was not simulated
JITTER = 1e-9  #: variance that keeps a covariance invertible


@dataclass(frozen=True)
class Kernel:
    """Covariance of values at coordinates in a unit cube, zero where any effect is neutral.

    The covariance of changes that several effects make only together is the product of those of
    each effect.
    """

    neutral: tuple[Array, ...]  #: neutral coordinates of each effect, (k, d)
    length: float

    def matern(self, x: Array, y: Array) -> Array:
        """Compute Matern's kernel of 3/2 between coordinates (m, d) and (n, d), (m, n)."""
        distance = np.linalg.norm(x[:, None] - y[None], axis=2) * (3.0**0.5 / self.length)
        return np.asarray((1.0 + distance) * np.exp(-distance))

    @cached_property
    def parts(self) -> list[tuple[slice, Array, Array]]:
        """Columns and neutral coordinates of each effect, and the inverse of their kernel."""
        ends = np.cumsum([0, *(neutral.shape[1] for neutral in self.neutral)]).tolist()
        parts = []
        for columns, neutral in zip(itertools.pairwise(ends), self.neutral, strict=True):
            covariance = self.matern(neutral, neutral) + JITTER * np.eye(len(neutral))
            parts.append((slice(*columns), neutral, np.asarray(np.linalg.inv(covariance))))
        return parts

    def covariance(self, x: Array, y: Array) -> Array:
        """Compute the covariance between coordinates (m, d) and (n, d), (m, n)."""
        product = np.ones((len(x), len(y)))
        for columns, neutral, inverse in self.parts:
            x_correlation = self.matern(x[:, columns], neutral)
            y_correlation = self.matern(neutral, y[:, columns])
            product *= (
                self.matern(x[:, columns], y[:, columns]) - x_correlation @ inverse @ y_correlation
            )
        return product

    def variance(self, x: Array) -> Array:
        """Compute the variance at coordinates (m, d), (m,)."""
        product = np.ones(len(x))
        for columns, neutral, inverse in self.parts:
            correlation = self.matern(x[:, columns], neutral)
            product *= 1.0 - ((correlation @ inverse) * correlation).sum(axis=1)
        return product


@dataclass(frozen=True)
class Emulator:
    """Gaussian processes of the changes of K moments over n levels."""

    x: Array  #: coordinates of the levels, (n, d)
    kernel: Kernel
    amplitude: Array  #: variance of the changes, (K,)
    inverse_root: Array  #: root of the inverse covariance of the levels, (K, n, n)
    deviates: Array  #: leave-one-out residual of each level over its standard error, (K, n)
    misfit: Array  #: squared deviate, at least 1 and the mean of all levels, (K, n)
    level_weights: Array  #: of the kernel to each level, (K, n)

    @classmethod
    def fit(
        cls,
        x: Array,
        neutral: tuple[Array, ...],
        changes: Array,
        level_error: Array,
        common_error: Array,
    ) -> Emulator:
        """Fit amplitudes and length to changes at coordinates ``x``, (n, d).

        Parameters
        ----------
        changes : (K, n + 1), of the levels and of the baseline; NaN where not simulated
        level_error : (K, n + 1) or (K, 1), standard error of each level by itself
        common_error : (K,), standard error that all levels have in common
        """
        is_known = np.isfinite(changes)
        targets = np.where(is_known, changes, 0.0)[..., None]
        level_variance = level_error**2 + np.where(is_known, 0.0, MISSING_VARIANCE)
        noise = common_error[:, None, None] ** 2 + level_variance[..., None] * np.eye(len(x) + 1)
        units = level_error[:, -1]

        def covariance_of(length: float, amplitudes: Array) -> Array:
            """Compute covariances of ``changes`` with their errors, (a, K, n + 1, n + 1).

            ``amplitudes`` (a, K) are in units of the levels' errors.
            """
            correlation = np.pad(Kernel(neutral, length).covariance(x, x), (0, 1))
            return correlation * ((amplitudes * units) ** 2)[..., None, None] + noise

        grid = np.repeat(np.array(AMPLITUDES)[:, None], len(units), axis=1)
        log_densities = [_log_density(covariance_of(length, grid), targets) for length in LENGTHS]
        evidence = np.array([logsumexp(log, axis=0).sum() for log in log_densities])
        length = float(np.exp(_peak(np.log(LENGTHS), evidence[:, None])[0]))
        log_density = _log_density(covariance_of(length, grid), targets)
        peak = np.exp(_peak(np.log(AMPLITUDES), log_density))
        kernel = Kernel(neutral, length)
        amplitude = (peak * units) ** 2
        inverse = np.linalg.inv(covariance_of(length, peak[None])[0])
        weights = (inverse @ targets)[..., 0]
        deviates = weights / np.sqrt(np.diagonal(inverse, axis1=1, axis2=2))
        count = np.maximum(is_known.sum(axis=1), 1)
        mean_square = (deviates**2 * is_known).sum(axis=1) / count
        misfit = np.maximum(np.maximum(deviates**2, mean_square[:, None]), 1.0)[:, :-1]
        return cls(
            x=x,
            kernel=kernel,
            amplitude=amplitude,
            inverse_root=np.linalg.cholesky(inverse[:, :-1, :-1]),
            deviates=np.where(is_known, deviates, 0.0)[:, :-1],
            misfit=misfit,
            level_weights=amplitude[:, None] * weights[:, :-1],
        )

    def miss_correlation(self, moments: int) -> float:
        """Estimate the correlation of misses between operating points, 0 to 1.

        By the first of ``moments`` moments of each operating point.
        """
        deviates = self.deviates[::moments]
        mean_square = (deviates**2).mean(axis=1, keepdims=True)
        deviates = deviates / np.sqrt(np.maximum(mean_square, JITTER))
        square_sum = (deviates**2).sum()
        products = (deviates.sum(axis=0) ** 2).sum() - square_sum
        correlation = products / max((len(deviates) - 1) * square_sum, JITTER)
        return float(np.clip(correlation, 0.0, 1.0))

    def weights(self, x: Array, noise: Array | float = JITTER) -> Array:
        """Compute weights of the levels' changes at coordinates (m, d), (m, n).

        ``noise`` is the variance of each level's change over that of all changes.
        """
        covariance = self.kernel.covariance(self.x, self.x) + noise * np.eye(len(self.x))
        return np.asarray(np.linalg.solve(covariance, self.kernel.covariance(self.x, x)).T)

    def predict(self, x: Array, moments: int) -> tuple[Array, Array]:
        """Predict changes and standard errors at coordinates (m, d).

        Returns
        -------
        changes : (m, K)
        errors : (m, 2 K / moments), of the first two of ``moments`` moments of each point
        """
        has_error = np.arange(len(self.amplitude)) % moments < 2
        correlation = self.kernel.covariance(x, self.x)
        amplitude = self.amplitude[has_error]
        roots = correlation @ self.inverse_root[has_error]
        explained = np.einsum("kmn,kmn->mk", roots, roots)
        variance = self.kernel.variance(x)[:, None] * amplitude - explained * amplitude**2
        nearest = np.linalg.norm(x[:, None] - self.x[None], axis=2).argmin(axis=1)
        misfit = self.misfit[has_error][:, nearest].T
        errors = np.sqrt(np.maximum(variance, 0.0) * misfit)
        return correlation @ self.level_weights.T, errors


def _peak(x: Array, values: Array) -> Array:
    """Find the places (K,) of the peaks of values (n, K) on an even grid ``x`` (n,).

    By the parabola through the largest value and its neighbours; an end of the grid is a peak.
    """
    columns = np.arange(values.shape[1])
    largest = values.argmax(axis=0)
    middle = np.clip(largest, 1, len(x) - 2)
    below, peak, above = (values[middle + step, columns] for step in (-1, 0, 1))
    curvature = np.minimum(below - 2.0 * peak + above, -1e-12)
    offset = np.clip(0.5 * (below - above) / curvature, -1.0, 1.0)
    return np.where(largest == middle, x[middle] + offset * (x[1] - x[0]), x[largest])


def _log_density(covariance: Array, targets: Array) -> Array:
    """Compute log densities of targets (K, n, 1) without their constant, (amplitudes, K)."""
    root = np.linalg.cholesky(covariance)
    scaled = np.linalg.solve(root, np.broadcast_to(targets, (*covariance.shape[:-1], 1)))
    log = -np.log(np.diagonal(root, axis1=2, axis2=3)).sum(axis=2)
    log -= 0.5 * (scaled[..., 0] ** 2).sum(axis=2)
    return np.asarray(log)
