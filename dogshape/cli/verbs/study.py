"""``study``, ``report`` and ``fit``: the search, its report and its surrogate."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from dogshape.cli.console import ProgressBar, emit, show, verb
from dogshape.cli.options import Cluster, Engine, Jobs, Json, Sets, StudyArg, with_engine
from dogshape.fitted import fit as fit_surrogate
from dogshape.pipeline.config.study_file import load_study
from dogshape.pipeline.store.folder import StudyFolder, default_out
from dogshape.pipeline.study import Run
from dogshape.study_result import load_result, search_study


@verb
def study(
    study: StudyArg,
    out: Annotated[Path | None, typer.Option(help="default: results/NAME")] = None,
    trials: Annotated[int | None, typer.Option(min=1, help="designs to propose")] = None,
    jobs: Jobs = 0,
    cluster: Cluster = None,
    seed: Annotated[int | None, typer.Option(min=0, help="of the search")] = None,
    storage: Annotated[
        str | None,
        typer.Option(help="PostgreSQL that machines share: postgresql+psycopg://user@host/db"),
    ] = None,
    resume: Annotated[bool, typer.Option("--resume", help="go on if there is a study")] = False,
    no_report: Annotated[
        bool, typer.Option("--no-report", help="result only; 'dogshape report' makes it later")
    ] = False,
    engine: Engine = None,
    set_: Sets = None,
    json: Json = False,
) -> None:
    """Search for the best shape, then write the report.

    The report takes a minute or more for its effects and animations; --no-report leaves it out.

    Example: dogshape study mq200 --out results/mq200 --trials 48
    """
    overrides = with_engine(set_, engine)
    overrides += [f"search.trials={trials}"] if trials is not None else []
    overrides += [f"search.seed={seed}"] if seed is not None else []
    given = load_study(study, overrides)
    folder = StudyFolder(out or default_out(given))
    how = Run(folder, jobs, storage, resume, cluster, not no_report, ProgressBar())
    found = search_study(given, how)
    show(found, json)
    if found.best is None:
        raise typer.Exit(1)


@verb
def report(
    directory: Annotated[Path, typer.Argument(metavar="DIR", help="folder of a study")],
    json: Json = False,
) -> None:
    """Write the report again from what a study stored.

    Animations of its fastest and slowest shifts that are missing are simulated again, and what
    the surrogate says of each variable is worked out unless it is there.

    Example: dogshape report results/mq200
    """
    path = load_result(directory).report(progress=ProgressBar())
    emit({"report": str(path)}, json, lambda: [f"report: {path}"])


@verb
def fit(
    where: Annotated[str, typer.Argument(metavar="STUDY|DIR", help="study, or folder of one")],
    out: Annotated[Path | None, typer.Option(help="default: surrogate.json of the folder")] = None,
    jobs: Jobs = 0,
    cluster: Cluster = None,
    engine: Engine = None,
    set_: Sets = None,
    json: Json = False,
) -> None:
    """Fit the surrogate and judge it on designs that it has not seen.

    A folder of results is fitted as it is. For a study, designs that fill its space are
    simulated first into results/NAME-space, and references apart to judge by, in the compiled
    engine unless the study names another.

    Example: dogshape fit results/mq200
    """
    found = fit_surrogate(
        where, with_engine(set_, engine), out=out, jobs=jobs, cluster=cluster,
        progress=ProgressBar(),
    )  # fmt: skip
    show(found, json)
