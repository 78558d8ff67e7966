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
much more than that: ``jumps_of`` says how many and by how much.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

ROOT5 = 5.0**0.5
SHORT = 0.1  #: length of steps
LENGTHS = (0.25, 0.5, 1.0, 2.0, 4.0)
STEPS = (1e-4, 1e-3, 0.01, 0.05, 0.2)  #: shares of the variance that steps may have
SIZES = np.geomspace(1e-3, 3.0, 12)  #: standard deviations that the logarithm may have
USUAL = (0.2, 1.5)  #: median of that deviation, and spread of its logarithm
KEPT = 4  #: places whose correlations are kept
JUMP = 3.0  #: standard errors beyond which a level that was left out lies behind a jump
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
        """Return what levels weigh in the curve at ``places`` (m, d), and its variance.

        Weights (m, N) add up to one; variance of the logarithm, (m,).
        """
        known = self._covariance(cell, places)
        return self._solve(cell, known, 1.0, self.size[cell] ** 2)

    def from_first(self, cell: int, places: Array) -> tuple[Array, Array]:
        """Return weights and variance of the first level with the curve's change from there.

        At the first level they are its own: a change of nothing changes nothing. Shapes as for
        ``weights``.
        """
        known = self._covariance(cell, places)
        there, covariance = self._first[cell]
        taken = self._solve(cell, known, 1.0, 0.0)[0] - there
        taken[:, 0] += 1.0
        variance = ((taken @ covariance - 2.0 * known) * taken).sum(axis=1)
        variance = variance + self.size[cell] ** 2
        return taken, self.inflation * np.maximum(variance, 0.0)

    @cached_property
    def _first(self) -> list[tuple[Array, Array]]:
        """Weights at the first level, (1, N), and the observations' covariance, by cell."""
        cells = range(len(self.sites))
        weights = [self.weights(cell, self.sites[cell, :1])[0] for cell in cells]
        return list(zip(weights, np.linalg.inv(self.inverse), strict=True))

    def change_variance(self, cell: int, places: Array, origin: Array) -> Array:
        """Return the variance of the curve's change from ``origin`` (d,) to places, (m,)."""
        apart = self._covariance(cell, places) - self._covariance(cell, origin[None])
        between = self.size[cell] ** 2 * _kernel(places - origin, self.lengths, self.step)
        both = 2.0 * (self.size[cell] ** 2 - between)
        return self._solve(cell, apart, 0.0, both)[1]

    def like(self, size: Array, errors: Array, longest: float = np.inf) -> Curves:
        """Return curves through other numbers at the same sites: ``size`` (C,), errors (C, N, N).

        Lengths are the same or ``longest``; variances are not judged.
        """
        lengths: Array = np.minimum(self.lengths, longest)
        shape = _kernel(self.sites[:, :, None] - self.sites[:, None], lengths, self.step)
        inverse = _inverse(size[:, None, None] ** 2 * shape + errors)
        return Curves(self.sites, lengths, self.step, size, inverse, 1.0)

    def _covariance(self, cell: int, places: Array) -> Array:
        known: Array = self.size[cell] ** 2 * self._correlation(cell, places)
        return known

    def _correlation(self, cell: int, places: Array) -> Array:
        """Return correlations of places and levels, (m, N); kept, since cells are asked in turn."""
        key = (0 if self._alike else cell, places.tobytes())
        if key not in self._kept:
            if len(self._kept) >= KEPT:
                self._kept.clear()
            apart = places[:, None] - self.sites[cell]
            self._kept[key] = _kernel(apart, self.lengths, self.step)
        return self._kept[key]

    @cached_property
    def _alike(self) -> bool:
        """Whether levels lie at the same coordinates at all operating points."""
        return bool((self.sites == self.sites[:1]).all())

    @cached_property
    def _kept(self) -> dict[tuple[int, bytes], Array]:
        return {}

    def _solve(
        self, cell: int, known: Array, total: float, own: float | Array
    ) -> tuple[Array, Array]:
        inverse = self.inverse[cell]
        ones = inverse.sum(axis=1)
        weights = known @ inverse
        left = (total - weights.sum(axis=1)) / ones.sum()
        variance = own - (weights * known).sum(axis=1) + left**2 * ones.sum()
        return weights + left[:, None] * ones, self.inflation * np.maximum(variance, 0.0)


def fit_curves(sites: Array, means: Array, errors: Array, judged: slice) -> Curves:
    """Fit curves to logarithms of means.

    Parameters
    ----------
    sites : coordinates (C, N, d).
    means : logarithms (C, N).
    errors : their covariance (C, N, N).
    judged : the levels that are left out one by one to judge the variances.
    """
    best: tuple[float, Curves] | None = None
    prior = -0.5 * (np.log(SIZES / USUAL[0]) / USUAL[1]) ** 2
    for lengths in itertools.product(LENGTHS, repeat=sites.shape[2]):
        scaled = np.array(lengths)
        for step in STEPS:
            shape = _kernel(sites[:, :, None] - sites[:, None], scaled, step)
            fits = [_likelihoods(size**2 * shape + errors, means) for size in SIZES]
            likelihoods = np.array([one[0] for one in fits]) + prior[:, None]
            chosen = np.argmax(likelihoods, axis=0)
            whole = float(likelihoods.max(axis=0).sum())
            if best is None or whole > best[0]:
                inverse = np.array([fits[k][1][c] for c, k in enumerate(chosen)])
                best = whole, Curves(sites, scaled, step, SIZES[chosen], inverse, 1.0)
    assert best is not None
    curves = best[1]
    return replace(curves, inflation=_inflation(curves.inverse, means, judged))


def _kernel(apart: Array, lengths: Array, step: float) -> Array:
    """Return the correlation of places ``apart`` (..., d), (...)."""
    smooth = np.sqrt(((apart / lengths) ** 2).sum(axis=-1))
    rough = np.sqrt((apart**2).sum(axis=-1)) / SHORT
    return (1.0 - step) * _matern(smooth) + step * _matern(rough)


def _matern(distance: Array) -> Array:
    r = ROOT5 * distance
    value: Array = (1.0 + r + r * r / 3.0) * np.exp(-r)
    return value


def _inverse(covariance: Array) -> Array:
    return np.asarray(np.linalg.inv(covariance), dtype=np.float64)


def _likelihoods(covariance: Array, means: Array) -> tuple[Array, Array]:
    """Return log-likelihoods (C,) without the constant, and inverse covariances (C, N, N)."""
    inverse = _inverse(covariance)
    ones = inverse.sum(axis=2)
    total = ones.sum(axis=1)
    solved = (inverse * means[:, None]).sum(axis=2)
    misfit = (means * solved).sum(axis=1) - (ones * means).sum(axis=1) ** 2 / total
    spread = np.linalg.slogdet(covariance)[1]
    return -0.5 * (misfit + spread + np.log(total)), inverse


def jumps_of(curves: Curves, means: Array, judged: slice) -> tuple[float, float]:
    """Return the share of levels that lie behind a jump, and its size in the logarithm (rms)."""
    missed, error = (part[:, judged] for part in left_out(curves.inverse, means))
    behind = abs(missed) > JUMP * np.sqrt(curves.inflation) * error
    if not behind.any():
        return 0.0, 0.0
    return float(behind.mean()), float(np.sqrt((missed[behind] ** 2).mean()))


def left_out(inverse: Array, means: Array) -> tuple[Array, Array]:
    """Return by how much levels that are left out miss their curves, and its error, (C, N)."""
    ones = inverse.sum(axis=2)
    total = ones.sum(axis=1)[:, None]
    solved = (inverse * means[:, None]).sum(axis=2)
    solved -= ones * (ones * means).sum(axis=1)[:, None] / total
    own = np.maximum(np.diagonal(inverse, axis1=1, axis2=2) - ones**2 / total, 1e-12)
    return solved / own, own**-0.5


def _inflation(inverse: Array, means: Array, judged: slice) -> float:
    """Return the mean square of residuals left out, over their variances, at least 1."""
    missed, error = left_out(inverse, means)
    return max(1.0, float(((missed / error)[:, judged] ** 2).mean()))
