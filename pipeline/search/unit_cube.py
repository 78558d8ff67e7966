"""Optuna's search spaces as points of a unit cube, and back.

A number has one coordinate from 0 to 1 over its range (of its logarithm where it says so), a
category one for each of its choices, of which one is 1.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import product
from typing import Any

import numpy as np
from optuna.distributions import (
    BaseDistribution,
    CategoricalDistribution,
    FloatDistribution,
    IntDistribution,
)

from dogshape.surrogate.covariance import Array

Number = FloatDistribution | IntDistribution


class Space:
    """A search space, its parameters in the order of their names."""

    def __init__(self, distributions: Mapping[str, BaseDistribution]) -> None:
        self.distributions = dict(sorted(distributions.items()))

    def coordinates(self, params: Sequence[Mapping[str, Any]]) -> Array:
        """Return points of the unit cube for parameters, (m, c)."""
        rows = [
            [one for name, known in self.distributions.items() for one in _place(known, row[name])]
            for row in params
        ]
        return np.array(rows, dtype=float).reshape(len(params), self.size)

    @property
    def size(self) -> int:
        """Number of coordinates."""
        return sum(
            len(d.choices) if isinstance(d, CategoricalDistribution) else 1
            for d in self.distributions.values()
        )

    def holds(self, params: Mapping[str, Any]) -> bool:
        """Check whether parameters are of this space and within its ranges."""
        return all(
            name in params and known._contains(known.to_internal_repr(params[name]))
            for name, known in self.distributions.items()
        )

    def key(self, params: Mapping[str, Any]) -> tuple[float, ...]:
        """Return a hashable key of parameters; equal ones have equal keys."""
        return tuple(d.to_internal_repr(params[name]) for name, d in self.distributions.items())

    def every(self, most: int) -> list[dict[str, Any]] | None:
        """List all parameters there are; None where they are more than ``most``."""
        values = [_values(known, most) for known in self.distributions.values()]
        if math.prod(math.inf if some is None else len(some) for some in values) > most:
            return None
        names = list(self.distributions)
        return [
            dict(zip(names, one, strict=True)) for one in product(*(some or [] for some in values))
        ]

    def drawn(self, rng: np.random.Generator, near: Mapping[str, Any] | None = None) -> Any:
        """Draw parameters: evenly, or normal about some with a deviation of 8 % of the range."""
        return {
            name: _drawn(known, rng, None if near is None else near[name])
            for name, known in self.distributions.items()
        }


STEP = 0.08  #: of the range, standard deviation of a draw near a point


def _place(known: BaseDistribution, value: Any) -> list[float]:
    if isinstance(known, CategoricalDistribution):
        return [float(value == choice) for choice in known.choices]
    assert isinstance(known, FloatDistribution | IntDistribution)
    return [_unit(known, value)]


def _drawn(known: BaseDistribution, rng: np.random.Generator, near: Any) -> Any:
    if isinstance(known, CategoricalDistribution):
        kept = near is not None and rng.random() > STEP * len(known.choices)
        return near if kept else known.choices[rng.integers(len(known.choices))]
    assert isinstance(known, FloatDistribution | IntDistribution)
    unit = rng.random() if near is None else _unit(known, near) + rng.normal(0.0, STEP)
    low, high = _ends(known)
    value = low + min(max(float(unit), 0.0), 1.0) * (high - low)
    return _stepped(known, float(np.exp(value)) if known.log else value)


def _values(known: BaseDistribution, most: int) -> list[Any] | None:
    """Return the values that a parameter may have; None where they are more than ``most``."""
    if isinstance(known, CategoricalDistribution):
        return list(known.choices)
    assert isinstance(known, FloatDistribution | IntDistribution)
    if known.single():
        return [known.low]
    step = known.step
    if step is None or (known.high - known.low) / step >= most:
        return None
    count = round((known.high - known.low) / step) + 1
    return [_stepped(known, known.low + k * step) for k in range(count)]


def _ends(known: Number) -> tuple[float, float]:
    """Return the ends of the scale, half a step beyond the range where there are steps."""
    half = 0.5 * known.step if known.step is not None else 0.0
    low, high = known.low - half, known.high + half
    return (float(np.log(low)), float(np.log(high))) if known.log else (low, high)


def _unit(known: Number, value: float) -> float:
    low, high = _ends(known)
    scaled = float(np.log(value)) if known.log else float(value)
    return (scaled - low) / (high - low) if high > low else 0.5


def _stepped(known: Number, value: float) -> float:
    if known.step is not None:
        value = known.low + round((value - known.low) / known.step) * known.step
    value = min(max(value, known.low), known.high)
    return round(value) if isinstance(known, IntDistribution) else value
