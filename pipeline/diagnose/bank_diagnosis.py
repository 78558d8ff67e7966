"""Diagnosis of a bench data set, and plan of its shifts: the bank of simulations first.

The package brings the bank of the published clutch at the operating points of its tables
(``studies/bench``). What it lacks is simulated once and kept in a folder, by default the user's
cache: ``bank.jsonl`` has the times of all clutches, ``shifts.jsonl`` finished shifts of an
unfinished bank. Diagnoses at once share the folder; each waits while another one simulates.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from platformdirs import user_cache_dir

from dogshape.diagnosis.bench.bench_data import (
    Bench,
    Reading,
    bundled_benches,
    gather,
    load_bench,
    require_shifts,
)
from dogshape.diagnosis.bench.stand_file import BenchRecord
from dogshape.diagnosis.diagnosis import Diagnosis, diagnose
from dogshape.diagnosis.inference.outcome import Field, field_of
from dogshape.diagnosis.inference.static_readings import measured_facts
from dogshape.diagnosis.likelihood.likelihood import Likelihood
from dogshape.diagnosis.likelihood.observed import observe
from dogshape.diagnosis.next_test import choose, require_terms
from dogshape.diagnosis.prediction.model import Model, build_models
from dogshape.diagnosis.settings import USUAL, Settings
from dogshape.pipeline.config.study_file import bundled_studies, load_study
from dogshape.pipeline.diagnose.bank import Bank
from dogshape.pipeline.progress import SILENT, Progress, WorkCounter
from dogshape.pipeline.simulate.executor import Executor
from dogshape.pipeline.store.folder import ShiftJournal
from dogshape.sim.effect import Effect
from dogshape.sim.effects import load, own_files
from dogshape.sim.errors import EffectError, InputError, StorageError
from dogshape.sim.files import writing
from dogshape.sim.setting import Setting
from dogshape.sim.statistics.blocks import Block
from dogshape.sim.statistics.shift_records import Record
from dogshape.sim.versions import bundled_root

BANK = Path(user_cache_dir("dogshape", appauthor=False)) / "bank"  #: where none is named
TIMES, SHIFTS = "bank.jsonl", "shifts.jsonl"
PATIENCE = 3600.0  #: s, for other diagnoses that simulate
BROUGHT = bundled_root() / "bench" / TIMES  #: file of the bank that the package brings


@dataclass(frozen=True)
class Means:
    """Means of a diagnosis: banks, effects and workers."""

    bank: Path = BANK  #: folder of banks
    effects: Path | None = None  #: folder of the user's own effects
    jobs: int = 0  #: worker processes, 0 for one a core
    progress: Progress = SILENT
    engine: str = "planar"  #: of the bank
    settings: Settings = USUAL


def diagnosed(bench: Bench, means: Means) -> Diagnosis:
    """Diagnose a data set; simulate the shifts that no bank has.

    DataError where no shift has a time, EffectError for an effect that cannot be run.
    """
    require_shifts(bench, times=True)
    effects = load(means.effects)
    require_terms(bench, effects)
    measured_facts(bench, effects)  # refuses a wrong one before the long work
    _require_working(effects, bench, means)
    bench = replace(bench, clutch=bench.clutch.with_engine(means.engine))
    found = diagnose(bench, models_of(bench, effects, means), means.settings)
    return replace(found, tests=choose(found))


def models_of(bench: Bench, effects: Mapping[str, Effect], means: Means) -> dict[str, Model]:
    """Build the predictions of a data set, by the place where displacement may be read."""
    notes, known = list[str](), Bank((BROUGHT, means.bank / TIMES))
    run = partial(shifts_of, means=means, notes=notes, known=known)
    return build_models(bench, effects, means.settings, run)


def shifts_of(
    blocks: Sequence[Block], means: Means, notes: list[str], known: Bank
) -> list[list[Record]]:
    """Take ``known`` shifts; simulate and keep what no file has; ``notes`` were said before."""
    if not known.missing(blocks):
        return known.times(blocks, lambda _: [])
    with writing(means.bank, PATIENCE, means.progress.say):
        known.read()  # another run may have written since
        lacking = known.missing(blocks)
        journal = ShiftJournal(means.bank / SHIFTS)
        left = sum(len(block.angles) for block in lacking)
        if not notes:
            notes.append(
                f"the bank of this clutch lacks {left} shifts; they are simulated once "
                f"and kept in {means.bank} for this and later diagnoses"
            )
            means.progress.say(notes[0])
        kept = f"{means.bank}; the same command goes on from there"
        with WorkCounter(means.progress, left, kept=kept) as counter:
            rows = known.times(blocks, Executor(journal, means.jobs, counter.advance).run)
        journal.say_unfinished(means.progress.say)
        with suppress(StorageError):  # the file of banks has them
            journal.drop({key for block in lacking for key in block.keys})
        return rows


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
            neutral = effects[name].neutral(base)
            if neutral and effects[name].apply(base, neutral) != base:
                given = ", ".join(f"{key} = {value:g}" for key, value in neutral.items())
                raise EffectError(
                    f"with its neutral values ({given}) the effect {name} changes the clutch or "
                    "its shift, but neutral values have to change nothing; correct neutral="
                )
        except EffectError as error:
            raise EffectError(f"{path}: {error}") from error


def points_from(where: str | Path) -> Bench:
    """Read the operating points and the clutch of a data set, or of a study; times do not matter.

    Raises InputError or DataError where there is neither, or it cannot be read.
    """
    path = Path(where)
    if (path / "bench.toml").is_file() or str(where) in bundled_benches():
        return load_bench(where)
    if path.is_file() or (path / "study.toml").is_file() or str(where) in bundled_studies():
        study = load_study(where)
        rows = [Reading(k, point, 1, None, None) for k, point in enumerate(study.points, start=2)]
        return Bench(
            name=study.name,
            source=f"study {where}",
            clutch=study.clutch,
            cells=gather(rows),
            record=BenchRecord(displacement_at="sleeve"),
        )
    names = ", ".join([*bundled_benches(), *bundled_studies()])
    raise InputError(
        f"there is no data set and no study at {where}: give a folder with bench.toml and "
        f"shifts.csv, a study file, or a bundled name ({names})"
    )


def predicted_field(bench: Bench, means: Means) -> Field:
    """Predict the effects at the operating points of a bench; simulates what no bank has."""
    bench = replace(bench, clutch=bench.clutch.with_engine(means.engine))
    model = next(iter(models_of(bench, load(means.effects), means).values()))
    # A drift of the data set is none of the shifts that are planned.
    seen = replace(observe(bench, model), drift=None)
    return field_of(Likelihood(bench, seen, model, means.settings))
