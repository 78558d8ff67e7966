"""Units as people write them at the head of a column, and what leads to the project's own."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, replace

SPEED, FORCE, TIME, LENGTH, OTHER = "speed", "force", "time", "length", "other"


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
    OTHER: dict.fromkeys(("nm", "bar", "mbar", "pa", "mpa", "degc", "v", "mv", "a", "%", "kg",
                          "mm/s", "m/s", "j", "deg", "grad"), math.nan),
}  # fmt: skip
UNITS = {
    text: Unit(text, kind, by) for kind, texts in SPELLINGS.items() for text, by in texts.items()
}
_SAME = str.maketrans({"\N{MICRO SIGN}": "u", "\N{GREEK SMALL LETTER MU}": "u", "°": "deg",
                       "\N{MINUS SIGN}": "-", "⁻": "-", "¹": "1", "·": "*"})  # fmt: skip
_BRACKETS = re.compile(r"^(.*?)\s*[\[({<]\s*([^\])}>]*?)\s*[\])}>]\s*(.*)$")
_LAST = re.compile(r"^(.+?)(?:\s+in\s+|\s*/\s*|[\s_,.]+)([^\s_]+)$")


def unit_named(text: str) -> Unit | None:
    """Find the unit of a spelling, None where it is none that is known."""
    plain = re.sub(r"\s+", "", text).translate(_SAME)
    found = UNITS.get(plain if plain in ("N", "n") else plain.lower())
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
