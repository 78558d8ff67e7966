r"""The time before the sliding ring moves: friction holds it, and the linkage is loaded.

While friction :math:`R_0` alone holds the ring, nothing happens at it. Without a linkage it is let
go when the shift force reaches :math:`R_0`. With one the actuator moves against a ring at rest,
:math:`m_a \ddot y = F(t) - L(y, \dot y)`, until :math:`L = R_0`. Both are found here, since a
friction law that is nearly a jump costs a solver of the whole motion thousands of steps to
stand still.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from dogshape.sim.shift.actuation import ForceProfile
from dogshape.sim.shift.clutch import Clutch

LATEST_RELEASE = (
    0.99  #: share of the time-out from which on a ring that was never let go is looked at
)


@dataclass(frozen=True)
class Release:
    """Times in s up to when the ring is let go, with displacement (m) and speed of the actuator.

    Each (n,); the last is where the motion of both rings begins.
    """

    time: NDArray[np.float64]
    displacement: NDArray[np.float64]
    speed: NDArray[np.float64]


@lru_cache(maxsize=64)  # shifts differ by their angle alone
def release(clutch: Clutch, profile: ForceProfile) -> Release:
    """Find the time at which friction lets the ring go; at once where it need not hold."""
    mechanism = clutch.mechanism
    held = mechanism.friction > 0.0 and mechanism.resistance(0.0, 0.0, 0.0) == 0.0
    slows = clutch.rings.initial_speed != 0.0 and mechanism.drag_torque > 0.0
    if not held or slows:
        return Release(*np.zeros((3, 1)))
    if mechanism.has_linkage:
        return _loaded(clutch, profile)
    low, high = 0.0, LATEST_RELEASE * clutch.timeout
    if profile.at(high) < mechanism.friction:
        low = high
    while high - low > 1e-6:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if profile.at(middle) < mechanism.friction else (low, middle)
    return Release(np.array([0.0, low]), np.zeros(2), np.zeros(2))


def _loaded(clutch: Clutch, profile: ForceProfile) -> Release:
    """Move the actuator against the ring at rest until the linkage pulls it loose."""
    mechanism, mass = clutch.mechanism, clutch.rings.mass
    linkage, far = mechanism.linkage(mass), mechanism.actuator_mass(mass)

    def motion(time: float, state: NDArray[np.float64]) -> list[float]:
        way, speed = map(float, state)
        return [speed, (float(profile.at(time)) - mechanism.pull(way, speed, *linkage)) / far]

    def loose(_: float, state: NDArray[np.float64]) -> float:
        way, speed = map(float, state)
        return float(mechanism.pull(way, speed, *linkage)) - mechanism.friction

    loose.terminal = True  # type: ignore[attr-defined]
    span = (0.0, LATEST_RELEASE * clutch.timeout)
    run = solve_ivp(
        motion, span, [0.0, 0.0], events=loose, rtol=1e-5, atol=1e-9, max_step=0.01 * span[1]
    )
    return Release(run.t, *run.y)
