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


def _elementwise(
    scalar_function: Callable[[float], float], array_function: Any
) -> Callable[[float], float]:
    def function(x: float) -> float:
        return array_function(x) if isinstance(x, ARRAY) else scalar_function(x)

    return function


tan = _elementwise(math.tan, np.tan)
cos = _elementwise(math.cos, np.cos)
arctan = _elementwise(math.atan, np.arctan)
log = _elementwise(math.log, np.log)
sqrt = _elementwise(math.sqrt, np.sqrt)


def hypot(x: float, y: float) -> float:
    """Compute ``sqrt(x**2 + y**2)``."""
    return np.hypot(x, y) if _hold_array((x, y)) else math.hypot(x, y)


def largest(*values: float) -> float:
    """Return the largest of ``values``, element by element."""
    return reduce(np.maximum, values) if _hold_array(values) else max(values)


def smallest(*values: float) -> float:
    """Return the smallest of ``values``, element by element."""
    return reduce(np.minimum, values) if _hold_array(values) else min(values)


def where(condition: bool, true_value: Value, false_value: Value) -> Value:
    """Select ``true_value`` if ``condition`` holds, else ``false_value``."""
    if isinstance(condition, ARRAY):
        return np.where(condition, true_value, false_value)  # type: ignore[return-value]
    return true_value if condition else false_value


def map_elements(function: Callable[..., float], *values: float) -> float:
    """Apply a function of numbers to numbers or arrays (n,); equal elements share one call."""
    if not _hold_array(values):
        return function(*values)
    columns = [column.tolist() for column in np.broadcast_arrays(*values)]
    rows = [*zip(*columns, strict=True)]
    results = {row: function(*row) for row in dict.fromkeys(rows)}
    array: Any = np.array([results[row] for row in rows])
    return array


def hashable(value: float) -> Hashable:
    """Return a key by which numbers and arrays compare equal; an array becomes its bytes."""
    return value.tobytes() if isinstance(value, ARRAY) else value


def bisect(
    holds: Callable[[float], bool], low: float, high: float, *, width: float = 0.0, share: float = 0
) -> tuple[float, float]:
    """Bisect for the end of a condition that holds from ``low`` on.

    Returns an interval around that end, at most ``width`` or ``share`` times its upper end wide;
    by default two neighbouring floats.
    """
    while high - low > max(width, share * high):
        middle = 0.5 * (low + high)
        if not low < middle < high:
            break
        if holds(middle):
            low = middle
        else:
            high = middle
    return low, high


def empirical_distribution(values: Any, weights: Any) -> tuple[Any, Any]:
    """Return cumulative probabilities (n,) and sorted values (n,); ``weights`` sum to one.

    The probability of a value is that below the middle of its weight.
    """
    order = np.argsort(values, kind="stable")
    sorted_weights = weights[order]
    return np.cumsum(sorted_weights) - 0.5 * sorted_weights, values[order]


def _hold_array(values: tuple[Any, ...]) -> bool:
    """Decide whether one of the values is an array."""
    return ARRAY in map(type, values)
