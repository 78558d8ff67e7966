"""What the clock ended, what another run told, and what was lost: nothing wrong of it stays."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
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
from dogshape.pipeline.study import run_study
from dogshape.sim.statistics.blocks import Block, run_block
from dogshape.sim.statistics.expectation import Estimate, Expectation, PointExpectation
from dogshape.sim.statistics.shift_records import Record, unfinished
from dogshape.sim.strength.landing import Demand
from tests.conftest import SMALL, searching

REASON = "no end after solver.time_limit_s = 600, at 0.01 s of the shift"
NO_ROWS = np.zeros((0, 13))


class Busy:
    """A machine that is too busy for some shifts of the prototype, until it is not."""

    def __init__(self) -> None:
        self.ended = 0

    def __call__(self, block: Block) -> Iterator[Record]:
        for place, row in enumerate(run_block(block)):
            if place == 0 and row["count"] == 15 and abs(row["height_mm"] - 3.7) < 1e-9:
                self.ended += 1
                lost = {"outcome": "diverged", "shift_time_s": None, "reason": REASON}
                yield {**row, **lost, "landing_loads_N_mm": [0.0] * len(row["landing_loads_N_mm"])}
            else:
                yield row


def test_a_shift_that_the_clock_ended_has_failed_and_is_not_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    study, busy = load_study("mq200_paper", [*SMALL, "search.trials=4"]), Busy()
    monkeypatch.setattr("dogshape.pipeline.simulate.executor.run_block", busy)
    found = run_study(study, searching(tmp_path, 1))
    assert busy.ended > 0
    assert [row["trial"] for row in found["trials"]] == [0, 1, 2, 3]
    assert [*found["failed_shifts"]] == [REASON.partition(", at ")[0]]
    for name in ("running.jsonl", "shifts.jsonl"):
        kept = [json.loads(line) for line in (tmp_path / name).read_text().splitlines()]
        assert not any(map(unfinished, kept))


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
