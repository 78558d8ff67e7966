"""One search of a sampler, for ``benchmarks/samplers.py``: what it declares after how many shifts.

This project's sampler runs as in any study. Optuna's are asked and told one design at a time, begin
with the same designs and have one constraint, the largest of all, in the way that each of them
wants it: known before the simulation for all checks but the landing, and told with it. A design
that may not be simulated costs no shift. It is told with the worst time so far, which matters to
no sampler but the one that fits a process to values.
"""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import optuna
from optuna.exceptions import ExperimentalWarning
from optuna.samplers import BaseSampler, GPSampler, NSGAIISampler, QMCSampler, TPESampler

from dogshape.pipeline.config.study_file import Setup, load_study
from dogshape.pipeline.search.dog_guide import DogGuide, search_space
from dogshape.pipeline.search.rounds import run
from dogshape.pipeline.search.sampler import SurrogateSampler
from dogshape.pipeline.search.samplers import sampler_factory
from dogshape.pipeline.search.search import open_search
from dogshape.pipeline.search.state import SearchState
from dogshape.pipeline.simulate.design import SIMULATED, design_of, values_of
from dogshape.pipeline.simulate.evaluation import evaluate
from dogshape.pipeline.simulate.executor import Executor
from dogshape.pipeline.simulate.point_plans import whole_plan
from dogshape.pipeline.store.folder import StudyFolder
from dogshape.pipeline.store.journal import ShiftJournal
from dogshape.surrogate.hypervolume import not_dominated

START = 10  #: designs that every sampler begins with, the prototype among them
POINTS = 3  #: operating points of six that this project's sampler simulates of a design
MOST_ASKED = 4000  #: proposals after which a sampler of Optuna's gives up: most may be forbidden
MOST_CPU = 400.0  #: s of a processor after which it gives up too
PROBLEM = (
    "operating.mismatch_rpm=[10, 50, 149]",
    "operating.force_N=[235.2, 641.5]",
    "expectation.angles=4",
    "search.use_known=false",
    f"search.startup={START}",
)

Values = dict[str, float]
SAMPLERS: dict[str, Callable[[int], BaseSampler]] = {
    "TPE": lambda seed: TPESampler(seed=seed, n_startup_trials=START),
    "NSGA-II": lambda seed: NSGAIISampler(seed=seed, population_size=START),
    "GPSampler": lambda seed: GPSampler(seed=seed, n_startup_trials=START),
    "quasi-random": lambda seed: QMCSampler(seed=seed, scramble=True),
}
OWN = {"own, 3 of 6 points": POINTS, "own, all points": None}  #: by points of a design
COMPILED = "own, Drake judges"  #: searched by the compiled engine, its front simulated by Drake
MANY = 64  #: angles at each operating point of that search


@dataclass(frozen=True)
class Step:
    """The front that a search declares after so many shifts and s of one processor."""

    shifts: int
    cpu: float
    designs: int
    front: list[Values]


@dataclass
class Record:
    """What a search did, step by step; ``asked`` counts the forbidden proposals too."""

    asked: int = 0
    steps: list[Step] = field(default_factory=list)


def problem(*overrides: str) -> Setup:
    """Return the study that all samplers search."""
    return load_study("mq200_paper", [*PROBLEM, *overrides])


def search(sampler: str, seed: int, designs: int) -> Record:
    """Run a search with the shifts that ``designs`` whole designs cost."""
    optuna.logging.set_verbosity(optuna.logging.ERROR)
    with warnings.catch_warnings(), TemporaryDirectory() as folder:
        warnings.simplefilter("ignore", ExperimentalWarning)
        if sampler in OWN:
            return _own(Path(folder), OWN[sampler], seed, designs)
        if sampler == COMPILED:
            return _judged(Path(folder), seed, designs)
        executor = Executor(ShiftJournal(Path(folder) / "shifts.jsonl"), 1)
        return _asked_and_told(SAMPLERS[sampler](seed), executor, problem(), seed, designs)


def first_designs(study: Setup, seed: int) -> list[Values]:
    """Return the designs that a search of this project begins with."""
    asked = optuna.create_study(
        directions=["minimize"] * 2, sampler=SurrogateSampler(DogGuide(study), seed, START)
    )
    asked.enqueue_trial(study.prototype)
    return [dict(asked.ask(search_space(study)).params) for _ in range(START)]


def _own(folder: Path, points: int | None, seed: int, designs: int) -> Record:
    whole = problem()
    part = points or len(whole.points)
    trials = designs * len(whole.points) // part
    study = problem(f"search.points={part}", f"search.trials={trials}", f"search.seed={seed}")
    guide = DogGuide(study)
    root = StudyFolder(folder)
    journal = ShiftJournal(root.shifts)
    opened = open_search(study, root, None, False, guide=guide)
    record, begun = Record(trials), time.process_time()

    def after_round(_: str, state: SearchState) -> None:
        declared = [dict(trial.params) for trial in state.front]
        spent = time.process_time() - begun
        record.steps.append(Step(len(journal.rows), spent, len(state.simulated), declared))

    run(opened, sampler_factory(study, guide), Executor(journal, 1), after_round)
    return record


def _judged(folder: Path, seed: int, designs: int) -> Record:
    """Search by the compiled engine alone; Drake then simulates designs of the front in turn."""
    settings = ("solver.engine=planar", f"expectation.angles={MANY}")
    study = problem(*settings, f"search.trials={designs}", f"search.seed={seed}")
    guide, root = DogGuide(study), StudyFolder(folder)
    opened = open_search(study, root, None, False, guide=guide)
    record, begun = Record(designs), time.process_time()
    compiled = Executor(ShiftJournal(root.compiled), 1)
    run(opened, sampler_factory(study, guide), compiled, lambda _, __: None)
    front = [dict(trial.params) for trial in opened.read().front]
    judge, kept = Executor(ShiftJournal(root.shifts), 1), list[Values]()
    for count, params in enumerate(front, start=1):
        whole = problem()
        plan, dog = whole_plan(whole), whole.dog_with(params)
        (one,) = evaluate(whole, [dog], judge, [plan], whole.file.expectation.seed)
        if design_of(whole, params, one.measured).feasible:
            kept.append(params)
        spent = time.process_time() - begun
        record.steps.append(Step(len(judge.journal.rows), spent, count, [*kept]))
    return record


def _asked_and_told(
    sampler: BaseSampler, executor: Executor, study: Setup, seed: int, designs: int
) -> Record:
    asked = optuna.create_study(directions=["minimize"] * 2, sampler=sampler)
    for params in first_designs(study, seed):
        asked.enqueue_trial(params)
    record, begun = Record(), time.process_time()
    found: list[tuple[Values, list[float]]] = []
    worst = 0.0
    simulated = 0
    budget = designs * sum(whole_plan(study))
    while (
        len(executor.journal.rows) < budget
        and record.asked < MOST_ASKED
        and time.process_time() - begun < MOST_CPU
    ):
        record.asked += 1
        trial = asked.ask(search_space(study))
        design = design_of(study, dict(trial.params))
        times: dict[str, float] = {SIMULATED: worst}
        if design.dog is not None and design.feasible:
            simulated += 1
            (one,) = evaluate(
                study, [design.dog], executor, [whole_plan(study)], study.file.expectation.seed
            )
            times = {name: estimate.value for name, estimate in one.estimates.items()}
            worst = max(worst, times[SIMULATED])
            design = design_of(study, design.params, one.measured)
            if design.feasible:
                found.append((design.params, values_of(study, design, times)))
        # A shape that is impossible has no length either: it is told the prototype's.
        length = values_of(study, design, times)[1]
        told = [times[SIMULATED], length if np.isfinite(length) else study.clutch.dog.travel * 1e3]
        trial.set_constraint("largest", max(design.constraints.values()))
        asked.tell(trial, told)
        if len(executor.journal.rows) > (record.steps[-1].shifts if record.steps else 0):
            spent = time.process_time() - begun
            shifts = len(executor.journal.rows)
            record.steps.append(Step(shifts, spent, simulated, _front(found)))
    return record


def _front(found: Sequence[tuple[Values, list[float]]]) -> list[Values]:
    if not found:
        return []
    kept = not_dominated(np.array([values for _, values in found]))
    return [params for (params, _), keep in zip(found, kept, strict=True) if keep]
