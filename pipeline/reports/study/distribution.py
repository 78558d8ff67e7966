"""The distribution of single shift times, prototype against chosen design."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import plotly.graph_objects as go

from dogshape.pipeline.reports.kit.look import INK, LINES, MARKS, Row, styled
from dogshape.pipeline.reports.study.design_shifts import (
    Array,
    Shifts,
    quantile,
    time_of,
    weights_of,
)

QUANTILES = (0.5, 0.95, 0.99)
UP = {0.5: 10, 0.95: 8, 0.99: 18}  #: of the words beside a quantile, px


@dataclass(frozen=True)
class Distribution:
    """Times of single shifts in order (n,), s, infinite where one did not engage.

    ``reached`` (n,) is the share of all shifts done by then; operating points have their weight.
    """

    times: Array
    reached: Array

    @property
    def lost(self) -> int:
        """Number of shifts that did not engage."""
        return int(np.isinf(self.times).sum())

    def quantile(self, share: float) -> float:
        """Return the time within which a share of shifts is done, s; infinite where none is."""
        return quantile(self.times, np.diff(self.reached, prepend=0.0), share)


def distribution(shifts: Shifts, design: dict[str, float]) -> Distribution | None:
    """Return the distribution of a design's shifts at the fresh angles; None without any."""
    rows = shifts.fresh(design)
    if not rows:
        return None
    times, weights = np.array([time_of(row) for row in rows]), weights_of(shifts.study, rows)
    order = np.argsort(times, kind="stable")
    return Distribution(times[order], np.cumsum(weights[order]))


def distribution_figure(found: dict[str, Distribution]) -> go.Figure:
    """Draw the share of shifts done against time with named quantiles; keys as in ``LINES``."""
    figure = go.Figure()
    for name, one in found.items():
        done = np.isfinite(one.times)
        times = [0.0, *(one.times[done] * 1e3)]
        figure.add_scatter(
            x=times, y=[0.0, *one.reached[done]], mode="lines", name=name,
            line={**LINES[name], "shape": "hv"},
            hovertemplate=f"{name}: %{{y:.1%}} within %{{x:.1f}} ms<extra></extra>",
        )  # fmt: skip
        marks = [(s, one.quantile(s) * 1e3) for s in QUANTILES if np.isfinite(one.quantile(s))]
        figure.add_scatter(
            x=[time for _, time in marks], y=[share for share, _ in marks], mode="markers",
            marker={**MARKS[name], "size": 12}, name=name, showlegend=False, hoverinfo="skip",
        )  # fmt: skip
    _label(figure, found)
    figure.update_xaxes(title="time of a single shift, ms", rangemode="tozero")
    figure.update_yaxes(title="share of shifts done", tickformat=".0%", range=[0, 1.1])
    return styled(figure, 460)


def _label(figure: go.Figure, found: dict[str, Distribution]) -> None:
    """Write each quantile beside its mark, where no curve is: left of the faster, else right."""
    first = min(found, key=lambda name: found[name].quantile(0.5))
    for share in QUANTILES:
        figure.add_hline(share, line={"color": INK, "width": 0.6, "dash": "dot"}, opacity=1)
        for name, one in found.items():
            time = one.quantile(share)
            if not np.isfinite(time):
                continue
            left = name == first
            figure.add_annotation(
                x=time * 1e3, y=share, text=f"{share:.0%}: {time * 1e3:.0f} ms", showarrow=False,
                xanchor="right" if left else "left", xshift=-12 if left else 12,
                yshift=UP[share] if left or share == QUANTILES[-1] else -UP[share],
                bgcolor="rgba(255, 255, 255, 0.85)", font={"size": 13},
            )  # fmt: skip


def quantile_rows(found: dict[str, Distribution]) -> list[Row]:
    """Return a row for each design: number of shifts, lost ones, quantiles and longest, s."""
    return [
        {
            "name": name,
            "shifts": len(one.times),
            "lost": one.lost,
            "quantiles_s": [one.quantile(share) for share in QUANTILES],
            "longest_s": one.quantile(1.0),
        }
        for name, one in found.items()
    ]
