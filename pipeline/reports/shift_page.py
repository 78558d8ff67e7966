"""One shift to look at: an animation with its curves, its facts, and the time series as a table.

The viewer of the rings is Drake's own, Meshcat with three.js inside, taken from the library as it
is installed, so that a page needs no network.
"""

from __future__ import annotations

from collections.abc import Mapping
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
from dogshape.pipeline.reports.charts import BLUE, GREEN, GREY, INK, ORANGE, styled
from dogshape.pipeline.reports.report import (
    as_script_json,
    figure_html,
    script,
    script_beside,
    write_page,
)
from dogshape.pipeline.reports.text import ENGINES, check_name, in_ms, value
from dogshape.sim.files import naming
from dogshape.sim.shift.conclusion import Engagement, Outcome
from dogshape.sim.shift.events import crests_cross, touching
from dogshape.sim.shift.geometry import Dog
from dogshape.sim.shift.mesh import dog_solid
from dogshape.sim.shift.trace import Trace
from dogshape.sim.statistics.blocks import events_record, loads_record
from dogshape.sim.units import DEG, MM, MS, RPM

SAMPLES = 6000  #: most points of a series on a page; longer ones are thinned
FORCE_CEILING = 4.0  #: end of the force axis over the largest shift force; impacts are far above
#: Colours of a phase: its button, and behind the curves.
TONES = {
    "free fly": ("#c3ccd5", "#f1f4f6"),
    "face contact": ("#eba394", "#fdeeea"),
    "entry": ("#ecd06f", "#fdf5d6"),
    "seating": ("#9fd0b0", "#e8f4ec"),
}
OTHER_TONES = ("#d7dde3", "#f7f8f9")


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
    viewer = Path(FindResourceOrThrow("drake/geometry/meshcat.js")).read_text(encoding="utf-8")
    codes = {"plotly": get_plotlyjs(), "meshcat": viewer}
    scripts = {
        name: script_beside(path, f"{name}.js", code) if scripts_beside else script(code)
        for name, code in codes.items()
    }
    phases = [
        {"name": phase_title(p.name), "start": p.start / MS, "end": p.end / MS,
         "tone": TONES.get(p.name, OTHER_TONES)[0]}
        for p in result.phases if p.end > p.start
    ]  # fmt: skip
    dog = result.clutch.dog
    data = {
        # Steps can be far below a microsecond; six digits of a ms keep them apart.
        "series": {name: np.round(v, 6).tolist() for name, v in _series(result.trace).items()},
        "phases": phases,
        "pitch": dog.pitch / MM,
        "height": dog.height / MM,
        "gap": dog.axial_gap / MM,
        "mean_radius": dog.mean_radius / MM,
        "profile": outline(dog, 1),
        "solids": solids(dog),
    }
    write_page(
        path,
        "shift.html.j2",
        result=result,
        mismatch=result.point.mismatch / RPM,
        angle=result.relative_angle / DEG,
        end=float(result.trace.time[-1]) / MS,
        engine=ENGINES[result.clutch.solver.engine],
        facts=[*event_facts(result), *load_facts(result, torque_peak)],
        phases=phases,
        data=as_script_json(data, allow_nan=True),
        curves=figure_html(curves(result), "curves"),
        **scripts,
    )


def _series(trace: Trace) -> dict[str, NDArray[np.float64]]:
    """Compute the series of the page over time, in its units, thinned to ``SAMPLES``.

    Impacts last a step or two: of the contact force the largest value of every interval is kept.
    """
    first = np.unique(np.linspace(0, len(trace.time) - 1, SAMPLES).astype(int))
    return {
        "time": trace.time[first] / MS,
        "displacement": trace.displacement[first] / MM,
        "relative_angle": trace.relative_angle[first],
        "output_speed": trace.output_speed[first] / RPM,
        "sliding_speed": trace.sliding_speed[first] / RPM,
        "mismatch": (trace.output_speed - trace.sliding_speed)[first] / RPM,
        "shift_force": trace.shift_force[first],
        "contact_force": np.maximum.reduceat(trace.contact_force, first),
        "touching": np.maximum.reduceat(touching(trace).astype(float), first),
    }


def curves(result: Engagement) -> go.Figure:
    """Draw displacement, speeds and forces over time, with the phases behind them."""
    series = _series(result.trace)
    figure = make_subplots(3, 1, shared_xaxes=True, vertical_spacing=0.05)
    lines: list[tuple[int, str, dict[str, Any]]] = [
        (1, "displacement", {"color": BLUE}),
        (2, "mismatch", {"color": INK, "dash": "dot", "width": 1.5}),
        (2, "sliding_speed", {"color": BLUE, "dash": "dashdot"}),
        (2, "output_speed", {"color": ORANGE, "dash": "dash"}),
        # A contact force is the mean of the step that ends at its time.
        (3, "contact_force", {"color": "#8a2c3a", "width": 1, "shape": "vh"}),
        (3, "shift_force", {"color": GREEN, "width": 2.5}),
    ]
    for row, name, line in lines:
        figure.add_scatter(
            x=series["time"], y=series[name], mode="lines", line={"width": 2, **line},
            name=name.replace("_", " "), hoverinfo="none", row=row, col=1,
        )  # fmt: skip
    for phase in result.phases:
        if phase.end > phase.start:
            tone = TONES.get(phase.name, OTHER_TONES)[1]
            figure.add_vrect(
                phase.start / MS, phase.end / MS, fillcolor=tone, opacity=1, line_width=0,
                layer="below",
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
    ceiling = FORCE_CEILING * max(1.0, float(result.trace.shift_force.max()))
    figure.update_yaxes(range=[0.0, ceiling], row=3)
    figure.update_xaxes(range=[0.0, float(series["time"][-1])])
    figure.update_xaxes(ticksuffix=" ms", row=3)
    styled(figure, 380).update_layout(font_size=12, hovermode="x")
    return figure.update_layout(margin={"l": 72, "r": 24, "t": 28, "b": 26})


def phase_table(result: Engagement) -> Table:
    """Tabulate the phases of a shift, ms."""
    rows = [
        (phase_title(p.name), in_ms(p.start), in_ms(p.end), in_ms(p.end - p.start))
        for p in result.phases
    ]
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


def load_facts(result: Engagement, torque_peak: float | None) -> list[str]:
    """List the loads of a shift, in words; ``torque_peak`` in N m."""
    return _words({**loads_record(result), "driveline_peak_Nm": torque_peak})


def _words(record: Mapping[str, Any]) -> list[str]:
    numbers = {key: one for key, one in record.items() if type(one) in (int, float)}
    return [f"{check_name(key)} {value(key, number)}" for key, number in numbers.items()]


def solids(dog: Dog) -> dict[str, Any]:
    """Return one dog of a ring, mm, and the ring about it, as the page wants them.

    The triangles of the dog come in the order traction flank, face, braking flank (two each), then
    what cannot touch.
    """
    mesh = dog_solid(dog)
    return {
        "vertices": np.round(mesh.vertices / MM, 4).ravel().tolist(),
        "cells": mesh.cells.ravel().tolist(),
        "count": dog.count,
        "inner": dog.inner_radius / MM,
        "outer": dog.outer_radius / MM,
    }
