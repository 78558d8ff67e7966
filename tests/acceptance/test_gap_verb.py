"""``dogshape gap`` on the published tables, from the bank that the package brings."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

import dogshape as ds
from dogshape.diagnosis.bench.bench_data import load_bench
from dogshape.diagnosis.diagnosis import Diagnosis
from dogshape.diagnosis.prediction.bank import both
from dogshape.pipeline.config.study_file import load_study
from dogshape.pipeline.diagnose.bank_diagnosis import Means, diagnosed
from dogshape.pipeline.diagnose.calibrated_study import calibrated_study
from dogshape.pipeline.reports.gap.gap_page import write_page
from tests.conftest import Said

Call = Callable[..., Said]


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory) -> Diagnosis:
    """The diagnosis of the stand; a simulation would fail for lack of workers."""
    folder = tmp_path_factory.mktemp("bank")
    diagnosis = diagnosed(load_bench("mq200_stand"), Means(bank=folder))
    assert not list(folder.iterdir())
    return diagnosis


@pytest.fixture(scope="module")
def stand(found: Diagnosis) -> dict[str, Any]:
    """The record of the stand."""
    record: dict[str, Any] = found.as_dict()
    return record


def test_the_stand_has_a_dead_time_and_a_drag_and_something_that_is_open(
    stand: dict[str, Any],
) -> None:
    assert stand["verdict"] == "ambiguous"
    assert stand["causes"] == ["actuation_delay", "drag_torque"]
    leading = stand["hypotheses"][0]
    assert {"actuation_delay", "drag_torque"} < set(leading["effects"])
    assert len(leading["effects"]) == 3
    assert 0.055 < leading["parameters"]["delay_s"]["mean"] < 0.105
    assert leading["predictive_p"] > 0.01
    # Its open third effects act before the first touch, which traces show.
    assert stand["next_test"]["name"].startswith("traces of 10 shifts at ")
    assert stand["next_test"]["misleads"] < 0.05


def test_record_and_page_list_what_was_simulated_together(
    found: Diagnosis, stand: dict[str, Any], tmp_path: Path
) -> None:
    """Drag with each open third, which the answer rests on."""
    told = {tuple(one["effects"]): one["levels"] for one in stand["together"]}
    for third in ("moving_mass", "viscous_damping", "sleeve_friction"):
        assert told[both("drag_torque", third)] >= 6
    write_page(found, tmp_path / "report.html")
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    count = told["drag_torque", "moving_mass"]
    drag, mass = (found.effects[name].plain for name in ("drag_torque", "moving_mass"))
    assert f"{drag} with {mass} at {count} values" in page


def test_what_is_said_of_the_stand_is_said_for_either_sense(stand: dict[str, Any]) -> None:
    """Nobody noted which way its wheel was driven."""
    plain, other = stand["senses"]
    assert (plain["reversed"], other["reversed"]) == (False, True)
    assert plain["probability"] + other["probability"] == pytest.approx(1.0)
    assert all(one["hypotheses"] for one in stand["senses"])
    assert "Which way the rings turned past each other was not noted" in stand["summary"]


def test_what_is_left_of_the_stand_was_not_fitted(stand: dict[str, Any]) -> None:
    gap = stand["gap"]
    assert 0.12 < gap["baseline_rmse_s"] < 0.15
    assert gap["floor_rmse_s"] < gap["heldout_rmse_s"] < 0.3 * gap["baseline_rmse_s"]
    assert gap["shrink"] > 0.8
    # Points that were not fitted do not tell the open thirds apart.
    assert gap["rival_shrink"] == pytest.approx(gap["shrink"], abs=0.05)


def test_cells_that_were_not_made_have_no_gap(stand: dict[str, Any]) -> None:
    empty = [(c["mismatch_rpm"], c["force_N"]) for c in stand["where"] if c["gap_s"] is None]
    assert len(empty) == 3
    assert {round(rpm) for rpm, _ in empty} == {5}
    assert "unknown_as_failed" not in stand["sensitivity"]  # the record reads them as not made


def test_what_the_stand_shows_at_rest_does_not_change_the_answer(stand: dict[str, Any]) -> None:
    given = stand["sensitivity"]["given_compliance_mm_kN"]
    having = [h for h in given if {"actuation_delay", "drag_torque"} <= set(h["effects"])]
    assert sum(h["probability"] for h in having) > 0.95
    assert "linkage_compliance" in given[0]["effects"]


def test_the_stand_becomes_a_study_with_its_dead_time_and_its_drag(
    found: Diagnosis, tmp_path: Path
) -> None:
    """Another study takes the mechanism that was found, and its draws are keys that it takes."""
    sizes = found.intervals[found.leading]
    for base in (None, "mq200_paper"):
        made = calibrated_study(found, tmp_path / "stand.toml", base, draws=20)
        assert made.study.actuation.delay == pytest.approx(sizes["delay_s"].mean, rel=1e-5)
        drag = made.study.clutch.mechanism.drag_torque
        assert drag == pytest.approx(sizes["drag_Nm"].mean, rel=1e-5)
        assert len(made.study.points) == 28
        told = "friction 0.3 and 0.16, and the study has 0.12 and 0.1"
        assert any(told in remark for remark in made.remarks) == (base is not None)
        made.write(tmp_path / "stand.toml")
        for row in made.draws:
            keys = {key: value for key, value in row.items() if key.startswith("effects.")}
            drawn = load_study(tmp_path / "stand.toml", keys)
            assert drawn.actuation.delay == pytest.approx(row["effects.actuation_delay"])
    # The gearbox has a fork of its own, whose mass gives way to the one that leads.
    gearbox = calibrated_study(found, tmp_path / "gearbox.toml", "mq200", draws=20)
    mass = sizes["added_mass_kg"].mean
    assert gearbox.study.mechanism["added_mass_kg"] == pytest.approx(mass, rel=1e-4)
    # Led another third, that mass would be a rival, and not be drawn.
    damped = ("actuation_delay", "drag_torque", "viscous_damping")
    swapped = {damped: found.leading, found.leading: damped}
    posterior = {swapped.get(h, h): p for h, p in found.posterior.items()}
    led = replace(found, leading=damped, posterior=posterior)
    other = calibrated_study(led, tmp_path / "gearbox.toml", "mq200", draws=20)
    assert other.study.mechanism["added_mass_kg"] == 0.3
    assert any("mass of actuator" in remark and "not drawn" in remark for remark in other.remarks)
    assert all("moving_mass" not in row["hypothesis"] for row in other.draws)


def test_a_plan_for_the_stand_says_what_no_shift_can_show(tmp_path: Path) -> None:
    """From the bundled bank: a dead time is seen at any strength, an axial gap at none."""
    plan = ds.plan_shifts("mq200_stand", 60, points=6, bank=tmp_path)
    names = [h[0] if h else "none" for h in plan.inference.field.hypotheses]
    seen = {name: plan.unlike(k)[0] for k, name in enumerate(names) if name != "none"}
    assert seen["actuation_delay"] == seen["reversed_mismatch"] == 1.0
    assert seen["axial_gap"] == seen["spline_friction"] == 0.0
    record = plan.to_dict()
    assert sum(visit["shifts"] for visit in record["order"]) == 60
    assert record["worth"] > record["all_points"]["worth"] - 0.01
    assert record["hours"] < 0.5 * record["all_points"]["hours"]
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("nowhere",), "nowhere"),
        (("mq200_stand", "--study", "nowhere"), "nowhere"),
        (("mq200_stand", "--correct", "time=hours"), "time"),
        (("mq200_stand", "--effects", "nowhere"), "nowhere"),
    ],
    ids=["data set", "study", "correction", "effects"],
)
def test_bad_input_is_a_sentence(dogshape: Call, arguments: tuple[str, ...], message: str) -> None:
    said = dogshape("gap", *arguments)
    assert said.status == 2
    assert message in said.sentence
