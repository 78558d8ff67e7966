"""The root stress of one design by finite elements, beside the closed form."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from dogshape.pipeline.record import Table
from dogshape.sim.shift.geometry import FLANKS, Dog, Flank
from dogshape.sim.strength.dog_strength import Limits, Load, root_load, root_tension
from dogshape.sim.units import MM, MPA
from dogshape.validation.finite_elements.root_mesh import RootShape
from dogshape.validation.finite_elements.root_stress import BANDS, Band, RootModel

#: Words of what is pressed.
PRESSED = {
    "whole": "all that touches", "tip": "top fifth of the flank",
    "load": "at the load height, interpolated",
}  # fmt: skip


@dataclass(frozen=True)
class RootCheck:
    """Tension in the fillet of a loaded flank, Pa, by finite elements and by closed form.

    ``lever`` is the height of the load's line above the floor, m; ``band`` what is pressed, or
    "load" for the load height of the load case, between the other two.
    """

    flank: Flank
    band: Band | Literal["load"]
    lever: float
    elements: float
    formula: float

    def to_dict(self) -> dict[str, Any]:
        """Give the record that ``strength --fem --json`` prints."""
        return {
            "flank": self.flank,
            "band": self.band,
            "lever_mm": self.lever / MM,
            "finite_elements_MPa": self.elements / MPA,
            "closed_form_MPa": self.formula / MPA,
        }


def root_checks(dog: Dog, limits: Limits) -> list[RootCheck]:
    """Return both flanks under the design load, on all that touches and at the tip.

    Takes some ten seconds; raises InputError where scikit-fem is missing.
    """
    radius = limits.root_radius
    model = RootModel(RootShape(dog, radius, dog.pitch))
    rows = []
    for flank in FLANKS:
        force = limits.load.force_per_dog(dog, flank)
        for band in BANDS:
            found = model.stress(flank, band, force)
            formula = root_tension(dog, radius, Load(force, flank, found.lever))
            rows.append(RootCheck(flank, band, found.lever, found.tension, formula))
        rows.append(_between(dog, limits, rows[-2], rows[-1]))
    return rows


def _between(dog: Dog, limits: Limits, low: RootCheck, high: RootCheck) -> RootCheck:
    """Return the stress at the load height; its ratio to the closed form runs straight."""
    load = root_load(dog, limits, low.flank)
    formula = root_tension(dog, limits.root_radius, load)
    levers, ratios = (low.lever, high.lever), [r.elements / r.formula for r in (low, high)]
    ratio = float(np.interp(load.lever, levers, ratios))
    return RootCheck(low.flank, "load", load.lever, ratio * formula, formula)


def root_table(checks: Sequence[RootCheck]) -> Table:
    """Tabulate the tension by finite elements beside the closed form."""
    heads = (
        *("tension at the root", "lever, mm", "finite elements, MPa", "closed form, MPa"), "ratio"
    )  # fmt: skip
    rows = [
        (
            f"{one.flank} flank, {PRESSED[one.band]}", f"{one.lever / MM:.2f}",
            f"{one.elements / MPA:.0f}", f"{one.formula / MPA:.0f}",
            f"{one.formula / one.elements:.2f}",
        )
        for one in checks
    ]  # fmt: skip
    return Table(heads, rows)
