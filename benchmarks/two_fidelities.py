"""The surrogate from rows of the compiled engine that pairs with Drake correct.

    python -m benchmarks.two_fidelities [--clutch NAME ...] [--designs N ...] [--contact SET]

Fits a clutch as ``dogshape fit --levels 2`` does, without the rows that the package brings, with
the first designs of its filling, more and more of them. References in two levels judge each fit;
each has Drake's shifts of its own. At every number of designs three ways are compared:

- ``parametric``: rows corrected by a constant and a slope over the mismatch, as ``fit`` does;
- ``process``: rows corrected by a Gaussian process of the pairs over design and operating point,
  which is co-kriging with a scale of one (Kennedy & O'Hagan 2000);
- ``uncorrected``: rows as they are.

``Drake alone`` has as many designs in Drake as take the processor time of the rows and pairs of
the most designs. Shifts are kept in ``results/two_fidelities-NAME-SET``, and a second run simulates
none: processor times are of a run that finds none.
"""

from __future__ import annotations

import argparse
import time
import warnings
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
from sklearn.exceptions import ConvergenceWarning
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import ConstantKernel, Matern

from dogshape.pipeline.config.study_file import Setup, load_study
from dogshape.pipeline.simulate.executor import Executor
from dogshape.pipeline.store.folder import StudyFolder
from dogshape.pipeline.store.journal import ShiftJournal
from dogshape.pipeline.train.filling import filling_blocks, first_designs
from dogshape.pipeline.train.training import fill, references_of
from dogshape.pipeline.train.training_rows import dataset_of, study_mix
from dogshape.pipeline.train.two_level_rows import (
    Times,
    compiled,
    pair_blocks,
    pairs_of,
    row_blocks,
    times_of,
)
from dogshape.sim.statistics.shift_records import Record
from dogshape.surrogate.covariance import Array
from dogshape.surrogate.dataset import DIGITS, Dataset
from dogshape.surrogate.discrepancy import ERROR, MEAN, SPREAD, Discrepancy, discrepancy_of
from dogshape.surrogate.learning import fit
from dogshape.surrogate.model import MIN_DESIGNS
from dogshape.surrogate.process_targets import point_coordinates
from dogshape.surrogate.validation_figures import Validation, figures, predict, ranked

HEAD = (
    "rows          designs  rmse,ms  bias,ms  Q2     in 95 %  Q2 points  in 95 %  rank of best"
    "  fit,s"
)
POINTS = {"operating.mismatch_rpm": [5.0, 25.0, 100.0, 249.0]}
CLUTCHES: dict[str, dict[str, object]] = {
    "prototype": {},
    "small": {
        "dog.outer_diameter_mm": 40.0,
        "dog.inner_diameter_mm": 33.0,
        "dog.count": 12,
        "dog.height_mm": 3.0,
        "sliding.mass_kg": 0.15,
        "sliding.inertia_kgm2": 0.003,
        "output.inertia_kgm2": 0.2,
        "load.torque_Nm": 90.0,
        "actuation.force_N": [120.0, 350.0],
        "actuation.rise_s": [0.22, 0.13],
        "operating.force_N": [120.0, 350.0],
        **POINTS,
    },
    "large": {
        "dog.outer_diameter_mm": 92.0,
        "dog.inner_diameter_mm": 78.0,
        "dog.count": 18,
        "dog.height_mm": 5.0,
        "sliding.mass_kg": 1.1,
        "sliding.inertia_kgm2": 0.06,
        "output.inertia_kgm2": 4.0,
        "load.torque_Nm": 800.0,
        "load.separating_force_limit_N": 12000.0,
        "actuation.force_N": [500.0, 1500.0],
        "actuation.rise_s": [0.22, 0.15],
        "operating.force_N": [500.0, 1500.0],
        **POINTS,
    },
}  #: settings of clutches upon ``mq200_paper``


def parametric(rows: Dataset, cheap: Times, dear: Times) -> Dataset:
    """Correct rows by a constant and a slope over the mismatch."""
    return discrepancy_of(pairs_of(cheap, dear)).corrected(rows)


def process(rows: Dataset, cheap: Times, dear: Times) -> Dataset:
    """Correct rows by a Gaussian process of what the parametric discrepancy leaves of the pairs."""
    places = [place for place in sorted(dear) if pairs_of(cheap, {place: dear[place]})]
    pairs = pairs_of(cheap, {place: dear[place] for place in places})
    common = discrepancy_of(pairs)
    mismatch = np.array([pair.mismatch for pair in pairs])
    left = np.array([pair.difference for pair in pairs]) - common.at(mismatch)[0]
    # Of few angles some pairs have no scatter by luck: all share the mean of the variances.
    noise = max(float(np.mean([pair.variance for pair in pairs])), 1e-8)
    x = _coordinates(
        rows,
        np.array([design for design, _ in places]),
        np.array([where[:2] for _, where in places]),
    )
    size = x.shape[1]
    kernel = ConstantKernel(1e-4, (1e-8, 1e-1)) * Matern([1.0] * size, (0.1, 30.0), nu=2.5)
    known = GaussianProcessRegressor(kernel, alpha=noise, random_state=0)
    with warnings.catch_warnings():
        # A parameter at its bound only says that nothing depends on the coordinate.
        warnings.simplefilter("ignore", ConvergenceWarning)
        known.fit(x, left)
    more, error = known.predict(_coordinates(rows, rows.x, rows.points), return_std=True)
    return _scaled(rows, common, more, error)


def uncorrected(rows: Dataset, cheap: Times, dear: Times) -> Dataset:
    """Return rows as they are."""
    return rows


WAYS: dict[str, Callable[[Dataset, Times, Times], Dataset]] = {
    "parametric": parametric,
    "process": process,
    "uncorrected": uncorrected,
}


def _coordinates(rows: Dataset, x: Array, points: Array) -> Array:
    return np.column_stack([rows.scaled(x), point_coordinates(points)])


def _scaled(rows: Dataset, common: Discrepancy, more: Array, error: Array) -> Dataset:
    """Return rows with the factor of both discrepancies, and the error of the second."""
    values, first = rows.rows.copy(), len(rows.variables)
    factor = np.exp(common.at(rows.points[:, 0])[0] + more)
    for column in (MEAN, SPREAD, ERROR):
        values[:, first + column] *= factor
    values[:, first + ERROR] = np.hypot(values[:, first + ERROR], error * values[:, first + MEAN])
    return replace(rows, rows=values)


def line(name: str, designs: int, v: Validation, seconds: float) -> str:
    """Format the figures of one fit."""
    rank = "-" if v.rank_best is None else f"{v.rank_best:.2f}"
    return (
        f"{name:12s}  {designs:7d}  {v.rmse_s * 1e3:7.2f}  {v.bias_s * 1e3:+7.2f}  {v.q2:.3f}"
        f"  {v.coverage_95:7.0%}  {v.q2_points:9.3f}  {v.coverage_points:7.0%}  {rank:>12s}"
        f"  {seconds:5.0f}"
    )


def first(study: Setup, shifts: list[Record], count: int) -> list[Record]:
    """Return the shifts of the first ``count`` designs of the filling."""
    names = list(study.variables)
    kept = {tuple(d[name] for name in names) for d in first_designs(study, count)}
    # A shift's record has gone through SI, which may cost the last digit.
    return [s for s in shifts if tuple(round(s[name], 3) for name in names) in kept]


def judged(study: Setup, folder: StudyFolder, rows: Dataset) -> tuple[Validation, float]:
    """Fit rows, and judge the fit by the folder's references; with the fit's processor time, s."""
    begun = time.process_time()
    model = fit(replace(rows, physics=study.physics))
    seconds = time.process_time() - begun
    space, best = references_of(study, folder)
    mix = study_mix(study)
    found = figures(space, predict(model, space.x, mix), "references", rows.shifts)
    if len(best):
        found = ranked(found, best, predict(model, best.x, mix).time)
    return found, seconds


def simulate(study: Setup, folder: StudyFolder) -> float:
    """Simulate rows and pairs, without references; return the processor time, s."""
    designs, begun = first_designs(study, study.file.surrogate.designs), time.process_time()
    with folder.writing():
        folder.open(study, resume=True)
        Executor(ShiftJournal(folder.compiled), 1).run(row_blocks(study, designs))
        Executor(ShiftJournal(folder.pairs), 1).run(pair_blocks(study, designs))
    return time.process_time() - begun


def alone(study: Setup, folder: StudyFolder, seconds: float) -> Dataset:
    """Simulate in Drake what takes this processor time, at least the designs that a fit needs."""
    journal = ShiftJournal(folder.root / "alone.jsonl")
    executor, begun = Executor(journal, 1), time.process_time()
    for count, design in enumerate(first_designs(study, study.file.surrogate.designs)):
        if count >= MIN_DESIGNS and time.process_time() - begun >= seconds:
            break
        executor.run(filling_blocks(study, design, count, study.file.surrogate.seed))
    return dataset_of(study, journal.rows.values())


def compare(study: Setup, folder: StudyFolder, counts: list[int]) -> None:
    """Simulate a clutch, fit it in all ways, judge and print."""
    seconds = simulate(study, folder)
    fill(study, folder, 1, levels=2)
    cheap = list(ShiftJournal(folder.compiled).rows.values())
    dear = list(ShiftJournal(folder.pairs).rows.values())
    ours, theirs = times_of(compiled(study), cheap), times_of(study, dear)
    _say_data(study, folder, (len(cheap), len(dear)), seconds)
    _say_discrepancy(discrepancy_of(pairs_of(ours, theirs)))
    print(HEAD)
    for count in sorted(counts):
        rows = dataset_of(compiled(study), first(study, cheap, count))
        kept = {tuple(np.round(x, DIGITS)) for x in rows.designs.tolist()}
        own = {place: times for place, times in theirs.items() if place[0] in kept}
        for way, correct in WAYS.items():
            print(line(way, count, *judged(study, folder, correct(rows, ours, own))), flush=True)
    data = alone(study, folder, seconds)
    print(line("Drake alone", len(data.designs), *judged(study, folder, data)))
    print()


def _say_data(study: Setup, folder: StudyFolder, shifts: tuple[int, int], seconds: float) -> None:
    space, best = references_of(study, folder)
    apart = len(ShiftJournal(folder.references).rows)
    dense = len(ShiftJournal(folder.compiled_references).rows)
    error = float(np.sqrt((space.error**2).mean()))
    print(f"{study.name}: {shifts[0]} shifts compiled, {shifts[1]} of Drake in pairs")
    print(f"references: {len(space)} that fill the space and {len(best)} of the best tenth,")
    print(f"{dense} shifts compiled and {apart} of Drake; s.e. of a time {error * 1e3:.2f} ms")
    print(f"processor time of rows and pairs {seconds:.0f} s")
    print()


def _say_discrepancy(found: Discrepancy) -> None:
    said = found.as_dict()
    print(f"ln Drake - ln compiled: {said['constant']:+.3%} (s.e. {said['constant_error']:.3%})")
    if said["slope"] is not None:
        print(f"  {said['slope']:+.3%} (s.e. {said['slope_error']:.3%}) for each e of mismatch")
    print(f"  scatter beyond sampling {found.scatter:.3%}, of {found.pairs} pairs of means")
    left = ", ".join(f"{error:.3%} ({name})" for name, error in said["left_out_rms"].items())
    print(f"  pairs left out are missed by {left}")
    print()


def main() -> None:
    """Compare the clutches that are asked for."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--clutch", choices=CLUTCHES, nargs="+", default=list(CLUTCHES))
    parser.add_argument("--designs", type=int, nargs="+", default=[60, 125, 250, 500])
    parser.add_argument("--contact", default="lubricated_steel")
    parser.add_argument("--references", type=int, default=28, help="that fill the space")
    given = parser.parse_args()
    for clutch in given.clutch:
        name = f"two_fidelities-{clutch}-{given.contact}"
        settings = CLUTCHES[clutch] | {
            "name": name,
            "contact.set": given.contact,
            "surrogate.designs": max(given.designs),
            "surrogate.references": given.references,
            "surrogate.best_references": 12,
        }
        compare(
            load_study("mq200_paper", settings), StudyFolder(Path("results") / name), given.designs
        )


if __name__ == "__main__":
    main()
