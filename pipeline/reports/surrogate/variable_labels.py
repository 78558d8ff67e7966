"""Names of what may be varied, for people."""

from __future__ import annotations

from dogshape.sim.units import unit_of

LABELS = {
    "chamfer_deg": "chamfer \N{GREEK SMALL LETTER ALPHA}",
    "traction_deg": "traction flank \N{GREEK SMALL LETTER BETA}",
    "braking_deg": "braking flank \N{GREEK SMALL LETTER GAMMA}",
    "height_mm": "height h",
    "count": "number of dogs N",
    "mismatch_rpm": "mismatch",
    "force_N": "shift force",
}


def label(name: str) -> str:
    """Return the words for a key."""
    return LABELS.get(name, name)


def axis(name: str) -> str:
    """Return the words for a key with its unit."""
    unit = unit_of(name)
    return f"{label(name)}, {unit}" if unit else label(name)


def value(name: str, number: float) -> str:
    """Return a value with its unit."""
    return f"{number:.4g} {unit_of(name)}".strip()
