"""Charts that results draw of themselves."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import plotly.graph_objects as go
from plotly.subplots import make_subplots

from dogshape.pipeline.reports.look import BLUE, INK, ORANGE, RED, Row, styled
from dogshape.pipeline.reports.text import axis
from dogshape.sim.strength.checks import GROUPS, Check

if TYPE_CHECKING:
    import pandas as pd


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


def means_by_point(points: Sequence[Row]) -> go.Figure:
    """Draw mean shift times over the mismatch, a line for each force, with standard errors.

    ``points`` are records with ``mismatch_rpm``, ``force_N``, ``mean_s`` and ``standard_error_s``.
    """
    figure = go.Figure()
    for force in sorted({p["force_N"] for p in points}):
        mine = sorted((p for p in points if p["force_N"] == force), key=lambda p: p["mismatch_rpm"])
        errors = [1e3 * (p["standard_error_s"] or 0.0) for p in mine]
        figure.add_trace(
            go.Scatter(
                x=[p["mismatch_rpm"] for p in mine],
                y=[None if p["mean_s"] is None else 1e3 * p["mean_s"] for p in mine],
                error_y={"array": errors},
                name=f"{force:.4g} N",
                mode="lines+markers",
            )
        )
    figure.update_xaxes(title="mismatch speed, 1/min")
    figure.update_yaxes(title="mean shift time, ms", rangemode="tozero")
    return styled(figure, 420)


def margins(checks: Sequence[Check], within: Mapping[str, Mapping[str, float]]) -> go.Figure:
    """Draw the margin of each check as a bar, and within it a thinner one of the worst case.

    ``within`` has the margins left within the tolerances by check and kind; where no dog is left
    the bar is a word.
    """
    ordered = sorted(checks, key=lambda check: list(GROUPS).index(check.rule.group))
    figure = go.Figure()
    looks: list[tuple[str, bool, Row]] = [
        ("passed", True, {"color": BLUE}),
        ("failed", False, {"color": RED, "pattern": {"shape": "/", "fgcolor": "white"}}),
    ]
    for name, passed, marker in looks:
        mine = [(c.name, c.margin) for c in ordered if c.passed == passed]
        figure.add_trace(_bars(name, mine, marker, 0.72))
    worst = [(c.name, within[c.name]["worst_case"]) for c in ordered if c.name in within]
    figure.add_trace(_bars("worst case within the tolerances", worst, {"color": INK}, 0.2))
    for name, margin in worst:
        if math.isinf(margin):
            figure.add_annotation(x=0, y=name, text="no dog left", showarrow=False, xanchor="right")
    figure.update_layout(barmode="overlay")
    figure.update_xaxes(
        title="margin to the limit, % of the limit", zeroline=True, zerolinecolor=INK
    )
    names = [check.name for check in ordered]
    figure.update_yaxes(categoryarray=names, autorange="reversed", automargin=True)
    return styled(figure, 150 + 24 * len(names))


def _bars(name: str, rows: Sequence[tuple[str, float]], marker: Row, width: float) -> go.Bar:
    drawn = [(check, 100 * margin) for check, margin in rows if math.isfinite(margin)]
    return go.Bar(
        x=[margin for _, margin in drawn], y=[check for check, _ in drawn], name=name,
        orientation="h", marker=marker, width=width,
        hovertemplate=f"%{{y}}, {name}: %{{x:.1f}} %<extra></extra>",
    )  # fmt: skip
