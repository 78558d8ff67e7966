"""Sheets of workbooks: texts of their cells, and the marks that a spreadsheet shows beside them.

Marks are hidden, filtered and grouped rows, cells that are struck out, coloured, merged or
annotated, rules of conditional formatting, and numbers that their format shows as others. Formulas
without a stored value are refused.
"""

from __future__ import annotations

import operator
import re
from collections import Counter
from collections.abc import Callable, Collection, Sequence
from dataclasses import replace
from datetime import date, datetime, time, timedelta
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TypeGuard
from zipfile import BadZipFile, ZipFile

from dogshape.bench.decoding import TableLimits
from dogshape.bench.raw_sheet import CellNote, RawRow, RawSheet, clean_text, file_of
from dogshape.sim.errors import DataError

if TYPE_CHECKING:
    from openpyxl.cell.cell import Cell
    from openpyxl.worksheet.worksheet import Worksheet

HIDDEN = "hidden"
FILTERED = "hidden by a filter"
GROUPED = "grouped"
STRUCK = "struck out"
COLOURED = "coloured"
MASKED = "hidden by a number format"
#: Comparisons of conditional formatting by the operator of the workbook, with their words.
COMPARISONS: dict[str, tuple[str, Callable[..., bool]]] = {
    "greaterThan": ("above", operator.gt),
    "greaterThanOrEqual": ("at least", operator.ge),
    "lessThan": ("below", operator.lt),
    "lessThanOrEqual": ("at most", operator.le),
    "equal": ("equal to", operator.eq),
    "notEqual": ("other than", operator.ne),
    "between": ("between", lambda value, *ends: min(ends) <= value <= max(ends)),
    "notBetween": ("not between", lambda value, *ends: not min(ends) <= value <= max(ends)),
}
_RULE_NUMBER = re.compile(r"[+-]?\d+(\.\d*)?([eE][+-]?\d+)?")
_ABSOLUTE_CELL = re.compile(r"\$[A-Z]{1,3}\$\d+")
_TEXT_NUMBER = re.compile(r"[+-]?\d[\d.,' ]*[.,]\d+")
_THOUSANDS = re.compile(r"[0#?.],+(?![0#?.])")
_LITERAL = re.compile(r'"([^"]*)"|\\(.)')
#: Sections of a number format: positive, negative, zero, text; these show nothing.
_EMPTY_SECTION = re.compile(r"(\[[^\]]*\]|[_*].|\s)*")


def read_workbook(path: Path, limits: TableLimits) -> RawSheet:
    """Read a sheet; raises DataError for a file that is no workbook or an ambiguous sheet."""
    file = file_of(path)
    opened = _open_sheet(path, file, limits)
    if opened is None:
        return RawSheet(path, "\t", ())
    sheet, content = opened
    cells = [list(row) for row in sheet.iter_rows(max_row=content.last_row, max_col=content.width)]
    _require_values(file, content.formulas, sheet)
    texts = [[_cell_text(cell) for cell in row] for row in cells]
    for number, row in enumerate(texts, start=1):
        longest = max(map(len, row), default=0)
        limits.require("cell_characters", longest, f"{file}, row {number}", "shorten the cell")
    merged = _fill_merged(sheet, texts)
    ruled, unjudged = _rule_marks(sheet, content.last_row, content.width)
    rows = []
    for number, (row, row_cells) in enumerate(zip(texts, cells, strict=True), start=1):
        if any(row):
            marks = (*_row_marks(sheet, number, row_cells), *ruled.get(number, ()))
            rows.append(RawRow(number, tuple(row), marks, tuple(map(_colour, row_cells))))
    raw_sheet = RawSheet(
        path,
        "\t",
        tuple(rows),
        merged=merged,
        hidden_columns=_hidden_columns(sheet, content.width),
        remarks=unjudged,
    )
    return _with_number_notes(raw_sheet, cells)


class _SheetContent(NamedTuple):
    """Last row and column with a value, and coordinates of the formulas."""

    last_row: int
    width: int
    formulas: list[str]


def _open_sheet(
    path: Path, file: Path, limits: TableLimits
) -> tuple[Worksheet, _SheetContent] | None:
    """Open the sheet that ``path`` names, with its content; None for a workbook without values."""
    from openpyxl import load_workbook  # noqa: PLC0415  # half a second that texts do not need

    title = str(path)[len(str(file)) + 1 :]
    try:
        _require_packed(file, limits)
        contents = _filled_sheets(file, limits, title)
        name = _named_sheet(file, contents, title)
        if not name:
            return None
        return load_workbook(file, data_only=True)[name], contents[name]
    except FileNotFoundError:
        raise
    except OSError as error:
        raise DataError(f"{file} cannot be read: {error.strerror}; check path and rights") from None
    except BadZipFile as error:
        raise DataError(f"{file} is no workbook; save it as .xlsx or as CSV") from error
    except (ValueError, KeyError, TypeError, AttributeError, SyntaxError) as error:
        raise DataError(
            f"{file} is no workbook that can be read; save its sheet alone as .xlsx, or as CSV"
        ) from error


def _require_packed(file: Path, limits: TableLimits) -> None:
    """Raise DataError for a workbook that exceeds a limit, packed or unpacked."""
    limits.require("file_bytes", file.stat().st_size, str(file), "divide the workbook")
    with ZipFile(file) as archive:
        unpacked = sum(part.file_size for part in archive.infolist())
    limits.require("unpacked_bytes", unpacked, str(file), "save the sheet alone")


def _filled_sheets(file: Path, limits: TableLimits, title: str) -> dict[str, _SheetContent]:
    """Scan the sheets that have values, visible ones first, by their titles.

    With a ``title``, other sheets are scanned up to their first value.
    """
    from openpyxl import load_workbook  # noqa: PLC0415

    book = load_workbook(file, read_only=True)
    contents = {}
    for sheet in book.worksheets:
        sheet.reset_dimensions()  # the size that the file states may be wrong
        complete = title in ("", sheet.title)
        content = _scan_sheet(sheet, f"{file}, sheet {sheet.title}", limits, complete=complete)
        if content.last_row:
            contents[sheet.title] = content
    states = {sheet.title: sheet.sheet_state for sheet in book.worksheets}
    book.close()
    titles = sorted(contents, key=lambda name: states[name] != "visible")
    return {name: contents[name] for name in titles}


def _scan_sheet(sheet: Any, place: str, limits: TableLimits, *, complete: bool) -> _SheetContent:
    """Find last row, width and formulas of a sheet; up to the first value if not ``complete``."""
    last_row = 0
    width = 0
    formulas: list[str] = []
    for number, cells in enumerate(sheet.iter_rows(), start=1):
        filled = [column for column, cell in enumerate(cells, start=1) if cell.value is not None]
        formulas += [cell.coordinate for cell in cells if cell.data_type == "f"]
        if filled:
            last_row = number
            width = max(width, filled[-1])
            limits.require("columns", width, place, "divide the table")
            limits.require("rows", last_row, place, "divide the table")
            limits.require("workbook_cells", last_row * width, place, "divide the table")
        if last_row and not complete:
            break
    return _SheetContent(last_row, width, formulas)


def _named_sheet(file: Path, names: Collection[str], title: str) -> str:
    """Return the title of the sheet to read, empty if no sheet has values."""
    if title in names or (not title and len(names) < 2):
        return title or next(iter(names), "")
    fault = f"there is no sheet '{title}' with cells" if title else "several sheets have cells"
    example = next(iter(names), "SHEET")
    rule = f"name one of {', '.join(names)}, as {file}#{example}"
    raise DataError(f"{file}: {fault}; {rule}")


def _require_values(file: Path, formulas: Sequence[str], values: Worksheet) -> None:
    """Raise DataError for cells of formulas whose value was never stored."""
    from openpyxl.cell.cell import MergedCell  # noqa: PLC0415

    empty = [
        coordinate
        for coordinate in formulas
        if values[coordinate].value is None and not isinstance(values[coordinate], MergedCell)
    ]
    if not empty:
        return
    cells = ", ".join(empty[:3])
    if len(empty) > 3:
        cells += f" and {len(empty) - 3} more"
    verb = "holds a formula whose value was"
    if len(empty) > 1:
        verb = "hold formulas whose values were"
    raise DataError(
        f"{file}: {cells} {verb} never stored; "
        "open the workbook in a spreadsheet, save it, and try again"
    )


def _cell_text(cell: Cell) -> str:
    """Format the value of a cell: a duration in s, a number with the word of its number format."""
    value = cell.value
    number_format = str(cell.number_format)
    if value is None:
        return ""
    if isinstance(value, timedelta | time):
        return _clock_text(value, number_format)
    if isinstance(value, datetime | date):
        return str(value)
    if not _is_numeric(value):
        return clean_text(str(value))
    positive_format = number_format.split(";", maxsplit=1)[0]
    if "%" in _LITERAL.sub("", positive_format):
        return f"{100.0 * value:.12g} %"
    words = "".join(quoted or sign for quoted, sign in _LITERAL.findall(positive_format)).strip()
    return f"{value} {words}".strip()


def _clock_text(value: timedelta | time, number_format: str) -> str:
    """Format a duration in s, and a time of day as a clock."""
    if isinstance(value, time):
        if "h" in number_format.lower() and "[" not in number_format:
            clock = value.strftime("%H:%M:%S")
            return f"{clock}.{value.microsecond:06d}" if value.microsecond else clock
        value = timedelta(
            hours=value.hour,
            minutes=value.minute,
            seconds=value.second,
            microseconds=value.microsecond,
        )
    return f"{value.total_seconds():.12g} s"


def _fill_merged(sheet: Worksheet, texts: list[list[str]]) -> tuple[CellNote, ...]:
    """Fill merged cells with the value of their topmost cell; list the filled cells."""
    notes = []
    for area in sheet.merged_cells.ranges:
        if area.max_row == area.min_row or area.min_row > len(texts):
            continue
        value = texts[area.min_row - 1][area.min_col - 1]
        for number in range(area.min_row + 1, min(area.max_row, len(texts)) + 1):
            texts[number - 1][area.min_col - 1] = value
            notes.append(CellNote(number, area.min_col, f"merged with row {area.min_row}"))
    return tuple(notes)


def _row_marks(sheet: Worksheet, number: int, cells: Sequence[Cell]) -> tuple[str, ...]:
    """List the marks of a row: hidden, filtered, grouped, struck out, masked, comments."""
    line = sheet.row_dimensions[number]
    filled = [cell for cell in cells if cell.value is not None]
    marks = []
    if line.hidden or line.height == 0:
        filtered = sheet.auto_filter is not None and bool(sheet.auto_filter.filterColumn)
        marks.append(FILTERED if filtered else HIDDEN)
    elif line.outlineLevel:
        marks.append(GROUPED)
    if any(cell.font is not None and cell.font.strike for cell in filled):
        marks.append(STRUCK)
    if any(map(_is_masked, filled)):
        marks.append(MASKED)
    marks += [
        f"comment '{clean_text(cell.comment.text)}'"
        for cell in cells
        if getattr(cell, "comment", None) is not None
    ]
    return tuple(marks)


def _rule_marks(
    sheet: Worksheet, last_row: int, width: int
) -> tuple[dict[int, list[str]], tuple[str, ...]]:
    """Find the rows whose cells fall under a rule of conditional formatting.

    Returns marks by row number, and a sentence on each rule that is no comparison with a value.
    """
    marks: dict[int, list[str]] = {}
    unjudged: list[str] = []
    for area in sheet.conditional_formatting:
        cells: list[Cell] = []
        for span in area.cells.ranges:
            for row in sheet.iter_rows(
                min_row=span.min_row,
                max_row=min(span.max_row, last_row),
                min_col=span.min_col,
                max_col=min(span.max_col, width),
            ):
                cells += row
        for rule in area.rules if cells else ():
            limits = [_rule_limit(sheet, formula) for formula in rule.formula]
            comparison = COMPARISONS.get(rule.operator or "")
            if rule.type != "cellIs" or comparison is None or not limits or None in limits:
                kind = " ".join(filter(None, (rule.type, *map(str, rule.formula))))
                unjudged.append(
                    f"conditional formatting of {area.sqref} ({kind}) is not judged: rows that it "
                    "marks are read as the others"
                )
                continue
            words, compare = comparison
            shown = " and ".join(f"{limit:g}" for limit in limits if limit is not None)
            mark = f"under the rule {words} {shown}"
            for cell in cells:
                if _is_numeric(cell.value) and compare(cell.value, *limits):
                    row_marks = marks.setdefault(cell.row, [])
                    row_marks += [mark] if mark not in row_marks else []
    return marks, tuple(dict.fromkeys(unjudged))


def _is_numeric(value: Any) -> TypeGuard[float]:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _rule_limit(sheet: Worksheet, formula: str) -> float | None:
    """Read the value of a rule, a number or an absolute cell; None for any other formula."""
    if _RULE_NUMBER.fullmatch(formula.strip()):
        return float(formula)
    value = sheet[formula.replace("$", "")].value if _ABSOLUTE_CELL.fullmatch(formula) else None
    return float(value) if _is_numeric(value) else None


def _is_masked(cell: Cell) -> bool:
    """Test whether the number format of a cell hides its value, as ``;;;`` does."""
    sections = str(cell.number_format).split(";")
    if len(sections) == 1:
        return False
    value = cell.value
    if not _is_numeric(value):
        return len(sections) == 4 and _EMPTY_SECTION.fullmatch(sections[3]) is not None
    # A format that blanks zeros alone, such as 0;-0;, rejects nothing.
    section = sections[1] if value < 0 else sections[0]
    return _EMPTY_SECTION.fullmatch(section) is not None


def _colour(cell: Cell) -> str:
    """Name fill and font of a cell, empty for black on white and for an empty cell."""
    if cell.value is None or not cell.has_style:
        return ""
    fill = _colour_name(cell.fill.fgColor) if cell.fill.fill_type else ""
    font = _colour_name(cell.font.color) if cell.font is not None and cell.font.color else ""
    plain_fill = "" if fill in ("FFFFFFFF", "00FFFFFF", "theme 0") else fill
    plain_font = "" if font in ("FF000000", "00000000", "theme 1") else font
    return f"{plain_fill}/{plain_font}" if plain_fill or plain_font else ""


def _colour_name(colour: Any) -> str:
    if colour.type == "rgb":
        return str(colour.rgb)
    tint = f" {colour.tint:.2f}" if colour.tint else ""
    return f"{colour.type} {colour.value}{tint}"


def _hidden_columns(sheet: Worksheet, width: int) -> frozenset[int]:
    """List the places of hidden columns; those hidden together are one dimension."""
    dimensions = [line for line in sheet.column_dimensions.values() if line.hidden]
    return frozenset(
        place
        for place in range(1, width + 1)
        if any(line.min <= place <= line.max for line in dimensions)
    )


def _with_number_notes(sheet: RawSheet, cells: Sequence[Sequence[Cell]]) -> RawSheet:
    """Add notes on misleading numbers, and the columns that hold numbers and not their texts."""
    notes: list[CellNote] = []
    true_numbers = set()
    for place, column in enumerate(zip(*cells, strict=True), start=1):
        numbers = [cell for cell in column if type(cell.value) in (int, float)]
        texts = [
            cell
            for cell in column
            if isinstance(cell.value, str) and _TEXT_NUMBER.fullmatch(cell.value.strip())
        ]
        dates = [cell for cell in column if isinstance(cell.value, datetime | date)]
        if numbers and len(texts) < len(numbers):
            true_numbers.add(place)
        if numbers:
            notes += _notes_on_texts(texts, place)
        notes += _notes_on_thousands(numbers, place)
        if len(dates) < len(numbers):
            notes += _notes_on_dates(dates, place)
    return replace(sheet, notes=tuple(notes), true_numbers=frozenset(true_numbers))


def _notes_on_texts(cells: Sequence[Cell], place: int) -> list[CellNote]:
    remedy = "is text among numbers; turn the cell into a number"
    return [CellNote(cell.row, place, f"'{cell.value}' {remedy}") for cell in cells]


def _notes_on_thousands(cells: Sequence[Cell], place: int) -> list[CellNote]:
    notes = []
    for cell in cells:
        positive_format = str(cell.number_format).split(";", maxsplit=1)[0]
        if _THOUSANDS.search(_LITERAL.sub("", positive_format)):
            sentence = (
                f"holds {cell.value}, which the number format '{cell.number_format}' shows "
                "divided by thousands; set the format General and correct number or unit"
            )
            notes.append(CellNote(cell.row, place, sentence))
    return notes


def _notes_on_dates(cells: Sequence[Cell], place: int) -> list[CellNote]:
    cause = "is a date among numbers: the spreadsheet has taken a number for a date"
    remedy = "enter the number again"
    return [CellNote(cell.row, place, f"'{cell.value}' {cause}; {remedy}") for cell in cells]


def odd_colours(rows: Sequence[RawRow]) -> list[int]:
    """Return indices of the rows with a cell whose colour differs from most of its column.

    Bands of every second or third row are no marks.
    """
    width = min((len(row.colours) for row in rows), default=0)
    usual_colours = [_usual_colour(rows, column) for column in range(width)]

    def is_odd(row: RawRow) -> bool:
        colours = zip(row.cells, usual_colours, row.colours, strict=False)
        return any(cell and usual is not None and c != usual for cell, usual, c in colours)

    odd_rows = [index for index, row in enumerate(rows) if is_odd(row)]
    steps = {later - earlier for earlier, later in pairwise(odd_rows)}
    regular = len(odd_rows) > 2 and len(steps) == 1 and steps != {1}
    banded = regular and 3 * len(odd_rows) >= len(rows) - 2
    return [] if banded else odd_rows


def _usual_colour(rows: Sequence[RawRow], column: int) -> str | None:
    """Return the most common colour of the filled cells of a column; None for an empty column."""
    colours = Counter(row.colours[column] for row in rows if row.cells[column])
    return colours.most_common(1)[0][0] if colours else None
