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
from dogshape.sim.bundled import bundled_root
from dogshape.sim.errors import InputError
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
        str, typer.Option(help="published, tuning or (engine planar) wide: strengths and draws")
    ] = "",
    size: Annotated[str, typer.Option(help="full (130 to 170 cases) or small")] = "full",
    seed: Annotated[int | None, typer.Option(min=0, help="default: that of the set")] = None,
    engine: Annotated[str, typer.Option(help="of the truths: mujoco or planar")] = "mujoco",
    jobs: Jobs = 0,
    json: Json = False,
) -> None:
    """Write data of cases with known effects from a second engine, and the sealed key.

    Example: dogshape blind make results/blind --size small
    """
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
    total = len(manifest_of(folder)["cases"])
    # It loads the simulation, which making and scoring without pairs do not need.
    diagnose_folder = import_module("dogshape.validation.blind.case_diagnosis").diagnose_folder
    alone, beside = (partial(diagnose_folder, jobs=n) for n in (jobs, 1))
    with WorkCounter(ProgressBar(), total, unit="cases") as progress:
        found = run_cases(folder, beside, _processes(jobs), progress.advance, alone)
    emit({"cases": found}, json, lambda: run_table(found))


@blind.command()
@verb
def score(folder: Folder, jobs: Jobs = 0, json: Json = False) -> None:
    """Open the key and say how often the diagnosis was right, with intervals.

    Example: dogshape blind score results/blind --json
    """

    def seen_by(case: Path) -> Seen:
        found: Seen = import_module("dogshape.validation.blind.case_diagnosis").seen_by(case, jobs)
        return found

    with WorkCounter(ProgressBar(), 0) as progress:
        found = score_of(folder, seen_by, progress, _processes(jobs))
    emit(found, json, lambda: score_table(found))


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
