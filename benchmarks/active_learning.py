"""Simulating where it tells most, against filling the space, for the fastest designs.

Both begin with the same designs. The question is how fast the best tenth of 200 feasible designs
are; its error is against dense simulations of these, at other angles.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np

from benchmarks.space import space
from dogshape.pipeline.simulate.executor import Executor
from dogshape.pipeline.store.journal import ShiftJournal, append
from dogshape.pipeline.train.inquiry import Inquiry, inquire
from dogshape.pipeline.train.reference_designs import best_pool
from dogshape.surrogate.learning import fit
from dogshape.surrogate.mix import Mix
from dogshape.surrogate.model import Surrogate
from dogshape.surrogate.references import Reference
from dogshape.surrogate.validation_figures import predict

START = 40  #: designs that both begin with
SHIFTS = 1536  #: spent on the question
FILLING = (40, 80, 160, 320, 500)


def main() -> None:
    """Print both curves and the ratio of shifts for equal error."""
    kept = space()
    best, pool = kept.references[1], best_pool(kept.study)
    print(f"error of the expected time of {len(best)} references of the best tenth, ms")
    print("filling the space: designs, shifts, error (rms), bias, spread about it")
    filled = []
    for count in FILLING:
        data = kept.first(count)
        error = _error(fit(data), best, kept.mix)
        filled.append((data.shifts, error[0]))
        print(f"{count:4d}  {data.shifts:6d}  {_said(error)}", flush=True)
    print("asking for the best: shifts, error (rms), bias, spread about it")
    found = []
    with tempfile.TemporaryDirectory() as place:
        path = Path(place) / "shifts.jsonl"
        for shift in kept.shifts_of(START):
            append(path, shift)
        journal = ShiftJournal(path)
        asked = Inquiry("best", SHIFTS)
        for model in inquire(kept.study, asked, Executor(journal), lambda _: None, pool):
            error = _error(model, best, kept.mix)
            found.append((model.data.shifts, error[0]))
            print(f"      {model.data.shifts:6d}  {_said(error)}", flush=True)
    _ratios(np.array(filled), np.array(found))


def _error(model: Surrogate, best: Reference, mix: Mix) -> tuple[float, float, float]:
    miss = predict(model, best.x, mix).time - best.time
    return float(np.sqrt((miss**2).mean())), float(miss.mean()), float(miss.std())


def _said(error: tuple[float, float, float]) -> str:
    return "  ".join(f"{value * 1e3:+6.2f}" for value in error)


def _ratios(filled: np.ndarray, found: np.ndarray) -> None:
    """Print how many shifts of filling reach the error that a question reached."""
    falling = np.minimum.accumulate(filled[:, 1])
    print("for equal error: shifts asked, shifts of filling, ratio")
    for shifts, error in found[2::3]:
        if error < falling[-1]:
            most = filled[-1, 0]
            print(f"{shifts:6.0f}  more than {most:.0f}  more than {most / shifts:.1f}")
            continue
        needed = float(np.interp(-error, -falling, filled[:, 0]))
        print(f"{shifts:6.0f}  {needed:6.0f}  {needed / shifts:.1f}")


if __name__ == "__main__":
    main()
