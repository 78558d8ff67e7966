"""Figures of a validation: how good the surrogate is on designs that it has not seen.

Always by design: rows of one design are on the same side of a split, else a design's own shifts
at other operating points would foretell it.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, fields
from typing import Any

import numpy as np

from surrogate.covariance import Array
from surrogate.mix import Mix
from surrogate.model import Surrogate
from surrogate.reference import Reference

BEST = 0.1  #: share of designs that a search cares for


@dataclass(frozen=True)
class Validation:
    """Figures on designs that the fit never saw.

    Parameters
    ----------
    q2 : of the expected time over the study's operating points: 1 less squared error over variance.
    coverage_95 : share of expected times within their 95 % interval.
    rmse_s : root-mean-square error of the expected time, s.
    n : number of designs.
    noise_s : root-mean-square standard error of the simulated expected times themselves, s.
    q2_points, coverage_points, rmse_points_s : the same for means at single operating points.
    rank_best : rank correlation (Spearman) among the best tenth of designs, if there are ten.
    source : ``references``, dense simulations of designs apart, or ``held out``.
    shifts : simulated shifts behind the fit.
    """

    q2: float
    coverage_95: float
    rmse_s: float
    n: int
    noise_s: float
    q2_points: float
    coverage_points: float
    rmse_points_s: float
    rank_best: float | None
    source: str
    shifts: int

    @property
    def useful(self) -> bool:
        """Whether the surrogate explains at least half of the variance."""
        return self.q2 >= 0.5

    def as_dict(self) -> dict[str, Any]:
        """Return the figures by name."""
        return asdict(self)


def validation_of(record: dict[str, Any]) -> Validation:
    """Return the figures from a record; TypeError or KeyError where it lacks some."""
    return Validation(**{field.name: record[field.name] for field in fields(Validation)})


@dataclass(frozen=True)
class Prediction:
    """What the surrogate says of reference designs.

    ``time`` and ``error`` are of the expected time, (k,); ``means`` of the shifts that engage
    at each point, ``relative`` the standard deviation of its logarithm, (k, m).
    """

    time: Array
    error: Array
    means: Array
    relative: Array


def predict(surrogate: Surrogate, x: Array, mix: Mix) -> Prediction:
    """Predict designs (k, d) over a mix and at each of its points."""
    expected = [surrogate.expected(row, mix) for row in x]
    size = len(mix.points)
    inputs = surrogate.inputs(np.repeat(x, size, axis=0), np.tile(mix.points, (len(x), 1)))
    mean, variance = surrogate.times.predict(inputs)
    return Prediction(
        time=np.array([e.time for e in expected]),
        error=np.array([e.error for e in expected]),
        means=np.exp(mean + 0.5 * variance).reshape(len(x), size),
        relative=np.sqrt(variance).reshape(len(x), size),
    )


def figures(reference: Reference, prediction: Prediction, source: str, shifts: int) -> Validation:
    """Return the figures of predictions against references."""
    miss = prediction.time - reference.time
    within = np.hypot(prediction.error, reference.error)
    points = prediction.means - reference.means
    apart = np.abs(np.log(prediction.means / reference.means))
    noise = np.hypot(prediction.relative, reference.errors / reference.means)
    return Validation(
        q2=_q2(miss, reference.time),
        coverage_95=float((np.abs(miss) <= 1.96 * within).mean()),
        rmse_s=_rms(miss),
        n=len(reference),
        noise_s=_rms(reference.error),
        q2_points=_q2(points.ravel(), reference.means.ravel()),
        coverage_points=float((apart <= 1.96 * noise).mean()),
        rmse_points_s=_rms(points),
        rank_best=rank_correlation(reference.time, prediction.time),
        source=source,
        shifts=shifts,
    )


def rank_correlation(time: Array, predicted: Array, share: float = BEST) -> float | None:
    """Return Spearman's rank correlation among the best ``share`` of designs, None below ten."""
    best = np.argsort(time)[: round(share * len(time))]
    if len(best) < 10:
        return None
    ranks, guessed = (np.argsort(np.argsort(values[best])) for values in (time, predicted))
    return float(np.corrcoef(ranks, guessed)[0, 1])


def _q2(miss: Array, truth: Array) -> float:
    spread = float(((truth - truth.mean()) ** 2).sum())
    return 1.0 - float((miss**2).sum()) / spread if spread > 0.0 else 0.0


def _rms(values: Array) -> float:
    return float(np.sqrt((values**2).mean()))
