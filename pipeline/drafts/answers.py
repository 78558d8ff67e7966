"""Numbers as a user types them in a dialogue: units, ranges, decimal commas.

``25 deg``, ``40 ms``, ``-500 to 800``, ``0,6``. A number has the unit of its question unless the
answer names another one of the same quantity.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from dogshape.bench.cell_values import FORCE, LENGTH, SPEED, TIME, bare_unit, unit_named
from dogshape.sim.clutch_tables import RANGE_WORD
from dogshape.sim.errors import InputError, meant_number
from dogshape.sim.units import DEG

#: Sonic conductance of an opening, dm3/(s bar) per mm2 (ISO 6358-1: 5 mm2 have about 1).
CONDUCTANCE_OF_OPENING = 0.2
#: Factors to a unit of the study file, by spelling without blanks.
SPELLINGS: dict[str, dict[str, float]] = {
    "deg": {"deg": 1.0, "degrees": 1.0, "rad": 1.0 / DEG, "mrad": 1e-3 / DEG},
    "kg": {"kg": 1.0, "g": 1e-3, "t": 1e3},
    "kg m2": {"kgm2": 1.0, "gm2": 1e-3, "kgcm2": 1e-4, "kgmm2": 1e-6},
    "bar": {"bar": 1.0, "MPa": 10.0, "kPa": 0.01, "Pa": 1e-5, "psi": 0.0689476},
    "cm2": {"cm2": 1.0, "mm2": 0.01, "dm2": 100.0, "m2": 1e4},
    "cm3": {"cm3": 1.0, "ml": 1.0, "mm3": 1e-3, "dm3": 1e3, "l": 1e3},
    "l/min": {"l/min": 1.0, "dm3/min": 1.0, "l/h": 1.0 / 60.0, "l/s": 60.0, "m3/h": 1e3 / 60.0},
    "dm3/(s bar)": {
        **dict.fromkeys(("dm3/(sbar)", "dm3/sbar", "l/(sbar)", "l/sbar"), 1.0),
        **dict.fromkeys(("l/(minbar)", "l/minbar", "dm3/(minbar)"), 1.0 / 60.0),
        "mm2": CONDUCTANCE_OF_OPENING,
        "cm2": 100.0 * CONDUCTANCE_OF_OPENING,
    },
    "V": {"V": 1.0},
    "A": {"A": 1.0, "mA": 1e-3},
    "ohm": {"ohm": 1.0, "Ohm": 1.0},
    "mH": {"mH": 1.0, "H": 1e3},
    "N/mm": {"N/mm": 1.0, "kN/m": 1.0, "kN/mm": 1e3},
    "MPa": {"MPa": 1.0, "GPa": 1e3, "bar": 0.1},
    "N m": {"Nm": 1.0, "kNm": 1e3, "Nmm": 1e-3},
    "N m/rad": {"Nm/rad": 1.0, "kNm/rad": 1e3, "Nm/deg": 1.0 / DEG, "kNm/deg": 1e3 / DEG},
}
#: Dimension of a unit that tables of benches have too.
DIMENSIONS = {"1/min": SPEED, "N": FORCE, "s": TIME, "mm": LENGTH}
_NUMBER = re.compile(
    r"(?P<number>[-+\N{MINUS SIGN}\N{EN DASH}]?(?:\d+(?:[.,]\d+)*[.]?|[.]\d+)(?:[eE][-+]?\d+)?)"
    r"\s*(?P<unit>(?:1/min|[^\W\d_]|\N{DEGREE SIGN})"
    r"(?:[\w/()\N{MIDDLE DOT}*^\N{DEGREE SIGN}]|\s(?=[^\W\d]))*)?\s*[;,]?\s*"
)
#: ``3,200`` is a number with a decimal comma or with a separator of thousands.
_AMBIGUOUS = re.compile(r"[1-9]\d{0,2},\d{3}")


@dataclass(frozen=True)
class TypedAnswer:
    """Numbers of an answer."""

    numbers: tuple[float, ...]  #: in the unit of the question
    ranged: bool  #: whether they are the two ends of a range


def read_numbers(text: str, unit: str, factors: Mapping[str, float] | None = None) -> TypedAnswer:
    """Read an answer to a question in ``unit``.

    ``factors`` to that unit are those of further units, by their spelling without blanks. Raises
    InputError for an answer that is neither a list of numbers nor a range, or an unknown unit.
    """
    parts = [part.strip() for part in RANGE_WORD.split(text.strip())]
    ranged = len(parts) == 2
    if len(parts) > 2:
        raise InputError("give a range as LOW to HIGH")
    pairs: list[tuple[float, str]] = []
    for part in parts:
        pairs += _pairs(part)
    if ranged:
        if len(pairs) != 2:
            raise InputError("give a range as LOW to HIGH")
        (low, low_unit), (high, high_unit) = pairs
        pairs = [(low, low_unit or high_unit), (high, high_unit)]
    numbers = tuple(number * _factor(word, unit, factors or {}) for number, word in pairs)
    if ranged and not numbers[0] < numbers[1]:
        raise InputError(f"the range {text.strip()} has its larger end first; exchange the ends")
    return TypedAnswer(numbers, ranged=ranged)


def read_sum(text: str, unit: str) -> TypedAnswer:
    """Read a sum such as ``600 + 650 mm2`` as one number in ``unit``.

    A term without a unit has that of the next one. InputError for a term that is no number.
    """
    total = 0.0
    word = ""
    for term in reversed(text.split("+")):
        pairs = _pairs(term.strip())
        if len(pairs) != 1:
            raise InputError("give one number, or a sum such as 6 + 6.5")
        ((number, own_word),) = pairs
        word = own_word or word
        total += number * _factor(word, unit, {})
    return TypedAnswer((total,), ranged=False)


def number_of(text: str) -> float:
    """Read a number without a unit; InputError for anything else."""
    numbers = read_numbers(text, "").numbers
    if len(numbers) != 1:
        raise InputError("give a number")
    return numbers[0]


def choice_of(text: str, choices: Sequence[str]) -> str:
    """Read an answer that is a text, one of ``choices`` if there are any; else InputError."""
    if choices and text not in choices:
        raise InputError(f"give one of {', '.join(choices)}")
    return text.strip()


def _pairs(text: str) -> list[tuple[float, str]]:
    """Divide a text into numbers, each with the unit behind it or ``""``."""
    pairs: list[tuple[float, str]] = []
    place = 0
    while place < len(text):
        match = _NUMBER.match(text, place)
        digits, unit = match.groups("") if match else ("", "")
        number = meant_number(digits)
        if match is None or number is None or not math.isfinite(number):
            raise InputError(f"'{text[place:]}' is no number")
        if _AMBIGUOUS.fullmatch(digits.lstrip("+-\N{MINUS SIGN}\N{EN DASH}")):
            thousands = digits.replace(",", "")
            raise InputError(
                f"{digits} may be {thousands} or {number:g}; write it without the comma"
            )
        pairs.append((number, unit.strip()))
        place = match.end()
    if not pairs:
        raise InputError("there is no number")
    return pairs


def _factor(word: str, unit: str, other_factors: Mapping[str, float]) -> float:
    """Return the factor from the unit that ``word`` spells to ``unit``; InputError if unknown."""
    if not word:
        return 1.0
    spelling = bare_unit(word).replace("*", "")
    factors = {**SPELLINGS.get(unit, {}), **other_factors}
    if spelling in factors:
        return factors[spelling]
    bench_unit = unit_named(word)
    if bench_unit is not None and bench_unit.dimension == DIMENSIONS.get(unit):
        return bench_unit.factor
    remedy = f"give it in {unit or 'plain numbers'}"
    if unit == "N" and spelling.lower() in ("bar", "mpa"):
        remedy += ", pressure times area: 1 bar on 1 cm2 is 10 N"
    raise InputError(f"'{word}' is no unit of this quantity; {remedy}")


def shown_value(value: Any) -> str:
    """Format a default as a user would type it."""
    if isinstance(value, Mapping):
        return f"{value['low']:g} to {value['high']:g}"
    parts = value if isinstance(value, (list, tuple)) else [value]
    return " ".join(f"{part:g}" if isinstance(part, float) else f"{part}" for part in parts)
