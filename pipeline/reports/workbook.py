"""Tables of a page as sheets of a workbook (.xlsx)."""

from __future__ import annotations

import re
from collections.abc import Iterable
from io import BytesIO

import pandas as pd

from dogshape.pipeline.record import MINUS, Table
from dogshape.sim.files import without_formulas

MAX_SHEET_NAME = 31  #: letters that a spreadsheet takes
NOT_IN_A_SHEET_NAME = re.compile(r"[\[\]:*?/\\]")


def workbook_of(tables: Iterable[tuple[str, Table]]) -> bytes:
    """Write tables as a workbook, a sheet each by their titles; numbers are numbers there."""
    buffer = BytesIO()
    with pd.ExcelWriter(buffer) as writer:
        for title, table in tables:
            name = _sheet_name(title, writer.sheets.keys())
            # A group is a row of one cell.
            rows = [
                [*map(_cell, row)] + [None] * (len(table.heads) - len(row)) for row in table.rows
            ]
            frame = pd.DataFrame(rows, columns=list(table.heads))
            without_formulas(frame).to_excel(writer, sheet_name=name, index=False)
    return buffer.getvalue()


def _sheet_name(title: str, taken: Iterable[str]) -> str:
    """Return the name of a table's sheet: its title, numbered if another table has it."""
    base = NOT_IN_A_SHEET_NAME.sub(" ", title).strip() or "Summary"
    names = set(taken)
    name = base[:MAX_SHEET_NAME]
    number = 1
    while name in names:
        number += 1
        name = f"{base[: MAX_SHEET_NAME - 3]} {number}"
    return name


def _cell(text: str) -> str | float:
    """Return a printed number as a number, any other text as it is."""
    try:
        return float(text.replace(MINUS, "-"))
    except ValueError:
        return str(text)
