"""A whole study in two levels: counts, resuming, and what its pages say."""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dogshape.pipeline.config.study_file import Setup, load_study
from dogshape.pipeline.reports.study_page import publish
from dogshape.pipeline.simulate.executor import Executor
from dogshape.pipeline.store.folder import StudyFolder
from dogshape.pipeline.store.result_schema import StudyRecord, require_result
from dogshape.pipeline.study import run_study
from dogshape.sim.statistics.batch import run_block
from dogshape.sim.statistics.blocks import Block
from dogshape.sim.statistics.shift_records import Record
from tests.conftest import SMALL, searching

BOTH = [
    *SMALL,
    "search.levels=2",
    "search.screen_angles=16",
    "search.confirm_angles=4",
]
POINTS, PAIRS, SCREEN = 2, 2, 16


class CutOffError(Exception):
    """Stands for the end of a process."""


def _study(*more: str) -> Setup:
    return load_study("mq200_paper", [*BOTH, *more])


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The study, run at one go."""
    folder = tmp_path_factory.mktemp("two-levels") / "whole"
    run_study(_study(), searching(folder, jobs=1))
    return folder


def _result(folder: Path) -> dict[str, Any]:
    found: dict[str, Any] = json.loads((folder / "result.json").read_text("utf-8"))
    return found


def test_shifts_of_both_engines_are_counted_apart(whole: Path) -> None:
    result = _result(whole)
    require_result(result, "the result")
    assert set(result) == set(StudyRecord.model_fields)
    told = [row for row in result["trials"] if row["expected_shift_time_s"] is not None]
    simulated = [row for row in told if row["shifts"]]
    for row in simulated:
        assert row["shifts"] == POINTS * PAIRS
        assert row["compiled_shifts"] == POINTS * SCREEN
        assert row["points"] == POINTS
    assert result["n_compiled_shifts"] == sum(row["compiled_shifts"] for row in result["trials"])
    lines = (whole / "shifts.jsonl").read_text("utf-8").splitlines()
    assert result["n_simulated_shifts"] == len(lines)
    assert not any('"engine": "planar"' in line for line in lines)
    confirmed = result["confirmation"]["best"]
    assert {p["n_planar"] for p in confirmed["points"]} == {64}
    assert confirmed["shifts"] == 4 * POINTS


def test_the_front_has_the_values_of_both_engines_at_new_angles(whole: Path) -> None:
    result = _result(whole)
    said = {one["trial"]: one for one in result["confirmation"]["designs"]}
    assert result["front"]
    for row in result["front"]:
        assert row["expected_shift_time_s"] == said[row["trial"]]["expected_shift_time_s"]
        assert row["standard_error_s"] == said[row["trial"]]["standard_error_s"]
    searched = [row["expected_shift_time_s"] for row in result["trials"]]
    assert all(row["expected_shift_time_s"] not in searched for row in result["front"])


@pytest.mark.parametrize("most", [30, 60])
def test_a_search_that_was_cut_off_ends_as_it_would_have(
    whole: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, most: int
) -> None:
    """After so many blocks of either engine, in the search and after it."""
    folder, begun = tmp_path / "cut", [0]

    def cut(block: Block) -> Iterator[Record]:
        begun[0] += 1
        if begun[0] > most:
            raise CutOffError
        return run_block(block)

    with monkeypatch.context() as patch:
        patch.setattr("dogshape.pipeline.simulate.executor.run_block", cut)
        with pytest.raises(CutOffError):
            run_study(_study(), searching(folder, jobs=1))
    run_study(_study(), searching(folder, jobs=1, resume=True))
    assert _result(folder) == _result(whole)


def test_shifts_that_are_lost_are_simulated_again(whole: Path, tmp_path: Path) -> None:
    folder = Path(shutil.copytree(whole, tmp_path / "lost"))
    lines = (folder / "shifts.jsonl").read_text("utf-8").splitlines(keepends=True)
    (folder / "shifts.jsonl").write_text("".join(lines[5:]), encoding="utf-8")
    run_study(_study(), searching(folder, jobs=1, resume=True))
    assert _result(folder) == _result(whole)


def test_drake_simulates_nothing_twice(whole: Path, tmp_path: Path) -> None:
    folder = Path(shutil.copytree(whole, tmp_path / "again"))
    engines: list[str] = []
    simulate = Executor._simulate

    def seen(self: Executor, blocks: list[Block]) -> Any:
        engines.extend(block.clutch.solver.engine for block in blocks)
        return simulate(self, blocks)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Executor, "_simulate", seen)
        run_study(_study(), searching(folder, jobs=1, resume=True))
    assert set(engines) == {"planar"}
    assert _result(folder) == _result(whole)


def test_the_report_says_which_shifts_the_errors_rest_on(whole: Path) -> None:
    page = publish(StudyFolder(whole), lambda _: None).read_text("utf-8")
    result = _result(whole)
    assert "of the compiled engine, corrected by what Drake differs at some of the same" in page
    assert "16 angles of the compiled engine at each operating point and 2 of Drake" in page
    assert f"by Drake, {result['n_compiled_shifts']} by the compiled engine; " in page
    assert "4 new angles at each operating point among 64 of the compiled engine" in page


def test_the_surrogate_learns_from_the_corrected_rows(whole: Path) -> None:
    rows = json.loads((whole / "others.json").read_text("utf-8"))["rows"]
    shifts = np.array([row[-2] for row in rows])
    assert set(shifts.tolist()) == {SCREEN}
    assert len(rows) == POINTS * _result(whole)["n_simulated_designs"]
