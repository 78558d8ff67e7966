"""A whole study: search, confirmation at fresh angles, surrogate, report."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from optuna.trial import FrozenTrial

from pipeline.config import Study, require_variables
from pipeline.design import Design, design_of, exact_values, objectives_of
from pipeline.evaluation import FRESH, Simulated, evaluate
from pipeline.executor import Executor
from pipeline.folder import StudyFolder, write_json
from pipeline.journal import ShiftJournal
from pipeline.progress import ShiftProgress
from pipeline.records import check_record, expectation_record
from pipeline.reporting.publish import publish
from pipeline.rows import study_mix
from pipeline.sampler import sampler_factory
from pipeline.search import Search, best_trial, expected_time, front, open_search, run
from pipeline.tolerances import smallest_within, spread_record, time_spread
from pipeline.training import train
from sim.checks import smallest_margin
from sim.errors import InputError
from sim.versions import versions
from surrogate.model import MIN_DESIGNS


@dataclass(frozen=True)
class Run:
    """Where and how a study is run; ``jobs`` 0 is one for each core."""

    folder: StudyFolder
    jobs: int = 0
    storage: str | None = None
    resume: bool = False


def run_study(study: Study, how: Run) -> dict[str, Any]:
    """Run or resume a study; return its result, which is also in ``result.json``."""
    objectives_of(study)
    require_variables(study)
    sampler_of = sampler_factory(study)
    folder = how.folder
    with folder.writing():
        folder.open(study, how.resume)
        search = open_search(study, folder, how.storage, how.resume)
        journal = ShiftJournal(folder.shifts)
        with ShiftProgress(_shifts(study)) as progress:

            def after_round(line: str) -> None:
                progress.say(line)
                write_json(folder.result, collect(search, journal))

            executor = Executor(journal, how.jobs, progress.advance)
            try:
                run(search, sampler_of, executor, after_round)
                confirmation = _confirm(search, executor, progress)
            except KeyboardInterrupt:
                progress.say(f"finished shifts are kept in {folder.root}; --resume goes on")
                raise
        result = collect(search, journal)
        result["confirmation"] = confirmation
        if result["n_simulated_designs"] > MIN_DESIGNS:
            _learn(study, folder, result, progress.say)
        else:
            progress.say(f"no surrogate: it needs more than {MIN_DESIGNS} simulated designs")
        write_json(folder.result, result)
        publish(folder, progress.say)
    return result


def _learn(
    study: Study, folder: StudyFolder, result: dict[str, Any], say: Callable[[str], None]
) -> None:
    """Fit the surrogate and add what it says to the result; say why where it cannot be."""
    try:
        stored = train(folder, say=say)
    except InputError as error:
        say(f"no surrogate: {error}")
        return
    result["surrogate"] = stored.validation.as_dict()
    for row in result["trials"]:  # best and front are among them
        spread = time_spread(study, stored.surrogate, row, study_mix(study))
        row["time_within_tolerances"] = spread_record(spread)


def _shifts(study: Study) -> int:
    """Return the number of shifts that a study takes at most."""
    search, points = study.file.search, len(study.points)
    return points * (search.trials * study.file.expectation.angles + 2 * search.confirm_angles)


def collect(search: Search, journal: ShiftJournal) -> dict[str, Any]:
    """Return what a search has found so far."""
    study = search.study
    rows = {trial.number: row_of(search, trial) for trial in search.trials}
    best = best_trial(search)
    return {
        "study": study.name,
        "objectives": study.file.search.objectives,
        "best": rows[best.number] if best is not None else None,
        "front": [rows[trial.number] for trial in front(search)],
        "trials": list(rows.values()),
        "n_simulated_designs": len(search.simulated),
        "n_simulated_shifts": len(journal.rows),
        "confirmation": None,
        "surrogate": None,
        "versions": versions(),
        "config_hash": study.config_hash,
        "physics_hash": study.physics_hash,
    }


def row_of(search: Search, trial: FrozenTrial) -> dict[str, Any]:
    """Return a design as a flat row; times are None where it was not simulated."""
    study = search.study
    design = search.design(trial)
    simulated = "standard_error_s" in trial.user_attrs
    return {
        "trial": trial.number,
        "prototype": bool(trial.user_attrs.get("prototype", False)),
        **trial.params,
        **exact_values(study, design),
        "expected_shift_time_s": expected_time(search, trial) if simulated else None,
        "standard_error_s": trial.user_attrs.get("standard_error_s"),
        "engaged": trial.user_attrs.get("engaged"),
        "feasible": design.feasible,
        "failed": design.failed,
        **_margins(design),
        **smallest_within(study, design),
        "time_within_tolerances": None,
    }


def _margins(design: Design) -> dict[str, Any]:
    if not design.checks:
        return {"smallest_margin": None, "weakest_check": "geometry", "margins": {}}
    weakest = smallest_margin(design.checks)
    return {
        "smallest_margin": weakest.margin,
        "weakest_check": weakest.name,
        "margins": {c.name: c.margin for c in design.checks},
    }


def _confirm(search: Search, executor: Executor, progress: ShiftProgress) -> dict[str, Any] | None:
    best = best_trial(search)
    if best is None:
        return None
    progress.say("confirming the best design and the prototype at fresh angles")
    return confirm(search.study, dict(best.params), executor)


def confirm(study: Study, best: dict[str, float], executor: Executor) -> dict[str, Any]:
    """Simulate prototype and best design again at angles that the search did not use."""
    angles = study.file.search.confirm_angles
    seed = study.file.expectation.seed + FRESH
    dogs = [study.clutch.dog, study.dog_with(best)]
    both = evaluate(study, dogs, executor, angles, seed, checked=True)
    prototype, winner = (found.expectation for found in both)
    gain = prototype.mean - winner.mean
    return {
        "angles": angles,
        "prototype": _confirmed(study, study.prototype, both[0]),
        "best": _confirmed(study, best, both[1]),
        "gain_s": gain,
        "gain_standard_error_s": (prototype.standard_error**2 + winner.standard_error**2) ** 0.5,
        "gain_share": gain / prototype.mean,
    }


def _confirmed(study: Study, params: dict[str, float], found: Simulated) -> dict[str, Any]:
    design = design_of(study, params, found.landing)
    return {
        **expectation_record(found.expectation),
        "checks": [check_record(check) for check in design.checks],
    }
