r"""Curves through means at a few levels, each known to the error of finitely many angles.

At each operating point the logarithm of the mean time over the coordinates *x* of an effect
(``diagnosis.prediction.levels``) is a Gaussian process with an unknown constant and covariance

.. math:: k(x, x') = s^2 [(1 - \nu)\, m(|x - x'|/\ell) + \nu\, m(|x - x'|/\ell_0)],

Matern's :math:`m(r) = (1 + \sqrt 5 r + 5 r^2/3)\, e^{-\sqrt 5 r}`. The share :math:`\nu` with its
short length stands for the steps in which fast shifts run. What is observed has the errors of its
angles, which are common to all levels and therefore correlated. Lengths and :math:`\nu` are the
likeliest ones of all operating points together, *s* that of each alone, all with the constant
integrated out (Rasmussen and Williams 2006, ch. 2.7 and 5.4). So few levels would often let
nothing look likeliest: *s* has a wide lognormal prior (``USUAL``).

Left out one by one, levels have residuals :math:`(Py)_i/P_{ii}` of variance :math:`1/P_{ii}`,
:math:`P = C^{-1} - C^{-1} 1 1^T C^{-1}/(1^T C^{-1} 1)`, :math:`C = k + S` (Dubrule 1983). Where
their mean square exceeds one, all variances grow by it. Times that jump between two levels miss by
much more than that, of which the likelihood's odd cells take care.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

ROOT5 = 5.0**0.5
SHORT = 0.1  #: length of steps
LENGTHS = (0.25, 0.5, 1.0, 2.0, 4.0)  #: lengths of curves, over the prior
STEPS = (1e-4, 1e-3, 0.01, 0.05, 0.2)  #: shares of the variance that steps may have
SIZES = np.geomspace(1e-3, 3.0, 12)  #: standard deviations that the logarithm may have
USUAL = (0.2, 1.5)  #: median of that deviation, and spread of its logarithm
FLOOR = 1e-4  #: relative error of a mean that is always there


@dataclass(frozen=True)
class Curves:
    """Curves of C operating points through N levels in d coordinates.

    ``sites`` (C, N, d), ``lengths`` (d,), ``step`` the share of steps, ``size`` (C,), ``inverse``
    of the observations' covariance (C, N, N), ``inflation`` of variances.
    """

    sites: Array
    lengths: Array
    step: float
    size: Array
    inverse: Array
    inflation: float

    def weights(self, cell: int, places: Array) -> tuple[Array, Array]:
        """Compute the weights of levels in the curve at ``places`` (m, d), and its variance.

        Weights (m, N) add up to one; variance of the logarithm, (m,).
        """
        size, inverse = self.size[cell], self.inverse[cell]
        known = size**2 * _kernel(places[:, None] - self.sites[cell], self.lengths, self.step)
        weights, left = _solved(inverse, known, 1.0)
        ones = inverse.sum(axis=1)
        variance = size**2 - _products(weights, known) + left**2 * ones.sum()
        return weights + left[:, None] * ones, self.inflation * np.maximum(variance, 0.0)

    def covariance(self, places: Array) -> Array:
        """Return the covariance of curves at ``places`` (C or 1, m, d) and levels, (C, m, N)."""
        sites = self.sites[:1] if self._alike else self.sites
        shape = _kernel(places[:, :, None] - sites[:, None], self.lengths, self.step)
        return self.size[:, None, None] ** 2 * shape

    def from_first(self, known: Array) -> tuple[Array, Array]:
        """Return weights and variance of the first level with the curve's change from there.

        At the first level they are its own: a change of nothing changes nothing. ``known`` is the
        covariance of places with levels; weights (C, m, N), variances (C, m).
        """
        there, covariance = self._first
        weights, left = _solved(self.inverse, known, 1.0)
        taken = weights + left[..., None] * self._ones[:, None] - there
        taken[..., 0] += 1.0
        variance = _products(taken @ covariance - 2.0 * known, taken)
        variance = variance + self.size[:, None] ** 2
        return taken, self.inflation * np.maximum(variance, 0.0)

    @cached_property
    def _first(self) -> tuple[Array, Array]:
        """Weights at the first level, (C, 1, N), and the observations' covariance, (C, N, N)."""
        cells = range(len(self.sites))
        weights = [self.weights(cell, self.sites[cell, :1])[0] for cell in cells]
        return np.array(weights), _inverse(self.inverse)

    def change_variance(self, known: Array, places: Array, origin: Array) -> Array:
        """Return the variance of the curves' change from ``origin`` to places, (C, m).

        ``known`` is the covariance of ``places`` (C or 1, m, d) with levels, ``origin`` (C or 1,
        d) the coordinates of no change.
        """
        apart = known - self.covariance(origin[:, None])
        between = _kernel(places - origin[:, None], self.lengths, self.step)
        scale = self.size[:, None] ** 2
        own = 2.0 * (scale - scale * between)
        weights, left = _solved(self.inverse, apart, 0.0)
        variance = own - _products(weights, apart) + left**2 * self._ones.sum(axis=1)[:, None]
        return self.inflation * np.maximum(variance, 0.0)

    @cached_property
    def _ones(self) -> Array:
        """Row sums of the inverse, (C, N)."""
        return self.inverse.sum(axis=2)

    @cached_property
    def _alike(self) -> bool:
        """Test that levels lie at the same coordinates at all operating points."""
        return bool((self.sites == self.sites[:1]).all())

    def like(self, size: Array, errors: Array, longest: float = np.inf) -> Curves:
        """Return curves through other numbers at the same sites: ``size`` (C,), errors (C, N, N).

        Lengths are the same or ``longest``; variances are not judged.
        """
        lengths: Array = np.minimum(self.lengths, longest)
        shape = _kernel(self.sites[:, :, None] - self.sites[:, None], lengths, self.step)
        inverse = _inverse(size[:, None, None] ** 2 * shape + errors)
        return Curves(self.sites, lengths, self.step, size, inverse, 1.0)


def _solved(inverse: Array, known: Array, total: float) -> tuple[Array, Array]:
    """Return weights (..., m, N) of levels, and what they lack of ``total``, (..., m)."""
    weights = known @ inverse
    whole = inverse.sum(axis=-1).sum(axis=-1, keepdims=True)
    return weights, (total - weights.sum(axis=-1)) / whole


def _products(one: Array, other: Array) -> Array:
    """Return the inner products of rows, (..., m)."""
    return (one * other).sum(axis=-1)


def fit_curves(sites: Array, means: Array, errors: Array, judged: slice) -> Curves:
    """Fit curves to logarithms of means.

    Parameters
    ----------
    sites : coordinates (C, N, d).
    means : logarithms (C, N).
    errors : their covariance (C, N, N).
    judged : the levels that are left out one by one to judge the variances.
    """
    best: tuple[float, Array, float, NDArray[np.intp]] | None = None
    prior = -0.5 * (np.log(SIZES / USUAL[0]) / USUAL[1]) ** 2
    apart = sites[:, :, None] - sites[:, None]
    white = np.linalg.inv(np.linalg.cholesky(errors))  # W with W S W^T = 1
    for lengths in itertools.product(LENGTHS, repeat=sites.shape[2]):
        scaled = np.array(lengths)
        for step in STEPS:
            likelihoods = _likelihoods(_kernel(apart, scaled, step), white, means) + prior
            whole = float(likelihoods.max(axis=1).sum())
            if best is None or whole > best[0]:
                best = whole, scaled, step, np.argmax(likelihoods, axis=1)
    assert best is not None
    _, scaled, step, chosen = best
    size = SIZES[chosen]
    inverse = _inverse(size[:, None, None] ** 2 * _kernel(apart, scaled, step) + errors)
    missed, error = left_out(inverse, means)
    inflation = max(1.0, float(((missed / error)[:, judged] ** 2).mean()))
    return Curves(sites, scaled, step, size, inverse, inflation)


def _kernel(apart: Array, lengths: Array, step: float) -> Array:
    """Return the correlation of places ``apart`` (..., d), (...)."""
    smooth, rough = _length(apart / lengths), _length(apart) / SHORT
    return (1.0 - step) * matern(smooth) + step * matern(rough)


def _length(apart: Array) -> Array:
    """Return lengths of vectors (..., d), much quicker for few coordinates than a sum over them."""
    squares = apart[..., 0] ** 2
    for place in range(1, apart.shape[-1]):
        squares = squares + apart[..., place] ** 2
    return np.sqrt(squares)


def matern(distance: Array) -> Array:
    """Compute the correlation over ``distance`` (...) in lengths, (...)."""
    r = ROOT5 * distance
    return (1.0 + r + r * r / 3.0) * np.exp(-r)


def _inverse(covariance: Array) -> Array:
    return np.asarray(np.linalg.inv(covariance), dtype=np.float64)


def _likelihoods(shape: Array, white: Array, means: Array) -> Array:
    """Return log-likelihoods of all ``SIZES``, (C, sizes), up to a constant of each row.

    One decomposition serves all sizes: with W k W^T = Q L Q^T at s = 1 the covariance
    s^2 k + S has the inverse W^T Q (s^2 L + 1)^-1 Q^T W.
    """
    values, vectors = np.linalg.eigh(white @ shape @ np.swapaxes(white, 1, 2))
    turned = np.swapaxes(vectors, 1, 2) @ white
    ones, mine = turned.sum(axis=2), (turned @ means[..., None])[..., 0]
    spread = SIZES[:, None] ** 2 * np.maximum(values, 0.0)[:, None] + 1.0
    total = (ones[:, None] ** 2 / spread).sum(axis=2)
    misfit = ((mine**2)[:, None] / spread).sum(axis=2)
    misfit -= ((ones * mine)[:, None] / spread).sum(axis=2) ** 2 / total
    return -0.5 * (misfit + np.log(spread).sum(axis=2) + np.log(total))


def left_out(inverse: Array, means: Array) -> tuple[Array, Array]:
    """Compute the residuals of levels that are left out, and their errors, (C, N)."""
    ones = inverse.sum(axis=2)
    total = ones.sum(axis=1)[:, None]
    solved = (inverse * means[:, None]).sum(axis=2)
    solved -= ones * (ones * means).sum(axis=1)[:, None] / total
    own = np.maximum(np.diagonal(inverse, axis1=1, axis2=2) - ones**2 / total, 1e-12)
    return solved / own, own**-0.5
