"""Figures of the page: effects, indices, and slices that its choices redraw."""

from __future__ import annotations

from typing import Any

import plotly.graph_objects as go
from plotly.subplots import make_subplots

from dogshape.pipeline.reports.kit.html import figure_html
from dogshape.pipeline.reports.kit.look import BLUE, GREY, INK, ORANGE, Row, styled
from dogshape.pipeline.reports.kit.text import axis, label, value

Series = dict[str, list[Any]]

BAND = "rgba(31, 95, 168, 0.22)"
COLUMNS = 4  #: panels beside each other
#: Series of a panel of slices in the order of their traces, with their look and legend.
LOOKS: dict[str, Row] = {
    "95 % interval": {
        "mode": "lines", "fill": "toself", "fillcolor": BAND, "line": {"width": 0},
        "hoverinfo": "skip",
    },
    "passes every check": {"mode": "lines", "line": {"color": BLUE, "width": 2.5}},
    "fails a check": {"mode": "lines", "line": {"color": INK, "width": 1.5, "dash": "dot"}},
    "the design, or its operating point": {
        "mode": "markers",
        "marker": {
            "color": ORANGE, "size": 13, "symbol": "star", "line": {"color": INK, "width": 1},
        },
    },
}  # fmt: skip


def effects_figure(effects: Row) -> go.Figure:
    """Draw the main effect of each variable with its band."""
    shown = effects["variables"]
    figure = _panels(len(shown), 3)
    for place, effect in enumerate(shown):
        x, where = effect["values"], _where(place, 3)
        band = _band(x, effect["low_s"], effect["high_s"])
        figure.add_trace(_trace("95 % interval", band, LOOKS["95 % interval"], place), **where)
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


def slices_figure(base: Row) -> go.Figure:
    """Draw the slices through a base at its first choice of operating points."""
    names = list(base["operating"][0]["curves"])
    figure = _panels(len(names), COLUMNS)
    first = slice_series(base, base["operating"][0])
    for place, name in enumerate(names):
        series = first[place * len(LOOKS) : (place + 1) * len(LOOKS)]
        for (said, look), one in zip(LOOKS.items(), series, strict=True):
            shown = _with_marks(look) if name == "count" and said != "95 % interval" else look
            figure.add_trace(_trace(said, one, shown, place), **_where(place, COLUMNS))
        title = {"text": axis(name), "font": {"size": 11.5}}  # four are in a row on paper
        figure.update_xaxes(title=title, **_where(place, COLUMNS))
        curve = base["operating"][0]["curves"][name]
        if "values" in curve:
            figure.update_yaxes(rangemode="tozero", **_where(place, COLUMNS))
            figure.update_xaxes(**_ticks(curve), **_where(place, COLUMNS))
        else:
            figure.update_yaxes(matches="y", **_where(place, COLUMNS))
    figure.update_yaxes(showticklabels=True)
    figure.update_yaxes(title="time, ms", col=1)  # a longer one overlaps the next row on paper
    return styled(figure, 110 + 260 * _rows(len(names), COLUMNS))


def _ticks(curve: Row) -> Row:
    """Return the axis of mismatch or force: few ticks on a logarithmic one."""
    if not curve["logarithmic"] or not curve["values"]:
        return {}
    low, high = min(curve["values"]), max(curve["values"])
    steps = (1, 2, 5) if high > 8.0 * low else range(1, 10)
    every = [step * 10.0**power for power in range(-3, 7) for step in steps]
    return {"type": "log", "tickvals": [tick for tick in every if low <= tick <= high]}


def slice_series(base: Row, choice: Row) -> list[Series]:
    """Compute x, y and words of all traces of the slices, panel by panel."""
    found: list[Series] = []
    for name, curve in choice["curves"].items():
        along = base["variables"].get(name)
        if along is None:
            clear: list[list[str]] = [[] for _ in curve["values"]]
            found += _series(name, curve, curve["values"], clear, curve["own"])
        else:
            own = base["design"][name]
            found += _series(name, curve, along["values"], along["failed"], own)
    return found


def _series(
    name: str, curve: Row, x: list[float], failed: list[list[str]], own: float | None
) -> list[Series]:
    time, words = _ms(curve["time_s"]), _words(name, curve, x, failed)
    near = [any(failed[max(0, k - 1) : k + 2]) for k in range(len(x))]
    passing = [None if out else t for t, out in zip(time, failed, strict=True)]
    failing = [t if out else None for t, out in zip(time, near, strict=True)]
    at = [] if own is None or not x else [min(range(len(x)), key=lambda k: abs(x[k] - own))]
    return [
        _band(x, curve["low_s"], curve["high_s"]),
        {"x": x, "y": passing, "text": words},
        {"x": x, "y": failing, "text": words},
        {"x": [x[k] for k in at], "y": [time[k] for k in at], "text": [words[k] for k in at]},
    ]


def _words(name: str, curve: Row, x: list[float], failed: list[list[str]]) -> list[str]:
    columns = (x, _ms(curve["time_s"]), _ms(curve["low_s"]), _ms(curve["high_s"]), failed)
    lines = []
    for number, time, low, high, out in zip(*columns, strict=True):
        fails = f"<br>fails {', '.join(out).replace('_', ' ')}" if out else ""
        lines.append(f"{value(name, number)}: {time:.1f} ms ({low:.1f} to {high:.1f}){fails}")
    return lines


def _band(x: list[float], low: list[float], high: list[float]) -> Series:
    return {"x": [*x, *reversed(x)], "y": [*_ms(high), *reversed(_ms(low))], "text": []}


def _trace(name: str, series: Series, look: Row, place: int) -> go.Scatter:
    words = series.get("text", [])
    hover = {} if "hoverinfo" in look or not words else {"hoverinfo": "text"}
    return go.Scatter(name=name, legendgroup=name, showlegend=place == 0, **series, **look, **hover)


def _with_marks(look: Row) -> Row:
    if look["mode"] == "markers":
        return look
    solid = "dash" not in look["line"]
    symbol = "circle" if solid else "circle-open"
    return look | {"mode": "lines+markers", "marker": {"size": 5, "symbol": symbol}}


def _panels(count: int, columns: int) -> go.Figure:
    rows, beside = _rows(count, columns), min(count, columns)
    return make_subplots(rows, beside, horizontal_spacing=0.06, vertical_spacing=0.26 / rows)


def _rows(count: int, columns: int) -> int:
    return -(-count // columns)


def _where(place: int, columns: int) -> Row:
    return {"row": place // columns + 1, "col": place % columns + 1}


def _ms(seconds: list[float]) -> list[float]:
    return [float(f"{1e3 * value:.5g}") for value in seconds]
