r"""One shift of a stand with its truth, in MuJoCo, as the stand records it.

MuJoCo's semi-implicit Euler steps through the free flight coarsely and, from just before the crests
meet, with ``STEP``. Between steps three constants of MuJoCo are set: the coefficient of
friction by the last slip *v*, with :math:`z = v/v_s - 10`,

.. math:: \mu(v) = \left(\mu_d + \frac{\mu_s - \mu_d}{2} \Big(1 - \frac{z}{\sqrt{1+z^2}}\Big)
   \right) \frac{v}{\sqrt{v^2 + v_s^2}}

where the stand creeps as the published one (below ``HELD`` dogs are held); the friction of a spline
by the torque of the dogs; spring and damper of the contact, for faces or flanks.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from importlib import import_module
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dogshape.sim.errors import InputError
from dogshape.validation.blind.mujoco_model import FLIGHT_STEP, STEP, contact_references, model_text
from dogshape.validation.blind.stand import Point, Stand, Truth

Series = NDArray[np.float64]

HELD = 5e-3  #: stiction velocity below which dogs are held, m/s
STEPS_PER_SETTING = 2  #: between two settings of friction and force
COARSE_SHARE = 0.9  #: of the gap that is flown in coarse steps
REST_INTERVAL_S = 0.01  #: between two tests for rest
REST_TOLERANCE = 1e-7  #: change of a resting position between two tests, m or rad
FACE_NORMAL = 0.9  #: axial component of a normal above which faces touch
DETENT_WIDTH = 1e-3  #: m
STRIBECK_SPEED = 0.02  #: at which a friction at rest has fallen by a factor of e, m/s
SPLINE_RADIUS_RATIO = 0.8  #: radius of the spline over the inner radius of the dogs


@dataclass(frozen=True)
class Draw:
    """Values drawn for each shift.

    ``angle`` in rad between dogs at the start of the force, ``late`` in s how long the force
    waits, ``phase`` in rad of the ripple, ``progress`` the share of the series that is past.
    """

    angle: float
    late: float = 0.0
    phase: float = 0.0
    progress: float = 0.0


@dataclass(frozen=True)
class Shift:
    """Reading of the stand: a shift time and, if recorded, the motion."""

    time: float | None  #: s, None where the shift did not engage
    #: time, s; displacement of sensor and ring, m; angular velocity of sliding and output ring,
    #: rad/s; velocity of the ring, m/s; (n, 6)
    motion: Series | None = None


def load_mujoco() -> Any:
    """Import MuJoCo; InputError where it cannot be loaded."""
    try:
        import_module("mujoco.rollout")
        return import_module("mujoco")
    except ImportError as error:
        raise InputError(
            f"MuJoCo, the second physics engine, cannot be loaded ({error}); "
            "install it with: pip install -c constraints.txt '.[blind]'."
        ) from error


def engine_available() -> bool:
    """Test whether MuJoCo can be imported."""
    try:
        load_mujoco()
    except InputError:
        return False
    return True


def signal(truth: Truth, point: Point, time: float) -> float:
    """Compute the force at a time after its start, N: a cubic step to the force of a point.

    ``time`` is in s. With two stages the force stays at the first until ``truth.stage_time``.
    """
    s = min(1.0, max(0.0, time / point.rise))
    step = s * s * (3.0 - 2.0 * s)
    if truth.stage < 1.0 and time < truth.stage_time:
        step = min(step, truth.stage)
    elif truth.stage < 1.0:
        t = min(1.0, (time - truth.stage_time) / point.rise)
        step = min(step, truth.stage) + (1.0 - truth.stage) * t * t * (3.0 - 2.0 * t)
        step = min(step, 1.0)
    return point.force * step


class FrictionLaw(NamedTuple):
    """Friction of the dogs."""

    static: float
    dynamic: float
    creep_velocity: float  #: slip below which dogs creep, m/s; 0 for none

    def coefficient(self, slip: float) -> float:
        """Compute the coefficient of friction at a slip in m/s."""
        if self.creep_velocity == 0.0:
            return self.dynamic
        z = slip / self.creep_velocity - 10.0
        step = 1.0 - z / math.sqrt(1.0 + z * z)
        sliding_coefficient = self.dynamic + 0.5 * (self.static - self.dynamic) * step
        return (
            sliding_coefficient
            * slip
            / math.sqrt(slip * slip + self.creep_velocity * self.creep_velocity)
        )


def friction_law(stand: Stand, truth: Truth) -> FrictionLaw:
    """Build the friction law of the dogs; a stand that hardly creeps has one coefficient."""
    static = stand.static_friction if truth.static_friction is None else truth.static_friction
    dynamic = stand.dynamic_friction if truth.dynamic_friction is None else truth.dynamic_friction
    if stand.stiction_speed < HELD:
        return FrictionLaw(dynamic, dynamic, creep_velocity=0.0)
    return FrictionLaw(static, dynamic, creep_velocity=truth.stiction * stand.stiction_speed)


class Engine:
    """Stand with its truth in MuJoCo for any number of shifts.

    ``model`` are options of ``mujoco_model.model_text``.
    """

    def __init__(self, stand: Stand, truth: Truth | None = None, **model: Any) -> None:
        self.stand = stand
        self.truth = truth or Truth()
        self._mujoco = load_mujoco()
        text = model_text(stand, self.truth, **model)
        self._model = self._mujoco.MjModel.from_xml_string(text)
        self._data = self._mujoco.MjData(self._model)
        self._friction = self._model.pair_friction[:, :2]
        self._position = self._data.qpos
        self._velocity = self._data.qvel
        self._applied_force = self._data.qfrc_applied
        self._control = self._data.ctrl
        self._law = friction_law(stand, self.truth)
        names = ["output", "shift", "sliding"]
        if self.truth.linkage:
            names.append("actuator")
        self._dof = [int(self._model.joint(name).dofadr[0]) for name in names]
        gap = stand.gap + self.truth.gap_offset
        self._coarse_travel = COARSE_SHARE * gap - self.truth.high_dog
        self._travel = gap + stand.height - stand.seated - self.truth.high_dog
        inertia = self.truth.inertia_factor * stand.sliding_inertia
        spline_share = 1.0 - stand.mass * stand.radius**2 / inertia
        spline_radius = SPLINE_RADIUS_RATIO * stand.inner_radius
        self._spline_force_per_torque = max(0.0, spline_share) / spline_radius  # 1/m
        self._flank_reference = (-1.0, -1.0)
        self._face_reference = (-1.0, -1.0)
        self._friction_factor = 1.0
        self._motion: list[tuple[float, ...]] | None = None

    def shift(self, point: Point, draw: Draw, keep: bool = False) -> Shift:
        """Simulate a shift at a nominal point, with its motion if ``keep``."""
        point = self.truth.apply(point, draw.progress)
        delay = self.truth.delay + draw.late + self.truth.clock_drift * draw.progress
        self._friction_factor = 1.0 + self.truth.galling * draw.progress
        self._begin(point, draw)
        self._motion = [self._state()] if keep else None
        seated_time = self._run(point, draw, self.stand.timeout - delay)
        motion = None
        if self._motion is not None:
            motion = np.array(self._motion)
            motion[:, 0] += delay
        if seated_time is None:
            return Shift(None, motion)
        shift_time = delay + seated_time
        return Shift(None if shift_time > self.stand.timeout else shift_time, motion)

    def _run(self, point: Point, draw: Draw, time_limit: float) -> float | None:
        """Step until the ring is seated; return the time that the sensor shows, s, or None."""
        sensor_time: float | None = None
        resting_state: tuple[float, ...] = ()
        next_test = point.rise + 6.0 * self.truth.lag + self.truth.stage_time
        while self._data.time < time_limit:
            previous_time, previous_sensor = self._step(point, draw.phase)
            ring, sensor = self._displacements()
            time = float(self._data.time)
            if sensor_time is None and sensor >= self._travel:
                share = (self._travel - previous_sensor) / (sensor - previous_sensor)
                sensor_time = previous_time + share * (time - previous_time)
            if ring >= self._travel:
                return time if sensor_time is None else sensor_time
            if time >= next_test:
                state = self._resting_state()
                changes = [abs(a - b) for a, b in zip(state, resting_state, strict=False)]
                if changes and max(changes) < REST_TOLERANCE:
                    return None
                resting_state = state
                next_test = time + REST_INTERVAL_S
        return None

    def _begin(self, point: Point, draw: Draw) -> None:
        """Set the state at the start of the force, contact and friction."""
        self._mujoco.mj_resetData(self._model, self._data)
        output, _, sliding, *_ = self._dof
        self._position[output] = draw.angle
        self._velocity[sliding] = self.stand.sliding_speed
        self._velocity[output] = self.stand.sliding_speed + point.mismatch
        self._velocity[output] += self.truth.ripple * math.sin(draw.phase)
        references = contact_references(self.stand, self.truth, point)
        self._flank_reference, self._face_reference = references
        self._model.pair_solref[:] = self._flank_reference
        self._set_friction(self.stand.radius * abs(point.mismatch))

    def _set_friction(self, slip: float) -> None:
        self._friction[:] = max(1e-5, self._friction_factor * self._law.coefficient(slip))

    def _step(self, point: Point, phase: float) -> tuple[float, float]:
        """Step on; return time and displacement at the sensor before the last step, s and m."""
        data = self._data
        model = self._model
        truth = self.truth
        start = float(data.time), self._displacements()[1]
        shift = self._dof[1]
        in_gap = self._position[shift] < self._coarse_travel
        flying = not truth.linkage and data.ncon == 0 and in_gap
        model.opt.timestep = FLIGHT_STEP if flying else STEP
        self._control[0] = signal(truth, point, data.time)
        if truth.detent:
            z = (float(self._position[shift]) - truth.detent_position) / DETENT_WIDTH
            force = truth.detent * math.cos(math.pi * z) ** 2
            self._applied_force[shift] = -force if abs(z) < 0.5 else 0.0
        if truth.ripple:
            angle = truth.ripple_rate * data.time + phase
            acceleration = truth.ripple * truth.ripple_rate * math.cos(angle)
            self._applied_force[self._dof[0]] = self.stand.output_inertia * acceleration
        self._mujoco.mj_step(model, data, nstep=1 if flying else STEPS_PER_SETTING)
        if data.ncon:
            self._set_contact()
        elif truth.spline_friction:
            model.dof_frictionloss[shift] = truth.friction
        if truth.static_excess:
            slip = abs(float(self._velocity[shift])) / STRIBECK_SPEED
            model.dof_frictionloss[shift] = truth.friction + truth.static_excess * math.exp(-slip)
        if self._motion is not None:
            self._motion.append(self._state())
        return start

    def _set_contact(self) -> None:
        """Set contact and friction by normal, slip and torque of the last step."""
        on_face = abs(float(self._data.contact.frame[0, 2])) > FACE_NORMAL
        self._model.pair_solref[:] = self._face_reference if on_face else self._flank_reference
        if self._law.creep_velocity:
            # Rows of the last contact: normal speed and two components of the slip.
            slip = self._data.efc_vel[-2:].tolist()
            self._set_friction(math.hypot(*slip))
        if self.truth.spline_friction:
            # The hinge's constraint force is the contact's and that of the drag, if any.
            torque = abs(float(self._data.qfrc_constraint[self._dof[2]]))
            force = self.truth.spline_friction * self._spline_force_per_torque * torque
            self._model.dof_frictionloss[self._dof[1]] = self.truth.friction + force

    def _displacements(self) -> tuple[float, float]:
        """Return displacements of the ring and at the sensor, m."""
        ring = float(self._position[self._dof[1]])
        if self.truth.linkage and self.truth.sensor == "actuator":
            return ring, float(self._position[self._dof[3]])
        return ring, ring

    def _resting_state(self) -> tuple[float, ...]:
        """Return displacements, m, and relative angle, rad, which stay the same at rest.

        A ring that never moves lets the other one turn, so the angle is 0 without contact.
        """
        output, _, sliding, *_ = self._dof
        angle = 0.0
        if self._data.ncon:
            angle = float(self._position[output] - self._position[sliding])
        return (*self._displacements(), angle)

    def _state(self) -> tuple[float, ...]:
        """Return a row of ``Shift.motion``."""
        ring, sensor = self._displacements()
        output, shift, sliding, *_ = self._dof
        velocities = (float(self._velocity[dof]) for dof in (sliding, output, shift))
        return (float(self._data.time), sensor, ring, *velocities)
