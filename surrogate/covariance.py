r"""Covariance of the surrogate: sums of products over designs and operating points.

A term is :math:`\sigma^2\, g(o)\, g(o')\, m(r_x)\, m(r_o)`, with Matern's
:math:`m(r) = (1 + \sqrt 5 r + 5 r^2/3)\, e^{-\sqrt 5 r}`, :math:`r_x` the distance of two
designs over a length scale for each coordinate and :math:`r_o` that of two operating
points. Either factor may be left out. In a term that grows, :math:`g = e^{(b u + c u^2)/2}`
with :math:`u = |o_1| - 1` from the mismatch's coordinate: fast shifts are rougher than slow ones.

A rough term has Wendland's :math:`m(r) = (1 - r)_+^k (k r + 1)` instead, which is zero beyond its
reach: there nearly all pairs of designs are left out. It is positive definite in up to *d*
coordinates with :math:`k = \lfloor d/2 \rfloor + 3` (Wendland 1995), so *k* is 7 for up to nine and
grows with more.

Products keep designs and operating points apart, so that a mix of operating points is summed
once and not for every design. Rasmussen and Williams 2006, ch. 4.
"""

from __future__ import annotations

import os
from collections import deque
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Places = NDArray[np.int64]
ROOT5 = 5.0**0.5
USUAL = 7  #: power of Wendland's function, at least
CHUNK = 64  #: rows worked out at a time, so that they stay in the processor's cache


@dataclass(frozen=True)
class Term:
    """One term: its factors, and its growth with the mismatch.

    ``scales`` bounds its length scales, ranges of designs being scaled to one; a fit starts from
    ``first``. Equal bounds fix them as the reach of what is rough: nothing beyond predicts it.
    """

    design: bool
    point: bool
    grows: bool = False
    scales: tuple[float, float] = (0.2, 30.0)
    first: float = 1.0

    @property
    def rough(self) -> bool:
        """Fixed length scales."""
        return self.scales[0] == self.scales[1]


@dataclass(frozen=True)
class Part:
    """A term with its numbers: variance, growth, length scales of its factors, None if left out."""

    rough: bool
    variance: float
    growth: tuple[float, float]
    design: Array | None
    point: Array | None

    def amplitude(self, points: Array) -> Array:
        """Return the standard deviation at operating points (n, p), (n,)."""
        size, (steep, bent) = _size(points), self.growth
        return self.variance**0.5 * np.exp(0.5 * (steep * size + bent * size**2))

    def design_factor(self, a: Array, b: Array) -> Array:
        """Return the factor of designs (n, d) and (m, d), (n, m)."""
        return self._factor(a, b, self.design)

    def point_factor(self, a: Array, b: Array) -> Array:
        """Return the factor of operating points with their amplitudes, (n, m)."""
        factor = self._factor(a, b, self.point)
        factor *= self.amplitude(a)[:, None]
        factor *= self.amplitude(b)[None, :]
        return factor

    def add(self, total: Array, design: Array | None, points: tuple[Array, Array]) -> None:
        """Add the term to a total (n, m), given its factor of designs and the operating points."""
        if self.rough and design is not None:
            self._add_near(total, design, points)
            return
        block = self.point_factor(*points)
        if design is not None:
            block *= design
        total += block

    def _add_near(self, total: Array, design: Array, points: tuple[Array, Array]) -> None:
        rows, columns = np.nonzero(design)
        a, b = points[0][rows], points[1][columns]
        factor = design[rows, columns] * self.amplitude(a) * self.amplitude(b)
        if self.point is not None:
            apart = np.sqrt((((a - b) / self.point) ** 2).sum(axis=1))
            factor *= wendland(apart, len(self.point))
        total[rows, columns] += factor

    def _factor(self, a: Array, b: Array, scale: Array | None) -> Array:
        if scale is None:
            return np.ones((len(a), len(b)))
        a, b = a / scale, b / scale
        return wendland(distance(a, b), len(scale)) if self.rough else matern(a, b)


@dataclass(frozen=True)
class Covariance:
    """Terms with their parameters.

    Parameters
    ----------
    terms : what is summed.
    designs, points : numbers of coordinates of a design and of an operating point.
    theta : for each term the logarithm of its variance, its growth (b, c) where it grows, then
        the logarithms of its length scales, design before operating point, (size,).
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
            growth = (float(rest.pop(0)), float(rest.pop(0))) if term.grows else (0.0, 0.0)
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

    def rougher(self, variance: float, points: Array) -> Covariance:
        """Return the covariance whose last term, if rough, has at least a variance at points."""
        last, theta = self.terms[-1], self.theta.copy()
        place = len(theta) - 1 - 2 * last.grows
        if last.rough and variance > 0.0:
            least = float((self.parts[-1].amplitude(points) ** 2).min())
            theta[place] += max(0.0, np.log(variance / least))
        return replace(self, theta=theta)

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
                design = None if part.design is None else part.design_factor(xa[rows], xb)
                part.add(total[rows], design, (oa[rows], ob))
        return total

    def among(self, inputs: Array) -> Array:
        """Return the covariance of inputs (n, d + p) with each other.

        Half of it is worked out, and the factors of designs once for all rows of a design.
        """
        x, o = self.split(inputs)
        designs, place = np.unique(x, axis=0, return_inverse=True)
        place = place.ravel()
        factors = [part.design_factor(designs, designs) for part in self.parts]
        total = np.zeros((len(x), len(x)))

        def fill(k: int) -> None:
            rows, known = slice(k, k + CHUNK), slice(0, k + CHUNK)
            for part, factor in zip(self.parts, factors, strict=True):
                design = None if part.design is None else factor[place[rows]][:, place[known]]
                part.add(total[rows, known], design, (o[rows], o[known]))
            total[:k, rows] = total[rows, :k].T

        with ThreadPoolExecutor(os.cpu_count()) as threads:  # numpy lets other threads go on
            deque(threads.map(fill, range(0, len(x), CHUNK)), maxlen=0)
        return total

    def variance(self, inputs: Array) -> Array:
        """Return the variance of inputs (n, d + p) before any data, (n,)."""
        points = self.split(inputs)[1]
        return np.sum([part.amplitude(points) ** 2 for part in self.parts], axis=0)

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
                for size in (_size(o), _size(o) ** 2):
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
            theta += [0.0, 0.0]
            bounds += [np.array([-16.0, 16.0]), np.array([-16.0, 16.0])]
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


def wendland(apart: Array, coordinates: int) -> Array:
    """Compute Wendland's correlation of scaled distances, of their shape; zero from 1 on.

    Positive definite over that many coordinates.
    """
    power = max(USUAL, coordinates // 2 + 3)
    correlation = np.zeros_like(apart)
    inside = apart < 1.0
    near = apart[inside]
    correlation[inside] = (1.0 - near) ** power * (power * near + 1.0)
    return correlation


def _size(points: Array) -> Array:
    """Compute the mismatch coordinate of operating points (n, p), zero at coordinate 1, (n,)."""
    return np.abs(points[:, 0]) - 1.0 if points.shape[1] else np.zeros(len(points))


def _slopes(scaled: Array, rest: Array) -> list[Array]:
    """Return the slopes by the logarithm of each length scale; ``rest`` is the other factor."""
    root = ROOT5 * distance(scaled, scaled)
    steep = rest * (5.0 / 3.0 * (1.0 + root) * np.exp(-root))
    return [steep * (values[:, None] - values[None, :]) ** 2 for values in scaled.T]
