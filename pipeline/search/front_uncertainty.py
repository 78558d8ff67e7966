"""Uncertainty of a front: intervals, and the probability that no other design is better.

What is known of the simulated designs is drawn many times. Where a surrogate predicts operating
points, or times rest on two levels (``pipeline.search.level_front``), draws are joint, so that
errors which designs share cancel; otherwise, and where it was confirmed, each design has the
standard error of its own shifts.
A design's probability is the share of the draws in which no other feasible design beats it in all
objectives.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dogshape.pipeline.search.guide import drawn
from dogshape.pipeline.search.level_front import joint_level_times
from dogshape.pipeline.search.state import SearchState
from dogshape.pipeline.simulate.design import SIMULATED, leading, losses_of, objectives_of
from dogshape.surrogate.covariance import Array
from dogshape.surrogate.hypervolume import not_dominated
from dogshape.surrogate.model import interval

DRAWS, PARTS = 2000, 40  #: draws, and parts of them that are compared at once


@dataclass(frozen=True)
class Standing:
    """Interval (95 %) of a design's leading objective, and its probability of the front."""

    low: float
    high: float
    probability: float


def standings(state: SearchState) -> dict[int, Standing]:
    """Compute interval and probability of each feasible design, by its trial."""
    if not state.feasible:
        return {}
    losses = _draws(state, np.random.default_rng(state.study.file.search.seed))
    on_front = np.concatenate([not_dominated(part) for part in np.array_split(losses, PARTS)])
    name = leading(state.study).name
    found = {}
    for trial, probability in zip(state.feasible, on_front.mean(axis=0).tolist(), strict=True):
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
    shared = [k for k, trial in enumerate(trials) if trial.number in state.predicted]
    if shared and SIMULATED in names:
        asked = [trials[k] for k in shared]
        if study.two_levels:
            found = joint_level_times(study, state.simulated, asked)
        else:
            assert state.guide is not None
            found = state.guide.joint(state.simulated, asked)
        draws[:, shared, names.index(SIMULATED)] = drawn(*found, rng, DRAWS)
    return draws
