"""Names beside the marks of a figure, put where they cover neither marks nor each other."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import plotly.graph_objects as go

from pipeline.reporting.look import INK

PLOT = (600.0, 320.0)  #: size of a plot on paper, that the places are worked out for, px
LETTER, LINE = 8.0, 17.0  #: width and height of a letter, px
REACHES = (24.0, 38.0, 54.0, 72.0)  #: distances of a name from its mark, px
TURNS = (225, 315, 45, 135, 270, 90, 0, 180)  #: directions that are tried, degrees
MARK = 9.0  #: half the width of a mark, px


@dataclass(frozen=True)
class Label:
    """Words for a mark at a point of the axes."""

    words: str
    at: tuple[float, float]

    @property
    def width(self) -> float:
        """Width of the words, px; bold signs have none."""
        return LETTER * len(self.words.replace("<b>", "").replace("</b>", ""))


def shifts_of(
    labels: Sequence[Label],
    x: Sequence[float],
    y: Sequence[float],
    others: Sequence[tuple[float, float]] = (),
) -> list[tuple[float, float]]:
    """Return for each label how far right and up its middle stands from its mark, px.

    ``x`` and ``y`` are the ends of the axes, ``others`` marks without a label. Labels are placed
    in turn, each at the first place that covers least of the marks and of the labels before.
    """
    marks = [_pixel(at, x, y) for at in (*(label.at for label in labels), *others)]
    taken: list[tuple[float, float, float]] = []
    found = []
    for label, (across, up) in zip(labels, marks, strict=False):
        tries = [
            (reach * math.cos(math.radians(turn)) + math.copysign(0.3 * label.width, math.cos(
                math.radians(turn))) * (turn % 180 != 90), reach * math.sin(math.radians(turn)))
            for reach in REACHES for turn in TURNS
        ]  # fmt: skip
        best = min(
            tries,
            key=lambda t: _covered((across + t[0], up + t[1], label.width), marks, taken),
        )
        taken.append((across + best[0], up + best[1], label.width))
        found.append(best)
    return found


def write_labels(
    figure: go.Figure,
    labels: Sequence[Label],
    x: Sequence[float],
    y: Sequence[float],
    others: Sequence[tuple[float, float]] = (),
    **where: int,
) -> None:
    """Write labels beside their marks, each with a thin line to it; ``where`` is row and column."""
    for label, (right, up) in zip(labels, shifts_of(labels, x, y, others), strict=True):
        figure.add_annotation(
            x=label.at[0], y=label.at[1], text=label.words, ax=right, ay=-up, showarrow=True,
            arrowhead=0, arrowwidth=1, arrowcolor=INK, standoff=7, font={"size": 14}, **where,
        )  # fmt: skip


def _pixel(at: tuple[float, float], x: Sequence[float], y: Sequence[float]) -> tuple[float, float]:
    return (
        PLOT[0] * (at[0] - x[0]) / (x[1] - x[0]),
        PLOT[1] * (at[1] - y[0]) / (y[1] - y[0]),
    )


def _covered(
    box: tuple[float, float, float],
    marks: list[tuple[float, float]],
    taken: list[tuple[float, float, float]],
) -> float:
    """Return how much a label covers, and how much of it lies outside the plot, px."""
    across, up, width = box
    others = [(*mark, 2.0 * MARK, 2.0 * MARK) for mark in marks]
    others += [(a, u, w, LINE) for a, u, w in taken]
    total = 0.0
    for a, u, w, h in others:
        over = min(0.5 * (width + w) - abs(across - a), 0.5 * (LINE + h) - abs(up - u))
        total += max(0.0, over)
    outside = max(0.0, 0.5 * width - across, across + 0.5 * width - PLOT[0])
    return total + outside + max(0.0, 0.5 * LINE - up, up + 0.5 * LINE - PLOT[1])
