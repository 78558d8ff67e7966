r"""Convergence of the search: best value and hypervolume against the shifts simulated.

The hypervolume is what the front dominates of the box between the best and the worst value of
each objective that feasible designs of the search have.
"""

from __future__ import annotations

from dataclasses import dataclass
from textwrap import wrap

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from dogshape.pipeline.reports.kit.look import BLUE, GREY, INK, MARKS, Row, styled
from dogshape.pipeline.reports.study.designs import design_name, failed_at_new_angles
from dogshape.pipeline.reports.study.goals import goals_of
from dogshape.pipeline.reports.study.single_shifts import Array
from dogshape.pipeline.simulate.design import SIMULATED
from dogshape.surrogate.hypervolume import hypervolume


@dataclass(frozen=True)
class Course:
    """The search, design by design: feasible ones with the shifts simulated up to each, (n,).

    ``best`` is the best value of the leading objective so far, as shown; ``volume`` the share of
    the box that is dominated.
    """

    rows: list[Row]
    shifts: Array
    best: Array
    volume: Array


def course(result: Row) -> Course:
    """Follow a search design by design; designs that land too hard cost shifts, too."""
    failed = {row["trial"] for row in failed_at_new_angles(result)}
    spent, total, rows = [], 0, []
    for row in result["trials"]:
        if row[SIMULATED] is None:
            continue
        total += row["shifts"]
        if row["feasible"] and row["trial"] not in failed:
            rows.append(row)
            spent.append(total)
    goals = goals_of(result)
    lead, sign = goals.leading, goals.leading.objective.sign
    losses = [[goal.objective.sign * goal.shown(row) for goal in goals.every] for row in rows]
    volumes = np.zeros(len(rows))
    if len(rows) > 1:
        values = np.array(losses, dtype=float)
        low, span = values.min(axis=0), np.ptp(values, axis=0)
        shares, corner = (values - low) / np.where(span > 0.0, span, 1.0), np.ones(len(low))
        volumes = np.array([hypervolume(shares[: n + 1], corner) for n in range(len(shares))])
    best = sign * np.minimum.accumulate([sign * lead.shown(row) for row in rows] or [0.0])
    return Course(rows, np.array(spent, dtype=float), best[: len(rows)], volumes)


def convergence_figure(result: Row, found: Course) -> go.Figure:
    """Draw every feasible design and the best so far, and the front's hypervolume below."""
    several, lead = len(result["objectives"]) > 1, goals_of(result).leading
    figure = make_subplots(
        2 if several else 1, 1, shared_xaxes=True, vertical_spacing=0.08,
        row_heights=[0.62, 0.38] if several else [1.0],
    )  # fmt: skip
    figure.add_scatter(
        x=found.shifts, y=[lead.shown(row) for row in found.rows], mode="markers",
        name="simulated design",
        marker={"color": GREY, "symbol": "circle-open", "size": 8, "line": {"width": 1.5}},
        text=[design_name(row) for row in found.rows],
        hovertemplate=f"%{{text}}: %{{y:.4g}} {lead.unit} after %{{x}} shifts<extra></extra>",
        row=1, col=1,
    )  # fmt: skip
    figure.add_scatter(
        x=found.shifts, y=found.best, mode="lines", name="best so far",
        line={"color": BLUE, "width": 2.5, "shape": "hv"}, hoverinfo="skip", row=1, col=1,
    )  # fmt: skip
    for row, spent in zip(found.rows, found.shifts, strict=True):
        if row["prototype"]:
            figure.add_scatter(
                x=[spent], y=[lead.shown(row)], mode="markers", name="prototype",
                marker={**MARKS["prototype"], "size": 14}, hoverinfo="skip", row=1, col=1,
            )  # fmt: skip
    figure.update_yaxes(title="<br>".join(wrap(lead.axis, 24)), row=1)
    if several:
        figure.add_scatter(
            x=found.shifts, y=found.volume, mode="lines+markers", name="hypervolume",
            line={"color": INK, "width": 2, "shape": "hv", "dash": "dash"}, marker={"size": 5},
            hovertemplate="%{y:.3f} after %{x} shifts<extra></extra>", row=2, col=1,
        )  # fmt: skip
        figure.update_yaxes(title="hypervolume", rangemode="tozero", row=2)
    figure.update_xaxes(rangemode="tozero")
    figure.update_xaxes(title="simulated shifts of the search", row=2 if several else 1)
    return styled(figure, 540 if several else 380)
