r"""Influence of each input: first-order and total Sobol indices.

The first-order index is the share of the variance that an input explains alone, the total one
what remains when all others are known,

.. math:: S_i = \frac{V(E(t | z_i))}{V(t)}, \qquad T_i = \frac{E(V(t | z_{\sim i}))}{V(t)}

(Sobol 2001; estimators of Saltelli et al. 2010 as SALib has them). Inputs are independent,
evenly spread over a box; on a logarithmic scale or whole numbers where they are so.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from SALib.analyze import sobol as analysis
from SALib.sample import sobol as sampling

from dogshape.surrogate.covariance import Array

SAMPLES = 2048  #: base samples, a power of two; each costs the number of inputs and two
EVEN, LOG, WHOLE = "linear", "logarithmic", "whole numbers"


@dataclass(frozen=True)
class Input:
    """An input between two values; ``scale`` is one of ``EVEN``, ``LOG``, ``WHOLE``."""

    name: str
    low: float
    high: float
    scale: str = EVEN

    def at(self, share: Array) -> Array:
        """Return the values at shares of the way from low to high, (n,)."""
        if self.scale == WHOLE:
            levels = self.high - self.low + 1.0
            return np.minimum(self.low + np.floor(share * levels), self.high)
        if self.scale == LOG:
            return self.low * (self.high / self.low) ** share
        return self.low + share * (self.high - self.low)


@dataclass(frozen=True)
class Indices:
    """Indices of inputs with the half widths of their 95 % intervals, each (d,)."""

    inputs: tuple[Input, ...]
    first: Array
    first_half: Array
    total: Array
    total_half: Array


def indices(
    inputs: Sequence[Input],
    function: Callable[[Array], Array],
    samples: int = SAMPLES,
    seed: int = 1,
) -> Indices:
    """Compute the indices of a function of inputs (n, d), (n,); ``seed`` above zero."""
    bounds = [[0.0, 1.0]] * len(inputs)
    problem = {"num_vars": len(inputs), "names": [one.name for one in inputs], "bounds": bounds}
    shares = sampling.sample(problem, samples, calc_second_order=False, seed=seed)
    values = np.column_stack([one.at(share) for one, share in zip(inputs, shares.T, strict=True)])
    results = function(values)
    if not np.ptp(results) > 0.0:
        none = np.zeros(len(inputs))
        return Indices(tuple(inputs), none, none, none, none)
    found = analysis.analyze(problem, results, calc_second_order=False, seed=seed)
    first, first_half, total, total_half = (
        np.asarray(found[key]) for key in ("S1", "S1_conf", "ST", "ST_conf")
    )
    return Indices(tuple(inputs), first, first_half, total, total_half)
