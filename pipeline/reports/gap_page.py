"""Report of a diagnosis as a page, with its record and its table of operating points."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import plotly.graph_objects as go
from markupsafe import Markup

from dogshape.diagnosis.bench.bench_data import Bench
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
from dogshape.pipeline.reports.charts import times_by_point
from dogshape.pipeline.reports.report import Report
from dogshape.pipeline.reports.text import ENGINES, axis, bind_units, place_name
from dogshape.pipeline.store.result_records import PlaceRow
from dogshape.sim.files import without_formulas, write_whole
from dogshape.sim.units import RPM
from dogshape.sim.versions import engine

REPORT, RECORD, TABLE = "report.html", "gap.json", "cells.csv"
MAX_ROWS = 8  #: tests, and hypotheses, in a table
MIN_PROBABILITY = 0.005  #: from which a hypothesis, or an effect, is in a table


class CellRow(PlaceRow):
    """One operating point of a diagnosis; null where there is none."""

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


def cells_of(found: Diagnosis) -> list[CellRow]:
    """List the operating points of a diagnosis, in the order of its data set."""
    held_out, nearest = found.held_out, found.fits[found.leading].predicted
    spread = np.sqrt((nearest.sd**2).mean(axis=0))
    errors, named = found.fits[NONE].predicted.error.mean(axis=0), found.leading != NONE
    return [
        CellRow(
            mismatch_rpm=cell.point.mismatch / RPM,
            force_N=cell.point.profile.force,
            shifts=cell.n,
            engaged=cell.engaged,
            failed=cell.failed,
            unknown=cell.unknown,
            bench_s=cell.time,
            simulated_s=point.mean,
            gap_s=point.gap,
            bench_error_s=number_or_none(spread[k] / cell.n**0.5) if cell.n else None,
            simulated_error_s=None if point.mean is None else number_or_none(errors[k]),
            error_s=None if point.gap is None else number_or_none(point.standard_error),
            z=number_or_none(point.z),
            predicted_s=number_or_none(held_out.mean[k]) if named else None,
            predicted_error_s=number_or_none(held_out.sd[k]) if named else None,
        )
        for k, (point, cell) in enumerate((one, one.cell) for one in found.gaps)
    ]


def cells_figure(cells: Sequence[CellRow]) -> go.Figure:
    """Draw bench times beside those without effects and of the leading hypothesis."""
    sides = {
        "without effects": ("simulated_s", "simulated_error_s"),
        "leading hypothesis, point held out": ("predicted_s", "predicted_error_s"),
        "bench": ("bench_s", "bench_error_s"),
    }
    return times_by_point([cell.to_dict() for cell in cells], sides)


def publish(
    found: Diagnosis,
    folder: Path,
    consequence: Consequence | None = None,
    history: Mapping[str, str] | None = None,
) -> Path:
    """Write ``report.html``, ``gap.json`` and ``cells.csv`` into a folder; return the report.

    The folder is made where it is missing; files of these names are replaced. ``consequence`` is
    that of the cause for the designs of a study, ``history`` has sentences on updates, by name.
    """
    folder.mkdir(parents=True, exist_ok=True)
    title = f"{found.bench.name}: difference between bench and simulation"
    page = Report(title, headline_of(found.verdict, found.effects))
    page.add("", Markup("<p>{}</p>").format(bind_units(summary(found))))
    page.add("Hypotheses", hypothesis_table(found), inclusion_table(found))
    page.add("Next test", advice_table(found))
    page.add(
        "Residuals",
        residual_table(found),
        cells_figure(cells_of(found)),
        "Mean shift times with 95 % intervals.",
    )
    if consequence is not None:
        page.add("Design choice", choice_table(consequence), consequence.sentence)
    readings = [
        (
            RECORD_MEANINGS[one.key, one.value],
            chance(one.probability),
            headline_of(one.verdict, found.effects),
        )
        for one in found.record_meanings
    ]
    page.add(
        "Data and settings",
        Table(("if", "probability", "answer"), readings, {}, (2,)) if readings else None,
        Table(("", ""), list((_facts(found) | dict(history or {})).items())),
    )
    page.save(folder / REPORT)
    write_whole(folder / RECORD, json.dumps(found.to_dict(), indent=1, allow_nan=False) + "\n")
    write_whole(folder / TABLE, without_formulas(frame_of(cells_of(found))).to_csv(index=False))
    return folder / REPORT


def hypothesis_table(found: Diagnosis) -> Table:
    """Tabulate the most probable hypotheses and the nearest known one, with sizes and p-value."""
    credible = found.verdict.credible
    worth = [h for h, p in found.posterior.items() if p >= MIN_PROBABILITY or h in credible]
    rows = []
    for hypothesis in dict.fromkeys([*worth[:MAX_ROWS], found.leading]):
        sizes, p = "", ""
        if fit := found.fits.get(hypothesis):
            sizes = "\n".join(describe_parameter(name, one) for name, one in fit.intervals.items())
            p = "< 0.001" if fit.p < 0.001 else f"{fit.p:.2g}"
        share = chance(found.posterior.get(hypothesis, 0.0))
        rows.append((hypothesis_name(hypothesis, found.effects), share, sizes, p))
    looks = {0: "best"} if found.verdict.kind == "effect" else {}
    note = (
        "p: probability of data as far from the hypothesis as these, if the hypothesis is true. An "
        "effect too weak to be seen counts as absent."
    )
    heads = "hypothesis", "probability", "sizes (90 % interval)", "p"
    return Table(heads, rows, looks, (2,), note)


def inclusion_table(found: Diagnosis) -> Table:
    """Tabulate the probability of each effect to be part of the cause; named ones are marked."""
    named, parts = found.verdict.causes, found.inclusion
    those = [name for name in parts if parts[name] >= MIN_PROBABILITY or name in named]
    rows = [
        (found.effects[name].plain, chance(parts[name]), chance(found.inclusion_error[name]))
        for name in those
    ]
    looks = {k: "best" for k, name in enumerate(those) if name in named}
    note = (
        "Sum over hypotheses with the effect. Error: one standard error by finite numbers of draws "
        "and of simulated benches."
    )
    return Table(("effect", "probability", "error"), rows, looks, (), note)


def residual_table(found: Diagnosis) -> Table:
    """Tabulate root-mean-square gaps: without effects, at held-out points, by chance."""
    gaps, rows = found.held_out, [("no effect", ms(found.held_out.baseline))]
    if found.leading != NONE:
        name = hypothesis_name(found.leading, found.effects)
        rows.append((f"{name}, at held-out points", ms(gaps.held_out)))
    if gaps.rival is not None and gaps.rival_held_out is not None:
        name = hypothesis_name(gaps.rival, found.effects)
        rows.append((f"best rival, {name}, at held-out points", ms(gaps.rival_held_out)))
    rows.append(("chance alone", ms(gaps.chance)))
    note = (
        "Held out: each point is predicted by a fit to all other points. Chance alone: scatter of "
        "the shifts and errors of the simulation."
    )
    return Table(("", "root-mean-square gap"), rows, note=note)


def advice_table(found: Diagnosis) -> Table:
    """Tabulate the advised tests with the chances to settle and to mislead, and their work."""
    some = [
        t
        for k, t in enumerate(found.tests[:MAX_ROWS])
        if not k or t.information >= MIN_INFORMATION_NATS
    ]
    rows = [
        (
            test.name,
            *(chance(one) if test.information >= MIN_INFORMATION_NATS else "-" for one in both),
            f"{test.information:.2f}",
            f"{test.hours:.2g}",
        )
        for test in some
        for both in [(test.settles, test.misleads)]
    ]
    heads = "test", "chance to settle", "to mislead", "information, nats", "work, h"
    note = "Dash: the outcome would not change the probabilities." * any("-" in row for row in rows)
    return Table(heads, rows, {0: "best"}, (), note)


def choice_table(found: Consequence) -> Table:
    """Tabulate the designs chosen without the cause and with it, and the cost of ignoring it."""
    sides = found.chosen, found.best
    rows = [
        [axis(key), *(f"{one.params[key]:.4g}" if key in one.params else "" for one in sides)]
        for key in {**sides[0].params, **sides[1].params}
    ]
    rows += [
        ["expected shift time without the cause", *(ms(one.without.mean) for one in sides)],
        ["expected shift time with the cause", *(ms(one.with_effect.mean) for one in sides)],
        ["cost of ignoring the cause", ms(found.regret), ""],
    ]
    heads = "", "chosen without the cause", "best with the cause"
    return Table(heads, rows, {len(rows) - 1: "best"})


def _facts(found: Diagnosis) -> dict[str, str]:
    """List the facts on data set, record and run."""
    bench, record = found.bench, found.to_dict()["record"]
    shifts, bare = sum(cell.n for cell in bench.cells), sum(not c.n for c in bench.cells)
    lost = [
        f"{one.failed} of {one.failed + one.engaged} at {place_name(one.to_dict())}"
        for one in cells_of(found)
        if one.failed
    ]
    given = {
        "data set": f"{bench.name}; {bench.source}",
        "operating points": f"{len(bench.cells)}, {bare or 'none'} untimed; {shifts} timed shifts",
        "shifts that did not engage": "; ".join(lost) or "none",
        "record": "; ".join(f"{k}: {v}".replace("_", " ") for k, v in record.items()),
        "corrections": ", ".join(bench.corrections),
        "suspicious values": "; ".join(
            f"{one.found}; this looks like {one.looks_like}" for one in bench.warnings
        ),
        "readings at rest and direct tests": "; ".join(fact.sentence for fact in found.facts),
        "effects considered": ", ".join(effect.plain for effect in found.effects.values()),
        "negligible": f"a gap below {ms(found.margin_s)}",
        "simulated by": ENGINES[bench.clutch.solver.engine],
        "versions": ", ".join(f"{name} {version}" for name, version in engine().items()),
    }
    return {key: words for key, words in given.items() if words}


def examined_lines(bench: Bench) -> list[str]:
    """List the corrections and suspicious values of a data set, a line each."""
    made = ", ".join(bench.corrections)
    lines = [f"corrected as asked: {made}"] if made else []
    return lines + [f"warning: {finding.sentence}" for finding in bench.warnings]
