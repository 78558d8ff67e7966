"""Tables for people at the command line, and flat records of results."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rich.console import Group, RenderableType
from rich.table import Table

from diagnosis.comparison import Comparison, Difference
from pipeline.config import Study
from pipeline.console import in_ms
from pipeline.report import is_clear
from pipeline.tolerances import KINDS, Within
from sim.checks import GROUPS, Check, feasible, smallest_margin
from sim.engagement import Engagement
from sim.expectation import Expectation
from sim.root_check import RootCheck
from sim.tolerance import Spread
from sim.units import MM, MPA, RPM
from surrogate.query import Answer
from surrogate.validation import Validation


def _table(*columns: str) -> Table:
    table = Table(box=None, pad_edge=False, header_style="bold")
    for index, column in enumerate(columns):
        table.add_column(column, justify="left" if index == 0 else "right")
    return table


def shift_table(result: Engagement, torque_peak: float | None) -> RenderableType:
    """Return outcome, phases, events and loads of one shift; ``torque_peak`` in N m."""
    table = _table("phase", "start, ms", "end, ms", "length, ms")
    for phase in result.phases:
        length = phase.end - phase.start
        table.add_row(phase.name, in_ms(phase.start), in_ms(phase.end), in_ms(length))
    outcome = result.outcome.value.replace("_", " ")
    time = f" in {in_ms(result.shift_time)} ms" if result.shift_time is not None else ""
    happened = "; ".join(event_facts(result))
    loads = "\n".join(load_facts(result, torque_peak))
    return Group(f"{outcome}{time}: {result.detail}", table, happened, loads)


def event_facts(result: Engagement) -> list[str]:
    """Return what happened in a shift, in words."""
    events = result.events
    slid = f"faces slid {events.face_slide / MM:.1f} mm" if events.chamfer_slid else "no face slid"
    return [
        _counted(events.face_contacts, "face contact"),
        f"{_counted(events.slots_skipped, 'slot')} skipped",
        f"thrown back {events.rebound / MM:.2f} mm",
        f"held dog on dog {in_ms(events.time_blocked)} ms",
        slid,
    ]


def _counted(number: int, thing: str) -> str:
    return f"{number or 'no'} {thing}{'' if number == 1 else 's'}"


def load_facts(result: Engagement, torque_peak: float | None) -> list[str]:
    """Return the loads of a shift, in words; ``torque_peak`` in N m."""
    loads = result.loads
    facts = [
        f"peak force axial {loads.peak_axial_force:.0f} N, "
        f"tangential {loads.peak_tangential_force:.0f} N",
        f"impulse of the hardest millisecond {loads.impact_impulse:.3g} N s",
        f"energy dissipated {loads.energy_dissipated:.3g} J",
    ]
    if loads.residual_mismatch is not None:
        facts.append(f"mismatch as the flanks close {loads.residual_mismatch / RPM:.3g} 1/min")
    if torque_peak is not None:
        facts.append(f"driveline torque peak from that mismatch {torque_peak:.3g} N m")
    return facts


def expectation_table(result: Expectation) -> RenderableType:
    """Return the expected shift time of each operating point and over all."""
    table = _table("mismatch, 1/min", "force, N", "mean, ms", "s.e., ms", "sd, ms", "engaged", "n")
    for p in result.points:
        table.add_row(
            f"{p.point.mismatch / RPM:.4g}",
            f"{p.point.profile.force:.1f}",
            in_ms(p.mean),
            in_ms(p.standard_error),
            in_ms(p.sd),
            f"{p.engaged:.0%}",
            str(p.n),
        )
    total = (
        f"expected shift time {in_ms(result.mean)} +- {in_ms(result.standard_error)} ms "
        "(one standard error)"
    )
    if result.numerical_error is not None and not math.isnan(result.numerical_error):
        total += f", numerical error {result.numerical_error * 1e3:.2g} ms"
    if result.is_lower_bound:
        total += "\nnone engaged at a point above: its mean is an estimate with p = 1/(n + 1)"
    return Group(table, total)


def strength_table(
    checks: Sequence[Check],
    within: Within,
    held: float,
    notes: Sequence[str] = (),
    explain: bool = False,
) -> RenderableType:
    """Return every check with value, limit and margins, by group.

    ``within`` has the margins left within the tolerances by the check's name, ``held`` is
    what the blocking mechanism has to hold, N; ``notes`` are warnings.
    """
    table = _table("check", "value", "", "limit", "unit", "margin", "worst case", "rss", "passed")
    for group, title in GROUPS.items():
        members = [c for c in checks if c.rule.group == group]
        if members:
            table.add_row(title, style="bold")
        for c in members:
            left = within.get(c.name, {})
            table.add_row(
                "  " + c.name,
                f"{c.value:.4g}",
                "<=" if c.rule.at_most else ">=",
                f"{c.limit:.4g}",
                c.unit,
                percentage(c.margin),
                *(percentage(left[k]) if k in left else "-" for k in KINDS),
                "yes" if c.passed else "NO",
            )
    weakest = smallest_margin(checks)
    verdict = "feasible" if feasible(checks) else "not feasible"
    if not any(c.rule.group == "impact" for c in checks):
        verdict += " before its landing, dog on dog, is simulated"
    lines = [
        "",
        "margin: distance to the limit over the limit, at nominal size, with every tolerance at "
        "its worst, and by root sum of squares (no tolerances for the landing)",
        f"{verdict}; smallest margin {percentage(weakest.margin, 1)}, {weakest.name}",
        *_within_line(within),
        *(f"warning: {note}; --fem checks it" for note in notes),
        f"the blocking mechanism has to hold {held:.0f} N",
    ]
    return Group(table, *lines, *([_rules_table(checks)] if explain else []))


def _within_line(within: Within) -> list[str]:
    """Return the smallest margin in the worst case, in words."""
    if not within:
        return []
    name = min(within, key=lambda n: within[n]["worst_case"])
    worst = percentage(within[name]["worst_case"], 1)
    return [f"with every tolerance at its worst {worst}, {name}"]


def percentage(share: float, digits: int = 0) -> str:
    """Return a margin in percent; what is beyond -999 % says no more than that."""
    if math.isinf(share):
        return "no dog"
    return f"{max(share, -9.99):.{digits}%}"


def _rules_table(checks: Sequence[Check]) -> RenderableType:
    table = Table(box=None, pad_edge=False, header_style="bold", title_justify="left")
    for column in ("check", "meaning", "formula", "source", "limit set by"):
        table.add_column(column, overflow="fold")
    for rule in sorted((c.rule for c in checks), key=lambda r: list(GROUPS).index(r.group)):
        table.add_row(rule.name, rule.meaning, rule.formula, rule.source, rule.key)
    return table


def root_table(roots: Sequence[RootCheck]) -> RenderableType:
    """Return the root stress by finite elements beside the closed form."""
    head = ("tension at the root", "lever, mm", "finite elements, MPa", "closed form, MPa", "ratio")
    table = _table(*head)
    where = {
        "whole": "all that touches",
        "tip": "top fifth of the flank",
        "load": "at the load height, interpolated",
    }
    for root in roots:
        table.add_row(
            f"{root.flank} flank, {where[root.band]}",
            f"{root.lever / MM:.2f}",
            f"{root.elements / MPA:.0f}",
            f"{root.formula / MPA:.0f}",
            f"{root.formula / root.elements:.2f}",
        )
    return Group("", table)


def export_text(written: dict[str, str], volume: float) -> RenderableType:
    """Return which files were written; ``volume`` of one ring in mm3."""
    words = {"svg": "drawing", "stl": "one ring, both are alike", "step": "both rings"}
    lines = [f"wrote {path} ({words[kind]})" for kind, path in written.items()]
    return Group(*lines, f"volume of a ring {volume:.1f} mm3")


def study_table(study: Study, result: dict[str, Any], report: Path) -> RenderableType:
    """Return the front and the confirmation of a study."""
    variables = list(study.variables)
    table = _table("design", *variables, "time, ms", "s.e., ms", "smallest margin")
    for row in result["front"]:
        values = [f"{row[v]:.4g}" for v in variables]
        time, error = in_ms(row["expected_shift_time_s"]), in_ms(row["standard_error_s"])
        margin = f"{row['smallest_margin']:.0%} {row['weakest_check']}"
        table.add_row(str(row["trial"]), *values, time, error, margin)
    lines: list[RenderableType] = [table]
    c = result["confirmation"]
    if c is None:
        lines.append("no design passes every check, so none was simulated")
    else:
        best, proto = c["best"], c["prototype"]
        lines.append(
            f"at fresh angles: design {result['best']['trial']} "
            f"{in_ms(best['expected_shift_time_s'])} +- {in_ms(best['standard_error_s'])} ms, "
            "prototype "
            f"{in_ms(proto['expected_shift_time_s'])} +- {in_ms(proto['standard_error_s'])} ms, "
            f"gain {in_ms(c['gain_s'])} +- {in_ms(c['gain_standard_error_s'])} ms "
            f"(one standard error; numerical error {best['numerical_error_s'] * 1e3:.2g} ms)"
        )
        if not is_clear(c):
            lines.append("the best design is not distinguishable from the prototype")
    lines.append(f"{result['n_simulated_shifts']} shifts simulated; report: {report}")
    return Group(*lines)


def validation_text(validation: Validation, path: Path) -> str:
    """Return the validation figures of a surrogate."""
    return (
        f"{validation.n} designs, held out in turn: Q2 {validation.q2:.3f}, "
        f"rmse {in_ms(validation.rmse_s)} ms, {validation.coverage_95:.0%} within the 95 % "
        f"interval; written to {path}"
    )


def answer_text(
    answer: Answer, validation: Validation, spread: Spread, checks: RenderableType
) -> RenderableType:
    """Return the surrogate's answer with warnings, its move within tolerances, and checks."""
    lines = [
        f"expected shift time {in_ms(answer.time)} ms, 95 % interval {in_ms(answer.low)} to "
        f"{in_ms(answer.high)} ms (surrogate)"
    ]
    lines += [f"warning: {w}; the prediction extrapolates" for w in answer.warnings]
    if not validation.useful:
        lines.append(
            f"warning: on designs held out the surrogate has Q2 {validation.q2:.2f}; "
            "simulate more designs before relying on it"
        )
    lines.append(
        f"within the tolerances it moves by {spread.worst_case * 1e3:.2g} ms in the worst case, "
        f"{spread.root_sum_square * 1e3:.2g} ms by root sum of squares"
    )
    return Group(*lines, "", checks)


def difference_record(d: Difference) -> dict[str, Any]:
    """Return one operating point of a comparison by the contract's names."""
    return {
        "mismatch_rpm": d.cell.point.mismatch / RPM,
        "force_N": d.cell.point.profile.force,
        "bench_s": d.cell.time,
        "simulated_s": d.simulated.mean_engaged,
        "standard_error_s": d.standard_error,
        "z": d.z,
        "engaged": d.simulated.engaged,
        "n": d.simulated.n,
    }


def comparison_table(result: Comparison) -> RenderableType:
    """Return bench and simulation side by side."""
    head = ("mismatch, 1/min", "force, N", "bench, ms", "simulated, ms", "s.e., ms", "ratio", "z")
    table = _table(*head)
    for d in result.differences:
        bench, simulated = d.cell.time, d.simulated.mean_engaged
        ratio = f"{simulated / bench:.2f}" if bench and simulated else "-"
        z = f"{d.z:+.1f}" if d.z is not None else "-"
        mismatch = f"{d.cell.point.mismatch / RPM:.4g}"
        force = f"{d.cell.point.profile.force:.1f}"
        error = in_ms(d.standard_error)
        table.add_row(mismatch, force, in_ms(bench), in_ms(simulated), error, ratio, z)
    total = (
        f"{result.bench.name}: root-mean-square gap {in_ms(result.rmse)} ms, "
        f"relative {result.relative_rms:.1%}"
    )
    if result.numerical_error is not None:
        total += f"; numerical error of the mean {result.numerical_error * 1e3:.2g} ms"
    return Group(table, total)
