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
from dogshape.surrogate.model import NORMAL_95, Surrogate

MAX_INTERVALS = 12  #: of each variable


@dataclass(frozen=True)
class MainEffect:
    """Main effect of a variable on the expected time, s, with mean zero over the designs."""

    variable: str
    values: Array  #: of the variable, edge units, (k,)
    effect: Array  #: (k,)
    low: Array  #: bound of 95 % at each value, (k,)
    high: Array


def main_effects(surrogate: Surrogate, variables: Sequence[str], x: Array) -> list[MainEffect]:
    """Compute the main effect of each variable that varies over designs (n, d) in edge units."""
    effects = []
    for column in np.flatnonzero(np.ptp(x, axis=0) > 0.0).tolist():
        values, designs, form = accumulate(x, column)
        times, covariance = surrogate.predict_jointly(designs)
        effect = form @ times
        variances = np.diag(form @ covariance @ form.T)
        half_width = NORMAL_95 * np.sqrt(np.maximum(variances, 0.0))
        effects.append(
            MainEffect(
                variable=variables[column],
                values=values,
                effect=effect,
                low=effect - half_width,
                high=effect + half_width,
            )
        )
    return effects


def accumulate(x: Array, column: int) -> tuple[Array, Array, Array]:
    """Move designs (n, d) to the ends of their interval of a column.

    Returns the ends of all intervals, (k,), the moved designs, (2 n, d), and a matrix, (k, 2 n):
    its product with the times of the moved designs is the main effect.
    """
    settings = x[:, column]
    levels = np.linspace(0.0, 1.0, MAX_INTERVALS + 1)
    ends: Array = np.unique(np.quantile(settings, levels, method="inverted_cdf"))
    interval = np.clip(np.searchsorted(ends, settings) - 1, 0, len(ends) - 2)
    lower = x.copy()
    lower[:, column] = ends[interval]
    upper = x.copy()
    upper[:, column] = ends[interval + 1]
    counts = np.bincount(interval, minlength=len(ends) - 1)
    steps = np.zeros((len(ends) - 1, len(interval)))
    steps[interval, np.arange(len(interval))] = 1.0 / counts[interval]
    form = np.concatenate([np.zeros((1, len(interval))), np.cumsum(steps, axis=0)])
    form -= counts / counts.sum() @ (0.5 * (form[1:] + form[:-1]))
    return ends, np.concatenate([lower, upper]), np.concatenate([-form, form], axis=1)
