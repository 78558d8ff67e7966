"""An output ring with missing dogs: N/s dogs against N slots, in both engines and the checks."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import dogshape as ds
from dogshape.pipeline.config.study_file import load_study
from dogshape.pipeline.export.cad import write_step
from dogshape.pipeline.export.drawing import open_section_svg, outline
from dogshape.pipeline.export.dxf import ring_outlines
from dogshape.pipeline.simulate.design import DesignGroup, pair_with
from dogshape.sim.errors import GeometryError
from dogshape.sim.shift.clutch import Clutch, OperatingPoint
from dogshape.sim.shift.conclusion import engage
from dogshape.sim.shift.pair import OutputDog, RingDogs
from dogshape.sim.shift.planar import PlanarClutch
from dogshape.sim.shift.plant import ClutchPlant
from dogshape.sim.units import DEG, MM
from tests.conftest import Call, Point

THIRD = "output_dog.slots_per_dog=3"
#: Changes of the prototype's dog, and the dimensions of the output dog.
SHAPES: dict[str, tuple[dict[str, float], OutputDog]] = {
    "chamfer": ({}, OutputDog()),
    "roof": ({"crest": 0.5, "chamfer": 12 * DEG, "chamfer_back": 9 * DEG}, OutputDog()),
    "undercut": (
        {"traction": -3 * DEG, "braking": -3 * DEG, "chamfer": 6 * DEG, "backlash": 0.8 * MM},
        OutputDog(),
    ),
    "unlike": ({}, OutputDog(height=3.0 * MM, chamfer=11 * DEG)),
}


def _missing(clutch: Clutch, name: str) -> Clutch:
    change, output_dog = SHAPES[name]
    dog = replace(clutch.dog, **change)
    return replace(clutch, dog=dog, output_dog=replace(output_dog, slots_per_dog=3))


def _times(plant: ClutchPlant | PlanarClutch, clutch: Clutch, at: OperatingPoint) -> np.ndarray:
    """Shift times at four relative angles, s; NaN for a shift that does not engage."""
    angles = [(k + 0.5) / 4 * clutch.dog.pitch_angle for k in range(4)]
    return np.array([engage(plant, at, angle).shift_time or np.nan for angle in angles])


@pytest.mark.parametrize("mismatch", [50, -50])
@pytest.mark.parametrize("name", SHAPES)
def test_missing_dogs_are_a_softer_full_pair(
    clutch: Clutch, point: Point, name: str, mismatch: int
) -> None:
    """N/s dogs of a stiffness k have the forces of N dogs of k/s, at every relative angle."""
    missing = _missing(clutch, name).with_engine("planar").refined()
    contact = replace(missing.contact, stiffness=missing.contact.stiffness / 3.0)
    output_dog = replace(missing.output_dog, slots_per_dog=None)
    softer = replace(missing, contact=contact, output_dog=output_dog)
    at = point(mismatch, 469.0)
    times = _times(PlanarClutch(missing), missing, at)
    assert np.isfinite(times).any()
    assert times == pytest.approx(_times(PlanarClutch(softer), softer, at), rel=1e-4, nan_ok=True)


@pytest.mark.parametrize("mismatch", [50, -50])
@pytest.mark.parametrize("name", SHAPES)
def test_mean_times_follow_drake(clutch: Clutch, point: Point, name: str, mismatch: int) -> None:
    """Means over four angles within 0.1 %."""
    missing = _missing(clutch, name).refined()
    at = point(mismatch, 469.0)
    drake_times = _times(ClutchPlant(missing), missing, at)
    compiled_times = _times(PlanarClutch(missing.with_engine("planar")), missing, at)
    assert np.isnan(drake_times).tolist() == np.isnan(compiled_times).tolist()
    assert np.nanmean(compiled_times) == pytest.approx(np.nanmean(drake_times), rel=1e-3)


@pytest.mark.parametrize("mismatch", [50, -50])
@pytest.mark.parametrize("name", SHAPES)
def test_dogs_missing_on_either_ring_shift_alike(
    clutch: Clutch, point: Point, name: str, mismatch: int
) -> None:
    """In the compiled engine to the last digit; of one sliding dog Drake has one plant for both."""
    missing = _missing(clutch, name).with_engine("planar")
    on_sliding = replace(missing, output_dog=replace(missing.output_dog, is_sliding_sparse=True))
    assert on_sliding.pair.sliding_dogs.pitches == missing.pair.output_dogs.pitches == 3
    at = point(mismatch, 469.0)
    times = _times(PlanarClutch(missing), missing, at)
    assert np.isfinite(times).any()
    sliding_times = _times(PlanarClutch(on_sliding), on_sliding, at)
    assert np.array_equal(sliding_times, times, equal_nan=True)


@pytest.mark.parametrize("is_sliding_sparse", [False, True])
def test_a_dog_with_its_share_stands_for_the_ring(
    clutch: Clutch, point: Point, *, is_sliding_sparse: bool
) -> None:
    """Drake with every dog of both rings: fifteen, and five that are there."""
    missing = _missing(clutch, "chamfer").refined()
    output_dog = replace(missing.output_dog, is_sliding_sparse=is_sliding_sparse)
    missing = replace(missing, output_dog=output_dog)
    every_dog = replace(missing, solver=replace(missing.solver, all_dogs=True))
    at = point(50, 469.0)
    plant = ClutchPlant(every_dog)
    angle = 0.4 * missing.dog.pitch_angle
    times = [engage(model, at, angle).shift_time for model in (plant, ClutchPlant(missing))]
    assert times[0] == pytest.approx(times[1], rel=1e-4)
    # Turned by one pitch the dogs stand before the next slots.
    turned = engage(plant, at, angle + missing.dog.pitch_angle).shift_time
    assert turned == pytest.approx(times[0], rel=1e-4)


def test_fewer_dogs_bear_the_torque() -> None:
    full = load_study("mq200_paper")
    missing = load_study("mq200_paper", [THIRD])
    dog = full.clutch.dog
    # Of a fixed load sharing: three times the load on a dog.
    loads = [replace(s.limits.load, accuracy=None, pitch_sd=None) for s in (full, missing)]
    assert loads[1].force_per_dog(dog) == pytest.approx(3.0 * loads[0].force_per_dog(dog))
    assert (missing.clutch.pair.touching_count, loads[1].touching(dog)) == (5, 5)
    # Shares of dogs by number and accuracy are those of five.
    graded = replace(missing.limits.load, accuracy=6)
    five = replace(full.limits.load, accuracy=6)
    torque = graded.design_torque
    assert graded.sharing(dog, torque) > five.sharing(dog, torque)


def test_uneven_dogs_are_refused() -> None:
    with pytest.raises(GeometryError, match=r"slots_per_dog is 2, but .* the 15 of dog.count"):
        load_study("mq200_paper", ["output_dog.slots_per_dog=2"])
    with pytest.raises(GeometryError, match="two at least"):
        load_study("mq200_paper", ["output_dog.slots_per_dog=15"])
    # A search skips numbers of dogs that are no multiple.
    study = load_study("mq200_paper", [THIRD])
    dogs = DesignGroup.of(study, ["count"], np.array([[12.0], [14.0], [15.0], [3.0]])).dogs
    assert pair_with(study, dogs).possible.tolist() == [True, False, True, False]


def test_drawings_lack_the_dogs_and_solids_are_refused(dogshape: Call, tmp_path: Path) -> None:
    study = load_study("mq200_paper", [THIRD])
    pair = study.clutch.pair
    points = len(outline(RingDogs(pair.output), 1))
    assert len(outline(pair.output_dogs, 7)) == 3 * points
    assert len(outline(RingDogs(pair.output), 7)) == 7 * points
    assert open_section_svg(pair, pair) != open_section_svg(replace(pair, slots_per_dog=1), pair)
    (full,) = ring_outlines(RingDogs(pair.output), study.limits, 3e-3)
    (lacking,) = ring_outlines(pair.output_dogs, study.limits, 3e-3)
    assert len(full) - len(lacking) == 10 * 2 * points  # two ends of each arc
    with pytest.raises(ds.InputError, match="slots_per_dog is 3, but solids"):
        write_step(pair, 3e-4, 3e-3, tmp_path / "a.step")
    said = dogshape("export", "mq200_paper", "--set", THIRD, "--stl", "a.stl", "--ring", "output")
    assert "write the sliding ring as a surface" in said.sentence
    said = dogshape("export", "mq200_paper", "--set", THIRD, "--stl", "a.stl", "--svg", "a.svg")
    assert said.status == 0, said.err
    text = Path("a.svg").read_text("utf-8")
    assert "of these the output ring has 5, at every pitch number 3" in text
