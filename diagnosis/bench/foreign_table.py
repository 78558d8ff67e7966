"""Tables of a bench that were made for no reader in particular: head, units, numbers, faults.

Lines before the head are passed over, a row of units below it is read. Numbers may have a decimal
comma. Every fault of a file is kept and told with the others; what is assumed is told too.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from statistics import median

from dogshape.diagnosis.bench.foreign_columns import Column, Match, Quantity, matched
from dogshape.diagnosis.bench.measured_units import FORCE, SPEED, TIME, Unit, unit_named
from dogshape.sim.errors import DataError, number
from dogshape.sim.texts import listed, read_cells

NOTHING = frozenset(("", "-", "--", "n/a", "na", "nan", "#n/a", "none", "null", "k.a.", "#nv"))
YES = frozenset(("true", "yes", "ja", "1", "ok", "i.o.", "io", "wahr", "x", "engaged", "y", "j"))
NO = frozenset(("false", "no", "nein", "0", "nok", "n.i.o.", "nio", "falsch", "failed", "n"))
MOST = 12  #: faults of one kind that are told one by one
_NUMBER = re.compile(r"[+-]?(\d+([.,]\d*)?|[.,]\d+)([eE][+-]?\d+)?")


@dataclass(frozen=True)
class ForeignTable:
    """A table as it stands: its columns, and its rows with their numbers in the file."""

    path: Path
    columns: tuple[Column, ...]
    rows: tuple[tuple[int, tuple[str, ...]], ...]

    def cells(self, column: Column) -> list[tuple[int, str]]:
        """Return the cells of a column with the numbers of their rows."""
        place = self.columns.index(column)
        return [(row, cells[place]) for row, cells in self.rows]


@dataclass
class Report:
    """Collect faults, and sentences on what was assumed."""

    faults: list[str] = field(default_factory=list)
    assumed: list[str] = field(default_factory=list)
    signs: dict[str, str] = field(default_factory=dict)

    def sign(self, cell: str, where: str) -> None:
        """Note the decimal sign of a number."""
        for sign in ",.":
            if sign in cell:
                self.signs.setdefault(sign, f"'{cell}', {where}")

    def require_one_sign(self, path: Path) -> None:
        """Add a fault where numbers of a file have both decimal signs; begin a new file."""
        if len(self.signs) > 1:
            self.faults.append(
                f"{path} has numbers with a comma ({self.signs[',']}) and with a point "
                f"({self.signs['.']}), which can be read in two ways; save it with one"
            )
        self.signs.clear()

    def require(self, where: str) -> None:
        """Raise DataError with all faults, if there are any."""
        if self.faults:
            raise DataError(listed(where, dict.fromkeys(self.faults)))


def read_foreign(path: Path) -> ForeignTable:
    """Read a table whose head stands anywhere above its numbers; raises DataError without one."""
    try:
        _, rows = read_cells(path)
    except FileNotFoundError as error:
        raise DataError(f"there is no {path}; give a CSV that the stand has written") from error
    first = next((k for k, (_, row) in enumerate(rows) if _is_data(row)), None)
    if not first:
        raise DataError(
            f"{path} has no row of names above rows of numbers; save the table as CSV with a name "
            "and unit above each column"
        )
    above = rows[first - 1][1]
    with_units = (
        first > 1 and _is_units(above) and len(_full(rows[first - 2][1])) >= len(_full(above))
    )
    head = rows[first - 2][1] if with_units else above
    below = above if with_units else []
    width = max(place for place, cell in enumerate(head, start=1) if cell)
    names = [cell or f"column {place}" for place, cell in enumerate(head[:width], start=1)]
    columns = [
        Column.of(name, below[place] if place < len(below) else "")
        for place, name in enumerate(names)
    ]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise DataError(f"{path}: the column '{twice[0]}' is there twice; rename one of the two")
    body = [(n, (*row[:width], *[""] * (width - len(row)))) for n, row in rows[first:]]
    long = [n for n, row in rows[first:] if _full(row[width:])]
    if long:
        raise DataError(
            f"{path}, row {long[0]} has more cells than the {width} columns of the head; is a "
            "decimal comma among them? save it with semicolons between cells"
        )
    return ForeignTable(path, tuple(columns), tuple(body))


def _full(row: Sequence[str]) -> list[str]:
    return [cell for cell in row if cell]


def _is_data(row: Sequence[str]) -> bool:
    cells = _full(row)
    numbers = sum(_NUMBER.fullmatch(cell) is not None for cell in cells)
    return numbers >= 2 and 2 * numbers >= len(cells)


def _is_units(row: Sequence[str]) -> bool:
    cells = [cell.strip("[]() ") for cell in _full(row)]
    known = sum(unit_named(cell) is not None for cell in cells)
    return known >= 1 and all(unit_named(c) is not None or c in ("", "-", "1") for c in cells)


def match_columns(
    table: ForeignTable, quantities: Sequence[Quantity], said: Mapping[str, str], report: Report
) -> list[Match]:
    """Match the columns of a table; undecided ones become faults of the report."""
    found, faults = matched(table.columns, quantities, said)
    report.faults += [f"{table.path}: {fault}" for fault in faults]
    done = []
    for match in found:
        strange = match.column.strange
        if strange and not match.given and match.quantity.dimension:
            valid = ", ".join(match.quantity.units)
            report.faults.append(
                f"{table.path}: the unit '{strange}' of '{match.column.head}' is not known; say "
                f"it: --column {match.quantity.name}='{match.column.head}:UNIT' with one of {valid}"
            )
        done.append(match)
    left = [c.head for c in table.columns if c not in [m.column for m in done]]
    if left:
        report.assumed.append(f"columns not used: {', '.join(left)}")
    return done


def numbers_of(
    table: ForeignTable, match: Match, report: Report, *, needed: bool = True
) -> tuple[list[float | None], Unit | None]:
    """Convert a column to the project's unit, None where a cell is empty; and its unit.

    What is no number becomes a fault, empty cells of a ``needed`` column too. Without a unit in the
    head the size of the values decides, which is told as an assumption.
    """
    values: list[float | None] = []
    bad, empty = [], []
    for row, cell in table.cells(match.column):
        plain = (
            cell.replace("\N{MINUS SIGN}", "-").replace(" ", "").replace("\N{NO-BREAK SPACE}", "")
        )
        if plain.lower() in NOTHING:
            values.append(None)
            empty.append(row)
        elif _NUMBER.fullmatch(plain):
            values.append(float(plain.replace(",", ".")))
            report.sign(plain, f"row {row}")
        else:
            values.append(None)
            bad.append(f"row {row}: '{cell}'")
    where = f"{table.path}, column '{match.column.head}' ({match.quantity.name})"
    if bad:
        report.faults.append(
            f"{where} must hold numbers without signs between thousands, but {_some(bad)}; "
            "correct the cells"
        )
    if empty and needed:
        rows = _some([str(row) for row in empty])
        report.faults.append(f"{where} is empty in row {rows}; fill the cells or remove the rows")
    unit = match.unit or _assumed_unit(match, [v for v in values if v is not None])
    if match.unit is None and unit is not None:
        report.assumed.append(
            f"'{match.column.head}' ({match.quantity.name}) gives no unit and is taken as "
            f"{unit.text} by its size; --column {match.quantity.name}='{match.column.head}:UNIT' "
            "says another"
        )
    factor = 1.0 if unit is None else unit.factor
    return [None if v is None else factor * v for v in values], unit


def _some(items: Sequence[str]) -> str:
    more = f" and {len(items) - MOST} more" if len(items) > MOST else ""
    return ", ".join(items[:MOST]) + more


def _assumed_unit(match: Match, values: Sequence[float]) -> Unit | None:
    """Choose a unit by the size of values; shifts take below 5 s and forces above 5 N."""
    if not values or match.quantity.dimension is None:
        return None
    # A recorder's clock may begin anywhere: the length of a trace decides.
    zero = min(values) if match.quantity.name == "t_s" else 0.0
    middle = median(abs(value - zero) for value in values)
    sizes = {
        TIME: "ms" if middle > 5.0 else "s",
        FORCE: "kN" if middle < 5.0 else "N",
        SPEED: "1/min",
    }
    return unit_named(sizes.get(match.quantity.dimension, "mm"))


def answers_of(table: ForeignTable, match: Match, report: Report) -> list[bool | None]:
    """Read a column of yes and no, None where a cell is empty; other words become a fault."""
    values: list[bool | None] = []
    bad = []
    for row, cell in table.cells(match.column):
        word = cell.lower()
        known = word in YES or word in NO or word in NOTHING
        values.append(None if word in NOTHING or not known else word in YES)
        bad += [] if known else [f"row {row}: '{cell}'"]
    if bad:
        report.faults.append(
            f"{table.path}, column '{match.column.head}' (engaged) must be yes, no or empty, but "
            f"{_some(bad)}; write true or false"
        )
    return values


def counts_of(table: ForeignTable, match: Match, report: Report) -> list[int]:
    """Read a column of whole numbers of at least 1; an empty cell counts as 1."""
    values, _ = numbers_of(table, match, report, needed=False)
    rows = [row for row, _ in table.rows]
    bad = [
        f"row {row}: {number(value)}"
        for row, value in zip(rows, values, strict=True)
        if value is not None and (value < 1 or value != math.floor(value))
    ]
    if bad:
        report.faults.append(
            f"{table.path}, column '{match.column.head}' (n_shifts) must be whole numbers of at "
            f"least 1, but {_some(bad)}; correct the cells"
        )
    return [max(1, round(value)) if value is not None else 1 for value in values]
