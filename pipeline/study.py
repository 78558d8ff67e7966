"""A whole study: search, confirmation at new angles, audit in Drake, surrogate, report."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import chain
from typing import Any

from dogshape.pipeline.config.study_file import Setup, require_variables, wear_of
from dogshape.pipeline.progress import SILENT, Progress, Say, WorkCounter
from dogshape.pipeline.record import number_or_none
from dogshape.pipeline.reports.study_page import publish
from dogshape.pipeline.search.confirmation import (
    Executors,
    confirm,
    confirm_nearest,
    shifts_to_confirm,
)
from dogshape.pipeline.search.engine_audit import audit
from dogshape.pipeline.search.search import Search, open_search, run
from dogshape.pipeline.search.state import SearchState, Trial, expectation_from
from dogshape.pipeline.search.study_record import (
    Confirmation,
    ConfirmedDesign,
    DesignRow,
    StudyRecord,
)
from dogshape.pipeline.simulate.design import (
    ENGAGEMENT,
    OBJECTIVES,
    SIMULATED,
    Design,
    leading_objective,
    limits_of,
    objectives_of,
)
from dogshape.pipeline.simulate.evaluation import STAGES, LifeStage, failures, life_of
from dogshape.pipeline.simulate.executor import Executor, connect
from dogshape.pipeline.simulate.tolerance_time import tolerance_time
from dogshape.pipeline.store.folder import ShiftJournal, StudyFolder, write_json
from dogshape.pipeline.store.folder_lock import lock_folder
from dogshape.pipeline.store.result_records import EngineAgreement, HangPriorRow, hang_keys
from dogshape.pipeline.store.trial_storage import guard_storage, open_storage
from dogshape.pipeline.train.training import train
from dogshape.pipeline.train.training_rows import study_mix
from dogshape.sim.errors import EngineError, GeometryError, InputError
from dogshape.sim.interface import argument
from dogshape.sim.statistics.expectation import Estimate
from dogshape.sim.strength.checks import smallest_margin
from dogshape.sim.versions import versions
from dogshape.surrogate.model import MIN_DESIGNS

MISSING_SIMULATION = "simulation"  #: failed check of a design without estimates


@dataclass(frozen=True)
class StudyOptions:
    """Folder, workers and storage of a study."""

    folder: StudyFolder
    jobs: int = 0  #: worker processes, 0 for one a core or the cluster's workers
    storage: str | None = None  #: address of a database that runs share
    resume: bool = False
    cluster: str | None = None  #: address of a Dask scheduler
    report: bool = True
    progress: Progress = SILENT


def run_study(study: Setup, options: StudyOptions) -> StudyRecord:
    """Run or resume a study, write its result to ``result.json`` and return it.

    Raises EngineError where both engines do not agree, after result and report are written.
    """
    # Refuse an unknown objective or limit, and a study without variables, before any work.
    objectives_of(study)
    limits_of(study)
    require_variables(study)
    folder = options.folder
    say = options.progress.say
    if options.storage is not None:
        open_storage(folder, options.storage)  # refuse a wrong address before anything is written
    connect(options.cluster)
    with lock_folder(folder.root):
        folder.open(study, options.resume)
        with guard_storage(options.storage, folder):
            search = open_search(study.search_setup, folder, options.storage, options.resume)
            if search.sampler.refusal:
                say(search.sampler.refusal)
            result = _search_and_confirm(search, options)
        if result.n_simulated_designs >= MIN_DESIGNS:
            result = _learn(study, folder, result, say=say)
        else:
            say(f"no surrogate: it needs at least {MIN_DESIGNS} simulated designs")
        write_json(folder.result, result.to_dict())
        if options.report:
            publish(folder, say)
    if result.audit is not None:
        require_agreement(study, result.audit)
    return result


def require_agreement(study: Setup, agreement: EngineAgreement) -> None:
    """Raise EngineError where the audit of a study finds that its engines do not agree."""
    if not agreement.agrees:
        raise EngineError(
            f"the compiled engine and Drake do not agree in the study {study.name}: "
            f"{agreement.text}; its result is not valid: give solver.engine = "
            '"drake" to simulate all of it in Drake'
        )


def _search_and_confirm(search: Search, options: StudyOptions) -> StudyRecord:
    """Run a search to its end, confirm its front and audit it."""
    folder = options.folder
    study = search.study
    settings = study.file.search
    search_journal = ShiftJournal(folder.running)  # of compiled shifts, dropped after their use
    kept_journal = ShiftJournal(folder.shifts)  # of Drake's shifts
    resumption = f"{folder.root}; {argument('resume', value=True)} goes on"
    max_shifts = _max_remaining_shifts(search)
    with WorkCounter(options.progress, max_shifts, at_most=True, resumption=resumption) as counter:
        counter.say(
            f"at most {max_shifts} shifts: {settings.trials} designs at "
            f"{len(study.points)} operating points, then prototype and up to "
            f"{settings.confirm_designs} of the front at new angles"
        )

        def after_round(line: str, state: SearchState) -> None:
            counter.expect_more(_max_remaining_shifts(search))
            counter.say(line)
            write_json(folder.result, study_record(state, kept_journal).to_dict())

        executors = Executors(
            Executor(search_journal, options.jobs, counter.advance, options.cluster),
            Executor(kept_journal, options.jobs, counter.advance, options.cluster),
        )
        searched_state = run(search, executors.search, after_round)
        confirmation, confirmed_state = confirm(searched_state, executors, counter.say)
        nearest = None
        remaining_gain = None
        if confirmation is None:  # no design passes
            nearest = confirm_nearest(searched_state, executors, counter.say)
        else:
            remaining_gain = search.predict_remaining_gain(confirmation.chosen)
        life = _life(confirmation, confirmed_state, executors.search, counter)
        designs = [trial.params for trial in searched_state.simulated]
        agreement = audit(study, designs, executors.kept, settings.audit_shifts, counter.say)
        for journal in (search_journal, kept_journal):
            journal.say_unfinished(counter.say)
        executors.search.drop_shifts()
    if search.sharing is not None:
        searched_state = search.read()  # with the trials of all runs that share the search
    _write_rows(folder, searched_state, confirmed_state)
    changes = {"life": life, "audit": agreement, "remaining_gain": remaining_gain}
    result = study_record(searched_state, kept_journal).model_copy(update=changes)
    return _with_confirmation(result, confirmed_state, confirmation, nearest)


def _write_rows(
    folder: StudyFolder, searched_state: SearchState, confirmed_state: SearchState
) -> None:
    """Write the surrogate's data; a confirmed design has rows of its new angles too."""
    confirmed_trials = [trial for trial in confirmed_state.trials if trial.confirmed]
    trials = searched_state.renew(confirmed_trials).simulated
    write_json(folder.rows, {"rows": list(chain(*(trial.rows for trial in trials)))})


def _with_confirmation(
    result: StudyRecord,
    state: SearchState,
    confirmation: Confirmation | None,
    nearest: Sequence[ConfirmedDesign] | None,
) -> StudyRecord:
    """Add the confirmation of a front to the record of a search, or the designs nearest to passing.

    ``state`` has the trials at the new angles.
    """
    changes: dict[str, Any] = {"confirmation": confirmation}
    shift_count = result.n_simulated_shifts
    if confirmation is not None:
        rows = {trial.number: design_row(state, trial) for trial in state.trials if trial.confirmed}
        changes |= {
            "best": rows[confirmation.chosen],
            "front": [rows[trial.number] for trial in state.front if trial.confirmed],
        }
        shift_count += _confirmation_shifts(confirmation, rows)
    if nearest is not None:
        changes |= {"nearest": nearest}
        shift_count += sum(design.shifts or 0 for design in nearest)
    return result.model_copy(update={**changes, "n_simulated_shifts": shift_count})


def _confirmation_shifts(confirmation: Confirmation, rows: Mapping[int, DesignRow]) -> int:
    """Count the shifts of a confirmation in both engines; ``rows`` are designs by trial number."""
    designs = list(confirmation.designs)
    trials = [design.trial for design in designs]
    has_prototype = any(row.prototype for number, row in rows.items() if number in trials)
    if not has_prototype:
        designs.append(confirmation.prototype)
    total = 0
    for design in designs:
        total += design.shifts or 0
        if design.drake is not None:
            total += design.drake.shifts
    return total


def _max_remaining_shifts(search: Search) -> int:
    """Count the shifts that the remaining part of a study takes at most."""
    study = search.study
    remaining_trials = max(0, study.file.search.trials - len(search.read().trials))
    design_shifts = len(study.points) * study.file.expectation.angles
    life_stages = 0 if study.file.wear is None else len(STAGES)
    audit_shifts = 0
    if study.reference_setup is not None:
        audit_shifts = 2 * study.file.search.audit_shifts  # in both engines
    search_shifts = (remaining_trials + life_stages) * design_shifts
    return search_shifts + shifts_to_confirm(study) + audit_shifts


def _life(
    confirmation: Confirmation | None,
    state: SearchState,
    executor: Executor,
    counter: WorkCounter,
) -> list[LifeStage] | None:
    """Simulate the chosen design over its life; None where the study has no wear."""
    study = state.study
    wear = wear_of(study.file)
    if wear is None or confirmation is None:
        return None
    trial = next(trial for trial in state.trials if trial.number == confirmation.chosen)
    counter.say(f"design {trial.number} over its life: half worn and worn")
    try:
        return life_of(study, trial.params, wear, executor=executor, priors=state.priors)
    except GeometryError as error:
        counter.say(f"no drift over the life: the worn dog is impossible: {error}")
        return None


def _learn(study: Setup, folder: StudyFolder, result: StudyRecord, say: Say) -> StudyRecord:
    """Fit the surrogate; add its validation and times within tolerances to the result."""
    try:
        stored = train(folder, say=say)
    except InputError as error:
        say(f"no surrogate: {error}")
        return result
    mix = study_mix(study)

    def within_tolerances(design: DesignRow) -> DesignRow:
        params = design.params(study.variables)
        time = tolerance_time(study, stored.surrogate, params, mix)
        return design.model_copy(update={"time_within_tolerances": time})

    return result.model_copy(
        update={
            "surrogate": stored.validation,
            "trials": [within_tolerances(design) for design in result.trials],
            "front": [within_tolerances(design) for design in result.front],
            "best": result.best and within_tolerances(result.best),
        }
    )


def study_record(state: SearchState, journal: ShiftJournal) -> StudyRecord:
    """Record the state of a search; ``journal`` has Drake's shifts, of which failed ones count."""
    study = state.study
    best = state.best
    rows = {trial.number: design_row(state, trial) for trial in state.trials}
    failed_shifts = Counter[str]()
    for trial in state.trials:
        failed_shifts += Counter(trial.failed)
    failed_shifts += Counter(failures(journal.rows.values()))
    return StudyRecord(
        study=study.name,
        engine=study.clutch.solver.engine,
        objectives=list(study.file.search.objectives),
        leading=leading_objective(study).name,
        quantile=study.file.search.quantile,
        best=rows[best.number] if best is not None else None,
        front=[rows[trial.number] for trial in state.front],
        trials=list(rows.values()),
        n_simulated_designs=len(state.simulated),
        n_simulated_shifts=sum(trial.shifts for trial in state.simulated),
        failed_shifts=dict(failed_shifts),
        hang_prior=[HangPriorRow(**vars(prior)) for prior in state.priors],
        confirmation=None,
        nearest=None,
        remaining_gain=None,
        life=None,
        audit=None,
        surrogate=None,
        versions=versions(),
        config_hash=study.config_hash,
        physics_hash=study.physics_hash,
    )


def design_row(state: SearchState, trial: Trial) -> DesignRow:
    """Record a design of a search; times are None if too few shifts engage."""
    study = state.study
    design = state.designs[trial.number]
    enough_engage = ENGAGEMENT.name not in design.failed
    estimates = _estimates(study, trial, has_times=enough_engage)
    values: dict[str, float | None] = dict.fromkeys(estimates)
    errors: dict[str, float | None] = dict.fromkeys(estimates)
    for name, estimate in estimates.items():
        if estimate is not None:
            values[name] = estimate.value
            errors[name] = estimate.standard_error
    weakest = smallest_margin(design.checks) if design.checks else None
    expectation = None
    if trial.times:
        expectation = expectation_from(study, trial.times).replace_priors(state.priors)
    worst_check: str | None = None
    worst_margin: float | None = None
    statistical_check: str | None = None
    statistical_margin: float | None = None
    if design.dog is not None:
        worst_check, worst_margin = design.weakest_within("worst_case")
        statistical_check, statistical_margin = design.weakest_within("root_sum_square")
    failed = _failed_checks(trial, design)
    shape_and_objectives: dict[str, Any] = {**trial.params, **design.exact_values}
    margins_and_estimates: dict[str, Any] = {
        "smallest_margin": weakest.margin if weakest else None,
        "weakest_check": weakest.name if weakest else "geometry",
        "margins": {check.name: check.margin for check in design.checks},
        **values,  # an estimate of the smallest margin replaces the exact one
    }
    return DesignRow(
        trial=trial.number,
        prototype=trial.prototype,
        **shape_and_objectives,
        **margins_and_estimates,
        **hang_keys(expectation).to_dict(),
        standard_errors=errors,
        standard_error_s=errors[SIMULATED],
        points=len(study.points) if trial.simulated else 0,
        shifts=trial.shifts,
        engaged=None if trial.check_inputs is None else trial.check_inputs.engaged,
        feasible=not failed,
        failed=failed,
        margin_worst_case=number_or_none(worst_margin),
        margin_root_sum_square=number_or_none(statistical_margin),
        weakest_check_worst_case=worst_check,
        weakest_check_root_sum_square=statistical_check,
        time_within_tolerances=None,
    )


def _failed_checks(trial: Trial, design: Design) -> list[str]:
    """List the failed checks of a trial; they include ``engines`` and ``simulation``."""
    failed = list(design.failed)
    if not trial.engines_agree:
        failed.append("engines")
    if not failed and not trial.simulated:
        failed.append(MISSING_SIMULATION)
    return failed


def _estimates(study: Setup, trial: Trial, *, has_times: bool) -> dict[str, Estimate | None]:
    """Select the estimates of the simulated objectives by name.

    All are None without a simulation; those of times also unless ``has_times``.
    """
    names = [objective.name for objective in objectives_of(study) if objective.simulated]
    estimates = dict.fromkeys([SIMULATED, *names])
    for name in estimates:
        is_time = OBJECTIVES[name].unit == "s"
        if trial.estimates and (has_times or not is_time):
            estimates[name] = trial.estimates.get(name)
    return estimates
