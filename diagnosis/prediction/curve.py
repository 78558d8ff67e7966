"""Changes that an effect makes to the moments of shift times, over its parameters."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from dogshape.diagnosis.prediction.emulator import Emulator
from dogshape.diagnosis.prediction.moments import MOMENTS, Angles, Modes
from dogshape.diagnosis.prediction.simulations import coordinate
from dogshape.diagnosis.terms import Array, Hypothesis
from dogshape.sim.effect import Effect, Parameter
from dogshape.sim.setting import Setting

MIN_CONTACT_SHARE = 0.02  #: of the mean time, from the closed gap to the end
MIN_ROOT_RATIO = 0.02  #: of the root of 1 / time until the gap is closed to that of the baseline


@dataclass(frozen=True)
class ParameterSpace:
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

    def shares(self, values: Array) -> Array:
        """Compute shares (m, p) of the ranges at values (m, p)."""
        shares = np.empty(values.shape)
        for k, parameter in enumerate(self.parameters):
            shares[:, k] = parameter.share(values[:, k])
        return shares

    def columns(self, name: str) -> slice:
        """Find the columns of an effect's parameters."""
        ends = np.cumsum([0, *(len(effect.parameters) for effect in self.effects)]).tolist()
        index = self.hypothesis.index(name)
        return slice(ends[index], ends[index + 1])


class AngleDistribution(NamedTuple):
    """Distribution of the relative angles at m values, (m, 1) each."""

    concentration: Array
    centre: Array  #: pitches


class Changes(NamedTuple):
    """Changes by an effect at m values of its parameters and C operating points."""

    moments: Array  #: (m, C, MOMENTS)
    delay: Array  #: dead time, s, (m, C)
    error: Array  #: of the change of ln mean by interpolation between levels, (m, C)
    log_sd_error: Array | float = 0.0  #: the same of ln standard deviation, (m, C)
    common_share: float = 0.0  #: of the variance of ``error`` that all points have in common
    modes: Modes | None = None
    flight: Array | float = 0.0  #: of the logarithm of the time until the gap is closed, (m, C)
    slip: Array | float = 0.0  #: of the mismatch, pitches/s, (m, C)
    angles: AngleDistribution | None = None  #: None for even angles
    inverse_squared_count: Array | float = 0.0  #: 1 / number of angles that count^2, (m, C)


class Curve(NamedTuple):
    """Changes by an effect between its n benches, in the unit cube of their coordinates."""

    effect: Effect
    setting: Setting
    low: Array  #: lower ends of the coordinates, (p,)
    width: Array  #: ranges of the coordinates, (p,)
    gap_time: Array  #: time until the gap is closed of the baseline, s, (C,)
    emulator: Emulator  #: of the moments
    angles: Angles  #: times of the benches
    is_dense: np.ndarray  #: whether a bench has all angles of the baseline, (n,)
    exact: Array  #: changes of delay, root of 1 / gap time, and mismatch, (n, 3 C)

    def coordinates(self, values: Array) -> Array:
        """Compute coordinates in the unit cube of values (m, p), (m, p)."""
        x = (coordinates(self.effect, values, self.setting) - self.low) / self.width
        return np.clip(x, 0.0, 1.0)

    def changes(self, values: Array) -> Changes:
        """Interpolate the changes at values (m, p)."""
        x = self.coordinates(values)
        cells = len(self.gap_time)
        moments, errors = self.emulator.predict(x, MOMENTS)
        exact = (self.emulator.weights(x) @ self.exact).reshape(-1, 3, cells)
        delay, inverse_root, slip = exact.swapaxes(0, 1)
        root_ratio = np.maximum(1.0 + inverse_root * self.gap_time**0.5, MIN_ROOT_RATIO)
        errors = errors.reshape(-1, cells, 2)
        return Changes(
            moments=moments.reshape(-1, cells, MOMENTS),
            delay=delay,
            error=errors[..., 0],
            log_sd_error=errors[..., 1],
            common_share=self.emulator.miss_correlation(MOMENTS),
            flight=-2.0 * np.log(root_ratio),
            slip=slip,
        )


def coordinates(effect: Effect, values: Array, setting: Setting) -> Array:
    """Compute coordinates in which times change evenly, of values (m, p), (m, p)."""
    pairs = zip(effect.parameters, values.T, strict=True)
    columns = [coordinate(p, column, setting) for p, column in pairs]
    return np.array(columns).reshape(len(columns), len(values)).T
