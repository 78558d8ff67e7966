r"""The dog and the pair of rings, from six numbers and two diameters.

Notation of Jasný, Hajžman and Achtenová (2019): :math:`\alpha` chamfer,
:math:`\beta` traction flank, :math:`\gamma` braking flank, :math:`h` height,
:math:`N` dogs; the pitch is :math:`\vartheta = 2\pi/N`.

*Median plane*: half height. There dog and slot are equally wide, so each
spans :math:`\vartheta/2` and both flanks touch at full depth.

*Flank*: a plane through the radial line at :math:`\pm\vartheta/4` in the median
plane, leaning inwards by its side angle. With :math:`u` along that line and
:math:`t` across it a flank is :math:`\rho u - z \tan\beta\, t`. Only this form
lets mating flanks touch all over (Jasný thesis 2019, figure 24b).

*Face*: one plane through the crest, the edge of the traction flank at
:math:`z = h/2`, falling by :math:`\alpha` towards the braking flank. The crest
is parallel to the median plane, so the dog is equally high over its length.

*Edges*: crest and braking edge are sharp, or rounded with one radius. All lengths are those of the
sharp dog, to the intersection of its faces, as a drawing has them.

Widths are measured along the circumference at the mean radius:

.. math::
    w_{tip} = \tfrac{1}{2}\vartheta r - \tfrac{h}{2}(\tan\beta + \tan\gamma), \quad
    w_{root} = \tfrac{1}{2}\vartheta r + \tfrac{h}{2}(\tan\beta + \tan\gamma)

Both rings carry the same dog, one of them turned over about a radial axis.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from dogshape.sim.errors import GeometryError, InputError, refusal, require_between
from dogshape.sim.units import DEG, MM, from_si, unit_of

LAND = 5e-5  #: m of every face that roundings and fillets leave
SHARPEST = 2e-5  #: m of an edge's or root's radius; nothing made is sharper
_ANGLES = ("chamfer_deg", "traction_deg", "braking_deg")
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
        _require_numbers(self)
        _require_shape(self)
        _require_edges(self)

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
        return math.tan(self.traction) + math.tan(self.braking)

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
    def entry_play_angle(self) -> float:
        """Entry play as an angle, rad."""
        return self.entry_play / self.mean_radius

    @property
    def edge_drop(self) -> float:
        """Depth below the crest at which the face meets the braking flank, m.

        The flank leans outwards below the crest, so the face runs on past the
        tip width: ``drop / (1 - tan(chamfer) tan(braking))``.
        """
        return self.edge_drop_at(self.mean_radius)

    def edge_drop_at(self, radius: float) -> float:
        """Depth below the crest at which the face meets the braking flank at ``radius``, m."""
        slope = math.tan(self.chamfer)
        return self.tip_width_at(radius) * slope / (1.0 - slope * math.tan(self.braking))

    @property
    def face_width(self) -> float:
        """Width of the face, crest to braking edge, along the circumference at mean radius, m."""
        return self.tip_width + self.edge_drop * math.tan(self.braking)

    @property
    def crest_overlap(self) -> float:
        """Overlap of two faces at dogs facing dogs, crest to crest at the mean radius, m."""
        return 0.5 * self.pitch - self.height * math.tan(self.traction)

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
        corners = (self.traction - self.chamfer, self.chamfer + self.braking)
        crest, braking = (1.0 / math.tan(0.25 * math.pi + 0.5 * corner) for corner in corners)
        return crest, braking

    @property
    def edge_room(self) -> float:
        """Largest radius of crest and braking edge that leaves ``LAND`` of face and flanks, m.

        The face is narrowest at the inner radius, the braking flank lowest at the outer one.
        """
        narrow = self.tip_width_at(self.inner_radius)
        drop = self.edge_drop_at(self.inner_radius)
        face = (narrow + drop * math.tan(self.braking)) / math.cos(self.chamfer)
        low = self.height - self.edge_drop_at(self.outer_radius)
        crest, braking = self.edge_cuts
        rooms = (
            (face, crest + braking),
            (self.height / math.cos(self.traction), crest),
            (low / math.cos(self.braking), braking),
        )
        return max(0.0, min((length - LAND) / taken for length, taken in rooms))

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
        (-middle - half * math.tan(dog.braking), -half),
        (-middle + edge * math.tan(dog.braking), edge),
        (middle - half * math.tan(dog.traction), half),
        (middle + half * math.tan(dog.traction), -half),
    ]


def _require_numbers(dog: Dog) -> None:
    if dog.count != int(dog.count) or dog.count < 2:
        rule = "a ring has a whole number of dogs of at least 2"
        raise InputError(refusal("dog.count", dog.count, "", rule, "give a whole number"))
    for name in _ANGLES:
        angle = getattr(dog, name.removesuffix("_deg"))
        if not 0.0 <= angle < math.radians(60.0):
            rule = "it must be at least 0 and below 60 deg"
            remedy = SCOPE if angle < 0.0 else "check the angle and that it is in degrees"
            _refuse_value(name, angle, rule, remedy)
    for name, (low, high) in LENGTHS.items():
        length = getattr(dog, name.removesuffix("_mm"))
        remedy = "check the length and that it is in millimetres"
        require_between(f"dog.{name}", length / MM, low / MM, high / MM, remedy)
    if dog.inner_diameter >= dog.outer_diameter:
        rule = f"it must be below dog.outer_diameter_mm = {dog.outer_diameter * 1e3:.6g} mm"
        _refuse_value("inner_diameter_mm", dog.inner_diameter, rule, "exchange or correct the two")


def _refuse_value(name: str, value: float, rule: str, remedy: str) -> None:
    edge_value = from_si(name, value)
    raise InputError(refusal(f"dog.{name}", edge_value, unit_of(name), rule, remedy))


def _require_shape(dog: Dog) -> None:
    tip = dog.tip_width_at(dog.inner_radius)
    if tip <= 0.0:
        rule = "the flanks must not meet below the tip (0 mm)"
        remedy = "use fewer or lower dogs, smaller side angles or a larger inner diameter"
        message = refusal("tip width at the inner radius", tip * 1e3, "mm", rule, remedy)
        raise GeometryError(message)
    if math.tan(dog.chamfer) * math.tan(dog.braking) >= 1.0:
        total = (dog.chamfer + dog.braking) / DEG
        rule = "face and braking flank meet below 90 deg only"
        message = refusal("chamfer and braking angle", total, "deg", rule, "use smaller angles")
        raise GeometryError(message)
    low = dog.braking_flank_height
    if low <= 0.5 * dog.height:
        rule = f"the chamfer must leave more than half the height, {dog.height * 500:.4g} mm"
        remedy = "use a smaller chamfer, more dogs or a higher dog"
        message = refusal("height of the braking flank", low * 1e3, "mm", rule, remedy)
        raise GeometryError(message)


def _require_edges(dog: Dog) -> None:
    if dog.edge_radius == 0.0:
        return
    radius, room = dog.edge_radius / MM, dog.edge_room / MM
    if radius < SHARPEST / MM:
        rule = f"an edge is sharp (0 mm) or at least {SHARPEST / MM:.4g} mm round"
        raise InputError(refusal("dog.edge_radius_mm", radius, "mm", rule, "correct the radius"))
    if radius > room:
        rule = f"it must be at most {room:.4g} mm to leave {LAND / MM:.2g} mm of face and flanks"
        remedy = "use a smaller radius, fewer dogs or wider tips"
        raise GeometryError(refusal("dog.edge_radius_mm", radius, "mm", rule, remedy))
