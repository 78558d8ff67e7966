r"""Contact of one dog with the opposite ring, plane by plane, and the motion it gives; compiled.

Below the skin of the compliant dog the pressure is stiffness times the least of the depths
:math:`d_i = o_i - n_i \cdot p` below its planes. A touching quadrilateral of a rigid dog is cut to
where :math:`d_i` is the least and positive; over that polygon the traction (Hunt and Crossley 1975)

.. math:: t = k d_i (1 + D v_n)_+ \left(n + \mu \, s(|v_t|) \frac{v_t}{|v_t|}\right)

is integrated by three points in each triangle of a fan. IMPACT of Adams acts on the whole dog
instead, with :math:`\sigma` the cubic step and *d* the largest depth, at the centroid of the
overlap and along its mean normal, :math:`F = (K d^{3/2} + C \sigma(d/d_C) \, v_n)_+`. Steps:
Bogacki and Shampine's pair 3(2) (1989); where dogs stay in touch, Shampine and Reichelt's linearly
implicit pair 2(3) (1997); Gustafsson's step-size controller (1991).

``summarize`` works times, events and loads of either engine's run out of its states. Contact forces
follow from the motion by balance of momentum, each the mean over the step that ends at its time.
Along the shaft, with masses and forces as in ``sim.shift.mechanism``,

.. math:: \int F_c = \int F - m_s \Delta\dot x - m_a \Delta\dot y - c \Delta x - \int \left(R
   + D + \mu_s \frac{|T|}{r_s} \sigma\right).

The integral of the shift force is known in closed form; the others are smooth over a step:
Simpson's rule, with the middle from the cubic through both ends. About the shaft, :math:`\int M_c =
J_1 \Delta\omega + \int M_0 \sigma - \int M_1`, of ring and rest together where a shaft gives way;
*M* are the torques of a drive (``sim.shift.drive``), of whose tables and control a run keeps the
integral.

One file: the compiler's cache knows of changes in a function's own file alone.
"""

# mypy: disable-error-code="no-untyped-def"

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit

#: Of the compiler; to count references to arrays (``_nrt``) takes two fifths of the time here.
#: Sums in any order would cost a tenth less, but give other digits where code comes from the cache.
OPTIONS: dict[str, Any] = {"cache": True, "error_model": "numpy", "_nrt": False}
compiled = njit(**OPTIONS)
making = njit(**OPTIONS | {"_nrt": True, "nogil": True})  #: for what makes arrays, or calls such
#: A call takes every field of every array: without calls a shift costs a fifth less.
inlined = njit(**OPTIONS, forceinline=True)

#: A rigid plane meets the pressure of a plane only where it presses against it: cosine between
#: its normal and the pressure's gradient, at least (112.5 degrees).
OPPOSED = math.cos(0.625 * math.pi)
MARGIN = 1.02  #: by which an overlap is looked for before dogs can touch
ROOM = 9  #: corners of a quadrilateral cut by the planes of a dog, at most, beyond their number
#: Angles of both rings, way, their rates; way and speed of the actuator; angle and rate of what is
#: behind the sliding ring's shaft and the output ring's.
SIZE = 12
PLAIN_SIZE, LINKED_SIZE = 6, 8  #: without shafts that give way, and without an actuator apart
#: Which numbers of a state are angles or ways, and which turn.
PLACES = np.array([True, True, True, False, False, False, *[True, False] * 3])
TURNS = np.array([True, False, True, True, False, True, False, False, *[True] * 4])
#: Why ``advance`` returned; HELD: the rings stand still on each other.
ENGAGED, PAUSED, FULL, LOST, HELD = range(5)
LEAST = 1e-12  #: s, a step below which the integration is lost
GAIN, MOST = 0.08, 5.0  #: by the errors of two steps, and growth of a step at most
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
 TWIST, PITCH, CREST, FACES, SLOPE, HEIGHT, GAP, LENGTH, BACKS, BACK_SLOPE,
 DETENT_SEAT, DRIVEN, TORQUE_START, SLIDING_TORQUE, SLIDING_SLOPE, OUTPUT_TORQUE, OUTPUT_SLOPE,
 SYNCHRONISER, PACK, PACK_OIL, PACK_SPEED, PACK_AHEAD, BESIDE) = range(54)  # fmt: skip
NUMBERS = 54
SIXTH = 1.0 / 6.0
STOP_LOSS = 100.0  #: s/m, dissipation of the stop behind the ring, as in the Drake plant
FACE_LAW = 6  #: numbers of a law with another friction of faces on faces
IMPACT_LAW = 7  #: numbers of a law that is IMPACT's
SERIES = 1.0 / 64.0  #: stiction velocity over slip up to which four terms give the arctangent

STILL_WINDOW = 0.02  #: s over which rings must stand still to count as blocked
STEADY = 0.01  #: share by which a pack's torque may still change where rings count as blocked
STILL = 1e-3  #: m/s of slip below which faces count as held
FACE_DEPTH = 0.05  #: of the height, to which a touch may be one of faces that are turned
LIFT = 1e-4  #: m by which faces must part before a touch counts as a new one
IMPACT = 1e-3  #: s, the window over which the impulse of an impact is taken
LONGEST_TURN = 0.05  #: pitches, by which a step may turn without a look at what is between
TOUCH_TURN = 0.004  #: the same of a step without contact, in which dogs may have met and parted
#: Places of a state and of their rates.
WAYS, RATES = (0, 1, 2, 6, 8, 10), (3, 4, 5, 7, 9, 11)


@making
def workspace(planes):
    """Make room for depths, two polygons and planes of a dog with a number of planes that touch."""
    return np.empty((4, ROOM + planes, max(4, planes)))


@inlined
def _below(x, y, z, plane):
    """Compute the depth of a point below a plane, m."""
    return plane[3] - (plane[0] * x + plane[1] * y + plane[2] * z)


@inlined
def _cut(work, here, count, plane, other):
    """Keep of polygon ``here`` what is deeper below a plane than the other; the same: than 0.

    Returns the number of corners that are left, and the place of the cut polygon.
    """
    there, less, kept, last = 3 - here, 0.0 if plane == other else 1.0, 0, count - 1
    a, b = work[3, plane], work[3, other]
    n = a[0] - less * b[0], a[1] - less * b[1], a[2] - less * b[2], a[3] - less * b[3]
    x0, y0, z0 = work[here, last, 0], work[here, last, 1], work[here, last, 2]
    before = _below(x0, y0, z0, n)
    for i in range(count):
        x, y, z = work[here, i, 0], work[here, i, 1], work[here, i, 2]
        value = _below(x, y, z, n)
        if (value > 0.0) != (before > 0.0):
            share = before / (before - value)
            x0, y0, z0 = x0 + share * (x - x0), y0 + share * (y - y0), z0 + share * (z - z0)
            work[there, kept, 0], work[there, kept, 1], work[there, kept, 2] = x0, y0, z0
            kept += 1
        if value > 0.0:
            work[there, kept, 0], work[there, kept, 1], work[there, kept, 2] = x, y, z
            kept += 1
        before, x0, y0, z0 = value, x, y, z
    return kept, there


@inlined
def _rub(slip, dynamic, static, stiction):
    """Compute the friction coefficient over the slip, s/m; slip and stiction velocity in m/s.

    Equal coefficients select the law of Drake's continuous plant.
    """
    if slip <= 1e-12:
        return 0.0
    if static == dynamic:
        over = 1.0 / slip
        rest = stiction * over
        if rest > SERIES:
            return dynamic * 0.6366197723675814 * math.atan(slip / stiction) * over
        square = rest * rest
        less = rest * (1.0 - square * (1.0 / 3.0 - square * (0.2 - square * (1.0 / 7.0))))
        return dynamic * (1.0 - 0.6366197723675814 * less) * over
    ratio, late = slip / stiction, slip / stiction - 10.0
    fall = late / math.sqrt(1.0 + late * late) / 0.9950371902099892
    held = (static - dynamic) * 0.5 * (1.0 - fall) + dynamic
    return held / math.sqrt(1.0 + ratio * ratio) / stiction


@inlined
def contact(angle, distance, turn, speed, surfaces, law, work):
    """Compute force along and torque about the shaft on the compliant dog.

    Parameters
    ----------
    angle : output ring's lead over dogs facing dogs, rad.
    distance : of the median planes, m.
    turn : output less sliding speed, rad/s.
    speed : of the sliding ring into engagement, m/s.
    surfaces : of ``sim.shift.planar.surfaces_of``.
    law : of ``PlanarClutch``; five numbers, six with a friction of faces, seven of IMPACT.
    work : of ``workspace``: depths of corners, two polygons, planes of the compliant dog.

    Returns
    -------
    tuple of float
        Force against the shift, N, and torque on the sliding ring, N m; of one dog.
    """
    pitch, ahead, behind = surfaces[4], surfaces[3][0], surfaces[3][1]
    normals, planes, axial, torque = surfaces[1], surfaces[1].shape[0], 0.0, 0.0
    turn, speed, base = -turn, -speed, angle - pitch * np.round(angle / pitch)
    for dog in range(-1, 2):
        place = base + dog * pitch
        # Flanks of one kind lie half a pitch from each other less what they lean and half of the
        # backlash, at the radius where that is least, and MARGIN.
        free = 0.5 * pitch * MARGIN - surfaces[3][2]
        if -place >= free - distance * ahead or place >= free - distance * behind:
            continue
        # In the frame of the rigid dog: the other's, half a turn about a line across the shaft.
        c, s = math.cos(place), math.sin(place)
        for i in range(planes):
            nx, ny, nz = normals[i, 0], normals[i, 1], normals[i, 2]
            work[3, i, 0], work[3, i, 1], work[3, i, 2] = c * nx - s * ny, -(s * nx + c * ny), -nz
            work[3, i, 3] = surfaces[2][i] - nz * distance
        if law.shape[0] == IMPACT_LAW:
            force, moment = _impact(turn, speed, surfaces, law, work)
            axial, torque = axial + force, torque + moment
            continue
        for quad in range(planes):
            for plane in range(planes if _meets(quad, surfaces, work) else 0):
                count, at = _part(quad, plane, surfaces, work)
                for i in range(1, count - 1):
                    force, moment = _triangle(at, i, quad, plane, turn, speed, surfaces, law, work)
                    axial, torque = axial + force, torque + moment
    return -axial, -torque


@inlined
def _meets(quad, surfaces, work):
    """Decide whether a rigid surface may touch; ``work[0]`` gets its corners' depths, m."""
    corners, planes = surfaces[0], surfaces[1].shape[0]
    for turn in range(planes):
        # Its like is the one that it most often lies outside of.
        plane = quad + turn if quad + turn < planes else quad + turn - planes
        n = work[3, plane, 0], work[3, plane, 1], work[3, plane, 2], work[3, plane, 3]
        deepest = -1.0
        for i in range(4):
            depth = _below(corners[quad, i, 0], corners[quad, i, 1], corners[quad, i, 2], n)
            work[0, i, plane] = depth
            deepest = max(deepest, depth)
        if deepest <= 0.0:
            return False
    return True


@inlined
def _is_least_somewhere(work, plane, planes):
    """Decide whether a plane's depth may be positive and the least; not where no corner has it so.

    Row 4 of ``work[0]`` gets 1 at each plane that divides the surface, at its own for the sign.
    """
    for other in range(planes):
        more, less = False, False
        for i in range(4):
            value = work[0, i, other] - (work[0, i, plane] if other != plane else 0.0)
            more |= value > 0.0
            less |= value <= 0.0
        if not more:
            return False
        work[0, 4, other] = 1.0 if less else 0.0
    return True


@inlined
def _part(quad, plane, surfaces, work):
    """Cut a rigid surface to where a plane's depth is the least and positive.

    Returns the number of corners, 0 where there is none, and the polygon's place in ``work``.
    """
    corners, normals, count, where, along = surfaces[0], surfaces[1], 4, 1, 0.0
    planes = normals.shape[0]
    for i in range(3):
        along += normals[quad, i] * work[3, plane, i]
    if -along <= OPPOSED or not _is_least_somewhere(work, plane, planes):
        return 0, where
    for i in range(4):
        for k in range(3):
            work[1, i, k] = corners[quad, i, k]
    for beyond in range(plane, plane + planes):
        other = beyond if beyond < planes else beyond - planes
        if count > 2 and work[0, 4, other] > 0.0:
            count, where = _cut(work, where, count, other, plane)
    return count, where


@inlined
def _points(where, i, normal, plane, work):
    """Give a third of the area of a polygon's corners 0, i and i + 1, and three points within.

    A point is its place across the shaft and its depth below a plane.
    """
    p, q, r, n = work[where, 0], work[where, i], work[where, i + 1], work[3, plane]
    ax, ay, az = q[0] - p[0], q[1] - p[1], q[2] - p[2]
    bx, by, bz = r[0] - p[0], r[1] - p[1], r[2] - p[2]
    ux, uy, uz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
    third = SIXTH * abs(ux * normal[0] + uy * normal[1] + uz * normal[2])
    x, y, z = p[0] + q[0] + r[0], p[1] + q[1] + r[1], p[2] + q[2] + r[2]
    return third, (_point(x, y, z, p, n), _point(x, y, z, q, n), _point(x, y, z, r, n))


@inlined
def _point(x, y, z, corner, plane):
    """Place a point two thirds of the way to a corner, from the sum of all three."""
    x, y, z = SIXTH * x + 0.5 * corner[0], SIXTH * y + 0.5 * corner[1], SIXTH * z + 0.5 * corner[2]
    return x, y, _below(x, y, z, plane)


@inlined
def _triangle(where, i, quad, plane, turn, speed, surfaces, law, work):
    """Integrate the traction over the triangle of corners 0, i and i + 1 of a polygon."""
    normal, axial, torque = surfaces[1][quad], 0.0, 0.0
    mx, my, mz = normal[0], normal[1], normal[2]
    third, points = _points(where, i, normal, plane, work)
    dynamic, static = law[2], law[4]
    if law.shape[0] == FACE_LAW and surfaces[7][quad] and surfaces[7][plane]:
        dynamic, static = law[5], law[5]
    for x, y, depth in points:
        across, around = x * my - y * mx, turn * (x * x + y * y)
        closing = -turn * across - speed * mz
        pressure = law[0] * depth * max(1.0 + law[1] * closing, 0.0) * third
        # The speed along the surface, by what is left of its square.
        slip = math.sqrt(max(turn * around + speed * speed - closing * closing, 0.0))
        rub = _rub(slip, dynamic, static, law[3])
        axial -= pressure * (mz - rub * (speed + closing * mz))
        torque -= pressure * (across - rub * (around + closing * across))
    return axial, torque


@compiled
def _step_of(share):
    """Rise from 0 to 1 as Adams' STEP over a share from 0 to 1."""
    share = min(max(share, 0.0), 1.0)
    return share * share * (3.0 - 2.0 * share)


@compiled
def impact_friction_at(slip, law):
    """Compute the coefficient of Adams' Coulomb friction at a slip in m/s; law of IMPACT.

    STEP from minus to plus the static one over twice the stiction velocity, and on to the dynamic.
    """
    if slip < law[3]:
        return law[4] * (2.0 * _step_of(0.5 * (slip + law[3]) / law[3]) - 1.0)
    return law[4] + (law[2] - law[4]) * _step_of((slip - law[3]) / (law[6] - law[3]))


@compiled
def _impact(turn, speed, surfaces, law, work):
    """Compute IMPACT's force and torque on the compliant dog from one dog of the opposite ring."""
    volume, deepest = 0.0, 0.0
    px, py, nx, ny, nz = 0.0, 0.0, 0.0, 0.0, 0.0  # point and normal times the volume
    for quad in range(surfaces[1].shape[0]):
        normal, planes = surfaces[1][quad], surfaces[1].shape[0]
        for plane in range(planes if _meets(quad, surfaces, work) else 0):
            count, where = _part(quad, plane, surfaces, work)
            for i in range(count):
                x, y, z = work[where, i, 0], work[where, i, 1], work[where, i, 2]
                deepest = max(deepest, _below(x, y, z, work[3, plane]))
            for i in range(1, count - 1):
                third, points = _points(where, i, normal, plane, work)
                for x, y, depth in points:
                    part = third * depth
                    volume += part
                    px, py, nx = px + part * x, py + part * y, nx + part * normal[0]
                    ny, nz = ny + part * normal[1], nz + part * normal[2]
    if volume <= 0.0:
        return 0.0, 0.0
    length = math.sqrt(nx * nx + ny * ny + nz * nz)
    x, y, nx, ny, nz = px / volume, py / volume, nx / length, ny / length, nz / length
    vx, vy, vz = turn * y, -turn * x, -speed
    closing = vx * nx + vy * ny + vz * nz
    spring = law[0] * deepest * math.sqrt(deepest)
    force = max(spring + law[1] * _step_of(deepest / law[5]) * closing, 0.0)
    vx, vy, vz = vx - closing * nx, vy - closing * ny, vz - closing * nz
    slip = math.sqrt(vx * vx + vy * vy + vz * vz)
    rub = impact_friction_at(slip, law) / slip if slip > 1e-12 else 0.0
    return -force * (nz + rub * vz), -force * (x * (ny + rub * vy) - y * (nx + rub * vx))


@inlined
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


@inlined
def _smooth(value, small):
    return value / math.sqrt(value * value + small * small)


@inlined
def _spring(stretch, rate, stiff, loss, low, high, deep):
    """Compute a spring's force, or that of two stops (``sim.shift.mechanism.spring_force``)."""
    if low == high:
        return stiff * stretch + loss * rate
    ahead, behind = max(stretch - high, 0.0), max(low - stretch, 0.0)
    push = max(ahead * (stiff + loss * rate / (ahead + deep)), 0.0)
    return push - max(behind * (stiff - loss * rate / (behind + deep)), 0.0)


@inlined
def _twist(state, plain):
    """Compute the torque of the shaft on the sliding ring at a state (12,), N m."""
    half, lead, rate = 0.5 * plain[BACKLASH], state[8] - state[2], state[9] - state[5]
    return _spring(lead, rate, plain[SHAFT], plain[SHAFT_LOSS], -half, half, plain[TWIST])


@inlined
def _resistance(way, speed, through, plain):
    """Compute detent and friction against the ring, N; ``through`` the spline goes a torque."""
    held = 0.0
    if plain[DETENT] != 0.0:
        for sign, place in ((1.0, plain[DETENT_AT]), (-1.0, plain[DETENT_SEAT])):
            bump = max(1.0 - (2.0 * (way - place) / plain[DETENT_WIDTH]) ** 2, 0.0)
            held += sign * plain[DETENT] * bump * bump
    rub = plain[FRICTION] + plain[SPLINE] * abs(through)
    if rub > 0.0:
        held += rub * _smooth(speed, plain[SLIP_SPEED])
    return held


@inlined
def _side_places(plain):
    """Give the places of angle and rate of the sliding side, then of the output side.

    Each side is what stands behind the shaft of its ring, or the ring on a rigid shaft.
    """
    sliding_angle, sliding_rate = (8, 9) if plain[BEHIND] > 0.0 else (2, 5)
    output_angle, output_rate = (10, 11) if plain[AHEAD] > 0.0 else (0, 3)
    return sliding_angle, sliding_rate, output_angle, output_rate


@inlined
def _drag(state, plain):
    """Compute the torque that holds what turns with the sliding ring's side, N m."""
    if plain[DRAG] == 0.0:
        return 0.0
    _, sliding_rate, _, _ = _side_places(plain)
    return plain[DRAG] * _smooth(state[sliding_rate], plain[TURN_SPEED])


@inlined
def _pack(state, plain):
    """Compute the torque of a wet pack on the side that it acts on, about the axis, N m."""
    _, sliding_rate, _, output_rate = _side_places(plain)
    speed = state[output_rate if plain[PACK_AHEAD] > 0.0 else sliding_rate]
    slip = plain[PACK_SPEED] - speed
    return plain[PACK] * _smooth(slip, plain[TURN_SPEED]) + plain[PACK_OIL] * slip


@inlined
def _drive(time, state, plain):
    """Compute the torques of the drive on sliding and output side, about the axis, N m."""
    since = time - plain[TORQUE_START]
    near = plain[SLIDING_TORQUE] + plain[SLIDING_SLOPE] * since
    far = plain[OUTPUT_TORQUE] + plain[OUTPUT_SLOPE] * since
    if plain[SYNCHRONISER] > 0.0:
        _, sliding_rate, _, output_rate = _side_places(plain)
        mismatch = state[output_rate] - state[sliding_rate]
        shared = plain[SYNCHRONISER] * _smooth(mismatch, plain[TURN_SPEED])
        near += shared
        far -= shared
    if plain[PACK] > 0.0 or plain[PACK_OIL] > 0.0:
        if plain[PACK_AHEAD] > 0.0:
            far += _pack(state, plain)
        else:
            near += _pack(state, plain)
    return near, far


@inlined
def _forces(state, plain, surfaces, law, work):
    """Compute force along and torque about the shaft of all dogs at a state (12,), N and N m."""
    if state[1] <= surfaces[5]:
        return 0.0, 0.0
    angle, turn = state[0] - state[2], state[3] - state[5]
    along, about = contact(angle, surfaces[6] - state[1], turn, state[4], surfaces, law, work)
    return along * plain[DOGS], about * plain[DOGS]


@inlined
def _motion(time, push, along, about, state, out, plain):
    """Write the rates of a state (12,) into ``out``: ``push`` of the actuator, contact's forces."""
    way, speed, behind = state[1], state[4], 0.0
    if way < -plain[REBOUND]:
        behind = max(plain[STOP] * (-plain[REBOUND] - way) * (1.0 - STOP_LOSS * speed), 0.0)
    drive = push
    out[6], out[7] = speed, 0.0
    if plain[LINKED] > 0.0:
        u, rate, deep = state[6] - way, state[7] - speed, plain[DEEP_STOP]
        drive = _spring(u, rate, plain[STIFF], plain[LOSS], 0.0, plain[PLAY], deep)
        out[6] = state[7]
        out[7] = (push - drive) / plain[FAR]
    drive_torque, through = 0.0, about
    if plain[BEHIND] > 0.0:
        through = drive_torque = _twist(state, plain)
    drag, far_drive = _drag(state, plain), 0.0
    if plain[DRIVEN] > 0.0:
        near_drive, far_drive = _drive(time, state, plain)
        drag -= near_drive
        through -= plain[BESIDE] * near_drive
    held = _resistance(way, speed, through, plain)
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
        out[10], out[11] = state[11], (far_drive - back) / plain[AHEAD]
    else:
        out[3] = (far_drive - about) / plain[OUTPUT]


@compiled
def rates(time, state, out, plain, knots, surfaces, law, work):
    """Write the rates of a state (12,) into ``out``; whether dogs touch."""
    along, about = _forces(state, plain, surfaces, law, work)
    _motion(time, force_at(time, knots), along, about, state, out, plain)
    return along != 0.0 or about != 0.0


@making
def _slopes(time, state, now, slopes, plain, knots, surfaces, law, work):
    """Write into ``slopes`` (13, 12) how the rates ``now`` change with the state, and in time.

    Contact follows from relative angle and speed: of either ring's, one is looked at.
    """
    push, along, about = force_at(time, knots), 0.0, 0.0
    changed = slopes[SIZE]
    more, moved = np.zeros(SIZE), np.zeros(SIZE)
    for j in (SIZE, 0, 1, 3, 4):  # the last one first: nothing is changed
        small = _small(j, plain) if j < SIZE else 0.0
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
        _motion(time, push, along + more[j], about + moved[j], state, changed, plain)
        state[j] = was
        slopes[j] = (changed - now) / small
    later = time + SMALL_TIME
    _motion(later, force_at(later, knots), along, about, state, changed, plain)
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


@making
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
def _grown(worst, most, error):
    """Compute the growth of a step from the errors of this one and the last, over their tolerance.

    Returns also how much the next step may grow, not at all after a refused one, and the error that
    counts then.
    """
    if worst > 1.0:
        return max(0.2, 0.9 * worst ** (-1.0 / 3.0)), 1.0, error
    grown = 0.9 * max(worst, 1e-9) ** (GAIN - 1.0 / 3.0) * error**GAIN
    return min(most, grown), MOST, max(worst, 0.01)


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


@making
def _reached(last, time, state, before, until, plain, knots):
    """Decide whether ring and actuator made the travel, or at a look are held; PAUSED for neither.

    ``last`` is the step before a look, others as for ``advance``.
    """
    if state[1] >= plain[WAY] and (plain[LINKED] == 0.0 or state[6] >= plain[WAY]):
        return ENGAGED
    if not last or not before.size:
        return PAUSED
    held = stands_still(time, before, state, until - time, plain, knots)
    before[:] = state
    return HELD if held else PAUSED


@compiled
def _next_look(time, before, until):
    """Compute the time of the next look whether the rings stand still, s."""
    if not before.size:
        return until
    return min(STILL_WINDOW * (math.floor(time / STILL_WINDOW + 1e-9) + 1.0), until)


@making
def advance(
    time, step, state, before, pause, until, plain, knots, surfaces, law, tolerance, max_step,
    mode, times, states,
):  # fmt: skip
    """Integrate until the travel is made, the rings are held, or time or record are at an end.

    Parameters
    ----------
    time, step : now, and the step to try, s.
    state : (12,); holds the last state afterwards.
    before : state at the last look whether the rings stand still, every ``STILL_WINDOW``, (12,);
        NaN where there was none, and of size 0 where nobody looks.
    pause, until : end of this call and of the shift, s.
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
    age, most, error = KEPT, MOST, 1.0  # of the slopes, in steps; of the last step its error
    while time < pause:
        if count >= times.shape[0]:
            return FULL, time, step, count, spent
        look = _next_look(time, before, until)
        stop = min(look, pause)
        last = time + step >= stop
        h = stop - time if last else step
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
            time = stop if last else time + h
            state[:], k1[:] = trial, k4
            times[count], states[count] = time, trial
            count += 1
            age, touch = KEPT if last else age + 1, touches
            mode[TOUCHED] = mode[TOUCHED] + 1.0 if touch else 0.0
            looks = last and stop == look
            why = _reached(looks, time, state, before, until, plain, knots)
            if why != PAUSED:
                return why, time, step, count, spent
        elif h < LEAST:
            return LOST, time, step, count, spent
        else:
            age = KEPT if age > 0 else 0
        grown, most, error = _grown(worst, most, error)
        if not last or grown < 1.0:
            step = min(h * grown, max_step)
        # Implicit steps where dogs stay in touch, and back where that gains nothing.
        if not stiff:
            age = KEPT
            mode[BEATEN] = step if mode[TOUCHED] >= PATIENCE else 0.0
        elif not touch or step < mode[BEATEN]:
            mode[BEATEN], mode[TOUCHED] = 0.0, 0.0
    return PAUSED, time, step, count, spent


@making
def stands_still(time, before, state, left, plain, knots):
    """Decide whether the rings are held, once the force is half up and would move free ones.

    Parameters
    ----------
    time, left : of ``state``, and to the time-out, s.
    before, state : (12,), one ``STILL_WINDOW`` apart; NaN where there is none before.
    """
    if math.isnan(before[0]) or force_at(time - STILL_WINDOW, knots) < 0.5 * knots[1, -1]:
        return False
    both = np.empty((2, SIZE))
    both[0], both[1] = before, state
    if plain[USED] == SIZE:
        # What hangs on a ring may still turn, in its play or on its shaft, and set the ring going.
        for one in both:
            behind = max(abs(one[9] - one[5]), abs(one[11] - one[3]))
            if plain[RADIUS] * behind > STILL:
                return False
    if plain[DRIVEN] > 0.0 and (plain[PACK] > 0.0 or plain[PACK_OIL] > 0.0):
        # Held rings turn on together, and what the pack gives follows their speed.
        earlier, now = _pack(before, plain), _pack(state, plain)
        both[0] = state + (state - before) * (left / STILL_WINDOW)
        later = _pack(both[0], plain)
        if max(abs(later - now), abs(earlier - now)) > STEADY * abs(now):
            return False
        both[0] = before
    return stays_held(both, STILL_WINDOW, left, plain)


@compiled
def stays_held(states, span, left, plain):
    """Decide whether rings stand still, and creep and its growth would not free them in time.

    Parameters
    ----------
    states : output angle, displacement, sliding angle and their rates first, (n, 6 or more), over
        the last ``span`` s.
    left : time to the time-out, s.
    """
    first, last = states[0], states[-1]
    turning, sliding = 0.0, 0.0
    for state in states:
        turning = max(turning, plain[RADIUS] * abs(state[3] - state[5]))
        sliding = max(sliding, abs(state[4]))
    if max(turning, abs(last[4])) > STILL:
        return False
    grown = plain[RADIUS] * abs(last[3] - last[5] - first[3] + first[5])
    turned = turning * left + 0.5 * grown / span * left * left
    made = sliding * left + 0.5 * abs(last[4] - first[4]) / span * left * left
    # The last one: slip that would free a face from a face.
    angle, way, free = last[0] - last[2], last[1], np.inf
    if faces_meet(angle, way, plain):
        overlap, most, _ = facing(face_overlap(angle, plain), plain)
        free = min(overlap, most - overlap)
    return turned < 0.5 * free and made < 0.5 * (plain[WAY] - way)


@making
def face_overlap(angle, plain):
    """Compute the overlap of two faces along the circumference, m; a number or (n,).

    At the mean radius ``L = c + a r``: *c* is the overlap of the ridges at dogs
    facing dogs, *a* the angle from there. Faces part at L = 0, ridge on ridge, and
    at twice the width of a face; where L is negative, backs overlap by as much.
    """
    offset = (angle + 0.5 * plain[PITCH]) % plain[PITCH] - 0.5 * plain[PITCH]
    return plain[CREST] + offset * plain[RADIUS]


@compiled
def facing(overlap, plain):
    """Give overlap, twice the width and slope of two faces, or backs, at a ``face_overlap``."""
    if overlap > 0.0:
        return overlap, plain[FACES], plain[SLOPE]
    return -overlap, plain[BACKS], plain[BACK_SLOPE]


@compiled
def faces_meet(angle, way, plain):
    """Decide whether a position allows a face to touch a face, or a back a back.

    Those that overlap by L touch at a depth of ``L tan(chamfer)``; a twentieth
    of the height is allowed for the turn of one face against the other.
    """
    overlap, most, slope = facing(face_overlap(angle, plain), plain)
    return 0.0 < overlap < most and way - plain[GAP] <= overlap * slope + FACE_DEPTH * plain[HEIGHT]


@making
def shift_force(times, knots):
    """Compute the shift force, N, and its integral from the start, N s, at times, (n,) each."""
    force, given = np.empty(times.size), np.empty(times.size)
    place, before, last = 0, 0.0, knots.shape[1] - 1
    for i in range(times.size):
        while place < last and times[i] >= knots[0, place + 1]:
            before += _integral(1.0, place, knots)
            place += 1
        force[i] = force_at(times[i], knots)
        since = times[i] - knots[0, place]
        if place == last:
            given[i] = before + since * knots[1, last]
        else:
            step = knots[0, place + 1] - knots[0, place]
            given[i] = before + _integral(since / step, place, knots)
    return force, given


@compiled
def _integral(s, place, knots):
    """Integrate the piecewise cubic from a knot to a share of the way to the next."""
    step, two, three, four = knots[0, place + 1] - knots[0, place], s * s, s**3, s**4
    return step * (
        knots[1, place] * (s - three + 0.5 * four)
        + knots[2, place] * step * (0.5 * two - 2.0 / 3.0 * three + 0.25 * four)
        + knots[1, place + 1] * (three - 0.5 * four)
        + knots[2, place + 1] * step * (0.25 * four - three / 3.0)
    )


@inlined
def _midway(start, end, step, middle):
    """Write the state in the middle of a step into ``middle``, (12,), from the cubics of ways."""
    for k in range(len(WAYS)):
        way, rate = WAYS[k], RATES[k]
        middle[way] = 0.5 * (start[way] + end[way]) + 0.125 * step * (start[rate] - end[rate])
        middle[rate] = 1.5 * (end[way] - start[way]) / step - 0.25 * (start[rate] + end[rate])


@inlined
def _mean_drive(i, step, start, middle, end, driven, plain):
    """Compute the mean torque of the drive on the sliding side over the step to ``i``, N m."""
    if plain[DRIVEN] == 0.0:
        return 0.0
    both = _drive(0.0, start, plain)[0] + _drive(0.0, end, plain)[0]
    partners = (both + 4.0 * _drive(0.0, middle, plain)[0]) / 6.0
    return partners + (driven[0, i] - driven[0, i - 1]) / step


@making
def contact_means(times, states, given, driven, plain):
    """Compute the contact's force against the shift, N, and torque on the sliding ring, N m.

    Means over the steps that end at times, (n,) each, 0 at the first one; ``given`` (n,) is the
    integral of the shift force, ``driven`` that of ``sim.shift.drive.impulses``, (2, n), or (2, 0).
    """
    force, torque = np.zeros(times.size), np.zeros(times.size)
    held = plain[USED] > PLAIN_SIZE or plain[DAMPING] > 0.0 or plain[DETENT] > 0.0
    held |= plain[FRICTION] > 0.0 or plain[SPLINE] > 0.0 or plain[DRAG] > 0.0
    held |= plain[DRIVEN] > 0.0
    middle = np.empty(SIZE)
    for i in range(1, times.size):
        start, end, step = states[i - 1], states[i], times[i] - times[i - 1]
        if plain[DRIVEN] > 0.0 and step < LEAST:
            continue  # what rounding left of a piece of the drive
        gained = plain[SLIDING] * (end[5] - start[5])
        if plain[BEHIND] > 0.0:
            gained += plain[BEHIND] * (end[9] - start[9])
        torque[i] = gained / step
        momentum = plain[SLEEVE] * (end[4] - start[4])
        if not held:
            force[i] = (given[i] - given[i - 1] - momentum) / step
            continue
        _midway(start, end, step, middle)
        torque[i] += (_drag(start, plain) + 4.0 * _drag(middle, plain) + _drag(end, plain)) / 6.0
        driving = _mean_drive(i, step, start, middle, end, driven, plain)
        torque[i] -= driving
        # What the rule leaves of a friction torque is no contact.
        if abs(torque[i]) < 0.01 * (plain[DRAG] + plain[SYNCHRONISER] + plain[PACK]):
            torque[i] = 0.0
        if end[1] == start[1]:
            continue  # at rest friction holds the shift force, whatever it is
        if plain[LINKED] > 0.0:
            momentum += plain[FAR] * (end[7] - start[7])
        resisting = 0.0
        for part, weight in ((start, 1.0), (middle, 4.0), (end, 1.0)):
            through = torque[i] - plain[BESIDE] * driving
            if plain[BEHIND] > 0.0:
                through = _twist(part, plain)
            resisting += weight * _resistance(part[1], part[4], through, plain)
        pushed = given[i] - given[i - 1] - plain[DAMPING] * (end[1] - start[1])
        force[i] = (pushed - momentum) / step - resisting / 6.0
    return force, torque


@compiled
def crossing(times, ways, speeds, way):
    """Find the time in s at which a displacement first reaches ``way``; NaN where it never does.

    Where the first state is there already, that is its time; between two states it is on the cubic.
    Series (n,).
    """
    for i in range(times.size):
        if ways[i] >= way:
            break
    else:
        return np.nan
    if i == 0:
        return times[0]
    step, low, high = times[i] - times[i - 1], 0.0, 1.0
    for _ in range(50):
        s = 0.5 * (low + high)
        there = _cubic(s, step, ways[i - 1], speeds[i - 1], ways[i], speeds[i])
        low, high = (low, s) if there >= way else (s, high)
    return times[i - 1] + step * 0.5 * (low + high)


@compiled
def _cubic(s, step, x0, v0, x1, v1):
    """Evaluate the cubic between two places with rates at its share ``s``."""
    t = 1.0 - s
    return (
        (1.0 + 2.0 * s) * t**2 * x0
        + s * t**2 * step * v0
        + s * s * (3.0 - 2.0 * s) * x1
        + s * s * (s - 1.0) * step * v1
    )


@compiled
def penetration(way, angle, planes, plain):
    r"""Compute how deep a sliding dog lies in an output dog, m; 0 where they are apart.

    Sections at the mean radius are convex and one is the other turned by half a turn, so
    along each shared normal they overlap by :math:`2 p_n - n \cdot c`, with the plane's
    distance and the way between both centres; the least over all planes is the depth.

    Parameters
    ----------
    way, angle : axial way of the sliding ring from the start, m, and output ring's lead over dogs
        facing dogs, rad.
    planes : normals across and along the shaft, and :math:`2 p_n`, m, (p, 3).
    """
    pitch, deepest = plain[PITCH] * plain[RADIUS], 0.0
    across = -angle * plain[RADIUS]
    across -= pitch * np.rint(across / pitch)
    up = plain[GAP] + plain[HEIGHT] - way
    for dog in range(-1, 2):  # the dogs on either side too
        least = np.inf
        for i in range(planes.shape[0]):
            along = planes[i, 0] * (across + dog * pitch) + planes[i, 1] * up
            least = min(least, planes[i, 2] - along)
        deepest = max(deepest, least)
    return deepest


@compiled
def _within(s, step, start, end):
    """Give way and relative angle at the share ``s`` of a step between two states, on the cubic."""
    before, after = start[0] - start[2], end[0] - end[2]
    way = _cubic(s, step, start[1], start[4], end[1], end[4])
    return way, _cubic(s, step, before, start[3] - start[5], after, end[3] - end[5])


@compiled
def extremes(times, states, planes, plain):
    """Find the deepest penetration and the farthest way of a shift, m, between its steps too.

    A step turns fast rings by more than a pitch, and dogs may meet and part within it. Steps that
    turn by more than ``LONGEST_TURN`` are divided into parts that do not, on the cubic.
    """
    most, longest = 0.0, LONGEST_TURN * plain[PITCH]
    for i in range(1, times.size):
        most = max(most, abs(states[i, 0] - states[i, 2] - states[i - 1, 0] + states[i - 1, 2]))
    parts = math.ceil(most / longest)
    farthest, angle, deepest = states[0, 1], states[0, 0] - states[0, 2], 0.0
    for i in range(times.size):
        end, step = states[i], times[i] - times[max(0, i - 1)]
        start, before, angle = states[max(0, i - 1)], angle, end[0] - end[2]
        farthest = max(farthest, end[1])
        deepest = max(deepest, penetration(end[1], angle, planes, plain))
        for part in range(1, parts if abs(angle - before) > longest else 1):
            way, between = _within(part / parts, step, start, end)
            farthest = max(farthest, way)
            deepest = max(deepest, penetration(way, between, planes, plain))
    return deepest, farthest


@making
def touching(times, force, torque, push, plain):
    """Mark steps with a contact, (n,): contact and shift force in N, torque of the contact, N m."""
    touches = np.zeros(force.size, np.bool_)
    for i in range(force.size):
        impulse = torque[i] / plain[RADIUS] * (times[i] - times[max(0, i - 1)])
        touches[i] = force[i] > 0.5 + 0.01 * push[i] or abs(impulse) > 1e-6
    return touches


@compiled
def passed_over(times, states, touches, planes, plain):
    """Find how deep dogs lay in each other within steps that show no contact, m.

    The integrators see forces at a few places of a step alone, and nothing else limits the step of
    free rings: a fast tip grazes another one for a tenth of a millisecond.
    """
    deepest, longest = 0.0, TOUCH_TURN * plain[PITCH]
    for i in range(1, times.size):
        start, end, step = states[i - 1], states[i], times[i] - times[i - 1]
        before, after = start[0] - start[2], end[0] - end[2]
        if touches[i] or end[1] <= plain[GAP] or abs(after - before) <= longest:
            continue
        parts = math.ceil(abs(after - before) / longest)
        for part in range(1, parts):
            way, angle = _within(part / parts, step, start, end)
            deepest = max(deepest, penetration(way, angle, planes, plain))
    return deepest


@compiled
def _marks(times, states, touches, faces, end, plain):
    """Find the ends of free flight and face contact and the start of seating, s."""
    first, met, seat, last = end, end, end, -1.0
    for i in range(times.size - 1, -1, -1):
        if states[i, 1] >= plain[GAP]:
            met = times[i]
        if touches[i]:
            first = times[i]
        if faces[i]:
            last = max(last, times[i])
    if last < 0.0:
        first = last = met
    for i in range(times.size - 1, -1, -1):
        if touches[i] and times[i] > last:
            seat = times[i]
    return min(first, end), min(last, end), min(seat, end)


@compiled
def _events(times, states, overlap, faces, plain):
    """Compute face contacts, slots skipped, rebound in m, time blocked in s and face slide in m."""
    rebound = blocked = slide = deepest = 0.0
    landings, flown, before = 0, -np.inf, -np.inf
    for i in range(times.size):
        state = states[i]
        deepest = max(deepest, state[1]) if i else state[1]
        rebound = max(rebound, deepest - state[1])
        over, most, slope = facing(overlap[i], plain)
        level = plain[GAP] + over * slope - state[1]
        apart = level if 0.0 < over < most else plain[GAP] + plain[HEIGHT]
        flown = max(flown, apart)
        if not faces[i]:
            continue
        if not landings or (not faces[i - 1] and flown - before > LIFT):
            landings += 1
        flown = before = apart
        slip = abs(state[3] - state[5]) * plain[RADIUS]
        step = times[i] - times[i - 1] if i else 0.0
        if slip < STILL:
            blocked += step
        else:
            slide += slip * step
    return landings, _skipped(states, overlap, plain), rebound, blocked, slide


@compiled
def _skipped(states, overlap, plain):
    """Count slots between the first one within reach and the one that was entered.

    Slot *k* lies between the angles k and k + 1 pitches. Dogs that stand on a face
    when the crests meet reach the next slot in the direction of the mismatch.
    """
    met, last = 0, states.shape[0] - 1
    while met <= last and states[met, 1] < plain[GAP]:
        met += 1
    if met > last:
        return 0
    forward, slots = states[0, 3] - states[0, 5] >= 0.0, (0.0, 0.0)
    for i in (met, last):
        place = (states[i, 0] - states[i, 2]) / plain[PITCH]
        over, most, _ = facing(overlap[i], plain)
        if 0.0 < over < most and states[i, 1] < plain[WAY]:
            slot = np.rint(place) - (0.0 if forward else 1.0)
        else:
            slot = math.floor(place)
        slots = slots[1], slot
    return max(0, int(slots[1] - slots[0] if forward else slots[0] - slots[1]))


@making
def _strikes(times, force, push, torque, plain):
    """Find the largest impulse within ``IMPACT``, N s, and the largest of the torque alone, N m s.

    Of the contact force what it gives beyond holding the shift force, ``push``, N, counts; (n,).
    """
    along, about = np.zeros(times.size), np.zeros(times.size)
    for i in range(1, times.size):
        step = times[i] - times[i - 1]
        along[i] = along[i - 1] + max(force[i] - push[i], 0.0) * step
        about[i] = about[i - 1] + torque[i] * step
    impulse, struck, after = 0.0, 0.0, 0
    for i in range(times.size):
        until = times[i] + IMPACT
        while after < times.size - 1 and times[after + 1] <= until:
            after += 1
        one, other = along[after], about[after]
        if after < times.size - 1:
            share = (until - times[after]) / (times[after + 1] - times[after])
            one += share * (along[after + 1] - one)
            other += share * (about[after + 1] - other)
        turn = abs(other - about[i])
        struck = max(struck, turn)
        impulse = max(impulse, math.hypot(one - along[i], turn / plain[RADIUS]))
    return impulse, struck


@compiled
def energy_lost(states, push, plain):
    """Compute initial energy and work of the shift force less kinetic energy at the end, J.

    What a mechanism took is in it, and what shafts store; ``push`` is the shift force, N, (n,).
    Rings are seen from a frame that turns as the sliding ring did before the shift.
    """
    place, work = 6 if plain[LINKED] > 0.0 else 1, 0.0
    for i in range(1, push.size):
        work += 0.5 * (push[i] + push[i - 1]) * (states[i, place] - states[i - 1, place])
    first, last = states[0], states[-1]
    twice = plain[SLEEVE] * (first[4] ** 2 - last[4] ** 2)
    if plain[LINKED] > 0.0:
        twice += plain[FAR] * (first[7] ** 2 - last[7] ** 2)
    for mass, rate in ((SLIDING, 5), (BEHIND, 9), (OUTPUT, 3), (AHEAD, 11)):
        twice += plain[mass] * ((first[rate] - first[5]) ** 2 - (last[rate] - first[5]) ** 2)
    return work + 0.5 * twice


@making
def drive_work(times, states, driven, plain):
    """Compute the work of drive and drag on turning rings, J, in the frame of ``energy_lost``.

    ``driven`` as for ``contact_means``. On rings that stand drag is a part of the mechanism.
    """
    frame, work, middle = states[0, 5], 0.0, np.empty(SIZE)
    if frame == 0.0 and plain[DRIVEN] == 0.0:
        return 0.0
    near_way, near_rate, far_way, far_rate = _side_places(plain)
    for i in range(1, times.size):
        start, end, step = states[i - 1], states[i], times[i] - times[i - 1]
        _midway(start, end, step, middle)
        for part, weight in ((start, 1.0), (middle, 4.0), (end, 1.0)):
            near, far = -_drag(part, plain), 0.0
            if plain[DRIVEN] > 0.0:
                near_drive, far = _drive(0.0, part, plain)
                near += near_drive
            power = near * (part[near_rate] - frame) + far * (part[far_rate] - frame)
            work += weight * step * power / 6.0
        if plain[DRIVEN] > 0.0:
            near_turn = end[near_way] - start[near_way] - frame * step
            far_turn = end[far_way] - start[far_way] - frame * step
            work += (driven[0, i] - driven[0, i - 1]) / step * near_turn
            work += (driven[1, i] - driven[1, i - 1]) / step * far_turn
    return work


@making
def _line_loads(force, torque, overlap, faces, classes, plain):
    """Compute the largest load of faces, N/m, while the force is more axial than tangential.

    By class of overlap: ``classes`` are their lower ends, m, (k,).
    """
    largest = np.zeros(classes.size)
    for i in range(force.size):
        if faces[i] and force[i] > abs(torque[i]) / plain[RADIUS]:
            # Past the middle the edge of the flank parts the faces.
            over, most, _ = facing(overlap[i], plain)
            least, place = min(over, most - over), 0
            while place + 1 < classes.size and classes[place + 1] <= least:
                place += 1
            largest[place] = max(largest[place], force[i] / (plain[DOGS] * plain[LENGTH]))
    return largest


@compiled
def _shaft_peaks(states, plain):
    """Find the largest torque of sliding and output ring's shaft, N m; NaN for a rigid one."""
    behind = 0.0 if plain[BEHIND] > 0.0 else np.nan
    ahead = 0.0 if plain[AHEAD] > 0.0 else np.nan
    for state in states:
        if plain[BEHIND] > 0.0:
            behind = max(behind, abs(_twist(state, plain)))
        if plain[AHEAD] > 0.0:
            lead, rate = state[10] - state[0], state[11] - state[3]
            ahead = max(ahead, abs(plain[OUT_SHAFT] * lead + plain[OUT_LOSS] * rate))
    return behind, ahead


@making
def summarize(times, states, plain, knots, driven, planes, classes):
    """Work times, events and loads out of a run.

    Parameters
    ----------
    times, states : of the run, (n,) and (n, 12).
    driven : as for ``contact_means``.
    planes : as for ``penetration``.
    classes : lower ends of classes of overlap, m, (k,).

    Returns
    -------
    tuple
        Times at which ring and actuator made the travel, s, NaN for never; deepest penetration and
        farthest way, m; what ``passed_over`` finds, m; ends of free flight and face contact, start
        of seating, s; fields of ``Events``; of ``Loads`` without the landing; line loads, (k,).
    """
    ring = far = crossing(times, states[:, 1], states[:, 4], plain[WAY])
    if plain[LINKED] > 0.0:
        far = crossing(times, states[:, 6], states[:, 7], plain[WAY])
    push, given = shift_force(times, knots)
    force, torque = contact_means(times, states, given, driven, plain)
    lost = energy_lost(states, push, plain) + drive_work(times, states, driven, plain)
    touches, overlap = touching(times, force, torque, push, plain), np.empty(times.size)
    faces, before, peaks = touches.copy(), 0, (0.0, 0.0)
    end = times[-1] if math.isnan(ring) else ring
    for i in range(times.size):
        angle = states[i, 0] - states[i, 2]
        overlap[i] = face_overlap(angle, plain)
        faces[i] &= faces_meet(angle, states[i, 1], plain)
        peaks = max(peaks[0], force[i]), max(peaks[1], abs(torque[i]))
    marks = _marks(times, states, touches, faces, end, plain)
    while before + 1 < times.size and times[before + 1] < marks[2]:
        before += 1
    impulse, struck = _strikes(times, force, push, torque, plain)
    near, output = plain[SLIDING] + plain[BEHIND], plain[OUTPUT] + plain[AHEAD]
    loads = (
        peaks[0], peaks[1] / plain[RADIUS], impulse, lost,
        struck * (near + output) / (near * output),
        states[before, 3] - states[before, 5] if marks[2] < end else np.nan,
        *_shaft_peaks(states, plain),
    )  # fmt: skip
    return (
        (ring, far), extremes(times, states, planes, plain),
        passed_over(times, states, touches, planes, plain), marks,
        _events(times, states, overlap, faces, plain), loads,
        _line_loads(force, torque, overlap, faces, classes, plain),
    )  # fmt: skip
