"""A shift in words: an explanation of its time, and a list of facts."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from dogshape.pipeline.reports.kit.text import in_ms, minus
from dogshape.sim.shift.conclusion import DEAD_TIME, Engagement, Outcome
from dogshape.sim.shift.events import Phase, crests_cross
from dogshape.sim.shift.loads import peak_duration
from dogshape.sim.units import MM, MS, RPM

ROSE = 0.05  #: share of the first mismatch from which a later change of it is told


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


def why(result: Engagement) -> str:
    """Explain the longest phase of a shift in one sentence."""
    end = result.phases[-1].end
    longest = max(result.phases, key=lambda p: p.end - p.start)
    length = in_ms(longest.end - longest.start)
    if result.outcome is Outcome.BLOCKED:
        return (
            "Friction holds dog on dog: the faces have stood still for "
            f"{in_ms(result.events.time_blocked)} ms and would not reach a slot before the "
            "time-out."
        )
    share = f"{phase_title(longest.name)} took {length} of {in_ms(end)} ms"
    if result.outcome is not Outcome.ENGAGED:
        return f"Not engaged: {result.detail}; until then {share}."
    return f"{share[0].upper()}{share[1:]}: {_REASONS[longest.name](result, longest)}."


def _on_faces(result: Engagement, phase: Phase) -> str:
    """Describe the slip of the faces to a slot: way, rate and loss of speed."""
    times = [phase.start, phase.end]
    start, end = np.interp(times, result.trace.time, result.trace.relative_angle)
    slip = float(abs(end - start) * result.clutch.dog.mean_radius / MM)
    rate = slip / ((phase.end - phase.start) / MS)
    text = f"dog met dog, and the rings turned {slip:.1f} mm "
    missed = result.events.slots_skipped
    if missed:
        text += f"past {missed} slot{'s' if missed > 1 else ''} that did not let them in"
    else:
        text += "to the next slot"
    return f"{text}, at {rate:.2g} mm/ms{_slowed(result, phase)}"


def _slowed(result: Engagement, phase: Phase) -> str:
    """Describe the fall of the mismatch in a phase and its rise; empty where it hardly fell."""
    trace = result.trace
    inside = (trace.time >= phase.start) & (trace.time <= phase.end)
    ends = np.interp([phase.start, phase.end], trace.time, trace.relative_speed) / RPM
    values = np.array([ends[0], *(trace.relative_speed[inside] / RPM), ends[1]])
    before, least, after = values[0], values[np.abs(values).argmin()], values[-1]
    if abs(least) > 0.8 * abs(before):
        return ""
    text = f"; the mismatch fell from {before:.0f} to {least:.0f}"
    if abs(after - least) >= ROSE * abs(before):
        text += f" and {'rose' if after > least else 'turned'} to {after:.0f}"
    return minus(f"{text} 1/min".replace("-0 ", "0 "))


def _in_flight(result: Engagement, phase: Phase) -> str:
    gap = result.clutch.dog.axial_gap / MM
    return (
        f"the shift force had to bring the ring over the gap of {gap:.2f} mm and had only "
        f"reached {_force(result, phase.end)}"
    )


def _before_the_force(result: Engagement, phase: Phase) -> str:
    return "the shift force had not begun"


def _on_flanks(result: Engagement, phase: Phase) -> str:
    way = np.interp(phase.start, result.trace.time, result.trace.displacement) / MM
    travel = result.clutch.shift_travel / MM
    return (
        f"flanks met at {way:.2f} of {travel:.2f} mm, and the ring made the rest along them "
        f"while the shift force rose only to {_force(result, phase.end)}"
    )


def _in_slots(result: Engagement, phase: Phase) -> str:
    return f"the dogs were in the slots and free, under {_force(result, phase.end)}"


_REASONS: dict[str, Callable[[Engagement, Phase], str]] = {
    DEAD_TIME: _before_the_force,
    "free fly": _in_flight,
    "face contact": _on_faces,
    "entry": _in_slots,
    "seating": _on_flanks,
}


def _meeting(result: Engagement) -> list[str]:
    """Describe the first contact of the rings; without a face it is their crests that pass."""
    flight, face = [phase for phase in result.phases if phase.name != DEAD_TIME][:2]
    if flight.end >= result.trace.time[-1]:
        return []
    speed = np.interp(flight.end, result.trace.time, result.trace.axial_speed)
    what = "first touch" if face.end > face.start else "crests meet"
    return [f"{what} with {abs(speed):.2f} m/s"]


def _force(result: Engagement, time: float) -> str:
    now = np.interp(time, result.trace.time, result.trace.shift_force)
    return f"{now:.0f} of {result.point.profile.net_force:.0f} N"
