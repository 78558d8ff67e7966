"""Declaration of a quantity: its key in a file, its range there, and the version that added it.

A dataclass of ``sim`` declares each field once (``quantity``). Its section of a study file, the
record of it and the refusal of a value beyond the range follow (``sim.clutch_tables.keys_of``).
"""

from __future__ import annotations

from dataclasses import MISSING, dataclass, field, fields
from functools import lru_cache
from typing import Any

from dogshape.sim.errors import require_between
from dogshape.sim.units import from_si


@dataclass(frozen=True)
class Quantity:
    """Key of a field in a file, and what holds for its value there, in the unit of the key."""

    key: str
    low: float
    high: float
    remedy: str = ""  #: of a value beyond the range; empty for that of the section
    #: whether the key was added later: at its default it is no part of a file's hash, so that
    #: results of files without the key stay valid
    late: bool = False


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
    return field(default=default, metadata={"quantity": Quantity(key, low, high, remedy, late)})


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
