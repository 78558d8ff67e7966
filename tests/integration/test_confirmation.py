"""Confirmation on times made up: some designs were lucky in the search, or land too hard later."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import optuna
import pytest

from dogshape.pipeline.config.study_file import Setup, load_study
from dogshape.pipeline.reports.designs import (
    failed_at_new_angles,
    simulated_frame,
)
from dogshape.pipeline.search.confirmation import Executors, confirm, shifts_to_confirm
from dogshape.pipeline.search.result_schema import require_result
from dogshape.pipeline.search.search import Search, run, sampler_of
from dogshape.pipeline.search.state import SearchState
from dogshape.pipeline.simulate.evaluation import NEW_ANGLES
from dogshape.pipeline.simulate.executor import Executor
from dogshape.pipeline.store.folder import StudyFolder
from dogshape.pipeline.store.journal import ShiftJournal
from dogshape.pipeline.study import Run, collect, run_study
from dogshape.sim.shift.loads import OVERLAPS, Landing
from dogshape.sim.statistics.blocks import Block
from dogshape.sim.statistics.shift_records import Record, landing_record
from tests.conftest import SMALL

SETTINGS = [
    *SMALL,
    "solver.engine=drake",
    "expectation.angles=4",
    "search.sampler=space_filling",
    "search.trials=24",
    "search.confirm_designs=24",
]
LATE = 0.02  #: s that a design takes longer at the new angles, where it was lucky in the search


class CutOffError(Exception):
    """Stands for the end of a process."""


def _mean(given: Mapping[str, Any]) -> float:
    """Return the true expected time: short dogs take long, and one design more than another."""
    return 0.09 + 0.006 * (4.2 - given["height_mm"]) + 0.012 * (given["braking_deg"] % 1.0)


def _time(given: Record) -> float:
    """Return the time of a shift: a saw-tooth round the pitch."""
    turned = given["relative_angle_deg"] * given["count"] / 360.0
    place = (turned + 7.3 * given["height_mm"] + 0.31 * given["chamfer_deg"]) % 1.0
    return _mean(given) + 0.03 * (place - 0.5)


class MadeUp:
    """Simulates by a formula; ends the process after ``most`` shifts, if that is given.

    At the new angles designs whose chamfer is ``hard`` land too hard, and those whose chamfer is
    ``lucky`` take longer. Of those whose chamfer is ``blocked`` one shift in three or four engages.
    """

    def __init__(
        self, hard: set[float] | None = None, lucky: set[float] | None = None,
        most: int | None = None, blocked: Callable[[float], bool] = lambda _: False,
    ) -> None:  # fmt: skip
        self.keys: list[str] = []
        self.hard, self.lucky, self.most = hard or set(), lucky or set(), most
        self.blocked = blocked

    def __call__(self, block: Block) -> Iterator[Record]:
        new = (block.seed or 0) >= NEW_ANGLES
        for key, given in zip(block.keys, block.inputs, strict=True):
            if block.clutch.solver.engine == "drake":  # the gain under other contact is not kept
                if len(self.keys) == self.most:
                    raise CutOffError
                self.keys.append(key)
            own = round(given["chamfer_deg"], 6)
            load = 1e7 if new and own in self.hard else 0.0
            stuck = self.blocked(given["chamfer_deg"]) and block.keys.index(key) % 4 != 0
            time = _time(given) + LATE * (new and own in self.lucky)
            yield {
                "key": key, **given, "outcome": "blocked" if stuck else "engaged",
                "seed": block.seed, "shift_time_s": None if stuck else time,
                "peak_axial_force_N": 1e3, "peak_tangential_force_N": 1e3,
                **landing_record(Landing((load,) * len(OVERLAPS))),
            }  # fmt: skip


Opened = tuple[SearchState, Executors, MadeUp]
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
        executor = Executor(ShiftJournal(shifts), 1)
        run(Search(study, trials, sampler_of(study)), executor, lambda *_: None)
    return trials, shifts


@pytest.fixture
def opened(
    study: Setup,
    ended: tuple[optuna.Study, Path],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> Open:
    """Open the search as a new process would; designs that are named fail, or were lucky."""
    trials, kept = ended

    def opening(
        hard: list[int], lucky: list[int] | None = None, *, shifts: str = "one",
        most: int | None = None, budget: int = 24,
    ) -> Opened:  # fmt: skip
        own = load_study("mq200_paper", [*SETTINGS, f"search.confirm_designs={budget}"])
        state = Search(own, trials, sampler_of(own)).read()
        paths = tmp_path / f"{shifts}-search", tmp_path / shifts
        if not paths[0].exists():
            shutil.copy(kept, paths[0])
        chamfers = {t.number: round(t.params["chamfer_deg"], 6) for t in state.trials}
        those = ({chamfers[n] for n in numbers or []} for numbers in (hard, lucky))
        made_up = MadeUp(*those, most)
        monkeypatch.setattr("dogshape.pipeline.simulate.executor.run_block", made_up)
        return state, Executors(*(Executor(ShiftJournal(path), 1) for path in paths)), made_up

    return opening


def _confirmed(state: SearchState, executors: Executors) -> tuple[dict[str, Any], SearchState]:
    found, after = confirm(state, executors, lambda _count, _line: None)
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


def _trials(found: Mapping[str, Any]) -> list[int]:
    return [one["trial"] for one in found["designs"]]


def _dominating(state: SearchState) -> int:
    """The first design of the front that alone dominates others."""
    whole = _front(state, set())
    return next(one for one in whole if len(_front(state, {one})) >= len(whole))


def test_the_whole_front_is_confirmed_and_has_the_values_of_the_new_angles(opened: Open) -> None:
    state, executor, made_up = opened([])
    found, after = _confirmed(state, executor)
    values = {one["trial"]: one["expected_shift_time_s"] for one in found["designs"]}
    assert [t.number for t in after.front] == _front(after, set())
    assert {t.number for t in after.front} <= {*values}
    assert {*_front(state, set())} <= {*values}
    assert found["left_out"] == []
    for trial in after.front:
        assert after.losses[trial.number][0] == values[trial.number]
        assert (trial.estimates or {})["expected_shift_time_s"].value == values[trial.number]
    assert found["chosen"] == next(
        n for n in _trials(found) if n in [t.number for t in after.front]
    )
    by_contact = {one["contact"]: one["gain_s"] for one in found["gains_by_contact"]}
    assert [*by_contact] == [
        "friction 0.0667", "friction 0.133", "dissipation 1 s/m", "dissipation 60 s/m"
    ]  # fmt: skip
    chosen = next(t for t in state.trials if t.number == found["chosen"])
    true = _mean(state.study.prototype) - _mean(chosen.params)
    assert [*by_contact.values()] == pytest.approx([true] * 4, abs=2e-3)
    assert len(made_up.keys) <= shifts_to_confirm(state.study, len(values))


def test_a_design_that_was_lucky_in_the_search_leaves_the_front(opened: Open) -> None:
    """What it had beaten is confirmed, and the record says how far search and new angles differ."""
    first = _dominating(opened([])[0])
    state, executor, _ = opened([], [first])
    found, after = _confirmed(state, executor)
    assert first not in [t.number for t in after.front]
    assert {*_front(state, {first})} <= {*_trials(found)}
    assert found["chosen"] != first
    one = next(one for one in found["designs"] if one["trial"] == first)
    value, error = one["searched"]["value"], one["searched"]["standard_error"]
    off = one["expected_shift_time_s"] - value
    assert off > 0.5 * LATE
    expected = off / (error**2 + one["standard_error_s"] ** 2) ** 0.5
    assert one["errors_apart"] == pytest.approx(expected)
    assert one["agrees"] == (abs(expected) <= 3.0)


def test_what_is_beyond_the_budget_is_left_out_and_said(opened: Open) -> None:
    budget = 2
    state, executor, made_up = opened([], budget=budget)
    assert len(state.front) > budget
    found, after = _confirmed(state, executor)
    assert len(_trials(found)) == budget
    assert found["left_out"] == [t.number for t in after.front if not t.confirmed]
    assert found["left_out"]
    assert len(made_up.keys) <= shifts_to_confirm(state.study, budget)


def test_where_every_design_fails_the_first_of_the_search_is_chosen(opened: Open) -> None:
    state = opened([])[0]
    every = [trial.number for trial in state.feasible]
    state, executor, _ = opened(every)
    found, after = _confirmed(state, executor)
    assert {*_trials(found)} == {*every}
    assert not after.front
    assert found["chosen"] == _front(state, set())[0]


def test_a_confirmation_that_was_cut_off_ends_as_it_would_have(opened: Open) -> None:
    """The same designs and front, and no shift twice."""
    failing = _front(opened([])[0], set())[:2]
    state, executor, whole = opened(failing, shifts="whole")
    found, after = _confirmed(state, executor)
    cut = int(0.6 * len(whole.keys))
    with pytest.raises(CutOffError):
        _confirmed(*opened(failing, shifts="cut", most=cut)[:2])
    again, other, rest = opened(failing, shifts="cut")
    ended, last = _confirmed(again, other)
    assert ended == found
    assert len(rest.keys) == len(whole.keys) - cut
    assert set(other.kept.journal.rows) == set(executor.kept.journal.rows)
    assert collect(last, other.kept.journal) == collect(after, executor.kept.journal)


def test_a_study_ends_with_the_front_of_what_did_not_fail(
    study: Setup,
    ended: tuple[optuna.Study, Path],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Report and table show what failed, as failed; the trials stay those of the search."""
    state = Search(study, ended[0], sampler_of(study)).read()
    first = state.trials[_dominating(state)]
    hard = {round(first.params["chamfer_deg"], 6)}
    monkeypatch.setattr("dogshape.pipeline.study.MIN_DESIGNS", 99)  # no surrogate of shifts made up
    results = []
    for name, failing in (("passes", set[float]()), ("fails", hard)):
        monkeypatch.setattr("dogshape.pipeline.simulate.executor.run_block", MadeUp(failing))
        how = Run(StudyFolder(tmp_path / name), 1, report=False)
        results.append(run_study(study, how))
    passes, fails = results
    shown, over = ([row["trial"] for row in r["front"]] for r in (fails, passes))
    assert first.number in over
    assert first.number not in shown
    assert fails["best"]["trial"] in shown
    assert [row["trial"] for row in failed_at_new_angles(fails)] == [first.number]
    frame = simulated_frame(fails, list(study.variables)).set_index("trial")
    assert frame.index[frame["failed_at_fresh_angles"]].tolist() == [first.number]
    assert frame.index[frame["on_front"]].tolist() == sorted(shown)
    assert fails["trials"] == passes["trials"]


def test_designs_that_do_not_engage_have_no_time_and_no_gain(
    study: Setup, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The prototype, of 8 degrees, and others; none is ranked by the retries of a time-out."""
    blocked = MadeUp(blocked=lambda chamfer: chamfer < 9.0)
    monkeypatch.setattr("dogshape.pipeline.study.MIN_DESIGNS", 99)
    monkeypatch.setattr("dogshape.pipeline.simulate.executor.run_block", blocked)
    folder = StudyFolder(tmp_path / "out")
    result = run_study(study, Run(folder, 1, report=True))
    require_result(result, "the result")
    page = folder.report.read_text("utf-8")
    silent = [row for row in result["trials"] if "engagement" in row["failed"]]
    assert 0 in [row["trial"] for row in silent]
    assert all(row["expected_shift_time_s"] is None and not row["feasible"] for row in silent)
    assert all(row["engaged"] < 0.5 for row in silent)
    assert "faster" not in page
    confirmation = result["confirmation"]
    assert result["best"]["engaged"] == 1.0
    assert all(row["engaged"] == 1.0 for row in result["front"])
    assert confirmation["prototype"]["engages"] is False
    assert confirmation["prototype"]["expected_shift_time_s"] is None
    assert confirmation["gain_s"] is confirmation["gain_share"] is None
    assert confirmation["gains"] == {}
    count = confirmation["prototype"]["shifts"]
    assert f"{count} of {count} shifts; prototype {count // 3} of {count}" in page
    assert f"engages in {count // 3} of {count}<" in page
