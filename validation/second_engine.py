"""One shift in a second physics engine, MuJoCo, to check the first.

Model and motion are those of ``validation.blind``, of a stand without any effect; force, flight
before the contact and restitution are the project's. It represents a contact set with one friction
coefficient and little creep, as ``lubricated_steel``; contact is as stiff as the step allows. Free
flight is its closed form; then semi-implicit Euler with speeds half a step behind, of second order.
Single shifts agree within a percent or two (``python -m benchmarks.second_engine``): what remains
is contact at edges, whose normal is the edges' in MuJoCo and the rigid side's in Drake.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

import numpy as np

from dogshape.sim.elementwise import Array
from dogshape.sim.errors import InputError, Refusal, require_between
from dogshape.sim.shift.clutch import Clutch, OperatingPoint
from dogshape.sim.shift.geometry import Dog
from dogshape.sim.shift.mesh import dog_planes, dog_solid, meeting
from dogshape.sim.units import MM
from dogshape.validation.blind.mujoco_model import OVERHANG, ratio_of
from dogshape.validation.blind.mujoco_shift import Draw, Engine, Shift
from dogshape.validation.blind.stand import Point, Stand
from dogshape.validation.impact import restitution

CHUNK_S = 0.004  #: motion between two checks of the travel, s
FREE_FLIGHT_SHARE = 0.999  #: of the axial gap, flown in closed form
DAMPING_RATIOS = (0.15, 3.0)  #: restitution from 0.65 to 0.02
MIN_FRICTION_RATIO = 0.75  #: of dynamic over static friction


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


def stand_of(clutch: Clutch) -> Stand:
    """Describe a clutch as a stand; InputError for features that MuJoCo cannot represent."""
    dog = clutch.dog
    rings = clutch.rings
    contact = clutch.contact
    _require_supported(clutch)
    return Stand(
        count=dog.count,
        chamfer=dog.chamfer,
        traction=dog.traction,
        braking=dog.braking,
        height=dog.height,
        outer_radius=dog.outer_radius,
        inner_radius=dog.inner_radius,
        gap=dog.axial_gap,
        mass=rings.mass,
        sliding_inertia=rings.sliding_inertia,
        sliding_speed=0.0,
        output_inertia=rings.output_inertia,
        static_friction=contact.dynamic_friction,
        dynamic_friction=contact.dynamic_friction,
        stiction_speed=0.0,
        timeout=clutch.timeout,
        seated=clutch.seated_tolerance,
        rebound=clutch.rebound,
    )


def _require_supported(clutch: Clutch) -> None:
    """Raise InputError for a contact, edge, actuator or drive that MuJoCo cannot represent."""
    dog = clutch.dog
    contact = clutch.contact
    if contact.dynamic_friction < MIN_FRICTION_RATIO * contact.static_friction:
        fall = f"falls from {contact.static_friction:g} to {contact.dynamic_friction:g}"
        raise InputError(
            f"friction of contact set '{contact.name}' {fall}, but the second engine knows one "
            "coefficient; use a set such as lubricated_steel, where the two are within a quarter."
        )
    remedy = "use a set such as lubricated_steel, the second engine holds what friction can hold"
    creep = contact.stiction_velocity
    require_between("contact.stiction_velocity_m_s", creep, 0.0, 5e-3, remedy)
    if dog.edge_radius > 0.0:
        message = Refusal(
            "dog.edge_radius_mm",
            dog.edge_radius / MM,
            "mm",
            rule="the second engine has sharp edges (0 mm)",
            remedy="leave dog.edge_radius_mm out",
        )
        raise InputError(message)
    if clutch.actuator is not None:
        raise InputError(
            f"the second engine has no {clutch.actuator.kind} actuator; take actuation.kind = "
            '"profile"'
        )
    if clutch.drive.has_torques:
        raise InputError("the second engine has no [drive] of torques; leave its torques out")


def damping_ratio(clutch: Clutch, point: OperatingPoint) -> float:
    """Compute the damping ratio with the restitution of the contact set at a flank hit.

    The dog arrives with the mismatch and, half way down, with its free speed. Friction
    changes the effective mass at the flank, which the engine leaves out of *A*.
    """
    dog = clutch.dog
    rings = clutch.rings
    lean = dog.traction if point.mismatch >= 0.0 else dog.braking
    c = math.cos(lean)
    s = math.sin(lean)
    mu = clutch.contact.dynamic_friction
    half_way_time = point.profile.free_flight_time(dog.axial_gap + 0.5 * dog.height, rings.mass)
    axial_speed = float(point.profile.free_speed(half_way_time, rings.mass))
    speed = c * abs(point.mismatch) * dog.mean_radius + s * axial_speed
    turning = dog.mean_radius**2 / rings.reduced_inertia
    smooth = c * c * turning + s * s / rings.mass
    rough = c * (c + mu * s) * turning + s * (s - mu * c) / rings.mass
    friction_factor = math.sqrt(smooth / max(rough, 0.25 * smooth))
    ratio = ratio_of(restitution(clutch.contact.dissipation * speed), DAMPING_RATIOS)
    if ratio in DAMPING_RATIOS:
        return ratio
    return min(DAMPING_RATIOS[1], ratio * friction_factor)


class SecondEngine(Engine):
    """Clutch built in MuJoCo for any number of shifts.

    Raises InputError where MuJoCo is missing or cannot represent the clutch.
    """

    def __init__(self, clutch: Clutch, settings: EngineSettings | None = None) -> None:
        self.clutch = clutch
        self.settings = settings or EngineSettings()
        self._time_step = self.settings.time_step
        super().__init__(
            stand_of(clutch),
            step=self._time_step,
            stop=(-0.01 / self._time_step**2, -0.5 / self._time_step),
            shapes=(dog_solid(clutch.dog).vertices, _overhanging_corners(clutch.dog)),
        )
        self._rollout = self._mujoco.rollout.Rollout(nthread=0)

    def engage(self, point: OperatingPoint, relative_angle: float, keep: bool = False) -> Shift:
        """Simulate a shift; ``relative_angle`` in rad as for ``sim.shift.conclusion.engage``.

        With ``keep`` the shift has the motion of every step from the end of the free flight on, its
        speeds half a step behind.
        """
        self._operating_point = point
        profile = point.profile
        nominal = Point(point.mismatch, profile.net_force, profile.rise)
        return self.shift(nominal, Draw(relative_angle), keep)

    def _begin(self, point: Point, draw: Draw) -> None:
        """Set the end of the free flight, and spring and damper of the contact."""
        super()._begin(point, draw)
        profile = self._operating_point.profile
        mass = self.clutch.rings.mass
        ratio = damping_ratio(self.clutch, self._operating_point)
        rate = min(self.settings.damping / (2.0 * ratio), 0.5 / self._time_step)
        self._model.pair_solref[:] = -(rate**2), -2.0 * ratio * rate
        start = profile.free_flight_time(FREE_FLIGHT_SHARE * self.stand.gap, mass)
        self._data.time = start
        self._position[:] += start * self._velocity
        self._position[1] = profile.free_flight(start, mass)
        self._velocity[1] = profile.free_speed(start - 0.5 * self._time_step, mass)

    def _step(self, point: Point, phase: float) -> tuple[float, float]:
        """Step on for a chunk, in which nothing but the force changes, or to full travel."""
        data = self._data
        count = round(CHUNK_S / self._time_step)
        times = data.time + self._time_step * np.arange(count, dtype=np.float64)
        force = self._operating_point.profile.at(times)
        start = np.concatenate([[data.time], self._position, self._velocity])
        states = np.empty((1, count, 7))
        # Without its checks, which take as long as ten steps, it wants lists and a length.
        self._rollout.rollout(
            [self._model],
            [data],
            start[None, :],
            force[None, :, None],
            skip_checks=True,
            nstep=count,
            state=states,
        )
        # Rows: time; positions and velocities of output ring, travel and sliding ring.
        states = np.concatenate([start[None, :], states[0]])
        seated = states[:, 2] >= self._travel
        last = int(seated.argmax()) if seated.any() else count
        data.time = states[last, 0]
        self._position[:] = states[last, 1:4]
        self._velocity[:] = states[last, 4:]
        if self._motion is not None:
            self._motion += states[1 : last + 1, [0, 2, 2, 6, 4, 5]].tolist()
        return float(states[last - 1, 0]), float(states[last - 1, 2])


def _overhanging_corners(dog: Dog) -> Array:
    """Compute the corners of a dog with its ends moved out by ``OVERHANG``, m, (n, 3)."""
    planes = dog_planes(dog)
    ends = (planes.inner.moved(OVERHANG), planes.outer.moved(OVERHANG))
    corners = []
    for first, second in itertools.pairwise([planes.root, *planes.touching, planes.root]):
        for end in ends:
            corners.append(meeting(first, second, end))
    return np.array(corners)
