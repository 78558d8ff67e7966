"""Headline and summary of a diagnosis, and numbers with their units."""

from __future__ import annotations

from dataclasses import replace

import pytest

from dogshape.diagnosis.bench.stand_file import Sensor
from dogshape.diagnosis.report.wording import (
    between,
    chance,
    described,
    headline,
    summary,
)
from dogshape.diagnosis.terms import NONE, UNKNOWN
from tests.diagnosed import (
    DAMPED,
    EFFECTS,
    HEAVY,
    STAND,
    Interval,
    diagnosed,
    diagnosis_of,
    reading,
)


def test_numbers_have_their_units() -> None:
    assert [chance(p) for p in (0.001, 0.5, 0.985, 0.999)] == ["< 1 %", "50 %", "98 %", "> 99 %"]
    assert described("friction_N", Interval(30.0, 20.0, 41.0)) == "friction 30 N (20 to 41 N)"
    assert described("delay_s", Interval(0.08, 0.07, 0.09)) == "delay 80 ms (70 to 90 ms)"
    assert between("force_factor", 0.6, 0.6) == "0.6"


@pytest.mark.parametrize(
    ("kind", "causes", "words"),
    [
        ("effect", ("drag_torque",), "Cause: drag torque on the sliding ring"),
        (
            "ambiguous",
            ("actuation_delay", "drag_torque"),
            "Part of the cause: dead time of the actuation and drag torque on the sliding ring; "
            "the rest is open",
        ),
        ("ambiguous", (), "Open: no effect or an unknown cause"),
        ("none", (), "No effect needed: the gap lies within the margin"),
        ("unknown", (), "Unknown: no known effect explains the gap"),
    ],
)
def test_each_verdict_has_its_headline(kind: str, causes: tuple[str, ...], words: str) -> None:
    assert headline(kind, causes, [NONE, UNKNOWN], EFFECTS) == words


def test_an_open_cause_names_the_parts_that_all_hypotheses_have() -> None:
    pair, third = ("actuation_delay", "drag_torque"), ("sleeve_friction",)
    said = headline("ambiguous", (), [pair, tuple(sorted(pair + third)), UNKNOWN], EFFECTS)
    assert said == (
        "Open: dead time of the actuation and drag torque on the sliding ring, with or without dry "
        "friction of the sliding ring, or an unknown cause"
    )


def test_the_summary_has_sizes_over_all_plausible_hypotheses() -> None:
    found = diagnosed()
    said = summary(found)
    assert said.startswith("Bench and simulation differ by 138 ms (root mean square over 25 ")
    every, alone = found.sizes["actuation_delay"]["delay_s"], found.fits[HEAVY].interval("delay_s")
    assert (every.low, every.high) != (alone.low, alone.high)
    assert f"dead time of the actuation {between('delay_s', every.low, every.high)}" in said
    assert "mass of actuator and linkage" in said.partition("Open beside:")[2]
    assert "(62 %)" in said
    assert "nothing more (14 %)" in said


def test_a_reading_at_rest_that_explains_nothing_is_refuted() -> None:
    """No effect moves a time of this model, so the linkage explains 0 ms of the gap."""
    said = summary(diagnosed())
    assert "Alone and as read at rest, elastic linkage (3.9 mm/kN) explains 0 ms" in said
    named = summary(diagnosis_of({("linkage_compliance",): 0.98, NONE: 0.02}))
    assert "elastic linkage (3.9" not in named


def test_a_mass_is_given_at_the_arm_by_the_ratio_squared() -> None:
    """20 kg at the sleeve over 3.1914 squared are 1.96 kg at the arm."""
    said = summary(diagnosed())
    assert "At the arm, added mass of 20 kg is 2 kg (ratio 3.19 squared)." in said
    direct = replace(STAND, sensor=Sensor())
    said = summary(diagnosis_of({HEAVY: 0.9, DAMPED: 0.1}, direct))
    assert "At the arm" not in said
    assert "Added mass of 20 kg is 20 times that of fork and rod (1 kg)" in said


def test_a_size_beyond_its_ordinary_source_has_the_test_that_measures_it() -> None:
    """1.6 N m over the 0.5 N m of bearings and seals."""
    said = summary(diagnosed())
    assert (
        "Drag of 1.6 N m is 3.2 times that of bearings and seals of an input shaft (0.5 N m); "
        "run-down of the sliding ring measures it in 1 h." in said
    )
    assert "Delay of" not in said


def test_a_reading_of_the_record_that_decides_is_stated() -> None:
    same = reading("time_zero", "command", 0.7, diagnosed().verdict.causes)
    other = reading("time_zero", "force", 0.3, ("drag_torque",))
    posterior = diagnosed().posterior
    assert "If " not in summary(diagnosis_of(posterior, readings=(same, same)))
    said = summary(diagnosis_of(posterior, readings=(same, other)))
    assert said.endswith(
        "If times start with the force (30 %), the answer is: part of the cause: drag torque on "
        "the sliding ring; the rest is open."
    )


@pytest.mark.parametrize(
    ("posterior", "words"),
    [
        ({NONE: 0.96, ("drag_torque",): 0.04}, "The gap without scatter is below 11 ms with"),
        ({UNKNOWN: 0.9, ("drag_torque",): 0.1}, "No known effect, alone or with others"),
        (
            {("drag_torque",): 0.6, ("sleeve_friction",): 0.4},
            "The cause is open. Parts and their probabilities: drag torque on the sliding ring",
        ),
        ({("drag_torque",): 0.97, NONE: 0.03}, "Cause, with 97 %: drag torque on the sliding ring"),
    ],
)
def test_each_verdict_has_its_sentence(posterior: dict, words: str) -> None:
    assert words in summary(diagnosis_of(posterior))
