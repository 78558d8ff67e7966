r"""Expected shift time over the random relative angle and the operating points.

The angle is uniform over one pitch. It is sampled in *n* strata, one angle
uniform in each, drawn once for each operating point and common to all designs,
so that designs differ by their shape and not by their luck.

A shift that does not engage is tried again after the time-out and a
retraction. With *p* the share that engages,

.. math:: E = E[t | engaged] + \frac{1-p}{p} (t_{timeout} + t_{retraction}).

The standard error of a stratified mean comes from second differences round the
pitch, :math:`s^2 = \sum (t_{k-1} - 2 t_k + t_{k+1})^2 / (6 n^2)`. For a time that
is linear in the angle this is the variance within the strata, without bias
(Wolter 2007, ch. 8); jumps between strata count as scatter, on the safe side.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sim.clutch import OperatingPoint
from sim.engagement import Outcome

Phases = NDArray[np.float64]


@dataclass(frozen=True)
class ShiftResult:
    """What an expectation needs of one shift: outcome and time in s (None if it failed)."""

    outcome: Outcome
    shift_time: float | None


@dataclass(frozen=True)
class PointExpectation:
    """Expected shift time at one operating point, s.

    ``mean`` includes the retries, ``mean_engaged`` does not. Where no shift
    engaged, ``mean`` is a lower bound with p = 1/(n + 1) and ``mean_engaged`` None.
    ``standard_error`` is NaN for fewer than three shifts, which say nothing of it.
    """

    point: OperatingPoint
    mean: float
    mean_engaged: float | None
    standard_error: float
    sd: float
    engaged: float
    n: int


@dataclass(frozen=True)
class Expectation:
    """Expected shift time over all operating points, weighted, s."""

    points: tuple[PointExpectation, ...]
    mean: float
    standard_error: float

    @property
    def is_lower_bound(self) -> bool:
        """Whether at some operating point no shift engaged at all."""
        return any(p.mean_engaged is None for p in self.points)

    @property
    def engaged(self) -> float:
        """Smallest share engaged over the operating points."""
        return min(p.engaged for p in self.points)


def stratified_phases(count: int, seed: int, index: int) -> Phases:
    """Return ``count`` fractions of a pitch in [0, 1), one in each stratum, (count,).

    ``index`` is that of the operating point: each has angles of its own, so
    that the errors of the points are independent.
    """
    rng = np.random.default_rng([seed, index])
    phases: Phases = (np.arange(count) + rng.random(count)) / count
    return phases


def expect_point(
    point: OperatingPoint,
    shifts: Sequence[ShiftResult],
    timeout: float,
    retraction: float,
    stratified: bool = True,
) -> PointExpectation:
    """Return the expected shift time of one operating point from its shifts.

    ``shifts`` are in the order of their angles; ``timeout`` and ``retraction`` in s.
    Shifts whose integration failed say nothing and are left out.
    """
    asked = len(shifts)
    n = sum(s.outcome is not Outcome.DIVERGED for s in shifts)
    times = np.array([s.shift_time for s in shifts if s.shift_time is not None], dtype=float)
    lost = timeout + retraction
    if times.size == 0:
        return PointExpectation(point, timeout + asked * lost, None, lost, 0.0, 0.0, n)
    share = times.size / n
    mean = float(times.mean())
    variance = _variance_of_mean(times, stratified and share == 1.0)
    retry = (1.0 - share) / share * lost
    retry_variance = (lost / share**2) ** 2 * share * (1.0 - share) / n
    error = math.sqrt(variance + retry_variance) if asked > 2 else math.nan
    sd = float(times.std(ddof=1)) if times.size > 1 else 0.0
    return PointExpectation(point, mean + retry, mean, error, sd, share, n)


def _variance_of_mean(times: Phases, stratified: bool) -> float:
    n = times.size
    if n < 3:
        return float(times.mean() ** 2 / n)  # two times that agree by luck would look exact
    if stratified:
        bends = np.roll(times, 1) - 2.0 * times + np.roll(times, -1)
        return float((bends**2).sum() / (6.0 * n * n))
    return float(times.var(ddof=1) / n)


def expect(points: Sequence[PointExpectation]) -> Expectation:
    """Return the weighted expectation over operating points with independent errors."""
    weights = np.array([p.point.weight for p in points])
    weights = weights / weights.sum()
    mean = float(weights @ np.array([p.mean for p in points]))
    error = float(np.sqrt((weights**2) @ np.array([p.standard_error**2 for p in points])))
    return Expectation(tuple(points), mean, error)
