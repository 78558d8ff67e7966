"""Searches of so few designs that all of them are tried, or one is proposed twice."""

from __future__ import annotations

from pathlib import Path

from dogshape.pipeline.config.schema import VariablesSection
from dogshape.pipeline.config.study_file import Setup, build_study, load_study
from dogshape.pipeline.search.search import open_search
from dogshape.pipeline.search.state import standings
from dogshape.pipeline.simulate.design import worth_simulating
from dogshape.pipeline.store.folder import StudyFolder
from dogshape.pipeline.study import Run, run_study
from tests.conftest import SMALL


def _small_space(*more: str) -> Setup:
    """A study of the number of dogs alone: few designs, some of which pass the checks."""
    file = load_study("mq200_paper", [*SMALL, "search.trials=40", *more]).file
    few = VariablesSection(count=[13, 20])
    return build_study(file.model_copy(update={"variables": few}))


def test_a_search_ends_where_every_design_was_tried(tmp_path: Path) -> None:
    study = _small_space()
    allowed = [n for n in range(13, 21) if worth_simulating(study, {"count": n})]
    assert 1 < len(allowed) < 10
    how = Run(StudyFolder(tmp_path), jobs=1, resume=True)
    result = run_study(study, how)
    assert sorted(row["count"] for row in result["trials"]) == allowed
    assert result["best"] is not None
    again = run_study(study, how)
    assert [row["count"] for row in again["trials"]] == [row["count"] for row in result["trials"]]


def test_a_design_that_was_proposed_again_counts_once(tmp_path: Path) -> None:
    study = _small_space("search.sampler=random", "search.trials=12")
    result = run_study(study, Run(StudyFolder(tmp_path), jobs=1))
    told = [row for row in result["trials"] if row["expected_shift_time_s"] is not None]
    designs = {row["count"] for row in told}
    assert len(designs) < len(told)
    assert result["n_simulated_designs"] == len(designs)
    shown = [row["count"] for row in result["front"]]
    assert len(set(shown)) == len(shown)
    assert len(result["confirmation"]["designs"]) == 1
    state = open_search(study.working, StudyFolder(tmp_path), None, resume=True).read()
    assert len(standings(state)) == len(state.feasible) <= len(designs)
