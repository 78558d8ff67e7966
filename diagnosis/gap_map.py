"""Gap over mismatch and force: a map of grouped operating points, and a sentence.

A point counts as slower or faster where its gap exceeds ``CLEAR_ERRORS`` standard errors. The
sentence states the pattern that most points follow: no gap, one sign everywhere, or one sign beyond
a mismatch or force. A split of the points must explain more points than a pattern without one.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dogshape.diagnosis.comparison import PointGap
from dogshape.diagnosis.terms import Array
from dogshape.sim.units import RPM, short

Mask = NDArray[np.bool_]  #: of points, (n,)
CLEAR_ERRORS = 2.0  #: standard errors from which a gap has a sign
SPLIT_COST = 2.0  #: points that a split must explain beyond a pattern without one
MIN_PATTERN_SHARE = 0.6  #: of the points, from which a pattern is stated
SIGNS = {1: "slower", -1: "faster", 0: "within the error"}


class Group(NamedTuple):
    """Neighbouring values of mismatch or force as one column or row of a map."""

    low: float
    high: float

    @property
    def label(self) -> str:
        """Value or range in words."""
        if self.low == self.high:
            return short(self.low)
        return f"{short(self.low, 3)} to {short(self.high, 3)}"


class MapCell(NamedTuple):
    """Weighted mean gap of the operating points in a cell of a map."""

    gap: float  #: s
    standard_error: float  #: s

    @property
    def z(self) -> float:
        """Gap in standard errors."""
        return self.gap / self.standard_error


@dataclass(frozen=True)
class GapMap:
    """Gaps of the points that have one, by groups of mismatch, 1/min, and force, N."""

    mismatches: tuple[Group, ...]
    forces: tuple[Group, ...]
    cells: dict[tuple[int, int], MapCell]  #: by indices of force and mismatch


class _Points(NamedTuple):
    """Operating points with a gap, (n,) each."""

    mismatch: Array  #: 1/min
    force: Array  #: N
    gap: Array  #: s
    standard_error: Array  #: s

    @property
    def signs(self) -> Array:
        """1 for slower, -1 for faster, 0 within the error."""
        z = self.gap / self.standard_error
        return np.where(abs(z) < CLEAR_ERRORS, 0.0, np.sign(z))


class _Pattern(NamedTuple):
    """Signs of the gap inside and outside a part of the points."""

    inside: Mask  #: whether a point is in the part, (n,)
    sign: int
    outside_sign: int
    place: str  #: of the part, in words; empty for all points
    outside_place: str
    cost: float  #: points that it must explain beyond a pattern of no cost

    def follows(self, signs: Array) -> Mask:
        """Mark the points that follow the pattern, (n,)."""
        return np.asarray(signs == np.where(self.inside, self.sign, self.outside_sign), dtype=bool)

    def score(self, signs: Array) -> float:
        """Count the points that follow the pattern, less its cost."""
        return float(self.follows(signs).sum()) - self.cost


def map_gaps(gaps: Sequence[PointGap], columns: int, rows: int) -> GapMap:
    """Average gaps over at most ``columns`` groups of mismatch and ``rows`` groups of force."""
    points = _points_of(gaps)
    mismatches = group_values(points.mismatch, columns)
    forces = group_values(points.force, rows)
    cells = {}
    for i, force in enumerate(forces):
        in_row = (force.low <= points.force) & (points.force <= force.high)
        for j, mismatch in enumerate(mismatches):
            in_column = (mismatch.low <= points.mismatch) & (points.mismatch <= mismatch.high)
            inside = in_row & in_column
            if inside.any():
                weights = points.standard_error[inside] ** -2.0
                mean = float(np.average(points.gap[inside], weights=weights))
                cells[i, j] = MapCell(mean, float(weights.sum() ** -0.5))
    return GapMap(mismatches, forces, cells)


def group_values(values: Array, max_count: int) -> tuple[Group, ...]:
    """Group values (n,) in ascending order; the nearest neighbours by their ratio join first."""
    groups = [Group(value, value) for value in np.unique(values).tolist()]
    while len(groups) > max_count:
        pairs = [(a.low, b.high) for a, b in itertools.pairwise(groups)]
        distances = [(high - low) / (abs(low) + abs(high)) for low, high in pairs]
        index = int(np.argmin(distances))
        groups[index : index + 2] = [Group(*pairs[index])]
    return tuple(groups)


def describe_gaps(gaps: Sequence[PointGap]) -> str:
    """State in one sentence where the bench differs, by how much, and the largest gap."""
    points = _points_of(gaps)
    if not len(points.gap):
        return "No operating point has a time of bench and simulation."
    signs = points.signs
    pattern = max(_patterns(points), key=lambda candidate: candidate.score(signs))
    follows = pattern.follows(signs)
    if follows.mean() < MIN_PATTERN_SHARE:
        counts = [f"{SIGNS[sign]} at {int((signs == sign).sum())}" for sign in (1, -1, 0)]
        clause = f"{', '.join(counts)} of {len(signs)} points"
    else:
        clause = _pattern_clause(points, pattern, follows)
    return f"The bench is {clause}; {_largest_clause(points)}."


def _points_of(gaps: Sequence[PointGap]) -> _Points:
    """Collect the operating points that have a gap."""
    rows = [
        (gap.cell.point.mismatch / RPM, gap.cell.point.profile.force, gap.gap, gap.standard_error)
        for gap in gaps
        if gap.gap is not None and np.isfinite(gap.gap)
    ]
    table = np.array(rows, dtype=float).reshape(-1, 4)
    mismatch = np.array([float(f"{value:.6g}") for value in table[:, 0]])
    return _Points(mismatch, *table[:, 1:].T)


def _patterns(points: _Points) -> Iterator[_Pattern]:
    """Yield the patterns that a sentence may state, those without a split first."""
    everywhere = np.ones(len(points.gap), dtype=bool)
    for sign in (0, 1, -1):
        yield _Pattern(everywhere, sign, 0, "", "", 0.0)
    for values, unit in ((points.mismatch, "1/min"), (points.force, "N")):
        for split in np.unique(values)[1:].tolist():
            place = f"from {short(split)} {unit} on"
            for sign in (1, -1):
                for outside_sign in (0, -sign):
                    yield _Pattern(values >= split, sign, outside_sign, place, "below", SPLIT_COST)
                yield _Pattern(
                    values < split, sign, 0, f"below {short(split)} {unit}", "above", SPLIT_COST
                )


def _pattern_clause(points: _Points, pattern: _Pattern, follows: Mask) -> str:
    """State a pattern with the gaps of the points that follow it."""
    inside = pattern.inside
    clauses = [_part_clause(points, inside, follows, pattern.sign, pattern.place)]
    if not inside.all():
        part = (~inside, follows, pattern.outside_sign, pattern.outside_place)
        clauses.append(_part_clause(points, *part))
    return ", ".join(clauses)


def _part_clause(points: _Points, part: Mask, follows: Mask, sign: int, place: str) -> str:
    """State sign and range of the gaps in a part of the points, and how many follow the pattern."""
    words = [SIGNS[sign]]
    counted = part & follows
    if sign and counted.any():
        sizes = 1e3 * abs(points.gap[counted])
        ends = dict.fromkeys(short(end, 2) for end in (sizes.min(), sizes.max()))
        words.append(f"by {' to '.join(ends)} ms")
    if place:
        words.append(place)
    total = int(part.sum())
    count = int(counted.sum())
    if count < total:
        words.append(f"at {count} of {total} points")
    elif not place:
        words.append(f"at all {total} points" if total > 1 else "at the only point")
    return " ".join(words)


def _largest_clause(points: _Points) -> str:
    """State the largest gap that has a sign; without one the largest in standard errors."""
    z = abs(points.gap / points.standard_error)
    sizes = np.where(z >= CLEAR_ERRORS, abs(points.gap), 0.0)
    index = int(sizes.argmax() if sizes.any() else z.argmax())
    place = f"{short(points.mismatch[index])} 1/min and {short(points.force[index])} N"
    gap = float(f"{1e3 * points.gap[index]:.2g}")
    return f"largest at {place}: {gap:+g} ms, {short(z[index], 2)} standard errors"
