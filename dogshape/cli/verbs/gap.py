"""``gap``, ``gap plan``, ``gap update``: the cause of a difference between bench and simulation."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from dogshape.cli.console import ProgressBar, emit, show, verb
from dogshape.cli.options import Corrections, Jobs, Json
from dogshape.gap import diagnose, update_diagnosis
from dogshape.pipeline.diagnose.bank_diagnosis import BANK
from dogshape.pipeline.diagnose.calibrated_study import (
    DRAWS,
    require_effects,
    require_new_study,
)
from dogshape.plan import plan_shifts
from dogshape.sim.effects import load
from dogshape.sim.errors import DogshapeError, InputError

Bank = Annotated[Path, typer.Option(help="folder of simulations that diagnoses share")]
Effects = Annotated[Path | None, typer.Option(help="folder with effects of your own, a file each")]


@verb
def gap(
    bench: Annotated[str, typer.Argument(metavar="BENCH_DIR", help="folder of a data set")],
    out: Annotated[
        Path | None, typer.Option(help="folder for report.html, gap.json and cells.csv")
    ] = None,
    bank: Bank = BANK,
    effects: Effects = None,
    study: Annotated[
        str | None,
        typer.Option(
            help="study, or folder of its results: its best designs are simulated with the cause"
        ),
    ] = None,
    write: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="write a study with the cause; draws beside it"),
    ] = None,
    base: Annotated[
        str | None,
        typer.Option(help="with --write: study that takes it; default: the bench's own clutch"),
    ] = None,
    causes: Annotated[
        str | None,
        typer.Option(
            metavar="EFFECTS",
            help="with --write: effects, separated by commas, instead of the most probable ones",
        ),
    ] = None,
    draws: Annotated[
        int, typer.Option(min=1, max=100_000, help="with --write: draws from the posterior")
    ] = DRAWS,
    engine: Annotated[str, typer.Option(help="planar or drake, which takes hours")] = "planar",
    correct: Corrections = None,
    jobs: Jobs = 0,
    json: Json = False,
) -> None:
    """Identify the effects that make a bench differ from the simulation.

    Simulations of a clutch and its operating points take some minutes, once; those of the published
    clutch come with the package. 'dogshape gap plan' plans the shifts before, 'dogshape gap update'
    joins new ones to a diagnosis.

    Example: dogshape gap mq200_stand --out results/gap-stand
    """
    for name, given in (("--base", base), ("--causes", causes)):
        if given is not None and write is None:
            raise InputError(f"{name} is '{given}', but no study is written; give --write FILE too")
    wanted = None if causes is None else [name.strip() for name in causes.split(",")]
    if wanted is not None:
        # A misspelt name needs no diagnosis to be refused.
        require_effects(wanted, load(effects))
    if write is not None:
        require_new_study(write, base)
    found = diagnose(
        bench, correct=correct or (), out=out, bank=bank, effects=effects, study=study,
        engine=engine, jobs=jobs, progress=ProgressBar(),
    )  # fmt: skip
    try:
        made = None if write is None else found.calibrated(write, base, draws, wanted)
    except (DogshapeError, OSError):
        # The diagnosis was long work and is an answer by itself.
        show(found, json)
        raise
    if write is None or made is None:
        show(found, json)
        return
    kept = made.to_dict(write)
    lines = [
        "",
        f"study: {kept['study']} ({', '.join(kept['effects']) or 'its own keys'}); "
        f"{kept['n_draws']} draws from the posterior: {kept['draws']}",
        *(f"note: {remark}" for remark in kept["remarks"]),
    ]
    emit({**found.to_dict(), "calibrated": kept}, json, lambda: [*found.parts, *lines])


@verb
def gap_plan(
    where: Annotated[
        str,
        typer.Argument(metavar="BENCH_DIR|STUDY", help="data set or study: its operating points"),
    ],
    shifts: Annotated[int, typer.Option(help="shifts in all, at least 20")],
    points: Annotated[
        int | None, typer.Option(min=1, help="operating points that are used, at most")
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="of the random order")] = 1,
    out: Annotated[
        Path | None, typer.Option(metavar="FILE", help="table to fill in at the bench, as CSV")
    ] = None,
    bank: Bank = BANK,
    effects: Effects = None,
    jobs: Jobs = 0,
    json: Json = False,
) -> None:
    """Plan the shifts of a bench: operating points, numbers, order, and causes they distinguish.

    The order is random but for a reference point at the beginning, in the middle and at the end,
    so that a drift of the stand shows. Times of a data set are not used. A study, or a clutch of
    your own, is simulated once, as for 'dogshape gap'.

    Example: dogshape gap plan mq200_stand --shifts 120 --out shifts.csv
    """
    found = plan_shifts(
        where, shifts, points=points, seed=seed, out=out, bank=bank, effects=effects, jobs=jobs,
        progress=ProgressBar(),
    )  # fmt: skip
    show(found, json)


@verb
def gap_update(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="--out of an earlier diagnosis")],
    new: Annotated[
        Path, typer.Argument(metavar="NEW.csv", help="new readings, columns as in shifts.csv")
    ],
    bank: Bank = BANK,
    effects: Annotated[
        Path | None, typer.Option(help="folder with effects of your own; default: as before")
    ] = None,
    jobs: Jobs = 0,
    json: Json = False,
) -> None:
    """Join new readings to the data of an earlier diagnosis, and compare both answers.

    Units and corrections are those of the earlier data. The folder keeps the earlier record as
    gap-0.json, gap-1.json and so on, and all updates in updates.json.

    Example: dogshape gap update results/gap-stand new.csv
    """
    found = update_diagnosis(
        folder, new, bank=bank, effects=effects, jobs=jobs, progress=ProgressBar()
    )
    show(found, json)
