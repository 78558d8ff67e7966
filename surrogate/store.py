"""The surrogate on disk: JSON with data, parameters, figures and versions.

The file holds its own hash, so a byte that changed is noticed; nothing in it is run.
"""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass, fields
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from dogshape.sim.errors import DataError
from dogshape.sim.files import write_whole
from dogshape.sim.versions import versions
from dogshape.surrogate.dataset import Dataset, Grid, Mix
from dogshape.surrogate.model import Surrogate, fit
from dogshape.surrogate.validation_figures import Validation

FORMAT = 4  #: version of the file
AGAIN = "fit the surrogate again with 'dogshape fit'"


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
        "validation": stored.validation.as_dict(),
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
    except (OSError, ValueError) as error:
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
        return Stored(_surrogate(content), Validation.from_dict(content["validation"]))
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
    text = json.dumps(content, sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:20]
