"""Figures of a validation: how good the surrogate is on designs that it has not seen.

Splits are by design: all rows of a design are on the same side, else a design's own shifts at other
operating points would predict it.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, fields, replace
from typing import Any

import numpy as np

from dogshape.surrogate.covariance import Array
from dogshape.surrogate.dataset import Mix, Reference
from dogshape.surrogate.model import Surrogate
from dogshape.surrogate.process import FLOOR

LEAST_Q2 = 0.5  #: of a surrogate that is of use
LEAST = 10  #: designs that figures of their expected times need


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
    source : ``references``, dense simulations of designs apart, or ``held out``.
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

    def as_dict(self) -> dict[str, Any]:
        """Return the figures by name."""
        return asdict(self)


def validation_of(record: dict[str, Any]) -> Validation:
    """Return the figures from a record; TypeError or KeyError where it lacks some."""
    return Validation(**{field.name: record[field.name] for field in fields(Validation)})


@dataclass(frozen=True)
class Prediction:
    """Predictions of the surrogate for reference designs.

    ``time`` and ``error`` are of the expected time of shifts that engage, (k,); ``means`` is
    that at each point, ``relative`` the standard deviation of its logarithm, ``spreads`` the
    standard deviation of a single shift, ``shares`` the share engaged, (k, m).
    """

    time: Array
    error: Array
    means: Array
    relative: Array
    spreads: Array
    shares: Array


def predict(surrogate: Surrogate, x: Array, mix: Mix) -> Prediction:
    """Predict designs (k, d) over a mix and at each of its points."""
    engaging = replace(mix, retry=0.0)
    found = [_predicted(surrogate, row, engaging) for row in x]
    return Prediction(*(np.array(column) for column in zip(*found, strict=True)))


def _predicted(surrogate: Surrogate, x: Array, mix: Mix) -> tuple[float | Array, ...]:
    """Return the fields of a prediction for one design (d,)."""
    inputs = surrogate.crossed(x[None, :], mix.points)
    own = surrogate.own
    if own is not None and own.covers(mix):
        expected = surrogate.expected(x, mix)
        mean, variance = (found[0] for found in own.at_points(x[None, :]))
    else:
        mean, covariance = surrogate.times.joint(inputs)
        expected = surrogate.summed(inputs, mean, covariance, mix)
        variance = np.maximum(np.diag(covariance), 0.0)
    return (
        expected.time,
        expected.error,
        np.exp(mean + 0.5 * variance),
        np.sqrt(variance),
        surrogate.spread(inputs),
        surrogate.share.at(inputs)[0],
    )


def figures(reference: Reference, prediction: Prediction, source: str, shifts: int) -> Validation:
    """Return the figures of predictions against references."""
    residual = prediction.time - reference.time
    within = np.hypot(prediction.error, reference.error)
    points = prediction.means - reference.means
    apart = np.abs(np.log(prediction.means / reference.means))
    noise = np.hypot(prediction.relative, reference.errors / reference.means)
    spread = np.log((prediction.spreads + FLOOR) / (reference.spreads + FLOOR))
    return Validation(
        q2=_q2(residual, reference.time),
        coverage_95=float((np.abs(residual) <= 1.96 * within).mean()),
        rmse_s=_rms(residual),
        bias_s=float(residual.mean()),
        n=len(reference),
        noise_s=_rms(reference.error),
        q2_points=_q2(points.ravel(), reference.means.ravel()),
        coverage_points=float((apart <= 1.96 * noise).mean()),
        rmse_points_s=_rms(points),
        spread_error=_rms(spread),
        lost=int(reference.lost.sum()),
        lost_expected=float(((1.0 - prediction.shares) * reference.shifts).sum()),
        rank_best=None,
        n_best=0,
        source=source,
        shifts=shifts,
    )


def ranked(validation: Validation, reference: Reference, predicted: Array) -> Validation:
    """Return the figures with the rank correlation of references that are all of the best."""
    if len(reference) < LEAST:
        return validation
    rank = rank_correlation(reference.time, predicted)
    return replace(validation, rank_best=rank, n_best=len(reference))


def rank_correlation(one: Array, other: Array) -> float:
    """Return Spearman's rank correlation of two series without ties, each (n,)."""
    ranks, others = (np.argsort(np.argsort(values)) for values in (one, other))
    return float(np.corrcoef(ranks, others)[0, 1])


def _q2(residual: Array, truth: Array) -> float:
    spread = float(((truth - truth.mean()) ** 2).sum())
    return 1.0 - float((residual**2).sum()) / spread if spread > 0.0 else 0.0


def _rms(values: Array) -> float:
    return float(np.sqrt((values**2).mean()))
