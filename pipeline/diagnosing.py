"""From a bench data set to its diagnosis: the bank of simulations first, then the inference.

The package brings the bank of the published clutch at the operating points of its tables
(``studies/bench``). What it lacks is simulated once and kept in a folder:

``shifts.jsonl``  every finished shift; an interrupted bank goes on from it
``bank.json``     the times of finished banks, of any clutch
``flights.npz``   the ring's flight up to the first touch, for data sets with traces
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from diagnosis.bank import SHIFT, Bank, Plan, blocks_of
from diagnosis.bank_store import BankStore
from diagnosis.bench import Bench, load_bench
from diagnosis.blind import sealed
from diagnosis.blind.between import RULES, Moved, engines_apart
from diagnosis.blind.plain import plain
from diagnosis.blind.stand import read_stand
from diagnosis.diagnosis import Diagnosis, diagnose
from diagnosis.emulator import BankEmulator
from diagnosis.flight_store import FlightStore
from pipeline.executor import Executor
from pipeline.journal import ShiftJournal
from pipeline.lock import writing
from pipeline.progress import ShiftProgress
from sim.blocks import Block
from sim.bundled import bundled_root
from sim.effect import Effect
from sim.effects import load
from sim.records import Record

BANK = Path("results") / "bank"  #: folder of banks where none is named
TIMES, FLIGHTS = "bank.json", "flights.npz"
ENGINES = "engines.json"  #: beside blind cases


def _silent(_: str) -> None:
    """Say nothing."""


@dataclass(frozen=True)
class Means:
    """With what a diagnosis is made.

    Parameters
    ----------
    bank : folder of banks.
    effects : folder of the user's own effects, None without.
    jobs : worker processes, 0 for one a core.
    say : takes a line for the user.
    """

    bank: Path = BANK
    effects: Path | None = None
    jobs: int = 0
    say: Callable[[str], None] = field(default=_silent)


def brought(name: str) -> Path:
    """Return a file of the bank that the package brings."""
    return bundled_root() / "bench" / name


def diagnosed(bench: Bench, means: Means) -> Diagnosis:
    """Return the diagnosis of a data set; simulates what no bank has."""
    effects = load(means.effects)
    emulator, flights = _emulator(bench, effects, means)
    found = diagnose(bench, emulator, effects)
    flights.save()
    return found


def _emulator(
    bench: Bench, effects: Mapping[str, Effect], means: Means
) -> tuple[BankEmulator, FlightStore]:
    """Return what foretells a data set, and the flights that are to be saved afterwards."""
    flights = FlightStore((brought(FLIGHTS), means.bank / FLIGHTS))
    return BankEmulator(bank_of(bench, effects, means), flights), flights


def diagnose_folder(folder: Path, jobs: int = 0) -> dict[str, Any]:
    """Return the record of the diagnosis of a blind case, and what plain ways say of it.

    What both engines differ by without any effect is measured with the first case of a set.
    """
    bench, means, effects = load_bench(folder), Means(jobs=jobs), load(None)
    bare, flights = _emulator(bench, effects, means)
    emulator = Moved(bare, _engines_apart(folder, bare.bank))
    found = diagnose(bench, emulator, effects, rules=RULES).as_dict()
    flights.save()
    return {**found, "plain": plain(bench, emulator, effects)}


def _engines_apart(folder: Path, bank: Bank) -> list[float]:
    """Return what both engines differ by at the points of a case, s; kept beside the cases."""
    path = folder.parent.parent / ENGINES
    if not path.exists():
        later = engines_apart(read_stand(folder), bank)
        sealed.write(path, json.dumps({"later_s": later}))
    found: list[float] = sealed.read(path, "remove it")["later_s"]
    return found


def bank_of(bench: Bench, effects: Mapping[str, Effect], means: Means) -> Bank:
    """Return the bank of a data set: what files have of it, and the rest simulated."""
    plan = Plan(tuple(effects.values()))
    store = BankStore((brought(TIMES), means.bank / TIMES))
    left = sum(len(block.angles) for block in store.missing(blocks_of(plan, bench)))
    if not left:
        return store.bank(plan, bench, _none_left)
    means.say(_announced(left, means))
    how = "the same command goes on from there"
    with (
        writing(means.bank),
        ShiftProgress(left) as progress,
        progress.kept_in(means.bank, how),
    ):
        journal = ShiftJournal(means.bank / "shifts.jsonl")
        bank = store.bank(plan, bench, Executor(journal, means.jobs, progress.advance).run)
        journal.say_unfinished(means.say)
        return bank


def _announced(shifts: int, means: Means) -> str:
    jobs = means.jobs or os.cpu_count() or 1
    minutes = max(1.0, shifts * SHIFT / jobs / 60.0)
    return (
        f"the bank of this clutch lacks {shifts} shifts, about {minutes:.0f} min with {jobs} "
        f"workers; kept in {means.bank} for this and later diagnoses"
    )


def _none_left(blocks: Sequence[Block]) -> list[list[Record]]:
    raise AssertionError(f"{len(blocks)} blocks are simulated that the bank has")
