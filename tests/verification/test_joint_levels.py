"""Effects simulated together: limits of the correction, and a clutch of closed form."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from dogshape.diagnosis.bench.bench_data import Bench, load_bench
from dogshape.diagnosis.prediction.bank import Bank, Plan, collect, settings_of, times_at
from dogshape.diagnosis.prediction.emulator import BankEmulator
from dogshape.diagnosis.prediction.joint_levels import JointLevels
from dogshape.diagnosis.prediction.levels import Level
from dogshape.diagnosis.terms import Array
from dogshape.sim.effects import load
from dogshape.sim.shift.clutch import Clutch
from dogshape.sim.statistics.blocks import Block
from dogshape.sim.statistics.shift_records import Record
from tests.made_up import few_cells, made_up, mean_time

EFFECTS = load()
PAIR = ("moving_mass", "sleeve_friction")
THREE = ("force_scale", "moving_mass", "sleeve_friction")
CELLS = [(25, 235.2), (50, 315.5), (100, 641.5)]
PLAN = Plan(tuple(EFFECTS[name] for name in (*THREE, "relative_angle")), checks=())


@pytest.fixture(scope="module")
def bench() -> Bench:
    return few_cells(load_bench("mq200_adams"), CELLS)


@pytest.fixture(scope="module")
def bank(bench: Bench) -> Bank:
    return collect(PLAN, bench, _bound)


def _factor(clutch: Clutch) -> float:
    """Return by how much shifts take longer where mass and friction come together."""
    mechanism = clutch.mechanism
    mass, friction = mechanism.added_mass / 3.0, mechanism.friction / 100.0
    return float(np.exp(min(1.0, mass) * min(1.0, friction)))


def _bound(blocks: Sequence[Block]) -> list[list[Record]]:
    """Simulate blocks of a clutch whose mass and friction act together (a ``Runner``)."""
    factors = [_factor(block.clutch) for block in blocks]
    return [
        [{**row, "shift_time_s": factor * row["shift_time_s"]} for row in rows]
        for factor, rows in zip(factors, made_up(blocks), strict=True)
    ]


def _levels(some: tuple[str, ...], count: int, seed: int) -> list[Level]:
    """Draw values of a middle part of the priors, of which there are benches."""
    parameters = [p for name in some for p in EFFECTS[name].parameters]
    shares = np.random.default_rng(seed).uniform(0.3, 0.75, (count, len(parameters)))
    return [
        Level(some, tuple(p.at(float(s)) for p, s in zip(parameters, row, strict=True)))
        for row in shares
    ]


def _times(bank: Bank, levels: list[Level]) -> Array:
    return times_at(PLAN, bank.settings, levels, _bound)


def _scores(emulator: BankEmulator, bench: Bench, levels: list[Level]) -> tuple[Array, Array]:
    """Return misses of the mean over their errors, and those errors over the mean, (L, C)."""
    scores, errors = [], []
    for level in levels:
        for cell, setting in enumerate(settings_of(bench)):
            changed = level.setting(EFFECTS, setting)
            true = _factor(changed.clutch) * mean_time(changed.clutch, changed.point)
            found = emulator.at(level.hypothesis, np.array([level.values]), cell)
            error = float(np.hypot(found.error, found.common)[0])
            scores.append((float(found.times.mean()) - true) / error)
            errors.append(error / true)
    return np.array(scores), np.array(errors)


@pytest.mark.parametrize(
    ("some", "left", "worst"),
    [((PAIR, PAIR), 0.2, 1.0), ((PAIR, THREE), 0.2, 1.0), ((THREE, THREE), 0.6, 3.0)],
)
def test_joint_levels_show_what_no_effect_alone_does(
    some: tuple[tuple[str, ...], tuple[str, ...]],
    left: float,
    worst: float,
    bench: Bench,
    bank: Bank,
) -> None:
    """Those of a pair serve three effects too; sixteen in the space of three are far apart."""
    simulated, asked = some
    plain = BankEmulator(bank)
    levels, fresh = _levels(simulated, 16, 1), _levels(asked, 16, 2)
    known = plain.with_levels(levels, _times(bank, levels))
    (before, wide), (after, narrow) = (_scores(one, bench, fresh) for one in (plain, known))
    assert np.sqrt(np.mean(after**2)) < worst
    missed = [np.sqrt(np.mean((s * e) ** 2)) for s, e in ((before, wide), (after, narrow))]
    assert missed[0] > 0.1
    assert missed[1] < left * missed[0]


def test_each_effect_alone_stays_what_it_is(bank: Bank) -> None:
    plain = BankEmulator(bank)
    levels = _levels(PAIR, 6, 1)
    known = plain.with_levels(levels, _times(bank, levels))
    for name, value in (("force_scale", 0.7), ("sleeve_friction", 60.0), ("moving_mass", 2.0)):
        one, other = (e.at((name,), np.array([[value]]), 1) for e in (plain, known))
        assert np.array_equal(one.times, other.times)
    # An effect of hardly any strength corrects nothing of the other.
    alone = known.at(("sleeve_friction",), np.array([[60.0]]), 1)
    both = known.at(PAIR, np.array([[1e-6, 60.0]]), 1)
    assert both.times.mean() == pytest.approx(alone.times.mean(), rel=1e-3)


def _joint(noise: float) -> JointLevels:
    sites = np.array([[[0.2, 0.3], [0.5, 0.5], [0.8, 0.4]]])
    return JointLevels(
        sites,
        np.full((1, 3), 0.2),
        np.array([[0.1, -0.15, 0.05]]),
        np.full((1, 3), noise),
        np.array([0.5, 0.5]),
    )


def test_exact_levels_are_met_and_nothing_is_known_far_away() -> None:
    joint = _joint(1e-6)
    weights, left = joint.weights(joint.sites, joint.stated)
    assert (weights @ joint.residual[..., None])[0, :, 0] == pytest.approx(joint.residual[0])
    assert left == pytest.approx(np.zeros((1, 3)), abs=1e-6)
    far, wide = joint.weights(np.array([[[40.0, 40.0]]]), np.array([[0.2]]))
    assert far == pytest.approx(np.zeros((1, 1, 3)), abs=1e-9)
    assert wide[0, 0] == pytest.approx((joint._fitted[1] * 0.2) ** 2)


def test_where_the_combination_has_no_error_nothing_is_corrected() -> None:
    weights, left = _joint(1e-3).weights(np.array([[[0.5, 0.5]]]), np.zeros((1, 1)))
    assert not weights.any()
    assert left[0, 0] == 0.0


def test_levels_without_a_mean_say_nothing() -> None:
    joint = _joint(1e-3)
    residual = joint.residual.copy()
    residual[0, 1] = np.nan
    some = JointLevels(joint.sites, joint.stated, residual, joint.noise, joint.lengths)
    weights, _ = some.weights(joint.sites, joint.stated)
    assert np.isfinite(weights).all()
    assert abs(weights[0, :, 1]).max() < 1e-3
