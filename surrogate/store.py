"""Validation of a surrogate, and its file: JSON with data, parameters, figures and versions.

The file holds its own hash, so a byte that changed is noticed; nothing in it is run.
"""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass, fields, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import Field

from dogshape.sim.clutch_tables import Section
from dogshape.sim.elementwise import Array
from dogshape.sim.errors import DataError, InputError
from dogshape.sim.files import write_whole
from dogshape.sim.versions import versions
from dogshape.surrogate.dataset import Dataset, Grid, Mix
from dogshape.surrogate.model import Surrogate, fit

FORMAT = 4  #: version of the file
AGAIN = "fit the surrogate again with 'dogshape fit'"
LEAST_Q2 = 0.5  #: of a surrogate that is of use
LEAST = 10  #: designs that figures of their expected times need
FLOOR = 2e-4  #: s, added to a standard deviation before its logarithm is taken


def _figure(meaning: str, unit: str = "") -> Any:
    """Declare a figure with its meaning and unit, as ``result.json`` documents it."""
    return Field(description=meaning, json_schema_extra={"unit": unit})


class Validation(Section):
    """Validation of the surrogate on designs that the fit did not use."""

    q2: float = _figure("share of the variance of expected times that it explains", "1")
    coverage_95: float = _figure("share of expected times within their 95 % interval", "share")
    rmse_s: float = _figure("root-mean-square error of the expected time", "s")
    bias_s: float = _figure("mean error of the expected time", "s")
    n: int = _figure("number of designs")
    noise_s: float = _figure("root-mean-square standard error of the simulated expected times", "s")
    q2_points: float = _figure("share of the variance explained at single operating points", "1")
    coverage_points: float = _figure(
        "share within the 95 % interval at single operating points", "share"
    )
    rmse_points_s: float = _figure("root-mean-square error at single operating points", "s")
    spread_error: float = _figure("error of the logarithm of a single shift's deviation", "1")
    lost: int = _figure("shifts that did not engage")
    lost_expected: float = _figure("shifts that the surrogate expected not to engage")
    rank_best: float | None = _figure("rank correlation among designs of the best tenth", "1")
    n_best: int = _figure("number of those designs")
    source: str = _figure("`references`, designs simulated apart, or `held out`")
    shifts: int = _figure("shifts behind the fit")

    @property
    def useful(self) -> bool:
        """Test for half of the variance: of expected times, with few designs at single points."""
        return (self.q2 if self.n >= LEAST else self.q2_points) >= LEAST_Q2


def validate(
    surrogate: Surrogate, reference: Dataset | None = None, best: Dataset | None = None
) -> Validation:
    """Judge a surrogate by references at its own points, or else by leaving out each design.

    Of references that are all of the ``best`` it has the rank correlation; none for fewer than ten.
    """
    data = surrogate.data if reference is None else reference
    grid, mix = data.engaging, replace(data.mix, retry=0.0)
    if not len(grid.x):
        raise InputError("no design engages at every operating point, so nothing can judge the "
                         "surrogate; simulate more designs")  # fmt: skip
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
    share = surrogate.engaged(data.grid.x, mix)
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
        **_ranks(surrogate, best),
        source="held out" if reference is None else "references",
        shifts=surrogate.data.shifts,
    )


def _ranks(surrogate: Surrogate, best: Dataset | None) -> dict[str, Any]:
    if best is None or len((grid := best.engaging).x) < LEAST:
        return {"rank_best": None, "n_best": 0}
    from scipy.stats import spearmanr  # noqa: PLC0415  slow to load, and few verbs rank

    times = surrogate.predict(grid.x, replace(best.mix, retry=0.0))[0]
    rank = float(spearmanr(grid.means @ best.mix.weights, times).statistic)
    return {"rank_best": rank, "n_best": len(grid.x)}


def _q2(residual: Array, truth: Array) -> float:
    spread = float(((truth - truth.mean()) ** 2).sum())
    return 1.0 - float((residual**2).sum()) / spread if spread > 0.0 else 0.0


def _rms(values: Array) -> float:
    return float(np.sqrt((values**2).mean()))


@dataclass(frozen=True)
class Stored:
    """A surrogate with its figures."""

    surrogate: Surrogate
    validation: Validation


class MissingError(DataError):
    """No file where a surrogate was looked for."""


def save(path: Path, stored: Stored) -> None:
    """Write a surrogate; the file holds all that ``load`` needs."""
    surrogate, data = stored.surrogate, stored.surrogate.data
    content = {
        "format": FORMAT,
        "physics": data.physics,
        "engine": data.engine,
        "variables": list(data.variables),
        "low": data.low.tolist(),
        "high": data.high.tolist(),
        "points": data.mix.points.tolist(),
        "weights": data.mix.weights.tolist(),
        "retry": data.mix.retry,
        "grid": {f.name: _rounded(getattr(data.grid, f.name)) for f in fields(Grid)},
        "time": surrogate.time.covariance.theta.tolist(),
        "each_point": surrogate.points.covariance.theta.tolist(),
        "share": [_finite(surrogate.share.length), surrogate.share.strength],
        "validation": stored.validation.model_dump(),
        "versions": versions(),
    }
    content["hash"] = _hash(content)
    lines = (f"{json.dumps(k)}: {json.dumps(v, allow_nan=False)}" for k, v in content.items())
    write_whole(path, "{\n" + ",\n".join(lines) + "\n}\n")


def load(path: Path) -> Stored:
    """Read a surrogate; a damaged file or one of another format raises DataError."""
    try:
        return _stored(path, path.read_text(encoding="utf-8"))
    except FileNotFoundError as error:
        raise MissingError(
            f"there is no surrogate at {path}; run 'dogshape study' or 'dogshape fit' first, "
            "or name a file with --surrogate"
        ) from error
    except (OSError, ValueError, RecursionError) as error:
        raise DataError(f"{path} is not a surrogate file; {AGAIN}") from error


@lru_cache(maxsize=2)  # an unchanged file is asked again and again; its processes keep inverses
def _stored(path: Path, text: str) -> Stored:
    content = json.loads(text)
    if not isinstance(content, dict):
        raise ValueError("no object")
    if (found := content.get("format")) != FORMAT:
        newer = isinstance(found, int) and found > FORMAT
        remedy = "use the version of dogshape that wrote it, or a newer one" if newer else AGAIN
        raise DataError(
            f"{path} has format {found!r}, but this version reads format {FORMAT}; {remedy}"
        )
    if content.pop("hash", None) != _hash(content):
        raise DataError(f"{path} was changed or damaged: it does not match its hash; {AGAIN}")
    try:
        return Stored(_surrogate(content), Validation(**content["validation"]))
    except (KeyError, TypeError, ValueError) as error:
        raise DataError(f"{path} is incomplete ({error}); {AGAIN}") from error


def _surrogate(content: dict[str, Any]) -> Surrogate:
    low, high, points, weights, time, each = (
        np.array(content[key], dtype=float)
        for key in ("low", "high", "points", "weights", "time", "each_point")
    )
    grid = Grid(**{k: np.array(v, dtype=float) for k, v in content["grid"].items()})
    mix = Mix(points, weights, float(content["retry"]))
    names, physics, engine = (content[key] for key in ("variables", "physics", "engine"))
    data = Dataset(tuple(names), low, high, physics, engine, mix, grid)
    length, strength = content["share"]
    share = (np.inf if length is None else float(length), float(strength))
    return fit(data, known=(time, each, *share))


def _rounded(values: Any) -> list[list[float | None]]:
    """Give numbers of nine digits as JSON takes them."""
    return [[_finite(float(f"{v:.9g}")) for v in row] for row in values.tolist()]


def _finite(value: float) -> float | None:
    return value if np.isfinite(value) else None


def _hash(content: dict[str, Any]) -> str:
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()[:20]
