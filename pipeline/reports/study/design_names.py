"""Names of designs and words about them, the same in figures and tables."""

from __future__ import annotations

from typing import Any

from dogshape.pipeline.reports.study.goals import MARGIN, Goals
from dogshape.pipeline.reports.surrogate.variable_labels import label, value

Row = dict[str, Any]


def is_barred(row: Row) -> bool:
    """Tell whether a design failed a check that needs no simulation, and so has no time."""
    return not row["feasible"] and row["expected_shift_time_s"] is None


def design_name(row: Row) -> str:
    """Return the name of a design."""
    return "prototype" if row["prototype"] else f"design {row['trial']}"


def check_name(name: str) -> str:
    """Return the name of a check in words."""
    return name.replace("_", " ")


def percent(margin: float) -> str:
    """Return a margin in percent, with decimals where it is small."""
    digits = 2 if 0.0 < abs(margin) < 0.001 else (1 if abs(margin) < 0.05 else 0)
    words = f"{100 * margin:.{digits}f} %"
    return words.replace("-", "\N{MINUS SIGN}")


def describe(row: Row, variables: list[str], goals: Goals) -> str:
    """Return all that a figure says of a design where the mouse points at it."""
    lines = [f"<b>{design_name(row)}</b>"]
    lines += [f"{label(name)} {value(name, row[name])}" for name in variables]
    lines += [
        f"{goal.label} {goal.words(goal.shown(row), goal.error(row))}"
        for goal in goals.told
        if row.get(goal.name) is not None and goal.name != MARGIN
    ]
    if "probability_on_front" in row:
        lines.append(f"on the front with probability {percent(row['probability_on_front'])}")
    if row["failed"]:
        lines.append("fails " + ", ".join(check_name(name) for name in row["failed"]))
    if row["margins"]:
        least = sorted(row["margins"].items(), key=lambda pair: pair[1])[:3]
        said = ", ".join(f"{check_name(name)} {percent(margin)}" for name, margin in least)
        lines.append(f"least margins: {said}")
    return "<br>".join(lines)


def of_kinds(result: Row) -> dict[str, list[Row]]:
    """Return the designs of a search by kind; each is of one kind, empty kinds too."""
    best = result["best"]
    chosen = None if best is None else best["trial"]
    front = {row["trial"] for row in result["front"]}
    failed = {row["trial"] for row in failed_afresh(result)}

    def kind(row: Row) -> str:
        if row["trial"] == chosen:
            return "chosen"
        if row["prototype"]:
            return "prototype"
        if not row["feasible"]:
            return "infeasible" if is_barred(row) else "lands too hard"
        if row["trial"] in failed:
            return "lands too hard"
        return "front" if row["trial"] in front else "dominated"

    kinds = ("dominated", "lands too hard", "infeasible", "front", "chosen", "prototype")
    found: dict[str, list[Row]] = {name: [] for name in kinds}
    for row in result["trials"]:
        found[kind(row)].append(row)
    return found


def designs_shown(result: Row) -> list[Row]:
    """Return the prototype, the front, best of the leading objective first, and what failed afresh.

    Each stands once.
    """
    last = [*result["front"], *failed_afresh(result)]
    shown = {row["trial"]: row for row in last}
    own = [r for r in result["trials"] if r["prototype"] and r["trial"] not in shown]
    return [*own, *shown.values()]


def failed_afresh(result: Row) -> list[Row]:
    """Return the designs that fail a check at the fresh angles, in the search's order."""
    rows = {row["trial"]: row for row in result["trials"]}
    confirmed = (result["confirmation"] or {"designs": []})["designs"]
    return [
        rows[one["trial"]]
        for one in confirmed
        if not all(check["passed"] for check in one["checks"])
    ]
