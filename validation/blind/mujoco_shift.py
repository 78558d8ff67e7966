r"""One shift of a stand with its truth, in MuJoCo, and what the stand reads of it.

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
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dogshape.sim.errors import InputError
from dogshape.validation.blind.mujoco_model import FLIGHT_STEP, STEP, contact_references, model_text
from dogshape.validation.blind.stand import Point, Stand, Truth

Series = NDArray[np.float64]

HELD = 5e-3  #: m/s, speeds of stiction below it count as none
TOGETHER = 2  #: steps between two settings of friction and force
NEAR = 0.9  #: share of the gap that is flown coarsely
LOOK = 0.01  #: s between two looks at whether anything moves
FLAT = 0.9  #: axial part of a normal above which faces touch
DETENT_WIDTH = 1e-3  #: m
SPLINE_PLACE = 0.8  #: radius of the spline over the inner radius of the dogs


@dataclass(frozen=True)
class Draw:
    """Values that differ from shift to shift.

    ``angle`` in rad between dogs at the start of the force, ``late`` in s how long the force
    waits, ``phase`` in rad of the ripple, ``fade`` the share of the force that a drift has left.
    """

    angle: float
    late: float = 0.0
    phase: float = 0.0
    fade: float = 1.0


@dataclass(frozen=True)
class Shift:
    """Reading of the stand: a time in s, None where the shift did not engage, and the motion.

    ``motion`` (n, 6), where it is kept: s, m at the sensor, m of the ring, rad/s of the sliding
    and of the output ring, m/s of the ring.
    """

    time: float | None
    motion: Series | None = None


def loaded() -> Any:
    """Return MuJoCo; InputError where it cannot be loaded."""
    try:
        import_module("mujoco.rollout")
        return import_module("mujoco")
    except ImportError as error:
        raise InputError(
            f"MuJoCo, the second physics engine, cannot be loaded ({error}); "
            "install it with: pip install -c constraints.txt '.[blind]'."
        ) from error


def engine_available() -> bool:
    """Test that MuJoCo can be imported."""
    try:
        loaded()
    except InputError:
        return False
    return True


def signal(truth: Truth, point: Point, time: float) -> float:
    """Compute the force in N at ``time`` in s after its start: a cubic step to a point's force.

    With two stages the first share of it waits for the second.
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


def friction_law(stand: Stand, truth: Truth) -> tuple[float, float, float]:
    """Return static and dynamic coefficient, and the slip in m/s below which dogs creep."""
    static = stand.static_friction if truth.static_friction is None else truth.static_friction
    dynamic = stand.dynamic_friction if truth.dynamic_friction is None else truth.dynamic_friction
    if stand.stiction_speed < HELD:
        return dynamic, dynamic, 0.0
    return static, dynamic, truth.stiction * stand.stiction_speed


def coefficient(law: tuple[float, float, float], slip: float) -> float:
    """Return the coefficient of friction at a slip in m/s."""
    static, dynamic, creep = law
    if creep == 0.0:
        return dynamic
    z = slip / creep - 10.0
    fallen = dynamic + 0.5 * (static - dynamic) * (1.0 - z / math.sqrt(1.0 + z * z))
    return fallen * slip / math.sqrt(slip * slip + creep * creep)


class Engine:
    """A stand with its truth that can be shifted again and again; ``model`` as for its text."""

    def __init__(self, stand: Stand, truth: Truth | None = None, **model: Any) -> None:
        self.stand, self.truth = stand, truth or Truth()
        self._mujoco = loaded()
        text = model_text(stand, self.truth, **model)
        self._model = self._mujoco.MjModel.from_xml_string(text)
        self._data = self._mujoco.MjData(self._model)
        self._friction = self._model.pair_friction[:, :2]
        self._place, self._rate = self._data.qpos, self._data.qvel
        self._applied, self._control = self._data.qfrc_applied, self._data.ctrl
        self._law = friction_law(stand, self.truth)
        names = ("output", "shift", "sliding", *(["actuator"] if self.truth.linkage else []))
        self._dof = [int(self._model.joint(name).dofadr[0]) for name in names]
        gap = stand.gap + self.truth.gap_offset
        self._near = NEAR * gap - self.truth.high_dog
        self._travel = gap + stand.height - stand.seated - self.truth.high_dog
        turning = self.truth.inertia_factor * stand.sliding_inertia
        shares = 1.0 - stand.mass * stand.radius**2 / turning
        self._flank = self._face = (-1.0, -1.0)
        self._spline = max(0.0, shares) / (SPLINE_PLACE * stand.inner_radius)

    def shift(self, point: Point, draw: Draw, keep: bool = False) -> Shift:
        """Simulate one shift; ``keep`` keeps its motion."""
        point = self.truth.given(point, draw.fade)
        delay = self.truth.delay + draw.late
        self._begin(point, draw)
        self._kept = [self._state()] if keep else None
        read: float | None = None  # time at which the sensor is seated
        ended: float | None = None  # the same, once the ring is
        limit = self.stand.timeout - delay
        stood: tuple[float, ...] = ()
        look = point.rise + 6.0 * self.truth.lag + self.truth.stage_time
        while self._data.time < limit:
            before, mark = self._step(point, draw.phase)
            ring, sensor = self._places()
            now = float(self._data.time)
            if read is None and sensor >= self._travel:
                read = before + (self._travel - mark) / (sensor - mark) * (now - before)
            if ring >= self._travel:
                ended = delay + (now if read is None else read)
                break
            if now >= look:
                rest = self._rest()
                if stood and max(abs(a - b) for a, b in zip(rest, stood, strict=True)) < 1e-7:
                    break
                look, stood = now + LOOK, rest
        motion = None if self._kept is None else np.array(self._kept)
        if motion is not None:
            motion[:, 0] += delay
        late = ended is not None and ended > self.stand.timeout
        return Shift(None if late else ended, motion)

    def _begin(self, point: Point, draw: Draw) -> None:
        data, model, truth = self._data, self._model, self.truth
        self._mujoco.mj_resetData(model, data)
        output, _, sliding, *_ = self._dof
        self._place[output] = draw.angle
        self._rate[sliding] = self.stand.sliding_speed
        self._rate[output] = self.stand.sliding_speed + point.mismatch
        self._rate[output] += truth.ripple * math.sin(draw.phase)
        self._flank, self._face = contact_references(self.stand, truth, point)
        model.pair_solref[:] = self._flank
        self._set_friction(self.stand.radius * abs(point.mismatch))

    def _set_friction(self, slip: float) -> None:
        self._friction[:] = max(1e-5, coefficient(self._law, slip))

    def _step(self, point: Point, phase: float) -> tuple[float, float]:
        """Step on; return time and way at the sensor before the last step, s and m."""
        data, model, truth = self._data, self._model, self.truth
        before = float(data.time), self._places()[1]
        shift = self._dof[1]
        flying = not truth.linkage and data.ncon == 0 and self._place[shift] < self._near
        model.opt.timestep = FLIGHT_STEP if flying else STEP
        self._control[0] = signal(truth, point, data.time)
        if truth.detent:
            z = (float(self._place[shift]) - truth.detent_position) / DETENT_WIDTH
            hump = truth.detent * math.cos(math.pi * z) ** 2
            self._applied[shift] = -hump if abs(z) < 0.5 else 0.0
        if truth.ripple:
            turn = truth.ripple_rate * data.time + phase
            swing = truth.ripple * truth.ripple_rate * math.cos(turn)
            self._applied[self._dof[0]] = self.stand.output_inertia * swing
        self._mujoco.mj_step(model, data, nstep=1 if flying else TOGETHER)
        if data.ncon:
            self._after_contact()
        elif truth.spline_friction:
            model.dof_frictionloss[shift] = truth.friction
        if self._kept is not None:
            self._kept.append(self._state())
        return before

    def _after_contact(self) -> None:
        """Set friction by the slip and the torque of the step that was made, and what touches."""
        flat = abs(float(self._data.contact.frame[0, 2])) > FLAT
        self._model.pair_solref[:] = self._face if flat else self._flank
        if self._law[2]:
            # Rows of the last contact: normal speed and both components of the slip.
            along, across = self._data.efc_vel[-2:].tolist()
            self._set_friction(math.hypot(along, across))
        if self.truth.spline_friction:
            # The hinge's constraint force is the contact's and that of the drag, if any.
            torque = abs(float(self._data.qfrc_constraint[self._dof[2]]))
            pressed = self.truth.spline_friction * self._spline * torque
            self._model.dof_frictionloss[self._dof[1]] = self.truth.friction + pressed

    def _places(self) -> tuple[float, float]:
        """Return the way of the ring and the one that is read, m."""
        ring = float(self._place[self._dof[1]])
        ahead = self.truth.linkage and self.truth.sensor == "actuator"
        return ring, float(self._place[self._dof[3]]) if ahead else ring

    def _rest(self) -> tuple[float, ...]:
        """Gather the final state once nothing more will happen: ways, and the pitch's angle.

        A ring that never moves lets the other one turn, so that the angle counts in contact only.
        """
        output, _, sliding, *_ = self._dof
        apart = float(self._place[output] - self._place[sliding])
        return (*self._places(), apart if self._data.ncon else 0.0)

    def _state(self) -> tuple[float, ...]:
        ring, sensor = self._places()
        output, shift, sliding, *_ = self._dof
        speeds = (float(self._rate[dof]) for dof in (sliding, output, shift))
        return (float(self._data.time), sensor, ring, *speeds)
