"""Timely and late shifts, and moments of shift times at relative angles that count by weights.

Timely shifts also part into two modes where the variance within both is least (Otsu 1979, IEEE
Trans. Syst. Man Cybern. 9). That is compiled: a diagnosis parts the angles of a million means.
"""

# mypy: disable-error-code="no-untyped-def"

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from dogshape.diagnosis.terms import Array
from dogshape.sim.kernel.compiler import compiled, inlined, making

#: Places of the moments in the last axis of an array of moments, (..., MOMENTS).
LOG_MEAN = 0  #: ln mean of the timely shifts, ln s
LOG_SD = 1  #: ln standard deviation of the timely shifts, ln s
LATE_SHARE = 2  #: late shifts over those that engage
ENGAGED_LOGIT = 3  #: logit of the share that engages
LOG_KURTOSIS = 4  #: ln kurtosis of the timely shifts
MOMENTS = 5

#: Places of the values that are summed over the angles of a bench.
TIMELY = 0  #: 1 for timely shifts, else 0
ENGAGED = 1  #: 1 for shifts that engage, else 0
SIMULATED = 2  #: 1 for shifts that were simulated, else 0
DEVIATION = 3  #: of a timely shift from their mean, 0 for others, s
SQUARED_DEVIATION = 4  #: s^2
VALUES = 5
SQUARED_WEIGHT = 5  #: place of the sum of squared weights of simulated shifts

EVEN_ERROR = 0.8  #: of the mean of one angle over the deviation (measured)
EVEN_POWER = 0.8  #: of the number of even angles, with which that error falls (measured)
LATE_DISTANCES = 8.0  #: distances of the 10 % quantile behind the median, from which it is late
MIN_SD_S = 5e-4  #: s, resolution of a shift time
MIN_WEIGHT = 1e-9  #: sum of weights to divide by


def mark_late(times: Array, min_delay: Array) -> np.ndarray:
    """Mark late shifts among times of operating points, s, (..., C, n).

    A late shift lies behind the median by ``min_delay`` (C,), s, and by ``LATE_DISTANCES``
    distances of the 10 % quantile from it: the fast side does not move with late shifts.
    """
    fast, median = quantiles(times, (0.1, 0.5))
    delay = np.maximum(LATE_DISTANCES * (median - fast), min_delay)
    return np.isfinite(times) & (times > (median + delay)[..., None])


def quantiles(times: Array, shares: Sequence[float]) -> list[Array]:
    """Compute quantiles of the shifts that engage, s, (...) for each share.

    ``times`` are (..., n); a quantile is 0 where no shift engages.
    """
    engaged = np.isfinite(times)
    count = engaged.sum(axis=-1)
    filler = np.where(count == 0, 0.0, np.inf)[..., None]
    ordered = np.sort(np.where(engaged, times, filler), axis=-1)
    last = np.maximum(count - 1, 0)
    values = []
    for share in shares:
        lower = np.floor(share * last).astype(int)
        upper = np.minimum(lower + 1, last)
        low = np.take_along_axis(ordered, lower[..., None], -1)[..., 0]
        high = np.take_along_axis(ordered, upper[..., None], -1)[..., 0]
        values.append(np.asarray(low + (share * last - lower) * (high - low)))
    return values


def mask_late(times: Array, min_delay: Array) -> Array:
    """Replace times of late shifts and of shifts that did not engage by NaN, (..., C, n)."""
    return np.where(np.isfinite(times) & ~mark_late(times, min_delay), times, np.nan)


class WeightedChanges(NamedTuple):
    """Changes of the moments by weights of the angles, at m rows of weights and C points."""

    moments: Array  #: sum over the benches, (m, C, MOMENTS)
    inverse_squares: Array  #: 1 / squared number of angles that count, (m, C)
    #: Squared error of the mean by angles, over the deviation, (m, C).
    angle_variance: Array


@dataclass(frozen=True)
class Angles:
    """Shift times of n benches at C operating points and A relative angles, NaN where unknown."""

    times: Array  #: s, (n, C, A)
    is_late: np.ndarray  #: (n, C, A)

    @cached_property
    def _values(self) -> Array:
        """Values that are summed over the angles, (C, A, VALUES, n); deviations are from means."""
        is_engaged = np.isfinite(self.times)
        is_timely = is_engaged & ~self.is_late
        deviation = np.where(is_timely, self.times - self._mean[..., None], 0.0)
        is_simulated = ~np.isnan(self.times)
        values = [is_timely, is_engaged, is_simulated, deviation, deviation**2]
        return np.ascontiguousarray(np.moveaxis(np.array(values, dtype=float), (0, 1), (2, 3)))

    @cached_property
    def _mean(self) -> Array:
        """Mean of the timely shifts at even angles, s, (n, C)."""
        is_timely = np.isfinite(self.times) & ~self.is_late
        total = np.where(is_timely, self.times, 0.0).sum(axis=-1)
        return np.asarray(total / np.maximum(is_timely.sum(axis=-1), 1.0))

    @cached_property
    def _even_moments(self) -> Array:
        """Moments at even angles, (C, n, MOMENTS)."""
        bench_count, cell_count, angle_count = self.times.shape
        weights = np.ones((1, cell_count, angle_count))
        no_moments = np.zeros((cell_count, bench_count, MOMENTS))
        rows = [
            self._sum(weights, share[None], no_moments).moments[0] for share in np.eye(bench_count)
        ]
        return np.ascontiguousarray(np.moveaxis(np.array(rows), 0, 1))

    def changes(self, weights: Array, bench_shares: Array) -> WeightedChanges:
        """Sum the changes of the moments from even angles over the benches.

        Parameters
        ----------
        weights : (m, C, A), of the angles
        bench_shares : (m, n), of the changes of each bench
        """
        return self._sum(weights, bench_shares, self._even_moments)

    def _sum(self, weights: Array, bench_shares: Array, even_moments: Array) -> WeightedChanges:
        """Sum the moments less ``even_moments`` (C, n, MOMENTS) over the benches."""
        shape = weights.shape[:2]
        changes = WeightedChanges(
            moments=np.zeros((*shape, MOMENTS)),  # kurtosis is that of the modes
            inverse_squares=np.zeros(shape),
            angle_variance=np.zeros(shape),
        )
        benches = _Benches(self._values, np.ascontiguousarray(self._mean.T), even_moments)
        _sum_changes(
            np.ascontiguousarray(weights), np.ascontiguousarray(bench_shares), benches, changes
        )
        return changes


class _Benches(NamedTuple):
    """Values of n benches that weights of the angles sum."""

    values: Array  #: (C, A, VALUES, n)
    means: Array  #: of the timely shifts at even angles, s, (C, n)
    even_moments: Array  #: from which changes count, (C, n, MOMENTS)


@making
def _sum_changes(weights, bench_shares, benches, changes):
    """Fill the changes by weights (m, C, A) and shares (m, n) of the benches."""
    sums = np.empty((VALUES + 1, bench_shares.shape[1]))
    for row in range(weights.shape[0]):
        for cell in range(weights.shape[1]):
            _sum_angles(weights[row, cell], benches.values[cell], sums)
            _add_changes((row, cell), bench_shares[row], sums, benches, changes)


@compiled
def _sum_angles(weights, values, sums):
    """Sum the values (A, VALUES, n) of one operating point by weights (A,) over the angles."""
    sums[:] = 0.0
    for k in range(len(weights)):
        weight = weights[k]
        for value in range(VALUES):
            for bench in range(sums.shape[1]):
                sums[value, bench] += weight * values[k, value, bench]
        for bench in range(sums.shape[1]):
            sums[SQUARED_WEIGHT, bench] += weight * weight * values[k, SIMULATED, bench]


@inlined
def _add_changes(place, shares, sums, benches, changes):
    """Add the changes of all benches, by shares (n,), at a row and operating point."""
    cell = place[1]
    moments = changes.moments[place]
    for bench in range(len(shares)):
        even = benches.even_moments[cell, bench]
        timely = max(sums[TIMELY, bench], MIN_WEIGHT)
        engaged = max(sums[ENGAGED, bench], MIN_WEIGHT)
        simulated = max(sums[SIMULATED, bench], MIN_WEIGHT)
        first = sums[DEVIATION, bench] / timely
        variance = max(sums[SQUARED_DEVIATION, bench] / timely - first**2, MIN_SD_S**2)
        engaged_share = min(max(engaged / simulated, 0.01), 0.99)
        engaged_logit = math.log(engaged_share / (1.0 - engaged_share))
        log_mean = math.log(max(benches.means[cell, bench] + first, MIN_SD_S))
        moments[LOG_MEAN] += shares[bench] * (log_mean - even[LOG_MEAN])
        moments[LOG_SD] += shares[bench] * (0.5 * math.log(variance) - even[LOG_SD])
        moments[LATE_SHARE] += shares[bench] * (1.0 - timely / engaged - even[LATE_SHARE])
        moments[ENGAGED_LOGIT] += shares[bench] * (engaged_logit - even[ENGAGED_LOGIT])
        count = sums[SIMULATED, bench] ** 2 / max(sums[SQUARED_WEIGHT, bench], MIN_WEIGHT)
        error = EVEN_ERROR * count**-EVEN_POWER
        changes.inverse_squares[place] += (shares[bench] / count) ** 2
        changes.angle_variance[place] += (shares[bench] * error) ** 2


class Modes(NamedTuple):
    """Two modes of timely shifts at m rows of weights and C operating points, (m, C) each."""

    minor_share: Array  #: share of the smaller mode, 1 where there are no modes
    main_mean: Array  #: mean of the larger mode over that of all
    main_sd: Array  #: standard deviation of the larger mode over that of all
    kurtosis: Array  #: excess kurtosis of all


def modes_of(times: Array, is_timely: np.ndarray, weights: Array) -> Modes:
    """Part ascending times (C, A) into two modes by weights (m, C, A) of their angles."""
    modes = np.empty((*weights.shape[:2], 4))
    _fill_modes(times, is_timely, np.ascontiguousarray(weights), modes)
    return Modes(*np.moveaxis(modes, -1, 0))


@compiled
def _fill_modes(times, is_timely, weights, modes):
    """Fill the modes (m, C, 4) of all rows and operating points."""
    for row in range(weights.shape[0]):
        for cell in range(weights.shape[1]):
            _split_modes(weights[row, cell], times[cell], is_timely[cell], modes[row, cell])


@compiled
def _split_modes(weights, times, is_timely, modes):
    """Fill the four fields of ``Modes`` for one row and operating point."""
    total_weight = 0.0
    time_sum = 0.0
    for k in range(len(times)):
        if is_timely[k]:
            total_weight += weights[k]
            time_sum += weights[k] * times[k]
    total_weight = max(total_weight, MIN_WEIGHT)
    mean = time_sum / total_weight
    # Sums about the mean of all: of all times up to one, and of the lower mode.
    weight = first = second = fourth = 0.0
    mode_weight = mode_first = mode_second = max_between = 0.0
    for k in range(len(times)):
        if is_timely[k]:
            deviation = times[k] - mean
            weight += weights[k]
            first += weights[k] * deviation
            second += weights[k] * deviation**2
            fourth += weights[k] * deviation**4
            upper_weight = max(total_weight - weight, MIN_WEIGHT)
            between_variance = first * first * (1.0 / max(weight, MIN_WEIGHT) + 1.0 / upper_weight)
            if between_variance > max_between:
                max_between = between_variance
                mode_weight = weight
                mode_first = first
                mode_second = second
    if mode_weight < 0.5 * total_weight:  # the upper mode is the larger one
        mode_weight = total_weight - mode_weight
        mode_first = -mode_first
        mode_second = second - mode_second
    mode_weight = max(mode_weight, MIN_WEIGHT)
    variance = max(second / total_weight, MIN_SD_S**2)
    mode_variance = max(mode_second / mode_weight - (mode_first / mode_weight) ** 2, 0.0)
    modes[0] = max(1.0 - mode_weight / total_weight, 0.0)
    modes[1] = 1.0 + mode_first / mode_weight / max(mean, MIN_SD_S)
    modes[2] = (mode_variance / variance) ** 0.5
    modes[3] = fourth / total_weight / variance**2 - 3.0
