"""A whole study: search, confirmation at new angles, audit in Drake, surrogate, report."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

from dogshape.pipeline.config.study_file import Setup, require_variables, wear_of
from dogshape.pipeline.progress import SILENT, Progress, Say, WorkCounter
from dogshape.pipeline.reports.designs import Row
from dogshape.pipeline.reports.study_page import publish
from dogshape.pipeline.search.confirmation import Executors, audit, confirm, shifts_to_confirm
from dogshape.pipeline.search.search import Search, open_search, run
from dogshape.pipeline.search.state import PROTOTYPE, SearchState, Trial, expectation_from
from dogshape.pipeline.simulate.design import (
    ENGAGEMENT,
    OBJECTIVES,
    SIMULATED,
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
from dogshape.pipeline.store.result_records import EngineAgreement, HangKeys, hang_keys
from dogshape.pipeline.store.trial_storage import guard_storage, open_storage
from dogshape.pipeline.train.training import train
from dogshape.pipeline.train.training_rows import study_mix
from dogshape.sim.errors import EngineError, GeometryError, InputError
from dogshape.sim.files import writing
from dogshape.sim.strength.checks import smallest_margin
from dogshape.sim.versions import versions
from dogshape.surrogate.model import MIN_DESIGNS

UNKNOWN = "simulation"  #: what a design fails whose shifts say nothing of some objective


@dataclass(frozen=True)
class Run:
    """Where and how a study is run; ``jobs`` 0 is one for each core, or the cluster's workers."""

    folder: StudyFolder
    jobs: int = 0
    storage: str | None = None
    resume: bool = False
    cluster: str | None = None
    report: bool = True
    progress: Progress = SILENT


def run_study(study: Setup, how: Run) -> Row:
    """Run or resume a study; give its result, which is also in ``result.json``.

    EngineError, after result and report are written, where both engines do not agree.
    """
    objectives_of(study)
    limits_of(study)
    require_variables(study)
    folder, say = how.folder, how.progress.say
    if how.storage is not None:
        open_storage(folder, how.storage)  # refused before anything is written
    connect(how.cluster)
    with writing(folder.root):
        new = not folder.manifest.exists()
        folder.open(study, how.resume)
        with guard_storage(how.storage, folder):
            try:
                search = open_search(study.search_setup, folder, how.storage, how.resume)
            except InputError:
                if new:  # another study may start there
                    folder.manifest.unlink()
                raise
            result = _searched(search, how)
        if result["n_simulated_designs"] >= MIN_DESIGNS:
            _learn(study, folder, result, say)
        else:
            say(f"no surrogate: it needs at least {MIN_DESIGNS} simulated designs")
        write_json(folder.result, result)
        if how.report:
            publish(folder, say)
    if result["audit"] is not None:
        require_agreement(study, EngineAgreement(**result["audit"]))
    return result


def require_agreement(study: Setup, found: EngineAgreement) -> None:
    """Raise EngineError where the audit of a study finds that its engines do not agree."""
    if not found.agrees:
        raise EngineError(
            f"the compiled engine and Drake do not agree in the study {study.name}: "
            f"{found.text}; its result does not hold: give solver.engine = "
            '"drake" to simulate all of it in Drake'
        )


def _searched(search: Search, how: Run) -> Row:
    """Run a search to its end, confirm its front and audit it; give the result."""
    folder, study, settings = how.folder, search.study, search.study.file.search
    journals = ShiftJournal(folder.running), ShiftJournal(folder.shifts)
    on = f"{folder.root}; --resume goes on"
    with WorkCounter(how.progress, _most(search), most=True, kept=on) as counter:
        counter.say(
            f"at most {_most(search)} shifts: {settings.trials} designs at "
            f"{len(study.points)} operating points, then prototype and up to "
            f"{settings.confirm_designs} of the front at new angles"
        )

        def after_round(line: str, state: SearchState) -> None:
            counter.rest(_most(search))
            counter.say(line)
            write_json(folder.result, collect(state, journals[1]))

        both = (Executor(journal, how.jobs, counter.advance, how.cluster) for journal in journals)
        executors = Executors(*both)
        searched = run(search, executors.search, after_round)
        confirmation, state = confirm(searched, executors, counter.say)
        life = _life(confirmation, state, executors.search, counter)
        designs = [trial.params for trial in searched.simulated]
        audited = audit(study, designs, executors.kept, settings.audit_shifts, counter.say)
        for journal in journals:
            journal.say_unfinished(counter.say)
        executors.search.forget()
    if search.sharing is not None:
        searched = search.read()  # with the trials of all who share the search
    confirmed = searched.renew(trial for trial in state.trials if trial.confirmed)
    write_json(folder.rows, {"rows": [row for trial in confirmed.simulated for row in trial.rows]})
    result = collect(searched, journals[1])
    if confirmation is not None:
        known = {trial.number: row_of(state, trial) for trial in state.trials}
        front = [known[trial.number] for trial in state.front if trial.confirmed]
        result |= {"best": known[confirmation["chosen"]], "front": front}
        every = list(confirmation["designs"])  # the prototype may be none of them
        if not any(known[one["trial"]][PROTOTYPE] for one in every):
            every.append(confirmation["prototype"])
        shifts = (one["shifts"] + (one["drake"] or {"shifts": 0})["shifts"] for one in every)
        result["n_simulated_shifts"] += sum(shifts)
    found = {"confirmation": confirmation, "life": life}
    return {**result, **found, "audit": audited and audited.to_dict()}


def _most(search: Search) -> int:
    """Count the shifts that the rest of a study takes at most."""
    study = search.study
    left = max(0, study.file.search.trials - len(search.read().trials))
    each = len(study.points) * study.file.expectation.angles
    stages = 0 if study.file.wear is None else len(STAGES)
    audited = 0 if study.reference_setup is None else 2 * study.file.search.audit_shifts
    return (left + stages) * each + shifts_to_confirm(study) + audited


def _life(
    confirmation: Row | None, state: SearchState, executor: Executor, counter: WorkCounter
) -> list[Row] | None:
    """Simulate the chosen design over its life; None where the study has no wear."""
    study, wear = state.study, wear_of(state.study.file)
    if wear is None or confirmation is None:
        return None
    trial = next(t for t in state.trials if t.number == confirmation["chosen"])
    counter.say(f"design {trial.number} over its life: half worn and worn")
    try:
        return [row.to_dict() for row in life_of(study, trial.params, wear, executor, state.priors)]
    except GeometryError as error:
        counter.say(f"no drift over the life: worn dogs are none: {error}")
        return None


def _learn(study: Setup, folder: StudyFolder, result: Row, say: Say) -> None:
    """Fit the surrogate and add what it says to the result; say why where it cannot be."""
    try:
        stored = train(folder, say=say)
    except InputError as error:
        say(f"no surrogate: {error}")
        return
    result["surrogate"] = stored.validation.model_dump()
    for row in filter(None, (*result["trials"], *result["front"], result["best"])):
        found = tolerance_time(study, stored.surrogate, row, study_mix(study))
        row["time_within_tolerances"] = found.to_dict()


def collect(state: SearchState, journal: ShiftJournal) -> Row:
    """Record the state of a search; ``journal`` has the shifts that are kept."""
    study, best = state.study, state.best
    rows = {trial.number: row_of(state, trial) for trial in state.trials}
    failed = [Counter(trial.failed) for trial in state.trials]
    failed.append(Counter(failures(journal.rows.values())))
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
        "failed_shifts": dict(sum(failed, Counter[str]())),
        "hang_prior": [vars(prior) for prior in state.priors],
        **dict.fromkeys(("confirmation", "life", "audit", "surrogate")),
        "versions": versions(),
        "config_hash": study.config_hash,
        "physics_hash": study.physics_hash,
    }


def row_of(state: SearchState, trial: Trial) -> Row:
    """Record a design as a flat row, without times where it engages too seldom to have one."""
    study, design = state.study, state.designs[trial.number]
    names = dict.fromkeys([SIMULATED, *(o.name for o in objectives_of(study) if o.simulated)])
    known, late = trial.estimates or {}, ENGAGEMENT.name in design.failed
    found = {n: None if late and OBJECTIVES[n].unit == "s" else known.get(n) for n in names}
    errors = {n: None if one is None else one.standard_error for n, one in found.items()}
    exact, failed = exact_values(study, design), list(design.failed)
    weakest = smallest_margin(design.checks) if design.checks else None
    parts = dict.fromkeys(HangKeys.model_fields)
    if trial.times:
        parts = hang_keys(expectation_from(study, trial.times).under(state.priors))
    if not trial.judged:
        failed.append("engines")
    return {
        "trial": trial.number,
        PROTOTYPE: trial.prototype,
        **trial.params,
        **exact,
        "smallest_margin": weakest.margin if weakest else None,
        "weakest_check": weakest.name if weakest else "geometry",
        "margins": {check.name: check.margin for check in design.checks},
        **{name: None if one is None else one.value for name, one in found.items()},
        **parts,
        "standard_errors": errors,
        "standard_error_s": errors[SIMULATED],
        "points": len(study.points) if trial.simulated else 0,
        "shifts": trial.shifts,
        "engaged": None if trial.measured is None else trial.measured.engaged,
        "feasible": trial.simulated and not failed,
        "failed": failed or ([] if trial.simulated else [UNKNOWN]),
        **smallest_within(study, design),
        "time_within_tolerances": None,
    }
