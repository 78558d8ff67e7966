"""Time series of bench shifts, from CSV, LabVIEW's TDMS or ASAM's MDF.

Time zero is the start of the force. Time has to grow from sample to sample, and every value has to
be a finite number. Other columns or channels than those of ``COLUMNS`` are not read.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from dogshape.diagnosis.bench.mdf4 import SUFFIXES, read_mdf
from dogshape.diagnosis.bench.tdms import read_tdms
from dogshape.diagnosis.bench.time_axis import TIME, Channel, join_channels
from dogshape.sim.errors import DataError, number_rule
from dogshape.sim.texts import TextTable, read_table
from dogshape.sim.units import to_si

Series = NDArray[np.float64]

COLUMNS = (TIME, "displacement_mm", "force_N", "sliding_speed_rpm", "output_speed_rpm")


@dataclass(frozen=True, eq=False)
class BenchTrace:
    """Time series of one bench shift, each (n,), SI units.

    ``displacement`` and ``force`` are referred to the sleeve, wherever they are measured. ``notes``
    say what was interpolated, cut or lost; ``start_error`` is the standard error of time zero where
    it was found from the force, s.
    """

    path: Path
    time: Series
    displacement: Series
    force: Series
    sliding_speed: Series
    output_speed: Series
    notes: tuple[str, ...] = field(default=(), kw_only=True)
    start_error: float = field(default=0.0, kw_only=True)

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
    read = read_tdms if suffix == ".tdms" else read_mdf if suffix in SUFFIXES else _read_csv
    table, notes = join_channels(path, read(path, COLUMNS[1:]))
    return BenchTrace(path, *(to_si(name, 1.0) * table[name] for name in COLUMNS), notes=notes)


def _read_csv(path: Path, names: Sequence[str]) -> dict[str, Channel]:
    """Read the columns of a CSV trace; a row without a value is no sample of that channel."""
    text = read_table(path, COLUMNS, COLUMNS)
    text.require(COLUMNS)
    time, lines = _numbers(text, TIME, range(len(text.rows))), [row for row, _ in text.rows]
    found = {}
    for name in names:
        places = [place for place, cell in enumerate(text.column(name)) if cell]
        found[name] = Channel(
            time[places], _numbers(text, name, places), [lines[place] for place in places]
        )
    return found


def _numbers(table: TextTable, column: str, places: Sequence[int]) -> Series:
    cells = table.column(column)
    try:
        return np.array([cells[place] for place in places], dtype=float)
    except ValueError:
        place = next(place for place in places if not _is_number(cells[place]))
        raise DataError(
            f"{table.path}, row {table.rows[place][0]}, column {column} is '{cells[place]}', but "
            f"it must be {number_rule(cells[place])}; correct the cell"
        ) from None


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
