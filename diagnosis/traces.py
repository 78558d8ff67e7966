"""Time series of bench shifts, from CSV or LabVIEW's TDMS.

A trace starts with the force. Time has to grow from sample to sample, and every value has to
be a finite number; other columns or channels than those of ``COLUMNS`` are let be.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from diagnosis.tdms import read_channels
from sim.errors import DataError, did_you_mean
from sim.units import to_si

Series = NDArray[np.float64]

COLUMNS = ("t_s", "displacement_mm", "force_N", "sliding_speed_rpm", "output_speed_rpm")
LEAST = 10  #: samples that a trace must have


@dataclass(frozen=True, eq=False)
class BenchTrace:
    """Time series of one bench shift, each (n,), SI units.

    ``displacement`` and ``force`` are referred to the sleeve, wherever they are measured.
    """

    path: Path
    time: Series
    displacement: Series
    force: Series
    sliding_speed: Series
    output_speed: Series

    @property
    def relative_speed(self) -> Series:
        """Output less sliding speed, rad/s, (n,)."""
        return self.output_speed - self.sliding_speed

    @property
    def step(self) -> float:
        """Median time from sample to sample, s."""
        return float(np.median(np.diff(self.time)))


def read_trace(path: Path) -> BenchTrace:
    """Read a trace; every mistake raises DataError with file, row or channel, and remedy."""
    if not path.is_file():
        raise DataError(f"there is no trace {path}; add the file, or leave the cell trace empty")
    table = read_channels(path, COLUMNS) if path.suffix.lower() == ".tdms" else _csv(path)
    first = 0 if path.suffix.lower() == ".tdms" else 2
    for column in COLUMNS:
        _require_finite(path, column, table[column], first)
    _require_order(path, table["t_s"], first)
    values = [to_si(column, 1.0) * table[column] for column in COLUMNS]
    return BenchTrace(path, *values)


def _csv(path: Path) -> dict[str, Series]:
    try:
        table = pd.read_csv(path, dtype=str, keep_default_na=False)
    except (pd.errors.ParserError, pd.errors.EmptyDataError, UnicodeDecodeError, OSError) as error:
        remedy = "save the trace with commas between values and a point in numbers"
        raise DataError(
            f"{path} is not a table of comma separated values: {error}; {remedy}"
        ) from error
    for column in COLUMNS:
        if column not in table.columns:
            hint = did_you_mean(column, [str(c) for c in table.columns])
            raise DataError(
                f"{path}, row 1: the column '{column}' is missing; add it (in the file: {hint})"
            )
    return {column: _numbers(path, column, table[column].tolist()) for column in COLUMNS}


def _numbers(path: Path, column: str, texts: list[str]) -> Series:
    try:
        return np.array(texts, dtype=float)
    except ValueError:
        row, text = next((k, t) for k, t in enumerate(texts, start=2) if not _is_number(t))
        raise DataError(
            f"{path}, row {row}, column {column} is '{text}', but it must be a number; "
            "correct the cell"
        ) from None


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _require_finite(path: Path, column: str, values: Series, first: int) -> None:
    bad = ~np.isfinite(values)
    if bad.any():
        row = int(np.argmax(bad)) + first
        raise DataError(
            f"{path}, row {row}, column {column} is '{values[row - first]}', but it must be a "
            "finite number; correct the cell"
        )


def _require_order(path: Path, time: Series, first: int) -> None:
    if time.size < LEAST:
        raise DataError(
            f"{path} has {time.size} samples, but a trace needs at least {LEAST}; "
            "export the whole shift"
        )
    back = np.diff(time) <= 0.0
    if back.any():
        row = int(np.argmax(back)) + 1
        raise DataError(
            f"{path}, row {row + first}, column t_s is '{time[row]:.6g}' after "
            f"'{time[row - 1]:.6g}', but time must grow from sample to sample; "
            "sort the trace and leave doubled samples out"
        )
