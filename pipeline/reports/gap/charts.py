"""Bars and intervals of the report: causes, gaps before and after, bounds, phases."""

from __future__ import annotations

from collections.abc import Sequence

import plotly.graph_objects as go

from dogshape.diagnosis.diagnosis import Diagnosis
from dogshape.diagnosis.inference.parameter_intervals import Bound
from dogshape.diagnosis.prediction.hypotheses import NONE
from dogshape.diagnosis.report.phase_times import PhaseGap
from dogshape.diagnosis.report.wording import between, chance, ms, quantity, shown
from dogshape.pipeline.reports.gap.hypothesis_cards import by_chance, short, shown_hypotheses
from dogshape.pipeline.reports.gap.point_rows import NINETY
from dogshape.pipeline.reports.kit.look import BLUE, GREY, INK, ORANGE, Row, styled
from dogshape.pipeline.reports.kit.text import minus
from dogshape.sim.effect import Parameter

_Bar = tuple[str, float, str]  #: name, value and words of a bar
#: Bars that differ without colour.
SOLID: Row = {"color": BLUE, "line": {"color": INK, "width": 1}}
HOLLOW: Row = {"color": "white", "line": {"color": INK, "width": 1}}
HATCHED: Row = {
    "color": ORANGE, "line": {"color": INK, "width": 1},
    "pattern": {"shape": "/", "fgcolor": "white", "size": 7},
}  # fmt: skip


def causes_figure(found: Diagnosis) -> go.Figure:
    """Draw the probability of each plausible hypothesis, the 90 % set filled."""
    shown_ones = shown_hypotheses(found)
    figure = go.Figure()
    for name, marker, inside in (("in the 90 % set", SOLID, True), ("outside", HOLLOW, False)):
        those = [h for h in shown_ones if (h in found.verdict.credible) == inside]
        if those:
            chances = [(short(found, h), found.posterior[h]) for h in those]
            _bars(figure, name, [(words, p, chance(p)) for words, p in chances], marker)
    names = [short(found, h) for h in shown_ones]
    figure.update_layout(barmode="overlay", legend={"traceorder": "normal"})
    figure.update_yaxes(categoryorder="array", categoryarray=names[::-1])
    fifths = [0.0, 0.2, 0.4, 0.6, 0.8, 1.0]
    figure.update_xaxes(title="probability", range=[0.0, 1.12], tickformat=".0%", tickvals=fifths)
    return _tall(figure, len(names), row_height(names))


def held_out_figure(found: Diagnosis) -> go.Figure:
    """Draw the gap before, after on points held out, with the best rival, and the floor."""
    gaps = found.before_after
    rows = [("no effect (before)", gaps.baseline, HATCHED)]
    if found.leading != NONE:
        rows.append((short(found, found.leading), gaps.held_out, SOLID))
    if found.rival is not None:
        rows.append(
            (f"best rival: {short(found, found.rival[0])}", found.rival[1].held_out, HOLLOW)
        )
    rows.append((*by_chance(found), {**HOLLOW, "color": GREY}))
    figure = go.Figure()
    known = [(name, value, marker) for name, value, marker in rows if value is not None]
    for name, value, marker in known:
        _bars(figure, name, [(name, 1e3 * value, ms(value))], marker)
    figure.update_layout(barmode="overlay", showlegend=False)
    figure.update_yaxes(categoryorder="array", categoryarray=[name for name, *_ in known][::-1])
    most = max((1e3 * value for _, value, _ in known), default=1.0)
    figure.update_xaxes(title="root-mean-square gap, ms", range=[0.0, 1.18 * most])
    return _tall(figure, len(known), row_height([name for name, *_ in known]))


def _bars(figure: go.Figure, name: str, bars: Sequence[_Bar], marker: Row) -> None:
    names, values, words = (list(column) for column in zip(*bars, strict=True))
    figure.add_bar(
        y=names, x=values, name=name, orientation="h", marker=marker, width=0.6,
        text=words, textposition="outside", cliponaxis=False,
        hovertemplate="%{y}: %{text}<extra></extra>",
    )  # fmt: skip


def row_height(names: Sequence[str]) -> int:
    """Return the height of a row that has room for the lines of any name, px; on paper too."""
    lines = max((1 + name.count("<br>") for name in names), default=1)
    return max(54, 14 + 22 * lines)


def _tall(figure: go.Figure, rows: int, each: int) -> go.Figure:
    figure = styled(figure, 120 + each * rows)
    figure.update_yaxes(automargin=True, ticks="")
    return figure


def bounds_figure(found: Diagnosis) -> go.Figure:
    """Draw the share of its prior that each effect may still have, on its own."""
    rows = sorted(_ranges(found), key=lambda row: (not row[2].informed, row[4] - row[3]))
    figure = go.Figure()
    figure.update_layout(showlegend=True)
    for informed, dash, color, width in ((True, "solid", BLUE, 7), (False, "dot", GREY, 4)):
        those = [row for row in rows if row[2].informed == informed]
        if those:
            _spans(figure, those, {"dash": dash, "color": color, "width": width})
    setting = found.scored[NONE].space.setting
    parameters = [found.effects[name].parameters[0] for name in found.bounds]
    figure.add_scatter(
        x=[p.share(p.neutral_of(setting)) for p in parameters],
        y=[found.effects[name].plain for name in found.bounds], mode="markers",
        name="no effect", hoverinfo="skip",
        marker={"symbol": "diamond-open", "size": 10, "color": INK},
    )  # fmt: skip
    for name, words, *_ in rows:
        figure.add_annotation(
            x=1.04, y=name, text=words, showarrow=False, xanchor="left",
            font={"size": 13},
        )  # fmt: skip
    names = [row[0] for row in rows]
    figure.update_yaxes(categoryorder="array", categoryarray=names[::-1], type="category")
    ends = ["low end", "middle", "high end"]
    figure.update_xaxes(
        range=[-0.03, 1.95], tickvals=[0.0, 0.5, 1.0], ticktext=ends, showgrid=True,
        title="within the range held possible before",
    )  # fmt: skip
    return _tall(figure, len(names), 27)


_Range = tuple[str, str, Bound, float, float]  #: name, words, bound and its ends as shares


def _ranges(found: Diagnosis) -> list[_Range]:
    rows = []
    for name, bound in found.bounds.items():
        parameter = found.effects[name].parameters[0]
        ends = parameter.share(bound.low), parameter.share(bound.high)
        many = len(found.effects[name].parameters) > 1
        words = _bound_words(parameter, bound, quantity(parameter.name) if many else "")
        rows.append((found.effects[name].plain, words, bound, *ends))
    return rows


def _spans(figure: go.Figure, rows: Sequence[_Range], line: dict[str, object]) -> None:
    """Draw a line for each range; at least a hundredth wide, so that it is seen."""
    x: list[float | None] = []
    y: list[str | None] = []
    for name, _, _, low, high in rows:
        x += [low, max(high, low + 0.01), None]
        y += [name, name, None]
    known = rows[0][2].informed
    figure.add_scatter(
        x=x, y=y, mode="lines", line=line, hoverinfo="skip",
        name="may still be (95 %)" if known else "no information",
    )  # fmt: skip


def _bound_words(parameter: Parameter, bound: Bound, name: str) -> str:
    if not bound.informed:
        return "no information"
    neutral = parameter.neutral
    if not callable(neutral) and neutral <= parameter.low:
        high, unit = shown(parameter.name, bound.high)
        return f"{name} at most {high:.3g} {unit}".strip()
    return f"{name} {minus(between(parameter.name, bound.low, bound.high))}".strip()


def phases_figure(phases: Sequence[PhaseGap]) -> go.Figure:
    """Draw the mean duration of each phase on the bench and in the simulation, ms."""
    figure = go.Figure()
    names = [phase.name for phase in phases]
    sides = (
        ("simulation", HATCHED, [p.simulated_mean for p in phases]),
        ("bench", SOLID, [p.bench_mean for p in phases]),
    )
    for name, marker, means in sides:
        figure.add_bar(
            x=names, y=[1e3 * mean for mean in means], name=name, marker=marker,
            hovertemplate=f"{name}, %{{x}}: %{{y:.1f}} ms<extra></extra>",
        )  # fmt: skip
    for phase in phases:
        top = 1e3 * max(phase.bench_mean, phase.simulated_mean)
        figure.add_annotation(
            x=phase.name, y=top, text=phase_words(phase), showarrow=False, yshift=14,
        )  # fmt: skip
    figure.update_layout(barmode="group")
    figure.update_yaxes(title="mean duration, ms", rangemode="tozero")
    return styled(figure, 360)


def phase_words(phase: PhaseGap) -> str:
    """Print the gap of a phase with its 90 % interval, ms."""
    return minus(f"{1e3 * phase.gap:+.1f} ± {NINETY * 1e3 * phase.standard_error:.1f}")
