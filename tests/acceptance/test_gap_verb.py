"""``dogshape gap`` on the published tables, from the bank that the package brings."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from dogshape.diagnosis.bench.bench_data import load_bench
from dogshape.pipeline.diagnose.bank_diagnosis import Means, diagnosed
from tests.conftest import Said

Call = Callable[..., Said]


@pytest.fixture(scope="module")
def stand(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """The record of the stand; a simulation would fail for lack of workers."""
    folder = tmp_path_factory.mktemp("bank")
    record: dict[str, Any] = diagnosed(load_bench("mq200_stand"), Means(bank=folder)).as_dict()
    assert not list(folder.iterdir())
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
    assert stand["next_test"]["name"] == "force at the sleeve over time"


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
    assert gap["rival_heldout_rmse_s"] > gap["heldout_rmse_s"]


def test_cells_of_which_nothing_is_known_have_no_gap(stand: dict[str, Any]) -> None:
    empty = [(c["mismatch_rpm"], c["force_N"]) for c in stand["where"] if c["gap_s"] is None]
    assert len(empty) == 3
    assert {round(rpm) for rpm, _ in empty} == {5}
    failed = stand["sensitivity"]["unknown_as_failed"][0]
    assert failed["effects"] == ["unknown"]


def test_what_the_stand_shows_at_rest_does_not_change_the_answer(stand: dict[str, Any]) -> None:
    given = stand["sensitivity"]["given_compliance_mm_kN"]
    having = [h for h in given if {"actuation_delay", "drag_torque"} <= set(h["effects"])]
    assert sum(h["probability"] for h in having) > 0.95
    assert "linkage_compliance" in given[0]["effects"]


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
