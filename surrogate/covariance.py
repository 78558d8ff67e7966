r"""Covariance of the surrogate: a sum of correlations over designs.

A smooth term is :math:`\sigma^2 m(r)` with Matern's :math:`m(r) = (1 + \sqrt 5 r + 5 r^2/3)\,
e^{-\sqrt 5 r}` and :math:`r` the distance over a length scale for each coordinate (Rasmussen and
Williams 2006, ch. 4). A rough term has Wendland's :math:`m(r) = (1 - r)_+^k (k r + 1)`, zero beyond
its reach: steps that no other design predicts. It is positive definite in up to *d* coordinates
with :math:`k = \lfloor d/2 \rfloor + 3` (Wendland 1995), at least 7 here.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from dogshape.sim.elementwise import Array

ROOT5 = 5.0**0.5
LEAST_POWER = 7  #: of Wendland's function


@dataclass(frozen=True)
class Term:
    """One term; ranges of designs are scaled to one."""

    scales: tuple[float, float] = (0.2, 30.0)  #: bounds; equal ones are the reach of a rough term
    first: float = 1.0  #: length scale that a fit starts from

    @property
    def rough(self) -> bool:
        """Fixed length scales."""
        return self.scales[0] == self.scales[1]


@dataclass(frozen=True)
class Covariance:
    """Terms that are summed, over so many coordinates of a design."""

    terms: tuple[Term, ...]
    coordinates: int
    #: of each term the logarithm of its variance and, unless it is rough, of its scales, (size,)
    theta: Array

    def _parts(self, smooth: bool = False) -> Iterator[tuple[Term, float, Array]]:
        """Yield each term, or only smooth ones, with its variance and its length scales."""
        place = 0
        for term in self.terms:
            free = 0 if term.rough else self.coordinates
            variance = float(np.exp(self.theta[place]))
            scales = np.exp(self.theta[place + 1 : place + 1 + free])
            place += 1 + free
            if not (smooth and term.rough):
                yield term, variance, scales if free else np.full(self.coordinates, term.first)

    def between(self, a: Array, b: Array, *, smooth: bool = False) -> Array:
        """Compute the covariance of designs (n, c) and (m, c), or its smooth part, (n, m)."""
        total = np.zeros((len(a), len(b)))
        for term, variance, scales in self._parts(smooth):
            apart = distance(a / scales, b / scales)
            total += variance * (wendland(apart, len(scales)) if term.rough else matern(apart))
        return total

    def variance(self) -> float:
        """Compute the variance of any design before any data."""
        return sum(variance for _, variance, _ in self._parts())

    def slopes(self, x: Array) -> tuple[Array, Array]:
        """Compute the covariance of designs (n, c) and its slopes by theta, (size, n, n)."""
        total, slopes = np.zeros((len(x), len(x))), []
        for term, variance, scales in self._parts():
            scaled = x / scales
            apart = distance(scaled, scaled)
            own = variance * (wendland(apart, len(scales)) if term.rough else matern(apart))
            total += own
            slopes.append(own)
            if not term.rough:
                steep = variance * 5.0 / 3.0 * (1.0 + ROOT5 * apart) * np.exp(-ROOT5 * apart)
                slopes += [steep * (v[:, None] - v[None, :]) ** 2 for v in scaled.T]
        return total, np.stack(slopes)


def first_parameters(terms: tuple[Term, ...], coordinates: int) -> tuple[Array, Array]:
    """Give the parameters that a fit starts from, (size,), and their bounds, (size, 2)."""
    theta, bounds = [], []
    for term in terms:
        free = 0 if term.rough else coordinates
        theta += [np.log(term.first)] + [np.log(term.first)] * free
        bounds += [np.log([1e-6, 100.0])] + [np.log(term.scales)] * free
    return np.array(theta), np.array(bounds)


def matern(apart: Array) -> Array:
    """Compute Matern's correlation (nu 5/2) of scaled distances, of their shape."""
    root = ROOT5 * apart
    return (1.0 + root * (1.0 + root / 3.0)) * np.exp(-root)


def wendland(apart: Array, coordinates: int) -> Array:
    """Compute Wendland's correlation of scaled distances, of their shape; zero from 1 on.

    Positive definite over that many coordinates.
    """
    power = max(LEAST_POWER, coordinates // 2 + 3)
    return np.maximum(1.0 - apart, 0.0) ** power * (power * apart + 1.0)


def distance(a: Array, b: Array) -> Array:
    """Compute the distances of scaled designs (n, c) and (m, c), (n, m)."""
    squares = (a * a).sum(axis=1)[:, None] - 2.0 * a @ b.T + (b * b).sum(axis=1)[None, :]
    return np.sqrt(np.maximum(squares, 0.0))
