"""Shifts as flat records of what went in and came out, in the edge's units; nothing simulates."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Sequence
from typing import Any

from dogshape.sim.errors import ranged_record
from dogshape.sim.shift.clutch import MAX_STEPS, Clutch, OperatingPoint
from dogshape.sim.shift.conclusion import TIME_LIMIT, Outcome
from dogshape.sim.shift.geometry import Dog
from dogshape.sim.statistics.expectation import ShiftResult
from dogshape.sim.statistics.uncertainty import Variant
from dogshape.sim.units import DEG, MM, from_si, suffix_of

#: A line of shifts.jsonl: inputs and results of a shift by their keys.
Record = dict[str, Any]


def edge_record(value: Any, keys: Iterable[str]) -> Record:
    """Return fields of a value in the edge's units, by keys of field and unit."""
    return {key: from_si(key, getattr(value, key.removesuffix(suffix_of(key)))) for key in keys}


#: Later keys of a dog with their defaults: records of dogs that have these stay as they were.
DEFAULTS = edge_record(Dog, ("edge_radius_mm", "crest", "chamfer_back_deg", "backlash_mm"))


def clutch_record(clutch: Clutch) -> Record:
    """Return everything about a clutch that a simulation uses, in the edge's units.

    A limit of steps, later keys of the dog, IMPACT, friction of faces, engine, mechanism and drive
    are named where they are not the usual ones; the limit of time never is, since a shift that it
    ends is not kept (``unfinished``).
    """
    dog, rings, contact, solver = clutch.dog, clutch.rings, clutch.contact, clutch.solver
    return {
        **{k: one for k, one in ranged_record(dog).items() if one != DEFAULTS.get(k)},
        "sliding_mass_kg": rings.mass,
        **edge_record(rings, ("sliding_inertia_kgm2", "output_inertia_kgm2")),
        # Records of shafts that stand have the key of the speed that earlier versions had.
        **({} if clutch.drive.turns else {"initial_speed_rpm": 0.0}),
        "contact_set": contact.name,
        **contact.record,
        **(ranged_record(contact.impact) if contact.impact else {}),
        "timeout_s": clutch.timeout,
        "seated_tolerance_mm": clutch.seated_tolerance / MM,
        "rebound_mm": clutch.rebound / MM,
        "scheme": solver.scheme,
        "accuracy": solver.accuracy,
        "max_step_s": solver.max_step,
        "all_dogs": solver.all_dogs,
        **({} if solver.engine == "drake" else {"engine": solver.engine}),
        **({} if solver.max_steps == MAX_STEPS else {"max_steps": solver.max_steps}),
        **clutch.mechanism.record,
        **clutch.drive.record,
    }


def uncertain_record(source: Iterable[tuple[str, str]]) -> Record:
    """Return distributions in words as a flat record; a certain shift has none."""
    return {f"uncertain_{name}": text for name, text in source}


def variant_record(clutch: Clutch, point: OperatingPoint, variant: Variant) -> Record:
    """Return the factors of an uncertain shift and the inputs that they make, as ``Variant`` does.

    A dissipation is named where it is uncertain: records of studies without it stay as they were.
    """
    contact, inertia, profile = clutch.contact, clutch.rings.output_inertia, point.profile
    found: Record = {
        "friction_factor": variant.friction,
        "force_factor": variant.force,
        "inertia_factor": variant.inertia,
        "drawn_static_friction": contact.static_friction * variant.friction,
        "drawn_dynamic_friction": contact.dynamic_friction * variant.friction,
        "drawn_output_inertia_kgm2": inertia * variant.inertia,
        "drawn_force_N": profile.force * variant.force,
        "drawn_force_rise_s": variant.rise,
        **uncertain_record(variant.source),
    }
    if contact.face_friction is not None:
        found["drawn_face_friction"] = contact.face_friction * variant.friction
    if "dissipation_factor" in dict(variant.source):
        found["dissipation_factor"] = variant.dissipation
        found["drawn_dissipation_s_m"] = contact.dissipation * variant.dissipation
    return found


def content_key(record: Record) -> str:
    """Return a short hash of a record; equal inputs share it.

    Floats are rounded to twelve digits, which a change of unit does not reach.
    """
    rounded = {k: float(f"{v:.12g}") if isinstance(v, float) else v for k, v in record.items()}
    return hashlib.sha256(json.dumps(rounded, sort_keys=True).encode()).hexdigest()[:20]


BINS = 24  #: of the relative angle over a pitch, at most


def entries_by_angle(records: Sequence[Record]) -> list[list[int]]:
    """Count direct entries, those after face contact and failures, by relative angle.

    In equal bins of a pitch from dogs facing dogs; shifts whose integration failed are left out.
    """
    counts = [[0, 0, 0] for _ in range(min(BINS, len(records)))]
    for one in (row for row in records if row["outcome"] != Outcome.DIVERGED.value):
        phase = one["relative_angle_deg"] * one["count"] / 360.0 % 1.0
        entry = 2 if one["shift_time_s"] is None else int(one["face_contacts"] > 0)
        counts[int(phase * len(counts))][entry] += 1
    return counts


def first_windows(records: Sequence[Record]) -> int:
    """Count the shifts that engage without being carried past a slot."""
    engaged = (row for row in records if row["shift_time_s"] is not None)
    return sum(row["slots_skipped"] == 0 for row in engaged)


def unfinished(record: Record) -> bool:
    """Test that the clock ended a shift: another run may finish it."""
    return str(record.get("reason", "")).startswith(TIME_LIMIT)


def result_of(record: Record) -> ShiftResult:
    """Extract outcome, time, and the rest of a blocked shift from a record."""
    rest, outcome = record.get("rest_overlap_deg"), Outcome(record["outcome"])
    return ShiftResult(outcome, record["shift_time_s"], None if rest is None else rest * DEG)


def landing_of(record: Record) -> tuple[float, ...]:
    """Extract the hardest landing from a record, N/m (``Loads.landing_loads``)."""
    return tuple(load / MM for load in record["landing_loads_N_mm"])
