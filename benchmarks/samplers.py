"""Samplers compared: how much of the front each finds, by shifts and by time.

    python -m benchmarks.samplers [--seeds N] [--designs N] [--jobs N] [--out DIR]

The paper's study's objectives and constraints at six of its operating points; of a hundred landings
one may be harder than the checks take. ``benchmarks/sampler_runs.py`` says how each sampler is run
and what it is given. All begin with the same ten designs, none knows what the package brings, and
each may spend the same number of shifts of Drake. Each run has a processor to itself.

A front is what a search declares once it has spent so many shifts of Drake, or so many minutes of a
processor with compiled shifts and proposals: designs that pass every check and that no other
dominates, as far as it knows. The minutes compared are those that the best of Optuna's samplers
took for all of its shifts, and a quarter of them.

All designs of these fronts are simulated again at new angles, by the compiled engine at 64 of each
operating point; Drake at one of the same says what its times are off by in the mean of all designs,
which is printed. Those whose dogs land too hard there are left out. What is told is the hypervolume
of the rest up to a quarter beyond the prototype, as a share of that of the reference front: the
best of all designs that were simulated so, among them the front of a search over 20 000 designs by
the surrogate that the package brings.

Finished runs are kept in a folder and not run again, and so are designs that were simulated again.
Takes half an hour of a processor; needs the extra ``gp``.
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

from benchmarks.sampler_runs import OWN, SAMPLERS, Values, problem, search
from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.search.dog_guide import search_space
from dogshape.pipeline.search.repair import simulated_levels
from dogshape.pipeline.search.unit_cube import Space
from dogshape.pipeline.simulate.design import (
    SIMULATED,
    design_of,
    exact_losses,
    values_of,
    worth_simulating,
)
from dogshape.pipeline.simulate.evaluation import NEW_ANGLES
from dogshape.pipeline.simulate.executor import scratch_executor
from dogshape.pipeline.train.found_surrogates import known_surrogate
from dogshape.pipeline.train.training_rows import study_mix
from dogshape.surrogate.covariance import Array
from dogshape.surrogate.expected_time import Over
from dogshape.surrogate.hypervolume import hypervolume, not_dominated

SHIFTS = 24  #: of a whole design
PAIRS, DENSE = 1, 64  #: new angles at each operating point of a declared design: Drake, compiled
SHARES = (0.2, 1.0)  #: of all shifts of Drake, at which fronts are compared
PARTS = (0.25, 1.0)  #: of the processor time of the best of Optuna's, at which fronts are compared
BEYOND = 1.25  #: the hypervolume's reference point, over the prototype's time and length
WIDE, NEAR, ROUNDS = 8000, 3000, 4  #: designs of the search by the surrogate: wide, near, rounds
KEPT = 24  #: designs of its front that are simulated
ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")

Run = dict[str, Any]
Key = tuple[float, ...]
Shares = Mapping[tuple[str, int], Array]  #: by sampler and seed, one for each column


def run_and_keep(sampler: str, seed: int, designs: int, path: Path) -> str:
    """Run a search and keep its record."""
    record = search(sampler, seed, designs)
    kept = {"sampler": sampler, "seed": seed, "shifts": SHIFTS * designs, **asdict(record)}
    new = path.with_suffix(".new")
    new.write_text(json.dumps(kept), encoding="utf-8")
    new.replace(path)
    return f"{sampler}, seed {seed}: {record.steps[-1].shifts} shifts"


def all_runs(seeds: int, designs: int, jobs: int, folder: Path) -> list[Run]:
    """Return the records of all searches; those that are kept are not run again."""
    paths = {
        (name, seed): folder / f"{name.replace(' ', '_').replace(',', '')}-{seed}-{designs}.json"
        for seed in range(1, seeds + 1)
        for name in (*SAMPLERS, OWN)
    }
    with ProcessPoolExecutor(jobs, get_context("spawn"), max_tasks_per_child=1) as pool:
        left = [
            pool.submit(run_and_keep, *key, designs, path)
            for key, path in paths.items()
            if not path.exists()
        ]
        for done in as_completed(left):
            print(done.result(), flush=True)
    return [json.loads(path.read_text(encoding="utf-8")) for path in paths.values()]


def front_at(run: Run, key: str, most: float) -> list[Values]:
    """Return the front of a search once it has spent so many ``shifts``, or s of ``cpu``."""
    spent = [step for step in run["steps"] if step[key] <= most]
    return list(spent[-1]["front"]) if spent else []


def shifts_compared(most: int) -> list[int]:
    """Return the numbers of shifts at which fronts are compared."""
    return [round(most * share) for share in SHARES]


def minutes_of(run: Run) -> float:
    """Return the minutes of a processor that a run took in all."""
    return float(run["steps"][-1]["cpu"]) / 60.0


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
    """Objectives of designs at new angles: (time in s, length in mm), inf if not feasible.

    By many compiled shifts. ``apart`` is what Drake's times are more at some of the same angles,
    over the expected time. What is known is kept in ``truth.jsonl`` of a folder.
    """

    def __init__(self, folder: Path, jobs: int) -> None:
        seed = problem().file.expectation.seed + NEW_ANGLES
        self._study = problem(
            f"expectation.seed={seed}", "search.levels=2", f"search.pair_angles={PAIRS}",
            f"search.screen_angles={DENSE}",
        )  # fmt: skip
        self._executor = scratch_executor(jobs)
        self._path = folder / "truth.jsonl"
        self._values: dict[Key, Array] = {}
        self.apart: list[float] = []
        if self._path.exists():
            for line in self._path.read_text(encoding="utf-8").splitlines():
                known = json.loads(line)
                self._take(tuple(known["design"]), known)

    def learn(self, designs: Sequence[Values]) -> None:
        """Simulate designs that are not known yet."""
        study = self._study
        fresh = {self._key(d): d for d in designs if self._key(d) not in self._values}
        for key, params in fresh.items():
            found = simulated_levels(study, params, self._executor, PAIRS, DENSE)
            design = design_of(study, params, found.measured)
            levels = found.levels
            assert levels is not None
            told = values_of(study, design, {SIMULATED: levels.compiled})
            values = told if design.feasible else [np.inf, np.inf]
            known = {"values": values, "apart": levels.correction / levels.compiled}
            self._take(key, known)
            with self._path.open("a", encoding="utf-8") as kept:
                kept.write(json.dumps({"design": key, **known}) + "\n")

    def _take(self, key: Key, known: Mapping[str, Any]) -> None:
        self._values[key] = np.array(known["values"])
        self.apart.append(known["apart"])

    def of(self, designs: Sequence[Values]) -> Array:
        """Return the objectives of designs that were simulated, (n, 2)."""
        return np.array([self._values[self._key(d)] for d in designs]).reshape(-1, 2)

    def _key(self, design: Values) -> Key:
        return tuple(design[name] for name in self._study.variables)


def best_other(runs: Sequence[Run], truth: Truth, beyond: Array, most: int) -> str:
    """Return the sampler of Optuna's whose front after all shifts is best in the median."""
    found: dict[str, list[float]] = {}
    for run in runs:
        if run["sampler"] in SAMPLERS:
            volume = hypervolume(truth.of(front_at(run, "shifts", most)), beyond)
            found.setdefault(run["sampler"], []).append(volume)
    return max(found, key=lambda name: float(np.median(found[name])))


def print_shares(names: Sequence[str], shares: Shares, columns: Sequence[str]) -> None:
    """Print the share of the reference's hypervolume by sampler and what was spent."""
    print("\nshare of the reference front's hypervolume, median of the seeds (least, largest)")
    print(f"{'':<18}" + "".join(f"{column:>23}" for column in columns) + "  seeds")
    for name in names:
        rows = np.array([share for (other, _), share in shares.items() if other == name])
        cells = [f"{np.median(c):.3f} ({c.min():.3f}, {c.max():.3f})" for c in rows.T]
        print(f"{name:<18}" + "".join(f"{cell:>23}" for cell in cells) + f"{len(rows):>7d}")


def print_costs(runs: Sequence[Run], names: Sequence[str], truth: Truth, most: int) -> None:
    """Print what the runs cost, and how many of the designs they declare hold."""
    print(f"\nmedians at the end: shifts of Drake (of {most}), compiled ones, simulated designs,")
    print("proposals, minutes of a processor; of all that the seeds declare, what holds at new")
    print("angles")
    for name in names:
        mine = [run for run in runs if run["sampler"] == name]
        last = [run["steps"][-1] for run in mine]
        shifts, compiled, designs = (
            np.median([step.get(key, 0) for step in last])
            for key in ("shifts", "compiled", "designs")
        )
        asked, minutes = (
            np.median(values)
            for values in ([run["asked"] for run in mine], [minutes_of(run) for run in mine])
        )
        declared = truth.of([d for run in mine for d in front_at(run, "shifts", most)])
        held = int(np.isfinite(declared[:, 0]).sum())
        print(
            f"{name:<18}{shifts:>7.0f}{compiled:>9.0f}{designs:>6.0f}{asked:>7.0f}{minutes:>7.1f}"
            f"{held:>6d} of {len(declared)}"
        )


def print_races(shares: Shares, columns: Sequence[str], most: int) -> None:
    """Print for each seed the search in two levels against the best of Optuna's samplers."""
    first, second = shifts_compared(most)
    print(f"\n{OWN}, less the best of Optuna's samplers at the same seed; last column: at {first}")
    print(f"shifts less the best other at {second}")
    print(f"{'':<18}" + "".join(f"{column:>15}" for column in columns) + f"{'last':>9}")
    for seed in sorted({seed for name, seed in shares if name == OWN}):
        rivals = [shares[name, seed] for name in SAMPLERS if (name, seed) in shares]
        if rivals:
            own, best = shares[OWN, seed], np.array(rivals).max(axis=0)
            cells = "".join(f"{value:>+15.3f}" for value in own - best)
            print(f"seed {seed:<13}{cells}{own[0] - best[1]:>+9.3f}")


def main() -> None:
    """Run what is missing and print the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--designs", type=int, default=48)
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--out", type=Path, default=Path("build/samplers"))
    given = parser.parse_args()
    os.environ.update(dict.fromkeys(ONE_THREAD, "1"))
    given.out.mkdir(parents=True, exist_ok=True)
    runs = all_runs(given.seeds, given.designs, given.jobs, given.out)
    tell(runs, SHIFTS * given.designs, Truth(given.out, given.jobs))


def tell(runs: Sequence[Run], most: int, truth: Truth) -> None:
    """Judge the fronts of all runs and print the tables."""
    study, counts = problem(), shifts_compared(most)
    emulated = emulated_front(study)
    truth.learn([study.prototype, *emulated])
    beyond = BEYOND * truth.of([study.prototype])[0]
    fronts = {
        (run["sampler"], run["seed"]): [front_at(run, "shifts", count) for count in counts]
        for run in runs
    }
    truth.learn([design for parts in fronts.values() for part in parts for design in part])
    best = best_other(runs, truth, beyond, most)
    whole = float(np.median([minutes_of(run) for run in runs if run["sampler"] == best]))
    minutes = [part * whole for part in PARTS]
    for run in runs:
        later = [front_at(run, "cpu", 60.0 * part) for part in minutes]
        truth.learn([design for part in later for design in part])
        fronts[run["sampler"], run["seed"]] += later
    told = [study.prototype, *emulated, *(d for f in fronts.values() for part in f for d in part)]
    values = truth.of(told)
    reference = hypervolume(values, beyond)
    shares = {
        key: np.array([hypervolume(truth.of(part), beyond) / reference for part in parts])
        for key, parts in fronts.items()
    }
    by_surrogate = hypervolume(truth.of(emulated), beyond) / reference
    prototype, simulated = truth.of([study.prototype])[0], np.unique(values, axis=0)
    front = int(not_dominated(simulated).sum())
    print(f"prototype {prototype[0] * 1e3:.1f} ms, {prototype[1]:.2f} mm; reference: front of "
          f"{front} designs, best of all here; the search by")  # fmt: skip
    print(f"the surrogate alone has {by_surrogate:.3f} of it; minutes compared are those of {best}")
    apart, error = np.mean(truth.apart), np.std(truth.apart) / len(truth.apart) ** 0.5
    print(f"times of Drake less those of the compiled engine, mean of {len(truth.apart)} designs: "
          f"{1e2 * apart:+.3f} +- {1e2 * error:.3f} %")  # fmt: skip
    columns = [f"{count} shifts" for count in counts] + [f"{part:.2f} min" for part in minutes]
    names = [*dict.fromkeys(run["sampler"] for run in runs)]
    print_shares(names, shares, columns)
    print_races(shares, columns, most)
    print_costs(runs, names, truth, most)


if __name__ == "__main__":
    main()
