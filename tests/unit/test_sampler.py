"""The sampler among Optuna's own: Optuna's tests of samplers, and what it is better at."""

from __future__ import annotations

from collections.abc import Callable
from itertools import combinations
from pathlib import Path

import numpy as np
import optuna
import pytest
from optuna.distributions import CategoricalDistribution, FloatDistribution, IntDistribution
from optuna.storages.journal import JournalFileBackend
from optuna.testing.pytest_samplers import (
    BasicSamplerTestCase,
    MultiObjectiveSamplerTestCase,
    RelativeSamplerTestCase,
)

from pipeline.sampling.improvement import added, directions, hypervolume, scales, volume_of
from pipeline.sampling.sampler import Breadth, SurrogateSampler
from pipeline.sampling.space import STEP, Space
from surrogate.covariance import Array

FEW = Breadth(wide=60, near=20, draws=8, ways=32)  #: for what holds however much is weighed


class TestAsOptunaWantsIt(
    BasicSamplerTestCase, RelativeSamplerTestCase, MultiObjectiveSamplerTestCase
):
    """Optuna's own cases; startup ends soon, so that most of them reach the processes."""

    @pytest.fixture
    def sampler(self) -> Callable[[], optuna.samplers.BaseSampler]:
        return lambda: SurrogateSampler(seed=0, startup=2, breadth=FEW)


def bowls(trial: optuna.Trial) -> tuple[float, float]:
    """Two bowls whose front is the line between their centres; a ring of it is forbidden."""
    x, y = trial.suggest_float("x", 0.0, 1.0), trial.suggest_float("y", 0.0, 1.0)
    trial.set_constraint("ring", 0.15 - float(np.hypot(x - 0.5, y - 0.5)))
    return (x - 0.2) ** 2 + (y - 0.2) ** 2, (x - 0.8) ** 2 + (y - 0.8) ** 2


def searched(sampler: optuna.samplers.BaseSampler, trials: int = 40) -> float:
    """Hypervolume of what a sampler finds of the bowls."""
    study = optuna.create_study(directions=["minimize"] * 2, sampler=sampler)
    study.optimize(bowls, n_trials=trials)
    kept = [t.values for t in study.trials if t.constraints["ring"] <= 0.0]
    return hypervolume(np.array(kept), np.full(2, 0.8))


def test_it_finds_more_of_a_front_than_random_designs() -> None:
    """Two objectives and a constraint that only the evaluation tells."""
    own = [searched(SurrogateSampler(seed=seed, breadth=FEW)) for seed in range(3)]
    blind = [searched(optuna.samplers.RandomSampler(seed=seed)) for seed in range(3)]
    assert min(own) > max(blind)


def test_ask_and_tell_from_a_storage_goes_on_as_before(tmp_path: Path) -> None:
    """Any storage serves, and a search that is taken up again makes the same trials."""
    backend = JournalFileBackend(str(tmp_path / "trials.log"))
    storage = optuna.storages.JournalStorage(backend)
    whole = optuna.create_study(
        directions=["minimize"] * 2, sampler=SurrogateSampler(seed=3, breadth=FEW)
    )
    whole.optimize(bowls, n_trials=14)
    for part in (12, 2):
        again = optuna.create_study(
            study_name="bowls",
            storage=storage,
            directions=["minimize"] * 2,
            sampler=SurrogateSampler(seed=3, breadth=FEW),
            load_if_exists=True,
        )
        for _ in range(part):
            trial = again.ask()
            again.tell(trial, bowls(trial))
    assert [t.params for t in again.trials] == [t.params for t in whole.trials]


def test_proposals_of_a_batch_differ() -> None:
    study = optuna.create_study(directions=["minimize"] * 2, sampler=SurrogateSampler(seed=1))
    study.optimize(bowls, n_trials=12)
    ranges = {"x": FloatDistribution(0.0, 1.0), "y": FloatDistribution(0.0, 1.0)}
    batch = [study.ask(ranges).params for _ in range(4)]
    apart = [np.hypot(a["x"] - b["x"], a["y"] - b["y"]) for a, b in combinations(batch, 2)]
    assert min(apart) > 0.02


@pytest.mark.parametrize("objectives", [1, 2, 3])
def test_directions_measure_the_volume(objectives: int) -> None:
    """A box of known sides, and one with a box cut out of it."""
    sides = np.array([0.5, 0.8, 0.7])[:objectives]
    ways = directions(np.random.default_rng(0), 200_000, objectives)
    reference = np.ones(objectives)

    def measured(front: Array) -> float:
        largest = scales(front[None], reference, ways)[0].max(axis=0)
        return float(largest.mean()) * volume_of(objectives)

    one = measured((reference - sides)[None, :])
    assert one == pytest.approx(np.prod(sides), rel=0.01)
    both = np.array([reference - sides, reference - sides[::-1]])
    shared = np.prod(np.minimum(sides, sides[::-1]))
    assert measured(both) == pytest.approx(2 * np.prod(sides) - shared, rel=0.01)
    more = added(both[None, 1:], both[None, :1], reference, ways)
    assert more[0] == pytest.approx(np.prod(sides) - shared, abs=0.01 * one)


def test_what_adds_nothing_gains_nothing() -> None:
    ways = directions(np.random.default_rng(0), 64, 2)
    front = np.array([[[0.2, 0.5], [0.5, 0.2]]])
    dominated = np.array([[[0.5, 0.5], [1.2, 0.1], [0.2, 0.5]]])
    assert added(dominated, front, np.ones(2), ways) == pytest.approx([0.0, 0.0, 0.0])


SPACE = {
    "log": FloatDistribution(1e-3, 10.0, log=True),
    "step": FloatDistribution(0.0, 1.0, step=0.25),
    "whole": IntDistribution(6, 36),
    "choice": CategoricalDistribution(["a", "b", "c"]),
}


def test_a_space_draws_what_it_holds_and_every_value() -> None:
    space, rng = Space(SPACE), np.random.default_rng(0)
    drawn = [space.drawn(rng) for _ in range(600)]
    assert all(space.holds(params) for params in drawn)
    assert {params["step"] for params in drawn} == {0.0, 0.25, 0.5, 0.75, 1.0}
    assert {params["whole"] for params in drawn} == set(range(6, 37))
    where = space.coordinates(drawn)
    assert where.shape == (600, space.size) == (600, 6)
    assert 0.0 <= where.min() < where.max() <= 1.0
    assert where.mean(axis=0) == pytest.approx([1 / 3] * 3 + [0.5] * 3, abs=0.06)
    assert not space.holds({**drawn[0], "whole": 37})
    assert not space.holds({"log": 1.0})


def test_draws_near_a_design_are_near() -> None:
    space, rng = Space(SPACE), np.random.default_rng(0)
    centre = {"log": 0.1, "step": 0.5, "whole": 20, "choice": "b"}
    near = [space.drawn(rng, centre) for _ in range(300)]
    where, there = space.coordinates(near), space.coordinates([centre])
    numbers = where[:, [3, 5]] - there[:, [3, 5]]  # of the logarithm and the whole number
    assert numbers.std(axis=0) == pytest.approx([STEP, STEP], rel=0.2)
    assert np.mean([params["choice"] == "b" for params in near]) > 0.7
