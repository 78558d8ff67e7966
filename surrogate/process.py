r"""A Gaussian process given its data: what is known anywhere, and how well.

With covariance *k*, noise variances :math:`s_i^2` of the rows and targets *y* about their
mean *c*,

.. math:: \mu(z) = c + k(z)^T \alpha, \quad \alpha = (K + S)^{-1} (y - c), \qquad
   C(z, z') = k(z, z') - k(z)^T (K + S)^{-1} k(z')

(Rasmussen and Williams 2006, ch. 2). Numpy alone: asking must start fast.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from dogshape.surrogate.covariance import Array, Covariance

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
