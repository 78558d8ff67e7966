"""A whole study: search, confirmation at new angles, surrogate, report."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass
from typing import Any

from optuna.trial import FrozenTrial

from dogshape.pipeline.config.study_file import Setup, require_variables, wear_of
from dogshape.pipeline.progress import SILENT, Progress, WorkCounter
from dogshape.pipeline.reports.study_page import publish
from dogshape.pipeline.search.confirmation import confirm
from dogshape.pipeline.search.dog_guide import DogGuide, distinct, simulated
from dogshape.pipeline.search.front_uncertainty import standings
from dogshape.pipeline.search.repair import repair
from dogshape.pipeline.search.rounds import SamplerOf, run
from dogshape.pipeline.search.samplers import sampler_factory
from dogshape.pipeline.search.search import Search, open_search
from dogshape.pipeline.search.state import (
    SearchState,
    compiled_of,
    compiled_shifts,
    confirmed,
    measured_of,
)
from dogshape.pipeline.search.tolerance_effects import smallest_within, spread_record, time_spread
from dogshape.pipeline.search.trials import UNKNOWN
from dogshape.pipeline.simulate.design import (
    ENGAGEMENT,
    SIMULATED,
    Design,
    exact_errors,
    exact_values,
    is_time,
    leading,
    limits_of,
    objectives_of,
)
from dogshape.pipeline.simulate.executor import Executor, connect
from dogshape.pipeline.simulate.level_times import require_levels
from dogshape.pipeline.simulate.life import STAGES, life_of
from dogshape.pipeline.simulate.point_plans import most_to_confirm, most_to_search
from dogshape.pipeline.store.folder import StudyFolder, write_json
from dogshape.pipeline.store.journal import ShiftJournal
from dogshape.pipeline.store.trial_storage import kept
from dogshape.pipeline.train.training import Say, train
from dogshape.pipeline.train.training_rows import study_mix
from dogshape.sim.errors import GeometryError, InputError
from dogshape.sim.shift.conclusion import Outcome
from dogshape.sim.strength.checks import smallest_margin
from dogshape.sim.versions import versions
from dogshape.surrogate.model import MIN_DESIGNS


@dataclass(frozen=True)
class Run:
    """Where and how a study is run; ``jobs`` 0 is one for each core, or the cluster's workers.

    Without ``report`` it ends with its result. ``progress`` is told how far it is.
    """

    folder: StudyFolder
    jobs: int = 0
    storage: str | None = None
    resume: bool = False
    cluster: str | None = None
    report: bool = True
    progress: Progress = SILENT


def run_study(study: Setup, how: Run) -> dict[str, Any]:
    """Run or resume a study; give its result, which is also in ``result.json``."""
    objectives_of(study)
    limits_of(study)
    require_variables(study)
    require_levels(study)
    guide = DogGuide(study)
    sampler_of = sampler_factory(study, guide)
    folder = how.folder
    connect(how.cluster)
    with folder.writing():
        folder.open(study, how.resume)
        search = open_search(study, folder, how.storage, how.resume, guide=guide)
        with closing(search.claims), kept(how.storage, folder):
            result, say = _searched(search, sampler_of, how)
        if result["n_simulated_designs"] >= MIN_DESIGNS:
            _learn(study, folder, result, say)
        else:
            say(f"no surrogate: it needs at least {MIN_DESIGNS} simulated designs")
        write_json(folder.result, result)
        if how.report:
            publish(folder, say)
    return result


def _searched(search: Search, sampler_of: SamplerOf, how: Run) -> tuple[dict[str, Any], Say]:
    """Run a search to its end and confirm its front.

    Give the result and how to say more.
    """
    folder, journal = how.folder, ShiftJournal(how.folder.shifts)
    most, words = _most(search)
    with WorkCounter(how.progress, most, most=True) as progress:
        progress.say(words)
        if (angles := search.study.file.search.screen_angles) is not None:
            progress.say(
                f"before Drake each design is screened by the compiled engine, {angles} angles at "
                "every operating point"
            )
        if outside := _outside(search.study):
            progress.say(f"the study's own dog is not among the designs searched: {outside}")

        def after_round(line: str, state: SearchState) -> None:
            progress.rest(_most(search)[0])
            progress.say(line)
            write_json(folder.result, collect(state, journal))

        executor = Executor(journal, how.jobs, progress.advance, how.cluster, progress.known)
        with progress.kept_in(folder.root, "--resume goes on"):
            findings = repair(search, executor, progress.say)
            searched = run(search, sampler_of, executor, after_round, findings)
            confirmation, state = _confirm(searched, executor, progress)
            life = _life(confirmation, state, executor, progress)
    if state.shared:
        searched = search.read(searched.findings)  # with what the others told meanwhile
    study = search.study
    if state.shared or study.searches_operation or study.two_levels:  # its shifts do not say it
        write_json(folder.others, {"rows": searched.rows})
    result = collect(searched, journal)
    if confirmation is not None:
        result |= _of_new_angles(state, confirmation["chosen"])
    return {**result, "confirmation": confirmation, "life": life}, progress.say


def _outside(study: Setup) -> str:
    """List the keys of the study's own dog that lie outside its search ranges."""
    return ", ".join(
        f"{name} is {study.prototype[name]:g}, the range {low:g} to {high:g}"
        for name, (low, high) in study.variables.items()
        if not low <= study.prototype[name] <= high
    )


def _of_new_angles(state: SearchState, chosen: int) -> dict[str, Any]:
    """Record the chosen design and the front by the values of their confirmation."""
    rows = rows_of(state)
    front = [rows[trial.number] for trial in state.front if confirmed(trial)]
    return {"best": rows[chosen], "front": front}


def _life(
    confirmation: dict[str, Any] | None,
    state: SearchState,
    executor: Executor,
    progress: WorkCounter,
) -> list[dict[str, Any]] | None:
    """Simulate the chosen design over its life; None where the study has no wear."""
    study = state.study
    wear = wear_of(study.file)
    if wear is None or confirmation is None:
        return None
    trial = next(t for t in state.trials if t.number == confirmation["chosen"])
    each = len(study.points) * study.file.search.confirm_angles
    progress.rest((len(STAGES) - 1) * each)
    progress.say(f"design {trial.number} over its life: half worn and worn")
    try:
        return life_of(study, dict(trial.params), wear, executor)
    except GeometryError as error:
        progress.say(f"no drift over the life: worn dogs are none: {error}")
        return None


def _learn(
    study: Setup, folder: StudyFolder, result: dict[str, Any], say: Callable[[str], None]
) -> None:
    """Fit the surrogate and add what it says to the result; say why where it cannot be."""
    try:
        stored = train(folder, say=say)
    except InputError as error:
        say(f"no surrogate: {error}")
        return
    result["surrogate"] = stored.validation.as_dict()
    of_new_angles = [*result["front"], *([result["best"]] if result["best"] else [])]
    for row in [*result["trials"], *of_new_angles]:
        spread = time_spread(study, stored.surrogate, row, study_mix(study))
        row["time_within_tolerances"] = spread_record(spread)


def _most(search: Search) -> tuple[int, str]:
    """Count the shifts that the rest of a study takes at most, and describe them."""
    study, settings = search.study, search.study.file.search
    trials = search.trials()
    left = max(0, settings.trials - len(trials))
    partial = search.guide is not None and search.guide.partial
    new = not any(trial.user_attrs.get("prototype") for trial in trials)
    confirm = settings.confirm_designs
    most = most_to_search(study, left, partial, left > 0 and new) + most_to_confirm(study, confirm)
    points = f"{settings.points} of {len(study.points)}" if partial else f"all {len(study.points)}"
    if study.two_levels:
        points += f" (Drake at {settings.pair_angles} of {settings.screen_angles} angles of each)"
    return most, (
        f"at most {most} shifts: {left} designs at {points} operating points, then prototype and "
        f"up to {confirm} of the front at all of them to confirm"
    )


def collect(state: SearchState, journal: ShiftJournal) -> dict[str, Any]:
    """Record the state of a search."""
    study, best, rows = state.study, state.best, rows_of(state)
    return {
        "study": study.name,
        "engine": study.clutch.solver.engine,
        "objectives": study.file.search.objectives,
        "maximised": [o.name for o in objectives_of(study) if o.maximise],
        "leading": leading(study).name,
        "quantile": study.file.search.quantile,
        "best": rows[best.number] if best is not None else None,
        "front": [rows[trial.number] for trial in state.front],
        "trials": list(rows.values()),
        "n_simulated_designs": len(distinct(state.simulated)),
        "n_simulated_shifts": state.shifts(journal.finished),
        **_compiled(study, {"n_compiled_shifts": compiled_shifts(study, state.trials)}),
        "failed_shifts": failed_shifts(journal),
        "confirmation": None,
        "life": None,
        "surrogate": None,
        "versions": versions(),
        "config_hash": study.config_hash,
        "physics_hash": study.physics_hash,
    }


def failed_shifts(journal: ShiftJournal) -> dict[str, int]:
    """Count the failed shifts of a journal, by the reason; they have no time."""
    failed = [row for row in journal.rows.values() if row["outcome"] == Outcome.DIVERGED.value]
    reasons = (str(row.get("reason", Outcome.DIVERGED.message)) for row in failed)
    return dict(Counter(reason.partition(", at ")[0] for reason in reasons))


def rows_of(state: SearchState) -> dict[int, dict[str, Any]]:
    """Record every design of a state as a row, by trial, feasible ones with their standing."""
    rows = {trial.number: row_of(state, trial) for trial in state.trials}
    for number, standing in standings(state).items():
        rows[number] |= {
            "low": standing.low,
            "high": standing.high,
            "probability_on_front": standing.probability,
        }
    return rows


def row_of(state: SearchState, trial: FrozenTrial) -> dict[str, Any]:
    """Record a design as a flat row.

    Times are None where it was not simulated, or engages too seldom to have one.
    """
    study = state.study
    design = state.design(trial)
    told, measured = simulated(trial), measured_of(study, trial)
    names = dict.fromkeys([SIMULATED, *(o.name for o in objectives_of(study) if o.simulated)])
    silent = {name for name in names if ENGAGEMENT.name in design.failed and is_time(name)}
    found = {
        name: state.value(trial, name) if told and name not in silent else (None, None)
        for name in names
    }
    exact = exact_values(study, design)
    return {
        "trial": trial.number,
        "prototype": bool(trial.user_attrs.get("prototype", False)),
        **trial.params,
        **exact,
        **_margins(design),
        **{name: value for name, (value, _) in found.items()},
        "standard_errors": {
            **{name: error for name, (_, error) in found.items()},
            **exact_errors(study, exact),
        },
        "standard_error_s": found[SIMULATED][1],
        "points": len(trial.user_attrs["rows"]) if told else 0,
        "shifts": sum(state.plan(trial)) if told else 0,
        **_compiled(study, {"compiled_shifts": compiled_of(study, trial)}),
        "engaged": None if measured is None else measured.engaged,
        "feasible": design.feasible and told,
        "failed": design.failed or ([] if told else [UNKNOWN]),
        **smallest_within(study, design),
        "time_within_tolerances": None,
    }


def _compiled(study: Setup, counted: dict[str, int]) -> dict[str, int]:
    """Return counts of compiled shifts for a study in two levels, nothing for another."""
    return counted if study.two_levels else {}


def _margins(design: Design) -> dict[str, Any]:
    if not design.checks:
        return {"smallest_margin": None, "weakest_check": "geometry", "margins": {}}
    weakest = smallest_margin(design.checks)
    return {
        "smallest_margin": weakest.margin,
        "weakest_check": weakest.name,
        "margins": {c.name: c.margin for c in design.checks},
    }


def _confirm(
    state: SearchState, executor: Executor, progress: WorkCounter
) -> tuple[dict[str, Any] | None, SearchState]:
    def told(count: int, line: str) -> None:
        progress.rest(most_to_confirm(state.study, count))
        progress.say(line)

    return confirm(state, executor, told)
