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

from dogshape.pipeline.reports.kit.look import LINES, MARKS, Row, styled
from dogshape.pipeline.reports.kit.maps import (
    LOSS_TO_GAIN,
    MINUS,
    MOST,
    TALL,
    frame,
    grid,
    heat_map,
    map_height,
)
from dogshape.pipeline.reports.surrogate.asked_points import spread

PAIR = (("prototype", "prototype"), ("chosen", "best"))  #: names with keys of the confirmation
#: The fewer engage, the darker; the scale stays one in grey.
DARK_TO_PALE = ((0.0, "#1f5fa8"), (0.5, "#a9c9e6"), (1.0, "#f1f6fb"))


@dataclass(frozen=True)
class Gain:
    """What the chosen design gains at one operating point: gain and standard error, s."""

    mismatch_rpm: float
    force_N: float
    gain_s: float
    error_s: float

    @property
    def clear(self) -> bool:
        """Whether it is at least twice its standard error."""
        return abs(self.gain_s) >= 2.0 * self.error_s and self.gain_s != 0.0


def gains(confirmation: Row) -> list[Gain]:
    """Return the gain at each operating point that both designs were confirmed at."""
    best = {(p["mismatch_rpm"], p["force_N"]): p for p in confirmation["best"]["points"]}
    found = []
    for point in confirmation["prototype"]["points"]:
        place = (point["mismatch_rpm"], point["force_N"])
        if place in best:
            errors = [p["standard_error_s"] for p in (point, best[place])]
            error = math.hypot(*(math.nan if e is None else e for e in errors))
            found.append(Gain(*place, point["mean_s"] - best[place]["mean_s"], error))
    return found


def is_grid(confirmation: Row) -> bool:
    """Tell whether the points are every mismatch with every force, few enough for maps.

    Weights must be products of one for the mismatch and one for the force.
    """
    points = confirmation["prototype"]["points"]
    mismatches, forces, places = grid(points)
    if len(places) < len(mismatches) * len(forces) or not (
        len(mismatches) <= MOST[0] and len(forces) <= MOST[1]
    ):
        return False
    weights = np.array(
        [
            [places[i, j].get("weight", 1.0) for j in range(len(forces))]
            for i in range(len(mismatches))
        ]
    )
    return bool(np.linalg.matrix_rank(weights, tol=1e-9 * float(weights.max())) == 1)


def weights_by(points: list[Row], key: str) -> dict[float, str]:
    """Return the weight of each mismatch, or force, of a grid in words, empty where all are equal.

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
            points.sort(key=lambda p: float(p["mismatch_rpm"]))
            points = _parted(points)
            error = [1.96 * (p.get("standard_error_s") or 0.0) * 1e3 for p in points]
            trace = go.Scatter(
                x=[p["mismatch_rpm"] for p in points],
                y=[None if p["mean_s"] is None else p["mean_s"] * 1e3 for p in points],
                error_y={"type": "data", "array": error, "thickness": 1},
                name=name,
                legendgroup=name,
                showlegend=column == 1,
                mode="lines+markers",
                line=LINES[name],
                marker={**MARKS[name], "size": 9},
                hovertemplate=f"{name}, %{{x:.4g}} 1/min, {force:.1f} N: %{{y:.1f}} ms"
                "<extra></extra>",
            )
            figure.add_trace(trace, 1, column)
    mismatches = sorted({p["mismatch_rpm"] for p in ours})
    if mismatches[0] > 0.0:
        figure.update_xaxes(type="log", tickvals=spread(mismatches, 3), tickangle=0)
    figure.update_xaxes(title="mismatch, 1/min")
    figure.update_yaxes(rangemode="tozero")
    figure.update_yaxes(title="mean shift time, ms", col=1)
    figure = styled(figure, 400)
    figure.update_layout(legend={"y": 1.12}, margin={"t": 70})
    return figure


def _parted(points: list[Row]) -> list[Row]:
    """Return points with a gap where the mismatch changes its sign: other flanks meet there."""
    signs = [p["mismatch_rpm"] > 0.0 for p in points]
    if len(set(signs)) < 2:
        return points
    first = signs.index(True)
    return [*points[:first], {"mismatch_rpm": None, "mean_s": None}, *points[first:]]


def engaged_figure(confirmation: Row) -> go.Figure:
    """Draw the share engaged at the first try over mismatch and force, with counts."""
    figure = make_subplots(
        1, 2, shared_yaxes=True, subplot_titles=[name for name, _ in PAIR], horizontal_spacing=0.04
    )
    for column, (_, key) in enumerate(PAIR, start=1):
        mismatches, forces, places = grid(confirmation[key]["points"])
        shares = np.full((len(mismatches), len(forces)), np.nan)
        words = np.full(shares.shape, "", dtype=object)
        for (i, j), p in places.items():
            shares[i, j] = p["engaged"]
            words[i, j] = engaged_words(p, " " if len(mismatches) > TALL else "<br>")
        figure.add_trace(heat_map(mismatches, forces, shares, words, DARK_TO_PALE), 1, column)
    figure.update_traces(zmin=0.0, zmax=1.0)
    return _mapped(figure, confirmation["prototype"]["points"])


def engaged_words(point: Row, between: str = " ") -> str:
    """Return the share that engages at the first try, and the counts."""
    engaged, count = point["engaged"], point["n"]
    return f"{100 * engaged:.0f} %{between}{round(engaged * count)}/{count}"


def gain_figure(confirmation: Row) -> go.Figure:
    """Draw what the chosen design gains over mismatch and force, ms with standard error."""
    found = gains(confirmation)
    rows = [{"mismatch_rpm": g.mismatch_rpm, "force_N": g.force_N, "gain": g} for g in found]
    mismatches, forces, places = grid(rows)
    values = np.full((len(mismatches), len(forces)), np.nan)
    words = np.full(values.shape, "", dtype=object)
    for (i, j), row in places.items():
        gain: Gain = row["gain"]
        values[i, j] = 1e3 * gain.gain_s
        words[i, j] = gain_words(gain)
    figure = make_subplots(1, 1)
    figure.add_trace(heat_map(mismatches, forces, values, words, LOSS_TO_GAIN))
    most = float(np.nanmax(np.abs(values))) or 1.0
    figure.update_traces(zmin=-most, zmax=most)
    for (i, j), row in places.items():
        if row["gain"].gain_s < 0.0:  # a frame tells a loss without colour
            frame(figure, i, j, "solid" if row["gain"].clear else "dot")
    return _mapped(figure, confirmation["prototype"]["points"])


def gain_words(gain: Gain) -> str:
    """Return gain and standard error in ms; a loss says so."""
    said = f"{1e3 * gain.gain_s:+.1f} ± {1e3 * gain.error_s:.1f}".replace("-", MINUS)
    return said + (" slower" if gain.gain_s < 0.0 else "")


def _mapped(figure: go.Figure, points: list[Row]) -> go.Figure:
    """Name the axes of a map; ticks have their weights where those differ."""
    for key, title, update in (
        ("force_N", "shift force, N", figure.update_xaxes),
        ("mismatch_rpm", "mismatch, 1/min", figure.update_yaxes),
    ):
        weights = weights_by(points, key)
        at = [f"{value:.4g}" for value in sorted(weights)]
        said = [f"{v:.4g}" + (f" ({weights[v]})" if weights[v] else "") for v in sorted(weights)]
        said = [words.replace("-", MINUS) for words in said]
        weighted = any(weights.values())
        said_of = title.replace(", ", ",<br>") if weighted and key == "mismatch_rpm" else title
        where = {} if key == "force_N" else {"col": 1}
        update(type="category", tickvals=at, ticktext=said)
        update(title=said_of + (" (weight)" if weighted else ""), **where)
    figure = styled(figure, map_height(len(weights)))
    figure.update_layout(margin={"t": 40})
    return figure
