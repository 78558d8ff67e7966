"""Observations of a bench at its operating points, as the likelihood reads them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dogshape.diagnosis.bench.bench_data import Bench
from dogshape.diagnosis.bench.flight_marks import SeenFlight, flights_of
from dogshape.diagnosis.bench.reading import Cell
from dogshape.diagnosis.prediction.outliers import MOST, bulk
from dogshape.diagnosis.terms import Array
from dogshape.sim.shift.clutch import Clutch

LEAST = 0.5e-3  #: s, the least spread of single shifts


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
        and its degrees of freedom; 0 for both where there are fewer than two.
    engaged, failed, unknown : shifts counted.
    wait : from slot to slot, s.
    mismatch, force : rad/s and N.
    timeout : s.
    flights : marks of the traces, one for each force profile that has any.
    """

    singles: tuple[Array, ...]
    outlier_times: tuple[Array, ...]
    mean: Array
    n: Array
    log_sd: Array
    freedom: Array
    engaged: Array
    failed: Array
    unknown: Array
    wait: Array
    mismatch: Array
    force: Array
    timeout: float
    flights: tuple[SeenFlight, ...] = ()

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
        own = np.where(self.freedom > 0, self.freedom + 1.0, 0.0)
        return np.maximum(0.0, self.n - own)

    def hides(self, waits: Array) -> np.ndarray:
        """Mark the further numbers of outliers that can go unseen, (cells, 1, parts).

        Any may within means. Of single shifts those behind a quantile of theirs are found, unless
        so many are outliers that it lies among them (``diagnosis.prediction.outliers``).
        """
        found = np.array([times.size for times in self.outlier_times])[:, None, None]
        many = waits + found > (1.0 - MOST) * (self.shifts[:, None, None] - 1.0)
        return (waits == 0.0) | many | (self.in_means > 0)[:, None, None]

    @property
    def time(self) -> Array:
        """Mean time of all shifts that have one, s, (cells,); NaN for none."""
        whole = np.array([times.sum() for times in self.outlier_times]) + self.n * self.mean
        return np.where(self.shifts > 0, whole / np.maximum(1, self.shifts), np.nan)


def observe(bench: Bench) -> Observed:
    """Gather the observations of a data set."""
    split = [_split(cell) for cell in bench.cells]
    waits = [_wait(cell, bench.clutch) for cell in bench.cells]
    counts = [(cell.engaged, cell.failed, cell.unknown) for cell in bench.cells]
    mean, n, log_sd, freedom = np.array([one for _, one in split]).reshape(-1, 4).T
    engaged, failed, unknown = np.array(counts, dtype=float).reshape(-1, 3).T
    return Observed(
        singles=tuple(cell.times for cell in bench.cells),
        outlier_times=tuple(times for times, _ in split),
        mean=mean,
        n=n,
        log_sd=log_sd,
        freedom=freedom,
        engaged=engaged,
        failed=failed,
        unknown=unknown,
        wait=np.array(waits),
        mismatch=np.array([cell.point.mismatch for cell in bench.cells]),
        force=np.array([cell.point.profile.force for cell in bench.cells]),
        timeout=bench.clutch.timeout,
        flights=flights_of(bench),
    )


def _split(cell: Cell) -> tuple[Array, tuple[float, float, float, float]]:
    """Split the outliers of a cell from mean, number, log sd and freedom of the other shifts."""
    means = [(r.time, r.n) for r in cell.readings if r.time is not None and r.n > 1]
    hidden = sum(n for _, n in means)
    times = cell.times
    core = bulk(times) if times.size else times
    timely = times[np.isfinite(core)]
    n = hidden + timely.size
    mean = (sum(t * k for t, k in means) + float(timely.sum())) / max(1, n)
    freedom = max(0, timely.size - 1)
    spread = max(LEAST, float(timely.std(ddof=1))) if freedom else 1.0
    return times[np.isnan(core)], (mean, n, float(np.log(spread)), freedom)


def _wait(cell: Cell, clutch: Clutch) -> float:
    slip = abs(cell.point.mismatch)
    return min(clutch.timeout, clutch.dog.pitch_angle / slip) if slip else clutch.timeout
