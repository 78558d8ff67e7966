"""Retention under torque: equilibrium without friction, and reports of dogs that jump out."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from dogshape.pipeline.config.study_file import Setup, load_study
from dogshape.pipeline.simulate.design import OBJECTIVES, design_of
from dogshape.sim.errors import InputError
from dogshape.sim.shift.geometry import FLANKS, Dog
from dogshape.sim.strength.load_case import LoadCase
from dogshape.sim.strength.locking import retention, retention_force, separating_force, worn_angle
from dogshape.sim.units import DEG
from tests.conftest import named_checks

#: Found by hand, and the one that an earlier search chose: traction, braking, height, count, play.
UNDERCUT = {"traction_deg": -2.603, "braking_deg": -4.299, "height_mm": 3.934, "count": 7,
            "backlash_mm": 12.0}  # fmt: skip
PUSHING = {"traction_deg": 8.8, "braking_deg": 9.8, "height_mm": 5.9, "count": 7,
           "backlash_mm": 7.9}  # fmt: skip
DETENT = 60.0  #: N, of a ball detent


@pytest.fixture(scope="module")
def motorcycle() -> Setup:
    """Read the study of undercut dogs."""
    return load_study("motorcycle")


def _straight(dog: Dog, angle: float) -> Dog:
    """Give both flanks a side angle in deg, with the play that an undercut needs."""
    return replace(dog, traction=angle * DEG, braking=angle * DEG)


@pytest.mark.parametrize("friction", [0.0, 0.05, 0.12])
@pytest.mark.parametrize("angle", [-4.0, 1.0, 12.0])
def test_the_axial_force_is_the_balance_of_normal_and_friction(
    motorcycle: Setup, angle: float, friction: float
) -> None:
    """Normal n and friction mu n of a flank carry the torque and push along the shaft."""
    dog, load = _straight(motorcycle.clutch.dog, angle), replace(motorcycle.limits.load)
    load = replace(load, wear_angle=0.0, vibration_force=0.0)
    at = math.radians(angle)
    normal = load.design_torque / dog.mean_radius / (math.cos(at) + friction * math.sin(at))
    by_hand = normal * (math.sin(at) - friction * math.cos(at))
    assert separating_force(dog, load, "traction", friction) == pytest.approx(by_hand, rel=1e-12)


def test_wear_leans_a_straight_flank_and_leaves_a_leaning_one(motorcycle: Setup) -> None:
    """Monotonic and continuous over the side angle; a wear of 0 leaves every flank."""
    dog, load = motorcycle.clutch.dog, LoadCase()
    angles = np.linspace(-6.0, 6.0, 241)
    worn = [worn_angle(_straight(dog, a), load, "traction") / DEG for a in angles.tolist()]
    assert worn == pytest.approx(np.maximum(angles, np.minimum(angles, 0.0) + 1.0).tolist())
    assert np.all(np.diff(worn) >= -1e-12)
    new = replace(load, wear_angle=0.0)
    assert worn_angle(dog, new, "braking") == dog.braking


@pytest.mark.parametrize(
    ("angle", "holds", "answer"),
    [
        (0.0, False, "friction alone"),  # straight, and +1 degree once worn: reported to jump out
        (1.0, False, "friction alone"),
        (-1.5, True, "undercut"),  # reported cure: 1.5 degrees, race gearboxes 2 to 3, up to 5
        (-2.5, True, "undercut"),
        (-5.0, True, "undercut"),
        (8.0, False, "nothing: it jumps out"),
    ],
)
def test_straight_dogs_jump_out_and_undercut_cures_it(
    motorcycle: Setup, angle: float, holds: bool, answer: str
) -> None:
    """Field reports of motorcycle gearboxes, with a ball detent and the least friction."""
    dog = _straight(motorcycle.clutch.dog, angle)
    load = replace(motorcycle.limits.load, separating_force_limit=DETENT, vibration_force=0.0)
    check = named_checks(dog, load)["retention_traction"]
    assert check.passed is holds
    found = retention(dog, load, "traction")
    assert found.answer == answer
    if answer == "friction alone":
        assert check.margin <= 0.0
        assert found.all_friction < 0.0 < found.frictionless
        push = load.design_torque / dog.mean_radius * math.tan(1.0 * DEG)
        assert check.value == pytest.approx(push)
        latched = replace(load, separating_force_limit=1.01 * push)
        assert named_checks(dog, latched)["retention_traction"].passed
        assert retention(dog, latched, "traction").answer == "blocking mechanism"


def test_a_design_of_undercut_holds_and_one_that_pushes_fails(motorcycle: Setup) -> None:
    """New and with all friction the first pulls in with 1064 N; the other pushes with 178 N."""
    found = {name: design_of(motorcycle, p) for name, p in (("in", UNDERCUT), ("out", PUSHING))}
    assert not [n for n in found["in"].failed if n.startswith("retention")]
    assert {f"retention_{flank}" for flank in FLANKS} <= set(found["out"].failed)
    new = replace(motorcycle.limits.load, wear_angle=0.0, vibration_force=0.0)
    forces = {name: retention(one.dog, new, "traction") for name, one in found.items() if one.dog}
    assert forces["in"].all_friction == pytest.approx(-1064, abs=1)
    assert forces["in"].frictionless == pytest.approx(-283, abs=1)
    assert forces["out"].all_friction == pytest.approx(179, abs=1)
    assert forces["out"].flank_friction == pytest.approx(647, abs=1)
    force = OBJECTIVES["retention_force_N"].exact
    assert force is not None
    values = {n: force(one, one.dog) for n, one in found.items() if one.dog}
    assert values["in"] > 0.0 > values["out"]


def test_retention_is_that_of_the_weaker_flank_less_vibration(motorcycle: Setup) -> None:
    dog = replace(motorcycle.clutch.dog, traction=-5.0 * DEG, braking=-2.0 * DEG)
    load = replace(motorcycle.limits.load, coast_share=0.5, vibration_force=25.0)
    pulls = {
        "traction": load.design_torque / dog.mean_radius * math.tan(4.0 * DEG),
        "braking": 0.5 * load.design_torque / dog.mean_radius * math.tan(1.0 * DEG),
    }
    assert retention_force(dog, load) == pytest.approx(min(pulls.values()) - 25.0)


def test_as_the_torque_reverses_nothing_but_the_mechanism_holds(motorcycle: Setup) -> None:
    dog, load = motorcycle.clutch.dog, replace(motorcycle.limits.load, vibration_force=80.0)
    for held, passed in ((60.0, False), (100.0, True)):
        check = named_checks(dog, replace(load, separating_force_limit=held))["retention_reversal"]
        assert (check.value, check.passed) == (80.0, passed)
    still = replace(load, vibration_force=0.0)
    assert "retention_reversal" not in named_checks(dog, still)


def test_one_interval_of_friction_releases_at_its_upper_and_holds_at_its_lower_end() -> None:
    load = load_study("mq200").limits.load
    assert load.spline_friction == 0.10
    assert load.spline_interval == (load.friction_hold, load.friction_release) == (0.05, 0.12)
    rolling = load_study("mq200", ["mechanism.spline_friction=0.02"]).limits.load
    assert rolling.spline_interval == (0.02, 0.12)
    dry = load_study("mq200", ["mechanism.spline_friction=0.3"]).limits.load
    assert dry.spline_interval == (0.05, 0.3)
    own = ["load.spline_friction_hold=0.01", "load.spline_friction_release=0.03"]
    found = load_study("mq200", ["mechanism.spline_friction=0.02", *own]).limits.load
    assert found.spline_interval == (0.01, 0.03)
    assert load_study("mq200_paper").limits.load.spline_interval == (0.0, 0.0)


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        (["load.spline_friction_release=0.05"], "it must be at least mechanism.spline_friction"),
        (["load.spline_friction_hold=0.11"], "it must be at most mechanism.spline_friction = 0.1"),
        (
            ["mechanism=", "load.spline_friction_hold=0.1"],
            "load.spline_friction_hold belongs to mechanism.spline_friction",
        ),
    ],
)
def test_an_interval_without_the_simulated_friction_is_refused(
    settings: list[str], words: str
) -> None:
    with pytest.raises(InputError, match=words):
        load_study("mq200", settings)
