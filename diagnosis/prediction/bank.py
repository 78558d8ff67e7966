"""Bank: shifts of one clutch with each effect at a few levels, at the bench's operating points.

A plan lists the levels. All levels have the same even relative angles at an operating point, so
that levels differ by their physics. The baseline has further angles between, since every hypothesis
rests on it. Effects that only change the reading of a shift need no shift. Pairs of effects are
predicted from both alone (``diagnosis.prediction.emulator``); a few are simulated to measure the
error of that.

With 28 operating points and the effects of the project the default plan has about 62 000 shifts.
One shift takes about 0.1 s of processor time, so two cores need 52 minutes. Fewer angles or levels
take less in proportion (``Plan.shifts``, ``Plan.hours``).

A mean of 16 angles errs by milliseconds, so both coefficients of friction are integrated with
``ACCURACY`` instead of the ten times smaller one of single shifts. That moves a mean by less than a
millisecond at a third of the cost, and is part of the numerical error that a bank measures.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import islice
from typing import cast

import numpy as np
from numpy.typing import NDArray

from dogshape.diagnosis.bench.bench_data import Bench
from dogshape.diagnosis.prediction.levels import TOGETHER, Level, check_level, levels_of, only_read
from dogshape.diagnosis.terms import Hypothesis
from dogshape.sim.effect import Effect
from dogshape.sim.errors import InputError
from dogshape.sim.setting import Sensor, Setting
from dogshape.sim.shift.outcome import Outcome
from dogshape.sim.statistics.blocks import Block, even_block
from dogshape.sim.statistics.numerical_error import Runner, numerical_ratio
from dogshape.sim.statistics.shift_records import Record, content_key
from dogshape.sim.units import RPM

Array = NDArray[np.float64]

ANGLES = 16  #: at each level
SHIFT = 0.1  #: s of processor time that a shift takes, about
ACCURACY = 1e-6  #: of the convex integrator, at least

#: Comes with every ring on its shaft, so it is simulated together with each other effect. Dead
#: time, which comes with every actuator, adds itself to any time and needs no shift.
COMMON = "sleeve_friction"
#: Other pairs that are simulated, as far as their effects are asked for.
CHECKS: tuple[Hypothesis, ...] = (
    ("actuation_lag", "moving_mass"),
    ("contact_friction", "mismatch_speed"),
    ("force_scale", "moving_mass"),
    ("linkage_compliance", "moving_mass"),
)


@dataclass(frozen=True)
class Plan:
    """Settings of a bank.

    Parameters
    ----------
    effects : to reckon with.
    angles : even relative angles of each level.
    dense : how many times as many the baseline has.
    levels, plane : numbers of levels of effects with one parameter and with two.
    checks : pairs to simulate; None for ``CHECKS`` and each effect with ``COMMON``.
    seed : of where the angles begin.
    """

    effects: tuple[Effect, ...]
    angles: int = ANGLES
    dense: int = 3
    levels: int = 5
    plane: int = 17
    checks: tuple[Hypothesis, ...] | None = None
    seed: int = 1

    def __post_init__(self) -> None:
        for name, least in (("angles", 4), ("dense", 1), ("levels", 2), ("plane", 3)):
            value = getattr(self, name)
            if value < least:
                raise InputError(
                    f"{name} of the bank is {value}, but must be at least {least}; give more"
                )

    @property
    def named(self) -> dict[str, Effect]:
        """The effects by name."""
        return {effect.name: effect for effect in self.effects}

    def levels_for(self, bench: Bench) -> tuple[Level, ...]:
        """Return all levels besides the baseline, pairs last."""
        setting = settings_of(bench)[0]
        own = {
            effect.name: levels_of(effect, setting, self.levels, self.plane)
            for effect in self.effects
            if not only_read(effect, setting)
        }
        asked = self.checks
        if asked is None:
            asked = (*CHECKS, *(both(COMMON, name) for name in own if name != COMMON))
        there = [pair for pair in asked if set(pair) <= set(own)]
        pairs = [check_level(pair, own, share) for share in TOGETHER for pair in there]
        # Of few levels both shares are the same one.
        return (*(level for levels in own.values() for level in levels), *dict.fromkeys(pairs))

    def shifts(self, bench: Bench) -> int:
        """Count the shifts of the bank of a bench, without those for the numerics."""
        each = self.dense + len(self.levels_for(bench))
        return len(bench.cells) * self.angles * each

    def hours(self, bench: Bench, cores: int = 2, shift: float = SHIFT) -> float:
        """Estimate the hours of the bank at ``shift`` s of processor time a shift."""
        return self.shifts(bench) * shift / cores / 3600.0


@dataclass(frozen=True)
class Bank:
    """Simulated times at C operating points, s; ``inf`` did not engage, NaN failed to integrate.

    ``angles`` (C, dense n) in rad and ``baseline`` alike; ``common`` (C, n) are the places of the
    levels' angles in them. ``times`` (L, C, n) belongs to ``levels``. ``numerics`` are mean and
    standard deviation of the numerical error of a shift, in spreads of its operating point.
    """

    effects: tuple[Effect, ...]
    settings: tuple[Setting, ...]
    angles: Array
    common: NDArray[np.int64]
    baseline: Array
    levels: tuple[Level, ...]
    times: Array
    numerics: tuple[float, float]

    def of(self, hypothesis: Hypothesis) -> list[int]:
        """Return the places of a hypothesis' levels."""
        return [k for k, level in enumerate(self.levels) if level.hypothesis == hypothesis]

    @property
    def base(self) -> Array:
        """Times of the baseline at the angles of the levels, (C, n)."""
        return np.take_along_axis(self.baseline, self.common, axis=1)


def both(one: str, other: str) -> Hypothesis:
    """Return two effects as a hypothesis."""
    first, second = sorted((one, other))
    return first, second


def settings_of(bench: Bench) -> tuple[Setting, ...]:
    """Return the operating points of a bench without any effect, as a bank simulates them."""
    sensor, clutch = cast(Sensor, bench.sensor.displacement_at), bench.clutch
    if clutch.solver.scheme == "cenic":
        accuracy = max(ACCURACY, clutch.solver.accuracy)
        clutch = replace(clutch, solver=replace(clutch.solver, accuracy=accuracy))
    return tuple(Setting(clutch, cell.point, sensor=sensor) for cell in bench.cells)


def blocks_of(plan: Plan, bench: Bench) -> Iterable[Block]:
    """Yield the shifts of a bank: the baseline at all operating points, then level by level."""
    settings = settings_of(bench)
    yield from _blocks(plan, settings, _changed(plan, plan.levels_for(bench), settings))


def blocks_at(plan: Plan, settings: Sequence[Setting], level: Level) -> list[Block]:
    """Return the shifts of a further level at all operating points, whose baselines are given."""
    (changed,) = _changed(plan, [level], settings)
    return [
        _block(setting, plan, _draw(start), 1)
        for setting, start in zip(changed, settings, strict=True)
    ]


def times_at(
    plan: Plan, settings: Sequence[Setting], levels: Sequence[Level], run: Runner
) -> Array:
    """Simulate further levels at all operating points by ``run``: times, s, (L, C, n)."""
    blocks = [block for level in levels for block in blocks_at(plan, settings, level)]
    rows = iter(run(blocks))
    changed = _changed(plan, levels, settings)
    return np.array([[times_of(one, next(rows)) for one in level] for level in changed])


def _changed(
    plan: Plan, levels: Iterable[Level], settings: Sequence[Setting]
) -> Iterator[list[Setting]]:
    """Yield the benches of a level at all operating points, level by level."""
    named = plan.named
    for level in levels:
        yield [level.setting(named, setting) for setting in settings]


def _blocks(
    plan: Plan, settings: Sequence[Setting], changed: Iterable[Sequence[Setting]]
) -> Iterator[Block]:
    """Yield the baseline at all operating points, then each bench of ``changed``."""
    draws = [_draw(setting) for setting in settings]
    for setting, draw in zip(settings, draws, strict=True):
        yield _block(setting, plan, draw, plan.dense)
    for level in changed:
        for setting, draw in zip(level, draws, strict=True):
            yield _block(setting, plan, draw, 1)


def _draw(setting: Setting) -> int:
    """Return the draw of an operating point's angles: its own, whichever others stand beside it."""
    point = setting.point
    return int(content_key({"mismatch_rpm": point.mismatch / RPM, **point.profile.record}), 16)


def _block(setting: Setting, plan: Plan, draw: int, dense: int) -> Block:
    whole = (plan.seed, draw)
    return even_block(setting.clutch, setting.point, dense * plan.angles, whole, plan.angles)


def collect(
    plan: Plan,
    bench: Bench,
    run: Runner,
    whole: Runner | None = None,
    numerics: tuple[float, float] | None = None,
) -> Bank:
    """Simulate a bank, or what is missing of it, and gather its times.

    ``run`` gives at least outcomes and times of shifts, and ``whole`` (``run`` by default) all that
    a record has; with an executor's journal behind them finished shifts are not simulated again,
    for whichever bench they were. ``numerics`` are those of the bank where they are known.
    """
    settings, levels = settings_of(bench), plan.levels_for(bench)
    changed = list(_changed(plan, levels, settings))
    blocks = list(_blocks(plan, settings, changed))
    rows = run(blocks)
    cells = len(settings)
    angles = np.array([block.angles for block in blocks[:cells]])
    common = _common(angles, np.array([b.angles for b in blocks[cells : 2 * cells]] or angles))
    left = iter(rows)
    base = [times_of(s, r) for s, r in zip(settings, islice(left, cells), strict=True)]
    times = [[times_of(setting, next(left)) for setting in level] for level in changed]
    return Bank(
        effects=plan.effects,
        settings=settings,
        angles=angles,
        common=common,
        baseline=np.array(base),
        levels=levels,
        times=np.array(times).reshape(len(levels), cells, common.shape[1]),
        numerics=numerics or _numerics(blocks[:cells], common, whole or run),
    )


def _common(angles: Array, fewer: Array) -> NDArray[np.int64]:
    """Return the places of fewer angles (C, n) among angles (C, dense n)."""
    return np.argmin(abs(fewer[:, :, None] - angles[:, None]), axis=2)


def _numerics(
    blocks: Sequence[Block], common: NDArray[np.int64], run: Runner
) -> tuple[float, float]:
    """Return the numerical error of the baseline's shifts at the levels' angles."""
    fewer = [block.only(mine.tolist()) for block, mine in zip(blocks, common, strict=True)]
    return numerical_ratio(fewer, run(fewer), run)


def times_of(setting: Setting, rows: Sequence[Record]) -> Array:
    """Read the times of shifts as a bench does, s, (n,)."""
    return np.array([_time(setting, row) for row in rows])


def _time(setting: Setting, row: Record) -> float:
    if row["outcome"] == Outcome.DIVERGED.value:
        return math.nan
    time = setting.time_of(row)
    return math.inf if time is None else time
