"""The sampler among Optuna's own: Optuna's tests of samplers, and what it is better at."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import combinations
from pathlib import Path
from types import MappingProxyType

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
from optuna.trial import FrozenTrial
from scipy.special import ndtr

from dogshape.pipeline.search.guide import FreeGuide, Params, Response
from dogshape.pipeline.search.sampler import WIDE, Breadth, Pool, SurrogateSampler
from dogshape.pipeline.search.unit_cube import STEP, Space
from dogshape.sim.errors import InputError
from dogshape.surrogate.covariance import Array
from dogshape.surrogate.hypervolume import added, directions, scales, volume_of

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


def test_a_chance_from_no_value_is_refused_and_from_few_is_unsure() -> None:
    """The limit cases: none, one, some that are alike; then what many say counts."""
    rng = np.random.default_rng(0)
    asked = rng.random((50, 5))
    with pytest.raises(InputError, match="no design was simulated yet"):
        Response.fitted(np.zeros((0, 5)), np.zeros(0))
    for count in (1, 2, 5, 10):
        x = rng.random((count, 5))
        for value in (-0.4, -1e-3, 1e-3, 0.4):
            chance = Response.fitted(x, np.full(count, value), least=0.2).below(asked)
            assert ((chance > 0.5) == (value < 0.0)).all()
            assert ((chance > 0.0) & (chance < 1.0)).all()
            if count == 1:
                assert chance == pytest.approx(float(ndtr(-value / 0.2 / 2.1**0.5)), abs=0.12)
            if abs(value) < 0.01:
                assert chance == pytest.approx(0.5, abs=0.05)
    x = rng.random((60, 5))
    sure = Response.fitted(x, x[:, 0] - 0.5, least=0.2)
    chance = sure.below(asked)
    assert (chance[asked[:, 0] < 0.4] > 0.95).all()
    assert (chance[asked[:, 0] > 0.6] < 0.05).all()


@pytest.mark.parametrize("value", [-2000.0, 0.0, 3e-6])
def test_a_constraint_of_any_size_is_unsure_where_few_trials_tell_it(value: float) -> None:
    """A lone value of a free guide says that others may be as far away as the limit is."""
    trials = [
        optuna.trial.create_trial(
            params={"x": 0.1 * k}, distributions={"x": FloatDistribution(0.0, 1.0)}, value=1.0,
            constraints={"limit": value},
        )
        for k in range(3)
    ]  # fmt: skip
    space = Space({"x": FloatDistribution(0.0, 1.0)})
    for count in (1, 3):
        found = FreeGuide().predict(space, trials[:count], np.ones(1))
        chance = found.chances([{"x": 0.9}])[0]
        assert 0.02 < chance < 0.98
        assert (chance > 0.5) == (value < 0.0)


def test_a_small_space_lists_what_it_holds() -> None:
    space = Space({name: SPACE[name] for name in ("step", "choice", "whole")})
    every = space.every(1000)
    assert every is not None
    assert len(every) == len({space.key(params) for params in every}) == 5 * 31 * 3
    assert all(space.holds(params) for params in every)
    rng = np.random.default_rng(0)
    keys = {space.key(params) for params in every}
    assert all(space.key(space.drawn(rng)) in keys for _ in range(200))
    assert space.every(5 * 31 * 3 - 1) is None
    assert Space(SPACE).every(10**9) is None
    assert Space({"one": FloatDistribution(2.0, 2.0)}).every(1) == [{"one": 2.0}]


@pytest.mark.parametrize("startup", [3, 100])
def test_every_design_of_a_small_space_is_proposed_before_any_again(startup: int) -> None:
    """While it fills, and while it improves; then the search goes round evenly."""
    ranges = {"n": IntDistribution(1, 4), "kind": CategoricalDistribution(["a", "b", "c"])}
    study = optuna.create_study(sampler=SurrogateSampler(seed=0, startup=startup))
    told = []
    for _ in range(24):
        trial = study.ask(ranges)
        study.tell(trial, trial.params["n"] * 1.0)
        told.append(tuple(trial.params.values()))
    assert len(set(told[:12])) == 12
    if startup == 100:
        assert len(set(told[12:])) == 12


def test_a_pool_that_was_taken_is_drawn_anew() -> None:
    """More designs that fill the space than the pool has: none comes twice."""
    space, pool = Space({"x": FloatDistribution(0.0, 1.0)}), Pool(FreeGuide(), seed=0)
    taken = pool.first(space)
    more = pool.untaken(space, taken)
    assert len(taken) == len(more) == WIDE
    assert not {space.key(params) for params in taken} & {space.key(params) for params in more}
    assert pool.untaken(space, taken) == more


class Told:
    """A guide and prediction that know a line of designs exactly: quick ones are long.

    ``b`` puts a design behind the front, in both objectives.
    """

    distributions = MappingProxyType(
        {"a": FloatDistribution(0.0, 1.0), "b": FloatDistribution(0.0, 1.0, step=0.2)}
    )

    def allows(self, params: Params) -> bool:
        return True

    def predict(self, space: Space, trials: Sequence[FrozenTrial], signs: Array) -> Told:
        return self

    def draws(self, params: Sequence[Params], rng: np.random.Generator, count: int) -> Array:
        values = np.array([self.of(one) for one in params]).reshape(1, len(params), 2)
        return np.repeat(values, count, axis=0)

    def chances(self, params: Sequence[Params]) -> Array:
        return np.ones(len(params))

    def of(self, params: Params) -> tuple[float, float]:
        return params["a"] + params["b"], 1.0 - params["a"] + params["b"]


def narrow_then_proposed(more: list[tuple[float, float]], proposals: int) -> Array:
    """Propose designs after a narrow front and others behind it, (n, 2)."""
    guide = Told()
    study = optuna.create_study(
        directions=["minimize"] * 2, sampler=SurrogateSampler(guide, 1, 3, FEW)
    )
    front = [{"a": a, "b": 0.0} for a in (0.48, 0.5, 0.52)]
    behind = [{"a": 0.1, "b": 0.6}, {"a": 0.9, "b": 0.6}, {"a": 0.5, "b": 0.4}]
    for params in front + behind:
        study.add_trial(
            optuna.trial.create_trial(
                params=params, distributions=dict(guide.distributions), values=guide.of(params)
            )
        )
    for values in more:
        study.add_trial(
            optuna.trial.create_trial(
                params={"a": 0.5, "b": 1.0},
                distributions=dict(guide.distributions),
                values=values,
            )
        )
    first = len(study.trials)
    for _ in range(proposals):
        trial = study.ask(dict(guide.distributions))
        study.tell(trial, guide.of(trial.params))
    return np.array([trial.values for trial in study.trials[first:]])


def test_a_front_that_is_narrow_does_not_stay_so() -> None:
    """Designs beyond either end of the front are proposed, slower or longer than all of it."""
    proposed = narrow_then_proposed([], 4)
    assert proposed[:, 0].min() < 0.25
    assert proposed[:, 1].min() < 0.25


def test_an_outlier_does_not_decide_what_is_proposed() -> None:
    """Beside a design a thousand times as slow, slow ones would gain all and quick ones nothing."""
    proposed = narrow_then_proposed([(1e3, 1.5)], 3)
    assert proposed[:, 0].min() < 0.25
    assert proposed[:, 1].min() < 0.25
