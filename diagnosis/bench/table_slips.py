"""Slips that the table of shifts shows, alone or beside the calibration of the actuator."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import combinations

import numpy as np

from dogshape.diagnosis.bench.corrections import Correction, corrected
from dogshape.diagnosis.bench.finding import Finding
from dogshape.diagnosis.bench.stand_file import Stand
from dogshape.diagnosis.bench.table import Row, Sheet
from dogshape.sim.errors import InputError, number
from dogshape.sim.shift.actuation import ForceProfile

SURE = 0.5  #: share of the free flight below which no force, mass or time zero off nominal reaches
ODD = 0.9  #: share below which a time is odd
CLOSE = 0.01  #: relative difference within which two values are the same one


def free_flight(stand: Stand, row: Row) -> float:
    """Return the time in s of the free flight over the shift's travel, inf without a force."""
    try:
        profile = ForceProfile(row.force, row.rise)
    except InputError:
        return np.inf
    return profile.free_flight_time(stand.clutch.shift_travel, stand.clutch.rings.mass)


def too_early(stand: Stand, row: Row, share: float = SURE) -> bool:
    """Test that a row's time lies below a share of its free flight."""
    return row.time is not None and row.time < share * free_flight(stand, row)


def _cannot_be(stand: Stand, row: Row) -> bool:
    if not np.isfinite(free_flight(stand, row)):
        return True
    beyond = row.time is not None and not 0.0 < row.time <= stand.clutch.timeout
    return beyond or too_early(stand, row)


def bounds(stand: Stand, sheet: Sheet) -> list[Finding]:
    """Return the fewest corrections that bring most rows within their physical bounds."""
    wrong = sum(_cannot_be(stand, row) for row in sheet.rows)
    timed = sum(row.time is not None for row in sheet.rows)
    if 2 * wrong < max(1, timed):
        return []  # single cells, which are refused one by one
    offered = [quantity for quantity in UNITS if _looks_scaled(stand, sheet, quantity)]
    for count in (1, 2, 3):
        for chosen in combinations(offered, count):
            if _left(stand, sheet, chosen) <= 0.1 * len(sheet.rows):
                return [_bound(stand, sheet, quantity) for quantity in chosen]
    return _swapped_by_size(stand, sheet)


UNITS = {"time": "ms", "rise": "ms", "force": "kN"}


def _looks_scaled(stand: Stand, sheet: Sheet, quantity: str) -> bool:
    """Test that the size of a column speaks for the unit that it may be in."""
    known = [value for row in sheet.rows if (value := getattr(row, quantity)) is not None]
    if not known:
        return False
    middle = float(np.median(known))
    return middle < 100.0 if quantity == "force" else middle > stand.clutch.timeout


def _left(stand: Stand, sheet: Sheet, chosen: Iterable[str]) -> int:
    for quantity in chosen:
        sheet = corrected(sheet, Correction(quantity, UNITS[quantity]), stand.sensor)
    return sum(_cannot_be(stand, row) for row in sheet.rows)


def _bound(stand: Stand, sheet: Sheet, quantity: str) -> Finding:
    column = {"time": "shift_time_s", "rise": "force_rise_s", "force": "force_N"}[quantity]
    rule = {
        "time": "a shift that has a time ends after its free flight and before the time-out of "
        f"{number(stand.clutch.timeout)} s",
        "rise": "so slow a force could not have ended shifts in their times",
        "force": "so small a force could not have ended shifts in their times",
    }[quantity]
    unit = {"ms": "milliseconds", "kN": "kilonewtons"}[UNITS[quantity]]
    found = f"{column} {_span(getattr(row, quantity) for row in sheet.rows)}, but {rule}"
    return Finding(quantity, found, unit, UNITS[quantity], certain=True, arguable=False)


def _span(values: Iterable[float | None]) -> str:
    known = sorted(value for value in values if value is not None)
    if known[0] == known[-1]:
        return f"is {number(known[0])}"
    return f"runs from {number(known[0])} to {number(known[-1])}"


def _swapped_by_size(stand: Stand, sheet: Sheet) -> list[Finding]:
    mismatch, force = (np.abs(_column(sheet, name)) for name in ("mismatch", "force"))
    turned = corrected(sheet, Correction("axes", "swapped"), stand.sensor)
    if np.median(mismatch) < 2.0 * np.median(force) or any(
        _cannot_be(stand, row) for row in turned.rows
    ):
        return []
    found = f"force_N {_span(force)}, which could not have ended shifts in their times"
    return [_swapped(found)]


def _swapped(found: str) -> Finding:
    looks = "the columns mismatch_rpm and force_N swapped"
    return Finding("axes", found, looks, "swapped", certain=True)


def _column(sheet: Sheet, name: str) -> np.ndarray:
    return np.array([getattr(row, name) for row in sheet.rows], dtype=float)


def axes_by_rise(stand: Stand, sheet: Sheet) -> list[Finding]:
    """Return swapped axes where the rise time goes with the mismatch instead of the force."""
    by_mismatch = _rises(sheet, "mismatch")
    by_force = _rises(sheet, "force")
    whole = len(set().union(*by_mismatch))
    mixed = sum(len(rises) > 1 for rises in by_force)
    if whole < 2 or mixed < 2 or any(len(rises) > 1 for rises in by_mismatch):
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


def axes_by_calibration(stand: Stand, sheet: Sheet) -> list[Finding]:
    """Return swapped axes where the mismatches are the calibrated forces."""
    known = [one.sleeve_force for one in stand.calibration if one.sleeve_force is not None]
    mismatches = np.unique(np.abs(_column(sheet, "mismatch")))
    if mismatches.size < 2 or not _all_among(mismatches, known):
        return []
    if _all_among(np.unique(_column(sheet, "force")), known):
        return []
    found = f"mismatch_rpm {_span(mismatches)}, the forces of the table actuator_calibration"
    return [_swapped(found)]


def _all_among(values: np.ndarray, known: list[float]) -> bool:
    if not known:
        return False
    apart = np.abs(values[:, None] / np.array(known)[None, :] - 1.0)
    return bool((apart.min(axis=1) < CLOSE).all())


def force_by_calibration(stand: Stand, sheet: Sheet) -> list[Finding]:
    """Return a force at the arm where the forces are the arm's of the calibration."""
    both = [one for one in stand.calibration if one.arm_force and one.sleeve_force]
    forces = np.unique(_column(sheet, "force"))
    at_arm = _all_among(forces, [one.arm_force for one in both if one.arm_force])
    sleeve = [one.sleeve_force for one in both if one.sleeve_force]
    factor = stand.sensor.force_factor
    if factor is not None and factor > 1.05 and _all_among(forces / factor, sleeve):
        times = f"{number(factor)} times sleeve_force_N of the table actuator_calibration"
        found, looks = f"force_N {_span(forces)}, {times}", "a force referred to the sleeve twice"
        return [Finding("force", found, looks, certain=True)]
    if not at_arm or _all_among(forces, sleeve):
        return []
    found = (
        f"force_N {_span(forces)}, the values of arm_force_N in the table actuator_calibration "
        "and not those of sleeve_force_N"
    )
    return [_at_arm(stand, found, certain=True)]


def _at_arm(stand: Stand, found: str, *, certain: bool) -> Finding:
    factor = stand.sensor.force_factor
    looks = "the force at the robot arm instead of that at the sleeve"
    if factor is not None:
        looks += f", which is {number(factor)} times as large"
    way = None if factor is None else "arm"
    return Finding("force", found, looks, way, certain=certain)


def linkage(stand: Stand, sheet: Sheet) -> list[Finding]:
    """Return a calibration whose forces contradict the linkage of the sensor."""
    factor = stand.sensor.force_factor
    pairs = [
        one.sleeve_force / one.arm_force
        for one in stand.calibration
        if one.arm_force and one.sleeve_force
    ]
    if factor is None or not pairs or abs(np.median(pairs) / factor - 1.0) < 2.0 * CLOSE:
        return []
    found = (
        f"sleeve_force_N is {number(float(np.median(pairs)))} times arm_force_N in the table "
        f"actuator_calibration, but linkage_ratio and linkage_efficiency make it {number(factor)}"
    )
    return [Finding("force", found, "another linkage in one of the two")]


def weak_force(stand: Stand, sheet: Sheet) -> list[Finding]:
    """Return a force that moves the ring, but is smaller than any shift force."""
    forces = _column(sheet, "force")
    if not 0.0 < forces.max() < 20.0:
        return []
    return [Finding("force", f"force_N {_span(forces)} N", "kilonewtons", "kN")]


def early_times(stand: Stand, sheet: Sheet) -> list[Finding]:
    """Return times that are shorter than the free flight, though not impossibly so."""
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
