r"""Time series of a shift, worked out from the states of the run, and the torque of its driveline.

*Driveline* of torsional stiffness *c* between two inertias at rest, driven by the contact's torque
*M* on the sliding ring; its torque is Duhamel's integral (Rao, *Mechanical Vibrations*, 4.5),

.. math:: T(t) = \omega \int_0^t M(\tau) \sin \omega(t - \tau)\,d\tau, \qquad \omega = \sqrt{c/J},
   \quad J = J_1 J_2/(J_1 + J_2), \qquad \text{exact for the mean of M over each step.}

What mismatch is left at the end strikes once more. Nothing damps the swing.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dogshape.sim.shift.actuation import ForceProfile
from dogshape.sim.shift.clutch import Clutch

Series = NDArray[np.float64]


@dataclass(frozen=True)
class Trace:
    """Time series of a shift, each (n,), SI units; forces are of the whole ring."""

    time: Series
    displacement: Series
    axial_speed: Series
    sliding_speed: Series
    output_speed: Series
    relative_angle: Series
    shift_force: Series
    contact_force: Series  #: axial, positive against the shift
    tangential_force: (
        Series  #: at the mean radius, positive where the output drives the sliding ring
    )
    actuator_displacement: Series  #: that of the ring unless there is a linkage, as is its rate
    actuator_speed: Series
    input_torque: Series | None = None  #: of the shaft on its ring; None for a rigid one
    output_torque: Series | None = None
    input_speed: Series | None = None  #: of what is behind the shaft
    output_far_speed: Series | None = None

    @property
    def relative_speed(self) -> Series:
        """Output less sliding speed, rad/s, (n,); at the start it is the mismatch."""
        return self.output_speed - self.sliding_speed


_COLUMNS = {"displacement": 1, "axial_speed": 4, "sliding_speed": 5, "output_speed": 3}


def trace_of(clutch: Clutch, profile: ForceProfile, time: Series, state: Series) -> Trace:
    """Return the trace of a run, times and states as ``sim.shift.conclusion.Run`` has them."""
    from dogshape.sim import kernel  # noqa: PLC0415  slow to load, and results have no need of it

    push, given = kernel.shift_force(time, profile.knots)
    force, torque = kernel.contact_means(time, state, given, clutch.numbers)
    far = state[:, 6:8] if clutch.mechanism.has_linkage else state[:, [1, 4]]
    near, output = clutch.shafts
    behind: dict[str, Series] = {}
    if near is not None:
        torque_in = near.torque(state[:, 8] - state[:, 2], state[:, 9] - state[:, 5])
        behind |= {"input_torque": torque_in, "input_speed": state[:, 9]}
    if output is not None:
        torque_out = output.torque(state[:, 10] - state[:, 0], state[:, 11] - state[:, 3])
        behind |= {"output_torque": torque_out, "output_far_speed": state[:, 11]}
    return Trace(
        time=time,
        **{name: state[:, column] for name, column in _COLUMNS.items()},
        relative_angle=state[:, 0] - state[:, 2],
        shift_force=push,
        contact_force=force,
        tangential_force=torque / clutch.dog.mean_radius,
        actuator_displacement=far[:, 0],
        actuator_speed=far[:, 1],
        **behind,
    )


def torque_peak(clutch: Clutch, trace: Trace, stiffness: float) -> float:
    """Compute the largest torque in N m of a driveline of ``stiffness`` in N m/rad in a shift."""
    inertia = clutch.rings.reduced_inertia
    rate = math.sqrt(stiffness / inertia)
    torque = trace.tangential_force[1:] * clutch.dog.mean_radius
    turns = rate * (trace.time - trace.time[0])
    back = np.exp(-1j * turns)
    pushes = torque * (back[:-1] - back[1:]) / 1j
    # T is the imaginary part of the state and its rate over that of the swing the real one.
    state = np.concatenate([[0.0], np.cumsum(pushes)]) / back
    ahead, swing = state.imag[:-1] - torque, np.hypot(state.imag[:-1] - torque, state.real[:-1])
    crest = np.arctan2(state.real[:-1], ahead) % (2.0 * math.pi)
    trough = (crest + math.pi) % (2.0 * math.pi)
    within = np.diff(turns)
    turning = ((crest, torque + swing), (trough, torque - swing))
    largest = [np.abs(np.where(place <= within, value, 0.0)) for place, value in turning]
    engaged = bool((trace.displacement >= clutch.shift_travel).any())
    last = inertia * float(trace.relative_speed[-1]) * rate if engaged else 0.0
    return float(max(np.abs(state.imag).max(), *map(np.max, largest), abs(state[-1] + last)))
