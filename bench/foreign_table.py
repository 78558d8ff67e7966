"""Layout of a foreign table: head, rows of shifts, and excluded rows with their reasons.

A foreign table is read in five steps, each a frozen value that ``explain_reading`` tells about:
*raw sheet* (``bench.raw_sheet``, ``workbook``), *layout* (here), *columns and units*
(``foreign_columns``), *rows and marks* (``row_marks``), *readings* (``foreign_readings``).

A layout has one row for each shift or mean, else it is reshaped where that is certain (transposed,
repeats as columns) and refused by its name where it is not: matrix, blocks with titles, tables side
by side. A row of words between the shifts may say that those below are of another kind, and is a
question. ``docs/bench.md`` lists the rows that are left out.
"""

from __future__ import annotations

import csv
import re
from collections import Counter
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from textwrap import shorten

import numpy as np

from dogshape.bench.cell_grid import MARKS, CellGrid, Cells
from dogshape.bench.cell_values import (
    Column,
    begins_with_number,
    durations_of,
    is_blank,
    is_number,
    numbers_of,
    split_head,
    unit_named,
)
from dogshape.bench.decoding import TableLimits
from dogshape.bench.draft_arguments import rows_argument, rows_example
from dogshape.bench.quantities import SHIFT_TIME, SPLITTING, has_word, plain_words, score
from dogshape.bench.raw_sheet import (
    QuoteError,
    RawRow,
    RawSheet,
    file_of,
    is_workbook,
    quoting_of,
    read_lines,
    text_sheet,
)
from dogshape.bench.table_shapes import (
    is_transposed,
    named_needs,
    require_no_blocks,
    require_rows_of_shifts,
    transposed,
)
from dogshape.bench.workbook import read_workbook
from dogshape.sim.errors import DataError
from dogshape.sim.interface import argument

Reasons = list[tuple[int, str]]  #: rows of the file that are left out, and why
QUOTED_LENGTH = 80  #: characters of a row that is left out
ROUNDED = 2e-3  #: share by which a rounded sum or mean is off
HEADS = 4  #: rows of names and units above the numbers, at most
SAMPLE_LINES = 2000  #: lines by which the separator of a text is chosen
PLAIN, TRANSPOSED, REPEATS = "one row a shift", "transposed", "repeats as columns"
_LABVIEW = re.compile(
    r"(?ms)^(?:LabVIEW Measurement|Channels\b).*?^\*\*\*End_of_Header\*\*\*[^\n]*"
)
_DECIMAL = re.compile(r"(?m)^Decimal_Separator\s+([.,])")
_STATISTIC = re.compile(
    r"(?i)n\s*[=:]?|(Ø|count|anzahl|mean|average|avg|mittel\w*|durchschnitt|median|sum|summe|total|gesamt"
    r"|std\w*|sd|stabw|standardabweichung|var|varianz|min|max|minimum|maximum|\d+ ?%"
    r"|moyenne|media|somma|suma|somme|gemiddelde|prumer|srednia|medel\w*)"
    r"(\W*|\W+[^\W\d]{0,2}\W*)"
)
#: Words that say of rows that they are no shifts.
REJECTED = re.compile(
    r"(?i)ung[uü]e?ltig|verworfen|ausrei(ß|ss)er|fehlerhaft|fehlmessung|defekt|nicht (gewertet"
    r"|werten|verwend\w+|ber[uü]e?cksichtig\w+)|streichen|gestrichen|ausgeschlossen|invalid|discard|reject"
    r"|outlier|exclude|ignore|omit|bad (run|shift|data)|do not use|not valid|aborted|abgebrochen"
    r"|abbruch|failed (run|measurement)|rejet[ée]|exclu|aberrant|invalide|scartat|scarto|anomal"
    r"|non valid|descartad|rechazad|inv[aá]lid|odrzucon|neplatn|vy[rř]azen|ongeldig|kassera"
)


@dataclass(frozen=True)
class Layout:
    """Where a sheet has its names, units and shifts.

    ``questions`` are those on rows.
    """

    name: str
    names: tuple[str, ...]
    units: tuple[str, ...]
    body: tuple[RawRow, ...]
    left_out: tuple[tuple[int, str], ...]
    questions: tuple[str, ...]

    def lines(self) -> Iterator[str]:
        """Describe the layout, a line each."""
        yield self.name
        names = (
            f"{name} {unit}".strip() for name, unit in zip(self.names, self.units, strict=True)
        )
        yield f"names: {' | '.join(names)}"
        if self.body:
            yield f"rows {self.body[0].number} to {self.body[-1].number}: {len(self.body)}"
        yield from (f"left out: row {number}: {reason}" for number, reason in self.left_out)
        yield from (f"question: {question}" for question in self.questions)


@dataclass(frozen=True)
class ForeignTable:
    """Foreign table: raw sheet, layout, columns and rows of shifts.

    ``place_questions`` are pairs of a column's place and a question on one of its words. ``stated``
    is the decimal sign that the file states.
    """

    sheet: RawSheet
    layout: Layout
    columns: tuple[Column, ...]
    left_out: Reasons
    stated: str | None
    place_questions: Reasons
    summaries: tuple[tuple[str, str], ...] = ()  #: heads of columns left out, and why

    @cached_property
    def rows(self) -> tuple[int, ...]:
        """Row numbers of the shifts in the file."""
        return tuple(row.number for row in self.layout.body)

    @property
    def path(self) -> Path:
        """The file, with the sheet behind it."""
        return self.sheet.path

    def with_remark(self, remark: str) -> ForeignTable:
        """Add a sentence on how the table was read."""
        sheet = replace(self.sheet, remarks=(*self.sheet.remarks, remark))
        return replace(self, sheet=sheet)

    def taking(self, places: Sequence[int], reasons: Reasons) -> ForeignTable:
        """Select the rows at ``places``; ``reasons`` has row and reason of each excluded row."""
        columns = tuple(
            replace(column, cells=tuple(column.cells[k] for k in places)) for column in self.columns
        )
        body = tuple(self.layout.body[k] for k in places)
        return replace(
            self,
            layout=replace(self.layout, body=body),
            columns=columns,
            left_out=sorted([*self.left_out, *reasons]),
        )


def read_foreign(
    path: Path,
    chosen: Sequence[range] = (),
    *,
    sums: bool = True,
    limits: TableLimits,
    quoted: bool,
) -> ForeignTable:
    """Read a table whose head stands anywhere above its numbers; raises DataError without one.

    ``chosen`` are the rows of the file that are shifts, where its structure is not to decide.
    Without ``sums``, as of traces, each row of numbers is a row of the table. Unless ``quoted``,
    quotation marks are ordinary signs.
    """
    if not file_of(path).exists():
        raise DataError(f"there is no {path}; give a CSV or .xlsx that the stand has written")
    sheet, stated = read_sheet(path, limits, chosen, quoted=quoted)
    return table_of(sheet, stated, chosen, sums=sums)


def read_sheet(
    path: Path, limits: TableLimits, chosen: Sequence[range], *, quoted: bool
) -> tuple[RawSheet, str | None]:
    """Read the raw sheet, and the decimal sign that the file states.

    Quotation marks are ordinary signs unless ``quoted``, or where ``chosen`` has a row that they
    would swallow. Raises QuoteError, with the options, for others that swallow rows.
    """
    if is_workbook(path):
        return read_workbook(path, limits), None
    text = "".join(read_lines(path, limits))
    stated = _DECIMAL.search(text)
    decimal = stated[1] if stated else None
    text = _LABVIEW.sub(lambda match: "\n" * match.group().count("\n"), text)
    lines = [f"{line}\n" for line in text.split("\n")]
    if quoted:
        try:
            return text_sheet(path, lines, _separator(lines), limits), decimal
        except QuoteError as error:
            fault = error
    separator = _separator(lines, quoted=False)
    sheet = text_sheet(path, lines, separator, limits, quoted=False)
    if not quoted:
        return sheet, decimal
    if not any(row in span for row in fault.rows for span in chosen):
        raise QuoteError(f"{fault}, {_quote_options(sheet, decimal)}") from None
    remark = (
        f"quotation marks are ordinary signs, as {argument('rows')} names rows between two of them"
    )
    return replace(sheet, remarks=(remark,)), decimal


def _quote_options(sheet: RawSheet, decimal: str | None) -> str:
    """Offer the options that read a sheet with quotation marks as ordinary signs."""
    option = f"or say {argument('quotes', 'none')} where quotation marks are ordinary signs"
    try:
        table = table_of(sheet, decimal)
    except DataError:
        return option
    first, last = table.rows[0], table.rows[-1]
    if last - first + 1 != len(table.rows):
        return option
    return f"{option}, or {rows_argument(f'{first}-{last}')} where each of these lines is a shift"


def _separator(lines: Sequence[str], *, quoted: bool = True) -> str:
    """Choose the separator that gives most rows of numbers, else whole quotations, most cells."""

    def rows_of_numbers(separator: str) -> tuple[int, int, int]:
        count, broken, cells = 0, 0, 0
        quoting = quoting_of(quoted)
        try:
            for row in csv.reader(lines[:SAMPLE_LINES], delimiter=separator, quoting=quoting):
                filled = [cell.strip() for cell in row if cell.strip()]
                numbers = sum(map(is_number, filled))
                count += numbers >= 2 and 2 * numbers >= len(filled)
                broken += any(cell.count('"') % 2 for cell in filled)
                cells += len(filled)
        except csv.Error:
            return 0, 0, 0
        return count, -broken, cells

    return max(";\t,|", key=rows_of_numbers)


def table_of(
    sheet: RawSheet, stated: str | None, chosen: Sequence[range] = (), *, sums: bool = True
) -> ForeignTable:
    """Find the layout of a sheet and its columns; raises as ``read_foreign``."""
    path = sheet.path
    sheet, grid, signs, name = _grid_of(sheet, sums=sums)
    layout = _divided(path, grid, chosen, signs, sums=sums)
    width, place_questions = len(layout.names), list[tuple[int, str]]()
    numbers = {row.number for row in layout.body}
    body = [k for k, row in enumerate(grid.raw) if row.number in numbers]
    excluded_rows = list(layout.left_out)
    if sums and not chosen:
        excluded_rows += _summaries(grid, body, place_questions)
    excluded = {number for number, _ in excluded_rows}
    body = [k for k in body if grid.rows[k] not in excluded]
    if not body:
        raise DataError(f"{path} has no row of a shift; name its rows with {rows_example('2-41')}")
    _require_width(path, grid, body, width)
    nameless = ("",) * int(grid.filled[body, width:].any(axis=0).sum())
    layout = replace(
        layout,
        name=name,
        names=layout.names + nameless,
        units=layout.units + nameless,
        body=tuple(grid.raw[k] for k in body),
        left_out=tuple(sorted(excluded_rows)),
    )
    columns = _columns(sheet, layout, [grid.cells[k] for k in body])
    table = ForeignTable(sheet, layout, columns, [*layout.left_out], stated, place_questions)
    if sums:
        require_rows_of_shifts(path, columns, grid)
    return table


def _grid_of(sheet: RawSheet, *, sums: bool) -> tuple[RawSheet, CellGrid, frozenset[str], str]:
    """Divide a sheet into cells, with remarks as a column and shifts as rows.

    Returns sheet and grid, the signs of comments, and the name of the layout. Raises DataError for
    a sheet without rows of numbers.
    """
    grid = CellGrid(sheet)
    signs = _comment_signs(grid) if sums else frozenset()
    if signs:
        sheet = _with_remarks(sheet, signs)
        grid = CellGrid(sheet)
    if not grid.data.any():
        grid = CellGrid(sheet, loose=True)
    name = PLAIN
    if sums and is_transposed(grid):
        sheet, name = transposed(sheet), TRANSPOSED
        grid = CellGrid(sheet)
    if not grid.data.any():
        require_no_blocks(sheet.path, grid, range(len(grid.rows)))
        raise DataError(
            f"{sheet.path} has no rows of numbers; save the table as CSV with semicolons, tabs or "
            "commas between cells, and a name and unit above each column"
        )
    return sheet, grid, signs, name


def _comment_signs(grid: CellGrid) -> frozenset[str]:
    """Find the signs of comments above the numbers; none where most rows begin with one."""
    places = np.flatnonzero(grid.data)
    if not places.size:
        return frozenset()
    heads = [cells[0] for cells in grid.cells[: places[0]]]
    signs = frozenset(head[0] for head in heads if len(head) > 1 and head[0] in MARKS)
    commented = [cells[0][:1] in signs for cells in grid.cells[places[0] :]]
    return signs if 2 * sum(commented) <= places.size else frozenset()


def _with_remarks(sheet: RawSheet, signs: Collection[str]) -> RawSheet:
    """Turn remarks behind numbers, ``131 # noisy``, into marks of their rows."""
    pattern = re.compile(rf"(.*?\d.*?)\s*[{re.escape(''.join(signs))}]\s*(.*)")
    usual_width = Counter(len(row.cells) for row in sheet.rows).most_common(1)[0][0]
    rows = []
    for row in sheet.rows:
        matches = [(k, pattern.fullmatch(cell)) for k, cell in enumerate(row.cells)]
        remarks = [(k, match) for k, match in matches if match and is_number(match[1])]
        if not remarks or row.cells[0][:1] in signs:
            rows.append(row)
            continue
        place, match = remarks[0]
        # A separator within the remark makes a row longer than the others.
        behind = row.cells[place + 1 :] if len(row.cells) > usual_width else ()
        other_cells = () if behind else row.cells[place + 1 :]
        words = ", ".join(filter(None, (match[2], *behind))).replace("'", " ")
        cells = (*row.cells[:place], match[1], *other_cells)
        rows.append(replace(row, cells=cells, marks=(*row.marks, f"remark {words}".strip())))
    return replace(sheet, rows=tuple(rows))


def _columns(sheet: RawSheet, layout: Layout, cells: Sequence[Cells]) -> tuple[Column, ...]:
    columns = []
    for k, (name, unit) in enumerate(zip(layout.names, layout.units, strict=True)):
        column_cells = tuple(row[k] for row in cells)
        if name or any(column_cells):
            head = name or f"column {k + 1}"
            parts = split_head(head, unit)
            durations = tuple(durations_of(column_cells))
            duration_column = Column(k + 1, head, *parts, durations)
            if durations and score(SHIFT_TIME, duration_column) > 0.0:
                column_cells = durations
            true_numbers = k + 1 in sheet.true_numbers
            hidden = k + 1 in sheet.hidden_columns
            columns.append(Column(k + 1, head, *parts, column_cells, true_numbers, hidden))
    return tuple(columns)


def _require_width(path: Path, grid: CellGrid, body: Sequence[int], width: int) -> None:
    """Raise DataError for numbers beyond the last name; words there are a column without one."""
    is_wide = grid.numeric[body, width:].any(axis=1)
    if is_wide.any():
        raise DataError(
            f"{path}, row {grid.rows[body[int(is_wide.argmax())]]} has more cells than the {width} "
            "columns of the head; is a decimal comma among them? save it with semicolons between "
            "cells"
        )


def _divided(
    path: Path,
    grid: CellGrid,
    chosen: Sequence[range],
    signs: Collection[str],
    *,
    sums: bool,
) -> Layout:
    """Divide rows into names, units, shifts, and excluded rows with their reasons."""
    is_chosen = [any(number in span for span in chosen) for number in grid.rows]
    heads = [k for k in range([*is_chosen, True].index(True)) if grid.is_head(k)]
    head_place = -1
    if heads:
        head_place = heads[-1] if chosen else heads[0]
    first = head_place + 1 + int(np.argmax(grid.data[head_place + 1 :]))
    first += _is_numbered_head(grid, first)
    names, units, head_places = _head(grid, first)
    questions: list[str] = []
    if chosen:
        body = [k for k in range(first, len(is_chosen)) if is_chosen[k]]
        other_places = np.setdiff1d(np.flatnonzero(grid.data), body)
        excluded_rows = [(grid.rows[k], f"not among {argument('rows')}") for k in other_places]
    else:
        body, words, excluded_rows = _classified_rows(
            path, grid, first, head_places=head_places, heads=heads, signs=signs
        )
        questions = _word_questions(grid, body, words, range(first)) if sums else []
    rows = tuple(grid.raw[k] for k in body)
    return Layout(PLAIN, tuple(names), tuple(units), rows, tuple(excluded_rows), tuple(questions))


def _quoted(text: str) -> str:
    """Quote the text of a row in brackets, shortened; empty for a row without any."""
    return f" ('{shorten(text, QUOTED_LENGTH, placeholder='...')}')" if text else ""


def _classified_rows(
    path: Path,
    grid: CellGrid,
    first: int,
    *,
    head_places: Sequence[int],
    heads: Collection[int],
    signs: Collection[str],
) -> tuple[list[int], list[int], Reasons]:
    """Sort the rows from the place ``first`` on: shifts, words, and excluded rows with reasons.

    Raises DataError where another of the ``heads`` begins a second table.
    """
    excluded_rows = [
        (grid.rows[k], f"stands above the table{_quoted(grid.text_of(k))}")
        for k in range(first)
        if k not in head_places
    ]
    repeated = {grid.cells[k] for k in head_places}
    body: list[int] = []
    words: list[int] = []
    for k in range(first, len(grid.rows)):
        if grid.cells[k] in repeated:
            excluded_rows.append((grid.rows[k], "repeats the head"))
        elif grid.cells[k][0][:1] in signs and grid.cells[k][0]:
            text = grid.text_of(k)
            excluded_rows.append((grid.rows[k], f"is a comment{_quoted(text)}"))
            is_asked = REJECTED.search(text) or has_word(SPLITTING, plain_words(text))
            words += [k] if is_asked and not grid.numeric[k].any() else []
        elif k in heads:
            require_no_blocks(path, grid, [j for j in range(k + 1) if not grid.data[j]])
            answer = rows_argument(f"{grid.rows[first]}-{grid.rows[k - 1]}")
            raise DataError(
                f"{path}: another table begins in row {grid.rows[k]}; save each as a file of its "
                f"own, or name the rows of shifts, such as {answer}"
            )
        elif not grid.numeric[k].any() and not any(map(begins_with_number, grid.cells[k])):
            excluded_rows.append((grid.rows[k], f"has no number ('{_first(grid, k)}')"))
            words.append(k)
        else:
            body.append(k)
    return body, words, excluded_rows


def _first(grid: CellGrid, k: int) -> str:
    return next(filter(None, grid.cells[k]))


def _word_questions(
    grid: CellGrid, body: Sequence[int], words: Sequence[int], head_rows: Sequence[int]
) -> list[str]:
    """Ask about rows of words between the shifts, and about those that reject shifts."""
    inner_words = [k for k in words if body and k < body[-1]]
    rejecting = [
        k
        for k in (*head_rows, *words)
        if k not in inner_words
        and grid.filled[k].sum() < 3
        and REJECTED.search(" ".join(grid.cells[k]))
        and not grid.is_head(k)
    ]
    row_texts = [f"row {grid.rows[k]} '{_first(grid, k)}'" for k in (*inner_words, *rejecting)]
    if not row_texts:
        return []
    span = f"{grid.rows[body[0]]}-{grid.rows[body[-1]]}" if body else "2-41"
    return [
        f"{', '.join(row_texts[:6])}: words that may say that rows are other shifts, or none; name "
        f"the rows of shifts with {rows_example(span)}"
    ]


def _is_numbered_head(grid: CellGrid, first: int) -> bool:
    """Test that the first row of numbers names columns: words above numbers, beside 1, 2, 3."""
    if first + 1 >= len(grid.rows) or not grid.data[first + 1]:
        return False
    words = grid.filled[first] & ~grid.numeric[first] & grid.numeric[first + 1]
    cells = grid.cells[first]
    numbers = [cells[k] for k in np.flatnonzero(grid.numeric[first])]
    counted = numbers == [str(k) for k in range(1, len(numbers) + 1)]
    nameless = ~grid.filled[first] & grid.numeric[first + 1]
    if counted and nameless.any() and grid.is_head(first - 1):
        return True
    if not words.any() or any(
        begins_with_number(cells[k]) or is_blank(cells[k]) for k in np.flatnonzero(words)
    ):
        return False
    return counted and named_needs(_head(grid, first)[0]) < 2


def _head(grid: CellGrid, first: int) -> tuple[list[str], list[str], list[int]]:
    """Read names and units above the first row of numbers, with the places of their rows.

    Comments are names where nothing else is. A name that is empty, only a number, or the end of a
    word that is divided by a hyphen is completed by the row above.
    """
    numbered = first - 1 if first and grid.data[first - 1] else -1
    near_rows = [k for k in range(max(0, first - HEADS), first) if grid.filled[k].sum() > 1]
    zone = [
        k for k in near_rows if (not grid.data[k] or k == numbered) and not grid.comment[k]
    ] or near_rows
    rows = [[cell.lstrip(MARKS + " ") or cell for cell in grid.cells[k]] for k in zone]
    blank = [""] * grid.filled.shape[1]
    has_units = len(rows) > 1 and _are_units(rows[-1], rows[-2])
    units, head_places = (rows.pop(), zone[-2:]) if has_units else (blank, zone[-1:])
    names = rows[-1] if rows else blank
    if len(rows) > 1 and (numbered in zone or _is_divided(rows[-2], names)):
        names = _completed_names(rows[-2], names)
        head_places = zone[-len(head_places) - 1 :]
    width = 1 + int(np.flatnonzero(grid.filled[[*head_places, first]].any(axis=0))[-1])
    return names[:width], units[:width], head_places


def _is_divided(upper_row: Cells, names: Cells) -> bool:
    """Test that words of the row above go on in the row of names."""
    return any(
        upper.endswith("-") and lower[:1].islower()
        for upper, lower in zip(upper_row, names, strict=True)
    )


def _completed_names(upper_row: Cells, names: Cells) -> list[str]:
    """Join names with those above them; a number gets the last name to its left."""
    completed, latest = [], ""
    for upper, lower in zip(upper_row, names, strict=True):
        latest = upper or latest
        if lower.isdecimal():
            completed.append(f"{latest} {lower}".strip())
        elif upper.endswith("-") and lower[:1].islower():
            completed.append(upper[:-1] + lower)
        else:
            completed.append(lower or upper)
    return completed


def _are_units(row: Cells, upper_row: Cells) -> bool:
    is_unit = [bool(unit_named(cell.strip("[]() "))) for cell in row]
    words = any(c.strip("[]()-1 ") and not unit for c, unit in zip(row, is_unit, strict=True))
    return sum(map(bool, map(unit_named, upper_row))) < sum(is_unit) and (
        sum(is_unit) >= 2 or not words
    )


def _summaries(grid: CellGrid, body: list[int], questions: Reasons) -> Reasons:
    """Find rows that summarise those above them, and ask about words in place of numbers."""
    firsts = {k: _first(grid, k) for k in body}
    statistic_rows = [k for k, word in firsts.items() if _STATISTIC.fullmatch(word)]
    reasons = [
        (grid.rows[k], f"statistic of the rows above ('{firsts[k]}')") for k in statistic_rows
    ]
    body = [k for k in body if k not in statistic_rows]
    values = np.ma.masked_invalid([numbers_of(grid.cells[k]) for k in body])
    for size in (2, 1):  # a sum and a mean, or one of them
        if len(body) > size + 2 and all(_is_statistic(values[:-size], v) for v in values[-size:]):
            reasons += [(grid.rows[k], "sum or mean of the rows above") for k in body[-size:]]
            body = body[:-size]
            break
    return reasons + _foot_words(grid, body, questions)


def _foot_words(grid: CellGrid, body: Sequence[int], questions: Reasons) -> Reasons:
    """Find rows at the foot with a word in a column of numbers; ask about those before."""
    reasons: Reasons = []
    place = int(grid.filled[body].any(axis=0).argmax()) if body else 0
    number = grid.numeric[body][:, place] if body else np.zeros(0)
    if all(2 * part.sum() <= len(part) for part in (number, number[: len(body) // 2 + 1])):
        return reasons  # words or codes name the rows
    last = body[int(np.flatnonzero(number)[-1])]
    for k in body:
        word = grid.cells[k][place]
        if grid.numeric[k, place]:
            continue
        if word and k > last:
            reasons.append((grid.rows[k], f"word where other rows have a number ('{word}')"))
        elif not re.search(r"\d", word):  # a code such as 2b
            questions.append(
                (
                    place + 1,
                    f"row {grid.rows[k]} has '{word}' where other rows have a number; "
                    f"correct it, or name the rows of shifts with {rows_example('2-41')}",
                )
            )
    return reasons


def _is_statistic(values: np.ma.MaskedArray, row: np.ma.MaskedArray) -> bool:
    """Test that a row is sum or mean of those above it, in two columns that are not constant."""
    filled = ~np.ma.getmaskarray(row)
    statistics = values[:, filled].mean(axis=0), values[:, filled].sum(axis=0)
    is_equal = any(
        np.ma.allclose(value, row[filled], rtol=ROUNDED, atol=0.0) for value in statistics
    )
    return bool(is_equal and (np.ma.ptp(values[:, filled], axis=0) > 0.0).sum() > 1)
