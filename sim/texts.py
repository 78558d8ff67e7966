"""Text files of users as editors and spreadsheets save them: encodings, TOML, tables of text.

Commas, semicolons or tabs part the cells; where these are no commas, numbers may have a decimal
comma. What could be read in two ways is refused with what to save instead. A sheet of a workbook,
``FILE.xlsx`` or ``FILE.xlsx#SHEET``, is read as a table with tabs.
"""

from __future__ import annotations

import codecs
import csv
import re
import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

from dogshape.sim.errors import DataError, InputError, did_you_mean

SAVE = "save it as CSV (UTF-8)"  #: remedy, as spreadsheets name it
NO_TABLE = "is not a table of comma separated values"
SEPARATORS = (",", ";", "\t")
_COMMA = re.compile(r"[+-]?\d*,\d+([eE][+-]?\d+)?")
_POINT = re.compile(r"[+-]?\d*\.\d+([eE][+-]?\d+)?")
_WIDE = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
_WORKBOOK = re.compile(r"(.+\.xlsx)(?:#(.+))?", re.IGNORECASE)
_EITHER = re.compile(r"-?\d{1,3}\.\d{3}")  #: a number whose point could part thousands
_BINARY = frozenset(range(32)) - set(b"\t\n\r\f")


@dataclass(frozen=True)
class TextTable:
    """A table as text; in the columns that were named numeric, numbers have a point."""

    path: Path
    head: tuple[str, ...]  #: names of the columns
    rows: tuple[tuple[int, tuple[str, ...]], ...]  #: as long as the head, with number in the file

    def column(self, name: str) -> list[str]:
        """Return the cells below a name."""
        place = self.head.index(name)
        return [cells[place] for _, cells in self.rows]

    def require(self, needed: Iterable[str], known: Iterable[str] | None = None) -> None:
        """Raise DataError with all columns at once that are missing, unknown or there twice.

        ``known`` None lets other columns be.
        """
        needed, own = tuple(needed), None if known is None else tuple(known)
        if len(self.head) == 1 < len(needed):
            raise DataError(f"{self.path} {NO_TABLE}: its first line is '{self.head[0]}'; {SAVE}")
        unknown = {} if own is None else dict.fromkeys(n for n in self.head if n not in own)
        faults = [f"'{n}' is not a known column; {did_you_mean(n, own or ())}" for n in unknown]
        others = [name for name in self.head if name not in needed]
        instead = f" (in the file: {', '.join(others)})" if others and own is None else ""
        # A misspelt column is also a missing one; the spelling is the better hint.
        absent = [n for n in needed if n not in self.head and f"'{n}'" not in " ".join(faults)]
        faults += [f"the column '{name}' is missing; add it{instead}" for name in absent]
        looked_at = needed if own is None else self.head
        twice = sorted({name for name in looked_at if self.head.count(name) > 1})
        faults += [f"the column '{name}' is there twice; keep one" for name in twice]
        if faults:
            raise DataError(listed(f"{self.path}, row 1", faults))


def is_plain(text: str) -> bool:
    """Test that a text is a number as programs write it."""
    try:
        float(text)
    except ValueError:
        return False
    return True


def listed(where: str, faults: Iterable[str]) -> str:
    """Return one fault behind its place, or several below it, a line each."""
    faults = list(faults)
    if len(faults) == 1:
        return f"{where}: {faults[0]}"
    return "\n".join([f"{where}: {len(faults)} mistakes", *(f"- {fault}" for fault in faults)])


def text_of(path: Path) -> str:
    """Return a file's text: UTF-8 or UTF-16 with or without a byte-order mark, or Windows' own.

    Raises DataError for what is no text, OSError where the file cannot be read.
    """
    raw = path.read_bytes()
    wide = raw.startswith(_WIDE)
    try:
        return raw.decode("utf-16" if wide else "utf-8-sig")
    except UnicodeDecodeError as error:
        # Western Windows saves "CSV" so; bytes that no text has give away anything else.
        if wide or not _BINARY.isdisjoint(raw):
            raise DataError("it is no text") from error
        return raw.decode("cp1252", errors="replace")


def read_toml(path: Path) -> dict[str, Any]:
    """Read a TOML file; raises InputError with the line, OSError where there is none."""
    try:
        return tomllib.loads(text_of(path))
    except (tomllib.TOMLDecodeError, RecursionError) as error:
        raise InputError(f"{path} is not valid TOML: {error}; correct the line") from error
    except DataError as error:
        raise InputError(f"{path} is not valid TOML: {error}; save it as UTF-8") from error


def place_of(tables: Any, key: str) -> tuple[Any, str]:
    """Return the table that holds a dotted key, made where it is missing, and the last name."""
    *names, last = key.split(".")
    for name in names:
        tables = tables.setdefault(name, {})
        if not isinstance(tables, Mapping):
            fault = f"{key} cannot be set: {name} is a value and not a table"
            raise InputError(f"{fault}; check the key")
    return tables, last


def read_table(path: Path, numeric: Iterable[str], names: Iterable[str] = ()) -> TextTable:
    """Read a table of text; in the ``numeric`` columns a decimal comma becomes a point.

    A column of the file that is one of ``names`` but for its case gets that name, unless the file
    has a column of exactly that name too. Raises DataError with row and remedy where the file is no
    table, a row has more cells than the head, or numbers can be read in two ways; else
    FileNotFoundError.
    """
    lines = read_lines(path)
    first = next((line for line in lines if line.strip()), "")
    # What parts the head into most cells.
    separator = max(SEPARATORS, key=lambda one: len(next(csv.reader([first], delimiter=one), [])))
    rows = parted(path, lines, separator)
    if not rows:
        raise DataError(f"{path} {NO_TABLE}: it is empty; {SAVE}")
    head = _unpadded(rows[0][1])
    meant = {name.lower(): name for name in names if name not in head}
    head = [meant.get(column.lower(), column) for column in head]
    body = [(number, _fitted(path, number, row, head, separator)) for number, row in rows[1:]]
    if separator != ",":
        body = _with_points(path, head, body, frozenset(numeric))
    return TextTable(path, tuple(head), tuple((number, tuple(row)) for number, row in body))


def read_lines(path: Path) -> list[str]:
    """Read the lines of a file with their ends, without Excel's own line on the separator.

    Raises as ``read_table``.
    """
    book = _WORKBOOK.fullmatch(str(path))
    try:
        text = _sheet_text(book) if book else text_of(path)
    except FileNotFoundError:
        raise
    except OSError as error:
        raise DataError(f"{path} cannot be read: {error.strerror}; check path and rights") from None
    except DataError as error:
        if book:
            raise
        raise DataError(f"{path} {NO_TABLE}: {error}; {SAVE}") from None
    if "\0" in text:
        raise DataError(f"{path} {NO_TABLE}: it is no text; {SAVE}")
    lines = text.splitlines(keepends=True)
    return lines[1:] if lines and re.fullmatch(r"sep=.\s*", lines[0]) else lines


def file_of(table: Path) -> Path:
    """Give the file of a table, without the sheet that may be named behind it."""
    found = _WORKBOOK.fullmatch(str(table))
    return Path(found[1]) if found else table


def _sheet_text(found: re.Match[str]) -> str:
    """Read a sheet of a workbook as text with tabs; DataError where none is named of several."""
    import pandas as pd  # noqa: PLC0415  # half a second that other tables do not need

    try:
        every = pd.read_excel(found[1], sheet_name=None, header=None, dtype=object)
    except (ValueError, KeyError, BadZipFile) as error:
        raise DataError(f"{found[1]} is no workbook; save it as .xlsx or as CSV") from error
    sheets = {name: frame for name, frame in every.items() if not frame.empty}
    first, wanted = next(iter(sheets), "SHEET"), found[2]
    if wanted not in sheets and (wanted or len(sheets) != 1):
        fault = f"there is no sheet '{wanted}'" if wanted else "several sheets have cells"
        rule = f"name one of {', '.join(sheets)}, as {found[1]}#{first}"
        raise DataError(f"{found[1]}: {fault}; {rule}")

    def text(cell: Any) -> Any:
        # Written to four decimals, its point can be nothing else.
        return f"{cell}0" if isinstance(cell, float) and _EITHER.fullmatch(str(cell)) else cell

    return str(sheets[wanted or first].map(text).to_csv(sep="\t", index=False, header=False))


def parted(path: Path, lines: list[str], separator: str) -> list[tuple[int, list[str]]]:
    """Part lines into cells without blanks around them: rows with their numbers."""
    try:
        found = list(csv.reader(lines, delimiter=separator))
    except csv.Error as error:
        raise DataError(f"{path} {NO_TABLE}: {error}; {SAVE}") from None
    return [(n, [c.strip() for c in row]) for n, row in enumerate(found, start=1) if any(row)]


def _unpadded(row: list[str]) -> list[str]:
    return row[: max((place for place, cell in enumerate(row, start=1) if cell), default=0)]


def _fitted(path: Path, number: int, row: list[str], head: list[str], separator: str) -> list[str]:
    """Return a row of the head's length; cells beyond it raise DataError."""
    row = _unpadded(row)
    if len(row) > len(head):
        comma = "; is a decimal comma among them? write numbers with a point"
        raise DataError(
            f"{path}, row {number} has {len(row)} cells for {len(head)} columns: "
            f"'{row[len(head)]}' stands beyond the last column, '{head[-1]}'"
            f"{comma if separator == ',' else ''}; take away what is too many"
        )
    return row + [""] * (len(head) - len(row))


def _with_points(
    path: Path, head: list[str], rows: list[tuple[int, list[str]]], numeric: frozenset[str]
) -> list[tuple[int, list[str]]]:
    """Return rows whose numbers have a decimal point; raises DataError where both stand."""
    places = [place for place, name in enumerate(head) if name in numeric]
    cells = [(number, row[place]) for number, row in rows for place in places]
    comma = next(((n, cell) for n, cell in cells if _COMMA.fullmatch(cell)), None)
    point = next(((n, cell) for n, cell in cells if _POINT.fullmatch(cell)), None)
    if comma and point:
        raise DataError(
            f"{path} has numbers with a comma ('{comma[1]}', row {comma[0]}) and with a point "
            f"('{point[1]}', row {point[0]}), which can be read in two ways; save it with one"
        )
    for _, row in rows:
        for place in places:
            if _COMMA.fullmatch(row[place]):
                row[place] = row[place].replace(",", ".")
    return rows
