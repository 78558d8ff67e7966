"""The sampler: what it draws, how it improves a front, and how unsure few values leave it."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from typing import Any, cast

import numpy as np
import pytest
from optuna.trial import FrozenTrial, TrialState
from scipy.special import ndtr

from dogshape.pipeline.search.sampler import (
    NEAR_DEVIATION,
    Params,
    Space,
    SurrogateSampler,
    added_volume,
    chance_below_zero,
    draw_directions,
    fit_response,
    order_descending,
)
from dogshape.sim.elementwise import Array
from dogshape.surrogate.process import draw_jointly

RANGES = {"height_mm": (2.0, 4.0), "count": (6, 36)}


class ExactGuide:
    """A guide and prediction that know a line of designs exactly: quick ones are long.

    ``b`` puts a design behind the front, in both objectives.
    """

    signs = np.ones(2)
    leading = 0

    def __init__(self, **variables: tuple[float, float]) -> None:
        self.space = Space(variables or {"a": (0.0, 1.0), "b": (0.0, 1.0)})

    def allowed(self, params: Sequence[Params]) -> Array:
        return np.ones(len(params))

    def predict(self, trials: Sequence[FrozenTrial]) -> ExactGuide:
        return self

    def draws(self, params: Sequence[Params], rng: np.random.Generator, count: int) -> Array:
        values = np.array([self.objectives_of(one) for one in params]).reshape(1, len(params), 2)
        return np.repeat(values, count, axis=0)

    def constraints(self, trials: Sequence[FrozenTrial]) -> dict[int, dict[str, float]]:
        return {trial.number: dict(trial.constraints) for trial in trials}

    def losses(self, trials: Sequence[FrozenTrial]) -> Array:
        return np.array([trial.values for trial in trials]).reshape(len(trials), 2)

    def chances(self, params: Sequence[Params]) -> Array:
        return np.ones(len(params))

    def objectives_of(self, params: Params) -> tuple[float, float]:
        behind = 0.2 * round(5.0 * params["b"])
        return params["a"] + behind, 1.0 - params["a"] + behind


class DesignLoop:
    """A search that is asked and told one design after the other."""

    def __init__(
        self, guide: ExactGuide, startup: int = 3, polish_start: int | None = None
    ) -> None:
        self.guide = guide
        self.sampler = SurrogateSampler(cast(Any, guide), 1, startup, polish_start)
        self.trials: list[FrozenTrial] = []

    def tell(self, params: Params, values: Sequence[float] | None = None) -> None:
        """Add a design; it is running without values."""
        trial = self.guide.space.trial(params)
        trial.number = len(self.trials)
        if values is not None:
            trial.state, trial.values = TrialState.COMPLETE, list(values)
        self.trials.append(trial)

    def ask(self, running: bool = False) -> Params | None:
        """Propose a design and tell its values, unless it is to be running."""
        params = self.sampler.propose(self.trials)
        if params is not None:
            self.tell(params, None if running else self.guide.objectives_of(params))
        return params


@pytest.mark.parametrize("objectives", [1, 2, 3])
def test_directions_measure_the_volume(objectives: int) -> None:
    """A box of known sides, and one with a box cut out of it."""
    sides = np.array([0.5, 0.8, 0.7])[:objectives]
    ways = draw_directions(np.random.default_rng(0), 200_000, objectives)
    reference = np.ones(objectives)

    both = np.array([[reference - sides, reference - sides[::-1]]])
    (one,) = added_volume(both[:, :1], both[:, :0], reference, ways)
    assert one == pytest.approx(np.prod(sides), rel=0.01)
    shared = np.prod(np.minimum(sides, sides[::-1]))
    (more,) = added_volume(both[:, 1:], both[:, :1], reference, ways)
    assert one + more == pytest.approx(2 * np.prod(sides) - shared, rel=0.01)
    assert more == pytest.approx(np.prod(sides) - shared, abs=0.01 * one)


def test_a_space_draws_what_it_holds_evenly_or_near_a_design() -> None:
    space, rng = Space(RANGES), np.random.default_rng(0)
    drawn = [space.draw(rng) for _ in range(600)]
    assert all(space.holds(params) for params in drawn)
    assert {params["count"] for params in drawn} == set(range(6, 37))
    where = space.coordinates(drawn)
    assert 0.0 <= where.min() < where.max() <= 1.0
    assert where.mean(axis=0) == pytest.approx([0.5, 0.5], abs=0.06)
    assert not space.holds({**drawn[0], "count": 37})
    assert not space.holds({"count": 7})
    centre = {"height_mm": 3.0, "count": 20}
    near = space.coordinates([space.draw(rng, centre) for _ in range(300)])
    off = near - space.coordinates([centre])
    assert off.std(axis=0) == pytest.approx([NEAR_DEVIATION, NEAR_DEVIATION], rel=0.2)


def test_a_chance_from_few_values_is_unsure() -> None:
    """The limit cases: one, some that are alike; then what many say counts."""
    rng = np.random.default_rng(0)
    asked = rng.random((50, 5))
    for count in (1, 2, 5, 10):
        x = rng.random((count, 5))
        for value in (-0.4, -1e-3, 1e-3, 0.4):
            known = fit_response(x, np.full(count, value), min_deviation=0.2)
            chance = chance_below_zero(known, asked)
            assert ((chance > 0.5) == (value < 0.0)).all()
            assert ((chance > 0.0) & (chance < 1.0)).all()
            if count == 1:
                assert chance == pytest.approx(float(ndtr(-value / 0.2 / 2.1**0.5)), abs=0.12)
            if abs(value) < 0.01:
                assert chance == pytest.approx(0.5, abs=0.05)
    x = rng.random((60, 5))
    chance = chance_below_zero(fit_response(x, x[:, 0] - 0.5, min_deviation=0.2), asked)
    assert (chance[asked[:, 0] < 0.4] > 0.95).all()
    assert (chance[asked[:, 0] > 0.6] < 0.05).all()


@pytest.mark.parametrize("startup", [1, 100])
def test_every_design_of_a_small_space_is_proposed_once(startup: int) -> None:
    """While it fills, and while it improves."""
    guide = ExactGuide(count=(1, 12))
    guide.objectives_of = lambda params: (params["count"], -params["count"])  # type: ignore[method-assign]
    search = DesignLoop(guide, startup)
    told = [search.ask() for _ in range(13)]
    assert told[12] is None
    assert len({params["count"] for params in told[:12] if params}) == 12


@pytest.mark.parametrize("outliers", [[], [(1e3, 1.5)]], ids=["narrow", "with an outlier"])
def test_a_front_that_is_narrow_does_not_stay_so(outliers: list[tuple[float, float]]) -> None:
    """Designs beyond either end of the front are proposed, and those of a batch differ.

    Beside a design a thousand times as slow, slow ones would gain all and quick ones nothing.
    """
    guide = ExactGuide()
    search = DesignLoop(guide)
    front = [{"a": a, "b": 0.0} for a in (0.48, 0.5, 0.52)]
    behind = [{"a": 0.1, "b": 0.6}, {"a": 0.9, "b": 0.6}, {"a": 0.5, "b": 0.4}]
    for params in front + behind:
        search.tell(params, guide.objectives_of(params))
    for values in outliers:
        search.tell({"a": 0.5, "b": 1.0}, values)
    proposed = [guide.objectives_of(search.ask() or {}) for _ in range(4)]
    assert min(one for one, _ in proposed) < 0.25
    assert min(other for _, other in proposed) < 0.25
    batch = [search.ask(running=True) or {} for _ in range(4)]
    apart = [np.hypot(a["a"] - b["a"], a["b"] - b["b"]) for a, b in combinations(batch, 2)]
    assert min(apart) > 0.01


def test_joint_draws_change_as_little_as_their_covariance() -> None:
    """Also where eigenvalues are equal or zero, whose vectors any rounding turns."""
    rng = np.random.default_rng(0)
    root = rng.normal(size=(40, 12))
    pairs = np.kron(np.eye(20), [[1.0, 1.0], [1.0, 1.0]])
    scales = np.logspace(-3.0, 0.0, 40)
    for covariance in (np.eye(40), pairs, root @ root.T, np.outer(scales, scales) * pairs):
        noise = 1e-13 * np.diag(covariance).max() * rng.normal(size=(40, 40))
        changed = covariance + noise + noise.T
        draws, changed_draws = (
            draw_jointly(np.zeros(40), matrix, np.random.default_rng(1), count=4000)
            for matrix in (covariance, changed)
        )
        assert np.abs(draws - changed_draws).max() < 1e-5 * draws.std()
        error = np.cov(draws.T) - covariance
        assert np.abs(error).max() < 0.1 * np.diag(covariance).max()
    assert (draw_jointly(np.ones(2), np.zeros((2, 2)), rng, count=3) == 1.0).all()


def test_equal_gains_are_in_the_order_of_their_places() -> None:
    gains = np.array([0.3, 0.6, 0.1 + 0.2, 0.6 * (1.0 - 1e-12), 0.0])
    assert order_descending(gains) == [1, 3, 0, 2, 4]
    assert order_descending(gains[::-1]) == [1, 3, 2, 4, 0]
    assert order_descending(np.zeros(3)) == [0, 1, 2]


def test_a_polish_ends_nearer_to_the_best() -> None:
    """Of the line that the guide knows, the best of the leading objective lies at its end."""
    designs = [{"a": a, "b": b} for a, b in ((0.3, 0.0), (0.5, 0.2), (0.9, 0.0), (0.4, 0.9))]
    ends = {}
    for polish_start in (None, len(designs)):
        search = DesignLoop(ExactGuide(), polish_start=polish_start)
        for params in designs:
            search.tell(params, search.guide.objectives_of(params))
        before = search.sampler.draw_remaining_gain(search.trials, designs[0])
        proposed = [search.ask() or {} for _ in range(4)]
        best = min(proposed, key=lambda params: search.guide.objectives_of(params)[0])
        ends[polish_start] = search.guide.objectives_of(best)[0]
        after = search.sampler.draw_remaining_gain(search.trials, best)
        assert before.mean() == pytest.approx(0.3, abs=0.02)
        assert 0.0 <= after.mean() <= ends[polish_start]
    assert ends[len(designs)] < 0.01
    assert ends[len(designs)] < ends[None]
    early = DesignLoop(ExactGuide())
    assert not len(early.sampler.draw_remaining_gain(early.trials, designs[0]))
