"""What is said while a study runs, and at its end."""

from __future__ import annotations

import io
from pathlib import Path

import pytest
from rich.console import Console

from dogshape.cli.progress_bar import ProgressBar
from dogshape.cli.tables.study_tables import study_table
from dogshape.pipeline.config.study_file import Setup, load_study
from dogshape.pipeline.progress import WorkCounter, about
from dogshape.pipeline.simulate.executor import Executor
from dogshape.pipeline.simulate.point_plans import most_to_confirm, most_to_search
from dogshape.pipeline.store.journal import ShiftJournal
from dogshape.sim.statistics.blocks import even_blocks
from tests.conftest import ONE_LEVEL
from tests.found import FORCE, LENGTH, TIME, Row, found


def test_shifts_are_announced_with_all_that_is_planned() -> None:
    """48 designs at 10 of 28 points with 6 angles, the prototype at all; 16 angles confirm."""
    study = load_study("mq200_paper", ONE_LEVEL)
    assert most_to_search(study, 48, partial=True, prototype=True) == (47 * 10 + 28) * 6
    assert most_to_search(study, 8, partial=True, prototype=False) == 8 * 10 * 6
    assert most_to_search(study, 8, partial=False, prototype=True) == 8 * 28 * 6
    assert most_to_confirm(study, 4) == 5 * 28 * 16 + 2 * 56


def test_progress_says_an_upper_bound_as_such(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("dogshape.cli.progress_bar.LINE_EVERY", 0.0)
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
        progress.known(200)
        now = 14.0
        progress.advance(10)  # too soon for a line
        progress.known(100)  # not of this run
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


def test_a_terminal_has_a_bar_that_goes(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("FORCE_COLOR", "1")
    monkeypatch.setenv("COLUMNS", "100")
    with WorkCounter(ProgressBar(), 4, most=True) as progress:
        progress.advance(1)
        progress.say("a sentence")
    shown = capsys.readouterr().err
    assert "1 of at most 4 shifts, less than a minute left" in shown
    assert "a sentence" in shown
    assert shown.endswith("\x1b[2K")  # the line of the bar is erased


@pytest.mark.parametrize(
    ("seconds", "said"),
    [
        (0.4, "less than a minute"),
        (50.0, "about a minute"),
        (119.0, "about 2 minutes"),
        (7140.0, "about 119 minutes"),
        (7200.0, "about 2 h"),
        (7900.0, "about 2 h 10 min"),
        (86_400.0, "about 24 h"),
    ],
)
def test_times_are_said_in_minutes_and_hours(seconds: float, said: str) -> None:
    assert about(seconds) == said


def test_a_shift_is_counted_once(small_study: Setup, tmp_path: Path) -> None:
    counted: list[int] = []
    blocks = even_blocks(small_study.clutch, small_study.points[:1], 3, 1)
    journal = ShiftJournal(tmp_path / "shifts.jsonl")
    executor = Executor(journal, 1, counted.append)
    executor.run(blocks)
    executor.run(blocks)
    assert sum(counted) == 3
    Executor(journal, 1, counted.append).run(blocks)  # one that was stopped goes on
    assert sum(counted) == 6


def _said(study: Setup, result: Row, report: Path | None = None) -> str:
    for row in result["trials"]:
        row |= {**study.prototype, **row}
    stream = io.StringIO()
    Console(file=stream, width=200).print(
        study_table(study, result | {"failed_shifts": {}}, report)
    )
    return stream.getvalue()


def test_the_end_table_shows_the_objectives_of_the_study(study: Setup, result: Row) -> None:
    lines = _said(study, result | {"objectives": [TIME, LENGTH, FORCE]}).splitlines()
    assert "Design 2" in lines[0]
    assert "20 % faster" in lines[0]
    for name, values in (
        ("expected shift time, ms", "100.0 (98.8 to 101.2) 80.0 (78.8 to 81.2) 20.0 ± 1.0 ms less"),
        ("axial length, root to root, mm", "8 7 1 mm less (12 %)"),
        ("axial separating force, N", "8000 7000 1000 N less (12 %)"),
        ("number of dogs N", "15 17"),
    ):
        (line,) = [line for line in lines if line.startswith(name)]
        assert values in " ".join(line.split())
    front = [" ".join(line.split()) for line in lines if line.startswith(("prototype", "2, cho"))]
    assert "100.0 (98.0 to 102.0) 8 8000 1.0 % tip width" in front[-2]
    assert "70.0 (68.0 to 72.0) 7 7000 3.0 % tip width" in front[-1]
    (leads,) = [line for line in lines if line.startswith("front by")]
    assert "in the order of the expected shift time" in leads
    assert "report: none yet, 'dogshape report' makes it" in lines[-1]


def test_the_end_table_where_no_design_passes(study: Setup) -> None:
    nothing = found() | {"best": None, "front": [], "confirmation": None}
    said = _said(study, nothing, Path("report.html"))
    assert said.startswith("No design of this search passes every check")
    short = [{**row, "margins": {"edge_pressure_impact": -0.3 + 0.1 * k, "tip_width": 0.5}}
             for k, row in enumerate(nothing["trials"][1:3])]  # fmt: skip
    said = _said(study, nothing | {"trials": short}, Path("report.html"))
    assert "2 of 2 fail edge pressure impact, the nearest of them by 20 %. Widen" in said
    assert "report: report.html" in said


def test_the_prototype_alone_is_no_headline(study: Setup) -> None:
    """Nothing of the search passes: its failures are said, and no gain of the prototype."""
    result = found()
    own = result["trials"][0]
    short = [{**row, "feasible": False, "margins": {"tip_width": -0.1 * row["trial"]}}
             for row in result["trials"][1:]]  # fmt: skip
    said = _said(study, result | {"trials": [own, *short], "best": own, "front": [own]}, None)
    assert said.startswith("No design that is faster than the prototype passes every check.")
    assert "5 of 6 fail tip width, the nearest of them by 10 %" in " ".join(said.split())


def test_a_prototype_that_does_not_engage_has_no_gain(study: Setup) -> None:
    result = found()
    silent = result["confirmation"]["prototype"]
    silent |= {TIME: None, "engages": False, "estimates": {}}
    silent["points"][0]["engaged"] = 0.25
    result["confirmation"]["gains"] = {}
    said = _said(study, result, None)
    assert said.startswith("Design 2 engages in 32 of 32 shifts, the prototype in 12 of 32 shifts.")
    assert "faster" not in said


def test_search_and_confirmation_that_disagree_are_said(study: Setup) -> None:
    result = found()
    said = " ".join(_said(study, result, None).split())
    assert "design 2 70.0 ± 1.0 and 80.0 ± 0.6 ms, 8.6 combined standard errors apart" in said
