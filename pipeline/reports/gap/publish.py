"""Writing the report of a diagnosis with its record and its table."""

from __future__ import annotations

from pathlib import Path

from dogshape.diagnosis.diagnosis import Diagnosis
from dogshape.pipeline.diagnose.extras import Extras
from dogshape.pipeline.reports.gap.content import content_of, record_text
from dogshape.pipeline.reports.gap.point_rows import cells_of, table
from dogshape.pipeline.reports.kit.html import render
from dogshape.sim.files import naming

REPORT, RECORD, TABLE = "report.html", "gap.json", "cells.csv"


def publish(diagnosis: Diagnosis, folder: Path, extras: Extras | None = None) -> Path:
    """Write ``report.html``, ``gap.json`` and ``cells.csv`` into a folder; return the report.

    The folder is made where it is missing; files of these names are written anew.
    """
    folder.mkdir(parents=True, exist_ok=True)
    write_page(diagnosis, folder / REPORT, extras)
    written = {RECORD: record_text(diagnosis) + "\n", TABLE: table(cells_of(diagnosis))}
    for name, text in written.items():
        with naming(folder / name):
            (folder / name).write_text(text, encoding="utf-8")
    return folder / REPORT


def write_page(diagnosis: Diagnosis, path: Path, extras: Extras | None = None) -> None:
    """Write the report alone, one HTML file that opens offline."""
    page = render("gap.html.j2", **content_of(diagnosis, extras or Extras()))
    with naming(path):
        path.write_text(page, encoding="utf-8")
