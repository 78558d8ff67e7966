"""Time series of bench shifts, from CSV, LabVIEW's TDMS or ASAM's MDF.

A trace starts with the force. Time has to grow from sample to sample, and every value has to
be a finite number; other columns or channels than those of ``COLUMNS`` are let be.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from dogshape.diagnosis.bench.mdf4 import SUFFIXES, read_mdf
from dogshape.diagnosis.bench.tdms import read_channels
from dogshape.sim.errors import DataError, number_rule
from dogshape.sim.texts import TextTable, read_table
from dogshape.sim.units import to_si

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
    suffix = path.suffix.lower()
    if suffix == ".tdms" or suffix in SUFFIXES:
        table = (read_channels if suffix == ".tdms" else read_mdf)(path, COLUMNS)
        rows: Sequence[int] = range(next(iter(table.values())).size)
    else:
        text = read_table(path, COLUMNS, COLUMNS)
        text.require(COLUMNS)
        table = {column: _numbers(text, column) for column in COLUMNS}
        rows = [number for number, _ in text.rows]
    for column in COLUMNS:
        _require_finite(path, column, table[column], rows)
    _require_order(path, table["t_s"], rows)
    values = [to_si(column, 1.0) * table[column] for column in COLUMNS]
    return BenchTrace(path, *values)


def _numbers(table: TextTable, column: str) -> Series:
    texts = table.column(column)
    try:
        return np.array(texts, dtype=float)
    except ValueError:
        place, text = next((k, t) for k, t in enumerate(texts) if not _is_number(t))
        raise DataError(
            f"{table.path}, row {table.rows[place][0]}, column {column} is '{text}', but it must "
            f"be {number_rule(text)}; correct the cell"
        ) from None


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _require_finite(path: Path, column: str, values: Series, rows: Sequence[int]) -> None:
    bad = ~np.isfinite(values)
    if bad.any():
        place = int(np.argmax(bad))
        raise DataError(
            f"{path}, row {rows[place]}, column {column} is '{values[place]}', but it must be a "
            "finite number; correct the cell"
        )


def _require_order(path: Path, time: Series, rows: Sequence[int]) -> None:
    if time.size < LEAST:
        raise DataError(
            f"{path} has {time.size} samples, but a trace needs at least {LEAST}; "
            "export the whole shift"
        )
    back = np.diff(time) <= 0.0
    if back.any():
        place = int(np.argmax(back)) + 1
        raise DataError(
            f"{path}, row {rows[place]}, column t_s is '{time[place]:.6g}' after "
            f"'{time[place - 1]:.6g}', but time must grow from sample to sample; "
            "sort the trace and leave doubled samples out"
        )
