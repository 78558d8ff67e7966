"""Text files of users as editors and spreadsheets save them: encodings, TOML, tables of text.

Commas, semicolons or tabs part the cells; where these are no commas, numbers may have a decimal
comma. What could be read in two ways is refused with what to save instead. A sheet of a workbook
(``sim.raw_sheet``) is read as a table with tabs; one that has marks is refused.
"""

from __future__ import annotations

import csv
import re
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from dogshape.sim.decoding import TableLimits, decoded, read_bytes
from dogshape.sim.errors import DataError, InputError, did_you_mean
from dogshape.sim.raw_sheet import (
    FILTERED,
    HIDDEN,
    MASKED,
    NO_TABLE,
    SAVE,
    STRUCK,
    RawSheet,
    read_raw,
)

SEPARATORS = (",", ";", "\t")
_COMMA = re.compile(r"[+-]?\d*,\d+([eE][+-]?\d+)?")
_POINT = re.compile(r"[+-]?\d*\.\d+([eE][+-]?\d+)?")


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
    """Read the text of a file (``sim.decoding``).

    Raises DataError for what is no text or too large, OSError where the file cannot be read.
    """
    return decoded(read_bytes(path, TableLimits()))


def read_toml(path: Path) -> dict[str, Any]:
    """Read a TOML file; raises InputError with the line, OSError where there is none."""
    try:
        return tomllib.loads(text_of(path))
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"{path} is not valid TOML: {error}; correct the line") from error
    except RecursionError:
        raise InputError(
            f"{path} is not valid TOML: its values are nested too deeply; correct the brackets"
        ) from None
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
    sheet = read_raw(path, _separator_of_head)
    _require_plain(sheet)
    separator = sheet.separator
    rows = [(row.number, list(row.cells)) for row in sheet.rows]
    if not rows:
        raise DataError(f"{path} {NO_TABLE}: it is empty; {SAVE}")
    head = _unpadded(rows[0][1])
    meant = {name.lower(): name for name in names if name not in head}
    head = [meant.get(column.lower(), column) for column in head]
    body = [(number, _fitted(path, number, row, head, separator)) for number, row in rows[1:]]
    if separator != ",":
        body = _with_points(path, head, body, frozenset(numeric))
    return TextTable(path, tuple(head), tuple((number, tuple(row)) for number, row in body))


def _separator_of_head(lines: Sequence[str]) -> str:
    """Choose the separator that parts the head into most cells."""
    head = next((line for line in lines if line.strip()), "")
    return max(SEPARATORS, key=lambda sign: len(next(csv.reader([head], delimiter=sign), [])))


def _require_plain(sheet: RawSheet) -> None:
    """Raise DataError for rows and cells of a workbook that say more than their values."""
    rejected = {HIDDEN, FILTERED, STRUCK, MASKED}
    faults = [
        f"row {row.number} is {mark}; show it plainly, or delete it"
        for row in sheet.rows
        for mark in row.marks
        if mark in rejected
    ]
    faults += [f"row {note.row}: {note.sentence}" for note in sheet.notes]
    if faults:
        raise DataError(listed(str(sheet.path), faults))


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
