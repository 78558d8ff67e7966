"""``compare``: designs, studies, results or contact sets side by side."""

from __future__ import annotations

from typing import Annotated, Any

import typer
from rich.table import Table

from dogshape.cli.console import columns, emit, verb
from dogshape.cli.options import Json
from dogshape.pipeline.config.set_point import OPERATED
from dogshape.pipeline.reports.kit.text import axis, check_name, percent
from dogshape.pipeline.reports.study.design_record import ms_or_dash, words_of
from dogshape.side_by_side import SideBySide
from dogshape.side_by_side import compare as compare_items
from dogshape.sim.clutch_tables import DogSection

OPERATION = ("contact", "material", "operating_points", "engine")


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
    """Return a column for each item: shape, times, margins, and keys that differ."""
    table = columns("", *(item["label"] for item in found.items))
    every = [_rows(item) for item in found.items]
    for title in dict.fromkeys(title for rows in every for title in rows):
        table.add_row(title, *(rows.get(title, "-") for rows in every))
    return table


def _rows(item: dict[str, Any]) -> dict[str, str]:
    """Write an item as titles and cells."""
    if "margins" not in item:  # a contact set
        return {check_name(k): f"{v:.4g}" for k, v in item.items() if k != "label"}
    apart = item["difference_s"], item["difference_standard_error_s"]
    shape = [key for key in (*DogSection.model_fields, *OPERATED) if item.get(key) is not None]
    return {
        **{axis(key): f"{item[key]:.4g}" for key in shape},
        **words_of(item),
        "difference, ms": ms_or_dash(*apart, "+"),
        **{check_name(key): str(item[key]) for key in OPERATION},
        **{key: "-" if value is None else str(value) for key, value in item["settings"].items()},
        **{
            f"margin, {check_name(key)}": "-" if one is None else percent(one)
            for key, one in item["margins"].items()
        },
    }
