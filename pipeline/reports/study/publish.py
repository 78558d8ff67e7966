"""Writing the report of a study, and what it needs that takes time: effects and animations."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from dogshape.pipeline.config.study_file import Study
from dogshape.pipeline.reports.kit.html import render
from dogshape.pipeline.reports.study.content import content_of
from dogshape.pipeline.reports.study.design_names import designs_shown
from dogshape.pipeline.reports.study.design_shifts import Shifts, read_shifts
from dogshape.pipeline.reports.study.design_tables import designs_frame
from dogshape.pipeline.reports.study.learned import learn_effects
from dogshape.pipeline.reports.study.replays import replays_of, write_replays
from dogshape.pipeline.store.folder import StudyFolder
from dogshape.pipeline.store.journal import ShiftJournal
from dogshape.pipeline.store.output_files import require_targets
from dogshape.sim.files import naming

Row = dict[str, Any]
Say = Callable[[str], None]


def publish(folder: StudyFolder, say: Say) -> Path:
    """Make what the report lacks, then write it; return its path.

    Effects from the surrogate take a minute, the page of a shift half a second each.
    """
    study, result = folder.stored_study(), folder.stored_result()
    require_targets({"the report": folder.report})
    learn_effects(folder, say)
    shifts = _shifts(folder, study)
    if (lost := _lost(folder, result, shifts)) > 0:
        say(
            f"{folder.shifts} lacks {lost} of the {result['n_simulated_shifts']} shifts that "
            f"{folder.result.name} rests on, so the report shows single shifts without them; "
            "'dogshape study' with --resume simulates them again"
        )
    pairs = replays_of(shifts, designs_shown(result) if result["best"] is not None else [])
    write_replays(folder, shifts, [one for pair in pairs for one in pair], say)
    return _write(folder, study, result, shifts)


def write_report(folder: StudyFolder) -> Path:
    """Write ``report.html`` and ``designs.csv`` from what the study stored; return the report."""
    study, result = folder.stored_study(), folder.stored_result()
    return _write(folder, study, result, _shifts(folder, study))


def _shifts(folder: StudyFolder, study: Study) -> Shifts:
    return read_shifts(study, ShiftJournal(folder.shifts, only_read=True))


def _lost(folder: StudyFolder, result: Row, shifts: Shifts) -> int:
    """Return how many shifts are missing; what other machines simulated is in their folders."""
    return 0 if folder.others.exists() else result["n_simulated_shifts"] - len(shifts.rows)


def _write(folder: StudyFolder, study: Study, result: Row, shifts: Shifts) -> Path:
    page = render("report.html.j2", **content_of(folder, study, result, shifts))
    with naming(folder.designs):
        designs_frame(result, list(study.variables)).to_csv(folder.designs, index=False)
    with naming(folder.report):
        folder.report.write_text(page, encoding="utf-8")
    return folder.report
