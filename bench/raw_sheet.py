"""Raw sheet of a table: rows with the text of their cells, their numbers and their marks.

First of the five steps by which a foreign table is read. Text has cells between separators; a sheet
of a workbook, ``FILE.xlsx`` or ``FILE.xlsx#SHEET``, is read by ``bench.workbook``.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Literal

from dogshape.bench.decoding import TableLimits, decode_text, read_bytes
from dogshape.sim.errors import DataError
from dogshape.sim.interface import key_argument

SAVE = "save it as CSV (UTF-8)"  #: remedy, as spreadsheets name it
NO_TABLE = "is not a table of comma separated values"
_WORKBOOK = re.compile(r"(.+\.xlsx)(?:#(.+))?", re.IGNORECASE)
#: Workbooks that are not read, by suffix.
OTHER_BOOKS = {
    ".xlsm": "a workbook with macros",
    ".xls": "a workbook of Excel 97",
    ".xlsb": "a binary workbook",
    ".ods": "a workbook of LibreOffice",
    ".numbers": "a workbook of Numbers",
}
_ZIP = b"PK\x03\x04"
_OLE = b"\xd0\xcf\x11\xe0"
_PLAIN = re.compile(r"[A-Za-z0-9_.,;:/+-]*")
#: A cell between the quotation marks of a word processor.
_TYPOGRAPHIC = re.compile(r"[“”„‟«»]\s*([^“”„‟«»]*?)\s*[“”‟«»]")


class QuoteError(DataError):
    """A quotation mark encloses later rows; ``rows`` are their numbers."""

    def __init__(self, text: str, rows: range = range(0)) -> None:
        super().__init__(text)
        self.rows = rows


@dataclass(frozen=True)
class RawRow:
    """A row: its number in the file, its cells, its marks, and the colours of its cells.

    A colour is empty where a cell has none; rows of a text have neither marks nor colours.
    """

    number: int
    cells: tuple[str, ...]
    marks: tuple[str, ...] = ()
    colours: tuple[str, ...] = ()


@dataclass(frozen=True)
class CellNote:
    """A sentence on the cell in ``row`` of the file and column ``place``, from 1."""

    row: int
    place: int
    sentence: str


@dataclass(frozen=True)
class RawSheet:
    """Rows of a sheet that have cells, with the marks of a workbook.

    ``true_numbers`` are the places of columns that hold numbers and not their texts. ``notes`` are
    on cells that cannot be read, ``merged`` on those that have the value of a cell above.
    ``remarks`` are sentences on how the sheet was read.
    """

    path: Path
    separator: str
    rows: tuple[RawRow, ...]
    notes: tuple[CellNote, ...] = ()
    merged: tuple[CellNote, ...] = ()
    true_numbers: frozenset[int] = frozenset()
    hidden_columns: frozenset[int] = frozenset()
    remarks: tuple[str, ...] = ()

    @cached_property
    def width(self) -> int:
        """Cells of the longest row."""
        return max((len(row.cells) for row in self.rows), default=0)

    @cached_property
    def cells(self) -> list[tuple[str, ...]]:
        """Cells of each row, filled to the width of the sheet."""
        return [(*row.cells, *[""] * (self.width - len(row.cells))) for row in self.rows]

    def lines(self) -> Iterator[str]:
        """Describe the sheet, a line each: size, marks and cells with notes."""
        words = {";": "semicolons", "\t": "tabs", ",": "commas", "|": "strokes"}
        separators = words.get(self.separator, repr(self.separator))
        yield f"{len(self.rows)} rows with cells, up to {self.width} cells between {separators}"
        for row in self.rows:
            if row.marks:
                yield f"row {row.number}: {', '.join(row.marks)}"
        for note in (*self.notes, *self.merged):
            yield f"row {note.row}, column {note.place}: {note.sentence}"
        if self.hidden_columns:
            yield f"hidden columns: {', '.join(map(str, sorted(self.hidden_columns)))}"
        yield from self.remarks


def file_of(table: Path) -> Path:
    """Return the path of a table's file, without the name of a sheet behind ``#``."""
    match = _WORKBOOK.fullmatch(str(table))
    return Path(match[1]) if match else table


def is_workbook(path: Path) -> bool:
    """Test whether a path names a workbook or one of its sheets."""
    return bool(_WORKBOOK.fullmatch(str(path)))


def read_lines(path: Path, limits: TableLimits) -> list[str]:
    """Read the lines of a text with their ends, without Excel's line ``sep=;`` at the top.

    Raises DataError with the remedy if the file is no table or exceeds ``limits``,
    FileNotFoundError for a missing file.
    """
    kind = OTHER_BOOKS.get(path.suffix.lower())
    if kind and path.exists():
        raise DataError(f"{path} is {kind} ({path.suffix}); save it as .xlsx or as CSV")
    text = _read_text(path, limits)
    if "\0" in text:
        raise DataError(f"{path} {NO_TABLE}: it is no text; {SAVE}")
    text = text.replace("\r\n", "\n").replace("\r", "\n")
    limits.require("rows", text.count("\n"), str(path), "divide the table")
    *complete_lines, last_line = text.split("\n")
    lines = [f"{line}\n" for line in complete_lines]
    if last_line:
        lines.append(last_line)
    return lines[1:] if lines and re.fullmatch(r"sep=.\s*", lines[0]) else lines


def _read_text(path: Path, limits: TableLimits) -> str:
    """Read and decode the text of a table; raises as ``read_lines``."""
    try:
        raw = read_bytes(path, limits)
        if raw.startswith((_ZIP, _OLE)):
            raise DataError(
                "it is a workbook or an archive; save it as .xlsx, with this ending, or as CSV"
            )
        return decode_text(raw)
    except FileNotFoundError:
        raise
    except OSError as error:
        raise DataError(f"{path} cannot be read: {error.strerror}; check path and rights") from None
    except DataError as error:
        if ";" in str(error):
            raise
        raise DataError(f"{path} {NO_TABLE}: {error}; {SAVE}") from None


def text_sheet(
    path: Path,
    lines: Sequence[str],
    separator: str,
    limits: TableLimits,
    *,
    quoted: bool = True,
) -> RawSheet:
    """Divide lines into cells; raises QuoteError for a quotation mark that swallows rows.

    Unless ``quoted``, quotation marks are ordinary signs.
    """
    rows = []
    reader = csv.reader(lines, delimiter=separator, quoting=quoting_of(quoted))
    first_line = 0
    number = 0
    default_size_limit = csv.field_size_limit(limits.cell_characters)
    try:
        for cells in reader:
            number += 1
            row_lines = lines[first_line : reader.line_num]
            if len(row_lines) > 1:
                _require_closed(path, number, row_lines, separator)
            first_line = reader.line_num
            limits.require("columns", len(cells), f"{path}, row {number}", "divide the table")
            if any(cells):
                rows.append(RawRow(number, tuple(map(clean_text, cells))))
    except csv.Error as error:
        if "field larger" not in str(error):
            raise DataError(f"{path} {NO_TABLE}: {error}; {SAVE}") from None
        _require_closed(path, number + 1, lines[first_line:], separator)
        answer = key_argument("limits", "cell_characters", "NUMBER")
        raise DataError(
            f"{path}, row {number + 1} has a cell of more than {limits.cell_characters} "
            f"characters; shorten it, or raise the limit: {answer}"
        ) from None
    finally:
        csv.field_size_limit(default_size_limit)
    return RawSheet(path, separator, tuple(rows))


def quoting_of(quoted: bool) -> Literal[0, 3]:
    """Choose the way in which ``csv`` reads quotation marks."""
    return csv.QUOTE_MINIMAL if quoted else csv.QUOTE_NONE


def _require_closed(path: Path, row: int, lines: Sequence[str], separator: str) -> None:
    """Raise QuoteError if the quotation mark in the first of these lines encloses later rows."""
    mark_count = sum(line.count('"') for line in lines)
    rows_inside = [line for line in lines[1:] if line.count(separator) >= 1]
    # A head or a remark may be wrapped; a number before each separator is a row of its own.
    number_rows = [line for line in rows_inside if re.match(r"\s*[\"+-]?\d", line)]
    if mark_count % 2 or number_rows:
        end = "is never closed" if mark_count % 2 else f"is closed {len(lines) - 1} lines later"
        raise QuoteError(
            f"{path}, row {row}: a quotation mark begins a cell and {end}, so that "
            f"{len(lines) - 1} lines would be lost; remove the mark, or close it in its row",
            range(row + 1, row + len(lines)),
        )


def clean_text(cell: str) -> str:
    """Return the text of a cell in one line, without hyphens of wrapped words and outer quotes.

    ``="50"`` and ``'50`` protect numbers from a spreadsheet; “50” comes from a word processor.
    """
    if _PLAIN.fullmatch(cell):
        return cell
    text = re.sub(r"(?<=\w)(?:-\s*\n\s*|\xad\s*)(?=[^\W\d_])", _unhyphenated, cell)
    text = re.sub(r"\s*[\n\t]\s*|[^\S ]", " ", text).strip()
    protected = re.fullmatch(r"=\s*\"(.*)\"|'([+-]?[\d.,]+)", text)
    if protected:
        return protected[1] or protected[2] or ""
    quoted = _TYPOGRAPHIC.fullmatch(text)
    return quoted[1] if quoted else text


def _unhyphenated(match: re.Match[str]) -> str:
    following = match.string[match.end()]
    return "" if following.islower() else "-"
