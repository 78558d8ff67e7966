"""Text files of users as editors and spreadsheets save them: encodings, TOML, tables of text.

Commas, semicolons or tabs separate the cells; unless these are commas, numbers may have a decimal
comma. An ambiguous table is refused with a remedy. A sheet of a workbook (``bench.workbook``) is
read as a table with tabs; a sheet with marks is refused.
"""

from __future__ import annotations

import csv
import re
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from dogshape.bench.decoding import TableLimits, decode_text, read_bytes
from dogshape.bench.raw_sheet import NO_TABLE, SAVE, RawSheet, is_workbook, read_lines, text_sheet
from dogshape.bench.workbook import FILTERED, HIDDEN, MASKED, STRUCK, read_workbook
from dogshape.sim.errors import DataError, InputError, did_you_mean, join_faults

SEPARATORS = (",", ";", "\t")
_COMMA = re.compile(r"[+-]?\d*,\d+([eE][+-]?\d+)?")
_POINT = re.compile(r"[+-]?\d*\.\d+([eE][+-]?\d+)?")


@dataclass(frozen=True)
class TextTable:
    """A table of text; numbers in its numeric columns have a decimal point."""

    path: Path
    head: tuple[str, ...]  #: names of the columns
    rows: tuple[tuple[int, tuple[str, ...]], ...]  #: number in the file, cells as many as the head

    def column(self, name: str) -> list[str]:
        """Return the cells below a name."""
        place = self.head.index(name)
        return [cells[place] for _, cells in self.rows]

    def require(self, needed: Sequence[str], known: Sequence[str] | None = None) -> None:
        """Raise DataError that lists all missing, unknown and repeated columns.

        With ``known`` None any other column is allowed.
        """
        if len(self.head) == 1 < len(needed):
            raise DataError(f"{self.path} {NO_TABLE}: its first line is '{self.head[0]}'; {SAVE}")
        faults: list[str] = []
        other_names = ""
        checked_names = needed
        if known is not None:
            unknown = dict.fromkeys(name for name in self.head if name not in known)
            faults += [
                f"'{name}' is not a known column; {did_you_mean(name, known)}" for name in unknown
            ]
            checked_names = self.head
        else:
            extra_names = [name for name in self.head if name not in needed]
            if extra_names:
                other_names = f" (in the file: {', '.join(extra_names)})"
        # A misspelt column is also a missing one; the spelling is the better hint.
        hints = " ".join(faults)
        missing = [name for name in needed if name not in self.head and f"'{name}'" not in hints]
        faults += [f"the column '{name}' is missing; add it{other_names}" for name in missing]
        repeated = sorted({name for name in checked_names if self.head.count(name) > 1})
        faults += [f"the column '{name}' is there twice; keep one" for name in repeated]
        if faults:
            raise DataError(join_faults(f"{self.path}, row 1", faults))


def is_plain(text: str) -> bool:
    """Test whether Python reads ``text`` as a number."""
    try:
        float(text)
    except ValueError:
        return False
    return True


def text_of(path: Path) -> str:
    """Read a text file of any encoding that ``bench.decoding`` detects.

    Raises DataError for binary or too large files, OSError if the file cannot be read.
    """
    return decode_text(read_bytes(path, TableLimits()))


def read_toml(path: Path) -> dict[str, Any]:
    """Read a TOML file; raises InputError that names the line, OSError for a missing file."""
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
    """Return the innermost table of a dotted ``key`` and the key's last name; create the table."""
    *names, last = key.split(".")
    for name in names:
        tables = tables.setdefault(name, {})
        if not isinstance(tables, Mapping):
            fault = f"{key} cannot be set: {name} is a value and not a table"
            raise InputError(f"{fault}; check the key")
    return tables, last


def read_table(path: Path, numeric: Iterable[str], names: Iterable[str] = ()) -> TextTable:
    """Read a table of text; in the ``numeric`` columns a decimal comma becomes a point.

    A column whose name differs from one of ``names`` by case alone gets that name, unless the file
    also has a column of exactly that name. Raises DataError with row and remedy if the file is no
    table, a row has more cells than the head, or numbers are ambiguous; FileNotFoundError.
    """
    limits = TableLimits()
    if is_workbook(path):
        sheet = read_workbook(path, limits)
    else:
        lines = read_lines(path, limits)
        sheet = text_sheet(path, lines, _separator_of_head(lines), limits)
    _require_plain(sheet)
    separator = sheet.separator
    if not sheet.rows:
        raise DataError(f"{path} {NO_TABLE}: it is empty; {SAVE}")
    file_head = _strip_empty_cells(list(sheet.rows[0].cells))
    names_by_lower = {name.lower(): name for name in names if name not in file_head}
    head = [names_by_lower.get(column.lower(), column) for column in file_head]
    rows = [
        (row.number, _pad_row(path, row.number, list(row.cells), head, separator=separator))
        for row in sheet.rows[1:]
    ]
    if separator != ",":
        _replace_commas(path, head, rows, frozenset(numeric))
    return TextTable(path, tuple(head), tuple((number, tuple(cells)) for number, cells in rows))


def _separator_of_head(lines: Sequence[str]) -> str:
    """Choose the separator that divides the head into most cells."""
    head = next((line for line in lines if line.strip()), "")

    def cell_count(separator: str) -> int:
        """Count the cells of the head."""
        return len(next(csv.reader([head], delimiter=separator), []))

    return max(SEPARATORS, key=cell_count)


def _require_plain(sheet: RawSheet) -> None:
    """Raise DataError for marked rows and annotated cells of a workbook."""
    rejected = {HIDDEN, FILTERED, STRUCK, MASKED}
    faults = [
        f"row {row.number} is {mark}; show it plainly, or delete it"
        for row in sheet.rows
        for mark in row.marks
        if mark in rejected
    ]
    faults += [f"row {note.row}: {note.sentence}" for note in sheet.notes]
    if faults:
        raise DataError(join_faults(str(sheet.path), faults))


def _strip_empty_cells(cells: list[str]) -> list[str]:
    """Remove empty cells at the end of a row."""
    width = max((place for place, cell in enumerate(cells, start=1) if cell), default=0)
    return cells[:width]


def _pad_row(
    path: Path, number: int, cells: list[str], head: list[str], *, separator: str
) -> list[str]:
    """Pad a row with empty cells to the length of ``head``; raises DataError for a longer row."""
    filled = _strip_empty_cells(cells)
    if len(filled) > len(head):
        question = "; is a decimal comma among them? write numbers with a point"
        raise DataError(
            f"{path}, row {number} has {len(filled)} cells for {len(head)} columns: "
            f"'{filled[len(head)]}' stands beyond the last column, '{head[-1]}'"
            f"{question if separator == ',' else ''}; take away what is too many"
        )
    return filled + [""] * (len(head) - len(filled))


def _replace_commas(
    path: Path, head: list[str], rows: list[tuple[int, list[str]]], numeric: frozenset[str]
) -> None:
    """Replace decimal commas in ``rows`` by points; raises DataError if the table has both."""
    places = [place for place, name in enumerate(head) if name in numeric]
    numbers = [(number, cells[place]) for number, cells in rows for place in places]
    comma = next(((row, cell) for row, cell in numbers if _COMMA.fullmatch(cell)), None)
    point = next(((row, cell) for row, cell in numbers if _POINT.fullmatch(cell)), None)
    if comma and point:
        raise DataError(
            f"{path} has numbers with a comma ('{comma[1]}', row {comma[0]}) and with a point "
            f"('{point[1]}', row {point[0]}), which can be read in two ways; save it with one"
        )
    for _, cells in rows:
        for place in places:
            if _COMMA.fullmatch(cells[place]):
                cells[place] = cells[place].replace(",", ".")
