"""Figures of a diagnosis: map of the gap, inclusion of the effects, phases along the shift."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import plotly.graph_objects as go
from plotly.subplots import make_subplots

from dogshape.diagnosis.diagnosis import Diagnosis
from dogshape.diagnosis.report.phase_times import PhaseGap
from dogshape.diagnosis.report.wording import chance
from dogshape.pipeline.reports.gap.point_rows import NINETY, CellRow, unreadable
from dogshape.pipeline.reports.kit.look import BLUE, GREY, INK, ORANGE, Row, styled
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
LEAST = 0.01  #: probability from which an effect has a bar
FASTER_TO_SLOWER = tuple(
    (share, color)
    for (share, _), (_, color) in zip(LOSS_TO_GAIN, reversed(LOSS_TO_GAIN), strict=True)
)
#: Bars that differ without colour.
SOLID: Row = {"color": BLUE, "line": {"color": INK, "width": 1}}
HOLLOW: Row = {"color": "white", "line": {"color": INK, "width": 1}}
HATCHED: Row = {
    "color": ORANGE, "line": {"color": INK, "width": 1},
    "pattern": {"shape": "/", "fgcolor": "white", "size": 7},
}  # fmt: skip


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


def inclusion_figure(found: Diagnosis) -> go.Figure:
    """Draw the probability of each effect to be part of the cause; named effects are filled."""
    those = [(n, p) for n, p in found.inclusion.items() if p >= LEAST or n in found.verdict.causes]
    those.sort(key=lambda one: one[1])
    named = [name in found.verdict.causes for name, _ in those]
    figure = go.Figure()
    for title, marker, inside in (("named", SOLID, True), ("not named", HOLLOW, False)):
        bars = [one for one, there in zip(those, named, strict=True) if there == inside]
        if bars:
            figure.add_bar(
                y=[found.effects[name].plain for name, _ in bars], x=[p for _, p in bars],
                name=title, orientation="h", marker=marker, width=0.6,
                text=[chance(p) for _, p in bars], textposition="outside", cliponaxis=False,
                hovertemplate="%{y}: %{text}<extra></extra>",
            )  # fmt: skip
    names = [found.effects[name].plain for name, _ in those]
    figure.update_layout(barmode="overlay", legend={"traceorder": "normal"})
    figure.update_yaxes(categoryorder="array", categoryarray=names, automargin=True, ticks="")
    fifths = [0.0, 0.2, 0.4, 0.6, 0.8, 1.0]
    figure.update_xaxes(title="probability", range=[0.0, 1.12], tickformat=".0%", tickvals=fifths)
    return styled(figure, 130 + 34 * len(names))


def phases_figure(phases: Sequence[PhaseGap]) -> go.Figure:
    """Draw the mean duration of each phase on the bench and in the simulation, ms."""
    figure = go.Figure()
    names = [phase.name for phase in phases]
    sides = (
        ("simulation", HATCHED, [p.simulated_mean for p in phases]),
        ("bench", SOLID, [p.bench_mean for p in phases]),
    )
    for name, marker, means in sides:
        figure.add_bar(
            x=names, y=[1e3 * mean for mean in means], name=name, marker=marker,
            hovertemplate=f"{name}, %{{x}}: %{{y:.1f}} ms<extra></extra>",
        )  # fmt: skip
    for phase in phases:
        top = 1e3 * max(phase.bench_mean, phase.simulated_mean)
        figure.add_annotation(
            x=phase.name, y=top, text=phase_words(phase), showarrow=False, yshift=14,
        )  # fmt: skip
    figure.update_layout(barmode="group")
    figure.update_yaxes(title="mean duration, ms", rangemode="tozero")
    return styled(figure, 360)


def phase_words(phase: PhaseGap) -> str:
    """Print the gap of a phase with its 90 % interval, ms."""
    return minus(f"{1e3 * phase.gap:+.1f} ± {NINETY * 1e3 * phase.standard_error:.1f}")
