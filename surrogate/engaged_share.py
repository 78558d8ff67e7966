r"""Share of shifts that engage: near one, near zero, or in between, never outside.

Engaged and all shifts of the rows are counted with a weight that falls with their
distance, on top of a prior with the overall share (correlated Beta process, Goetschalckx,
Poupart and Hoey 2011):

.. math:: p(z) \sim Beta(s \bar p + \sum_i c_i k_i,\; s (1 - \bar p) + \sum_i c_i (n_i - k_i)),
   \quad c_i = e^{-|z - z_i|^2/2\ell^2}

Length :math:`\ell` and strength *s* of the prior are those that best predict the counts of
designs left out. A Gaussian process of the logit would pull shares that are nearly always
one away from it, and each thousandth costs a retry.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import inf

import numpy as np

from dogshape.surrogate.covariance import Array, Places, distance

LENGTHS = (0.1, 0.2, 0.4, inf)  #: of designs scaled to one, and of operating points
STRENGTHS = (1.0, 10.0, 100.0)


@dataclass(frozen=True)
class Share:
    """Counts with their inputs, the length and the strength of the prior.

    Parameters
    ----------
    designs : number of coordinates of a design.
    inputs : (n, d + p).
    engaged, shifts : counts of each row, (n,).
    """

    designs: int
    inputs: Array
    engaged: Array
    shifts: Array
    length: float
    strength: float

    @property
    def overall(self) -> float:
        """Share of all shifts after Jeffreys, which is never 0 or 1."""
        return float((self.engaged.sum() + 0.5) / (self.shifts.sum() + 1.0))

    def at(self, inputs: Array) -> tuple[Array, Array]:
        """Return share and its variance at inputs (m, d + p), each (m,)."""
        cut = self.designs
        near = _nearness(inputs[:, :cut], self.inputs[:, :cut], self.length)
        near *= _nearness(inputs[:, cut:], self.inputs[:, cut:], self.length)
        return self._beta(near @ self.engaged, near @ (self.shifts - self.engaged))

    def over(self, x: Array, nodes: Array, known: Array, place: Places) -> tuple[Array, Array]:
        """Return share and variance of designs (m, d) at operating points (q, p), each (m, q).

        ``known`` are the distinct designs of the rows (k, d), ``place`` that of each row (n,).
        """
        here = _nearness(nodes, self.inputs[:, self.designs :], self.length)
        counts = []
        for count in (self.engaged, self.shifts - self.engaged):
            summed = np.zeros((len(known), len(nodes)))
            np.add.at(summed, place, (here * count).T)
            counts.append(_nearness(x, known, self.length) @ summed)
        return self._beta(*counts)

    def alike(self, inputs: Array) -> Array:
        """Compute the correlation of errors of the share at inputs (m, d + p), (m, m)."""
        x, points = inputs[:, : self.designs], inputs[:, self.designs :]
        return self.near(x, x) * self.near(points, points)

    def near(self, a: Array, b: Array) -> Array:
        """Compute the nearness of designs, or operating points, (m, c) and (k, c), (m, k)."""
        return _nearness(a, b, self.length)

    def _beta(self, engaged: Array, lost: Array) -> tuple[Array, Array]:
        a = engaged + self.strength * self.overall
        b = lost + self.strength * (1.0 - self.overall)
        total = a + b
        return a / total, a * b / (total**2 * (total + 1.0))


def fit_share(designs: int, inputs: Array, counts: tuple[Array, Array], place: Places) -> Share:
    """Fit length and strength: those that best predict the counts of designs left out.

    ``counts`` are those of engaged and of all shifts, each (n,); ``place`` the design's of
    each row, (n,).
    """
    engaged, shifts = counts
    if (engaged == shifts).all():
        return Share(designs, inputs, engaged, shifts, inf, STRENGTHS[-1])
    others = place[:, None] != place[None, :]
    best, found = -inf, None
    for length in LENGTHS:
        near = _nearness(inputs, inputs, length) * others
        for strength in STRENGTHS:
            one = Share(designs, inputs, engaged, shifts, length, strength)
            share = one._beta(near @ engaged, near @ (shifts - engaged))[0]
            likely = float((engaged * np.log(share) + (shifts - engaged) * np.log1p(-share)).sum())
            if likely > best:
                best, found = likely, one
    assert found is not None
    return found


def _nearness(a: Array, b: Array, length: float) -> Array:
    if length == inf:
        return np.ones((len(a), len(b)))
    return np.exp(-0.5 * (distance(a, b) / length) ** 2)
