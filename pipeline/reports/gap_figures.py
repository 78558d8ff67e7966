"""Figures of a diagnosis: map of the gap, and bench times beside those of two simulations."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from dogshape.diagnosis.bench.comparison import Comparison, PointGap
from dogshape.diagnosis.diagnosis import Diagnosis
from dogshape.diagnosis.terms import NONE
from dogshape.pipeline.record import Record, key, number_or_none
from dogshape.pipeline.reports.charts import BLUE, GREY, INK, ORANGE, Row, styled
from dogshape.pipeline.reports.text import minus, place_name
from dogshape.sim.units import RPM

NINETY = 1.645  #: standard errors of a 90 % interval, either side
CLEAR = 2.0  #: standard errors from which a gap is framed
ROOM = (16, 6)  #: mismatches and forces of a grid that a map has room for
FILLED = 0.5  #: share of a grid that must be filled to be drawn as one
BESIDE, MAX_PANELS = 4, 8  #: panels side by side, and forces that have a panel each
#: Faster is blue, slower orange; both pale, so that the numbers stay readable in grey.
FASTER_TO_SLOWER = [[0.0, "#8db9e2"], [0.5, "#ffffff"], [1.0, "#f0b48a"]]
PLAIN, LEADING = "without effects", "leading hypothesis, point held out"  #: names of curves


class CellRow(Record):
    """One operating point of a diagnosis; null where there is none."""

    mismatch_rpm: float = key("mismatch before the shift", "1/min")
    force_N: float = key("final shift force", "N")
    shifts: int = key("shifts that have a time")
    engaged: int = key("shifts that engaged")
    failed: int = key("shifts that did not")
    unknown: int = key("shifts of which that is not known")
    bench_s: float | None = key("mean on the bench", "s")
    bench_error_s: float | None = key("its standard error, from the predicted spread", "s")
    simulated_s: float | None = key("simulation without any effect", "s")
    simulated_error_s: float | None = key("its standard error", "s")
    gap_s: float | None = key("bench less simulation", "s")
    error_s: float | None = key("its standard error", "s")
    z: float | None = key("gap over its standard error", "1")
    predicted_s: float | None = key("leading hypothesis, fitted to all other points", "s")
    predicted_error_s: float | None = key("its standard error", "s")

    @property
    def place(self) -> tuple[float, float]:
        """Mismatch and force."""
        return self.mismatch_rpm, self.force_N

    @property
    def missing(self) -> str:
        """Reason in words for the lack of a gap; empty where there is one."""
        if self.gap_s is not None:
            return ""
        if self.bench_s is not None:
            return "not simulated"
        return "not engaged" if self.failed else "unknown"


def cells_of(found: Diagnosis) -> list[CellRow]:
    """List the operating points of a diagnosis, in the order of its data set."""
    held_out, nearest = found.held_out, found.fits[found.leading].predicted
    spread = np.sqrt((nearest.sd**2).mean(axis=0))
    errors, named = found.fits[NONE].predicted.error.mean(axis=0), found.leading != NONE
    return [
        row_of(
            point,
            float(errors[k]),
            float(spread[k] / point.cell.n**0.5) if point.cell.n else None,
            float(held_out.mean[k]) if named else None,
            float(held_out.sd[k]) if named else None,
        )
        for k, point in enumerate(found.gaps)
    ]


def row_of(
    point: PointGap, simulated_error: float | None, bench_error: float | None = None,
    predicted: float | None = None, predicted_error: float | None = None,
) -> CellRow:  # fmt: skip
    """Record the gap at an operating point; errors and prediction in s."""
    cell = point.cell
    return CellRow(
        mismatch_rpm=cell.point.mismatch / RPM,
        force_N=cell.point.profile.force,
        shifts=cell.n,
        engaged=cell.engaged,
        failed=cell.failed,
        unknown=cell.unknown,
        bench_s=cell.time,
        bench_error_s=number_or_none(bench_error),
        simulated_s=point.mean,
        simulated_error_s=None if point.mean is None else number_or_none(simulated_error),
        gap_s=point.gap,
        error_s=None if point.gap is None else number_or_none(point.standard_error),
        z=number_or_none(point.z),
        predicted_s=number_or_none(predicted),
        predicted_error_s=number_or_none(predicted_error),
    )


def gap_map_figure(cells: list[CellRow]) -> go.Figure:
    """Draw the gap of each operating point over mismatch and force, ms; clear ones are framed.

    Points that are no grid have a line each.
    """
    rows, columns = (sorted({cell.place[k] for cell in cells}) for k in (0, 1))
    many = len(rows) > ROOM[0] or len(columns) > ROOM[1]
    if many or len(cells) < FILLED * len(rows) * len(columns):
        ordered = sorted(cells, key=lambda c: c.place, reverse=True)
        places = {(k, 0): cell for k, cell in enumerate(ordered)}
        names, heads = [place_name(*c.place) for c in ordered], ["gap"]
    else:
        places = {(rows.index(c.place[0]), columns.index(c.place[1])): c for c in cells}
        names, heads = [minus(f"{m:.4g}") for m in rows], [f"{f:.4g}" for f in columns]
    values = np.full((len(names), len(heads)), np.nan)
    words = np.full(values.shape, "", dtype=object)
    figure = go.Figure()
    for (i, j), cell in places.items():
        words[i, j] = cell.missing or minus(f"{1e3 * (cell.gap_s or 0.0):+.1f}")
        if cell.gap_s is not None:
            values[i, j] = 1e3 * cell.gap_s
            words[i, j] += f" ({cell.engaged}/{cell.engaged + cell.failed})" if cell.failed else ""
        corners = {"x0": j - 0.47, "x1": j + 0.47, "y0": i - 0.46, "y1": i + 0.46}
        if cell.z is not None and abs(cell.z) >= CLEAR:
            look = {"line": {"color": INK, "width": 2}, "fillcolor": "rgba(0, 0, 0, 0)"}
            figure.add_shape(type="rect", **corners, **look)
        elif cell.missing:
            figure.add_shape(type="rect", **corners, fillcolor=GREY, opacity=0.25, line_width=0)
            figure.add_annotation(x=j, y=i, text=words[i, j], showarrow=False)
    most = float(np.nanmax(np.abs(values))) if np.isfinite(values).any() else 1.0
    figure.add_heatmap(
        z=values, x=heads, y=names, text=words, texttemplate="%{text}", showscale=False, xgap=2,
        ygap=2, textfont={"size": 13, "color": INK}, colorscale=FASTER_TO_SLOWER, zmin=-most,
        zmax=most, hovertemplate="%{y}, %{x}: %{text}<extra></extra>",
    )  # fmt: skip
    named = len(heads) > 1
    figure.update_xaxes(type="category", title="shift force, N" if named else None)
    figure.update_yaxes(type="category", title="mismatch, 1/min" if named else None)
    return styled(figure, 130 + (46 if len(names) <= 8 else 28) * len(names))


def compared_figure(compared: Comparison) -> go.Figure:
    """Draw bench and simulated times of every operating point, ms over 1/min.

    The band is 90 % of what the difference may be by chance; it is drawn about the simulation.
    """
    cells = [row_of(one, one.standard_error) for one in compared.differences]
    return before_figure(cells, "simulated")


def before_figure(cells: list[CellRow], plain: str = PLAIN) -> go.Figure:
    """Draw mean times over mismatch, a panel for each force; a line each where forces are many.

    ``plain`` names the simulation; cells with a prediction have a second curve.
    """
    sides = (
        (plain, "simulated", {"color": ORANGE, "symbol": "square-open", "size": 10}),
        (LEADING, "predicted", {"color": BLUE, "symbol": "diamond", "size": 10}),
        ("bench", "bench", {"color": INK, "size": 8, "symbol": "circle"}),
    )
    forces = sorted({cell.force_N for cell in cells})
    if len(forces) > MAX_PANELS or len(cells) < 2 * len(forces):
        return _listed(cells, sides)
    columns, rows = min(BESIDE, len(forces)), -(-len(forces) // BESIDE)
    figure = make_subplots(
        rows, columns, shared_yaxes=True, subplot_titles=[f"{f:.4g} N" for f in forces],
        horizontal_spacing=0.03, vertical_spacing=0.16,
    )  # fmt: skip
    for place, force in enumerate(forces):
        mine = sorted((c for c in cells if c.force_N == force), key=lambda c: c.mismatch_rpm)
        where = {"row": place // columns + 1, "col": place % columns + 1}
        for name, side, marker in sides:
            found = _known(mine, side)
            x, y = [c.mismatch_rpm for c, *_ in found], [mean for _, mean, _ in found]
            look = {
                "name": name,
                "legendgroup": name,
                "showlegend": place == 0,
                "hovertemplate": f"{name}, %{{x:.4g}} 1/min: %{{y:.1f}} ms<extra></extra>",
            }
            if not found:
                continue
            if side == "bench":
                error = {"array": [half for *_, half in found], "thickness": 1.2}
                figure.add_scatter(x=x, y=y, error_y=error, mode="markers", marker=marker, **look,
                                   **where)  # fmt: skip
                continue
            ends = [m + s * h for s, part in ((1, found), (-1, found[::-1])) for _, m, h in part]
            figure.add_scatter(
                x=x + x[::-1], y=ends, fill="toself", fillcolor=marker["color"], opacity=0.2,
                mode="none", hoverinfo="skip", showlegend=False, **where,
            )  # fmt: skip
            line = {"color": marker["color"], "width": 2.5,
                    "dash": "dash" if side == "simulated" else "solid"}  # fmt: skip
            figure.add_scatter(x=x, y=y, mode="lines", line=line, **look, **where)
    mismatches = sorted({c.mismatch_rpm for c in cells})
    if mismatches[0] > 0.0:
        ticks = [mismatches[k] for k in {0, len(mismatches) // 2, len(mismatches) - 1}]
        figure.update_xaxes(type="log", tickvals=ticks, tickangle=0)
    figure.update_xaxes(title="mismatch, 1/min", row=rows)
    figure.update_yaxes(rangemode="tozero")
    figure.update_yaxes(title="mean shift time, ms", col=1)
    figure = styled(figure, 130 + 290 * rows)
    return figure.update_layout(legend={"y": 1.0 + 0.12 / rows}, margin={"t": 80})


def _known(cells: Sequence[CellRow], side: str) -> list[tuple[CellRow, float, float]]:
    """Select the cells that have a time of a side, with it and half its 90 % interval, ms."""
    found = []
    for cell in cells:
        mean, error = getattr(cell, f"{side}_s"), getattr(cell, f"{side}_error_s")
        if mean is not None:
            found.append((cell, 1e3 * mean, NINETY * 1e3 * (error or 0.0)))
    return found


def _listed(cells: list[CellRow], sides: Sequence[tuple[str, str, Row]]) -> go.Figure:
    """Draw a line for each operating point."""
    ordered, figure = sorted(cells, key=lambda c: c.place, reverse=True), go.Figure()
    for name, side, marker in sides:
        if found := _known(ordered, side):
            figure.add_scatter(
                x=[mean for _, mean, _ in found], y=[place_name(*c.place) for c, *_ in found],
                error_x={"array": [half for *_, half in found], "thickness": 1.2}, name=name,
                mode="markers", marker=marker,
                hovertemplate=f"{name}, %{{y}}: %{{x:.1f}} ms<extra></extra>",
            )  # fmt: skip
    names = [place_name(*cell.place) for cell in ordered]
    figure.update_xaxes(title="mean shift time, ms", rangemode="tozero")
    figure.update_yaxes(type="category", categoryorder="array", categoryarray=names)
    figure.update_yaxes(automargin=True)
    return styled(figure, 130 + 26 * len(names))
