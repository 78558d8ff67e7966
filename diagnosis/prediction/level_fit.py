r"""One effect alone: curves through its levels at all operating points.

The mean :math:`M(x)` is that of the baseline with the change along the curve of
``diagnosis.prediction.level_curves``, :math:`\ln M = \sum_l w_l \ln M_l`. An effect of no strength
is then the baseline itself. The shape, times over their mean at equal shares, has the same weights.
Both leave outliers (``diagnosis.prediction.outliers``) out. The share of outliers has the weights
of the share engaged.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from dogshape.diagnosis.prediction.angle_means import (
    binned,
    engaged_count,
    engaged_mean,
    even_variance,
    mean_covariance,
    residuals,
    with_dense,
)
from dogshape.diagnosis.prediction.bank import Bank
from dogshape.diagnosis.prediction.combination import Emulated
from dogshape.diagnosis.prediction.level_curves import Curves, fit_curves
from dogshape.diagnosis.prediction.levels import Axes
from dogshape.diagnosis.prediction.outliers import Outliers, bulk, outlier_shares
from dogshape.sim.effect import Effect

Array = NDArray[np.float64]

SHARES = 24  #: at which times are given
LEAST = 0.02  #: relative to its mean, the least time of a shape
SUDDEN = 0.3  #: length at most of curves of the share engaged
NONE = 10.0  #: relative error of a mean without a single shift


@dataclass(frozen=True)
class Alone:
    """One effect alone, emulated at m values and C operating points.

    ``change`` is the variance of the change of the mean's logarithm from the baseline, (C, m);
    ``weights`` and ``share_weights`` are those of levels in its curves, (C, m, N); ``places`` are
    coordinates, (C, m, d), and ``neutral`` those without the effect, (C, d).
    """

    emulated: Emulated
    change: Array
    weights: Array
    share_weights: Array
    places: Array
    neutral: Array


@dataclass(frozen=True)
class Fit:
    """One effect at C operating points through N levels, the first of which is the baseline.

    ``means`` (C, N) are logarithms, ``shapes`` (C, N, q) times over their mean. ``shares``
    engaged (C, N) have errors of their own, ``share_curves``, whose variance is at least
    ``least`` (C,): equal angles at all levels count less than as many different angles.
    ``outlier_shares`` are (C, N); means and shapes leave outliers out.
    """

    effect: Effect
    axes: tuple[Axes, ...]
    curves: Curves
    share_curves: Curves
    means: Array
    shapes: Array
    shares: Array
    least: Array
    outlier_shares: Array

    def at(self, values: Array) -> Alone:
        """Emulate this effect alone at values (m, p)."""
        places, neutral = self._places(values)
        known = self.curves.covariance(places)
        weights, variance = self.curves.from_first(known)
        mean = np.exp(_weighed(weights, self.means))
        shape = np.sort(np.maximum(weights @ self.shapes, LEAST), axis=-1)
        shape *= (mean / shape.mean(axis=-1))[..., None]
        part, uncertain = self.share_curves.from_first(self.share_curves.covariance(places))
        engaged = np.clip(_weighed(part, self.shares), 0.0, 1.0)
        uncertain = np.maximum(uncertain, self.least[:, None]) + self._step(part, engaged)
        outlying = np.clip(_weighed(part, self.outlier_shares), 1e-3, 1.0 - 1e-3)
        change = self.curves.change_variance(known, places, neutral)
        emulated = Emulated(shape, engaged, variance, uncertain, outlying)
        cells = len(self.means)
        wide = (np.broadcast_to(one, (cells, *one.shape[1:])) for one in (places, neutral))
        return Alone(emulated, change, weights, part, *wide)

    def _places(self, values: Array) -> tuple[Array, Array]:
        """Return coordinates of values (m, p) and of the neutral ones, (C, m, d) and (C, d).

        They have the first axis 1 where all operating points have the same.
        """
        axes = self.axes[:1] if self._alike else self.axes
        return np.array([a.at(values) for a in axes]), np.array([a.neutral for a in axes])

    @cached_property
    def _alike(self) -> bool:
        """Test that all operating points have the same coordinates."""
        return all(axes.same(self.axes[0]) for axes in self.axes)

    def _step(self, weights: Array, engaged: Array) -> Array:
        """Return the variance of a share that may fall anywhere between levels that differ."""
        part = abs(weights)
        part /= part.sum(axis=-1, keepdims=True)
        return (part * (self.shares[:, None] - engaged[..., None]) ** 2).sum(axis=-1)


def fit_effect(bank: Bank, effect: Effect, dense: Array, outliers: Outliers) -> Fit:
    """Fit what an effect alone does at all operating points; ``dense`` is the baseline's bulk."""
    places = bank.of((effect.name,))
    axes = tuple(Axes.of(effect, setting) for setting in bank.settings)
    values = np.array([bank.levels[k].values for k in places])
    times = np.concatenate([bank.base[None], bank.times[places]]).transpose(1, 0, 2)
    sites = np.array([[a.neutral, a.neutral, *a.at(values)] for a in axes])
    soon = bulk(times)
    means, errors = _means(bank, dense, soon, _speeds(bank, places))
    curves = fit_curves(sites, means, errors, slice(2, None))
    shapes = np.array([[_shape(t) for t in mine] for mine in _with_first(dense, soon)])
    shares, doubts = _shares(_with_first(bank.baseline, times))
    likely = _share_curves(curves, shares, doubts)
    first = outlier_shares(bank.baseline[:, None], dense[:, None], outliers.share)
    rare = np.concatenate([first, outlier_shares(times, soon, outliers.share)], axis=1)
    least = doubts.min(axis=1)
    return Fit(effect, axes, curves, likely, means, shapes, shares, least, rare)


def _with_first(first: Array, times: Array) -> list[list[Array]]:
    """Return times of levels (C, N, n) after those of the baseline at more angles, (C, dense n)."""
    return [[dense, *levels] for dense, levels in zip(first, times, strict=True)]


def _speeds(bank: Bank, places: list[int]) -> Array:
    """Return at which speeds the rings pass at the baseline and at levels, pitches a second."""
    named = {effect.name: effect for effect in bank.effects}
    rows = []
    for setting in bank.settings:
        settings = [setting, *(bank.levels[k].setting(named, setting) for k in places)]
        rows.append([abs(s.point.mismatch) / s.clutch.dog.pitch_angle for s in settings])
    return np.array(rows)


def _means(bank: Bank, dense: Array, times: Array, speeds: Array) -> tuple[Array, Array]:
    """Return logarithms of means (C, N) and their covariance, baseline at all angles first."""
    share = bank.common.shape[1] / bank.baseline.shape[1]
    errors = with_dense(mean_covariance(times, speeds), even_variance(residuals(dense)), share)
    found = np.concatenate([engaged_mean(dense)[:, None], engaged_mean(times)], axis=1)
    timeout = np.array([[setting.clutch.timeout] for setting in bank.settings])
    unknown = np.isnan(found)
    errors += np.eye(found.shape[1]) * np.where(unknown, NONE**2, 0.0)[:, None, :]
    return np.log(np.where(unknown, timeout, found)), errors


def _shape(times: Array) -> Array:
    """Return the times that engaged over their mean at ``SHARES`` shares; 1 where none did."""
    shape = binned(times, SHARES)[0]
    return np.ones(SHARES) if np.isnan(shape).any() else shape / shape.mean()


def _shares(every: list[list[Array]]) -> tuple[Array, Array]:
    """Return shares engaged (C, N) and their variances by Jeffreys' rule."""
    counted = np.array([[engaged_count(one) for one in mine] for mine in every])
    engaged, asked = counted[..., 0], counted[..., 1]
    likely = (engaged + 0.5) / (asked + 1.0)
    return engaged / np.maximum(asked, 1.0), likely * (1.0 - likely) / (asked + 2.0)


def _share_curves(curves: Curves, shares: Array, doubts: Array) -> Curves:
    """Return curves of the share engaged, which may fall from level to level at once.

    The baseline's second row is part of its first and hardly counts.
    """
    once = np.where(np.arange(shares.shape[1]) == 1, 100.0, 1.0)
    noise = np.eye(shares.shape[1]) * (once * doubts)[:, None, :]
    size = np.maximum(shares.std(axis=1), np.sqrt(doubts.min(axis=1)))
    return curves.like(size, noise, SUDDEN)


def _weighed(weights: Array, levels: Array) -> Array:
    """Sum levels (C, N) by weights (C, m, N), (C, m)."""
    return np.stack([w @ level for w, level in zip(weights, levels, strict=True)])
