"""Gaps before and after at operating points that the fit did not use.

Each force, then each speed, is left out. The hypothesis is refitted to the other cells by new
weights of its rows, and predicts the cells left out. So every cell is predicted twice.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from dogshape.diagnosis.bench.bench_data import Bench
from dogshape.diagnosis.likelihood.observations import Observed
from dogshape.diagnosis.likelihood.scores import PredictionSummary, Scored
from dogshape.diagnosis.likelihood.signature import Metric, known
from dogshape.diagnosis.terms import Array

Predict = Callable[[np.ndarray], Array]  #: mean times of all cells from the data of some


@dataclass(frozen=True)
class HeldOut:
    """Root-mean-square gaps, s: baseline, held out, and floor; ``shrink`` in [-1, 1].

    What cannot be said (a single operating point, no gap above the floor) is None.
    """

    baseline: float | None
    held_out: float | None
    floor: float | None

    @property
    def shrink(self) -> float | None:
        """Share of the gap above the floor that is gone."""
        if self.baseline is None or self.held_out is None or self.floor is None:
            return None
        above = self.baseline - self.floor
        # With a gap of noise alone there is nothing to shrink.
        if above <= 0.05 * self.floor:
            return 0.0
        return min(1.0, max(-1.0, 1.0 - (self.held_out - self.floor) / above))


def folds(bench: Bench) -> list[np.ndarray]:
    """List the cells to leave out, one force, then one speed at a time."""
    forces = np.array([cell.point.profile.force for cell in bench.cells])
    speeds = np.array([cell.point.mismatch for cell in bench.cells])
    found = [column == value for column in (forces, speeds) for value in np.unique(column)]
    return [fold for fold in found if not fold.all()]


def by_effects(found: Scored) -> Predict:
    """Make the predictor of a hypothesis after a refit; NaN where none of its values engages."""
    means = found.rows.predicted.mean
    there = np.isfinite(means)

    def predict(cells: np.ndarray) -> Array:
        # A value by which nothing engages has no mean time, which is not a time of zero.
        weights = found.weights(cells)[:, None] * there
        whole = weights.sum(axis=0)
        summed = (weights * np.where(there, means, 0.0)).sum(axis=0)
        return np.where(whole > 0.0, summed / np.where(whole > 0.0, whole, 1.0), np.nan)

    return predict


def held_out(
    bench: Bench, seen: Observed, baseline: PredictionSummary, metric: Metric, predict: Predict
) -> HeldOut:
    """Compute gaps before and after; predictions come from refits without each cell."""
    times = seen.time
    having = known(times) & known(baseline.mean[0])
    if not having.any():
        return HeldOut(None, None, None)
    gaps = times - baseline.mean[0]
    left = [(times - predict(~fold))[fold & having] for fold in folds(bench)]
    after = np.concatenate(left) if left else np.array([])
    after = after[np.isfinite(after)]
    return HeldOut(_rms(gaps[having]), _rms(after), _rms(metric.mean[having]))


def _rms(values: Array) -> float | None:
    return math.sqrt(float((values**2).mean())) if values.size else None
