"""The surrogate of a clutch that was never seen, from the compiled engine that Drake corrects.

    python -m benchmarks.two_fidelities [--clutch NAME ...] [--designs N ...] [--contact SET]

Fits a clutch as ``dogshape fit --levels 2`` does, without the rows that the package brings.
References that no fit saw, 40 that fill the space and 20 of the best tenth, judge

- ``all points``: designs at all of the study's operating points, more and more of them, the last
  with those that were chosen as likely to be among the best, which is what ``fit`` has;
- ``own points``: what the rows at operating points of their own say without these;
- ``bundled``: the surrogate that the package brings, where it has one of the clutch;
- ``one engine``: rows as ``--levels 1`` has them, of as many designs as Drake simulates in the
  processor time of all that is learnt from. They are rows of the compiled engine, whose means are
  Drake's to the discrepancy that is printed, and Drake's time of a shift is that of the pairs.

Three ways to correct the rows at points of their own are compared with few designs:

- ``parametric``: by a constant and a slope over the mismatch, as ``fit`` does;
- ``process``: by a Gaussian process of the pairs over design and operating point, which is
  co-kriging with a scale of one (Kennedy & O'Hagan 2000);
- ``uncorrected``: rows as they are.

Shifts are kept in ``results/two_fidelities-NAME-SET`` with the processor times of the run that
simulated them, and a second run simulates none.
"""

from __future__ import annotations

import argparse
import time
import warnings
from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
from sklearn.exceptions import ConvergenceWarning
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import ConstantKernel, Matern

from dogshape.pipeline.config.study_file import Setup, load_study
from dogshape.pipeline.simulate.executor import Executor
from dogshape.pipeline.store.folder import StudyFolder, read_json, write_json
from dogshape.pipeline.store.journal import ShiftJournal
from dogshape.pipeline.train.filling import first_designs
from dogshape.pipeline.train.mix_rows import angles_of, count_of, simulate_mix_rows
from dogshape.pipeline.train.training import fill, references_of, train
from dogshape.pipeline.train.training_rows import dataset_of, study_mix
from dogshape.pipeline.train.two_level_rows import (
    DENSE,
    Times,
    compiled,
    pair_blocks,
    pairs_of,
    row_blocks,
    row_designs,
    times_of,
    two_level_data,
)
from dogshape.sim.statistics.shift_records import Record
from dogshape.surrogate.covariance import Array
from dogshape.surrogate.dataset import DIGITS, WHERE, Dataset
from dogshape.surrogate.discrepancy import ERROR, MEAN, SPREAD, Discrepancy, discrepancy_of
from dogshape.surrogate.learning import fit
from dogshape.surrogate.mix_learning import fitted, mix_times
from dogshape.surrogate.model import MIN_DESIGNS, Surrogate
from dogshape.surrogate.process_targets import point_coordinates
from dogshape.surrogate.references import Reference
from dogshape.surrogate.validation_figures import (
    Validation,
    figures,
    predict,
    rank_correlation,
    ranked,
)

HEAD = (
    "rows          designs  rmse,ms  bias,ms  Q2     in 95 %  Q2 points  in 95 %  rank of best"
    "  fit,s"
)
DRAWS = 1000  #: of the errors of references
FEW_DESIGNS = 40  #: with which ways to correct are compared
REFERENCE_ERROR = 0.003  #: relative standard error of the expected time of a reference
SEED = 20  #: of designs, angles and references: no form or number was chosen by these
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


def judged(
    study: Setup, apart: tuple[Reference, Reference], model: Surrogate, shifts: int
) -> Validation:
    """Judge a surrogate by references that fill the space, and by those of the best."""
    space, best = apart
    mix = study_mix(study)
    found = figures(space, predict(model, space.x, mix), "references", shifts)
    return ranked(found, best, predict(model, best.x, mix).time) if len(best) else found


def ceiling(best: Reference) -> float:
    """Compute the rank correlation that exact times have with references, by their errors.

    The mean over draws: true times are the references' with as much less scatter as errors add.
    """
    rng, about = np.random.default_rng(0), best.time - best.time.mean()
    unsure = float((best.error**2).mean())
    true = about * max(0.0, 1.0 - unsure / float(about.var())) ** 0.5
    drawn = true + best.error * rng.standard_normal((DRAWS, len(true)))
    return float(np.mean([rank_correlation(true, one) for one in drawn]))


@contextmanager
def counted(path: Path, part: str) -> Iterator[dict[str, float]]:
    """Add the processor time of a part, s, to those of the runs before that were stopped."""
    spent: dict[str, float] = read_json(path, "remove it") if path.exists() else {}
    begun = time.process_time()
    try:
        yield spent
    finally:
        spent[part] = spent.get(part, 0.0) + time.process_time() - begun
        write_json(path, spent)


def simulate(study: Setup, folder: StudyFolder) -> dict[str, float]:
    """Simulate a clutch and give processor times in s, by part; go on where a run was stopped.

    ``learnt`` is that of all that is learnt from, with Drake's ``pairs``.
    """
    designs, kept = row_designs(study), folder.root / "seconds.json"
    made = [0]

    def count(shifts: int) -> None:
        made[0] += shifts

    with folder.writing():
        folder.open(study, resume=True)
        executor = Executor(ShiftJournal(folder.compiled), 1, quick=count)
        with counted(kept, "rows"):
            executor.run(row_blocks(study, designs))
        with counted(kept, "pairs"):
            Executor(ShiftJournal(folder.pairs), 1).run(pair_blocks(study, designs))
        with counted(kept, "mixed") as spent:
            try:
                simulate_mix_rows(compiled(study), folder, executor)
            finally:
                spent["made"] = spent.get("made", 0.0) + made[0]
    with counted(kept, "references"):
        fill(study, folder, 1, levels=2)
    found: dict[str, float] = read_json(kept, "remove the folder and run again")
    every = count_of(study) * angles_of(study) * len(study.points)
    # What a run simulated and had not written when it was stopped counts as made, too.
    mixed = found["mixed"] * every / found["made"]
    return found | {"learnt": found["rows"] + found["pairs"] + mixed}


def halved(shifts: list[Record], names: list[str]) -> list[Record]:
    """Select every second angle of each row, so that those that are left are even again."""
    groups: dict[tuple[float, ...], list[Record]] = defaultdict(list)
    for shift in shifts:
        groups[tuple(shift[name] for name in (*names, *WHERE))].append(shift)
    return [
        shift
        for group in groups.values()
        for shift in sorted(group, key=lambda one: float(one["relative_angle_deg"]))[::DENSE]
    ]


def compare(study: Setup, folder: StudyFolder, counts: list[int]) -> None:
    """Simulate a clutch, fit it in all ways, judge and print."""
    seconds = simulate(study, folder)
    begun = time.process_time()
    whole = train(folder).surrogate
    fitting = time.process_time() - begun
    data, mixed = two_level_data(study, folder)
    apart = references_of(study, folder)
    _say_data(folder, (study.name, apart), whole, seconds | {"fits": fitting})
    cheap = list(ShiftJournal(folder.compiled).rows.values())
    dear = list(ShiftJournal(folder.pairs).rows.values())
    theirs = times_of(study, dear)
    ours = {k: v for k, v in times_of(compiled(study), cheap).items() if k in theirs}
    _say_discrepancy(discrepancy_of(pairs_of(ours, theirs)))
    print(HEAD)

    def say(name: str, designs: int, model: Surrogate, spent: float, shifts: int) -> None:
        print(line(name, designs, judged(study, apart, model, shifts), spent), flush=True)

    size, every = len(study.points), count_of(study)
    for count in [*(n for n in sorted(counts) if n < every), every]:
        begun = time.process_time()
        rows = mixed.rows[: count * size]
        own = fitted(mix_times(data, rows, study_mix(study)))
        say("all points", count, replace(whole, own=own), time.process_time() - begun, own.shifts)
    say("own points", len(data.designs), replace(whole, own=None), 0.0, data.shifts)
    for way, correct in WAYS.items():
        some = dataset_of(compiled(study), first(study, cheap, FEW_DESIGNS))
        kept = {tuple(np.round(x, DIGITS)) for x in some.designs.tolist()}
        own_pairs = {place: times for place, times in theirs.items() if place[0] in kept}
        say(way, FEW_DESIGNS, *_fitted(study, correct(some, ours, own_pairs)))
    settings = study.file.surrogate
    a_design = seconds["pairs"] / len(dear) * settings.points * settings.angles
    number = max(MIN_DESIGNS, round(seconds["learnt"] / a_design))
    few = halved(first(study, cheap, number), list(study.variables))
    say("one engine", number, *_fitted(study, dataset_of(compiled(study), few)))
    print()


def _fitted(study: Setup, rows: Dataset) -> tuple[Surrogate, float, int]:
    """Fit rows at points of their own; give the processor time, s, and the shifts, too."""
    begun = time.process_time()
    model = fit(replace(rows, physics=study.physics))
    return model, time.process_time() - begun, rows.shifts


def _say_data(
    folder: StudyFolder,
    named: tuple[str, tuple[Reference, Reference]],
    model: Surrogate,
    seconds: dict[str, float],
) -> None:
    name, (space, best) = named
    apart = len(ShiftJournal(folder.references).rows)
    dense = len(ShiftJournal(folder.compiled_references).rows)
    error = float(np.sqrt((space.error**2).mean()))
    levels = model.data.levels
    print(f"{name}: {levels['planar']} shifts compiled, {levels['drake']} of Drake in pairs")
    print(f"references: {len(space)} that fill the space and {len(best)} of the best tenth,")
    print(f"{dense} shifts compiled and {apart} of Drake; s.e. of a time {error * 1e3:.2f} ms")
    print(f"rank of the best that exact times would have: {ceiling(best):.2f}")
    print(
        f"processor time {seconds['learnt']:.0f} s of rows and pairs, "
        f"{seconds['references']:.0f} s of references, {seconds['fits']:.0f} s of fits"
    )
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


def study_of(clutch: str, contact: str) -> Setup:
    """Return the study of a clutch: denser references than a fit makes."""
    more: dict[str, object] = {
        "name": f"two_fidelities-{clutch}-{contact}",
        "contact.set": contact,
        "surrogate.reference_error": REFERENCE_ERROR,
        "surrogate.seed": SEED,
    }
    return load_study("mq200_paper", CLUTCHES[clutch] | more)


def main() -> None:
    """Compare the clutches that are asked for."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--clutch", choices=CLUTCHES, nargs="+", default=list(CLUTCHES))
    parser.add_argument("--designs", type=int, nargs="+", default=[100, 200, 300])
    parser.add_argument("--contact", default="lubricated_steel")
    given = parser.parse_args()
    for clutch in given.clutch:
        study = study_of(clutch, given.contact)
        compare(study, StudyFolder(Path("results") / study.name), given.designs)


if __name__ == "__main__":
    main()
