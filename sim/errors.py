"""Errors that a user can cause, each with a sentence: quantity, value, unit, rule and remedy."""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from dataclasses import MISSING, field, fields
from functools import lru_cache
from typing import Any, NamedTuple

from dogshape.sim.units import from_si, unit_of


class DogshapeError(Exception):
    """Root of every error that is the input's fault and not the program's."""


class InputError(DogshapeError):
    """A value, key or file that cannot be used."""


class GeometryError(DogshapeError):
    """A dog that cannot be made or a pair of rings that cannot mesh."""


class EffectError(DogshapeError):
    """An effect whose program is wrong, whatever the values of its parameters."""


class DataError(DogshapeError):
    """A bench data set or stored result that cannot be read."""


class StorageError(DogshapeError):
    """A study folder or storage that is in use, of another version or damaged."""


class WorkerError(DogshapeError):
    """Worker processes or a cluster that cannot be reached or cannot go on."""


class EngineError(DogshapeError):
    """Engines that do not agree on the shifts of a study."""


def number(value: float) -> str:
    """Format ``value`` for a sentence: up to six significant digits."""
    return f"{value:.6g}"


def refusal(quantity: str, value: float, unit: str, rule: str, remedy: str) -> str:
    """Return the sentence ``quantity is value unit, but rule; remedy``"""
    amount = f"{number(value)} {unit}".strip()
    return f"{quantity} is {amount}, but {rule}; {remedy}"


def require_between(name: str, value: float, low: float, high: float, remedy: str) -> None:
    """Raise InputError unless ``low <= value <= high``; the unit is what ``name`` ends in."""
    if not low <= value <= high:
        unit = unit_of(name)
        rule = f"it must lie between {number(low)} and {number(high)} {unit}".rstrip()
        raise InputError(refusal(name, value, unit, rule, remedy))


def require_parts(section: str, parts: Any, sides: Any, remedy: str, *, rest: bool = False) -> None:
    """Raise InputError where an inertia is more than its side's, or leaves no ``rest``, kg m2."""
    for name, side in (("ring", "sliding"), ("wheel", "output")):
        part, whole = getattr(parts, f"{name}_inertia"), getattr(sides, f"{side}_inertia")
        if part > whole or (rest and part == whole):
            key, rule = f"{section}.{name}_inertia_kgm2", f"it is a part of {side}.inertia_kgm2"
            raise InputError(refusal(key, part, "kg m2", f"{rule} = {whole:.6g}", remedy))


class Range(NamedTuple):
    """Key of a field in a file, range there, and remedy of a value beyond it."""

    key: str
    low: float
    high: float
    remedy: str


def within(key: str, low: float, high: float, default: Any = MISSING, *, remedy: str = "") -> Any:
    """Declare a field of a dataclass with its key in a file and its range there."""
    return field(default=default, metadata={"range": Range(key, low, high, remedy)})


@lru_cache
def ranges_of(kind: Any) -> dict[str, Range]:
    """Return the ranges of a dataclass by the names of its fields."""
    return {one.name: one.metadata["range"] for one in fields(kind) if "range" in one.metadata}


def ranged_record(value: Any) -> dict[str, Any]:
    """Return the fields of a value that have a range, by their keys in a file and in its units."""
    kind: Any = type(value)
    return {key: from_si(key, getattr(value, name)) for name, (key, *_) in ranges_of(kind).items()}


def require_ranges(value: Any, section: str, remedy: str) -> None:
    """Raise InputError where a field of a value of ``section`` is beyond its range; None is not."""
    kind: Any = type(value)
    for name, (key, low, high, own) in ranges_of(kind).items():
        given = from_si(key, getattr(value, name))
        if given is not None and not low <= given <= high:  # in millions of shifts hardly one
            require_between(f"{section}.{key}".lstrip("."), given, low, high, own or remedy)


def did_you_mean(name: str, valid: Iterable[str]) -> str:
    """Return a closing remark with the nearest valid names, or the whole list.

    Case is no difference; names that hold the given one are near it.
    """
    names = sorted(valid)
    low = {one.lower(): one for one in names}
    given = name.strip().lower()
    near = difflib.get_close_matches(given, low, n=1, cutoff=0.6)
    holding = [one for one in low if len(given) > 3 and given in one]
    found = [low[one] for one in dict.fromkeys([*near, *holding])][:3]
    if found:
        return "did you mean " + " or ".join(f"'{one}'" for one in found) + "?"
    return "valid are " + ", ".join(names)


def require_known(name: str, value: str, kind: str, valid: Iterable[str]) -> None:
    """Raise InputError unless a value is one of the valid ones; ``kind`` with its article."""
    if value not in (known := tuple(valid)):
        raise InputError(f"{name} is '{value}', which is not {kind}; {did_you_mean(value, known)}")


def meant_number(text: str) -> float | None:
    """Return the number that a text means by a decimal comma or a typeset minus, if it does."""
    plain = text.strip().replace("\N{MINUS SIGN}", "-").replace("\N{EN DASH}", "-")
    try:
        return float(plain.replace(",", ".") if plain.count(",") == 1 else plain)
    except ValueError:
        return None


def number_rule(text: str) -> str:
    """Give the rule for a number that a text breaks, with the right spelling where it is plain."""
    meant = meant_number(text)
    return "a number" if meant is None else f"a number with a point and a plain minus, as {meant:g}"
