r"""Gaussian process of the expected shift time over the shape of the dog.

The process models :math:`y = \ln t`, which keeps times positive and makes errors
relative: :math:`y(x) = m + f(x) + \epsilon`, :math:`f` with a Matern 5/2 covariance and
a length scale for each variable (scaled to its search range), :math:`\epsilon` with
the known variance :math:`(s/t)^2` of each row. Rasmussen and Williams 2006, ch. 2.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass

import numpy as np
from sklearn.exceptions import ConvergenceWarning
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import ConstantKernel, Kernel, Matern, WhiteKernel

from sim.errors import InputError
from surrogate.dataset import Array, Dataset

MIN_DESIGNS = 10  #: fewer say nothing about five length scales


@dataclass(frozen=True)
class Prediction:
    """Median of the expected shift time with its 95 % interval, each (m,), s."""

    time: Array
    low: Array
    high: Array
    log_sd: Array


class Surrogate:
    """A fitted process; build with ``fit`` or, from known length scales, ``restore``."""

    def __init__(self, data: Dataset, kernel: Kernel, optimise: bool, seed: int = 0) -> None:
        self.data = data
        log_time = np.log(data.time)
        self._mean = float(log_time.mean())
        noise = (data.error / data.time) ** 2 + 1e-8
        self._process = GaussianProcessRegressor(
            kernel,
            alpha=noise,
            optimizer="fmin_l_bfgs_b" if optimise else None,
            n_restarts_optimizer=2 if optimise else 0,
            random_state=seed,
        )
        with warnings.catch_warnings():
            # A length scale at its bound only says that a variable does not matter.
            warnings.simplefilter("ignore", ConvergenceWarning)
            self._process.fit(data.scaled(data.x), log_time - self._mean)

    @property
    def theta(self) -> list[float]:
        """Logarithms of signal variance, d length scales and roughness."""
        return [float(v) for v in self._process.kernel_.theta]

    @property
    def roughness(self) -> float:
        """Variance of the logarithm that neither the shape nor the standard error explains.

        A few angles see the jumps of the shift time here or there as the dogs change, which
        makes the simulated mean rough; it belongs to the sample and not to the design.
        """
        return float(self._process.kernel_.k2.noise_level)

    def predict(self, x: Array) -> Prediction:
        """Predict the expected shift time of designs (m, d) in edge units."""
        mean, sd = self._process.predict(self.data.scaled(x), return_std=True)
        sd = np.sqrt(np.maximum(sd**2 - self.roughness, 0.0))
        centre = mean + self._mean
        return Prediction(
            time=np.exp(centre),
            low=np.exp(centre - 1.96 * sd),
            high=np.exp(centre + 1.96 * sd),
            log_sd=sd,
        )

    def sample(self, x: Array, rng: np.random.Generator) -> Array:
        """Draw the expected shift times of designs (m, d) from the posterior, (m,), s."""
        mean, covariance = self._process.predict(self.data.scaled(x), return_cov=True)
        covariance -= self.roughness * np.eye(len(covariance))
        jitter = 1e-7 * float(self._process.kernel_.diag(self.data.scaled(x[:1]))[0])
        root = np.linalg.cholesky(covariance + jitter * np.eye(len(covariance)))
        draw: Array = np.exp(mean + root @ rng.standard_normal(len(mean)) + self._mean)
        return draw


def _kernel(dimensions: int) -> Kernel:
    scales = np.full(dimensions, 0.5)
    matern = Matern(scales, length_scale_bounds=(0.05, 20.0), nu=2.5)
    smooth = ConstantKernel(0.02, constant_value_bounds=(1e-4, 10.0)) * matern
    return smooth + WhiteKernel(1e-4, noise_level_bounds=(1e-7, 1e-2))


def fit(data: Dataset, seed: int = 0) -> Surrogate:
    """Fit the process to a data set; fewer than ``MIN_DESIGNS`` raise InputError."""
    if len(data) < MIN_DESIGNS:
        raise InputError(
            f"the surrogate has {len(data)} simulated designs, but it needs more than "
            f"{MIN_DESIGNS}; run more trials"
        )
    return Surrogate(data, _kernel(data.x.shape[1]), optimise=True, seed=seed)


def restore(data: Dataset, theta: list[float]) -> Surrogate:
    """Rebuild a fitted process from its data and the logarithms of its parameters."""
    kernel = _kernel(data.x.shape[1]).clone_with_theta(np.array(theta))
    return Surrogate(data, kernel, optimise=False)
