"""The same shift in another physics engine, MuJoCo, as a check on the first.

Model and motion are those of ``validation.blind``, of a stand without any effect; force, flight
before the contact and restitution are the project's. It stands for a contact set with one friction
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

from dogshape.sim.errors import InputError, refusal, require_between
from dogshape.sim.shift.clutch import Clutch, OperatingPoint
from dogshape.sim.shift.mesh import dog_planes, dog_solid, meeting
from dogshape.sim.units import MM
from dogshape.validation.blind.mujoco_model import OVERHANG, ratio_of
from dogshape.validation.blind.mujoco_shift import Draw, Engine, Shift
from dogshape.validation.blind.stand import Point, Stand
from dogshape.validation.impact import restitution

CHUNK = 0.004  #: s of motion between two looks at it
FREE = 0.999  #: part of the axial gap that is flown in closed form
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


def stand_of(clutch: Clutch) -> Stand:
    """Describe a clutch as a stand; InputError for a contact or an edge that MuJoCo cannot have."""
    dog, rings, contact = clutch.dog, clutch.rings, clutch.contact
    if contact.dynamic_friction < 0.75 * contact.static_friction:
        fall = f"falls from {contact.static_friction:g} to {contact.dynamic_friction:g}"
        raise InputError(
            f"friction of contact set '{contact.name}' {fall}, but the second engine knows one "
            "coefficient; use a set such as lubricated_steel, where the two are within a quarter."
        )
    remedy = "use a set such as lubricated_steel, the second engine holds what friction can hold"
    creep = contact.stiction_velocity
    require_between("contact.stiction_velocity_m_s", creep, 0.0, 5e-3, remedy)
    if dog.edge_radius > 0.0:
        rule, remedy = "the second engine has sharp edges (0 mm)", "leave dog.edge_radius_mm out"
        raise InputError(refusal("dog.edge_radius_mm", dog.edge_radius / MM, "mm", rule, remedy))
    if clutch.drive.has_torques:
        raise InputError("the second engine has no [drive] of torques; leave its torques out")
    return Stand(
        count=dog.count, chamfer=dog.chamfer, traction=dog.traction, braking=dog.braking,
        height=dog.height, outer_radius=dog.outer_radius, inner_radius=dog.inner_radius,
        gap=dog.axial_gap, mass=rings.mass, sliding_inertia=rings.sliding_inertia,
        sliding_speed=0.0, output_inertia=rings.output_inertia,
        static_friction=contact.dynamic_friction, dynamic_friction=contact.dynamic_friction,
        stiction_speed=0.0, timeout=clutch.timeout, seated=clutch.seated_tolerance,
        rebound=clutch.rebound,
    )  # fmt: skip


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


class SecondEngine(Engine):
    """A clutch built in MuJoCo that can be shifted again and again.

    Raises InputError where MuJoCo is missing or cannot stand for the contact set.
    """

    def __init__(self, clutch: Clutch, settings: EngineSettings | None = None) -> None:
        self.clutch, self.settings = clutch, settings or EngineSettings()
        self._every = step = self.settings.time_step
        stand, longer = stand_of(clutch), dog_planes(clutch.dog)
        for end in ("inner", "outer"):
            longer[end] = longer[end].moved(OVERHANG)
        around = [n for n in ("root", "braking", "face", "back", "traction") if n in longer]
        lines = itertools.product(itertools.pairwise([*around, "root"]), ("inner", "outer"))
        points = [meeting(*(longer[name] for name in (*sides, end))) for sides, end in lines]
        shapes = dog_solid(clutch.dog).vertices, np.array(points)
        stop = -0.01 / step**2, -0.5 / step
        super().__init__(stand, step=step, stop=stop, shapes=shapes)
        self._rollout = self._mujoco.rollout.Rollout(nthread=0)

    def engage(self, point: OperatingPoint, relative_angle: float, keep: bool = False) -> Shift:
        """Simulate one shift; ``relative_angle`` in rad as for ``sim.shift.conclusion.engage``.

        ``keep`` keeps the motion of every step from the end of the free flight on, its speeds
        half a step behind.
        """
        self._operated, profile = point, point.profile
        asked = Point(point.mismatch, profile.net_force, profile.rise)
        return self.shift(asked, Draw(relative_angle), keep)

    def _begin(self, point: Point, draw: Draw) -> None:
        """Set the end of the free flight, and spring and damper of the contact."""
        super()._begin(point, draw)
        profile, mass = self._operated.profile, self.clutch.rings.mass
        ratio = damping_ratio(self.clutch, self._operated)
        rate = min(self.settings.damping / (2.0 * ratio), 0.5 / self._every)
        self._model.pair_solref[:] = -(rate**2), -2.0 * ratio * rate
        start = profile.free_flight_time(FREE * self.stand.gap, mass)
        self._data.time = start
        self._place[:] += start * self._rate
        self._place[1] = profile.free_flight(start, mass)
        self._rate[1] = profile.free_speed(start - 0.5 * self._every, mass)

    def _step(self, point: Point, phase: float) -> tuple[float, float]:
        """Step on for a chunk, in which nothing but the force changes, or to full travel."""
        data, count = self._data, round(CHUNK / self._every)
        times = data.time + self._every * np.arange(count, dtype=np.float64)
        force = self._operated.profile.at(times)
        begin = np.concatenate([[data.time], self._place, self._rate])
        states = np.empty((1, count, 7))
        # Without its checks, which take as long as ten steps, it wants lists and a length.
        self._rollout.rollout(
            [self._model], [data], begin[None, :], force[None, :, None],
            skip_checks=True, nstep=count, state=states,
        )  # fmt: skip
        made = np.concatenate([begin[None, :], states[0]])
        there = made[:, 2] >= self._travel
        last = int(there.argmax()) if there.any() else count
        data.time, self._place[:], self._rate[:] = made[last, 0], made[last, 1:4], made[last, 4:]
        if self._kept is not None:
            self._kept += made[1 : last + 1, [0, 2, 2, 6, 4, 5]].tolist()
        return float(made[last - 1, 0]), float(made[last - 1, 2])
