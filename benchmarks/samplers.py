"""Samplers compared: how much of the front each finds, by shifts and by time.

    python -m benchmarks.samplers [--seeds N] [--designs N] [--jobs N] [--out DIR] [--kept]

The paper's study's objectives and constraints at six of its operating points, four angles each;
``benchmarks/sampler_runs.py`` says how each sampler is run. All begin with the same ten designs and
may spend the same number of shifts, and none knows what the package brings. Each run has a
processor to itself, so that the time is that of one worker.

One more run of this project searches by the compiled engine alone, at many more angles. Its
shifts are those with which Drake simulates the designs of its front in turn.

A run of Optuna's also ends after 400 s of a processor or 4000 proposals: it then keeps the
front that it had.

A front is what a search declares at a number of shifts: designs that pass every check and that no
other dominates, as far as it knows. All of them are simulated again, densely and at new angles,
and those whose dogs land too hard there are left out. What is told is the hypervolume of the rest
up to a quarter beyond the prototype, as a share of that of the reference front: the best of all
designs that were simulated densely, among them the front of a search over 20 000 designs by the
surrogate that the package brings.

Finished runs are kept in a folder and not run again; ``--kept`` tells of those only. Takes an hour
and a half on two processors; needs the extra ``gp``.
"""

from __future__ import annotations

import argparse
import json
import os
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.sampler_runs import COMPILED, OWN, SAMPLERS, Values, problem, search
from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.search.dog_guide import search_space
from dogshape.pipeline.search.unit_cube import Space
from dogshape.pipeline.simulate.design import (
    SIMULATED,
    design_of,
    exact_losses,
    values_of,
    worth_simulating,
)
from dogshape.pipeline.simulate.evaluation import NEW_ANGLES, evaluate
from dogshape.pipeline.simulate.executor import Executor
from dogshape.pipeline.simulate.point_plans import whole_plan
from dogshape.pipeline.store.journal import ShiftJournal
from dogshape.pipeline.train.found_surrogates import known_surrogate
from dogshape.pipeline.train.training_rows import study_mix
from dogshape.surrogate.covariance import Array
from dogshape.surrogate.expected_time import Over
from dogshape.surrogate.hypervolume import hypervolume, not_dominated

SHIFTS = 24  #: of a whole design
DENSE = 8  #: new angles at each operating point of a declared design
SHARES = (0.2, 1.0)  #: of all shifts, at which fronts are compared
BEYOND = 1.25  #: the hypervolume's reference point, over the prototype's time and length
WIDE, NEAR, ROUNDS = 8000, 3000, 4  #: designs of the search by the surrogate: wide, near, rounds
KEPT = 24  #: designs of its front that are simulated
ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")

Run = dict[str, Any]
Key = tuple[float, ...]


def run_and_keep(sampler: str, seed: int, designs: int, path: Path) -> str:
    """Run a search and keep its record."""
    record = search(sampler, seed, designs)
    kept = {"sampler": sampler, "seed": seed, "shifts": SHIFTS * designs, **asdict(record)}
    new = path.with_suffix(".new")
    new.write_text(json.dumps(kept), encoding="utf-8")
    new.replace(path)
    return f"{sampler}, seed {seed}: {record.steps[-1].shifts} shifts"


def all_runs(
    samplers: Sequence[str], seeds: int, designs: int, jobs: int, folder: Path, *, kept: bool
) -> list[Run]:
    """Return the records of all searches; those that are kept are not run again.

    ``kept``: of those only.
    """
    paths = {
        (name, seed): folder / f"{name.replace(' ', '_').replace(',', '')}-{seed}-{designs}.json"
        for seed in range(1, seeds + 1)
        for name in samplers
    }
    if kept:
        paths = {key: path for key, path in paths.items() if path.exists()}
    with ProcessPoolExecutor(jobs, get_context("spawn"), max_tasks_per_child=1) as pool:
        left = [
            pool.submit(run_and_keep, *key, designs, path)
            for key, path in paths.items()
            if not path.exists()
        ]
        for done in as_completed(left):
            print(done.result(), flush=True)
    return [json.loads(path.read_text(encoding="utf-8")) for path in paths.values()]


def front_at(run: Run, shifts: int) -> list[Values]:
    """Return what a search declares once it has spent so many shifts."""
    spent = [step for step in run["steps"] if step["shifts"] <= shifts]
    return list(spent[-1]["front"]) if spent else []


def shifts_compared(most: int) -> list[int]:
    """Return the numbers of shifts at which fronts are compared."""
    return [round(most * share) for share in SHARES]


def emulated_front(study: Setup) -> list[Values]:
    """Return the front of a search over 20 000 designs by the surrogate that the package brings."""
    known = known_surrogate(study)
    if known is None:
        raise SystemExit("the package brings no surrogate for this physics")
    over, space, rng = (
        Over(known.surrogate, study_mix(study)),
        Space(search_space(study)),
        np.random.default_rng(1),
    )
    designs = _allowed(study, space, rng, WIDE, None)
    for _ in range(ROUNDS):
        best = [designs[k] for k in np.flatnonzero(_emulated(study, over, designs)[0])]
        designs = best + _allowed(study, space, rng, NEAR, best)
    kept, values = _emulated(study, over, designs)
    places = np.flatnonzero(kept)
    places = places[np.argsort(values[places, 0])]
    spread = np.unique(np.linspace(0, len(places) - 1, KEPT).astype(int))
    return [designs[k] for k in places[spread]]


def _allowed(
    study: Setup, space: Space, rng: np.random.Generator, size: int, near: list[Values] | None
) -> list[Values]:
    found: list[Values] = []
    while len(found) < size:
        params = space.drawn(rng, None if near is None else near[int(rng.integers(len(near)))])
        if worth_simulating(study, params):
            found.append(params)
    return found


def _emulated(study: Setup, over: Over, designs: Sequence[Values]) -> tuple[Any, Any]:
    """Return which designs no other dominates, and the losses of all, by the surrogate."""
    losses = exact_losses(study, designs)
    losses[:, 0] = over.predict(study.rows(designs))[0]
    order = np.lexsort((losses[:, 1], losses[:, 0]))
    shortest = np.minimum.accumulate(losses[order, 1])
    kept = np.zeros(len(losses), dtype=bool)
    kept[order] = np.concatenate([[True], losses[order[1:], 1] < shortest[:-1]])
    return kept, losses


class Truth:
    """Objectives of designs, densely simulated: (time in s, length in mm), inf if not feasible."""

    def __init__(self, study: Setup, folder: Path, jobs: int) -> None:
        self._study = study
        self._executor = Executor(ShiftJournal(folder / "dense.jsonl"), jobs)
        self._values: dict[Key, Array] = {}

    def learn(self, designs: Sequence[Values]) -> None:
        """Simulate designs that are not known yet."""
        study = self._study
        fresh = {self._key(d): d for d in designs if self._key(d) not in self._values}
        dogs = [study.dog_with(params) for params in fresh.values()]
        plans, seed = (
            [whole_plan(study, DENSE)] * len(dogs),
            study.file.expectation.seed + NEW_ANGLES,
        )
        found = evaluate(study, dogs, self._executor, plans, seed)
        for (key, params), one in zip(fresh.items(), found, strict=True):
            design = design_of(study, params, one.measured)
            told = values_of(study, design, {SIMULATED: one.expectation.mean})
            self._values[key] = np.array(told) if design.feasible else np.full(2, np.inf)

    def of(self, designs: Sequence[Values]) -> Array:
        """Return the objectives of designs that were simulated, (n, 2)."""
        return np.array([self._values[self._key(d)] for d in designs]).reshape(-1, 2)

    @property
    def all(self) -> Array:
        """Objectives of every design so far, (n, 2)."""
        return np.array([*self._values.values()])

    def _key(self, design: Values) -> Key:
        return tuple(design[name] for name in self._study.variables)


def print_shares(runs: Sequence[Run], shares: Mapping[tuple[str, int], Array], most: int) -> None:
    """Print the share of the reference's hypervolume by sampler and shifts."""
    counts = shifts_compared(most)
    print("share of the reference front's hypervolume, median of the seeds (least, largest)")
    print(f"{'shifts':<20}" + "".join(f"{count:>24}" for count in counts))
    for name in dict.fromkeys(run["sampler"] for run in runs):
        rows = np.array([share for (other, _), share in shares.items() if other == name])
        cells = [f"{np.median(c):.3f} ({c.min():.3f}, {c.max():.3f})" for c in rows.T]
        print(f"{name:<20}" + "".join(f"{cell:>24}" for cell in cells))


def print_costs(runs: Sequence[Run], most: int) -> None:
    """Print what the runs cost besides, medians over the seeds."""
    print(f"\nmedians at the end: shifts (of {most}), designs, proposals, minutes of one processor")
    for name in dict.fromkeys(run["sampler"] for run in runs):
        mine = [run for run in runs if run["sampler"] == name]
        last = [run["steps"][-1] for run in mine]
        shifts, designs, seconds = (
            np.median([step[key] for step in last]) for key in ("shifts", "designs", "cpu")
        )
        asked = np.median([run["asked"] for run in mine])
        print(f"{name:<20}{shifts:>8.0f}{designs:>8.0f}{asked:>8.0f}{seconds / 60:>8.1f}")


def print_races(shares: Mapping[tuple[str, int], Array], most: int) -> None:
    """Print for each seed this project's sampler against the best of Optuna's."""
    counts = shifts_compared(most)
    print("\nthis project's sampler less the best other of the same seed, at equal shifts;")
    print(f"last: at {counts[0]} shifts less the best other at {most}")
    for name in (*OWN, COMPILED):
        for seed in sorted({seed for other, seed in shares if other == name}):
            rivals = np.array(
                [shares[other, seed] for other in SAMPLERS if (other, seed) in shares]
            )
            if not len(rivals):
                continue
            own, best = shares[name, seed], rivals.max(axis=0)
            cells = "".join(f"{value:>+9.3f}" for value in own - best)
            print(f"{name:<20}seed {seed}{cells}   last {own[0] - best[-1]:+.3f}")


def main() -> None:
    """Run what is missing and print the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--designs", type=int, default=48)
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--out", type=Path, default=Path("build/samplers"))
    parser.add_argument("--kept", action="store_true", help="run nothing, tell what is kept")
    parser.add_argument("--only", nargs="*", default=[*SAMPLERS, *OWN, COMPILED])
    given = parser.parse_args()
    os.environ.update(dict.fromkeys(ONE_THREAD, "1"))
    given.out.mkdir(parents=True, exist_ok=True)
    runs = all_runs(given.only, given.seeds, given.designs, given.jobs, given.out, kept=given.kept)
    study = problem()
    most = SHIFTS * given.designs
    fronts = {
        (run["sampler"], run["seed"]): [front_at(run, count) for count in shifts_compared(most)]
        for run in runs
    }
    truth = Truth(study, given.out, given.jobs)
    truth.learn([study.prototype, *emulated_front(study)])
    emulated = truth.all[1:]
    truth.learn([design for front in fronts.values() for part in front for design in part])
    beyond = BEYOND * truth.of([study.prototype])[0]
    reference = hypervolume(truth.all, beyond)
    shares = {
        key: np.array([hypervolume(truth.of(part), beyond) / reference for part in front])
        for key, front in fronts.items()
    }
    by_surrogate = hypervolume(emulated, beyond) / reference
    print(f"{len(truth.all)} designs simulated densely; prototype "
          f"{truth.all[0, 0] * 1e3:.1f} ms, {truth.all[0, 1]:.2f} mm")  # fmt: skip
    print(f"reference: front of {int(not_dominated(truth.all).sum())} designs, best of all here; "
          f"the search by the surrogate alone has {by_surrogate:.3f} of it\n")  # fmt: skip
    print_shares(runs, shares, most)
    print_races(shares, most)
    print_costs(runs, most)


if __name__ == "__main__":
    main()
