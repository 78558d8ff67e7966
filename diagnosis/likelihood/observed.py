"""Observations of a data set at each operating point, as the likelihood counts them.

Among ``MANY`` single shifts of a point late ones show; mean and spread are those of the others.
Within a mean, and among fewer single shifts, any number of late ones may hide.

Where the order of the shifts is known, a drift over the series is ``d`` times the mean time over
its whole length. What shifts at one operating point say of ``d`` is taken off all times; the rest
is an error that all points have in common.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.stats import norm
from scipy.stats import t as student

from dogshape.diagnosis.bench.bench_data import Bench, Cell, Reading
from dogshape.diagnosis.bench.flight_marks import SeenFlight, flights_of
from dogshape.diagnosis.prediction.model import Model
from dogshape.diagnosis.prediction.moments import LEAST_SD, late_times
from dogshape.diagnosis.terms import Array

MANY = 4  #: single shifts, from which late ones can be seen
DRIFT = 0.1  #: of the mean time, standard deviation of a drift over the whole series
INSIDE = 0.95  #: probability below the upper end of an interval that holds 90 %


@dataclass(frozen=True)
class Drift:
    """Drift over the series as a share of the mean time, by shifts at one operating point.

    ``offsets`` are what one ``sd`` makes of each cell's mean, s, (C,), ``places`` those of each
    cell's times in a series of length 1 and mean 0; ``informed`` is one less variance over prior.
    """

    mean: float
    sd: float
    offsets: Array = field(repr=False)
    informed: float
    places: tuple[Array, ...] = field(repr=False)

    def to_dict(self) -> dict[str, Any]:
        """Give the record ``drift``, with the interval that holds 90 %."""
        low, high = self.mean - 1.645 * self.sd, self.mean + 1.645 * self.sd
        return {"share": {"mean": self.mean, "low": low, "high": high}, "informed": self.informed}


@dataclass(frozen=True)
class Observed:
    """Observations of C operating points."""

    count: Array  #: number of shifts in the mean, 0 for none, (C,)
    mean: Array  #: s, (C,)
    variance: Array  #: of single shifts, s^2, (C,)
    freedom: Array  #: its degrees of freedom, (C,)
    late: Array  #: number of late shifts beside the mean, (C,)
    hidden: Array  #: whether late shifts may be within the mean, (C,)
    engaged: Array  #: number of shifts, (C,)
    failed: Array  #: number of shifts, (C,)
    mismatch: Array  #: rad/s, (C,)
    force: Array  #: N, (C,)
    drift: Drift | None  #: None where the order is not known
    flights: tuple[SeenFlight, ...]  #: marks of the free flight in traces


def observe(bench: Bench, model: Model) -> Observed:
    """Gather the observations of a data set at the operating points of a model."""
    drift = drift_of(bench.cells, model.far)
    rows = [
        _observed(cell, far, 0.0 if drift is None else drift.mean * drift.places[k])
        for k, (cell, far) in enumerate(zip(bench.cells, model.far.tolist(), strict=True))
    ]
    count, mean, variance, freedom, late, hidden = np.array(rows, dtype=float).reshape(-1, 6).T
    engaged, failed, mismatch, force = np.array([
        (cell.engaged, cell.failed, cell.point.mismatch, cell.point.profile.force)
        for cell in bench.cells
    ], dtype=float).T  # fmt: skip
    return Observed(
        count, mean, variance, freedom, late, hidden.astype(bool), engaged, failed, mismatch,
        force, drift, flights_of(bench),
    )  # fmt: skip


def _observed(cell: Cell, far: float, drift: Array | float) -> tuple[float, ...]:
    """Count one cell: number, mean, variance, freedom, late ones, whether some may hide."""
    rows = [r for r in cell.readings if r.time is not None]
    if not rows:
        return 0.0, 0.0, 1.0, 0.0, 0.0, 0.0
    times, numbers, late = _split(rows, far)
    times = np.maximum(times - drift * np.average(times, weights=numbers), 0.1 * times)
    hides = bool((numbers > 1).any()) or len(times) < MANY
    squares = [(r.sd**2 * (r.n - 1), r.n - 1.0) for r in rows if r.sd is not None and r.n > 1]
    single = times[(numbers == 1) & ~late]
    if single.size > 1:
        squares.append((float(single.var(ddof=1)) * (single.size - 1), single.size - 1.0))
    freedom = sum(part for _, part in squares)
    variance = sum(square for square, _ in squares) / freedom if freedom else 1.0
    mean = float(np.average(times[~late], weights=numbers[~late]))
    count = float(numbers[~late].sum())
    return count, mean, max(variance, LEAST_SD**2), freedom, float(late.sum()), float(hides)


def _split(rows: Sequence[Reading], far: float) -> tuple[Array, Array, np.ndarray]:
    """Give times, numbers of shifts, and which single shifts are seen to be late, (k,) each."""
    times = np.array([r.time for r in rows], dtype=float)
    numbers = np.array([r.n for r in rows], dtype=float)
    single, late = numbers == 1, np.zeros(len(rows), dtype=bool)
    if single.sum() >= MANY:
        late[single] = late_times(times[single][None], np.array([far]))[0]
    return times, numbers, late


def drift_of(cells: Sequence[Cell], far: Array) -> Drift | None:
    """Estimate the drift over the series; None where the order of the shifts is not known."""
    rows = [[r for r in cell.readings if r.time is not None] for cell in cells]
    known = [r.place for row in rows for r in row if r.place is not None]
    if len(known) < sum(map(len, rows)) or len(set(known)) < 2:
        return None
    whole = (np.array(known) - min(known)) / (max(known) - min(known))
    whole = whole - np.average(whole, weights=[r.n for row in rows for r in row])
    places = tuple(np.split(whole, np.cumsum([len(row) for row in rows])[:-1]))
    parts, centres, means = [], np.zeros(len(cells)), np.zeros(len(cells))
    for k, (row, least) in enumerate(zip(rows, far.tolist(), strict=True)):
        if row:
            times, weights, late = _split(row, least)
            times, weights, where = times[~late], weights[~late], places[k][~late]
            means[k] = np.average(times, weights=weights)
            centres[k] = np.average(where, weights=weights)
            parts.append((weights, where - centres[k], times / means[k] - 1.0))
    mean, variance = _within(parts)
    sd = float(np.sqrt(variance))
    return Drift(mean, sd, sd * means * centres, 1.0 - variance / DRIFT**2, places)


def _within(parts: Sequence[tuple[Array, Array, Array]]) -> tuple[float, float]:
    """Regress relative times on places, each less those of their point: mean and variance."""
    weights, places, times = (np.concatenate(part) for part in zip(*parts, strict=True))
    freedom, square = weights.size - len(parts), float((weights * places**2).sum())
    if freedom < 2.0 or square == 0.0:
        return 0.0, DRIFT**2
    pull = float((weights * places * times).sum())
    scatter = max(float((weights * times**2).sum()) - pull**2 / square, 1e-12) / (freedom - 1.0)
    # The 90 % interval of the slope is that of Student's distribution.
    scatter *= float(student.ppf(INSIDE, freedom - 1.0) / norm.ppf(INSIDE)) ** 2
    information = DRIFT**-2.0 + square / scatter
    return pull / scatter / information, 1.0 / information
