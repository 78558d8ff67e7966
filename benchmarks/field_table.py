"""Read the score of a field set, and write what docs/results.md says of it.

``docs/evidence/blind_field.txt`` is what ``dogshape blind score`` prints of a field set, below the
commands. Until a set is scored nothing is written.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from benchmarks.blocks import Block
from benchmarks.entries import ROOT

SCORE = ROOT / "docs" / "evidence" / "blind_field.txt"
HEAD = ("value (95 %)", "n", "aim", "met")
FIGURE = re.compile(r"(-?[\d.]+) \((-?[\d.]+) to (-?[\d.]+)\)")
CALIBRATION = "calibration error"  #: begins the words of a figure that is no share


def headline_of(path: Path) -> list[tuple[str, ...]]:
    """Read the headline figures of a score: words, value, number, aim and whether it is met.

    Raises
    ------
    ValueError : the score has no table of headline figures.
    """
    rows: list[tuple[str, ...]] = []
    inside = False
    for line in path.read_text("utf-8").splitlines():
        cells = tuple(re.split(r"\s{2,}", line.strip()))
        if cells[1:] == HEAD:
            inside = True
        elif inside and len(cells) == len(HEAD) + 1:
            rows.append(cells)
        elif inside:
            return rows
    if not rows:
        raise ValueError(f"{path} has no headline figures of a field set")
    return rows


def passage(path: Path = SCORE) -> str | None:
    """Write what docs/results.md says of a field set; None before one is scored."""
    if not path.exists():
        return None
    text = path.read_text("utf-8")
    lines = [
        "| figure | value (95 %) | cases | aim | met |",
        "|---|---|---|---|---|",
        *(_line(row) for row in headline_of(path)),
        "",
        _sentence(text, r"^scored by .*$"),
        _sentence(text, r"^calibration error of right probabilities.*$"),
    ]
    return "\n".join([*(line for line in lines if line is not None), ""])


def _line(row: Sequence[str]) -> str:
    words, value, n, aim, met = row
    return f"| {words} | {_value(words, value)} | {n} | {aim.strip('-')} | {met.strip('-')} |"


def _value(words: str, value: str) -> str:
    found = FIGURE.fullmatch(value)
    if found is None or words.startswith(CALIBRATION):
        return value
    mid, low, high = (100.0 * float(one) for one in found.groups())
    return f"{mid:.0f} % ({low:.0f} to {high:.0f})"


def _sentence(text: str, pattern: str) -> str | None:
    """Write a line of the score as a sentence, None where it has no such line."""
    found = re.search(pattern, text, re.MULTILINE)
    return None if found is None else f"{found[0][0].upper()}{found[0][1:]}."


FIELD = Block("docs/results.md", "blind field", passage)
