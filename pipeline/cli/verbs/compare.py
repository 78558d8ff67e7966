"""``compare``: designs, studies, results or contact sets side by side."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Group, RenderableType

from dogshape.pipeline.cli.console import columns, emit, verb
from dogshape.pipeline.cli.options import Json
from dogshape.pipeline.store.output_files import require_targets
from dogshape.side_by_side import SideBySide
from dogshape.side_by_side import compare as compare_items


@verb
def compare(
    items: Annotated[
        list[str], typer.Argument(metavar="A B ...", help="e.g. results/mq200#43, mq200")
    ],
    html: Annotated[Path | None, typer.Option(help="write the table as a page")] = None,
    json: Json = False,
) -> None:
    """Compare designs, studies, folders of results or contact sets with the first one.

    FOLDER#N and STUDY#N are designs. Without #N it is the one decided for, or chosen, or the
    study's own. Differences of times are paired where both were simulated at the same angles.

    Example: dogshape compare mq200#19 mq200#43 mq200#0 --html side.html
    """
    require_targets({"--html": html})
    found = compare_items(*items)
    if html is not None:
        found.report(html)
    emit({**found.to_dict(), "notes": found.notes}, json, lambda: _text(found, html))


def _text(found: SideBySide, html: Path | None) -> RenderableType:
    head, *rows = found.rows
    table = columns(*head)
    for row in rows:
        table.add_row(*row)
    written = [f"wrote {html}"] if html is not None else []
    return Group(table, *found.notes, *written)
