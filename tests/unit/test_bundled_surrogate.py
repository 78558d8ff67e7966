"""The surrogate that comes with the package, and which one is asked."""

from __future__ import annotations

import math
import re
from pathlib import Path

import pytest

from dogshape.check import ENGINE_ERROR, check_design
from dogshape.expectation import ALL_POINTS, simulate_mean
from dogshape.pipeline.config.study_file import find_study, load_study
from dogshape.pipeline.simulate.executor import RunOptions
from dogshape.pipeline.train.training_rows import matching_surrogate, stored_surrogate
from dogshape.surrogate.query import compare_physics
from dogshape.surrogate.store import MissingError
from tests.conftest import Call

PROTOTYPE = 0.0948  #: s, expected shift time at new angles (docs/results.md)


def test_a_check_works_without_any_results(dogshape: Call) -> None:
    said = dogshape("check", "mq200_paper", "--json")
    assert said.status == 0
    assert said.json["low_s"] < PROTOTYPE < said.json["high_s"]
    assert said.json["high_s"] < 1.1 * said.json["low_s"]
    assert said.json["in_range"] is True
    assert 0.99 < said.json["engaged"] <= 1.0
    missing = [one["check"] for one in said.json["verdict"]["not_judged"]]
    assert missing == ["flank_strike"]  # the landing was simulated
    low, high = (said.json["predicted"][key] for key in ("low_s", "high_s"))
    assert low < PROTOTYPE < high
    assert not said.json["missed_by_surrogate"]
    text = dogshape("check", "mq200_paper", "--mismatch-rpm", 80, "--force-N", 300).out
    assert "nearest simulated design" in text


def test_a_copy_of_the_study_has_it_by_its_physics(tmp_path: Path) -> None:
    copy = tmp_path / "mine.toml"
    text = find_study("mq200_paper").read_text().replace('name = "mq200_paper"', 'name = "mine"')
    copy.write_text(text)
    mine = load_study(copy, ["operating.mismatch_rpm=[50]"])
    stored, _ = stored_surrogate(mine, None)
    assert not compare_physics(stored.surrogate.data, mine.physics)
    assert matching_surrogate(load_study(copy, ["sliding.mass_kg=0.4"]), None) is None


def test_a_clutch_without_a_surrogate_is_simulated_by_the_compiled_engine(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)  # no results of a search
    few = ["operating.mismatch_rpm=[50, 149]", "operating.force_N=[469]", "sliding.mass_kg=0.4"]
    study = load_study("mq200_paper", few)
    record = check_design(study).to_dict()
    assert record["engine"] == "planar"
    assert record["shifts_planar"] == 2 * study.file.expectation.angles
    assert record["surrogate"] is None
    missing = [one["check"] for one in record["verdict"]["not_judged"]]
    assert missing == ["flank_strike"]  # the landing was simulated
    mean = simulate_mean(
        load_study("mq200_paper", [*few, "solver.engine=planar", "expectation.seed=7"]),
        RunOptions(jobs=1),
        ALL_POINTS,
        angles=40,
    ).mean
    error = math.hypot(record["standard_error_s"], mean.standard_error)
    assert abs(record["expected_shift_time_s"] - mean.mean) < 3.0 * error
    # Its error is that of the angles and that of the engine.
    assert record["standard_error_s"] > ENGINE_ERROR * record["expected_shift_time_s"]
    # The interval is that of Gamma distributed parts, longer upwards than downwards.
    below = record["expected_shift_time_s"] - record["low_s"]
    above = record["high_s"] - record["expected_shift_time_s"]
    assert above > below > 0.0
    assert below + above == pytest.approx(2.0 * 1.96 * record["standard_error_s"], rel=0.1)
    with pytest.raises(MissingError):
        check_design(study, surrogate=tmp_path / "none.json")


def test_a_design_without_a_time_has_its_reason(dogshape: Call) -> None:
    brought = str(find_study("mq200_paper").parent / "surrogate.json")
    for sets, words in (
        (("dog.chamfer_deg=4",), "faces hold: no estimate"),
        (("dog.count=40",), "must be at least 1.5 mm to be made"),
        (("dog.height_mm=9", "dog.count=12"), "to be made"),
    ):
        asked = [part for one in sets for part in ("--set", one)]
        said = dogshape("check", "mq200_paper", *asked, "--surrogate", brought, "--json")
        assert said.status == 1
        assert said.json["expected_shift_time_s"] is said.json["low_s"] is None
        assert words in said.json["reason"]
        assert said.json["in_range"] is False
        assert f"no shift time: {said.json['reason']}" in " ".join(
            dogshape("check", "mq200_paper", *asked, "--surrogate", brought).out.split()
        )


def test_a_clutch_of_which_few_shifts_engage_has_no_time(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    flat = {"dog.chamfer_deg": 0.0, "dog.traction_deg": 4.0, "dog.braking_deg": 0.0,
            "operating.mismatch_rpm": [5.0], "operating.force_N": [235.2]}  # fmt: skip
    found = check_design(load_study("mq200_paper", flat))
    assert found.time_s is None
    assert found.to_dict()["engaged"] < 0.5
    assert re.search(r"no shift time: engages in \d+ of 64 shifts, in \d+ % at", repr(found))
