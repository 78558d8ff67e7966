r"""Errors of the simulation that operating points have in common.

A contact law that lets dogs pass each other too slowly does so at every force of a mismatch, and
much alike at the next. Cell *k* is then off by :math:`(A z)_k`, with *z* standard normal and

.. math:: (A A^T)_{kl} = s^2 \bar t_k \bar t_l\, e^{-d_{kl}^2 / 2 \ell^2},

:math:`\bar t` the baseline's mean times, *d* the distance of the logarithms of the mismatches and
*s* a share of the time. Integrated out: with slopes *g* and curvatures *H* of the cells' log
likelihoods over an offset,

.. math:: \ln \int e^{g^T A z - z^T A^T H A z / 2} N(z; 0, 1) dz
          = \tfrac12 v^T (1 + M)^{-1} v - \tfrac12 \ln |1 + M|, \quad
          v = A^T g, \; M = A^T H A,

exact where the times of the cells are normal.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dogshape.diagnosis.terms import Array, Table
from dogshape.sim.units import RPM

LENGTH = 1.0  #: of the errors, in units of the natural logarithm of the mismatch
JITTER = 1e-9


@dataclass(frozen=True)
class Slopes(Table):
    """Slopes of cells' log likelihoods (m, cells) over an offset of the prediction.

    ``first`` is the derivative, 1/s, ``second`` the curvature downwards, 1/s^2, not negative.
    """

    first: Array
    second: Array


def common_errors(mismatch: Array, baseline: Array, share: float) -> Array:
    """Return *A*, s, (cells, r).

    Parameters
    ----------
    mismatch : rad/s, (cells,).
    baseline : mean times without any effect, s, (cells,); NaN where there is none.
    share : standard deviation as share of a mean time.
    """
    slips = np.log(abs(mismatch) + RPM)
    levels, place = np.unique(slips, return_inverse=True)
    apart = (levels[:, None] - levels[None]) / LENGTH
    root = np.linalg.cholesky(np.exp(-0.5 * apart**2) + JITTER * np.eye(levels.size))
    return share * np.nan_to_num(baseline)[:, None] * root[place]


def shared_errors(common: Array, joint: Array) -> Array:
    """Return errors that cells have in common, for any value (cells, r) and for each (m, cells).

    The result is (m, cells, r + 1), or (1, cells, r) where no value has any of its own.
    """
    if not joint.any():
        return common[None]
    every = np.broadcast_to(common, (len(joint), *common.shape))
    return np.concatenate([every, joint[..., None]], axis=2)


def log_common(slopes: Slopes, common: Array) -> Array:
    """Compute the change of the log likelihood by common errors (m or 1, cells, r), (m,)."""
    if not common.any():
        return np.zeros(len(slopes.first))
    squares, spread = _solved(slopes, common)
    return 0.5 * squares - spread


def explained(slopes: Slopes, common: Array) -> Array:
    """Compute the squared scores that common errors (m or 1, cells, r) explain, (m,).

    A score is the slope over the root of the curvature.
    """
    return _solved(slopes, common)[0]


def _solved(slopes: Slopes, common: Array) -> tuple[Array, Array]:
    r"""Return :math:`v^T (1 + M)^{-1} v` and :math:`\tfrac12 \ln |1 + M|`, (m,) each."""
    pull = (slopes.first[:, None] @ common)[:, 0]
    matrix = np.swapaxes(common, 1, 2) @ (slopes.second[:, :, None] * common)
    root = np.linalg.cholesky(matrix + np.eye(common.shape[2]))
    scaled = np.linalg.solve(root, pull[..., None])[..., 0]
    return (scaled**2).sum(axis=1), np.log(np.diagonal(root, axis1=1, axis2=2)).sum(axis=1)
