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

Other numbers of the mix of all shifts, each with its standard error:

**Mean** of a quantity over the mix: the weighted mean of the operating points' means, with the
standard error of evenly spaced angles at each (``sim.statistics.expectation``). A time has a value
even where the integration of every shift failed, since such a shift counts as one that did not
engage; what a failed shift struck nobody knows, so there a mean is NaN and not a number that looks
gentle.

**Quantile** of a single shift's time. A shift that does not engage is tried again after time-out
and retraction, at a new relative angle, until it engages. With the share *p* that engages at an
operating point, its time is :math:`t + k (t_{timeout} + t_{retraction})` with probability
:math:`p (1-p)^k` for each time *t* of those that engaged, which has the mean of the expected shift
time. Where none engages, *p* is 1/(n + 1) and *t* the time-out, as there. All these times with
their weights make a distribution; a time stands in the middle of its weight, and between two the
quantile runs straight.

Its standard error is Woodruff's (1952): the share of shifts below the quantile is a mean, whose
standard error *s* is found as that of any mean over even angles; the quantiles at q - s and
q + s lie two standard errors apart. Beyond the largest time nothing is known, so a
share above that makes the interval narrower; where less than half a standard error is left of its
upper part, the lower one stands for both.
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
    ``blocked`` of the ``n`` shifts stood still dog on dog, held by friction.
    """

    point: OperatingPoint
    mean: float
    mean_engaged: float | None
    standard_error: float
    sd: float
    engaged: float
    n: int
    blocked: int = 0

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


Values = NDArray[np.float64]

TAIL = 1e-6  #: of a point's weight, left out of its retries
WIDE = 1.0  #: half width of the interval that gives a standard error, in those of the share
LEAST = 0.5  #: the same where the largest time is near, at least


@dataclass(frozen=True)
class Estimate:
    """A number with its standard error, in the unit of its name.

    ``parts`` is what each operating point adds to the variance, up to a common factor; empty
    where nothing is known of that.
    """

    value: float
    standard_error: float
    parts: tuple[float, ...] = ()


@dataclass(frozen=True)
class _Retried:
    """Times of one operating point, retries included, with their weights."""

    times: Values  # of each shift and retry, s, (m,)
    masses: Values  # (m,), add up to the weight of the point
    shift: NDArray[np.int64]  # which shift a time comes from, (m,)
    sizes: Values  # what a time adds to its shift's share below, (m,)
    count: int  # of shifts

    def below(self, time: float) -> float:
        """Return the variance of the share of the point's shifts below a time."""
        each = np.zeros(self.count)
        np.add.at(each, self.shift, np.where(self.times <= time, self.sizes, 0.0))
        return variance_of_mean(each) if self.count > 2 else 0.25 / self.count


def mean_over(weights: Sequence[float], values: Sequence[Sequence[float]]) -> Estimate:
    """Return the mean over operating points of ``values`` in the order of their angles.

    ``weights`` of the points need not add up to one; a point without values is left out. NaN, and
    its standard error too, where no point has any.
    """
    pairs = [(w, np.array(v, dtype=float)) for w, v in zip(weights, values, strict=True)]
    total = sum(weight for weight, v in pairs if len(v))
    if not total:
        return Estimate(math.nan, math.nan)
    mean = sum(weight * float(v.mean()) for weight, v in pairs if len(v)) / total
    parts = [weight**2 * variance_of_mean(v) if len(v) else 0.0 for weight, v in pairs]
    return Estimate(mean, math.sqrt(sum(parts) / total**2), tuple(parts))


def time_quantile(
    weights: Sequence[float],
    shifts: Sequence[Sequence[ShiftResult]],
    share: float,
    timeout: float,
    retraction: float,
) -> Estimate:
    """Return the time within which the ``share`` of all shifts engages, s.

    Parameters
    ----------
    weights : of the operating points; they need not add up to one.
    shifts : of each, in the order of their angles; those whose integration failed are left out.
    timeout, retraction : what a shift that does not engage costs, s.
    """
    whole = sum(weights)
    points = [
        _retried(weight / whole, mine, timeout, retraction)
        for weight, mine in zip(weights, shifts, strict=True)
    ]
    times = np.concatenate([point.times for point in points])
    masses = np.concatenate([point.masses for point in points])
    order = np.argsort(times, kind="stable")
    times, masses = times[order], masses[order] / masses.sum()
    places = np.cumsum(masses) - 0.5 * masses

    def at(wanted: float) -> float:
        return float(np.interp(wanted, places, times))

    value = at(share)
    variances = [point.below(value) for point in points]
    if value >= times[-1]:  # no shift beyond: as if each had been drawn by chance
        variances = [share * (1.0 - share) / len(mine) for mine in shifts]
    parts = tuple((w / whole) ** 2 * v for w, v in zip(weights, variances, strict=True))
    error = math.sqrt(sum(parts))
    half = min(WIDE, (places[-1] - share) / error) if error > 0.0 else WIDE
    if half < LEAST:
        return Estimate(value, (value - at(share - WIDE * error)) / WIDE, parts)
    spread = at(share + half * error) - at(share - half * error)
    return Estimate(value, spread / (2.0 * half), parts)


def _retried(
    weight: float, shifts: Sequence[ShiftResult], timeout: float, retraction: float
) -> _Retried:
    sound = [s for s in shifts if s.outcome is not Outcome.DIVERGED]
    places = [k for k, s in enumerate(sound) if s.shift_time is not None]
    times = np.array([s.shift_time for s in sound if s.shift_time is not None], dtype=float)
    count, share = len(sound), len(places) / max(1, len(sound))
    if not places:
        count = max(1, len(shifts))
        places, times, share = list(range(count)), np.full(count, timeout), 1.0 / (count + 1)
    tries = 1 if share == 1.0 else math.ceil(math.log(TAIL) / math.log1p(-share))
    again = (1.0 - share) ** np.arange(tries)
    failed_time = np.arange(tries) * (timeout + retraction)
    sizes = np.repeat(again, len(places)) * (share * count / len(places))
    return _Retried(
        times=(failed_time[:, None] + times[None, :]).ravel(),
        masses=weight * sizes / count,
        shift=np.tile(np.array(places), tries),
        sizes=sizes,
        count=count,
    )
