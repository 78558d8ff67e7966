"""Signatures: predictions in units of the errors of the data, as points with a distance.

The signature of a prediction has a coordinate for each mean time and each share engaged. The
logarithm of the spread is a further one for each cell with single shifts. Each coordinate is
divided by its standard error at the data set's number of shifts, errors of the simulation included.
Marks of the flight add one independent coordinate each. Half the squared distance of two signatures
is about the expected log Bayes factor between them. A squared distance of 4 is two standard errors
in all.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dogshape.diagnosis.likelihood.cell_likelihood import sample_spread
from dogshape.diagnosis.likelihood.flight_likelihood import whitening
from dogshape.diagnosis.likelihood.observations import Observed
from dogshape.diagnosis.likelihood.scores import PredictionSummary
from dogshape.diagnosis.settings import USUAL
from dogshape.diagnosis.terms import Array

VISIBLE = USUAL.decision.visible  #: squared distance from which predictions can be told apart


@dataclass(frozen=True)
class Metric:
    """Standard errors of a data set, (cells,) each; infinite where no data are.

    ``core`` is that of the mean without outliers, ``mean`` that of all shifts. ``flight``
    (K, K) makes the marks of the flight independent, of standard error 1.
    """

    mean: Array
    log_sd: Array
    engaged: Array
    core: Array
    flight: Array | None = None

    def of(self, predicted: PredictionSummary) -> Array:
        """Return signatures, (m, coordinates)."""
        parts = zip(
            (predicted.core, predicted.log_sd, predicted.engaged),
            (self.core, self.log_sd, self.engaged),
            strict=True,
        )
        found = [np.nan_to_num(part[:, known(e)] / e[known(e)]) for part, e in parts]
        if self.flight is not None and predicted.flight is not None:
            found.append(predicted.flight @ self.flight.T)
        return np.hstack(found)


def known(errors: Array) -> np.ndarray:
    """Mark the finite errors."""
    return np.isfinite(errors)


def metric_of(seen: Observed, baseline: PredictionSummary) -> Metric:
    """Return the standard errors, spreads and errors from the baseline (1, cells)."""
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
    return Metric(mean, log_sd, engaged, core, flight)


def squared(one: Array, other: Array) -> Array:
    """Return squared distances between signatures (m, k) and (n, k), (m, n)."""
    cross = (one**2).sum(axis=1)[:, None] + (other**2).sum(axis=1) - 2.0 * one @ other.T
    return np.maximum(cross, 0.0)
