"""``gap``: which effect makes a bench differ from the simulation."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from dogshape.gap import diagnose
from dogshape.pipeline.cli.console import emit, verb
from dogshape.pipeline.cli.options import Corrections, Jobs, Json
from dogshape.pipeline.cli.progress_bar import ProgressBar
from dogshape.pipeline.cli.tables.gap_tables import diagnosis_table
from dogshape.pipeline.diagnose.bank_diagnosis import BANK


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
    correct: Corrections = None,
    jobs: Jobs = 0,
    json: Json = False,
) -> None:
    """Find which unmodelled effect makes a bench differ from the simulation.

    The simulations of a clutch and its operating points take about half an hour on two cores,
    once; those of the published clutch come with the package.

    Example: dogshape gap mq200_stand --out results/gap-stand
    """
    found = diagnose(
        bench, correct=correct or (), out=out, bank=bank, effects=effects, study=study, jobs=jobs,
        progress=ProgressBar(),
    )  # fmt: skip
    record = found.to_dict()
    emit(record, json, lambda: diagnosis_table(found.inference, record))
