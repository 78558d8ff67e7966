"""Differences of two designs that were simulated at the same places of the pitch.

Designs have the same random start of their angles, as shares of the pitch, so that the difference
of their times at each angle leaves out what both have in common. Its mean has the standard error
of evenly spaced angles (``sim.statistics.expectation``). Where a shift did not engage, or angles
differ, nothing is paired.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from dogshape.pipeline.reports.study.single_shifts import place
from dogshape.sim.statistics.expectation import variance_of_mean
from dogshape.sim.statistics.shift_records import Record

ENDS = (0.1, 0.9)  #: shares of the draws of a factor between which a gain is given
FREE = 20  #: shifts beyond what is fitted, below which they say nothing of a factor
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


@dataclass(frozen=True)
class ByFactor:
    """Gain in s at ``ENDS`` of the draws of a factor, and the standard error of the difference."""

    ends: tuple[float, float]
    error: float


def gain_by_factor(
    ours: Sequence[Record], theirs: Sequence[Record], weights: Iterable[float], names: Sequence[str]
) -> dict[str, ByFactor]:
    """Fit the first design's times less the second's to the logarithms of the drawn factors.

    Both have the same draws at the same places of the pitch, so each pair is of one draw. The fit
    has a mean for each operating point and a slope for each factor that was drawn. Empty where too
    few shifts of both engaged.
    """
    beside = {_pair_key(row): row for row in theirs}
    both = [
        (row, beside[_pair_key(row)], weight)
        for row, weight in zip(ours, weights, strict=True)
        if _pair_key(row) in beside
    ]
    both = [(a, b, w) for a, b, w in both if None not in (a["shift_time_s"], b["shift_time_s"])]
    names = [name for name in names if len({a.get(name, 1.0) for a, _, _ in both}) > 1]
    places = [place(a["mismatch_rpm"], a["force_N"]) for a, _, _ in both]
    free = len(both) - len(set(places)) - len(names)
    if not names or free < FREE:
        return {}
    logs = np.log([[a[name] for name in names] for a, _, _ in both])
    gain = np.array([a["shift_time_s"] - b["shift_time_s"] for a, b, _ in both])
    weight = np.array([w for _, _, w in both])
    weight = weight / weight.mean()
    x, y = logs.copy(), gain.copy()
    for one in set(places):
        here = np.array([at == one for at in places])
        x[here] -= x[here].mean(axis=0)
        y[here] -= y[here].mean()
    root = np.sqrt(weight)
    slope, *_ = np.linalg.lstsq(root[:, None] * x, root * y, rcond=None)
    variance = float(weight @ (y - x @ slope) ** 2) / free
    errors = np.sqrt(variance * np.diag(np.linalg.pinv(x.T @ (weight[:, None] * x))))
    mean, middle = float(np.average(gain, weights=weight)), np.average(logs, axis=0, weights=weight)
    found = {}
    for k, name in enumerate(names):
        low, high = np.quantile(logs[:, k], ENDS)
        ends = tuple(mean + float(slope[k] * (end - middle[k])) for end in (low, high))
        found[name] = ByFactor((ends[0], ends[1]), float(errors[k] * (high - low)))
    return found


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
