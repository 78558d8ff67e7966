"""Write the bank that the package brings: all simulations of the published data sets' diagnoses.

    python -m benchmarks.bundled_bank [--bank FOLDER] [--jobs N]

What ``studies/bench/bank.jsonl`` lacks is simulated by the compiled engine and kept in FOLDER. The
file is written again with what these diagnoses ask for and nothing else. From nothing it takes
800 000 shifts, some minutes.
"""

from __future__ import annotations

import argparse
import itertools
import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from dogshape.bench.bench_data import load_bench
from dogshape.diagnosis.diagnosis import diagnose
from dogshape.diagnosis.prediction.building import build_models
from dogshape.pipeline.diagnose.bank import Bank, series_key
from dogshape.pipeline.diagnose.bank_diagnosis import (
    BANK,
    BUNDLED_BANK,
    TIMES,
    BankOptions,
    SimulationRounds,
    shifts_of,
)
from dogshape.sim.effects import load
from dogshape.sim.files import write_whole
from dogshape.sim.statistics.blocks import Block
from dogshape.sim.statistics.shift_records import Record
from dogshape.terminal import ProgressBar

SETS = ("mq200_stand", "mq200_adams")
SEEDS = (1, 2)  #: of the inference, those of the acceptance tests


def main() -> None:
    """Write the bundled bank."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--bank", type=Path, default=BANK)
    parser.add_argument("--jobs", type=int, default=0)
    arguments = parser.parse_args()
    options = BankOptions(bank=arguments.bank, jobs=arguments.jobs, progress=ProgressBar())
    used_keys = list[str]()
    rounds = SimulationRounds()
    bank = Bank((BUNDLED_BANK, arguments.bank / TIMES))

    def run(blocks: Sequence[Block]) -> list[list[Record]]:
        used_keys.extend(map(series_key, blocks))
        return shifts_of(blocks, options, rounds, bank)

    for name, seed in itertools.product(SETS, SEEDS):
        bench = load_bench(name)
        settings = replace(options.settings, seed=seed)
        bench = replace(bench, clutch=bench.clutch.with_engine(options.engine))
        diagnose(bench, build_models(bench, load(None), settings, run), settings)
    rows = [json.dumps(bank.series[key]) + "\n" for key in dict.fromkeys(used_keys)]
    write_whole(BUNDLED_BANK, "".join(rows))
    print(f"{BUNDLED_BANK}: {len(rows)} series")


if __name__ == "__main__":
    main()
