r"""Shift force over time, and the free flight it gives.

The published force is a cubic step (Adams STEP), :math:`F(t) = F (3 s^2 - 2 s^3)`, :math:`s = t/T`
up to :math:`s = 1`, then constant. Through a lag of first order, :math:`\tau y' = F - y`, it is
with :math:`\theta = \tau/T` and :math:`y(0) = 0`, while the step rises,

.. math:: y/F = 3 (s^2 - 2 \theta s + 2 \theta^2) - 2 (s^3 - 3 \theta s^2 + 6 \theta^2 s
   - 6 \theta^3) - 6 \theta^2 (1 + 2 \theta) e^{-s/\theta},

and nears *F* as :math:`e^{-(t - T)/\tau}` afterwards. A mass that nothing touches has travelled
:math:`x = (F T^2/m)(s^4/4 - s^5/10)` within the step; with a lag, :math:`\int y = \int F - \tau y`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import KW_ONLY, dataclass
from functools import cached_property
from typing import TypeVar

import numpy as np

from dogshape.sim.elementwise import Array
from dogshape.sim.errors import InputError, Refusal, require_between
from dogshape.sim.quantity import quantities_of, quantity, record_quantities, require_ranges

Times = TypeVar("Times", float, Array)  #: one time, or (n,)
SMALLEST_FORCE = 1.0  #: N, of a shift force and of what reaches the sleeve of it
SMALLEST_LAG = 1e-5  #: s
SAME_RISE_S = 1e-9  #: difference up to which two rise times are the same


def cubic_step(share: Times, full: Times | float) -> Times:
    """Evaluate ``full`` (3 s^2 - 2 s^3) with s the ``share``, clipped to 0 to 1; one or (n,)."""
    s = np.clip(share, 0.0, 1.0)
    return full * s * s * (3.0 - 2.0 * s)


@dataclass(frozen=True)
class ForceProfile:
    """A shift force that rises as a cubic step; times of all methods count from its start."""

    force: float = quantity("force_N", SMALLEST_FORCE, 1e5, remedy="correct the force")  #: final, N
    rise: float = quantity("force_rise_s", 1e-4, 10.0)  #: s
    _: KW_ONLY
    #: dead time from the command to the start of the force, s
    delay: float = quantity("force_delay_s", 0.0, 10.0, 0.0)
    #: constant part that never reaches the sleeve, N; the rest rises in the time
    loss: float = quantity("force_loss_N", 0.0, 1e5, 0.0, remedy="give a smaller loss")
    #: time constant through which the force comes, s; 0 or at least ``SMALLEST_LAG``
    lag: float = quantity("force_lag_s", 0.0, 10.0, 0.0)

    def __post_init__(self) -> None:
        remedy = "give it in seconds"
        require_ranges(self, "", remedy)
        if self.lag:
            require_between("force_lag_s", self.lag, SMALLEST_LAG, 10.0, remedy)
        if self.loss > self.force - SMALLEST_FORCE:
            rule = f"it must leave {SMALLEST_FORCE:g} N or more of force_N = {self.force:.6g}"
            raise InputError(Refusal("force_loss_N", self.loss, "N", rule, "give a smaller loss"))

    @property
    def net_force(self) -> float:
        """Final force that reaches the sleeve, N."""
        return self.force - self.loss

    def at(self, time: Times) -> Times:
        """Compute the force at ``time`` in s after the start, N."""
        step = cubic_step(time / self.rise, self.net_force)
        if self.lag == 0.0:
            return step
        lag = self.lag / self.rise
        s = np.clip(time / self.rise, 0.0, 1.0)
        square = s * s - 2.0 * lag * s + 2.0 * lag**2
        cube = s**3 - 3.0 * lag * square
        free = 6.0 * lag**2 * (1.0 + 2.0 * lag) * np.exp(-s / lag)
        rising = self.net_force * (3.0 * square - 2.0 * cube - free)
        elapsed = np.maximum(0.0, time - self.rise) / self.lag
        return self.net_force - (self.net_force - rising) * np.exp(-elapsed)

    @cached_property
    def knots(self) -> Array:
        """Times in s, forces in N and their slopes in N/s, cubic in between, (3, n).

        The last force is constant from there on; a lag has its last knot 30 lags after the rise.
        """
        if self.lag == 0.0:
            return np.array([[0.0, self.rise], [0.0, self.net_force], [0.0, 0.0]])
        start_times = self.lag * np.linspace(0.0, 12.0, 49)
        rise_times = np.linspace(0.0, self.rise, 65)
        end_times = self.rise + self.lag * np.linspace(0.0, 30.0, 121)
        start_times = start_times[start_times < self.rise]
        times = np.concatenate([start_times, rise_times, end_times])
        times = np.unique(np.round(times, 12))
        forces = self.at(times)
        slopes = (cubic_step(times / self.rise, self.net_force) - forces) / self.lag
        return np.array([times, forces, slopes])

    @property
    def record(self) -> dict[str, float]:
        """The profile as a flat record in the edge's units."""
        return {key: value for key, value in record_quantities(self).items() if value != 0.0}

    def free_flight(self, time: Times, mass: float) -> Times:
        """Compute the displacement of a free ``mass`` in kg at ``time`` in s, m."""
        s = np.clip(time / self.rise, 0.0, 1.0)
        rise_travel = self.net_force * self.rise**2 / mass * (s**4 / 4.0 - s**5 / 10.0)
        elapsed = np.maximum(0.0, time - self.rise)
        rise_speed = 0.5 * self.net_force * self.rise / mass
        travel: Times = (
            rise_travel + elapsed * rise_speed + 0.5 * self.net_force / mass * elapsed**2
        )
        if self.lag:
            return travel - self.lag * self.free_speed(time, mass)
        return travel

    def free_speed(self, time: Times, mass: float) -> Times:
        """Compute the speed of a free ``mass`` in kg at ``time`` in s, m/s."""
        s = np.clip(time / self.rise, 0.0, 1.0)
        rise_speed = self.net_force * self.rise / mass * (s**3 - s**4 / 2.0)
        elapsed = np.maximum(0.0, time - self.rise)
        speed: Times = rise_speed + self.net_force / mass * elapsed
        if self.lag:
            return speed - self.lag / mass * self.at(time)
        return speed

    def free_flight_time(self, way: float, mass: float) -> float:
        """Compute the time after which a free ``mass`` in kg has travelled ``way`` in m, s."""
        if way == 0.0:
            return 0.0
        # The way is convex in time, so Newton's steps come down to the root from any later time,
        # and an earlier one is later after a step. The way of the rise is at least
        # 0.15 (F T^2/m) s^4, which makes this guess a late one there, and one lag later with a lag.
        time = self.rise * (way * mass / (0.15 * self.net_force * self.rise**2)) ** 0.25
        time = step = time + self.lag
        while abs(step) > 1e-12 * time:
            step = (self.free_flight(time, mass) - way) / self.free_speed(time, mass)
            time -= step
        return float(time)


def recorded_profile(record: Mapping[str, float]) -> ForceProfile:
    """Build the profile that a flat record describes."""
    keys = {name: declared.key for name, declared in quantities_of(ForceProfile).items()}
    values = {name: record[key] for name, key in keys.items() if key in record}
    return ForceProfile(**values)


@dataclass(frozen=True)
class RiseTable:
    """Rise time of the shift force by its final value, linear in between."""

    forces: tuple[float, ...]  #: N, in any order
    rises: tuple[float, ...]  #: s, one for each force; another number of them raises InputError

    def __post_init__(self) -> None:
        if len(self.forces) != len(self.rises):
            raise InputError(
                f"actuation.force_N has {len(self.forces)} and actuation.rise_s "
                f"{len(self.rises)} values, but each force needs its rise time; "
                "give lists of equal length"
            )

    def covers(self, force: float) -> bool:
        """Decide whether a force in N lies within the table."""
        return min(self.forces) <= force <= max(self.forces)

    def rise(self, force: float) -> float:
        """Interpolate the rise time of a ``force`` in N, s; constant beyond the table."""
        rows = sorted(zip(self.forces, self.rises, strict=True))
        forces, rises = zip(*rows, strict=True)
        return float(np.interp(force, forces, rises))

    def profile(self, force: float, other_way: str = "") -> ForceProfile:
        """Build the force profile of a final ``force`` in N; InputError beyond the table.

        ``other_way`` is a further remedy for the message, such as an option of the verb.
        """
        if not force > 0.0:
            remedy = "give a positive force; the sign of a shift is that of the mismatch"
            rule = "it must point into engagement"
            raise InputError(Refusal("shift force", force, "N", rule, remedy))
        if not self.covers(force):
            low = min(self.forces)
            high = max(self.forces)
            rule = f"the rise times of the study cover {low:.6g} to {high:.6g} N"
            if low == high:
                rule = f"the study has a rise time for {low:.6g} N alone"
            remedy = "extend actuation.force_N and actuation.rise_s" + other_way
            raise InputError(Refusal("shift force", force, "N", rule, remedy))
        return ForceProfile(force, self.rise(force))

    def gives(self, profile: ForceProfile) -> bool:
        """Compare the rise of a profile with the table's."""
        if not self.covers(profile.force):
            return False
        return abs(self.profile(profile.force).rise - profile.rise) < SAME_RISE_S
