"""Replication in two levels: more compiled shifts first, then Drake's where they tell.

Designs of the front are screened at ``FULL`` times the angles of the search, before anything
confirms them: landings and the slowest operating point are extremes of the sample, and a design
that fails there leaves the front, which may bring others onto it. Then, as in one level
(``pipeline.search.replication``), round by round those of unclear designs that tell most get twice
the angles of one engine at every operating point: of the one that takes more of the variance of
the design's time for its cost. A compiled shift counts ``COST`` of one of Drake.

Compiled shifts are not kept, and the journal has Drake's: a run that was cut off repeats some
seconds of each design and ends as it would have.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from optuna.trial import FrozenTrial

from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.search.front_uncertainty import Drawn, draw, standings
from dogshape.pipeline.search.level_front import correction_of, levels_of
from dogshape.pipeline.search.replication import (
    Replication,
    Told,
    numbers,
    renewed,
    telling,
    unclear,
)
from dogshape.pipeline.search.state import SearchState, compiled_of, compiled_shifts
from dogshape.pipeline.simulate.evaluation import Simulated, evaluate, in_two_levels, screen
from dogshape.pipeline.simulate.executor import Executor
from dogshape.pipeline.simulate.level_times import FULL, LevelTimes
from dogshape.pipeline.simulate.point_plans import most_to_replicate, whole_plan
from dogshape.pipeline.simulate.two_levels import COST

MOST_COMPILED = 16  #: times the angles of the search, at most
MOST_PAIRS = 64  #: angles of Drake at each operating point, at most
FALLS = 0.6  #: of the variance of the compiled engine's mean, what twice the angles take
FALLS_PAIRS = 0.5  #: of that of the mean difference


@dataclass(frozen=True)
class Step:
    """A design's next angles, of Drake and of the compiled engine, and what they cost.

    ``worth`` is what they are expected to tell for the cost, in shifts of Drake.
    """

    trial: FrozenTrial
    few: int
    many: int
    cost: float
    worth: float


def effort(state: SearchState) -> float:
    """Count the shifts of a state in two levels, in those of Drake."""
    return state.spent + COST * compiled_shifts(state.study, state.trials)


def replicate_levels(
    state: SearchState, executor: Executor, told: Told
) -> tuple[Replication, SearchState]:
    """Screen the front at more angles, then tell unclear designs apart within the budget.

    Give with the account of it the state that follows.
    """
    first, start, before = draw(state), effort(state), state
    known = {t.number: compiled_of(state.study, t) for t in state.simulated}
    drawn, rounds, spent = first, 0, 0.0
    budget = most_to_replicate(state.study, int(start))
    while steps := _next_steps(state, drawn, budget - spent):
        for step in steps:
            state = _simulate(state, step, executor)
        drawn, rounds, spent = draw(state), rounds + 1, effort(state) - start
        left = len(unclear(drawn))
        told(
            int(budget - spent),
            f"replication, {state.spent - before.spent} shifts of Drake and "
            f"{round((spent - state.spent + before.spent) / COST)} compiled ones: {left} unclear",
        )
    done = Replication(
        budget=budget,
        shifts=state.spent - before.spent,
        rounds=rounds,
        unclear=(numbers(unclear(first)), numbers(unclear(drawn))),
        misplaced=(first.misplaced, drawn.misplaced),
        searched={t.number: sum(before.plan(t)) for t in before.simulated},
        before=standings(before, first),
        front=[trial.number for trial in before.front],
        compiled=known,
    )
    return done, state


def _next_steps(state: SearchState, drawn: Drawn, left: float) -> list[Step]:
    """Choose the steps of the next round within the cost that is left."""
    study = state.study
    full = FULL * (study.file.search.screen_angles or 0)
    steps = []
    for trial in state.front:
        levels = levels_of(study, trial)
        if levels.many < full:
            more = COST * (full - levels.many) * len(study.points)
            steps.append(Step(trial, levels.few, full, more, 0.0))
    if not steps:
        steps = sorted(_telling_steps(state, drawn), key=lambda step: -step.worth)
    chosen: list[Step] = []
    for step in steps:
        if step.cost <= left and len(chosen) < study.file.search.batch:
            chosen.append(step)
            left -= step.cost
    return chosen


def _telling_steps(state: SearchState, drawn: Drawn) -> list[Step]:
    study = state.study
    every = {t.number: levels_of(study, t) for t in state.simulated}
    own = correction_of(study, [*every.values()]).own
    corrected = dict(zip(every, own.tolist(), strict=True))
    found, asked = [], set(numbers(unclear(drawn)))
    for place, trial in enumerate(drawn.trials):
        if trial.number in asked:
            levels, gain = every[trial.number], telling(drawn, place)
            variance = corrected[trial.number] * levels.compiled**2
            found += _steps(study, trial, levels, variance, gain)
    return found


def _steps(
    study: Setup, trial: FrozenTrial, levels: LevelTimes, corrected: float, gain: float
) -> list[Step]:
    """List the better of both steps of a design, none where it has all angles that it may.

    ``corrected`` is the variance of its own correction, s2, and ``gain`` what it would tell.
    """
    points, few, many = len(study.points), levels.few, levels.many
    whole = levels.compiled_variance + corrected
    found = []
    if 2 * many <= MOST_COMPILED * (study.file.search.screen_angles or 0):
        cost, share = COST * many * points, FALLS * levels.compiled_variance / whole
        found.append(Step(trial, few, 2 * many, cost, gain * share / cost))
    if 2 * few <= min(MOST_PAIRS, many):
        cost, share = float(few * points), FALLS_PAIRS * corrected / whole
        found.append(Step(trial, 2 * few, many, cost, gain * share / cost))
    return [max(found, key=lambda step: step.worth)] if found else []


def simulated_levels(
    study: Setup, params: Mapping[str, float], executor: Executor, few: int, many: int
) -> tuple[Simulated, Sequence[int]]:
    """Simulate a design at so many angles of both engines; give it with its plan in Drake."""
    dog, own = study.dog_with(dict(params)), study.operated(params)
    seed, base, plan = study.file.expectation.seed, study.own_angles, whole_plan(study, few)
    (quick,) = screen(study, [dog], executor, seed, [own], angles=many, base=base)
    (one,) = evaluate(study, [dog], executor, [plan], seed, base=base, operated=[own])
    assert quick is not None
    (both,) = in_two_levels(study, [quick], [one], seed, base)
    return both, plan


def _simulate(state: SearchState, step: Step, executor: Executor) -> SearchState:
    params = {**step.trial.params}
    found, plan = simulated_levels(state.study, params, executor, step.few, step.many)
    same = [one for one in state.simulated if one.params == step.trial.params]
    return state.renew([renewed(state.study, one, [*plan], found) for one in same])
