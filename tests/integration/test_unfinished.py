"""What the clock ended, what another run told, and what was lost: nothing wrong of it stays."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import optuna
import pytest
from optuna.trial import FrozenTrial, TrialState

from dogshape.cli.console import ProgressBar
from dogshape.diagnosis.prediction.bank_store import BankStore
from dogshape.pipeline.config.study_file import Setup, load_study
from dogshape.pipeline.reports.study_page import publish
from dogshape.pipeline.search.dog_guide import DogGuide
from dogshape.pipeline.search.rounds import next_round
from dogshape.pipeline.search.samplers import sampler_factory
from dogshape.pipeline.search.search import Search
from dogshape.pipeline.search.trials import finish
from dogshape.pipeline.simulate.design import Measured, design_of
from dogshape.pipeline.simulate.evaluation import Simulated
from dogshape.pipeline.simulate.executor import Executor
from dogshape.pipeline.simulate.point_plans import Plan, is_whole, whole_plan
from dogshape.pipeline.store.folder import StudyFolder
from dogshape.pipeline.store.journal import ShiftJournal
from dogshape.pipeline.study import run_study
from dogshape.sim.errors import InputError
from dogshape.sim.statistics.batch import run_block
from dogshape.sim.statistics.blocks import Block, even_blocks
from dogshape.sim.statistics.estimate import Estimate
from dogshape.sim.statistics.expectation import Expectation, PointExpectation
from dogshape.sim.statistics.shift_records import Record, unfinished
from dogshape.sim.strength.landing import LANDING_RULES, Demand
from tests.conftest import SMALL, searching
from tests.integration.studies import Finished

FEW = [*SMALL, "search.trials=4", "search.sampler=random"]
REASON = "no end after solver.time_limit_s = 600, at 0.01 s of the shift"
NO_ROWS = np.zeros((0, 13))
#: Dogs that land too hard.
HARD = Measured(Demand(1e10, 1e10, 1e10))
DESIGN = ("chamfer_deg", "height_mm", "count", "expected_shift_time_s", "trial")


class Busy:
    """A machine that is too busy for some shifts of the prototype, until it is not."""

    def __init__(self) -> None:
        self.ended = 0

    def __call__(self, block: Block) -> Iterator[Record]:
        for place, row in enumerate(run_block(block)):
            if place == 0 and row["count"] == 15 and abs(row["height_mm"] - 3.7) < 1e-9:
                self.ended += block.clutch.solver.engine == "drake"  # compiled ones are not kept
                lost = {"outcome": "diverged", "shift_time_s": None, "reason": REASON}
                yield {**row, **lost, "landing_loads_N_mm": [0.0] * len(row["landing_loads_N_mm"])}
            else:
                yield row


def _rows(result: dict[str, Any]) -> list[list[Any]]:
    return [[row[name] for name in DESIGN] for row in result["trials"]]


def test_what_the_clock_ended_is_simulated_again_by_the_next_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, calm: Finished
) -> None:
    """The run counts such shifts as failed and ends; the next one ends as if nothing had been."""
    study, busy = load_study("mq200_paper", FEW), Busy()
    monkeypatch.setattr("dogshape.pipeline.simulate.executor.run_block", busy)
    first = run_study(study, searching(tmp_path, 1))
    monkeypatch.undo()
    assert busy.ended > 0
    assert first["failed_shifts"] == {REASON.partition(", at ")[0]: busy.ended}
    assert len(first["trials"]) == 4
    assert _rows(first)[0] != _rows(calm.result)[0]
    kept = [json.loads(line) for line in (tmp_path / "shifts.jsonl").read_text().splitlines()]
    assert not any(map(unfinished, kept))
    assert first["n_simulated_shifts"] == len(kept)
    again = run_study(study, searching(tmp_path, 1, resume=True))
    assert again["failed_shifts"] == {}
    assert _rows(again) == _rows(calm.result)
    assert again["confirmation"] == calm.result["confirmation"]


def test_a_result_of_before_that_the_clock_spoilt_is_mended(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, calm: Finished
) -> None:
    """Earlier versions kept what the clock ended, and told the trials that rest on it."""
    study = load_study("mq200_paper", FEW)
    with pytest.MonkeyPatch.context() as before:
        before.setattr("dogshape.pipeline.simulate.executor.run_block", Busy())
        for module in ("store.journal", "simulate.evaluation"):
            before.setattr(f"dogshape.pipeline.{module}.unfinished", lambda _: False)
        first = run_study(study, searching(tmp_path, 1))
    assert REASON in (tmp_path / "shifts.jsonl").read_text()
    for _ in range(2):  # trials stay as they were told, so each run mends them
        again = run_study(study, searching(tmp_path, 1, resume=True))
        assert again["failed_shifts"] == {}
        assert _rows(again) == _rows(calm.result) != _rows(first)


def test_lost_shifts_are_said_and_simulated_again(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], calm: Finished
) -> None:
    study, path = load_study("mq200_paper", FEW), tmp_path / "shifts.jsonl"
    folder = StudyFolder(tmp_path)
    for name in ("study.json", "trials.log", "result.json"):
        (tmp_path / name).write_bytes((calm.folder / name).read_bytes())
    lines = (calm.folder / "shifts.jsonl").read_text().splitlines(keepends=True)
    path.write_text("".join(lines[: len(lines) // 2]))
    said: list[str] = []
    publish(folder, said.append)
    lost = len(lines) - len(lines) // 2
    (line,) = [line for line in said if "lacks" in line]
    assert f"lacks {lost} of the {len(lines)} shifts that result.json rests on" in line
    assert "--resume simulates them again" in line
    path.unlink()
    how = replace(searching(tmp_path, 1, resume=True), progress=ProgressBar())
    again = run_study(study, how)
    words = " ".join(capsys.readouterr().err.split())
    searched = sum(row["shifts"] for row in again["trials"])
    assert f"lacks {searched} shifts of" in words
    assert again["n_simulated_shifts"] == len(lines)
    assert sorted(path.read_text().splitlines(keepends=True)) == sorted(lines)
    assert _rows(again) == _rows(calm.result)


def test_a_bank_keeps_no_series_that_the_clock_cut_short(tmp_path: Path) -> None:
    study = load_study("mq200_paper", SMALL)
    blocks = even_blocks(study.clutch, study.points, 3, 1)
    failed = {"outcome": "diverged", "shift_time_s": None, "reason": REASON}
    sound = {"outcome": "engaged", "shift_time_s": 0.1}
    store = BankStore([tmp_path / "bank.json"])

    def run(asked: Sequence[Block]) -> list[list[Record]]:
        return [[failed if b is blocks[0] else sound] * len(b.angles) for b in asked]

    store._answered(blocks, run)
    assert not store.missing(blocks)  # this diagnosis goes on with what it has
    store._write()
    assert BankStore([tmp_path / "bank.json"]).missing(blocks) == blocks[:1]


class Points(DogGuide):
    """A guide of designs that lack points, from which nothing can be predicted."""

    def times(self, trials: Sequence[FrozenTrial]) -> Any:
        raise InputError("too few")


def _asked(study: Setup, monkeypatch: pytest.MonkeyPatch) -> tuple[Search, list[int], list[Plan]]:
    """Return a search with its first round asked, and the plans that are simulated later on."""
    search = Search(study, optuna.create_study(directions=["minimize"] * 2), guide=Points(study))
    ids, plans = next_round(search, sampler_factory(study)), list[Plan]()

    def evaluated(
        study: Setup, dogs: Any, _: Any, asked: Sequence[Plan], __: int, **___: Any
    ) -> Any:
        plans.extend(asked)
        time = Estimate(0.1, 0.001)
        landed = HARD if is_whole(asked[0]) else Measured(Demand())  # harder at points left out
        point = PointExpectation(study.points[0], 0.1, 0.1, 0.001, 0.0, 1.0, 3)
        found = {"expected_shift_time_s": time}
        one = Simulated(Expectation((point,), 0.1, 0.001), landed, NO_ROWS, found)
        return [one] * len(dogs)

    monkeypatch.setattr("dogshape.pipeline.search.trials.evaluate", evaluated)
    return search, ids, plans


def test_constraints_are_those_of_the_last_simulation(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where nothing can be predicted, all points are simulated, and dogs may land harder."""
    study = load_study("mq200_paper", [*SMALL, "search.batch=2"])
    search, ids, plans = _asked(study, monkeypatch)
    for trial_id in ids:
        search.optuna._storage.set_trial_system_attr(trial_id, "dogshape:plan", [3, 0])
    finish(search, ids, Executor(ShiftJournal(tmp_path / "shifts.jsonl"), 1))
    assert plans == [[3, 0]] * len(ids) + [whole_plan(study)] * len(ids)
    landings = {rule.name for rule in LANDING_RULES}
    for trial in search.trials():
        hard = design_of(study, dict(trial.params), HARD).constraints
        assert landings & hard.keys()
        assert trial.constraints == hard
        assert any(value > 0.0 for value in hard.values())


def test_what_another_run_told_leaves_no_other_trial_running(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    study = load_study("mq200_paper", [*SMALL, "search.batch=3"])
    search, ids, _ = _asked(study, monkeypatch)
    search.optuna.tell(search.optuna.get_trials()[0].number, [0.2, 8.0])
    finish(search, ids, Executor(ShiftJournal(tmp_path / "shifts.jsonl"), 1))
    trials = search.optuna.get_trials()
    assert [trial.state for trial in trials] == [TrialState.COMPLETE] * 3
    assert trials[0].values == [0.2, 8.0]
