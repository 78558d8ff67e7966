"""Simulated shift times of one clutch at a data set's operating points, with each effect at levels.

All levels have the same even relative angles at an operating point, so levels differ by their
physics alone. The baseline has further angles between. Levels of one parameter are even in the
share of its range; those of two fill the plane, each farthest from all before it. Ranges are wider
than the usual ones of the priors wherever such a bench exists.

The times of a bank's shifts are one small file, kept by the inputs of the simulation. A series is a
bench at one operating point and its angles. Its key has all inputs of its first shift and the
programs' versions, so another bank takes the series that it shares.
"""

from __future__ import annotations

import itertools
import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

from dogshape.diagnosis.bench.bench_data import Bench
from dogshape.diagnosis.terms import Array, Hypothesis
from dogshape.sim.effect import Effect, Parameter
from dogshape.sim.errors import StorageError
from dogshape.sim.files import write_whole
from dogshape.sim.setting import Sensor, Setting
from dogshape.sim.shift.conclusion import Outcome
from dogshape.sim.statistics.blocks import Block, Runner, even_block
from dogshape.sim.statistics.shift_records import Record, content_key, unfinished
from dogshape.sim.units import RPM
from dogshape.sim.versions import engine

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

    @property
    def base(self) -> Array:
        """Times of the baseline at the angles of the levels, (C, ANGLES)."""
        return np.take_along_axis(self.baseline, self.common, axis=1)

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
                effect = effect.with_range(wider)
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


def simulate(
    effects: Mapping[str, Effect],
    settings: Sequence[Setting],
    run: Runner,
) -> Simulated:
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


def simulate_bench(
    changed: Sequence[Setting], settings: Sequence[Setting], run: Runner, dense: int = 1
) -> Array:
    """Simulate changed settings at the angles of their baselines, s, (C, dense * ANGLES)."""
    rows = run([_block(*pair, dense) for pair in zip(changed, settings, strict=True)])
    pairs = zip(changed, rows, strict=True)
    return np.array([read_times(replace(one, delay=0.0), row) for one, row in pairs])


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


TICK = 1e-5  #: s, in which times are kept
LATE = -1  #: stands for a shift that did not engage
FORMAT = 2


@dataclass
class BankStore:
    """Files of series, read in turn where they exist; the last one is written."""

    paths: Sequence[Path]

    @cached_property
    def series(self) -> dict[str, Record]:
        """All series of the files, by key; StorageError where a file is none."""
        found: dict[str, Record] = {}
        for path in self.paths:
            found |= _read(path)
        return found

    def missing(self, blocks: Iterable[Block]) -> list[Block]:
        """List the blocks that no file has, each series once."""
        found = {series_key(block): block for block in blocks}
        return [block for key, block in found.items() if key not in self.series]

    def times(self, blocks: Sequence[Block], run: Runner) -> list[list[Record]]:
        """Return the shifts of blocks; what no file has is simulated by ``run`` and written.

        A series that the clock cut short is simulated again the next time.
        """
        keys = [series_key(block) for block in blocks]
        left = {k: b for k, b in zip(keys, blocks, strict=True) if k not in self.series}
        fresh = dict[str, Record]()
        for key, rows in zip(left, run(list(left.values())) if left else [], strict=True):
            self.series[key] = _kept(rows)
            if not any(unfinished(row) for row in rows):
                fresh[key] = self.series[key]
        if fresh:
            _write(self.paths[-1], _read(self.paths[-1]) | fresh)
        return [_rows(self.series[key]) for key in keys]

    def save(self, path: Path, keys: Iterable[str]) -> None:
        """Write the series of some keys to a file of their own; KeyError where one is missing."""
        _write(path, {key: self.series[key] for key in keys})


def _write(path: Path, series: Record) -> None:
    lines = [f"{json.dumps(k)}:{json.dumps(s, separators=(',', ':'))}" for k, s in series.items()]
    text = f'{{"bank":{FORMAT},"series":{{\n' + ",\n".join(lines) + "\n}}\n"
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write_whole(path, text)
    except OSError as error:
        raise StorageError(
            f"{path} cannot be written ({error.strerror}); make room or give another folder"
        ) from error


def series_key(block: Block) -> str:
    """Return the key of a block: its angles are even, so the first and their number are enough."""
    return content_key({"first": block.first_key, "n": len(block.angles), **engine()})


def _kept(rows: Sequence[Record]) -> Record:
    """Return the times of a series; None failed to integrate, ``LATE`` did not engage."""

    def ticks(row: Record, time: float | None) -> int | None:
        if row["outcome"] == Outcome.DIVERGED.value:
            return None
        return LATE if time is None else round(time / TICK)

    kept: Record = {"t": [ticks(row, row["shift_time_s"]) for row in rows]}
    there = [ticks(row, row.get("actuator_time_s", row["shift_time_s"])) for row in rows]
    return kept if there == kept["t"] else {**kept, "actuator": there}


def _rows(kept: Record) -> list[Record]:
    times: list[int | None] = kept["t"]
    found: list[Record] = []
    for pair in zip(times, kept.get("actuator", times), strict=True):
        sleeve, actuator = (None if t in (None, LATE) else t * TICK for t in pair)
        outcome = Outcome.TIMED_OUT if sleeve is None else Outcome.ENGAGED
        outcome = Outcome.DIVERGED if pair[0] is None else outcome
        times_s = {"shift_time_s": sleeve, "actuator_time_s": actuator}
        found.append({"outcome": outcome.value, **times_s})
    return found


def _read(path: Path) -> dict[str, Record]:
    """Read the series of a file, none where it is missing; StorageError where it is no bank."""
    if not path.exists():
        return {}
    broken = f"{path} is not a bank of shifts; remove it to make it again"
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
        if found["bank"] != FORMAT or not all(
            isinstance(s["t"], list) for s in found["series"].values()
        ):
            raise StorageError(broken)
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise StorageError(f"{broken} ({type(error).__name__})") from error
    return dict(found["series"])
