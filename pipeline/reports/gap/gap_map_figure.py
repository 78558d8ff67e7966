"""Map of the gap over mismatch and force, in ms and in standard errors."""

from __future__ import annotations

import math
from collections.abc import Callable

import plotly.graph_objects as go
from plotly.subplots import make_subplots

from dogshape.pipeline.reports.gap.point_rows import CellRow, unreadable
from dogshape.pipeline.reports.kit.look import GREY, styled
from dogshape.pipeline.reports.kit.maps import (
    LOSS_TO_GAIN,
    cover,
    frame,
    grid,
    has_room,
    map_height,
    shaded_cells,
)
from dogshape.pipeline.reports.kit.text import minus, place_name

CLEAR = 2.0  #: standard errors from which a gap is framed
DEEP = 4.0  #: standard errors that have the deepest color, if none is larger
FILLED = 0.5  #: share of a grid that must be filled to be drawn as one
FASTER_TO_SLOWER = tuple(
    (share, color)
    for (share, _), (_, color) in zip(LOSS_TO_GAIN, reversed(LOSS_TO_GAIN), strict=True)
)


def gap_map_figure(cells: list[CellRow]) -> go.Figure:
    """Draw the gap of each operating point in ms and in standard errors, side by side.

    Points that are no grid have a line each.
    """
    mismatches, forces, places = grid(cells, lambda cell: cell.place)
    as_grid = has_room(mismatches, forces) and len(cells) >= FILLED * len(mismatches) * len(forces)
    columns, rows = [f"{f:.4g}" for f in forces], [minus(f"{m:.4g}") for m in mismatches]
    if not as_grid:
        ordered = sorted(cells, key=lambda c: c.place, reverse=True)
        columns, rows = ["gap"], [place_name(*c.place) for c in ordered]
        places = {(row, 0): cell for row, cell in enumerate(ordered)}
    titles = ["bench less simulation, ms", "the same in standard errors"]
    figure = make_subplots(1, 2, shared_yaxes=True, subplot_titles=titles, horizontal_spacing=0.04)
    # A gap that is clear of no error has no deep color.
    for column, panel in enumerate(((_in_ms, 0.0), (_in_errors, DEEP)), start=1):
        _panel(figure, column, (columns, rows), places, panel)
    named = len(columns) > 1
    figure.update_xaxes(type="category", title="shift force, N" if named else None)
    figure.update_yaxes(type="category")
    figure.update_yaxes(title="mismatch, 1/min" if named else None, col=1)
    return styled(figure, map_height(len(rows))).update_layout(margin={"t": 40})


def _panel(
    figure: go.Figure,
    column: int,
    names: tuple[list[str], list[str]],
    places: dict[tuple[int, int], CellRow],
    panel: tuple[Callable[[CellRow], tuple[float | None, str]], float],
) -> None:
    """Draw the cells; ``panel`` says what of each, and what has the deepest color at least."""
    say, least = panel
    shaded = {}
    for at, cell in places.items():
        number, words = say(cell)
        if number is not None:
            shaded[at] = number, words
            continue
        # Say on grey why the cell has no gap.
        cover(figure, at, line={"width": 0}, fillcolor=GREY, opacity=0.25, row=1, col=column)
        figure.add_annotation(
            x=at[1], y=at[0], text=words.replace(" ", "<br>"), showarrow=False, font={"size": 12},
            row=1, col=column,
        )  # fmt: skip
    most = max([least, *(abs(number) for number, _ in shaded.values())]) or 1.0
    trace = shaded_cells(*names, shaded, FASTER_TO_SLOWER)
    figure.add_trace(trace.update(zmin=-most, zmax=most), 1, column)
    for at, cell in places.items():
        if cell.z is not None and abs(cell.z) >= CLEAR:
            frame(figure, *at, row=1, col=column)


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
    return minus(f"{value:+.{digits}f}")
