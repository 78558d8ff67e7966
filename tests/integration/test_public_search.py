"""A searched study and a fitted surrogate in the public package, from one finished study."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import FrozenInstanceError
from pathlib import Path
from typing import Any

import pytest

import dogshape as ds
from dogshape.pipeline.config.study_file import bundled_studies
from dogshape.pipeline.search.result_schema import require_result
from tests.conftest import SMALL, Said
from tests.integration.studies import SETTINGS, Finished

Dogshape = Callable[..., Said]
ROOT = Path(__file__).parents[2]
TIME = "expected_shift_time_s"
SETS = [part for text in SMALL for part in ("--set", text)]


@pytest.fixture(scope="module")
def found(finished: Finished, tmp_path_factory: pytest.TempPathFactory) -> ds.StudyResult:
    """The finished study at smoke size, opened again by its problem."""
    out = finished.copy(tmp_path_factory.mktemp("public") / "mine")
    return ds.Study("mq200_paper", SETTINGS).search(out, jobs=1, report=False, resume=True)


@pytest.fixture
def record(found: ds.StudyResult) -> dict[str, Any]:
    """A copy of the record of the finished study, to be spoilt."""
    copied: dict[str, Any] = json.loads(json.dumps(found.record))
    return copied


def test_a_search_is_what_the_command_line_prints(
    found: ds.StudyResult, dogshape: Dogshape
) -> None:
    """The same study resumed has nothing left to simulate."""
    arguments = ("--out", found.folder, "--resume", "--no-report", "--jobs", "1", "--json")
    said = dogshape("study", "mq200_paper", *SETS, *arguments)
    assert said.status == 0, said.err
    printed, own = said.json, json.loads(json.dumps(found.to_dict()))
    assert printed.pop("seconds_cpu") > 0.0 < own.pop("seconds_cpu")
    assert printed == own
    assert set(said.json) >= {"best", "front", "n_simulated_shifts", "report"}
    assert said.json["report"] is None


def test_a_result_is_read_from_its_folder(found: ds.StudyResult) -> None:
    again = ds.load_result(found.folder)
    assert again.record == json.loads(found.folder.joinpath("result.json").read_text())
    own = json.loads(json.dumps(found.to_dict()))
    assert again.to_dict() == own | {"seconds_cpu": None}
    assert again.config.config_hash == found.config.config_hash
    with pytest.raises(FrozenInstanceError):
        again.record = {}  # type: ignore[misc]


def test_front_and_trials_are_tables(found: ds.StudyResult) -> None:
    front, trials = found.front, found.to_frame()
    assert list(front["trial"]) == [row["trial"] for row in found.record["front"]]
    assert front[TIME].is_monotonic_increasing
    assert (front[f"standard_error_of_{TIME}"] > 0.0).all()
    assert f"standard_error_of_{found.record['objectives'][1]}" not in front
    assert list(trials["trial"]) == list(range(12))
    assert set(trials.loc[trials["on_front"], "trial"]) == set(front["trial"])
    assert found.best is not None
    assert trials.loc[trials["chosen"], "trial"].tolist() == [found.best["trial"]]


def test_the_report_is_written_where_one_asks(
    found: ds.StudyResult, tmp_path: Path, dogshape: Dogshape
) -> None:
    page = found.report(tmp_path / "mine.html")
    assert page == tmp_path / "mine.html"
    assert page.read_bytes() == (found.folder / "report.html").read_bytes()
    pages = sorted(path.name for path in (found.folder / "shifts").iterdir())
    assert sorted(path.name for path in (tmp_path / "shifts").iterdir()) == pages != []
    assert ds.load_result(found.folder).page == found.folder / "report.html"
    said = dogshape("report", found.folder, "--json")
    assert json.loads(said.out) == {"report": str(found.folder / "report.html")}


def test_a_fit_is_what_the_command_line_prints(
    found: ds.StudyResult, tmp_path: Path, dogshape: Dogshape
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


@pytest.mark.parametrize("name", bundled_studies())
def test_kept_results_keep_to_the_schema(name: str) -> None:
    path = ROOT / "studies" / name / "result.json"
    require_result(json.loads(path.read_text()), name)


def test_what_the_schema_lacks_is_refused(record: dict[str, Any]) -> None:
    record["front"][0]["chamfr_deg"] = 8.0
    record["trials"][1]["feasible"] = 1
    del record["confirmation"]["gain_s"]
    with pytest.raises(ds.InputError) as refused:
        require_result(record, "mine")
    for words in (
        "'front.0.chamfr_deg' is not a known key; did you mean",
        "'confirmation.gain_s' is missing",
        "trials.1.feasible is 1",
    ):
        assert words in str(refused.value)
