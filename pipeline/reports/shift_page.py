"""One shift to look at: an animation with its curves, its facts, and the time series as a table.

The viewer of the rings is Drake's own, Meshcat with three.js inside, taken from the library as it
is installed, so that a page needs no network.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import plotly.graph_objects as go
from numpy.typing import NDArray
from plotly.offline import get_plotlyjs
from plotly.subplots import make_subplots
from pydrake.common import FindResourceOrThrow

from dogshape.pipeline.export.drawing import outline
from dogshape.pipeline.record import Table
from dogshape.pipeline.reports.charts import BLUE, GREEN, GREY, INK, ORANGE
from dogshape.pipeline.reports.report import (
    as_script_json,
    figure_html,
    script,
    script_beside,
    write_page,
)
from dogshape.pipeline.reports.text import ENGINES, in_ms
from dogshape.sim.files import naming
from dogshape.sim.shift.conclusion import DEAD_TIME, Engagement, Outcome
from dogshape.sim.shift.events import crests_cross, touching
from dogshape.sim.shift.geometry import Dog
from dogshape.sim.shift.loads import peak_duration
from dogshape.sim.shift.mesh import Mesh, dog_solid
from dogshape.sim.shift.trace import Trace
from dogshape.sim.units import DEG, MM, MS, RPM

SAMPLES = 6000  #: most points of a series on a page; longer ones are thinned
FORCE_CEILING = 4.0  #: end of the force axis over the largest shift force
#: Colours of a phase: in the bar, and behind the curves.
TONES = {
    "free fly": ("#c3ccd5", "#f1f4f6"),
    "face contact": ("#eba394", "#fdeeea"),
    "entry": ("#ecd06f", "#fdf5d6"),
    "seating": ("#9fd0b0", "#e8f4ec"),
}
#: Height of the curves, px, and of the line over each panel that names its curves.
HEIGHT, HEADLINE, FOOT = 350, 23, 26
PANELS = (0.36, 0.3, 0.34)  #: shares of displacement, speed and force
BODY = 0.11  #: axial length of the ring behind its dogs over the outer radius


def write_trace(result: Engagement, path: Path) -> None:
    """Write the time series of a shift as CSV, columns as in bench traces."""
    with naming(path):
        trace_frame(result.trace).to_csv(path, index=False, float_format="%.9g")


def trace_frame(trace: Trace) -> pd.DataFrame:
    """Tabulate the time series of a shift, columns as in bench traces."""
    return pd.DataFrame(
        {
            "t_s": trace.time,
            "displacement_mm": trace.displacement / MM,
            "force_N": trace.shift_force,
            "sliding_speed_rpm": trace.sliding_speed / RPM,
            "output_speed_rpm": trace.output_speed / RPM,
            "relative_angle_deg": trace.relative_angle / DEG,
            "contact_force_N": trace.contact_force,
        }
    )


def write_animation(
    result: Engagement,
    path: Path,
    torque_peak: float | None = None,
    *,
    scripts_beside: bool = False,
) -> None:
    """Write the shift as one HTML page that opens without a network.

    ``torque_peak`` is the driveline's, N m, where the study knows its stiffness. With
    ``scripts_beside`` many pages in one folder share the code of their figures, megabytes each.
    """
    series = _series(result.trace)
    viewer = Path(FindResourceOrThrow("drake/geometry/meshcat.js")).read_text(encoding="utf-8")
    codes = {"plotly": get_plotlyjs(), "meshcat": viewer}
    scripts = {
        name: script_beside(path, f"{name}.js", code) if scripts_beside else script(code)
        for name, code in codes.items()
    }
    write_page(
        path,
        "shift.html.j2",
        result=result,
        mismatch=result.point.mismatch / RPM,
        angle=result.relative_angle / DEG,
        end=float(result.trace.time[-1]) / MS,
        engine=ENGINES[result.clutch.solver.engine],
        facts=facts(result, torque_peak),
        panels=[round(top) for top, _ in _panels()],
        data=as_script_json(_content(result, series), allow_nan=True),
        curves=figure_html(_curves(result, series), "curves"),
        **scripts,
    )


def _series(trace: Trace) -> dict[str, NDArray[np.float64]]:
    """Compute the series of the page over time, in its units, thinned to ``SAMPLES``.

    Impacts last a step or two: of the contact force the largest value of every
    interval is kept.
    """
    first = np.unique(np.linspace(0, len(trace.time) - 1, SAMPLES).astype(int))
    # The output ring's angle, rad: the sliding ring starts at zero.
    mean = 0.5 * (trace.output_speed[1:] + trace.output_speed[:-1])
    way = np.concatenate([[0.0], np.cumsum(mean * np.diff(trace.time))])
    angle = trace.relative_angle[0] + way
    return {
        "time": trace.time[first] / MS,
        "displacement": trace.displacement[first] / MM,
        "output_angle": angle[first],
        "sliding_angle": (angle - trace.relative_angle)[first],
        "output_speed": trace.output_speed[first] / RPM,
        "sliding_speed": trace.sliding_speed[first] / RPM,
        "shift_force": trace.shift_force[first],
        "contact_force": np.maximum.reduceat(trace.contact_force, first),
        "touching": np.maximum.reduceat(touching(trace).astype(float), first),
    }


def _content(result: Engagement, series: dict[str, NDArray[np.float64]]) -> dict[str, Any]:
    """Collect the data for the scripts of the page."""
    dog = result.clutch.dog
    return {
        "series": {
            # Steps can be far below a microsecond; six digits of a ms keep them apart.
            name: np.round(values, 6 if name in ("time", "displacement") else 7).tolist()
            for name, values in series.items()
        },
        "pitch": dog.pitch / MM,
        "height": dog.height / MM,
        "gap": dog.axial_gap / MM,
        "mean_radius": dog.mean_radius / MM,
        "seated": result.clutch.shift_travel / MM,
        "profile": outline(dog, 1),
        "solids": solids(dog),
        "phases": [
            {
                "name": phase_title(p.name),
                "start": p.start / MS,
                "end": p.end / MS,
                "tone": _tone(p.name)[0],
            }
            for p in result.phases
        ],
        "force_ranges": [_ceiling(result), 1.05 * result.loads.peak_axial_force],
    }


def _tone(phase: str) -> tuple[str, str]:
    return TONES.get(phase, ("#d7dde3", "#f7f8f9"))


def _ceiling(result: Engagement) -> float:
    """Return the end of the force axis, N: impacts are far above the shift force."""
    return FORCE_CEILING * max(1.0, float(result.trace.shift_force.max()))


def _panels() -> list[tuple[float, float]]:
    """Return top and bottom of each panel, px from the top of the curves."""
    room = HEIGHT - FOOT - len(PANELS) * HEADLINE
    panels, top = [], 0.0
    for share in PANELS:
        bottom = top + HEADLINE + share * room
        panels.append((top, bottom))
        top = bottom
    return panels


def curves(result: Engagement) -> go.Figure:
    """Draw displacement, speeds and forces over time, with the phases behind them."""
    figure = _curves(result, _series(result.trace))
    for row, title in enumerate(("displacement, mm", "speed, 1/min", "force, N"), start=1):
        figure.update_yaxes(title=title, row=row)
    return figure.update_layout(paper_bgcolor="white")


def _curves(result: Engagement, series: dict[str, NDArray[np.float64]]) -> go.Figure:
    """Draw displacement, speeds and forces over time with the phases behind them."""
    figure = make_subplots(len(PANELS), 1, shared_xaxes=True)
    mismatch = series["output_speed"] - series["sliding_speed"]
    rows: list[tuple[int, Any, dict[str, Any]]] = [
        (1, series["displacement"], {"color": BLUE}),
        (2, mismatch, {"color": INK, "dash": "dot", "width": 1.5}),
        (2, series["sliding_speed"], {"color": BLUE}),
        (2, series["output_speed"], {"color": ORANGE, "dash": "dash"}),
        # A contact force is the mean of the step that ends at its time.
        (3, series["contact_force"], {"color": "#8a2c3a", "width": 1, "shape": "vh"}),
        (3, series["shift_force"], {"color": GREEN, "width": 2.5}),
    ]
    for row, values, line in rows:
        look = {"mode": "lines", "line": {"width": 2, **line}, "hoverinfo": "skip"}
        figure.add_trace(go.Scatter(x=series["time"], y=values, **look), row, 1)
    for phase in result.phases:
        if phase.end > phase.start:
            span = {"x0": phase.start / MS, "x1": phase.end / MS}
            colour = _tone(phase.name)[1]
            figure.add_vrect(**span, fillcolor=colour, opacity=1, line_width=0, layer="below")
    marks = (
        ("crests meet", result.clutch.dog.axial_gap, "top left"),
        ("engaged", result.clutch.shift_travel, "bottom left"),
    )
    for text, level, where in marks:
        line = {"color": GREY, "width": 1, "dash": "dot"}
        note = {"text": text, "font": {"size": 11, "color": "#55626f"}}
        figure.add_hline(
            level / MM, row=1, opacity=1, line=line, annotation=note, annotation_position=where
        )
    return _laid_out(figure, _ceiling(result))


def _laid_out(figure: go.Figure, ceiling: float) -> go.Figure:
    room, small = HEIGHT - FOOT, {"font": {"size": 13}, "standoff": 12}
    for row, ((top, bottom), unit) in enumerate(
        zip(_panels(), ("mm", "1/min", "N"), strict=True), start=1
    ):
        domain = [1.0 - bottom / room, 1.0 - (top + HEADLINE) / room]
        figure.update_yaxes(domain=domain, title={"text": unit, **small}, nticks=5, row=row)
    figure.update_xaxes(range=[0.0, float(figure.data[0].x[-1])])
    figure.update_xaxes(ticksuffix=" ms", row=len(PANELS))
    figure.update_yaxes(range=[0.0, ceiling], row=len(PANELS))
    figure.update_layout(
        template="simple_white",
        height=HEIGHT,
        font={"family": "system-ui, sans-serif", "size": 12.5, "color": INK},
        # The page lays its cursor and its phases over the same margins.
        margin={"l": 72, "r": 24, "t": 0, "b": FOOT, "autoexpand": False},
        paper_bgcolor="rgba(0,0,0,0)",
        showlegend=False,
    )
    return figure


def phase_table(result: Engagement) -> Table:
    """Tabulate the phases of a shift, ms."""
    rows = [
        (phase_title(p.name), in_ms(p.start), in_ms(p.end), in_ms(p.end - p.start))
        for p in result.phases
    ]
    return Table(("phase", "start, ms", "end, ms", "length, ms"), rows)


def facts(result: Engagement, torque_peak: float | None) -> list[str]:
    """List the facts on a shift beside its phases; ``torque_peak`` in N m."""
    return [*_meeting(result), *event_facts(result), *load_facts(result, torque_peak)]


def phase_title(name: str) -> str:
    """Name a phase for people; records keep the name itself."""
    return "free flight" if name == "free fly" else name


def event_facts(result: Engagement) -> list[str]:
    """List the events of a shift, in words."""
    events = result.events
    slid = f"faces slid {events.face_slide / MM:.1f} mm" if events.chamfer_slid else "no face slid"
    facts = [
        _counted(events.face_contacts, "face contact"),
        f"{_counted(events.slots_skipped, 'slot')} skipped",
        f"thrown back {events.rebound / MM:.2f} mm",
        f"held dog on dog {in_ms(events.time_blocked)} ms",
        slid,
    ]
    last = result.trace.relative_angle[-1:], result.trace.displacement[-1:]
    if result.outcome is Outcome.BLOCKED and crests_cross(result.clutch, *last)[0]:
        facts.append("stands crest across crest, where no chamfer lets go")
    return facts


def _counted(number: int, thing: str) -> str:
    return f"{number or 'no'} {thing}{'' if number == 1 else 's'}"


def load_facts(result: Engagement, torque_peak: float | None) -> list[str]:
    """List the loads of a shift, in words; ``torque_peak`` in N m."""
    loads, lasts = result.loads, peak_duration(result.trace) / MS
    facts = [
        f"peak force of rigid rings axial {loads.peak_axial_force:.0f} N, "
        f"tangential {loads.peak_tangential_force:.0f} N for {lasts:.2g} ms",
        f"hardest ms {loads.impact_impulse:.3g} N s, takes {loads.strike_mismatch / RPM:.3g} 1/min",
        f"dissipated {loads.energy_dissipated:.3g} J",
    ]
    if loads.residual_mismatch is not None:
        facts.append(f"flanks close with {loads.residual_mismatch / RPM:.3g} 1/min")
    if torque_peak is not None:
        facts.append(f"driveline peak {torque_peak:.3g} N m")
    return facts


def _meeting(result: Engagement) -> list[str]:
    """Describe the first contact of the rings; without a face it is their crests that pass."""
    flight, face = [phase for phase in result.phases if phase.name != DEAD_TIME][:2]
    if flight.end >= result.trace.time[-1]:
        return []
    speed = np.interp(flight.end, result.trace.time, result.trace.axial_speed)
    what = "first touch" if face.end > face.start else "crests meet"
    return [f"{what} with {abs(speed):.2f} m/s"]


def ring_body(dog: Dog, length: float) -> Mesh:
    """Mesh the ring behind the dogs, from their roots ``length`` m backwards.

    The frame is the ring's (see ``sim.shift.mesh``); a closed surface, normals outwards.
    """
    sides = 12 * dog.count
    angle = 2.0 * np.pi * np.arange(sides) / sides
    root = -0.5 * dog.height
    inner, outer = dog.inner_radius, dog.outer_radius
    rim = [(inner, root - length), (outer, root - length), (outer, root), (inner, root)]
    circles = [
        np.stack([radius * np.cos(angle), radius * np.sin(angle), np.full(sides, z)], axis=1)
        for radius, z in rim
    ]
    here = np.arange(sides)
    after = (here + 1) % sides
    cells = []
    for edge in range(4):
        a, b = edge * sides, (edge + 1) % 4 * sides
        cells.append(np.stack([here + a, after + a, after + b], axis=1))
        cells.append(np.stack([here + a, after + b, here + b], axis=1))
    return Mesh(np.concatenate(circles), np.concatenate(cells))


def solids(dog: Dog) -> dict[str, Any]:
    """Return one dog and the body of a ring, mm, as the page wants them.

    The triangles of the dog come in the order traction flank, face, braking
    flank (two each), then what cannot touch.
    """
    return {
        "dog": _plain(dog_solid(dog)),
        "body": _plain(ring_body(dog, BODY * dog.outer_radius)),
        "count": dog.count,
        "radius": dog.outer_radius / MM,
    }


def _plain(mesh: Mesh) -> dict[str, Any]:
    return {
        "vertices": np.round(mesh.vertices / MM, 4).ravel().tolist(),
        "cells": mesh.cells.ravel().tolist(),
    }
