r"""Time series of a shift, worked out from the states of the run.

Contact forces follow from what the sliding ring does, by balance of momentum: along the shaft the
shift force lost to the contact, about it the torque that its speed shows. Each is the mean over the
step that ends at its time. Along the shaft, with masses and forces as in ``sim.shift.mechanism``,

.. math:: \int F_c = \int F - m_s \Delta\dot x - m_a \Delta\dot y - c \Delta x - \int \left(R
   + D + \mu_s \frac{|T|}{r_s} \sigma\right).

The linkage's force is inner and drops out; the integral of the shift force is known in closed
form. The others are smooth over a step: Simpson's rule, with the state in its middle from the
cubic through both ends. About the shaft, :math:`\int M_c = J_1 \Delta\omega + \int M_0 \sigma`. The
torque of a shaft between ring and rest is inner as well: then :math:`J_1 \Delta\omega` is the sum
of both.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from dogshape.sim.shift.actuation import ForceProfile
from dogshape.sim.shift.clutch import Clutch, OperatingPoint
from dogshape.sim.shift.mechanism import Shaft

Series = NDArray[np.float64]


def contact_means(
    clutch: Clutch, profile: ForceProfile, time: Series, state: Series
) -> tuple[Series, Series]:
    """Return axial force against the shift in N and torque on the sliding ring in N m.

    Means over the n - 1 steps between times in s, (n,); ``state`` (n, 6), (n, 8) or (n, 12) as for
    ``sim.shift.conclusion.Run``.
    """
    rings, mechanism, steps = clutch.rings, clutch.mechanism, np.diff(time)
    shaft = mechanism.input_side(rings.sliding_inertia)
    if shaft is None:
        torque = rings.sliding_inertia * np.diff(state[:, 5]) / steps
    else:
        torque = (shaft.near * np.diff(state[:, 5]) + shaft.far * np.diff(state[:, 9])) / steps
    if not (mechanism.has_forces or mechanism.damping):
        mass = mechanism.sleeve_mass(rings.mass)
        lost = np.diff(profile.free_speed(time, mass)) - np.diff(state[:, 4])
        return mass * lost / steps, torque
    middle = _middles(state, steps)
    held_at = 9 if mechanism.ring_inertia > 0.0 else 5
    parts = (state[:-1], middle, state[1:])
    torque = torque + _simpson([mechanism.drag(part[:, held_at]) for part in parts])
    # What the rule leaves of a drag torque is no contact.
    torque = np.where(np.abs(torque) < 0.01 * mechanism.drag_torque, 0.0, torque)
    share = mechanism.spline_share(rings.mass, clutch.dog.mean_radius, rings.sliding_inertia)
    momentum = mechanism.sleeve_mass(rings.mass) * np.diff(state[:, 4])
    if mechanism.has_linkage:
        momentum += mechanism.actuator_mass(rings.mass) * np.diff(state[:, 7])
    given = np.diff(profile.free_speed(time, 1.0)) - mechanism.damping * np.diff(state[:, 1])
    held = [
        mechanism.resistance(
            part[:, 1], part[:, 4], share * torque if shaft is None else _through(shaft, part)
        )
        for part in parts
    ]
    moved = np.diff(state[:, 1]) != 0.0  # at rest friction holds the shift force, whatever it is
    return np.where(moved, (given - momentum) / steps - _simpson(held), 0.0), torque


def shaft_torques(clutch: Clutch, state: Series) -> tuple[Series | None, Series | None]:
    """Return the shafts' torques on sliding and output ring, N m, (n,); None for rigid ones."""
    mechanism, rings = clutch.mechanism, clutch.rings
    near = mechanism.input_side(rings.sliding_inertia)
    far = mechanism.output_side(rings.output_inertia)
    return (
        None if near is None else _through(near, state),
        None if far is None else far.torque(state[:, 10] - state[:, 0], state[:, 11] - state[:, 3]),
    )


def _through(shaft: Shaft, state: Series) -> Series:
    return shaft.torque(state[:, 8] - state[:, 2], state[:, 9] - state[:, 5])


def _middles(state: Series, steps: Series) -> Series:
    """Return states in the middle of each step, by the cubic through both ends."""
    step = steps[:, None]
    middle = np.empty_like(state[1:])
    pairs = [(0, 3), (1, 4), (2, 5), (6, 7), (8, 9), (10, 11)]
    known = [pair for pair in pairs if pair[1] < state.shape[1]]
    places, rates = (list(columns) for columns in zip(*known, strict=True))
    (x0, v0), (x1, v1) = ((s[:, places], s[:, rates]) for s in (state[:-1], state[1:]))
    middle[:, places] = 0.5 * (x0 + x1) + 0.125 * step * (v0 - v1)
    middle[:, rates] = 1.5 * (x1 - x0) / step - 0.25 * (v0 + v1)
    return middle


def _simpson(values: list[Series]) -> Series:
    start, middle, end = values
    return (start + 4.0 * middle + end) / 6.0


@dataclass(frozen=True)
class Trace:
    """Time series of a shift, each (n,), SI units.

    ``contact_force`` is the axial one, positive against the shift.
    ``tangential_force`` acts on the sliding ring at the mean radius, positive
    where the output ring drives it. Both are of the whole ring. ``actuator_displacement``
    and its rate are those of the ring unless there is a linkage. ``input_torque`` and
    ``output_torque`` are those of the shafts on their rings, ``input_speed`` and
    ``output_far_speed`` of what is behind; None for rigid shafts.
    """

    time: Series
    displacement: Series
    axial_speed: Series
    sliding_speed: Series
    output_speed: Series
    relative_angle: Series
    shift_force: Series
    contact_force: Series
    tangential_force: Series
    actuator_displacement: Series
    actuator_speed: Series
    input_torque: Series | None = None
    output_torque: Series | None = None
    input_speed: Series | None = None
    output_far_speed: Series | None = None

    @cached_property
    def steps(self) -> Series:
        """Time since the step before, s, (n,); 0 at the start."""
        return np.concatenate([[0.0], self.time[1:] - self.time[:-1]])

    @property
    def relative_speed(self) -> Series:
        """Output less sliding speed, rad/s, (n,); at the start it is the mismatch."""
        return self.output_speed - self.sliding_speed


def trace_of(
    clutch: Clutch,
    point: OperatingPoint,
    times: Sequence[float] | Series,
    states: Sequence[Series] | Series,
) -> Trace:
    """Return the trace of a run.

    Parameters
    ----------
    times : s, (n,); a time that does not grow is left out.
    states : as ``sim.shift.conclusion.Run`` has them.
    """
    time, state = np.array(times), np.array(states)
    keep = np.concatenate([[True], time[1:] > time[:-1]])
    if not keep.all():
        time, state = time[keep], state[keep]
    mean_force, torque = contact_means(clutch, point.profile, time, state)
    far = state[:, 6:8] if clutch.mechanism.has_linkage else state[:, [1, 4]]
    shafts = shaft_torques(clutch, state)
    return Trace(
        time=time,
        displacement=state[:, 1],
        axial_speed=state[:, 4],
        sliding_speed=state[:, 5],
        output_speed=state[:, 3],
        relative_angle=state[:, 0] - state[:, 2],
        shift_force=point.profile.at(time),
        contact_force=np.concatenate([[0.0], mean_force]),
        tangential_force=np.concatenate([[0.0], torque / clutch.dog.mean_radius]),
        actuator_displacement=far[:, 0],
        actuator_speed=far[:, 1],
        input_torque=shafts[0],
        output_torque=shafts[1],
        input_speed=None if shafts[0] is None else state[:, 9],
        output_far_speed=None if shafts[1] is None else state[:, 11],
    )


def crossing(time: Series, displacement: Series, speed: Series, way: float) -> float | None:
    """Find the time at which a displacement first reaches ``way``, s; None where it never does.

    Where the first state is there already, that is its time. Cubic between the two states
    (Hermite), solved by bisection. Series (n,).
    """
    reached = displacement >= way
    last = int(np.argmax(reached))
    if not reached[last]:
        return None
    if last == 0:
        return float(time[0])
    pair = slice(last - 1, last + 1)
    # Plain numbers: the same arithmetic in a fraction of the time.
    (t0, t1), (x0, x1), (v0, v1) = (s[pair].tolist() for s in (time, displacement, speed))
    step = t1 - t0
    low, high = 0.0, 1.0
    for _ in range(50):
        s = 0.5 * (low + high)
        x = (
            (1 + 2 * s) * (1 - s) ** 2 * x0
            + s * (1 - s) ** 2 * step * v0
            + s * s * (3 - 2 * s) * x1
            + s * s * (s - 1) * step * v1
        )
        low, high = (low, s) if x >= way else (s, high)
    end: float = t0 + 0.5 * (low + high) * step
    return end
