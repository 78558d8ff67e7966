r"""Times, events and loads of a shift out of the states of either engine's run.

Contact forces follow from the motion by balance of momentum, each the mean over the step that ends
at its time. Along the shaft, with masses and forces as in ``sim.shift.mechanism``,

.. math:: \int F_c = \int F - m_s \Delta\dot x - m_a \Delta\dot y - c \Delta x - \int \left(R
   + D + \mu_s \frac{|T|}{r_s} \sigma\right).

The integral of a force over time is known in closed form; the others are smooth over a step:
Simpson's rule, with the middle from the cubic through both ends. About the shaft, :math:`\int M_c =
J_1 \Delta\omega + \int M_0 \sigma - \int M_1`, of ring and its side together on an elastic shaft;
*M* are the torques of a drive (``sim.shift.drive``), of whose tables and control a run keeps the
integral.
"""

# mypy: disable-error-code="no-untyped-def"

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from dogshape.sim.elementwise import Array
from dogshape.sim.kernel.compiler import compiled, inlined, making
from dogshape.sim.kernel.contact import face_overlap, faces_meet, overlapping_surfaces
from dogshape.sim.kernel.motion import (
    MIN_STEP_S,
    STILL_SLIP_M_S,
    drag,
    drive_torques,
    force_at,
    input_shaft_torque,
    output_shaft_torque,
    push_at,
    resistance,
    side_angles,
    side_speeds,
    write_actuator_rates,
)
from dogshape.sim.kernel_layout import (
    ACTUATOR_DISPLACEMENT,
    ACTUATOR_LEVEL,
    ACTUATOR_SPEED,
    AXIAL_SPEED,
    DISPLACEMENT,
    FORCE_PROFILE,
    INPUT_SIDE_ANGLE,
    INPUT_SIDE_SPEED,
    KNOT_FORCE,
    KNOT_SLOPE,
    KNOT_TIME,
    OUTPUT_ANGLE,
    OUTPUT_SIDE,
    OUTPUT_SIDE_ANGLE,
    OUTPUT_SIDE_SPEED,
    OUTPUT_SPEED,
    RIGID_STATE_SIZE,
    SLIDING_ANGLE,
    SLIDING_SIDE,
    SLIDING_SPEED,
    SPINDLE_TRAVEL,
    STATE_SIZE,
)

#: Columns of angles and displacements in a state, and of their rates in the same order.
PLACE_COLUMNS = (
    OUTPUT_ANGLE,
    DISPLACEMENT,
    SLIDING_ANGLE,
    ACTUATOR_DISPLACEMENT,
    INPUT_SIDE_ANGLE,
    OUTPUT_SIDE_ANGLE,
)
RATE_COLUMNS = (
    OUTPUT_SPEED,
    AXIAL_SPEED,
    SLIDING_SPEED,
    ACTUATOR_SPEED,
    INPUT_SIDE_SPEED,
    OUTPUT_SIDE_SPEED,
)
MIN_PART_LIFT_M = 1e-4  #: by which faces must separate before a touch counts as a new one
IMPACT_WINDOW_S = 1e-3  #: time over which the impulse of an impact is taken
MAX_STEP_PITCHES = 0.05  #: turn of a step that is looked at only at its ends
MAX_FREE_STEP_PITCHES = 0.004  #: the same of a step without contact, in which dogs may have met
MIN_CONTACT_FORCE_N = 0.5  #: mean over a step that counts as a contact, plus a share of the push
MIN_CONTACT_SHARE = 0.01  #: of the shift force, in a mean that counts as a contact
MIN_CONTACT_IMPULSE_NS = 1e-6  #: tangential, over a step that counts as a contact
MIN_TORQUE_SHARE = 0.01  #: of the friction torques, below which a mean torque is no contact
BISECTIONS = 50  #: of a step, for the time at which it crosses a displacement


class ShiftMarks(NamedTuple):
    """Times that divide a shift into its phases, s."""

    flight_end: float
    face_contact_end: float
    seating_start: float


class EventValues(NamedTuple):
    """Values of ``sim.shift.trace.Events``, in its order."""

    face_contacts: int
    slots_skipped: int
    rebound_travel: float
    time_blocked: float
    face_slide: float


class LoadValues(NamedTuple):
    """Values of ``sim.shift.trace.Loads`` but the landing, in its order; NaN for none."""

    peak_axial_force: float
    peak_tangential_force: float
    impact_impulse: float
    energy_dissipated: float
    strike_mismatch: float
    residual_mismatch: float
    input_torque_peak: float
    output_torque_peak: float


class ShiftSummary(NamedTuple):
    """Times, events and loads of a run."""

    shift_time: float  #: at which the ring made the travel, s; NaN for never
    actuator_time: float  #: at which the actuator made it, s; NaN for never
    deepest: float  #: largest penetration of the dogs, m
    farthest: float  #: largest displacement of the ring, m
    missed_overlap: float  #: largest penetration within a step that shows no contact, m
    marks: ShiftMarks
    events: EventValues
    loads: LoadValues
    line_loads: Array  #: by class of overlap, N/m, (k,)


@making
def shift_force(times, states, numbers, knots):
    """Compute the shift force, N, and its integral from the start, N s, at times in s, (n,).

    ``states`` of the run, (n, 14), decide the force of an actuator.
    """
    forces = np.empty(times.size)
    impulses = np.empty(times.size)
    if numbers.actuator.kind != FORCE_PROFILE:
        _integrate_actuator(times, states, numbers, knots, forces, impulses)
        return forces, impulses
    place = 0
    knot_impulse = 0.0  # up to the knot at ``place``
    last = knots.shape[1] - 1
    for i in range(times.size):
        while place < last and times[i] >= knots[KNOT_TIME, place + 1]:
            knot_impulse += _knot_integral(1.0, place, knots)
            place += 1
        forces[i] = force_at(times[i], knots)
        elapsed = times[i] - knots[KNOT_TIME, place]
        if place == last:
            impulses[i] = knot_impulse + elapsed * knots[KNOT_FORCE, last]
        else:
            step = knots[KNOT_TIME, place + 1] - knots[KNOT_TIME, place]
            impulses[i] = knot_impulse + _knot_integral(elapsed / step, place, knots)
    return forces, impulses


@making
def _integrate_actuator(times, states, numbers, knots, forces, impulses):
    """Write the force of an actuator, N, and its integral by Simpson's rule, N s, (n,)."""
    middle = np.empty(STATE_SIZE)
    start_rates = np.zeros(STATE_SIZE)
    end_rates = np.zeros(STATE_SIZE)
    forces[0] = push_at(times[0], states[0], knots, numbers)
    impulses[0] = 0.0
    write_actuator_rates(times[0], states[0], start_rates, numbers)
    for i in range(1, times.size):
        start = states[i - 1]
        end = states[i]
        step = times[i] - times[i - 1]
        forces[i] = push_at(times[i], end, knots, numbers)
        write_actuator_rates(times[i], end, end_rates, numbers)
        _write_midpoint(start, end, step, middle)
        for column in (SPINDLE_TRAVEL, ACTUATOR_LEVEL):
            mean = 0.5 * (start[column] + end[column])
            middle[column] = mean + 0.125 * step * (start_rates[column] - end_rates[column])
        middle_force = push_at(times[i] - 0.5 * step, middle, knots, numbers)
        mean_force = (forces[i - 1] + 4.0 * middle_force + forces[i]) / 6.0
        impulses[i] = impulses[i - 1] + step * mean_force
        start_rates[:] = end_rates


@compiled
def _knot_integral(s, place, knots):
    """Integrate a shift force from a knot to a share of the way to the next, N s."""
    step = knots[KNOT_TIME, place + 1] - knots[KNOT_TIME, place]
    square = s * s
    cube = s**3
    fourth = s**4
    return step * (
        knots[KNOT_FORCE, place] * (s - cube + 0.5 * fourth)
        + knots[KNOT_SLOPE, place] * step * (0.5 * square - 2.0 / 3.0 * cube + 0.25 * fourth)
        + knots[KNOT_FORCE, place + 1] * (cube - 0.5 * fourth)
        + knots[KNOT_SLOPE, place + 1] * step * (0.25 * fourth - cube / 3.0)
    )


@inlined
def _write_midpoint(start, end, step, middle):
    """Write the state in the middle of a step into ``middle``, (14,), from the cubics of places.

    Of an actuator's own states nothing is written.
    """
    for k in range(len(PLACE_COLUMNS)):
        place = PLACE_COLUMNS[k]
        rate = RATE_COLUMNS[k]
        mean = 0.5 * (start[place] + end[place])
        middle[place] = mean + 0.125 * step * (start[rate] - end[rate])
        mean_rate = 1.5 * (end[place] - start[place]) / step
        middle[rate] = mean_rate - 0.25 * (start[rate] + end[rate])


@inlined
def _mean_sliding_drive(i, step, start, middle, end, driven, numbers):
    """Compute the mean torque of the drive on the sliding side over the step to ``i``, N m."""
    if not numbers.has_drive:
        return 0.0
    ends = drive_torques(0.0, start, numbers)[0] + drive_torques(0.0, end, numbers)[0]
    partners = (ends + 4.0 * drive_torques(0.0, middle, numbers)[0]) / 6.0
    return partners + (driven[SLIDING_SIDE, i] - driven[SLIDING_SIDE, i - 1]) / step


@making
def contact_means(times, states, impulses, driven, numbers):
    """Compute the mean force and torque of the contact over each step.

    Parameters
    ----------
    times, states : of the run, s, (n,), and (n, 14).
    impulses : integral of the shift force, N s, (n,).
    driven : integrals of the drive's torques of ``sim.shift.drive.impulses``, N m s, (2, n), or
        (2, 0) without a drive.

    Returns
    -------
    tuple of array
        Force against the shift, N, and torque on the sliding ring, N m, over the steps that end at
        the times, (n,), 0 at the first.
    """
    forces = np.zeros(times.size)
    torques = np.zeros(times.size)
    has_forces = (
        numbers.state_size > RIGID_STATE_SIZE
        or numbers.damping > 0.0
        or numbers.detent > 0.0
        or numbers.friction > 0.0
        or numbers.spline_force_per_torque > 0.0
        or numbers.drag_torque > 0.0
        or numbers.has_drive
    )
    friction_torques = numbers.drag_torque + numbers.synchroniser_torque + numbers.pack_torque
    middle = np.empty(STATE_SIZE)
    for i in range(1, times.size):
        start = states[i - 1]
        end = states[i]
        step = times[i] - times[i - 1]
        if numbers.has_drive and step < MIN_STEP_S:
            continue  # a remainder of rounding at the end of a piece of the drive
        gain = numbers.sliding_inertia * (end[SLIDING_SPEED] - start[SLIDING_SPEED])
        if numbers.input_side_inertia > 0.0:
            side_gain = end[INPUT_SIDE_SPEED] - start[INPUT_SIDE_SPEED]
            gain += numbers.input_side_inertia * side_gain
        torques[i] = gain / step
        momentum = numbers.sleeve_mass * (end[AXIAL_SPEED] - start[AXIAL_SPEED])
        if not has_forces:
            forces[i] = (impulses[i] - impulses[i - 1] - momentum) / step
            continue
        _write_midpoint(start, end, step, middle)
        drags = drag(start, numbers) + 4.0 * drag(middle, numbers) + drag(end, numbers)
        torques[i] += drags / 6.0
        driving = _mean_sliding_drive(i, step, start, middle, end, driven, numbers)
        torques[i] -= driving
        # What the rule leaves of a friction torque is no contact.
        if abs(torques[i]) < MIN_TORQUE_SHARE * friction_torques:
            torques[i] = 0.0
        if end[DISPLACEMENT] == start[DISPLACEMENT]:
            continue  # at rest friction holds the shift force, whatever it is
        if numbers.has_linkage:
            actuator_gain = end[ACTUATOR_SPEED] - start[ACTUATOR_SPEED]
            momentum += numbers.actuator_mass * actuator_gain
        resisting = 0.0
        for state, weight in ((start, 1.0), (middle, 4.0), (end, 1.0)):
            spline_torque = torques[i] - numbers.spline_inertia_ratio * driving
            if numbers.input_side_inertia > 0.0:
                spline_torque = input_shaft_torque(state, numbers)
            resisting += weight * resistance(
                state[DISPLACEMENT], state[AXIAL_SPEED], spline_torque, numbers
            )
        travel = end[DISPLACEMENT] - start[DISPLACEMENT]
        pushed = impulses[i] - impulses[i - 1] - numbers.damping * travel
        forces[i] = (pushed - momentum) / step - resisting / 6.0
    return forces, torques


@compiled
def crossing(times, places, speeds, level):
    """Find the first time in s at which a series reaches ``level``; NaN for never.

    The time of the first value where that has reached it; else on the cubic between two values.
    Series and its rates (n,).
    """
    for i in range(times.size):
        if places[i] >= level:
            break
    else:
        return np.nan
    if i == 0:
        return times[0]
    step = times[i] - times[i - 1]
    low = 0.0
    high = 1.0
    for _ in range(BISECTIONS):
        s = 0.5 * (low + high)
        if _cubic(s, step, places[i - 1], speeds[i - 1], places[i], speeds[i]) >= level:
            high = s
        else:
            low = s
    return times[i - 1] + step * 0.5 * (low + high)


@compiled
def _cubic(s, step, start, start_rate, end, end_rate):
    """Evaluate the cubic between two values with their rates at a share ``s`` of the step."""
    t = 1.0 - s
    return (
        (1.0 + 2.0 * s) * t**2 * start
        + s * t**2 * step * start_rate
        + s * s * (3.0 - 2.0 * s) * end
        + s * s * (s - 1.0) * step * end_rate
    )


@compiled
def penetration(displacement, angle, planes, numbers):
    r"""Compute the penetration of a sliding dog into an output dog, m; 0 for separate dogs.

    Sections at the mean radius are convex, so along each normal of a plane they overlap by
    :math:`p_n - n \cdot c`, with the sum of both extents and the way between both centres; the
    least over all planes is the depth.

    Parameters
    ----------
    displacement : of the sliding ring from the start, m.
    angle : output ring's lead over dogs facing dogs, rad.
    planes : normals across and along the shaft, and :math:`p_n`, m, (p, 3).
    """
    pitch = numbers.pitch_angle * numbers.mean_radius
    deepest = 0.0
    y = -angle * numbers.mean_radius
    y -= pitch * np.rint(y / pitch)
    z = numbers.axial_gap + numbers.height - displacement
    for dog in range(-1, 2):  # the dogs on either side too
        depth = np.inf
        for i in range(planes.shape[0]):
            distance = planes[i, 0] * (y + dog * pitch) + planes[i, 1] * z
            depth = min(depth, planes[i, 2] - distance)
        deepest = max(deepest, depth)
    return deepest


@inlined
def _relative_angle(state):
    """Compute the output ring's lead over dogs facing dogs, rad."""
    return state[OUTPUT_ANGLE] - state[SLIDING_ANGLE]


@compiled
def _interpolate_position(s, step, start, end):
    """Compute displacement, m, and relative angle, rad, at a share of a step, on the cubics."""
    displacement = _cubic(
        s, step, start[DISPLACEMENT], start[AXIAL_SPEED], end[DISPLACEMENT], end[AXIAL_SPEED]
    )
    start_rate = start[OUTPUT_SPEED] - start[SLIDING_SPEED]
    end_rate = end[OUTPUT_SPEED] - end[SLIDING_SPEED]
    angle = _cubic(s, step, _relative_angle(start), start_rate, _relative_angle(end), end_rate)
    return displacement, angle


@compiled
def extremes(times, states, planes, numbers):
    """Find the deepest penetration and the farthest displacement of a shift, m.

    A step turns fast rings by more than a pitch, and dogs may meet and part within it. Steps that
    turn by more than ``MAX_STEP_PITCHES`` are divided into parts that do not, on the cubic.
    """
    largest_turn = 0.0
    max_turn = MAX_STEP_PITCHES * numbers.pitch_angle
    for i in range(1, times.size):
        turn = abs(
            states[i, OUTPUT_ANGLE]
            - states[i, SLIDING_ANGLE]
            - states[i - 1, OUTPUT_ANGLE]
            + states[i - 1, SLIDING_ANGLE]
        )
        largest_turn = max(largest_turn, turn)
    parts = math.ceil(largest_turn / max_turn)
    farthest = states[0, DISPLACEMENT]
    deepest = 0.0
    angle = _relative_angle(states[0])
    for i in range(times.size):
        previous = max(0, i - 1)
        start = states[previous]
        end = states[i]
        step = times[i] - times[previous]
        start_angle = angle
        angle = _relative_angle(end)
        farthest = max(farthest, end[DISPLACEMENT])
        deepest = max(deepest, penetration(end[DISPLACEMENT], angle, planes, numbers))
        inner_parts = parts if abs(angle - start_angle) > max_turn else 1
        for part in range(1, inner_parts):
            displacement, part_angle = _interpolate_position(part / parts, step, start, end)
            farthest = max(farthest, displacement)
            deepest = max(deepest, penetration(displacement, part_angle, planes, numbers))
    return deepest, farthest


@making
def touching(times, forces, torques, pushes, numbers):
    """Mark steps with a contact, (n,).

    Parameters
    ----------
    times : s, (n,).
    forces, torques : of ``contact_means``, N and N m, (n,).
    pushes : shift force, N, (n,).
    """
    touches = np.zeros(forces.size, np.bool_)
    for i in range(forces.size):
        impulse = torques[i] / numbers.mean_radius * (times[i] - times[max(0, i - 1)])
        min_force = MIN_CONTACT_FORCE_N + MIN_CONTACT_SHARE * pushes[i]
        touches[i] = forces[i] > min_force or abs(impulse) > MIN_CONTACT_IMPULSE_NS
    return touches


@compiled
def passed_over(times, states, touches, planes, numbers):
    """Find the largest penetration of dogs within steps that show no contact, m.

    The integrators see forces at a few places of a step alone, and nothing else limits the step of
    free rings: a fast tip grazes another one for a tenth of a millisecond.
    """
    deepest = 0.0
    max_turn = MAX_FREE_STEP_PITCHES * numbers.pitch_angle
    for i in range(1, times.size):
        start = states[i - 1]
        end = states[i]
        step = times[i] - times[i - 1]
        turn = abs(_relative_angle(end) - _relative_angle(start))
        if touches[i] or end[DISPLACEMENT] <= numbers.axial_gap or turn <= max_turn:
            continue
        parts = math.ceil(turn / max_turn)
        for part in range(1, parts):
            displacement, angle = _interpolate_position(part / parts, step, start, end)
            deepest = max(deepest, penetration(displacement, angle, planes, numbers))
    return deepest


class MarkSteps(NamedTuple):
    """Steps at whose ends the marks of a shift are seen; the number of steps for none."""

    first_touch: int
    last_face_touch: int
    crests_meet: int
    seating: int


@compiled
def _find_mark_steps(states, touches, face_touches, numbers):
    """Find the steps of first touch, last touch of a face, crests that meet and first flank."""
    size = touches.size
    first_touch = size
    crests_meet = size
    last_face_touch = size
    for i in range(size - 1, -1, -1):
        if states[i, DISPLACEMENT] >= numbers.axial_gap:
            crests_meet = i
        if touches[i]:
            first_touch = i
        if face_touches[i] and last_face_touch == size:
            last_face_touch = i
    seating = size
    entry = crests_meet if last_face_touch == size else last_face_touch
    for i in range(size - 1, entry, -1):
        if touches[i]:
            seating = i
    return MarkSteps(first_touch, last_face_touch, crests_meet, seating)


@compiled
def _find_marks(times, states, steps, end, impulses, touches, numbers):
    """Find the ends of free flight and face contact and the start of seating within steps, s.

    ``impulses`` of the contact over each step, N s, (n,).
    """
    if steps.last_face_touch < times.size:
        first_touch = _touch_start(times, steps.first_touch, end, impulses)
        last_face_touch = _face_end(
            times, states, steps.last_face_touch, impulses, touches, numbers
        )
    else:
        crests_meet = crossing(
            times, states[:, DISPLACEMENT], states[:, AXIAL_SPEED], numbers.axial_gap
        )
        first_touch = end if math.isnan(crests_meet) else crests_meet
        last_face_touch = first_touch
    seating = _touch_start(times, steps.seating, end, impulses)
    flight_end = min(first_touch, end)
    face_contact_end = min(max(last_face_touch, flight_end), end)
    return ShiftMarks(flight_end, face_contact_end, min(max(seating, face_contact_end), end))


@compiled
def _touch_start(times, i, end, impulses):
    """Find the time in the step to ``i`` at which a contact begins, s; ``end`` for no step."""
    if i >= times.size:
        return end
    if i == 0 or i + 1 == times.size:
        return times[i]
    length = _contact_time(impulses[i], impulses[i + 1], times[i + 1] - times[i])
    return max(times[i - 1], times[i] - length)


@compiled
def _face_end(times, states, i, impulses, touches, numbers):
    """Find the time at which faces that touch over the step to ``i`` part or pass, s."""
    if i == 0 or i + 1 == times.size:
        return times[i]
    if not touches[i + 1]:
        length = _contact_time(impulses[i], impulses[i - 1], times[i - 1] - times[max(0, i - 2)])
        return min(times[i], times[i - 1] + length)
    step = times[i + 1] - times[i]
    low = 0.0
    high = 1.0
    for _ in range(BISECTIONS):
        share = 0.5 * (low + high)
        displacement, angle = _interpolate_position(share, step, states[i], states[i + 1])
        if faces_meet(angle, displacement, numbers):
            low = share
        else:
            high = share
    return times[i] + low * step


@compiled
def _contact_time(impulse, next_impulse, next_step):
    r"""Compute the time that a contact takes in the step of its start, s; backwards of its end.

    A force that grows evenly from zero over the time :math:`x` and the next step :math:`h` gives
    the impulses :math:`r = x^2/(2 x h + h^2)`, so :math:`x = h (r + \sqrt{r^2 + r})`.
    """
    if next_impulse <= 0.0:
        return np.inf
    ratio = impulse / next_impulse
    return next_step * (ratio + math.sqrt(ratio * ratio + ratio))


@compiled
def _find_events(times, states, overlaps, face_touches, numbers):
    """Count face contacts and skipped slots; find rebound, time blocked and slide of faces."""
    rebound = 0.0
    time_blocked = 0.0
    slide = 0.0
    farthest = 0.0
    face_contacts = 0
    largest_distance = -np.inf
    contact_distance = -np.inf
    for i in range(times.size):
        state = states[i]
        displacement = state[DISPLACEMENT]
        farthest = max(farthest, displacement) if i else displacement
        rebound = max(rebound, farthest - displacement)
        overlap, max_overlap, depth = overlapping_surfaces(overlaps[i], numbers)
        distance = numbers.axial_gap + depth - displacement
        if not 0.0 < overlap < max_overlap:
            distance = numbers.axial_gap + numbers.height
        largest_distance = max(largest_distance, distance)
        if not face_touches[i]:
            continue
        lift = largest_distance - contact_distance
        if not face_contacts or (not face_touches[i - 1] and lift > MIN_PART_LIFT_M):
            face_contacts += 1
        largest_distance = distance
        contact_distance = distance
        slip = abs(state[OUTPUT_SPEED] - state[SLIDING_SPEED]) * numbers.mean_radius
        step = times[i] - times[i - 1] if i else 0.0
        if slip < STILL_SLIP_M_S:
            time_blocked += step
        else:
            slide += slip * step
    skipped = _count_skipped_slots(states, overlaps, numbers)
    return EventValues(
        face_contacts, skipped, rebound_travel=rebound, time_blocked=time_blocked, face_slide=slide
    )


@compiled
def _count_skipped_slots(states, overlaps, numbers):
    """Count slots between the first one within reach and the one that was entered."""
    first = 0
    last = states.shape[0] - 1
    while first <= last and states[first, DISPLACEMENT] < numbers.axial_gap:
        first += 1
    if first > last:
        return 0
    forward = states[0, OUTPUT_SPEED] - states[0, SLIDING_SPEED] >= 0.0
    first_slot = _slot_within_reach(states[first], overlaps[first], forward, numbers)
    last_slot = _slot_within_reach(states[last], overlaps[last], forward, numbers)
    skipped = last_slot - first_slot if forward else first_slot - last_slot
    return max(0, int(skipped))


@compiled
def _slot_within_reach(state, overlap, forward, numbers):
    """Compute the number of the slot that a position reaches.

    Slot *k* lies between the angles k and k + 1 pitches. Dogs that stand on a face when the crests
    meet reach the next slot in the direction of the mismatch.
    """
    pitches = _relative_angle(state) / numbers.pitch_angle
    face, max_overlap, _ = overlapping_surfaces(overlap, numbers)
    if 0.0 < face < max_overlap and state[DISPLACEMENT] < numbers.shift_travel:
        return np.rint(pitches) - (0.0 if forward else 1.0)
    return float(math.floor(pitches))


@making
def _find_strikes(times, forces, pushes, torques, numbers):
    """Find the hardest strike within ``IMPACT_WINDOW_S``.

    Of the contact force the part beyond holding the shift force, ``pushes``, N, counts; (n,).

    Returns
    -------
    tuple of float
        Largest impulse, N s, and largest angular impulse alone, N m s.
    """
    axial = np.zeros(times.size)
    angular = np.zeros(times.size)
    for i in range(1, times.size):
        step = times[i] - times[i - 1]
        axial[i] = axial[i - 1] + max(forces[i] - pushes[i], 0.0) * step
        angular[i] = angular[i - 1] + torques[i] * step
    largest = 0.0
    largest_angular = 0.0
    last = 0  # time before the end of the window
    for i in range(times.size):
        window_end = times[i] + IMPACT_WINDOW_S
        while last < times.size - 1 and times[last + 1] <= window_end:
            last += 1
        end_axial = axial[last]
        end_angular = angular[last]
        if last < times.size - 1:
            share = (window_end - times[last]) / (times[last + 1] - times[last])
            end_axial += share * (axial[last + 1] - end_axial)
            end_angular += share * (angular[last + 1] - end_angular)
        angular_impulse = abs(end_angular - angular[i])
        largest_angular = max(largest_angular, angular_impulse)
        tangential_impulse = angular_impulse / numbers.mean_radius
        largest = max(largest, math.hypot(end_axial - axial[i], tangential_impulse))
    return largest, largest_angular


@inlined
def _energy_change(inertia, column, first, last):
    """Compute twice the loss of kinetic energy of an inertia, J.

    In the frame of the sliding ring before the shift; ``column`` is that of its speed.
    """
    frame_speed = first[SLIDING_SPEED]
    first_speed = first[column] - frame_speed
    last_speed = last[column] - frame_speed
    return inertia * (first_speed**2 - last_speed**2)


@compiled
def energy_lost(states, pushes, numbers):
    """Compute initial energy and work of the shift force less kinetic energy at the end, J.

    The energy that a mechanism took is in it, and that stored in shafts. Rings are seen from a
    frame that turns as the sliding ring did before the shift.

    Parameters
    ----------
    states : (n, 14).
    pushes : shift force, N, (n,).
    """
    pushed = ACTUATOR_DISPLACEMENT if numbers.has_linkage else DISPLACEMENT
    work = 0.0
    for i in range(1, pushes.size):
        travel = states[i, pushed] - states[i - 1, pushed]
        work += 0.5 * (pushes[i] + pushes[i - 1]) * travel
    first = states[0]
    last = states[-1]
    double_energy = numbers.sleeve_mass * (first[AXIAL_SPEED] ** 2 - last[AXIAL_SPEED] ** 2)
    if numbers.has_linkage:
        actuator_squares = first[ACTUATOR_SPEED] ** 2 - last[ACTUATOR_SPEED] ** 2
        double_energy += numbers.actuator_mass * actuator_squares
    double_energy += _energy_change(numbers.sliding_inertia, SLIDING_SPEED, first, last)
    double_energy += _energy_change(numbers.input_side_inertia, INPUT_SIDE_SPEED, first, last)
    double_energy += _energy_change(numbers.output_inertia, OUTPUT_SPEED, first, last)
    double_energy += _energy_change(numbers.output_side_inertia, OUTPUT_SIDE_SPEED, first, last)
    return work + 0.5 * double_energy


@making
def drive_work(times, states, driven, numbers):
    """Compute the work of drive and drag on turning rings, J, in the frame of ``energy_lost``.

    ``driven`` as for ``contact_means``. On rings that stand drag is a part of the mechanism.
    """
    frame_speed = states[0, SLIDING_SPEED]
    work = 0.0
    middle = np.empty(STATE_SIZE)
    if frame_speed == 0.0 and not numbers.has_drive:
        return 0.0
    for i in range(1, times.size):
        start = states[i - 1]
        end = states[i]
        step = times[i] - times[i - 1]
        _write_midpoint(start, end, step, middle)
        for state, weight in ((start, 1.0), (middle, 4.0), (end, 1.0)):
            sliding_torque = -drag(state, numbers)
            output_torque = 0.0
            if numbers.has_drive:
                sliding_drive, output_torque = drive_torques(0.0, state, numbers)
                sliding_torque += sliding_drive
            sliding_speed, output_speed = side_speeds(state, numbers)
            sliding_power = sliding_torque * (sliding_speed - frame_speed)
            power = sliding_power + output_torque * (output_speed - frame_speed)
            work += weight * step * power / 6.0
        if numbers.has_drive:
            start_sliding, start_output = side_angles(start, numbers)
            end_sliding, end_output = side_angles(end, numbers)
            sliding_turn = end_sliding - start_sliding - frame_speed * step
            output_turn = end_output - start_output - frame_speed * step
            sliding_impulse = driven[SLIDING_SIDE, i] - driven[SLIDING_SIDE, i - 1]
            output_impulse = driven[OUTPUT_SIDE, i] - driven[OUTPUT_SIDE, i - 1]
            work += sliding_impulse / step * sliding_turn
            work += output_impulse / step * output_turn
    return work


@making
def _find_line_loads(forces, torques, overlaps, face_touches, classes, numbers):
    """Find the largest load of faces while the force is more axial than tangential, N/m, (k,).

    By class of overlap: ``classes`` are their lower ends, m, (k,).
    """
    largest = np.zeros(classes.size)
    for i in range(forces.size):
        if not face_touches[i] or forces[i] <= abs(torques[i]) / numbers.mean_radius:
            continue
        # Past the middle the edge of the flank separates the faces.
        overlap, max_overlap, _ = overlapping_surfaces(overlaps[i], numbers)
        supported = min(overlap, max_overlap - overlap)
        place = 0
        while place + 1 < classes.size and classes[place + 1] <= supported:
            place += 1
        line_load = forces[i] / (numbers.dog_count * numbers.radial_width)
        largest[place] = max(largest[place], line_load)
    return largest


@compiled
def _find_shaft_peaks(states, numbers):
    """Find the largest torque of sliding and output ring's shaft, N m; NaN for a rigid one."""
    input_peak = 0.0 if numbers.input_side_inertia > 0.0 else np.nan
    output_peak = 0.0 if numbers.output_side_inertia > 0.0 else np.nan
    for state in states:
        if numbers.input_side_inertia > 0.0:
            input_peak = max(input_peak, abs(input_shaft_torque(state, numbers)))
        if numbers.output_side_inertia > 0.0:
            output_peak = max(output_peak, abs(output_shaft_torque(state, numbers)))
    return input_peak, output_peak


@compiled
def _residual_mismatch(times, states, seating, end):
    """Find the relative speed before the step of first flank, rad/s; NaN if no flank closed."""
    if seating >= times.size or times[seating] >= end:
        return np.nan
    step = max(0, seating - 1)
    return states[step, OUTPUT_SPEED] - states[step, SLIDING_SPEED]


@making
def summarize(times, states, number_record, knots, driven, planes, classes):
    """Compute times, events and loads of a run.

    Parameters
    ----------
    times, states : of the run, s, (n,), and (n, 14).
    number_record : of ``CLUTCH_NUMBERS``, (1,), which is recognised faster than one alone.
    knots : of the shift force, as of ``ShiftModel``.
    driven : as for ``contact_means``.
    planes : as for ``penetration``.
    classes : lower ends of classes of overlap, m, (k,).

    Returns
    -------
    ShiftSummary
    """
    numbers = number_record[0]
    shift_time = crossing(
        times, states[:, DISPLACEMENT], states[:, AXIAL_SPEED], numbers.shift_travel
    )
    actuator_time = shift_time
    if numbers.has_linkage:
        actuator_time = crossing(
            times,
            states[:, ACTUATOR_DISPLACEMENT],
            states[:, ACTUATOR_SPEED],
            numbers.shift_travel,
        )
    pushes, impulses = shift_force(times, states, numbers, knots)
    forces, torques = contact_means(times, states, impulses, driven, numbers)
    energy = energy_lost(states, pushes, numbers)
    energy += drive_work(times, states, driven, numbers)
    touches = touching(times, forces, torques, pushes, numbers)
    overlaps = np.empty(times.size)
    face_touches = touches.copy()
    contact_impulses = np.empty(times.size)
    peak_force = 0.0
    peak_torque = 0.0
    end = times[-1] if math.isnan(shift_time) else shift_time
    for i in range(times.size):
        angle = _relative_angle(states[i])
        overlaps[i] = face_overlap(angle, numbers)
        face_touches[i] &= faces_meet(angle, states[i, DISPLACEMENT], numbers)
        step = times[i] - times[max(0, i - 1)]
        contact_impulses[i] = step * math.hypot(forces[i], torques[i] / numbers.mean_radius)
        peak_force = max(peak_force, forces[i])
        peak_torque = max(peak_torque, abs(torques[i]))
    steps = _find_mark_steps(states, touches, face_touches, numbers)
    marks = _find_marks(times, states, steps, end, contact_impulses, touches, numbers)
    impulse, angular_impulse = _find_strikes(times, forces, pushes, torques, numbers)
    sliding_inertia = numbers.sliding_inertia + numbers.input_side_inertia
    output_inertia = numbers.output_inertia + numbers.output_side_inertia
    inertia_sum = sliding_inertia + output_inertia
    input_peak, output_peak = _find_shaft_peaks(states, numbers)
    loads = LoadValues(
        peak_axial_force=peak_force,
        peak_tangential_force=peak_torque / numbers.mean_radius,
        impact_impulse=impulse,
        energy_dissipated=energy,
        strike_mismatch=angular_impulse * inertia_sum / (sliding_inertia * output_inertia),
        residual_mismatch=_residual_mismatch(times, states, steps.seating, end),
        input_torque_peak=input_peak,
        output_torque_peak=output_peak,
    )
    deepest, farthest = extremes(times, states, planes, numbers)
    return ShiftSummary(
        shift_time=shift_time,
        actuator_time=actuator_time,
        deepest=deepest,
        farthest=farthest,
        missed_overlap=passed_over(times, states, touches, planes, numbers),
        marks=marks,
        events=_find_events(times, states, overlaps, face_touches, numbers),
        loads=loads,
        line_loads=_find_line_loads(forces, torques, overlaps, face_touches, classes, numbers),
    )
