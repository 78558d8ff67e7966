"""Run the steps of a page of the documentation, and draw its pictures.

    python -m benchmarks.pages docs/tutorial.md build/tutorial docs/tutorial
    python -m benchmarks.pages docs/howto/own_driveline.md build/own_driveline docs/howto

Fenced blocks of a page are steps, in their order:

``sh``                  commands ``dogshape``, run in the folder; ``# status 1`` names a status that
                        is not 0
``text``                what the command before prints, line by line; ``...`` stands for anything
``python`` and others with ``title="NAME"``   a file, written into the folder
``python``              a script, run in the folder
``console``             commands that no test runs: long ones, and such that need a server

A paragraph that begins with ``Written:`` names the files in backticks that are there afterwards.
"""

from __future__ import annotations

import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

FENCE = re.compile(r"^```(\w+)(?: title=\"([^\"]+)\")?\n(.*?)^```$", re.MULTILINE | re.DOTALL)
WRITTEN = re.compile(r"^Written: (.*?)(?=\n\n|\Z)", re.MULTILINE | re.DOTALL)
STATUS = re.compile(r"#\s*status (\d+)\s*$")


@dataclass(frozen=True)
class Step:
    """One block of a page.

    ``kind`` is ``written``, ``file``, or the language of the block; ``title`` is the name of a
    file, ``line`` where the block stands in the page.
    """

    kind: str
    text: str
    title: str = ""
    line: int = 0


@dataclass(frozen=True)
class Command:
    """A command of a page with the status that it ends with."""

    words: tuple[str, ...]
    status: int = 0


def steps_of(page: Path) -> list[Step]:
    """List the steps of a page in order."""
    text = page.read_text(encoding="utf-8")
    steps = []
    for block in FENCE.finditer(text):
        language, title, body = block.groups()
        kind = "file" if title else language
        steps.append((block.start(), Step(kind, body, title or "", _line(text, block.start()))))
    for match in WRITTEN.finditer(text):
        steps.append(
            (match.start(), Step("written", match.group(1), "", _line(text, match.start())))
        )
    return [step for _, step in sorted(steps, key=lambda pair: pair[0])]


def _line(text: str, place: int) -> int:
    return text.count("\n", 0, place) + 1


def commands_of(text: str) -> Iterator[Command]:
    """Split a block into commands; a backslash continues a line, ``# status N`` is the status."""
    for line in text.replace("\\\n", " ").splitlines():
        match = STATUS.search(line)
        words = shlex.split(line, comments=True)
        if words:
            yield Command(tuple(words), int(match.group(1)) if match else 0)


def output_patterns(text: str) -> Iterator[str]:
    """Write each line of a ``text`` block as a pattern for words parted by single blanks."""
    for line in text.splitlines():
        words = " ".join(line.split())
        if words and words != "...":
            yield r".*?".join(re.escape(part.strip()) for part in words.split("..."))


def written_files(text: str) -> list[str]:
    """List the files of a paragraph that begins with ``Written:``."""
    return re.findall(r"`([^`]+)`", text)


class Picture(NamedTuple):
    """Part of a page that a step writes."""

    source: str  #: file in the folder of the steps; ``APP`` for the live page of ``APP_STUDY``
    window: str  #: width and height, px
    scale: float  #: of the picture


APP = ""
APP_STUDY = "mq200_paper"
#: Pictures of a page of the documentation by the stem of the page and their own.
PICTURES = {
    "tutorial": {
        "report": Picture("results/first/report.html", "1180,820", 0.62),
        "app": Picture(APP, "1280,960", 0.57),
        "shift": Picture("shift.html", "1180,800", 0.62),
        "gap": Picture("results/gap/report.html", "1180,1000", 0.62),
        "effect": Picture("results/gap_own/report.html", "1180,640", 0.62),
    },
    "own_driveline": {"own_driveline": Picture("driveline.html", "1180,820", 0.62)},
}
DRAWINGS = {"tutorial": "dog.svg"}  #: files of the steps that are pictures, by the stem of the page


def main(page: Path, folder: Path, pictures: Path) -> None:
    """Run the steps of a page in an empty folder, and draw their pages."""
    folder.mkdir(parents=True)
    program = Path(sys.executable).parent / "dogshape"
    for step in steps_of(page):
        if step.kind == "file":
            (folder / step.title).parent.mkdir(parents=True, exist_ok=True)
            (folder / step.title).write_text(step.text, encoding="utf-8")
        elif step.kind == "python":
            subprocess.run([sys.executable, "-c", step.text], cwd=folder, check=True)
        elif step.kind == "sh":
            for command in commands_of(step.text):
                print("$", shlex.join(command.words), flush=True)
                result = subprocess.run([program, *command.words[1:]], cwd=folder, check=False)
                if result.returncode != command.status:
                    raise SystemExit(f"{page}, line {step.line}: status {result.returncode}")
    pictures.mkdir(parents=True, exist_ok=True)
    if page.stem in DRAWINGS:
        shutil.copy(folder / DRAWINGS[page.stem], pictures)
    for name, picture in PICTURES[page.stem].items():
        path = pictures / f"{name}.png"
        if picture.source == APP:
            _shoot_app(program, path, picture)
        else:
            _shoot((folder / picture.source).resolve().as_uri(), path, picture)


def _shoot_app(program: Path, path: Path, picture: Picture) -> None:
    serve = [str(program), "app", APP_STUDY, "--no-browser", "--port", "0"]
    with subprocess.Popen(serve, stderr=subprocess.PIPE, text=True) as server:
        assert server.stderr is not None
        _shoot(server.stderr.readline().split()[0], path, picture)
        server.terminate()


def _shoot(address: str, path: Path, picture: Picture) -> None:
    command = [
        "chromium",
        "--headless",
        "--no-sandbox",
        "--use-angle=swiftshader",
        "--enable-unsafe-swiftshader",
        "--no-first-run",
        "--hide-scrollbars",
        f"--user-data-dir={path.parent.resolve() / '.chromium'}",
        "--virtual-time-budget=30000",
        f"--window-size={picture.window}",
        f"--force-device-scale-factor={picture.scale}",
        f"--screenshot={path.resolve()}",
        address,
    ]
    try:
        subprocess.run(command, check=True, capture_output=True, timeout=120)
    finally:
        shutil.rmtree(path.parent / ".chromium", ignore_errors=True)


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:4]))
