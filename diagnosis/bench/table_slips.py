"""Slips and flaws that the table of shifts shows, alone or beside the actuator's calibration."""

from __future__ import annotations

from collections.abc import Hashable
from itertools import combinations

import numpy as np

from dogshape.diagnosis.bench.corrections import Correction, corrected
from dogshape.diagnosis.bench.finding import Finding
from dogshape.diagnosis.bench.near_points import NEAR, near_points
from dogshape.diagnosis.bench.stand_file import Stand
from dogshape.diagnosis.bench.table import Row, Sheet
from dogshape.diagnosis.terms import Array
from dogshape.sim.errors import InputError, number
from dogshape.sim.shift.actuation import ForceProfile
from dogshape.sim.units import MS

SURE = 0.5  #: share of the free flight below which no force, mass or time zero off nominal reaches
ODD = 0.9  #: share below which a time is odd
CLOSE = 0.01  #: relative difference within which two values are the same one
#: Columns whose size may show another unit: name, unit in words, correction, and the rule.
SCALED = {
    "time": ("shift_time_s", "milliseconds", "ms", "a shift that has a time ends after its free "
             "flight and before the time-out of {} s"),
    "rise": ("force_rise_s", "milliseconds", "ms", "so slow a force could not have ended shifts in "
             "their times"),
    "force": ("force_N", "kilonewtons", "kN", "so small a force could not have ended shifts in "
              "their times"),
}  # fmt: skip


def free_flight(stand: Stand, row: Row) -> float:
    """Compute the time in s of the free flight over the shift's travel, inf without a force."""
    try:
        profile = ForceProfile(row.force, row.rise)
    except InputError:
        return np.inf
    return profile.free_flight_time(stand.clutch.shift_travel, stand.clutch.rings.mass)


def too_early(stand: Stand, row: Row, share: float = SURE) -> bool:
    """Test that a row's time lies below a share of its free flight."""
    return row.time is not None and row.time < share * free_flight(stand, row)


def _impossible(stand: Stand, sheet: Sheet) -> int:
    """Count rows that no shift can have."""
    return sum(
        np.isinf(free := free_flight(stand, row))
        or (row.time is not None and not max(0.0, SURE * free) <= row.time <= stand.clutch.timeout)
        for row in sheet.rows
    )


def _column(sheet: Sheet, name: str) -> Array:
    values = np.array([getattr(row, name) for row in sheet.rows], dtype=float)
    return np.sort(values[np.isfinite(values)])


def _span(values: Array) -> str:
    low, high = number(values[0]), number(values[-1])
    return f"is {low}" if values[0] == values[-1] else f"runs from {low} to {high}"


def bounds(stand: Stand, sheet: Sheet) -> list[Finding]:
    """Find the fewest corrections that bring most rows within their physical bounds."""
    timed, limit = _column(sheet, "time").size, stand.clutch.timeout
    if 2 * _impossible(stand, sheet) < max(1, timed):
        return []  # single cells, which are refused one by one
    columns = {name: _column(sheet, name) for name in (*SCALED, "mismatch")}
    middle = {name: np.median(abs(known)) for name, known in columns.items() if known.size}
    offered = [name for name in SCALED if name in middle and
               (middle[name] < 100.0 if name == "force" else middle[name] > limit)]  # fmt: skip
    for chosen in (c for count in (1, 2, 3) for c in combinations(offered, count)):
        other = sheet
        for name in chosen:
            other = corrected(other, Correction(name, SCALED[name][2]), stand.sensor)
        if _impossible(stand, other) <= 0.1 * len(sheet.rows):
            return [
                Finding(name, f"{column} {_span(columns[name])}, but {rule.format(number(limit))}",
                        unit, way, certain=True, arguable=False)
                for name in chosen for column, unit, way, rule in [SCALED[name]]
            ]  # fmt: skip
    turned = corrected(sheet, Correction("axes", "swapped"), stand.sensor)
    if middle["mismatch"] < 2.0 * middle["force"] or _impossible(stand, turned):
        return []
    span = _span(columns["force"])
    return [_swapped(f"force_N {span}, which could not have ended shifts in their times")]


def _swapped(found: str) -> Finding:
    looks = "the columns mismatch_rpm and force_N swapped"
    return Finding("axes", found, looks, "swapped", certain=True)


def axes_by_rise(stand: Stand, sheet: Sheet) -> list[Finding]:
    """Find swapped axes where the rise time goes with the mismatch instead of the force."""
    rises: dict[str, dict[float, set[float]]] = {"force": {}, "mismatch": {}}
    for row in sheet.rows:
        for name, by in rises.items():
            by.setdefault(getattr(row, name), set()).add(row.rise)
    mixed, several = (sum(len(some) > 1 for some in by.values()) for by in rises.values())
    if len({row.rise for row in sheet.rows}) < 2 or mixed < 2 or several:
        return []
    return [_swapped(
        f"force_rise_s goes with mismatch_rpm: {mixed} of {len(rises['force'])} forces have "
        "several rise times, and each mismatch has one"
    )]  # fmt: skip


def force_by_calibration(stand: Stand, sheet: Sheet) -> list[Finding]:
    """Find forces that are the arm's of the calibration and not the sleeve's."""
    both = np.array([(c.arm_force, c.sleeve_force) for c in stand.calibration
                     if c.arm_force and c.sleeve_force])  # fmt: skip
    forces, factor = _column(sheet, "force"), stand.sensor.force_factor
    if not both.size:
        return []

    def among(values: Array) -> list[bool]:
        apart = abs(values[:, None, None] / both - 1.0).min(axis=1)
        return list((apart < CLOSE).all(axis=0))

    if factor is not None and factor > 1.05 and among(forces / factor)[1]:
        times = f"{number(factor)} times sleeve_force_N of the table actuator_calibration"
        looks = "a force referred to the sleeve twice"
        return [Finding("force", f"force_N {_span(forces)}, {times}", looks, certain=True)]
    if among(forces) != [True, False]:
        return []
    found = (
        f"force_N {_span(forces)}, the values of arm_force_N in the table actuator_calibration "
        "and not those of sleeve_force_N"
    )
    return [_at_arm(stand, found, certain=True)]


def _at_arm(stand: Stand, found: str, *, certain: bool) -> Finding:
    factor = stand.sensor.force_factor
    looks = "the force at the robot arm instead of that at the sleeve"
    looks += "" if factor is None else f", which is {number(factor)} times as large"
    return Finding("force", found, looks, None if factor is None else "arm", certain=certain)


def early_times(stand: Stand, sheet: Sheet) -> list[Finding]:
    """Find times that are shorter than the free flight, though not impossibly so."""
    early = sum(too_early(stand, row, ODD) for row in sheet.rows)
    timed, factor = _column(sheet, "time").size, stand.sensor.force_factor
    if early < max(1, 0.2 * timed):
        return []
    found = f"{early} of {timed} times are shorter than the free flight under their force"
    if factor is not None and factor > 1.05:
        turned = corrected(sheet, Correction("force", "arm"), stand.sensor)
        if not any(too_early(stand, row, ODD) for row in turned.rows):
            return [_at_arm(stand, found, certain=False)]
    looks = "a time that starts after the force, a larger force or a smaller mass than given"
    return [Finding("time", found, looks)]


def repeated_rows(_: Stand, sheet: Sheet) -> list[Finding]:
    """Find rows with a time that repeat earlier rows.

    Times of single shifts are rounded and may be equal by chance, so that of these half must be
    repeats; of means and of traces one is enough.
    """
    first: dict[Hashable, int] = {}
    found: dict[bool, list[tuple[int, int]]] = {True: [], False: []}
    timed = [row for row in sheet.rows if row.time is not None]
    lone = [row.n == 1 and row.trace is None for row in timed]
    for row, single in zip(timed, lone, strict=True):
        numbers = (row.mismatch, row.force, row.rise, row.n, row.time)
        what = numbers if row.trace is None else row.trace.path
        if what in first:
            found[single].append((row.row, first[what]))
        first.setdefault(what, row.row)
    copies = found[False] + (found[True] if 2 * len(found[True]) >= max(4, sum(lone)) else [])
    if not copies:
        return []
    many = f"{len(copies)} rows repeat earlier ones" if len(copies) > 1 else "a row is there twice"
    looks = "a table that was copied below itself: copies make the data seem surer than they are"
    said = f"{many}: row {copies[0][0]} is row {copies[0][1]} again"
    return [Finding("rows", said, looks, arguable=False)]


def nearly_same_points(_: Stand, sheet: Sheet) -> list[Finding]:
    """Find rows whose set values are nearly, but not just, those of others."""
    near = near_points(sheet.rows)
    if not near:
        return []
    many = f"{len(near)} rows have" if len(near) > 1 else "a row has"
    one, other = (
        f"row {row.row} ({row.mismatch:.6g} 1/min, {row.force:.6g} N, {row.rise:.4g} s)"
        for row in (sheet.rows[place] for place in min(near.items()))
    )
    found = (
        f"{many} nearly the set values of others: {one} and {other} differ by at most {NEAR:.0%}"
    )
    looks = "measured in place of set values, each of which would be an operating point of its own"
    return [Finding("points", found, f"{looks}, with errors of its own", "joined", certain=True)]


def ends_early(stand: Stand, row: Row) -> bool:
    """Test that the trace of a row ends before its shift does, in time and in travel."""
    trace = row.trace
    if trace is None or row.time is None or trace.time[-1] >= row.time - 2.0 * trace.step:
        return False
    return bool(trace.displacement.max() < stand.clutch.shift_travel)


def short_traces(stand: Stand, sheet: Sheet) -> list[Finding]:
    """Find traces that end before their shift, and say how many end before the first touch."""
    short = [(row, row.trace) for row in sheet.rows if row.trace and ends_early(stand, row)]
    if not short:
        return []
    row, trace = short[0]
    many = f"{len(short)} traces end" if len(short) > 1 else "a trace ends"
    found = (
        f"{many} before the shift is over: that of row {row.row} by "
        f"{((row.time or 0.0) - trace.time[-1]) / MS:.3g} ms, so that it is used up to there"
    )
    flying = sum(one.displacement.max() < stand.clutch.dog.axial_gap for _, one in short)
    if flying:
        found += (
            f"; {flying} of {len(short)} end before the first touch and tell its beginning only, "
            "if they are of these shifts at all"
        )
    return [Finding("traces", found, "a recording that was stopped early", arguable=False)]
