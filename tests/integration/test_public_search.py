"""A searched study and a fitted surrogate in the public package, from one finished study."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

import dogshape as ds
from dogshape.pipeline.search.study_record import StudyRecord
from dogshape.sim.clutch_tables import validate
from tests.conftest import SMALL, Call, set_options
from tests.integration.studies import SETTINGS, Finished

TIME = "expected_shift_time_s"
SETS = set_options(SMALL)


@pytest.fixture(scope="module")
def found(finished: Finished, tmp_path_factory: pytest.TempPathFactory) -> ds.StudyResult:
    """The finished study at smoke size, opened again by its problem."""
    out = finished.copy(tmp_path_factory.mktemp("public") / "mine")
    return ds.Study("mq200_paper", SETTINGS).search(out, jobs=1, report=False, resume=True)


@pytest.fixture
def record(found: ds.StudyResult) -> dict[str, Any]:
    """A copy of the record of the finished study, to be spoilt."""
    copied: dict[str, Any] = json.loads(json.dumps(found.record.to_dict()))
    return copied


def test_a_search_is_what_the_command_line_prints(found: ds.StudyResult, dogshape: Call) -> None:
    """The same study resumed has nothing left to simulate."""
    arguments = ("--out", found.folder, "--resume", "--no-report", "--jobs", "1", "--json")
    said = dogshape("search", "mq200_paper", *SETS, *arguments)
    assert said.status == 0, said.err
    printed, own = said.json, json.loads(json.dumps(found.to_dict()))
    assert printed.pop("seconds_cpu") > 0.0 < own.pop("seconds_cpu")
    assert printed == own
    assert set(said.json) >= {"best", "front", "n_simulated_shifts", "report"}
    assert said.json["report"] is None


def test_a_result_is_read_from_its_folder(found: ds.StudyResult) -> None:
    again = ds.load_result(found.folder)
    assert again.record.to_dict() == json.loads(found.folder.joinpath("result.json").read_text())
    assert again.to_dict() == json.loads(json.dumps(found.to_dict())) | {"seconds_cpu": None}
    assert again.config.config_hash == found.config.config_hash


def test_front_and_trials_are_tables_and_a_figure(found: ds.StudyResult) -> None:
    front, trials = found.front, found.to_frame()
    assert list(front["trial"]) == [row.trial for row in found.record.front]
    assert front[TIME].is_monotonic_increasing
    assert (front[f"standard_error_of_{TIME}"] > 0.0).all()
    assert f"standard_error_of_{found.record.objectives[1]}" not in front
    assert list(trials["trial"]) == list(range(12))
    assert set(trials.loc[trials["on_front"], "trial"]) == set(front["trial"])
    assert found.best is not None
    assert trials.loc[trials["chosen"], "trial"].tolist() == [found.best.trial]

    (border,) = [one for one in found.plot().data if one.mode == "lines"]
    assert list(border.x) == pytest.approx(list(1e3 * found.front[TIME]))


def test_the_report_is_written_into_the_folder(
    reported: Finished, dogshape: Call, tmp_path: Path
) -> None:
    folder = reported.copy(tmp_path / "own")
    assert list((folder / "shifts").iterdir())
    assert ds.load_result(folder).page == folder / "report.html"
    said = dogshape("report", folder, "--json")
    assert json.loads(said.out) == {"report": str(folder / "report.html")}


def test_a_fit_is_what_the_command_line_prints(
    found: ds.StudyResult, tmp_path: Path, dogshape: Call
) -> None:
    fitted = ds.fit(found.folder, out=tmp_path / "one.json")
    said = dogshape("fit", found.folder, "--out", tmp_path / "one.json", "--json")
    printed, own = json.loads(said.out), json.loads(json.dumps(fitted.to_dict()))
    assert printed.pop("seconds") > 0.0 < own.pop("seconds")
    assert printed == own
    assert fitted.config.config_hash == found.config.config_hash
    data = fitted.stored.surrogate.data
    assert len(fitted.to_frame()) == len(data) * len(data.mix.points)
    assert f"{fitted.to_dict()['designs']} designs at" in repr(fitted)


def test_what_cannot_be_fitted_or_searched_is_refused(found: ds.StudyResult) -> None:
    with pytest.raises(ds.InputError, match="leave it out, or name the study"):
        ds.fit(found.folder, ["dog.count=18"])
    with pytest.raises(ds.InputError, match="give them to Study"):
        ds.fit(ds.Study("mq200_paper"), ["dog.count=18"])
    with pytest.raises(ds.DogshapeError, match=r"there is no study[.]json"):
        ds.load_result(found.folder / "none")


def test_a_new_result_has_every_key_of_the_schema(record: dict[str, Any]) -> None:
    """Keys that only older results or other objectives lack are there."""
    validate(StudyRecord, record, "result.json")
    assert set(record) == set(StudyRecord.model_fields)
    confirmed = record["confirmation"]["designs"][0]
    model = StudyRecord.model_validate(record).confirmation
    assert model is not None
    assert (
        set(confirmed)
        == model.designs[0].model_fields_set
        == set(type(model.designs[0]).model_fields) - {"engagement_torque_limits"}
    )  # the study gives no torques to find their limit
    assert set(confirmed["points"][0]) == set(type(model.best.points[0]).model_fields)


def test_what_the_schema_lacks_is_refused(
    found: ds.StudyResult, record: dict[str, Any], tmp_path: Path
) -> None:
    (tmp_path / "study.json").write_bytes((found.folder / "study.json").read_bytes())
    result = tmp_path / "result.json"
    record["front"][0]["chamfr_deg"] = 8.0
    record["trials"][1]["feasible"] = 1
    del record["confirmation"]["gain_s"]
    result.write_text(json.dumps(record))
    with pytest.raises(ds.InputError) as refused:
        ds.load_result(tmp_path)
    for words in (
        "'front.0.chamfr_deg' is not a known key; did you mean",
        "'confirmation.gain_s' is missing", "trials.1.feasible is 1",
    ):  # fmt: skip
        assert words in str(refused.value)
