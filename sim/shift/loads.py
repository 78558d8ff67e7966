r"""Loads of a shift that a designer needs.

The rings are rigid behind the stiffness of the dogs. Impulses and energies follow from momenta;
peak forces go with :math:`\sqrt{k m}` and are estimates (``benchmarks/impact_force.py``).

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

from dogshape.sim.shift.clutch import Clutch
from dogshape.sim.shift.trace import Trace

#: Lower ends of the classes of overlap, m; the last has no upper end.
OVERLAPS = (*(i * 1e-4 for i in range(20)), 2e-3, 3e-3)


@dataclass(frozen=True)
class Landing:
    """Dog on dog, all dogs alike: largest load per length of the dogs, N/m, for each class of
    overlap in ``OVERLAPS``.
    """

    line_loads: tuple[float, ...] = (0.0,) * len(OVERLAPS)


@dataclass(frozen=True)
class Loads:
    """Loads of a shift, of the whole ring.

    Parameters
    ----------
    peak_axial_force : largest axial contact force, N.
    peak_tangential_force : largest tangential contact force at the mean radius, N.
    impact_impulse : largest impulse (axial and tangential as a vector) within any
        millisecond that the contact gives beyond holding the shift force, N s.
    energy_dissipated : energy that the contact took, by balance, J: what is left
        in the compressed dogs at the end included, and what a mechanism took.
    strike_mismatch : largest change of the relative speed that the contact makes within any
        millisecond, rad/s: what the hardest strike takes of the mismatch.
    residual_mismatch : relative speed with which the flanks close for good, at the
        start of seating, rad/s, signed; None where none closed. Flanks that struck and
        flew off before show in the impulse and in ``strike_mismatch``.
    input_torque, output_torque : largest of the shafts on their rings, N m; None for rigid ones.
    landing : what faces and edges bore.
    """

    peak_axial_force: float
    peak_tangential_force: float
    impact_impulse: float
    energy_dissipated: float
    strike_mismatch: float
    residual_mismatch: float | None
    input_torque: float | None
    output_torque: float | None
    landing: Landing


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
