"""Moments of shift times at even relative angles that count by weights.

The times also part into two modes where the variance within both is least (Otsu 1979, IEEE Trans.
Syst. Man Cybern. 9). Compiled: a diagnosis weighs the angles of a million means.
"""

# mypy: disable-error-code="no-untyped-def"

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from dogshape.diagnosis.terms import Array
from dogshape.sim.kernel import compiled

TINY = 1e-9  #: least sum of weights to divide by


class Moments(NamedTuple):
    """Moments under m weightings at C operating points, (m, C) each."""

    mean: Array  #: of timely shifts, s
    square: Array  #: variance of these, s^2
    late: Array  #: share of late shifts among those that engage
    engaged: Array  #: share that engages
    angles: Array  #: number of even angles that tell as much
    minor: Array  #: share of the smaller mode
    main: Array  #: mean of the larger mode, s
    narrow: Array  #: variance of the larger mode, s^2


def moments_of(times: Array, kept: np.ndarray, late: np.ndarray, weights: Array) -> Moments:
    """Compute moments of ascending times (C, n), of which some are timely and some late.

    ``weights`` are (m, C, n).
    """
    found = np.empty((*weights.shape[:2], len(Moments._fields)))
    _fill(times, kept, late, np.ascontiguousarray(weights), found)
    return Moments(*np.moveaxis(found, -1, 0))


@compiled
def _fill(times, kept, late, weights, found):
    for row in range(weights.shape[0]):
        for cell in range(weights.shape[1]):
            own = weights[row, cell], times[cell], kept[cell]
            _weigh(*own, late[cell], found[row, cell])
            _part(*own, found[row, cell])


@compiled
def _weigh(weights, times, kept, late, out):
    """Compute moments and number of angles."""
    every = squares = whole = first = behind = second = 0.0
    for k in range(len(times)):
        every += weights[k]
        squares += weights[k] * weights[k]
        behind += weights[k] * late[k]
        if kept[k]:
            whole += weights[k]
            first += weights[k] * times[k]
    mean, engaged = first / max(whole, TINY), whole + behind
    for k in range(len(times)):
        if kept[k]:
            second += weights[k] * (times[k] - mean) ** 2
    out[0], out[1] = mean, second / max(whole, TINY)
    out[2], out[3] = behind / max(engaged, TINY), engaged / every
    out[4], out[5] = every * every / squares, whole


@compiled
def _part(weights, times, kept, out):
    """Compute the modes; ``out`` has mean, variance and weight of all."""
    mean, whole = out[0], out[5]
    # Sums of the lower mode about the mean of all.
    share = moved = spread = below = first = second = most = 0.0
    for k in range(len(times)):
        if kept[k]:
            apart = times[k] - mean
            below += weights[k]
            first += weights[k] * apart
            second += weights[k] * apart * apart
            between = first * first * (1.0 / max(below, TINY) + 1.0 / max(whole - below, TINY))
            if between > most:
                most, share, moved, spread = between, below, first, second
    if share < 0.5 * whole:
        share, moved, spread = whole - share, -moved, out[1] * whole - spread
    share = max(share, TINY)
    out[5] = max(1.0 - share / max(whole, TINY), 0.0)
    out[6], out[7] = mean + moved / share, max(spread / share - (moved / share) ** 2, 0.0)
