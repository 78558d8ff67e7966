"""The root stress of one design by finite elements, beside the closed form."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from dogshape.sim.shift.geometry import FLANKS, Dog, Flank
from dogshape.sim.strength.dog_strength import Limits, root_load
from dogshape.sim.strength.notch import Load, root_tension
from dogshape.validation.finite_elements.root_mesh import RootShape
from dogshape.validation.finite_elements.root_stress import BANDS, Band, RootModel


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
