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

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

from dogshape.diagnosis.bench.bench_data import Bench
from dogshape.diagnosis.terms import Array, Hypothesis
from dogshape.sim.effect import Effect, Parameter
from dogshape.sim.setting import Sensor, Setting
from dogshape.sim.shift.conclusion import Outcome
from dogshape.sim.statistics.blocks import Block, Runner, even_block
from dogshape.sim.statistics.shift_records import Record, content_key
from dogshape.sim.units import RPM

ANGLES = 16  #: even relative angles of each level
DENSE = 3  #: times as many angles of the baseline
ALONG, PLANE = 9, 33  #: levels of one parameter, and of two or more
WIDER = 0.5  #: of a prior's range, by which it is widened at either end
SEED = 1  #: of where the angles begin
PRECISE = 1e-6  #: accuracy of the convex integrator, at least: a mean of 16 angles errs by more


@dataclass(frozen=True)
class Level:
    """A hypothesis with values of all its parameters, effect by effect: one bench to simulate."""

    hypothesis: Hypothesis
    values: tuple[float, ...] = ()

    def setting(self, effects: Mapping[str, Effect], baseline: Setting) -> Setting:
        """Apply the effects to a setting; DogshapeError where there is no such bench."""
        left = list(self.values)
        for name in self.hypothesis:
            names = [parameter.name for parameter in effects[name].parameters]
            mine, left = left[: len(names)], left[len(names) :]
            baseline = effects[name].apply(baseline, dict(zip(names, mine, strict=True)))
        return baseline


@dataclass(frozen=True)
class Simulated:
    """Simulated times at C operating points, s; ``inf`` did not engage, NaN is not known."""

    settings: tuple[Setting, ...]  #: baseline of each operating point
    angles: Array  #: relative angles, rad, (C, DENSE * ANGLES)
    baseline: Array  #: times at them, (C, DENSE * ANGLES)
    common: NDArray[np.int64]  #: places of the levels' angles among them, (C, ANGLES)
    levels: tuple[Level, ...]  #: in the order of ``times``
    times: Array  #: without delays of the reading, (L, C, ANGLES)

    def spread(self, times: Array) -> Array:
        """Place times (..., C, ANGLES) among the baseline's angles, NaN between them."""
        found = np.full((*times.shape[:-1], self.angles.shape[1]), np.nan)
        np.put_along_axis(found, np.broadcast_to(self.common, times.shape), times, axis=-1)
        return found

    def of(self, hypothesis: Hypothesis) -> list[int]:
        """List the places of a hypothesis' levels."""
        return [k for k, level in enumerate(self.levels) if level.hypothesis == hypothesis]


def settings_of(bench: Bench, sensor: Sensor) -> tuple[Setting, ...]:
    """List the operating points of a bench without any effect, as they are simulated."""
    clutch = bench.clutch
    if clutch.solver.scheme == "cenic":
        accuracy = max(PRECISE, clutch.solver.accuracy)
        clutch = replace(clutch, solver=replace(clutch.solver, accuracy=accuracy))
    return tuple(Setting(clutch, cell.point, sensor=sensor) for cell in bench.cells)


def with_wide_range(effect: Effect, setting: Setting) -> Effect:
    """Widen the ranges of an effect's parameters where such a bench exists."""
    for name in [parameter.name for parameter in effect.parameters]:
        for upper, part in itertools.product((True, False), (1.0, 0.6, 0.3)):
            (now,) = (p for p in effect.parameters if p.name == name)
            wider = now.widened(WIDER * part, upper=upper)
            if wider == now or (not upper and now.neutral_of(setting) <= now.low):
                continue
            end = wider.high if upper else wider.low
            if effect.possible(setting, {**effect.neutral(setting), name: end}):
                every = tuple(wider if p.name == name else p for p in effect.parameters)
                effect = replace(effect, parameters=every)
                break
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
    count = len(effect.parameters)
    shares, steps = np.zeros((1, 0)), 4 * (ALONG - 1)
    if count == 1:
        shares = np.linspace(0.0, 1.0, steps + 1)[:, None]
    elif count:
        corners = np.array(list(itertools.product((0.0, 1.0), repeat=count)))
        shares = np.vstack([corners, qmc.Sobol(count, scramble=False).random_base2(7)])
    ends, levels, places = extremes(settings), list[Level](), list[list[float]]()
    for row in shares.tolist():
        values = {p.name: p.at(share) for p, share in zip(effect.parameters, row, strict=True)}
        if all(effect.possible(setting, values) for setting in ends):
            levels.append(Level((effect.name,), tuple(values.values())))
            places.append(row)
    if count == 0 or not levels:
        return tuple(levels)
    known = np.array(places)
    if count == 1:
        even = (steps * np.linspace(known[0, 0], known[-1, 0], ALONG)).round() / steps
        return tuple(levels[k] for k in np.flatnonzero(np.isin(known[:, 0], even)))
    # Each level is farthest from all before it.
    chosen, near = [0], np.linalg.norm(known - known[0], axis=1)
    while len(chosen) < min(PLANE, len(known)):
        chosen.append(int(near.argmax()))
        near = np.minimum(near, np.linalg.norm(known - known[chosen[-1]], axis=1))
    return tuple(levels[k] for k in chosen)


def extremes(settings: Sequence[Setting]) -> list[Setting]:
    """Select the operating points of least and largest force and mismatch."""
    keys = (lambda s: s.point.profile.force, lambda s: abs(s.point.mismatch))
    return [end(settings, key=key) for key in keys for end in (min, max)]


def simulate(effects: Mapping[str, Effect], settings: Sequence[Setting], run: Runner) -> Simulated:
    """Simulate baseline and all levels of effects."""
    settings = tuple(settings)
    levels = [one for effect in effects.values() for one in levels_of(effect, settings)]
    dense = [_block(setting, setting, DENSE) for setting in settings]
    changed = [[level.setting(effects, setting) for setting in settings] for level in levels]
    blocks = [_block(*pair) for row in changed for pair in zip(row, settings, strict=True)]
    rows = iter(run(dense + blocks))
    baseline = np.array([read_times(s, next(rows)) for s in settings])
    times = [[read_times(replace(one, delay=0.0), next(rows)) for one in row] for row in changed]
    angles = np.array([block.angles for block in dense])
    fewer = np.array([_block(setting, setting).angles for setting in settings])
    common = np.argmin(abs(fewer[:, :, None] - angles[:, None]), axis=2)
    whole = np.array(times).reshape(len(levels), len(settings), ANGLES)
    return Simulated(settings, angles, baseline, common, tuple(levels), whole)


def simulate_benches(
    changed: Sequence[Sequence[Setting]], settings: Sequence[Setting], run: Runner
) -> Array:
    """Simulate n benches at all angles of their baselines, s, (n, C, DENSE * ANGLES).

    ``changed`` are the settings of each bench at the C operating points.
    """
    pairs = [pair for row in changed for pair in zip(row, settings, strict=True)]
    rows = run([_block(setting, baseline, DENSE) for setting, baseline in pairs])
    times = [
        read_times(replace(setting, delay=0.0), row)
        for (setting, _), row in zip(pairs, rows, strict=True)
    ]
    return np.array(times).reshape(len(changed), len(settings), DENSE * ANGLES)


def _block(changed: Setting, baseline: Setting, dense: int = 1) -> Block:
    """Build the block of a setting at the angles of its baseline, each point's own draw."""
    point = baseline.point
    record = {"mismatch_rpm": point.mismatch / RPM, **point.profile.record}
    draw = (SEED, int(content_key(record), 16))
    return even_block(changed.clutch, changed.point, dense * ANGLES, draw, ANGLES)


def read_times(setting: Setting, rows: Sequence[Record]) -> Array:
    """Read times as the bench does, s, (n,): inf where not engaged, NaN where failed."""
    failed = [row["outcome"] == Outcome.DIVERGED.value for row in rows]
    times = [np.inf if (time := setting.time_of(row)) is None else time for row in rows]
    return np.where(failed, np.nan, times)
