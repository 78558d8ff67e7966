"""The surrogate on disk: JSON with data, parameters, validation and versions."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from sim.errors import DataError
from sim.versions import versions
from surrogate.dataset import Dataset
from surrogate.model import Surrogate, restore
from surrogate.validation import Validation

FORMAT = 1  #: version of the file


def save(path: Path, surrogate: Surrogate, validation: Validation) -> None:
    """Write a fitted surrogate; the file holds all that ``load`` needs."""
    data = surrogate.data
    content = {
        "format": FORMAT,
        "variables": list(data.variables),
        "low": data.low.tolist(),
        "high": data.high.tolist(),
        "x": data.x.tolist(),
        "time_s": data.time.tolist(),
        "error_s": data.error.tolist(),
        "physics": data.physics,
        "digest": data.digest,
        "theta": surrogate.theta,
        "validation": validation.as_dict(),
        "versions": versions(),
    }
    temporary = path.with_suffix(".tmp")
    temporary.write_text(json.dumps(content, indent=1), encoding="utf-8")
    temporary.replace(path)


def load(path: Path) -> tuple[Surrogate, Validation]:
    """Read a surrogate; a damaged file or one of another format raises DataError."""
    content = _read(path)
    if content.get("format") != FORMAT:
        raise DataError(
            f"{path} has format {content.get('format')!r}, but this version reads format "
            f"{FORMAT}; fit the surrogate again with 'dogshape fit'"
        )
    try:
        data = Dataset(
            variables=tuple(content["variables"]),
            low=np.array(content["low"], dtype=float),
            high=np.array(content["high"], dtype=float),
            x=np.array(content["x"], dtype=float),
            time=np.array(content["time_s"], dtype=float),
            error=np.array(content["error_s"], dtype=float),
            physics=content["physics"],
        )
        intact = data.digest == content["digest"]
        validation = Validation(**content["validation"])
        theta = [float(v) for v in content["theta"]]
    except (KeyError, TypeError, ValueError) as error:
        raise DataError(f"{path} is incomplete ({error}); fit the surrogate again") from error
    if not intact:
        raise DataError(
            f"{path} was changed: its data do not match their hash; fit the surrogate again"
        )
    return restore(data, theta), validation


def _read(path: Path) -> dict[str, Any]:
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError as error:
        raise DataError(
            f"there is no surrogate at {path}; run 'dogshape study' or 'dogshape fit' first, "
            "or name a file with --surrogate"
        ) from error
    except (OSError, ValueError) as error:
        raise DataError(f"{path} is not a surrogate file; fit the surrogate again") from error
    if not isinstance(content, dict):
        raise DataError(f"{path} is not a surrogate file; fit the surrogate again")
    return content
