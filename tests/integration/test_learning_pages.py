"""Every command of the tutorial and of the short recipes runs, and does what its page says."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner

from benchmarks.pages import Command, commands_of, output_patterns, steps_of, written_files
from dogshape.cli.app import app
from tests.conftest import Call

DOCS = Path(__file__).parents[2] / "docs"
RUN = [DOCS / "tutorial.md", *sorted((DOCS / "howto").glob("*.md"))]
GROUPS = {("init",), ("blind",)}
KINDS = {"sh", "console", "text", "file", "python", "toml", "written"}


@pytest.mark.parametrize("page", RUN, ids=lambda page: page.stem)
def test_a_page_does_what_it_says(page: Path, dogshape: Call, tmp_path: Path) -> None:
    printed = ""
    for step in steps_of(page):
        place = f"{page.name}, line {step.line}"
        assert step.kind in KINDS, place
        if step.kind == "file":
            (tmp_path / step.title).parent.mkdir(parents=True, exist_ok=True)
            (tmp_path / step.title).write_text(step.text, encoding="utf-8")
        elif step.kind == "sh":
            printed = ""
            for command in commands_of(step.text):
                assert command.words[0] == "dogshape", place
                said = dogshape(*command.words[1:])
                assert said.status == command.status, f"{place}: {said.out}\n{said.err}"
                printed += said.out
        elif step.kind == "python":
            printed = subprocess.run(
                [sys.executable, "-c", step.text], cwd=tmp_path, check=True, capture_output=True,
                text=True,
            ).stdout  # fmt: skip
        elif step.kind == "text":
            for pattern in output_patterns(step.text):
                assert re.search(pattern, " ".join(printed.split())), (
                    f"{place}: {pattern}\n{printed}"
                )
        elif step.kind == "written":
            named = written_files(step.text)
            assert named, place
            assert not [name for name in named if not (tmp_path / name).is_file()], place


@pytest.mark.parametrize("page", RUN, ids=lambda page: page.stem)
def test_commands_that_are_not_run_have_the_options_that_they_name(page: Path) -> None:
    for step in steps_of(page):
        if step.kind == "console":
            for command in commands_of(step.text):
                if command.words[0] == "dogshape":
                    assert not _unknown(command), f"{page.name}, line {step.line}"


def _unknown(command: Command) -> set[str]:
    """Return the options that a verb does not have, by what its help lists."""
    words = command.words[1:]
    verb = words[: 2 if words[:1] in GROUPS else 1]
    told = CliRunner().invoke(app, [*verb, "--help"])
    assert told.exit_code == 0, f"no such verb: {verb}"
    known = set(re.findall(r"^  (--[\w-]+)", told.stdout, re.MULTILINE))
    return {word for word in command.words if word.startswith("--")} - known
