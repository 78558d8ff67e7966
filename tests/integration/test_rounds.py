"""Rounds that were cut off end as they would have, whoever goes on with them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from dataclasses import replace
from functools import cache
from typing import Any

import optuna
import pytest
from optuna.samplers import BaseSampler

from dogshape.pipeline.config.study_file import Setup, load_study
from dogshape.pipeline.search.rounds import ROUND, WORKER, next_round
from dogshape.pipeline.search.samplers import sampler_factory
from dogshape.pipeline.search.search import Search

SAMPLERS = ("surrogate", "space_filling", "tpe", "nsga2", "random")
TRIALS = 12


class CutOffError(Exception):
    """Stands for the end of a process."""


class Claimed:
    """Claims of a run, beside others that are alive."""

    def __init__(self, worker: int | None, living: set[int]) -> None:
        self.worker, self._living = worker, living

    def turn(self) -> Any:
        return nullcontext()

    def living(self) -> set[int]:
        return self._living

    def wait(self) -> None:
        raise AssertionError("nothing to wait for")

    def close(self) -> None:
        pass


def _study(sampler: str) -> Setup:
    return load_study(
        "mq200_paper",
        ["search.startup=3", f"search.trials={TRIALS}", f"search.sampler={sampler}",
         "shift.timeout_s=1.1"],
    )  # fmt: skip


def _opened(study: Setup) -> Search:
    return Search(study, optuna.create_study(directions=["minimize"] * 2))


def _tell(search: Search, ids: list[int], upto: int | None = None) -> None:
    """Tell trials some function of their parameters."""
    for trial_id in ids[:upto]:
        trial = optuna.Trial(search.optuna, trial_id)
        given = trial.params
        search.optuna.tell(trial, [given["chamfer_deg"] + given["count"], given["height_mm"]])


def _go_on(search: Search, sampler_of: Callable[[int], BaseSampler]) -> list[dict[str, Any]]:
    while ids := next_round(search, sampler_of):
        _tell(search, ids)
    return [trial.params for trial in search.trials()]


@cache
def _whole(sampler: str) -> Search:
    """A search that nothing cut off, to be read alone."""
    study = _study(sampler)
    search = _opened(study)
    _go_on(search, sampler_factory(study))
    return search


def _ending(sampler_of: Callable[[int], BaseSampler], number: int) -> Callable[[int], BaseSampler]:
    """Return what ends the process where proposal ``number`` would be asked."""

    def ending(asked: int) -> BaseSampler:
        if asked == number:
            raise CutOffError
        return sampler_of(asked)

    return ending


@pytest.mark.parametrize("sampler", SAMPLERS)
@pytest.mark.parametrize("number", [2, 6])
def test_a_round_cut_off_while_it_was_asked_asks_the_same(sampler: str, number: int) -> None:
    study, whole = _study(sampler), [trial.params for trial in _whole(sampler).trials()]
    sampler_of = sampler_factory(study)
    search = _opened(study)
    with pytest.raises(CutOffError):
        _go_on(search, _ending(sampler_of, number))
    assert len(search.trials()) < number
    assert _go_on(search, sampler_factory(study)) == whole
    assert len(whole) == TRIALS


@pytest.mark.parametrize("sampler", ["tpe", "nsga2"])
@pytest.mark.parametrize("told", [1, 3])
def test_a_round_cut_off_while_it_was_told_asks_no_more(sampler: str, told: int) -> None:
    """The rounds after it begin where they would have."""
    study, whole = _study(sampler), _whole(sampler)
    params = [trial.params for trial in whole.trials()]
    search, sampler_of = _opened(study), sampler_factory(study)
    _tell(search, next_round(search, sampler_of))
    second = next_round(search, sampler_of)
    _tell(search, second, told)
    assert next_round(search, sampler_of) == second[told:]
    assert _go_on(search, sampler_of) == params
    rounds = [[t.user_attrs[ROUND] for t in one.trials()] for one in (search, whole)]
    assert rounds[0] == rounds[1] == [[4 * (n // 4), 4] for n in range(TRIALS)]


def test_a_trial_that_was_asked_and_not_marked_is_of_the_last_round() -> None:
    study = _study("random")
    sampler_of = sampler_factory(study)
    whole = _go_on(_opened(study), sampler_of)
    search = _opened(study)
    with pytest.raises(CutOffError):
        _go_on(search, _ending(sampler_of, 6))
    _unmarked(search)
    assert _go_on(search, sampler_of) == whole
    search = _opened(study)
    with pytest.raises(CutOffError):
        _go_on(search, _ending(sampler_of, 5))
    _unmarked(search)  # the only one of its round
    assert _go_on(search, sampler_of) == whole


@pytest.mark.parametrize("sampler", ["surrogate", "tpe", "nsga2"])
@pytest.mark.parametrize("number", [0, 2, 7])
def test_a_trial_that_was_cut_off_while_it_was_asked_keeps_its_number(
    sampler: str, number: int
) -> None:
    """Whatever of its design had been drawn, designs have the numbers that they would have had."""
    study, whole = _study(sampler), _whole(sampler)
    for drawn in (0, 2):
        search = _opened(study)
        with _cut_off_in_suggestion(number, drawn), pytest.raises(CutOffError):
            _go_on(search, sampler_factory(study))
        last = search.optuna.get_trials(deepcopy=False)[-1]
        assert (last.number, last.state.name, len(last.params)) == (number, "RUNNING", drawn)
        _go_on(search, sampler_factory(study))
        told = {trial.number: trial.params for trial in search.trials()}
        assert told == {trial.number: trial.params for trial in whole.trials()}
        assert list(told) == list(range(TRIALS))


@contextmanager
def _cut_off_in_suggestion(number: int, drawn: int) -> Iterator[None]:
    """End the process while trial ``number`` is asked, after so many of its parameters."""
    usual, left = optuna.Trial._suggest, iter(range(drawn))

    def cut(trial: optuna.Trial, *given: Any) -> Any:
        if trial.number == number and next(left, None) is None:
            raise CutOffError
        return usual(trial, *given)

    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(optuna.Trial, "_suggest", cut)
        yield


def test_a_trial_that_was_cut_off_before_others_were_asked_has_failed() -> None:
    """Asked again it would propose what one of them has, as it knows the trials before it only."""
    study = _study("surrogate")
    sampler_of = sampler_factory(study)
    search = _opened(study)
    search = replace(search, claims=Claimed(1, {1}))
    with _cut_off_in_suggestion(3, 2), pytest.raises(CutOffError):
        next_round(search, sampler_of)
    search.optuna.ask({})  # as another run has it, which took its turn before
    assert len(next_round(search, sampler_of)) == 4
    states = [trial.state.name for trial in search.optuna.get_trials(deepcopy=False)]
    assert states[3] == "FAIL"


def _unmarked(search: Search) -> None:
    last = search.optuna.get_trials(deepcopy=False)[-1]
    assert last.state == optuna.trial.TrialState.RUNNING
    del last.user_attrs[ROUND]


def test_each_round_of_a_dead_run_is_taken_over_as_it_is() -> None:
    """Two runs died, one while it asked; a third goes on beside one that lives."""
    study = _study("random")
    sampler_of = sampler_factory(study)
    search = _opened(study)
    search = replace(search, claims=Claimed(1, {1}))
    first = next_round(search, sampler_of)
    search = replace(search, claims=Claimed(2, {1, 2}))
    with pytest.raises(CutOffError):
        next_round(search, _ending(sampler_of, 6))
    search = replace(search, claims=Claimed(3, {3}))
    assert next_round(search, sampler_of) == first
    second = next_round(search, sampler_of)
    assert len(second) == 4
    third = next_round(search, sampler_of)
    assert not next_round(search, sampler_of)
    trials = search.optuna.get_trials(deepcopy=False)
    assert [t._trial_id for t in trials] == [*first, *second, *third]
    assert {t.user_attrs[WORKER] for t in trials} == {3}
    rounds = [tuple(t.user_attrs[ROUND]) for t in trials]
    assert rounds == [(0, 4)] * 4 + [(4, 4)] * 4 + [(8, 4)] * 4
