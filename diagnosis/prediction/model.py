r"""Prediction of shift times under any set of effects, at a data set's operating points.

Each level of a simulated effect gives four numbers an operating point: logarithm of the mean and of
the standard deviation of timely shifts, share of late ones, logit of the share that engages. Their
changes from the baseline at the same angles are interpolated over the effect's parameters. Of
several effects the changes of the mean add,

.. math:: \mu = \mu_0 \Bigl(1 + \sum_e (e^{y_e} - 1)\Bigr), \qquad
          \Delta = \tfrac{2}{5}\,\mu_0 \Bigl(e^{\sum_e y_e} - 1 - \sum_e (e^{y_e} - 1)\Bigr),

where :math:`\Delta` is the error that all operating points have in common, until the effects are
simulated together. Then a Gaussian process over the parameters carries what these simulations
differ by from the rule. A dead time adds itself exactly; relative angles that are not uniform are
weights on the baseline's angles.

A late shift passes at least half a slot behind the median; see ``late_times``.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from scipy.interpolate import PchipInterpolator, RBFInterpolator
from scipy.special import expit, logit

from dogshape.diagnosis.bench.bench_data import Bench
from dogshape.diagnosis.bench.sense import DELAY, REVERSED, forward
from dogshape.diagnosis.prediction.simulations import (
    ANGLES,
    JOINT_ANGLES,
    Level,
    Simulated,
    coordinate,
    settings_of,
    simulate,
    with_wide_range,
)
from dogshape.diagnosis.settings import Settings
from dogshape.diagnosis.terms import Array, Hypothesis
from dogshape.sim.effect import Effect, Parameter
from dogshape.sim.errors import DogshapeError
from dogshape.sim.setting import Sensor, Setting, angle_weights
from dogshape.sim.statistics.numerical_error import Runner

#: Properties of the contact that no data set of shifts may name.
NUISANCES = ("contact_dissipation", "contact_stiffness")
FAR = 8.0  #: distances of the 10 % quantile behind the median, from which a shift is late
LEAST_FAR = 8e-3  #: s behind the median, at least
SLOT = 0.5  #: of the passing time of a slot behind the median, at least
SLOTS = 5.0  #: slots that a late shift passes, where too few simulated ones are late
ENOUGH_LATE = 8  #: late shifts from which their delays are known
LEAST_SD = 5e-4  #: s, resolution of a shift time
POOLED = 10.0  #: shifts that the share of late ones at all levels counts as at each
COMBINED = 0.4  #: error of changes that add, over what they differ by from those that multiply
LEAST_PART = 0.5  #: of the product, below which added changes of shorter times do not fall
LENGTH, NUGGET = 0.4, 0.05  #: of residuals of joint levels over the unit cube: length, noise share
MOMENTS = 4
TRIED = 7  #: values of each parameter at which the range of an effect is examined


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
        columns = [_at(p, shares[:, k]) for k, p in enumerate(self.parameters)]
        return np.stack(columns, axis=1) if columns else np.zeros((len(shares), 0))

    def columns(self, name: str) -> slice:
        """Find the columns of an effect's parameters."""
        start = 0
        for effect in self.effects:
            end = start + len(effect.parameters)
            if effect.name == name:
                return slice(start, end)
            start = end
        raise KeyError(name)


def _at(parameter: Parameter, shares: Array) -> Array:
    low, high = parameter.low, parameter.high
    if parameter.scale == "uniform":
        return np.asarray(low + shares * (high - low))
    return np.asarray(low * (high / low) ** shares)


@dataclass(frozen=True)
class Predicted:
    """Shift times that a hypothesis predicts, for m values of its parameters at C points.

    Parameters
    ----------
    mean, sd : of timely shifts that engage, dead time included, s, (m, C).
    error : standard error of ``mean`` by angles and effect laws, s, (m, C).
    common : error that all points share with its sign: effects together against alone, s, (m, C).
    late : share of late shifts among those that engage, (m, C).
    engaged : share that engages before the time-out, (m, C).
    delay : dead time within ``mean``, s, (m, C).
    """

    mean: Array
    sd: Array
    error: Array
    common: Array
    late: Array
    engaged: Array
    delay: Array

    def only(self, rows: object) -> Predicted:
        """Select some of the values."""
        return Predicted(*(getattr(self, name)[rows] for name in self.__dataclass_fields__))

    @staticmethod
    def joined(parts: Sequence[Predicted]) -> Predicted:
        """Join the values of several predictions."""
        names = Predicted.__dataclass_fields__
        return Predicted(*(np.concatenate([getattr(p, n) for p in parts]) for n in names))


@dataclass(frozen=True)
class _Joint:
    """Residuals of effects simulated together: shares (K, d) and residuals (K, C, MOMENTS)."""

    shares: Array
    residuals: Array

    def at(self, shares: Array) -> tuple[Array, Array]:
        """Predict residuals (m, C, MOMENTS), and the share of their variance that is left (m,)."""
        gram = _kernel(self.shares, self.shares) + NUGGET * np.eye(len(self.shares))
        known = _kernel(shares, self.shares)
        weights = np.linalg.solve(gram, known.T).T
        left = np.clip(1.0 - (weights * known).sum(axis=1), 0.0, 1.0)
        return np.tensordot(weights, self.residuals, axes=1), left


def _kernel(one: Array, other: Array) -> Array:
    square = ((one[:, None] - other[None]) ** 2).sum(axis=2)
    return np.asarray(np.exp(-0.5 * square / LENGTH**2))


@dataclass(frozen=True)
class Model:
    """Predictions of a clutch at a data set's operating points.

    Parameters
    ----------
    effects : of hypotheses, by name, with their wide ranges.
    simulated : baseline and levels.
    nuisances : properties of the contact that are integrated under every hypothesis.
    law : error of an effect's law, as a share of the change that it makes.
    turned : of the reversed sense of rotation, where that is a hypothesis.
    joint : effects that were simulated together.
    """

    effects: Mapping[str, Effect]
    simulated: Simulated
    nuisances: Mapping[str, Effect]
    law: float
    turned: Model | None = None
    joint: Mapping[Hypothesis, _Joint] = field(default_factory=dict)

    @property
    def settings(self) -> tuple[Setting, ...]:
        """Baseline of each operating point."""
        return self.simulated.settings

    @property
    def setting(self) -> Setting:
        """Baseline of the first operating point."""
        return self.simulated.settings[0]

    @property
    def cells(self) -> int:
        """Number of operating points."""
        return len(self.simulated.settings)

    @cached_property
    def waits(self) -> Array:
        """Time in which the rings turn by one pitch, at most the time-out, s, (C,)."""
        return np.array([wait_of(one) for one in self.settings])

    @cached_property
    def base(self) -> Array:
        """Moments of the baseline at all angles, (C, MOMENTS)."""
        return self._moments(self.simulated.baseline)

    @cached_property
    def shape(self) -> Array:
        """Excess kurtosis of timely shifts of the baseline, (C,)."""
        times = timely(self.simulated.baseline, self.waits)
        middle = np.nan_to_num(np.nanmean(times, axis=1, keepdims=True))
        parts = np.nan_to_num(times - middle)
        count = np.maximum(1, np.isfinite(times).sum(axis=1))
        second = np.maximum((parts**2).sum(axis=1) / count, LEAST_SD**2)
        return np.clip((parts**4).sum(axis=1) / count / second**2 - 3.0, -1.5, 12.0)

    @cached_property
    def _every(self) -> tuple[Array, Array]:
        """Times of the baseline and all levels, (C, n), and which of them are late."""
        levels = np.moveaxis(self.simulated.times, 1, 0)
        late = [late_times(row, self.waits[:, None]) for row in (levels,)]
        base = late_times(self.simulated.baseline, self.waits)
        times = np.hstack([self.simulated.baseline, levels.reshape(self.cells, -1)])
        return times, np.hstack([base, late[0].reshape(self.cells, -1)])

    @cached_property
    def pooled_late(self) -> Array:
        """Share of late shifts over baseline and all levels, (C,)."""
        times, late = self._every
        return (late.sum(axis=1) + 0.5) / (np.isfinite(times).sum(axis=1) + 50.0)

    @cached_property
    def behind(self) -> tuple[Array, Array]:
        """Mean and standard deviation of a late shift's delay behind timely ones, s, (C,) each.

        They are those of all levels. Where hardly any shift is late, a late one passes ``SLOTS``
        slots, and its delay scatters as much.
        """
        times, late = self._every
        middle = np.array(
            [np.median(row[np.isfinite(row)]) if np.isfinite(row).any() else 0.0 for row in times]
        )
        levels = np.moveaxis(self.simulated.times, 1, 0)
        own = _quantile(
            np.sort(np.where(np.isfinite(levels), levels, np.inf), -1),
            np.isfinite(levels).sum(-1),
            0.5,
        )
        medians = np.hstack(
            [
                np.repeat(middle[:, None], self.simulated.baseline.shape[1], 1),
                np.repeat(own, ANGLES, 1),
            ]
        )
        timeout = np.array([one.clutch.timeout for one in self.settings])
        mean = np.minimum(SLOTS * self.waits, 0.5 * timeout)
        sd = mean.copy()
        for cell in range(self.cells):
            mine = (times[cell] - medians[cell])[late[cell]]
            if mine.size >= ENOUGH_LATE:
                mean[cell], sd[cell] = mine.mean(), mine.std(ddof=1)
        return mean, sd

    def space(self, hypothesis: Hypothesis) -> Space:
        """Find the parameters of a hypothesis."""
        return Space(tuple(self.effects[name] for name in forward(hypothesis)), self.setting)

    def predict(self, hypothesis: Hypothesis, shares: Array) -> Predicted:
        """Predict a hypothesis at shares (m, p) of its ranges."""
        if REVERSED in hypothesis:
            assert self.turned is not None, "the reversed sense is asked for where it is simulated"
            return self.turned.predict(forward(hypothesis), shares)
        space = self.space(hypothesis)
        values = space.values(shares)
        count, base = len(values), np.exp(self.base[:, 0])
        added, logs = np.tile(base, (count, 1)), np.zeros((count, self.cells))
        rest = np.zeros((count, self.cells, MOMENTS - 1))
        square, delay = np.zeros((count, self.cells)), np.zeros((count, self.cells))
        for name in hypothesis:
            change, later = self.changes(name, values[:, space.columns(name)])
            added += base * np.expm1(change[..., 0])
            logs += change[..., 0]
            rest += change[..., 1:]
            square += change[..., 0] ** 2
            delay += later
        product = base * np.exp(logs)
        added = np.maximum(added, LEAST_PART * product)
        common = COMBINED * (product - added)
        if joint := self.joint.get(self.acting(hypothesis)):
            found, left = joint.at(shares[:, self.acting_columns(space)])
            added = added * np.exp(found[..., 0])
            rest = rest + found[..., 1:]
            common = common * np.sqrt(left)[:, None]
        sd = np.exp(self.base[:, 1] + rest[..., 0] + np.log(added / product))
        sd = np.clip(sd, LEAST_SD, np.maximum(added, LEAST_SD))
        error = np.hypot(0.5 * sd / ANGLES**0.5, self.law * np.sqrt(square) * added)
        late = np.clip(self.base[:, 2] + rest[..., 1], 1e-3, 0.9)
        engaged = expit(self.base[:, 3] + rest[..., 2])
        return Predicted(added + delay, sd, error, common, late, engaged, delay)

    def acting(self, hypothesis: Hypothesis) -> Hypothesis:
        """List the effects of a hypothesis that are simulated, not only read."""
        return tuple(name for name in forward(hypothesis) if name not in self.read_only)

    @cached_property
    def read_only(self) -> frozenset[str]:
        """Effects that change the reading of a shift alone."""
        return frozenset(n for n, e in self.effects.items() if reads_only(e, self.setting))

    def possible(self, hypothesis: Hypothesis, shares: Array) -> Array:
        """Mark shares (m, p) of which there is a bench, (m,)."""
        space = self.space(hypothesis)
        values = space.values(shares)
        found = np.ones(len(values), dtype=bool)
        for effect in space.effects:
            if effect.name in self._bounded:
                mine = values[:, space.columns(effect.name)]
                names = [p.name for p in effect.parameters]
                for k in np.flatnonzero(found):
                    given = dict(zip(names, mine[k].tolist(), strict=True))
                    found[k] = effect.possible(self.setting, given)
        return found

    @cached_property
    def _bounded(self) -> frozenset[str]:
        """Effects of which some values within the range give no bench."""
        found = set()
        for name, effect in self.effects.items():
            ticks = np.linspace(0.0, 1.0, TRIED).tolist()
            for row in itertools.product(*[ticks] * len(effect.parameters)):
                given = {p.name: p.at(s) for p, s in zip(effect.parameters, row, strict=True)}
                if not effect.possible(self.setting, given):
                    found.add(name)
                    break
        return frozenset(found)

    def changes(self, name: str, values: Array) -> tuple[Array, Array]:
        """Compute changes of the moments (m, C, MOMENTS) and dead times (m, C) by an effect."""
        effect = self.effects.get(name) or self.nuisances[name]
        if name in self.read_only:
            return self._read(effect, values)
        if name not in self._curves:
            self._curves[name] = self._curve(effect)
        return self._curves[name](values)

    @cached_property
    def _curves(self) -> dict[str, Callable[[Array], tuple[Array, Array]]]:
        return {}

    def _curve(self, effect: Effect) -> Callable[[Array], tuple[Array, Array]]:
        """Build the interpolator of an effect's changes over its parameters."""
        places = self.simulated.of((effect.name,))
        x = self._coordinates(effect, np.array([self.simulated.levels[k].values for k in places]))
        moments = self._moments(self.simulated.times[places])
        y = _filled(moments - self._moments(self.simulated.base), x)
        neutral = np.array([[p.neutral_of(self.setting) for p in effect.parameters]])
        x, y = np.vstack([x, self._coordinates(effect, neutral)]), np.vstack([y, 0.0 * y[:1]])
        delays = np.vstack([self.simulated.delays[places], np.zeros((1, self.cells))])
        whole = np.concatenate([y.reshape(len(y), -1), delays], axis=1)
        if not effect.parameters:
            at = lambda v: np.tile(whole[0], (len(v), 1))  # noqa: E731
        elif len(effect.parameters) == 1:
            order = np.unique(np.round(x[:, 0], 9), return_index=True)[1]
            curve, low, high = PchipInterpolator(x[order, 0], whole[order]), x.min(), x.max()
            at = lambda v: curve(np.clip(v[:, 0], low, high))  # noqa: E731
        else:
            extra = self._idle_places(effect, x)
            x, whole = (
                np.vstack([x, extra]),
                np.vstack([whole, np.zeros((len(extra), whole.shape[1]))]),
            )
            low, wide = x.min(axis=0), np.ptp(x, axis=0)
            order = np.unique(np.round((x - low) / wide, 9), axis=0, return_index=True)[1]
            x, whole = x[order], whole[order]
            plane = RBFInterpolator((x - low) / wide, whole, kernel="linear")
            at = lambda v: plane((v - low) / wide)  # noqa: E731
        size = self.cells * MOMENTS

        def changes(values: Array) -> tuple[Array, Array]:
            found = at(self._coordinates(effect, values))
            return found[:, :size].reshape(-1, self.cells, MOMENTS), found[:, size:]

        return changes

    def _idle_places(self, effect: Effect, x: Array) -> Array:
        """List places at which the first parameter is neutral and the others change nothing."""
        neutral = effect.neutral(self.setting)
        first = effect.parameters[0]
        ends = [{**neutral, p.name: v} for p in effect.parameters[1:] for v in (p.low, p.high)]
        if not all(
            effect.possible(self.setting, given)
            and effect.apply(self.setting, given) == self.setting
            for given in ends
        ):
            return np.zeros((0, x.shape[1]))
        ticks = np.linspace(x[:, 1].min(), x[:, 1].max(), 5)
        start = coordinate(first, np.array([neutral[first.name]]), self.setting)[0]
        return np.array([[start, tick] for tick in ticks])

    def _coordinates(self, effect: Effect, values: Array) -> Array:
        columns = [
            coordinate(p, values[:, k], self.setting) for k, p in enumerate(effect.parameters)
        ]
        return np.stack(columns, axis=1) if columns else np.zeros((len(values), 0))

    def _read(self, effect: Effect, values: Array) -> tuple[Array, Array]:
        """Compute the changes by an effect of the reading: dead time, weights of the angles."""
        change = np.zeros((len(values), self.cells, MOMENTS))
        delay, uneven = np.zeros(len(values)), np.zeros((len(values), 2))
        if effect.name not in self._slopes:
            self._slopes[effect.name] = self._dead_time(effect)
        slope = self._slopes[effect.name]
        if slope is not None:
            delay = slope * values[:, 0]
        else:
            uneven = np.array([self._reading(effect, row)[1:] for row in values.tolist()])
            delay = np.array([self._reading(effect, row)[0] for row in values.tolist()])
        if uneven.any():
            change = self._weighted(uneven[:, :1, None], uneven[:, 1:, None])
        return change, np.tile(delay[:, None], self.cells)

    @cached_property
    def _slopes(self) -> dict[str, float | None]:
        return {}

    def _dead_time(self, effect: Effect) -> float | None:
        """Compute the dead time for each unit of the only parameter; None for any other effect."""
        if len(effect.parameters) != 1:
            return None
        (only,) = effect.parameters
        ends = np.array([only.low, 0.5 * (only.low + only.high), only.high])
        found = np.array([self._reading(effect, [value]) for value in ends.tolist()])
        slope = float(found[2, 0] / ends[2])
        return slope if np.allclose(found, np.outer(slope * ends, [1.0, 0.0, 0.0])) else None

    def _reading(self, effect: Effect, row: list[float]) -> tuple[float, float, float]:
        """Give dead time, concentration and centre; none where there is no such bench."""
        names = [p.name for p in effect.parameters]
        try:
            changed = effect.apply(self.setting, dict(zip(names, row, strict=True)))
        except DogshapeError:
            return 0.0, 0.0, 0.0
        return changed.delay - self.setting.delay, changed.concentration, changed.centre

    def _weighted(self, concentration: Array, centre: Array) -> Array:
        """Compute the changes by relative angles that are not uniform, (m, C, MOMENTS)."""
        pitch = np.array([one.clutch.dog.pitch_angle for one in self.settings])
        turns = self.simulated.angles / pitch[:, None]
        weights = angle_weights(turns, concentration, centre)
        times = self.simulated.baseline
        late, ended = late_times(times, self.waits), np.isfinite(times)
        kept = weights * (ended & ~late)
        whole = np.maximum(kept.sum(axis=2), 1e-9)
        known = np.where(ended, times, 0.0)
        mean = (kept * known).sum(axis=2) / whole
        square = (kept * (known - mean[..., None]) ** 2).sum(axis=2) / whole
        share = (weights * ended).sum(axis=2) / weights.sum(axis=2)
        lately = (weights * late).sum(axis=2) / np.maximum((weights * ended).sum(axis=2), 1e-9)
        change = np.stack(
            [
                np.log(np.maximum(mean, LEAST_SD)) - self.base[:, 0],
                0.5 * np.log(np.maximum(square, LEAST_SD**2)) - self.base[:, 1],
                lately - self.base[:, 2],
                logit(np.clip(share, 0.01, 0.99)) - self.base[:, 3],
            ],
            axis=-1,
        )
        return change

    def _moments(self, times: Array) -> Array:
        """Compute the moments of times (..., C, n), (..., C, MOMENTS)."""
        late = late_times(times, self.waits)
        ended = np.isfinite(times)
        count = (ended & ~late).sum(axis=-1)
        known = np.where(ended & ~late, times, 0.0)
        mean = known.sum(axis=-1) / np.maximum(1, count)
        square = np.where(ended & ~late, times - mean[..., None], 0.0) ** 2
        sd = np.sqrt(square.sum(axis=-1) / np.maximum(1, count - 1))
        tried = (~np.isnan(times)).sum(axis=-1)
        pooled = (late.sum(axis=-1) + POOLED * self.pooled_late) / (ended.sum(axis=-1) + POOLED)
        engaged = (ended.sum(axis=-1) + 0.5) / (tried + 1.0)
        with np.errstate(divide="ignore"):
            return np.stack(
                [
                    np.where(count > 0, np.log(np.maximum(mean, 1e-6)), np.nan),
                    np.where(count > 1, np.log(np.maximum(sd, LEAST_SD)), np.nan),
                    pooled,
                    logit(engaged),
                ],
                axis=-1,
            )

    def level_of(self, hypothesis: Hypothesis, shares: Array) -> Level:
        """Build the level of the acting effects of a hypothesis at shares (p,)."""
        space = self.space(hypothesis)
        acting = self.acting_columns(space)
        return Level(self.acting(hypothesis), tuple(space.values(shares[None])[0, acting].tolist()))

    def with_joint(self, hypothesis: Hypothesis, shares: Array, times: Array) -> Model:
        """Add simulations of effects together.

        Parameters
        ----------
        hypothesis : acting effects.
        shares : of their ranges, (K, p).
        times : simulated at every other angle of the levels, s, (K, C, JOINT_ANGLES).
        """
        alone = replace(self, joint={})
        base = self._moments(self.simulated.base[:, :: ANGLES // JOINT_ANGLES])
        found = self._moments(times) - base
        space = self.space(hypothesis)
        values = space.values(shares)
        ruled = np.zeros_like(found)
        growth = np.zeros(found.shape[:2])
        for name in hypothesis:
            change, _ = alone.changes(name, values[:, space.columns(name)])
            ruled += change
            growth += np.expm1(change[..., 0])
        product = np.exp(ruled[..., 0])
        added = np.maximum(1.0 + growth, LEAST_PART * product)
        ruled[..., 1] += np.log(added / product)
        ruled[..., 0] = np.log(added)
        residuals = np.nan_to_num(found - ruled)
        if before := self.joint.get(hypothesis):
            shares = np.vstack([before.shares, shares])
            residuals = np.concatenate([before.residuals, residuals])
        return replace(self, joint={**self.joint, hypothesis: _Joint(shares, residuals)})

    def acting_columns(self, space: Space) -> Array:
        """Find the columns of the effects that are simulated, (k,)."""
        columns = [
            np.arange(len(space.parameters))[space.columns(name)]
            for name in self.acting(space.hypothesis)
        ]
        return np.concatenate(columns) if columns else np.zeros(0, dtype=int)


def build_models(
    bench: Bench, effects: Mapping[str, Effect], settings: Settings, run: Runner
) -> dict[str, Model]:
    """Build the models of a data set, by the place where the displacement may be read.

    ``run`` simulates blocks, with whatever it keeps of earlier ones.
    """
    places: tuple[Sensor, ...] = ("sleeve", "actuator")
    if bench.record.displacement_at != "unknown":
        places = (bench.record.displacement_at,)
    found: dict[str, Model] = {}
    for place in places:
        plain = settings_of(bench, place)
        wide = {n: with_wide_range(e, plain[0]) for n, e in effects.items()}
        measured = {one.effect for one in bench.measured}
        nuisances = {n: wide.pop(n) for n in NUISANCES if n in wide and n not in measured}
        turned = None
        if wide.pop(REVERSED, None) is not None:
            other = [one.with_point(mismatch=0.0 - one.point.mismatch) for one in plain]
            known = bench.record.sense == "known"
            mine = {n: e for n, e in wide.items() if not known or reads_only(e, plain[0])}
            turned = Model(mine, simulate(mine, other, run), {}, settings.law)
        levels = simulate({**wide, **nuisances}, plain, run)
        if bench.record.time_zero == "force":
            wide.pop(DELAY, None)
        found[place] = Model(wide, levels, nuisances, settings.law, turned)
    return found


def reads_only(effect: Effect, setting: Setting) -> bool:
    """Check that an effect changes the reading of a shift alone, so that none is simulated."""
    for share in (0.3, 0.9):
        given = {p.name: p.at(share) for p in effect.parameters}
        try:
            changed = effect.apply(setting, given)
        except DogshapeError:
            return False
        if (changed.clutch, changed.point) != (setting.clutch, setting.point):
            return False
    return True


def wait_of(setting: Setting) -> float:
    """Compute the time in which the rings turn by one pitch, at most the time-out, s."""
    slip, timeout = abs(setting.point.mismatch), setting.clutch.timeout
    return min(timeout, setting.clutch.dog.pitch_angle / slip) if slip else timeout


def late_times(times: Array, waits: Array) -> Array:
    """Mark late shifts among times (..., C, n) of operating points with ``waits`` (C,), s.

    A late shift lies behind the median by half the passing time of a slot, by ``FAR`` distances of
    the 10 % quantile from it, and by ``LEAST_FAR``. The fast side does not move with late shifts.
    """
    ended = np.isfinite(times)
    ordered = np.sort(np.where(ended, times, np.inf), axis=-1)
    count = ended.sum(axis=-1)
    fast, middle = (_quantile(ordered, count, share) for share in (0.1, 0.5))
    far = np.maximum(FAR * (middle - fast), np.maximum(SLOT * waits, LEAST_FAR))
    return ended & (times > (middle + far)[..., None])


def _quantile(ordered: Array, count: Array, share: float) -> Array:
    """Compute a quantile of the first ``count`` of ordered times (..., n), (...); 0 for none."""
    place = share * np.maximum(count - 1, 0)
    below = np.floor(place).astype(int)
    above = np.minimum(below + 1, np.maximum(count - 1, 0))
    low, high = (np.take_along_axis(ordered, k[..., None], -1)[..., 0] for k in (below, above))
    known = count > 0
    low, high = np.where(known, low, 0.0), np.where(known, high, 0.0)
    return np.asarray(low + (place - below) * (high - low))


def timely(times: Array, waits: Array) -> Array:
    """Replace late shifts and those that did not engage by NaN."""
    return np.where(np.isfinite(times) & ~late_times(times, waits), times, np.nan)


def _filled(changes: Array, x: Array) -> Array:
    """Take unknown changes (L, C, MOMENTS) from the nearest level, else as none."""
    changes = changes.copy()
    apart = np.linalg.norm((x[:, None] - x[None]) / np.maximum(np.ptp(x, axis=0), 1e-9), axis=2)
    for _, cell, moment in zip(*np.nonzero(np.isnan(changes)), strict=True):
        column = changes[:, cell, moment]
        known = np.flatnonzero(np.isfinite(column))
        for level in np.flatnonzero(np.isnan(column)):
            column[level] = column[known[apart[level, known].argmin()]] if known.size else 0.0
    return changes
