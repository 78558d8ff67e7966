"""Times over a study's own points: a known function, what asks them, and the file."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from dogshape.pipeline.config.study_file import load_study
from dogshape.pipeline.train.training import validate
from dogshape.pipeline.train.training_rows import with_rows
from dogshape.sim.errors import DataError, InputError
from dogshape.surrogate.covariance import Array
from dogshape.surrogate.dataset import COLUMNS, Mix, reference_of
from dogshape.surrogate.expected_time import Over
from dogshape.surrogate.learning import Effort, fit, fitted, mix_times
from dogshape.surrogate.mix_times import MixTimes, own_of, shape_of
from dogshape.surrogate.model import Surrogate
from dogshape.surrogate.store import Stored, load, save
from dogshape.surrogate.validation_figures import predict
from tests.unit.test_surrogate import GRID, MIX, QUICK, made, truth

NOISE = 0.02
APART = Mix(GRID, np.full(len(GRID), 1.0 / len(GRID)), MIX.retry)  #: other weights


def rough(x: Array, points: Array) -> Array:
    """A time that runs otherwise at each point of the grid."""
    place = np.array([np.flatnonzero((point == GRID).all(axis=1))[0] for point in points])
    return truth(x, points) * np.exp(0.1 * np.sin(x[:, 0] / 4.0 + 2.0 * place))


def whole(designs: int, noise: float, seed: int) -> Array:
    """Rows of designs that have every point of the grid, (n, d + 8)."""
    data = made(designs, seed=seed, grid=True)
    rows, first = data.rows.copy(), len(data.variables)
    mean = rough(data.x, data.points)
    mean *= np.exp(noise * np.random.default_rng(seed).standard_normal(len(mean)))
    rows[:, first + COLUMNS.index("mean_s")] = mean
    rows[:, first + COLUMNS.index("standard_error_s")] = max(noise, 1e-3) * mean
    return rows


@pytest.fixture(scope="module")
def plain() -> Surrogate:
    """A surrogate of rows at points of their own."""
    return fit(made(60), effort=QUICK)


@pytest.fixture(scope="module")
def own(plain: Surrogate) -> MixTimes:
    """The times over the grid of 90 designs, fitted."""
    return fitted(mix_times(plain.data, whole(90, NOISE, 3), MIX), Effort(rows=90, steps=40))


@pytest.fixture(scope="module")
def surrogate(plain: Surrogate, own: MixTimes) -> Surrogate:
    """The surrogate of both."""
    return replace(plain, own=own)


def test_it_predicts_a_time_that_differs_from_point_to_point(
    plain: Surrogate, surrogate: Surrogate
) -> None:
    data = plain.data
    reference = reference_of(replace(data, rows=whole(40, 0.0, 8)), MIX)
    rows, both = (validate(one, MIX, reference) for one in (plain, surrogate))
    assert both.q2 > 0.99
    assert both.q2_points > 0.98 > rows.q2_points
    assert both.rmse_points_s < 0.5 * rows.rmse_points_s
    assert both.coverage_95 >= 0.85
    assert 0.85 <= both.coverage_points <= 0.999


def test_the_error_is_that_of_the_designs_and_no_more(own: MixTimes) -> None:
    x = made(60, seed=11).designs
    mean, variance = own.processes[0].predict(own.coordinates(x))
    true = np.log([float(MIX.weights @ rough(np.tile(row, (6, 1)), GRID)) for row in x])
    assert np.sqrt(((mean - true) ** 2).mean()) < NOISE
    assert 0.5 < np.sqrt(((mean - true) ** 2 / variance).mean()) < 1.6


def test_what_has_the_mix_answers_for_it_alone(surrogate: Surrogate, plain: Surrogate) -> None:
    x = made(3, seed=4).designs
    own = surrogate.own
    assert own is not None
    assert surrogate.own_process(MIX) is own.processes[0]
    assert surrogate.own_process(MIX.at(2)) is own.processes[3]
    assert surrogate.own_process(APART) is None
    assert surrogate.expected(x[0], APART) == plain.expected(x[0], APART)
    assert surrogate.expected(x[0], MIX) != plain.expected(x[0], MIX)


def test_one_design_and_many_have_the_same_answer(surrogate: Surrogate) -> None:
    x = made(6, seed=4).designs
    for mix in (MIX, MIX.at(1)):
        over = Over(surrogate, mix)
        time, error = over.predict(x)
        alone = [surrogate.expected(row, mix) for row in x]
        assert time == pytest.approx([one.time for one in alone], rel=1e-9)
        # One takes the root of the rows' covariance, the other its inverse.
        assert error == pytest.approx([one.error for one in alone], rel=1e-4)
        jointly, covariance = over.joint(x)
        assert jointly == pytest.approx(time, rel=1e-9)
        assert np.sqrt(np.diag(covariance)) == pytest.approx(error, rel=1e-4)


def test_the_figures_are_of_what_is_answered(surrogate: Surrogate) -> None:
    x = made(4, seed=4).designs
    found = predict(surrogate, x, MIX)
    bare = replace(MIX, retry=0.0)
    assert found.time == pytest.approx([surrogate.expected(row, bare).time for row in x])
    at_one = [surrogate.expected(row, bare.at(5)).time for row in x]
    assert found.means[:, 5] == pytest.approx(at_one)


def test_the_file_keeps_it(surrogate: Surrogate, tmp_path: Path) -> None:
    reference = reference_of(replace(surrogate.data, rows=whole(12, 0.0, 8)), MIX)
    path = tmp_path / "surrogate.json"
    save(path, Stored(surrogate, validate(surrogate, MIX, reference)))
    again = load(path).surrogate
    x = made(3, seed=4).designs
    for mix in (MIX, MIX.at(3), APART):
        for row in x:
            ours, theirs = surrogate.expected(row, mix), again.expected(row, mix)
            assert theirs.time == pytest.approx(ours.time, rel=1e-9)
            assert theirs.error == pytest.approx(ours.error, rel=1e-6)
    content = json.loads(path.read_text())
    content["own"]["processes"].pop()
    with pytest.raises(ValueError, match="6 processes instead of 7"):
        own_of(content["own"], again.data)
    path.write_text(path.read_text().replace('"shifts": ', '"shifts":  1', 1))
    with pytest.raises(DataError, match="changed or damaged"):
        load(path)


def test_few_designs_are_refused(plain: Surrogate) -> None:
    with pytest.raises(InputError, match=r"9 designs engage.*at least 10.*mix_shifts"):
        mix_times(plain.data, whole(9, NOISE, 3), MIX)


def test_the_coordinates_of_the_shape_are_those_of_the_dog() -> None:
    study = load_study("mq200_paper", {})
    about = with_rows(study, np.zeros((0, 13)))
    dog = study.clutch.dog
    x = study.rows([study.prototype])
    found = shape_of(about, x)
    assert found is not None
    of_dog = [dog.entry_play, dog.tip_width, dog.edge_drop]
    assert found[0] == pytest.approx([1e3 * value for value in of_dog], rel=1e-9)


def test_without_the_shape_a_design_has_its_variables(own: MixTimes) -> None:
    assert shape_of(own.about, own.x) is None
    assert own.inputs.shape[1] == 3 + 1  # and the ridge of its one angle
