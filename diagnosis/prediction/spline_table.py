"""Tables over an even grid of shares of parameters' ranges, interpolated by splines."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from functools import cache

import numpy as np
from scipy.interpolate import BSpline, make_interp_spline
from scipy.ndimage import distance_transform_edt, maximum_filter

from dogshape.diagnosis.terms import Array

SPLINE_ERROR = 0.25  #: of a spline, over its misses with every other node only


def node_shares(sizes: Sequence[int]) -> Array:
    """List the nodes of a grid as shares, (n1 n2 ..., p)."""
    nodes = list(itertools.product(*(np.linspace(0.0, 1.0, size) for size in sizes)))
    return np.array(nodes).reshape(len(nodes), len(sizes))


def spline_weights(shares: Array, sizes: Sequence[int], degree: int) -> Array:
    """Compute the weights of a grid's nodes in a spline at shares (m, p), (m, n1 n2 ...)."""
    weights = np.ones((len(shares), 1))
    for k, size in enumerate(sizes):
        factors = _basis(size, degree)(shares[:, k])
        weights = (weights[:, :, None] * factors[:, None, :]).reshape(len(shares), -1)
    return weights


@cache
def _basis(size: int, degree: int) -> BSpline:
    """Build the cardinal splines of ``size`` even nodes from 0 to 1."""
    nodes = np.linspace(0.0, 1.0, size)
    return make_interp_spline(nodes, np.eye(size), k=min(degree, size - 1))


def fill_missing(rows: Array, sizes: Sequence[int]) -> Array:
    """Fill rows of a grid that are NaN, (n1 n2 ..., K), with the nearest; zeros if all are NaN."""
    table = rows.reshape(*sizes, -1)
    is_missing = np.isnan(table[..., 0])
    if is_missing.all():
        return np.zeros_like(rows)
    if is_missing.any():
        nearest = distance_transform_edt(is_missing, return_distances=False, return_indices=True)
        table = table[tuple(nearest)]
    return np.asarray(table.reshape(rows.shape))


def spline_error(rows: Array, sizes: Sequence[int]) -> Array:
    """Estimate the error of a spline through rows (n1 n2 ..., K), the same shape.

    By the misses of a spline through every other node, at each node and its neighbours.
    """
    table = rows.reshape(*sizes, -1)
    coarse_nodes = table[tuple(slice(None, None, 2) for _ in sizes)]
    coarse_rows = coarse_nodes.reshape(-1, table.shape[-1])
    weights = spline_weights(node_shares(sizes), coarse_nodes.shape[:-1], degree=3)
    miss = abs((weights @ coarse_rows).reshape(table.shape) - table)
    neighbours = (*(3 for _ in sizes), 1)
    error = SPLINE_ERROR * maximum_filter(miss, size=neighbours, mode="nearest")
    return np.asarray(error.reshape(rows.shape))
