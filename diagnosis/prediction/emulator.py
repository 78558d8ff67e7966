r"""Emulator: from a bank's levels to the distribution of times at any values of a hypothesis.

One effect alone: the mean :math:`M(x)` is that of the baseline with the change along the curve of
``diagnosis.prediction.level_curves``, :math:`\ln M = \sum_l w_l \ln M_l`. An effect of no strength
is then the baseline itself. The shape, times over their mean at equal shares, has the same weights.
Both leave outliers (``diagnosis.prediction.outliers``) out. The share of outliers has the weights
of the share engaged, and their delay is that of all levels of the operating point.

Effects together: with :math:`T_e` the times at a share of an effect's own spread and :math:`T_0`
those of the baseline, :math:`T = T_0 \prod_e T_e/T_0`, and the odds of engaging likewise. Simulated
pairs correct these times (``diagnosis.prediction.combination``). Delays add to all times, exactly.
Angles that are not uniform are weights on the baseline's angles.

The error of a mean has three parts: the curve's own (angles and interpolation), numerics, and the
combination.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
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
from dogshape.diagnosis.prediction.combination import Emulated, Interactions, together
from dogshape.diagnosis.prediction.flight_store import FlightStore
from dogshape.diagnosis.prediction.flight_table import FlightTables
from dogshape.diagnosis.prediction.level_curves import Curves, fit_curves
from dogshape.diagnosis.prediction.levels import Axes, Level
from dogshape.diagnosis.prediction.outliers import (
    PRIOR,
    Outliers,
    bulk,
    outlier_shares,
    outlier_statistics,
)
from dogshape.diagnosis.prediction.prediction import Marks, Prediction
from dogshape.diagnosis.terms import Hypothesis
from dogshape.sim.effect import Effect
from dogshape.sim.errors import InputError, did_you_mean
from dogshape.sim.setting import Setting, angle_weights
from dogshape.sim.shift.actuation import ForceProfile

Array = NDArray[np.float64]

SHARES = 24  #: at which times are given
LEAST = 0.02  #: relative to its mean, the least time of a shape
SUDDEN = 0.3  #: length at most of curves of the share engaged
ANGLES = "angles"  #: stands for effects that only weight the baseline's angles
NONE = 10.0  #: relative error of a mean without a single shift
PROBES = 4  #: values at which it is seen whether operating points read alike


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

    def at(self, values: Array) -> tuple[Emulated, Array]:
        """Emulate this effect alone at values (m, p), with the variance of the change.

        The latter is the variance of the change of the mean's logarithm from the baseline, (C, m).
        """
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
        return Emulated(shape, engaged, variance, uncertain, outlying), change

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


class BankEmulator:
    """Emulator over a bank: predicts each operating point at any values of a hypothesis."""

    def __init__(self, bank: Bank, flights: FlightStore | None = None) -> None:
        self.bank = bank
        self.effects = {effect.name: effect for effect in bank.effects}
        simulated = {level.hypothesis[0] for level in bank.levels}
        self._soon = bulk(bank.baseline)
        levels = [(bank.times, bulk(bank.times))] if bank.levels else []
        self.outliers = outlier_statistics([(bank.baseline, self._soon), *levels])
        self.fits = {
            name: fit_effect(bank, self.effects[name], self._soon, self.outliers)
            for name in sorted(simulated)
        }
        self._asked: tuple[object, Prediction] | None = None
        self.flights = FlightTables(self.effects, bank.settings, flights)

    def at(self, hypothesis: Hypothesis, values: Array, cell: int) -> Prediction:
        """Predict an operating point at ``values`` (m, p) of a hypothesis.

        Raises InputError for an effect that the bank does not have.
        """
        # Operating points are asked in turn, and all at once are much quicker than each alone.
        key = hypothesis, values.shape, values.tobytes()
        if self._asked is None or self._asked[0] != key:
            self._asked = key, self._everywhere(hypothesis, values)
        every = self._asked[1]
        return Prediction(**{f.name: getattr(every, f.name)[cell] for f in fields(every)})

    def _everywhere(self, hypothesis: Hypothesis, values: Array) -> Prediction:
        """Predict all operating points, (C, m) and (C, m, q)."""
        parts = self._parts(hypothesis, values)
        alone = {n: self.fits[n].at(mine) for n, mine in parts.items() if n in self.fits}
        read = {name: mine for name, mine in parts.items() if name not in self.fits}
        weighted, delay = self._read(read, len(values))
        if weighted:
            alone[ANGLES] = weighted, weighted.variance
        common = np.zeros((1, 1))
        if len(alone) == 1:
            ((whole, _),) = alone.values()
        else:
            emulated_alone = {name: emulated for name, (emulated, _) in alone.items()}
            variances = [change for _, change in alone.values()]
            whole = together(self._baseline, list(emulated_alone.values()), variances)
            missed = self.interactions.missed(self._baseline, emulated_alone)
            common = missed.common
            whole = replace(
                whole,
                times=whole.times * np.exp(missed.moved)[..., None],
                variance=whole.variance + missed.own**2,
            )
        return self._spread(whole, delay, common)

    def flight(self, hypothesis: Hypothesis, values: Array, profile: ForceProfile) -> Marks:
        """Predict the marks of the flight at ``values`` (m, p) of a hypothesis."""
        self._parts(hypothesis, values)
        return self.flights.at(hypothesis, values, profile)

    def _parts(self, hypothesis: Hypothesis, values: Array) -> dict[str, Array]:
        """Return the values of each effect, (m, p) each."""
        parts, start = {}, 0
        for name in hypothesis:
            if name not in self.effects:
                raise InputError(
                    f"the bank does not have the effect '{name}'; "
                    f"{did_you_mean(name, self.effects)}"
                )
            count = len(self.effects[name].parameters)
            parts[name] = values[:, start : start + count]
            start += count
        return parts

    @cached_property
    def _baseline(self) -> Emulated:
        return _stacked([self._weighted(cell, None) for cell in range(len(self.bank.settings))])

    def _weighted(self, cell: int, weights: Array | None) -> Emulated:
        """Return the baseline with weights (m, n) on its angles."""
        times = self.bank.baseline[cell]
        given = np.ones((1, times.size)) if weights is None else weights
        ended, known = np.isfinite(times), ~np.isnan(times)
        total = np.maximum((given * known).sum(axis=1), 1e-12)
        share = (given * ended).sum(axis=1) / total
        fast = self._soon[cell]
        found = binned(fast, SHARES, given) if ended.any() else None
        if found is None:
            never = np.full((len(given), SHARES), self.bank.settings[cell].clutch.timeout)
            quarter, rare = (
                np.full(len(given), 0.25),
                np.full(len(given), self.outliers.share[cell]),
            )
            return Emulated(never, share, np.full(len(given), NONE**2), quarter, rare)
        mean, soon = found.mean(axis=1), np.isfinite(fast)
        part = np.maximum((given * soon).sum(axis=1) / total, 1e-12)
        apart = np.where(soon, fast, 0.0) - soon * mean[:, None]
        series = given * apart / (mean * part)[:, None]
        count = total**2 / (given**2 * known).sum(axis=1)
        likely = (share * count + 0.5) / (count + 1.0)
        doubt = likely * (1.0 - likely) / (count + 2.0)
        rare = (share - part) * count + PRIOR * self.outliers.share[cell]
        return Emulated(found, share, even_variance(series), doubt, rare / (share * count + PRIOR))

    def _read(self, parts: dict[str, Array], count: int) -> tuple[Emulated | None, Array]:
        """Weight the baseline's angles, None without weights, and add up delays (C or 1, m)."""
        if not parts:
            return None, np.zeros((1, count))
        rows = np.concatenate(list(parts.values()), axis=1)
        delay, concentration, centre = self._readings(tuple(parts), rows)
        if not concentration.any():
            return None, delay
        every = enumerate(zip(self.bank.settings, self.bank.angles, strict=True))
        turns = [(cell, angles / one.clutch.dog.pitch_angle) for cell, (one, angles) in every]
        wide = len(turns), count
        sharp, middle = np.broadcast_to(concentration, wide), np.broadcast_to(centre, wide)
        weights = [angle_weights(t, sharp[c][:, None], middle[c][:, None]) for c, t in turns]
        return _stacked([self._weighted(cell, one) for cell, one in enumerate(weights)]), delay

    def _readings(self, names: tuple[str, ...], rows: Array) -> tuple[Array, Array, Array]:
        """Return delay, concentration and centre of benches that only read otherwise, (C, m) each.

        Where all operating points read alike the first axis is 1.
        """

        def at(setting: Setting, rows: Array) -> Array:
            read = [Level(names, tuple(r)).setting(self.effects, setting) for r in rows.tolist()]
            return np.array([(s.delay - setting.delay, s.concentration, s.centre) for s in read]).T

        # An effect may ask for the operating point; most do not, and those are read once.
        few = rows[:: max(1, len(rows) // PROBES)][:PROBES]
        first, *others = self.bank.settings
        alike = all(np.allclose(at(one, few), at(first, few), atol=1e-12) for one in others)
        settings = (first,) if alike else (first, *others)
        delay, concentration, centre = np.stack([at(one, rows) for one in settings], axis=1)
        return delay, concentration, centre

    @cached_property
    def interactions(self) -> Interactions:
        """Laws of combination from the simulated pairs."""
        return Interactions.of(self.bank)

    def _spread(self, whole: Emulated, delay: Array, common: Array) -> Prediction:
        """Make the prediction from what acts on the shifts, and delays of the reading."""
        mean = whole.times.mean(axis=-1)
        ratio = mean / self._baseline.times.mean(axis=-1)
        variance = whole.variance * mean**2 + self._other[:, None] * ratio**2
        n = self.bank.baseline.shape[1]
        times = whole.times + delay[..., None]
        parts = {
            "engaged": (whole.engaged * n + 0.5) / (n + 1.0),
            "error": np.sqrt(variance),
            "engaged_error": np.sqrt(whole.engaged_variance),
            "common": common * mean,
            "outlier_share": whole.outlier_share,
            "behind": self.outliers.mean[:, None],
            "behind_sd": self.outliers.sd[:, None],
            "delay": delay,
        }
        # Constants are repeated for each value.
        shape = np.broadcast_shapes(mean.shape, delay.shape)
        wide = np.broadcast_to(times, (*shape, times.shape[-1]))
        return Prediction(wide, **{name: np.broadcast_to(p, shape) for name, p in parts.items()})

    @cached_property
    def _other(self) -> Array:
        """Variance from numerics, by operating point, s2, (C,)."""
        return np.array([self._other_of(cell) for cell in range(len(self.bank.settings))])

    def _other_of(self, cell: int) -> float:
        times = self._soon[cell]
        ended = times[np.isfinite(times)]
        mean, scatter = self.bank.numerics
        spread = float(ended.std(ddof=1)) if ended.size > 1 else 0.0
        return spread**2 * (mean**2 + scatter**2 / max(1, ended.size))


def _weighed(weights: Array, levels: Array) -> Array:
    """Sum levels (C, N) by weights (C, m, N), (C, m)."""
    return np.stack([w @ level for w, level in zip(weights, levels, strict=True)])


def _stacked(emulated_alone: list[Emulated]) -> Emulated:
    """Gather what is emulated at each operating point."""
    return Emulated(
        *(np.stack([getattr(one, f.name) for one in emulated_alone]) for f in fields(Emulated))
    )
