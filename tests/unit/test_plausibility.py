"""Doubts that are said: units, dogs that cannot engage, shifts not converged or out of range."""

from __future__ import annotations

from typing import Any

import pytest

import dogshape as ds
from dogshape.pipeline.config.study_file import load_study
from dogshape.pipeline.simulate.plausibility import (
    angle_notes,
    drag_notes,
    notes_of,
    slide_notes,
    slips_of,
)
from dogshape.sim.errors import InputError
from dogshape.sim.statistics.blocks import engage
from tests.conftest import Call, set_options

POINT = ("--engine", "planar", "--mismatch-rpm", "50", "--force-N", "469")


@pytest.mark.parametrize(
    "value",
    [
        "dog.traction_deg=-15", "variables.traction_deg=[-13, 20]", "dog.undercut_deg=3",
        "output.count=20",
    ],
)  # fmt: skip
def test_what_the_model_lacks_is_refused_with_what_it_has(value: str) -> None:
    with pytest.raises(InputError) as refused:
        load_study("mq200", [value])
    said = str(refused.value)
    for words in (value.partition("=")[0], "undercut", "dog.backlash_mm", "both rings"):
        assert words in said
    assert "did you mean" not in said
    assert "in degrees" not in said


@pytest.mark.parametrize(
    ("values", "words"),
    [
        (("dog.chamfer_deg=0.14",), "0.14 rad are 8.02 deg"),
        (("dog.traction_deg=0.21",), "dog.traction_deg is 0.21 deg; is it in degrees?"),
        (("dog.traction_deg=-0.087", "dog.backlash_mm=0.3"), "-0.087 rad are -4.98 deg"),
        (("dog.crest=0.5", "dog.chamfer_back_deg=0.2"), "dog.chamfer_back_deg is 0.2 deg"),
        (("output.inertia_kgm2=6048",), "output.inertia_kgm2 is 6048"),
        (("sliding.mass_kg=0.003",), "is it in kg?"),
        (("mechanism.spline_radius_mm=35.2",), "outside the dogs, whose outer radius is 26 mm"),
        (("sliding.inertia_kgm2=0.00005", "strike="), "17.6 mm has at least 9.29e-05"),
        (("load.shifts=5",), "load.shifts is 5 over the life"),
        (("load.torque_Nm=0.2",), "is load.torque_Nm in N m?"),
        (("dog.traction_deg=0", "dog.braking_deg=0"), "flanks leave 0 mm"),
        (("dog.traction_deg=0.1", "dog.braking_deg=0"), "the model alone, not when made"),
    ],
)
def test_odd_units_and_flanks_without_play_are_said(values: tuple[str, ...], words: str) -> None:
    assert any(words in note for note in slips_of(load_study("mq200", values)))


@pytest.mark.parametrize(
    "values",
    [
        ("dog.chamfer_deg=1.5",),
        (  # a truck
            "dog.outer_diameter_mm=140", "dog.inner_diameter_mm=124", "dog.height_mm=6",
            "sliding.mass_kg=2.5", "sliding.inertia_kgm2=0.1", "output.inertia_kgm2=1100",
            "load.torque_Nm=1500", "mechanism.ring_inertia_kgm2=0.005", "strike=",
        ),
        (  # a motorcycle
            "dog.outer_diameter_mm=62", "dog.count=6", "dog.height_mm=6", "sliding.mass_kg=0.25",
            "sliding.inertia_kgm2=0.002", "output.inertia_kgm2=0.05", "load.shifts=1000",
        ),
    ],
)  # fmt: skip
def test_usual_clutches_are_no_question(values: tuple[str, ...]) -> None:
    assert slips_of(load_study("mq200", values)) == []


def test_angles_beyond_a_pitch_and_doubled_keys_are_said(dogshape: Call) -> None:
    dog = load_study("mq200_paper").clutch.dog
    assert angle_notes(dog, [0.0, 12.0, -24.0]) == []
    assert "-30 deg is taken modulo the pitch of 24 deg: 18 deg" in angle_notes(dog, [-30.0])[0]
    said = dogshape("shift", "mq200_paper", *POINT, "--angle-deg", "1000")
    assert "1000 deg is taken modulo the pitch of 24 deg: 16 deg" in said.err
    twice = ("--set", "dog.count=20", "--set", "dog.count=18")
    said = dogshape("strength", "mq200_paper", "--no-simulate", *twice)
    assert "--set gives dog.count more than once; the last one counts, dog.count=18" in said.err


COMPILED = {"solver.engine": "planar"}
PLAY = {
    **COMPILED,
    "mechanism.ring_inertia_kgm2": 0.002,
    "mechanism.input_stiffness_Nm_rad": 5000,
    "mechanism.spline_backlash_deg": 0.3,
}
TWO_SHAFTS = {
    **PLAY, "mechanism.wheel_inertia_kgm2": 0.05, "mechanism.output_stiffness_Nm_rad": 3000
}  # fmt: skip


@pytest.mark.parametrize(
    ("settings", "speed", "angle"),
    [(PLAY, -249.0, 1.0), (TWO_SHAFTS, -249.0, 7.0), (COMPILED, -900.0, 7.0)],
    ids=["play", "two shafts", "fast"],
)
def test_a_shift_says_whether_finer_steps_move_it(
    settings: dict[str, Any], speed: float, angle: float
) -> None:
    study = ds.Study("mq200_paper", settings)
    found = study.shift(mismatch_rpm=speed, force_N=469, angle_deg=angle)
    assert found.engagement.events.slots_skipped + found.engagement.events.face_contacts > 1
    assert found.to_dict()["solver"]["converged"] is found.converged
    moved = abs((found.refined.shift_time or 1.0) / (found.time_s or 1.0) - 1.0)
    assert found.converged is (moved <= 0.01)
    assert any("not converged: engaged in" in one for one in found.warnings) is not found.converged
    assert any("(study.expect())" in one for one in found.warnings) is not found.converged


@pytest.mark.parametrize(
    ("speed", "force", "words"),
    [
        (1000.0, 3000.0, []),
        (-1500.0, 4000.0, ["mismatch of 1500", "shift force of 4000 N is beyond 3000 N"]),
    ],
)
def test_a_shift_beyond_the_range_says_so(speed: float, force: float, words: list[str]) -> None:
    study = ds.Study("mq200_paper", COMPILED)
    found = study.shift(mismatch_rpm=speed, force_N=force, angle_deg=10, force_rise_s=0.05)
    said = [one for one in found.to_dict()["warnings"] if "beyond" in one]
    assert all(word in one for one, word in zip(said, words, strict=True))


@pytest.mark.parametrize(
    ("settings", "engine", "accuracy"),
    [
        ({}, "drake", 1e-7),
        ({"contact.set": "adams_impact"}, "planar", 1e-4),
        ({"mechanism.compliance_mm_kN": 0.3}, "planar", 1e-4),
        ({"mechanism.compliance_mm_kN": 0.3, "solver.engine": "drake"}, "drake", 1e-9),
        ({"mechanism.compliance_mm_kN": 0.3, "solver.accuracy": 1e-8}, "planar", 1e-8),
    ],
)
def test_forces_of_a_mechanism_with_two_coefficients_and_impact_are_the_compiled_engines(
    settings: dict[str, Any], engine: str, accuracy: float
) -> None:
    solver = ds.Study("mq200_paper", {"contact.set": "adams2019", **settings}).config.clutch.solver
    assert (solver.engine, solver.accuracy) == (engine, accuracy)


def test_a_drag_on_a_ring_that_stands_is_said() -> None:
    """It holds the ring there; shafts that turn, or no drag, leave nothing to say."""
    turning, standing = "drive.shaft_speed_rpm=2000", "drive.shaft_speed_rpm=0"
    (note,) = drag_notes(load_study("mq200", [standing]))
    assert "mechanism.drag_torque_Nm is 0.1 N m and the sliding ring stands" in note
    assert drag_notes(load_study("mq200", [turning])) == []
    assert drag_notes(load_study("mq200_paper")) == []


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ((), "shafts stand: sliding ring at rest, output ring at the mismatch"),
        (
            ("drive.shaft_speed_rpm=2000",),
            "turn at 2000 1/min on the wheels' side, engine at the s",
        ),
        (
            ("drive.shaft_speed_rpm=900", "drive.engine_side=output", "drive.output_torque_Nm=-50"),
            "turn at 900 1/min on the wheels' side, engine at the output ring, torque over time",
        ),
    ],
)
def test_the_speed_of_the_shafts_is_said(
    dogshape: Call, settings: tuple[str, ...], words: str
) -> None:
    given = set_options(settings)
    said = dogshape("shift", "mq200_paper", *POINT, "--angle-deg", "3", *given)
    assert words in said.out
    found = dogshape("expect", "mq200_paper", "--angles", "3", *POINT[2:], *given, "--json")
    assert words.removeprefix("shafts ") in found.json["shafts"]


def test_a_common_speed_is_said_to_change_no_time() -> None:
    """Only a wet pack, whose other side turns at a speed of its own, drags by the speed."""
    words = "another speed changes no time"
    pack = "drive.pack_viscous_Nms_rad=0.05"
    assert words in load_study("motorcycle").shafts_text
    assert words not in load_study("motorcycle", [pack]).shafts_text
    assert words not in load_study("mq200_paper").shafts_text
    times: dict[str, list[float | None]] = {}
    for rpm in (1000, 6000):
        for key in ("", pack):
            keys = [f"drive.shaft_speed_rpm={rpm}", *filter(None, [key])]
            study = load_study("motorcycle", keys).search_setup
            times.setdefault(key, []).append(engage(study.clutch, study.points[0], 0.1).shift_time)
    assert times[""][0] == pytest.approx(times[""][1], rel=1e-3)
    assert times[pack][0] != pytest.approx(times[pack][1], rel=1e-2)


#: Pointed teeth of a light sleeve in place of the prototype's dogs.
SLEEVE = (
    "dog.count=27", "dog.chamfer_deg=34", "dog.chamfer_back_deg=34", "dog.crest=0.5",
    "dog.traction_deg=0", "dog.braking_deg=0", "dog.height_mm=4", "dog.backlash_mm=0.2",
    "dog.outer_diameter_mm=57", "dog.inner_diameter_mm=55", "sliding.mass_kg=0.05",
    "sliding.inertia_kgm2=0.000351", "output.inertia_kgm2=20", "strike=",
)  # fmt: skip


def test_a_slide_that_loses_power_is_said_with_the_stiffness_that_bounds_it() -> None:
    """By the mean of a drawn dissipation, and on the stiffness of the remedy no more."""
    (note,) = slide_notes(load_study("mq200_both", SLEEVE))
    assert "faces of 34 deg that slide under 641.5 N lose about 8.6 %" in note
    assert note in notes_of(load_study("mq200_both", SLEEVE))
    (certain,) = slide_notes(load_study("mq200_both", [*SLEEVE, "uncertain.dissipation_factor="]))
    assert "14 %" in certain
    assert "20 s/m" in certain
    stiffness = note.split("contact.stiffness_Pa_m = ")[1].split()[0]
    remedy = f"contact.stiffness_Pa_m={stiffness}"
    assert slide_notes(load_study("mq200_both", [*SLEEVE, remedy])) == []


def test_a_slide_that_no_stiffness_bounds_has_a_dissipation_as_remedy() -> None:
    values = ("uncertain.dissipation_factor=", "contact.dissipation_s_m=9000")
    (note,) = slide_notes(load_study("mq200_both", [*SLEEVE, *values]))
    assert "a contact.dissipation_s_m of" in note


@pytest.mark.parametrize("study", ["mq200", "mq200_both", "motorcycle", "amt", "ev_disconnect"])
def test_slides_of_bundled_clutches_lose_little(study: str) -> None:
    assert slide_notes(load_study(study)) == []


def test_faces_that_friction_holds_have_no_slide_of_their_own() -> None:
    assert slide_notes(load_study("mq200_paper", ["contact.set=adams2019"])) == []
