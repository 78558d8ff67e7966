"""What the template of the gap report is filled with; what is not known is empty."""

from __future__ import annotations

import json
from typing import Any
from urllib.parse import quote

from dogshape.diagnosis.bench.finding import Finding
from dogshape.diagnosis.diagnosis import Diagnosis
from dogshape.diagnosis.inference.next_test import why
from dogshape.diagnosis.inference.static_readings import against, facts_of
from dogshape.diagnosis.prediction.hypotheses import NONE, UNKNOWN, plain
from dogshape.diagnosis.report.wording import chance, headline, in_words, ms, quantity
from dogshape.pipeline.diagnose.extras import Extras, SoWhat
from dogshape.pipeline.reports.gap import before_after as before
from dogshape.pipeline.reports.gap import charts, reasons
from dogshape.pipeline.reports.gap import gap_map_figure as gapmap
from dogshape.pipeline.reports.gap import hypothesis_cards as answers
from dogshape.pipeline.reports.gap import odds_matrix as alike
from dogshape.pipeline.reports.gap import point_rows as cells
from dogshape.pipeline.reports.kit.html import figure_html
from dogshape.pipeline.reports.study.design_tables import csv_link
from dogshape.pipeline.reports.surrogate.variable_labels import axis, label, value

Row = dict[str, Any]
TESTS = 8  #: tests that are listed
READINGS = {
    "priors_halved": "ranges half as wide",
    "priors_doubled": "ranges twice as wide",
    "unknown_as_failed": "unknown shifts read as failed",
}


def content_of(found: Diagnosis, extras: Extras) -> Row:
    """Return the content of the template."""
    points = cells.cells_of(found)
    return {
        "bench": found.bench,
        "headline": headline(found.found),
        "summary": in_words(found.found),
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
        "tests": _tests(found),
        "at_rest": [against(fact, found.scored) for fact in facts_of(found.bench)],
        "next": (found.tests[0].name, why(found.tests[0], found.posterior, found.effects)),
        "so_what": _so_what(extras.so_what),
        "facts": _facts(found, extras),
        "json_link": "data:application/json," + quote(record_text(found)),
        "csv_link": csv_link(cells.table(points)),
        **_marks(points),
        **_figures(found, points, extras),
    }


def record_text(found: Diagnosis) -> str:
    """Return the record of a diagnosis as JSON."""
    return json.dumps(found.as_dict(), indent=1, allow_nan=False)


def _figures(found: Diagnosis, points: list[cells.CellRow], extras: Extras) -> Row:
    """Return all figures as HTML, an empty word where there is nothing to draw."""
    gaps, leading = found.before_after, found.leading
    timed = any(point.bench_s is not None for point in points)
    name = "" if leading == NONE else answers.short(found, leading)
    many = len(found.posterior) > 1
    drawn = {
        "map": gapmap.gap_map_figure(points) if timed else None,
        "causes": charts.causes_figure(found) if many else None,
        "before": before.before_figure(points, name.replace("<br>", " ")) if timed else None,
        "held_out": charts.held_out_figure(found) if gaps.baseline is not None else None,
        "alike": alike.alike_figure(found) if alike.is_worth(found) else None,
        "bounds": charts.bounds_figure(found) if found.bounds else None,
        "phases": charts.phases_figure(extras.phases) if extras.phases else None,
    }
    return {
        f"{key}_figure": "" if figure is None else figure_html(figure, key)
        for key, figure in drawn.items()
    }


def _cards(found: Diagnosis) -> list[Row]:
    """Return the numbers under the headline: gap, what is left, and what chance makes."""
    gaps = found.before_after
    if gaps.baseline is None or gaps.floor is None:
        return []
    cards = [("prototype", "gap now", gaps.baseline, "bench less simulation, root mean square")]
    if found.leading != NONE and gaps.held_out is not None:
        cards.append(("chosen", "gap left", gaps.held_out, "at points that the fit never saw"))
    words = "would be left if that hypothesis were true" if len(cards) > 1 else "would be the gap"
    title, chance_s = answers.by_chance(found)
    cards.append(("gain", title, gaps.floor if chance_s is None else chance_s, words))
    return [dict(zip(("look", "title", "value", "words"), card, strict=True)) | {
        "value": ms(card[2]).split()[0]} for card in cards]  # fmt: skip


def _marks(points: list[cells.CellRow]) -> Row:
    """Return what the legend of the map has to explain."""
    without = {cells.unreadable(point) for point in points} - {""}
    part = any(point.failed and point.engaged for point in points)
    unknown = sum(point.unknown for point in points)
    return {"without": sorted(without), "part_engaged": part, "unknown_shifts": unknown}


def _readings(found: Diagnosis) -> Row:
    """Return probabilities under other readings: a column each, a row a hypothesis."""
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
    """Return what a reading assumes, in words; ``given_X`` takes a reading at rest in."""
    if key.startswith("given_"):
        return f"given the {quantity(key.removeprefix('given_'))} at rest"
    return READINGS.get(key, key.replace("_", " "))


def _tests(found: Diagnosis) -> list[Row]:
    """Return the menu, with what each test tells and its chance to settle the cause."""
    return [
        {
            "name": test.name,
            "how": test.how,
            "shows": ", ".join(found.effects[name].plain for name in test.shows),
            "information": "" if test.information is None else f"{test.information:.2f}",
            "share": "" if test.information is None else chance(test.settles),
            "hours": f"{test.hours:.2g}",
        }
        for test in found.tests[:TESTS]
    ]


def _so_what(given: SoWhat | None) -> Row | None:
    if given is None:
        return None
    keys = list(dict.fromkeys([*given.without.design, *given.within.design]))
    rows = [
        (axis(key), [_value(key, side.design) for side in (given.without, given.within)])
        for key in keys
    ]
    for words, name in (("without", "time_without_s"), ("with", "time_with_s")):
        times = [ms(getattr(side, name)) for side in (given.without, given.within)]
        rows.append((f"expected shift time, simulated {words} the effect", times))
    return {"rows": rows, "regret": ms(given.regret_s), "sentence": given.sentence}


def _value(key: str, design: Any) -> str:
    return value(key, design[key]).split()[0] if key in design else ""


def _facts(found: Diagnosis, extras: Extras) -> dict[str, str]:
    """Return what is known of data set and run."""
    bench = found.bench
    shifts = sum(cell.n for cell in bench.cells)
    given = {
        "data set": bench.name,
        "source": bench.source,
        "operating points": f"{len(bench.cells)}, with {shifts} shifts that have a time",
        "corrections": ", ".join(f"{c.quantity}={c.way}" for c in bench.corrections),
        "looks odd": "; ".join(_odd(one) for one in bench.warnings),
        "effects considered": ", ".join(effect.plain for effect in found.effects.values()),
        "hypotheses": _hypotheses(found),
        **extras.provenance,
    }
    return {label(key).replace("_", " "): words for key, words in given.items() if words}


def _hypotheses(found: Diagnosis) -> str:
    """Return how many hypotheses were weighed, and of which kind."""
    named = [h for h in found.posterior if h not in (NONE, UNKNOWN)]
    sizes = [sum(len(h) == k for h in named) for k in (1, 2, 3)]
    kinds = zip(sizes, ("of one effect", "of two", "of three"), strict=True)
    listed = [f"{count} {words}" for count, words in kinds if count]
    return f"{len(found.posterior)}: {', '.join(listed)}, no effect, and no known effect"


def _odd(finding: Finding) -> str:
    return f"{finding.found}; this looks like {finding.looks_like}"
