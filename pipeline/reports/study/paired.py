"""Differences of two designs that were simulated at the same places of the pitch.

Designs have the same random start of their angles, as shares of the pitch, so that the difference
of their times at each angle leaves out what both have in common. Its mean has the standard error
of evenly spaced angles (``sim.statistics.expectation``). Where a shift did not engage, or angles
differ, nothing is paired.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from dogshape.pipeline.reports.study.single_shifts import place
from dogshape.sim.statistics.expectation import variance_of_mean
from dogshape.sim.statistics.shift_records import Record

LEAST = 3  #: angles of a point below which they say nothing of an error
Place = tuple[str, str]


@dataclass(frozen=True)
class Difference:
    """Difference of mean times in s with its standard error; ``paired`` at the same angles."""

    value: float
    error: float
    paired: bool

    @property
    def clear(self) -> bool:
        """Whether it is at least twice its standard error."""
        return abs(self.value) >= 2.0 * self.error and self.value != 0.0


def _pair_key(row: Record) -> tuple[Place, int]:
    """Name the operating point of a shift, and its place in the pitch in millionths."""
    share = row["relative_angle_deg"] * row["count"] / 360.0
    return place(row["mismatch_rpm"], row["force_N"]), round(1e6 * share)


def phases(rows: Sequence[Record]) -> dict[Place, dict[int, float | None]]:
    """Sort shifts by operating point and place in the pitch, in millionths: times in s."""
    found: dict[Place, dict[int, float | None]] = {}
    for row in rows:
        at, phase = _pair_key(row)
        found.setdefault(at, {})[phase] = row["shift_time_s"]
    return found


def paired_points(ours: Sequence[Record], theirs: Sequence[Record]) -> dict[Place, Difference]:
    """Pair the shifts of two designs at each operating point: the second's times less the first's.

    Only points whose angles are the same ones, three or more, and where all shifts engaged.
    """
    mine, other, found = phases(ours), phases(theirs), {}
    for at, times in mine.items():
        beside = other.get(at, {})
        if times.keys() != beside.keys() or len(times) < LEAST:
            continue
        steps = [(times[k], beside[k]) for k in sorted(times)]
        known = [(a, b) for a, b in steps if a is not None and b is not None]
        if len(known) == len(steps):
            each = np.array([b - a for a, b in known])
            error = math.sqrt(variance_of_mean(each))
            found[at] = Difference(float(each.mean()), error, paired=True)
    return found


def point_differences(
    ours: Sequence[Record], theirs: Sequence[Record], paired: Mapping[Place, Difference]
) -> dict[Place, Difference]:
    """Take the difference at each point that two confirmations share, paired where it can be.

    Points where a design engages too seldom to have a time are left out.

    ``ours`` and ``theirs`` are records of points with ``mean_s`` and ``standard_error_s``.
    """
    beside = {place(p["mismatch_rpm"], p["force_N"]): p for p in theirs}
    found = {}
    for point in ours:
        at = place(point["mismatch_rpm"], point["force_N"])
        other = beside.get(at)
        if other is None or None in (point["mean_s"], other["mean_s"]):
            continue
        errors = [p["standard_error_s"] for p in (point, other)]
        error = math.hypot(*(math.nan if e is None else e for e in errors))
        plain = Difference(other["mean_s"] - point["mean_s"], error, paired=False)
        # In two levels a mean rests on far more shifts than the pairs of Drake alone.
        found[at] = plain if point.get("n_planar") else paired.get(at, plain)
    return found


def overall(points: Mapping[Place, Difference], weights: Mapping[Place, float]) -> Difference:
    """Weigh the differences of operating points, whose errors are independent."""
    total = sum(weights.get(at, 1.0) for at in points)
    shares = {at: weights.get(at, 1.0) / total for at in points}
    value = sum(shares[at] * one.value for at, one in points.items())
    error = math.sqrt(sum((shares[at] * one.error) ** 2 for at, one in points.items()))
    return Difference(value, error, all(one.paired for one in points.values()))
