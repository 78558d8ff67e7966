"""The same shift in another physics engine, MuJoCo, as a check on the first.

Geometry, masses and force are the project's; collision, contact, friction and integration are
MuJoCo's (``validation.second_model``). It stands for a contact set with one friction coefficient
and little creep, as ``lubricated_steel``; contact is as stiff as the step allows. Free flight is
its closed form; then semi-implicit Euler with speeds half a step behind, of second order. Single
shifts agree within a percent or two (``python -m benchmarks.second_engine``): what remains is
contact at edges, whose normal is the edges' in MuJoCo and the rigid side's in Drake.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from dogshape.sim import kernel
from dogshape.sim.errors import InputError
from dogshape.sim.shift.clutch import Clutch, OperatingPoint
from dogshape.sim.shift.conclusion import Outcome
from dogshape.sim.shift.trace import Series, Trace, trace_of
from dogshape.validation.blind.mujoco_shift import loaded
from dogshape.validation.second_model import (
    EngineSettings,
    damping_ratio,
    model_text,
    require_one_coefficient,
    solver_reference,
)

CHUNK = 0.004  #: s of motion between two looks at it
FREE = 0.999  #: part of the axial gap that is flown in closed form


def engine_available() -> bool:
    """Test that MuJoCo can be imported."""
    try:
        loaded()
    except InputError:
        return False
    return True


@dataclass(frozen=True)
class SecondShift:
    """Result of one shift in the second engine, with its problem.

    ``shift_time`` is in s, None unless engaged. ``times`` (n,) in s and ``states``
    (n, 6) are those of every step from the end of the free flight on: output angle,
    displacement, sliding angle and, half a step behind, their rates.
    """

    clutch: Clutch
    point: OperatingPoint
    relative_angle: float
    outcome: Outcome
    shift_time: float | None
    times: Series
    states: Series

    @cached_property
    def trace(self) -> Trace:
        """The same time series that the first engine gives, free flight included."""
        times = np.linspace(0.0, self.times[0], 20, endpoint=False)
        flight = _flight(self.clutch, self.point, self.relative_angle, times, times)
        return trace_of(
            self.clutch,
            self.point.profile,
            np.concatenate([times, self.times]),
            np.pad(np.concatenate([flight, self.states]), ((0, 0), (0, kernel.SIZE - 6))),
        )


class SecondEngine:
    """A clutch built in MuJoCo that can be shifted again and again.

    Raises InputError where MuJoCo is missing or cannot stand for the contact set.
    """

    def __init__(self, clutch: Clutch, settings: EngineSettings | None = None) -> None:
        require_one_coefficient(clutch)
        mujoco = loaded()
        self.clutch = clutch
        self.settings = settings or EngineSettings()
        self._model = mujoco.MjModel.from_xml_string(model_text(clutch, self.settings))
        self._data = mujoco.MjData(self._model)
        self._rollout = mujoco.rollout.Rollout(nthread=0)

    def shift(self, point: OperatingPoint, relative_angle: float) -> SecondShift:
        """Simulate one shift; ``relative_angle`` in rad as for ``sim.shift.engagement.engage``."""
        clutch, still_since = self.clutch, 0.0
        start, reference = _start(clutch, point, self.settings)
        self._model.pair_solref[:] = reference
        times = [np.array([start])]
        before = times[0] - 0.5 * self.settings.time_step
        states = [_flight(clutch, point, relative_angle, times[0], before)]
        outcome: Outcome | None = None
        while outcome is None:
            now, motion = self._advance(point, float(times[-1][-1]), states[-1][-1])
            times.append(now)
            states.append(motion)
            end = float(now[-1])
            if not np.isfinite(motion).all():
                outcome = Outcome.DIVERGED
            elif (motion[now <= clutch.timeout, 1] >= clutch.shift_travel).any():
                outcome = Outcome.ENGAGED
            elif end >= clutch.timeout:
                outcome = Outcome.TIMED_OUT
            elif not kernel.stays_held(motion, CHUNK, clutch.timeout - end, clutch.numbers):
                still_since = end
            elif end - still_since >= kernel.STILL_WINDOW and _half_up(point, end):
                outcome = Outcome.BLOCKED
        whole, moved, shift_time = np.concatenate(times), np.concatenate(states), None
        if outcome is Outcome.ENGAGED:
            last = 1 + int(np.argmax(moved[:, 1] >= clutch.shift_travel))
            whole, moved = whole[:last], moved[:last]
            shift_time = float(np.interp(clutch.shift_travel, moved[-2:, 1], whole[-2:]))
        return SecondShift(clutch, point, relative_angle, outcome, shift_time, whole, moved)

    def _advance(self, point: OperatingPoint, start: float, state: Series) -> tuple[Series, Series]:
        """Step on for a chunk and return the new times (n,) and states (n, 6)."""
        step, count = self.settings.time_step, round(CHUNK / self.settings.time_step)
        now: Series = start + step * np.arange(1 + count, dtype=np.float64)
        force = point.profile.at(now[:-1]) / self.clutch.dog.count
        begin = np.concatenate([[start], state])
        motion = np.empty((1, count, 7))
        # Without its checks, which take as long as ten steps, it wants lists and a length.
        self._rollout.rollout(
            [self._model],
            [self._data],
            begin[None, :],
            force[None, :, None],
            skip_checks=True,
            nstep=count,
            state=motion,
        )
        return now[1:], motion[0, :, 1:]


@lru_cache(maxsize=256)
def _start(
    clutch: Clutch, point: OperatingPoint, settings: EngineSettings
) -> tuple[float, tuple[float, float]]:
    """Compute the end of the free flight, s, and the contact's ``solref``: for all angles."""
    start = point.profile.free_flight_time(FREE * clutch.dog.axial_gap, clutch.rings.mass)
    return start, solver_reference(settings, damping_ratio(clutch, point))


def _half_up(point: OperatingPoint, end: float) -> bool:
    """Test that the force was half up: then a ring that nothing holds would move."""
    before = end - kernel.STILL_WINDOW
    return bool(point.profile.at(before) >= 0.5 * point.profile.net_force)


def _flight(
    clutch: Clutch, point: OperatingPoint, angle: float, times: Series, before: Series
) -> Series:
    """Return the states (n, 6) of the free flight, rates at the times ``before``, s."""
    rings, profile = clutch.rings, point.profile
    turning = np.full_like(times, rings.initial_speed)
    ahead = turning + point.mismatch
    way = profile.free_flight(times, rings.mass)
    speed = profile.free_speed(before, rings.mass)
    return np.stack([angle + ahead * times, way, turning * times, ahead, speed, turning], axis=1)


def second_shift(clutch: Clutch, point: OperatingPoint, relative_angle: float) -> SecondShift:
    """Build a clutch in the second engine and simulate one shift; angle in rad."""
    return SecondEngine(clutch).shift(point, relative_angle)
