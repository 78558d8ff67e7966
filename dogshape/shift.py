"""One shift: its problem is a study, an operating point and a relative angle."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dogshape.pipeline.config.asked_points import point_of
from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.reports.shift.animation import curves, trace_frame, write_animation
from dogshape.result import Result, ms
from dogshape.sim.engines import engage
from dogshape.sim.errors import InputError, refusal
from dogshape.sim.shift.conclusion import Engagement
from dogshape.sim.shift.driveline import TorquePeaks
from dogshape.sim.statistics.batch import events_record, loads_record, shaft_record
from dogshape.sim.strength.manufacture import require_makeable
from dogshape.sim.units import DEG, RPM

if TYPE_CHECKING:
    import pandas as pd
    import plotly.graph_objects as go

OWN_RISE = ", or give --force-rise-s"  #: for forces that the study's table lacks


@dataclass(frozen=True, repr=False)
class Shift(Result):
    """Simulated shift: outcome, time, phases, events, loads and time series.

    Parameters
    ----------
    config : the study that was asked.
    engagement : what the simulation gave, with clutch, operating point and relative angle.
    torque_peaks : of the driveline, N m; None where the study does not know its stiffness.
    """

    config: Setup
    engagement: Engagement
    torque_peaks: TorquePeaks | None

    @property
    def time_s(self) -> float | None:
        """Shift time, s; None unless the shift engaged."""
        return self.engagement.shift_time

    @property
    def torque_peak(self) -> float | None:
        """Largest torque in the driveline, N m; None where its stiffness is unknown."""
        return None if self.torque_peaks is None else self.torque_peaks.whole

    @property
    def facts(self) -> dict[str, str]:
        """Outcome, time, and where and how it was simulated."""
        one = self.engagement
        return {
            "outcome": one.outcome.value,
            "shift time": ms(one.shift_time),
            "mismatch": f"{one.point.mismatch / RPM:.4g} 1/min",
            "force": f"{one.point.profile.force:.1f} N",
            "relative angle": f"{one.relative_angle / DEG:.4g} deg",
        }

    def to_dict(self) -> dict[str, Any]:
        """Give outcome, time, phases, events, loads and solver, in the edge's units."""
        result, peaks = self.engagement, self.torque_peaks
        solver = result.clutch.solver
        return {
            "engine": solver.engine,
            "outcome": result.outcome.value,
            "shift_time_s": result.shift_time,
            "phases": [{"name": p.name, "start": p.start, "end": p.end} for p in result.phases],
            "peak_axial_force_N": result.loads.peak_axial_force,
            "events": events_record(result),
            "loads": {
                **loads_record(result),
                **shaft_record(result.trace),
                "torque_peak_Nm": None if peaks is None else peaks.whole,
                "torque_peak_strike_Nm": None if peaks is None else peaks.strike,
                "torque_peak_closing_Nm": None if peaks is None else peaks.closing,
            },
            "detail": result.detail,
            "solver": {
                "scheme": solver.scheme,
                "accuracy": solver.accuracy,
                "max_step_s": solver.max_step,
                "steps": result.steps,
                "evaluations": result.evaluations,
                "dogs": result.clutch.dog.count if solver.all_dogs else 1,
                "contact_set": result.clutch.contact.name,
            },
            **({"mechanism": self.config.mechanism} if self.config.mechanism else {}),
        }

    def to_frame(self) -> pd.DataFrame:
        """Give the time series, columns as in bench traces."""
        return trace_frame(self.engagement.trace)

    def plot(self) -> go.Figure:
        """Draw displacement, speeds and forces over time, with the phases behind them."""
        return curves(self.engagement)

    def report(self, path: str | Path) -> Path:
        """Write the animated page of the shift, which opens offline; give its path."""
        write_animation(self.engagement, Path(path), self.torque_peak)
        return Path(path)


def simulate_shift(
    config: Setup,
    mismatch_rpm: float,
    force_N: float,
    angle_deg: float,
    force_rise_s: float | None = None,
    *,
    all_dogs: bool = False,
) -> Shift:
    """Simulate one shift of a study.

    Parameters
    ----------
    mismatch_rpm : speed of ring against ring before the shift, 1/min; positive runs the traction
        flanks together (docs/mismatch.md).
    force_N : final shift force, N.
    angle_deg : lead of the output ring over dogs facing dogs, deg.
    force_rise_s : rise time of the force, s; None for that of the study's table.
    all_dogs : whether to model every dog instead of one pair with the symmetry of all.

    Raises
    ------
    InputError, GeometryError
        For a dog that cannot be made, a force without a rise time, an angle that is no number.
    """
    require_makeable(config.clutch.dog, config.limits.manufacturing)
    clutch = replace(config.clutch, solver=replace(config.clutch.solver, all_dogs=all_dogs))
    point = point_of(config, mismatch_rpm, force_N, force_rise_s, OWN_RISE)
    if not abs(angle_deg) <= 1e6:
        rule, remedy = "it must be a finite angle", "give an angle in degrees"
        raise InputError(refusal("relative angle", angle_deg, "deg", rule, remedy))
    result = engage(clutch, point, angle_deg * DEG)
    return Shift(config, result, config.torque_peaks(result.clutch, result.trace, result.loads))
