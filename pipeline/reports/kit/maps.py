"""Figures over mismatch and shift force: maps with a number in each cell, and panels of curves."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TypeVar

import numpy as np
import plotly.graph_objects as go

from dogshape.pipeline.reports.kit.look import INK, styled

T = TypeVar("T")
MOST = (16, 6)  #: mismatches and forces of a grid that maps have room for
TALL = 8  #: rows of a map above which they are low
#: Slower is orange, faster blue; both pale, so that the numbers stay readable in grey.
LOSS_TO_GAIN = ((0.0, "#f0b48a"), (0.5, "#ffffff"), (1.0, "#8db9e2"))
#: Corners of a cell about its row and column.
CELL = {"x0": -0.47, "x1": 0.47, "y0": -0.46, "y1": 0.46}


def grid(
    points: Sequence[T], place: Callable[[T], tuple[float, float]]
) -> tuple[list[float], list[float], dict[tuple[int, int], T]]:
    """Sort points into rows by mismatch and columns by force: both in order, and the cells."""
    mismatches, forces = (sorted({place(p)[k] for p in points}) for k in (0, 1))
    cells = {(mismatches.index(place(p)[0]), forces.index(place(p)[1])): p for p in points}
    return mismatches, forces, cells


def has_room(mismatches: Sequence[float], forces: Sequence[float]) -> bool:
    """Check that maps have room for so many mismatches and forces."""
    return len(mismatches) <= MOST[0] and len(forces) <= MOST[1]


def shaded_cells(
    x: Sequence[str],
    y: Sequence[str],
    cells: Mapping[tuple[int, int], tuple[float, str]],
    scale: Sequence[tuple[float, str]],
    hover: str = "%{y}, %{x}",
) -> go.Heatmap:
    """Draw a table whose cells, by row and column, have a shade and words; others are empty."""
    values = np.full((len(y), len(x)), np.nan)
    words = np.full(values.shape, "", dtype=object)
    for at, (value, text) in cells.items():
        values[at], words[at] = value, text
    return go.Heatmap(
        z=values, x=list(x), y=list(y), text=words, texttemplate="%{text}",
        textfont={"size": 13, "color": INK}, colorscale=[list(step) for step in scale],
        showscale=False, xgap=2, ygap=2, hovertemplate=hover + ": %{text}<extra></extra>",
    )  # fmt: skip


def frame(figure: go.Figure, i: int, j: int, dash: str = "solid", **where: int) -> None:
    """Draw a frame round the cell in row *i* and column *j*; it tells without colour."""
    cover(figure, (i, j), line={"color": INK, "width": 2, "dash": dash},
          fillcolor="rgba(0, 0, 0, 0)", opacity=1, **where)  # fmt: skip


def cover(figure: go.Figure, at: tuple[int, int], **look: object) -> None:
    """Draw a rectangle over the cell at a row and a column."""
    corners = {end: at["xy".index(end[0]) - 1] + off for end, off in CELL.items()}
    figure.add_shape(type="rect", **corners, **look)


def map_height(rows: int) -> int:
    """Return the height of a map, px."""
    return 130 + (46 if rows <= TALL else 28) * rows


def mismatch_axes(
    figure: go.Figure, mismatches: Sequence[float], height: int, row: int | None = None
) -> go.Figure:
    """Give panels of mean shift times over the mismatch their axes; ``row`` has the title."""
    mismatches = sorted(set(mismatches))
    if mismatches[0] > 0.0:
        figure.update_xaxes(type="log", tickvals=thinned(mismatches, 3), tickangle=0)
    figure.update_xaxes(title="mismatch, 1/min", row=row)
    figure.update_yaxes(rangemode="tozero")
    figure.update_yaxes(title="mean shift time, ms", col=1)
    return styled(figure, height)


def thinned(values: Sequence[T], most: int) -> list[T]:
    """Select at most so many of the values, first and last among them, evenly spread."""
    places = np.linspace(0, len(values) - 1, min(most, len(values))).round().astype(int)
    return [values[place] for place in dict.fromkeys(places.tolist())]
