"""What is said while a study runs, and at its end."""

from __future__ import annotations

from pathlib import Path

import pytest

import dogshape as ds
from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.progress import WorkCounter
from dogshape.pipeline.simulate.executor import Executor
from dogshape.pipeline.store.folder import ShiftJournal
from dogshape.sim.statistics.blocks import even_blocks
from dogshape.terminal import ProgressBar


def test_progress_says_an_upper_bound_as_such(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("dogshape.terminal.LINE_EVERY", 0.0)
    with WorkCounter(ProgressBar(), 10, most=True) as progress:
        progress.advance(4)
        progress.rest(3)
        progress.advance(1)
        progress.advance(5)
    with WorkCounter(ProgressBar(), 2) as exact:
        exact.advance(1)
    said = [line.partition(" shifts")[0] for line in capsys.readouterr().err.splitlines()]
    assert said == ["4 of at most 10", "5 of at most 7", "10 of at most 10", "1 of 2"]


def test_a_shift_is_counted_once(small_study: Setup, tmp_path: Path) -> None:
    counted: list[int] = []
    blocks = even_blocks(small_study.clutch, small_study.points[:1], 3, 1)
    journal = ShiftJournal(tmp_path / "shifts.jsonl")
    executor = Executor(journal, 1, lambda done, _: counted.append(done))
    executor.run(blocks)
    executor.run(blocks)
    assert sum(counted) == 3
    again = Executor(journal, 1, lambda done, known: counted.append(known))  # stopped before
    again.run(blocks)
    assert sum(counted) == 6


def test_true_is_a_bar_and_false_is_silent(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("dogshape.terminal.LINE_EVERY", 0.0)
    point = {"mismatch_rpm": 100, "force_N": 469, "angles": 3, "jobs": 1}
    ds.Study("mq200_paper").expect(**point)
    assert capsys.readouterr() == ("", "")
    ds.Study("mq200_paper").expect(**point, progress=True)
    assert "of 6 shifts" in capsys.readouterr().err
