"""The bank that the package brings: both senses of rotation at the published operating points.

    python -m benchmarks.bundled_bank [--bank FOLDER] [--jobs N]

What ``studies/bench/bank.json`` lacks is taken from ``bank.json`` or the journal of FOLDER, or else
simulated there; then the file is written again with what the plans of the published data sets ask
for and nothing else. From nothing it takes 80 000 shifts.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

from dogshape.diagnosis.bench.bench_data import load_bench
from dogshape.diagnosis.prediction.bank_store import BankStore
from dogshape.pipeline.cli.progress_bar import ProgressBar
from dogshape.pipeline.diagnose.bank_diagnosis import (
    BANK,
    TIMES,
    Means,
    banks_of,
    blocks_by_key,
    brought,
    plans_of,
)
from dogshape.sim.effects import load

SETS = ("mq200_stand", "mq200_adams")


def main() -> None:
    """Write the bundled bank."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--bank", type=Path, default=BANK)
    parser.add_argument("--jobs", type=int, default=0)
    given = parser.parse_args()
    effects, keys = load(None), list[str]()
    for name in SETS:
        # Whatever a set says: a copy of it may call its sense unknown.
        bench = replace(load_bench(name), mismatch_sense="unknown")
        banks_of(bench, effects, Means(bank=given.bank, jobs=given.jobs, progress=ProgressBar()))
        keys += blocks_by_key(plans_of(bench, effects))
    store = BankStore((brought(TIMES), given.bank / TIMES))
    store.save(brought(TIMES), dict.fromkeys(keys))
    print(f"{brought(TIMES)}: {len(dict.fromkeys(keys))} series")


if __name__ == "__main__":
    main()
