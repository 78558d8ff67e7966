"""Effects of a surrogate of a known additive time."""

from __future__ import annotations

import numpy as np
import pytest

from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.train.training import first_designs
from dogshape.pipeline.train.training_rows import study_mix, with_rows
from dogshape.sim.elementwise import Array
from dogshape.surrogate.model import Surrogate, fit
from dogshape.surrogate.process import Effort
from dogshape.surrogate.sensitivity import accumulate, main_effects

#: Ends of the search ranges of the paper's study, and what each variable adds across them, s.
LOW, HIGH = np.array([0.0, 4.0, 4.0, 1.6, 6.0]), np.array([20.0, 30.0, 30.0, 6.0, 36.0])
SLOPES = np.array([-0.012, 0.0, 0.01, 0.02, -0.05])
BEND = 0.03  #: of the square of the chamfer's share of its range, s
DESIGNS = 70


def terms(x: Array) -> Array:
    """What each variable of designs (n, 5) adds to the time, (n, 5), s."""
    u = (x - LOW) / (HIGH - LOW)
    effect_terms: Array = u * SLOPES
    effect_terms[:, 0] += BEND * u[:, 0] ** 2
    return effect_terms


def pace(points: Array) -> Array:
    """How much longer than at 50 1/min and 400 N a shift takes at points (n, 2), (n,)."""
    factor: Array = (points[:, 0] / 50.0) ** -0.1 * (points[:, 1] / 400.0) ** -0.2
    return factor


def truth(x: Array, points: Array) -> Array:
    """The time of designs (n, 5) at operating points (n, 2), (n,), s."""
    time: Array = (0.09 + terms(x).sum(axis=1)) * pace(points)
    return time


def feasible(study: Setup, count: int, seed: int) -> Array:
    """Designs that pass every check, (n, 5)."""
    designs = first_designs(study, count, seed - study.file.surrogate.seed, border=False)
    return np.array([list(design.values()) for design in designs], dtype=float)


@pytest.fixture(scope="module")
def surrogate(study: Setup) -> Surrogate:
    """A surrogate of the known time, with some noise."""
    mix = study_mix(study)
    count, size = DESIGNS * len(mix.points), len(mix.points)
    x = np.repeat(feasible(study, DESIGNS, 1), size, axis=0)
    points = np.tile(mix.points, (DESIGNS, 1))
    mean = truth(x, points) * np.exp(0.005 * np.random.default_rng(1).standard_normal(count))
    eight = np.full(count, 8.0)
    columns = (mean, 0.005 * mean, 0.3 * mean, eight, eight, np.ones(count))
    data = with_rows(study, np.column_stack([x, points, *columns]))
    return fit(data, Effort(steps=25))


def test_effects_of_an_additive_time_are_its_terms(study: Setup, surrogate: Surrogate) -> None:
    mix, x = study_mix(study), feasible(study, 100, 9)
    main = main_effects(surrogate, surrogate.data.variables, x)
    assert [effect.variable for effect in main] == list(surrogate.data.variables)
    mean = float(mix.weights @ pace(mix.points))
    inside = []
    for column, effect in enumerate(main):
        _, designs, form = accumulate(x, column)
        exact = form @ (mean * terms(designs).sum(axis=1))
        line = np.tile(x[:1], (len(effect.values), 1))
        line[:, column] = effect.values
        # What the form adds up is the term itself but for a constant.
        assert np.ptp(exact - mean * terms(line)[:, column]) < 1e-12
        assert effect.effect == pytest.approx(exact, abs=1.5e-3)
        assert (effect.high - effect.low).max() < 8e-3
        inside += list((effect.low <= exact) & (exact <= effect.high))
    assert np.mean(inside) >= 0.9
    count = {effect.variable: effect for effect in main}["count"]
    assert count.values[np.argmin(count.effect)] == x[:, 4].max()
    assert count.values.tolist() == [round(v) for v in count.values]


def test_an_effect_is_not_that_of_what_comes_along() -> None:
    first = np.linspace(0.0, 1.0, 60)
    x = np.column_stack([first, first + 0.01 * np.sin(50.0 * first), np.ones(60)])
    _, designs, form = accumulate(x, 1)
    assert form @ designs[:, 0] == pytest.approx(0.0, abs=1e-12)
    values, designs, form = accumulate(x, 0)
    assert form @ designs[:, 0] == pytest.approx(values - values.mean(), abs=0.01)
