"""Values of a foreign table in the project's units, and a record of how each column was read."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import compress
from typing import Any

import numpy as np

from dogshape.diagnosis.bench.foreign_columns import (
    Match,
    Quantity,
    Term,
    counts_up,
    grows,
    matched,
    plain_words,
)
from dogshape.diagnosis.bench.foreign_table import Column, ForeignTable
from dogshape.diagnosis.bench.measured_units import FORCE, SPEED, TIME, Unit, unit_named
from dogshape.diagnosis.bench.time_stamps import is_dated, stamps_of
from dogshape.diagnosis.bench.written_numbers import Decimals, are_numbers, decimals_of
from dogshape.diagnosis.terms import Array
from dogshape.sim.errors import DataError, number
from dogshape.sim.texts import listed

NOTHING = frozenset(("", "-", "--", "n/a", "na", "nan", "#n/a", "none", "null", "k.a.", "#nv"))
YES = ("true", "yes", "ja", "1", "ok", "i.o.", "io", "i.o", "wahr", "x", "engaged", "y", "j", "oui",
       "si", "sí", "ano", "tak", "pass", "passed", "✓", "✔")  # fmt: skip
NO = ("false", "no", "nein", "0", "nok", "n.i.o.", "nio", "n.i.o", "falsch", "failed", "fail", "n",
      "non", "ne", "nie", "✗", "✘")  # fmt: skip
ANSWERS = {**dict.fromkeys(NOTHING), "unknown": None, **dict.fromkeys(YES, True),
           **dict.fromkeys(NO, False)}  # fmt: skip
MOST = 12  #: faults of one kind that are listed one by one
Values = list[Any]  #: a value for each row, None where there is none


@dataclass
class Report:
    """Faults and questions, assumptions, readings, and what was left out with the reason."""

    faults: list[str] = field(default_factory=list)
    assumed: list[str] = field(default_factory=list)
    left_out: list[dict[str, Any]] = field(default_factory=list)
    readings: list[dict[str, Any]] = field(default_factory=list)

    def require(self, where: str) -> None:
        """Raise DataError with all faults, if there are any."""
        faults = list(dict.fromkeys(self.faults))
        if faults:
            raise DataError(listed(where, faults) if len(faults) > 1 else faults[0])


@dataclass
class TableReader:
    """Convert the columns of one table; ``report`` collects faults and records."""

    table: ForeignTable
    matches: Mapping[str, Match]
    decimals: Decimals
    report: Report

    @classmethod
    def of(
        cls, table: ForeignTable, quantities: Sequence[Quantity], said: Mapping[str, str],
        decimal: str | None, report: Report,
    ) -> TableReader:  # fmt: skip
        """Match the columns of a table and decide on its decimal sign."""
        found, faults = matched(table.columns, quantities, said)
        used = {t.column.place: t.column for m in found for t in m.terms}
        # A word among numbers that are read anyway is a fault of their column.
        read = {t.column.place for m in found for t in m.terms if m.quantity.name != "order"}
        faults = [text for place, text in table.questions if place not in read] + faults
        decimals, stated = Decimals(decimal), decimal or table.stated
        cells = {c.head: c.cells for c in used.values() if not is_dated(c.cells)}
        try:
            decimals = decimals_of(cells, table.rows, stated, table.separator)
        except DataError as error:
            faults.append(str(error))
        file = str(table.path)
        report.faults += [f"{file}: {fault}" for fault in (*faults, *decimals.questions)]
        report.left_out += [{"file": file, "row": n, "reason": why} for n, why in table.left_out]
        report.left_out += [{"file": file, "column": c.head, "reason": _reason(c)}
                            for c in table.columns if c.place not in used]  # fmt: skip
        return cls(table, {m.quantity.name: m for m in found}, decimals, report)

    def _fault(self, match: Match, text: str) -> None:
        where = f"{self.table.path}, column '{match.head}' ({match.quantity.name})"
        self.report.faults.append(f"{where} {text}")

    def _rows(self, cells: Sequence[Any], wrong: Sequence[bool]) -> str:
        """List cells that are wrong with their rows, the first of many."""
        bad = [f"row {n}: '{cell}'" for n, cell in
               compress(zip(self.table.rows, cells, strict=True), wrong)]  # fmt: skip
        more = f" and {len(bad) - MOST} more" if len(bad) > MOST else ""
        return ", ".join(bad[:MOST]) + more

    def _record(self, match: Match, values: Values, why: str, unit: str | None = None) -> None:
        """Record how a quantity was read: first, least and largest of known ``values``."""
        numbers = [rounded(v) for v in values if isinstance(v, float)]
        cells = [cell for t in match.terms for cell in t.column.cells] if numbers else []
        self.report.readings.append({
            "file": str(self.table.path), "quantity": match.quantity.name, "column": match.head,
            "unit": unit, "decimals": self.decimals.named(cells),
            "first": next(iter(numbers or values), None), "least": min(numbers, default=None),
            "largest": max(numbers, default=None), "why": why,
        })  # fmt: skip

    def values(self, match: Match, *, needed: bool = False) -> Array:
        """Convert a column, or a formula of columns, to the project's unit; NaN for empty cells.

        Cells without a number are a fault, empty cells of a ``needed`` column too.
        """
        whole: dict[str, Any] = {}
        units, whys = [], [match.why]
        for place, term in enumerate(match.terms):
            values = self._cells(match, term.column.cells, needed)
            unit, why = self._unit(match, term, values[np.isfinite(values)])
            whole[f"c{place}"] = values * (1.0 if unit is None else unit.factor)
            units += [unit.text] if unit else []
            whys += [why] if why else []
        try:
            with np.errstate(all="ignore"):
                values = eval(match.formula or "c0", {"__builtins__": {}}, whole)
        except (SyntaxError, TypeError):
            values = whole["c0"] * np.nan
        known = values[np.isfinite(values)]
        if match.formula and not known.size:
            self._fault(match, f"is no formula ({match.why}); write for instance 'n_out - n_in'")
        ends = [*known[:1].tolist(), known.min(), known.max()] if known.size else []
        self._record(match, ends, "; ".join(whys), ", ".join(dict.fromkeys(units)) or None)
        return np.where(np.isfinite(values), values, np.nan)

    def numbers(self, name: str, *, needed: bool = False) -> Values:
        """Convert a column as ``values`` does, None for empty cells or no such column."""
        if name not in self.matches:
            return [None] * len(self.table.rows)
        values = self.values(self.matches[name], needed=needed).tolist()
        return [rounded(one) if math.isfinite(one) else None for one in values]

    def _cells(self, match: Match, cells: Sequence[str], needed: bool) -> Array:
        """Read the numbers of a column, NaN where there is none, (rows,)."""
        values = self.decimals.values(cells)
        if np.isfinite(values).all():
            return values
        empty = [cell.lower() in NOTHING for cell in cells]
        bad = [not (known or none) for known, none in zip(are_numbers(cells), empty, strict=True)]
        if any(bad):
            listed = self._rows(cells, bad)
            self._fault(match, f"must hold numbers, but {listed}; correct or empty the cells")
        if any(empty) and needed:
            rows = ", ".join(map(str, list(compress(self.table.rows, empty))[:MOST]))
            self._fault(match, f"is empty in row {rows}; fill the cells or remove the rows")
        return values

    def _unit(self, match: Match, term: Term, values: Array) -> tuple[Unit | None, str]:
        """Give the unit of a column, and the reason where its head has none, or ask for it."""
        quantity, column, unit = match.quantity, term.column, term.unit
        option = f"--column {quantity.name}='{column.head}:"
        if (unit is not None and not np.isnan(unit.factor)) or quantity.dimension is None:
            return unit, ""
        angular = re.search(r"omega|angular|winkel", plain_words(column.name))
        if unit or (quantity.dimension == SPEED and angular and not column.strange):
            text = f"in '{unit.text}'" if unit else "without a unit"
            self._fault(
                match, f"is a speed {text}, in revolutions or radians; say {option}1/min', "
                f"{option}rev/s' or {option}rad/s'",
            )  # fmt: skip
        elif column.strange:
            self._fault(
                match, f"has the unit '{column.strange}', which is not known; say {option}UNIT' "
                f"with one of {quantity.units}",
            )  # fmt: skip
        elif values.size:
            # A recorder's clock may begin anywhere: the length of a trace decides.
            middle = np.median(abs(values - (values.min() if quantity.name == "t_s" else 0.0)))
            text = {TIME: "ms" if middle > 5.0 else "s", FORCE: "kN" if middle < 5.0 else "N",
                    SPEED: "1/min"}.get(quantity.dimension, "mm")  # fmt: skip
            self.report.assumed.append(
                f"{self.table.path}: '{column.head}' ({quantity.name}) has no unit and is taken as "
                f"{text} by its size; {option}UNIT' says another"
            )
            return unit_named(text), f"{text} by its size"
        return None, ""

    def counts(self) -> list[int]:
        """Read the number of shifts of each row, a whole number of at least 1; 1 where none is."""
        match, values = self.matches.get("n_shifts"), self.numbers("n_shifts")
        if match is None:
            self.report.assumed.append(
                f"{self.table.path}: each row is one shift, as no column counts them"
            )
        elif any(wrong := [v is not None and (v < 1 or v % 1 > 0) for v in values]):
            bad = self._rows([v and number(v) for v in values], wrong).replace("'", "")
            self._fault(match, f"must be whole numbers of at least 1, but {bad}; correct them")
        return [max(1, round(value or 1)) for value in values]

    def texts(self, name: str) -> list[str]:
        """Read a column as it stands."""
        match = self.matches.get(name)
        if match is None:
            return [""] * len(self.table.rows)
        cells = match.terms[0].column.cells
        self._record(match, list(filter(None, cells)), match.why)
        return list(cells)

    def answers(self) -> list[bool | None]:
        """Read a column of yes and no, None where it does not say.

        An option such as ``gut=yes,empty=no`` goes first.
        """
        match = self.matches.get("engaged")
        if match is None:
            return [None] * len(self.table.rows)
        column = match.terms[0].column
        option = f"--column engaged='{column.head}:"
        cells = ["empty" if c.lower() in NOTHING else c.lower() for c in column.cells]
        often = Counter(cells)
        said = dict(pair.lower().split("=", 1) for pair in match.option.split(",") if "=" in pair)
        words = {word: said.get(word, "" if word == "empty" else word) for word in often}
        values = {word: ANSWERS[other] for word, other in words.items() if other in ANSWERS}
        strange = [word for word in often if word not in values]
        if strange and not match.given and set(values.values()) <= {None}:
            why = f"its words are neither yes nor no; {option}{strange[0]}=yes' says so"
            self.report.left_out.append(
                {"file": str(self.table.path), "column": column.head, "reason": why}
            )
            return [None] * len(cells)
        if strange:
            bad = self._rows(cells, [cell in strange for cell in cells])
            self._fault(
                match, f"must be yes, no or empty, but {bad}; write true or false, or say "
                f"{option}{strange[0]}=yes'",
            )  # fmt: skip
        if "empty" not in said and set(values.values()) == {True, None}:
            self._fault(
                match, f"has only {', '.join(w for w in values if values[w])} and {often['empty']} "
                "empty cells, which may be shifts that did not engage, or nothing noted; say "
                f"{option}empty=no' or {option}empty=unknown'",
            )  # fmt: skip
        names = {True: "yes", False: "no", None: "not said"}
        read = ", ".join(f"{word} = {names[values.get(word)]} ({n})" for word, n in often.items())
        done = [values.get(cell) for cell in cells]
        self._record(match, [v for v in done if v is not None], f"{match.why}; {read}")
        return done

    def stamps(self) -> Values:
        """Read time stamps: seconds as numbers, dates as ISO 8601; others raise DataError."""
        match = self.matches["timestamp"]
        unit, columns = match.terms[0].unit, [t.column.cells for t in match.terms]
        cells = [" ".join(row) for row in zip(*columns, strict=True)]
        known = [cell for cell in cells if cell.lower() not in NOTHING]
        numbers = are_numbers(known)
        if not known or len(set(numbers)) > 1:
            raise DataError(
                "it has dates and plain numbers" if known else "all its cells are empty"
            )
        values: Sequence[Any] = self.decimals.values(known).tolist() if all(numbers) else known
        found, way = stamps_of(values, unit.factor if unit and all(numbers) else None, match.option)
        left = iter(found)
        self._record(match, found, f"{match.why}; {way}", unit.text if unit else None)
        return [None if cell.lower() in NOTHING else next(left) for cell in cells]


def rounded(value: float) -> float:
    """Take away the last digit, which a factor such as 1e-3 adds to that of the cell."""
    return float(f"{value:.15g}")


def _reason(column: Column) -> str:
    """Give the reason why a column is not used."""
    cells = [cell for cell in column.cells if cell]
    if not cells:
        return "empty"
    if counts_up(column):
        return f"numbers the rows; --column order='{column.head}' takes it as order of the shifts"
    clock = column.unit and column.unit.dimension == TIME and grows(column)
    if clock or is_dated(cells):
        what = "grows as a clock" if clock else "dates"
        return f"{what}; --column timestamp='{column.head}' takes it as times of the shifts"
    numbers = np.isfinite(column.values).sum()
    return "words" if 2 * numbers < len(cells) else "no quantity of this name"
