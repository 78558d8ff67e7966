"""Mean times that a hypothesis predicts of each operating point from all others.

The parameters and the size of the discrepancy are those given the data of the other points, so that
no point is predicted from itself. A draw adds the error of the simulation at the point, the
discrepancy there with either sign, the scatter of as many shifts as were made, and late ones among
them. What the discrepancy would have to be to save a hypothesis is left out, since that is no
prediction; so are odd cells.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from dogshape.diagnosis.inference.influence import heavy_rows
from dogshape.diagnosis.likelihood.cell_predictions import CellPredictions
from dogshape.diagnosis.likelihood.discrepancy import Discrepancy
from dogshape.diagnosis.likelihood.left_out import left_out
from dogshape.diagnosis.likelihood.scores import Problem, Scored
from dogshape.diagnosis.likelihood.time_parts import outlier_delay
from dogshape.diagnosis.terms import Array, Hypothesis

DRAWN = 2000  #: values at each operating point
SHARES = (0.05, 0.25, 0.5, 0.75, 0.95)  #: of the distribution


@dataclass(frozen=True)
class PredictedMeans:
    """Distribution of the mean time of each operating point by a hypothesis.

    Parameters
    ----------
    quantiles : at ``SHARES``, s, (cells, 5); NaN where there is no time.
    below : share of the distribution below the mean that was measured, (cells,), NaN likewise.
    """

    hypothesis: Hypothesis
    quantiles: Array
    below: Array

    @property
    def inside(self) -> np.ndarray:
        """Mark the cells whose mean lies within 90 %, (cells,)."""
        return (self.below >= SHARES[0]) & (self.below <= SHARES[-1])

    @property
    def known(self) -> np.ndarray:
        """Mark the cells that have a mean to compare, (cells,)."""
        return np.isfinite(self.below)

    def as_dict(self, points: list[tuple[float, float]]) -> dict[str, Any]:
        """Write the record; ``points`` are mismatch in 1/min and force in N of all cells."""
        return {
            "effects": list(self.hypothesis),
            "within_90": int((self.inside & self.known).sum()),
            "of": int(self.known.sum()),
            "cells": [
                {
                    "mismatch_rpm": mismatch,
                    "force_N": force,
                    "quantiles_s": self.quantiles[place].tolist(),
                    "below": float(self.below[place]),
                }
                for place, (mismatch, force) in enumerate(points)
                if self.known[place]
            ],
        }


def predicted_means(problem: Problem, one: Scored) -> PredictedMeans:
    """Draw the mean time of each cell that has one, given the data of all others."""
    seen, one = problem.seen, heavy_rows(one)
    rows = one.rows
    values = one.space.values(rows.shares)
    predicted = problem.predictions(one.hypothesis, values)
    left = left_out(rows.slopes, rows.discrepancy, rows.joint)
    alone = rows.log_likelihood.sum(axis=1)[:, None] - rows.log_likelihood
    log = (one.log_prior[:, None] + alone)[..., None] + left.log_weight
    generator = np.random.default_rng(1)
    delay, deviation = outlier_delay(seen, predicted)
    quantiles, below = np.full((seen.cells, len(SHARES)), np.nan), np.full(seen.cells, np.nan)
    times = seen.time
    for cell in np.flatnonzero(np.isfinite(times)).tolist():
        engages = np.isfinite(predicted.mean[cell])[:, None]
        weights = np.exp(log[:, cell] - log[:, cell].max()) * engages
        if not weights.sum() > 0.0:
            continue
        picks = generator.choice(weights.size, DRAWN, p=weights.ravel() / weights.sum())
        row, member = np.divmod(picks, weights.shape[1])
        late = delay[cell, row], deviation[cell, row]
        common = _common(rows.discrepancy, cell)[member] + rows.joint[row, cell] ** 2
        drawn = _drawn(predicted, (cell, row), common, generator)
        drawn = drawn + _scatter(predicted, (cell, row), float(seen.shifts[cell]), late, generator)
        quantiles[cell] = np.quantile(drawn, SHARES)
        below[cell] = (drawn < times[cell]).mean()
    return PredictedMeans(one.hypothesis, quantiles, below)


def _drawn(
    predicted: CellPredictions, at: tuple[int, np.ndarray], common: Array,
    generator: np.random.Generator,
) -> Array:  # fmt: skip
    """Draw expected times of a cell, with all errors of the simulation, s, (draws,).

    ``common`` is the variance of those that cells have in common, s^2, (draws,).
    """
    error = np.sqrt(predicted.error[at] ** 2 + common)
    drawn: Array = predicted.mean[at] + error * generator.standard_normal(at[1].size)
    return drawn


def _common(prior: Discrepancy, cell: int) -> Array:
    """Compute the variance of a cell's discrepancy before the data, each member's, s^2."""
    square = np.array([(root[cell] ** 2).sum() for root in prior.roots])
    beside = 0.0 if prior.beside is None else (prior.beside[cell] ** 2).sum()
    found: Array = (square[:, None] * prior.amplitudes**2).ravel() + beside
    return found


def _scatter(
    predicted: CellPredictions,
    at: tuple[int, np.ndarray],
    shifts: float,
    late: tuple[Array, Array],
    generator: np.random.Generator,
) -> Array:
    """Draw what so many shifts add to their mean by chance, s, (draws,)."""
    cell, row = at
    number = generator.binomial(int(shifts), predicted.outlier_share[cell, row])
    square = predicted.sd[cell, row] ** 2 / shifts + number * (late[1] / shifts) ** 2
    noise = np.sqrt(square) * generator.standard_normal(row.size)
    drawn: Array = number * late[0] / shifts + noise
    return drawn
