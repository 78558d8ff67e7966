"""``blind``: cases whose effect is withheld, their diagnosis, and its score."""

from __future__ import annotations

import os
from importlib import import_module
from pathlib import Path
from typing import Annotated, Any

import typer

from dogshape.cli.console import emit, verb
from dogshape.cli.options import Jobs, Json
from dogshape.cli.progress_bar import ProgressBar
from dogshape.cli.tables.blind_tables import made_lines, run_table, score_table
from dogshape.pipeline.progress import WorkCounter
from dogshape.validation.blind.cases import SEED
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
    small: Annotated[bool, typer.Option("--small", help="a case of each kind only")] = False,
    seed: Annotated[int | None, typer.Option(min=0, help=f"of the draws; default {SEED}")] = None,
    jobs: Jobs = 0,
    json: Json = False,
) -> None:
    """Write data of cases with known effects from two engines, and the sealed key.

    Example: dogshape blind make results/blind --small
    """
    field_set = import_module("dogshape.validation.blind.field_set")
    cases = field_set.cases_of(seed, small=small)
    with WorkCounter(ProgressBar(), len(cases), unit="cases") as progress:
        manifest = field_set.make_field(
            folder, cases, _diagnosis().likelihood_of, _processes(jobs), progress.advance
        )
    emit(manifest, json, lambda: made_lines(folder, manifest))


@blind.command()
@verb
def run(folder: Folder, jobs: Jobs = 0, json: Json = False) -> None:
    """Diagnose each case from its data alone; goes on where it was stopped.

    Example: dogshape blind run results/blind
    """
    total = len(manifest_of(folder)["cases"])
    diagnose = _diagnosis().diagnose_folder
    with WorkCounter(ProgressBar(), total, unit="cases") as progress:
        found = run_cases(folder, diagnose, _processes(jobs), progress.advance)
    emit({"cases": found}, json, lambda: run_table(found))


@blind.command()
@verb
def score(folder: Folder, json: Json = False) -> None:
    """Open the key and say how often the diagnosis was right, with intervals.

    Example: dogshape blind score results/blind --json
    """
    scoring = import_module("dogshape.validation.blind.score")
    found = scoring.score_field(folder, _diagnosis().advised)
    emit(found, json, lambda: score_table(found))


def _diagnosis() -> Any:
    """Load what diagnoses a case, with the simulation."""
    return import_module("dogshape.validation.blind.case_diagnosis")


def _processes(jobs: int) -> int:
    return jobs or os.cpu_count() or 1
