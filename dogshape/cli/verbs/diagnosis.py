"""Verbs on the cause of a difference between bench and simulation."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from typer import Argument, Option

import dogshape as ds
from dogshape.cli import dialogue
from dogshape.cli.options import (
    BenchOrTable,
    Columns,
    Corrections,
    Decimal,
    Drop,
    FillDown,
    Jobs,
    Json,
    Keep,
    Origin,
    Quotes,
    RiseTime,
    Rows,
    Sets,
    SizeLimits,
    bench_draft,
    emit,
    show,
)
from dogshape.sim.errors import DogshapeError, InputError
from dogshape.sim.interface import argument

if TYPE_CHECKING:
    from dogshape.bench.bench_draft import DraftTables

Bank = Annotated[
    Path | None, Option(help="folder of simulations that diagnoses share; default: user's cache")
]
Effects = Annotated[Path | None, Option(help="folder with effects of your own, a file each")]


def diagnose(
    bench: BenchOrTable,
    out: Annotated[Path | None, Option(help="for report.html, gap.json and cells.csv")] = None,
    bank: Bank = None,
    effects: Effects = None,
    study: Annotated[str | None, Option(help="study: effect on its choice")] = None,
    write: Annotated[Path | None, Option(metavar="FILE", help="calibrated study")] = None,
    base: Annotated[str | None, Option(help="with --write: study to calibrate")] = None,
    causes: Annotated[str | None, Option(help="with --write: other effects, A,B")] = None,
    draws: Annotated[int, Option(min=1, max=100_000, help="with --write: draws")] = 200,
    engine: Annotated[str, Option(help="planar or drake, which takes hours")] = "planar",
    seed: Annotated[int, Option(min=0, help="of the random draws of the inference")] = 1,
    correct: Corrections = None,
    origin: Origin = None,
    column: Columns = None,
    rise_s: RiseTime = None,
    decimal: Decimal = None,
    rows: Rows = None,
    drop: Drop = None,
    keep: Keep = None,
    fill_down: FillDown = False,
    limit: SizeLimits = None,
    quotes: Quotes = None,
    set_: Sets = None,
    jobs: Jobs = 0,
    json: Json = False,
) -> None:
    """Identify the cause of the gap between bench and simulation.

    A table is read as by 'init bench', with the same options from --from to --set; its readings and
    assumptions are printed first, and a fault is asked about in a terminal. The steps of reading
    are printed by 'init bench TABLE --explain', evidence and residuals are in the report of --out.
    Simulations of a clutch and its operating points take two to fifteen minutes
    of processor time, once; those of a refinement cannot be foreseen.

    Example: dogshape diagnose measured.csv --out results/gap --column shift_time_s=t90:ms
    """
    for option, text in (("--base", base), ("--causes", causes)):
        if text is not None and write is None:
            raise InputError(
                f"{option} is '{text}', but no study is written; give --write FILE too"
            )
    effect_names = None if causes is None else [name.strip() for name in causes.split(",")]
    if write is not None:  # refuses its faults before the long diagnosis
        from dogshape.pipeline.diagnose import calibrated_study  # noqa: PLC0415
        from dogshape.sim.effects import load  # noqa: PLC0415

        if effect_names is not None:
            calibrated_study.require_effects(effect_names, load(effects))
        calibrated_study.require_new_study(write, base)
    tables = _read_draft(
        bench,
        origin=origin,
        column=column,
        rise_s=rise_s,
        decimal=decimal,
        rows=rows,
        drop=drop,
        keep=keep,
        fill_down=fill_down,
        limit=limit,
        quotes=quotes,
        set_=set_,
    )
    diagnosis = ds.diagnose(
        tables or bench,
        correct=correct or (),
        out=out,
        bank=bank,
        effects=effects,
        study=study,
        engine=engine,
        seed=seed,
        jobs=jobs,
        progress=True,
    )
    if write is None:
        show(diagnosis, json)
        return
    try:
        calibrated = diagnosis.calibrated(write, base, draws, effect_names)
    except (DogshapeError, OSError):
        show(diagnosis, json)  # long work, and an answer by itself
        raise
    lines = [
        "",
        f"study: {write} ({', '.join(calibrated.effects) or 'its own keys'}); "
        f"{len(calibrated.draws)} draws from the posterior: {calibrated_study.draws_beside(write)}",
        *(f"note: {remark}" for remark in calibrated.remarks),
    ]
    record = {**diagnosis.to_dict(), "calibrated": calibrated.to_dict(write)}
    emit(record, json, lambda: [*diagnosis.to_parts(), *lines])


def _read_draft(bench: str, **options: Any) -> DraftTables | None:
    """Read a table and print its reading; None for the folder of a data set.

    A fault is asked about in a terminal. ``options`` are those of ``bench_draft``; InputError for
    an option that a folder does not take.
    """
    from dogshape.bench.bench_draft import is_table, read_tables  # noqa: PLC0415

    if not is_table(bench):
        for name, value in options.items():
            if value:
                option = argument("settings" if name == "set_" else name)
                raise InputError(
                    f"{option} says how a table is read, but {bench} is no table; give the table, "
                    "such as measured.csv, or change bench.toml of the data set"
                )
        return None
    draft = bench_draft([bench], **options)
    if dialogue.may_ask():
        return dialogue.correct_reading(draft, confirm=False)
    tables = read_tables(draft)
    if not tables.report.faults:
        dialogue.print_reading(tables.report)
    return tables


def plan_shifts(
    where: Annotated[str, Argument(metavar="BENCH_DIR|STUDY", help="operating points")],
    shifts: Annotated[int, Option(help="shifts in all, at least 20")],
    points: Annotated[int | None, Option(min=1, help="operating points, at most")] = None,
    seed: Annotated[int, Option(min=0, help="of the random order")] = 1,
    out: Annotated[
        Path | None, Option(metavar="FILE", help="table to fill in, CSV or .xlsx")
    ] = None,
    bank: Bank = None,
    effects: Effects = None,
    jobs: Jobs = 0,
    json: Json = False,
) -> None:
    """Plan the shifts of a bench so that they distinguish causes.

    The order is random but for a reference point at the beginning, in the middle and at the end,
    so that a drift of the stand shows. Times of a data set are not used.

    Example: dogshape plan-shifts mq200_stand --shifts 120 --out shifts.csv
    """
    plan = ds.plan_shifts(
        where,
        shifts,
        points=points,
        seed=seed,
        out=out,
        bank=bank,
        effects=effects,
        jobs=jobs,
        progress=True,
    )
    show(plan, json)


def update_diagnosis(
    folder: Annotated[Path, Argument(metavar="DIR", help="--out of an earlier diagnosis")],
    new: Annotated[Path, Argument(metavar="NEW.csv", help="or .xlsx; columns as in shifts.csv")],
    bank: Bank = None,
    effects: Effects = None,
    jobs: Jobs = 0,
    json: Json = False,
) -> None:
    """Add new readings to a diagnosis, and compare both answers.

    Units, corrections and effects of your own are those of the earlier data. The folder keeps the
    earlier record as gap-0.json, gap-1.json and so on, and all updates in updates.json.

    Example: dogshape update-diagnosis results/gap-stand new.csv
    """
    update = ds.update_diagnosis(folder, new, bank=bank, effects=effects, jobs=jobs, progress=True)
    show(update, json)
