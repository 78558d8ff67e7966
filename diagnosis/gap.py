r"""The gap map: bench less simulation at every operating point, and how sure it is.

A gap is the mean of *n* bench shifts less the simulated mean over evenly spaced angles. Its
variance has three parts,

.. math:: v = \frac{\sigma^2}{n} + s^2 + e^2,

the sampling of the bench, that of the simulation and the numerics. The spread
:math:`\sigma` of single shifts is the simulation's, since that of ten readings is known to a
quarter at best and scores gaps of nothing as many standard errors; *s* is the standard error
of a mean over even angles (``sim.expectation``). The numerical error *e* comes from repeating
some shifts with a tolerance thirty times smaller, in units of their cell's spread, since a small
error matters where a shift hangs in the balance: with mean :math:`\bar r`, which no number of
shifts averages out, and scatter :math:`s_r` over the *m* shifts of the cell,
:math:`e^2 = \sigma^2 (\bar r^2 + s_r^2/m)`.

Fast shifts have a narrow bulk and a rare long tail, which a few angles may not meet. By the rule
of succession one in *m* + 2 may be such a shift. It waits for the next slot, pitch over mismatch,
or for as long as a whole shift where that is less; what this exceeds the range seen by is
:math:`\tau`, and :math:`p(1-p)\tau^2` with *p* = 1/(*m* + 2) joins the variance of single shifts
in both samples.

Over the map the mean of :math:`v` over the mean-square gap is the share of noise; what is left
is systematic. Shares engaged are compared where the bench says whether it engaged: with *k* of
*m* simulated shifts engaged and Jeffreys' prior the share is
:math:`\mathrm{Beta}(k + 1/2, m - k + 1/2)`, the number of *n* tried bench shifts beta-binomial.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import betabinom, mannwhitneyu

from diagnosis.bench import Bench
from diagnosis.reading import Cell
from sim.blocks import Block, even_blocks
from sim.clutch import Clutch, OperatingPoint
from sim.expectation import PointExpectation, expect_point, variance_of_mean
from sim.numerical import Runner, numerical_differences
from sim.records import Record, result_of

ANGLES = 16  #: evenly spaced angles at each operating point
FLOOR = 1e-6  #: s, the least standard error
LEAST_SPREAD = 1e-4  #: s, the least spread that a numerical error is measured in


@dataclass(frozen=True)
class ErrorBudget:
    """Standard errors of a gap, s: sampling of the bench and of the simulation, numerics."""

    bench: float
    simulation: float
    numerics: float

    @property
    def whole(self) -> float:
        """All three together, s."""
        return max(FLOOR, math.sqrt(self.bench**2 + self.simulation**2 + self.numerics**2))


@dataclass(frozen=True)
class CellGap:
    """One operating point: its bench cell, its simulation and the errors of their gap.

    ``times`` are those of the simulated shifts that engaged, s, in the order of their angles.
    """

    cell: Cell
    simulated: PointExpectation
    times: tuple[float, ...]
    errors: ErrorBudget

    @property
    def gap(self) -> float | None:
        """Bench less simulated mean, s; None where one of them is missing."""
        if self.cell.time is None or self.simulated.mean_engaged is None:
            return None
        return self.cell.time - self.simulated.mean_engaged

    @property
    def z(self) -> float | None:
        """Gap in standard errors."""
        return None if self.gap is None else self.gap / self.errors.whole

    @property
    def bench_sd(self) -> float | None:
        """Spread of the bench's single times, s; None for fewer than two."""
        times = self.cell.times
        return float(times.std(ddof=1)) if times.size > 1 else None

    @property
    def times_p(self) -> float | None:
        """Two-sided probability, by ranks, that single bench times lie as the simulated ones.

        One shift of a long tail moves a mean by many standard errors, and ranks hardly. None for
        fewer than three single times, or simulated ones.
        """
        if self.cell.times.size < 3 or len(self.times) < 3:
            return None
        return float(mannwhitneyu(self.cell.times, self.times).pvalue)

    @property
    def engaged_p(self) -> float | None:
        """Two-sided probability that a share engaged as simulated gives one as odd as the bench's.

        None where the bench does not say whether it engaged, or no simulated shift is known.
        """
        tried, simulated = self.cell.tried, self.simulated
        if not tried or not simulated.n:
            return None
        engaged = round(simulated.engaged * simulated.n)
        number = betabinom(tried, engaged + 0.5, simulated.n - engaged + 0.5)
        tails = number.cdf(self.cell.engaged), number.sf(self.cell.engaged - 1)
        return min(1.0, 2.0 * float(min(tails)))


@dataclass(frozen=True)
class Marginal:
    """Mean gap over the cells that share a force or a mismatch, s; ``value`` in N or rad/s."""

    value: float
    gap: float
    standard_error: float
    cells: int

    @property
    def z(self) -> float:
        """Mean gap in standard errors."""
        return self.gap / self.standard_error


@dataclass(frozen=True)
class Shares:
    """Shares of the mean-square gap; ``systematic`` is what the others leave, at least 0."""

    bench: float
    simulation: float
    numerics: float

    @property
    def systematic(self) -> float:
        """What neither sampling nor numerics account for."""
        return max(0.0, 1.0 - self.bench - self.simulation - self.numerics)


@dataclass(frozen=True)
class GapMap:
    """Gaps at all operating points of a data set."""

    bench: Bench
    cells: tuple[CellGap, ...]

    @property
    def compared(self) -> tuple[CellGap, ...]:
        """Cells that have a gap."""
        return tuple(cell for cell in self.cells if cell.gap is not None)

    @property
    def gaps(self) -> tuple[float, ...]:
        """Gaps of these, s."""
        return tuple(cell.gap for cell in self.cells if cell.gap is not None)

    @property
    def baseline_rmse(self) -> float:
        """Root-mean-square gap, s; NaN without a gap."""
        return _rms(self.gaps)

    @property
    def floor_rmse(self) -> float:
        """Root-mean-square standard error: the gap that noise and numerics alone would show, s."""
        return _rms([cell.errors.whole for cell in self.compared])

    @property
    def chi_square(self) -> float:
        """Mean square of the gaps in standard errors; one where there is noise alone."""
        return _rms([cell.z for cell in self.compared if cell.z is not None]) ** 2

    @property
    def shares(self) -> Shares:
        """Shares of the mean-square gap that are noise and numerics."""
        errors = [cell.errors for cell in self.compared]
        whole = max(self.baseline_rmse, FLOOR) ** 2 if errors else math.nan
        parts = ([e.bench for e in errors], [e.simulation for e in errors])
        sampled, simulated = (_rms(part) ** 2 / whole for part in parts)
        return Shares(sampled, simulated, _rms([e.numerics for e in errors]) ** 2 / whole)

    @property
    def by_force(self) -> tuple[Marginal, ...]:
        """Mean gap at each force, over the mismatches that have one."""
        return _marginals(self.compared, lambda cell: cell.point.profile.force)

    @property
    def by_mismatch(self) -> tuple[Marginal, ...]:
        """Mean gap at each mismatch, over the forces that have one."""
        return _marginals(self.compared, lambda cell: cell.point.mismatch)


def _rms(values: Sequence[float]) -> float:
    return math.sqrt(sum(v * v for v in values) / len(values)) if values else math.nan


def _marginals(cells: Sequence[CellGap], key: Callable[[Cell], float]) -> tuple[Marginal, ...]:
    found: dict[float, list[CellGap]] = {}
    for one in cells:
        found.setdefault(key(one.cell), []).append(one)
    return tuple(_marginal(value, found[value]) for value in sorted(found))


def _marginal(value: float, cells: Sequence[CellGap]) -> Marginal:
    """Average with equal weights; sampling averages out, numerics of one sign do not."""
    count = len(cells)
    sampled = sum(c.errors.bench**2 + c.errors.simulation**2 for c in cells) / count**2
    numerics = sum(c.errors.numerics for c in cells) / count
    mean = sum(c.gap for c in cells if c.gap is not None) / count
    return Marginal(value, mean, max(FLOOR, math.hypot(math.sqrt(sampled), numerics)), count)


def gap_map(
    bench: Bench, run: Runner, angles: int = ANGLES, seed: int = 1, *, checked: bool = True
) -> GapMap:
    """Simulate every operating point of a data set at even angles and take the gaps.

    Parameters
    ----------
    run : simulates blocks of shifts.
    angles : evenly spaced relative angles at each operating point, at least three.
    seed : of where the angles begin.
    checked : whether to repeat an eighth of the shifts for the numerical error, which is 0
        otherwise.
    """
    blocks = even_blocks(bench.clutch, [cell.point for cell in bench.cells], angles, seed)
    rows = run(blocks)
    apart = numerical_ratio(blocks, rows, run) if checked else (0.0, 0.0)
    pairs = zip(bench.cells, rows, strict=True)
    return GapMap(bench, tuple(cell_gap(cell, r, bench.clutch, apart) for cell, r in pairs))


def numerical_ratio(
    blocks: Sequence[Block], rows: Sequence[Sequence[Record]], run: Runner
) -> tuple[float, float]:
    """Return mean and standard deviation of a shift's numerical error in spreads of its cell.

    ``blocks`` and their ``rows`` are those of whole cells. Of the squared mean that part is left
    out which the scatter of so few shifts makes by itself.
    """
    apart, which = numerical_differences(blocks, rows, run)
    spreads = np.array([_spread(rows[k]) for k in which])
    ratios = apart / np.maximum(spreads, LEAST_SPREAD)
    if ratios.size < 2:
        return float(ratios.mean()), 0.0
    mean, scatter = float(ratios.mean()), float(ratios.std(ddof=1))
    left = math.sqrt(max(0.0, mean**2 - scatter**2 / ratios.size))
    return math.copysign(left, mean), scatter


def _spread(rows: Sequence[Record]) -> float:
    times = [t for row in rows if (t := result_of(row).shift_time) is not None]
    return float(np.std(times, ddof=1)) if len(times) > 1 else 0.0


def unseen_tail(clutch: Clutch, point: OperatingPoint, times: Sequence[float]) -> float:
    """Return the standard deviation that a tail which no simulated shift met may add, s.

    ``times`` are those of the simulated shifts, s.
    """
    if not times or point.mismatch == 0.0:
        return 0.0
    wait = clutch.dog.pitch_angle / abs(point.mismatch)
    beyond = min(wait, float(np.mean(times))) - (max(times) - min(times))
    share = 1.0 / (len(times) + 2)
    return math.sqrt(share * (1.0 - share)) * max(0.0, beyond)


def _mean_error(simulated: PointExpectation, times: Sequence[float]) -> float:
    """Return the standard error of the simulated mean over shifts that engaged, s."""
    if not times:
        return 0.0
    return math.sqrt(variance_of_mean(np.array(times), even=simulated.engaged == 1.0))


def cell_gap(
    cell: Cell, rows: Sequence[Record], clutch: Clutch, numerics: tuple[float, float] = (0.0, 0.0)
) -> CellGap:
    """Return the gap of one cell from its simulated shifts at even angles.

    ``numerics`` are mean and standard deviation of the numerical error of one shift, in spreads
    of the cell.
    """
    results = [result_of(row) for row in rows]
    simulated = expect_point(cell.point, results, clutch.timeout, 0.0)
    times = tuple(r.shift_time for r in results if r.shift_time is not None)
    tail, count = unseen_tail(clutch, cell.point, times), math.sqrt(max(1, len(times)))
    mean, scatter = numerics
    errors = ErrorBudget(
        bench=math.hypot(simulated.sd, tail) / math.sqrt(max(1, cell.n)),
        simulation=math.hypot(_mean_error(simulated, times), tail / count),
        numerics=max(LEAST_SPREAD, simulated.sd) * math.hypot(mean, scatter / count),
    )
    return CellGap(cell, simulated, times, errors)
