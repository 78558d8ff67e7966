"""Influence of each operating point on the answer: a map and a table."""

from __future__ import annotations

import plotly.graph_objects as go
from plotly.subplots import make_subplots

from dogshape.diagnosis.diagnosis import Diagnosis
from dogshape.diagnosis.inference.influence import CellInfluence, Influence
from dogshape.diagnosis.prediction.hypotheses import plain
from dogshape.diagnosis.report.influence_words import VERDICTS
from dogshape.diagnosis.report.wording import chance
from dogshape.pipeline.reports.gap.gap_map_figure import FASTER_TO_SLOWER, FILLED
from dogshape.pipeline.reports.kit.look import Row, styled
from dogshape.pipeline.reports.kit.maps import (
    LOSS_TO_GAIN,
    frame,
    grid,
    has_room,
    map_height,
    shaded_cells,
)
from dogshape.pipeline.reports.kit.text import minus, place_name
from dogshape.sim.units import RPM

_Place = tuple[float, float, CellInfluence]  #: mismatch in 1/min, force in N


def _places(found: Diagnosis, said: Influence) -> list[_Place]:
    """List the operating points that have data, in the order of the data set."""
    points = [cell.point for cell in found.bench.cells]
    return [
        (point.mismatch / RPM, point.profile.force, one)
        for point, one in zip(points, said.cells, strict=True)
        if one is not None
    ]


def influence_figure(found: Diagnosis, said: Influence) -> go.Figure:
    """Draw what each point adds to the odds, and the probability without it, side by side."""
    cells = _places(found, said)
    mismatches, forces, at = grid(cells, lambda one: one[:2])
    as_grid = has_room(mismatches, forces) and len(cells) >= FILLED * len(mismatches) * len(forces)
    columns, rows = [f"{f:.4g}" for f in forces], [minus(f"{m:.4g}") for m in mismatches]
    if not as_grid:
        ordered = sorted(cells, key=lambda one: one[:2], reverse=True)
        columns, rows = ["point"], [place_name(*one[:2]) for one in ordered]
        at = {(row, 0): one for row, one in enumerate(ordered)}
    titles = [
        "adds to the log Bayes factor, nats",
        f"probability without it (now {chance(said.probability)})",
    ]
    figure = make_subplots(1, 2, shared_yaxes=True, subplot_titles=titles, horizontal_spacing=0.04)
    added = {place: (one.log_bayes, _nats(one.log_bayes)) for place, (*_, one) in at.items()}
    moved = {
        place: (one.probability - said.probability, chance(one.probability))
        for place, (*_, one) in at.items()
    }
    # Blue speaks for the leading hypothesis in either.
    sides = (added, 2.0, LOSS_TO_GAIN), (moved, 0.2, FASTER_TO_SLOWER)
    for column, (shaded, least, scale) in enumerate(sides, start=1):
        most = max(least, *(abs(value) for value, _ in shaded.values()))
        trace = shaded_cells(columns, rows, shaded, scale)
        figure.add_trace(trace.update(zmin=-most, zmax=most), 1, column)
    mine = said.verdict.kind, said.verdict.causes
    for place, (*_, one) in at.items():
        if (one.verdict.kind, one.verdict.causes) != mine:
            frame(figure, *place, row=1, col=2)
    named = len(columns) > 1
    figure.update_xaxes(type="category", title="shift force, N" if named else None)
    figure.update_yaxes(type="category")
    figure.update_yaxes(title="mismatch, 1/min" if named else None, col=1)
    return styled(figure, map_height(len(rows))).update_layout(margin={"t": 40})


def _nats(value: float) -> str:
    if abs(value) < 0.005:
        return "0.00"
    return minus(f"{value:+.{1 if abs(value) >= 0.95 else 2}f}")


def rows_of(found: Diagnosis, said: Influence) -> list[Row]:
    """Tabulate the points, the most influential first."""
    every: dict[int, _Place] = {}
    for place, (cell, one) in enumerate(zip(found.bench.cells, said.cells, strict=True)):
        if one is not None:
            every[place] = cell.point.mismatch / RPM, cell.point.profile.force, one
    return [_row(found, said, *every[place]) for place in said.ordered]


def _row(
    found: Diagnosis, said: Influence, mismatch: float, force: float, one: CellInfluence
) -> Row:
    changed = (one.verdict.kind, one.verdict.causes) != (said.verdict.kind, said.verdict.causes)
    error = f" ± {one.error:.2f}" if one.error >= 0.005 else ""
    causes = " and ".join(found.effects[name].plain for name in one.verdict.causes)
    verdict = f"{VERDICTS[one.verdict.kind]}{': ' if causes else ''}{causes}"
    return {
        "point": place_name(mismatch, force),
        "probability": chance(one.probability),
        "top": "" if one.top == said.leading else plain(one.top, found.effects),
        "log_bayes": f"{_nats(one.log_bayes)}{error}",
        "elpd": _nats(one.elpd),
        "rival_elpd": _nats(one.rival_elpd),
        "verdict": verdict if changed else "the same",
        "changed": changed,
        "draws": f"{one.draws:.0f}",
        "k_hat": "refitted" if one.refitted else _shape(one.k_hat),
    }


def _shape(k_hat: float | None) -> str:
    return "-" if k_hat is None else minus(f"{k_hat:.2f}")
