r"""Margins of a design within its manufacturing tolerances.

Every dimension *i* may be off by its tolerance either way, which takes at most
:math:`d_i` from a margin. For independent deviations :math:`\sqrt{\sum d_i^2}` is the usual
estimate (root sum of squares). The worst case is the margin with every dimension off to
the side on which it takes something: exact where a margin rises or falls with a
dimension all the way, which ``tests/verification/test_tolerance.py`` checks at all corners.

Both rings are made alike, so one deviation holds for either.

Default tolerances: height and diameters of ISO 2768-1 fine, the rest of ground or
precision-forged dogs (assumptions).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Annotated, Any

from dogshape.sim.elementwise import key, largest, smallest, where
from dogshape.sim.errors import DogshapeError, Within, require_ranges
from dogshape.sim.shift.geometry import FLANKS, SHARPEST, Dog, flank_contact
from dogshape.sim.strength.checks import Check, Rule
from dogshape.sim.units import DEG, MM


@dataclass(frozen=True)
class Tolerances:
    """Largest deviation of each dimension either way, rad and m.

    ``contact_ratio`` is the least share of the height that has to touch with all of them
    at their worst and the rings short of full depth by the seated tolerance; ``clearance``
    is the least gap between the crests in neutral, m.
    """

    chamfer: Annotated[float, Within("chamfer_deg", 0.0, 5.0, "give an angle in degrees")] = (
        0.25 * DEG
    )
    traction: Annotated[float, Within("traction_deg", 0.0, 5.0, "give an angle in degrees")] = (
        0.25 * DEG
    )
    braking: Annotated[float, Within("braking_deg", 0.0, 5.0, "give an angle in degrees")] = (
        0.25 * DEG
    )
    height: Annotated[float, Within("height_mm", 0.0, 2.0)] = 0.05 * MM
    outer_diameter: Annotated[float, Within("outer_diameter_mm", 0.0, 2.0)] = 0.15 * MM
    inner_diameter: Annotated[float, Within("inner_diameter_mm", 0.0, 2.0)] = 0.15 * MM
    axial_gap: Annotated[float, Within("axial_gap_mm", 0.0, 2.0)] = 0.1 * MM
    root_radius: Annotated[float, Within("root_radius_mm", 0.0, 2.0)] = 0.05 * MM
    contact_ratio: Annotated[
        float, Within("contact_ratio", 0.0, 1.0, "give a share of the height")
    ] = 0.5
    clearance: Annotated[float, Within("clearance_mm", 0.0, 2.0)] = 0.3 * MM

    def __post_init__(self) -> None:
        require_ranges(self, "tolerance", "give a length in mm")

    @property
    def dimensions(self) -> dict[str, float]:
        """Dimensions with their tolerance, those without one left out."""
        names = [f.name for f in fields(self) if f.name not in ("contact_ratio", "clearance")]
        return {name: getattr(self, name) for name in names if getattr(self, name) > 0.0}

    def without_sizes(self) -> Tolerances:
        """Return the limits alone, with every dimension exact."""
        return replace(self, **dict.fromkeys(self.dimensions, 0.0))


@dataclass(frozen=True)
class Spread:
    """Move of a quantity within the tolerances, by dimension and at the worst."""

    by_dimension: dict[str, float]
    worst_case: float

    @property
    def root_sum_square(self) -> float:
        """Root of the sum of the squares of all effects."""
        return math.hypot(*self.by_dimension.values())


SIDES = (-1.0, 1.0)
Values = Callable[[Dog, float], Sequence[float]]  #: of a dog and its root radius in m


def moved(dog: Dog, root_radius: float, deviations: Mapping[str, float]) -> tuple[Dog, float]:
    """Return a dog and its root radius with some dimensions off by ``deviations`` (SI).

    Raises GeometryError where that is no dog. An angle or length stops at zero, the root
    radius at ``SHARPEST``.
    """
    off: dict[str, Any] = {
        name: largest(0.0, getattr(dog, name) + deviation)
        for name, deviation in deviations.items()
        if name != "root_radius"
    }
    radius = largest(SHARPEST, root_radius + deviations.get("root_radius", 0.0))
    return replace(dog, **off), radius


def losses(dog: Dog, root_radius: float, tolerances: Tolerances, values: Values) -> list[Spread]:
    """Compute the largest loss of each of ``values``.

    A deviation that leaves no dog makes every loss infinite.
    """
    sizes = tolerances.dimensions
    nominal = values(dog, root_radius)

    def fall(signs: Mapping[str, float]) -> list[float]:
        deviations = {name: sign * sizes[name] for name, sign in signs.items()}
        try:
            shape, radius = moved(dog, root_radius, deviations)
            there, possible = values(shape, radius), shape.possible
        except DogshapeError:
            return [math.inf] * len(nominal)
        fallen = [here - off for here, off in zip(nominal, there, strict=True)]
        return fallen if possible is True else [where(possible, by, math.inf) for by in fallen]

    # Of each dimension the falls of all values on either side.
    falls = {name: [fall({name: side}) for side in SIDES] for name in sizes}
    corners: dict[tuple[Hashable, ...], list[float]] = {}
    found = []
    for i in range(len(nominal)):
        sides = {name: (down[i], up[i]) for name, (down, up) in falls.items()}
        signs = {name: where(down >= up, *SIDES) for name, (down, up) in sides.items()}
        corner = tuple(key(sign) for sign in signs.values())
        if corner not in corners:
            corners[corner] = fall(signs)
        by_dimension = {name: largest(*two, 0.0) for name, two in sides.items()}
        found.append(Spread(by_dimension, largest(corners[corner][i], *by_dimension.values())))
    return found


def _contact(dog: Dog, root_radius: float) -> list[float]:
    """Return the height that touches over the height of the dog, on either flank."""
    return [flank_contact(dog, root_radius, flank).height / dog.height for flank in FLANKS]


CONTACT_RULE = Rule(
    "contact_ratio", "tolerance",
    "share of the height that touches on the worse flank, every tolerance at its worst",
    "(height that touches - seated tolerance)/h less all losses",
    "worst case of all dimensions; limit an assumption", "", "tolerance.contact_ratio", False,
)  # fmt: skip
CLEARANCE_RULE = Rule(
    "clearance", "tolerance",
    "gap between the crests in neutral, gap and both heights at their worst",
    "axial gap - its tolerance - 2 tolerances of the height",
    "dogs that meet in neutral ratchet; limit an assumption",
    "mm", "tolerance.clearance_mm", False,
)  # fmt: skip


def contact_check(dog: Dog, root_radius: float, tolerances: Tolerances, seated: float) -> Check:
    """Return the check of the contact left after tolerances; ``seated`` tolerance in m."""
    nominal = _contact(dog, root_radius)
    left = [
        here - seated / dog.height - spread.worst_case
        for here, spread in zip(
            nominal, losses(dog, root_radius, tolerances, _contact), strict=True
        )
    ]
    return Check(CONTACT_RULE, largest(smallest(*left), -1.0), tolerances.contact_ratio)


def clearance_check(dog: Dog, tolerances: Tolerances) -> Check:
    """Return the check of the gap that is left in neutral."""
    left = dog.axial_gap - tolerances.axial_gap - 2.0 * tolerances.height
    return Check(CLEARANCE_RULE, left / MM, tolerances.clearance / MM)
