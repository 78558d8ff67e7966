"""Samplers compared: how much of the front each finds in some minutes of one processor.

    python -m benchmarks.samplers [--seeds N] [--minutes N] [--jobs N] [--out DIR]

The paper's study's objectives and constraints at six of its operating points; of a hundred landings
one may be harder than the checks take. The compiled engine simulates every design, at 64 angles of
each point. All samplers begin with the same ten designs and know nothing else of the clutch.

Optuna's samplers propose one design at a time, as one uses Optuna with a simulator. A
design that a closed form forbids costs no shift: it gets the worst time so far and its largest
constraint. ``GPSampler`` proposes forbidden designs nearly always, so it proposes among allowed
ones only (``AllowedGP``). This project's search is that of a study.

A front is what a search declares once it has spent so many minutes: designs that pass every check
and that no other dominates. All of them are simulated again at new angles; those whose dogs land
too hard there are left out. The result is the hypervolume of the others up to a quarter beyond
the prototype, as a share of that of the reference front: the best of all designs simulated so.

Finished runs are kept in a folder and not run again, nor are designs that were simulated again.
Needs the extra ``gp``.
"""

from __future__ import annotations

import argparse
import json
import os
import time
import warnings
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from contextlib import suppress
from multiprocessing import get_context
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import optuna
from optuna._hypervolume import compute_hypervolume
from optuna.exceptions import ExperimentalWarning
from optuna.samplers import BaseSampler, GPSampler, NSGAIISampler, QMCSampler, TPESampler

from dogshape.pipeline.config.study_file import Setup, load_study
from dogshape.pipeline.search.sampler import LANDING, Guide, Pool, Space, SurrogateSampler
from dogshape.pipeline.search.search import open_search, run
from dogshape.pipeline.search.state import SearchState, not_dominated
from dogshape.pipeline.simulate.design import SIMULATED, design_of, values_of
from dogshape.pipeline.simulate.evaluation import NEW_ANGLES, evaluate
from dogshape.pipeline.simulate.executor import Executor, scratch_executor
from dogshape.pipeline.store.folder import ShiftJournal, StudyFolder
from dogshape.sim.elementwise import Array

START_DESIGNS = 10  #: designs that every sampler begins with, the prototype among them
TIME_SHARES = (0.25, 0.5, 1.0)  #: of the minutes, at which fronts are compared
MAX_PROPOSALS = 4000  #: proposals after which a search gives up: most may be forbidden
REFERENCE_FACTOR = 1.25  #: the hypervolume's reference point, over the prototype's time and length
WIDE_POOL = 2048  #: allowed designs of the space from which ``AllowedGP`` proposes
NEAR_POOL = 100  #: allowed designs near good ones from which ``AllowedGP`` proposes
OWN = "own"
ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
PROBLEM = (
    "operating.mismatch_rpm=[10, 50, 149]",
    "operating.force_N=[235.2, 641.5]",
    "expectation.angles=64",
    "load.landing_share=0.01",
    f"search.startup={START_DESIGNS}",
)

Values = dict[str, float]
Run = dict[str, Any]  #: ``asked``, and ``steps`` with ``cpu`` in s, ``designs`` and ``front``


def problem(*overrides: str) -> Setup:
    """Return the study that all samplers search."""
    return load_study("mq200_paper", [*PROBLEM, *overrides]).search_setup


class AllowedGP(GPSampler):
    """GPSampler that takes the largest value of its acquisition among allowed designs.

    Optuna has its acquisition optimised in one method that a user may override. Here it is
    taken at as many designs of the whole space as Optuna itself begins with, all of them allowed,
    at allowed ones near its front, and at allowed ones near the best ten of these.
    """

    def __init__(self, seed: int) -> None:
        super().__init__(seed=seed, n_startup_trials=START_DESIGNS)
        study = problem()
        self._pool = Pool(Guide(study), seed, WIDE_POOL)
        self._draw = np.random.default_rng(seed)
        self._first = self._pool.draw(np.random.default_rng(seed), WIDE_POOL)

    def _optimize_acqf(self, acqf: Any, best_params: Any) -> Any:
        space = acqf.search_space
        candidates = list(self._first)
        if best_params is not None and len(best_params):
            incumbents = [space.get_unnormalized_param(p) for p in best_params]
            candidates += self._pool.draw(self._draw, NEAR_POOL, incumbents)
        points = space.get_normalized_params([None] * len(candidates), candidates)
        values = acqf.eval_acqf_no_grad(points)
        best = [candidates[k] for k in np.argsort(values)[-10:]]
        candidates = best + self._pool.draw(self._draw, NEAR_POOL, best)
        points = space.get_normalized_params([None] * len(candidates), candidates)
        return points[int(np.argmax(acqf.eval_acqf_no_grad(points)))]


SAMPLERS: dict[str, Callable[[int], BaseSampler]] = {
    "TPE": lambda seed: TPESampler(seed=seed, n_startup_trials=START_DESIGNS),
    "NSGA-II": lambda seed: NSGAIISampler(seed=seed, population_size=START_DESIGNS),
    "GPSampler": AllowedGP,
    "quasi-random": lambda seed: QMCSampler(seed=seed, scramble=True),
}


class _SpentError(Exception):
    """The minutes of a search are spent."""


def run_study_search(seed: int, minutes: float) -> Run:
    """Search as a study does until the minutes are spent."""
    study = problem(f"search.seed={seed}", f"search.trials={MAX_PROPOSALS}")
    start = cpu_clock()
    steps: list[Run] = []

    def after_round(_: str, state: SearchState) -> None:
        front = [trial.params for trial in state.front]
        cpu = cpu_clock() - start
        steps.append({"cpu": cpu, "designs": len(state.simulated), "front": front})
        steps[-1]["asked"] = len(state.trials)
        if cpu > 60.0 * minutes:
            raise _SpentError

    with TemporaryDirectory() as place, suppress(_SpentError):
        folder = StudyFolder(Path(place))
        executor = Executor(ShiftJournal(folder.running), 1)
        run(open_search(study, folder, None, False), executor, after_round)
    return {"asked": steps[-1]["asked"], "steps": steps}


def run_optuna_search(sampler: BaseSampler, seed: int, minutes: float) -> Run:
    """Ask and tell one of Optuna's samplers until the minutes are spent."""
    study = problem()
    start = cpu_clock()
    proposal_count = 0
    worst = 0.0
    executor = scratch_executor(1)
    settings = study.file.expectation
    search = optuna.create_study(directions=["minimize"] * 2, sampler=sampler)
    for params in first_designs(study, seed):
        search.enqueue_trial(params)
    designs: list[tuple[Values, list[float]]] = []
    steps: list[Run] = []
    limiting = LANDING if isinstance(sampler, AllowedGP) else None
    while cpu_clock() - start < 60.0 * minutes and proposal_count < MAX_PROPOSALS:
        proposal_count += 1
        trial = search.ask(Space(study.variables).trial(study.prototype).distributions)
        design = design_of(study, dict(trial.params))
        times: dict[str, float] = {SIMULATED: worst}
        simulated = design.feasible
        if simulated:
            (evaluation,) = evaluate(
                study, [design.params], executor, settings.angles, settings.seed
            )
            executor.drop_shifts()
            times = {name: estimate.value for name, estimate in evaluation.estimates.items()}
            worst = max(worst, times[SIMULATED])
            design = design_of(study, design.params, evaluation.check_inputs)
            if design.feasible:
                designs.append((design.params, values_of(design, times)))
        # A shape that is impossible has no length either: it has the prototype's.
        length = values_of(design, times)[1]
        losses = [
            times[SIMULATED],
            length if np.isfinite(length) else study.clutch.dog.travel * 1e3,
        ]
        limits = [v for n, v in design.constraints.items() if limiting is None or n in limiting]
        trial.set_constraint("largest", max(limits))
        search.tell(trial, losses)
        if simulated and designs:
            dominant = not_dominated(np.array([values for _, values in designs]))
            front = [
                params
                for (params, _), is_dominant in zip(designs, dominant, strict=True)
                if is_dominant
            ]
            count = 1 + (steps[-1]["designs"] if steps else 0)
            steps.append({"cpu": cpu_clock() - start, "designs": count, "front": front})
    return {"asked": proposal_count, "steps": steps}


def cpu_clock() -> float:
    """Return the processor time of this process, s."""
    return time.process_time()


def first_designs(study: Setup, seed: int) -> list[Values]:
    """Return the designs that a search of this project begins with."""
    sampler = SurrogateSampler(Guide(study), seed, START_DESIGNS)
    space = Space(study.variables)
    trials = [space.trial(study.prototype)]
    while len(trials) < START_DESIGNS:
        trials.append(space.trial(sampler.propose(trials) or {}))
    return [trial.params for trial in trials]


def run_and_keep(sampler: str, seed: int, minutes: float, path: Path) -> str:
    """Run a search and store its record."""
    optuna.logging.set_verbosity(optuna.logging.ERROR)
    study = problem()
    evaluate(study, [{}], scratch_executor(1), 3, 1)  # the engine is compiled before it is timed
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ExperimentalWarning)
        if sampler == OWN:
            record = run_study_search(seed, minutes)
        else:
            record = run_optuna_search(SAMPLERS[sampler](seed), seed, minutes)
    new = path.with_suffix(".new")
    new.write_text(json.dumps({"sampler": sampler, "seed": seed, **record}), encoding="utf-8")
    new.replace(path)
    return f"{sampler}, seed {seed}: {record['steps'][-1]['designs']} designs"


def load_runs(seeds: int, minutes: float, jobs: int, folder: Path) -> list[Run]:
    """Run the searches without a stored record; return the records of all."""
    paths = {
        (name, seed): folder / f"{name}-{seed}-{minutes:g}.json"
        for seed in range(1, seeds + 1)
        for name in (*SAMPLERS, OWN)
    }
    with ProcessPoolExecutor(jobs, get_context("spawn"), max_tasks_per_child=1) as pool:
        futures = [
            pool.submit(run_and_keep, *key, minutes, path)
            for key, path in paths.items()
            if not path.exists()
        ]
        for future in as_completed(futures):
            print(future.result(), flush=True)
    return [json.loads(path.read_text(encoding="utf-8")) for path in paths.values()]


def front_at(record: Run, minutes: float) -> list[Values]:
    """Return the front of a search after a number of minutes, empty before the first."""
    finished = [step for step in record["steps"] if step["cpu"] <= 60.0 * minutes]
    return list(finished[-1]["front"]) if finished else []


class Truth:
    """Objectives of designs at new angles: (time in s, length in mm), inf if not feasible.

    ``truth.jsonl`` of a folder stores them.
    """

    def __init__(self, folder: Path, jobs: int) -> None:
        self._study = problem()
        self._executor = scratch_executor(jobs)
        self._path = folder / "truth.jsonl"
        self._values: dict[tuple[float, ...], list[float]] = {}
        if self._path.exists():
            for line in self._path.read_text(encoding="utf-8").splitlines():
                record = json.loads(line)
                self._values[tuple(record["design"])] = record["values"]

    def learn(self, designs: Sequence[Values]) -> None:
        """Simulate designs without objectives."""
        study = self._study
        settings = self._study.file.expectation
        unknown = {self._key(d): d for d in designs if self._key(d) not in self._values}
        for key, params in unknown.items():
            seed = settings.seed + NEW_ANGLES
            (evaluation,) = evaluate(study, [params], self._executor, settings.angles, seed)
            self._executor.drop_shifts()
            design = design_of(study, params, evaluation.check_inputs)
            values = [np.inf, np.inf]
            if design.feasible:
                values = values_of(design, {SIMULATED: evaluation.expectation.mean})
            self._values[key] = values
            with self._path.open("a", encoding="utf-8") as file:
                file.write(json.dumps({"design": key, "values": values}) + "\n")

    def of(self, designs: Sequence[Values]) -> Array:
        """Return the objectives of designs that were simulated, (n, 2)."""
        return np.array([self._values[self._key(d)] for d in designs]).reshape(-1, 2)

    def _key(self, design: Values) -> tuple[float, ...]:
        return tuple(design[name] for name in self._study.variables)


def hypervolume(values: Array, reference_point: Array) -> float:
    """Compute the hypervolume of objectives (n, 2) up to a point; those beyond it add nothing."""
    inside = values[(values <= reference_point).all(axis=1)]
    return float(compute_hypervolume(inside, reference_point)) if len(inside) else 0.0


def print_results(runs: Sequence[Run], minutes: Sequence[float], truth: Truth) -> None:
    """Print the shares of the reference front of all runs, and their numbers of designs."""
    study = problem()
    designs = [study.prototype]
    for record in runs:
        for limit in minutes:
            designs += front_at(record, limit)
    truth.learn(designs)
    prototype = truth.of([study.prototype])[0]
    reference_point = REFERENCE_FACTOR * prototype
    values = truth.of(designs)
    reference = hypervolume(values, reference_point)
    shares: dict[str, list[list[float]]] = {}
    for record in runs:
        fronts = [truth.of(front_at(record, limit)) for limit in minutes]
        run_shares = [hypervolume(front, reference_point) / reference for front in fronts]
        shares.setdefault(record["sampler"], []).append(run_shares)
    best = int(not_dominated(np.unique(values, axis=0)).sum())
    print(
        f"prototype {prototype[0] * 1e3:.1f} ms, {prototype[1]:.2f} mm; reference: front of "
        f"{best} designs, best of all here"
    )
    print("\nshare of the reference front's hypervolume, median of the seeds (least, largest)")
    print(f"{'':<14}" + "".join(f"{limit:>19.2f} min" for limit in minutes) + "  seeds")
    for name in (*SAMPLERS, OWN):
        rows = np.array(shares[name])
        cells = [f"{np.median(c):.3f} ({c.min():.3f}, {c.max():.3f})" for c in rows.T]
        print(f"{name:<14}" + "".join(f"{cell:>23}" for cell in cells) + f"{len(rows):>7d}")
    print("\nmedians at the end: simulated designs, proposals; of all that the seeds declare, what")
    print("holds at new angles")
    for name in (*SAMPLERS, OWN):
        sampler_runs = [record for record in runs if record["sampler"] == name]
        design_count = np.median([record["steps"][-1]["designs"] for record in sampler_runs])
        proposals = np.median([record["asked"] for record in sampler_runs])
        front = []
        for record in sampler_runs:
            front += front_at(record, minutes[-1])
        feasible_count = int(np.isfinite(truth.of(front)[:, 0]).sum())
        print(
            f"{name:<14}{design_count:>6.0f}{proposals:>7.0f}{feasible_count:>6d} of {len(front)}"
        )


def main() -> None:
    """Run missing searches and print the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--minutes", type=float, default=0.8)
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--out", type=Path, default=Path("build/samplers"))
    arguments = parser.parse_args()
    os.environ.update(dict.fromkeys(ONE_THREAD, "1"))
    arguments.out.mkdir(parents=True, exist_ok=True)
    runs = load_runs(arguments.seeds, arguments.minutes, arguments.jobs, arguments.out)
    print_results(
        runs,
        [part * arguments.minutes for part in TIME_SHARES],
        Truth(arguments.out, arguments.jobs),
    )


if __name__ == "__main__":
    main()
