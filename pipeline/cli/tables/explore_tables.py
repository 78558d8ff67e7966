"""The page of a surrogate in a few lines."""

from __future__ import annotations

from typing import Any

from rich.console import Group, RenderableType
from rich.table import Table

from dogshape.pipeline.cli.console import columns
from dogshape.pipeline.reports.kit.text import axis, in_ms

Row = dict[str, Any]  #: a row of ``explore --json``


def explored_text(record: Row) -> RenderableType:
    """Return effects and indices of each variable, and where the page is."""
    effects, near = record["effects"], record["indices"][0]
    own = record["slices"][0]["operating"][0]
    time = own["reason"] or f"{in_ms(own['expected_shift_time_s'])} ms"
    sides = ", ".join(f"{axis(one['variable'])} {one['low']:.4g} to {one['high']:.4g}"
                      for one in near["inputs"])  # fmt: skip
    return Group(
        f"the study's own design: {time}",
        f"effects over {effects['designs']} feasible designs; indices over a box about the study's "
        f"own design, mean {in_ms(near['mean_s'])} ms, standard deviation {in_ms(near['sd_s'])} ms "
        f"({sides}):",
        _table(effects, near),
        f"page: {record['file']}",
    )


def _table(effects: Row, near: Row) -> Table:
    table = columns(
        "variable", "fastest at", "slowest less fastest, ms", "first-order index", "total index"
    )
    known = {effect["variable"]: effect for effect in effects["variables"]}
    for one in near["inputs"]:
        effect = known.get(one["variable"])
        table.add_row(
            axis(one["variable"]),
            f"{effect['fastest']:.4g}" if effect else "-",
            in_ms(effect["span_s"]) if effect else "-",
            *(f"{one[key]:.3f} ± {one[f'{key}_half_width']:.3f}" for key in ("first", "total")),
        )
    return table
