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
    """Write the table of a field set for docs/results.md; None before a set is scored.

    The last column is the value by least squares, where these are scored.
    """
    if not path.exists():
        return None
    heads = ["figure", "value (95 %)", "cases", "aim", "met"]
    rows = [[*row[:3], *(text.strip("-") for text in row[3:])] for row in headline_of(path)]
    if fit_path.exists():
        heads.append("least squares")
        fit_values = {words: value for words, value, *_ in headline_of(fit_path)}
        rows = [[*row, fit_values[row[0]].strip("-")] for row in rows]
    lines = [f"| {' | '.join(heads)} |", "|---" * len(heads) + "|"]
    lines += [f"| {' | '.join(row)} |" for row in rows]
    scoring = re.search(r"^scored by .*$", path.read_text("utf-8"), re.MULTILINE)
    closing = [f"{scoring[0].capitalize()}."] if scoring else []
    return "\n".join([*lines, "", *closing, ""])
