"""Many shifts: flat records of what went in and came out, and a block of work.

A block is one clutch at one operating point with its relative angles. It is a
value that can be sent to another process; the plant is built there and kept
for the next block of the same clutch.
"""

from __future__ import annotations

import hashlib
import json
import platform
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from importlib import metadata
from typing import Any

from sim.clutch import Clutch, OperatingPoint
from sim.engagement import Engagement, engage
from sim.expectation import ShiftResult, even_phases
from sim.loads import Landing
from sim.outcome import Outcome
from sim.plant import ClutchPlant
from sim.units import DEG, MM, RPM

Record = dict[str, Any]


@dataclass(frozen=True)
class Block:
    """One clutch at one operating point, at relative angles in rad."""

    clutch: Clutch
    point: OperatingPoint
    angles: tuple[float, ...]

    @property
    def keys(self) -> list[str]:
        """Content keys of the block's shifts, in the order of the angles."""
        return [content_key(inputs(self.clutch, self.point, angle)) for angle in self.angles]


def even_blocks(
    clutch: Clutch,
    points: Sequence[OperatingPoint],
    count: int,
    seed: int,
    base: int | None = None,
) -> list[Block]:
    """Return a block for each operating point, at ``count`` evenly spaced angles of its own.

    ``seed`` and ``base`` as for ``sim.expectation.even_phases``.
    """
    blocks = []
    for index, point in enumerate(points):
        angles = even_phases(count, seed, index, base) * clutch.dog.pitch_angle
        blocks.append(Block(clutch, point, tuple(angles.tolist())))
    return blocks


def clutch_record(clutch: Clutch) -> Record:
    """Return everything about a clutch that a simulation uses, in the edge's units."""
    dog, rings, contact, solver = clutch.dog, clutch.rings, clutch.contact, clutch.solver
    return {
        "count": dog.count,
        "chamfer_deg": dog.chamfer / DEG,
        "traction_deg": dog.traction / DEG,
        "braking_deg": dog.braking / DEG,
        "height_mm": dog.height / MM,
        "outer_diameter_mm": dog.outer_diameter / MM,
        "inner_diameter_mm": dog.inner_diameter / MM,
        "axial_gap_mm": dog.axial_gap / MM,
        "sliding_mass_kg": rings.mass,
        "sliding_inertia_kgm2": rings.sliding_inertia,
        "output_inertia_kgm2": rings.output_inertia,
        "initial_speed_rpm": rings.initial_speed / RPM,
        "contact_set": contact.name,
        "static_friction": contact.static_friction,
        "dynamic_friction": contact.dynamic_friction,
        "stiction_velocity_m_s": contact.stiction_velocity,
        "stiffness_Pa_m": contact.stiffness,
        "dissipation_s_m": contact.dissipation,
        "timeout_s": clutch.timeout,
        "seated_tolerance_mm": clutch.seated_tolerance / MM,
        "rebound_mm": clutch.rebound / MM,
        "scheme": solver.scheme,
        "accuracy": solver.accuracy,
        "max_step_s": solver.max_step,
        "all_dogs": solver.all_dogs,
    }


def inputs(clutch: Clutch, point: OperatingPoint, angle: float) -> Record:
    """Return the inputs of one shift as a flat record."""
    return {
        **clutch_record(clutch),
        "mismatch_rpm": point.mismatch / RPM,
        "force_N": point.profile.force,
        "force_rise_s": point.profile.rise,
        "relative_angle_deg": angle / DEG,
    }


def content_key(record: Record) -> str:
    """Return a short hash of a record; equal inputs share it.

    Floats are rounded to twelve digits, which a change of unit does not reach.
    """
    rounded = {k: float(f"{v:.12g}") if isinstance(v, float) else v for k, v in record.items()}
    text = json.dumps(rounded, sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:20]


@lru_cache(maxsize=1)
def versions() -> dict[str, str]:
    """Return the versions that a result depends on."""
    names = ("dogshape", "drake", "numpy", "scipy", "scikit-learn", "optuna")
    return {"python": platform.python_version(), **{n: metadata.version(n) for n in names}}


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
        "residual_mismatch_rpm": None
        if loads.residual_mismatch is None
        else loads.residual_mismatch / RPM,
        **landing_record(loads.landing),
    }


def shift_record(result: Engagement) -> Record:
    """Return one shift as a flat record: key, inputs, result and versions."""
    given = inputs(result.clutch, result.point, result.relative_angle)
    return {
        "key": content_key(given),
        **given,
        "outcome": result.outcome.value,
        "shift_time_s": result.shift_time,
        **events_record(result),
        **loads_record(result),
        "steps": result.steps,
        "evaluations": result.evaluations,
        "dogshape": versions()["dogshape"],
        "drake": versions()["drake"],
    }


def result_of(record: Record) -> ShiftResult:
    """Return what an expectation needs from a record."""
    return ShiftResult(Outcome(record["outcome"]), record["shift_time_s"])


def landing_record(landing: Landing) -> Record:
    """Return a landing as a flat record in the edge's units."""
    return {"landing_loads_N_mm": [load * MM for load in landing.line_loads]}


def landing_of(record: Record) -> Landing:
    """Return what a record says of the hardest landing, dog on dog."""
    return Landing(tuple(load / MM for load in record["landing_loads_N_mm"]))


@lru_cache(maxsize=2)
def plant_of(clutch: Clutch) -> ClutchPlant:
    """Return the plant of a clutch, built once in this process."""
    return ClutchPlant(clutch)


def run_block(block: Block) -> Iterator[Record]:
    """Simulate the shifts of a block one after the other and yield their records."""
    plant = plant_of(block.clutch)
    for angle in block.angles:
        yield shift_record(engage(plant, block.point, angle))
