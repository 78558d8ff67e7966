"""Observations of a data set at each operating point, as the likelihood counts them.

Late shifts show among ``MIN_SINGLE_SHIFTS`` single shifts of a point; mean and spread are those of
the others. Within a mean, and among fewer single shifts, any number of late ones may hide.

Where the order of the shifts is known, a drift over the series is ``d`` times the mean time over
its whole length. What shifts at one operating point say of ``d`` is taken off all times; the rest
is an error that all points have in common.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from scipy.stats import norm
from scipy.stats import t as student

from dogshape.bench.bench_data import Bench, Cell, Reading
from dogshape.bench.contact_marks import SeenContacts, contacts_of
from dogshape.bench.flight_marks import SeenFlight, flights_of
from dogshape.diagnosis.prediction.model import Model
from dogshape.diagnosis.prediction.moments import MIN_SD_S, mark_late
from dogshape.diagnosis.terms import Array

MIN_SINGLE_SHIFTS = 4  #: of a point, from which late ones can be seen
UPPER_PROBABILITY = 0.95  #: below the upper end of an interval that holds 90 %


@dataclass(frozen=True)
class Drift:
    """Drift over the series as a share of the mean time, by shifts at one operating point."""

    mean: float
    sd: float
    offsets: Array = field(repr=False)  #: of each cell's mean by one ``sd``, s, (C,)
    informed: float  #: 1 less variance over prior variance
    #: Of each cell's times, in a series of length 1 and mean 0.
    places: tuple[Array, ...] = field(repr=False)

    def to_dict(self) -> dict[str, Any]:
        """Write the record ``drift``, with the interval that holds 90 %."""
        low = self.mean - 1.645 * self.sd
        high = self.mean + 1.645 * self.sd
        return {"share": {"mean": self.mean, "low": low, "high": high}, "informed": self.informed}


@dataclass(frozen=True)
class Observations:
    """Observations of C operating points."""

    count: Array  #: number of shifts in the mean, 0 for none, (C,)
    mean: Array  #: s, (C,)
    variance: Array  #: of single shifts, s^2, (C,)
    freedom: Array  #: degrees of freedom of the variance, (C,)
    late_count: Array  #: number of late shifts beside the mean, (C,)
    hides_late: np.ndarray  #: whether late shifts may be within the mean, (C,)
    engaged_count: Array  #: number of shifts, (C,)
    failed_count: Array  #: number of shifts, (C,)
    mismatch: Array  #: rad/s, (C,)
    force: Array  #: N, (C,)
    drift: Drift | None  #: None where the order of the shifts is not known
    flights: tuple[SeenFlight, ...]  #: marks of the free flight in traces
    contacts: SeenContacts | None  #: marks of the contact in traces


class _CellSummary(NamedTuple):
    """Observations of one operating point, in the order of ``Observations``."""

    shift_count: float = 0.0
    mean: float = 0.0
    variance: float = 1.0
    freedom: float = 0.0
    late_count: float = 0.0
    hides_late: float = 0.0


class _Times(NamedTuple):
    """Times of one operating point, (k,) each."""

    times: Array  #: s
    counts: Array  #: number of shifts of each time
    is_late: np.ndarray  #: whether a single shift is seen to be late


def observe(bench: Bench, model: Model) -> Observations:
    """Gather the observations of a data set at the operating points of a model."""
    drift = estimate_drift(bench.cells, model.baseline.min_late_delay, model.constants.drift)
    summaries = []
    for k, (cell, min_delay) in enumerate(
        zip(bench.cells, model.baseline.min_late_delay.tolist(), strict=True)
    ):
        drift_shares = 0.0 if drift is None else drift.mean * drift.places[k]
        summaries.append(_summarise(cell, min_delay, drift_shares))
    columns = _CellSummary(*np.array(summaries, dtype=float).reshape(-1, 6).T)
    rows = [(c.engaged, c.failed, c.point.mismatch, c.point.profile.force) for c in bench.cells]
    engaged, failed, mismatch, force = np.array(rows, dtype=float).T
    return Observations(
        count=np.asarray(columns.shift_count),
        mean=np.asarray(columns.mean),
        variance=np.asarray(columns.variance),
        freedom=np.asarray(columns.freedom),
        late_count=np.asarray(columns.late_count),
        hides_late=np.asarray(columns.hides_late).astype(bool),
        engaged_count=engaged,
        failed_count=failed,
        mismatch=mismatch,
        force=force,
        drift=drift,
        flights=flights_of(bench),
        contacts=contacts_of(bench),
    )


def _summarise(cell: Cell, min_delay: float, drift_shares: Array | float) -> _CellSummary:
    """Summarise the shifts of one cell, a drift (k,) as shares of the mean taken off its times.

    ``min_delay`` of a late shift behind the median is in s.
    """
    readings = [reading for reading in cell.readings if reading.time is not None]
    if not readings:
        return _CellSummary()
    times, counts, is_late = _read_times(readings, min_delay)
    times = np.maximum(times - drift_shares * np.average(times, weights=counts), 0.1 * times)
    hides_late = bool((counts > 1).any()) or len(times) < MIN_SINGLE_SHIFTS
    square_sum = freedom = 0.0
    for reading in readings:
        if reading.sd is not None and reading.n > 1:
            square_sum += reading.sd**2 * (reading.n - 1)
            freedom += reading.n - 1.0
    single = times[(counts == 1) & ~is_late]
    if single.size > 1:
        square_sum += float(single.var(ddof=1)) * (single.size - 1)
        freedom += single.size - 1.0
    variance = square_sum / freedom if freedom else 1.0
    return _CellSummary(
        shift_count=float(counts[~is_late].sum()),
        mean=float(np.average(times[~is_late], weights=counts[~is_late])),
        variance=max(variance, MIN_SD_S**2),
        freedom=freedom,
        late_count=float(is_late.sum()),
        hides_late=float(hides_late),
    )


class SingleSeries(NamedTuple):
    """Timely single shifts of one operating point, (k,) each."""

    times: Array  #: without drift, s
    places: Array  #: in the series of all shifts


def single_series(bench: Bench, model: Model, drift: Drift | None) -> Iterator[SingleSeries]:
    """Yield the single shifts of each operating point that has some, where their order is known."""
    if drift is None:
        return
    delays = model.baseline.min_late_delay.tolist()
    for cell, min_delay, places in zip(bench.cells, delays, drift.places, strict=True):
        readings = [reading for reading in cell.readings if reading.time is not None]
        if not readings:
            continue
        times, counts, is_late = _read_times(readings, min_delay)
        is_single = (counts == 1) & ~is_late
        if is_single.sum() >= MIN_SINGLE_SHIFTS:
            single_times = times[is_single] * (1.0 - drift.mean * places[is_single])
            yield SingleSeries(single_times, places[is_single])


def _read_times(readings: Sequence[Reading], min_delay: float) -> _Times:
    """Read times, numbers of shifts and visible late shifts of readings that have a time."""
    times = np.array([reading.time for reading in readings], dtype=float)
    counts = np.array([reading.n for reading in readings], dtype=float)
    is_single = counts == 1
    is_late = np.zeros(len(readings), dtype=bool)
    if is_single.sum() >= MIN_SINGLE_SHIFTS:
        is_late[is_single] = mark_late(times[is_single][None], np.array([min_delay]))[0]
    return _Times(times, counts, is_late)


def estimate_drift(cells: Sequence[Cell], min_late_delay: Array, prior_sd: float) -> Drift | None:
    """Estimate the drift over the series; None where the order of the shifts is not known.

    ``min_late_delay`` of a late shift behind the median is in s, (C,); ``prior_sd`` of the drift
    is a share of the mean time.
    """
    rows = [[r for r in cell.readings if r.time is not None] for cell in cells]
    readings = list(itertools.chain.from_iterable(rows))
    order = [reading.place for reading in readings if reading.place is not None]
    if len(order) < len(readings) or len(set(order)) < 2:
        return None
    series = (np.array(order) - min(order)) / (max(order) - min(order))
    series = series - np.average(series, weights=[reading.n for reading in readings])
    places = tuple(np.split(series, np.cumsum([len(row) for row in rows])[:-1]))
    residuals = []
    centres = np.zeros(len(cells))
    means = np.zeros(len(cells))
    for k, (row, min_delay) in enumerate(zip(rows, min_late_delay.tolist(), strict=True)):
        if not row:
            continue
        times, counts, is_late = _read_times(row, min_delay)
        weights = counts[~is_late]
        timely_places = places[k][~is_late]
        means[k] = np.average(times[~is_late], weights=weights)
        centres[k] = np.average(timely_places, weights=weights)
        relative_times = times[~is_late] / means[k] - 1.0
        residuals.append((weights, timely_places - centres[k], relative_times))
    mean, variance = _regress(residuals, prior_sd)
    sd = float(np.sqrt(variance))
    informed = 1.0 - variance / prior_sd**2
    return Drift(mean, sd, offsets=sd * means * centres, informed=informed, places=places)


def _regress(
    residuals: Sequence[tuple[Array, Array, Array]], prior_sd: float
) -> tuple[float, float]:
    """Regress relative times on places in the series: posterior mean and variance of the slope.

    ``residuals`` are weights, places and times of each operating point, less their means.
    """
    weights, places, times = (np.concatenate(part) for part in zip(*residuals, strict=True))
    freedom = weights.size - len(residuals)
    square_sum = float((weights * places**2).sum())
    if freedom < 2.0 or square_sum == 0.0:
        return 0.0, prior_sd**2
    product_sum = float((weights * places * times).sum())
    residual_sum = float((weights * times**2).sum()) - product_sum**2 / square_sum
    scatter = max(residual_sum, 1e-12) / (freedom - 1.0)
    # The 90 % interval of the slope is that of Student's distribution.
    student_quantile = student.ppf(UPPER_PROBABILITY, freedom - 1.0)
    scatter *= float(student_quantile / norm.ppf(UPPER_PROBABILITY)) ** 2
    information = prior_sd**-2.0 + square_sum / scatter
    return product_sum / scatter / information, 1.0 / information
