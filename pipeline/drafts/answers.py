"""Numbers as a user types them in a dialogue: units, ranges, decimal commas.

``25 deg``, ``40 ms``, ``-500 to 800``, ``0,6``. A number has the unit of its question unless the
answer names another one of the same quantity.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from dogshape.diagnosis.bench.cell_values import FORCE, LENGTH, SPEED, TIME, bare_unit, unit_named
from dogshape.sim.errors import InputError, meant_number
from dogshape.sim.units import DEG

#: Factors to a unit of the study file, by spelling without blanks.
SPELLINGS: dict[str, dict[str, float]] = {
    "deg": {"deg": 1.0, "degrees": 1.0, "rad": 1.0 / DEG, "mrad": 1e-3 / DEG},
    "kg": {"kg": 1.0, "g": 1e-3, "t": 1e3},
    "kg m2": {"kgm2": 1.0, "gm2": 1e-3, "kgcm2": 1e-4, "kgmm2": 1e-6},
    "N m": {"Nm": 1.0, "kNm": 1e3, "Nmm": 1e-3},
    "N m/rad": {"Nm/rad": 1.0, "kNm/rad": 1e3, "Nm/deg": 1.0 / DEG, "kNm/deg": 1e3 / DEG},
}
#: Dimension of a unit that tables of benches have too.
DIMENSIONS = {"1/min": SPEED, "N": FORCE, "s": TIME, "mm": LENGTH}
_RANGE = re.compile(r"\s+(?:to|bis)\s+|\s*(?:\.\.\.?|\N{HORIZONTAL ELLIPSIS})\s*")
_NUMBER = re.compile(
    r"(?P<number>[-+\N{MINUS SIGN}\N{EN DASH}]?(?:\d+(?:[.,]\d+)*[.]?|[.]\d+)(?:[eE][-+]?\d+)?)"
    r"\s*(?P<unit>(?:1/min|[^\W\d_]|\N{DEGREE SIGN})"
    r"(?:[\w/\N{MIDDLE DOT}*^\N{DEGREE SIGN}]|\s(?=[^\W\d]))*)?\s*[;,]?\s*"
)
#: ``3,200`` is a number with a decimal comma or with a separator of thousands.
_AMBIGUOUS = re.compile(r"[1-9]\d{0,2},\d{3}")


@dataclass(frozen=True)
class Answer:
    """Numbers of an answer in the unit of its question; two ends of a range if ``ranged``."""

    numbers: tuple[float, ...]
    ranged: bool = False


def read_numbers(text: str, unit: str, others: Mapping[str, float] | None = None) -> Answer:
    """Read an answer to a question in ``unit``.

    ``others`` are factors to that unit of further units, by their spelling without blanks. Raises
    InputError for an answer that is no list of numbers and no range, and for an unknown unit.
    """
    parts = [part.strip() for part in _RANGE.split(text.strip())]
    if len(parts) > 2:
        raise InputError("give a range as LOW to HIGH")
    found = [pair for part in parts for pair in _pairs(part)]
    if len(parts) == 2:
        if len(found) != 2:
            raise InputError("give a range as LOW to HIGH")
        (low, low_unit), (high, high_unit) = found
        found = [(low, low_unit or high_unit), (high, high_unit)]
    numbers = tuple(number * _factor(word, unit, others or {}) for number, word in found)
    if len(parts) == 2 and not numbers[0] < numbers[1]:
        raise InputError(f"the range {text.strip()} has its larger end first; exchange the ends")
    return Answer(numbers, ranged=len(parts) == 2)


def number_of(text: str) -> float:
    """Read a number without a unit; InputError for anything else."""
    numbers = read_numbers(text, "").numbers
    if len(numbers) != 1:
        raise InputError("give a number")
    return numbers[0]


def _pairs(text: str) -> list[tuple[float, str]]:
    """Divide a text into numbers, each with the unit behind it or ``""``."""
    pairs, place = list[tuple[float, str]](), 0
    while place < len(text):
        match = _NUMBER.match(text, place)
        number = meant_number(match["number"]) if match else None
        if match is None or number is None or not math.isfinite(number):
            raise InputError(f"'{text[place:]}' is no number")
        if _AMBIGUOUS.fullmatch(match["number"].lstrip("+-\N{MINUS SIGN}\N{EN DASH}")):
            whole = match["number"].replace(",", "")
            raise InputError(
                f"{match['number']} may be {whole} or {number:g}; write it without the comma"
            )
        pairs.append((number, (match["unit"] or "").strip()))
        place = match.end()
    if not pairs:
        raise InputError("there is no number")
    return pairs


def _factor(word: str, unit: str, others: Mapping[str, float]) -> float:
    """Return the factor from the unit that a ``word`` spells to ``unit``; InputError if unknown."""
    if not word:
        return 1.0
    spelled = bare_unit(word).replace("*", "")
    factors = {**SPELLINGS.get(unit, {}), **others}
    if spelled in factors:
        return factors[spelled]
    known = unit_named(word)
    if known is not None and known.dimension == DIMENSIONS.get(unit):
        return known.factor
    remedy = f"give it in {unit or 'plain numbers'}"
    if unit == "N" and spelled.lower() in ("bar", "mpa"):
        remedy += ", pressure times area: 1 bar on 1 cm2 is 10 N"
    raise InputError(f"'{word}' is no unit of this quantity; {remedy}")


def shown_value(value: Any) -> str:
    """Write a default as a user would type it."""
    if isinstance(value, Mapping):
        return f"{value['low']:g} to {value['high']:g}"
    values = value if isinstance(value, (list, tuple)) else [value]
    return " ".join(f"{one:g}" if isinstance(one, float) else f"{one}" for one in values)
