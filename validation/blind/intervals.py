"""Shares and means with their intervals."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import TypedDict

import numpy as np

NORMAL = 1.959964  #: of a two-sided 95 % interval
DRAWS = 2000  #: of a bootstrap


class Interval(TypedDict):
    """Value of ``n`` cases with the ends of its 95 % interval; None where there is no case."""

    value: float | None
    low: float | None
    high: float | None
    n: int


def share(flags: Iterable[bool]) -> Interval:
    """Compute a share with Wilson's 95 % interval: ``value``, ``low``, ``high``, ``n``."""
    given = list(flags)
    n = len(given)
    if n == 0:
        return {"value": None, "low": None, "high": None, "n": 0}
    # By hand: scipy's exact quantile would change the ninth digit of records that are kept.
    p, z2 = sum(given) / n, NORMAL**2
    middle = (p + z2 / (2 * n)) / (1.0 + z2 / n)
    half = NORMAL / (1.0 + z2 / n) * math.sqrt(p * (1.0 - p) / n + z2 / (4.0 * n * n))
    return {"value": p, "low": max(0.0, middle - half), "high": min(1.0, middle + half), "n": n}


def mean(values: Iterable[float | None], seed: int = 0) -> Interval:
    """Compute a mean with a bootstrap's 95 % interval; None among the values are left out."""
    given = np.array([v for v in values if v is not None], dtype=float)
    n = len(given)
    if n == 0:
        return {"value": None, "low": None, "high": None, "n": 0}
    # By hand: scipy's bootstrap refuses a single value, and a set may have no more.
    generator = np.random.default_rng(seed)
    drawn = given[generator.integers(n, size=(DRAWS, n))].mean(axis=1)
    low, high = np.quantile(drawn, (0.025, 0.975))
    return {"value": float(given.mean()), "low": float(low), "high": float(high), "n": n}


def calibration(cases: list[list[tuple[float, bool]]], bins: int = 10, seed: int = 0) -> Interval:
    """Compute the expected calibration error of probabilities, by case, with its interval.

    Each case gives probabilities and whether each came true. The error is the mean distance of
    probability and frequency over even bins, weighted by how many fall in each; cases are
    drawn as a whole for the interval, which does not contain the value where cases are few: drawing
    anew adds chance of its own.
    """
    if not cases:
        return {"value": None, "low": None, "high": None, "n": 0}
    generator = np.random.default_rng(seed)
    drawn = [
        _error([cases[k] for k in generator.integers(len(cases), size=len(cases))], bins)
        for _ in range(DRAWS // 10)
    ]
    low, high = np.quantile(drawn, (0.025, 0.975))
    value = _error(cases, bins)
    return {"value": value, "low": float(low), "high": float(high), "n": len(cases)}


def _error(cases: list[list[tuple[float, bool]]], bins: int) -> float:
    pairs = np.array([pair for case in cases for pair in case], dtype=float)
    place = np.minimum((pairs[:, 0] * bins).astype(int), bins - 1)
    apart = np.bincount(place, pairs[:, 0] - pairs[:, 1], bins)
    return float(abs(apart).sum() / len(pairs))
