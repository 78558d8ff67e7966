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

Other errors that cells have in common, with sizes of their own, stand beside it as further
columns *B* of normal coefficients: a drift (``diagnosis.likelihood.drift``), and errors of nominal
force and mismatch that all settings share (``diagnosis.bench.input_errors``). They are taken
off first,

.. math:: W = 1 + B^T H B, \quad g' = g - H B W^{-1} B^T g, \quad
          H' = H - H B W^{-1} B^T H,

which leaves :math:`\tfrac12 g^T B W^{-1} B^T g - \tfrac12 \ln |W|` and the same integral again.
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
LEAST_SPREAD = 0.1  #: of ln force, the least over which its line is one deviation
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
    beside : columns *B* of other errors in common, s, (cells, q); None without any.
    """

    roots: tuple[Array, ...]
    amplitudes: Array
    prior: Array
    beside: Array | None = None

    @cached_property
    def log_prior(self) -> Array:
        """Logarithm of the prior of each member, shape by shape, (shapes * a,)."""
        return np.log(self.prior).ravel()

    @cached_property
    def narrow_roots(self) -> tuple[Array, ...]:
        """Roots with the same covariances and no more columns than cells, s, (cells, r) each.

        All have as many columns, the last of which may be zero.
        """
        # A = R^T Q^T with Q orthogonal, which turns standard normals to standard normals.
        narrow = [
            np.linalg.qr(root.T)[1].T if len(root) < root.shape[1] else root for root in self.roots
        ]
        most = max(root.shape[1] for root in narrow)
        return tuple(np.pad(root, ((0, 0), (0, most - root.shape[1]))) for root in narrow)

    @property
    def covariance(self) -> Array:
        """Covariance of the offsets of all cells before the data, s^2, (cells, cells)."""
        return self._covariance(self.prior @ self.amplitudes**2)

    @property
    def widest(self) -> Array:
        """Covariance of these offsets at the largest amplitude, s^2, (cells, cells)."""
        return self._covariance(self.prior.sum(axis=1) * self.amplitudes[-1] ** 2)

    def _covariance(self, squares: Array) -> Array:
        """Add the covariances of all shapes, by so much each, and what else cells err in."""
        parts = [s * root @ root.T for s, root in zip(squares, self.roots, strict=True)]
        if self.beside is not None:
            parts.append(self.beside @ self.beside.T)
        found: Array = np.sum(parts, axis=0)
        return found

    @property
    def absent(self) -> bool:
        """Test that the simulation counts as right, and cells err in nothing else together."""
        if self.beside is not None and self.beside.any():
            return False
        return not any(root.any() for root in self.roots) or not self.amplitudes.any()

    def absent_beside(self, joint: Array) -> bool:
        """Test that cells err in nothing together, nor in a further error of values, s."""
        return self.absent and not joint.any()

    def of(self, cells: np.ndarray) -> Discrepancy:
        """Select some cells."""
        beside = None if self.beside is None else self.beside[cells]
        roots = tuple(root[cells] for root in self.roots)
        return Discrepancy(roots, self.amplitudes, self.prior, beside)

    def draw(self, generator: np.random.Generator) -> Array:
        """Draw offsets of all cells before the data, s, (cells,)."""
        member = generator.choice(self.prior.size, p=self.prior.ravel())
        shape, place = np.unravel_index(member, self.prior.shape)
        root = self.roots[int(shape)]
        drawn: Array = self.amplitudes[place] * root @ generator.standard_normal(root.shape[1])
        if self.beside is not None:
            drawn = drawn + self.beside @ generator.standard_normal(self.beside.shape[1])
        return drawn


def discrepancy_prior(
    mismatch: Array, force: Array, baseline: Array, rules: Rules, told: np.ndarray | None = None
) -> Discrepancy:
    """Build the prior of the discrepancy.

    Parameters
    ----------
    mismatch, force : rad/s and N, (cells,).
    baseline : mean times without any effect, s, (cells,); NaN where there is none.
    rules : with the scale of the amplitude's half-normal prior, length and shapes.
    told : cells with data, (cells,) true or false, by whose forces the line over these is scaled;
        None for all. Rows that were never measured change nothing.
    """
    speeds, place = np.unique(np.log(abs(mismatch) + RPM), return_inverse=True)
    alike = np.exp(-0.5 * ((speeds[:, None] - speeds[None]) / rules.discrepancy_length) ** 2)
    forces = np.log(force)
    scale = forces if told is None or not told.any() else forces[told]
    # Forces that hardly differ tell no line; one force has none.
    slope = (forces - scale.mean()) / max(float(scale.std()), LEAST_SPREAD)
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
    first, second, taken, wide, own = _without_others(slopes, joint, prior.beside)
    # All shapes stand side by side: a step of the elimination is one of all values and shapes.
    roots = prior.narrow_roots
    matrices = [_less(curvatures(root, second), own, root) for root in roots]
    vectors = [(first @ root).T for root in roots]
    form = _tridiagonal(np.concatenate(matrices, axis=2), np.concatenate(vectors, axis=1))
    count = len(first)
    squares, spread = (
        np.hstack([part[k * count : (k + 1) * count] for k in range(len(roots))])
        for part in form.sums(prior.amplitudes**2)
    )
    return Marginals(squares + taken[:, None], spread + wide[:, None], prior.log_prior)


def curvatures(root: Array, second: Array) -> Array:
    """Compute *M* at the amplitude one of each value, (r, r, m)."""
    # One product of matrices for all values: each entry is a sum over cells.
    size = root.shape[1]
    pairs = (root[:, :, None] * root[:, None]).reshape(len(root), -1)
    return (pairs.T @ second.T).reshape(size, size, -1)


@dataclass(frozen=True)
class _Tridiagonal:
    """Symmetric matrices turned to tridiagonal form, with a vector turned along the first axis.

    Parameters
    ----------
    diagonal : (r, m).
    beside : squares beside the diagonal, the first of which is the squared vector, (r, m).
    """

    diagonal: Array
    beside: Array

    def sums(self, scales: Array) -> tuple[Array, Array]:
        r"""Compute the integral's parts at scales *s* of *M*, (m, scales) each.

        :math:`s v^T (1 + s M)^{-1} v` and :math:`\tfrac12 \ln |1 + s M|`: pivots from the last row
        up multiply to the determinant, and the last is the inverse's first entry over one.
        """
        scale = scales[:, None]
        pivot, product = np.ones(1), np.zeros(1)
        below: Array = np.zeros_like(self.diagonal[0])
        for place in range(len(self.diagonal) - 1, -1, -1):
            # Rounding must not make an error that explains less than nothing.
            pivot = np.maximum(1.0 + scale * self.diagonal[place] - scale**2 * below / pivot, 1.0)
            product = product + np.log(pivot)
            below = self.beside[place]
        return (scale * below / pivot).T, 0.5 * product.T


def _tridiagonal(matrix: Array, vector: Array) -> _Tridiagonal:
    """Turn matrices (r, r, m) to tridiagonal form by reflections, with a vector (r, m) before.

    The matrices are overwritten. LAPACK would take each value's small matrix by itself; here every
    step is one of all values (Golub and Van Loan 2013, ch. 8.3). The first reflection turns the
    vector along the first axis.
    """
    size = len(vector)
    diagonal, beside = np.empty_like(vector), np.empty_like(vector)
    column = vector
    for place in range(size):
        square = (column**2).sum(axis=0)
        beside[place] = square
        if column.shape[0] > 1:
            mirror = column.copy()
            mirror[0] += np.copysign(np.sqrt(square), column[0])
            length = (mirror**2).sum(axis=0)
            factor = np.divide(2.0, length, out=np.zeros_like(length), where=length > 0.0)
            pushed = factor * np.einsum("ijm,jm->im", matrix, mirror)
            pushed -= 0.5 * factor * (mirror * pushed).sum(axis=0) * mirror
            crossed = mirror[:, None] * pushed
            matrix -= crossed
            matrix -= crossed.transpose(1, 0, 2)
        diagonal[place] = matrix[0, 0]
        column, matrix = matrix[1:, 0], matrix[1:, 1:]
    return _Tridiagonal(diagonal, beside)


def _less(matrix: Array, own: Array | None, root: Array) -> Array:
    """Take what other errors take of the curvatures off the matrices of a root, (r, r, m)."""
    if own is None:
        return matrix
    pulls = np.atleast_3d(own).transpose(2, 0, 1) @ root  # (q, m, r)
    for pull in np.swapaxes(pulls, 1, 2):
        matrix = matrix - pull[:, None] * pull
    return matrix


def _without_others(
    slopes: Slopes, joint: Array, beside: Array | None
) -> tuple[Array, Array, Array, Array, Array | None]:
    """Integrate all errors beside the discrepancy out, as ``_without_joint`` does with one.

    With several the last is (m, cells, q).
    """
    if beside is None or not beside.any():
        return _without_joint(slopes, joint)
    bent, root, scores = _others(slopes, joint, beside)
    taken = (scores**2).sum(axis=1)
    wide = np.log(np.diagonal(root, axis1=1, axis2=2)).sum(axis=1)
    own = np.swapaxes(np.linalg.solve(root, np.swapaxes(bent, 1, 2)), 1, 2)
    left = slopes.first - (own @ scores[..., None])[..., 0]
    return left, slopes.second, taken, wide, own


def _others(slopes: Slopes, joint: Array, beside: Array) -> tuple[Array, Array, Array]:
    """Return *HB*, the root of *W*, and what its inverse makes of *B'g*, value by value."""
    columns = np.broadcast_to(beside, (len(slopes.first), *beside.shape))
    if joint.any():
        columns = np.concatenate([joint[..., None], columns], axis=2)
    bent = slopes.second[..., None] * columns
    across = np.swapaxes(columns, 1, 2)
    root: Array = np.asarray(np.linalg.cholesky(np.eye(columns.shape[2]) + across @ bent), float)
    pulled = np.linalg.solve(root, across @ slopes.first[..., None])
    return bent, root, np.asarray(pulled[..., 0], float)


def beside_draws(
    slopes: Slopes,
    prior: Discrepancy,
    joint: Array,
    discrepancy: Array,
    generator: np.random.Generator,
) -> Array:
    """Draw the coefficients of the other errors of each value given the data, (m, q).

    ``discrepancy`` (m, cells), s, was drawn for the same values.
    """
    if prior.beside is None or not prior.beside.any():
        return np.zeros((len(slopes.first), 0))
    left = Slopes(slopes.first - slopes.second * discrepancy, slopes.second)
    _, root, scores = _others(left, joint, prior.beside)
    noise = generator.standard_normal(scores.shape)
    up = np.swapaxes(root, 1, 2)
    drawn: Array = np.asarray(np.linalg.solve(up, (scores + noise)[..., None])[..., 0], float)
    return drawn[:, drawn.shape[1] - prior.beside.shape[1] :]


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
    first, second, _, _, own = _without_others(slopes, joint, prior.beside)
    found = np.zeros(first.shape)
    for shape, root in enumerate(prior.roots):
        mine = np.flatnonzero(shapes == shape)
        size = prior.amplitudes[places[mine]][:, None]
        matrix = _less(curvatures(root, second[mine]), None if own is None else own[mine], root)
        precision = np.eye(root.shape[1]) + size[..., None] ** 2 * np.moveaxis(matrix, -1, 0)
        covariance = np.linalg.inv(precision)
        mean = (covariance @ (size * (first[mine] @ root))[..., None])[..., 0]
        noise = generator.standard_normal(mean.shape)[..., None]
        drawn = mean + (np.linalg.cholesky(covariance) @ noise)[..., 0]
        found[mine] = size * (drawn @ root.T)
    return found, prior.amplitudes[places]
