"""Expected times along a line: of many designs over a mix, or at single operating points."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dogshape.surrogate.covariance import Array
from dogshape.surrogate.expected_time import Over
from dogshape.surrogate.model import Surrogate, interval

CHUNK = 1000  #: inputs that are worked out at a time


@dataclass(frozen=True)
class Curve:
    """Expected times with their 95 % interval, each (m,), s."""

    time: Array
    low: Array
    high: Array


def over_designs(over: Over, x: Array, *, alone: bool = True) -> Curve:
    """Return the curve of designs (m, d) in edge units over a mix; ``alone`` as for ``Over``."""
    time, error = over.predict(x, alone=alone)
    return Curve(time, *interval(time, error))


def at_points(surrogate: Surrogate, x: Array, points: Array, retry: float) -> Curve:
    """Return the curve of designs (m, d) in edge units, each at its operating point (m, 2).

    Points are in 1/min and N; ``retry`` is what a shift that does not engage costs, s.
    """
    inputs = surrogate.inputs(x, points)
    mean, variance = surrogate.times.predict(inputs)
    engaged = np.exp(mean + 0.5 * variance)
    share, unsure = surrogate.share.at(inputs)
    time = engaged + (1.0 - share) / share * retry
    error = np.sqrt(engaged**2 * np.expm1(variance) + unsure / share**4 * retry**2)
    return Curve(time, *interval(time, error))


def times_at(surrogate: Surrogate, x: Array, points: Array, retry: float) -> Array:
    """Return the times alone of designs (m, d) at operating points (m, 2), (m,), s; faster."""
    inputs = surrogate.inputs(x, points)
    found = []
    for some in (inputs[k : k + CHUNK] for k in range(0, len(x), CHUNK)):
        share = surrogate.share.at(some)[0]
        found.append(np.exp(surrogate.times.mean(some)) + (1.0 - share) / share * retry)
    return np.concatenate(found)
