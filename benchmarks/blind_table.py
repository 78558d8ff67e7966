"""Read the score of the blind check, and write what docs/results.md says of it.

``docs/evidence/blind.txt`` is what ``dogshape blind score`` prints, below the commands. Scores from
before both ways to diagnose were scored have other columns; of these nothing is written here.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from benchmarks.blocks import Block
from benchmarks.entries import ROOT
from benchmarks.field_table import FIELD

SCORE = ROOT / "docs" / "evidence" / "blind.txt"
HEAD = "not told (a user's)"
FIGURE = re.compile(r"(-?[\d.]+) \((-?[\d.]+) to (-?[\d.]+)\)")
NOTHING = "-"
WIDTH = 105  #: letters of a line


@dataclass(frozen=True)
class Figure:
    """Hold a value with its 95 % interval, None for nothing to count, and the number counted."""

    value: tuple[float, float, float] | None
    n: int

    def share(self) -> str:
        """Write a share in percent."""
        if self.value is None:
            return NOTHING
        value, low, high = (100.0 * one for one in self.value)
        return f"{value:.0f} % ({low:.0f} to {high:.0f}), n {self.n}"

    def mean(self) -> str:
        """Write a figure that is no share."""
        if self.value is None:
            return NOTHING
        value, low, high = self.value
        return f"{value:.2f} ({low:.2f} to {high:.2f}), n {self.n}"

    def count(self) -> str:
        """Write how many of how many."""
        return NOTHING if self.value is None else f"{self.value[0] * self.n:.0f} of {self.n}"


Score = Mapping[str, tuple[Figure, ...]]  #: by label: not told and told, or not told alone


def has_both(path: Path) -> bool:
    """Say if a score has the diagnosis that is not told beside the one that is."""
    return HEAD in path.read_text("utf-8")


def score_of(path: Path) -> Score:
    """Read a score by its labels.

    Raises
    ------
    ValueError : a line behind the head is not one of the table.
    """
    found: dict[str, tuple[Figure, ...]] = {}
    head = False
    for line in path.read_text("utf-8").splitlines():
        label, *cells = re.split(r"\s{2,}", line.strip())
        if cells and cells[-1] == "n":
            head = True
        elif head and cells:
            pairs = zip(cells[::2], cells[1::2], strict=True)
            found[label] = tuple(_figure(value, n) for value, n in pairs)
    return found


def _figure(words: str, n: str) -> Figure:
    if words == "-":
        return Figure(None, int(n))
    match = FIGURE.fullmatch(words)
    if match is None:
        raise ValueError(f"{words!r} is no figure of a blind score")
    return Figure((float(match[1]), float(match[2]), float(match[3])), int(n))


@dataclass(frozen=True)
class _Row:
    words: str
    labels: tuple[str, ...]
    aim: str = ""
    write: Callable[[Figure], str] = Figure.share


def _rows(score: Score) -> list[_Row]:
    """List the rows of the table: all cases first, then kinds of cases."""
    kinds = [
        label.split()[1][:-1] for label in score if re.fullmatch(r"outside, \w+: named", label)
    ]
    return [
        _Row("the truth is the most probable hypothesis", ("all cases: right",)),
        _Row("the truth is in the leading class", ("all cases: right class",), "95 %"),
        _Row(
            "where causes are named: they are the truth, no more and no less",
            ("all cases: named exactly, of what is named",),
            "98 %",
        ),
        _Row("the 90 % set of hypotheses holds the truth", ("all cases: in the 90 % set",), "90 %"),
        _Row("hypotheses in that set", ("all cases: size of the 90 % set",), write=Figure.mean),
        _Row(
            "calibration error of the leading hypothesis",
            ("all cases: calibration error of the leading one",),
            "0.05",
            Figure.mean,
        ),
        _Row("an effect named where there is none", ("no effect: one is named",), "1 %"),
        _Row("pairs: both found", ("pairs: both causes found",), "70 %"),
        _Row(
            "pairs whose second effect can be seen after a refit of the first: both found",
            ("pairs, second effect visible after refit of the first: both found",),
        ),
        _Row(
            "outside the list: unknown or refused",
            ("outside the list: unknown, or refused",),
            "90 %",
        ),
        _Row("outside the list: an effect named", ("outside the list: an effect named",)),
        *(
            _Row(
                f"{kind.replace('_', ' ')}: unknown or refused; an effect named",
                (f"outside, {kind}: recognised", f"outside, {kind}: named"),
                write=Figure.count,
            )
            for kind in kinds
        ),
        _Row("one effect alone: the diagnosis", ("one effect: the diagnosis",)),
        _Row("the same cases: smallest RMSE", ("one effect: smallest RMSE",)),
        _Row("the same cases: AICc", ("one effect: AICc",)),
        _Row(
            "the advised test settles an ambiguous case; wrongly",
            ("ambiguous: settled", "ambiguous: settled wrongly"),
            "80 %",
        ),
    ]


def passage(path: Path = SCORE) -> str | None:
    """Write what docs/results.md says of a score; None for one with one way to diagnose.

    Raises
    ------
    KeyError : the score lacks a figure.
    """
    if not has_both(path):
        return None
    score = score_of(path)
    lines = [
        "| over n cases | not told | told | aim |",
        "|---|---|---|---|",
        *(_line(row, score) for row in _rows(score)),
    ]
    return "\n".join([*_intro(score["all cases: right"][0].n), "", *lines, ""])


def _line(row: _Row, score: Score) -> str:
    ways = [
        "; ".join(row.write(score[label][way]) for label in row.labels if way < len(score[label]))
        for way in range(2)
    ]
    return f"| {row.words} | {ways[0]} | {ways[1]} | {row.aim} |".replace("  |", " |")


def _intro(cases: int) -> list[str]:
    words = (
        f"{cases} sealed cases: each effect alone at "
        "three strengths, pairs, nothing, and things outside the list, as means, single shifts and "
        "traces. The data come from MuJoCo, which shares no physics with the simulation; the hash "
        "of the key was published before the one run ([all figures](evidence/blind.txt), "
        "[what they mean](blind.md)). *Not told* is the diagnosis that a user gets; *told* is "
        "the same once it knows what both engines differ by without any effect, which no stand "
        "tells. Over all cases, barely visible effects included, with 95 % intervals:"
    )
    lines = [""]
    for word in words.split(" "):
        fits = len(lines[-1]) + len(word) < WIDTH
        lines[-1:] = [f"{lines[-1]} {word}".strip()] if fits else [lines[-1], word]
    return lines


BLOCKS = (Block("docs/results.md", "blind score", passage), FIELD)
