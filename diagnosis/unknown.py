r"""The hypothesis *unknown*: a structured gap that no known effect explains.

Every cell's times are those of the baseline, moved by an offset :math:`b_c` of their own and
stretched by a common factor. The offsets are a Gaussian process over the logarithms of force and
mismatch,

.. math:: K_{ij} = A^2 w_i w_j (\rho e^{-d_{ij}^2 / 2 \ell^2} + (1 - \rho) \delta_{ij}),

with *w* one, or the baseline's mean time over its average. The likelihood of a cell as a function
of its offset is put into the form :math:`S_c N(b_c; m_c, v_c)`, exact for means, so that the
evidence is :math:`\prod S_c \cdot N(m; 0, V + K)`, summed over a grid of *A*, :math:`\ell`, *w*
and stretch. A cell's share engaged is the baseline's or anything, half and half.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import logsumexp

from diagnosis.bench import Bench
from diagnosis.likelihood import Observed, log_engaged, log_times, mean_of, sd_of
from diagnosis.scoring import Problem
from diagnosis.spread import Array, Spread
from sim.units import RPM

SCALES = np.geomspace(0.005, 0.4, 12)  #: A, s
LENGTHS = (0.5, 1.5, 5.0)  #: in units of the natural logarithm
SMOOTH = 0.8  #: share of the variance that neighbours have in common
STRETCHES = {0.5: 0.25, 1.0: 0.5, 2.0: 0.25}  #: with their prior probabilities
OFFSETS = np.sinh(np.linspace(-6.0, 6.0, 121)) / 4.0  #: in standard errors, to 50 either side


@dataclass(frozen=True)
class Offset:
    """A cell's likelihood over its offset, as log S, mean and variance; None without times."""

    log_size: float
    mean: float
    variance: float


@dataclass(frozen=True)
class Model:
    """One member of the grid: what its offsets and its cells say.

    ``kernel`` is (cells, cells), s^2; ``mean`` and ``variance`` those of the cells' likelihoods.
    """

    kernel: Array
    offsets: tuple[Offset | None, ...]
    log_prior: float

    def log_evidence(self, cells: np.ndarray) -> float:
        """Return the logarithm of the density of the times of some cells."""
        places = [k for k in np.flatnonzero(cells) if self.offsets[k] is not None]
        if not places:
            return 0.0
        mean, variance, size = self._parts(places)
        matrix = self.kernel[np.ix_(places, places)] + np.diag(variance)
        root = np.linalg.cholesky(matrix)
        scaled = np.linalg.solve(root, mean)
        log = -0.5 * scaled @ scaled - np.log(np.diag(root)).sum()
        return float(size + log - 0.5 * len(places) * np.log(2.0 * np.pi))

    def predict(self, cells: np.ndarray) -> tuple[Array, Array]:
        """Return mean and variance of every cell's offset given some cells, (cells,) each."""
        places = [k for k in np.flatnonzero(cells) if self.offsets[k] is not None]
        mean, variance, _ = self._parts(places)
        matrix = self.kernel[np.ix_(places, places)] + np.diag(variance)
        across = self.kernel[:, places]
        gain = np.linalg.solve(matrix, across.T).T
        return gain @ mean, np.diag(self.kernel) - (gain * across).sum(axis=1)

    def _parts(self, places: Sequence[int]) -> tuple[Array, Array, float]:
        those = [o for k in places if (o := self.offsets[k]) is not None]
        sizes = sum(o.log_size for o in those)
        return np.array([o.mean for o in those]), np.array([o.variance for o in those]), sizes


@dataclass(frozen=True)
class Unknown:
    """The hypothesis with its evidence.

    ``engaged`` and ``as_failed`` are the logarithms of what is said of the shares, (cells,), the
    latter with the unknown shifts read as failed.
    """

    models: tuple[Model, ...]
    baseline: Array
    engaged: Array
    as_failed: Array

    @property
    def log_evidence(self) -> float:
        """Logarithm of the evidence of all cells."""
        return self._total() + float(self.engaged.sum())

    @property
    def log_evidence_as_failed(self) -> float:
        """The same with the unknown shifts read as failed."""
        return self._total() + float(self.as_failed.sum())

    def _total(self) -> float:
        cells = np.ones(self.baseline.size, dtype=bool)
        return float(logsumexp([m.log_prior + m.log_evidence(cells) for m in self.models]))

    def predict(self, cells: np.ndarray) -> tuple[Array, Array]:
        """Return mean time and variance of the offset of every cell given the data of some."""
        log = np.array([m.log_prior + m.log_evidence(cells) for m in self.models])
        weights = np.exp(log - logsumexp(log))
        kept = [(w, m.predict(cells)) for w, m in zip(weights, self.models, strict=True) if w > 1e-4]
        share = np.array([w for w, _ in kept])[:, None] / sum(w for w, _ in kept)
        means, variances = (np.array([one[k] for _, one in kept]) for k in (0, 1))
        mean = (share * means).sum(axis=0)
        spread = (share * (variances + (means - mean) ** 2)).sum(axis=0)
        return self.baseline + mean, spread


def unknown(problem: Problem, bench: Bench) -> Unknown:
    """Return the hypothesis for a data set."""
    spreads = problem.spreads((), np.zeros((1, 0)))
    means = np.array([float(mean_of(s)[0]) for s in spreads])
    places = np.array(
        [[np.log(c.point.profile.force), np.log(abs(c.point.mismatch) + RPM)] for c in bench.cells]
    )
    models = []
    for stretch, weight in STRETCHES.items():
        offsets = tuple(
            _offset(problem, seen, _stretched(spread, stretch))
            for seen, spread in zip(problem.seen, spreads, strict=True)
        )
        models += _grid(places, means, offsets, np.log(weight))
    shares = [
        [_free_share(o, s, o.failed + extra * o.unknown) for extra in (0, 1)]
        for o, s in zip(problem.seen, spreads, strict=True)
    ]
    plain, failed = np.array(shares).reshape(-1, 2).T
    return Unknown(tuple(models), means, plain, failed)


def _grid(
    places: Array, means: Array, offsets: tuple[Offset | None, ...], log_prior: float
) -> list[Model]:
    square = ((places[:, None] - places[None]) ** 2).sum(axis=2)
    known = means[np.isfinite(means)]
    relative = np.nan_to_num(means / known.mean(), nan=1.0) if known.size else np.ones(len(means))
    found = []
    number = len(SCALES) * len(LENGTHS) * 2
    for scale, length, weight in itertools.product(SCALES, LENGTHS, (1.0, relative)):
        shape = SMOOTH * np.exp(-0.5 * square / length**2) + (1.0 - SMOOTH) * np.eye(len(places))
        sizes = scale * weight * np.ones(len(places))
        kernel = np.outer(sizes, sizes) * shape
        found.append(Model(kernel, offsets, log_prior - float(np.log(number))))
    return found


def _stretched(spread: Spread, factor: float) -> Spread:
    mean = spread.times.mean(axis=1, keepdims=True)
    return replace(spread, times=mean + factor * (spread.times - mean))


def _offset(problem: Problem, seen: Observed, spread: Spread) -> Offset | None:
    """Return a cell's likelihood over its offset in the form of a normal density."""
    if not seen.shifts or not np.isfinite(spread.times).all():
        return None
    middle = seen.mean if not seen.singles.size else float(np.median(seen.singles))
    step = float(np.hypot(sd_of(spread)[0] / np.sqrt(seen.shifts), spread.error[0]))
    offsets = middle - float(mean_of(spread)[0]) + step * OFFSETS
    moved = Spread(
        spread.times + offsets[:, None],
        *(np.repeat(v, offsets.size) for v in (spread.engaged, spread.error, spread.engaged_error)),
    )
    log = log_times(seen, moved, problem.rules) + np.log(np.gradient(offsets))
    weights = np.exp(log - log.max())
    whole = weights.sum()
    mean = float(weights @ offsets / whole)
    variance = float(weights @ (offsets - mean) ** 2 / whole)
    return Offset(float(log.max() + np.log(whole)), mean, max(variance, 1e-10))


def _free_share(seen: Observed, spread: Spread, failed: int) -> float:
    """Return the log probability of a number engaged by the baseline's share, or by any."""
    tried = seen.engaged + failed
    by_baseline = float(log_engaged(seen, spread, failed)[0])
    return float(np.logaddexp(by_baseline, -np.log(tried + 1.0)) - np.log(2.0)) if tried else 0.0
