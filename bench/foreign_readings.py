"""Readings of a foreign table: the values of its quantities, in the project's units.

Last step of reading. Faults of all columns are collected and raised together.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from dogshape.bench.cell_values import (
    ANSWERS,
    CURRENT,
    FORCE,
    NAMES,
    PRESSURE,
    SPEED,
    TIME,
    UNITS,
    VOLTAGE,
    Column,
    Unit,
    answer_of,
    decimal_sign,
    is_blank,
    is_date,
    is_number,
    numbers_of,
    split_quantity,
    stamps_of,
    unit_named,
    unit_with_factor,
)
from dogshape.bench.column_options import PURE_NUMBER, Match
from dogshape.bench.draft_arguments import NONE, column_argument, no_column
from dogshape.bench.foreign_columns import matched
from dogshape.bench.foreign_table import REPEATS, TRANSPOSED, ForeignTable
from dogshape.bench.quantities import (
    SHIFTS,
    WORD,
    TableQuantity,
    counts_up,
    grows,
    plain_words,
    score,
)
from dogshape.bench.raw_sheet import CellNote
from dogshape.bench.reading_report import ColumnReading, Exclusion, ReadingReport
from dogshape.bench.repeats import with_repeats
from dogshape.bench.row_marks import RowChoice, RowPlan, chosen_rows, row_plan
from dogshape.bench.row_splits import with_lists, with_shares
from dogshape.bench.table_shapes import side_question
from dogshape.sim.elementwise import Array
from dogshape.sim.errors import DataError, InputError, number
from dogshape.sim.interface import argument

MAX_CELL_CHARACTERS = 40  #: characters of a cell that a sentence shows
MAX_LISTED = 12  #: faults of one kind that are listed one by one
#: Factor between values of one column from which two units are likely.
MIXED_UNITS = {"force_N": 100.0, "supply_bar": 100.0, "shift_time_s": 300.0}
#: Quantities of which a merged cell would repeat a result, not a set value.
RESULTS = ("shift_time_s", "shift_time_sd_s", "n_shifts")
SENTENCES = {
    TRANSPOSED: "the table is transposed: its columns are the rows of shifts, numbered from 1",
    REPEATS: "each cell of the columns of repeats is a shift of its own",
}
Values = list[Any]  #: a value for each row, None where there is none


class TableReader:
    """Convert the columns of one table; ``report`` collects faults and records."""

    def __init__(
        self,
        table: ForeignTable,
        quantities: Sequence[TableQuantity],
        options: Mapping[str, str],
        decimal: str | None,
        report: ReadingReport,
        *,
        choice: RowChoice | None = None,
    ) -> None:
        """Match columns, choose rows, and decide on the decimal sign.

        ``decimal`` is that of the user, ``choice`` what the user has said of rows.
        """
        self.quantities, self.report, self.choice = quantities, report, choice or RowChoice()
        self.table, self.sign = table, decimal
        self.is_decimal_open = False
        self.plan = RowPlan(table.rows, ())
        questions: list[str] = []
        settled = frozenset[str]()
        if quantities is SHIFTS:
            settled, options, questions = self._choose_rows(options)
        self.matching = matched(self.table.columns, quantities, options)
        if quantities is SHIFTS:
            self._drop_empty_rows(options)
            settled |= _left_out_by_user(self.table, options)
            read = self.matching.columns
            self.plan = row_plan(self.table, read, self.choice, settled)
        self.matches = {match.quantity.name: match for match in self.matching.matches}
        read = self.matching.columns
        if self.plan.share is not None and read.get(self.plan.share) == "engaged":
            del self.matches["engaged"]
        questions += [*self.matching.questions, *self.plan.questions]
        # A word among numbers that are read anyway is a fault of their column.
        places = {column.place for column, name in read.items() if name != "order"}
        words = [text for place, text in self.table.place_questions if place not in places]
        faults = [*words, *questions, *self._cell_faults(read), *self._find_sign(decimal, read)]
        self._record_faults(faults, read)

    def _choose_rows(
        self, options: Mapping[str, str]
    ) -> tuple[frozenset[str], Mapping[str, str], list[str]]:
        """Apply the user's answers on rows, and reshape repeats.

        Returns the columns that the answers settle, options of columns, and questions.
        """
        questions: list[str] = []
        settled = frozenset[str]()
        try:
            self.table, settled = chosen_rows(self.table, self.choice)
        except InputError as error:
            questions.append(str(error))
        stated = set(options)
        self.table, options, repeat_questions = with_repeats(self.table, options)
        if not repeat_questions and self.table.layout.name != REPEATS:
            self.table, options = with_lists(self.table, options)
        self.table, options, faults = with_shares(self.table, options)
        settled |= frozenset(column.head for column in self.table.columns if column.is_outcome)
        questions += faults
        needed = {quantity.name for quantity in SHIFTS if quantity.needed}
        side_text = "" if needed <= stated else side_question(self.table.columns)
        return settled, options, [*questions, *repeat_questions, *filter(None, [side_text])]

    def _drop_empty_rows(self, options: Mapping[str, str]) -> None:
        """Leave rows out that have no cell in the columns that are read."""
        rows = self.table.rows
        read = self.matching.columns
        full = [k for k in range(len(rows)) if any(column.cells[k] for column in read)]
        if 0 < len(full) < len(rows):
            empty = [row for k, row in enumerate(rows) if k not in full]
            reasons = [(row, "empty in the columns of the shifts") for row in empty]
            self.table = self.table.taking(full, reasons)
            self.matching = matched(self.table.columns, self.quantities, options)

    def _find_sign(self, decimal: str | None, read: Mapping[Column, str]) -> list[str]:
        """Determine the decimal sign of texts; return a fault for an ambiguous one."""
        cells = {
            column.head: [split_quantity(cell)[0] for cell in self._plain_cells(column)]
            for column in read
            if not column.is_dated and not column.true_numbers
        }
        table = self.table
        try:
            self.sign = decimal_sign(
                cells, table.rows, decimal or table.stated, table.sheet.separator
            )
        except DataError as error:
            self.is_decimal_open = True
            return [str(error)]
        return []

    def _record_faults(self, faults: Sequence[str], read: Mapping[Column, str]) -> None:
        file, table, report = str(self.table.path), self.table, self.report
        report.faults += [f"{file}: {fault}" for fault in faults]
        report.left_out += [Exclusion(file, why, row=number) for number, why in table.left_out]
        report.left_out += [Exclusion(file, why, column=head) for head, why in table.summaries]
        report.left_out += [
            Exclusion(file, _reason(column), column=column.head)
            for column in table.columns
            if column not in read
        ]
        if table.layout.name in SENTENCES:
            report.assumed.append(f"{file}: {SENTENCES[table.layout.name]}")
        report.assumed += [f"{file}: {remark}" for remark in table.sheet.remarks]
        merged = [note for note in table.sheet.merged if note.row in table.rows]
        if merged:
            report.assumed.append(
                f"{file}: merged cells hold for all their rows ({len(merged)} cells)"
            )

    def _plain_cells(self, column: Column) -> list[str]:
        """Give the cells of a column, empty for those that have a note."""
        noted = {note.row for note in self.table.sheet.notes if note.place == column.place}
        rows = self.table.rows
        return ["" if row in noted else cell for row, cell in zip(rows, column.cells, strict=True)]

    def _cell_faults(self, read: Mapping[Column, str]) -> list[str]:
        """Describe the unreadable cells of a workbook, a sentence for each column."""
        sheet, rows = self.table.sheet, set(self.table.rows)
        missing = any(q.needed and q.name not in self.matches for q in self.quantities)
        heads = {
            column.place: column.head for column in self.table.columns if column in read or missing
        }
        results = {column.place for column, name in read.items() if name in RESULTS}
        sentences = [(note, note.sentence) for note in sheet.notes if note.place in heads]
        sentences += [
            (note, f"{note.sentence}, one result for several rows; write a value into each row")
            for note in sheet.merged
            if note.place in results
        ]
        groups: dict[int, list[tuple[CellNote, str]]] = {}
        for note, sentence in sentences:
            if note.row in rows:
                groups.setdefault(note.place, []).append((note, sentence))
        faults = []
        for place, cells in groups.items():
            first, sentence = cells[0]
            other_rows = ", ".join(str(note.row) for note, _ in cells[1:MAX_LISTED])
            likewise = f"; likewise row {other_rows}" if other_rows else ""
            faults.append(f"row {first.row}, column '{heads[place]}': {sentence}{likewise}")
        return faults

    def lines(self) -> Iterator[tuple[str, str]]:
        """Describe the steps of reading, pairs of a step and a line."""
        table = self.table
        yield from (("raw sheet", line) for line in table.sheet.lines())
        yield from (("layout", line) for line in table.layout.lines())
        yield from (("columns and units", line) for line in self.matching.lines())
        yield from (("rows and marks", line) for line in self.plan.lines())

    def _fault(self, match: Match, text: str) -> None:
        place = f"{self.table.path}, column '{match.head}' ({match.quantity.name})"
        self.report.faults.append(f"{place} {text}")

    def _rows(self, cells: Sequence[Any], wrong: Sequence[bool]) -> str:
        rows = [
            f"row {row}: '{str(cell)[:MAX_CELL_CHARACTERS]}'"
            for row, cell, is_wrong in zip(self.table.rows, cells, wrong, strict=True)
            if is_wrong
        ]
        remainder = f" and {len(rows) - MAX_LISTED} more" if len(rows) > MAX_LISTED else ""
        return ", ".join(rows[:MAX_LISTED]) + remainder

    def _record(self, match: Match, values: Values, reason: str, unit: str = "") -> Values:
        """Record how values were read, and return them."""
        entries = [value for value in values if value is not None]
        numbers = [value for value in entries if isinstance(value, float)]
        cells = [cell for column, _ in match.terms for cell in column.cells] if numbers else []
        signed = self.sign and any(self.sign in cell for cell in cells)
        self.report.readings.append(
            ColumnReading(
                file=str(self.table.path),
                quantity=match.quantity.name,
                column=match.head,
                unit=unit or None,
                decimals=NAMES[str(self.sign)] if signed else None,
                first=next(iter(entries), None),
                least=min(numbers, default=None),
                largest=max(numbers, default=None),
                why=f"{match.why}; {reason}".rstrip("; "),
            )
        )
        return values

    def read(self) -> dict[str, Values]:
        """Read all quantities, (rows,) each; None for an empty cell or a missing column.

        Numbers are in the project's unit; cells that cannot be read are a fault.
        """
        ways = {
            "n_shifts": self._counts,
            "engaged": self._answers,
            "timestamp": self._stamps,
            "trace": self._texts,
        }
        return {
            q.name: ways.get(q.name, self._numbers)(self.matches[q.name])
            if q.name in self.matches
            else [None] * len(self.table.rows)
            for q in self.quantities
        }

    def _numbers(self, match: Match) -> Values:
        """Convert a column, a formula of columns, or a constant; None for empty cells."""
        import pandas as pd  # noqa: PLC0415  # slow to load

        if not match.terms:
            return self._record(match, [float(match.formula)] * len(self.table.rows), "")
        terms = [self._term(match, column, unit) for column, unit in match.terms]
        frame = pd.DataFrame({f"c{k}": values for k, (values, _) in enumerate(terms)})
        try:
            values = pd.to_numeric(frame.eval(match.formula)).replace([np.inf, -np.inf], np.nan)
        except Exception:  # what it raises depends on the text
            values = np.nan * frame["c0"]
        if match.formula != "c0" and not values.notna().any():
            self._fault(
                match,
                f"is no formula of its columns ({match.why}); write columns, numbers, + - * / and "
                "brackets, for instance 'n_out - n_in' or '-1 * n_in'",
            )
        # A factor such as 1e-3 adds a last digit to that of the cell.
        done = [float(f"{v:.15g}") if math.isfinite(v) else None for v in values]
        self._question_units(match, done)
        units = ", ".join(dict.fromkeys(unit.text for _, unit in terms if unit and unit.text))
        declared = zip(terms, match.terms, strict=True)
        sized = any(
            unit and unit.text in UNITS and not stated for (_, unit), (_, stated) in declared
        )
        return self._record(match, done, f"{units} by its size" if sized else "", units)

    def _question_units(self, match: Match, values: Values) -> None:
        """Ask about values so far apart that two units may stand in one column."""
        limit = MIXED_UNITS.get(match.quantity.name)
        sizes = [(value, k) for k, value in enumerate(values) if value is not None and value > 0.0]
        if (
            self.is_decimal_open
            or limit is None
            or self.quantities is not SHIFTS
            or match.stated
            or len(sizes) < 2
        ):
            return
        (smallest, low), (largest, high) = min(sizes), max(sizes)
        if largest < limit * smallest:
            return
        cells, rows = match.column.cells, self.table.rows
        answer = column_argument(match.quantity.name, f"{match.head}:UNIT")
        self._fault(
            match,
            f"has '{cells[low]}' (row {rows[low]}) beside '{cells[high]}' (row "
            f"{rows[high]}), {number(round(largest / smallest))} times as much: two units in "
            f"one column? correct the cells, or say {answer} where all have one unit",
        )

    def _term(self, match: Match, column: Column, unit: Unit | None) -> tuple[Array, Unit | None]:
        """Read a column in the project's unit, (rows,); NaN for a cell without a number."""
        quantity = match.quantity
        cells = self._filled_down(match, column)
        values, factors = self._cell_numbers(match, column, cells, unit)
        empty = np.array([is_blank(cell) for cell in cells])
        noted = [
            not plain and bool(cell)
            for plain, cell in zip(self._plain_cells(column), column.cells, strict=True)
        ]
        if (bad := np.isnan(values) & ~empty & ~np.array(noted)).any():
            wrong = [cell for cell, is_bad in zip(cells, bad, strict=True) if is_bad]
            rows = self._rows(cells, bad.tolist())
            self._fault(match, f"must hold numbers, but has {rows}; {_remedy_of(wrong)}")
        if empty.any() and quantity.filled:
            rows = ", ".join(map(str, np.array(self.table.rows)[empty][:MAX_LISTED]))
            fill_down = argument("fill_down", value=True)
            remedy = f", or say {fill_down} where the value above holds for them"
            self._fault(
                match,
                f"is empty in row {rows}; fill the cells or remove the rows"
                f"{remedy if not empty[0] else ''}",
            )
        finite_values = values[np.isfinite(values)]
        if quantity.dimension is None or not finite_values.size or unit is PURE_NUMBER:
            return values, unit
        if np.isfinite(factors).any():
            texts = (unit_of.text for _, unit_of in map(split_quantity, cells) if unit_of)
            units = f"{', '.join(dict.fromkeys(texts))} in its cells"
            return values * factors, Unit(units, str(quantity.dimension), math.nan)
        if unit is None or np.isnan(unit.factor):
            unit = self._guessed_unit(match, column, unit, finite_values)
        return values * (unit.factor if unit else 1.0), unit

    def _filled_down(self, match: Match, column: Column) -> list[str]:
        """Fill empty set values from the row above, if the user chose it."""
        cells = [*column.cells]
        if not self.choice.fill_down or not match.quantity.filled:
            return cells
        for k in range(1, len(cells)):
            cells[k] = cells[k] or cells[k - 1]
        filled = sum(bool(new) and not old for new, old in zip(cells, column.cells, strict=True))
        if filled:
            self.report.assumed.append(
                f"{self.table.path}: {filled} empty cells of '{column.head}' have the value above"
            )
        return cells

    def _cell_numbers(
        self, match: Match, column: Column, cells: Sequence[str], unit: Unit | None
    ) -> tuple[Array, Array]:
        """Read numbers, and factors to the project's unit of cells that have a unit, (rows,)."""
        pairs = [split_quantity(cell) for cell in cells]
        sign = "." if column.true_numbers else self.sign
        values = numbers_of([text for text, _ in pairs], sign)
        factors = np.array([cell_unit.factor if cell_unit else np.nan for _, cell_unit in pairs])
        dimension = match.quantity.dimension
        wrong = [
            cell_unit is not None
            and (cell_unit.dimension != dimension or (unit is not None and unit.factor != factor))
            for (_, cell_unit), factor in zip(pairs, factors, strict=True)
        ]
        is_bare = [cell_unit is None and is_number(text) for text, cell_unit in pairs]
        if any(wrong):
            self._fault(
                match,
                f"has another unit in {self._rows(cells, wrong)}; correct the cells or the head",
            )
        elif np.isfinite(factors).any() and any(is_bare) and unit is None:
            self._fault(
                match,
                f"has no unit in {self._rows(cells, is_bare)}, but other cells have "
                "one; write it into each",
            )
        elif unit is not None:
            factors = np.where(
                np.isfinite(factors).any() & np.isfinite(values), unit.factor, np.nan
            )
        return values, factors

    def _guessed_unit(
        self, match: Match, column: Column, unit: Unit | None, values: Array
    ) -> Unit | None:
        """Ask for a unit that is unknown, or guess the one that is not there by its size."""
        quantity = match.quantity
        answer = column_argument(quantity.name, f"{column.head}:UNIT")
        angular = re.search("omega|angular|winkel", plain_words(column.name))
        mismatch = quantity.name == "mismatch_rpm" and match.formula == "c0"
        if unit is None and mismatch and abs(values).max() < 1.0:
            self._fault(
                match,
                f"has no unit and no value of 1 or more, as a ratio has; say {answer}, or "
                "multiply it by the speed of the shaft",
            )
            return None
        if unit is None and not column.strange and not angular:
            text = _usual_unit(quantity, values)
            self.report.assumed.append(
                f"{self.table.path}: '{column.head}' ({quantity.name}) has no unit and is taken as "
                f"{text} by its size; {answer} says another"
            )
            return unit_named(text)
        spelling = unit.text if unit else column.strange or ""
        scaled = unit_with_factor(spelling)
        if unit is None and scaled and scaled.dimension == quantity.dimension:
            multiple = column_argument(quantity.name, f"{column.head}:{spelling}")
            self._fault(
                match,
                f"has the unit '{spelling}': say {multiple} where its numbers count so many of "
                f"it, or {answer}",
            )
            return None
        ambiguity = "ambiguous (revolutions or radians)"
        if quantity.dimension != SPEED or (unit is None and not angular):
            ambiguity = "unknown"
        called = f"the unit '{spelling}', which is" if spelling else "a unit that is"
        self._fault(match, f"has {called} {ambiguity}; say {answer} with one of {quantity.units}")
        return None

    def _counts(self, match: Match) -> Values:
        """Read the number of shifts of each row, a whole number of at least 1."""
        values = self._numbers(match)
        if any(wrong := [v is not None and (v < 1 or v % 1 > 0) for v in values]):
            bad = self._rows([v and number(v) for v in values], wrong).replace("'", "")
            self._fault(match, f"must be whole numbers of at least 1, but {bad}; correct them")
        return values

    def _texts(self, match: Match) -> Values:
        return self._record(match, [cell or None for cell in match.column.cells], "")

    def _answers(self, match: Match) -> Values:
        """Convert answers to yes and no; an option, ``gut=yes,empty=no``, prevails."""
        cells = [answer_of(cell) for cell in match.column.cells]
        pairs = (pair.split("=", 1) for pair in match.option.split(",") if "=" in pair)
        stated = {answer_of(word): answer_of(answer) for word, answer in pairs}
        counts = Counter(cells)
        values = {w: ANSWERS[stated.get(w, w)] for w in counts if stated.get(w, w) in ANSWERS}
        if strange := [word for word in counts if word not in values]:
            bad = self._rows(cells, [cell in strange for cell in cells])
            answer = column_argument("engaged", f"{match.head}:{strange[0]}=yes,empty=no")
            self._fault(
                match,
                f"must be yes, no or empty, but {bad}; write true or false, or say {answer}, or "
                f"{no_column('engaged')} to leave it out",
            )
        names = {True: "yes", False: "no", None: "not said"}
        read = ", ".join(f"{word} = {names[values.get(word)]} ({n})" for word, n in counts.items())
        return self._record(match, [values.get(cell) for cell in cells], read)

    def _stamps(self, match: Match) -> Values:
        """Read numbers with a unit in s, and dates as ISO 8601."""
        column, unit = match.terms[0]
        cells = [cell for cell in column.cells if not is_blank(cell)]
        try:
            if unit is not None and all(map(is_number, cells)):
                moments = [f"{v:.12g}" for v in unit.factor * numbers_of(cells, self.sign)]
                way = "seconds"
            else:
                moments, way = stamps_of(cells, "" if unit else match.option)
        except DataError as error:
            answer = column_argument("timestamp", f"{match.head}:s")
            self._fault(
                match,
                f"{error}, or say {answer} for numbers of seconds, or {no_column('timestamp')} to "
                "leave it out",
            )
            return [None] * len(column.cells)
        stamps = iter(moments)
        values = [None if is_blank(cell) else next(stamps) for cell in column.cells]
        return self._record(match, values, way, unit.text if unit else "")


def _left_out_by_user(table: ForeignTable, options: Mapping[str, str]) -> frozenset[str]:
    """Name the columns of quantities that the user leaves out."""
    left_out = [q for q in SHIFTS if options.get(q.name) == NONE]
    return frozenset(c.head for c in table.columns for q in left_out if score(q, c) >= WORD)


def _usual_unit(quantity: TableQuantity, values: Array) -> str:
    """Guess the unit of numbers by their size."""
    # A recorder's clock may begin anywhere: the length of a trace decides.
    middle = np.median(abs(values - (values.min() if quantity.name == "t_s" else 0.0)))
    return {
        TIME: "ms" if middle > 5.0 else "s",
        FORCE: "kN" if middle < 5.0 else "N",
        SPEED: "1/min",
        PRESSURE: "bar",
        VOLTAGE: "V",
        CURRENT: "A",
    }.get(str(quantity.dimension), "mm")


def _remedy_of(cells: Sequence[str]) -> str:
    """Choose the remedy for cells that are no numbers."""
    if any("±" in cell or "+-" in cell or "+/-" in cell for cell in cells):
        return "write what stands behind ± into a column of its own, named standard deviation"
    if any(re.search(r"\d\s*[,;/|]\s+\d", cell) for cell in cells):
        return "write each shift into a row of its own"
    if any(re.match(r"[<>≤≥]\s*\d", cell) for cell in cells):
        return (
            "empty the cells and write no into a column engaged where these shifts did not engage, "
            "or write the times"
        )
    if any(map(is_date, cells)):
        return "a spreadsheet may have taken numbers for dates: enter the numbers again"
    return "correct or empty the cells"


def _reason(column: Column) -> str:
    """Give the reason for which a column is no quantity."""
    if column.hidden:
        return "hidden in the workbook"
    if counts_up(column):
        answer = column_argument("order", column.head)
        return f"numbers the rows; {answer} takes it as order of the shifts"
    if column.is_dated or (column.unit and column.unit.dimension == TIME and grows(column)):
        answer = column_argument("timestamp", column.head)
        return f"clock; {answer} takes it as times of the shifts"
    return "no quantity of this name" if any(column.cells) else "empty"
