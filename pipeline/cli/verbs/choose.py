"""``choose``: the decision for a design, and its folder for the workshop."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from dogshape.decision import choose_design
from dogshape.pipeline.cli.console import emit, verb
from dogshape.pipeline.cli.options import Json


@verb
def choose(
    directory: Annotated[Path, typer.Argument(metavar="DIR", help="folder of a study's results")],
    design: Annotated[int, typer.Option(min=0, help="its number in the report; 0: the prototype")],
    why: Annotated[str, typer.Option(help="reason, for the report and the data sheet")],
    force: Annotated[
        bool, typer.Option("--force", help="decide again; earlier decisions are kept")
    ] = False,
    json: Json = False,
) -> None:
    """Decide for a design: the report says so, and DIR/decision is for the workshop.

    That folder holds the dimensioned section, one ring for print, both for CAD where the extra
    [cad] is installed, and a data sheet that prints on one page.

    Example: dogshape choose results/mq200 --design 43 --why "no slow point, lets go up to 0.19"
    """
    record = choose_design(directory, design, why, force=force).to_dict()
    emit(record, json, lambda: _text(record))


def _text(record: dict[str, Any]) -> str:
    lines = [f"decided for design {record['design']}: {record['why']}"]
    lines += [f"wrote {record['folder']}/{name}" for name in record["files"]]
    lines += [f"warning: {note}" for note in record["notes"]]
    lines += [f"report: {record['report']}"] if record["report"] else []
    return "\n".join(lines)
