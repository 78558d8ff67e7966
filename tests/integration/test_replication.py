"""Replication of a search whose shifts are made up, so that the true front is known."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import optuna
import pytest
from optuna.trial import FrozenTrial

from dogshape.pipeline.config.schema import REPLICATE
from dogshape.pipeline.config.study_file import Setup, load_study
from dogshape.pipeline.search.dog_guide import DogGuide
from dogshape.pipeline.search.front_uncertainty import Drawn, draw, standings
from dogshape.pipeline.search.replication import (
    HIGH,
    LOW,
    Replication,
    replicate,
    replication_record,
    telling,
)
from dogshape.pipeline.search.rounds import run
from dogshape.pipeline.search.samplers import sampler_factory
from dogshape.pipeline.search.search import Search
from dogshape.pipeline.search.state import SearchState
from dogshape.pipeline.simulate.design import SIMULATED
from dogshape.pipeline.simulate.executor import Executor
from dogshape.pipeline.simulate.point_plans import most_to_replicate
from dogshape.pipeline.store.folder import comparable
from dogshape.pipeline.store.journal import ShiftJournal
from dogshape.pipeline.study import collect
from dogshape.sim.shift.loads import OVERLAPS, Landing
from dogshape.sim.statistics.blocks import Block
from dogshape.sim.statistics.shift_records import Record, content_key, landing_record
from dogshape.surrogate.hypervolume import not_dominated
from tests.conftest import SMALL

LENGTH = "axial_length_mm"
MADE_UP = [
    *SMALL,
    "expectation.angles=4",
    "search.sampler=space_filling",
    "search.trials=24",
    "search.replicate=3.0",
]
PARTIAL = [
    "operating.mismatch_rpm=[25, 50, 100, 149]",
    "operating.force_N=[315.5, 641.5]",
    "search.points=3",
    "search.replicate=0.5",
]


class CutOffError(Exception):
    """Stands for the end of a process."""


def _mean(design: Record) -> float:
    """Return the true expected time: short dogs take long, and one design more than another."""
    return 0.09 + 0.006 * (4.2 - design["height_mm"]) + 0.012 * (design["braking_deg"] % 1.0)


def _time(given: Record) -> float:
    """Return the time of a shift: a saw-tooth round the pitch, whose place differs by design."""
    turned = given["relative_angle_deg"] * given["count"] / 360.0
    place = (turned + 7.3 * given["height_mm"] + 0.31 * given["chamfer_deg"]) % 1.0
    return _mean(given) + 0.03 * (place - 0.5)


class MadeUp:
    """Simulates by a formula; ends the process after ``most`` shifts, if that is given."""

    def __init__(self, most: int | None = None) -> None:
        self.keys: list[str] = []
        self.most = most

    def __call__(self, block: Block) -> Iterator[Record]:
        for key, given in zip(block.keys, block.inputs, strict=True):
            if len(self.keys) == self.most:
                raise CutOffError
            self.keys.append(key)
            yield {
                "key": key, **given, "outcome": "engaged", "shift_time_s": _time(given),
                "peak_axial_force_N": 1e3, "peak_tangential_force_N": 1e3,
                **landing_record(Landing()), "seed": block.seed,
            }  # fmt: skip


Opened = tuple[SearchState, Executor, MadeUp]
Ended = Callable[..., Opened]


def _study(*more: str) -> Setup:
    return load_study("mq200_paper", [*MADE_UP, *more])


@pytest.fixture(scope="module")
def kept(tmp_path_factory: pytest.TempPathFactory) -> dict[str, tuple[optuna.Study, Path]]:
    """Trials and shifts of searches that have ended, by their configuration, run when needed."""
    return {"": (optuna.create_study(), tmp_path_factory.mktemp("searches"))}


@pytest.fixture
def ended(
    kept: dict[str, tuple[optuna.Study, Path]], monkeypatch: pytest.MonkeyPatch
) -> Callable[..., Opened]:
    """Return what opens an ended search as a new process would; further shifts are made up, too."""

    def searched(study: Setup, trials: optuna.Study, shifts: Path, most: int | None) -> Opened:
        made_up = MadeUp(most)
        monkeypatch.setattr("dogshape.pipeline.simulate.executor.run_block", made_up)
        search = Search(study, trials, guide=DogGuide(study))
        executor = Executor(ShiftJournal(shifts), 1)
        state = run(search, sampler_factory(study, search.guide), executor, lambda *_: None)
        return state, executor, made_up

    def opened(study: Setup, shifts: Path, most: int | None = None) -> Opened:
        mark = content_key(comparable(study.file))
        if mark not in kept:
            directions = ["minimize"] * len(study.file.search.objectives)
            found = optuna.create_study(directions=directions), kept[""][1] / mark
            searched(study, *found, None)
            kept[mark] = found
        if not shifts.exists():
            shutil.copy(kept[mark][1], shifts)
        return searched(study, kept[mark][0], shifts, most)

    return opened


def _replicated(state: SearchState, executor: Executor) -> tuple[Replication, SearchState]:
    return replicate(state, executor, lambda _left, _line: None)


def _unclear(state: SearchState) -> list[int]:
    drawn = draw(state)
    pairs = zip(drawn.trials, drawn.probabilities, strict=True)
    return [trial.number for trial, chance in pairs if LOW < chance < HIGH]


def _true(state: SearchState) -> dict[int, bool]:
    """Whether each feasible design is on the front of the true times."""
    trials = state.feasible
    values = np.array([state.losses[trial.number] for trial in trials])
    place = state.study.file.search.objectives.index(SIMULATED)
    values[:, place] = [_mean(trial.params) for trial in trials]
    return {t.number: bool(on) for t, on in zip(trials, not_dominated(values), strict=True)}


def _right(state: SearchState) -> int:
    """Number of designs whose place on the front is the true one."""
    shown = {trial.number for trial in state.front}
    return sum((number in shown) == on for number, on in _true(state).items())


def _errors(state: SearchState) -> dict[int, float]:
    return {t.number: state.value(t, SIMULATED)[1] for t in state.feasible}


@pytest.mark.parametrize("objectives", [[SIMULATED, LENGTH], [SIMULATED]])
def test_replication_finds_the_true_front(
    objectives: list[str], tmp_path: Path, ended: Ended
) -> None:
    """With one objective, the best design: it is the front."""
    state, executor, _ = ended(_study(f"search.objectives={objectives}"), tmp_path / "one")
    right = _right(state)
    done, after = _replicated(state, executor)
    assert len(done.unclear[1]) <= len(done.unclear[0]) / 2
    assert done.misplaced[1] < 0.5 * done.misplaced[0]
    assert _right(after) >= max(right, len(after.feasible) - 1)
    assert _right(after) > right or right == len(after.feasible)
    true, stand = _true(after), standings(after)
    clear = {n: s.probability > 0.5 for n, s in stand.items() if n not in done.unclear[1]}
    assert clear == {number: true[number] for number in clear}


def test_more_is_known_of_the_unclear_designs_alone(
    tmp_path: Path,
    kept: dict[str, tuple[optuna.Study, Path]],
    ended: Ended,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Trials, and the state before, stay as they were told."""
    study, rounds = _study(), list[set[int]]()
    state, executor, _ = ended(study, tmp_path / "one")
    errors, stand, first = _errors(state), standings(state), _unclear(state)
    told = {t.number: t.values for t in state.trials}

    def drawing(now: SearchState) -> Drawn:
        rounds.append(set(_unclear(now)))
        return draw(now)

    monkeypatch.setattr("dogshape.pipeline.search.replication.draw", drawing)
    done, after = _replicated(state, executor)
    more = {t.number for t in after.feasible if sum(after.plan(t)) > done.searched[t.number]}
    assert done.unclear == (first, _unclear(after))
    assert set(first) <= more <= set.union(*rounds)
    assert len(more) < len(errors) - 4
    now = standings(after)
    for number, error in _errors(after).items():
        if number in more:
            assert error < 0.8 * errors[number]
            assert now[number].high - now[number].low < stand[number].high - stand[number].low
        else:
            assert error == errors[number]
            assert now[number].low == stand[number].low
    stored = kept[content_key(comparable(study.file))][0].get_trials(deepcopy=False)
    assert {t.number: t.values for t in stored} == told
    assert (_errors(state), standings(state)) == (errors, stand)


@pytest.mark.parametrize("more", [["search.replicate=0.5"], PARTIAL])
@pytest.mark.parametrize("share", [pytest.param(0.3, marks=pytest.mark.slow), 0.9])
def test_a_replication_that_was_cut_off_ends_as_it_would_have(
    more: list[str], share: float, tmp_path: Path, ended: Ended
) -> None:
    """The same designs, shifts and standings, and no shift twice."""
    study = _study(*more)
    state, executor, whole = ended(study, tmp_path / "whole")
    done, after = _replicated(state, executor)
    assert done.rounds > 1
    assert len(whole.keys) == done.shifts
    cut = int(share * done.shifts)
    with pytest.raises(CutOffError):
        _replicated(*ended(study, tmp_path / "cut", cut)[:2])
    again, other, rest = ended(study, tmp_path / "cut")
    same, last = _replicated(again, other)
    assert same == done
    assert standings(last) == standings(after)
    assert set(other.journal.rows) == set(executor.journal.rows)
    assert len(rest.keys) == len(whole.keys) - cut
    records = [replication_record(one, done) for one in (last, after)]
    assert collect(last, other.journal, records[0]) == collect(after, executor.journal, records[1])


def test_points_that_were_predicted_are_simulated(tmp_path: Path, ended: Ended) -> None:
    """The error of predicted times shrinks, by new operating points and by more angles."""
    state, executor, _ = ended(_study(*PARTIAL), tmp_path / "one")
    errors, plans = _errors(state), {t.number: state.plan(t) for t in state.feasible}
    assert all(sum(count > 0 for count in plan) in (3, 8) for plan in plans.values())
    done, after = _replicated(state, executor)
    more = [t for t in after.feasible if after.plan(t) != plans[t.number]]
    assert 2 < len(more) < len(plans)
    for trial in more:
        assert after.value(trial, SIMULATED)[1] < errors[trial.number]
        rows = trial.user_attrs["rows"]
        assert sum(row[-2] for row in rows) == sum(after.plan(trial))
        assert len(rows) == sum(count > 0 for count in after.plan(trial))
    assert sum(len(t.user_attrs["rows"]) for t in more) > 3 * len(more)
    assert 0 < done.shifts <= done.budget


@pytest.mark.parametrize("share", [0.02, 0.1, 0.5])
def test_replication_keeps_to_its_budget(share: float, tmp_path: Path, ended: Ended) -> None:
    study = _study(f"search.replicate={share}")
    state, executor, made_up = ended(study, tmp_path / "one")
    before = len(executor.journal.rows)
    done, _ = _replicated(state, executor)
    assert done.budget == most_to_replicate(study, before) == int(share * before)
    assert done.budget - 8 < done.shifts == len(made_up.keys) <= done.budget


def test_without_a_budget_nothing_is_replicated(tmp_path: Path, ended: Ended) -> None:
    state, executor, made_up = ended(_study("search.replicate=0"), tmp_path / "one")
    done, after = _replicated(state, executor)
    assert (done.budget, done.shifts, done.rounds) == (0, 0, 0)
    assert done.unclear[0] == done.unclear[1] == _unclear(after)
    assert not made_up.keys


def test_the_result_says_what_replication_changed(tmp_path: Path, ended: Ended) -> None:
    state, executor, made_up = ended(_study("search.replicate=0.5"), tmp_path / "one")
    stand = standings(state)
    done, after = _replicated(state, executor)
    result = collect(after, executor.journal, replication_record(after, done))
    said = result["replication"]
    assert said == replication_record(after, done)
    assert said["shifts"] == sum(d["shifts"] - d["shifts_before"] for d in said["designs"])
    assert said["shifts"] == len(made_up.keys) > 0
    assert result["n_simulated_shifts"] == sum(row["shifts"] for row in result["trials"])
    rows = {row["trial"]: row for row in result["trials"]}
    shown = {row["trial"] for row in result["front"]}
    assert shown <= {one["trial"] for one in said["designs"]}
    for one in said["designs"]:
        row = rows[one["trial"]]
        assert one["shifts"] == row["shifts"] >= one["shifts_before"] == 8
        assert one["probability_on_front"] == row["probability_on_front"]
        assert one["probability_on_front_before"] == stand[one["trial"]].probability
        assert one["on_front"] == (one["trial"] in shown)


def test_a_design_that_lands_too_hard_at_more_angles_leaves_the_front(
    tmp_path: Path, ended: Ended, monkeypatch: pytest.MonkeyPatch
) -> None:
    state, executor, made_up = ended(_study(), tmp_path / "one")
    first = next(t for t in state.front if t.number in _unclear(state))
    hardest = landing_record(Landing((1e7,) * len(OVERLAPS)))

    def hard(block: Block) -> Iterator[Record]:
        for row in made_up(block):
            same = row["chamfer_deg"] == pytest.approx(first.params["chamfer_deg"])
            yield {**row, **(hardest if same else {})}

    monkeypatch.setattr("dogshape.pipeline.simulate.executor.run_block", hard)
    done, after = _replicated(state, executor)
    assert first.number in done.unclear[0]
    assert first.number not in {trial.number for trial in [*after.feasible, *after.front]}
    said: list[dict[str, Any]] = replication_record(after, done)["designs"]
    (one,) = [one for one in said if one["trial"] == first.number]
    assert one["on_front_before"]
    assert not one["on_front"]
    assert one["probability_on_front"] is None


@pytest.mark.parametrize("more", [["search.replicate=0.5"], PARTIAL])
def test_a_state_lists_the_storage_once_and_its_use_never(
    more: list[str],
    tmp_path: Path,
    kept: dict[str, tuple[optuna.Study, Path]],
    ended: Ended,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    study, listed = _study(*more), list[int]()
    _, executor, _ = ended(study, tmp_path / "one")
    search = Search(study, kept[content_key(comparable(study.file))][0], guide=DogGuide(study))
    listing = optuna.Study.get_trials

    def counted(self: optuna.Study, *given: Any, **named: Any) -> list[FrozenTrial]:
        listed.append(1)
        return listing(self, *given, **named)

    monkeypatch.setattr(optuna.Study, "get_trials", counted)
    state = search.read()
    assert len(listed) == 1
    done, after = _replicated(state, executor)
    assert done.rounds > 0
    result = collect(after, executor.journal, replication_record(after, done))
    assert [row["trial"] for row in result["front"]] == [trial.number for trial in after.front]
    assert len(listed) == 1


def test_what_a_design_tells() -> None:
    """Of two that cannot be told apart and one that is far: the one of the larger error."""
    rng = np.random.default_rng(1)
    times = np.array([0.060, 0.0605, 0.090]) + rng.standard_normal((2000, 3)) * [1e-3, 4e-3, 4e-3]
    values = times[:, :, None]
    drawn = Drawn([], values, not_dominated(values))
    told = [telling(drawn, place) for place in range(3)]
    assert told[1] > 3.0 * told[0] > 0.0
    assert told[1] == pytest.approx(drawn.misplaced, rel=0.3)
    assert abs(told[2]) < 0.05


def test_what_replication_may_take_may_change_between_runs() -> None:
    file = load_study("mq200_paper", ["search.replicate="]).file
    assert file.search.replicate == REPLICATE
    assert "replicate" not in file.search.model_dump()
    assert comparable(file) == comparable(load_study("mq200_paper", ["search.replicate=0"]).file)
