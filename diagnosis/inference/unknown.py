r"""Hypothesis *unknown*: a structured gap that no known effect explains.

Every cell's times are those of the baseline, moved by an offset :math:`b_c` of their own and
stretched by a common factor, or in each cell by another. The offsets are a Gaussian process over
the logarithms of force and mismatch,

.. math:: K_{ij} = A^2 w_i w_j (\rho e^{-d_{ij}^2 / 2 \ell^2} + (1 - \rho) \delta_{ij}),

with *w* one, or the baseline's mean time over its average. The likelihood of a cell as a function
of its offset is put into the form :math:`S_c N(b_c; m_c, v_c)`, exact for means, so that the
evidence is :math:`\prod S_c \cdot N(m; 0, V + K)`, summed over a grid of *A*, :math:`\ell`, *w*
and stretch. A cell's share engaged is the baseline's or anything, half and half. The marks of the
flight have offsets of their own (``diagnosis.likelihood.flight_likelihood``).
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from dogshape.diagnosis.bench.bench_data import Bench
from dogshape.diagnosis.likelihood.cell_likelihood import log_engaged
from dogshape.diagnosis.likelihood.cell_predictions import CellPredictions
from dogshape.diagnosis.likelihood.flight_likelihood import log_unknown
from dogshape.diagnosis.likelihood.mean_density import MeanDensity, log_outliers
from dogshape.diagnosis.likelihood.observations import Observed
from dogshape.diagnosis.likelihood.scores import Problem
from dogshape.diagnosis.likelihood.time_parts import log_sum
from dogshape.diagnosis.settings import Unlisted
from dogshape.diagnosis.terms import Array
from dogshape.sim.units import RPM

SCALES = 12  #: standard deviations of the offsets that are summed over
OFFSETS = np.sinh(np.linspace(-6.0, 6.0, 121)) / 4.0  #: in standard errors, to 50 either side


@dataclass(frozen=True)
class Offset:
    """A cell's likelihood over its offset, as log S, mean and variance; None without times."""

    log_size: float
    mean: float
    variance: float


@dataclass(frozen=True)
class Model:
    """Member of the grid: prior of the offsets, and the cells' likelihoods over them.

    ``kernel`` is (cells, cells), s^2; ``mean`` and ``variance`` those of the cells' likelihoods.
    """

    kernel: Array
    offsets: tuple[Offset | None, ...]
    log_prior: float

    def predict(self, cells: np.ndarray) -> tuple[Array, Array]:
        """Return mean and variance of every cell's offset given some cells, (cells,) each."""
        places = self._having(cells)
        mean, variance = self._parts(places)
        matrix = self.kernel[np.ix_(places, places)] + np.diag(variance)
        across = self.kernel[:, places]
        gain = np.linalg.solve(matrix, across.T).T
        return gain @ mean, np.diag(self.kernel) - (gain * across).sum(axis=1)

    def coefficient(self, direction: Array) -> tuple[float, float]:
        """Return mean and variance of the standard normal coefficient of a direction, s, (cells,).

        The direction is part of the kernel.
        """
        places = self._having(np.ones(len(self.kernel), dtype=bool))
        mean, variance = self._parts(places)
        across = direction[places]
        gain = np.linalg.solve(self.kernel[np.ix_(places, places)] + np.diag(variance), across)
        return float(gain @ mean), max(0.0, 1.0 - float(gain @ across))

    def _having(self, cells: np.ndarray) -> list[int]:
        return [k for k in np.flatnonzero(cells).tolist() if self.offsets[k] is not None]

    def _parts(self, places: Sequence[int]) -> tuple[Array, Array]:
        those = [o for k in places if (o := self.offsets[k]) is not None]
        return np.array([o.mean for o in those]), np.array([o.variance for o in those])


@dataclass(frozen=True)
class Unknown:
    """Hypothesis *unknown* with its evidence.

    ``engaged`` and ``as_failed`` are the logarithms of what is said of the shares, (cells,), the
    latter with the unknown shifts read as failed; ``flight`` that of the marks of flights, ``told``
    that of direct tests.
    """

    models: tuple[Model, ...]
    baseline: Array
    engaged: Array
    as_failed: Array
    flight: float = 0.0
    told: float = 0.0

    @property
    def log_evidence(self) -> float:
        """Logarithm of the evidence of all cells."""
        return self._total() + float(self.engaged.sum()) + self.flight + self.told

    def log_evidence_of(self, cells: np.ndarray, flown: float = 1.0) -> float:
        """Compute the logarithm of the evidence of some cells.

        ``flown`` is their part of what is said of the marks of flights.
        """
        times = float(log_sum(self._logs(cells), axis=0))
        return times + float(self.engaged[cells].sum()) + flown * self.flight + self.told

    @property
    def log_evidence_as_failed(self) -> float:
        """The same with the unknown shifts read as failed."""
        return self._total() + float(self.as_failed.sum()) + self.flight + self.told

    def _total(self) -> float:
        return float(log_sum(self._all_logs, axis=0))

    @cached_property
    def _all_logs(self) -> Array:
        return self._logs(np.ones(self.baseline.size, dtype=bool))

    @cached_property
    def _kernels(self) -> Array:
        """Priors of the offsets of all members, (members, cells, cells)."""
        return np.array([m.kernel for m in self.models])

    @cached_property
    def _offsets(self) -> Array:
        """Log S, mean and variance of the cells' likelihoods, (3, members, cells); NaN without."""
        nothing = Offset(np.nan, np.nan, np.nan)
        every = [[offset or nothing for offset in m.offsets] for m in self.models]
        found = np.array([[(o.log_size, o.mean, o.variance) for o in row] for row in every])
        return np.moveaxis(found, -1, 0)

    def _logs(self, cells: np.ndarray) -> Array:
        """Compute the log density of the times of some cells with the prior, (members,).

        The matrices of all members are factored in one call. Cells that have times are those of
        all members.
        """
        log_prior = np.array([m.log_prior for m in self.models])
        places = [k for k in np.flatnonzero(cells) if self.models[0].offsets[k] is not None]
        if not places:
            return log_prior
        sizes, mean, variance = self._offsets[:, :, places]
        matrix = self._kernels[:, places][:, :, places]
        matrix[:, range(len(places)), range(len(places))] += variance
        return log_prior + sizes.sum(axis=1) + log_normal(mean, matrix)

    def draw(self, direction: Array, count: int, generator: np.random.Generator) -> Array:
        """Draw the coefficient of a direction that cells err along together, (count,)."""
        log = self._all_logs
        weights = np.exp(log - log_sum(log, axis=0))
        parts = generator.multinomial(count, weights / weights.sum())
        found = [
            generator.normal(mean, np.sqrt(variance), many)
            for model, many in zip(self.models, parts.tolist(), strict=True)
            if many
            for mean, variance in [model.coefficient(direction)]
        ]
        return np.concatenate(found) if found else np.zeros(0)

    def predict(self, cells: np.ndarray) -> tuple[Array, Array]:
        """Return mean time and variance of the offset of every cell given the data of some."""
        log = self._logs(cells)
        weights = np.exp(log - log_sum(log, axis=0))
        kept = [
            (w, m.predict(cells)) for w, m in zip(weights, self.models, strict=True) if w > 1e-4
        ]
        share = np.array([w for w, _ in kept])[:, None] / sum(w for w, _ in kept)
        means, variances = (np.array([one[k] for _, one in kept]) for k in (0, 1))
        mean = (share * means).sum(axis=0)
        spread = (share * (variances + (means - mean) ** 2)).sum(axis=0)
        return self.baseline + mean, spread


def log_normal(apart: Array, covariance: Array) -> Array:
    """Compute log densities of normal vectors (members, k) round zero, (members,).

    ``covariance`` is (members, k, k).
    """
    root = np.linalg.cholesky(covariance)
    scaled = np.linalg.solve(root, apart[..., None])[..., 0]
    spread = np.log(np.diagonal(root, axis1=1, axis2=2)).sum(axis=1)
    log: Array = -0.5 * (scaled**2).sum(axis=1) - spread
    return log - 0.5 * apart.shape[1] * np.log(2.0 * np.pi)


def unknown(problem: Problem, bench: Bench) -> Unknown:
    """Fit the hypothesis *unknown* to a data set."""
    seen, predicted = problem.seen, problem.predictions((), np.zeros((1, 0)))
    means = predicted.whole[0][:, 0]
    places = np.array(
        [[np.log(c.point.profile.force), np.log(abs(c.point.mismatch) + RPM)] for c in bench.cells]
    )
    models, prior = [], problem.settings.unlisted
    kernels = _kernels(places, means, prior)
    for stretch, shape, weight in prior.stretches:
        offsets = offsets_of_cells(seen, _stretched(predicted, stretch, shape))
        log_prior = float(np.log(weight)) - float(np.log(len(kernels)))
        models += [Model(k + problem.discrepancy.covariance, offsets, log_prior) for k in kernels]
    plain, failed = (_free_share(seen, predicted, extra) for extra in (0.0, 1.0))
    flown = problem.flown((), np.zeros((1, 0)))
    freedom = problem.settings.likelihood.flight_freedom
    flight = log_unknown(problem.flights, flown, prior, freedom)
    return Unknown(tuple(models), means, plain, failed, flight)


def _kernels(places: Array, means: Array, prior: Unlisted) -> list[Array]:
    """Return the covariances of the offsets, (cells, cells) each, all as probable."""
    square = ((places[:, None] - places[None]) ** 2).sum(axis=2)
    known = means[np.isfinite(means)]
    relative = np.nan_to_num(means / known.mean(), nan=1.0) if known.size else np.ones(len(means))
    found, smooth = [], prior.smooth
    scales = np.geomspace(prior.least_offset, prior.most_offset, SCALES)
    for scale, length, weight in itertools.product(scales, prior.lengths, (1.0, relative)):
        shape = smooth * np.exp(-0.5 * square / length**2) + (1.0 - smooth) * np.eye(len(places))
        sizes = scale * weight * np.ones(len(places))
        found.append(np.outer(sizes, sizes) * shape)
    return found


def _stretched(predicted: CellPredictions, factor: float, shape: float | None) -> CellPredictions:
    times = predicted.mean[..., None] + factor * (predicted.times - predicted.mean[..., None])
    error = predicted.shape if shape is None else np.full_like(predicted.shape, shape)
    return replace(predicted, times=times, sd=factor * predicted.sd, shape=error)


def offsets_of_cells(seen: Observed, predicted: CellPredictions) -> tuple[Offset | None, ...]:
    """Return each cell's likelihood over its offset in the form of a normal density.

    The likelihood is a mixture of normal parts, whose mass, mean and variance are summed.
    """
    # A cell's own offset is no jump that the emulator missed.
    plain = replace(predicted, missed=np.zeros_like(predicted.missed))
    known = (seen.n > 0) & np.isfinite(plain.mean[:, 0])
    density = MeanDensity.of(seen, plain)
    logs = density.log_share[:, 0]
    sizes = log_sum(logs, axis=1)
    weights = np.exp(logs - sizes[:, None])
    centres, widths = density.score[:, 0] * density.width[:, 0], density.width[:, 0]
    means = (weights * centres).sum(axis=1)
    variances = (weights * (widths**2 + (centres - means[:, None]) ** 2)).sum(axis=1)
    sizes = sizes - density.found[:, 0] + log_outliers(seen, plain)[:, 0]
    every = zip(sizes.tolist(), means.tolist(), variances.tolist(), strict=True)
    return tuple(
        Offset(*one) if there else None for there, one in zip(known.tolist(), every, strict=True)
    )


def _free_share(seen: Observed, predicted: CellPredictions, extra: float) -> Array:
    """Return the log probability of numbers engaged by the baseline's share, or by any, (cells,).

    ``extra`` is the share of unknown shifts that count as failed.
    """
    failed = seen.failed + extra * seen.unknown
    by_baseline = log_engaged(seen, predicted, failed)[:, 0]
    return np.logaddexp(by_baseline, -np.log(seen.engaged + failed + 1.0)) - np.log(2.0)
