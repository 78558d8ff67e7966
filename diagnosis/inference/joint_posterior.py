"""Joint posterior of a hypothesis: draws of its parameters and of the discrepancy's amplitude.

Draws are rows of the evidence by their posterior weights. The amplitude is that of a node of the
discrepancy, drawn within the part of its half-normal prior that the node stands for. Densities are
sums of normal kernels over the shares of the priors, mirrored at the ends of these.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import halfnorm

from dogshape.diagnosis.inference.evidence import effective
from dogshape.diagnosis.inference.influence import heavy_rows
from dogshape.diagnosis.likelihood.discrepancy import NODES, marginals
from dogshape.diagnosis.likelihood.scores import Scored
from dogshape.diagnosis.terms import Array, Hypothesis

DRAWN = 600  #: values of a hypothesis
CELLS = 34  #: of a density along an axis
ROOM = 3.5  #: standard deviations that an axis shows, either side, at most
WIDEST = 0.9999  #: probability of the amplitude's prior that counts as its range


@dataclass(frozen=True)
class JointPosterior:
    """Draws from the posterior of a hypothesis.

    Parameters
    ----------
    shares : of the priors, (draws, p); the last column is the amplitude's where ``amplitude``.
    draws : effective number that they stand for.
    amplitude : of the discrepancy, as shares of the mean time, (draws,); None without any.
    """

    hypothesis: Hypothesis
    shares: Array
    draws: float
    amplitude: Array | None


def joint_posterior(one: Scored) -> JointPosterior:
    """Draw from the posterior of a hypothesis."""
    one = heavy_rows(one)
    generator = np.random.default_rng(1)
    weights = one.weights()
    steps = (np.arange(DRAWN) + generator.random()) / DRAWN
    places = np.minimum(np.searchsorted(np.cumsum(weights), steps), weights.size - 1)
    rows = one.rows.only(places)
    count = effective(one.log_prior + one.rows.whole) if len(weights) > 1 else 1.0
    if one.rows.shares.shape[1] == 1:
        # Rows of a quadrature are few and even: values between them are as good.
        order = np.argsort(one.rows.shares[:, 0])
        below = np.cumsum(weights[order]) - 0.5 * weights[order]
        between = np.interp(steps, below, one.rows.shares[order, 0])[:, None]
        order = order[np.minimum(np.searchsorted(below, steps), order.size - 1)]
        rows, count = replace(one.rows.only(order), shares=between), float(DRAWN)
    prior = rows.discrepancy
    if prior.absent or not prior.amplitudes.any():
        return JointPosterior(one.hypothesis, rows.shares, count, None)
    chances = marginals(rows.slopes, prior, rows.joint).weights
    edges = chances.cumsum(axis=1)
    picks = (generator.random((DRAWN, 1)) * edges[:, -1:] > edges).sum(axis=1)
    nodes = np.minimum(picks, chances.shape[1] - 1) % prior.amplitudes.size
    ends = halfnorm.cdf(np.concatenate([[0.0], 0.5 * (NODES[1:] + NODES[:-1]), [np.inf]]))
    inside = ends[nodes] + generator.random(DRAWN) * (ends[nodes + 1] - ends[nodes])
    scale = float(prior.amplitudes[-1] / NODES[-1])
    return JointPosterior(one.hypothesis, rows.shares, count, scale * halfnorm.ppf(inside))


def amplitude_quantile(one: Scored, share: float = WIDEST) -> float:
    """Return a quantile of the amplitude's prior, as share of the mean time."""
    scale = float(one.rows.discrepancy.amplitudes[-1] / NODES[-1])
    return scale * float(halfnorm.ppf(share))


def amplitude_density(shares: Array) -> Array:
    """Return the amplitude's prior density at shares of ``amplitude_quantile`` (m,)."""
    whole = float(halfnorm.ppf(WIDEST))
    found: Array = whole * halfnorm.pdf(whole * shares)
    return found


def window_of(values: Array) -> tuple[float, float]:
    """Return the part of [0, 1] that an axis shows of shares (draws,)."""
    middle, spread = float(values.mean()), max(float(values.std()), 0.002)
    low = max(0.0, min(float(values.min()), middle - ROOM * spread))
    high = min(1.0, max(float(values.max()), middle + ROOM * spread))
    return max(low, middle - 2.0 * ROOM * spread), min(high, middle + 2.0 * ROOM * spread)


def density(values: Array, grid: Array, count: float) -> Array:
    """Estimate the density of shares (draws,) at points of a grid, mirrored at 0 and 1."""
    width = max(float(values.std()), 1e-4) * count ** (-1.0 / 5.0)
    whole = np.concatenate([values, -values, 2.0 - values])
    apart = (grid[:, None] - whole) / width
    found: Array = np.exp(-0.5 * apart**2).sum(axis=1)
    return found / (values.size * width * np.sqrt(2.0 * np.pi))


def held(x: Array, y: Array, grids: tuple[Array, Array], count: float) -> Array:
    """Compute the probability of all denser places, for each place of a grid, (rows, columns).

    ``x`` and ``y`` are shares (draws,); rows are along *y*. A region of 90 % is where it is below
    0.9.
    """
    both = np.stack([x, y])
    matrix = np.cov(both) + 1e-8 * np.eye(2)
    root = np.linalg.cholesky(matrix * count ** (-1.0 / 3.0))
    mirrored = [np.stack([a, b]) for a in (x, -x, 2.0 - x) for b in (y, -y, 2.0 - y)]
    near = np.concatenate(mirrored, axis=1)
    reach = 3.0 * np.sqrt(np.diag(matrix))[:, None]
    low = np.array([[g.min()] for g in grids]) - reach
    high = np.array([[g.max()] for g in grids]) + reach
    near = near[:, ((near > low) & (near < high)).all(axis=0)]
    places = np.stack([a.ravel() for a in np.meshgrid(*grids)])
    inverse = np.linalg.inv(root)
    here, there = inverse @ places, inverse @ near
    square = (here**2).sum(axis=0)[:, None] + (there**2).sum(axis=0) - 2.0 * here.T @ there
    dense = np.exp(-0.5 * np.maximum(square, 0.0)).sum(axis=1)
    order = np.argsort(-dense)
    found = np.empty_like(dense)
    found[order] = np.cumsum(dense[order]) / dense.sum()
    return found.reshape(len(grids[1]), len(grids[0]))
