"""One shift: its problem is a study, an operating point and a relative angle."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, cast

from dogshape.pipeline.config.study_file import OWN_RISE, Place, Setup, points_of
from dogshape.pipeline.record import Figure, Frame, Result, Table
from dogshape.pipeline.reports.shift_page import (
    curves,
    event_facts,
    load_facts,
    phase_table,
    trace_frame,
    write_animation,
)
from dogshape.pipeline.reports.text import ENGINES, time_text
from dogshape.running import in_radians
from dogshape.sim.files import write_frame
from dogshape.sim.shift.conclusion import Engagement
from dogshape.sim.statistics.blocks import engage, events_record, loads_record
from dogshape.sim.strength.peak_force import peak_forces
from dogshape.sim.units import RPM

#: Largest mismatch in 1/min and force in N of the table of checked shifts (``docs/proof.md``).
CHECKED_RPM, CHECKED_N = 1000.0, 3000.0
CONVERGED = 0.01  #: of the shift time, by which finer steps may move it


@dataclass(frozen=True, repr=False)
class Shift(Result):
    """Simulated shift: outcome, time, phases, events, loads and time series.

    ``torque_peak`` is the largest torque in the driveline, N m, None where its stiffness is
    unknown; ``refined`` the same shift with finer steps, where it skipped a slot or bounced.
    """

    config: Setup
    engagement: Engagement
    torque_peak: float | None
    refined: Engagement | None = None

    @property
    def time_s(self) -> float | None:
        """Shift time, s; None unless the shift engaged."""
        return self.engagement.shift_time

    @property
    def converged(self) -> bool:
        """Whether finer steps leave outcome and, within a percent, time as they are.

        A shift that neither skips a slot nor bounces is not repeated: of 200 such shifts with
        shafts, linkages and up to 900 1/min none moved by a percent.
        """
        if self.refined is None:
            return True
        time, finer = self.time_s, self.refined.shift_time
        if time is None or finer is None:
            return self.engagement.outcome is self.refined.outcome
        return abs(finer - time) <= CONVERGED * time

    @property
    def warnings(self) -> tuple[str, ...]:
        """Sentences on a shift that is not converged, or is beyond the checked range."""
        one, finer, found = self.engagement, self.refined, list[str]()
        if finer is not None and not self.converged:
            time = f" in {time_text(finer.shift_time)}" if finer.shift_time else ""
            found.append(
                f"not converged: {finer.outcome.value.replace('_', ' ')}{time} with finer steps. "
                "After slots skipped or bounces a single shift depends on the steps; take a mean "
                "over angles (dogshape expect)"
            )
        for name, value, limit, unit in (
            ("mismatch", abs(one.point.mismatch) / RPM, CHECKED_RPM, "1/min"),
            ("shift force", one.point.profile.force, CHECKED_N, "N"),
        ):
            if value > limit * (1.0 + 1e-9):
                found.append(
                    f"{name} of {value:.6g} {unit} is beyond {limit:.6g} {unit}, up to which the "
                    "contact was checked (docs/proof.md)"
                )
        return tuple(found)

    def to_parts(self) -> list[str | Table]:
        """Give outcome, phases, events, loads and warnings."""
        one = self.engagement
        time = f" in {time_text(one.shift_time)}" if one.shift_time is not None else ""
        return [
            f"{one.outcome.value.replace('_', ' ')}{time}: {one.detail}",
            phase_table(one),
            "; ".join(event_facts(one)),
            *load_facts(one, self.torque_peak, self.config.limits),
            self.config.shafts_text,
            f"simulated by {ENGINES[one.clutch.solver.engine]}",
            *(f"warning: {warning}" for warning in self.warnings),
        ]

    def to_dict(self) -> dict[str, Any]:
        """Give outcome, time, phases, events, loads and solver, in the edge's units."""
        result, finer = self.engagement, self.refined
        solver, mechanism, peak = result.clutch.solver, self.config.mechanism, self.torque_peak
        return {
            "engine": solver.engine,
            "outcome": result.outcome.value,
            "shift_time_s": result.shift_time,
            "phases": [{"name": p.name, "start": p.start, "end": p.end} for p in result.phases],
            "peak_axial_force_N": result.loads.peak_axial_force,
            "events": events_record(result),
            "loads": {**loads_record(result), "torque_peak_Nm": peak, **self._peaks},
            "detail": result.detail,
            "warnings": list(self.warnings),
            "solver": {
                "scheme": solver.scheme,
                "accuracy": solver.accuracy,
                "max_step_s": solver.max_step,
                "steps": len(result.run.times),
                "evaluations": result.evaluations,
                "converged": self.converged,
                "refined_outcome": None if finer is None else finer.outcome.value,
                "refined_shift_time_s": None if finer is None else finer.shift_time,
                "dogs": result.clutch.dog.count if solver.all_dogs else 1,
                "contact_set": result.clutch.contact.name,
            },
            "shafts": self.config.clutch.drive.text,
            **({"mechanism": mechanism} if mechanism else {}),
        }

    @property
    def _peaks(self) -> dict[str, Any]:
        """Contact times and strike force that decide whether peak forces hold for rigid rings."""
        peaks = peak_forces(self.engagement, self.config.limits)
        return {
            "axial_contact_time_s": peaks.contact,
            "stress_wave_time_s": peaks.wave,
            "axially_rigid": peaks.rigid_axially,
            "strike_force_N": peaks.strike,
        }

    def to_frame(self) -> Frame:
        """Give the time series, columns as in bench traces."""
        return trace_frame(self.engagement.trace)

    def plot(self) -> Figure:
        """Draw displacement, speeds and forces over time, with the phases behind them."""
        return curves(self.engagement)

    def write_trace(self, path: str | Path) -> Path:
        """Write the time series as CSV or .xlsx, columns as in bench traces; give its path."""
        write_frame(self.to_frame(), Path(path))
        return Path(path)

    def report(self, path: str | Path) -> Path:
        """Write the animated page of the shift, which opens offline; give its path."""
        limits = self.config.limits
        write_animation(self.engagement, Path(path), self.torque_peak, limits=limits)
        return Path(path)


def simulate_shift(config: Setup, place: Place, angle_deg: float, all_dogs: bool) -> Shift:
    """Simulate one shift as ``Study.shift`` does, for a study that is read."""
    clutch = replace(config.clutch, solver=replace(config.clutch.solver, all_dogs=all_dogs))
    (point,) = points_of(config, place, OWN_RISE)
    (angle,) = cast("tuple[float]", in_radians([angle_deg]))
    result = engage(clutch, point, angle)
    chaotic = result.events.slots_skipped > 0 or result.events.face_contacts > 1
    refined = engage(clutch.refined(), point, angle) if chaotic else None
    return Shift(config, result, config.torque_peak(result), refined)
