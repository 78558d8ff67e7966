"""Read the score of a field set, and write its table of docs/results.md.

``docs/evidence/blind_field.txt`` is what ``dogshape blind score`` prints of a field set, below the
commands, ``blind_fit.txt`` the same of nested least squares. Until a set is scored nothing is
written.
"""

from __future__ import annotations

import re
from pathlib import Path

EVIDENCE = Path(__file__).resolve().parents[1] / "docs" / "evidence"
SCORE = EVIDENCE / "blind_field.txt"
FIT_SCORE = EVIDENCE / "blind_fit.txt"
HEAD = ("value (95 %)", "n", "aim", "met")


def headline_of(path: Path) -> list[tuple[str, ...]]:
    """Read the headline figures of a score: words, value, number, aim and whether it is met.

    Raises
    ------
    ValueError : the score has no table of headline figures.
    """
    rows: list[tuple[str, ...]] = []
    in_table = False
    for line in path.read_text("utf-8").splitlines():
        cells = tuple(re.split(r"\s{2,}", line.strip()))
        if cells[1:] == HEAD:
            in_table = True
        elif in_table and len(cells) == len(HEAD) + 1:
            rows.append(cells)
        elif in_table:
            return rows
    if not rows:
        raise ValueError(f"{path} has no headline figures of a field set")
    return rows


def case_count(path: Path) -> int:
    """Read the number of cases of a score.

    Raises
    ------
    ValueError : the score does not state it.
    """
    match = re.search(r"^(\d+) cases", path.read_text("utf-8"), re.MULTILINE)
    if match is None:
        raise ValueError(f"{path} does not state the number of its cases")
    return int(match[1])


def passage(path: Path = SCORE, fit_path: Path = FIT_SCORE) -> str | None:
    """Write the table of a field set for docs/results.md; None before a set is scored."""
    if not path.exists():
        return None
    fit_values = {words: value for words, value, *_ in headline_of(fit_path)}
    scoring = re.search(r"^scored by .*$", path.read_text("utf-8"), re.MULTILINE)
    lines = [
        "| figure | value (95 %) | cases | aim | met | least squares |",
        "|---|---|---|---|---|---|",
        *(
            f"| {words} | {value} | {n} | {aim.strip('-')} | {met.strip('-')} "
            f"| {fit_values[words].strip('-')} |"
            for words, value, n, aim, met in headline_of(path)
        ),
        "",
        *([f"{scoring[0].capitalize()}."] if scoring else []),
    ]
    return "\n".join([*lines, ""])
