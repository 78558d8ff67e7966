"""``gap update``: new readings join the data set of an earlier diagnosis."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from dogshape.cli.console import emit, verb
from dogshape.cli.options import Jobs, Json
from dogshape.cli.progress_bar import ProgressBar
from dogshape.cli.tables.gap_tables import update_table
from dogshape.pipeline.diagnose.bank_diagnosis import BANK
from dogshape.update import update_diagnosis


@verb
def gap_update(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="--out of an earlier diagnosis")],
    new: Annotated[
        Path, typer.Argument(metavar="NEW.csv", help="new readings, columns as in shifts.csv")
    ],
    bank: Annotated[Path, typer.Option(help="folder of simulations that diagnoses share")] = BANK,
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
    emit(found.to_dict(), json, lambda: update_table(found.to_dict(), found.diagnosis.inference))
