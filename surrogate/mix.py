"""A mix of operating points: where a clutch is shifted, and how often."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dogshape.sim.shift.clutch import OperatingPoint
from dogshape.sim.units import RPM
from dogshape.surrogate.covariance import Array


@dataclass(frozen=True)
class Mix:
    """Operating points with weights that add up to one.

    Parameters
    ----------
    points : mismatch in 1/min and force in N, (m, 2).
    weights : (m,).
    retry : time that a shift which does not engage costs, s.
    """

    points: Array
    weights: Array
    retry: float

    def at(self, index: int) -> Mix:
        """Return the mix that is one of the points alone."""
        return Mix(self.points[index : index + 1], np.ones(1), self.retry)


def mix_of(points: Sequence[OperatingPoint], retry: float) -> Mix:
    """Return the mix of weighted operating points; ``retry`` in s."""
    weights = np.array([point.weight for point in points])
    rows = [(point.mismatch / RPM, point.profile.force) for point in points]
    return Mix(np.array(rows), weights / weights.sum(), retry)
