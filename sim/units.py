"""Units at the edge.

Inside the project everything is SI with angles in radians. Files, tables, the
command line and reports use the unit that a name ends in (``height_mm``,
``mismatch_rpm``). This module holds every conversion between the two.
"""

from __future__ import annotations

import math
from functools import lru_cache

MM = 1e-3  #: metres in a millimetre
DEG = math.pi / 180.0  #: radians in a degree
RPM = 2.0 * math.pi / 60.0  #: radians per second in a revolution per minute
MPA = 1e6  #: pascals in a megapascal
MS = 1e-3  #: seconds in a millisecond

#: Factor to SI by the suffix of a name; a name without one of them is a pure number.
FACTORS: dict[str, float] = {
    "_mm": MM,
    "_um": 1e-3 * MM,
    "_deg": DEG,
    "_mrad": 1e-3,
    "_rpm": RPM,
    "_MPa": MPA,
    "_ms": MS,
    "_m_s": 1.0,
    "_m_s2": 1.0,
    "_Pa_m": 1.0,
    "_s_m": 1.0,
    "_N_mm": 1.0 / MM,
    "_N_um": 1e3 / MM,
    "_HV": 1.0,
    "_Nm_rad": 1.0,
    "_Nm": 1.0,
    "_mm3_Nm": 1e-9,
    "_Ns": 1.0,
    "_Ns_m": 1.0,
    "_mm_kN": 1e-6,
    "_J": 1.0,
    "_N": 1.0,
    "_kgm2": 1.0,
    "_kg": 1.0,
    "_s": 1.0,
}

UNIT_NAMES: dict[str, str] = {
    "_mm": "mm",
    "_um": "um",
    "_deg": "deg",
    "_mrad": "mrad",
    "_rpm": "1/min",
    "_MPa": "MPa",
    "_ms": "ms",
    "_m_s": "m/s",
    "_m_s2": "m/s2",
    "_Pa_m": "Pa/m",
    "_s_m": "s/m",
    "_N_mm": "N/mm",
    "_N_um": "N/um",
    "_HV": "HV",
    "_Nm_rad": "N m/rad",
    "_Nm": "N m",
    "_mm3_Nm": "mm3/(N m)",
    "_Ns": "N s",
    "_Ns_m": "N s/m",
    "_mm_kN": "mm/kN",
    "_J": "J",
    "_N": "N",
    "_kgm2": "kg m2",
    "_kg": "kg",
    "_s": "s",
}


@lru_cache(maxsize=256)
def suffix_of(name: str) -> str:
    """Return the unit suffix of ``name`` (``"_mm"``), or ``""`` for a pure number."""
    matches = [suffix for suffix in FACTORS if name.endswith(suffix)]
    return max(matches, key=len, default="")


def unit_of(name: str) -> str:
    """Return the unit that ``name`` ends in, for messages and labels (``"mm"``)."""
    return UNIT_NAMES.get(suffix_of(name), "")


def to_si(name: str, value: float) -> float:
    """Convert ``value``, given in the unit that ``name`` ends in, to SI."""
    return value * FACTORS.get(suffix_of(name), 1.0)


def from_si(name: str, value: float) -> float:
    """Convert an SI ``value`` to the unit that ``name`` ends in."""
    return value / FACTORS.get(suffix_of(name), 1.0)
