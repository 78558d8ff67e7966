r"""MuJoCo model of the stand with its truth: a mechanism of MuJoCo for each effect.

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
SHARPEST = 0.5 / STEP  #: 1/s, highest rate at which a contact takes away a normal speed
DAMPING_RATIOS = (0.05, 12.0)  #: restitution from 0.86 to 0.002
IMPEDANCE = 1e-3  #: d above
HOLD = 0.1  #: softness of held friction over A; 0.1 and 1 give the same times
OVERHANG = 1e-3  #: m by which the sliding dog reaches beyond the output ring
FORK = 0.15  #: share of the ring's mass that stands on the actuator's side of a linkage
LINKAGE_DAMPING = 0.2  #: of the critical one
STOP: Reference = (-1e6, -4e3)  #: of the stop behind the start of the ring
STOP_RATE = 6e3  #: rad/s of a ring between the stops of its play
FLIGHT_STEP = 1e-4  #: s, the longest step that joints and stops must bear


def dog_corners(stand: Stand, chamfer: float, reach: float = 0.0) -> np.ndarray:
    """Return the eight corners (8, 3) of a dog in m, its ends moved out by ``reach``.

    A flank holds the radial line at a quarter of the pitch half way up and leans inwards; the
    face falls by the chamfer from the crest, the top edge of the traction flank.
    """
    half, quarter = 0.5 * stand.height, 0.25 * stand.pitch
    up = np.array([0.0, 0.0, 1.0])
    radii = (stand.inner_radius - reach, stand.outer_radius + reach)
    along = {s: np.array([math.cos(quarter), s * math.sin(quarter), 0.0]) for s in (1, -1)}
    out = {s: np.array([-math.sin(quarter), s * math.cos(quarter), 0.0]) for s in (1, -1)}
    rise = {1: up - math.tan(stand.traction) * out[1], -1: up - math.tan(stand.braking) * out[-1]}
    normal = math.cos(chamfer) * up - math.sin(chamfer) * out[1]
    level = normal @ (half * rise[1])
    points = []
    for side in (1, -1):
        for radius in radii:
            foot = radius * along[side]
            top = (level - normal @ foot) / (normal @ rise[side])
            points += [foot - half * rise[side], foot + top * rise[side]]
    return np.array(points)


def restitution(approach: float) -> float:
    r"""Return Hunt and Crossley's restitution e for ``approach`` = d v.

    Their law gives :math:`a (1 + e) = \ln((1 + a)/(1 - a e))` with a = d v.
    """
    a = approach
    if a < 1e-3:
        return 1.0 - 2.0 * a / 3.0
    highest = min(1.0, 1.0 / a) * (1.0 - 1e-12)

    def left(e: float) -> float:
        return a * (1.0 + e) - math.log1p(a) + math.log1p(-a * e)

    return float(brentq(left, 0.0, highest)) if left(highest) < 0.0 else highest


def restitution_of(damping_ratio: float) -> float:
    """Return the restitution of a spring and damper that cannot pull."""
    z = damping_ratio
    root = math.sqrt(abs(1.0 - z * z))
    if root < 1e-6:
        return math.exp(-2.0)
    if z < 1.0:
        return math.exp(-z / root * (math.pi - math.atan2(2.0 * z * root, 1.0 - 2.0 * z * z)))
    return math.exp(-z / root * math.log((z + root) / (z - root)))


def ratio_of(wanted: float, ends: tuple[float, float]) -> float:
    """Return the damping ratio of a restitution, within ``ends``."""
    if wanted >= restitution_of(ends[0]):
        return ends[0]
    if wanted <= restitution_of(ends[1]):
        return ends[1]
    return float(brentq(lambda z: restitution_of(z) - wanted, *ends))


def deepest(ratio: float) -> float:
    """Return the depth that a blow reaches, over speed times time (v/omega)."""
    z, root = ratio, math.sqrt(abs(1.0 - ratio * ratio))
    if root < 1e-6:
        return math.exp(-1.0)
    inverse = math.atan(root / z) if z < 1.0 else math.atanh(root / z)
    return math.exp(-z / root * inverse)


def contact_references(stand: Stand, truth: Truth, point: Point) -> tuple[Reference, Reference]:
    """Return ``solref`` of the dogs at an operating point: on a flank, and face on face.

    A flank is hit half way down, by mismatch and axial speed, by the mass that it feels; a face
    at the end of the gap by the ring alone.
    """
    lean = stand.traction if point.mismatch >= 0.0 else stand.braking
    mass = stand.mass + truth.added_mass
    sliding = truth.inertia_factor * stand.sliding_inertia
    turning = stand.radius**2 * (1.0 / sliding + 1.0 / stand.output_inertia)
    felt = 1.0 / (math.cos(lean) ** 2 * turning + math.sin(lean) ** 2 / mass)
    around = abs(point.mismatch) * stand.radius
    gap = stand.gap + truth.gap_offset
    axial = _axial_speed(truth, point, gap + 0.5 * stand.height, mass)
    hit = math.cos(lean) * around + math.sin(lean) * axial
    landing = _axial_speed(truth, point, gap, mass)
    return _reference(stand, truth, felt, hit), _reference(stand, truth, mass, landing)


def _reference(stand: Stand, truth: Truth, mass: float, speed: float) -> Reference:
    r"""Return spring and damper that stop a mass in kg, at a speed in m/s, as the contact does.

    The contact of the stand presses with k A x (1 + d v). From that follow the restitution and
    the depth of a blow, :math:`x^2 = 2 m (dv - \ln(1 + dv))/(k A d^2)`.
    """
    area = (stand.outer_radius - stand.inner_radius) * 0.5 * stand.height * stand.count
    approach = truth.dissipation * speed
    depth = 2.0 * mass * (approach - math.log1p(approach)) / (truth.stiffness * area)
    depth = math.sqrt(depth) / truth.dissipation
    ratio = ratio_of(restitution(approach), DAMPING_RATIOS)
    rate = speed * deepest(ratio) / depth
    # Beyond what the step bears the damping is less, and the speed of release stays.
    damping = min(2.0 * ratio * rate, SHARPEST)
    return -damping * min(rate / (2.0 * ratio), 0.25 / STEP), -damping


def _axial_speed(truth: Truth, point: Point, way: float, mass: float) -> float:
    """Return about the speed in m/s of the free ring after a way in m."""
    force = max(1.0, point.force - truth.friction)
    # A force that rises as t^2 at first makes F t^4 / (4 m T^2) of way.
    time = (4.0 * max(way, 1e-5) * mass * point.rise**2 / force) ** 0.25
    return float(3.6 * way / time)


def model_text(
    stand: Stand,
    truth: Truth,
    step: float = STEP,
    stop: Reference = STOP,
    shapes: tuple[np.ndarray, np.ndarray] | None = None,
) -> str:
    """Return the model as MJCF for a ``step`` in contact, s.

    ``shapes`` are the corners (8, 3) of a dog and of one that overhangs it, m, where they are not
    those of ``dog_corners``. Friction and ``solref`` of the dogs are set later, for an operating
    point.
    """
    chamfer = stand.chamfer + truth.chamfer_offset
    shapes = shapes or (dog_corners(stand, chamfer), dog_corners(stand, chamfer, OVERHANG))
    meshes = "".join(
        f'<mesh name="{name}" vertex="{" ".join(f"{x:.12g}" for x in points.ravel())}"/>'
        for name, points in zip(("dog", "long"), shapes, strict=True)
    )
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
    return f"""<mujoco>
<compiler angle="radian"/>
<option timestep="{step}" gravity="0 0 0" cone="elliptic" impratio="{1.0 / (IMPEDANCE * HOLD)}"
 solver="Newton" jacobian="dense" tolerance="1e-12" ccd_tolerance="1e-9" integrator="Euler">
 <flag refsafe="disable" multiccd="disable" island="disable" diagexact="enable"/>
</option>
<asset>{meshes}</asset>
<worldbody>{_output(stand)}{_sliding(stand, truth, dogs, stop)}{actuator}
</worldbody>
<contact>{pairs}</contact>{tendon}
<actuator><general joint="{"actuator" if truth.linkage else "shift"}" {lag}/></actuator>
</mujoco>"""


def _output(stand: Stand) -> str:
    geoms = "".join(
        f'<geom name="output_{k}" type="mesh" mesh="dog" contype="0" conaffinity="0" '
        f'euler="0 0 {k * stand.pitch:.15g}"/>'
        for k in range(stand.count)
    )
    joint = '<joint name="output" type="hinge" axis="0 0 1"/>'
    return f"<body>{_inertial(1.0, stand.output_inertia)}{joint}{geoms}</body>"


def _sliding(stand: Stand, truth: Truth, dogs: list[str], stop: Reference) -> str:
    travel = stand.gap + truth.gap_offset + stand.height
    mass = stand.mass * (1.0 - FORK) if truth.linkage else stand.mass
    armature = 0.0 if truth.linkage else truth.added_mass
    rub = f'solreffriction="0 {-0.5 / FLIGHT_STEP}" solimpfriction="0.9999 0.9999 0.001"'
    limit = f'solreflimit="{stop[0]} {stop[1]}" solimplimit="0.999 0.999 0.001"'
    # A turn by pi about x, and then by its place about z.
    places = {"low": (0.0, 0.0), "high": (truth.high_dog, stand.count // 2 * stand.pitch)}
    geoms = "".join(
        f'<geom name="{name}" type="mesh" mesh="long" contype="0" conaffinity="0" '
        f'pos="0 0 {-high:.15g}" quat="0 {math.cos(0.5 * at):.15g} {math.sin(0.5 * at):.15g} 0"/>'
        for name, (high, at) in places.items()
        if name in dogs
    )
    return (
        f'<body pos="0 0 {travel:.15g}">'
        f"{_inertial(mass, truth.inertia_factor * stand.sliding_inertia)}"
        f'<joint name="shift" type="slide" axis="0 0 -1" limited="true" range="{-stand.rebound} 1" '
        f'armature="{armature}" damping="{truth.damping}" frictionloss="{truth.friction}" '
        f"{limit} {rub}/>"
        f'<joint name="sliding" type="hinge" axis="0 0 1" frictionloss="{truth.drag_torque}" '
        f"{rub}/>{geoms}</body>"
    )


def _linkage(stand: Stand, truth: Truth) -> tuple[str, str]:
    """Write the actuator, and the tendon to the ring: a spring, or two stops a play apart."""
    if not truth.linkage:
        return "", ""
    near, far = stand.mass * (1.0 - FORK), stand.mass * FORK + truth.added_mass
    if truth.free_play:
        stop = f"{-(STOP_RATE**2)} {-2.0 * LINKAGE_DAMPING * STOP_RATE}"
        how = (
            f'limited="true" range="0 {truth.free_play}" solreflimit="{stop}" '
            'solimplimit="0.999 0.999 0.001"'
        )
    else:
        stiffness = 1.0 / truth.compliance
        damping = 2.0 * LINKAGE_DAMPING * math.sqrt(stiffness * near * far / (near + far))
        how = f'stiffness="{stiffness}" damping="{damping}" springlength="0"'
    joint = '<joint name="actuator" type="slide" axis="0 0 -1"/>'
    joints = '<joint joint="actuator" coef="1"/><joint joint="shift" coef="-1"/>'
    tendon = f'<tendon><fixed name="link" {how}>{joints}</fixed></tendon>'
    return f"<body>{_inertial(far, 1.0)}{joint}</body>", tendon


def _inertial(mass: float, polar: float) -> str:
    """Return the inertia of a body; only its mass and its polar inertia act."""
    return f'<inertial pos="0 0 0" mass="{mass:.15g}" diaginertia="{polar} {polar} {polar}"/>'
