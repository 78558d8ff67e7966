"""Parameters with their intervals, and what an effect is at most."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dogshape.diagnosis.likelihood.scores import Scored
from dogshape.diagnosis.likelihood.signature import VISIBLE, Metric, squared
from dogshape.diagnosis.prediction.hypotheses import NONE
from dogshape.diagnosis.terms import Array

INSIDE = 0.9  #: probability of an interval


@dataclass(frozen=True)
class Interval:
    """Mean and central 90 % interval of a parameter, in its unit."""

    mean: float
    low: float
    high: float

    def as_dict(self) -> dict[str, float]:
        """Return the record of the contract."""
        return {"mean": self.mean, "low": self.low, "high": self.high}


@dataclass(frozen=True)
class Bound:
    """Values of an effect's first parameter that the data leave, with 95 %.

    ``informed`` is False where the data see nothing of the effect: then the range is the prior's.
    """

    parameter: str
    low: float
    high: float
    informed: bool

    def as_dict(self) -> dict[str, float | str | bool]:
        """Return a flat record."""
        ends = {"low": self.low, "high": self.high}
        return {"parameter": self.parameter, **ends, "informed": self.informed}


def quantiles(values: Array, weights: Array, shares: Sequence[float]) -> list[float]:
    """Return weighted quantiles of values (m,)."""
    # numpy's weighted quantiles do not interpolate: an end would jump from row to row.
    order = np.argsort(values)
    below = np.cumsum(weights[order]) - 0.5 * weights[order]
    return [float(np.interp(share, below, values[order])) for share in shares]


def intervals(found: Scored) -> dict[str, Interval]:
    """Return the parameters of a hypothesis by name."""
    values, weights = found.space.values(found.rows.shares), found.weights()
    tail = 0.5 * (1.0 - INSIDE)
    return {
        parameter.name: Interval(
            float(weights @ values[:, k]), *quantiles(values[:, k], weights, (tail, 1.0 - tail))
        )
        for k, parameter in enumerate(found.space.parameters)
    }


def bounds(scored: Sequence[Scored], metric: Metric, visible: float = VISIBLE) -> dict[str, Bound]:
    """Return the bound of each effect on its own; one without parameters has none."""
    baseline = next(one for one in scored if one.hypothesis == NONE).rows.predicted
    nothing = metric.of(baseline)
    found = {}
    for one in scored:
        if len(one.hypothesis) == 1 and one.space.parameters:
            seen = squared(metric.of(one.rows.predicted), nothing)[:, 0] >= visible
            found[one.hypothesis[0]] = _bound(one, bool(seen.any()))
    return found


def _bound(one: Scored, informed: bool) -> Bound:
    parameter = one.space.parameters[0]
    if not informed:
        return Bound(parameter.name, parameter.low, parameter.high, False)
    values, weights = one.space.values(one.rows.shares)[:, 0], one.weights()
    neutral = parameter.neutral_of(one.space.setting)
    one_sided = neutral <= parameter.low
    low, high = quantiles(values, weights, (0.0, 0.95) if one_sided else (0.025, 0.975))
    return Bound(parameter.name, min(low, neutral) if one_sided else low, high, True)
