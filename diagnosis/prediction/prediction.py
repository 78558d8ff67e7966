"""What a hypothesis says of one operating point: the distribution of the time that is read there.

The bank of simulations gives it (an emulator), the likelihood asks for it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np

from dogshape.diagnosis.terms import Array, Hypothesis
from dogshape.sim.shift.actuation import ForceProfile


@dataclass(frozen=True)
class Spread:
    """Times that a bench reads at one operating point, for m values of a hypothesis.

    Parameters
    ----------
    times : of shifts that engage and are not late, at the shares (k + 1/2)/q of them, ascending,
        s, (m, q).
    engaged : share of shifts that engage before the time-out, (m,).
    error : standard error of the mean of ``times``: too few simulated angles, emulation and
        numerics together, s, (m,).
    engaged_error : standard error of ``engaged``, (m,).
    common : of that mean, which all operating points have alike, times its size and sign at each:
        what effects together do other than each alone, s, (m,). Not part of ``error``.
    late : share of those that engage that are late (``diagnosis.prediction.outliers``), (m,).
    behind, behind_sd : by how much they are later than the mean of the others, and the standard
        deviation, s, (m,); NaN where nobody knows.
    delay : part of all times that is added to what was simulated, and has no error, s, (m,).
    missed, jump : share of operating points at which times jump between two values that were
        simulated, so that the mean is off by much more than ``error``, and by how much, s, (m,).
    """

    times: Array
    engaged: Array
    error: Array
    engaged_error: Array
    common: Array
    late: Array
    behind: Array
    behind_sd: Array
    delay: Array
    missed: Array
    jump: Array

    @classmethod
    def plain(cls, times: Array, engaged: Array, error: Array, engaged_error: Array) -> Spread:
        """Return a spread without late shifts and common errors."""
        nothing, nobody = np.zeros(len(times)), np.full(len(times), np.nan)
        late = nothing, nobody, nobody
        errors = error, engaged_error, nothing
        return cls(times, engaged, *errors, *late, nothing, nothing, nothing)


class Emulator(Protocol):
    """Says the spread at each operating point of a data set, by its place, quickly."""

    def at(self, hypothesis: Hypothesis, values: Array, cell: int) -> Spread:
        """Return what a hypothesis with ``values`` (m, p) says of an operating point."""
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
    """An emulator that also says the marks of the flight under a force profile."""

    def flight(self, hypothesis: Hypothesis, values: Array, profile: ForceProfile) -> Marks:
        """Return what a hypothesis with ``values`` (m, p) says of the marks."""
        ...
