"""Actuator of a stepped shift: its command over time, and its own state where that changes.

A command is a static force, as that of an operating point (``sim.shift.actuators``), or off. It is
constant between its changes, each of which acts after the dead time. Pressure, current or lagged
force go on from where they are; the drum of a cam turns as long as the command is on.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from dogshape.sim import kernel
from dogshape.sim.elementwise import Array
from dogshape.sim.kernel_layout import (
    ACTUATOR_DISPLACEMENT,
    ACTUATOR_LEVEL,
    ACTUATOR_SPEED,
    AXIAL_SPEED,
    DISPLACEMENT,
    SPINDLE_TRAVEL,
)
from dogshape.sim.shift.actuation import SMALLEST_FORCE, ForceProfile
from dogshape.sim.shift.actuators import COMMAND_RISE_S, Actuator
from dogshape.sim.shift.clutch import Clutch


class CommandCourse(NamedTuple):
    """Dead time, lag and loss between a command and the force at the fork."""

    delay: float = 0.0  #: s
    lag: float = 0.0  #: s
    loss: float = 0.0  #: N

    def profile(self, force: float) -> ForceProfile | None:
        """Build the profile of a static force in N; None for one that leaves no force."""
        if force - self.loss < SMALLEST_FORCE:
            return None
        return ForceProfile(force, COMMAND_RISE_S, lag=self.lag, loss=self.loss)


DIRECT = CommandCourse()  #: a command that acts at once, without loss


class CommandChange(NamedTuple):
    """Change of a command, when it reaches the actuator."""

    time: float  #: s
    force: float  #: static, N; 0 is off


class SavedCommand(NamedTuple):
    """Command of an actuator at a time, of plain numbers."""

    force: float  #: that acts, N; 0 is off
    used_force: float  #: of the last command that was on, N; 0 before the first one
    asked_force: float  #: of the last change, N
    pending: tuple[CommandChange, ...]  #: that do not act yet
    drum_start: float  #: time from which the drum counts as turning, s
    off_time: float  #: of the last change to off, s


#: Command before the first one.
NO_COMMAND = SavedCommand(
    force=0.0, used_force=0.0, asked_force=0.0, pending=(), drum_start=0.0, off_time=0.0
)


class ActuatorReading(NamedTuple):
    """Force, travel and logged channel of an actuator."""

    force: float  #: at the fork, N
    travel: float  #: of the fork, m
    channel: float  #: pressure above the ambient one, Pa, or current, A; 0 without a channel


class CommandedActuator:
    """Actuator of a clutch with its present command."""

    def __init__(self, clutch: Clutch, actuator: Actuator, course: CommandCourse) -> None:
        self.actuator = actuator
        self._clutch = clutch
        self._course = course
        self._command = NO_COMMAND

    @property
    def is_used(self) -> bool:
        """Whether the command was on before."""
        return self._command.used_force > 0.0

    def ask(self, time: float, force: float) -> None:
        """Ask for a static force in N from a time in s on; the dead time comes after it."""
        command = self._command
        if force == command.asked_force:
            return
        change = CommandChange(time + self._course.delay, force)
        self._command = command._replace(asked_force=force, pending=(*command.pending, change))

    def next_change(self) -> float:
        """Return the time of the next change, s; infinity without one."""
        pending = self._command.pending
        return pending[0].time if pending else math.inf

    def apply_changes(self, time: float, numbers: np.record, state: Array) -> None:
        """Write the commands that are due at a time in s into numbers and state of a shift."""
        while self.next_change() <= time:
            change, *pending = self._command.pending
            self._command = self._command._replace(pending=tuple(pending))
            self._switch(time, change.force, numbers, state)

    def _switch(self, time: float, force: float, numbers: np.record, state: Array) -> None:
        """Switch to a static force in N at a time in s."""
        command = self._command
        was_used = self.is_used
        if self._course.profile(force) is not None:
            if command.force == 0.0:  # the drum goes on from where it stopped
                drum_start = command.drum_start + time - command.off_time
                command = command._replace(drum_start=drum_start)
            self._command = command._replace(force=force, used_force=force)
        elif command.force > 0.0:
            self._command = command._replace(force=0.0, off_time=time)
        if not self.is_used:
            return
        stored = state[ACTUATOR_LEVEL] * self.actuator.level_unit(numbers["actuator"])
        self.write(numbers)
        state[ACTUATOR_LEVEL] = stored / self.actuator.level_unit(numbers["actuator"])
        if not was_used:
            state[ACTUATOR_LEVEL] = self.actuator.initial_level(force)

    def write(self, numbers: np.record) -> None:
        """Write the actuator at its present command into the numbers of a shift."""
        command = self._command
        profile = self._course.profile(command.used_force)
        if profile is None:
            return
        actuator_numbers = self._clutch.shift_numbers(profile)["actuator"]
        actuator_numbers["dwell_time"] += command.drum_start
        if command.force == 0.0:
            self.actuator.switch_off(actuator_numbers)
        numbers["actuator"] = actuator_numbers

    def reading(self, time: float, state: Array, numbers: np.record) -> ActuatorReading:
        """Compute force, travel and channel at a time in s and a state, (14,)."""
        place, rate = DISPLACEMENT, AXIAL_SPEED
        if numbers["has_linkage"]:
            place, rate = ACTUATOR_DISPLACEMENT, ACTUATOR_SPEED
        travel = float(state[place])
        if not self.is_used:
            return ActuatorReading(force=0.0, travel=travel, channel=0.0)
        actuator_numbers = numbers["actuator"]
        level = float(state[ACTUATOR_LEVEL])
        force = kernel.actuator_force(
            time,
            travel,
            float(state[rate]),
            float(state[SPINDLE_TRAVEL]),
            level,
            actuator_numbers,
        )
        channel = 0.0
        if self.actuator.logged_key:
            used_force = self._command.used_force
            profile = self._course.profile(used_force)
            assert profile is not None
            used_numbers = self._clutch.shift_numbers(profile)["actuator"]
            unit = self.actuator.level_unit(actuator_numbers)
            used_level = level * unit / self.actuator.level_unit(used_numbers)
            channel = float(self.actuator.channel(np.array(used_level), used_force))
        return ActuatorReading(force=float(force), travel=travel, channel=channel)

    def save(self) -> SavedCommand:
        """Copy the command."""
        return self._command

    def restore(self, saved: SavedCommand) -> None:
        """Go to a command of ``save``."""
        pending = tuple(CommandChange(*change) for change in saved.pending)
        self._command = saved._replace(pending=pending)
