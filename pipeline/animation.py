"""One shift to look at: an animation with its curves, and the time series as a table."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from pipeline.drawing import outline
from pipeline.figures import BLUE, GREEN, GREY, INK, ORANGE
from pipeline.report import figure_html, render
from sim.engagement import Engagement
from sim.units import DEG, MM, MS, RPM

FRAMES = 600  #: positions of the animation, evenly spaced in time
FORCE_CEILING = 4.0  #: end of the force axis over the largest shift force
SHADES = ("#ffffff", "#f6e3d5", "#e4eef8", "#e3f1e8")


def write_trace(result: Engagement, path: Path) -> None:
    """Write the time series of a shift as CSV, columns as in bench traces."""
    t = result.trace
    table = pd.DataFrame(
        {
            "t_s": t.time,
            "displacement_mm": t.displacement / MM,
            "force_N": t.shift_force,
            "sliding_speed_rpm": t.sliding_speed / RPM,
            "output_speed_rpm": t.output_speed / RPM,
            "relative_angle_deg": t.relative_angle / DEG,
            "contact_force_N": t.contact_force,
        }
    )
    table.to_csv(path, index=False, float_format="%.9g")


def write_animation(result: Engagement, path: Path) -> None:
    """Write the shift as one HTML page that opens without a network."""
    page = render(
        "shift.html.j2",
        result=result,
        dog=result.clutch.dog,
        mismatch=result.point.mismatch / RPM,
        angle=result.relative_angle / DEG,
        ceiling=FORCE_CEILING * float(result.trace.shift_force.max()),
        end=float(result.trace.time[-1]) / MS,
        shades=SHADES,
        data=json.dumps(_frames(result)),
        curves=figure_html(_curves(result), "curves"),
    )
    path.write_text(page, encoding="utf-8")


def _frames(result: Engagement) -> dict[str, Any]:
    """Return positions over time and the profile of the rings, mm and ms."""
    dog, trace = result.clutch.dog, result.trace
    times = np.linspace(0.0, trace.time[-1], FRAMES)
    way = np.interp(times, trace.time, trace.displacement) / MM
    slip = np.interp(times, trace.time, trace.relative_angle) * dog.mean_radius / MM
    return {
        "t": np.round(times / MS, 4).tolist(),
        "x": np.round(way, 5).tolist(),
        "s": np.round(slip, 5).tolist(),
        "pitch": dog.pitch / MM,
        "height": dog.height / MM,
        "gap": dog.axial_gap / MM,
        "profile": outline(dog, 1),
        "phases": [
            {"name": p.name, "start": p.start / MS, "end": p.end / MS, "shade": shade}
            for p, shade in zip(result.phases, SHADES, strict=True)
        ],
    }


def _curves(result: Engagement) -> go.Figure:
    """Draw displacement, speeds and forces over time with the phases behind them."""
    t = result.trace
    time = t.time / MS
    figure = make_subplots(3, 1, shared_xaxes=True, vertical_spacing=0.05)
    rows: list[tuple[int, str, Any, str, str]] = [
        (1, "displacement", t.displacement / MM, BLUE, "solid"),
        (2, "sliding ring", t.sliding_speed / RPM, BLUE, "solid"),
        (2, "output ring", t.output_speed / RPM, ORANGE, "dash"),
        (3, "contact force, axial", t.contact_force, GREY, "solid"),
        (3, "shift force", t.shift_force, GREEN, "dash"),
    ]
    for row, name, values, colour, dash in rows:
        line = {"color": colour, "dash": dash, "width": 2}
        figure.add_trace(go.Scatter(x=time, y=values, name=name, mode="lines", line=line), row, 1)
    for phase, shade in zip(result.phases, SHADES, strict=True):
        if phase.end > phase.start:
            span = {"x0": phase.start / MS, "x1": phase.end / MS}
            figure.add_vrect(**span, fillcolor=shade, line_width=0, layer="below")
    figure.update_yaxes(title="displacement, mm", row=1)
    figure.update_yaxes(title="speed, 1/min", row=2)
    # Impacts are far above the shift force; the axis keeps both in sight.
    ceiling = FORCE_CEILING * float(t.shift_force.max())
    figure.update_yaxes(title="force, N", range=[0.0, ceiling], row=3)
    figure.update_xaxes(title="time, ms", row=3)
    figure.update_layout(
        template="simple_white",
        height=620,
        font={"family": "system-ui, sans-serif", "size": 14, "color": INK},
        margin={"l": 70, "r": 20, "t": 40, "b": 50},
        legend={"orientation": "h", "y": 1.02, "yanchor": "bottom", "x": 0},
        hovermode="x unified",
    )
    return figure
