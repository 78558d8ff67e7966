r"""Numbers of the mix of all shifts, each with its standard error.

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

from dogshape.sim.shift.conclusion import Outcome
from dogshape.sim.statistics.expectation import ShiftResult, variance_of_mean

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
