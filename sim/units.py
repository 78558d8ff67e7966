"""Conversions between SI inside and the unit at the edge, which a name ends in (``height_mm``)."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import TypeVar

Value = TypeVar("Value", float, float | None)

MM = 1e-3  #: metres in a millimetre
DEG = math.pi / 180.0  #: radians in a degree
RPM = 2.0 * math.pi / 60.0  #: radians per second in a revolution per minute
MPA = 1e6  #: pascals in a megapascal
MS = 1e-3  #: seconds in a millisecond

#: Factor to SI and name of a unit by the suffix of a name; without one it is a pure number.
UNITS: dict[str, tuple[float, str]] = {
    "_mm": (MM, "mm"), "_um": (1e-3 * MM, "um"), "_mm_kN": (1e-6, "mm/kN"), "_s_kN": (1e-3, "s/kN"),
    "_deg": (DEG, "deg"), "_mrad": (1e-3, "mrad"), "_rpm": (RPM, "1/min"),
    "_s": (1.0, "s"), "_ms": (MS, "ms"), "_m_s": (1.0, "m/s"), "_m_s2": (1.0, "m/s2"),
    "_N": (1.0, "N"), "_Ns": (1.0, "N s"), "_Ns_m": (1.0, "N s/m"), "_s_m": (1.0, "s/m"),
    "_N_mm": (1.0 / MM, "N/mm"), "_N_um": (1e3 / MM, "N/um"), "_Nm": (1.0, "N m"),
    "_Nm_rad": (1.0, "N m/rad"), "_Nms_rad": (1.0, "N m s/rad"), "_MPa": (MPA, "MPa"),
    "_Pa_m": (1.0, "Pa/m"),
    "_N_m1_5": (1.0, "N/m^1.5"),
    "_bar": (1e5, "bar"), "_cm2": (1e-4, "cm2"), "_cm3": (1e-6, "cm3"),
    "_l_min": (1e-3 / 60.0, "l/min"), "_dm3_s_bar": (1e-8, "dm3/(s bar)"),
    "_V": (1.0, "V"), "_A": (1.0, "A"), "_ohm": (1.0, "ohm"), "_mH": (1e-3, "mH"),
    "_HV": (1.0, "HV"), "_J": (1.0, "J"), "_mm3_Nm": (1e-9, "mm3/(N m)"),
    "_kg": (1.0, "kg"), "_kgm2": (1.0, "kg m2"), "": (1.0, ""),
}  # fmt: skip


@lru_cache(maxsize=256)
def suffix_of(name: str) -> str:
    """Return the unit suffix of ``name`` (``"_mm"``), or ``""`` for a pure number."""
    return max((suffix for suffix in UNITS if name.endswith(suffix)), key=len)


def unit_of(name: str) -> str:
    """Return the unit that ``name`` ends in, for messages and labels (``"mm"``)."""
    return UNITS[suffix_of(name)][1]


def short(value: float, digits: int = 4) -> str:
    """Format ``value`` with ``digits`` significant digits, below 1e6 without an exponent."""
    return f"{float(f'{value:.{digits}g}'):g}"


def to_si(name: str, value: float) -> float:
    """Convert ``value``, given in the unit that ``name`` ends in, to SI."""
    return value * UNITS[suffix_of(name)][0]


def from_si(name: str, value: Value) -> Value:
    """Convert an SI ``value`` to the unit that ``name`` ends in; None and pure numbers stay."""
    factor = UNITS[suffix_of(name)][0]
    return value if value is None or factor == 1.0 else value / factor
