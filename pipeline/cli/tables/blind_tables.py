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
    """Return the leading figures with their intervals, as a user gets them and told the engine."""
    if "told" not in found:
        return _alone(found)
    table = columns("figure", "not told (a user's)", "n", "told the engine's baseline", "n")
    for (words, figure), (_, beside) in zip(_rows(found), _rows(found["told"]), strict=True):
        both = (cell for one in (figure, beside) for cell in (figure_text(one), str(one["n"])))
        table.add_row(words, *both)
    test, others = found["advised_test"], columns("advised test, not told", "value (95 %)", "n")
    for words, figure in (
        ("ambiguous: settled", test["all"]["settled"]),
        ("ambiguous: settled as the truth itself", test["all"]["settled_as_truth"]),
        ("ambiguous: settled wrongly", test["all"]["wrongly_settled"]),
        ("visible and ambiguous: settled", test["visible"]["settled"]),
        ("visible and ambiguous: settled wrongly", test["visible"]["wrongly_settled"]),
        ("seconds a case, both ways", found["time_s"]["mean"]),
    ):
        others.add_row(words, figure_text(figure), str(figure["n"]))
    return Group(table, "", others)


def _alone(found: Record) -> RenderableType:
    """Return the figures of a set with one way to diagnose, those of each kind of truth last."""
    table = columns("figure", "value (95 %)", "n")
    same = found.get("equivalence")
    rows = [row for row in _rows(found) if row[1]["n"]]
    for kind, part in found["by_kind"].items():
        rows += [
            (f"kind {kind}: right", part["top_1"]),
            (f"kind {kind}: in the 90 % set", part["coverage_90"]),
            (f"kind {kind}: an effect named", part["named"]),
            (f"kind {kind}: all that is named is a cause", part["named_causes_true"]),
        ]
    if same is not None:
        rows += [
            ("none said: the true gap is within the margin", same["within_of_said_none"]),
            ("true gap within the margin: none said", same["said_none_of_within"]),
        ]
    for words, figure in rows:
        table.add_row(words, figure_text(figure), str(figure["n"]))
    if same is None or same["largest_ratio_of_said_none"] is None:
        return table
    largest = same["largest_ratio_of_said_none"]
    return Group(table, "", f"largest true gap where none is said: {largest:.2f} margins")


def _rows(found: Record) -> list[tuple[str, Any]]:
    """List the figures of one way to diagnose, those fixed before a set is opened first."""
    every, visible, inside = found["all"], found["visible"], found["visible_inside"]
    groups = {
        "all cases": every,
        "visible": visible,
        "visible, of the list": inside,
        **{f"one effect, {s}": part for s, part in found["singles_by_strength"].items()},
        **{f"data as {form}": part for form, part in found["by_form"].items()},
    }
    heads = {
        "top_1": "right",
        "top_class": "right class",
        "precision_when_named": "named exactly, of what is named",
        "coverage_90": "in the 90 % set",
        "size_90": "size of the 90 % set",
        "calibration_error_of_top": "calibration error of the leading one",
    }
    rows = [(f"{group}: {w}", part[n]) for n, w in heads.items() for group, part in groups.items()]
    rows += [
        ("all cases: class right, as the means look", every["top_class_as_seen"]),
        (
            "all cases: calibration error of the leading one, as the means look",
            every["calibration_error_of_top_as_seen"],
        ),
        ("all cases: all that is named is a cause", every["named_causes_true"]),
        ("all cases: 90 % intervals of parameters", every["parameter_coverage_90"]),
        ("all cases: logarithm of the truth's probability", every["log_score"]),
        ("no effect: one is named", found["none"]["false_alarms"]),
        ("no effect: none is said", found["none"]["verdict_none"]),
        ("no effect: unknown is said", found["none"]["verdict_unknown"]),
        ("pairs: both causes found", found["pairs"]["both_found"]),
        ("pairs: one or both found", found["pairs"]["one_found_or_both"]),
        ("visible pairs: both causes found", found["pairs_visible"]["both_found"]),
        ("pairs, each effect visible: both found", found["pairs_both_visible"]["both_found"]),
        (
            "pairs, second effect visible after refit of the first: both found",
            found["pairs_visible_after_refit"]["both_found"],
        ),
        ("outside the list: unknown, or refused", found["outside"]["recognised"]),
        ("outside the list: an effect named", found["outside"]["wrong_effect_named"]),
        *((f"outside, {n}: recognised", one) for n, one in found["outside"]["by_kind"].items()),
        *((f"outside, {n}: named", one) for n, one in found["outside"]["named_by_kind"].items()),
        ("held-out shrink of the true hypothesis", found["shrink"]["true"]),
        ("held-out shrink of the leading one where wrong", found["shrink"]["leading_where_wrong"]),
        ("one effect: the diagnosis", found["plain"]["singles"]["diagnosis"]),
        ("one effect: smallest RMSE", found["plain"]["singles"]["smallest_rmse"]),
        ("one effect: AICc", found["plain"]["singles"]["aicc"]),
    ]
    return rows


def field_table(found: Record) -> RenderableType:
    """Return the headline figures of a field set with their aims, then by engine and clutch."""
    table = columns("figure, not told", "value (95 %)", "n", "aim", "met")
    met = {True: "yes", False: "no", None: "-"}
    for one in found["headline"]:
        figure = one["figure"]
        table.add_row(
            one["words"], figure_text(figure), str(figure["n"]), one["aim"] or "-", met[one["met"]]
        )
    others = columns("figure, not told", "value (95 %)", "n")
    for words, figure in _field_rows(found):
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


def _field_rows(found: Record) -> list[tuple[str, Any]]:
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
