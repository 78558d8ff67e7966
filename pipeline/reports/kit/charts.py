"""Charts that results draw of themselves."""

from __future__ import annotations

from collections.abc import Sequence

import plotly.graph_objects as go

from dogshape.pipeline.reports.kit.look import Row, styled


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
                y=[1e3 * p["mean_s"] for p in mine],
                error_y={"array": errors},
                name=f"{force:.4g} N",
                mode="lines+markers",
            )
        )
    figure.update_xaxes(title="mismatch speed, 1/min")
    figure.update_yaxes(title="mean shift time, ms", rangemode="tozero")
    return styled(figure, 420)
