"""Page of a single shift: animation, curves and facts; its time series as a table.

The viewer of the rings is Meshcat, with three.js, from the installed Drake: a page needs no
network.
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
from plotly.subplots import make_subplots
from pydrake.common import FindResourceOrThrow

from dogshape.pipeline.export.drawing import outline
from dogshape.pipeline.record import Table
from dogshape.pipeline.reports.charts import BLUE, GREEN, GREY, INK, ORANGE, styled
from dogshape.pipeline.reports.report import figure_html, packed_script, plotly_code, write_page
from dogshape.pipeline.reports.text import ENGINES, check_name, in_ms, minus, value
from dogshape.sim import kernel
from dogshape.sim.files import write_whole
from dogshape.sim.shift.conclusion import Engagement, Outcome
from dogshape.sim.shift.geometry import Dog
from dogshape.sim.shift.mesh import dog_solid
from dogshape.sim.shift.pair import RingDogs
from dogshape.sim.shift.trace import Phase, Trace, crests_cross
from dogshape.sim.statistics.blocks import events_record, loads_record
from dogshape.sim.strength.dog_strength import Limits
from dogshape.sim.strength.peak_force import PeakForces, peak_forces
from dogshape.sim.units import DEG, MM, MS, RPM

TANGENTIAL = "peak_tangential_force_N"
NO_STRIKE = Limits()
MAX_FORCE_RATIO = 5.0  #: end of the force axis over the shift force, for peaks beyond rigid rings
MAX_SAMPLES = 6000  #: points of a series on a page; longer series are thinned
#: Colours of the phases.
PHASE_COLOURS = {
    "dead time": "#d7dde3",
    "free fly": "#c3ccd5",
    "face contact": "#eba394",
    "entry": "#ecd06f",
    "seating": "#9fd0b0",
}
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


def _series(result: Engagement) -> pd.DataFrame:
    """Thin the time series to ``MAX_SAMPLES``; contact forces are maxima over intervals."""
    trace = result.trace
    starts = np.unique(np.linspace(0, len(trace.time) - 1, MAX_SAMPLES).astype(int))
    series = trace_frame(trace).iloc[starts]
    touches = kernel.touching(
        trace.time,
        trace.contact_force,
        trace.tangential_force * result.clutch.dog.mean_radius,
        trace.shift_force,
        result.clutch.numbers,
    )
    return series.assign(
        contact_force_N=np.maximum.reduceat(trace.contact_force, starts),
        touching=np.maximum.reduceat(touches.astype(float), starts),
        mismatch_rpm=series.output_speed_rpm - series.sliding_speed_rpm,
    )


def write_animation(
    result: Engagement,
    path: Path,
    torque_peak: float | None = None,
    shared: bool = False,
    limits: Limits = NO_STRIKE,
) -> None:
    """Write a shift as an HTML page that opens without a network.

    ``torque_peak`` is the peak torque of the driveline, N m, None if its stiffness is unknown;
    ``limits`` have the strike of the study. With ``shared`` the pages of a folder share the code
    of their figures.
    """
    viewer = Path(FindResourceOrThrow("drake/geometry/meshcat.js")).read_text(encoding="utf-8")
    scripts = {"plotly": plotly_code(), "meshcat": viewer}
    for name, code in scripts.items():
        if not shared:
            scripts[name] = packed_script(code)
            continue
        shared_path = path.with_name(f"{name}.js")
        if not (shared_path.is_file() and shared_path.read_text("utf-8") == code):
            write_whole(shared_path, code)
        scripts[name] = Markup('<script src="{}"></script>').format(shared_path.name)
    data = _animation_data(result)
    dog = result.clutch.dog
    point = result.point
    contact = result.clutch.contact.name
    outcome = result.outcome.value.replace("_", " ").capitalize()
    if result.shift_time is None:
        outcome = f"{outcome} at {in_ms(float(result.trace.time[-1]))} ms"
    else:
        outcome = f"{outcome} in {in_ms(result.shift_time)} ms"
    where = (
        f"at {point.mismatch / RPM:.4g} 1/min, {point.profile.force:.4g} N, relative angle "
        f"{result.relative_angle / DEG:.2f}°"
    )
    write_page(
        path,
        "shift.html.j2",
        outcome=outcome,
        where=minus(where),
        how=f"{dog.count} dogs, contact {contact}, by {ENGINES[result.clutch.solver.engine]}",
        facts=[*event_facts(result), *load_facts(result, torque_peak, limits)],
        phases=data["phases"],
        data=json.dumps(data, separators=(",", ":")).replace("<", "\\u003c"),
        curves=figure_html(curves(result), "curves"),
        **scripts,
    )


def _animation_data(result: Engagement) -> dict[str, Any]:
    """Collect series, phases and geometry of a shift as the scripts of the page read them."""
    pair = result.clutch.pair
    dog = pair.sliding
    phases = [
        {
            "name": phase_title(phase.name),
            "start": phase.start,
            "end": phase.end,
            "tone": PHASE_COLOURS[phase.name],
        }
        for phase in _nonzero_phases(result)
    ]
    return {
        # Steps can be far below a microsecond; nine digits of a second tell them apart.
        "series": _series(result).round(9).to_dict("list"),
        "phases": phases,
        "pitch": dog.pitch / MM,
        "travel": pair.travel / MM,
        "length": pair.axial_length / MM,
        "radii": [dog.inner_radius / MM, dog.outer_radius / MM],
        "count": dog.count,
        "sliding": _ring_shape(pair.sliding_dogs),
        "output": _ring_shape(pair.output_dogs),
    }


def _ring_shape(ring: RingDogs) -> dict[str, Any]:
    """Collect sections and surfaces of a ring's dogs in mm; the root is below the pitch plane."""
    return {
        "root": ring.dog.dedendum / MM,
        "pitches": ring.pitches,
        "low": None if ring.low is None else _dog_shape(ring.low),
        **_dog_shape(ring.dog),
    }


def _dog_shape(dog: Dog) -> dict[str, Any]:
    """Collect section and surface of a dog in mm."""
    solid = dog_solid(dog)
    return {
        "profile": outline(RingDogs(dog), 1),
        "vertices": np.round(solid.vertices / MM, 4).ravel().tolist(),
        "cells": solid.cells.ravel().tolist(),
    }


def _nonzero_phases(result: Engagement) -> list[Phase]:
    """Select the phases longer than zero: a shift may have no face contact."""
    return [phase for phase in result.phases if phase.end > phase.start]


def curves(result: Engagement) -> go.Figure:
    """Draw displacement, speeds and forces over time, with the phases behind them."""
    series = _series(result)
    time = 1e3 * series.t_s
    figure = make_subplots(3, 1, shared_xaxes=True, vertical_spacing=0.05)
    for name, (row, line) in CURVES.items():
        title = "shift force" if name == "force_N" else " ".join(name.split("_")[:-1])
        figure.add_scatter(
            x=time,
            y=series[name],
            mode="lines",
            line={"width": 2, **line},
            name=title,
            hoverinfo="none",
            row=row,
            col=1,
        )
    for phase in _nonzero_phases(result):
        figure.add_vrect(
            phase.start / MS,
            phase.end / MS,
            fillcolor=PHASE_COLOURS[phase.name],
            opacity=0.25,
            line_width=0,
            layer="below",
        )
    for text, level, position in (
        ("crests meet", result.clutch.dog.axial_gap, "top left"),
        ("engaged", result.clutch.shift_travel, "bottom left"),
    ):
        figure.add_hline(
            level / MM,
            row=1,
            opacity=1,
            line={"color": GREY, "width": 1, "dash": "dot"},
            annotation_text=text,
            annotation_position=position,
            annotation_font_size=11,
        )
    for row, unit in enumerate(("mm", "1/min", "N"), start=1):
        figure.update_yaxes(title={"text": unit, "standoff": 8}, nticks=5, row=row)
    figure.update_yaxes(rangemode="tozero", row=3)
    max_force = MAX_FORCE_RATIO * float(result.trace.shift_force.max())
    is_cut = max_force < result.loads.peak_axial_force
    if is_cut and not peak_forces(result, NO_STRIKE).rigid_axially:
        figure.update_yaxes(range=[0.0, max_force], row=3)
    figure.update_xaxes(range=[0.0, float(time.iloc[-1])])
    figure.update_xaxes(ticksuffix=" ms", row=3)
    styled(figure, 380).update_layout(font_size=12, hovermode="x")
    return figure.update_layout(margin={"l": 72, "r": 24, "t": 28, "b": 26})


def phase_table(result: Engagement) -> Table:
    """Tabulate start, end and length of the phases of a shift, ms; those of no length lack."""
    rows = []
    for phase in _nonzero_phases(result):
        times = (phase.start, phase.end, phase.end - phase.start)
        rows.append((phase_title(phase.name), *map(in_ms, times)))
    return Table(("phase", "start, ms", "end, ms", "length, ms"), rows)


def phase_title(name: str) -> str:
    """Print the name of a phase; records have the name itself."""
    return "free flight" if name == "free fly" else name


def event_facts(result: Engagement) -> list[str]:
    """List the events of a shift, in words."""
    facts = _words(events_record(result))
    last_angle = result.trace.relative_angle[-1:]
    last_displacement = result.trace.displacement[-1:]
    is_blocked = result.outcome is Outcome.BLOCKED
    if is_blocked and crests_cross(result.clutch, last_angle, last_displacement)[0]:
        facts.append("stands crest across crest, where no chamfer lets go")
    return facts


def load_facts(result: Engagement, torque_peak: float | None, limits: Limits) -> list[str]:
    """List the loads of a shift, in words; ``torque_peak`` in N m.

    Peak forces beyond rigid rings are marked, or replaced by those of the study's strike.
    """
    peaks = peak_forces(result, limits)
    forces = [_axial_words(peaks), _tangential_words(peaks)]
    loads = loads_record(result)
    for key in ("peak_axial_force_N", TANGENTIAL):
        loads.pop(key, None)
    return [*forces, *_words({**loads, "driveline_peak_Nm": torque_peak})]


def _axial_words(peaks: PeakForces) -> str:
    """Print the peak axial force, with the times that make it an upper bound."""
    if peaks.rigid_axially:
        return f"peak axial force {value('_N', peaks.axial)}"
    return (
        f"peak axial force below {value('_N', peaks.axial)}: the contact takes "
        f"{1e6 * peaks.contact:.3g} us, a stress wave through the ring and back "
        f"{1e6 * peaks.wave:.3g} us"
    )


def _tangential_words(peaks: PeakForces) -> str:
    """Describe the peak tangential force.

    It is that of the study's strike if this is below the simulated one.
    """
    simulated = value("_N", peaks.tangential)
    if peaks.shafts or peaks.tangential == 0.0:
        return f"peak tangential force {simulated}"
    if peaks.strike is not None and peaks.strike < peaks.tangential:
        strike = value("_N", peaks.strike)
        return f"peak tangential force {strike} by [strike], {simulated} if both sides were rigid"
    return (
        f"peak tangential force {simulated} with both sides rigid, an upper estimate; "
        "mechanism.ring_inertia_kgm2 and input_stiffness_Nm_rad give ring and shaft"
    )


def _words(record: Mapping[str, Any]) -> list[str]:
    """Print the numbers of a record with name and unit; other values are left out."""
    words = []
    for key, number in record.items():
        if type(number) in (int, float):
            words.append(f"{check_name(key)} {value(key, number)}")
    return words
