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
MIN_WENDLAND_POWER = 7
VARIANCE_BOUNDS = (1e-6, 100.0)  #: of a term, of targets scaled to a variance of one


@dataclass(frozen=True)
class Term:
    """One term; ranges of designs are scaled to one."""

    scales: tuple[float, float] = (0.2, 30.0)  #: bounds; equal ones are the reach of a rough term
    first: float = 1.0  #: length scale that a fit starts from

    @property
    def rough(self) -> bool:
        """Whether the length scales are fixed."""
        return self.scales[0] == self.scales[1]


@dataclass(frozen=True)
class Covariance:
    """Sum of terms over a number of coordinates of a design."""

    terms: tuple[Term, ...]
    coordinates: int
    #: of each term the logarithm of its variance and, unless it is rough, of its scales, (size,)
    theta: Array

    def _unpack(self, smooth: bool = False) -> Iterator[tuple[Term, float, Array]]:
        """Yield each term, or only smooth ones, with variance and length scales, (c,)."""
        position = 0
        for term in self.terms:
            scale_count = 0 if term.rough else self.coordinates
            variance = float(np.exp(self.theta[position]))
            scales = np.exp(self.theta[position + 1 : position + 1 + scale_count])
            position += 1 + scale_count
            if term.rough:
                scales = np.full(self.coordinates, term.first)
            if not (smooth and term.rough):
                yield term, variance, scales

    def between(self, a: Array, b: Array, *, smooth: bool = False) -> Array:
        """Compute the covariance of designs (n, c) and (m, c), or its smooth part, (n, m)."""
        total = np.zeros((len(a), len(b)))
        for term, variance, scales in self._unpack(smooth):
            separation = distance(a / scales, b / scales)
            total += variance * _correlation(term, separation, len(scales))
        return total

    def variance(self) -> float:
        """Compute the prior variance of a design."""
        return sum(variance for _, variance, _ in self._unpack())

    def slopes(self, x: Array) -> tuple[Array, Array]:
        """Compute the covariance of designs (n, c), (n, n), and its slopes, (size, n, n).

        The slopes are the derivatives with respect to ``theta``.
        """
        total = np.zeros((len(x), len(x)))
        slopes = []
        for term, variance, scales in self._unpack():
            scaled = x / scales
            separation = distance(scaled, scaled)
            covariance = variance * _correlation(term, separation, len(scales))
            total += covariance
            slopes.append(covariance)
            if term.rough:
                continue
            decay = np.exp(-ROOT5 * separation)
            steepness = variance * 5.0 / 3.0 * (1.0 + ROOT5 * separation) * decay
            for column in scaled.T:
                slopes.append(steepness * (column[:, None] - column[None, :]) ** 2)
        return total, np.stack(slopes)


def first_parameters(terms: tuple[Term, ...], coordinates: int) -> tuple[Array, Array]:
    """Return initial parameters of a fit, (size,), and their bounds, (size, 2)."""
    theta = []
    bounds = []
    for term in terms:
        scale_count = 0 if term.rough else coordinates
        theta += [np.log(term.first)] * (1 + scale_count)
        bounds += [np.log(VARIANCE_BOUNDS)] + [np.log(term.scales)] * scale_count
    return np.array(theta), np.array(bounds)


def _correlation(term: Term, separation: Array, coordinates: int) -> Array:
    """Compute the correlation of a term at scaled distances, same shape."""
    if term.rough:
        return wendland(separation, coordinates)
    return matern(separation)


def matern(separation: Array) -> Array:
    """Compute Matern's correlation (nu 5/2) at scaled distances, same shape."""
    root = ROOT5 * separation
    return (1.0 + root * (1.0 + root / 3.0)) * np.exp(-root)


def wendland(separation: Array, coordinates: int) -> Array:
    """Compute Wendland's correlation at scaled distances, same shape; zero from 1 on.

    It is positive definite over at most ``coordinates`` coordinates.
    """
    power = max(MIN_WENDLAND_POWER, coordinates // 2 + 3)
    return np.maximum(1.0 - separation, 0.0) ** power * (power * separation + 1.0)


def distance(a: Array, b: Array) -> Array:
    """Compute the distances of scaled designs (n, c) and (m, c), (n, m)."""
    squares = (a * a).sum(axis=1)[:, None] - 2.0 * a @ b.T + (b * b).sum(axis=1)[None, :]
    return np.sqrt(np.maximum(squares, 0.0))
