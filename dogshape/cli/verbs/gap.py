"""``gap``: cause of the difference between bench and simulation."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Group

from dogshape.cli.console import emit, verb
from dogshape.cli.options import Corrections, Jobs, Json
from dogshape.cli.progress_bar import ProgressBar
from dogshape.cli.tables.gap_tables import calibrated_lines, diagnosis_table
from dogshape.gap import diagnose
from dogshape.pipeline.diagnose.bank_diagnosis import BANK
from dogshape.pipeline.diagnose.calibrated_study import (
    require_effects,
    require_new_study,
)
from dogshape.pipeline.diagnose.posterior_draws import DRAWS
from dogshape.sim.effects import load
from dogshape.sim.errors import DogshapeError, InputError


@verb
def gap(
    bench: Annotated[str, typer.Argument(metavar="BENCH_DIR", help="folder of a data set")],
    out: Annotated[
        Path | None, typer.Option(help="folder for report.html, gap.json and cells.csv")
    ] = None,
    bank: Annotated[Path, typer.Option(help="folder of simulations that diagnoses share")] = BANK,
    effects: Annotated[
        Path | None, typer.Option(help="folder with effects of your own, a file each")
    ] = None,
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
    if base is not None and write is None:
        raise InputError(f"--base is '{base}', but no study is written; give --write FILE too")
    if causes is not None and write is None:
        raise InputError(f"--causes is '{causes}', but no study is written; give --write FILE too")
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
    record = found.to_dict()
    try:
        made = None if write is None else found.calibrated(write, base, draws, wanted)
    except (DogshapeError, OSError):
        # The diagnosis was long work and is an answer by itself.
        emit(record, json, lambda: diagnosis_table(found.inference, record))
        raise
    if write is None or made is None:
        emit(record, json, lambda: diagnosis_table(found.inference, record))
        return
    kept = made.as_dict(write)
    emit(
        {**record, "calibrated": kept},
        json,
        lambda: Group(diagnosis_table(found.inference, record), *calibrated_lines(kept)),
    )
