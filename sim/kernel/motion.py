r"""Motion of a shift and its integration, up to full depth or to rings that stand still.

Steps: Bogacki and Shampine's pair 3(2) (1989); where dogs stay in touch, Shampine and Reichelt's
linearly implicit pair 2(3) (1997); Gustafsson's step-size controller (1991). Masses and forces
along the shaft are those of ``sim.shift.mechanism``, torques those of ``sim.shift.drive``.
"""

# mypy: disable-error-code="no-untyped-def"

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from dogshape.sim.kernel.actuator import actuator_force, actuator_rates
from dogshape.sim.kernel.compiler import compiled, inlined, making
from dogshape.sim.kernel.contact import (
    clip_workspace,
    contact,
    face_overlap,
    faces_meet,
    overlapping_surfaces,
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
    OUTPUT_SIDE_ANGLE,
    OUTPUT_SIDE_SPEED,
    OUTPUT_SPEED,
    SLIDING_ANGLE,
    SLIDING_SPEED,
    SPINDLE_TRAVEL,
    STATE_SIZE,
    ShiftModel,
    Surfaces,
)

#: Whether a column of a state is an angle or displacement, not a rate, (14,).
IS_PLACE = np.array([True, True, True, False, False, False, *[True, False] * 4])
#: Whether a column of a state is an angle or its rate, (14,).
IS_TURNING = np.array(
    [True, False, True, True, False, True, False, False, *[True] * 4, False, False]
)
# Why ``advance`` returned.
ENGAGED = 0  #: ring and actuator made the shift's travel
PAUSED = 1  #: the end of the call
FULL = 2  #: no space for another step
UNDERFLOW = 3  #: the step became shorter than ``MIN_STEP_S``
HELD = 4  #: the rings stand still on each other

MIN_STEP_S = 1e-12  #: step below which the integration is lost
ERROR_ORDER = 1.0 / 3.0  #: exponent of the error in the growth of a step
PREDICTIVE_GAIN = 0.08  #: exponent of the last step's error in the growth of a step
MAX_GROWTH = 5.0  #: of a step, factor
MIN_GROWTH = 0.2  #: of a refused step, factor
GROWTH_SAFETY = 0.9  #: factor on the growth
MIN_ERROR = 1e-9  #: of a step over its tolerance, below which a step grows no more
MIN_LAST_ERROR = 0.01  #: of the last step over its tolerance, as it counts for the next
INFINITE_ERROR = 1e3  #: over its tolerance, of a step whose error is not finite
ROSENBROCK_SHARE = 1.0 / (2.0 + math.sqrt(2.0))  #: implicit share of a step
JACOBIAN_STEP_M = 1e-9  #: change of a place by which slopes are measured
JACOBIAN_STEP_M_S = 1e-6  #: change of a speed
JACOBIAN_STEP_S = 1e-7  #: change of the time
MAX_JACOBIAN_AGE = 8  #: steps for which slopes are used
STIFF_AFTER_STEPS = 60  #: steps in touch after which implicit ones are tried

STOP_DISSIPATION_S_M = 100.0  #: of the stop behind the ring, as in the Drake plant
STILL_WINDOW_S = 0.02  #: time over which rings must stand still to count as blocked
MAX_PACK_CHANGE = 0.01  #: share by which a pack's torque may still change on blocked rings
STILL_SLIP_M_S = 1e-3  #: slip below which faces count as held
MAX_PUSH_CHANGE = 0.01  #: share by which an actuator's force may still change on blocked rings

# Rows of the stages of a step, each (14,).
K1 = 0  #: rates at the start of the step
K2 = 1  #: rates of the second stage
K3 = 2  #: rates of the third stage
K4 = 3  #: rates at the end of the step
ERROR = 4  #: estimated error over the length of the step
TRIAL = 5  #: state of a stage, at last of the end
STAGE_ROWS = 6


class StepProgress(NamedTuple):
    """End of a call of ``advance``."""

    reason: int  #: ENGAGED, PAUSED, FULL, UNDERFLOW or HELD
    time: float  #: s
    step: float  #: to try next, s
    recorded: int  #: number of recorded steps
    evaluations: int  #: of the rates


@inlined
def force_at(time, knots):
    """Evaluate a shift force at a time in s, N; knots as of ``ShiftModel``, constant beyond."""
    last = knots.shape[1] - 1
    if time >= knots[KNOT_TIME, last]:
        return knots[KNOT_FORCE, last]
    if time <= knots[KNOT_TIME, 0]:
        return knots[KNOT_FORCE, 0]
    low = 0
    high = last
    while high - low > 1:
        middle = (low + high) // 2
        if knots[KNOT_TIME, middle] <= time:
            low = middle
        else:
            high = middle
    step = knots[KNOT_TIME, high] - knots[KNOT_TIME, low]
    s = (time - knots[KNOT_TIME, low]) / step
    t = 1.0 - s
    return (
        (1.0 + 2.0 * s) * t * t * knots[KNOT_FORCE, low]
        + s * t * t * step * knots[KNOT_SLOPE, low]
        + s * s * (3.0 - 2.0 * s) * knots[KNOT_FORCE, high]
        - s * s * t * step * knots[KNOT_SLOPE, high]
    )


@inlined
def _fork_motion(state, numbers):
    """Select travel, m, and speed, m/s, of the fork, which is at the ring without a linkage."""
    if numbers.has_linkage:
        return state[ACTUATOR_DISPLACEMENT], state[ACTUATOR_SPEED]
    return state[DISPLACEMENT], state[AXIAL_SPEED]


@compiled
def _actuator_push(time, state, numbers):
    """Evaluate the force of an actuator at a state, N."""
    travel, speed = _fork_motion(state, numbers)
    spindle_travel = state[SPINDLE_TRAVEL]
    level = state[ACTUATOR_LEVEL]
    return actuator_force(time, travel, speed, spindle_travel, level, numbers.actuator)


@inlined
def push_at(time, state, knots, numbers):
    """Evaluate the shift force at a time in s and a state, N; knots as of ``ShiftModel``."""
    if numbers.actuator.kind == FORCE_PROFILE:
        return force_at(time, knots)
    return _actuator_push(time, state, numbers)


@compiled
def write_actuator_rates(time, state, rates_out, numbers):
    """Write the rates of an actuator's own states into ``rates_out``, (14,)."""
    travel, speed = _fork_motion(state, numbers)
    spindle_travel = state[SPINDLE_TRAVEL]
    level = state[ACTUATOR_LEVEL]
    spindle_rate, level_rate = actuator_rates(
        time, travel, speed, spindle_travel, level, numbers.actuator
    )
    rates_out[SPINDLE_TRAVEL] = spindle_rate
    rates_out[ACTUATOR_LEVEL] = level_rate


@inlined
def _smooth_sign(value, scale):
    """Compute the sign of a value, smooth below ``scale``."""
    return value / math.sqrt(value * value + scale * scale)


@inlined
def _spring(stretch, rate, stiffness, damping, lower, upper, stop_depth):
    """Compute the force of a spring, or of two stops (``sim.shift.mechanism.spring_force``)."""
    if lower == upper:
        return stiffness * stretch + damping * rate
    upper_depth = max(stretch - upper, 0.0)
    lower_depth = max(lower - stretch, 0.0)
    push = max(upper_depth * (stiffness + damping * rate / (upper_depth + stop_depth)), 0.0)
    return push - max(lower_depth * (stiffness - damping * rate / (lower_depth + stop_depth)), 0.0)


@inlined
def input_shaft_torque(state, numbers):
    """Compute the torque of the shaft on the sliding ring, N m."""
    half_play = 0.5 * numbers.spline_backlash
    lead = state[INPUT_SIDE_ANGLE] - state[SLIDING_ANGLE]
    rate = state[INPUT_SIDE_SPEED] - state[SLIDING_SPEED]
    return _spring(
        lead,
        rate,
        numbers.input_stiffness,
        numbers.input_damping,
        -half_play,
        half_play,
        numbers.stop_twist,
    )


@inlined
def output_shaft_torque(state, numbers):
    """Compute the torque of the shaft on the output ring, N m."""
    lead = state[OUTPUT_SIDE_ANGLE] - state[OUTPUT_ANGLE]
    rate = state[OUTPUT_SIDE_SPEED] - state[OUTPUT_SPEED]
    return numbers.output_stiffness * lead + numbers.output_damping * rate


@inlined
def _detent_bump(distance, numbers):
    """Evaluate the parabola of a detent at a distance in m from its peak, 0 to 1.

    The force of climb and fall goes with its square.
    """
    return max(1.0 - (2.0 * distance / numbers.detent_width) ** 2, 0.0)


@inlined
def resistance(displacement, speed, spline_torque, numbers):
    """Compute detent and friction against the ring, N; ``spline_torque`` in N m."""
    force = 0.0
    if numbers.detent != 0.0:
        climb = _detent_bump(displacement - numbers.detent_position, numbers)
        force += numbers.detent * climb * climb
        fall = _detent_bump(displacement - numbers.detent_seat, numbers)
        force += -1.0 * numbers.detent * fall * fall
    friction = numbers.friction + numbers.spline_force_per_torque * abs(spline_torque)
    if friction > 0.0:
        force += friction * _smooth_sign(speed, numbers.smooth_speed)
    return force


@inlined
def side_speeds(state, numbers):
    """Select the speeds of sliding and output side, rad/s.

    Each side is the inertia behind the shaft of its ring, or the ring on a rigid shaft.
    """
    sliding = state[SLIDING_SPEED]
    if numbers.input_side_inertia > 0.0:
        sliding = state[INPUT_SIDE_SPEED]
    output = state[OUTPUT_SPEED]
    if numbers.output_side_inertia > 0.0:
        output = state[OUTPUT_SIDE_SPEED]
    return sliding, output


@inlined
def side_angles(state, numbers):
    """Select the angles of sliding and output side, rad, as ``side_speeds`` the speeds."""
    sliding = state[SLIDING_ANGLE]
    if numbers.input_side_inertia > 0.0:
        sliding = state[INPUT_SIDE_ANGLE]
    output = state[OUTPUT_ANGLE]
    if numbers.output_side_inertia > 0.0:
        output = state[OUTPUT_SIDE_ANGLE]
    return sliding, output


@inlined
def drag(state, numbers):
    """Compute the drag torque against the sliding side, N m, positive for a positive speed."""
    if numbers.drag_torque == 0.0:
        return 0.0
    sliding_speed, _ = side_speeds(state, numbers)
    return numbers.drag_torque * _smooth_sign(sliding_speed, numbers.smooth_turn)


@inlined
def _has_pack(numbers):
    """Decide whether a wet pack acts."""
    return numbers.pack_torque > 0.0 or numbers.pack_viscous > 0.0


@inlined
def _pack(state, numbers):
    """Compute the torque of a wet pack on the side that it acts on, about the axis, N m."""
    sliding_speed, output_speed = side_speeds(state, numbers)
    speed = output_speed if numbers.pack_on_output else sliding_speed
    slip = numbers.pack_speed - speed
    coulomb = numbers.pack_torque * _smooth_sign(slip, numbers.smooth_turn)
    return coulomb + numbers.pack_viscous * slip


@inlined
def drive_torques(time, state, numbers):
    """Compute the torques of the drive on sliding and output side, about the axis, N m.

    At the time in s within the piece of torques that ``numbers`` hold.
    """
    elapsed = time - numbers.torque_start
    on_sliding = numbers.sliding_torque + numbers.sliding_torque_rate * elapsed
    on_output = numbers.output_torque + numbers.output_torque_rate * elapsed
    if numbers.synchroniser_torque > 0.0:
        sliding_speed, output_speed = side_speeds(state, numbers)
        mismatch = output_speed - sliding_speed
        shared = numbers.synchroniser_torque * _smooth_sign(mismatch, numbers.smooth_turn)
        on_sliding += shared
        on_output -= shared
    if _has_pack(numbers):
        if numbers.pack_on_output:
            on_output += _pack(state, numbers)
        else:
            on_sliding += _pack(state, numbers)
    return on_sliding, on_output


@compiled
def _low_contact(angle, distance, relative_speed, axial_speed, surfaces, law, workspace):
    """Compute ``contact`` beside a low dog of the output ring."""
    low_surfaces = Surfaces(
        surfaces.corners[surfaces.rigid_normals.shape[0] :],
        surfaces.rigid_normals,
        surfaces.normals,
        surfaces.offsets[surfaces.normals.shape[0] :],
        surfaces.traction_lean,
        surfaces.braking_lean,
        surfaces.half_backlash,
        surfaces.pitch_angle,
        surfaces.low_gap,
        surfaces.travel,
        surfaces.is_rigid_face,
        surfaces.is_face,
        surfaces.low_gap,
    )
    return contact(angle, distance, relative_speed, axial_speed, low_surfaces, law, workspace)


@inlined
def _contact_loads(state, model, workspace):
    """Compute ``contact_loads``; ``model`` has records in place of arrays of one."""
    surfaces = model.surfaces
    if state[DISPLACEMENT] <= surfaces.axial_gap:
        return 0.0, 0.0
    angle = state[OUTPUT_ANGLE] - state[SLIDING_ANGLE]
    relative_speed = state[OUTPUT_SPEED] - state[SLIDING_SPEED]
    distance = surfaces.travel - state[DISPLACEMENT]
    axial, torque = contact(
        angle, distance, relative_speed, state[AXIAL_SPEED], surfaces, model.law, workspace
    )
    dog_count = model.numbers.dog_count
    axial *= dog_count
    torque *= dog_count
    if state[DISPLACEMENT] > surfaces.low_gap:
        low_axial, low_torque = _low_contact(
            angle, distance, relative_speed, state[AXIAL_SPEED], surfaces, model.law, workspace
        )
        low_count = model.numbers.low_dog_count
        axial += low_axial * low_count
        torque += low_torque * low_count
    return axial, torque


@compiled
def contact_loads(state, model, workspace):
    """Compute the contact's force along the shaft, N, and torque about it, N m, of all dogs."""
    row = ShiftModel(model.numbers[0], model.knots, model.surfaces, model.law[0])
    return _contact_loads(state, row, workspace)


@inlined
def _motion(time, push, axial, torque, state, rates_out, numbers):
    """Write the rates of a state into ``rates_out``, (14,).

    Parameters
    ----------
    time : s.
    push : force on the actuator, or on the ring without a linkage, N.
    axial, torque : of the contact, N and N m, as of ``_contact_loads``.
    """
    displacement = state[DISPLACEMENT]
    speed = state[AXIAL_SPEED]
    stop_force = 0.0
    if displacement < -numbers.rebound:
        depth = -numbers.rebound - displacement
        dissipation = 1.0 - STOP_DISSIPATION_S_M * speed
        stop_force = max(numbers.rebound_stiffness * depth * dissipation, 0.0)
    ring_push = push
    rates_out[ACTUATOR_DISPLACEMENT] = speed
    rates_out[ACTUATOR_SPEED] = 0.0
    if numbers.has_linkage:
        ring_push = _spring(
            state[ACTUATOR_DISPLACEMENT] - displacement,
            state[ACTUATOR_SPEED] - speed,
            numbers.linkage_stiffness,
            numbers.linkage_damping,
            0.0,
            numbers.free_play,
            numbers.stop_depth,
        )
        rates_out[ACTUATOR_DISPLACEMENT] = state[ACTUATOR_SPEED]
        rates_out[ACTUATOR_SPEED] = (push - ring_push) / numbers.actuator_mass
    shaft_torque = 0.0
    spline_torque = torque
    if numbers.input_side_inertia > 0.0:
        shaft_torque = input_shaft_torque(state, numbers)
        spline_torque = shaft_torque
    holding_torque = drag(state, numbers)
    output_drive = 0.0
    if numbers.has_drive:
        sliding_drive, output_drive = drive_torques(time, state, numbers)
        holding_torque -= sliding_drive
        spline_torque -= numbers.spline_inertia_ratio * sliding_drive
    resisting = resistance(displacement, speed, spline_torque, numbers)
    rates_out[OUTPUT_ANGLE] = state[OUTPUT_SPEED]
    rates_out[DISPLACEMENT] = speed
    rates_out[SLIDING_ANGLE] = state[SLIDING_SPEED]
    force = ring_push - resisting - numbers.damping * speed - axial + stop_force
    rates_out[AXIAL_SPEED] = force / numbers.sleeve_mass
    rates_out[INPUT_SIDE_ANGLE:] = 0.0
    if numbers.actuator.kind != FORCE_PROFILE:
        write_actuator_rates(time, state, rates_out, numbers)
    if numbers.input_side_inertia > 0.0:
        rates_out[SLIDING_SPEED] = (torque + shaft_torque) / numbers.sliding_inertia
        rates_out[INPUT_SIDE_ANGLE] = state[INPUT_SIDE_SPEED]
        side_torque = -(shaft_torque + holding_torque)
        rates_out[INPUT_SIDE_SPEED] = side_torque / numbers.input_side_inertia
    else:
        rates_out[SLIDING_SPEED] = (torque - holding_torque) / numbers.sliding_inertia
    if numbers.output_side_inertia > 0.0:
        back_torque = output_shaft_torque(state, numbers)
        rates_out[OUTPUT_SPEED] = (back_torque - torque) / numbers.output_inertia
        rates_out[OUTPUT_SIDE_ANGLE] = state[OUTPUT_SIDE_SPEED]
        side_torque = output_drive - back_torque
        rates_out[OUTPUT_SIDE_SPEED] = side_torque / numbers.output_side_inertia
    else:
        rates_out[OUTPUT_SPEED] = (output_drive - torque) / numbers.output_inertia


@compiled
def rates(time, state, rates_out, model, workspace):
    """Write the rates of a state into ``rates_out``, (14,), and return whether dogs touch."""
    axial, torque = _contact_loads(state, model, workspace)
    push = push_at(time, state, model.knots, model.numbers)
    _motion(time, push, axial, torque, state, rates_out, model.numbers)
    return axial != 0.0 or torque != 0.0


@making
def _measure_jacobian(time, state, state_rates, jacobian, model, workspace):
    """Measure the change of ``state_rates`` with each column of the state and with time.

    Writes ``jacobian``, (15, 14). The contact depends on relative angle and speed, so that the
    columns of the sliding ring follow from those of the output ring.
    """
    numbers = model.numbers
    push = push_at(time, state, model.knots, numbers)
    axial = 0.0
    torque = 0.0
    changed_rates = jacobian[STATE_SIZE]
    axial_change = np.zeros(STATE_SIZE)
    torque_change = np.zeros(STATE_SIZE)
    # One call of the contact, which is compiled in place: the first column changes nothing.
    for column in (STATE_SIZE, OUTPUT_ANGLE, DISPLACEMENT, OUTPUT_SPEED, AXIAL_SPEED):
        change = 0.0
        if column < STATE_SIZE:
            change = _jacobian_step(column, numbers)
            state[column] += change
        changed_axial, changed_torque = _contact_loads(state, model, workspace)
        if column == STATE_SIZE:
            axial = changed_axial
            torque = changed_torque
            continue
        state[column] -= change
        axial_change[column] = changed_axial - axial
        torque_change[column] = changed_torque - torque
    axial_change[SLIDING_ANGLE] = -axial_change[OUTPUT_ANGLE]
    torque_change[SLIDING_ANGLE] = -torque_change[OUTPUT_ANGLE]
    axial_change[SLIDING_SPEED] = -axial_change[OUTPUT_SPEED]
    torque_change[SLIDING_SPEED] = -torque_change[OUTPUT_SPEED]
    for column in range(numbers.state_size):
        change = _jacobian_step(column, numbers)
        value = state[column]
        state[column] = value + change
        changed_axial = axial + axial_change[column]
        changed_torque = torque + torque_change[column]
        changed_push = push
        if numbers.actuator.kind != FORCE_PROFILE:
            changed_push = _actuator_push(time, state, numbers)
        _motion(time, changed_push, changed_axial, changed_torque, state, changed_rates, numbers)
        state[column] = value
        jacobian[column] = (changed_rates - state_rates) / change
    later = time + JACOBIAN_STEP_S
    later_push = push_at(later, state, model.knots, numbers)
    _motion(later, later_push, axial, torque, state, changed_rates, numbers)
    changed_rates[:] = (changed_rates - state_rates) / JACOBIAN_STEP_S


@compiled
def _jacobian_step(column, numbers):
    """Compute the change of a column of the state by which slopes are measured."""
    change = JACOBIAN_STEP_M if IS_PLACE[column] else JACOBIAN_STEP_M_S
    return change / numbers.mean_radius if IS_TURNING[column] else change


@compiled
def _factor(implicit_step, jacobian, factors, size):
    """Write the factors of ``1 - implicit_step J``, (14, 14), without exchange of rows."""
    for i in range(size):
        for j in range(size):
            factors[i, j] = (1.0 if i == j else 0.0) - implicit_step * jacobian[j, i]
    for k in range(size):
        for i in range(k + 1, size):
            share = factors[i, k] / factors[k, k]
            factors[i, k] = share
            if share != 0.0:
                for j in range(k + 1, size):
                    factors[i, j] -= share * factors[k, j]


@compiled
def _solve(factors, right, size):
    """Replace a right-hand side by the solution, with the factors of ``_factor``."""
    for i in range(size):
        for j in range(i):
            right[i] -= factors[i, j] * right[j]
    for i in range(size - 1, -1, -1):
        for j in range(i + 1, size):
            right[i] -= factors[i, j] * right[j]
        right[i] /= factors[i, i]


@making
def _implicit_step(time, step, renew, state, stages, jacobian, factors, model, workspace):
    """Make an implicit step into the stages TRIAL and ERROR.

    ``renew`` estimates the Jacobian, (15, 14), by differences; ``factors``, (14, 14), are computed
    in each step. Returns whether dogs touch at the end.
    """
    k1 = stages[K1]
    k2 = stages[K2]
    k4 = stages[K4]
    trial = stages[TRIAL]
    error = stages[ERROR]
    if renew:
        _measure_jacobian(time, state, k1, jacobian, model, workspace)
    size = model.numbers.state_size
    implicit_step = step * ROSENBROCK_SHARE
    time_slope = jacobian[STATE_SIZE]
    _factor(implicit_step, jacobian, factors, size)
    slope1 = k1 + implicit_step * time_slope
    _solve(factors, slope1, size)
    trial[:] = state + 0.5 * step * slope1
    rates(time + 0.5 * step, trial, k2, model, workspace)
    slope2 = k2 - slope1
    _solve(factors, slope2, size)
    slope2 += slope1
    trial[:] = state + step * slope2
    touching = rates(time + step, trial, k4, model, workspace)
    error[:] = (
        k4
        - (6.0 + math.sqrt(2.0)) * (slope2 - k2)
        - 2.0 * (slope1 - k1)
        + implicit_step * time_slope
    )
    _solve(factors, error, size)
    error[:] = (slope1 - 2.0 * slope2 + error) / 6.0
    return touching


@compiled
def _explicit_step(time, step, state, stages, model, workspace):
    """Make an explicit step into the stages TRIAL and ERROR.

    Returns whether dogs touch at the end.
    """
    k1 = stages[K1]
    k2 = stages[K2]
    k3 = stages[K3]
    k4 = stages[K4]
    trial = stages[TRIAL]
    error = stages[ERROR]
    for i in range(STATE_SIZE):
        trial[i] = state[i] + 0.5 * step * k1[i]
    rates(time + 0.5 * step, trial, k2, model, workspace)
    for i in range(STATE_SIZE):
        trial[i] = state[i] + 0.75 * step * k2[i]
    rates(time + 0.75 * step, trial, k3, model, workspace)
    for i in range(STATE_SIZE):
        trial[i] = state[i] + step * (2.0 * k1[i] + 3.0 * k2[i] + 4.0 * k3[i]) / 9.0
    touching = rates(time + step, trial, k4, model, workspace)
    for i in range(STATE_SIZE):
        error[i] = -5.0 * k1[i] / 72.0 + k2[i] / 12.0 + k3[i] / 9.0 - 0.125 * k4[i]
    return touching


@compiled
def _control_step(error, max_growth, last_error):
    """Control the length of the next step by the errors of two steps over their tolerance.

    Returns
    -------
    tuple of float
        Factor on the step, largest factor on the step after it, error that then counts as the
        last one. After a refused step there is no growth.
    """
    if error > 1.0:
        factor = max(MIN_GROWTH, GROWTH_SAFETY * error ** (-1.0 / 3.0))
        return factor, 1.0, last_error
    exponent = PREDICTIVE_GAIN - ERROR_ORDER
    factor = GROWTH_SAFETY * max(error, MIN_ERROR) ** exponent * last_error**PREDICTIVE_GAIN
    return min(max_growth, factor), MAX_GROWTH, max(error, MIN_LAST_ERROR)


@compiled
def _largest_error(step, errors, numbers, limits):
    """Compute the largest error of a step over its tolerance."""
    largest = 0.0
    for i in range(numbers.state_size):
        error = abs(step * errors[i])
        if IS_TURNING[i]:
            error *= numbers.mean_radius
        tolerance = limits.place_error if IS_PLACE[i] else limits.speed_error
        largest = max(largest, error / tolerance)
    return largest if math.isfinite(largest) else INFINITE_ERROR


@making
def _reason_to_stop(at_look, time, state, look_state, timeout, numbers, knots):
    """Decide whether the shift is at its end: ENGAGED, HELD, or PAUSED for neither.

    ``at_look`` is true after the step before a look, others as for ``advance``.
    """
    arrived = state[DISPLACEMENT] >= numbers.shift_travel
    if numbers.has_linkage:
        arrived = arrived and state[ACTUATOR_DISPLACEMENT] >= numbers.shift_travel
    if arrived:
        return ENGAGED
    if not at_look or not look_state.size:
        return PAUSED
    held = stands_still(time, look_state, state, timeout - time, numbers, knots)
    look_state[:] = state
    return HELD if held else PAUSED


@compiled
def _next_look(time, look_state, timeout):
    """Compute the time of the next look whether the rings stand still, s."""
    if not look_state.size:
        return timeout
    return min(STILL_WINDOW_S * (math.floor(time / STILL_WINDOW_S + 1e-9) + 1.0), timeout)


@inlined
def _evaluations_of(implicit, renew):
    """Count the evaluations of the rates in a step, with a new Jacobian for ``renew``."""
    if not implicit:
        return 3
    return 7 if renew else 2


@inlined
def _accept_step(touching, state, stages, mode):
    """Copy the end of a step to the state, and its rates to the start of the next step."""
    for i in range(STATE_SIZE):
        state[i] = stages[TRIAL, i]
        stages[K1, i] = stages[K4, i]
    mode.steps_in_touch = mode.steps_in_touch + 1.0 if touching else 0.0


@inlined
def _switch_mode(implicit, touching, step, mode):
    """Switch to implicit steps where dogs stay in touch, and back where that gains nothing.

    ``step`` is the next one, s.
    """
    if not implicit:
        mode.explicit_step = step if mode.steps_in_touch >= STIFF_AFTER_STEPS else 0.0
    elif not touching or step < mode.explicit_step:
        mode.explicit_step = 0.0
        mode.steps_in_touch = 0.0


@making
def advance(time, step, state, look_state, pause, timeout, model, limits, mode, times, states):
    """Integrate until the travel is made, the rings are held, or time or record are at an end.

    Parameters
    ----------
    time, step : now, and the step to try, s.
    state : (14,); holds the last state afterwards.
    look_state : state at the last look whether the rings stand still, every ``STILL_WINDOW_S``,
        (14,); NaN where there was none, and of size 0 where nobody looks.
    pause, timeout : end of this call and of the shift, s.
    model : ``ShiftModel``.
    limits : ``StepLimits``.
    mode : a record of ``STEP_MODE``, (1,), zeros at the start; the next call continues with it.
    times, states : arrays for the recorded steps, s, (n,), and (n, 14).

    Returns
    -------
    StepProgress
        Why it ended, and what the next call begins with.
    """
    numbers = model.numbers[0]
    model_row = ShiftModel(numbers, model.knots, model.surfaces, model.law[0])
    mode_row = mode[0]
    workspace = clip_workspace(model.surfaces.normals.shape[0])
    stages = np.empty((STAGE_ROWS, STATE_SIZE))
    jacobian = np.zeros((STATE_SIZE + 1, STATE_SIZE))
    factors = np.empty((STATE_SIZE, STATE_SIZE))
    touching = rates(time, state, stages[K1], model_row, workspace)
    recorded = 0
    evaluations = 1
    jacobian_age = MAX_JACOBIAN_AGE
    max_growth = MAX_GROWTH
    last_error = 1.0
    while time < pause:
        if recorded >= times.shape[0]:
            return StepProgress(FULL, time, step, recorded, evaluations)
        look = _next_look(time, look_state, timeout)
        stop = min(look, pause)
        to_stop = time + step >= stop
        length = stop - time if to_stop else step
        implicit = mode_row.explicit_step > 0.0
        renew = implicit and jacobian_age >= MAX_JACOBIAN_AGE
        if renew:
            jacobian_age = 0
        evaluations += _evaluations_of(implicit, renew)
        # Each step is called here alone: a function between would be optimized once more with both.
        if implicit:
            touches = _implicit_step(
                time, length, renew, state, stages, jacobian, factors, model_row, workspace
            )
        else:
            touches = _explicit_step(time, length, state, stages, model_row, workspace)
        error = _largest_error(length, stages[ERROR], numbers, limits)
        if error <= 1.0:
            time = stop if to_stop else time + length
            _accept_step(touches, state, stages, mode_row)
            times[recorded] = time
            states[recorded] = state
            recorded += 1
            jacobian_age = MAX_JACOBIAN_AGE if to_stop else jacobian_age + 1
            touching = touches
            at_look = to_stop and stop == look
            reason = _reason_to_stop(
                at_look, time, state, look_state, timeout, numbers, model.knots
            )
            if reason != PAUSED:
                return StepProgress(reason, time, step, recorded, evaluations)
        elif length < MIN_STEP_S:
            return StepProgress(UNDERFLOW, time, step, recorded, evaluations)
        else:
            jacobian_age = MAX_JACOBIAN_AGE if jacobian_age > 0 else 0
        factor, max_growth, last_error = _control_step(error, max_growth, last_error)
        if not to_stop or factor < 1.0:
            step = min(length * factor, limits.max_step)
        if not implicit:
            jacobian_age = MAX_JACOBIAN_AGE
        _switch_mode(implicit, touching, step, mode_row)
    return StepProgress(PAUSED, time, step, recorded, evaluations)


@compiled
def _force_is_up(time, look_state, state, numbers, knots):
    """Decide whether the force was half up at the last look, or an actuator's grows no more."""
    earlier_push = push_at(time - STILL_WINDOW_S, look_state, knots, numbers)
    if numbers.actuator.kind == FORCE_PROFILE:
        return earlier_push >= 0.5 * knots[KNOT_FORCE, -1]
    push = push_at(time, state, knots, numbers)
    return push > 0.0 and abs(push - earlier_push) <= MAX_PUSH_CHANGE * push


@making
def stands_still(time, look_state, state, remaining, numbers, knots):
    """Decide whether the rings are held, once the force is half up and would move free ones.

    Parameters
    ----------
    time, remaining : of ``state``, and to the time-out, s.
    look_state, state : (14,), one ``STILL_WINDOW_S`` apart; NaN where there is none before.
    """
    if math.isnan(look_state[OUTPUT_ANGLE]):
        return False
    if not _force_is_up(time, look_state, state, numbers, knots):
        return False
    states = np.empty((2, STATE_SIZE))
    states[0] = look_state
    states[1] = state
    # A side may still turn, in its play or on its shaft, and set its ring going.
    for row in states:
        sliding_speed, output_speed = side_speeds(row, numbers)
        input_twist_rate = abs(sliding_speed - row[SLIDING_SPEED])
        output_twist_rate = abs(output_speed - row[OUTPUT_SPEED])
        if numbers.mean_radius * max(input_twist_rate, output_twist_rate) > STILL_SLIP_M_S:
            return False
    if numbers.has_drive and _has_pack(numbers):
        # Held rings turn on together, and the torque of the pack follows their speed.
        earlier_pack = _pack(look_state, numbers)
        pack = _pack(state, numbers)
        states[0] = state + (state - look_state) * (remaining / STILL_WINDOW_S)
        later_pack = _pack(states[0], numbers)
        if max(abs(later_pack - pack), abs(earlier_pack - pack)) > MAX_PACK_CHANGE * abs(pack):
            return False
        states[0] = look_state
    return stays_held(states, STILL_WINDOW_S, remaining, numbers)


@compiled
def stays_held(states, span, remaining, numbers):
    """Decide whether rings stand still, and creep and its growth would not free them in time.

    Parameters
    ----------
    states : over the last ``span`` s, (n, 6 or more).
    remaining : time to the time-out, s.
    """
    first = states[0]
    last = states[-1]
    turning_slip = 0.0
    axial_slip = 0.0
    for state in states:
        relative_speed = abs(state[OUTPUT_SPEED] - state[SLIDING_SPEED])
        turning_slip = max(turning_slip, numbers.mean_radius * relative_speed)
        axial_slip = max(axial_slip, abs(state[AXIAL_SPEED]))
    if max(turning_slip, abs(last[AXIAL_SPEED])) > STILL_SLIP_M_S:
        return False
    relative_growth = (
        last[OUTPUT_SPEED] - last[SLIDING_SPEED] - first[OUTPUT_SPEED] + first[SLIDING_SPEED]
    )
    slip_growth = numbers.mean_radius * abs(relative_growth)
    axial_growth = abs(last[AXIAL_SPEED] - first[AXIAL_SPEED])
    turning_creep = turning_slip * remaining + 0.5 * slip_growth / span * remaining * remaining
    axial_creep = axial_slip * remaining + 0.5 * axial_growth / span * remaining * remaining
    angle = last[OUTPUT_ANGLE] - last[SLIDING_ANGLE]
    displacement = last[DISPLACEMENT]
    freeing_slip = np.inf
    if faces_meet(angle, displacement, numbers):
        overlap, max_overlap, _ = overlapping_surfaces(face_overlap(angle, numbers), numbers)
        freeing_slip = min(overlap, max_overlap - overlap)
    remaining_travel = numbers.shift_travel - displacement
    return turning_creep < 0.5 * freeing_slip and axial_creep < 0.5 * remaining_travel
