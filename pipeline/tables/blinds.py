"""Blind cases: what was made, what was found, and the score."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from rich.console import Group, RenderableType

from pipeline.console import columns

Record = Mapping[str, Any]


def made_lines(folder: Path, manifest: Record) -> RenderableType:
    """Return how many cases were made and the hash of their key."""
    return Group(
        f"{len(manifest['cases'])} cases in {folder / 'cases'}",
        f"key sealed with SHA-256 {manifest['key_sha256']}",
        f"go on with: dogshape blind run {folder}",
    )


def run_table(results: Mapping[str, Record]) -> RenderableType:
    """Return verdict, leading hypothesis and time of each case."""
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
    """Return the leading figures with their intervals."""
    groups = {
        f"all {found['cases']} cases": found["all"],
        f"gap of two sampling errors or more ({found['visible']['n']})": found["visible"],
        f"of them with effects of the list ({found['visible_inside']['n']})": found[
            "visible_inside"
        ],
        **{f"one effect, {s}": part for s, part in found["singles_by_strength"].items()},
        **{f"data as {form}": part for form, part in found["by_form"].items()},
    }
    names = ("top_1", "top_class", "top_class_as_seen", "precision_when_named", "coverage_90")
    heads = ("right", "right class", "as it can be seen", "right if named", "in 90 % set")
    table = columns("cases", *heads)
    for group, part in groups.items():
        table.add_row(group, *(_figure(part[name]) for name in names))
    return Group(table, "", _others(found))


def _others(found: Record) -> RenderableType:
    shrink, plain, test = found["shrink"], found["plain"], found["advised_test"]
    inside = found["visible_inside"]
    rows: Iterable[tuple[str, Any]] = (
        ("an effect named where there is none", found["none"]["false_alarms"]),
        ("pairs: both causes found", found["pairs"]["both_found"]),
        ("pairs: one or both found", found["pairs"]["one_found_or_both"]),
        ("visible pairs: both causes found", found["pairs_visible"]["both_found"]),
        ("pairs, each effect visible: both found", found["pairs_both_visible"]["both_found"]),
        ("visible: all that is named is a cause", found["visible"]["named_causes_true"]),
        ("visible: what is named is all that can be seen", found["visible"]["precision_as_seen"]),
        ("of the list: what is named is all that can be seen", inside["precision_as_seen"]),
        ("of the list: all that is named is a cause", inside["named_causes_true"]),
        ("visible: size of the 90 % set", found["visible"]["size_90"]),
        ("outside the list: unknown, or refused", found["outside"]["recognised"]),
        ("outside the list: an effect named", found["outside"]["wrong_effect_named"]),
        ("visible, outside the list: unknown, or refused", found["outside_visible"]["recognised"]),
        ("ambiguous: settled by the advised test", test["all"]["settled"]),
        ("ambiguous: settled as the truth itself", test["all"]["settled_as_truth"]),
        ("ambiguous: settled wrongly", test["all"]["wrongly_settled"]),
        ("visible and ambiguous: settled by the advised test", test["visible"]["settled"]),
        ("the same, or on all that can be seen", test["visible"]["settled_as_seen"]),
        ("visible and ambiguous: settled wrongly", test["visible"]["wrongly_settled"]),
        ("calibration error of probabilities", found["all"]["calibration_error"]),
        ("calibration error of the leading one", found["all"]["calibration_error_of_top"]),
        ("the same, as far as it can be seen", found["all"]["calibration_error_of_top_as_seen"]),
        ("visible: calibration error of probabilities", found["visible"]["calibration_error"]),
        ("held-out shrink of the true hypothesis", shrink["true"]),
        ("held-out shrink over that of the true one, median", shrink["leading_over_true"]),
        ("held-out shrink of the leading one where it is wrong", shrink["leading_where_wrong"]),
        ("held-out shrink of the best rival of a right one", shrink["best_rival_where_right"]),
        ("visible single effects: the diagnosis", plain["visible"]["diagnosis"]),
        ("visible single effects: smallest RMSE", plain["visible"]["smallest_rmse"]),
        ("visible single effects: AICc", plain["visible"]["aicc"]),
        ("seconds a case", found["time_s"]["mean"]),
    )
    table = columns("figure", "value (95 %)", "n")
    for words, figure in rows:
        table.add_row(words, _figure(figure), str(figure["n"]))
    return table


def _figure(figure: Record) -> str:
    if figure["value"] is None:
        return "-"
    return f"{figure['value']:.2f} ({figure['low']:.2f} to {figure['high']:.2f})"
