"""``check``: designs at once, by their closed forms and the compiled engine or a surrogate.

Whoever asks a surrogate often wants the answer at once, so nothing slow to load belongs here.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from dogshape.check import check_design
from dogshape.cli.console import say, show, verb
from dogshape.cli.options import (
    Engine,
    Json,
    OneForce,
    OneMismatch,
    Sets,
    StudyArg,
    SurrogateFile,
    with_engine,
)
from dogshape.pipeline.config.study_file import load_study
from dogshape.pipeline.store.folder import require_targets
from dogshape.pipeline.train.design_table import beside
from dogshape.predictions import predict_designs
from dogshape.sim.errors import InputError


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
    engine: Engine = None,
    set_: Sets = None,
    json: Json = False,
) -> None:
    """Quick check of one design, or predicted times of many.

    The time is expected over the study's operating points, or at the one that is given. The
    compiled engine simulates one design in seconds, landing included, and the surrogate's
    prediction stands beside it; --surrogate FILE answers at once, without the landing. A table is
    the surrogate's: answers go beside it, into NAME-times.csv; status 1 if a row has no answer.

    Example: dogshape check mq200 --set dog.chamfer_deg=14 --set dog.count=18
    """
    given = load_study(study, with_engine(set_, engine))
    require_targets({"--out": out})
    asked = {"mismatch_rpm": mismatch_rpm, "force_N": force_N}
    if designs is not None:
        target = out or beside(designs)
        many = predict_designs(given, designs, target, **asked, surrogate=surrogate)
        for line in many.notes:
            say(line)
        show(many, json)
        if many.to_dict()["impossible"]:
            raise typer.Exit(1)
        return
    if out is not None:
        raise InputError("--out is for the answers to --designs; give both or neither")
    found = check_design(given, **asked, surrogate=surrogate)
    show(found, json)
    if not found.feasible:
        raise typer.Exit(1)
