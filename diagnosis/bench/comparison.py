"""Simulation against a bench data set, operating point by operating point.

If the data set gives its relative angles, the simulation uses the same angles. The standard error
is then that of a mean of as many random angles. Otherwise the angles are evenly spaced, and the
error adds that of the bench's mean and that of the simulated mean. The former has the simulated
spread, or that of the readings where it is larger: few angles may miss a long tail. Stated errors
of nominal force and mismatch join it (*u_input* of ASME V&V 20, ``diagnosis.bench.comparison``).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from dogshape.diagnosis.bench.bench_data import Bench, Cell
from dogshape.diagnosis.bench.stand_file import NominalErrors, Tolerance
from dogshape.diagnosis.terms import Array
from dogshape.sim.shift.actuation import ForceProfile
from dogshape.sim.shift.clutch import Clutch, OperatingPoint
from dogshape.sim.statistics.blocks import Block, even_blocks
from dogshape.sim.statistics.expectation import PointExpectation, expect_point
from dogshape.sim.statistics.numerical_error import Runner, numerical_error
from dogshape.sim.statistics.shift_records import Record, result_of
from dogshape.sim.units import RPM

LEAST = 3  #: single readings that say something of their scatter
ANGLES = 16  #: evenly spaced angles where neither data set nor caller says any


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
    differences = tuple(_with_input_errors(bench, found))
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


def _with_input_errors(bench: Bench, found: list[Difference]) -> list[Difference]:
    """Add the errors of nominal values to those of the gaps, where any are stated."""
    inputs = inputs_of(bench)
    if inputs is None:
        return found
    means = np.array([np.nan if one.mean is None else one.mean for one in found])
    errors = np.nan_to_num(inputs.u_input(means)).tolist()
    return [
        replace(one, standard_error=math.hypot(one.standard_error, error))
        for one, error in zip(found, errors, strict=True)
    ]


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


STEP = 0.01  #: of ln force
ALIKE = 0.02  #: of a value, up to which two are alike
APART = {"flight": 0.03, "mismatch": 0.1}  #: of ln flight and ln mismatch, the least difference
ONE_FORCE = (
    "Where a mismatch has one force only, an error of the force is propagated by the free flight "
    "alone."
)
ONE_MISMATCH = "Where a force has one mismatch only, an error of the mismatch is not propagated."


@dataclass(frozen=True)
class Propagated:
    """Errors of nominal values in the mean times, root mean square over the cells, s."""

    systematic: float
    each_point: float
    lacking: tuple[str, ...]

    @property
    def whole(self) -> float:
        """Both together: *u_input*, s."""
        return float(np.hypot(self.systematic, self.each_point))

    @property
    def sentence(self) -> str:
        """The errors in words."""
        parts = [
            f"{1e3 * size:.2g} ms {kind}"
            for size, kind in (
                (self.systematic, "at all operating points alike"),
                (self.each_point, "at each operating point anew"),
            )
            if size > 0.0
        ]
        made = " and ".join(parts) or "nothing"
        said = f"The stated errors of nominal force and mismatch make {made} (root mean square)."
        return " ".join([said, *self.lacking])

    def as_dict(self) -> dict[str, Any]:
        """Write the record ``nominal_errors``."""
        return {
            "systematic_rms_s": self.systematic,
            "each_point_rms_s": self.each_point,
            "u_input_rms_s": self.whole,
            "sentence": self.sentence,
        }


@dataclass(frozen=True)
class Sensitivity:
    """Change of the mean times with nominal values, (cells,) each.

    ``force`` is s for ln force, ``mismatch`` s for rad/s. ``lacking`` has sentences on what the
    data set does not show.
    """

    force: Array
    mismatch: Array
    lacking: tuple[str, ...] = ()


@dataclass(frozen=True)
class NominalInputs:
    """Nominal values of a data set with their errors, each (cells,).

    ``mismatch`` in rad/s, ``force`` in N, ``rise`` in s; ``flight`` is the time of the free flight,
    s, ``flight_slope`` its change with ln force, s.
    """

    errors: NominalErrors
    mismatch: Array
    force: Array
    rise: Array
    flight: Array
    flight_slope: Array

    def sensitivity(self, baseline: Array) -> Sensitivity:
        """Differentiate mean times without effect, s, (cells,), NaN where there are none."""
        slow = abs(self.mismatch) + RPM
        by_flight, alone = _slopes(
            baseline, self.flight, [self.mismatch], APART["flight"] * self.flight
        )
        by_flight = np.where(alone, 1.0, by_flight)
        lacking = [ONE_FORCE] if alone.any() and self._stated("force") else []
        sides = np.sign(self.mismatch)
        least = np.full(slow.size, APART["mismatch"])
        by_mismatch, alone = _slopes(baseline, np.log(slow), [self.force, self.rise, sides], least)
        lacking += [ONE_MISMATCH] if alone.any() and self._stated("mismatch") else []
        return Sensitivity(
            self.flight_slope * by_flight,
            sides * by_mismatch / slow,
            tuple(lacking),
        )

    def _stated(self, quantity: str) -> bool:
        """Test that an error of a quantity is stated."""
        kinds = self.errors.systematic, self.errors.each_point
        return any(getattr(k, quantity) or getattr(k, f"{quantity}_share") for k in kinds)

    def systematic(self, baseline: Array) -> Array:
        """Return the offsets that one deviation of each systematic error makes, s, (cells, q)."""
        return self._columns(self.errors.systematic, baseline)

    def propagated(self, baseline: Array) -> Propagated:
        """Summarise the errors over the cells whose mean time is known, s."""
        there = np.isfinite(baseline)
        squares = (
            (self.systematic(baseline)[there] ** 2).sum(axis=1),
            self.each_point(baseline)[there] ** 2,
        )
        sizes = [float(np.sqrt(one.mean())) if there.any() else 0.0 for one in squares]
        return Propagated(sizes[0], sizes[1], self.sensitivity(baseline).lacking)

    def u_input(self, baseline: Array) -> Array:
        """Return the standard deviation of each mean by all errors together, s, (cells,)."""
        whole: Array = np.hypot(
            self.each_point(baseline), np.sqrt((self.systematic(baseline) ** 2).sum(axis=1))
        )
        return whole

    def each_point(self, baseline: Array) -> Array:
        """Return the standard deviation of a cell's mean by errors of its setting, s, (cells,)."""
        columns = self._columns(self.errors.each_point, baseline)
        whole: Array = np.sqrt((columns**2).sum(axis=1))
        return whole

    def _columns(self, size: Tolerance, baseline: Array) -> Array:
        """Return the offsets of one deviation of each error, s, (cells, q)."""
        slope = self.sensitivity(baseline)
        every = (
            slope.force * size.force_share,
            slope.force * size.force / self.force,
            slope.mismatch * size.mismatch_share * self.mismatch,
            slope.mismatch * size.mismatch,
        )
        found = [column for column in every if column.any()]
        return np.stack(found, axis=1) if found else np.zeros((self.force.size, 0))


def inputs_of(bench: Bench) -> NominalInputs | None:
    """Return the nominal values of a data set that states errors of them, None else."""
    if not bench.errors:
        return None
    points = [cell.point for cell in bench.cells]
    flights = np.array(
        [[_flight(bench.clutch, p, by) for by in (0.0, -STEP, STEP)] for p in points]
    )
    return NominalInputs(
        bench.errors,
        np.array([point.mismatch for point in points]),
        np.array([point.profile.force for point in points]),
        np.array([point.profile.rise for point in points]),
        flights[:, 0],
        (flights[:, 2] - flights[:, 1]) / (2.0 * STEP),
    )


def _flight(clutch: Clutch, point: OperatingPoint, by: float) -> float:
    """Return the free flight's time in s with a force whose logarithm is changed."""
    profile = ForceProfile(point.profile.force * float(np.exp(by)), point.profile.rise)
    return profile.free_flight_time(clutch.shift_travel, clutch.rings.mass)


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
