"""``validate``: the simulation beside bench data."""

from __future__ import annotations

from typing import Annotated

import typer

from dogshape.bench import Bench
from dogshape.cli.console import emit, verb
from dogshape.cli.options import Corrections, Engine, Jobs, Json, angles_of
from dogshape.cli.progress_bar import ProgressBar
from dogshape.cli.tables.validate_tables import comparison_table
from dogshape.comparison import simulate_bench
from dogshape.pipeline.simulate.kept_shifts import SHIFTS
from dogshape.running import Where


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
    emit(found.to_dict(), json, lambda: comparison_table(found.compared))
