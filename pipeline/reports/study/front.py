"""The front: every design by its objectives, and how sure each place on it is."""

from __future__ import annotations

from collections.abc import Sequence

import plotly.graph_objects as go
from plotly.subplots import make_subplots

from dogshape.pipeline.reports.kit.look import BLUE, INK, MARKS, Row, styled, window
from dogshape.pipeline.reports.study.designs import (
    as_searched,
    confirmed_designs,
    describe,
    design_name,
    is_measured,
    of_kinds,
)
from dogshape.pipeline.reports.study.goals import Goal, Goals, goals_of

PALE = "#b9c9dd"
LEAST, LARGEST = 9.0, 36.0  #: sizes of marks that show a third objective, px
MAIN, ASIDE = 1.0, 0.15  #: widths of all panels together, and of each beside the main one
EMPTY = 1.0 / 3.0  #: share of the axis that may be empty before the prototype has its own panel
CHOICES = ("front", "prototype", "chosen")  #: kinds of designs that are named
STEPS = (20.0, 36.0, 54.0)  #: distances of a name from its mark that are tried, px
MARK, HIGH = 9.0, 10.0  #: half sizes of a mark and of a name's height, px
LETTER = 8.0  #: width of a letter, px
PLOT = (600.0, 320.0)  #: size of a narrow plot, px, in which names stay within the axes
WIDTHS = (PLOT[0], 1000.0)  #: of a plot on paper and on a screen, px
Box = tuple[float, float, float, float]  #: middle and half sides, px


def front_figure(result: Row, variables: list[str], other: str) -> go.Figure:
    """Draw the leading objective against another one, infeasible designs beside it."""
    kinds, goals = of_kinds(result), goals_of(result)
    lead, second = goals.leading, goals.named(other)
    barred = [row for row in kinds["infeasible"] if row.get(other) is not None]
    seen = _simulated(kinds)
    y = window([second.shown(row) for row in seen])
    barred = [row for row in barred if y[0] < second.shown(row) < y[1]]
    beaten = [
        row
        for row in [*kinds["dominated"], *kinds["fails when simulated"]]
        if is_measured(row) and y[0] < second.shown(row) < y[1]
    ]
    far = _far_prototype(kinds["prototype"], [*kinds["front"], *kinds["chosen"], *beaten], lead)
    aside = bool(far) + bool(barred)
    widths = [MAIN - ASIDE * aside, *[ASIDE] * aside]
    figure = make_subplots(
        1, len(widths), shared_yaxes=True, column_widths=widths, horizontal_spacing=0.02
    )
    if len(goals.every) == 2:  # what the front dominates lies right of and above its border
        figure.add_scatter(
            x=[lead.shown(row) for row in result["front"]],
            y=[second.shown(row) for row in result["front"]],
            mode="lines", line={"color": BLUE, "shape": "hv", "width": 1.5},
            showlegend=False, hoverinfo="skip", name="border of the front", row=1, col=1,
        )  # fmt: skip
    for kind, every in kinds.items():
        rows = [row for row in every if is_measured(row)]
        if rows and kind != "infeasible":
            column = 2 if far and kind == "prototype" else 1
            figure.add_trace(_designs(kind, rows, second, variables, goals), 1, column)
    if barred:
        trace = _designs("infeasible", barred, second, variables, goals)
        figure.add_trace(trace.update(x=["not<br>simulated"] * len(barred)), 1, len(widths))
        figure.update_xaxes(tickangle=0, col=len(widths))
    near = [row for row in seen if row not in far]
    x = window([lead.shown(row) for row in ([*near, *beaten] if far else near)])
    chosen = kinds["chosen"]
    names = [f"<b>chosen: {design_name(r)}</b>" if r in chosen else _short(r) for r in near]
    _write_names(figure, [*near, *beaten], names, (lead, second), (x, y), row=1, col=1)
    figure.update_xaxes(title=lead.axis, range=x, col=1)
    figure.update_yaxes(title=second.axis, range=y, col=1)
    for row in far:
        _write_far(figure, row, lead, second)
    return styled(figure, 520)


def _far_prototype(prototype: list[Row], others: list[Row], lead: Goal) -> list[Row]:
    """List the prototype where it would leave more than ``EMPTY`` of the axis without a design."""
    own = [row for row in prototype if is_measured(row)]
    values = [lead.shown(row) for row in others]
    if not own or not values:
        return []
    at = lead.shown(own[0])
    return own if at - max(values) > EMPTY * (at - min(values)) else []


def _write_far(figure: go.Figure, row: Row, lead: Goal, second: Goal) -> None:
    at = lead.shown(row)
    room = 1.6 * max(abs(end - at) for end in lead.interval(row)) or 0.1 * abs(at)
    figure.update_xaxes(
        title={"text": "axis broken", "font": {"size": 12}}, range=[at - room, at + room],
        tickvals=[at], ticktext=[f"{at:.3g}"], tickangle=0, col=2,
    )  # fmt: skip
    _write(figure, (at, second.shown(row)), _short(row), (0, 30), row=1, col=2)


def _write_names(
    figure: go.Figure, rows: Sequence[Row], names: Sequence[str], goals: tuple[Goal, Goal],
    ends: tuple[tuple[float, float], tuple[float, float]], *, size: float = 0.0, **where: int,
) -> None:  # fmt: skip
    """Name the first of ``rows`` beside their marks, where no mark and no other name is.

    The better side, where the front leaves no other design, is tried first. ``ends`` are of the
    axes, within which all names stay, ``size`` is of the largest marks, px.
    """
    spans = [high - low for low, high in ends]
    lows = [low for low, _ in ends]
    at = [[goal.shown(row) for goal in goals] for row in rows]
    marks = [
        [(wide * (x - lows[0]) / spans[0], PLOT[1] * (y - lows[1]) / spans[1]) for x, y in at]
        for wide in WIDTHS
    ]
    taken: list[list[Box]] = [
        [(x, y, 0.5 * size + MARK, 0.5 * size + MARK) for x, y in placed] for placed in marks
    ]
    for k in sorted(range(len(names)), key=lambda k: at[k][0]):
        half = 0.5 * LETTER * len(names[k].replace("<b>", "").replace("</b>", ""))
        # The prototype is seldom on the front: its better side is full, the other one is not.
        right, up = (
            1.0 if goal.objective.maximise != bool(rows[k]["prototype"]) else -1.0 for goal in goals
        )
        best: tuple[int, float, float] | None = None
        for far in STEPS:
            for side, rise in ((right, up), (0.0, up), (right, 0.0), (-right, up), (right, -up),
                               (0.0, -up), (-right, -up)):  # fmt: skip
                offs = side * (8.0 + 0.5 * size + half), rise * (far + 0.5 * size)
                x, y = (
                    min(max(own + off, room), most - room) - own
                    for own, off, room, most in zip(
                        marks[0][k], offs, (half, HIGH), PLOT, strict=True
                    )
                )
                boxes = [(m[k][0] + x, m[k][1] + y, half, HIGH) for m in marks]
                hits = sum(_meet(b, o) for b, t in zip(boxes, taken, strict=True) for o in t)
                if best is None or hits < best[0]:
                    best = hits, x, y
        if best is not None:
            _, x, y = best
            for m, others in zip(marks, taken, strict=True):
                others.append((m[k][0] + x, m[k][1] + y, half, HIGH))
            _write(figure, (at[k][0], at[k][1]), names[k], (x, -y), **where)


def _meet(one: Box, other: Box) -> bool:
    """Check whether two boxes, given by middle and half sides, overlap."""
    return all(abs(one[k] - other[k]) < one[k + 2] + other[k + 2] for k in (0, 1))


def _write(
    figure: go.Figure, at: tuple[float, float], words: str, off: tuple[float, float], **where: int
) -> None:
    figure.add_annotation(
        x=at[0], y=at[1], text=words, ax=off[0], ay=off[1], showarrow=True, arrowhead=0,
        arrowwidth=1, arrowcolor=INK, standoff=7, font={"size": 14},
        bgcolor="rgba(255, 255, 255, 0.75)", **where,
    )  # fmt: skip


def third_figure(result: Row, variables: list[str], second: str, third: str) -> go.Figure:
    """Draw the front by leading objective and ``second``; size and a number are ``third``."""
    kinds, goals = of_kinds(result), goals_of(result)
    lead, up, size = goals.leading, goals.named(second), goals.named(third)
    values = [size.shown(r) for rows in kinds.values() for r in rows if is_measured(r)]
    low, span = min(values), (max(values) - min(values)) or 1.0
    figure = go.Figure()
    for kind in ("dominated", *CHOICES):
        rows = [row for row in kinds[kind] if is_measured(row)]
        if rows:
            trace = _designs(kind, rows, up, variables, goals)
            sizes = [LEAST + (LARGEST - LEAST) * (size.shown(r) - low) / span for r in rows]
            trace.marker = {**trace.marker.to_plotly_json(), "size": sizes, "opacity": 0.75}
            trace.error_x = trace.error_y = None
            figure.add_trace(trace)
    seen = _simulated(kinds)
    names = [f"{_short(row)}: {size.number(size.shown(row))}" for row in seen]
    x, y = (window([goal.shown(row) for row in seen]) for goal in (lead, up))
    _write_names(figure, seen, names, (lead, up), (x, y), size=LARGEST)
    figure.update_xaxes(title=lead.axis, range=x)
    figure.update_yaxes(title=up.axis, range=y)
    return styled(figure, 520).update_layout(legend={"itemsizing": "constant"})


def sure_figure(result: Row) -> go.Figure:
    """Draw the 95 % interval of each design of the front and, if known, its probability."""
    rows = [as_searched(result, row) for row in reversed(result["front"])]
    lead = goals_of(result).leading
    known = all("probability_on_front" in row for row in rows)
    figure = make_subplots(
        1, 2 if known else 1, shared_yaxes=True, column_widths=[0.62, 0.38] if known else [1.0],
        horizontal_spacing=0.08,
    )  # fmt: skip
    best = result["best"]["trial"]
    names = {r["trial"]: design_name(r) + " (chosen)" * (r["trial"] == best) for r in rows}
    figure.add_scatter(
        x=[lead.shown(row) for row in rows], y=[*names.values()], mode="markers",
        error_x={**_bars(rows, lead), "thickness": 2, "width": 6},
        marker={"color": BLUE, "size": 10, "symbol": "circle"}, name="search, 95 % interval",
        hovertemplate=f"%{{y}}: %{{x:.4g}} {lead.unit}<extra></extra>", row=1, col=1,
    )  # fmt: skip
    found = confirmed_designs(result)
    estimates = {t: lead.estimate(found[t]) for t in names if t in found and is_measured(found[t])}
    if estimates:
        figure.add_scatter(
            x=[value for value, _ in estimates.values()], y=[names[t] for t in estimates],
            error_x={"array": [1.96 * error for _, error in estimates.values()], "color": INK},
            mode="markers", name="new angles, 95 % interval",
            marker={"color": "white", "size": 10, "symbol": "square",
                    "line": {"color": INK, "width": 2}},
            hovertemplate=f"%{{y}}, new angles: %{{x:.4g}} {lead.unit}<extra></extra>",
            row=1, col=1,
        )  # fmt: skip
    if known:
        shares = [row["probability_on_front"] for row in rows]
        figure.add_bar(
            x=shares, y=[*names.values()], orientation="h", name="probability on the front",
            marker={"color": PALE, "line": {"color": INK, "width": 1}, "pattern": {"shape": "/"}},
            text=[f"{share:.0%}" for share in shares], textposition="outside", cliponaxis=False,
            width=0.5, hovertemplate="%{y}: %{x:.0%}<extra></extra>", row=1, col=2,
        )  # fmt: skip
        figure.update_xaxes(title="probability on the front", range=[0, 1.19], tickformat=".0%",
                            tickvals=[0, 0.25, 0.5, 0.75, 1], col=2)  # fmt: skip
    figure.update_xaxes(title=lead.axis, col=1)
    return styled(figure, 150 + 40 * len(rows)).update_layout(margin={"l": 150})


def _bars(rows: list[Row], goal: Goal) -> Row:
    pairs = [(goal.shown(row), goal.interval(row)) for row in rows]
    return {
        "type": "data",
        "array": [high - value for value, (_, high) in pairs],
        "arrayminus": [value - low for value, (low, _) in pairs],
    }


def _designs(
    kind: str, rows: list[Row], second: Goal, variables: list[str], goals: Goals
) -> go.Scatter:
    """Draw designs of a kind; those without a simulated time get their place from the caller."""
    trace = go.Scatter(
        y=[second.shown(row) for row in rows], name=kind, mode="markers", marker=MARKS[kind],
        text=[describe(row, variables, goals) for row in rows], hoverinfo="text",
    )  # fmt: skip
    if kind == "infeasible":
        return trace
    look = {"thickness": 1.2, "width": 3, "color": INK if kind in CHOICES else PALE}
    unsure = [any(goal.error(row) for row in rows) for goal in (goals.leading, second)]
    if all(unsure) and kind not in CHOICES:
        unsure = [False, False]  # crosses of many designs would cover those of the front
    return trace.update(
        x=[goals.leading.shown(row) for row in rows],
        error_x={**_bars(rows, goals.leading), **look} if unsure[0] else None,
        error_y={**_bars(rows, second), **look} if unsure[1] else None,
    )


def _simulated(kinds: dict[str, list[Row]]) -> list[Row]:
    """Select the designs that are named and were simulated."""
    return [r for kind in reversed(CHOICES) for r in kinds[kind] if is_measured(r)]


def _short(row: Row) -> str:
    return "<b>prototype</b>" if row["prototype"] else str(row["trial"])
