"""Bench times with the simulation without and with the leading hypothesis."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import plotly.graph_objects as go
from plotly.subplots import make_subplots

from dogshape.diagnosis.bench.comparison import Comparison
from dogshape.pipeline.reports.gap.point_rows import NINETY, CellRow, row_of
from dogshape.pipeline.reports.kit.look import BLUE, INK, ORANGE, Row, styled
from dogshape.pipeline.reports.kit.maps import mismatch_axes
from dogshape.pipeline.reports.kit.text import place_name

BESIDE = 4  #: panels side by side
MOST = 8  #: forces that have a panel each
BENCH: Row = {"color": INK, "size": 8, "symbol": "circle"}
PLAIN, LEADING = "without effects", "leading hypothesis, point held out"  #: names of curves
_Pick = Callable[[CellRow], tuple[float | None, float]]  #: time, s, and half its interval, ms


def before_figure(cells: list[CellRow], plain: str = PLAIN) -> go.Figure:
    """Draw mean times over mismatch, a panel for each force; a line each where forces are many.

    ``plain`` names the simulation; cells with a prediction have a second curve.
    """
    forces = sorted({cell.force_N for cell in cells})
    if len(forces) > MOST or len(cells) < 2 * len(forces):
        return _listed(cells, plain)
    columns = min(BESIDE, len(forces))
    rows = -(-len(forces) // columns)
    figure = make_subplots(
        rows, columns, shared_yaxes=True, subplot_titles=[f"{f:.4g} N" for f in forces],
        horizontal_spacing=0.03, vertical_spacing=0.16,
    )  # fmt: skip
    for place, force in enumerate(forces):
        those = sorted((c for c in cells if c.force_N == force), key=lambda c: c.mismatch_rpm)
        for trace in _curves(those, plain, first=place == 0):
            figure.add_trace(trace, place // columns + 1, place % columns + 1)
    figure = mismatch_axes(figure, [c.mismatch_rpm for c in cells], 130 + 290 * rows, rows)
    return figure.update_layout(legend={"y": 1.0 + 0.12 / rows}, margin={"t": 80})


def compared_figure(compared: Comparison) -> go.Figure:
    """Draw bench and simulated times of every operating point, ms over 1/min.

    The band is 90 % of what the difference may be by chance; it is drawn about the simulation.
    """
    cells = [row_of(one, one.standard_error) for one in compared.differences]
    return before_figure(cells, "simulated")


def _simulated(cell: CellRow) -> tuple[float | None, float]:
    return cell.simulated_s, _half(cell.simulated_error_s)


def _predicted(cell: CellRow) -> tuple[float | None, float]:
    return cell.predicted_s, _half(cell.predicted_error_s)


def _bench(cell: CellRow) -> tuple[float | None, float]:
    return cell.bench_s, _half(cell.bench_error_s)


def _half(error: float | None) -> float:
    return NINETY * 1e3 * (error or 0.0)


def _known(cells: Sequence[CellRow], pick: _Pick) -> list[tuple[CellRow, float, float]]:
    """Select the cells that have a time, with it and half its 90 % interval, ms."""
    picked = ((cell, *pick(cell)) for cell in cells)
    return [(cell, 1e3 * mean, half) for cell, mean, half in picked if mean is not None]


def _curves(cells: Sequence[CellRow], plain: str, *, first: bool) -> list[go.Scatter]:
    """Draw bands, lines and points of one force."""
    sides = (
        (plain, ORANGE, "rgba(200,89,12,0.16)", "dash", _simulated),
        (LEADING, BLUE, "rgba(31,95,168,0.22)", "solid", _predicted),
    )
    found = []
    for name, color, pale, dash, pick in sides:
        rows = _known(cells, pick)
        x, y = [cell.mismatch_rpm for cell, *_ in rows], [mean for _, mean, _ in rows]
        high, low = ([m + side * h for _, m, h in rows] for side in (1.0, -1.0))
        band = go.Scatter(
            x=x + x[::-1], y=high + low[::-1], fill="toself", fillcolor=pale, mode="lines",
            line={"width": 0}, hoverinfo="skip", showlegend=False,
        )  # fmt: skip
        line = go.Scatter(
            x=x, y=y, name=name, legendgroup=name, showlegend=first, mode="lines",
            line={"color": color, "dash": dash, "width": 2.5},
            hovertemplate="%{x:.4g} 1/min: %{y:.1f} ms<extra></extra>",
        )  # fmt: skip
        found += [band, line] if rows else []
    rows = _known(cells, _bench)
    points = go.Scatter(
        x=[cell.mismatch_rpm for cell, *_ in rows], y=[mean for _, mean, _ in rows],
        error_y={"array": [half for *_, half in rows], "thickness": 1.2},
        name="bench", legendgroup="bench", showlegend=first, mode="markers", marker=BENCH,
        hovertemplate="bench, %{x:.4g} 1/min: %{y:.1f} ms<extra></extra>",
    )  # fmt: skip
    return [*found, points]


def _listed(cells: list[CellRow], plain: str) -> go.Figure:
    """Draw a line for each operating point."""
    ordered = sorted(cells, key=lambda c: c.place, reverse=True)
    figure = go.Figure()
    for name, marker, pick in (
        (plain, {"color": ORANGE, "symbol": "square-open", "size": 10}, _simulated),
        (LEADING, {"color": BLUE, "symbol": "diamond", "size": 10}, _predicted),
        ("bench", BENCH, _bench),
    ):
        if rows := _known(ordered, pick):
            figure.add_scatter(
                x=[mean for _, mean, _ in rows], y=[place_name(*c.place) for c, *_ in rows],
                error_x={"array": [half for *_, half in rows], "thickness": 1.2}, name=name,
                mode="markers", marker=marker,
                hovertemplate=f"{name}, %{{y}}: %{{x:.1f}} ms<extra></extra>",
            )  # fmt: skip
    names = [place_name(*cell.place) for cell in ordered]
    figure.update_xaxes(title="mean shift time, ms", rangemode="tozero")
    figure.update_yaxes(type="category", categoryorder="array", categoryarray=names)
    figure.update_yaxes(automargin=True)
    return styled(figure, 130 + 26 * len(names))
