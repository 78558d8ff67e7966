"""Readings of a bench, one row of its table each, and cells gathered from them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dogshape.diagnosis.bench.traces import BenchTrace
from dogshape.sim.shift.clutch import OperatingPoint


@dataclass(frozen=True)
class Reading:
    """One row: a shift, or ``n`` shifts at one operating point, 0 where none was made.

    ``time`` is the (mean) shift time in s, None where there is none. ``engaged`` is None
    where the source does not say; a time says that it engaged. ``row`` counts the lines of
    ``shifts.csv`` from 1. ``sd`` is the standard deviation of the ``n`` times of a mean, s.
    ``place`` is that in the series of all shifts, an order or a time in s; None where the source
    does not say.
    """

    row: int
    point: OperatingPoint
    n: int
    time: float | None
    engaged: bool | None
    trace: BenchTrace | None = None
    sd: float | None = None
    place: float | None = None


@dataclass(frozen=True)
class Cell:
    """All readings at one operating point.

    Each of its shifts is one of three: ``engaged``, ``failed`` (tried, not engaged before
    the time-out) and ``unknown``, of which the source does not say whether it was tried.
    """

    point: OperatingPoint
    readings: tuple[Reading, ...]

    @property
    def n(self) -> int:
        """Number of shifts that have a time, alone or within a mean."""
        return sum(r.n for r in self.readings if r.time is not None)

    @property
    def time(self) -> float | None:
        """Mean shift time over these, s, None where there is none."""
        total = self.n
        whole = sum(r.time * r.n for r in self.readings if r.time is not None)
        return whole / total if total else None

    @property
    def times(self) -> NDArray[np.float64]:
        """Times of single shifts, s, (k,); those within means are not among them."""
        single = [r.time for r in self.readings if r.n == 1 and r.time is not None]
        return np.array(single, dtype=float)

    @property
    def engaged(self) -> int:
        """Number of shifts known to have engaged."""
        return sum(r.n for r in self.readings if r.engaged)

    @property
    def failed(self) -> int:
        """Number of shifts that were tried and did not engage."""
        return sum(r.n for r in self.readings if r.engaged is False)

    @property
    def unknown(self) -> int:
        """Number of shifts of which nothing is known: not tried, or not engaged."""
        return sum(r.n for r in self.readings if r.engaged is None)

    @property
    def tried(self) -> int:
        """Number of shifts known to have been tried."""
        return self.engaged + self.failed

    @property
    def traces(self) -> tuple[BenchTrace, ...]:
        """Traces of its shifts."""
        return tuple(r.trace for r in self.readings if r.trace is not None)


def gather(readings: Sequence[Reading]) -> tuple[Cell, ...]:
    """Gather readings by operating point, in the order in which these first appear."""
    found: dict[OperatingPoint, list[Reading]] = {}
    for reading in readings:
        found.setdefault(reading.point, []).append(reading)
    return tuple(Cell(point, tuple(those)) for point, those in found.items())
