"""Rounds that were cut off end as they would have, whoever goes on with them."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import Any

import numpy as np
import optuna
import pytest
from optuna.trial import FrozenTrial, TrialState

from dogshape.pipeline.config.study_file import Setup, load_study
from dogshape.pipeline.search.sampler import SurrogateSampler
from dogshape.pipeline.search.search import Search, finish_round, next_round, sampler_of
from dogshape.pipeline.simulate.design import Measured
from dogshape.pipeline.simulate.evaluation import Simulated
from dogshape.pipeline.simulate.executor import scratch_executor
from dogshape.sim.statistics.expectation import Estimate, Expectation, PointExpectation
from dogshape.sim.strength.landing import Demand
from tests.conftest import SMALL

TRIALS = 12
STUDY = load_study(
    "mq200_paper", ["search.startup=3", f"search.trials={TRIALS}", "shift.timeout_s=1.1"]
)


class CutOffError(Exception):
    """Stands for the end of a process."""


def _opened() -> Search:
    trials = optuna.create_study(directions=["minimize"] * 2)
    return Search(STUDY, trials, sampler_of(STUDY))


def _tell(search: Search, trials: list[FrozenTrial], upto: int | None = None) -> None:
    """Tell trials some function of their parameters."""
    for trial in trials[:upto]:
        given = trial.params
        values = [given["chamfer_deg"] + given["count"], given["height_mm"]]
        search.optuna.tell(trial.number, values)


def _go_on(search: Search) -> list[dict[str, Any]]:
    while trials := next_round(search):
        _tell(search, trials)
    return [trial.params for trial in search.read().trials]


@cache
def _whole() -> list[dict[str, Any]]:
    """The designs of a search that nothing cut off."""
    return _go_on(_opened())


@pytest.mark.parametrize("number", [2, 6])
def test_a_round_cut_off_while_it_was_proposed_is_filled_up(
    number: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    search, usual = _opened(), SurrogateSampler.propose

    def ending(self: SurrogateSampler, trials: list[FrozenTrial]) -> Any:
        if len(trials) == number:
            raise CutOffError
        return usual(self, trials)

    monkeypatch.setattr(SurrogateSampler, "propose", ending)
    with pytest.raises(CutOffError):
        _go_on(search)
    monkeypatch.undo()
    assert len(search.read().trials) < number
    assert _go_on(search) == _whole()
    assert len(_whole()) == TRIALS


@pytest.mark.parametrize("told", [1, 3])
def test_a_round_cut_off_while_it_was_told_asks_no_more(told: int) -> None:
    """The rounds after it begin where they would have."""
    search = _opened()
    _tell(search, next_round(search))
    second = next_round(search)
    _tell(search, second, told)
    left = [trial.number for trial in second[told:]]
    assert [trial.number for trial in next_round(search)] == left
    assert _go_on(search) == _whole()


def test_what_another_run_told_leaves_no_other_trial_running(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    study = load_study("mq200_paper", [*SMALL, "search.batch=3"])
    storage = optuna.create_study(directions=["minimize"] * 2)
    search = Search(study, storage, sampler_of(study))
    trials = next_round(search)

    def evaluated(_: Setup, designs: Sequence[Any], *__: Any) -> list[Simulated]:
        point = PointExpectation(study.points[0], 0.1, 0.1, 0.001, 0.0, 1.0, 3)
        found = {"expected_shift_time_s": Estimate(0.1, 0.001)}
        expectation = Expectation((point,), 0.1, 0.001)
        one = Simulated(expectation, Measured(Demand()), np.zeros((0, 13)), found, 3)
        return [one] * len(designs)

    monkeypatch.setattr("dogshape.pipeline.search.search.evaluate", evaluated)
    storage.tell(trials[0].number, [0.2, 8.0])
    finish_round(search, trials, scratch_executor(1))
    told = storage.get_trials()
    assert [trial.state for trial in told] == [TrialState.COMPLETE] * 3
    assert told[0].values == [0.2, 8.0]
