"""Figures of a study's report: front, operating points, single shifts, limits, course."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from dogshape.pipeline.reports.data_sheet import point_gains
from dogshape.pipeline.reports.designs import (
    Goal,
    confirmed_designs,
    describe,
    design_name,
    failed_at_new_angles,
    goals_of,
    is_measured,
    of_kinds,
    shown_goals,
)
from dogshape.pipeline.reports.look import (
    BLUE,
    GREEN,
    GREY,
    INK,
    LINES,
    MARKS,
    ORANGE,
    RED,
    Row,
    styled,
    window,
)
from dogshape.pipeline.reports.prices import FACTORS
from dogshape.pipeline.reports.single_shifts import Distribution
from dogshape.pipeline.reports.text import check_name, ms_with_error, place_name
from dogshape.pipeline.simulate.design import SIMULATED

QUANTILES = (0.5, 0.95, 0.99)
PAIR = (("prototype", "prototype"), ("chosen", "best"))  #: names with keys of the confirmation
NAMED = ("front", "chosen", "prototype")  #: kinds of designs that have a name and error bars
LINE = 30  #: height of a line of listed points, px
#: Colour, dash and mark of a line each; there are no more lines than these.
SERIES = (
    (BLUE, "solid", "circle"), (ORANGE, "dash", "square"), (GREEN, "dot", "diamond"),
    (RED, "dashdot", "triangle-up"), (INK, "longdash", "x"), (GREY, "solid", "cross"),
)  # fmt: skip


def front_figure(result: Row, variables: list[str], other: str) -> go.Figure:
    """Draw the leading objective against another one; designs far from the front are left out."""
    kinds, goals = of_kinds(result), goals_of(result)
    lead, second = goals[0], next(goal for goal in goals if goal.name == other)
    named = [row for kind in NAMED for row in kinds[kind] if is_measured(row)]
    ends = [window([goal.shown(row) for row in named]) for goal in (lead, second)]
    figure = go.Figure()
    if len(goals) == 2:  # what the front dominates lies right of and above its border
        figure.add_scatter(
            x=[lead.shown(row) for row in result["front"]],
            y=[second.shown(row) for row in result["front"]],
            mode="lines", line={"color": BLUE, "shape": "hv", "width": 1.5},
            showlegend=False, hoverinfo="skip",
        )  # fmt: skip
    for kind, every in kinds.items():
        rows = [row for row in every if is_measured(row)]
        if not rows:
            continue
        trace = go.Scatter(
            x=[lead.shown(row) for row in rows], y=[second.shown(row) for row in rows],
            name=kind, mode="markers", marker=MARKS[kind], hoverinfo="text",
            hovertext=[describe(row, variables, shown_goals(result)) for row in rows],
            customdata=[row["trial"] for row in rows],
        )  # fmt: skip
        if kind in NAMED:
            look = {"thickness": 1.2, "width": 3, "color": INK}
            names = [f"<b>{kind}</b>" if kind != "front" else str(row["trial"]) for row in rows]
            sides = ["left" if lead.shown(row) > sum(ends[0]) / 2 else "right" for row in rows]
            trace.update(
                mode="markers+text", text=names, textposition=[f"top {side}" for side in sides],
                error_x={"array": [1.96 * lead.error(row) for row in rows], **look},
                error_y={"array": [1.96 * second.error(row) for row in rows], **look},
            )  # fmt: skip
        figure.add_trace(trace)
    figure.update_xaxes(title=lead.title, range=ends[0])
    figure.update_yaxes(title=second.title, range=ends[1])
    return styled(figure, 480)


def sure_figure(result: Row) -> go.Figure:
    """Draw the 95 % interval of each design of the front, by the search and at the new angles."""
    rows = {row["trial"]: row for row in result["trials"]}
    shown, lead = [rows[row["trial"]] for row in reversed(result["front"])], goals_of(result)[0]
    found, figure = confirmed_designs(result), go.Figure()
    repeated = [row for row in shown if row["trial"] in found and is_measured(found[row["trial"]])]
    for name, these, pairs, mark in (
        ("search", shown, [(lead.shown(row), lead.error(row)) for row in shown],
         {"color": BLUE, "size": 10, "symbol": "circle"}),
        ("new angles", repeated, [lead.estimate(found[row["trial"]]) for row in repeated],
         {"color": "white", "size": 10, "symbol": "square", "line": {"color": INK, "width": 2}}),
    ):  # fmt: skip
        if these:
            figure.add_scatter(
                x=[value for value, _ in pairs], y=[design_name(row) for row in these],
                error_x={"array": [1.96 * error for _, error in pairs], "color": INK},
                mode="markers", name=f"{name}, 95 % interval", marker=mark,
                hovertemplate=f"%{{y}}, {name}: %{{x:.4g}} {lead.unit}<extra></extra>",
            )  # fmt: skip
    figure.update_xaxes(title=lead.title)
    figure.update_yaxes(categoryarray=[design_name(row) for row in shown], type="category")
    return styled(figure, 150 + 34 * len(shown)).update_layout(margin={"l": 120})


def points_figure(confirmation: Row, weights: Mapping[tuple[float, float], float]) -> go.Figure:
    """Draw mean times, gain and share engaged at the first try, a line for each operating point.

    ``weights`` are by mismatch and force; equal ones are not shown.
    """
    points = sorted(confirmation["prototype"]["points"], key=_place)
    alike = len(set(weights.values())) < 2
    names = [
        place_name(*_place(p)) + ("" if alike else f" ({weights.get(_place(p), 1.0):.3g})")
        for p in points
    ]
    figure = make_subplots(
        1, 3, shared_yaxes=True, column_widths=[0.44, 0.32, 0.24], horizontal_spacing=0.02,
        subplot_titles=["mean shift time, ms", "gain, ms", "engaged"],
    )  # fmt: skip
    for column, (name, key) in enumerate(PAIR):
        mine = sorted(confirmation[key]["points"], key=_place)
        figure.add_scatter(
            x=[None if p["mean_s"] is None else 1e3 * p["mean_s"] for p in mine], y=names,
            error_x={"array": [1.96e3 * (p["standard_error_s"] or 0.0) for p in mine],
                     "thickness": 1},
            mode="markers", name=name, marker={**MARKS[name], "size": 11},
            hovertemplate=f"{name}, %{{y}}: %{{x:.1f}} ms<extra></extra>", row=1, col=1,
        )  # fmt: skip
        figure.add_scatter(
            x=[column] * len(mine), y=names, mode="text", showlegend=False, hoverinfo="skip",
            text=[f"{p['engaged']:.0%} {round(p['engaged'] * p['n'])}/{p['n']}" for p in mine],
            row=1, col=3,
        )  # fmt: skip
    found = {(g["mismatch_rpm"], g["force_N"]): g
             for g in point_gains(confirmation["prototype"], confirmation["best"])}  # fmt: skip
    at = [(name, found[_place(p)]) for name, p in zip(names, points, strict=True)
          if _place(p) in found]  # fmt: skip
    figure.add_scatter(
        x=[1e3 * g["gain_s"] for _, g in at], y=[name for name, _ in at], mode="markers",
        error_x={"array": [1.96e3 * g["error_s"] for _, g in at], "thickness": 1},
        marker={"color": INK, "size": 9, "line": {"color": INK, "width": 1.5},
                "symbol": ["circle" if g["clear"] else "circle-open" for _, g in at]},
        text=[ms_with_error(g["gain_s"], g["error_s"], "+") for _, g in at], showlegend=False,
        hovertemplate="%{y}: %{text} ms<extra></extra>", row=1, col=2,
    )  # fmt: skip
    figure.add_vline(0.0, line={"color": INK, "width": 1}, row=1, col=2)
    figure.update_xaxes(range=[-0.6, 1.6], tickvals=[0, 1], ticktext=[n for n, _ in PAIR], col=3)
    figure.update_yaxes(
        type="category", categoryorder="array", categoryarray=names[::-1], showgrid=True,
        range=[-0.6, len(points) - 0.4],
    )  # fmt: skip
    figure.update_xaxes(rangemode="tozero", col=1)
    legend = {"y": 1.0, "yref": "container", "yanchor": "top"}
    figure = styled(figure, 150 + LINE * len(points))
    return figure.update_layout(margin={"l": 190, "t": 80}, legend=legend)


def _place(point: Row) -> tuple[float, float]:
    return point["mismatch_rpm"], point["force_N"]


def distribution_figure(found: Mapping[str, Distribution]) -> go.Figure:
    """Draw the share of shifts done against time with quantiles; keys as in ``LINES``."""
    figure = go.Figure()
    for share in QUANTILES:
        figure.add_hline(share, line={"color": INK, "width": 0.6, "dash": "dot"}, opacity=1)
    for name, one in found.items():
        done = np.isfinite(one.times)
        figure.add_scatter(
            x=[0.0, *(one.times[done] * 1e3)], y=[0.0, *one.reached[done]], mode="lines", name=name,
            line={**LINES[name], "shape": "hv"},
            hovertemplate=f"{name}: %{{y:.1%}} within %{{x:.1f}} ms<extra></extra>",
        )  # fmt: skip
    figure.update_xaxes(title="time of a single shift, ms", rangemode="tozero")
    figure.update_yaxes(title="share of shifts done", tickformat=".0%", range=[0, 1.05],
                        tickvals=[0, 0.25, *QUANTILES])  # fmt: skip
    return styled(figure, 420)


def prices_figure(rows: Sequence[Row]) -> go.Figure:
    """Draw the best predicted time over each dear limit, as a share of what it is."""
    figure = go.Figure()
    for (color, dash, symbol), row in zip(SERIES, rows, strict=False):
        sign = "≤" if row["at_most"] else "≥"
        figure.add_scatter(
            x=[100.0 * factor for factor in FACTORS],
            y=[None if t is None else 1e3 * t for _, t in row["curve"]],
            mode="lines+markers",
            name=f"{check_name(row['name'])} {sign} {row['limit']:.4g} {row['unit']}".strip(),
            line={"color": color, "dash": dash},
            marker={"symbol": symbol, "size": 8},
            customdata=[[limit, row["unit"]] for limit, _ in row["curve"]],
            hovertemplate="limit %{customdata[0]:.4g} %{customdata[1]}: %{y:.1f} ms",
        )
    figure.add_vline(x=100.0, line_dash="dot", line_color="grey")
    figure.update_xaxes(title="limit, % of what the study asks")
    figure.update_yaxes(title="best expected shift time, ms")
    return styled(figure, height=380)


def course_of(result: Row, lead: Goal) -> list[tuple[int, float, float, Row]]:
    """Follow a search: shifts up to each feasible design, its value and the best so far."""
    failed = {row["trial"] for row in failed_at_new_angles(result)}
    total, found, best = 0, [], None
    for row in result["trials"]:
        if row[SIMULATED] is None:
            continue
        total += row["shifts"]
        if row["feasible"] and row["trial"] not in failed:
            value = lead.shown(row)
            better = max if lead.objective.maximise else min
            best = value if best is None else better(best, value)
            found.append((total, value, best, row))
    return found


def course_figure(result: Row) -> go.Figure:
    """Draw every feasible design and the best so far against the shifts simulated."""
    lead, figure = goals_of(result)[0], go.Figure()
    found = course_of(result, lead)
    figure.add_scatter(
        x=[total for total, *_ in found], y=[value for _, value, *_ in found], mode="markers",
        name="simulated design", text=[design_name(row) for *_, row in found],
        marker={"color": GREY, "symbol": "circle-open", "size": 8, "line": {"width": 1.5}},
        hovertemplate=f"%{{text}}: %{{y:.4g}} {lead.unit} after %{{x}} shifts<extra></extra>",
    )  # fmt: skip
    figure.add_scatter(
        x=[total for total, *_ in found], y=[best for _, _, best, _ in found], mode="lines",
        name="best so far", line={"color": BLUE, "width": 2.5, "shape": "hv"}, hoverinfo="skip",
    )  # fmt: skip
    figure.update_xaxes(title="simulated shifts of the search", rangemode="tozero")
    figure.update_yaxes(title=lead.title)
    return styled(figure, 380)
