"""``compare``: designs, studies, results or contact sets side by side."""

from __future__ import annotations

from typing import Annotated, Any

import typer
from rich.table import Table

from dogshape.pipeline.cli.console import columns, emit, verb
from dogshape.pipeline.cli.options import Json
from dogshape.pipeline.reports.kit.text import check_name, label, percent
from dogshape.side_by_side import SideBySide
from dogshape.side_by_side import compare as compare_items
from dogshape.sim.units import unit_of


@verb
def compare(
    items: Annotated[
        list[str], typer.Argument(metavar="A B ...", help="e.g. results/mq200#43, mq200")
    ],
    json: Json = False,
) -> None:
    """Compare designs, studies, folders of results or contact sets with the first one.

    FOLDER#N and STUDY#N are designs. Without #N it is the chosen one, or the study's own.
    Differences are to the first item, with the error of independent means.

    Example: dogshape compare mq200#19 mq200#43 mq200#0
    """
    found = compare_items(*items)
    emit(found.to_dict(), json, lambda: _table(found))


def _table(found: SideBySide) -> Table:
    """Return the frame of the items as a table, times in ms and margins in percent."""
    frame = found.to_frame()
    table = columns("", *frame.columns)
    for key, values in frame.iterrows():
        table.add_row(_title(str(key)), *(_cell(str(key), value) for value in values))
    return table


def _title(key: str) -> str:
    table, _, name = key.rpartition(".")
    if table.startswith("settings"):
        return key.removeprefix("settings.")
    if table == "margins":
        return f"margin, {check_name(name)}"
    unit = unit_of(name).replace("s", "ms") if name.endswith("_s") else unit_of(name)
    words = label(name) if label(name) != name else check_name(name)
    return ", ".join(part for part in (table.replace("_", " "), words, unit) if part)


def _cell(key: str, value: Any) -> str:
    if value is None or value != value:  # noqa: PLR0124  # what another item alone has
        return "-"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, (str, list)):
        return str(value)
    if "margin" in key and not key.startswith("settings"):
        return percent(value)
    in_ms = key.endswith("_s") and not key.startswith("settings")
    return f"{1e3 * value:.2f}" if in_ms else f"{value:.4g}"
