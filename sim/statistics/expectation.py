r"""Expected shift time over the random relative angle and the operating points, and other numbers.

The angle is uniform over one pitch, sampled at *n* even angles with a random start that is common
to all designs. A shift that does not engage hangs and is tried again. The expected time is the mean
of engaged shifts and the time of retries, by the posterior of the probability of a hang
(``hangs``); the error of either is known on its own, and that of the mean is

.. math:: s^2 = \frac{\sum d_k^2}{12 n^2} + \frac{5 \hat\sigma^2}{6 n}, \quad
   \hat\sigma^2 = \max(0, -\overline{d_k d_{k+1}}),

:math:`d_k` being differences round the pitch: the variance of a saw-tooth and of scatter (Wolter
2007, ch. 8). A quantile of a single shift's time takes :math:`t + k (t_{timeout} + t_{retraction})`
with probability :math:`p (1-p)^k`; its error is Woodruff's (1952): from the quantiles at the share
plus and minus its standard error. A blocked shift that a ``SetPoint`` frees has a time of its own
and is not tried again.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from dogshape.sim.elementwise import Array, empirical_distribution
from dogshape.sim.shift.clutch import OperatingPoint
from dogshape.sim.shift.conclusion import Outcome
from dogshape.sim.statistics.hangs import HangPosterior, HangPrior, interval, weak_priors

FIRST_WINDOW_SHARE = 0.9  #: of the relative angles, up to the limit engagement speed (judged)
LEAST_ENGAGED = 0.5  #: share of an operating point's shifts from which it has a time (judged)
NO_TIME = "no expected shift time, as fewer than half engage at some operating point"


@dataclass(frozen=True)
class Estimate:
    """A number with its standard error, in the unit of its name."""

    value: float
    standard_error: float


@dataclass(frozen=True)
class ShiftResult:
    """Outcome and time of one shift in s (None if it failed), for an expectation."""

    outcome: Outcome
    shift_time: float | None
    rest: float | None = None  #: of a blocked one to the next slot ahead, rad


@dataclass(frozen=True)
class SetPoint:
    r"""Set-point of the relative speed that alternates about zero and frees a blocked shift.

    A drive that overcomes the friction of the faces, :math:`\mu_s F r`, makes the relative speed
    :math:`A \sin(2 \pi (t - t_0)/T)` from :math:`t_0` on, at first in the sense of the mismatch.
    The relative angle then has passed the rest :math:`u` of the overlap at

    .. math:: t_0 + \frac{T}{2 \pi} \arccos\left(1 - \frac{2 \pi u}{A T}\right), \qquad
       u \le \frac{A T}{\pi},

    and the ring falls into the slot; its fall, 3 to 12 ms if simulated, is left out. A larger rest
    is never passed.
    """

    amplitude: float = 0.0  #: rad/s; 0 frees nothing
    period: float = 1.0  #: s
    start: float = 0.0  #: s from the command

    def passages(self, overlaps: Array) -> Array:
        """Compute the times from the command to the passage of overlaps in rad, (n,), s or NaN."""
        swing = self.amplitude * self.period / math.pi
        shares = np.where(overlaps <= swing, overlaps / (swing or 1.0), np.nan)
        return self.start + self.period / (2.0 * math.pi) * np.arccos(1.0 - 2.0 * shares)

    def freed(self, shifts: Sequence[ShiftResult]) -> list[ShiftResult]:
        """Give each blocked shift the time at which it is freed; it remains ``Outcome.BLOCKED``."""
        if self.amplitude == 0.0:
            return list(shifts)
        rests = np.array([np.nan if s.rest is None else s.rest for s in shifts])
        pairs = zip(shifts, self.passages(rests).tolist(), strict=True)
        return [s if math.isnan(time) else replace(s, shift_time=time) for s, time in pairs]


@dataclass(frozen=True)
class PointExpectation:
    """Expected shift time at one operating point, s."""

    point: OperatingPoint
    engaged_mean: float  #: of shifts that engage or are freed; the time-out where none does
    engaged_error: float  #: its standard error, NaN for fewer than three shifts
    mean_engaged: float | None  #: without those that are freed; None where no shift engaged
    sd: float
    engaged: float  #: share at the first try
    n: int
    retry_cost: float  #: of a shift that hangs
    hang: HangPosterior  #: probability that a shift hangs
    blocked: int = 0  #: number that stood still dog on dog, held by friction
    freed: int = 0  #: number of these that a set-point freed
    by_angle: Sequence[Sequence[int]] = ()  #: of ``entries_by_angle``
    prior: HangPrior | None = None  #: of the probability of a hang
    #: number that engaged without being carried past a slot; None where the shifts do not tell
    first_window: int | None = None
    direct_share: float | None = None  #: of ``sim.statistics.shiftability``

    @property
    def hangs(self) -> int:
        """Number of the shifts that are tried again."""
        return self.lost - self.freed

    @property
    def silent(self) -> bool:
        """Whether no shift tells a time: retries then count as one in n + 1 that engages."""
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

    def under(self, prior: HangPrior) -> PointExpectation:
        """Return the expectation by another prior of the probability of a hang."""
        return replace(self, hang=prior.posterior(self.hangs, self.n), prior=prior)

    @property
    def timed(self) -> float:
        """Share of the shifts that engage at the first try or freed by the set-point."""
        return self.engaged + self.freed / max(1, self.n)

    @property
    def lost(self) -> int:
        """Number of the shifts that did not engage at the first try."""
        return self.n - round(self.engaged * self.n)

    @property
    def engages(self) -> bool:
        """Whether enough of the shifts engage for an expected time."""
        return self.timed >= LEAST_ENGAGED

    @property
    def time(self) -> float | None:
        """Expected shift time, s; None where too few shifts engage."""
        return self.mean if self.engages else None


@dataclass(frozen=True)
class Expectation:
    """Expected shift time over all operating points, weighted, s."""

    points: tuple[PointExpectation, ...]
    numerical_error: float | None = None  #: by repeating some shifts with a far smaller tolerance
    #: of the time of all shifts of the mix, by their share, retries included
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

    @property
    def hang_probability(self) -> float:
        """Posterior mean of the probability that a shift hangs."""
        return self._weighted([p.hang.mean for p in self.points])

    @property
    def hang_interval(self) -> tuple[float, float]:
        """Interval of that probability, 95 %."""
        variance = self.weights**2 @ np.array([p.hang.variance for p in self.points])
        return interval(self.hang_probability, float(variance))

    @property
    def hangs(self) -> int:
        """Number of the shifts that are tried again."""
        return sum(p.hangs for p in self.points)

    @property
    def hang_counts(self) -> list[tuple[int, int]]:
        """Numbers of hangs and shifts by operating point."""
        return [(point.hangs, point.n) for point in self.points]

    def under(self, priors: Sequence[HangPrior]) -> Expectation:
        """Return the expectation by other priors, one for each operating point."""
        pairs = zip(self.points, priors, strict=True)
        return replace(self, points=tuple(point.under(prior) for point, prior in pairs))

    @property
    def relative_error(self) -> float:
        """Standard error of the mean of engaged shifts over that mean."""
        return self.engaged_error / self.engaged_mean

    @property
    def engages(self) -> bool:
        """Whether at every operating point enough of the shifts engage for an expected time."""
        return all(p.engages for p in self.points)

    @property
    def time(self) -> float | None:
        """Expected shift time, s; None where too few shifts engage somewhere."""
        return self.mean if self.engages else None

    @property
    def losses(self) -> str:
        """Count the shifts that did not engage by cause, with what frees those that are held."""
        words = f"{self.lost} of {self.shifts} shifts did not engage"
        late, freed = self.lost - self.blocked, sum(point.freed for point in self.points)
        if self.blocked:
            words += f": {self.blocked} held dog on dog by friction"
            words += f" ({freed} of these freed by the alternating set-point)" if freed else ""
        if late:
            words += f"{',' if self.blocked else ':'} {late} short of full depth at the time-out"
        if self.engages or not self.blocked:
            return words
        return f"{words}; a larger chamfer, mismatch or sliding.inertia_kgm2 frees those held"

    @property
    def mean_engaged(self) -> float | None:
        """Weighted mean without retries, s; None where at some operating point none engaged.

        One hung shift in some hundreds moves ``mean`` by milliseconds and this one hardly.
        """
        total = sum(p.point.weight for p in self.points)
        if None in (p.mean_engaged for p in self.points):
            return None
        return sum(p.point.weight / total * (p.mean_engaged or 0.0) for p in self.points)

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
    """Return ``count`` fractions of a pitch in [0, 1), evenly spaced from a random start, (count,).

    Each operating point has an ``index``, and so angles of its own and an independent error. Where
    ``count`` is a multiple of ``base``, the result holds the ``base`` fractions of the same draw.
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
    n = sum(s.outcome is not Outcome.DIVERGED for s in shifts)
    held = [s.shift_time for s in shifts if s.outcome is Outcome.BLOCKED]
    blocked, freed = len(held), sum(time is not None for time in held)
    times = np.array([s.shift_time for s in shifts if s.shift_time is not None], dtype=float)
    lost = timeout + retraction
    (prior,) = weak_priors(1)
    hang = prior.posterior(n - times.size, n)
    if times.size == 0:
        return PointExpectation(
            point,
            engaged_mean=timeout,
            engaged_error=0.0,
            mean_engaged=None,
            sd=0.0,
            engaged=0.0,
            n=n,
            retry_cost=lost,
            hang=hang,
            blocked=blocked,
            prior=prior,
        )
    variance = variance_of_mean(times, even=even and times.size == n)
    kept = [s.shift_time for s in shifts if s.outcome is not Outcome.BLOCKED and s.shift_time]
    return PointExpectation(
        point,
        engaged_mean=float(times.mean()),
        engaged_error=math.sqrt(variance) if len(shifts) > 2 else math.nan,
        mean_engaged=float(np.mean(kept)) if kept else None,
        sd=float(times.std(ddof=1)) if times.size > 1 else 0.0,
        engaged=len(kept) / n,
        n=n,
        retry_cost=lost,
        hang=hang,
        blocked=blocked,
        freed=freed,
        prior=prior,
    )


def variance_of_mean(times: Array, *, even: bool = True) -> float:
    """Return the variance of the mean of times (n,) in the order of their angles, s2."""
    n = times.size
    if n < 3:
        return float(times.mean() ** 2 / n)  # two times that agree by luck would look exact
    if even:
        steps = np.roll(times, -1) - times
        scatter = max(0.0, -float((steps * np.roll(steps, -1)).mean()))
        return float((steps**2).sum()) / (12.0 * n * n) + 5.0 * scatter / (6.0 * n)
    return float(times.var(ddof=1) / n)


def expect(
    points: Sequence[PointExpectation], priors: Sequence[HangPrior] | None = None
) -> Expectation:
    """Return the weighted expectation over operating points with independent errors.

    ``priors`` of the probability of a hang, one for each point; ``weak_priors`` by default.
    """
    return Expectation(tuple(points)).under(priors or weak_priors(len(points)))


TAIL = 1e-6  #: of a point's weight, left out of its retries
LEAST = 0.5  #: standard errors of the share to either side that give an error, where 1 is too wide


def mean_over(weights: Sequence[float], values: Sequence[Sequence[float]]) -> Estimate:
    """Return the mean over operating points of ``values`` in the order of their angles.

    ``weights`` of the points need not add up to one; a point without values is left out. NaN, and
    its standard error too, where no point has any.
    """
    pairs = [(w, np.array(v, dtype=float)) for w, v in zip(weights, values, strict=True) if len(v)]
    total = sum(weight for weight, _ in pairs)
    if not total:
        return Estimate(math.nan, math.nan)
    mean = sum(weight * float(v.mean()) for weight, v in pairs) / total
    variance = sum(weight**2 * variance_of_mean(v) for weight, v in pairs)
    return Estimate(mean, math.sqrt(variance / total**2))


def share_over(weights: Sequence[float], counts: Sequence[tuple[int, int]]) -> Estimate:
    """Estimate the share of all shifts that do not miss, with the posterior's standard deviation.

    ``counts`` of misses and of shifts at each operating point, with the weak priors of
    ``sim.statistics.hangs``; ``weights`` of the points need not add up to one. A point without
    shifts is left out. NaN, and its standard error too, where no point has any.
    """
    known = [(weight, *pair) for weight, pair in zip(weights, counts, strict=True) if pair[1]]
    total = sum(weight for weight, *_ in known)
    if not total:
        return Estimate(math.nan, math.nan)
    share, variance = 1.0, 0.0
    for prior, (weight, misses, shifts) in zip(weak_priors(len(known)), known, strict=True):
        posterior = prior.posterior(misses, shifts)
        share -= weight / total * posterior.mean
        variance += (weight / total) ** 2 * posterior.variance
    return Estimate(share, math.sqrt(variance))


def time_quantile(
    weights: Sequence[float],
    shifts: Sequence[Sequence[ShiftResult]],
    share: float,
    timeout: float,
    retraction: float,
) -> Estimate:
    """Return the time within which the ``share`` of all shifts engages, s.

    ``weights`` of the operating points need not add up to one; ``shifts`` of each are in the order
    of their angles, and those whose integration failed are left out. ``timeout`` and ``retraction``
    in s are the cost of a shift that does not engage.
    """
    parts = np.array(weights, dtype=float) / sum(weights)
    points = [_with_retries(mine, timeout, retraction) for mine in shifts]
    times = np.concatenate([times[sizes > 0.0] for times, sizes in points])
    sized = zip(parts, (sizes for _, sizes in points), strict=True)
    masses = np.concatenate([w * sizes[sizes > 0.0] / sizes.shape[1] for w, sizes in sized])
    places, times = empirical_distribution(times, masses / masses.sum())

    def at(wanted: float) -> float:
        return float(np.interp(wanted, places, times))

    value = at(share)
    below = [np.where(tries <= value, sizes, 0.0).sum(axis=0) for tries, sizes in points]
    variances = [variance_of_mean(one) if one.size > 2 else 0.25 / one.size for one in below]
    if value >= times[-1]:  # no shift beyond: as if each had been drawn by chance
        variances = [share * (1.0 - share) / len(mine) for mine in shifts]
    error = math.sqrt(sum(w**2 * v for w, v in zip(parts.tolist(), variances, strict=True)))
    half = min(1.0, (places[-1] - share) / error) if error > 0.0 else 1.0
    if half < LEAST:
        return Estimate(value, value - at(share - error))
    return Estimate(value, (at(share + half * error) - at(share - half * error)) / (2.0 * half))


def _with_retries(
    shifts: Sequence[ShiftResult], timeout: float, retraction: float
) -> tuple[Array, Array]:
    """Return times, s, of each try and shift, and their sizes, (tries, shifts).

    Sizes add up to the number of shifts, 0 for those that did not engage. Where none did, each has
    the time-out, with a share of 1/(n + 1).
    """
    sound = [s for s in shifts if s.outcome is not Outcome.DIVERGED]
    times = np.array([np.nan if s.shift_time is None else s.shift_time for s in sound])
    engaged = np.isfinite(times)
    share = float(engaged.mean()) if sound else 0.0
    if not engaged.any():
        count = max(1, len(shifts))
        times, engaged, share = np.full(count, timeout), np.ones(count, bool), 1.0 / (count + 1)
    tries = 1 if share == 1.0 else math.ceil(math.log(TAIL) / math.log1p(-share))
    again: Array = np.arange(float(tries))[:, None]
    sizes: Array = (1.0 - share) ** again * (share * times.size / engaged.sum()) * engaged
    tried: Array = again * (timeout + retraction) + np.where(engaged, times, 0.0)
    return tried, sizes


def halves(phases: Array, times: Array, count: int) -> Array:
    r"""Return the middles of the ``count`` intervals in which the time most likely jumps, (count,).

    With neighbours that go on as their slopes do, the jump in an interval of width :math:`h_k` and
    difference :math:`d_k` is :math:`r_k = \sqrt{|d_k - h_k d_{k-1}/h_{k-1}|\,|d_k - h_k
    d_{k+1}/h_{k+1}|}`; the largest :math:`h_k r_k` count. ``phases`` (n,) are fractions of a
    pitch in any order, ``times`` (n,) in s, NaN of shifts that did not engage.
    """
    places, widths, _, below, above = _round_the_pitch(phases, times)
    chosen = np.sort(np.argsort(-(widths * np.sqrt(below * above)), kind="stable")[:count])
    return (places[chosen] + 0.5 * widths[chosen]) % 1.0


def mean_round_the_pitch(phases: Array, times: Array) -> tuple[float, float]:
    r"""Return the mean of the times over one pitch, s, and its variance, s2.

    By the trapezoidal rule (Davis & Rabinowitz 1984, ch. 6); a jump anywhere in its interval leaves
    :math:`s^2 = \sum_k h_k^2 \rho_k^2/12`, :math:`\rho_k` the smaller factor of :math:`r_k`. A
    shift that does not engage stands for the next one below it that does. Arguments as for
    ``halves``; NaN both where no shift engaged.
    """
    _, widths, values, below, above = _round_the_pitch(phases, times)
    mean = float(widths @ (values[:-1] + values[1:])) / 2.0
    return mean, float(widths**2 @ np.minimum(below, above) ** 2) / 12.0


def _round_the_pitch(phases: Array, times: Array) -> tuple[Array, Array, Array, Array, Array]:
    """Return phases in order and widths (n,), times (n + 1,), both factors of the jumps (n,)."""
    order = np.argsort(phases, kind="stable")
    places, values = phases[order], times[order]
    engaged = np.isfinite(values)
    if engaged.any():
        last = np.maximum.accumulate(np.where(engaged, np.arange(len(values)), -1))
        values = values[np.where(last < 0, np.flatnonzero(engaged)[-1], last)]
    widths, values = np.diff(places, append=places[:1] + 1.0), np.append(values, values[0])
    differences = np.diff(values)
    slopes = differences / widths
    below, above = (abs(differences - widths * np.roll(slopes, way)) for way in (1, -1))
    return places, widths, values, below, above
