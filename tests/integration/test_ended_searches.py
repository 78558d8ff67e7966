"""A search of so few designs that all of them are tried."""

from __future__ import annotations

from pathlib import Path

from dogshape.pipeline.config.schema import VariablesSection
from dogshape.pipeline.config.study_file import build_study, load_study
from dogshape.pipeline.simulate.design import worth_simulating
from dogshape.pipeline.store.folder import StudyFolder
from dogshape.pipeline.study import Run, run_study
from tests.conftest import SMALL


def test_a_search_ends_where_every_design_was_tried(tmp_path: Path) -> None:
    file = load_study("mq200_paper", [*SMALL, "search.trials=40"]).file
    few = VariablesSection(count=[13, 20])
    study = build_study(file.model_copy(update={"variables": few}))
    allowed = [n for n in range(13, 21) if worth_simulating(study, {"count": n})]
    assert 1 < len(allowed) < 10
    how = Run(StudyFolder(tmp_path), jobs=1, resume=True)
    result = run_study(study, how)
    assert sorted(row["count"] for row in result["trials"]) == allowed
    assert result["best"] is not None
    again = run_study(study, how)
    assert [row["count"] for row in again["trials"]] == [row["count"] for row in result["trials"]]
