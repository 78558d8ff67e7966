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
from dogshape.terminal import ProgressBar
from dogshape.validation.blind.cases import SEED
from dogshape.validation.blind.sealed import manifest_of
from dogshape.validation.blind.sealed import run as run_cases

Record = Mapping[str, Any]  #: a score of ``validation.blind.score``, as it is printed in JSON
Parts = Sequence[str | Table]

blind = typer.Typer(
    name="blind",
    help="Cases whose effect is withheld: make them, diagnose them, open the key and score.",
    **PLAIN,
)

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
def run(folder: Folder, jobs: Jobs = 0, json: Json = False) -> None:
    """Diagnose each case from its data; continue a stopped run.

    Example: dogshape blind run results/blind
    """
    total = len(manifest_of(folder)["cases"])
    diagnose = _diagnosis().diagnose_folder
    with WorkCounter(ProgressBar(), total, unit="cases") as progress:
        found = run_cases(folder, diagnose, workers_of(jobs), progress.advance)
    emit({"cases": found}, json, lambda: run_table(found))


@blind.command()
def score(folder: Folder, jobs: Jobs = 0, json: Json = False) -> None:
    """Open the key and compute the share of right diagnoses.

    Example: dogshape blind score results/blind --json
    """
    scoring = import_module("dogshape.validation.blind.score")
    total, advise = len(manifest_of(folder)["cases"]), _diagnosis().advised
    with WorkCounter(ProgressBar(), total, unit="cases") as progress:
        found = scoring.score_field(folder, advise, workers_of(jobs), progress.advance)
    emit(found, json, lambda: score_table(found))


def _diagnosis() -> Any:
    """Load what diagnoses a case, with the simulation."""
    return import_module("dogshape.validation.blind.advised_test")


def run_table(results: Mapping[str, Record]) -> Parts:
    """Write verdict, leading hypothesis and time of each case."""
    rows: list[Sequence[str]] = []
    for name, result in results.items():
        time = f"{result['cpu_s']:.1f}"
        if "refused" in result:
            rows.append((name, "refused", "-", "-", time))
            continue
        found = result["diagnosis"]
        top = found["hypotheses"][0]
        words = " + ".join(top["effects"]) or "none"
        rows.append((name, found["verdict"], words, f"{top['probability']:.2f}", time))
    return [Table(("case", "verdict", "leading", "probability", "processor s"), rows)]


def score_table(found: Record) -> Parts:
    """Write the headline figures of a field set with their aims, then by form, engine and kind."""
    rows: list[Sequence[str]] = []
    met = {True: "yes", False: "no", None: "-"}
    for one in found["headline"]:
        figure = one["figure"]
        value = figure_text(figure, one["percent"])
        rows.append((one["words"], value, str(figure["n"]), one["aim"] or "-", met[one["met"]]))
    groups: list[Sequence[str]] = []
    said = {one["name"]: one for one in found["headline"]}
    for key in ("by_form", "by_engine", "by_kind"):
        for group, mine in found[key].items():
            for name, figure in mine.items():
                value = figure_text(figure, said[name]["percent"])
                if figure["n"]:
                    groups.append((f"{group}: {said[name]['words']}", value, str(figure["n"])))
    clear = f"{found['cases']} cases, {found['clear']} of them clear"
    heads = ("figure", "value (95 %)", "n", "aim", "met")
    return [_code_line(found["code"]), clear, "", Table(heads, rows), "", Table(heads[:3], groups)]


def _code_line(code: Record) -> str:
    """Write a sentence on the code that scores a set."""
    if code["changed"]:
        return f"scored by other code than sealed: {', '.join(code['changed'])}"
    if not code["figures_as_sealed"]:
        return "scored by other headline figures than sealed"
    return "scored by the code and the headline figures that were sealed"


def figure_text(figure: Record, percent: bool = True) -> str:
    """Write a figure with its interval; a dash without a value."""
    if figure["value"] is None:
        return "-"
    value, low, high = (figure[name] for name in ("value", "low", "high"))
    if percent:
        return f"{100 * value:.0f} % ({100 * low:.0f} to {100 * high:.0f})"
    return f"{value:.2f} ({low:.2f} to {high:.2f})"
