r"""The dog and a pair of equal rings, from a few numbers and two diameters (Jasny et al. 2019).

Chamfer :math:`\alpha`, side angles :math:`\beta, \gamma`, height *h*, *N* dogs, pitch
:math:`\vartheta = 2\pi/N`, backlash :math:`\varphi`, *j* at the mean radius. A flank is a plane
through the radial line at :math:`\pm(\vartheta - \varphi)/4` in the *pitch plane*, :math:`z = 0` at
half height (``root_depth`` of unlike rings: ``sim.shift.pair``), so that mating flanks lie on each
other once the play is turned; there a slot is wider than a dog by :math:`\varphi r`.

The ridge, :math:`z = h/2`, divides the tip at the share *c* (``crest``) from the braking to the
traction edge at every radius. The face falls from it by :math:`\alpha` towards the braking flank,
the back by :math:`\alpha_b` towards the traction flank; *c* = 1 has no back, *c* = 0 no face.

Widths run along the circumference at radius *r*:
:math:`w_{tip,root} = \tfrac{1}{2}(\vartheta - \varphi) r \mp \tfrac{h}{2}(\tan\beta +
\tan\gamma)`.

Rings whose pitch planes are *D* apart have a play of :math:`\varphi r + D(\tan\beta + \tan\gamma)`.
On the way in, flanks first face each other at :math:`D = h - 2d`, with the larger depth *d* of both
edges below the ridge: undercut flanks pass if the play is not negative there.

At full depth :math:`h - 2(d(r) + a)` of a flank touches, with the depth *d* of its edge. A rounding
by :math:`\varrho` takes :math:`a = \varrho \cos\beta \cot(\psi/2)` from it along the shaft,
:math:`\psi` the angle of the material.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property, reduce
from operator import and_
from typing import Any, Literal, NamedTuple

import numpy as np

from dogshape.sim.elementwise import Mask, cos, hypot, largest, smallest, tan, where
from dogshape.sim.errors import GeometryError, InputError, Refusal
from dogshape.sim.quantity import quantities_of, quantity
from dogshape.sim.units import DEG, MM, from_si, to_si, unit_of

LAND = 5e-5  #: m of every face that roundings and fillets leave
SHARPEST = 2e-5  #: m of an edge's or root's radius; nothing made is sharper
#: What no key of the dog can say; every refusal of such a key or value ends with it.
SCOPE = (
    "the model has flanks of -10 (undercut) to 60 deg, faces that fall to one side or, with "
    "dog.crest and dog.chamfer_back_deg, to both, backlash (dog.backlash_mm), and on both rings "
    "dogs of one number, annulus and pair of side angles ([output_dog] has what may differ)"
)
EQUAL_DOGS = (
    "the model has at least two equal dogs around each ring, which keep the rings parallel; give a "
    "whole number"
)
CREST = "give a share of the tip, 0 for a ridge on the braking and 1 on the traction edge"
LENGTH = "check the length and that it is in millimetres"


Flank = Literal["traction", "braking"]
FLANKS: tuple[Flank, ...] = ("traction", "braking")
#: Root of the teeth: the face of a ring, or the bore of a sleeve and the rim of its mate.
Mount = Literal["face", "sleeve"]


@dataclass(frozen=True)
class Dog:
    """One dog, its ring and the axial gap to the other ring, in SI units.

    Raises InputError where a value is not finite, negative or outside its mathematical range,
    GeometryError where the flanks meet below the tip, a chamfer eats a flank or belongs to no face,
    undercut dogs do not pass each other, or the roundings leave nothing of faces or flanks.
    """

    # Ranges are wide enough for any clutch, and narrow enough to catch a wrong unit.
    count: int = quantity("count", 2, 1000, remedy=EQUAL_DOGS)  #: of a ring
    chamfer: float = quantity("chamfer_deg", 0.0, 60.0, remedy=SCOPE)  #: of the face, rad
    #: side angle of the flank, rad; negative is an undercut
    traction: float = quantity("traction_deg", -10.0, 60.0, remedy=SCOPE)
    braking: float = quantity("braking_deg", -10.0, 60.0, remedy=SCOPE)  #: of the other flank
    height: float = quantity("height_mm", 0.2, 100.0)  #: crest above root, m
    outer_diameter: float = quantity("outer_diameter_mm", 5.0, 2000.0)  #: of the toothed annulus, m
    inner_diameter: float = quantity("inner_diameter_mm", 2.0, 2000.0)
    #: between the crests of the two rings before the shift, m
    axial_gap: float = quantity("axial_gap_mm", 0.0, 100.0)
    #: of crest and edges of the tip, m; 0 is sharp
    edge_radius: float = quantity("edge_radius_mm", 0.0, 10.0, 0.0, late=True)
    #: place of the ridge on the tip, 0 at its braking, 1 at its traction edge
    crest: float = quantity("crest", 0.0, 1.0, 1.0, late=True, remedy=CREST)
    #: by which the tip falls from the ridge to the traction flank, rad
    chamfer_back: float = quantity("chamfer_back_deg", 0.0, 60.0, 0.0, late=True, remedy=SCOPE)
    #: of the seated pair along the circumference at the mean radius, m
    backlash: float = quantity("backlash_mm", 0.0, 50.0, 0.0, late=True)
    #: of the root below the pitch plane, m; None: half the height
    root_depth: float | None = None

    def __post_init__(self) -> None:
        for rule in _rules(self):
            if not rule.satisfied:
                sentence = rule.rule.format(*rule.numbers)
                message = Refusal(rule.quantity, rule.value, rule.unit, sentence, rule.remedy)
                raise rule.error(message)

    @cached_property
    def tangents(self) -> tuple[float, float, float]:
        """Tangents of chamfer, traction and braking angle; nearly every length asks for them."""
        return tan(self.chamfer), tan(self.traction), tan(self.braking)

    @property
    def possible(self) -> bool:
        """Whether all rules of a shape are kept; always for a dog that was built."""
        return True

    @cached_property
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

    @cached_property
    def radial_width(self) -> float:
        """Length of a dog along the radius, m."""
        return self.outer_radius - self.inner_radius

    @cached_property
    def pitch_angle(self) -> float:
        """Angle from one dog to the next, rad."""
        return 2.0 * math.pi / self.count

    @property
    def pitch(self) -> float:
        """Pitch along the circumference at the mean radius, m."""
        return self.pitch_angle * self.mean_radius

    @cached_property
    def backlash_angle(self) -> float:
        """Play of the seated pair, rad."""
        return self.backlash / self.mean_radius

    @property
    def dedendum(self) -> float:
        """Depth of the root below the pitch plane, m."""
        return 0.5 * self.height if self.root_depth is None else self.root_depth

    @property
    def addendum(self) -> float:
        """Height of the crest above the pitch plane, m."""
        return self.height - self.dedendum

    @cached_property
    def lean(self) -> float:
        """Sum of the tangents of both side angles."""
        return self.tangents[1] + self.tangents[2]

    @property
    def has_back(self) -> bool:
        """Whether the tip has two faces, with the ridge between them."""
        return 0.0 < self.crest < 1.0

    @property
    def falls(self) -> tuple[float, float]:
        """Angles by which the tip falls to the edges of traction and braking flank, rad.

        Negative where it rises to a ridge on that edge.
        """
        traction = where(self.crest == 1.0, -self.chamfer, self.chamfer_back)
        return traction, where(self.crest == 0.0, -self.chamfer_back, self.chamfer)

    def tip_width_at(self, radius: float) -> float:
        """Width of the dog at crest height at ``radius``, m, between the planes of both flanks.

        Chamfers do not reduce it. The floor of a slot is wider by the play.
        """
        middle = 0.5 * (self.pitch_angle - self.backlash_angle) * radius
        return middle - self.addendum * self.lean

    def root_width_at(self, radius: float) -> float:
        """Width of the dog at its root at ``radius``, m; a slot's mouth is wider by the play."""
        middle = 0.5 * (self.pitch_angle - self.backlash_angle) * radius
        return middle + self.dedendum * self.lean

    @cached_property
    def tip_width(self) -> float:
        """Width at crest height at the mean radius, m."""
        return self.tip_width_at(self.mean_radius)

    @property
    def root_width(self) -> float:
        """Width at the root at the mean radius, m."""
        return self.root_width_at(self.mean_radius)

    @property
    def entry_play(self) -> float:
        """Width of the slot's mouth less ``tip_width`` at the mean radius, m.

        The share of a pitch that enters without touching a face at vanishing mismatch, where the
        tip is flat. Negative where only the chamfers of an undercut dog let it pass.
        """
        return self.height * self.lean + self.backlash

    @property
    def passing_play(self) -> float:
        """Play with which flanks first face each other on the way in, at the inner radius, m.

        Of undercut flanks this is the least play on the way; of others the play at full depth is.
        """
        inner = self.inner_radius
        drop = largest(*self.drops_at(inner))
        return self.backlash_angle * inner + (self.height - 2.0 * drop) * self.lean

    @cached_property
    def edge_drop(self) -> float:
        """Depth of the braking edge below the ridge at the mean radius, m."""
        return self.drops_at(self.mean_radius)[1]

    @cached_property
    def back_drop(self) -> float:
        """Depth of the traction edge below the ridge at the mean radius, m."""
        return self.drops_at(self.mean_radius)[0]

    def drops_at(self, radius: float) -> tuple[float, float]:
        """Depths of traction and braking edge, where tip and flank meet, below the ridge, m.

        A flank leans outwards below the crest, so its face runs on past its share of the tip
        width: ``drop / (1 - tan(chamfer) tan(braking))``. 0 where the ridge is that edge.
        """
        face, traction, braking = self.tangents
        back = tan(self.chamfer_back)
        tip = self.tip_width_at(radius)
        return (
            (1.0 - self.crest) * tip * back / (1.0 - back * traction),
            self.crest * tip * face / (1.0 - face * braking),
        )

    @cached_property
    def face_width(self) -> float:
        """Width of the face, ridge to braking edge, along the circumference at mean radius, m."""
        return self.crest * self.tip_width + self.edge_drop * self.tangents[2]

    @cached_property
    def back_width(self) -> float:
        """Width of the back, ridge to traction edge, along the circumference at mean radius, m."""
        return (1.0 - self.crest) * self.tip_width + self.back_drop * self.tangents[1]

    @cached_property
    def crest_overlap(self) -> float:
        """Overlap of two faces at dogs facing dogs, ridge to ridge at the mean radius, m.

        Twice the way of the ridge from the middle of the dog towards the traction flank; where it
        is negative, backs overlap by as much.
        """
        traction_line = 0.5 * (self.pitch - self.backlash)
        traction_edge = traction_line - 2.0 * self.addendum * self.tangents[1]
        return traction_edge - 2.0 * (1.0 - self.crest) * self.tip_width

    @property
    def ridge_offset(self) -> float:
        """Distance of the ridge from a parallel radial line, m, positive to growing angles.

        The line is at ``2 crest - 1`` times the angle of the traction flank's line. Two ridges on
        each other cross at twice this distance over the radius.
        """
        rise = self.addendum
        _, traction, braking = self.tangents
        return (1.0 - self.crest) * rise * braking - self.crest * rise * traction

    @property
    def edge_cuts(self) -> tuple[float, float]:
        """Lengths that a rounding takes beside traction and braking edge, over its radius.

        ``cot(psi/2)`` with the angle of the material, 90 degrees + side angle + the fall of the tip
        to that edge: 90 degrees + traction - chamfer at a crest on the traction edge.
        """
        traction_fall, braking_fall = self.falls
        traction_half = 0.25 * math.pi + 0.5 * (self.traction + traction_fall)
        braking_half = 0.25 * math.pi + 0.5 * (braking_fall + self.braking)
        return 1.0 / tan(traction_half), 1.0 / tan(braking_half)

    @property
    def crest_cut(self) -> float:
        """Length that a rounding takes beside the ridge, over its radius.

        A ridge on an edge has the length of ``edge_cuts``, a ridge between two faces
        ``tan((chamfer + chamfer_back)/2)``.
        """
        traction, braking = self.edge_cuts
        inner = tan(0.5 * (self.chamfer + self.chamfer_back))
        braking_or_inner = where(self.crest == 0.0, braking, inner)
        return where(self.crest == 1.0, traction, braking_or_inner)

    @property
    def edge_room(self) -> float:
        """Largest radius of crest and edges that leaves ``LAND`` of faces and flanks, m."""
        traction, braking = self.edge_cuts
        crest = self.crest_cut
        cuts = (crest + braking, traction + crest, traction, braking)
        sides = zip(self.side_lengths, cuts, strict=True)
        return largest(0.0, smallest(*((length - LAND) / cut for length, cut in sides)))

    @property
    def side_lengths(self) -> tuple[float, float, float, float]:
        """Lengths of face, back, traction and braking flank across the edges, at the least, m.

        Infinite for a face that the tip does not have.
        """
        chamfer, traction, braking = self.tangents
        tip = self.tip_width_at(self.inner_radius)
        traction_drop, braking_drop = self.drops_at(self.inner_radius)
        face = (self.crest * tip + braking_drop * braking) * hypot(1.0, chamfer)
        back = (1.0 - self.crest) * tip + traction_drop * traction
        back *= hypot(1.0, tan(self.chamfer_back))
        traction_drop, braking_drop = self.drops_at(self.outer_radius)
        return (
            where(self.crest == 0.0, math.inf, face),
            where(self.crest == 1.0, math.inf, back),
            (self.height - traction_drop) / cos(self.traction),
            (self.height - braking_drop) / cos(self.braking),
        )

    @property
    def travel(self) -> float:
        """Axial way from the start of the shift to full depth, m."""
        return self.axial_gap + self.height

    @property
    def axial_length(self) -> float:
        """Room the pair needs along the shaft when open, root to root, m."""
        return self.axial_gap + 2.0 * self.height


def section(dog: Dog) -> list[tuple[float, float]]:
    """Compute the corners of a dog's profile, unrolled at the mean radius, from root to root, m.

    Points (along the circumference, above the pitch plane): braking root, braking edge, ridge,
    traction edge, traction root; a ridge on an edge is one point with it. The slot's floor runs on
    at the root's height.
    """
    rise = dog.addendum
    depth = dog.dedendum
    quarter = 0.25 * (dog.pitch - dog.backlash)
    braking_edge = rise - dog.edge_drop
    traction_edge = rise - dog.back_drop
    ridge = [(0.5 * dog.crest_overlap, rise)] if dog.has_back else []
    return [
        (-quarter - depth * tan(dog.braking), -depth),
        (-quarter + braking_edge * tan(dog.braking), braking_edge),
        *ridge,
        (quarter - traction_edge * tan(dog.traction), traction_edge),
        (quarter + depth * tan(dog.traction), -depth),
    ]


def field_values(value: Any) -> dict[str, Any]:
    """Return the values of a dataclass by the names of its fields."""
    return {entry.name: getattr(value, entry.name) for entry in fields(value)}


@dataclass(frozen=True, eq=False)
class Dogs(Dog):
    """Many dogs as one: every field is a number or an array (n,), and no shape is refused."""

    row: Any = None  #: of each dog's design among many, (n,) of int; None where no design has one

    __hash__ = object.__hash__
    __eq__ = object.__eq__

    def __post_init__(self) -> None:
        """Accept any shape."""

    @classmethod
    def of(cls, dog: Dog, **columns: Any) -> Dogs:
        """Build many dogs of one or of many, with ``columns`` (n,) in place of some fields."""
        return cls(**(field_values(dog) | columns))

    @property
    def possible(self) -> bool:
        """Whether all rules of a shape are kept, (n,) of bool."""
        return reduce(and_, (rule.satisfied for rule in _rules(self)))

    @cached_property
    def size(self) -> int:
        """Number of dogs."""
        return np.broadcast(*field_values(self).values()).size

    def select(self, mask: Mask) -> Dogs:
        """Select the dogs of a mask (n,)."""
        columns = field_values(self).items()
        return replace(self, **{n: values[mask] for n, values in columns if np.ndim(values)})

    @classmethod
    def join(cls, groups: Sequence[Dogs]) -> Dogs:
        """Join groups of as many dogs each; a number that all share stays one."""
        size = groups[0].size
        columns: dict[str, Any] = {}
        for field in fields(cls):
            values = [getattr(dogs, field.name) for dogs in groups]
            columns[field.name] = values[0]
            if any(map(np.ndim, values)) or len(set(values)) > 1:
                columns[field.name] = np.concatenate([np.broadcast_to(v, size) for v in values])
        return cls(**columns)


class _Rule(NamedTuple):
    """Rule of a shape, its state for a dog or for each of ``Dogs``, and parts of its refusal."""

    satisfied: bool
    error: type[Exception]
    quantity: str
    value: float
    unit: str
    rule: str
    remedy: str
    numbers: tuple[float, ...] = ()  #: that the rule names


def _rules(dog: Dog) -> Iterator[_Rule]:
    """Yield all rules of a shape, in the order of their refusals."""
    yield from _range_rules(dog)
    yield _Rule(
        dog.count % 1 == 0,
        InputError,
        "dog.count",
        value=dog.count,
        unit="",
        rule="a ring has a whole number of dogs",
        remedy="give a whole number",
    )
    yield from _ridge_rules(dog)
    yield _Rule(
        dog.inner_diameter < dog.outer_diameter,
        InputError,
        "dog.inner_diameter_mm",
        value=dog.inner_diameter / MM,
        unit="mm",
        rule="it must be below dog.outer_diameter_mm = {:.6g} mm",
        remedy="exchange or correct them",
        numbers=(dog.outer_diameter / MM,),
    )
    yield from _profile_rules(dog)
    if dog.edge_radius > 0.0:
        yield from _edge_radius_rules(dog)


def _range_rules(dog: Dog) -> Iterator[_Rule]:
    """Yield the range of each field."""
    for name, declared in quantities_of(Dog).items():
        key = declared.key
        value = getattr(dog, name)
        unit = unit_of(key)
        yield _Rule(
            (value >= to_si(key, declared.low)) & (value <= to_si(key, declared.high)),
            InputError,
            f"dog.{key}",
            value=from_si(key, value),
            unit=unit,
            rule=f"it must lie between {{:g}} and {{:g}} {unit}".rstrip(),
            remedy=declared.remedy or LENGTH,
            numbers=(declared.low, declared.high),
        )


def _ridge_rules(dog: Dog) -> Iterator[_Rule]:
    """Yield the rules of a ridge on an edge and on a flat tip."""
    for name, edge_crest, side in (("chamfer_back", 1.0, "traction"), ("chamfer", 0.0, "braking")):
        angle = getattr(dog, name)
        yield _Rule(
            (dog.crest != edge_crest) | (angle == 0.0),
            GeometryError,
            f"dog.{name}_deg",
            value=angle / DEG,
            unit="deg",
            rule=(
                f"it must be 0 with dog.crest = {edge_crest:g}: the ridge stands on the {side} edge"
            ),
            remedy="give dog.crest between 0 and 1, 0.5 for a ridge in the middle",
        )
    yield _Rule(
        (dog.crest == 0.0) | (dog.crest == 1.0) | (dog.chamfer + dog.chamfer_back > 0.0),
        GeometryError,
        "dog.crest",
        value=dog.crest,
        unit="",
        rule="a flat tip has no ridge",
        remedy="give a chamfer, or leave dog.crest out",
    )


def _edge_radius_rules(dog: Dog) -> Iterator[_Rule]:
    """Yield the rules of the radius of a rounded edge."""
    radius = dog.edge_radius / MM
    min_radius = SHARPEST / MM
    yield _Rule(
        radius >= min_radius,
        InputError,
        "dog.edge_radius_mm",
        value=radius,
        unit="mm",
        rule="an edge is sharp (0 mm) or at least {:.4g} mm round",
        remedy="correct the radius",
        numbers=(min_radius,),
    )
    max_radius = dog.edge_room / MM
    yield _Rule(
        radius <= max_radius,
        GeometryError,
        "dog.edge_radius_mm",
        value=radius,
        unit="mm",
        rule="it must be at most {:.4g} mm to leave {:.2g} mm of face and flanks",
        remedy="use a smaller radius, fewer dogs or wider tips",
        numbers=(max_radius, LAND / MM),
    )


def _profile_rules(dog: Dog) -> Iterator[_Rule]:
    """Yield the rules of tip, root and flanks of the profile."""
    tip = dog.tip_width_at(dog.inner_radius) / MM
    yield _Rule(
        tip > 0.0,
        GeometryError,
        "tip width at the inner radius",
        value=tip,
        unit="mm",
        rule="the flanks must not meet below the tip (0 mm)",
        remedy=(
            "use fewer or lower dogs, smaller side angles, less backlash or a larger inner diameter"
        ),
    )
    root = dog.root_width_at(dog.inner_radius) / MM
    min_root = 0.5 * tip
    yield _Rule(
        root > min_root,
        GeometryError,
        "root width at the inner radius",
        value=root,
        unit="mm",
        rule="an undercut must leave more than half the tip width, {:.4g} mm",
        remedy="use less undercut or lower dogs",
        numbers=(min_root,),
    )
    yield from _flank_rules(dog, "traction", dog.chamfer_back, dog.height - dog.back_drop)
    yield from _flank_rules(dog, "braking", dog.chamfer, dog.height - dog.edge_drop)
    play = dog.passing_play
    yield _Rule(
        play >= 0.0,
        GeometryError,
        "play at the mouth of a slot",
        value=play / MM,
        unit="mm",
        rule="undercut flanks must pass each other on the way in (0 mm)",
        remedy="use more backlash, less undercut or a larger chamfer",
    )


def _flank_rules(dog: Dog, flank: Flank, fall: float, height: float) -> Iterator[_Rule]:
    """Yield the rules of a flank below a face that falls by an angle in rad; height in m."""
    lean = side_angle(dog, flank)
    face = "chamfer" if flank == "braking" else "back chamfer"
    yield _Rule(
        tan(fall) * tan(lean) < 1.0,
        GeometryError,
        f"{face} and {flank} angle",
        value=(fall + lean) / DEG,
        unit="deg",
        rule=f"face and {flank} flank meet below 90 deg only",
        remedy="use smaller angles",
    )
    min_height = 0.5 * dog.height
    yield _Rule(
        height > min_height,
        GeometryError,
        f"height of the {flank} flank",
        value=height / MM,
        unit="mm",
        rule="the chamfer must leave more than half the height, {:.4g} mm",
        remedy="use a smaller chamfer, more dogs or a higher dog",
        numbers=(min_height / MM,),
    )


def side_angle(dog: Dog, flank: Flank) -> float:
    """Look up the side angle of a flank, rad."""
    return dog.traction if flank == "traction" else dog.braking


@dataclass(frozen=True)
class FlankContact:
    """Part of a flank that touches at full depth, from ``low`` to ``high`` at the mean radius."""

    low: float  #: above the slot's floor, m
    high: float
    area: float  #: projected on the plane through the axis, m2

    @property
    def height(self) -> float:
        """Height that touches at the mean radius, m; negative without a touch."""
        return self.high - self.low

    def level(self, share: float) -> float:
        """Compute the height above the floor at a share of the touching height, m."""
        return self.low + share * self.height


def tip_radius(dog: Dog, root_radius: float) -> float:
    """Select the radius of tip edges as made, m: their own or the roots' radius."""
    return dog.edge_radius or root_radius


class FlankLosses(NamedTuple):
    """Depths of a flank's rounded edge below the ridge, m, at three radii."""

    inner: float
    mean: float
    outer: float


def _flank_losses(dog: Dog, root_radius: float, flank: Flank) -> FlankLosses:
    """Compute the depths of a flank's rounded edge; ``root_radius`` in m."""
    side = FLANKS.index(flank)
    edge = tip_radius(dog, root_radius) * cos(side_angle(dog, flank)) * dog.edge_cuts[side]
    return FlankLosses(
        inner=dog.drops_at(dog.inner_radius)[side] + edge,
        mean=dog.drops_at(dog.mean_radius)[side] + edge,
        outer=dog.drops_at(dog.outer_radius)[side] + edge,
    )


def flank_contact(
    dog: Dog,
    root_radius: float,
    flank: Flank,
    mate: Dog | None = None,
    depth: float | None = None,
) -> FlankContact:
    """Compute the part of a dog's flank that touches at full depth.

    ``root_radius`` in m; ``mate`` is the dog of the other ring, None for an equal one. ``depth``
    is the way from crest on crest to full depth, m, by default the height of the lower dog.
    """
    losses = _flank_losses(dog, root_radius, flank)
    mate_losses = losses
    lower_height = dog.height
    if mate is not None:
        mate_losses = _flank_losses(mate, root_radius, flank)
        lower_height = smallest(dog.height, mate.height)
    depth = lower_height if depth is None else depth
    inner_height = depth - (losses.inner + mate_losses.inner)
    outer_height = depth - (losses.outer + mate_losses.outer)
    # Of a height that falls to zero within the width, the part that is positive.
    difference = abs(inner_height - outer_height)
    highest = largest(inner_height, outer_height, 0.0)
    partial_height = 0.5 * highest**2 / where(difference > 0.0, difference, 1.0)
    mean_height = 0.5 * (inner_height + outer_height)
    both_touch = smallest(inner_height, outer_height) >= 0.0
    touching_height = where(both_touch, mean_height, partial_height)
    low = dog.height - depth + mate_losses.mean
    return FlankContact(low, dog.height - losses.mean, dog.radial_width * touching_height)


def _crest_angles(dog: Dog) -> tuple[float, float]:
    """Compute the lean of the bisector of the crest and half of its angle, rad.

    Faces that fall from the crest on either side lean from the axis as a flank does.
    """
    half_right = 0.25 * math.pi
    right_angle = 0.5 * math.pi
    lean = where(dog.crest == 1.0, dog.traction, right_angle - dog.chamfer_back)
    fall = where(dog.crest == 0.0, right_angle - dog.braking, dog.chamfer)
    return half_right + 0.5 * (fall + lean), half_right + 0.5 * (lean - fall)


def crest_loss(dog: Dog, root_radius: float) -> float:
    """Compute the height that the rounding takes from the crest, m."""
    lean, half = _crest_angles(dog)
    return root_radius * (math.sin(lean) / math.sin(half) - 1.0)


def crest_setback(dog: Dog, radius: float) -> float:
    """Compute the setback of a rounded crest's ridge behind the sharp one at mean radius, m."""
    lean, half = _crest_angles(dog)
    return radius * cos(lean) / math.sin(half)


def root_radius_room(dog: Dog) -> float:
    """Compute the largest radius of roots with which fillets and roundings fit side by side, m.

    On floor and faces at the inner radius, where they are narrowest, and on the flanks at the
    outer radius, where they are lowest. Widths are taken along the circumference;
    ``sim.part.lands`` has the same between planes. Roundings have the same radius, or that of the
    dog's edges.
    """
    face, back, *flanks = dog.side_lengths
    # Over its radius a fillet takes along floor and flank, and a rounding along its sides:
    fillets = [1.0 / tan(0.25 * math.pi + 0.5 * lean) for lean in (dog.traction, dog.braking)]
    cuts = dog.edge_cuts
    has_edge_radius = dog.edge_radius > 0.0
    floor = dog.tip_width_at(dog.inner_radius) + dog.backlash_angle * dog.inner_radius
    rooms = [(floor, sum(fillets))]
    for length, fillet, cut in zip(flanks, fillets, cuts, strict=True):
        free_length = length - dog.edge_radius * cut
        rooms.append((free_length, fillet if has_edge_radius else fillet + cut))
    if not has_edge_radius:
        traction_cut, braking_cut = cuts
        rooms.append((face, dog.crest_cut + braking_cut))
        rooms.append((back, traction_cut + dog.crest_cut))
    return largest(0.0, smallest(*((length - LAND) / cut for length, cut in rooms)))
