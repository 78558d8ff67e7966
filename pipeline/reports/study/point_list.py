"""Operating points that are no grid: a line for each with times, gain and share engaged."""

from __future__ import annotations

import plotly.graph_objects as go
from plotly.subplots import make_subplots

from dogshape.pipeline.reports.kit.look import INK, MARKS, Row, styled
from dogshape.pipeline.reports.kit.maps import MINUS
from dogshape.pipeline.reports.study.operating_grid import PAIR, engaged_words, gain_words, gains

LINE = 30  #: height of a line, px
#: Marks of a gain: clear, or within twice its standard error.
GAINS = {True: "circle", False: "circle-open"}


def listed_figure(confirmation: Row) -> go.Figure:
    """Draw mean times, gain and share engaged at the first try, a line for each point."""
    points = sorted(confirmation["prototype"]["points"], key=_place)
    names = [_name(p, points) for p in points]
    figure = make_subplots(
        1, 3, shared_yaxes=True, column_widths=[0.44, 0.32, 0.24], horizontal_spacing=0.02,
        subplot_titles=["mean shift time, ms", "gain, ms", "engaged"],
    )  # fmt: skip
    for name, key in PAIR:
        mine = sorted(confirmation[key]["points"], key=_place)
        figure.add_trace(_times(name, mine, names), 1, 1)
    _add_gains(figure, confirmation, names)
    _add_shares(figure, confirmation, names)
    figure.update_yaxes(type="category", categoryorder="array", categoryarray=names[::-1])
    figure.update_yaxes(range=[-0.6, len(points) - 0.4])
    figure.update_yaxes(showgrid=True, gridcolor="#e6eaee")
    figure.update_xaxes(rangemode="tozero", col=1)
    figure = styled(figure, 150 + LINE * len(points))
    figure.update_layout(margin={"l": 190, "t": 80}, legend={"y": 1.0, "yref": "container",
                                                             "yanchor": "top"})  # fmt: skip
    return figure


def _place(point: Row) -> tuple[float, float]:
    return point["mismatch_rpm"], point["force_N"]


def _name(point: Row, points: list[Row]) -> str:
    words = f"{point['mismatch_rpm']:.4g} 1/min, {point['force_N']:.4g} N".replace("-", MINUS)
    weights = [p.get("weight", 1.0) for p in points]
    alike = max(weights) <= min(weights) * (1.0 + 1e-9)
    return words + ("" if alike else f" ({point['weight']:.3g})")


def _times(name: str, points: list[Row], names: list[str]) -> go.Scatter:
    error = [1.96e3 * (p["standard_error_s"] or 0.0) for p in points]
    return go.Scatter(
        x=[1e3 * p["mean_s"] for p in points], y=names, mode="markers", name=name,
        error_x={"type": "data", "array": error, "thickness": 1,
                 "arrayminus": [min(e, 1e3 * p["mean_s"])
                                for e, p in zip(error, points, strict=True)]},
        marker={**MARKS[name], "size": 11},
        hovertemplate=f"{name}, %{{y}}: %{{x:.1f}} ms<extra></extra>",
    )  # fmt: skip


def _add_gains(figure: go.Figure, confirmation: Row, names: list[str]) -> None:
    found = sorted(gains(confirmation), key=lambda gain: (gain.mismatch_rpm, gain.force_N))
    figure.add_scatter(
        x=[1e3 * gain.gain_s for gain in found], y=names, mode="markers", showlegend=False,
        error_x={"type": "data", "array": [1.96e3 * gain.error_s for gain in found],
                 "thickness": 1},
        marker={"color": INK, "size": 9, "symbol": [GAINS[gain.clear] for gain in found],
                "line": {"color": INK, "width": 1.5}},
        text=[gain_words(gain) for gain in found], name="gain",
        hovertemplate="%{y}: %{text} ms<extra></extra>", row=1, col=2,
    )  # fmt: skip
    figure.add_vline(0.0, line={"color": INK, "width": 1}, row=1, col=2)


def _add_shares(figure: go.Figure, confirmation: Row, names: list[str]) -> None:
    """Write the shares engaged of both designs as numbers in two columns."""
    for place, (_, key) in enumerate(PAIR):
        points = sorted(confirmation[key]["points"], key=_place)
        figure.add_scatter(
            x=[place] * len(points), y=names, mode="text", showlegend=False,
            text=[engaged_words(p) for p in points], name=f"engaged, {key}", hoverinfo="skip",
            row=1, col=3,
        )  # fmt: skip
    figure.update_xaxes(
        range=[-0.6, 1.6], tickvals=[0, 1], ticktext=[name for name, _ in PAIR], col=3
    )
