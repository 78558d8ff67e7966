"""Figures of results, with one look.

What a colour says, a marker says too, so that a page can be printed in grey.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Mapping, Sequence
from operator import itemgetter

import numpy as np
import plotly.graph_objects as go
import plotly.io as pio
from plotly.subplots import make_subplots

from dogshape.pipeline.reports.designs import (
    FAILS,
    MARGIN,
    UNCLEAR,
    Goal,
    Row,
    confirmation_of,
    design_name,
    goals_of,
    objection,
    of_kinds,
)
from dogshape.pipeline.reports.text import PLACE, axis, check_name, minus, place_name
from dogshape.pipeline.simulate.design import SIMULATED
from dogshape.pipeline.store.result_records import HingeRow
from dogshape.sim.units import short

# A notebook keeps its figures in HTML too, with plotly's code once, so that they survive export.
if pio.renderers.default == "plotly_mimetype":
    pio.renderers.default = "plotly_mimetype+notebook"

INK, GREY = "#1b2733", "#9aa5b1"
BLUE, ORANGE, GREEN = "#1f5fa8", "#c8590c", "#2e7d4f"

EDGE: Row = {"color": INK}  #: of a mark
#: Marks of the kinds of designs, the same in every figure.
MARKS: dict[str, Row] = {
    "dominated": {"color": GREY, "size": 8, "symbol": "circle-open"},
    FAILS: {"color": INK, "size": 8, "symbol": "x-thin", "line": {"width": 1.5}},
    UNCLEAR: {"color": INK, "size": 8, "symbol": "diamond-open"},
    "front": {"color": BLUE, "size": 9, "symbol": "circle"},
    "chosen": {"color": BLUE, "size": 17, "symbol": "diamond", "line": EDGE | {"width": 1.5}},
    "prototype": {"color": ORANGE, "size": 18, "symbol": "star", "line": EDGE | {"width": 1}},
}
#: Marks of what is drawn by operating point, in this order.
SIDES: tuple[Row, ...] = (
    {"color": ORANGE, "size": 10, "symbol": "square-open", "line": {"width": 2}},
    {"color": BLUE, "size": 9, "symbol": "diamond"},
    {"color": INK, "size": 8, "symbol": "circle"},
)
PAPER = (620.0, 290.0)  #: width and height of the front on paper, px
ROOM = 23.0  #: between numbers and marks of the front, px
#: Leaders to the numbers of designs, the shortest first; px, y downwards.
LEADERS = [cmath.rect(r, math.radians(a)) for r in (24, 44, 64, 84) for a in (130, 95, 165)]
BY_PLACE = itemgetter(*reversed(PLACE))  #: order of operating points, by force
BESIDE = 3  #: panels of effects side by side
ENTRIES = ("first try", "direct entry")
ENTRY_NOTE = (
    "First try: share that engages without a retry (Bóka 2010), left out where all do. Direct "
    "entry: share without a touch of faces (Aljawabrah and Lovas 2024). x: not all engage."
)


def styled(figure: go.Figure, height: int) -> go.Figure:
    """Give a figure the look of all pages and its height in px."""
    return figure.update_layout(
        template="simple_white",
        height=height,
        font={"family": "system-ui, sans-serif", "size": 14, "color": INK},
        margin={"l": 70, "r": 20, "t": 40, "b": 60},
        legend={"orientation": "h", "y": 1.0, "yref": "container", "yanchor": "top", "x": 0},
        hoverlabel={"align": "left"},
    )


def front_figure(result: Row, variables: Sequence[str], other: str = "") -> go.Figure:
    """Draw the leading objective against another one; designs far from the front are left out.

    By default it is the next objective, where there is none the smallest margin.
    """
    other = other or next((goal.name for goal in goals_of(result)[1:]), MARGIN)
    goals = goals_of(result, SIMULATED, other)
    lead, second = goals[0], next(goal for goal in goals if goal.name == other)
    figure, named = go.Figure(), list[Row]()
    if len(result["objectives"]) == 2:  # what the front dominates lies right of and above it
        figure.add_scatter(
            x=[lead.shown(row) for row in result["front"]],
            y=[second.shown(row) for row in result["front"]],
            mode="lines", line={"color": BLUE, "shape": "hv", "width": 1.5},
            showlegend=False, hoverinfo="skip",
        )  # fmt: skip
    for kind, every in of_kinds(result).items():
        rows, bars = [row for row in every if row[SIMULATED] is not None], {}
        if kind in ("front", "chosen", "prototype"):
            named += rows
            look = {"thickness": 1, "width": 3, "color": INK}
            for axis_name, goal in (("x", lead), ("y", second)):
                shown = [goal.shown(row) for row in rows]
                ends = [goal.ends(goal.shown(row), goal.error(row)) for row in rows]
                bars[f"error_{axis_name}"] = {
                    "array": [high - at for at, (_, high) in zip(shown, ends, strict=True)],
                    "arrayminus": [at - low for at, (low, _) in zip(shown, ends, strict=True)],
                    **look,
                }
        texts = [
            "<br>".join([
                f"<b>{design_name(row)}</b>",
                *(f"{axis(name)}: {row[name]:.4g}" for name in variables),
                *(f"{goal.label} {goal.words(goal.shown(row), goal.error(row))}"
                  for goal in goals if row.get(goal.name) is not None),
                *_objections(result, row),
            ])
            for row in rows
        ]  # fmt: skip
        if rows:
            figure.add_scatter(
                x=[lead.shown(row) for row in rows], y=[second.shown(row) for row in rows],
                customdata=[row["trial"] for row in rows], name=kind, mode="markers",
                marker=MARKS[kind], hoverinfo="text", hovertext=texts, **bars,
            )  # fmt: skip
    named.sort(key=lead.shown)
    x, y = ([goal.shown(row) for row in named] for goal in (lead, second))
    figure.update_xaxes(title=lead.title, range=_window(lead, named))
    figure.update_yaxes(title=second.title, range=_window(second, named))
    px = [PAPER[0] * one / ((max(x) - min(x)) or 1.0) / 1.4 for one in x]
    py = [-PAPER[1] * one / ((max(y) - min(y)) or 1.0) / 1.4 for one in y]
    taken = [complex(*place) for place in zip(px, py, strict=True)]
    for row, here in zip(named, tuple(taken), strict=True):
        # A leader points where no design of the front can be, if there is room.
        ways = [complex(lead.sign * way.real, second.sign * way.imag) for way in LEADERS]
        room = [min(abs(here + way - other) for other in taken) for way in ways]
        way = next((w for w, r in zip(ways, room, strict=True) if r > ROOM), ways[-1])
        if not row["prototype"]:
            taken.append(here + way)
            figure.add_annotation(
                x=lead.shown(row), y=second.shown(row), text=str(row["trial"]), ax=way.real,
                ay=way.imag, arrowwidth=1, arrowcolor=GREY, arrowhead=0, standoff=5, font_size=13,
            )  # fmt: skip
    return styled(figure, 480)


def _objections(result: Row, row: Row) -> list[str]:
    """List what keeps a design from passing, by its confirmation where it has one."""
    if confirmed := confirmation_of(result, row):
        return list(filter(None, [objection(confirmed)]))
    return [f"fails {check_name(name)}" for name in row["failed"]]


def _window(goal: Goal, rows: Sequence[Row]) -> tuple[float, float] | None:
    """Return a range that shows rows and their bars with room on either side; None without any."""
    if not rows:
        return None
    ends = [goal.ends(goal.shown(row), goal.error(row)) for row in rows]
    low, high = min(low for low, _ in ends), max(high for _, high in ends)
    room = 0.2 * (high - low) or 0.1 * abs(high) or 1.0
    return low - room, high + room


def times_by_point(rows: Sequence[Row], sides: Mapping[str, tuple[str, str]]) -> go.Figure:
    """Draw mean times, ms, with 95 % intervals: a line for each operating point, by force.

    ``sides`` are up to three by their names, each with the keys of mean and standard error in the
    records of the operating points, both s or None.
    """
    rows = sorted(rows, key=BY_PLACE, reverse=True)
    names = [place_name(row) for row in rows]
    figure = go.Figure()
    for (side, (mean, error)), mark in zip(sides.items(), SIDES, strict=False):
        known = [(name, row) for name, row in zip(names, rows, strict=True)
                 if row[mean] is not None]  # fmt: skip
        if known:
            figure.add_scatter(
                x=[1e3 * row[mean] for _, row in known], y=[name for name, _ in known],
                error_x={"array": [1.96e3 * (row.get(error) or 0.0) for _, row in known],
                         "thickness": 1.2},
                name=side, mode="markers", marker=mark,
                hovertemplate=f"{side}, %{{y}}: %{{x:.1f}} ± %{{error_x.array:.1f}} ms"
                "<extra></extra>",
            )  # fmt: skip
    figure.update_xaxes(title="mean shift time, ms", rangemode="tozero", showgrid=True)
    figure.update_yaxes(
        categoryorder="array", categoryarray=names, automargin=True, showgrid=True, dtick=1,
        range=[-0.7, len(names) - 0.3],
    )  # fmt: skip
    return styled(figure, 110 + 22 * len(names))


def shiftability_figure(sides: Mapping[str, tuple[Sequence[Row], int]]) -> go.Figure:
    """Map shares of shifts over mismatch and force, and direct entry over the relative angle.

    ``sides`` have records of operating points with their ``shiftability``, and the number of dogs.
    Points that are no grid have a row each.
    """
    every = [row for rows, _ in sides.values() for row in rows]
    speeds, forces = ({row[key] for row in every[: len(every) // len(sides)]} for key in PLACE)
    grid = len(forces) > 1 and len(every) == len(sides) * len(speeds) * len(forces)
    shown = ENTRIES[all(row["engaged"] == 1.0 for row in every) :]
    widths = [0.24 if grid else 0.08] * len(shown)
    figure = make_subplots(
        len(sides), len(widths) + 1, column_widths=[*widths, 1.0 - sum(widths)], shared_yaxes=True,
        horizontal_spacing=0.02, vertical_spacing=0.24 / len(sides), row_titles=[*sides],
        column_titles=[*(one.replace(" ", "<br>") for one in shown), f"{ENTRIES[1]}, by angle"],
    ).update_annotations(font_size=None)  # fmt: skip
    lines, look = 5, {"coloraxis": "coloraxis", "xgap": 1, "ygap": 1}
    hover = "%{y}, %{x}: %{z:.0f} %<extra></extra>"
    for place, (rows, count) in enumerate(sides.values(), start=1):
        ordered = sorted(rows, key=BY_PLACE)
        pushes = [f"{row[PLACE[1]]:.3g}" if grid else "" for row in ordered]
        names = [minus(f"{r[PLACE[0]]:.4g}") if grid else place_name(r) for r in ordered]
        for column, entry in enumerate(shown, start=1):
            share = [row["engaged"] if entry == ENTRIES[0] else row["shiftability"]["direct"]
                     for row in ordered]  # fmt: skip
            figure.add_heatmap(
                x=pushes, y=names, z=100.0 * np.array(share), texttemplate="%{z:.0f}",
                hovertemplate=hover, row=place, col=column, **look,
            )  # fmt: skip
            figure.update_xaxes(type="category", tickangle=0, row=place, col=column)
        by_angle = [np.array(row["shiftability"]["by_angle"]) for row in ordered]
        bins = math.gcd(*map(len, by_angle))  # points that got more angles may have more bins
        counts: dict[str, np.ndarray] = {}
        for name, entries in zip(names, by_angle, strict=True):
            counts[name] = counts.get(name, 0) + entries.reshape(bins, -1, 3).sum(axis=1)
        made, lines = np.array([*counts.values()]), max(lines, len(counts))
        whole = made.sum(axis=2)
        figure.add_heatmap(
            x=(np.arange(bins) + 0.5) * 360.0 / count / bins, y=[*counts],
            z=100.0 * made[:, :, 0] / np.where(whole, whole, np.nan),
            text=np.where(made[:, :, 2] > 0, "x", ""), texttemplate="%{text}", row=place,
            col=len(shown) + 1, **look, hovertemplate=hover,
        )  # fmt: skip
        figure.update_yaxes(title=axis(PLACE[0]) if grid else "", row=place, col=1)
    titles = [*[axis(PLACE[1]) if grid else ""] * len(shown), "relative angle, °"]
    for column, title in enumerate(titles, start=1):
        figure.update_xaxes(title=title, row=len(sides), col=column)
    bar = {"title": {"text": "shifts, %", "side": "right"}, "thickness": 14}
    shades = {"colorscale": [[0, "#eef3f9"], [1, BLUE]], "cmin": 0, "cmax": 100}
    figure.update_layout(coloraxis={**shades, "colorbar": bar})
    figure.update_yaxes(type="category", automargin=True, autorange="reversed", dtick=1)
    return styled(figure, 80 + len(sides) * (65 + 24 * lines))


LEAST_MARGIN = -200.0  #: %, of the figure of assumptions; bars end there


def assumptions_figure(hinges: Sequence[HingeRow]) -> go.Figure:
    """Draw the smallest margin over the range of each assumption, %, as a tornado."""
    figure = go.Figure()
    for name, colour, flips in (
        ("changes the sign", ORANGE, True), ("keeps the sign", BLUE, False),
    ):  # fmt: skip
        rows = [hinge for hinge in hinges if hinge.flips is flips]
        if not rows:
            continue
        shown = [[max(LEAST_MARGIN, 100.0 * m) for m in row.smallest_margin] for row in rows]
        figure.add_bar(
            y=[row.assumption for row in rows], base=[ends[0] for ends in shown],
            x=[ends[1] - ends[0] for ends in shown], orientation="h", name=name,
            marker_color=colour, width=0.5, hoverinfo="text", showlegend=True,
            hovertext=[
                f"{row.cell('range')}: {row.cell('smallest_margin')}, {row.cell('weakest_check')}"
                for row in rows
            ],
        )  # fmt: skip
        for row, ends in zip(rows, shown, strict=True):
            for end, place, far in zip(row.range, ends, reversed(ends), strict=True):
                figure.add_annotation(
                    x=place, y=row.assumption, text=short(end), showarrow=False,
                    xanchor="right" if place < far else "left", xshift=-4 if place < far else 4,
                )  # fmt: skip
    figure.add_vline(0.0, line={"color": INK, "width": 1})
    figure.update_xaxes(title="smallest margin, %")
    figure.update_yaxes(
        autorange="reversed", automargin=True, categoryorder="array",
        categoryarray=[hinge.assumption for hinge in hinges],
    )  # fmt: skip
    return styled(figure, 130 + 34 * len(hinges))


def effects_figure(found: Row) -> go.Figure:
    """Draw the main effect of each variable on the expected shift time, ms, with its band."""
    shown = found["variables"]
    rows, columns = -(-len(shown) // BESIDE), min(len(shown), BESIDE)
    figure = make_subplots(rows, columns, horizontal_spacing=0.06, vertical_spacing=0.32 / rows)
    for place, one in enumerate(shown):
        x, where = one["values"], {"row": place // BESIDE + 1, "col": place % BESIDE + 1}
        ends = [1e3 * v for v in (*one["high_s"], *reversed(one["low_s"]))]
        figure.add_scatter(
            x=[*x, *reversed(x)], y=ends, name="95 % interval", showlegend=place == 0,
            mode="lines", fill="toself", hoverinfo="skip", fillcolor="rgba(31, 95, 168, 0.22)",
            line={"width": 0}, **where,
        )  # fmt: skip
        figure.add_scatter(
            x=x, y=[1e3 * v for v in one["effect_s"]], name="effect on the expected shift time",
            showlegend=place == 0, mode="lines+markers", line={"color": BLUE, "width": 2.5},
            **where,
        )  # fmt: skip
        figure.add_hline(0.0, line={"color": GREY, "width": 1}, **where)
        figure.update_xaxes(title=axis(one["variable"]), **where)
    figure.update_yaxes(matches="y", showticklabels=True)
    figure.update_yaxes(title="effect, ms", col=1)
    return styled(figure, 90 + 250 * rows)
