"""Where the gap is: over mismatch and force, in ms and in standard errors."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from dogshape.pipeline.reports.gap.point_rows import CellRow, unreadable
from dogshape.pipeline.reports.kit.look import GREY, styled
from dogshape.pipeline.reports.kit.maps import (
    LOSS_TO_GAIN,
    MINUS,
    MOST,
    cells_with_words,
    frame,
    map_height,
)

CLEAR = 2.0  #: standard errors from which a gap is framed
FILLED = 0.5  #: share of a grid that must be filled to be drawn as one
FASTER_TO_SLOWER = tuple(
    (share, color)
    for (share, _), (_, color) in zip(LOSS_TO_GAIN, reversed(LOSS_TO_GAIN), strict=True)
)


def gap_map_figure(cells: list[CellRow]) -> go.Figure:
    """Draw the gap of each operating point in ms and in standard errors, side by side.

    Points that are no grid have a line each.
    """
    columns, rows, places = _layout(cells)
    titles = ["bench less simulation, ms", "the same in standard errors"]
    figure = make_subplots(1, 2, shared_yaxes=True, subplot_titles=titles, horizontal_spacing=0.04)
    for column, say in enumerate((_in_ms, _in_errors), start=1):
        _panel(figure, column, (columns, rows), places, say)
    as_grid = len(columns) > 1
    figure.update_xaxes(type="category", title="shift force, N" if as_grid else None)
    figure.update_yaxes(type="category")
    figure.update_yaxes(title="mismatch, 1/min" if as_grid else None, col=1)
    figure = styled(figure, map_height(len(rows)))
    figure.update_layout(margin={"t": 40})
    return figure


def _layout(
    cells: list[CellRow],
) -> tuple[list[str], list[str], dict[tuple[int, int], CellRow]]:
    """Return names of columns and rows, and which cell is in which row and column."""
    mismatches = sorted({cell.mismatch_rpm for cell in cells})
    forces = sorted({cell.force_N for cell in cells})
    fits = len(mismatches) <= MOST[0] and len(forces) <= MOST[1]
    if fits and len(cells) >= FILLED * len(mismatches) * len(forces):
        places = {(mismatches.index(c.mismatch_rpm), forces.index(c.force_N)): c for c in cells}
        return [f"{f:.4g}" for f in forces], [_signed(m) for m in mismatches], places
    ordered = sorted(cells, key=lambda c: c.place, reverse=True)
    names = [f"{_signed(c.mismatch_rpm)} 1/min, {c.force_N:.4g} N" for c in ordered]
    return ["gap"], names, {(row, 0): cell for row, cell in enumerate(ordered)}


def _signed(value: float) -> str:
    return f"{value:.4g}".replace("-", MINUS)


def _panel(
    figure: go.Figure,
    column: int,
    names: tuple[list[str], list[str]],
    places: dict[tuple[int, int], CellRow],
    say: Callable[[CellRow], tuple[float | None, str]],
) -> None:
    values = np.full((len(names[1]), len(names[0])), np.nan)
    words = np.full(values.shape, "", dtype=object)
    for (i, j), cell in places.items():
        number, said = say(cell)
        if number is None:
            _mark(figure, column, (i, j), said)
        else:
            values[i, j], words[i, j] = number, said
    known = values[np.isfinite(values)]
    most = float(np.abs(known).max()) if known.size else 1.0
    trace = cells_with_words(*names, values, words, FASTER_TO_SLOWER)
    figure.add_trace(trace.update(zmin=-most or -1.0, zmax=most or 1.0), 1, column)
    for (i, j), cell in places.items():
        if cell.z is not None and abs(cell.z) >= CLEAR:
            frame(figure, i, j, row=1, col=column)


def _mark(figure: go.Figure, column: int, at: tuple[int, int], words: str) -> None:
    """Write into a cell that has no gap why, on grey."""
    i, j = at
    figure.add_shape(
        type="rect", x0=j - 0.47, x1=j + 0.47, y0=i - 0.46, y1=i + 0.46, line={"width": 0},
        fillcolor=GREY, opacity=0.25, row=1, col=column,
    )  # fmt: skip
    figure.add_annotation(
        x=j, y=i, text=words.replace(" ", "<br>"), showarrow=False, font={"size": 12}, row=1,
        col=column,
    )  # fmt: skip


def _in_ms(cell: CellRow) -> tuple[float | None, str]:
    if cell.gap_s is None:
        return None, unreadable(cell)
    gap = 1e3 * cell.gap_s
    few = f"<br>{cell.engaged}/{cell.engaged + cell.failed}" if cell.failed else ""
    return gap, _plus(gap) + few


def _in_errors(cell: CellRow) -> tuple[float | None, str]:
    return (None, unreadable(cell)) if cell.z is None else (cell.z, _plus(cell.z))


def _plus(value: float) -> str:
    digits = 0 if math.fabs(value) >= 9.95 else 1
    return f"{value:+.{digits}f}".replace("-", MINUS)
