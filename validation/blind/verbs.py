"""Verbs ``make``, ``run`` and ``score`` of ``dogshape blind``: sealed sets and their score."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from importlib import import_module
from pathlib import Path
from typing import Annotated, Any

import typer

from dogshape.cli.options import PLAIN, Jobs, Json, emit
from dogshape.pipeline.progress import WorkCounter
from dogshape.pipeline.record import Table
from dogshape.pipeline.simulate.executor import workers_of
from dogshape.sim.errors import InputError
from dogshape.terminal import ProgressBar
from dogshape.validation.blind.cases import SEED
from dogshape.validation.blind.sealed import RESULTS, manifest_of
from dogshape.validation.blind.sealed import run as run_cases

Record = Mapping[str, Any]  #: a score of ``validation.blind.score``, as printed in JSON
Parts = Sequence[str | Table]

blind = typer.Typer(
    name="blind",
    help="Cases whose effect is withheld: make them, diagnose them, open the key and score.",
    **PLAIN,
)

DIAGNOSIS = "diagnosis"
#: Functions that diagnose the folder of a case, by method: module and name.
METHODS = {
    DIAGNOSIS: ("advised_test", "diagnose_folder"),
    "fit": ("plain_fit", "diagnose_by_fit"),
}

Folder = Annotated[Path, typer.Argument(metavar="DIR", help="folder of the set of cases")]


@blind.command()
def make(
    folder: Folder,
    small: Annotated[bool, typer.Option("--small", help="a case of each kind only")] = False,
    seed: Annotated[int | None, typer.Option(min=0, help=f"of the draws; default {SEED}")] = None,
    jobs: Jobs = 0,
    json: Json = False,
) -> None:
    """Write simulated data of known effects, and the sealed key.

    Example: dogshape blind make results/blind --small
    """
    field_set = import_module("dogshape.validation.blind.field_set")
    cases = field_set.cases_of(seed, small=small)
    with WorkCounter(ProgressBar(), len(cases), unit="cases") as progress:
        manifest = field_set.make_field(
            folder, cases, _diagnosis().likelihood_of, workers_of(jobs), progress.advance
        )
    lines = [
        f"{len(manifest['cases'])} cases in {folder / 'cases'}",
        f"key sealed with SHA-256 {manifest['key_sha256']}",
        f"go on with: dogshape blind run {folder}",
    ]
    emit(manifest, json, lambda: lines)


@blind.command()
def run(
    folder: Folder,
    method: Annotated[
        str, typer.Option(help="diagnosis, or fit: nested least squares beside it")
    ] = DIAGNOSIS,
    jobs: Jobs = 0,
    json: Json = False,
) -> None:
    """Diagnose each case from its data; continue a stopped run.

    Example: dogshape blind run results/blind
    """
    if method not in METHODS:
        raise InputError(f"--method {method} is unknown; give one of: {', '.join(METHODS)}")
    total = len(manifest_of(folder)["cases"])
    module, name = METHODS[method]
    diagnose = getattr(import_module(f"dogshape.validation.blind.{module}"), name)
    results_name = results_name_of(method)
    with WorkCounter(ProgressBar(), total, unit="cases") as progress:
        results = run_cases(folder, diagnose, workers_of(jobs), progress.advance, results_name)
    emit({"cases": results}, json, lambda: run_table(results))


@blind.command()
def score(
    folder: Folder,
    method: Annotated[
        str, typer.Option(help="diagnosis, fit, or a folder of DIR with the results of another")
    ] = DIAGNOSIS,
    jobs: Jobs = 0,
    json: Json = False,
) -> None:
    """Open the key and compute the share of right diagnoses.

    Example: dogshape blind score results/blind --json
    """
    scoring = import_module("dogshape.validation.blind.score")
    total = len(manifest_of(folder)["cases"])
    advise = _diagnosis().make_advised_test if method == DIAGNOSIS else None
    results_name = results_name_of(method)
    with WorkCounter(ProgressBar(), total, unit="cases") as progress:
        record = scoring.score_field(
            folder, advise, workers_of(jobs), progress.advance, results_name
        )
    emit(record, json, lambda: score_table(record))


def results_name_of(method: str) -> str:
    """Name the folder of a method's results within a set."""
    return RESULTS if method == DIAGNOSIS else method


def _diagnosis() -> Any:
    """Import the diagnosis of a case, which loads the simulation."""
    return import_module("dogshape.validation.blind.advised_test")


def run_table(results: Mapping[str, Record]) -> Parts:
    """Tabulate verdict, leading hypothesis and processor time of each case."""
    rows: list[Sequence[str]] = []
    for name, result in results.items():
        time = f"{result['cpu_s']:.1f}"
        if "refused" in result:
            rows.append((name, "refused", "-", "-", time))
            continue
        diagnosis = result["diagnosis"]
        top = diagnosis["hypotheses"][0]
        hypothesis = " + ".join(top["effects"]) or "none"
        rows.append((name, diagnosis["verdict"], hypothesis, f"{top['probability']:.2f}", time))
    return [Table(("case", "verdict", "leading", "probability", "processor s"), rows)]


def score_table(score: Record) -> Parts:
    """Tabulate the headline figures of a set with their aims, and by form, engine and kind."""
    rows: list[Sequence[str]] = []
    met = {True: "yes", False: "no", None: "-"}
    headlines = {headline["name"]: headline for headline in score["headline"]}
    for headline in headlines.values():
        figure = headline["figure"]
        value = figure_text(figure, headline["percent"])
        aim = headline["aim"] or "-"
        rows.append((headline["words"], value, str(figure["n"]), aim, met[headline["met"]]))
    group_rows: list[Sequence[str]] = []
    for key in ("by_form", "by_engine", "by_kind"):
        for group, figures in score[key].items():
            group_rows += _group_rows(group, figures, headlines)
    heads = ("figure", "value (95 %)", "n", "aim", "met")
    return [
        _code_line(score["code"]),
        f"{score['cases']} cases, {score['clear']} of them clear",
        "",
        Table(heads, rows),
        "",
        Table(heads[:3], group_rows),
    ]


def _group_rows(
    group: str, figures: Mapping[str, Record], headlines: Mapping[str, Record]
) -> list[Sequence[str]]:
    """Write the rows of a group's figures that have cases."""
    rows: list[Sequence[str]] = []
    for name, figure in figures.items():
        if figure["n"]:
            headline = headlines[name]
            value = figure_text(figure, headline["percent"])
            rows.append((f"{group}: {headline['words']}", value, str(figure["n"])))
    return rows


def _code_line(code: Record) -> str:
    """Write a sentence on the code of a score."""
    if code["changed"]:
        return f"scored by other code than sealed: {', '.join(code['changed'])}"
    if not code["figures_as_sealed"]:
        return "scored by other headline figures than sealed"
    return "scored by the code and the headline figures that were sealed"


def figure_text(figure: Record, percent: bool = True) -> str:
    """Write a figure with its interval; a dash without a value."""
    if figure["value"] is None:
        return "-"
    value = figure["value"]
    low = figure["low"]
    high = figure["high"]
    if percent:
        return f"{100 * value:.0f} % ({100 * low:.0f} to {100 * high:.0f})"
    return f"{value:.2f} ({low:.2f} to {high:.2f})"
