"""Confirmation on times made up, where some designs land too hard at the new angles."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import optuna
import pytest

from dogshape.pipeline.config.study_file import Setup, load_study
from dogshape.pipeline.reports.study.designs import (
    designs_frame,
    designs_shown,
    failed_at_new_angles,
    of_kinds,
)
from dogshape.pipeline.search.confirmation import confirm
from dogshape.pipeline.search.rounds import run
from dogshape.pipeline.search.samplers import sampler_factory
from dogshape.pipeline.search.search import Search
from dogshape.pipeline.search.state import SearchState
from dogshape.pipeline.simulate.evaluation import NEW_ANGLES
from dogshape.pipeline.simulate.executor import Executor
from dogshape.pipeline.simulate.point_plans import MOST_CONFIRMED, most_to_confirm
from dogshape.pipeline.store.folder import StudyFolder
from dogshape.pipeline.store.journal import ShiftJournal
from dogshape.pipeline.study import Run, collect, run_study
from dogshape.sim.shift.loads import OVERLAPS, Landing
from dogshape.sim.statistics.blocks import Block
from dogshape.sim.statistics.shift_records import Record, landing_record
from tests.integration.test_replication import MADE_UP, CutOffError, MadeUp

WANTED = 3
SETTINGS = [*MADE_UP, "search.replicate=0", f"search.confirm_designs={WANTED}"]


class Landings(MadeUp):
    """Lets designs of some chamfers land too hard, but at the new angles alone."""

    def __init__(self, hard: set[float], most: int | None = None) -> None:
        super().__init__(most)
        self.hard = hard

    def __call__(self, block: Block) -> Iterator[Record]:
        for row in super().__call__(block):
            fails = round(row["chamfer_deg"], 6) in self.hard and (block.seed or 0) >= NEW_ANGLES
            hardest = landing_record(Landing((1e7,) * len(OVERLAPS))) if fails else {}
            yield {**row, **hardest}


Opened = tuple[SearchState, Executor, Landings]
Open = Callable[..., Opened]


@pytest.fixture(scope="module")
def study() -> Setup:
    return load_study("mq200_paper", SETTINGS)


@pytest.fixture(scope="module")
def ended(study: Setup, tmp_path_factory: pytest.TempPathFactory) -> tuple[optuna.Study, Path]:
    """Trials and shifts of a search that has ended."""
    trials = optuna.create_study(directions=["minimize"] * 2)
    shifts = tmp_path_factory.mktemp("ended") / "shifts"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("dogshape.pipeline.simulate.executor.run_block", MadeUp())
        search, executor = Search(study, trials), Executor(ShiftJournal(shifts), 1)
        run(search, sampler_factory(study, None), executor, lambda *_: None)
    return trials, shifts


@pytest.fixture
def opened(
    study: Setup,
    ended: tuple[optuna.Study, Path],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> Open:
    """Open the search as a new process would; designs that are named fail at new angles."""
    trials, kept = ended

    def opening(failing: list[int], shifts: str = "one", most: int | None = None) -> Opened:
        state, path = Search(study, trials).read(), tmp_path / shifts
        if not path.exists():
            shutil.copy(kept, path)
        hard = {round(t.params["chamfer_deg"], 6) for t in state.trials if t.number in failing}
        landings = Landings(hard, most)
        monkeypatch.setattr("dogshape.pipeline.simulate.executor.run_block", landings)
        return state, Executor(ShiftJournal(path), 1), landings

    return opening


def _confirmed(state: SearchState, executor: Executor) -> tuple[dict[str, Any], SearchState]:
    found, after = confirm(state, executor, lambda _count, _line: None)
    assert found is not None
    return found, after


def _front(state: SearchState, without: set[int]) -> list[int]:
    """The designs that nothing but ``without`` beats, best first, by comparing each with each."""
    values = {
        t.number: state.losses[t.number].tolist() for t in state.feasible if t.number not in without
    }
    kept = [
        number
        for number, own in values.items()
        if not any(o[0] <= own[0] and o[1] <= own[1] and o != own for o in values.values())
    ]
    return sorted(kept, key=lambda number: values[number][0])


def _trials(found: dict[str, Any]) -> list[int]:
    return [one["trial"] for one in found["designs"]]


def _failed(found: dict[str, Any]) -> list[int]:
    return [d["trial"] for d in found["designs"] if not all(c["passed"] for c in d["checks"])]


def _dominating(state: SearchState) -> int:
    """The first design of the front that alone dominates others."""
    whole = _front(state, set())
    return next(one for one in whole if len(_front(state, {one})) >= len(whole))


def test_where_all_pass_the_first_of_the_front_are_confirmed(opened: Open) -> None:
    state, executor, landings = opened([])
    found, after = _confirmed(state, executor)
    assert _trials(found) == _front(state, set())[:WANTED]
    assert found["chosen"] == _trials(found)[0]
    assert not after.findings.unfit
    assert len(landings.keys) <= most_to_confirm(state.study, WANTED)


def test_what_a_failing_design_dominated_is_on_the_front_and_confirmed(opened: Open) -> None:
    """Of the designs confirmed those that pass are the first of the front without the failed."""
    first = _dominating(opened([])[0])
    state, executor, _ = opened([first])
    before = [trial.number for trial in state.front]
    expected = _front(state, {first})
    assert set(expected) - set(before)
    found, after = _confirmed(state, executor)
    assert after.findings.unfit == {first} == set(_failed(found))
    assert [trial.number for trial in after.front] == expected
    assert [trial for trial in _trials(found) if trial != first] == expected[:WANTED]
    assert found["chosen"] == expected[0]


def test_what_those_designs_dominated_comes_next_when_they_fail(opened: Open) -> None:
    state = opened([])[0]
    first = _dominating(state)
    second = next(t for t in _front(state, {first}) if t not in _front(state, set()))
    failing = {first, second}
    state, executor, _ = opened([*failing])
    found, after = _confirmed(state, executor)
    passed = [trial for trial in _trials(found) if trial not in failing]
    assert after.findings.unfit == failing
    assert passed == _front(after, set())[:WANTED] == _front(opened([])[0], failing)[:WANTED]
    assert found["chosen"] == passed[0]


def test_no_more_than_twice_as_many_are_simulated(opened: Open) -> None:
    """Where none passes, the first of all is chosen, as it was."""
    state = opened([])[0]
    every = [trial.number for trial in state.feasible]
    assert len(every) > MOST_CONFIRMED * WANTED
    first = _front(state, set())[0]
    state, executor, landings = opened(every)
    found, after = _confirmed(state, executor)
    assert _failed(found) == _trials(found)
    assert len(found["designs"]) == len(after.findings.unfit) == MOST_CONFIRMED * WANTED
    assert found["chosen"] == first == _trials(found)[0]
    assert len(landings.keys) <= most_to_confirm(state.study, MOST_CONFIRMED * WANTED)


def test_those_confirmed_stand_in_the_order_of_the_search(opened: Open) -> None:
    state = opened([])[0]
    failing = _front(state, set())[:2]
    state, executor, _ = opened(failing)
    found, _ = _confirmed(state, executor)
    times = {number: losses[0] for number, losses in state.losses.items()}
    assert [times[n] for n in _trials(found)] == sorted(times[n] for n in _trials(found))
    assert _failed(found) == failing


@pytest.mark.parametrize("share", [0.3, 0.8])
def test_a_confirmation_that_was_cut_off_ends_as_it_would_have(share: float, opened: Open) -> None:
    """The same designs and front, and no shift twice."""
    failing = _front(opened([])[0], set())[:2]
    state, executor, whole = opened(failing, "whole")
    found, after = _confirmed(state, executor)
    cut = int(share * len(whole.keys))
    with pytest.raises(CutOffError):
        _confirmed(*opened(failing, "cut", cut)[:2])
    again, other, rest = opened(failing, "cut")
    ended, last = _confirmed(again, other)
    assert ended == found
    assert len(rest.keys) == len(whole.keys) - cut
    assert set(other.journal.rows) == set(executor.journal.rows)
    assert collect(last, other.journal) == collect(after, executor.journal)


def test_a_study_ends_with_the_front_of_what_did_not_fail(
    study: Setup,
    ended: tuple[optuna.Study, Path],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Report and table show what failed, as failed; what replication changed stays as it was."""
    state = Search(study, ended[0]).read()
    first = state.trials[_dominating(state)]
    hard = {round(first.params["chamfer_deg"], 6)}
    monkeypatch.setattr("dogshape.pipeline.study.MIN_DESIGNS", 99)  # no surrogate of shifts made up
    results = []
    for name, failing in (("passes", set[float]()), ("fails", hard)):
        monkeypatch.setattr("dogshape.pipeline.simulate.executor.run_block", Landings(failing))
        again = load_study("mq200_paper", [*SETTINGS, "search.replicate=0.1"])
        how = Run(StudyFolder(tmp_path / name), 1, report=False)
        results.append(run_study(again, how))
    passes, fails = results
    shown, over = ([row["trial"] for row in r["front"]] for r in (fails, passes))
    assert first.number in over
    assert first.number not in shown
    assert fails["best"]["trial"] in shown
    assert [row["trial"] for row in failed_at_new_angles(fails)] == [first.number]
    table = [row["trial"] for row in designs_shown(fails)]
    assert table == [*({0} - {*shown}), *shown, first.number]
    assert first.number in [row["trial"] for row in of_kinds(fails)["fails when simulated"]]
    assert all("probability_on_front" in row for row in fails["front"])
    assert "probability_on_front" not in fails["trials"][first.number]
    frame = designs_frame(fails, list(study.variables)).set_index("trial")
    assert frame.index[frame["failed_at_fresh_angles"]].tolist() == [first.number]
    assert frame.index[frame["on_front"]].tolist() == sorted(shown)
    assert fails["replication"] == passes["replication"]
