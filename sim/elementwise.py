"""Functions of one number, or of arrays element by element, and of the order of numbers.

Closed forms are written once in these and serve one design and many; ``math`` takes a tenth of the
time of an array of one element. Annotations are those of one design.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable
from functools import reduce
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
ARRAY: Any = np.ndarray
Value = TypeVar("Value", float, str)


def _elementwise(one: Callable[[float], float], many: Any) -> Callable[[float], float]:
    def applied(x: float) -> float:
        return many(x) if isinstance(x, ARRAY) else one(x)

    return applied


tan = _elementwise(math.tan, np.tan)
cos = _elementwise(math.cos, np.cos)
arctan = _elementwise(math.atan, np.arctan)
log = _elementwise(math.log, np.log)
sqrt = _elementwise(math.sqrt, np.sqrt)


def hypot(x: float, y: float) -> float:
    """Compute the root of the sum of squares."""
    return np.hypot(x, y) if _hold_array((x, y)) else math.hypot(x, y)


def largest(*values: float) -> float:
    """Select the largest of some values."""
    return reduce(np.maximum, values) if _hold_array(values) else max(values)


def smallest(*values: float) -> float:
    """Select the smallest of some values."""
    return reduce(np.minimum, values) if _hold_array(values) else min(values)


def where(condition: bool, one: Value, other: Value) -> Value:
    """Select ``one`` where a condition holds, else ``other``."""
    if isinstance(condition, ARRAY):
        return np.where(condition, one, other)  # type: ignore[return-value]
    return one if condition else other


def each(function: Callable[..., float], *values: float) -> float:
    """Apply a function of numbers to numbers, or once to equal elements of arrays (n,)."""
    if _hold_array(values):
        rows = [*zip(*(one.tolist() for one in np.broadcast_arrays(*values)), strict=True)]
        found = {row: function(*row) for row in dict.fromkeys(rows)}
        every: Any = np.array([found[row] for row in rows])
        return every
    return function(*values)


def key(value: float) -> Hashable:
    """Return a value to compare by: an array's is made of its elements."""
    return value.tobytes() if isinstance(value, ARRAY) else value


def bisect(
    holds: Callable[[float], bool], low: float, high: float, *, width: float = 0.0, share: float = 0
) -> tuple[float, float]:
    """Bisect to where a condition that holds from ``low`` on ends: last and first place beside it.

    They are ``width``, or a ``share`` of the place, apart at most, by default neighbours.
    """
    while low < (middle := 0.5 * (low + high)) < high and high - low > max(width, share * high):
        low, high = (middle, high) if holds(middle) else (low, middle)
    return low, high


def by_weight(values: Any, weights: Any) -> tuple[Any, Any]:
    """Sort values (n,); beside them the weights below the middle of each, of a sum of one."""
    order = np.argsort(values, kind="stable")
    return np.cumsum(weights[order]) - 0.5 * weights[order], values[order]


def _hold_array(values: tuple[Any, ...]) -> bool:
    return ARRAY in map(type, values)
