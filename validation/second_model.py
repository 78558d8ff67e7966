r"""The clutch as a MuJoCo model, and the contact law it is given.

Frame and joints are the project's. One convex dog of the sliding ring, with a share 1/N of mass,
inertia and force, meets every dog of the output ring and overhangs it. The direct format of contact
parameters gives each contact a spring and a damper for the very mass that it moves, :math:`A f =
\omega^2 |r| - c v`. Impedance 1e-3: near 1, a contact that slips is also pushed apart. Friction:
elliptic cone, dynamic coefficient; its damping times the step sets which slip of the step counts.
``multiccd`` off: of two crossing edges it takes a flank's normal. ``diagexact``: else *A* lacks the
turning inertia. Restitution of the law: :math:`e = \exp(-\zeta \varphi/\sqrt{1-\zeta^2})`,
:math:`\zeta = c/2\omega` (Schwager and Pöschel 2007), chosen for the speed at which a flank is hit.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from dogshape.sim.errors import InputError, refusal, require_between
from dogshape.sim.shift.clutch import Clutch, OperatingPoint
from dogshape.sim.shift.mesh import Vertices, corners, dog_planes, dog_solid
from dogshape.sim.units import MM
from dogshape.validation.blind.mujoco_model import ratio_of
from dogshape.validation.impact import restitution

IMPEDANCE = 1e-3  #: d above
SLIP_DAMPING = 1.5  #: damping of friction times the step
HOLD = 0.1  #: softness of held friction over A; 0.1 and 1 give the same times
OVERHANG = 1e-3  #: m by which the sliding dog reaches beyond the output ring
DAMPING_RATIOS = (0.15, 3.0)  #: restitution from 0.65 to 0.02


@dataclass(frozen=True)
class EngineSettings:
    """Settings of the steps of the second engine.

    ``time_step`` in s; ``damping`` in 1/s is the rate at which a contact takes away a
    normal speed, the inverse of the time that an impact lasts. The default is the
    cheapest for means, ``FINE`` follows single shifts.
    """

    time_step: float = 2e-5
    damping: float = 1.25e4

    def __post_init__(self) -> None:
        remedy = "correct the settings of the second engine"
        require_between("engine.time_step_s", self.time_step, 1e-7, 2e-4, remedy)
        # Two flanks at once damp nearly twice as much, and twice a step is not stable.
        require_between("engine.damping", self.damping, 1e2, 1.01 / self.time_step, remedy)


FINE = EngineSettings(time_step=4e-6, damping=2.5e4)


def require_one_coefficient(clutch: Clutch) -> None:
    """Raise InputError unless Coulomb friction with one coefficient stands for the contact."""
    contact = clutch.contact
    if contact.dynamic_friction < 0.75 * contact.static_friction:
        fall = f"falls from {contact.static_friction:g} to {contact.dynamic_friction:g}"
        raise InputError(
            f"friction of contact set '{contact.name}' {fall}, but the second engine knows one "
            "coefficient; use a set such as lubricated_steel, where the two are within a quarter."
        )
    rule_at = "contact.stiction_velocity_m_s"
    remedy = "use a set such as lubricated_steel, the second engine holds what friction can hold"
    require_between(rule_at, contact.stiction_velocity, 0.0, 5e-3, remedy)


def damping_ratio(clutch: Clutch, point: OperatingPoint) -> float:
    """Return the damping ratio whose restitution is that of the contact set at a flank hit.

    The dog arrives with the mismatch and, half way down, with its free speed. Friction
    changes the mass that the flank feels, which the engine leaves out of *A*.
    """
    dog, rings = clutch.dog, clutch.rings
    lean = dog.traction if point.mismatch >= 0.0 else dog.braking
    c, s, mu = math.cos(lean), math.sin(lean), clutch.contact.dynamic_friction
    half_way = point.profile.free_flight_time(dog.axial_gap + 0.5 * dog.height, rings.mass)
    axial = float(point.profile.free_speed(half_way, rings.mass))
    speed = c * abs(point.mismatch) * dog.mean_radius + s * axial
    turning = dog.mean_radius**2 / rings.reduced_inertia
    smooth = c * c * turning + s * s / rings.mass
    rough = c * (c + mu * s) * turning + s * (s - mu * c) / rings.mass
    felt = math.sqrt(smooth / max(rough, 0.25 * smooth))
    wanted = restitution(clutch.contact.dissipation * speed)
    ratio = ratio_of(wanted, DAMPING_RATIOS)
    return ratio if ratio in DAMPING_RATIOS else min(DAMPING_RATIOS[1], ratio * felt)


def solver_reference(settings: EngineSettings, ratio: float) -> tuple[float, float]:
    """Return stiffness (1/s2) and damping (1/s) over mass, negative as MuJoCo wants them."""
    frequency = min(settings.damping / (2.0 * ratio), 0.5 / settings.time_step)
    return -(frequency**2), -2.0 * ratio * frequency


def model_text(clutch: Clutch, settings: EngineSettings) -> str:
    """Return the model as MJCF; its ``solref`` is a stand-in for that of the operating point."""
    dog, rings, count = clutch.dog, clutch.rings, clutch.dog.count
    if dog.edge_radius > 0.0:
        rule = "the second engine has sharp edges (0 mm)"
        radius, remedy = dog.edge_radius / MM, "leave dog.edge_radius_mm out"
        raise InputError(refusal("dog.edge_radius_mm", radius, "mm", rule, remedy))
    step = settings.time_step
    long_dog = dog_planes(dog)
    for end in ("inner", "outer"):
        long_dog[end] = long_dog[end].moved(OVERHANG)
    output = "".join(
        f'<geom name="output_{k}" type="mesh" mesh="dog" contype="0" conaffinity="0" '
        f'euler="0 0 {k * dog.pitch_angle:.15g}"/>'
        for k in range(count)
    )
    friction = clutch.contact.dynamic_friction
    slip_damping = SLIP_DAMPING * IMPEDANCE / step
    contact = (
        f'condim="3" friction="{friction} {friction}" solimp="{IMPEDANCE} {IMPEDANCE} 0.001" '
        f'solref="-1 -1" solreffriction="0 {-slip_damping}"'
    )
    pairs = "".join(f'<pair geom1="dog" geom2="output_{k}" {contact}/>' for k in range(count))
    stop = f'solreflimit="{-0.01 / step**2} {-0.5 / step}" solimplimit="0.999 0.999 0.001"'
    return f"""<mujoco>
<compiler angle="radian"/>
<option timestep="{step}" gravity="0 0 0" cone="elliptic" impratio="{1.0 / (IMPEDANCE * HOLD)}"
 solver="Newton" jacobian="dense" tolerance="1e-12" ccd_tolerance="1e-9">
 <flag refsafe="disable" multiccd="disable" island="disable" diagexact="enable"/>
</option>
<asset>
 <mesh name="dog" vertex="{_numbers(dog_solid(dog).vertices)}"/>
 <mesh name="long_dog" vertex="{_numbers(corners(long_dog))}"/>
</asset>
<worldbody>
 <body name="output_ring">{_inertial(1.0, rings.output_inertia / count)}
  <joint name="output" type="hinge" axis="0 0 1"/>{output}
 </body>
 <body name="sliding_ring" pos="0 0 {dog.travel:.15g}">
  {_inertial(rings.mass / count, rings.sliding_inertia / count)}
  <joint name="shift" type="slide" axis="0 0 -1" limited="true"
   range="{-clutch.rebound:.15g} 1" {stop}/>
  <joint name="sliding" type="hinge" axis="0 0 1"/>
  <geom name="dog" type="mesh" mesh="long_dog" contype="0" conaffinity="0"
   euler="{math.pi:.15g} 0 0"/>
 </body>
</worldbody>
<contact>{pairs}</contact>
<actuator><motor joint="shift"/></actuator>
</mujoco>"""


def _numbers(vertices: Vertices) -> str:
    return " ".join(f"{value:.12g}" for value in vertices.ravel())


def _inertial(mass: float, polar: float) -> str:
    """Return the inertia of a body; only its mass and its polar inertia act."""
    return f'<inertial pos="0 0 0" mass="{mass:.15g}" diaginertia="{polar} {polar} {polar}"/>'
