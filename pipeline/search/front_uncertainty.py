"""Uncertainty of a front: intervals, and the probability that no other design is better.

What is known of the simulated designs is drawn many times. Where a surrogate predicts operating
points, or times rest on two levels (``pipeline.search.level_front``), draws are joint, so that
errors which designs share cancel; otherwise each design has the standard error of its own shifts.
A design's probability is the share of the draws in which no other feasible design beats it in all
objectives.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from optuna.trial import FrozenTrial

from dogshape.pipeline.search.guide import drawn
from dogshape.pipeline.search.level_front import joint_level_times
from dogshape.pipeline.search.state import SearchState
from dogshape.pipeline.simulate.design import SIMULATED, leading, losses_of, objectives_of
from dogshape.surrogate.covariance import Array, Mask
from dogshape.surrogate.hypervolume import not_dominated
from dogshape.surrogate.model import interval

DRAWS, PARTS = 2000, 40  #: draws, and parts of them that are compared at once


@dataclass(frozen=True)
class Standing:
    """Interval (95 %) of a design's leading objective, and its probability of the front."""

    low: float
    high: float
    probability: float


@dataclass(frozen=True)
class Drawn:
    """Joint draws of feasible designs: losses (s, n, k), and who is on the front, (s, n)."""

    trials: list[FrozenTrial]
    losses: Array
    on_front: Mask

    @property
    def probabilities(self) -> Array:
        """Share of the draws in which each design is on the front, (n,)."""
        shares: Array = self.on_front.mean(axis=0)
        return shares

    @property
    def misplaced(self) -> float:
        """Expected number of designs on the wrong side, each put on its likelier one."""
        chance = self.probabilities
        return float(np.minimum(chance, 1.0 - chance).sum())


def draw(state: SearchState) -> Drawn:
    """Draw the losses of the feasible designs of a search; they may be none."""
    trials = [*state.feasible]
    if not trials:
        return Drawn([], np.zeros((DRAWS, 0, 1)), np.zeros((DRAWS, 0), dtype=bool))
    rng = np.random.default_rng(state.study.file.search.seed)
    losses = _draws(state, rng)
    parts = np.array_split(losses, PARTS)
    return Drawn(trials, losses, np.concatenate([not_dominated(part) for part in parts]))


def standings(state: SearchState, drawn: Drawn | None = None) -> dict[int, Standing]:
    """Compute interval and probability of each feasible design, by its trial.

    ``drawn`` are the draws of the state where they are known.
    """
    drawn = drawn or draw(state)
    name = leading(state.study).name
    found = {}
    for trial, probability in zip(drawn.trials, drawn.probabilities.tolist(), strict=True):
        value, error = state.value(trial, name)
        low, high = value - 1.96 * error, value + 1.96 * error
        if value > 0.0:
            low, high = (float(end[0]) for end in interval(np.array([value]), np.array([error])))
        found[trial.number] = Standing(low, high, probability)
    return found


def _draws(state: SearchState, rng: np.random.Generator) -> Array:
    """Draw all losses of feasible designs, (s, n, k)."""
    trials, study = state.feasible, state.study
    means = np.array([state.losses[trial.number] for trial in trials])
    errors = np.array([losses_of(study, t.values, t.user_attrs)[1] for t in trials])
    draws: Array = means + errors * rng.standard_normal((DRAWS, *means.shape))
    names = [objective.name for objective in objectives_of(study)]
    if study.two_levels and SIMULATED in names:
        times, covariance = joint_level_times(study, state.simulated, trials)
        draws[:, :, names.index(SIMULATED)] = drawn(times, covariance, rng, DRAWS)
    elif state.predicted and state.guide is not None and SIMULATED in names:
        times, covariance = state.guide.joint(state.simulated, trials)
        draws[:, :, names.index(SIMULATED)] = drawn(times, covariance, rng, DRAWS)
    return draws
