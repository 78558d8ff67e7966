"""Headline and summary of a diagnosis, and numbers with their units."""

from __future__ import annotations

from dataclasses import replace

from dogshape.diagnosis.bench.stand_file import Sensor
from dogshape.diagnosis.report.wording import between, summary
from dogshape.diagnosis.terms import NONE
from tests.diagnosed import DAMPED, HEAVY, STAND, diagnosed, diagnosis_of, reading


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
