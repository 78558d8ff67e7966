"""The compiled engine searches, Drake confirms: one study from trials to report."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from dogshape.pipeline.config.study_file import load_study
from dogshape.pipeline.reports.single_shifts import read_shifts
from dogshape.pipeline.simulate.evaluation import NEW_ANGLES, evaluate
from dogshape.pipeline.simulate.executor import scratch_executor
from dogshape.pipeline.simulate.point_plans import whole_plan
from dogshape.pipeline.store.folder import StudyFolder
from dogshape.pipeline.store.journal import ShiftJournal
from dogshape.pipeline.study import Run, run_study
from dogshape.sim.errors import InputError
from tests.conftest import SMALL, Listener

JUDGED = [*SMALL, "solver.engine='planar'", "search.confirm_engine='drake'"]


def test_drake_judges_what_the_compiled_engine_has_searched(tmp_path: Path) -> None:
    study, folder = load_study("mq200_paper", JUDGED), StudyFolder(tmp_path)
    said: list[str] = []
    result = run_study(study, Run(folder, 1, progress=Listener(said)))
    confirmed = result["confirmation"]
    assert (result["engine"], confirmed["engine"]) == ("planar", "drake")
    # The confirmed prototype is what Drake says of it, simulated here by itself.
    plain = load_study("mq200_paper", SMALL)
    plan, seed = whole_plan(plain, 3), plain.file.expectation.seed + NEW_ANGLES
    (own,) = evaluate(plain, [plain.clutch.dog], scratch_executor(1), [plan], seed)
    assert confirmed["prototype"]["expected_shift_time_s"] == own.expectation.mean
    # What was searched is the compiled engine's alone, and so is what the surrogate learns.
    journal = ShiftJournal(folder.shifts)
    shifts = read_shifts(study, journal)
    best = {name: result["best"][name] for name in study.variables}
    base = study.file.expectation.seed
    searched = [row for row in shifts.of(best) if row.get("seed") == base]
    assert {row.get("engine") for row in searched} == {"planar"}
    assert {row.get("engine") for row in shifts.confirmed(best)} == {None}
    stored = json.loads(folder.surrogate.read_text())
    assert stored["physics"]["engine"] == "planar"
    page = folder.report.read_text()
    assert "by the compiled engine, at the new angles by Drake" in page
    lines = folder.shifts.read_text()
    run_study(study, Run(folder, 1, resume=True))
    assert folder.shifts.read_text() == lines


def test_only_engines_that_exist_confirm() -> None:
    with pytest.raises(InputError, match=r"search\.confirm_engine"):
        load_study("mq200_paper", [*SMALL, "search.confirm_engine='adams'"])
    study = load_study("mq200_paper", JUDGED)
    assert study.confirming.clutch == load_study("mq200_paper", SMALL).clutch
    assert load_study("mq200_paper", SMALL).confirming.clutch.solver.engine == "drake"
