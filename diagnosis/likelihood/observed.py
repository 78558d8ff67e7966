"""Observations of a data set at each operating point, as the likelihood counts them.

Single shifts of a point with ``MANY`` of them or more show which are late
(``diagnosis.prediction.model.late_times``); the mean and the spread are then those of the timely
ones. Within a mean, and among fewer single shifts, any number of late ones may hide.

Where the order of the shifts is known, a drift over the series is ``d`` times the mean time over
its whole length. What shifts at one operating point say of ``d`` is taken off all times; the rest
is an error that all points have in common.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.stats import norm
from scipy.stats import t as student

from dogshape.diagnosis.bench.bench_data import Bench, Cell, Reading
from dogshape.diagnosis.bench.flight_marks import SeenFlight, flights_of
from dogshape.diagnosis.prediction.model import LEAST_SD, Model, late_times
from dogshape.diagnosis.terms import Array

MANY = 4  #: single shifts, from which late ones can be seen
DRIFT = 0.1  #: of the mean time, standard deviation of a drift over the whole series
ALIKE = 4.0  #: degrees of freedom that the scatter of all points counts as at each
INSIDE = 0.95  #: probability below the upper end of an interval that holds 90 %
ROUNDS = 4  #: of slope and scatter in turn


@dataclass(frozen=True)
class Drift:
    """Drift over the series as a share of the mean time, by shifts at one operating point.

    ``mean`` and ``sd`` are its distribution, ``offsets`` what one ``sd`` makes of each cell's mean,
    s, (C,); ``informed`` is the share of the prior's variance that repeated points have taken. The
    series runs from ``first`` to ``last``, ``middle`` is the mean place of all shifts within it.
    """

    mean: float
    sd: float
    offsets: Array = field(repr=False)
    informed: float
    first: float
    last: float
    middle: float

    def places(self, rows: Sequence[Reading]) -> Array:
        """Compute places of readings in the series, of which the whole is one long, (k,)."""
        found = np.array([self.first if r.place is None else r.place for r in rows], dtype=float)
        return (found - self.first) / (self.last - self.first) - self.middle


@dataclass(frozen=True)
class Observed:
    """Observations of C operating points.

    Parameters
    ----------
    count, mean : number of shifts in the mean, and the mean, s, (C,); 0 and 0 for none.
    variance, freedom : of single shifts, s^2, and its degrees of freedom, (C,).
    late : number of late shifts beside the mean, (C,).
    hidden : whether late shifts may be within the mean, (C,).
    engaged, failed, untold : numbers of shifts that engaged, failed, or may not have been tried.
    mismatch, force : of each point, rad/s and N.
    drift : None where the order is not known.
    flights : marks of the free flight in traces.
    """

    count: Array
    mean: Array
    variance: Array
    freedom: Array
    late: Array
    hidden: Array
    engaged: Array
    failed: Array
    untold: Array
    mismatch: Array
    force: Array
    drift: Drift | None
    flights: tuple[SeenFlight, ...]

    @property
    def having(self) -> np.ndarray:
        """Mark the points with a mean, (C,)."""
        return self.count > 0


def observe(bench: Bench, model: Model) -> Observed:
    """Gather the observations of a data set at the operating points of a model."""
    drift = drift_of(bench.cells, model.far)
    rows = [
        _observed(cell, far, drift)
        for cell, far in zip(bench.cells, model.far.tolist(), strict=True)
    ]
    count, mean, variance, freedom, late, hidden = np.array(rows, dtype=float).reshape(-1, 6).T
    tried = [(cell.engaged, cell.failed, cell.unknown) for cell in bench.cells]
    engaged, failed, untold = np.array(tried, dtype=float).reshape(-1, 3).T
    return Observed(
        count,
        mean,
        variance,
        freedom,
        late,
        hidden.astype(bool),
        engaged,
        failed,
        untold,
        np.array([cell.point.mismatch for cell in bench.cells]),
        np.array([cell.point.profile.force for cell in bench.cells]),
        drift,
        flights_of(bench),
    )


def _observed(cell: Cell, far: float, drift: Drift | None) -> tuple[float, ...]:
    """Count one cell: number, mean, variance, freedom, late ones, whether some may hide."""
    rows = [r for r in cell.readings if r.time is not None]
    if not rows:
        return 0.0, 0.0, 1.0, 0.0, 0.0, 0.0
    times, numbers, late = _split(rows, far)
    if drift is not None:
        off = drift.mean * np.average(times, weights=numbers) * drift.places(rows)
        times = np.maximum(times - off, 0.1 * times)
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
    places = [r.place for row in rows for r in row]
    if not places or any(place is None for place in places):
        return None
    known = [place for place in places if place is not None]
    first, last = min(known), max(known)
    if first == last:
        return None
    numbers = [r.n for row in rows for r in row]
    middle = float(np.average((np.array(known) - first) / (last - first), weights=numbers))
    plain = Drift(0.0, DRIFT, np.zeros(len(cells)), 0.0, first, last, middle)
    parts, centres, means = [], np.zeros(len(cells)), np.zeros(len(cells))
    for k, (row, least) in enumerate(zip(rows, far.tolist(), strict=True)):
        if not row:
            continue
        times, weights, late = _split(row, least)
        times, weights, where = times[~late], weights[~late], plain.places(row)[~late]
        means[k] = np.average(times, weights=weights)
        centres[k] = np.average(where, weights=weights)
        parts.append((weights, means[k] * (where - centres[k]), times - means[k], means[k]))
    mean, variance = _within(parts)
    sd = float(np.sqrt(variance))
    return Drift(mean, sd, sd * means * centres, 1.0 - variance / DRIFT**2, first, last, middle)


def _within(parts: Sequence[tuple[Array, Array, Array, float]]) -> tuple[float, float]:
    """Compute mean and variance of a drift by what shifts at one operating point say of it.

    ``parts`` have numbers of shifts, places times mean, times less mean, and the mean, of each.
    """
    slope = 0.0
    # The 90 % interval of the slope is that of Student's distribution.
    freedom = sum(len(weights) - 1.0 for weights, *_ in parts)
    if freedom < 2.0:
        return slope, DRIFT**2
    for _ in range(ROUNDS):
        left = [float((w * (t - slope * x) ** 2).sum()) / m**2 for w, x, t, m in parts]
        pooled = sum(left) / (freedom - 1.0)
        unsure = float(student.ppf(INSIDE, freedom - 1.0) / norm.ppf(INSIDE)) ** 2
        scatter = [
            unsure * m**2 * (square + ALIKE * pooled) / (len(w) - 1.0 + ALIKE)
            for square, (w, _, _, m) in zip(left, parts, strict=True)
        ]
        pull, information = 0.0, DRIFT**-2.0
        for (w, x, t, _), sigma in zip(parts, scatter, strict=True):
            if sigma > 0.0:
                pull += float((w * x * t).sum()) / sigma
                information += float((w * x**2).sum()) / sigma
        slope = pull / information
    return slope, 1.0 / information
