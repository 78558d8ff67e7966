"""Reference values of expected times from the simulation, to judge the surrogate.

Times are those of shifts that engage. One shift in some hundreds may hang crest on crest and cost a
second. Dense simulations of a design hold one such shift or none, and their mean would depend on
that draw. Shares engaged are compared by their counts instead, over all references.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from dogshape.surrogate.covariance import Array
from dogshape.surrogate.dataset import Dataset, among
from dogshape.surrogate.mix import Mix


@dataclass(frozen=True)
class Reference:
    """Designs that were simulated at every point of a mix.

    Parameters
    ----------
    x : designs, (k, d), edge units.
    time, error : expected time of the shifts that engage over the mix, and its standard
        error, (k,), s.
    means, errors : of the shifts that engage at each point, (k, m), s.
    spreads : standard deviation of such a shift, (k, m), s.
    lost, shifts : how many did not engage, and how many were made, (k, m).
    """

    x: Array
    time: Array
    error: Array
    means: Array
    errors: Array
    spreads: Array
    lost: Array
    shifts: Array

    def __len__(self) -> int:
        return len(self.time)

    def of(self, designs: Array) -> Reference:
        """Return the references that are among ``designs`` (k, d)."""
        kept = among(self.x, designs)
        return Reference(*(getattr(self, field.name)[kept] for field in fields(self)))


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
    whole = (engaged > 0).all(axis=1)
    engaged, shifts = engaged[whole], shifts[whole]
    means, errors = time[whole] / engaged, np.sqrt(variance[whole]) / engaged
    return Reference(
        x=data.designs[whole],
        time=means @ mix.weights,
        error=np.sqrt(errors**2 @ mix.weights**2),
        means=means,
        errors=errors,
        spreads=np.sqrt(spread[whole] / engaged),
        lost=shifts - engaged,
        shifts=shifts,
    )


def _node_of(points: Array, nodes: Array) -> list[int]:
    """Return for each operating point (n, 2) its place among the nodes, -1 if it is none."""
    places = {tuple(np.round(node, 6)): j for j, node in enumerate(nodes)}
    return [places.get(tuple(np.round(point, 6)), -1) for point in points]
