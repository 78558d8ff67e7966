"""What the surrogate says of a design."""

from __future__ import annotations

from rich.console import Group, RenderableType

from pipeline.console import in_ms
from sim.tolerance import Spread
from surrogate.query import Answer
from surrogate.validation import Validation


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
