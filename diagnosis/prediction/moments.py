"""Timely and late shifts, and moments of shift times at relative angles that count by weights.

Timely shifts also part into two modes where the variance within both is least (Otsu 1979, IEEE
Trans. Syst. Man Cybern. 9). That is compiled: a diagnosis parts the angles of a million means.
"""

# mypy: disable-error-code="no-untyped-def"

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.special import logit

from dogshape.diagnosis.terms import Array
from dogshape.sim.kernel import compiled

FAR = 8.0  #: distances of the 10 % quantile behind the median, from which a shift is late
LEAST_SD = 5e-4  #: s, resolution of a shift time
TINY = 1e-9  #: least sum of weights to divide by


def late_times(times: Array, least: Array) -> np.ndarray:
    """Mark late shifts among times (..., C, n) of operating points.

    A late shift lies behind the median by ``least`` (C,), s, and by ``FAR`` distances of the 10 %
    quantile from it: the fast side does not move with late shifts.
    """
    fast, middle = quantiles(times, (0.1, 0.5))
    far = np.maximum(FAR * (middle - fast), least)
    return np.isfinite(times) & (times > (middle + far)[..., None])


def quantiles(times: Array, shares: Sequence[float]) -> list[Array]:
    """Compute quantiles of the shifts that engage among times (..., n), (...) each; 0 for none."""
    ended = np.isfinite(times)
    count = ended.sum(axis=-1)
    ordered = np.sort(np.where(ended, times, np.where(count == 0, 0.0, np.inf)[..., None]), axis=-1)
    last, found = np.maximum(count - 1, 0), []
    for share in shares:
        below = np.floor(share * last).astype(int)
        ends = (below, np.minimum(below + 1, last))
        low, high = (np.take_along_axis(ordered, k[..., None], -1)[..., 0] for k in ends)
        found.append(np.asarray(low + (share * last - below) * (high - low)))
    return found


def timely(times: Array, least: Array) -> Array:
    """Replace late shifts and those that did not engage by NaN."""
    return np.where(np.isfinite(times) & ~late_times(times, least), times, np.nan)


@dataclass(frozen=True)
class Angles:
    """Shift times of n benches at C operating points and A relative angles, NaN where unknown."""

    times: Array  #: (n, C, A)
    late: np.ndarray  #: which are late, (n, C, A)

    @cached_property
    def _parts(self) -> tuple[Array, Array, Array]:
        """Which shifts are timely, engage, and were simulated, (n, C, A) each."""
        ended = np.isfinite(self.times)
        return 1.0 * (ended & ~self.late), 1.0 * ended, 1.0 * ~np.isnan(self.times)

    @cached_property
    def _centred(self) -> tuple[Array, Array]:
        """Mean of the timely shifts, s, (n, C), and how far each is from it, (n, C, A)."""
        kept = self._parts[0]
        whole = np.where(kept, self.times, 0.0).sum(axis=-1)
        centre = whole / np.maximum(kept.sum(axis=-1), 1.0)
        return centre, np.where(kept > 0.0, self.times - centre[..., None], 0.0)

    @cached_property
    def _even(self) -> Array:
        """Moments at even angles, (1, n, C, 5)."""
        return self._moments(np.ones((1, *self.times.shape[1:])))

    def _moments(self, weights: Array) -> Array:
        centre, apart = self._centred
        timely, engaged, every = (np.maximum(_sums(weights, one), TINY) for one in self._parts)
        first, second = (_sums(weights, one) / timely for one in (apart, apart**2))
        mean = np.maximum(centre + first, LEAST_SD)
        square = np.maximum(second - first**2, LEAST_SD**2)
        odds, late = logit(np.clip(engaged / every, 0.01, 0.99)), 1.0 - timely / engaged
        # Kurtosis is that of the modes.
        return np.stack([np.log(mean), 0.5 * np.log(square), late, odds, 0.0 * mean], axis=-1)

    def changes(self, weights: Array) -> tuple[Array, Array]:
        """Compute changes of moments by weights (m, C, A): of ln mean, ln deviation, share of late
        shifts and logit of those that engage, (m, n, C, 5); and the number of even angles that tell
        as much, (m, n, C).
        """
        known = self._parts[2]
        count = _sums(weights, known) ** 2 / np.maximum(_sums(weights**2, known), TINY)
        return self._moments(weights) - self._even, count


def _sums(weights: Array, values: Array) -> Array:
    """Sum values (n, C, A) by weights (m, C, A) over the angles, (m, n, C)."""
    return np.moveaxis(weights.swapaxes(0, 1) @ values.transpose(1, 2, 0), 0, -1)


def modes_of(times: Array, kept: np.ndarray, weights: Array) -> Array:
    """Part ascending times (C, A), of which some are timely, into two modes by weights (m, C, A).

    Share of the smaller mode, mean and deviation of the larger one over those of all, and excess
    kurtosis of all, (4, m, C).
    """
    found = np.empty((*weights.shape[:2], 4))
    _fill(times, kept, np.ascontiguousarray(weights), found)
    return np.moveaxis(found, -1, 0)


@compiled
def _fill(times, kept, weights, found):
    for row in range(weights.shape[0]):
        for cell in range(weights.shape[1]):
            _part(weights[row, cell], times[cell], kept[cell], found[row, cell])


@compiled
def _part(weights, times, kept, out):
    whole = first = 0.0
    for k in range(len(times)):
        if kept[k]:
            whole += weights[k]
            first += weights[k] * times[k]
    whole = max(whole, TINY)
    mean = first / whole
    # Sums of the lower mode about the mean of all.
    share = moved = spread = below = first = second = fourth = most = 0.0
    for k in range(len(times)):
        if kept[k]:
            apart = times[k] - mean
            below += weights[k]
            first += weights[k] * apart
            second += weights[k] * apart**2
            fourth += weights[k] * apart**4
            between = first * first * (1.0 / max(below, TINY) + 1.0 / max(whole - below, TINY))
            if between > most:
                most, share, moved, spread = between, below, first, second
    if share < 0.5 * whole:
        share, moved, spread = whole - share, -moved, second - spread
    share, square = max(share, TINY), max(second / whole, LEAST_SD**2)
    narrow = max(spread / share - (moved / share) ** 2, 0.0)
    out[0] = max(1.0 - share / whole, 0.0)
    out[1] = 1.0 + moved / share / max(mean, LEAST_SD)
    out[2] = (narrow / square) ** 0.5
    out[3] = fourth / whole / square**2 - 3.0
