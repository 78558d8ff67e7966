"""Confirmation: designs of the front, simulated again at every operating point and at new angles.

A search picks designs that were also lucky, and more angles find harder landings. So prototype and
designs of the front are simulated again at angles which the search did not use, by the compiled
engine at ``DENSER`` times as many; their values and checks are those found there. At
``search.confirm_angles`` of the same angles Drake simulates them too, and a design on which both
engines do not agree (``pipeline.simulate.agreement``) leaves the front. A study in Drake has
``search.confirm_angles`` new angles alone.

The front follows from these values: a design that fails a check leaves it, one that another now
beats too, and designs that come onto it are confirmed next, until the whole front is, or
``search.confirm_designs`` were simulated. What is not confirmed then is not on the front of the
result. All of it follows from trials and shifts, so that a run that was cut off ends as it would
have.

**Gain under other contact.** Friction of dogs and dissipation of a blow are seldom known; a
standard error counts neither. So the compiled engine simulates prototype and chosen design at the
ends of what contact may be: friction a third less and a third more (oiled steel 0.08 to 0.16, VDI
2230-1), dissipation 1 s/m of dry steel and 60 s/m of faces that meet through oil
(``docs/simulation.md``). What the study draws stays drawn about that.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.search.state import SearchState, Trial
from dogshape.pipeline.simulate.agreement import Agreement, compare_engines
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
    Params,
    Simulated,
    design_blocks,
    evaluate,
    expectation_of,
)
from dogshape.pipeline.simulate.executor import Executor
from dogshape.pipeline.store.result_records import check_record, expectation_record
from dogshape.pipeline.train.training_rows import row_record
from dogshape.sim.errors import InputError
from dogshape.sim.shift.clutch import ContactSet
from dogshape.sim.statistics.blocks import Block, numerical_error, repeated
from dogshape.sim.statistics.expectation import Expectation

ANGLES = 32  #: of each operating point, for either design
FRICTION, DISSIPATION = (2.0 / 3.0, 4.0 / 3.0), (1.0, 60.0)  #: factors; s/m


def gains_by_contact(study: Setup, params: Params, executor: Executor) -> list[dict[str, Any]]:
    """Simulate the gain in expected shift time under each contact, a row each.

    None where either design engages in too few shifts to have a time.
    """
    named = _contacts(study.clutch.contact)
    designs = [study.prototype, params]
    seed = study.file.expectation.seed + NEW_ANGLES
    asked = []
    for contact in named.values():
        clutch = replace(study.clutch.with_engine("planar"), contact=contact)
        quick = replace(study, clutch=clutch)
        asked += [design_blocks(quick, one, ANGLES, seed) for one in designs]
    with executor.apart() as running:
        rows = iter(running.run([block for blocks in asked for block in blocks]))
    found = [
        expectation_of(study, [b.point for b in blocks], [next(rows) for _ in blocks])
        for blocks in asked
    ]
    pairs = zip(named, found[::2], found[1::2], strict=True)
    return [_row(name, before, after) for name, before, after in pairs]


def _contacts(own: ContactSet) -> dict[str, ContactSet]:
    """Make the contact sets at the ends of friction and dissipation, by what they are called."""
    frictions = {
        f"friction {own.dynamic_friction * factor:.3g}": replace(
            own,
            static_friction=own.static_friction * factor,
            dynamic_friction=own.dynamic_friction * factor,
        )
        for factor in FRICTION
    }
    blows = {f"dissipation {d:g} s/m": replace(own, dissipation=d) for d in DISSIPATION}
    return frictions | blows


def _row(name: str, before: Expectation, after: Expectation) -> dict[str, Any]:
    known = before.engages and after.engages
    gain = before.mean - after.mean
    error = math.hypot(before.standard_error, after.standard_error)
    return {
        "contact": name,
        "gain_s": gain if known else None,
        "gain_standard_error_s": error if known else None,
        "gain_share": gain / before.mean if known else None,
    }


Told = Callable[[int, str], None]  #: called with how many designs are next, and a line for people
DENSER = 2  #: times the angles of the search that the compiled engine has at the new ones
APART = 3.0  #: standard errors from which search and confirmation of a design do not agree


@dataclass(frozen=True)
class Executors:
    """Executors of a study: of the compiled shifts that no result needs later, and of the others.

    A study in Drake has its search in the first and its confirmation in the second.
    """

    search: Executor
    kept: Executor


@dataclass(frozen=True)
class Confirmed:
    """A design at new angles, and the agreement of both engines there; None without two."""

    simulated: Simulated
    agreement: Agreement | None


def new_angles(study: Setup) -> int:
    """Count the new angles of each operating point: a multiple of ``search.confirm_angles``."""
    few = study.file.search.confirm_angles
    if study.clutch.solver.engine == "drake":
        return few
    return few * math.ceil(DENSER * study.file.expectation.angles / few)


def shifts_to_confirm(study: Setup, designs: int) -> int:
    """Count the shifts that confirm the prototype and so many designs, at most.

    For prototype and chosen design those for the numerical error come on top.
    """
    few, many = study.file.search.confirm_angles, new_angles(study)
    both = len(study.points) * (many if many == few else many + few)
    return (1 + designs) * both + 2 * repeated(len(study.points) * few)


def confirm(
    searched: SearchState, executors: Executors, told: Told
) -> tuple[dict[str, Any] | None, SearchState]:
    """Simulate prototype and front of an ended search at angles that it did not use.

    Give the record, None where no design passes every check of the search, and the state with the
    values at the new angles.
    """
    state, study, found = searched, searched.study, dict[int, Confirmed]()
    while trials := _next(state, len(found)):
        line = f"confirming prototype and {len(trials)} of the front at new angles"
        if found:
            line = f"confirming {len(trials)} more that the new angles put on the front"
        told(len(trials), line)
        new = _resimulated(study, [trial.params for trial in trials], executors)
        names = [f"design {trial.number}" for trial in trials]
        _require_known(dict(zip(names, new, strict=True)))
        found |= {trial.number: one for trial, one in zip(trials, new, strict=True)}
        state = state.renew(_renewed(study, t, found[t.number]) for t in trials)
    if not found:
        return None, state
    loss = {trial.number: searched.leading_loss(trial) for trial in searched.simulated}
    order = sorted(found, key=lambda number: (loss[number], number))
    return _record(searched, state, {number: found[number] for number in order}, executors), state


def _next(state: SearchState, done: int) -> list[Trial]:
    """Select the designs of the front as it is now that are confirmed next."""
    open_ones = [trial for trial in state.front if not trial.confirmed]
    return open_ones[: max(0, state.study.file.search.confirm_designs - done)]


def _renewed(study: Setup, trial: Trial, found: Confirmed) -> Trial:
    """Replace the values of a trial by those of new angles, and add its rows there."""
    one = found.simulated
    values = {name: estimate.value for name, estimate in one.estimates.items()}
    return replace(
        trial,
        values=tuple(values_of(study, design_of(study, trial.params, one.measured), values)),
        estimates=one.estimates,
        measured=one.measured,
        rows=[*trial.rows, *row_record(one.rows)],
        confirmed=True,
        judged=found.agreement is None or found.agreement.agrees,
    )


def _resimulated(
    study: Setup, designs: Sequence[Params], executors: Executors, *, require_made: bool = True
) -> list[Confirmed]:
    """Simulate designs at new angles, and again in Drake at some of them."""
    many, seed, executor = new_angles(study), _seed(study), _executor(study, executors)
    found = evaluate(study, designs, executor, many, seed, require_made=require_made)
    results = []
    for params, one in zip(designs, found, strict=True):
        agreement, blocks = None, _thinned(study, params)
        if study.judging is not None:
            rows = executor.run(blocks)  # which are known by now
            agreement = compare_engines(blocks, rows, study.judging.clutch, executors.kept)
        else:
            executors.kept.run(blocks)  # for the single shifts of the report
        results.append(Confirmed(one, agreement))
    executors.search.forget()
    return results


def _with_numerical_error(
    study: Setup, params: Params, found: Confirmed, executors: Executors
) -> Confirmed:
    """Add the numerical error, from some of the shifts repeated."""
    executor, blocks = _executor(study, executors), _thinned(study, params)
    error = numerical_error(blocks, executor.run(blocks), executor.run)
    one = found.simulated
    expectation = replace(one.expectation, numerical_error=error)
    return replace(found, simulated=replace(one, expectation=expectation))


def _seed(study: Setup) -> int:
    return study.file.expectation.seed + NEW_ANGLES


def _executor(study: Setup, executors: Executors) -> Executor:
    return executors.kept if study.clutch.solver.engine == "drake" else executors.search


def _thinned(study: Setup, params: Params) -> list[Block]:
    """Return the shifts of a design at ``search.confirm_angles`` of its new angles."""
    many = new_angles(study)
    places = range(0, many, many // study.file.search.confirm_angles)
    return [block.only(places) for block in design_blocks(study, params, many, _seed(study))]


def _record(
    searched: SearchState,
    state: SearchState,
    found: Mapping[int, Confirmed],
    executors: Executors,
) -> dict[str, Any]:
    """Record the confirmation of designs, by trial in the search's order.

    Chosen is the first of the front in that order; where no design passes, the first of all. None
    is chosen for its luck here.
    """
    study = searched.study
    trials = {trial.number: trial for trial in searched.simulated if trial.number in found}
    front = {trial.number for trial in state.front}
    chosen = next((number for number in found if number in front), next(iter(found)))
    params, own = trials[chosen].params, trials[chosen].prototype
    if own:
        prototype = found[chosen]
    else:
        (prototype,) = _resimulated(study, [study.prototype], executors, require_made=False)
        _require_known({"the prototype": prototype})
    both = [
        _with_numerical_error(study, one, known, executors)
        for one, known in ((study.prototype, prototype), (params, found[chosen]))
    ]
    return {
        "angles": new_angles(study),
        "drake_angles": None if both[0].agreement is None else study.file.search.confirm_angles,
        "prototype": _confirmed(study, study.prototype, both[0]),
        "chosen": chosen,
        "best": _confirmed(study, params, both[1]),
        "designs": [
            {
                "trial": number,
                **_confirmed(study, trials[number].params, one),
                **_beside_search(searched, trials[number], one.simulated),
            }
            for number, one in found.items()
        ],
        "left_out": [trial.number for trial in state.front if not trial.confirmed],
        **_gain(study, None if own else both[0].simulated, both[1].simulated),
        "gains_by_contact": [] if own else gains_by_contact(study, params, executors.search),
    }


def _beside_search(searched: SearchState, trial: Trial, found: Simulated) -> dict[str, Any]:
    """Record the leading objective by the search, and how far that is off."""
    name = leading(searched.study).name
    old, new = (trial.estimates or {})[name], found.estimates[name]
    both = math.hypot(old.standard_error, new.standard_error)
    off = (new.value - old.value) / both if both else 0.0
    return {
        "searched": {"value": old.value, "standard_error": old.standard_error},
        "errors_apart": off,
        "agrees": abs(off) <= APART,
    }


def _require_known(found: Mapping[str, Confirmed]) -> None:
    """Raise InputError where the shifts of a design say nothing of some objective."""
    unknown = [name for name, one in found.items() if not one.simulated.known]
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


def _confirmed(study: Setup, params: Params, found: Confirmed) -> dict[str, Any]:
    design = design_of(study, params, found.simulated.measured)
    return {
        **expectation_record(found.simulated.expectation),
        "estimates": _estimates(found.simulated),
        "checks": [check_record(check) for check in design.checks],
        "drake": None if found.agreement is None else found.agreement.record,
    }
