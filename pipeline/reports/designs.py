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

MARGIN, QUANTILE_TIME = "smallest_margin", "shift_time_quantile_s"
FIRST_TRY = "first_try_share"
NORMAL_95 = 1.96  #: standard errors to the end of a 95 % interval
#: Units that are shown instead of the stored ones, and the factors that lead to them.
SHOWN = {
    "peak_impact_force_N": "kN", "peak_axial_force_N": "kN", MARGIN: "%", FIRST_TRY: "%",
    "smallest_margin_worst": "%", "smallest_margin_statistical": "%",
}  # fmt: skip
FAILS, UNCLEAR = "fails when simulated", WORDS["not_clear"]  #: kinds of designs
FACTORS = {"ms": 1e3, "%": 100.0, "kN": 1e-3}


@dataclass(frozen=True)
class Goal(Objective):
    """An objective of a study as it is shown; ``label`` and ``unit`` are for people."""

    @property
    def factor(self) -> float:
        """Shown value over the stored one."""
        return FACTORS.get(self.unit, 1.0)

    @property
    def title(self) -> str:
        """Label and unit, for a column or an axis, with the direction where it is not the usual."""
        words = f"{self.label}, {self.unit}" if self.unit else self.label
        return words + (" (more is better)" if self.maximise else "")

    def shown(self, row: Row) -> float:
        """Return the value of a row in the unit that is shown."""
        return self.factor * float(row[self.name])

    def error(self, row: Row) -> float:
        """Return the standard error of a row in the unit that is shown; zero if exact."""
        return self.factor * float(row["standard_errors"].get(self.name) or 0.0)

    def estimate(self, estimates: Row) -> tuple[float, float]:
        """Return its estimate at the new angles, or a gain in it, and the error, as shown."""
        found = estimates[self.name]
        return self.factor * found["value"], self.factor * (found["standard_error"] or 0.0)

    def ends(self, shown: float, error: float) -> tuple[float, float]:
        """Return the ends of the 95 % interval of a shown value; of a share by its posterior."""
        if self.name != FIRST_TRY or not error:
            return shown - NORMAL_95 * error, shown + NORMAL_95 * error
        low, high = interval(shown / self.factor, (error / self.factor) ** 2)
        return self.factor * low, self.factor * high

    def pair(self, shown: float, error: float = 0.0) -> str:
        """Print a shown value with its standard error, if it has one, without the unit.

        A share has its 95 % interval instead: its error is not the same to both sides.
        """
        if self.name == FIRST_TRY and error:
            low, high = self.ends(shown, error)
            return f"{shown:.4g} (95 %: {low:.4g} to {high:.4g})"
        return self.difference(shown, error)

    def difference(self, shown: float, error: float = 0.0) -> str:
        """Print a difference of two shown values with its standard error, without the unit."""
        if self.unit in FACTORS:
            return with_error(shown, error) if error else minus(f"{shown:.1f}")
        return minus(f"{shown:.4g}" + (f" ± {error:.2g}" if error else ""))

    def words(self, shown: float, error: float = 0.0) -> str:
        """Print a shown value with error and unit."""
        return f"{self.pair(shown, error)} {self.unit}".strip()


def goals_of(result: Row, *more: str) -> list[Goal]:
    """List the objectives of a result, the leading one first, then ``more`` that are none."""
    names = sorted(result["objectives"], key=lambda name: name != result["leading"])
    level = f"{100 * result.get('quantile', QUANTILE):.4g} % "
    found = []
    for name in dict.fromkeys((*names, *more)):
        one = OBJECTIVES[name]
        unit = "ms" if one.unit == "s" else SHOWN.get(name, one.unit)
        label = (level if name == QUANTILE_TIME else "") + one.label
        found.append(Goal(**{**vars(one), "label": label, "unit": unit}))
    return found


def design_name(row: Row) -> str:
    """Name a design."""
    return "prototype" if row["prototype"] else f"design {row['trial']}"


def confirmed_designs(result: Row) -> dict[int, Row]:
    """Select the records of the confirmation for designs of the front, by trial."""
    return {one["trial"]: one for one in (result["confirmation"] or {"designs": []})["designs"]}


def confirmation_of(result: Row, row: Row) -> Row | None:
    """Select what a design was simulated with at new angles; None where it was not."""
    confirmation: Row = result["confirmation"] or {}
    if "prototype" in confirmation and row["prototype"]:
        return dict(confirmation["prototype"])
    chosen = {confirmation["chosen"]: confirmation["best"]} if "chosen" in confirmation else {}
    return (nearest_records(result) | confirmed_designs(result) | chosen).get(row["trial"])


def nearest_records(result: Row) -> dict[int, Row]:
    """Select the records of own dog and nearest designs where none passes, by trial."""
    return {one["trial"]: one for one in result.get("nearest") or ()}


def engaged_shifts(record: Row) -> tuple[int, int]:
    """Count the shifts of a confirmed design that engaged, and all of them."""
    points = record["points"]
    return sum(round(p["engaged"] * p["n"]) for p in points), sum(p["n"] for p in points)


def margins_of(row: Row, record: Row | None) -> dict[str, float]:
    """Collect the margins of a design by check, those at the new angles where there are any."""
    checks = (record or {"checks": []})["checks"]
    own = {c["name"]: c["margin"] for c in checks if c["margin"] is not None}
    return {**(row["margins"] or {}), **own}


def margin_intervals(record: Row | None) -> dict[str, list[float]]:
    """Collect the 95 % intervals of a confirmed design's margins by check, of landings alone."""
    checks = (record or {"checks": []})["checks"]
    return {c["name"]: c["margin_interval"] for c in checks if c.get("margin_interval")}


def confirmed_verdict(confirmed: Row) -> VerdictRow:
    """Give the verdict on a confirmed design; of earlier versions that of its checks alone."""
    if verdict := confirmed.get("verdict"):
        return VerdictRow(**verdict)
    margins = []
    for check in confirmed["checks"]:
        low, high = check.get("margin_interval") or (check["margin"], check["margin"])
        margins.append(Margin(check["name"], check["margin"], clear=low >= 0.0 or high < 0.0))
    return VerdictRow(**judge(margins, ()).to_dict())


def objection(confirmed: Row) -> str:
    """Compose the state of a verdict with its checks and their margins; empty where it passes.

    Limits that sum up other checks are named where no other one fails.
    """
    verdict = confirmed_verdict(confirmed)
    if verdict.state == "passes":
        return ""
    if verdict.state == "not_judged":
        names = [check_name(missing.check) for missing in verdict.not_judged]
        return f"{WORDS['not_judged']}: {', '.join(names)}"
    names = verdict.not_clear
    if verdict.state == "fails":
        surely = [name for name in verdict.failed if name not in verdict.not_clear]
        names = [name for name in surely if name not in SUMMARIES] or surely
    checks = {check["name"]: check for check in confirmed["checks"]}
    words = ", ".join(_margin_words(checks[name]) for name in names)
    return f"fails {words}" if verdict.state == "fails" else f"{WORDS['not_clear']}: {words}"


def _margin_words(check: Row) -> str:
    """Name a check with its margin, and the interval of it."""
    words = f"{check_name(check['name'])} ({percent(check['margin'])}"
    if ends := check.get("margin_interval"):
        words += f", 95 %: {' to '.join(map(percent, ends))}"
    return f"{words})"


def out_at_new_angles(result: Row) -> dict[int, str]:
    """Give the objections to designs with a negative margin at new angles, in search order."""
    return {
        trial: objection(record)
        for trial, record in confirmed_designs(result).items()
        if confirmed_verdict(record).failed
    }


def of_kinds(result: Row) -> dict[str, list[Row]]:
    """Sort the simulated designs of a search by kind; each is of one kind, empty kinds too.

    Confirmed ones have the values of their confirmation.
    """
    front = {row["trial"]: row for row in result["front"]}
    out = out_at_new_angles(result)
    kinds = ("dominated", FAILS, UNCLEAR, "front", "chosen", "prototype")
    found: dict[str, list[Row]] = {name: [] for name in kinds}
    for searched in result["trials"]:
        row = front.get(searched["trial"], searched)
        nearest = nearest_records(result).get(row["trial"])
        own = confirmation_of(result, row) if row["prototype"] else nearest
        if own is not None:
            known = own["estimates"].items()
            errors = {name: one["standard_error"] for name, one in known}
            row = row | {name: one["value"] for name, one in known}
            row |= {"standard_errors": errors, SIMULATED: own[SIMULATED]}
        words = out.get(row["trial"]) or (objection(nearest) if nearest else "")
        if row[SIMULATED] is not None:
            kind = (
                "chosen" if result["best"] and row["trial"] == result["best"]["trial"]
                else "prototype" if row["prototype"]
                else UNCLEAR if words.startswith(UNCLEAR)
                else FAILS if words or not row["feasible"]
                else "front" if row["trial"] in front else "dominated"
            )  # fmt: skip
            found[kind].append(row)
    return found


def designs_shown(result: Row) -> list[Row]:
    """List the prototype, the front, best first, and designs out at new angles, once.

    Values are those of the search.
    """
    rows = {row["trial"]: row for row in result["trials"]}
    own = [row for row in result["trials"] if row["prototype"]]
    first = [row["trial"] for row in (*own, *result["front"])]
    return [rows[trial] for trial in dict.fromkeys([*first, *out_at_new_angles(result)])]


def designs_frame(result: Row, names: Sequence[str], rows: Sequence[Row] | None = None) -> Frame:
    """Tabulate designs of a search with all that is known of them, a row each; by default all."""
    front, out = {row["trial"] for row in result["front"]}, out_at_new_angles(result)
    best = (result["best"] or {}).get("trial")
    apart = (*names, "trial", "prototype", "failed")
    table = []
    for row in result["trials"] if rows is None else rows:
        within = row.get("time_within_tolerances") or {}
        table.append({
            "trial": row["trial"],
            "prototype": row["prototype"],
            "on_front": row["trial"] in front,
            "failed_at_fresh_angles": row["trial"] in out,
            "chosen": row["trial"] == best,
            **{name: row[name] for name in names},
            **{k: v for k, v in row.items() if k not in apart and not isinstance(v, dict | list)},
            **{f"standard_error_of_{name}": v for name, v in row["standard_errors"].items()},
            "failed": " ".join(row["failed"]),
            **{f"within_tolerances_{k}": v for k, v in within.items() if not isinstance(v, dict)},
            **{f"margin_of_{name}": margin for name, margin in row["margins"].items()},
        })  # fmt: skip
    return frame_of(table)
