"""Read the score of a field set, and write what docs/results.md says of it.

``docs/evidence/blind_field.txt`` is what ``dogshape blind score`` prints of a field set, below the
commands. Until a set is scored nothing is written.
"""

from __future__ import annotations

import re
from pathlib import Path

SCORE = Path(__file__).resolve().parents[1] / "docs" / "evidence" / "blind_field.txt"
HEAD = ("value (95 %)", "n", "aim", "met")


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
    scored = re.search(r"^scored by .*$", path.read_text("utf-8"), re.MULTILINE)
    lines = [
        "| figure | value (95 %) | cases | aim | met |",
        "|---|---|---|---|---|",
        *(
            f"| {words} | {value} | {n} | {aim.strip('-')} | {met.strip('-')} |"
            for words, value, n, aim, met in headline_of(path)
        ),
        "",
        *([f"{scored[0].capitalize()}."] if scored else []),
    ]
    return "\n".join([*lines, ""])
