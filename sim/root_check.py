"""The root stress of one design by finite elements, beside the closed form."""

from __future__ import annotations

from dataclasses import dataclass

from sim.flank import FLANKS, Flank
from sim.geometry import Dog
from sim.notch import Load, root_tension
from sim.root_mesh import RootShape
from sim.root_stress import Band, RootModel
from sim.strength import Limits

BANDS: tuple[Band, ...] = ("whole", "tip")


@dataclass(frozen=True)
class RootCheck:
    """Tension in the fillet of a loaded flank, Pa, by finite elements and by closed form.

    ``lever`` is the height of the load's line above the floor, m; ``band`` what is pressed.
    """

    flank: Flank
    band: Band
    lever: float
    elements: float
    formula: float


def root_checks(dog: Dog, limits: Limits) -> list[RootCheck]:
    """Return both flanks under the design load, on all that touches and at the tip.

    Takes some ten seconds; raises InputError where scikit-fem is missing.
    """
    radius, force = limits.root_radius, limits.load.force_per_dog(dog)
    model = RootModel(RootShape(dog, radius, dog.pitch))
    rows = []
    for flank in FLANKS:
        for band in BANDS:
            found = model.stress(flank, band, force)
            formula = root_tension(dog, radius, Load(force, flank, found.lever))
            rows.append(RootCheck(flank, band, found.lever, found.tension, formula))
    return rows
