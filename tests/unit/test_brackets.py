"""Names and paths are printed as they are: square brackets are no markup."""

from __future__ import annotations

import pytest

from dogshape.cli.console import emit
from dogshape.pipeline.progress import WorkCounter
from dogshape.pipeline.record import Table
from dogshape.terminal import ProgressBar

NAMES = ("stand [v2] :smile:", "a[red]b", "[/red] x")


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
    ProgressBar().say(f"kept in {name}")
    with WorkCounter(ProgressBar(), 1) as progress:
        progress.say(f"finished shifts are in {name}")
    err = capsys.readouterr().err
    assert f"kept in {name}" in err
    assert f"finished shifts are in {name}" in err
