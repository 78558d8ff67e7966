r"""Contact of one dog with the opposite ring, plane by plane, and overlap of faces.

Inside the compliant dog the pressure is stiffness times the least of the depths
:math:`d_i = o_i - n_i \cdot p` below its planes. A touching quadrilateral of a rigid dog is clipped
to the part where :math:`d_i` is the least depth and positive; the traction (Hunt and Crossley 1975)

.. math:: t = k d_i (1 + D v_n)_+ \left(n + \mu \, s(|v_t|) \frac{v_t}{|v_t|}\right)

is integrated over that polygon by three points in each triangle of a fan. IMPACT of Adams acts once
for the whole dog instead, at the centroid of the overlap and along its mean normal; with the cubic
step :math:`\sigma` and the largest depth *d*, :math:`F = (K d^{3/2} + C \sigma(d/d_C) \, v_n)_+`.
"""

# mypy: disable-error-code="no-untyped-def"

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from dogshape.sim.elementwise import Array
from dogshape.sim.kernel.compiler import compiled, inlined, making

#: Least cosine between the normal of a rigid surface and the pressure gradient for a contact (an
#: angle of 112.5 degrees).
MIN_GRADIENT_COSINE = math.cos(0.625 * math.pi)
OVERLAP_MARGIN = 1.02  #: half pitches up to which a dog is examined for contact
EXTRA_CORNERS = 9  #: corners of a quadrilateral cut by planes, beyond the number of planes
MIN_SLIP = 1e-12  #: m/s, below which a point has no friction
SERIES_RATIO = 1.0 / 64.0  #: stiction velocity over slip up to which four terms give the arctangent
TWO_OVER_PI = 0.6366197723675814
FALL_SLIP = 10.0  #: slip over stiction velocity in the middle of the fall to dynamic friction
FALL_AT_REST = 0.9950371902099892  #: ``FALL_SLIP / sqrt(1 + FALL_SLIP^2)``
SIXTH = 1.0 / 6.0
FACE_DEPTH_SHARE = 0.05  #: of the height, depth added for faces turned against each other


class ClipBuffers(NamedTuple):
    """Views of the workspace for the clip of one rigid surface by p planes."""

    depths: Array  #: of the surface's corners below each plane, m, (4 or more, p or more)
    dividers: Array  #: 1 for a plane between corners of the surface, else 0, (p or more,)
    polygons: Array  #: source and target of a clip, corners by row, m, (2, p + EXTRA_CORNERS, 3+)
    #: of the compliant dog in the rigid dog's frame: normal and offset, m, (p or more, 4 or more)
    planes: Array


@making
def clip_workspace(plane_count):
    """Make the workspace of ``ClipBuffers``; one array is passed faster than four."""
    return np.empty((4, plane_count + EXTRA_CORNERS, max(4, plane_count)))


@inlined
def _clip_buffers(workspace):
    """Divide the workspace of a clip; depths need four of its rows, dividers are the fifth."""
    return ClipBuffers(
        depths=workspace[0], dividers=workspace[0, 4], polygons=workspace[1:3], planes=workspace[3]
    )


@inlined
def _depth(x, y, z, plane):
    """Compute the depth of a point below a plane (normal and offset), m."""
    return plane[3] - (plane[0] * x + plane[1] * y + plane[2] * z)


@inlined
def _set_corner(polygon, place, x, y, z):
    """Write a corner of a polygon, m."""
    polygon[place, 0] = x
    polygon[place, 1] = y
    polygon[place, 2] = z


@inlined
def _clip(buffers, source, corner_count, plane, other):
    """Clip a polygon to where ``plane`` is deeper than ``other`` (Sutherland and Hodgman 1974).

    If both are the same plane, to where it is deeper than 0.

    Returns
    -------
    tuple of int
        Number of remaining corners, index of the clipped polygon.
    """
    target = 1 - source
    polygon = buffers.polygons[source]
    clipped = buffers.polygons[target]
    normal = buffers.planes[plane]
    other_normal = buffers.planes[other]
    weight = 0.0 if plane == other else 1.0
    divider = (
        normal[0] - weight * other_normal[0],
        normal[1] - weight * other_normal[1],
        normal[2] - weight * other_normal[2],
        normal[3] - weight * other_normal[3],
    )
    last = corner_count - 1
    previous_x = polygon[last, 0]
    previous_y = polygon[last, 1]
    previous_z = polygon[last, 2]
    previous_depth = _depth(previous_x, previous_y, previous_z, divider)
    clipped_count = 0
    for i in range(corner_count):
        x = polygon[i, 0]
        y = polygon[i, 1]
        z = polygon[i, 2]
        depth = _depth(x, y, z, divider)
        if (depth > 0.0) != (previous_depth > 0.0):
            share = previous_depth / (previous_depth - depth)
            edge_x = previous_x + share * (x - previous_x)
            edge_y = previous_y + share * (y - previous_y)
            edge_z = previous_z + share * (z - previous_z)
            _set_corner(clipped, clipped_count, edge_x, edge_y, edge_z)
            clipped_count += 1
        if depth > 0.0:
            _set_corner(clipped, clipped_count, x, y, z)
            clipped_count += 1
        previous_depth = depth
        previous_x = x
        previous_y = y
        previous_z = z
    return clipped_count, target


@inlined
def _friction_over_slip(slip, dynamic_friction, static_friction, stiction_velocity):
    """Compute the friction coefficient divided by the slip, s/m; slip and stiction velocity in m/s.

    If both coefficients are equal, the law is that of Drake's continuous plant.
    """
    if slip <= MIN_SLIP:
        return 0.0
    if static_friction == dynamic_friction:
        inverse_slip = 1.0 / slip
        ratio = stiction_velocity * inverse_slip
        if ratio > SERIES_RATIO:
            angle = math.atan(slip / stiction_velocity)
            return dynamic_friction * TWO_OVER_PI * angle * inverse_slip
        square = ratio * ratio
        complement = ratio * (1.0 - square * (1.0 / 3.0 - square * (0.2 - square * (1.0 / 7.0))))
        return dynamic_friction * (1.0 - TWO_OVER_PI * complement) * inverse_slip
    slip_ratio = slip / stiction_velocity
    beyond_fall = slip_ratio - FALL_SLIP
    fall = beyond_fall / math.sqrt(1.0 + beyond_fall * beyond_fall) / FALL_AT_REST
    coefficient = (static_friction - dynamic_friction) * 0.5 * (1.0 - fall) + dynamic_friction
    return coefficient / math.sqrt(1.0 + slip_ratio * slip_ratio) / stiction_velocity


@inlined
def contact(angle, distance, relative_speed, axial_speed, surfaces, law, workspace):
    """Compute axial force and torque of the contact on the compliant dog, of the sliding ring.

    Parameters
    ----------
    angle : output ring's lead over dogs facing dogs, rad.
    distance : between the median planes of both dogs, m.
    relative_speed : output less sliding speed, rad/s.
    axial_speed : of the sliding ring into engagement, m/s.
    surfaces : ``Surfaces`` of both dogs.
    law : record of ``CONTACT_LAW``.
    workspace : array of ``clip_workspace``.

    Returns
    -------
    tuple of float
        Force against the shift, N, and torque, N m, on one dog.
    """
    buffers = _clip_buffers(workspace)
    pitch = surfaces.pitch_angle
    plane_count = surfaces.normals.shape[0]
    quad_count = surfaces.rigid_normals.shape[0]
    axial = 0.0
    torque = 0.0
    # Velocity of the compliant dog relative to the rigid one, in the frame of the rigid one.
    turn = -relative_speed
    speed = -axial_speed
    angle_in_pitch = angle - pitch * np.round(angle / pitch)
    for dog in range(-1, 2):
        dog_angle = angle_in_pitch + dog * pitch
        # Flanks part at half a pitch less half of the backlash and the turn by their lean; the
        # lean of ``surfaces`` is the least over the radius, and half a pitch has a margin.
        free_angle = 0.5 * pitch * OVERLAP_MARGIN - surfaces.half_backlash
        if -dog_angle >= free_angle - distance * surfaces.traction_lean:
            continue
        if dog_angle >= free_angle - distance * surfaces.braking_lean:
            continue
        _place_planes(dog_angle, distance, surfaces, buffers)
        if law.is_impact:
            force, moment = _impact(turn, speed, surfaces, law, workspace)
            axial += force
            torque += moment
            continue
        for quad in range(quad_count):
            if not _may_touch(quad, surfaces, buffers):
                continue
            for plane in range(plane_count):
                corner_count, polygon = _part_nearest(quad, plane, surfaces, buffers)
                for i in range(1, corner_count - 1):
                    force, moment = _triangle(
                        polygon, i, quad, plane, turn, speed, surfaces, law, buffers
                    )
                    axial += force
                    torque += moment
    return -axial, -torque


@inlined
def _place_planes(dog_angle, distance, surfaces, buffers):
    """Write the compliant dog's planes in the frame of a rigid dog at an angle, rad, and distance.

    The frame of the rigid dog is turned by half a turn about a line across the shaft.
    """
    c = math.cos(dog_angle)
    s = math.sin(dog_angle)
    planes = buffers.planes
    for i in range(surfaces.normals.shape[0]):
        nx = surfaces.normals[i, 0]
        ny = surfaces.normals[i, 1]
        nz = surfaces.normals[i, 2]
        planes[i, 0] = c * nx - s * ny
        planes[i, 1] = -(s * nx + c * ny)
        planes[i, 2] = -nz
        planes[i, 3] = surfaces.offsets[i] - nz * distance


@inlined
def _may_touch(quad, surfaces, buffers):
    """Decide whether a rigid surface has a corner below each plane; write its corners' depths."""
    corners = surfaces.corners
    plane_count = surfaces.normals.shape[0]
    for step in range(plane_count):
        # The plane with the index of the surface comes first, as most surfaces lie above it.
        plane = quad + step
        while plane >= plane_count:
            plane -= plane_count
        planes = buffers.planes
        equation = planes[plane, 0], planes[plane, 1], planes[plane, 2], planes[plane, 3]
        deepest = -1.0
        for i in range(4):
            depth = _depth(corners[quad, i, 0], corners[quad, i, 1], corners[quad, i, 2], equation)
            buffers.depths[i, plane] = depth
            deepest = max(deepest, depth)
        if deepest <= 0.0:
            return False
    return True


@inlined
def _may_be_nearest(buffers, plane, plane_count):
    """Decide from the corners' depths whether a part of the surface may be nearest to a plane.

    ``buffers.dividers`` marks each plane whose depth equals this plane's somewhere within the
    surface, and this plane if the surface crosses it.
    """
    depths = buffers.depths
    for other in range(plane_count):
        any_inside = False
        any_outside = False
        for i in range(4):
            depth = depths[i, other]
            if other != plane:
                depth -= depths[i, plane]
            any_inside |= depth > 0.0
            any_outside |= depth <= 0.0
        if not any_inside:
            return False
        buffers.dividers[other] = 1.0 if any_outside else 0.0
    return True


@inlined
def _part_nearest(quad, plane, surfaces, buffers):
    """Clip a rigid surface to the part that lies below a plane and nearer to it than to others.

    Returns
    -------
    tuple of int
        Number of corners, 0 for no such part, and index of the polygon in ``buffers``.
    """
    corners = surfaces.corners
    plane_count = surfaces.normals.shape[0]
    corner_count = 4
    polygon = 0
    cosine = 0.0
    for i in range(3):
        cosine += surfaces.rigid_normals[quad, i] * buffers.planes[plane, i]
    if -cosine <= MIN_GRADIENT_COSINE or not _may_be_nearest(buffers, plane, plane_count):
        return 0, polygon
    for i in range(4):
        for k in range(3):
            buffers.polygons[0, i, k] = corners[quad, i, k]
    for unwrapped in range(plane, plane + plane_count):
        other = unwrapped if unwrapped < plane_count else unwrapped - plane_count
        if corner_count > 2 and buffers.dividers[other] > 0.0:
            corner_count, polygon = _clip(buffers, polygon, corner_count, other, plane)
    return corner_count, polygon


@inlined
def _quadrature_points(polygon, i, normal, plane, buffers):
    """Compute three points in the triangle of corners 0, i and i + 1 of a polygon.

    Returns
    -------
    tuple
        Weight of each point, a third of the area, m2, and points: x, y and depth below the plane,
        m.
    """
    first = buffers.polygons[polygon, 0]
    second = buffers.polygons[polygon, i]
    third = buffers.polygons[polygon, i + 1]
    equation = buffers.planes[plane]
    ax = second[0] - first[0]
    ay = second[1] - first[1]
    az = second[2] - first[2]
    bx = third[0] - first[0]
    by = third[1] - first[1]
    bz = third[2] - first[2]
    ux = ay * bz - az * by
    uy = az * bx - ax * bz
    uz = ax * by - ay * bx
    weight = SIXTH * abs(ux * normal[0] + uy * normal[1] + uz * normal[2])
    x = first[0] + second[0] + third[0]
    y = first[1] + second[1] + third[1]
    z = first[2] + second[2] + third[2]
    points = (
        _quadrature_point(x, y, z, first, equation),
        _quadrature_point(x, y, z, second, equation),
        _quadrature_point(x, y, z, third, equation),
    )
    return weight, points


@inlined
def _quadrature_point(sum_x, sum_y, sum_z, corner, plane):
    """Compute the point halfway from a triangle's centroid to a corner, and its depth, m.

    The sums are those of the coordinates of all three corners.
    """
    x = SIXTH * sum_x + 0.5 * corner[0]
    y = SIXTH * sum_y + 0.5 * corner[1]
    z = SIXTH * sum_z + 0.5 * corner[2]
    return x, y, _depth(x, y, z, plane)


@inlined
def _triangle(polygon, i, quad, plane, turn, speed, surfaces, law, buffers):
    """Integrate the traction over the triangle of corners 0, i and i + 1 of a polygon.

    Returns
    -------
    tuple of float
        Force along the shaft, N, and torque about it, N m, on the rigid dog.
    """
    normal = surfaces.rigid_normals[quad]
    nx = normal[0]
    ny = normal[1]
    nz = normal[2]
    axial = 0.0
    torque = 0.0
    weight, points = _quadrature_points(polygon, i, normal, plane, buffers)
    dynamic_friction = law.dynamic_friction
    static_friction = law.static_friction
    if law.has_face_friction and surfaces.is_rigid_face[quad] and surfaces.is_face[plane]:
        dynamic_friction = law.face_friction
        static_friction = law.face_friction
    for x, y, depth in points:
        normal_arm = x * ny - y * nx
        velocity_moment = turn * (x * x + y * y)
        closing_speed = -turn * normal_arm - speed * nz
        damping = max(1.0 + law.damping * closing_speed, 0.0)
        normal_force = law.stiffness * depth * damping * weight
        # Slip by Pythagoras: square of the speed of the point less that of the closing speed.
        slip_square = turn * velocity_moment + speed * speed - closing_speed * closing_speed
        slip = math.sqrt(max(slip_square, 0.0))
        friction = _friction_over_slip(
            slip, dynamic_friction, static_friction, law.stiction_velocity
        )
        axial -= normal_force * (nz - friction * (speed + closing_speed * nz))
        torque -= normal_force * (
            normal_arm - friction * (velocity_moment + closing_speed * normal_arm)
        )
    return axial, torque


@compiled
def _adams_step(share):
    """Evaluate the cubic STEP of Adams from 0 to 1; ``share`` is clipped to 0 to 1."""
    share = min(max(share, 0.0), 1.0)
    return share * share * (3.0 - 2.0 * share)


@compiled
def impact_friction_at(slip, law):
    """Compute the coefficient of Adams' Coulomb friction at a slip in m/s; law of IMPACT.

    STEP leads from minus to plus the static coefficient, between minus and plus the stiction
    velocity, and from there to the dynamic coefficient at the transition velocity.
    """
    stiction_velocity = law.stiction_velocity
    static_friction = law.static_friction
    if slip < stiction_velocity:
        rise = _adams_step(0.5 * (slip + stiction_velocity) / stiction_velocity)
        return static_friction * (2.0 * rise - 1.0)
    fall = _adams_step((slip - stiction_velocity) / (law.transition_velocity - stiction_velocity))
    return static_friction + (law.dynamic_friction - static_friction) * fall


@compiled
def _impact(turn, speed, surfaces, law, workspace):
    """Compute IMPACT's force and torque between the compliant dog and one rigid dog.

    Returns
    -------
    tuple of float
        Force along the shaft, N, and torque about it, N m, on the rigid dog.
    """
    buffers = _clip_buffers(workspace)
    volume = 0.0
    deepest = 0.0
    # Integrals over the volume of the overlap: of the position, and of the normal.
    px = 0.0
    py = 0.0
    nx = 0.0
    ny = 0.0
    nz = 0.0
    plane_count = surfaces.normals.shape[0]
    for quad in range(surfaces.rigid_normals.shape[0]):
        normal = surfaces.rigid_normals[quad]
        if not _may_touch(quad, surfaces, buffers):
            continue
        for plane in range(plane_count):
            corner_count, polygon = _part_nearest(quad, plane, surfaces, buffers)
            corners = buffers.polygons[polygon]
            for i in range(corner_count):
                depth = _depth(corners[i, 0], corners[i, 1], corners[i, 2], buffers.planes[plane])
                deepest = max(deepest, depth)
            for i in range(1, corner_count - 1):
                weight, points = _quadrature_points(polygon, i, normal, plane, buffers)
                for x, y, depth in points:
                    point_volume = weight * depth
                    volume += point_volume
                    px += point_volume * x
                    py += point_volume * y
                    nx += point_volume * normal[0]
                    ny += point_volume * normal[1]
                    nz += point_volume * normal[2]
    if volume <= 0.0:
        return 0.0, 0.0
    length = math.sqrt(nx * nx + ny * ny + nz * nz)
    x = px / volume
    y = py / volume
    nx /= length
    ny /= length
    nz /= length
    vx = turn * y
    vy = -turn * x
    vz = -speed
    closing_speed = vx * nx + vy * ny + vz * nz
    spring = law.stiffness * deepest * math.sqrt(deepest)
    damping = law.damping * _adams_step(deepest / law.damping_depth) * closing_speed
    force = max(spring + damping, 0.0)
    vx -= closing_speed * nx
    vy -= closing_speed * ny
    vz -= closing_speed * nz
    slip = math.sqrt(vx * vx + vy * vy + vz * vz)
    friction = impact_friction_at(slip, law) / slip if slip > MIN_SLIP else 0.0
    axial = -force * (nz + friction * vz)
    return axial, -force * (x * (ny + friction * vy) - y * (nx + friction * vx))


@making
def face_overlap(angle, numbers):
    """Compute the overlap of two faces along the circumference, m; a number or (n,).

    At the mean radius *r* the overlap is ``L = c + a r``: *c* is the overlap of the ridges at dogs
    facing dogs, *a* the angle from there. Faces part at L = 0, ridge on ridge, and at twice the
    width of a face. Where L is negative, the backs of the tips overlap by -L.
    """
    pitch = numbers.pitch_angle
    offset = (angle + 0.5 * pitch) % pitch - 0.5 * pitch
    return numbers.crest_overlap + offset * numbers.mean_radius


@compiled
def overlapping_surfaces(overlap, numbers):
    """Select the surfaces that overlap, faces or backs, by the sign of a ``face_overlap``.

    Returns
    -------
    tuple of float
        Overlap of the faces or of the backs, at least 0; overlap at which they part; depth below
        the crests at which they touch, m.
    """
    if overlap > 0.0:
        excess = max(0.0, overlap - numbers.face_width)
        depth = overlap * numbers.face_slope + excess * numbers.face_slope_rise
        return overlap, numbers.face_reach, depth
    excess = max(0.0, -overlap - numbers.back_width)
    depth = -overlap * numbers.back_slope + excess * numbers.back_slope_rise
    return -overlap, numbers.back_reach, depth


@compiled
def faces_meet(angle, displacement, numbers):
    """Decide whether a position allows a face to touch a face, or a back a back.

    Faces of equal chamfer that overlap by L touch at a depth of ``L tan(chamfer)``; a twentieth of
    the height is added as one face may be turned against the other.
    """
    overlap, max_overlap, depth = overlapping_surfaces(face_overlap(angle, numbers), numbers)
    max_depth = depth + FACE_DEPTH_SHARE * numbers.height
    return 0.0 < overlap < max_overlap and displacement - numbers.axial_gap <= max_depth
