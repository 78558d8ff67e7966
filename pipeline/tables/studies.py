"""What a search found, and how good its surrogate is."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from rich.console import Group, RenderableType

from pipeline.config import Study
from pipeline.console import columns, in_ms
from pipeline.records import is_clear
from surrogate.validation import Validation


def study_table(study: Study, result: dict[str, Any], report: Path) -> RenderableType:
    """Return the front and the confirmation of a study."""
    variables = list(study.variables)
    table = columns("design", *variables, "time, ms", "s.e., ms", "smallest margin")
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
