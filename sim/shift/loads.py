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
from dogshape.sim.shift.events import Flags, Phase, face_overlap
from dogshape.sim.shift.trace import Series, Trace

IMPACT = 1e-3  #: s, the window over which the impulse of an impact is taken
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
    landing : what faces and edges bore.
    """

    peak_axial_force: float
    peak_tangential_force: float
    impact_impulse: float
    energy_dissipated: float
    strike_mismatch: float
    residual_mismatch: float | None
    landing: Landing


def loads_of(clutch: Clutch, trace: Trace, faces: Flags, seating: Phase) -> Loads:
    """Return the loads of a shift; ``faces`` marks steps with a face on a face, (n,)."""
    before = max(0, int(np.searchsorted(trace.time, seating.start)) - 1)
    closed = seating.end > seating.start
    pressed = _within_impact(trace, np.maximum(trace.contact_force - trace.shift_force, 0.0))
    turned = _within_impact(trace, trace.tangential_force)
    struck = float(np.abs(turned).max()) * clutch.dog.mean_radius
    return Loads(
        peak_axial_force=float(trace.contact_force.max()),
        peak_tangential_force=float(np.abs(trace.tangential_force).max()),
        impact_impulse=float(np.hypot(pressed, turned).max()),
        energy_dissipated=float(energy_lost(clutch, trace)[-1]),
        strike_mismatch=struck / clutch.rings.reduced_inertia,
        residual_mismatch=float(trace.relative_speed[before]) if closed else None,
        landing=_dog_on_dog(clutch, trace, faces),
    )


def _dog_on_dog(clutch: Clutch, trace: Trace, faces: Flags) -> Landing:
    """Return the largest load of faces while the force is more axial than tangential."""
    dog = clutch.dog
    landed = faces & (trace.contact_force > np.abs(trace.tangential_force))
    load = trace.contact_force[landed] / (dog.count * dog.radial_width)
    overlap, most = face_overlap(clutch, trace.relative_angle[landed])
    # Past the middle the braking edge parts the faces.
    classes = np.searchsorted(OVERLAPS, np.minimum(overlap, most - overlap), side="right") - 1
    largest = np.zeros(len(OVERLAPS))
    np.maximum.at(largest, classes, load)
    return Landing(tuple(largest.tolist()))


def _within_impact(trace: Trace, force: Series) -> Series:
    """Return the impulse of a force (n,) over an impact's length from each time on, N s, (n,)."""
    impulse = np.cumsum(force * trace.steps)
    gained: Series = np.interp(trace.time + IMPACT, trace.time, impulse) - impulse
    return gained


def energy_lost(clutch: Clutch, trace: Trace) -> Series:
    """Return initial energy and work of the shift force less kinetic energy, J, (n,).

    What a mechanism took is in it, and what shafts store.
    """
    rings, mechanism = clutch.rings, clutch.mechanism
    twice = (
        mechanism.sleeve_mass(rings.mass) * trace.axial_speed**2
        + mechanism.actuator_mass(rings.mass) * trace.actuator_speed**2
    )
    for shaft, whole, near, far in (
        (clutch.shafts[0], rings.sliding_inertia, trace.sliding_speed, trace.input_speed),
        (clutch.shafts[1], rings.output_inertia, trace.output_speed, trace.output_far_speed),
    ):
        if shaft is None or far is None:
            twice = twice + whole * near**2
        else:
            twice = twice + shaft.near * near**2 + shaft.far * far**2
    kinetic = 0.5 * twice
    mean_force = 0.5 * (trace.shift_force[1:] + trace.shift_force[:-1])
    work = np.concatenate([[0.0], np.cumsum(mean_force * np.diff(trace.actuator_displacement))])
    lost: Series = kinetic[0] + work - kinetic
    return lost


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
