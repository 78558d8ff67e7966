"""Predictions of the surrogate for a design."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from rich.console import Group, RenderableType

from dogshape.pipeline.reports.kit.text import in_ms
from dogshape.surrogate.model import Expected

if TYPE_CHECKING:
    from dogshape.check import Check, Guess

TOLD = 5  #: impossible rows of a table that are told one by one


def check_text(found: Check, checks: RenderableType) -> RenderableType:
    """Return the expected time, the surrogate's prediction beside it, and checks."""
    lines = [_time_line(found)]
    if found.expected is not None:
        lines += _parts(found.expected)
    if found.guess is not None:
        lines += _surrogate_lines(found, found.guess)
    if found.design.not_checked and not found.refusal:
        lines.append("landing not judged: the surrogate knows none; leave out --surrogate")
    return Group(*lines, "", checks)


def _time_line(found: Check) -> str:
    expected = found.expected
    if expected is None:
        return f"no shift time: {found.refusal}"
    source = "surrogate" if found.quick is None else (
        f"{found.shifts} shifts of the compiled engine, 1 % of its error against Drake included"
    )  # fmt: skip
    return (
        f"expected shift time {in_ms(expected.time)} ms, 95 % interval {in_ms(expected.low)} to "
        f"{in_ms(expected.high)} ms ({source}); single shifts scatter by {in_ms(expected.sd)} ms, "
        f"{expected.engaged:.1%} engage where fewest do"
    )


def _parts(expected: Expected) -> list[str]:
    """Split an interval into shifts that engage and retries, where retries count."""
    if not expected.retries and not expected.retries_error:
        return []
    bare, error = expected.without_retries
    return [
        f"without retries {in_ms(bare)} \N{PLUS-MINUS SIGN} {in_ms(1.96 * error)} ms, retries "
        f"{in_ms(expected.retries)} \N{PLUS-MINUS SIGN} {in_ms(1.96 * expected.retries_error)} ms "
        "(95 %)"
    ]


def _surrogate_lines(found: Check, guess: Guess) -> list[str]:
    answer, told, q2 = guess.answer, guess.answer.expected, guess.validation.q2
    lines = []
    if found.quick is not None:
        time = answer.refusal if told is None else (
            f"{in_ms(told.time)} ms ({in_ms(told.low)} to {in_ms(told.high)})"
        )  # fmt: skip
        lines.append(f"surrogate {guess.path}: {time}")
        lines += [*_parts(told)] if told is not None else []
    if found.missed:
        lines.append("warning: the surrogate misses the simulated time by more than its interval")
    lines += [f"warning: {w}; the surrogate extrapolates" for w in answer.warnings]
    lines.append(
        f"next simulated design: {answer.distance:.1f} times as far as one usually is from another"
    )
    if not guess.validation.useful:
        lines.append(
            f"warning: on designs that it has not seen the surrogate has Q2 {q2:.2f}; "
            "simulate more designs before relying on it"
        )
    if told is None:
        return lines
    return [
        *lines,
        f"within the tolerances it moves by {guess.spread.worst_case * 1e3:.2g} ms in the worst "
        f"case, {guess.spread.root_sum_square * 1e3:.2g} ms by root sum of squares",
    ]


def many_text(data: dict[str, Any]) -> str:
    """Write the question that was put to a table of designs."""
    best, many = data["best_feasible"], len(data["impossible"])
    lines = [f"row {one['row']} is no design: {one['reason']}" for one in data["impossible"][:TOLD]]
    lines += [f"and {many - TOLD} more rows are no designs"] if many > TOLD else []
    without = data["without_time"]
    lines += [f"row {one['row']} has no time: {one['reason']}" for one in without[:TOLD]]
    lines += [f"and {len(without) - TOLD} more rows have none"] if len(without) > TOLD else []
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
