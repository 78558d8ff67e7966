"""``blind``: cases whose effect is withheld, their diagnosis, and its score."""

from __future__ import annotations

import os
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Annotated

import typer

from dogshape.pipeline.cli.console import emit, verb
from dogshape.pipeline.cli.options import Jobs, Json
from dogshape.pipeline.cli.progress_bar import ProgressBar
from dogshape.pipeline.cli.tables.blind_tables import made_lines, run_table, score_table
from dogshape.pipeline.progress import WorkCounter
from dogshape.validation.blind.cases import SEED
from dogshape.validation.blind.field_set import STANDS, FieldWanted, make_field
from dogshape.validation.blind.score import score_field
from dogshape.validation.blind.sealed import manifest_of
from dogshape.validation.blind.sealed import run as run_cases

blind = typer.Typer(
    name="blind",
    help="Cases whose effect is withheld: make them, diagnose them, open the key and score.",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
)

Folder = Annotated[Path, typer.Argument(metavar="DIR", help="folder of the set of cases")]


@blind.command()
@verb
def make(
    folder: Folder,
    size: Annotated[str, typer.Option(help="full (309 cases) or small (12)")] = "full",
    seed: Annotated[int | None, typer.Option(min=0, help=f"of the draws; default {SEED}")] = None,
    jobs: Jobs = 0,
    json: Json = False,
) -> None:
    """Write data of cases with known effects from three engines, and the sealed key.

    Example: dogshape blind make results/blind --size small
    """
    wanted = FieldWanted(size, seed)
    total = 2 * len(wanted.cases)  # data and yardstick
    # It loads the simulation, which the score does not need.
    seen = import_module("dogshape.validation.blind.case_diagnosis").seen_by
    with WorkCounter(ProgressBar(), total, unit="cases") as progress:
        manifest = make_field(folder, wanted, seen, _processes(jobs), progress.advance)
    emit(manifest, json, lambda: made_lines(folder, manifest))


@blind.command()
@verb
def run(folder: Folder, jobs: Jobs = 0, json: Json = False) -> None:
    """Diagnose each case from its data alone; goes on where it was stopped.

    Example: dogshape blind run results/blind
    """
    total = len(manifest_of(folder)["cases"])
    diagnosis = import_module("dogshape.validation.blind.case_diagnosis")
    alone, beside = (partial(diagnosis.diagnose_folder, jobs=n) for n in (jobs, 1))
    for stand in sorted((folder / STANDS).glob("*")):
        diagnosis.seen_by(stand, jobs)  # one bank serves all cases on a clutch
    with WorkCounter(ProgressBar(), total, unit="cases") as progress:
        found = run_cases(folder, beside, _processes(jobs), progress.advance, alone)
    emit({"cases": found}, json, lambda: run_table(found))


@blind.command()
@verb
def score(folder: Folder, json: Json = False) -> None:
    """Open the key and say how often the diagnosis was right, with intervals.

    Example: dogshape blind score results/blind --json
    """
    found = score_field(folder)
    emit(found, json, lambda: score_table(found))


def _processes(jobs: int) -> int:
    return jobs or os.cpu_count() or 1
