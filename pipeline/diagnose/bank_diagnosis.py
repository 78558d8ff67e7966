"""Diagnosis of a bench data set, and plan of its shifts: the bank of simulations first.

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

from dogshape.diagnosis.bench.bench_data import Bench, Reading, gather, load_bench, require_times
from dogshape.diagnosis.bench.stand_file import BenchRecord
from dogshape.diagnosis.bench.table import COLUMNS
from dogshape.diagnosis.diagnosis import Diagnosis, diagnose
from dogshape.diagnosis.inference.next_test import require_terms
from dogshape.diagnosis.inference.shift_plan import Field, ShiftPlan, field_of, shift_plan
from dogshape.diagnosis.inference.static_readings import require_measured
from dogshape.diagnosis.likelihood.likelihood import Likelihood
from dogshape.diagnosis.likelihood.observed import observe
from dogshape.diagnosis.prediction.bank_store import BankStore
from dogshape.diagnosis.prediction.model import Model, build_models
from dogshape.diagnosis.settings import USUAL, Settings
from dogshape.pipeline.config.study_file import bundled_studies, load_study
from dogshape.pipeline.diagnose.study_keys import rounded
from dogshape.pipeline.progress import SILENT, Progress, WorkCounter, about
from dogshape.pipeline.simulate.executor import Executor, workers_of
from dogshape.pipeline.store.journal import ShiftJournal
from dogshape.sim.effect import Effect
from dogshape.sim.effects import load, own_files
from dogshape.sim.errors import EffectError, InputError
from dogshape.sim.files import writing
from dogshape.sim.setting import Setting
from dogshape.sim.statistics.blocks import Block, run_block
from dogshape.sim.statistics.shift_records import Record
from dogshape.sim.units import RPM
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
        return store.times(blocks, lambda _: [])
    with writing(means.bank, means.patience):
        store = BankStore(store.paths)  # another run may have written since
        lacking = store.missing(blocks)
        journal = ShiftJournal(means.bank / SHIFTS)
        left = sum(len(block.angles) for block in lacking)
        there = sum(key in journal.rows for block in lacking for key in block.keys)
        workers = workers_of(means.jobs)
        lasts = about((left - there) * COST[means.engine] / workers)
        kept = f" ({there} more are there from a run that was stopped)" if there else ""
        means.progress.say(
            f"the bank of this clutch lacks {left - there} shifts{kept}. To simulate them takes "
            f"{lasts} with {workers} workers, once; kept in {means.bank} for this and later "
            "diagnoses"
        )
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
    times = []
    for setting in (base, changed):
        clutch = setting.clutch.with_engine("planar")
        (row,) = run_block(Block(clutch, setting.point, (0.25 * clutch.dog.pitch_angle,)))
        times.append(setting.time_of(row))
    if None not in times and not math.isclose(*times, rel_tol=SAME_TIME):  # type: ignore[arg-type]
        given = ", ".join(f"{name} = {value:g}" for name, value in neutral.items())
        before, after = (f"{1e3 * time:.4g}" for time in times if time is not None)
        raise EffectError(
            f"with its neutral values ({given}) the effect {effect.name} moves a shift from "
            f"{before} to {after} ms, but neutral values have to change nothing; correct neutral="
        )


@dataclass(frozen=True)
class Wanted:
    """Plan that is asked for: shifts in all, seed of their order, operating points at most."""

    shifts: int
    seed: int = 1
    points: int | None = None


def points_from(where: str | Path) -> Bench:
    """Return the operating points and the clutch of a data set, or of a study.

    A plan uses no times of a data set. A study is a bench of which no shift is known yet.

    Raises
    ------
    InputError, DataError
        There is neither, or it cannot be read.
    """
    path, root = Path(where), bundled_root() / "bench"
    if (path / "bench.toml").is_file() or (root / str(where)).is_dir():
        return load_bench(where)
    if path.is_file() or (path / "study.toml").is_file() or str(where) in bundled_studies():
        study = load_study(where)
        rows = [Reading(k, point, 1, None, None) for k, point in enumerate(study.points, start=2)]
        return Bench(
            name=study.name, source=f"study {where}", clutch=study.clutch, cells=gather(rows),
            record=BenchRecord(displacement_at="sleeve"),
        )  # fmt: skip
    sets = sorted(p.name for p in root.iterdir() if p.is_dir())
    raise InputError(
        f"there is no data set and no study at {where}: give a folder with bench.toml and "
        f"shifts.csv, a study file, or a bundled name ({', '.join([*sets, *bundled_studies()])})"
    )


def planned(bench: Bench, wanted: Wanted, means: Means) -> ShiftPlan:
    """Plan shifts at the operating points of a bench; simulates what no bank has of its clutch.

    Raises InputError for a number of shifts or points that makes no plan.
    """
    if wanted.points is not None and not 1 <= wanted.points <= len(bench.cells):
        raise InputError(
            f"number of operating points is {wanted.points}, but {bench.name} has "
            f"{len(bench.cells)}; give 1 to {len(bench.cells)}"
        )
    return shift_plan(predicted_field(bench, means), wanted.shifts, wanted.seed, wanted.points)


def predicted_field(bench: Bench, means: Means) -> Field:
    """Predict the effects at the operating points of a bench."""
    bench = replace(bench, clutch=bench.clutch.with_engine(means.engine))
    model = next(iter(models_of(bench, load(means.effects), means).values()))
    # A drift of the data set is none of the shifts that are planned.
    seen = replace(observe(bench, model), drift=None)
    return field_of(Likelihood(bench, seen, model, means.settings))


def sheet(bench: Bench, plan: ShiftPlan) -> str:
    """Write the plan as a ``shifts.csv`` whose times are still to be filled in, a row a shift.

    Its column ``order`` counts the shifts, so that a drift can be seen afterwards.
    """
    lines = [",".join((*COLUMNS[:7], "order"))]
    for place, count in plan.order:
        point = bench.cells[place].point
        values = rounded(point.mismatch / RPM), rounded(point.profile.force), point.profile.rise
        for _ in range(count):
            lines.append(f"{','.join(map(str, values))},1,,,,{len(lines)}")
    return "\n".join(lines) + "\n"
