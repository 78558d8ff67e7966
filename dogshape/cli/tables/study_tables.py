"""Result of a search, and the quality of its surrogate."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from rich.console import Group, RenderableType
from rich.table import Table

from dogshape.cli.console import columns
from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.reports.kit.text import axis, check_name, in_ms, percent
from dogshape.pipeline.reports.study.alternatives import HEAD, alternatives, cells_of
from dogshape.pipeline.reports.study.designs import (
    designs_shown,
    failed_at_new_angles,
    is_measured,
    least_margins,
    margins_of,
    weakest_at_worst,
)
from dogshape.pipeline.reports.study.goals import MARGIN, Goal, goals_of
from dogshape.pipeline.reports.study.study_page import at_own_places
from dogshape.pipeline.reports.study.summary import facts_of, gained, headline
from dogshape.sim.shift.outcome import depends_on_clock
from dogshape.surrogate.store import Stored
from dogshape.surrogate.validation_figures import LEAST_Q2

Row = dict[str, Any]  #: a part of result.json, whose schema is ``pipeline.store.result_schema``


def study_table(study: Setup, result: Row, report: Path | None) -> RenderableType:
    """Show the result of a study: prototype beside chosen design, and the front.

    ``report`` is None where none was made.
    """
    result = at_own_places(study, result)
    lines: list[RenderableType] = [headline(result)]
    if result["confirmation"]:
        lines += ["", _pair(study, result), "", _facts(study, result)]
        error = result["confirmation"]["best"]["numerical_error_s"]
        if error is not None:
            lines.append(f"numerical error of the expected shift time {error * 1e3:.2g} ms")
        if others := alternatives(study, result):
            table = columns(*HEAD)
            for one in others:
                table.add_row(*cells_of(one, others[0]))
            lines += ["", "designs of the front that pass every check at the new angles", table]
    if result["best"] is not None:
        last = ", last what failed at the new angles" if failed_at_new_angles(result) else ""
        by = "by the new angles" if result["confirmation"] else "by the search"
        order = f"in the order of the {goals_of(result).leading.label}"
        lines += ["", f"front {by}, {order} (95 % intervals){last}", _front(study, result), ""]
    for reason, count in result["failed_shifts"].items():
        again = "; --resume simulates them again" if depends_on_clock(reason) else ""
        lines.append(f"{count} shifts failed and count as not engaged: {reason}{again}")
    where = "none yet, 'dogshape report' makes it" if report is None else report
    return Group(*lines, f"report: {where}")


def _facts(study: Setup, result: Row) -> Table:
    """Return the facts of the chosen design, a line each."""
    table = columns("fact", "")
    table.columns[1].justify, table.columns[1].overflow = "left", "fold"
    for fact in facts_of(study, result):
        table.add_row(fact.name, fact.words)
    return table


def _pair(study: Setup, result: Row) -> Table:
    """Return prototype and chosen design, a line for each variable and objective."""
    best, c = result["best"], result["confirmation"]
    own = next(row for row in result["trials"] if row["prototype"])
    both = (
        [(own, c["prototype"])] if best["prototype"] else [(own, c["prototype"]), (best, c["best"])]
    )
    heads = ["prototype"] if best["prototype"] else ["prototype", f"design {best['trial']}, chosen"]
    table = columns(f"at {c['angles']} new angles (95 % interval)", *heads, "change")
    for name in study.variables:
        table.add_row(axis(name), *(f"{row[name]:.4g}" for row, _ in both))
    if best["prototype"] and is_measured(c["prototype"]):
        lead = goals_of(result).leading
        table.add_row(lead.title, _ranged(lead, lead.estimate(c["prototype"])))
    for one in gained(result):
        table.add_row(one.goal.title, *(_ranged(one.goal, p) for p in (one.prototype, one.chosen)),
                      one.change)  # fmt: skip
    least = (least_margins(margins_of(*one))[0] for one in both)
    table.add_row("smallest margin, nominal size", *map(_named, least))
    worst = (weakest_at_worst(study, row) for row, _ in both)
    table.add_row("at worst-case tolerances", *map(_named, worst))
    return table


def _front(study: Setup, result: Row) -> Table:
    """Return the prototype and the designs of the front by the study's objectives."""
    goals = [goal for goal in goals_of(result).told if goal.name != MARGIN]
    table = columns(
        "design", *study.variables, *(goal.title for goal in goals), "smallest margin, nominal size"
    )
    for row in designs_shown(result):
        values = [f"{row[name]:.4g}" for name in study.variables]
        name = "prototype" if row["prototype"] else str(row["trial"])
        name += ", chosen" if row["trial"] == result["best"]["trial"] else ""
        table.add_row(name, *values, *(_searched(goal, row) for goal in goals), _margin(row))
    return table


def _searched(goal: Goal, row: Row) -> str:
    """Return an objective of a row with its 95 % interval, if it has one."""
    if row.get(goal.name) is None or (goal.unit == "ms" and not is_measured(row)):
        return "does not engage" if row["points"] else "not simulated"
    if not goal.error(row):
        return goal.number(goal.shown(row))
    return f"{goal.number(goal.shown(row))} ({_between(goal, *goal.interval(row))})"


def _ranged(goal: Goal, found: tuple[float, float]) -> str:
    """Return a value with its 95 % interval from its standard error, if it has one."""
    value, half = found[0], 1.96 * found[1]
    return f"{goal.number(value)}" + (
        f" ({_between(goal, value - half, value + half)})" if half else ""
    )


def _between(goal: Goal, low: float, high: float) -> str:
    return f"{goal.number(low)} to {goal.number(high)}"


def _margin(row: Row) -> str:
    return _named(least_margins(row["margins"])[0] if row["margins"] else None)


def _named(one: tuple[str, float] | None) -> str:
    return "no dog" if one is None else f"{percent(one[1])} {check_name(one[0])}"


def validation_text(stored: Stored, path: Path) -> RenderableType:
    """Return the figures of a surrogate, and the scores of the forms it was chosen from."""
    data, v = stored.surrogate.data, stored.validation
    how = "references apart" if v.source == "references" else "designs held out in turn"
    table = columns("judged by", "Q2", "rmse, ms", "within 95 %")
    noise = f"{v.n} {how}, expected time, s.e. {in_ms(v.noise_s)} ms"
    table.add_row(noise, f"{v.q2:.3f}", in_ms(v.rmse_s), f"{v.coverage_95:.0%}")
    table.add_row(
        "single operating points",
        f"{v.q2_points:.3f}",
        in_ms(v.rmse_points_s),
        f"{v.coverage_points:.0%}",
    )
    lines: list[RenderableType] = [
        f"{len(data.designs)} designs, {len(data)} operating points, {data.shifts} shifts",
        table,
    ]
    for named, q2 in (("expected times", v.q2), ("times at single operating points", v.q2_points)):
        if q2 < LEAST_Q2:
            lines.append(
                f"warning: Q2 {q2:.3f} of {named} explains less than half of their variance: "
                "useless; raise surrogate.designs or surrogate.mix_shifts"
            )
    lines.append(
        f"times are of shifts that engage, bias {v.bias_s * 1e3:+.1f} ms; {v.lost} did not, where "
        f"{v.lost_expected:.1f} were expected"
    )
    if data.levels:
        found = data.levels["discrepancy"]
        lines.append(
            f"rows of the compiled engine, {data.levels['planar']} shifts, corrected by "
            f"{found['constant']:+.2%} (s.e. {found['constant_error']:.2%}) from "
            f"{data.levels['drake']} of Drake"
        )
    if v.rank_best is not None:
        lines.append(f"rank correlation of {v.n_best} designs of the best tenth {v.rank_best:.2f}")
    if stored.comparison:
        scores = columns("form", "mean log density", "rmse of ln t", "within 95 %")
        for s in stored.comparison:
            scores.add_row(
                s["form"],
                f"{s['log_density']:.3f}",
                f"{s['log_rmse']:.3f}",
                f"{s['coverage_95']:.0%}",
            )
        lines += ["", "forms by what they foretold of designs left out", scores]
    return Group(*lines, f"written to {path}")
