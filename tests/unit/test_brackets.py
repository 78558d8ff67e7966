"""Names and paths are printed as they are: square brackets are no markup."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from dogshape.cli.console import ProgressBar, emit, say, show
from dogshape.pipeline.config.study_file import load_study
from dogshape.pipeline.progress import WorkCounter
from dogshape.pipeline.record import Table
from dogshape.sim.versions import bundled_root
from dogshape.study_result import StudyResult
from tests.conftest import Said

Call = Callable[..., Said]
NAMES = ("stand [v2] :smile:", "a[red]b", "[/red] x")
ONE_SHIFT = ("--mismatch-rpm", 50, "--force-N", 469, "--relative-angle-deg", 10)


@pytest.mark.parametrize("name", NAMES)
def test_tables_and_lines_print_names_as_they_are(
    name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    table = Table(("case", f"head {name}"), [(f"cell {name}", "1")])
    emit({}, False, lambda: [table, f"report: {name}/report.html", f"wrote {name}"])
    out = capsys.readouterr().out
    for words in (f"head {name}", f"cell {name}", f"report: {name}/report.html", f"wrote {name}"):
        assert words in out


@pytest.mark.parametrize("name", NAMES)
def test_progress_prints_names_as_they_are(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    say(f"kept in {name}")
    with WorkCounter(ProgressBar(), 1) as progress:
        progress.say(f"finished shifts are in {name}")
    err = capsys.readouterr().err
    assert f"kept in {name}" in err
    assert f"finished shifts are in {name}" in err


@pytest.mark.parametrize("name", NAMES[1:])
def test_files_are_written_and_named(dogshape: Call, tmp_path: Path, name: str) -> None:
    folder = tmp_path / name
    folder.mkdir(parents=True)
    page, drawing = Path(name) / "shift.html", Path(name) / "dog.svg"
    shown = dogshape("shift", "mq200_paper", *ONE_SHIFT, "--html", page)
    assert shown.status == 0
    assert f"wrote {page}" in shown.out
    drawn = dogshape("export", "mq200_paper", "--svg", drawing)
    assert drawn.status == 0
    assert str(drawing) in drawn.out
    assert page.is_file()
    assert drawing.is_file()


@pytest.mark.parametrize("name", NAMES)
def test_a_bench_has_any_name(dogshape: Call, tmp_path: Path, name: str) -> None:
    folder = tmp_path / "mine"
    shutil.copytree(bundled_root() / "bench/mq200_adams", folder)
    settings, table = folder / "bench.toml", folder / "shifts.csv"
    old = next(line for line in settings.read_text().splitlines() if line.startswith("name"))
    settings.write_text(settings.read_text().replace(old, f'name = "{name}"', 1))
    lines = table.read_text().splitlines()
    table.write_text("\n".join([lines[0], lines[25]]))
    said = dogshape("validate", folder, "--angles", 3, "--jobs", 1)
    assert said.status == 0
    assert f"data: {name}" in said.out


def test_a_study_names_its_report(
    result: dict[str, Any], capsys: pytest.CaptureFixture[str]
) -> None:
    report = Path("runs [v2]") / "[/red]" / "report.html"
    study = load_study("mq200_paper")
    for row in result["trials"]:
        row |= {**study.prototype, **row}
    whole = result | {"failed_shifts": {"[/red] stuck": 1}}
    show(StudyResult(study, report.parent, whole, report), False)
    out = capsys.readouterr().out
    assert f"report: {report}" in out
    assert "[/red] stuck" in out
