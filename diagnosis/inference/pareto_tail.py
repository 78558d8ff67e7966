r"""Tail of importance weights: the shape of the generalised Pareto law that fits the largest.

A shape :math:`\hat k` above 0.7 says that few draws carry the sum, and that its error is larger
than it looks (Vehtari, Simpson, Gelman, Yao and Gabry, Pareto smoothed importance sampling). The
estimate is the quick one of Zhang and Stephens (2009), with the weak prior of the former.
"""

from __future__ import annotations

import math

import numpy as np

from dogshape.diagnosis.terms import Array

LEAST = 5  #: weights of a tail, at least
PRIOR, CENTRE = 10.0, 0.5  #: weights that the prior of the shape counts for, and its centre


def tail_shape(log_weights: Array) -> float:
    """Estimate the shape of the tail of weights (m,), NaN where there are too few to tell.

    The tail is the largest of them: a fifth, but at most three times the root of their number.
    """
    size = log_weights.size
    count = math.ceil(min(0.2 * size, 3.0 * math.sqrt(size)))
    if count < LEAST or count >= size:
        return math.nan
    ordered = np.sort(np.exp(log_weights - log_weights.max()))
    over: Array = ordered[-count:] - ordered[-count - 1]
    over = over[over > 0.0]
    return math.nan if over.size < LEAST else pareto_shape(over)


def pareto_shape(over: Array) -> float:
    """Estimate the shape of a generalised Pareto law from its sorted draws (m,), above zero."""
    size = over.size
    points = 30 + int(math.sqrt(size))
    quartile = over[int(size / 4.0 + 0.5) - 1]
    steps = 1.0 - np.sqrt(points / (np.arange(1, points + 1) - 0.5))
    scale = steps / 3.0 / quartile + 1.0 / over[-1]
    shape = np.log1p(-scale[:, None] * over).mean(axis=1)
    likely = size * (np.log(-scale / shape) - shape - 1.0)
    weights = np.exp(likely - likely.max())
    best = float((scale * weights).sum() / weights.sum())
    found = float(np.log1p(-best * over).mean())
    return (size * found + PRIOR * CENTRE) / (size + PRIOR)
