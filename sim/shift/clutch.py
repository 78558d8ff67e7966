"""The clutch as data: both rings, the contact and the solver that moves them."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from types import SimpleNamespace

import numpy as np

from dogshape.sim.errors import InputError, Refusal, require_between, require_known, require_parts
from dogshape.sim.kernel_layout import (
    CLUTCH_NUMBERS,
    LINKED_STATE_SIZE,
    RIGID_STATE_SIZE,
    SHAFTED_STATE_SIZE,
    STATE_SIZE,
    filled_record,
)
from dogshape.sim.quantity import quantities_of, quantity, record_quantities, require_ranges
from dogshape.sim.shift.actuation import ForceProfile
from dogshape.sim.shift.actuators import Actuator
from dogshape.sim.shift.drive import NO_DRIVE, Drive, EngineSide
from dogshape.sim.shift.geometry import Dog
from dogshape.sim.shift.mechanism import (
    NO_MECHANISM,
    SMOOTH_SPEED_M_S,
    SMOOTH_TURN_RAD_S,
    STOP_DEPTH_M,
    STOP_TWIST_RAD,
    Mechanism,
    Shaft,
    shaft_of,
)
from dogshape.sim.shift.pair import ALIKE, OutputDog, Pair, dog_pair
from dogshape.sim.units import RPM, unit_of


@dataclass(frozen=True)
class ImpactLaw:
    """Laws of Adams for a whole dog: IMPACT along the normal, and where friction is dynamic.

    ``F = K d^1.5 + C s(d / depth) d'`` with the largest depth *d* and the cubic step *s*. Friction
    is a step from minus to plus the static coefficient over twice the stiction velocity, and falls
    by another to the dynamic one at the transition velocity. The defaults are the thesis' (tables 7
    and 8), its ``K = 1e8 N/m`` read in SI units.
    """

    stiffness: float = quantity("impact_stiffness_N_m1_5", 1e5, 1e13, 1e8)  #: K, N/m^1.5
    damping: float = quantity("impact_damping_Ns_m", 0.0, 1e7, 1e4)  #: C, N s/m
    depth: float = quantity("impact_depth_mm", 1e-5, 1.0, 1e-5)  #: where damping is full, m
    transition_velocity: float = quantity("transition_velocity_m_s", 1e-4, 1e2, 1.0)  #: slip, m/s

    def __post_init__(self) -> None:
        require_ranges(self, "contact", "correct the law")


#: Fields that a set with IMPACT must have: the stiffness is that of the stop behind the ring.
IMPACT_LAYER = (("stiffness", 5e11), ("dissipation", 0.0))


@dataclass(frozen=True)
class ContactSet:
    """Parameters of the dog contact.

    A compliant layer (pressure = stiffness x penetration, Drake's hydroelastic model), Hunt and
    Crossley's dissipation ``p (1 + d v)``, Coulomb friction regularised over a stiction velocity.
    With ``impact`` the law IMPACT replaces layer and dissipation of the dogs; the stiffness is then
    that of the stop behind the ring. With ``face_friction`` faces on faces have this coefficient,
    static and dynamic, and the two others are those of flanks and edges. Both are in the compiled
    engine alone.
    """

    name: str
    static_friction: float = quantity("static_friction", 0.0, 1.5)
    dynamic_friction: float = quantity("dynamic_friction", 0.0, 1.5)
    stiction_velocity: float = quantity("stiction_velocity_m_s", 1e-5, 1.0)  #: slip, m/s
    stiffness: float = quantity("stiffness_Pa_m", 1e10, 1e16)  #: pressure per penetration, Pa/m
    dissipation: float = quantity("dissipation_s_m", 0.0, 1e4)  #: s/m
    impact: ImpactLaw | None = None
    #: of faces on faces, such as an oil film's; None: that of flanks and edges
    face_friction: float | None = quantity("face_friction", 0.0, 1.5, None, late=True)

    def __post_init__(self) -> None:
        require_ranges(self, "contact", "correct the contact set")
        if self.impact is not None and self.face_friction is not None:
            rule = "the law IMPACT acts on a whole dog, without a friction of its faces"
            remedy = 'leave it out, or take contact.set = "lubricated_steel"'
            raise InputError(Refusal("contact.face_friction", self.face_friction, "", rule, remedy))
        if self.dynamic_friction > self.static_friction:
            rule = f"it must not exceed contact.static_friction = {self.static_friction:.6g}"
            remedy = "exchange or correct the two coefficients"
            message = Refusal("contact.dynamic_friction", self.dynamic_friction, "", rule, remedy)
            raise InputError(message)
        if self.impact is not None:
            self._require_impact_layer(self.impact)

    def _require_impact_layer(self, impact: ImpactLaw) -> None:
        """Raise InputError for another layer, or a friction that does not fall, beside IMPACT."""
        for name, layer_value in IMPACT_LAYER:
            value = getattr(self, name)
            if value != layer_value:
                key = quantities_of(ContactSet)[name].key
                rule = "the set has the law IMPACT, which has its own stiffness and damping"
                remedy = 'leave it out, or take contact.set = "adams2019"'
                raise InputError(Refusal(f"contact.{key}", value, unit_of(key), rule, remedy))
        end = impact.transition_velocity
        if self.stiction_velocity >= end:
            name = "contact.stiction_velocity_m_s"
            rule = f"friction is dynamic from {end:g} m/s on"
            raise InputError(Refusal(name, self.stiction_velocity, "m/s", rule, "take a lower one"))

    @property
    def record(self) -> dict[str, float]:
        """Numbers of the contact by their keys in the edge's units."""
        return {key: value for key, value in record_quantities(self).items() if value is not None}

    @property
    def compiled_only(self) -> bool:
        """Whether Drake has no law for it: IMPACT, or a friction of faces."""
        return self.impact is not None or self.face_friction is not None

    @property
    def face_dynamic_friction(self) -> float:
        """Dynamic friction of faces on faces."""
        return self.dynamic_friction if self.face_friction is None else self.face_friction

    def scaled(self, friction: float, dissipation: float) -> ContactSet:
        """Multiply all coefficients of friction, and the dissipation, by factors."""
        face = self.face_friction
        return replace(
            self,
            static_friction=self.static_friction * friction,
            dynamic_friction=self.dynamic_friction * friction,
            face_friction=None if face is None else face * friction,
            dissipation=self.dissipation * dissipation,
        )


#: ``adams2019``: the published model (thesis tables 7 and 8), for comparison; its stiction velocity
#: lets a face creep. Its IMPACT with a damper of 1e4 N s/m stops a dog's share of the ring within
#: 3.3 um at a restitution of 0.05, as this law does (``tests/verification/test_impact.py``).
#: ``adams_impact``: the same tables with the laws that they belong to.
#: ``lubricated_steel``: oiled hardened steel, for design. c' = 14 N/(mm um) (ISO 6336-1, method C)
#: over 3.1 mm of flank is 4.5e12 Pa/m; 20 s/m leave a restitution of 0.24 at 0.2 m/s (assumption).
CONTACT_SETS: dict[str, ContactSet] = {
    "adams2019": ContactSet("adams2019", 0.30, 0.16, 0.1, 5e11, 100.0),
    "adams_impact": ContactSet("adams_impact", 0.30, 0.16, 0.1, 5e11, 0.0, ImpactLaw()),
    "lubricated_steel": ContactSet("lubricated_steel", 0.12, 0.10, 2e-4, 5e12, 20.0),
}


def contact_set(name: str) -> ContactSet:
    """Look up a contact set by name; InputError for an unknown one."""
    require_known("contact.set", name, "a contact set", CONTACT_SETS)
    return CONTACT_SETS[name]


@dataclass(frozen=True)
class Rings:
    """Masses that move: sliding ring (kg, kg m2) and output ring (kg m2)."""

    mass: float = quantity("sliding.mass_kg", 1e-3, 1e3)
    sliding_inertia: float = quantity("sliding.inertia_kgm2", 1e-6, 100.0)
    output_inertia: float = quantity("output.inertia_kgm2", 1e-6, 1e4)

    def __post_init__(self) -> None:
        require_ranges(self, "", "check the value and its unit")

    @property
    def reduced_inertia(self) -> float:
        """Inertia of the relative motion ``J1 J2 / (J1 + J2)``, kg m2."""
        total = self.sliding_inertia + self.output_inertia
        return self.sliding_inertia * self.output_inertia / total


ENGINES = ("drake", "planar")
PLANAR_ACCURACY = 1e-4  #: of the compiled engine, m/s
#: Schemes with the accuracy that each needs.
SCHEMES = {"runge_kutta3": 3e-4, "cenic": 1e-7}
CENIC_WITH_FORCES = 1e-9  #: where mechanism or drive have forces, taken from the start of a step
MAX_STEPS = 400_000  #: steps of a shift where the study gives no other number


@dataclass(frozen=True)
class Solver:
    """Engine, scheme, accuracy and limits of the integration.

    ``runge_kutta3`` is the reference: sliding contact limits its step by stability, and at 3e-4
    shifts agree with 1e-5 within 0.1 % (``make evidence``). ``cenic`` is needed where static and
    dynamic friction differ much; it wants 1e-7 (position error of a step in m and rad), and 1e-9
    with forces of a mechanism (``docs/simulation.md``). The compiled engine takes from the scheme
    the friction law alone, and ``accuracy`` is the error of a step in m/s.

    A shift that takes more than ``max_steps``, or more than ``time_limit`` in s, has diverged; the
    first stands far below the second and is the same on every machine.
    """

    scheme: str = "runge_kutta3"
    accuracy: float = quantity("accuracy", 1e-10, 0.1, 3e-4)
    max_step: float = quantity("max_step_s", 1e-6, 0.01, 1e-3)
    all_dogs: bool = False
    max_steps: int = quantity("max_steps", 10, 1e8, MAX_STEPS, late=True)
    time_limit: float = quantity("time_limit_s", 0.01, 86_400.0, 600.0, late=True)
    engine: str = "drake"

    def __post_init__(self) -> None:
        require_known("solver.engine", self.engine, "an engine", ENGINES)
        require_known("solver.scheme", self.scheme, "a scheme", SCHEMES)
        require_ranges(self, "solver", "correct the solver settings")


#: Dynamic over static friction, from which on the dynamic one stands for both.
MIN_FRICTION_RATIO = 0.75
#: Stiction velocity from which slip of a tooth-to-tooth contact lies in its ramp.
SLOW_STICTION_M_S = 1e-3


def require_engine(contact: ContactSet, engine: str) -> None:
    """Raise InputError where an engine has no law of a contact set."""
    if contact.impact is not None and engine == "drake":
        raise InputError(
            f"solver.engine is 'drake', but contact set '{contact.name}' has the law IMPACT for a "
            'whole dog, which Drake has not; take solver.engine = "planar", or contact.set = '
            '"adams2019"'
        )
    if contact.face_friction is not None and engine == "drake":
        rule = "solver.engine is 'drake', whose dogs have one friction for faces and flanks"
        remedy = 'take solver.engine = "planar", or leave contact.face_friction out'
        raise InputError(Refusal("contact.face_friction", contact.face_friction, "", rule, remedy))


def solver_for(
    contact: ContactSet,
    mechanism: Mechanism = NO_MECHANISM,
    drive: Drive = NO_DRIVE,
    actuator: Actuator | None = None,
) -> Solver:
    """Choose the solver for a contact set, with its accuracy for mechanism, drive and actuator.

    The explicit scheme knows the dynamic coefficient alone, that of slip above ten stiction
    velocities. Where the two differ by more than a quarter (0.30 and 0.16), or dogs slip more
    slowly, the static one decides whether a flank holds.
    """
    falls = contact.dynamic_friction < MIN_FRICTION_RATIO * contact.static_friction
    creeps = contact.stiction_velocity > SLOW_STICTION_M_S
    scheme = "cenic" if falls or creeps else "runge_kutta3"
    forced = mechanism.has_forces or drive.has_torques or actuator is not None
    return Solver(scheme, accuracy_of(scheme, forced=forced))


def accuracy_of(scheme: str, *, forced: bool) -> float:
    """Look up the accuracy of Drake's scheme, with forces of a mechanism or without."""
    return CENIC_WITH_FORCES if scheme == "cenic" and forced else SCHEMES[scheme]


@dataclass(frozen=True)
class Clutch:
    """Everything about a shift except how it is operated."""

    dog: Dog
    rings: Rings
    contact: ContactSet
    solver: Solver
    timeout: float = 1.0  #: s
    seated_tolerance: float = 5e-5  #: how far from full travel a shift counts as done, m
    #: how far behind its start the sliding ring can be thrown before it meets a stop, m: as far as
    #: the dogs stand ahead, there the neighbouring gear begins
    rebound: float = 1e-3
    mechanism: Mechanism = NO_MECHANISM
    drive: Drive = NO_DRIVE  #: speed of the shafts and torques on them
    actuator: Actuator | None = None  #: None: the shift force is that over time of the point
    output_dog: OutputDog = ALIKE  #: dimensions in which the output ring's dog differs from ``dog``

    def __post_init__(self) -> None:
        remedy = "give what turns with the dogs alone"
        require_parts("mechanism", self.mechanism, self.rings, remedy, is_smaller=True)

    @property
    def shift_travel(self) -> float:
        """Travel at which a shift counts as finished, m."""
        return self.pair.travel - self.seated_tolerance

    @cached_property
    def pair(self) -> Pair:
        """Dogs of sliding and output ring."""
        return dog_pair(self.dog, self.output_dog)

    @property
    def shafts(self) -> tuple[Shaft, Shaft]:
        """Shafts behind sliding and output ring."""
        mechanism = self.mechanism
        input_shaft = shaft_of(
            mechanism.ring_inertia,
            self.rings.sliding_inertia,
            mechanism.input_stiffness,
            backlash=mechanism.backlash,
        )
        output_shaft = shaft_of(
            mechanism.wheel_inertia, self.rings.output_inertia, mechanism.output_stiffness
        )
        return input_shaft, output_shaft

    @property
    def has_forces(self) -> bool:
        """Whether forces beside the shift force and the contact act."""
        has_law = self.actuator is not None
        return self.mechanism.has_forces or self.drive.has_torques or has_law

    @cached_property
    def numbers(self) -> np.record:
        """Masses, mechanism, drive, stop and faces, a record of ``sim.kernel_layout``."""
        numbers = SimpleNamespace()
        self._set_masses(numbers)
        self._set_resistance(numbers)
        self._set_linkage(numbers)
        self._set_shafts(numbers)
        self._set_dogs(numbers)
        self._set_drive(numbers)
        return filled_record(CLUTCH_NUMBERS, vars(numbers))

    def shift_numbers(self, profile: ForceProfile) -> np.record:
        """Return the numbers of a shift: those of the clutch, with the command of its actuator."""
        if self.actuator is None:
            return self.numbers
        numbers = self.numbers.copy()
        mechanism = self.mechanism
        fork_mass = mechanism.actuator_mass(self.rings.mass)
        driven_mass = fork_mass or mechanism.sleeve_mass(self.rings.mass)
        self.actuator.write(numbers.actuator, profile, driven_mass)
        return numbers

    def _set_masses(self, numbers: SimpleNamespace) -> None:
        """Write masses, inertias, and the size of the state that moves."""
        mechanism = self.mechanism
        input_shaft, output_shaft = self.shafts
        numbers.sleeve_mass = mechanism.sleeve_mass(self.rings.mass)
        # Without a linkage nothing has this mass; 1 keeps the record free of a division by 0.
        numbers.actuator_mass = mechanism.actuator_mass(self.rings.mass) or 1.0
        numbers.sliding_inertia = input_shaft.ring_inertia
        numbers.input_side_inertia = input_shaft.side_inertia
        numbers.output_inertia = output_shaft.ring_inertia
        numbers.output_side_inertia = output_shaft.side_inertia
        numbers.state_size = self._state_size

    @property
    def _state_size(self) -> int:
        """Number of columns of ``sim.kernel_layout`` that move; each includes those before it."""
        if self.actuator is not None:
            return STATE_SIZE
        if any(shaft.side_inertia for shaft in self.shafts):
            return SHAFTED_STATE_SIZE
        return LINKED_STATE_SIZE if self.mechanism.has_linkage else RIGID_STATE_SIZE

    def _set_resistance(self, numbers: SimpleNamespace) -> None:
        """Write damping, friction, drag, detent and the stop behind the ring."""
        dog = self.dog
        mechanism = self.mechanism
        numbers.damping = mechanism.damping
        numbers.friction = mechanism.friction
        spline_share = self._spline_share
        spline_friction = spline_share * mechanism.spline_friction / mechanism.spline_radius
        numbers.spline_force_per_torque = spline_friction
        if spline_share > 0.0:
            numbers.spline_inertia_ratio = (1.0 - spline_share) / spline_share
        numbers.drag_torque = mechanism.drag_torque
        numbers.smooth_speed = SMOOTH_SPEED_M_S
        numbers.smooth_turn = SMOOTH_TURN_RAD_S
        numbers.detent = mechanism.detent
        numbers.detent_position = mechanism.detent_position
        numbers.detent_seat = mechanism.detent_seat or math.inf
        numbers.detent_width = mechanism.detent_width
        numbers.rebound = self.rebound
        count = self.pair.touching_count
        face_stiffness = self.contact.stiffness * count * dog.tip_width * dog.radial_width
        numbers.rebound_stiffness = face_stiffness

    @property
    def _spline_share(self) -> float:
        """Share of the contact's torque that goes through the spline, 1 with a shaft."""
        input_shaft, _ = self.shafts
        if input_shaft.side_inertia:
            return 1.0
        return self.mechanism.spline_share(
            self.rings.mass, self.dog.mean_radius, input_shaft.ring_inertia
        )

    def _set_linkage(self, numbers: SimpleNamespace) -> None:
        """Write stiffness, damping and play of the linkage."""
        mechanism = self.mechanism
        numbers.has_linkage = mechanism.has_linkage
        if mechanism.has_linkage:
            stiffness, damping = mechanism.linkage(self.rings.mass)
            numbers.linkage_stiffness = stiffness
            numbers.linkage_damping = damping
        numbers.free_play = mechanism.free_play
        numbers.stop_depth = STOP_DEPTH_M

    def _set_shafts(self, numbers: SimpleNamespace) -> None:
        """Write stiffness, damping and play of the shafts behind the rings."""
        input_shaft, output_shaft = self.shafts
        numbers.input_stiffness = input_shaft.stiffness
        numbers.input_damping = input_shaft.damping
        numbers.spline_backlash = input_shaft.backlash
        numbers.stop_twist = STOP_TWIST_RAD
        numbers.output_stiffness = output_shaft.stiffness
        numbers.output_damping = output_shaft.damping

    def _set_dogs(self, numbers: SimpleNamespace) -> None:
        """Write count, pitch, faces and travel of the dogs."""
        dog = self.dog
        pair = self.pair
        faces = pair.faces
        backs = pair.backs
        numbers.dog_count = pair.touching_count
        numbers.low_dog_count = pair.low_count
        numbers.mean_radius = dog.mean_radius
        numbers.pitch_angle = dog.pitch_angle
        numbers.axial_gap = dog.axial_gap
        numbers.height = pair.depth
        numbers.radial_width = dog.radial_width
        numbers.shift_travel = self.shift_travel
        numbers.crest_overlap = pair.crest_overlap
        numbers.face_reach = faces.reach
        numbers.face_slope = faces.slope
        numbers.face_width = faces.flat_width
        numbers.face_slope_rise = faces.slope_rise
        numbers.back_reach = backs.reach
        numbers.back_slope = backs.slope
        numbers.back_width = backs.flat_width
        numbers.back_slope_rise = backs.slope_rise

    def _set_drive(self, numbers: SimpleNamespace) -> None:
        """Write synchroniser and pack; a run writes torques over time piece by piece."""
        drive = self.drive
        numbers.has_drive = drive.has_torques
        numbers.synchroniser_torque = drive.synchroniser
        numbers.pack_torque = drive.pack_torque
        numbers.pack_viscous = drive.pack_viscous
        numbers.pack_speed = drive.sense * drive.pack_speed
        numbers.pack_on_output = drive.engine_side == "output"

    def loaded(self, side: EngineSide, torque: float) -> Clutch:
        """Add a torque in N m on a side during the shift."""
        return replace(self, drive=self.drive.loaded(side, torque))

    def refined(self) -> Clutch:
        """Refine the solver: a thirtieth of the tolerance and half the longest step."""
        solver = self.solver
        accuracy = max(solver.accuracy / 30.0, 1e-10)
        max_step = max(0.5 * solver.max_step, 1e-6)
        return replace(self, solver=replace(solver, accuracy=accuracy, max_step=max_step))

    def with_engine(self, engine: str) -> Clutch:
        """Change the engine, with the accuracy that it needs."""
        solver = solver_for(self.contact, self.mechanism, self.drive, self.actuator)
        accuracy = PLANAR_ACCURACY if engine == "planar" else solver.accuracy
        return replace(self, solver=replace(self.solver, engine=engine, accuracy=accuracy))


@dataclass(frozen=True)
class OperatingPoint:
    """Mismatch and shift force, with a weight.

    The force of an actuator is its largest static one, which its command gives.
    A positive mismatch runs the traction flanks together, and opposing faces fall away from each
    other: the ring on the engine's side is the faster one, as before an upshift.
    """

    #: output less sliding speed about the axis from the output to the sliding ring, rad/s
    #: (``docs/scope.md``)
    mismatch: float
    profile: ForceProfile
    weight: float = 1.0

    def __post_init__(self) -> None:
        remedy = "give the mismatch speed in 1/min"
        require_between("mismatch_rpm", self.mismatch / RPM, -5000.0, 5000.0, remedy)
        require_between("weight", self.weight, 1e-12, 1e12, "correct the weight")
