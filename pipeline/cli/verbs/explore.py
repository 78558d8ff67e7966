"""``explore``: what the surrogate says of shapes that were not simulated, as one page."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from dogshape.pipeline.cli.console import emit, verb
from dogshape.pipeline.cli.options import Json, Sets, StudyArg, SurrogateFile
from dogshape.pipeline.cli.tables.explore_tables import explored_text
from dogshape.pipeline.config.study_file import load_study
from dogshape.pipeline.reports.surrogate.page import write_page
from dogshape.pipeline.reports.surrogate.record import explored
from dogshape.pipeline.reports.surrogate.slices import bases_of, rivals_of
from dogshape.pipeline.store.folder import StudyFolder, default_out
from dogshape.pipeline.store.output_files import require_targets
from dogshape.pipeline.train.found_surrogates import stored_surrogate


@verb
def explore(
    study: StudyArg,
    surrogate: SurrogateFile = None,
    out: Annotated[Path | None, typer.Option(help="default: results/NAME/explore.html")] = None,
    set_: Sets = None,
    json: Json = False,
) -> None:
    """Page that answers "what if": effects of each number, what matters, slices.

    Nothing is simulated; all of it is the surrogate's. Designs of the front in results/NAME are
    among those that slices go through.

    Example: dogshape explore mq200 --set dog.chamfer_deg=13 --out what-if.html
    """
    given = load_study(study, set_)
    stored, source = stored_surrogate(given, surrogate)
    folder = StudyFolder(default_out(given))
    path = out or folder.root / "explore.html"
    require_targets({"--out": path}, folders=True)
    result = folder.stored_result() if folder.result.is_file() else None
    bases = bases_of(given, result)
    found = explored(given, stored, bases, lambda line: typer.echo(line, err=True))
    offered = {"front_designs": len(rivals_of(given, result)), "front_shown": len(bases) - 1}
    record = {"file": str(path), "surrogate": str(source), **offered, **found}
    write_page(record, path)
    emit(record, json, lambda: explored_text(record))
