r"""Evidence :math:`Z = \int L(\theta) \pi(\theta) d\theta` over the shares of the priors.

One or two parameters of one effect: boxes of the unit cube with three Gauss points a side are
halved until no halving changes the sum; the change of the last halving is the error. More
parameters, and pairs of effects: importance sampling from the prior and from Student-t
distributions round the draws so far. All rounds are weighted as one mixture, and the effective
sample size gives the error. ``validation.nested_sampling`` is a second computation.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import cache, partial

import numpy as np
from scipy.special import gammaln
from scipy.stats import qmc

from dogshape.diagnosis.likelihood.scores import IMPOSSIBLE, Problem, Rows, Scored, score
from dogshape.diagnosis.likelihood.time_parts import log_sum
from dogshape.diagnosis.prediction.hypotheses import Space, log_odds
from dogshape.diagnosis.terms import Array, Hypothesis

FIRST = {1: 8, 2: 4}  #: boxes along a side at the start
TOLERANCE = 0.003  #: share of the evidence that a halving may still change
ROUNDS = 9  #: of halving, at most
POINTS = {1: 600, 2: 2600}  #: with which halving ends
#: Values of the first round of importance sampling, even over the prior: of three parameters or
#: fewer, twice as many for each one more, whose narrow peak they else miss.
FIRST_DRAWS = 128
DRAWS = 192  #: values in a round of importance sampling
SAMPLINGS = 16  #: rounds of importance sampling, at most
ENOUGH = 150.0  #: effective draws with which the sampling ends
#: How far below the best log evidence the best value of a hypothesis lies where more rounds are
#: not worth while, round by round: the first values may all miss a narrow peak.
HOPELESS = (100.0, 40.0, 15.0, 7.0)
SOME, BEHIND = 20.0, 4.0  #: effective draws that do for a hypothesis so many nats behind the best
DOF = 5.0  #: of the Student-t
PRIOR_SHARE = 0.15  #: of the draws that come from the prior
OUTSIDE = 48  #: values at the ends of the prior

_GAUSS, _GAUSS_WEIGHTS = np.polynomial.legendre.leggauss(3)

Score = Callable[[Array], Rows]


@dataclass(frozen=True)
class Sum:
    """Rows of a quadrature with the logarithm of the prior's share of each, (m,)."""

    rows: Rows
    log_prior: Array
    log_evidence: float
    error: float


def evidence(
    problem: Problem, space: Space, best: float = -np.inf, cells: np.ndarray | None = None
) -> Scored:
    """Return a hypothesis with its evidence.

    ``best`` is the log evidence that it would need to lead: what lies far below is left early.
    ``cells``, true or false, are those whose data count, all by default.
    """

    at = partial(_scored_at, problem, space, cells)
    size = len(space.parameters)
    if size == 0:
        rows = at(np.zeros((1, 0)))
        total = float(rows.whole[0])
        return Scored(space, rows, np.zeros(1), total, 0.0)
    if by_quadrature(space):
        found = normalised(quadrature(at, size, best))
    else:
        found = normalised(sampled(at, size, best))
    parts = found.rows, found.log_prior, found.log_evidence, found.error
    return Scored(space, *parts, ends=partial(_log_at_ends, at, size))


def _scored_at(problem: Problem, space: Space, cells: np.ndarray | None, shares: Array) -> Rows:
    """Score a hypothesis at shares (m, p) of its priors, given the data of some cells or all."""
    rows = score(problem, space, shares)
    return rows if cells is None else rows.of(cells)


def _log_at_ends(at: Score, size: int) -> Array:
    """Compute the log likelihood at the ends of the prior, (m,)."""
    return at(outside(size)).whole


def scored_in_turn(
    problem: Problem, spaces: Iterable[Space], best: float = -np.inf
) -> dict[Hypothesis, Scored]:
    """Compute evidences in turn, so that what is hopeless beside the best is left early.

    ``best`` is the largest log evidence, with the prior over that of none.
    """
    found: dict[Hypothesis, Scored] = {}
    for space in spaces:
        prior = log_odds(space.hypothesis, problem.settings.priors)
        found[space.hypothesis] = evidence(problem, space, best - prior)
        best = max(best, found[space.hypothesis].log_evidence + prior)
    return found


def by_quadrature(space: Space) -> bool:
    """Test that the evidence of a hypothesis is a sum over boxes rather than over draws."""
    alone = sum(bool(effect.parameters) for effect in space.effects) == 1
    return alone and len(space.parameters) in FIRST


def effective(log: Array) -> float:
    """Return the effective number of draws with these logarithms of weights."""
    return float(np.exp(2.0 * log_sum(log, axis=0) - log_sum(2.0 * log, axis=0)))


def normalised(found: Sum) -> Sum:
    """Return the sum with the prior's weight on benches that there can be."""
    possible = found.rows.log_likelihood[:, 0] > IMPOSSIBLE
    if possible.all():
        return found
    whole = log_sum(found.log_prior[possible], axis=0) - log_sum(found.log_prior, axis=0)
    return Sum(
        found.rows.only(possible),
        found.log_prior[possible] - whole,
        found.log_evidence - float(whole),
        found.error,
    )


def hopeless(rows: Rows, best: float, finished: int) -> bool:
    """Test that a hypothesis lies so far below the best that more rounds change nothing."""
    limit = HOPELESS[min(finished, len(HOPELESS) - 1)]
    return float(rows.whole.max()) < best - limit


def quadrature(at: Score, size: int, best: float = -np.inf) -> Sum:
    """Integrate over the unit cube of ``size`` 1 or 2 by halving boxes."""
    # scipy's cubature gives the sum, but not the rows behind it, which all that follows weighs.
    boxes = _first_boxes(size)
    rows = at(_points(boxes))
    log = _log_weights(boxes)
    live = np.ones(len(boxes), dtype=bool)
    each = 3**size
    error = np.inf
    for finished in range(ROUNDS):
        parts = _box_sums(rows, log, each)
        whole = log_sum(parts, axis=0)
        share = np.exp(parts - whole)
        split = live & (share > TOLERANCE / 10.0)
        if not split.any() or len(boxes) * each > POINTS[size] or hopeless(rows, best, finished):
            break
        children = _halved(boxes[split])
        new, new_log = at(_points(children)), _log_weights(children)
        sums = _box_sums(new, new_log, each).reshape(-1, 2**size)
        change = np.abs(np.exp(log_sum(sums, axis=1) - whole) - share[split])
        error = float(change.sum()) / np.sqrt(max(1, split.sum()))
        again = np.repeat(change > TOLERANCE / np.sqrt(split.sum()), 2**size)
        keep = np.repeat(~split, each)
        rows = rows.only(keep).joined(new)
        log = np.concatenate([log[keep], new_log])
        boxes = np.concatenate([boxes[~split], children])
        live = np.concatenate([live[~split], again])
    return Sum(rows, log, float(log_sum(_box_sums(rows, log, each), axis=0)), error)


def _first_boxes(size: int) -> Array:
    """Return boxes as low corners and widths, (boxes, 2, size)."""
    count = FIRST[size]
    corners = np.array(list(itertools.product(np.arange(count) / count, repeat=size)))
    return np.stack([corners, np.full_like(corners, 1.0 / count)], axis=1)


def _halved(boxes: Array) -> Array:
    size = boxes.shape[2]
    offsets = np.array(list(itertools.product((0.0, 0.5), repeat=size)))
    corners = boxes[:, None, 0] + offsets * boxes[:, None, 1]
    widths = np.broadcast_to(0.5 * boxes[:, None, 1], corners.shape)
    return np.stack([corners, widths], axis=2).reshape(-1, 2, size)


def _points(boxes: Array) -> Array:
    size = boxes.shape[2]
    inside = 0.5 + 0.5 * np.array(list(itertools.product(_GAUSS, repeat=size)))
    return (boxes[:, None, 0] + inside * boxes[:, None, 1]).reshape(-1, size)


def _log_weights(boxes: Array) -> Array:
    size = boxes.shape[2]
    product = np.array([np.prod(w) for w in itertools.product(_GAUSS_WEIGHTS / 2.0, repeat=size)])
    volumes = boxes[:, 1].prod(axis=1)
    return np.log(volumes[:, None] * product).ravel()


def _box_sums(rows: Rows, log: Array, each: int) -> Array:
    return log_sum((log + rows.whole).reshape(-1, each), axis=1)


def sampled(at: Score, size: int, best: float = -np.inf, seed: int = 1) -> Sum:
    """Integrate over the unit cube by importance sampling that adapts itself."""
    generator = np.random.default_rng(seed)
    points = qmc.Sobol(size, seed=generator).random(FIRST_DRAWS * 2 ** max(0, size - 3))
    rows = at(points)
    proposals: list[_Proposal] = []
    counts = [len(points)]
    for finished in range(SAMPLINGS):
        likely = rows.whole
        log = -_log_mixture(rows.shares, proposals, counts)
        if hopeless(rows, best, finished) or effective(log + likely) > ENOUGH:
            break
        if log_sum(log + likely, axis=0) < best - BEHIND and effective(log + likely) > SOME:
            break
        proposal = _fitted(rows.shares, log, likely)
        new = proposal.draw(DRAWS, generator)
        new = new[((new > 0.0) & (new < 1.0)).all(axis=1)]
        proposals.append(proposal)
        counts.append(DRAWS)
        if len(new):
            rows = rows.joined(at(new))
    likely = rows.whole
    log = -_log_mixture(rows.shares, proposals, counts)
    error = 1.0 / np.sqrt(effective(log + likely))
    # Draws outside the cube have no likelihood but count in the mixture, which has them.
    return Sum(rows, log, float(log_sum(log + likely, axis=0)), float(error))


@dataclass(frozen=True)
class _Proposal:
    """A Student-t, with a share of the uniform on the cube."""

    centre: Array
    root: Array  #: Cholesky factor of its matrix, lower

    def draw(self, count: int, generator: np.random.Generator) -> Array:
        size = self.centre.size
        flat = generator.random(count) < PRIOR_SHARE
        normal = generator.standard_normal((count, size)) @ self.root.T
        student = self.centre + normal / np.sqrt(generator.chisquare(DOF, (count, 1)) / DOF)
        return np.where(flat[:, None], generator.random((count, size)), student)

    def log_density(self, points: Array) -> Array:
        size = self.centre.size
        scaled = np.linalg.solve(self.root, (points - self.centre).T)
        constant = gammaln((DOF + size) / 2.0) - gammaln(DOF / 2.0) - size / 2 * np.log(DOF * np.pi)
        log = constant - np.log(np.diag(self.root)).sum()
        log = log - (DOF + size) / 2.0 * np.log1p((scaled**2).sum(axis=0) / DOF)
        return np.logaddexp(np.log(PRIOR_SHARE), np.log1p(-PRIOR_SHARE) + log)


def _log_mixture(points: Array, proposals: list[_Proposal], counts: list[int]) -> Array:
    """Return the logarithm of the number of draws expected per volume at points, (m,)."""
    logs = [np.full(len(points), np.log(counts[0]))]
    pairs = zip(proposals, counts[1:], strict=True)
    logs += [np.log(count) + one.log_density(points) for one, count in pairs]
    return log_sum(np.stack(logs), axis=0)


def _fitted(points: Array, log: Array, likely: Array) -> _Proposal:
    """Fit a Student-t to weights that are flattened until enough draws share them."""
    power, size = 1.0, points.shape[1]
    while effective(log + power * likely) < 8.0 * size and power > 1e-3:
        power *= 0.7
    weights = np.exp(log + power * likely - log_sum(log + power * likely, axis=0))
    centre = weights @ points
    apart = points - centre
    matrix: Array = 1.2 * (weights[:, None] * apart).T @ apart + 1e-7 * np.eye(size)
    root: Array = np.asarray(np.linalg.cholesky(matrix), dtype=float)
    return _Proposal(centre, root)


@cache
def outside(size: int) -> Array:
    """Return shares of a prior of twice the width that lie outside, moved to its ends, (m, p)."""
    if size == 1:
        return np.array([[0.0], [1.0]])
    wide = 2.0 * qmc.Halton(size, seed=1).random(8 * OUTSIDE) - 0.5
    beyond = wide[((wide < 0.0) | (wide > 1.0)).any(axis=1)][:OUTSIDE]
    return np.clip(beyond, 0.0, 1.0)


def with_width(found: Scored, factor: float) -> Scored:
    """Return a hypothesis with priors half (0.5) or twice (2) as wide in each parameter.

    Half as wide is round what the data favour. Beyond the ends of a prior the likelihood is taken
    as at its ends.
    """
    size = len(found.space.parameters)
    if size == 0:
        return found
    if factor > 1.0:
        return _doubled(found, size)
    centre = np.clip(found.weights() @ found.rows.shares, 0.25, 0.75)
    inside = np.all(np.abs(found.rows.shares - centre) <= 0.25, axis=1)
    if not inside.any():
        return found
    log = found.log_prior[inside]
    log = log - log_sum(log, axis=0)
    rows = found.rows.only(inside)
    total = float(log_sum(log + rows.whole, axis=0))
    return replace(found, rows=rows, log_prior=log, log_evidence=total)


def _doubled(found: Scored, size: int) -> Scored:
    within = 0.5**size
    total = np.log(within) + found.log_evidence
    if found.ends is not None:
        ends = found.ends()
        beyond = np.log1p(-within) + log_sum(ends, axis=0) - np.log(len(ends))
        total = np.logaddexp(total, beyond)
    return replace(found, log_evidence=float(total))
