"""Samplers compared: how much of the front each finds in the same processor time.

    python -m benchmarks.samplers [PROBLEM ...] [--seeds N] [--jobs N] [--out DIR]

A problem is a bundled study at fewer operating points or angles (``PROBLEMS``), with its own
objectives or its expected shift time alone. This project's search runs as in a study, polish
included. Each other sampler gets the processor time that this search took with the same seed. All
begin with the same designs.

Optuna's samplers propose one design at a time, as one uses Optuna with a simulator. A design that
a closed form forbids costs no shift: it gets the worst values so far and its largest constraint.
``GPSampler`` proposes forbidden designs nearly always, so it proposes among allowed ones only
(``AllowedGP``), and has the values and constraints that this project's sampler has.

The front of a search has the designs that pass every check and that no other dominates. All of
them are simulated again at new angles, twice as many; those that fail a check there leave the
front, and designs that come onto it are simulated next. The result is the hypervolume of the front,
as a share of that of the reference front: the best of all designs simulated so. It is counted up to
a quarter beyond the prototype, or beyond the end of the reference front where that is farther.
Times have the hangs that are pooled over all designs.

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
from dataclasses import dataclass, replace
from importlib import import_module
from itertools import chain
from multiprocessing import get_context
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import optuna
from optuna._hypervolume import compute_hypervolume
from optuna.exceptions import ExperimentalWarning
from optuna.samplers import BaseSampler, GPSampler, NSGAIISampler, QMCSampler, TPESampler
from optuna.study import StudyDirection
from optuna.trial import FrozenTrial, TrialState, create_trial

from dogshape.pipeline.config.study_file import Setup, load_study
from dogshape.pipeline.search.sampler import (
    FRONT_CANDIDATES,
    LANDING,
    SPACE_CANDIDATES,
    Guide,
    Pool,
    Space,
    SurrogateSampler,
)
from dogshape.pipeline.search.search import open_search, run
from dogshape.pipeline.search.state import (
    SIMULATION,
    SearchState,
    Trial,
    not_dominated,
    pool_trials,
    simulation_record,
    trial_of,
)
from dogshape.pipeline.simulate.design import (
    SIMULATED,
    design_of,
    objectives_of,
    simulated_limits,
    values_of,
)
from dogshape.pipeline.simulate.evaluation import (
    NEW_ANGLES,
    TIME_ESTIMATORS,
    Evaluation,
    drop_design_shifts,
    evaluate,
)
from dogshape.pipeline.simulate.executor import Executor, scratch_executor
from dogshape.pipeline.store.folder import ShiftJournal, StudyFolder
from dogshape.sim.elementwise import Array

START_DESIGNS = 12  #: designs that every sampler begins with, the prototype among them
TIME_SHARES = (0.25, 0.5, 1.0)  #: of a search's processor time, at which fronts are compared
MAX_PROPOSALS = 4000  #: proposals after which a search gives up: most may be forbidden
REFERENCE_FACTOR = 1.25  #: the hypervolume's reference point, over prototype or end of the front
TRUTH_ANGLES = 2  #: angles of the simulation at new angles, over those of the search
BEST_CANDIDATES = 10  #: candidates that ``AllowedGP`` draws near
OWN = "own"
STOCK = "GPSampler"
ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")

Values = dict[str, float]
#: ``cpu`` in s and ``designs``, in the order in which these were simulated: ``params``, ``losses``
#: and ``feasible`` of each
Run = dict[str, Any]


@dataclass(frozen=True)
class Problem:
    """Study that samplers search, with its changes and the samplers."""

    name: str
    study_name: str
    overrides: tuple[str, ...]
    samplers: tuple[str, ...] = (STOCK,)

    def setup(self, *overrides: str) -> Setup:
        """Load the study."""
        # The prototype may be forbidden, and a round has four designs.
        startup = f"search.startup={START_DESIGNS - 1}"
        return load_study(self.study_name, [*self.overrides, startup, *overrides]).search_setup

    @property
    def time_alone(self) -> Problem:
        """The same problem with the expected shift time as its only objective."""
        objective = f"search.objectives=['{SIMULATED}']"
        return replace(
            self, name=f"{self.name}, time alone", overrides=(*self.overrides, objective)
        )


FORCES = "operating.force_N=[235.2, 641.5]"
PAPER = Problem(
    "mq200_paper",
    "mq200_paper",
    (
        "operating.mismatch_rpm=[10, 50, 149]",
        FORCES,
        "expectation.angles=64",
        "load.landing_share=0.01",
        "search.trials=72",
    ),
    samplers=("TPE", "NSGA-II", STOCK, "quasi-random"),
)
MQ200 = Problem(
    "mq200",
    "mq200",
    (
        "operating.mismatch_rpm=[10, 50, 149]",
        FORCES,
        "expectation.angles=16",
        "search.trials=40",
    ),
)
THREE = Problem("mq200_three", "mq200_three", ("expectation.angles=16", "search.trials=48"))
BOTH = Problem(
    "mq200_both",
    "mq200_both",
    (
        "operating.mismatch_rpm=[-149, -25, 25, 149]",
        FORCES,
        "expectation.angles=12",
        "search.trials=40",
    ),
)
MOTORCYCLE = Problem("motorcycle", "motorcycle", ("expectation.angles=16", "search.trials=48"))
AMT = Problem(
    "amt",
    "amt",
    (
        "operating.points=["
        "{mismatch_rpm = 20.0, force_N = 1000.0, weight = 4.0},"
        "{mismatch_rpm = 60.0, force_N = 1000.0, weight = 4.0},"
        "{mismatch_rpm = -20.0, force_N = 1000.0, weight = 3.0},"
        "{mismatch_rpm = -60.0, force_N = 1000.0, weight = 3.0}]",
        "expectation.angles=16",
        "search.trials=40",
    ),
)
PROBLEMS = {
    problem.name: problem
    for problem in (
        PAPER,
        MQ200,
        THREE,
        BOTH,
        MOTORCYCLE,
        AMT,
        MQ200.time_alone,
        THREE.time_alone,
        BOTH.time_alone,
        MOTORCYCLE.time_alone,
        AMT.time_alone,
    )
}


class AllowedGP(GPSampler):
    """GPSampler that takes the largest value of its acquisition among allowed designs.

    It has the candidates, times and constraints of this project's sampler: as many allowed designs
    of the whole space and near its front, and as many again near the best of these; times with
    pooled hangs; the hardest landing, and each simulated limit, as one constraint.
    """

    def __init__(self, study: Setup, seed: int) -> None:
        super().__init__(seed=seed, n_startup_trials=START_DESIGNS)
        self._guide = Guide(study)
        self._pool = Pool(self._guide, seed, SPACE_CANDIDATES)
        self._draw = np.random.default_rng(seed)
        self._proposed: list[Values] = []

    def _sample_relative_impl(
        self, study: Any, completed_trials: Any, running_trials: Any, search_space: Any
    ) -> Any:
        self._proposed = [trial.params for trial in completed_trials]
        simulated = [trial for trial in completed_trials if SIMULATION in trial.user_attrs]
        constraints = self._guide.constraints(simulated)
        trials = []
        for trial, losses in zip(simulated, self._guide.losses(simulated), strict=True):
            by_name = constraints[trial.number]
            limits = {"landing": max(v for name, v in by_name.items() if name in LANDING)}
            for name in simulated_limits(self._guide.study):
                limits[name] = float(np.arcsinh(by_name[name]))
            trials.append(
                create_trial(
                    params=trial.params,
                    distributions=trial.distributions,
                    values=losses.tolist(),
                    constraints=limits,
                )
            )
        return super()._sample_relative_impl(study, trials, running_trials, search_space)

    def _optimize_acqf(self, acqf: Any, best_params: Any) -> Any:
        space = acqf.search_space
        candidates = self._pool.remaining(self._proposed)
        if best_params is not None and len(best_params):
            incumbents = [space.get_unnormalized_param(params) for params in best_params]
            candidates += self._pool.draw(self._draw, FRONT_CANDIDATES, incumbents)
        points = space.get_normalized_params([None] * len(candidates), candidates)
        gains = acqf.eval_acqf_no_grad(points)
        best = [candidates[place] for place in np.argsort(gains)[-BEST_CANDIDATES:]]
        candidates = best + self._pool.draw(self._draw, FRONT_CANDIDATES, best)
        points = space.get_normalized_params([None] * len(candidates), candidates)
        return points[int(np.argmax(acqf.eval_acqf_no_grad(points)))]


SAMPLERS: dict[str, Callable[[Setup, int], BaseSampler]] = {
    "TPE": lambda _, seed: TPESampler(seed=seed, n_startup_trials=START_DESIGNS),
    "NSGA-II": lambda _, seed: NSGAIISampler(seed=seed, population_size=START_DESIGNS),
    STOCK: AllowedGP,
    "quasi-random": lambda _, seed: QMCSampler(seed=seed, scramble=True),
}


def run_study_search(problem: Problem, seed: int) -> Run:
    """Search as a study does."""
    study = problem.setup(f"search.seed={seed}")
    start = cpu_clock()
    times: list[float] = []

    def after_round(_: str, state: SearchState) -> None:
        times.extend([cpu_clock() - start] * (len(state.simulated) - len(times)))

    with TemporaryDirectory() as place:
        folder = StudyFolder(Path(place))
        executor = Executor(ShiftJournal(folder.running), 1)
        state = run(open_search(study, folder, None, False), executor, after_round)
    return run_record(state, times)


def run_record(state: SearchState, times: Sequence[float]) -> Run:
    """Record the simulated designs of a finished search and the times of their ends, s."""
    feasible = {trial.number for trial in state.feasible}
    designs = [
        {
            "params": trial.params,
            "losses": state.losses[trial.number].tolist(),
            "feasible": trial.number in feasible,
        }
        for trial in state.simulated
    ]
    return {"cpu": list(times), "designs": designs}


def run_optuna_search(problem: Problem, name: str, seed: int, cpu_limit: float) -> Run:
    """Ask and tell one of Optuna's samplers until the processor time is spent, s."""
    study = problem.setup(f"search.seed={seed}")
    settings = study.file.expectation
    executor = scratch_executor(1)
    start_designs = first_designs(study, seed)
    start = cpu_clock()
    # Every objective of the problems is to be minimised.
    directions = [StudyDirection.MINIMIZE] * len(objectives_of(study))
    search = optuna.create_study(directions=directions, sampler=SAMPLERS[name](study, seed))
    for params in start_designs:
        search.enqueue_trial(params)
    distributions = Space(study.variables).trial(study.prototype).distributions
    worst = np.zeros(len(directions))
    times: list[float] = []  # at which designs were finished
    proposal_count = 0
    while cpu_clock() - start < cpu_limit and proposal_count < MAX_PROPOSALS:
        proposal_count += 1
        trial = search.ask(distributions)
        design = design_of(study, dict(trial.params))
        estimates: Values = {}
        if design.feasible:
            (evaluation,) = evaluate(
                study, [design.params], executor, settings.angles, settings.seed
            )
            drop_design_shifts(study, executor, settings.angles, settings.seed)
            if evaluation.is_complete:
                trial.set_user_attr(SIMULATION, simulation_record(evaluation)._asdict())
                estimates = values_by_name(evaluation)
                design = design_of(study, design.params, evaluation.check_inputs)
        values = np.array(values_of(design, estimates))
        worst = np.fmax(worst, np.where(np.isfinite(values), values, worst))
        constraints = design.constraints
        if name != STOCK:
            constraints = {"largest": max(constraints.values())}
        for constraint, value in constraints.items():
            trial.set_constraint(constraint, value)
        search.tell(trial, np.where(np.isfinite(values), values, worst).tolist())
        if estimates:
            times.append(cpu_clock() - start)
    complete = search.get_trials(deepcopy=False, states=[TrialState.COMPLETE])
    simulated = [trial_of(trial) for trial in complete if SIMULATION in trial.user_attrs]
    return run_record(SearchState(study, pool_trials(study, simulated)[0]), times)


def values_by_name(evaluation: Evaluation) -> Values:
    """Return the simulated values of a design by name."""
    return {name: estimate.value for name, estimate in evaluation.estimates.items()}


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


def record_path(folder: Path, problem: Problem, sampler: str, seed: int) -> Path:
    """Return the file of a run."""
    return folder / f"{problem.name}-{sampler}-{seed}.json"


def run_and_keep(problem_name: str, seed: int, folder: Path) -> str:
    """Run the searches of a problem with a seed that have no record, and store their records."""
    problem = PROBLEMS[problem_name]
    optuna.logging.set_verbosity(optuna.logging.ERROR)
    # Neither compilation nor the import of torch and scipy is timed.
    for module in ("optuna._gp.acqf", "optuna._gp.optim_mixed", "dogshape.surrogate.process"):
        import_module(module)
    evaluate(problem.setup(), [{}], scratch_executor(1), 3, 1)
    texts = []
    cpu_limit = 0.0
    for sampler in (OWN, *problem.samplers):
        path = record_path(folder, problem, sampler, seed)
        if not path.exists():
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", ExperimentalWarning)
                if sampler == OWN:
                    record = run_study_search(problem, seed)
                else:
                    record = run_optuna_search(problem, sampler, seed, cpu_limit)
            new = path.with_suffix(".new")
            new.write_text(json.dumps({"sampler": sampler, "seed": seed, **record}), "utf-8")
            new.replace(path)
        record = json.loads(path.read_text(encoding="utf-8"))
        if sampler == OWN:
            cpu_limit = record["cpu"][-1]
        texts.append(f"{sampler} {len(record['designs'])}")
    return f"{problem.name}, seed {seed}, {cpu_limit:.1f} s: designs of {', '.join(texts)}"


def run_missing(problems: Sequence[Problem], seeds: int, jobs: int, folder: Path) -> None:
    """Run the searches without a stored record, each sampler after that of this project."""
    with ProcessPoolExecutor(jobs, get_context("spawn"), max_tasks_per_child=1) as pool:
        futures = []
        for seed in range(1, seeds + 1):
            for problem in problems:
                names = (OWN, *problem.samplers)
                paths = [record_path(folder, problem, name, seed) for name in names]
                if not all(path.exists() for path in paths):
                    futures.append(pool.submit(run_and_keep, problem.name, seed, folder))
        for future in as_completed(futures):
            print(future.result(), flush=True)


def load_runs(problem: Problem, seeds: int, folder: Path) -> dict[str, list[Run]]:
    """Read the records of a problem by sampler, in the order of the seeds."""
    runs = {}
    for sampler in (*problem.samplers, OWN):
        paths = [record_path(folder, problem, sampler, seed) for seed in range(1, seeds + 1)]
        runs[sampler] = [json.loads(path.read_text(encoding="utf-8")) for path in paths]
    return runs


def front_of(designs: Sequence[Run]) -> list[Values]:
    """Return the feasible designs of a search that no other dominates."""
    feasible = [design for design in designs if design["feasible"]]
    if not feasible:
        return []
    is_on_front = not_dominated(np.array([design["losses"] for design in feasible]))
    return [feasible[place]["params"] for place in np.flatnonzero(is_on_front)]


class Truth:
    """Objectives of designs at new angles, inf for those that fail a check there.

    A file of the folder stores the simulations.
    """

    def __init__(self, problem: Problem, folder: Path, jobs: int) -> None:
        self._study = problem.setup()
        self._space = Space(self._study.variables)
        self._executor = scratch_executor(jobs)
        self._path = folder / f"{problem.name}-truth.jsonl"
        self._trials: dict[tuple[float, ...], Trial] = {}
        if self._path.exists():
            for line in self._path.read_text(encoding="utf-8").splitlines():
                record = json.loads(line)
                self._add(record["design"], record["values"], record["simulation"])
        self._state = SearchState(self._study, ())

    def _add(self, design: Values, values: list[float], simulation: dict[str, Any]) -> None:
        frozen: FrozenTrial = self._space.trial(design, **{SIMULATION: simulation})
        frozen.values = values
        trial = replace(trial_of(frozen), number=len(self._trials))
        self._trials[self._space.key(design)] = trial

    def learn(self, designs: Sequence[Values]) -> None:
        """Simulate designs that are not stored."""
        study = self._study
        angles = TRUTH_ANGLES * study.file.expectation.angles
        seed = study.file.expectation.seed + NEW_ANGLES
        unknown = {self._space.key(params): params for params in designs}
        unknown = {key: p for key, p in unknown.items() if key not in self._trials}
        if not unknown and self._state.trials:
            return
        for params in unknown.values():
            (evaluation,) = evaluate(study, [params], self._executor, angles, seed)
            drop_design_shifts(study, self._executor, angles, seed)
            values = values_of(design_of(study, params), values_by_name(evaluation))
            simulation = simulation_record(evaluation)._asdict()
            record = {"design": params, "values": values, "simulation": simulation}
            with self._path.open("a", encoding="utf-8") as file:
                file.write(json.dumps(record) + "\n")
            self._add(params, values, simulation)
        trials, _ = pool_trials(study, list(self._trials.values()))
        # A limit on a time is judged again with each prior.
        time_limits = TIME_ESTIMATORS.keys() & set(simulated_limits(study))
        design_cache = {} if time_limits else self._state.design_cache
        self._state = SearchState(study, trials, design_cache)

    def losses(self, design: Values) -> Array:
        """Return the objectives of a design, whether or not it passes the checks, (k,)."""
        return self._state.losses[self._trials[self._space.key(design)].number]

    def passes(self, design: Values) -> bool:
        """Tell whether a design passes every check."""
        trial = self._trials[self._space.key(design)]
        return any(feasible.number == trial.number for feasible in self._state.feasible)

    def confirmed_front(self, designs: Sequence[Run]) -> list[Values]:
        """Return the front of the designs of a search that pass every check at new angles."""
        candidates = [design for design in designs if design["feasible"]]
        while candidates:
            front = front_of(candidates)
            self.learn(front)
            if all(map(self.passes, front)):
                return front
            candidates = [
                design
                for design in candidates
                if design["params"] not in front or self.passes(design["params"])
            ]
        return []


def hypervolume(values: Array, reference_point: Array) -> float:
    """Compute the hypervolume of objectives (n, k) up to a point; those beyond it add nothing."""
    inside = values[(values <= reference_point).all(axis=1)]
    return float(compute_hypervolume(inside, reference_point)) if len(inside) else 0.0


def designs_at_moments(record: Run, cpu: float, count: int) -> list[list[Run]]:
    """List the designs of a search at shares of a processor time, s, and the first ``count``."""
    counts = [sum(time <= share * cpu for time in record["cpu"]) for share in TIME_SHARES]
    return [record["designs"][:finished] for finished in (*counts, count)]


def compare(problem: Problem, runs: dict[str, list[Run]], truth: Truth) -> list[float]:
    """Print the rows of a problem; return the shares of the stock over those of this project."""
    study = problem.setup()
    leading = [objective.name for objective in objectives_of(study)].index(SIMULATED)
    minutes = np.median([own["cpu"][-1] / 60.0 for own in runs[OWN]])
    moments: dict[str, list[list[list[Run]]]] = {}
    for sampler, records in runs.items():
        moments[sampler] = []
        for record, own, stock in zip(records, runs[OWN], runs[STOCK], strict=True):
            count = min(len(own["designs"]), len(stock["designs"]))
            moments[sampler].append(designs_at_moments(record, own["cpu"][-1], count))
    searches = list(chain(*chain(*moments.values())))
    truth.learn([study.prototype, *chain(*map(front_of, searches))])
    fronts = {
        sampler: [list(map(truth.confirmed_front, designs)) for designs in sampler_moments]
        for sampler, sampler_moments in moments.items()
    }
    prototype = truth.losses(study.prototype)
    front_designs = chain(*chain(*chain(*fronts.values())))
    losses = np.array([truth.losses(design) for design in front_designs])
    reference_front = np.unique(losses[not_dominated(losses)], axis=0)
    reference_point = REFERENCE_FACTOR * np.maximum(prototype, reference_front.max(axis=0))
    reference = hypervolume(reference_front, reference_point)

    def share(front: list[Values]) -> float:
        values = np.array([truth.losses(design) for design in front])
        return hypervolume(values.reshape(-1, len(prototype)), reference_point) / reference

    shares = {}
    for sampler, sampler_fronts in fronts.items():
        shares[sampler] = np.array(
            [list(map(share, seed_fronts)) for seed_fronts in sampler_fronts]
        )
        best_ms = []
        for seed_fronts in sampler_fronts:
            final_front = seed_fronts[len(TIME_SHARES) - 1]
            times = [truth.losses(design)[leading] for design in final_front]
            best_ms.append(1e3 * min(times, default=np.inf))
        design_count = np.median([len(record["designs"]) for record in runs[sampler]])
        cells = [f"{np.median(c):.3f} ({c.min():.3f}, {c.max():.3f})" for c in shares[sampler].T]
        best = f"{np.median(best_ms):.1f} ({min(best_ms):.1f}, {max(best_ms):.1f})"
        print(
            f"{problem.name:<26}{sampler:<14}"
            + "".join(f"{cell:>23}" for cell in cells)
            + f"{best:>22}{design_count:>9.0f}{minutes:>8.2f}"
        )
    place = len(TIME_SHARES) - 1
    return (shares[STOCK][:, place] / shares[OWN][:, place]).tolist()


def print_results(problems: Sequence[Problem], seeds: int, jobs: int, folder: Path) -> None:
    """Print the shares of the reference front of all runs, and their best times."""
    print("share of the reference front's hypervolume, median of the seeds (least, largest), at a")
    print("quarter, half and all of the processor time, and with equal designs of own and stock;")
    print("best time at new angles, ms; simulated designs; minutes")
    titles = ("a quarter", "half", "all", "equal designs")
    print(
        f"\n{'problem':<26}{'sampler':<14}"
        + "".join(f"{title:>23}" for title in titles)
        + f"{'best, ms':>22}{'designs':>9}{'min':>8}"
    )
    ratios = []
    for problem in problems:
        runs = load_runs(problem, seeds, folder)
        ratios += compare(problem, runs, Truth(problem, folder, jobs))
    print(
        f"\n{STOCK} over own, all of the time: median of {len(ratios)} pairs "
        f"{np.median(ratios):.3f}; GPSampler ahead in {sum(r > 1.0 for r in ratios)}"
    )


def main() -> None:
    """Run missing searches and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("problems", nargs="*", choices=[[], *PROBLEMS], default=[])
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--out", type=Path, default=Path("build/samplers"))
    arguments = parser.parse_args()
    os.environ.update(dict.fromkeys(ONE_THREAD, "1"))
    arguments.out.mkdir(parents=True, exist_ok=True)
    problems = [PROBLEMS[name] for name in arguments.problems or PROBLEMS]
    run_missing(problems, arguments.seeds, arguments.jobs, arguments.out)
    print_results(problems, arguments.seeds, arguments.jobs, arguments.out)


if __name__ == "__main__":
    main()
