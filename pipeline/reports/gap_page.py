"""Report of a diagnosis as a page, with its record and its table of operating points."""

from __future__ import annotations

import json
import textwrap
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import plotly.graph_objects as go
from markupsafe import Markup

from dogshape.bench.bench_data import Bench
from dogshape.diagnosis.comparison import PointGap
from dogshape.diagnosis.diagnosis import Inference, list_tests
from dogshape.diagnosis.gap_map import GapMap, MapCell, describe_gaps, map_gaps
from dogshape.diagnosis.inference.outcome import MIN_INFORMATION_NATS
from dogshape.diagnosis.report.wording import (
    MIN_STATED_PROBABILITY,
    RECORD_MEANINGS,
    answered_meanings,
    cause_sentence,
    chance,
    describe_parameter,
    excess_lines,
    headline,
    headline_of,
    listed_effects,
    ms,
    remarks,
    shrink_sentence,
    size_lines,
)
from dogshape.diagnosis.terms import NONE, UNKNOWN, hypothesis_name
from dogshape.pipeline.diagnose.consequence import Consequence
from dogshape.pipeline.record import Table, frame_of, number_or_none
from dogshape.pipeline.reports.charts import TimeMark, times_by_point
from dogshape.pipeline.reports.gap_charts import effects_picture, map_picture, steps_picture
from dogshape.pipeline.reports.report import Report, title_table, title_values
from dogshape.pipeline.reports.text import ENGINES, axis, bind_units, minus, place_name
from dogshape.pipeline.store.result_records import PlaceRow
from dogshape.sim.clutch_tables import key
from dogshape.sim.files import without_formulas, write_whole
from dogshape.sim.units import RPM
from dogshape.sim.versions import program_versions

REPORT = "report.html"
RECORD = "gap.json"
TABLE = "cells.csv"
MAP_COLUMNS = 8  #: groups of mismatch in a map, at most
MAP_ROWS = 6  #: groups of force in a map, at most
TITLE_WIDTH = 32  #: characters of an effect in a line of a table
COLUMN_GAP = 2  #: characters between columns of a table


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


def cells_of(diagnosis: Inference) -> list[CellRow]:
    """List the operating points of a diagnosis, in the order of its data set."""
    leading_prediction = diagnosis.fits[diagnosis.leading].predicted
    spread = np.sqrt((leading_prediction.sd**2).mean(axis=0))
    simulation_errors = diagnosis.fits[NONE].predicted.error.mean(axis=0)
    return [
        _cell_row(diagnosis, k, spread[k], simulation_errors[k]) for k in range(len(diagnosis.gaps))
    ]


def _cell_row(diagnosis: Inference, k: int, spread: float, simulation_error: float) -> CellRow:
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
    without_effects = [
        TimeMark.of(cell, cell.simulated_s, cell.simulated_error_s) for cell in cells
    ]
    leading = [TimeMark.of(cell, cell.predicted_s, cell.predicted_error_s) for cell in cells]
    bench = [TimeMark.of(cell, cell.bench_s, cell.bench_error_s) for cell in cells]
    return times_by_point(
        {
            "without effects": without_effects,
            "leading hypothesis, point held out": leading,
            "bench": bench,
        }
    )


def publish(
    diagnosis: Inference,
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
    diagnosis: Inference,
    consequence: Consequence | None,
    history: Mapping[str, str] | None = None,
    *,
    block: Mapping[str, str] | None = None,
) -> Report:
    """Compose the page of a diagnosis.

    ``consequence`` is the effect of the cause on the choice between designs, ``history`` has
    sentences on updates, by name, ``block`` values of the title block.
    """
    title = f"{diagnosis.bench.name}: difference between bench and simulation"
    page = Report(title, headline(diagnosis))
    page.add("", _pictures(diagnosis))
    page.add("Effects", effect_table(diagnosis), *remarks(diagnosis))
    page.add("Next test", advice_table(diagnosis), diagnosis.tests[0].why)
    page.add("Hypotheses", hypothesis_table(diagnosis))
    page.add("Residuals", residual_table(diagnosis), *_held_out_parts(diagnosis))
    if consequence is not None:
        page.add("Design choice", choice_table(consequence), consequence.sentence)
    facts = _facts(diagnosis) | dict(history or {})
    fact_table = Table(("", ""), list(facts.items()))
    block_table = title_table(title_values(block or {}))
    page.add("Data and settings", block_table, _meaning_table(diagnosis), fact_table)
    return page


def _pictures(diagnosis: Inference) -> Markup:
    """Draw where the gap is, which effects explain it and how far it closes, a sentence each."""
    gap_map = map_gaps(diagnosis.gaps, MAP_COLUMNS, MAP_ROWS)
    pictures = [
        ("Where", map_picture(gap_map), diagnosis.where),
        ("Which", effects_picture(diagnosis), cause_sentence(diagnosis)),
        ("How far", steps_picture(diagnosis), shrink_sentence(diagnosis)),
    ]
    figures = [
        Markup("<figure><h3>{}</h3>{}<figcaption>{}</figcaption></figure>").format(
            name, picture, bind_units(sentence)
        )
        for name, picture, sentence in pictures
    ]
    return Markup('<div class="pictures">{}</div>').format(Markup("\n").join(figures))


def _held_out_parts(diagnosis: Inference) -> list[Markup | str]:
    """Draw the gap that the leading hypothesis leaves at held-out points; nothing for *none*."""
    if diagnosis.leading == NONE:
        return []
    gaps = [
        PointGap(cell, number_or_none(mean), error)
        for cell, mean, error in zip(
            diagnosis.bench.cells,
            diagnosis.held_out.mean.tolist(),
            diagnosis.held_out.sd.tolist(),
            strict=True,
        )
    ]
    picture = map_picture(map_gaps(gaps, MAP_COLUMNS, MAP_ROWS))
    name = hypothesis_name(diagnosis.leading, diagnosis.effects)
    caption = f"Held-out points with {name}: {describe_gaps(gaps)}"
    return [Markup('<div class="pictures">{}</div>').format(picture), caption]


def _meaning_table(diagnosis: Inference) -> Table:
    """Tabulate the meanings of ambiguous records that the data decide or that decide the answer."""
    rows = []
    for meaning in answered_meanings(diagnosis):
        condition = RECORD_MEANINGS[meaning.key, meaning.value]
        answer = headline_of(meaning.verdict, diagnosis.effects)
        rows.append((condition, chance(meaning.probability), answer))
    return Table(("if", "probability", "answer"), rows, {}, (2,))


def map_table(diagnosis: Inference, width: int) -> Table:
    """Tabulate the gap in ms, and its standard errors, over force and mismatch.

    Neighbouring mismatches join until the table has at most ``width`` characters.
    """
    tables = [
        _map_table(map_gaps(diagnosis.gaps, columns, MAP_ROWS))
        for columns in range(MAP_COLUMNS, 0, -1)
    ]
    return next((table for table in tables if _text_width(table) <= width), tables[-1])


def _map_table(gap_map: GapMap) -> Table:
    """Tabulate a map of gaps."""
    rows = []
    for i, force in enumerate(gap_map.forces):
        cells = [gap_map.cells.get((i, j)) for j in range(len(gap_map.mismatches))]
        texts = ["-" if cell is None else _gap_text(cell) for cell in cells]
        rows.append([force.label, *texts])
    heads = ["N \\ 1/min", *(mismatch.label for mismatch in gap_map.mismatches)]
    return Table(heads, rows)


def _gap_text(cell: MapCell) -> str:
    """Write a gap in ms with its standard errors in brackets."""
    return minus(f"{1e3 * cell.gap:z.0f} ({abs(cell.z):.0f})")


def _text_width(table: Table) -> int:
    """Count the characters of a line of a table."""
    columns = zip(table.heads, *table.rows, strict=True)
    return sum(max(map(len, column)) + COLUMN_GAP for column in columns) - COLUMN_GAP


def effect_table(diagnosis: Inference) -> Table:
    """Tabulate the plausible effects: probability to be part of the cause, sizes; causes marked."""
    causes = diagnosis.verdict.causes
    rows = list[Sequence[str]]()
    looks = {}
    for name in listed_effects(diagnosis):
        if name in causes:
            looks[len(rows)] = "best"
        error = 100.0 * diagnosis.inclusion_error[name]
        inclusion = f"{chance(diagnosis.inclusion[name])} ± {max(1.0, error):.0f}"
        sizes = "\n".join(size_lines(diagnosis, name))
        excess = "\n".join(excess_lines(diagnosis, name))
        title = "\n".join(textwrap.wrap(diagnosis.effects[name].plain, TITLE_WIDTH))
        rows.append((title, inclusion, sizes, excess))
    for hypothesis in (NONE, UNKNOWN):
        probability = diagnosis.posterior.get(hypothesis, 0.0)
        if probability > MIN_STATED_PROBABILITY:
            name = hypothesis_name(hypothesis, diagnosis.effects)
            rows.append((name, chance(probability), "", ""))
    note = (
        "Probability that the effect is part of the cause, ± its standard error by finite numbers "
        "of draws and of simulated benches. A size too small for these data to show counts as "
        "absent. Range end: the data want a size beyond the last one of the list."
    )
    heads = "effect", "probability", "size (90 % interval)", "beyond ordinary"
    return Table(heads, rows, looks, (2, 3), note)


def hypothesis_table(diagnosis: Inference) -> Table:
    """Tabulate the plausible sets of effects with probability, sizes and p-value."""
    plausible = [h for h, p in diagnosis.posterior.items() if p > MIN_STATED_PROBABILITY]
    rows = []
    for hypothesis in dict.fromkeys([*plausible, diagnosis.leading]):
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
        "p: probability of data as far from the hypothesis as these, if the hypothesis is true. A "
        "wrong hypothesis may have a large p."
    )
    heads = "hypothesis", "probability", "sizes (90 % interval)", "p"
    return Table(heads, rows, looks, (2,), note)


def residual_table(diagnosis: Inference) -> Table:
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


def advice_table(diagnosis: Inference) -> Table:
    """Tabulate the advised tests with gain, hours, information and the refuting result."""
    rows = []
    note = ""
    for index, test in enumerate(list_tests(diagnosis.tests, diagnosis.leading)):
        gain = chance(test.gain)
        if test.information < MIN_INFORMATION_NATS:
            if index > 0 and not {*diagnosis.leading}.intersection(test.effects):
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


def _facts(diagnosis: Inference) -> dict[str, str]:
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
        "versions": ", ".join(f"{name} {version}" for name, version in program_versions().items()),
    }
    return {name: words for name, words in facts.items() if words}


def examined_lines(bench: Bench) -> list[str]:
    """List the corrections and suspicious values of a data set, a line each."""
    lines = [f"warning: {finding.sentence}" for finding in bench.warnings]
    if bench.corrections:
        lines.insert(0, f"corrected as asked: {', '.join(bench.corrections)}")
    return lines
