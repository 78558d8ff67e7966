"""How good the surrogate is on designs that it has not seen."""

from __future__ import annotations

from dataclasses import asdict, dataclass

import numpy as np

from surrogate.dataset import Array, Dataset
from surrogate.model import MIN_DESIGNS, fit


@dataclass(frozen=True)
class Validation:
    """Figures of a cross-validation by design.

    ``q2`` is 1 less the squared error over the variance, ``coverage_95`` the share
    of held-out times within the 95 % interval (noise of the row included),
    ``rmse_s`` the root-mean-square error in s, ``n`` the number of designs.
    """

    q2: float
    coverage_95: float
    rmse_s: float
    n: int

    @property
    def useful(self) -> bool:
        """Whether the surrogate explains at least half of the variance."""
        return self.q2 >= 0.5

    def as_dict(self) -> dict[str, float]:
        """Return the figures by name."""
        return asdict(self)


def held_out(data: Dataset, folds: int = 8, seed: int = 0) -> tuple[Array, Array]:
    """Predict every design from fits that never saw it.

    Returns the predicted time (n,), s, and the standard deviation of its
    logarithm with the noise of the row, (n,).
    """
    n = len(data)
    folds = n if n < 2 * MIN_DESIGNS else folds
    order = np.random.default_rng(seed).permutation(n)
    time, sd = np.empty(n), np.empty(n)
    for fold in range(folds):
        out = order[fold::folds]
        keep = np.setdiff1d(order, out)
        model = fit(data.subset(keep), seed)
        prediction = model.predict(data.x[out])
        time[out] = prediction.time
        sample = (data.error[out] / data.time[out]) ** 2 + model.roughness
        sd[out] = np.sqrt(prediction.log_sd**2 + sample)
    return time, sd


def validate(data: Dataset, seed: int = 0) -> Validation:
    """Cross-validate the surrogate of a data set of more than ``MIN_DESIGNS`` designs."""
    time, sd = held_out(data, seed=seed)
    miss = data.time - time
    inside = np.abs(np.log(data.time / time)) <= 1.96 * sd
    spread = float(((data.time - data.time.mean()) ** 2).sum())
    return Validation(
        q2=1.0 - float((miss**2).sum()) / spread if spread > 0.0 else 0.0,
        coverage_95=float(inside.mean()),
        rmse_s=float(np.sqrt((miss**2).mean())),
        n=len(data),
    )
