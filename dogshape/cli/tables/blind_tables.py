"""Blind cases: what was made, what was found, and the score."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rich.console import Group, RenderableType

from dogshape.cli.console import columns

Record = Mapping[str, Any]  #: a score of ``validation.blind.score``, as it is printed in JSON


def made_lines(folder: Path, manifest: Record) -> RenderableType:
    """Write the number of cases that were made and the hash of their key."""
    return Group(
        f"{len(manifest['cases'])} cases in {folder / 'cases'}",
        f"key sealed with SHA-256 {manifest['key_sha256']}",
        f"go on with: dogshape blind run {folder}",
    )


def run_table(results: Mapping[str, Record]) -> RenderableType:
    """Write verdict, leading hypothesis and time of each case."""
    table = columns("case", "verdict", "leading", "probability", "processor s")
    for name, result in results.items():
        time = f"{result['cpu_s']:.1f}"
        if "refused" in result:
            table.add_row(name, "refused", "-", "-", time)
            continue
        found = result["diagnosis"]
        top = found["hypotheses"][0]
        words = " + ".join(top["effects"]) or "none"
        table.add_row(name, found["verdict"], words, f"{top['probability']:.2f}", time)
    return table


def score_table(found: Record) -> RenderableType:
    """Write the headline figures of a field set with their aims, then by form, engine and kind."""
    table = columns("figure", "value (95 %)", "n", "aim", "met")
    met = {True: "yes", False: "no", None: "-"}
    for one in found["headline"]:
        figure = one["figure"]
        value = figure_text(figure, one["percent"])
        table.add_row(one["words"], value, str(figure["n"]), one["aim"] or "-", met[one["met"]])
    groups = columns("figure", "value (95 %)", "n")
    said = {one["name"]: one for one in found["headline"]}
    for key in ("by_form", "by_engine", "by_kind"):
        for group, mine in found[key].items():
            for name, figure in mine.items():
                value = figure_text(figure, said[name]["percent"])
                if figure["n"]:
                    groups.add_row(f"{group}: {said[name]['words']}", value, str(figure["n"]))
    clear = f"{found['cases']} cases, {found['clear']} of them clear"
    return Group(_code_line(found["code"]), clear, "", table, "", groups)


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
