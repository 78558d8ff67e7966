r"""Limits of manufacture on the shape, and margins within manufacturing tolerances.

*Root sum of squares*: independent dimensions, each normal about its nominal size with the tolerance
:math:`t = 3 C \sigma` (*C* the capability of the process, by default 1: three standard deviations,
as for a pitch in ``sim.strength.load_case``), move a margin by a normal deviate of
:math:`\sqrt{\sum e_i^2}/(3 C)`, :math:`e_i` its loss at the tolerance. The share *p* of the dogs,
the reject rate, lies beyond :math:`z_p/(3 C) \sqrt{\sum e_i^2}`. Dimensions that are even over the
whole tolerance have :math:`C = 1/\sqrt 3`. No more is lost than in the worst case.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Mapping
from dataclasses import dataclass, fields, replace
from functools import reduce
from statistics import NormalDist
from typing import Any, Literal

import numpy as np

from dogshape.sim.elementwise import hashable, hypot, largest, smallest, where
from dogshape.sim.errors import DogshapeError, GeometryError, refusal, require_ranges, within
from dogshape.sim.shift.geometry import FLANKS, SHARPEST, Dog, flank_contact, root_radius_room
from dogshape.sim.strength.checks import RULES, Check, checks_of
from dogshape.sim.units import DEG, MM


@dataclass(frozen=True)
class ManufacturingLimits:
    """Limits of the workshop, lengths in m: ``RULES`` has their meaning and reason."""

    tip_width: float = within("tip_width_mm", 0.05, 100.0, 1.5e-3)
    slot_width: float = within("slot_width_mm", 0.05, 100.0, 1.5e-3)
    cutter_reach: float = within("cutter_reach", 0.1, 100.0, 3.0)
    flank_height: float = within("flank_height_mm", 0.05, 100.0, 1.5e-3)
    #: of the roots, and of tip edges without a radius of their own
    root_radius: float = within("root_radius_mm", 0.02, 10.0, 0.3e-3)
    tip_core: float = within("tip_core_mm", 0.0, 100.0, 0.5e-3)
    chamfer_share: float = within("chamfer_share", 0.0, 0.5, 0.35)
    module: float = within("module_mm", 0.05, 100.0, 1.25e-3)
    #: thickness of the ring behind the roots; None for one that is thick enough
    rim: float | None = within("rim_mm", 0.1, 1000.0, None, remedy="give the thickness in mm")

    def __post_init__(self) -> None:
        require_ranges(self, "manufacturing", "correct the limit")


#: Checks that a dog must pass to be made at all.
MAKEABLE = tuple(n for n, rule in RULES.items() if rule.group == "make" and n != "tip_core")


def manufacturing_checks(dog: Dog, limits: ManufacturingLimits) -> tuple[Check, ...]:
    """Return the manufacturability checks of a dog."""
    inner = dog.inner_radius
    # The cutter enters an undercut slot by its mouth.
    slot = dog.pitch_angle * inner - largest(dog.root_width_at(inner), dog.tip_width_at(inner))
    found = {
        "tip_width": dog.tip_width_at(inner),
        "slot_width": slot,
        "cutter_reach": dog.height / slot,
        "flank_height": dog.height - largest(*dog.drops_at(dog.outer_radius)),
        "root_radius": root_radius_room(dog),
        **({} if dog.edge_radius == 0.0 else {"edge_clearance": dog.edge_radius}),
        "chamfer_share": largest(*dog.drops_at(dog.mean_radius)) / dog.height,
        "module": 2.0 * dog.mean_radius / dog.count,
    }
    bounds = vars(limits) | {"edge_clearance": limits.root_radius}
    return checks_of((name, value, bounds[name]) for name, value in found.items())


def require_fillets(dog: Dog, radius: float) -> None:
    """Raise GeometryError unless fillets of a ``radius`` in m fit into slot and tip of a dog."""
    if (room := root_radius_room(dog)) < radius:
        rule = f"the largest that fits into slot and tip is {room / MM:.4g} mm"
        refused = refusal("manufacturing.root_radius_mm", radius / MM, "mm", rule, FILLETS)
        raise GeometryError(refused)


FILLETS = "use a smaller radius, fewer dogs, or a smaller chamfer"
ANGLE, SHARE = "give an angle in degrees", "give a share of the height"


@dataclass(frozen=True)
class Tolerances:
    """Largest deviation of each dimension either way, rad and m, and the limits of two checks.

    Height and diameters by default of ISO 2768-1 fine, the rest of ground or precision-forged dogs
    (assumptions). ``RULES`` has the meaning of ``contact_ratio`` and ``clearance``. The reject rate
    is that of a normal deviate beyond 3 standard deviations on one side, of each check.
    """

    chamfer: float = within("chamfer_deg", 0.0, 5.0, 0.25 * DEG, remedy=ANGLE)
    traction: float = within("traction_deg", 0.0, 5.0, 0.25 * DEG, remedy=ANGLE)
    braking: float = within("braking_deg", 0.0, 5.0, 0.25 * DEG, remedy=ANGLE)
    height: float = within("height_mm", 0.0, 2.0, 0.05 * MM)
    outer_diameter: float = within("outer_diameter_mm", 0.0, 2.0, 0.15 * MM)
    inner_diameter: float = within("inner_diameter_mm", 0.0, 2.0, 0.15 * MM)
    axial_gap: float = within("axial_gap_mm", 0.0, 2.0, 0.1 * MM)
    root_radius: float = within("root_radius_mm", 0.0, 2.0, 0.05 * MM)
    contact_ratio: float = within("contact_ratio", 0.0, 1.0, 0.5, remedy=SHARE)
    clearance: float = within("clearance_mm", 0.0, 2.0, 0.3 * MM)
    chamfer_back: float = within("chamfer_back_deg", 0.0, 5.0, 0.25 * DEG, remedy=ANGLE)
    backlash: float = within("backlash_mm", 0.0, 2.0, 0.05 * MM)
    reject_rate: float = within("reject_rate", 1e-9, 0.5, 0.00135)
    capability: float = within("capability", 0.3, 3.0, 1.0)

    def __post_init__(self) -> None:
        require_ranges(self, "tolerance", "give a length in mm")

    @property
    def dimensions(self) -> dict[str, float]:
        """Dimensions with their tolerance, those without one left out."""
        names = [f.name for f in fields(self) if f.name not in NO_DIMENSIONS]
        return {name: getattr(self, name) for name in names if getattr(self, name) > 0.0}

    @property
    def statistical_share(self) -> float:
        """Loss at the reject rate over the root sum of squares of the losses at the tolerances."""
        return -NormalDist().inv_cdf(self.reject_rate) / (3.0 * self.capability)

    def without_sizes(self) -> Tolerances:
        """Return the limits alone, with every dimension exact."""
        return replace(self, **dict.fromkeys(self.dimensions, 0.0))


#: Fields of ``Tolerances`` that are no dimension.
NO_DIMENSIONS = ("contact_ratio", "clearance", "reject_rate", "capability")
Kind = Literal["worst_case", "root_sum_square"]  #: addition of the effects of all dimensions


@dataclass(frozen=True)
class Spread:
    """Move of a quantity within the tolerances, by dimension and at the worst.

    ``share`` is ``Tolerances.statistical_share``.
    """

    by_dimension: dict[str, float]
    worst_case: float
    share: float = 1.0

    @property
    def root_sum_square(self) -> float:
        """Move at the reject rate: root of the sum of the squares of all effects."""
        total = reduce(hypot, self.by_dimension.values(), 0.0)
        return smallest(self.share * total, self.worst_case)


SIDES = (-1.0, 1.0)
Values = Callable[[Dog, float], dict[str, float]]  #: of a dog and its root radius in m


def moved(dog: Dog, root_radius: float, deviations: Mapping[str, float]) -> tuple[Dog, float]:
    """Return a dog and its root radius with some dimensions off by ``deviations`` (SI).

    Raises GeometryError where that is no dog. A chamfer or length stops at zero, the root radius at
    ``SHARPEST``; a face or play that the dog does not have stays away.
    """
    off: dict[str, Any] = dict(deviations)
    radius = largest(SHARPEST, root_radius + off.pop("root_radius", 0.0))
    for name, deviation in off.items():
        value = getattr(dog, name)
        off[name] = value + deviation
        if name not in ("traction", "braking"):
            off[name] = where(_has(dog, name), largest(0.0, off[name]), value)
    return replace(dog, **off), radius


def _has(dog: Dog, name: str) -> bool:
    """Decide whether a dog has a dimension, or which of ``Dogs`` have."""
    absent = {"chamfer": dog.crest == 0.0, "chamfer_back": dog.crest == 1.0}
    return np.logical_not(absent.get(name, (name == "backlash") & (dog.backlash == 0.0)))


def losses(
    dog: Dog, root_radius: float, tolerances: Tolerances, values: Values
) -> dict[str, Spread]:
    """Compute the largest loss of each of ``values``.

    Worst is every dimension off to the side on which it takes something: exact where a value rises
    or falls with a dimension all the way. One deviation holds for both rings, which are made alike.
    One that leaves no dog makes every loss infinite.
    """
    sizes = {n: size for n, size in tolerances.dimensions.items() if np.any(_has(dog, n))}
    nominal = values(dog, root_radius)

    def fall(signs: Mapping[str, float]) -> dict[str, float]:
        deviations = {size: sign * sizes[size] for size, sign in signs.items()}
        try:
            shape, radius = moved(dog, root_radius, deviations)
            there, possible = values(shape, radius), shape.possible
        except DogshapeError:
            return dict.fromkeys(nominal, math.inf)
        return {name: where(possible, nominal[name] - there[name], math.inf) for name in nominal}

    falls = {size: [fall({size: side}) for side in SIDES] for size in sizes}
    corners: dict[tuple[Hashable, ...], dict[str, float]] = {}
    found = {}
    for name in nominal:
        sides = {size: (down[name], up[name]) for size, (down, up) in falls.items()}
        signs = {size: where(down >= up, *SIDES) for size, (down, up) in sides.items()}
        corner = tuple(map(hashable, signs.values()))
        if corner not in corners:
            corners[corner] = fall(signs)
        by_dimension = {size: largest(*two, 0.0) for size, two in sides.items()}
        worst = largest(corners[corner][name], *by_dimension.values())
        found[name] = Spread(by_dimension, worst, tolerances.statistical_share)
    return found


def _contact(dog: Dog, root_radius: float) -> dict[str, float]:
    return {f: flank_contact(dog, root_radius, f).height / dog.height for f in FLANKS}


def tolerance_checks(
    dog: Dog,
    root_radius: float,
    tolerances: Tolerances,
    seated: float,
    kind: Kind = "root_sum_square",
) -> tuple[Check, ...]:
    """Return the checks of contact and of the gap in neutral within tolerances; lengths in m."""
    spreads, contact = losses(dog, root_radius, tolerances, _contact), _contact(dog, root_radius)
    short = seated / dog.height
    left = [contact[flank] - short - getattr(spread, kind) for flank, spread in spreads.items()]
    losses_of_gap = {"axial_gap": tolerances.axial_gap, "height": 2.0 * tolerances.height}
    total = sum(losses_of_gap.values())
    gap = dog.axial_gap - getattr(Spread(losses_of_gap, total, tolerances.statistical_share), kind)
    return checks_of(
        [
            ("contact_ratio", largest(smallest(*left), -1.0), tolerances.contact_ratio),
            ("clearance", gap, tolerances.clearance),
        ]
    )
