"""Rings of unlike dogs: both engines, limit cases, closed forms, mirror images, checks of both."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dogshape.pipeline.config.study_file import Setup, load_study
from dogshape.pipeline.simulate.design import DesignGroup, design_of, judge_design, pair_with
from dogshape.sim import kernel
from dogshape.sim.errors import GeometryError, InputError
from dogshape.sim.part import part_volume
from dogshape.sim.quantity import quantities_of
from dogshape.sim.shift.actuation import ForceProfile
from dogshape.sim.shift.clutch import Clutch, OperatingPoint, Rings
from dogshape.sim.shift.conclusion import Engagement, Outcome, engage, section_planes
from dogshape.sim.shift.geometry import FLANKS, Dog, flank_contact, section
from dogshape.sim.shift.mesh import dog_planes, rotation
from dogshape.sim.shift.pair import RING_NAMES, OutputDog, Pair, dog_pair
from dogshape.sim.shift.planar import PlanarClutch
from dogshape.sim.shift.plant import ClutchPlant
from dogshape.sim.strength.checks import RINGS, LimitCheck
from dogshape.sim.strength.dog_strength import Limits, margin_losses, strength_checks
from dogshape.sim.strength.landing import (
    MODULUS,
    Demand,
    bedding,
    crests_of,
    demands_of,
    elastic_loads,
)
from dogshape.sim.strength.materials import MATERIALS
from dogshape.sim.units import DEG, MM
from tests.conftest import Call, Point
from tests.verification.test_planar import force_of
from tests.verification.test_shapes import roof

#: Changes of the sliding dog, and the dimensions of the output dog.
UNLIKE: dict[str, tuple[dict[str, float], OutputDog]] = {
    "lower and steeper": ({}, OutputDog(height=3.0 * MM, chamfer=11 * DEG)),
    "higher and narrower": ({}, OutputDog(height=4.4 * MM, backlash=0.6 * MM)),
    "roof on one ring": ({}, OutputDog(crest=0.5, chamfer=12 * DEG, chamfer_back=9 * DEG)),
    "flat and round on one ring": ({}, OutputDog(chamfer=0.0, edge_radius=0.2 * MM)),
    "undercut": (
        {"traction": -3 * DEG, "braking": -3 * DEG, "chamfer": 6 * DEG, "backlash": 0.8 * MM},
        OutputDog(height=3.2 * MM, chamfer=9 * DEG, backlash=0.6 * MM),
    ),
}


def _unlike(clutch: Clutch, name: str) -> Clutch:
    change, output_dog = UNLIKE[name]
    return replace(clutch, dog=replace(clutch.dog, **change), output_dog=output_dog)


def _shifts(clutch: Clutch, point: OperatingPoint, angles: int) -> list[Engagement]:
    """Simulate shifts at even angles by the compiled engine in fine steps."""
    plant = PlanarClutch(clutch.with_engine("planar").refined())
    pitch = clutch.dog.pitch_angle
    return [engage(plant, point, (k + 0.5) / angles * pitch) for k in range(angles)]


@pytest.mark.parametrize("name", UNLIKE)
def test_forces_of_single_states_are_those_of_drake(clutch: Clutch, name: str) -> None:
    """As of equal rings (``test_planar``), whichever ring is the rigid one."""
    unlike = _unlike(clutch, name)
    pair = unlike.pair
    plant, compiled = ClutchPlant(unlike), PlanarClutch(unlike)
    plant.start(OperatingPoint(1.0, ForceProfile(469.0, 0.1766)), 0.1)
    carriage = plant.plant.GetBodyByName("carriage").model_instance()
    port = plant.plant.get_generalized_contact_forces_output_port(carriage)
    rng = np.random.default_rng(2)
    scale = np.array([1.0, unlike.dog.mean_radius])
    planes = section_planes(pair)
    errors = list[float]()
    while len(errors) < 60:
        angle = rng.uniform(-unlike.dog.pitch_angle, unlike.dog.pitch_angle)
        way = rng.uniform(0.98 * unlike.dog.axial_gap, pair.travel)
        if not 0.0 < kernel.penetration(way, angle, planes, unlike.numbers) < 1e-4:
            continue
        output, sliding, speed = (float(v) for v in rng.normal(0.0, [5.0, 5.0, 0.3]))
        plant.plant.SetPositions(plant.plant_context, [1.0 + angle, way, 1.0])
        plant.plant.SetVelocities(plant.plant_context, [output, speed, sliding])
        _, axial, torque = port.Eval(plant.plant_context)
        force = force_of(compiled, angle, pair.travel - way, output - sliding, speed)
        drake = np.array([-axial, torque]) / scale
        if np.hypot(*drake) > 1e-6:
            difference = np.array(force) / scale - drake
            errors.append(float(np.hypot(*difference) / np.hypot(*drake)))
    assert np.quantile(errors, 0.5) < 1e-5
    assert np.quantile(errors, 0.9) < 3e-4


@pytest.mark.parametrize("mismatch", [50, -50])
@pytest.mark.parametrize("name", UNLIKE)
def test_mean_times_follow_drake(clutch: Clutch, point: Point, name: str, mismatch: int) -> None:
    """Means over three angles within 0.1 %; measured up to 0.002 %."""
    unlike = _unlike(clutch, name)
    at = point(mismatch, 469.0)
    plant = ClutchPlant(unlike.refined())
    angles = [(k + 0.5) / 3 * unlike.dog.pitch_angle for k in range(3)]
    drake = [engage(plant, at, angle) for angle in angles]
    compiled = _shifts(unlike, at, 3)
    assert [s.outcome for s in compiled] == [s.outcome for s in drake]
    times = [
        [s.shift_time for s in shifts if s.outcome is Outcome.ENGAGED]
        for shifts in (drake, compiled)
    ]
    assert len(times[0]) >= 2
    assert np.mean(times[1]) == pytest.approx(np.mean(times[0]), rel=1e-3)


def _same_as(dog: Dog) -> OutputDog:
    names = [name for name in quantities_of(OutputDog) if name not in RING_NAMES]
    return OutputDog(**{name: getattr(dog, name) for name in names})


@pytest.mark.parametrize("shape", ["prototype", "roof"])
def test_dimensions_of_the_sliding_dog_change_no_digit(
    clutch: Clutch, point: Point, shape: str
) -> None:
    dog = clutch.dog if shape == "prototype" else roof(clutch.dog, edge_radius=0.1 * MM)
    equal = replace(clutch, dog=dog)
    same = replace(equal, output_dog=_same_as(dog))
    for mismatch in (50, -50):
        shifts, same_shifts = (_shifts(c, point(mismatch, 469.0), 3) for c in (equal, same))
        for shift, same_shift in zip(shifts, same_shifts, strict=True):
            assert shift.shift_time == same_shift.shift_time
            assert shift.loads == same_shift.loads
            assert shift.events == same_shift.events
    limits = Limits()
    same_limits = Limits(output_dog=_same_as(dog))
    checks, same_checks = (strength_checks(dog, case) for case in (limits, same_limits))
    assert checks == same_checks
    assert not any(check.ring for check in same_checks)
    losses, same_losses = (margin_losses(dog, case) for case in (limits, same_limits))
    for name, spread in losses.items():
        assert same_losses[name].worst_case == pytest.approx(spread.worst_case, rel=1e-9, abs=1e-12)


def _swapped(clutch: Clutch) -> Clutch:
    """Exchange the dogs and inertias of both rings; the new sliding dog is half root, half tip."""
    dog, output = clutch.dog, replace(clutch.pair.output, root_depth=None)
    rings = clutch.rings
    new_rings = Rings(rings.mass, rings.output_inertia, rings.sliding_inertia)
    return replace(clutch, dog=output, output_dog=_same_as(dog), rings=new_rings)


@pytest.mark.parametrize("mismatch", [50, -50])
@pytest.mark.parametrize(
    "output_dog",
    [
        OutputDog(chamfer=11 * DEG),
        OutputDog(crest=0.5, chamfer=12 * DEG, chamfer_back=10 * DEG),
        OutputDog(edge_radius=0.2 * MM),
    ],
    ids=["steeper", "roof", "round"],
)
def test_exchanged_rings_shift_alike(
    clutch: Clutch, point: Point, output_dog: OutputDog, mismatch: int
) -> None:
    """Seen from the other end both clutches are one: only relative motion and one mass count."""
    unlike = replace(clutch, output_dog=output_dog)
    shifts = _shifts(unlike, point(mismatch, 469.0), 4)
    swapped = _shifts(_swapped(unlike), point(mismatch, 469.0), 4)
    for shift, other in zip(shifts, swapped, strict=True):
        assert shift.outcome is other.outcome
        assert shift.shift_time == pytest.approx(other.shift_time, rel=1e-6)


@pytest.mark.parametrize("mismatch", [50, -50])
def test_exchanged_rings_of_one_slope_shift_alike_whichever_is_rigid(
    clutch: Clutch, point: Point, mismatch: int
) -> None:
    """Straight flanks of unlike height and play: where faces are parallel the layer has no side."""
    change = {"traction": 0.0, "braking": 0.0, "backlash": 1.0 * MM}
    straight = replace(clutch, dog=replace(clutch.dog, **change))
    unlike = replace(straight, output_dog=OutputDog(height=2.9 * MM, backlash=0.6 * MM))
    assert not unlike.pair.is_sliding_rigid
    shifts = _shifts(unlike, point(mismatch, 469.0), 4)
    swapped = _shifts(_swapped(unlike), point(mismatch, 469.0), 4)
    for shift, other in zip(shifts, swapped, strict=True):
        assert shift.shift_time == pytest.approx(other.shift_time, rel=2e-3)


@pytest.mark.parametrize("height", [2.9, 3.7, 4.6])
def test_travel_is_the_gap_and_the_lower_dog(clutch: Clutch, height: float) -> None:
    """A ring that meets nothing takes the time of free flight over it, and ends there."""
    unlike = replace(clutch, output_dog=OutputDog(height=height * MM))
    pair = unlike.pair
    assert pair.travel / MM == pytest.approx(1.0 + min(height, 3.7))
    assert pair.axial_length / MM == pytest.approx(1.0 + height + 3.7)
    profile = ForceProfile(469.0, 0.1766)
    shift = engage(
        PlanarClutch(unlike.with_engine("planar").refined()),
        OperatingPoint(0.0, profile),
        0.5 * unlike.dog.pitch_angle,
    )
    way = pair.travel - unlike.seated_tolerance
    flight = profile.free_flight_time(way, unlike.rings.mass)
    assert shift.shift_time == pytest.approx(flight, rel=1e-4)


@pytest.mark.parametrize("height", [2.9, 4.6])
def test_mating_flanks_coincide_at_full_depth(prototype: Dog, height: float) -> None:
    """Root and crest of the lower dog then lie in the crest and root of the higher one."""
    pair = dog_pair(prototype, OutputDog(height=height * MM))
    sliding, output = dog_planes(pair.sliding), dog_planes(pair.output)
    turned_over = np.array([1.0, -1.0, -1.0])
    for flank, mate, side in (
        (sliding.traction, output.traction, 1),
        (sliding.braking, output.braking, -1),
    ):
        turn = rotation(side * 0.5 * prototype.pitch_angle)
        assert turn @ (flank.normal * turned_over) == pytest.approx(-mate.normal, abs=1e-12)
        assert flank.offset == mate.offset == 0.0
    tops = [dog.addendum for dog in (pair.sliding, pair.output)]
    floors = [dog.dedendum for dog in (pair.output, pair.sliding)]
    room = [floor - top for top, floor in zip(tops, floors, strict=True)]
    assert min(room) == pytest.approx(0.0, abs=1e-15)
    assert max(room) == pytest.approx(abs(height - 3.7) * MM)


def test_play_of_a_seated_pair_is_the_mean_of_both(prototype: Dog) -> None:
    """Width of the slot of one ring less the dog of the other, in the pitch plane."""
    dog = replace(prototype, backlash=0.2 * MM)
    pair = dog_pair(dog, OutputDog(backlash=0.8 * MM, height=3.0 * MM))
    widths = [0.5 * (dog.pitch - ring_dog.backlash) for ring_dog in (pair.sliding, pair.output)]
    assert pair.backlash == pytest.approx(dog.pitch - sum(widths))
    assert pair.backlash / MM == pytest.approx(0.5)
    assert pair.entry_play == pytest.approx(
        dog.pitch - pair.sliding.tip_width - pair.output.tip_width
    )


@pytest.mark.parametrize("name", UNLIKE)
def test_faces_touch_at_their_closed_form(clutch: Clutch, name: str) -> None:
    """Depth below the crests at which two sections touch first, by the corners of both."""
    sharp = _unlike(clutch, name)
    if sharp.output_dog.edge_radius:
        sharp = replace(sharp, output_dog=replace(sharp.output_dog, edge_radius=None))
    pair, numbers = sharp.pair, sharp.numbers
    compared = 0
    for angle in np.linspace(-0.5, 0.5, 101) * sharp.dog.pitch_angle:
        overlap, reach, depth = kernel.overlapping_surfaces(
            kernel.face_overlap(angle, numbers), numbers
        )
        if 0.0 < overlap < reach:
            touch = _depth_of_touch(pair, float(angle))
            assert depth == pytest.approx(touch, abs=1e-9)
            compared += 1
    assert compared > 30


def _depth_of_touch(pair: Pair, angle: float) -> float:
    """Compute the way from crests on crests until two sections touch, m, by both outlines."""
    sliding = [(-y - angle * pair.sliding.mean_radius, z) for y, z in section(pair.sliding)]
    output = section(pair.output)
    places = [y for y, _ in (*sliding, *output)]
    gap = math.inf
    for place in places:
        heights = [_height_at(sorted(outline), place) for outline in (sliding, output)]
        if None not in heights:
            gap = min(gap, -sum(height for height in heights if height is not None))
    return pair.sliding.addendum + pair.output.addendum + gap


def _height_at(outline: list[tuple[float, float]], place: float) -> float | None:
    """Interpolate the height of a tip's outline between its edges, None beside it."""
    edges = [point for point in outline if point[1] > min(z for _, z in outline) + 1e-12]
    if not edges[0][0] - 1e-12 <= place <= edges[-1][0] + 1e-12:
        return None
    y, z = np.array(edges).T
    return float(np.interp(place, y, z))


@pytest.mark.parametrize("height", [3.0, 4.4])
def test_contact_of_flanks_runs_between_both_edges(prototype: Dog, height: float) -> None:
    """By hand at the mean radius: from the edge of the mate, above the floor, to the dog's own."""
    pair = dog_pair(prototype, OutputDog(height=height * MM, chamfer=5 * DEG))
    for dog, mate in ((pair.sliding, pair.output), (pair.output, pair.sliding)):
        for side, flank in enumerate(FLANKS):
            contact = flank_contact(dog, 0.0, flank, mate)
            own_drop = dog.drops_at(dog.mean_radius)[side]
            mate_drop = mate.drops_at(dog.mean_radius)[side]
            assert contact.low == pytest.approx(dog.dedendum - mate.addendum + mate_drop)
            assert contact.high == pytest.approx(dog.height - own_drop)
            assert contact.height == pytest.approx(pair.depth - own_drop - mate_drop)
    areas = [
        flank_contact(dog, 2e-4, "braking", mate).area
        for dog, mate in ((pair.sliding, pair.output), (pair.output, pair.sliding))
    ]
    assert areas[0] == pytest.approx(areas[1])


def test_checks_are_those_of_the_worse_ring(prototype: Dog) -> None:
    """Each dog beside its mate by itself; the ring with the smaller margin is named."""
    output_dog = OutputDog(height=3.2 * MM, chamfer=10 * DEG, backlash=0.4 * MM)
    limits = Limits(output_dog=output_dog, output_material=MATERIALS["42CrMo4"])
    output = output_dog.beside(prototype)
    checks = _by_name(strength_checks(prototype, limits))
    alone = [
        _by_name(strength_checks(prototype, Limits().beside(output))),
        _by_name(strength_checks(output, Limits(material=MATERIALS["42CrMo4"]).beside(prototype))),
    ]
    named = set[str]()
    for name, check in checks.items():
        if check.rule.group == "tolerance":
            continue
        margins = [ring_checks[name].margin for ring_checks in alone]
        assert check.margin == min(margins)
        if margins[0] != margins[1]:
            assert check.ring == RINGS[margins.index(min(margins))]
            assert check.ring in check.fault
        named.add(check.ring)
    assert named == {"", *RINGS}
    ratio = flank_contact(prototype, 0.3e-3, "braking", output).height / output.height
    assert checks["contact_ratio"].value < ratio


def _by_name(checks: tuple[LimitCheck, ...]) -> dict[str, LimitCheck]:
    return {check.name: check for check in checks}


def test_a_face_that_one_ring_lacks_does_not_deviate(prototype: Dog) -> None:
    """A roof beside a tip with one face: every margin within tolerances is finite."""
    limits = Limits(output_dog=OutputDog(crest=1.0, chamfer_back=0.0, backlash=0.0))
    dog = roof(prototype, backlash=0.3 * MM)
    losses = margin_losses(dog, limits)
    assert all(math.isfinite(spread.worst_case) for spread in losses.values())
    assert losses["flank_height"].worst_case > 0.0


def test_landing_of_unlike_edges_by_hand(prototype: Dog) -> None:
    """Hertz with 1/R = 1/0.2 + 1/0.4 per mm, at an overlap without a flat.

    The edge of 0.2 mm takes two thirds of the approach as it beds in.
    """
    dog = replace(prototype, edge_radius=0.2 * MM)
    limits = Limits(output_dog=OutputDog(edge_radius=0.4 * MM))
    loads = np.zeros((1, 22))
    loads[0, 1] = 2e5
    crests = crests_of(dog, limits)
    load = float(elastic_loads(crests, loads, limits)[0, 1])
    demand = Demand(*demands_of(dog, loads, limits)[0])
    curvature = 1.0 / 0.2e-3 + 1.0 / 0.4e-3
    assert demand.edge == pytest.approx(math.sqrt(load * MODULUS * curvature / math.pi))
    half_width = 2.0 * load / (math.pi * crests.pressure_limit)
    bedded = math.pi * crests.pressure_limit**2 / (load * MODULUS)
    depth = 2.0 / 3.0 * 0.5 * half_width**2 * (curvature - bedded)
    assert bedding(dog, demand, limits).depth == pytest.approx(depth)


def test_a_ridge_lands_on_a_face_of_another_slope_as_a_cylinder_on_a_plane(prototype: Dog) -> None:
    """Hertz with 1/R = 1/0.3 per mm, at an overlap of 2 mm; faces of one slope bear there flat.

    The ridge takes all of the approach as it beds in.
    """
    loads = np.zeros((1, 22))
    loads[0, 20] = 1e6
    limits = Limits(output_dog=OutputDog(chamfer=6 * DEG))
    crests = crests_of(prototype, limits)
    load = float(elastic_loads(crests, loads, limits)[0, 20])
    demand = Demand(*demands_of(prototype, loads, limits)[0])
    assert demand.ridge == pytest.approx(math.sqrt(load * MODULUS / (math.pi * 0.3e-3)))
    half_width = 2.0 * load / (math.pi * crests.pressure_limit)
    radius = load * MODULUS / (math.pi * crests.pressure_limit**2)
    depth = 0.5 * half_width**2 * (1.0 / 0.3e-3 - 1.0 / radius)
    assert bedding(prototype, demand, limits) == pytest.approx((depth, radius))
    flat = Demand(*demands_of(prototype, loads, Limits())[0])
    assert flat.ridge == 0.0
    assert demand.face == pytest.approx(flat.face, rel=0.05)


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"output_dog.traction_deg": 15.0}, "output_dog.traction_deg is 15 deg.*12 deg.*give 12"),
        ({"output_dog.braking_deg": -3.0}, "output_dog.braking_deg is -3 deg.*give 22"),
        ({"output_dog.height_mm": 1.8, "output_dog.chamfer_deg": 1.0}, "half of dog.height_mm"),
        ({"output_dog.chamfer_deg": 50.0}, "output ring: height of the braking flank"),
        ({"output_dog.chamfer_deg": 70.0}, "output_dog.chamfer_deg is 70 deg"),
        ({"output_dog.count": 5}, "output_dog.count.*dogs of one number"),
        ({"output_dog.material": "cheese"}, "cheese"),
        ({"output_dog.height_mm": 3.0, "wear.edge_radius_mm": 0.5}, "leave one of them out"),
    ],
)
def test_rings_that_do_not_fit_are_refused(settings: dict[str, Any], words: str) -> None:
    with pytest.raises((InputError, GeometryError), match=words):
        load_study("mq200", settings)


def test_equal_side_angles_may_be_given() -> None:
    angles = {"output_dog.traction_deg": 12.0, "output_dog.braking_deg": 22.0}
    assert load_study("mq200", angles).clutch.pair.alike


def test_undercut_dogs_that_do_not_pass_are_refused(prototype: Dog) -> None:
    """Either ring passes an equal one; the lower chamfer of the pair takes the play."""
    undercut = replace(
        prototype, traction=-6 * DEG, braking=-6 * DEG, chamfer=10 * DEG, backlash=0.62 * MM
    )
    assert dog_pair(undercut).passing_play > 0.0
    with pytest.raises(GeometryError, match="pass each other"):
        dog_pair(undercut, OutputDog(chamfer=9.9 * DEG, backlash=0.0))


def _study() -> Setup:
    return load_study("mq200", {"output_dog.height_mm": 3.2, "output_dog.material": "42CrMo4"})


def test_study_file_builds_both_rings() -> None:
    """A searched design keeps the dimensions of the output ring; hashes have them."""
    study, equal = _study(), load_study("mq200")
    assert study.physics_hash != equal.physics_hash
    assert study.config_hash != equal.config_hash
    assert study.physics["output_dog_height_mm"] == pytest.approx(3.2)
    params = {"count": 20, "chamfer_deg": 6.0}
    dog = study.dog_with(params)
    pair = pair_with(study, dog)
    assert (pair.output.count, pair.output.chamfer) == (20, pytest.approx(6.0 * DEG))
    assert pair.output.height == pytest.approx(3.2 * MM)
    design, verdict = judge_design(design_of(study, {"height_mm": 3.0}))
    assert design.exact_values["axial_length_mm"] == pytest.approx(1.0 + 3.0 + 3.2)
    failed = [check for check in design.checks if check.ring and not check.passed]
    assert all(f"({check.ring})" in verdict.line for check in failed)
    with pytest.raises(GeometryError, match=r"half of dog\.height_mm"):
        study.dog_with({"height_mm": 6.5})


def test_many_designs_are_judged_as_one() -> None:
    study = _study()
    heights = np.array([[2.8], [3.2], [3.6], [6.5]])
    dogs = DesignGroup.of(study, ["height_mm"], heights).dogs
    possible = pair_with(study, dogs).possible
    assert possible.tolist() == [True, True, True, False]
    checks = _by_name(strength_checks(dogs, study.limits))
    for place, height in enumerate(heights[:3, 0]):
        single = strength_checks(study.dog_with({"height_mm": height}), study.limits)
        for check in single:
            margins = np.broadcast_to(checks[check.name].margin, 4)
            assert margins[place] == pytest.approx(check.margin, rel=1e-9, abs=1e-12)


def test_export_writes_either_ring(tmp_path: Path, dogshape: Call) -> None:
    """Volumes of both rings by the program and by the part of each dog."""
    study = _study()
    volumes = {}
    for ring in ("sliding", "output"):
        drawing, stl = tmp_path / f"{ring}.svg", tmp_path / f"{ring}.stl"
        options = (f"--svg={drawing}", f"--stl={stl}", f"--ring={ring}", "--json")
        settings = ("--set=output_dog.height_mm=3.2", "--set=output_dog.material=42CrMo4")
        result = dogshape("export", "mq200", *options, *settings)
        volumes[ring] = result.json["ring_volume_mm3"]
        assert stl.stat().st_size > 1000
    assert "3.20" in (tmp_path / "output.svg").read_text("utf-8")
    assert "3.70" in (tmp_path / "sliding.svg").read_text("utf-8")
    pair, radius = study.clutch.pair, study.limits.root_radius
    assert volumes["sliding"] == pytest.approx(part_volume(pair.sliding, radius, 3 * MM) / MM**3)
    assert volumes["output"] == pytest.approx(part_volume(pair.output, radius, 3 * MM) / MM**3)
    assert volumes["output"] < volumes["sliding"]
