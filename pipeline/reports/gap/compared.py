"""A comparison of bench and simulation as a figure."""

from __future__ import annotations

import plotly.graph_objects as go

from dogshape.diagnosis.bench.comparison import Comparison, Difference
from dogshape.pipeline.reports.gap.before_after import before_figure
from dogshape.pipeline.reports.gap.point_rows import CellRow
from dogshape.sim.units import RPM


def compared_figure(compared: Comparison) -> go.Figure:
    """Draw bench and simulated times of every operating point, ms over 1/min.

    The band is 90 % of what the difference may be by chance; it is drawn about the simulation.
    """
    return before_figure([_cell(d) for d in compared.differences], "", plain="simulated")


def _cell(difference: Difference) -> CellRow:
    cell, simulated = difference.cell, difference.simulated.mean_engaged
    return CellRow(
        mismatch_rpm=cell.point.mismatch / RPM,
        force_N=cell.point.profile.force,
        shifts=cell.n,
        engaged=cell.engaged,
        failed=cell.failed,
        unknown=cell.unknown,
        bench_s=cell.time,
        bench_error_s=None,
        simulated_s=simulated,
        simulated_error_s=None if simulated is None else difference.standard_error,
        gap_s=difference.gap,
        error_s=None if difference.gap is None else difference.standard_error,
        z=difference.z,
        foretold_s=None,
        foretold_error_s=None,
    )
