"""Volume of the part against closed forms and by hand, its limits, and its STL."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from dogshape.sim.errors import GeometryError
from dogshape.sim.part import lands, part_volume, ring_part
from dogshape.sim.shift.geometry import LAND, Dog, section
from dogshape.sim.shift.mesh import Mesh, to_stl
from dogshape.sim.units import DEG, MM
from tests.properties.test_part import open_edges

BODY = 5.0 * MM
UNDERCUT = {"traction": -4.0 * DEG, "braking": -8.0 * DEG, "chamfer": 0.0, "backlash": 2.0 * MM}
ROOF = {"crest": 0.4, "chamfer_back": 12.0 * DEG, "backlash": 0.3 * MM, "edge_radius": 0.4 * MM}


def _annulus(dog: Dog) -> float:
    return math.pi * (dog.outer_radius**2 - dog.inner_radius**2)


@pytest.mark.parametrize(
    "shape", [(0.0, 0.0, 0.0), (12.0, 22.0, 0.0), (0.0, 30.0, 0.0), (-4.0, -9.0, 2.5)]
)
def test_without_chamfer_dogs_fill_half_of_the_height(
    prototype: Dog, shape: tuple[float, float, float]
) -> None:
    """Sharp dogs between leaning planes hold exactly half of the annulus, less half the play."""
    traction, braking, play = shape
    angles = {"chamfer": 0.0, "traction": traction * DEG, "braking": braking * DEG}
    dog = replace(prototype, backlash=play * MM, **angles)
    filled = 0.5 * (1.0 - dog.backlash_angle / dog.pitch_angle)
    exact = _annulus(dog) * (BODY + filled * dog.height)
    assert part_volume(dog, 0.0, BODY) == pytest.approx(exact, rel=3e-6)


def test_narrow_ring_is_its_section_bent_round(prototype: Dog) -> None:
    """A ring of no width holds the area of the unrolled section times its circumference."""
    dog = replace(prototype, outer_diameter=48.01 * MM, inner_diameter=47.99 * MM)
    x, z = np.array(section(dog)).T
    area = 0.5 * abs(float(x @ np.roll(z, -1) - z @ np.roll(x, -1)))
    teeth = part_volume(dog, 0.0, BODY) - _annulus(dog) * BODY
    # Bending the section round changes its widths by (s/r)²/6 or so.
    assert teeth == pytest.approx(dog.count * area * dog.radial_width, rel=2e-3)


def test_a_chamfer_takes_half_of_width_squared_times_its_slope(prototype: Dog) -> None:
    """Side angles of 0: the wedge is the integral of y²/2 over the radius, by hand."""
    flat = replace(prototype, chamfer=0.0, traction=0.0, braking=0.0)
    theta, ro, ri = flat.pitch_angle, flat.outer_radius, flat.inner_radius
    # The depth is tan(chamfer) r sin(phi) over the angle phi from the crest, up to half a pitch.
    slope = math.tan(5.0 * DEG)
    wedge = flat.count * slope * (1.0 - math.cos(0.5 * theta)) * (ro**3 - ri**3) / 3.0
    both = [part_volume(replace(flat, chamfer=a), 0.0, BODY) for a in (0.0, 5.0 * DEG)]
    assert both[0] - both[1] == pytest.approx(wedge, rel=1e-3)


def test_fillets_take_what_roundings_leave_at_right_angles(prototype: Dog) -> None:
    """A square less a quarter circle each: larger tips alone lose their difference."""
    dog = replace(prototype, chamfer=0.0, traction=0.0, braking=0.0)
    one, other = 0.3 * MM, 0.8 * MM
    taken = 2.0 * dog.count * (1.0 - math.pi / 4.0) * dog.radial_width * (other**2 - one**2)
    even, blunt = (part_volume(replace(dog, edge_radius=r), one, BODY) for r in (one, other))
    assert even == pytest.approx(part_volume(dog, 0.0, BODY), rel=3e-5)
    assert even - blunt == pytest.approx(taken, rel=5e-3)


@pytest.mark.parametrize("radius", [0.0, 0.3 * MM, 1.0 * MM])
def test_the_volume_converges_with_the_square_of_the_step(prototype: Dog, radius: float) -> None:
    volumes = [
        ring_part(prototype, radius, BODY, n, 0.5 * prototype.pitch_angle / n).volume
        for n in (24, 48, 96)
    ]
    first, second = np.diff(volumes)
    assert first / second == pytest.approx(4.0, rel=0.1)
    limit = volumes[-1] + second / 3.0
    assert part_volume(prototype, radius, BODY) == pytest.approx(limit, rel=1e-5)


def test_fillets_need_room(prototype: Dog) -> None:
    """Side angles and chamfer of 0: two right-angled corners share the height."""
    ring_part(prototype, 2.1 * MM, BODY)
    dog = replace(prototype, chamfer=0.0, traction=0.0, braking=0.0, height=2.0 * MM)
    assert lands(dog, 0.5 * (dog.height - LAND)).min() == pytest.approx(LAND, abs=1e-8)
    for radius, words in (
        (2.2 * MM, r"root_radius_mm is 2\.2 mm, but .* 2\.1\d+ mm"),
        (-1.0 * MM, r"root_radius_mm is -1 mm"),
        (1e-9, r"root_radius_mm is 1e-06 mm, but it must be 0 or"),
    ):
        with pytest.raises(GeometryError, match=words):
            ring_part(prototype, radius, BODY)


def test_tip_may_close_on_chords_before_it_does_on_arcs(prototype: Dog) -> None:
    """Widths on arcs leave a micrometre of tip; the straight edges have crossed by then."""
    height = prototype.pitch_angle * prototype.inner_radius / prototype.lean - 2e-6
    dog = replace(prototype, height=height)
    assert dog.tip_width_at(dog.inner_radius) > 0.0
    with pytest.raises(GeometryError, match=r"at the inner radius is -0\.0.* mm"):
        ring_part(dog, 0.0, BODY)


def _read(data: bytes) -> Mesh:
    """Read a binary STL; corners with equal coordinates are one."""
    kind = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    facets = np.frombuffer(data, kind, offset=84)
    assert int.from_bytes(data[80:84], "little") == len(facets)
    points, cells = np.unique(facets["corners"].reshape(-1, 3), axis=0, return_inverse=True)
    corners = facets["corners"].astype(float)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    assert (normals * facets["normal"]).sum(1) == pytest.approx(np.ones(len(facets)), abs=1e-5)
    return Mesh(points.astype(float), cells.reshape(-1, 3))


@pytest.mark.parametrize("radius", [0.0, 0.3 * MM])
@pytest.mark.parametrize("shape", [{}, UNDERCUT, ROOF])
def test_stl_is_binary_closed_and_in_millimetres(
    prototype: Dog, shape: dict[str, float], radius: float
) -> None:
    ring = ring_part(replace(prototype, **shape), radius, BODY)
    data = to_stl(ring, "sliding ring")
    assert data == to_stl(ring, "sliding ring")
    assert b"mm: sliding ring" in data[:80]
    assert not data.startswith(b"solid")
    read = _read(data)
    assert len(read.vertices) == len(ring.vertices)
    assert open_edges(read.cells) == 0
    assert read.volume == pytest.approx(ring.volume * 1e9, rel=1e-6)
