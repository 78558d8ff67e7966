"""Bench data beside the simulation."""

from __future__ import annotations

from rich.console import Group, RenderableType

from dogshape.cli.console import columns
from dogshape.diagnosis.bench.bench_data import Bench
from dogshape.diagnosis.bench.comparison import Comparison
from dogshape.pipeline.reports.kit.text import in_ms
from dogshape.sim.units import RPM

FLIPPED = 1e-3  #: s, numerical error that the steps of the solver alone do not make


def examined_lines(bench: Bench) -> list[str]:
    """Return the same in words, a line each."""
    made = ", ".join(str(correction) for correction in bench.corrections)
    lines = [f"corrected as asked: {made}"] if made else []
    return lines + [f"warning: {finding.sentence}" for finding in bench.warnings]


def _gap(result: Comparison) -> str:
    """Return the gap of times over all points, or of shares engaged where there are no times."""
    if result.rmse is None or result.relative_rms is None:
        engaged, tried, simulated = result.engaged
        return (
            f"no times to compare; {engaged} of {tried} tried shifts engaged on the bench, "
            f"{simulated:.0%} in the simulation"
        )
    return f"root-mean-square gap {in_ms(result.rmse)} ms, relative {result.relative_rms:.1%}"


def comparison_table(result: Comparison) -> RenderableType:
    """Return bench and simulation side by side."""
    head = ("mismatch, 1/min", "force, N", "bench, ms", "simulated, ms", "s.e., ms", "ratio", "z")
    table = columns(*head)
    for d in result.differences:
        bench, simulated = d.cell.time, d.simulated.mean_engaged
        ratio = f"{simulated / bench:.2f}" if bench and simulated else "-"
        z = f"{d.z:+.1f}" if d.z is not None else "-"
        mismatch = f"{d.cell.point.mismatch / RPM:.4g}"
        force = f"{d.cell.point.profile.force:.1f}"
        error = in_ms(d.standard_error)
        table.add_row(mismatch, force, in_ms(bench), in_ms(simulated), error, ratio, z)
    total = f"{result.bench.name}: {_gap(result)}"
    lines = [total, "ratio: simulated over bench; z: bench less simulated, over s.e."]
    if result.numerical_error is not None:
        lines[0] += f"; numerical error of the mean {result.numerical_error * 1e3:.2g} ms"
        if result.numerical_error > FLIPPED:
            lines.append(
                "so large a numerical error is a shift that flipped: of those repeated with a "
                "finer tolerance one or more came into another slot, or did not engage; with more "
                "--angles one such shift counts less"
            )
    return Group(table, *lines, *examined_lines(result.bench))
