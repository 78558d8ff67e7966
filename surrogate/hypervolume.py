r"""Expected gain of hypervolume by a candidate, by random scales.

For a reference point *r* beyond all designs and a direction :math:`\lambda` of positive
coordinates, the scale of values *y* (all to be minimised) is

.. math:: s_\lambda(y) = \min_i \left(\max(0, r_i - y_i) / \lambda_i\right)^k

and the mean over directions of the largest scale among designs is their hypervolume but for a
constant (Deng and Zhang 2019; Golovin and Zhang 2020). The gain by a candidate is its mean gain in
the largest scale. Values of candidates and designs are drawn jointly, so that shared errors cancel.
"""

from __future__ import annotations

import math

import numpy as np

from dogshape.surrogate.covariance import Array, Mask


def directions(rng: np.random.Generator, count: int, objectives: int) -> Array:
    """Return directions with positive coordinates, evenly over the sphere, (count, k)."""
    drawn = np.abs(rng.standard_normal((count, objectives)))
    directions: Array = drawn / np.linalg.norm(drawn, axis=1, keepdims=True)
    return np.maximum(directions, 1e-6)


def scales(values: Array, reference: Array, ways: Array) -> Array:
    """Return the scale of values (s, m, k) in each of the directions (w, k), (s, m, w).

    ``reference`` (k,) is the point beyond which nothing counts.
    """
    gain = np.maximum(reference - values, 0.0)
    least = np.full((*values.shape[:2], len(ways)), np.inf)
    for k in range(values.shape[2]):
        np.minimum(least, gain[:, :, k, None] / ways[:, k], out=least)
    return least ** values.shape[2]


def added(candidates: Array, front: Array, reference: Array, ways: Array) -> Array:
    """Compute the hypervolume that each candidate adds to a front, mean over draws, (m,).

    Parameters
    ----------
    candidates : drawn values, (s, m, k).
    front : drawn values of the designs that are there, (s, f, k).
    reference : (k,).
    ways : directions, (w, k).
    """
    own = scales(candidates, reference, ways)
    if front.shape[1]:
        best = scales(front, reference, ways).max(axis=1)
        own = np.maximum(own - best[:, None, :], 0.0)
    return own.mean(axis=(0, 2)) * volume_of(candidates.shape[2])


def hypervolume(values: Array, reference: Array) -> float:
    """Return the volume that rows (n, k), to be minimised, dominate below a reference (k,).

    By slices: between two values of the last objective the dominated region is that of the rows
    below, one objective fewer.
    """
    inside = values[(values < reference).all(axis=1)]
    if not len(inside):
        return 0.0
    if len(reference) == 1:
        return float(reference[0] - inside.min())
    inside = inside[np.argsort(inside[:, -1], kind="stable")]
    depths = np.diff(inside[:, -1], append=reference[-1])
    return sum(
        float(depth) * hypervolume(inside[: n + 1, :-1], reference[:-1])
        for n, depth in enumerate(depths)
        if depth > 0.0
    )


def volume_of(objectives: int) -> float:
    """Return the volume of the part of the unit ball with positive coordinates."""
    k = objectives
    return float(math.pi ** (k / 2) / (2**k * math.gamma(k / 2 + 1)))


def not_dominated(values: Array) -> Mask:
    """Mark the rows (..., n, k), all to be minimised, that no row dominates, (..., n)."""
    one, other = values[..., :, None, :], values[..., None, :, :]
    better, strictly = np.all(one <= other, axis=-1), np.any(one < other, axis=-1)
    return np.logical_not(np.any(better & strictly, axis=-2)).astype(bool)
