"""Rounds that were cut off end as they would have, whoever goes on with them."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import cache
from typing import Any

import optuna
import pytest
from optuna.samplers import BaseSampler
from optuna.trial import FrozenTrial

from dogshape.pipeline.config.study_file import Setup, load_study
from dogshape.pipeline.search.search import Search, next_round, sampler_factory

SAMPLERS = ("surrogate", "tpe", "random")
TRIALS = 12


class CutOffError(Exception):
    """Stands for the end of a process."""


def _study(sampler: str) -> Setup:
    return load_study(
        "mq200_paper",
        ["search.startup=3", f"search.trials={TRIALS}", f"search.sampler={sampler}",
         "shift.timeout_s=1.1"],
    )  # fmt: skip


def _opened(study: Setup) -> Search:
    return Search(study, optuna.create_study(directions=["minimize"] * 2), sampler_factory(study))


def _tell(search: Search, trials: list[FrozenTrial], upto: int | None = None) -> None:
    """Tell trials some function of their parameters."""
    for trial in trials[:upto]:
        given = trial.params
        search.optuna.tell(
            trial.number, [given["chamfer_deg"] + given["count"], given["height_mm"]]
        )


def _go_on(search: Search) -> list[dict[str, Any]]:
    while trials := next_round(search):
        _tell(search, trials)
    return [trial.params for trial in search.read().trials]


@cache
def _whole(sampler: str) -> list[dict[str, Any]]:
    """The designs of a search that nothing cut off."""
    return _go_on(_opened(_study(sampler)))


def _ending(search: Search, number: int) -> Search:
    """Return a search that ends the process where proposal ``number`` would be asked."""

    def ending(asked: int) -> BaseSampler:
        if asked == number:
            raise CutOffError
        return search.sampler_of(asked)

    return replace(search, sampler_of=ending)


@pytest.mark.parametrize("sampler", SAMPLERS)
@pytest.mark.parametrize("number", [2, 6])
def test_a_round_cut_off_while_it_was_asked_asks_the_same(sampler: str, number: int) -> None:
    search = _opened(_study(sampler))
    with pytest.raises(CutOffError):
        _go_on(_ending(search, number))
    assert len(search.read().trials) < number
    assert _go_on(search) == _whole(sampler)
    assert len(_whole(sampler)) == TRIALS


@pytest.mark.parametrize("sampler", ["tpe"])
@pytest.mark.parametrize("told", [1, 3])
def test_a_round_cut_off_while_it_was_told_asks_no_more(sampler: str, told: int) -> None:
    """The rounds after it begin where they would have."""
    search = _opened(_study(sampler))
    _tell(search, next_round(search))
    second = next_round(search)
    _tell(search, second, told)
    left = [trial.number for trial in second[told:]]
    assert [trial.number for trial in next_round(search)] == left
    assert _go_on(search) == _whole(sampler)


@pytest.mark.parametrize("sampler", ["surrogate", "tpe"])
@pytest.mark.parametrize("number", [0, 7])
def test_a_trial_that_was_cut_off_while_it_was_asked_is_asked_again(
    sampler: str, number: int
) -> None:
    """Whatever of its design had been drawn, the designs are those that there would have been."""
    for drawn in (0, 2):
        search = _opened(_study(sampler))
        with _cut_off_in_suggestion(number, drawn), pytest.raises(CutOffError):
            _go_on(search)
        last = search.optuna.get_trials(deepcopy=False)[-1]
        assert (last.number, last.state.name, len(last.params)) == (number, "RUNNING", drawn)
        assert _go_on(search) == _whole(sampler)


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
