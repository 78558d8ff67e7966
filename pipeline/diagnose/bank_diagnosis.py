"""From a bench data set to its diagnosis: the bank of simulations first, then the inference.

The package brings the bank of the published clutch at the operating points of its tables
(``studies/bench``). What it lacks is simulated once and kept in a folder:

``shifts.jsonl``  finished shifts of unfinished banks, from which these go on, and all baselines
``bank.json``     the times of finished banks, of any clutch
``flights.npz``   the ring's flight up to the first touch, for data sets with traces
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

from dogshape.diagnosis.bench.bench_data import Bench, require_times
from dogshape.diagnosis.diagnosis import Diagnosis, Ranked, diagnose_wider, ranked
from dogshape.diagnosis.inference.next_test import require_terms
from dogshape.diagnosis.inference.static_readings import require_measured
from dogshape.diagnosis.prediction.bank import SHIFT, Bank, Plan, blocks_of
from dogshape.diagnosis.prediction.bank_store import BankStore, series_key
from dogshape.diagnosis.prediction.emulator import BankEmulator
from dogshape.diagnosis.prediction.flight_store import FlightStore
from dogshape.diagnosis.prediction.levels import Level
from dogshape.diagnosis.prediction.sense_bank import (
    SenseEmulator,
    forward_plan,
    reversed_bench,
    reversed_plan,
)
from dogshape.pipeline.diagnose.held_shifts import held_shifts
from dogshape.pipeline.diagnose.joint_simulation import JointSimulation
from dogshape.pipeline.diagnose.lacking import reason
from dogshape.pipeline.duration import about
from dogshape.pipeline.progress import SILENT, Progress, WorkCounter
from dogshape.pipeline.simulate.block_cost import dearness
from dogshape.pipeline.simulate.executor import Executor, workers_of
from dogshape.pipeline.store.journal import ShiftJournal
from dogshape.sim.bundled import bundled_root
from dogshape.sim.effect import Effect
from dogshape.sim.effects import load, own_files
from dogshape.sim.errors import EffectError
from dogshape.sim.setting import Setting
from dogshape.sim.statistics.batch import run_block
from dogshape.sim.statistics.blocks import Block
from dogshape.sim.statistics.numerical_error import Runner
from dogshape.sim.statistics.shift_records import Record
from dogshape.sim.writers import writing

BANK = Path("results") / "bank"  #: folder of banks where none is named
PLANAR = 0.003  #: s of processor time that a shift of the compiled engine takes, about
SAME_TIME = 1e-6  #: relative difference below which neutral values change no shift time
HELD = 0.5  #: share of a bank that may be lacking before another engine simulates all of it
TIMES, FLIGHTS, SHIFTS = "bank.json", "flights.npz", "shifts.jsonl"
TOGETHER = "together.json"  #: of the package, with times of effects together


@dataclass(frozen=True)
class Means:
    """Means of a diagnosis: banks, effects and workers.

    Parameters
    ----------
    bank : folder of banks.
    effects : folder of the user's own effects, None without.
    jobs : worker processes, 0 for one a core.
    progress : is told how far the simulations are.
    engine : of the bank; None for the one whose lacking shifts take less time.
    patience : s to wait for another run that writes banks, before StorageError.
    """

    bank: Path = BANK
    effects: Path | None = None
    jobs: int = 0
    progress: Progress = SILENT
    engine: str | None = None
    patience: float = 0.0


def brought(name: str) -> Path:
    """Return a file of the bank that the package brings."""
    return bundled_root() / "bench" / name


def diagnosed(bench: Bench, means: Means) -> Diagnosis:
    """Diagnose a data set; simulate the shifts that no bank has.

    Where the leading sizes lie at an end of their range, that is widened, and the levels that it
    lacks are simulated too. DataError where no shift has a time, EffectError for an effect that
    cannot be run.
    """
    require_times(bench)
    effects = load(means.effects)
    require_terms(bench, effects)
    require_measured(bench, effects)
    _require_working(effects, bench, means)
    bench = with_bank_engine(bench, effects, means)
    return diagnosed_by_banks(bench, effects, means)


def diagnosed_by_banks(bench: Bench, effects: Mapping[str, Effect], means: Means) -> Diagnosis:
    """Diagnose a data set by its banks, again with wider ranges where sizes lie at their end.

    What effects were simulated together for one answer serves the next, which lists it too.
    """
    together, stores = dict[Level, None](), list[FlightStore]()

    def once(ranged: Mapping[str, Effect]) -> Ranked:
        emulator, flights = emulator_of(bench, ranged, means)
        stores.append(flights)
        known = [level for level in together if set(level.hypothesis) <= set(ranged)]
        found = ranked(bench, emulator.with_levels(known) if known else emulator, ranged)
        every = tuple(dict.fromkeys((*known, *found.ranking.together)))
        together.update(dict.fromkeys(every))
        flights.save()
        return replace(found, ranking=replace(found.ranking, together=every))

    diagnosis = diagnose_wider(once, effects)
    for flights in stores:  # the conclusion may have asked for more flights
        flights.save()
    return diagnosis


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


def emulator_of(
    bench: Bench, effects: Mapping[str, Effect], means: Means
) -> tuple[SenseEmulator, FlightStore]:
    """Build the emulator of a data set, and the flights that are to be saved afterwards."""
    flights = FlightStore((brought(FLIGHTS), means.bank / FLIGHTS))
    plain, turned = banks_of(bench, effects, means)
    simulate = _joint(bench, effects, plain, means)
    return SenseEmulator(BankEmulator(plain, flights), turned, simulate), flights


def _joint(
    bench: Bench, effects: Mapping[str, Effect], bank: Bank, means: Means
) -> JointSimulation | None:
    """Build what simulates effects together; None for an engine that takes minutes for that."""
    if bench.clutch.solver.engine != "planar":
        return None
    (plan, _), _ = plans_of(bench, effects)
    return JointSimulation(plan, bank, brought(TOGETHER), means.bank, means.jobs, means.progress)


def bank_of(bench: Bench, effects: Mapping[str, Effect], means: Means) -> Bank:
    """Return the bank of a data set with the sense of its table."""
    return banks_of(bench, effects, means)[0]


def with_bank_engine(bench: Bench, effects: Mapping[str, Effect], means: Means) -> Bench:
    """Choose the engine that simulates the bank of a data set.

    The data set's own where a bank has more than half of the shifts: an effect or a point more is
    no reason to answer from another basis. Else the compiled engine, which takes a minute for what
    Drake takes half an hour.
    """
    if means.engine is not None:
        return replace(bench, clutch=bench.clutch.with_engine(means.engine))
    store = _store(means)
    every = blocks_by_key(plans_of(bench, effects)).values()
    lacking = sum(len(block.angles) for block in store.missing(every))
    if lacking <= HELD * sum(len(block.angles) for block in every):
        return bench
    return replace(bench, clutch=bench.clutch.with_engine("planar"))


def cost_of(bench: Bench) -> float:
    """Estimate the processor time of a shift of a bank, s."""
    return PLANAR if bench.clutch.solver.engine == "planar" else SHIFT


def plans_of(
    bench: Bench, effects: Mapping[str, Effect]
) -> tuple[tuple[Plan, Bench], tuple[Plan, Bench]]:
    """Plan the simulations of a data set, with the sense of its table and reversed."""
    turned = reversed_plan(effects, bench), reversed_bench(bench)
    return (forward_plan(effects), bench), turned


def blocks_by_key(plans: Iterable[tuple[Plan, Bench]]) -> dict[str, Block]:
    """List the blocks of some plans, each once, by the key of their series."""
    return {series_key(block): block for one in plans for block in blocks_of(*one)}


def banks_of(bench: Bench, effects: Mapping[str, Effect], means: Means) -> tuple[Bank, Bank]:
    """Build the banks of a data set with the sense of its table and with the reversed one.

    They are what files have of them, and the rest simulated.
    """
    plans = plans_of(bench, effects)
    with suppress(_Lacking):
        return _made(_store(means), plans, _none)
    with writing(means.bank, means.patience):
        store = _store(means)  # another run may have written since
        lacking = store.missing(blocks_by_key(plans).values())
        if not lacking:
            with suppress(_Lacking):
                return _made(store, plans, _none)
        journal = ShiftJournal(means.bank / SHIFTS)
        # What both banks lack is counted first, so that the time is told once.
        left = sum(len(block.angles) for block in lacking)
        there = sum(key in journal.rows for block in lacking for key in block.keys)
        lasts = about((left - there) * cost_of(bench) / workers_of(means.jobs))
        why = _why(bench, effects, means)
        means.progress.say(_announced((left, there), lasts, means, why))
        extra = sum((dearness(block) - 1.0) * len(block.angles) for block in lacking)
        with (
            WorkCounter(means.progress, left, extra=extra) as progress,
            progress.kept_in(means.bank, "the same command goes on from there"),
        ):
            executor = Executor(
                journal, means.jobs, progress.advance, known=progress.known, weigh=progress.weigh
            )
            banks = _made(store, plans, executor.run)
        journal.say_unfinished(means.progress.say)
        _shorten(journal, means)
        return banks


def _store(means: Means) -> BankStore:
    return BankStore((brought(TIMES), means.bank / TIMES))


def _made(
    store: BankStore, plans: tuple[tuple[Plan, Bench], tuple[Plan, Bench]], run: Runner
) -> tuple[Bank, Bank]:
    plain, turned = plans
    first = store.bank(*plain, run)
    return first, store.bank(*turned, run, first.numerics)


def _shorten(journal: ShiftJournal, means: Means) -> None:
    """Drop from a journal what the file of banks has, as it now is on the disk."""
    held = held_shifts(journal.rows.values(), _store(means).series)
    with suppress(OSError):  # nothing rests on it, and the next run drops them
        if held:
            journal.drop(held)


def _why(bench: Bench, effects: Mapping[str, Effect], means: Means) -> str:
    """Explain why simulations are lacking."""
    own, known = own_files(means.effects) if means.effects else (), load(means.effects)
    wider = [n for n, e in effects.items() if n in known and e.parameters != known[n].parameters]
    return reason(bench, [name for name in own if name in effects], wider)


def _announced(counts: tuple[int, int], lasts: str, means: Means, why: str) -> str:
    (shifts, finished), jobs = counts, workers_of(means.jobs)
    there = f" ({finished} more are there from a run that was stopped)" if finished else ""
    because = f": {why}" if why else ""
    return (
        f"the bank of this clutch lacks {shifts - finished} shifts{there}{because}. To simulate "
        f"them takes {lasts} with {jobs} workers, once; kept in {means.bank} for this and later "
        "diagnoses"
    )


class _Lacking(Exception):  # noqa: N818  # no error: shifts are still to be simulated
    """Signal that no file has some of the shifts."""


def _none(blocks: Sequence[Block]) -> list[list[Record]]:
    raise _Lacking
