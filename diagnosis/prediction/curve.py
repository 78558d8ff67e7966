"""Changes that an effect makes to the moments of shift times, over its parameters."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from dogshape.diagnosis.prediction.emulator import Emulator
from dogshape.diagnosis.prediction.moments import Angles
from dogshape.diagnosis.prediction.simulations import coordinate
from dogshape.diagnosis.terms import Array, Hypothesis
from dogshape.sim.effect import Effect, Parameter
from dogshape.sim.setting import Setting

MOMENTS = 5
LEAST_PART = 0.02  #: of the mean time, from the closed gap to the end at least


@dataclass(frozen=True)
class Space:
    """Parameters of a hypothesis as a unit cube of shares of their ranges."""

    effects: tuple[Effect, ...]
    setting: Setting

    @property
    def hypothesis(self) -> Hypothesis:
        """Names of the effects."""
        return tuple(effect.name for effect in self.effects)

    @cached_property
    def parameters(self) -> tuple[Parameter, ...]:
        """All parameters, effect by effect."""
        return tuple(p for effect in self.effects for p in effect.parameters)

    def values(self, shares: Array) -> Array:
        """Compute values (m, p) at shares (m, p) of the ranges."""
        rows = [p.at(share) for p, share in zip(self.parameters, shares.T, strict=True)]
        return np.array(rows).reshape(shares.shape[::-1]).T

    def columns(self, name: str) -> slice:
        """Find the columns of an effect's parameters."""
        ends = np.cumsum([0, *(len(effect.parameters) for effect in self.effects)]).tolist()
        place = self.hypothesis.index(name)
        return slice(ends[place], ends[place + 1])


class Changes(NamedTuple):
    """Changes by an effect at m values of its parameters."""

    moments: Array  #: (m, C, MOMENTS)
    delay: Array  #: dead time, s, (m, C)
    #: errors of the changes of ln mean and ln deviation by interpolation between levels, (m, C)
    error: Array
    spread: Array | float = 0.0
    alike: float = 0.0  #: share of the variance of ``error`` that all points have in common
    #: share of the smaller mode; mean and deviation of the larger one over those of all; excess
    #: kurtosis; (4, m, C)
    modes: Array | None = None
    #: of the logarithm of the time until the gap is closed, and of the mismatch, pitches/s, (m, C)
    flight: Array | float = 0.0
    slip: Array | float = 0.0
    uneven: Array | None = None  #: concentration and centre of the angles, (2, m, 1)
    #: square of the error of ln deviation by uneven angles over ``BLUR``, (m, C)
    blur: Array | float = 0.0


class Curve(NamedTuple):
    """Changes by an effect between its benches, in the unit cube of their coordinates."""

    effect: Effect
    setting: Setting
    low: Array  #: least coordinates, and ranges, (p,)
    wide: Array
    free: Array  #: time until the gap is closed of the baseline, s, (C,)
    emulator: Emulator  #: of their moments
    angles: Angles  #: their times
    dense: np.ndarray  #: which of them have all angles of the baseline, (n,)
    exact: Array  #: changes of delay, root of 1 / ``free``, and mismatch, (n, 3 C)

    def places(self, values: Array) -> Array:
        """Compute coordinates of values (m, p), (m, p)."""
        at = (coordinates(self.effect, values, self.setting) - self.low) / self.wide
        return np.clip(at, 0.0, 1.0)

    def changes(self, values: Array) -> Changes:
        """Compute the changes at values (m, p)."""
        at, cells = self.places(values), len(self.free)
        moments, error = self.emulator.at(at, MOMENTS)
        found = self.emulator.weights(at) @ self.exact
        delay, root, slip = found.reshape(-1, 3, cells).swapaxes(0, 1)
        flight = -2.0 * np.log(np.maximum(1.0 + root * self.free**0.5, LEAST_PART))
        moments = moments.reshape(-1, cells, MOMENTS)
        error, spread = error.reshape(-1, cells, 2).transpose(2, 0, 1)
        alike = self.emulator.alike(MOMENTS)
        return Changes(moments, delay, error, spread, alike, flight=flight, slip=slip)


def coordinates(effect: Effect, values: Array, setting: Setting) -> Array:
    """Compute the coordinates in which times change evenly, of values (m, p), (m, p)."""
    pairs = zip(effect.parameters, values.T, strict=True)
    columns = [coordinate(p, column, setting) for p, column in pairs]
    return np.array(columns).reshape(len(columns), len(values)).T
