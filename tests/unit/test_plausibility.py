"""Slips that no rule of a file forbids: units in doubt, dogs that cannot engage, missing scope."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from dogshape.pipeline.config.study_file import load_study
from dogshape.pipeline.simulate.plausibility import folded, slips_of
from dogshape.sim.errors import InputError
from tests.conftest import Said

Call = Callable[..., Said]
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
        (("load.torque_Nm=0.2",), "is load.torque_Nm in N m?"),
        (("dog.traction_deg=0", "dog.braking_deg=0"), "flanks leave 0 mm"),
        (("dog.traction_deg=0.1", "dog.braking_deg=0"), "the model alone, not when made"),
    ],
)
def test_units_in_doubt_and_flanks_without_play_are_said(
    values: tuple[str, ...], words: str
) -> None:
    assert any(words in note for note in slips_of(load_study("mq200", values)))


@pytest.mark.parametrize(
    "values",
    [
        ("dog.chamfer_deg=1.5",),
        (  # a truck
            "dog.outer_diameter_mm=140", "dog.inner_diameter_mm=124", "dog.height_mm=6",
            "sliding.mass_kg=2.5", "sliding.inertia_kgm2=0.1", "output.inertia_kgm2=1100",
            "load.torque_Nm=1500",
        ),
        (  # a motorcycle
            "dog.outer_diameter_mm=62", "dog.count=6", "dog.height_mm=6", "sliding.mass_kg=0.25",
            "sliding.inertia_kgm2=0.002", "output.inertia_kgm2=0.05",
        ),
    ],
)  # fmt: skip
def test_usual_clutches_are_no_question(values: tuple[str, ...]) -> None:
    assert slips_of(load_study("mq200", values)) == []


def test_angles_beyond_a_pitch_and_doubled_keys_are_said(dogshape: Call) -> None:
    dog = load_study("mq200_paper").clutch.dog
    assert folded(dog, [0.0, 12.0, -24.0]) == []
    assert "-30 deg is taken modulo the pitch of 24 deg: 18 deg" in folded(dog, [-30.0])[0]
    said = dogshape("shift", "mq200_paper", *POINT, "--relative-angle-deg", "1000")
    assert "1000 deg is taken modulo the pitch of 24 deg: 16 deg" in said.err
    said = dogshape("expect", "mq200_paper", *POINT, "--angles", "3,400")
    assert "400 deg is taken modulo" in said.err
    twice = ("--set", "dog.count=20", "--set", "dog.count=18")
    said = dogshape("strength", "mq200_paper", "--no-simulation", *twice)
    assert "--set gives dog.count more than once; the last one counts, dog.count=18" in said.err


@pytest.mark.parametrize(
    ("force", "words"),
    [
        ("0", "shift force is 0 N, but it must point into engagement"),
        ("4690", "cover 235.2 to 641.5 N"),
    ],
)
def test_forces_without_a_rise_time(dogshape: Call, force: str, words: str) -> None:
    point = ("--mismatch-rpm", "50", "--force-N", force, "--relative-angle-deg", "3")
    said = dogshape("shift", "mq200_paper", *point)
    assert said.status == 2
    assert words in said.sentence
