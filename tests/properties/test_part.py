"""Every ring that the rules accept is a sound part, and two of them mesh.

Thousands of designs from the ranges of the search, with other diameters, zeros, and ridges and
undercut flanks with backlash mixed in.
"""

from __future__ import annotations

import numpy as np
import pytest

from dogshape.sim.errors import GeometryError
from dogshape.sim.part import SMALLEST_RADIUS, lands, profile, ring_part
from dogshape.sim.shift.geometry import LAND, Dog, root_radius_room
from dogshape.sim.shift.mesh import Lines, Mesh, Plane, dog_planes, rotation
from dogshape.sim.strength.manufacture import ManufacturingLimits, manufacturing_checks
from dogshape.sim.units import DEG, MM
from tests.conftest import require_program

Design = tuple[Dog, float]
COARSE = {"segments": 4, "step": 3.0 * DEG}
BODY = 5.0 * MM
NEAR = 1e-12  #: m, rounding error of a distance


def draw(rng: np.random.Generator) -> Design | None:
    """Draw a design of the search; None where the rules before this part refuse it."""
    zero = rng.random(3) < 0.04
    low, high = np.array([0.0, 4.0, 4.0]), np.array([20.0, 30.0, 30.0])
    chamfer, traction, braking = np.where(zero, 0.0, rng.uniform(low, high)) * DEG
    shape = {}
    if rng.random() < 0.4:
        traction, braking = rng.uniform(-10.0, [10.0, 0.0]) * DEG
        tip = {"crest": rng.uniform(), "chamfer_back": rng.uniform(0.0, 20.0) * DEG}
        shape = {**tip, "backlash": rng.uniform(0.0, 4.0) * MM}
    outer, inner = 52.0, 44.0
    if rng.random() < 0.4:
        outer = rng.uniform(25.0, 150.0)
        inner = outer * rng.uniform(0.3, 0.95)
    height, radius = rng.uniform(1.6, 6.0), rng.choice([0.0, rng.uniform(0.0, 0.6)], p=[0.1, 0.9])
    sizes = (height * MM, outer * MM, inner * MM, 1.0 * MM)
    try:
        dog = Dog(int(rng.integers(6, 37)), chamfer, traction, braking, *sizes, **shape)
    except GeometryError:
        return None
    made = all(check.passed for check in manufacturing_checks(dog, ManufacturingLimits()))
    return (dog, float(radius) * MM) if made else None


def designs(seed: int, number: int) -> list[Design]:
    """Return so many designs that all rules accept."""
    rng = np.random.default_rng(seed)
    found: list[Design] = []
    while len(found) < number:
        design = draw(rng)
        if design is None:
            continue
        dog, radius = design
        if rng.random() < 0.1:
            radius = root_radius_room(dog)
        if radius == 0.0 or (radius > SMALLEST_RADIUS and lands(dog, radius).min() >= LAND):
            found.append((dog, radius))
    return found


@pytest.fixture(scope="module", params=[500, pytest.param(1500, marks=pytest.mark.slow)])
def many(request: pytest.FixtureRequest) -> list[Design]:
    return designs(1, request.param)


def open_edges(cells: np.ndarray) -> int:
    """Count directed edges that occur twice or have no reverse, or are no one's reverse."""
    edges = np.concatenate([cells[:, [0, 1]], cells[:, [1, 2]], cells[:, [2, 0]]])
    size = int(cells.max()) + 1
    there, back = edges[:, 0] * size + edges[:, 1], edges[:, 1] * size + edges[:, 0]
    there, back = np.sort(there), np.sort(back)
    if np.array_equal(there, back):
        return int((np.diff(there) == 0).sum())
    return len(np.setxor1d(there, back)) or len(there)


def altitudes(mesh: Mesh) -> np.ndarray:
    """Return the smallest altitude of each triangle, m: zero when it is degenerate."""
    corners = mesh.vertices[mesh.cells]
    sides = np.roll(corners, -1, axis=1) - corners
    doubled = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1)
    return np.asarray(doubled / np.linalg.norm(sides, axis=2).max(axis=1))


def piercings(mesh: Mesh, pitches: int, count: int) -> int:
    """Count edges that pierce a triangle without sharing a corner with it.

    Only the first ``pitches`` of ``count`` are looked at: a pitch and its neighbour stand
    for the whole ring. Coplanar overlap is not seen; area and volume tell of that.
    """
    cells = mesh.cells[: len(mesh.cells) * pitches // count]
    points = mesh.vertices / MM
    edges = np.concatenate([cells[:, [0, 1]], cells[:, [1, 2]], cells[:, [2, 0]]])
    edges = np.unique(np.sort(edges, axis=1), axis=0)
    ends, corners = points[edges], points[cells]
    close = np.ones((len(edges), len(cells)), dtype=bool)
    for axis in (2, 1, 0):
        e, c = ends[:, :, axis], corners[:, :, axis]
        close &= e.max(1)[:, None] >= c.min(1)[None, :]
        close &= e.min(1)[:, None] <= c.max(1)[None, :]
    i, j = np.nonzero(close)
    apart = (edges[i][:, :, None] != cells[j][:, None, :]).all(axis=(1, 2))
    return int(_pierces(ends[i[apart]], corners[j[apart]]).sum())


def _pierces(ends: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Tell for pairs of an edge (n, 2, 3) and a triangle (n, 3, 3), mm, whether they cross."""
    begin, end = ends[:, :1], ends[:, 1:]
    sides = np.linalg.det(corners - begin), np.linalg.det(corners - end)
    a, b, c = (corners[:, k] - begin[:, 0] for k in range(3))
    way = (end - begin)[:, 0]
    around = np.array([(np.cross(p, q) * way).sum(1) for p, q in ((a, b), (b, c), (c, a))])
    tiny = 1e-11  # mm3
    crosses = (np.minimum(*sides) < -tiny) & (np.maximum(*sides) > tiny)
    return np.asarray(crosses & ((around > tiny).all(0) | (around < -tiny).all(0)))


def overturned(dog: Dog, mesh: Mesh) -> int:
    """Count triangles of inner and outer end whose normals do not point out of the ring."""
    corners = mesh.vertices[mesh.cells]
    radii = np.hypot(corners[..., 0], corners[..., 1]) - dog.mean_radius
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    outwards = (normals * corners.mean(1))[:, :2].sum(1) * radii[:, 0]
    return int((outwards <= 0.0)[np.ptp(radii, axis=1) < NEAR].sum())


def test_every_accepted_design_is_a_sound_part(many: list[Design]) -> None:
    """Closed and without degenerate triangles; seen along the radius no end folds over itself."""
    for dog, radius in many:
        mesh = ring_part(dog, radius, BODY, **COARSE)
        said = f"{dog}, root radius {radius}"
        assert open_edges(mesh.cells) == 0, said
        assert len(np.unique(mesh.cells)) == len(mesh.vertices), said
        assert altitudes(mesh).min() > 1e-9, said
        assert overturned(dog, mesh) == 0, said


def test_no_accepted_design_cuts_itself(many: list[Design]) -> None:
    for dog, radius in many[:1000]:
        mesh = ring_part(dog, radius, BODY, **COARSE)
        assert piercings(mesh, 2, dog.count) == 0, f"{dog}, root radius {radius}"


def mated(dog: Dog, mesh: Mesh, opening: float = 0.0) -> Mesh:
    """Return the other ring of a pair at full depth, or ``opening`` (m) back from it."""
    turn = rotation(0.5 * dog.pitch_angle) @ np.diag([1.0, -1.0, -1.0])
    return Mesh(mesh.vertices @ turn.T + [0.0, 0.0, opening], mesh.cells)


def clearance(dog: Dog, radius: float, points: np.ndarray) -> np.ndarray:
    """Return how far inside the slot between dogs 0 and 1 the points (n, 3) are, m.

    From the planes alone. In the wedge of a fillet, where both distances fall short of the
    radius, the distance to its axis counts.
    """
    planes = dog_planes(dog)
    x, y, z = rotation(dog.pitch_angle) @ planes.braking.normal
    floor = Plane(np.array([0.0, 0.0, 1.0]), -0.5 * dog.height)
    walls = (planes.traction, Plane(np.array([x, y, z]), planes.braking.offset))
    low = points @ floor.normal - floor.offset
    result = low
    for wall in walls:
        away = points @ wall.normal - wall.offset
        result = np.minimum(result, away)
        c = float(floor.normal @ wall.normal)
        p, q = away - radius, low - radius
        a, b = (p - c * q) / (1.0 - c * c), (q - c * p) / (1.0 - c * c)
        inside = (a < 0.0) & (b < 0.0)
        depth = radius - np.sqrt(np.maximum(a * p + b * q, 0.0))
        result = np.where(inside, np.minimum(result, depth), result)
    return result


def mate_points(dog: Dog, radius: float) -> np.ndarray:
    """Return points (n, 3) of the mating dog at full depth, from flank over tip to flank."""
    corners = profile(dog, radius, 12, 2.0 * DEG)
    rows = [corners[0][-1:], *corners[1:-2], corners[-2][:1]]
    lines = Lines(
        *(np.concatenate([getattr(r, f) for r in rows]) for f in ("points", "directions"))
    )
    ends = np.linspace(dog.inner_radius, dog.outer_radius, 5)
    points = np.concatenate([lines.at(float(end)) for end in ends])
    return mated(dog, Mesh(points, np.zeros((0, 3), dtype=np.int64))).vertices


def test_mating_dogs_fill_their_slots_and_nothing_more(many: list[Design]) -> None:
    """At full depth no point of a dog lies in the other ring; without play both flanks touch."""
    for dog, radius in many:
        gap = clearance(dog, radius, mate_points(dog, radius))
        assert gap.min() > -NEAR, f"{dog}, root radius {radius}: {gap.min()}"
        assert gap.min() < NEAR or dog.backlash > 0.0


def _overlap(one: Mesh, other: Mesh) -> float:
    """Return the volume that two closed surfaces share, mm3."""
    from manifold3d import Manifold, Mesh64

    bodies = []
    for mesh in (one, other):
        body = Manifold(Mesh64(mesh.vertices / MM, mesh.cells.astype(np.uint64)))
        assert body.status().name == "NoError"
        bodies.append(body)
    return float((bodies[0] ^ bodies[1]).volume())


@pytest.fixture(scope="module")
def _manifold() -> None:
    try:
        import manifold3d  # noqa: F401
    except ImportError:
        require_program(False, "manifold3d")


@pytest.mark.usefixtures("_manifold")
def test_two_rings_at_full_depth_share_no_volume(many: list[Design]) -> None:
    """Boolean intersection of the surfaces themselves, made by an outside library.

    Flanks touch all over, and so do tips and fillets without chamfer.
    """
    for dog, radius in many[:120]:
        mesh = ring_part(dog, radius, BODY, 16, 3.0 * DEG)
        shared = _overlap(mesh, mated(dog, mesh))
        tooth = 0.25 * dog.pitch * dog.height * dog.radial_width / MM**3
        assert shared < 1e-6 * tooth, f"{dog}, root radius {radius}"
