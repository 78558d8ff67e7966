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
        "share": [number_or_none(surrogate.share.length), surrogate.share.strength],
        "validation": stored.validation.as_dict(),
        "versions": versions(),
    }
    content["hash"] = _hash(content)
    lines = (f"{json.dumps(k)}: {json.dumps(v, allow_nan=False)}" for k, v in content.items())
    write_whole(path, "{\n" + ",\n".join(lines) + "\n}\n")


class MissingError(DataError):
    """No file where a surrogate was looked for."""


def load(path: Path) -> Stored:
    """Read a surrogate; a damaged file or one of another format raises DataError."""
    return _stored(path, _text_of(path))


@lru_cache(maxsize=2)
def _stored(path: Path, text: str) -> Stored:
    # An unchanged file is asked again and again; its processes keep their inverses.
    content = _content(path, text)
    _require_format(path, content.get("format"))
    given = content.pop("hash", None)
    if given != _hash(content):
        raise DataError(f"{path} was changed or damaged: it does not match its hash; {AGAIN}")
    try:
        validation = Validation.from_dict(content["validation"])
        return Stored(_surrogate(content), validation)
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
    """Give numbers of nine digits, None where one is not finite, as JSON takes them."""
    return [[number_or_none(float(f"{v:.9g}")) for v in row] for row in values.tolist()]


def number_or_none(value: float) -> float | None:
    """Give a number that JSON can hold: None where it is not finite."""
    return value if np.isfinite(value) else None


def _hash(content: dict[str, Any]) -> str:
    text = json.dumps(content, sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:20]


def _require_format(path: Path, found: Any) -> None:
    if found == FORMAT:
        return
    newer = isinstance(found, int) and found > FORMAT
    remedy = "use the version of dogshape that wrote it, or a newer one" if newer else AGAIN
    raise DataError(
        f"{path} has format {found!r}, but this version reads format {FORMAT}; {remedy}"
    )


def _text_of(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8")
    except FileNotFoundError as error:
        raise MissingError(
            f"there is no surrogate at {path}; run 'dogshape study' or 'dogshape fit' first, "
            "or name a file with --surrogate"
        ) from error
    except (OSError, ValueError) as error:
        raise DataError(f"{path} is not a surrogate file; {AGAIN}") from error


def _content(path: Path, text: str) -> dict[str, Any]:
    try:
        content = json.loads(text)
    except ValueError as error:
        raise DataError(f"{path} is not a surrogate file; {AGAIN}") from error
    if not isinstance(content, dict):
        raise DataError(f"{path} is not a surrogate file; {AGAIN}")
    return content
