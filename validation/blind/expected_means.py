"""Mean times and spreads of a truth in its engine without scatter, at even relative angles."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from dogshape.validation.blind.cases import Case
from dogshape.validation.blind.data import Array, engine_of, series_places, swapped
from dogshape.validation.blind.mujoco_shift import Draw
from dogshape.validation.blind.stand import Point, Stand, Truth

THIRDS = (1.0 / 6.0, 0.5, 5.0 / 6.0)  #: quantiles of the places in a series
ANGLES = {"planar": 64, "mujoco": 20}  #: even ones, by engine
FAR, LEAST_FAR, SLOT = 8.0, 8e-3, 0.5  #: behind the median, from which a shift is late


@dataclass(frozen=True)
class Expected:
    """Mean times and spreads of an engine without scatter, s, (points,); late shifts left out."""

    mean: Array
    sd: Array


def expected_of(case: Case, stand: Stand, points: Sequence[Point]) -> Expected:
    """Simulate the means that the engine of a case expects of its truth, as the table has them."""
    truth = case.truth
    if not truth.drift:
        found = expected(case.engine, stand, points, truth)
    else:
        steady = replace(truth, drift=0.0)
        parts = [expected(case.engine, stand, points, steady, fades) for fades in fades_of(case)]
        means = np.array([part.mean for part in parts])
        inner = np.mean([part.sd**2 for part in parts], axis=0)
        found = Expected(means.mean(axis=0), np.sqrt(inner + means.var(axis=0)))
    order = swapped(case, points)
    return Expected(found.mean[order], found.sd[order])


def expected(
    name: str,
    stand: Stand,
    points: Sequence[Point],
    truth: Truth,
    fades: Sequence[float] | None = None,
) -> Expected:
    """Simulate even angles of nominal operating points, weighted as the truth draws them.

    ``fades`` are the shares of the force that a drift has left at each point. A valve that sticks
    or hangs delays by its mean, and its own spread joins that of the angles.
    """
    engine, count = engine_of(name, stand, truth), ANGLES[name]
    turns = (np.arange(count) + 0.5) / count
    late, spread = truth.waiting
    # Phases of a ripple go round several times while the angles go round once.
    draws = [Draw(turn * stand.pitch, late, 2.0 * np.pi * (7.0 * turn % 1.0)) for turn in turns]
    times = np.array(
        [
            [engine.shift(point, replace(draw, fade=fade)).time for draw in draws]
            for point, fade in zip(points, fades or [1.0] * len(points), strict=True)
        ],
        float,
    )
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


def fades_of(case: Case) -> list[list[float]]:
    """Compute shares of the force that a drift leaves, early, middle and late ones of each point.

    They are (3, points), each for a third of the point's shifts.
    """
    last = max(1, sum(case.numbers) - 1)
    places = [np.quantile(mine, THIRDS) for mine in series_places(case)]
    fades: list[list[float]] = (1.0 - case.truth.drift * (np.array(places).T - 1) / last).tolist()
    return fades
