"""Confirmation: designs of the front, re-simulated at every operating point and at new angles.

A search picks designs that were also lucky, and more angles find harder landings. So prototype and
first designs of the front are re-simulated at angles which the search did not use. A design that
fails a check there beats no other: it leaves the front, those that it alone dominated join it, and
more are confirmed, until so many as are wanted pass, or ``MOST_CONFIRMED`` times as many were
simulated. With ``search.confirm_engine`` Drake confirms what the compiled engine has searched. In
two levels the compiled engine simulates them too, at ``FULL`` times the angles of a screen, which
hold Drake's. All of it follows from trials and shifts, so that a run that was cut off ends as it
would have.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

from optuna.trial import FrozenTrial

from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.search.state import SearchState
from dogshape.pipeline.simulate.design import design_of, objectives_of
from dogshape.pipeline.simulate.evaluation import (
    NEW_ANGLES,
    Simulated,
    evaluate,
    in_two_levels,
    screen,
)
from dogshape.pipeline.simulate.executor import Executor
from dogshape.pipeline.simulate.level_times import compiled_angles
from dogshape.pipeline.simulate.point_plans import most_confirmed, whole_plan
from dogshape.pipeline.store.result_records import check_record, expectation_record
from dogshape.sim.errors import InputError

Told = Callable[[int, str], None]  #: called with how many designs are next, and a line for people


def confirm(
    state: SearchState, executor: Executor, told: Told
) -> tuple[dict[str, Any] | None, SearchState]:
    """Re-simulate prototype and designs of an ended search at angles that it did not use.

    Every operating point is simulated, whatever the search left out. Give the record, None where
    no design passes every check of the search, and the state without designs that fail a check.
    """
    study, found = state.study.confirming, dict[int, Simulated]()
    params: dict[int, dict[str, float]] = {}
    while trials := _next(state, found):
        count, failed = len(trials), len(state.findings.unfit)
        line = f"confirming prototype and {count} of the front at new angles"
        if failed:
            line = f"{failed} failed at the new angles: confirming {count} more of the front"
            line += " without them"
        told(count, line)
        these = {trial.number: dict(trial.params) for trial in trials}
        new = resimulated(study, these, executor)
        params, found = params | these, found | new
        unfit = [t for t, one in new.items() if not _passes(study, these[t], one)]
        state = state.reject(unfit) if unfit else state
    if not found:
        return None, state
    loss = {t.number: state.leading_loss(t) for t in state.simulated if t.number in found}
    order = sorted(found, key=lambda number: (loss[number], number))
    designs = {number: params[number] for number in order}
    return _record(study, designs, {number: found[number] for number in order}, executor), state


def _next(state: SearchState, found: Mapping[int, Simulated]) -> list[FrozenTrial]:
    """Select the first designs of the front as it is now that are to be confirmed next."""
    best = state.best
    if best is None:
        return []
    passed = len(found.keys() - state.findings.unfit)
    wanted = state.study.file.search.confirm_designs - passed
    left = min(wanted, most_confirmed(state.study) - len(found))
    shown = [best, *(t for t in state.front if t.number != best.number)]
    return [t for t in shown if t.number not in found][: max(0, left)]


def resimulated(
    study: Setup, designs: Mapping[int, dict[str, float]], executor: Executor
) -> dict[int, Simulated]:
    """Simulate designs, by trial, at every operating point and at angles new to the search.

    Raises InputError where the shifts of a design say nothing of some objective.
    """
    found = dict(zip(designs, _evaluated(study, [*designs.values()], executor), strict=True))
    _require_known({f"design {trial}": one for trial, one in found.items()})
    return found


def _evaluated(
    study: Setup, designs: list[dict[str, float]], executor: Executor, checked: bool = False
) -> list[Simulated]:
    dogs = [study.dog_with(params) for params in designs]
    own = [study.operated(params) for params in designs]
    angles, seed = study.file.search.confirm_angles, study.file.expectation.seed + NEW_ANGLES
    plans = [whole_plan(study, angles)] * len(dogs)
    found = evaluate(study, dogs, executor, plans, seed, checked=checked, operated=own)
    if study.two_levels:
        many = compiled_angles(study)
        quick = screen(study, dogs, executor, seed, own, angles=many, base=angles)
        both = [one for one in quick if one is not None]
        return in_two_levels(study, both, found, seed, angles)
    screened = screen(study, dogs, executor, seed, own)
    return [
        one if quick is None else replace(one, measured=quick.measured)
        for one, quick in zip(found, screened, strict=True)
    ]


def _passes(study: Setup, params: dict[str, float], found: Simulated) -> bool:
    return design_of(study, params, found.measured).feasible


def _record(
    study: Setup,
    designs: Mapping[int, dict[str, float]],
    found: Mapping[int, Simulated],
    executor: Executor,
) -> dict[str, Any]:
    """Record the confirmation of designs, by trial in the search's order.

    Chosen is the first that passes every check here too, its hardest landing among them; where
    none does, the first. Their order is the search's: none is chosen for its luck here.
    """
    passed = [trial for trial, one in found.items() if _passes(study, designs[trial], one)]
    chosen = (passed or [*found])[0]
    both = _evaluated(study, [study.prototype, designs[chosen]], executor, checked=True)
    _require_known({"the prototype": both[0]})
    prototype, winner = (one.expectation for one in both)
    gain = prototype.mean - winner.mean
    named = study.file.search.confirm_engine
    return {
        **({} if named is None else {"engine": named}),
        "angles": study.file.search.confirm_angles,
        "prototype": _confirmed(study, study.prototype, both[0]),
        "chosen": chosen,
        "best": _confirmed(study, designs[chosen], both[1]),
        "designs": [
            {"trial": trial, **_confirmed(study, designs[trial], one)}
            for trial, one in found.items()
        ],
        "gain_s": gain,
        "gain_standard_error_s": (prototype.standard_error**2 + winner.standard_error**2) ** 0.5,
        "gain_share": gain / prototype.mean,
        "gains": _gains(study, *both),
    }


def _require_known(found: Mapping[str, Simulated]) -> None:
    """Raise InputError where the shifts of a design say nothing of some objective."""
    unknown = [name for name, one in found.items() if not one.known]
    if unknown:
        raise InputError(
            f"every shift of {' and '.join(unknown)} at new angles failed, so what they strike "
            "is unknown; start the study with a larger solver.max_steps or solver.time_limit_s, "
            "or without the objective peak_impact_force_N"
        )


def _gains(study: Setup, prototype: Simulated, best: Simulated) -> dict[str, dict[str, float]]:
    """Compute the gain in each simulated objective, with its standard error."""
    signs = {objective.name: objective.sign for objective in objectives_of(study)}
    gains = {}
    for name, one in best.estimates.items():
        other = prototype.estimates[name]
        value = signs.get(name, 1.0) * (other.value - one.value)
        error = math.hypot(other.standard_error, one.standard_error)
        gains[name] = {"value": value, "standard_error": error}
    return gains


def _confirmed(study: Setup, params: dict[str, float], found: Simulated) -> dict[str, Any]:
    design = design_of(study, params, found.measured)
    return {
        **expectation_record(found.expectation),
        "estimates": {
            name: {"value": one.value, "standard_error": one.standard_error}
            for name, one in found.estimates.items()
        },
        "checks": [check_record(check) for check in design.checks],
    }
