"""Parameters of the surrogate's covariance by scikit-learn's Gaussian process."""

from __future__ import annotations

import warnings
from dataclasses import replace
from typing import Any

from scipy.optimize import minimize
from sklearn.exceptions import ConvergenceWarning
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import Kernel, StationaryKernelMixin

from dogshape.surrogate.covariance import Array, Covariance


class DesignKernel(StationaryKernelMixin, Kernel):  # type: ignore[misc]
    """The covariance as scikit-learn's Gaussian process takes it."""

    def __init__(self, covariance: Covariance, limits: Array) -> None:
        self.covariance = covariance
        self.limits = limits

    @property
    def theta(self) -> Array:
        """Logarithms of the parameters, (size,)."""
        return self.covariance.theta

    @theta.setter
    def theta(self, theta: Array) -> None:
        self.covariance = replace(self.covariance, theta=theta)

    @property
    def bounds(self) -> Array:
        """Bounds of ``theta``, (size, 2)."""
        return self.limits

    def __call__(self, X: Array, Y: Array | None = None, eval_gradient: bool = False) -> Any:
        """Compute the covariance (n, m), with its slopes by ``theta`` (n, n, size) if asked."""
        if eval_gradient:
            matrix, slopes = self.covariance.slopes(X)
            return matrix, slopes.transpose(1, 2, 0)
        return self.covariance.between(X, X if Y is None else Y)

    def diag(self, X: Array) -> Array:
        """Compute the variance of each input, (n,)."""
        return self(X).diagonal()


def likeliest(
    covariance: Covariance, bounds: Array, data: tuple[Array, Array, Array], steps: int
) -> Covariance:
    """Find the likeliest covariance of targets (n, k) at inputs (n, c) with noise (n,)."""
    inputs, targets, noise = data

    def minimum(objective: Any, theta: Array, bounds: Array) -> tuple[Array, float]:
        limit = {"maxiter": steps}
        found = minimize(
            objective, theta, method="L-BFGS-B", jac=True, bounds=bounds, options=limit
        )
        return found.x, found.fun

    kernel = DesignKernel(covariance, bounds)
    regressor = GaussianProcessRegressor(kernel, alpha=noise, optimizer=minimum)
    # A length scale at its bound: its coordinate does not matter.
    with warnings.catch_warnings(action="ignore", category=ConvergenceWarning):
        regressor.fit(inputs, targets)
    return replace(covariance, theta=regressor.kernel_.theta)
