"""``gap plan``: shifts to make before any is made."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from dogshape.cli.console import emit, verb
from dogshape.cli.options import Jobs, Json
from dogshape.cli.progress_bar import ProgressBar
from dogshape.cli.tables.plan_tables import plan_table
from dogshape.pipeline.diagnose.bank_diagnosis import BANK
from dogshape.plan import plan_shifts


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
    bank: Annotated[Path, typer.Option(help="folder of simulations that diagnoses share")] = BANK,
    effects: Annotated[
        Path | None, typer.Option(help="folder with effects of your own, a file each")
    ] = None,
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
    emit(found.to_dict(), json, lambda: plan_table(found))
