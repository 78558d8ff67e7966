r"""Prediction of shift times under any set of effects, at a data set's operating points.

Each level of a simulated effect gives five moments: logarithms of mean and standard deviation of
timely shifts, share of late ones, logit of the share that engages, logarithm of the kurtosis. Their
changes from the baseline at the same angles are interpolated over the effect's parameters. Of
several effects those of the time *T* until the gap is closed multiply, and those of the time *E*
from there on,

.. math:: \mu = T_0 \prod_e \frac{T_e}{T_0} + E_0 e^{\sum_e z_e}, \qquad
          z_e = \ln \frac{E_e}{E_0}, \qquad \Delta = 0.7\,\mu \sum_{e<f} |z_e z_f|,

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
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy.special import expit, logit

from dogshape.bench.bench_data import Bench
from dogshape.diagnosis.prediction.curve import (
    MIN_CONTACT_SHARE,
    AngleDistribution,
    Changes,
    Curve,
    ParameterSpace,
    coordinates,
)
from dogshape.diagnosis.prediction.emulator import Emulator
from dogshape.diagnosis.prediction.moments import (
    ENGAGED_LOGIT,
    LATE_DISTANCES,
    LATE_SHARE,
    LOG_KURTOSIS,
    LOG_MEAN,
    LOG_SD,
    MIN_SD_S,
    MOMENTS,
    Angles,
    Modes,
    angle_error,
    mark_late,
    mask_late,
    modes_of,
    quantiles,
)
from dogshape.diagnosis.prediction.simulations import (
    ANGLES,
    DENSE_FACTOR,
    Level,
    SimulatedTimes,
    extremes,
    settings_of,
    simulate,
    simulate_benches,
    widen_ranges,
)
from dogshape.diagnosis.settings import Settings
from dogshape.diagnosis.terms import DELAY, REVERSED, Array, Hypothesis, strip_sense
from dogshape.sim.effect import Effect
from dogshape.sim.errors import DogshapeError
from dogshape.sim.setting import Sensor, Setting, angle_weights
from dogshape.sim.shift.planar import touch_time
from dogshape.sim.statistics.blocks import Runner

MIN_LATE_DELAY_S = 8e-3  #: s, of a late shift behind the median
MIN_LATE_PASSING = 0.5  #: of the passing time of a slot, the same
LATE_SLOTS = 5.0  #: slots that a late shift passes, where too few simulated ones are late
MIN_LATE_COUNT = 8  #: late shifts from which their delays are estimated
LATE_SHARE_PRIOR = 10.0  #: shifts that the share of late ones at all levels counts as at each
PAIR_ERROR = 0.7  #: error of two effects over the product of their changes (measured)
#: Variance of a change by angles of a bench over that of all changes (measured): of benches at all
#: angles of the baseline, and at those of the levels.
DENSE_NOISE = 5e-4
SPARSE_NOISE = 3e-3
UNEVEN_SD_ERROR = 1.2  #: error of ln deviation by uneven angles, over 1 / number that counts
UNEVEN_MEAN_ERROR = 0.2  #: the same of the mean, of which it is a share
GRID_STEPS = {1: 64, 2: 16}  #: steps of a range between further benches, by number of effects
BENCHES_PER_ROUND = 4  #: further benches that are simulated at once
BENCHES_PER_LOOK = 2  #: the same at the angles of levels, for a first look
DENSE_ERROR = DENSE_FACTOR**-0.8  #: error of a moment by all angles over a level's (measured)
#: Errors of a level's moments: of ln mean over the coefficient of variation, of ln deviation, of
#: the share of late shifts over the binomial one, of the logit of those that engage, ln kurtosis.
LEVEL_ERRORS = (0.1, 0.25, 1.0, 0.5, 0.3)
COMMON_ERRORS = (0.04, 0.05, 0.5, 1.0, 0.2)
MIN_KURTOSIS = -1.5  #: excess
MAX_KURTOSIS = 12.0  #: excess
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


class LateDelay(NamedTuple):
    """Delay of a late shift behind timely ones, s, (C,) each."""

    mean: Array
    sd: Array


class Approach(NamedTuple):
    """Motion until the gap is closed, (C,) each."""

    time: Array  #: s
    pace: Array  #: mismatch, pitches/s


class ReadingChange(NamedTuple):
    """Change of the reading of a shift by an effect."""

    delay: float  #: s
    concentration: float  #: of the relative angles
    centre: float  #: of the relative angles, pitches


class FurtherBench(NamedTuple):
    """Bench of one or two effects beside the levels."""

    level: Level
    times: Array  #: s, (C, DENSE_FACTOR * ANGLES), NaN where not simulated
    is_dense: bool  #: whether all angles of the baseline are simulated


class OrderedBaseline(NamedTuple):
    """Baseline of each operating point in the order of its times, (C, A) each."""

    turns: Array  #: relative angles, pitches
    times: Array  #: s
    is_timely: np.ndarray


@dataclass
class _EffectSums:
    """Sums of the changes by effects of a hypothesis, at m values and C operating points."""

    moments: Array  #: changes, (m, C, MOMENTS)
    modes: Modes
    contact_logs: list[Array] = field(default_factory=list)  #: ln time from the closed gap, (m, C)
    reading_log: Array | float = 0.0  #: change of ln mean by effects of the reading, (m, C)
    squared_log: Array | float = 0.0  #: sum of squared changes of ln mean, (m, C)
    delay: Array | float = 0.0  #: s, (m, C)
    emulation_variance: Array | float = 0.0  #: of ln mean by interpolation, (m, C)
    common_variance: Array | float = 0.0  #: the part of it that all points share, (m, C)
    flight: Array | float = 0.0  #: change of the logarithm of the approach's time, (m, C)
    slip: Array | float = 0.0  #: change of the mismatch, pitches/s, (m, C)
    log_sd_variance: Array | float = 0.0  #: squared error of ln deviation, (m, C)

    def add(self, change: Changes) -> None:
        """Add the changes by one more effect."""
        self.moments += change.moments
        self.squared_log = self.squared_log + change.moments[..., LOG_MEAN] ** 2
        self.delay = self.delay + change.delay
        self.emulation_variance = self.emulation_variance + change.error**2
        self.common_variance = self.common_variance + change.common_share * change.error**2
        self.flight = self.flight + change.flight
        self.slip = self.slip + change.slip
        uneven_variance = UNEVEN_SD_ERROR**2 * change.inverse_squared_count
        self.log_sd_variance = self.log_sd_variance + (uneven_variance + change.log_sd_error**2)
        if change.modes is not None:
            self.modes = change.modes


@dataclass(frozen=True)
class Model:
    """Predictions of a clutch at a data set's operating points."""

    effects: Mapping[str, Effect]  #: of hypotheses, by name, with their wide ranges
    simulated: SimulatedTimes  #: baseline and levels
    nuisances: Mapping[str, Effect]  #: integrated under every hypothesis
    law_error: float  #: error of an effect's law, as a share of the change that it makes
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
        return self.simulated.settings

    @property
    def setting(self) -> Setting:
        """Baseline of the first operating point."""
        return self.simulated.settings[0]

    @property
    def cell_count(self) -> int:
        """Number of operating points."""
        return len(self.simulated.settings)

    @cached_property
    def passing_times(self) -> Array:
        """Time in which the rings turn by one pitch, at most the time-out, s, (C,)."""
        return np.array([passing_time(setting) for setting in self.settings])

    @cached_property
    def min_late_delay(self) -> Array:
        """Smallest delay of a late shift behind the median, s, (C,), by the dense baseline."""
        fast, median = quantiles(self.simulated.baseline, (0.1, 0.5))
        min_delay = np.maximum(MIN_LATE_PASSING * self.passing_times, MIN_LATE_DELAY_S)
        return np.maximum(LATE_DISTANCES * (median - fast), min_delay)

    @cached_property
    def base_moments(self) -> Array:
        """Moments of the baseline at all angles, (C, MOMENTS)."""
        return self._moments(self.simulated.baseline)

    @cached_property
    def base_mean(self) -> Array:
        """Mean of the baseline's timely shifts, s, (C,)."""
        return np.asarray(np.exp(self.base_moments[:, LOG_MEAN]))

    @cached_property
    def kurtosis(self) -> Array:
        """Excess kurtosis of timely shifts of the baseline, (C,)."""
        excess = np.nan_to_num(np.exp(self.base_moments[:, LOG_KURTOSIS]) - 3.0)
        return np.clip(excess, MIN_KURTOSIS, MAX_KURTOSIS)

    @cached_property
    def _level_times(self) -> Array:
        """Times of all levels by operating point, s, (C, levels, angles)."""
        return np.moveaxis(self.simulated.times, 1, 0)

    @cached_property
    def _pooled_times(self) -> Array:
        """Times of the baseline and all levels, s, (C, n)."""
        level_times = self._level_times.reshape(self.cell_count, -1)
        return np.hstack([self.simulated.baseline, level_times])

    @cached_property
    def _pooled_is_late(self) -> np.ndarray:
        """Whether the shifts of baseline and levels are late, (C, n)."""
        late_levels = mark_late(self._level_times, self.min_late_delay[:, None])
        late_levels = late_levels.reshape(self.cell_count, -1)
        return np.hstack([mark_late(self.simulated.baseline, self.min_late_delay), late_levels])

    @cached_property
    def pooled_late_share(self) -> Array:
        """Share of late shifts over baseline and all levels, (C,)."""
        late_count = self._pooled_is_late.sum(axis=1)
        return (late_count + 0.5) / (np.isfinite(self._pooled_times).sum(axis=1) + 50.0)

    @cached_property
    def late_delay(self) -> LateDelay:
        """Mean and standard deviation of a late shift's delay behind timely ones.

        Where hardly any shift is late, it passes ``LATE_SLOTS`` slots, and scatters as much.
        """
        times = self._pooled_times
        is_late = self._pooled_is_late
        (level_medians,) = quantiles(self._level_times, (0.5,))
        baseline_count = self.simulated.baseline.shape[1]
        timeout = np.array([setting.clutch.timeout for setting in self.settings])
        mean = np.minimum(LATE_SLOTS * self.passing_times, 0.5 * timeout)
        sd = mean.copy()
        for cell in np.flatnonzero(is_late.sum(axis=1) >= MIN_LATE_COUNT):
            median = np.median(times[cell][np.isfinite(times[cell])])
            medians = np.append(
                np.repeat(median, baseline_count), np.repeat(level_medians[cell], ANGLES)
            )
            delays = (times[cell] - medians)[is_late[cell]]
            mean[cell] = delays.mean()
            sd[cell] = delays.std(ddof=1)
        return LateDelay(mean, sd)

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

        Times until the gap is closed multiply and times of contact multiply; pairs that were
        simulated together correct that.
        """
        space = self.space(hypothesis)
        contact_effects = self.contact_effects(hypothesis)
        sums = self._sum_changes(space, contact_effects, values)
        mean = self.base_mean * np.exp(sums.moments[..., LOG_MEAN])
        if len(contact_effects) > 1:
            gap_time = self._approach.time * np.exp(sums.flight)
            contact_time = self._contact_time * np.exp(sum(sums.contact_logs))
            mean = (gap_time + contact_time) * np.exp(sums.reading_log)
        pair_error = np.zeros_like(mean)
        for first, second in itertools.combinations(range(len(contact_effects)), 2):
            pair = (contact_effects[first], contact_effects[second])
            emulator = self.pair_emulators.get(pair)
            if emulator is None:
                product = sums.contact_logs[first] * sums.contact_logs[second]
                pair_error += PAIR_ERROR * abs(product)
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
        sums = _EffectSums(
            moments=np.zeros((*shape, MOMENTS)), modes=Modes(ones, ones, ones, self.kurtosis * ones)
        )
        approach = self._approach
        for name in sorted(space.hypothesis, key=lambda name: name in self.reading_effects):
            change = self.changes(name, values[:, space.columns(name)])
            if change.angles is not None:
                turn = (approach.pace + sums.slip) * approach.time * np.exp(sums.flight)
                further_turn = turn - approach.pace * approach.time
                x = {
                    effect: self._curve(effect).coordinates(values[:, space.columns(effect)])
                    for effect in contact_effects
                }
                change = self._weigh_angles(change, change.angles, further_turn, x)
            log = change.moments[..., LOG_MEAN]
            if name in self.reading_effects:
                sums.reading_log = sums.reading_log + log
            else:
                gap_time = approach.time * np.exp(change.flight)
                contact_time = self.base_mean * np.exp(log) - gap_time
                contact_time = np.maximum(contact_time, MIN_CONTACT_SHARE * self.base_mean)
                sums.contact_logs.append(np.log(contact_time / self._contact_time))
            sums.add(change)
        return sums

    def _with_errors(self, sums: _EffectSums, mean: Array, pair_error: Array) -> Prediction:
        """Build a prediction from the sums of changes and the mean without dead time, s, (m, C).

        ``pair_error`` is the relative error of the mean by pairs of effects, (m, C).
        """
        none = np.zeros_like(mean)
        log_sd = self.base_moments[:, LOG_SD] + sums.moments[..., LOG_SD]
        late_share = self.base_moments[:, LATE_SHARE] + sums.moments[..., LATE_SHARE]
        engaged_logit = self.base_moments[:, ENGAGED_LOGIT] + sums.moments[..., ENGAGED_LOGIT]
        sd = np.clip(np.exp(log_sd), MIN_SD_S, np.maximum(mean, MIN_SD_S))
        law_variance = self.law_error**2 * (none + sums.squared_log)
        emulation_variance = none + sums.emulation_variance
        variance = law_variance + emulation_variance - sums.common_variance + pair_error**2
        mean_error = angle_error(DENSE_FACTOR * ANGLES) * sd
        kurtosis = (sums.modes.kurtosis + 3.0) * np.exp(sums.moments[..., LOG_KURTOSIS]) - 3.0
        return Prediction(
            mean=mean + sums.delay,
            sd=sd,
            error=np.hypot(mean_error, np.sqrt(variance) * mean),
            emulation_error=np.sqrt(emulation_variance) * mean,
            common_error=np.sqrt(pair_error**2 + sums.common_variance) * mean,
            late_share=np.clip(late_share, 1e-3, 0.9),
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
            self.settings,
            self.runner,
            density=DENSE_FACTOR if is_dense else 1,
        )
        if not is_dense:
            times = self.simulated.spread_times(times)
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
        level_angles = (self._moments(self._angles.times[1:]) - self.base_moments)[..., :2]
        # All angles lack the error that the levels' angles have in common.
        is_dense = np.array([bench.is_dense for bench in benches])
        misses = np.vstack([self._moments(times)[..., :2] - rule, level_angles])
        misses[:-1][is_dense] += level_angles
        level_error, common_error = (error[:, :2].ravel() for error in self._moment_errors)
        factors = np.append(np.where(is_dense, DENSE_ERROR, 1.0), 1.0)
        return Emulator.fit(
            x=self._pair_coordinates(names, self.space(names), values),
            neutral=tuple(self._curve(name).emulator.kernel.neutral[0] for name in names),
            changes=misses.reshape(len(misses), -1).T,
            level_error=level_error[:, None] * factors,
            common_error=common_error,
        )

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
            shares = np.linspace(0.0, 1.0, RANGE_SHARES)
            rows = itertools.product(shares, repeat=len(effect.parameters))
            exists = np.array([[_exists(effect, row, s) for s in self._extremes] for row in rows])
            if exists.all():
                limiting = []
            elif (exists == exists[:, :1]).all():
                limiting = self._extremes[:1]
            else:
                limiting = self._extremes
            self._limiting_settings[effect.name] = limiting
        return self._limiting_settings[effect.name]

    @cached_property
    def _extremes(self) -> list[Setting]:
        return extremes(self.settings)

    @cached_property
    def reading_effects(self) -> frozenset[str]:
        """Names of the effects of the reading of a shift alone."""
        effects = self.effects.items()
        return frozenset(name for name, e in effects if changes_only_reading(e, self._extremes))

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
        indices = self.simulated.level_indices((effect.name,))
        further = self.further_benches.get((effect.name,), ())
        levels = [self.simulated.levels[k] for k in indices] + [bench.level for bench in further]
        is_dense = np.array([False] * len(indices) + [bench.is_dense for bench in further])
        level_times = self.simulated.spread_times(self.simulated.times[indices])
        rows = [*level_times, *(bench.times for bench in further)]
        times = np.array(rows).reshape(len(levels), *self.simulated.angles.shape)
        # Coordinates, in the unit cube of levels and neutral values.
        neutral_values = self._neutral_values(effect) if effect.parameters else np.zeros((0, 0))
        x = coordinates(effect, np.array([level.values for level in levels]), self.setting)
        neutral = coordinates(effect, neutral_values, self.setting)
        corners = np.vstack([x[~is_dense], neutral])
        low = corners.min(axis=0)
        width = np.maximum(np.ptp(corners, axis=0), 1e-9)
        # Moments: those of all angles lack the error that the levels' angles have in common.
        with_baseline = np.concatenate([times, self._angles.times[1:]])
        changes = self._moments(with_baseline) - self.base_moments
        changes[:-1][is_dense] += changes[-1]
        level_error, common_error = (error.ravel() for error in self._moment_errors)
        factors = np.append(np.where(is_dense, DENSE_ERROR, 1.0), 1.0)
        emulator = Emulator.fit(
            x=np.clip((x - low) / width, 0.0, 1.0),
            neutral=((neutral - low) / width,),
            changes=changes.reshape(len(changes), -1).T,
            level_error=level_error[:, None] * factors,
            common_error=common_error,
        )
        return Curve(
            effect=effect,
            setting=self.setting,
            low=low,
            width=width,
            gap_time=self._approach.time,
            emulator=emulator,
            angles=Angles(times, mark_late(times, self.min_late_delay)),
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
            inverse_root = approach.time**-0.5 - self._approach.time**-0.5
            rows.append((delays, inverse_root, approach.pace - self._approach.pace))
        return np.array(rows).reshape(len(levels), -1)

    @cached_property
    def _approach(self) -> Approach:
        """Approach of the baseline."""
        return approach_of(self.settings)

    @cached_property
    def _contact_time(self) -> Array:
        """Mean time of the baseline from the closed gap to the end, s, (C,)."""
        contact_time = self.base_mean - self._approach.time
        return np.maximum(contact_time, MIN_CONTACT_SHARE * self.base_mean)

    @cached_property
    def _moment_errors(self) -> tuple[Array, Array]:
        """Errors of a level's moments by its angles: of each level, in common, (C, MOMENTS)."""
        units = np.ones((self.cell_count, MOMENTS))
        units[:, LOG_MEAN] = np.exp(self.base_moments[:, LOG_SD] - self.base_moments[:, LOG_MEAN])
        late_share = self.pooled_late_share
        units[:, LATE_SHARE] = np.sqrt(late_share * (1.0 - late_share) / ANGLES)
        return np.array(LEVEL_ERRORS) * units, np.array(COMMON_ERRORS) * units

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
                self._cached_readings[key] = _reading_change(effect, row, self.setting)
            rows.append(self._cached_readings[key])
        delay, concentration, centre = np.array(rows).reshape(-1, 3, 1).swapaxes(0, 1)
        none = np.zeros((len(values), self.cell_count))
        angles = None
        if concentration.any() or centre.any():
            angles = AngleDistribution(concentration, centre)
        moments = np.zeros((*none.shape, MOMENTS))
        return Changes(moments=moments, delay=delay + none, error=none, angles=angles)

    @cached_property
    def _turns(self) -> Array:
        """Angles of the baseline, pitches, (C, A)."""
        pitch = np.array([[setting.clutch.dog.pitch_angle] for setting in self.settings])
        return np.asarray(self.simulated.angles / pitch)

    @cached_property
    def _ordered_baseline(self) -> OrderedBaseline:
        """Baseline in the order of its times."""
        times = self.simulated.baseline
        order = np.argsort(times, axis=1)
        is_timely = np.isfinite(mask_late(times, self.min_late_delay))
        return OrderedBaseline(
            turns=np.take_along_axis(self._turns, order, axis=1),
            times=np.take_along_axis(times, order, axis=1),
            is_timely=np.take_along_axis(is_timely, order, axis=1),
        )

    def _weigh_angles(
        self, change: Changes, angles: AngleDistribution, turn: Array, x: Mapping[str, Array]
    ) -> Changes:
        """Weigh the angles of the baseline, and of benches with effects at coordinates (m, d).

        Modes are the baseline's, the centre moved by the further ``turn`` before the rings touch,
        pitches, (m, C).
        """
        concentration = angles.concentration[..., None]
        centre = angles.centre[..., None]
        weights = angle_weights(self._turns, concentration, centre)
        base = self._angles.changes(weights, np.tile([1.0, 0.0], (len(weights), 1)))
        moments = base.moments
        angle_variance = base.angle_variance
        inverse_squares = base.inverse_squares
        for name, effect_x in x.items():
            curve = self._curve(name)
            noise = np.where(curve.is_dense, DENSE_NOISE, SPARSE_NOISE)
            bench_shares = curve.emulator.weights(effect_x, noise)
            dense_share = bench_shares @ curve.is_dense
            base_shares = np.stack([dense_share, bench_shares.sum(axis=1) - dense_share], axis=1)
            change_of_benches = curve.angles.changes(weights, bench_shares)
            moments = moments + change_of_benches.moments
            moments = moments - self._angles.changes(weights, base_shares).moments
            angle_variance = angle_variance + change_of_benches.angle_variance
            inverse_squares = inverse_squares + change_of_benches.inverse_squares
        log_sd = self.base_moments[:, LOG_SD] - self.base_moments[:, LOG_MEAN]
        variation = np.exp(log_sd + moments[..., LOG_SD] - moments[..., LOG_MEAN])
        variance = angle_variance * variation**2 + UNEVEN_MEAN_ERROR**2 * inverse_squares
        baseline = self._ordered_baseline
        weights = angle_weights(baseline.turns, concentration, centre + turn[..., None])
        return change._replace(
            moments=moments,
            error=np.sqrt(variance),
            inverse_squared_count=inverse_squares,
            modes=modes_of(baseline.times, baseline.is_timely, weights),
        )

    @cached_property
    def _angles(self) -> Angles:
        """Two benches: the baseline at all angles, and at the angles of the levels."""
        simulated = self.simulated
        level_times = np.take_along_axis(simulated.baseline, simulated.level_angles, axis=1)
        times = np.stack([simulated.baseline, simulated.spread_times(level_times)])
        return Angles(times, mark_late(times, self.min_late_delay))

    def _moments(self, times: Array) -> Array:
        """Compute the moments of times (..., C, n), s, (..., C, MOMENTS)."""
        is_late = mark_late(times, self.min_late_delay)
        is_engaged = np.isfinite(times)
        is_timely = is_engaged & ~is_late
        count = is_timely.sum(axis=-1)
        mean = np.where(is_timely, times, 0.0).sum(axis=-1) / np.maximum(1, count)
        squares = np.where(is_timely, times - mean[..., None], 0.0) ** 2
        square_sum = np.maximum(squares.sum(axis=-1), np.maximum(1, count) * MIN_SD_S**2)
        sd = np.sqrt(square_sum / np.maximum(1, count - 1))
        kurtosis = count * (squares**2).sum(axis=-1) / square_sum**2
        engaged = is_engaged.sum(axis=-1)
        shifts = (~np.isnan(times)).sum(axis=-1)
        late_count = is_late.sum(axis=-1) + LATE_SHARE_PRIOR * self.pooled_late_share
        moments = np.empty((*mean.shape, MOMENTS))
        moments[..., LOG_MEAN] = np.where(count > 0, np.log(np.maximum(mean, 1e-6)), np.nan)
        moments[..., LOG_SD] = np.where(count > 1, np.log(sd), np.nan)
        moments[..., LATE_SHARE] = late_count / (engaged + LATE_SHARE_PRIOR)
        moments[..., ENGAGED_LOGIT] = logit((engaged + 0.5) / (shifts + 1.0))
        log_kurtosis = np.log(np.maximum(kurtosis, 1.0))
        moments[..., LOG_KURTOSIS] = np.where(count > 3, log_kurtosis, np.nan)
        return moments


def build_models(
    bench: Bench, effects: Mapping[str, Effect], settings: Settings, runner: Runner
) -> dict[str, Model]:
    """Build the models of a data set, by the place where the displacement may be read."""
    place = bench.record.displacement_at
    if place == "unknown":
        sensors: tuple[Sensor, ...] = ("sleeve", "actuator")
        return {
            sensor: _build_model(bench, effects, settings, runner, sensor=sensor)
            for sensor in sensors
        }
    return {place: _build_model(bench, effects, settings, runner, sensor=place)}


def _build_model(
    bench: Bench,
    effects: Mapping[str, Effect],
    settings: Settings,
    runner: Runner,
    *,
    sensor: Sensor,
) -> Model:
    """Build the model of a data set with the displacement read by a sensor."""
    baseline = settings_of(bench, sensor)
    wide_effects = {name: widen_ranges(effect, baseline[0]) for name, effect in effects.items()}
    measured = {result.effect for result in bench.measured}
    nuisances = {}
    for name in settings.nuisance:
        if name in wide_effects and name not in measured:
            nuisances[name] = wide_effects.pop(name)
    reversed_model = None
    if wide_effects.pop(REVERSED, None) is not None:
        is_known = bench.record.sense == "known"
        reversed_model = _build_reversed(
            wide_effects, baseline, settings, runner, only_reading=is_known
        )
    simulated = simulate({**wide_effects, **nuisances}, baseline, runner)
    if bench.record.time_zero == "force":
        wide_effects.pop(DELAY, None)
    return Model(
        effects=wide_effects,
        simulated=simulated,
        nuisances=nuisances,
        law_error=settings.law,
        reversed_model=reversed_model,
        runner=runner,
    )


def _build_reversed(
    effects: Mapping[str, Effect],
    baseline: Sequence[Setting],
    settings: Settings,
    runner: Runner,
    *,
    only_reading: bool,
) -> Model:
    """Build the model of the reversed sense of rotation.

    ``only_reading`` keeps the effects that change the reading alone.
    """
    reversed_effects = dict(effects)
    if only_reading:
        ends = extremes(baseline)
        for name, effect in effects.items():
            if not changes_only_reading(effect, ends):
                del reversed_effects[name]
    reversed_settings = [s.with_point(mismatch=0.0 - s.point.mismatch) for s in baseline]
    return Model(
        effects=reversed_effects,
        simulated=simulate(reversed_effects, reversed_settings, runner),
        nuisances={},
        law_error=settings.law,
        runner=runner,
    )


def _exists(effect: Effect, shares: Sequence[float], setting: Setting) -> bool:
    """Check that there is a bench with an effect at shares (p,) of its ranges."""
    values = {p.name: float(p.at(s)) for p, s in zip(effect.parameters, shares, strict=True)}
    return effect.possible(setting, values)


def changes_only_reading(effect: Effect, settings: Sequence[Setting]) -> bool:
    """Check that an effect changes only the reading of a shift, equally at all settings."""
    for share in (0.3, 0.9):
        values = {p.name: p.at(share) for p in effect.parameters}
        changes = set()
        for setting in settings:
            try:
                changed_setting = effect.apply(setting, values)
            except DogshapeError:
                return False
            if (changed_setting.clutch, changed_setting.point) != (setting.clutch, setting.point):
                return False
            changes.add(_reading_change(effect, list(values.values()), setting))
        if len(changes) > 1:
            return False
    return True


def approach_of(settings: Sequence[Setting]) -> Approach:
    """Compute the approach at settings (C,)."""
    times = [max(touch_time(s.clutch, s.point.profile), MIN_SD_S) for s in settings]
    paces = [s.point.mismatch / s.clutch.dog.pitch_angle for s in settings]
    return Approach(np.array(times), np.array(paces))


def _reading_change(effect: Effect, row: Sequence[float], setting: Setting) -> ReadingChange:
    """Compute the change of the reading by an effect at values (p,), 0 for no bench."""
    names = [p.name for p in effect.parameters]
    try:
        changed_setting = effect.apply(setting, dict(zip(names, row, strict=True)))
    except DogshapeError:
        return ReadingChange(delay=0.0, concentration=0.0, centre=0.0)
    return ReadingChange(
        delay=changed_setting.delay - setting.delay,
        concentration=changed_setting.concentration,
        centre=changed_setting.centre,
    )


def passing_time(setting: Setting) -> float:
    """Compute the time in which the rings turn by one pitch, at most the time-out, s."""
    slip = abs(setting.point.mismatch)
    timeout = setting.clutch.timeout
    if slip == 0.0:
        return timeout
    return min(timeout, setting.clutch.dog.pitch_angle / slip)
