"""Layout of a table that a stand has written: dialect, head, units, rows of shifts, rows left out.

Rows that begin with the name of a statistic are left out, at the foot also rows with another word
in place of a number, and sums or means of all rows above without a word. Elsewhere a word or
nothing in place of a number is a question.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from dogshape.diagnosis.bench.foreign_cells import (
    Unit,
    is_number,
    numbers_of,
    split_head,
    unit_named,
)
from dogshape.diagnosis.terms import Array
from dogshape.sim.errors import DataError
from dogshape.sim.texts import parted, read_lines

Cells = Sequence[str]
Reasons = list[tuple[int, str]]  #: rows of the file that are left out, and why
ROUNDED = 2e-3  #: share by which a rounded sum or mean is off
HEADS = 4  #: rows of names and units above the numbers, at most
MARKS = "#%!"  #: at the beginning of comments
_LABVIEW = re.compile(
    r"(?ms)^(?:LabVIEW Measurement|Channels\b).*?^\*\*\*End_of_Header\*\*\*[^\n]*"
)
_DECIMAL = re.compile(r"(?m)^Decimal_Separator\s+([.,])")
_STATISTIC = re.compile(
    r"(?i)(Ø|n|count|anzahl|mean|average|avg|mittel\w*|durchschnitt|median|sum|summe|total|gesamt"
    r"|std\w*|sd|stabw|standardabweichung|var|varianz|min|max|minimum|maximum|\d+ ?%)"
    r"(\W*|\W+\w{0,2}\W*)"
)


@dataclass(frozen=True)
class Column:
    """A column: its place from 1, head, name without unit, unit, an unknown unit, and cells."""

    place: int
    head: str
    name: str
    unit: Unit | None
    strange: str | None = None
    cells: tuple[str, ...] = ()

    @classmethod
    def of(cls, place: int, head: str, below: str = "", cells: Cells = ()) -> Column:
        """Read a head, with the unit that stands in a row of its own below it, if there is one."""
        name, unit, strange = split_head(head)
        under = below.strip("[]() ")
        unit = unit or unit_named(under)
        strange = None if unit else strange or (under if re.search(r"\w", under) else None)
        return cls(place, head, name, unit, strange, tuple(cells))

    @cached_property
    def values(self) -> Array:
        """Numbers by the decimal sign that each cell shows, NaN for other cells, (rows,)."""
        return numbers_of(self.cells)


@dataclass(frozen=True)
class ForeignTable:
    """A table as it stands: columns, numbers of its rows, and rows left out with their reasons.

    ``questions`` are pairs of a column's place and a question on one of its words. ``stated`` is
    the decimal sign that the file says.
    """

    path: Path
    columns: tuple[Column, ...]
    rows: tuple[int, ...]
    left_out: Reasons
    stated: str | None
    separator: str
    questions: Reasons


class _Grid:
    """Lines of a file as cells, equally many in each row, and which of them are numbers."""

    def __init__(self, rows: Sequence[tuple[int, Cells]]) -> None:
        width = max((len(cells) for _, cells in rows), default=0)
        self.rows = [n for n, _ in rows]
        self.cells = [(*cells, *[""] * (width - len(cells))) for _, cells in rows]
        self.numeric = np.array([[is_number(cell) for cell in row] for row in self.cells])
        self.filled = np.array([[bool(cell) for cell in row] for row in self.cells])
        self.comment = np.array([row[0][:1] in MARKS if row[0] else False for row in self.cells])
        numbers = self.numeric.sum(axis=-1)
        self.data = (numbers >= 2) & (2 * numbers >= self.filled.sum(axis=-1))

    def is_head(self, k: int) -> bool:
        """Test that a row has words enough to name the columns of numbers just below it."""
        below = np.flatnonzero(self.data[k + 1 : k + 3])
        if not below.size or self.numeric[k].any() or self.comment[k]:
            return False
        count = self.filled[k].sum()
        return bool(count >= max(2, 0.6 * self.filled[k + 1 + below[0]].sum()))


def read_foreign(path: Path, chosen: Sequence[range] = (), *, sums: bool = True) -> ForeignTable:
    """Read a table whose head stands anywhere above its numbers; raises DataError without one.

    ``chosen`` are the rows of the file that are shifts, where its structure is not to decide.
    Without ``sums`` no row can be one of those above.
    """
    try:
        text = "".join(read_lines(path))
    except FileNotFoundError as error:
        raise DataError(
            f"there is no {path}; give a CSV or .xlsx that the stand has written"
        ) from error
    stated = _DECIMAL.search(text)
    lines = _LABVIEW.sub(lambda found: "\n" * found.group().count("\n"), text).splitlines(True)
    ways = {separator: _Grid(parted(path, lines, separator)) for separator in ";\t,|"}
    separator = max(ways, key=lambda one: ways[one].data.sum())
    grid = ways[separator]
    if not grid.data.any():
        raise DataError(
            f"{path} has no rows of numbers; save the table as CSV with semicolons, tabs or commas "
            "between cells, and a name and unit above each column"
        )
    head, units, body, left = _divided(path, grid, chosen)
    width, questions = len(head), list[tuple[int, str]]()
    if sums and not chosen:
        left += _summaries(grid, body, questions)
    gone = {n for n, _ in left}
    kept = [k for k in body if grid.rows[k] not in gone]
    if not kept:
        raise DataError(f"{path} has no row of a shift; name its rows with --rows, such as 2-41")
    if (wide := grid.filled[kept, width:].any(axis=1)).any():
        raise DataError(
            f"{path}, row {grid.rows[kept[int(wide.argmax())]]} has more cells than the {width} "
            "columns of the head; is a decimal comma among them? save it with semicolons between "
            "cells"
        )
    columns = [
        Column.of(k + 1, head[k] or f"column {k + 1}", units[k], cells)
        for k, cells in enumerate(list(zip(*(grid.cells[k] for k in kept), strict=True))[:width])
        if head[k] or any(cells)
    ]
    return ForeignTable(
        path, tuple(columns), tuple(grid.rows[k] for k in kept), sorted(left),
        stated[1] if stated else None, separator, questions,
    )  # fmt: skip


def _divided(
    path: Path, grid: _Grid, chosen: Sequence[range]
) -> tuple[list[str], list[str], list[int], Reasons]:
    """Divide rows into names, units, rows below them, and rows left out with their reasons."""
    asked = [any(n in those for those in chosen) for n in grid.rows]
    start = asked.index(True) if any(asked) else len(asked)
    heads = [k for k in range(start) if grid.is_head(k)]
    above = heads[-1 if chosen else 0] if heads else -1
    first = above + 1 + int(np.argmax(grid.data[above + 1 :]))
    names, units, used = _head(grid, first)
    if chosen:
        body = [k for k in range(first, len(asked)) if asked[k]]
        others = np.setdiff1d(np.flatnonzero(grid.data), body)
        return names, units, body, [(grid.rows[k], "not among --rows") for k in others]
    left = [(grid.rows[k], "stands above the table") for k in range(first) if k not in used]
    body, repeated = [], {grid.cells[k] for k in used}
    for k in range(first, len(grid.rows)):
        if grid.cells[k] in repeated:
            left.append((grid.rows[k], "repeats the head"))
        elif k in heads:
            raise DataError(
                f"{path}: another table begins in row {grid.rows[k]}; save each as a file of its "
                "own, or name the rows of shifts, such as --rows "
                f"{grid.rows[first]}-{grid.rows[k - 1]}"
            )
        elif not grid.numeric[k].any():
            left.append((grid.rows[k], f"has no number ('{next(filter(None, grid.cells[k]))}')"))
        else:
            body.append(k)
    return names, units, body, left


def _head(grid: _Grid, first: int) -> tuple[list[str], list[str], list[int]]:
    """Read names and units above the first row of numbers, with the places of their rows.

    Comments are names where nothing else is.
    """
    near = [k for k in range(max(0, first - HEADS), first) if grid.filled[k].sum() > 1]
    zone = [k for k in near if not grid.data[k] and not grid.comment[k]] or near
    rows = [[cell.lstrip(MARKS + " ") or cell for cell in grid.cells[k]] for k in zone]
    blank = [""] * grid.filled.shape[1]
    below = len(rows) > 1 and _are_units(rows[-1], rows[-2])
    units, used = (rows.pop(), zone[-2:]) if below else (blank, zone[-1:])
    names = rows[-1] if rows else blank
    width = 1 + int(np.flatnonzero(grid.filled[[*used, first]].any(axis=0))[-1])
    return names[:width], units[:width], used


def _are_units(row: Cells, above: Cells) -> bool:
    known = [bool(unit_named(cell.strip("[]() "))) for cell in row]
    words = any(c.strip("[]()-1 ") and not unit for c, unit in zip(row, known, strict=True))
    again = sum(bool(unit_named(cell)) for cell in above)
    return again < sum(known) and (sum(known) >= 2 or not words)


def _summaries(grid: _Grid, body: list[int], questions: Reasons) -> Reasons:
    """Find rows that summarise those above them, and ask about words in place of numbers."""
    firsts = {k: next(filter(None, grid.cells[k])) for k in body}
    named = [k for k, word in firsts.items() if _STATISTIC.fullmatch(word)]
    found = [(grid.rows[k], f"statistic of the rows above ('{firsts[k]}')") for k in named]
    body = [k for k in body if k not in named]
    values = np.ma.masked_invalid([numbers_of(grid.cells[k]) for k in body])
    for size in (2, 1):  # a sum and a mean, or one of them
        if len(body) > size + 2 and all(_is_statistic(values[:-size], v) for v in values[-size:]):
            found += [(grid.rows[k], "sum or mean of the rows above") for k in body[-size:]]
            body = body[:-size]
            break
    place = int(grid.filled[body].any(axis=0).argmax()) if body else 0
    number = grid.numeric[body][:, place] if body else np.zeros(0)
    if all(2 * part.sum() <= len(part) for part in (number, number[: len(body) // 2 + 1])):
        return found  # words or codes name the rows
    for k in body:
        word = grid.cells[k][place]
        if grid.numeric[k, place]:
            continue
        if word and k > body[int(np.flatnonzero(number)[-1])]:
            found.append((grid.rows[k], f"word where other rows have a number ('{word}')"))
        elif not re.search(r"\d", word):  # a code such as 2b
            questions.append((
                place + 1, f"row {grid.rows[k]} has '{word}' where other rows have a number; "
                "correct it, or name the rows of shifts with --rows, such as 2-41",
            ))  # fmt: skip
    return found


def _is_statistic(above: np.ma.MaskedArray, row: np.ma.MaskedArray) -> bool:
    """Test that a row is sum or mean of those above it, in two columns that are not constant."""
    known = ~np.ma.getmaskarray(row)
    means = above[:, known].mean(axis=0), above[:, known].sum(axis=0)
    same = any(np.ma.allclose(own, row[known], rtol=ROUNDED, atol=0.0) for own in means)
    return bool(same and (np.ma.ptp(above[:, known], axis=0) > 0.0).sum() > 1)
