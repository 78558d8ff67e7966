r"""Planes that bound a dog, in the frame of ``sim.shift.mesh``.

A rounded edge is a cylinder about a straight line, since all edges are straight. Contact has it as
planes that touch it, their normals at even angles :math:`\delta` between those of the two faces, so
many that the edge stands out by at most :math:`\varrho(1/\cos\tfrac{\delta}{2} - 1) \le`
``DEVIATION``. All of them are equally deep below the cylinder's axis, as the two faces are.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from dogshape.sim.shift.geometry import Dog

Vertices = NDArray[np.float64]  #: (n, 3), m
DEVIATION = (
    1e-6  #: m that planes stand out beyond the edge they touch; below a ground face's roughness
)


@dataclass(frozen=True)
class Plane:
    """Half-space ``normal . x <= offset`` with an outward unit normal (3,)."""

    normal: NDArray[np.float64]
    offset: float

    def moved(self, distance: float) -> Plane:
        """Return the plane moved outwards by ``distance``, m."""
        return Plane(self.normal, self.offset + distance)


def flank_line(dog: Dog, side: int) -> tuple[Vertices, Vertices]:
    """Return directions along and across the radial line of a flank, each (3,).

    ``side`` is +1 for the traction and -1 for the braking flank; the second
    direction points out of the dog.
    """
    quarter = 0.25 * dog.pitch_angle
    along = np.array([math.cos(quarter), side * math.sin(quarter), 0.0])
    across = np.array([-math.sin(quarter), side * math.cos(quarter), 0.0])
    return along, across


def dog_planes(dog: Dog) -> dict[str, Plane]:
    """Return the six planes that bound a dog: two flanks, face, root, inner, outer."""
    half = 0.5 * dog.height
    axis = np.array([0.0, 0.0, 1.0])
    _, across_t = flank_line(dog, +1)
    _, across_b = flank_line(dog, -1)
    lean = {"traction": (across_t, dog.traction), "braking": (across_b, dog.braking)}
    planes = {
        name: Plane(math.cos(angle) * across + math.sin(angle) * axis, 0.0)
        for name, (across, angle) in lean.items()
    }
    planes["face"] = face_plane(dog)
    planes["root"] = Plane(-axis, half)
    quarter = 0.25 * dog.pitch_angle
    radial = np.array([1.0, 0.0, 0.0])
    planes["inner"] = Plane(-radial, -dog.inner_radius * math.cos(quarter))
    planes["outer"] = Plane(radial, dog.outer_radius)
    return planes


def face_plane(dog: Dog) -> Plane:
    """Return the plane through the crest that falls by the chamfer towards braking."""
    half = 0.5 * dog.height
    _, across = flank_line(dog, +1)
    crest = -half * math.tan(dog.traction) * across + np.array([0.0, 0.0, half])
    normal = np.array([0.0, 0.0, math.cos(dog.chamfer)]) - math.sin(dog.chamfer) * across
    return Plane(normal, float(normal @ crest))


@dataclass(frozen=True)
class Edge:
    """Rounded edge of a dog.

    Parameters
    ----------
    axis : point of the cylinder's axis, m, (3,).
    direction : of the axis, outwards, (3,).
    planes : that touch the cylinder between its two faces.
    """

    axis: NDArray[np.float64]
    direction: NDArray[np.float64]
    planes: tuple[Plane, ...]


def rounded_edges(dog: Dog) -> tuple[Edge, Edge]:
    """Return crest and braking edge, both rounded with the edge radius."""
    planes = dog_planes(dog)
    pairs = pairwise([planes["traction"], planes["face"], planes["braking"]])
    crest, braking = (_edge(first, last, dog.edge_radius) for first, last in pairs)
    return crest, braking


def _edge(first: Plane, last: Plane, radius: float) -> Edge:
    along = np.cross(first.normal, last.normal)
    along *= math.copysign(1.0, along[0]) / float(np.linalg.norm(along))
    offsets = np.array([first.offset - radius, last.offset - radius, 0.0])
    axis = np.linalg.solve(np.array([first.normal, last.normal, along]), offsets)
    arc = math.acos(float(first.normal @ last.normal))
    widest = 2.0 * math.acos(radius / (radius + DEVIATION))
    steps = max(2, math.ceil(arc / widest))
    shares = np.arange(1, steps) / steps
    before, after = np.sin((1.0 - shares) * arc), np.sin(shares * arc)
    normals = (before[:, None] * first.normal + after[:, None] * last.normal) / math.sin(arc)
    return Edge(axis, along, tuple(Plane(n, float(n @ axis) + radius) for n in normals))


def touching_planes(dog: Dog) -> tuple[Plane, ...]:
    """Return the planes that can touch: traction flank, face, braking flank.

    Those of a rounded edge stand between its two faces.
    """
    planes = dog_planes(dog)
    faces = planes["traction"], planes["face"], planes["braking"]
    if dog.edge_radius == 0.0:
        return faces
    crest, edge = rounded_edges(dog)
    return faces[0], *crest.planes, faces[1], *edge.planes, faces[2]
