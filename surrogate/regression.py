"""Parameters of the surrogate's covariance by scikit-learn's Gaussian process."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from scipy.optimize import fmin_l_bfgs_b
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import Kernel, StationaryKernelMixin

from dogshape.sim.elementwise import Array
from dogshape.surrogate.covariance import Covariance


class DesignKernel(StationaryKernelMixin, Kernel):  # type: ignore[misc]
    """The covariance as scikit-learn's Gaussian process takes it: ``theta`` (size,) varies."""

    theta: Any = None  # values in the place of the base's properties
    bounds: Any = None

    def __init__(self, covariance: Covariance, theta: Array, bounds: Array) -> None:
        self.covariance, self.theta, self.bounds = covariance, theta, bounds

    def __call__(self, X: Array, Y: Array | None = None, eval_gradient: bool = False) -> Any:
        """Compute the covariance (n, m), with its slopes by ``theta`` (n, n, size) if asked."""
        covariance = replace(self.covariance, theta=self.theta)
        if eval_gradient:
            matrix, slopes = covariance.slopes(X)
            return matrix, slopes.transpose(1, 2, 0)
        return covariance.between(X, X if Y is None else Y)

    def diag(self, X: Array) -> Array:
        """Compute the variance of each input, (n,)."""
        return self(X).diagonal()


def likeliest(
    covariance: Covariance, bounds: Array, data: tuple[Array, Array, Array], steps: int
) -> Covariance:
    """Find the likeliest covariance of targets (n, k) at inputs (n, c) with noise (n,)."""
    inputs, targets, noise = data

    def minimum(objective: Any, theta: Array, bounds: Array) -> Any:
        return fmin_l_bfgs_b(objective, theta, bounds=bounds, maxiter=steps)[:2]

    kernel = DesignKernel(covariance, covariance.theta, bounds)
    regressor = GaussianProcessRegressor(kernel, alpha=noise, optimizer=minimum)
    return replace(covariance, theta=regressor.fit(inputs, targets).kernel_.theta)
