"""Slips that traces show beside the table of shifts: they say most of it again."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from dogshape.diagnosis.bench.finding import Finding
from dogshape.diagnosis.bench.repeats import ends_early
from dogshape.diagnosis.bench.stand_file import Stand
from dogshape.diagnosis.bench.table import Row, Sheet
from dogshape.diagnosis.bench.traces import BenchTrace
from dogshape.sim.errors import InputError, number
from dogshape.sim.shift.actuation import ForceProfile
from dogshape.sim.units import MM, RPM

NEAR = 1.3  #: factor within which two readings of one quantity are taken as the same
SETTLED = 0.25  #: s after the rise from which any delay of the force is over

Ratios = NDArray[np.float64]


def _ratios(sheet: Sheet, ratio: Callable[[Row, BenchTrace], float | None]) -> Ratios:
    """Return a ratio for each trace that has one, (n,)."""
    values = [ratio(row, row.trace) for row in sheet.rows if row.trace is not None]
    return np.array([value for value in values if value is not None], dtype=float)


def _all_near(ratios: Ratios, target: float, factor: float = NEAR) -> bool:
    """Test that nine in ten ratios lie within a factor of a target, of its sign."""
    return _share_near(ratios, target, factor) >= 0.9


def _share_near(ratios: Ratios, target: float, factor: float = NEAR) -> float:
    if not ratios.size:
        return 0.0
    apart = ratios / target
    return float(((apart > 1.0 / factor) & (apart < factor)).mean())


def _middle(ratios: Ratios) -> str:
    return number(float(f"{np.median(ratios):.3g}"))


def _start(trace: BenchTrace) -> slice:
    """Return the first samples, in which nothing has touched yet."""
    return slice(0, max(5, trace.time.size // 32))


def _first_speed(trace: BenchTrace) -> float:
    """Return output less sliding speed at the start, 1/min."""
    return float(np.median(trace.relative_speed[_start(trace)])) / RPM


def axes_by_speed(stand: Stand, sheet: Sheet) -> list[Finding]:
    """Return swapped axes where the speeds of traces begin at what the table calls a force."""
    by_force = _ratios(sheet, lambda row, t: abs(_first_speed(t)) / row.force if row.force else 0.0)
    if not _all_near(by_force, 1.0) or _share_near(_speed_ratios(sheet), 1.0) > 0.5:
        return []
    found = f"the traces begin with a mismatch of {_middle(by_force)} 1/min for each N of force_N"
    return [Finding("axes", found, "the columns mismatch_rpm and force_N swapped", "swapped", True)]


def _speed_ratios(sheet: Sheet) -> Ratios:
    """Return the first mismatch of each trace over that of its row, (n,)."""
    return _ratios(sheet, lambda row, t: _first_speed(t) / row.mismatch if row.mismatch else None)


def speeds(stand: Stand, sheet: Sheet) -> list[Finding]:
    """Return speeds in another unit, or of another sign, in table or traces."""
    ratios = _speed_ratios(sheet)
    if not ratios.size or _all_near(ratios, 1.0):
        return []
    found = (
        f"the traces begin with {_middle(ratios)} times the mismatch_rpm of their rows "
        "(output_speed_rpm less sliding_speed_rpm)"
    )
    if _all_near(ratios, 1.0 / RPM):
        looks = "mismatch_rpm in radians a second"
        return [Finding("mismatch", found, looks, "rad_s", certain=True)]
    if _all_near(ratios, RPM):
        looks = "the speeds of the traces in radians a second"
        return [Finding("speeds", found, looks, "rad_s", certain=True)]
    if _all_near(ratios, -1.0):
        looks = "a mismatch_rpm of sliding less output speed"
        return [Finding("mismatch", found, looks, "reversed", certain=True)]
    if _share_near(ratios, 1.0) >= 0.5:
        return []  # a few odd shifts
    return [Finding("mismatch", found, "another speed than the nominal one")]


def trace_time(stand: Stand, sheet: Sheet) -> list[Finding]:
    """Return traces whose time runs a hundred times as long as the shift."""
    timeout = stand.clutch.timeout
    ratios = _ratios(sheet, lambda row, t: float(t.time[-1]) / (row.time or timeout))
    ends = _ratios(sheet, lambda _, t: float(t.time[-1]))
    if not ratios.size or np.median(ratios) < 100.0 or np.median(ends) < timeout:
        return []
    found = f"t_s of the traces runs to {_middle(ratios)} times the time of the shift"
    looks = "milliseconds"
    return [Finding("trace_time", found, looks, "ms", certain=True, arguable=False)]


def displacement(stand: Stand, sheet: Sheet) -> list[Finding]:
    """Return a displacement that does not end near the travel of the sleeve."""
    travel = stand.clutch.dog.travel
    ratios = _ratios(
        sheet,
        lambda row, t: t.displacement.max() / travel if row.time and not ends_early(row) else None,
    )
    most = 1.8 if stand.sensor.displacement_at == "actuator" else 1.15
    if not ratios.size or 0.9 <= np.median(ratios) <= most:
        return []
    middle = float(np.median(ratios))
    found = (
        f"displacement_mm of finished shifts ends at {_middle(ratios * travel / MM)}, but the "
        f"sleeve's travel is {number(travel / MM)} mm"
    )
    looks, way, certain = _other_displacement(stand, middle)
    return [Finding("displacement", found, looks, way, certain)]


def _other_displacement(stand: Stand, middle: float) -> tuple[str, str | None, bool]:
    """Name the probable unit of a displacement of so many travels, its correction, certainty."""
    ratio = stand.sensor.linkage_ratio
    if 0.5e-3 < middle < 2e-3:
        return "metres", "m", True
    if ratio is not None and 0.8 * ratio < middle < 1.8 * ratio:
        return f"the robot arm's, {number(ratio)} times the sleeve's", "arm", True
    if middle > 2.0 and ratio is None:
        return "that of an actuator (give linkage_ratio in the table [sensor])", None, True
    if not 0.5 < middle < 2.0:
        return "another unit than millimetres", None, True
    return "a sensor with a wrong scale or a soft linkage", None, False


def trace_start(stand: Stand, sheet: Sheet) -> list[Finding]:
    """Return displacements that do not begin at zero."""
    travel = stand.clutch.dog.travel
    ratios = _ratios(sheet, lambda row, t: float(np.median(t.displacement[_start(t)])) / travel)
    if not ratios.size or abs(np.median(ratios)) < 0.1:
        return []
    found = f"displacement_mm of the traces begins at {_middle(ratios)} of the travel instead of 0"
    looks = "a sensor that is not set to zero, or traces that begin after the force"
    return [Finding("displacement", found, looks)]


def trace_force(stand: Stand, sheet: Sheet) -> list[Finding]:
    """Return a force in traces of another scale than that of the table."""
    ratios = _ratios(sheet, _last_force)
    factor = stand.sensor.force_factor
    if not ratios.size:
        return []
    found = f"force_N of the traces ends at {_middle(ratios)} of what force_N of the table makes it"
    if np.median(ratios) < 0.01:
        return [Finding("trace_force", found, "kilonewtons", "kN", certain=True)]
    if factor is not None and factor > 1.5 and _all_near(ratios, factor, 1.2):
        looks = "the force at the robot arm in the table"
        return [Finding("force", found, looks, "arm", certain=True)]
    settled = _ratios(
        sheet, lambda row, t: _last_force(row, t) if t.time[-1] > row.rise + SETTLED else None
    )
    if factor is not None and factor > 1.5 and _all_near(settled, 1.0 / factor, 1.2):
        looks = "the force at the robot arm in the traces"
        return [Finding("trace_force", found, looks, "arm")]
    if settled.size and not 0.5 < np.median(settled) < 1.5:
        return [Finding("trace_force", found, "a sensor with a wrong scale")]
    return []


def _last_force(row: Row, trace: BenchTrace) -> float | None:
    """Return the last force of a trace over the nominal one at that time, None without one."""
    try:
        nominal = ForceProfile(row.force, row.rise).at(float(trace.time[-1]))
    except InputError:
        return None
    return float(np.median(trace.force[-5:])) / nominal if nominal > 0.0 else None
