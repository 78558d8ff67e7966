"""Designs and objectives of a study's result, as frames, tables and figures name them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from dogshape.pipeline.config.schema import QUANTILE
from dogshape.pipeline.record import Frame, frame_of, percent
from dogshape.pipeline.reports.text import check_name, minus, with_error
from dogshape.pipeline.simulate.design import OBJECTIVES, SIMULATED, SUMMARIES, Objective
from dogshape.pipeline.store.result_records import VerdictRow
from dogshape.sim.statistics.hangs import interval
from dogshape.sim.strength.verdict import WORDS, Margin, judge

Row = dict[str, Any]  #: a part of result.json, whose schema is ``pipeline.search.result_schema``

MARGIN = "smallest_margin"
QUANTILE_TIME = "shift_time_quantile_s"
FIRST_TRY = "first_try_share"
NORMAL_95 = 1.96  #: standard errors to the end of a 95 % interval
#: Printed units that differ from the stored ones, by objective.
PRINTED_UNITS = {
    "peak_impact_force_N": "kN",
    "peak_axial_force_N": "kN",
    MARGIN: "%",
    FIRST_TRY: "%",
    "smallest_margin_worst": "%",
    "smallest_margin_statistical": "%",
}
UNIT_FACTORS = {"ms": 1e3, "%": 100.0, "kN": 1e-3}  #: printed value over the stored one
#: Kinds of designs.
FAILS = "fails when simulated"
UNCLEAR = WORDS["not_clear"]


@dataclass(frozen=True)
class Goal(Objective):
    """An objective of a study with its printed ``label`` and ``unit``."""

    @property
    def factor(self) -> float:
        """Printed value over the stored one."""
        return UNIT_FACTORS.get(self.unit, 1.0)

    @property
    def title(self) -> str:
        """Label and unit for a column or an axis; of a maximised objective with its sense."""
        title = f"{self.label}, {self.unit}" if self.unit else self.label
        return f"{title} (more is better)" if self.maximise else title

    def printed_value(self, row: Row) -> float:
        """Read the value of a row, in the printed unit."""
        return self.factor * float(row[self.name])

    def error(self, row: Row) -> float:
        """Read the standard error of a row, in the printed unit; zero for an exact objective."""
        return self.factor * float(row["standard_errors"].get(self.name) or 0.0)

    def estimate(self, estimates: Row) -> tuple[float, float]:
        """Read value and standard error of an estimate or a gain, in the printed unit."""
        estimate = estimates[self.name]
        return self.factor * estimate["value"], self.factor * (estimate["standard_error"] or 0.0)

    def ends(self, value: float, error: float) -> tuple[float, float]:
        """Compute the 95 % interval of a value in the printed unit; of a share by posterior."""
        if self.name != FIRST_TRY or not error:
            return value - NORMAL_95 * error, value + NORMAL_95 * error
        low, high = interval(value / self.factor, (error / self.factor) ** 2)
        return self.factor * low, self.factor * high

    def pair(self, value: float, error: float = 0.0) -> str:
        """Print a value with its standard error, without the unit; both in the printed unit.

        A share has its 95 % interval instead, as its error is not symmetric.
        """
        if self.name == FIRST_TRY and error:
            low, high = self.ends(value, error)
            return f"{value:.4g} (95 %: {low:.4g} to {high:.4g})"
        return self.difference(value, error)

    def difference(self, value: float, error: float = 0.0) -> str:
        """Print a difference of two values with its standard error, without the unit."""
        if self.unit in UNIT_FACTORS:
            return with_error(value, error) if error else minus(f"{value:.1f}")
        suffix = f" ± {error:.2g}" if error else ""
        return minus(f"{value:.4g}{suffix}")

    def words(self, value: float, error: float = 0.0) -> str:
        """Print a value with standard error and unit."""
        return f"{self.pair(value, error)} {self.unit}".strip()


def goals_of(result: Row, *extra_names: str) -> list[Goal]:
    """List the objectives of a result, the leading one first, then further ones by name."""
    names = sorted(result["objectives"], key=lambda name: name != result["leading"])
    level = 100 * result.get("quantile", QUANTILE)
    goals = []
    for name in dict.fromkeys((*names, *extra_names)):
        objective = OBJECTIVES[name]
        unit = "ms" if objective.unit == "s" else PRINTED_UNITS.get(name, objective.unit)
        label = objective.label
        if name == QUANTILE_TIME:
            label = f"{level:.4g} % {label}"
        goals.append(Goal(**{**vars(objective), "label": label, "unit": unit}))
    return goals


def design_name(row: Row) -> str:
    """Name a design by its number, or as the prototype."""
    return "prototype" if row["prototype"] else f"design {row['trial']}"


def confirmed_designs(result: Row) -> dict[int, Row]:
    """Select the confirmed designs of the front, by trial; empty before the confirmation."""
    confirmation = result["confirmation"] or {"designs": []}
    return {record["trial"]: record for record in confirmation["designs"]}


def confirmation_of(result: Row, row: Row) -> Row | None:
    """Select the record of a design at new angles; None if it was not simulated there."""
    confirmation: Row = result["confirmation"] or {}
    if "prototype" in confirmation and row["prototype"]:
        return dict(confirmation["prototype"])
    records = nearest_records(result) | confirmed_designs(result)
    if "chosen" in confirmation:
        records[confirmation["chosen"]] = confirmation["best"]
    return records.get(row["trial"])


def nearest_records(result: Row) -> dict[int, Row]:
    """Select the records at new angles of a search in which no design passes, by trial."""
    return {record["trial"]: record for record in result.get("nearest") or ()}


def engaged_shifts(record: Row) -> tuple[int, int]:
    """Count the shifts of a confirmed design that engaged, and all of them."""
    points = record["points"]
    return sum(round(p["engaged"] * p["n"]) for p in points), sum(p["n"] for p in points)


def margins_of(row: Row, record: Row | None) -> dict[str, float]:
    """Collect the margins of a design by check; those of its ``record`` at new angles first."""
    checks = (record or {"checks": []})["checks"]
    confirmed = {c["name"]: c["margin"] for c in checks if c["margin"] is not None}
    return {**(row["margins"] or {}), **confirmed}


def margin_intervals(record: Row | None) -> dict[str, list[float]]:
    """Collect the 95 % intervals of a confirmed design's landing margins, by check."""
    checks = (record or {"checks": []})["checks"]
    return {c["name"]: c["margin_interval"] for c in checks if c.get("margin_interval")}


def confirmed_verdict(confirmed: Row) -> VerdictRow:
    """Read the verdict on a confirmed design; judge the checks of a record without one."""
    verdict = confirmed.get("verdict")
    if verdict:
        return VerdictRow(**verdict)
    margins = []
    for check in confirmed["checks"]:
        low, high = check.get("margin_interval") or (check["margin"], check["margin"])
        margins.append(Margin(check["name"], check["margin"], clear=low >= 0.0 or high < 0.0))
    return VerdictRow(**judge(margins, ()).to_dict())


def objection(confirmed: Row) -> str:
    """Compose the objection to a confirmed design, checks with margins; empty if it passes.

    Limits that sum up other checks are named if no single check fails.
    """
    verdict = confirmed_verdict(confirmed)
    if verdict.state == "passes":
        return ""
    if verdict.state == "not_judged":
        names = [check_name(missing.check) for missing in verdict.not_judged]
        return f"{WORDS['not_judged']}: {', '.join(names)}"
    names = verdict.not_clear
    if verdict.state == "fails":
        failed = [name for name in verdict.failed if name not in verdict.not_clear]
        names = [name for name in failed if name not in SUMMARIES] or failed
    checks = {check["name"]: check for check in confirmed["checks"]}
    words = ", ".join(_margin_words(checks[name]) for name in names)
    return f"fails {words}" if verdict.state == "fails" else f"{WORDS['not_clear']}: {words}"


def _margin_words(check: Row) -> str:
    """Print a check with its margin and the 95 % interval of the margin."""
    words = f"{check_name(check['name'])} ({percent(check['margin'])}"
    ends = check.get("margin_interval")
    if ends:
        words += f", 95 %: {' to '.join(map(percent, ends))}"
    return f"{words})"


def out_at_new_angles(result: Row) -> dict[int, str]:
    """Collect the objections to designs with a negative margin at new angles, by trial."""
    return {
        trial: objection(record)
        for trial, record in confirmed_designs(result).items()
        if confirmed_verdict(record).failed
    }


def of_kinds(result: Row) -> dict[str, list[Row]]:
    """Group the simulated designs of a search by kind; a design has one kind, kinds may be empty.

    Confirmed designs have the values of their confirmation.
    """
    front = {row["trial"]: row for row in result["front"]}
    objections = out_at_new_angles(result)
    for trial, record in nearest_records(result).items():
        objections[trial] = objections.get(trial) or objection(record)
    kinds = ("dominated", FAILS, UNCLEAR, "front", "chosen", "prototype")
    designs: dict[str, list[Row]] = {name: [] for name in kinds}
    for searched in result["trials"]:
        row = _estimated_row(result, front.get(searched["trial"], searched))
        if row[SIMULATED] is not None:
            kind = _kind_of(result, row, objections.get(row["trial"], ""))
            designs[kind].append(row)
    return designs


def _estimated_row(result: Row, row: Row) -> Row:
    """Replace values of prototype or nearest design by those at new angles, if it has any."""
    if row["prototype"]:
        record = confirmation_of(result, row)
    else:
        record = nearest_records(result).get(row["trial"])
    if record is None:
        return row
    estimates = record["estimates"].items()
    values = {name: estimate["value"] for name, estimate in estimates}
    errors = {name: estimate["standard_error"] for name, estimate in estimates}
    return row | values | {"standard_errors": errors, SIMULATED: record[SIMULATED]}


def _kind_of(result: Row, row: Row, words: str) -> str:
    """Name the kind of a simulated design; ``words`` are the objection to it at new angles."""
    if result["best"] and row["trial"] == result["best"]["trial"]:
        return "chosen"
    if row["prototype"]:
        return "prototype"
    if words.startswith(UNCLEAR):
        return UNCLEAR
    if words or not row["feasible"]:
        return FAILS
    on_front = any(row["trial"] == design["trial"] for design in result["front"])
    return "front" if on_front else "dominated"


def designs_shown(result: Row) -> list[Row]:
    """List the prototype, the front, best first, and designs with objections at new angles.

    Each design is listed once, with the values of the search.
    """
    rows = {row["trial"]: row for row in result["trials"]}
    prototypes = [row for row in result["trials"] if row["prototype"]]
    trials = [row["trial"] for row in (*prototypes, *result["front"])]
    return [rows[trial] for trial in dict.fromkeys([*trials, *out_at_new_angles(result)])]


def designs_frame(result: Row, names: Sequence[str], rows: Sequence[Row] | None = None) -> Frame:
    """Tabulate the rows of designs, all of a search by default, with kinds, errors and margins.

    The columns of the searched variables ``names`` stand before those of values.
    """
    front = {row["trial"] for row in result["front"]}
    objections = out_at_new_angles(result)
    best_trial = (result["best"] or {}).get("trial")
    first_keys = (*names, "trial", "prototype", "failed")
    table = []
    for row in result["trials"] if rows is None else rows:
        values = {key: value for key, value in row.items() if not isinstance(value, dict | list)}
        changes = row.get("time_within_tolerances") or {}
        table.append(
            {
                "trial": row["trial"],
                "prototype": row["prototype"],
                "on_front": row["trial"] in front,
                "failed_at_fresh_angles": row["trial"] in objections,
                "chosen": row["trial"] == best_trial,
                **{name: row[name] for name in names},
                **{key: value for key, value in values.items() if key not in first_keys},
                **{f"standard_error_of_{name}": v for name, v in row["standard_errors"].items()},
                "failed": " ".join(row["failed"]),
                **{
                    f"within_tolerances_{k}": v
                    for k, v in changes.items()
                    if not isinstance(v, dict)
                },
                **{f"margin_of_{name}": margin for name, margin in row["margins"].items()},
            }
        )
    return frame_of(table)
