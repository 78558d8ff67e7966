"""The search: reproducible, resumable, and never simulating what cannot be built."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from optuna.trial import FrozenTrial, TrialState

from dogshape.pipeline.config.schema import VariablesSection
from dogshape.pipeline.config.study_file import Setup, build_study, load_study, pair_of
from dogshape.pipeline.search.sampler import Guide, Space, SurrogateSampler
from dogshape.pipeline.search.state import SIMULATION
from dogshape.pipeline.simulate.design import design_of, worth_simulating
from dogshape.pipeline.store.folder import ShiftJournal, append
from dogshape.pipeline.study import run_study
from dogshape.sim.errors import DogshapeError, InputError, StorageError
from dogshape.sim.units import RPM
from dogshape.surrogate.store import load
from tests.conftest import SMALL, searching
from tests.integration.studies import Finished


def _rows(folder: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in (folder / "shifts.jsonl").read_text().splitlines()]


def _designs(result: dict[str, Any]) -> list[tuple[Any, ...]]:
    names = ("chamfer_deg", "traction_deg", "braking_deg", "height_mm", "count")
    return [(*(row[n] for n in names), row["expected_shift_time_s"]) for row in result["trials"]]


def test_ridge_back_chamfer_and_backlash_are_searched(tmp_path: Path) -> None:
    """Of every design the dog, the checks, the shifts and the surrogate have them."""
    keys = {"dog.crest": 0.5, "dog.chamfer_back_deg": 12.0, "search.trials": 11}
    ranges = {"crest": [0.3, 0.7], "chamfer_back_deg": [8.0, 18.0], "backlash_mm": [0.0, 0.3]}
    searched = {f"variables.{key}": ends for key, ends in ranges.items()}
    small = dict(map(pair_of, SMALL))
    study = load_study("mq200_paper", small | keys | searched)
    run_study(study, searching(tmp_path))
    result = json.loads((tmp_path / "result.json").read_text())
    names = list(study.variables)
    assert result["trials"][0]["backlash_mm"] == 0.0
    for row in result["trials"][1:]:
        assert all(low <= row[key] <= high for key, (low, high) in study.variables.items())
    assert load(tmp_path / "surrogate.json").surrogate.data.variables == tuple(names)


def test_a_study_ends_with_everything(finished: Finished) -> None:
    folder, result = finished.folder, finished.result
    assert len(result["trials"]) == 12
    assert result["trials"][0]["prototype"]
    assert result["trials"][0]["count"] == 15
    confirmed, best = result["confirmation"]["designs"], result["best"]
    assert result["trials"][best["trial"]]["expected_shift_time_s"] == min(
        row["expected_shift_time_s"] for row in result["trials"]
    )
    assert confirmed[0]["trial"] == best["trial"]
    assert best["expected_shift_time_s"] == confirmed[0]["expected_shift_time_s"]
    assert {row["trial"] for row in result["front"]} <= {d["trial"] for d in confirmed}
    # At the new angles twice as many of the compiled engine, three of them of Drake too.
    assert result["n_simulated_shifts"] == 12 * 6 + 2 * (12 + 6)
    assert len(_rows(folder)) == 2 * 6 + 4  # of confirmation and audit, in Drake
    assert not (folder / "running.jsonl").read_text()
    assert result["audit"]["shifts"] == 4
    assert result["audit"]["agrees"]
    assert all(one["drake"]["shifts"] == 6 and one["drake"]["agrees"] for one in confirmed)
    assert result["confirmation"]["gain_s"] == pytest.approx(
        result["confirmation"]["prototype"]["expected_shift_time_s"]
        - result["confirmation"]["best"]["expected_shift_time_s"]
    )
    for name in ("study.json", "trials.log", "surrogate.json"):
        assert (folder / name).stat().st_size > 0
    assert not (folder / "report.html").exists()
    assert not (folder / "shifts").exists()


def test_same_seed_gives_the_same_trials_on_more_workers(
    finished: Finished, tmp_path: Path
) -> None:
    again = run_study(load_study("mq200_paper", SMALL), searching(tmp_path, jobs=2))
    assert _designs(again) == _designs(finished.result)
    assert json.loads((tmp_path / "result.json").read_text()) == again


def test_a_journal_of_trials_is_mended_or_refused(
    finished: Finished, short: Finished, tmp_path: Path
) -> None:
    """One that a kill cut off goes on, also with more trials; a damaged one is refused."""
    study = load_study("mq200_paper", [*SMALL, "search.trials=4"])
    torn = short.copy(tmp_path / "torn")
    with (torn / "trials.log").open("ab") as file:
        file.write(b'{"op_code": 4, "worker')
    longer = run_study(load_study("mq200_paper", SMALL), searching(torn, jobs=1, resume=True))
    assert _designs(longer) == _designs(finished.result)
    tmp_path = short.copy(tmp_path / "broken")
    log = tmp_path / "trials.log"
    log.write_bytes(b"rubbish\n" + log.read_bytes())
    shifts = (tmp_path / "shifts.jsonl").read_bytes()
    with pytest.raises(StorageError, match=r"trials\.log is damaged; remove the file"):
        run_study(study, searching(tmp_path, jobs=1, resume=True))
    log.unlink()
    again = run_study(study, searching(tmp_path, jobs=1, resume=True))
    assert _designs(again) == _designs(short.result)
    assert (tmp_path / "shifts.jsonl").read_bytes() == shifts


def test_nothing_is_overwritten_without_resume(finished: Finished, tmp_path: Path) -> None:
    folder = finished.copy(tmp_path)
    before = {p: p.read_bytes() for p in folder.rglob("*") if p.is_file()}
    with pytest.raises(StorageError, match="holds a study already; add --resume"):
        run_study(load_study("mq200_paper", SMALL), searching(folder))
    other = load_study("mq200_paper", [*SMALL, "sliding.mass_kg=0.4"])
    words = r"another configuration \(sliding\.mass_kg was 0\.3 and is now 0\.4\); give the one"
    with pytest.raises(StorageError, match=words):
        run_study(other, searching(folder, resume=True))
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


def test_no_feasible_design_is_said(small_study: Setup, tmp_path: Path) -> None:
    tight = load_study("mq200_paper", [*SMALL, "material.allowable_pressure_MPa=2"])
    with pytest.raises(InputError, match=r"passes every check\. Of those .* fail flank pressure"):
        run_study(tight, searching(tmp_path, jobs=1))


@pytest.mark.parametrize(
    ("override", "words"),
    [
        ("search.objectives=['axial_length_mm']", "has none that needs a simulation"),
        ("search.objectives=['expected_shift_time']", "did you mean 'expected_shift_time_s'?"),
        (
            "search.limits.first_try_share=1.5",
            "search.limits.first_try_share is 1.5, but no share engaged in time at the first try "
            "is above 1;",
        ),
        ("search.limits.expected_shift_time_s=-0.06", "every expected shift time is above 0;"),
        ("search.limits.smallest_margin_worst=10", "is above 1;"),
        ("search.limits.impact_impulse_Ns=nan", "it must be finite"),
    ],
)
def test_wrong_search_settings(tmp_path: Path, override: str, words: str) -> None:
    study = load_study("mq200_paper", [*SMALL, override])
    with pytest.raises(DogshapeError) as refused:
        run_study(study, searching(tmp_path / "out", jobs=1))
    assert words in str(refused.value)
    assert not (tmp_path / "out").exists()


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
    how = searching(tmp_path, jobs=1, resume=True)
    result = run_study(study, how)
    assert sorted(row["count"] for row in result["trials"]) == allowed
    assert result["best"] is not None
    again = run_study(study, how)
    assert [row["count"] for row in again["trials"]] == [row["count"] for row in result["trials"]]
