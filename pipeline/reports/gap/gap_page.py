"""Report of a diagnosis as a page, with its record and its table of operating points."""

from __future__ import annotations

import json
from pathlib import Path
from urllib.parse import quote

from dogshape.diagnosis.diagnosis import Diagnosis
from dogshape.diagnosis.inference.next_test import NextTest
from dogshape.diagnosis.report.wording import (
    chance,
    described,
    headline_of,
    ms,
    reading_name,
    summary,
)
from dogshape.diagnosis.terms import NONE, Hypothesis, plain
from dogshape.pipeline.diagnose.consequence import Consequence, Extras
from dogshape.pipeline.reports.gap import gap_figures as figures
from dogshape.pipeline.reports.gap.before_after import before_figure
from dogshape.pipeline.reports.gap.point_rows import CellRow, cells_of, table, unreadable
from dogshape.pipeline.reports.kit import html
from dogshape.pipeline.reports.kit.look import Row
from dogshape.pipeline.reports.kit.text import axis, value
from dogshape.sim.files import naming

REPORT, RECORD, TABLE = "report.html", "gap.json", "cells.csv"
TESTS, MOST = 8, 8  #: tests, and hypotheses, in a table
LEAST = 0.005  #: probability from which a hypothesis is in the table


def publish(found: Diagnosis, folder: Path, extras: Extras | None = None) -> Path:
    """Write ``report.html``, ``gap.json`` and ``cells.csv`` into a folder; return the report.

    The folder is made where it is missing; files of these names are replaced.
    """
    folder.mkdir(parents=True, exist_ok=True)
    write_page(found, folder / REPORT, extras)
    for name, text in ((RECORD, record_text(found) + "\n"), (TABLE, table(cells_of(found)))):
        with naming(folder / name):
            (folder / name).write_text(text, encoding="utf-8")
    return folder / REPORT


def write_page(found: Diagnosis, path: Path, extras: Extras | None = None) -> None:
    """Write the report alone, one HTML file that opens offline."""
    html.write_page(path, "gap.html.j2", **content_of(found, extras or Extras()))


def record_text(found: Diagnosis) -> str:
    """Write the record of a diagnosis as JSON."""
    return json.dumps(found.to_dict(), indent=1, allow_nan=False)


def content_of(found: Diagnosis, extras: Extras) -> Row:
    """Collect the content of the template."""
    points = cells_of(found)
    return {
        "bench": found.bench,
        "headline": headline_of(found.verdict, found.effects),
        "summary": summary(found),
        "kind": found.verdict.kind,
        "without": sorted({unreadable(point) for point in points} - {""}),
        "part_engaged": any(point.failed and point.engaged for point in points),
        "hypotheses": [hypothesis_row(found, h) for h in shown_hypotheses(found)],
        "gaps": gap_rows(found),
        "tests": [(test.name, *_worth(test), f"{test.hours:.2g}") for test in found.tests[:TESTS]],
        "choice": None if extras.consequence is None else _choice(extras.consequence),
        "readings": [
            (reading_name(one), chance(one.probability), headline_of(one.verdict, found.effects))
            for one in found.readings
        ],
        "facts": _facts(found, extras),
        "json_link": "data:application/json," + quote(record_text(found)),
        "csv_link": html.csv_link(table(points)),
        **_figures(found, points, extras),
    }


def _worth(test: NextTest) -> tuple[str, str, str]:
    """Print the chances to settle and to mislead and the information, empty where unknown."""
    if test.information is None:
        return "", "", ""
    return chance(test.settles), chance(test.misleads), f"{test.information:.2f}"


def _figures(found: Diagnosis, points: list[CellRow], extras: Extras) -> Row:
    """Draw all figures as HTML, an empty word where there is nothing to draw."""
    drawn = {
        "map": figures.gap_map_figure(points),
        "inclusion": figures.inclusion_figure(found) if any(found.inclusion.values()) else None,
        "before": before_figure(points),
        "phases": figures.phases_figure(extras.phases) if extras.phases else None,
    }
    return {
        f"{key}_figure": "" if figure is None else html.figure_html(figure, key)
        for key, figure in drawn.items()
    }


def shown_hypotheses(found: Diagnosis) -> list[Hypothesis]:
    """Select the hypotheses of a table, most probable first, and the nearest known one."""
    worth = [h for h, p in found.posterior.items() if p >= LEAST or h in found.verdict.credible]
    return list(dict.fromkeys([*worth[:MOST], found.leading]))


def hypothesis_row(found: Diagnosis, hypothesis: Hypothesis) -> Row:
    """Tabulate a hypothesis: name, probability, sizes, and p-value, empty where unknown."""
    fit = found.fits.get(hypothesis)
    parameters = fit.space.parameters if fit else ()
    p = fit.p if fit else None
    return {
        "name": plain(hypothesis, found.effects),
        "probability": chance(found.posterior.get(hypothesis, 0.0)),
        "sizes": [described(p.name, fit.interval(p.name)) for p in parameters] if fit else [],
        "p": "" if p is None else "< 0.001" if p < 0.001 else f"{p:.2g}",
    }


def gap_rows(found: Diagnosis) -> list[tuple[str, str]]:
    """Tabulate root-mean-square gaps: without effects, at held-out points, by chance, of a rival.

    Each row has a name and a time in ms.
    """
    gaps = found.held_out
    rows: list[tuple[str, float | None]] = [("no effect", gaps.baseline)]
    if found.leading != NONE:
        name = plain(found.leading, found.effects)
        rows.append((f"{name}, at held-out points", gaps.held_out))
    if gaps.rival is not None:
        name = plain(gaps.rival, found.effects)
        rows.append((f"best rival, {name}, at held-out points", gaps.rival_held_out))
    rows.append(("chance alone", gaps.chance))
    return [(name, ms(time)) for name, time in rows if time is not None]


def _choice(found: Consequence) -> Row:
    sides = found.chosen, found.best

    def shown(key: str, design: Row) -> str:
        return value(key, design[key]).split()[0] if key in design else ""

    keys = dict.fromkeys([*sides[0].params, *sides[1].params])
    rows = [(axis(key), [shown(key, dict(one.params)) for one in sides]) for key in keys]
    for words, name in (("without the cause", "without"), ("with the cause", "with_effect")):
        times = [ms(getattr(side, name).mean) for side in sides]
        rows.append((f"expected shift time {words}", times))
    return {"rows": rows, "regret": ms(found.regret), "sentence": found.sentence}


def _facts(found: Diagnosis, extras: Extras) -> dict[str, str]:
    """List the facts on data set, record and run."""
    bench = found.bench
    shifts = sum(cell.n for cell in bench.cells)
    record = found.to_dict()["record"]
    given = {
        "data set": bench.name,
        "source": bench.source,
        "operating points": f"{len(bench.cells)}, with {shifts} timed shifts",
        "record": "; ".join(f"{k}: {v}".replace("_", " ") for k, v in record.items()),
        "corrections": ", ".join(f"{c.quantity}={c.way}" for c in bench.corrections),
        "suspicious values": "; ".join(
            f"{one.found}; this looks like {one.looks_like}" for one in bench.warnings
        ),
        "readings at rest and direct tests": "; ".join(fact.sentence for fact in found.facts),
        "effects considered": ", ".join(
            f"{effect.plain} ({name})" for name, effect in found.effects.items()
        ),
        "margin": ms(found.margin_s),
        "Monte Carlo error": f"{found.noise:.2g} of the leading probability",
        **extras.provenance,
    }
    return {key: words for key, words in given.items() if words}
