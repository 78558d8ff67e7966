r"""Simulation against a bench data set, operating point by operating point.

If the data set gives its relative angles, the simulation uses the same angles. The standard error
is then that of a mean of as many random angles. Otherwise the angles are evenly spaced, and the
error adds that of the bench's mean and that of the simulated mean. The former has the simulated
spread, or that of the readings where it is larger: few angles may miss a long tail.

Stated errors of nominal force and mismatch join it: *u_input* of ASME V&V 20. The mean time at an
operating point changes with force and mismatch by

.. math:: \frac{\partial T}{\partial \ln F} = \frac{\partial t_0}{\partial \ln F}
          \frac{\Delta T}{\Delta t_0}, \qquad
          \frac{\partial T}{\partial n} = \frac{1}{|n| + n_1}
          \frac{\Delta T}{\Delta \ln(|n| + n_1)},

with :math:`t_0` the free flight, whose derivative at the same rise time has a closed form, and
differences between neighbours of the data set (:math:`n_1` is 1/min). Along its grid the rise time
mostly changes with the force, which an error of the force does not; the free flight has both in it.
Neighbours are some way apart, and points within ``ALIKE`` are alike: simulated means err by their
angles, of which a small step would make a large slope. Where a mismatch has one force only, the
free flight alone counts; where a force has one mismatch only, its error is not propagated.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from dogshape.diagnosis.bench.bench_data import Bench, Cell
from dogshape.diagnosis.terms import Array
from dogshape.sim.statistics.blocks import Block, even_blocks
from dogshape.sim.statistics.expectation import PointExpectation, expect_point
from dogshape.sim.statistics.numerical_error import Runner, numerical_error
from dogshape.sim.statistics.shift_records import Record, result_of
from dogshape.sim.units import RPM

LEAST = 3  #: single readings that say something of their scatter
ANGLES = 16  #: evenly spaced angles where neither data set nor caller says any
STEP = 0.01  #: of ln force
ALIKE = 0.02  #: of a value, up to which two are alike
APART = {"flight": 0.03, "mismatch": 0.1}  #: of ln flight and ln mismatch, the least difference


@dataclass(frozen=True)
class PointGap:
    """Gap of the mean shift time at an operating point, bench less simulation.

    ``mean`` is the simulated one, s, None where no shift engaged; ``standard_error`` that of the
    gap, s.
    """

    cell: Cell
    mean: float | None
    standard_error: float

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
class Difference(PointGap):
    """Gap at an operating point with the expectation that was simulated for it."""

    simulated: PointExpectation


@dataclass(frozen=True)
class Comparison:
    """All operating points of a data set.

    ``numerical_error`` in s is that of the mean over all of them, None if not asked for.
    """

    bench: Bench
    differences: tuple[Difference, ...]
    numerical_error: float | None = None

    @property
    def rmse(self) -> float | None:
        """Root-mean-square gap over the cells that have a bench time, s; None without any."""
        return _rms([d.gap for d in self.differences if d.gap is not None])

    @property
    def relative_rms(self) -> float | None:
        """Root-mean-square of simulation over bench less one; None without a gap."""
        ratios = [
            -d.gap / d.cell.time
            for d in self.differences
            if d.gap is not None and d.cell.time is not None
        ]
        return _rms(ratios)

    @property
    def engaged(self) -> tuple[int, int, float]:
        """Bench shifts that engaged, of how many tried, and the simulated share at their points."""
        cells = [(d.cell, d.simulated) for d in self.differences if d.cell.tried]
        tried = sum(cell.tried for cell, _ in cells)
        expected = sum(cell.tried * simulated.engaged for cell, simulated in cells)
        return sum(cell.engaged for cell, _ in cells), tried, expected / max(1, tried)


def _rms(values: list[float]) -> float | None:
    return math.sqrt(sum(v * v for v in values) / len(values)) if values else None


def compare(
    bench: Bench,
    run: Runner,
    angles: int | tuple[float, ...] | None = None,
    seed: int = 1,
    *,
    checked: bool = False,
) -> Comparison:
    """Simulate every operating point of a data set.

    Parameters
    ----------
    run : simulates blocks of shifts.
    angles : relative angles in rad, or how many evenly spaced ones, at least three;
        by default those of the data set, or sixteen.
    seed : of where the angles begin.
    checked : whether to repeat an eighth of the shifts for the numerical error.
    """
    given = angles if isinstance(angles, tuple) else None
    if angles is None:
        given = bench.relative_angles
    count = angles if isinstance(angles, int) else ANGLES
    points = [cell.point for cell in bench.cells]
    if given is None:
        blocks = even_blocks(bench.clutch, points, count, seed)
    else:
        blocks = [Block(bench.clutch, point, given) for point in points]
    rows = run(blocks)
    pairs = zip(bench.cells, rows, strict=True)
    found = [_difference(bench, c, r, given is None) for c, r in pairs]
    if bench.errors:
        means = np.array([np.nan if one.mean is None else one.mean for one in found])
        added = np.nan_to_num(input_errors(bench, means)).tolist()
        found = [
            replace(one, standard_error=math.hypot(one.standard_error, error))
            for one, error in zip(found, added, strict=True)
        ]
    differences = tuple(found)
    error = numerical_error(blocks, rows, run) if checked else None
    return Comparison(bench, differences, error)


def _difference(bench: Bench, cell: Cell, rows: list[Record], even: bool) -> Difference:
    results = [result_of(row) for row in rows]
    simulated = expect_point(cell.point, results, bench.clutch.timeout, 0.0, even=even)
    error = simulated.sd / math.sqrt(max(1, simulated.n))
    if even:
        sampled = max(simulated.sd, _scatter(cell)) / math.sqrt(max(1, cell.n))
        error = math.hypot(simulated.standard_error, sampled)
    return Difference(cell, simulated.mean_engaged, max(error, 1e-6), simulated)


def _scatter(cell: Cell) -> float:
    """Return the standard deviation of readings, s; 0 where too few say it.

    That of single ones is pooled with those that come beside means.
    """
    times = cell.times
    told = [(r.n - 1.0, r.sd**2) for r in cell.readings if r.sd is not None]
    if len(times) >= LEAST:
        told.append((len(times) - 1.0, float(times.var(ddof=1))))
    whole = sum(freedom for freedom, _ in told)
    if whole < LEAST - 1.0:
        return 0.0
    return math.sqrt(sum(freedom * variance for freedom, variance in told) / whole)


def sensitivity(bench: Bench, means: Array) -> tuple[Array, Array]:
    """Differentiate mean times without effect, s, (cells,), NaN where there are none.

    Returns their changes with ln force, s, and with the mismatch, s for rad/s, (cells,) each.
    """
    points = [cell.point for cell in bench.cells]
    mismatch = np.array([point.mismatch for point in points])
    force, rise = np.array([(p.profile.force, p.profile.rise) for p in points]).T
    flights = np.array(
        [
            [
                replace(p.profile, force=p.profile.force * float(np.exp(by))).free_flight_time(
                    bench.clutch.shift_travel, bench.clutch.rings.mass
                )
                for by in (0.0, -STEP, STEP)
            ]
            for p in points
        ]
    )
    flight, sides, slow = flights[:, 0], np.sign(mismatch), abs(mismatch) + RPM
    by_flight, alone = _slopes(means, flight, [mismatch], APART["flight"] * flight)
    least = np.full(slow.size, APART["mismatch"])
    by_mismatch, _ = _slopes(means, np.log(slow), [force, rise, sides], least)
    by_force = (flights[:, 2] - flights[:, 1]) / (2.0 * STEP) * np.where(alone, 1.0, by_flight)
    return by_force, sides * by_mismatch / slow


def input_errors(bench: Bench, means: Array) -> Array:
    """Compute the standard deviation of each mean by all stated nominal errors, s, (cells,)."""
    force = np.array([cell.point.profile.force for cell in bench.cells])
    mismatch = np.array([cell.point.mismatch for cell in bench.cells])
    by_force, by_mismatch = sensitivity(bench, means)
    parts = [
        part
        for size in (bench.errors.systematic, bench.errors.each_point)
        for part in (
            by_force * size.force_share,
            by_force * size.force_N / force,
            by_mismatch * size.mismatch_share * mismatch,
            by_mismatch * size.mismatch,
        )
    ]
    whole: Array = np.sqrt(np.sum(np.square(parts), axis=0))
    return whole


def _slopes(
    values: Array, place: Array, alike: Sequence[Array], least: Array
) -> tuple[Array, np.ndarray]:
    """Differentiate values over their places, among cells that are alike in all else, (cells,).

    Places that differ by less than ``least`` from the first of them count as one. The second marks
    cells that have no neighbour; their slope is zero.
    """
    found, alone = np.zeros(values.size), np.zeros(values.size, dtype=bool)
    labels = np.stack([_labels(one) for one in alike], axis=1)
    _, groups = np.unique(labels, axis=0, return_inverse=True)
    for group in np.unique(groups):
        mine = np.flatnonzero((groups.ravel() == group) & np.isfinite(values))
        mine = mine[np.argsort(place[mine], kind="stable")]
        bins = _bins(place[mine], least[mine])
        if not bins.size or bins[-1] == 0:
            alone[mine] = True
            continue
        count = np.bincount(bins)
        means, steps = (np.bincount(bins, one[mine]) / count for one in (values, place))
        found[mine] = np.gradient(means, steps)[bins]
    return found, alone


def _labels(values: Array) -> np.ndarray:
    """Number values so that those within ``ALIKE`` of the least of them have the same, (cells,)."""
    order = np.argsort(values, kind="stable")
    ordered = values[order]
    found = np.empty(values.size, dtype=np.int64)
    found[order] = _bins(ordered, ALIKE * abs(ordered))
    return found


def _bins(ordered: Array, least: Array) -> np.ndarray:
    """Number ascending values so that each bin begins ``least`` above the beginning of the last."""
    found, bins = np.zeros(ordered.size, dtype=np.int64), 0
    begin = 0
    for place in range(1, ordered.size):
        if ordered[place] - ordered[begin] > max(least[begin], 1e-12):
            bins, begin = bins + 1, place
        found[place] = bins
    return found
