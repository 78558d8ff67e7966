r"""Likelihood of all cells together, expanded at the offsets that the data leave.

What cells err in common is integrated out with a parabola for the log likelihood of each cell over
its offset (``diagnosis.likelihood.discrepancy``). The density of a mean is a mixture, in which a
cell may be odd, so one parabola does not hold everywhere: a simulation that is off by ten widths of
the means has all cells deep in the tails, where an odd cell is the likelier explanation, and the
slopes there say nothing of the offset that explains all of them at once. So the parabola touches
the logarithm where the offset ends,

.. math:: \ln f(\delta) \approx \ln f(\delta^*) + g (\delta - \delta^*)
          - \tfrac12 h (\delta - \delta^*)^2,

with the mean :math:`\delta^* = (1 + C H)^{-1} C g` of the offsets, *C* the covariance of all that
cells err in common. The search for it begins with parts that count as if the offset could be
anything within *C*, and ends where it is known; in between it is known within ever less, so that
one odd cell, which at first pulls all others, is found to be odd. It begins once with the amplitude
on average and once with the largest. Of the two ends that with the larger likelihood of all cells
together is taken, value by value.
"""

from __future__ import annotations

from dataclasses import astuple, dataclass

import numpy as np

from dogshape.diagnosis.likelihood.cell_likelihood import Timed, timed
from dogshape.diagnosis.likelihood.cell_predictions import CellPredictions
from dogshape.diagnosis.likelihood.discrepancy import Discrepancy, Slopes, marginals
from dogshape.diagnosis.likelihood.mean_density import MeanDensity
from dogshape.diagnosis.likelihood.observations import Observed
from dogshape.diagnosis.terms import Array

#: Shares of the offsets' variance before the data that are left from step to step.
LEFT = (1.0, 0.1, 0.01)

Parabola = tuple[Array, Array, Array]  # at the offset zero: logarithm, slope, curvature downwards


def timed_together(
    seen: Observed, predicted: CellPredictions, prior: Discrepancy
) -> tuple[Timed, Array]:
    """Return log densities of each cell's times for the offsets that are likely, and what joins.

    Log densities and slopes are those of the parabolas at the offset zero. Only their sum with the
    second, (m,), what ``marginals`` says of these slopes, is a log likelihood. Where cells err in
    nothing together it is zero, and the densities are exact.
    """
    common = np.nan_to_num(predicted.common)
    if prior.absent_beside(common):
        return timed(seen, predicted), np.zeros(common.shape[1])
    found, gain = _likelier(seen, predicted, prior)
    return timed(seen, predicted, found.parts), gain


def likely_offset(seen: Observed, predicted: CellPredictions, prior: Discrepancy) -> Array:
    """Return the offset of each cell's mean that the data leave, s, (cells, m).

    Zero where cells err in nothing together.
    """
    common = np.nan_to_num(predicted.common)
    if prior.absent_beside(common):
        return np.zeros_like(common)
    return _likelier(seen, predicted, prior)[0].offset


@dataclass(frozen=True)
class _Expansion:
    """Parabolas of each cell's log density, (cells, m): where they touch it, and at no offset."""

    offset: Array
    log: Array
    first: Array
    second: Array

    @property
    def parts(self) -> Parabola:
        """Logarithm, slope and curvature at the offset zero."""
        return self.log, self.first, self.second


def _likelier(
    seen: Observed, predicted: CellPredictions, prior: Discrepancy
) -> tuple[_Expansion, Array]:
    """Return the likelier of two expansions, value by value, and what its integral adds, (m,)."""
    common = np.nan_to_num(predicted.common)
    density = MeanDensity.of(seen, predicted)
    known = (seen.n > 0)[:, None] & np.isfinite(predicted.mean)
    usual = prior.covariance
    found = _expanded(density, usual, usual, common, known)
    other = _expanded(density, prior.widest, usual, common, known)
    gain, more = (marginals(_slopes(one), prior, common.T).log for one in (found, other))
    better = other.log.sum(axis=0) + more > found.log.sum(axis=0) + gain
    both = zip(astuple(found), astuple(other), strict=True)
    return _Expansion(*(np.where(better, b, a) for a, b in both)), np.where(better, more, gain)


def _expanded(
    density: MeanDensity, first: Array, then: Array, common: Array, known: np.ndarray
) -> _Expansion:
    """Follow the offsets to where they end, with one covariance first and another one then.

    Parabolas are zero where nothing is ``known``.
    """
    variance = np.diag(first)[:, None] + common**2
    offset, covariance = np.zeros_like(variance), first
    for part in LEFT:
        slope, curvature = _of(known, *density.near(offset, part * variance))
        slopes = Slopes((slope + curvature * offset).T, curvature.T)
        offset, covariance = likely_offsets(slopes, covariance, common.T).T, then
    log, slope, curvature = _of(known, *density.at(offset))
    at_zero = slope + curvature * offset
    at_no_offset = log - offset * (at_zero - 0.5 * curvature * offset)
    return _Expansion(offset, at_no_offset, at_zero, curvature)


def _of(known: np.ndarray, *parts: Array) -> tuple[Array, ...]:
    """Set to zero what is not known."""
    return tuple(np.where(known, np.nan_to_num(part), 0.0) for part in parts)


def _slopes(found: _Expansion) -> Slopes:
    """Turn slopes and curvatures value by value."""
    return Slopes(found.first.T.copy(), found.second.T.copy())


def likely_offsets(slopes: Slopes, covariance: Array, joint: Array) -> Array:
    """Compute the mean of the offsets that the slopes leave, s, (m, cells).

    ``covariance`` is that of what cells err in common before the data, s^2, (cells, cells);
    ``joint`` (m, cells) a further error of each value, s, fully correlated.
    """
    matrix = covariance[None]
    if joint.any():
        matrix = matrix + joint[:, :, None] * joint[:, None]
    left = np.eye(len(covariance)) + matrix * slopes.second[:, None]
    found = np.linalg.solve(left, matrix @ slopes.first[..., None])
    return np.asarray(found[..., 0], float)
