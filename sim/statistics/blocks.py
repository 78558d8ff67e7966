"""Blocks of work: one clutch at one operating point with its relative angles.

A block is a value that any process can simulate with the engine of its solver, Drake's plant or the
compiled one; either takes a second to load, so it loads at first use. The numerical error of a mean
shift time is estimated by repeating some of its shifts.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np

from dogshape.sim.elementwise import Array
from dogshape.sim.shift import conclusion
from dogshape.sim.shift.clutch import Clutch, OperatingPoint
from dogshape.sim.shift.conclusion import Engagement, Engine, Outcome
from dogshape.sim.statistics.expectation import NumericalError, even_phases
from dogshape.sim.statistics.shift_records import (
    OpenKey,
    Record,
    clutch_record,
    content_key,
    edge_record,
    variant_record,
)
from dogshape.sim.statistics.uncertainty import Uncertainty, Variant
from dogshape.sim.units import DEG, MM, RPM
from dogshape.sim.versions import engine_versions

ANGLE_KEY = "relative_angle_deg"  #: key of the relative angle in a record of inputs


@lru_cache(maxsize=2)
def _engine_of(clutch: Clutch) -> Engine:
    """Build the engine of a clutch; cached in this process."""
    if clutch.solver.engine == "planar":
        from dogshape.sim.shift.planar import PlanarClutch  # noqa: PLC0415

        return PlanarClutch(clutch)
    from dogshape.sim.shift.plant import ClutchPlant  # noqa: PLC0415

    return ClutchPlant(clutch)


def engage(clutch: Clutch, point: OperatingPoint, relative_angle: float) -> Engagement:
    """Simulate one shift with the engine of the clutch's solver; ``relative_angle`` in rad."""
    return conclusion.engage(_engine_of(clutch), point, relative_angle)


#: All operating points share the record of a clutch.
_record_of = lru_cache(maxsize=64)(clutch_record)


def _nominal_record(clutch: Clutch, point: OperatingPoint) -> Record:
    """Return the inputs that all shifts of a clutch at an operating point have in common."""
    return {
        **_record_of(clutch),
        "mismatch_rpm": point.mismatch / RPM,
        **point.profile.record,
    }


@lru_cache(maxsize=256)
def _angle_key(clutch: Clutch, point: OperatingPoint) -> OpenKey:
    """Return the content key of a certain shift without its relative angle; cached.

    Blocks of one clutch at one operating point differ by their angles alone.
    """
    return OpenKey.of(_nominal_record(clutch, point), ANGLE_KEY)


@dataclass(frozen=True)
class Block:
    """Shifts of one clutch at one operating point over relative angles."""

    clutch: Clutch  #: nominal
    point: OperatingPoint  #: nominal
    angles: tuple[float, ...]  #: rad
    seed: int | None = None  #: of the draw of the angles; None for listed angles
    variants: tuple[Variant, ...] = ()  #: drawn factors of each angle; empty without uncertainty

    @property
    def inputs(self) -> list[Record]:
        """Inputs of the shifts by angle as flat records: nominal ones and drawn factors."""
        clutch, point = self.clutch, self.point
        common = _nominal_record(clutch, point)
        records = []
        for angle, variant in zip(self.angles, self.each_variant, strict=True):
            record = {**common, ANGLE_KEY: angle / DEG}
            if variant is not None:
                record |= variant_record(clutch, point, variant)
            records.append(record)
        return records

    @cached_property
    def keys(self) -> list[str]:
        """Content keys of the block's shifts, in the order of the angles."""
        if self.variants:
            return [content_key(record) for record in self.inputs]
        angle_key = _angle_key(self.clutch, self.point)
        return [angle_key.fill(angle / DEG) for angle in self.angles]

    @cached_property
    def first_key(self) -> str:
        """Content key of the first shift."""
        return self.only([0]).keys[0]

    @property
    def each_variant(self) -> tuple[Variant | None, ...]:
        """Drawn factors of each angle, None without uncertainty."""
        return self.variants or (None,) * len(self.angles)

    def only(self, places: Sequence[int]) -> Block:
        """Return the block with the angles of the indices ``places`` alone."""
        variants = tuple(self.variants[k] for k in places) if self.variants else ()
        return replace(self, angles=tuple(self.angles[k] for k in places), variants=variants)

    def refined(self, place: int) -> Block:
        """Return the block of the angle at index ``place`` with a thirtieth of the tolerance."""
        return replace(self.only([place]), clutch=self.clutch.refined(), seed=None)


def even_blocks(
    clutch: Clutch,
    points: Sequence[OperatingPoint],
    angles: int | Sequence[float],
    seed: int,
    base: int | None = None,
    *,
    uncertainty: Uncertainty | None = None,
) -> list[Block]:
    """Return an ``even_block`` for each operating point; ``base`` as for ``even_phases``."""
    return [
        even_block(clutch, point, angles, (seed, index), base, uncertainty=uncertainty)
        for index, point in enumerate(points)
    ]


def even_block(
    clutch: Clutch,
    point: OperatingPoint,
    angles: int | Sequence[float],
    draw: tuple[int, int],
    base: int | None = None,
    *,
    uncertainty: Uncertainty | None = None,
) -> Block:
    """Return the block of an operating point at a number of even angles, or at listed ones in rad.

    ``draw`` is seed and index of even angles and of uncertain factors.
    """
    seed = None
    angle_list: Sequence[float]
    if isinstance(angles, int):
        seed = draw[0]
        angle_list = (_draw_phases(angles, *draw, base) * clutch.dog.pitch_angle).tolist()
    else:
        angle_list = angles
    variants: tuple[Variant, ...] = ()
    if uncertainty:
        variants = _draw_variants(uncertainty, point, len(angle_list), *draw, base)
    return Block(clutch, point, tuple(angle_list), seed=seed, variants=variants)


#: All designs share the draws of an operating point.
_draw_phases = lru_cache(maxsize=256)(even_phases)
_draw_variants = lru_cache(maxsize=128)(Uncertainty.variants)


def events_record(result: Engagement) -> Record:
    """Return the events of a shift as a flat record in the units of files."""
    events = result.events
    record: Record = {
        "face_contacts": events.face_contacts,
        "slots_skipped": events.slots_skipped,
        **edge_record(events, ("rebound_travel_mm", "time_blocked_s", "face_slide_mm")),
    }
    if result.outcome is Outcome.BLOCKED:
        record["rest_overlap_deg"] = _overlap_ahead(result) / DEG
    return record


def _overlap_ahead(result: Engagement) -> float:
    """Compute the overlap of a blocked shift up to the next slot in the sense of mismatch, rad."""
    from dogshape.sim import kernel  # noqa: PLC0415  slow to load

    numbers = result.clutch.numbers
    angle = float(result.trace.relative_angle[-1])
    overlap, max_overlap, _ = kernel.overlapping_surfaces(
        kernel.face_overlap(angle, numbers), numbers
    )
    length = max_overlap - overlap if result.point.mismatch > 0.0 else overlap
    return max(length, 0.0) / result.clutch.dog.mean_radius


_LOAD_KEYS = (
    "peak_axial_force_N",
    "peak_tangential_force_N",
    "impact_impulse_Ns",
    "energy_dissipated_J",
    "strike_mismatch_rpm",
    "residual_mismatch_rpm",
)
_SHAFT_KEYS = ("input_torque_peak_Nm", "output_torque_peak_Nm")


def loads_record(result: Engagement) -> Record:
    """Return the loads of a shift as a flat record in the units of files.

    Rigid shafts have no keys.
    """
    shaft_record = edge_record(result.loads, _SHAFT_KEYS)
    return {
        **edge_record(result.loads, _LOAD_KEYS),
        "landing_loads_N_mm": [load * MM for load in result.loads.landing_loads],
        **{key: torque for key, torque in shaft_record.items() if torque is not None},
    }


def run_block(block: Block) -> Iterator[Record]:
    """Simulate the shifts of a block; yield each as a flat record of inputs, results, versions."""
    shifts = zip(block.angles, block.each_variant, block.inputs, block.keys, strict=True)
    for angle, variant, inputs, key in shifts:
        clutch, point = block.clutch, block.point
        if variant is not None:
            clutch = variant.clutch(clutch)
            point = variant.point(point)
        result = engage(clutch, point, angle)
        record = {
            "key": key,
            **inputs,
            "outcome": result.outcome.value,
            "shift_time_s": result.shift_time,
        }
        if clutch.mechanism.has_linkage:
            record |= {"actuator_time_s": result.actuator_time}
        record |= events_record(result) | loads_record(result)
        record |= {"steps": len(result.run.times), "evaluations": result.evaluations}
        if result.outcome is Outcome.DIVERGED:
            record |= {"reason": result.detail}
        yield record | engine_versions() | {"seed": block.seed}


REPEAT_INTERVAL = 8  #: one shift of so many is repeated
MIN_REPEATS = 4  #: shifts to repeat, if there are as many

Runner = Callable[[Sequence[Block]], list[list[Record]]]  #: simulates blocks, in order


def repeat_count(shifts: int) -> int:
    """Compute the number of ``shifts`` to repeat for the numerical error."""
    return min(shifts, max(MIN_REPEATS, shifts // REPEAT_INTERVAL))


MIN_FLIP = 0.05  #: change of a shift's time over the time from which the shift flips


def numerical_error(
    blocks: Sequence[Block], rows: Sequence[Sequence[Record]], run: Runner
) -> NumericalError:
    """Estimate the numerical error of a mean shift time over operating points.

    ``rows`` are the shifts of each block. An eighth of them, at least four, drawn at random, is
    repeated with a tolerance thirty times smaller. The mean difference is weighted as the mean is.
    A shift that does not engage counts with the time-out.
    """
    shifts = []
    for block, block_rows in zip(blocks, rows, strict=False):
        shifts += [(block, index, row) for index, row in enumerate(block_rows)]
    count = repeat_count(len(shifts))
    permutation = np.random.default_rng(len(shifts)).permutation(len(shifts))
    sample = [shifts[k] for k in sorted(permutation[:count].tolist())]
    fine_rows = run([block.refined(index) for block, index, _ in sample])
    coarse_times = _times_or_timeout([row for *_, row in sample], blocks[0].clutch.timeout)
    fine_times = _times_or_timeout([row for (row,) in fine_rows], blocks[0].clutch.timeout)
    differences = coarse_times - fine_times
    flips = int((abs(differences) > MIN_FLIP * coarse_times).sum())
    weights = np.array([block.point.weight / len(block.angles) for block, *_ in sample])
    weights /= weights.sum()
    mean = float(weights @ differences)
    error = math.nan
    if count > 1:
        error = math.sqrt(float(weights**2 @ (differences - mean) ** 2) * count / (count - 1))
    return NumericalError(mean, error, repeats=count, flips=flips)


def _times_or_timeout(rows: Sequence[Record], timeout: float) -> Array:
    """Return the shift times of records, s, (n,), with the time-out for shifts without one."""
    times = np.array([row["shift_time_s"] for row in rows], dtype=float)
    return np.where(np.isnan(times), timeout, times)
