"""Prediction of a hypothesis: the distribution of shift times at each operating point.

The bank of simulations gives it (an emulator), the likelihood asks for it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol, Self, runtime_checkable

import numpy as np

from dogshape.diagnosis.prediction.levels import Level
from dogshape.diagnosis.terms import Array, Hypothesis
from dogshape.sim.shift.actuation import ForceProfile


@dataclass(frozen=True)
class Prediction:
    """Shift times that a hypothesis predicts for a bench, at m values of its parameters.

    Arrays are (m,) at one operating point, (cells, m) at several; ``times`` has a last axis more.

    Parameters
    ----------
    times : of shifts that engage, outliers left out, at the shares (k + 1/2)/q, ascending, s.
    engaged : share of shifts that engage before the time-out.
    error : standard error of the mean of ``times``: too few simulated angles, emulation and
        numerics together, s.
    engaged_error : standard error of ``engaged``.
    common : error of the mean that all operating points share: effects together against each
        alone, s, with its sign. It is no part of ``error``.
    outlier_share : share of outliers (``diagnosis.prediction.outliers``) among those that engage.
    behind, behind_sd : mean and standard deviation of the delay of outliers behind the mean of
        the others, s; NaN where no simulation has enough of them.
    delay : part of all times that is added to the simulated time and has no error, s.
    """

    times: Array
    engaged: Array
    error: Array
    engaged_error: Array
    common: Array
    outlier_share: Array
    behind: Array
    behind_sd: Array
    delay: Array

    @classmethod
    def plain(cls, times: Array, engaged: Array, error: Array, engaged_error: Array) -> Prediction:
        """Make a prediction without outliers and common errors."""
        zero, unknown = np.zeros(len(times)), np.full(len(times), np.nan)
        outliers = zero, unknown, unknown
        return Prediction(times, engaged, error, engaged_error, zero, *outliers, zero)


class Emulator(Protocol):
    """Fast predictor of each operating point of a data set, by its place."""

    def at(self, hypothesis: Hypothesis, values: Array, cell: int) -> Prediction:
        """Predict an operating point at ``values`` (m, p) of a hypothesis."""
        ...


@runtime_checkable
class SimulatingEmulator(Emulator, Protocol):
    """Emulator that can have effects simulated together where it is asked to."""

    def acting(self, hypothesis: Hypothesis) -> Hypothesis:
        """List the effects of a hypothesis that are simulated, not only read.

        None where the emulator cannot have them simulated together.
        """
        ...

    def joint_levels(self, acting: Hypothesis) -> int:
        """Count the levels at which effects were simulated together."""
        ...

    def with_levels(self, levels: Sequence[Level]) -> Self:
        """Simulate effects together at some levels, and return an emulator that has them."""
        ...


@dataclass(frozen=True)
class Marks:
    """Marks of the flight for m values of a hypothesis, s, (m, SIZE) each.

    ``diagnosis.bench.flight_marks`` says what they are.

    Parameters
    ----------
    times : when displacement and force pass the marks' values.
    error : standard errors of each on its own.
    creep : standard error that all have in common.
    """

    times: Array
    error: Array
    creep: Array


@runtime_checkable
class FlightEmulator(Emulator, Protocol):
    """Emulator that also predicts the marks of the flight under a force profile."""

    def flight(self, hypothesis: Hypothesis, values: Array, profile: ForceProfile) -> Marks:
        """Predict the marks at ``values`` (m, p) of a hypothesis."""
        ...
