"""Baseline of a clutch: moments of its shift times without any effect, and what they say of others.

Late shifts, errors of a level's moments and weights of relative angles follow from the simulated
times of the baseline and of all levels.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy.special import logit

from dogshape.diagnosis.prediction.curve import MIN_CONTACT_SHARE
from dogshape.diagnosis.prediction.moments import (
    ENGAGED_LOGIT,
    LATE_SHARE,
    LOG_KURTOSIS,
    LOG_MEAN,
    LOG_SD,
    MIN_SD_S,
    MOMENTS,
    Angles,
    mark_late,
    mask_late,
    quantiles,
)
from dogshape.diagnosis.prediction.simulations import (
    ANGLES,
    SimulatedTimes,
    passing_time,
)
from dogshape.diagnosis.settings import Settings
from dogshape.diagnosis.terms import Array
from dogshape.sim.setting import Setting
from dogshape.sim.shift.planar import touch_time

MIN_LATE_COUNT = 8  #: late shifts from which their delays are estimated
#: Errors of a level's moments: of ln mean over the coefficient of variation, of ln deviation, of
#: the share of late shifts over the binomial one, of the logit of those that engage, ln kurtosis.
LEVEL_ERRORS = (0.1, 0.25, 1.0, 0.5, 0.3)
COMMON_ERRORS = (0.04, 0.05, 0.5, 1.0, 0.2)
MIN_KURTOSIS = -1.5  #: excess
MAX_KURTOSIS = 12.0  #: excess


class LateDelay(NamedTuple):
    """Delay of a late shift behind timely ones, s, (C,) each."""

    mean: Array
    sd: Array


class Approach(NamedTuple):
    """Motion until the gap is closed, (C,) each."""

    time: Array  #: s
    pace: Array  #: mismatch, pitches/s


class OrderedBaseline(NamedTuple):
    """Baseline of each operating point in the order of its times, (C, A) each."""

    turns: Array  #: relative angles, pitches
    times: Array  #: s
    is_timely: np.ndarray


@dataclass(frozen=True)
class Baseline:
    """Moments of the baseline at C operating points, and what follows from the simulated times."""

    simulated: SimulatedTimes  #: baseline and levels
    constants: Settings  #: that decide an answer

    @property
    def settings(self) -> tuple[Setting, ...]:
        """Baseline of each operating point."""
        return self.simulated.settings

    @property
    def cell_count(self) -> int:
        """Number of operating points."""
        return len(self.simulated.settings)

    @cached_property
    def passing_times(self) -> Array:
        """Time in which the rings turn by one pitch, at most the time-out, s, (C,)."""
        return np.array([passing_time(setting) for setting in self.settings])

    @property
    def min_late_delay(self) -> Array:
        """Smallest delay of a late shift behind the median, s, (C,), by the dense baseline."""
        return self.simulated.min_late_delay

    @cached_property
    def moments(self) -> Array:
        """Moments of the baseline at all angles, (C, MOMENTS)."""
        return self.moments_of(self.simulated.baseline_times)

    @cached_property
    def mean(self) -> Array:
        """Mean of the baseline's timely shifts, s, (C,)."""
        return np.asarray(np.exp(self.moments[:, LOG_MEAN]))

    @cached_property
    def kurtosis(self) -> Array:
        """Excess kurtosis of timely shifts of the baseline, (C,)."""
        excess = np.nan_to_num(np.exp(self.moments[:, LOG_KURTOSIS]) - 3.0)
        return np.clip(excess, MIN_KURTOSIS, MAX_KURTOSIS)

    @cached_property
    def _level_times(self) -> Array:
        """Times of all levels by operating point, s, (C, levels, angles)."""
        return np.moveaxis(self.simulated.times, 1, 0)

    @cached_property
    def _pooled_times(self) -> Array:
        """Times of the baseline and all levels, s, (C, n)."""
        level_times = self._level_times.reshape(self.cell_count, -1)
        return np.hstack([self.simulated.baseline_times, level_times])

    @cached_property
    def _pooled_is_late(self) -> np.ndarray:
        """Whether the shifts of baseline and levels are late, (C, n)."""
        late_levels = mark_late(self._level_times, self.min_late_delay[:, None])
        late_levels = late_levels.reshape(self.cell_count, -1)
        return np.hstack(
            [mark_late(self.simulated.baseline_times, self.min_late_delay), late_levels]
        )

    @cached_property
    def pooled_late_share(self) -> Array:
        """Share of late shifts over baseline and all levels, (C,)."""
        late_count = self._pooled_is_late.sum(axis=1)
        return (late_count + 0.5) / (np.isfinite(self._pooled_times).sum(axis=1) + 50.0)

    @cached_property
    def late_delay(self) -> LateDelay:
        """Mean and standard deviation of a late shift's delay behind timely ones.

        Where hardly any shift is late, it passes ``late_slots`` slots, and scatters as much.
        """
        times = self._pooled_times
        is_late = self._pooled_is_late
        (level_medians,) = quantiles(self._level_times, (0.5,))
        baseline_count = self.simulated.baseline_times.shape[1]
        timeout = np.array([setting.clutch.timeout for setting in self.settings])
        mean = np.minimum(self.constants.late_slots * self.passing_times, 0.5 * timeout)
        sd = mean.copy()
        for cell in np.flatnonzero(is_late.sum(axis=1) >= MIN_LATE_COUNT):
            median = np.median(times[cell][np.isfinite(times[cell])])
            medians = np.append(
                np.repeat(median, baseline_count), np.repeat(level_medians[cell], ANGLES)
            )
            delays = (times[cell] - medians)[is_late[cell]]
            mean[cell] = delays.mean()
            sd[cell] = delays.std(ddof=1)
        return LateDelay(mean, sd)

    @cached_property
    def approach(self) -> Approach:
        """Approach of the baseline."""
        return approach_of(self.settings)

    @cached_property
    def contact_time(self) -> Array:
        """Mean time of the baseline from the closed gap to the end, s, (C,)."""
        contact_time = self.mean - self.approach.time
        return np.maximum(contact_time, MIN_CONTACT_SHARE * self.mean)

    @cached_property
    def moment_errors(self) -> tuple[Array, Array]:
        """Errors of a level's moments by its angles: of each level, in common, (C, MOMENTS)."""
        units = np.ones((self.cell_count, MOMENTS))
        units[:, LOG_MEAN] = np.exp(self.moments[:, LOG_SD] - self.moments[:, LOG_MEAN])
        late_share = self.pooled_late_share
        units[:, LATE_SHARE] = np.sqrt(late_share * (1.0 - late_share) / ANGLES)
        return np.array(LEVEL_ERRORS) * units, np.array(COMMON_ERRORS) * units

    @cached_property
    def turns(self) -> Array:
        """Angles of the baseline, pitches, (C, A)."""
        pitch = np.array([[setting.clutch.dog.pitch_angle] for setting in self.settings])
        return np.asarray(self.simulated.angles / pitch)

    @cached_property
    def ordered(self) -> OrderedBaseline:
        """Baseline in the order of its times."""
        times = self.simulated.baseline_times
        order = np.argsort(times, axis=1)
        is_timely = np.isfinite(mask_late(times, self.min_late_delay))
        return OrderedBaseline(
            turns=np.take_along_axis(self.turns, order, axis=1),
            times=np.take_along_axis(times, order, axis=1),
            is_timely=np.take_along_axis(is_timely, order, axis=1),
        )

    @cached_property
    def angles(self) -> Angles:
        """Two benches: the baseline at all angles, and at the angles of the levels."""
        simulated = self.simulated
        level_times = simulated.spread_times(simulated.baseline_level_times)
        times = np.stack([simulated.baseline_times, level_times])
        return Angles(times, mark_late(times, self.min_late_delay))

    @cached_property
    def level_angle_change(self) -> Array:
        """Change of the moments where only the angles of the levels count, (1, C, MOMENTS)."""
        return self.moments_of(self.angles.times[1:]) - self.moments

    def moments_of(self, times: Array) -> Array:
        """Compute the moments of times (..., C, n), s, (..., C, MOMENTS)."""
        is_late = mark_late(times, self.min_late_delay)
        is_engaged = np.isfinite(times)
        is_timely = is_engaged & ~is_late
        count = is_timely.sum(axis=-1)
        mean = np.where(is_timely, times, 0.0).sum(axis=-1) / np.maximum(1, count)
        squares = np.where(is_timely, times - mean[..., None], 0.0) ** 2
        square_sum = np.maximum(squares.sum(axis=-1), np.maximum(1, count) * MIN_SD_S**2)
        sd = np.sqrt(square_sum / np.maximum(1, count - 1))
        kurtosis = count * (squares**2).sum(axis=-1) / square_sum**2
        engaged = is_engaged.sum(axis=-1)
        shifts = (~np.isnan(times)).sum(axis=-1)
        pooled_count = self.constants.late_pooled
        late_count = is_late.sum(axis=-1) + pooled_count * self.pooled_late_share
        moments = np.empty((*mean.shape, MOMENTS))
        moments[..., LOG_MEAN] = np.where(count > 0, np.log(np.maximum(mean, 1e-6)), np.nan)
        moments[..., LOG_SD] = np.where(count > 1, np.log(sd), np.nan)
        moments[..., LATE_SHARE] = late_count / (engaged + pooled_count)
        moments[..., ENGAGED_LOGIT] = logit((engaged + 0.5) / (shifts + 1.0))
        log_kurtosis = np.log(np.maximum(kurtosis, 1.0))
        moments[..., LOG_KURTOSIS] = np.where(count > 3, log_kurtosis, np.nan)
        return moments


def approach_of(settings: Sequence[Setting]) -> Approach:
    """Compute the approach at settings (C,)."""
    times = [max(touch_time(s.clutch, s.point.profile), MIN_SD_S) for s in settings]
    paces = [s.point.mismatch / s.clutch.dog.pitch_angle for s in settings]
    return Approach(np.array(times), np.array(paces))
