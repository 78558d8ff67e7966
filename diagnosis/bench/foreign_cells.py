"""Cells of tables as people and loggers write them: numbers, units, dates and words.

A file has one decimal sign. ``1,200`` is 1200 or 1.2, which other numbers of the file decide, or a
statement of the file or of the user; otherwise it is a question.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

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


def numbers_of(cells: Sequence[str], sign: str | None = None) -> Array:
    """Convert cells with a decimal sign, None for any, (cells,); NaN where one is no number."""

    def value(text: str) -> float:
        if not _NUMBER.fullmatch(text):
            return math.nan
        own = sign or ("," if "," in text and "." not in text else ".")
        return float(re.sub(f"[ '{OTHER[own]}]", "", text).replace(own, "."))

    return np.array([value(plain(cell)) for cell in cells], dtype=float)


def decimal_sign(
    columns: Mapping[str, Sequence[str]], rows: Sequence[int], stated: str | None, separator: str
) -> str | None:
    """Decide on the decimal sign of a file, None where no number has one.

    ``stated`` is the sign that the file or the user says. Raises DataError for numbers with both
    signs, and for those that can be read in two ways.
    """
    sure: dict[str, str] = {}
    asked: dict[str, str] = {}
    for head, cells in columns.items():
        for cell, row in zip(map(plain, cells), rows, strict=True):
            if is_number(cell) and (marks := re.findall("[.,]", cell)):
                mark = marks[-1] if marks.count(marks[-1]) == 1 else OTHER[marks[-1]]
                if not _EITHER.fullmatch(cell):
                    sure.setdefault(mark, f"a {NAMES[mark]} ('{cell}', row {row})")
                    continue
                asked.setdefault(
                    mark, f"column '{head}', row {row}: '{cell}' can be read as "
                    f"{cell.replace(mark, '')}, --decimal {OTHER[mark]}, or as "
                    f"{cell.replace(mark, '.')}, --decimal {mark}",
                )  # fmt: skip
    if len(sure) > 1 or (stated and OTHER[stated] in sure):
        both = " and with ".join(sure[mark] for mark in sorted(sure))
        says = f", but {NAMES[stated]} is said to be the decimal sign" if stated else ""
        raise DataError(
            f"numbers with {both}{says}, which can be read in two ways; save it with one sign"
        )
    sign = stated or next(iter(sure), None)
    if sign or not asked:
        return sign
    mixed = [cells for cells in columns.values() if any(map(_EITHER.fullmatch, cells))]
    whole = any(re.fullmatch(r"0*[1-9]\d*", cell) for cells in mixed for cell in cells)
    if separator == "," and set(asked) == {"."} and not whole:
        return "."
    raise DataError("; ".join(asked.values()))


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


#: Dates and clocks that are read without a statement; Python's directives, or pandas' ISO 8601.
FORMS = ("ISO8601", "%d.%m.%Y %H:%M:%S.%f", "%d.%m.%Y %H:%M:%S", "%d.%m.%Y %H:%M", "%d.%m.%Y",
         "%H:%M:%S.%f", "%H:%M:%S", "%H:%M")  # fmt: skip
_DATED = re.compile(r"\d[./-]\d{1,2}[./-]\d|\d-[A-Za-z]{3}-\d|\b\d{1,2}:\d{2}")


def is_dated(cells: Sequence[str]) -> bool:
    """Test that most cells are dates or clocks."""
    known = [cell for cell in cells if cell]
    return 2 * sum(bool(_DATED.search(cell)) for cell in known) > len(known)


def stamps_of(cells: Sequence[str], form: str) -> tuple[list[str], str]:
    """Convert dates to ISO 8601, and clocks without a date to s; also tell the form they have.

    ``form`` has directives such as ``%d/%m/%Y``; empty finds one of ``FORMS``. Raises DataError for
    other cells.
    """
    import pandas as pd  # noqa: PLC0415  # slow to load, and most tables have no dates

    whole = pd.Series(cells, dtype=object).str.replace(r"(?<=:\d\d),(?=\d)", ".", regex=True)
    tried = {way: pd.to_datetime(whole, format=way, errors="coerce", utc=True)
             for way in ((form,) if form else FORMS)}  # fmt: skip
    way, found = min(tried.items(), key=lambda one: one[1].isna().sum())
    if (wrong := found.isna()).any():
        raise DataError(
            f"has '{cells[int(wrong.argmax())]}', which is no date and time as "
            f"{form or '2024-05-31 14:05:09 or 31.05.2024 14:05:09'}; say its form behind the "
            "column: --column timestamp='COLUMN:%d/%m/%Y %H:%M:%S'"
        )
    if way == FORMS[0] or "%d" in way:
        return [one.isoformat() for one in found], f"dates as {way}"
    seconds = (found - found.dt.normalize()).dt.total_seconds()
    seconds += 86_400.0 * (seconds.diff() < -43_200.0).cumsum()  # after midnight
    return [f"{one:.12g}" for one in seconds], "clock without a date"


NOTHING = frozenset(("", "-", "--", "n/a", "na", "nan", "#n/a", "none", "null", "k.a.", "#nv"))
YES = ("true", "yes", "ja", "1", "ok", "i.o.", "io", "i.o", "wahr", "x", "engaged", "y", "j", "oui",
       "si", "sí", "ano", "tak", "pass", "passed", "✓", "✔")  # fmt: skip
NO = ("false", "no", "nein", "0", "nok", "n.i.o.", "nio", "n.i.o", "falsch", "failed", "fail", "n",
      "non", "ne", "nie", "✗", "✘")  # fmt: skip
ANSWERS = {**dict.fromkeys((*NOTHING, "empty", "unknown")), **dict.fromkeys(YES, True),
           **dict.fromkeys(NO, False)}  # fmt: skip


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
    Quantity(
        "mismatch_rpm", SPEED,
        r"\w*mismatch|(\w*differenz|relativ|schlupf)drehzahl|drehzahldifferenz|d n|dn|delta \w+"
        "|n diff|diff n|(speed|rpm) difference|relative speed",
        r"slip|schlupf|rpm|\w*drehzahl|n",
        "output|abtrieb|antrieb|input|in|out|shaft|welle|" + _SPREAD, needed=True, filled=True,
    ),
    Quantity("force_N", FORCE, _FORCE, r"\w*force|\w*kraft|f",
             f"time|zeit|{_RISE}|{_SPREAD}", needed=True, filled=True),
    Quantity("force_rise_s", TIME,
             r"(force )?rise( time)?|anstiegszeit|kraftanstieg|t (rise|anstieg|ramp|an|anst)",
             _RISE, _SPREAD),
    Quantity("n_shifts", None, "n shifts|anzahl schaltungen|repeats|repetitions|wiederholungen",
             r"shifts|count|anzahl|number|schaltungen|samples|n"),
    Quantity(
        "shift_time_s", TIME, r"shift time|\w*schalt(zeit|dauer)|t (shift|schalt)",
        r"\w*time|\w*zeit|\w*dauer|duration|t|t\d+",
        f"stamp|zeitstempel|timeout|datum|date|delay|{_RISE}|{_SPREAD}", needed=True,
    ),
    Quantity(
        "engaged", None, "engaged|eingelegt|geschaltet|eingerueckt|eingespurt",
        "erfolg|erfolgreich|success|ok|i o|io|result|ergebnis|status",
        r"not|nicht|no|n|fail\w*|fehler|error",
    ),
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
