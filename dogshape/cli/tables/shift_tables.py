"""Result of one shift, and the mean of many."""

from __future__ import annotations

import math
from collections.abc import Mapping

from rich.console import Group, RenderableType

from dogshape.cli.console import columns
from dogshape.pipeline.reports.kit.text import in_ms, ms_with_error
from dogshape.pipeline.reports.shift.story import event_facts, load_facts, phase_title
from dogshape.sim.shift.conclusion import Engagement
from dogshape.sim.statistics.expectation import Expectation
from dogshape.sim.units import RPM

#: What each engine is called where people read.
ENGINES = {"drake": "Drake", "planar": "the compiled engine"}


def shift_table(result: Engagement, torque_peak: float | None) -> RenderableType:
    """Return outcome, phases, events and loads of one shift; ``torque_peak`` in N m."""
    table = columns("phase", "start, ms", "end, ms", "length, ms")
    for phase in result.phases:
        length = phase.end - phase.start
        table.add_row(phase_title(phase.name), in_ms(phase.start), in_ms(phase.end), in_ms(length))
    outcome = result.outcome.value.replace("_", " ")
    time = f" in {in_ms(result.shift_time)} ms" if result.shift_time is not None else ""
    happened = "; ".join(event_facts(result))
    loads = "\n".join(load_facts(result, torque_peak))
    engine = simulated_by(result.clutch.solver.engine)
    return Group(f"{outcome}{time}: {result.detail}", table, happened, loads, engine)


def simulated_by(engine: str) -> str:
    """Name the engine in a sentence."""
    return f"simulated by {ENGINES[engine]}"


def expectation_table(result: Expectation, engine: str = "drake") -> RenderableType:
    """Return the expected shift time of each operating point and over all."""
    heads = "mismatch, 1/min", "force, N", "mean, ms", "s.e., ms", "sd, ms", "engaged", "n"
    table = columns(*heads)
    for p in result.points:
        mean, error = _mean_and_error(p.mean, p.standard_error) if p.engages else ("-", "-")
        table.add_row(
            f"{p.point.mismatch / RPM:.4g}",
            f"{p.point.profile.force:.1f}",
            mean,
            error,
            in_ms(p.sd),
            f"{p.engaged:.0%}",
            str(p.n),
        )
    if not result.engages:
        return Group(result.engaged_words, table, _lost(result), simulated_by(engine))
    mean, error = _mean_and_error(result.mean, result.standard_error)
    total = f"expected shift time {mean} +- {error} ms (one standard error)"
    if math.isnan(result.standard_error):
        total = f"expected shift time {mean} ms (of too few shifts to say by how much it errs)"
    if result.numerical_error is not None and not math.isnan(result.numerical_error):
        total += f", numerical error {result.numerical_error * 1e3:.2g} ms"
    total += f"\n{simulated_by(engine)}"
    if result.lost:
        total += f"\n{_lost(result)}"
    return Group(table, total)


def _mean_and_error(mean: float, error: float) -> tuple[str, str]:
    """Print a time and its error, s, in ms, to a hundredth where the error asks."""
    if math.isnan(mean) or math.isnan(error):
        return in_ms(mean), in_ms(error)
    shown, off = ms_with_error(mean, error).split(" ± ")
    return shown, off


def _lost(result: Expectation) -> str:
    """Count the shifts that did not engage, and give the mean with their retries."""
    text = f"{result.lost} of {result.shifts} shifts did not engage"
    if result.blocked:
        text += f", {result.blocked} held dog on dog by friction"
    if result.mean_engaged is not None:
        text += f"; without their retries the mean is {in_ms(result.mean_engaged)} ms"
    return text


def drawn_text(facts: Mapping[str, str]) -> str:
    """Write the expected shift time over draws, a line for each fact."""
    return "\n".join(f"{name}: {value}" for name, value in facts.items())
