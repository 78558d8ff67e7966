r"""Changes that an effect makes to the moments of shift times, between its levels.

A Gaussian process over the effect's coordinates, zero at neutral values, for each moment of each
operating point. Level *i*, and the baseline at the levels' angles as the last, show

.. math:: y_i = f(x_i) + u + \epsilon_i, \qquad f \sim GP(0, a^2 k), \; u \sim N(0, s_u^2),
          \; \epsilon_i \sim N(0, s^2),

with Matern's kernel of 3/2 conditioned on :math:`f = 0`, the error *u* of the angles that all
levels have in common, and that of each level, since shifts are chaotic. The amplitude *a* is the
one of most likelihood for each moment, the length of the kernel the one for all together
(Rasmussen and Williams, *Gaussian Processes for Machine Learning*, 2006, chapter 5).
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.special import logsumexp

from dogshape.diagnosis.terms import Array

LENGTHS = (0.25, 0.5, 1.0, 2.0)  #: of the range of an effect, over which its changes are alike
AMPLITUDES = (0.3, 1.0, 3.0, 10.0, 30.0)  #: of its changes over the error of one level
LOST = 1e6  #: variance of a moment that is not known
EXACT = 1e-9  #: variance of what is


@dataclass(frozen=True)
class Kernel:
    """Covariance of values at coordinates in a unit cube, zero where any effect is neutral.

    ``plain`` are the neutral coordinates of each effect, (k, d). That of what several effects do
    only together is the product of their covariances.
    """

    plain: tuple[Array, ...]
    length: float

    def free(self, one: Array, other: Array) -> Array:
        """Compute Matern's kernel of 3/2 between coordinates (m, d) and (n, d), (m, n)."""
        far = np.linalg.norm(one[:, None] - other[None], axis=2) * (3.0**0.5 / self.length)
        return np.asarray((1.0 + far) * np.exp(-far))

    @cached_property
    def parts(self) -> list[tuple[slice, Array, Array]]:
        """Columns and neutral coordinates of each effect, and the inverse of their kernel."""
        ends = np.cumsum([0, *(plain.shape[1] for plain in self.plain)]).tolist()
        whole = [self.free(one, one) + EXACT * np.eye(len(one)) for one in self.plain]
        inner = [np.asarray(np.linalg.inv(one)) for one in whole]
        columns = [slice(*pair) for pair in itertools.pairwise(ends)]
        return list(zip(columns, self.plain, inner, strict=True))

    def across(self, one: Array, other: Array) -> Array:
        """Compute the covariance between coordinates, (m, n)."""
        whole = np.ones((len(one), len(other)))
        for mine, plain, inner in self.parts:
            left, right = self.free(one[:, mine], plain), self.free(plain, other[:, mine])
            whole *= self.free(one[:, mine], other[:, mine]) - left @ inner @ right
        return whole

    def own(self, at: Array) -> Array:
        """Compute the variance at coordinates, (m,)."""
        whole = np.ones(len(at))
        for mine, plain, inner in self.parts:
            near = self.free(at[:, mine], plain)
            whole *= 1.0 - ((near @ inner) * near).sum(axis=1)
        return whole


@dataclass(frozen=True)
class Emulator:
    """Changes of K moments over n levels at coordinates ``x``, (n, d)."""

    x: Array
    kernel: Kernel
    size: Array  #: variance of the changes, (K,)
    root: Array  #: of the inverse of the covariance of the levels, (K, n, n)
    missed: Array  #: each level's miss by the others over its standard error, (K, n)
    misfit: Array  #: its square, at least 1 and the mean of all levels, (K, n)
    factor: Array  #: weights of the levels, (K, n)

    @classmethod
    def fitted(
        cls, x: Array, plain: tuple[Array, ...], found: Array, own: Array, common: Array
    ) -> Emulator:
        """Fit to changes (K, n + 1), the baseline's last, NaN for none.

        Errors are those of each, (K, n + 1) or (K, 1), and in common, (K,).
        """
        known, eye = np.isfinite(found), np.eye(len(x) + 1)
        found = np.where(known, found, 0.0)[..., None]
        single = own**2 + np.where(known, 0.0, LOST)
        noise = common[:, None, None] ** 2 + single[..., None] * eye
        sizes = np.multiply.outer(AMPLITUDES, own[:, -1]) ** 2
        best = -np.inf
        for kernel in (Kernel(plain, length) for length in LENGTHS):
            within = np.pad(kernel.across(x, x), (0, 1))
            every = within * sizes[..., None, None] + noise
            root = np.linalg.cholesky(every)
            inner = np.linalg.solve(root, np.broadcast_to(found, (*every.shape[:-1], 1)))
            log = -np.log(np.diagonal(root, axis1=2, axis2=3)).sum(axis=2)
            log -= 0.5 * (inner[..., 0] ** 2).sum(axis=2)
            if (whole := float(logsumexp(log, axis=0).sum())) > best:
                best, top = whole, (log.argmax(axis=0), np.arange(len(own)))
                chosen, size, inverse = kernel, sizes[top], np.linalg.inv(every[top])
        weights = (inverse @ found)[..., 0]
        left = weights / np.sqrt(np.diagonal(inverse, axis1=1, axis2=2))
        mean = (left**2 * known).sum(axis=1) / np.maximum(known.sum(axis=1), 1)
        misfit = np.maximum(np.maximum(left**2, mean[:, None]), 1.0)[:, :-1]
        root = np.linalg.cholesky(inverse[:, :-1, :-1])
        left = np.where(known, left, 0.0)[:, :-1]
        return cls(x, chosen, size, root, left, misfit, size[:, None] * weights[:, :-1])

    def alike(self, every: int) -> float:
        """Estimate the correlation of misses between each ``every``-th moment, 0 to 1."""
        missed = self.missed[::every]
        missed = missed / np.sqrt(np.maximum((missed**2).mean(axis=1, keepdims=True), EXACT))
        own = (missed**2).sum()
        between = (missed.sum(axis=0) ** 2).sum() - own
        return float(np.clip(between / max((len(missed) - 1) * own, EXACT), 0.0, 1.0))

    def weights(self, places: Array, noise: Array | float = EXACT) -> Array:
        """Compute weights (m, n) of the levels' changes at coordinates (m, d).

        ``noise`` is the variance of each level's change over that of all changes.
        """
        within = self.kernel.across(self.x, self.x) + noise * np.eye(len(self.x))
        return np.asarray(np.linalg.solve(within, self.kernel.across(self.x, places)).T)

    def at(self, places: Array, every: int) -> tuple[Array, Array]:
        """Compute changes (m, K) at coordinates (m, d).

        Standard errors are those of the first two of ``every`` moments, (m, 2 K / every).
        """
        first = np.arange(len(self.size)) % every < 2
        along = self.kernel.across(places, self.x)
        size, taken = self.size[first], ((along @ self.root[first]) ** 2).sum(axis=2).T
        left = self.kernel.own(places)[:, None] * size - taken * size**2
        near = np.linalg.norm(places[:, None] - self.x[None], axis=2).argmin(axis=1)
        error = np.sqrt(np.maximum(left, 0.0) * self.misfit[first][:, near].T)
        return along @ self.factor.T, error
