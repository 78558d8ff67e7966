"""``validate``: the simulation beside bench data."""

from __future__ import annotations

from typing import Annotated

import typer

from dogshape.diagnosis.bench.bench_data import load_bench, require_something
from dogshape.diagnosis.bench.comparison import ANGLES, compare
from dogshape.diagnosis.report.examined import examined_record
from dogshape.pipeline.cli.console import emit, verb
from dogshape.pipeline.cli.options import Corrections, Jobs, Json, angles_of
from dogshape.pipeline.cli.progress_bar import ProgressBar
from dogshape.pipeline.cli.tables.validate_tables import (
    comparison_table,
    difference_record,
    engaged_record,
)
from dogshape.pipeline.progress import WorkCounter
from dogshape.pipeline.simulate.kept_shifts import SHIFTS, kept_shifts, work_folder
from dogshape.sim.errors import InputError
from dogshape.sim.statistics.numerical_error import repeated
from dogshape.sim.statistics.shift_records import clutch_record
from dogshape.sim.units import DEG


@verb
def validate(
    bench: Annotated[str, typer.Argument(metavar="BENCH_DIR", help="folder of a data set")],
    angles: Annotated[
        str | None,
        typer.Option(help="how many, or angles A,B,C in degrees; default: the set's own, or 16"),
    ] = None,
    correct: Corrections = None,
    jobs: Jobs = 0,
    json: Json = False,
) -> None:
    """Simulate the operating points of a bench data set and compare.

    Example: dogshape validate mq200_adams
    """
    given = load_bench(bench, correct or ())
    count, degrees = angles_of(angles, ANGLES)
    listed = tuple(angle * DEG for angle in degrees)
    if len(listed or range(count)) < 3:
        raise InputError(
            f"--angles is '{angles}', but a comparison needs at least three; give more"
        )
    require_something(given)
    chosen = None if angles is None else listed or count
    own = given.relative_angles if angles is None else None
    shifts = len(given.cells) * len(listed or own or range(count))
    folder = work_folder(SHIFTS, "validate", given.name, clutch_record(given.clutch), angles)
    with (
        WorkCounter(ProgressBar(), shifts + repeated(shifts)) as progress,
        kept_shifts(folder, progress, jobs) as executor,
    ):
        result = compare(given, executor.run, chosen, checked=True)
    data = {
        "name": given.name,
        "points": [difference_record(d) for d in result.differences],
        "rmse_s": result.rmse,
        "relative_rms": result.relative_rms,
        "engaged": engaged_record(result),
        "numerical_error_s": result.numerical_error,
        **examined_record(given),
    }
    emit(data, json, lambda: comparison_table(result))
