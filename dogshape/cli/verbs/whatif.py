"""``whatif``: the live page of a study, times and checks at once."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Annotated

import typer

from dogshape.cli.console import emit, verb
from dogshape.cli.options import Json, Sets, StudyArg, SurrogateFile
from dogshape.pipeline.config.study_file import load_study
from dogshape.whatif import WhatIf, write_what_if


@verb
def whatif(
    study: StudyArg,
    surrogate: SurrogateFile = None,
    out: Annotated[Path | None, typer.Option(help="default: results/NAME/whatif.html")] = None,
    set_: Sets = None,
    json: Json = False,
) -> None:
    """Live page: move a number, and see section, expected time and all checks at once.

    The page is one file that opens without a network. It has fields and sliders for the numbers of
    the dogs, one operating point and friction, and begins with any design of the front. The study's
    own design is simulated first, in seconds; other times are the surrogate's ('dogshape fit').

    Example: dogshape whatif mq200_paper --out whatif.html
    """
    given = load_study(study, set_)
    command = shlex.join([str(study), *(f"--set={one}" for one in set_ or ())])
    found = write_what_if(given, out, surrogate, command)
    emit(found.to_dict(), json, lambda: _text(found))


def _text(found: WhatIf) -> str:
    cautions = [f"warning: {one}" for one in found.warnings]
    return "\n".join([*cautions, f"page: {found.page}"])
