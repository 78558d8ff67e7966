"""The front: every design by its objectives, and how sure each place on it is."""

from __future__ import annotations

import plotly.graph_objects as go
from plotly.subplots import make_subplots

from dogshape.pipeline.reports.kit.look import BLUE, INK, MARKS, Row, styled, window
from dogshape.pipeline.reports.study.design_names import describe, design_name, of_kinds
from dogshape.pipeline.reports.study.goals import Goal, Goals, goals_of
from dogshape.pipeline.reports.study.point_labels import Label, Span, Taken, write_labels
from dogshape.pipeline.simulate.design import SIMULATED

PALE = "#b9c9dd"
LEAST, LARGEST = 9.0, 36.0  #: sizes of marks that show a third objective, px
MAIN, ASIDE = 1.0, 0.15  #: widths of all panels together, and of each beside the main one
EMPTY = 1.0 / 3.0  #: share of the axis that may be empty before the prototype has its own panel
CHOICES = ("front", "prototype", "chosen")  #: kinds of designs that are named


def front_figure(result: Row, variables: list[str], other: str) -> go.Figure:
    """Draw the leading objective against another one, infeasible designs beside it."""
    kinds, goals = of_kinds(result), goals_of(result)
    lead, second = goals.leading, goals.named(other)
    barred = [row for row in kinds["infeasible"] if row.get(other) is not None]
    seen = _simulated(kinds)
    y = window([second.shown(row) for row in seen + barred])
    rest = [
        row
        for row in [*kinds["dominated"], *kinds["lands too hard"]]
        if row[SIMULATED] is not None and y[0] < second.shown(row) < y[1]
    ]
    far = _far_prototype(kinds["prototype"], [*kinds["front"], *kinds["chosen"], *rest], lead)
    widths = [MAIN - ASIDE * (bool(far) + bool(barred)), *[ASIDE] * (bool(far) + bool(barred))]
    figure = make_subplots(
        1, len(widths), shared_yaxes=True, column_widths=widths, horizontal_spacing=0.02
    )
    if len(goals.every) == 2:
        figure.add_trace(_stairs(result["front"], lead, second), 1, 1)
    for kind, rows in kinds.items():
        if rows and kind != "infeasible" and rows[0][SIMULATED] is not None:
            column = 2 if far and kind == "prototype" else 1
            figure.add_trace(_designs(kind, rows, second, variables, goals), 1, column)
    if barred:
        figure.add_trace(_not_simulated(barred, second, variables, goals), 1, len(widths))
        figure.update_xaxes(tickangle=0, col=len(widths))
    near = [row for row in seen if row not in far]
    x = window([lead.shown(row) for row in ([*near, *rest] if far else near)])
    chosen = kinds["chosen"]
    labels = [
        Label(
            f"<b>chosen: {design_name(row)}</b>" if row in chosen else _short(row),
            (lead.shown(row), second.shown(row)),
        )
        for row in near
    ]
    marks = [(lead.shown(row), second.shown(row)) for row in rest]
    taken = Taken(marks, _lines(near, lead, second), share=widths[0] / MAIN)
    write_labels(figure, labels, x, y, taken, row=1, col=1)
    figure.update_xaxes(title=lead.axis, range=x, col=1)
    figure.update_yaxes(title=second.axis, range=y, col=1)
    for row in far:
        _write_far(figure, row, lead, second)
    return styled(figure, 520)


def _far_prototype(prototype: list[Row], others: list[Row], lead: Goal) -> list[Row]:
    """List the prototype where it would leave more than ``EMPTY`` of the axis without a design."""
    own = [row for row in prototype if row[SIMULATED] is not None]
    values = [lead.shown(row) for row in others]
    if not own or not values:
        return []
    at = lead.shown(own[0])
    return own if at - max(values) > EMPTY * (at - min(values)) else []


def _write_far(figure: go.Figure, row: Row, lead: Goal, second: Goal) -> None:
    """Give the prototype its name and an axis of its own, in the second panel."""
    at = lead.shown(row)
    room = 1.6 * max(abs(end - at) for end in lead.interval(row)) or 0.1 * abs(at)
    figure.update_xaxes(
        title={"text": "axis broken", "font": {"size": 12}}, range=[at - room, at + room],
        tickvals=[at], ticktext=[f"{at:.3g}"], tickangle=0, col=2,
    )  # fmt: skip
    figure.add_annotation(
        x=at, y=second.shown(row), text=_short(row), ax=0, ay=30, showarrow=True, arrowhead=0,
        arrowwidth=1, arrowcolor=INK, standoff=9, font={"size": 14}, row=1, col=2,
    )  # fmt: skip


def third_figure(result: Row, variables: list[str], second: str, third: str) -> go.Figure:
    """Draw the front by leading objective and ``second``; size and a number are ``third``."""
    kinds, goals = of_kinds(result), goals_of(result)
    lead, up, size = goals.leading, goals.named(second), goals.named(third)
    values = [size.shown(r) for rows in kinds.values() for r in rows if r[SIMULATED] is not None]
    low, high = min(values), max(values)
    figure = go.Figure()
    for kind in ("dominated", *CHOICES):
        rows = [row for row in kinds[kind] if row[SIMULATED] is not None]
        if not rows:
            continue
        trace = _designs(kind, rows, up, variables, goals)
        share = [(size.shown(row) - low) / ((high - low) or 1.0) for row in rows]
        sizes = [LEAST + (LARGEST - LEAST) * part for part in share]
        trace.marker = {**trace.marker.to_plotly_json(), "size": sizes, "opacity": 0.75}
        trace.error_x = trace.error_y = None
        figure.add_trace(trace)
    seen = _simulated(kinds)
    x = window([lead.shown(row) for row in seen])
    y = window([up.shown(row) for row in seen])
    named = [(f"{_short(row)}: {size.number(size.shown(row))}", row) for row in seen]
    labels = [Label(words, (lead.shown(row), up.shown(row))) for words, row in named]
    rest = [(lead.shown(row), up.shown(row)) for row in kinds["dominated"]]
    write_labels(figure, labels, x, y, Taken(rest, half=LARGEST / 2.0 + 3.0))
    figure.update_xaxes(title=lead.axis, range=x)
    figure.update_yaxes(title=up.axis, range=y)
    figure = styled(figure, 520)
    figure.update_layout(legend={"itemsizing": "constant"})
    return figure


def sure_figure(result: Row) -> go.Figure:
    """Draw the 95 % interval of each design of the front and, if known, its probability."""
    rows, lead = list(reversed(result["front"])), goals_of(result).leading
    known = all("probability_on_front" in row for row in rows)
    figure = make_subplots(
        1, 2 if known else 1, shared_yaxes=True, column_widths=[0.62, 0.38] if known else [1.0],
        horizontal_spacing=0.03,
    )  # fmt: skip
    names = [_front_name(row, result) for row in rows]
    figure.add_scatter(
        x=[lead.shown(row) for row in rows], y=names, mode="markers",
        error_x={**_bars(rows, lead), "thickness": 2, "width": 6},
        marker={"color": BLUE, "size": 10, "symbol": "circle"}, name="search, 95 % interval",
        hovertemplate=f"%{{y}}: %{{x:.4g}} {lead.unit}<extra></extra>", row=1, col=1,
    )  # fmt: skip
    for place in confirmed_values(result, names):
        figure.add_trace(place, 1, 1)
    if known:
        figure.add_trace(_probabilities(rows, names), 1, 2)
        figure.update_xaxes(title="probability on the front", range=[0, 1.19], tickformat=".0%",
                            tickvals=[0, 0.25, 0.5, 0.75, 1], col=2)  # fmt: skip
    figure.update_xaxes(title=lead.axis, col=1)
    figure = styled(figure, 150 + 40 * len(rows))
    figure.update_layout(margin={"l": 150})
    return figure


def confirmed_values(result: Row, names: list[str]) -> list[go.Scatter]:
    """Return the leading objective at fresh angles of designs that have it, one trace or none."""
    found, lead = confirmed_designs(result), goals_of(result).leading
    rows = [row for row in reversed(result["front"]) if row["trial"] in found]
    if not rows:
        return []
    by_trial = {row["trial"]: n for row, n in zip(reversed(result["front"]), names, strict=True)}
    mark = {"color": "white", "size": 10, "symbol": "square", "line": {"color": INK, "width": 2}}
    fresh = [lead.estimate(found[row["trial"]]) for row in rows]
    return [
        go.Scatter(
            x=[value for value, _ in fresh],
            y=[by_trial[row["trial"]] for row in rows],
            error_x={"array": [1.96 * error for _, error in fresh], "color": INK},
            mode="markers",
            marker=mark,
            name="fresh angles, 95 % interval",
            hovertemplate=f"%{{y}}, fresh angles: %{{x:.4g}} {lead.unit}<extra></extra>",
        )
    ]


def confirmed_designs(result: Row) -> dict[int, Row]:
    """Return what the confirmation found for designs of the front, by trial."""
    confirmation = result["confirmation"]
    return {} if not confirmation else {one["trial"]: one for one in confirmation["designs"]}


def _front_name(row: Row, result: Row) -> str:
    return design_name(row) + (" (chosen)" if row["trial"] == result["best"]["trial"] else "")


def _probabilities(rows: list[Row], names: list[str]) -> go.Bar:
    shares = [row["probability_on_front"] for row in rows]
    return go.Bar(
        x=shares, y=names, orientation="h", name="probability on the front", width=0.5,
        marker={"color": PALE, "line": {"color": INK, "width": 1}, "pattern": {"shape": "/"}},
        text=[f"{share:.0%}" for share in shares], textposition="outside", cliponaxis=False,
        hovertemplate="%{y}: %{x:.0%}<extra></extra>",
    )  # fmt: skip


def _stairs(front: list[Row], lead: Goal, second: Goal) -> go.Scatter:
    """Return the border of what the front dominates; it runs away from the best design."""
    return go.Scatter(
        x=[lead.shown(row) for row in front],
        y=[second.shown(row) for row in front],
        mode="lines",
        line={"color": BLUE, "shape": "hv", "width": 1.5},
        showlegend=False,
        hoverinfo="skip",
        name="border of the front",
    )


def _bars(rows: list[Row], goal: Goal) -> Row:
    """Return the 95 % intervals of designs as error bars."""
    pairs = [(goal.shown(row), goal.interval(row)) for row in rows]
    return {
        "type": "data",
        "array": [high - value for value, (_, high) in pairs],
        "arrayminus": [value - low for value, (low, _) in pairs],
    }


def _lines(rows: list[Row], lead: Goal, second: Goal) -> list[tuple[Span, Span]]:
    """Return the ends of the error bars of designs, of both objectives."""
    found = []
    for row in rows:
        at = lead.shown(row), second.shown(row)
        for place, goal in enumerate((lead, second)):
            if goal.error(row):
                low, high = goal.interval(row)
                found.append(((low, at[1]), (high, at[1])) if place == 0 else
                             ((at[0], low), (at[0], high)))  # fmt: skip
    return found


def _designs(
    kind: str, rows: list[Row], second: Goal, variables: list[str], goals: Goals
) -> go.Scatter:
    look = {"thickness": 1.2, "width": 3, "color": INK if kind in CHOICES else PALE}
    unsure = [any(goal.error(row) for row in rows) for goal in (goals.leading, second)]
    if all(unsure) and kind not in CHOICES:
        unsure = [False, False]  # crosses of many designs would hide those of the front
    return go.Scatter(
        x=[goals.leading.shown(row) for row in rows],
        y=[second.shown(row) for row in rows],
        error_x={**_bars(rows, goals.leading), **look} if unsure[0] else None,
        error_y={**_bars(rows, second), **look} if unsure[1] else None,
        name=kind,
        mode="markers",
        marker=MARKS[kind],
        text=[describe(row, variables, goals) for row in rows],
        hoverinfo="text",
    )


def _not_simulated(
    barred: list[Row], second: Goal, variables: list[str], goals: Goals
) -> go.Scatter:
    return go.Scatter(
        x=["not<br>simulated"] * len(barred),
        y=[second.shown(row) for row in barred],
        mode="markers",
        name="infeasible",
        marker=MARKS["infeasible"],
        text=[describe(row, variables, goals) for row in barred],
        hoverinfo="text",
    )


def _simulated(kinds: dict[str, list[Row]]) -> list[Row]:
    """Return the designs that are named and were simulated."""
    order = reversed(CHOICES)  # the first has the best place for its name
    return [row for kind in order for row in kinds[kind] if row[SIMULATED] is not None]


def _short(row: Row) -> str:
    """Return the name that stands beside a mark: the number, or in bold the prototype."""
    return "<b>prototype</b>" if row["prototype"] else str(row["trial"])
