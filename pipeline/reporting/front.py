"""The front: every design by its objectives, and how sure each place on it is."""

from __future__ import annotations

import plotly.graph_objects as go
from plotly.subplots import make_subplots

from pipeline.design import SIMULATED
from pipeline.reporting.labels import Label, write_labels
from pipeline.reporting.look import (
    BLUE,
    INK,
    MARKS,
    Row,
    axis_title,
    shown,
    styled,
    window,
)
from pipeline.reporting.names import describe, design_name, interval, of_kinds

PALE = "#b9c9dd"
CHOICES = ("front", "chosen", "prototype")  #: kinds of designs that are named


def front_figure(result: Row, variables: list[str], other: str) -> go.Figure:
    """Draw expected shift time against another objective, infeasible designs beside it."""
    kinds = of_kinds(result)
    barred = [row for row in kinds["infeasible"] if other in row]
    widths = [0.88, 0.12] if barred else [1.0]
    figure = make_subplots(
        1, len(widths), shared_yaxes=True, column_widths=widths, horizontal_spacing=0.02
    )
    if len(result["objectives"]) == 2:
        figure.add_trace(_stairs(result["front"], other), 1, 1)
    for kind, rows in kinds.items():
        if rows and kind != "infeasible" and rows[0]["expected_shift_time_s"] is not None:
            figure.add_trace(_designs(kind, rows, other, variables), 1, 1)
    if barred:
        figure.add_trace(_not_simulated(barred, other, variables), 1, 2)
        figure.update_xaxes(tickangle=0, col=2)
    seen = _timed(kinds)
    x = window([shown(row, SIMULATED) for row in seen])
    y = window([row[other] for row in seen + barred])
    chosen = kinds["chosen"]
    labels = [
        Label(
            f"<b>chosen: {design_name(row)}</b>" if row in chosen else _short(row),
            (shown(row, SIMULATED), row[other]),
        )
        for row in seen
    ]
    rest = [*kinds["dominated"], *kinds["lands too hard"]]
    marks = [(shown(row, SIMULATED), row[other]) for row in rest]
    write_labels(figure, labels, x, y, marks, row=1, col=1)
    figure.update_xaxes(title=axis_title(SIMULATED), range=x, col=1)
    figure.update_yaxes(title=axis_title(other), range=y, col=1)
    return styled(figure, 520)


def third_figure(result: Row, variables: list[str], second: str, third: str) -> go.Figure:
    """Draw the front by time and ``second``; size and a number at each mark are ``third``."""
    kinds = of_kinds(result)
    values = [row[third] for rows in kinds.values() for row in rows if row[SIMULATED] is not None]
    low, high = min(values), max(values)
    figure = go.Figure()
    for kind in ("dominated", *CHOICES):
        rows = [row for row in kinds[kind] if row[SIMULATED] is not None]
        if not rows:
            continue
        trace = _designs(kind, rows, second, variables)
        share = [(row[third] - low) / ((high - low) or 1.0) for row in rows]
        sizes = [9.0 + 27.0 * part for part in share]
        trace.marker = {**trace.marker.to_plotly_json(), "size": sizes, "opacity": 0.75}
        trace.error_x = None
        figure.add_trace(trace)
    seen = _timed(kinds)
    x = window([shown(row, SIMULATED) for row in seen])
    y = window([row[second] for row in seen])
    named = [(f"{_short(row)}: {row[third]:.4g}", row) for row in seen]
    labels = [Label(words, (shown(row, SIMULATED), row[second])) for words, row in named]
    write_labels(figure, labels, x, y)
    figure.update_xaxes(title=axis_title(SIMULATED), range=x)
    figure.update_yaxes(title=axis_title(second), range=y)
    figure = styled(figure, 520)
    figure.update_layout(legend={"itemsizing": "constant"})
    return figure


def sure_figure(result: Row) -> go.Figure:
    """Draw the 95 % interval of each design of the front and, if known, its probability."""
    rows = list(reversed(result["front"]))
    known = all("probability_on_front" in row for row in rows)
    figure = make_subplots(
        1, 2 if known else 1, shared_yaxes=True, column_widths=[0.62, 0.38] if known else [1.0],
        horizontal_spacing=0.03,
    )  # fmt: skip
    names = [_front_name(row, result) for row in rows]
    times = [shown(row, SIMULATED) for row in rows]
    ends = [interval(row) for row in rows]
    error = {
        "array": [high * 1e3 - t for (_, high), t in zip(ends, times, strict=True)],
        "arrayminus": [t - low * 1e3 for (low, _), t in zip(ends, times, strict=True)],
        "thickness": 2, "width": 6,
    }  # fmt: skip
    mark = {"color": BLUE, "size": 10, "symbol": "circle"}
    figure.add_scatter(
        x=times, y=names, error_x=error, mode="markers", marker=mark, name="search, 95 % interval",
        hovertemplate="%{y}: %{x:.1f} ms<extra></extra>", row=1, col=1,
    )  # fmt: skip
    for place in confirmed_times(result, names):
        figure.add_trace(place, 1, 1)
    if known:
        figure.add_trace(_probabilities(rows, names), 1, 2)
        figure.update_xaxes(title="probability on the front", range=[0, 1.19], tickformat=".0%",
                            tickvals=[0, 0.25, 0.5, 0.75, 1], col=2)  # fmt: skip
    figure.update_xaxes(title=axis_title(SIMULATED), col=1)
    figure = styled(figure, 150 + 40 * len(rows))
    figure.update_layout(margin={"l": 150})
    return figure


def confirmed_times(result: Row, names: list[str]) -> list[go.Scatter]:
    """Return the times at fresh angles of the designs that have them, one trace or none."""
    found = confirmed_designs(result)
    rows = [row for row in reversed(result["front"]) if row["trial"] in found]
    if not rows:
        return []
    by_trial = {row["trial"]: n for row, n in zip(reversed(result["front"]), names, strict=True)}
    mark = {"color": "white", "size": 10, "symbol": "square", "line": {"color": INK, "width": 2}}
    fresh = [found[row["trial"]] for row in rows]
    return [
        go.Scatter(
            x=[shown(one, SIMULATED) for one in fresh],
            y=[by_trial[row["trial"]] for row in rows],
            error_x={"array": [1.96e3 * one["standard_error_s"] for one in fresh], "color": INK},
            mode="markers",
            marker=mark,
            name="fresh angles, 95 % interval",
            hovertemplate="%{y}, fresh angles: %{x:.1f} ms<extra></extra>",
        )
    ]


def confirmed_designs(result: Row) -> dict[int, Row]:
    """Return what the confirmation found for designs of the front, by trial."""
    confirmation = result["confirmation"]
    if not confirmation:
        return {}
    best = {result["best"]["trial"]: confirmation["best"]}
    return {one["trial"]: one for one in confirmation.get("designs", [])} | best


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


def _stairs(front: list[Row], other: str) -> go.Scatter:
    """Return the border of what the front dominates."""
    return go.Scatter(
        x=[shown(row, SIMULATED) for row in front],
        y=[row[other] for row in front],
        mode="lines",
        line={"color": BLUE, "shape": "hv", "width": 1.5},
        showlegend=False,
        hoverinfo="skip",
        name="border of the front",
    )


def _designs(kind: str, rows: list[Row], other: str, variables: list[str]) -> go.Scatter:
    ends = [interval(row) for row in rows]
    times = [shown(row, SIMULATED) for row in rows]
    return go.Scatter(
        x=times,
        y=[row[other] for row in rows],
        error_x={
            "type": "data",
            "array": [high * 1e3 - t for (_, high), t in zip(ends, times, strict=True)],
            "arrayminus": [t - low * 1e3 for (low, _), t in zip(ends, times, strict=True)],
            "thickness": 1.2,
            "width": 3,
            "color": INK if kind in ("front", "chosen", "prototype") else PALE,
        },
        name=kind,
        mode="markers",
        marker=MARKS[kind],
        text=[describe(row, variables) for row in rows],
        hoverinfo="text",
    )


def _not_simulated(barred: list[Row], other: str, variables: list[str]) -> go.Scatter:
    return go.Scatter(
        x=["not<br>simulated"] * len(barred),
        y=[row[other] for row in barred],
        mode="markers",
        name="infeasible",
        marker=MARKS["infeasible"],
        text=[describe(row, variables) for row in barred],
        hoverinfo="text",
    )


def _timed(kinds: dict[str, list[Row]]) -> list[Row]:
    """Return the designs that are named and have a time."""
    return [row for kind in CHOICES for row in kinds[kind] if row[SIMULATED] is not None]


def _short(row: Row) -> str:
    """Return the name that stands beside a mark: the number, or in bold the prototype."""
    return "<b>prototype</b>" if row["prototype"] else str(row["trial"])
