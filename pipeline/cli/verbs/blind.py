"""``blind``: cases whose effect is withheld, their diagnosis, and its score."""

from __future__ import annotations

import os
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Annotated, Any

import typer

from dogshape.pipeline.cli.console import emit, verb
from dogshape.pipeline.cli.options import Jobs, Json
from dogshape.pipeline.cli.progress_bar import ProgressBar
from dogshape.pipeline.cli.tables.blind_tables import (
    field_table,
    made_lines,
    run_table,
    score_table,
)
from dogshape.pipeline.progress import WorkCounter
from dogshape.sim.bundled import bundled_root
from dogshape.sim.errors import InputError
from dogshape.validation.blind.field_cases import WHICH
from dogshape.validation.blind.field_score import score_field
from dogshape.validation.blind.field_set import STANDS, FieldWanted, make_field
from dogshape.validation.blind.pair_refit import Seen
from dogshape.validation.blind.score import score as score_of
from dogshape.validation.blind.sealed import Wanted, manifest_of, points_for
from dogshape.validation.blind.sealed import make as make_cases
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
    bench: Annotated[
        str, typer.Option(help="data set whose clutch and operating points are taken")
    ] = "mq200_adams",
    which: Annotated[
        str,
        typer.Option(
            help="published, tuning, (engine planar) wide: strengths and draws; or field: three "
            "engines and three clutches of its own"
        ),
    ] = "",
    size: Annotated[str, typer.Option(help="full (130 to 310 cases) or small")] = "full",
    seed: Annotated[int | None, typer.Option(min=0, help="default: that of the set")] = None,
    engine: Annotated[
        str, typer.Option(help="of the truths: mujoco or planar; field has all")
    ] = "mujoco",
    jobs: Jobs = 0,
    json: Json = False,
) -> None:
    """Write data of cases with known effects from a second engine, and the sealed key.

    Example: dogshape blind make results/blind --size small
    """
    if which == WHICH:
        sealed = _field(folder, size, seed, jobs)
        emit(sealed, json, lambda: made_lines(folder, sealed))
        return
    usual = "wide" if engine == "planar" else "published"
    wanted = Wanted(_base(bench), which or usual, size, seed, engine)
    points_for(wanted)  # refuses a bad stand before anything is simulated
    with WorkCounter(ProgressBar(), _count(wanted), unit="cases") as progress:
        manifest = make_cases(folder, wanted, _processes(jobs), progress.advance)
    emit(manifest, json, lambda: made_lines(folder, manifest))


@blind.command()
@verb
def run(folder: Folder, jobs: Jobs = 0, json: Json = False) -> None:
    """Diagnose each case from its data alone; goes on where it was stopped.

    Example: dogshape blind run results/blind
    """
    manifest = manifest_of(folder)
    total = len(manifest["cases"])
    # It loads the simulation, which making and scoring without pairs do not need.
    diagnosis = import_module("dogshape.validation.blind.case_diagnosis")
    alone, beside = (partial(diagnosis.diagnose_folder, jobs=n) for n in (jobs, 1))
    if manifest.get("set") == WHICH:
        for stand in sorted((folder / STANDS).iterdir()):
            diagnosis.seen_by(stand, jobs)  # one bank serves all cases on a clutch
    with WorkCounter(ProgressBar(), total, unit="cases") as progress:
        found = run_cases(folder, beside, _processes(jobs), progress.advance, alone)
    emit({"cases": found}, json, lambda: run_table(found))


@blind.command()
@verb
def score(folder: Folder, jobs: Jobs = 0, json: Json = False) -> None:
    """Open the key and say how often the diagnosis was right, with intervals.

    Example: dogshape blind score results/blind --json
    """

    if manifest_of(folder).get("set") == WHICH:
        emit(beside := score_field(folder), json, lambda: field_table(beside))
        return

    def seen_by(case: Path) -> Seen:
        found: Seen = import_module("dogshape.validation.blind.case_diagnosis").seen_by(case, jobs)
        return found

    with WorkCounter(ProgressBar(), 0) as progress:
        found = score_of(folder, seen_by, progress, _processes(jobs))
    emit(found, json, lambda: score_table(found))


def _field(folder: Path, size: str, seed: int | None, jobs: int) -> dict[str, Any]:
    """Make a field set; its cases count twice, data and yardstick."""
    wanted = FieldWanted(size, seed)
    seen = import_module("dogshape.validation.blind.case_diagnosis").seen_by
    with WorkCounter(ProgressBar(), 2 * len(wanted.cases), unit="cases") as progress:
        return make_field(folder, wanted, seen, _processes(jobs), progress.advance)


def _base(bench: str) -> Path:
    """Return the folder of a data set, given or bundled."""
    for folder in (Path(bench), bundled_root() / "bench" / bench):
        if (folder / "bench.toml").is_file() and (folder / "shifts.csv").is_file():
            return folder
    raise InputError(
        f"--bench is '{bench}', but there is no data set of that name; give a folder with "
        "bench.toml and shifts.csv, or mq200_adams"
    )


def _processes(jobs: int) -> int:
    return jobs or os.cpu_count() or 1


def _count(wanted: Wanted) -> int:
    from dogshape.validation.blind.cases import cases_of  # noqa: PLC0415

    return len(cases_of(wanted.which, wanted.size, wanted.seed))
