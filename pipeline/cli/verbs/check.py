"""``check``: designs without simulation, by their closed forms and the surrogate.

Whoever asks often wants the answer at once, so nothing that is slow to load belongs here.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import RenderableType

from dogshape.pipeline.cli.console import emit, verb
from dogshape.pipeline.cli.options import (
    Json,
    OneForce,
    OneMismatch,
    Sets,
    StudyArg,
    SurrogateFile,
)
from dogshape.pipeline.cli.progress_bar import say
from dogshape.pipeline.cli.tables.margin_tables import strength_table
from dogshape.pipeline.cli.tables.prediction_tables import answer_text, filled_lines, many_text
from dogshape.pipeline.config.asked_points import points_of
from dogshape.pipeline.config.study_file import load_study
from dogshape.pipeline.search.tolerance_effects import (
    checks_within,
    margins_within,
    spread_record,
    time_spread,
)
from dogshape.pipeline.simulate.design import design_of, notes_of
from dogshape.pipeline.store.output_files import require_targets
from dogshape.pipeline.train.design_table import ask_many
from dogshape.pipeline.train.found_surrogates import stored_surrogate
from dogshape.pipeline.train.training_rows import mix_over
from dogshape.sim.errors import InputError
from dogshape.sim.strength.locking import blocking_force
from dogshape.surrogate.mix import Mix
from dogshape.surrogate.query import Answer, ask


@verb
def check(
    study: StudyArg,
    surrogate: SurrogateFile = None,
    mismatch_rpm: OneMismatch = None,
    force_N: OneForce = None,
    designs: Annotated[
        Path | None, typer.Option(help="CSV of designs to ask about, columns as chamfer_deg")
    ] = None,
    out: Annotated[Path | None, typer.Option(help="with --designs: CSV of the answers")] = None,
    set_: Sets = None,
    json: Json = False,
) -> None:
    """Quick check of one design, or predicted times of many, without simulating them.

    The time is expected over the study's operating points, or at the one that is given. Of a
    table the answers go beside it, into NAME-times.csv; status 1 if a row is no design at all.

    Example: dogshape check mq200 --set dog.chamfer_deg=14 --set dog.count=18
    """
    given = load_study(study, set_)
    require_targets({"--out": out})
    mix = mix_over(given, points_of(given, mismatch_rpm, force_N))
    stored, path = stored_surrogate(given, surrogate)
    if designs is not None:
        data = ask_many(given, stored.surrogate, mix, designs, out)
        for line in filled_lines(data):
            say(line)
        emit(data, json, lambda: many_text(data))
        if data["impossible"]:
            raise typer.Exit(1)
        return
    if out is not None:
        raise InputError("--out is for the answers to --designs; give both or neither")
    model = stored.surrogate
    answer = ask(model, given.prototype, mix, given.physics)
    design = design_of(given, {})
    within = margins_within(given, design)
    spread = time_spread(given, model, given.prototype, mix)
    record = {
        **_answer_record(answer, mix),
        "q2": stored.validation.q2,
        "surrogate": str(path),
        "time_within_tolerances": spread_record(spread),
        "feasible": design.feasible,
        "not_checked": design.not_checked,
        "checks": checks_within(design, within),
    }
    held = blocking_force(given.clutch.dog, given.limits.load)

    def text() -> RenderableType:
        table = strength_table(design.checks, within, held, notes_of(given))
        return answer_text(answer, stored.validation, spread, table)

    emit(record, json, text)
    if not design.feasible:
        raise typer.Exit(1)


def _answer_record(answer: Answer, mix: Mix) -> dict[str, Any]:
    expected = answer.expected
    return {
        "expected_shift_time_s": expected.time,
        "low_s": expected.low,
        "high_s": expected.high,
        "standard_error_s": expected.error,
        "sd_s": expected.sd,
        "engaged": expected.engaged,
        "operating_points": len(mix.points),
        "in_range": answer.in_range,
        "distance": answer.distance,
        "warnings": list(answer.warnings),
    }
