r"""Simulation against a bench data set, operating point by operating point.

If the data set gives its relative angles, the simulation uses the same angles. The standard error
is then that of a mean of as many random angles. Otherwise the angles are evenly spaced, and the
error adds that of the bench's mean and that of the simulated mean. The former has the simulated
spread, or that of the readings where it is larger: few angles may miss a long tail.

Stated errors of nominal force and mismatch join it, *u_input* of ASME V&V 20: the derivatives of
the simulated mean, by shifts at ``STEP`` to either side, times the errors.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from dogshape.bench.bench_data import Bench, Cell
from dogshape.sim.statistics.blocks import Block, Runner, even_blocks, numerical_error
from dogshape.sim.statistics.expectation import NumericalError, expect_point
from dogshape.sim.statistics.shift_records import result_of

MIN_READINGS = 3  #: single readings that say something of their scatter
ANGLES = 16  #: evenly spaced angles where neither data set nor caller says any
#: Of force and mismatch: the errors of means over few angles would hide the change by less.
STEP = 0.15


@dataclass(frozen=True)
class PointGap:
    """Gap of the mean shift time at an operating point, bench less simulation.

    ``mean`` is the simulated one, s, None where no shift engaged; ``standard_error`` that of the
    gap, s; ``engaged`` and ``n`` the share and number of simulated shifts that did.
    """

    cell: Cell
    mean: float | None
    standard_error: float
    engaged: float = np.nan
    n: int = 0

    @property
    def gap(self) -> float | None:
        """Bench less simulation, s; None where one of them has no time."""
        if self.cell.time is None or self.mean is None:
            return None
        return self.cell.time - self.mean

    @property
    def z(self) -> float | None:
        """Gap in standard errors."""
        return None if self.gap is None else self.gap / self.standard_error


@dataclass(frozen=True)
class PointGaps:
    """All operating points of a data set, and the numerical error of their mean, if known."""

    bench: Bench
    differences: tuple[PointGap, ...]
    numerical_error: NumericalError | None = None

    @property
    def rmse(self) -> float | None:
        """Root-mean-square gap over the cells that have a bench time, s; None without any."""
        return _rms([d.gap for d in self.differences if d.gap is not None])

    @property
    def relative_rms(self) -> float | None:
        """Root-mean-square of simulation over bench less one; None without a gap."""
        gaps = [(d.gap, d.cell.time) for d in self.differences]
        return _rms([-gap / time for gap, time in gaps if gap is not None and time])

    @property
    def engaged(self) -> tuple[int, int, float]:
        """Bench shifts that engaged, of how many tried, and the simulated share at their points."""
        attempts = sum(d.cell.tried for d in self.differences)
        expected = sum(d.cell.tried * d.engaged for d in self.differences)
        return sum(d.cell.engaged for d in self.differences), attempts, expected / max(1, attempts)


def _rms(values: list[float]) -> float | None:
    return math.sqrt(sum(v * v for v in values) / len(values)) if values else None


def compare(
    bench: Bench,
    run: Runner,
    angles: int | tuple[float, ...] | None = None,
    *,
    checked: bool = False,
) -> PointGaps:
    """Simulate every operating point of a data set.

    ``angles`` are relative angles in rad, or how many evenly spaced ones; by default those of the
    data set, or sixteen. ``checked`` asks for the numerical error, by an eighth of the shifts
    again.
    """
    relative_angles = angles or bench.relative_angles or ANGLES
    even, points = isinstance(relative_angles, int), [cell.point for cell in bench.cells]
    blocks = even_blocks(bench.clutch, points, relative_angles, seed=1)
    rows = run(blocks)
    added = _input_errors(bench, blocks, run) if bench.errors else [0.0] * len(blocks)
    gaps = []
    for cell, records, input_error in zip(bench.cells, rows, added, strict=True):
        results = [result_of(record) for record in records]
        simulated = expect_point(cell.point, results, bench.clutch.timeout, 0.0, even=even)
        error = simulated.sd / math.sqrt(max(1, simulated.n))
        if even:
            sampled = max(simulated.sd, _scatter(cell)) / math.sqrt(max(1, cell.n))
            share, cost = simulated.first_try_share or 1.0, bench.clutch.timeout
            retry_error = cost / share**2 * math.sqrt(share * (1.0 - share) / simulated.n)
            error = math.hypot(simulated.engaged_error, retry_error, sampled)
        error = math.hypot(max(error, 1e-6), input_error)
        gaps.append(PointGap(cell, simulated.unaided_mean, error, simulated.engaged, simulated.n))
    return PointGaps(bench, tuple(gaps), numerical_error(blocks, rows, run) if checked else None)


def _scatter(cell: Cell) -> float:
    """Compute the standard deviation of readings, s; 0 for too few readings.

    That of single ones is pooled with those that come beside means.
    """
    times = cell.times
    spreads = [(r.n - 1.0, r.sd**2) for r in cell.readings if r.sd is not None]
    if len(times) >= MIN_READINGS:
        spreads.append((len(times) - 1.0, float(times.var(ddof=1))))
    freedom, variance = np.reshape(spreads, (-1, 2)).T
    enough = freedom.sum() >= MIN_READINGS - 1.0
    return float(np.sqrt(np.average(variance, weights=freedom))) if enough else 0.0


def _input_errors(bench: Bench, blocks: Sequence[Block], run: Runner) -> list[float]:
    """Propagate stated errors of nominal force and mismatch to the simulated means, s."""
    squares = np.zeros(len(blocks))
    points = [block.point for block in blocks]
    kinds = bench.errors.systematic, bench.errors.each_point
    sizes = np.square([kind.sizes for kind in kinds]).sum(axis=0)
    for name, (share, size) in (("force", sizes[:2]), ("mismatch", sizes[2:])):
        values = np.array([p.profile.force if name == "force" else p.mismatch for p in points])
        relative = share + size / np.maximum(abs(values), 1e-9) ** 2
        if not relative.any():
            continue
        ends = []
        for by in (1.0 - STEP, 1.0 + STEP):
            moved_blocks = [
                replace(
                    block,
                    point=replace(p, profile=replace(p.profile, force=by * value))
                    if name == "force"
                    else replace(p, mismatch=by * value),
                )
                for block, p, value in zip(blocks, points, values.tolist(), strict=True)
            ]
            means: list[float] = []
            for rows in run(moved_blocks):
                results = [result_of(row).shift_time for row in rows]
                times = [time for time in results if time is not None]
                means.append(sum(times) / len(times) if times else np.nan)
            ends.append(means)
        low_means, high_means = np.array(ends)  # s, by the logarithm of the quantity
        squares += ((high_means - low_means) / (2.0 * STEP)) ** 2 * relative
    return list(np.sqrt(np.nan_to_num(squares)).tolist())
