"""Trials of a round: simulated side by side, then told in the order of their numbers.

A trial is told once all that belongs to it is known, and each for itself: what another run told
meanwhile is left as it is. A design of which the clock ended a shift
(``sim.statistics.shift_records.unfinished``) is told to nobody: this run counts the shift as
failed, and the next one takes the trial up again.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from copy import copy
from dataclasses import replace
from typing import Any

import optuna
from optuna.exceptions import UpdateFinishedTrialError
from optuna.trial import FrozenTrial, TrialState

from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.search.dog_guide import SCREENED, simulated
from dogshape.pipeline.search.level_front import LEVELS
from dogshape.pipeline.search.sampler import PLAN
from dogshape.pipeline.search.search import Search
from dogshape.pipeline.search.state import NOTHING, Findings, measured_record, plan_of
from dogshape.pipeline.simulate.design import (
    MEASURED,
    SIMULATED,
    Design,
    Measured,
    design_of,
    values_of,
)
from dogshape.pipeline.simulate.evaluation import Simulated, evaluate, in_two_levels, screen
from dogshape.pipeline.simulate.executor import Executor
from dogshape.pipeline.simulate.point_plans import is_whole, whole_plan
from dogshape.pipeline.train.training_rows import row_record
from dogshape.sim.errors import InputError

UNKNOWN = "simulation"  #: what a design fails whose shifts say nothing of some objective


def finish(
    search: Search,
    ids: Sequence[int],
    executor: Executor,
    findings: Findings = NOTHING,
    screened: Sequence[Simulated | None] | None = None,
) -> Findings:
    """Simulate the designs among trials that may pass and tell them all in order.

    ``screened`` is what their screen found, where that is over. Give the findings with the trials
    that are left open.
    """
    study = search.study
    trials = [search.optuna._storage.get_trial(trial_id) for trial_id in ids]
    designs = [design_of(study, dict(trial.params)) for trial in trials]
    worth = {k: d.dog for k, d in enumerate(designs) if d.dog is not None and d.feasible}
    seed = study.file.expectation.seed
    own = {k: study.operated(designs[k].params) for k in worth}
    base = study.own_angles if study.two_levels else None
    if screened is None:
        screened = screen(study, [*worth.values()], executor, seed, [*own.values()], base=base)
    screens = dict(zip(worth, screened, strict=True))
    measured = {k: None if one is None else one.measured for k, one in screens.items()}
    judged = {k: design_of(study, designs[k].params, one) for k, one in measured.items()}
    worth = {k: dog for k, dog in worth.items() if judged[k].feasible}
    plans = [plan_of(study, trials[k]) for k in worth]
    operated = [own[k] for k in worth]
    alone = evaluate(study, [*worth.values()], executor, plans, seed, operated=operated)
    evaluated = _with_screens(study, [screens[k] for k in worth], alone, base)
    results = {
        k: replace(result, measured=measured[k] or result.measured)
        for k, result in zip(worth, evaluated, strict=True)
    }
    found = {k: result for k, result in results.items() if result.known}
    noted = [
        _noted(study, t, designs[k], found.get(k), measured.get(k)) for k, t in enumerate(trials)
    ]
    for k, one in screens.items():
        if one is not None and k not in found:
            noted[k].user_attrs[SCREENED] = row_record(one.rows)
    for k in worth.keys() - found.keys():
        noted[k].user_attrs["failed"] = [UNKNOWN]
    try:
        times = _predict(search, findings, [noted[k] for k in found])
    except InputError:  # too few engage to predict anything: all points are simulated
        for trial in trials:
            with suppress(UpdateFinishedTrialError):
                storage = search.optuna._storage
                storage.set_trial_system_attr(trial._trial_id, PLAN, whole_plan(study))
        return finish(search, ids, executor, findings, screened)
    for k, trial in enumerate(noted):
        # A design that failed its screen keeps the compiled engine's values: proposals learn of it.
        one = found.get(k) or screens.get(k)
        known = one is not None and one.known
        estimates = {n: e.value for n, e in one.estimates.items()} if one and known else {}
        if trial.number in times:
            estimates[SIMULATED] = times[trial.number]
        trial.values = values_of(study, designs[k], estimates)
        if k in results and results[k].unfinished:
            findings = findings.with_left_open(trial)
        else:
            _tell(search, trials[k], trial)
    return findings


def _with_screens(
    study: Setup,
    screens: Sequence[Simulated | None],
    evaluated: Sequence[Simulated],
    base: int | None,
) -> Sequence[Simulated]:
    """Put the shifts of both engines together in two levels; in one level they stay apart."""
    if base is None:
        return evaluated
    passed = [one for one in screens if one is not None]
    return in_two_levels(study, passed, evaluated, study.file.expectation.seed, base)


def _noted(
    study: Setup,
    trial: FrozenTrial,
    design: Design,
    found: Simulated | None,
    screened: Measured | None,
) -> FrozenTrial:
    """Copy a trial as finished, with what the simulation of its design gave."""
    measured = screened if found is None else found.measured
    landed = design if measured is None else design_of(study, design.params, measured)
    noted = copy(trial)
    noted.state = TrialState.COMPLETE
    noted.user_attrs = {**trial.user_attrs, **(attributes_of(found) if found else {})}
    if measured is not None:
        noted.user_attrs[MEASURED] = measured_record(measured)
    noted.system_attrs = dict(trial.system_attrs)
    for name, value in landed.constraints.items():
        if name not in trial.constraints:  # a round that was cut off told the same
            noted.set_constraint(name, value)
    if landed.failed:
        noted.user_attrs["failed"] = landed.failed
    return noted


def attributes_of(found: Simulated) -> dict[str, Any]:
    """Record the simulation of a design as attributes of its trial."""
    estimates = found.estimates.items()
    both = {} if found.levels is None else {LEVELS: found.levels.record}
    return {
        **both,
        "standard_error_s": found.expectation.standard_error,
        "simulated": {name: e.value for name, e in estimates},
        "standard_errors": {name: e.standard_error for name, e in estimates},
        MEASURED: measured_record(found.measured),
        "rows": row_record(found.rows),
    }


def _predict(search: Search, findings: Findings, trials: Sequence[FrozenTrial]) -> dict[int, float]:
    """Predict and note the expected times, s, by number, of trials that lack operating points.

    ``trials`` are all that were simulated of the round. The times follow from those and all
    before.
    """
    lacking = {trial.number for trial in trials if not is_whole(plan_of(search.study, trial))}
    if not lacking or search.guide is None:
        return {}
    # A round that was cut off while it was told is predicted from the same again.
    before = [trial for trial in search.trials(findings) if simulated(trial)]
    known = {trial.number: trial for trial in [*before, *trials]}
    together = [known[number] for number in sorted(known)]
    times, errors = search.guide.times(together)
    found = {}
    for trial, time, error in zip(together, times.tolist(), errors.tolist(), strict=True):
        if trial.number in lacking:
            found[trial.number] = time
            known_so_far = trial.user_attrs
            trial.user_attrs |= {
                "standard_error_s": error,
                "simulated": {**known_so_far["simulated"], SIMULATED: time},
                "standard_errors": {**known_so_far["standard_errors"], SIMULATED: error},
            }
    return found


def _tell(search: Search, given: FrozenTrial, noted: FrozenTrial) -> None:
    """Write what is new of a trial into the storage and end it there."""
    trial = optuna.Trial(search.optuna, given._trial_id)
    # A run that seemed dead may have told it meanwhile: it found the same.
    with suppress(UpdateFinishedTrialError):
        for name, value in noted.constraints.items():
            if name not in given.constraints:
                trial.set_constraint(name, value)
        for name, value in noted.user_attrs.items():
            if name not in given.user_attrs or given.user_attrs[name] != value:
                trial.set_user_attr(name, value)
        search.optuna.tell(trial, noted.values, skip_if_finished=True)
