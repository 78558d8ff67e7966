"""Many shifts: a block of work simulated one shift after the other, flat records out.

A plant is built in the process that simulates and kept for the next block of the same clutch.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from dogshape.sim.engines import engage
from dogshape.sim.shift.conclusion import Engagement, Outcome
from dogshape.sim.shift.trace import Trace
from dogshape.sim.statistics.blocks import Block
from dogshape.sim.statistics.shift_records import Record, landing_record
from dogshape.sim.units import MM, RPM
from dogshape.sim.versions import versions


def events_record(result: Engagement) -> Record:
    """Return the events of a shift as a flat record in the edge's units."""
    events = result.events
    return {
        "face_contacts": events.face_contacts,
        "slots_skipped": events.slots_skipped,
        "rebound_travel_mm": events.rebound / MM,
        "time_blocked_s": events.time_blocked,
        "face_slide_mm": events.face_slide / MM,
        "chamfer_slid": events.chamfer_slid,
    }


def loads_record(result: Engagement) -> Record:
    """Return the loads of a shift as a flat record in the edge's units."""
    loads = result.loads
    return {
        "peak_axial_force_N": loads.peak_axial_force,
        "peak_tangential_force_N": loads.peak_tangential_force,
        "impact_impulse_Ns": loads.impact_impulse,
        "energy_dissipated_J": loads.energy_dissipated,
        "strike_mismatch_rpm": loads.strike_mismatch / RPM,
        "residual_mismatch_rpm": None
        if loads.residual_mismatch is None
        else loads.residual_mismatch / RPM,
        **landing_record(loads.landing),
    }


def shaft_record(trace: Trace) -> Record:
    """Return the largest torques of shafts that give way, N m; nothing for rigid ones."""
    shafts = {"input": trace.input_torque, "output": trace.output_torque}
    return {
        f"{name}_torque_peak_Nm": float(np.abs(torque).max())
        for name, torque in shafts.items()
        if torque is not None
    }


def shift_record(result: Engagement, given: Record, key: str) -> Record:
    """Return one shift as a flat record: its ``key``, the inputs ``given``, result and versions."""
    linked = result.clutch.mechanism.has_linkage
    return {
        "key": key,
        **given,
        "outcome": result.outcome.value,
        "shift_time_s": result.shift_time,
        **({"actuator_time_s": result.actuator_time} if linked else {}),
        **shaft_record(result.trace),
        **events_record(result),
        **loads_record(result),
        "steps": result.steps,
        "evaluations": result.evaluations,
        **({"reason": result.detail} if result.outcome is Outcome.DIVERGED else {}),
        "dogshape": versions()["dogshape"],
        "drake": versions()["drake"],
    }


def run_block(block: Block) -> Iterator[Record]:
    """Simulate the shifts of a block one after the other and yield their records."""
    asked = zip(block.angles, block.each_variant, block.inputs, block.keys, strict=True)
    for angle, variant, given, key in asked:
        clutch, point = block.clutch, block.point
        if variant is not None:
            clutch, point = variant.clutch(clutch), variant.point(point)
        yield {**shift_record(engage(clutch, point, angle), given, key), "seed": block.seed}
