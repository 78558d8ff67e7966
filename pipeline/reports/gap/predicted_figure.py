"""Means that hypotheses predict of each operating point, beside the bench's."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from dogshape.diagnosis.bench.reading import Cell
from dogshape.diagnosis.diagnosis import Diagnosis
from dogshape.diagnosis.inference.predicted_means import PredictedMeans
from dogshape.diagnosis.prediction.hypotheses import NONE, plain
from dogshape.pipeline.reports.kit.look import BLUE, GREEN, INK, ORANGE, RED, Row, styled
from dogshape.pipeline.reports.kit.text import minus, place_name
from dogshape.sim.units import RPM

MOST = 8  #: forces that have a panel each
BESIDE = 2  #: panels side by side
COLORS = (BLUE, GREEN, ORANGE)
FILLS = ("rgba(31,95,168,0.45)", "rgba(46,125,79,0.15)", "rgba(255,255,255,0.9)")
HIGH, BETWEEN, EDGES = 340, 100, 150  #: px of a row, between two, and about all
SHIFTS = 40  #: single shifts of a point that are drawn, at most


def roles(found: Diagnosis) -> list[str]:
    """Name the hypotheses that are compared, as a legend does."""
    names = []
    for one in found.foretold:
        if one.hypothesis == found.leading:
            names.append("leading hypothesis" if one.hypothesis != NONE else "no effect (leading)")
        else:
            names.append("no effect" if one.hypothesis == NONE else "best rival")
    return names


def predicted_figure(found: Diagnosis) -> go.Figure:
    """Draw bench and predicted means over the mismatch, a panel for each force.

    Where forces are many, or points are no grid, each point has its own place in one panel.
    """
    cells = found.bench.cells
    groups = _groups(cells)
    columns = min(BESIDE, len(groups))
    rows = -(-len(groups) // columns)
    titles = list(groups) if len(groups) > 1 or next(iter(groups)) else None
    figure = make_subplots(
        rows, columns, subplot_titles=titles, horizontal_spacing=0.07,
        vertical_spacing=BETWEEN / (HIGH * rows),
    )  # fmt: skip
    for number, (name, places) in enumerate(groups.items()):
        at = number // columns + 1, number % columns + 1
        labels = [_label(cells[k], within=bool(name)) for k in places]
        _panel(figure, found, (places, labels), at, first=number == 0)
        title = "mismatch, 1/min" if name else None
        figure.update_xaxes(title=title, row=at[0], col=at[1])
    figure.update_xaxes(type="category", tickangle=0 if next(iter(groups)) else None)
    figure.update_yaxes(title="mean shift time, ms", col=1)
    figure = styled(figure, EDGES + HIGH * rows)
    return figure.update_layout(
        boxmode="group", boxgap=0.12, boxgroupgap=0.12, margin={"t": 90},
        legend={"y": 1.0 + 34.0 / (HIGH * rows), "traceorder": "normal"},
    )  # fmt: skip


def _groups(cells: Sequence[Cell]) -> dict[str, list[int]]:
    """Sort cells that have a time into panels by force, by mismatch within; one panel if many."""
    timed = [k for k, cell in enumerate(cells) if cell.time is not None]
    forces = sorted({cells[k].point.profile.force for k in timed})
    order = sorted(timed, key=lambda k: (cells[k].point.profile.force, cells[k].point.mismatch))
    if len(forces) > MOST or len(timed) < 2 * len(forces):
        return {"": order}
    return {f"{f:.4g} N": [k for k in order if cells[k].point.profile.force == f] for f in forces}


def _label(cell: Cell, *, within: bool) -> str:
    mismatch = cell.point.mismatch / RPM
    return minus(f"{mismatch:.4g}") if within else place_name(mismatch, cell.point.profile.force)


def _panel(
    figure: go.Figure,
    found: Diagnosis,
    where: tuple[list[int], list[str]],
    at: tuple[int, int],
    *,
    first: bool,
) -> None:
    """Draw boxes of each hypothesis, the bench, and marks where it lies outside."""
    places, labels = where
    look: Row = {"row": at[0], "col": at[1]}
    for number, (one, role) in enumerate(zip(found.foretold, roles(found), strict=True)):
        low, first_quarter, middle, last_quarter, high = 1e3 * one.quantiles[places].T
        figure.add_box(
            x=labels, lowerfence=low, q1=first_quarter, median=middle, q3=last_quarter,
            upperfence=high, name=role, legendgroup=role, offsetgroup=str(number),
            showlegend=first, line={"color": COLORS[number], "width": 1.6},
            fillcolor=FILLS[number], whiskerwidth=0.6, **look,
        )  # fmt: skip
    _bench(figure, found, where, look, first=first)


def _bench(
    figure: go.Figure,
    found: Diagnosis,
    where: tuple[list[int], list[str]],
    look: Row,
    *,
    first: bool,
) -> None:
    places, labels = where
    cells = [found.bench.cells[k] for k in places]
    singles = [
        (name, 1e3 * float(time))
        for name, cell in zip(labels, cells, strict=True)
        for time in cell.times[:SHIFTS]
    ]
    if singles:
        figure.add_scatter(
            x=[name for name, _ in singles], y=[time for _, time in singles], mode="markers",
            marker={"symbol": "line-ew-open", "size": 9, "color": "#7b8794", "opacity": 0.5},
            name="single shifts", legendgroup="single", showlegend=first, hoverinfo="skip", **look,
        )  # fmt: skip
    spread = found.mean_prediction.single[places]
    counts = np.array([max(1, cell.n) for cell in cells])
    errors = 1e3 * np.sqrt(np.nan_to_num(spread) / counts)
    missed = np.array([[not inside for inside in one.inside[places]] for one in found.foretold])
    leading = missed[0] if len(missed) else np.zeros(len(places), dtype=bool)
    times = [1e3 * cell.time if cell.time is not None else None for cell in cells]
    for name, color, symbol, those in (
        ("bench, ± standard error", INK, "circle", ~leading),
        ("bench, outside 90 % of the leading one", RED, "x", leading),
    ):
        figure.add_scatter(
            x=[label for label, there in zip(labels, those, strict=True) if there],
            y=[time for time, there in zip(times, those, strict=True) if there],
            error_y={"array": errors[those], "thickness": 1.6, "width": 4},
            mode="markers", marker={"color": color, "symbol": symbol, "size": 9},
            name=name, legendgroup=name, showlegend=first,
            hovertemplate="bench, %{x}: %{y:.1f} ms<extra></extra>", **look,
        )  # fmt: skip


def in_words(found: Diagnosis) -> list[tuple[str, str]]:
    """Count the means that each hypothesis holds, and name where it fails."""
    said = []
    for one, role in zip(found.foretold, roles(found), strict=True):
        title = f"{role[0].upper()}{role[1:]}"
        if one.hypothesis != NONE:
            title += f", {plain(one.hypothesis, found.effects)}"
        said.append((title, _counted(found, one)))
    return said


def _counted(found: Diagnosis, one: PredictedMeans) -> str:
    outside = np.flatnonzero(one.known & ~one.inside)
    whole = int(one.known.sum())
    if not outside.size:
        return f"holds all {whole} means."
    middle, high, low = one.quantiles[:, 2], one.quantiles[:, 4], one.quantiles[:, 0]
    times = np.array([np.nan if c.time is None else c.time for c in found.bench.cells])
    gaps = times - middle
    far = np.abs(gaps) / np.maximum(1e-6, 0.5 * (high - low))
    worst = sorted(outside.tolist(), key=lambda k: -far[k])[:3]
    those = [
        f"{_label(found.bench.cells[k], within=False)} ({minus(f'{1e3 * gaps[k]:+.0f}')} ms)"
        for k in worst
    ]
    most = "" if outside.size <= len(those) else ", most at"
    return (
        f"holds {whole - outside.size} of {whole} means within its 90 %; "
        f"it fails at {outside.size}{most or ':'} {'; '.join(those)}."
    )
