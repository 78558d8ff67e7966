"""Writing the report of a diagnosis with its record and its table."""

from __future__ import annotations

from pathlib import Path

from diagnosis.diagnosis import Diagnosis
from pipeline.gapreport.cells import cells_of, table
from pipeline.gapreport.content import content_of, record_text
from pipeline.gapreport.extras import Extras
from pipeline.reporting.html import render

REPORT, RECORD, TABLE = "report.html", "gap.json", "cells.csv"


def publish(diagnosis: Diagnosis, folder: Path, extras: Extras | None = None) -> Path:
    """Write ``report.html``, ``gap.json`` and ``cells.csv`` into a folder; return the report.

    The folder is made where it is missing; files of these names are written anew.
    """
    folder.mkdir(parents=True, exist_ok=True)
    page = render("gap.html.j2", **content_of(diagnosis, extras or Extras()))
    (folder / RECORD).write_text(record_text(diagnosis) + "\n", encoding="utf-8")
    (folder / TABLE).write_text(table(cells_of(diagnosis)), encoding="utf-8")
    report = folder / REPORT
    report.write_text(page, encoding="utf-8")
    return report
