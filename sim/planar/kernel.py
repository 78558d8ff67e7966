r"""Contact of one dog with the opposite ring, plane by plane, and the motion it gives; compiled.

The rings stay coaxial, so the motion has two degrees of freedom: the relative angle
:math:`\varphi` and the axial distance *Z* of the median planes. Each touching surface of a rigid
dog is a plane quadrilateral (``sim.shift.mesh.rigid_dog``). Below the skin of the compliant dog
the pressure is stiffness times the least of three depths :math:`d_i = o_i - n_i \cdot p`, one for
each plane that touches.

In the frame of the compliant dog the quadrilateral is cut to the region where :math:`d_i` is the
least depth and positive. What is left is a convex polygon with a pressure that is linear over
it. Over that polygon

.. math:: t = k d_i (1 + D v_n)_+ \left(n + \mu \, s(|v_t|) \frac{v_t}{|v_t|}\right)

is integrated by three points in each triangle of a fan, which is exact for the normal part: *n* is
the rigid plane's outward normal, *v* the speed of the rigid against the compliant dog, with its
parts :math:`v_n = v \cdot n` and :math:`v_t` (Hunt and Crossley 1975; the hydroelastic model of
Elandt, Drumwright, Sherman and Ruina 2019 for a rigid and a compliant body).

The motion between is integrated by Bogacki and Shampine's pair of orders 3 and 2 (1989), whose last
stage is the next step's first, with the equations of ``sim.shift.mechanism``. The step follows the
largest error of a speed (axial, or of either ring at the mean radius) and of the places, and never
exceeds ``max_step``.

All of it is one file: the compiler's cache on disk knows of changes in a function's own file alone.
"""

# mypy: disable-error-code="no-untyped-def"

from __future__ import annotations

import math

import numpy as np
from numba import njit

#: A rigid plane meets the pressure of a plane only where it presses against it: cosine between
#: its normal and the pressure's gradient, at least (112.5 degrees).
OPPOSED = math.cos(0.625 * math.pi)
MARGIN = 1.02  #: by which an overlap is looked for before dogs can touch
ROOM = 12  #: corners of a cut quadrilateral, at most
VALUES = 3  #: place for values at corners behind a polygon and two cut ones
SIZE = 8  #: angles of both rings, way, their rates; way and speed of the actuator
#: Why ``advance`` returned.
ENGAGED, PAUSED, FULL, LOST = range(4)
#: Kept on disk; a division by zero gives an infinity, which ``advance`` looks for.
COMPILED = {"cache": True, "error_model": "numpy"}
LEAST = 1e-12  #: s, a step below which the integration is lost

# Places in ``plain``, the numbers of a clutch.
(SLEEVE, FAR, SLIDING, OUTPUT, DAMPING, FRICTION, DETENT, DETENT_AT, DETENT_WIDTH, SPLINE, DRAG,
 STIFF, LOSS, PLAY, DOGS, REBOUND, STOP, RADIUS, WAY, SLIP_SPEED, TURN_SPEED, DEEP_STOP,
 LINKED) = range(23)  # fmt: skip
NUMBERS = 23
STOP_LOSS = 100.0  #: s/m, dissipation of the stop behind the ring, as in the Drake plant


@njit(**COMPILED)
def _cut(work, here, count, a, b):
    """Keep of polygon ``here`` what has more in column ``a`` than in ``b``; b < 0: than 0.

    Returns the number of corners that are left, and where: in the same place if all are, else in
    the one of the two places for cut polygons that is free.
    """
    values = work[VALUES]
    more, less = False, False
    for i in range(count):
        value = work[here, i, a] - (work[here, i, b] if b >= 0 else 0.0)
        values[i, 0] = value
        more |= value > 0.0
        less |= value <= 0.0
    if not more:
        return 0, here
    if not less:
        return count, here
    there = 2 if here == 1 else 1
    kept, last = 0, count - 1
    before = values[last, 0]
    for i in range(count):
        value = values[i, 0]
        if (value > 0.0) != (before > 0.0):
            share = before / (before - value)
            for column in range(6):
                start = work[here, last, column]
                work[there, kept, column] = start + share * (work[here, i, column] - start)
            kept += 1
        if value > 0.0:
            for column in range(6):
                work[there, kept, column] = work[here, i, column]
            kept += 1
        before = value
        last = i
    return kept, there


@njit(**COMPILED)
def friction_at(slip, law):
    """Compute the friction coefficient at a slip in m/s; ``law`` as for ``contact``."""
    ratio = slip / law[3]
    if law[4] == law[2]:
        return law[2] * 0.6366197723675814 * math.atan(ratio)
    late = ratio - 10.0
    fall = late / math.sqrt(1.0 + late * late) / 0.9950371902099892
    held = (law[4] - law[2]) * 0.5 * (1.0 - fall) + law[2]
    return held * ratio / math.sqrt(1.0 + ratio * ratio)


@njit(**COMPILED)
def contact(angle, distance, turn, speed, surfaces, law, work):
    """Compute force along and torque about the shaft on the compliant dog.

    Parameters
    ----------
    angle : output ring's lead over dogs facing dogs, rad.
    distance : of the median planes, m.
    turn : output less sliding speed, rad/s.
    speed : of the sliding ring into engagement, m/s.
    surfaces : of ``PlanarClutch``.
    law : of ``PlanarClutch``; equal coefficients select the law of Drake's continuous plant.
    work : room for polygons, (VALUES + 1, ROOM, 6): whole, two cut ones, and values at corners.

    Returns
    -------
    tuple of float
        Force against the shift, N, and torque on the sliding ring, N m; of one dog.
    """
    pitch, ahead, behind = surfaces[4], surfaces[3][0], surfaces[3][1]
    axial, torque = 0.0, 0.0
    base = angle - pitch * np.round(angle / pitch)
    for dog in range(-1, 2):
        place = base + dog * pitch
        # Flanks of one kind lie half a pitch from each other less what they lean, and MARGIN.
        free = 0.5 * pitch * MARGIN
        if -place >= free - distance * ahead or place >= free - distance * behind:
            continue
        c, s = math.cos(place), math.sin(place)
        for quad in range(3):
            if _meets(quad, c, s, distance, surfaces, work):
                force, moment = _surface(quad, c, s, turn, speed, surfaces, law, work)
                axial += force
                torque += moment
    return axial, torque


@njit(**COMPILED)
def _meets(quad, c, s, distance, surfaces, work):
    """Place a rigid surface in the compliant dog's frame, with its depths; whether it may touch.

    ``work[0]`` gets corners and their depths below the three planes, m.
    """
    corners, normals, offsets = surfaces[0], surfaces[1], surfaces[2]
    for i in range(4):
        x, y, z = corners[quad, i, 0], corners[quad, i, 1], corners[quad, i, 2]
        work[0, i, 0], work[0, i, 1], work[0, i, 2] = c * x - s * y, -(s * x + c * y), distance - z
    for turn in range(3):
        plane = (quad + turn) % 3  # its like is the one that it most often lies outside of
        nx, ny, nz = normals[plane, 0], normals[plane, 1], normals[plane, 2]
        deepest = -1.0
        for i in range(4):
            along = nx * work[0, i, 0] + ny * work[0, i, 1] + nz * work[0, i, 2]
            work[0, i, 3 + plane] = offsets[plane] - along
            deepest = max(deepest, work[0, i, 3 + plane])
        if deepest <= 0.0:
            return False
    return True


@njit(**COMPILED)
def _is_least_somewhere(work, column, one, other):
    """Decide whether a depth may be the least; not where another is at every corner."""
    first, second = False, False
    for i in range(4):
        first |= work[0, i, one] > work[0, i, column]
        second |= work[0, i, other] > work[0, i, column]
    return first and second


@njit(**COMPILED)
def _surface(quad, c, s, turn, speed, surfaces, law, work):
    """Cut a rigid surface, ``work[0]``, by the least depth and integrate over each part."""
    normals = surfaces[1]
    mx = c * normals[quad, 0] - s * normals[quad, 1]
    my = -(s * normals[quad, 0] + c * normals[quad, 1])
    normal = (mx, my, -normals[quad, 2])
    axial, torque = 0.0, 0.0
    for plane in range(3):
        along = mx * normals[plane, 0] + my * normals[plane, 1] + normal[2] * normals[plane, 2]
        if -along <= OPPOSED:
            continue
        column, one, other = 3 + plane, 3 + (plane + 1) % 3, 3 + (plane + 2) % 3
        if not _is_least_somewhere(work, column, one, other):
            continue
        count, where = _cut(work, 0, 4, column, -1)
        if count > 2:
            count, where = _cut(work, where, count, one, column)
        if count > 2:
            count, where = _cut(work, where, count, other, column)
        for i in range(1, count - 1):
            force, moment = _triangle(work, where, i, column, normal, turn, speed, law)
            axial += force
            torque += moment
    return axial, torque


@njit(**COMPILED)
def _triangle(work, where, i, column, normal, turn, speed, law):
    """Integrate the traction over the triangle of corners 0, i and i + 1 of a polygon."""
    mx, my, mz = normal
    ax, ay, az = (
        work[where, i, 0] - work[where, 0, 0],
        work[where, i, 1] - work[where, 0, 1],
        work[where, i, 2] - work[where, 0, 2],
    )
    j = i + 1
    bx, by, bz = (
        work[where, j, 0] - work[where, 0, 0],
        work[where, j, 1] - work[where, 0, 1],
        work[where, j, 2] - work[where, 0, 2],
    )
    ux, uy, uz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
    weight = math.sqrt(ux * ux + uy * uy + uz * uz) / 6.0
    axial, torque = 0.0, 0.0
    for point in range(3):
        f0 = 2.0 / 3.0 if point == 0 else 1.0 / 6.0
        f1 = 2.0 / 3.0 if point == 1 else 1.0 / 6.0
        f2 = 2.0 / 3.0 if point == 2 else 1.0 / 6.0
        x = f0 * work[where, 0, 0] + f1 * work[where, i, 0] + f2 * work[where, j, 0]
        y = f0 * work[where, 0, 1] + f1 * work[where, i, 1] + f2 * work[where, j, 1]
        depth = (
            f0 * work[where, 0, column] + f1 * work[where, i, column] + f2 * work[where, j, column]
        )
        vx, vy, vz = turn * y, -turn * x, -speed
        closing = vx * mx + vy * my + vz * mz
        pressure = law[0] * depth * max(1.0 + law[1] * closing, 0.0) * weight
        vx, vy, vz = vx - closing * mx, vy - closing * my, vz - closing * mz
        slip = math.sqrt(vx * vx + vy * vy + vz * vz)
        rub = friction_at(slip, law) / slip if slip > 1e-12 else 0.0
        axial -= pressure * (mz + rub * vz)
        torque -= pressure * (x * (my + rub * vy) - y * (mx + rub * vx))
    return axial, torque


@njit(**COMPILED)
def force_at(time, knots):
    """Evaluate a piecewise cubic: ``knots`` are times, values and slopes, (3, n); held beyond."""
    last = knots.shape[1] - 1
    if time >= knots[0, last]:
        return knots[1, last]
    if time <= knots[0, 0]:
        return knots[1, 0]
    low, high = 0, last
    while high - low > 1:
        middle = (low + high) // 2
        if knots[0, middle] <= time:
            low = middle
        else:
            high = middle
    step = knots[0, high] - knots[0, low]
    s = (time - knots[0, low]) / step
    t = 1.0 - s
    return (
        (1.0 + 2.0 * s) * t * t * knots[1, low]
        + s * t * t * step * knots[2, low]
        + s * s * (3.0 - 2.0 * s) * knots[1, high]
        - s * s * t * step * knots[2, high]
    )


@njit(**COMPILED)
def _smooth(value, small):
    return value / math.sqrt(value * value + small * small)


@njit(**COMPILED)
def _pull(stretch, rate, plain):
    """Compute the linkage's force on the ring, N (``Mechanism.pull``)."""
    stiff, loss, play = plain[STIFF], plain[LOSS], plain[PLAY]
    if play == 0.0:
        return stiff * stretch + loss * rate
    ahead, behind = max(stretch - play, 0.0), max(-stretch, 0.0)
    push = max(ahead * (stiff + loss * rate / (ahead + plain[DEEP_STOP])), 0.0)
    return push - max(behind * (stiff - loss * rate / (behind + plain[DEEP_STOP])), 0.0)


@njit(**COMPILED)
def rates(time, state, out, plain, knots, surfaces, law, work):
    """Write the rates of a state (8,) into ``out``."""
    way, speed = state[1], state[4]
    along, about = 0.0, 0.0
    if way > surfaces[5]:
        angle, turn = state[0] - state[2], state[3] - state[5]
        along, about = contact(angle, surfaces[6] - way, turn, speed, surfaces, law, work)
        along *= plain[DOGS]
        about *= plain[DOGS]
    behind = 0.0
    if way < -plain[REBOUND]:
        depth = -plain[REBOUND] - way
        behind = max(plain[STOP] * depth * (1.0 - STOP_LOSS * speed), 0.0)
    push = force_at(time, knots)
    drive = push
    out[6], out[7] = speed, 0.0
    if plain[LINKED] > 0.0:
        drive = _pull(state[6] - way, state[7] - speed, plain)
        out[6] = state[7]
        out[7] = (push - drive) / plain[FAR]
    held = 0.0
    if plain[DETENT] != 0.0:
        place = 2.0 * (way - plain[DETENT_AT]) / plain[DETENT_WIDTH]
        bump = max(1.0 - place * place, 0.0)
        held += plain[DETENT] * bump * bump
    rub = plain[FRICTION] + plain[SPLINE] * abs(about)
    if rub > 0.0:
        held += rub * _smooth(speed, plain[SLIP_SPEED])
    drag = 0.0
    if plain[DRAG] > 0.0:
        drag = plain[DRAG] * _smooth(state[5], plain[TURN_SPEED])
    out[0], out[1], out[2] = state[3], speed, state[5]
    out[3] = -about / plain[OUTPUT]
    out[4] = (drive - held - plain[DAMPING] * speed - along + behind) / plain[SLEEVE]
    out[5] = (about - drag) / plain[SLIDING]


@njit(**COMPILED)
def _stages(time, h, state, stages, trial, plain, knots, surfaces, law, work):
    """Make a step of ``h`` into ``trial``, with the rates at its four stages."""
    k1, k2, k3, k4 = stages
    for i in range(SIZE):
        trial[i] = state[i] + 0.5 * h * k1[i]
    rates(time + 0.5 * h, trial, k2, plain, knots, surfaces, law, work)
    for i in range(SIZE):
        trial[i] = state[i] + 0.75 * h * k2[i]
    rates(time + 0.75 * h, trial, k3, plain, knots, surfaces, law, work)
    for i in range(SIZE):
        trial[i] = state[i] + h * (2.0 * k1[i] + 3.0 * k2[i] + 4.0 * k3[i]) / 9.0
    rates(time + h, trial, k4, plain, knots, surfaces, law, work)


@njit(**COMPILED)
def _error(h, stages, plain, tolerance):
    """Compare both orders of a step: the largest error over its tolerance."""
    k1, k2, k3, k4 = stages
    worst = 0.0
    for i in range(SIZE if plain[LINKED] > 0.0 else SIZE - 2):
        error = -5.0 * k1[i] / 72.0 + k2[i] / 12.0 + k3[i] / 9.0 - 0.125 * k4[i]
        error = abs(h * error)
        if i % 3 != 1 and i < SIZE - 2:  # an angle or its rate
            error *= plain[RADIUS]
        place = i < 3 or i == SIZE - 2
        worst = max(worst, error / (tolerance[1] if place else tolerance[0]))
    return worst


@njit(nogil=True, **COMPILED)
def advance(
    time, step, state, until, plain, knots, surfaces, law, tolerance, max_step, times, states
):
    """Integrate until the travel is made, a time is reached or the record is full.

    Parameters
    ----------
    time, step : now, and the step to try, s.
    state : (8,); holds the last state afterwards.
    until : s.
    tolerance : error of a speed in m/s and of a place in m that a step may have, (2,).
    times, states : room for the record, (n,) and (n, 8).

    Returns
    -------
    tuple
        Why it ended, time, next step, number of recorded steps, evaluations.
    """
    work = np.empty((VALUES + 1, ROOM, 6))
    k1, k2, k3, k4 = np.empty(SIZE), np.empty(SIZE), np.empty(SIZE), np.empty(SIZE)
    trial = np.empty(SIZE)
    linked = plain[LINKED] > 0.0
    rates(time, state, k1, plain, knots, surfaces, law, work)
    count, spent = 0, 1
    while time < until:
        if count >= times.shape[0]:
            return FULL, time, step, count, spent
        last = time + step >= until
        h = until - time if last else step
        _stages(time, h, state, (k1, k2, k3, k4), trial, plain, knots, surfaces, law, work)
        spent += 3
        worst = _error(h, (k1, k2, k3, k4), plain, tolerance)
        if not math.isfinite(worst):
            worst = 1e3
        if worst <= 1.0:
            time = until if last else time + h
            for i in range(SIZE):
                state[i] = trial[i]
                k1[i] = k4[i]
                states[count, i] = trial[i]
            times[count] = time
            count += 1
            if state[1] >= plain[WAY] and (not linked or state[6] >= plain[WAY]):
                return ENGAGED, time, step, count, spent
        elif h < LEAST:
            return LOST, time, step, count, spent
        grown = 5.0 if worst < 1e-3 else 0.9 * worst ** (-1.0 / 3.0)
        grown = min(5.0, max(0.1, grown))
        if not last or grown < 1.0:
            step = min(h * grown, max_step)
    return PAUSED, time, step, count, spent
