r"""Time series of a shift, worked out from the states of the run.

Contact forces follow from the motion by balance of momentum, each the mean over the step that ends
at its time. Along the shaft, with masses and forces as in ``sim.shift.mechanism``,

.. math:: \int F_c = \int F - m_s \Delta\dot x - m_a \Delta\dot y - c \Delta x - \int \left(R
   + D + \mu_s \frac{|T|}{r_s} \sigma\right).

The integral of the shift force is known in closed form; the others are smooth over a step:
Simpson's rule, with the middle from the cubic through both ends. About the shaft, :math:`\int M_c =
J_1 \Delta\omega + \int M_0 \sigma`, of ring and rest together where a shaft gives way.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from dogshape.sim.shift.actuation import ForceProfile
from dogshape.sim.shift.clutch import Clutch
from dogshape.sim.shift.mechanism import Shaft

Series = NDArray[np.float64]
Place = TypeVar("Place", float, NDArray[np.float64])  #: a number or (n,)


def contact_means(
    clutch: Clutch, profile: ForceProfile, time: Series, state: Series
) -> tuple[Series, Series]:
    """Return axial force against the shift in N and torque on the sliding ring in N m.

    Means over the n - 1 steps between times in s, (n,); ``state`` as ``sim.shift.conclusion.Run``
    has it.
    """
    rings, mechanism, steps = clutch.rings, clutch.mechanism, np.diff(time)
    shaft, _ = clutch.shafts
    if shaft is None:
        torque = rings.sliding_inertia * np.diff(state[:, 5]) / steps
    else:
        torque = (shaft.near * np.diff(state[:, 5]) + shaft.far * np.diff(state[:, 9])) / steps
    sleeve = mechanism.sleeve_mass(rings.mass)
    if not (mechanism.has_forces or mechanism.damping):
        lost = np.diff(profile.free_speed(time, sleeve)) - np.diff(state[:, 4])
        return sleeve * lost / steps, torque
    parts = (state[:-1], _middles(state, steps), state[1:])
    dragged = 5 if shaft is None else 9
    torque = torque + _simpson([mechanism.drag(part[:, dragged]) for part in parts])
    # What the rule leaves of a drag torque is no contact.
    torque = np.where(np.abs(torque) < 0.01 * mechanism.drag_torque, 0.0, torque)
    momentum = sleeve * np.diff(state[:, 4])
    if mechanism.has_linkage:
        momentum += mechanism.actuator_mass(rings.mass) * np.diff(state[:, 7])
    given = np.diff(profile.free_speed(time, 1.0)) - mechanism.damping * np.diff(state[:, 1])
    share = mechanism.spline_share(rings.mass, clutch.dog.mean_radius, rings.sliding_inertia)
    through = [share * torque] * 3 if shaft is None else [_torque(shaft, part) for part in parts]
    held = [
        mechanism.resistance(part[:, 1], part[:, 4], pressing)
        for part, pressing in zip(parts, through, strict=True)
    ]
    moved = np.diff(state[:, 1]) != 0.0  # at rest friction holds the shift force, whatever it is
    return np.where(moved, (given - momentum) / steps - _simpson(held), 0.0), torque


def _torque(shaft: Shaft, state: Series) -> Series:
    """Return the torque of the sliding ring's shaft, N m, (n,)."""
    return shaft.torque(state[:, 8] - state[:, 2], state[:, 9] - state[:, 5])


def _middles(state: Series, steps: Series) -> Series:
    """Return states in the middle of each step, by the cubic through both ends."""
    places, rates = [0, 1, 2, 6, 8, 10], [3, 4, 5, 7, 9, 11]
    step, middle = steps[:, None], np.empty_like(state[1:])
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


_COLUMNS = {"displacement": 1, "axial_speed": 4, "sliding_speed": 5, "output_speed": 3}


def trace_of(clutch: Clutch, profile: ForceProfile, times: Series, states: Series) -> Trace:
    """Return the trace of a run; a time in s that does not grow is left out.

    Parameters
    ----------
    times, states : as ``sim.shift.conclusion.Run`` has them.
    """
    keep = np.concatenate([[True], times[1:] > times[:-1]])
    time, state = times[keep], states[keep]
    mean_force, torque = contact_means(clutch, profile, time, state)
    far = state[:, 6:8] if clutch.mechanism.has_linkage else state[:, [1, 4]]
    near, output = clutch.shafts
    behind: dict[str, Series] = {}
    if near is not None:
        behind |= {"input_torque": _torque(near, state), "input_speed": state[:, 9]}
    if output is not None:
        torque_out = output.torque(state[:, 10] - state[:, 0], state[:, 11] - state[:, 3])
        behind |= {"output_torque": torque_out, "output_far_speed": state[:, 11]}
    return Trace(
        time=time,
        **{name: state[:, column] for name, column in _COLUMNS.items()},
        relative_angle=state[:, 0] - state[:, 2],
        shift_force=profile.at(time),
        contact_force=np.concatenate([[0.0], mean_force]),
        tangential_force=np.concatenate([[0.0], torque / clutch.dog.mean_radius]),
        actuator_displacement=far[:, 0],
        actuator_speed=far[:, 1],
        **behind,
    )


def cubic(s: Place, step: Place, start: tuple[Place, Place], end: tuple[Place, Place]) -> Place:
    """Evaluate the cubic between two places with rates, a ``step`` in s apart, at its share *s*."""
    t = 1 - s
    return (
        (1 + 2 * s) * t**2 * start[0]
        + s * t**2 * step * start[1]
        + s * s * (3 - 2 * s) * end[0]
        + s * s * (s - 1) * step * end[1]
    )


def crossing(time: Series, displacement: Series, speed: Series, way: float) -> float | None:
    """Find the time in s at which a displacement first reaches ``way``; None where it never does.

    Where the first state is there already, that is its time; between two states it is on the cubic.
    Series (n,).
    """
    reached = displacement >= way
    last = int(np.argmax(reached))
    if not reached[last]:
        return None
    if last == 0:
        return float(time[0])
    # Plain numbers: the same arithmetic in a fraction of the time.
    (t0, t1), (x0, x1), (v0, v1) = (
        s[last - 1 : last + 1].tolist() for s in (time, displacement, speed)
    )
    low, high = 0.0, 1.0
    for _ in range(50):
        s = 0.5 * (low + high)
        there = cubic(s, t1 - t0, (x0, v0), (x1, v1)) >= way
        low, high = (low, s) if there else (s, high)
    end: float = t0 + 0.5 * (low + high) * (t1 - t0)
    return end
