r"""Effects together, corrected by levels at which they were simulated together.

What effects that were simulated alone give together (``diagnosis.prediction.combination``) is the
mean of a Gaussian process over the coordinates *x* of all of them, with the covariance

.. math:: k(x, x') = a^2 \sigma(x) \sigma(x')\, m(|(x - x')/\ell|),

where :math:`\sigma` is the error that the combination states of the logarithm of a mean, which is
nothing where an effect is neutral, and *m* is Matern's of ``diagnosis.prediction.level_curves``.
Lengths are those of each effect's own curve times a factor; that and *a* are the likeliest of all
operating points together. Joint levels show its residuals: logarithms of their means less those of
the combination, with the errors of their angles. Shapes, shares that engage and profiles over the
angle take the same weights of levels.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from dogshape.diagnosis.prediction.level_curves import matern
from dogshape.diagnosis.terms import Array

FACTORS = (0.25, 0.5, 1.0, 2.0)  #: of the lengths of each effect's own curve
SCALES = (0.5, 1.0, 2.0, 4.0, 8.0, 16.0)  #: of the error that the combination states
USUAL = 0.7  #: spread of the logarithm of that scale before
LONGEST = 1.5  #: of the priors, the longest length


@dataclass(frozen=True)
class JointLevels:
    """L joint levels of some effects at C operating points.

    Parameters
    ----------
    sites : coordinates, (C, L, d).
    stated : errors of the combination there, of the logarithm of the mean, (C, L).
    residual, noise : of the logarithm of the mean, and its standard error, (C, L); NaN where a
        level is not known.
    lengths : of the effects' own curves, (d,).
    """

    sites: Array
    stated: Array
    residual: Array
    noise: Array
    lengths: Array

    def weights(self, places: Array, stated: Array) -> tuple[Array, Array]:
        """Compute the weights of residuals at places (C, m, d), and the variance that is left.

        ``stated`` are the combination's errors there, (C, m). Weights (C, m, L), variance (C, m).
        """
        factor, scale, inverse = self._fitted
        apart = places[:, :, None] - self.sites[:, None]
        known = scale**2 * stated[..., None] * self.stated[:, None] * self._shape(apart, factor)
        weights = known @ inverse
        variance = (scale * stated) ** 2 - (weights * known).sum(axis=-1)
        return weights, np.maximum(variance, 0.0)

    def _shape(self, apart: Array, factor: float) -> Array:
        lengths = np.minimum(factor * self.lengths, LONGEST)
        return matern(np.sqrt(((apart / lengths) ** 2).sum(axis=-1)))

    @cached_property
    def _fitted(self) -> tuple[float, float, Array]:
        """Factor of lengths, scale of errors, and the inverse of the covariance, (C, L, L)."""
        known = np.isfinite(self.residual + self.noise)
        residual = np.where(known, self.residual, 0.0)
        noise = np.where(known, self.noise, 1e3)
        apart = self.sites[:, :, None] - self.sites[:, None]
        prior = self.stated[:, :, None] * self.stated[:, None]
        diagonal = np.eye(residual.shape[1]) * (noise**2)[:, None]
        best: tuple[float, float, float, Array] | None = None
        for factor, scale in itertools.product(FACTORS, SCALES):
            whole = scale**2 * prior * self._shape(apart, factor) + diagonal
            inverse = np.linalg.inv(whole)
            misfit = (residual * (inverse @ residual[..., None])[..., 0]).sum()
            likely = -0.5 * (misfit + np.linalg.slogdet(whole)[1].sum())
            likely -= 0.5 * (np.log(scale) / USUAL) ** 2
            if best is None or likely > best[0]:
                best = float(likely), factor, scale, inverse
        assert best is not None
        return best[1:]
