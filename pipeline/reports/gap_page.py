"""Report of a diagnosis as a page, with its record and its table of operating points."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import plotly.graph_objects as go
from markupsafe import Markup

from dogshape.bench.bench_data import Bench
from dogshape.diagnosis.diagnosis import Diagnosis
from dogshape.diagnosis.inference.outcome import MIN_INFORMATION_NATS
from dogshape.diagnosis.report.wording import (
    RECORD_MEANINGS,
    chance,
    describe_parameter,
    headline_of,
    ms,
    summary,
)
from dogshape.diagnosis.terms import NONE, hypothesis_name
from dogshape.pipeline.diagnose.consequence import Consequence
from dogshape.pipeline.record import Table, frame_of, key, number_or_none
from dogshape.pipeline.reports.charts import TimeMark, times_by_point
from dogshape.pipeline.reports.report import Report
from dogshape.pipeline.reports.text import ENGINES, axis, bind_units, place_name
from dogshape.pipeline.store.result_records import PlaceRow
from dogshape.sim.files import without_formulas, write_whole
from dogshape.sim.units import RPM
from dogshape.sim.versions import engine

REPORT = "report.html"
RECORD = "gap.json"
TABLE = "cells.csv"
MAX_ROWS = 8  #: tests, and hypotheses, in a table
MIN_PROBABILITY = 0.005  #: of a hypothesis, or an effect, in a table


class CellRow(PlaceRow):
    """One operating point of a diagnosis; null for a missing value."""

    shifts: int = key("shifts that have a time")
    engaged: int = key("shifts that engaged")
    failed: int = key("shifts that did not")
    unknown: int = key("shifts of which that is not known")
    bench_s: float | None = key("mean on the bench", "s")
    bench_error_s: float | None = key("its standard error, from the predicted spread", "s")
    simulated_s: float | None = key("simulation without any effect", "s")
    simulated_error_s: float | None = key("its standard error", "s")
    gap_s: float | None = key("bench less simulation", "s")
    error_s: float | None = key("its standard error", "s")
    z: float | None = key("gap over its standard error", "1")
    predicted_s: float | None = key("leading hypothesis, fitted to all other points", "s")
    predicted_error_s: float | None = key("its standard error", "s")


def cells_of(diagnosis: Diagnosis) -> list[CellRow]:
    """List the operating points of a diagnosis, in the order of its data set."""
    leading_prediction = diagnosis.fits[diagnosis.leading].predicted
    spread = np.sqrt((leading_prediction.sd**2).mean(axis=0))
    simulation_errors = diagnosis.fits[NONE].predicted.error.mean(axis=0)
    return [
        _cell_row(diagnosis, k, spread[k], simulation_errors[k]) for k in range(len(diagnosis.gaps))
    ]


def _cell_row(diagnosis: Diagnosis, k: int, spread: float, simulation_error: float) -> CellRow:
    """Describe the k-th operating point; ``spread`` of shifts and ``simulation_error`` in s."""
    gap = diagnosis.gaps[k]
    cell = gap.cell
    predicted = None
    predicted_error = None
    if diagnosis.leading != NONE:
        predicted = number_or_none(diagnosis.held_out.mean[k])
        predicted_error = number_or_none(diagnosis.held_out.sd[k])
    return CellRow(
        mismatch_rpm=cell.point.mismatch / RPM,
        force_N=cell.point.profile.force,
        shifts=cell.n,
        engaged=cell.engaged,
        failed=cell.failed,
        unknown=cell.unknown,
        bench_s=cell.time,
        bench_error_s=number_or_none(spread / cell.n**0.5) if cell.n else None,
        simulated_s=gap.mean,
        simulated_error_s=None if gap.mean is None else number_or_none(simulation_error),
        gap_s=gap.gap,
        error_s=None if gap.gap is None else number_or_none(gap.standard_error),
        z=number_or_none(gap.z),
        predicted_s=predicted,
        predicted_error_s=predicted_error,
    )


def cells_figure(cells: Sequence[CellRow]) -> go.Figure:
    """Draw mean times of the bench, without effects and of the leading hypothesis, by point."""
    without_effects = [TimeMark(cell, cell.simulated_s, cell.simulated_error_s) for cell in cells]
    leading = [TimeMark(cell, cell.predicted_s, cell.predicted_error_s) for cell in cells]
    bench = [TimeMark(cell, cell.bench_s, cell.bench_error_s) for cell in cells]
    return times_by_point(
        {
            "without effects": without_effects,
            "leading hypothesis, point held out": leading,
            "bench": bench,
        }
    )


def publish(
    diagnosis: Diagnosis,
    folder: Path,
    consequence: Consequence | None = None,
    history: Mapping[str, str] | None = None,
) -> Path:
    """Write ``report.html``, ``gap.json`` and ``cells.csv`` into a folder; return the first.

    A missing folder is created, files of these names are replaced.
    """
    folder.mkdir(parents=True, exist_ok=True)
    compose_page(diagnosis, consequence, history).save(folder / REPORT)
    record = json.dumps(diagnosis.to_dict(), indent=1, allow_nan=False)
    write_whole(folder / RECORD, f"{record}\n")
    cells = frame_of(cells_of(diagnosis))
    write_whole(folder / TABLE, without_formulas(cells).to_csv(index=False))
    return folder / REPORT


def compose_page(
    diagnosis: Diagnosis,
    consequence: Consequence | None = None,
    history: Mapping[str, str] | None = None,
) -> Report:
    """Compose the page of a diagnosis.

    ``consequence`` is the effect of the cause on the choice between designs, ``history`` has
    sentences on updates, by name.
    """
    title = f"{diagnosis.bench.name}: difference between bench and simulation"
    page = Report(title, headline_of(diagnosis.verdict, diagnosis.effects))
    page.add("", Markup("<p>{}</p>").format(bind_units(summary(diagnosis))))
    page.add("Hypotheses", hypothesis_table(diagnosis), inclusion_table(diagnosis))
    page.add("Next test", advice_table(diagnosis))
    figure = cells_figure(cells_of(diagnosis))
    caption = "Mean shift times with 95 % intervals."
    page.add("Residuals", residual_table(diagnosis), figure, caption)
    if consequence is not None:
        page.add("Design choice", choice_table(consequence), consequence.sentence)
    facts = _facts(diagnosis) | dict(history or {})
    page.add("Data and settings", _meaning_table(diagnosis), Table(("", ""), list(facts.items())))
    return page


def _meaning_table(diagnosis: Diagnosis) -> Table:
    """Tabulate the meanings of ambiguous records with probability and headline."""
    rows = []
    for meaning in diagnosis.record_meanings:
        condition = RECORD_MEANINGS[meaning.key, meaning.value]
        headline = headline_of(meaning.verdict, diagnosis.effects)
        rows.append((condition, chance(meaning.probability), headline))
    return Table(("if", "probability", "answer"), rows, {}, (2,))


def hypothesis_table(diagnosis: Diagnosis) -> Table:
    """Tabulate the most probable hypotheses with probability, sizes and p-value."""
    credible = diagnosis.verdict.credible
    probable = [h for h, p in diagnosis.posterior.items() if p >= MIN_PROBABILITY or h in credible]
    rows = []
    for hypothesis in dict.fromkeys([*probable[:MAX_ROWS], diagnosis.leading]):
        sizes = ""
        p_value = ""
        fit = diagnosis.fits.get(hypothesis)
        if fit:
            lines = [describe_parameter(*interval) for interval in fit.intervals.items()]
            sizes = "\n".join(lines)
            p_value = "< 0.001" if fit.p < 0.001 else f"{fit.p:.2g}"
        probability = chance(diagnosis.posterior.get(hypothesis, 0.0))
        name = hypothesis_name(hypothesis, diagnosis.effects)
        rows.append((name, probability, sizes, p_value))
    looks = {0: "best"} if diagnosis.verdict.kind == "effect" else {}
    note = (
        "p: probability of data as far from the hypothesis as these, if the hypothesis is true. An "
        "effect too weak to be seen counts as absent."
    )
    heads = "hypothesis", "probability", "sizes (90 % interval)", "p"
    return Table(heads, rows, looks, (2,), note)


def inclusion_table(diagnosis: Diagnosis) -> Table:
    """Tabulate the probability that an effect is part of the cause; causes are marked."""
    causes = diagnosis.verdict.causes
    rows = list[Sequence[str]]()
    looks = {}
    for name, probability in diagnosis.inclusion.items():
        if probability < MIN_PROBABILITY and name not in causes:
            continue
        if name in causes:
            looks[len(rows)] = "best"
        error = chance(diagnosis.inclusion_error[name])
        rows.append((diagnosis.effects[name].plain, chance(probability), error))
    note = (
        "Sum over hypotheses with the effect. Error: one standard error by finite numbers of draws "
        "and of simulated benches."
    )
    return Table(("effect", "probability", "error"), rows, looks, (), note)


def residual_table(diagnosis: Diagnosis) -> Table:
    """Tabulate root-mean-square gaps, ms: without effects, at held-out points, by chance."""
    gaps = diagnosis.held_out
    rows = [("no effect", ms(gaps.baseline))]
    if diagnosis.leading != NONE:
        name = hypothesis_name(diagnosis.leading, diagnosis.effects)
        rows.append((f"{name}, at held-out points", ms(gaps.held_out)))
    if gaps.rival is not None and gaps.rival_held_out is not None:
        name = hypothesis_name(gaps.rival, diagnosis.effects)
        rows.append((f"best rival, {name}, at held-out points", ms(gaps.rival_held_out)))
    rows.append(("chance alone", ms(gaps.chance)))
    note = (
        "Held out: each point is predicted by a fit to all other points. Chance alone: scatter of "
        "the shifts and errors of the simulation."
    )
    return Table(("", "root-mean-square gap"), rows, note=note)


def advice_table(diagnosis: Diagnosis) -> Table:
    """Tabulate the advised tests with gain, hours, information and the refuting result."""
    rows = []
    note = ""
    for index, test in enumerate(diagnosis.tests[:MAX_ROWS]):
        gain = chance(test.gain)
        if test.information < MIN_INFORMATION_NATS:
            if index > 0:
                continue
            gain = "-"
            note = "Dash: the outcome would not change the probabilities."
        rows.append((test.name, gain, f"{test.hours:.2g}", f"{test.information:.2f}", test.refutes))
    heads = "test", "gain", "work, h", "information, nats", "refuting result"
    return Table(heads, rows, {0: "best"}, (), note)


def choice_table(consequence: Consequence) -> Table:
    """Tabulate the designs chosen without and with the cause, and the cost of ignoring it."""
    chosen = consequence.chosen
    best = consequence.best
    rows = []
    for name in {**chosen.params, **best.params}:
        values = [
            f"{design.params[name]:.4g}" if name in design.params else ""
            for design in (chosen, best)
        ]
        rows.append([axis(name), *values])
    without_cause = [ms(chosen.without.mean), ms(best.without.mean)]
    with_cause = [ms(chosen.with_effect.mean), ms(best.with_effect.mean)]
    rows += [
        ["expected shift time without the cause", *without_cause],
        ["expected shift time with the cause", *with_cause],
        ["cost of ignoring the cause", ms(consequence.regret), ""],
    ]
    heads = "", "chosen without the cause", "best with the cause"
    return Table(heads, rows, {len(rows) - 1: "best"})


def _facts(diagnosis: Diagnosis) -> dict[str, str]:
    """List the facts on data set, record and run by name; empty ones are left out."""
    bench = diagnosis.bench
    record = diagnosis.to_dict()["record"]
    shifts = sum(cell.n for cell in bench.cells)
    untimed = sum(not cell.n for cell in bench.cells) or "none"
    failures = [
        f"{cell.failed} of {cell.failed + cell.engaged} at {place_name(cell)}"
        for cell in cells_of(diagnosis)
        if cell.failed
    ]
    facts = {
        "data set": f"{bench.name}; {bench.source}",
        "operating points": f"{len(bench.cells)}, {untimed} untimed; {shifts} timed shifts",
        "shifts that did not engage": "; ".join(failures) or "none",
        "record": "; ".join(f"{k}: {v}".replace("_", " ") for k, v in record.items()),
        "corrections": ", ".join(bench.corrections),
        "suspicious values": "; ".join(
            f"{finding.found}; this looks like {finding.looks_like}" for finding in bench.warnings
        ),
        "readings at rest and direct tests": "; ".join(fact.sentence for fact in diagnosis.facts),
        "effects considered": ", ".join(effect.plain for effect in diagnosis.effects.values()),
        "negligible": f"a gap below {ms(diagnosis.margin_s)}",
        "simulated by": ENGINES[bench.clutch.solver.engine],
        "versions": ", ".join(f"{name} {version}" for name, version in engine().items()),
    }
    return {name: words for name, words in facts.items() if words}


def examined_lines(bench: Bench) -> list[str]:
    """List the corrections and suspicious values of a data set, a line each."""
    lines = [f"warning: {finding.sentence}" for finding in bench.warnings]
    if bench.corrections:
        lines.insert(0, f"corrected as asked: {', '.join(bench.corrections)}")
    return lines
