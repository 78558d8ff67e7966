"""Slips that the table of shifts shows, alone or beside the calibration of the actuator."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import combinations

import numpy as np

from dogshape.diagnosis.bench.corrections import Correction, corrected
from dogshape.diagnosis.bench.finding import Finding
from dogshape.diagnosis.bench.stand_file import Stand
from dogshape.diagnosis.bench.table import Row, Sheet
from dogshape.diagnosis.terms import Array
from dogshape.sim.errors import InputError, number
from dogshape.sim.shift.actuation import ForceProfile

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
    limit = stand.clutch.timeout
    return sum(
        not np.isfinite(free_flight(stand, row))
        or (row.time is not None and not 0.0 < row.time <= limit)
        or too_early(stand, row)
        for row in sheet.rows
    )


def bounds(stand: Stand, sheet: Sheet) -> list[Finding]:
    """Find the fewest corrections that bring most rows within their physical bounds."""
    timed = sum(row.time is not None for row in sheet.rows)
    if 2 * _impossible(stand, sheet) < max(1, timed):
        return []  # single cells, which are refused one by one
    limit = stand.clutch.timeout
    middle = {name: _median(sheet, name) for name in SCALED}
    offered = [name for name, value in middle.items()
               if (value < 100.0 if name == "force" else value > limit)]  # fmt: skip
    for count in (1, 2, 3):
        for chosen in combinations(offered, count):
            other = sheet
            for name in chosen:
                other = corrected(other, Correction(name, SCALED[name][2]), stand.sensor)
            if _impossible(stand, other) <= 0.1 * len(sheet.rows):
                return [_scaled(sheet, name, limit) for name in chosen]
    turned = corrected(sheet, Correction("axes", "swapped"), stand.sensor)
    mismatch, force = (np.abs(_column(sheet, name)) for name in ("mismatch", "force"))
    if np.median(mismatch) < 2.0 * np.median(force) or _impossible(stand, turned):
        return []
    return [_swapped(f"force_N {_span(force)}, which could not have ended shifts in their times")]


def _scaled(sheet: Sheet, name: str, limit: float) -> Finding:
    column, unit, way, rule = SCALED[name]
    found = f"{column} {_span(_column(sheet, name))}, but {rule.format(number(limit))}"
    return Finding(name, found, unit, way, certain=True, arguable=False)


def _median(sheet: Sheet, name: str) -> float:
    known = _column(sheet, name)
    return float(np.median(known)) if known.size else np.nan


def _span(values: Iterable[float]) -> str:
    known = sorted(values)
    same = known[0] == known[-1]
    return (
        f"is {number(known[0])}" if same else f"runs from {number(known[0])} to {number(known[-1])}"
    )


def _swapped(found: str) -> Finding:
    looks = "the columns mismatch_rpm and force_N swapped"
    return Finding("axes", found, looks, "swapped", certain=True)


def _column(sheet: Sheet, name: str) -> Array:
    values = np.array([getattr(row, name) for row in sheet.rows], dtype=float)
    return values[np.isfinite(values)]


def axes_by_rise(stand: Stand, sheet: Sheet) -> list[Finding]:
    """Find swapped axes where the rise time goes with the mismatch instead of the force."""
    by_mismatch, by_force = _rises(sheet, "mismatch"), _rises(sheet, "force")
    mixed = sum(len(rises) > 1 for rises in by_force)
    several = any(len(rises) > 1 for rises in by_mismatch)
    if len(set().union(*by_mismatch)) < 2 or mixed < 2 or several:
        return []
    found = (
        f"force_rise_s goes with mismatch_rpm: {mixed} of {len(by_force)} forces have several "
        "rise times, and each mismatch has one"
    )
    return [_swapped(found)]


def _rises(sheet: Sheet, name: str) -> list[set[float]]:
    found: dict[float, set[float]] = {}
    for row in sheet.rows:
        found.setdefault(getattr(row, name), set()).add(row.rise)
    return list(found.values())


def force_by_calibration(stand: Stand, sheet: Sheet) -> list[Finding]:
    """Find a force at the arm where the forces are the arm's of the calibration."""
    both = [(c.arm_force, c.sleeve_force) for c in stand.calibration
            if c.arm_force and c.sleeve_force]  # fmt: skip
    forces, factor = np.unique(_column(sheet, "force")), stand.sensor.force_factor
    arm, sleeve = [a for a, _ in both], [s for _, s in both]
    if factor is not None and factor > 1.05 and _all_among(forces / factor, sleeve):
        times = f"{number(factor)} times sleeve_force_N of the table actuator_calibration"
        looks = "a force referred to the sleeve twice"
        return [Finding("force", f"force_N {_span(forces)}, {times}", looks, certain=True)]
    if not _all_among(forces, arm) or _all_among(forces, sleeve):
        return []
    found = (
        f"force_N {_span(forces)}, the values of arm_force_N in the table actuator_calibration "
        "and not those of sleeve_force_N"
    )
    return [_at_arm(stand, found, certain=True)]


def _all_among(values: Array, known: list[float]) -> bool:
    apart = np.abs(values[:, None] / np.array(known)[None, :] - 1.0)
    return bool(known and (apart.min(axis=1) < CLOSE).all())


def _at_arm(stand: Stand, found: str, *, certain: bool) -> Finding:
    factor = stand.sensor.force_factor
    looks = "the force at the robot arm instead of that at the sleeve"
    looks += "" if factor is None else f", which is {number(factor)} times as large"
    return Finding("force", found, looks, None if factor is None else "arm", certain=certain)


def early_times(stand: Stand, sheet: Sheet) -> list[Finding]:
    """Find times that are shorter than the free flight, though not impossibly so."""
    timed = [row for row in sheet.rows if row.time is not None]
    early = [row for row in timed if too_early(stand, row, ODD)]
    if len(early) < max(1, 0.2 * len(timed)):
        return []
    found = f"{len(early)} of {len(timed)} times are shorter than the free flight under their force"
    factor = stand.sensor.force_factor
    if factor is not None and factor > 1.05:
        turned = corrected(sheet, Correction("force", "arm"), stand.sensor)
        if not any(too_early(stand, row, ODD) for row in turned.rows):
            return [_at_arm(stand, found, certain=False)]
    looks = "a time that starts after the force, a larger force or a smaller mass than given"
    return [Finding("time", found, looks)]
