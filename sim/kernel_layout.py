"""Layout of the values that the compiled engine reads: numbers of a clutch, states, surfaces, laws.

Declared apart from the engine, which is slow to load.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dogshape.sim.elementwise import Array, Mask

# Columns of a state.
OUTPUT_ANGLE = 0  #: rad
DISPLACEMENT = 1  #: of the sliding ring into engagement, m
SLIDING_ANGLE = 2  #: rad
OUTPUT_SPEED = 3  #: rad/s
AXIAL_SPEED = 4  #: of the sliding ring, m/s
SLIDING_SPEED = 5  #: rad/s
ACTUATOR_DISPLACEMENT = 6  #: m
ACTUATOR_SPEED = 7  #: m/s
INPUT_SIDE_ANGLE = 8  #: of the inertia behind the sliding ring's shaft, rad
INPUT_SIDE_SPEED = 9  #: rad/s
OUTPUT_SIDE_ANGLE = 10  #: of the inertia behind the output ring's shaft, rad
OUTPUT_SIDE_SPEED = 11  #: rad/s
SPINDLE_TRAVEL = 12  #: of a motor, m
ACTUATOR_LEVEL = 13  #: speed of a motor, m/s; pressure, current or lagged force over its largest
STATE_SIZE = 14
RIGID_STATE_SIZE = 6  #: columns that move without a linkage and with rigid shafts
LINKED_STATE_SIZE = 8  #: columns that move with a linkage and with rigid shafts
SHAFTED_STATE_SIZE = 12  #: columns that move with a shaft; the others are an actuator's own

# Rows of the knots of a shift force.
KNOT_TIME = 0  #: s
KNOT_FORCE = 1  #: N
KNOT_SLOPE = 2  #: N/s

# Rows of the integrals of the drive's torques.
SLIDING_SIDE = 0  #: N m s
OUTPUT_SIDE = 1  #: N m s

# Kinds of actuators (``sim.shift.actuators``).
FORCE_PROFILE = 0  #: a force over time
SPRING = 1
CAM = 2
MOTOR = 3
PNEUMATIC = 4
HYDRAULIC = 5
SOLENOID = 6

AMBIENT_PA = 1e5  #: absolute pressure around a cylinder (ISO 8778)
REFERENCE_PA = 1e5  #: absolute, at which a conductance counts its volume (ISO 8778)

#: Numbers of an actuator in a shift, SI units; ``Actuator.write`` fills one record of them.
ACTUATOR_NUMBERS = np.dtype(
    (
        np.record,
        np.dtype(
            [
                ("kind", "i8"),
                ("command", "f8"),  # largest static force, N
                ("force_share", "f8"),  # of the force that reaches the sleeve
                ("lag", "f8"),  # of first order behind the force, s; 0: none
                # Spring, or return spring.
                ("preload", "f8"),  # N
                ("rate", "f8"),  # N/m
                # Coupling of cam or motor to the fork.
                ("stiffness", "f8"),  # N/m
                ("damping", "f8"),  # N s/m
                # Way of a cam or a solenoid.
                ("stroke", "f8"),  # m
                # Cam.
                ("dwell_time", "f8"),  # before the ramp, s
                ("ramp_time", "f8"),  # s
                # Motor, referred to its spindle.
                ("drive_mass", "f8"),  # kg
                ("stall_force", "f8"),  # N
                ("no_load_speed", "f8"),  # m/s
                # Cylinder.
                ("supply", "f8"),  # Pa; of air absolute, of oil above the ambient
                ("area", "f8"),  # m2
                ("back_force", "f8"),  # N
                ("dead_volume", "f8"),  # m3
                ("valve_flow", "f8"),  # of air at choked flow and of oil at ``supply``, m3/s
                ("critical_ratio", "f8"),
                ("bulk_modulus", "f8"),  # of oil, Pa
                # Solenoid.
                ("voltage_share", "f8"),
                ("time_constant", "f8"),  # of the open armature, s
                ("start_force", "f8"),  # at rated current and the open armature, N
                ("residual_gap", "f8"),  # m
            ],
            align=True,
        ),
    )
)

#: Numbers of a clutch, SI units; ``Clutch.numbers`` fills one record of them.
CLUTCH_NUMBERS = np.dtype(
    (
        np.record,
        np.dtype(
            [
                # Masses along the shaft.
                ("sleeve_mass", "f8"),  # all that moves with the sliding ring, kg
                ("actuator_mass", "f8"),  # beyond the linkage, kg; 1 without a linkage
                # Inertias about the shaft.
                ("sliding_inertia", "f8"),  # of the sliding ring, or of its whole side, kg m2
                ("input_side_inertia", "f8"),  # behind the ring's shaft, kg m2; 0: rigid shaft
                ("output_inertia", "f8"),  # of the output ring, or of its whole side, kg m2
                ("output_side_inertia", "f8"),  # behind the ring's shaft, kg m2; 0: rigid shaft
                # Resistance of the sliding ring.
                ("damping", "f8"),  # N s/m
                ("friction", "f8"),  # dry, N
                ("spline_force_per_torque", "f8"),  # friction per torque on the ring, 1/m
                ("drag_torque", "f8"),  # on the sliding side, N m
                ("smooth_speed", "f8"),  # below which axial friction is smooth, m/s
                ("smooth_turn", "f8"),  # below which friction torques are smooth, rad/s
                ("detent", "f8"),  # force of the climb, N; 0: no detent
                ("detent_position", "f8"),  # displacement at the peak of the climb, m
                ("detent_seat", "f8"),  # displacement at the peak of the fall, m; inf: no fall
                ("detent_width", "f8"),  # of climb and fall, m
                # Linkage between actuator and sliding ring.
                ("has_linkage", "?"),
                ("linkage_stiffness", "f8"),  # N/m
                ("linkage_damping", "f8"),  # N s/m
                ("free_play", "f8"),  # m
                ("stop_depth", "f8"),  # beyond the play at which half of the damping acts, m
                # Shafts of the rings.
                ("input_stiffness", "f8"),  # N m/rad
                ("input_damping", "f8"),  # N m s/rad
                ("spline_backlash", "f8"),  # between both ends of the play, rad
                ("stop_twist", "f8"),  # beyond the play at which half of the damping acts, rad
                ("output_stiffness", "f8"),  # N m/rad
                ("output_damping", "f8"),  # N m s/rad
                # Stop behind the start of the sliding ring.
                ("rebound", "f8"),  # distance of the stop, m
                ("rebound_stiffness", "f8"),  # of the stop, N/m
                # Dogs.
                ("dog_count", "f8"),  # of those that touch at once, high ones
                ("low_dog_count", "f8"),  # of the output ring
                ("mean_radius", "f8"),  # m
                ("pitch_angle", "f8"),  # rad
                ("axial_gap", "f8"),  # m
                ("height", "f8"),  # of the lower dog, m
                ("radial_width", "f8"),  # m
                ("shift_travel", "f8"),  # displacement at which a shift is finished, m
                ("crest_overlap", "f8"),  # of two faces at dogs facing dogs, m
                ("face_reach", "f8"),  # sum of the widths of two faces that meet, m
                ("face_slope", "f8"),  # tangent of the flatter face
                ("face_width", "f8"),  # of the flatter face, m
                ("face_slope_rise", "f8"),  # tangent of the steeper face less that of the flatter
                ("back_reach", "f8"),  # sum of the widths of two backs that meet, m
                ("back_slope", "f8"),  # tangent of the flatter back
                ("back_width", "f8"),  # of the flatter back, m
                ("back_slope_rise", "f8"),  # tangent of the steeper back less that of the flatter
                # Drive, torques about the axis from the output to the sliding ring.
                ("has_drive", "?"),  # whether any torque acts
                ("torque_start", "f8"),  # of the piece of torques, s
                ("sliding_torque", "f8"),  # on the sliding side at the start of the piece, N m
                ("sliding_torque_rate", "f8"),  # N m/s
                ("output_torque", "f8"),  # on the output side at the start of the piece, N m
                ("output_torque_rate", "f8"),  # N m/s
                ("synchroniser_torque", "f8"),  # N m
                ("pack_torque", "f8"),  # Coulomb torque of a wet pack, N m
                ("pack_viscous", "f8"),  # N m s/rad
                ("pack_speed", "f8"),  # of the pack's partner, rad/s
                ("pack_on_output", "?"),  # whether the pack acts on the output side
                ("spline_inertia_ratio", "f8"),  # ring over what its spline drives; 0 with a shaft
                # Columns of a state that move.
                ("state_size", "i8"),
                ("actuator", ACTUATOR_NUMBERS),
            ],
            align=True,
        ),
    )
)


class Surfaces(NamedTuple):
    """Surfaces of the rigid dog of a pair and planes of the compliant one, q and p of them.

    Those of a low dog of the output ring are parallel to those of a high one: with low dogs
    ``corners`` and ``offsets`` have as many further rows for the pair with a low dog.
    """

    corners: Array  #: of the rigid dog's quadrilaterals, m, (q, 4, 3)
    rigid_normals: Array  #: of the quadrilaterals, outward, (q, 3)
    normals: Array  #: of the compliant dog's planes, outward, (p, 3)
    offsets: Array  #: of these planes along their normals, m, (p,)
    traction_lean: float  #: least turn by a traction flank's lean over the distance, rad/m
    braking_lean: float  #: least turn by a braking flank's lean over the distance, rad/m
    half_backlash: float  #: rad
    pitch_angle: float  #: rad
    axial_gap: float  #: m
    travel: float  #: m
    is_rigid_face: Mask  #: whether a quadrilateral is a face of the tip, (q,)
    is_face: Mask  #: whether a plane is a face of the tip, (p,)
    low_gap: float  #: ``axial_gap`` to the crest of a low dog, m; infinite without low dogs


#: Law of the contact between two dogs: the pressure of a layer with Hunt and Crossley's dissipation
#: or, with ``is_impact``, the force IMPACT of Adams on the whole dog.
CONTACT_LAW = np.dtype(
    (
        np.record,
        np.dtype(
            [
                ("stiffness", "f8"),  # Pa/m; of IMPACT N/m^1.5
                ("damping", "f8"),  # dissipation, s/m; of IMPACT N s/m
                ("dynamic_friction", "f8"),
                ("stiction_velocity", "f8"),  # m/s
                ("static_friction", "f8"),
                ("has_face_friction", "?"),  # whether faces on faces have a friction of their own
                ("face_friction", "f8"),  # of faces on faces, static and dynamic
                ("is_impact", "?"),
                ("damping_depth", "f8"),  # at which IMPACT's damping is full, m
                ("transition_velocity", "f8"),  # slip from which IMPACT's friction is dynamic, m/s
            ],
            align=True,
        ),
    )
)


class ShiftModel(NamedTuple):
    """Everything that the motion of a shift depends on.

    Records as arrays of one: the compiler takes microseconds to recognise a record alone.
    """

    numbers: NDArray[np.record]  #: a record of ``CLUTCH_NUMBERS``, (1,)
    knots: Array  #: of the shift force: times, forces and slopes, (3, n)
    surfaces: Surfaces
    law: NDArray[np.record]  #: a record of ``CONTACT_LAW``, (1,)


def shift_model(numbers: np.record, knots: Array, surfaces: Surfaces, law: np.record) -> ShiftModel:
    """Build a model with its own copy of numbers and law."""
    return ShiftModel(np.array([numbers]), knots, surfaces, np.array([law]))


class StepLimits(NamedTuple):
    """Errors and length that a step of the integration may have."""

    speed_error: float  #: m/s
    place_error: float  #: m
    max_step: float  #: s


#: State of the switch between explicit and implicit steps, which one call leaves to the next.
STEP_MODE = np.dtype(
    (
        np.record,
        np.dtype(
            [
                ("steps_in_touch", "f8"),
                ("explicit_step", "f8"),  # length that implicit steps must exceed, s; 0: explicit
            ],
            align=True,
        ),
    )
)


def empty_record(dtype: np.dtype[Any]) -> np.record:
    """Make one record of zeros."""
    record: Any = np.zeros((), dtype)[()]
    return record


def filled_record(dtype: np.dtype[Any], values: Mapping[str, Any]) -> np.record:
    """Make one record of values by field, zero for a field without one.

    All fields at once: an attribute of a record takes microseconds.
    """
    fields = {**_zeros_of(dtype), **values}
    record: Any = np.array(tuple(fields.values()), dtype)[()]
    return record


@cache
def _zeros_of(dtype: np.dtype[Any]) -> dict[str, Any]:
    """Return the zeros of a record by field."""
    return dict(zip(dtype.names or (), np.zeros((), dtype).item(), strict=True))
