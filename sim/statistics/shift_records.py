"""Shifts as flat records of inputs and results, in the units of files; nothing simulates."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Mapping, Sequence
from operator import itemgetter
from typing import Any, NamedTuple

from dogshape.sim.quantity import record_quantities
from dogshape.sim.shift.clutch import MAX_STEPS, Clutch, OperatingPoint
from dogshape.sim.shift.conclusion import TIME_LIMIT, Outcome
from dogshape.sim.shift.geometry import Dog
from dogshape.sim.shift.pair import OUTPUT_PREFIX
from dogshape.sim.statistics.expectation import ShiftResult
from dogshape.sim.statistics.uncertainty import Variant
from dogshape.sim.units import DEG, MM, from_si, suffix_of

_ENCODER = json.JSONEncoder(sort_keys=True)

#: A line of shifts.jsonl: inputs and results of a shift by their keys.
Record = dict[str, Any]


def edge_record(value: Any, keys: Iterable[str]) -> Record:
    """Return fields of ``value`` in the units of files by ``keys``, names with unit."""
    return {key: from_si(key, getattr(value, key.removesuffix(suffix_of(key)))) for key in keys}


#: Later keys of a dog with their defaults: records of dogs that have these stay as they were.
DEFAULTS = edge_record(Dog, ("edge_radius_mm", "crest", "chamfer_back_deg", "backlash_mm"))


SPARSE_RING = f"{OUTPUT_PREFIX}sparse_ring"  #: key of the ring whose dogs are missing or low


def clutch_record(clutch: Clutch) -> Record:
    """Return the inputs of a simulation that concern the clutch, in the units of files.

    A limit of steps, later keys of the dog, another dog of the output ring, IMPACT, friction of
    faces, engine, mechanism, drive and actuator have keys if they are not the usual ones; the limit
    of time never has, since a shift that it ends is not kept (``unfinished``).
    """
    dog = clutch.dog
    rings = clutch.rings
    contact = clutch.contact
    solver = clutch.solver
    dog_record = {
        key: value for key, value in record_quantities(dog).items() if value != DEFAULTS.get(key)
    }
    return {
        **dog_record,
        **clutch.output_dog.record,
        **({SPARSE_RING: "sliding"} if clutch.output_dog.is_sliding_sparse else {}),
        "sliding_mass_kg": rings.mass,
        **edge_record(rings, ("sliding_inertia_kgm2", "output_inertia_kgm2")),
        # Records of shafts that stand have the key of the speed that earlier versions had.
        **({} if clutch.drive.turns else {"initial_speed_rpm": 0.0}),
        "contact_set": contact.name,
        **contact.record,
        **(record_quantities(contact.impact) if contact.impact else {}),
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
        **(clutch.actuator.record if clutch.actuator else {}),
    }


def uncertain_record(source: Iterable[tuple[str, str]]) -> Record:
    """Return distributions in words as a flat record; empty for a certain shift."""
    return {f"uncertain_{name}": text for name, text in source}


def variant_record(clutch: Clutch, point: OperatingPoint, variant: Variant) -> Record:
    """Return the factors of an uncertain shift and the inputs drawn with them.

    The dissipation has a key if it is uncertain: records of other studies stay unchanged.
    """
    contact = clutch.contact
    inertia = clutch.rings.output_inertia
    profile = point.profile
    record: Record = {
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
        record |= {"drawn_face_friction": contact.face_friction * variant.friction}
    if "dissipation_factor" in dict(variant.source):
        record |= {
            "dissipation_factor": variant.dissipation,
            "drawn_dissipation_s_m": contact.dissipation * variant.dissipation,
        }
    return record


def content_key(record: Record) -> str:
    """Return a short hash of a record; equal inputs share it.

    Floats are rounded to twelve digits, more than a change of unit preserves.
    """
    return _hash(_content_text(record))


def _content_text(record: Record) -> str:
    """Write the text of a record that its content key hashes."""
    rounded = {
        key: _rounded(value) if isinstance(value, float) else value for key, value in record.items()
    }
    return _ENCODER.encode(rounded)


def _rounded(value: float) -> float:
    """Round a number of a record to twelve digits."""
    return float(f"{value:.12g}")


def _hash(text: str) -> str:
    """Return a short hash of a text."""
    return hashlib.sha256(text.encode()).hexdigest()[:20]


class OpenKey(NamedTuple):
    """Content key of records that differ by the number of one field, without that number."""

    before: str  #: text of the record before the number
    after: str

    @classmethod
    def of(cls, record: Record, field: str) -> OpenKey:
        """Build the key of a record without the number of a further ``field``."""
        name = json.dumps(field)
        before, after = _content_text({**record, field: None}).split(f"{name}: null")
        return cls(f"{before}{name}: ", after)

    def fill(self, number: float) -> str:
        """Return the ``content_key`` of the record with a number."""
        return _hash(f"{self.before}{json.dumps(_rounded(number))}{self.after}")


def key_of(record: Record) -> str:
    """Extract the content key of a shift or of a series of shifts."""
    key: str = record["key"]
    return key


class ShiftAngle(NamedTuple):
    """Relative angle of a shift at the start of the force, and the number of dogs of a ring."""

    relative_angle_deg: float
    dogs: int

    @property
    def pitches(self) -> float:
        """Relative angle from dogs facing dogs, in pitches."""
        return self.relative_angle_deg * self.dogs / 360.0


class ShiftLoads(NamedTuple):
    """Loads of a shift, in the units of files."""

    peak_axial_force_N: float
    peak_tangential_force_N: float
    impact_impulse_Ns: float
    energy_dissipated_J: float


_get_angle = itemgetter("relative_angle_deg", "count")
_get_loads = itemgetter(*ShiftLoads._fields)


def angle_of(record: Record) -> ShiftAngle:
    """Extract the relative angle from a record."""
    return ShiftAngle(*_get_angle(record))


def loads_of(record: Record) -> ShiftLoads:
    """Extract the loads from a record."""
    return ShiftLoads(*_get_loads(record))


MAX_BINS = 24  #: of the relative angle over a pitch


def entries_by_angle(records: Sequence[Record]) -> list[list[int]]:
    """Count direct entries, entries after face contact and failures, (bins, 3).

    Bins divide a pitch evenly from dogs facing dogs; diverged shifts are left out.
    """
    counts = [[0, 0, 0] for _ in range(min(MAX_BINS, len(records)))]
    for record in records:
        if diverged(record):
            continue
        phase = angle_of(record).pitches % 1.0
        is_engaged = result_of(record).shift_time is not None
        entry = int(record["face_contacts"] > 0) if is_engaged else 2
        counts[int(phase * len(counts))][entry] += 1
    return counts


def first_windows(records: Sequence[Record]) -> int:
    """Count the shifts that engage without skipping a slot."""
    engaged = (record for record in records if result_of(record).shift_time is not None)
    return sum(record["slots_skipped"] == 0 for record in engaged)


def diverged(record: Record) -> bool:
    """Test whether the integration of a shift failed; it has no shift time then."""
    return record["outcome"] == Outcome.DIVERGED.value


def quantity_of(record: Mapping[str, Any], key: str) -> float:
    """Extract a number from a record; later keys of the dog have defaults.

    An absent dimension of the output ring's dog is that of the sliding ring's.
    """
    if key in record:
        return float(record[key])
    if key.startswith(OUTPUT_PREFIX):
        return quantity_of(record, key.removeprefix(OUTPUT_PREFIX))
    return float(DEFAULTS[key])


def unfinished(record: Record) -> bool:
    """Test whether the limit of computing time ended a shift: another run may finish it."""
    return str(record.get("reason", "")).startswith(TIME_LIMIT)


def result_of(record: Record) -> ShiftResult:
    """Extract outcome, time and, of a blocked shift, the overlap from a record."""
    overlap = record.get("rest_overlap_deg")
    return ShiftResult(
        Outcome(record["outcome"]),
        record["shift_time_s"],
        None if overlap is None else overlap * DEG,
    )


def landing_of(record: Record) -> tuple[float, ...]:
    """Extract the hardest landing from a record, N/m (``Loads.landing_loads``)."""
    return tuple(load / MM for load in record["landing_loads_N_mm"])
