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
    """Kernel of scikit-learn from a covariance, with ``theta`` (size,) to fit."""

    theta: Any = None  # values in the place of the base's properties
    bounds: Any = None

    def __init__(self, covariance: Covariance, theta: Array, bounds: Array) -> None:
        self.covariance = covariance
        self.theta = theta
        self.bounds = bounds

    def __call__(self, X: Array, Y: Array | None = None, eval_gradient: bool = False) -> Any:
        """Compute the covariance (n, m), with ``eval_gradient`` also its slopes (n, n, size)."""
        covariance = replace(self.covariance, theta=self.theta)
        if eval_gradient:
            matrix, slopes = covariance.slopes(X)
            return matrix, slopes.transpose(1, 2, 0)
        return covariance.between(X, X if Y is None else Y)

    def diag(self, X: Array) -> Array:
        """Compute the variance of each input, (n,)."""
        return self(X).diagonal()


def fit_covariance(
    covariance: Covariance,
    inputs: Array,
    targets: Array,
    *,
    noise: Array,
    bounds: Array,
    steps: int,
) -> Covariance:
    """Fit the likeliest parameters to targets (n, k) at inputs (n, c) with noise variances (n,).

    ``covariance`` has the initial parameters, ``bounds`` (size, 2) limits them, and ``steps`` is
    the largest number of iterations.
    """

    def minimize(objective: Any, theta: Array, bounds: Array) -> Any:
        return fmin_l_bfgs_b(objective, theta, bounds=bounds, maxiter=steps)[:2]

    kernel = DesignKernel(covariance, covariance.theta, bounds)
    regressor = GaussianProcessRegressor(kernel, alpha=noise, optimizer=minimize)
    return replace(covariance, theta=regressor.fit(inputs, targets).kernel_.theta)
