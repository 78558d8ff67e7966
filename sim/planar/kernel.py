r"""Contact of one dog with the opposite ring, plane by plane, and the motion it gives; compiled.

Below the skin of the compliant dog the pressure is stiffness times the least of the depths
:math:`d_i = o_i - n_i \cdot p` below its planes. A touching quadrilateral of a rigid dog is cut to
where :math:`d_i` is the least and positive; over that polygon the traction (Hunt and Crossley 1975)

.. math:: t = k d_i (1 + D v_n)_+ \left(n + \mu \, s(|v_t|) \frac{v_t}{|v_t|}\right)

is integrated by three points in each triangle of a fan. Steps: Bogacki and Shampine's pair 3(2)
(1989); where dogs stay in touch, Shampine and Reichelt's linearly implicit pair 2(3) (1997). One
file: the compiler's cache knows of changes in a function's own file alone.
"""

# mypy: disable-error-code="no-untyped-def"

from __future__ import annotations

import math

import numpy as np
from numba import njit

compiled = njit(cache=True, error_model="numpy")

#: A rigid plane meets the pressure of a plane only where it presses against it: cosine between
#: its normal and the pressure's gradient, at least (112.5 degrees).
OPPOSED = math.cos(0.625 * math.pi)
MARGIN = 1.02  #: by which an overlap is looked for before dogs can touch
ROOM = 9  #: corners of a quadrilateral cut by the planes of a dog, at most, beyond their number
VALUES = 3  #: place for values at corners behind a polygon and two cut ones
#: Angles of both rings, way, their rates; way and speed of the actuator; angle and rate of what is
#: behind the sliding ring's shaft and the output ring's.
SIZE = 12
PLAIN_SIZE, LINKED_SIZE = 6, 8  #: without shafts that give way, and without an actuator apart
#: Which numbers of a state are angles or ways, and which turn.
PLACES = np.array([True, True, True, False, False, False, *[True, False] * 3])
TURNS = np.array([True, False, True, True, False, True, False, False, *[True] * 4])
#: Why ``advance`` returned.
ENGAGED, PAUSED, FULL, LOST = range(4)
LEAST = 1e-12  #: s, a step below which the integration is lost
ROSENBROCK = 1.0 / (2.0 + math.sqrt(2.0))  #: of a step, its implicit part
#: Changes of a place in m, a speed in m/s and a time in s by which slopes are measured.
SMALL_WAY, SMALL_SPEED, SMALL_TIME = 1e-9, 1e-6, 1e-7
KEPT = 8  #: steps for which slopes are kept
PATIENCE = 60  #: steps in touch after which implicit ones are tried
#: In ``mode``: steps in touch; the step that implicit ones must exceed, s.
TOUCHED, BEATEN = range(2)

# Places in ``plain``, the numbers of a clutch.
(SLEEVE, FAR, SLIDING, OUTPUT, DAMPING, FRICTION, DETENT, DETENT_AT, DETENT_WIDTH, SPLINE, DRAG,
 STIFF, LOSS, PLAY, DOGS, REBOUND, STOP, RADIUS, WAY, SLIP_SPEED, TURN_SPEED, DEEP_STOP,
 LINKED, USED, BEHIND, SHAFT, SHAFT_LOSS, BACKLASH, AHEAD, OUT_SHAFT, OUT_LOSS,
 TWIST) = range(32)  # fmt: skip
NUMBERS = 32
_FAR, _NEAR = 2.0 / 3.0, 1.0 / 6.0
#: Places of a triangle's three points, as shares of its corners.
POINTS = ((_FAR, _NEAR, _NEAR), (_NEAR, _FAR, _NEAR), (_NEAR, _NEAR, _FAR))
STOP_LOSS = 100.0  #: s/m, dissipation of the stop behind the ring, as in the Drake plant


@compiled
def workspace(planes):
    """Make room for the polygons of a dog with a number of planes that touch."""
    return np.empty((VALUES + 1, ROOM + planes, 3 + planes))


@compiled
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
    columns = work.shape[2]
    kept, last = 0, count - 1
    before = values[last, 0]
    for i in range(count):
        value = values[i, 0]
        if (value > 0.0) != (before > 0.0):
            share = before / (before - value)
            for column in range(columns):
                start = work[here, last, column]
                work[there, kept, column] = start + share * (work[here, i, column] - start)
            kept += 1
        if value > 0.0:
            for column in range(columns):
                work[there, kept, column] = work[here, i, column]
            kept += 1
        before = value
        last = i
    return kept, there


@compiled
def friction_at(slip, law):
    """Compute the friction coefficient at a slip in m/s; ``law`` as for ``contact``."""
    ratio = slip / law[3]
    if law[4] == law[2]:
        return law[2] * 0.6366197723675814 * math.atan(ratio)
    late = ratio - 10.0
    fall = late / math.sqrt(1.0 + late * late) / 0.9950371902099892
    held = (law[4] - law[2]) * 0.5 * (1.0 - fall) + law[2]
    return held * ratio / math.sqrt(1.0 + ratio * ratio)


@compiled
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
    work : of ``workspace``: a whole polygon, two cut ones, and values at corners.

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
        # Flanks of one kind lie half a pitch from each other less what they lean and half of the
        # backlash, at the radius where that is least, and MARGIN.
        free = 0.5 * pitch * MARGIN - surfaces[3][2]
        if -place >= free - distance * ahead or place >= free - distance * behind:
            continue
        c, s = math.cos(place), math.sin(place)
        for quad in range(surfaces[1].shape[0]):
            if _meets(quad, c, s, distance, surfaces, work):
                force, moment = _surface(quad, c, s, turn, speed, surfaces, law, work)
                axial += force
                torque += moment
    return axial, torque


@compiled
def _meets(quad, c, s, distance, surfaces, work):
    """Place a rigid surface in the compliant dog's frame, with its depths; whether it may touch.

    ``work[0]`` gets corners and their depths below all planes, m.
    """
    corners, normals, offsets = surfaces[0], surfaces[1], surfaces[2]
    planes = normals.shape[0]
    for i in range(4):
        x, y, z = corners[quad, i, 0], corners[quad, i, 1], corners[quad, i, 2]
        work[0, i, 0], work[0, i, 1], work[0, i, 2] = c * x - s * y, -(s * x + c * y), distance - z
    for turn in range(planes):
        plane = (quad + turn) % planes  # its like is the one that it most often lies outside of
        nx, ny, nz = normals[plane, 0], normals[plane, 1], normals[plane, 2]
        deepest = -1.0
        for i in range(4):
            along = nx * work[0, i, 0] + ny * work[0, i, 1] + nz * work[0, i, 2]
            work[0, i, 3 + plane] = offsets[plane] - along
            deepest = max(deepest, work[0, i, 3 + plane])
        if deepest <= 0.0:
            return False
    return True


@compiled
def _is_least_somewhere(work, plane, planes):
    """Decide whether a plane's depth may be the least; not where another is at every corner."""
    column = 3 + plane
    for other in range(plane + 1, plane + planes):
        depth, more = 3 + other % planes, False
        for i in range(4):
            more |= work[0, i, depth] > work[0, i, column]
        if not more:
            return False
    return True


@compiled
def _surface(quad, c, s, turn, speed, surfaces, law, work):
    """Cut a rigid surface, ``work[0]``, by the least depth and integrate over each part."""
    normals = surfaces[1]
    mx = c * normals[quad, 0] - s * normals[quad, 1]
    my = -(s * normals[quad, 0] + c * normals[quad, 1])
    normal = (mx, my, -normals[quad, 2])
    planes = normals.shape[0]
    axial, torque = 0.0, 0.0
    for plane in range(planes):
        along = mx * normals[plane, 0] + my * normals[plane, 1] + normal[2] * normals[plane, 2]
        if -along <= OPPOSED:
            continue
        if not _is_least_somewhere(work, plane, planes):
            continue
        column = 3 + plane
        count, where = _cut(work, 0, 4, column, -1)
        for other in range(plane + 1, plane + planes):
            if count > 2:
                count, where = _cut(work, where, count, 3 + other % planes, column)
        for i in range(1, count - 1):
            force, moment = _triangle(work, where, i, column, normal, turn, speed, law)
            axial += force
            torque += moment
    return axial, torque


@compiled
def _triangle(work, where, i, column, normal, turn, speed, law):
    """Integrate the traction over the triangle of corners 0, i and i + 1 of a polygon."""
    mx, my, mz = normal
    p, q, r = work[where, 0], work[where, i], work[where, i + 1]
    ax, ay, az = q[0] - p[0], q[1] - p[1], q[2] - p[2]
    bx, by, bz = r[0] - p[0], r[1] - p[1], r[2] - p[2]
    ux, uy, uz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
    weight = math.sqrt(ux * ux + uy * uy + uz * uz) / 6.0
    axial, torque = 0.0, 0.0
    for f0, f1, f2 in POINTS:
        x, y = f0 * p[0] + f1 * q[0] + f2 * r[0], f0 * p[1] + f1 * q[1] + f2 * r[1]
        depth = f0 * p[column] + f1 * q[column] + f2 * r[column]
        vx, vy, vz = turn * y, -turn * x, -speed
        closing = vx * mx + vy * my + vz * mz
        pressure = law[0] * depth * max(1.0 + law[1] * closing, 0.0) * weight
        vx, vy, vz = vx - closing * mx, vy - closing * my, vz - closing * mz
        slip = math.sqrt(vx * vx + vy * vy + vz * vz)
        rub = friction_at(slip, law) / slip if slip > 1e-12 else 0.0
        axial -= pressure * (mz + rub * vz)
        torque -= pressure * (x * (my + rub * vy) - y * (mx + rub * vx))
    return axial, torque


@compiled
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
        low, high = (middle, high) if knots[0, middle] <= time else (low, middle)
    step = knots[0, high] - knots[0, low]
    s = (time - knots[0, low]) / step
    t = 1.0 - s
    return (
        (1.0 + 2.0 * s) * t * t * knots[1, low]
        + s * t * t * step * knots[2, low]
        + s * s * (3.0 - 2.0 * s) * knots[1, high]
        - s * s * t * step * knots[2, high]
    )


@compiled
def _smooth(value, small):
    return value / math.sqrt(value * value + small * small)


@compiled
def _spring(stretch, rate, stiff, loss, low, high, deep):
    """Compute a spring's force, or that of two stops (``sim.shift.mechanism.spring_force``)."""
    if low == high:
        return stiff * stretch + loss * rate
    ahead, behind = max(stretch - high, 0.0), max(low - stretch, 0.0)
    push = max(ahead * (stiff + loss * rate / (ahead + deep)), 0.0)
    return push - max(behind * (stiff - loss * rate / (behind + deep)), 0.0)


@compiled
def _forces(state, plain, surfaces, law, work):
    """Compute force along and torque about the shaft of all dogs at a state (12,), N and N m."""
    if state[1] <= surfaces[5]:
        return 0.0, 0.0
    angle, turn = state[0] - state[2], state[3] - state[5]
    distance = surfaces[6] - state[1]
    along, about = contact(angle, distance, turn, state[4], surfaces, law, work)
    return along * plain[DOGS], about * plain[DOGS]


@compiled
def _motion(push, along, about, state, out, plain):
    """Write the rates of a state (12,) into ``out``: ``push`` of the actuator, contact's forces."""
    way, speed = state[1], state[4]
    behind = 0.0
    if way < -plain[REBOUND]:
        depth = -plain[REBOUND] - way
        behind = max(plain[STOP] * depth * (1.0 - STOP_LOSS * speed), 0.0)
    drive = push
    out[6], out[7] = speed, 0.0
    if plain[LINKED] > 0.0:
        u, rate, deep = state[6] - way, state[7] - speed, plain[DEEP_STOP]
        drive = _spring(u, rate, plain[STIFF], plain[LOSS], 0.0, plain[PLAY], deep)
        out[6] = state[7]
        out[7] = (push - drive) / plain[FAR]
    held = 0.0
    if plain[DETENT] != 0.0:
        place = 2.0 * (way - plain[DETENT_AT]) / plain[DETENT_WIDTH]
        bump = max(1.0 - place * place, 0.0)
        held += plain[DETENT] * bump * bump
    drive_torque, through = 0.0, about
    if plain[BEHIND] > 0.0:
        half, u, rate = 0.5 * plain[BACKLASH], state[8] - state[2], state[9] - state[5]
        stiff, loss = plain[SHAFT], plain[SHAFT_LOSS]
        through = drive_torque = _spring(u, rate, stiff, loss, -half, half, plain[TWIST])
    rub = plain[FRICTION] + plain[SPLINE] * abs(through)
    if rub > 0.0:
        held += rub * _smooth(speed, plain[SLIP_SPEED])
    drag = 0.0
    if plain[DRAG] > 0.0:
        drag = plain[DRAG] * _smooth(state[9 if plain[BEHIND] > 0.0 else 5], plain[TURN_SPEED])
    out[0], out[1], out[2] = state[3], speed, state[5]
    out[4] = (drive - held - plain[DAMPING] * speed - along + behind) / plain[SLEEVE]
    out[8:] = 0.0
    if plain[BEHIND] > 0.0:
        out[5] = (about + drive_torque) / plain[SLIDING]
        out[8], out[9] = state[9], -(drive_torque + drag) / plain[BEHIND]
    else:
        out[5] = (about - drag) / plain[SLIDING]
    if plain[AHEAD] > 0.0:
        lead, rate = state[10] - state[0], state[11] - state[3]
        back = plain[OUT_SHAFT] * lead + plain[OUT_LOSS] * rate
        out[3] = (back - about) / plain[OUTPUT]
        out[10], out[11] = state[11], -back / plain[AHEAD]
    else:
        out[3] = -about / plain[OUTPUT]


@compiled
def rates(time, state, out, plain, knots, surfaces, law, work):
    """Write the rates of a state (12,) into ``out``; whether dogs touch."""
    along, about = _forces(state, plain, surfaces, law, work)
    _motion(force_at(time, knots), along, about, state, out, plain)
    return along != 0.0 or about != 0.0


@compiled
def _slopes(time, state, now, slopes, plain, knots, surfaces, law, work):
    """Write into ``slopes`` (13, 12) how the rates ``now`` change with the state, and in time.

    Contact follows from relative angle and speed: of either ring's, one is looked at.
    """
    push, along, about = force_at(time, knots), 0.0, 0.0
    changed = slopes[SIZE]
    more, moved = np.zeros(SIZE), np.zeros(SIZE)
    for j in (SIZE, 0, 1, 3, 4):  # the last one first: nothing is changed
        small = _small(j, plain)
        if j < SIZE:
            state[j] += small
        one, other = _forces(state, plain, surfaces, law, work)
        if j == SIZE:
            along, about = one, other
            continue
        state[j] -= small
        more[j], moved[j] = one - along, other - about
    more[2], moved[2], more[5], moved[5] = -more[0], -moved[0], -more[3], -moved[3]
    for j in range(int(plain[USED])):
        small, was = _small(j, plain), state[j]
        state[j] = was + small
        _motion(push, along + more[j], about + moved[j], state, changed, plain)
        state[j] = was
        slopes[j] = (changed - now) / small
    _motion(force_at(time + SMALL_TIME, knots), along, about, state, changed, plain)
    changed[:] = (changed - now) / SMALL_TIME


@compiled
def _small(j, plain):
    """Give the change of a state's number ``j`` by which slopes are measured."""
    small = SMALL_WAY if PLACES[j] else SMALL_SPEED
    return small / plain[RADIUS] if TURNS[j] else small


@compiled
def _factor(step, slopes, matrix, size):
    """Factor ``1 - step J`` in place, (12, 12), without exchange of rows."""
    for i in range(size):
        for j in range(size):
            matrix[i, j] = (1.0 if i == j else 0.0) - step * slopes[j, i]
    for k in range(size):
        for i in range(k + 1, size):
            share = matrix[i, k] / matrix[k, k]
            matrix[i, k] = share
            if share != 0.0:
                for j in range(k + 1, size):
                    matrix[i, j] -= share * matrix[k, j]


@compiled
def _solve(matrix, right, size):
    """Replace a right-hand side by the solution, with the factors of ``_factor``."""
    for i in range(size):
        for j in range(i):
            right[i] -= matrix[i, j] * right[j]
    for i in range(size - 1, -1, -1):
        for j in range(i + 1, size):
            right[i] -= matrix[i, j] * right[j]
        right[i] /= matrix[i, i]


@compiled
def _implicit(
    time, h, new, state, stages, trial, slopes, matrix, plain, knots, surfaces, law, work
):
    """Make a step of ``h`` into ``trial``; its error into the third of the stages.

    ``new`` slopes are measured first.
    """
    k1, k2, k3, k4 = stages
    if new:
        _slopes(time, state, k1, slopes, plain, knots, surfaces, law, work)
    size = int(plain[USED])
    part = h * ROSENBROCK
    _factor(part, slopes, matrix, size)
    one = k1 + part * slopes[SIZE]
    _solve(matrix, one, size)
    trial[:] = state + 0.5 * h * one
    rates(time + 0.5 * h, trial, k2, plain, knots, surfaces, law, work)
    two = k2 - one
    _solve(matrix, two, size)
    two += one
    trial[:] = state + h * two
    touch = rates(time + h, trial, k4, plain, knots, surfaces, law, work)
    k3[:] = k4 - (6.0 + math.sqrt(2.0)) * (two - k2) - 2.0 * (one - k1) + part * slopes[SIZE]
    _solve(matrix, k3, size)
    k3[:] = (one - 2.0 * two + k3) / 6.0
    return touch


@compiled
def _explicit(time, h, state, stages, trial, plain, knots, surfaces, law, work):
    """Make a step of ``h`` into ``trial``; its error into the third of the stages."""
    k1, k2, k3, k4 = stages
    for i in range(SIZE):
        trial[i] = state[i] + 0.5 * h * k1[i]
    rates(time + 0.5 * h, trial, k2, plain, knots, surfaces, law, work)
    for i in range(SIZE):
        trial[i] = state[i] + 0.75 * h * k2[i]
    rates(time + 0.75 * h, trial, k3, plain, knots, surfaces, law, work)
    for i in range(SIZE):
        trial[i] = state[i] + h * (2.0 * k1[i] + 3.0 * k2[i] + 4.0 * k3[i]) / 9.0
    touch = rates(time + h, trial, k4, plain, knots, surfaces, law, work)
    for i in range(SIZE):
        k3[i] = -5.0 * k1[i] / 72.0 + k2[i] / 12.0 + k3[i] / 9.0 - 0.125 * k4[i]
    return touch


@compiled
def _worst(h, error, plain, tolerance):
    """Compute the largest error over its tolerance."""
    worst = 0.0
    for i in range(int(plain[USED])):
        one = abs(h * error[i])
        if TURNS[i]:
            one *= plain[RADIUS]
        worst = max(worst, one / (tolerance[1] if PLACES[i] else tolerance[0]))
    return worst if math.isfinite(worst) else 1e3


@njit(cache=True, error_model="numpy", nogil=True)
def advance(
    time, step, state, until, plain, knots, surfaces, law, tolerance, max_step, mode, times, states
):
    """Integrate until the travel is made, a time is reached or the record is full.

    Parameters
    ----------
    time, step : now, and the step to try, s.
    state : (12,); holds the last state afterwards.
    until : s.
    tolerance : error of a speed in m/s and of a place in m that a step may have, (2,).
    mode : of the steps, (2,), zeros at the start; holds what the next call goes on with.
    times, states : room for the record, (n,) and (n, 12).

    Returns
    -------
    tuple
        Why it ended, time, next step, number of recorded steps, evaluations.
    """
    work = workspace(surfaces[1].shape[0])
    stages = (np.empty(SIZE), np.empty(SIZE), np.empty(SIZE), np.empty(SIZE))
    k1, _, k3, k4 = stages
    trial, slopes, matrix = np.empty(SIZE), np.zeros((SIZE + 1, SIZE)), np.empty((SIZE, SIZE))
    touch = rates(time, state, k1, plain, knots, surfaces, law, work)
    count, spent = 0, 1
    age = KEPT  # of the slopes, in steps
    while time < until:
        if count >= times.shape[0]:
            return FULL, time, step, count, spent
        last = time + step >= until
        h = until - time if last else step
        stiff = mode[BEATEN] > 0.0
        if stiff:
            new = age >= KEPT
            spent, age = spent + (5 if new else 0), 0 if new else age
            touches = _implicit(
                time, h, new, state, stages, trial, slopes, matrix,
                plain, knots, surfaces, law, work,
            )  # fmt: skip
        else:
            touches = _explicit(time, h, state, stages, trial, plain, knots, surfaces, law, work)
        spent += 2 if stiff else 3
        worst = _worst(h, k3, plain, tolerance)
        if worst <= 1.0:
            time = until if last else time + h
            state[:] = trial
            k1[:] = k4
            states[count] = trial
            times[count] = time
            count += 1
            age += 1
            touch = touches
            mode[TOUCHED] = mode[TOUCHED] + 1.0 if touch else 0.0
            if state[1] >= plain[WAY] and (plain[LINKED] == 0.0 or state[6] >= plain[WAY]):
                return ENGAGED, time, step, count, spent
        elif h < LEAST:
            return LOST, time, step, count, spent
        else:
            age = KEPT if age > 0 else 0
        grown = min(5.0, max(0.1, 0.9 * worst ** (-1.0 / 3.0)))
        if not last or grown < 1.0:
            step = min(h * grown, max_step)
        # Implicit steps where dogs stay in touch, and back where that gains nothing.
        if not stiff:
            age = KEPT
            mode[BEATEN] = step if mode[TOUCHED] >= PATIENCE else 0.0
        elif not touch or step < mode[BEATEN]:
            mode[BEATEN], mode[TOUCHED] = 0.0, 0.0
    return PAUSED, time, step, count, spent
