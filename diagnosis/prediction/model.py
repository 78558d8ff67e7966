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
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from scipy.special import expit, logit

from dogshape.diagnosis.bench.bench_data import Bench
from dogshape.diagnosis.prediction.curve import (
    LEAST_PART,
    MOMENTS,
    Changes,
    Curve,
    Space,
    coordinates,
)
from dogshape.diagnosis.prediction.emulator import Emulator
from dogshape.diagnosis.prediction.moments import (
    FAR,
    LEAST_SD,
    Angles,
    late_times,
    modes_of,
    quantiles,
    timely,
)
from dogshape.diagnosis.prediction.simulations import (
    ANGLES,
    DENSE,
    Level,
    Simulated,
    extremes,
    settings_of,
    simulate,
    simulate_benches,
    with_wide_range,
)
from dogshape.diagnosis.settings import Settings
from dogshape.diagnosis.terms import DELAY, REVERSED, Array, Hypothesis, forward
from dogshape.sim.effect import Effect
from dogshape.sim.errors import DogshapeError
from dogshape.sim.setting import Sensor, Setting, angle_weights
from dogshape.sim.shift.planar import touch_time
from dogshape.sim.statistics.blocks import Runner

LEAST_FAR = 8e-3  #: s behind the median, at least
SLOT = 0.5  #: of the passing time of a slot behind the median, at least
SLOTS = 5.0  #: slots that a late shift passes, where too few simulated ones are late
ENOUGH_LATE = 8  #: late shifts from which their delays are known
POOLED = 10.0  #: shifts that the share of late ones at all levels counts as at each
COMBINED = 0.7  #: error of two effects over the product of their changes (measured)
#: Measured: variances of a change by angles of benches at all of them and at few, over that of all
#: changes; errors of ln deviation and of the mean by uneven angles over 1 / number that counts.
CHAOS, BLUR, FLOOR = (5e-4, 3e-3), 1.2, 0.2
#: Steps of a range between which further benches of one and of two effects lie, and how many of
#: these are simulated at once.
GRID, BENCHES = {1: 32, 2: 16}, 4
DENSE_ERROR = DENSE**-0.8  #: error of a moment by all angles over that by a level's (measured)
#: Errors of a level's moments: of ln mean over the coefficient of variation, of ln deviation, of
#: the share of late shifts over the binomial one, of the logit of those that engage, ln kurtosis.
OWN, SHARED = (0.1, 0.25, 1.0, 0.5, 0.3), (0.04, 0.05, 0.5, 1.0, 0.2)
TAILS = -1.5, 12.0  #: of the excess kurtosis, least and most
RECENT = 256  #: results that are kept
TRIED = 9  #: values of each parameter at which the range of an effect is examined


@dataclass(frozen=True)
class Predicted:
    """Shift times that a hypothesis predicts, for m values of its parameters at C points."""

    mean: Array  #: of timely shifts that engage, dead time included, s
    sd: Array  #: of these, s
    error: Array  #: standard error of each ``mean`` by angles, effect laws and emulation, s
    emulated: Array  #: all of it by interpolation between levels, s
    common: Array  #: error that all points share: emulation, effects together, s
    late: Array  #: share of late shifts among those that engage
    engaged: Array  #: share that engages before the time-out
    delay: Array  #: dead time within ``mean``, s
    #: Two modes of the timely shifts, by uneven angles: share of the smaller one, 1 for no modes;
    #: mean of the larger one behind ``mean``, s; its standard deviation, s.
    minor: Array
    main: Array
    narrow: Array
    shape: Array  #: excess kurtosis of the timely shifts
    blur: Array  #: standard error of the logarithm of ``sd`` by interpolation and uneven angles

    def only(self, rows: object) -> Predicted:
        """Select some of the values."""
        return Predicted(*(getattr(self, name)[rows] for name in self.__dataclass_fields__))

    @staticmethod
    def joined(parts: Sequence[Predicted]) -> Predicted:
        """Join the values of several predictions."""
        names = Predicted.__dataclass_fields__
        return Predicted(*(np.concatenate([getattr(p, n) for p in parts]) for n in names))


@dataclass(frozen=True)
class Model:
    """Predictions of a clutch at a data set's operating points."""

    effects: Mapping[str, Effect]  #: of hypotheses, by name, with their wide ranges
    simulated: Simulated  #: baseline and levels
    nuisances: Mapping[str, Effect]  #: integrated under every hypothesis
    law: float  #: error of an effect's law, as a share of the change that it makes
    turned: Model | None = None  #: of the reversed sense of rotation, where that is a hypothesis
    run: Runner | None = None  #: simulates further benches
    #: What the changes of two effects miss of ln mean and ln deviation, 2 C moments.
    joint: Mapping[Hypothesis, Emulator] = field(default_factory=dict)
    #: Benches of one or two effects beside the levels, and their times, (C, DENSE * ANGLES).
    further: Mapping[Hypothesis, tuple[tuple[Level, Array], ...]] = field(default_factory=dict)
    _curves: dict[str, Curve] = field(default_factory=dict)
    _limits: dict[str, list[Setting]] = field(default_factory=dict)
    _recent: dict[object, Changes] = field(default_factory=dict)
    _benches: dict[tuple[object, ...], bool] = field(default_factory=dict)

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
    def far(self) -> Array:
        """Least distance of a late shift behind the median, s, (C,), by the dense baseline."""
        fast, middle = quantiles(self.simulated.baseline, (0.1, 0.5))
        return np.maximum(FAR * (middle - fast), np.maximum(SLOT * self.waits, LEAST_FAR))

    @cached_property
    def base(self) -> Array:
        """Moments of the baseline at all angles, (C, MOMENTS)."""
        return self._moments(self.simulated.baseline)

    @cached_property
    def shape(self) -> Array:
        """Excess kurtosis of timely shifts of the baseline, (C,)."""
        return np.clip(np.nan_to_num(np.exp(self.base[:, 4]) - 3.0), *TAILS)

    @cached_property
    def _every(self) -> tuple[Array, Array]:
        """Times of the baseline and all levels, (C, n), and which of them are late."""
        levels = np.moveaxis(self.simulated.times, 1, 0)
        late = late_times(levels, self.far[:, None]).reshape(self.cells, -1)
        base = self.simulated.baseline
        times = np.hstack([base, levels.reshape(self.cells, -1)])
        return times, np.hstack([late_times(base, self.far), late])

    @cached_property
    def pooled_late(self) -> Array:
        """Share of late shifts over baseline and all levels, (C,)."""
        times, late = self._every
        return (late.sum(axis=1) + 0.5) / (np.isfinite(times).sum(axis=1) + 50.0)

    @cached_property
    def behind(self) -> tuple[Array, Array]:
        """Mean and standard deviation of a late shift's delay behind timely ones, s, (C,) each.

        Where hardly any shift is late, it passes ``SLOTS`` slots, and scatters as much.
        """
        times, late = self._every
        (own,) = quantiles(np.moveaxis(self.simulated.times, 1, 0), (0.5,))
        dense = self.simulated.baseline.shape[1]
        timeout = np.array([one.clutch.timeout for one in self.settings])
        mean = np.minimum(SLOTS * self.waits, 0.5 * timeout)
        sd = mean.copy()
        for cell in np.flatnonzero(late.sum(axis=1) >= ENOUGH_LATE):
            middle = np.median(times[cell][np.isfinite(times[cell])])
            medians = np.append(np.repeat(middle, dense), np.repeat(own[cell], ANGLES))
            mine = (times[cell] - medians)[late[cell]]
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
        return self.predict_values(hypothesis, self.space(hypothesis).values(shares))

    def predict_values(self, hypothesis: Hypothesis, values: Array) -> Predicted:
        """Predict a hypothesis without the sense at values (m, p)."""
        space, count, base = self.space(hypothesis), len(values), np.exp(self.base[:, 0])
        free, pace = self._free
        after = np.maximum(base - free, LEAST_PART * base)
        logs, angled, square, delay, missed, alike, flight, slip = np.zeros((8, count, self.cells))
        parts, crossed = list[Array](), np.zeros((count, self.cells))
        modes = np.ones((4, count, self.cells))
        modes[3] = self.shape
        rest, blur = np.zeros((count, self.cells, MOMENTS - 1)), np.zeros((count, self.cells))
        others = [name for name in hypothesis if name not in self.readings]
        for name in sorted(hypothesis, key=lambda name: name in self.readings):
            change = self.changes(name, values[:, space.columns(name)])
            if change.uneven is not None:
                turn = (pace + slip) * free * np.exp(flight) - pace * free
                where = {n: self._curve(n).places(values[:, space.columns(n)]) for n in others}
                change = self._uneven(change, turn, where)
            log = change.moments[..., 0]
            if name in self.readings:
                angled += log
            else:
                left = base * np.exp(log) - free * np.exp(change.flight)
                parts.append(np.log(np.maximum(left, LEAST_PART * base) / after))
            logs += log
            flight += change.flight
            slip += change.slip
            rest += change.moments[..., 1:]
            square += log**2
            missed += change.error**2
            alike += change.alike * change.error**2
            delay += change.delay
            modes = modes if change.modes is None else change.modes
            blur += BLUR**2 * change.blur + change.spread**2
        mean = base * np.exp(logs)
        if len(others) > 1:
            mean = (free * np.exp(flight) + after * np.exp(sum(parts))) * np.exp(angled)
        for (one, first), (other, second) in itertools.combinations(
            zip(others, parts, strict=True), 2
        ):
            error = COMBINED * abs(first * second)
            if joint := self.joint.get((one, other)):
                places = self._places((one, other), space, values)
                moments, errors = joint.at(places, 2)
                mean = mean * np.exp(moments[:, ::2])
                rest[..., 0] += moments[:, 1::2]
                error, blur = errors[:, ::2], blur + errors[:, 1::2] ** 2
            crossed += error
        sd = np.clip(np.exp(self.base[:, 1] + rest[..., 0]), LEAST_SD, np.maximum(mean, LEAST_SD))
        own = self.law**2 * square + missed - alike + crossed**2
        error = np.hypot(_angle_error(DENSE * ANGLES) * sd, np.sqrt(own) * mean)
        late = np.clip(self.base[:, 2] + rest[..., 1], 1e-3, 0.9)
        engaged = expit(self.base[:, 3] + rest[..., 2])
        shape = np.clip((modes[3] + 3.0) * np.exp(rest[..., 3]) - 3.0, *TAILS)
        return Predicted(
            mean + delay, sd, error, np.sqrt(missed) * mean, np.sqrt(crossed**2 + alike) * mean,
            late, engaged, delay, modes[0], mean * (modes[1] - 1.0), sd * modes[2], shape,
            blur**0.5,
        )  # fmt: skip

    def _places(self, names: Hypothesis, space: Space, values: Array) -> Array:
        """Compute coordinates of effects in their unit cubes, (m, p)."""
        cubes = (self._curve(name).places(values[:, space.columns(name)]) for name in names)
        return np.hstack([*cubes])

    def has_further_benches(self, hypothesis: Hypothesis) -> bool:
        """Check for benches beside the levels that predict a hypothesis."""
        if REVERSED in hypothesis:
            return self.turned is not None and self.turned.has_further_benches(forward(hypothesis))
        return any({*names} <= {*hypothesis} for names in self.further)

    def simulate(self, hypothesis: Hypothesis, shares: Array) -> Model | None:
        """Simulate one or two effects near the first of shares (m, p), for all predictions.

        Benches lie on a grid of shares, so that draws which differ a little lead to the same ones,
        and have all angles of the baseline. None where nothing is left to simulate: every bench is
        there already or does not exist, or none or three effects are no reading of a shift.
        """
        if REVERSED in hypothesis:
            other = self.turned and self.turned.simulate(forward(hypothesis), shares)
            return other and replace(self, turned=other)
        names = tuple(name for name in hypothesis if name not in self.readings)
        if self.run is None or len(names) not in GRID:
            return None
        columns = [self.space(hypothesis).columns(name) for name in names]
        changed = self._new_levels(names, np.hstack([shares[:, some] for some in columns]))
        if not changed:
            return None
        times = simulate_benches([*changed.values()], self.settings, self.run)
        benches = (*self.further.get(names, ()), *zip(changed, times, strict=True))
        further = {**self.further, names: benches}
        touched: list[Hypothesis]
        if len(names) == 2:
            model = replace(self, further=further)
            touched = [names]
        else:
            curves = {name: curve for name, curve in self._curves.items() if name not in names}
            model = replace(self, further=further, _curves=curves, _recent={})
            touched = [pair for pair in self.joint if names[0] in pair]
        return replace(model, joint={**self.joint, **{n: model._missed(n) for n in touched}})

    def thinned(self, hypothesis: Hypothesis, group: int, groups: int) -> Model:
        """Leave out one further bench in ``groups`` of a hypothesis' effects and pairs."""
        if REVERSED in hypothesis:
            assert self.turned is not None, "the reversed sense is asked for where it is simulated"
            turned = self.turned.thinned(forward(hypothesis), group, groups)
            return replace(self, turned=turned)
        further = {
            names: tuple(one for k, one in enumerate(benches) if k % groups != group)
            if {*names} <= {*hypothesis}
            else benches
            for names, benches in self.further.items()
        }
        curves = {name: one for name, one in self._curves.items() if name not in hypothesis}
        model = replace(self, further=further, joint={}, _curves=curves, _recent={})
        pairs = [names for names in self.joint if {*names} <= {*hypothesis} and further[names]]
        return replace(model, joint={names: model._missed(names) for names in pairs})

    def _new_levels(self, names: Hypothesis, shares: Array) -> dict[Level, list[Setting]]:
        """Find the first levels on the grid near shares (m, p) without a bench, with settings."""
        steps, space = GRID[len(names)], self.space(names)
        known = {level for level, _ in self.further.get(names, ())}
        changed = dict[Level, list[Setting]]()
        for values in space.values((shares * steps).round() / steps).tolist():
            # Rounded, a bench is the same whatever the last digits of a processor's logarithms.
            level = Level(names, tuple(float(f"{value:.6g}") for value in values))
            if level in known:
                continue
            known.add(level)
            with suppress(DogshapeError):  # there is no such bench
                changed[level] = [level.setting(self.effects, one) for one in self.settings]
            if len(changed) == BENCHES:
                break
        return changed

    def _missed(self, names: Hypothesis) -> Emulator:
        """Fit what the changes of two effects miss of ln mean and ln deviation at their benches."""
        benches = self.further[names]
        values = np.array([level.values for level, _ in benches])
        times = np.array([one for _, one in benches])
        space = self.space(names)
        p = replace(self, joint={}).predict_values(names, values)
        ruled = np.stack([np.log(p.mean - p.delay), np.log(p.sd)], axis=-1)
        angles = (self._moments(self._angles.times[1:]) - self.base)[..., :2]
        # All angles lack the error that the levels' angles have in common.
        found = np.vstack([self._moments(times)[..., :2] - ruled + angles, angles])
        x = self._places(names, space, values)
        own, common = self._noise.reshape(2, -1, MOMENTS)[..., :2].reshape(2, -1)
        own = own[:, None] * np.append(np.full(len(times), DENSE_ERROR), 1.0)
        plain = tuple(self._curve(name).emulator.kernel.plain[0] for name in names)
        found = found.reshape(len(found), -1).T
        return Emulator.fitted(x, plain, found, own, common)

    def possible(self, hypothesis: Hypothesis, shares: Array) -> np.ndarray:
        """Mark shares (m, p) of which there is a bench, (m,)."""
        space, found = self.space(hypothesis), np.ones(len(shares), dtype=bool)
        for effect in space.effects:
            if ends := self._ends(effect):
                for k, row in enumerate(shares[:, space.columns(effect.name)].tolist()):
                    key = effect.name, *row
                    if key not in self._benches:
                        self._benches[key] = all(_exists(effect, row, one) for one in ends)
                    found[k] &= self._benches[key]
        return found

    def _ends(self, effect: Effect) -> list[Setting]:
        """List the points that decide which values give no bench, none where all give one."""
        if effect.name not in self._limits:
            rows = itertools.product(np.linspace(0.0, 1.0, TRIED), repeat=len(effect.parameters))
            exist = np.array([[_exists(effect, r, one) for one in self._extremes] for r in rows])
            few = 0 if exist.all() else 1 if (exist == exist[:, :1]).all() else len(self._extremes)
            self._limits[effect.name] = self._extremes[:few]
        return self._limits[effect.name]

    @cached_property
    def _extremes(self) -> list[Setting]:
        return extremes(self.settings)

    @cached_property
    def readings(self) -> frozenset[str]:
        """Names of the effects of the reading of a shift alone."""
        every = self.effects.items()
        return frozenset(name for name, one in every if reads_only(one, self._extremes))

    def changes(self, name: str, values: Array) -> Changes:
        """Compute the changes by an effect at values (m, p); recent results are kept."""
        key = name, values.shape, values.tobytes()
        if key not in self._recent:
            if len(self._recent) >= RECENT:
                self._recent.clear()
            read = self._read(self.effects[name], values) if name in self.readings else None
            self._recent[key] = read or self._curve(name).changes(values)
        return self._recent[key]

    def _curve(self, name: str) -> Curve:
        """Find the changes by an effect, fitted once."""
        if name not in self._curves:
            self._curves[name] = self._fitted(self.effects.get(name) or self.nuisances[name])
        return self._curves[name]

    def _fitted(self, effect: Effect) -> Curve:
        """Fit the changes by an effect over its levels, moment by moment."""
        places, further = self.simulated.of((effect.name,)), self.further.get((effect.name,), ())
        levels = [*(self.simulated.levels[k] for k in places), *(level for level, _ in further)]
        rows = [*self.simulated.times[places], *(one for _, one in further)]
        dense = np.array([one.shape[1] > ANGLES for one in rows], dtype=bool)
        spread = [one if one.shape[1] > ANGLES else self.simulated.spread(one) for one in rows]
        times = np.array(spread).reshape(len(rows), *self.simulated.angles.shape)
        angles = Angles(times, late_times(times, self.far))
        idle = self._idle_values(effect) if effect.parameters else np.zeros((0, 0))
        values = np.array([level.values for level in levels])
        x, plain = (coordinates(effect, one, self.setting) for one in (values, idle))
        every = np.vstack([x[~dense], plain])
        low, wide = every.min(axis=0), np.maximum(np.ptp(every, axis=0), 1e-9)
        x, plain = np.clip((x - low) / wide, 0.0, 1.0), (plain - low) / wide
        found = self._moments(np.concatenate([times, self._angles.times[1:]])) - self.base
        # What all angles show lacks the error that the levels' angles have in common.
        found[:-1][dense] += found[-1]
        own, common = self._noise
        own = own[:, None] * np.append(np.where(dense, DENSE_ERROR, 1.0), 1.0)
        fitted = Emulator.fitted(x, (plain,), found.reshape(len(found), -1).T, own, common)
        given, (free, pace), added = {effect.name: effect}, self._free, []
        for level in levels:
            rows = [level.setting(given, one) for one in self.settings]
            time, slip = _free(rows)
            added.append(([one.delay for one in rows], time**-0.5 - free**-0.5, slip - pace))
        exact = np.array(added).reshape(len(levels), -1)
        return Curve(effect, self.setting, low, wide, free, fitted, angles, dense, exact)

    @cached_property
    def _free(self) -> Array:
        """Time until the gap is closed, s, and mismatch, pitches/s, of the baseline, (2, C)."""
        return _free(self.settings)

    @cached_property
    def _noise(self) -> Array:
        """Errors of a level's moments by its angles: own and common ones, (2, C * MOMENTS)."""
        varied, one = np.exp(self.base[:, 1] - self.base[:, 0]), np.ones(self.cells)
        late = np.sqrt(self.pooled_late * (1.0 - self.pooled_late) / ANGLES)
        units = np.stack([varied, one, late, one, one], axis=1)
        return (np.array([OWN, SHARED])[:, None] * units).reshape(2, -1)

    def _idle_values(self, effect: Effect) -> Array:
        """List neutral values: of all parameters, or of the first where it idles the others."""
        neutral = effect.neutral(self.setting)
        rows, more = [list(neutral.values())], effect.parameters[1:]
        ends = [{**neutral, p.name: v} for p in more for v in (p.low, p.high)]
        if ends and all(
            effect.possible(self.setting, given)
            and effect.apply(self.setting, given) == self.setting
            for given in ends
        ):
            low, high = more[0].low, more[0].high
            rows += [[rows[0][0], v, *rows[0][2:]] for v in np.linspace(low, high, 5).tolist()]
        return np.array(rows)

    def _read(self, effect: Effect, values: Array) -> Changes:
        """Compute the changes by an effect of the reading: dead time, uneven angles."""
        rows = [_reading(effect, row, self.setting) for row in values.tolist()]
        delay, *uneven = np.array(rows).reshape(-1, 3, 1).swapaxes(0, 1)
        none = np.zeros((len(values), self.cells))
        given = np.array(uneven) if np.any(uneven) else None
        return Changes(np.zeros((*none.shape, MOMENTS)), delay + none, none, uneven=given)

    @cached_property
    def _turns(self) -> Array:
        """Angles of the baseline, pitches, (C, A)."""
        pitch = np.array([[one.clutch.dog.pitch_angle] for one in self.settings])
        return np.asarray(self.simulated.angles / pitch)

    @cached_property
    def _ordered(self) -> list[np.ndarray]:
        """Angles of the baseline, pitches, times, and timely ones, in their order, (C, A)."""
        times = self.simulated.baseline
        every = self._turns, times, np.isfinite(timely(times, self.far))
        return [np.take_along_axis(one, np.argsort(times, axis=1), axis=1) for one in every]

    def _uneven(self, change: Changes, turn: Array, where: Mapping[str, Array]) -> Changes:
        """Weigh the angles of the baseline, and of benches with effects at coordinates (m, d).

        Modes are the baseline's, the centre moved by the further ``turn`` before the rings touch.
        """
        concentration, centre = np.asarray(change.uneven)[..., None]
        given = angle_weights(self._turns, concentration, centre)
        plain, count = self._angles.changes(given)
        moments, left, even = plain[:, 0], _angle_error(count[:, 0]) ** 2, count[:, 0] ** -2.0
        for name, at in where.items():
            curve = self._curve(name)
            weights = curve.emulator.weights(at, np.where(curve.dense, *CHAOS))
            found, count = curve.angles.changes(given)
            found = found - plain[:, np.where(curve.dense, 0, 1)]
            moments = moments + np.einsum("mn,mnck->mck", weights, found)
            left = left + np.einsum("mn,mnc->mc", weights**2, _angle_error(count) ** 2)
            even = even + np.einsum("mn,mnc->mc", weights**2, count**-2.0)
        varied = np.exp(self.base[:, 1] - self.base[:, 0] + moments[..., 1] - moments[..., 0])
        error = np.sqrt(left * varied**2 + FLOOR**2 * even)
        turns, times, kept = self._ordered
        given = angle_weights(turns, concentration, centre + turn[..., None])
        modes = modes_of(times, kept, given)
        return change._replace(moments=moments, error=error, blur=even, modes=modes)

    @cached_property
    def _angles(self) -> Angles:
        """Baseline at all angles, and at those of the levels."""
        simulated, every = self.simulated, self.simulated.baseline
        few = simulated.spread(np.take_along_axis(every, simulated.common, axis=1))
        times = np.stack([every, few])
        return Angles(times, late_times(times, self.far))

    def _moments(self, times: Array) -> Array:
        """Compute the moments of times (..., C, n), (..., C, MOMENTS)."""
        late, ended = late_times(times, self.far), np.isfinite(times)
        count = (ended & ~late).sum(axis=-1)
        mean = np.where(ended & ~late, times, 0.0).sum(axis=-1) / np.maximum(1, count)
        square = np.where(ended & ~late, times - mean[..., None], 0.0) ** 2
        whole = np.maximum(square.sum(axis=-1), np.maximum(1, count) * LEAST_SD**2)
        sd = np.sqrt(whole / np.maximum(1, count - 1))
        fourth = count * (square**2).sum(axis=-1) / whole**2
        tried, ended = (~np.isnan(times)).sum(axis=-1), ended.sum(axis=-1)
        moments = (
            np.where(count > 0, np.log(np.maximum(mean, 1e-6)), np.nan),
            np.where(count > 1, np.log(sd), np.nan),
            (late.sum(axis=-1) + POOLED * self.pooled_late) / (ended + POOLED),
            logit((ended + 0.5) / (tried + 1.0)),
            np.where(count > 3, np.log(np.maximum(fourth, 1.0)), np.nan),
        )
        return np.stack(moments, axis=-1)


def build_models(
    bench: Bench, effects: Mapping[str, Effect], settings: Settings, run: Runner
) -> dict[str, Model]:
    """Build the models of a data set, by the place where the displacement may be read."""
    known = bench.record.displacement_at
    places: tuple[Sensor, ...] = ("sleeve", "actuator") if known == "unknown" else (known,)
    found: dict[str, Model] = {}
    for place in places:
        plain = settings_of(bench, place)
        wide = {n: with_wide_range(e, plain[0]) for n, e in effects.items()}
        measured = {one.effect for one in bench.measured}
        nuisances = {n: wide.pop(n) for n in settings.nuisance if n in wide and n not in measured}
        turned = None
        if wide.pop(REVERSED, None) is not None:
            other = [one.with_point(mismatch=0.0 - one.point.mismatch) for one in plain]
            every = bench.record.sense != "known"
            mine = {n: e for n, e in wide.items() if every or reads_only(e, extremes(plain))}
            turned = Model(mine, simulate(mine, other, run), {}, settings.law, run=run)
        levels = simulate({**wide, **nuisances}, plain, run)
        if bench.record.time_zero == "force":
            wide.pop(DELAY, None)
        found[place] = Model(wide, levels, nuisances, settings.law, turned, run)
    return found


def _exists(effect: Effect, shares: Sequence[float], setting: Setting) -> bool:
    given = {p.name: float(p.at(s)) for p, s in zip(effect.parameters, shares, strict=True)}
    return effect.possible(setting, given)


def reads_only(effect: Effect, settings: Sequence[Setting]) -> bool:
    """Check that an effect changes the reading of a shift alone, and all settings alike."""
    for share in (0.3, 0.9):
        given = {p.name: p.at(share) for p in effect.parameters}
        try:
            pairs = [(effect.apply(setting, given), setting) for setting in settings]
        except DogshapeError:
            return False
        if any((one.clutch, one.point) != (plain.clutch, plain.point) for one, plain in pairs):
            return False
        if len({_reading(effect, list(given.values()), setting) for setting in settings}) > 1:
            return False
    return True


def _free(settings: Sequence[Setting]) -> Array:
    """Compute the time until the gap is closed, s, and the mismatch, pitches/s, (2, n)."""
    times = [max(touch_time(one.clutch, one.point.profile), LEAST_SD) for one in settings]
    return np.array([times, [one.point.mismatch / one.clutch.dog.pitch_angle for one in settings]])


def _reading(effect: Effect, row: list[float], setting: Setting) -> tuple[float, float, float]:
    """Give dead time, concentration and centre; none where there is no such bench."""
    names = [p.name for p in effect.parameters]
    try:
        changed = effect.apply(setting, dict(zip(names, row, strict=True)))
    except DogshapeError:
        return 0.0, 0.0, 0.0
    return changed.delay - setting.delay, changed.concentration, changed.centre


def wait_of(setting: Setting) -> float:
    """Compute the time in which the rings turn by one pitch, at most the time-out, s."""
    slip, timeout = abs(setting.point.mismatch), setting.clutch.timeout
    return min(timeout, setting.clutch.dog.pitch_angle / slip) if slip else timeout


def _angle_error(count: Array | int) -> Array:
    """Compute the error of the mean of even angles over the deviation (measured)."""
    return np.asarray(0.8 * count**-0.8)
