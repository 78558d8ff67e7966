"""One search of a sampler, for ``benchmarks/samplers.py``: what it declares after how many shifts.

Optuna's samplers are asked and told one design at a time, as one uses Optuna with a simulator:
Drake simulates a design at every operating point. They begin with the same designs as this
project's and have one constraint, the largest of all, told in the way that each of them wants it.
A design that a closed form forbids costs no shift; its constraint says so, and its time is the
worst so far, which these samplers do not read.

``GPSampler`` would read it, refits at each proposal, and proposes forbidden designs nearly always.
So it proposes among allowed designs only (``AllowedGP``): it is given the closed forms, and spends
its shifts. Its constraint is the landing, the one that a simulation has to tell.

This project's search is that of a study with ``search.levels = 2`` and a pair of shifts at each
operating point.
"""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import optuna
from optuna.exceptions import ExperimentalWarning
from optuna.samplers import BaseSampler, GPSampler, NSGAIISampler, QMCSampler, TPESampler

from dogshape.pipeline.config.study_file import Setup, load_study
from dogshape.pipeline.search.dog_guide import LANDING, DogGuide, search_space
from dogshape.pipeline.search.pool import Pool
from dogshape.pipeline.search.rounds import run
from dogshape.pipeline.search.sampler import SurrogateSampler
from dogshape.pipeline.search.samplers import sampler_factory
from dogshape.pipeline.search.search import open_search
from dogshape.pipeline.search.state import SearchState, compiled_shifts
from dogshape.pipeline.search.unit_cube import Space
from dogshape.pipeline.simulate.design import SIMULATED, design_of, values_of
from dogshape.pipeline.simulate.evaluation import evaluate
from dogshape.pipeline.simulate.executor import Executor
from dogshape.pipeline.simulate.point_plans import whole_plan
from dogshape.pipeline.store.folder import StudyFolder
from dogshape.pipeline.store.journal import ShiftJournal
from dogshape.surrogate.hypervolume import not_dominated

START = 10  #: designs that every sampler begins with, the prototype among them
MOST_ASKED = 4000  #: proposals after which a search gives up: most may be forbidden
SCREEN = 64  #: angles of the compiled engine at each operating point of a design in two levels
WIDE, NEAR = 2048, 100  #: allowed designs among which ``AllowedGP`` proposes: of the space, near
PROBLEM = (
    "operating.mismatch_rpm=[10, 50, 149]",
    "operating.force_N=[235.2, 641.5]",
    "expectation.angles=4",
    "load.landing_share=0.01",
    f"search.startup={START}",
)

Values = dict[str, float]


class AllowedGP(GPSampler):
    """GPSampler that takes the largest value of its acquisition among allowed designs.

    Optuna has its acquisition optimised in one method that a user may override. Here it is
    taken at as many designs of the whole space as Optuna itself begins with, all of them allowed,
    at allowed ones near its front, and at allowed ones near the best ten of these.
    """

    def __init__(self, seed: int) -> None:
        super().__init__(seed=seed, n_startup_trials=START)
        study = problem()
        self._space = Space(search_space(study))
        self._pool = Pool(DogGuide(study), seed, WIDE)
        self._draw = np.random.default_rng(seed)

    def _optimize_acqf(self, acqf: Any, best_params: Any) -> Any:
        inner, space = acqf.search_space, self._space
        known = (
            [] if best_params is None else [inner.get_unnormalized_param(p) for p in best_params]
        )
        found = self._pool.first(space)
        found = found + (self._pool.drawn(space, self._draw, NEAR, known) if known else [])
        values = acqf.eval_acqf_no_grad(inner.get_normalized_params([None] * len(found), found))
        best = [found[k] for k in np.argsort(values)[-10:]]
        found = best + self._pool.drawn(space, self._draw, NEAR, best)
        places = inner.get_normalized_params([None] * len(found), found)
        return places[int(np.argmax(acqf.eval_acqf_no_grad(places)))]


SAMPLERS: dict[str, Callable[[int], BaseSampler]] = {
    "TPE": lambda seed: TPESampler(seed=seed, n_startup_trials=START),
    "NSGA-II": lambda seed: NSGAIISampler(seed=seed, population_size=START),
    "GPSampler": AllowedGP,
    "quasi-random": lambda seed: QMCSampler(seed=seed, scramble=True),
}
OWN = "own, two levels"
LEVEL_SHARE = 0.25  #: of the shifts of Drake after which a search in two levels ends


@dataclass(frozen=True)
class Step:
    """The front that a search declares after so many shifts of Drake and s of one processor."""

    shifts: int
    cpu: float
    designs: int
    front: list[Values]
    compiled: int = 0


@dataclass
class Record:
    """What a search did, step by step; ``asked`` counts the forbidden proposals too."""

    asked: int = 0
    steps: list[Step] = field(default_factory=list)

    def note(self, state: SearchState, journal: ShiftJournal, begun: float) -> None:
        """Note what a search of this project declares now."""
        study, declared = state.study, [dict(trial.params) for trial in state.front]
        compiled = compiled_shifts(study, state.trials) if study.two_levels else 0
        spent = time.process_time() - begun
        shifts, designs = len(journal.rows), len(state.simulated)
        self.steps.append(Step(shifts, spent, designs, declared, compiled))


def problem(*overrides: str) -> Setup:
    """Return the study that all samplers search."""
    return load_study("mq200_paper", [*PROBLEM, *overrides])


def search(sampler: str, seed: int, designs: int) -> Record:
    """Run a search with the shifts that ``designs`` whole designs cost."""
    optuna.logging.set_verbosity(optuna.logging.ERROR)
    with warnings.catch_warnings(), TemporaryDirectory() as folder:
        warnings.simplefilter("ignore", ExperimentalWarning)
        if sampler == OWN:
            return _two_levels(Path(folder), seed, designs)
        executor = Executor(ShiftJournal(Path(folder) / "shifts.jsonl"), 1)
        return _asked_and_told(SAMPLERS[sampler](seed), executor, problem(), seed, designs)


def first_designs(study: Setup, seed: int) -> list[Values]:
    """Return the designs that a search of this project begins with."""
    asked = optuna.create_study(
        directions=["minimize"] * 2, sampler=SurrogateSampler(DogGuide(study), seed, START)
    )
    asked.enqueue_trial(study.prototype)
    return [dict(asked.ask(search_space(study)).params) for _ in range(START)]


class _SpentError(Exception):
    """The shifts of a search are spent."""


def _two_levels(folder: Path, seed: int, designs: int) -> Record:
    """Search in two levels until the shifts of Drake are spent."""
    study = problem(
        "search.levels=2", "search.pair_angles=1", f"search.screen_angles={SCREEN}",
        f"search.seed={seed}", f"search.trials={MOST_ASKED}",
    )  # fmt: skip
    guide, root = DogGuide(study), StudyFolder(folder)
    journal, opened = ShiftJournal(root.shifts), open_search(study, root, None, False, guide=guide)
    executor, begun, record = Executor(journal, 1), time.process_time(), Record()
    budget = LEVEL_SHARE * designs * sum(whole_plan(problem()))

    def after_round(_: str, state: SearchState) -> None:
        record.note(state, journal, begun)
        record.asked = len(state.trials)
        if len(journal.rows) >= budget:
            raise _SpentError

    with suppress(_SpentError):
        run(opened, sampler_factory(study, guide), executor, after_round)
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
    told_of = LANDING if isinstance(sampler, AllowedGP) else None
    while len(executor.journal.rows) < budget and record.asked < MOST_ASKED:
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
        limits = [v for n, v in design.constraints.items() if told_of is None or n in told_of]
        trial.set_constraint("largest", max(limits))
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
