"""The surrogate on disk: JSON with data, parameters, figures and versions.

The file holds its own hash, so a byte that changed is noticed; nothing in it is run.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from dogshape.sim.errors import DataError
from dogshape.sim.files import write_whole
from dogshape.sim.versions import versions
from dogshape.surrogate.covariance import Array, Covariance, Term, starting
from dogshape.surrogate.dataset import COLUMNS, Dataset
from dogshape.surrogate.mix_times import own_of, own_record
from dogshape.surrogate.model import SMOOTH, TERMS, Share, Surrogate
from dogshape.surrogate.process import (
    Process,
    Targets,
    design_coordinates,
    row_inputs,
    spread_targets,
    time_targets,
)
from dogshape.surrogate.validation_figures import Validation, validation_of

FORMAT = 3  #: version of the file
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
        **({} if surrogate.own is None else {"own": own_record(surrogate.own)}),
        "variables": list(data.variables),
        "low": data.low.tolist(),
        "high": data.high.tolist(),
        "columns": [*data.variables, *COLUMNS],
        "rows": [[_number(v) for v in row] for row in data.rows.tolist()],
        "data_hash": data.digest,
        "times": _process_record(surrogate.times),
        "spreads": _process_record(surrogate.spreads),
        "share": {
            "length": _number(surrogate.share.length),
            "strength": surrogate.share.strength,
        },
        "validation": stored.validation.as_dict(),
        "versions": versions(),
    }
    content["hash"] = _hash(content)
    write_whole(path, _text(content))


class MissingError(DataError):
    """No file where a surrogate was looked for."""


def load(path: Path) -> Stored:
    """Read a surrogate; a damaged file or one of another format raises DataError."""
    content = _read(path)
    _require_format(path, content.get("format"))
    given = content.pop("hash", None)
    if given != _hash(content):
        raise DataError(f"{path} was changed or damaged: it does not match its hash; {AGAIN}")
    try:
        return Stored(
            _surrogate(content),
            validation_of(content["validation"]),
        )
    except (KeyError, TypeError, ValueError) as error:
        raise DataError(f"{path} is incomplete ({error}); {AGAIN}") from error


def _surrogate(content: dict[str, Any]) -> Surrogate:
    data = Dataset(
        variables=tuple(content["variables"]),
        low=np.array(content["low"], dtype=float),
        high=np.array(content["high"], dtype=float),
        rows=np.array(content["rows"], dtype=float),
        physics=content["physics"],
        engine=content["engine"],
    )
    designs = design_coordinates(data, data.x[:1]).shape[1]
    times, spreads = time_targets(data), spread_targets(data)
    share = content["share"]
    return Surrogate(
        data=data,
        times=_process(content["times"], TERMS, designs, times),
        spreads=_process(content["spreads"], (SMOOTH,), designs, spreads),
        share=Share(
            designs,
            row_inputs(data),
            data.column("engaged"),
            data.column("shifts"),
            np.inf if share["length"] is None else float(share["length"]),
            float(share["strength"]),
        ),
        own=own_of(content["own"], data) if "own" in content else None,
    )


def _process_record(process: Process) -> dict[str, list[float]]:
    return {
        "theta": process.covariance.theta.tolist(),
        "weights": process.weights.tolist(),
    }


def _process(
    record: dict[str, Any], terms: Sequence[Term], designs: int, targets: Targets
) -> Process:
    inputs, values, noise = targets
    theta: Array = np.array(record["theta"], dtype=float)
    covariance = Covariance(tuple(terms), designs, inputs.shape[1] - designs, theta)
    size = len(starting(covariance.terms, designs, covariance.points)[0])
    if len(theta) != size:
        raise ValueError(f"{len(theta)} parameters instead of {size}")
    weights: Array = np.array(record["weights"], dtype=float)
    return replace(Process(covariance, inputs, values, noise), known=weights)


def _number(value: float) -> float | None:
    """Return a number that JSON can hold: None where it is not finite."""
    return value if np.isfinite(value) else None


def _text(content: dict[str, Any]) -> str:
    """Return the file's text: a line for each key and for each row."""
    lines = []
    for key, value in content.items():
        if key == "rows":
            rows = ",\n".join(json.dumps(row) for row in value)
            lines.append(f'"rows": [\n{rows}\n]')
        else:
            lines.append(f"{json.dumps(key)}: {json.dumps(value, allow_nan=False)}")
    return "{\n" + ",\n".join(lines) + "\n}\n"


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


def _read(path: Path) -> dict[str, Any]:
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError as error:
        raise MissingError(
            f"there is no surrogate at {path}; run 'dogshape study' or 'dogshape fit' first, "
            "or name a file with --surrogate"
        ) from error
    except (OSError, ValueError) as error:
        raise DataError(f"{path} is not a surrogate file; {AGAIN}") from error
    if not isinstance(content, dict):
        raise DataError(f"{path} is not a surrogate file; {AGAIN}")
    return content
