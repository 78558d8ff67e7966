"""The search: reproducible, resumable, never simulating what cannot be built; rounds cut off."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import optuna
import pytest
from optuna.trial import FrozenTrial, TrialState

import dogshape as ds
from dogshape.check import check_design
from dogshape.pipeline.config.schema import VariablesSection
from dogshape.pipeline.config.study_file import Setup, build_study, load_study, pair_of
from dogshape.pipeline.search.confirmation import NEAREST
from dogshape.pipeline.search.sampler import Guide, Space, SurrogateSampler
from dogshape.pipeline.search.search import Search, finish_round, next_round, sampler_of
from dogshape.pipeline.search.state import SIMULATION
from dogshape.pipeline.simulate.design import CheckInputs, design_of, worth_simulating
from dogshape.pipeline.simulate.evaluation import Evaluation
from dogshape.pipeline.simulate.executor import scratch_executor
from dogshape.pipeline.store.folder import ShiftJournal, append
from dogshape.pipeline.study import run_study
from dogshape.pipeline.train.training_rows import stored_surrogate
from dogshape.sim.errors import InputError, StorageError
from dogshape.sim.shift.conclusion import Outcome
from dogshape.sim.statistics.expectation import Estimate, ShiftResult, expect, expect_point
from dogshape.sim.strength.landing import Demand
from dogshape.sim.units import RPM
from tests.conftest import SMALL, Listener, search_run
from tests.integration.studies import Finished, designs_of, lines_of


def test_ridge_backlash_and_mechanism_are_in_every_part_of_a_search(tmp_path: Path) -> None:
    """Designs, shifts, confirmation, surrogate and folder, by the compiled engine."""
    keys = {"dog.crest": 0.5, "dog.chamfer_back_deg": 12.0, "search.trials": 11}
    ranges = {"crest": [0.3, 0.7], "chamfer_back_deg": [8.0, 18.0], "backlash_mm": [0.0, 0.3]}
    searched = {f"variables.{key}": ends for key, ends in ranges.items()}
    own = {"mechanism.spline_friction": 0.1, "mechanism.delay_s": 0.05, "effects.drag_torque": 0.2}
    small = {**dict(map(pair_of, SMALL)), **keys, **searched, "solver.engine": "planar"}
    study, plain = (load_study("mq200_paper", small | more) for more in (own, {}))
    result = run_study(study, search_run(tmp_path, jobs=1)).to_dict()
    assert result["physics_hash"] == study.physics_hash
    assert result["trials"][0]["backlash_mm"] == 0.0
    for row in result["trials"][1:]:
        assert all(low <= row[key] <= high for key, (low, high) in study.variables.items())
    kept = [json.loads(line) for line in lines_of(tmp_path, "shifts.jsonl")]
    expected = {"mechanism_spline_friction": 0.1, "mechanism_drag_torque_Nm": 0.2,
                "force_delay_s": 0.05}  # fmt: skip
    assert all(row.items() >= expected.items() and "engine" not in row for row in kept)
    stored, path = stored_surrogate(study, tmp_path / "surrogate.json")
    assert stored.surrogate.data.variables == tuple(study.variables)
    assert stored.surrogate.data.physics == study.physics
    assert check_design(study, surrogate=path).to_dict()["low_s"] > 0.06
    with pytest.raises(InputError, match="mechanism_spline_friction is absent here"):
        check_design(plain, surrogate=path)


def test_a_study_ends_with_everything(finished: Finished) -> None:
    folder, result = finished.folder, finished.result
    assert len(result["trials"]) == 12
    assert result["trials"][0]["prototype"]
    assert result["trials"][0]["count"] == 15
    confirmed, best = result["confirmation"]["designs"], result["best"]
    times = [row["expected_shift_time_s"] for row in result["trials"]]
    assert times[best["trial"]] == min(times)
    assert confirmed[0]["trial"] == best["trial"]
    assert best["expected_shift_time_s"] == confirmed[0]["expected_shift_time_s"]
    assert {row["trial"] for row in result["front"]} <= {d["trial"] for d in confirmed}
    # At the new angles twice as many of the compiled engine, three of them of Drake too.
    shifts = [design["shifts"] for design in confirmed]
    assert {count % 12 for count in shifts} == {0}
    assert result["n_simulated_shifts"] == 12 * 6 + sum(shifts) + 6 * len(confirmed)
    assert len(lines_of(folder, "shifts.jsonl")) == 2 * 6 + 4  # of confirmation and audit, in Drake
    assert not (folder / "running.jsonl").read_text()
    assert result["audit"]["shifts"] == 4
    assert result["audit"]["agrees"]
    assert all(one["drake"]["shifts"] == 6 and one["drake"]["agrees"] for one in confirmed)
    assert result["confirmation"]["gain_s"] == pytest.approx(
        result["confirmation"]["prototype"]["expected_shift_time_s"]
        - result["confirmation"]["best"]["expected_shift_time_s"]
    )
    gain = result["remaining_gain"]
    assert 0.0 <= gain["expected"] <= gain["upper"] < best["expected_shift_time_s"]
    for name in ("study.json", "trials.log", "surrogate.json"):
        assert (folder / name).stat().st_size > 0
    assert not (folder / "report.html").exists()
    assert not (folder / "shifts").exists()


def test_a_seed_gives_the_same_trials_on_more_workers(finished: Finished, tmp_path: Path) -> None:
    again = run_study(load_study("mq200_paper", SMALL), search_run(tmp_path, jobs=2)).to_dict()
    assert designs_of(again) == designs_of(finished.result)
    assert json.loads((tmp_path / "result.json").read_text()) == again


def test_a_journal_of_trials_is_mended_or_refused(
    finished: Finished, short: Finished, tmp_path: Path
) -> None:
    """One that a kill cut off goes on, also with more trials; a damaged one is refused."""
    study = load_study("mq200_paper", [*SMALL, "search.trials=4"])
    torn = short.copy(tmp_path / "torn")
    with (torn / "trials.log").open("ab") as file:
        file.write(b'{"op_code": 4, "worker')
    longer = run_study(
        load_study("mq200_paper", SMALL), search_run(torn, jobs=1, resume=True)
    ).to_dict()
    assert designs_of(longer) == designs_of(finished.result)
    tmp_path = short.copy(tmp_path / "broken")
    log = tmp_path / "trials.log"
    log.write_bytes(b"rubbish\n" + log.read_bytes())
    shifts = (tmp_path / "shifts.jsonl").read_bytes()
    with pytest.raises(StorageError, match=r"trials\.log is damaged; remove the file"):
        run_study(study, search_run(tmp_path, jobs=1, resume=True))
    log.unlink()
    again = run_study(study, search_run(tmp_path, jobs=1, resume=True)).to_dict()
    assert designs_of(again) == designs_of(short.result)
    assert (tmp_path / "shifts.jsonl").read_bytes() == shifts


def test_nothing_is_overwritten_without_resume(finished: Finished, tmp_path: Path) -> None:
    folder = finished.copy(tmp_path)
    before = {p: p.read_bytes() for p in folder.rglob("*") if p.is_file()}
    with pytest.raises(StorageError, match="holds a study already; add resume=True"):
        run_study(load_study("mq200_paper", SMALL), search_run(folder))
    other = load_study("mq200_paper", [*SMALL, "sliding.mass_kg=0.4"])
    words = r"another configuration \(sliding\.mass_kg was 0\.3 and is now 0\.4\); give the one"
    with pytest.raises(StorageError, match=words):
        run_study(other, search_run(folder, resume=True))
    assert {p: p.read_bytes() for p in folder.rglob("*") if p.is_file()} == before


def test_own_sampler_finds_the_minimum_of_a_known_function() -> None:
    """With the time replaced by a bowl, the process beats designs that only fill the space."""
    study = load_study("mq200_paper", [*SMALL, "search.objectives=['expected_shift_time_s']"])
    names, space = list(study.variables), Space(study.variables)
    low, high = np.array(list(study.variables.values())).T
    goal = np.array([12.0, 15.0, 18.0, 3.5, 20.0])
    best = {}
    for startup in (10, 1000):
        sampler = SurrogateSampler(Guide(study), seed=4, startup=startup)
        trials: list[FrozenTrial] = []
        for number in range(30):
            params = sampler.propose(trials)
            assert params is not None
            assert design_of(study, params).feasible
            design = np.array([params[n] for n in names])
            time = float(0.05 + 0.1 * (((design - goal) / (high - low)) ** 2).sum())
            at = [(p.mismatch / RPM, p.profile.force) for p in study.points]
            rows = [[*design, *where, time, 1e-4, 0.01, 6, 6, 1] for where in at]
            found = {"estimates": {"expected_shift_time_s": [time, 1e-4]}, "rows": rows}
            landed = {"demand_Pa": [0.0] * 3, "limited": {}, "engaged": 1.0, "shifts": 12}
            trial = space.trial(params, **{SIMULATION: found | landed})
            trial.state, trial.values, trial.number = TrialState.COMPLETE, [time], number
            trials.append(trial)
        best[startup] = min(trial.values[0] for trial in trials) - 0.05
        assert len({tuple(t.params.values()) for t in trials}) == 30
    assert best[10] < 0.25 * best[1000]


#: A search of the compiled engine, and each of its designs with its objectives as a line.
SEARCH = """
import sys, tempfile
from pathlib import Path
from dogshape.pipeline.config.study_file import load_study
from dogshape.pipeline.search.search import open_search, run
from dogshape.pipeline.simulate.executor import Executor
from dogshape.pipeline.store.folder import ShiftJournal, StudyFolder

study = load_study("mq200", sys.argv[1:]).search_setup
with tempfile.TemporaryDirectory() as place:
    folder = StudyFolder(Path(place))
    executor = Executor(ShiftJournal(folder.running), 1)
    state = run(open_search(study, folder, None, False), executor, lambda *_: None)
for trial in state.trials:
    print(trial.params, [round(value, 12) for value in trial.values])
"""
#: Features that numpy leaves out, kernel and threads of OpenBLAS.
PROCESSORS = (("", "", "2"), ("X86_V3,X86_V4,AVX512_ICL,AVX512_SPR", "Nehalem", "1"))


def test_every_processor_proposes_the_same_designs() -> None:
    """Its last digits differ: of numpy's functions, of sums, and of what is solved and drawn."""
    keys = [
        "operating.mismatch_rpm=[50, 149]",
        "operating.force_N=[469.0, 641.5]",
        "expectation.angles=3",
        "search.trials=18",
        "search.startup=10",
    ]
    outputs = []
    for features, kernel, threads in PROCESSORS:
        variables = {
            "NPY_DISABLE_CPU_FEATURES": features,
            "OPENBLAS_CORETYPE": kernel,
            "OPENBLAS_NUM_THREADS": threads,
        }
        environment = {name: value for name, value in variables.items() if value}
        process = subprocess.run(
            [sys.executable, "-c", SEARCH, *keys],
            env=os.environ | environment,
            capture_output=True,
            check=True,
            text=True,
        )
        outputs.append(process.stdout.splitlines())
    assert len(outputs[0]) == 18
    assert outputs[0] == outputs[1]


def test_a_search_in_which_no_design_can_pass_ends_with_a_page(tmp_path: Path) -> None:
    """Own dog and nearest designs are simulated, though a check fails before; all is kept."""
    keys = ["material.allowable_pressure_MPa=2", "search.trials=8", "solver.engine=planar"]
    study, said = load_study("mq200_paper", [*SMALL, *keys]), list[str]()
    run = replace(search_run(tmp_path, jobs=1, progress=Listener(said)), report=True)
    result = run_study(study, run).to_dict()
    assert any("passes every check. Of those" in line for line in said)
    assert (result["best"], result["confirmation"], len(result["trials"])) == (None, None, 8)
    assert not any(row["feasible"] or row["expected_shift_time_s"] for row in result["trials"])
    least = {row["trial"]: min(row["margins"].values()) for row in result["trials"]}
    nearest = [one["trial"] for one in result["nearest"]]
    others = sorted((n for n in least if n), key=lambda n: (-least[n], n))
    assert nearest == [0, *others[:NEAREST]]
    for one in result["nearest"]:
        assert one["expected_shift_time_s"] > 0.0
        assert one["verdict"]["state"] == "fails"
        assert "flank_pressure_traction" in one["verdict"]["failed"]
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    for words in ("Nearest designs", "Checks that stop them", "own dog", "fails flank"):
        assert words in page
    found = ds.load_result(tmp_path)
    assert (found.best, found.verdict, found.to_dict()["feasible"]) == (None, None, False)
    again = run_study(study, replace(run, resume=True)).to_dict()
    assert again["nearest"] == result["nearest"]


def test_journal_drops_a_torn_line_and_refuses_a_broken_one(tmp_path: Path) -> None:
    path = tmp_path / "shifts.jsonl"
    landing = {"landing_loads_N_mm": [0.0]}
    append(path, {"key": "a", "outcome": "engaged", "shift_time_s": 0.1, **landing})
    append(path, {"key": "b", "outcome": "blocked", "shift_time_s": None, **landing})
    whole = path.read_bytes()
    path.write_bytes(whole + b'{"key": "c", "shi')
    assert set(ShiftJournal(path).rows) == {"a", "b"}
    for wrong in (b"rubbish\n", b'{"key": "x"}\n', b'{"key": "x", "outcome": "y"}\n'):
        path.write_bytes(wrong + whole)
        with pytest.raises(StorageError, match="line 1 is not a finished shift"):
            ShiftJournal(path)


def test_a_search_ends_where_every_design_was_tried(tmp_path: Path) -> None:
    file = load_study("mq200_paper", [*SMALL, "search.trials=40"]).file
    few = VariablesSection(count=[13, 20])
    study = build_study(file.model_copy(update={"variables": few}))
    allowed = [n for n in range(13, 21) if worth_simulating(study, {"count": n})]
    assert 1 < len(allowed) < 10
    how = search_run(tmp_path, jobs=1, resume=True)
    result = run_study(study, how).to_dict()
    assert sorted(row["count"] for row in result["trials"]) == allowed
    assert result["best"] is not None
    again = run_study(study, how).to_dict()
    assert [row["count"] for row in again["trials"]] == [row["count"] for row in result["trials"]]


TRIALS = 12
BUDGET = ["search.startup=3", f"search.trials={TRIALS}", "shift.timeout_s=1.1"]
STUDY = load_study("mq200_paper", BUDGET)


class CutOffError(Exception):
    """Stands for the end of a process."""


def _opened(study: Setup = STUDY) -> Search:
    trials = optuna.create_study(directions=["minimize"] * 2)
    return Search(study, trials, sampler_of(study))


def _tell(search: Search, trials: list[FrozenTrial], upto: int | None = None) -> None:
    """Finish trials with a made-up function of their parameters."""
    for trial in trials[:upto]:
        given = trial.params
        values = [given["chamfer_deg"] + given["count"], given["height_mm"]]
        search.optuna_study.tell(trial.number, values)


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


def test_what_another_run_told_leaves_no_trial_running(monkeypatch: pytest.MonkeyPatch) -> None:
    search = _opened(load_study("mq200_paper", [*SMALL, "search.batch=3"]))
    study, storage, trials = search.study, search.optuna_study, next_round(search)

    def evaluated(_: Setup, designs: Sequence[Any], *__: Any) -> list[Evaluation]:
        times = [ShiftResult(Outcome.ENGAGED, 0.1)] * 3
        expectation = expect([expect_point(point, times, 1.0, 0.2) for point in study.points])
        found = {"expected_shift_time_s": Estimate(0.1, 0.001)}
        one = Evaluation(expectation, CheckInputs(Demand()), np.zeros((0, 13)), found, 3)
        return [one] * len(designs)

    monkeypatch.setattr("dogshape.pipeline.search.search.evaluate", evaluated)
    storage.tell(trials[0].number, [0.2, 8.0])
    finish_round(search, trials, scratch_executor(1))
    told = storage.get_trials()
    assert [trial.state for trial in told] == [TrialState.COMPLETE] * 3
    assert told[0].values == [0.2, 8.0]
