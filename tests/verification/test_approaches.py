"""Time until the axial gap is closed under two effects, against the compiled engine."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from dogshape.bench.bench_data import load_bench
from dogshape.diagnosis.prediction.approaches import Approaches
from dogshape.diagnosis.prediction.curve import ParameterSpace
from dogshape.diagnosis.prediction.simulations import Level, settings_of
from dogshape.diagnosis.terms import Array, Hypothesis
from dogshape.sim.effects import load
from dogshape.sim.errors import DogshapeError
from dogshape.sim.shift.planar import touch_time

EFFECTS = load()
SETTINGS = settings_of(load_bench("mq200_adams"), "sleeve")
APPROACHES = Approaches(EFFECTS, SETTINGS)


def _space(pair: Hypothesis) -> ParameterSpace:
    return ParameterSpace(tuple(EFFECTS[name] for name in pair), SETTINGS[0])


@cache
def _times(h: Hypothesis, values: tuple[float, ...]) -> Array:
    """Integrate the approach at all operating points, s, (C,)."""
    settings = [Level(h, values).setting(EFFECTS, setting) for setting in SETTINGS]
    return np.array([touch_time(s.clutch, s.point.profile) for s in settings])


def _predicted_times(pair: Hypothesis, values: Array) -> tuple[Array, Array]:
    """Predict the approach with two effects from those with each, s, and its relative error."""
    space = _space(pair)
    change, error = APPROACHES.pair_change(space, pair, values[None])
    baseline = _times((), ()) ** -0.5
    root = baseline * (1.0 + change[0])
    for name in pair:
        single = _times((name,), tuple(values[space.columns(name)].tolist()))
        root = root + single**-0.5 - baseline
    return root**-2.0, 2.0 * error[0] * baseline / root


@pytest.mark.parametrize(
    "pair",
    [
        ("moving_mass", "viscous_damping"),
        ("sleeve_friction", "viscous_damping"),
        ("linkage_compliance", "viscous_damping"),
        ("actuation_lag", "linkage_compliance"),
        ("axial_gap", "force_loss"),
    ],
)
def test_two_effects_agree_with_the_engine(pair: Hypothesis) -> None:
    """Random sizes: within 6 % or three stated errors, where changes multiply within 60 %."""
    space = _space(pair)
    generator = np.random.default_rng(2)
    for shares in generator.uniform(0.2, 0.8, (6, len(space.parameters))):
        values = space.values(shares[None])[0]
        try:
            exact = _times(pair, tuple(values.tolist()))
        except DogshapeError:  # no such bench
            continue
        predicted, error = _predicted_times(pair, values)
        assert (abs(predicted / exact - 1.0) < np.maximum(0.06, 3.0 * error)).all()


def test_a_damped_ring_with_friction_creeps_while_the_force_rises() -> None:
    r"""With :math:`c \dot x = F(t) - R` the gap is the integral of the net force over c."""
    pair = ("sleeve_friction", "viscous_damping")
    friction, damping = _space(pair).values(np.array([[0.5, 1.0]]))[0]  # a node
    predicted, _ = _predicted_times(pair, np.array([friction, damping]))
    for setting, time in zip(SETTINGS, predicted.tolist(), strict=True):
        times = np.linspace(0.0, 2.0 * time, 20_001)
        net_force = np.maximum(setting.point.profile.at(times) - friction, 0.0)
        way = np.cumsum(net_force) * times[1] / damping
        creep_time = np.interp(setting.clutch.dog.axial_gap, way, times)
        assert time == pytest.approx(creep_time, rel=0.02)


def test_an_effect_without_approach_adds_nothing() -> None:
    pair = ("chamfer_angle", "moving_mass")
    space = _space(pair)
    change, error = APPROACHES.pair_change(space, pair, space.values(np.full((1, 2), 0.7)))
    assert not change.any()
    assert not error.any()
