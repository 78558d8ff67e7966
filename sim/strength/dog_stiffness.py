r"""Stiffness of a pair of dogs at flank and face, with the sector of ring behind each.

A dog is a bar on the ring: with the force's height *l*, thickness *s(z)*, and moment *m(z)* of a
unit force about the middle of the section, compression :math:`\int n^2/s`, bending :math:`\int 12
m^2/s^3` and shear :math:`\int 2.4 (1 + \nu)/(1 - \nu^2)\, q^2/s` add up to a compliance in units of
:math:`(1 - \nu^2)/(E b)`, *b* the length of a dog along the radius. The root rotates with the
square of its moment over *s*; the sector, *D* pitches deep, adds :math:`(1 - 2 \nu)/(1 - \nu)^2 D`
along the axis, as it does not stretch along the circumference, and :math:`2 D/(1 - \nu)` along
that. All of this times the factor of a short dog in three dimensions over plane strain.

*Local*: a pressure on a strip beside an edge of the angle :math:`\psi` strains a wedge. Its energy
over each unit of :math:`\ln r` (Michell 1900, Flamant's wedge)

.. math:: W = \frac{\sin^2(\psi/2)}{\psi/2 + \sin(\psi)/2}
    + \frac{\cos^2(\psi/2)}{\psi/2 - \sin(\psi)/2}

is :math:`2/\pi` for a half plane and three times that at a right angle. A strip *w* wide that
begins *s* from the sharp edge, as beside a rounding, strains a half plane up to :math:`\lambda = w
+ k s`, beyond it the wedge.

The compliance is conjugate to the force along the shaft or the circumference: work over its square.
Coefficients are fitted to finite elements of 20 designs by ``python -m benchmarks.dog_stiffness``,
with a body of one and half a pitch. On 14 others the stiffness deviates by 4.4 % rms and at most 10
% at flanks, 1.7 and 6 % at faces, for a body of one pitch; at most 13 and 7 % for half a pitch, 7
and 4 % for two pitches, which were not fitted. Ranges as of ``dog_strength.root_tension``; dogs of
2 to 16 mm along the radius stay within 4 %, a backlash of 0.3 pitches makes the stiffness 8 % too
large.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from dogshape.sim.elementwise import arctan, largest, log, smallest, tan, where
from dogshape.sim.shift.geometry import FLANKS, Dog, Flank, side_angle
from dogshape.sim.strength.materials import POISSON, YOUNG

PLANE_MODULUS = YOUNG / (1.0 - POISSON**2)  #: of plane strain, Pa
SHEAR_COMPLIANCE = 2.0 / (1.0 - POISSON)  #: of shear, over that of plane strain
#: of the sector along the axis over that of plane strain: the circumference does not stretch
SECTOR_COMPLIANCE = (1.0 - 2.0 * POISSON) / (1.0 - POISSON) ** 2
SHEAR_FACTOR = 1.2  #: of a rectangle
BODY_DEPTH = 1.0  #: of the sector that deforms, pitches
HALF_PLANE = 2.0 / math.pi  #: W of a half plane
SHORT_DOG = 1.146  #: compliance in three dimensions over plane strain, as of whole faces
#: Smallest width and band, m: impossible shapes among ``Dogs`` have a finite stiffness.
SMALLEST_LENGTH = 1e-5
_POINTS, _WEIGHTS = np.polynomial.legendre.leggauss(5)
#: Heights of a bar's sections over that of the load, and their weights.
SECTIONS = tuple(zip((0.5 + 0.5 * _POINTS).tolist(), (0.5 * _WEIGHTS).tolist(), strict=True))


class FlankFit(NamedTuple):
    """Coefficients of ``flank_compliance``."""

    shear: float  #: on that of the bar
    root: float  #: on the square of the root's moment over its width
    sector: float  #: on the shear of the sector
    constant: float
    spread: float  #: on the logarithm of thickness over height of the flank
    edge: float  #: on the wedge of a load near the upper end


class FaceFit(NamedTuple):
    """Coefficients of ``face_compliance``."""

    root: float  #: on the square of the root's moment over its width
    constant: float
    lean: float  #: on the square of the slope of the face
    end: float  #: on the share of the face beside the strip
    curve: float  #: on the square of that share
    setback: float  #: on the distance of the strip from the edge


FLANK = FlankFit(
    shear=0.653,
    root=3.212,
    sector=0.922,
    constant=0.117,
    spread=0.726,
    edge=0.529,
)
FACE = FaceFit(
    root=1.017,
    constant=0.152,
    lean=0.605,
    end=0.593,
    curve=0.997,
    setback=1.884,
)


class _Force(NamedTuple):
    """Force on a dog of unit size and its place."""

    across: float  #: part towards the traction flank
    down: float  #: part towards the ring
    place: float  #: along the circumference from the middle plane of the flanks' lines, m
    height: float  #: above the floor, m


class _Bar(NamedTuple):
    """Compliances of a dog as a bar on its root, in units of 1/(E' b)."""

    compression: float
    bending: float
    shear: float
    moment: float  #: at the root, over its width


def _bar(dog: Dog, force: _Force) -> _Bar:
    """Integrate the strain energy of a dog below a force."""
    _, traction, braking = dog.tangents
    quarter = 0.25 * (dog.pitch - dog.backlash)
    compression = bending = shear = 0.0
    for share, weight in SECTIONS:
        height = share * force.height
        above = height - dog.dedendum
        width = largest(2.0 * quarter - above * (traction + braking), SMALLEST_LENGTH)
        middle = 0.5 * above * (braking - traction)
        arm = force.down * (force.place - middle) + force.across * (force.height - height)
        step = weight * force.height
        compression = compression + step * force.down**2 / width
        bending = bending + step * 12.0 * arm**2 / width**3
        shear = shear + step * SHEAR_FACTOR * SHEAR_COMPLIANCE * force.across**2 / width
    root_middle = 0.5 * dog.dedendum * (traction - braking)
    moment = force.down * (force.place - root_middle) + force.across * force.height
    root_width = largest(dog.root_width, SMALLEST_LENGTH)
    return _Bar(compression, bending, shear, moment / root_width)


def wedge_compliance(cotangent: float) -> float:
    """Compute W of a wedge by the cotangent of half of its angle."""
    half_angle = arctan(1.0 / cotangent)
    square = 1.0 / (1.0 + cotangent**2)  # of the sine
    half_sine = cotangent * square
    return square / (half_angle + half_sine) + (1.0 - square) / (half_angle - half_sine)


class FlankLoad(NamedTuple):
    """Even pressure on a flank: heights above the floor of its resultant and upper end, m."""

    level: float
    top: float


def flank_compliance(
    dog: Dog, flank: Flank, load: FlankLoad, depth: float = BODY_DEPTH, by: FlankFit = FLANK
) -> float:
    """Compute the compliance of one dog and its sector along the circumference, m/N.

    ``depth`` of the sector in pitches.
    """
    slope = tan(side_angle(dog, flank))
    side = FLANKS.index(flank)
    outward = 1.0 - 2.0 * side  # traction flanks face growing angles
    quarter = 0.25 * (dog.pitch - dog.backlash)
    place = outward * (quarter - (load.level - dog.dedendum) * slope)
    bar = _bar(dog, _Force(-outward, down=slope, place=place, height=load.level))
    height = largest(dog.height - dog.drops_at(dog.mean_radius)[side], SMALLEST_LENGTH)
    band = largest(2.0 * (load.top - load.level), SMALLEST_LENGTH)
    thickness = largest(0.5 * (dog.tip_width + dog.root_width), SMALLEST_LENGTH)
    wedge = wedge_compliance(dog.edge_cuts[side]) * (1.0 + slope**2)
    body = (
        bar.compression
        + bar.bending
        + by.shear * bar.shear
        + by.root * bar.moment**2
        + by.sector * SHEAR_COMPLIANCE * depth
        + by.constant
    )
    local = by.spread * log(thickness / height) + by.edge * wedge * log(height / band)
    return (SHORT_DOG * body + local) / (PLANE_MODULUS * dog.radial_width)


class Strip(NamedTuple):
    """Strip of a face under pressure, m along the circumference."""

    start: float  #: from the sharp crest
    width: float


def face_compliance(
    dog: Dog,
    strip: Strip,
    depth: float = BODY_DEPTH,
    by: FaceFit = FACE,
    short_dog: float = SHORT_DOG,
) -> float:
    """Compute the compliance of one dog and its sector along the shaft, m/N.

    The strip lies on the face, of dogs without one on the back. ``depth`` of the sector in pitches;
    ``short_dog`` is 1 in plane strain.
    """
    is_back = dog.crest == 0.0
    inward = where(is_back, 1.0, -1.0)  # from the crest, towards growing angles
    slope = tan(where(is_back, dog.chamfer_back, dog.chamfer))
    face_width = largest(where(is_back, dog.back_width, dog.face_width), SMALLEST_LENGTH)
    middle = strip.start + 0.5 * strip.width
    force = _Force(
        -inward * slope,
        down=1.0,
        place=0.5 * dog.crest_overlap + inward * middle,
        height=dog.height - slope * middle,
    )
    bar = _bar(dog, force)
    reach = strip.width + by.setback * strip.start
    share = 1.0 - smallest(reach / face_width, 1.0)
    tilt = 1.0 + slope**2
    wedge = wedge_compliance(dog.crest_cut)
    local = wedge * (log(face_width / reach) - by.end * share - by.curve * share**2)
    local = local + HALF_PLANE * log(reach / strip.width)
    body = (
        bar.compression
        + bar.bending
        + bar.shear
        + by.root * bar.moment**2
        + depth * (SECTOR_COMPLIANCE + SHEAR_COMPLIANCE * slope**2)
        + by.constant
        + by.lean * slope**2
    )
    return (short_dog * body + tilt * local) / (PLANE_MODULUS * dog.radial_width)
