"""Replication: more relative angles where it is unclear which designs are on the front.

After the search a feasible design is unclear whose probability of the front
(``pipeline.search.front_uncertainty``) lies between ``LOW`` and ``HIGH``. Round by round those that
tell most get more angles: evenly spaced ones, twice as many, which hold those of the search
(``sim.statistics.expectation.even_phases``). Then front and probabilities are worked out anew,
until nothing is unclear or the budget is spent.

What a design *i* tells is how many designs fewer are expected on the wrong side, over the shifts
that it has, were its losses y_i known:

    ( sum_j min(p_j, 1 - p_j) - E_i sum_j min(p_j(y_i), 1 - p_j(y_i)) ) / shifts_i

with p_j(y_i) the probability of *j* among joint draws in which *i* has such losses (the expected
value of perfect information, by parts of the draws: Strong and Oakley 2013).

Trials stay as they were told: what more shifts say of them is in the findings of the state alone,
and all of it follows from trials and shifts, so that a run that was cut off ends as it would have.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import astuple, dataclass
from typing import Any

import numpy as np
from optuna.trial import FrozenTrial

from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.search.dog_guide import distinct
from dogshape.pipeline.search.front_uncertainty import Drawn, Standing, draw, standings
from dogshape.pipeline.search.point_choice import HALF, telling_points
from dogshape.pipeline.search.sampler import PLAN
from dogshape.pipeline.search.state import SearchState, checked_design, compiled_of
from dogshape.pipeline.search.trials import attributes_of
from dogshape.pipeline.simulate.design import MEASURED, SIMULATED, objectives_of, values_of
from dogshape.pipeline.simulate.evaluation import Simulated, evaluate
from dogshape.pipeline.simulate.executor import Executor
from dogshape.pipeline.simulate.point_plans import Plan, is_whole, most_to_replicate
from dogshape.pipeline.simulate.precision import MOST
from dogshape.surrogate.covariance import Array, Places

LOW, HIGH = 0.05, 0.95  #: probabilities between which a place on the front is unclear
CELLS = 16  #: parts of the draws, of 125 each, in which a design's losses count as known

Told = Callable[[int, str], None]  #: called with the shifts that are left, and a line for people


@dataclass(frozen=True)
class Replication:
    """Cost and result of a replication.

    ``budget`` and ``shifts`` that it may take and took, ``rounds``, trials that were ``unclear``
    before and after, and how many designs were expected on the wrong side (``misplaced``). By
    trial: the shifts of the search, how designs stood, and the front then. In two levels these are
    Drake's shifts, ``compiled`` has the other engine's of the search, and the budget counts both.
    """

    budget: int
    shifts: int
    rounds: int
    unclear: tuple[list[int], list[int]]
    misplaced: tuple[float, float]
    searched: dict[int, int]
    before: dict[int, Standing]
    front: list[int]
    compiled: dict[int, int] | None = None


def replicate(
    state: SearchState, executor: Executor, told: Told
) -> tuple[Replication, SearchState]:
    """Give unclear designs of an ended search more angles, until none is or the budget is spent.

    Give with the account of it the state that follows.
    """
    first, searched = draw(state), {t.number: sum(state.plan(t)) for t in state.simulated}
    before, on_front = standings(state, first), [trial.number for trial in state.front]
    drawn, rounds, start, spent = first, 0, state.spent, 0
    budget = most_to_replicate(state.study, start)
    while plans := _next_plans(state, drawn, executor, budget - spent):
        state = _simulate(state, plans, executor)
        drawn, rounds = draw(state), rounds + 1
        spent, left = state.spent - start, len(unclear(drawn))
        told(budget - spent, f"replication, {spent} of at most {budget} shifts: {left} unclear")
    done = Replication(
        budget=budget,
        shifts=spent,
        rounds=rounds,
        unclear=(numbers(unclear(first)), numbers(unclear(drawn))),
        misplaced=(first.misplaced, drawn.misplaced),
        searched=searched,
        before=before,
        front=on_front,
    )
    return done, state


def numbers(trials: Sequence[FrozenTrial]) -> list[int]:
    """List the numbers of trials."""
    return [trial.number for trial in trials]


def replication_record(state: SearchState, done: Replication) -> dict[str, Any]:
    """Record what replication took, and each design that it or the front before or after had.

    ``state`` follows the replication. Designs that landed too hard have no standing there.
    """
    after = standings(state)
    now = {trial.number: sum(state.plan(trial)) for trial in state.simulated}
    shown = [trial.number for trial in state.front]
    more = [number for number, shifts in now.items() if shifts > done.searched[number]]
    if done.compiled is not None:
        own = {t.number: compiled_of(state.study, t) for t in state.simulated}
        more = sorted({*more, *(n for n, count in own.items() if count > done.compiled[n])})
    every = dict.fromkeys([*shown, *done.front, *sorted(more)])
    designs = [
        {
            "trial": number,
            "shifts_before": done.searched[number],
            "shifts": now[number],
            **_stood(done.before.get(number), "_before"),
            **_stood(after.get(number), ""),
            "on_front_before": number in done.front,
            "on_front": number in shown,
            **_compiled(state, done, number),
        }
        for number in every
    ]
    both = {}
    if done.compiled is not None:
        both["compiled_shifts"] = sum(
            compiled_of(state.study, trial) - done.compiled[trial.number]
            for trial in distinct(state.simulated)
        )
    return {
        **both,
        "budget_shifts": done.budget,
        "shifts": done.shifts,
        "rounds": done.rounds,
        "misplaced_before": done.misplaced[0],
        "misplaced": done.misplaced[1],
        "unclear_before": done.unclear[0],
        "unclear": done.unclear[1],
        "designs": designs,
    }


def _compiled(state: SearchState, done: Replication, number: int) -> dict[str, int]:
    """Record the compiled shifts of a design before and after; nothing in one level."""
    if done.compiled is None:
        return {}
    trial = next(t for t in state.simulated if t.number == number)
    return {
        "compiled_shifts_before": done.compiled[number],
        "compiled_shifts": compiled_of(state.study, trial),
    }


def _stood(standing: Standing | None, when: str) -> dict[str, float | None]:
    low, high, chance = (None,) * 3 if standing is None else astuple(standing)
    return {f"low{when}": low, f"high{when}": high, f"probability_on_front{when}": chance}


def unclear(drawn: Drawn) -> list[FrozenTrial]:
    """Select the designs whose place on the front is unclear."""
    pairs = zip(drawn.trials, drawn.probabilities, strict=True)
    return [trial for trial, chance in pairs if LOW < chance < HIGH]


def _next_plans(
    state: SearchState, drawn: Drawn, executor: Executor, left: int
) -> list[tuple[FrozenTrial, Plan]]:
    """Return the designs of the next round with their new plans, within ``left`` shifts."""
    found: list[tuple[FrozenTrial, Plan]] = []
    worth = {
        trial.number: telling(drawn, place) / sum(state.plan(trial))
        for place, trial in enumerate(drawn.trials)
    }
    best_first = sorted(unclear(drawn), key=lambda trial: -worth[trial.number])
    for trial in best_first if left > 0 else []:
        order = _telling(state, trial, executor)
        plan = _extended(state.plan(trial), order, state.study.file.expectation.angles, left)
        if plan != state.plan(trial):
            found.append((trial, plan))
            left -= sum(plan) - sum(state.plan(trial))
        if len(found) == state.study.file.search.batch:
            break
    return found


def telling(drawn: Drawn, place: int) -> float:
    """Compute the expected drop in misplaced designs, were one design's losses known."""
    cells = _cells(drawn.losses[:, place, :])
    sizes = np.bincount(cells)
    on_front = np.zeros((len(sizes), drawn.on_front.shape[1]))
    np.add.at(on_front, cells, drawn.on_front)
    known = np.minimum(on_front, sizes[:, None] - on_front).sum() / len(cells)
    return float(drawn.misplaced - known)


def _cells(losses: Array) -> Places:
    """Return the part of the draws to which each belongs by its losses (s, k), (s,)."""
    unsure = losses[:, np.ptp(losses, axis=0) > 0.0]
    each = round(CELLS ** (1.0 / max(1, unsure.shape[1])))
    cells = np.zeros(len(losses), dtype=np.int64)
    for column in unsure.T:
        rank = np.argsort(np.argsort(column, kind="stable"), kind="stable")
        cells = cells * each + rank * each // len(column)
    return cells


def _telling(state: SearchState, trial: FrozenTrial, executor: Executor) -> list[int]:
    if state.predicted and state.guide is not None:
        over = state.guide.over(state.simulated)
        return telling_points(state.study, over, state.study.rows([trial.params])[0])
    (found,) = _evaluated(state, [(trial, state.plan(trial))], executor)
    return most_of_variance(state, found, state.plan(trial))


def most_of_variance(state: SearchState, found: Simulated, plan: Plan) -> list[int]:
    """Select the points that hold half of the variance of a design's objectives.

    First where a shift more takes most of it. Each objective counts the same.
    """
    total = np.zeros(len(plan))
    for name in (one.name for one in objectives_of(state.study) if one.simulated):
        parts = np.array(found.estimates[name].parts)
        if parts.size and parts.sum() > 0.0:
            total[np.array(plan) > 0] += parts / parts.sum()
    order = np.argsort(-total / np.maximum(plan, 1), kind="stable")
    enough = 1 + int(np.searchsorted(np.cumsum(total[order]), HALF * total.sum()))
    return [int(place) for place in order[:enough] if total[place] > 0.0]


def _extended(plan: Plan, order: Sequence[int], angles: int, left: int) -> Plan:
    """Return a plan with twice the angles at some points, within the shifts that are left.

    A point that has none gets as many as the search gave. There are no more than half as many
    shifts more, but for the first point: where they serve best is then asked anew.
    """
    extended, most = list(plan), sum(plan) // 2
    for place in order:
        more = plan[place] or angles
        first = extended == plan
        if plan[place] + more <= MOST and more <= left and (first or more <= most):
            extended[place] += more
            left, most = left - more, most - more
    return extended


def _evaluated(
    state: SearchState, plans: Sequence[tuple[FrozenTrial, Plan]], executor: Executor
) -> list[Simulated]:
    study = state.study
    dogs = [study.dog_with(dict(trial.params)) for trial, _ in plans]
    seed, base = study.file.expectation.seed, study.file.expectation.angles
    own = [study.operated(dict(trial.params)) for trial, _ in plans]
    each = [plan for _, plan in plans]
    return evaluate(study, dogs, executor, each, seed, base=base, operated=own)


def _simulate(
    state: SearchState, plans: Sequence[tuple[FrozenTrial, Plan]], executor: Executor
) -> SearchState:
    """Simulate designs by their new plans and take up what that gives."""
    more = [
        renewed(state.study, one, plan, found)
        for (trial, plan), found in zip(plans, _evaluated(state, plans, executor), strict=True)
        for one in state.simulated
        if one.params == trial.params
    ]
    return state.renew(more)


def renewed(study: Setup, trial: FrozenTrial, plan: Plan, found: Simulated) -> FrozenTrial:
    """Copy a trial with what all shifts of its design say; predicted times stay as told."""
    known: dict[str, Any] = {**trial.user_attrs, **attributes_of(found)}
    # Few shifts do not overrule a screen of many; in two levels both are of the screen.
    if study.file.search.screen_angles is not None and found.levels is None:
        known[MEASURED] = trial.user_attrs[MEASURED]
    if not is_whole(plan):
        known["standard_error_s"] = trial.user_attrs["standard_error_s"]
        for name in ("simulated", "standard_errors"):
            known[name] = {**known[name], SIMULATED: trial.user_attrs[name][SIMULATED]}
    copied = copy(trial)
    copied.user_attrs = known
    copied.system_attrs = {**trial.system_attrs, PLAN: plan}
    copied.values = values_of(study, checked_design(study, copied), known["simulated"])
    return copied
