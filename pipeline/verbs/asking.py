"""``check``: one design without simulation, by its closed forms and the surrogate.

Whoever asks often wants the answer at once, so nothing that is slow to load belongs here.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.console import RenderableType

from pipeline.config import load_study
from pipeline.console import emit, verb
from pipeline.design import design_of, root_notes
from pipeline.folder import StudyFolder
from pipeline.options import Json, Sets, StudyArg, default_out
from pipeline.tables.answers import answer_text
from pipeline.tables.checks import strength_table
from pipeline.tolerances import checks_within, margins_within, spread_record, time_spread
from sim.locking import blocking_force
from surrogate.query import ask
from surrogate.store import load


@verb
def check(
    study: StudyArg,
    surrogate: Annotated[
        Path | None, typer.Option(help="default: results/NAME/surrogate.json")
    ] = None,
    set_: Sets = None,
    json: Json = False,
) -> None:
    """Quick check of one design, without simulating it.

    Example: dogshape check mq200 --set dog.chamfer_deg=14 --set dog.count=18
    """
    given = load_study(study, set_)
    model, validation = load(surrogate or StudyFolder(default_out(given)).surrogate)
    answer = ask(model, given.prototype, given.physics_hash)
    design = design_of(given, {})
    within = margins_within(given, design)
    spread = time_spread(given, model, given.prototype)
    data = {
        "expected_shift_time_s": answer.time,
        "low_s": answer.low,
        "high_s": answer.high,
        "in_range": answer.in_range,
        "q2": validation.q2,
        "warnings": list(answer.warnings),
        "time_within_tolerances": spread_record(spread),
        "feasible": design.feasible,
        "not_checked": design.not_checked,
        "checks": checks_within(design, within),
    }
    held = blocking_force(given.clutch.dog, given.limits.load)

    def text() -> RenderableType:
        table = strength_table(design.checks, within, held, root_notes(given))
        return answer_text(answer, validation, spread, table)

    emit(data, json, text)
    if not design.feasible:
        raise typer.Exit(1)
