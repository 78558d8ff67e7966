"""Confirmation: designs of the front, re-simulated at every operating point and at new angles.

A search picks designs that were also lucky, and more angles find harder landings. So prototype and
designs of the front are re-simulated at angles which the search did not use, and their values and
checks are those found there. The front follows from these: a design that fails a check leaves it,
one that another now beats too, and designs that come onto it are confirmed next, until the whole
front is, or ``search.confirm_designs`` were simulated. What is not confirmed then is not on the
front of the result. With ``search.confirm_engine`` Drake confirms what the compiled engine has
searched. In two levels the compiled engine simulates them too, at ``FULL`` times the angles of a
screen, which hold Drake's. All of it follows from trials and shifts, so that a run that was cut off
ends as it would have.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from copy import copy
from dataclasses import replace
from typing import Any

from optuna.trial import FrozenTrial

from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.search.state import CONFIRMED, SearchState, checked_design, confirmed
from dogshape.pipeline.search.trials import attributes_of
from dogshape.pipeline.simulate.contact_range import gains_by_contact
from dogshape.pipeline.simulate.design import (
    SIMULATED,
    design_of,
    is_time,
    leading,
    objectives_of,
    values_of,
)
from dogshape.pipeline.simulate.evaluation import (
    NEW_ANGLES,
    Simulated,
    evaluate,
    in_two_levels,
    screen,
)
from dogshape.pipeline.simulate.executor import Executor
from dogshape.pipeline.simulate.level_times import compiled_angles
from dogshape.pipeline.simulate.point_plans import whole_plan
from dogshape.pipeline.store.result_records import check_record, expectation_record
from dogshape.sim.errors import InputError

Told = Callable[[int, str], None]  #: called with how many designs are next, and a line for people
APART = 3.0  #: standard errors from which search and confirmation of a design do not agree


def confirm(
    searched: SearchState, executor: Executor, told: Told
) -> tuple[dict[str, Any] | None, SearchState]:
    """Re-simulate prototype and front of an ended search at angles that it did not use.

    Every operating point is simulated, whatever the search left out. Give the record, None where
    no design passes every check of the search, and the state with what the new angles say.
    """
    state, study, found = searched, searched.study.confirming, dict[int, Simulated]()
    while trials := _next(state, len(found)):
        line = f"confirming prototype and {len(trials)} of the front at new angles"
        if found:
            line = f"confirming {len(trials)} more that the new angles put on the front"
        told(len(trials), line)
        these = {trial.number: dict(trial.params) for trial in trials}
        new = resimulated(study, these, executor)
        found |= new
        state = state.renew(_with_found(study, t, new[t.number]) for t in trials)
    if not found:
        return None, state
    loss = {trial.number: searched.leading_loss(trial) for trial in searched.simulated}
    order = sorted(found, key=lambda number: (loss[number], number))
    return _record(searched, state, {number: found[number] for number in order}, executor), state


def _next(state: SearchState, done: int) -> list[FrozenTrial]:
    """Select the designs of the front as it is now that are confirmed next."""
    open_ones = [trial for trial in state.front if not confirmed(trial)]
    return open_ones[: max(0, state.study.file.search.confirm_designs - done)]


def _with_found(study: Setup, trial: FrozenTrial, found: Simulated) -> FrozenTrial:
    """Copy a trial with the values of new angles; what the surrogate learns stays the search's."""
    kept, noted = ("rows", "levels"), copy(trial)
    new = {k: v for k, v in attributes_of(found).items() if k not in kept}
    noted.user_attrs = {**trial.user_attrs, **new, CONFIRMED: True}
    values = {name: one.value for name, one in found.estimates.items()}
    noted.values = values_of(study, checked_design(study, noted), values)
    return noted


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


def _record(
    searched: SearchState, state: SearchState, found: Mapping[int, Simulated], executor: Executor
) -> dict[str, Any]:
    """Record the confirmation of designs, by trial in the search's order.

    Chosen is the first of the front in that order; where no design passes, the first of all. None
    is chosen for its luck here.
    """
    study = searched.study.confirming
    trials = {trial.number: trial for trial in searched.simulated if trial.number in found}
    front = {trial.number for trial in state.front}
    chosen = next((number for number in found if number in front), next(iter(found)))
    params = dict(trials[chosen].params)
    both = _evaluated(study, [study.prototype, params], executor, checked=True)
    _require_known({"the prototype": both[0]})
    named, own = study.file.search.confirm_engine, bool(trials[chosen].user_attrs.get("prototype"))
    return {
        **({} if named is None else {"engine": named}),
        "angles": study.file.search.confirm_angles,
        "prototype": _confirmed(study, study.prototype, both[0]),
        "chosen": chosen,
        "best": _confirmed(study, params, both[1]),
        "designs": [
            {
                "trial": number,
                **_confirmed(study, dict(trials[number].params), one),
                **_beside_search(searched, trials[number], one),
            }
            for number, one in found.items()
        ],
        "left_out": [trial.number for trial in state.front if not confirmed(trial)],
        **_gain(study, None if own else both[0], both[1]),
        "gains_by_contact": [] if own else gains_by_contact(study, params, executor),
    }


def _beside_search(searched: SearchState, trial: FrozenTrial, found: Simulated) -> dict[str, Any]:
    """Record what the search had said of the leading objective, and how far that is off."""
    name = leading(searched.study).name
    value, error = searched.value(trial, name)
    new = found.estimates[name]
    both = math.hypot(error, new.standard_error)
    off = (new.value - value) / both if both else 0.0
    return {
        "searched": {"value": value, "standard_error": error},
        "errors_apart": off,
        "agrees": abs(off) <= APART,
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


def _gain(study: Setup, prototype: Simulated | None, best: Simulated) -> dict[str, Any]:
    """Compute the gain in each simulated objective, with its standard error.

    None over the prototype itself, and in a time where either engages too seldom to have one.
    """
    signs = {objective.name: objective.sign for objective in objectives_of(study)}
    before = {} if prototype is None else _estimates(prototype)
    gains = {}
    for name, one in _estimates(best).items():
        if (other := before.get(name)) is not None:
            value = signs.get(name, 1.0) * (other["value"] - one["value"])
            error = math.hypot(other["standard_error"], one["standard_error"])
            gains[name] = {"value": value, "standard_error": error}
    time = gains.get(SIMULATED)
    share = None if time is None else time["value"] / before[SIMULATED]["value"]
    return {
        "gain_s": None if time is None else time["value"],
        "gain_standard_error_s": None if time is None else time["standard_error"],
        "gain_share": share,
        "gains": gains,
    }


def _estimates(found: Simulated) -> dict[str, dict[str, float]]:
    """Record the simulated objectives that a design has: no time where too few shifts engage."""
    engages = found.expectation.engages
    return {
        name: {"value": one.value, "standard_error": one.standard_error}
        for name, one in found.estimates.items()
        if engages or not is_time(name)
    }


def _confirmed(study: Setup, params: dict[str, float], found: Simulated) -> dict[str, Any]:
    design = design_of(study, params, found.measured)
    return {
        **expectation_record(found.expectation),
        "estimates": _estimates(found),
        "checks": [check_record(check) for check in design.checks],
    }
