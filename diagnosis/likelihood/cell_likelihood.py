"""Likelihood of a cell of bench data under the prediction of a hypothesis.

Times have the density of ``diagnosis.likelihood.mean_density``. What cells err in common
(``diagnosis.likelihood.discrepancy``) need slope and curvature of it over an offset, at one that is
likely (``diagnosis.likelihood.likely_offsets``). Shares engaged are beta-binomial with the error of
the emulated share. Unknown shifts are left out, or counted as failed on request.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import betaln, gammaln

from dogshape.diagnosis.likelihood.cell_predictions import CellPredictions
from dogshape.diagnosis.likelihood.discrepancy import Slopes
from dogshape.diagnosis.likelihood.mean_density import MeanDensity, log_outliers
from dogshape.diagnosis.likelihood.observations import Observed
from dogshape.diagnosis.terms import Array


def log_as_failed(seen: Observed, predicted: CellPredictions, engaged: Array) -> Array:
    """Compute the change of the log probability if unknown shifts are failures, (cells, m).

    ``engaged`` is the log probability of the numbers engaged where they are left out.
    """
    if not seen.unknown.any():
        return np.zeros_like(predicted.engaged)
    return log_engaged(seen, predicted, seen.failed + seen.unknown) - engaged


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


def timed(
    seen: Observed,
    predicted: CellPredictions,
    of_means: tuple[Array, Array, Array] | None = None,
) -> Timed:
    """Return the logarithm of the density of each cell's times, with its slopes.

    ``of_means`` are log density, slope and curvature of the means, (cells, m) each, those without
    an offset by default (``diagnosis.likelihood.likely_offsets`` has others).
    """
    having = (seen.n > 0)[:, None]
    parts = MeanDensity.of(seen, predicted).at() if of_means is None else of_means
    log, first, second = (np.where(having, part, 0.0) for part in parts)
    log = log + log_outliers(seen, predicted)
    # A hypothesis by which nothing engages has no times; any time is then as good as another.
    anyhow = seen.shifts[:, None] * np.log(predicted.rules.late_anything / seen.timeout)
    known = np.isfinite(predicted.mean)
    first, second = (np.where(known, np.nan_to_num(part), 0.0) for part in (first, second))
    return Timed(np.where(known, log, anyhow), first, second)


def log_times(seen: Observed, predicted: CellPredictions) -> Array:
    """Return the logarithm of the density of each cell's times, (cells, m)."""
    return timed(seen, predicted).log


def log_engaged(seen: Observed, predicted: CellPredictions, failed: Array) -> Array:
    """Return the log probability of the numbers engaged, (cells, m), beta-binomial."""
    a, b = beta_of(predicted)
    engaged, missed = seen.engaged[:, None], failed[:, None]
    tried = engaged + missed
    ways = gammaln(tried + 1) - gammaln(engaged + 1) - gammaln(missed + 1)
    return ways + betaln(a + engaged, b + missed) - betaln(a, b)


def beta_of(predicted: CellPredictions) -> tuple[Array, Array]:
    """Return the parameters of the Beta with the emulated share and its error, (cells, m) each."""
    # A share of exactly one with no error would make one failure impossible.
    share = np.clip(predicted.engaged, 2e-3, 1.0 - 2e-3)
    most = share * (1.0 - share)
    size = most / np.clip(predicted.engaged_error**2, 1e-6, 0.9 * most) - 1.0
    return share * size, (1.0 - share) * size
