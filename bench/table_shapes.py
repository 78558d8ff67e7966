"""Shapes of tables that have not one row a shift: transposed, matrix, blocks, tables side by side.

The quantities that columns and heads name tell the shapes apart.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from dogshape.bench.cell_grid import CellGrid, Cells
from dogshape.bench.cell_values import (
    FORCE,
    SPEED,
    Column,
    begins_with_number,
    is_number,
    split_head,
)
from dogshape.bench.quantities import SHIFTS, WORD, is_force_by_area, score
from dogshape.bench.raw_sheet import RawRow, RawSheet
from dogshape.sim.errors import DataError
from dogshape.sim.interface import key_arguments

_TITLE_VALUE = re.compile(r"[^\W\d]\w*\s*[=:]\s*[+-]?\d|\d\s*(?:1/min|rpm|U/min|kN|N|tr/min)\b")


def _needs_of(column: Column) -> set[str]:
    """Name the needed quantities of which a column has a word, or for a force or time the unit."""
    names = {q.name for q in SHIFTS if q.needed and score(q, column) >= WORD}
    if not names and column.unit is not None:
        names = {q.name for q in SHIFTS if q.needed and score(q, column) > 0.0}
    return names | ({"force_N"} if is_force_by_area(column) else set())


def named_needs(names: Cells) -> int:
    """Count the needed quantities that a row of names has."""
    columns = [Column(k, name, *split_head(name)) for k, name in enumerate(names, start=1) if name]
    return len(set().union(*map(_needs_of, columns))) if columns else 0


def is_transposed(grid: CellGrid) -> bool:
    """Test that the first cells of rows name quantities, with two numbers or more behind each."""
    heads = {
        cells[0]
        for cells in grid.cells
        if cells[0]
        and not is_number(cells[0])
        and sum(map(bool, cells)) >= 3
        and sum(map(begins_with_number, cells[1:])) >= 2
    }
    return named_needs(tuple(heads)) >= 2


def transposed(sheet: RawSheet) -> RawSheet:
    """Exchange rows and columns; the numbers of the columns become those of the rows.

    Empty columns are left out. DataError for hidden, merged or marked cells, or notes.
    """
    if any(row.marks for row in sheet.rows) or sheet.hidden_columns or sheet.merged or sheet.notes:
        raise DataError(
            f"{sheet.path} is transposed, a column for each shift, and has hidden, merged or marked"
            " cells; paste it transposed (rows for columns) and save it again"
        )
    columns = [
        RawRow(number, tuple(column))
        for number, column in enumerate(zip(*sheet.cells, strict=True), start=1)
        if any(column)
    ]
    return replace(sheet, rows=tuple(columns))


def require_no_blocks(path: Path, grid: CellGrid, places: Iterable[int]) -> None:
    """Raise DataError for blocks whose titles among these rows hold the operating point.

    A title is such as ``dn = 50 1/min``.
    """
    texts = [(grid.rows[k], grid.text_of(k)) for k in places]
    titles = [(number, text) for number, text in texts if _TITLE_VALUE.search(text)]
    if len(titles) > 1:
        number, text = titles[0]
        raise DataError(
            f"{path} is in blocks with the operating point in titles ({len(titles)}: row {number} "
            f"'{text}' ...); write these values into columns of their own, beside each shift"
        )


def require_rows_of_shifts(path: Path, columns: Sequence[Column], grid: CellGrid) -> None:
    """Raise DataError for a matrix and for blocks with titles."""
    names = set().union(*map(_needs_of, columns))
    if len(names) >= 3:
        return
    has_speed = any(c.unit and c.unit.dimension == SPEED for c in columns)
    if len(names) < 2 and not has_speed:
        require_no_blocks(path, grid, np.flatnonzero(~grid.data).tolist())
    if _is_matrix(columns, grid):
        raise DataError(
            f"{path} is a matrix, with one quantity in its first row and one in its first "
            "column; write a row for each operating point, with mismatch, force, shift time "
            "and number of shifts in columns"
        )


def side_question(columns: Sequence[Column]) -> str:
    """Ask which of several tables side by side has the shifts, empty for a single table."""
    sides = _sides(columns)
    if not sides:
        return ""
    spans = ", ".join(f"{side[0].place} to {side[-1].place}" for side in sides)
    return (
        f"{len(sides)} tables stand side by side (columns {spans}); save each as a file of its "
        f"own, or name the columns of the shifts: {_columns_of(sides[0])}"
    )


def _is_matrix(columns: Sequence[Column], grid: CellGrid) -> bool:
    """Test that numbers stand as names above numbers, or names share a word beside a number."""
    heads = [column.head for column in columns]
    lettered = [re.sub(r"[\d.,\s]+", "#", head) for head in heads[1:] if re.search(r"\d", head)]
    units = [c.unit for c in columns[1:] if c.unit and re.search(r"(^|[=\s])\d", c.name)]
    is_alike = len(lettered) > 1 and len(set(lettered)) == 1 and len(lettered) == len(heads) - 1
    if (
        is_alike
        and len(units) == len(lettered)
        and all(unit.dimension in (SPEED, FORCE) for unit in units)
    ):
        return True
    first = int(np.flatnonzero(grid.data)[0])
    corner, top = grid.cells[first][0], grid.numeric[first][1:]
    lower_rows = np.flatnonzero(grid.data)[1:]
    filled = grid.filled[first][1:]
    square = (
        lower_rows.size
        and grid.numeric[lower_rows, 0].all()
        and top[filled].all()
        and filled.sum() > 1
    )
    return bool(square and not is_number(corner) and not begins_with_number(corner))


def _sides(columns: Sequence[Column]) -> list[list[Column]]:
    """Divide columns into tables that each have two needed quantities, empty for a single table."""
    sides: list[list[Column]] = []
    names_of_side: set[str] = set()
    last_place = 0
    for column in columns:
        names = _needs_of(column)
        heads = {c.head for c in sides[-1]} if sides else set()
        gap = column.place > last_place + 1
        is_repeated = column.head in heads and bool(names & names_of_side)
        if not sides or gap or is_repeated:
            sides.append([])
            names_of_side = set()
        sides[-1].append(column)
        names_of_side |= names
        last_place = column.place
    full = [side for side in sides if len(set().union(*map(_needs_of, side))) >= 2]
    return full if len(full) > 1 else []


def _columns_of(side: Sequence[Column]) -> str:
    """Write the argument ``columns`` that selects one of several tables."""
    columns = {}
    for quantity in SHIFTS:
        best = max(side, key=lambda column: score(quantity, column))
        if quantity.needed and score(quantity, best) > 0.0:
            columns[quantity.name] = f"column {best.place}"
    return key_arguments("columns", columns)
