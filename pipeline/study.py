"""A whole study: search, confirmation at new angles, audit in Drake, surrogate, report."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import chain

from dogshape.pipeline.config.study_file import Setup, require_variables, wear_of
from dogshape.pipeline.progress import SILENT, Progress, Say, WorkCounter
from dogshape.pipeline.reports.designs import Row
from dogshape.pipeline.reports.study_page import publish
from dogshape.pipeline.search.confirmation import (
    Executors,
    audit,
    confirm,
    confirm_nearest,
    shifts_to_confirm,
)
from dogshape.pipeline.search.search import Search, open_search, run
from dogshape.pipeline.search.state import PROTOTYPE, SearchState, Trial, expectation_from
from dogshape.pipeline.simulate.design import (
    ENGAGEMENT,
    OBJECTIVES,
    SIMULATED,
    Design,
    exact_values,
    leading_objective,
    limits_of,
    objectives_of,
    smallest_within,
    tolerance_time,
)
from dogshape.pipeline.simulate.evaluation import STAGES, failures, life_of
from dogshape.pipeline.simulate.executor import Executor, connect
from dogshape.pipeline.store.folder import ShiftJournal, StudyFolder, write_json
from dogshape.pipeline.store.folder_lock import lock_folder
from dogshape.pipeline.store.result_records import EngineAgreement, HangKeys, hang_keys
from dogshape.pipeline.store.trial_storage import guard_storage, open_storage
from dogshape.pipeline.train.training import train
from dogshape.pipeline.train.training_rows import study_mix
from dogshape.sim.errors import EngineError, GeometryError, InputError
from dogshape.sim.statistics.expectation import Estimate
from dogshape.sim.strength.checks import smallest_margin
from dogshape.sim.versions import versions
from dogshape.surrogate.model import MIN_DESIGNS

UNKNOWN = "simulation"  #: failed check of a design without an estimate of some objective


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


def run_study(study: Setup, options: StudyOptions) -> Row:
    """Run or resume a study, and return its result, which is also in ``result.json``.

    EngineError, after result and report are written, where both engines do not agree.
    """
    objectives_of(study)
    limits_of(study)
    require_variables(study)
    folder = options.folder
    say = options.progress.say
    if options.storage is not None:
        open_storage(folder, options.storage)  # refused before anything is written
    connect(options.cluster)
    with lock_folder(folder.root):
        folder.open(study, options.resume)
        with guard_storage(options.storage, folder):
            search = open_search(study.search_setup, folder, options.storage, options.resume)
            if search.sampler.refusal:
                say(search.sampler.refusal)
            result = _search_and_confirm(search, options)
        if result["n_simulated_designs"] >= MIN_DESIGNS:
            _learn(study, folder, result, say=say)
        else:
            say(f"no surrogate: it needs at least {MIN_DESIGNS} simulated designs")
        write_json(folder.result, result)
        if options.report:
            publish(folder, say)
    if result["audit"] is not None:
        require_agreement(study, EngineAgreement(**result["audit"]))
    return result


def require_agreement(study: Setup, agreement: EngineAgreement) -> None:
    """Raise EngineError where the audit of a study finds that its engines do not agree."""
    if not agreement.agrees:
        raise EngineError(
            f"the compiled engine and Drake do not agree in the study {study.name}: "
            f"{agreement.text}; its result does not hold: give solver.engine = "
            '"drake" to simulate all of it in Drake'
        )


def _search_and_confirm(search: Search, options: StudyOptions) -> Row:
    """Run a search to its end, confirm its front and audit it; return the result."""
    folder = options.folder
    study = search.study
    settings = study.file.search
    search_journal = ShiftJournal(folder.running)
    kept_journal = ShiftJournal(folder.shifts)
    resumption = f"{folder.root}; --resume goes on"
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
            write_json(folder.result, collect(state, kept_journal))

        executors = Executors(
            Executor(search_journal, options.jobs, counter.advance, options.cluster),
            Executor(kept_journal, options.jobs, counter.advance, options.cluster),
        )
        searched_state = run(search, executors.search, after_round)
        confirmation, state = confirm(searched_state, executors, counter.say)
        nearest = None
        if confirmation is None:
            nearest = confirm_nearest(searched_state, executors, counter.say)
        life = _life(confirmation, state, executors.search, counter)
        designs = [trial.params for trial in searched_state.simulated]
        agreement = audit(study, designs, executors.kept, settings.audit_shifts, counter.say)
        for journal in (search_journal, kept_journal):
            journal.say_unfinished(counter.say)
        executors.search.forget()
    if search.sharing is not None:
        searched_state = search.read()  # with the trials of all who share the search
    confirmed_state = searched_state.renew(trial for trial in state.trials if trial.confirmed)
    write_json(folder.rows, {"rows": list(chain(*(t.rows for t in confirmed_state.simulated)))})
    result = collect(searched_state, kept_journal)
    if confirmation is not None:
        rows = {trial.number: row_of(state, trial) for trial in state.trials if trial.confirmed}
        result["best"] = rows[confirmation["chosen"]]
        result["front"] = [rows[trial.number] for trial in state.front if trial.confirmed]
        result["n_simulated_shifts"] += _confirmation_shifts(confirmation, rows)
    if nearest is not None:
        result["nearest"] = nearest
        result["n_simulated_shifts"] += sum(design["shifts"] for design in nearest)
    return {
        **result,
        "confirmation": confirmation,
        "life": life,
        "audit": agreement and agreement.to_dict(),
    }


def _confirmation_shifts(confirmation: Row, rows: Mapping[int, Row]) -> int:
    """Count the shifts of a confirmation in both engines; ``rows`` are the trials by number."""
    designs = list(confirmation["designs"])
    has_prototype = any(rows[design["trial"]][PROTOTYPE] for design in designs)
    if not has_prototype:
        designs.append(confirmation["prototype"])
    total = 0
    for design in designs:
        total += design["shifts"]
        if design["drake"]:
            total += design["drake"]["shifts"]
    return total


def _max_remaining_shifts(search: Search) -> int:
    """Count the shifts that the remaining part of a study takes at most."""
    study = search.study
    remaining_trials = max(0, study.file.search.trials - len(search.read().trials))
    design_shifts = len(study.points) * study.file.expectation.angles
    life_stages = 0 if study.file.wear is None else len(STAGES)
    audit_shifts = 0
    if study.reference_setup is not None:
        audit_shifts = 2 * study.file.search.audit_shifts
    search_shifts = (remaining_trials + life_stages) * design_shifts
    return search_shifts + shifts_to_confirm(study) + audit_shifts


def _life(
    confirmation: Row | None, state: SearchState, executor: Executor, counter: WorkCounter
) -> list[Row] | None:
    """Simulate the chosen design over its life; None where the study has no wear."""
    study = state.study
    wear = wear_of(study.file)
    if wear is None or confirmation is None:
        return None
    trial = next(trial for trial in state.trials if trial.number == confirmation["chosen"])
    counter.say(f"design {trial.number} over its life: half worn and worn")
    try:
        stages = life_of(study, trial.params, wear, executor=executor, priors=state.priors)
    except GeometryError as error:
        counter.say(f"no drift over the life: worn dogs are none: {error}")
        return None
    return [stage.to_dict() for stage in stages]


def _learn(study: Setup, folder: StudyFolder, result: Row, say: Say) -> None:
    """Fit the surrogate, and add its validation and times within tolerances to the result."""
    try:
        stored = train(folder, say=say)
    except InputError as error:
        say(f"no surrogate: {error}")
        return
    result["surrogate"] = stored.validation.model_dump()
    for row in filter(None, (*result["trials"], *result["front"], result["best"])):
        time = tolerance_time(study, stored.surrogate, row, study_mix(study))
        row["time_within_tolerances"] = time.to_dict()


def collect(state: SearchState, journal: ShiftJournal) -> Row:
    """Record the state of a search; ``journal`` has the shifts of Drake."""
    study = state.study
    best = state.best
    rows = {trial.number: row_of(state, trial) for trial in state.trials}
    failed_shifts = Counter[str]()
    for trial in state.trials:
        failed_shifts += Counter(trial.failed)
    failed_shifts += Counter(failures(journal.rows.values()))
    return {
        "study": study.name,
        "engine": study.clutch.solver.engine,
        "objectives": study.file.search.objectives,
        "leading": leading_objective(study).name,
        "quantile": study.file.search.quantile,
        "best": rows[best.number] if best is not None else None,
        "front": [rows[trial.number] for trial in state.front],
        "trials": list(rows.values()),
        "n_simulated_designs": len(state.simulated),
        "n_simulated_shifts": sum(trial.shifts for trial in state.simulated),
        "failed_shifts": dict(failed_shifts),
        "hang_prior": [vars(prior) for prior in state.priors],
        **dict.fromkeys(("confirmation", "nearest", "life", "audit", "surrogate")),
        "versions": versions(),
        "config_hash": study.config_hash,
        "physics_hash": study.physics_hash,
    }


def row_of(state: SearchState, trial: Trial) -> Row:
    """Record a design as a flat row, without times where it engages too seldom to have one."""
    study = state.study
    design = state.designs[trial.number]
    estimates = _estimates(study, trial, has_times=ENGAGEMENT.name not in design.failed)
    values: dict[str, float | None] = dict.fromkeys(estimates)
    errors: dict[str, float | None] = dict.fromkeys(estimates)
    for name, estimate in estimates.items():
        if estimate is not None:
            values[name] = estimate.value
            errors[name] = estimate.standard_error
    weakest = smallest_margin(design.checks) if design.checks else None
    hang_values = dict.fromkeys(HangKeys.model_fields)
    if trial.times:
        hang_values = hang_keys(expectation_from(study, trial.times).under(state.priors))
    failed = _failed_checks(trial, design)
    return {
        "trial": trial.number,
        PROTOTYPE: trial.prototype,
        **trial.params,
        **exact_values(study, design),
        "smallest_margin": weakest.margin if weakest else None,
        "weakest_check": weakest.name if weakest else "geometry",
        "margins": {check.name: check.margin for check in design.checks},
        **values,
        **hang_values,
        "standard_errors": errors,
        "standard_error_s": errors[SIMULATED],
        "points": len(study.points) if trial.simulated else 0,
        "shifts": trial.shifts,
        "engaged": None if trial.measured is None else trial.measured.engaged,
        "feasible": not failed,
        "failed": failed,
        **smallest_within(study, design),
        "time_within_tolerances": None,
    }


def _failed_checks(trial: Trial, design: Design) -> list[str]:
    """List the failed checks of a trial, with the agreement of engines and its simulation."""
    failed = list(design.failed)
    if not trial.judged:
        failed.append("engines")
    if not failed and not trial.simulated:
        failed.append(UNKNOWN)
    return failed


def _estimates(study: Setup, trial: Trial, *, has_times: bool) -> dict[str, Estimate | None]:
    """Return the estimates of the simulated objectives by name; without times if not."""
    names = [objective.name for objective in objectives_of(study) if objective.simulated]
    estimates = dict.fromkeys([SIMULATED, *names])
    for name in estimates:
        is_time = OBJECTIVES[name].unit == "s"
        if trial.estimates and (has_times or not is_time):
            estimates[name] = trial.estimates.get(name)
    return estimates
