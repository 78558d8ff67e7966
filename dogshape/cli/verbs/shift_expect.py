"""``shift`` and ``expect``: one engagement, and the mean of many."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager
from functools import partial
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Group

from dogshape.cli.console import emit, verb, warn
from dogshape.cli.options import (
    Cluster,
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
from dogshape.cli.progress_bar import ProgressBar
from dogshape.cli.tables.shift_tables import drawn_text, expectation_table, shift_table
from dogshape.drawn import expect_draws
from dogshape.expectation import simulate_mean
from dogshape.pipeline.config.study_file import load_study
from dogshape.pipeline.progress import WorkCounter
from dogshape.pipeline.reports.shift.animation import write_trace
from dogshape.pipeline.simulate.executor import Executor
from dogshape.pipeline.simulate.kept_shifts import SHIFTS
from dogshape.pipeline.simulate.plausibility import folded, slips_of
from dogshape.pipeline.store.output_files import require_targets
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
Simulate = Callable[[WorkCounter], AbstractContextManager[Executor]]
OWN_RISE = ", or give --force-rise-s"  #: for forces that the study's table lacks
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
    written = [f"warning: {one}" for one in found.warnings]
    written += [f"wrote {path}" for path in (html, trace) if path is not None]
    table = partial(shift_table, found.engagement, found.torque_peak)
    emit(found.to_dict(), json, lambda: Group(table(), *written))


def _require_alone(draws: Path, others: tuple[object, ...]) -> None:
    """Raise InputError where draws are asked for with what they do not go with."""
    if any(other is not None for other in others):
        raise InputError(
            f"--draws is {draws}, which goes with all operating points and --angles, --set, "
            "--engine and --jobs alone; leave out the others"
        )


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
        _require_alone(draws, (mismatch_rpm, force_N, force_rise_s, precision, cluster))
        count = angles_of(angles)
        if count is not None and not isinstance(count, int):
            raise InputError(f"--angles is '{angles}', but --draws takes a number; give one")
        spread = expect_draws(
            study, draws, with_engine(set_, engine), angles=count, jobs=jobs, progress=ProgressBar()
        )
        emit(spread.to_dict(), json, lambda: drawn_text(spread.facts))
        return
    given = load_study(study, with_engine(set_, engine))
    listed = angles_of(angles)
    warn([*slips_of(given), *folded(given.clutch.dog, listed if isinstance(listed, tuple) else ())])
    where = Where(jobs, cluster, SHIFTS, ProgressBar())
    found = simulate_mean(
        given, where, mismatch_rpm, force_N, force_rise_s, angles=listed, precision=precision
    )
    by = given.clutch.solver.engine
    emit(found.to_dict(), json, lambda: expectation_table(found.mean, by))
