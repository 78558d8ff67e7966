r"""Discrepancy of two engines in the mean shift time, from shifts that both have.

Rows of the cheap engine become rows of the one that counts by

.. math:: \ln t_{dear} = \ln t_{cheap} + d, \qquad
   d = \beta_0 + \beta_1 (\ln |n| - \overline{\ln |n|}) + \epsilon, \quad
   \epsilon \sim N(0, \tau^2),

with the mismatch *n* (Kennedy & O'Hagan 2000, their scale one and the discrepancy parametric). Each
pair of means is at the same design, operating point and relative angles, so what both engines
share cancels. Coefficients are by weighted least squares, :math:`w = 1/(s^2 + \tau^2)`, the
scatter :math:`\tau` beyond sampling by moments (DerSimonian & Laird 1986). The slope is kept where
it predicts pairs left out better than a constant.

Rows of like mismatch share their sampling error: of few angles most have none where the engines
part, and look exact, and a row that has one would lose its weight by it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from dogshape.sim.errors import InputError
from dogshape.surrogate.covariance import Array
from dogshape.surrogate.dataset import Dataset

LEAST = 10  #: pairs of means that a discrepancy needs
LIKE = 20  #: pairs of like mismatch that share their sampling error
EXACT = 1e-6  #: least sampling error of a difference of logarithms
SLOWEST = 1.0  #: 1/min, mismatch below which the discrepancy changes no more
MEAN, ERROR, SPREAD = 2, 3, 4  #: columns behind the design


@dataclass(frozen=True)
class Pair:
    """Times of both engines at the same angles of one design at one operating point, s.

    Parameters
    ----------
    mismatch : 1/min.
    cheap, dear : times of the angles at which both engage, (n,) each, n at least three.
    """

    mismatch: float
    cheap: Array
    dear: Array

    @property
    def difference(self) -> float:
        """Logarithm of the mean of ``dear`` over that of ``cheap``."""
        return float(np.log(self.dear.mean() / self.cheap.mean()))

    @property
    def variance(self) -> float:
        """Sampling variance of the difference, that of random angles, by the jackknife.

        The usual linear formula is a fifth too small for four angles of unequal times.
        """
        n = len(self.dear)
        left = np.array([float(t.sum()) - t for t in (self.cheap, self.dear)])
        parts = np.log(left[1] / left[0])
        return float(((parts - parts.mean()) ** 2).sum()) * (n - 1) / n


@dataclass(frozen=True)
class Discrepancy:
    """Discrepancy of two engines over the mismatch.

    Parameters
    ----------
    centre : mean logarithm of the mismatch of the pairs, of 1/min.
    values : constant, and slope where there is one, (p,).
    covariance : of ``values``, (p, p).
    scatter : standard deviation of a row's discrepancy beyond sampling.
    pairs, shifts : pairs of means, and shifts of either engine in them.
    left_out : root-mean-square error of pairs left out: uncorrected, constant, slope.
    """

    centre: float
    values: Array
    covariance: Array
    scatter: float
    pairs: int
    shifts: int
    left_out: tuple[float, float, float]

    def at(self, mismatch: Array) -> tuple[Array, Array]:
        """Return the discrepancy and its common standard error at mismatches in 1/min, (m,)."""
        basis = _basis(mismatch, self.centre)[:, : len(self.values)]
        error: Array = np.sqrt(np.einsum("mi,ij,mj->m", basis, self.covariance, basis))
        return basis @ self.values, error

    def corrected(self, data: Dataset) -> Dataset:
        """Return the rows of the cheap engine as those of the one that counts.

        Means and deviations are scaled; the scatter of the discrepancy joins the standard error.
        """
        rows, first = data.rows.copy(), len(data.variables)
        factor = np.exp(self.at(data.points[:, 0])[0])
        rows[:, first + MEAN] *= factor
        rows[:, first + SPREAD] *= factor
        own = rows[:, first + ERROR] * factor
        rows[:, first + ERROR] = np.hypot(own, self.scatter * rows[:, first + MEAN])
        return replace(data, rows=rows)

    def as_dict(self) -> dict[str, Any]:
        """Return coefficients, errors and what they come from, by name."""
        errors = np.sqrt(np.diag(self.covariance))
        slope = len(self.values) > 1
        return {
            "constant": float(self.values[0]),
            "constant_error": float(errors[0]),
            "slope": float(self.values[1]) if slope else None,
            "slope_error": float(errors[1]) if slope else None,
            "centre_rpm": float(np.exp(self.centre)),
            "scatter": self.scatter,
            "pairs": self.pairs,
            "pair_shifts": self.shifts,
            "left_out_rms": dict(
                zip(("uncorrected", "constant", "slope"), self.left_out, strict=True)
            ),
        }


def discrepancy_of(pairs: Sequence[Pair]) -> Discrepancy:
    """Fit the discrepancy to pairs of means.

    Raises InputError for fewer than ``LEAST``.
    """
    if len(pairs) < LEAST:
        raise InputError(
            f"the correction of the compiled engine has {len(pairs)} pairs of means with three "
            f"shifts that engage in both engines, but it needs at least {LEAST}; raise "
            "surrogate.designs, or give --levels 1"
        )
    mismatch = np.array([pair.mismatch for pair in pairs])
    found = np.array([pair.difference for pair in pairs])
    variance = _shared(mismatch, np.array([pair.variance for pair in pairs]))
    centre = float(_logarithm(mismatch).mean())
    basis = _basis(mismatch, centre)
    widths = (1, 2) if np.ptp(basis[:, 1]) > 0.0 else (1,)
    errors = [_rms(found)]
    errors += [_left_out(basis[:, :width], found, variance) for width in widths]
    width = 1 + int(np.argmin(errors[1:]))
    values, covariance, scatter = _least_squares(basis[:, :width], found, variance)
    return Discrepancy(
        centre=centre,
        values=values,
        covariance=covariance,
        scatter=scatter,
        pairs=len(pairs),
        shifts=sum(len(pair.dear) for pair in pairs),
        left_out=(errors[0], errors[1], errors[-1]),
    )


def _logarithm(mismatch: Array) -> Array:
    return np.asarray(np.log(np.maximum(np.abs(mismatch), SLOWEST)))


def _basis(mismatch: Array, centre: float) -> Array:
    """Return a constant and the centred logarithm of the mismatch, (m, 2)."""
    return np.column_stack([np.ones(len(mismatch)), _logarithm(mismatch) - centre])


def _shared(mismatch: Array, variance: Array) -> Array:
    """Return the mean variance of the pairs nearest in size of the mismatch, (n,)."""
    size = np.abs(mismatch)
    near = [np.argsort(np.abs(size - one), kind="stable")[:LIKE] for one in size]
    return np.array([max(float(variance[places].mean()), EXACT**2) for places in near])


def _least_squares(basis: Array, found: Array, variance: Array) -> tuple[Array, Array, float]:
    """Return coefficients (p,), their covariance (p, p), and the scatter beyond sampling."""
    values, covariance = _weighted(basis, found, 1.0 / variance)
    weights = 1.0 / variance
    excess = float((weights * (found - basis @ values) ** 2).sum()) - (len(found) - len(values))
    lost = float(np.trace(covariance @ (basis.T * weights**2) @ basis))
    scatter2 = max(0.0, excess / (float(weights.sum()) - lost))
    values, covariance = _weighted(basis, found, 1.0 / (variance + scatter2))
    return values, covariance, scatter2**0.5


def _weighted(basis: Array, found: Array, weights: Array) -> tuple[Array, Array]:
    covariance: Array = np.array(np.linalg.inv((basis.T * weights) @ basis), dtype=float)
    values: Array = covariance @ (basis.T * weights) @ found
    return values, covariance


def _left_out(basis: Array, found: Array, variance: Array) -> float:
    """Return the root-mean-square error of each pair predicted by the others."""
    errors = []
    for place in range(len(found)):
        others = np.arange(len(found)) != place
        values, _, _ = _least_squares(basis[others], found[others], variance[others])
        errors.append(float(found[place] - basis[place] @ values))
    return _rms(np.array(errors))


def _rms(values: Array) -> float:
    return float(np.sqrt((values**2).mean()))
