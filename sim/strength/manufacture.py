"""Limits of manufacture on the shape, and margins within manufacturing tolerances.

A search left to itself runs to dogs that the chamfer has eaten and calls free
flight a shift. These rules are checked first and cost nothing.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

from dogshape.sim.elementwise import key, largest, smallest, where
from dogshape.sim.errors import DogshapeError, GeometryError, require_ranges, within
from dogshape.sim.shift.geometry import FLANKS, SHARPEST, Dog, flank_contact, root_radius_room
from dogshape.sim.strength.checks import Check, Rule
from dogshape.sim.units import DEG, MM


@dataclass(frozen=True)
class ManufacturingLimits:
    """Limits of the workshop; lengths in m.

    Parameters
    ----------
    tip_width : narrower tips are bruised in handling and lose their shape in hardening.
    tip_core : soft core that the case leaves of the tip, so that it does not harden through.
    slot_width : diameter of the cutter, which has to reach the floor of the slot where
        that is narrowest, at the inner radius.
    cutter_reach : depth of the slot over the width of its floor; a slender cutter bends.
    flank_height : of the braking flank, the lower one.
    root_radius : with which roots are filleted, and tip edges rounded that have no radius of
        their own.
    chamfer_share : depth of the face at its edge over the height of the dog.
    module : mean diameter over count; smaller dogs lose their shape in hardening.
    rim : thickness of the ring behind the roots; None for one that is thick enough.
    """

    tip_width: float = within("tip_width_mm", 0.05, 100.0, 1.5e-3)
    slot_width: float = within("slot_width_mm", 0.05, 100.0, 1.5e-3)
    cutter_reach: float = within("cutter_reach", 0.1, 100.0, 3.0)
    flank_height: float = within("flank_height_mm", 0.05, 100.0, 1.5e-3)
    root_radius: float = within("root_radius_mm", 0.02, 10.0, 0.3e-3)
    tip_core: float = within("tip_core_mm", 0.0, 100.0, 0.5e-3)
    chamfer_share: float = within("chamfer_share", 0.0, 0.5, 0.35)
    module: float = within("module_mm", 0.05, 100.0, 1.25e-3)
    rim: float | None = within("rim_mm", 0.1, 1000.0, None, remedy="give the thickness in mm")

    def __post_init__(self) -> None:
        require_ranges(self, "manufacturing", "correct the limit")


_NARROW = "use fewer or lower dogs or smaller side angles"
_LOW_FLANK = "use a smaller chamfer, more dogs or a higher dog"
#: By check: rule, and what helps a shape that breaks it.
_RULES = {
    name: (Rule(name, "make", what, formula, source, unit, f"manufacturing.{key}", at_most), help)
    for name, unit, key, at_most, what, formula, source, help in (
        ("tip_width", "mm", "tip_width_mm", False, "width of the tip at the inner radius",
         "pitch angle r_i/2 - h (tan beta + tan gamma)/2",
         "handling and distortion in hardening (assumption)", _NARROW),
        ("slot_width", "mm", "slot_width_mm", False,
         "width of the slot's floor at the inner radius",
         "pitch at r_i less the root width there", "smallest cutter (assumption)", _NARROW),
        ("cutter_reach", "", "cutter_reach", True, "depth of the slot over the width of its floor",
         "h over the slot's width at the inner radius",
         "reach of a short end mill, three diameters (assumption)", _NARROW),
        ("flank_height", "mm", "flank_height_mm", False,
         "height of the braking flank at the outer radius, where it is lowest",
         "h - d, d depth of the face at its edge there",
         "keeps a flank on the side that brakes (assumption)", _LOW_FLANK),
        ("root_radius", "mm", "root_radius_mm", False,
         "largest root radius that fits into slot and tip",
         "two fillets on the slot's floor, two roundings on the tip, one of each on a flank",
         "geometry; wear of the cutter sets the limit (assumption)",
         "use a smaller radius, fewer dogs, or a smaller chamfer"),
        ("edge_clearance", "mm", "root_radius_mm", False,
         "radius of the tip edges, which meet the root fillets of the other ring",
         "R of the edges, at least that of the roots",
         "geometry: a ball that fits into the tip fits into the slot",
         "use a larger dog.edge_radius_mm, or smaller root fillets"),
        ("chamfer_share", "", "chamfer_share", True,
         "depth of the face at its edge over the height of the dog", "d/h",
         "leaves a flank of two thirds (assumption)", _LOW_FLANK),
        ("module", "mm", "module_mm", False, "mean diameter over the number of dogs", "2 r/N",
         "distortion in hardening (assumption)", "use fewer dogs or a larger diameter"),
    )
}  # fmt: skip
TIP_CORE_RULE = Rule(
    "tip_core", "make", "soft core of the tip at the inner radius",
    "width of the tip less a case depth from either side",
    "a tip hardened through chips; limit an assumption", "mm", "manufacturing.tip_core_mm", False,
)  # fmt: skip
#: Checks that a dog must pass to be made at all.
MAKEABLE = tuple(_RULES)


def manufacturing_checks(dog: Dog, limits: ManufacturingLimits) -> tuple[Check, ...]:
    """Return the manufacturability checks of a dog, lengths in mm."""
    inner = dog.inner_radius
    slot = dog.pitch_angle * inner - dog.root_width_at(inner)
    lowest = dog.height - dog.edge_drop_at(dog.outer_radius)
    lengths = {
        "tip_width": (dog.tip_width_at(inner), limits.tip_width),
        "slot_width": (slot, limits.slot_width),
        "flank_height": (lowest, limits.flank_height),
        "root_radius": (root_radius_room(dog), limits.root_radius),
        "edge_clearance": (dog.edge_radius, limits.root_radius),
        "module": (2.0 * dog.mean_radius / dog.count, limits.module),
    }
    rows = {name: (value / MM, limit / MM) for name, (value, limit) in lengths.items()} | {
        "cutter_reach": (dog.height / slot, limits.cutter_reach),
        "chamfer_share": (dog.edge_drop / dog.height, limits.chamfer_share),
    }
    sharp = dog.edge_radius == 0.0
    return tuple(
        Check(rule, *rows[name])
        for name, (rule, _) in _RULES.items()
        if not (sharp and name == "edge_clearance")
    )


def tip_core_check(dog: Dog, limits: ManufacturingLimits, case_depth: float) -> Check:
    """Return the check of the core that a case of ``case_depth`` (m) leaves of the tip."""
    core = dog.tip_width_at(dog.inner_radius) - 2.0 * case_depth
    return Check(TIP_CORE_RULE, core / MM, limits.tip_core / MM)


def require_makeable(dog: Dog, limits: ManufacturingLimits) -> None:
    """Raise GeometryError with the first rule that the dog breaks."""
    for check in manufacturing_checks(dog, limits):
        if not check.passed:
            raise GeometryError(
                f"{check.fault} to be made; {_RULES[check.name][1]}, or change {check.rule.key}."
            )


ANGLE = "give an angle in degrees"


@dataclass(frozen=True)
class Tolerances:
    """Largest deviation of each dimension either way, rad and m.

    Height and diameters by default of ISO 2768-1 fine, the rest of ground or precision-forged dogs
    (assumptions).

    ``contact_ratio`` is the least share of the height that has to touch with all of them
    at their worst and the rings short of full depth by the seated tolerance; ``clearance``
    is the least gap between the crests in neutral, m.
    """

    chamfer: float = within("chamfer_deg", 0.0, 5.0, 0.25 * DEG, remedy=ANGLE)
    traction: float = within("traction_deg", 0.0, 5.0, 0.25 * DEG, remedy=ANGLE)
    braking: float = within("braking_deg", 0.0, 5.0, 0.25 * DEG, remedy=ANGLE)
    height: float = within("height_mm", 0.0, 2.0, 0.05 * MM)
    outer_diameter: float = within("outer_diameter_mm", 0.0, 2.0, 0.15 * MM)
    inner_diameter: float = within("inner_diameter_mm", 0.0, 2.0, 0.15 * MM)
    axial_gap: float = within("axial_gap_mm", 0.0, 2.0, 0.1 * MM)
    root_radius: float = within("root_radius_mm", 0.0, 2.0, 0.05 * MM)
    contact_ratio: float = within(
        "contact_ratio", 0.0, 1.0, 0.5, remedy="give a share of the height"
    )
    clearance: float = within("clearance_mm", 0.0, 2.0, 0.3 * MM)

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

    Worst is every dimension off to the side on which it takes something: exact where a value rises
    or falls with a dimension all the way (``tests/verification/test_tolerance.py``). One deviation
    holds for both rings, which are made alike. One that leaves no dog makes every loss infinite.
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
