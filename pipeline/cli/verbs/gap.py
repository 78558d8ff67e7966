"""``gap``: which effect makes a bench differ from the simulation."""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from dogshape.diagnosis.bench.bench_data import load_bench
from dogshape.diagnosis.diagnosis import Diagnosis
from dogshape.diagnosis.report.wording import headline
from dogshape.pipeline.cli.console import emit, verb
from dogshape.pipeline.cli.options import Corrections, Jobs, Json
from dogshape.pipeline.cli.progress_bar import ProgressBar, say
from dogshape.pipeline.cli.tables.gap_tables import diagnosis_table
from dogshape.pipeline.cli.tables.validate_tables import examined_record
from dogshape.pipeline.diagnose.bank_diagnosis import BANK, Means, diagnosed
from dogshape.pipeline.diagnose.consequence import studied
from dogshape.pipeline.diagnose.extras import Extras, so_what
from dogshape.pipeline.diagnose.report_parts import extras_of, price_of
from dogshape.pipeline.reports.gap.publish import publish
from dogshape.sim.writers import writing


@verb
def gap(
    bench: Annotated[str, typer.Argument(metavar="BENCH_DIR", help="folder of a data set")],
    out: Annotated[
        Path | None, typer.Option(help="folder for report.html, gap.json and cells.csv")
    ] = None,
    bank: Annotated[Path, typer.Option(help="folder of simulations that diagnoses share")] = BANK,
    effects: Annotated[
        Path | None, typer.Option(help="folder with effects of your own, a file each")
    ] = None,
    study: Annotated[
        str | None,
        typer.Option(
            help="study, or folder of its results: its best designs are simulated with the cause"
        ),
    ] = None,
    correct: Corrections = None,
    jobs: Jobs = 0,
    json: Json = False,
) -> None:
    """Find which unmodelled effect makes a bench differ from the simulation.

    The simulations of a clutch and its operating points take about half an hour on two cores,
    once; those of the published clutch come with the package.

    Example: dogshape gap mq200_stand --out results/gap-stand
    """
    given, means = load_bench(bench, correct or ()), Means(bank, effects, jobs, ProgressBar())
    if study is not None:
        studied(study)  # refuses a study without a result before the long work
    with writing(out) if out is not None else nullcontext():
        found = diagnosed(given, means)
        extras = Extras() if out is None else extras_of(found)
        report, price = _reported(found, out, extras), None
        if study is not None:
            say(_before_price(found, report))
            price = price_of(found, study, means, out or bank)
            report = _reported(found, out, replace(extras, so_what=so_what(price)))
    record = {
        **found.as_dict(),
        **examined_record(given),
        "so_what": price.record if price else None,
        "report": str(report) if report else None,
    }
    emit(record, json, lambda: diagnosis_table(found, record))


def _reported(found: Diagnosis, out: Path | None, extras: Extras) -> Path | None:
    """Write the report into a folder where one is given; return its path."""
    return None if out is None else publish(found, out, extras)


def _before_price(found: Diagnosis, report: Path | None) -> str:
    where = f"written to {report}" if report else "not written, for want of --out"
    return f"{headline(found.found)}. The diagnosis is {where}; next: what ignoring the cause costs"
