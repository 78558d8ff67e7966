"""Diagnosis, update and calibrated study in tables."""

from __future__ import annotations

from typing import Any

from rich.console import Group, RenderableType
from rich.table import Table

from dogshape.cli.console import columns
from dogshape.cli.tables.validate_tables import examined_lines
from dogshape.diagnosis.diagnosis import Diagnosis
from dogshape.diagnosis.report.wording import chance
from dogshape.pipeline.reports.gap.gap_page import gap_rows, hypothesis_row, shown_hypotheses
from dogshape.sim.effects import load

SHOWN = 6  #: hypotheses in a table


def diagnosis_table(found: Diagnosis, record: dict[str, Any]) -> RenderableType:
    """Return a diagnosis for the console."""
    own = [name for name in found.effects if name not in load()]
    return Group(
        record["summary"],
        "",
        _hypotheses(found),
        "",
        "root-mean-square gap: " + "; ".join(f"{name} {time}" for name, time in gap_rows(found)),
        f"Monte Carlo error of the leading probability: {found.noise:.3f}",
        *(f"own effect {n}: {chance(found.inclusion.get(n, 0.0))}" for n in own),
        next_test_line(record["next_test"]),
        *([record["so_what"]["sentence"]] if record["so_what"] else []),
        *([f"report: {record['report']}"] if record["report"] else []),
        *examined_lines(found.bench),
    )


def next_test_line(record: dict[str, Any]) -> str:
    """Return the next test with its reason, in a line."""
    return f"next test: {record['name']}. {record['why']}"


def _hypotheses(found: Diagnosis) -> Table:
    table = columns("hypothesis", "probability", "sizes (90 %)", "p")
    for hypothesis in shown_hypotheses(found)[:SHOWN]:
        row = hypothesis_row(found, hypothesis)
        sizes = "; ".join(row["sizes"]) or "-"
        table.add_row(row["name"], row["probability"], sizes, row["p"] or "-")
    return table


def calibrated_lines(record: dict[str, Any]) -> list[str]:
    """List the content of a calibrated study, and what it leaves out."""
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
    table = columns("hypothesis", "before", "now")
    for name in names:
        table.add_row(name, *(chance(one.get(name, 0.0)) for one in both))
    return Group(
        record["sentence"],
        "",
        table,
        "",
        f"before: {record['before']['headline']}",
        f"now: {record['after']['headline']}",
        next_test_line(record["next_test"]),
        f"report: {record['report']}",
        *examined_lines(found.bench),
    )
