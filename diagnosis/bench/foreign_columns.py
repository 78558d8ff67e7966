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
from typing import Any

import numpy as np

from dogshape.diagnosis.bench.foreign_table import (
    ANSWERS,
    FORCE,
    LENGTH,
    NAMES,
    NOTHING,
    SPEED,
    TIME,
    UNITS,
    Column,
    ForeignTable,
    Unit,
    decimal_sign,
    is_dated,
    is_number,
    numbers_of,
    stamps_of,
    unit_named,
)
from dogshape.diagnosis.terms import Array
from dogshape.sim.errors import DataError, InputError, did_you_mean, number
from dogshape.sim.texts import listed

NONE = "-"  #: column option of a quantity that is not to be read
#: Scores of a column: its unit alone, a loose word, one of its words, its name; a unit beside them.
UNIT, LOOSE, WORD, NAME, FITS = 1.0, 2.0, 3.0, 4.0, 0.5
#: Quantities of which loose words settle nothing between columns of the right kind.
UNDECIDED = ("mismatch_rpm", "shift_time_s")
#: Quantities with an option of words in place of a unit.
WORDED = ("engaged", "timestamp", "trace")
MOST = 12  #: faults of one kind that are listed one by one
Values = list[Any]  #: a value for each row, None where there is none


@dataclass(frozen=True)
class Quantity:
    """A quantity that is looked for: name, dimension of its units, and patterns of whole words.

    ``words`` name it, ``loose`` ones may also mean something else, and with those ``against`` a
    column is another. ``needed`` says that a table is of no use without the quantity, ``filled``
    that each row has to have it.
    """

    name: str
    dimension: str | None
    words: str
    loose: str = "-"
    against: str = "-"
    needed: bool = False
    filled: bool = False

    @property
    def units(self) -> str:
        """Spellings of units that it may have."""
        return ", ".join(text for text, one in UNITS.items() if one.dimension == self.dimension)


_SPREAD = r"\w*std\w*|sd|sigma|streuung|\w*abweichung|min|max|\w*deviation"
_RISE = r"\w*rise|\w*anstieg\w*|ramp\w*"
_FORCE = "shift force|(schalt|stell|aktor|axial)kraft|f (shift|axial|act|schalt|ax)"
SHIFTS = (
    Quantity("mismatch_rpm", SPEED,
             r"\w*mismatch|(\w*differenz|relativ|schlupf)drehzahl|drehzahldifferenz|d n|dn"
             r"|delta \w+|n diff|diff n|(speed|rpm) difference|relative speed",
             r"slip|schlupf|rpm|\w*drehzahl|n",
             f"output|abtrieb|antrieb|input|in|out|shaft|welle|{_SPREAD}",
             needed=True, filled=True),
    Quantity("force_N", FORCE, _FORCE, r"\w*force|\w*kraft|f",
             f"time|zeit|{_RISE}|{_SPREAD}", needed=True, filled=True),
    Quantity("force_rise_s", TIME,
             r"(force )?rise( time)?|anstiegszeit|kraftanstieg|t (rise|anstieg|ramp|an|anst)",
             _RISE, _SPREAD),
    Quantity("n_shifts", None, "n shifts|anzahl schaltungen|repeats|repetitions|wiederholungen",
             r"shifts|count|anzahl|number|schaltungen|samples|n"),
    Quantity("shift_time_s", TIME, r"shift time|\w*schalt(zeit|dauer)|t (shift|schalt)",
             r"\w*time|\w*zeit|\w*dauer|duration|t|t\d+",
             f"stamp|zeitstempel|timeout|datum|date|delay|{_RISE}|{_SPREAD}", needed=True),
    Quantity("engaged", None,
             "engaged|eingelegt|geschaltet|eingerueckt|eingespurt|eingerastet|drin|im eingriff",
             "erfolg|erfolgreich|success|ok|i o|io|result|ergebnis|status|bewertung|beurteilung"
             "|urteil",
             r"not|nicht|no|n|fail\w*|fehler|error"),
    Quantity("trace", None, "trace( file)?|messdatei|measurement file",
             "file|datei|dateiname|filename"),
    Quantity("shift_time_sd_s", TIME, _SPREAD.replace("|min|max", ""),
             against=r"f|force|kraft|n|mismatch|drehzahl|rise|anstieg|error"),
    Quantity("order", None,
             r"(run )?order|reihenfolge|lfd( nr)?|laufende nummer|laufnummer|sequence|sequenz"
             "|run (number|no)|versuchsnummer|shift number"),
    Quantity("timestamp", TIME,
             "time ?stamp|zeitstempel|(datum|date|date time|datum uhrzeit)"),
)  # fmt: skip
TRACE = (
    Quantity("t_s", TIME, "-", "t|time|zeit", needed=True),
    Quantity("displacement_mm", LENGTH, "displacement|(schalt|muffen)weg|s sleeve|sleeve position",
             r"\w*weg|travel|position|x|s", needed=True),
    Quantity("force_N", FORCE, _FORCE, r"\w*force|\w*kraft|f", needed=True),
    Quantity("sliding_speed_rpm", SPEED,
             r"speed sliding|(sliding|sleeve) speed|n (sleeve|muffe|sliding)"
             "|drehzahl muffe|muffendrehzahl",
             "n antrieb|antriebsdrehzahl|input speed|n in", needed=True),
    Quantity("output_speed_rpm", SPEED,
             r"speed output|(output|gear) speed|n (rad|gear|output|abtrieb)"
             "|drehzahl rad|(rad|abtriebs)drehzahl",
             "n out", needed=True),
)  # fmt: skip


@dataclass(frozen=True)
class Match:
    """Columns that are taken for a quantity, each with its unit, and the reason.

    ``formula`` joins them as ``c0``, ``c1`` ...; ``option`` stands behind the colon of an option.
    """

    quantity: Quantity
    terms: tuple[tuple[Column, Unit | None], ...]
    why: str
    formula: str = "c0"
    option: str = ""

    @property
    def head(self) -> str:
        """Heads of its columns."""
        return " and ".join(column.head for column, _ in self.terms)


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

    def has(pattern: str) -> bool:
        return bool(re.search(rf"\b({pattern})\b", name))

    name, dated = plain_words(column.name), is_dated(column.cells)
    fits = 0.0 if column.unit is None else FITS
    if (
        has(quantity.against)
        or (column.unit and column.unit.dimension != quantity.dimension)
        or (dated and quantity.dimension and quantity.name != "timestamp")
        or (quantity.needed and any(column.cells) and not np.isfinite(column.values).any())
        or (quantity.name == "shift_time_s" and not has(quantity.words) and grows(column))
    ):
        return 0.0
    if re.fullmatch(quantity.words, name) or (dated and quantity.name == "timestamp"):
        return NAME + fits
    if has(quantity.words) or has(quantity.loose):
        return (WORD if has(quantity.words) else LOOSE) + fits
    # A unit alone says nothing of what a table may lack.
    return UNIT + fits if fits and quantity.needed else 0.0


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


def _outcome(column: Column) -> str:
    """Ask about a column of words of which one at least says no; empty for another."""
    words = {word: ANSWERS.get(word, "strange") for word in map(answer_of, column.cells)}
    if False not in words.values() or "strange" in words.values():
        return ""
    option = f"--column engaged='{column.head}"
    turned = ",".join(f"{w}={'no' if y else 'yes'}" for w, y in words.items() if y is not None)
    return (
        f"'{column.head}' holds yes and no and may be the outcome; say {option}', {option}:{turned}"
        f"' where its yes is a failure, or --column engaged={NONE} to leave it out"
    )


def answer_of(cell: str) -> str:
    """Write a cell as ``ANSWERS`` has it: in lower case, without blanks."""
    return "empty" if cell.lower() in NOTHING else "".join(cell.lower().split())


def matched(
    columns: Sequence[Column], quantities: Sequence[Quantity], said: Mapping[str, str]
) -> tuple[list[Match], list[str]]:
    """Match columns with quantities, best first: matches, and questions on what is not decided.

    ``said`` maps quantities to column options (``said_match``), which come first, or to ``NONE``.
    """
    found: list[Match] = []
    faults: list[str] = []
    missing: list[Quantity] = []
    for name, text in said.items():
        try:
            found += [said_match(columns, quantities, name, text)] if text != NONE else []
        except InputError as error:
            faults.append(str(error))
    left = [c for c in columns if c not in {term for one in found for term, _ in one.terms}]
    scores = {q: {c: score(q, c) for c in left} for q in quantities if q.name not in said}
    for quantity, own in sorted(scores.items(), key=lambda one: -max(one[1].values(), default=0.0)):
        best = max((own[c] for c in left), default=0.0)
        loose = quantity.name in UNDECIDED and best < WORD
        equal = [c for c in left if own[c] > 0.0 and (loose or own[c] == best)]
        if not equal:
            missing += [quantity] if quantity.needed else []
            faults += list(map(_outcome, left)) if quantity.name == "engaged" else []
        elif len(equal) > 1:
            faults.append(_which(quantity.name, equal))
        elif quantity.name == "n_shifts" and counts_up(equal[0]):
            head = equal[0].head
            faults.append(
                f"'{head}' numbers the rows and is no count of shifts; say --column order='{head}'"
                f", or --column n_shifts='{head}' where each row is the mean of so many shifts"
            )
        else:
            left.remove(equal[0])
            why = "name and unit" if equal[0].unit else "name"
            found.append(Match(quantity, ((equal[0], equal[0].unit),), why))
    return found, [*filter(None, faults), *(_missing(one, left) for one in missing)]


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
    said = (
        f"no column looks like {quantity.name}; say which one it is: --column {quantity.name}="
        f"COLUMN or COLUMN:UNIT (columns left: {', '.join(repr(c.head) for c in left) or 'none'})"
    )
    clocks = [c.head for c in left if c.unit and c.unit.dimension == TIME and grows(c)]
    if quantity.name == "shift_time_s" and clocks:
        said += f"; '{clocks[0]}' grows from row to row as a clock does"
    return said


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
    some = "|".join(re.escape(one) for one in sorted(labels, key=len, reverse=True) if one)
    terms: list[tuple[Column, Unit | None]] = []
    whole = re.fullmatch(rf"({some})(?::(.*))?", text)
    formula, option = "c0", ""
    if name in WORDED and whole:
        option = whole[2] or ""
        terms = [(labels[whole[1]], unit_named(option) or labels[whole[1]].unit)]
    else:

        def placed(found: re.Match[str]) -> str:
            column, asked = labels[found[1]], found[2] or ""
            unit = unit_named(asked) if asked else column.unit
            if (asked and not unit) or (unit and unit.dimension != quantity.dimension):
                raise InputError(
                    f"the unit of {name} is '{asked or (unit.text if unit else '')}', but it must "
                    f"be one of: {quantity.units or 'none, a number without one'}"
                )
            terms.append((column, unit))
            return f"c{len(terms) - 1}"

        formula = re.sub(rf"(?<![\w.])({some})(?::([\w/^*%-]*\w))?(?!\w)", placed, text)
    if not terms:
        hint = did_you_mean(text, [c.head for c in columns])
        raise InputError(f"--column {name} is '{text}', but the file has no such column; {hint}")
    signed = ["its sign is that of the formula, positive where traction flanks meet"]
    other = [f"the head says {column.unit.text}" for column, unit in terms
             if column.unit and unit and unit.factor != column.unit.factor]  # fmt: skip
    why = [f"--column {text}", *(signed if len(terms) > 1 else []), *other]
    return Match(quantity, tuple(terms), "; ".join(why), formula, option)


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


class TableReader:
    """Convert the columns of one table; ``report`` collects faults and records."""

    def __init__(
        self, table: ForeignTable, quantities: Sequence[Quantity], said: Mapping[str, str],
        decimal: str | None, report: Report,
    ) -> None:  # fmt: skip
        """Match the columns and decide on the decimal sign; ``decimal`` is that of the user."""
        self.table, self.quantities, self.report = table, quantities, report
        self.sign = decimal
        found, faults = matched(table.columns, quantities, said)
        self.matches = {m.quantity.name: m for m in found}
        used = {c: m.quantity.name for m in found for c, _ in m.terms}
        # A word among numbers that are read anyway is a fault of their column.
        read = {c.place for c, name in used.items() if name != "order"}
        faults = [text for place, text in table.questions if place not in read] + faults
        cells = {c.head: c.cells for c in used if not is_dated(c.cells)}
        try:
            self.sign = decimal_sign(cells, table.rows, decimal or table.stated, table.separator)
        except DataError as error:
            faults.append(str(error))
        file = str(table.path)
        report.faults += [f"{file}: {fault}" for fault in faults]
        report.left_out += [{"file": file, "row": n, "reason": why} for n, why in table.left_out]
        report.left_out += [{"file": file, "column": c.head, "reason": _reason(c)}
                            for c in table.columns if c not in used]  # fmt: skip

    def _fault(self, match: Match, text: str) -> None:
        where = f"{self.table.path}, column '{match.head}' ({match.quantity.name})"
        self.report.faults.append(f"{where} {text}")

    def _rows(self, cells: Sequence[Any], wrong: Sequence[bool]) -> str:
        bad = [f"row {n}: '{cell}'" for n, cell, off in
               zip(self.table.rows, cells, wrong, strict=True) if off]  # fmt: skip
        return ", ".join(bad[:MOST]) + (f" and {len(bad) - MOST} more" if len(bad) > MOST else "")

    def _record(self, match: Match, values: Values, why: str, unit: str = "") -> Values:
        """Record how values were read, and return them."""
        known = [v for v in values if v is not None]
        numbers = [v for v in known if isinstance(v, float)]
        cells = [cell for column, _ in match.terms for cell in column.cells] if numbers else []
        signed = self.sign and any(self.sign in cell for cell in cells)
        self.report.readings.append({
            "file": str(self.table.path), "quantity": match.quantity.name, "column": match.head,
            "unit": unit or None, "decimals": NAMES[str(self.sign)] if signed else None,
            "first": next(iter(known), None), "least": min(numbers, default=None),
            "largest": max(numbers, default=None), "why": f"{match.why}; {why}".rstrip("; "),
        })  # fmt: skip
        return values

    def read(self) -> dict[str, Values]:
        """Read all quantities, None where a column does not say them or is not there.

        Numbers are in the project's unit; cells that cannot be read are a fault.
        """
        ways = {"n_shifts": self._counts, "engaged": self._answers, "timestamp": self._stamps,
                "trace": self._texts}  # fmt: skip
        return {
            q.name: ways.get(q.name, self._numbers)(self.matches[q.name])
            if q.name in self.matches else [None] * len(self.table.rows)
            for q in self.quantities
        }  # fmt: skip

    def _numbers(self, match: Match) -> Values:
        """Convert a column, or a formula of columns; None for empty cells."""
        import pandas as pd  # noqa: PLC0415  # slow to load

        terms = [self._term(match, column, unit) for column, unit in match.terms]
        frame, why = pd.DataFrame({f"c{k}": values for k, (values, _) in enumerate(terms)}), ""
        try:
            values = pd.to_numeric(frame.eval(match.formula)).replace([np.inf, -np.inf], np.nan)
        except Exception as error:  # what it raises depends on the text
            values, why = np.nan * frame["c0"], f": {error}"
        if match.formula != "c0" and not values.notna().any():
            self._fault(match, f"is no formula of its columns ({match.why}{why}); write for "
                        "instance 'n_out - n_in'")  # fmt: skip
        # A factor such as 1e-3 adds a last digit to that of the cell.
        done = [float(f"{v:.15g}") if math.isfinite(v) else None for v in values]
        units = ", ".join(dict.fromkeys(unit.text for _, unit in terms if unit))
        sized = units and not all(unit for _, unit in match.terms)
        return self._record(match, done, f"{units} by its size" if sized else "", units)

    def _term(self, match: Match, column: Column, unit: Unit | None) -> tuple[Array, Unit | None]:
        """Read a column in the project's unit, NaN where there is no number, (rows,)."""
        values, quantity = numbers_of(column.cells, self.sign), match.quantity
        empty = np.array([cell.lower() in NOTHING for cell in column.cells])
        if (bad := np.isnan(values) & ~empty).any():
            rows = self._rows(column.cells, bad.tolist())
            self._fault(match, f"must hold numbers, but has {rows}; correct or empty the cells")
        if empty.any() and quantity.filled:
            rows = ", ".join(map(str, np.array(self.table.rows)[empty][:MOST]))
            self._fault(match, f"is empty in row {rows}; fill the cells or remove the rows")
        known = values[np.isfinite(values)]
        if quantity.dimension is None or not known.size:
            return values, unit
        option = f"--column {quantity.name}='{column.head}:"
        angular = re.search("omega|angular|winkel", plain_words(column.name))
        if (unit and np.isnan(unit.factor)) or (not unit and (column.strange or angular)):
            text = f"the unit '{unit.text if unit else column.strange or ''}', which is"
            self._fault(match, f"has {text} unknown or ambiguous (revolutions or radians); say "
                        f"{option}UNIT' with one of {quantity.units}")  # fmt: skip
        elif unit is None:
            # A recorder's clock may begin anywhere: the length of a trace decides.
            middle = np.median(abs(known - (known.min() if quantity.name == "t_s" else 0.0)))
            text = {TIME: "ms" if middle > 5.0 else "s", FORCE: "kN" if middle < 5.0 else "N",
                    SPEED: "1/min"}.get(quantity.dimension, "mm")  # fmt: skip
            self.report.assumed.append(
                f"{self.table.path}: '{column.head}' ({quantity.name}) has no unit and is taken as "
                f"{text} by its size; {option}UNIT' says another"
            )
            unit = unit_named(text)
        return values * (unit.factor if unit else 1.0), unit

    def _counts(self, match: Match) -> Values:
        """Read the number of shifts of each row, a whole number of at least 1."""
        values = self._numbers(match)
        if any(wrong := [v is not None and (v < 1 or v % 1 > 0) for v in values]):
            bad = self._rows([v and number(v) for v in values], wrong).replace("'", "")
            self._fault(match, f"must be whole numbers of at least 1, but {bad}; correct them")
        return values

    def _texts(self, match: Match) -> Values:
        return self._record(match, [cell or None for cell in match.terms[0][0].cells], "")

    def _answers(self, match: Match) -> Values:
        """Read yes and no; an option such as ``gut=yes,empty=no`` goes first."""
        cells = [answer_of(cell) for cell in match.terms[0][0].cells]
        pairs = (pair.split("=", 1) for pair in match.option.split(",") if "=" in pair)
        said = {answer_of(word): answer_of(way) for word, way in pairs}
        often = Counter(cells)
        values = {w: ANSWERS[said.get(w, w)] for w in often if said.get(w, w) in ANSWERS}
        if strange := [word for word in often if word not in values]:
            bad = self._rows(cells, [cell in strange for cell in cells])
            self._fault(match, f"must be yes, no or empty, but {bad}; write true or false, or say "
                        f"--column engaged='{match.head}:{strange[0]}=yes,empty=no', or "
                        f"--column engaged={NONE} to leave it out")  # fmt: skip
        names = {True: "yes", False: "no", None: "not said"}
        read = ", ".join(f"{word} = {names[values.get(word)]} ({n})" for word, n in often.items())
        return self._record(match, [values.get(cell) for cell in cells], read)

    def _stamps(self, match: Match) -> Values:
        """Read numbers with a unit in s, and dates as ISO 8601."""
        column, unit = match.terms[0]
        cells = [cell for cell in column.cells if cell.lower() not in NOTHING]
        try:
            if unit is not None and all(map(is_number, cells)):
                found = [f"{v:.12g}" for v in unit.factor * numbers_of(cells, self.sign)]
                way = "seconds"
            else:
                found, way = stamps_of(cells, "" if unit else match.option)
        except DataError as error:
            self._fault(match, f"{error}, or say --column timestamp='{match.head}:s' for numbers "
                        f"of seconds, or --column timestamp={NONE} to leave it out")  # fmt: skip
            return [None] * len(column.cells)
        stamps = iter(found)
        values = [None if cell.lower() in NOTHING else next(stamps) for cell in column.cells]
        return self._record(match, values, way, unit.text if unit else "")


def _reason(column: Column) -> str:
    """Give the reason for which a column is no quantity."""
    if counts_up(column):
        return f"numbers the rows; --column order='{column.head}' takes it as order of the shifts"
    if is_dated(column.cells) or (column.unit and column.unit.dimension == TIME and grows(column)):
        return f"clock; --column timestamp='{column.head}' takes it as times of the shifts"
    return "no quantity of this name" if any(column.cells) else "empty"
