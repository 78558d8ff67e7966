"""Blocks of work: one clutch at one operating point with its relative angles.

A block is a value that any process can simulate, with Drake's plant or the compiled engine, as its
solver says; either takes a second to load, and few runs want both. The numerical error of a mean
shift time is found by repeating some of its shifts.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np

from dogshape.sim.shift import conclusion
from dogshape.sim.shift.clutch import Clutch, OperatingPoint
from dogshape.sim.shift.conclusion import Engagement, Engine, Outcome
from dogshape.sim.statistics.expectation import even_phases
from dogshape.sim.statistics.shift_records import (
    Record,
    clutch_record,
    content_key,
    edge_record,
    variant_record,
)
from dogshape.sim.statistics.uncertainty import Uncertainty, Variant
from dogshape.sim.units import DEG, MM, RPM
from dogshape.sim.versions import engine


@lru_cache(maxsize=2)
def _prepared(clutch: Clutch) -> Engine:
    """Build the plant of a clutch once in this process."""
    if clutch.solver.engine == "planar":
        from dogshape.sim.shift.planar import PlanarClutch  # noqa: PLC0415

        return PlanarClutch(clutch)
    from dogshape.sim.shift.plant import ClutchPlant  # noqa: PLC0415

    return ClutchPlant(clutch)


def engage(clutch: Clutch, point: OperatingPoint, relative_angle: float) -> Engagement:
    """Simulate one shift with the engine of the clutch's solver; ``relative_angle`` in rad."""
    return conclusion.engage(_prepared(clutch), point, relative_angle)


@dataclass(frozen=True)
class Block:
    """One clutch at one operating point, the nominal ones, at relative angles in rad."""

    clutch: Clutch
    point: OperatingPoint
    angles: tuple[float, ...]
    seed: int | None = None  #: of the angles' draw; None where they were given
    variants: tuple[Variant, ...] = ()  #: draw of each angle; empty where all is certain

    @property
    def inputs(self) -> list[Record]:
        """Nominal inputs of its shifts by angle as flat records, and draws where uncertain."""
        clutch, point = self.clutch, self.point
        same = clutch_record(clutch) | {"mismatch_rpm": point.mismatch / RPM} | point.profile.record
        return [
            {
                **same,
                "relative_angle_deg": angle / DEG,
                **({} if variant is None else variant_record(clutch, point, variant)),
            }
            for angle, variant in zip(self.angles, self.each_variant, strict=True)
        ]

    @cached_property
    def keys(self) -> list[str]:
        """Content keys of the block's shifts, in the order of the angles."""
        return [content_key(given) for given in self.inputs]

    @cached_property
    def first_key(self) -> str:
        """Content key of the first shift."""
        return self.only([0]).keys[0]

    @property
    def each_variant(self) -> tuple[Variant | None, ...]:
        """The draw of each angle, None where all is certain."""
        return self.variants or (None,) * len(self.angles)

    def only(self, places: Sequence[int]) -> Block:
        """Return the block with the angles at ``places`` alone."""
        variants = tuple(self.variants[k] for k in places) if self.variants else ()
        return replace(self, angles=tuple(self.angles[k] for k in places), variants=variants)

    def refined(self, place: int) -> Block:
        """Return the shift at ``place`` alone, with a tolerance thirty times smaller."""
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
    """Return one operating point at so many even angles, or at those listed, rad.

    ``draw`` is seed and index of even angles and of uncertain factors.
    """
    if isinstance(angles, int):
        shares = even_phases(angles, *draw, base) * clutch.dog.pitch_angle
        places: tuple[float, ...] = tuple(shares.tolist())
    else:
        places = tuple(angles)
    variants = _drawn(uncertainty, point, len(places), *draw, base) if uncertainty else ()
    return Block(clutch, point, places, draw[0] if isinstance(angles, int) else None, variants)


_drawn = lru_cache(maxsize=128)(Uncertainty.variants)  # designs have the draws of a point in common


def events_record(result: Engagement) -> Record:
    """Return the events of a shift as a flat record in the edge's units."""
    events, rest = result.events, {}
    if result.outcome is Outcome.BLOCKED:  # the overlap left in the sense of the mismatch
        from dogshape.sim import kernel  # noqa: PLC0415  slow to load

        numbers, angle = result.clutch.numbers, float(result.trace.relative_angle[-1])
        overlap, most, _ = kernel.facing(kernel.face_overlap(angle, numbers), numbers)
        left = most - overlap if result.point.mismatch > 0.0 else overlap
        rest["rest_overlap_deg"] = max(left, 0.0) / result.clutch.dog.mean_radius / DEG
    lengths = edge_record(events, ("rebound_travel_mm", "time_blocked_s", "face_slide_mm"))
    counts = {"face_contacts": events.face_contacts, "slots_skipped": events.slots_skipped}
    return {**counts, **lengths, **rest}


_LOADS = (
    *("peak_axial_force_N", "peak_tangential_force_N", "impact_impulse_Ns", "energy_dissipated_J"),
    *("strike_mismatch_rpm", "residual_mismatch_rpm"),
)
_SHAFTS = ("input_torque_peak_Nm", "output_torque_peak_Nm")


def loads_record(result: Engagement) -> Record:
    """Return the loads of a shift as a flat record in the edge's units; rigid shafts have none."""
    landing = [load * MM for load in result.loads.landing_loads]
    shafts = {k: v for k, v in edge_record(result.loads, _SHAFTS).items() if v is not None}
    return {**edge_record(result.loads, _LOADS), "landing_loads_N_mm": landing, **shafts}


def run_block(block: Block) -> Iterator[Record]:
    """Simulate the shifts of a block and yield each as a flat record: inputs, result, versions."""
    asked = zip(block.angles, block.each_variant, block.inputs, block.keys, strict=True)
    for angle, variant, given, key in asked:
        clutch, point = block.clutch, block.point
        if variant is not None:
            clutch, point = variant.clutch(clutch), variant.point(point)
        result = engage(clutch, point, angle)
        times = {"shift_time_s": result.shift_time}
        if clutch.mechanism.has_linkage:
            times["actuator_time_s"] = result.actuator_time
        record = {"key": key, **given, "outcome": result.outcome.value} | times
        record |= events_record(result) | loads_record(result)
        record |= {"steps": len(result.run.times), "evaluations": result.evaluations}
        if result.outcome is Outcome.DIVERGED:
            record["reason"] = result.detail
        yield record | engine() | {"seed": block.seed}


CHECKED, LEAST = 8, 4  #: one shift in so many is repeated, and at least so many

Runner = Callable[[Sequence[Block]], list[list[Record]]]  #: simulates blocks, in order


def repeated(shifts: int) -> int:
    """Compute the number of shifts that are repeated."""
    return min(shifts, max(LEAST, shifts // CHECKED))


def numerical_error(
    blocks: Sequence[Block], rows: Sequence[Sequence[Record]], run: Runner
) -> float:
    """Return the numerical error of a mean shift time over operating points, s.

    An eighth of the shifts, at least four, drawn at random, is repeated with a tolerance thirty
    times smaller. The mean difference (weighted as the mean is) and its standard error are added as
    squares. A shift that does not engage counts with the time-out. NaN for a single shift.
    """
    shifts = [(k, place, row) for k, mine in enumerate(rows) for place, row in enumerate(mine)]
    number = repeated(len(shifts))
    drawn = np.random.default_rng(len(shifts)).permutation(len(shifts))[:number]
    chosen = [shifts[k] for k in sorted(drawn.tolist())]
    fine = run([blocks[k].refined(place) for k, place, _ in chosen])
    if number < 2:
        return math.nan
    pairs = [(row, again) for (*_, row), (again,) in zip(chosen, fine, strict=True)]
    times = np.array([[one["shift_time_s"] for one in pair] for pair in pairs], dtype=float)
    # None is NaN by now.
    apart = -np.diff(np.where(np.isnan(times), blocks[0].clutch.timeout, times))[:, 0]
    weights = np.array([blocks[k].point.weight / len(blocks[k].angles) for k, *_ in chosen])
    weights /= weights.sum()
    mean = float(weights @ apart)
    return math.sqrt(mean**2 + float(weights**2 @ (apart - mean) ** 2) * number / (number - 1))
