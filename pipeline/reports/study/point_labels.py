"""Names beside the marks of a figure, put where they cover neither marks nor each other."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import plotly.graph_objects as go

from dogshape.pipeline.reports.kit.look import INK

#: Sizes of a plot that the places are worked out for, on paper and on a screen, px.
PLOTS = ((560.0, 320.0), (1040.0, 410.0))
LETTER, LINE = 8.0, 17.0  #: width and height of a letter, px
BETWEEN = 8.0  #: least distance of two labels side by side, px
REACHES = (24.0, 38.0, 54.0, 72.0, 96.0)  #: distances of a name from its mark, px
TURNS = (225, 315, 45, 135, 270, 90, 0, 180)  #: directions that are tried, degrees
NEARER = 4.0  #: what a label that is nearer to another mark costs, px
MARK = 11.0  #: half the width of a mark with some room, px
Span = tuple[float, float]
Box = tuple[float, float, float, float]  #: middle across and up, width, height, px


@dataclass(frozen=True)
class Label:
    """Words for a mark at a point of the axes."""

    words: str
    at: tuple[float, float]

    @property
    def width(self) -> float:
        """Width of the words, px; bold signs have none."""
        return LETTER * len(self.words.replace("<b>", "").replace("</b>", ""))


@dataclass(frozen=True)
class Taken:
    """What no label may cover: marks at points of the axes, and bars from one end to the other.

    ``half`` is half the width of a mark, px; ``share`` what the panel has of the plot's width.
    """

    marks: Sequence[Span] = ()
    bars: Sequence[tuple[Span, Span]] = ()
    half: float = MARK
    share: float = 1.0

    @property
    def plots(self) -> tuple[Span, ...]:
        """Sizes of the panel on paper and on a screen, px."""
        return tuple((self.share * width, height) for width, height in PLOTS)

    def boxes(self, x: Span, y: Span, plot: Span) -> list[Box]:
        """Return marks and bars as boxes on a plot of a size."""
        size = 2.0 * self.half
        found = [(*_pixel(mark, x, y, plot), size, size) for mark in self.marks]
        for ends in self.bars:
            (a, u), (b, v) = (_pixel(end, x, y, plot) for end in ends)
            found.append((0.5 * (a + b), 0.5 * (u + v), abs(b - a) + 6.0, abs(v - u) + 6.0))
        return found


def shifts_of(labels: Sequence[Label], x: Span, y: Span, taken: Taken | None = None) -> list[Span]:
    """Return for each label how far right and up its middle stands from its mark, px.

    ``x`` and ``y`` are the ends of the axes, ``taken`` what is there without a label. Labels are
    placed in turn, each at the first place that covers least of marks, bars and the labels before.
    """
    given = taken or Taken()
    marks = replace(given, marks=[*(label.at for label in labels), *given.marks])
    boxes = [marks.boxes(x, y, plot) for plot in given.plots]
    found = []
    for label in labels:
        at = [_pixel(label.at, x, y, plot) for plot in given.plots]
        best = _best(label, at, boxes, marks)
        for (a, u), there in zip(at, boxes, strict=True):
            there.append((a + best[0], u + best[1], label.width + BETWEEN, LINE))
        found.append(best)
    return found


def _best(label: Label, at: list[Span], boxes: list[list[Box]], taken: Taken) -> Span:
    """Return the place of a label that covers least on all sizes of the plot together, px.

    The first boxes are those of the marks of ``taken``: one that stands nearer than the label's own
    would be taken for it.
    """
    marks = len(taken.marks)

    def cost(place: Span) -> float:
        total = 0.0
        for (a, u), there, plot in zip(at, boxes, taken.plots, strict=True):
            box = a + place[0], u + place[1], label.width, LINE
            own = _apart(box, a, u)
            total += _covered(box, there, plot)
            total += NEARER * any(_apart(box, b, v) < 0.99 * own for b, v, *_ in there[:marks])
        return total

    return min(_places(label), key=cost)


def _places(label: Label) -> list[Span]:
    """Return where a label may stand from its mark, px, the nearest first."""
    tries = []
    for reach in REACHES:
        for turn in TURNS:
            across, up = (reach * f(math.radians(turn)) for f in (math.cos, math.sin))
            beside = 0.0 if turn % 180 == 90 else math.copysign(0.5 * label.width, across)
            tries.append((across + beside, up))
    return tries


def write_labels(
    figure: go.Figure,
    labels: Sequence[Label],
    x: Span,
    y: Span,
    taken: Taken | None = None,
    **where: int,
) -> None:
    """Write labels beside their marks, each with a thin line to it; ``where`` is row and column."""
    for label, (right, up) in zip(labels, shifts_of(labels, x, y, taken), strict=True):
        figure.add_annotation(
            x=label.at[0], y=label.at[1], text=label.words, ax=right, ay=-up, showarrow=True,
            arrowhead=0, arrowwidth=1, arrowcolor=INK, standoff=7, font={"size": 14}, **where,
        )  # fmt: skip


def _pixel(at: Span, x: Span, y: Span, plot: Span) -> Span:
    return plot[0] * (at[0] - x[0]) / (x[1] - x[0]), plot[1] * (at[1] - y[0]) / (y[1] - y[0])


def _apart(box: Box, across: float, up: float) -> float:
    """Return the distance of a point from a box, px; nought within."""
    a, u, width, height = box
    return math.hypot(max(abs(a - across) - 0.5 * width, 0), max(abs(u - up) - 0.5 * height, 0))


def _covered(box: Box, others: list[Box], plot: Span) -> float:
    """Return how much a label covers, and how much of it lies outside the plot, px."""
    across, up, width, height = box
    total = 0.0
    for a, u, w, h in others:
        over = min(0.5 * (width + w) - abs(across - a), 0.5 * (height + h) - abs(up - u))
        total += max(0.0, over)
    outside = max(0.0, 0.5 * width - across, across + 0.5 * width - plot[0])
    return total + outside + max(0.0, 0.5 * height - up, up + 0.5 * height - plot[1])
