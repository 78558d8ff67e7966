"""What it costs that finished shifts outlast a power cut, beside what a shift costs.

A line of the journal can be left to the operating system, which writes it within half a minute, be
forced to the disk by itself, or with the block of a design's shifts at an operating point.
"""

from __future__ import annotations

import os
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from dogshape.pipeline.config.study_file import load_study
from dogshape.pipeline.store.journal import ShiftJournal, append
from dogshape.sim.statistics.batch import run_block
from dogshape.sim.statistics.blocks import even_blocks

SHIFTS = 480
RUNS = 5


def main() -> None:
    """Print ms a shift, the median of several runs, and its share of a shift."""
    study = load_study("mq200_paper")
    blocks = even_blocks(study.clutch, study.points, study.file.expectation.angles, 1)
    begin = time.process_time()
    rows = [row for block in blocks[::4] for row in run_block(block)]
    shift = (time.process_time() - begin) / len(rows)
    size = len(blocks[0].angles)
    print(f"a shift takes {shift * 1e3:.1f} ms of a processor; blocks of {size} shifts")

    def measured(each: int | None) -> float:
        with tempfile.TemporaryDirectory(dir=".") as place:
            path = Path(place) / "shifts.jsonl"
            journal = ShiftJournal(path)
            begin = time.perf_counter()
            for count in range(SHIFTS):
                row = rows[count % len(rows)]
                append(path, row)
                if each is not None and count % each == each - 1:
                    journal.add([row])
            return (time.perf_counter() - begin) / SHIFTS

    _print("left to the system", lambda: measured(None), shift)
    _print("forced line by line", lambda: measured(1), shift)
    _print("forced block by block", lambda: measured(size), shift)


def _print(what: str, measure: Callable[[], float], shift: float) -> None:
    times = [measure() for _ in range(RUNS)]
    middle = float(np.median(times))
    print(
        f"{what:22s} {middle * 1e3:6.3f} ms a shift ({min(times) * 1e3:.3f} to "
        f"{max(times) * 1e3:.3f}), {middle / shift:.1%} of its time",
        flush=True,
    )


if __name__ == "__main__":
    os.sync()
    main()
