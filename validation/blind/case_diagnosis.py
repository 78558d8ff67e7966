"""Diagnosis of a blind case, with and without the measured gap between both engines."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from dogshape.diagnosis.bench.bench_data import Bench, load_bench
from dogshape.diagnosis.diagnosis import diagnose
from dogshape.diagnosis.prediction.bank import settings_of
from dogshape.diagnosis.prediction.prediction import FlightEmulator
from dogshape.diagnosis.prediction.sense_bank import SenseEmulator
from dogshape.diagnosis.settings import Rules, Settings
from dogshape.pipeline.diagnose.bank_diagnosis import (
    Means,
    diagnosed_by_banks,
    emulator_of,
    with_bank_engine,
)
from dogshape.sim.effect import Effect
from dogshape.sim.effects import load
from dogshape.validation.blind import sealed
from dogshape.validation.blind.baselines import plain
from dogshape.validation.blind.engine_gap import RULES, Moved, engines_apart
from dogshape.validation.blind.pair_refit import Seen
from dogshape.validation.blind.stand import read_stand

PATIENCE = 600.0  #: s to wait for the bank that another case has to complete
ENGINES = "engines.json"  #: beside blind cases
LATER = ("later_s", "reversed_later_s")  #: its keys: with the sense of the table, and reversed


def diagnose_folder(folder: Path, jobs: int = 0) -> dict[str, Any]:
    """Diagnose a blind case, and name its cause by the baselines.

    Beside the diagnosis that a user gets, ``told`` has that of the same data once what both engines
    differ by without any effect is known; it is measured with the first case of a set. Sets that
    MuJoCo did not make have no such column.
    """
    means, effects = Means(jobs=jobs, patience=PATIENCE), load(None)
    bench = with_bank_engine(load_bench(folder), effects, means)
    bare, flights = emulator_of(bench, effects, means)
    told = diagnosed_by_banks(bench, effects, means).as_dict()
    found = {**told, "plain": plain(bench, bare, effects)}
    if sealed.manifest_of(folder.parent.parent).get("engine", "mujoco") == "mujoco":
        emulator = Moved(bare, *_engines_apart(folder, bare))
        found["told"] = _with_plain(bench, emulator, effects, RULES)
    flights.save()
    return found


def seen_by(folder: Path, jobs: int = 0) -> Seen:
    """Return with what ``diagnose_folder`` diagnoses a blind case as a user gets it.

    The bank of simulations is made where there is none.
    """
    means, effects = Means(jobs=jobs, patience=PATIENCE), load(None)
    bench = with_bank_engine(load_bench(folder), effects, means)
    emulator, _ = emulator_of(bench, effects, means)
    return Seen(emulator, effects, settings_of(bench))


def _with_plain(
    bench: Bench, emulator: FlightEmulator, effects: Mapping[str, Effect], rules: Rules
) -> dict[str, Any]:
    """Diagnose with one emulator, and name the cause by the baselines."""
    found = diagnose(bench, emulator, effects, settings=Settings(rules)).as_dict()
    return {**found, "plain": plain(bench, emulator, effects)}


def _engines_apart(folder: Path, emulator: SenseEmulator) -> tuple[list[float], list[float]]:
    """Measure the offsets of both engines at the points of a case, s, in both senses.

    It is kept beside the cases.
    """
    path = folder.parent.parent / ENGINES
    if not path.exists():
        stand, banks = read_stand(folder), (emulator.plain.bank, emulator.reversed.bank)
        later = [engines_apart(stand, bank) for bank in banks]
        sealed.write(path, json.dumps(dict(zip(LATER, later, strict=True))))
    found = sealed.read(path, "remove it")
    return found[LATER[0]], found[LATER[1]]
