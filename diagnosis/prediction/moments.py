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
from scipy.special import logit

from dogshape.diagnosis.terms import Array
from dogshape.sim.kernel import compiled

#: Places of the moments in the last axis of an array of moments, (..., MOMENTS).
LOG_MEAN = 0  #: ln mean of the timely shifts, ln s
LOG_SD = 1  #: ln standard deviation of the timely shifts, ln s
LATE_SHARE = 2  #: late shifts over those that engage
ENGAGED_LOGIT = 3  #: logit of the share that engages
LOG_KURTOSIS = 4  #: ln kurtosis of the timely shifts
MOMENTS = 5

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


@dataclass(frozen=True)
class Angles:
    """Shift times of n benches at C operating points and A relative angles, NaN where unknown."""

    times: Array  #: s, (n, C, A)
    is_late: np.ndarray  #: (n, C, A)

    @cached_property
    def _is_timely(self) -> Array:
        """1 for timely shifts, else 0, (n, C, A)."""
        return 1.0 * (np.isfinite(self.times) & ~self.is_late)

    @cached_property
    def _is_engaged(self) -> Array:
        """1 for shifts that engage, else 0, (n, C, A)."""
        return 1.0 * np.isfinite(self.times)

    @cached_property
    def _is_simulated(self) -> Array:
        """1 for shifts that were simulated, else 0, (n, C, A)."""
        return 1.0 * ~np.isnan(self.times)

    @cached_property
    def _mean(self) -> Array:
        """Mean of the timely shifts at even angles, s, (n, C)."""
        total = np.where(self._is_timely, self.times, 0.0).sum(axis=-1)
        return np.asarray(total / np.maximum(self._is_timely.sum(axis=-1), 1.0))

    @cached_property
    def _deviation(self) -> Array:
        """Deviation of each timely shift from their mean, 0 for others, s, (n, C, A)."""
        return np.where(self._is_timely > 0.0, self.times - self._mean[..., None], 0.0)

    @cached_property
    def _even_moments(self) -> Array:
        """Moments at even angles, (1, n, C, MOMENTS)."""
        return self._moments(np.ones((1, *self.times.shape[1:])))

    def _moments(self, weights: Array) -> Array:
        """Compute moments by weights (m, C, A), (m, n, C, MOMENTS)."""
        timely = np.maximum(_sum_angles(weights, self._is_timely), MIN_WEIGHT)
        engaged = np.maximum(_sum_angles(weights, self._is_engaged), MIN_WEIGHT)
        simulated = np.maximum(_sum_angles(weights, self._is_simulated), MIN_WEIGHT)
        first = _sum_angles(weights, self._deviation) / timely
        second = _sum_angles(weights, self._deviation**2) / timely
        mean = np.maximum(self._mean + first, MIN_SD_S)
        variance = np.maximum(second - first**2, MIN_SD_S**2)
        moments = np.zeros((*mean.shape, MOMENTS))  # kurtosis is that of the modes
        moments[..., LOG_MEAN] = np.log(mean)
        moments[..., LOG_SD] = 0.5 * np.log(variance)
        moments[..., LATE_SHARE] = 1.0 - timely / engaged
        moments[..., ENGAGED_LOGIT] = logit(np.clip(engaged / simulated, 0.01, 0.99))
        return moments

    def changes(self, weights: Array) -> tuple[Array, Array]:
        """Compute changes of the moments by weights (m, C, A) of the angles.

        Returns
        -------
        changes : (m, n, C, MOMENTS), from the moments at even angles
        count : (m, n, C), number of even angles with the same information
        """
        total = _sum_angles(weights, self._is_simulated)
        squares = _sum_angles(weights**2, self._is_simulated)
        count = total**2 / np.maximum(squares, MIN_WEIGHT)
        return self._moments(weights) - self._even_moments, count


def _sum_angles(weights: Array, values: Array) -> Array:
    """Sum values (n, C, A) by weights (m, C, A) over the angles, (m, n, C)."""
    return np.moveaxis(weights.swapaxes(0, 1) @ values.transpose(1, 2, 0), 0, -1)


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
