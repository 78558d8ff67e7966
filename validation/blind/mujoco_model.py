r"""MuJoCo model of the stand with its truth, a mechanism of MuJoCo for each effect.

One convex dog of the sliding ring carries the whole ring, meets every dog of the output ring and
overhangs it. The direct format of contact parameters gives each contact a spring and a damper for
the very mass that it moves, :math:`A f = \omega^2 |r| - c v`. Impedance 1e-3: near 1, a contact
that slips is also pushed apart. ``multiccd`` off: of two crossing edges it takes a flank's normal.
``diagexact``: else *A* lacks the turning inertia. Restitution of a spring and damper: Schwager and
Pöschel (2007).

Friction and drag are ``frictionloss`` of slide and hinge, that of a
spline set each step by the contact's torque; damping and mass are ``damping`` and ``armature`` of
the slide; a lag is ``filterexact`` of the actuator. A linkage, its mass and its play are a body of
its own and a tendon with stiffness or limits; a detent is half a wave of a cosine, 1 mm wide.
Friction of the dogs is set each step by the slip; spring and damper of the contact follow from
restitution and depth of a blow. One dog higher is a second dog that reaches farther. Force, delay,
angles, mismatch, ripple and stages are signals and initial values. Euler's rule: implicit ones
leave out what couples two bodies.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.optimize import brentq

from dogshape.validation.blind.stand import Point, Stand, Truth

Reference = tuple[float, float]  #: stiffness and damping over mass, negative as MuJoCo wants them

STEP = 2e-5  #: s, in contact
MAX_DAMPING_RATE = 0.5 / STEP  #: 1/s, at which a contact takes away a normal speed
DAMPING_RATIOS = (0.05, 12.0)  #: restitution from 0.86 to 0.002
IMPEDANCE = 1e-3  #: of contacts
FRICTION_SOFTNESS = 0.1  #: of held friction over A; 0.1 and 1 give the same times
OVERHANG = 1e-3  #: m by which the sliding dog reaches beyond the output ring
FORK_SHARE = 0.15  #: of the ring's mass on the actuator's side of a linkage
LINKAGE_DAMPING = 0.2  #: of the critical one
STOP: Reference = (-1e6, -4e3)  #: of the stop behind the start of the ring
STOP_RATE = 6e3  #: rad/s of a ring between the stops of its play
FLIGHT_STEP = 1e-4  #: s, the longest step that keeps joints and stops stable


def dog_corners(stand: Stand, chamfer: float, reach: float = 0.0) -> np.ndarray:
    """Compute the corners of a dog, its ends moved out by ``reach`` (m), m, (8, 3).

    A flank goes through the radial line at a quarter of the pitch half way up and leans inwards;
    the face falls by the chamfer (rad) from the crest, the top edge of the traction flank.
    """
    half_height = 0.5 * stand.height
    quarter = 0.25 * stand.pitch
    axis = np.array([0.0, 0.0, 1.0])
    leans = {1: stand.traction, -1: stand.braking}
    radial = {}
    outwards = {}
    rise = {}
    for side, lean in leans.items():
        radial[side] = np.array([math.cos(quarter), side * math.sin(quarter), 0.0])
        outwards[side] = np.array([-math.sin(quarter), side * math.cos(quarter), 0.0])
        rise[side] = axis - math.tan(lean) * outwards[side]
    normal = math.cos(chamfer) * axis - math.sin(chamfer) * outwards[1]
    level = normal @ (half_height * rise[1])
    points = []
    for side in leans:
        for radius in (stand.inner_radius - reach, stand.outer_radius + reach):
            foot = radius * radial[side]
            top = (level - normal @ foot) / (normal @ rise[side])
            points.append(foot - half_height * rise[side])
            points.append(foot + top * rise[side])
    return np.array(points)


def restitution(approach: float) -> float:
    r"""Compute Hunt and Crossley's restitution e for ``approach`` = d v.

    Their law gives :math:`a (1 + e) = \ln((1 + a)/(1 - a e))` with a = d v.
    """
    a = approach
    if a < 1e-3:
        return 1.0 - 2.0 * a / 3.0
    upper_bound = min(1.0, 1.0 / a) * (1.0 - 1e-12)

    def residual(e: float) -> float:
        return a * (1.0 + e) - math.log1p(a) + math.log1p(-a * e)

    if residual(upper_bound) < 0.0:
        return float(brentq(residual, 0.0, upper_bound))
    return upper_bound


def restitution_of(damping_ratio: float) -> float:
    """Compute the restitution of a spring and damper that cannot pull."""
    z = damping_ratio
    root = math.sqrt(abs(1.0 - z * z))
    if root < 1e-6:
        return math.exp(-2.0)
    if z < 1.0:
        return math.exp(-z / root * (math.pi - math.atan2(2.0 * z * root, 1.0 - 2.0 * z * z)))
    return math.exp(-z / root * math.log((z + root) / (z - root)))


def ratio_of(restitution: float, bounds: tuple[float, float]) -> float:
    """Compute the damping ratio of a restitution, clipped to ``bounds``."""
    if restitution >= restitution_of(bounds[0]):
        return bounds[0]
    if restitution <= restitution_of(bounds[1]):
        return bounds[1]
    return float(brentq(lambda z: restitution_of(z) - restitution, *bounds))


def relative_depth(ratio: float) -> float:
    """Compute the depth of an impact over v/omega for a damping ratio."""
    z = ratio
    root = math.sqrt(abs(1.0 - ratio * ratio))
    if root < 1e-6:
        return math.exp(-1.0)
    inverse = math.atan(root / z) if z < 1.0 else math.atanh(root / z)
    return math.exp(-z / root * inverse)


def contact_references(stand: Stand, truth: Truth, point: Point) -> tuple[Reference, Reference]:
    """Compute ``solref`` of the dogs at an operating point: on a flank, and face on face.

    A flank is hit half way down with mismatch and axial speed; its effective mass is that of ring
    and inertias. A face is hit at the end of the gap by the ring alone.
    """
    lean = stand.traction if point.mismatch >= 0.0 else stand.braking
    mass = stand.mass + truth.added_mass
    sliding_inertia = truth.inertia_factor * stand.sliding_inertia
    turning = stand.radius**2 * (1.0 / sliding_inertia + 1.0 / stand.output_inertia)
    flank_mass = 1.0 / (math.cos(lean) ** 2 * turning + math.sin(lean) ** 2 / mass)
    tangential_speed = abs(point.mismatch) * stand.radius
    gap = stand.gap + truth.gap_offset
    axial_speed = _axial_speed(truth, point, gap + 0.5 * stand.height, mass)
    flank_speed = math.cos(lean) * tangential_speed + math.sin(lean) * axial_speed
    face_speed = _axial_speed(truth, point, gap, mass)
    return (
        _reference(stand, truth, flank_mass, flank_speed),
        _reference(stand, truth, mass, face_speed),
    )


def _reference(stand: Stand, truth: Truth, mass: float, speed: float) -> Reference:
    r"""Compute the spring and damper equivalent to the contact for a mass, kg, at a speed, m/s.

    The contact of the stand presses with k A x (1 + d v). From that follow the restitution and
    the depth of an impact, :math:`x^2 = 2 m (dv - \ln(1 + dv))/(k A d^2)`.
    """
    area = (stand.outer_radius - stand.inner_radius) * 0.5 * stand.height * stand.count
    approach = truth.dissipation * speed
    depth = 2.0 * mass * (approach - math.log1p(approach)) / (truth.stiffness * area)
    depth = math.sqrt(depth) / truth.dissipation
    ratio = ratio_of(restitution(approach), DAMPING_RATIOS)
    rate = speed * relative_depth(ratio) / depth
    # Where the step limits the damping, the speed of release stays.
    damping = min(2.0 * ratio * rate, MAX_DAMPING_RATE)
    return -damping * min(rate / (2.0 * ratio), 0.25 / STEP), -damping


def _axial_speed(truth: Truth, point: Point, displacement: float, mass: float) -> float:
    """Estimate the speed of the free ring of a mass (kg) after a displacement (m), m/s."""
    force = max(1.0, point.force - truth.friction)
    # A force that rises as t^2 at first moves the ring by F t^4 / (4 m T^2).
    time = (4.0 * max(displacement, 1e-5) * mass * point.rise**2 / force) ** 0.25
    return float(3.6 * displacement / time)


def model_text(
    stand: Stand,
    truth: Truth,
    step: float = STEP,
    stop: Reference = STOP,
    shapes: tuple[np.ndarray, np.ndarray] | None = None,
) -> str:
    """Write the model as MJCF for a ``step`` in contact, s.

    ``stop`` is the ``solref`` of the stop behind the ring. ``shapes`` are the corners (8, 3) of a
    dog and of an overhanging dog, m, by default those of ``dog_corners``. Friction and ``solref``
    of the dogs are set later, for an operating point.
    """
    if shapes is None:
        chamfer = stand.chamfer + truth.chamfer_offset
        shapes = dog_corners(stand, chamfer), dog_corners(stand, chamfer, OVERHANG)
    meshes = _mesh("dog", shapes[0]) + _mesh("long", shapes[1])
    dogs = ["low", "high"] if truth.high_dog else ["low"]
    pairs = "".join(
        f'<pair geom1="{name}" geom2="output_{k}" condim="3" friction="0.1 0.1" '
        f'solimp="{IMPEDANCE} {IMPEDANCE} 0.001" solref="-1 -1" '
        f'solreffriction="0 {-1.5 * IMPEDANCE / step}"/>'
        for name in dogs
        for k in range(stand.count)
    )
    actuator, tendon = _linkage(stand, truth)
    lag = f'dyntype="filterexact" dynprm="{truth.lag}"' if truth.lag else ""
    impedance_ratio = 1.0 / (IMPEDANCE * FRICTION_SOFTNESS)
    return f"""<mujoco>
<compiler angle="radian"/>
<option timestep="{step}" gravity="0 0 0" cone="elliptic" impratio="{impedance_ratio}"
 solver="Newton" jacobian="dense" tolerance="1e-12" ccd_tolerance="1e-9" integrator="Euler">
 <flag refsafe="disable" multiccd="disable" island="disable" diagexact="enable"/>
</option>
<asset>{meshes}</asset>
<worldbody>{_output(stand)}{_sliding(stand, truth, dogs, stop)}{actuator}
</worldbody>
<contact>{pairs}</contact>{tendon}
<actuator><general joint="{"actuator" if truth.linkage else "shift"}" {lag}/></actuator>
</mujoco>"""


def _mesh(name: str, points: np.ndarray) -> str:
    """Write a mesh asset of corners (n, 3), m."""
    vertices = " ".join(f"{coordinate:.12g}" for coordinate in points.ravel())
    return f'<mesh name="{name}" vertex="{vertices}"/>'


def _output(stand: Stand) -> str:
    """Write the output ring."""
    geoms = "".join(
        f'<geom name="output_{k}" type="mesh" mesh="dog" contype="0" conaffinity="0" '
        f'euler="0 0 {k * stand.pitch:.15g}"/>'
        for k in range(stand.count)
    )
    joint = '<joint name="output" type="hinge" axis="0 0 1"/>'
    return f"<body>{_inertial(1.0, stand.output_inertia)}{joint}{geoms}</body>"


def _sliding(stand: Stand, truth: Truth, dogs: list[str], stop: Reference) -> str:
    """Write the sliding ring with the named dogs, ``low`` and ``high``."""
    travel = stand.gap + truth.gap_offset + stand.height
    mass = stand.mass * (1.0 - FORK_SHARE) if truth.linkage else stand.mass
    armature = 0.0 if truth.linkage else truth.added_mass
    friction = f'solreffriction="0 {-0.5 / FLIGHT_STEP}" solimpfriction="0.9999 0.9999 0.001"'
    limit = f'solreflimit="{stop[0]} {stop[1]}" solimplimit="0.999 0.999 0.001"'
    geoms = _sliding_dog("low", height=0.0, angle=0.0)
    if "high" in dogs:
        angle = stand.count // 2 * stand.pitch
        geoms += _sliding_dog("high", height=truth.high_dog, angle=angle)
    return (
        f'<body pos="0 0 {travel:.15g}">'
        f"{_inertial(mass, truth.inertia_factor * stand.sliding_inertia)}"
        f'<joint name="shift" type="slide" axis="0 0 -1" limited="true" range="{-stand.rebound} 1" '
        f'armature="{armature}" damping="{truth.damping}" frictionloss="{truth.friction}" '
        f"{limit} {friction}/>"
        f'<joint name="sliding" type="hinge" axis="0 0 1" frictionloss="{truth.drag_torque}" '
        f"{friction}/>{geoms}</body>"
    )


def _sliding_dog(name: str, height: float, angle: float) -> str:
    """Write a dog of the sliding ring, raised by a height, m, at an angle about the axis, rad."""
    # A turn by pi about x, and then by the angle about z.
    turn = f"0 {math.cos(0.5 * angle):.15g} {math.sin(0.5 * angle):.15g} 0"
    return (
        f'<geom name="{name}" type="mesh" mesh="long" contype="0" conaffinity="0" '
        f'pos="0 0 {-height:.15g}" quat="{turn}"/>'
    )


def _linkage(stand: Stand, truth: Truth) -> tuple[str, str]:
    """Write the actuator, and its tendon to the ring: a spring, or two stops with free play."""
    if not truth.linkage:
        return "", ""
    ring_mass = stand.mass * (1.0 - FORK_SHARE)
    actuator_mass = stand.mass * FORK_SHARE + truth.added_mass
    if truth.free_play:
        stop = f"{-(STOP_RATE**2)} {-2.0 * LINKAGE_DAMPING * STOP_RATE}"
        coupling = (
            f'limited="true" range="0 {truth.free_play}" solreflimit="{stop}" '
            'solimplimit="0.999 0.999 0.001"'
        )
    else:
        stiffness = 1.0 / truth.compliance
        total_mass = ring_mass + actuator_mass
        damping = (
            2.0 * LINKAGE_DAMPING * math.sqrt(stiffness * ring_mass * actuator_mass / total_mass)
        )
        coupling = f'stiffness="{stiffness}" damping="{damping}" springlength="0"'
    joint = '<joint name="actuator" type="slide" axis="0 0 -1"/>'
    joints = '<joint joint="actuator" coef="1"/><joint joint="shift" coef="-1"/>'
    tendon = f'<tendon><fixed name="link" {coupling}>{joints}</fixed></tendon>'
    return f"<body>{_inertial(actuator_mass, 1.0)}{joint}</body>", tendon


def _inertial(mass: float, polar: float) -> str:
    """Write the inertia of a body, kg and kg m2; only mass and polar inertia act."""
    return f'<inertial pos="0 0 0" mass="{mass:.15g}" diaginertia="{polar} {polar} {polar}"/>'
