r"""A Gaussian process given its data: what is known anywhere, and how well.

With covariance *k*, noise variances :math:`s_i^2` of the rows and targets *y* about their
mean *c*,

.. math:: \mu(z) = c + k(z)^T \alpha, \quad \alpha = (K + S)^{-1} (y - c), \qquad
   C(z, z') = k(z, z') - k(z)^T (K + S)^{-1} k(z')

(Rasmussen and Williams 2006, ch. 2). Numpy alone: asking must start fast.

**Targets** are logarithms of the rows with their known noise. A face or flank turns from holding to
letting go where the tangent of its angle passes the friction coefficient, and times change there.
So designs have a further coordinate for each angle, which runs from -1 to 1 there,
:math:`\tanh((\tan\theta - \mu)/0.04)`.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from dogshape.surrogate.covariance import Array, Covariance, Mask
from dogshape.surrogate.dataset import Dataset

BLOCK = 100  #: rows of a triangular system that are solved at a time


def root_of(covariance: Array) -> Array:
    """Return a matrix whose product with its transpose is a covariance, each (m, m).

    By eigenvalues, so that one that is singular, or not quite positive, has one too.
    """
    values, vectors = np.linalg.eigh(covariance)
    return vectors * np.sqrt(np.maximum(values, 0.0))


@dataclass(frozen=True)
class Process:
    """Covariance with the data that it is given.

    Parameters
    ----------
    covariance : with fitted parameters.
    inputs : (n, d + p), coordinates of designs and operating points.
    targets : (n,).
    noise : variance of each target, (n,).
    known : weights worked out before, (n,); None to have them worked out.
    """

    covariance: Covariance
    inputs: Array
    targets: Array
    noise: Array
    known: Array | None = None

    @cached_property
    def centre(self) -> float:
        """Mean of the targets."""
        return float(self.targets.mean())

    @cached_property
    def matrix(self) -> Array:
        """Covariance of the targets, noise included, (n, n)."""
        matrix = self.covariance.among(self.inputs)
        matrix[np.diag_indices_from(matrix)] += self.noise
        return matrix

    @cached_property
    def inverse(self) -> Array:
        """Inverse of ``matrix``, (n, n)."""
        return np.linalg.inv(self.matrix).astype(float)

    @cached_property
    def weights(self) -> Array:
        """Weight of each row in a prediction, (n,)."""
        if self.known is not None:
            return self.known
        return self.inverse @ (self.targets - self.centre)

    def mean(self, inputs: Array) -> Array:
        """Predict inputs (m, d + p), (m,)."""
        return self.centre + self.covariance.between(inputs, self.inputs) @ self.weights

    def predict(self, inputs: Array) -> tuple[Array, Array]:
        """Return mean and variance of inputs (m, d + p), each (m,)."""
        cross = self.covariance.between(inputs, self.inputs)
        taken = np.einsum("ij,ij->i", cross @ self.inverse, cross)
        variance = np.maximum(self.covariance.variance(inputs) - taken, 0.0)
        return self.centre + cross @ self.weights, variance

    def joint(self, inputs: Array) -> tuple[Array, Array]:
        """Return mean (m,) and covariance (m, m) of inputs (m, d + p)."""
        cross = self.covariance.between(inputs, self.inputs)
        white = self._whitened(cross.T)
        covariance = self.covariance.between(inputs, inputs) - white.T @ white
        return self.centre + cross @ self.weights, covariance

    @cached_property
    def _root(self) -> Array:
        """Lower root of ``matrix``, (n, n)."""
        return np.linalg.cholesky(self.matrix).astype(float)

    @cached_property
    def whitening(self) -> Array:
        """Inverse of the lower root of ``matrix``, (n, n)."""
        return self._whitened(np.eye(len(self._root)))

    def _whitened(self, columns: Array) -> Array:
        """Return the inverse of the root times columns (n, m), block by block, (n, m)."""
        white = columns.copy()
        for k in range(0, len(white), BLOCK):
            rows = slice(k, k + BLOCK)
            white[rows] -= self._root[rows, :k] @ white[:k]
            white[rows] = np.linalg.solve(self._root[rows, rows], white[rows])
        return white


Targets = tuple[Array, Array, Array]  #: inputs (n, c + 2), targets (n,), noise variances (n,)

ANGLES = ("chamfer_deg", "traction_deg", "braking_deg")  #: that hold or let go
WIDTH = 0.04  #: of the ridge, tangent of an angle
FLOOR = 2e-4  #: s, added to a spread before its logarithm is taken
LIKE = 150  #: rows of like mismatch that share their noise


def design_coordinates(data: Dataset, x: Array) -> Array:
    """Return coordinates of designs (m, d) in edge units: scaled, and the ridge's, (m, c)."""
    scaled = data.scaled(x)
    friction = data.physics["dynamic_friction"]
    angles = [i for i, name in enumerate(data.variables) if name in ANGLES]
    tangents = np.tan(np.radians(np.atleast_2d(x)[:, angles]))
    return np.concatenate([scaled, np.tanh((tangents - friction) / WIDTH)], axis=1)


def point_coordinates(points: Array) -> Array:
    """Return coordinates of operating points, mismatch in 1/min and force in N, (m, 2).

    Logarithmic but for mismatches near zero, which may have either sign.
    """
    return np.column_stack([np.arcsinh(points[:, 0] / 5.0) / 4.0, np.log(points[:, 1] / 400.0)])


def timed(data: Dataset) -> Mask:
    """Mark the rows with a time, (n,) of bool: some shift engaged."""
    return np.isfinite(data.column("mean_s"))


def known_noise(data: Dataset) -> Array:
    """Return the variance of the logarithm of each mean, (n,).

    A mean that is low by luck has a low standard error too. Weighted by its own error, such a mean
    would draw all times down (by a percent, eight angles a row). Rows share the mean of those with
    the nearest mismatch instead, each for its own number of shifts that engaged.
    """
    count = data.column("engaged")
    one = count * (data.column("standard_error_s") / data.column("mean_s")) ** 2
    sure = count > 2  # fewer say nothing of their scatter
    one = np.where(sure, one, np.median(one[sure]) if sure.any() else 1.0)
    size = min(len(one), LIKE)
    order = np.argsort(data.points[:, 0], kind="stable")
    running = np.convolve(one[order], np.ones(size) / size, mode="valid")
    place = np.clip(np.arange(len(one)) - size // 2, 0, len(one) - size)
    shared = np.empty(len(one))
    shared[order] = running[place]
    return shared / count


def row_inputs(data: Dataset) -> Array:
    """Return the coordinates of all rows, (n, c + 2)."""
    designs = design_coordinates(data, data.x)
    return np.concatenate([designs, point_coordinates(data.points)], axis=1)


def time_targets(data: Dataset) -> Targets:
    """Return the logarithms of the mean times with their known noise.

    The logarithm of a noisy mean lies half its variance low, which is put back.
    """
    rows = data.subset(timed(data))
    noise = known_noise(rows)
    return row_inputs(rows), np.log(rows.column("mean_s")) + 0.5 * noise, noise


def spread_targets(data: Dataset) -> Targets:
    """Compute log standard deviations with the variance of their sampling noise."""
    rows = data.subset(data.column("engaged") > 2)
    noise = 0.5 / (rows.column("engaged") - 1.0) + 0.05
    # The logarithm of a deviation from few shifts lies half its variance low, too.
    return row_inputs(rows), np.log(rows.column("sd_s") + FLOOR) + 0.5 * noise, noise
