r"""Times over the relative angle at the first touch, where levels can be compared angle by angle.

Until dogs touch, the rings turn against each other by :math:`\phi = \Omega \tau`, with the mismatch
:math:`\Omega` and the time :math:`\tau` of the flight. An effect that only makes the flight longer
moves all times along the angle at the start of the force, and changes none over the angle at the
first touch, :math:`\psi = \theta + \phi`. So times of levels are laid over :math:`\psi`, periodic
over the pitch, and mixed there with the weights :math:`w` of their effect's curve:

.. math:: \ln T(\psi) = \ln T_0(\psi) + \sum_e \sum_l w_{e,l} \ln\frac{T_{e,l}(\psi)}{T_0(\psi)}.

Relative angles that are not uniform weight this profile at :math:`\theta = \psi - \phi`. Only
ratios of what is weighted to what is not are taken from it: uniform angles change nothing.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from dogshape.diagnosis.prediction.angle_means import even_variance, shared_out
from dogshape.diagnosis.prediction.bank import Bank
from dogshape.diagnosis.prediction.combination import Emulated
from dogshape.diagnosis.prediction.level_fit import Alone
from dogshape.diagnosis.prediction.outliers import bulk
from dogshape.diagnosis.prediction.touch_phases import TouchPhases
from dogshape.diagnosis.terms import Array
from dogshape.sim.setting import angle_weights


@dataclass(frozen=True)
class Profiles:
    """Profiles of some benches at C operating points, over J angles at the first touch.

    ``logs`` are logarithms of times in s, ``engaged`` the shares that engage, (C, N, J) each.
    """

    logs: Array
    engaged: Array

    def mixed(self, weights: Array, share_weights: Array) -> Profiles:
        """Mix the benches by weights (C, m, N) of logarithms of times and of shares."""
        return Profiles(weights @ self.logs, share_weights @ self.engaged)

    def corrected(self, weights: Array, other: Profiles) -> Profiles:
        """Add residuals (C, L, J) by weights (C, m, L)."""
        return Profiles(self.logs + weights @ other.logs, self.engaged + weights @ other.engaged)

    def on_top(self, other: Profiles, base: Profiles) -> Profiles:
        """Add the change of another profile from the baseline's."""
        return Profiles(
            self.logs + other.logs - base.logs, self.engaged + other.engaged - base.engaged
        )


def laid(times: Array, touch: Array, places: Array) -> tuple[Array, Array]:
    """Lay times over angles at the first touch.

    Parameters
    ----------
    times : s, (n,); angles without a time take that of their neighbours.
    touch : angle of each at the first touch, pitches, (n,).
    places : asked angles, pitches, (J,).

    Return logarithms of times and shares that engage, (J,) each.
    """
    ended = np.isfinite(times)
    share = np.interp(places, touch, ended * 1.0, period=1.0)
    if not ended.any():
        return np.zeros(places.size), share
    return np.interp(places, touch[ended], np.log(times[ended]), period=1.0), share


class AngleProfiles:
    """Profiles of a bank's baseline and levels, over the baseline's angles at the first touch."""

    def __init__(self, bank: Bank, phases: TouchPhases) -> None:
        self.bank, self.phases = bank, phases
        pitches = np.array([one.clutch.dog.pitch_angle for one in bank.settings])
        self._angles = bank.angles / pitches[:, None]
        still = phases.at({}, 1)[:, 0]
        #: Angles at the first touch, pitches, (C, J), even and ascending.
        self.places = np.sort((self._angles + still[:, None]) % 1.0, axis=1)
        self._still = still
        self._levels: dict[str, Profiles] = {}

    @cached_property
    def base(self) -> Profiles:
        """Profile of the baseline, (C, 1, J)."""
        rows = [
            laid(bulk(times), angles + turned, places)
            for times, angles, turned, places in zip(
                self.bank.baseline, self._angles, self._still, self.places, strict=True
            )
        ]
        logs, engaged = np.array(rows).transpose(1, 0, 2)
        return Profiles(logs[:, None], engaged[:, None])

    def of(self, levels: Sequence[int]) -> Profiles:
        """Lay levels of the bank, by their places in it, over the angles."""
        named = {effect.name: effect for effect in self.bank.effects}
        logs, engaged = [], []
        for cell, setting in enumerate(self.bank.settings):
            angles = self._angles[cell, self.bank.common[cell]]
            rows = [
                laid(
                    bulk(self.bank.times[k, cell]),
                    angles + self.phases.of(self.bank.levels[k].setting(named, setting)),
                    self.places[cell],
                )
                for k in levels
            ]
            logs.append([one for one, _ in rows])
            engaged.append([one for _, one in rows])
        return Profiles(np.array(logs), np.array(engaged))

    def mixed(self, alone: Mapping[str, Alone]) -> Profiles:
        """Mix the levels of effects by the weights that each has alone, (C, m, J)."""
        whole = self.base
        for name, one in alone.items():
            mine = self._of_effect(name).mixed(one.weights, one.share_weights)
            whole = whole.on_top(mine, self.base)
        return whole

    def _of_effect(self, name: str) -> Profiles:
        """Return the profiles of an effect's levels behind two of the baseline, as curves are."""
        if name not in self._levels:
            mine, base = self.of(self.bank.of((name,))), self.base
            self._levels[name] = Profiles(
                np.concatenate([base.logs, base.logs, mine.logs], axis=1),
                np.concatenate([base.engaged, base.engaged, mine.engaged], axis=1),
            )
        return self._levels[name]


@dataclass(frozen=True)
class Preferred:
    """Relative angles that are not uniform, at C operating points and m values, (C, m) each."""

    concentration: Array
    centre: Array

    @property
    def uniform(self) -> bool:
        """Test that all angles are uniform."""
        return not self.concentration.any()

    def weights(self, places: Array, turned: Array) -> Array:
        """Weight angles at the first touch (C, J), (C, m, J); ``turned`` (C, m) is in pitches."""
        start = places[:, None] - turned[..., None]
        return angle_weights(start, self.concentration[..., None], self.centre[..., None])


def weighted(whole: Emulated, mixed: Profiles, weights: Array, angles: int) -> Emulated:
    """Weight emulated times (C, m, q) by a profile over J angles.

    ``weights`` are (C, m, J), 1 on average; ``angles`` at a level say how well a jump of the
    profile is known.
    """
    even = np.clip(mixed.engaged, 1e-3, 1.0)
    given = weights * even
    times = np.exp(mixed.logs)
    plain, chosen = _mean(times, even), _mean(times, given)
    q = whole.times.shape[-1]
    shape = _shape(times, given, q) / _shape(times, even, q)
    changed = np.sort(whole.times * shape, axis=-1)
    mean = whole.times.mean(axis=-1) * chosen / plain
    changed *= (mean / changed.mean(axis=-1))[..., None]
    likely, share = (np.clip(one.mean(axis=-1), 1e-3, 1.0 - 1e-3) for one in (given, even))
    odds = likely / (1.0 - likely) * (1.0 - share) / share
    return replace(
        whole,
        times=changed,
        engaged=whole.engaged * odds / (1.0 - whole.engaged + whole.engaged * odds),
        variance=whole.variance + _jumps(times, given, even, angles),
        engaged_variance=whole.engaged_variance * np.maximum(1.0, (weights**2).mean(axis=-1)),
    )


def _mean(times: Array, given: Array) -> Array:
    """Return weighted means over the last axis."""
    found: Array = (times * given).sum(axis=-1) / given.sum(axis=-1)
    return found


def _shape(times: Array, given: Array, count: int) -> Array:
    """Return weighted times (..., J) over ``count`` equal shares of them, over their mean."""
    order = np.argsort(times, axis=-1)
    mass = np.take_along_axis(np.broadcast_to(given, times.shape), order, axis=-1)
    mass = mass / mass.sum(axis=-1, keepdims=True)
    sums = np.take_along_axis(times, order, axis=-1) * mass
    size = times.shape[-1]
    parts = shared_out(mass.reshape(-1, size), sums.reshape(-1, size), count)
    parts = parts.reshape(*times.shape[:-1], count)
    return np.asarray(parts / parts.mean(axis=-1, keepdims=True))


def _jumps(times: Array, given: Array, even: Array, angles: int) -> Array:
    """Compute what weights add to the variance of a mean's logarithm, (C, m).

    A profile of a level knows its jumps to one of its angles only.
    """
    every = max(1, times.shape[-1] // angles)
    rows = []
    for weights in (given, even):
        mean, part = _mean(times, weights), weights.mean(axis=-1)
        series = weights * (times / mean[..., None] - 1.0) / part[..., None]
        rows.append(np.mean([even_variance(series[..., k::every]) for k in range(every)], axis=0))
    return np.maximum(0.0, rows[0] - rows[1])
