"""What both engines still differ by where effects act: blind cases at their true values.

    dogshape blind make DIR --which tuning --seed 4242
    python -m benchmarks.blind_rest DIR

The key is opened, so the set is one to tune on. The emulator predicts each case with effects of
the list at their true values; what both engines differ by without any effect is taken off as
``dogshape blind run`` does. For each truth: the root mean square of the gaps that are left over
their errors (sampling, emulator, ``Rules.model_error``; without the tenth that is largest, as in
``validation.blind.case_marks``), and case by case the median gap at 100 1/min and more as share of
the mean time, which a common error has to cover. Two minutes.
"""

from __future__ import annotations

import sys
from collections import defaultdict
from pathlib import Path
from typing import Any

import numpy as np

from dogshape.diagnosis.bench.bench_data import load_bench
from dogshape.diagnosis.likelihood.cell_predictions import CellPredictions
from dogshape.diagnosis.prediction.emulator import BankEmulator
from dogshape.diagnosis.prediction.sense_bank import SenseEmulator
from dogshape.diagnosis.settings import Rules
from dogshape.pipeline.diagnose.bank_diagnosis import Means, banks_of, with_bank_engine
from dogshape.sim.effects import load
from dogshape.sim.units import RPM
from dogshape.validation.blind.case_marks import CHANCE, counted, timely
from dogshape.validation.blind.engine_gap import Moved, engines_apart
from dogshape.validation.blind.sealed import opened
from dogshape.validation.blind.stand import read_stand

FAST = 99.0 * RPM


def main() -> None:
    """Print the table."""
    folder = Path(sys.argv[1])
    key, effects = opened(folder), load()
    first = folder / "cases" / next(iter(key["cases"]))
    bench, stand = with_bank_engine(load_bench(first), effects, Means()), read_stand(first)
    banks = banks_of(bench, effects, Means())
    bank, later = banks[0], [engines_apart(stand, one) for one in banks]
    emulator = Moved(SenseEmulator(BankEmulator(bank), banks[1]), *later)
    scores: dict[str, list[float]] = defaultdict(list)
    shares: dict[str, list[float]] = defaultdict(list)
    for case in key["cases"].values():
        if case["outside"]:
            continue
        z, share = _left(emulator, bank, effects, key["points"], case)
        name = " + ".join(sorted(case["parameters"])) or "none"
        scores[name] += z
        shares[name].append(share)
    print(f"{'truth':42s} in errors  share of the mean time")
    for name in sorted(scores):
        each = " ".join(f"{100.0 * share:+5.1f}" for share in shares[name])
        print(f"{name:42s} {_size(scores[name]):9.2f}  {each} %")
    whole = np.concatenate(list(shares.values())) * 100.0
    every = _size([z for mine in scores.values() for z in mine])
    rest, middle = np.sqrt((whole**2).mean()), np.median(abs(whole))
    print(f"all cases: {every:.2f} errors; share of the mean time {rest:.1f} % (root mean square),")
    print(f"{middle:.1f} % (median)")


def _size(scores: list[float]) -> float:
    """Return the root mean square of scores, one for normal ones, without the largest."""
    return float(np.sqrt(counted([z**2 for z in scores]) / CHANCE))


def _left(
    emulator: Moved, bank: Any, effects: Any, points: list[list[float]], case: Any
) -> tuple[list[float], float]:
    """Return gaps over their errors, and their median share of the mean time at fast points."""
    hypothesis = tuple(sorted(case["parameters"]))
    values = np.array([
        [case["parameters"][h][p.name] for h in hypothesis for p in effects[h].parameters]
    ])  # fmt: skip
    places = {(s.point.mismatch, s.point.profile.force): k for k, s in enumerate(bank.settings)}
    scores: list[float] = []
    shares: list[float] = []
    for (mismatch, force, _), times in zip(points, case["times_s"], strict=True):
        near = min(places, key=lambda p: abs(p[0] - mismatch) + abs(p[1] - force))
        said = CellPredictions.of([emulator.at(hypothesis, values, places[near])], Rules())
        seen = timely(times)
        if seen.size < 3 or not np.isfinite(said.mean[0, 0]):
            continue
        gap, mean = float(seen.mean() - said.mean[0, 0]), float(said.mean[0, 0])
        sampling = said.sd[0, 0] ** 2 / seen.size
        scores.append(gap / float(np.sqrt(sampling + said.error[0, 0] ** 2)))
        if abs(mismatch) >= FAST:
            shares.append(gap / mean)
    return scores, float(np.median(shares))


if __name__ == "__main__":
    main()
