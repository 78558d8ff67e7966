"""The same shift in another physics engine, MuJoCo, as a check on the first.

Geometry, masses and the force are the project's; collision, contact, friction and
integration are MuJoCo's (``validation.second_model``). It stands for a contact set with
one friction coefficient and little creep, as ``lubricated_steel``; the stiffness of the
set is not used, contact is as stiff as the step allows.

The free flight before the crests meet is taken from its closed form. From there
MuJoCo's semi-implicit Euler steps, all in compiled code, run with speeds half a
step behind the positions: so started it is the leapfrog rule, of second order.

``python -m benchmarks.second_engine`` prints how far both engines agree, and why not farther. In
short: single shifts agree within a percent or two (median) everywhere, and within 0.1 % where rings
are so narrow that the radius of a contact is known. What remains is contact at edges. Faces and
flanks of two rings turned against each other are not parallel and touch at their ends; where edges
cross, MuJoCo pushes along the common normal of the edges, as rigid bodies do. Drake's contact
surface pushes along the normal of the rigid side, which makes the entry a millisecond slower, and
lets no crest stand on a crest. At high speeds the smallest difference decides which slot a dog
enters, for a tenth of the angles.

MuJoCo is an optional extra, ``pip install -c constraints.txt '.[blind]'``.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from importlib import import_module
from typing import Any

import numpy as np

from dogshape.sim.errors import InputError
from dogshape.sim.shift.clutch import Clutch, OperatingPoint
from dogshape.sim.shift.conclusion import Outcome
from dogshape.sim.shift.events import STILL_WINDOW, stays_held
from dogshape.sim.shift.trace import Series, Trace, trace_of
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
        _mujoco()
    except InputError:
        return False
    return True


def _mujoco() -> Any:
    try:
        import_module("mujoco.rollout")
        return import_module("mujoco")
    except ImportError as error:
        raise InputError(
            f"the second physics engine cannot be loaded ({error}), but this comparison needs it; "
            "install it with: pip install -c constraints.txt '.[blind]'."
        ) from error


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
        flight = _flight(self, self.relative_angle, times, times)
        return trace_of(
            self.clutch,
            self.point.profile,
            np.concatenate([times, self.times]),
            np.concatenate([flight, self.states]),
        )


class SecondEngine:
    """A clutch built in MuJoCo that can be shifted again and again.

    Raises InputError where MuJoCo is missing or cannot stand for the contact set.
    """

    def __init__(self, clutch: Clutch, settings: EngineSettings | None = None) -> None:
        require_one_coefficient(clutch)
        mujoco = _mujoco()
        self.clutch = clutch
        self.settings = settings or EngineSettings()
        self._model = mujoco.MjModel.from_xml_string(model_text(clutch, self.settings))
        self._data = mujoco.MjData(self._model)
        self._rollout = mujoco.rollout.Rollout(nthread=0)

    def shift(self, point: OperatingPoint, relative_angle: float) -> SecondShift:
        """Simulate one shift; ``relative_angle`` in rad as for ``sim.shift.engagement.engage``."""
        start, reference = _start(self.clutch, point, self.settings)
        self._model.pair_solref[:] = reference
        watch = _Watch(self.clutch, point)
        times = [np.array([start])]
        before = times[0] - 0.5 * self.settings.time_step
        states = [_flight(watch, relative_angle, times[0], before)]
        while watch.outcome is None:
            now, motion = self._advance(point, float(times[-1][-1]), states[-1][-1])
            times.append(now)
            states.append(motion)
            watch.look(now, motion)
        return _conclude(watch, relative_angle, np.concatenate(times), np.concatenate(states))

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


class _Watch:
    """Decides after each chunk whether the shift has ended, and how."""

    def __init__(self, clutch: Clutch, point: OperatingPoint) -> None:
        self.clutch = clutch
        self.point = point
        self.outcome: Outcome | None = None
        self._still_since = 0.0

    def look(self, times: Series, states: Series) -> None:
        """Set the outcome if the shift ended within a chunk."""
        clutch, end = self.clutch, float(times[-1])
        if not np.isfinite(states).all():
            self.outcome = Outcome.DIVERGED
        elif (states[times <= clutch.timeout, 1] >= clutch.shift_travel).any():
            self.outcome = Outcome.ENGAGED
        elif end >= clutch.timeout:
            self.outcome = Outcome.TIMED_OUT
        elif not stays_held(clutch, states, CHUNK, clutch.timeout - end):
            self._still_since = end
        elif end - self._still_since >= STILL_WINDOW and self._half_up(end - STILL_WINDOW):
            self.outcome = Outcome.BLOCKED

    def _half_up(self, time: float) -> bool:
        """Test that the force was half up: then a ring that nothing holds would move."""
        return bool(self.point.profile.at(time) >= 0.5 * self.point.profile.net_force)


def _flight(problem: _Watch | SecondShift, angle: float, times: Series, before: Series) -> Series:
    """Return the states (n, 6) of the free flight, rates at the times ``before``, s."""
    rings, profile = problem.clutch.rings, problem.point.profile
    turning = np.full_like(times, rings.initial_speed)
    ahead = turning + problem.point.mismatch
    way = profile.free_flight(times, rings.mass)
    speed = profile.free_speed(before, rings.mass)
    return np.stack([angle + ahead * times, way, turning * times, ahead, speed, turning], axis=1)


def _conclude(watch: _Watch, angle: float, times: Series, states: Series) -> SecondShift:
    clutch, shift_time = watch.clutch, None
    if watch.outcome is Outcome.ENGAGED:
        last = 1 + int(np.argmax(states[:, 1] >= clutch.shift_travel))
        times, states = times[:last], states[:last]
        shift_time = float(np.interp(clutch.shift_travel, states[-2:, 1], times[-2:]))
    outcome = watch.outcome or Outcome.DIVERGED
    return SecondShift(clutch, watch.point, angle, outcome, shift_time, times, states)


def second_shift(clutch: Clutch, point: OperatingPoint, relative_angle: float) -> SecondShift:
    """Build a clutch in the second engine and simulate one shift; angle in rad."""
    return SecondEngine(clutch).shift(point, relative_angle)
