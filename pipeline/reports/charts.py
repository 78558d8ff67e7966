"""Figures of results, with one look.

What a colour says, a marker says too, so that a page can be printed in grey.
"""

from __future__ import annotations

import cmath
import math
import re
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import plotly.graph_objects as go
import plotly.io as pio
from plotly.io.base_renderers import NotebookRenderer
from plotly.subplots import make_subplots

from dogshape.pipeline.reports.designs import (
    FAILS,
    MARGIN,
    OWN_DOG,
    UNCLEAR,
    Goal,
    confirmation_of,
    design_name,
    goals_of,
    objection,
    of_kinds,
)
from dogshape.pipeline.reports.surrogate_findings import VariableEffect
from dogshape.pipeline.reports.text import PLACE, axis, check_name, minus, place_name
from dogshape.pipeline.search.study_record import DesignRow, StudyRecord
from dogshape.pipeline.simulate.design import SIMULATED
from dogshape.pipeline.store.check_records import HingeRow
from dogshape.pipeline.store.result_records import PlaceRow, PointRow
from dogshape.sim.statistics.expectation import Estimate, positive_interval
from dogshape.sim.units import short


class OfflineRenderer(NotebookRenderer):  # type: ignore[misc]  # plotly has no types
    """Renderer of figures as HTML, with plotly's code once, that loads nothing from a network."""

    MATHJAX = re.compile(r'<script src="https://[^"]*mathjax[^"]*"></script>')

    def to_mimebundle(self, fig_dict: dict[str, Any]) -> dict[str, str]:
        """Render a figure without the script for formulas, which no figure here has."""
        bundle = super().to_mimebundle(fig_dict)
        return {mimetype: self.MATHJAX.sub("", html) for mimetype, html in bundle.items()}


# A notebook keeps its figures in HTML too, so that they survive export.
pio.renderers["offline"] = OfflineRenderer()
if pio.renderers.default == "plotly_mimetype":
    pio.renderers.default = "plotly_mimetype+offline"

Look = dict[str, Any]  #: keywords of plotly

INK = "#1b2733"
GREY = "#9aa5b1"
BLUE = "#1f5fa8"
ORANGE = "#c8590c"
GREEN = "#2e7d4f"

MARK_BORDER: Look = {"color": INK}
#: Marks of the kinds of designs, the same in every figure.
MARKS: dict[str, Look] = {
    "dominated": {"color": GREY, "size": 8, "symbol": "circle-open"},
    FAILS: {"color": INK, "size": 8, "symbol": "x-thin", "line": {"width": 1.5}},
    UNCLEAR: {"color": INK, "size": 8, "symbol": "diamond-open"},
    "front": {"color": BLUE, "size": 9, "symbol": "circle"},
    "chosen": {
        "color": BLUE,
        "size": 17,
        "symbol": "diamond",
        "line": MARK_BORDER | {"width": 1.5},
    },
    OWN_DOG: {
        "color": ORANGE,
        "size": 18,
        "symbol": "star",
        "line": MARK_BORDER | {"width": 1},
    },
}
#: Marks of times by operating point, for up to three sides in this order.
SIDE_MARKS: tuple[Look, ...] = (
    {"color": ORANGE, "size": 10, "symbol": "square-open", "line": {"width": 2}},
    {"color": BLUE, "size": 9, "symbol": "diamond"},
    {"color": INK, "size": 8, "symbol": "circle"},
)
FRONT_SIZE = (620.0, 290.0)  #: width and height of the front on paper, px
MIN_SEPARATION = 23.0  #: between numbers and marks of the front, px
#: Leaders to the numbers of designs, the shortest first; px, y downwards.
LEADERS = [cmath.rect(r, math.radians(a)) for r in (24, 44, 64, 84) for a in (130, 95, 165)]
EFFECT_COLUMNS = 3  #: panels of effects side by side
FIRST_TRY_ENTRY = "first try"
DIRECT_ENTRY = "direct entry"
#: Colours, gaps and hover text of maps.
MAP_STYLE: Look = {
    "coloraxis": "coloraxis",
    "xgap": 1,
    "ygap": 1,
    "hovertemplate": "%{y}, %{x}: %{z:.0f} %<extra></extra>",
}
ENTRY_NOTE = (
    "First try: share that engages without a retry (Bóka 2010), left out where all do. Direct "
    "entry: share without a touch of faces (Aljawabrah and Lovas 2024). x: not all engage."
)


def styled(figure: go.Figure, height: int) -> go.Figure:
    """Set the template, fonts and margins of all pages, and the height of a figure in px."""
    return figure.update_layout(
        template="simple_white",
        height=height,
        font={"family": "system-ui, sans-serif", "size": 14, "color": INK},
        margin={"l": 70, "r": 20, "t": 40, "b": 60},
        legend={"orientation": "h", "y": 1.0, "yref": "container", "yanchor": "top", "x": 0},
        hoverlabel={"align": "left"},
    )


def front_figure(
    result: StudyRecord, variables: Sequence[str], other_objective: str = ""
) -> go.Figure:
    """Draw the leading objective against another objective, with the designs of all kinds.

    The other objective is by default the next one, without one the smallest margin. The axes show
    the front, prototype and chosen design with their 95 % intervals.
    """
    if not other_objective:
        other_objective = next((goal.name for goal in goals_of(result)[1:]), MARGIN)
    goals = goals_of(result, SIMULATED, other_objective)
    lead = goals[0]
    second = next(goal for goal in goals if goal.name == other_objective)
    figure = go.Figure()
    if len(result.objectives) == 2:  # dominated designs lie right of the line and above it
        figure.add_scatter(
            x=[lead.printed_value(row) for row in result.front],
            y=[second.printed_value(row) for row in result.front],
            mode="lines",
            line={"color": BLUE, "shape": "hv", "width": 1.5},
            showlegend=False,
            hoverinfo="skip",
        )
    numbered = []
    for kind, designs in of_kinds(result).items():
        rows = [row for row in designs if row.expected_shift_time_s is not None]
        bars = {}
        if kind in ("front", "chosen", OWN_DOG):
            numbered += rows
            bars = {"error_x": _error_bars(lead, rows), "error_y": _error_bars(second, rows)}
        if rows:
            figure.add_scatter(
                x=[lead.printed_value(row) for row in rows],
                y=[second.printed_value(row) for row in rows],
                customdata=[row.trial for row in rows],
                name=kind,
                mode="markers",
                marker=MARKS[kind],
                hoverinfo="text",
                hovertext=[_hover_text(result, row, variables, goals) for row in rows],
                **bars,
            )
    numbered.sort(key=lead.printed_value)
    figure.update_xaxes(title=lead.title, range=_window(lead, numbered))
    figure.update_yaxes(title=second.title, range=_window(second, numbered))
    _add_numbers(figure, numbered, lead, second)
    return styled(figure, 480)


def _error_bars(goal: Goal, rows: Sequence[DesignRow]) -> Look:
    """Build the error bars of an objective, 95 % intervals in the printed unit."""
    values = [goal.printed_value(row) for row in rows]
    intervals = [goal.ends(goal.printed_value(row), goal.error(row)) for row in rows]
    return {
        "array": [high - value for value, (_, high) in zip(values, intervals, strict=True)],
        "arrayminus": [value - low for value, (low, _) in zip(values, intervals, strict=True)],
        "thickness": 1,
        "width": 3,
        "color": INK,
    }


def _hover_text(
    result: StudyRecord, design: DesignRow, variables: Sequence[str], goals: Sequence[Goal]
) -> str:
    """Print name, variables, objectives and objections of a design, a line each."""
    lines = [f"<b>{design_name(design)}</b>"]
    lines += [f"{axis(name)}: {value:.4g}" for name, value in design.params(variables).items()]
    for goal in goals:
        if design.value(goal.name) is not None:
            words = goal.words(goal.printed_value(design), goal.error(design))
            lines.append(f"{goal.label} {words}")
    return "<br>".join([*lines, *_objections(result, design)])


def _add_numbers(figure: go.Figure, rows: Sequence[DesignRow], lead: Goal, second: Goal) -> None:
    """Write the numbers of designs beside their marks, with leaders that avoid other marks."""
    x = [lead.printed_value(row) for row in rows]
    y = [second.printed_value(row) for row in rows]
    x_px = [FRONT_SIZE[0] * value / ((max(x) - min(x)) or 1.0) / 1.4 for value in x]
    y_px = [-FRONT_SIZE[1] * value / ((max(y) - min(y)) or 1.0) / 1.4 for value in y]
    marks = [complex(*position) for position in zip(x_px, y_px, strict=True)]
    occupied = list(marks)
    # A leader points away from the front, where no design can be, if there is room.
    leaders = [complex(lead.sign * way.real, second.sign * way.imag) for way in LEADERS]
    for row, mark in zip(rows, marks, strict=True):
        if row.prototype:
            continue
        leader = _free_leader(mark, leaders, occupied)
        occupied.append(mark + leader)
        figure.add_annotation(
            x=lead.printed_value(row),
            y=second.printed_value(row),
            text=str(row.trial),
            ax=leader.real,
            ay=leader.imag,
            arrowwidth=1,
            arrowcolor=GREY,
            arrowhead=0,
            standoff=5,
            font_size=13,
        )


def _free_leader(mark: complex, leaders: Sequence[complex], occupied: Sequence[complex]) -> complex:
    """Select the first leader, px, whose end is clear of marks and numbers; else the last."""
    for leader in leaders:
        separation = min(abs(mark + leader - position) for position in occupied)
        if separation > MIN_SEPARATION:
            return leader
    return leaders[-1]


def _objections(result: StudyRecord, design: DesignRow) -> list[str]:
    """List the objections to a design: by its confirmation, if it has one, else by the search."""
    confirmed = confirmation_of(result, design)
    if confirmed is not None:
        words = objection(confirmed)
        return [words] if words else []
    return [f"fails {check_name(name)}" for name in design.failed]


def _window(goal: Goal, rows: Sequence[DesignRow]) -> tuple[float, float] | None:
    """Compute the range of an axis that shows rows, intervals and a border; None without rows."""
    if not rows:
        return None
    intervals = [goal.ends(goal.printed_value(row), goal.error(row)) for row in rows]
    low = min(low for low, _ in intervals)
    high = max(high for _, high in intervals)
    border = 0.2 * (high - low) or 0.1 * abs(high) or 1.0
    return low - border, high + border


class TimeMark(NamedTuple):
    """Mean time at an operating point with its 95 % interval, s; None without one."""

    point: PlaceRow
    mean_s: float | None
    interval_s: tuple[float, float] | None

    @classmethod
    def of(cls, point: PlaceRow, mean: float | None, error: float | None) -> TimeMark:
        """Mark a time in s by its standard error; the interval of a time is positive."""
        if mean is None or error is None:
            return cls(point, mean, None)
        return cls(point, mean, positive_interval(Estimate(mean, error)))

    @classmethod
    def with_retries(cls, point: PointRow) -> TimeMark:
        """Mark the mean time of an operating point, with the error of each of its parts."""
        mean = point.mean_s
        error = point.standard_error_s
        engaged_mean = point.engaged_mean_s
        engaged_error = point.engaged_standard_error_s
        if mean is None or error is None or engaged_mean is None or engaged_error is None:
            return cls.of(point, mean, error)
        retries_error = math.sqrt(max(0.0, error**2 - engaged_error**2))
        retries = Estimate(max(0.0, mean - engaged_mean), retries_error)
        return cls(point, mean, positive_interval(Estimate(engaged_mean, engaged_error), retries))


def _force_and_mismatch(point: PlaceRow) -> tuple[float, float]:
    """Return the key that sorts operating points, by force."""
    return point.force_N, point.mismatch_rpm


def times_by_point(sides: Mapping[str, Sequence[TimeMark]]) -> go.Figure:
    """Draw mean times, ms, with 95 % intervals: a line for each operating point, by force.

    ``sides`` has by name, three at most, the times of the same operating points.
    """
    names: list[str] = []
    figure = go.Figure()
    for (side, side_times), mark in zip(sides.items(), SIDE_MARKS, strict=False):
        times = sorted(side_times, key=lambda time: _force_and_mismatch(time.point), reverse=True)
        names = [place_name(time.point) for time in times]
        timed = [
            (place_name(point), mean, interval or (mean, mean))
            for point, mean, interval in times
            if mean is not None
        ]
        if timed:
            error_bars = {
                "array": [1e3 * (high - mean) for _, mean, (_, high) in timed],
                "arrayminus": [1e3 * (mean - low) for _, mean, (low, _) in timed],
            }
            figure.add_scatter(
                x=[1e3 * mean for _, mean, _ in timed],
                y=[name for name, _, _ in timed],
                error_x={**error_bars, "thickness": 1.2},
                name=side,
                mode="markers",
                marker=mark,
                customdata=[(1e3 * low, 1e3 * high) for _, _, (low, high) in timed],
                hovertemplate=f"{side}, %{{y}}: %{{x:.1f}} ms "
                "(%{customdata[0]:.1f} to %{customdata[1]:.1f} ms)<extra></extra>",
            )
    figure.update_xaxes(title="mean shift time, ms", rangemode="tozero", showgrid=True)
    figure.update_yaxes(
        categoryorder="array",
        categoryarray=names,
        automargin=True,
        showgrid=True,
        dtick=1,
        range=[-0.7, len(names) - 0.3],
    )
    return styled(figure, 110 + 22 * len(names))


def shiftability_figure(sides: Mapping[str, tuple[Sequence[PointRow], int]]) -> go.Figure:
    """Map shares of shifts over mismatch and force, and direct entry over the relative angle.

    ``sides`` has by name the operating points with ``shiftability``, and the number of dogs.
    Points that are no grid have a row each.
    """
    records = [point for points, _ in sides.values() for point in points]
    side_records = records[: len(records) // len(sides)]
    speeds = {point.mismatch_rpm for point in side_records}
    forces = {point.force_N for point in side_records}
    is_grid = len(forces) > 1 and len(records) == len(sides) * len(speeds) * len(forces)
    entries = [FIRST_TRY_ENTRY, DIRECT_ENTRY]
    if all(point.engaged == 1.0 for point in records):
        entries = [DIRECT_ENTRY]
    widths = [0.24 if is_grid else 0.08] * len(entries)
    titles = [entry.replace(" ", "<br>") for entry in entries]
    figure = make_subplots(
        len(sides),
        len(widths) + 1,
        column_widths=[*widths, 1.0 - sum(widths)],
        shared_yaxes=True,
        horizontal_spacing=0.02,
        vertical_spacing=0.24 / len(sides),
        row_titles=[*sides],
        column_titles=[*titles, f"{DIRECT_ENTRY}, by angle"],
    ).update_annotations(font_size=None)
    line_count = 5  # of the tallest map
    for figure_row, (points, dog_count) in enumerate(sides.values(), start=1):
        sorted_points = sorted(points, key=_force_and_mismatch)
        if is_grid:
            names = [minus(f"{point.mismatch_rpm:.4g}") for point in sorted_points]
        else:
            names = [place_name(point) for point in sorted_points]
        for column, entry in enumerate(entries, start=1):
            share = [_entry_share(point, entry) for point in sorted_points]
            figure.add_heatmap(
                x=[f"{point.force_N:.3g}" if is_grid else "" for point in sorted_points],
                y=names,
                z=100.0 * np.array(share),
                texttemplate="%{z:.0f}",
                row=figure_row,
                col=column,
                **MAP_STYLE,
            )
            figure.update_xaxes(type="category", tickangle=0, row=figure_row, col=column)
        counts = _entries_by_angle(sorted_points, names)
        line_count = max(line_count, len(counts))
        figure.add_heatmap(
            **_angle_map(counts, dog_count), row=figure_row, col=len(entries) + 1, **MAP_STYLE
        )
        figure.update_yaxes(title=axis(PLACE[0]) if is_grid else "", row=figure_row, col=1)
    force_title = axis(PLACE[1]) if is_grid else ""
    axis_titles = [*[force_title] * len(entries), "relative angle, °"]
    for column, title in enumerate(axis_titles, start=1):
        figure.update_xaxes(title=title, row=len(sides), col=column)
    bar = {"title": {"text": "shifts, %", "side": "right"}, "thickness": 14}
    shades = {"colorscale": [[0, "#eef3f9"], [1, BLUE]], "cmin": 0, "cmax": 100}
    figure.update_layout(coloraxis={**shades, "colorbar": bar})
    figure.update_yaxes(type="category", automargin=True, autorange="reversed", dtick=1)
    return styled(figure, 80 + len(sides) * (65 + 24 * line_count))


def _entry_share(point: PointRow, entry: str) -> float:
    """Return the share of shifts that engage at the first try, or enter directly."""
    if entry == FIRST_TRY_ENTRY:
        return point.engaged
    assert point.shiftability is not None
    return point.shiftability.direct


def _entries_by_angle(points: Sequence[PointRow], names: Sequence[str]) -> dict[str, np.ndarray]:
    """Sum the shifts of operating points by their name, each (bins, 3) over the relative angle.

    The columns are direct entries, entries after a face contact, and shifts that do not engage.
    """
    entries = [np.array(point.shiftability.by_angle) for point in points if point.shiftability]
    bins = math.gcd(*map(len, entries))  # points that got more angles may have more bins
    counts: dict[str, np.ndarray] = {}
    for name, by_angle in zip(names, entries, strict=True):
        counts[name] = counts.get(name, 0) + by_angle.reshape(bins, -1, 3).sum(axis=1)
    return counts


def _angle_map(counts: Mapping[str, np.ndarray], dog_count: int) -> Look:
    """Build the map of direct entry, %, over the relative angle within a pitch, degrees."""
    shifts = np.array([*counts.values()])
    total = shifts.sum(axis=2)
    bins = shifts.shape[1]
    return {
        "x": (np.arange(bins) + 0.5) * 360.0 / dog_count / bins,
        "y": [*counts],
        "z": 100.0 * shifts[:, :, 0] / np.where(total, total, np.nan),
        "text": np.where(shifts[:, :, 2] > 0, "x", ""),
        "texttemplate": "%{text}",
    }


MIN_MARGIN_PERCENT = -200.0  #: of the figure of assumptions; bars end there


def assumptions_figure(hinges: Sequence[HingeRow]) -> go.Figure:
    """Draw the smallest margin over the range of each assumption, %, as a tornado."""
    figure = go.Figure()
    for name, colour, flips in (
        ("changes the sign", ORANGE, True),
        ("keeps the sign", BLUE, False),
    ):
        rows = [hinge for hinge in hinges if hinge.flips is flips]
        if not rows:
            continue
        bars = [_bar_ends(row) for row in rows]
        figure.add_bar(
            y=[row.assumption for row in rows],
            base=[first for first, _ in bars],
            x=[last - first for first, last in bars],
            orientation="h",
            name=name,
            marker_color=colour,
            width=0.5,
            hoverinfo="text",
            showlegend=True,
            hovertext=[
                f"{row.cell('range')}: {row.cell('smallest_margin')}, {row.cell('weakest_check')}"
                for row in rows
            ],
        )
        for row, ends in zip(rows, bars, strict=True):
            for value, margin, opposite in zip(row.range, ends, reversed(ends), strict=True):
                is_left = margin < opposite
                figure.add_annotation(
                    x=margin,
                    y=row.assumption,
                    text=short(value),
                    showarrow=False,
                    xanchor="right" if is_left else "left",
                    xshift=-4 if is_left else 4,
                )
    figure.add_vline(0.0, line={"color": INK, "width": 1})
    figure.update_xaxes(title="smallest margin, %")
    figure.update_yaxes(
        autorange="reversed",
        automargin=True,
        categoryorder="array",
        categoryarray=[hinge.assumption for hinge in hinges],
    )
    return styled(figure, 130 + 34 * len(hinges))


def _bar_ends(hinge: HingeRow) -> list[float]:
    """Compute the smallest margins at both ends of an assumption's range, %, as drawn."""
    return [max(MIN_MARGIN_PERCENT, 100.0 * margin) for margin in hinge.smallest_margin]


def effects_figure(variables: Sequence[VariableEffect]) -> go.Figure:
    """Draw the main effect of each variable on the expected shift time, ms, with 95 % bands."""
    rows = math.ceil(len(variables) / EFFECT_COLUMNS)
    columns = min(len(variables), EFFECT_COLUMNS)
    figure = make_subplots(rows, columns, horizontal_spacing=0.06, vertical_spacing=0.32 / rows)
    for index, effect in enumerate(variables):
        row, column = divmod(index, EFFECT_COLUMNS)
        panel = {"row": row + 1, "col": column + 1}
        x = effect.values
        band = [*effect.high_s, *reversed(effect.low_s)]
        figure.add_scatter(
            x=[*x, *reversed(x)],
            y=[1e3 * time for time in band],
            name="95 % interval",
            showlegend=index == 0,
            mode="lines",
            fill="toself",
            hoverinfo="skip",
            fillcolor="rgba(31, 95, 168, 0.22)",
            line={"width": 0},
            **panel,
        )
        figure.add_scatter(
            x=x,
            y=[1e3 * time for time in effect.effect_s],
            name="effect on the expected shift time",
            showlegend=index == 0,
            mode="lines+markers",
            line={"color": BLUE, "width": 2.5},
            **panel,
        )
        figure.add_hline(0.0, line={"color": GREY, "width": 1}, **panel)
        figure.update_xaxes(title=axis(effect.variable), **panel)
    figure.update_yaxes(matches="y", showticklabels=True)
    figure.update_yaxes(title="effect, ms", col=1)
    return styled(figure, 90 + 250 * rows)
