"""Bundled studies with other objectives, run at smoke size; objectives of failed shifts."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dogshape.pipeline.config.schema import QUANTILE
from dogshape.pipeline.config.study_file import Setup, load_study
from dogshape.pipeline.reports.study_page import write_report
from dogshape.pipeline.search.confirmation import Executors, _resimulated
from dogshape.pipeline.simulate.executor import scratch_executor
from dogshape.pipeline.store.folder import StudyFolder
from dogshape.pipeline.study import run_study
from dogshape.sim.errors import InputError
from dogshape.sim.statistics.expectation import Estimate, mean_over
from tests.conftest import searching

QUANTILE_S = "shift_time_quantile_s"


def _tiny(name: str, *more: str) -> Setup:
    """A bundled study of two operating points, three angles and few designs, in Drake."""
    points = "operating={points=[{mismatch_rpm=100, force_N=469, weight=2}, "
    points += "{mismatch_rpm=-149, force_N=469}]}"
    budget = ["expectation.angles=3", "search.confirm_angles=3", "search.trials=4"]
    budget += ["search.sampler=space_filling", "solver.engine=drake"]
    return load_study(name, [points, *budget, *more])


def _run(study: Setup, folder: Path) -> tuple[dict[str, Any], list[dict[str, Any]]]:
    result = run_study(study, searching(folder, jobs=1))
    kept = folder / "shifts.jsonl"
    lines = kept.read_text().splitlines() if kept.exists() else []
    return result, [json.loads(line) for line in lines]


def test_the_robust_study_at_smoke_size(tmp_path: Path) -> None:
    study = _tiny("mq200_robust")
    result, shifts = _run(study, tmp_path)
    assert result["leading"] == "shift_time_quantile_s"
    assert study.file.search.quantile == QUANTILE
    rows = [row for row in result["trials"] if row["feasible"]]
    first = min(rows, key=lambda row: row["shift_time_quantile_s"])
    assert result["confirmation"]["designs"][0]["trial"] == first["trial"]
    assert {row["force_factor"] for row in shifts} != {1.0}
    # The prototype's chamfer would not slide from rest at the upper end of the friction.
    assert result["trials"][0]["failed"] == ["chamfer_release"]
    for row in result["trials"][1:]:
        assert row["standard_errors"]["shift_time_quantile_s"] > 0.0
        assert row["shift_time_quantile_s"] > row["expected_shift_time_s"]
    confirmed = result["confirmation"]
    before, after = (confirmed[k]["estimates"][QUANTILE_S]["value"] for k in ("prototype", "best"))
    assert confirmed["gains"][QUANTILE_S]["value"] == pytest.approx(before - after)
    assert write_report(StudyFolder(tmp_path)).stat().st_size > 0
    resumed = run_study(study, searching(tmp_path, jobs=1, resume=True))
    assert resumed["trials"] == result["trials"]
    assert resumed["n_simulated_shifts"] == result["n_simulated_shifts"]


def test_a_mean_of_nothing_is_unknown_and_a_point_of_nothing_is_left_out() -> None:
    nothing = mean_over([1.0, 2.0], [[], []])
    assert np.isnan([nothing.value, nothing.standard_error]).all()
    assert mean_over([1.0, 2.0], [[], [3.0, 3.0, 3.0]]) == Estimate(3.0, 0.0)


def test_designs_whose_shifts_all_fail_are_as_if_not_simulated(tmp_path: Path) -> None:
    """Their times count as not engaged; what they strike is unknown, and never the best."""
    study = _tiny("mq200_three", "solver.max_steps=20", "search.trials=2")
    result, shifts = _run(study, tmp_path)
    assert not shifts
    assert result["failed_shifts"] == {"no end after solver.max_steps = 20": 12}
    assert result["n_simulated_designs"] == 0
    assert result["best"] is result["confirmation"] is None
    for row in result["trials"]:
        assert row["peak_impact_force_N"] is None
        assert row["failed"] == ["simulation"]
        assert not row["feasible"]
    executors = Executors(scratch_executor(1), scratch_executor(1))
    with pytest.raises(InputError, match="every shift of design 0 at new angles failed"):
        _resimulated(study, {"design 0": study.prototype}, executors)
