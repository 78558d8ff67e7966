"""Errors that a user can cause, each with a sentence that says what to do.

One root class; a message names the quantity, its value and unit, the rule and
the remedy. The command line prints it and exits with status 2.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable

from sim.units import unit_of


class DogshapeError(Exception):
    """Root of every error that is the input's fault and not the program's."""


class InputError(DogshapeError):
    """A value, key or file that cannot be used."""


class GeometryError(DogshapeError):
    """A dog that cannot be made or a pair of rings that cannot mesh."""


class DataError(DogshapeError):
    """A bench data set or stored result that cannot be read."""


class StorageError(DogshapeError):
    """A study folder or storage that is in use, of another version or damaged."""


class WorkerError(DogshapeError):
    """Worker processes or a cluster that cannot be reached or cannot go on."""


def number(value: float) -> str:
    """Format ``value`` for a sentence: up to six significant digits."""
    return f"{value:.6g}"


def refusal(quantity: str, value: float, unit: str, rule: str, remedy: str) -> str:
    """Return the sentence ``quantity is value unit, but rule; remedy.``"""
    amount = f"{number(value)} {unit}".strip()
    return f"{quantity} is {amount}, but {rule}; {remedy}."


def require_between(name: str, value: float, low: float, high: float, remedy: str) -> None:
    """Raise InputError unless ``low <= value <= high``; the unit is what ``name`` ends in."""
    if not low <= value <= high:
        unit = unit_of(name)
        rule = f"it must lie between {number(low)} and {number(high)} {unit}".rstrip()
        raise InputError(refusal(name, value, unit, rule, remedy))


def did_you_mean(name: str, valid: Iterable[str]) -> str:
    """Return a closing remark with the nearest valid name, or the whole list."""
    names = sorted(valid)
    near = difflib.get_close_matches(name, names, n=1, cutoff=0.6)
    if near:
        return f"did you mean '{near[0]}'?"
    return "valid are " + ", ".join(names)
