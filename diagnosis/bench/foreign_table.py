"""Layout of a table that a stand has written: dialect, head, units, rows of shifts, rows left out.

The table is the longest run of numbers below a row of names. Rows of sums and means are recognised
by their structure: a word where other rows have a number, or numbers that are one statistic of
those above.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise, takewhile, zip_longest
from pathlib import Path
from typing import Any

import numpy as np

from dogshape.diagnosis.bench.foreign_cells import (
    Decimals,
    Unit,
    are_numbers,
    decimals_of,
    split_head,
    unit_named,
)
from dogshape.diagnosis.terms import Array
from dogshape.sim.errors import DataError
from dogshape.sim.texts import parted, read_lines

Cells = Sequence[str]
Reasons = list[tuple[int, str]]  #: rows of the file that are left out, and why
SAMPLE = 200  #: lines by which the dialect is recognised
FOOT = 100  #: last rows that may be sums without a mark
HEADS = 4  #: rows of names and units above the numbers, at most
_LABVIEW = re.compile(
    r"(?ms)^(?:LabVIEW Measurement|Channels\b).*?^\*\*\*End_of_Header\*\*\*[^\n]*"
)
_WIDE = re.compile(r"\S+(?: \S+)*")  # words between two blanks or more
_ANY = re.compile(r"\S+")
_NAMED = re.compile(r"\S+(?: +[\[(]\S*)?")  # names with units behind a blank
_DECIMAL = re.compile(r"(?m)^Decimal_Separator\s+([.,])")
_COMMENT = re.compile(r"\s*\"?(?:[#%!]|//)")


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
    numeric: Array
    filled: Array
    comments: frozenset[int]

    @classmethod
    def of(cls, rows: Sequence[tuple[int, Cells]], comments: frozenset[int]) -> _Grid:
        columns = list(zip_longest(*(row for _, row in rows), fillvalue=""))
        filled = np.array([list(map(bool, cells)) for cells in columns]).T
        numeric = np.array([are_numbers(cells) for cells in columns]).T
        cells = list(zip(*columns, strict=True))
        return cls([n for n, _ in rows], cells, numeric, filled, comments)

    @property
    def data(self) -> Array:
        """Rows of numbers, (rows,)."""
        numbers = self.numeric.sum(axis=1)
        return (numbers >= 2) & (2 * numbers >= self.filled.sum(axis=1))

    def is_head(self, k: int, first: int) -> bool:
        """Test that a row has words enough to name the columns of the row ``first``."""
        words = max(2, 0.6 * self.filled[first].sum())
        return bool(self.filled[k].sum() >= words and not self.numeric[k].any())


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
    bare = _LABVIEW.sub(lambda found: "\n" * found.group().count("\n"), text)
    lines = bare.splitlines(keepends=True)
    separator, rows = _parted(path, lines)
    comments = frozenset(n for n, line in enumerate(lines, start=1) if _COMMENT.match(line))
    grid = _Grid.of(rows, comments)
    head, units, body, left = _divided(path, grid, separator, chosen)
    width, questions = len(head), list[tuple[int, str]]()
    if (long := body[grid.filled[body, width:].any(axis=1)]).size:
        raise DataError(
            f"{path}, row {grid.rows[long[0]]} has more cells than the {width} columns of the "
            "head; is a decimal comma among them? save it with semicolons between cells"
        )
    if sums and body.size and not chosen:
        left += _summaries(grid, body, separator, questions)
    gone = {n for n, _ in left}
    kept = [k for k in body.tolist() if grid.rows[k] not in gone]
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
    """Part lines into cells by the dialect that gives the most regular table."""
    import clevercsv  # noqa: PLC0415  # loaded for foreign tables only

    sample = "".join([line for line in lines if line.strip()][:SAMPLE])
    found = clevercsv.Detector().detect(sample, delimiters=list(",;\t| "))
    for separator in (str(found.delimiter or "") if found else "", ";", "\t", ","):
        if separator == " ":
            break
        rows = parted(path, lines, separator) if separator else []
        first = next((k for k, (_, row) in enumerate(rows) if _is_data(row)), -1)
        above = rows[max(0, first - HEADS) : max(0, first)]
        if first == 0 or any(sum(map(bool, row)) > 1 for _, row in above):
            return separator, rows
    texts = [(n, re.sub(r"^[#%!]+", " ", line.rstrip())) for n, line in enumerate(lines, start=1)
             if line.strip("#%! \t\r\n")]  # fmt: skip
    for blanks in (_WIDE, _ANY):
        cells = [blanks.findall(text) for _, text in texts]
        widths = Counter(len(row) for row in cells if _is_data(row)).most_common(1)
        width, often = widths[0] if widths else (0, 0)
        if width >= 3 and 2 * often >= len(cells):
            break
    usual = [[found.span() for found in blanks.finditer(text)]
             for (_, text), row in zip(texts, cells, strict=True)
             if len(row) == width and _is_data(row)]  # fmt: skip
    for k, (_, text) in enumerate(texts):
        if usual and len(cells[k]) != width:
            ways = [way.findall(text) for way in (_WIDE, _NAMED)]
            cells[k] = next((w for w in ways if len(w) == width), _by_place(text, usual))
    return " ", [(n, row) for (n, _), row in zip(texts, cells, strict=True)]


def _is_data(row: Cells) -> bool:
    numbers = sum(are_numbers(row))
    return numbers >= 2 and 2 * numbers >= sum(map(bool, row))


def _by_place(text: str, usual: Sequence[Sequence[tuple[int, int]]]) -> list[str]:
    """Put the words of a line into the columns of other lines by their places."""
    edges = [(spans[..., 0].min(), spans[..., 1].max()) for spans in np.array(usual).swapaxes(0, 1)]
    cells = [""] * len(edges)
    for found in _WIDE.finditer(text):
        a, b = found.span()
        far = [max(low - b, a - high, abs(low + high - a - b) * 1e-3) for low, high in edges]
        at = far.index(min(far))
        cells[at] = f"{cells[at]} {found.group()}".strip()
    return cells


def _divided(
    path: Path, grid: _Grid, separator: str, chosen: Sequence[range]
) -> tuple[list[str], list[str], Array, Reasons]:
    """Divide rows into names, units, rows below them, and rows left out with their reasons."""
    data = grid.data.tolist()
    if not any(data):
        raise DataError(
            f"{path} has no rows of numbers; save the table as CSV with a name and unit above each "
            "column"
        )
    starts = [
        k for k in range(1, len(data)) if data[k] and not data[k - 1]
        and any(grid.is_head(above, k) for above in range(max(0, k - 2), k))
    ] or [data.index(True)]  # fmt: skip
    heads = {k: _head(grid, k, separator) for k in starts}
    size = Counter[str]()
    for a, b in pairwise([*starts, len(data)]):
        size[str(heads[a][:2])] += sum(data[a:b])
    first = max(starts, key=lambda k: size[str(heads[k][:2])])
    names, units, used = heads[first]
    above = set(grid.cells[max(0, first - HEADS) : first])
    numeric = (grid.numeric.sum(axis=1) > 0).tolist()
    body: list[int] = []
    left: Reasons = []
    for k, (n, row) in enumerate(zip(grid.rows, grid.cells, strict=True)):
        if chosen:
            inside = k >= first and any(n in those for those in chosen)
            body += [k] if inside else []
            left += [(n, "not among --rows")] if data[k] and not inside else []
        elif k < first:
            # A blank line parts the head from lines that are not of the table.
            beside = k >= min(used, default=first) or n + first - k == grid.rows[first]
            if data[k] or (beside and k not in used):
                left.append((n, f"stands above the table ('{next(filter(None, row))}')"))
        elif k in heads and heads[k][:2] != (names, units):
            raise DataError(
                f"{path}: another table begins in row {n}; save each as a file of its own, or name "
                f"the rows of shifts, such as --rows {grid.rows[first]}-{n - 1}"
            )
        elif row in above:
            left.append((n, "repeats the head"))
        elif not numeric[k]:
            left.append((n, f"has no number ('{next(filter(None, row))}')"))
        else:
            body.append(k)
    return names, units, np.array(body, dtype=int), left


def _head(grid: _Grid, first: int, separator: str) -> tuple[list[str], list[str], list[int]]:
    """Read names and units above the first row of numbers, with the places of their rows.

    Comments are no names, unless all lines above the numbers are comments.
    """
    data, filled = grid.data, grid.filled
    width = 1 + int(np.flatnonzero(filled[data].any(axis=0))[-1])
    noted = [grid.rows[k] in grid.comments for k in range(first)]

    def known(k: int) -> list[int]:
        return [p for p, cell in enumerate(grid.cells[k]) if unit_named(cell.strip("[]()#! "))]

    near = takewhile(
        lambda k: not data[k] and (filled[k].sum() > 1 or noted[k] or known(k)),
        range(first - 1, -1, -1),
    )
    zone = [k for k in near if filled[k].sum() > 1 or known(k)][::-1]
    if any(not noted[k] and filled[k].sum() > len(known(k)) for k in zone):
        zone = [k for k in zone if not noted[k]]
    zone = zone[-HEADS:]
    if not zone:
        return [""] * width, [""] * width, []
    rows = [list(_unpadded(grid.cells[k])) for k in zone]
    for row in rows:
        row[0] = row[0].lstrip("#%! ") or row[0]
    units: list[str] = []
    for at in range(len(rows) - 1, 0, -1):
        if _is_units(rows[at], ["".join(c) for c in zip_longest(*rows[:at], fillvalue="")]):
            units, rows, zone = rows[at], rows[:at], [*zone[:at], zone[at]]
            break
    lower = rows[-1]
    width = max(len(lower), len(units)) if len(lower) > 1 else width
    lower = lower + [""] * (width - len(lower))
    names = lower
    if len(rows) > 1:
        names = _two_lines(rows[-2] + [""] * (width - len(rows[-2])), lower, separator)
    used = zone[len(rows) - (1 if names is lower else 2) :]
    return names, units + [""] * (width - len(units)), used


def _is_units(row: Cells, above: Cells) -> bool:
    """Test that a row holds units, some cells aside, of the names above it."""
    known = [k for k, cell in enumerate(row) if unit_named(cell.strip("[]() "))]
    others = [c for k, c in enumerate(row) if k not in known and c.strip("[]()-1 ")]
    named = all(k < len(above) and above[k] for k in known)
    again = sum(bool(unit_named(cell)) for cell in above)
    return named and again < len(known) and (len(known) >= 2 or (len(known) == 1 and not others))


def _two_lines(upper: list[str], lower: list[str], separator: str) -> list[str]:
    """Join names that stand in two lines, or below names of groups; else give the lower line."""
    names, above = list(filter(None, lower)), sum(map(bool, upper))
    if len(set(names)) < len(names):
        upper = [next((c for c in upper[k::-1] if c), "") for k in range(len(upper))]
    elif above < 3 or any(are_numbers(upper)):
        return lower
    elif all(lower):
        units = sum(split_head(name)[1] is not None for name in lower)
        if above < len(names) or separator == " " or units > 1:
            return lower  # the upper line is a title
    return [f"{a[:-1]}{b}" if a.endswith("-") else f"{a} {b}".strip()
            for a, b in zip(upper, lower, strict=False)]  # fmt: skip


def _unpadded(row: Cells) -> Cells:
    return row[: max((place for place, cell in enumerate(row, start=1) if cell), default=0)]


def _summaries(grid: _Grid, body: Array, separator: str, questions: Reasons) -> Reasons:
    """Find rows that summarise those above them, and labelled rows at the ends of the table."""
    rows, cells = [grid.rows[k] for k in body], [grid.cells[k] for k in body]
    columns = {str(k): those for k, those in enumerate(zip(*cells, strict=True))}
    try:
        decimals = decimals_of(columns, rows, None, separator)
    except DataError:
        decimals = Decimals(None)
    values = np.stack([decimals.values(those) for those in columns.values()], axis=1)
    labels = _labels(cells, np.isfinite(values), grid.filled[body])
    coded = [bool(re.search(r"\d", row[0])) for row in cells]
    bare = 2 * sum(coded) > len(coded)  # first cells such as A1, among which a word stands out
    found: dict[int, str] = {}
    above: list[int] = []
    start = 0  # of the group that the last rows belong to
    for k, row in enumerate(cells):
        follows = k - 1 in found
        word = bare and row[0] and not coded[k]
        if k in labels or word or follows or k >= len(cells) - FOOT:
            sure = labels.get(k) and not re.search(r"\d", labels[k])
            mark = "word" if sure else "place" if k in labels or word or follows else ""
            for those in (above[start:], above):
                if name := _statistic(values[those], values[k], row, decimals, mark):
                    found[k] = f"{name} of rows {rows[those[0]]} to {rows[those[-1]]}"
                    break
        if k not in found:
            start = len(above) if follows else start
            above.append(k)
    shifts = [k for k in above if not labels.get(k)]
    for k, word in labels.items():
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
    return [(rows[k], why + (f" ('{labels[k]}')" if labels.get(k) else ""))
            for k, why in found.items()]  # fmt: skip


def _labels(rows: Sequence[Cells], numeric: Array, filled: Array) -> dict[int, str]:
    """Find rows whose first cell is a word, or empty, where other rows have a number."""
    both = np.array([numeric, filled], dtype=int)
    below = both.sum(axis=1)[:, None] - both.cumsum(axis=1)
    above, others = np.zeros_like(below[:, 0]), 0
    found: dict[int, str] = {}
    for k, row in enumerate(rows):
        numbers, cells = above if others > 1 else below[:, k]
        usual = 2 * numbers > cells
        place = next((p for p, cell in enumerate(row) if cell), 0)
        word = usual[place] and not numeric[k, place] and numeric[k].any()
        if word or (not row[0] and usual[0]):
            found[k] = row[place] if word else ""
        else:
            others += 1
            above = above + both[:, k]
    return found


#: Statistics of the numbers of a column, and whether tables usually have them.
STATISTICS: dict[str, tuple[Callable[[Array], Any], bool]] = {
    "mean": (np.mean, True),
    "sum": (np.sum, True),
    "standard deviation": (lambda known: known.std(ddof=1), True),
    "standard deviation (n)": (np.std, True),
    "standard error": (lambda known: known.std(ddof=1) / known.size**0.5, False),
    "count": (np.size, True),
    "median": (np.median, False),
    "least value": (np.min, False),
    "largest value": (np.max, False),
    "range": (np.ptp, False),
    "variance": (lambda known: known.var(ddof=1), False),
}


def _statistic(above: Array, values: Array, row: Cells, decimals: Decimals, mark: str) -> str:
    """Name the statistic that a row is of the rows above it, empty where it is of none.

    ``mark`` says by what the row stands out: a ``word``, its ``place``, or nothing. Columns that
    are constant above tell little, and every column has to agree where no word stands.
    """
    columns = [(above[np.isfinite(above[:, k]), k], value, row[k])
               for k, value in enumerate(values) if np.isfinite(value)]  # fmt: skip
    columns = [one for one in columns if one[0].size > 1]
    for name, (statistic, usual) in STATISTICS.items():
        hits = [
            np.ptp(known) > 0.0 for known, value, cell in columns
            if abs(statistic(known) - value) <= 0.51 * decimals.step(cell) + 1e-9 * abs(value)
        ]  # fmt: skip
        least = {"word": 1, "place": 1 if usual else 2}.get(mark, 2 if usual else len(columns) + 1)
        share = 2 / 3 if mark == "word" else 1.0
        if sum(hits) >= least and len(hits) >= share * len(columns) and (mark or len(above) > 2):
            return name
    return ""
