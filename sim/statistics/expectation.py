r"""Expected shift time over the random relative angle and the operating points, and other numbers.

The angle is uniform over one pitch, sampled at *n* even angles with a random start that is common
to all designs. A shift that does not engage hangs and is tried again. The expected time is the mean
of engaged shifts plus the time of retries, by the posterior of the probability of a hang
(``hangs``); each has its own error, and that of the mean is

.. math:: s^2 = \frac{\sum d_k^2}{12 n^2} + \frac{5 \hat\sigma^2}{6 n}, \quad
   \hat\sigma^2 = \max(0, -\overline{d_k d_{k+1}}),

:math:`d_k` being differences round the pitch: the variance of a saw-tooth and of scatter (Wolter
2007, ch. 8). A quantile of a single shift's time takes :math:`t + k (t_{timeout} + t_{retraction})`
with probability :math:`p (1-p)^k`; its error is Woodruff's (1952): from the quantiles at the share
plus and minus its standard error. A blocked shift that a ``SetPoint`` frees has a time of its own
and is not tried again.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from dogshape.sim.elementwise import Array, empirical_distribution
from dogshape.sim.shift.clutch import OperatingPoint
from dogshape.sim.shift.conclusion import Outcome
from dogshape.sim.statistics.hangs import HangPosterior, HangPrior, interval, weak_priors

FIRST_WINDOW_SHARE = 0.9  #: of the relative angles, up to the limit engagement speed (judged)
MIN_ENGAGED_SHARE = 0.5  #: of an operating point's shifts, from which it has a time (judged)
#: Share of hangs at an operating point above which a verdict warns (judged): beyond one shift in
#: twenty the 95 % quantile of the shift time there is a retry's.
HANG_WARNING_SHARE = 0.05
NO_TIME = "no expected shift time, as fewer than half engage at some operating point"


@dataclass(frozen=True)
class Estimate:
    """A number with its standard error, in the unit of its name."""

    value: float
    standard_error: float


PART_LEVELS = 200  #: quantiles of a part, for the interval of a sum of two


def positive_interval(*parts: Estimate, share: float = 0.95) -> tuple[float, float]:
    """Compute the central interval of a sum of one or two positive parts that holds a ``share``.

    Each part is Gamma distributed with its mean and variance, or exact without an error: an
    expected time is the mean of engaged shifts and the time of retries. NaN for an unknown error.
    """
    sums = functools.reduce(np.add.outer, map(_gamma_quantiles, parts))
    low, high = np.quantile(sums, [0.5 - 0.5 * share, 0.5 + 0.5 * share], method="hazen")
    return float(low), float(high)


def _gamma_quantiles(part: Estimate) -> Array:
    """Compute even quantiles of a Gamma distribution by mean and standard deviation."""
    from scipy.special import gammaincinv  # noqa: PLC0415  slow to load

    if part.standard_error == 0.0 or part.value <= 0.0:
        return np.array([part.value])
    levels = (np.arange(PART_LEVELS) + 0.5) / PART_LEVELS
    scale = part.standard_error**2 / part.value
    quantiles: Array = scale * gammaincinv(part.value / scale, levels)
    return quantiles


@dataclass(frozen=True)
class ShiftResult:
    """Outcome and time of one shift, for an expectation."""

    outcome: Outcome
    shift_time: float | None  #: s; None if it did not engage
    overlap: float | None = None  #: of a blocked shift up to the next slot ahead, rad


@dataclass(frozen=True)
class SetPoint:
    r"""Set-point of the relative speed that alternates about zero and frees a blocked shift.

    A drive that overcomes the friction of the faces, :math:`\mu_s F r`, makes the relative speed
    :math:`A \sin(2 \pi (t - t_0)/T)` from :math:`t_0` on, at first in the sense of the mismatch.
    The relative angle then has passed the overlap :math:`u` at

    .. math:: t_0 + \frac{T}{2 \pi} \arccos\left(1 - \frac{2 \pi u}{A T}\right), \qquad
       u \le \frac{A T}{\pi},

    and the ring falls into the slot; its fall, 3 to 12 ms if simulated, is left out. A larger
    overlap is never passed.
    """

    amplitude: float = 0.0  #: rad/s; 0 frees nothing
    period: float = 1.0  #: s
    start: float = 0.0  #: s from the command

    def passages(self, overlaps: Array) -> Array:
        """Compute the times of passing ``overlaps`` (n,) in rad, s after the command, (n,)."""
        swing = self.amplitude * self.period / math.pi
        shares = np.where(overlaps <= swing, overlaps / (swing or 1.0), np.nan)
        return self.start + self.period / (2.0 * math.pi) * np.arccos(1.0 - 2.0 * shares)

    def free_blocked(self, shifts: Sequence[ShiftResult]) -> list[ShiftResult]:
        """Return the shifts with the times at which blocked ones are freed; outcomes stay."""
        if self.amplitude == 0.0:
            return list(shifts)
        overlaps = np.array([np.nan if s.overlap is None else s.overlap for s in shifts])
        times = self.passages(overlaps).tolist()
        results = []
        for shift, time in zip(shifts, times, strict=True):
            results.append(shift if math.isnan(time) else replace(shift, shift_time=time))
        return results


@dataclass(frozen=True)
class PointExpectation:
    """Expected shift time at one operating point, s."""

    point: OperatingPoint
    engaged_mean: float  #: of shifts that engage or are freed; the time-out without any
    engaged_error: float  #: standard error of ``engaged_mean``, NaN for fewer than three shifts
    unaided_mean: float | None  #: of shifts that engage by themselves; None without any
    sd: float
    engaged: float  #: share at the first try
    n: int  #: number of shifts, without diverged ones
    retry_cost: float  #: of a shift that hangs, s
    hang: HangPosterior  #: probability that a shift hangs
    blocked: int = 0  #: number of shifts that friction held dog on dog
    freed: int = 0  #: number of blocked shifts that a set-point freed
    by_angle: Sequence[Sequence[int]] = ()  #: of ``entries_by_angle``
    prior: HangPrior | None = None  #: of the probability of a hang
    #: number of shifts that engaged without skipping a slot; None if not recorded
    first_window: int | None = None
    direct_share: float | None = None  #: of ``sim.statistics.shiftability``

    @property
    def hangs(self) -> int:
        """Number of shifts that are tried again."""
        return self.lost - self.freed

    @property
    def silent(self) -> bool:
        """Whether no shift has a time: one in n + 1 retries then counts as engaged."""
        return self.hangs >= self.n

    @property
    def retries(self) -> float:
        """Expected time of retries, s."""
        if self.silent:
            return max(1, self.n) * self.retry_cost
        return self.retry_cost * self.hang.mean / (1.0 - self.hang.mean)

    @property
    def retries_error(self) -> float:
        """Standard error of ``retries``, s."""
        if self.silent:
            return self.retry_cost
        return self.retry_cost * math.sqrt(self.hang.variance) / (1.0 - self.hang.mean) ** 2

    @property
    def mean(self) -> float:
        """Mean of engaged shifts and time of retries, s."""
        return self.engaged_mean + self.retries

    @property
    def standard_error(self) -> float:
        """Standard error of ``mean``, s; NaN for fewer than three shifts."""
        return math.hypot(self.engaged_error, self.retries_error)

    def replace_prior(self, prior: HangPrior) -> PointExpectation:
        """Return the expectation with another prior of the probability of a hang."""
        return replace(self, hang=prior.posterior(self.hangs, self.n), prior=prior)

    @property
    def first_try_share(self) -> float:
        """Share of shifts that engage at the first try, alone or freed by the set-point."""
        return self.engaged + self.freed / max(1, self.n)

    @property
    def lost(self) -> int:
        """Number of shifts that did not engage at the first try."""
        return self.n - round(self.engaged * self.n)

    @property
    def engages(self) -> bool:
        """Whether enough shifts engage for an expected time."""
        return self.first_try_share >= MIN_ENGAGED_SHARE

    @property
    def time(self) -> float | None:
        """Expected shift time, s; None if too few shifts engage."""
        return self.mean if self.engages else None


MIN_BIAS = 2.0  #: mean difference over its standard error from which it is a bias


class NumericalError(NamedTuple):
    """Mean shift time less that of the same shifts at a smaller tolerance."""

    difference: float  #: in the mean, s
    standard_error: float  #: of the difference, s; NaN for a single shift
    repeats: int  #: repeated shifts
    flips: int  #: repeated shifts that take another slot or have another outcome

    @property
    def size(self) -> float:
        """Difference and its standard error, added as squares, s."""
        return math.hypot(self.difference, self.standard_error)

    @property
    def is_bias(self) -> bool:
        """Whether the difference exceeds what flips of single shifts explain."""
        return abs(self.difference) > MIN_BIAS * self.standard_error


@dataclass(frozen=True)
class MixExpectation:
    """Expected shift time over all operating points, weighted, s."""

    points: tuple[PointExpectation, ...]
    numerical_error: NumericalError | None = None
    #: quantiles of the time of all shifts of the mix, retries included, by share
    quantiles: Mapping[float, Estimate] = field(default_factory=dict)
    first_window_share: float = FIRST_WINDOW_SHARE  #: that defines the limit engagement speed
    #: operating points under a further torque on a side, by that torque in N m
    by_torque: Mapping[float, tuple[PointExpectation, ...]] = field(default_factory=dict)

    @property
    def weights(self) -> Array:
        """Weights of the operating points, of sum one, (points,)."""
        weights = np.array([p.point.weight for p in self.points])
        return weights / weights.sum()

    def _weighted(self, values: Sequence[float]) -> float:
        return float(self.weights @ np.array(values))

    def _combined(self, errors: Sequence[float]) -> float:
        return float(np.linalg.norm(self.weights * np.array(errors)))

    @property
    def engaged_mean(self) -> float:
        """Mean of the shifts that engage or are freed by a set-point, s."""
        return self._weighted([p.engaged_mean for p in self.points])

    @property
    def engaged_error(self) -> float:
        """Standard error of ``engaged_mean``, s."""
        return self._combined([p.engaged_error for p in self.points])

    @property
    def retries(self) -> float:
        """Expected time of retries, s."""
        return self._weighted([p.retries for p in self.points])

    @property
    def retries_error(self) -> float:
        """Standard error of ``retries``, s."""
        return self._combined([p.retries_error for p in self.points])

    @property
    def mean(self) -> float:
        """Expected shift time, s: ``engaged_mean`` and ``retries``."""
        return self._weighted([p.mean for p in self.points])

    @property
    def standard_error(self) -> float:
        """Standard error of ``mean``, s, of both of its parts."""
        return self._combined([p.standard_error for p in self.points])

    def interval(self, share: float = 0.95) -> tuple[float, float]:
        """Compute the central interval of ``mean`` that holds a ``share``, s."""
        return positive_interval(
            Estimate(self.engaged_mean, self.engaged_error),
            Estimate(self.retries, self.retries_error),
            share=share,
        )

    @property
    def hang_probability(self) -> float:
        """Posterior mean of the probability that a shift hangs."""
        return self._weighted([p.hang.mean for p in self.points])

    @property
    def hang_interval(self) -> tuple[float, float]:
        """95 % interval of the probability of a hang."""
        variance = self.weights**2 @ np.array([p.hang.variance for p in self.points])
        return interval(self.hang_probability, float(variance))

    @property
    def worst_hang(self) -> HangPosterior | None:
        """Largest probability of a hang at an operating point; None without simulated shifts."""
        posteriors = [point.hang for point in self.points if point.n]
        return max(posteriors, key=lambda posterior: posterior.mean, default=None)

    @property
    def hangs(self) -> int:
        """Number of shifts that are tried again."""
        return sum(p.hangs for p in self.points)

    @property
    def hang_counts(self) -> list[tuple[int, int]]:
        """Numbers of hangs and shifts by operating point."""
        return [(point.hangs, point.n) for point in self.points]

    def replace_priors(self, priors: Sequence[HangPrior]) -> MixExpectation:
        """Return the expectation with other priors, one for each operating point."""
        points = [
            point.replace_prior(prior) for point, prior in zip(self.points, priors, strict=True)
        ]
        return replace(self, points=tuple(points))

    @property
    def relative_error(self) -> float:
        """Standard error of the mean of engaged shifts over that mean."""
        return self.engaged_error / self.engaged_mean

    @property
    def engages(self) -> bool:
        """Whether enough shifts engage at every operating point for an expected time."""
        return all(p.engages for p in self.points)

    @property
    def time(self) -> float | None:
        """Expected shift time, s; None if too few shifts engage at some operating point."""
        return self.mean if self.engages else None

    @property
    def losses(self) -> str:
        """Sentence on the shifts that did not engage: numbers by cause, and a remedy."""
        sentence = f"{self.lost} of {self.shifts} shifts did not engage"
        causes = []
        if self.blocked:
            cause = f"{self.blocked} held dog on dog by friction"
            freed = sum(point.freed for point in self.points)
            if freed:
                cause += f" ({freed} of these freed by the alternating set-point)"
            causes.append(cause)
        timed_out = self.lost - self.blocked
        if timed_out:
            causes.append(f"{timed_out} short of full depth at the time-out")
        if causes:
            sentence += f": {', '.join(causes)}"
        if self.engages or not self.blocked:
            return sentence
        return f"{sentence}; a larger chamfer, mismatch or sliding.inertia_kgm2 frees those held"

    @property
    def unaided_mean(self) -> float | None:
        """Weighted mean without retries, s; None if no shift engaged at some operating point.

        One hung shift in some hundreds moves ``mean`` by milliseconds, but hardly this mean.
        """
        total_weight = sum(p.point.weight for p in self.points)
        if None in (p.unaided_mean for p in self.points):
            return None
        return sum(p.point.weight / total_weight * (p.unaided_mean or 0.0) for p in self.points)

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


def even_phases(count: int, seed: int, index: int, base: int | None = None) -> Array:
    """Draw ``count`` evenly spaced fractions of a pitch in [0, 1) with a random start, (count,).

    The ``index`` of an operating point gives it an independent start. If ``count`` is a multiple of
    ``base``, the result contains the ``base`` fractions of the same draw.
    """
    refinement = count // (base or count)  # angles for one of ``base``
    start = np.random.default_rng([seed, index]).random() * refinement
    return (np.arange(count) + start % 1.0) / count


def expect_point(
    point: OperatingPoint,
    shifts: Sequence[ShiftResult],
    timeout: float,
    retraction: float,
    *,
    even: bool = True,
) -> PointExpectation:
    """Estimate the expected shift time of one operating point from its shifts.

    Parameters
    ----------
    shifts : in the order of their angles; diverged ones are left out.
    timeout, retraction : s.
    even : whether the angles are evenly spaced; else they are independent.
    """
    n = sum(s.outcome is not Outcome.DIVERGED for s in shifts)
    blocked_times = [s.shift_time for s in shifts if s.outcome is Outcome.BLOCKED]
    times = np.array([s.shift_time for s in shifts if s.shift_time is not None], dtype=float)
    (prior,) = weak_priors(1)
    no_times = PointExpectation(
        point,
        engaged_mean=timeout,
        engaged_error=0.0,
        unaided_mean=None,
        sd=0.0,
        engaged=0.0,
        n=n,
        retry_cost=timeout + retraction,
        hang=prior.posterior(n - times.size, n),
        blocked=len(blocked_times),
        prior=prior,
    )
    if times.size == 0:
        return no_times
    variance = variance_of_mean(times, even=even and times.size == n)
    engaged_times = [
        s.shift_time for s in shifts if s.outcome is not Outcome.BLOCKED and s.shift_time
    ]
    return replace(
        no_times,
        engaged_mean=float(times.mean()),
        engaged_error=math.sqrt(variance) if len(shifts) > 2 else math.nan,
        unaided_mean=float(np.mean(engaged_times)) if engaged_times else None,
        sd=float(times.std(ddof=1)) if times.size > 1 else 0.0,
        engaged=len(engaged_times) / n,
        freed=sum(time is not None for time in blocked_times),
    )


def variance_of_mean(times: Array, *, even: bool = True) -> float:
    """Estimate the variance of the mean of times (n,) in the order of their angles, s2."""
    n = times.size
    if n < 3:
        return float(times.mean() ** 2 / n)  # two times that agree by chance would look exact
    if even:
        steps = np.roll(times, -1) - times
        scatter = max(0.0, -float((steps * np.roll(steps, -1)).mean()))
        return float((steps**2).sum()) / (12.0 * n * n) + 5.0 * scatter / (6.0 * n)
    return float(times.var(ddof=1) / n)


def expect(
    points: Sequence[PointExpectation], priors: Sequence[HangPrior] | None = None
) -> MixExpectation:
    """Return the weighted expectation over operating points with independent errors.

    ``priors`` of the probability of a hang, one for each point; ``weak_priors`` by default.
    """
    return MixExpectation(tuple(points)).replace_priors(priors or weak_priors(len(points)))


RETRY_TAIL = 1e-6  #: of a point's weight, left out of its retries
#: Half width, in standard errors of the share, of the interval that gives the error of a quantile.
MIN_HALF_WIDTH = 0.5


def mean_over(weights: Sequence[float], values: Sequence[Sequence[float]]) -> Estimate:
    """Estimate the mean of ``values``, in the order of their angles, over operating points.

    ``weights`` of the points need not add up to one; a point without values is left out. NaN for
    mean and standard error if no point has any.
    """
    samples = [
        (weight, np.array(point_values, dtype=float))
        for weight, point_values in zip(weights, values, strict=True)
        if len(point_values)
    ]
    total_weight = sum(weight for weight, _ in samples)
    if not total_weight:
        return Estimate(math.nan, math.nan)
    mean = sum(weight * float(sample.mean()) for weight, sample in samples) / total_weight
    variance = sum(weight**2 * variance_of_mean(sample) for weight, sample in samples)
    return Estimate(mean, math.sqrt(variance / total_weight**2))


def share_over(weights: Sequence[float], counts: Sequence[tuple[int, int]]) -> Estimate:
    """Estimate the share of all shifts that do not miss, with the posterior's standard deviation.

    ``counts`` of misses and of shifts at each operating point, with the weak priors of
    ``sim.statistics.hangs``; ``weights`` of the points need not add up to one. A point without
    shifts is left out. NaN for share and standard error if no point has any.
    """
    samples = [(weight, *pair) for weight, pair in zip(weights, counts, strict=True) if pair[1]]
    total_weight = sum(weight for weight, *_ in samples)
    if not total_weight:
        return Estimate(math.nan, math.nan)
    share = 1.0
    variance = 0.0
    priors = weak_priors(len(samples))
    for prior, (weight, misses, shifts) in zip(priors, samples, strict=True):
        posterior = prior.posterior(misses, shifts)
        share -= weight / total_weight * posterior.mean
        variance += (weight / total_weight) ** 2 * posterior.variance
    return Estimate(share, math.sqrt(variance))


def time_quantile(
    weights: Sequence[float],
    shifts: Sequence[Sequence[ShiftResult]],
    share: float,
    timeout: float,
    retraction: float,
) -> Estimate:
    """Estimate the time within which the ``share`` of all shifts engages, s.

    ``weights`` of the operating points need not add up to one; ``shifts`` of each are in the order
    of their angles, and diverged ones are left out. ``timeout`` and ``retraction`` in s are the
    cost of a shift that does not engage.
    """
    point_shares = np.array(weights, dtype=float) / sum(weights)
    points = [_with_retries(point_shifts, timeout, retraction) for point_shifts in shifts]
    masses = []
    for point_share, point in zip(point_shares, points, strict=True):
        is_engaged = point.sizes > 0.0
        masses.append(point_share * point.sizes[is_engaged] / point.sizes.shape[1])
    engaged_times = [point.times[point.sizes > 0.0] for point in points]
    mass = np.concatenate(masses)
    probabilities, times = empirical_distribution(np.concatenate(engaged_times), mass / mass.sum())

    def quantile(probability: float) -> float:
        return float(np.interp(probability, probabilities, times))

    value = quantile(share)
    variances = [_share_variance(point, value) for point in points]
    if value >= times[-1]:  # no shift beyond: as of independent draws
        variances = [share * (1.0 - share) / len(point_shifts) for point_shifts in shifts]
    squares = zip(point_shares.tolist(), variances, strict=True)
    error = math.sqrt(sum(weight**2 * variance for weight, variance in squares))
    half_width = min(1.0, (probabilities[-1] - share) / error) if error > 0.0 else 1.0
    if half_width < MIN_HALF_WIDTH:
        return Estimate(value, value - quantile(share - error))
    width = quantile(share + half_width * error) - quantile(share - half_width * error)
    return Estimate(value, width / (2.0 * half_width))


class _Retries(NamedTuple):
    """Times of the shifts of an operating point at each try, with their sizes.

    Sizes add up to the number of shifts; they are 0 for shifts that did not engage.
    """

    times: Array  #: s, (tries, shifts)
    sizes: Array  #: (tries, shifts)


def _share_variance(point: _Retries, time: float) -> float:
    """Estimate the variance of the share of a point's shifts within ``time`` in s."""
    shares = np.where(point.times <= time, point.sizes, 0.0).sum(axis=0)
    return variance_of_mean(shares) if shares.size > 2 else 0.25 / shares.size


def _with_retries(shifts: Sequence[ShiftResult], timeout: float, retraction: float) -> _Retries:
    """Repeat the shifts of an operating point until nearly all engage.

    If none engages, each has the time-out, with a share of 1/(n + 1).
    """
    sound = [s for s in shifts if s.outcome is not Outcome.DIVERGED]
    times = np.array([np.nan if s.shift_time is None else s.shift_time for s in sound])
    engaged = np.isfinite(times)
    share = float(engaged.mean()) if sound else 0.0
    if not engaged.any():
        count = max(1, len(shifts))
        times = np.full(count, timeout)
        engaged = np.ones(count, bool)
        share = 1.0 / (count + 1)
    tries = 1 if share == 1.0 else math.ceil(math.log(RETRY_TAIL) / math.log1p(-share))
    retries: Array = np.arange(float(tries))[:, None]
    return _Retries(
        times=retries * (timeout + retraction) + np.where(engaged, times, 0.0),
        sizes=(1.0 - share) ** retries * (share * times.size / engaged.sum()) * engaged,
    )


def middles_of_jumps(phases: Array, times: Array, count: int) -> Array:
    r"""Compute the middles of the ``count`` intervals with the most likely jumps in time, (count,).

    With neighbours that continue their slopes, the jump in an interval of width :math:`h_k` and
    difference :math:`d_k` is :math:`r_k = \sqrt{|d_k - h_k d_{k-1}/h_{k-1}|\,|d_k - h_k
    d_{k+1}/h_{k+1}|}`; the largest :math:`h_k r_k` count. ``phases`` (n,) are fractions of a
    pitch in any order, ``times`` (n,) in s, NaN of shifts that did not engage.
    """
    course = _course_over_pitch(phases, times)
    jumps = np.sqrt(course.left_jumps * course.right_jumps)
    largest = np.argsort(-(course.widths * jumps), kind="stable")[:count]
    indices = np.sort(largest)
    return (course.phases[indices] + 0.5 * course.widths[indices]) % 1.0


def mean_round_the_pitch(phases: Array, times: Array) -> tuple[float, float]:
    r"""Compute the mean of the times over one pitch, s, and its variance, s2.

    By the trapezoidal rule (Davis & Rabinowitz 1984, ch. 6); a jump :math:`\rho_k` anywhere in its
    interval leaves :math:`s^2 = \sum_k h_k^2 \rho_k^2/12`. The jump is the smaller of those by the
    slopes of both neighbours. A shift that does not engage has the time of the next lower phase
    that does. Arguments as for ``middles_of_jumps``; both NaN if no shift engaged.
    """
    course = _course_over_pitch(phases, times)
    mean = float(course.widths @ (course.times[:-1] + course.times[1:])) / 2.0
    jumps = np.minimum(course.left_jumps, course.right_jumps)
    return mean, float(course.widths**2 @ jumps**2) / 12.0


class _Course(NamedTuple):
    """Times over the phases of a pitch, the first one repeated at the end."""

    phases: Array  #: sorted, (n,)
    widths: Array  #: of the intervals behind them, (n,)
    times: Array  #: s, (n + 1,)
    left_jumps: Array  #: jump in each interval by the slope of the interval before, s, (n,)
    right_jumps: Array  #: by the slope of the interval behind, s, (n,)


def _course_over_pitch(phases: Array, times: Array) -> _Course:
    """Sort the times over a pitch, fill those of shifts that did not engage, and measure jumps."""
    order = np.argsort(phases, kind="stable")
    sorted_phases = phases[order]
    values = times[order]
    engaged = np.isfinite(values)
    if engaged.any():
        last = np.maximum.accumulate(np.where(engaged, np.arange(len(values)), -1))
        values = values[np.where(last < 0, np.flatnonzero(engaged)[-1], last)]
    values = np.append(values, values[0])
    widths = np.diff(sorted_phases, append=sorted_phases[:1] + 1.0)
    differences = np.diff(values)
    slopes = differences / widths
    return _Course(
        sorted_phases,
        widths=widths,
        times=values,
        left_jumps=abs(differences - widths * np.roll(slopes, 1)),
        right_jumps=abs(differences - widths * np.roll(slopes, -1)),
    )
