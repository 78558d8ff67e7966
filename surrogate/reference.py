"""What the simulation says of an expected time, to hold the surrogate against."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from surrogate.covariance import Array
from surrogate.dataset import Dataset
from surrogate.mix import Mix


@dataclass(frozen=True)
class Reference:
    """Designs that were simulated at every point of a mix.

    Parameters
    ----------
    x : designs, (k, d), edge units.
    time, error : expected time over the mix, retries included, and its standard error, (k,), s.
    means, errors : of the shifts that engage at each point, (k, m), s; NaN where none did.
    spreads : standard deviation of such a shift, (k, m), s.
    shares : share engaged, (k, m).
    """

    x: Array
    time: Array
    error: Array
    means: Array
    errors: Array
    spreads: Array
    shares: Array

    def __len__(self) -> int:
        return len(self.time)


def reference_of(data: Dataset, mix: Mix) -> Reference:
    """Return the designs of a data set that have every point of the mix and engage at each.

    Rows of several seeds at one point count by their shifts.
    """
    count, size = len(data.designs), len(mix.points)
    node = _node_of(data.points, mix.points)
    place = data.design_of_row
    engaged, shifts = np.zeros((count, size)), np.zeros((count, size))
    time, variance, spread = (np.zeros((count, size)) for _ in range(3))
    of_row = zip(
        place, node, data.column("engaged"), data.column("shifts"), data.column("mean_s"),
        data.column("standard_error_s"), data.column("sd_s"), strict=True,
    )  # fmt: skip
    for k, j, good, n, mean, error, sd in of_row:
        if j < 0:
            continue
        shifts[k, j] += n
        if good > 0:
            engaged[k, j] += good
            time[k, j] += good * mean
            variance[k, j] += (good * error) ** 2
            spread[k, j] += good * sd**2
    whole = (shifts > 0).all(axis=1) & (engaged > 0).all(axis=1)
    engaged, shifts = engaged[whole], shifts[whole]
    means, errors = time[whole] / engaged, np.sqrt(variance[whole]) / engaged
    share = engaged / shifts
    retry = (1.0 - share) / share * mix.retry
    retry_error = np.sqrt(share * (1.0 - share) / shifts) / share**2 * mix.retry
    total = np.sqrt((errors**2 + retry_error**2) @ mix.weights**2)
    spreads = np.sqrt(spread[whole] / engaged)
    designs = data.designs[whole]
    return Reference(designs, (means + retry) @ mix.weights, total, means, errors, spreads, share)


def _node_of(points: Array, nodes: Array) -> list[int]:
    """Return for each operating point (n, 2) its place among the nodes, -1 if it is none."""
    places = {tuple(np.round(node, 6)): j for j, node in enumerate(nodes)}
    return [places.get(tuple(np.round(point, 6)), -1) for point in points]
