"""What a search found, and how good its surrogate is."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from rich.console import Group, RenderableType

from pipeline.config import Study
from pipeline.console import columns, in_ms
from pipeline.design import SIMULATED, objectives_of
from pipeline.records import is_clear
from surrogate.store import Stored


def study_table(study: Study, result: dict[str, Any], report: Path | None) -> RenderableType:
    """Return the front and the confirmation of a study; ``report`` is None where none was made."""
    variables = list(study.variables)
    others = [o for o in objectives_of(study) if o.name not in (SIMULATED, "smallest_margin")]
    heads = [f"{o.label}, {o.unit}".rstrip(", ") for o in others]
    table = columns("design", *variables, "time, ms", "s.e., ms", *heads, "smallest margin")
    for row in result["front"]:
        values = [f"{row[v]:.4g}" for v in variables]
        time, error = in_ms(row["expected_shift_time_s"]), in_ms(row["standard_error_s"])
        margin = f"{row['smallest_margin']:.0%} {row['weakest_check']}"
        more = [f"{row[o.name]:.4g}" for o in others]
        table.add_row(str(row["trial"]), *values, time, error, *more, margin)
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
        lines += [_gain_text(c, o.name, o.label, o.unit) for o in others if o.simulated]
        if not is_clear(c):
            lines.append("the best design is not distinguishable from the prototype")
    for reason, count in result["failed_shifts"].items():
        lines.append(f"{count} shifts failed and count as not engaged: {reason}")
    where = "none yet, 'dogshape report' makes it" if report is None else report
    lines.append(f"{result['n_simulated_shifts']} shifts simulated; report: {where}")
    return Group(*lines)


def _gain_text(confirmation: dict[str, Any], name: str, label: str, unit: str) -> str:
    """Return in words what both confirmed designs have of a simulated objective."""
    told = [
        f"{who} {one['value']:.4g} +- {one['standard_error']:.2g} {unit}"
        for who in ("best", "prototype")
        for one in [confirmation[who]["estimates"][name]]
    ]
    return f"{label}: {', '.join(told)}"


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
    lines.append(
        f"times are of shifts that engage, bias {v.bias_s * 1e3:+.1f} ms; {v.lost} did not, where "
        f"{v.lost_expected:.1f} were expected"
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
