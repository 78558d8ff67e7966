"""Commands at work: their progress, the files that a stop leaves, and how they resume."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import pytest

from dogshape.bench.bench_data import load_bench
from dogshape.diagnosis.prediction.building import build_models
from dogshape.diagnosis.settings import USUAL
from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.diagnose.bank_diagnosis import BankOptions, SimulationRounds, models_of
from dogshape.pipeline.progress import WorkCounter
from dogshape.pipeline.simulate.executor import Executor, RunOptions
from dogshape.pipeline.store.folder import ShiftJournal, append
from dogshape.sim.effects import load
from dogshape.sim.statistics.blocks import Block, even_blocks
from dogshape.sim.statistics.shift_records import Record
from dogshape.terminal import ProgressBar
from tests.analytic import AnalyticShifts, select_cells, simulate_analytic
from tests.conftest import Call, CommandResult, Listener
from tests.diagnoses import simulated_bench, simulated_diagnosis

POINT = ("expect", "mq200_paper", "--mismatch-rpm", 149, "--force-N", 469, "--jobs", 1)
EXPECT, PRECISE = (*POINT, "--angles", 6), (*POINT, "--precision", 0.2)
VALIDATE = ("validate", "mq200_adams", "--angles", 3, "--jobs", 1)


def _line(said: CommandResult) -> str:
    """Return standard error without the console's breaks."""
    return " ".join(said.err.split())


@pytest.mark.parametrize("asked", [EXPECT, PRECISE, VALIDATE])
def test_a_stopped_command_goes_on(
    dogshape: Call, tmp_path: Path, quick: AnalyticShifts, asked: tuple[object, ...]
) -> None:
    whole = dogshape(*asked)
    assert whole.status == 0, whole.err
    assert not list(tmp_path.iterdir()), "a command that is done leaves nothing"
    shifts, quick.done, quick.stop = quick.done, 0, 5
    stopped = dogshape(*asked)
    assert stopped.status == 130
    (folder,) = (tmp_path / "results" / "shifts").iterdir()
    assert len((folder / "shifts.jsonl").read_bytes().splitlines()) == 5
    assert f"5 finished shifts are kept in results/shifts/{folder.name}" in _line(stopped)
    assert "the same command goes on" in _line(stopped)
    quick.stop = None
    again = dogshape(*asked)
    assert (again.status, again.out) == (0, whole.out)
    assert quick.done == shifts, "a finished shift was simulated again"
    assert not (tmp_path / "results").exists()


def test_a_folder_that_cannot_be_made_is_told(
    dogshape: Call, tmp_path: Path, quick: AnalyticShifts
) -> None:
    (tmp_path / "results").write_text("a file", encoding="utf-8")
    said = dogshape(*EXPECT)
    assert said.status == 0
    assert _line(said).startswith("results/shifts/expect-")
    assert "finished shifts are lost" in _line(said)
    assert quick.done > 6
    assert [path.name for path in tmp_path.iterdir()] == ["results"]


def test_the_same_command_twice_at_once_is_told(
    tmp_path: Path, quick: AnalyticShifts, capsys: pytest.CaptureFixture[str]
) -> None:
    where = RunOptions(1, None, tmp_path, ProgressBar())
    with where.executor("expect", ("abc", 3), 1) as (first, _):
        with where.executor("expect", ("abc", 3), 1) as (second, _):
            assert second.journal.path != first.journal.path
        assert first.journal.path.parent.exists(), "the folder of the first is left alone"
    assert "in use by another run" in " ".join(capsys.readouterr().err.split())
    assert not list(tmp_path.iterdir()), "what was there before stays"


def test_the_bank_announces_what_is_left(tmp_path: Path, quick: AnalyticShifts) -> None:
    bench = select_cells(load_bench("mq200_adams"), [(10, 235.2)])
    effects = {"moving_mass": load()["moving_mass"]}
    bench = replace(bench, clutch=replace(bench.clutch, timeout=1.1))  # no bank has this clutch
    requests: list[Sequence[Block]] = []

    def noted(asked: Sequence[Block]) -> list[list[Record]]:
        requests.append(asked)
        return simulate_analytic(asked)

    build_models(bench, effects, USUAL, noted)
    blocks = requests[0]  # at even angles; the angles between follow from these
    left = sum(len(block.angles) for block in blocks[1:])
    append(tmp_path / "shifts.jsonl", *AnalyticShifts()(blocks[0]))
    said: list[str] = []
    models_of(bench, effects, BankOptions(tmp_path, jobs=1, progress=Listener(said)))
    assert f"lacks {left + len(blocks[0].angles)} shifts" in said[0]
    assert "further rounds follow" in said[0]
    assert sum("further rounds follow" in line for line in said) == 1
    rounds = SimulationRounds()
    assert rounds.begin() == "round 1 of the diagnosis"
    assert rounds.begin() == "round 2 of the diagnosis, 0 min after the first"


def test_the_diagnosis_is_written_before_its_price(
    dogshape: Call, tmp_path: Path, quick: AnalyticShifts, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench = simulated_bench({"actuation_delay": {"delay_s": 0.08}})
    found = simulated_diagnosis(bench, advise=True)
    monkeypatch.setattr("dogshape.gap.diagnose_bench", lambda *_: found)
    asked = ("diagnose", "mq200_stand", "--study", "mq200_paper", "--out", "g", "--jobs", 1)
    quick.stop = 100
    stopped = dogshape(*asked)
    assert stopped.status == 130
    out = tmp_path / "g"
    first = json.loads((out / "gap.json").read_text(encoding="utf-8"))
    assert first["verdict"] == found.verdict.kind
    assert 'id="design-choice"' not in (out / "report.html").read_text(encoding="utf-8")
    assert "100 finished shifts are kept in g/so-what-" in _line(stopped)
    assert "The report is written to g/report.html" in _line(stopped)
    quick.stop = None
    again = dogshape(*asked)
    assert again.status == 0, again.err
    assert quick.done == 7 * 28 * 6, "a dead time needs no shift of its own"
    assert 'id="design-choice"' in (out / "report.html").read_text(encoding="utf-8")
    names = [".lock", "cells.csv", "data", "gap.json", "report.html"]
    assert sorted(path.name for path in out.iterdir()) == names


def test_progress_says_an_upper_bound_as_such(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("dogshape.terminal.LINE_INTERVAL_S", 0.0)
    with WorkCounter(ProgressBar(), 10, at_most=True) as progress:
        progress.advance(4)
        progress.expect_more(3)
        progress.advance(1)
        progress.advance(5)
    with WorkCounter(ProgressBar(), 2) as exact:
        exact.advance(1)
    with WorkCounter(ProgressBar(), 2, stage="round 3") as part:
        part.advance(1)
    said = [line.partition(" shifts")[0] for line in capsys.readouterr().err.splitlines()]
    assert said == [
        "4 of at most 10",
        "5 of at most 7",
        "10 of at most 10",
        "1 of 2",
        "round 3: 1 of 2",
    ]


def test_a_shift_is_counted_once(small_study: Setup, tmp_path: Path) -> None:
    counted, blocks = list[int](), even_blocks(small_study.clutch, small_study.points[:1], 3, 1)
    journal = ShiftJournal(tmp_path / "shifts.jsonl")
    executor = Executor(journal, 1, lambda done, _: counted.append(done))
    executor.run(blocks)
    executor.run(blocks)
    assert sum(counted) == 3
    again = Executor(journal, 1, lambda done, known: counted.append(known))  # stopped before
    again.run(blocks)
    assert sum(counted) == 6
