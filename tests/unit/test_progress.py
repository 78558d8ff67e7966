"""What is said while a study runs, and at its end."""

from __future__ import annotations

from pathlib import Path

import pytest

from dogshape.cli.console import ProgressBar
from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.progress import WorkCounter, about
from dogshape.pipeline.simulate.executor import Executor
from dogshape.pipeline.store.journal import ShiftJournal
from dogshape.sim.statistics.blocks import even_blocks


def test_progress_says_an_upper_bound_as_such(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("dogshape.cli.console.LINE_EVERY", 0.0)
    with WorkCounter(ProgressBar(), 10, most=True) as progress:
        progress.advance(4)
        progress.rest(3)
        progress.advance(1)
        progress.advance(5)
    with WorkCounter(ProgressBar(), 2) as exact:
        exact.advance(1)
    said = [line.partition(" shifts")[0] for line in capsys.readouterr().err.splitlines()]
    assert said == ["4 of at most 10", "5 of at most 7", "10 of at most 10", "1 of 2"]


def test_the_rate_outlasts_a_change_of_the_total(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    now = 0.0
    monkeypatch.setattr("rich.console.monotonic", lambda: now)
    with WorkCounter(ProgressBar(), 400) as progress:
        progress.advance(200, 200)
        now = 14.0
        progress.advance(10)  # too soon for a line
        progress.advance(100, 100)  # not of this run
        now = 100.0
        progress.advance(10)
        progress.rest(120)
        progress.advance(20)  # too soon again
        now = 200.0
        progress.advance(20)
    assert capsys.readouterr().err.splitlines() == [
        "320 of 400 shifts, about 7 minutes left",
        "360 of 440 shifts, about 4 minutes left",
    ]


def test_times_are_said_in_minutes_and_hours() -> None:
    for seconds, said in (
        (50.0, "about a minute"), (7140.0, "about 119 minutes"), (7200.0, "about 2 h"),
        (7900.0, "about 2 h 10 min"), (86_400.0, "about 24 h"),
    ):  # fmt: skip
        assert about(seconds) == said


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
