"""Table that a stand has written: its cells, head, units, rows of shifts, and rows left out.

A file has one decimal sign. ``1,200`` is 1200 or 1.2, which other numbers of the file decide, or a
statement of the file or of the user; otherwise it is a question. ``docs/bench.md`` lists the rows
that are left out.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from dogshape.diagnosis.terms import Array
from dogshape.sim.errors import DataError
from dogshape.sim.texts import file_of, parted, read_lines

_SAME = str.maketrans({
    **dict.fromkeys("\N{NO-BREAK SPACE}\N{NARROW NO-BREAK SPACE}\N{THIN SPACE}", " "),
    **dict.fromkeys("\N{RIGHT SINGLE QUOTATION MARK}\N{LEFT SINGLE QUOTATION MARK}\N{PRIME}", "'"),
    **dict.fromkeys("\N{MINUS SIGN}\N{EN DASH}\N{HYPHEN}\N{NON-BREAKING HYPHEN}", "-"),
})  # fmt: skip
_NUMBER = re.compile(
    r"[+-]?(?:(?:\d+(?:[.,]\d*)?|[.,]\d+)(?:[eE][+-]?\d+)?"
    r"|\d{1,3}([ ,.'])\d{3}(?:\1\d{3})*(?:(?!\1)[.,]\d+)?)"
)
_EITHER = re.compile(r"[+-]?[1-9]\d{0,2}[.,]\d{3}")  # thousands or three decimals
NAMES = {".": "point", ",": "comma"}
OTHER = {".": ",", ",": "."}


def plain(cell: str) -> str:
    """Write a cell with ordinary minus sign and blank, the sign beside its digits."""
    text = cell if cell.isascii() else cell.translate(_SAME)
    return text[0] + text[1:].lstrip() if text[:1] in ("+", "-") else text


def is_number(cell: str) -> bool:
    """Test that a cell is a number, whatever its decimal sign."""
    return bool(_NUMBER.fullmatch(plain(cell)))


def numbers_of(cells: Sequence[str], sign: str | None = None) -> Array:
    """Convert cells with a decimal sign, None for any, (cells,); NaN where one is no number."""

    def value(text: str) -> float:
        if not _NUMBER.fullmatch(text):
            return math.nan
        own = sign or ("," if "," in text and "." not in text else ".")
        return float(re.sub(f"[ '{OTHER[own]}]", "", text).replace(own, "."))

    return np.array([value(plain(cell)) for cell in cells], dtype=float)


def decimal_sign(
    columns: Mapping[str, Sequence[str]], rows: Sequence[int], stated: str | None, separator: str
) -> str | None:
    """Decide on the decimal sign of a file, None where no number has one.

    ``stated`` is the sign that the file or the user says. Raises DataError for numbers with both
    signs, and for those that can be read in two ways.
    """
    sure: dict[str, str] = {}
    asked: dict[str, str] = {}
    for head, cells in columns.items():
        for cell, row in zip(map(plain, cells), rows, strict=True):
            if is_number(cell) and (marks := re.findall("[.,]", cell)):
                mark = marks[-1] if marks.count(marks[-1]) == 1 else OTHER[marks[-1]]
                if not _EITHER.fullmatch(cell):
                    sure.setdefault(mark, f"a {NAMES[mark]} ('{cell}', row {row})")
                    continue
                asked.setdefault(
                    mark, f"column '{head}', row {row}: '{cell}' can be read as "
                    f"{cell.replace(mark, '')}, --decimal {OTHER[mark]}, or as "
                    f"{cell.replace(mark, '.')}, --decimal {mark}",
                )  # fmt: skip
    if len(sure) > 1 or (stated and OTHER[stated] in sure):
        both = " and with ".join(sure[mark] for mark in sorted(sure))
        says = f", but {NAMES[stated]} is said to be the decimal sign" if stated else ""
        raise DataError(
            f"numbers with {both}{says}, which can be read in two ways; save it with one sign"
        )
    sign = stated or next(iter(sure), None)
    if sign or not asked:
        return sign
    mixed = [cells for cells in columns.values() if any(map(_EITHER.fullmatch, cells))]
    whole = any(re.fullmatch(r"0*[1-9]\d*", cell) for cells in mixed for cell in cells)
    if separator == "," and set(asked) == {"."} and not whole:
        return "."
    raise DataError("; ".join(asked.values()))


SPEED, FORCE, TIME, LENGTH, MISC = "speed", "force", "time", "length", "other"


@dataclass(frozen=True)
class Unit:
    """A unit: its spelling, what it measures, and the factor to 1/min, N, s or mm."""

    text: str
    dimension: str
    factor: float


#: Spellings without blanks and in lower case but for N; each with the factor to the project's unit.
SPELLINGS: dict[str, dict[str, float]] = {
    SPEED: {
        **dict.fromkeys(("1/min", "rpm", "u/min", "upm", "min-1", "min^-1", "r/min", "rev/min",
                         "/min", "ot/min", "tr/min", "obr/min", "giri/min", "rot/min"), 1.0),
        **dict.fromkeys(("rad/s", "rads-1", "rad*s^-1"), 30.0 / math.pi),
        **dict.fromkeys(("hz", "u/s", "rps", "rev/s", "r/s"), 60.0),
        **dict.fromkeys(("1/s", "s-1", "s^-1", "/s"), math.nan),  # revolutions or radians
        **dict.fromkeys(("deg/s", "grad/s"), 1.0 / 6.0),
    },
    FORCE: {"N": 1.0, "newton": 1.0, "kn": 1e3, "dan": 10.0, "kgf": 9.80665, "kp": 9.80665,
            "lbf": 4.4482216152605},
    TIME: {"s": 1.0, "sec": 1.0, "sek": 1.0, "ms": 1e-3, "msec": 1e-3, "us": 1e-6},
    LENGTH: {"mm": 1.0, "m": 1e3, "cm": 10.0, "um": 1e-3},
    MISC: dict.fromkeys(("nm", "bar", "mbar", "pa", "mpa", "degc", "v", "mv", "a", "%", "kg",
                          "mm/s", "m/s", "j", "deg", "grad"), math.nan),
}  # fmt: skip
UNITS = {
    text: Unit(text, kind, by) for kind, texts in SPELLINGS.items() for text, by in texts.items()
}
_UNIT_SIGNS = str.maketrans({"\N{MICRO SIGN}": "u", "\N{GREEK SMALL LETTER MU}": "u", "°": "deg",
                       "\N{MINUS SIGN}": "-", "⁻": "-", "¹": "1", "·": "*"})  # fmt: skip
_BRACKETS = re.compile(r"^(.*?)\s*[\[({<]\s*([^\])}>]*?)\s*[\])}>]\s*(.*)$")
_LAST = re.compile(r"^(.+?)(?:\s+in\s+|\s*/\s*|[\s_,.]+)([^\s_]+)$")


def unit_named(text: str) -> Unit | None:
    """Find the unit of a spelling, None where it is none that is known."""
    bare = re.sub(r"\s+", "", text).translate(_UNIT_SIGNS)
    found = UNITS.get(bare if bare in ("N", "n") else bare.lower())
    return None if found is None else replace(found, text=text.strip())


def split_head(text: str, below: str = "") -> tuple[str, Unit | None, str | None]:
    """Divide the head of a column into name, unit, and what stands as a unit but is none known.

    A unit stands in brackets at the end (``F [kN]``), after "in" or a stroke (``F/kN``), last
    (``t_shift ms``), or in a cell of its own ``below``.
    """
    name, unit, strange, under = text, None, None, below.strip("[]() ")
    if found := _BRACKETS.match(text):
        name, inside, rest = found.groups()
        unit = unit_named(inside)
        strange = None if unit or "[" not in text or inside in ("", "-", "1") else inside
        name = " ".join(filter(None, (name, "" if unit or strange else inside, rest)))
    elif found := _LAST.match(text):
        bare, last = found.groups()
        if "/" in last and unit_named(last) is None and unit_named(last.split("/", 1)[1]):
            bare, last = f"{bare} {last.split('/', 1)[0]}", last.split("/", 1)[1]
        unit = unit_named(last)
        name = bare if unit else text
    unit = unit or unit_named(under)
    return name, unit, None if unit else strange or (under if re.search(r"\w", under) else None)


#: Dates and clocks that are read without a statement; Python's directives, or pandas' ISO 8601.
FORMS = ("ISO8601", "%d.%m.%Y %H:%M:%S.%f", "%d.%m.%Y %H:%M:%S", "%d.%m.%Y %H:%M", "%d.%m.%Y",
         "%H:%M:%S.%f", "%H:%M:%S", "%H:%M")  # fmt: skip
_DATED = re.compile(r"\d[./-]\d{1,2}[./-]\d|\d-[A-Za-z]{3}-\d|\b\d{1,2}:\d{2}")


def is_dated(cells: Sequence[str]) -> bool:
    """Test that most cells are dates or clocks."""
    known = [cell for cell in cells if cell]
    return 2 * sum(bool(_DATED.search(cell)) for cell in known) > len(known)


def stamps_of(cells: Sequence[str], form: str) -> tuple[list[str], str]:
    """Convert dates to ISO 8601, and clocks without a date to s; also tell the form they have.

    ``form`` has directives such as ``%d/%m/%Y``; empty finds one of ``FORMS``. Raises DataError for
    other cells.
    """
    import pandas as pd  # noqa: PLC0415  # slow to load, and most tables have no dates

    whole = pd.Series(cells, dtype=object).str.replace(r"(?<=:\d\d),(?=\d)", ".", regex=True)
    tried = {way: pd.to_datetime(whole, format=way, errors="coerce", utc=True)
             for way in ((form,) if form else FORMS)}  # fmt: skip
    way, found = min(tried.items(), key=lambda one: one[1].isna().sum())
    if (wrong := found.isna()).any():
        raise DataError(
            f"has '{cells[int(wrong.argmax())]}', which is no date and time as "
            f"{form or '2024-05-31 14:05:09 or 31.05.2024 14:05:09'}; say its form behind the "
            "column: --column timestamp='COLUMN:%d/%m/%Y %H:%M:%S'"
        )
    if way == FORMS[0] or "%d" in way:
        return [one.isoformat() for one in found], f"dates as {way}"
    seconds = (found - found.dt.normalize()).dt.total_seconds()
    seconds += 86_400.0 * (seconds.diff() < -43_200.0).cumsum()  # after midnight
    return [f"{one:.12g}" for one in seconds], "clock without a date"


NOTHING = frozenset(("", "-", "--", "n/a", "na", "nan", "#n/a", "none", "null", "k.a.", "#nv"))
YES = ("true", "yes", "ja", "1", "ok", "i.o.", "io", "i.o", "wahr", "x", "engaged", "y", "j", "oui",
       "si", "sí", "ano", "tak", "pass", "passed", "✓", "✔")  # fmt: skip
NO = ("false", "no", "nein", "0", "nok", "n.i.o.", "nio", "n.i.o", "falsch", "failed", "fail", "n",
      "non", "ne", "nie", "✗", "✘")  # fmt: skip
ANSWERS = {**dict.fromkeys((*NOTHING, "empty", "unknown")), **dict.fromkeys(YES, True),
           **dict.fromkeys(NO, False)}  # fmt: skip

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
        return bool(self.filled[k].sum() >= max(2, 0.6 * self.filled[k + 1 + below[0]].sum()))


def read_foreign(path: Path, chosen: Sequence[range] = (), *, sums: bool = True) -> ForeignTable:
    """Read a table whose head stands anywhere above its numbers; raises DataError without one.

    ``chosen`` are the rows of the file that are shifts, where its structure is not to decide.
    Without ``sums`` no row can be one of those above.
    """
    if not file_of(path).exists():
        raise DataError(f"there is no {path}; give a CSV or .xlsx that the stand has written")
    text = "".join(read_lines(path))
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
    columns = []
    for k, cells in enumerate(list(zip(*(grid.cells[k] for k in kept), strict=True))[:width]):
        if head[k] or any(cells):
            name = head[k] or f"column {k + 1}"
            columns.append(Column(k + 1, name, *split_head(name, units[k]), cells))
    return ForeignTable(
        path, tuple(columns), tuple(grid.rows[k] for k in kept), sorted(left),
        stated[1] if stated else None, separator, questions,
    )  # fmt: skip


def _divided(
    path: Path, grid: _Grid, chosen: Sequence[range]
) -> tuple[list[str], list[str], list[int], Reasons]:
    """Divide rows into names, units, rows below them, and rows left out with their reasons."""
    asked = [any(n in those for those in chosen) for n in grid.rows]
    heads = [k for k in range([*asked, True].index(True)) if grid.is_head(k)]
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
    return sum(map(bool, map(unit_named, above))) < sum(known) and (sum(known) >= 2 or not words)


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
