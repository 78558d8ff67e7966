"""Columns of a foreign table that say how times scatter, and in which order they were measured.

They are of use and not needed: what cannot be read of them is left out, which is told.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from dogshape.diagnosis.bench.foreign_columns import Match
from dogshape.diagnosis.bench.foreign_table import NOTHING, ForeignTable, Report, numbers_of
from dogshape.diagnosis.bench.time_stamps import as_iso, is_plain

Row = dict[str, Any]  #: a row of the draft
Values = tuple[list[str | None], str]  #: cells as ``shifts.csv`` has them, and the unit's spelling


def place_in_series(
    table: ForeignTable, by: Mapping[str, Match], rows: list[Row], report: Report
) -> list[Row]:
    """Add spreads, order and time stamps to rows of a table, and return what is told of columns."""
    told = []
    readers: dict[str, Callable[[ForeignTable, Match, Report], Values]] = {
        "shift_time_sd_s": _numbers,
        "order": _numbers,
        "timestamp": _stamps,
    }
    for name, read in readers.items():
        if name not in by:
            continue
        head, own = by[name].column.head, Report()
        values, unit = read(table, by[name], own)
        report.signs.update({k: v for k, v in own.signs.items() if k not in report.signs})
        report.assumed += own.assumed
        fault = own.faults[0] if own.faults else _gap(name, rows, values)
        if fault:
            report.assumed.append(f"{table.path}: the column '{head}' is left out: {fault}")
            continue
        for row, value in zip(rows, values, strict=True):
            row[name] = value
        told.append({"file": str(table.path), "quantity": name, "column": head,
                     "unit": unit or None})  # fmt: skip
        if name == "shift_time_sd_s":
            _only_of_means(table, head, rows, report)
        else:
            report.assumed.append(
                f"{table.path}: the shifts were made in the order of '{head}', so that a diagnosis "
                "looks for a drift"
            )
    return told


def _numbers(table: ForeignTable, match: Match, report: Report) -> Values:
    values, unit = numbers_of(table, match, report, needed=False)
    return [None if v is None else f"{v:.9g}" for v in values], unit.text if unit else ""


def _stamps(table: ForeignTable, match: Match, report: Report) -> Values:
    """Read time stamps: numbers in s, dates and times as ISO 8601."""
    factor = 1.0 if match.unit is None else match.unit.factor
    found: list[str | None] = []
    for row, cell in table.cells(match.column):
        plain = cell.replace(",", ".")
        if cell.lower() in NOTHING:
            found.append(None)
        elif is_plain(plain):
            found.append(f"{factor * float(plain):.12g}")
        else:
            try:
                found.append(as_iso(cell))
            except ValueError:
                report.faults.append(f"row {row} has '{cell}', which is no date and time")
                found.append(None)
    return found, match.unit.text if match.unit else ""


def _gap(name: str, rows: list[Row], values: list[str | None]) -> str:
    """Return why a column does not place all shifts in a series, an empty word where it does."""
    if name == "shift_time_sd_s":
        return ""
    timed = [(r["row"], v) for r, v in zip(rows, values, strict=True) if r["time"] is not None]
    lacking = [row for row, value in timed if value is None]
    if lacking:
        return f"it is empty in row {lacking[0]}, but every shift with a time needs its place"
    kinds = {is_plain(value) for _, value in timed if value is not None}
    return "it has dates and plain numbers" if len(kinds) > 1 else ""


def _only_of_means(table: ForeignTable, head: str, rows: list[Row], report: Report) -> None:
    """Take spreads away where there is no mean of several shifts; that is told."""
    name = "shift_time_sd_s"
    alone = [row for row in rows if row[name] and (row["n"] < 2 or row["time"] is None)]
    for row in alone:
        row[name] = None
    if alone:
        report.assumed.append(
            f"{table.path}: '{head}' is left out in row {alone[0]['row']}"
            f"{' and others' if len(alone) > 1 else ''}, where there is no mean of several shifts"
        )
