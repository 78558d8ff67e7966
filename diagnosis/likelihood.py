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

from dataclasses import dataclass, fields
from typing import Self

import numpy as np
from scipy.special import betaln, gammaln, log_ndtr, ndtr, ndtri

from diagnosis.bench import Bench
from diagnosis.marks import SeenFlight, flights_of
from diagnosis.reading import Cell
from diagnosis.spread import Array, Spread
from sim.clutch import Clutch

TAIL = 0.02  #: least share of shifts that wait longer than any that was simulated
ANYTHING = 0.002  #: share of shifts that may take any time until the time-out
KERNEL = 0.7  #: width of a kernel over the distance of neighbouring quantiles
KERNELS = 16  #: about how many kernels a density has
LEAST = 0.5e-3  #: s, the least spread of single shifts
WAITS = 4  #: most shifts of a mean that may have waited, plus one
FAR = 3.0  #: widths from the bulk beyond which a cell tells nothing of its offset
CLIP = 0.01  #: a shift's rank in its distribution counts no more extreme than this
ROOT = float(np.sqrt(2.0 * np.pi))

_NODES, _WEIGHTS = np.polynomial.hermite_e.hermegauss(4)
_LOG_WEIGHTS = np.log(_WEIGHTS / _WEIGHTS.sum())


@dataclass(frozen=True)
class Rules:
    """What the likelihood takes for granted.

    Parameters
    ----------
    model_error, least_error : error of any simulation of a mean shift time, beside the
        emulator's own: mesh, contact law, rigid bodies; as share of the mean, and in s.
    """

    model_error: float = 0.02
    least_error: float = 0.5e-3


@dataclass(frozen=True)
class Observed:
    """What a bench has at its operating points, each (cells,); times in s.

    Parameters
    ----------
    singles : times of single shifts, cell by cell, (k,) each.
    mean, n : grand mean of the shifts that are only known as means, and their number.
    engaged, failed, unknown : shifts counted.
    wait : from slot to slot, s.
    timeout : s.
    flights : marks of the traces, one for each force profile that has any.
    """

    singles: tuple[Array, ...]
    mean: Array
    n: Array
    engaged: Array
    failed: Array
    unknown: Array
    wait: Array
    timeout: float
    flights: tuple[SeenFlight, ...] = ()

    @property
    def cells(self) -> int:
        """Number of cells."""
        return len(self.singles)

    @property
    def single(self) -> Array:
        """Number of single shifts with a time, (cells,)."""
        return np.array([times.size for times in self.singles], dtype=float)

    @property
    def shifts(self) -> Array:
        """Number of shifts with a time, alone or within a mean, (cells,)."""
        whole: Array = self.single + self.n
        return whole

    @property
    def tried(self) -> Array:
        """Number of shifts known to have been tried, (cells,)."""
        return self.engaged + self.failed

    @property
    def time(self) -> Array:
        """Mean time of all shifts that have one, s, (cells,); NaN for none."""
        whole = np.array([times.sum() for times in self.singles]) + self.n * self.mean
        return np.where(self.shifts > 0, whole / np.maximum(1, self.shifts), np.nan)


def observe(bench: Bench) -> Observed:
    """Return what a data set has."""
    means = [_grand_mean(cell) for cell in bench.cells]
    waits = [_wait(cell, bench.clutch) for cell in bench.cells]
    counts = [(cell.engaged, cell.failed, cell.unknown) for cell in bench.cells]
    mean, n = np.array(means, dtype=float).reshape(-1, 2).T
    engaged, failed, unknown = np.array(counts, dtype=float).reshape(-1, 3).T
    singles = tuple(cell.times for cell in bench.cells)
    counted = engaged, failed, unknown
    flights = flights_of(bench)
    return Observed(singles, mean, n, *counted, np.array(waits), bench.clutch.timeout, flights)


def _grand_mean(cell: Cell) -> tuple[float, int]:
    means = [(r.time, r.n) for r in cell.readings if r.time is not None and r.n > 1]
    count = sum(n for _, n in means)
    return sum(t * n for t, n in means) / max(1, count), count


def _wait(cell: Cell, clutch: Clutch) -> float:
    slip = abs(cell.point.mismatch)
    return min(clutch.timeout, clutch.dog.pitch_angle / slip) if slip else clutch.timeout


@dataclass(frozen=True)
class Said:
    """What a hypothesis says of all cells: the fields of a spread, (cells, m) and (cells, m, q).

    ``sd`` is the spread of single shifts, ``mean`` that of the times; both in s.
    """

    times: Array
    engaged: Array
    error: Array
    engaged_error: Array
    mean: Array
    sd: Array

    @classmethod
    def of(cls, spreads: list[Spread], rules: Rules) -> Self:
        """Gather spreads, one a cell; the model's own error joins the emulator's."""
        times = np.stack([s.times for s in spreads])
        mean = times.mean(axis=2)
        sd = np.maximum(LEAST, times.std(axis=2, ddof=1))
        model = np.hypot(rules.model_error * mean, rules.least_error)
        error = np.hypot(np.stack([s.error for s in spreads]), model)
        engaged, engaged_error = (
            np.stack([getattr(s, name) for s in spreads]) for name in ("engaged", "engaged_error")
        )
        return cls(times, engaged, np.maximum(error, 1e-5), engaged_error, mean, sd)

    def cell(self, place: int) -> Self:
        """Return one cell, with (1, m)."""
        return type(self)(*(getattr(self, f.name)[place : place + 1] for f in fields(self)))

    @property
    def tail(self) -> float:
        """Share of shifts that may wait longer than any that was simulated."""
        return max(TAIL, 1.0 / float(self.times.shape[2] + 2))


def log_sum(logs: Array, axis: int) -> Array:
    """Return the logarithm of a sum of exponentials, quicker than scipy's for small arrays."""
    top = np.max(logs, axis=axis, keepdims=True)
    whole: Array = np.log(np.exp(logs - top).sum(axis=axis)) + np.squeeze(top, axis=axis)
    return whole


def log_likelihood(seen: Observed, said: Said) -> Array:
    """Return the logarithm of each cell's likelihood, (cells, m), unknown shifts left out."""
    return log_times(seen, said) + log_engaged(seen, said, seen.failed)


def log_as_failed(seen: Observed, said: Said) -> Array:
    """Return what reading the unknown shifts as failed adds to it, (cells, m)."""
    if not seen.unknown.any():
        return np.zeros_like(said.engaged)
    whole = log_engaged(seen, said, seen.failed + seen.unknown)
    return whole - log_engaged(seen, said, seen.failed)


def log_times(seen: Observed, said: Said) -> Array:
    """Return the logarithm of the density of each cell's times, (cells, m)."""
    found = np.where(
        (seen.n > 0)[:, None], log_mean(seen, said, np.zeros_like(said.error), said.error), 0.0
    )
    for place in np.flatnonzero(seen.single):
        found[place] = _log_single_cell(_cell(seen, int(place)), said.cell(int(place)))
    # A hypothesis by which nothing engages has no times; any time is then as good as another.
    anyhow = seen.shifts[:, None] * np.log(ANYTHING / seen.timeout)
    return np.where(np.isfinite(said.mean), found, anyhow)


def _cell(seen: Observed, place: int) -> Observed:
    one = slice(place, place + 1)
    counts = seen.engaged[one], seen.failed[one], seen.unknown[one], seen.wait[one]
    return Observed(seen.singles[one], seen.mean[one], seen.n[one], *counts, seen.timeout)


def _log_single_cell(seen: Observed, said: Said) -> Array:
    """Return the logarithm for a cell with single shifts, (m,), its common offset integrated out.

    Gauss-Hermite's nodes lie where the offset is likely after a look at the medians.
    """
    times, error = seen.singles[0], said.error[0]
    middle, width = _at_share(said.times[0], 0.5), bulk_width(said)
    weight = times.size / width**2
    apart = np.median(times) - middle
    # Far from the bulk the density is flat, and no offset more likely than before.
    near = np.abs(apart) < FAR * np.hypot(width, error)
    variance = 1.0 / (1.0 / error**2 + np.where(near, weight, 0.0))
    centre = np.where(near, variance * weight * apart, 0.0)
    kernels = _kernels(said.times[0])
    nodes = []
    for node, log_weight in zip(_NODES, _LOG_WEIGHTS, strict=True):
        offset = centre + node * np.sqrt(variance)
        prior = 0.5 * node**2 - 0.5 * (offset / error) ** 2 + np.log(np.sqrt(variance) / error)
        each = log_singles(seen, said, offset, kernels).sum(axis=1)
        if seen.n[0]:
            each = each + log_mean(seen, said, offset[None], 0.0 * said.error)[0]
        nodes.append(log_weight + prior + each)
    return log_sum(np.stack(nodes), axis=0)


def bulk_width(said: Said) -> Array:
    """Return the spread of the bulk of a cell's times by their quartiles, s, (m,)."""
    low, high = (_at_share(said.times[0], share) for share in (0.25, 0.75))
    width: Array = np.clip((high - low) / 1.35, LEAST, said.sd[0])
    return width


def _at_share(times: Array, share: float) -> Array:
    """Return what a share of ascending times (m, q) lies below, (m,)."""
    place = share * (times.shape[1] - 1)
    low = int(place)
    high = min(low + 1, times.shape[1] - 1)
    value: Array = times[:, low] + (place - low) * (times[:, high] - times[:, low])
    return value


def log_mean(seen: Observed, said: Said, offset: Array, error: Array) -> Array:
    """Return the log density of means whose cells' common ``offset`` (cells, m) is known."""
    share, score, width = _waits(seen, said, offset, error)
    return log_sum(share - 0.5 * score**2 - np.log(width * ROOT), axis=2)


def _waits(seen: Observed, said: Said, offset: Array, error: Array) -> tuple[Array, Array, Array]:
    """Return of 0, 1, ... shifts that waited: log probability, score, width, (cells, m, w)."""
    n, share = np.maximum(1.0, seen.n)[:, None, None], said.tail
    waits = np.arange(float(WAITS))
    with np.errstate(divide="ignore"):
        ways = gammaln(n + 1) - gammaln(waits + 1) - gammaln(np.maximum(n - waits, 0.0) + 1)
        log_share = ways + waits * np.log(share) + (n - waits) * np.log1p(-share)
    log_share = np.where(waits <= n, log_share, -1e9)
    log_share = log_share - log_sum(log_share, axis=2)[..., None]
    seen_range = said.times[..., -1] - said.times[..., 0]
    wait = np.maximum(0.0, np.minimum(seen.wait[:, None], said.mean) - seen_range)
    extra = wait[..., None] / n
    centre = (said.mean + offset)[..., None] + waits * extra
    width = np.sqrt((said.sd**2 / n[..., 0] + error**2)[..., None] + waits * extra**2)
    return log_share, (seen.mean[:, None, None] - centre) / width, width


def _kernels(times: Array) -> tuple[Array, Array]:
    """Return centres and widths of kernels from quantiles (m, q), s, (m, about KERNELS)."""
    step = max(1, times.shape[1] // KERNELS)
    whole = times.shape[1] // step * step
    centres = times[:, :whole].reshape(len(times), -1, step).mean(axis=2)
    if centres.shape[1] < 2:
        return centres, np.full_like(centres, LEAST)
    return centres, np.maximum(KERNEL * np.gradient(centres, axis=1), LEAST)


def log_singles(seen: Observed, said: Said, offset: Array, kernels: tuple[Array, Array]) -> Array:
    """Return the log density of each single shift of one cell, (m, k), given its offset (m,)."""
    times = seen.singles[0]
    centres, widths = kernels
    # In single precision: what it loses is far below the error of the kernels.
    over = (1.0 / widths).astype(np.float32)
    score = (times[None, :] - offset[:, None]).astype(np.float32)[:, :, None] * over[:, None, :]
    score -= (centres / widths).astype(np.float32)[:, None, :]
    score *= score
    score *= np.float32(-0.5)
    np.exp(score, out=score)
    bulk = np.einsum("mkq,mq->mk", score, over) / (centres.shape[1] * ROOT)
    first = (said.times[0, :, 0] + offset)[:, None]
    seen_range = said.times[0, :, -1] - said.times[0, :, 0]
    scale = np.maximum(seen.wait[0], seen_range)[:, None]
    late = times[None, :] - first
    slow = np.where(late > 0.0, (1.0 + np.maximum(late, 0.0) / scale) ** -2 / scale, 0.0)
    whole = (1.0 - said.tail - ANYTHING) * bulk + said.tail * slow + ANYTHING / seen.timeout
    result: Array = np.log(whole)
    return result


def log_engaged(seen: Observed, said: Said, failed: Array) -> Array:
    """Return the log probability of the numbers engaged, (cells, m), beta-binomial."""
    a, b = beta_of(said)
    engaged, missed = seen.engaged[:, None], failed[:, None]
    tried = engaged + missed
    ways = gammaln(tried + 1) - gammaln(engaged + 1) - gammaln(missed + 1)
    result: Array = ways + betaln(a + engaged, b + missed) - betaln(a, b)
    return result


def beta_of(said: Said) -> tuple[Array, Array]:
    """Return the parameters of the Beta with the emulated share and its error, (cells, m) each."""
    # A share of exactly one with no error would make one failure impossible.
    share = np.clip(said.engaged, 2e-3, 1.0 - 2e-3)
    most = share * (1.0 - share)
    size = most / np.clip(said.engaged_error**2, 1e-6, 0.9 * most) - 1.0
    return share * size, (1.0 - share) * size


def time_score(seen: Observed, said: Said) -> Array:
    """Return how far the times lie from what is said of them, normal scores, (cells, m).

    Of single shifts the ranks in their distribution count, so that no single one can be more
    than a few standard errors; of a mean its distribution function. Zero without times.
    """
    one, both = np.sqrt(seen.single)[:, None], np.sqrt(np.maximum(1, seen.shifts))[:, None]
    scores = np.sqrt(seen.n)[:, None] * _mean_score(seen, said)
    for place in np.flatnonzero(seen.single):
        scores[place] += one[place] * _rank_score(seen.singles[place], said.cell(int(place)))
    whole: Array = np.nan_to_num(scores / both, nan=20.0)
    return whole


def _rank_score(times: Array, said: Said) -> Array:
    centres, widths = _kernels(said.times[0])
    rank = ndtr((times[None, :, None] - centres[:, None]) / widths[:, None]).mean(axis=2)
    normal = ndtri(np.clip(rank, CLIP, 1.0 - CLIP)).mean(axis=1)
    # An offset of a narrow bulk with a rare tail moves all ranks.
    score: Array = normal / np.sqrt(1.0 / times.size + (said.error[0] / bulk_width(said)) ** 2)
    return score


def _mean_score(seen: Observed, said: Said) -> Array:
    share, apart, _ = _waits(seen, said, np.zeros_like(said.error), said.error)
    below, above = (log_sum(share + log_ndtr(sign * apart), axis=2) for sign in (1.0, -1.0))
    # The smaller tail keeps its digits far out.
    low = np.maximum(np.minimum(below, above), -700.0)
    scores: Array = np.where(below < above, 1.0, -1.0) * ndtri(np.exp(low))
    return np.where((seen.n > 0)[:, None], scores, 0.0)
