"""Mean times and spreads of a truth in its engine without scatter, at even relative angles."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from dogshape.diagnosis.prediction.outliers import Array, bulk
from dogshape.validation.blind.cases import Case
from dogshape.validation.blind.data import series_places
from dogshape.validation.blind.mujoco_shift import Draw
from dogshape.validation.blind.stand import Point, Stand, Truth
from dogshape.validation.blind.truth_engines import engine_of

THIRDS = (1.0 / 6.0, 0.5, 5.0 / 6.0)  #: quantiles of the places in a series
ANGLES = {"planar": 96, "mujoco": 24, "drake": 16}  #: even ones, by engine


@dataclass(frozen=True)
class Expected:
    """Mean times and spreads of an engine without scatter, s, (points,); late shifts left out."""

    mean: Array
    sd: Array


def expected(
    name: str,
    stand: Stand,
    points: Sequence[Point],
    truth: Truth,
    fades: Sequence[float] | None = None,
) -> Expected:
    """Simulate even angles of nominal operating points, weighted as the truth draws them.

    ``fades`` are the shares of the force that a drift has left at each point. A sticking valve
    delays by its mean, and its own spread joins that of the angles.
    """
    turns = _turns(name)
    weights = np.exp(truth.concentration * (np.cos(2.0 * np.pi * (turns - truth.centre)) - 1.0))
    return moments(times_at(name, stand, points, truth, fades), weights, truth.sticking)


def _turns(name: str) -> Array:
    return (np.arange(ANGLES[name]) + 0.5) / ANGLES[name]


def times_at(
    name: str,
    stand: Stand,
    points: Sequence[Point],
    truth: Truth,
    fades: Sequence[float] | None = None,
) -> Array:
    """Simulate times at even angles of nominal operating points, s, (points, n); NaN for none."""
    engine, turns = engine_of(name, stand, truth), _turns(name)
    # Phases of a ripple go round several times while the angles go round once.
    draws = [
        Draw(turn * stand.pitch, truth.sticking, 2.0 * np.pi * (7.0 * turn % 1.0))
        for turn in turns.tolist()
    ]
    return np.array(
        [
            [engine.shift(point, replace(draw, fade=fade)).time for draw in draws]
            for point, fade in zip(points, fades or [1.0] * len(points), strict=True)
        ],
        float,
    )


def moments(times: Array, weights: Array, more: float = 0.0) -> Expected:
    """Compute mean and spread of times (points, n) with weights (n,), late shifts left out.

    ``more`` is the standard deviation of a further delay, s; NaN stands for no shift.
    """
    having = np.isfinite(bulk(times))
    known = having.any(axis=1)
    share = np.where(known, (having * weights).sum(axis=1), np.nan)
    soon = np.where(having, times, 0.0)
    mean = (soon * weights).sum(axis=1) / share
    apart = np.where(having, times - mean[:, None], 0.0)
    return Expected(mean, np.sqrt((apart**2 * weights).sum(axis=1) / share + more**2))


def fades_of(case: Case) -> list[list[float]]:
    """Return shares of the force that a drift leaves, early, middle and late ones of each point.

    They are (3, points), each for a third of the point's shifts.
    """
    last = max(1, sum(case.numbers) - 1)
    places = [np.quantile(mine, THIRDS) for mine in series_places(case)]
    fades: list[list[float]] = (1.0 - case.truth.drift * (np.array(places).T - 1) / last).tolist()
    return fades


def pooled(parts: Sequence[Expected]) -> Expected:
    """Join means and spreads of equally many shifts each."""
    means = np.array([part.mean for part in parts])
    inner = np.mean([part.sd**2 for part in parts], axis=0)
    return Expected(means.mean(axis=0), np.sqrt(inner + means.var(axis=0)))
