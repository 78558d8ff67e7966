r"""Expected shift time over the random relative angle and the operating points.

The angle is uniform over one pitch. It is sampled at *n* evenly spaced angles with a random start.
The start is drawn once for each operating point and is common to all designs, so that designs
differ by their shape, not by luck. The mean is unbiased; on the times of the prototype its error is
a third of that of as many random angles at *n* = 8, and it falls as 1/n instead of its root.

A shift that does not engage is tried again after the time-out and a
retraction. With *p* the share that engages,

.. math:: E = E[t | engaged] + \frac{1-p}{p} (t_{timeout} + t_{retraction}).

The standard error comes from differences :math:`d_k = t_{k+1} - t_k` round the
pitch. Times run in slopes with a few jumps. A saw-tooth of height H alone gives a
variance of :math:`H^2/(12 n^2) = \sum d_k^2/(12 n^2)`; scatter :math:`\sigma` from
angle to angle gives :math:`\sigma^2/n` and shows in the product of neighbouring
differences, of which it makes the mean :math:`-\sigma^2`:

.. math:: s^2 = \frac{\sum d_k^2}{12 n^2} + \frac{5 \hat\sigma^2}{6 n}, \qquad
   \hat\sigma^2 = \max(0, -\overline{d_k d_{k+1}}).

Both cases come out right; on the prototype's times it is 1.0 to 1.8 times the
scatter at 6 to 24 angles (Wolter 2007, ch. 8, for such estimators).

Where fewer than ``LEAST_ENGAGED`` of the shifts of an operating point engage, :math:`(1-p)/p` is
above one: the time-out and the number of angles make the mean, not the dogs. Such a clutch has no
expected shift time (``time``); its share engaged says what there is to say. ``mean`` stays what the
formula gives, for what learns from it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dogshape.sim.shift.clutch import OperatingPoint
from dogshape.sim.shift.conclusion import Outcome

Phases = NDArray[np.float64]

LEAST_ENGAGED = 0.5  #: share of an operating point's shifts from which it has a time (judged)
NO_TIME = "no expected shift time, as fewer than half engage at some operating point"


@dataclass(frozen=True)
class ShiftResult:
    """Outcome and time of one shift in s (None if it failed), for an expectation."""

    outcome: Outcome
    shift_time: float | None


@dataclass(frozen=True)
class PointExpectation:
    """Expected shift time at one operating point, s.

    ``mean`` includes the retries, ``mean_engaged`` does not. Where no shift
    engaged, ``mean`` is an estimate with p = 1/(n + 1) and ``mean_engaged`` None.
    ``standard_error`` is NaN for fewer than three shifts, which say nothing of it.
    ``blocked`` of the ``n`` shifts stood still dog on dog, held by friction. ``n_planar`` shifts of
    the compiled engine stand behind a mean of a search in two levels
    (``pipeline.simulate.level_times``); counts and shares are those of the other engine there.
    """

    point: OperatingPoint
    mean: float
    mean_engaged: float | None
    standard_error: float
    sd: float
    engaged: float
    n: int
    blocked: int = 0
    n_planar: int = 0

    @property
    def lost(self) -> int:
        """Number of the shifts that did not engage."""
        return self.n - round(self.engaged * self.n)

    @property
    def engages(self) -> bool:
        """Whether enough of the shifts engage for an expected time."""
        return self.engaged >= LEAST_ENGAGED

    @property
    def time(self) -> float | None:
        """Expected shift time, s; None where too few shifts engage."""
        return self.mean if self.engages else None


@dataclass(frozen=True)
class Expectation:
    """Expected shift time over all operating points, weighted, s.

    ``numerical_error`` is that of the mean from repeating some shifts with a far
    smaller tolerance; None where that was not done.
    """

    points: tuple[PointExpectation, ...]
    mean: float
    standard_error: float
    numerical_error: float | None = None

    @property
    def engages(self) -> bool:
        """Whether at every operating point enough of the shifts engage for an expected time."""
        return all(p.engages for p in self.points)

    @property
    def time(self) -> float | None:
        """Expected shift time, s; None where too few shifts engage somewhere."""
        return self.mean if self.engages else None

    @property
    def engaged_words(self) -> str:
        """Count of the shifts that engage, and what that leaves of the time, as words."""
        return f"engages in {self.shifts - self.lost} of {self.shifts} shifts" + (
            "" if self.engages else f": {NO_TIME}"
        )

    @property
    def mean_engaged(self) -> float | None:
        """Weighted mean of the shifts that engage, s: what is left without the retries.

        One hung shift in some hundreds moves ``mean`` by milliseconds and this one hardly. None
        where at some operating point none engaged.
        """
        total = sum(p.point.weight for p in self.points)
        means = [(p.point.weight / total, p.mean_engaged) for p in self.points]
        found = [weight * mean for weight, mean in means if mean is not None]
        return sum(found) if len(found) == len(means) else None

    @property
    def shifts(self) -> int:
        """Number of shifts that finished."""
        return sum(p.n for p in self.points)

    @property
    def planar_shifts(self) -> int:
        """Number of shifts of the compiled engine beside them, in two levels."""
        return sum(p.n_planar for p in self.points)

    @property
    def lost(self) -> int:
        """Number of shifts that did not engage."""
        return sum(p.lost for p in self.points)

    @property
    def blocked(self) -> int:
        """Number of shifts that friction held dog on dog."""
        return sum(p.blocked for p in self.points)

    @property
    def engaged(self) -> float:
        """Smallest share engaged over the operating points."""
        return min(p.engaged for p in self.points)


def even_phases(count: int, seed: int, index: int, base: int | None = None) -> Phases:
    """Return ``count`` fractions of a pitch in [0, 1), evenly spaced, (count,).

    The start is random. ``index`` is that of the operating point: each has angles
    of its own, so that the errors of the points are independent. Where ``count`` is a
    multiple of ``base``, the result holds the ``base`` fractions of the same draw.
    """
    start = np.random.default_rng([seed, index]).random() * (count // (base or count))
    return (np.arange(count) + start % 1.0) / count


def nested(few: int, many: int, seed: int, index: int, base: int) -> list[int]:
    """Find the places of few even angles among the many that hold them.

    Both are of the same draw, as for ``even_phases``.
    """
    own, all_of_them = (even_phases(count, seed, index, base) for count in (few, many))
    apart = np.abs(np.subtract.outer(own, all_of_them))
    return [int(place) for place in np.minimum(apart, 1.0 - apart).argmin(axis=1)]


def expect_point(
    point: OperatingPoint,
    shifts: Sequence[ShiftResult],
    timeout: float,
    retraction: float,
    *,
    even: bool = True,
) -> PointExpectation:
    """Return the expected shift time of one operating point from its shifts.

    ``shifts`` are in the order of their angles; ``timeout`` and ``retraction`` in s.
    Shifts whose integration failed say nothing and are left out.
    """
    asked = len(shifts)
    n = sum(s.outcome is not Outcome.DIVERGED for s in shifts)
    blocked = sum(s.outcome is Outcome.BLOCKED for s in shifts)
    times = np.array([s.shift_time for s in shifts if s.shift_time is not None], dtype=float)
    lost = timeout + retraction
    if times.size == 0:
        return PointExpectation(point, timeout + asked * lost, None, lost, 0.0, 0.0, n, blocked)
    share = times.size / n
    mean = float(times.mean())
    variance = variance_of_mean(times, even=even and share == 1.0)
    retry = (1.0 - share) / share * lost
    retry_variance = (lost / share**2) ** 2 * share * (1.0 - share) / n
    error = math.sqrt(variance + retry_variance) if asked > 2 else math.nan
    sd = float(times.std(ddof=1)) if times.size > 1 else 0.0
    return PointExpectation(point, mean + retry, mean, error, sd, share, n, blocked)


def variance_of_mean(times: Phases, *, even: bool = True) -> float:
    """Return the variance of the mean of times (n,) in the order of their angles, s2."""
    n = times.size
    if n < 3:
        return float(times.mean() ** 2 / n)  # two times that agree by luck would look exact
    if even:
        steps = np.roll(times, -1) - times
        scatter = max(0.0, -float((steps * np.roll(steps, -1)).mean()))
        return float((steps**2).sum()) / (12.0 * n * n) + 5.0 * scatter / (6.0 * n)
    return float(times.var(ddof=1) / n)


def expect(points: Sequence[PointExpectation]) -> Expectation:
    """Return the weighted expectation over operating points with independent errors."""
    weights = np.array([p.point.weight for p in points])
    weights = weights / weights.sum()
    mean = float(weights @ np.array([p.mean for p in points]))
    error = float(np.sqrt((weights**2) @ np.array([p.standard_error**2 for p in points])))
    return Expectation(tuple(points), mean, error)
