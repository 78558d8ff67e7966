r"""The dog and the pair of rings, from six numbers and two diameters (Jasny et al. 2019).

Chamfer :math:`\alpha`, side angles :math:`\beta, \gamma`, height *h*, *N* dogs, pitch
:math:`\vartheta = 2\pi/N`. At half height dog and slot are equally wide; a flank is a plane through
the radial line at :math:`\pm\vartheta/4` there. The face falls by :math:`\alpha` from the crest,
:math:`z = h/2`, towards the braking flank. Widths run along the circumference at radius *r*:
:math:`w_{tip,root} = \tfrac{1}{2}\vartheta r \mp \tfrac{h}{2}(\tan\beta + \tan\gamma)`. At full
depth tip edges, rounded by :math:`\varrho`, take :math:`a = \varrho \cos\beta \cot(\psi/2)` from a
flank along the shaft, :math:`\psi` the angle of the material: what touches is :math:`h - 2
a_\beta`, or :math:`h - 2 (d(r) + a_\gamma)` with the depth *d* where face and braking flank meet.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property, reduce
from operator import and_
from typing import Literal, NamedTuple

from dogshape.sim.elementwise import cos, hypot, largest, smallest, tan, where
from dogshape.sim.errors import GeometryError, InputError, refusal
from dogshape.sim.units import DEG, MM

LAND = 5e-5  #: m of every face that roundings and fillets leave
SHARPEST = 2e-5  #: m of an edge's or root's radius; nothing made is sharper
STEEP = math.radians(60.0)  #: no flank or chamfer is as steep
#: What no key of the dog can say; every refusal of such a key or value ends with it.
SCOPE = (
    "the model has flanks of 0 to 60 deg (no undercut or back taper), no circular play (dog and "
    "slot are equally wide at half height), a face that falls to one side, and equal dogs on both "
    "rings"
)
#: Plausible lengths, m: wide enough for any clutch, narrow enough to catch a wrong unit.
LENGTHS = {
    "height_mm": (0.2e-3, 0.1),
    "outer_diameter_mm": (5e-3, 2.0),
    "inner_diameter_mm": (2e-3, 2.0),
    "axial_gap_mm": (0.0, 0.1),
    "edge_radius_mm": (0.0, 0.01),
}


@dataclass(frozen=True)
class Dog:
    """One dog, its ring and the axial gap to the other ring, in SI units.

    Parameters
    ----------
    count : number of dogs of a ring.
    chamfer, traction, braking : chamfer of the face and side angles of the two
        flanks, rad.
    height : crest above root, m.
    outer_diameter, inner_diameter : of the toothed annulus, m.
    axial_gap : between the crests of the two rings before the shift, m.
    edge_radius : of crest and braking edge, m; 0 is sharp.

    Raises
    ------
    InputError
        A value is not finite, negative or outside its mathematical range.
    GeometryError
        The flanks meet below the tip, the chamfer eats the braking flank, or the roundings of the
        edges leave nothing of face or flanks.
    """

    count: int
    chamfer: float
    traction: float
    braking: float
    height: float
    outer_diameter: float
    inner_diameter: float
    axial_gap: float
    edge_radius: float = 0.0

    def __post_init__(self) -> None:
        for rule in _rules(self):
            if not rule.kept:
                words = rule.rule.format(*rule.numbers)
                said = refusal(rule.quantity, rule.value, rule.unit, words, rule.remedy)
                raise rule.error(said)

    @cached_property
    def tangents(self) -> tuple[float, float, float]:
        """Tangents of chamfer, traction and braking angle; nearly every length asks for them."""
        return tan(self.chamfer), tan(self.traction), tan(self.braking)

    @property
    def possible(self) -> bool:
        """Whether there is such a dog; there is, but for some of ``Dogs``."""
        return True

    @property
    def mean_radius(self) -> float:
        """Mean radius of the annulus, m."""
        return 0.25 * (self.outer_diameter + self.inner_diameter)

    @property
    def inner_radius(self) -> float:
        """Inner radius of the annulus, m."""
        return 0.5 * self.inner_diameter

    @property
    def outer_radius(self) -> float:
        """Outer radius of the annulus, m."""
        return 0.5 * self.outer_diameter

    @property
    def radial_width(self) -> float:
        """Length of a dog along the radius, m."""
        return self.outer_radius - self.inner_radius

    @property
    def pitch_angle(self) -> float:
        """Angle from one dog to the next, rad."""
        return 2.0 * math.pi / self.count

    @property
    def pitch(self) -> float:
        """Pitch along the circumference at the mean radius, m."""
        return self.pitch_angle * self.mean_radius

    @property
    def lean(self) -> float:
        """Sum of the tangents of both side angles."""
        return self.tangents[1] + self.tangents[2]

    def tip_width_at(self, radius: float) -> float:
        """Width of the dog at crest height at ``radius``, m; the slot's floor is as wide."""
        return 0.5 * self.pitch_angle * radius - 0.5 * self.height * self.lean

    def root_width_at(self, radius: float) -> float:
        """Width of the dog at its root at ``radius``, m; the slot's mouth is as wide."""
        return 0.5 * self.pitch_angle * radius + 0.5 * self.height * self.lean

    @property
    def tip_width(self) -> float:
        """Width at crest height at the mean radius, m."""
        return self.tip_width_at(self.mean_radius)

    @property
    def root_width(self) -> float:
        """Width at the root at the mean radius, m."""
        return self.root_width_at(self.mean_radius)

    @property
    def entry_play(self) -> float:
        """Width of the slot's mouth less that of the tip at the mean radius, m."""
        return self.height * self.lean

    @property
    def edge_drop(self) -> float:
        """Depth below the crest at which the face meets the braking flank, m.

        The flank leans outwards below the crest, so the face runs on past the
        tip width: ``drop / (1 - tan(chamfer) tan(braking))``.
        """
        return self.edge_drop_at(self.mean_radius)

    def edge_drop_at(self, radius: float) -> float:
        """Depth below the crest at which the face meets the braking flank at ``radius``, m."""
        slope, _, braking = self.tangents
        return self.tip_width_at(radius) * slope / (1.0 - slope * braking)

    @property
    def face_width(self) -> float:
        """Width of the face, crest to braking edge, along the circumference at mean radius, m."""
        return self.tip_width + self.edge_drop * self.tangents[2]

    @property
    def crest_overlap(self) -> float:
        """Overlap of two faces at dogs facing dogs, crest to crest at the mean radius, m."""
        return 0.5 * self.pitch - self.height * self.tangents[1]

    @property
    def braking_flank_height(self) -> float:
        """Axial height of the braking flank, from root to the edge of the face, m."""
        return self.height - self.edge_drop

    @property
    def edge_cuts(self) -> tuple[float, float]:
        """Lengths that a rounding of crest and braking edge takes along its sides, over its radius.

        ``cot(psi/2)`` with the angle of the material, 90 degrees + traction - chamfer at the crest
        and 90 degrees + chamfer + braking at the braking edge.
        """
        crest = 0.25 * math.pi + 0.5 * (self.traction - self.chamfer)
        braking = 0.25 * math.pi + 0.5 * (self.chamfer + self.braking)
        return 1.0 / tan(crest), 1.0 / tan(braking)

    @property
    def edge_room(self) -> float:
        """Largest radius of crest and braking edge that leaves ``LAND`` of face and flanks, m."""
        crest, braking = self.edge_cuts
        rooms = zip(self.side_lengths, (crest + braking, crest, braking), strict=True)
        return largest(0.0, smallest(*((length - LAND) / taken for length, taken in rooms)))

    @property
    def side_lengths(self) -> tuple[float, float, float]:
        """Lengths of face, traction and braking flank across the edges where they are least, m."""
        slope, _, braking = self.tangents
        narrow = self.tip_width_at(self.inner_radius)
        face = (narrow + self.edge_drop_at(self.inner_radius) * braking) * hypot(1.0, slope)
        low = self.height - self.edge_drop_at(self.outer_radius)
        return face, self.height / cos(self.traction), low / cos(self.braking)

    @property
    def travel(self) -> float:
        """Axial way from the start of the shift to full depth, m."""
        return self.axial_gap + self.height

    @property
    def axial_length(self) -> float:
        """Room the pair needs along the shaft when open, root to root, m."""
        return self.axial_gap + 2.0 * self.height


def section(dog: Dog) -> list[tuple[float, float]]:
    """Return one dog's profile unrolled at the mean radius, from root to root.

    Points (along the circumference, above the median plane), m: braking root,
    braking edge of the face, crest, traction root. The slot's floor runs on at
    the root's height.
    """
    half = 0.5 * dog.height
    middle = 0.25 * dog.pitch
    edge = half - dog.edge_drop
    return [
        (-middle - half * tan(dog.braking), -half),
        (-middle + edge * tan(dog.braking), edge),
        (middle - half * tan(dog.traction), half),
        (middle + half * tan(dog.traction), -half),
    ]


class Dogs(Dog):
    """Many dogs as one: every field is a number or an array (n,), and no shape is refused."""

    __hash__ = object.__hash__
    __eq__ = object.__eq__

    def __post_init__(self) -> None:
        """Accept any shape."""

    @property
    def possible(self) -> bool:
        """Whether there is such a dog, (n,) of bool."""
        return reduce(and_, (rule.kept for rule in _rules(self)))


class _Rule(NamedTuple):
    """Whether a dog keeps a rule, or for each of ``Dogs``, and the parts of its refusal."""

    kept: bool
    error: type[Exception]
    quantity: str
    value: float
    unit: str
    rule: str
    remedy: str
    numbers: tuple[float, ...] = ()  #: that the rule names


def _rules(dog: Dog) -> Iterator[_Rule]:
    whole, remedy = (dog.count % 1 == 0) & (dog.count >= 2), "give a whole number"
    rule = "a ring has a whole number of dogs of at least 2"
    yield _Rule(whole, InputError, "dog.count", dog.count, "", rule, remedy)
    rule = "it must be at least 0 and below 60 deg"
    for name in ("chamfer", "traction", "braking"):
        angle, key = getattr(dog, name), f"dog.{name}_deg"
        kept = (angle >= 0.0) & (angle < STEEP)
        yield _Rule(kept, InputError, key, angle / DEG, "deg", rule, SCOPE)
    rule = "it must lie between {:.6g} and {:.6g} mm"
    remedy = "check the length and that it is in millimetres"
    for key, (low, high) in LENGTHS.items():
        length, ends = getattr(dog, key.removesuffix("_mm")) / MM, (low / MM, high / MM)
        kept = (length >= ends[0]) & (length <= ends[1])
        yield _Rule(kept, InputError, f"dog.{key}", length, "mm", rule, remedy, ends)
    inner, outer = dog.inner_diameter, dog.outer_diameter
    rule, remedy = "it must be below dog.outer_diameter_mm = {:.6g} mm", "exchange or correct them"
    key, most = "dog.inner_diameter_mm", (outer / MM,)
    yield _Rule(inner < outer, InputError, key, inner / MM, "mm", rule, remedy, most)
    tip, low = dog.tip_width_at(dog.inner_radius) / MM, dog.braking_flank_height
    rule = "the flanks must not meet below the tip (0 mm)"
    remedy = "use fewer or lower dogs, smaller side angles or a larger inner diameter"
    name = "tip width at the inner radius"
    yield _Rule(tip > 0.0, GeometryError, name, tip, "mm", rule, remedy)
    kept, total = dog.tangents[0] * dog.tangents[2] < 1.0, (dog.chamfer + dog.braking) / DEG
    rule, name = "face and braking flank meet below 90 deg only", "chamfer and braking angle"
    yield _Rule(kept, GeometryError, name, total, "deg", rule, "use smaller angles")
    rule = "the chamfer must leave more than half the height, {:.4g} mm"
    remedy, half = "use a smaller chamfer, more dogs or a higher dog", 0.5 * dog.height
    name, least = "height of the braking flank", (half / MM,)
    yield _Rule(low > half, GeometryError, name, low / MM, "mm", rule, remedy, least)
    if dog.edge_radius > 0.0:
        radius, key, least = dog.edge_radius / MM, "dog.edge_radius_mm", (SHARPEST / MM,)
        rule, remedy = "an edge is sharp (0 mm) or at least {:.4g} mm round", "correct the radius"
        yield _Rule(radius >= least[0], InputError, key, radius, "mm", rule, remedy, least)
        rule = "it must be at most {:.4g} mm to leave {:.2g} mm of face and flanks"
        remedy = "use a smaller radius, fewer dogs or wider tips"
        kept, numbers = radius <= dog.edge_room / MM, (dog.edge_room / MM, LAND / MM)
        yield _Rule(kept, GeometryError, key, radius, "mm", rule, remedy, numbers)


Flank = Literal["traction", "braking"]
FLANKS: tuple[Flank, ...] = ("traction", "braking")


def side_angle(dog: Dog, flank: Flank) -> float:
    """Return the side angle of a flank, rad."""
    return dog.traction if flank == "traction" else dog.braking


@dataclass(frozen=True)
class FlankContact:
    """Part of a flank that touches at full depth, from ``low`` to ``high`` at the mean radius."""

    low: float  #: above the slot's floor, m
    high: float
    area: float  #: projected on the plane through the axis, m2

    @property
    def height(self) -> float:
        """Height that touches at the mean radius, m; negative where nothing does."""
        return self.high - self.low

    def level(self, share: float) -> float:
        """Return the height above the floor at a share of what touches, m."""
        return self.low + share * self.height


def tip_radius(dog: Dog, root_radius: float) -> float:
    """Return the radius with which tip edges are made, m: their own, or that of the roots."""
    return dog.edge_radius or root_radius


def flank_contact(dog: Dog, root_radius: float, flank: Flank) -> FlankContact:
    """Compute the part of two flanks that touches at full depth; ``root_radius`` in m."""
    radii, cut = (dog.inner_radius, dog.mean_radius, dog.outer_radius), dog.edge_cuts
    taken = tip_radius(dog, root_radius) * cos(side_angle(dog, flank)) * cut[FLANKS.index(flank)]
    drops = [dog.edge_drop_at(r) for r in radii] if flank == "braking" else [0.0, 0.0, 0.0]
    inner, mean, outer = (drop + taken for drop in drops)
    area = dog.radial_width * _mean_positive(dog.height - 2.0 * inner, dog.height - 2.0 * outer)
    return FlankContact(mean, dog.height - mean, area)


def _crest_angles(dog: Dog) -> tuple[float, float]:
    """Return the lean of the bisector of the crest and half of its angle, rad."""
    corner = 0.25 * math.pi
    return corner + 0.5 * (dog.chamfer + dog.traction), corner + 0.5 * (dog.traction - dog.chamfer)


def crest_loss(dog: Dog, root_radius: float) -> float:
    """Compute the height that the rounding takes from the crest, m."""
    lean, half = _crest_angles(dog)
    return root_radius * (math.sin(lean) / math.sin(half) - 1.0)


def crest_setback(dog: Dog, radius: float) -> float:
    """Compute how far the ridge of a rounded crest stands behind the sharp one, mean radius, m."""
    lean, half = _crest_angles(dog)
    return radius * cos(lean) / math.sin(half)


def root_radius_room(dog: Dog) -> float:
    """Return the largest radius of roots for which fillets and roundings fit side by side, m.

    On floor and face at the inner radius, where they are narrowest, on the traction flank,
    and on the braking flank at the outer radius, where it is lowest. Widths are taken along
    the circumference; ``sim.part.lands`` has the same between planes. Roundings have the same
    radius, or that of the dog's edges.
    """
    face, *flanks = dog.side_lengths
    # Over its radius a fillet takes along floor and flank, and a rounding along its sides:
    fillets = [1.0 / tan(0.25 * math.pi + 0.5 * lean) for lean in (dog.traction, dog.braking)]
    cuts, own = dog.edge_cuts, dog.edge_radius > 0.0
    rooms = [(dog.tip_width_at(dog.inner_radius), sum(fillets))]
    for length, fillet, cut in zip(flanks, fillets, cuts, strict=True):
        rooms.append((length - dog.edge_radius * cut, fillet if own else fillet + cut))
    if not own:
        rooms.append((face, sum(cuts)))
    return largest(0.0, smallest(*((length - LAND) / taken for length, taken in rooms)))


def _mean_positive(a: float, b: float) -> float:
    top, apart = largest(a, b, 0.0), abs(a - b)
    part = 0.5 * top**2 / where(apart > 0.0, apart, 1.0)
    return where(smallest(a, b) >= 0.0, 0.5 * (a + b), part)
