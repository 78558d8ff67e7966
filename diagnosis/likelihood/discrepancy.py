r"""Discrepancy: by how much the simulation is wrong under every hypothesis, inferred with the rest.

Two honest engines differ by some percent of the time, mostly to one side, alike at neighbouring
mismatches, and somewhat with the force. Cell *k*, of the mean time :math:`\bar t_k` without any
effect, of the mismatch *n* and the force *F*, is then off by

.. math:: \delta_k = s\, \bar t_k\, (b + g(\ln n_k) + h(\ln n_k)\, f_k), \qquad f_k = \ln F_k
          \text{ standardised},

with *b* normal, and *g*, *h* Gaussian processes of the length one. Their variances are shares of
one (``Rules.discrepancy_shapes``): mostly one-sided, or mostly a curve over the mismatch. The
amplitude *s* is half normal; its nodes have the prior probability between the middles of their
neighbours. This is the discrepancy of Kennedy and O'Hagan (2001) with an informative prior, without
which parameters come out wrong and too sure (Brynjarsdottir and O'Hagan 2014).

Given amplitude and shape, :math:`\delta = A z` with *z* standard normal, and with the slopes *g*
and curvatures *H* of the cells' log likelihoods over an offset,

.. math:: \ln \int e^{g^T A z - z^T A^T H A z / 2} N(z; 0, 1) dz
          = \tfrac12 v^T (1 + M)^{-1} v - \tfrac12 \ln |1 + M|, \quad
          v = A^T g, \; M = A^T H A,

exact where the times of the cells are normal. Amplitudes and shapes are summed over.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.stats import halfnorm

from dogshape.diagnosis.settings import Rules
from dogshape.diagnosis.terms import Array, Table
from dogshape.sim.units import RPM

JITTER = 1e-9  #: of a variance, so that its matrix has a root
#: Amplitudes over the scale of their prior.
NODES = np.array([0.1, 0.4, 0.8, 1.3, 2.0, 3.0])


@dataclass(frozen=True)
class Slopes(Table):
    """Slopes of cells' log likelihoods (m, cells) over an offset of the prediction.

    ``first`` is the derivative, 1/s, ``second`` the curvature downwards, 1/s^2, not negative.
    """

    first: Array
    second: Array

    def of(self, cells: np.ndarray) -> Slopes:
        """Select some cells."""
        return Slopes(self.first[:, cells], self.second[:, cells])


@dataclass(frozen=True)
class Discrepancy:
    """Prior of the discrepancy at the cells of a data set.

    Parameters
    ----------
    roots : *A* of each shape at the amplitude one, s, (cells, r) each.
    amplitudes : as shares of a mean time, (a,).
    prior : of shapes and amplitudes, (shapes, a), adds to one.
    """

    roots: tuple[Array, ...]
    amplitudes: Array
    prior: Array

    @cached_property
    def log_prior(self) -> Array:
        """Logarithm of the prior of each member, shape by shape, (shapes * a,)."""
        return np.log(self.prior).ravel()

    @property
    def covariance(self) -> Array:
        """Covariance of the offsets of all cells before the data, s^2, (cells, cells)."""
        squares = self.prior @ self.amplitudes**2
        parts = [s * root @ root.T for s, root in zip(squares, self.roots, strict=True)]
        found: Array = np.sum(parts, axis=0)
        return found

    @property
    def absent(self) -> bool:
        """Test that the simulation counts as right."""
        return not any(root.any() for root in self.roots) or not self.amplitudes.any()

    def of(self, cells: np.ndarray) -> Discrepancy:
        """Select some cells."""
        return Discrepancy(tuple(root[cells] for root in self.roots), self.amplitudes, self.prior)

    def draw(self, generator: np.random.Generator) -> Array:
        """Draw offsets of all cells before the data, s, (cells,)."""
        member = generator.choice(self.prior.size, p=self.prior.ravel())
        shape, place = np.unravel_index(member, self.prior.shape)
        root = self.roots[int(shape)]
        drawn: Array = self.amplitudes[place] * root @ generator.standard_normal(root.shape[1])
        return drawn


def discrepancy_prior(mismatch: Array, force: Array, baseline: Array, rules: Rules) -> Discrepancy:
    """Build the prior of the discrepancy.

    Parameters
    ----------
    mismatch, force : rad/s and N, (cells,).
    baseline : mean times without any effect, s, (cells,); NaN where there is none.
    rules : with the scale of the amplitude's half-normal prior, length and shapes.
    """
    speeds, place = np.unique(np.log(abs(mismatch) + RPM), return_inverse=True)
    alike = np.exp(-0.5 * ((speeds[:, None] - speeds[None]) / rules.discrepancy_length) ** 2)
    forces = np.log(force)
    slope = (forces - forces.mean()) / (forces.std() or 1.0)
    edge = JITTER * np.eye(speeds.size)
    roots = []
    for constant, curve, tilt, _ in rules.discrepancy_shapes:
        level = np.linalg.cholesky(constant + curve * alike + edge)[place]
        tilted = np.linalg.cholesky(tilt * alike + edge)[place] * slope[:, None]
        both = np.hstack([level, tilted] if slope.any() else [level])
        roots.append(np.nan_to_num(baseline)[:, None] * both)
    middles = np.concatenate([[0.0], 0.5 * (NODES[1:] + NODES[:-1]), [np.inf]])
    chances = np.diff(halfnorm.cdf(middles))
    prior = np.outer([shape[-1] for shape in rules.discrepancy_shapes], chances)
    return Discrepancy(tuple(roots), rules.discrepancy * NODES, prior)


@dataclass(frozen=True)
class Marginals:
    """Change of the log likelihood of m values by the discrepancy, each member's, (m, members).

    Parameters
    ----------
    squares : squared scores that it explains. A score is a slope over the root of the curvature.
    spread : half the logarithm of the determinant.
    log_prior : of the members, (members,).
    """

    squares: Array
    spread: Array
    log_prior: Array

    @cached_property
    def _joint(self) -> Array:
        return self.log_prior + 0.5 * self.squares - self.spread

    @property
    def log(self) -> Array:
        """Change of the log likelihood, (m,)."""
        top = self._joint.max(axis=1)
        summed: Array = np.log(np.exp(self._joint - top[:, None]).sum(axis=1)) + top
        return summed

    @property
    def weights(self) -> Array:
        """Posterior of the members given each value, (m, members)."""
        return np.exp(self._joint - self.log[:, None])


def marginals(slopes: Slopes, prior: Discrepancy, joint: Array) -> Marginals:
    """Integrate the discrepancy out.

    ``joint`` (m, cells) is a further error, s, normal and fully correlated, of each value; zero
    where there is none.
    """
    first, second, taken, wide, own = _without_joint(slopes, joint)
    scales = prior.amplitudes**2
    squares, spreads = [], []
    for root in prior.roots:
        matrix = root.T @ (second[:, :, None] * root)
        if own is not None:
            pull = own @ root
            matrix = matrix - pull[:, :, None] * pull[:, None]
        values, vectors = np.linalg.eigh(matrix)
        values = np.maximum(values, 0.0)[:, None]
        parts = (np.swapaxes(vectors, 1, 2) @ (first @ root)[..., None])[:, None, :, 0] ** 2
        gain = 1.0 + scales[:, None] * values
        squares.append((scales[:, None] * parts / gain).sum(axis=2))
        spreads.append(0.5 * np.log(gain).sum(axis=2))
    return Marginals(
        np.hstack(squares) + taken[:, None], np.hstack(spreads) + wide[:, None], prior.log_prior
    )


def _without_joint(slopes: Slopes, joint: Array) -> tuple[Array, Array, Array, Array, Array | None]:
    """Integrate each value's own error out: slopes, curvatures, squares, spread, and what it takes.

    The last, (m, cells), has an outer product that is to be taken off the curvatures.
    """
    first, second = slopes.first, slopes.second
    if not joint.any():
        nothing = np.zeros(len(first))
        return first, second, nothing, nothing, None
    bent = second * joint
    whole = 1.0 + (joint * bent).sum(axis=1)
    pulled = (joint * first).sum(axis=1)
    left = first - bent * (pulled / whole)[:, None]
    return left, second, pulled**2 / whole, 0.5 * np.log(whole), bent / np.sqrt(whole)[:, None]


def posterior_draws(
    slopes: Slopes,
    prior: Discrepancy,
    joint: Array,
    generator: np.random.Generator,
) -> tuple[Array, Array]:
    """Draw the discrepancy of each value given the data, s, (m, cells), and its amplitude, (m,)."""
    weights = marginals(slopes, prior, joint).weights
    edges = weights.cumsum(axis=1)
    picks = (generator.random((len(weights), 1)) * edges[:, -1:] > edges).sum(axis=1)
    shapes, places = np.unravel_index(np.minimum(picks, weights.shape[1] - 1), prior.prior.shape)
    first, second, _, _, own = _without_joint(slopes, joint)
    found = np.zeros(first.shape)
    for shape, root in enumerate(prior.roots):
        mine = np.flatnonzero(shapes == shape)
        size = prior.amplitudes[places[mine]][:, None]
        matrix = root.T @ (second[mine, :, None] * root)
        if own is not None:
            pull = own[mine] @ root
            matrix = matrix - pull[:, :, None] * pull[:, None]
        precision = np.eye(root.shape[1]) + size[..., None] ** 2 * matrix
        covariance = np.linalg.inv(precision)
        mean = (covariance @ (size * (first[mine] @ root))[..., None])[..., 0]
        noise = generator.standard_normal(mean.shape)[..., None]
        drawn = mean + (np.linalg.cholesky(covariance) @ noise)[..., 0]
        found[mine] = size * (drawn @ root.T)
    return found, prior.amplitudes[places]
