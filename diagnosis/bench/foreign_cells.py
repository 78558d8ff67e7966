"""Cells of tables as people and loggers write them: numbers, units, dates and words.

A file has one decimal sign. ``1,200`` is 1200 or 1.2, which other numbers of the file decide, or a
statement of the file or of the user; otherwise it is a question.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime

import numpy as np

from dogshape.diagnosis.terms import Array
from dogshape.sim.errors import DataError

_SAME = str.maketrans({
    **dict.fromkeys("\N{NO-BREAK SPACE}\N{NARROW NO-BREAK SPACE}\N{THIN SPACE}", " "),
    **dict.fromkeys("\N{RIGHT SINGLE QUOTATION MARK}\N{LEFT SINGLE QUOTATION MARK}\N{PRIME}", "'"),
    **dict.fromkeys("\N{MINUS SIGN}\N{EN DASH}\N{HYPHEN}\N{NON-BREAKING HYPHEN}", "-"),
})  # fmt: skip
_NUMBER = re.compile(
    r"[+-]?(?:(?:\d+(?:[.,]\d*)?|[.,]\d+)(?:[eE][+-]?\d+)?"
    r"|\d{1,3}([ ,.'])\d{3}(?:\1\d{3})*(?:(?!\1)[.,]\d+)?)"
)
_EITHER = re.compile(r"[+-]?[1-9]\d{0,2}[.,]\d{3}")  # thousands or three decimals
NAMES = {".": "point", ",": "comma"}
OTHER = {".": ",", ",": "."}


def plain(cell: str) -> str:
    """Write a cell with ordinary minus sign and blank, the sign beside its digits."""
    text = cell if cell.isascii() else cell.translate(_SAME)
    return text[0] + text[1:].lstrip() if text[:1] in ("+", "-") else text


def is_number(cell: str) -> bool:
    """Test that a cell is a number, whatever its decimal sign."""
    return bool(_NUMBER.fullmatch(plain(cell)))


def _shown_sign(cell: str) -> tuple[str | None, bool]:
    """Give the decimal sign that a number shows, and whether it may part thousands as well."""
    text = plain(cell)
    marks = re.findall("[.,]", text)
    if not marks or not _NUMBER.fullmatch(text):
        return None, False
    if marks.count(marks[-1]) > 1:
        return OTHER[marks[-1]], False
    return marks[-1], bool(_EITHER.fullmatch(text))


@dataclass(frozen=True)
class Decimals:
    """Decimal sign of a file, None where no number has one, and questions on undecided columns."""

    sign: str | None
    questions: tuple[str, ...] = ()

    def values(self, cells: Sequence[str]) -> Array:
        """Convert cells, NaN where one is no number, (cells,)."""
        return np.array([self._value(plain(cell)) for cell in cells], dtype=float)

    def _value(self, text: str) -> float:
        if not _NUMBER.fullmatch(text):
            return math.nan
        sign = self.sign or ("," if "," in text and "." not in text else ".")
        return float(re.sub(f"[ '{OTHER[sign]}]", "", text).replace(sign, "."))

    def step(self, cell: str) -> float:
        """Give the value of the last digit of a number."""
        return float(10.0 ** -len(re.split("[eE]", plain(cell))[0].partition(self.sign or ".")[2]))

    def named(self, cells: Sequence[str]) -> str | None:
        """Name the decimal sign of cells, None where none of them has one."""
        return NAMES[self.sign] if self.sign and any(self.sign in c for c in cells) else None


def decimals_of(
    columns: Mapping[str, Sequence[str]], rows: Sequence[int], stated: str | None, separator: str
) -> Decimals:
    """Decide on the decimal sign of a file from the cells of columns.

    ``stated`` is the sign that the file or the user says. Raises DataError for numbers with both.
    """
    shown = {head: [_shown_sign(cell) for cell in cells] for head, cells in columns.items()}
    sure: dict[str, str] = {}
    for head, signs in shown.items():
        for (sign, open_), cell, row in zip(signs, columns[head], rows, strict=True):
            if sign and not open_ and sign not in sure:
                sure[sign] = f"a {NAMES[sign]} ('{cell}', row {row})"
    if len(sure) > 1 or (stated and OTHER[stated] in sure):
        both = " and with ".join(sure[mark] for mark in sorted(sure))
        says = f", but {NAMES[stated]} is said to be the decimal sign" if stated else ""
        raise DataError(
            f"numbers with {both}{says}, which can be read in two ways; save it with one sign"
        )
    if stated:
        return Decimals(stated)
    sign, asked = next(iter(sure), None), []
    for head, signs in shown.items():
        marks = {mark for mark, open_ in signs if mark and open_}
        if not marks or (len(marks) == 1 and sign and sign not in marks):
            continue  # thousands, as the other sign is that of decimals
        if sign in marks and (sign, False) in signs:
            continue
        cells, place = columns[head], next(k for k, (_, open_) in enumerate(signs) if open_)
        one, bare = min(marks), any(re.fullmatch(r"0*[1-9]\d*", plain(cell)) for cell in cells)
        if len(marks) == 1 and not bare and (sign == one or (separator == "," and one == ".")):
            sign = one
            continue
        cell, mark = plain(cells[place]), str(signs[place][0])
        asked.append(
            f"column '{head}', row {rows[place]}: '{cell}' can be read as "
            f"{cell.replace(mark, '')}, --decimal {OTHER[mark]}, or as "
            f"{cell.replace(mark, '.')}, --decimal {mark}"
        )
    return Decimals(sign, tuple(asked))


SPEED, FORCE, TIME, LENGTH, MISC = "speed", "force", "time", "length", "other"


@dataclass(frozen=True)
class Unit:
    """A unit: its spelling, what it measures, and the factor to 1/min, N, s or mm."""

    text: str
    dimension: str
    factor: float


#: Spellings without blanks and in lower case but for N; each with the factor to the project's unit.
SPELLINGS: dict[str, dict[str, float]] = {
    SPEED: {
        **dict.fromkeys(("1/min", "rpm", "u/min", "upm", "min-1", "min^-1", "r/min", "rev/min",
                         "/min", "ot/min", "tr/min", "obr/min", "giri/min", "rot/min"), 1.0),
        **dict.fromkeys(("rad/s", "rads-1", "rad*s^-1"), 30.0 / math.pi),
        **dict.fromkeys(("hz", "u/s", "rps", "rev/s", "r/s"), 60.0),
        **dict.fromkeys(("1/s", "s-1", "s^-1", "/s"), math.nan),  # revolutions or radians
        **dict.fromkeys(("deg/s", "grad/s"), 1.0 / 6.0),
    },
    FORCE: {"N": 1.0, "newton": 1.0, "kn": 1e3, "dan": 10.0, "kgf": 9.80665, "kp": 9.80665,
            "lbf": 4.4482216152605},
    TIME: {"s": 1.0, "sec": 1.0, "sek": 1.0, "ms": 1e-3, "msec": 1e-3, "us": 1e-6},
    LENGTH: {"mm": 1.0, "m": 1e3, "cm": 10.0, "um": 1e-3},
    MISC: dict.fromkeys(("nm", "bar", "mbar", "pa", "mpa", "degc", "v", "mv", "a", "%", "kg",
                          "mm/s", "m/s", "j", "deg", "grad"), math.nan),
}  # fmt: skip
UNITS = {
    text: Unit(text, kind, by) for kind, texts in SPELLINGS.items() for text, by in texts.items()
}
_UNIT_SIGNS = str.maketrans({"\N{MICRO SIGN}": "u", "\N{GREEK SMALL LETTER MU}": "u", "°": "deg",
                       "\N{MINUS SIGN}": "-", "⁻": "-", "¹": "1", "·": "*"})  # fmt: skip
_BRACKETS = re.compile(r"^(.*?)\s*[\[({<]\s*([^\])}>]*?)\s*[\])}>]\s*(.*)$")
_LAST = re.compile(r"^(.+?)(?:\s+in\s+|\s*/\s*|[\s_,.]+)([^\s_]+)$")


def unit_named(text: str) -> Unit | None:
    """Find the unit of a spelling, None where it is none that is known."""
    bare = re.sub(r"\s+", "", text).translate(_UNIT_SIGNS)
    found = UNITS.get(bare if bare in ("N", "n") else bare.lower())
    return None if found is None else replace(found, text=text.strip())


def split_head(text: str) -> tuple[str, Unit | None, str | None]:
    """Divide the head of a column into name, unit, and what stands as a unit but is none known.

    A unit stands in brackets at the end (``F [kN]``), after "in" or a stroke (``F/kN``), or last
    (``t_shift ms``).
    """
    if found := _BRACKETS.match(text):
        name, inside, rest = found.groups()
        unit = unit_named(inside)
        if unit is not None:
            return f"{name} {rest}".strip(), unit, None
        strange = inside if "[" in text and inside not in ("", "-", "1") else None
        return f"{name} {inside if strange is None else ''} {rest}".strip(), None, strange
    if found := _LAST.match(text):
        name, last = found.groups()
        if "/" in last and unit_named(last) is None and unit_named(last.split("/", 1)[1]):
            name, last = f"{name} {last.split('/', 1)[0]}", last.split("/", 1)[1]
        if (unit := unit_named(last)) is not None:
            return name, unit, None
    return text, None, None


DATES = ("d/m/y", "m/d/y")  #: words in place of a unit, for dates that two readings have
SAMPLE = 200  #: cells by which a column is known as dates
_ORDER = re.compile(r"^(\d{1,2})([./-])(\d{1,2})[./-]\d{2,4}")
_MONTH = r"(?:jan|feb|mar|apr|may|jun|jul|aug|sep|oct|nov|dec)[a-z]*"
_DAY = re.compile(rf"(?i)\d[./-]\d{{1,2}}[./-]\d|\d[. -]*{_MONTH}|{_MONTH}[. -]+\d")
_CLOCK = re.compile(r"\b\d{1,2}:\d{2}")
_WORDS = re.compile(rf"(?i){_MONTH}|[ap]\.?m\.?|utc")


def seconds_of(text: str) -> float:
    """Convert a time stamp to s: ISO 8601 (UTC without a zone), or seconds.

    Raises ValueError for a text that is neither.
    """
    if is_plain(text):
        return float(text)
    moment = datetime.fromisoformat(text)
    return (moment if moment.tzinfo else moment.replace(tzinfo=UTC)).timestamp()


def is_plain(text: str) -> bool:
    """Test that a text is a number as programs write it."""
    try:
        float(text)
    except ValueError:
        return False
    return True


def has_day(cells: Sequence[str]) -> bool:
    """Test that cells have a date."""
    return any(_DAY.search(cell) for cell in cells[:SAMPLE])


def is_dated(cells: Sequence[str]) -> bool:
    """Test that most cells are dates or clocks, with no words but months and zones."""
    known = [cell for cell in cells[:SAMPLE] if cell]
    dated = [(_CLOCK.search(cell) or _DAY.search(cell))
             and not re.search(r"[A-Za-z]{2}", _WORDS.sub("", cell)) for cell in known]  # fmt: skip
    return 2 * sum(map(bool, dated)) > len(known)


def stamps_of(cells: Sequence[str], option: str) -> tuple[list[str], str]:
    """Convert dates to ISO 8601, and clocks without a date to s; also tell how they are read.

    ``option`` is one of ``DATES`` or empty. Raises DataError for other cells, and for those that
    can be read in two ways.
    """
    import pandas as pd  # noqa: PLC0415  # slow to load, and most tables have no dates

    if len(days := {bool(_DAY.search(cell)) for cell in cells}) > 1:
        raise DataError("has a date in some cells and none in others")
    orders = [found for cell in cells if (found := _ORDER.match(cell))]
    day, month = (any(int(found[k]) > 12 for found in orders) for k in (1, 3))
    first = any(found[2] == "." for found in orders) or option == "d/m/y"
    if len({found[0] for found in orders}) > 1 and not (first or option or day or month):
        raise DataError(
            f"may have its day or its month first ('{cells[0]}'); say which behind the column: "
            "--column timestamp=COLUMN:d/m/y or COLUMN:m/d/y"
        )
    first = first or (option != "m/d/y" and not month)
    whole = pd.Series(cells).str.replace(r"(?<=:\d\d),(?=\d)", ".", regex=True)
    whole = whole if True in days else "2000-01-01 " + whole
    try:
        found = pd.to_datetime(whole, format="mixed", dayfirst=first and bool(orders), utc=True)
    except (ValueError, OverflowError) as error:
        raise DataError(f"has cells that are no dates ({str(error).splitlines()[0]})") from error
    if True in days:
        way = f", {'day' if first else 'month'} first" if orders else ""
        return [one.isoformat() for one in found], f"dates{way}"
    seconds = (found - found.dt.normalize()).dt.total_seconds()
    seconds += 86_400.0 * (seconds.diff() < -43_200.0).cumsum()  # after midnight
    return [f"{one:.12g}" for one in seconds], "clock without a date"


NOTHING = frozenset(("", "-", "--", "n/a", "na", "nan", "#n/a", "none", "null", "k.a.", "#nv"))
YES = ("true", "yes", "ja", "1", "ok", "i.o.", "io", "i.o", "wahr", "x", "engaged", "y", "j", "oui",
       "si", "sí", "ano", "tak", "pass", "passed", "✓", "✔")  # fmt: skip
NO = ("false", "no", "nein", "0", "nok", "n.i.o.", "nio", "n.i.o", "falsch", "failed", "fail", "n",
      "non", "ne", "nie", "✗", "✘")  # fmt: skip
ANSWERS = {**dict.fromkeys(NOTHING), "unknown": None, **dict.fromkeys(YES, True),
           **dict.fromkeys(NO, False)}  # fmt: skip


@dataclass(frozen=True)
class Quantity:
    """A quantity that is looked for: name, kind, words for it and against it, parted by strokes.

    ``loose`` words may also mean something else; ``needed`` says that a table is of no use without
    the quantity. ``also`` is a kind that its numbers may have though it needs none.
    """

    name: str
    dimension: str | None
    words: str
    loose: str = ""
    against: str = ""
    needed: bool = False
    also: str | None = None

    @property
    def units(self) -> str:
        """Spellings of units that it may have."""
        return ", ".join(text for text, one in UNITS.items() if one.dimension == self.dimension)


_SPREAD = "|std|sd|sigma|streuung|abweichung|min|max|deviation|stdev"
_FORCE = (
    "shift force|schaltkraft|stellkraft|aktorkraft|axialkraft|f shift|f axial|f act|f schalt|f ax"
)
SHIFTS = (
    Quantity(
        "mismatch_rpm", SPEED,
        "mismatch|drehzahldifferenz|differenzdrehzahl|relativdrehzahl|delta n|delta omega|dn|d n|"
        "n diff|diff n|speed difference|relative speed|schlupfdrehzahl|delta speed|delta rpm",
        "slip|schlupf|rpm|drehzahl|n",
        "output|abtrieb|antrieb|input|in|out|shaft|welle" + _SPREAD, needed=True,
    ),
    Quantity("force_N", FORCE, _FORCE, "force|kraft|f", "rise|anstieg|time|zeit" + _SPREAD,
             needed=True),
    Quantity(
        "force_rise_s", TIME,
        "force rise|rise time|anstiegszeit|kraftanstieg|t rise|t anstieg|t ramp|t an|t anst",
        "rise|anstieg|ramp|rampe", _SPREAD[1:],
    ),
    Quantity("n_shifts", None,
             "n shifts|anzahl schaltungen|repeats|repetitions|wiederholungen",
             "shifts|count|anzahl|number|schaltungen|samples|n"),
    Quantity(
        "shift_time_s", TIME,
        "shift time|schaltzeit|schaltdauer|t shift|t schalt|mean shift time|mittlere schaltzeit",
        "mean time|t mean|time|zeit|dauer|duration|t",
        "rise|anstieg|ramp|rampe|stamp|stempel|timeout|datum|delay" + _SPREAD, needed=True,
    ),
    Quantity(
        "engaged", None, "engaged|eingelegt|geschaltet|eingerueckt|eingespurt",
        "erfolg|erfolgreich|success|ok|i o|io|result|ergebnis|status",
        "not|nicht|no|n|fail|failed|failure|fehler|error",
    ),
    Quantity("trace", None, "trace|trace file|messdatei|measurement file",
             "file|datei|dateiname|filename"),
    Quantity(
        "shift_time_sd_s", TIME,
        "std|sd|stdev|stddev|sigma|streuung|standardabweichung|standard deviation|"
        "standard abweichung|std dev",
        "", "f|force|kraft|n|mismatch|drehzahl|rise|anstieg|error",
    ),
    Quantity(
        "order", None,
        "order|run order|reihenfolge|lfd nr|lfd|laufende nummer|laufnummer|sequence|sequenz|"
        "run number|run no|versuchsnummer|shift number",
    ),
    Quantity("timestamp", None,
             "timestamp|time stamp|zeitstempel|datum|date|date time|datum uhrzeit", also=TIME),
)  # fmt: skip
TRACE = (
    Quantity("t_s", TIME, "", "t|time|zeit", needed=True),
    Quantity("displacement_mm", LENGTH,
             "displacement|schaltweg|s sleeve|sleeve position|muffenweg", "weg|travel|position|x|s",
             needed=True),
    Quantity("force_N", FORCE, _FORCE, "force|kraft|f", needed=True),
    Quantity(
        "sliding_speed_rpm", SPEED,
        "sliding speed|speed sliding|n sleeve|n muffe|drehzahl muffe|sleeve speed|muffendrehzahl|"
        "n sliding",
        "n antrieb|antriebsdrehzahl|input speed|n in", needed=True,
    ),
    Quantity(
        "output_speed_rpm", SPEED,
        "output speed|speed output|n rad|n gear|drehzahl rad|gear speed|raddrehzahl|n output|"
        "n abtrieb|abtriebsdrehzahl",
        "n out", needed=True,
    ),
)  # fmt: skip
