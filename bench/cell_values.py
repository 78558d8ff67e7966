"""Values of cells: numbers, units, dates, durations and answers, as benches write them.

A file has one decimal sign. ``1,200`` is 1200 or 1.2, which other numbers of the file decide, or a
statement of the file or of the user; otherwise it is a question.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from dogshape.bench.draft_arguments import column_argument
from dogshape.sim.elementwise import Array
from dogshape.sim.errors import DataError
from dogshape.sim.interface import argument

_ORDINARY_SIGNS = str.maketrans({
    **dict.fromkeys("\N{NO-BREAK SPACE}\N{NARROW NO-BREAK SPACE}\N{THIN SPACE}", " "),
    **dict.fromkeys("\N{FIGURE SPACE}\N{SIX-PER-EM SPACE}\N{HAIR SPACE}", " "),
    **dict.fromkeys("\N{RIGHT SINGLE QUOTATION MARK}\N{LEFT SINGLE QUOTATION MARK}\N{PRIME}", "'"),
    **dict.fromkeys("\N{MINUS SIGN}\N{EN DASH}\N{HYPHEN}\N{NON-BREAKING HYPHEN}", "-"),
    **dict.fromkeys("\N{FULLWIDTH HYPHEN-MINUS}\N{FIGURE DASH}\N{SMALL HYPHEN-MINUS}", "-"),
})  # fmt: skip
_NUMBER = re.compile(
    r"[+-]?(?:(?:\d+(?:[.,]\d*)?|[.,]\d+)(?:[eEdD][+-]?\d+)?"
    r"|\d{1,3}([ ,.'])\d{3}(?:\1\d{3})*(?:(?!\1)[.,]\d+)?)"
)
_EITHER = re.compile(r"[+-]?[1-9]\d{0,2}[.,]\d{3}")  # thousands or three decimals
_BEGINS = re.compile(r"[<>=~≤≥≈±+-]*\s*[.,]?\d")
MAX_QUANTITY = 40  #: characters of a number with its unit
NAMES = {".": "point", ",": "comma"}
OTHER_DECIMAL = {".": ",", ",": "."}


def plain(cell: str) -> str:
    """Write a cell with ordinary minus sign and blank, the sign beside its digits."""
    text = cell if cell.isascii() else cell.translate(_ORDINARY_SIGNS)
    return text[0] + text[1:].lstrip() if text[:1] in ("+", "-") else text


def is_number(cell: str) -> bool:
    """Test that a cell is a number with either decimal sign."""
    return bool(_NUMBER.fullmatch(plain(cell)))


def begins_with_number(cell: str) -> bool:
    """Test that a cell begins with a number: ``>1000``, ``116 ± 12``."""
    return bool(_BEGINS.match(plain(cell)))


def numbers_of(cells: Sequence[str], sign: str | None = None) -> Array:
    """Convert cells with a decimal sign, None for any, (cells,); NaN where a cell is no number."""

    def value(text: str) -> float:
        if not _NUMBER.fullmatch(text):
            return math.nan
        decimal = sign or ("," if "," in text and "." not in text else ".")
        digits = re.sub(f"[ '{OTHER_DECIMAL[decimal]}]", "", text).replace(decimal, ".")
        number = float(digits.replace("D", "e").replace("d", "e"))
        return number if math.isfinite(number) else math.nan

    return np.array([value(plain(cell)) for cell in cells], dtype=float)


def decimal_sign(
    columns: Mapping[str, Sequence[str]], rows: Sequence[int], stated: str | None, separator: str
) -> str | None:
    """Decide on the decimal sign of a file, None where no number has one.

    ``stated`` is the sign that the file or the user says. Raises DataError for numbers with both
    signs, and for those that can be read in two ways.
    """
    certain, questions = _signs_of(columns, rows)
    if len(certain) > 1 or (stated and OTHER_DECIMAL[stated] in certain):
        signs = " and with ".join(certain[mark] for mark in sorted(certain))
        says = f", but {NAMES[stated]} is said to be the decimal sign" if stated else ""
        raise DataError(
            f"numbers with {signs}{says}, which can be read in two ways; save it with one sign"
        )
    sign = stated or next(iter(certain), None)
    if sign or not questions:
        return sign
    mixed = [cells for cells in columns.values() if any(map(_EITHER.fullmatch, cells))]
    has_whole_number = any(re.fullmatch(r"0*[1-9]\d*", cell) for cells in mixed for cell in cells)
    if separator == "," and set(questions) == {"."} and not has_whole_number:
        return "."
    raise DataError("; ".join(questions.values()))


def _signs_of(
    columns: Mapping[str, Sequence[str]], rows: Sequence[int]
) -> tuple[dict[str, str], dict[str, str]]:
    """Describe the first number with each decimal sign, and the first that has two readings."""
    certain: dict[str, str] = {}
    questions: dict[str, str] = {}
    for head, cells in columns.items():
        for cell, row in zip(map(plain, cells), rows, strict=True):
            marks = re.findall("[.,]", cell) if is_number(cell) else []
            if not marks:
                continue
            mark = marks[-1] if marks.count(marks[-1]) == 1 else OTHER_DECIMAL[marks[-1]]
            if not _EITHER.fullmatch(cell):
                certain.setdefault(mark, f"a {NAMES[mark]} ('{cell}', row {row})")
                continue
            questions.setdefault(
                mark,
                f"column '{head}', row {row}: '{cell}' can be read as "
                f"{cell.replace(mark, '')}, {argument('decimal', OTHER_DECIMAL[mark])}, or as "
                f"{cell.replace(mark, '.')}, {argument('decimal', mark)}",
            )
    return certain, questions


SPEED, FORCE, TIME, LENGTH, MISC = "speed", "force", "time", "length", "other"
PRESSURE, AREA, VOLTAGE, CURRENT = "pressure", "area", "voltage", "current"


@dataclass(frozen=True)
class Unit:
    """Unit: spelling, dimension, and factor to 1/min, N, s, mm, bar, V, A; of areas to N/bar."""

    text: str
    dimension: str
    factor: float


#: Spellings without blanks and in lower case but for N; each with the factor to the project's unit.
SPELLINGS: dict[str, dict[str, float]] = {
    SPEED: {
        **dict.fromkeys(("1/min", "rpm", "u/min", "upm", "min-1", "min^-1", "r/min", "rev/min",
                         "/min", "ot/min", "tr/min", "obr/min", "giri/min", "rot/min", "umdr/min",
                         "umdr./min", "ot./min", "obr./min", "omw/min", "varv/min", "f/min",
                         "g/min", "1/minute", "revs/min", "cpm"), 1.0),
        "rad/min": 0.5 / math.pi,
        **dict.fromkeys(("rad/s", "rads-1", "rad*s^-1", "rad/sec"), 30.0 / math.pi),
        **dict.fromkeys(("hz", "u/s", "rps", "rev/s", "r/s", "umdr/s", "umdr./s", "tr/s", "ot/s"),
                        60.0),
        **dict.fromkeys(("1/s", "s-1", "s^-1", "/s"), math.nan),  # revolutions or radians
        **dict.fromkeys(("deg/s", "grad/s", "degree/s", "degrees/s"), 1.0 / 6.0),
    },
    FORCE: {"N": 1.0, "newton": 1.0, "kn": 1e3, "dan": 10.0, "kgf": 9.80665, "kp": 9.80665,
            "lbf": 4.4482216152605, "mn": math.nan},
    TIME: {"s": 1.0, "sec": 1.0, "sek": 1.0, "ms": 1e-3, "msec": 1e-3, "msek": 1e-3, "us": 1e-6,
           "millisec": 1e-3, "seconds": 1.0, "sekunden": 1.0, "milliseconds": 1e-3,
           "millisekunden": 1e-3, "usec": 1e-6},
    LENGTH: {"mm": 1.0, "m": 1e3, "cm": 10.0, "um": 1e-3},
    PRESSURE: {"bar": 1.0, "mbar": 1e-3, "pa": 1e-5, "hpa": 1e-3, "kpa": 1e-2, "mpa": 10.0,
               "psi": 0.06894757293, "n/mm2": 10.0, "n/cm2": 0.1},
    AREA: {"mm2": 0.1, "mm^2": 0.1, "cm2": 10.0, "cm^2": 10.0, "m2": 1e5, "m^2": 1e5,
           "in2": 64.516},
    VOLTAGE: {"v": 1.0, "mv": 1e-3},
    CURRENT: {"a": 1.0, "ma": 1e-3},
    MISC: dict.fromkeys(("nm", "degc", "%", "kg", "lb", "mm/s", "m/s", "j",
                         "deg", "grad", "degf", "kw"), math.nan),
}  # fmt: skip
UNITS = {
    text: Unit(text, kind, by) for kind, texts in SPELLINGS.items() for text, by in texts.items()
}
_UNIT_SIGNS = str.maketrans({
    "\N{MICRO SIGN}": "u", "\N{GREEK SMALL LETTER MU}": "u", "°": "deg", "\N{MINUS SIGN}": "-",
    "⁻": "-", "¹": "1", "²": "2", "³": "3", "·": "*", "\N{MULTIPLICATION SIGN}": "x",
    "\N{DIVISION SLASH}": "/", "\N{FRACTION SLASH}": "/",
})  # fmt: skip
_FACTOR = re.compile(
    r"[x*]?\s*(\d+(?:[.,]\d+)?(?:[eE][+-]?\d+)?|10\^?-\d+|1/\d+)\s*[x*]?\s*([^\d\W].*|°.*|1/.*)"
)
_SQUARED = re.compile(r"(.*[^\d\W])\s*(?:²|\^?2)")
_BRACKETS = re.compile(r"^(.*?)\s*[\[({<]\s*([^\])}>]*?)\s*[\])}>]\s*(.*)$")
_LAST = re.compile(r"^(.+?)(?:\s+in\s+|\s*/\s*|[\s_,.]+)([^\s_]+)$")


def bare_unit(text: str) -> str:
    """Write the spelling of a unit without blanks and in plain signs, ``N·mm²`` as ``N*mm2``."""
    return re.sub(r"\s+", "", text).translate(_UNIT_SIGNS)


def unit_named(text: str) -> Unit | None:
    """Find the unit of a spelling, None for an unknown one."""
    spelling = bare_unit(text)
    unit = UNITS.get(spelling if spelling in ("N", "n") else spelling.lower())
    return None if unit is None else replace(unit, text=text.strip())


def unit_with_factor(text: str) -> Unit | None:
    """Find a unit with or without a factor: ``0.1 ms``, ``x0.01 s``, ``10^-1 ms``."""
    unit = unit_named(text)
    match = _FACTOR.fullmatch(text.strip().translate(_UNIT_SIGNS))
    if unit or not match:
        return unit
    base = unit_named(match[2])
    if base is None:
        return None
    digits = match[1].replace(",", ".")
    if digits.startswith("1/"):
        factor = 1.0 / float(digits[2:])
    elif re.fullmatch(r"10\^?-\d+", digits):
        factor = 10.0 ** float(digits[2:].lstrip("^"))
    else:
        factor = float(digits)
    return replace(base, text=text.strip(), factor=base.factor * factor)


def squared_time(text: str) -> Unit | None:
    """Find the unit of a variance of times, ``ms²``, its factor to s²; None for another text."""
    match = _SQUARED.fullmatch(text.strip())
    unit = unit_named(match[1]) if match else None
    if unit is None or unit.dimension != TIME:
        return None
    return Unit(text.strip(), TIME, unit.factor**2)


def split_quantity(cell: str) -> tuple[str, Unit | None]:
    """Split a cell with a quantity, ``0,642 kN``, into number and unit; None for no unit."""
    text = plain(cell)
    if len(text) > MAX_QUANTITY:
        return cell, None
    if is_number(text) or not begins_with_number(text):
        return cell, None
    for gap in re.finditer(r"(?<=\d)\s*(?=[^\d.,'\s])|(?<=\d)\s+", text):
        number, words = text[: gap.start()], text[gap.end() :]
        unit = unit_named(words)
        if unit and is_number(number):
            return number, unit
    return cell, None


def split_head(text: str, below: str = "") -> tuple[str, Unit | None, str | None]:
    """Divide the head of a column into name, unit, and the text of an unknown unit.

    A unit stands in brackets at the end (``F [kN]``), after "in" or a stroke (``F/kN``), last
    (``t_shift ms``), or in a cell of its own ``below``.
    """
    name, unit, strange, unit_text = text, None, None, below.strip("[]() ")
    if match := _BRACKETS.match(text):
        name, bracket_text, text_behind = match.groups()
        unit = unit_named(bracket_text)
        is_unit = "[" in text or unit_with_factor(bracket_text) is not None
        strange = None if unit or not is_unit or bracket_text in ("", "-", "1") else bracket_text
        name = " ".join(filter(None, (name, "" if unit or strange else bracket_text, text_behind)))
    elif match := _LAST.match(text):
        bare_name, last = match.groups()
        if "/" in last and unit_named(last) is None and unit_named(last.split("/", 1)[1]):
            bare_name, last = f"{bare_name} {last.split('/', 1)[0]}", last.split("/", 1)[1]
        unit = unit_named(last)
        name = bare_name if unit else text
    unit = unit or unit_named(unit_text)
    if unit:
        return name, unit, None
    if not strange and re.search(r"\w", unit_text):
        strange = unit_text
    return name, unit, strange or None


#: Dates and clocks that are read without a statement; Python's directives, or pandas' ISO 8601.
FORMS = (
    "ISO8601",
    "%d.%m.%Y %H:%M:%S.%f",
    "%d.%m.%Y %H:%M:%S",
    "%d.%m.%Y %H:%M",
    "%d.%m.%Y",
    "%H:%M:%S.%f",
    "%H:%M:%S",
    "%H:%M",
)
_DATED = re.compile(r"\d[./-]\d{1,2}[./-]\d|\d-[A-Za-z]{3}-\d|\b\d{1,2}:\d{2}")
_DURATION = re.compile(r"(?:0{1,2}:)?0{1,2}:(\d{1,2}[.,]\d{1,6})")


def is_date(cell: str) -> bool:
    """Test that a cell holds a date or a clock."""
    return bool(_DATED.search(cell))


def is_dated(cells: Sequence[str]) -> bool:
    """Test that most cells are dates or clocks."""
    filled = [cell for cell in cells if cell]
    return 2 * sum(map(is_date, filled)) > len(filled)


def durations_of(cells: Sequence[str]) -> list[str]:
    """Convert clocks below a minute, ``00:00.116``, to s; empty if any cell is none."""
    matches = [_DURATION.fullmatch(cell) for cell in cells if cell]
    if not matches or not all(matches):
        return []
    seconds = (match[1] for match in matches if match)
    return [f"{next(seconds)} s" if cell else "" for cell in cells]


def stamps_of(cells: Sequence[str], form: str) -> tuple[list[str], str]:
    """Convert dates to ISO 8601, and clocks without a date to s; also return their form.

    ``form`` has directives such as ``%d/%m/%Y``; empty finds one of ``FORMS``. Raises DataError for
    other cells.
    """
    import pandas as pd  # noqa: PLC0415  # slow to load, and most tables have no dates

    texts = pd.Series(cells, dtype=object).str.replace(r"(?<=:\d\d),(?=\d)", ".", regex=True)
    forms = (form,) if form else FORMS
    trials = {way: pd.to_datetime(texts, format=way, errors="coerce", utc=True) for way in forms}
    way, moments = min(trials.items(), key=lambda trial: trial[1].isna().sum())
    if (wrong := moments.isna()).any():
        answer = column_argument("timestamp", "COLUMN:%d/%m/%Y %H:%M:%S")
        raise DataError(
            f"has '{cells[int(wrong.argmax())]}', which is no date and time as "
            f"{form or '2024-05-31 14:05:09 or 31.05.2024 14:05:09'}; say its form behind the "
            f"column: {answer}"
        )
    if way == FORMS[0] or "%d" in way:
        return [moment.isoformat() for moment in moments], f"dates as {way}"
    seconds = (moments - moments.dt.normalize()).dt.total_seconds()
    seconds += 86_400.0 * (seconds.diff() < -43_200.0).cumsum()  # after midnight
    return [f"{second:.12g}" for second in seconds], "clock without a date"


NOTHING = frozenset(("", "-", "--", "n/a", "na", "nan", "#n/a", "none", "null", "k.a.", "#nv"))
YES = ("true", "yes", "ja", "1", "ok", "i.o.", "io", "i.o", "wahr", "x", "engaged", "y", "j", "oui",
       "si", "sí", "ano", "tak", "pass", "passed", "✓", "✔", "vrai", "sim", "igen", "da",
       "kyllä")  # fmt: skip
NO = ("false", "no", "nein", "0", "nok", "n.i.o.", "nio", "n.i.o", "falsch", "failed", "fail", "n",
      "non", "ne", "nie", "✗", "✘", "faux", "não", "nem", "nu", "ei", "nej", "nee")  # fmt: skip
ANSWERS = {
    **dict.fromkeys((*NOTHING, "empty", "unknown")),
    **dict.fromkeys(YES, True),
    **dict.fromkeys(NO, False),
}


def is_blank(cell: str) -> bool:
    """Whether a cell is empty or has a word for nothing."""
    return cell.lower() in NOTHING


def answer_of(cell: str) -> str:
    """Write a cell as ``ANSWERS`` has it: in lower case, without blanks."""
    return "empty" if is_blank(cell) else "".join(cell.lower().split())


@dataclass(frozen=True, eq=False)  # compared and hashed by identity, not by all of its cells
class Column:
    """A column: its place from 1, head, name without unit, unit, an unknown unit, and cells.

    ``true_numbers`` says that its numbers are a workbook's own, with a decimal point; ``hidden``
    that the workbook does not show it; ``repeats`` is the number of columns that it joins;
    ``is_outcome`` says that a share of its row was divided into yes and no.
    """

    place: int
    head: str
    name: str
    unit: Unit | None
    strange: str | None = None
    cells: tuple[str, ...] = ()
    true_numbers: bool = False
    hidden: bool = False
    repeats: int = 0
    is_outcome: bool = False

    @cached_property
    def is_dated(self) -> bool:
        """Whether most cells are dates or clocks."""
        return is_dated(self.cells)

    @cached_property
    def values(self) -> Array:
        """Numbers by the decimal sign that each cell shows, NaN for other cells, (rows,)."""
        return numbers_of([split_quantity(cell)[0] for cell in self.cells])
