"""Fitting a process: parameters of the covariance by maximum likelihood, with scikit-learn.

The likelihood of many rows is dear (its cost grows with their cube), so parameters come from
a random part of them and the data from all.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from scipy.optimize import minimize
from sklearn.exceptions import ConvergenceWarning
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import Kernel

from dogshape.surrogate.covariance import Array, Covariance, Term, starting
from dogshape.surrogate.process import Process


@dataclass(frozen=True)
class Effort:
    """Cost limit of a fit: rows that parameters are fitted to, drawn by seed, and steps."""

    rows: int = 600
    steps: int = 60
    seed: int = 0


WHOLE = Effort()  #: of a fit that is kept


class PointKernel(Kernel):  # type: ignore[misc]
    """The covariance as scikit-learn's Gaussian process takes it."""

    def __init__(self, covariance: Covariance, limits: Array) -> None:
        self.covariance = covariance
        self.limits = limits

    @property
    def theta(self) -> Array:
        """Parameters, (size,)."""
        return self.covariance.theta

    @theta.setter
    def theta(self, theta: Array) -> None:
        known = self.covariance
        self.covariance = Covariance(known.terms, known.designs, known.points, np.array(theta))

    @property
    def bounds(self) -> Array:
        """Bounds of the parameters, (size, 2)."""
        return self.limits

    def __call__(self, X: Array, Y: Array | None = None, eval_gradient: bool = False) -> Any:
        """Return the covariance, with its slopes where they are asked for."""
        if eval_gradient:
            return self.covariance.slopes(X)
        return self.covariance.between(X, X if Y is None else Y)

    def diag(self, X: Array) -> Array:
        """Return the variance of each input."""
        return self.covariance.variance(X)

    def is_stationary(self) -> bool:
        """Report that the kernel is not stationary: it grows with the mismatch."""
        return False


@contextmanager
def bounds_unsaid() -> Iterator[None]:
    """Leave out the warning of a length scale at its bound: its coordinate does not matter."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ConvergenceWarning)
        yield


def fit_process(
    terms: tuple[Term, ...],
    designs: int,
    data: tuple[Array, Array, Array],
    start: Array | None = None,
    effort: Effort = WHOLE,
) -> Process:
    """Return the likeliest process of inputs (n, d + p), targets (n,), noise variances (n,).

    ``designs`` is d; ``start`` are parameters to begin with, (size,).
    """
    inputs, targets, noise = data
    first, bounds = starting(terms, designs, inputs.shape[1] - designs)
    theta = first if start is None else np.clip(start, bounds[:, 0], bounds[:, 1])
    covariance = Covariance(terms, designs, inputs.shape[1] - designs, theta)
    if effort.steps == 0:
        return Process(covariance, inputs, targets, noise)
    few = np.random.default_rng(effort.seed).permutation(len(targets))[: effort.rows]
    regressor = GaussianProcessRegressor(
        PointKernel(covariance, bounds), alpha=noise[few], optimizer=partial(_minimum, effort.steps)
    )
    with bounds_unsaid():
        regressor.fit(inputs[few], targets[few] - targets.mean())
    return Process(regressor.kernel_.covariance, inputs, targets, noise)


def _minimum(steps: int, objective: Any, theta: Array, bounds: Array) -> tuple[Array, float]:
    found = minimize(
        objective, theta, method="L-BFGS-B", jac=True, bounds=bounds, options={"maxiter": steps}
    )
    return found.x, found.fun
