"""Designs and objectives of a study's result, as frames, tables and figures name them.

Times are shown in ms, margins and shares in percent, forces in kN.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from dogshape.pipeline.config.schema import QUANTILE
from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.reports.look import Row
from dogshape.pipeline.reports.text import check_name, label, minus, percent, value, with_error
from dogshape.pipeline.simulate.design import (
    OBJECTIVES,
    SIMULATED,
    SUMMARIES,
    Objective,
    design_of,
    weakest_within,
)

if TYPE_CHECKING:
    import pandas as pd

LEAST_ENGAGED = 0.5  #: share of the shifts of an operating point from which it has a time
MARGIN, QUANTILE_TIME = "smallest_margin", "shift_time_quantile_s"
#: Units that are shown instead of the stored ones, and the factors that lead to them.
SHOWN = {
    "peak_impact_force_N": "kN", "peak_axial_force_N": "kN", MARGIN: "%", "first_try_share": "%",
    "smallest_margin_worst": "%",
}  # fmt: skip
FACTORS = {"ms": 1e3, "%": 100.0, "kN": 1e-3}


@dataclass(frozen=True)
class Goal:
    """An objective of a study; ``share`` is the level of a quantile.

    ``leading`` marks the objective that decides which design is best.
    """

    objective: Objective
    share: float
    leading: bool

    @property
    def name(self) -> str:
        """Key of the objective."""
        return self.objective.name

    @property
    def label(self) -> str:
        """Words for the objective; a quantile has its level."""
        level = f"{100 * self.share:.4g} % " if self.name == QUANTILE_TIME else ""
        return level + self.objective.label

    @property
    def unit(self) -> str:
        """Unit that is shown."""
        own = SHOWN.get(self.name, self.objective.unit)
        return "ms" if own == "s" else own

    @property
    def factor(self) -> float:
        """Shown value over the stored one."""
        return FACTORS.get(self.unit, 1.0)

    @property
    def title(self) -> str:
        """Label and unit, for a column or an axis, with the direction where it is not the usual."""
        words = f"{self.label}, {self.unit}" if self.unit else self.label
        return words + (" (more is better)" if self.objective.maximise else "")

    def shown(self, row: Row) -> float:
        """Return the value of a row in the unit that is shown."""
        return self.factor * float(row[self.name])

    def error(self, row: Row) -> float:
        """Return the standard error of a row in the unit that is shown; zero if exact."""
        return self.factor * float(row["standard_errors"].get(self.name) or 0.0)

    def estimate(self, confirmed: Row) -> tuple[float, float]:
        """Return a simulated objective at the new angles, and its error, as shown."""
        found = confirmed["estimates"][self.name]
        return self.factor * found["value"], self.factor * (found["standard_error"] or 0.0)

    def pair(self, shown: float, error: float = 0.0) -> str:
        """Print a shown value with its standard error, if it has one, without the unit."""
        if self.unit in FACTORS:
            return with_error(shown, error) if error else minus(f"{shown:.1f}")
        return minus(f"{shown:.4g}" + (f" ± {error:.2g}" if error else ""))

    def words(self, shown: float, error: float = 0.0) -> str:
        """Print a shown value with error and unit."""
        return f"{self.pair(shown, error)} {self.unit}".strip()

    def cell(self, row: Row) -> str:
        """Print the value of a row with its error; words where it has none."""
        if row.get(self.name) is None or (self.unit == "ms" and not is_measured(row)):
            return "does not engage" if row["points"] else "not simulated"
        return self.pair(self.shown(row), self.error(row))


def goals_of(result: Row) -> list[Goal]:
    """List the objectives of a result, the leading one first."""
    share, lead = result.get("quantile", QUANTILE), result["leading"]
    names = sorted(result["objectives"], key=lambda name: name != lead)
    return [Goal(OBJECTIVES[name], share, name == lead) for name in names]


def shown_goals(result: Row) -> list[Goal]:
    """List the objectives, and the expected shift time where it is none of them."""
    goals = goals_of(result)
    if all(goal.name != SIMULATED for goal in goals):
        goals.append(Goal(OBJECTIVES[SIMULATED], goals[0].share, leading=False))
    return goals


def design_name(row: Row) -> str:
    """Name a design."""
    return "prototype" if row["prototype"] else f"design {row['trial']}"


def is_barred(row: Row) -> bool:
    """Check whether a design failed a check that needs no simulation, and so was not simulated."""
    return not row["feasible"] and not row["points"]


def is_measured(found: Row) -> bool:
    """Check whether a row or a confirmed design has a time that shifts say, not retries alone.

    At every operating point ``LEAST_ENGAGED`` of the shifts engaged.
    """
    points = found["points"]
    shares = [p["engaged"] for p in points] if isinstance(points, list) else [found["engaged"]]
    return found[SIMULATED] is not None and min(shares, default=1.0) >= LEAST_ENGAGED


def confirmed_designs(result: Row) -> dict[int, Row]:
    """Select the records of the confirmation for designs of the front, by trial."""
    confirmation = result["confirmation"]
    return {} if not confirmation else {one["trial"]: one for one in confirmation["designs"]}


def confirmation_of(result: Row, row: Row) -> Row | None:
    """Select what a design was confirmed with; None where it was not."""
    confirmation = result["confirmation"]
    if confirmation and row["prototype"]:
        return dict(confirmation["prototype"])
    if confirmation and row["trial"] == confirmation.get("chosen"):
        return dict(confirmation["best"])
    return confirmed_designs(result).get(row["trial"])


def engaged_shifts(record: Row) -> tuple[int, int]:
    """Count the shifts of a confirmed design that engaged, and all of them."""
    points = record["points"]
    return sum(round(p["engaged"] * p["n"]) for p in points), sum(p["n"] for p in points)


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


def failed_words(confirmed: Row | None) -> str:
    """List the checks that a confirmed design fails, with their margins; empty where none."""
    failed = [check for check in (confirmed or {"checks": []})["checks"] if not check["passed"]]
    return ", ".join(f"{check_name(c['name'])} ({percent(c['margin'])})" for c in failed)


def failed_at_new_angles(result: Row) -> list[Row]:
    """Select the designs that fail a check when re-simulated at new angles, in search order."""
    rows = {row["trial"]: row for row in result["trials"]}
    confirmed = confirmed_designs(result).items()
    return [rows[trial] for trial, one in confirmed if not all(c["passed"] for c in one["checks"])]


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
        if is_barred(row):
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
    """List the prototype, the front, best first, and designs that failed at new angles, once.

    Values are those of the search.
    """
    rows = {row["trial"]: row for row in result["trials"]}
    own = [trial for trial, row in rows.items() if row["prototype"]]
    trials = [row["trial"] for row in (*result["front"], *failed_at_new_angles(result))]
    return [rows[trial] for trial in dict.fromkeys([*own, *trials])]


def describe(row: Row, variables: list[str], goals: list[Goal]) -> str:
    """Describe a design where the mouse points at it."""
    lines = [f"<b>{design_name(row)}</b>"]
    lines += [f"{label(name)} {value(name, row[name])}" for name in variables]
    lines += [
        f"{goal.label} {goal.words(goal.shown(row), goal.error(row))}"
        for goal in goals
        if row.get(goal.name) is not None
    ]
    if row["failed"]:
        lines.append("fails " + ", ".join(check_name(name) for name in row["failed"]))
    least = least_margins(row["margins"] or {})[:3]
    lines += [f"margin {percent(margin)}, {check_name(name)}" for name, margin in least]
    return "<br>".join(lines)


def front_frame(result: Row, variables: list[str]) -> pd.DataFrame:
    """Tabulate the front: variables, objectives with standard errors, place, smallest margin."""
    import pandas as pd  # noqa: PLC0415  # half a second that the command line does not need

    estimated = list(dict.fromkeys([*result["objectives"], SIMULATED]))
    ends = {end: f"{end}_of_{result['leading']}" for end in ("low", "high")}
    best = None if result["best"] is None else result["best"]["trial"]
    columns = [
        *("trial", "prototype", "chosen", *variables),
        *(name for one in estimated for name in (one, f"standard_error_of_{one}")),
        *(*ends.values(), "probability_on_front", "smallest_margin", "weakest_check"),
        *("margin_worst_case", "weakest_check_worst_case"),
    ]
    rows = [
        {
            **{ends.get(key, key): value for key, value in row.items()},
            "chosen": row["trial"] == best,
            **{f"standard_error_of_{k}": error for k, error in row["standard_errors"].items()},
        }
        for row in result["front"]
    ]
    known = {name for row in rows for name in row} or set(columns)
    return pd.DataFrame(rows, columns=[name for name in columns if name in known])


def designs_frame(result: Row, variables: list[str], *, simulated: bool = False) -> pd.DataFrame:
    """Tabulate every design of the search with all that is known of it, a row each.

    With ``simulated`` those are left out that fail a check before a simulation.
    """
    import pandas as pd  # noqa: PLC0415  # half a second that the command line does not need

    front = {row["trial"] for row in result["front"]}
    failed = {row["trial"] for row in failed_at_new_angles(result)}
    best = None if result["best"] is None else result["best"]["trial"]

    def flat(row: Row) -> Row:
        apart = (*variables, "trial", "prototype", "failed")
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

    rows = [row for row in result["trials"] if not simulated or row[SIMULATED] is not None]
    return pd.DataFrame([flat(row) for row in rows])
