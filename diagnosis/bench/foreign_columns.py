"""Columns of a foreign table: which of them are which quantities, and their values.

Names are compared with words that benches use, in English and German; a unit in the head and the
kind of cells must fit the quantity. What fits in two ways becomes a question with its option.
"""

from __future__ import annotations

import math
import re
import unicodedata
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import compress
from typing import Any

import numpy as np

from dogshape.diagnosis.bench.foreign_cells import (
    ANSWERS,
    DATES,
    FORCE,
    NOTHING,
    SPEED,
    TIME,
    Decimals,
    Quantity,
    Unit,
    decimals_of,
    has_day,
    is_dated,
    is_number,
    stamps_of,
    unit_named,
)
from dogshape.diagnosis.bench.foreign_table import Column, ForeignTable
from dogshape.diagnosis.terms import Array
from dogshape.sim.errors import DataError, InputError, did_you_mean, number
from dogshape.sim.texts import listed

NONE = "-"  #: column option of a quantity that is not to be read
LEAST = 20.0  #: score from which a column is taken for a quantity
FITS = 20.0  #: what a unit of the right kind adds
#: Quantities of which loose words settle nothing between columns of the right kind.
UNDECIDED = ("mismatch_rpm", "shift_time_s")


@dataclass(frozen=True)
class Match:
    """Columns that are taken for a quantity, each with its unit, and the reason.

    ``formula`` joins the columns as ``c0``, ``c1`` and so on. ``option`` is what stands behind the
    colon of a column option.
    """

    quantity: Quantity
    terms: tuple[tuple[Column, Unit | None], ...]
    why: str
    formula: str = "c0"
    option: str = ""

    @property
    def columns(self) -> list[Column]:
        """Columns that it takes."""
        return [column for column, _ in self.terms]

    @property
    def head(self) -> str:
        """Heads of its columns."""
        return " and ".join(column.head for column in self.columns)


def plain_words(name: str) -> str:
    """Write a name in lower case, its words parted by blanks, without accents and signs."""
    apart = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name)
    for letter, said in (("ä", "ae"), ("ö", "oe"), ("ü", "ue"), ("ß", "ss"), ("Δ", "delta "),
                         ("\N{INCREMENT}", "delta "), ("ω", "omega"), ("Ø", "mean ")):  # fmt: skip
        apart = apart.replace(letter, said).replace(letter.upper(), said)
    bare = unicodedata.normalize("NFKD", apart).encode("ascii", "ignore").decode()
    return " ".join(re.sub(r"[^a-z0-9]+", " ", bare.lower()).split())


def score(quantity: Quantity, column: Column) -> float:
    """Score a column for a quantity; zero where its unit, a word or its cells speak against it."""
    name = plain_words(column.name)
    words, against = name.split(), filter(None, quantity.against.split("|"))
    kind = None if column.unit is None else column.unit.dimension
    if (
        any(word in words or (len(word) > 4 and word in name) for word in against)
        or kind not in (None, quantity.dimension, quantity.also)
        or (quantity.dimension and any(column.cells) and not np.isfinite(column.values).any())
    ):
        return 0.0
    if quantity.name == "shift_time_s" and _is_clock(quantity, column):
        return 0.0
    if quantity.name == "timestamp" and kind is None and is_dated(column.cells):
        return 90.0
    best = max(_alike(quantity.words, words), 0.6 * _alike(quantity.loose, words))
    if best == 0.0 and not quantity.needed:
        return 0.0  # a unit alone says nothing of what a table may lack
    return best + (FITS if kind is not None else 0.0)


def _alike(phrases: str, words: Sequence[str]) -> float:
    """Score the words of a name by phrases, 100 where one is the whole name."""
    best = 0.0
    for phrase in filter(None, phrases.split("|")):
        parts = phrase.split()
        if parts == list(words):
            return 100.0
        if set(parts) <= set(words):
            best = max(best, 50.0 if len(phrase) > 2 else 20.0)
        elif len(phrase) >= 5 and len(parts) == 1 and any(phrase in word for word in words):
            best = max(best, 40.0)
    return best


def _is_strong(quantity: Quantity, column: Column) -> bool:
    return _alike(quantity.words, plain_words(column.name).split()) > 20.0


def grows(column: Column) -> bool:
    """Test that numbers of a column grow from row to row, as a clock does."""
    steps = np.diff(column.values[np.isfinite(column.values)])
    return bool(steps.size >= 3 and (steps > 0).mean() >= 0.9)


def counts_up(column: Column) -> bool:
    """Test that a column numbers its rows: whole numbers, most of them one apart."""
    cells = [cell for cell in column.cells if cell]
    if len(cells) < 2 or not all(cell.isdecimal() for cell in cells):
        return False
    steps = np.diff(np.array(cells, dtype=int))
    return bool(max((steps == 1).mean(), (steps == -1).mean()) >= 0.6 and (steps != 0).all())


def matched(
    columns: Sequence[Column], quantities: Sequence[Quantity], said: Mapping[str, str]
) -> tuple[list[Match], list[str]]:
    """Match columns with quantities, best first: matches, and questions on what is not decided.

    ``said`` maps quantities to column options (``said_match``), which come first, or to ``NONE``.
    """
    found: list[Match] = []
    faults: list[str] = []
    for name, text in said.items():
        try:
            found += [said_match(columns, quantities, name, text)] if text != NONE else []
        except InputError as error:
            faults.append(str(error))
    taken = {column.place for one in found for column in one.columns}
    open_ = [q for q in quantities if q.name not in said]
    scores = {(q.name, c.place): score(q, c) for q in open_ for c in columns}
    while open_:
        ranked = [(scores[q.name, c.place], q, c)
                  for q in open_ for c in columns if c.place not in taken]  # fmt: skip
        best, quantity, column = max(ranked, key=lambda row: row[0], default=(0.0, None, None))
        if quantity is None or column is None or best < LEAST:
            break
        open_.remove(quantity)
        loose = quantity.name in UNDECIDED and not _is_strong(quantity, column)
        rivals = [(s, c) for s, q, c in ranked if q is quantity and s >= LEAST]
        equal = [c for s, c in rivals if loose or s == best or c.head == column.head]
        terms = [(column, column.unit)]
        days = {has_day(c.cells): c for _, c in rivals if is_dated(c.cells)}
        if quantity.name == "timestamp" and len(rivals) == len(days) == 2:
            equal, terms = [column], [(days[k], None) for k in (True, False)]
        if len(equal) > 1:
            faults.append(_which(quantity.name, equal))
        elif quantity.name == "n_shifts" and counts_up(column):
            faults.append(
                f"'{column.head}' numbers the rows and is no count of shifts; say --column order="
                f"'{column.head}', or --column n_shifts='{column.head}' where each row is the mean "
                "of so many shifts"
            )
        else:
            taken |= {column.place for column, _ in terms}
            found.append(Match(quantity, tuple(terms), "name and unit" if column.unit else "name"))
    left = [c for c in columns if c.place not in taken]
    return found, faults + [_missing(one, left) for one in open_ if one.needed]


def _which(name: str, equal: Sequence[Column]) -> str:
    heads = [c.head for c in equal]
    if name == "mismatch_rpm" and len(set(heads)) > 1:
        one, other = equal[0].name, equal[1].name
        return (
            f"mismatch_rpm may be {' or '.join(map(repr, heads))}, or their difference; say "
            f"--column mismatch_rpm='{other} - {one}' or '{one} - {other}', positive where it runs "
            "the traction flanks together (docs/mismatch.md), or the column itself"
        )
    named = [f"column {c.place}" if heads.count(c.head) > 1 else c.head for c in equal]
    ways = " or ".join(f"--column {name}='{one}'" for one in named)
    return f"{name} may be the column {' or '.join(map(repr, heads))}; say which: {ways}"


def _missing(quantity: Quantity, left: Sequence[Column]) -> str:
    speeds = [c for c in left if c.unit and c.unit.dimension == SPEED]
    if quantity.name == "mismatch_rpm" and len(speeds) > 1:
        return _which(quantity.name, speeds)
    for column in left:
        if quantity.name == "shift_time_s" and _is_clock(quantity, column):
            return (
                f"'{column.head}' grows from row to row as a clock does "
                f"({', '.join(column.cells[:3])} ...); say --column {quantity.name}="
                f"'{column.head}' where it is the shift time"
            )
    return (
        f"no column looks like {quantity.name}; say which one it is: --column {quantity.name}="
        f"COLUMN or COLUMN:UNIT (columns left: {', '.join(repr(c.head) for c in left) or 'none'})"
    )


def _is_clock(quantity: Quantity, column: Column) -> bool:
    words = plain_words(column.name).split()
    time = _alike(quantity.loose, words) or (column.unit and column.unit.dimension == TIME)
    return bool(time) and not _is_strong(quantity, column) and grows(column)


def said_match(
    columns: Sequence[Column], quantities: Sequence[Quantity], name: str, text: str
) -> Match:
    """Read a column option: ``COLUMN``, ``COLUMN:UNIT``, or a formula such as ``n_out - n_in``.

    A column is named by its head, its head without the unit, or its place (``column 3``). A unit of
    the option goes before that of the head.
    """
    known = {quantity.name: quantity for quantity in quantities}
    if name not in known:
        raise InputError(f"--column {name}=... names no quantity; {did_you_mean(name, known)}")
    quantity, labels = known[name], {f"column {c.place}": c for c in columns}
    for names in ([c.name for c in columns], [c.head for c in columns]):
        labels |= {n: c for n, c in zip(names, columns, strict=True) if names.count(n) == 1}
    head, _, option = (text, "", "") if text in labels else text.rpartition(":")
    formula, terms = "c0", []
    if head in labels:
        terms = [_term(quantity, labels[head], option)]
    else:

        def placed(found: re.Match[str]) -> str:
            terms.append(_term(quantity, labels[found[1]], found[2] or ""))
            return f"c{len(terms) - 1}"

        some = "|".join(re.escape(one) for one in sorted(labels, key=len, reverse=True) if one)
        formula = re.sub(rf"(?<![\w.])({some})(?::([\w/^*%-]*\w))?(?!\w)", placed, text)
        if not terms or re.search(r"\*\s*\*|//|[^-+*/(). \d]", re.sub(r"\bc\d+", "", formula)):
            hint = did_you_mean(text, [c.head for c in columns])
            raise InputError(
                f"--column {name} is '{text}', but the file has no such column; {hint}"
            )
    why = [f"--column {text}"]
    if len(terms) > 1:
        why.append("its sign is that of the formula, positive where traction flanks meet")
    for column, unit in terms:
        if column.unit and unit and unit.factor != column.unit.factor:
            why.append(f"the head says {column.unit.text}")
    return Match(quantity, tuple(terms), "; ".join(why), formula, option)


def _term(quantity: Quantity, column: Column, asked: str) -> tuple[Column, Unit | None]:
    """Give the unit that an option or the head names; InputError where the quantity has others."""
    unit = unit_named(asked) if asked else column.unit
    if quantity.name == "engaged" or (quantity.also and asked in DATES):
        return column, None
    if (asked and not unit) or (unit and unit.dimension not in (quantity.dimension, quantity.also)):
        wrong = asked or (unit.text if unit else "")
        raise InputError(
            f"the unit of {quantity.name} is '{wrong}', but it must be one of: "
            f"{quantity.units or 'none, a number without one'}"
        )
    return column, unit


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
        used = {c.place: c for m in found for c in m.columns}
        # A word among numbers that are read anyway is a fault of their column.
        read = {c.place for m in found for c in m.columns if m.quantity.name != "order"}
        faults = [text for place, text in table.questions if place not in read] + faults
        decimals = Decimals(decimal)
        cells = {c.head: c.cells for c in used.values() if not is_dated(c.cells)}
        try:
            decimals = decimals_of(cells, table.rows, decimal or table.stated, table.separator)
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
        bad = [f"row {n}: '{cell}'" for n, cell in
               compress(zip(self.table.rows, cells, strict=True), wrong)]  # fmt: skip
        more = f" and {len(bad) - MOST} more" if len(bad) > MOST else ""
        return ", ".join(bad[:MOST]) + more

    def _record(self, match: Match, values: Values, why: str, unit: str | None = None) -> None:
        numbers = [rounded(v) for v in values if isinstance(v, float)]
        cells = [cell for c in match.columns for cell in c.cells] if numbers else []
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
        for place, column in enumerate(match.columns):
            values = self._cells(match, column.cells, needed)
            unit, why = self._unit(match, place, values[np.isfinite(values)])
            whole[f"c{place}"] = values * (1.0 if unit is None else unit.factor)
            units += [unit.text] if unit else []
            whys += [why] if why else []
        try:
            with np.errstate(all="ignore"):
                values = eval(match.formula, {"__builtins__": {}}, whole)
        except (SyntaxError, TypeError):
            values = whole["c0"] * np.nan
        known = values[np.isfinite(values)]
        if match.formula != "c0" and not known.size:
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
        empty = [cell.lower() in NOTHING for cell in cells]
        bad = [not none and math.isnan(v) for v, none in zip(values, empty, strict=True)]
        if any(bad):
            listed = self._rows(cells, bad)
            self._fault(match, f"must hold numbers, but {listed}; correct or empty the cells")
        if any(empty) and needed:
            rows = ", ".join(map(str, list(compress(self.table.rows, empty))[:MOST]))
            self._fault(match, f"is empty in row {rows}; fill the cells or remove the rows")
        return values

    def _unit(self, match: Match, place: int, values: Array) -> tuple[Unit | None, str]:
        """Give the unit of a column, and the reason where its head has none, or ask for it."""
        quantity, (column, unit) = match.quantity, match.terms[place]
        option = f"--column {quantity.name}='{column.head}:"
        if (unit is not None and not np.isnan(unit.factor)) or quantity.dimension is None:
            return unit, ""
        angular = (
            quantity.dimension == SPEED
            and not column.strange
            and re.search("omega|angular|winkel", plain_words(column.name))
        )
        if unit or angular or column.strange:
            text = f"the unit '{unit.text if unit else column.strange or ''}', which is"
            self._fault(
                match, f"has {text} unknown, or revolutions as well as radians; say {option}UNIT' "
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
        cells = match.columns[0].cells
        self._record(match, list(filter(None, cells)), match.why)
        return list(cells)

    def answers(self) -> list[bool | None]:
        """Read a column of yes and no, None where it does not say.

        An option such as ``gut=yes,empty=no`` goes first.
        """
        match = self.matches.get("engaged")
        if match is None:
            return [None] * len(self.table.rows)
        option = f"--column engaged='{match.head}:"
        cells = ["empty" if c.lower() in NOTHING else c.lower() for c in match.columns[0].cells]
        said = dict(pair.lower().split("=", 1) for pair in match.option.split(",") if "=" in pair)
        often = Counter(cells)
        words = {word: said.get(word, "" if word == "empty" else word) for word in often}
        values = {word: ANSWERS[other] for word, other in words.items() if other in ANSWERS}
        if strange := [word for word in often if word not in values]:
            bad = self._rows(cells, [cell in strange for cell in cells])
            self._fault(
                match, f"must be yes, no or empty, but {bad}; write true or false, or say "
                f"{option}{strange[0]}=yes', or --column engaged={NONE} to leave it out",
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
        """Read time stamps: numbers with a unit in s, dates as ISO 8601; others are a fault."""
        match = self.matches.get("timestamp")
        if match is None:
            return [None] * len(self.table.rows)
        unit = match.terms[0][1]
        cells = [" ".join(row) for row in zip(*(c.cells for c in match.columns), strict=True)]
        known = [cell for cell in cells if cell.lower() not in NOTHING]
        try:
            if not any(map(is_number, known)):
                found, way = stamps_of(known, match.option)
            elif unit is not None and all(map(is_number, known)):
                way = "seconds"
                found = [f"{v:.12g}" for v in unit.factor * self.decimals.values(known)]
            else:
                raise DataError(
                    f"has numbers that are no dates; --column timestamp='{match.head}:s' takes "
                    "them as seconds"
                )
        except DataError as error:
            self._fault(match, f"{error}, or say --column timestamp={NONE} to leave it out")
            return [None] * len(cells)
        left = iter(found)
        self._record(match, found, f"{match.why}; {way}", unit.text if unit else None)
        return [None if cell.lower() in NOTHING else next(left) for cell in cells]


def rounded(value: float) -> float:
    """Take away the last digit, which a factor such as 1e-3 adds to that of the cell."""
    return float(f"{value:.15g}")


def _reason(column: Column) -> str:
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
