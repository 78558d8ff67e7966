"""Errors that a user can cause, each with a sentence: quantity, value, unit, rule and remedy."""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from dogshape.sim.units import unit_of


@dataclass(frozen=True)
class Refusal:
    """Refusal of a value; as text ``quantity is value unit, but rule; remedy``."""

    quantity: str
    value: float
    unit: str
    rule: str
    remedy: str

    def __str__(self) -> str:
        amount = f"{number(self.value)} {self.unit}".strip()
        return f"{self.quantity} is {amount}, but {self.rule}; {self.remedy}"


class DogshapeError(Exception):
    """Root of every error that is the input's fault and not the program's.

    The argument is a sentence or, of a value that breaks a rule, a ``Refusal``.
    """

    @property
    def refusal(self) -> Refusal | None:
        """Quantity, value, unit, rule and remedy; None for an error that has a sentence alone."""
        return self.args[0] if self.args and isinstance(self.args[0], Refusal) else None


class InputError(DogshapeError):
    """A value, key or file that cannot be used."""


class GeometryError(DogshapeError):
    """A dog that cannot be made or a pair of rings that cannot mesh."""


class EffectError(DogshapeError):
    """An effect whose program fails for any values of its parameters."""


class DataError(DogshapeError):
    """A bench data set or stored result that cannot be read."""


class StorageError(DogshapeError):
    """A study folder or storage that is in use, of another version or damaged."""


class WorkerError(DogshapeError):
    """Worker processes or a cluster that cannot be reached or cannot go on."""


class EngineError(DogshapeError):
    """Engines that do not agree on the shifts of a study, or one that cannot go on with a shift."""


def number(value: float) -> str:
    """Format ``value`` for a sentence: up to six significant digits."""
    return f"{value:.6g}"


def require_between(name: str, value: float, low: float, high: float, remedy: str) -> None:
    """Raise InputError unless ``low <= value <= high``; the suffix of ``name`` gives the unit."""
    if not low <= value <= high:
        unit = unit_of(name)
        rule = f"it must lie between {number(low)} and {number(high)} {unit}".rstrip()
        raise InputError(Refusal(name, value, unit, rule, remedy))


def require_parts(
    section: str, parts: Any, sides: Any, remedy: str, *, is_smaller: bool = False
) -> None:
    """Raise InputError if the inertia of ring or wheel exceeds that of its side, kg m2.

    With ``is_smaller`` it must not be equal either: a part of the side is left beside the ring.
    """
    for name, side in (("ring", "sliding"), ("wheel", "output")):
        part_inertia = getattr(parts, f"{name}_inertia")
        side_inertia = getattr(sides, f"{side}_inertia")
        if part_inertia > side_inertia or (is_smaller and part_inertia == side_inertia):
            key = f"{section}.{name}_inertia_kgm2"
            rule = f"it is a part of {side}.inertia_kgm2 = {side_inertia:.6g}"
            raise InputError(Refusal(key, part_inertia, "kg m2", rule, remedy))


def did_you_mean(name: str, valid: Iterable[str]) -> str:
    """Return a hint with up to three valid names similar to ``name``, or all valid names.

    Case is ignored; a valid name that contains ``name`` is similar to it.
    """
    names = sorted(valid)
    names_by_lower = {valid_name.lower(): valid_name for valid_name in names}
    query = name.strip().lower()
    close_names = difflib.get_close_matches(query, names_by_lower, n=1, cutoff=0.6)
    containing_names = [lower for lower in names_by_lower if len(query) > 3 and query in lower]
    matches = [*dict.fromkeys([*close_names, *containing_names])][:3]
    if matches:
        return "did you mean " + " or ".join(f"'{names_by_lower[m]}'" for m in matches) + "?"
    return "valid are " + ", ".join(names)


def join_faults(place: str, faults: Iterable[str]) -> str:
    """Return a message of ``place`` and one fault, or of their number and a line for each."""
    lines = list(faults)
    if len(lines) == 1:
        return f"{place}: {lines[0]}"
    return "\n".join([f"{place}: {len(lines)} mistakes", *(f"- {line}" for line in lines)])


def require_known(name: str, value: str, kind: str, valid: Iterable[str]) -> None:
    """Raise InputError unless ``value`` is in ``valid``; ``kind`` is a noun with its article."""
    valid_values = tuple(valid)
    if value not in valid_values:
        hint = did_you_mean(value, valid_values)
        raise InputError(f"{name} is '{value}', which is not {kind}; {hint}")


def meant_number(text: str) -> float | None:
    """Parse a number that may have a decimal comma or a typeset minus; None for other text."""
    ascii_text = text.strip().replace("\N{MINUS SIGN}", "-").replace("\N{EN DASH}", "-")
    if ascii_text.count(",") == 1:
        ascii_text = ascii_text.replace(",", ".")
    try:
        return float(ascii_text)
    except ValueError:
        return None


def number_rule(text: str) -> str:
    """Return the rule for a number that ``text`` breaks, with the correct spelling if known."""
    meant = meant_number(text)
    return "a number" if meant is None else f"a number with a point and a plain minus, as {meant:g}"
