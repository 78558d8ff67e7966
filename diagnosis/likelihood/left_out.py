r"""Likelihood without one operating point at a time, for all of them at once.

Given a member of the discrepancy (``diagnosis.likelihood.discrepancy``), the offsets of all cells
are normal after the data, cell *k* with the mean :math:`\beta` and the variance :math:`\alpha`.
With its slope *g* and curvature *h* the data of the cell are taken off again,

.. math:: v^T (1 + M)^{-1} v \to \ldots - 2 g \beta + g^2 \alpha
          + \frac{h (\beta - g \alpha)^2}{1 - h \alpha}, \qquad
          \ln |1 + M| \to \ldots + \ln (1 - h \alpha),

and the offset of the cell, as the other cells tell it, has the mean
:math:`(\beta - g \alpha) / (1 - h \alpha)` and the variance :math:`\alpha / (1 - h \alpha)`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dogshape.diagnosis.likelihood.discrepancy import Discrepancy, Slopes, curvatures
from dogshape.diagnosis.likelihood.scores import Rows
from dogshape.diagnosis.likelihood.time_parts import log_sum
from dogshape.diagnosis.terms import Array


@dataclass(frozen=True)
class LeftOut:
    """Discrepancy of each value without each cell, for each member, (m, cells, members).

    Parameters
    ----------
    log_weight : logarithm of prior and marginal likelihood of a member.
    mean, variance : of the cell's offset, as the other cells tell it, s and s^2.
    """

    log_weight: Array
    mean: Array
    variance: Array

    @property
    def log(self) -> Array:
        """Change of the log likelihood of the other cells by the discrepancy, (m, cells)."""
        return log_sum(self.log_weight, axis=2)


def left_out(slopes: Slopes, prior: Discrepancy, joint: Array) -> LeftOut:
    """Integrate the discrepancy out without each cell.

    ``joint`` (m, cells) is a further error, s, normal and fully correlated, of each value. What
    else the cells err in together (``Discrepancy.beside``) is integrated out likewise.
    """
    beside = joint[..., None]  # columns of further errors with normal coefficients
    if prior.beside is not None:
        shared = np.broadcast_to(prior.beside, (len(joint), *prior.beside.shape))
        beside = np.concatenate([beside, shared], axis=2)
    first, second = slopes.first, slopes.second
    bent = second[..., None] * beside
    across = np.swapaxes(beside, 1, 2)
    whole = np.eye(beside.shape[2]) + across @ bent
    pulled = np.linalg.solve(whole, across @ first[..., None])
    taken = (across @ first[..., None] * pulled).sum(axis=(1, 2))
    spread = 0.5 * np.linalg.slogdet(whole)[1]
    mean = (beside @ pulled)[..., 0]
    variance = (beside * np.swapaxes(np.linalg.solve(whole, across), 1, 2)).sum(axis=2)
    left = first - (bent @ pulled)[..., 0]
    scales = prior.amplitudes**2
    squares, spreads, means, variances = [], [], [], []
    for root in prior.narrow_roots:
        over = np.swapaxes(bent, 1, 2) @ root
        held = np.linalg.solve(whole, over)
        matrix = np.moveaxis(curvatures(root, second), -1, 0) - np.swapaxes(over, 1, 2) @ held
        values, vectors = np.linalg.eigh(matrix)
        gain = 1.0 + scales[:, None] * np.maximum(values, 0.0)[:, None]
        shrunk = np.swapaxes(scales[:, None] / gain, 1, 2)  # (m, r, amplitudes)
        parts = np.swapaxes(vectors, 1, 2) @ (left @ root)[..., None]
        axes = (root - beside @ held) @ vectors
        squares.append((shrunk * parts**2).sum(axis=1) + taken[:, None])
        spreads.append(0.5 * np.log(gain).sum(axis=2) + spread[:, None])
        means.append(axes @ (shrunk * parts) + mean[..., None])
        variances.append(axes**2 @ shrunk + variance[..., None])
    join = np.concatenate
    return _downdated(
        prior, slopes, (join(squares, 1), join(spreads, 1)), (join(means, 2), join(variances, 2))
    )


def _downdated(
    prior: Discrepancy, slopes: Slopes, whole: tuple[Array, Array], after: tuple[Array, Array]
) -> LeftOut:
    """Take each cell's slope and curvature off squares and spread, (m, members) each.

    ``after`` are mean and variance of the cells' offsets given all cells, (m, cells, members).
    """
    first, second = slopes.first[..., None], slopes.second[..., None]
    mean, variance = after
    kept = np.maximum(1.0 - second * variance, 1e-12)
    apart = mean - first * variance
    square = whole[0][:, None] - 2.0 * first * mean + first**2 * variance + second * apart**2 / kept
    log = prior.log_prior + 0.5 * square - whole[1][:, None] - 0.5 * np.log(kept)
    return LeftOut(log, apart / kept, variance / kept)


def totals_without(rows: Rows) -> Array:
    """Compute the log likelihood of all cells but each, together, (m, cells)."""
    alone: Array = rows.log_likelihood.sum(axis=1)[:, None] - rows.log_likelihood
    if rows.discrepancy.absent_beside(rows.joint):
        return alone
    return alone + left_out(rows.slopes, rows.discrepancy, rows.joint).log
