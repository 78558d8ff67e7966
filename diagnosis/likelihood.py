r"""How likely a cell of bench data is under what a hypothesis says of it.

One shift of time *t* has the density

.. math:: f(t) = (1 - \epsilon - \epsilon_0) \frac1q \sum_k N(t; t_k + \delta, h_k)
          + \epsilon\, g(t) + \epsilon_0 / T,

kernels at the emulated quantiles, as wide as the distance to their neighbours; *g* a heavy tail
of shifts that skip slots, :math:`g = (1/s)(1 + (t - t_0)/s)^{-2}` from the least quantile on with
*s* the wait for the next slot, or the range seen where that is more; and a trace of anything until
the time-out *T*. So one odd shift never decides, and ten do. A mean of *n* shifts is normal,
spread :math:`\sigma` of the quantiles, and *j* of its shifts may have waited for the next slot:

.. math:: f(\bar t) = \sum_j B(j; n, \epsilon) N(\bar t; \mu + j\tau/n,
          \sigma^2/n + j\tau^2/n^2 + e^2).

The error *e* of the emulated mean is common to all shifts of a cell: :math:`\delta \sim N(0, e)`
is integrated out over the whole cell and does not average out. Shares engaged are beta-binomial
with the error of the emulated share. Shifts of which nobody knows are left out, or counted as
failed where one asks.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import betaln, gammaln, log_ndtr, logsumexp, ndtr, ndtri

from diagnosis.bench import Bench
from diagnosis.reading import Cell
from diagnosis.spread import Array, Spread
from sim.clutch import Clutch

TAIL = 0.02  #: least share of shifts that wait longer than any that was simulated
ANYTHING = 0.002  #: share of shifts that may take any time until the time-out
KERNEL = 0.7  #: width of a kernel over the distance of neighbouring quantiles
LEAST = 0.5e-3  #: s, the least spread of single shifts
WAITS = 4  #: most shifts of a mean that may have waited, plus one
CLIP = 0.01  #: a shift's rank in its distribution counts no more extreme than this
ROOT = float(np.sqrt(2.0 * np.pi))

_NODES, _WEIGHTS = np.polynomial.hermite_e.hermegauss(5)
_LOG_WEIGHTS = np.log(_WEIGHTS / _WEIGHTS.sum())


@dataclass(frozen=True)
class Rules:
    """What the likelihood takes for granted.

    Parameters
    ----------
    model_error : error of any simulation of a mean shift time, as share of it, beside the
        emulator's own: mesh, contact law, rigid bodies.
    """

    model_error: float = 0.01


@dataclass(frozen=True)
class Observed:
    """What a bench has at one operating point; times in s.

    Parameters
    ----------
    singles : times of single shifts, (k,).
    mean, n : grand mean of the shifts that are only known as means, and their number.
    engaged, failed, unknown : shifts counted.
    wait : from slot to slot, s.
    timeout : s.
    """

    singles: Array
    mean: float
    n: int
    engaged: int
    failed: int
    unknown: int
    wait: float
    timeout: float

    @property
    def shifts(self) -> int:
        """Number of shifts with a time, alone or within a mean."""
        return self.singles.size + self.n

    @property
    def time(self) -> float:
        """Mean time of all shifts that have one, s; NaN for none."""
        whole = self.singles.sum() + (self.n * self.mean if self.n else 0.0)
        return float(whole / self.shifts) if self.shifts else float("nan")


def observe(bench: Bench) -> tuple[Observed, ...]:
    """Return what a data set has, cell by cell."""
    return tuple(observe_cell(cell, bench.clutch) for cell in bench.cells)


def observe_cell(cell: Cell, clutch: Clutch) -> Observed:
    """Return what one cell has."""
    means = [(r.time, r.n) for r in cell.readings if r.time is not None and r.n > 1]
    count = sum(n for _, n in means)
    mean = sum(t * n for t, n in means) / count if count else 0.0
    slip, timeout = abs(cell.point.mismatch), clutch.timeout
    wait = min(timeout, clutch.dog.pitch_angle / slip) if slip else timeout
    tried = cell.engaged, cell.failed, cell.unknown
    return Observed(cell.times, mean, count, *tried, wait, timeout)


def mean_of(spread: Spread) -> Array:
    """Return the mean time, s, (m,)."""
    mean: Array = spread.times.mean(axis=1)
    return mean


def sd_of(spread: Spread) -> Array:
    """Return the spread of single shifts, s, (m,)."""
    sd: Array = np.maximum(LEAST, spread.times.std(axis=1, ddof=1))
    return sd


def error_of(spread: Spread, rules: Rules) -> Array:
    """Return the standard error of the emulated mean with the model's own, s, (m,)."""
    error: Array = np.hypot(spread.error, rules.model_error * mean_of(spread))
    return np.maximum(error, 1e-5)


def log_likelihood(seen: Observed, spread: Spread, rules: Rules) -> Array:
    """Return the logarithm of the likelihood of a cell, (m,), unknown shifts left out."""
    return log_times(seen, spread, rules) + log_engaged(seen, spread, seen.failed)


def log_as_failed(seen: Observed, spread: Spread) -> Array:
    """Return what reading the unknown shifts as failed adds to the logarithm, (m,)."""
    whole = log_engaged(seen, spread, seen.failed + seen.unknown)
    return whole - log_engaged(seen, spread, seen.failed)


def log_times(seen: Observed, spread: Spread, rules: Rules) -> Array:
    """Return the logarithm of the density of the times of a cell, (m,)."""
    if not seen.shifts:
        return np.zeros(len(spread.times))
    # A hypothesis by which nothing engages has no times; any time is then as good as another.
    known = np.isfinite(spread.times).all(axis=1)
    result = np.full(known.shape, seen.shifts * np.log(ANYTHING / seen.timeout))
    if known.any():
        part = spread if known.all() else _rows(spread, known)
        result[known] = _log_known(seen, part, rules)
    return result


def _rows(spread: Spread, which: np.ndarray) -> Spread:
    parts = spread.times, spread.engaged, spread.error, spread.engaged_error
    return Spread(*(part[which] for part in parts))


def _log_known(seen: Observed, spread: Spread, rules: Rules) -> Array:
    error = error_of(spread, rules)
    if not seen.singles.size:
        return log_mean(seen, spread, np.zeros_like(error), error)
    nodes = []
    for node, weight in zip(_NODES, _LOG_WEIGHTS, strict=True):
        single = log_singles(seen, spread, node * error, rules).sum(axis=1)
        mean = log_mean(seen, spread, node * error, 0.0 * error) if seen.n else 0.0
        nodes.append(weight + single + mean)
    result: Array = logsumexp(nodes, axis=0)
    return result


def tail_share(spread: Spread) -> float:
    """Return the share of shifts that may wait longer than any that was simulated."""
    return max(TAIL, 1.0 / (spread.times.shape[1] + 2))


def log_mean(seen: Observed, spread: Spread, offset: Array, error: Array) -> Array:
    """Return the log density of the mean of n shifts whose common ``offset`` is known, (m,)."""
    share, score, width = _waits(seen, spread, offset, error)
    result: Array = logsumexp(share - 0.5 * score**2 - np.log(width * ROOT), axis=1)
    return result


def _waits(
    seen: Observed, spread: Spread, offset: Array | float, error: Array
) -> tuple[Array, Array, Array]:
    """Return of 0, 1, ... shifts that waited: log probability (w,), score and width (m, w)."""
    n, share = max(1, seen.n), tail_share(spread)
    waits = np.arange(min(WAITS, n + 1), dtype=float)
    ways = gammaln(n + 1) - gammaln(waits + 1) - gammaln(n - waits + 1)
    log_share = ways + waits * np.log(share) + (n - waits) * np.log1p(-share)
    seen_range = spread.times[:, -1] - spread.times[:, 0]
    extra = np.maximum(0.0, np.minimum(seen.wait, mean_of(spread)) - seen_range)[:, None] / n
    centre = (mean_of(spread) + offset)[:, None] + waits * extra
    width = np.sqrt((sd_of(spread) ** 2 / n + error**2)[:, None] + waits * extra**2)
    return log_share - logsumexp(log_share), (seen.mean - centre) / width, width


def kernels(spread: Spread) -> Array:
    """Return the width of the kernel at each quantile, s, (m, q)."""
    gaps = np.gradient(spread.times, axis=1)
    widths: Array = np.maximum(KERNEL * gaps, LEAST)
    return widths


def log_singles(seen: Observed, spread: Spread, offset: Array, rules: Rules) -> Array:
    """Return the log density of each single shift, (m, k), given the cell's common offset, s."""
    tail = tail_share(spread)
    widths = kernels(spread)
    apart = seen.singles[None, :, None] - (spread.times + offset[:, None])[:, None, :]
    inside = np.exp(-0.5 * (apart / widths[:, None, :]) ** 2) / widths[:, None, :]
    bulk = inside.mean(axis=2) / ROOT
    first = (spread.times[:, 0] + offset)[:, None]
    scale = np.maximum(seen.wait, spread.times[:, -1] - spread.times[:, 0])[:, None]
    late = seen.singles[None, :] - first
    slow = np.where(late > 0.0, (1.0 + np.maximum(late, 0.0) / scale) ** -2 / scale, 0.0)
    whole = (1.0 - tail - ANYTHING) * bulk + tail * slow + ANYTHING / seen.timeout
    result: Array = np.log(whole)
    return result


def log_engaged(seen: Observed, spread: Spread, failed: int) -> Array:
    """Return the log probability of the number engaged, (m,), beta-binomial."""
    tried = seen.engaged + failed
    if not tried:
        return np.zeros(len(spread.engaged))
    a, b = beta_of(spread)
    ways = gammaln(tried + 1) - gammaln(seen.engaged + 1) - gammaln(failed + 1)
    result: Array = ways + betaln(a + seen.engaged, b + failed) - betaln(a, b)
    return result


def beta_of(spread: Spread) -> tuple[Array, Array]:
    """Return the parameters of the Beta with the emulated share and its error, (m,) each."""
    # A share of exactly one with no error would make one failure impossible.
    share = np.clip(spread.engaged, 2e-3, 1.0 - 2e-3)
    most = share * (1.0 - share)
    size = most / np.clip(spread.engaged_error**2, 1e-6, 0.9 * most) - 1.0
    return share * size, (1.0 - share) * size


def time_score(seen: Observed, spread: Spread, rules: Rules) -> Array:
    """Return how far the times of a cell lie from what is said of them, normal scores, (m,).

    Of single shifts the ranks in their distribution count, so that no single one can be more
    than a few standard errors; of a mean its distribution function.
    """
    scores, weights = [], []
    error = error_of(spread, rules)
    sd = sd_of(spread)
    if seen.singles.size:
        k = seen.singles.size
        apart = seen.singles[None, :, None] - spread.times[:, None, :]
        rank = ndtr(apart / kernels(spread)[:, None, :]).mean(axis=2)
        normal = ndtri(np.clip(rank, CLIP, 1.0 - CLIP))
        scores.append(np.sqrt(k) * normal.mean(axis=1) / np.sqrt(1.0 + k * (error / sd) ** 2))
        weights.append(np.sqrt(k))
    if seen.n:
        scores.append(_mean_score(seen, spread, error))
        weights.append(np.sqrt(seen.n))
    total: Array = np.tensordot(weights, scores, 1) / np.linalg.norm(weights)
    return total


def _mean_score(seen: Observed, spread: Spread, error: Array) -> Array:
    share, apart, _ = _waits(seen, spread, 0.0, error)
    below, above = (logsumexp(share + log_ndtr(s * apart), axis=1) for s in (1.0, -1.0))
    # The smaller tail keeps its digits far out.
    low = np.maximum(np.minimum(below, above), -700.0)
    scores: Array = np.where(below < above, 1.0, -1.0) * ndtri(np.exp(low))
    return scores
