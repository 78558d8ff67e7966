"""Time series of a shift, worked out from the states of the run.

Contact forces follow from what the sliding ring does: along the shaft the shift
force lost to the contact, about it the torque that its speed shows. Each is the
mean over the step that ends at its time. What a mechanism takes is balanced out
(``sim.shift.balance``).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from dogshape.sim.shift.balance import contact_means, shaft_torques
from dogshape.sim.shift.clutch import Clutch, OperatingPoint

Series = NDArray[np.float64]


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
