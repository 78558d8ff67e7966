"""Simulated shift times of one clutch at a data set's operating points, with each effect at levels.

All levels have the same even relative angles at an operating point, so levels differ by their
physics alone. The baseline has further angles between. Levels of one parameter are even in the
share of its range; those of two fill the plane, each farthest from all before it. Ranges are wider
than the usual ones of the priors wherever such a bench exists.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

from dogshape.bench.bench_data import Bench
from dogshape.diagnosis.prediction.angle_cells import average_cells
from dogshape.diagnosis.prediction.moments import LATE_DISTANCES, quantiles
from dogshape.diagnosis.terms import Array, Hypothesis
from dogshape.sim.effect import Effect, Parameter
from dogshape.sim.setting import Sensor, Setting
from dogshape.sim.shift.clutch import OperatingPoint
from dogshape.sim.statistics.blocks import Block, Runner, even_block
from dogshape.sim.statistics.shift_records import content_key
from dogshape.sim.units import RPM

ANGLES = 16  #: even relative angles of each level
DENSE_FACTOR = 3  #: angles of the baseline over those of a level
LINE_LEVELS = 9  #: levels of one parameter
PLANE_LEVELS = 33  #: levels of two or more parameters
ANGLE_SEED = 1  #: of the first relative angle
MIN_LATE_DELAY_S = 8e-3  #: s, of a late shift behind the median
MIN_LATE_PASSING = 0.5  #: of the passing time of a slot, the same
MIN_ACCURACY = 1e-6  #: of the convex integrator: a mean of 16 angles errs by more


@dataclass(frozen=True)
class Level:
    """A hypothesis with values of all its parameters, effect by effect: one bench to simulate."""

    hypothesis: Hypothesis
    values: tuple[float, ...] = ()

    def setting(self, effects: Mapping[str, Effect], baseline: Setting) -> Setting:
        """Apply the effects to a setting.

        Raises DogshapeError where there is no such bench.
        """
        values = iter(self.values)
        setting = baseline
        for name in self.hypothesis:
            effect = effects[name]
            parameters = {parameter.name: next(values) for parameter in effect.parameters}
            setting = effect.apply(setting, parameters)
        return setting


@dataclass(frozen=True)
class SimulatedTimes:
    """Simulated times at C operating points, s; ``inf`` did not engage, NaN is not known."""

    settings: tuple[Setting, ...]  #: baseline of each operating point
    angles: Array  #: relative angles, rad, (C, DENSE_FACTOR * ANGLES)
    baseline_times: Array  #: means of the cells of these angles, (C, DENSE_FACTOR * ANGLES)
    level_angles: NDArray[np.int64]  #: indices of the levels' angles among them, (C, ANGLES)
    baseline_level_times: Array  #: of the baseline at the levels' angles, (C, ANGLES)
    levels: tuple[Level, ...]  #: in the order of ``times``
    times: Array  #: without delays of the reading, (L, C, ANGLES)

    @cached_property
    def min_late_delay(self) -> Array:
        """Smallest delay of a late shift behind the median, s, (C,), by the baseline."""
        return min_late_delay(self.settings, self.baseline_times)

    def spread_times(self, times: Array) -> Array:
        """Place times (..., C, ANGLES) at the baseline's angles, NaN between them."""
        spread = np.full((*times.shape[:-1], self.angles.shape[1]), np.nan)
        indices = np.broadcast_to(self.level_angles, times.shape)
        np.put_along_axis(spread, indices, times, axis=-1)
        return spread

    def level_indices(self, hypothesis: Hypothesis) -> list[int]:
        """List the indices of a hypothesis' levels."""
        return [k for k, level in enumerate(self.levels) if level.hypothesis == hypothesis]


def settings_of(bench: Bench, sensor: Sensor) -> tuple[Setting, ...]:
    """List the settings to simulate a bench without any effect, one for each operating point."""
    clutch = bench.clutch
    if clutch.solver.scheme == "cenic":
        accuracy = max(MIN_ACCURACY, clutch.solver.accuracy)
        clutch = replace(clutch, solver=replace(clutch.solver, accuracy=accuracy))
    return tuple(Setting(clutch, cell.point, sensor=sensor) for cell in bench.cells)


def widen_ranges(effect: Effect, setting: Setting, extension: float) -> Effect:
    """Widen the range of each parameter at both ends, as far as a bench exists at the new end.

    ``extension`` is the largest one, as a share of the range.
    """
    for name in [parameter.name for parameter in effect.parameters]:
        for upper in (True, False):
            effect = _widen_range(effect, name, setting, extension, upper=upper)
    return effect


def _widen_range(
    effect: Effect, name: str, setting: Setting, extension: float, *, upper: bool
) -> Effect:
    """Widen one end of the range of the parameter ``name``.

    It stays where no bench exists beyond it, and the lower end where no effect lies above it.
    """
    (parameter,) = (p for p in effect.parameters if p.name == name)
    if not upper and parameter.neutral_of(setting) <= parameter.low:
        return effect
    for share in (1.0, 0.6, 0.3):
        wider = parameter.widened(extension * share, upper=upper)
        end = wider.high if upper else wider.low
        is_possible = effect.possible(setting, {**effect.neutral(setting), name: end})
        if wider != parameter and is_possible:
            parameters = tuple(wider if p.name == name else p for p in effect.parameters)
            return replace(effect, parameters=parameters)
    return effect


def coordinate(parameter: Parameter, values: Array, setting: Setting) -> Array:
    """Compute coordinates in which times change evenly: the value, or a logarithm.

    Where the prior is uniform in the logarithm and nothing is neutral, ``ln(1 + v / low)`` has the
    baseline at 0.
    """
    if parameter.scale == "uniform":
        return np.asarray(values, dtype=float)
    if parameter.neutral_of(setting) == 0.0:
        return np.asarray(np.log1p(values / parameter.low))
    return np.asarray(np.log(values))


def levels_of(effect: Effect, settings: Sequence[Setting]) -> tuple[Level, ...]:
    """List the levels of an effect that exist at all operating points, spread over its range."""
    parameters = len(effect.parameters)
    steps = 4 * (LINE_LEVELS - 1)
    ends = extremes(settings)
    levels = list[Level]()
    rows = list[list[float]]()
    for row in _candidate_shares(parameters, steps).tolist():
        values = {p.name: p.at(share) for p, share in zip(effect.parameters, row, strict=True)}
        if all(effect.possible(setting, values) for setting in ends):
            levels.append(Level((effect.name,), tuple(values.values())))
            rows.append(row)
    if parameters == 0 or not levels:
        return tuple(levels)
    shares = np.array(rows)
    if parameters == 1:
        even_shares = np.linspace(shares[0, 0], shares[-1, 0], LINE_LEVELS)
        on_grid = (steps * even_shares).round() / steps
        return tuple(levels[k] for k in np.flatnonzero(np.isin(shares[:, 0], on_grid)))
    return tuple(levels[k] for k in _spread_points(shares, PLANE_LEVELS))


def _candidate_shares(parameters: int, steps: int) -> Array:
    """List shares of the ranges at which levels may lie, (n, parameters)."""
    if parameters == 0:
        return np.zeros((1, 0))
    if parameters == 1:
        return np.linspace(0.0, 1.0, steps + 1)[:, None]
    corners = np.array(list(itertools.product((0.0, 1.0), repeat=parameters)))
    sobol = qmc.Sobol(parameters, scramble=False).random_base2(7)
    return np.vstack([corners, sobol])


def _spread_points(points: Array, max_count: int) -> list[int]:
    """Choose points (n, d) of which each is farthest from all before it, by their indices."""
    indices = [0]
    distance = np.linalg.norm(points - points[0], axis=1)
    while len(indices) < min(max_count, len(points)):
        farthest = int(distance.argmax())
        indices.append(farthest)
        distance = np.minimum(distance, np.linalg.norm(points - points[farthest], axis=1))
    return indices


def extremes(settings: Sequence[Setting]) -> list[Setting]:
    """Select the operating points of smallest and largest force and mismatch, four."""
    keys = (lambda s: s.point.profile.force, lambda s: abs(s.point.mismatch))
    return [end(settings, key=key) for key in keys for end in (min, max)]


def simulate(
    effects: Mapping[str, Effect], settings: Sequence[Setting], runner: Runner
) -> SimulatedTimes:
    """Simulate the baseline and all levels of effects."""
    levels = [level for effect in effects.values() for level in levels_of(effect, settings)]
    dense_blocks = [_block(setting, setting, DENSE_FACTOR) for setting in settings]
    level_settings = []
    level_blocks = []
    for level in levels:
        for baseline in settings:
            setting = level.setting(effects, baseline)
            level_settings.append(setting)
            level_blocks.append(_block(setting, baseline))
    records = iter(runner(dense_blocks + level_blocks))
    baseline_times = np.array([setting.times_of(next(records)) for setting in settings])
    times = [replace(setting, delay=0.0).times_of(next(records)) for setting in level_settings]
    angles = np.array([block.angles for block in dense_blocks])
    even_angles = np.array([_block(setting, setting).angles for setting in settings])
    level_angles = np.argmin(abs(even_angles[:, :, None] - angles[:, None]), axis=2)
    late_delay = min_late_delay(settings, baseline_times)
    return SimulatedTimes(
        settings=tuple(settings),
        angles=angles,
        baseline_times=average_cells(dense_blocks, settings, baseline_times, late_delay, runner),
        level_angles=level_angles,
        baseline_level_times=np.take_along_axis(baseline_times, level_angles, axis=1),
        levels=tuple(levels),
        times=np.array(times).reshape(len(levels), len(settings), ANGLES),
    )


def simulate_benches(
    benches: Sequence[Sequence[Setting]],
    baseline: SimulatedTimes,
    runner: Runner,
    *,
    is_dense: bool = True,
) -> Array:
    """Simulate n benches at the angles of their baselines, s, (n, C, DENSE_FACTOR * ANGLES).

    ``benches`` are the settings of each bench at the C operating points. Where ``is_dense``, all
    angles are simulated, and times are means of their cells; else those of the levels alone, NaN
    between them.
    """
    density = DENSE_FACTOR if is_dense else 1
    pairs = [pair for bench in benches for pair in zip(bench, baseline.settings, strict=True)]
    blocks = [_block(setting, baseline_setting, density) for setting, baseline_setting in pairs]
    readings = [replace(setting, delay=0.0) for setting, _ in pairs]
    records = runner(blocks)
    times = np.array([s.times_of(rows) for s, rows in zip(readings, records, strict=True)])
    shape = (len(benches), len(baseline.settings), density * ANGLES)
    if not is_dense:
        return baseline.spread_times(times.reshape(shape))
    late_delays = np.tile(baseline.min_late_delay, len(benches))
    return average_cells(blocks, readings, times, late_delays, runner).reshape(shape)


def min_late_delay(settings: Sequence[Setting], times: Array) -> Array:
    """Compute the smallest delay of a late shift behind the median, s, (C,).

    ``times`` are those of the baseline, s, (C, A).
    """
    fast, median = quantiles(times, (0.1, 0.5))
    passing_times = np.array([passing_time(setting) for setting in settings])
    min_delay = np.maximum(MIN_LATE_PASSING * passing_times, MIN_LATE_DELAY_S)
    return np.maximum(LATE_DISTANCES * (median - fast), min_delay)


def passing_time(setting: Setting) -> float:
    """Compute the time in which the rings turn by one pitch, at most the time-out, s."""
    slip = abs(setting.point.mismatch)
    timeout = setting.clutch.timeout
    if slip == 0.0:
        return timeout
    return min(timeout, setting.clutch.dog.pitch_angle / slip)


def _block(setting: Setting, baseline: Setting, density: int = 1) -> Block:
    """Build the block of a setting at the even angles of its baseline's operating point."""
    draw = (ANGLE_SEED, _angle_index(baseline.point))
    return even_block(setting.clutch, setting.point, density * ANGLES, draw, ANGLES)


@lru_cache(maxsize=128)
def _angle_index(point: OperatingPoint) -> int:
    """Return the index of the draw of an operating point's angles; all levels share it."""
    record = {"mismatch_rpm": point.mismatch / RPM, **point.profile.record}
    return int(content_key(record), 16)
