"""An output ring with low dogs between the high ones, in both engines and the checks."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from dogshape.pipeline.config.study_file import load_study
from dogshape.pipeline.export.drawing import open_section_svg, outline
from dogshape.pipeline.export.dxf import ring_outlines
from dogshape.pipeline.simulate.design import DesignGroup, pair_with
from dogshape.sim import kernel
from dogshape.sim.errors import GeometryError, InputError
from dogshape.sim.kernel_layout import (
    AXIAL_SPEED,
    DISPLACEMENT,
    OUTPUT_ANGLE,
    OUTPUT_SPEED,
    STATE_SIZE,
    shift_model,
)
from dogshape.sim.shift.actuation import ForceProfile
from dogshape.sim.shift.clutch import Clutch, OperatingPoint
from dogshape.sim.shift.conclusion import Engagement, engage, section_planes
from dogshape.sim.shift.geometry import FLANKS, Flank, flank_contact
from dogshape.sim.shift.pair import OutputDog, RingDogs
from dogshape.sim.shift.planar import PlanarClutch
from dogshape.sim.shift.plant import ClutchPlant
from dogshape.sim.shift.stepped_shift import ShiftStart, StepLoads, SteppedShift
from dogshape.sim.statistics.shiftability import direct_share
from dogshape.sim.strength.checks import RINGS
from dogshape.sim.strength.dog_strength import (
    Limits,
    bearing_limits,
    margin_losses,
    root_load,
    root_of,
    strength_checks,
)
from dogshape.sim.strength.load_case import LoadCase
from dogshape.sim.units import DEG, MM, RPM
from tests.conftest import Call, Point

LOW = ("output_dog.slots_per_dog=3", "output_dog.low_height_mm=2.6")
#: Changes of the prototype's dog, and the dimensions of the output dog.
SHAPES: dict[str, tuple[dict[str, float], OutputDog]] = {
    "chamfer": ({}, OutputDog(slots_per_dog=3, low_height=2.6 * MM)),
    "roof": (
        {"crest": 0.5, "chamfer": 12 * DEG, "chamfer_back": 9 * DEG},
        OutputDog(slots_per_dog=3, low_height=2.2 * MM),
    ),
    "undercut": (
        {"traction": -3 * DEG, "braking": -3 * DEG, "chamfer": 6 * DEG, "backlash": 0.8 * MM},
        OutputDog(slots_per_dog=5, low_height=1.6 * MM),
    ),
    "compliant output ring": (
        {},
        OutputDog(height=4.2 * MM, chamfer=11 * DEG, slots_per_dog=3, low_height=2.9 * MM),
    ),
    "on the sliding ring": (
        {},
        OutputDog(slots_per_dog=3, low_height=2.6 * MM, is_sliding_sparse=True),
    ),
    "on the sliding ring of unlike ones": (
        {},
        OutputDog(
            height=4.2 * MM,
            chamfer=11 * DEG,
            slots_per_dog=3,
            low_height=2.9 * MM,
            is_sliding_sparse=True,
        ),
    ),
}


def _low(clutch: Clutch, name: str) -> Clutch:
    change, output_dog = SHAPES[name]
    return replace(clutch, dog=replace(clutch.dog, **change), output_dog=output_dog)


def _full(clutch: Clutch) -> Clutch:
    """Make all dogs high."""
    output_dog = replace(
        clutch.output_dog, slots_per_dog=None, low_height=None, is_sliding_sparse=False
    )
    return replace(clutch, output_dog=output_dog)


def _missing(clutch: Clutch) -> Clutch:
    """Leave the low dogs out."""
    return replace(clutch, output_dog=replace(clutch.output_dog, low_height=None))


def _shifts(clutch: Clutch, at: OperatingPoint, angles: int = 4) -> list[Engagement]:
    """Simulate shifts at even relative angles by the compiled engine in fine steps."""
    plant = PlanarClutch(clutch.with_engine("planar").refined())
    pitch = clutch.dog.pitch_angle
    return [engage(plant, at, (k + 0.5) / angles * pitch) for k in range(angles)]


def _times(shifts: list[Engagement]) -> np.ndarray:
    """Shift times, s; NaN for a shift that does not engage."""
    return np.array([shift.shift_time or np.nan for shift in shifts])


def _loads(clutch: Clutch, angle: float, displacement: float, *rates: float) -> np.ndarray:
    """Force, N, and torque, N m, of all dogs in the compiled engine.

    ``rates`` are output and axial speed.
    """
    plant = PlanarClutch(clutch)
    state = np.zeros(STATE_SIZE)
    state[[OUTPUT_ANGLE, DISPLACEMENT]] = angle, displacement
    state[[OUTPUT_SPEED, AXIAL_SPEED]] = rates or (0.0, 0.0)
    model = shift_model(clutch.numbers, np.zeros((3, 2)), plant.surfaces, plant.law)
    workspace = kernel.clip_workspace(len(plant.surfaces.normals))
    return np.array(kernel.contact_loads(state, model, workspace))


@pytest.mark.parametrize("name", SHAPES)
def test_forces_of_single_states_are_those_of_drake(clutch: Clutch, name: str) -> None:
    """Down to full depth, as of rings with equal dogs (``test_unlike_rings``)."""
    low = _low(clutch, name)
    pair = low.pair
    plant = ClutchPlant(low)
    plant.start(OperatingPoint(1.0, ForceProfile(469.0, 0.1766)), 0.1)
    carriage = plant.plant.GetBodyByName("carriage").model_instance()
    port = plant.plant.get_generalized_contact_forces_output_port(carriage)
    rng = np.random.default_rng(2)
    scale = np.array([1.0, low.dog.mean_radius])
    planes = section_planes(pair)
    first_way = low.dog.axial_gap + pair.shortening
    errors = list[float]()
    low_shares = list[float]()
    while len(errors) < 40:
        angle = rng.uniform(-low.dog.pitch_angle, low.dog.pitch_angle)
        way = rng.uniform(0.98 * first_way, pair.travel)
        if not 0.0 < kernel.penetration(way, angle, planes, low.numbers) < 1e-4:
            continue
        turn, speed = (float(v) for v in rng.normal(0.0, [5.0, 0.3]))
        plant.plant.SetPositions(plant.plant_context, [1.0 + angle, way, 1.0])
        plant.plant.SetVelocities(plant.plant_context, [turn, speed, 0.0])
        _, axial, torque = port.Eval(plant.plant_context)
        drake = plant.share * np.array([-axial, torque]) / scale
        if np.hypot(*drake) < 1e-5:
            continue
        loads = _loads(low, angle, way, turn, speed) / scale
        errors.append(float(np.hypot(*(loads - drake)) / np.hypot(*drake)))
        high_loads = _loads(_missing(low), angle, way, turn, speed) / scale
        low_shares.append(float(np.hypot(*(loads - high_loads)) / np.hypot(*loads)))
    assert np.median(low_shares) > 0.1  # low dogs take part
    assert np.quantile(errors, 0.5) < 1e-5
    assert np.quantile(errors, 0.9) < 3e-4


@pytest.mark.parametrize("mismatch", [50, -50])
@pytest.mark.parametrize("name", SHAPES)
def test_mean_times_follow_drake(clutch: Clutch, point: Point, name: str, mismatch: int) -> None:
    """Means over four angles within 0.1 %; measured up to 0.0014 %."""
    low = _low(clutch, name)
    at = point(mismatch, 469.0)
    plant = ClutchPlant(low.refined())
    angles = [(k + 0.5) / 4 * low.dog.pitch_angle for k in range(4)]
    drake_times = _times([engage(plant, at, angle) for angle in angles])
    compiled_times = _times(_shifts(low, at))
    assert np.isnan(drake_times).tolist() == np.isnan(compiled_times).tolist()
    assert np.nanmean(compiled_times) == pytest.approx(np.nanmean(drake_times), rel=1e-3)


@pytest.mark.parametrize("name", ["chamfer", "on the sliding ring"])
def test_neighbouring_dogs_stand_for_the_ring(clutch: Clutch, point: Point, name: str) -> None:
    """Drake with all dogs of both rings, at any pitch."""
    low = _low(clutch, name).refined()
    plant = ClutchPlant(replace(low, solver=replace(low.solver, all_dogs=True)))
    at = point(-50, 469.0)
    angle = 0.4 * low.dog.pitch_angle
    time = engage(ClutchPlant(low), at, angle).shift_time
    assert time is not None
    for pitches in (0, 1):
        turned = engage(plant, at, angle + pitches * low.dog.pitch_angle).shift_time
        assert turned == pytest.approx(time, rel=1e-4)


@pytest.mark.parametrize("mismatch", [50, -50])
@pytest.mark.parametrize("name", ["chamfer", "roof"])
def test_low_dogs_of_either_ring_shift_alike(
    clutch: Clutch, point: Point, name: str, mismatch: int
) -> None:
    """Of rings with one dog; the low dogs are rigid on the one, compliant on the other."""
    low = _low(clutch, name)
    on_sliding = replace(low, output_dog=replace(low.output_dog, is_sliding_sparse=True))
    assert low.pair.is_sparse_rigid != on_sliding.pair.is_sparse_rigid
    at = point(mismatch, 469.0)
    times = _times(_shifts(low, at))
    assert np.isfinite(times).any()
    assert _times(_shifts(on_sliding, at)) == pytest.approx(times, rel=2e-3, nan_ok=True)


@pytest.mark.parametrize("mismatch", [50, -50])
def test_low_dogs_of_full_height_are_the_full_ring(
    clutch: Clutch, point: Point, mismatch: int
) -> None:
    low = _low(clutch, "chamfer")
    high = replace(low, output_dog=replace(low.output_dog, low_height=low.dog.height))
    at = point(mismatch, 469.0)
    times = _times(_shifts(high, at))
    assert np.isfinite(times).any()
    assert times == pytest.approx(_times(_shifts(_full(low), at)), rel=1e-7, nan_ok=True)
    case = Limits(output_dog=high.output_dog, load=LoadCase(slots_per_dog=3))
    force = bearing_limits(high.dog, case).load.force_per_dog(high.dog)
    assert force == pytest.approx(LoadCase().force_per_dog(high.dog), rel=1e-12)


@pytest.mark.parametrize("mismatch", [50, -50])
def test_low_dogs_beyond_reach_are_missing(clutch: Clutch, point: Point, mismatch: int) -> None:
    """Between output dogs 0.8 mm higher than the sliding ones, 0.7 mm are beyond reach."""
    dog = replace(clutch.dog, chamfer=3 * DEG)
    output_dog = OutputDog(height=4.5 * MM, slots_per_dog=3, low_height=0.7 * MM)
    low = replace(clutch, dog=dog, output_dog=output_dog)
    at = point(mismatch, 469.0)
    for shift, bare in zip(_shifts(low, at), _shifts(_missing(low), at), strict=True):
        assert shift.shift_time == bare.shift_time
        assert (shift.loads, shift.events) == (bare.loads, bare.events)
    load = LoadCase(slots_per_dog=3, accuracy=6)
    bearing = bearing_limits(dog, Limits(load=load, output_dog=output_dog)).load
    assert bearing.low_shares == (0.0, 0.0)
    assert bearing.force_per_dog(dog) == load.force_per_dog(dog)


@pytest.mark.parametrize("flank", FLANKS)
@pytest.mark.parametrize("name", ["undercut", "compliant output ring"])
def test_pressed_flanks_share_the_torque_by_area(clutch: Clutch, name: str, flank: Flank) -> None:
    """Turned by 2 um into the flanks at full depth, all bear stiffness times depth times area."""
    low = _low(clutch, name)
    low = replace(low, dog=replace(low.dog, backlash=0.8 * MM))
    dog = low.dog
    pair = low.pair
    assert pair.low is not None
    depth = 2e-6
    sense = 1.0 if flank == "traction" else -1.0
    # At full depth dogs stand before slots: half a pitch from dogs facing dogs.
    middle = 0.5 * dog.pitch_angle
    angle = middle + sense * (0.5 * pair.backlash_angle + depth / dog.mean_radius)
    torques = [_loads(c, angle, pair.travel)[1] for c in (_missing(low), low)]
    high_torque = torques[0] / pair.touching_count
    low_torque = (torques[1] - torques[0]) / pair.low_count
    case = Limits(output_dog=low.output_dog, load=LoadCase(slots_per_dog=pair.slots_per_dog))
    share = bearing_limits(dog, case.with_root_radius(2e-5)).load.low_share(flank)
    assert 0.2 < share < 0.9
    assert low_torque / high_torque == pytest.approx(share, abs=0.012)


def test_direct_entries_are_those_of_the_high_dogs(clutch: Clutch) -> None:
    """Flat tips: the closed form, the shifts of the full ring and those with low dogs agree."""
    flat = {"chamfer": 0.0, "traction": 0.0, "braking": 0.0, "backlash": 2.0 * MM}
    dog = replace(clutch.dog, **flat)
    low = replace(clutch, dog=dog, output_dog=OutputDog(slots_per_dog=3, low_height=2.0 * MM))
    at = OperatingPoint(100.0 * RPM, ForceProfile(469.0, 0.18))
    share = direct_share(low, at)
    assert share is not None
    assert share == direct_share(_full(low), at)
    counts = [
        sum(shift.events.face_contacts == 0 for shift in _shifts(ring, at, 48))
        for ring in (low, _full(low))
    ]
    assert counts[0] == counts[1]
    assert counts[0] / 48 == pytest.approx(share, abs=1.5 / 48)


def test_high_dogs_alone_bear_dog_on_dog(clutch: Clutch, point: Point) -> None:
    """A ring held on the high dogs never reaches the low ones."""
    low = replace(
        clutch,
        dog=replace(clutch.dog, chamfer=0.0),
        output_dog=OutputDog(slots_per_dog=3, low_height=2.6 * MM),
    )
    at = point(5, 235.2)
    held = [shift for shift in _shifts(low, at, 6) if shift.shift_time is None]
    bare = [shift for shift in _shifts(_missing(low), at, 6) if shift.shift_time is None]
    assert len(held) == len(bare) > 0
    for shift, bare_shift in zip(held, bare, strict=True):
        assert shift.outcome == bare_shift.outcome
        assert shift.loads.landing_loads == bare_shift.loads.landing_loads


def test_a_stepped_shift_has_the_low_dogs(clutch: Clutch) -> None:
    """The flanks of an engaged ring carry a torque; with low dogs they give way less."""
    low = _low(clutch, "undercut")
    twists = []
    for ring in (_missing(low), low, _full(low)):
        middle = 0.5 * ring.dog.pitch_angle
        shift = SteppedShift(ring.with_engine("planar"), ShiftStart(0.0, 0.0, middle))
        shift.advance(0.2, StepLoads(469.0, 0.0, 0.0))
        assert shift.engaged
        shift.advance(0.6, StepLoads(469.0, 20.0, -20.0))
        twists.append(abs(shift.motion.relative_angle - middle))
    assert twists[0] > twists[1] > twists[2]


def test_checks_share_the_torque_and_judge_the_low_dogs() -> None:
    low = load_study("mq200_paper", [*LOW])
    missing = load_study("mq200_paper", [LOW[0]])
    full = load_study("mq200_paper")
    dog = low.clutch.dog
    case = bearing_limits(dog, low.limits)
    traction, braking = case.load.low_shares
    assert 0.0 < braking < traction < 1.0  # the chamfer takes more of a low flank
    forces = [bearing_limits(dog, s.limits).load.force_per_dog(dog) for s in (full, low, missing)]
    assert forces[0] < forces[1] < forces[2]
    # Of a fixed load sharing: the number of dogs by area.
    fixed = replace(case.load, accuracy=None, pitch_sd=None)
    ratio = fixed.force_per_dog(dog) / replace(fixed, low_shares=(1.0, 1.0)).force_per_dog(dog)
    assert ratio == pytest.approx(15 / (5 + 10 * traction))
    # Force and lever of a low dog are below those of a high one.
    pair = low.clutch.pair
    assert pair.low is not None
    output_case = case.beside(dog)
    for flank in FLANKS:
        high_load = root_load(pair.output, output_case, flank)
        contact = flank_contact(pair.low, case.root_radius, flank, dog)
        low_load = replace(
            high_load,
            force=high_load.force * case.load.low_share(flank),
            lever=contact.level(case.load.load_height),
        )
        high_root = root_of(pair.output, output_case, high_load)
        low_root = root_of(pair.low, output_case, low_load)
        assert np.all(np.array(low_root) < np.array(high_root))
    checks = {check.name: check for check in strength_checks(dog, low.limits)}
    bare_checks = {check.name: check for check in strength_checks(dog, missing.limits)}
    flank_height = checks["flank_height"]
    assert flank_height.ring == "output ring"
    assert flank_height.value < bare_checks["flank_height"].value
    for name in ("flank_pressure_traction", "root_bending_braking", "root_fatigue"):
        assert checks[name].margin > bare_checks[name].margin
    for name in ("chamfer_release", "contact_ratio"):
        assert checks[name].margin == bare_checks[name].margin


def test_checks_of_low_dogs_are_those_of_either_ring() -> None:
    """Of rings with one dog: the same margins, with the name of the other ring."""
    low = load_study("mq200_paper", [*LOW])
    on_sliding = load_study("mq200_paper", [*LOW, "output_dog.sparse_ring=sliding"])
    dog = low.clutch.dog
    exchanged = {RINGS[0]: RINGS[1], RINGS[1]: RINGS[0], "": ""}
    checks = strength_checks(dog, low.limits)
    sliding_checks = strength_checks(dog, on_sliding.limits)
    assert any(check.ring for check in checks)
    for check, sliding_check in zip(checks, sliding_checks, strict=True):
        assert sliding_check.margin == pytest.approx(check.margin, rel=1e-12)
        assert sliding_check.ring == exchanged[check.ring]
    losses, sliding_losses = (margin_losses(dog, s.limits) for s in (low, on_sliding))
    for name, spread in losses.items():
        assert sliding_losses[name].worst_case == pytest.approx(spread.worst_case, rel=1e-9)


def test_checks_of_many_dogs_are_those_of_each() -> None:
    """As a search has them: heights and chamfers beside low dogs of one height."""
    study = load_study("mq200_paper", [*LOW, "load.accuracy=6"])
    sizes = np.array([[2.8, 6.0], [3.4, 8.0], [4.2, 10.0]])
    dogs = DesignGroup.of(study, ["height_mm", "chamfer_deg"], sizes).dogs
    checks = {check.name: check.margin for check in strength_checks(dogs, study.limits)}
    losses = margin_losses(dogs, study.limits)
    for row, (height, chamfer) in enumerate(sizes):
        dog = replace(study.clutch.dog, height=height * MM, chamfer=chamfer * DEG)
        for check in strength_checks(dog, study.limits):
            margin = np.broadcast_to(checks[check.name], len(sizes))[row]
            assert margin == pytest.approx(check.margin, rel=1e-9, abs=1e-12), check.name
        for name, spread in margin_losses(dog, study.limits).items():
            loss = np.broadcast_to(losses[name].worst_case, len(sizes))[row]
            assert loss == pytest.approx(spread.worst_case, rel=1e-9, abs=1e-12), name


def test_impossible_low_dogs_are_refused() -> None:
    with pytest.raises(InputError, match=r"low_height_mm is 2 mm.* give output_dog.slots_per_dog"):
        load_study("mq200_paper", ["output_dog.low_height_mm=2.0"])
    with pytest.raises(GeometryError, match=r"low_height_mm is 3.9 mm.* have 3.7 mm"):
        load_study("mq200_paper", [LOW[0], "output_dog.low_height_mm=3.9"])
    with pytest.raises(GeometryError, match="low dogs of the output ring: height of the braking"):
        load_study("mq200_paper", [LOW[0], "output_dog.low_height_mm=0.8"])
    on_sliding = [LOW[0], "output_dog.sparse_ring=sliding", "output_dog.low_height_mm=0.8"]
    with pytest.raises(GeometryError, match="low dogs of the sliding ring: height of the braking"):
        load_study("mq200_paper", on_sliding)
    with pytest.raises(InputError, match="sparse_ring is 'sliding', but without"):
        load_study("mq200_paper", ["output_dog.sparse_ring=sliding"])
    with pytest.raises(InputError, match=r"must lie between 0\.2 and 100 mm"):
        load_study("mq200_paper", [LOW[0], "output_dog.low_height_mm=0.1"])
    # A search skips dogs that are lower than the low ones.
    study = load_study("mq200_paper", [*LOW])
    dogs = DesignGroup.of(study, ["height_mm"], np.array([[2.5], [2.6], [3.7]])).dogs
    assert pair_with(study, dogs).possible.tolist() == [False, True, True]


@pytest.mark.parametrize("ring", ["output", "sliding"])
def test_drawings_have_the_low_dogs(dogshape: Call, ring: str) -> None:
    overrides = [*LOW, f"output_dog.sparse_ring={ring}"]
    study = load_study("mq200_paper", overrides)
    pair = study.clutch.pair
    assert pair.low is not None
    sparse, full = pair.output_dogs, pair.sliding_dogs
    if ring == "sliding":
        sparse, full = full, sparse
    assert full == RingDogs(full.dog)
    points = len(outline(full, 1))
    profile = np.array(outline(sparse, 7))
    crests = profile.reshape(7, points, 2)[:, :, 1].max(axis=1)
    low_crest = (sparse.dog.addendum - pair.shortening) / MM
    assert crests == pytest.approx([1.85, low_crest, low_crest] * 2 + [1.85])
    assert open_section_svg(pair, pair) != open_section_svg(replace(pair, low=None), pair)
    (outlines,) = ring_outlines(sparse, study.limits, 3e-3)
    (full_outlines,) = ring_outlines(full, study.limits, 3e-3)
    assert len(outlines) == len(full_outlines)
    options = [word for override in overrides for word in ("--set", override)]
    said = dogshape("export", "mq200_paper", *options, "--stl", "a.stl", "--ring", ring)
    other_ring = {"output": "sliding", "sliding": "output"}[ring]
    assert f"write the {other_ring} ring as a surface" in said.sentence
    said = dogshape("export", "mq200_paper", *options, "--stl", "a.stl", "--ring", other_ring)
    assert said.status == 0, said.err
    said = dogshape("export", "mq200_paper", *options, "--dxf", "a.dxf", "--svg", "a.svg")
    assert said.status == 0, said.err
    text = f"on the {ring} ring 5 of these, at every pitch number 3, have full height, the others"
    assert text in " ".join(Path("a.svg").read_text("utf-8").split())
    assert "2.60" in Path("a.dxf").read_text("utf-8")
    page = Path("a.html")
    point = ("--mismatch-rpm", "50", "--force-N", "469", "--angle-deg", "10")
    said = dogshape(
        "shift", "mq200_paper", *options, *point, "--engine", "planar", "--report", page
    )
    assert said.status == 0, said.err
    text = page.read_text("utf-8")
    assert text.count('"low":{"profile"') == 1
    assert text.index(f'"{ring}":{{"root"') < text.index('"low":{"profile"')
    if ring == "sliding":
        assert text.index('"low":{"profile"') < text.index('"output":{"root"')


def test_a_study_with_low_dogs_is_checked(dogshape: Call) -> None:
    options = [word for override in LOW for word in ("--set", override)]
    said = dogshape("check", "mq200_paper", *options, "--json")
    assert said.json["expected_shift_time_s"] > 0.0
    full = dogshape("check", "mq200_paper", "--json")
    assert full.json["expected_shift_time_s"] != said.json["expected_shift_time_s"]
