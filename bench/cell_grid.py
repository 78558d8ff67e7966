"""Cells of a sheet as a grid, and which of them are numbers."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from dogshape.bench.cell_values import is_number, split_quantity
from dogshape.bench.raw_sheet import RawSheet

Cells = Sequence[str]
MARKS = "#%!"  #: at the beginning of comments


class CellGrid:
    """Rows as cells, equally many in each, and which of them are numbers.

    ``loose`` takes a number with a unit behind it as a number.
    """

    def __init__(self, sheet: RawSheet, *, loose: bool = False) -> None:
        width = sheet.width
        self.raw = sheet.rows
        self.rows = [row.number for row in sheet.rows]
        self.cells = sheet.cells
        test = _is_quantity if loose else is_number
        shape = (len(self.cells), width)
        self.numeric = _table_of([[test(cell) for cell in row] for row in self.cells], shape)
        self.filled = _table_of([[bool(cell) for cell in row] for row in self.cells], shape)
        self.comment = np.array([row[0][:1] in MARKS if row[0] else False for row in self.cells])
        numbers = self.numeric.sum(axis=-1)
        self.data = (numbers >= 2) & (2 * numbers >= self.filled.sum(axis=-1))

    def text_of(self, k: int) -> str:
        """Join the cells of a row that have a text."""
        return ", ".join(filter(None, self.cells[k]))

    def is_head(self, k: int) -> bool:
        """Test that a row has words enough to name the columns of numbers just below it."""
        below = np.flatnonzero(self.data[k + 1 : k + 3])
        if not below.size or self.numeric[k].any() or self.comment[k]:
            return False
        return bool(self.filled[k].sum() >= max(2, 0.6 * self.filled[k + 1 + below[0]].sum()))


def _table_of(rows: Sequence[Sequence[bool]], shape: tuple[int, int]) -> np.ndarray:
    return np.array(rows, dtype=bool).reshape(shape)


def _is_quantity(cell: str) -> bool:
    return is_number(split_quantity(cell)[0])
