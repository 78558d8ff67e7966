"""Layout of a table that a stand has written: dialect, head, units, rows of shifts, rows left out.

A row of sums or means shows itself by a word where other rows have a number, or by numbers that are
one statistic of those above. Such rows are left out at the foot of a table; elsewhere a word that
is no statistic is a question.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise, takewhile
from pathlib import Path

import numpy as np

from dogshape.diagnosis.bench.foreign_cells import (
    Decimals,
    Unit,
    decimals_of,
    is_number,
    split_head,
    unit_named,
)
from dogshape.diagnosis.terms import Array
from dogshape.sim.errors import DataError
from dogshape.sim.texts import parted, read_lines

Cells = Sequence[str]
Reasons = list[tuple[int, str]]  #: rows of the file that are left out, and why
SAMPLE = 1000  #: rows by which the separator is recognised
FOOT = 100  #: last rows that may be sums without a mark
HEADS = 4  #: rows of names and units above the numbers, at most
_LABVIEW = re.compile(
    r"(?ms)^(?:LabVIEW Measurement|Channels\b).*?^\*\*\*End_of_Header\*\*\*[^\n]*"
)
_DECIMAL = re.compile(r"(?m)^Decimal_Separator\s+([.,])")
_COMMENT = re.compile(r"\s*\"?(?:[#%!]|//)")
#: Columns between blanks: two or more of them, or any but one before a unit in brackets.
_BLANKS = (re.compile(r"\S+(?: \S+)*"), re.compile(r"\S+(?: +[\[(][^\])]*[\])])?"))


@dataclass(frozen=True)
class Column:
    """A column: its place from 1, head, name without unit, unit, and cells.

    ``strange`` stands in the place of a unit and is none that is known.
    """

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
        """Numbers by the decimal sign that the column shows, NaN for other cells, (rows,)."""
        return Decimals(None).values(self.cells)


@dataclass(frozen=True)
class ForeignTable:
    """A table as it stands: columns, the numbers of its rows in the file, and what was left out.

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


@dataclass(frozen=True)
class _Grid:
    """Lines of a file as cells: their numbers, which cells are numbers or filled, comments."""

    rows: Sequence[int]
    cells: Sequence[Cells]
    comments: frozenset[int]

    @cached_property
    def numeric(self) -> Array:
        return np.array([[is_number(cell) for cell in row] for row in self.cells])

    @cached_property
    def filled(self) -> Array:
        return np.array([[bool(cell) for cell in row] for row in self.cells])

    @cached_property
    def data(self) -> Array:
        """Rows of numbers, (rows,)."""
        numbers = self.numeric.sum(axis=1)
        return (numbers >= 2) & (2 * numbers >= self.filled.sum(axis=1))

    def is_head(self, k: int) -> bool:
        """Test that a row has words enough to name the columns of numbers just below it."""
        below = np.flatnonzero(self.data[k + 1 : k + 3])
        if not below.size or self.numeric[k].any() or self.rows[k] in self.comments:
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
        raise DataError(f"there is no {path}; give a CSV that the stand has written") from error
    stated = _DECIMAL.search(text)
    lines = _LABVIEW.sub(lambda found: "\n" * found.group().count("\n"), text).splitlines(True)
    separator, rows = _parted(path, lines)
    width = max((len(row) for _, row in rows), default=0)
    grid = _Grid(
        [n for n, _ in rows], [(*row, *[""] * (width - len(row))) for _, row in rows],
        frozenset(n for n, line in enumerate(lines, start=1) if _COMMENT.match(line)),
    )  # fmt: skip
    head, units, body, left = _divided(path, grid, chosen)
    width, questions = len(head), list[tuple[int, str]]()
    for k in body:
        if grid.filled[k, width:].any():
            raise DataError(
                f"{path}, row {grid.rows[k]} has more cells than the {width} columns of the "
                "head; is a decimal comma among them? save it with semicolons between cells"
            )
        if separator == " " and not grid.filled[k, :width].all():
            raise DataError(
                f"{path}, row {grid.rows[k]} has fewer cells than the {width} columns of the head, "
                "and blanks do not tell which are empty; save it with semicolons between cells"
            )
    if sums and body and not chosen:
        left += _summaries(grid, body, separator, questions)
    gone = {n for n, _ in left}
    kept = [k for k in body if grid.rows[k] not in gone]
    if not kept:
        raise DataError(f"{path} has no row of a shift; name its rows with --rows, such as 2-41")
    columns = [
        Column.of(k + 1, head[k] or f"column {k + 1}", units[k], cells)
        for k, cells in enumerate(list(zip(*(grid.cells[k] for k in kept), strict=True))[:width])
        if head[k] or any(cells)
    ]
    return ForeignTable(
        path, tuple(columns), tuple(grid.rows[k] for k in kept), sorted(left),
        stated[1] if stated else None, separator, questions,
    )  # fmt: skip


def _parted(path: Path, lines: list[str]) -> tuple[str, Sequence[tuple[int, Cells]]]:
    """Part lines into cells by the separator that gives the most rows of numbers."""
    ways: list[tuple[str, Sequence[tuple[int, Cells]]]] = [
        (separator, parted(path, lines, separator)) for separator in ";\t,|"
    ]
    bare = [(n, re.sub(r"^\s*[#%!]+", " ", line.rstrip())) for n, line in enumerate(lines, start=1)]
    ways += [
        (" ", [(n, cells) for n, line in bare if (cells := blanks.findall(line))])
        for blanks in _BLANKS
    ]

    def regular(rows: Sequence[tuple[int, Cells]]) -> int:
        widths = Counter(
            len(row) for _, row in rows[:SAMPLE]
            if (n := sum(map(is_number, row))) >= 2 and 2 * n >= sum(map(bool, row))
        )  # fmt: skip
        return max(widths.values(), default=0)

    return max(ways, key=lambda way: regular(way[1]))


def _divided(
    path: Path, grid: _Grid, chosen: Sequence[range]
) -> tuple[list[str], list[str], list[int], Reasons]:
    """Divide rows into names, units, rows below them, and rows left out with their reasons."""
    if not grid.data.any():
        raise DataError(
            f"{path} has no rows of numbers; save the table as CSV with a name and unit above each "
            "column"
        )
    asked = [any(n in those for those in chosen) for n in grid.rows]
    start = asked.index(True) if any(asked) else len(asked)
    heads = [k for k in range(len(grid.rows)) if grid.is_head(k) and k < start]
    above = heads[-1 if chosen else 0] if heads else -1
    first = above + 1 + int(np.argmax(grid.data[above + 1 :]))
    names, units, used = _head(grid, first)
    repeated = {grid.cells[k] for k in used}
    body: list[int] = []
    left: Reasons = []
    for k, (n, row) in enumerate(zip(grid.rows, grid.cells, strict=True)):
        if chosen:
            body += [k] if asked[k] and k >= first else []
            left += (
                [(n, "not among --rows")] if grid.data[k] and not (asked[k] and k >= first) else []
            )
        elif k < first:
            left += [] if k in used else [(n, "stands above the table")]
        elif row in repeated:
            left.append((n, "repeats the head"))
        elif k in heads:
            blocks = [(grid.data[a:b].sum(), grid.rows[a + 1], grid.rows[b - 1])
                      for a, b in pairwise([*heads, len(grid.rows)])]  # fmt: skip
            _, begin, end = max(blocks)
            raise DataError(
                f"{path}: another table begins in row {n}; save each as a file of its own, or name "
                f"the rows of shifts, such as --rows {begin}-{end}"
            )
        elif not grid.numeric[k].any():
            left.append((n, f"has no number ('{next(filter(None, row))}')"))
        else:
            body.append(k)
    return names, units, body, left


def _head(grid: _Grid, first: int) -> tuple[list[str], list[str], list[int]]:
    """Read names and units above the first row of numbers, with the places of their rows.

    Comments are no names, unless all lines above the numbers are comments. An empty name is that of
    the line above.
    """
    filled = grid.filled
    near = takewhile(
        lambda k: not grid.data[k] and (filled[k].sum() > 1 or grid.rows[k] in grid.comments),
        range(first - 1, -1, -1),
    )
    zone = [k for k in near if filled[k].sum() > 1][:HEADS][::-1]
    zone = [k for k in zone if grid.rows[k] not in grid.comments] or zone
    rows = [[cell.lstrip("#%! ") or cell for cell in grid.cells[k]] for k in zone]
    used, units = zone[-1:], [""] * filled.shape[1]
    if len(rows) > 1 and _are_units(rows[-1], rows[-2]):
        units, used = rows.pop(), zone[-2:]
    names = rows.pop() if rows else [""] * filled.shape[1]
    if rows and not all(names):
        more = [b or a for a, b in zip(rows[-1], names, strict=True)]
        used = [zone[len(rows) - 1], *used] if more != names else used
        names = more
    width = 1 + int(np.flatnonzero(filled[[*used, first]].any(axis=0))[-1])
    return names[:width], units[:width], used


def _are_units(row: Cells, above: Cells) -> bool:
    known = [k for k, cell in enumerate(row) if unit_named(cell.strip("[]() "))]
    others = [c for k, c in enumerate(row) if k not in known and c.strip("[]()-1 ")]
    again = sum(bool(unit_named(cell)) for cell in above)
    return again < len(known) and (len(known) >= 2 or not others)


#: Statistics of the numbers of a column that tables have below it.
STATISTICS: dict[str, Callable[[Array], float]] = {
    "mean": lambda known: float(known.mean()),
    "sum": lambda known: float(known.sum()),
    "standard deviation": lambda known: float(known.std(ddof=1)),
    "standard deviation (n)": lambda known: float(known.std()),
}


def _summaries(grid: _Grid, body: list[int], separator: str, questions: Reasons) -> Reasons:
    """Find rows that summarise those above them, and rows with a word at the ends of the table."""
    rows, cells = [grid.rows[k] for k in body], [grid.cells[k] for k in body]
    columns = {str(k): those for k, those in enumerate(zip(*cells, strict=True))}
    try:
        decimals = decimals_of(columns, rows, None, separator)
    except DataError:
        decimals = Decimals(None)
    values = np.stack([decimals.values(those) for those in columns.values()], axis=1)
    words = _words(cells, np.isfinite(values))
    found: dict[int, str] = {}
    above: list[int] = []
    start = 0  # of the group that the last rows belong to
    for k, row in enumerate(cells):
        follows = k - 1 in found
        if k in words or follows or k >= len(cells) - FOOT:
            for those in (above[start:], above):
                if name := _statistic(values[those], values[k], row, decimals, k in words):
                    found[k] = f"{name} of rows {rows[those[0]]} to {rows[those[-1]]}"
                    break
        if k not in found:
            start = len(above) if follows else start
            above.append(k)
    shifts = [k for k in above if not words.get(k)]
    for k, word in words.items():
        foot = not shifts or k < shifts[0] or k > shifts[-1]
        if k in found or not word or (re.search(r"\d", word) and not (foot and k - 1 in found)):
            continue
        if foot:
            found[k] = "word where other rows have a number"
        else:
            questions.append((
                cells[k].index(word) + 1, f"row {rows[k]} has '{word}' where other rows have a "
                "number, and is no sum or mean of those above; correct it, or name the rows of "
                "shifts with --rows",
            ))  # fmt: skip
    return [(rows[k], why + (f" ('{words[k]}')" if words.get(k) else ""))
            for k, why in found.items()]  # fmt: skip


def _words(rows: Sequence[Cells], numeric: Array) -> dict[int, str]:
    """Find rows whose first cell is a word where most (upper) rows have a number.

    The word is "" for an empty first cell, and for one without a digit among codes such as A1.
    """
    half = slice((len(rows) + 1) // 2)
    usual = (2 * numeric[half].sum(axis=0) > len(rows[half])) | (
        2 * numeric.sum(axis=0) > len(rows)
    )
    coded = 2 * sum(bool(re.search(r"\d", row[0])) for row in rows[half]) > len(rows[half])
    found: dict[int, str] = {}
    for k, row in enumerate(rows):
        place = next((p for p, cell in enumerate(row) if cell), 0)
        if usual[place] and not numeric[k, place] and numeric[k].any():
            found[k] = row[place]
        elif coded and not re.search(r"\d", row[0]):
            found[k] = ""
    return found


def _statistic(above: Array, values: Array, row: Cells, decimals: Decimals, marked: bool) -> str:
    """Name the statistic that a row is of the rows above it, empty where it is of none.

    All columns have to agree, of which two are not constant, or one in a ``marked`` row.
    """
    columns = [(above[np.isfinite(above[:, k]), k], value, row[k])
               for k, value in enumerate(values) if np.isfinite(value)]  # fmt: skip
    columns = [one for one in columns if one[0].size > 1]
    telling = sum(np.ptp(known) > 0.0 for known, _, _ in columns)
    if telling < (1 if marked else 2) or (len(above) < 3 and not marked):
        return ""
    for name, statistic in STATISTICS.items():
        if all(
            abs(statistic(known) - value) <= 0.51 * decimals.step(cell) + 1e-9 * abs(value)
            for known, value, cell in columns
        ):
            return name
    return ""
