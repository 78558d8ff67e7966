"""Declaration of a quantity: its key, range, meaning, unit, printed form and later addition.

A dataclass of ``sim`` declares each field once (``quantity``). Its section of a study file, the
record of it and the refusal of a value beyond the range follow (``sim.clutch_tables.Keys``). Keys
of files and records without such a field have the same declaration (``sim.clutch_tables.key``).
"""

from __future__ import annotations

import math
from dataclasses import MISSING, dataclass, field, fields
from functools import lru_cache
from typing import Any

from dogshape.sim.errors import require_between
from dogshape.sim.units import from_si


@dataclass(frozen=True)
class Quantity:
    """Key of a value in a file or record, and what holds for it, in the unit of the key."""

    key: str = ""  #: of a field of another name; empty for a field that is named as its key
    low: float = -math.inf
    high: float = math.inf
    remedy: str = ""  #: of a value beyond the range; empty for that of the section
    #: whether the key was added later: at its default it is no part of a file's hash, so that
    #: results of files without the key stay valid
    late: bool = False
    unit: str = ""  #: for the reference page
    head: str = ""  #: of its column in a table; none is printed without it
    scale: float = 1.0  #: printed over stored number
    form: str = ".4g"  #: format of the printed number

    @property
    def is_bounded(self) -> bool:
        """Whether the value has a range."""
        return math.isfinite(self.low) or math.isfinite(self.high)


def quantity(
    key: str,
    low: float,
    high: float,
    default: Any = MISSING,
    *,
    late: bool = False,
    remedy: str = "",
) -> Any:
    """Declare a field of a dataclass with its key and range in a file; see ``Quantity``."""
    declared = Quantity(key, low, high, remedy=remedy, late=late)
    return field(default=default, metadata={"quantity": declared})


@lru_cache
def quantities_of(kind: Any) -> dict[str, Quantity]:
    """Return the declared quantities of a dataclass by the names of its fields."""
    return {
        entry.name: entry.metadata["quantity"]
        for entry in fields(kind)
        if "quantity" in entry.metadata
    }


def record_quantities(value: Any) -> dict[str, Any]:
    """Return the declared quantities of ``value`` by key and in the unit of that key."""
    kind: Any = type(value)
    return {
        declared.key: from_si(declared.key, getattr(value, name))
        for name, declared in quantities_of(kind).items()
    }


def require_ranges(value: Any, section: str, remedy: str) -> None:
    """Raise InputError if a declared quantity of ``value`` is out of its range; None passes.

    ``section`` is the table of the file, ``remedy`` that of quantities without one of their own.
    """
    kind: Any = type(value)
    for name, declared in quantities_of(kind).items():
        number_in_file = from_si(declared.key, getattr(value, name))
        if number_in_file is None or declared.low <= number_in_file <= declared.high:
            continue
        full_key = f"{section}.{declared.key}".lstrip(".")
        require_between(
            full_key,
            number_in_file,
            declared.low,
            declared.high,
            remedy=declared.remedy or remedy,
        )
