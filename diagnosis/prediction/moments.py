"""Timely and late shifts, and moments of shift times at relative angles that count by weights.

Timely shifts also part into two modes where the variance within both is least (Otsu 1979, IEEE
Trans. Syst. Man Cybern. 9). That is compiled: a diagnosis parts the angles of a million means.
"""

# mypy: disable-error-code="no-untyped-def"

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from dogshape.diagnosis.terms import Array
from dogshape.sim.kernel.compiler import compiled

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


class AngleErrors(NamedTuple):
    """Errors by weights of the angles at m rows of weights, (m,) each."""

    inverse_square: Array  #: 1 / squared number of angles that count
    variance: Array  #: squared error of the mean, over the variance of the shifts


class _SimulatedAngles(NamedTuple):
    """Angles of n benches that were simulated, by p patterns."""

    patterns: Array  #: 1 for a simulated angle, else 0, (C, A, p)
    bench_patterns: Array  #: 1 for the pattern of a bench, else 0, (n, p)


@dataclass(frozen=True)
class Angles:
    """Shift times of n benches at C operating points and A relative angles, NaN where unknown."""

    times: Array  #: s, (n, C, A)
    is_late: np.ndarray  #: (n, C, A)

    @cached_property
    def _values(self) -> Array:
        """Values that are summed over the angles, (C, VALUES, A, n); deviations are from means."""
        is_engaged = np.isfinite(self.times)
        is_timely = is_engaged & ~self.is_late
        deviation = np.where(is_timely, self.times - self._mean[..., None], 0.0)
        is_simulated = ~np.isnan(self.times)
        values = [is_timely, is_engaged, is_simulated, deviation, deviation**2]
        return np.ascontiguousarray(np.moveaxis(np.array(values, dtype=float), (0, 1), (1, 3)))

    @cached_property
    def _mean(self) -> Array:
        """Mean of the timely shifts at even angles, s, (n, C)."""
        is_timely = np.isfinite(self.times) & ~self.is_late
        total = np.where(is_timely, self.times, 0.0).sum(axis=-1)
        return np.asarray(total / np.maximum(is_timely.sum(axis=-1), 1.0))

    @cached_property
    def _even_moments(self) -> Array:
        """Moments at even angles, (C, MOMENTS, 1, n)."""
        even_weights = np.ones((1, self.times.shape[2]))
        cells = range(self.times.shape[1])
        return np.array([self._moments(cell, even_weights) for cell in cells])

    @cached_property
    def _simulated(self) -> _SimulatedAngles:
        """Simulated angles, which most benches share."""
        is_simulated = ~np.isnan(self.times)
        patterns, index = np.unique(is_simulated, axis=0, return_inverse=True)
        return _SimulatedAngles(
            patterns=np.ascontiguousarray(np.moveaxis(patterns, 0, -1), dtype=float),
            bench_patterns=np.eye(len(patterns))[index.ravel()],
        )

    def changes(self, cell: int, weights: Array, bench_shares: Array) -> Array:
        """Sum the changes of the moments from even angles over the benches, (m, MOMENTS).

        Parameters
        ----------
        cell : index of the operating point
        weights : (m, A), of the angles
        bench_shares : (m, n), of the changes of each bench
        """
        change = self._moments(cell, weights) - self._even_moments[cell]
        return np.einsum("kmn,mn->mk", change, bench_shares)

    def errors(self, cell: int, weights: Array, bench_shares: Array) -> AngleErrors:
        """Compute the errors of ``changes`` by the number of angles that count."""
        patterns = self._simulated.patterns[cell]
        squares = np.maximum(weights**2 @ patterns, MIN_WEIGHT)
        count = np.maximum(weights @ patterns, MIN_WEIGHT) ** 2 / squares
        square_shares = bench_shares**2 @ self._simulated.bench_patterns
        error = EVEN_ERROR * count**-EVEN_POWER
        return AngleErrors(
            inverse_square=(square_shares / count**2).sum(axis=1),
            variance=(square_shares * error**2).sum(axis=1),
        )

    def _moments(self, cell: int, weights: Array) -> Array:
        """Compute the moments of all benches at an operating point, (MOMENTS, m, n).

        ``weights`` are (m, A); the kurtosis is that of the modes and stays 0 here.
        """
        sums = weights @ self._values[cell]
        timely, engaged, simulated = np.maximum(sums[: SIMULATED + 1], MIN_WEIGHT)
        deviation = sums[DEVIATION] / timely
        variance = np.maximum(sums[SQUARED_DEVIATION] / timely - deviation**2, MIN_SD_S**2)
        engaged_share = np.clip(engaged / simulated, 0.01, 0.99)
        moments = np.empty((MOMENTS, *deviation.shape))
        moments[LOG_MEAN] = np.log(np.maximum(self._mean[:, cell] + deviation, MIN_SD_S))
        moments[LOG_SD] = 0.5 * np.log(variance)
        moments[LATE_SHARE] = 1.0 - timely / engaged
        moments[ENGAGED_LOGIT] = np.log(engaged_share / (1.0 - engaged_share))
        moments[LOG_KURTOSIS] = 0.0
        return moments


class Modes(NamedTuple):
    """Two modes of timely shifts, an array each."""

    minor_share: Array  #: share of the smaller mode, 1 where there are no modes
    main_mean: Array  #: mean of the larger mode over that of all
    main_sd: Array  #: standard deviation of the larger mode over that of all
    kurtosis: Array  #: excess kurtosis of all


def modes_of(times: Array, is_timely: np.ndarray, weights: Array) -> Modes:
    """Part ascending times (A,) into two modes by weights (m, A) of their angles, (m,) each."""
    modes = np.empty((len(weights), 4))
    _fill_modes(times, is_timely, weights, modes)
    return Modes(*modes.T)


@compiled
def _fill_modes(times, is_timely, weights, modes):
    """Fill the modes (m, 4) of all rows of weights."""
    for row in range(weights.shape[0]):
        _split_modes(weights[row], times, is_timely, modes[row])


@compiled
def _split_modes(weights, times, is_timely, modes):
    """Fill the four fields of ``Modes`` for one row of weights."""
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
