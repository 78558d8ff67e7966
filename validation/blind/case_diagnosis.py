"""Diagnosis of a blind case, as a user gets it, beside plain baselines."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from dogshape.diagnosis.bench.bench_data import load_bench
from dogshape.diagnosis.prediction.bank import settings_of
from dogshape.pipeline.diagnose.bank_diagnosis import (
    Means,
    diagnosed_by_banks,
    emulator_of,
    with_bank_engine,
)
from dogshape.sim.effects import load
from dogshape.validation.blind.baselines import plain
from dogshape.validation.blind.yardstick import Seen

PATIENCE = 600.0  #: s to wait for the bank that another case has to complete


def diagnose_folder(folder: Path, jobs: int = 0) -> dict[str, Any]:
    """Diagnose a blind case, and name its cause by the baselines."""
    means, effects = Means(jobs=jobs, patience=PATIENCE), load(None)
    bench = with_bank_engine(load_bench(folder), effects, means)
    emulator, flights = emulator_of(bench, effects, means)
    record = diagnosed_by_banks(bench, effects, means).as_dict()
    found = {**record, "plain": plain(bench, emulator, effects)}
    flights.save()
    return found


def seen_by(folder: Path, jobs: int = 0) -> Seen:
    """Load emulator, effects and settings with which ``diagnose_folder`` diagnoses a folder.

    The bank of simulations is made where there is none.
    """
    means, effects = Means(jobs=jobs, patience=PATIENCE), load(None)
    bench = with_bank_engine(load_bench(folder), effects, means)
    emulator, _ = emulator_of(bench, effects, means)
    return Seen(emulator, effects, settings_of(bench))
