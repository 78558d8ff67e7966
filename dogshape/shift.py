"""One shift: its problem is a study, an operating point and a relative angle."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, cast

from dogshape.pipeline.config.study_file import RequestedPoint, Setup, points_of
from dogshape.pipeline.record import Figure, Frame, Table
from dogshape.pipeline.reports.shift_page import (
    curves,
    event_facts,
    load_facts,
    phase_table,
    trace_frame,
    write_animation,
)
from dogshape.pipeline.reports.text import ENGINES, time_text
from dogshape.result import Result
from dogshape.running import in_radians
from dogshape.sim.files import write_frame
from dogshape.sim.interface import argument, verb
from dogshape.sim.shift.conclusion import Engagement
from dogshape.sim.statistics.blocks import engage, events_record, loads_record
from dogshape.sim.strength.peak_force import peak_forces
from dogshape.sim.units import RPM

#: Largest mismatch and force of the table of checked shifts (``docs/proof.md``).
MAX_CHECKED_RPM = 1000.0
MAX_CHECKED_N = 3000.0
LIMIT_TOLERANCE = 1e-9  #: relative rounding error of converted units
CONVERGENCE_TOLERANCE = 0.01  #: relative change of the shift time by finer steps


@dataclass(frozen=True, repr=False)
class Shift(Result):
    """Simulated shift: outcome, time, phases, events, loads and time series."""

    config: Setup
    engagement: Engagement
    #: largest torque in the driveline, N m; None where its stiffness is unknown
    torque_peak: float | None
    #: the same shift with finer steps; None unless the shift skipped a slot or bounced
    refined: Engagement | None = None

    @property
    def time_s(self) -> float | None:
        """Shift time, s; None unless the shift engaged."""
        return self.engagement.shift_time

    @property
    def converged(self) -> bool:
        """Whether finer steps confirm the outcome and, within a percent, the time.

        A shift that neither skips a slot nor bounces is not repeated: of 200 such shifts, with
        shafts and linkages and up to 900 1/min, none changed by a percent.
        """
        if self.refined is None:
            return True
        time = self.time_s
        refined_time = self.refined.shift_time
        if time is None or refined_time is None:
            return self.engagement.outcome is self.refined.outcome
        return abs(refined_time - time) <= CONVERGENCE_TOLERANCE * time

    @property
    def warnings(self) -> tuple[str, ...]:
        """Sentences on a shift that is not converged or lies beyond the checked range."""
        point = self.engagement.point
        refined = self.refined
        warnings: list[str] = []
        if refined is not None and not self.converged:
            time = f" in {time_text(refined.shift_time)}" if refined.shift_time else ""
            outcome = refined.outcome.value.replace("_", " ")
            warnings.append(
                f"not converged: {outcome}{time} with finer steps. "
                "After slots skipped or bounces a single shift depends on the steps; take a mean "
                f"over angles ({verb('expect')})"
            )
        for name, value, limit, unit in (
            ("mismatch", abs(point.mismatch) / RPM, MAX_CHECKED_RPM, "1/min"),
            ("shift force", point.profile.force, MAX_CHECKED_N, "N"),
        ):
            if value > limit * (1.0 + LIMIT_TOLERANCE):
                warnings.append(
                    f"{name} of {value:.6g} {unit} is beyond {limit:.6g} {unit}, up to which the "
                    "contact was checked (docs/proof.md)"
                )
        return tuple(warnings)

    def to_parts(self) -> list[str | Table]:
        """Describe outcome, phases, events, loads and warnings."""
        result = self.engagement
        time = f" in {time_text(result.shift_time)}" if result.shift_time is not None else ""
        parts: list[str | Table] = [
            f"{result.outcome.value.replace('_', ' ')}{time}: {result.detail}",
            phase_table(result),
            "; ".join(event_facts(result)),
            *load_facts(result, self.torque_peak, self.config.limits),
            self.config.shafts_text,
        ]
        if self.config.actuator_text:
            parts.append(self.config.actuator_text)
        parts.append(f"simulated by {ENGINES[result.clutch.solver.engine]}")
        parts += [f"warning: {warning}" for warning in self.warnings]
        return parts

    def to_dict(self) -> dict[str, Any]:
        """Convert outcome, time, phases, events, loads and solver to values of JSON."""
        result = self.engagement
        refined = self.refined
        solver = result.clutch.solver
        mechanism = self.config.mechanism
        actuator = result.clutch.actuator
        loads = {
            **loads_record(result),
            "torque_peak_Nm": self.torque_peak,
            **self._rigidity_record,
        }
        return {
            "engine": solver.engine,
            "outcome": result.outcome.value,
            "shift_time_s": result.shift_time,
            "phases": [{"name": p.name, "start": p.start, "end": p.end} for p in result.phases],
            "peak_axial_force_N": result.loads.peak_axial_force,
            "events": events_record(result),
            "loads": loads,
            "detail": result.detail,
            "warnings": list(self.warnings),
            "solver": {
                "scheme": solver.scheme,
                "accuracy": solver.accuracy,
                "max_step_s": solver.max_step,
                "steps": len(result.run.times),
                "evaluations": result.evaluations,
                "converged": self.converged,
                "refined_outcome": None if refined is None else refined.outcome.value,
                "refined_shift_time_s": None if refined is None else refined.shift_time,
                "dogs": result.clutch.dog.count if solver.all_dogs else 1,
                "contact_set": result.clutch.contact.name,
            },
            "shafts": self.config.clutch.drive.text,
            **({"actuator": actuator.record} if actuator else {}),
            **({"mechanism": mechanism} if mechanism else {}),
        }

    @property
    def _rigidity_record(self) -> dict[str, Any]:
        """Contact time, stress wave time and strike force, which show if rigid rings are valid."""
        peaks = peak_forces(self.engagement, self.config.limits)
        return {
            "axial_contact_time_s": peaks.contact,
            "stress_wave_time_s": peaks.wave,
            "axially_rigid": peaks.rigid_axially,
            "strike_force_N": peaks.strike,
        }

    def to_frame(self) -> Frame:
        """Tabulate the time series, columns as in bench traces."""
        return trace_frame(self.engagement.trace)

    def plot(self) -> Figure:
        """Draw displacement, speeds and forces over time, with the phases behind them."""
        return curves(self.engagement)

    def write_trace(self, path: str | Path) -> Path:
        """Write the time series as CSV or .xlsx, columns as in bench traces; returns its path."""
        write_frame(self.to_frame(), Path(path))
        return Path(path)

    def report(self, path: str | Path) -> Path:
        """Write the animated page of the shift, which opens offline; returns its path."""
        limits = self.config.limits
        write_animation(self.engagement, Path(path), self.torque_peak, limits=limits)
        return Path(path)


def simulate_shift(
    config: Setup, requested: RequestedPoint, angle_deg: float, all_dogs: bool
) -> Shift:
    """Simulate one shift at an operating point and a relative angle; see ``Study.shift``."""
    clutch = replace(config.clutch, solver=replace(config.clutch.solver, all_dogs=all_dogs))
    remedy = f", or give {argument('force_rise_s')}"  # for a force without a rise time
    (point,) = points_of(config, requested, remedy)
    (angle,) = cast("tuple[float]", in_radians([angle_deg]))
    result = engage(clutch, point, angle)
    chaotic = result.events.slots_skipped > 0 or result.events.face_contacts > 1
    refined = engage(clutch.refined(), point, angle) if chaotic else None
    return Shift(config, result, config.torque_peak(result), refined)
