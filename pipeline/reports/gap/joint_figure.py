"""Joint posterior of a hypothesis as a corner of marginals and pairs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from dogshape.diagnosis.diagnosis import Diagnosis
from dogshape.diagnosis.inference.joint_posterior import (
    CELLS,
    JointPosterior,
    amplitude_density,
    amplitude_quantile,
    density,
    held,
    joint_posterior,
    window_of,
)
from dogshape.diagnosis.prediction.hypotheses import UNKNOWN, at_shares
from dogshape.diagnosis.report.wording import between, quantity, shown
from dogshape.diagnosis.terms import Array, Hypothesis
from dogshape.pipeline.reports.kit.look import BLUE, GREY, INK, ORANGE, styled
from dogshape.pipeline.reports.kit.maps import thinned
from dogshape.sim.effect import Parameter

LEAST = 0.03  #: probability from which a hypothesis has a corner
EACH, EDGES = 168, 150  #: px of a panel, and of what is about them all
POINTS = 250  #: draws that are dots
DIGITS = 4


@dataclass(frozen=True)
class _Axis:
    """A column of the corner.

    Parameters
    ----------
    title : with the unit.
    shares : draws, as shares of the prior.
    place : value of such shares as people read it.
    said : interval and range before, in words.
    neutral : value that changes nothing; None where there is none.
    prior : density of shares before the data.
    """

    title: str
    shares: Array
    place: Callable[[Array], Array]
    said: tuple[str, str]
    neutral: float | None
    log: bool = False
    prior: Callable[[Array], Array] = np.ones_like

    @property
    def ticks(self) -> dict[str, object]:
        """Ticks in words that plotly takes: of a logarithm 1, 2 and 5 in each decade."""
        if not self.log:
            return {"nticks": 4}
        low, high = self.range
        steps = [m * 10.0**k for k in range(-6, 7) for m in (1.0, 2.0, 5.0)]
        inside = thinned([v for v in steps if low <= np.log10(v) <= high], 4)
        return {"tickvals": inside, "ticktext": [f"{v:g}" for v in inside]}

    @property
    def grid(self) -> Array:
        """Shares at which densities are drawn."""
        return np.linspace(*window_of(self.shares), CELLS)

    @property
    def range(self) -> list[float]:
        """Ends of the axis as plotly wants them."""
        ends = self.place(np.array(window_of(self.shares)))
        return [float(one) for one in (np.log10(ends) if self.log else ends)]


def with_corners(found: Diagnosis) -> list[Hypothesis]:
    """List the hypotheses that have a corner, the leading one first."""
    plausible = [h for h, p in found.posterior.items() if p > LEAST and h != UNKNOWN]
    those = dict.fromkeys([found.leading, *plausible])
    return [h for h in those if _axes(found, h)]


def joint_figure(found: Diagnosis, hypothesis: Hypothesis) -> go.Figure:
    """Draw the marginal of each parameter, and each pair of them with regions of 50 and 90 %."""
    drawn, axes = _drawn(found, hypothesis), _axes(found, hypothesis)
    size = len(axes)
    figure = make_subplots(
        size, size, horizontal_spacing=0.025, vertical_spacing=0.03,
        specs=[[{} if column <= row else None for column in range(size)] for row in range(size)],
    )  # fmt: skip
    for row, across in enumerate(axes):
        for column in range(row):
            _pair(figure, (axes[column], across), drawn.draws, (row + 1, column + 1))
        _marginal(figure, across, drawn.draws, row + 1)
    for row, across in enumerate(axes, start=1):
        kind = "log" if across.log else "linear"
        figure.update_xaxes(col=row, type=kind, range=across.range, showticklabels=False)
        figure.update_xaxes(col=row, **across.ticks)
        figure.update_xaxes(
            row=size, col=row, showticklabels=True, title={"text": across.title, "font_size": 13}
        )
        if row > 1:
            figure.update_yaxes(row=row, type=kind, range=across.range, showticklabels=False)
            figure.update_yaxes(
                row=row, col=1, showticklabels=True, **across.ticks,
                title={"text": across.title, "font_size": 13},
            )  # fmt: skip
        figure.update_yaxes(
            row=row, col=row, visible=False, type="linear", range=None, rangemode="tozero"
        )
    figure = styled(figure, EDGES + EACH * size)
    figure.update_xaxes(tickangle=0, tickfont_size=12, mirror=True, ticks="outside")
    figure.update_yaxes(tickfont_size=12, mirror=True)
    return figure.update_layout(showlegend=False, margin={"t": 62, "r": 150 if size < 3 else 20})


def _drawn(found: Diagnosis, hypothesis: Hypothesis) -> JointPosterior:
    return joint_posterior(found.scored[hypothesis])


def _axes(found: Diagnosis, hypothesis: Hypothesis) -> list[_Axis]:
    """Collect the columns of a hypothesis: its parameters, and the discrepancy's amplitude."""
    one = found.scored[hypothesis]
    drawn = _drawn(found, hypothesis)
    axes = [
        _of_parameter(found, hypothesis, parameter, drawn.shares[:, place])
        for place, parameter in enumerate(one.space.parameters)
    ]
    if drawn.amplitude is not None:
        high, usual = (100.0 * amplitude_quantile(one, *share) for share in ((), (0.95,)))
        low, middle, top = np.quantile(100.0 * drawn.amplitude, (0.05, 0.5, 0.95))
        said = f"{middle:.2g} % ({low:.2g} to {top:.2g} %)", f"before: 0 to {usual:.2g} %"
        shares = np.minimum(100.0 * drawn.amplitude / high, 1.0)
        axes.append(
            _Axis(
                "discrepancy, % of time", shares, lambda part: high * part, said, None,
                prior=amplitude_density,
            )
        )  # fmt: skip
    return axes


def _of_parameter(
    found: Diagnosis, hypothesis: Hypothesis, parameter: Parameter, shares: Array
) -> _Axis:
    interval = found.intervals[hypothesis][parameter.name]
    factor, unit = shown(parameter.name, 1.0)
    name = quantity(parameter.name)
    mean = f"{shown(parameter.name, interval.mean)[0]:.3g} {unit}".rstrip()
    said = (
        f"{mean} ({between(parameter.name, interval.low, interval.high)})",
        f"before: {factor * parameter.low:.4g} to {factor * parameter.high:.4g} {unit}".rstrip(),
    )
    return _Axis(
        f"{name}, {unit}" if unit else name,
        shares,
        lambda part: factor * at_shares(parameter, part),
        said,
        factor * parameter.neutral_of(found.scored[hypothesis].space.setting),
        parameter.scale == "log-uniform",
    )


def _rounded(values: Array) -> list[float]:
    """Round to some digits, so that a page stays small."""
    return [float(f"{one:.{DIGITS}g}") for one in values]


def _marginal(figure: go.Figure, axis: _Axis, count: float, at: int) -> None:
    """Draw density, interval, the prior's density, and the neutral value."""
    grid = axis.grid
    dense = density(axis.shares, grid, count)
    low, high = np.quantile(axis.shares, (0.05, 0.95))
    inside = (grid >= low) & (grid <= high)
    x = axis.place(grid)
    figure.add_scatter(
        x=_rounded(x[inside]), y=_rounded(dense[inside]), fill="tozeroy", mode="none",
        fillcolor="rgba(31,95,168,0.25)", hoverinfo="skip", row=at, col=at,
    )  # fmt: skip
    figure.add_scatter(
        x=_rounded(x), y=_rounded(dense), mode="lines", line={"color": BLUE, "width": 2},
        hoverinfo="skip", row=at, col=at,
    )  # fmt: skip
    figure.add_scatter(
        x=_rounded(x), y=_rounded(axis.prior(grid)), mode="lines",
        line={"color": ORANGE, "dash": "dot", "width": 2}, hoverinfo="skip", row=at, col=at,
    )  # fmt: skip
    ends = x[0], x[-1]
    if axis.neutral is not None and min(ends) <= axis.neutral <= max(ends):
        figure.add_scatter(
            x=[axis.neutral] * 2, y=[0.0, float(dense.max())], mode="lines",
            line={"color": INK, "dash": "dash", "width": 1.5}, hoverinfo="skip", row=at, col=at,
        )  # fmt: skip
    for words, up, look in ((axis.said[0], 18, INK), (axis.said[1], 3, "#6b3410")):
        figure.add_annotation(
            text=words, showarrow=False, row=at, col=at, xref="x domain", yref="y domain",
            x=0.0, y=1.0, xanchor="left", yanchor="bottom", yshift=up,
            font={"size": 12, "color": look},
        )  # fmt: skip


def _pair(figure: go.Figure, axes: tuple[_Axis, _Axis], count: float, at: tuple[int, int]) -> None:
    """Draw two parameters: draws, regions of 50 and 90 %, neutral values."""
    across, up = axes
    row, column = at
    figure.add_scatter(
        x=_rounded(across.place(across.shares[:: _step(across)])),
        y=_rounded(up.place(up.shares[:: _step(across)])), mode="markers",
        marker={"size": 3, "color": GREY, "opacity": 0.55}, hoverinfo="skip", row=row, col=column,
    )  # fmt: skip
    mass = held(across.shares, up.shares, (across.grid, up.grid), count)
    for level, width, dash in ((0.5, 2.2, "solid"), (0.9, 1.6, "dash")):
        figure.add_contour(
            x=_rounded(across.place(across.grid)), y=_rounded(up.place(up.grid)),
            z=np.round(mass, 3).tolist(), showscale=False, hoverinfo="skip",
            contours={"start": level, "end": level, "size": 1.0, "coloring": "none"},
            line={"color": BLUE, "width": width, "dash": dash}, row=row, col=column,
        )  # fmt: skip
    for axis, way in ((across, "x"), (up, "y")):
        ends = axis.place(axis.grid[[0, -1]])
        if axis.neutral is not None and min(ends) <= axis.neutral <= max(ends):
            line = figure.add_vline if way == "x" else figure.add_hline
            line(axis.neutral, line={"color": INK, "dash": "dash", "width": 1.2},
                 row=row, col=column)  # fmt: skip


def _step(axis: _Axis) -> int:
    return max(1, axis.shares.size // POINTS)
