"""One shift to look at: an animation with its curves, its facts, and the time series as a table.

The viewer of the rings is Drake's own, Meshcat with three.js inside, taken from the library as it
is installed, so that a page needs no network.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import plotly.graph_objects as go
from markupsafe import Markup
from plotly.offline import get_plotlyjs
from plotly.subplots import make_subplots
from pydrake.common import FindResourceOrThrow

from dogshape.pipeline.export.drawing import outline
from dogshape.pipeline.record import Table
from dogshape.pipeline.reports.charts import BLUE, GREEN, GREY, INK, ORANGE, styled
from dogshape.pipeline.reports.report import figure_html, script, write_page
from dogshape.pipeline.reports.text import ENGINES, check_name, in_ms, minus, value
from dogshape.sim import kernel
from dogshape.sim.files import write_whole
from dogshape.sim.shift.conclusion import Engagement, Outcome
from dogshape.sim.shift.mesh import dog_solid
from dogshape.sim.shift.trace import Phase, Trace, crests_cross
from dogshape.sim.statistics.blocks import events_record, loads_record
from dogshape.sim.strength.dog_strength import Limits
from dogshape.sim.strength.peak_force import PeakForces, peak_forces
from dogshape.sim.units import DEG, MM, MS, RPM

TANGENTIAL = "peak_tangential_force_N"
NO_STRIKE = Limits()
SHOWN_FORCES = 5.0  #: largest shift forces on the axis of a peak beyond rigid rings
SAMPLES = 6000  #: most points of a series on a page; longer ones are thinned
#: Colours of the phases.
TONES = {
    "dead time": "#d7dde3", "free fly": "#c3ccd5", "face contact": "#eba394", "entry": "#ecd06f",
    "seating": "#9fd0b0",
}  # fmt: skip
#: Curves by column: panel from above, and look. A contact force is the mean of the step before.
CURVES: dict[str, tuple[int, dict[str, Any]]] = {
    "displacement_mm": (1, {"color": BLUE}),
    "mismatch_rpm": (2, {"color": INK, "dash": "dot", "width": 1.5}),
    "sliding_speed_rpm": (2, {"color": BLUE, "dash": "dashdot"}),
    "output_speed_rpm": (2, {"color": ORANGE, "dash": "dash"}),
    "contact_force_N": (3, {"color": "#8a2c3a", "width": 1, "shape": "vh"}),
    "force_N": (3, {"color": GREEN, "width": 2.5}),
}


def trace_frame(trace: Trace) -> pd.DataFrame:
    """Tabulate the time series of a shift, columns as in bench traces."""
    return pd.DataFrame({
        "t_s": trace.time,
        "displacement_mm": trace.displacement / MM,
        "force_N": trace.shift_force,
        "sliding_speed_rpm": trace.sliding_speed / RPM,
        "output_speed_rpm": trace.output_speed / RPM,
        "relative_angle_deg": trace.relative_angle / DEG,
        "contact_force_N": trace.contact_force,
    })  # fmt: skip


def _series(result: Engagement) -> pd.DataFrame:
    """Thin the time series to ``SAMPLES``; of impacts the largest force of an interval is kept."""
    trace = result.trace
    first = np.unique(np.linspace(0, len(trace.time) - 1, SAMPLES).astype(int))
    found = trace_frame(trace).iloc[first]
    touches = kernel.touching(
        trace.time, trace.contact_force, trace.tangential_force * result.clutch.dog.mean_radius,
        trace.shift_force, result.clutch.numbers,
    )  # fmt: skip
    return found.assign(
        contact_force_N=np.maximum.reduceat(trace.contact_force, first),
        touching=np.maximum.reduceat(touches.astype(float), first),
        mismatch_rpm=found["output_speed_rpm"] - found["sliding_speed_rpm"],
    )


def write_animation(
    result: Engagement, path: Path, torque_peak: float | None = None, shared: bool = False,
    limits: Limits = NO_STRIKE,
) -> None:  # fmt: skip
    """Write the shift as one HTML page that opens without a network.

    ``torque_peak`` is the driveline's, N m, where the study knows its stiffness, ``limits`` have
    its strikes; ``shared`` is whether many pages in one folder share the code of their figures,
    megabytes each.
    """
    viewer = Path(FindResourceOrThrow("drake/geometry/meshcat.js")).read_text(encoding="utf-8")
    scripts = {"plotly": get_plotlyjs(), "meshcat": viewer}
    for name, code in scripts.items():
        beside = path.with_name(f"{name}.js")
        if shared and not (beside.is_file() and beside.read_text("utf-8") == code):
            write_whole(beside, code)
        link = Markup('<script src="{}"></script>').format(beside.name)
        scripts[name] = link if shared else script(code)
    dog, point, contact = result.clutch.dog, result.point, result.clutch.contact.name
    data = {
        # Steps can be far below a microsecond; nine digits of a second keep them apart.
        "series": _series(result).round(9).to_dict("list"),
        "phases": [
            {"name": phase_title(p.name), "start": p.start, "end": p.end, "tone": TONES[p.name]}
            for p in _taken(result)
        ],
        "pitch": dog.pitch / MM,
        "height": dog.height / MM,
        "gap": dog.axial_gap / MM,
        "radii": [dog.inner_radius / MM, dog.outer_radius / MM],
        "count": dog.count,
        "profile": outline(dog, 1),
        "vertices": np.round(dog_solid(dog).vertices / MM, 4).ravel().tolist(),
        "cells": dog_solid(dog).cells.ravel().tolist(),
    }  # fmt: skip
    end = f"at {in_ms(float(result.trace.time[-1]))} ms"
    outcome = result.outcome.value.replace("_", " ").capitalize()
    where = (
        f"at {point.mismatch / RPM:.4g} 1/min, {point.profile.force:.4g} N, relative angle "
        f"{result.relative_angle / DEG:.2f}°"
    )
    write_page(
        path,
        "shift.html.j2",
        outcome=f"{outcome} {end}" if result.shift_time is None else
        f"{outcome} in {in_ms(result.shift_time)} ms",
        where=minus(where),
        how=f"{dog.count} dogs, contact {contact}, by {ENGINES[result.clutch.solver.engine]}",
        facts=[*event_facts(result), *load_facts(result, torque_peak, limits)],
        phases=data["phases"],
        data=json.dumps(data, separators=(",", ":")).replace("<", "\\u003c"),
        curves=figure_html(curves(result), "curves"),
        **scripts,
    )  # fmt: skip


def _taken(result: Engagement) -> list[Phase]:
    """Select the phases that took time: without a touch of faces there is no face contact."""
    return [phase for phase in result.phases if phase.end > phase.start]


def curves(result: Engagement) -> go.Figure:
    """Draw displacement, speeds and forces over time, with the phases behind them."""
    series = _series(result)
    time = 1e3 * series["t_s"]
    figure = make_subplots(3, 1, shared_xaxes=True, vertical_spacing=0.05)
    for name, (row, line) in CURVES.items():
        title = "shift force" if name == "force_N" else " ".join(name.split("_")[:-1])
        figure.add_scatter(
            x=time, y=series[name], mode="lines", line={"width": 2, **line}, name=title,
            hoverinfo="none", row=row, col=1,
        )  # fmt: skip
    for phase in _taken(result):
        figure.add_vrect(
            phase.start / MS, phase.end / MS, fillcolor=TONES[phase.name], opacity=0.25,
            line_width=0, layer="below",
        )  # fmt: skip
    for text, level, where in (
        ("crests meet", result.clutch.dog.axial_gap, "top left"),
        ("engaged", result.clutch.shift_travel, "bottom left"),
    ):
        figure.add_hline(
            level / MM, row=1, opacity=1, line={"color": GREY, "width": 1, "dash": "dot"},
            annotation_text=text, annotation_position=where, annotation_font_size=11,
        )  # fmt: skip
    for row, unit in enumerate(("mm", "1/min", "N"), start=1):
        figure.update_yaxes(title={"text": unit, "standoff": 8}, nticks=5, row=row)
    figure.update_yaxes(rangemode="tozero", row=3)
    most = SHOWN_FORCES * float(result.trace.shift_force.max())
    if most < result.loads.peak_axial_force and not peak_forces(result, NO_STRIKE).rigid_axially:
        figure.update_yaxes(range=[0.0, most], row=3)
    figure.update_xaxes(range=[0.0, float(time.iloc[-1])])
    figure.update_xaxes(ticksuffix=" ms", row=3)
    styled(figure, 380).update_layout(font_size=12, hovermode="x")
    return figure.update_layout(margin={"l": 72, "r": 24, "t": 28, "b": 26})


def phase_table(result: Engagement) -> Table:
    """Tabulate the phases of a shift that took time, ms."""
    spans = [(p.name, (p.start, p.end, p.end - p.start)) for p in _taken(result)]
    rows = [(phase_title(name), *map(in_ms, times)) for name, times in spans]
    return Table(("phase", "start, ms", "end, ms", "length, ms"), rows)


def phase_title(name: str) -> str:
    """Name a phase for people; records keep the name itself."""
    return "free flight" if name == "free fly" else name


def event_facts(result: Engagement) -> list[str]:
    """List the events of a shift, in words."""
    facts = _words(events_record(result))
    last = result.trace.relative_angle[-1:], result.trace.displacement[-1:]
    if result.outcome is Outcome.BLOCKED and crests_cross(result.clutch, *last)[0]:
        facts.append("stands crest across crest, where no chamfer lets go")
    return facts


def load_facts(
    result: Engagement, torque_peak: float | None, limits: Limits = NO_STRIKE
) -> list[str]:
    """List the loads of a shift, in words; ``torque_peak`` in N m.

    Peak forces beyond rigid rings are marked, or replaced by those of the study's strike.
    """
    record, peaks = loads_record(result), peak_forces(result, limits)
    forces = [_axial_words(peaks), _tangential_words(peaks)]
    others = {k: v for k, v in record.items() if k not in ("peak_axial_force_N", TANGENTIAL)}
    return [*forces, *_words({**others, "driveline_peak_Nm": torque_peak})]


def _axial_words(peaks: PeakForces) -> str:
    if peaks.rigid_axially:
        return f"peak axial force {value('_N', peaks.axial)}"
    return (
        f"peak axial force below {value('_N', peaks.axial)}: the contact takes "
        f"{1e6 * peaks.contact:.3g} us, a stress wave through the ring and back "
        f"{1e6 * peaks.wave:.3g} us"
    )


def _tangential_words(peaks: PeakForces) -> str:
    simulated = value("_N", peaks.tangential)
    if peaks.shafts or peaks.tangential == 0.0:
        return f"peak tangential force {simulated}"
    if peaks.strike is not None and peaks.strike < peaks.tangential:
        struck = value("_N", peaks.strike)
        return f"peak tangential force {struck} by [strike], {simulated} if both sides were rigid"
    return (
        f"peak tangential force {simulated} with both sides rigid, an upper estimate; "
        "mechanism.ring_inertia_kgm2 and input_stiffness_Nm_rad give ring and shaft"
    )


def _words(record: Mapping[str, Any]) -> list[str]:
    numbers = {key: one for key, one in record.items() if type(one) in (int, float)}
    return [f"{check_name(key)} {value(key, number)}" for key, number in numbers.items()]
