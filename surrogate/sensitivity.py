r"""Sensitivity of the expected time: main effects with bands.

Designs that pass every check are correlated, so effects are accumulated locally (Apley and Zhu
2020). A variable is cut at quantiles :math:`z_0 < \dots < z_K`, each design moved to both ends of
its interval, and the mean differences added up,

.. math:: g(z_k) = \sum_{l \le k} \frac{1}{n_l} \sum_{i \in l}
   \left( E(z_l, x_i) - E(z_{l-1}, x_i) \right) - c,

with mean zero over the designs. It is linear in the times of the moved designs, so the band follows
from their joint covariance, that of the smooth part.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dogshape.sim.elementwise import Array
from dogshape.surrogate.model import Surrogate

INTERVALS = 12  #: of each variable, at most


@dataclass(frozen=True)
class Effect:
    """Main effect of a variable on the expected time, s, with mean zero over the designs."""

    variable: str
    values: Array  #: edge units, (k,)
    effect: Array  #: (k,)
    low: Array  #: bound of 95 % at each value, (k,)
    high: Array


def effects(surrogate: Surrogate, variables: Sequence[str], x: Array) -> list[Effect]:
    """Return the main effect of each variable that varies over designs (n, d) in edge units."""
    found = []
    for column in np.flatnonzero(np.ptp(x, axis=0) > 0.0).tolist():
        values, moved, form = accumulate(x, column)
        times, covariance = surrogate.joint(moved)
        effect, errors = form @ times, form @ covariance @ form.T
        half = 1.96 * np.sqrt(np.maximum(np.diag(errors), 0.0))
        found.append(Effect(variables[column], values, effect, effect - half, effect + half))
    return found


def accumulate(x: Array, column: int) -> tuple[Array, Array, Array]:
    """Cut a column of designs (n, d) into intervals and move each design to the ends of its own.

    Give the ends, (k,), the moved designs, (2 n, d), and the form, (k, 2 n): the product of form
    and times of the moved designs is the effect.
    """
    given, shares = x[:, column], np.linspace(0.0, 1.0, INTERVALS + 1)
    values: Array = np.unique(np.quantile(given, shares, method="inverted_cdf"))
    place = np.clip(np.searchsorted(values, given) - 1, 0, len(values) - 2)
    below, above = x.copy(), x.copy()
    below[:, column], above[:, column] = values[place], values[place + 1]
    counts = np.bincount(place, minlength=len(values) - 1)
    steps = np.zeros((len(values) - 1, len(place)))
    steps[place, np.arange(len(place))] = 1.0 / counts[place]
    added = np.concatenate([np.zeros((1, len(place))), np.cumsum(steps, axis=0)])
    added -= counts / counts.sum() @ (0.5 * (added[1:] + added[:-1]))
    return values, np.concatenate([below, above]), np.concatenate([-added, added], axis=1)
