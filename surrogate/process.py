r"""A Gaussian process over designs, given its data: prediction and fit.

With covariance *k*, noise variance *s* and targets *y* about their mean *c*,

.. math:: \mu(x) = c + k(x)^T \alpha, \quad \alpha = (K + s I)^{-1} (y - c), \qquad
   C(x, x') = k(x, x') - k(x)^T (K + s I)^{-1} k(x')

(Rasmussen and Williams 2006, ch. 2). Several targets, each scaled to a standard deviation of one,
share the covariance. Its parameters are the likeliest ones of all targets, ch. 5, fitted to a
random part of the designs: the cost of a likelihood grows with their cube.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from dogshape.sim.elementwise import Array
from dogshape.surrogate.covariance import Covariance, Term, first_parameters

MIN_VARIANCE = 1e-8  #: of a joint draw, over the largest variance
MIN_JITTER = 1e-6  #: variance added to a correlation of one, raised tenfold until there is a root


@dataclass(frozen=True)
class Effort:
    """Cost limits of a fit."""

    designs: int = 400  #: that the parameters are fitted to, drawn at random
    steps: int = 60  #: of the optimiser; 0 keeps the initial parameters
    seed: int = 0  #: of the draw of designs
    digits: int | None = None  #: decimals that the parameters are rounded to; None keeps all


@dataclass(frozen=True)
class Process:
    """Covariance of scaled targets with its data."""

    covariance: Covariance  #: of targets less ``level`` and over ``scale``
    inputs: Array  #: coordinates of designs, (n, c)
    targets: Array  #: (n, k)
    noise: Array  #: variance of each design's scaled targets, (n,)
    level: Array  #: (k,)
    scale: Array  #: (k,)

    @cached_property
    def inverse(self) -> Array:
        """Inverse of the covariance of the scaled targets, noise included, (n, n)."""
        matrix = self.covariance.between(self.inputs, self.inputs)
        return np.linalg.inv(matrix + np.diag(self.noise)).astype(float)

    @cached_property
    def weights(self) -> Array:
        """Weight of each design in a prediction, (n, k)."""
        return self.inverse @ (self.targets - self.level)

    def mean(self, x: Array) -> Array:
        """Predict the targets at coordinates (m, c), (m, k)."""
        return self.level + self.covariance.between(x, self.inputs) @ self.weights

    def predict(self, x: Array) -> tuple[Array, Array]:
        """Predict mean and variance of the targets at coordinates (m, c), (m, k) each."""
        cross = self.covariance.between(x, self.inputs)
        explained = np.einsum("ij,ij->i", cross @ self.inverse, cross)
        variance = np.maximum(self.covariance.variance() - explained, 0.0)
        return self.level + cross @ self.weights, variance[:, None] * self.scale**2

    def predict_jointly(self, x: Array, *, smooth: bool = False) -> tuple[Array, Array]:
        """Predict mean (m,) and covariance (m, m) of the first target at coordinates (m, c).

        With ``smooth`` the covariance is that of the smooth terms.
        """
        cross = self.covariance.between(x, self.inputs, smooth=smooth)
        covariance = self.covariance.between(x, x, smooth=smooth) - cross @ self.inverse @ cross.T
        return self.mean(x)[:, 0], covariance * self.scale[0] ** 2

    def leave_one_out(self) -> tuple[Array, Array]:
        """Predict each design from all others: mean and variance of the targets, (n, k) each.

        In closed form, Rasmussen and Williams 2006, eq. 5.12.
        """
        precision = np.diag(self.inverse)[:, None]
        variance = np.maximum(1.0 / precision - self.noise[:, None], 0.0)
        return self.targets - self.weights / precision, variance * self.scale**2


def fit_process(
    terms: tuple[Term, ...],
    inputs: Array,
    targets: Array,
    noise: Array,
    *,
    start: Array | None = None,
    effort: Effort = Effort(),
    scale: Array | None = None,
) -> Process:
    """Fit the likeliest process to targets (n, k) at coordinates (n, c).

    ``noise`` is the variance of the targets, broadcast to (n, k). ``start`` are initial parameters,
    (size,). ``scale`` is the standard deviation of the targets, (k,), by default that of the data.
    """
    level = targets.mean(axis=0)
    spread = targets.std(axis=0)
    if scale is None:
        scale = np.where(spread > 0.0, spread, 1.0)
    relative_noise = (noise / scale**2 * np.ones_like(targets)).mean(axis=1)
    theta, bounds = first_parameters(terms, inputs.shape[1])
    if start is not None:
        theta = np.clip(start, bounds[:, 0], bounds[:, 1])
    covariance = Covariance(terms, inputs.shape[1], theta)
    if effort.steps:
        from dogshape.surrogate.regression import fit_covariance  # noqa: PLC0415  slow to load

        rng = np.random.default_rng(effort.seed)
        sample = rng.permutation(len(targets))[: effort.designs]
        covariance = fit_covariance(
            covariance,
            inputs[sample],
            (targets[sample] - level) / scale,
            noise=relative_noise[sample],
            bounds=bounds,
            steps=effort.steps,
        )
        if effort.digits is not None:
            covariance = replace(covariance, theta=covariance.theta.round(effort.digits))
    return Process(covariance, inputs, targets, noise=relative_noise, level=level, scale=scale)


def draw_jointly(mean: Array, covariance: Array, rng: np.random.Generator, count: int) -> Array:
    """Draw from a normal distribution of mean (m,) and covariance (m, m), (count, m).

    The triangular root changes with the covariance by as little as this does; the signs and order
    of eigenvectors are the linear algebra library's choice.
    """
    largest = covariance.diagonal().max()
    if largest <= 0.0:
        return np.tile(mean, (count, 1))
    deviation = np.sqrt(np.maximum(covariance.diagonal(), MIN_VARIANCE * largest))
    correlation = covariance / np.outer(deviation, deviation)
    jitter = MIN_JITTER
    while True:
        try:
            root = np.linalg.cholesky(correlation + jitter * np.eye(len(mean)))
            break
        except np.linalg.LinAlgError:  # rounding has left the covariance of near designs
            jitter *= 10.0
    return mean + rng.standard_normal((count, len(mean))) @ (deviation[:, None] * root).T
