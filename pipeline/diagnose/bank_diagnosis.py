"""From a bench data set to its diagnosis: the bank of simulations first, then the inference.

The package brings the bank of the published clutch at the operating points of its tables
(``studies/bench``). What it lacks is simulated once and kept in a folder:

``bank.json``     times of all banks, of any clutch
``shifts.jsonl``  finished shifts of an unfinished bank, from which it goes on
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

from dogshape.diagnosis.bench.bench_data import Bench, require_times
from dogshape.diagnosis.diagnosis import Diagnosis, diagnose
from dogshape.diagnosis.inference.next_test import require_terms
from dogshape.diagnosis.inference.static_readings import require_measured
from dogshape.diagnosis.prediction.bank_store import BankStore
from dogshape.diagnosis.prediction.model import Model, build_models
from dogshape.diagnosis.settings import USUAL, Settings
from dogshape.pipeline.progress import SILENT, Progress, WorkCounter, about
from dogshape.pipeline.simulate.executor import Executor, workers_of
from dogshape.pipeline.store.journal import ShiftJournal
from dogshape.sim.effect import Effect
from dogshape.sim.effects import load, own_files
from dogshape.sim.errors import EffectError
from dogshape.sim.files import writing
from dogshape.sim.setting import Setting
from dogshape.sim.statistics.batch import run_block
from dogshape.sim.statistics.blocks import Block
from dogshape.sim.statistics.shift_records import Record
from dogshape.sim.versions import bundled_root

BANK = Path("results") / "bank"  #: folder of banks where none is named
COST = {"planar": 0.0015, "drake": 0.1}  #: s of processor time of a shift, about
SAME_TIME = 1e-6  #: relative difference below which neutral values change no shift time
TIMES, SHIFTS = "bank.json", "shifts.jsonl"


@dataclass(frozen=True)
class Means:
    """Means of a diagnosis: banks, effects and workers.

    Parameters
    ----------
    bank : folder of banks.
    effects : folder of the user's own effects, None without.
    jobs : worker processes, 0 for one a core.
    progress : shows the progress of simulations.
    engine : of the bank.
    patience : s to wait for another run that writes banks, before StorageError.
    settings : of the diagnosis.
    """

    bank: Path = BANK
    effects: Path | None = None
    jobs: int = 0
    progress: Progress = SILENT
    engine: str = "planar"
    patience: float = 0.0
    settings: Settings = USUAL


def brought(name: str) -> Path:
    """Locate a file of the bank that the package brings."""
    return bundled_root() / "bench" / name


def diagnosed(bench: Bench, means: Means) -> Diagnosis:
    """Diagnose a data set; simulate the shifts that no bank has.

    DataError where no shift has a time, EffectError for an effect that cannot be run.
    """
    require_times(bench)
    effects = load(means.effects)
    require_terms(bench, effects)
    require_measured(bench, effects)
    _require_working(effects, bench, means)
    bench = replace(bench, clutch=bench.clutch.with_engine(means.engine))
    return diagnose(bench, models_of(bench, effects, means), means.settings)


def models_of(bench: Bench, effects: Mapping[str, Effect], means: Means) -> dict[str, Model]:
    """Build the predictions of a data set, by the place where displacement may be read."""
    return build_models(bench, effects, means.settings, lambda blocks: shifts_of(blocks, means))


def shifts_of(blocks: Sequence[Block], means: Means) -> list[list[Record]]:
    """Read the shifts of a bank; simulate what no file has, and keep it."""
    store = BankStore((brought(TIMES), means.bank / TIMES))
    if not store.missing(blocks):
        return store.times(blocks, _nothing)
    with writing(means.bank, means.patience):
        store = BankStore(store.paths)  # another run may have written since
        lacking = store.missing(blocks)
        journal = ShiftJournal(means.bank / SHIFTS)
        left = sum(len(block.angles) for block in lacking)
        there = sum(key in journal.rows for block in lacking for key in block.keys)
        means.progress.say(_announced(means, left, there))
        with (
            WorkCounter(means.progress, left) as progress,
            progress.kept_in(means.bank, "the same command goes on from there"),
        ):
            executor = Executor(journal, means.jobs, progress.advance, known=progress.known)
            rows = store.times(blocks, executor.run)
        journal.say_unfinished(means.progress.say)
        with suppress(OSError):  # the file of banks has them
            journal.drop({key for block in lacking for key in block.keys})
        return rows


def _nothing(blocks: Sequence[Block]) -> list[list[Record]]:
    """Simulate no block: all are known."""
    assert not blocks
    return []


def _announced(means: Means, left: int, there: int) -> str:
    lasts = about((left - there) * COST[means.engine] / workers_of(means.jobs))
    kept = f" ({there} more are there from a run that was stopped)" if there else ""
    return (
        f"the bank of this clutch lacks {left - there} shifts{kept}. To simulate them takes "
        f"{lasts} with {workers_of(means.jobs)} workers, once; kept in {means.bank} for this and "
        "later diagnoses"
    )


def _require_working(effects: Mapping[str, Effect], bench: Bench, means: Means) -> None:
    """Raise EffectError, with its file, for an effect of the user's that cannot be run."""
    own = own_files(means.effects) if means.effects else {}
    if means.effects and not own:
        means.progress.say(
            f"{means.effects} has no effect: no file NAME.py without an underscore before it"
        )
    base = Setting(bench.clutch, bench.cells[0].point)
    for name, path in own.items():
        try:
            effects[name].require_working(base)
            _require_neutral(effects[name], base)
        except EffectError as error:
            raise EffectError(f"{path}: {error}") from error


def _require_neutral(effect: Effect, base: Setting) -> None:
    """Raise EffectError where neutral values change the time that the bench reads of a shift.

    One shift of the compiled engine says so: settings may differ and mean the same.
    """
    neutral = effect.neutral(base)
    changed = effect.apply(base, neutral)
    if not neutral or changed == base:
        return
    times = [_read_time(one) for one in (base, changed)]
    if None not in times and not math.isclose(*times, rel_tol=SAME_TIME):  # type: ignore[arg-type]
        given = ", ".join(f"{name} = {value:g}" for name, value in neutral.items())
        before, after = (f"{1e3 * time:.4g}" for time in times if time is not None)
        raise EffectError(
            f"with its neutral values ({given}) the effect {effect.name} moves a shift from "
            f"{before} to {after} ms, but neutral values have to change nothing; correct neutral="
        )


def _read_time(setting: Setting) -> float | None:
    clutch = setting.clutch.with_engine("planar")
    (row,) = run_block(Block(clutch, setting.point, (0.25 * clutch.dog.pitch_angle,)))
    return setting.time_of(row)
