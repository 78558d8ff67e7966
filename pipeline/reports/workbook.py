"""Tables of a page as sheets of a workbook (.xlsx)."""

from __future__ import annotations

import re
from collections.abc import Iterable
from io import BytesIO

from dogshape.pipeline.record import MINUS, Table
from dogshape.sim.files import is_formula

MAX_SHEET_NAME = 31  #: letters that a spreadsheet takes
NOT_IN_A_SHEET_NAME = re.compile(r"[\[\]:*?/\\]")


def workbook_of(tables: Iterable[tuple[str, Table]]) -> bytes:
    """Write tables as a workbook, a sheet each by their titles; numbers are numbers there."""
    from openpyxl import Workbook  # noqa: PLC0415  # half a second that other pages do not need

    workbook = Workbook()
    workbook.remove(workbook.worksheets[0])
    for title, table in tables:
        sheet = workbook.create_sheet(_sheet_name(title, workbook.sheetnames))
        for row in (table.heads, *table.rows):
            sheet.append([_cell(text) for text in row])
    buffer = BytesIO()
    workbook.save(buffer)
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
    """Return a printed number as a number, any other text as it is but for formulas."""
    try:
        return float(text.replace(MINUS, "-"))
    except ValueError:
        return f"'{text}" if is_formula(text) else str(text)
