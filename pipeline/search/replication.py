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

Trials stay as they were told: what more shifts say of them is in the search alone, and all of it
follows from trials and shifts, so that a run that was cut off ends as it would have.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from copy import copy
from dataclasses import astuple, dataclass
from typing import Any

import numpy as np
from optuna.trial import FrozenTrial

from dogshape.pipeline.search.front_uncertainty import Drawn, Standing, draw, standings
from dogshape.pipeline.search.point_choice import HALF, telling_points
from dogshape.pipeline.search.sampler import PLAN
from dogshape.pipeline.search.search import Search, front
from dogshape.pipeline.search.trials import attributes_of
from dogshape.pipeline.simulate.design import SIMULATED, objectives_of, values_of
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
    """What replication took and changed.

    ``budget`` and ``shifts`` that it may take and took, ``rounds``, trials that were ``unclear``
    before and after, and how many designs were expected on the wrong side (``misplaced``). By
    trial: the shifts of the search, how designs stood, and the front then.
    """

    budget: int
    shifts: int
    rounds: int
    unclear: tuple[list[int], list[int]]
    misplaced: tuple[float, float]
    searched: dict[int, int]
    before: dict[int, Standing]
    front: list[int]


def replicate(search: Search, executor: Executor, told: Told) -> Replication:
    """Give unclear designs of an ended search more angles, until none is or the budget is spent."""
    first, searched = draw(search), {t.number: sum(search.plan(t)) for t in search.simulated}
    before, on_front = standings(search, first), [trial.number for trial in front(search)]
    drawn, rounds, start = first, 0, search.spent
    budget = most_to_replicate(search.study, start)
    while plans := _next_plans(search, drawn, executor, budget - (search.spent - start)):
        _simulate(search, plans, executor)
        drawn, rounds = draw(search), rounds + 1
        spent, left = search.spent - start, len(unclear(drawn))
        told(budget - spent, f"replication, {spent} of at most {budget} shifts: {left} unclear")
    return Replication(
        budget=budget,
        shifts=search.spent - start,
        rounds=rounds,
        unclear=(_numbers(unclear(first)), _numbers(unclear(drawn))),
        misplaced=(first.misplaced, drawn.misplaced),
        searched=searched,
        before=before,
        front=on_front,
    )


def _numbers(trials: Sequence[FrozenTrial]) -> list[int]:
    return [trial.number for trial in trials]


def replication_record(
    search: Search, done: Replication, after: Mapping[int, Standing]
) -> dict[str, Any]:
    """Return what replication took, and each design that it or the front before or after had.

    ``after`` is how designs stand now, by trial: those that landed too hard have no place in it.
    """
    now = {trial.number: sum(search.plan(trial)) for trial in search.simulated}
    shown = [trial.number for trial in front(search)]
    more = [number for number, shifts in now.items() if shifts > done.searched[number]]
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
        }
        for number in every
    ]
    return {
        "budget_shifts": done.budget,
        "shifts": done.shifts,
        "rounds": done.rounds,
        "misplaced_before": done.misplaced[0],
        "misplaced": done.misplaced[1],
        "unclear_before": done.unclear[0],
        "unclear": done.unclear[1],
        "designs": designs,
    }


def _stood(standing: Standing | None, when: str) -> dict[str, float | None]:
    low, high, chance = (None,) * 3 if standing is None else astuple(standing)
    return {f"low{when}": low, f"high{when}": high, f"probability_on_front{when}": chance}


def unclear(drawn: Drawn) -> list[FrozenTrial]:
    """Return the designs of which it is unclear whether they are on the front."""
    pairs = zip(drawn.trials, drawn.probabilities, strict=True)
    return [trial for trial, chance in pairs if LOW < chance < HIGH]


def _next_plans(
    search: Search, drawn: Drawn, executor: Executor, left: int
) -> list[tuple[FrozenTrial, Plan]]:
    """Return the designs of the next round with their new plans, within ``left`` shifts."""
    found: list[tuple[FrozenTrial, Plan]] = []
    for trial in _in_order(search, drawn) if left > 0 else []:
        order = _telling(search, trial, executor)
        plan = _extended(search.plan(trial), order, search.study.file.expectation.angles, left)
        if plan != search.plan(trial):
            found.append((trial, plan))
            left -= sum(plan) - sum(search.plan(trial))
        if len(found) == search.study.file.search.batch:
            break
    return found


def _in_order(search: Search, drawn: Drawn) -> list[FrozenTrial]:
    """Return the unclear designs, first what tells most for a shift."""
    worth = {
        trial.number: telling(drawn, place) / sum(search.plan(trial))
        for place, trial in enumerate(drawn.trials)
    }
    return sorted(unclear(drawn), key=lambda trial: -worth[trial.number])


def telling(drawn: Drawn, place: int) -> float:
    """Return how many designs fewer would be on the wrong side, were one design's losses known."""
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


def _telling(search: Search, trial: FrozenTrial, executor: Executor) -> list[int]:
    """Return the operating points whose standard error counts most in a design, in that order."""
    if search.foretold and search.guide is not None:
        over = search.guide.over(search.simulated)
        return telling_points(search.study, over, search.study.rows([trial.params])[0])
    (found,) = _evaluated(search, [(trial, search.plan(trial))], executor)
    return most_of_variance(search, found, search.plan(trial))


def most_of_variance(search: Search, found: Simulated, plan: Plan) -> list[int]:
    """Return the points that hold half of the variance of a design's objectives.

    First where a shift more takes most of it. Each objective counts the same.
    """
    total = np.zeros(len(plan))
    for name in (one.name for one in objectives_of(search.study) if one.simulated):
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
    search: Search, plans: Sequence[tuple[FrozenTrial, Plan]], executor: Executor
) -> list[Simulated]:
    study = search.study
    dogs = [study.dog_with(dict(trial.params)) for trial, _ in plans]
    seed, base = study.file.expectation.seed, study.file.expectation.angles
    return evaluate(study, dogs, executor, [plan for _, plan in plans], seed, base=base)


def _simulate(
    search: Search, plans: Sequence[tuple[FrozenTrial, Plan]], executor: Executor
) -> None:
    """Simulate designs by their new plans and take up what that gives."""
    for (trial, plan), found in zip(plans, _evaluated(search, plans, executor), strict=True):
        same = [one for one in search.simulated if one.params == trial.params]
        search.renew([renewed(search, one, plan, found) for one in same])


def renewed(search: Search, trial: FrozenTrial, plan: Plan, found: Simulated) -> FrozenTrial:
    """Return a trial as all shifts of its design say; times that are foretold stay as told."""
    known: dict[str, Any] = {**trial.user_attrs, **attributes_of(found)}
    if not is_whole(plan):
        known["standard_error_s"] = trial.user_attrs["standard_error_s"]
        for name in ("simulated", "standard_errors"):
            known[name] = {**known[name], SIMULATED: trial.user_attrs[name][SIMULATED]}
    renewed = copy(trial)
    renewed.user_attrs = known
    renewed.system_attrs = {**trial.system_attrs, PLAN: plan}
    renewed.values = values_of(search.study, search.design(renewed), known["simulated"])
    return renewed
