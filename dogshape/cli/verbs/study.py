"""Verbs that ask a study, its results or a bench: from one shift to the search."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path
from typing import Annotated, Any

import typer

import dogshape as ds
from dogshape.cli.console import ProgressBar, emit, show, verb, warn
from dogshape.cli.options import (
    Angles,
    Cluster,
    Corrections,
    Engine,
    Jobs,
    Json,
    OneForce,
    OneMismatch,
    Sets,
    StudyArg,
    angles_of,
    with_engine,
)
from dogshape.pipeline.simulate.executor import SHIFTS
from dogshape.pipeline.simulate.plausibility import folded, slips_of
from dogshape.pipeline.store.folder import require_targets
from dogshape.sim.errors import InputError

Mismatch = Annotated[
    float,
    typer.Option(
        help="speed of ring against ring before the shift; + runs the traction flanks together, "
        "as before an upshift (docs/mismatch.md)"
    ),
]
Force = Annotated[float, typer.Option("--force-N", help="final shift force")]
Rise = Annotated[float | None, typer.Option(help="rise time; default: the study's table")]


def _plausible(study: ds.Study, angles: Collection[float]) -> ds.Study:
    """Warn of values of a study whose unit is in doubt, and of angles beyond a pitch."""
    warn([*slips_of(study.config), *folded(study.config.clutch.dog, angles)])
    return study


@verb
def shift(
    study: StudyArg,
    mismatch_rpm: Mismatch,
    force_N: Force,
    relative_angle_deg: Annotated[
        float, typer.Option(help="lead of the output ring over dogs facing dogs")
    ],
    force_rise_s: Rise = None,
    all_dogs: Annotated[bool, typer.Option("--all-dogs", help="model every dog")] = False,
    html: Annotated[Path | None, typer.Option(help="write an animation with its curves")] = None,
    trace: Annotated[Path | None, typer.Option(help="write the time series as CSV")] = None,
    engine: Engine = None,
    set_: Sets = None,
    json: Json = False,
) -> None:
    """Simulate one engagement.

    Example: dogshape shift mq200 --mismatch-rpm 50 --force-N 469 --relative-angle-deg 10
    """
    if html is not None and html == trace:
        raise InputError(f"--html and --trace both name {html}; give two files")
    require_targets({"--html": html, "--trace": trace})
    given = ds.Study(study, with_engine(set_, engine))
    found = given.shift(
        mismatch_rpm=mismatch_rpm, force_N=force_N, angle_deg=relative_angle_deg,
        force_rise_s=force_rise_s, all_dogs=all_dogs,
    )  # fmt: skip
    _plausible(given, [relative_angle_deg])
    if html is not None:
        found.report(html)
    if trace is not None:
        found.write_trace(trace)
    written = [f"wrote {path}" for path in (html, trace) if path is not None]
    show(found, json, *(f"warning: {one}" for one in found.warnings), *written)


@verb
def expect(
    study: StudyArg,
    mismatch_rpm: OneMismatch = None,
    force_N: OneForce = None,
    force_rise_s: Rise = None,
    angles: Angles = None,
    precision: Annotated[
        float | None, typer.Option(help="wanted relative standard error, e.g. 0.01; finds N")
    ] = None,
    draws: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="table of keys, a row a draw (gap --write): an interval"),
    ] = None,
    engine: Engine = None,
    set_: Sets = None,
    jobs: Jobs = 0,
    cluster: Cluster = None,
    json: Json = False,
) -> None:
    """Expected shift time over the relative angle.

    Example: dogshape expect mq200 --mismatch-rpm 50 --force-N 469 --angles 24
    """
    settings, listed, bar = with_engine(set_, engine), angles_of(angles), ProgressBar()
    point: dict[str, Any] = {
        "mismatch_rpm": mismatch_rpm, "force_N": force_N, "force_rise_s": force_rise_s,
        "precision": precision, "cluster": cluster,
    }  # fmt: skip
    if draws is None:
        given = _plausible(ds.Study(study, settings), listed if isinstance(listed, tuple) else ())
        show(given.expect(**point, angles=listed, jobs=jobs, keep=SHIFTS, progress=bar), json)
        return
    if any(other is not None for other in point.values()):
        raise InputError(
            f"--draws is {draws}, which goes with all operating points and --angles, --set, "
            "--engine and --jobs alone; leave out the others"
        )
    if isinstance(listed, tuple):
        raise InputError(f"--angles is '{angles}', but --draws takes a number; give one")
    show(ds.expect_draws(study, draws, settings, angles=listed, jobs=jobs, progress=bar), json)


@verb
def validate(
    bench: Annotated[str, typer.Argument(metavar="BENCH_DIR", help="folder of a data set")],
    angles: Annotated[
        str | None,
        typer.Option(help="how many, or angles A,B,C in degrees; default: the set's own, or 16"),
    ] = None,
    correct: Corrections = None,
    engine: Engine = None,
    jobs: Jobs = 0,
    json: Json = False,
) -> None:
    """Simulate the operating points of a bench data set and compare.

    Example: dogshape validate mq200_adams
    """
    how: dict[str, Any] = {"engine": engine, "jobs": jobs, "keep": SHIFTS}
    given = ds.Bench(bench, correct or ())
    show(given.validate(angles_of(angles), **how, progress=ProgressBar()), json)


@verb
def strength(
    study: StudyArg,
    simulation: Annotated[
        bool, typer.Option(help="simulate the hardest landing, dog on dog")
    ] = True,
    explain: Annotated[bool, typer.Option("--explain", help="formulas, sources, keys")] = False,
    fem: Annotated[
        bool, typer.Option("--fem", help="root stress by finite elements too; extra [fem]")
    ] = False,
    engine: Engine = None,
    set_: Sets = None,
    jobs: Jobs = 0,
    json: Json = False,
) -> None:
    """Strength, self-locking and manufacturability of one design.

    The hardest landing is that of the study's operating points and angles, simulated in seconds by
    the compiled engine; --no-simulation leaves it out.

    Example: dogshape strength mq200 --set dog.height_mm=3.2
    """
    given, roots = ds.Study(study, with_engine(set_, engine)), []
    if fem:
        from dogshape.validation.finite_elements import root_check  # noqa: PLC0415

        roots = root_check.root_checks(given.config.clutch.dog, given.config.limits)
    found = given.strength(simulate=simulation, jobs=jobs, keep=SHIFTS, progress=ProgressBar())
    parts = [*found.parts, *(found.explained if explain else ())]
    record = found.to_dict()
    if fem:
        record["finite_elements"] = [one.to_dict() for one in roots]
        parts.append(root_check.root_table(roots))
    emit(record, json, lambda: parts)
    if not found.feasible:
        raise typer.Exit(1)


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
    settings = with_engine(set_, engine)
    settings += [f"search.trials={trials}"] if trials is not None else []
    settings += [f"search.seed={seed}"] if seed is not None else []
    found = ds.Study(study, settings).search(
        out, jobs=jobs, cluster=cluster, storage=storage, resume=resume, report=not no_report,
        progress=ProgressBar(),
    )  # fmt: skip
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
    path = ds.load_result(directory).report(progress=ProgressBar())
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
    how: dict[str, Any] = {"out": out, "jobs": jobs, "cluster": cluster}
    show(ds.fit(where, with_engine(set_, engine), **how, progress=ProgressBar()), json)


@verb
def compare(
    items: Annotated[
        list[str], typer.Argument(metavar="A B ...", help="e.g. results/mq200#43, mq200")
    ],
    json: Json = False,
) -> None:
    """Compare designs, studies, folders of results or contact sets with the first one.

    FOLDER#N and STUDY#N are designs. Without #N it is the chosen one, or the study's own.
    Differences are to the first item, with the error of independent means.

    Example: dogshape compare mq200#19 mq200#43 mq200#0
    """
    show(ds.compare(*items), json)
