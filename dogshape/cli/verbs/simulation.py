"""``shift``, ``expect`` and ``validate``: one engagement, the mean of many, and bench data."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from dogshape.bench import Bench, simulate_bench
from dogshape.cli.console import ProgressBar, show, verb, warn
from dogshape.cli.options import (
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
from dogshape.expectation import expect_draws, simulate_mean
from dogshape.pipeline.config.study_file import load_study
from dogshape.pipeline.reports.shift_page import write_trace
from dogshape.pipeline.simulate.executor import SHIFTS
from dogshape.pipeline.simulate.plausibility import folded, slips_of
from dogshape.pipeline.store.folder import require_targets
from dogshape.running import Where
from dogshape.shift import simulate_shift
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
    given = load_study(study, with_engine(set_, engine))
    found = simulate_shift(
        given, mismatch_rpm, force_N, relative_angle_deg, force_rise_s, all_dogs=all_dogs
    )
    warn([*slips_of(given), *folded(given.clutch.dog, [relative_angle_deg])])
    if html is not None:
        found.report(html)
    if trace is not None:
        write_trace(found.engagement, trace)
    written = [f"wrote {path}" for path in (html, trace) if path is not None]
    show(found, json, *(f"warning: {one}" for one in found.warnings), *written)


@verb
def expect(
    study: StudyArg,
    mismatch_rpm: OneMismatch = None,
    force_N: OneForce = None,
    force_rise_s: Rise = None,
    angles: Annotated[
        str | None,
        typer.Option(help="how many evenly spaced ones, or relative angles in degrees: A,B,C"),
    ] = None,
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
    if draws is not None:
        others = mismatch_rpm, force_N, force_rise_s, precision, cluster
        if any(other is not None for other in others):
            raise InputError(
                f"--draws is {draws}, which goes with all operating points and --angles, --set, "
                "--engine and --jobs alone; leave out the others"
            )
        count = angles_of(angles)
        if count is not None and not isinstance(count, int):
            raise InputError(f"--angles is '{angles}', but --draws takes a number; give one")
        spread = expect_draws(
            study, draws, with_engine(set_, engine), angles=count, jobs=jobs, progress=ProgressBar()
        )
        show(spread, json)
        return
    given = load_study(study, with_engine(set_, engine))
    listed = angles_of(angles)
    warn([*slips_of(given), *folded(given.clutch.dog, listed if isinstance(listed, tuple) else ())])
    where = Where(jobs, cluster, SHIFTS, ProgressBar())
    found = simulate_mean(
        given, where, mismatch_rpm, force_N, force_rise_s, angles=listed, precision=precision
    )
    show(found, json)


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
    given = Bench(bench, correct or ())
    where = Where(jobs, None, SHIFTS, ProgressBar())
    found = simulate_bench(given.data, where, angles_of(angles), engine)
    show(found, json)
