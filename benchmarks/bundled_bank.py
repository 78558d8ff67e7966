"""The bank that the package brings: both senses of rotation at the published operating points.

    python -m benchmarks.bundled_bank [--bank FOLDER] [--jobs N]

What ``studies/bench/bank.json`` lacks is taken from ``bank.json`` or the journal of FOLDER, or else
simulated there by the compiled engine; then the file is written again with what the plans of the
published data sets and their diagnoses ask for and nothing else. From nothing it takes 88 000
shifts, some minutes. So do the flights of every effect, and of each with friction of the sleeve, in
``flights.npz``. ``together.json`` has the effects that these diagnoses have simulated together.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from dogshape.diagnosis.bench.bench_data import Bench, load_bench
from dogshape.diagnosis.prediction.bank import COMMON, both, settings_of
from dogshape.diagnosis.prediction.bank_store import BankStore
from dogshape.diagnosis.prediction.flight_store import FlightStore
from dogshape.diagnosis.prediction.flight_table import FlightTables
from dogshape.diagnosis.prediction.sense_bank import forward_plan
from dogshape.diagnosis.terms import Hypothesis
from dogshape.pipeline.cli.progress_bar import ProgressBar
from dogshape.pipeline.diagnose.bank_diagnosis import (
    BANK,
    FLIGHTS,
    TIMES,
    TOGETHER,
    Means,
    banks_of,
    blocks_by_key,
    brought,
    diagnosed,
    plans_of,
)
from dogshape.pipeline.diagnose.joint_simulation import FOLDER
from dogshape.sim.effect import Effect
from dogshape.sim.effects import load

SETS = ("mq200_stand", "mq200_adams")
#: In the folder, on which a run that was stopped goes on: flights, and levels of wider ranges.
BUNDLED, WIDER = "bundled_flights.npz", "wider"


def fly_all(bench: Bench, effects: Mapping[str, Effect], store: FlightStore) -> int:
    """Let the ring fly with what traces ask for first; the number of tables that are new."""
    named = forward_plan(effects).named
    tables = FlightTables(named, settings_of(bench), store)
    alone: list[Hypothesis] = [(name,) for name in named]
    pairs = [both(COMMON, name) for name in named if name != COMMON]
    for hypothesis in [*alone, *pairs]:
        parameters = [p for name in hypothesis for p in effects[name].parameters]
        values = np.array([[p.at(0.5) for p in parameters]])
        for profile in tables.settings:
            tables.at(hypothesis, values, profile)
    return len(store.new)


def main() -> None:
    """Write the bundled bank."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--bank", type=Path, default=BANK)
    parser.add_argument("--jobs", type=int, default=0)
    given = parser.parse_args()
    effects, keys = load(None), list[str]()
    for name in SETS:
        # Whatever a set says: a copy of it may call its sense unknown.
        bench = load_bench(name)
        record = replace(bench.record, sense="unknown")
        bench = replace(bench, clutch=bench.clutch.with_engine("planar"), record=record)
        banks_of(bench, effects, Means(bank=given.bank, jobs=given.jobs, progress=ProgressBar()))
        keys += blocks_by_key(plans_of(bench, effects))
    flights = FlightStore((given.bank / BUNDLED,))
    for name in SETS:
        fly_all(load_bench(name), effects, flights)
        flights.save()
    BankStore((brought(TIMES), given.bank / TIMES)).save(brought(TIMES), dict.fromkeys(keys))
    # Before the diagnoses too: a table that the old file has would not be found lacking.
    brought(FLIGHTS).write_bytes((given.bank / BUNDLED).read_bytes())
    # Where a size of a published set lies at the end of its range, its diagnosis wants more levels.
    wider = given.bank / WIDER
    brought(TOGETHER).unlink(missing_ok=True)  # what an earlier answer asked for
    for name in SETS:
        diagnosed(load_bench(name), Means(bank=wider, jobs=given.jobs, progress=ProgressBar()))
    flights.take(wider / FLIGHTS)
    flights.save()
    brought(FLIGHTS).write_bytes((given.bank / BUNDLED).read_bytes())
    keys += BankStore((wider / TIMES,)).series
    BankStore((brought(TIMES), wider / TIMES)).save(brought(TIMES), dict.fromkeys(keys))
    # And what it has simulated together, in a file of its own: it goes with the answer.
    together = BankStore(sorted((wider / FOLDER).glob("*.json")))
    together.save(brought(TOGETHER), sorted(together.series))
    print(f"{brought(TIMES)}: {len(dict.fromkeys(keys))} series")
    print(f"{brought(TOGETHER)}: {len(together.series)} series")


if __name__ == "__main__":
    main()
