"""Volume of the part against closed forms and by hand, its limits, and its STL."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from dogshape.sim.errors import GeometryError
from dogshape.sim.part import (
    chamfer_volume,
    corner_volume,
    dog_corners,
    lands,
    largest_root_radius,
    part_volume,
    ring_part,
)
from dogshape.sim.shift.geometry import LAND, Dog, section
from dogshape.sim.shift.mesh import Mesh, to_stl
from dogshape.sim.units import DEG, MM

BODY = 5.0 * MM


def _annulus(dog: Dog) -> float:
    return math.pi * (dog.outer_radius**2 - dog.inner_radius**2)


@pytest.mark.parametrize("flanks", [(0.0, 0.0), (12.0, 22.0), (0.0, 30.0)])
def test_without_chamfer_dogs_fill_half_of_the_height(
    prototype: Dog, flanks: tuple[float, float]
) -> None:
    """Sharp dogs between leaning planes hold exactly half of the annulus, and the mesh too."""
    traction, braking = flanks
    dog = replace(prototype, chamfer=0.0, traction=traction * DEG, braking=braking * DEG)
    exact = _annulus(dog) * (BODY + 0.5 * dog.height)
    assert part_volume(dog, 0.0, BODY) == pytest.approx(exact, rel=1e-14)
    fine = ring_part(dog, 0.0, BODY, step=0.1 * DEG)
    assert fine.volume == pytest.approx(exact, rel=1e-6)


def test_narrow_ring_is_its_section_bent_round(prototype: Dog) -> None:
    """A ring of no width holds the area of the unrolled section times its circumference."""
    dog = replace(prototype, outer_diameter=48.01 * MM, inner_diameter=47.99 * MM)
    x, z = np.array(section(dog)).T
    area = 0.5 * abs(float(x @ np.roll(z, -1) - z @ np.roll(x, -1)))
    teeth = part_volume(dog, 0.0, BODY) - _annulus(dog) * BODY
    # Bending the section round changes its widths by (s/r)²/6 or so.
    assert teeth == pytest.approx(dog.count * area * dog.radial_width, rel=2e-3)


def test_small_chamfer_takes_half_of_width_squared_times_its_angle(prototype: Dog) -> None:
    """Side angles of 0: the wedge is the integral of y²/2 over the radius, by hand."""
    alpha = 1e-4
    dog = replace(prototype, chamfer=alpha, traction=0.0, braking=0.0, count=36)
    theta, ro, ri = dog.pitch_angle, dog.outer_radius, dog.inner_radius
    # The depth is alpha r sin(phi) over the angle phi from the crest, up to half a pitch.
    wedge = alpha * (1.0 - math.cos(0.5 * theta)) * (ro**3 - ri**3) / 3.0
    assert chamfer_volume(dog) == pytest.approx(wedge, rel=1e-6)


def test_fillet_of_a_right_angle_holds_a_square_less_a_quarter_circle(prototype: Dog) -> None:
    dog = replace(prototype, chamfer=0.0, traction=0.0, braking=0.0)
    rho = 0.3 * MM
    by_hand = (1.0 - math.pi / 4.0) * rho**2 * dog.radial_width
    for corner, sign in zip(dog_corners(dog, rho), (-1, 1, 1, -1), strict=True):
        assert corner_volume(dog, corner) == pytest.approx(sign * by_hand, rel=1e-4)


@pytest.mark.parametrize("radius", [0.0, 0.3 * MM, 2.1 * MM])
def test_mesh_tends_to_the_closed_form(prototype: Dog, radius: float) -> None:
    """The default is within 0.05 %, and twice as fine a mesh errs by a quarter."""
    exact = part_volume(prototype, radius, BODY)
    assert ring_part(prototype, radius, BODY).volume == pytest.approx(exact, rel=5e-4)
    errors = [
        ring_part(prototype, radius, BODY, n, 0.5 * prototype.pitch_angle / n).volume / exact - 1.0
        for n in (48, 96)
    ]
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.1)


def test_largest_root_radius_leaves_a_land_and_no_more(prototype: Dog) -> None:
    largest = largest_root_radius(prototype)
    assert lands(prototype, largest).min() == pytest.approx(LAND, abs=1e-8)
    ring_part(prototype, largest - 1e-8, BODY)
    with pytest.raises(GeometryError, match=r"root_radius_mm is 2\.2 mm, but .* 2\.142 mm"):
        ring_part(prototype, 2.2 * MM, BODY)
    with pytest.raises(GeometryError, match=r"root_radius_mm is -1 mm"):
        part_volume(prototype, -1.0 * MM, BODY)
    with pytest.raises(GeometryError, match=r"root_radius_mm is 1e-06 mm, but it must be 0 or"):
        part_volume(prototype, 1e-9, BODY)
    with pytest.raises(GeometryError, match="body_mm is 0 mm"):
        part_volume(prototype, 0.0, 0.0)


def test_parallel_flanks_leave_room_by_hand(prototype: Dog) -> None:
    """Side angles and chamfer of 0: two right-angled corners share the height, or the floor."""
    dog = replace(prototype, chamfer=0.0, traction=0.0, braking=0.0, height=2.0 * MM)
    assert largest_root_radius(dog) == pytest.approx(0.5 * (dog.height - LAND), abs=1e-8)
    high = replace(dog, height=20.0 * MM)
    chord = 2.0 * dog.inner_radius * math.sin(0.25 * dog.pitch_angle)
    assert largest_root_radius(high) == pytest.approx(0.5 * (chord - LAND), rel=5e-3)


def test_tip_may_close_on_chords_before_it_does_on_arcs(prototype: Dog) -> None:
    """Widths on arcs leave a micrometre of tip; the straight edges have crossed by then."""
    height = prototype.pitch_angle * prototype.inner_radius / prototype.lean - 2e-6
    dog = replace(prototype, height=height)
    assert dog.tip_width_at(dog.inner_radius) > 0.0
    with pytest.raises(GeometryError, match=r"at the inner radius is -0\.0.* mm"):
        part_volume(dog, 0.0, BODY)


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
def test_stl_is_binary_closed_and_in_millimetres(prototype: Dog, radius: float) -> None:
    ring = ring_part(prototype, radius, BODY)
    data = to_stl(ring, "sliding ring")
    assert data == to_stl(ring, "sliding ring")
    assert b"mm: sliding ring" in data[:80]
    assert not data.startswith(b"solid")
    read = _read(data)
    assert len(read.vertices) == len(ring.vertices)
    cells = read.cells
    edges = np.concatenate([cells[:, [0, 1]], cells[:, [1, 2]], cells[:, [2, 0]]]).tolist()
    there = {(a, b) for a, b in edges}
    assert len(there) == len(edges)
    assert all((b, a) in there for a, b in there)
    assert read.volume == pytest.approx(ring.volume * 1e9, rel=1e-6)
