"""Angles that are not uniform together with effects: the compiled engine says what they give."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq

from dogshape.diagnosis.bench.bench_data import Bench, load_bench
from dogshape.diagnosis.prediction.angle_profiles import laid
from dogshape.diagnosis.prediction.bank import Plan, blocks_at, collect, settings_of, times_of
from dogshape.diagnosis.prediction.emulator import BankEmulator
from dogshape.diagnosis.prediction.flight import touch_time
from dogshape.diagnosis.prediction.levels import Level
from dogshape.diagnosis.prediction.outliers import bulk
from dogshape.diagnosis.prediction.touch_phases import TouchPhases
from dogshape.sim.effects import load
from dogshape.sim.setting import Setting
from dogshape.sim.statistics.batch import run_block
from dogshape.sim.statistics.blocks import Block, even_block
from dogshape.sim.statistics.shift_records import Record
from tests.made_up import few_cells

EFFECTS = load()
CELLS = [(10, 235.2), (25, 315.5), (50, 641.5)]
ANGLES = 96  #: of what is simulated directly
SIZES = {
    "actuation_lag": [(0.05,), (0.15,), (0.32,)],
    "moving_mass": [(0.7,), (3.0,), (7.0,)],
    "mismatch_speed": [(-2.0, 0.9), (1.5, 1.1), (3.0, 0.8)],
}
PREFERRED = [(4.0, 0.1), (8.0, 0.45), (2.0, 0.8)]
PLAN = Plan(tuple(EFFECTS[name] for name in (*SIZES, "relative_angle")), checks=())


def run_blocks(blocks: Sequence[Block]) -> list[list[Record]]:
    """Simulate blocks (a ``Runner``)."""
    return [list(run_block(block)) for block in blocks]


@pytest.fixture(scope="module")
def bench() -> Bench:
    found = few_cells(load_bench("mq200_adams"), CELLS)
    return replace(found, clutch=found.clutch.with_engine("planar"))


@pytest.fixture(scope="module")
def emulator(bench: Bench) -> BankEmulator:
    return BankEmulator(collect(PLAN, bench, run_blocks))


def _direct(setting: Setting, seed: int) -> float:
    """Return the mean of shifts at many angles, weighted as the setting says."""
    block = even_block(setting.clutch, setting.point, ANGLES, (seed, 5))
    times = bulk(np.array(times_of(setting, run_blocks([block])[0])))
    known = np.isfinite(times)
    weights = setting.weights(block.angles) * known
    return float((weights * np.where(known, times, 0.0)).sum() / weights.sum())


@pytest.mark.parametrize("name", sorted(SIZES))
def test_weighted_angles_with_an_effect_are_what_shifts_there_take(
    name: str, bench: Bench, emulator: BankEmulator
) -> None:
    pair = tuple(sorted((name, "relative_angle")))
    scores, missed, alone = [], [], []
    for size, (sharp, centre) in zip(SIZES[name], PREFERRED, strict=True):
        values = (*size, sharp, centre) if pair[0] == name else (sharp, centre, *size)
        for cell, setting in enumerate(settings_of(bench)):
            changed = Level(pair, values).setting(EFFECTS, setting)
            true = _direct(changed, cell)
            found = emulator.at(pair, np.array([values]), cell)
            scores.append((found.times.mean() - true) / np.hypot(found.error, found.common)[0])
            missed.append(found.times.mean() / true - 1.0)
            # What weights on the baseline's own angles give, times the effect alone.
            base, angle, effect = (
                emulator.at(h, np.array([v]), cell).times.mean()
                for h, v in (
                    ((), ()),
                    (("relative_angle",), (sharp, centre)),
                    ((name,), size),
                )
            )
            alone.append(angle * effect / base / true - 1.0)
    assert np.sqrt(np.mean(np.square(scores))) < 1.5
    assert np.sqrt(np.mean(np.square(missed))) < 0.05
    assert np.sqrt(np.mean(np.square(missed))) < 0.5 * np.sqrt(np.mean(np.square(alone)))


def test_joint_levels_are_weighted_by_their_own_angles(
    bench: Bench, emulator: BankEmulator
) -> None:
    """At a level of effects together, what shifts of that level give."""
    pair = ("mismatch_speed", "moving_mass")
    levels = [
        Level(pair, (2.0, 0.9, 3.0)),
        Level(pair, (-2.0, 1.1, 5.0)),
        Level(pair, (1.0, 1.0, 8.0)),
    ]
    blocks = [blocks_at(PLAN, emulator.bank.settings, level) for level in levels]
    settings = settings_of(bench)
    times = [
        [
            times_of(level.setting(EFFECTS, setting), rows)
            for setting, rows in zip(settings, run_blocks(mine), strict=True)
        ]
        for level, mine in zip(levels, blocks, strict=True)
    ]
    known = emulator.with_levels(levels, np.array(times))
    scores, missed = [], []
    for level, preferred in zip(levels, PREFERRED, strict=True):
        asked = Level((*pair, "relative_angle"), (*level.values, *preferred))
        for cell, setting in enumerate(settings):
            true = _direct(asked.setting(EFFECTS, setting), cell)
            found = known.at(asked.hypothesis, np.array([asked.values]), cell)
            missed.append(found.times.mean() / true - 1.0)
            scores.append((found.times.mean() - true) / np.hypot(found.error, found.common)[0])
    assert np.sqrt(np.mean(np.square(scores))) < 1.0
    # One level has a jump where most of its angles are, known to a sixteenth of the pitch.
    assert np.median(np.abs(missed)) < 0.015


def test_hardly_preferred_angles_change_nothing(emulator: BankEmulator) -> None:
    for cell in range(len(CELLS)):
        plain = emulator.at(("moving_mass",), np.array([[2.0]]), cell)
        even = emulator.at(("moving_mass", "relative_angle"), np.array([[2.0, 1e-7, 0.3]]), cell)
        assert even.times == pytest.approx(plain.times, rel=1e-5)
        assert even.error == pytest.approx(plain.error, rel=1e-3)
        assert even.engaged == pytest.approx(plain.engaged, abs=1e-6)


def test_a_ring_without_friction_touches_where_its_force_is_integrated_twice(
    bench: Bench,
) -> None:
    """F (3 s^2 - 2 s^3), s = t/T, moves the ring by F T^2/m (s^4/4 - s^5/10) while it rises."""
    setting = settings_of(bench)[0].with_mechanism(friction=0.0)
    clutch, profile = setting.clutch, setting.point.profile
    mass = clutch.rings.mass + clutch.mechanism.added_mass
    way = clutch.dog.axial_gap * mass / (profile.force * profile.rise**2)
    share = brentq(lambda s: s**4 / 4.0 - s**5 / 10.0 - way, 0.0, 1.0)
    assert touch_time(setting) == pytest.approx(share * profile.rise, rel=1e-3)


def test_phases_between_nodes_are_those_of_flights(bench: Bench) -> None:
    settings = settings_of(bench)
    phases = TouchPhases(EFFECTS, settings)
    for name, sizes in SIZES.items():
        found = phases.at({name: np.array(sizes)}, len(sizes))
        for place, size in enumerate(sizes):
            for cell, setting in enumerate(settings):
                changed = Level((name,), size).setting(EFFECTS, setting)
                assert found[cell, place] == pytest.approx(phases.of(changed), abs=0.01)


@pytest.mark.parametrize("gap_mm", [0.3, 0.8, 0.82])
def test_phases_are_those_of_flights_down_to_no_gap_at_all(bench: Bench, gap_mm: float) -> None:
    settings = [one.with_dog(axial_gap=1e-3 * gap_mm) for one in settings_of(bench)]
    left = np.array([0.02, 0.05, 0.1, 0.15, 0.25])  # mm
    offsets = np.array([*(left - gap_mm), 0.05, 0.7])
    found = TouchPhases(EFFECTS, settings)
    phases = found.at({"axial_gap": offsets[:, None]}, len(offsets))
    for cell, setting in enumerate(settings):
        for place, offset in enumerate(offsets):
            changed = Level(("axial_gap",), (offset,)).setting(EFFECTS, setting)
            assert phases[cell, place] == pytest.approx(found.of(changed), abs=0.002)


def test_times_are_laid_over_the_pitch_periodically() -> None:
    times = np.array([0.1, 0.2, np.inf, 0.4])
    logs, engaged = laid(times, np.array([0.9, 1.15, 1.4, 1.65]), np.array([0.15, 0.4, 0.025]))
    assert np.exp(logs[0]) == pytest.approx(0.2)
    # Between its neighbours, in the logarithm, where nothing engaged.
    assert np.exp(logs[1]) == pytest.approx(np.sqrt(0.2 * 0.4))
    assert np.exp(logs[2]) == pytest.approx(np.sqrt(0.1 * 0.2))
    assert engaged == pytest.approx([1.0, 0.0, 1.0])
