"""Field set that was scored, diagnosed once more with its engines' baselines told.

    python -m benchmarks.field_told DIR [--jobs N] [--most N]

The headline of a field set is of a diagnosis that is told nothing, as no bench could tell it. This
says what a diagnosis makes of the same data that knows what the mean times of each engine are
without any effect, which the opened key has: they are added to all predictions, and what is left
where effects act has a scale of 3 % instead of 5 % (``validation.blind.engine_gap``). What both
columns miss is no fault of a wrong baseline. Not sealed: the key is open. Finished cases are kept
in DIR/told; ``--most`` takes the first N cases only.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np

from dogshape.diagnosis.bench.bench_data import Bench, load_bench
from dogshape.diagnosis.diagnosis import Diagnosis, Ranked, diagnose_wider, ranked
from dogshape.diagnosis.prediction.bank import settings_of
from dogshape.diagnosis.prediction.hypotheses import NONE
from dogshape.diagnosis.settings import Settings
from dogshape.diagnosis.terms import Array
from dogshape.pipeline.cli.tables.blind_tables import figure_text
from dogshape.pipeline.diagnose.bank_diagnosis import Means, emulator_of, with_bank_engine
from dogshape.sim.effect import Effect
from dogshape.sim.effects import load
from dogshape.sim.errors import DataError
from dogshape.validation.blind.engine_gap import RULES, Moved
from dogshape.validation.blind.field_figures import HEADLINES
from dogshape.validation.blind.field_score import field_mark, headline
from dogshape.validation.blind.field_set import STANDS
from dogshape.validation.blind.pair_refit import Seen, nearest
from dogshape.validation.blind.sealed import opened, results_of, write
from dogshape.validation.blind.stand import Point, read_points

Record = dict[str, Any]  #: key and results of a set, as they are kept in JSON


def told(folder: Path, name: str) -> None:
    """Diagnose a case with its engine's baseline, and keep the result."""
    path = folder / "told" / f"{name}.json"
    if path.exists():
        return
    begun, result = time.monotonic(), Record()
    try:
        result["diagnosis"] = _diagnosed(folder, name).as_dict()
    except DataError as error:
        result["refused"] = str(error)
    result["time_s"] = time.monotonic() - begun
    write(path, json.dumps(result))


def _diagnosed(folder: Path, name: str) -> Diagnosis:
    key = opened(folder)
    case, means, effects = key["cases"][name], Means(jobs=1), load(None)
    bench = with_bank_engine(load_bench(folder / "cases" / name), effects, means)
    reference = key["references"][f"{case['engine']}_{case['stand']}"]
    mean = np.array(reference["mean"], dtype=float)[case["places"]]
    every = read_points(folder / STANDS / case["stand"])
    points = [every[k] for k in case["places"]]

    def once(those: Mapping[str, Effect]) -> Ranked:
        emulator, flights = emulator_of(bench, those, means)
        seen = Seen(emulator, those, settings_of(bench))
        simulated = seen.predictions(NONE, np.zeros((1, 0)), range(len(bench.cells))).mean[:, 0]
        later = np.nan_to_num(_in_order(bench, points, mean) - simulated).tolist()
        found = ranked(bench, Moved(emulator, later, later), those, settings=Settings(RULES))
        flights.save()
        return found

    return diagnose_wider(once, effects)


def _in_order(bench: Bench, points: Sequence[Point], mean: Array) -> Array:
    """Return means at some operating points, s, in the order of a data set's cells."""
    cells = [(c.point.mismatch, c.point.profile.force) for c in bench.cells]
    found: Array = mean[nearest(cells, [(point.mismatch, point.force) for point in points])]
    return found


def main() -> None:
    """Diagnose what is missing, and print both columns."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--most", type=int, default=None)
    given = parser.parse_args()
    key, results = opened(given.folder), results_of(given.folder)
    names = sorted(key["cases"])[: given.most]
    (given.folder / "told").mkdir(exist_ok=True)
    with ProcessPoolExecutor(given.jobs, get_context("spawn")) as workers:
        list(workers.map(told, [given.folder] * len(names), names))
    beside = {n: json.loads((given.folder / "told" / f"{n}.json").read_text()) for n in names}
    columns = [
        headline([field_mark(n, key["cases"][n], key, found[n]) for n in names], {})
        for found in (results, beside)
    ]
    print(f"{len(names)} cases of {given.folder.name}, key opened before")
    print(f"{'figure':62s}{'not told':>22s}{'n':>6s}{'told':>22s}{'n':>6s}")
    for one in HEADLINES:
        bare, with_it = (column[one.name] for column in columns)
        if bare["n"]:
            print(
                f"{one.words:62s}{figure_text(bare):>22s}{bare['n']:>6d}"
                f"{figure_text(with_it):>22s}{with_it['n']:>6d}"
            )


if __name__ == "__main__":
    main()
