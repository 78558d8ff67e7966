"""Dimensions and meshes of dogs against hand calculation, closed forms and symmetry; refusals."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import fields, replace
from itertools import pairwise

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from dogshape.sim.errors import DogshapeError
from dogshape.sim.shift.geometry import FLANKS, Dog, Dogs, crest_loss, flank_contact, section
from dogshape.sim.shift.mesh import (
    Plane,
    compliant_dog,
    dog_planes,
    dog_solid,
    meeting,
    pressure_apex,
    rigid_dog,
    rotation,
    touching_planes,
    touching_quads,
)
from dogshape.sim.units import DEG, MM
from tests.conftest import dog_of


def roof(prototype: Dog, **change: float) -> Dog:
    """Return the prototype with a ridge in the middle, 12 deg to both sides, and changes."""
    own = {"crest": 0.5, "chamfer": 12.0 * DEG, "chamfer_back": 12.0 * DEG, **change}
    return replace(prototype, **own)


def mirrored(dog: Dog) -> Dog:
    """Return the mirror image of a dog: its flanks, falls and the place of its ridge exchanged."""
    return replace(
        dog,
        chamfer=dog.chamfer_back,
        chamfer_back=dog.chamfer,
        crest=1.0 - dog.crest,
        traction=dog.braking,
        braking=dog.traction,
    )


#: Ridge, falls to braking and traction flank in deg, traction, braking in deg, backlash in mm.
SHAPES = {
    "roof": (0.5, 12.0, 12.0, 12.0, 22.0, 0.0),
    "ridge aside": (0.8, 16.0, 9.0, 12.0, 22.0, 0.3),
    "flat behind": (0.4, 12.0, 0.0, 10.0, 15.0, 0.0),
    "undercut": (0.55, 16.0, 16.0, -3.0, -3.0, 0.6),
    "ridge at the braking edge": (0.0, 0.0, 8.0, 22.0, 12.0, 0.3),
    "play alone": (1.0, 8.0, 0.0, 12.0, 22.0, 1.0),
}


@pytest.mark.parametrize(
    ("dimension", "millimetres"),
    [
        *(("pitch", 10.053), ("tip_width", 3.886), ("root_width", 6.167), ("entry_play", 2.281)),
        *(("edge_drop", 0.579), ("face_width", 4.120), ("crest_overlap", 4.240)),
        *(("travel", 4.7), ("axial_length", 8.4)),
    ],
)
def test_prototype_dimensions(prototype: Dog, dimension: str, millimetres: float) -> None:
    assert getattr(prototype, dimension) * 1e3 == pytest.approx(millimetres, abs=6e-4)


def test_mating_flanks_coincide_at_full_depth(prototype: Dog) -> None:
    """One ring turned over about x and set half a pitch on: its flanks lie in ours."""
    planes = dog_planes(prototype)
    for flank, side in ((planes.traction, 1), (planes.braking, -1)):
        turned_over = flank.normal * [1.0, -1.0, -1.0]
        mate = rotation(side * 0.5 * prototype.pitch_angle) @ turned_over
        assert mate == pytest.approx(-flank.normal, abs=1e-12)


def shaped(prototype: Dog, name: str, shapes: Mapping[str, tuple[float, ...]] = SHAPES) -> Dog:
    """Return the prototype in a shape of ``shapes``."""
    crest, chamfer, back, traction, braking, backlash = shapes[name]
    angles = {"chamfer": chamfer, "chamfer_back": back, "traction": traction, "braking": braking}
    own = {key: value * DEG for key, value in angles.items()}
    return replace(prototype, crest=crest, backlash=backlash * MM, **own)


@pytest.mark.parametrize("name", SHAPES)
def test_planes_meet_in_the_points_of_the_profile(prototype: Dog, name: str) -> None:
    """At the mean radius, within what arcs differ from the straight lines across; a ridge exactly.

    Distances are across the radial line that a flank or a ridge is parallel to.
    """
    dog = shaped(prototype, name)
    planes = dog_planes(dog)
    around = [planes.root, *planes.touching, planes.root]
    lines = [-1.0] * 2 + [2.0 * dog.crest - 1.0] * (len(around) == 6) + [1.0] * 2
    for first, last, line, (y, z) in zip(around[:-1], around[1:], lines, section(dog), strict=True):
        lead = 0.25 * line * (dog.pitch_angle - dog.backlash_angle)
        along, across, _ = rotation(lead).T
        point = meeting(first, last, Plane(along, dog.mean_radius))
        arc = lead * dog.mean_radius
        close = 5e-6 if abs(line) == 1.0 else 1e-12
        assert (arc + across @ point, point[2]) == pytest.approx((y, z), abs=close)


@pytest.mark.parametrize("name", SHAPES)
def test_mirrored_dogs_have_mirrored_dimensions(prototype: Dog, name: str) -> None:
    dog = shaped(prototype, name)
    other = mirrored(dog)
    assert (other.edge_drop, other.back_drop) == pytest.approx((dog.back_drop, dog.edge_drop))
    assert (other.face_width, other.back_width) == pytest.approx((dog.back_width, dog.face_width))
    assert other.crest_overlap == pytest.approx(-dog.crest_overlap, abs=1e-12)
    assert other.ridge_offset == pytest.approx(-dog.ridge_offset, abs=1e-12)
    assert other.passing_play == pytest.approx(dog.passing_play)
    assert (other.edge_room, other.crest_cut) == pytest.approx((dog.edge_room, dog.crest_cut))
    assert crest_loss(other, 2e-4) == pytest.approx(crest_loss(dog, 2e-4))
    for one, mate in zip(FLANKS, reversed(FLANKS), strict=True):
        assert flank_contact(other, 2e-4, mate) == flank_contact(dog, 2e-4, one)
    assert np.array(section(other))[::-1] * [-1.0, 1.0] == pytest.approx(np.array(section(dog)))


def test_a_ridge_at_an_edge_is_the_single_chamfer(prototype: Dog) -> None:
    """In the limit: the planes of the prototype, whatever the back is, as it has no width then."""
    near = roof(prototype, crest=1.0 - 1e-9, chamfer=prototype.chamfer)
    single = dog_planes(prototype)
    both = dog_planes(near)._replace(back=None)
    for plane, single_plane in zip(both, single, strict=True):
        if plane is not None and single_plane is not None:
            assert plane.normal == pytest.approx(single_plane.normal, abs=1e-9)
            assert plane.offset == pytest.approx(single_plane.offset, abs=1e-9)
    assert near.back_drop == pytest.approx(0.0, abs=1e-9)


def test_flanks_take_each_other_in_with_the_backlash(prototype: Dog) -> None:
    """At full depth a tip stands at the other ring's roots, where its slot is wider by the play."""
    for name in SHAPES:
        dog = shaped(prototype, name)
        assert dog.pitch - dog.root_width - dog.tip_width == pytest.approx(dog.backlash)
        assert dog.pitch - 2.0 * dog.tip_width == pytest.approx(dog.entry_play)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"crest": 1.2}, ("dog.crest is 1.2", "between 0 and 1; give a share of the tip")),
        ({"chamfer_back": 0.1}, ("dog.chamfer_back_deg is 5.7", "0.5 for a ridge in the middle")),
        ({"crest": 0.0}, ("dog.chamfer_deg is 8", "dog.crest = 0", "braking edge")),
        ({"backlash": -1e-4}, ("dog.backlash_mm is -0.1 mm", "between 0 and 50 mm")),
        ({"backlash": 9e-3}, ("tip width at the inner radius is -", "less backlash")),
        ({"traction": -11 * DEG}, ("dog.traction_deg is -11 deg", "between -10 and", "undercut")),
        (
            {"traction": -5 * DEG, "braking": -5 * DEG},
            ("play at the mouth of a slot is -0.407", "use more backlash, less undercut"),
        ),
        (
            {"traction": -10 * DEG, "braking": -10 * DEG, "height": 9e-3, "backlash": 3.3e-3,
             "chamfer": 0.0},
            ("root width at the inner radius is", "more than half the tip width"),
        ),
        (
            {"crest": 0.1, "chamfer_back": 40 * DEG},
            ("height of the traction flank is", "more than half the height, 1.85 mm"),
        ),
        ({"count": 70}, ("tip width at the inner radius is -", "0 mm")),
        ({"height": 16e-3}, ("tip width at the inner radius is -", "0 mm")),
        ({"chamfer": 30 * DEG}, ("height of the braking flank is", "1.85 mm")),
        ({"edge_radius": 3 * MM}, ("dog.edge_radius_mm is 3 mm, but", "at most 2.425 mm")),
        ({"edge_radius": 0.01 * MM}, ("an edge is sharp (0 mm) or at least 0.02 mm round",)),
        ({"count": 1}, ("dog.count is 1",)),
        ({"height": 3.7}, ("dog.height_mm is 3700 mm",)),
        ({"height": math.nan}, ("dog.height_mm is nan mm",)),
        ({"chamfer": -0.1}, ("dog.chamfer_deg is -5.7",)),
        ({"inner_diameter": 60e-3}, ("dog.outer_diameter_mm = 52 mm",)),
    ],
)  # fmt: skip
def test_impossible_dogs_are_refused_with_a_remedy(
    prototype: Dog, change: dict[str, float], words: tuple[str, ...]
) -> None:
    with pytest.raises(DogshapeError) as refused:
        replace(prototype, **change)
    assert all(word in str(refused.value) for word in words), str(refused.value)


def test_many_dogs_are_as_each_of_them(prototype: Dog) -> None:
    """Every closed form of an array of shapes, with ridges on edges and between them."""
    dogs = [shaped(prototype, name) for name in SHAPES]
    names = ("chamfer", "traction", "braking", "crest", "chamfer_back", "backlash")
    arrays = {name: np.array([getattr(dog, name) for dog in dogs]) for name in names}
    many = Dogs(**({f.name: getattr(prototype, f.name) for f in fields(Dog)} | arrays))
    assert np.all(many.possible)
    for name in (
        *("tip_width", "root_width", "entry_play", "passing_play", "edge_drop", "back_drop"),
        *("face_width", "back_width", "crest_overlap", "edge_room", "side_lengths", "edge_cuts"),
        *("crest_cut", "ridge_offset", "falls"),
    ):
        each = np.array([getattr(dog, name) for dog in dogs]).T
        assert np.broadcast_to(getattr(many, name), each.shape) == pytest.approx(each), name


def test_undercut_passes_as_far_as_the_chamfers_let_it(prototype: Dog) -> None:
    """With a roof flanks first face each other twice the drop of the edge further in."""
    own = {"traction": -3.0 * DEG, "braking": -3.0 * DEG}
    dog = roof(prototype, chamfer=16 * DEG, chamfer_back=16 * DEG, backlash=0.4e-3, **own)
    drop = dog.drops_at(dog.inner_radius)[1]
    least = 2.0 * math.tan(3.0 * DEG) * (dog.height - 2.0 * drop)
    inner = dog.inner_radius / dog.mean_radius
    assert dog.passing_play == pytest.approx(dog.backlash * inner - least)
    with pytest.raises(DogshapeError, match="play at the mouth of a slot"):
        replace(dog, backlash=0.98 * least / inner)  # a wider tip has a deeper edge
    flat = replace(dog, crest=1.0, chamfer=0.0, chamfer_back=0.0, backlash=0.5e-3)
    assert flat.passing_play == pytest.approx(flat.entry_play - 0.5e-3 * (1.0 - inner))


ROOFS = {
    **{name: SHAPES[name] for name in ("roof", "ridge aside", "flat behind", "undercut")},
    "ridge near the edge": (0.97, 8.0, 12.0, 12.0, 22.0, 0.0),
    "symmetric": (0.5, 13.0, 13.0, 13.0, 13.0, 0.3),
    "steep": (0.3, 25.0, 30.0, 4.0, 29.0, 0.0),
    "nearly flat": (0.6, 0.02, 0.01, 12.0, 22.0, 0.0),
}
ALL = {**ROOFS, **SHAPES}
#: Chamfer, traction, braking in deg, height in mm, dogs: the prototype and corners of the range.
PLAIN = [(8, 12, 22, 3.7, 15), (2, 4, 5, 1.6, 6), (6, 29, 29, 5.5, 10), (15, 7, 25, 2.0, 34)]


@pytest.mark.parametrize(
    ("shape", "radius"),
    [
        *((shape, radius) for shape in PLAIN for radius in (0.0, 0.02, 0.1, 0.3)),
        *((name, radius) for name in ROOFS for radius in (0.0, 0.02, 0.07)),
    ],
)
def test_pressure_of_a_dog_is_its_depth_below_the_nearest_face(
    prototype: Dog, shape: str | tuple[float, ...], radius: float
) -> None:
    """Tetrahedra fill the convex body; Drake's pressure, from distances, is depth to a third."""
    named = isinstance(shape, str)
    sharp = shaped(prototype, shape, ROOFS) if named else dog_of(prototype, shape)
    dog = replace(sharp, edge_radius=radius * MM)
    mesh, (apex, full) = compliant_dog(dog), pressure_apex(dog)
    cells = mesh.vertices[mesh.cells]
    volumes = np.linalg.det(cells[:, 1:] - cells[:, :1]) / 6.0
    hull = ConvexHull(mesh.vertices)
    assert (volumes > 0.0).all()
    assert volumes.sum() == pytest.approx(hull.volume, rel=1e-9)
    assert mesh.vertices[-1] == pytest.approx(apex)
    # Vertices: of the skin, of either axis (ends on the skin, the others within), apex.
    field = np.zeros(len(mesh.vertices))
    field[-1], field[[-8, -7, -4, -3]] = full, radius * MM
    if named:  # of an interior vertex of a convex body the distance to the skin is the least depth
        field = -(mesh.vertices @ hull.equations[:, :3].T + hull.equations[:, 3]).max(axis=1)
        assert field.argmax() == len(field) - 1
        assert field[-1] == pytest.approx(full)
    planes, rng, skin = touching_planes(dog), np.random.default_rng(3), rigid_dog(dog)
    inverse = np.linalg.inv(
        np.concatenate([cells.transpose(0, 2, 1), np.ones((len(cells), 1, 4))], axis=1)
    )
    for triangle in skin.vertices[skin.cells]:
        inward = np.cross(triangle[2] - triangle[0], triangle[1] - triangle[0])
        inward /= np.linalg.norm(inward)
        for weights in rng.dirichlet(np.ones(3), 6):
            place = weights @ triangle + rng.uniform(0.0, full / 3.0) * inward
            depth = min(plane.depth(place) for plane in planes)
            shares = inverse @ [*place, 1.0]
            found = np.flatnonzero((shares > -1e-7).all(axis=1))
            if depth > 0.0:
                pressure = shares[found[0]] @ field[mesh.cells[found[0]]]
                assert pressure == pytest.approx(depth, abs=1e-9)


@pytest.mark.parametrize("name", [*SHAPES, "prototype"])
def test_rigid_surfaces_lie_in_the_planes_and_close_to_the_volume_of_the_profile(
    prototype: Dog, name: str
) -> None:
    dog = prototype if name == "prototype" else shaped(prototype, name)
    skin, solid = rigid_dog(dog), dog_solid(dog)
    for quad, plane in zip(touching_quads(dog), touching_planes(dog), strict=True):
        for corner in skin.vertices[list(quad)]:
            assert plane.depth(corner) == pytest.approx(0.0, abs=1e-12)
    edges = [(a, b) for cell in solid.cells.tolist() for a, b in pairwise([*cell, cell[0]])]
    assert sorted(edges) == sorted((b, a) for a, b in edges)
    y, z = np.array(section(dog)).T
    area = 0.5 * abs(float(y @ np.roll(z, -1) - z @ np.roll(y, -1)))
    assert solid.volume == pytest.approx(area * dog.radial_width, rel=0.02)
