"""Charts of results, and the look of all figures.

What a colour says, a marker says too, so that a page can be printed in grey.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import plotly.graph_objects as go
from plotly.subplots import make_subplots

from dogshape.pipeline.reports.text import axis, place_name
from dogshape.sim.strength.checks import GROUPS, Check

if TYPE_CHECKING:
    import pandas as pd

Row = dict[str, Any]  #: a part of result.json, whose schema is ``pipeline.store.result_schema``

INK = "#1b2733"
GREY = "#9aa5b1"
BLUE = "#1f5fa8"
ORANGE = "#c8590c"
GREEN = "#2e7d4f"
RED = "#b3261e"

#: Marks of the kinds of designs, the same in every figure.
MARKS: dict[str, Row] = {
    "dominated": {"color": GREY, "size": 8, "symbol": "circle-open"},
    "fails when simulated": {"color": INK, "size": 8, "symbol": "x-thin", "line": {"width": 1.5}},
    "front": {"color": BLUE, "size": 10, "symbol": "circle"},
    "chosen": {
        "color": BLUE, "size": 17, "symbol": "diamond", "line": {"color": INK, "width": 1.5},
    },
    "prototype": {
        "color": ORANGE, "size": 18, "symbol": "star", "line": {"color": INK, "width": 1},
    },
}  # fmt: skip
#: Marks of what is drawn by operating point, in this order.
SIDES: tuple[Row, ...] = (
    {"color": ORANGE, "size": 10, "symbol": "square-open", "line": {"width": 2}},
    {"color": BLUE, "size": 9, "symbol": "diamond"},
    {"color": INK, "size": 8, "symbol": "circle"},
)


def styled(figure: go.Figure, height: int) -> go.Figure:
    """Give a figure the look of all pages and its height in px."""
    figure.update_layout(
        template="simple_white",
        height=height,
        font={"family": "system-ui, sans-serif", "size": 14, "color": INK},
        margin={"l": 70, "r": 20, "t": 40, "b": 60},
        legend={"orientation": "h", "y": 1.0, "yref": "container", "yanchor": "top", "x": 0},
        hoverlabel={"align": "left"},
    )
    return figure


def window(values: Sequence[float]) -> tuple[float, float]:
    """Return a range that shows ``values`` with room on either side."""
    low, high = min(values), max(values)
    room = 0.12 * (high - low) or 0.1 * abs(high) or 1.0
    return low - room, high + room


def times_by_point(sides: Mapping[str, Sequence[Row]]) -> go.Figure:
    """Draw mean times, ms, with 95 % intervals: a line for each operating point, by force.

    ``sides`` are up to three by their names, each a record for each operating point with
    ``mismatch_rpm``, ``force_N``, ``mean_s`` and ``standard_error_s``, both s or None.
    """
    places = {(p["force_N"], p["mismatch_rpm"]) for points in sides.values() for p in points}
    names = [place_name(mismatch, force) for force, mismatch in sorted(places, reverse=True)]
    figure = go.Figure()
    for (name, points), mark in zip(sides.items(), SIDES, strict=False):
        known = [point for point in points if point["mean_s"] is not None]
        if known:
            errors = [1.96e3 * (point["standard_error_s"] or 0.0) for point in known]
            figure.add_scatter(
                x=[1e3 * point["mean_s"] for point in known],
                y=[place_name(point["mismatch_rpm"], point["force_N"]) for point in known],
                error_x={"array": errors, "thickness": 1.2}, name=name, mode="markers", marker=mark,
                hovertemplate=f"{name}, %{{y}}: %{{x:.1f}} ± %{{error_x.array:.1f}} ms"
                "<extra></extra>",
            )  # fmt: skip
    figure.update_xaxes(title="mean shift time, ms", rangemode="tozero", showgrid=True)
    figure.update_yaxes(
        type="category", categoryorder="array", categoryarray=names, automargin=True, showgrid=True
    )
    return styled(figure, 130 + 24 * len(names))


def trend_figure(found: pd.DataFrame) -> go.Figure:
    """Draw the predicted time over each number that ``moved`` names; the design itself as a dot.

    ``found`` has the rows of ``Study.predict``; the design is the first one.
    """
    moved = [key for key in found["moved"].unique() if key in found.columns]
    figure = make_subplots(1, len(moved), shared_yaxes=True, horizontal_spacing=0.025)
    own = found.iloc[0]
    for column, key in enumerate(moved, start=1):
        rows = found[found["moved"] == key]
        figure.add_scatter(
            x=rows[key], y=1e3 * rows["expected_shift_time_s"], mode="lines", line_color=BLUE,
            hovertemplate="%{x:.4g}: %{y:.1f} ms<extra></extra>", row=1, col=column,
        )  # fmt: skip
        figure.add_scatter(
            x=[own[key]], y=[1e3 * own["expected_shift_time_s"]], mode="markers",
            marker={"color": ORANGE, "size": 10}, hoverinfo="skip", row=1, col=column,
        )  # fmt: skip
        figure.update_xaxes(title=axis(key), row=1, col=column)
    figure.update_yaxes(title="ms", col=1)
    figure = styled(figure, 230).update_layout(showlegend=False)
    return figure.update_layout(margin={"l": 50, "r": 5, "t": 10, "b": 50}, font_size=12)


def margins(checks: Sequence[Check], within: Mapping[str, Mapping[str, float]]) -> go.Figure:
    """Draw the margin of each check as a bar, with a mark at that of the worst case.

    ``within`` has the margins left within the tolerances by check and kind.
    """
    ordered = sorted(checks, key=lambda check: list(GROUPS).index(check.rule.group))
    names, figure = [check.name for check in ordered], go.Figure()
    for name, passed, marker in (
        ("passed", True, {"color": BLUE}),
        ("failed", False, {"color": RED, "pattern": {"shape": "/", "fgcolor": "white"}}),
    ):
        mine = [check for check in ordered if check.passed == passed]
        figure.add_bar(
            x=[100.0 * check.margin for check in mine], y=[check.name for check in mine],
            name=name, orientation="h", marker=marker,
        )  # fmt: skip
    worst = {name: 100.0 * within[name]["worst_case"] for name in names if name in within}
    figure.add_scatter(
        x=list(worst.values()), y=list(worst), name="worst case within the tolerances",
        mode="markers", marker={"color": INK, "symbol": "line-ns-open", "size": 14},
    )  # fmt: skip
    for name, margin in worst.items():
        if math.isinf(margin):
            figure.add_annotation(x=0, y=name, text="no dog left", showarrow=False, xanchor="right")
    title = "margin to the limit, % of the limit"
    figure.update_xaxes(title=title, zeroline=True, zerolinecolor=INK)
    figure.update_yaxes(categoryarray=names, autorange="reversed", automargin=True)
    return styled(figure, 150 + 24 * len(names)).update_layout(barmode="overlay")
