"""Mean times of a truth over even relative angles: what its engine has without scatter."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from dogshape.diagnosis.prediction.outliers import bulk
from dogshape.validation.blind.data import even_times
from dogshape.validation.blind.stand import Point, Stand, Truth

ANGLES = 8  #: even ones, at each operating point


def even_means(
    stand: Stand,
    points: Sequence[Point],
    truth: Truth,
    name: str = "mujoco",
    count: int = ANGLES,
) -> np.ndarray:
    """Return mean times at even angles, weighted as the truth draws them, s, (points,)."""
    turns = (np.arange(count) + 0.5) / count
    weights = np.exp(truth.concentration * (np.cos(2.0 * np.pi * (turns - truth.centre)) - 1.0))
    times = np.array(even_times(stand, points, count, truth, name), float)
    having = np.isfinite(bulk(times))
    # Late shifts are left out, as in the size of a gap; where no shift engages there is no mean.
    share = np.where(having.any(axis=1), (having * weights).sum(axis=1), np.nan)
    return (np.where(having, times, 0.0) * weights).sum(axis=1) / share
