"""``explore``: what the surrogate says of shapes that were not simulated, as one page."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from dogshape.exploration import explore_surrogate
from dogshape.pipeline.cli.console import emit, verb
from dogshape.pipeline.cli.options import Json, Sets, StudyArg, SurrogateFile
from dogshape.pipeline.cli.progress_bar import ProgressBar
from dogshape.pipeline.cli.tables.explore_tables import explored_text
from dogshape.pipeline.config.study_file import load_study
from dogshape.pipeline.store.folder import StudyFolder, default_out


@verb
def explore(
    study: StudyArg,
    surrogate: SurrogateFile = None,
    out: Annotated[Path | None, typer.Option(help="default: results/NAME/explore.html")] = None,
    set_: Sets = None,
    json: Json = False,
) -> None:
    """Page of the surrogate: effects of each number, sensitivity indices, slices.

    Nothing is simulated; all of it is the surrogate's. Designs of the front in results/NAME are
    among those that slices go through.

    Example: dogshape explore mq200 --set dog.chamfer_deg=13 --out effects.html
    """
    given = load_study(study, set_)
    page = out or StudyFolder(default_out(given)).root / "explore.html"
    record = explore_surrogate(given, surrogate, page, ProgressBar()).to_dict()
    emit(record, json, lambda: explored_text(record))
