"""Signatures: predictions in units of the errors of the data, as points with a distance.

The signature of a prediction has a coordinate for each mean time and each share engaged. The
logarithm of the spread is a further one for each cell with single shifts. Each coordinate is
divided by its standard error at the data set's number of shifts, errors of the simulation included.
Mean times err in common besides, by the discrepancy before the data
(``diagnosis.likelihood.discrepancy``): their coordinates are whitened by the covariance of both, so
that what a discrepancy may as well have made is near. Marks of the flight add one independent
coordinate each. Half the squared distance of two signatures is about the expected log Bayes factor
between them. A squared distance of 4 is two standard errors in all.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dogshape.diagnosis.likelihood.discrepancy import Discrepancy
from dogshape.diagnosis.likelihood.flight_likelihood import whitening
from dogshape.diagnosis.likelihood.observations import Observed
from dogshape.diagnosis.likelihood.scores import PredictionSummary
from dogshape.diagnosis.likelihood.time_parts import sample_spread
from dogshape.diagnosis.settings import USUAL
from dogshape.diagnosis.terms import Array

VISIBLE = USUAL.decision.visible  #: squared distance from which predictions can be told apart


@dataclass(frozen=True)
class Metric:
    """Standard errors of a data set, (cells,) each; infinite where no data are.

    ``core`` is that of the mean without outliers, ``mean`` that of all shifts. ``whitening``
    (k, k) makes the k means without outliers that have data independent, of standard error 1, what
    cells err in common included; ``flight`` (K, K) likewise the marks of the flight.
    """

    mean: Array
    log_sd: Array
    engaged: Array
    core: Array
    whitening: Array
    flight: Array | None = None

    @property
    def precision(self) -> Array:
        """Weights of the cells in a squared distance, 1/s^2, (cells,); 0 without data."""
        found = np.zeros(len(self.core))
        found[known(self.core)] = (self.whitening**2).sum(axis=0)
        return found

    def of(self, predicted: PredictionSummary) -> Array:
        """Return signatures, (m, coordinates)."""
        parts = zip((predicted.log_sd, predicted.engaged), (self.log_sd, self.engaged), strict=True)
        means = np.nan_to_num(predicted.core[:, known(self.core)]) @ self.whitening.T
        found = [means, *(np.nan_to_num(part[:, known(e)] / e[known(e)]) for part, e in parts)]
        if self.flight is not None and predicted.flight is not None:
            found.append(predicted.flight @ self.flight.T)
        return np.hstack(found)


def known(errors: Array) -> np.ndarray:
    """Mark the finite errors."""
    return np.isfinite(errors)


def metric_of(seen: Observed, baseline: PredictionSummary, discrepancy: Discrepancy) -> Metric:
    """Return the standard errors, spreads and errors from the baseline (1, cells).

    ``discrepancy`` is what the means of all cells err in common before the data.
    """
    shifts, tried = seen.shifts, seen.tried
    share = np.clip(baseline.engaged[0], 0.02, 0.98)
    with np.errstate(divide="ignore"):
        mean, core = (
            np.sqrt(sd[0] ** 2 / shifts + baseline.error[0] ** 2)
            for sd in (baseline.sd, baseline.core_sd)
        )
        mean, core = (np.where(np.isfinite(one), one, np.inf) for one in (mean, core))
        log_sd = np.sqrt(sample_spread(seen.freedom)[1] + baseline.shape[0] ** 2)
        log_sd = np.where(seen.freedom > 0, log_sd, np.inf)
        engaged = np.sqrt(share * (1.0 - share) / tried + baseline.engaged_error[0] ** 2)
    flight = whitening(seen.flights) if baseline.flight is not None else None
    having = known(core)
    covariance = np.diag(core[having] ** 2) + discrepancy.covariance[np.ix_(having, having)]
    independent: Array = np.linalg.inv(np.linalg.cholesky(covariance))
    return Metric(mean, log_sd, engaged, core, independent, flight)


def squared(one: Array, other: Array) -> Array:
    """Return squared distances between signatures (m, k) and (n, k), (m, n)."""
    cross = (one**2).sum(axis=1)[:, None] + (other**2).sum(axis=1) - 2.0 * one @ other.T
    return np.maximum(cross, 0.0)
