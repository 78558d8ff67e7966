"""The diagnosis of a gap in words and tables."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from rich.console import Group, RenderableType
from rich.table import Table

from dogshape.diagnosis.diagnosis import Diagnosis
from dogshape.diagnosis.inference.predictive_check import ADEQUATE
from dogshape.diagnosis.inference.verdict import NAMED
from dogshape.diagnosis.prediction.hypotheses import UNKNOWN, plain
from dogshape.diagnosis.report.wording import chance, described
from dogshape.diagnosis.terms import Hypothesis
from dogshape.pipeline.cli.console import columns
from dogshape.pipeline.cli.tables.validate_tables import examined_lines
from dogshape.pipeline.reports.gap.odds_matrix import class_in_words
from dogshape.pipeline.reports.kit.text import in_ms
from dogshape.sim.effects import load

SHOWN = 6  #: hypotheses in the table
ALIKE = "cannot be told apart"
LEAST = 0.001  #: probability from which one is shown


def diagnosis_table(found: Diagnosis, record: dict[str, Any]) -> RenderableType:
    """Return a diagnosis for the console."""
    test = record["next_test"]
    lines = [
        record["summary"],
        "",
        _causes(found, record),
        "",
        _gap(found, record["gap"]),
        f"Monte Carlo error of the leading probability: {record['noise']:.3f}",
        *_classes(found),
        *_own(found, record),
        f"next test: {test['name']}. {test['why']}",
        *([record["so_what"]["sentence"]] if record["so_what"] else []),
        *([f"report: {record['report']}"] if record["report"] else []),
        *examined_lines(found.bench),
    ]
    return Group(*lines)


def _own(found: Diagnosis, record: dict[str, Any]) -> list[str]:
    """List the probability of each effect of the user's own, however small."""
    mine = [name for name in found.effects if name not in load()]
    chances = ((name, record["inclusion"].get(name, 0.0)) for name in mine)
    return [
        f"effect of your own: {found.effects[name].plain} is part of the cause with {chance(share)}"
        for name, share in chances
    ]


def calibrated_lines(record: dict[str, Any]) -> list[str]:
    """List what a calibrated study has, and what it leaves out."""
    unsure = record["uncertain"]
    return [
        "",
        f"study: {record['study']} ({', '.join(record['effects']) or 'its own keys'}); "
        f"{record['n_draws']} draws from the posterior: {record['draws']}",
        *([f"uncertain from shift to shift: {', '.join(unsure)}"] if unsure else []),
        *(f"note: {remark}" for remark in record["remarks"]),
    ]


def update_table(record: dict[str, Any], found: Diagnosis) -> RenderableType:
    """Return the change by new readings for the console."""
    both = [record[when]["probabilities"] for when in ("before", "after")]
    names = sorted({*both[0], *both[1]}, key=lambda name: -both[1].get(name, 0.0))[:SHOWN]
    table = columns("cause", "before", "now")
    for name in names:
        table.add_row(name, *(chance(one.get(name, 0.0)) for one in both))
    return Group(
        record["sentence"],
        "",
        table,
        "",
        f"before: {record['before']['headline']}",
        f"now: {record['after']['headline']}",
        f"next test: {record['next_test']['name']}. {record['next_test']['why']}",
        f"report: {record['report']}",
        *examined_lines(found.bench),
    )


def _causes(found: Diagnosis, record: dict[str, Any]) -> Table:
    table = columns("cause", "probability", "parameters (90 %)", "fits")
    for one in record["hypotheses"][:SHOWN]:
        hypothesis = tuple(one["effects"])
        # Where no known effect fits, the nearest still says what of it is likely.
        if one["probability"] < LEAST and hypothesis != found.leading:
            continue
        sizes = found.intervals.get(hypothesis, {})
        values = "; ".join(described(name, value) for name, value in sizes.items())
        fit = one.get("predictive_p")
        fits = "-" if fit is None else "yes" if fit >= ADEQUATE else "no"
        table.add_row(
            plain(hypothesis, found.effects),
            chance(one["probability"]),
            values or "-",
            fits,
        )
    return table


def _gap(found: Diagnosis, gap: dict[str, Any]) -> str:
    parts = [
        f"gap {in_ms(gap['baseline_rmse_s'])} ms",
        f"held out {in_ms(gap['heldout_rmse_s'])} ms",
        f"chance alone {in_ms(gap['leading_floor_rmse_s'])} ms",
    ]
    if gap["rival"] is not None:
        rival = plain(tuple(gap["rival"]), found.effects)
        parts.append(f"best rival ({rival}) {in_ms(gap['rival_heldout_rmse_s'])} ms held out")
    return ", ".join(parts)


def _classes(found: Diagnosis) -> list[str]:
    """List causes that cannot be told apart, by the names of the page with the record's keys."""
    groups = [group for group in found.confusion.classes if len(group) > 1]
    # Odds are those that as many shifts give on average; these data may tell all the same.
    lines = [f"{_told(found, g)}: {class_in_words(g, found.effects, keys=True)}" for g in groups]
    named = {n for h in found.confusion.hypotheses if h != UNKNOWN for n in h}
    for name in sorted(named):
        effect = found.effects[name]
        lines += [f"{ALIKE}: {effect.plain} ({name}) or {alias}" for alias in effect.aliases]
    return lines


def _told(found: Diagnosis, group: Sequence[Hypothesis]) -> str:
    """Write whether these data tell one of a class from the others, if not on average."""
    settled = any(found.posterior.get(h, 0.0) > NAMED for h in group)
    return "told apart by these data, not by as many shifts on average" if settled else ALIKE
