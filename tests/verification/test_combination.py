"""How two effects combine, where it is known: changes that add, and changes that multiply."""

from __future__ import annotations

import numpy as np
import pytest

from dogshape.diagnosis.prediction.bank import Bank
from dogshape.diagnosis.prediction.combination import (
    BLEND,
    Emulated,
    Interactions,
    basis,
    log_mean,
    together,
)
from dogshape.diagnosis.prediction.levels import Level
from dogshape.sim.effects import load

PAIR = ("moving_mass", "sleeve_friction")
EFFECTS = load()
BASE = 0.06 + 0.01 * ((np.arange(16) + 0.5) / 16)
ONE, TWO = 1.5, 1.8  #: ratios of the times with either effect of the simulated pair


def _pair(one: float, two: float, how: str) -> np.ndarray:
    """Return ratios with both effects."""
    return {"sum": one + two - 1.0, "product": one * two}[how] * BASE


def _bank(how: str) -> Bank:
    """A bank of two operating points with each effect and both."""
    levels = (Level(PAIR[:1], (1.0,)), Level(PAIR[1:], (50.0,)), Level(PAIR, (1.0, 50.0)))
    jitter = 1.0 + 1e-3 * np.random.default_rng(2).standard_normal((3, 2, 16))
    times = np.array([ONE * BASE, TWO * BASE, _pair(ONE, TWO, how)])[:, None] * jitter
    return Bank(
        effects=tuple(EFFECTS[name] for name in PAIR),
        settings=(),
        angles=np.zeros((2, 16)),
        common=np.arange(16)[None].repeat(2, axis=0),
        baseline=BASE[None].repeat(2, axis=0),
        levels=levels,
        times=times,
        numerics=(0.0, 0.0),
    )


def _reach(ratio: float) -> Emulated:
    nothing, every = np.full(1, 1e-3), np.full(1, 0.999)
    return Emulated((ratio * BASE)[None], every, np.zeros(1), np.zeros(1), nothing)


def _changes(pair: tuple[str, str], one: float, two: float) -> dict[str, np.ndarray]:
    """Return changes of the logarithm of the mean at both operating points."""
    return {name: np.full((2, 1), np.log(r)) for name, r in zip(pair, (one, two), strict=True)}


@pytest.mark.parametrize(("how", "share"), [("sum", 1.0), ("product", 0.0)])
@pytest.mark.parametrize(("one", "two"), [(1.1, 1.2), (1.5, 1.8), (1.3, 3.0)])
def test_a_simulated_pair_tells_how_its_effects_combine(
    how: str, share: float, one: float, two: float
) -> None:
    found = Interactions.of(_bank(how))
    blend = found.pairs[PAIR]
    assert blend.share == pytest.approx(share, abs=0.03)
    assert blend.own < 0.16
    base, alone = _reach(1.0), [_reach(one), _reach(two)]
    missed = found.missed(PAIR, _changes(PAIR, one, two))
    both = together(base, alone, [np.zeros(1)] * 2)
    mean = np.exp(log_mean(both) + missed.moved[1])
    assert mean == pytest.approx(_pair(one, two, how).mean(), rel=0.005)
    # Of the share nobody knows more than the error says, at strengths that were not simulated.
    d = basis(np.log([one]), np.log([two]))
    assert abs(missed.common[0]) == pytest.approx(blend.error * abs(d))
    assert blend.error >= 0.3


def test_what_was_not_simulated_has_the_spread_of_what_was() -> None:
    found = Interactions.of(_bank("sum"))
    changes = _changes(("a", "b"), 1.5, 1.8)
    missed = found.missed(("a", "b"), changes)
    assert found.any.share[0] == pytest.approx(1.0, abs=0.05)
    assert missed.moved[0] == pytest.approx(np.log(2.3 / 2.7), abs=0.02)
    none = Interactions.of(_without_pairs(_bank("sum")))
    assert (none.any.share[0], none.any.error) == BLEND
    assert (none.missed(("a", "b"), changes).own > 0.2 * np.log(1.5)).all()


def test_changes_that_undo_each_other_leave_some_time() -> None:
    """Sums of ratios far below one would be negative; half of the smaller one is the least."""
    assert np.exp(basis(np.log([0.4]), np.log([0.5])) + np.log(0.2)) == pytest.approx(0.2)
    assert basis(np.zeros(1), np.log([1.7])) == pytest.approx(0.0, abs=1e-12)


def _without_pairs(bank: Bank) -> Bank:
    return Bank(
        bank.effects, bank.settings, bank.angles, bank.common, bank.baseline,
        bank.levels[:2], bank.times[:2], bank.numerics,
    )  # fmt: skip
