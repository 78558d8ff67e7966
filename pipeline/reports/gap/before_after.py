"""Before and after: bench times with the simulation without and with the leading hypothesis."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import plotly.graph_objects as go
from plotly.subplots import make_subplots

from dogshape.pipeline.reports.gap.point_rows import NINETY, CellRow
from dogshape.pipeline.reports.kit.look import BLUE, INK, ORANGE, styled
from dogshape.pipeline.reports.kit.maps import MINUS
from dogshape.pipeline.reports.surrogate.asked_points import spread

BESIDE = 4  #: panels side by side
MOST = 8  #: forces that have a panel each
BENCH: dict[str, Any] = {"color": INK, "size": 8, "symbol": "circle"}
PLAIN = "without any effect"  #: name of the simulation before
_Pick = Callable[[CellRow], float | None]


def before_figure(cells: list[CellRow], leading: str, plain: str = PLAIN) -> go.Figure:
    """Draw mean times over mismatch, a panel for each force; a line each where forces are many.

    ``leading`` names what the second curve has, empty for no such curve; ``plain`` is the first.
    """
    forces = sorted({cell.force_N for cell in cells})
    if len(forces) > MOST or len(cells) < 2 * len(forces):
        return _listed(cells, leading, plain)
    columns = min(BESIDE, len(forces))
    rows = -(-len(forces) // columns)
    figure = make_subplots(
        rows, columns, shared_yaxes=True, subplot_titles=[f"{f:.4g} N" for f in forces],
        horizontal_spacing=0.03, vertical_spacing=0.16,
    )  # fmt: skip
    for place, force in enumerate(forces):
        row, column = place // columns + 1, place % columns + 1
        those = sorted((c for c in cells if c.force_N == force), key=lambda c: c.mismatch_rpm)
        for trace in _curves(those, leading, plain, first=place == 0):
            figure.add_trace(trace, row, column)
    _axes(figure, cells, rows)
    return figure


def _axes(figure: go.Figure, cells: list[CellRow], rows: int) -> None:
    mismatches = sorted({cell.mismatch_rpm for cell in cells})
    if mismatches[0] > 0.0:
        figure.update_xaxes(type="log", tickvals=spread(mismatches, 3), tickangle=0)
    figure.update_xaxes(title="mismatch, 1/min", row=rows)
    figure.update_yaxes(rangemode="tozero")
    figure.update_yaxes(title="mean shift time, ms", col=1)
    styled(figure, 130 + 290 * rows)
    figure.update_layout(legend={"y": 1.0 + 0.12 / rows}, margin={"t": 80})


def _curves(cells: Sequence[CellRow], leading: str, plain: str, *, first: bool) -> list[go.Scatter]:
    """Return bands, lines and points of one force."""
    found = _line(
        cells, (plain, ORANGE, "rgba(200,89,12,0.16)", "dash"),
        lambda c: c.simulated_s, lambda c: c.simulated_error_s, first=first,
    )  # fmt: skip
    if leading:
        found += _line(
            cells, (f"with {leading}", BLUE, "rgba(31,95,168,0.22)", "solid"),
            lambda c: c.foretold_s, lambda c: c.foretold_error_s, first=first,
        )  # fmt: skip
    return [*found, _bench(cells, first=first)]


def _line(
    cells: Sequence[CellRow],
    look: tuple[str, str, str, str],
    mean: _Pick,
    error: _Pick,
    *,
    first: bool,
) -> list[go.Scatter]:
    """Return a line with its 90 % band."""
    name, color, pale, dash = look
    x = [c.mismatch_rpm for c in cells if mean(c) is not None]
    y = [1e3 * m for c in cells if (m := mean(c)) is not None]
    half = [NINETY * 1e3 * (error(c) or 0.0) for c in cells if mean(c) is not None]
    high, low = ([a + s * b for a, b in zip(y, half, strict=True)] for s in (1.0, -1.0))
    band = go.Scatter(
        x=x + x[::-1], y=high + low[::-1], fill="toself", fillcolor=pale, mode="lines",
        line={"width": 0}, hoverinfo="skip", showlegend=False,
    )  # fmt: skip
    line = go.Scatter(
        x=x, y=y, name=name, legendgroup=name, showlegend=first, mode="lines",
        line={"color": color, "dash": dash, "width": 2.5},
        hovertemplate="%{x:.4g} 1/min: %{y:.1f} ms<extra></extra>",
    )  # fmt: skip
    return [band, line] if x else []


def _bench(cells: Sequence[CellRow], *, first: bool) -> go.Scatter:
    """Return the bench's means with 90 % bars."""
    having = [c for c in cells if c.bench_s is not None]
    return go.Scatter(
        x=[c.mismatch_rpm for c in having], y=[1e3 * (c.bench_s or 0.0) for c in having],
        error_y={"array": [_half(c.bench_error_s) for c in having], "thickness": 1.2},
        name="bench", legendgroup="bench", showlegend=first, mode="markers", marker=BENCH,
        hovertemplate="bench, %{x:.4g} 1/min: %{y:.1f} ms<extra></extra>",
    )  # fmt: skip


def _half(error: float | None) -> float:
    return NINETY * 1e3 * (error or 0.0)


def _listed(cells: list[CellRow], leading: str, plain: str) -> go.Figure:
    """Draw a line for each operating point."""
    ordered = sorted(cells, key=lambda c: c.place, reverse=True)
    names = [f"{c.mismatch_rpm:.4g} 1/min, {c.force_N:.4g} N".replace("-", MINUS) for c in ordered]
    marks: list[tuple[str, dict[str, Any], _Pick, _Pick]] = [
        (plain, {"color": ORANGE, "symbol": "square-open", "size": 10},
         lambda c: c.simulated_s, lambda c: c.simulated_error_s),
        (f"with {leading}", {"color": BLUE, "symbol": "diamond", "size": 10},
         lambda c: c.foretold_s, lambda c: c.foretold_error_s),
        ("bench", BENCH, lambda c: c.bench_s, lambda c: c.bench_error_s),
    ]  # fmt: skip
    figure = go.Figure()
    for name, marker, mean, error in marks:
        rows = [(n, m, error(c)) for n, c in zip(names, ordered, strict=True)
                if (m := mean(c)) is not None]  # fmt: skip
        if rows:
            figure.add_scatter(
                x=[1e3 * m for _, m, _ in rows], y=[n for n, _, _ in rows], name=name,
                error_x={"array": [_half(e) for *_, e in rows], "thickness": 1.2},
                mode="markers", marker=marker,
                hovertemplate=f"{name}, %{{y}}: %{{x:.1f}} ms<extra></extra>",
            )  # fmt: skip
    figure.update_xaxes(title="mean shift time, ms", rangemode="tozero")
    figure.update_yaxes(type="category", categoryorder="array", categoryarray=names)
    figure.update_yaxes(automargin=True)
    return styled(figure, 130 + 26 * len(names))
