"""All simulated designs side by side: a line for each, over variables, objectives and margin.

Plotly's own figure of this kind tells lines by colour alone and names none; here the dash tells
too, and the designs that matter are named at the end of their line.
"""

from __future__ import annotations

from textwrap import wrap

import plotly.graph_objects as go

from dogshape.pipeline.reports.kit.look import BLUE, GREY, INK, LINES, MARKS, Row, styled
from dogshape.pipeline.reports.kit.text import axis, minus
from dogshape.pipeline.reports.study.designs import describe, design_name, of_kinds
from dogshape.pipeline.reports.study.goals import MARGIN, Goal, goals_of
from dogshape.pipeline.simulate.design import OBJECTIVES, SIMULATED

#: Lines and marks of each kind in the order in which they are drawn; size 1 is no mark.
LOOKS: dict[str, tuple[Row, Row]] = {
    "lands too hard": ({"color": GREY, "dash": "dot", "width": 1}, {"size": 1}),
    "dominated": ({"color": GREY, "dash": "solid", "width": 1}, {"size": 1}),
    "front": ({"color": BLUE, "dash": "dot", "width": 2}, {**MARKS["front"], "size": 7}),
    "prototype": (LINES["prototype"], {**MARKS["prototype"], "size": 13}),
    "chosen": ({**LINES["chosen"], "width": 3.5}, {**MARKS["chosen"], "size": 12}),
}
APART = 0.065  #: least distance of two names, in shares of an axis
LETTER = 8  #: width of a letter of a name, px


def parallel_figure(result: Row, variables: list[str]) -> go.Figure:
    """Draw every simulated design as a line over variables, objectives and smallest margin."""
    kinds = {
        kind: [row for row in rows if row[SIMULATED] is not None]
        for kind, rows in of_kinds(result).items()
    }
    every, goals = [row for rows in kinds.values() for row in rows], goals_of(result)
    titles = {MARGIN: "smallest margin, %", **{goal.name: goal.title for goal in goals.told}}
    names = list(dict.fromkeys([*variables, *(goal.name for goal in goals.told), MARGIN]))
    ends = {n: (min(v), max(v)) for n in names if (v := [_value(row, n) for row in every])}

    def shares(row: Row) -> list[float]:
        """Place a design on every axis, from 0 to 1."""
        return [(_value(row, n) - a) / (b - a) if b > a else 0.5 for n, (a, b) in ends.items()]

    figure = go.Figure()
    for kind, (line, mark) in LOOKS.items():
        if rows := kinds[kind]:  # one trace, broken between designs
            figure.add_scatter(
                x=[*range(len(names)), None] * len(rows),
                y=[share for row in rows for share in (*shares(row), None)],
                text=[describe(r, variables, goals) for r in rows for _ in range(len(names) + 1)],
                hoverinfo="text", line=line, marker=mark, name=f"{kind} ({len(rows)})",
                mode="lines+markers" if mark["size"] > 1 else "lines",
            )  # fmt: skip
    for place, (name, (low, high)) in enumerate(ends.items()):
        title = axis(name).replace(" deg", " °") if name in variables else titles[name]
        _upright(figure, place, "<br>".join(wrap(title, 12, break_long_words=False)), (low, high))
    named = [row for kind in ("chosen", "prototype", "front") for row in kinds[kind]]
    named.sort(key=lambda row: shares(row)[-1])
    for row, level in zip(named, spread([shares(row)[-1] for row in named]), strict=True):
        figure.add_annotation(
            x=len(names) - 1, y=level, text=design_name(row), showarrow=False, xanchor="left",
            xshift=12, font={"size": 13},
        )  # fmt: skip
    figure.update_xaxes(visible=False, range=[-0.5, len(names) - 0.9])
    figure.update_yaxes(visible=False, range=[-0.12, 1.28])
    longest = max((len(design_name(row)) for row in named), default=0)
    room = {"l": 10, "r": 20 + LETTER * longest, "b": 10}
    return styled(figure, 560).update_layout(margin=room)


def _value(row: Row, name: str) -> float:
    if name in OBJECTIVES:
        return Goal(OBJECTIVES[name], 0.0, False).shown(row)
    return float(row[name])


def _upright(figure: go.Figure, place: int, title: str, ends: tuple[float, float]) -> None:
    """Draw an axis with its ends, clear of the largest mark, and its title."""
    line = {"color": INK, "width": 1}
    figure.add_shape(
        type="line", x0=place, x1=place, y0=0, y1=1, line=line, layer="below", opacity=1
    )
    texts = [minus(f"{end:.0f}" if abs(end) >= 1e3 else f"{end:.3g}") for end in ends]
    for level, text, anchor, shift, size in (
        (0.0, texts[0], "top", -9, 12), (1.0, texts[1], "bottom", 9, 12),
        (1.0, title, "bottom", 28, 13),
    ):  # fmt: skip
        figure.add_annotation(
            x=place, y=level, text=text, showarrow=False, yanchor=anchor, yshift=shift,
            font={"size": size},
        )  # fmt: skip


def spread(levels: list[float]) -> list[float]:
    """Move rising levels apart by ``APART``, and down again from above the axis."""
    found: list[float] = []
    for level in levels:
        found.append(max(level, found[-1] + APART) if found else level)
    most = 1.0
    for place in reversed(range(len(found))):
        found[place] = min(found[place], most)
        most = found[place] - APART
    return found
