"""Figures of single results: margins, predictions, comparisons, draws, probabilities, plans."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
import plotly.graph_objects as go

from dogshape.pipeline.reports.charts import BLUE, GREY, INK, MARKS, ORANGE, styled
from dogshape.pipeline.reports.designs import OWN_DOG
from dogshape.pipeline.reports.text import check_name
from dogshape.sim.statistics.expectation import Estimate, positive_interval

BAR_HEIGHT = 26  #: px, of a horizontal bar with its gap
FRAME_HEIGHT = 130  #: px, of axes and margins around the bars
FIGURE_HEIGHT = 420  #: px
MAX_SHOWN_MARGIN = 300.0  #: %, at which the axis of margins is cut
SLIDER_HEIGHT = 250  #: px, of the time over a slider
SLIDER_MARK_SIZE = 13  #: px
MAX_MARK_SIZE = 46.0  #: px, of the operating point with most planned shifts


def margins_figure(margins: Mapping[str, float]) -> go.Figure:
    """Draw the margin of each check, %, the smallest at the top; failed checks are hatched."""
    finite = {name: margin for name, margin in margins.items() if np.isfinite(margin)}
    names = sorted(finite, key=finite.__getitem__, reverse=True)
    percents = [100.0 * finite[name] for name in names]
    failed = [percent < 0.0 for percent in percents]
    figure = go.Figure(
        go.Bar(
            x=percents,
            y=[check_name(name) for name in names],
            orientation="h",
            marker={
                "color": [ORANGE if is_failed else BLUE for is_failed in failed],
                "pattern_shape": ["/" if is_failed else "" for is_failed in failed],
            },
            hovertemplate="%{y}: %{x:.1f} %<extra></extra>",
        )
    )
    figure.add_vline(0.0, line={"color": INK, "width": 1})
    low = min(0.0, *percents) if percents else 0.0
    high = min(MAX_SHOWN_MARGIN, max(percents, default=0.0))
    figure.update_xaxes(title="margin, %", range=[1.05 * low, 1.05 * max(high, 1.0)])
    figure.update_yaxes(automargin=True)
    return styled(figure, FRAME_HEIGHT + BAR_HEIGHT * len(names))


def times_figure(
    labels: Sequence[str], times: Sequence[float | None], errors: Sequence[float | None]
) -> go.Figure:
    """Draw expected shift times with 95 % intervals, ms, a mark for each label.

    ``times`` and standard ``errors`` are in s; None has no mark or no interval.
    """
    times_ms = np.array([math.nan if time is None else 1e3 * time for time in times])
    errors_ms = [1e3 * (error or 0.0) for error in errors]
    estimates = map(Estimate, times_ms.tolist(), errors_ms)
    lows, highs = np.transpose([positive_interval(estimate) for estimate in estimates])
    figure = go.Figure(
        go.Scatter(
            x=labels,
            y=times_ms,
            error_y={"array": highs - times_ms, "arrayminus": times_ms - lows},
            mode="markers",
            marker={"color": BLUE, "size": 11, "symbol": "diamond"},
        )
    )
    figure.update_yaxes(title="expected shift time, ms")
    return styled(figure, FIGURE_HEIGHT)


def ratios_figure(items: Mapping[str, Mapping[str, float]]) -> go.Figure:
    """Draw numbers of items over those of the first item, a group of bars for each key."""
    figure = go.Figure()
    first, *others = items
    for label in others:
        ratios = {
            key: items[label][key] / value
            for key, value in items[first].items()
            if value and key in items[label]
        }
        heights = [ratio - 1.0 for ratio in ratios.values()]
        texts = [f"{ratio:.3g}" for ratio in ratios.values()]
        figure.add_bar(x=list(ratios), y=heights, base=1.0, text=texts, name=label)
    figure.add_hline(1.0, line={"color": GREY, "width": 1})
    figure.update_yaxes(title=f"value over that of {first}", type="log")
    return styled(figure, FIGURE_HEIGHT)


def predictions_figure(
    rows: Sequence[int],
    times: Sequence[float],
    low: Sequence[float],
    high: Sequence[float],
    feasible: Sequence[bool],
) -> go.Figure:
    """Draw predicted shift times of designs with 95 % intervals, s, by their rows."""
    figure = go.Figure()
    time_ms = 1e3 * np.asarray(times, dtype=float)
    upper = 1e3 * np.asarray(high, dtype=float) - time_ms
    lower = time_ms - 1e3 * np.asarray(low, dtype=float)
    passes = np.asarray(feasible, dtype=bool)
    for label, chosen, mark in (
        ("no failed check", passes, {"color": BLUE, "symbol": "diamond", "size": 8}),
        ("a check fails", ~passes, {"color": INK, "symbol": "x-thin-open", "size": 8}),
    ):
        if chosen.any():
            figure.add_scatter(
                x=np.asarray(rows)[chosen],
                y=time_ms[chosen],
                error_y={"array": upper[chosen], "arrayminus": lower[chosen], "thickness": 1},
                name=label,
                mode="markers",
                marker=mark,
            )
    figure.update_xaxes(title="row of the table")
    figure.update_yaxes(title="predicted shift time, ms")
    return styled(figure, FIGURE_HEIGHT)


def draws_figure(times: Sequence[float], low: float, high: float) -> go.Figure:
    """Draw the distribution of expected shift times over draws with its 90 % interval, s."""
    finite = [1e3 * time for time in times if np.isfinite(time)]
    figure = go.Figure(go.Histogram(x=finite, marker={"color": BLUE}, name="draws"))
    for end in (low, high):
        figure.add_vline(1e3 * end, line={"color": ORANGE, "dash": "dash"})
    figure.update_xaxes(title="expected shift time, ms; dashed: 90 % interval")
    figure.update_yaxes(title="draws")
    return styled(figure, FIGURE_HEIGHT)


def probabilities_figure(
    names: Sequence[str], before: Sequence[float], after: Sequence[float]
) -> go.Figure:
    """Draw probabilities of hypotheses before and after new readings, %."""
    figure = go.Figure()
    for label, values, color in (("before", before, GREY), ("after", after, BLUE)):
        figure.add_bar(
            x=[100.0 * value for value in values],
            y=list(names),
            name=label,
            orientation="h",
            marker={"color": color},
        )
    figure.update_xaxes(title="probability, %", range=[0.0, 100.0])
    figure.update_yaxes(automargin=True, autorange="reversed")
    return styled(figure, FRAME_HEIGHT + 2 * BAR_HEIGHT * len(names))


def plan_figure(
    mismatches: Sequence[float], forces: Sequence[float], shifts: Sequence[int]
) -> go.Figure:
    """Draw the planned shifts by operating point, mismatch in 1/min and force in N."""
    most = max(shifts, default=1)
    figure = go.Figure(
        go.Scatter(
            x=mismatches,
            y=forces,
            mode="markers+text",
            text=[str(count) for count in shifts],
            marker={
                "color": BLUE,
                "opacity": 0.55,
                "size": [MAX_MARK_SIZE * (count / most) ** 0.5 for count in shifts],
            },
            hovertemplate="%{x} 1/min, %{y} N: %{text} shifts<extra></extra>",
        )
    )
    figure.update_xaxes(title="mismatch, 1/min")
    figure.update_yaxes(title="shift force, N")
    return styled(figure, FIGURE_HEIGHT)


def slider_figure(
    title: str,
    values: Sequence[float],
    times: Sequence[float],
    *,
    low: Sequence[float],
    high: Sequence[float],
    feasible: Sequence[bool],
    marks: Mapping[str, tuple[float, float]],
) -> go.Figure:
    """Draw predicted times with their 95 % band, ms, over a variable of the ``title``.

    The line is dashed where a check fails, and ends where there is no time. ``marks`` are value and
    time of ``this design`` and ``own dog``. ``times``, ``low`` and ``high`` are in s.
    """
    is_timed = ~np.isnan(times)
    shown_values = np.array(values)[is_timed].tolist()
    in_ms = 1e3 * np.array([times, low, high])[:, is_timed]
    passing = np.array(feasible)[is_timed]
    # A dash joins the neighbours on both sides.
    failing = ~passing
    failing[1:] |= ~passing[:-1]
    failing[:-1] |= ~passing[1:]
    figure = go.Figure()
    figure.add_scatter(
        x=[*shown_values, *reversed(shown_values)],
        y=[*in_ms[2], *reversed(in_ms[1])],
        fill="toself",
        fillcolor="rgba(31, 95, 168, 0.16)",
        line={"width": 0},
        hoverinfo="skip",
        showlegend=False,
    )
    for name, shown, dash in (("", passing, "solid"), ("a check fails", failing, "dot")):
        figure.add_scatter(
            x=shown_values,
            y=np.where(shown, in_ms[0], np.nan),
            mode="lines",
            line={"color": BLUE, "width": 2, "dash": dash},
            name=name,
            showlegend=bool(name) and not passing.all(),
            hovertemplate="%{x:.4g}: %{y:.1f} ms<extra></extra>",
        )
    looks = {OWN_DOG: MARKS[OWN_DOG], "this design": MARKS["chosen"]}
    for name, (value, time) in marks.items():
        figure.add_scatter(
            x=[value],
            y=[1e3 * time],
            mode="markers",
            name=name,
            marker=looks[name] | {"size": SLIDER_MARK_SIZE},
            hovertemplate="%{x:.4g}: %{y:.1f} ms<extra>" + name + "</extra>",
        )
    margin = 0.02 * (values[-1] - values[0])
    figure.update_xaxes(title=title, range=[values[0] - margin, values[-1] + margin])
    figure.update_yaxes(title="predicted time, ms", automargin=True)
    styled(figure, SLIDER_HEIGHT)
    return figure.update_layout(
        font={"size": 12}, margin={"l": 55, "r": 10, "t": 30, "b": 45}, dragmode=False
    )
