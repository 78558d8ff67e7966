"""Validation of a surrogate, and its file: JSON with data, parameters, figures and versions.

The file holds its own hash, so a byte that changed is noticed; nothing in it is run.
"""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass, fields, replace
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from dogshape.sim.clutch_tables import Section, key
from dogshape.sim.elementwise import Array
from dogshape.sim.errors import DataError, InputError
from dogshape.sim.files import write_whole
from dogshape.sim.interface import argument, verb
from dogshape.sim.versions import versions
from dogshape.surrogate.dataset import Dataset, Grid, Mix
from dogshape.surrogate.model import NORMAL_95, Parameters, Surrogate, fit

FORMAT = 4  #: version of the file
MIN_Q2 = 0.5  #: of a useful surrogate
MIN_VALIDATION_DESIGNS = 10  #: of figures of expected times
SD_OFFSET_S = 2e-4  #: added to a standard deviation before its logarithm is taken
HASH_DIGITS = 20


def _fit_again() -> str:
    """Write the remedy of a surrogate file that cannot be used."""
    return f"fit the surrogate again with {verb('fit')}"


class Validation(Section):
    """Validation of the surrogate on designs that the fit did not use."""

    q2: float = key("share of the variance of expected times that it explains", "1")
    coverage_95: float = key("share of expected times within their 95 % interval", "share")
    rmse_s: float = key("root-mean-square error of the expected time", "s")
    bias_s: float = key("mean error of the expected time", "s")
    n: int = key("number of designs")
    noise_s: float = key("root-mean-square standard error of the simulated expected times", "s")
    q2_points: float = key("share of the variance explained at single operating points", "1")
    coverage_points: float = key(
        "share within the 95 % interval at single operating points", "share"
    )
    rmse_points_s: float = key("root-mean-square error at single operating points", "s")
    spread_error: float = key("error of the logarithm of a single shift's deviation", "1")
    lost: int = key("shifts that did not engage")
    lost_expected: float = key("shifts that the surrogate expected not to engage")
    rank_best: float | None = key("rank correlation among designs of the best tenth", "1")
    n_best: int = key("number of those designs")
    source: str = key("`references`, designs simulated apart, or `held out`")
    shifts: int = key("shifts behind the fit")

    @property
    def useful(self) -> bool:
        """Whether ``MIN_Q2`` of the variance is explained, of few designs at single points."""
        q2 = self.q2 if self.n >= MIN_VALIDATION_DESIGNS else self.q2_points
        return q2 >= MIN_Q2


def validate(
    surrogate: Surrogate, reference: Dataset | None = None, best: Dataset | None = None
) -> Validation:
    """Validate a surrogate on reference designs, by default by leave-one-out of its own.

    The rank correlation is that of the designs of ``best``, None for fewer than
    ``MIN_VALIDATION_DESIGNS``.
    """
    data = surrogate.data if reference is None else reference
    grid = data.engaging
    mix = replace(data.mix, retry=0.0)
    if not len(grid.x):
        raise InputError(
            "no design engages at every operating point, so nothing can judge the "
            "surrogate; simulate more designs"
        )
    if reference is None:
        prediction = _predict_left_out(surrogate)
    else:
        prediction = _predict_reference(surrogate, grid, mix)
    times = grid.means @ mix.weights
    time_errors = np.sqrt(grid.errors**2 @ mix.weights**2)
    residual = prediction.time - times
    coverage = np.abs(residual) <= NORMAL_95 * np.hypot(prediction.error, time_errors)
    point_residual = prediction.point_time - grid.means
    point_error = np.hypot(prediction.point_error, grid.errors / grid.means)
    log_ratio = np.log(prediction.point_time / grid.means)
    point_coverage = np.abs(log_ratio) <= NORMAL_95 * point_error
    sds = surrogate.variation(mix.points) * prediction.point_time
    share = surrogate.predict_engaged(data.grid.x, mix)
    return Validation(
        q2=_q2(residual, times),
        coverage_95=float(coverage.mean()),
        rmse_s=_rms(residual),
        bias_s=float(residual.mean()),
        n=len(times),
        noise_s=_rms(time_errors),
        q2_points=_q2(point_residual.ravel(), grid.means.ravel()),
        coverage_points=float(point_coverage.mean()),
        rmse_points_s=_rms(point_residual),
        spread_error=_rms(np.log((sds + SD_OFFSET_S) / (grid.sds + SD_OFFSET_S))),
        lost=round((data.grid.shifts - data.grid.engaged).sum()),
        lost_expected=float(((1.0 - share) * data.grid.shifts).sum()),
        **_rank_correlation(surrogate, best),
        source="held out" if reference is None else "references",
        shifts=surrogate.data.shifts,
    )


class _Prediction(NamedTuple):
    """Predicted times of the designs of a validation."""

    time: Array  #: expected time, s, (n,)
    error: Array  #: standard error of the expected time, s, (n,)
    point_time: Array  #: time at each point, s, (n, q)
    point_error: Array  #: standard error of its logarithm, (n, q)


def _predict_left_out(surrogate: Surrogate) -> _Prediction:
    """Predict each design of the surrogate from all others."""
    mean, variance = surrogate.time.leave_one_out()
    time = np.exp(mean + 0.5 * variance)[:, 0]
    point_mean, point_variance = surrogate.points.leave_one_out()
    point_error = np.sqrt(point_variance) * surrogate.misfit
    return _Prediction(
        time=time,
        error=time * np.sqrt(np.expm1(variance[:, 0])),
        point_time=np.exp(point_mean + 0.5 * point_error**2),
        point_error=point_error,
    )


def _predict_reference(surrogate: Surrogate, grid: Grid, mix: Mix) -> _Prediction:
    """Predict reference designs over their mix."""
    time, error = surrogate.predict(grid.x, mix)
    point_time, point_variance = surrogate.predict_points(grid.x, mix)
    return _Prediction(time, error, point_time, np.sqrt(point_variance))


def _rank_correlation(surrogate: Surrogate, best: Dataset | None) -> dict[str, Any]:
    """Compute the rank correlation of predicted and simulated times of the best designs."""
    grid = None if best is None else best.engaging
    if best is None or grid is None or len(grid.x) < MIN_VALIDATION_DESIGNS:
        return {"rank_best": None, "n_best": 0}
    from scipy.stats import spearmanr  # noqa: PLC0415  slow to load, and few verbs rank

    times, _ = surrogate.predict(grid.x, replace(best.mix, retry=0.0))
    rank = float(spearmanr(grid.means @ best.mix.weights, times).statistic)
    return {"rank_best": rank, "n_best": len(grid.x)}


def _q2(residual: Array, truth: Array) -> float:
    """Compute the share of the variance explained, 0 for equal values."""
    squares = float(((truth - truth.mean()) ** 2).sum())
    if squares <= 0.0:
        return 0.0
    return 1.0 - float((residual**2).sum()) / squares


def _rms(values: Array) -> float:
    return float(np.sqrt((values**2).mean()))


@dataclass(frozen=True)
class Stored:
    """A surrogate with its validation."""

    surrogate: Surrogate
    validation: Validation


class MissingError(DataError):
    """No file where a surrogate was looked for."""


class _Content(NamedTuple):
    """Content of a surrogate's file, by its keys."""

    format: int
    physics: dict[str, Any]  #: everything else that a shift depends on
    engine: dict[str, Any]  #: versions of the programs that simulated
    variables: list[str]
    low: list[float]  #: of the range of each variable, in the units of the study
    high: list[float]
    points: list[list[float]]  #: as those of ``Mix``, as the next two
    weights: list[float]
    retry: float
    grid: dict[str, list[list[float | None]]]  #: fields of ``Grid``
    time: list[float]  #: ``theta`` of the covariance of expected times
    each_point: list[float]  #: ``theta`` of the covariance at single points
    share: Any  #: length of the share that engages, None for an infinite one, and its strength
    validation: dict[str, Any]  #: fields of ``Validation``
    versions: dict[str, str]


def save(path: Path, stored: Stored) -> None:
    """Write a surrogate; the file holds all that ``load`` needs."""
    surrogate = stored.surrogate
    data = surrogate.data
    file_content = _Content(
        format=FORMAT,
        physics=data.physics,
        engine=data.engine,
        variables=list(data.variables),
        low=data.low.tolist(),
        high=data.high.tolist(),
        points=data.mix.points.tolist(),
        weights=data.mix.weights.tolist(),
        retry=data.mix.retry,
        grid={field.name: _round(getattr(data.grid, field.name)) for field in fields(Grid)},
        time=surrogate.time.covariance.theta.tolist(),
        each_point=surrogate.points.covariance.theta.tolist(),
        share=[_finite_or_none(surrogate.share.length), surrogate.share.strength],
        validation=stored.validation.model_dump(),
        versions=versions(),
    )
    values = file_content._asdict()
    content = {**values, "hash": _hash(values)}
    lines = [
        f"{json.dumps(key)}: {json.dumps(value, allow_nan=False)}" for key, value in content.items()
    ]
    write_whole(path, "{\n" + ",\n".join(lines) + "\n}\n")


def load(path: Path) -> Stored:
    """Read a surrogate; a damaged file or one of another format raises DataError."""
    try:
        return _stored(path, path.read_text(encoding="utf-8"))
    except FileNotFoundError as error:
        raise MissingError(
            f"there is no surrogate at {path}; run {verb('search')} or {verb('fit')} first, "
            f"or name a file with {argument('surrogate')}"
        ) from error
    except (OSError, ValueError, RecursionError) as error:
        raise DataError(f"{path} is not a surrogate file; {_fit_again()}") from error


@lru_cache(maxsize=2)  # an unchanged file is read often, and its processes keep inverses
def _stored(path: Path, text: str) -> Stored:
    content = json.loads(text)
    if not isinstance(content, dict):
        raise ValueError("no object")
    file_format = content.get("format")
    if file_format != FORMAT:
        remedy = _fit_again()
        if isinstance(file_format, int) and file_format > FORMAT:
            remedy = "use the version of dogshape that wrote it, or a newer one"
        raise DataError(
            f"{path} has format {file_format!r}, but this version reads format {FORMAT}; {remedy}"
        )
    if content.pop("hash", None) != _hash(content):
        fault = "was changed or damaged: it does not match its hash"
        raise DataError(f"{path} {fault}; {_fit_again()}")
    try:
        file_content = _Content(*(content[name] for name in _Content._fields))
        return Stored(_surrogate(file_content), Validation(**file_content.validation))
    except (KeyError, TypeError, ValueError) as error:
        raise DataError(f"{path} is incomplete ({error}); {_fit_again()}") from error


def _surrogate(content: _Content) -> Surrogate:
    """Build the surrogate from the content of its file."""
    mix = Mix(
        points=_array(content.points),
        weights=_array(content.weights),
        retry=float(content.retry),
    )
    data = Dataset(
        variables=tuple(content.variables),
        low=_array(content.low),
        high=_array(content.high),
        physics=content.physics,
        engine=content.engine,
        mix=mix,
        grid=Grid(**{name: _array(values) for name, values in content.grid.items()}),
    )
    length, strength = content.share
    parameters = Parameters(
        time=_array(content.time),
        points=_array(content.each_point),
        share_length=np.inf if length is None else float(length),
        share_strength=float(strength),
    )
    return fit(data, parameters=parameters)


def _array(values: Any) -> Array:
    return np.array(values, dtype=float)


def _round(values: Array) -> list[list[float | None]]:
    """Round an array (n, q) to nine digits for JSON, None for numbers that are not finite."""
    rows: list[list[float | None]] = []
    for row in values.tolist():
        rows.append([_finite_or_none(float(f"{value:.9g}")) for value in row])
    return rows


def _finite_or_none(value: float) -> float | None:
    return value if np.isfinite(value) else None


def _hash(content: dict[str, Any]) -> str:
    text = json.dumps(content, sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:HASH_DIGITS]
