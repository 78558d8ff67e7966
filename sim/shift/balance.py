r"""Contact force of the dogs in each step of a run, by balance of momentum.

Along the shaft, with masses and forces as in ``sim.shift.mechanism``,

.. math:: \int F_c = \int F - m_s \Delta\dot x - m_a \Delta\dot y - c \Delta x - \int \left(R
   + D + \mu_s \frac{|T|}{r_s} \sigma\right).

The linkage's force is inner and drops out; the integral of the shift force is known in closed
form. The others are smooth over a step: Simpson's rule, with the state in its middle from the
cubic through both ends. About the shaft, :math:`\int M_c = J_1 \Delta\omega + \int M_0 \sigma`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dogshape.sim.shift.actuation import ForceProfile
from dogshape.sim.shift.clutch import Clutch

Series = NDArray[np.float64]


def contact_means(
    clutch: Clutch, profile: ForceProfile, time: Series, state: Series
) -> tuple[Series, Series]:
    """Return axial force against the shift in N and torque on the sliding ring in N m.

    Means over the n - 1 steps between times in s, (n,); ``state`` (n, 6) or (n, 8) as for
    ``sim.shift.trace``.
    """
    rings, mechanism, steps = clutch.rings, clutch.mechanism, np.diff(time)
    gained = np.diff(state[:, 5])
    torque = rings.sliding_inertia * gained / steps
    if not (mechanism.has_forces or mechanism.damping):
        mass = mechanism.sleeve_mass(rings.mass)
        lost = np.diff(profile.free_speed(time, mass)) - np.diff(state[:, 4])
        return mass * lost / steps, torque
    middle = _middles(state, steps)
    torque = _turning(clutch, torque, state, middle)
    share = mechanism.spline_share(rings.mass, clutch.dog.mean_radius, rings.sliding_inertia)
    momentum = mechanism.sleeve_mass(rings.mass) * np.diff(state[:, 4])
    if mechanism.has_linkage:
        momentum += mechanism.actuator_mass(rings.mass) * np.diff(state[:, 7])
    given = np.diff(profile.free_speed(time, 1.0)) - mechanism.damping * np.diff(state[:, 1])
    held = [
        mechanism.resistance(part[:, 1], part[:, 4], share * torque)
        for part in (state[:-1], middle, state[1:])
    ]
    moved = np.diff(state[:, 1]) != 0.0  # at rest friction holds the shift force, whatever it is
    return np.where(moved, (given - momentum) / steps - _simpson(held), 0.0), torque


def _turning(clutch: Clutch, gained: Series, state: Series, middle: Series) -> Series:
    """Return the mean torque of the contact from what turned the ring, N m, (n - 1,)."""
    mechanism = clutch.mechanism
    held = _simpson([mechanism.drag(p[:, 5]) for p in (state[:-1], middle, state[1:])])
    torque = gained + held
    # What the rule leaves of a drag torque is no contact.
    return np.where(np.abs(torque) < 0.01 * mechanism.drag_torque, 0.0, torque)


def _middles(state: Series, steps: Series) -> Series:
    """Return positions and speeds in the middle of each step, (n - 1, 6), by the cubic."""
    before, after = state[:-1, :6], state[1:, :6]
    step = steps[:, None]
    (x0, v0), (x1, v1) = ((s[:, :3], s[:, 3:]) for s in (before, after))
    way = 0.5 * (x0 + x1) + 0.125 * step * (v0 - v1)
    speed = 1.5 * (x1 - x0) / step - 0.25 * (v0 + v1)
    return np.hstack([way, speed])


def _simpson(values: list[Series]) -> Series:
    """Return the mean over a step from values at its start, middle and end."""
    start, middle, end = values
    return (start + 4.0 * middle + end) / 6.0
