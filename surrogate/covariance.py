r"""Covariance of the surrogate: sums of products over designs and operating points.

A term is :math:`\sigma^2\, g(o)\, g(o')\, m(r_x)\, m(r_o)`, with Matern's
:math:`m(r) = (1 + \sqrt 5 r + 5 r^2/3)\, e^{-\sqrt 5 r}`, :math:`r_x` the distance of two
designs over a length scale for each coordinate and :math:`r_o` that of two operating
points. Either factor may be left out. In a term that grows, :math:`g = e^{b|o_1|/2}` with
the mismatch's coordinate :math:`o_1`: fast shifts are rougher than slow ones.

Products keep designs and operating points apart, so that a mix of operating points is summed
once and not for every design. Rasmussen and Williams 2006, ch. 4.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Places = NDArray[np.int64]
ROOT5 = 5.0**0.5
CHUNK = 64  #: rows worked out at a time, so that they stay in the processor's cache


@dataclass(frozen=True)
class Term:
    """One term: which factors it has, and whether it grows with the mismatch.

    ``scales`` bounds its length scales, ranges of designs being scaled to one; a fit starts from
    ``first``. Equal bounds fix them: what is so short is rough, and nothing near foretells it.
    """

    design: bool
    point: bool
    grows: bool = False
    scales: tuple[float, float] = (0.2, 30.0)
    first: float = 1.0

    @property
    def rough(self) -> bool:
        """Whether the length scales are fixed."""
        return self.scales[0] == self.scales[1]


@dataclass(frozen=True)
class Part:
    """A term with its numbers: variance, growth, length scales of its factors, None if left out."""

    rough: bool
    variance: float
    growth: float
    design: Array | None
    point: Array | None

    def amplitude(self, points: Array) -> Array:
        """Return the standard deviation at operating points (n, p), (n,)."""
        grown: Array = self.variance**0.5 * np.exp(0.5 * self.growth * np.abs(points[:, 0]))
        return grown

    def design_factor(self, a: Array, b: Array) -> Array:
        """Return the factor of designs (n, d) and (m, d), (n, m)."""
        return _factor(a, b, self.design)

    def point_factor(self, a: Array, b: Array) -> Array:
        """Return the factor of operating points with their amplitudes, (n, m)."""
        factor = _factor(a, b, self.point)
        factor *= self.amplitude(a)[:, None]
        factor *= self.amplitude(b)[None, :]
        return factor


@dataclass(frozen=True)
class Covariance:
    """Terms with their parameters.

    Parameters
    ----------
    terms : what is summed.
    designs, points : numbers of coordinates of a design and of an operating point.
    theta : for each term the logarithm of its variance, its growth where it grows, then the
        logarithms of its length scales, design before operating point, (size,).
    """

    terms: tuple[Term, ...]
    designs: int
    points: int
    theta: Array

    @cached_property
    def parts(self) -> list[Part]:
        """The terms with their numbers."""
        rest, found = list(self.theta), []
        for term in self.terms:
            variance = float(np.exp(rest.pop(0)))
            growth = float(rest.pop(0)) if term.grows else 0.0
            design = self._scales(term, rest, self.designs) if term.design else None
            point = self._scales(term, rest, self.points) if term.point else None
            found.append(Part(term.rough, variance, growth, design, point))
        return found

    @staticmethod
    def _scales(term: Term, rest: list[float], number: int) -> Array:
        if term.rough:
            return np.full(number, term.first)
        taken = np.exp(rest[:number])
        del rest[:number]
        return taken

    def split(self, inputs: Array) -> tuple[Array, Array]:
        """Return coordinates of designs (n, d) and of operating points (n, p)."""
        return inputs[:, : self.designs], inputs[:, self.designs :]

    def between(self, a: Array, b: Array) -> Array:
        """Return the covariance of inputs (n, d + p) and (m, d + p), (n, m)."""
        (xa, oa), (xb, ob) = self.split(a), self.split(b)
        total = np.zeros((len(a), len(b)))
        for part in self.parts:
            for k in range(0, len(a), CHUNK):
                rows = slice(k, k + CHUNK)
                block = part.point_factor(oa[rows], ob)
                if part.design is not None:
                    block *= part.design_factor(xa[rows], xb)
                total[rows] += block
        return total

    def among(self, inputs: Array) -> Array:
        """Return the covariance of inputs (n, d + p) with each other.

        Half of it is worked out, and the factors of designs once for all rows of a design.
        """
        x, o = self.split(inputs)
        designs, place = np.unique(x, axis=0, return_inverse=True)
        place = place.ravel()
        total = np.zeros((len(x), len(x)))
        for part in self.parts:
            factor = part.design_factor(designs, designs)
            for k in range(0, len(x), CHUNK):
                rows, known = slice(k, k + CHUNK), slice(0, k + CHUNK)
                block = part.point_factor(o[rows], o[known])
                if part.design is not None:
                    block *= factor[place[rows]][:, place[known]]
                total[rows, known] += block
        lower = np.tril(total, -1)
        return lower + lower.T + np.diag(np.diag(total))

    def variance(self, inputs: Array) -> Array:
        """Return the variance of inputs (n, d + p) before any data, (n,)."""
        points = self.split(inputs)[1]
        total: Array = np.sum([part.amplitude(points) ** 2 for part in self.parts], axis=0)
        return total

    def slopes(self, inputs: Array) -> tuple[Array, Array]:
        """Return the covariance of inputs (n, d + p), (n, n), and its slopes, (n, n, size)."""
        x, o = self.split(inputs)
        total = np.zeros((len(x), len(x)))
        slopes = []
        for term, part in zip(self.terms, self.parts, strict=True):
            design, point = part.design_factor(x, x), part.point_factor(o, o)
            whole = design * point
            total += whole
            slopes.append(whole)
            if term.grows:
                size = np.abs(o[:, 0])
                slopes.append(0.5 * whole * (size[:, None] + size[None, :]))
            if part.design is not None and not term.rough:
                slopes += _slopes(x / part.design, point)
            if part.point is not None and not term.rough:
                grown = np.outer(part.amplitude(o), part.amplitude(o)) * design
                slopes += _slopes(o / part.point, grown)
        return total, np.stack(slopes, axis=-1)


def starting(terms: tuple[Term, ...], designs: int, points: int) -> tuple[Array, Array]:
    """Return parameters that a fit starts from, (size,), and their bounds, (size, 2)."""
    theta, bounds = [], []
    for term in terms:
        theta.append(np.log(0.03 * term.first))
        bounds.append(np.log([1e-6, 5.0]))
        if term.grows:
            theta.append(0.0)
            bounds.append(np.array([0.0, 8.0]))
        free = 0 if term.rough else term.design * designs + term.point * points
        theta += [np.log(term.first)] * free
        bounds += [np.log(term.scales)] * free
    return np.array(theta), np.array(bounds)


def matern(a: Array, b: Array) -> Array:
    """Return Matern's correlation (nu 5/2) of scaled inputs (n, d) and (m, d), (n, m)."""
    root = distance(ROOT5 * a, ROOT5 * b)
    correlation = root / 3.0
    correlation += 1.0
    correlation *= root
    correlation += 1.0
    correlation *= np.exp(np.negative(root, out=root), out=root)
    return correlation


def distance(a: Array, b: Array) -> Array:
    """Return the distances of scaled inputs (n, d) and (m, d), (n, m)."""
    squares = (-2.0 * a) @ b.T
    squares += (a * a).sum(axis=1)[:, None]
    squares += (b * b).sum(axis=1)[None, :]
    np.maximum(squares, 0.0, out=squares)
    return np.sqrt(squares, out=squares)


def _factor(a: Array, b: Array, scale: Array | None) -> Array:
    return np.ones((len(a), len(b))) if scale is None else matern(a / scale, b / scale)


def _slopes(scaled: Array, rest: Array) -> list[Array]:
    """Return the slopes by the logarithm of each length scale; ``rest`` is the other factor."""
    root = ROOT5 * distance(scaled, scaled)
    steep = rest * (5.0 / 3.0 * (1.0 + root) * np.exp(-root))
    return [steep * (values[:, None] - values[None, :]) ** 2 for values in scaled.T]
