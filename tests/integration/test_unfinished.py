"""Trials that another run told meanwhile."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import optuna
import pytest
from optuna.trial import TrialState

from dogshape.pipeline.config.study_file import Setup, load_study
from dogshape.pipeline.search.search import Search, finish_round, next_round, sampler_of
from dogshape.pipeline.simulate.design import Measured
from dogshape.pipeline.simulate.evaluation import Simulated
from dogshape.pipeline.simulate.executor import Executor
from dogshape.pipeline.store.journal import ShiftJournal
from dogshape.sim.statistics.expectation import Estimate, Expectation, PointExpectation
from dogshape.sim.strength.landing import Demand
from tests.conftest import SMALL

NO_ROWS = np.zeros((0, 13))


def test_what_another_run_told_leaves_no_other_trial_running(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    study = load_study("mq200_paper", [*SMALL, "search.batch=3"])
    storage = optuna.create_study(directions=["minimize"] * 2)
    search = Search(study, storage, sampler_of(study))
    trials = next_round(search)

    def evaluated(_: Setup, designs: Sequence[Any], *__: Any) -> list[Simulated]:
        point = PointExpectation(study.points[0], 0.1, 0.1, 0.001, 0.0, 1.0, 3)
        found = {"expected_shift_time_s": Estimate(0.1, 0.001)}
        expectation = Expectation((point,), 0.1, 0.001)
        return [Simulated(expectation, Measured(Demand()), NO_ROWS, found, 3)] * len(designs)

    monkeypatch.setattr("dogshape.pipeline.search.search.evaluate", evaluated)
    storage.tell(trials[0].number, [0.2, 8.0])
    finish_round(search, trials, Executor(ShiftJournal(tmp_path / "shifts.jsonl"), 1))
    told = storage.get_trials()
    assert [trial.state for trial in told] == [TrialState.COMPLETE] * 3
    assert told[0].values == [0.2, 8.0]
