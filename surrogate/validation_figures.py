"""Figures of a validation: how good the surrogate is on designs that it has not seen."""

from __future__ import annotations

from dataclasses import asdict, dataclass, fields, replace
from typing import Any

import numpy as np

from dogshape.sim.errors import InputError
from dogshape.surrogate.covariance import Array
from dogshape.surrogate.dataset import Dataset
from dogshape.surrogate.model import Surrogate

LEAST_Q2 = 0.5  #: of a surrogate that is of use
LEAST = 10  #: designs that figures of their expected times need
FLOOR = 2e-4  #: s, added to a standard deviation before its logarithm is taken


@dataclass(frozen=True)
class Validation:
    """Figures on designs that the fit never saw.

    Parameters
    ----------
    q2 : of the expected time over the study's operating points (of shifts that engage): 1 less
        squared error over variance.
    coverage_95 : share of expected times within their 95 % interval.
    rmse_s, bias_s : root-mean-square and mean error of the expected time, s.
    n : number of designs.
    noise_s : root-mean-square standard error of the simulated expected times themselves, s.
    q2_points, coverage_points, rmse_points_s : the same for means at single operating points.
    spread_error : root-mean-square error of the logarithm of a single shift's deviation.
    lost, lost_expected : shifts that did not engage, and how many the surrogate expected.
    rank_best, n_best : rank correlation (Spearman) among designs of the best tenth, and their
        number; None for fewer than ten.
    source : ``references``, dense simulations of designs apart, or ``held out``, each design from
        all others, with parameters of all.
    shifts : simulated shifts behind the fit.
    """

    q2: float
    coverage_95: float
    rmse_s: float
    bias_s: float
    n: int
    noise_s: float
    q2_points: float
    coverage_points: float
    rmse_points_s: float
    spread_error: float
    lost: int
    lost_expected: float
    rank_best: float | None
    n_best: int
    source: str
    shifts: int

    @property
    def useful(self) -> bool:
        """Test that the surrogate explains at least half of the variance.

        The variance is that of expected times, or with few designs of single operating points.
        """
        return (self.q2 if self.n >= LEAST else self.q2_points) >= LEAST_Q2

    @classmethod
    def from_dict(cls, record: dict[str, Any]) -> Validation:
        """Read the figures from a record; KeyError where it lacks some."""
        return cls(**{field.name: record[field.name] for field in fields(cls)})

    def as_dict(self) -> dict[str, Any]:
        """Return the figures by name."""
        return asdict(self)


def validate(surrogate: Surrogate, reference: Dataset | None = None) -> Validation:
    """Judge a surrogate by references at its own points, or else by leaving out each design."""
    data = surrogate.data if reference is None else reference
    grid, mix = data.engaging, replace(data.mix, retry=0.0)
    if not len(grid.x):
        raise InputError(
            "no design was simulated at every operating point and engaged at each, so nothing "
            "can judge the surrogate; simulate more designs"
        )
    if reference is None:
        (mean, variance), each = surrogate.time.left_out(), surrogate.points.left_out()
        time = np.exp(mean + 0.5 * variance)[:, 0]
        error = time * np.sqrt(np.expm1(variance[:, 0]))
        relative = np.sqrt(each[1]) * surrogate.misfit
        means = np.exp(each[0] + 0.5 * relative**2)
    else:
        time, error = surrogate.predict(grid.x, mix)
        means, spread = surrogate.at_points(grid.x, mix)
        relative = np.sqrt(spread)
    own, own_error = grid.means @ mix.weights, np.sqrt(grid.errors**2 @ mix.weights**2)
    share = surrogate.engaged(data.x, mix)
    deviations = surrogate.variation(mix.points) * means
    residual, points = time - own, means - grid.means
    noise = np.hypot(relative, grid.errors / grid.means)
    within = np.abs(residual) <= 1.96 * np.hypot(error, own_error)
    within_points = np.abs(np.log(means / grid.means)) <= 1.96 * noise
    return Validation(
        q2=_q2(residual, own),
        coverage_95=float(within.mean()),
        rmse_s=_rms(residual),
        bias_s=float(residual.mean()),
        n=len(own),
        noise_s=_rms(own_error),
        q2_points=_q2(points.ravel(), grid.means.ravel()),
        coverage_points=float(within_points.mean()),
        rmse_points_s=_rms(points),
        spread_error=_rms(np.log((deviations + FLOOR) / (grid.sds + FLOOR))),
        lost=round((data.grid.shifts - data.grid.engaged).sum()),
        lost_expected=float(((1.0 - share) * data.grid.shifts).sum()),
        rank_best=None,
        n_best=0,
        source="held out" if reference is None else "references",
        shifts=surrogate.data.shifts,
    )


def ranked(validation: Validation, surrogate: Surrogate, best: Dataset) -> Validation:
    """Add the rank correlation of references that are all of the best."""
    grid, mix = best.engaging, replace(best.mix, retry=0.0)
    if len(grid.x) < LEAST:
        return validation
    rank = rank_correlation(grid.means @ mix.weights, surrogate.predict(grid.x, mix)[0])
    return replace(validation, rank_best=rank, n_best=len(grid.x))


def rank_correlation(one: Array, other: Array) -> float:
    """Return Spearman's rank correlation of two series without ties, each (n,)."""
    ranks, others = (np.argsort(np.argsort(values)) for values in (one, other))
    return float(np.corrcoef(ranks, others)[0, 1])


def _q2(residual: Array, truth: Array) -> float:
    spread = float(((truth - truth.mean()) ** 2).sum())
    return 1.0 - float((residual**2).sum()) / spread if spread > 0.0 else 0.0


def _rms(values: Array) -> float:
    return float(np.sqrt((values**2).mean()))
