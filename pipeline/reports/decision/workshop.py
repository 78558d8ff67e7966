"""Folder for the workshop: drawing, solids and data sheet of the design that was chosen."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.export.cad import cad_available, write_step
from dogshape.pipeline.export.drawing import dimensioned_svg
from dogshape.pipeline.reports.decision.datasheet import sheet_of
from dogshape.pipeline.reports.kit.html import render
from dogshape.pipeline.reports.study.provenance import now
from dogshape.pipeline.reports.study.single_shifts import read_shifts
from dogshape.pipeline.reports.study.standing import Standing, standing_of
from dogshape.pipeline.reports.study.study_page import write_report
from dogshape.pipeline.simulate.design import SIMULATED
from dogshape.pipeline.store.decisions import (
    Decision,
    decisions_of,
    keep_decision,
    record_of,
    result_hash,
    workshop_folder,
)
from dogshape.pipeline.store.folder import StudyFolder, write_json
from dogshape.pipeline.store.journal import ShiftJournal
from dogshape.sim.errors import InputError, StorageError
from dogshape.sim.files import naming
from dogshape.sim.part.solid import ring_part
from dogshape.sim.shift.mesh import to_stl
from dogshape.sim.units import MM

Row = dict[str, Any]  #: a part of result.json, whose schema is ``pipeline.store.result_schema``
BODY = 3.0 * MM  #: thickness of a ring below its slots, m, as ``dogshape export`` has it
NO_STEP = "no STEP file: it needs the extra [cad] (pip install 'dogshape[cad]')"


def choose(folder: StudyFolder, design: int, why: str, *, force: bool = False) -> Row:
    """Record the decision for a design and write what the workshop needs; return the record.

    Raises
    ------
    InputError
        For a design that the study has not simulated, or no reason.
    StorageError
        For a folder without a result, or with a decision already, without ``force``.
    """
    study, result = folder.stored_study(), folder.stored_result()
    if not why.strip():
        raise InputError("--why is empty, but a decision needs its reason; write it in a sentence")
    row = _row(result, design)
    before, target = decisions_of(folder), workshop_folder(folder)
    if before and not force:
        raise StorageError(
            f"{folder.root} has a decision already, for design {before[-1].design} "
            f"({before[-1].day}: {before[-1].why}); --force decides again and keeps that one in "
            f"{folder.decision.name}"
        )
    with folder.writing():
        decision = Decision(
            design, why.strip(), now(), result_hash(folder), study.config_hash, study.physics_hash
        )
        standing = standing_of(study, result, row)
        files, notes = _files(folder, study, result, (decision, standing))
        keep_decision(folder, decision)
        write_json(target / "decision.json", record_of(decision))
    report = str(write_report(folder)) if folder.report.is_file() else None
    return {
        **record_of(decision),
        "folder": str(target),
        "files": [*files, "decision.json"],
        "notes": [*notes, *_doubts(result, standing)],
        "report": report,
    }


def _row(result: Row, design: int) -> Row:
    rows = {row["trial"]: row for row in result["trials"]}
    row = rows.get(design)
    if row is None:
        raise InputError(
            f"--design is {design}, but the study has the designs 0 (prototype) to "
            f"{max(rows, default=0)}; its report lists them"
        )
    if row[SIMULATED] is None:
        failed = ", ".join(row["failed"])
        raise InputError(
            f"--design is {design}, which failed {failed} and was not simulated; choose one that "
            "has a time"
        )
    return row


def _doubts(result: Row, standing: Standing) -> list[str]:
    """List what speaks against a design: checks that it fails, and that nobody confirmed it."""
    failed = [name for name, margin in standing.margins.items() if margin < 0.0]
    said = [f"design {standing.trial} fails {', '.join(failed)}"] if failed else []
    if not standing.confirmed and result["confirmation"]:
        said.append(
            f"design {standing.trial} was not simulated at the new angles of the confirmation: its "
            "time is that of the search, which picks designs that were also lucky"
        )
    return said


def _files(
    folder: StudyFolder, study: Setup, result: Row, chosen: tuple[Decision, Standing]
) -> tuple[list[str], list[str]]:
    """Write drawing, solids and data sheet; return their names, and what could not be written."""
    target, (decision, standing) = workshop_folder(folder), chosen
    target.mkdir(parents=True, exist_ok=True)
    dog = study.dog_with({name: standing.row[name] for name in study.variables})
    radius, title = study.limits.root_radius, f"{study.name}, design {standing.trial}"
    section = dimensioned_svg(dog, study.limits, title)
    _write(target / "section.svg", section)
    with naming(target / "ring.stl"):
        solid = to_stl(ring_part(dog, radius, BODY), f"dogshape {title}")
        (target / "ring.stl").write_bytes(solid)
    files, notes = ["section.svg", "ring.stl"], []
    if cad_available():
        write_step(dog, radius, BODY, target / "rings.step")
        files.append("rings.step")
    else:
        (target / "rings.step").unlink(missing_ok=True)  # of another design
        notes.append(NO_STEP)
    shifts = read_shifts(study, ShiftJournal(folder.shifts, only_read=True))
    content = sheet_of(study, result, standing, decision, shifts)
    page = render("datasheet.html.j2", plotly="", section=section, **content)
    _write(target / "datasheet.html", page)
    return [*files, "datasheet.html"], notes


def _write(path: Path, text: str) -> None:
    with naming(path):
        path.write_text(text, encoding="utf-8")
