"""A design's root by finite elements, and the files written of it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from rich.console import Group, RenderableType

from dogshape.cli.console import columns
from dogshape.sim.units import MM, MPA

if TYPE_CHECKING:
    from dogshape.validation.finite_elements.root_check import RootCheck


def root_table(roots: Sequence[RootCheck]) -> RenderableType:
    """Return the root stress by finite elements beside the closed form."""
    head = ("tension at the root", "lever, mm", "finite elements, MPa", "closed form, MPa", "ratio")
    table = columns(*head)
    where = {
        "whole": "all that touches",
        "tip": "top fifth of the flank",
        "load": "at the load height, interpolated",
    }
    for root in roots:
        table.add_row(
            f"{root.flank} flank, {where[root.band]}",
            f"{root.lever / MM:.2f}",
            f"{root.elements / MPA:.0f}",
            f"{root.formula / MPA:.0f}",
            f"{root.formula / root.elements:.2f}",
        )
    return Group("", table)


def export_text(written: dict[str, str], volume: float) -> RenderableType:
    """List the files that were written; ``volume`` of one ring in mm3."""
    words = {
        "svg": "drawing",
        "stl": "one ring, both are alike",
        "step": "both rings",
        "sheet": "data sheet",
    }
    lines = [f"wrote {path} ({words[kind]})" for kind, path in written.items()]
    return Group(*lines, f"volume of a ring {volume:.1f} mm3")


def root_record(root: RootCheck) -> dict[str, Any]:
    """Return the root stress of one load by finite elements and by the closed form."""
    return {
        "flank": root.flank,
        "band": root.band,
        "lever_mm": root.lever / MM,
        "finite_elements_MPa": root.elements / MPA,
        "closed_form_MPa": root.formula / MPA,
    }
