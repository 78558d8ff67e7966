"""Blind cases: what was made, what was found, and the score."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rich.console import Group, RenderableType

from dogshape.pipeline.cli.console import columns

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
    table = columns("case", "verdict", "leading", "probability", "s")
    for name, result in results.items():
        time = f"{result['time_s']:.1f}"
        if "refused" in result:
            table.add_row(name, "refused", "-", "-", time)
            continue
        found = result["diagnosis"]
        top = found["hypotheses"][0]
        words = " + ".join(top["effects"]) or "none"
        table.add_row(name, found["verdict"], words, f"{top['probability']:.2f}", time)
    return table


def score_table(found: Record) -> RenderableType:
    """Write the headline figures of a field set with their aims, then by engine and clutch."""
    table = columns("figure", "value (95 %)", "n", "aim", "met")
    met = {True: "yes", False: "no", None: "-"}
    for one in found["headline"]:
        figure = one["figure"]
        table.add_row(
            one["words"], figure_text(figure), str(figure["n"]), one["aim"] or "-", met[one["met"]]
        )
    others = columns("figure", "value (95 %)", "n")
    for words, figure in _other_rows(found):
        others.add_row(words, figure_text(figure), str(figure["n"]))
    return Group(_code_line(found["code"]), "", table, "", others, "", _chance_line(found))


def _code_line(code: Record) -> str:
    """Write a sentence on the code that scores a set."""
    if code["changed"]:
        return f"scored by other code than sealed: {', '.join(code['changed'])}"
    if not code["figures_as_sealed"]:
        return "scored by other headline figures than sealed"
    return "scored by the code and the headline figures that were sealed"


def _chance_line(found: Record) -> str:
    by_chance = found["calibration_by_chance"]
    if by_chance is None:
        return "no case has a probability"
    return f"calibration error of right probabilities at this number of cases: {by_chance:.3f}"


def _other_rows(found: Record) -> list[tuple[str, Any]]:
    """List the other figures of a field set: groups of cases, bands, outside, baselines."""
    words = {one["name"]: one["words"] for one in found["headline"]}
    rows = [
        (f"{group}: {words[name]}", figure)
        for part in ("by_engine", "by_clutch")
        for group, mine in found[part].items()
        for name, figure in mine.items()
    ]
    some = {
        "top_class": "cause or class right",
        "named": "a cause named",
        "named_wrongly": "named wrongly",
        "recognised": "unknown, refused, or the drift said",
        "none": "none within the margin",
        "both_or_all_found": "all causes found",
        "coverage_90": "in the 90 % set",
    }
    for title, part in (("", "bands"), ("clear, ", "clear_by_kind"), ("outside, ", "outside")):
        rows += [
            (f"{title}{group}: {said}", mine[name])
            for group, mine in found[part].items()
            for name, said in some.items()
        ]
    for kind, mine in found["by_kind"].items():
        rows += [
            (f"{kind}: probability of the leading one by evidence", mine["said"]),
            (f"{kind}: it is the truth", mine["so"]),
            (f"{kind}: probability of the leading one", mine["said_seen"]),
            (f"{kind}: it is the truth, but for causes that data cannot show", mine["so_seen"]),
        ]
    plain = found["plain"]
    rows += [
        ("cause left open: foreseen chance to settle it", found["advice_foreseen"]),
        *(
            (f"cause left open: settled by {kind}", figure)
            for kind, figure in found["advised_test"]["by_kind"].items()
        ),
        ("clear single effects: the diagnosis", plain["diagnosis"]),
        ("the same: smallest RMSE", plain["smallest_rmse"]),
        ("the same: AICc", plain["aicc"]),
        ("AICc above 0.8, all cases: named right", plain["aicc_named_right"]),
        ("AICc above 0.8, no effect: one is named", plain["aicc_false_alarms"]),
        ("clear single effects: calibration error of AICc", plain["aicc_calibration"]),
        ("hypotheses in the 90 % set", found["size_90"]),
        ("seconds a case", found["time_s"]),
    ]
    return [row for row in rows if row[1]["n"]]


def figure_text(figure: Record) -> str:
    """Write a figure with its interval; a dash without a value."""
    if figure["value"] is None:
        return "-"
    return f"{figure['value']:.2f} ({figure['low']:.2f} to {figure['high']:.2f})"
