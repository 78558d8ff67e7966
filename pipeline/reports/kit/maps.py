"""Maps over mismatch and shift force: a cell with its number at each operating point."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import plotly.graph_objects as go

from dogshape.pipeline.reports.kit.look import INK, Row

MINUS = "\N{MINUS SIGN}"
MOST = (16, 6)  #: mismatches and forces of a grid that maps have room for
TALL = 8  #: rows of a map above which they are low
#: Slower is orange, faster blue; both pale, so that the numbers stay readable in grey.
LOSS_TO_GAIN = ((0.0, "#f0b48a"), (0.5, "#ffffff"), (1.0, "#8db9e2"))


def grid(points: list[Row]) -> tuple[list[float], list[float], dict[tuple[int, int], Row]]:
    """Return mismatches and forces in order, and which point is in which row and column."""
    mismatches = sorted({p["mismatch_rpm"] for p in points})
    forces = sorted({p["force_N"] for p in points})
    places = {(mismatches.index(p["mismatch_rpm"]), forces.index(p["force_N"])): p for p in points}
    return mismatches, forces, places


def heat_map(
    mismatches: list[float],
    forces: list[float],
    values: np.ndarray,
    words: np.ndarray,
    scale: tuple[tuple[float, str], ...],
) -> go.Heatmap:
    """Return a map with words in its cells; values and words are (mismatches, forces)."""
    return cells_with_words(
        [f"{force:.4g}" for force in forces],
        [f"{mismatch:.4g}" for mismatch in mismatches],
        values,
        words,
        scale,
    ).update(hovertemplate="%{y} 1/min, %{x} N: %{text}<extra></extra>")


def cells_with_words(
    x: Sequence[str],
    y: Sequence[str],
    values: np.ndarray,
    words: np.ndarray,
    scale: tuple[tuple[float, str], ...],
) -> go.Heatmap:
    """Return a table whose cells have a shade and words, (y, x)."""
    return go.Heatmap(
        z=values,
        x=list(x),
        y=list(y),
        text=words,
        texttemplate="%{text}",
        textfont={"size": 13, "color": INK},
        colorscale=[list(step) for step in scale],
        showscale=False,
        xgap=2,
        ygap=2,
        hovertemplate="%{y}, %{x}: %{text}<extra></extra>",
    )


def frame(figure: go.Figure, i: int, j: int, dash: str = "solid", **where: int) -> None:
    """Draw a frame round the cell in row *i* and column *j*; it tells without colour."""
    figure.add_shape(
        type="rect", x0=j - 0.47, x1=j + 0.47, y0=i - 0.46, y1=i + 0.46,
        line={"color": INK, "width": 2, "dash": dash},
        fillcolor="rgba(0, 0, 0, 0)", opacity=1, **where,
    )  # fmt: skip


def map_height(rows: int) -> int:
    """Return the height of a map, px."""
    return 130 + (46 if rows <= TALL else 28) * rows
