"""Predictions of the surrogate for a design."""

from __future__ import annotations

from typing import Any

from rich.console import Group, RenderableType

from dogshape.pipeline.reports.kit.text import in_ms
from dogshape.sim.strength.tolerance import Spread
from dogshape.surrogate.model import Expected
from dogshape.surrogate.query import Answer
from dogshape.surrogate.validation_figures import Validation

TOLD = 5  #: impossible rows of a table that are told one by one


def answer_text(
    answer: Answer, validation: Validation, spread: Spread, checks: RenderableType
) -> RenderableType:
    """Return the surrogate's answer with warnings, its move within tolerances, and checks."""
    expected = answer.expected
    lines = [
        f"expected shift time {in_ms(expected.time)} ms, 95 % interval {in_ms(expected.low)} to "
        f"{in_ms(expected.high)} ms (surrogate); single shifts scatter by {in_ms(expected.sd)} ms, "
        f"{expected.engaged:.1%} engage where fewest do",
        f"next simulated design: {answer.distance:.1f} times as far as one usually is from another",
    ]
    lines += [
        f"warning: {w}; the prediction extrapolates, --engine planar simulates"
        for w in answer.warnings
    ]
    if not validation.useful:
        lines.append(
            f"warning: on designs that it has not seen the surrogate has Q2 {validation.q2:.2f}; "
            "simulate more designs before relying on it"
        )
    lines.append(
        f"within the tolerances it moves by {spread.worst_case * 1e3:.2g} ms in the worst case, "
        f"{spread.root_sum_square * 1e3:.2g} ms by root sum of squares"
    )
    return Group(*lines, "", checks)


def simulated_text(expected: Expected, shifts: int, checks: RenderableType) -> RenderableType:
    """Return the compiled engine's answer, and checks."""
    lines = [
        f"expected shift time {in_ms(expected.time)} ms, 95 % interval {in_ms(expected.low)} to "
        f"{in_ms(expected.high)} ms ({shifts} shifts of the compiled engine, 1 % of its error "
        f"against Drake included); single shifts scatter by {in_ms(expected.sd)} ms, "
        f"{expected.engaged:.1%} engage where fewest do",
        "no surrogate of this study's physics is there; 'dogshape fit' makes one",
    ]
    return Group(*lines, "", checks)


def many_text(data: dict[str, Any]) -> str:
    """Write the question that was put to a table of designs."""
    best, many = data["best_feasible"], len(data["impossible"])
    lines = [f"row {one['row']} is no design: {one['reason']}" for one in data["impossible"][:TOLD]]
    lines += [f"and {many - TOLD} more rows are no designs"] if many > TOLD else []
    least = (
        f"least predicted time of a feasible one {in_ms(best['expected_shift_time_s'])} ms, "
        f"row {best['row']}"
        if best
        else "none passes every check"
    )
    counts = f"{data['n']} designs, {data['in_range']} of them in the trained range"
    impossible = f", {many} impossible" if many else ""
    feasible = f"{data['feasible']} feasible before their landing is simulated"
    return "\n".join([*lines, f"wrote {data['file']}: {counts}{impossible}, {feasible}; {least}"])


def filled_lines(data: dict[str, Any]) -> list[str]:
    """List columns that the study filled in for a table of designs, and those only copied."""
    filled = ", ".join(f"{name} = {value:.6g}" for name, value in data["filled"].items())
    lines = [f"the table has no column for, and the study gives, {filled}"] if filled else []
    kept = ", ".join(data["kept"])
    return lines + ([f"columns copied, and no part of the question: {kept}"] if kept else [])
