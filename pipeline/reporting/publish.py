"""Writing the report of a study, and what it needs that takes time: effects and animations."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from pipeline.config import Study
from pipeline.folder import StudyFolder
from pipeline.journal import ShiftJournal
from pipeline.reporting.content import content_of
from pipeline.reporting.html import render
from pipeline.reporting.learned import learn_effects
from pipeline.reporting.names import designs_shown
from pipeline.reporting.replays import replays_of, write_replays
from pipeline.reporting.shifts import Shifts, read_shifts
from pipeline.reporting.tables import designs_frame

Row = dict[str, Any]
Say = Callable[[str], None]


def publish(folder: StudyFolder, say: Say) -> Path:
    """Make what the report lacks, then write it; return its path.

    Effects from the surrogate take a minute, the page of a shift half a second each.
    """
    study, result = folder.stored_study(), folder.stored_result()
    learn_effects(folder, say)
    shifts = _shifts(folder, study)
    pairs = replays_of(shifts, designs_shown(result) if result["best"] is not None else [])
    write_replays(folder, shifts, [one for pair in pairs for one in pair], say)
    return _write(folder, study, result, shifts)


def write_report(folder: StudyFolder) -> Path:
    """Write ``report.html`` and ``designs.csv`` from what the study stored; return the report."""
    study, result = folder.stored_study(), folder.stored_result()
    return _write(folder, study, result, _shifts(folder, study))


def _shifts(folder: StudyFolder, study: Study) -> Shifts:
    return read_shifts(study, ShiftJournal(folder.shifts, only_read=True))


def _write(folder: StudyFolder, study: Study, result: Row, shifts: Shifts) -> Path:
    page = render("report.html.j2", **content_of(folder, study, result, shifts))
    designs_frame(result, list(study.variables)).to_csv(folder.designs, index=False)
    folder.report.write_text(page, encoding="utf-8")
    return folder.report
