"""All simulated designs side by side: a line for each, over variables, objectives and margin.

Plotly's own figure of this kind tells lines by colour alone; here the dash tells too, and the
designs that matter are named at the end of their line.
"""

from __future__ import annotations

from dataclasses import dataclass
from textwrap import wrap

import plotly.graph_objects as go

from dogshape.pipeline.config.study_file import VARIABLES
from dogshape.pipeline.reports.kit.look import BLUE, GREY, INK, LINES, MARKS, Row, styled
from dogshape.pipeline.reports.study.design_names import describe, design_name, of_kinds
from dogshape.pipeline.reports.study.goals import MARGIN, Goal, Goals, goals_of
from dogshape.pipeline.reports.surrogate.variable_labels import label
from dogshape.pipeline.simulate.design import OBJECTIVES, SIMULATED
from dogshape.sim.units import unit_of

#: Lines of each kind in the order in which they are drawn.
LOOKS: dict[str, tuple[Row, Row]] = {
    "lands too hard": ({"color": GREY, "dash": "dot", "width": 1}, {"size": 1}),
    "dominated": ({"color": GREY, "dash": "solid", "width": 1}, {"size": 1}),
    "front": ({"color": BLUE, "dash": "dot", "width": 2}, {**MARKS["front"], "size": 7}),
    "prototype": (LINES["prototype"], {**MARKS["prototype"], "size": 13}),
    "chosen": ({**LINES["chosen"], "width": 3.5}, {**MARKS["chosen"], "size": 12}),
}
APART = 0.065  #: least distance of two names, in shares of an axis
LETTER = 8  #: width of a letter of a name, px


@dataclass(frozen=True)
class Axis:
    """One upright axis: its key, title in lines, ends of its values and decimals."""

    name: str
    title: str
    low: float
    high: float

    def share(self, row: Row) -> float:
        """Return where on the axis a design lies, from 0 to 1."""
        span = self.high - self.low
        return (_value(row, self.name) - self.low) / span if span else 0.5


def parallel_figure(result: Row, variables: list[str]) -> go.Figure:
    """Draw every simulated design as a line over variables, objectives and smallest margin."""
    kinds = {
        kind: [row for row in rows if row[SIMULATED] is not None]
        for kind, rows in of_kinds(result).items()
    }
    every = [row for rows in kinds.values() for row in rows]
    goals = goals_of(result)
    names = dict.fromkeys([*variables, *(goal.name for goal in goals.told), MARGIN])
    axes = axes_of(every, goals, list(names))
    words = {row["trial"]: describe(row, variables, goals) for row in every}
    figure = go.Figure()
    for kind, (line, mark) in LOOKS.items():
        rows = kinds[kind]
        if rows:
            figure.add_trace(_lines(kind, rows, axes, words, (line, mark)))
    for place, axis in enumerate(axes):
        _upright(figure, place, axis)
    named = [row for kind in ("chosen", "prototype", "front") for row in kinds[kind]]
    _names(figure, named, axes)
    figure.update_xaxes(visible=False, range=[-0.5, len(axes) - 0.9])
    figure.update_yaxes(visible=False, range=[-0.12, 1.28])
    figure = styled(figure, 560)
    longest = max(len(design_name(row)) for row in named) if named else 0
    figure.update_layout(margin={"l": 10, "r": 20 + LETTER * longest, "b": 10})
    return figure


def axes_of(rows: list[Row], goals: Goals, names: list[str]) -> list[Axis]:
    """Return the axes over the values of some designs."""
    axes = []
    for name in names:
        values = [_value(row, name) for row in rows]
        axes.append(Axis(name, _title(name, goals), min(values), max(values)))
    return axes


def _value(row: Row, name: str) -> float:
    """Return a value as shown."""
    if name in OBJECTIVES:
        return Goal(OBJECTIVES[name], 0.0, False).shown(row)
    return float(row[name])


def _title(name: str, goals: Goals) -> str:
    """Return the title of an axis in short lines."""
    titles = {MARGIN: "smallest margin, %", **{goal.name: goal.title for goal in goals.told}}
    words = _variable(name) if name in VARIABLES else titles[name]
    return "<br>".join(wrap(words, 12, break_long_words=False))


def _variable(name: str) -> str:
    unit = unit_of(name).replace("deg", "°")
    return f"{label(name)}, {unit}" if unit else label(name)


def _lines(
    kind: str, rows: list[Row], axes: list[Axis], said: dict[int, str], look: tuple[Row, Row]
) -> go.Scatter:
    """Return the lines of one kind as one trace, broken between designs."""
    x: list[float | None] = []
    y: list[float | None] = []
    words: list[str] = []
    for row in rows:
        x += [*range(len(axes)), None]
        y += [*(axis.share(row) for axis in axes), None]
        words += [said[row["trial"]]] * (len(axes) + 1)
    line, mark = look
    mode = "lines+markers" if mark["size"] > 1 else "lines"
    return go.Scatter(
        x=x, y=y, text=words, hoverinfo="text", mode=mode, line=line, marker=mark,
        name=f"{kind} ({len(rows)})",
    )  # fmt: skip


def _upright(figure: go.Figure, place: int, axis: Axis) -> None:
    figure.add_shape(
        type="line",
        x0=place,
        x1=place,
        y0=0,
        y1=1,
        line={"color": INK, "width": 1},
        layer="below",
        opacity=1,
    )
    # Clear of the largest mark, which may lie at an end.
    for level, words in ((0.0, axis.low), (1.0, axis.high)):
        anchor = "bottom" if level else "top"
        said = _short(words).replace("-", "\N{MINUS SIGN}")
        figure.add_annotation(
            x=place, y=level, text=said, showarrow=False, yanchor=anchor,
            yshift=9 if level else -9, font={"size": 12},
        )  # fmt: skip
    figure.add_annotation(
        x=place, y=1.0, text=axis.title, showarrow=False, yanchor="bottom", yshift=28,
        font={"size": 13},
    )  # fmt: skip


def _short(number: float) -> str:
    return f"{number:.0f}" if abs(number) >= 1e3 else f"{number:.3g}"


def _names(figure: go.Figure, rows: list[Row], axes: list[Axis]) -> None:
    """Name designs at the right end of their lines, apart from each other."""
    rows = sorted(rows, key=axes[-1].share)
    for row, level in zip(rows, spread([axes[-1].share(row) for row in rows]), strict=True):
        figure.add_annotation(
            x=len(axes) - 1, y=level, text=design_name(row), showarrow=False, xanchor="left",
            xshift=12, font={"size": 13},
        )  # fmt: skip


def spread(levels: list[float]) -> list[float]:
    """Return rising levels moved apart by ``APART``, and down again from above the axis."""
    found: list[float] = []
    for level in levels:
        found.append(max(level, found[-1] + APART) if found else level)
    most = 1.0
    for place in reversed(range(len(found))):
        found[place] = min(found[place], most)
        most = found[place] - APART
    return found
