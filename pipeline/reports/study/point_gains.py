"""Prototype and chosen design at each operating point: times, share engaged, gain.

Points of a grid are shown as maps and curves, any others (a list, a draw) in one figure with a
line for each point.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from dogshape.pipeline.reports.kit.look import INK, LINES, MARKS, Row, styled
from dogshape.pipeline.reports.kit.maps import (
    LOSS_TO_GAIN,
    TALL,
    frame,
    grid,
    has_room,
    map_height,
    mismatch_axes,
    shaded_cells,
)
from dogshape.pipeline.reports.kit.text import minus, ms_with_error, place_name

PAIR = (("prototype", "prototype"), ("chosen", "best"))  #: names with keys of the confirmation
#: The fewer engage, the darker; the scale stays one in grey.
DARK_TO_PALE = ((0.0, "#1f5fa8"), (0.5, "#a9c9e6"), (1.0, "#f1f6fb"))
LINE = 30  #: height of a line of listed points, px
HOVER = "%{y} 1/min, %{x} N"


@dataclass(frozen=True)
class Gain:
    """Gain of the chosen design at one operating point, with its standard error, s."""

    mismatch_rpm: float
    force_N: float
    gain_s: float
    error_s: float

    @property
    def clear(self) -> bool:
        """Whether it is at least twice its standard error."""
        return abs(self.gain_s) >= 2.0 * self.error_s and self.gain_s != 0.0

    @property
    def place(self) -> tuple[float, float]:
        """Mismatch and force."""
        return self.mismatch_rpm, self.force_N

    @property
    def words(self) -> str:
        """Gain and standard error in ms; a loss says so."""
        said = ms_with_error(self.gain_s, self.error_s, "+")
        return said + (" slower" if self.gain_s < 0.0 else "")


def gains(confirmation: Row) -> list[Gain]:
    """Compute the gain at each operating point that both designs were confirmed at."""
    best = {_place(p): p for p in confirmation["best"]["points"]}
    found = []
    for point in confirmation["prototype"]["points"]:
        other = best.get(_place(point))
        if other and None not in (point["mean_s"], other["mean_s"]):
            errors = [p["standard_error_s"] for p in (point, other)]
            error = math.hypot(*(math.nan if e is None else e for e in errors))
            found.append(Gain(*_place(point), point["mean_s"] - other["mean_s"], error))
    return found


def is_grid(confirmation: Row) -> bool:
    """Check that the points are every mismatch with every force, few enough for maps.

    Weights must be products of one for the mismatch and one for the force.
    """
    mismatches, forces, cells = grid(confirmation["prototype"]["points"], _place)
    if len(cells) < len(mismatches) * len(forces) or not has_room(mismatches, forces):
        return False
    weights = np.ones((len(mismatches), len(forces)))
    for at, point in cells.items():
        weights[at] = point.get("weight", 1.0)
    return bool(np.linalg.matrix_rank(weights, tol=1e-9 * float(weights.max())) == 1)


def weights_by(points: list[Row], key: str) -> dict[float, str]:
    """Print the weight of each mismatch, or force, of a grid; empty where all are equal.

    The least is 1.
    """
    sums: dict[float, float] = {}
    for p in points:
        sums[p[key]] = sums.get(p[key], 0.0) + p.get("weight", 1.0)
    least, most = min(sums.values()), max(sums.values())
    if most <= least * (1.0 + 1e-9):
        return dict.fromkeys(sums, "")
    return {value: f"{total / least:.3g}" for value, total in sums.items()}


def points_figure(confirmation: Row) -> go.Figure:
    """Draw mean shift time over mismatch, a panel for each force, prototype and chosen design."""
    ours = confirmation["prototype"]["points"]
    forces, weight = sorted({p["force_N"] for p in ours}), weights_by(ours, "force_N")
    titles = [f"{f:.1f} N" + (f", weight {weight[f]}" if weight[f] else "") for f in forces]
    figure = make_subplots(1, len(forces), shared_yaxes=True, subplot_titles=titles)
    for column, force in enumerate(forces, start=1):
        for name, key in PAIR:
            points = [p for p in confirmation[key]["points"] if p["force_N"] == force]
            points = _parted(sorted(points, key=_place))
            error = [1.96 * (p.get("standard_error_s") or 0.0) * 1e3 for p in points]
            figure.add_scatter(
                x=[p["mismatch_rpm"] for p in points],
                y=[None if p["mean_s"] is None else p["mean_s"] * 1e3 for p in points],
                error_y={"type": "data", "array": error, "thickness": 1},
                name=name, legendgroup=name, showlegend=column == 1, mode="lines+markers",
                line=LINES[name], marker={**MARKS[name], "size": 9},
                hovertemplate=f"{name}, %{{x:.4g}} 1/min, {force:.1f} N: %{{y:.1f}} ms"
                "<extra></extra>",
                row=1, col=column,
            )  # fmt: skip
    figure = mismatch_axes(figure, [p["mismatch_rpm"] for p in ours], 400)
    return figure.update_layout(legend={"y": 1.12}, margin={"t": 70})


def _parted(points: list[Row]) -> list[Row]:
    """Return points with a gap where the mismatch changes its sign: other flanks meet there."""
    first = sum(p["mismatch_rpm"] <= 0.0 for p in points)
    if first in (0, len(points)):
        return points
    return [*points[:first], {"mismatch_rpm": None, "mean_s": None}, *points[first:]]


def engaged_figure(confirmation: Row) -> go.Figure:
    """Draw the share engaged at the first try over mismatch and force, with counts."""
    figure = make_subplots(
        1, 2, shared_yaxes=True, subplot_titles=[name for name, _ in PAIR], horizontal_spacing=0.04
    )
    for column, (_, key) in enumerate(PAIR, start=1):
        mismatches, forces, places = grid(confirmation[key]["points"], _place)
        between = " " if len(mismatches) > TALL else "<br>"
        cells = {at: (p["engaged"], engaged_words(p, between)) for at, p in places.items()}
        trace = shaded_cells(_names(forces), _names(mismatches), cells, DARK_TO_PALE, HOVER)
        figure.add_trace(trace, 1, column)
    figure.update_traces(zmin=0.0, zmax=1.0)
    return _mapped(figure, confirmation["prototype"]["points"])


def engaged_words(point: Row, between: str = " ") -> str:
    """Print the share that engages at the first try, and the counts."""
    engaged, count = point["engaged"], point["n"]
    return f"{100 * engaged:.0f} %{between}{round(engaged * count)}/{count}"


def gain_figure(confirmation: Row) -> go.Figure:
    """Draw what the chosen design gains over mismatch and force, ms with standard error."""
    mismatches, forces, places = grid(gains(confirmation), lambda gain: gain.place)
    cells = {at: (1e3 * gain.gain_s, gain.words) for at, gain in places.items()}
    figure = make_subplots(1, 1)
    figure.add_trace(shaded_cells(_names(forces), _names(mismatches), cells, LOSS_TO_GAIN, HOVER))
    most = max((abs(value) for value, _ in cells.values()), default=0.0) or 1.0
    figure.update_traces(zmin=-most, zmax=most)
    for (i, j), gain in places.items():
        if gain.gain_s < 0.0:  # a frame tells a loss without colour
            frame(figure, i, j, "solid" if gain.clear else "dot")
    return _mapped(figure, confirmation["prototype"]["points"])


def _names(values: list[float]) -> list[str]:
    return [f"{value:.4g}" for value in values]


def _mapped(figure: go.Figure, points: list[Row]) -> go.Figure:
    """Name the axes of a map; ticks have their weights where those differ."""
    for key, title, update in (
        ("force_N", "shift force, N", figure.update_xaxes),
        ("mismatch_rpm", "mismatch, 1/min", figure.update_yaxes),
    ):
        weights = weights_by(points, key)
        at = _names(sorted(weights))
        said = [f"{v:.4g}" + (f" ({weights[v]})" if weights[v] else "") for v in sorted(weights)]
        update(type="category", tickvals=at, ticktext=[minus(tick) for tick in said])
        words = title
        if any(weights.values()):
            words = (title.replace(", ", ",<br>") if key == "mismatch_rpm" else title) + " (weight)"
        update(title=words, **({} if key == "force_N" else {"col": 1}))
    return styled(figure, map_height(len(weights))).update_layout(margin={"t": 40})


def listed_figure(confirmation: Row) -> go.Figure:
    """Draw mean times, gain and share engaged at the first try, a line for each point."""
    points = sorted(confirmation["prototype"]["points"], key=_place)
    weights = [p.get("weight", 1.0) for p in points]
    alike = max(weights) <= min(weights) * (1.0 + 1e-9)
    names = [place_name(*_place(p)) + ("" if alike else f" ({p['weight']:.3g})") for p in points]
    figure = make_subplots(
        1, 3, shared_yaxes=True, column_widths=[0.44, 0.32, 0.24], horizontal_spacing=0.02,
        subplot_titles=["mean shift time, ms", "gain, ms", "engaged"],
    )  # fmt: skip
    for column, (name, key) in enumerate(PAIR):
        mine = sorted(confirmation[key]["points"], key=_place)
        error = [1.96e3 * (p["standard_error_s"] or 0.0) for p in mine]
        means = [None if p["mean_s"] is None else 1e3 * p["mean_s"] for p in mine]
        low = [min(e, mean or 0.0) for e, mean in zip(error, means, strict=True)]
        figure.add_scatter(
            x=means, y=names, mode="markers", name=name,
            error_x={"type": "data", "array": error, "thickness": 1, "arrayminus": low},
            marker={**MARKS[name], "size": 11},
            hovertemplate=f"{name}, %{{y}}: %{{x:.1f}} ms<extra></extra>", row=1, col=1,
        )  # fmt: skip
        figure.add_scatter(
            x=[column] * len(mine), y=names, mode="text", showlegend=False,
            text=[engaged_words(p) for p in mine], name=f"engaged, {key}", hoverinfo="skip",
            row=1, col=3,
        )  # fmt: skip
    found = sorted(gains(confirmation), key=lambda gain: gain.place)
    figure.add_scatter(
        x=[1e3 * gain.gain_s for gain in found], y=names, mode="markers", showlegend=False,
        error_x={"type": "data", "array": [1.96e3 * gain.error_s for gain in found],
                 "thickness": 1},
        marker={"color": INK, "size": 9, "line": {"color": INK, "width": 1.5},
                "symbol": ["circle" if gain.clear else "circle-open" for gain in found]},
        text=[gain.words for gain in found], name="gain",
        hovertemplate="%{y}: %{text} ms<extra></extra>", row=1, col=2,
    )  # fmt: skip
    figure.add_vline(0.0, line={"color": INK, "width": 1}, row=1, col=2)
    figure.update_xaxes(range=[-0.6, 1.6], tickvals=[0, 1], ticktext=[n for n, _ in PAIR], col=3)
    figure.update_yaxes(type="category", categoryorder="array", categoryarray=names[::-1])
    figure.update_yaxes(range=[-0.6, len(points) - 0.4], showgrid=True, gridcolor="#e6eaee")
    figure.update_xaxes(rangemode="tozero", col=1)
    legend = {"y": 1.0, "yref": "container", "yanchor": "top"}
    figure = styled(figure, 150 + LINE * len(points))
    return figure.update_layout(margin={"l": 190, "t": 80}, legend=legend)


def _place(point: Row) -> tuple[float, float]:
    return point["mismatch_rpm"], point["force_N"]
