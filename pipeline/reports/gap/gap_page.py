"""The report of a diagnosis with its record and its table; what is not known is empty."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import Any
from urllib.parse import quote

from markupsafe import Markup

from dogshape.diagnosis.diagnosis import Diagnosis
from dogshape.diagnosis.inference.next_test import why
from dogshape.diagnosis.inference.static_readings import readings_in_words
from dogshape.diagnosis.prediction.hypotheses import NONE, UNKNOWN, plain
from dogshape.diagnosis.report.influence_words import influence_in_words, verdict_in_words
from dogshape.diagnosis.report.wording import chance, headline, ms, parts_in_words, quantity
from dogshape.pipeline.diagnose.extras import Extras, SoWhat
from dogshape.pipeline.reports.gap import before_after as before
from dogshape.pipeline.reports.gap import charts, joint_figure, predicted_figure, reasons
from dogshape.pipeline.reports.gap import gap_map_figure as gapmap
from dogshape.pipeline.reports.gap import hypothesis_cards as answers
from dogshape.pipeline.reports.gap import influence_figure as swayed
from dogshape.pipeline.reports.gap import odds_matrix as alike
from dogshape.pipeline.reports.gap import point_rows as cells
from dogshape.pipeline.reports.kit import html
from dogshape.pipeline.reports.kit.look import Row
from dogshape.pipeline.reports.kit.text import axis, label, value
from dogshape.sim.files import naming
from dogshape.sim.units import RPM

REPORT, RECORD, TABLE = "report.html", "gap.json", "cells.csv"
TESTS = 8  #: tests that are listed
READINGS = {
    "priors_halved": "ranges half as wide",
    "priors_doubled": "ranges twice as wide",
    "unknown_as_failed": "unknown shifts read as failed",
}


def publish(diagnosis: Diagnosis, folder: Path, extras: Extras | None = None) -> Path:
    """Write ``report.html``, ``gap.json`` and ``cells.csv`` into a folder; return the report.

    The folder is made where it is missing; files of these names are written anew.
    """
    folder.mkdir(parents=True, exist_ok=True)
    write_page(diagnosis, folder / REPORT, extras)
    written = {
        RECORD: record_text(diagnosis) + "\n",
        TABLE: cells.table(cells.cells_of(diagnosis)),
    }
    for name, text in written.items():
        with naming(folder / name):
            (folder / name).write_text(text, encoding="utf-8")
    return folder / REPORT


def write_page(diagnosis: Diagnosis, path: Path, extras: Extras | None = None) -> None:
    """Write the report alone, one HTML file that opens offline."""
    html.write_page(path, "gap.html.j2", **content_of(diagnosis, extras or Extras()))


def record_text(found: Diagnosis) -> str:
    """Write the record of a diagnosis as JSON."""
    return json.dumps(found.as_dict(), indent=1, allow_nan=False)


def content_of(found: Diagnosis, extras: Extras) -> Row:
    """Collect the content of the template."""
    points = cells.cells_of(found)
    return {
        "bench": found.bench,
        "headline": headline(found.found),
        "said": parts_in_words(found.found),
        "empty_cells": reasons.empty_cells(found),
        "few_data": reasons.few_data(found),
        "cards": _cards(found),
        "leading": "" if found.leading == NONE else plain(found.leading, found.effects),
        "answers": answers.answers_of(found, extras.remarks),
        "kind": found.verdict.kind,
        "classes": alike.classes_in_words(found),
        "limits": reasons.LIMITS,
        "not_named": reasons.why_not_named(found),
        "why_alike": reasons.why_alike(found),
        "readings": _readings(found),
        "unknown_cells": extras.unknown_cells,
        "tests": [
            {
                "name": test.name,
                "how": test.how,
                "shows": ", ".join(found.effects[name].plain for name in test.shows),
                "information": "" if test.information is None else f"{test.information:.2f}",
                "share": "" if test.information is None else chance(test.settles),
                "misleads": "" if test.information is None else chance(test.misleads),
                "hours": f"{test.hours:.2g}",
            }
            for test in found.tests[:TESTS]
        ],
        "at_rest": [
            said for _, said in readings_in_words(found.bench, found.effects, found.scored)
        ],
        "next": (found.tests[0].name, why(found.tests[0], found.posterior, found.effects)),
        "so_what": None if extras.so_what is None else _so_what(extras.so_what),
        "facts": _facts(found, extras),
        "json_link": "data:application/json," + quote(record_text(found)),
        "csv_link": html.csv_link(cells.table(points)),
        "without": sorted({cells.unreadable(point) for point in points} - {""}),
        "part_engaged": any(point.failed and point.engaged for point in points),
        "unknown_shifts": sum(point.unknown for point in points),
        "corners": _corners(found),
        "foretold": predicted_figure.in_words(found),
        **_influence(found),
        **_figures(found, points, extras),
    }


def _figures(found: Diagnosis, points: list[cells.CellRow], extras: Extras) -> Row:
    """Draw all figures as HTML, an empty word where there is nothing to draw."""
    leading = found.leading
    timed = any(point.bench_s is not None for point in points)
    name = "" if leading == NONE else answers.short(found, leading)
    drawn = {
        "map": gapmap.gap_map_figure(points) if timed else None,
        "causes": charts.causes_figure(found) if len(found.posterior) > 1 else None,
        "before": before.before_figure(points, name.replace("<br>", " ")) if timed else None,
        "held_out": None if found.before_after.baseline is None else charts.held_out_figure(found),
        "alike": alike.alike_figure(found) if len(found.confusion.hypotheses) > 1 else None,
        "bounds": charts.bounds_figure(found) if found.bounds else None,
        "phases": charts.phases_figure(extras.phases) if extras.phases else None,
        "foretold": predicted_figure.predicted_figure(found) if found.foretold and timed else None,
        "influence": swayed.influence_figure(found, found.influence) if found.influence else None,
    }
    return {
        f"{key}_figure": "" if figure is None else html.figure_html(figure, key)
        for key, figure in drawn.items()
    }


def _corners(found: Diagnosis) -> list[Row]:
    """Draw the joint posterior of each plausible hypothesis: the first as HTML, others as data."""
    drawn: list[Row] = []
    for hypothesis in joint_figure.with_corners(found):
        figure = joint_figure.joint_figure(found, hypothesis)
        share = chance(found.posterior.get(hypothesis, 0.0))
        drawn.append(
            {
                "name": f"{plain(hypothesis, found.effects)} ({share})",
                "html": "" if drawn else html.figure_html(figure, "joint"),
                "json": Markup(html.as_script_json(json.loads(str(figure.to_json())))),
                "width": 170 * len(figure.layout.annotations) // 2,
            }
        )
    return drawn


def _influence(found: Diagnosis) -> Row:
    """Describe and tabulate the influence of the operating points; empty where there is none."""
    said = found.influence
    if said is None:
        return {"swayed": "", "hangs": "", "influence_rows": [], "elpd": "", "rival": ""}
    points = [(c.point.mismatch / RPM, c.point.profile.force) for c in found.bench.cells]
    record = said.as_dict(points)
    apart, error = record["elpd_difference"], record["elpd_difference_error"]
    beside = f" ± {error:.2g}" if error is not None else ""
    return {
        "swayed": influence_in_words(said, points, found.effects),
        "hangs": verdict_in_words(said, points, found.effects) if said.changing else "",
        "influence_rows": swayed.rows_of(found, said),
        "elpd": f"{apart:.3g}{beside} nats".replace("-", "\N{MINUS SIGN}"),
        "rival": plain(said.rival, found.effects),
    }


def _cards(found: Diagnosis) -> list[Row]:
    """Return the numbers under the headline: gap now, gap left, and the gap by chance."""
    gaps = found.before_after
    if gaps.baseline is None or gaps.floor is None:
        return []
    cards = [("prototype", "gap now", gaps.baseline, "bench less simulation, root mean square")]
    if found.leading != NONE and gaps.held_out is not None:
        cards.append(("chosen", "gap left", gaps.held_out, "at points that the fit never saw"))
    words = "would be left if that hypothesis were true" if len(cards) > 1 else "would be the gap"
    title, chance_s = answers.by_chance(found)
    cards.append(("gain", title, gaps.floor if chance_s is None else chance_s, words))
    keys = ("look", "title", "value", "words")
    return [
        dict(zip(keys, (look, title, ms(gap).split()[0], words), strict=True))
        for look, title, gap, words in cards
    ]


def _readings(found: Diagnosis) -> Row:
    """Tabulate probabilities under other readings: a column each, a row a hypothesis."""
    columns = {"as given": found.posterior} | {
        _reading(key): posterior for key, posterior in found.other.items()
    }
    shown = [
        h for posterior in columns.values() for h in list(posterior)[:4] if posterior[h] > 0.005
    ]
    rows = [
        (plain(h, found.effects), [chance(posterior.get(h, 0.0)) for posterior in columns.values()])
        for h in dict.fromkeys(shown)
    ]
    first = {next(iter(posterior)) for posterior in columns.values()}
    return {"columns": list(columns), "rows": rows, "same": len(first) == 1}


def _reading(key: str) -> str:
    if key.startswith("given_"):
        return f"given the {quantity(key.removeprefix('given_'))} at rest"
    return READINGS.get(key, key.replace("_", " "))


def _so_what(given: SoWhat) -> Row:
    sides = given.without, given.within

    def shown(key: str, design: Mapping[str, Any]) -> str:
        return value(key, design[key]).split()[0] if key in design else ""

    rows = [
        (axis(key), [shown(key, side.design) for side in sides])
        for key in dict.fromkeys([*given.without.design, *given.within.design])
    ]
    for words, name in (("without", "time_without_s"), ("with", "time_with_s")):
        times = [ms(getattr(side, name)) for side in sides]
        rows.append((f"expected shift time, simulated {words} the effect", times))
    return {"rows": rows, "regret": ms(given.regret_s), "sentence": given.sentence}


def _together(found: Diagnosis) -> str:
    """List the effects that were simulated together for this diagnosis."""
    counts = Counter(level.hypothesis for level in found.together)
    every = (
        f"{' with '.join(found.effects[name].plain for name in h)} at {count} values"
        for h, count in counts.items()
    )
    return ", ".join(every)


def _facts(found: Diagnosis, extras: Extras) -> dict[str, str]:
    """List the facts on data set and run."""
    bench = found.bench
    named = [h for h in found.posterior if h not in (NONE, UNKNOWN)]
    kinds = zip((1, 2, 3), ("of one effect", "of two", "of three"), strict=True)
    counts = [(sum(len(h) == size for h in named), words) for size, words in kinds]
    listed = ", ".join(f"{count} {words}" for count, words in counts if count)
    given = {
        "data set": bench.name,
        "source": bench.source,
        "operating points": f"{len(bench.cells)}, with {sum(cell.n for cell in bench.cells)} "
        "shifts that have a time",
        "corrections": ", ".join(f"{c.quantity}={c.way}" for c in bench.corrections),
        "looks odd": "; ".join(
            f"{one.found}; this looks like {one.looks_like}" for one in bench.warnings
        ),
        "effects considered": ", ".join(
            f"{effect.plain} ({name})" for name, effect in found.effects.items()
        ),
        "hypotheses": f"{len(found.posterior)}: {listed}, no effect, and no known effect",
        "simulated together": _together(found),
        **extras.provenance,
    }
    return {label(key).replace("_", " "): words for key, words in given.items() if words}
