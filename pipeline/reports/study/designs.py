"""Kinds and names of designs, the same in figures and tables; tables of them."""

from __future__ import annotations

from collections.abc import Mapping

import pandas as pd

from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.reports.kit.look import Row
from dogshape.pipeline.reports.kit.text import check_name, label, percent, value
from dogshape.pipeline.reports.study.goals import MARGIN, Goals
from dogshape.pipeline.simulate.design import SIMULATED, SUMMARIES, design_of, weakest_within

LEAST_ENGAGED = 0.5  #: share of the shifts of an operating point from which it has a time
BESIDE = 8  #: designs beside each other in a table of margins


def is_barred(row: Row) -> bool:
    """Check whether a design failed a check that needs no simulation, and so was not simulated."""
    return not row["feasible"] and not row["points"]


def design_name(row: Row) -> str:
    """Name a design."""
    return "prototype" if row["prototype"] else f"design {row['trial']}"


def confirmed_designs(result: Row) -> dict[int, Row]:
    """Select the records of the confirmation for designs of the front, by trial."""
    confirmation = result["confirmation"]
    return {} if not confirmation else {one["trial"]: one for one in confirmation["designs"]}


def engaged_shifts(record: Row) -> tuple[int, int]:
    """Count the shifts of a confirmed design that engaged, and all of them."""
    points = record["points"]
    return sum(round(p["engaged"] * p["n"]) for p in points), sum(p["n"] for p in points)


def is_measured(found: Row) -> bool:
    """Check whether a row or a confirmed design has a time that shifts say, not retries alone.

    At every operating point ``LEAST_ENGAGED`` of the shifts engaged.
    """
    points = found["points"]
    shares = [p["engaged"] for p in points] if isinstance(points, list) else [found["engaged"]]
    return found[SIMULATED] is not None and min(shares, default=1.0) >= LEAST_ENGAGED


def margins_of(row: Row, record: Row | None) -> dict[str, float]:
    """Collect the margins of a design by check, those at the new angles where there are any."""
    checks = [] if record is None else record["checks"]
    return {
        **(row["margins"] or {}),
        **{c["name"]: c["margin"] for c in checks if c["margin"] is not None},
    }


def least_margins(margins: Mapping[str, float]) -> list[tuple[str, float]]:
    """Sort margins at nominal size, the smallest first; none that sums up others."""
    own = [(name, margin) for name, margin in margins.items() if name not in SUMMARIES]
    return sorted(own, key=lambda pair: pair[1])


def weakest_at_worst(study: Setup, row: Row) -> tuple[str, float] | None:
    """Name the check with the smallest margin at worst-case tolerances, and that margin.

    Results of earlier versions have the margin without its check, which is worked out here.
    """
    margin = row["margin_worst_case"]
    if margin is None:
        return None
    name = row.get("weakest_check_worst_case")
    if name is None:
        params = {key: row[key] for key in study.variables}
        name = weakest_within(study.operated(params), design_of(study, params))[0]
    return name, margin


def describe(row: Row, variables: list[str], goals: Goals) -> str:
    """Describe a design where the mouse points at it."""
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
        least = least_margins(row["margins"])[:3]
        said = ", ".join(f"{check_name(name)} {percent(margin)}" for name, margin in least)
        lines.append(f"least margins: {said}")
    return "<br>".join(lines)


def of_kinds(result: Row) -> dict[str, list[Row]]:
    """Sort the designs of a search by kind; each is of one kind, empty kinds too.

    Confirmed ones have the values of their confirmation.
    """
    chosen = None if result["best"] is None else result["best"]["trial"]
    front = {row["trial"]: row for row in result["front"]}
    failed = {row["trial"] for row in failed_at_new_angles(result)}

    def kind(row: Row) -> str:
        if row["trial"] == chosen:
            return "chosen"
        if row["prototype"]:
            return "prototype"
        if not row["feasible"] and is_barred(row):
            return "infeasible"
        if not row["feasible"] or row["trial"] in failed:
            return "fails when simulated"
        return "front" if row["trial"] in front else "dominated"

    kinds = ("dominated", "fails when simulated", "infeasible", "front", "chosen", "prototype")
    found: dict[str, list[Row]] = {name: [] for name in kinds}
    for row in result["trials"]:
        found[kind(row)].append(front.get(row["trial"], row))
    return found


def designs_shown(result: Row) -> list[Row]:
    """List the prototype, the front, best first, and designs that failed at new angles, once."""
    last = [*result["front"], *failed_at_new_angles(result)]
    shown = {row["trial"]: row for row in last}
    own = [r for r in result["trials"] if r["prototype"] and r["trial"] not in shown]
    return [*own, *shown.values()]


def as_searched(result: Row, row: Row) -> Row:
    """Give a design of the front with the values of the search."""
    own = next(one for one in result["trials"] if one["trial"] == row["trial"])
    return {**own, **{key: row[key] for key in ("probability_on_front",) if key in row}}


def failed_at_new_angles(result: Row) -> list[Row]:
    """Select the designs that fail a check when re-simulated at new angles, in search order."""
    rows = {row["trial"]: row for row in result["trials"]}
    confirmed = (result["confirmation"] or {"designs": []})["designs"]
    return [rows[one["trial"]] for one in confirmed if not all(c["passed"] for c in one["checks"])]


def designs_frame(result: Row, variables: list[str]) -> pd.DataFrame:
    """Tabulate every simulated design with all that is known of it, a row each."""
    simulated = [row for row in result["trials"] if row[SIMULATED] is not None]
    return _frame(result, variables, simulated)


def all_designs_frame(result: Row, variables: list[str]) -> pd.DataFrame:
    """Tabulate every design of the search, those too that fail a check before a simulation."""
    return _frame(result, variables, result["trials"])


def front_frame(result: Row, variables: list[str]) -> pd.DataFrame:
    """Tabulate the front: variables, objectives with standard errors, place, smallest margin."""
    told = list(dict.fromkeys([*result["objectives"], SIMULATED]))
    ends = [f"{end}_of_{result['leading']}" for end in ("low", "high")]
    best = None if result["best"] is None else result["best"]["trial"]
    columns = [
        *("trial", "prototype", "chosen", *variables),
        *(name for one in told for name in (one, f"standard_error_of_{one}")),
        *(*ends, "probability_on_front", "smallest_margin", "weakest_check"),
        *("margin_worst_case", "weakest_check_worst_case"),
    ]
    rows = [
        {
            **row,
            "chosen": row["trial"] == best,
            **{f"standard_error_of_{k}": error for k, error in row["standard_errors"].items()},
            **dict(zip(ends, (row.get("low"), row.get("high")), strict=True)),
        }
        for row in result["front"]
    ]
    exact = {f"standard_error_of_{one}" for one in told} - {name for r in rows for name in r}
    kept = [name for name in dict.fromkeys(columns) if name not in exact]
    return pd.DataFrame(rows, columns=kept)


def _frame(result: Row, variables: list[str], rows: list[Row]) -> pd.DataFrame:
    front = {row["trial"] for row in result["front"]}
    failed = {row["trial"] for row in failed_at_new_angles(result)}
    best = None if result["best"] is None else result["best"]["trial"]
    nested = ("margins", "failed", "time_within_tolerances", "standard_errors")

    def flat(row: Row) -> Row:
        apart = (*nested, *variables, "trial", "prototype")
        errors = {k: v for k, v in row["standard_errors"].items() if k != SIMULATED}
        within = row.get("time_within_tolerances") or {}
        return {
            "trial": row["trial"],
            "prototype": row["prototype"],
            "on_front": row["trial"] in front,
            "failed_at_fresh_angles": row["trial"] in failed,
            "chosen": row["trial"] == best,
            **{name: row[name] for name in variables},
            **{k: v for k, v in row.items() if k not in apart and not isinstance(v, (dict, list))},
            **{f"standard_error_of_{name}": error for name, error in errors.items()},
            "failed": " ".join(row["failed"]),
            **{f"within_tolerances_{k}": v for k, v in within.items() if not isinstance(v, dict)},
            **{f"margin_of_{name}": margin for name, margin in row["margins"].items()},
        }

    return pd.DataFrame([flat(row) for row in rows])


def in_parts(rows: list[Row], size: int = BESIDE) -> list[list[Row]]:
    """Divide rows into parts of nearly equal length, none longer than ``size``."""
    parts = -(-len(rows) // size)
    each = -(-len(rows) // parts) if parts else 1
    return [rows[start : start + each] for start in range(0, len(rows), each)]
