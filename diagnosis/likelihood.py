r"""How likely a cell of bench data is under what a hypothesis says of it.

One shift of time *t* has the density

.. math:: f(t) = (1 - \lambda - \epsilon_0) \frac1q \sum_k N(t; t_k + \delta, h_k)
          + \lambda\, g(t) + \epsilon_0 / T,

kernels at the emulated quantiles of shifts that are not late, as wide as the distance to their
neighbours; *g* a heavy tail of late ones (``diagnosis.late``), whose share is :math:`\lambda`,
:math:`g = (1/s)(1 + (t - t_0)/s)^{-2}` from the least quantile on with *s* by how much they are
later, or the range seen where that is more; and a trace of anything until the time-out *T*. So one
odd shift never decides, and ten do. A mean of *n* shifts is normal, spread :math:`\sigma` of the
quantiles, and *j* of its shifts may be late, by :math:`\tau` with the deviation *w*:

.. math:: f(\bar t) = \sum_j B(j; n, \lambda) N(\bar t; \mu + j\tau/n,
          \sigma^2/n + j w^2/n^2 + e^2).

The error *e* of the emulated mean is common to all shifts of a cell: :math:`\delta \sim N(0, e)`
is integrated out over the whole cell and does not average out. What cells err in common
(``diagnosis.common_error``) needs slope and curvature of all this over an offset. Shares engaged
are beta-binomial with the error of the emulated share. Shifts of which nobody knows are left out,
or counted as failed where one asks.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Self

import numpy as np
from scipy.special import betaln, gammaln, log_ndtr, ndtr, ndtri

from diagnosis.common_error import Slopes
from diagnosis.late import added
from diagnosis.observed import Observed
from diagnosis.spread import Array, Spread

TAIL = 0.02  #: least share of late shifts where nobody knows how late they are
ANYTHING = 0.002  #: share of shifts that may take any time until the time-out
KERNEL = 0.7  #: width of a kernel over the distance of neighbouring quantiles
KERNELS = 16  #: about how many kernels a density has
LEAST = 0.5e-3  #: s, the least spread of single shifts
LEAST_LATE = 0.003  #: least share of late shifts
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
        emulator's own: mesh, contact law, rigid bodies; as share of the simulated mean, and in s.
    common_error : error that all forces of a mismatch have in common, as share of the mean time
        without any effect (``diagnosis.common_error``).
    """

    model_error: float = 0.01
    least_error: float = 0.5e-3
    common_error: float = 0.04


@dataclass(frozen=True)
class Said:
    """What a hypothesis says of all cells: the fields of a spread, (cells, m) and (cells, m, q).

    ``sd`` and ``mean`` are of shifts that are not late, ``common`` the error of that mean that all
    cells have alike; ``late`` the share of late ones and ``behind``, ``behind_sd`` by how much they
    are; all in s. ``model`` is the part of ``error`` that any simulation has.
    """

    times: Array
    engaged: Array
    error: Array
    engaged_error: Array
    mean: Array
    sd: Array
    common: Array
    late: Array
    behind: Array
    behind_sd: Array
    model: Array

    @classmethod
    def of(cls, spreads: list[Spread], rules: Rules) -> Self:
        """Gather spreads, one a cell; the model's own error joins the emulator's."""
        times = np.stack([s.times for s in spreads])
        mean = times.mean(axis=2)
        sd = np.maximum(LEAST, times.std(axis=2, ddof=1))
        simulated = mean - np.stack([s.delay for s in spreads])
        model = np.hypot(rules.model_error * simulated, rules.least_error)
        error = np.hypot(np.stack([s.error for s in spreads]), model)
        engaged, engaged_error = (
            np.stack([getattr(s, name) for s in spreads]) for name in ("engaged", "engaged_error")
        )
        common, late, behind, wide = (
            np.stack([getattr(s, name) for s in spreads])
            for name in ("common", "late", "behind", "behind_sd")
        )
        late = np.maximum(late, max(TAIL, 1.0 / (times.shape[2] + 2.0)) * np.isnan(behind))
        late = np.clip(late, LEAST_LATE, 1.0 - LEAST_LATE)
        errors = np.maximum(error, 1e-5), engaged_error
        return cls(times, engaged, *errors, mean, sd, common, late, behind, wide, model)

    def cell(self, place: int) -> Self:
        """Return one cell, with (1, m)."""
        return type(self)(*(getattr(self, f.name)[place : place + 1] for f in fields(self)))

    def moved(self, offsets: Array) -> Said:
        """Return what one value says (cells, 1), moved by offsets, s, (cells, m)."""
        one = np.ones_like(offsets[:1])
        every = {f.name: getattr(self, f.name) for f in fields(self)}
        wide = {n: part * (one if part.ndim == 2 else one[..., None]) for n, part in every.items()}
        times = {"times": self.times + offsets[..., None], "mean": self.mean + offsets}
        return type(self)(**{**wide, **times})

    @property
    def whole(self) -> tuple[Array, Array]:
        """Mean and standard deviation with late shifts, s."""
        mean, variance = added(self.late, self.behind, self.behind_sd)
        return self.mean + mean, np.sqrt(self.sd**2 + variance)


def log_sum(logs: Array, axis: int) -> Array:
    """Return the logarithm of a sum of exponentials, quicker than scipy's for small arrays."""
    top = np.max(logs, axis=axis, keepdims=True)
    whole: Array = np.log(np.exp(logs - top).sum(axis=axis)) + np.squeeze(top, axis=axis)
    return whole


def log_as_failed(seen: Observed, said: Said) -> Array:
    """Return what reading the unknown shifts as failed adds to it, (cells, m)."""
    if not seen.unknown.any():
        return np.zeros_like(said.engaged)
    whole = log_engaged(seen, said, seen.failed + seen.unknown)
    return whole - log_engaged(seen, said, seen.failed)


@dataclass(frozen=True)
class Timed:
    """Log densities of cells' times, (cells, m), and how they change with a cell's offset."""

    log: Array
    first: Array
    second: Array

    @property
    def slopes(self) -> Slopes:
        """Slope and curvature, value by value."""
        return Slopes(self.first.T.copy(), self.second.T.copy())


def timed(seen: Observed, said: Said) -> Timed:
    """Return the logarithm of the density of each cell's times, with its slopes."""
    nothing = np.zeros_like(said.error)
    means = _timed_mean(seen, said, nothing, said.error)
    found = [np.where((seen.n > 0)[:, None], part, 0.0) for part in means]
    for place in np.flatnonzero(seen.single):
        cell = _timed_singles(_cell(seen, int(place)), said.cell(int(place)))
        for part, value in zip(found, cell, strict=True):
            part[place] = value
    # A hypothesis by which nothing engages has no times; any time is then as good as another.
    anyhow = seen.shifts[:, None] * np.log(ANYTHING / seen.timeout)
    known = np.isfinite(said.mean)
    log, first, second = found
    first, second = (np.where(known, np.nan_to_num(part), 0.0) for part in (first, second))
    return Timed(np.where(known, log, anyhow), first, second)


def log_times(seen: Observed, said: Said) -> Array:
    """Return the logarithm of the density of each cell's times, (cells, m)."""
    return timed(seen, said).log


def _cell(seen: Observed, place: int) -> Observed:
    one = slice(place, place + 1)
    counts = seen.engaged[one], seen.failed[one], seen.unknown[one]
    times = seen.wait[one], seen.mismatch[one], seen.timeout
    return Observed(seen.singles[one], seen.mean[one], seen.n[one], *counts, *times)


def _timed_singles(seen: Observed, said: Said) -> tuple[Array, Array, Array]:
    """Return log, slope and curvature of a cell with single shifts, (m,), offset integrated out.

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
    nodes, offsets = [], []
    for node, log_weight in zip(_NODES, _LOG_WEIGHTS, strict=True):
        offset = centre + node * np.sqrt(variance)
        prior = 0.5 * node**2 - 0.5 * (offset / error) ** 2 + np.log(np.sqrt(variance) / error)
        each = log_singles(seen, said, offset, kernels).sum(axis=1)
        if seen.n[0]:
            each = each + log_mean(seen, said, offset[None], 0.0 * said.error)[0]
        nodes.append(log_weight + prior + each)
        offsets.append(offset)
    log, moved = log_sum(np.stack(nodes), axis=0), np.stack(offsets) / error**2
    share = np.exp(np.stack(nodes) - log)
    first = (share * moved).sum(axis=0)
    second = 1.0 / error**2 - (share * (moved - first) ** 2).sum(axis=0)
    # Four nodes may miss it where shifts lie far off: it is not far below that of normal shifts.
    least = 0.5 / (error**2 + width**2 / times.size)
    return log, first, np.maximum(second, least)


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
    return _timed_mean(seen, said, offset, error)[0]


def _timed_mean(
    seen: Observed, said: Said, offset: Array, error: Array
) -> tuple[Array, Array, Array]:
    """Return the log density of means with slope and curvature, (cells, m) each."""
    share, score, width = _waits(seen, said, offset, error)
    parts = share - 0.5 * score**2 - np.log(width * ROOT)
    log = log_sum(parts, axis=2)
    weight, steep = np.exp(parts - log[..., None]), score / width
    first = (weight * steep).sum(axis=2)
    second = (weight * (width**-2.0 - (steep - first[..., None]) ** 2)).sum(axis=2)
    # Between two modes the curve bends upwards; a parabola must not rise above the modes.
    below = np.maximum(-np.log(width[..., 0] * ROOT) - log, 0.5)
    return log, first, np.maximum(second, 0.5 * first**2 / below)


def _waits(seen: Observed, said: Said, offset: Array, error: Array) -> tuple[Array, Array, Array]:
    """Return of 0, 1, ... shifts that waited: log probability, score, width, (cells, m, w)."""
    n, share = np.maximum(1.0, seen.n)[:, None, None], said.late[..., None]
    waits = np.arange(float(WAITS))
    with np.errstate(divide="ignore"):
        ways = gammaln(n + 1) - gammaln(waits + 1) - gammaln(np.maximum(n - waits, 0.0) + 1)
        log_share = ways + waits * np.log(share) + (n - waits) * np.log1p(-share)
    log_share = np.where(waits <= n, log_share, -1e9)
    log_share = log_share - log_sum(log_share, axis=2)[..., None]
    behind, wide = _behind(seen, said)
    centre = (said.mean + offset)[..., None] + waits * behind[..., None] / n
    width = np.sqrt(
        (said.sd**2 / n[..., 0] + error**2)[..., None] + waits * (wide[..., None] / n) ** 2
    )
    return log_share, (seen.mean[:, None, None] - centre) / width, width


def _behind(seen: Observed, said: Said) -> tuple[Array, Array]:
    """Return by how much late shifts are later, and the deviation, s, (cells, m).

    Where nobody knows, the wait for the next slot as far as it exceeds what was simulated.
    """
    seen_range = said.times[..., -1] - said.times[..., 0]
    wait = np.maximum(0.0, np.minimum(seen.wait[:, None], said.mean) - seen_range)
    known = np.isfinite(said.behind)
    return np.where(known, said.behind, wait), np.where(known, said.behind_sd, wait)


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
    behind = np.where(np.isfinite(said.behind[0]), said.behind[0], seen.wait[0])
    scale = np.maximum(behind, seen_range)[:, None]
    late = times[None, :] - first
    slow = np.where(late > 0.0, (1.0 + np.maximum(late, 0.0) / scale) ** -2 / scale, 0.0)
    late = said.late[0][:, None]
    whole = (1.0 - late - ANYTHING) * bulk + late * slow + ANYTHING / seen.timeout
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
