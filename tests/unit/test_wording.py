"""Summary of a diagnosis."""

from __future__ import annotations

from dataclasses import replace

from dogshape.diagnosis.bench.stand_file import Sensor
from dogshape.diagnosis.report.wording import between, summary
from tests.diagnosed import DAMPED, HEAVY, STAND, diagnosed, diagnosis_of, reading


def test_the_summary_has_sizes_over_all_plausible_hypotheses() -> None:
    found = diagnosed()
    every, alone = found.sizes["actuation_delay"]["delay_s"], found.fits[HEAVY].interval("delay_s")
    assert (every.low, every.high) != (alone.low, alone.high)
    said = summary(found)
    assert f"dead time of the actuation {between('delay_s', every.low, every.high)}" in said
    assert "mass of actuator and linkage" in said.partition("Open beside:")[2]
    assert "nothing more (14 %)" in said


def test_a_size_beyond_its_ordinary_source_has_the_test_that_measures_it() -> None:
    """1.6 N m over 0.5 N m; 20 kg at the sleeve, which are 1.96 kg at an arm of ratio 3.1914."""
    said = summary(diagnosed())
    words = "Drag of 1.6 N m is 3.2 times that of bearings and seals of an input shaft (0.5 N m); "
    assert f"{words}run-down of the sliding ring measures it." in said
    assert "Added mass of 2 kg is 2 times that of fork and rod (1 kg)" in said
    direct = replace(STAND, sensor=Sensor())
    said = summary(diagnosis_of({HEAVY: 0.9, DAMPED: 0.1}, direct))
    assert "Added mass of 20 kg is 20 times that of fork and rod (1 kg)" in said
    assert "Delay of" not in said


def test_a_reading_of_the_record_that_decides_is_stated() -> None:
    same = reading("time_zero", "command", 0.7, diagnosed().verdict.causes)
    other = reading("time_zero", "force", 0.3, ("drag_torque",))
    posterior = diagnosed().posterior
    assert "If " not in summary(diagnosis_of(posterior, readings=(same, same)))
    said = summary(diagnosis_of(posterior, readings=(same, other)))
    assert "If times start with the force (30 %), the answer is: part of the cause: drag" in said
