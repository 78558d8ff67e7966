"""Figures of the effects and Sobol indices of a study's variables."""

from __future__ import annotations

from typing import Any

import plotly.graph_objects as go
from plotly.subplots import make_subplots

from dogshape.pipeline.reports.kit.html import figure_html
from dogshape.pipeline.reports.kit.look import BLUE, GREY, INK, Row, styled
from dogshape.pipeline.reports.kit.text import axis, label

Series = dict[str, list[Any]]

BAND = "rgba(31, 95, 168, 0.22)"
BAND_LOOK: Row = {
    "mode": "lines", "fill": "toself", "fillcolor": BAND, "line": {"width": 0},
    "hoverinfo": "skip",
}  # fmt: skip


def effects_figure(effects: Row) -> go.Figure:
    """Draw the main effect of each variable with its band."""
    shown = effects["variables"]
    figure = _panels(len(shown), 3)
    for place, effect in enumerate(shown):
        x, where = effect["values"], _where(place, 3)
        ends = [*_ms(effect["high_s"]), *reversed(_ms(effect["low_s"]))]
        band = {"x": [*x, *reversed(x)], "y": ends}
        figure.add_trace(_trace("95 % interval", band, BAND_LOOK, place), **where)
        line = {"x": x, "y": _ms(effect["effect_s"])}
        look = {"mode": "lines+markers", "line": {"color": BLUE, "width": 2.5}}
        figure.add_trace(_trace("effect on the expected shift time", line, look, place), **where)
        figure.add_hline(0.0, line={"color": GREY, "width": 1}, **where)
        figure.update_xaxes(title=axis(effect["variable"]), **where)
    figure.update_yaxes(matches="y", showticklabels=True, range=_effect_range(shown))
    figure.update_yaxes(title="effect, ms", col=1)
    return styled(figure, 110 + 260 * _rows(len(shown), 3))


def _effect_range(shown: list[Row]) -> tuple[float, float]:
    """Give the range of effects in ms: all lines, and of wide bands as much again either way."""
    lines = [value for one in shown for value in _ms(one["effect_s"])]
    room = 0.1 * (span := max(lines) - min(lines) or 1.0)
    ends = [value for one in shown for key in ("low_s", "high_s") for value in _ms(one[key])]
    low = max(min(ends) - room, min(lines) - span)
    return low, min(max(ends) + room, max(lines) + span)


def indices_figure(found: Row) -> go.Figure:
    """Draw first-order and total index of each input with their intervals."""
    inputs = list(reversed(found["inputs"]))
    looks = {
        "total": ("total: with all that it does together with others", "#b9c9dd", "/"),
        "first": ("first-order: alone", BLUE, ""),
    }
    figure = go.Figure()
    for key, (name, colour, pattern) in looks.items():
        figure.add_bar(
            orientation="h",
            x=[one[key] for one in inputs],
            y=[label(one["variable"]) for one in inputs],
            error_x={"array": [one[f"{key}_half_width"] for one in inputs], "thickness": 1.2},
            name=name,
            marker={"color": colour, "pattern": {"shape": pattern}, "line": {"color": INK}},
            hovertemplate="%{y}: %{x:.2f}<extra></extra>",
        )
    figure.update_xaxes(title="share of the variance", rangemode="tozero")
    look = {"barmode": "group", "margin": {"l": 140}, "legend": {"traceorder": "reversed"}}
    return styled(figure, 130 + 48 * len(inputs)).update_layout(look)


def indices_html(indices: list[Row]) -> list[tuple[Row, str]]:
    """Draw each record of indices; give the records with their figures."""
    return [
        (found, figure_html(indices_figure(found), f"indices-{place}"))
        for place, found in enumerate(indices)
    ]


def _trace(name: str, series: Series, look: Row, place: int) -> go.Scatter:
    return go.Scatter(name=name, legendgroup=name, showlegend=place == 0, **series, **look)


def _panels(count: int, columns: int) -> go.Figure:
    rows, beside = _rows(count, columns), min(count, columns)
    return make_subplots(rows, beside, horizontal_spacing=0.06, vertical_spacing=0.26 / rows)


def _rows(count: int, columns: int) -> int:
    return -(-count // columns)


def _where(place: int, columns: int) -> Row:
    return {"row": place // columns + 1, "col": place % columns + 1}


def _ms(seconds: list[float]) -> list[float]:
    return [float(f"{1e3 * value:.5g}") for value in seconds]
