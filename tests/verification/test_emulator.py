"""The emulator against a clutch of closed form: means, errors that hold, shapes, combinations."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest

from dogshape.diagnosis.bench.bench_data import Bench, load_bench
from dogshape.diagnosis.prediction.angle_means import (
    binned,
    engaged_mean,
    even_variance,
    mean_covariance,
    with_dense,
)
from dogshape.diagnosis.prediction.bank import Plan, collect, settings_of
from dogshape.diagnosis.prediction.emulator import BankEmulator
from dogshape.diagnosis.prediction.level_curves import fit_curves
from dogshape.diagnosis.prediction.levels import Level
from dogshape.sim.effect import BenchTest, Effect, Parameter
from dogshape.sim.effects import load
from dogshape.sim.errors import InputError
from dogshape.sim.setting import Setting
from dogshape.sim.statistics.expectation import variance_of_mean
from tests.made_up import FACE, few_cells, made_up, mean_time

EFFECTS = load()
NAMES = ("actuation_delay", "actuation_lag", "moving_mass", "relative_angle", "sleeve_friction")
CELLS = [(5, 235.2), (25, 315.5), (50, 469.0), (249, 641.5)]


@pytest.fixture(scope="module")
def bench() -> Bench:
    return few_cells(load_bench("mq200_adams"), CELLS)


@pytest.fixture(scope="module")
def emulator(bench: Bench) -> BankEmulator:
    plan = Plan(tuple(EFFECTS[name] for name in NAMES))
    return BankEmulator(collect(plan, bench, made_up))


def _true(bench: Bench, level: Level, cell: int) -> float:
    setting = level.setting(EFFECTS, settings_of(bench)[cell])
    return mean_time(setting.clutch, setting.point) + setting.delay


def _drawn(name: str, count: int) -> np.ndarray:
    (parameter,) = EFFECTS[name].parameters
    shares = np.random.default_rng(4).random(count)
    return np.array([[parameter.at(float(share))] for share in shares])


@pytest.mark.parametrize(
    ("name", "size"), [("actuation_lag", 0.43), ("moving_mass", 0.52), ("sleeve_friction", 0.83)]
)
def test_means_between_levels_hold_within_their_errors(
    name: str, size: float, bench: Bench, emulator: BankEmulator
) -> None:
    """Scores are near one where levels differ, less where a curve through several averages."""
    values = _drawn(name, 60)
    scores, relative = [], []
    for cell in range(len(CELLS)):
        spread = emulator.at((name,), values, cell)
        true = np.array([_true(bench, Level((name,), tuple(v)), cell) for v in values])
        apart = spread.times.mean(axis=1) - true
        scores.append(apart / spread.error)
        relative.append(apart / true)
    # A lag changes nothing but when the dogs meet, so that its levels err independently.
    assert np.sqrt(np.mean(np.square(scores))) == pytest.approx(size, rel=0.25)
    assert np.mean(np.abs(scores) > 2.0) < 0.1
    assert np.sqrt(np.mean(np.square(relative))) < 0.03


def test_the_baseline_is_the_simulated_one(bench: Bench, emulator: BankEmulator) -> None:
    scores = []
    for cell in range(len(CELLS)):
        spread = emulator.at((), np.empty((1, 0)), cell)
        assert spread.times.shape == (1, 24)
        assert spread.times.mean() == pytest.approx(emulator.bank.baseline[cell].mean())
        scores.append((spread.times.mean() - _true(bench, Level(()), cell)) / spread.error[0])
    # Nothing is averaged here: one, within what four scores may be off it.
    assert 0.75 < np.sqrt(np.mean(np.square(scores))) < 1.35
    assert np.abs(scores).max() < 2.0


def test_an_effect_of_hardly_any_strength_is_the_baseline(emulator: BankEmulator) -> None:
    for name in ("moving_mass", "sleeve_friction", "actuation_lag"):
        for cell in range(len(CELLS)):
            none = emulator.at((), np.empty((1, 0)), cell)
            weak = emulator.at((name,), np.array([[1e-9]]), cell)
            assert weak.times.mean() == pytest.approx(none.times.mean(), rel=1e-6)
            # Errors may be larger: half of a variance is that of all levels on average.
            assert 0.9 < weak.error[0] / none.error[0] < 2.0


def test_a_delay_adds_to_all_times_exactly(emulator: BankEmulator) -> None:
    delays, mass = np.array([[0.0], [0.116]]), np.array([[0.4], [0.4]])
    late = emulator.at(("actuation_delay",), delays, 1)
    assert late.times[1] - late.times[0] == pytest.approx(np.full(24, 0.116))
    assert late.error[1] == late.error[0]
    both = emulator.at(("actuation_delay", "moving_mass"), np.hstack([delays, mass]), 1)
    alone = emulator.at(("moving_mass",), mass, 1)
    assert both.times[1] == pytest.approx(alone.times[1] + 0.116)
    assert both.error == pytest.approx(alone.error)


def test_a_delay_that_goes_with_the_force_is_that_of_each_operating_point(bench: Bench) -> None:
    """An effect of one's own may ask for the point at which it acts."""

    def change(setting: Setting, values: Mapping[str, float]) -> Setting:
        return replace(setting, delay=values["filling_s_kN"] * setting.point.profile.force / 1e3)

    size = Parameter("filling_s_kN", 0.0, 0.01, 0.5, "log-uniform", "made up")
    test = BenchTest("pressure", "Record it.")
    filling = Effect("filling", "fills late", (size,), change, test)
    emulator = BankEmulator(collect(Plan((filling,)), bench, made_up))
    for cell, (_, force) in enumerate(CELLS):
        none = emulator.at((), np.empty((1, 0)), cell)
        late = emulator.at(("filling",), np.array([[0.05], [0.2]]), cell)
        added = late.times - none.times
        expected = np.outer([0.05, 0.2], np.full(24, force / 1e3))
        assert added == pytest.approx(expected, rel=1e-9)


def test_spreads_have_the_shape_of_the_simulated_times(
    bench: Bench, emulator: BankEmulator
) -> None:
    """Without a face no wait: 60 % at the flight, the others even up to its slot's pass."""
    values = np.array([[2.0]])
    spread = emulator.at(("moving_mass",), values, 0)
    assert (np.diff(spread.times[0]) >= 0.0).all()
    point = bench.cells[0].point
    whole = bench.clutch.dog.pitch_angle / point.mismatch
    free = _true(bench, Level(("moving_mass",), (2.0,)), 0) - 0.5 * FACE**2 * whole
    uncertain = 2.0 * spread.error[0] / spread.times.mean()
    assert uncertain < 0.12
    assert spread.times[0, :12] == pytest.approx(np.full(12, free), rel=uncertain)
    last = FACE * whole - 0.5 * whole / 24  # in the middle of the last twenty-fourth
    assert spread.times[0, -1] - free == pytest.approx(last, rel=uncertain)


def test_angles_in_the_slots_take_the_wait_away(bench: Bench, emulator: BankEmulator) -> None:
    """At 5 1/min angles change little in flight: places in the pitch decide who waits."""
    name = ("relative_angle",)
    spread = emulator.at(name, np.array([[10.0, 0.65], [10.0, 0.05], [1e-6, 0.3]]), 0)
    none = emulator.at((), np.empty((1, 0)), 0)
    whole = bench.clutch.dog.pitch_angle / bench.cells[0].point.mismatch
    assert spread.times[0].mean() < none.times.mean() - 0.7 * 0.5 * FACE**2 * whole
    assert spread.times[1].mean() > none.times.mean() + 0.1 * whole
    assert spread.times[2] == pytest.approx(none.times[0], rel=1e-4)


def test_pairs_hold_within_their_errors(bench: Bench, emulator: BankEmulator) -> None:
    pair = ("moving_mass", "sleeve_friction")
    assert emulator.combination.interactions.pairs[pair].own < 0.5
    values = np.hstack([_drawn("moving_mass", 40), _drawn("sleeve_friction", 40)[::-1]])
    scores = []
    for cell in range(len(CELLS)):
        spread = emulator.at(pair, values, cell)
        true = np.array([_true(bench, Level(pair, tuple(v)), cell) for v in values])
        error = np.hypot(spread.error, spread.common)
        scores.append((spread.times.mean(axis=1) - true) / error)
    assert np.sqrt(np.mean(np.square(scores))) < 1.5
    assert np.mean(np.abs(scores) > 2.0) < 0.15


def test_shares_engaged_fall_with_an_effect_that_makes_shifts_late(bench: Bench) -> None:
    """At 5 1/min a wait of up to 320 ms meets a time-out of 300 ms."""
    late = replace(bench, clutch=replace(bench.clutch, timeout=0.3))
    plan = Plan((EFFECTS["actuation_lag"],), checks=())
    emulator = BankEmulator(collect(plan, late, made_up))
    spread = emulator.at(("actuation_lag",), np.array([[0.003], [0.03], [0.1], [0.2]]), 0)
    whole = bench.clutch.dog.pitch_angle / bench.cells[0].point.mismatch
    setting = settings_of(late)[0]
    free = mean_time(setting.clutch, setting.point) - 0.5 * FACE**2 * whole
    true = 1.0 - FACE + np.minimum(FACE, (0.3 - free - np.array([0.003, 0.03, 0.1, 0.2])) / whole)
    # Between the last two levels, 0.095 and 0.3 s, it falls to nothing all at once.
    assert spread.engaged[:2] == pytest.approx(true[:2], abs=0.05)
    assert (np.abs(spread.engaged - true) < 2.5 * spread.engaged_error).all()
    assert spread.engaged_error[3] > 0.1


def test_an_effect_that_no_bank_holds_is_named(emulator: BankEmulator) -> None:
    with pytest.raises(InputError, match=r"does not have the effect 'moving_mas'.*moving_mass"):
        emulator.at(("moving_mas",), np.array([[1.0]]), 0)


def test_variance_over_even_angles_is_that_of_an_expectation() -> None:
    series = np.random.default_rng(3).random((5, 12))
    one_by_one = [variance_of_mean(row) for row in series]
    assert even_variance(series) == pytest.approx(one_by_one)


def test_equal_levels_have_no_error_against_each_other() -> None:
    times = 0.1 + 0.05 * np.random.default_rng(5).random((2, 1, 16)).repeat(3, axis=1)
    covariance = mean_covariance(times, np.full((2, 3), 0.3))
    apart = covariance[:, 0, 0] + covariance[:, 1, 1] - 2.0 * covariance[:, 0, 1]
    assert (apart < 0.011 * covariance[:, 0, 0]).all()
    dense = with_dense(covariance, covariance[:, 0, 0] / 5.0, 1.0 / 3.0)
    assert dense[:, 0, 0] == pytest.approx(covariance[:, 0, 0] / 5.0, rel=1e-3)
    assert (np.linalg.eigvalsh(dense) > 0.0).all()


def test_a_jump_between_two_angles_errs_by_itself_where_a_level_moves_it() -> None:
    """A saw-tooth moved by a tenth of the gap: correlation 1 - 6 x 0.1 x 0.9 = 0.46."""
    places, starts = np.arange(16) / 16, np.random.default_rng(2).random((400, 1)) / 16
    first, second = (places + starts) % 1.0, (places + starts + 0.1 / 16) % 1.0
    errors = first.mean(axis=1), second.mean(axis=1)
    assert np.corrcoef(*errors)[0, 1] == pytest.approx(0.46, abs=0.05)
    flights = np.array([0.1, 0.1 + 0.1 / 16])
    times = flights[:, None] + 0.5 * np.stack([first[0], second[0]])
    covariance = mean_covariance(times[None], np.ones((1, 2)))[0]
    like = covariance[0, 1] / np.sqrt(covariance[0, 0] * covariance[1, 1])
    assert 0.35 < like < 0.6


def test_times_at_equal_shares_keep_the_mean() -> None:
    times = np.array([0.3, 0.1, np.inf, 0.2, np.nan])
    assert binned(times, 3)[0] == pytest.approx([0.1, 0.2, 0.3])
    assert binned(times, 2)[0] == pytest.approx([0.4 / 3, 0.8 / 3])
    assert engaged_mean(times) == pytest.approx(0.2)
    twice = binned(times, 4, np.array([[1.0, 2.0, 1.0, 1.0, 1.0]]))
    assert twice[0] == pytest.approx([0.1, 0.1, 0.2, 0.3])


def test_curves_judge_themselves_by_levels_left_out() -> None:
    """The closed form of residuals left out is what leaving out and fitting again gives."""
    places = np.linspace(0.0, 1.0, 7)[None, :, None]
    means = np.sin(3.0 * places[..., 0])
    errors = 1e-4 * np.eye(7)[None]
    curves = fit_curves(places, means, errors, slice(0, 7))
    weights, _ = curves.weights(0, places[0, 3:4] + 0.05)
    assert weights.sum() == pytest.approx(1.0)
    assert weights @ means[0] == pytest.approx(np.sin(3.0 * 0.55), abs=0.02)
    left, k = [], np.arange(7)
    for out in range(7):
        keep = k != out
        fewer = replace(curves, sites=places[:, keep], inflation=1.0)
        fewer = fewer.like(curves.size, errors[:, keep][:, :, keep])
        w, v = fewer.weights(0, places[0, out : out + 1])
        left.append(float((means[0, out] - w @ means[0, keep])[0] ** 2 / (v[0] + 1e-4)))
    assert curves.inflation == pytest.approx(max(1.0, np.mean(left)), rel=1e-6)
