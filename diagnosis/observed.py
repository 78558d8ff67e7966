"""What a bench shows at its operating points, as the likelihood reads it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from diagnosis.bench import Bench
from diagnosis.marks import SeenFlight, flights_of
from diagnosis.reading import Cell
from diagnosis.spread import Array
from sim.clutch import Clutch


@dataclass(frozen=True)
class Observed:
    """What a bench has at its operating points, each (cells,); times in s.

    Parameters
    ----------
    singles : times of single shifts, cell by cell, (k,) each.
    mean, n : grand mean of the shifts that are only known as means, and their number.
    engaged, failed, unknown : shifts counted.
    wait : from slot to slot, s.
    mismatch : rad/s.
    timeout : s.
    flights : marks of the traces, one for each force profile that has any.
    """

    singles: tuple[Array, ...]
    mean: Array
    n: Array
    engaged: Array
    failed: Array
    unknown: Array
    wait: Array
    mismatch: Array
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
        whole: Array = self.single + self.n
        return whole

    @property
    def tried(self) -> Array:
        """Number of shifts known to have been tried, (cells,)."""
        return self.engaged + self.failed

    @property
    def time(self) -> Array:
        """Mean time of all shifts that have one, s, (cells,); NaN for none."""
        whole = np.array([times.sum() for times in self.singles]) + self.n * self.mean
        return np.where(self.shifts > 0, whole / np.maximum(1, self.shifts), np.nan)


def observe(bench: Bench) -> Observed:
    """Return what a data set has."""
    means = [_grand_mean(cell) for cell in bench.cells]
    waits = [_wait(cell, bench.clutch) for cell in bench.cells]
    counts = [(cell.engaged, cell.failed, cell.unknown) for cell in bench.cells]
    mean, n = np.array(means, dtype=float).reshape(-1, 2).T
    engaged, failed, unknown = np.array(counts, dtype=float).reshape(-1, 3).T
    singles = tuple(cell.times for cell in bench.cells)
    counted = engaged, failed, unknown
    slips = np.array([cell.point.mismatch for cell in bench.cells])
    times = np.array(waits), slips, bench.clutch.timeout
    return Observed(singles, mean, n, *counted, *times, flights_of(bench))


def _grand_mean(cell: Cell) -> tuple[float, int]:
    means = [(r.time, r.n) for r in cell.readings if r.time is not None and r.n > 1]
    count = sum(n for _, n in means)
    return sum(t * n for t, n in means) / max(1, count), count


def _wait(cell: Cell, clutch: Clutch) -> float:
    slip = abs(cell.point.mismatch)
    return min(clutch.timeout, clutch.dog.pitch_angle / slip) if slip else clutch.timeout
