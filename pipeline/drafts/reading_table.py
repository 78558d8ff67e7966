"""Reading of a foreign table as a table and lines for people."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from dogshape.pipeline.record import Table
from dogshape.sim.units import unit_of

HEADS = "quantity", "column", "unit in file", "decimals", "first", "least", "largest", "why"
TEXT_COLUMNS = (1, 7)  #: places of column and reason in ``HEADS``


def reading_parts(record: Mapping[str, Any]) -> list[str | Table]:
    """Tabulate columns with unit, decimals and values, then list excluded rows and columns.

    ``record`` has the keys ``columns`` and ``left_out`` of ``write_bench``.
    """
    parts: list[str | Table] = []
    if record["columns"]:
        rows = [_column_cells(column) for column in record["columns"]]
        parts += [Table(HEADS, rows, {}, TEXT_COLUMNS), ""]
    return [*parts, *left_out_lines(record)]


def left_out_lines(record: Mapping[str, Any]) -> list[str]:
    """List excluded rows and columns, a line for each reason."""
    places_by_reason: dict[str, list[str]] = {}
    for item in record["left_out"]:
        place = f"row {item['row']}" if "row" in item else f"column '{item['column']}'"
        places_by_reason.setdefault(item["reason"], []).append(place)
    return [
        f"left out: {', '.join(places)}: {reason}" for reason, places in places_by_reason.items()
    ]


def assumption_lines(record: Mapping[str, Any]) -> list[str]:
    """List the assumptions on a table and its stand, a line each."""
    return [f"assumed: {assumption}" for assumption in record["assumed"]]


def count_text(record: Mapping[str, Any]) -> str:
    """Count rows, shifts, and shifts with a time."""
    timed = f"{record['with_time']} of them with a time"
    return f"{record['rows']} rows, {record['shifts']} shifts, {timed}"


def _column_cells(column: Mapping[str, Any]) -> tuple[str, ...]:
    """Format the reading of a column, a cell for each head."""
    unit = unit_of(column["quantity"])  # of the values, whatever that of the file
    values = [_value_text(column[key], unit) for key in ("first", "least", "largest")]
    return (
        column["quantity"],
        column["column"],
        column["unit"] or "-",
        column["decimals"] or "-",
        *values,
        column["why"],
    )


def _value_text(value: Any, unit: str) -> str:
    if value is None:
        return "-"
    if isinstance(value, float):
        return f"{value:.6g} {unit}".rstrip()
    return str(value)
