r"""Time series of a shift, its phases, events and loads, and the torque of its driveline.

Phases, contiguous from the start of the force: *free fly* until the first touch, or until the
crests meet when no face is ever touched; *face contact* from the first touch of any kind to the
last one of a face, with every bounce, rebound and skipped slot in between; *entry* while the dogs
are in the slots and no flank has touched yet; *seating* from the first flank contact to the end.
Times lie between the recorded steps: of crests on the cubic of the motion, of contacts by a force
that grows evenly. Phases add up to the shift time.

*Loads*: the rings are rigid behind the stiffness of the dogs. Impulses and energies follow from
momenta; peak forces go with :math:`\sqrt{k m}` and are estimates (``benchmarks/impact_force.py``).

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

from dogshape.sim.elementwise import Array, Mask
from dogshape.sim.kernel_layout import (
    ACTUATOR_DISPLACEMENT,
    ACTUATOR_SPEED,
    AXIAL_SPEED,
    DISPLACEMENT,
    OUTPUT_ANGLE,
    OUTPUT_SPEED,
    SLIDING_ANGLE,
    SLIDING_SPEED,
)
from dogshape.sim.shift.actuation import ForceProfile
from dogshape.sim.shift.clutch import Clutch
from dogshape.sim.shift.geometry import crest_loss, crest_setback

CREST_DEPTH = 1e-4  #: m about the crests' height within which crests can stand on each other
#: Lower ends of the classes of overlap, m; the last has no upper end.
OVERLAPS = (*(i * 1e-4 for i in range(20)), 2e-3, 3e-3)
PHASES = ("free fly", "face contact", "entry", "seating")


@dataclass(frozen=True)
class Phase:
    """A named part of the shift, start and end in s."""

    name: str
    start: float
    end: float


@dataclass(frozen=True)
class Events:
    """Events of a shift."""

    face_contacts: int  #: how often a dog came down on the face of another
    slots_skipped: int  #: number of slots within reach that the dogs were carried past
    rebound_travel: float  #: farthest way back from a depth once reached, m
    #: with face on face at a slip below ``sim.kernel.motion.STILL_SLIP_M_S``, s
    time_blocked: float
    face_slide: float  #: way that faces slid on each other, m


@dataclass(frozen=True)
class Loads:
    """Loads of a shift, of the whole ring."""

    peak_axial_force: float  #: largest axial contact force, N
    peak_tangential_force: float  #: largest tangential contact force at the mean radius, N
    #: largest impulse (axial and tangential as a vector) within any millisecond that the contact
    #: gives beyond holding the shift force, N s
    impact_impulse: float
    #: energy that the contact took, by balance, J: what is left in the compressed dogs at the end
    #: included, and what a mechanism took
    energy_dissipated: float
    #: largest change of the relative speed that the contact makes within any millisecond, rad/s:
    #: what the hardest strike takes of the mismatch
    strike_mismatch: float
    #: relative speed with which the flanks close for good, at the start of seating, rad/s, signed;
    #: None where none closed. Flanks that struck and flew off before show in the two above
    residual_mismatch: float | None
    input_torque_peak: float | None  #: largest of the sliding ring's shaft, N m; None: rigid
    output_torque_peak: float | None  #: the same of the output ring's shaft
    #: largest load per length of the dogs, N/m, dog on dog, all alike, by class of ``OVERLAPS``
    landing_loads: tuple[float, ...]


def crests_cross(clutch: Clutch, relative_angle: Array, displacement: Array) -> Mask:
    """Mark positions in which two crests cross within both dogs, at their depth, (n,).

    Straight crests stand twice their ``ridge_offset`` over the radius out of parallel where their
    overlap is zero at the mean radius, rounded ones more by their setback. The common normal is
    then the axis: friction holds whatever the chamfer, for rounded crests up to its angle beyond.
    """
    from dogshape.sim import kernel  # noqa: PLC0415  slow to load, and results have no need of it

    dog = clutch.dog
    dogs = (dog, clutch.pair.output)
    setback = sum(crest_setback(ring_dog, ring_dog.edge_radius) for ring_dog in dogs)
    offset = sum(ring_dog.ridge_offset for ring_dog in dogs)
    crossing_angle = abs(offset - setback) / dog.mean_radius
    slope = math.sin(math.atan(clutch.contact.static_friction))
    reach = 0.5 * crossing_angle * dog.radial_width + 2.0 * clutch.pair.edge_radius * slope
    overlap = kernel.face_overlap(relative_angle, clutch.numbers)
    loss = sum(crest_loss(ring_dog, ring_dog.edge_radius) for ring_dog in dogs)
    depth = displacement - dog.axial_gap - loss
    return (np.abs(depth) < CREST_DEPTH) & (np.abs(overlap - setback) <= reach)


@dataclass(frozen=True)
class Trace:
    """Time series of a shift, each (n,), SI units; forces are of the whole ring."""

    time: Array
    displacement: Array
    axial_speed: Array
    sliding_speed: Array
    output_speed: Array
    relative_angle: Array
    shift_force: Array
    contact_force: Array  #: axial, positive against the shift
    tangential_force: Array  #: at the mean radius, positive where the output drives
    actuator_displacement: Array  #: that of the ring unless there is a linkage, as is its rate
    actuator_speed: Array

    @property
    def relative_speed(self) -> Array:
        """Output less sliding speed, rad/s, (n,); at the start it is the mismatch."""
        return self.output_speed - self.sliding_speed


def trace_of(
    clutch: Clutch, profile: ForceProfile, times: Array, states: Array, driven: Array
) -> Trace:
    """Compute the trace of a run, times and states as ``sim.shift.conclusion.Run`` has them.

    ``driven`` are integrals of the drive's torques, N m s, (2, n), or (2, 0) without a drive.
    """
    from dogshape.sim import kernel  # noqa: PLC0415  slow to load, and results have no need of it

    numbers = clutch.shift_numbers(profile)
    pushes, impulses = kernel.shift_force(times, states, numbers, profile.knots)
    forces, torques = kernel.contact_means(times, states, impulses, driven=driven, numbers=numbers)
    has_linkage = clutch.mechanism.has_linkage
    actuator_column = ACTUATOR_DISPLACEMENT if has_linkage else DISPLACEMENT
    actuator_speed_column = ACTUATOR_SPEED if has_linkage else AXIAL_SPEED
    return Trace(
        time=times,
        displacement=states[:, DISPLACEMENT],
        axial_speed=states[:, AXIAL_SPEED],
        sliding_speed=states[:, SLIDING_SPEED],
        output_speed=states[:, OUTPUT_SPEED],
        relative_angle=states[:, OUTPUT_ANGLE] - states[:, SLIDING_ANGLE],
        shift_force=pushes,
        contact_force=forces,
        tangential_force=torques / clutch.dog.mean_radius,
        actuator_displacement=states[:, actuator_column],
        actuator_speed=states[:, actuator_speed_column],
    )


def torque_peak(clutch: Clutch, trace: Trace, stiffness: float) -> float:
    """Compute the largest torque in N m of a driveline of ``stiffness`` in N m/rad in a shift."""
    inertia = clutch.rings.reduced_inertia
    rate = math.sqrt(stiffness / inertia)
    torque = trace.tangential_force[1:] * clutch.dog.mean_radius
    turns = rate * (trace.time - trace.time[0])
    phasor = np.exp(-1j * turns)
    pushes = torque * (phasor[:-1] - phasor[1:]) / 1j
    # T is the imaginary part of the state, the real one its rate over that of the swing.
    state = np.concatenate([[0.0], np.cumsum(pushes)]) / phasor
    excess = state.imag[:-1] - torque
    swing = np.hypot(excess, state.real[:-1])
    crest_turn = np.arctan2(state.real[:-1], excess) % (2.0 * math.pi)
    trough_turn = (crest_turn + math.pi) % (2.0 * math.pi)
    step_turns = np.diff(turns)
    crests = np.abs(np.where(crest_turn <= step_turns, torque + swing, 0.0))
    troughs = np.abs(np.where(trough_turn <= step_turns, torque - swing, 0.0))
    engaged = bool((trace.displacement >= clutch.shift_travel).any())
    last_strike = inertia * float(trace.relative_speed[-1]) * rate if engaged else 0.0
    peaks = (np.abs(state.imag).max(), crests.max(), troughs.max(), abs(state[-1] + last_strike))
    return float(max(peaks))
