r"""Prediction of shift times under any set of effects, at a data set's operating points.

Each level of a simulated effect gives five moments: logarithms of mean and standard deviation of
timely shifts, share of late ones, logit of the share that engages, logarithm of the kurtosis. Their
changes from the baseline at the same angles are interpolated over the effect's parameters. Of
several effects the time *T* until the gap is closed is integrated
(``diagnosis.prediction.approaches``); those of the time *E* from there on multiply,

.. math:: \mu = T + E_0 e^{\sum_e z_e}, \qquad
          z_e = \ln \frac{E_e}{E_0}, \qquad \Delta = 0.6\,E \sum_{e<f} |z_e z_f|,

where :math:`\Delta` is the standard error of an operating point and that of all in common. Where
that decides, two effects are simulated together: a Gaussian process of what the rule misses, zero
where either is neutral, corrects mean and deviation, and its error replaces :math:`\Delta`. A dead
time adds itself exactly. Relative angles that are not uniform are weights on the angles of the
baseline and of the other effects' benches; what they change is interpolated between these.
Plausible effects get further benches at their likely draws.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, fields, replace
from typing import NamedTuple

import numpy as np
from scipy.special import expit

from dogshape.diagnosis.prediction.approaches import Approaches
from dogshape.diagnosis.prediction.baseline import (
    MAX_KURTOSIS,
    MIN_KURTOSIS,
    Baseline,
    approach_of,
)
from dogshape.diagnosis.prediction.curve import (
    MIN_CONTACT_SHARE,
    MIN_ROOT_RATIO,
    AngleDistribution,
    Changes,
    Curve,
    ParameterSpace,
    coordinates,
)
from dogshape.diagnosis.prediction.emulator import Emulator
from dogshape.diagnosis.prediction.moments import (
    ENGAGED_LOGIT,
    LATE_SHARE,
    LOG_KURTOSIS,
    LOG_MEAN,
    LOG_SD,
    MIN_SD_S,
    MOMENTS,
    Angles,
    Modes,
    mark_late,
    modes_of,
)
from dogshape.diagnosis.prediction.readings import ReadingChange, reading_change
from dogshape.diagnosis.prediction.simulations import (
    Level,
    extremes,
    simulate_benches,
)
from dogshape.diagnosis.settings import Settings
from dogshape.diagnosis.terms import REVERSED, Array, Hypothesis, strip_sense
from dogshape.sim.effect import Effect
from dogshape.sim.errors import DogshapeError
from dogshape.sim.setting import Setting, angle_weights
from dogshape.sim.statistics.blocks import Runner

#: Variance of a change by angles of a bench over that of all changes (measured): of benches at all
#: angles of the baseline, and at those of the levels.
DENSE_NOISE = 5e-4
SPARSE_NOISE = 3e-3
UNEVEN_SD_ERROR = 1.2  #: error of ln deviation by uneven angles, over 1 / number that counts
UNEVEN_MEAN_ERROR = 0.2  #: the same of the mean, of which it is a share
GRID_STEPS = {1: 64, 2: 16}  #: steps of a range between further benches, by number of effects
BENCHES_PER_ROUND = 4  #: further benches that are simulated at once
BENCHES_PER_LOOK = 2  #: the same at the angles of levels, for a first look
#: Errors of the moments of benches at all angles over those of a level (measured).
DENSE_ERRORS = (0.1, 0.25, 0.4, 0.4, 0.4)
CELL_ERROR = 0.008  #: of the mean of all angles over the deviation (measured)
CACHE_SIZE = 256  #: changes of an effect that are kept
RANGE_SHARES = 9  #: values of each parameter at which the range of an effect is examined


@dataclass(frozen=True)
class Prediction:
    """Shift times that a hypothesis predicts, for m values of its parameters at C points.

    All fields are (m, C).
    """

    mean: Array  #: of timely shifts that engage, dead time included, s
    sd: Array  #: standard deviation of these, s
    error: Array  #: standard error of each ``mean`` by angles, effect laws and emulation, s
    emulation_error: Array  #: all error by interpolation between levels, s
    common_error: Array  #: error that all points share: emulation, effects together, s
    late_share: Array  #: late shifts among those that engage
    engaged_share: Array  #: shifts that engage before the time-out
    delay: Array  #: dead time within ``mean``, s
    minor_share: Array  #: timely shifts in the smaller of two modes, 1 for no modes
    main_offset: Array  #: mean of the larger mode behind ``mean``, s
    main_sd: Array  #: standard deviation of the larger mode, s
    kurtosis: Array  #: excess kurtosis of the timely shifts
    log_sd_error: Array  #: standard error of ln ``sd`` by interpolation and uneven angles

    def select(self, index: object) -> Prediction:
        """Select values by an index into (m, C)."""
        return Prediction(*(getattr(self, item.name)[index] for item in fields(self)))

    @staticmethod
    def concatenate(predictions: Sequence[Prediction]) -> Prediction:
        """Concatenate predictions along their values."""
        columns = []
        for item in fields(Prediction):
            columns.append(np.concatenate([getattr(p, item.name) for p in predictions]))
        return Prediction(*columns)


class FurtherBench(NamedTuple):
    """Bench of one or two effects beside the levels."""

    level: Level
    times: Array  #: s, (C, DENSE_FACTOR * ANGLES), NaN where not simulated
    is_dense: bool  #: whether all angles of the baseline are simulated


@dataclass
class _EffectSums:
    """Sums of the changes by effects of a hypothesis, at m values and C operating points."""

    moments: Array  #: changes, (m, C, MOMENTS)
    modes: Modes
    contact_logs: list[Array] = field(default_factory=list)  #: ln time from the closed gap, (m, C)
    reading_log: Array | float = 0.0  #: change of ln mean by effects of the reading, (m, C)
    law_variance: Array | float = 0.0  #: of ln mean by the laws of effects, (m, C)
    delay: Array | float = 0.0  #: s, (m, C)
    emulation_variance: Array | float = 0.0  #: of ln mean by interpolation, (m, C)
    common_variance: Array | float = 0.0  #: the part of it that all points share, (m, C)
    flight: Array | float = 0.0  #: change of the logarithm of the approach's time, (m, C)
    flight_error: Array | float = 0.0  #: error of ``flight``, (m, C)
    slip: Array | float = 0.0  #: change of the mismatch, pitches/s, (m, C)
    log_sd_variance: Array | float = 0.0  #: squared error of ln deviation, (m, C)

    def add(self, change: Changes, share_error: float, law_error: float) -> None:
        """Add the changes by one more effect with the error of its law.

        ``share_error`` is the part in proportion to the change of ln mean, ``law_error`` the other
        one, which does not exceed the change.
        """
        log_change = abs(change.moments[..., LOG_MEAN])
        error = np.hypot(share_error * log_change, np.minimum(log_change, law_error))
        self.moments += change.moments
        self.law_variance = self.law_variance + error**2
        self.delay = self.delay + change.delay
        self.emulation_variance = self.emulation_variance + change.error**2
        self.common_variance = self.common_variance + change.common_share * change.error**2
        self.slip = self.slip + change.slip
        uneven_variance = UNEVEN_SD_ERROR**2 * change.inverse_squared_count
        self.log_sd_variance = self.log_sd_variance + (uneven_variance + change.log_sd_error**2)
        if change.modes is not None:
            self.modes = change.modes


@dataclass(frozen=True)
class Model:
    """Predictions of a clutch at a data set's operating points."""

    effects: Mapping[str, Effect]  #: of hypotheses, by name, with their wide ranges
    baseline: Baseline
    nuisances: Mapping[str, Effect]  #: integrated under every hypothesis
    reading_effects: frozenset[str]  #: names of the effects of the reading of a shift alone
    approaches: Approaches
    constants: Settings  #: that decide an answer
    #: Of the reversed sense of rotation, where that is a hypothesis.
    reversed_model: Model | None = None
    runner: Runner | None = None  #: simulates further benches
    #: Errors of the rule for two effects in ln mean and ln deviation, 2 C moments.
    pair_emulators: Mapping[Hypothesis, Emulator] = field(default_factory=dict)
    further_benches: Mapping[Hypothesis, tuple[FurtherBench, ...]] = field(default_factory=dict)
    _curves: dict[str, Curve] = field(default_factory=dict)
    _limiting_settings: dict[str, list[Setting]] = field(default_factory=dict)
    _cached_changes: dict[object, Changes] = field(default_factory=dict)
    _cached_readings: dict[tuple[object, ...], ReadingChange] = field(default_factory=dict)
    _bench_exists: dict[tuple[object, ...], bool] = field(default_factory=dict)

    @property
    def settings(self) -> tuple[Setting, ...]:
        """Baseline of each operating point."""
        return self.baseline.settings

    @property
    def setting(self) -> Setting:
        """Baseline of the first operating point."""
        return self.baseline.settings[0]

    @property
    def cell_count(self) -> int:
        """Number of operating points."""
        return self.baseline.cell_count

    def space(self, hypothesis: Hypothesis) -> ParameterSpace:
        """Build the parameter space of a hypothesis."""
        effects = tuple(self.effects[name] for name in strip_sense(hypothesis))
        return ParameterSpace(effects, self.setting)

    def predict(self, hypothesis: Hypothesis, shares: Array) -> Prediction:
        """Predict shift times of a hypothesis at shares (m, p) of its ranges."""
        if REVERSED in hypothesis:
            return self._reversed().predict(strip_sense(hypothesis), shares)
        return self.predict_values(hypothesis, self.space(hypothesis).values(shares))

    def _reversed(self) -> Model:
        """Return the model of the reversed sense, which must be simulated."""
        assert self.reversed_model is not None, "the reversed sense is simulated"
        return self.reversed_model

    def predict_values(self, hypothesis: Hypothesis, values: Array) -> Prediction:
        """Predict shift times of a hypothesis without the sense at values (m, p).

        Times of contact multiply; pairs that were simulated together correct that.
        """
        space = self.space(hypothesis)
        contact_effects = self.contact_effects(hypothesis)
        sums = self._sum_changes(space, contact_effects, values)
        mean = self.baseline.mean * np.exp(sums.moments[..., LOG_MEAN])
        contact_share = np.ones_like(mean)
        if len(contact_effects) > 1:
            gap_time = self.baseline.approach.time * np.exp(sums.flight)
            contact_time = self.baseline.contact_time * np.exp(sum(sums.contact_logs))
            mean = (gap_time + contact_time) * np.exp(sums.reading_log)
            contact_share = contact_time / (gap_time + contact_time)
        pair_error = np.zeros_like(mean)
        if not self.pair_emulators.keys() >= {*itertools.combinations(contact_effects, 2)}:
            pair_error = sums.flight_error * (1.0 - contact_share)
        for first, second in itertools.combinations(range(len(contact_effects)), 2):
            pair = (contact_effects[first], contact_effects[second])
            emulator = self.pair_emulators.get(pair)
            if emulator is None:
                product = abs(sums.contact_logs[first] * sums.contact_logs[second])
                pair_error += self.constants.pair_error * contact_share * product
                spread_variance = self.constants.pair_spread_error**2 * product
                sums.log_sd_variance = sums.log_sd_variance + spread_variance
                continue
            # Columns of the emulator are ln mean and ln deviation of one point after the other.
            x = self._pair_coordinates(pair, space, values)
            corrections, errors = emulator.predict(x, moments=2)
            mean = mean * np.exp(corrections[:, ::2])
            sums.moments[..., LOG_SD] += corrections[:, 1::2]
            sums.log_sd_variance = sums.log_sd_variance + errors[:, 1::2] ** 2
            pair_error += errors[:, ::2]
        return self._with_errors(sums, mean, pair_error)

    def _sum_changes(
        self, space: ParameterSpace, contact_effects: Sequence[str], values: Array
    ) -> _EffectSums:
        """Sum the changes by the effects of a hypothesis at values (m, p).

        Effects of the reading come last: uneven angles weigh the times with all other effects.
        """
        shape = (len(values), self.cell_count)
        ones = np.ones(shape)
        modes = Modes(ones, ones, ones, self.baseline.kurtosis * ones)
        sums = _EffectSums(moments=np.zeros((*shape, MOMENTS)), modes=modes)
        approach = self.baseline.approach
        root_change = np.zeros(shape)  # of the root of 1 / time until the gap is closed, relative
        root_error = np.zeros(shape)
        for name in contact_effects:
            change = self.changes(name, values[:, space.columns(name)])
            gap_time = approach.time * np.exp(change.flight)
            contact_time = self.baseline.mean * np.exp(change.moments[..., LOG_MEAN]) - gap_time
            contact_time = np.maximum(contact_time, MIN_CONTACT_SHARE * self.baseline.mean)
            sums.contact_logs.append(np.log(contact_time / self.baseline.contact_time))
            root_change += np.exp(-0.5 * change.flight) - 1.0
            sums.add(change, self.constants.law, self.constants.laws.get(name, 0.0))
        if len(contact_effects) > 1:
            pair_change, root_error = self.approaches.pair_change(space, contact_effects, values)
            root_change += pair_change
        root_ratio = np.maximum(1.0 + root_change, MIN_ROOT_RATIO)
        sums.flight = -2.0 * np.log(root_ratio)
        sums.flight_error = 2.0 * root_error / root_ratio
        for name in space.hypothesis:
            if name not in self.reading_effects:
                continue
            change = self.changes(name, values[:, space.columns(name)])
            if change.angles is not None:
                turn = (approach.pace + sums.slip) * approach.time * np.exp(sums.flight)
                further_turn = turn - approach.pace * approach.time
                x = {
                    effect: self._curve(effect).coordinates(values[:, space.columns(effect)])
                    for effect in contact_effects
                }
                change = self._weigh_angles(change, change.angles, further_turn, x)
            sums.reading_log = sums.reading_log + change.moments[..., LOG_MEAN]
            sums.add(change, self.constants.law, self.constants.laws.get(name, 0.0))
        return sums

    def _with_errors(self, sums: _EffectSums, mean: Array, pair_error: Array) -> Prediction:
        """Build a prediction from the sums of changes and the mean without dead time, s, (m, C).

        ``pair_error`` is the relative error of the mean by pairs of effects, (m, C).
        """
        none = np.zeros_like(mean)
        log_sd = self.baseline.moments[:, LOG_SD] + sums.moments[..., LOG_SD]
        late_share = self.baseline.moments[:, LATE_SHARE] + sums.moments[..., LATE_SHARE]
        engaged_logit = self.baseline.moments[:, ENGAGED_LOGIT] + sums.moments[..., ENGAGED_LOGIT]
        sd = np.clip(np.exp(log_sd), MIN_SD_S, np.maximum(mean, MIN_SD_S))
        emulation_variance = none + sums.emulation_variance
        variance = sums.law_variance + emulation_variance - sums.common_variance + pair_error**2
        mean_error = CELL_ERROR * sd
        kurtosis = (sums.modes.kurtosis + 3.0) * np.exp(sums.moments[..., LOG_KURTOSIS]) - 3.0
        return Prediction(
            mean=mean + sums.delay,
            sd=sd,
            error=np.hypot(mean_error, np.sqrt(variance) * mean),
            emulation_error=np.sqrt(emulation_variance) * mean,
            common_error=np.sqrt(pair_error**2 + sums.common_variance) * mean,
            late_share=np.clip(late_share, 1e-3, self.constants.late_most),
            engaged_share=expit(engaged_logit),
            delay=none + sums.delay,
            minor_share=sums.modes.minor_share,
            main_offset=mean * (sums.modes.main_mean - 1.0),
            main_sd=sd * sums.modes.main_sd,
            kurtosis=np.clip(kurtosis, MIN_KURTOSIS, MAX_KURTOSIS),
            log_sd_error=(none + sums.log_sd_variance) ** 0.5,
        )

    def _pair_coordinates(self, names: Hypothesis, space: ParameterSpace, values: Array) -> Array:
        """Compute unit-cube coordinates of two effects at values (m, p), (m, d)."""
        cubes = [self._curve(name).coordinates(values[:, space.columns(name)]) for name in names]
        return np.hstack(cubes)

    def simulate(
        self, hypothesis: Hypothesis, shares: Array, *, is_dense: bool = True
    ) -> Model | None:
        """Simulate one or two effects near the first of shares (m, p), for all predictions.

        Benches lie on a grid of shares, so that draws which differ a little lead to the same ones.
        They have all angles of the baseline, or those of the levels where not ``is_dense``. None
        where nothing remains to simulate: every bench is there already or does not exist, or all
        effects are of the reading of a shift. Of three effects, the two with the fewest benches
        are simulated.
        """
        if REVERSED in hypothesis:
            return self._simulate_reversed(strip_sense(hypothesis), shares, is_dense=is_dense)
        names = self.contact_effects(hypothesis)
        if self.runner is None or not names:
            return None
        if len(names) > 2:
            pairs = itertools.combinations(names, 2)
            names = min(pairs, key=lambda pair: len(self.further_benches.get(pair, ())))
        space = self.space(hypothesis)
        effect_shares = np.hstack([shares[:, space.columns(name)] for name in names])
        settings_by_level = self._new_levels(names, effect_shares, is_dense=is_dense)
        if not settings_by_level:
            return None
        times = simulate_benches(
            [*settings_by_level.values()],
            self.baseline.simulated,
            self.runner,
            is_dense=is_dense,
        )
        pairs_of_bench = zip(settings_by_level, times, strict=True)
        benches = tuple(FurtherBench(level, row, is_dense) for level, row in pairs_of_bench)
        return self._add_benches(names, benches)

    def _simulate_reversed(
        self, hypothesis: Hypothesis, shares: Array, *, is_dense: bool
    ) -> Model | None:
        """Simulate effects with the reversed sense near the first of shares (m, p)."""
        if self.reversed_model is None:
            return None
        model = self.reversed_model.simulate(hypothesis, shares, is_dense=is_dense)
        return None if model is None else replace(self, reversed_model=model)

    def _add_benches(self, names: Hypothesis, benches: tuple[FurtherBench, ...]) -> Model:
        """Add benches of one or two effects and refit the emulators that depend on them."""
        further = {**self.further_benches, names: (*self.further_benches.get(names, ()), *benches)}
        if len(names) == 2:
            model = replace(self, further_benches=further)
            pairs: list[Hypothesis] = [names]
        else:
            model = self._with_benches(further, names)
            pairs = [pair for pair in self.pair_emulators if names[0] in pair]
        emulators = {pair: model._fit_pair(pair) for pair in pairs}
        return replace(model, pair_emulators={**self.pair_emulators, **emulators})

    def _with_benches(
        self, further: Mapping[Hypothesis, tuple[FurtherBench, ...]], names: Hypothesis
    ) -> Model:
        """Replace the further benches; curves of effects that they change are fitted again."""
        curves = {name: curve for name, curve in self._curves.items() if name not in names}
        return replace(self, further_benches=further, _curves=curves, _cached_changes={})

    def new_effects(self, older: Model) -> set[str]:
        """Collect the effects with benches that an ``older`` model does not have."""
        names = set[str]()
        for effects, benches in self.further_benches.items():
            if len(benches) > len(older.further_benches.get(effects, ())):
                names.update(effects)
        if self.reversed_model is not None and older.reversed_model is not None:
            names |= self.reversed_model.new_effects(older.reversed_model)
        return names

    def _new_levels(
        self, names: Hypothesis, shares: Array, *, is_dense: bool
    ) -> dict[Level, list[Setting]]:
        """Find the first levels on the grid near shares (m, p) without a bench, with settings.

        Where ``is_dense``, without one at all angles.
        """
        steps = GRID_STEPS[len(names)]
        grid_shares = (shares * steps).round() / steps
        benches = self.further_benches.get(names, ())
        tried_levels = {bench.level for bench in benches if bench.is_dense or not is_dense}
        max_count = BENCHES_PER_ROUND if is_dense else BENCHES_PER_LOOK
        settings_by_level = dict[Level, list[Setting]]()
        for values in self.space(names).values(grid_shares).tolist():
            # Rounded, a bench is the same whatever the last digits of a processor's logarithms.
            level = Level(names, tuple(float(f"{value:.6g}") for value in values))
            if level in tried_levels:
                continue
            tried_levels.add(level)
            with suppress(DogshapeError):  # there is no such bench
                settings_by_level[level] = [level.setting(self.effects, s) for s in self.settings]
            if len(settings_by_level) == max_count:
                break
        return settings_by_level

    def _fit_pair(self, names: Hypothesis) -> Emulator:
        """Fit errors of the rule for two effects in ln mean and ln deviation at their benches."""
        benches = self.further_benches[names]
        values = np.array([bench.level.values for bench in benches])
        times = np.array([bench.times for bench in benches])
        p = replace(self, pair_emulators={}).predict_values(names, values)
        rule = np.stack([np.log(p.mean - p.delay), np.log(p.sd)], axis=-1)
        level_angles = self.baseline.level_angle_change[..., :2]
        # All angles lack the error that the levels' angles have in common.
        is_dense = np.array([bench.is_dense for bench in benches])
        misses = np.vstack([self.baseline.moments_of(times)[..., :2] - rule, level_angles])
        misses[:-1][is_dense] += level_angles
        level_error, common_error = (error[:, :2] for error in self.baseline.moment_errors)
        return Emulator.fit(
            x=self._pair_coordinates(names, self.space(names), values),
            neutral=tuple(self._curve(name).emulator.kernel.neutral[0] for name in names),
            changes=misses.reshape(len(misses), -1).T,
            level_error=self._bench_errors(level_error, is_dense),
            common_error=common_error.ravel(),
        )

    @staticmethod
    def _bench_errors(level_error: Array, is_dense: np.ndarray) -> Array:
        """Compute the errors of n benches and of the baseline at the levels' angles, (C M, n + 1).

        ``level_error`` (C, M) is that of M moments of a level.
        """
        dense_factors = np.array(DENSE_ERRORS[: level_error.shape[1]])[:, None]
        factors = np.where(np.append(is_dense, False), dense_factors, 1.0)
        return np.asarray((level_error[..., None] * factors).reshape(level_error.size, -1))

    def possible(self, hypothesis: Hypothesis, shares: Array) -> np.ndarray:
        """Mark shares (m, p) of which there is a bench, (m,)."""
        space = self.space(hypothesis)
        is_possible = np.ones(len(shares), dtype=bool)
        for effect in space.effects:
            limiting = self._limiting(effect)
            if not limiting:
                continue
            for k, row in enumerate(shares[:, space.columns(effect.name)].tolist()):
                key = (effect.name, *row)
                if key not in self._bench_exists:
                    self._bench_exists[key] = all(_exists(effect, row, s) for s in limiting)
                is_possible[k] &= self._bench_exists[key]
        return is_possible

    def _limiting(self, effect: Effect) -> list[Setting]:
        """List the points that decide which values give no bench, none where all give one."""
        if effect.name not in self._limiting_settings:
            ends = extremes(self.settings)
            shares = np.linspace(0.0, 1.0, RANGE_SHARES)
            rows = itertools.product(shares, repeat=len(effect.parameters))
            exists = np.array([[_exists(effect, row, s) for s in ends] for row in rows])
            if exists.all():
                limiting = []
            elif (exists == exists[:, :1]).all():
                limiting = ends[:1]
            else:
                limiting = ends
            self._limiting_settings[effect.name] = limiting
        return self._limiting_settings[effect.name]

    def contact_effects(self, hypothesis: Hypothesis) -> Hypothesis:
        """List the effects of a hypothesis that act on the shift itself, without the sense."""
        return tuple(n for n in strip_sense(hypothesis) if n not in self.reading_effects)

    def changes(self, name: str, values: Array) -> Changes:
        """Compute the changes by an effect at values (m, p); recent results are cached."""
        key = name, values.shape, values.tobytes()
        if key not in self._cached_changes:
            if len(self._cached_changes) >= CACHE_SIZE:
                self._cached_changes.clear()
            if name in self.reading_effects:
                changes = self._reading_changes(self.effects[name], values)
            else:
                changes = self._curve(name).changes(values)
            self._cached_changes[key] = changes
        return self._cached_changes[key]

    def _curve(self, name: str) -> Curve:
        """Look up the curve of an effect, fitted once."""
        if name not in self._curves:
            self._curves[name] = self._fit_curve(self.effects.get(name) or self.nuisances[name])
        return self._curves[name]

    def _fit_curve(self, effect: Effect) -> Curve:
        """Fit the changes by an effect over its benches, moment by moment."""
        simulated = self.baseline.simulated
        indices = simulated.level_indices((effect.name,))
        further = self.further_benches.get((effect.name,), ())
        levels = [simulated.levels[k] for k in indices] + [bench.level for bench in further]
        is_dense = np.array([False] * len(indices) + [bench.is_dense for bench in further])
        level_times = simulated.spread_times(simulated.times[indices])
        rows = [*level_times, *(bench.times for bench in further)]
        times = np.array(rows).reshape(len(levels), *simulated.angles.shape)
        # Coordinates, in the unit cube of levels and neutral values.
        neutral_values = self._neutral_values(effect) if effect.parameters else np.zeros((0, 0))
        x = coordinates(effect, np.array([level.values for level in levels]), self.setting)
        neutral = coordinates(effect, neutral_values, self.setting)
        corners = np.vstack([x[~is_dense], neutral])
        low = corners.min(axis=0)
        width = np.maximum(np.ptp(corners, axis=0), 1e-9)
        # Moments: those of all angles lack the error that the levels' angles have in common.
        level_angles = self.baseline.level_angle_change
        changes = np.vstack([self.baseline.moments_of(times) - self.baseline.moments, level_angles])
        changes[:-1][is_dense] += level_angles
        level_error, common_error = self.baseline.moment_errors
        emulator = Emulator.fit(
            x=np.clip((x - low) / width, 0.0, 1.0),
            neutral=((neutral - low) / width,),
            changes=changes.reshape(len(changes), -1).T,
            level_error=self._bench_errors(level_error, is_dense),
            common_error=common_error.ravel(),
        )
        return Curve(
            effect=effect,
            setting=self.setting,
            low=low,
            width=width,
            gap_time=self.baseline.approach.time,
            emulator=emulator,
            angles=Angles(times, mark_late(times, self.baseline.min_late_delay)),
            is_dense=is_dense,
            exact=self._exact_changes(effect, levels),
        )

    def _exact_changes(self, effect: Effect, levels: Sequence[Level]) -> Array:
        """Compute changes of delay, root of 1 / gap time, and pace by levels, (n, 3 C)."""
        rows = []
        for level in levels:
            settings = [level.setting({effect.name: effect}, s) for s in self.settings]
            approach = approach_of(settings)
            delays = [setting.delay for setting in settings]
            inverse_root = approach.time**-0.5 - self.baseline.approach.time**-0.5
            rows.append((delays, inverse_root, approach.pace - self.baseline.approach.pace))
        return np.array(rows).reshape(len(levels), -1)

    def _neutral_values(self, effect: Effect) -> Array:
        """List neutral values of all parameters, (k, p).

        Where a neutral first parameter idles the others, over the range of the second one.
        """
        neutral = effect.neutral(self.setting)
        values = list(neutral.values())
        further = effect.parameters[1:]
        ends = [{**neutral, p.name: end} for p in further for end in (p.low, p.high)]
        if not ends or not all(self._is_idle(effect, end) for end in ends):
            return np.array([values])
        second = np.linspace(further[0].low, further[0].high, 5).tolist()
        return np.array([values, *([values[0], value, *values[2:]] for value in second)])

    def _is_idle(self, effect: Effect, values: Mapping[str, float]) -> bool:
        """Check that an effect at values leaves the setting unchanged."""
        if not effect.possible(self.setting, values):
            return False
        return effect.apply(self.setting, values) == self.setting

    def _reading_changes(self, effect: Effect, values: Array) -> Changes:
        """Compute the changes by an effect of the reading: dead time, uneven angles."""
        rows = []
        for row in values.tolist():
            key = (effect.name, *row)
            if key not in self._cached_readings:
                self._cached_readings[key] = reading_change(effect, row, self.setting)
            rows.append(self._cached_readings[key])
        delay, concentration, centre = np.array(rows).reshape(-1, 3, 1).swapaxes(0, 1)
        none = np.zeros((len(values), self.cell_count))
        angles = None
        if concentration.any() or centre.any():
            angles = AngleDistribution(concentration, centre)
        moments = np.zeros((*none.shape, MOMENTS))
        return Changes(moments=moments, delay=delay + none, error=none, angles=angles)

    def _weigh_angles(
        self, change: Changes, angles: AngleDistribution, turn: Array, x: Mapping[str, Array]
    ) -> Changes:
        """Weigh the angles of the baseline, and of benches with effects at coordinates (m, d).

        Modes are the baseline's, the centre moved by the further ``turn`` before the rings touch,
        pitches, (m, C).
        """
        baseline_benches = self.baseline.angles
        shape = change.error.shape
        dense_baseline = np.tile([1.0, 0.0], (len(change.error), 1))
        baseline_shares = dense_baseline
        benches = []
        for name, effect_x in x.items():
            curve = self._curve(name)
            noise = np.where(curve.is_dense, DENSE_NOISE, SPARSE_NOISE)
            bench_shares = curve.emulator.weights(effect_x, noise)
            dense_share = bench_shares @ curve.is_dense
            shares = np.stack([dense_share, bench_shares.sum(axis=1) - dense_share], axis=1)
            baseline_shares = baseline_shares - shares
            benches.append((curve.angles, bench_shares))
        moments = np.empty((*shape, MOMENTS))
        angle_variance = np.empty(shape)
        inverse_squares = np.empty(shape)
        modes = []
        ordered = self.baseline.ordered
        for cell in range(self.cell_count):  # all weights at once do not fit a processor's cache
            weights = angle_weights(self.baseline.turns[cell], angles.concentration, angles.centre)
            errors = [baseline_benches.errors(cell, weights, dense_baseline)]
            change_sum = baseline_benches.changes(cell, weights, baseline_shares)
            for bench_angles, bench_shares in benches:
                errors.append(bench_angles.errors(cell, weights, bench_shares))
                change_sum += bench_angles.changes(cell, weights, bench_shares)
            moments[:, cell] = change_sum
            angle_variance[:, cell] = sum(error.variance for error in errors)
            inverse_squares[:, cell] = sum(error.inverse_square for error in errors)
            centre = angles.centre + turn[..., [cell]]
            weights = angle_weights(ordered.turns[cell], angles.concentration, centre)
            modes.append(modes_of(ordered.times[cell], ordered.is_timely[cell], weights))
        log_sd = self.baseline.moments[:, LOG_SD] - self.baseline.moments[:, LOG_MEAN]
        variation = np.exp(log_sd + moments[..., LOG_SD] - moments[..., LOG_MEAN])
        variance = angle_variance * variation**2 + UNEVEN_MEAN_ERROR**2 * inverse_squares
        return change._replace(
            moments=moments,
            error=np.sqrt(variance),
            inverse_squared_count=inverse_squares,
            modes=Modes(*np.stack(modes, axis=2)),
        )


def _exists(effect: Effect, shares: Sequence[float], setting: Setting) -> bool:
    """Check that there is a bench with an effect at shares (p,) of its ranges."""
    values = {p.name: float(p.at(s)) for p, s in zip(effect.parameters, shares, strict=True)}
    return effect.possible(setting, values)
