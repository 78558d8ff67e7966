"""Result of a search, and the quality of its surrogate."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from rich.console import Group, RenderableType
from rich.table import Table

from dogshape.pipeline.cli.console import columns
from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.reports.kit.text import axis, check_name, in_ms, percent
from dogshape.pipeline.reports.study.alternatives import (
    alternatives,
    margin_doubts,
    reasons,
)
from dogshape.pipeline.reports.study.designs import designs_shown, failed_at_new_angles
from dogshape.pipeline.reports.study.goals import MARGIN, Goal, goals_of
from dogshape.pipeline.reports.study.summary import (
    apart_words,
    at_the_ends,
    both_levels,
    choice,
    engine_of,
    failures_of,
    gained,
    headline,
    passed_over,
)
from dogshape.pipeline.simulate.design import ENGAGEMENT
from dogshape.sim.shift.outcome import depends_on_clock
from dogshape.surrogate.store import Stored
from dogshape.surrogate.validation_figures import LEAST_Q2

Row = dict[str, Any]  #: a part of result.json, whose schema is ``pipeline.store.result_schema``


def study_table(study: Setup, result: Row, report: Path | None) -> RenderableType:
    """Show the result of a study: prototype beside chosen design, and the front.

    ``report`` is None where none was made.
    """
    lines: list[RenderableType] = [headline(result)]
    if result["confirmation"]:
        lines += ["", _pair(study, result), *failures_of(result)]
        lines += [*margin_doubts(result), *reasons(alternatives(study, result, None))]
        lines += [words for words in (passed_over(result), *apart_words(result)) if words]
        if left := result["confirmation"]["left_out"]:
            lines.append(
                f"not confirmed, and so not on the front, are designs {', '.join(map(str, left))}: "
                "raise search.confirm_designs"
            )
        error = result["confirmation"]["best"]["numerical_error_s"]
        if error is not None:
            lines.append(f"numerical error of the expected shift time {error * 1e3:.2g} ms")
    if result["best"] is not None:
        last = ", last what failed at the new angles" if failed_at_new_angles(result) else ""
        source = "by the new angles" if result["confirmation"] else "by the search"
        lines += ["", choice(result), "", f"front {source} (95 % intervals){last}"]
        lines += [_front(study, result), ""]
        lines += [words] if (words := at_the_ends(result, study.variables)) else []
    for reason, count in result["failed_shifts"].items():
        again = "; --resume simulates them again" if depends_on_clock(reason) else ""
        lines.append(f"{count} shifts failed and count as not engaged: {reason}{again}")
    where = "none yet, 'dogshape report' makes it" if report is None else report
    both = f", {n} compiled ones" if (n := result.get("n_compiled_shifts")) else ""
    lines.append(
        f"{result['n_simulated_shifts']} shifts simulated by {engine_of(result)}{both}; "
        f"report: {where}"
    )
    lines += [words] if (words := both_levels(result)) else []
    return Group(*lines)


def _pair(study: Setup, result: Row) -> Table:
    """Return prototype and chosen design, a line for each variable and objective."""
    best, angles = result["best"], result["confirmation"]["angles"]
    own = next(row for row in result["trials"] if row["prototype"])
    chosen = "the same" if best["prototype"] else f"design {best['trial']}, chosen"
    table = columns(f"at {angles} new angles (95 % interval)", "prototype", chosen, "change")
    for name in study.variables:
        table.add_row(axis(name), *(f"{row[name]:.4g}" for row in (own, best)), "")
    for one in gained(result):
        table.add_row(one.goal.title, *(_ranged(one.goal, p) for p in (one.prototype, one.chosen)),
                      one.change)  # fmt: skip
    table.add_row("smallest margin, nominal", _margin(own), _margin(best), "")
    return table


def _front(study: Setup, result: Row) -> Table:
    """Return the prototype and the designs of the front by the study's objectives."""
    goals = [goal for goal in goals_of(result).told if goal.name != MARGIN]
    table = columns(
        "design", *study.variables, *(goal.title for goal in goals), "smallest margin, nominal"
    )
    for row in designs_shown(result):
        values = [f"{row[name]:.4g}" for name in study.variables]
        name = "prototype" if row["prototype"] else str(row["trial"])
        name += ", chosen" if row["trial"] == result["best"]["trial"] else ""
        table.add_row(name, *values, *(_searched(goal, row) for goal in goals), _margin(row))
    return table


def _searched(goal: Goal, row: Row) -> str:
    """Return an objective of a row with its 95 % interval, if it has one."""
    if row.get(goal.name) is None:
        return "does not engage" if ENGAGEMENT.name in row["failed"] else "not simulated"
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
    if row["smallest_margin"] is None:
        return "no dog"
    return f"{percent(row['smallest_margin'])} {check_name(row['weakest_check'])}"


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
