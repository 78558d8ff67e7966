"""Single shifts of designs, out of the journal of a study, and the distribution of their times."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np
import plotly.graph_objects as go
from numpy.typing import NDArray

from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.reports.kit.look import INK, LINES, MARKS, Row, styled
from dogshape.pipeline.simulate.evaluation import NEW_ANGLES
from dogshape.pipeline.store.journal import ShiftJournal
from dogshape.sim.shift.conclusion import Outcome
from dogshape.sim.statistics.shift_records import Record, clutch_record, content_key
from dogshape.sim.units import RPM

Array = NDArray[np.float64]
QUANTILES = (0.5, 0.95, 0.99)
UP = {0.5: 0, 0.95: -5, 0.99: 6}  #: of the words beside the line of a quantile, px


@dataclass(frozen=True)
class Shifts:
    """Finished shifts of a study by design, those repeated with a finer tolerance left out."""

    study: Setup
    rows: tuple[Record, ...]
    groups: dict[str, list[Record]] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        both = self.study, self.study.confirming
        keys = {key for study in both for key in clutch_record(study.clutch)}
        groups: dict[str, list[Record]] = {}
        for row in self.rows:
            if row["outcome"] != Outcome.DIVERGED.value:
                groups.setdefault(
                    content_key({key: row[key] for key in keys & row.keys()}), []
                ).append(row)
        object.__setattr__(self, "groups", groups)

    def of(self, design: dict[str, float]) -> list[Record]:
        """Select the shifts of a design, given in edge units."""
        return self._of(self.study, design)

    def _of(self, study: Setup, design: dict[str, float]) -> list[Record]:
        clutch = study.clutch.with_dog(study.dog_with(design))
        return self.groups.get(content_key(clutch_record(clutch)), [])

    def searched(self, design: dict[str, float]) -> list[Record]:
        """Select the shifts at the angles of the search."""
        seed = self.study.file.expectation.seed
        return [row for row in self.of(design) if row.get("seed") == seed]

    def confirmed(self, design: dict[str, float]) -> list[Record]:
        """Select the shifts at the new angles of the confirmation."""
        seed = self.study.file.expectation.seed + NEW_ANGLES
        return [row for row in self._of(self.study.confirming, design) if row.get("seed") == seed]


def read_shifts(study: Setup, journal: ShiftJournal) -> Shifts:
    """Group the shifts of a journal."""
    return Shifts(study, tuple(journal.rows.values()))


def time_of(row: Record) -> float:
    """Return the time of a shift, s; infinite where it did not engage."""
    time = row["shift_time_s"]
    return math.inf if time is None else float(time)


def extremes(rows: Iterable[Record]) -> tuple[Record, Record] | None:
    """Select the fastest and the slowest of some shifts; None where there are none.

    A shift that does not engage is slower than any that does, and a blocked one the slowest.
    """

    def order(row: Record) -> tuple[float, bool, str]:
        return time_of(row), row["outcome"] == Outcome.BLOCKED.value, row["key"]

    ordered = sorted(rows, key=order)
    return (ordered[0], ordered[-1]) if ordered else None


def weights_of(study: Setup, rows: Sequence[Record]) -> Array:
    """Return the weight of each shift (n,), of sum one: its operating point's, shared evenly."""
    given = {place(p.mismatch / RPM, p.profile.force): p.weight for p in study.points}
    places = [place(row["mismatch_rpm"], row["force_N"]) for row in rows]
    counts = {one: places.count(one) for one in set(places)}
    weights = np.array([given.get(one, 0.0) / counts[one] for one in places])
    total = float(weights.sum())
    return weights / total if total > 0.0 else weights


def place(mismatch_rpm: float, force_N: float) -> tuple[str, str]:
    """Return an operating point as a key that rounding does not reach."""
    return f"{mismatch_rpm:.9g}", f"{force_N:.9g}"


def quantile(times: Array, weights: Array, share: float) -> float:
    """Return the least time within which a share of shifts is done, s; times (n,), weights (n,).

    numpy's weighted quantile has no slack for rounding where a share is reached exactly.
    """
    order = np.argsort(times)
    reached = np.cumsum(weights[order])
    place = int(np.searchsorted(reached, share * reached[-1] * (1.0 - 1e-12)))
    return float(times[order][min(place, len(times) - 1)])


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
    """Sort a design's shifts at the new angles by their times; None without any."""
    rows = shifts.confirmed(design)
    if not rows:
        return None
    weights = weights_of(shifts.study.operated(design), rows)
    times = np.array([time_of(row) for row in rows])
    order = np.argsort(times, kind="stable")
    return Distribution(times[order], np.cumsum(weights[order]))


def distribution_figure(found: dict[str, Distribution]) -> go.Figure:
    """Draw the share of shifts done against time with named quantiles; keys as in ``LINES``."""
    figure = go.Figure()
    for share in QUANTILES:
        figure.add_hline(share, line={"color": INK, "width": 0.6, "dash": "dot"}, opacity=1)
        figure.add_annotation(
            x=1.0, xref="paper", xanchor="left", y=share, yshift=UP[share], text=f" {share:.0%}",
            showarrow=False, font={"size": 12},
        )  # fmt: skip
    for name, one in found.items():
        done = np.isfinite(one.times)
        figure.add_scatter(
            x=[0.0, *(one.times[done] * 1e3)], y=[0.0, *one.reached[done]], mode="lines", name=name,
            line={**LINES[name], "shape": "hv"},
            hovertemplate=f"{name}: %{{y:.1%}} within %{{x:.1f}} ms<extra></extra>",
        )  # fmt: skip
        marks = [(s, one.quantile(s) * 1e3) for s in QUANTILES if np.isfinite(one.quantile(s))]
        figure.add_scatter(
            x=[time for _, time in marks], y=[share for share, _ in marks], mode="markers",
            marker={**MARKS[name], "size": 12}, name=name, showlegend=False, hoverinfo="skip",
        )  # fmt: skip
    figure.update_xaxes(title="time of a single shift, ms", rangemode="tozero")
    figure.update_yaxes(title="share of shifts done", tickformat=".0%", range=[0, 1.1])
    return styled(figure, 460).update_layout(margin={"r": 45})


def quantile_rows(found: dict[str, Distribution]) -> list[Row]:
    """List for each design the number of shifts, lost ones, quantiles and the longest, s."""
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
