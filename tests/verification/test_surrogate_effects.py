"""Effects and Sobol indices of a surrogate of a known additive time."""

from __future__ import annotations

from itertools import islice

import numpy as np
import pytest

from dogshape.pipeline.config.study_file import Setup, load_study
from dogshape.pipeline.train.filling import filling_designs
from dogshape.pipeline.train.training_rows import study_mix, with_rows
from dogshape.surrogate.covariance import Array
from dogshape.surrogate.model import Surrogate, fit
from dogshape.surrogate.process import Effort
from dogshape.surrogate.sensitivity import EVEN, LOG, WHOLE, Input, accumulate, effects, indices

#: Ends of the search ranges of the paper's study, and what each variable adds across them, s.
LOW, HIGH = np.array([0.0, 4.0, 4.0, 1.6, 6.0]), np.array([20.0, 30.0, 30.0, 6.0, 36.0])
SLOPES = np.array([-0.012, 0.0, 0.01, 0.02, -0.05])
BEND = 0.03  #: of the square of the chamfer's share of its range, s
DESIGNS = 70


def terms(x: Array) -> Array:
    """What each variable of designs (n, 5) adds to the time, (n, 5), s."""
    u = (x - LOW) / (HIGH - LOW)
    added: Array = u * SLOPES
    added[:, 0] += BEND * u[:, 0] ** 2
    return added


def pace(points: Array) -> Array:
    """How much longer than at 50 1/min and 400 N a shift takes at points (n, 2), (n,)."""
    slower: Array = (points[:, 0] / 50.0) ** -0.1 * (points[:, 1] / 400.0) ** -0.2
    return slower


def truth(x: Array, points: Array) -> Array:
    """The time of designs (n, 5) at operating points (n, 2), (n,), s."""
    time: Array = (0.09 + terms(x).sum(axis=1)) * pace(points)
    return time


@pytest.fixture(scope="module")
def study() -> Setup:
    """The paper's study."""
    return load_study("mq200_paper")


def feasible(study: Setup, count: int, seed: int) -> Array:
    """Designs that pass every check, (n, 5)."""
    designs = islice(filling_designs(study, seed, border=False), count)
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
    found = effects(surrogate, surrogate.data.variables, x)
    assert [one.variable for one in found] == list(surrogate.data.variables)
    mean = float(mix.weights @ pace(mix.points))
    inside = []
    for column, one in enumerate(found):
        asked = accumulate(x, column)
        known = asked.form @ (mean * terms(asked.moved).sum(axis=1))
        along = np.tile(x[:1], (len(one.values), 1))
        along[:, column] = one.values
        # What the form adds up is the term itself but for a constant.
        assert np.ptp(known - mean * terms(along)[:, column]) < 1e-12
        assert one.effect == pytest.approx(known, abs=1.5e-3)
        assert (one.high - one.low).max() < 8e-3
        inside += list((one.low <= known) & (known <= one.high))
    assert np.mean(inside) >= 0.9
    by_name = {one.variable: one for one in found}
    assert not by_name["traction_deg"].clear
    assert by_name["count"].clear
    count = by_name["count"]
    assert count.values[np.argmin(count.effect)] == x[:, 4].max()
    assert count.values.tolist() == [round(v) for v in count.values]


def test_an_effect_is_not_that_of_what_comes_along() -> None:
    first = np.linspace(0.0, 1.0, 60)
    x = np.column_stack([first, first + 0.01 * np.sin(50.0 * first), np.ones(60)])
    asked = accumulate(x, 1)
    assert asked.form @ asked.moved[:, 0] == pytest.approx(0.0, abs=1e-12)
    own = accumulate(x, 0)
    assert own.form @ own.moved[:, 0] == pytest.approx(own.values - own.values.mean(), abs=0.01)


def test_indices_of_ishigami() -> None:
    """Closed form of Ishigami and Homma 1990 with a = 7, b = 0.1."""

    def ishigami(x: Array) -> Array:
        result: Array = np.sin(x[:, 0]) * (1 + 0.1 * x[:, 2] ** 4) + 7 * np.sin(x[:, 1]) ** 2
        return result

    found = indices([Input(name, -np.pi, np.pi) for name in "abc"], ishigami, samples=4096)
    assert found.first == pytest.approx([0.3139, 0.4424, 0.0], abs=0.03)
    assert found.total == pytest.approx([0.5576, 0.4424, 0.2437], abs=0.03)
    assert (found.first_half > 0.0).all()


def test_indices_of_an_additive_time(study: Setup, surrogate: Surrogate) -> None:
    low, high = np.array([7.0, 10.0, 18.0, 3.2, 12.0]), np.array([11.0, 16.0, 24.0, 4.2, 20.0])
    scales = [EVEN, EVEN, EVEN, EVEN, WHOLE]
    box = [Input(*one) for one in zip(study.variables, low, high, scales, strict=True)]
    found = indices(box, lambda x: surrogate.predict(x)[0], samples=512)
    share = np.random.default_rng(1).random((len(box), 4000))
    drawn = np.column_stack([one.at(part) for one, part in zip(box, share, strict=True)])
    variance = terms(drawn).var(axis=0)
    assert found.first == pytest.approx(variance / variance.sum(), abs=0.06)
    assert found.total == pytest.approx(found.first, abs=0.06)
    assert np.argmax(found.total) == 4


def test_inputs_keep_to_their_scale() -> None:
    share = np.array([0.0, 0.25, 0.5, 0.999, 1.0])
    assert Input("count", 12, 15, WHOLE).at(share).tolist() == [12, 13, 14, 15, 15]
    assert Input("force_N", 10, 1000, LOG).at(share)[[0, 2, 4]] == pytest.approx([10, 100, 1000])
    still = indices([Input("a", 0, 1)], lambda x: np.ones(len(x)), samples=8)
    assert still.total.tolist() == [0.0]
