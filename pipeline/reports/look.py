"""The look of all figures: colours, marks that tell without colour, labels and units.

What a colour says, a marker or a dash says too, so that a page can be printed in grey.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import plotly.graph_objects as go

Row = dict[str, Any]  #: a part of result.json, whose schema is ``pipeline.search.result_schema``

INK = "#1b2733"
GREY = "#9aa5b1"
BLUE = "#1f5fa8"
ORANGE = "#c8590c"
GREEN = "#2e7d4f"
RED = "#b3261e"

#: Marks of the kinds of designs, the same in every figure.
MARKS: dict[str, Row] = {
    "dominated": {"color": GREY, "size": 8, "symbol": "circle-open"},
    "fails when simulated": {"color": INK, "size": 8, "symbol": "x-thin", "line": {"width": 1.5}},
    "infeasible": {"color": INK, "size": 8, "symbol": "triangle-down-open"},
    "front": {"color": BLUE, "size": 10, "symbol": "circle"},
    "chosen": {
        "color": BLUE, "size": 17, "symbol": "diamond", "line": {"color": INK, "width": 1.5},
    },
    "prototype": {
        "color": ORANGE, "size": 18, "symbol": "star", "line": {"color": INK, "width": 1},
    },
}  # fmt: skip
#: Lines of the two designs that are compared.
LINES: dict[str, Row] = {
    "prototype": {"color": ORANGE, "dash": "dash", "width": 2.5},
    "chosen": {"color": BLUE, "dash": "solid", "width": 2.5},
}


def styled(figure: go.Figure, height: int) -> go.Figure:
    """Give a figure the look of all pages and its height in px."""
    figure.update_layout(
        template="simple_white",
        height=height,
        font={"family": "system-ui, sans-serif", "size": 14, "color": INK},
        margin={"l": 70, "r": 20, "t": 40, "b": 60},
        legend={"orientation": "h", "y": 1.02, "yanchor": "bottom", "x": 0},
        hoverlabel={"align": "left"},
    )
    return figure


def window(values: Sequence[float]) -> tuple[float, float]:
    """Return a range that shows ``values`` with room on either side."""
    low, high = min(values), max(values)
    room = 0.12 * (high - low) or 0.1 * abs(high) or 1.0
    return low - room, high + room
