"""The pair of rings as solids in a STEP file, for drawing and machining.

Planes and cylinders of one pitch are joined to an open shell that reaches a little beyond inner and
outer radius; a sector of a plain ring is split with it, and the part below is repeated about the
axis and sewn. So the kernel (Open CASCADE, through build123d) never has to make a fillet, the one
operation of it that fails for small lands. build123d is an optional extra and slow to import.
"""

from __future__ import annotations

import io
import itertools
import math
import re
from collections.abc import Sequence
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from dogshape.sim.errors import InputError
from dogshape.sim.files import naming
from dogshape.sim.part import between, dog_corners, require_room
from dogshape.sim.shift.geometry import Dog
from dogshape.sim.shift.mesh import Corner, Lines, Vertices, rotation
from dogshape.sim.units import MM

BEYOND = 0.02e-3  #: how far the shell reaches beyond the annulus, m; less than a land
STEP = math.radians(1.0)  #: of the polygons that end its planes there
#: A fixed time in the header: the same rings give the same file.
TIME = "2000-01-01T00:00:00"


def load_cad() -> Any:
    """Import build123d when it is first needed; an InputError says how to install it."""
    try:
        return import_module("build123d")
    except ImportError as error:
        fault = f"STEP files need build123d, which cannot be loaded ({error})"
        remedy = "install 'dogshape[cad]' with pip, and on Debian the packages libgl1 and libx11-6"
        raise InputError(f"{fault}; {remedy}") from error


def write_step(dog: Dog, root_radius: float, body: float, path: Path) -> None:
    """Write both rings as they stand before the shift to a STEP file in mm.

    Two solids, ``sliding ring`` and ``output ring``, on the z axis with their crests an
    axial gap apart; dogs face slots, so that an axial move alone leads to full depth.
    The gap is between the sharp crests: with a chamfer, rounded ones stand a little lower.

    ``root_radius`` is that of fillets and rounded tips, ``body`` the thickness of either ring below
    the floors of its slots, m. InputError without build123d; GeometryError where fillets or
    roundings do not fit, or the body has no thickness.
    """
    cad = load_cad()
    ring = ring_solid(dog, root_radius, body)
    # Transformed, not moved: a moved copy would share the name of the first ring.
    other = ring.rotate(cad.Axis.X, 180.0, transform=True)
    other = other.rotate(cad.Axis.Z, math.degrees(0.5 * dog.pitch_angle), transform=True)
    other = other.translate((0.0, 0.0, dog.travel / MM), transform=True)
    ring.label, other.label = "sliding ring", "output ring"
    pair = cad.Compound(label="dog clutch", children=[ring, other])
    written = io.BytesIO()
    cad.export_step(pair, written, timestamp=TIME)
    # Parts are numbered from 1; the kernel goes on counting from file to file.
    count, pattern = itertools.count(1), rb"(NEXT_ASSEMBLY_USAGE_OCCURRENCE\(')\d+'"
    text = re.sub(pattern, lambda found: b"%b%d'" % (found[1], next(count)), written.getvalue())
    with naming(path):
        path.write_bytes(text)


def ring_solid(dog: Dog, root_radius: float, body: float) -> Any:
    """Return one ring in its own frame (``sim.shift.mesh``) as a build123d solid in mm."""
    require_room(dog, root_radius)
    cad, corners = load_cad(), dog_corners(dog, root_radius)
    # The radial plane through the slot's floor, mid at the inner radius where that is narrowest,
    # stays on it all the way out.
    here = corners[-1].lines(1)[-1:].at(dog.inner_radius)[0]
    there = corners[0].lines(1)[:1].turned(dog.pitch_angle).at(dog.inner_radius)[0]
    x, y, _ = here / math.hypot(*here[:2]) + there / math.hypot(*there[:2])
    stop = math.atan2(y, x)
    shell = cad.Shell(_toothed_side(cad, dog, corners, stop))
    halves = _sector(cad, dog, body, stop).split(shell, keep=cad.Keep.ALL)
    pitch = min(halves, key=lambda half: half.center().Z)
    faces = []
    for face in pitch.faces():  # but those of the cuts
        angle = math.atan2(face.center().Y, face.center().X)
        if abs(math.remainder(angle - stop, dog.pitch_angle)) > 1e-9:
            faces.append(face)
    turns = [math.degrees(index * dog.pitch_angle) for index in range(dog.count)]
    turned = [face.rotate(cad.Axis.Z, turn) for turn in turns for face in faces]
    return cad.Solid(cad.Shell(turned)).clean()


def _toothed_side(cad: Any, dog: Dog, corners: Sequence[Corner], stop: float) -> list[Any]:
    """Return the faces of one pitch, floor to floor, a little larger than the annulus."""
    level = np.array([[0.0, 0.0, -0.5 * dog.height]])
    # The floors reach a little beyond the cut as well.
    angles = (stop - dog.pitch_angle - 0.01, stop + 0.01)
    rays = [Lines(level, rotation(angle)[:, :1].T) for angle in angles]
    first, last = (_Edge(ray, *(ray.at(radius)[0] for radius in _beyond(dog))) for ray in rays)
    edges, faces = [first], []
    for corner in corners:
        lines = corner.lines(8)
        # Cut at right angles to the corner's axis, beyond the annulus.
        cuts = [(lines.at(radius) - corner.axis) @ corner.direction for radius in _beyond(dog)]
        ways = (float(cuts[0].min()), float(cuts[1].max()))
        begin, end = (
            _Edge(line, *(line.points[0] + way * line.directions[0] for way in ways))
            for line in (lines[:1], lines[-1:])
        )
        faces.append(_plane(cad, dog, edges[-1], begin))
        if corner.radius:
            faces.append(_cylinder(cad, corner, begin, end))
        edges.append(end)
    return [*faces, _plane(cad, dog, edges[-1], last)]


class _Edge(NamedTuple):
    """A line of the shell with its two ends (3,), m."""

    line: Lines
    inner: Vertices
    outer: Vertices


def _beyond(dog: Dog) -> tuple[float, float]:
    return dog.inner_radius - BEYOND, dog.outer_radius + BEYOND


def _plane(cad: Any, dog: Dog, here: _Edge, there: _Edge) -> Any:
    """Return the plane face between two edges; many points keep its ends off the annulus."""
    ends = _beyond(dog)
    lines = between(here.line, there.line, ends, STEP)
    inner, outer = ([*lines.at(radius)] if len(lines.points) else [] for radius in ends)
    points = [here.inner, *inner, there.inner, there.outer, *outer[::-1], here.outer]
    return cad.Face(cad.Wire.make_polygon([_mm(point) for point in points], close=True))


def _cylinder(cad: Any, corner: Corner, begin: _Edge, end: _Edge) -> Any:
    """Return the cylinder of a corner: an arc across its axis, drawn along it."""
    middle = corner.radius * corner.normals(np.array([0.5]))[0]
    along = begin.inner - corner.axis
    centre = corner.axis + (along @ corner.direction) * corner.direction
    arc = cad.Edge.make_three_point_arc(_mm(begin.inner), _mm(centre + middle), _mm(end.inner))
    return cad.Face.extrude(arc, _mm(begin.outer - begin.inner))


def _sector(cad: Any, dog: Dog, body: float, stop: float) -> Any:
    """Return one pitch of a plain ring that ends above the crests."""
    bottom, top = -0.5 * dog.height - body, 0.5 * dog.height + 1.0 * MM
    angles = (stop - dog.pitch_angle, stop - 0.5 * dog.pitch_angle, stop)
    rims = [
        [_mm(np.array([r * math.cos(a), r * math.sin(a), bottom])) for a in angles]
        for r in (dog.inner_radius, dog.outer_radius)
    ]
    (a, _, b), (c, _, d) = rims
    arcs = [cad.Edge.make_three_point_arc(*rim) for rim in rims]
    sides = [cad.Edge.make_line(a, c), cad.Edge.make_line(b, d)]
    outline = cad.Face(cad.Wire([arcs[0], sides[0], arcs[1], sides[1]]))
    return cad.Solid.extrude(outline, cad.Vector(0.0, 0.0, (top - bottom) / MM))


def _mm(point: Vertices) -> tuple[float, float, float]:
    x, y, z = point / MM
    return float(x), float(y), float(z)
