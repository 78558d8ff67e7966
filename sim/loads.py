r"""Loads of a shift that a designer needs.

The rings are rigid behind the stiffness of the dogs, so peak forces are upper
bounds; impulses and energies follow from the momenta and are not. A blow against the
stop behind the sliding ring is in the energy, not in forces and impulse.

A driveline of torsional stiffness *c* takes up what mismatch is left when the flanks
close: the output ring's inertia is taken as the vehicle's side behind that spring, so
both swing against each other as two
inertias on a spring, and with :math:`J = J_1 J_2/(J_1 + J_2)` the torque peaks at

.. math:: T = \Delta\omega \sqrt{c J}.

Dog on dog, while faces can meet and the force is more axial than tangential (on a flank it
is the other way round), it bears on dogs N b long that overlap by *L*. What that does to
face or edge depends on how far they are rounded, so the largest load per length is kept
for each class of overlap.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from sim.clutch import Clutch
from sim.phases import Phase, face_overlap, on_face
from sim.trace import Series, Trace

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
    residual_mismatch : relative speed with which the flanks close for good, at the
        start of seating, rad/s, signed; None where none closed. Flanks that struck and
        flew off before show in the impulse.
    landing : what faces and edges bore.
    """

    peak_axial_force: float
    peak_tangential_force: float
    impact_impulse: float
    energy_dissipated: float
    residual_mismatch: float | None
    landing: Landing


def loads_of(clutch: Clutch, trace: Trace, phases: tuple[Phase, ...]) -> Loads:
    """Return the loads of a shift."""
    seating = phases[-1]
    before = max(0, int(np.searchsorted(trace.time, seating.start)) - 1)
    closed = seating.end > seating.start
    return Loads(
        peak_axial_force=float(trace.contact_force.max()),
        peak_tangential_force=float(np.abs(trace.tangential_force).max()),
        impact_impulse=_hardest(trace),
        energy_dissipated=float(energy_lost(clutch, trace)[-1]),
        residual_mismatch=float(trace.relative_speed[before]) if closed else None,
        landing=_dog_on_dog(clutch, trace),
    )


def _dog_on_dog(clutch: Clutch, trace: Trace) -> Landing:
    dog = clutch.dog
    landed = on_face(clutch, trace) & (trace.contact_force > np.abs(trace.tangential_force))
    load = np.where(landed, trace.contact_force, 0.0) / (dog.count * dog.radial_width)
    overlap, most = face_overlap(clutch, trace.relative_angle)
    # Past the middle the braking edge parts the faces.
    classes = np.searchsorted(OVERLAPS, np.minimum(overlap, most - overlap), side="right") - 1
    return Landing(tuple(load[classes == i].max(initial=0.0).item() for i in range(len(OVERLAPS))))


def _hardest(trace: Trace) -> float:
    """Return the largest impulse within any window of the impact's length, N s."""
    steps = np.diff(trace.time, prepend=trace.time[0])
    ends = trace.time + IMPACT
    gained = []
    pressed = np.maximum(trace.contact_force - trace.shift_force, 0.0)
    for force in (pressed, trace.tangential_force):
        impulse = np.cumsum(force * steps)
        gained.append(np.interp(ends, trace.time, impulse) - impulse)
    return float(np.hypot(*gained).max())


def energy_lost(clutch: Clutch, trace: Trace) -> Series:
    """Return initial energy and work of the shift force less kinetic energy, J, (n,).

    What a mechanism took is in it.
    """
    rings, mechanism = clutch.rings, clutch.mechanism
    kinetic = 0.5 * (
        mechanism.sleeve_mass(rings.mass) * trace.axial_speed**2
        + mechanism.actuator_mass(rings.mass) * trace.actuator_speed**2
        + rings.sliding_inertia * trace.sliding_speed**2
        + rings.output_inertia * trace.output_speed**2
    )
    mean_force = 0.5 * (trace.shift_force[1:] + trace.shift_force[:-1])
    work = np.concatenate([[0.0], np.cumsum(mean_force * np.diff(trace.actuator_displacement))])
    lost: Series = kinetic[0] + work - kinetic
    return lost


def torque_peak(mismatch: float, stiffness: float, inertia: float) -> float:
    """Return the torque in N m with which a driveline takes up a residual mismatch.

    ``mismatch`` in rad/s, torsional ``stiffness`` in N m/rad, reduced ``inertia`` in kg m2.
    """
    return abs(mismatch) * math.sqrt(stiffness * inertia)
