"""Observations of a bench at its operating points, as the likelihood reads them."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any, Self

import numpy as np

from dogshape.diagnosis.bench.bench_data import Bench
from dogshape.diagnosis.bench.flight_marks import SeenFlight, flights_of
from dogshape.diagnosis.bench.input_errors import NominalInputs, inputs_of
from dogshape.diagnosis.bench.reading import Cell
from dogshape.diagnosis.likelihood.drift import Drift, drift_of
from dogshape.diagnosis.prediction.outliers import MOST, bulk
from dogshape.diagnosis.settings import USUAL, Rules
from dogshape.diagnosis.terms import Array
from dogshape.sim.shift.clutch import Clutch

LEAST = 0.5e-3  #: s, the least spread of single shifts
ROUNDING = 1e-9  # of numbers of shifts


@dataclass(frozen=True)
class Observed:
    """Observations at the operating points of a bench, each (cells,); times in s.

    Parameters
    ----------
    singles : times of single shifts, cell by cell, (k,) each.
    outlier_times : outliers among them (``diagnosis.prediction.outliers``), likewise.
    mean, n : grand mean of all other shifts with a time, alone or within means, and their number;
        outliers can hide within means and among few single shifts.
    log_sd, freedom : logarithm of the standard deviation of the single shifts without outliers,
        pooled with those that come beside means, and its degrees of freedom; 0 for both where
        nothing says it.
    beside : degrees of freedom of those beside means, in which outliers can hide.
    engaged, failed, unknown : shifts counted.
    wait : from slot to slot, s.
    mismatch, force : rad/s and N.
    timeout : s.
    flights : marks of the traces, one for each force profile that has any.
    drift : trend over the series, where the order of the shifts is known; what repeated operating
        points say of it is taken off all times.
    inputs : nominal values with their errors, where the data set states any.
    """

    singles: tuple[Array, ...]
    outlier_times: tuple[Array, ...]
    mean: Array
    n: Array
    log_sd: Array
    freedom: Array
    beside: Array
    engaged: Array
    failed: Array
    unknown: Array
    wait: Array
    mismatch: Array
    force: Array
    timeout: float
    flights: tuple[SeenFlight, ...] = ()
    drift: Drift | None = None
    inputs: NominalInputs | None = None

    @cached_property
    def undivided(self) -> Self:
        """The same with outliers among single shifts counted with the others.

        Only of cells that have single shifts alone: else it is the same.
        """
        every = {name: getattr(self, name).copy() for name in ("mean", "n", "log_sd", "freedom")}
        found = [*self.outlier_times]
        for place in np.flatnonzero(self.divided):
            times = self.singles[place]
            found[place] = times[:0]
            every["mean"][place], every["n"][place] = times.mean(), times.size
            every["freedom"][place] = times.size - 1.0
            every["log_sd"][place] = np.log(max(LEAST, times.std(ddof=1)))
        return replace(self, **every, outlier_times=tuple(found))

    @cached_property
    def divided(self) -> np.ndarray:
        """Mark the cells with outliers among single shifts and no other readings, (cells,)."""
        apart = np.array([times.size for times in self.outlier_times])
        return (apart > 0) & (self.n + apart == self.single) & (self.beside == 0)

    def of(self, cells: np.ndarray) -> Self:
        """Select some cells, (cells,) true or false; the marks of flights stay."""
        every = {f.name: getattr(self, f.name) for f in fields(self)}
        some: dict[str, Any] = {n: a[cells] for n, a in every.items() if isinstance(a, np.ndarray)}
        for name in ("singles", "outlier_times"):
            some[name] = tuple(a for a, there in zip(every[name], cells, strict=True) if there)
        return replace(self, **some)

    @property
    def cells(self) -> int:
        """Number of cells."""
        return len(self.singles)

    @property
    def single(self) -> Array:
        """Number of single shifts with a time, (cells,)."""
        return np.array([times.size for times in self.singles], dtype=float)

    @property
    def shifts(self) -> Array:
        """Number of shifts with a time, alone or within a mean, (cells,)."""
        return self.n + np.array([times.size for times in self.outlier_times])

    @property
    def tried(self) -> Array:
        """Number of shifts known to have been tried, (cells,)."""
        return self.engaged + self.failed

    @property
    def in_means(self) -> Array:
        """Number of shifts of which only a mean is known, (cells,)."""
        alone = self.freedom - self.beside
        own = np.where(alone > 0, alone + 1.0, 0.0)
        return np.maximum(0.0, self.n - own)

    def hides(self, waits: Array) -> np.ndarray:
        """Mark the further numbers of outliers that can go unseen, (cells, 1, parts).

        Any may within means. Of single shifts those behind a quantile of theirs are found, unless
        so many are outliers that it lies among them (``diagnosis.prediction.outliers``).
        """
        found = np.array([times.size for times in self.outlier_times])[:, None, None]
        # Of six shifts one is found, for all that rounding says of a fifth of five.
        many = waits + found > (1.0 - MOST) * (self.shifts[:, None, None] - 1.0) + ROUNDING
        return (waits == 0.0) | many | (self.in_means > 0)[:, None, None]

    @property
    def time(self) -> Array:
        """Mean time of all shifts that have one, s, (cells,); NaN for none."""
        whole = np.array([times.sum() for times in self.outlier_times]) + self.n * self.mean
        return np.where(self.shifts > 0, whole / np.maximum(1, self.shifts), np.nan)


def observe(bench: Bench, rules: Rules = USUAL.likelihood) -> Observed:
    """Gather the observations of a data set; ``rules`` have the size that a drift may have."""
    drift = drift_of(bench.cells, rules)
    if drift is not None:
        bench = replace(bench, cells=drift.taken_off(bench.cells))
    split = [_split(cell) for cell in bench.cells]
    waits = [_wait(cell, bench.clutch) for cell in bench.cells]
    counts = [(cell.engaged, cell.failed, cell.unknown) for cell in bench.cells]
    mean, n, log_sd, freedom, beside = np.array([one for _, one in split]).reshape(-1, 5).T
    engaged, failed, unknown = np.array(counts, dtype=float).reshape(-1, 3).T
    return Observed(
        singles=tuple(cell.times for cell in bench.cells),
        outlier_times=tuple(times for times, _ in split),
        mean=mean,
        n=n,
        log_sd=log_sd,
        freedom=freedom,
        beside=beside,
        engaged=engaged,
        failed=failed,
        unknown=unknown,
        wait=np.array(waits),
        mismatch=np.array([cell.point.mismatch for cell in bench.cells]),
        force=np.array([cell.point.profile.force for cell in bench.cells]),
        timeout=bench.clutch.timeout,
        flights=flights_of(bench),
        drift=drift,
        inputs=inputs_of(bench),
    )


def _split(cell: Cell) -> tuple[Array, tuple[float, float, float, float, float]]:
    """Split the outliers of a cell from the other shifts.

    Of these it gives mean, number, log sd, its freedom, and the part of that from beside means.
    """
    means = [(r.time, r.n) for r in cell.readings if r.time is not None and r.n > 1]
    hidden = sum(n for _, n in means)
    times = cell.times
    core = bulk(times) if times.size else times
    timely = times[np.isfinite(core)]
    n = hidden + timely.size
    mean = (sum(t * k for t, k in means) + float(timely.sum())) / max(1, n)
    freedom = max(0, timely.size - 1)
    spread = max(LEAST, float(timely.std(ddof=1))) if freedom else 1.0
    told = [(r.sd, r.n - 1) for r in cell.readings if r.sd is not None]
    beside = sum(count for _, count in told)
    if beside:
        squares = freedom * spread**2 + sum(count * sd**2 for sd, count in told)
        spread = max(LEAST, float(np.sqrt(squares / (freedom + beside))))
    return times[np.isnan(core)], (mean, n, float(np.log(spread)), freedom + beside, beside)


def _wait(cell: Cell, clutch: Clutch) -> float:
    slip = abs(cell.point.mismatch)
    return min(clutch.timeout, clutch.dog.pitch_angle / slip) if slip else clutch.timeout
