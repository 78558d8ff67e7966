"""Asking the surrogate about many designs at once: a table in, a table out."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.config import Study
from sim.errors import InputError, did_you_mean
from surrogate.covariance import Array
from surrogate.mix import Mix
from surrogate.model import Surrogate, interval
from surrogate.over import Over
from surrogate.query import in_range, require_same_physics

ANSWERS = (
    "expected_shift_time_s", "low_s", "high_s", "standard_error_s", "distance", "in_range",
)  # fmt: skip


def ask_many(
    study: Study, surrogate: Surrogate, mix: Mix, source: Path, out: Path | None
) -> dict[str, Any]:
    """Predict the designs of a table and write it again with the answers beside them.

    Variables that the table lacks take the study's value. Other columns are kept.
    """
    require_same_physics(surrogate.data, study.physics)
    head, rows = _read(source)
    target = out or source.with_name(f"{source.stem}-times.csv")
    if target.resolve() == source.resolve():
        raise InputError(f"--out is {target}, the table that is read; name another file")
    x = _designs(study, surrogate.data.variables, source, head, rows)
    time, error = Over(surrogate, mix).predict(x)
    low, high = interval(time, error)
    known = in_range(surrogate, x, mix)
    columns = (time, low, high, error, surrogate.distance(x))
    with target.open("w", newline="", encoding="utf-8") as handle:
        writer = csv.writer(handle)
        writer.writerow([*head, *ANSWERS])
        for row, numbers, inside in zip(
            rows, np.column_stack(columns).tolist(), known.tolist(), strict=True
        ):
            writer.writerow([*row, *(f"{number:.6g}" for number in numbers), inside])
    best = int(np.argmin(time))
    return {
        "file": str(target),
        "n": len(rows),
        "in_range": int(known.sum()),
        "best": {
            **dict(zip(surrogate.data.variables, x[best].tolist(), strict=True)),
            "expected_shift_time_s": float(time[best]),
        },
    }


def _read(source: Path) -> tuple[list[str], list[list[str]]]:
    if not source.is_file():
        raise InputError(f"there is no table of designs at {source}; check --designs")
    try:
        with source.open(newline="", encoding="utf-8-sig") as handle:
            head, *rows = [row for row in csv.reader(handle) if row]
    except (ValueError, UnicodeDecodeError, csv.Error) as error:
        raise InputError(
            f"{source} is not a table: it needs a line of names and then designs; "
            "write it as CSV with commas"
        ) from error
    if not rows:
        raise InputError(f"{source} holds no design below its line of names; add some")
    for number, row in enumerate(rows, start=2):
        if len(row) != len(head):
            raise InputError(
                f"{source}, line {number} has {len(row)} values for {len(head)} names; mend it"
            )
    return head, rows


def _designs(
    study: Study, variables: tuple[str, ...], source: Path, head: list[str], rows: list[list[str]]
) -> Array:
    named = [name for name in head if name in variables]
    if not named:
        hint = did_you_mean(head[0], variables)
        raise InputError(f"{source} has no column of a variable, such as '{head[0]}'; {hint}")
    x = np.tile([study.prototype[name] for name in variables], (len(rows), 1)).astype(float)
    for name in named:
        place = head.index(name)
        try:
            x[:, variables.index(name)] = [float(row[place]) for row in rows]
        except ValueError as error:
            raise InputError(f"{source}, column {name}: {error}; give numbers") from error
    if "count" in variables and (x[:, variables.index("count")] % 1.0 != 0.0).any():
        raise InputError(f"{source}, column count: dogs come in whole numbers; round them")
    if not np.isfinite(x).all():
        raise InputError(f"{source} holds a value that is not finite; give numbers")
    return x
