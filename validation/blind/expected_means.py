"""Mean times and spreads of a truth in its engine without scatter, at even relative angles."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dogshape.validation.blind.cases import Case
from dogshape.validation.blind.data import Array, engine_of, swapped
from dogshape.validation.blind.mujoco_shift import Draw
from dogshape.validation.blind.stand import Point, Stand, Truth

ANGLES = {"planar": 48, "mujoco": 20}  #: even ones, by engine
FAR, LEAST_FAR, SLOT = 8.0, 8e-3, 0.5  #: behind the median, from which a shift is late


@dataclass(frozen=True)
class Expected:
    """Mean times and spreads of an engine without scatter, s, (points,); late shifts left out."""

    mean: Array
    sd: Array


def expected_of(case: Case, stand: Stand, points: Sequence[Point]) -> Expected:
    """Simulate the means that the engine of a case expects of its truth, as the table has them."""
    found, order = expected(case.engine, stand, points, case.truth), swapped(case, points)
    return Expected(found.mean[order], found.sd[order])


def expected(name: str, stand: Stand, points: Sequence[Point], truth: Truth) -> Expected:
    """Simulate even angles of nominal operating points, weighted as the truth draws them.

    A valve that sticks or hangs delays by its mean, and its own spread joins that of the angles.
    """
    engine, count = engine_of(name, stand, truth), ANGLES[name]
    turns = (np.arange(count) + 0.5) / count
    late, spread = truth.waiting
    # Phases of a ripple go round several times while the angles go round once.
    draws = [Draw(turn * stand.pitch, late, 2.0 * np.pi * (7.0 * turn % 1.0)) for turn in turns]
    times = np.array([[engine.shift(point, d).time for d in draws] for point in points], float)
    waits = np.array([min(stand.timeout, stand.pitch / abs(point.mismatch)) for point in points])
    weights = np.exp(truth.concentration * (np.cos(2.0 * np.pi * (turns - truth.centre)) - 1.0))
    return moments(timely(times, waits), weights, spread)


def timely(times: Array, waits: Array) -> Array:
    """Replace late shifts among times (points, n) by NaN.

    A late shift lies behind the median by half the time in which a slot passes, ``waits`` (points,)
    in s, and by ``FAR`` distances of the 10 % quantile from it.
    """
    known = np.isfinite(times).any(axis=1)
    fast, middle = np.full((2, len(times)), np.nan)
    fast[known], middle[known] = np.nanquantile(times[known], (0.1, 0.5), axis=1)
    far = np.maximum(FAR * (middle - fast), np.maximum(SLOT * waits, LEAST_FAR))
    return np.where(times > (middle + far)[:, None], np.nan, times)


def moments(times: Array, weights: Array, more: float = 0.0) -> Expected:
    """Compute mean and spread of times (points, n) with weights (n,); NaN stands for no shift.

    ``more`` is the standard deviation of a further delay, s.
    """
    having = np.isfinite(times)
    share = np.where(having.any(axis=1), (having * weights).sum(axis=1), np.nan)
    mean = (np.where(having, times, 0.0) * weights).sum(axis=1) / share
    apart = np.where(having, times - mean[:, None], 0.0)
    return Expected(mean, np.sqrt((apart**2 * weights).sum(axis=1) / share + more**2))
