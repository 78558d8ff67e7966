"""``shift`` and ``expect``: one engagement, and the mean of many."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Group

from dogshape.pipeline.cli.console import emit, verb
from dogshape.pipeline.cli.options import (
    Cluster,
    Jobs,
    Json,
    OneForce,
    OneMismatch,
    Sets,
    StudyArg,
    angles_of,
    point_of,
    points_of,
)
from dogshape.pipeline.cli.progress_bar import ProgressBar
from dogshape.pipeline.cli.tables.shift_tables import expectation_table, shift_table
from dogshape.pipeline.config.study_file import Study, load_study
from dogshape.pipeline.progress import WorkCounter
from dogshape.pipeline.reports.shift.animation import write_animation, write_trace
from dogshape.pipeline.simulate.evaluation import expectation_of
from dogshape.pipeline.simulate.executor import Executor
from dogshape.pipeline.simulate.kept_shifts import SHIFTS, kept_shifts, work_folder
from dogshape.pipeline.simulate.precision import FIRST, expect_to
from dogshape.pipeline.store.output_files import require_targets
from dogshape.pipeline.store.result_records import expectation_record
from dogshape.sim.errors import InputError, refusal, require_between
from dogshape.sim.shift.clutch import OperatingPoint
from dogshape.sim.shift.engagement import engage
from dogshape.sim.shift.plant import ClutchPlant
from dogshape.sim.statistics.batch import events_record, loads_record
from dogshape.sim.statistics.blocks import even_blocks, listed_blocks
from dogshape.sim.statistics.expectation import Expectation
from dogshape.sim.statistics.numerical_error import numerical_error, repeated
from dogshape.sim.strength.manufacture import require_makeable
from dogshape.sim.units import DEG

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
    set_: Sets = None,
    json: Json = False,
) -> None:
    """Simulate one engagement.

    Example: dogshape shift mq200 --mismatch-rpm 50 --force-N 469 --relative-angle-deg 10
    """
    if html is not None and html == trace:
        raise InputError(f"--html and --trace both name {html}; give two files")
    require_targets({"--html": html, "--trace": trace})
    given = load_study(study, set_)
    require_makeable(given.clutch.dog, given.limits.manufacturing)
    solver = replace(given.clutch.solver, all_dogs=all_dogs)
    clutch = replace(given.clutch, solver=solver)
    point = point_of(given, mismatch_rpm, force_N, force_rise_s, OWN_RISE)
    if not abs(relative_angle_deg) <= 1e6:
        rule, remedy = "it must be a finite angle", "give an angle in degrees"
        raise InputError(refusal("relative angle", relative_angle_deg, "deg", rule, remedy))
    result = engage(ClutchPlant(clutch), point, relative_angle_deg * DEG)
    peaks = given.torque_peaks(result.clutch, result.trace, result.loads)
    peak = None if peaks is None else peaks.whole
    if html is not None:
        write_animation(result, html, peak)
    if trace is not None:
        write_trace(result, trace)
    data = {
        "outcome": result.outcome.value,
        "shift_time_s": result.shift_time,
        "phases": [{"name": p.name, "start": p.start, "end": p.end} for p in result.phases],
        "peak_axial_force_N": result.loads.peak_axial_force,
        "events": events_record(result),
        "loads": {
            **loads_record(result),
            "torque_peak_Nm": peak,
            "torque_peak_strike_Nm": None if peaks is None else peaks.strike,
            "torque_peak_closing_Nm": None if peaks is None else peaks.closing,
        },
        "detail": result.detail,
        "solver": {
            "scheme": solver.scheme,
            "accuracy": solver.accuracy,
            "max_step_s": solver.max_step,
            "steps": result.steps,
            "evaluations": result.evaluations,
            "dogs": clutch.dog.count if all_dogs else 1,
            "contact_set": clutch.contact.name,
        },
    }
    written = [f"wrote {path}" for path in (html, trace) if path is not None]
    emit(data, json, lambda: Group(shift_table(result, peak), *written))


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
    set_: Sets = None,
    jobs: Jobs = 0,
    cluster: Cluster = None,
    json: Json = False,
) -> None:
    """Expected shift time over the relative angle.

    Example: dogshape expect mq200 --mismatch-rpm 50 --force-N 469 --angles 24
    """
    given = load_study(study, set_)
    require_makeable(given.clutch.dog, given.limits.manufacturing)
    if force_rise_s is not None and force_N is None:
        raise InputError("--force-rise-s goes with one operating point; give its speed and force")
    points = points_of(given, mismatch_rpm, force_N, force_rise_s, OWN_RISE)
    asked = given.config_hash, mismatch_rpm, force_N, force_rise_s, angles, precision
    folder = work_folder(SHIFTS, "expect", *asked)
    simulate = partial(kept_shifts, folder, jobs=jobs, cluster=cluster)
    if precision is not None:
        if angles is not None:
            raise InputError("--precision finds the number of angles itself; leave out --angles")
        require_between("--precision", precision, 1e-3, 1.0, "give for instance 0.01")
        result = _expect_to(given, points, precision, simulate)
    else:
        result = _expect_at(given, points, angles, simulate)
    emit(expectation_record(result), json, lambda: expectation_table(result))


def _expect_to(
    given: Study, points: tuple[OperatingPoint, ...], precision: float, simulate: Simulate
) -> Expectation:
    with (
        WorkCounter(ProgressBar(), FIRST * len(points)) as progress,
        simulate(progress) as executor,
    ):
        precise = expect_to(given, points, precision, executor, progress)
        error = numerical_error(precise.blocks, precise.rows, executor.run)
    return replace(precise.expectation, numerical_error=error)


def _expect_at(
    given: Study, points: tuple[OperatingPoint, ...], angles: str | None, simulate: Simulate
) -> Expectation:
    count, listed = angles_of(angles, given.file.expectation.angles)
    seed, unsure = given.file.expectation.seed, given.uncertainty
    if listed:
        blocks = listed_blocks(given.clutch, points, listed, seed, unsure)
    else:
        blocks = even_blocks(given.clutch, points, count, seed, uncertainty=unsure)
    shifts = sum(len(b.angles) for b in blocks)
    with (
        WorkCounter(ProgressBar(), shifts + repeated(shifts)) as progress,
        simulate(progress) as executor,
    ):
        rows = executor.run(blocks)
        error = numerical_error(blocks, rows, executor.run)
    result = expectation_of(given, points, rows, even=not listed)
    return replace(result, numerical_error=error)
