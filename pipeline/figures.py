"""Figures of the report, as plotly objects."""

from __future__ import annotations

from typing import Any

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from pipeline.design import OBJECTIVES, SIMULATED

Row = dict[str, Any]

INK = "#1b2733"
GREY = "#9aa5b1"
BLUE = "#1f5fa8"
ORANGE = "#c8590c"
GREEN = "#2e7d4f"
DASHES = ("solid", "dash", "dot", "dashdot")
COLOURS = (BLUE, ORANGE, GREEN, "#7a3b8f")


def styled(figure: go.Figure, height: int) -> go.Figure:
    """Give a figure the look of all pages and its height in px."""
    figure.update_layout(
        template="simple_white",
        height=height,
        font={"family": "system-ui, sans-serif", "size": 14, "color": INK},
        margin={"l": 70, "r": 20, "t": 40, "b": 60},
        legend={"orientation": "h", "y": 1.02, "yanchor": "bottom", "x": 0},
        hoverlabel={"align": "left"},
    )
    return figure


def axis_title(name: str) -> str:
    """Return label and unit of an objective; times are drawn in ms."""
    if name == SIMULATED:
        return "expected shift time, ms"
    objective = OBJECTIVES[name]
    return f"{objective.label}, {objective.unit}" if objective.unit else objective.label


def _describe(row: Row, variables: list[str]) -> str:
    lines = [f"design {row['trial']}"]
    lines += [f"{name} {row[name]:.4g}" for name in variables]
    if row["expected_shift_time_s"] is not None:
        time, error = row["expected_shift_time_s"] * 1e3, row["standard_error_s"] * 1e3
        lines.append(f"{time:.1f} ± {error:.1f} ms")
    if row["failed"]:
        lines.append("fails " + ", ".join(row["failed"]))
    else:
        lines.append(f"smallest margin {row['smallest_margin']:.0%} ({row['weakest_check']})")
    return "<br>".join(lines)


def is_barred(row: Row) -> bool:
    """Tell whether a design failed a check that needs no simulation, and so has no time."""
    return not row["feasible"] and row["expected_shift_time_s"] is None


def front_figure(result: Row, variables: list[str], other: str) -> go.Figure:
    """Draw expected shift time against another objective, infeasible designs beside it."""
    barred = [r for r in result["trials"] if is_barred(r) and r.get(other) is not None]
    hard = [r for r in result["trials"] if not r["feasible"] and not is_barred(r)]
    widths = [0.88, 0.12] if barred else [1.0]
    figure = make_subplots(1, len(widths), shared_yaxes=True, column_widths=widths)
    on_front = {r["trial"] for r in result["front"]}
    plain = [r for r in result["trials"] if r["feasible"] and r["trial"] not in on_front]
    looks: dict[str, tuple[list[Row], str, Row]] = {
        "dominated": (plain, "markers", {"color": GREY, "size": 8, "symbol": "circle-open"}),
        "lands too hard": (hard, "markers", {"color": INK, "size": 8, "symbol": "x"}),
        "front": (result["front"], "lines+markers", {"color": BLUE, "size": 10}),
        "prototype": (
            [r for r in result["trials"] if r["prototype"] and r["feasible"]],
            "markers",
            {"color": ORANGE, "size": 17, "symbol": "star"},
        ),
    }
    for name, (rows, mode, marker) in looks.items():
        look = {"mode": mode, "marker": marker}
        if rows:
            figure.add_trace(_scatter(name, rows, other, variables, look), 1, 1)
    if barred:
        cross = {"color": INK, "size": 8, "symbol": "x"}
        trace = go.Scatter(
            x=["not simulated"] * len(barred),
            y=[r[other] for r in barred],
            mode="markers",
            name="infeasible",
            marker=cross,
            text=[_describe(r, variables) for r in barred],
            hoverinfo="text",
        )
        figure.add_trace(trace, 1, 2)
    shown = [r for r in result["trials"] if r["feasible"] and r["prototype"]] + result["front"]
    times = [r["expected_shift_time_s"] * 1e3 for r in shown]
    heights = [r[other] for r in shown + barred]
    figure.update_xaxes(title=axis_title(SIMULATED), range=_window(times), col=1)
    figure.update_yaxes(title=axis_title(other), range=_window(heights), col=1)
    return styled(figure, 480)


def _window(values: list[float]) -> list[float]:
    """Return a range that shows ``values`` with room on either side."""
    low, high = min(values), max(values)
    room = 0.12 * (high - low) or 0.1 * abs(high)
    return [low - room, high + room]


def _scatter(name: str, rows: list[Row], other: str, variables: list[str], look: Row) -> go.Scatter:
    error = [1.96 * r["standard_error_s"] * 1e3 for r in rows]
    return go.Scatter(
        x=[r["expected_shift_time_s"] * 1e3 for r in rows],
        y=[r[other] for r in rows],
        error_x={"type": "data", "array": error, "thickness": 1, "width": 3},
        name=name,
        line={"color": BLUE, "shape": "vh", "width": 1.5},
        **look,
        text=[_describe(r, variables) for r in rows],
        hoverinfo="text",
    )


def convergence_figure(result: Row) -> go.Figure:
    """Draw every simulated design and the best so far against the number of designs."""
    rows = [r for r in result["trials"] if r["feasible"]]
    times = np.array([r["expected_shift_time_s"] for r in rows]) * 1e3
    number = np.arange(1, len(times) + 1)
    figure = go.Figure()
    figure.add_scatter(
        x=number,
        y=times,
        mode="markers",
        name="simulated design",
        marker={"color": GREY, "symbol": "circle-open", "size": 8},
    )
    figure.add_scatter(
        x=number,
        y=np.minimum.accumulate(times),
        mode="lines",
        name="best so far",
        line={"color": BLUE, "width": 2.5, "shape": "hv"},
    )
    figure.update_xaxes(title="simulated designs, in order")
    figure.update_yaxes(title=axis_title(SIMULATED))
    return styled(figure, 380)


def points_figure(confirmation: Row) -> go.Figure:
    """Draw mean shift time over mismatch, a panel for each force, prototype and best."""
    forces = sorted({p["force_N"] for p in confirmation["prototype"]["points"]})
    titles = [f"{force:.1f} N" for force in forces]
    figure = make_subplots(1, len(forces), shared_yaxes=True, subplot_titles=titles)
    looks = (("prototype", ORANGE, "dash", "star"), ("best", BLUE, "solid", "circle"))
    for column, force in enumerate(forces, start=1):
        for name, colour, dash, symbol in looks:
            points = [p for p in confirmation[name]["points"] if p["force_N"] == force]
            points.sort(key=lambda p: float(p["mismatch_rpm"]))
            error = [1.96 * p["standard_error_s"] * 1e3 for p in points]
            trace = go.Scatter(
                x=[p["mismatch_rpm"] for p in points],
                y=[p["mean_s"] * 1e3 for p in points],
                error_y={"type": "data", "array": error, "thickness": 1},
                name=name,
                legendgroup=name,
                showlegend=column == 1,
                mode="lines+markers",
                line={"color": colour, "dash": dash},
                marker={"symbol": symbol, "size": 8},
            )
            figure.add_trace(trace, 1, column)
    positive = all(p["mismatch_rpm"] > 0 for p in confirmation["prototype"]["points"])
    if positive:
        figure.update_xaxes(type="log", tickvals=[5, 10, 25, 50, 100, 250])
    figure.update_xaxes(title="mismatch, 1/min")
    figure.update_yaxes(rangemode="tozero")
    figure.update_yaxes(title="mean shift time, ms", col=1)
    figure = styled(figure, 400)
    figure.update_layout(legend={"y": 1.12}, margin={"t": 70})
    return figure
