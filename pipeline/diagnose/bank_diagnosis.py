"""Diagnosis of a bench data set, and plan of its shifts: the bank of simulations first.

The package brings the bank of the published clutch at the operating points of its tables
(``studies/bench``). What it lacks is simulated once and kept in a folder, by default the user's
cache: ``bank.jsonl`` has the times of all clutches, ``shifts.jsonl`` finished shifts of an
unfinished bank. Diagnoses at once share the folder; each waits while another one simulates.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from platformdirs import user_cache_dir
from threadpoolctl import threadpool_limits

from dogshape.bench.bench_data import (
    Bench,
    Reading,
    bundled_benches,
    gather,
    load_bench,
    require_shifts,
)
from dogshape.bench.stand_file import BenchRecord
from dogshape.diagnosis.diagnosis import Inference, diagnose
from dogshape.diagnosis.inference.outcome import Field, field_of
from dogshape.diagnosis.inference.static_readings import measured_facts
from dogshape.diagnosis.likelihood.likelihood import Likelihood
from dogshape.diagnosis.likelihood.observed import observe
from dogshape.diagnosis.next_test import rank_tests, require_terms
from dogshape.diagnosis.prediction.building import build_models, untried_effects
from dogshape.diagnosis.prediction.model import Model
from dogshape.diagnosis.settings import USUAL, Settings
from dogshape.pipeline.config.study_file import bundled_studies, load_study
from dogshape.pipeline.diagnose.bank import Bank
from dogshape.pipeline.progress import SILENT, Progress, WorkCounter
from dogshape.pipeline.simulate.executor import Executor
from dogshape.pipeline.store.folder import ShiftJournal, create_folder
from dogshape.sim.effect import Effect
from dogshape.sim.effects import effect_files, load
from dogshape.sim.errors import EffectError, InputError, StorageError
from dogshape.sim.interface import argument
from dogshape.sim.setting import Setting
from dogshape.sim.statistics.blocks import Block
from dogshape.sim.statistics.shift_records import Record
from dogshape.sim.versions import bundled_root

BANK = Path(user_cache_dir("dogshape", appauthor=False)) / "bank"  #: default folder of banks
TIMES = "bank.jsonl"  #: file of a bank
SHIFTS = "shifts.jsonl"  #: file of finished shifts of an unfinished bank
BUNDLED_BANK = bundled_root() / "bench" / TIMES  #: bank of the published benches, in a clone


@dataclass(frozen=True)
class BankOptions:
    """Bank, effects and workers of a diagnosis."""

    bank: Path = BANK  #: folder of banks
    effects: Path | None = None  #: folder of the user's own effects
    jobs: int = 0  #: worker processes, 0 for one a core
    progress: Progress = SILENT
    engine: str = "planar"  #: of the bank
    settings: Settings = USUAL


def diagnose_bench(bench: Bench, options: BankOptions) -> Inference:
    """Diagnose a data set; simulate the shifts that no bank has.

    DataError where no shift has a time, EffectError for an effect that cannot be run.
    """
    require_shifts(bench, times=True)
    effects = load(options.effects)
    require_terms(bench, effects)
    measured_facts(bench, effects)  # refuses a wrong one before the long work
    _require_working(effects, bench, options)
    bench = replace(bench, clutch=bench.clutch.with_engine(options.engine))
    # More threads take longer for matrices of some hundred rows, and sum in another order.
    with threadpool_limits(limits=1, user_api="blas"):
        models = models_of(bench, effects, options)
        diagnosis = diagnose(bench, models, options.settings)
        return replace(diagnosis, tests=rank_tests(diagnosis))


def models_of(
    bench: Bench, effects: Mapping[str, Effect], options: BankOptions
) -> dict[str, Model]:
    """Build the predictions of a data set, by the place where displacement may be read."""
    for name, reason in untried_effects(bench, effects).items():
        options.progress.say(f"the effect {name} is not tried: {reason}")
    bank = Bank((BUNDLED_BANK, options.bank / TIMES))
    run = partial(shifts_of, options=options, rounds=SimulationRounds(), bank=bank)
    return build_models(bench, effects, options.settings, run)


class SimulationRounds:
    """Rounds of missing shifts of a diagnosis; their number depends on the likely causes."""

    def __init__(self) -> None:
        self.count = 0
        self._start_time = 0.0  #: s, of the first round

    def begin(self) -> str:
        """Count a round; return its place in the diagnosis."""
        now = time.monotonic()
        self._start_time = self._start_time or now
        self.count += 1
        place = f"round {self.count} of the diagnosis"
        if self.count == 1:
            return place
        return f"{place}, {(now - self._start_time) / 60.0:.0f} min after the first"


def shifts_of(
    blocks: Sequence[Block], options: BankOptions, rounds: SimulationRounds, bank: Bank
) -> list[list[Record]]:
    """Return the shifts of blocks from a bank; simulate and store missing series.

    The message on missing shifts appears in the first of the ``rounds``. Several runs may write to
    a bank at once; a series that two of them lack is simulated by both.
    """
    missing_series = _MissingSeries(options, rounds)
    rows = bank.times(blocks, missing_series.simulate)
    missing_series.drop_journal()
    return rows


class _MissingSeries:
    """Simulation of series that no bank has; a journal keeps shifts until the bank has them."""

    def __init__(self, options: BankOptions, rounds: SimulationRounds) -> None:
        self._options = options
        self._rounds = rounds
        self._journal: ShiftJournal | None = None
        self._keys = set[str]()

    def simulate(self, missing: Sequence[Block]) -> list[list[Record]]:
        """Simulate missing series by the finished shifts of the journal."""
        options = self._options
        create_folder(options.bank)
        self._journal = ShiftJournal(options.bank / SHIFTS)
        self._keys.update(key for block in missing for key in block.keys)
        count = sum(len(block.angles) for block in missing)
        stage = self._rounds.begin()
        if self._rounds.count == 1:
            self._say_missing(count)
        resumption = f"{options.bank}; the same command goes on from there"
        counter = WorkCounter(options.progress, count, resumption=resumption, stage=stage)
        with counter:
            return Executor(self._journal, options.jobs, counter.advance).run(missing)

    def _say_missing(self, count: int) -> None:
        """Report the number of missing shifts of the first round."""
        message = (
            f"the bank of this clutch lacks {count} shifts; they are simulated once "
            f"and kept in {self._options.bank} for this and later diagnoses; further rounds follow "
            "until the probabilities of the causes settle"
        )
        if not BUNDLED_BANK.is_file():  # the package is a wheel
            message += (
                "; the folder studies/bench of a clone of the repository has those of the "
                f"published benches, for {argument('bank')}"
            )
        self._options.progress.say(message)

    def drop_journal(self) -> None:
        """Drop the journal's shifts, which the bank has now."""
        if self._journal is None:
            return
        self._journal.say_unfinished(self._options.progress.say)
        with suppress(StorageError):  # the file of banks has them
            self._journal.drop(self._keys)


def _require_working(effects: Mapping[str, Effect], bench: Bench, options: BankOptions) -> None:
    """Raise EffectError, with its file, for an effect of the user's that cannot be run."""
    paths = effect_files(options.effects) if options.effects else {}
    if options.effects and not paths:
        options.progress.say(
            f"{options.effects} has no effect: no file NAME.py without an underscore before it"
        )
    base = Setting(bench.clutch, bench.cells[0].point)
    for name, path in paths.items():
        try:
            effects[name].require_working(base)
            _require_neutral(name, effects[name], base)
        except EffectError as error:
            raise EffectError(f"{path}: {error}") from error


def _require_neutral(name: str, effect: Effect, base: Setting) -> None:
    """Raise EffectError for an effect that changes a setting at its neutral values."""
    neutral = effect.neutral(base)
    if neutral and effect.apply(base, neutral) != base:
        values = ", ".join(f"{key} = {value:g}" for key, value in neutral.items())
        raise EffectError(
            f"with its neutral values ({values}) the effect {name} changes the clutch or "
            "its shift, but neutral values have to change nothing; correct neutral="
        )


def load_points(place: str | Path) -> Bench:
    """Read the clutch and the operating points of a data set or a study, without times.

    ``place`` is a folder, a study file or a bundled name. Raises InputError or DataError where
    there is neither, or it cannot be read.
    """
    path = Path(place)
    if (path / "bench.toml").is_file() or str(place) in bundled_benches():
        return load_bench(place)
    if path.is_file() or (path / "study.toml").is_file() or str(place) in bundled_studies():
        study = load_study(place)
        readings = [
            Reading(row, point, 1, None, None) for row, point in enumerate(study.points, start=2)
        ]
        return Bench(
            name=study.name,
            source=f"study {place}",
            clutch=study.clutch,
            cells=gather(readings),
            record=BenchRecord(displacement_at="sleeve"),
        )
    names = ", ".join([*bundled_benches(), *bundled_studies()])
    raise InputError(
        f"there is no data set and no study at {place}: give a folder with bench.toml and "
        f"shifts.csv, a study file, or a bundled name ({names})"
    )


def predict_field(bench: Bench, options: BankOptions) -> Field:
    """Predict the effects at the operating points of a bench; simulate missing shifts."""
    bench = replace(bench, clutch=bench.clutch.with_engine(options.engine))
    with threadpool_limits(limits=1, user_api="blas"):
        models = models_of(bench, load(options.effects), options)
        model = next(iter(models.values()))
        # Shifts that are planned have no part in a drift of the data set.
        observed = replace(observe(bench, model), drift=None)
        return field_of(Likelihood(bench, observed, model, options.settings))
