"""Slips that traces show beside the table of shifts: they say most of it again."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from dogshape.diagnosis.bench.finding import Finding
from dogshape.diagnosis.bench.force_start import (
    FIRST,
    find_force_start,
    scatter,
    smoothed,
)
from dogshape.diagnosis.bench.record import TimeZero
from dogshape.diagnosis.bench.stand_file import Stand
from dogshape.diagnosis.bench.table import Row, Sheet
from dogshape.diagnosis.bench.table_slips import ends_early
from dogshape.diagnosis.bench.traces import BenchTrace
from dogshape.sim.errors import InputError, number
from dogshape.sim.shift.actuation import ForceProfile
from dogshape.sim.units import MM, RPM

NEAR = 1.3  #: factor within which two readings of one quantity are taken as the same
SETTLED = 0.25  #: s after the rise from which any delay of the force is over
#: Explanations of times that begin before the force, by what the record says of their zero.
BEFORE_FORCE: dict[TimeZero, str] = {
    "unknown": "shift times that count from another instant than the force",
    "command": "a dead time between command and force",
    "force": "times that begin before the force, against record.time_zero = 'force'",
}
CLOSER = 0.5  #: share of the scatter about a constant below which that about a ratio explains more
CLOCK = 2e-3  #: s, least difference of two clocks that is said: the least margin of a diagnosis
REST_WAY = 0.02  #: of the axial gap, least displacement at rest that is said: the first flight mark
REST_FORCE = 0.02  #: of the nominal force, least force at rest that is said: a load cell's error
MOVED = 0.005  #: of the travel, least way of the first samples of a record that begins in motion
CLEAR = 5.0  #: scatters of a median that a value at rest exceeds, four times 1.25 standard errors

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


def _middle(ratios: Ratios | list[float]) -> str:
    return number(float(f"{np.median(ratios):.3g}"))


def _first_speed(trace: BenchTrace) -> float:
    """Return output less sliding speed at the start, 1/min."""
    return float(np.median(trace.relative_speed[: max(FIRST, trace.time.size // 32)])) / RPM


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


def trace_notes(stand: Stand, sheet: Sheet) -> list[Finding]:
    """Return traces with channels that were interpolated, cut, or have samples lost."""
    noted = [row.trace for row in sheet.rows if row.trace is not None and row.trace.notes]
    if not noted:
        return []
    more = f", and {len(noted) - 1} more traces alike" if len(noted) > 1 else ""
    found = f"{noted[0].path.name}: {'; '.join(noted[0].notes)}{more}"
    looks = "channels with start times or rates of their own, or with lost samples"
    return [Finding("traces", found, looks, arguable=False)]


def trace_time(stand: Stand, sheet: Sheet) -> list[Finding]:
    """Return traces whose travel takes a hundred times as long as the shift."""
    timeout = stand.clutch.timeout
    took = _ratios(sheet, _motion)
    ratios = _ratios(sheet, lambda row, t: _motion(row, t) / (row.time or timeout))
    if not ratios.size or np.median(ratios) < 100.0 or np.median(took) < timeout:
        return []
    found = f"by t_s the travel of the traces takes {_middle(ratios)} times the time of the shift"
    if np.median(ratios) > 3e4:
        looks = "another unit than seconds or milliseconds"
        return [Finding("trace_time", found, looks, certain=True, arguable=False)]
    return [Finding("trace_time", found, "milliseconds", "ms", certain=True, arguable=False)]


def _motion(row: Row, trace: BenchTrace) -> float:
    """Return the time from the start of the force to nine tenths of the trace's travel, s."""
    start = find_force_start(trace, row.rise)
    way = trace.displacement - _rest(row, trace)
    end = trace.time[int(np.argmax(smoothed(way) >= 0.9 * way.max()))]
    return float(end - (trace.time[0] if start is None else start.time))


def _rest(row: Row, trace: BenchTrace) -> float:
    """Return the displacement at rest, m; zero where the record begins after the force."""
    start = find_force_start(trace, row.rise)
    if _begins_in_motion(trace) or (start and start.time < trace.time[0]):
        return 0.0
    return start.displacement if start else float(np.median(trace.displacement[:FIRST]))


def _begins_in_motion(trace: BenchTrace) -> bool:
    """Test that the first samples move at a speed that is no start from rest."""
    way = smoothed(trace.displacement)
    first, second = way[FIRST - 1] - way[0], way[2 * FIRST - 1] - way[FIRST]
    seen = first > max(MOVED * np.ptp(way), CLEAR * scatter(trace.displacement))
    return bool(seen and first > 0.4 * second)  # from rest it is at most 0.3: way grows as t^2


def trace_clock(stand: Stand, sheet: Sheet) -> list[Finding]:
    """Return traces of another time zero or rate than the table has, or of another end."""
    traced = [(row, row.trace) for row in sheet.rows if row.trace is not None]
    if not traced:
        return []
    clocks = np.array([_clock(stand, row, trace) for row, trace in traced])
    took = np.array([row.time or np.nan for row, _ in traced])
    start, end, least = clocks.T
    late = end - took
    # Times of the table, and the travel at which a stand ends a shift, scatter as well.
    between = CLOCK + float(np.median(least))
    off = abs(start) > least
    over = (start >= np.where(np.isnan(took), stand.clutch.timeout, took)) | (end <= 0.0)
    if ratio := _rate(end, took, between):
        found = f"the travel of the traces ends at {ratio:.3g} times shift_time_s of their rows"
        looks = "a recorder whose sample rate is not that of t_s, or a table whose clock runs wrong"
        return [Finding("trace_time", f"{found} (median)", looks)]
    # A single start that the travel does not confirm is scatter of the fit.
    off &= (2 * off.sum() >= off.size) | (abs(late) > between) | over
    if off.any():
        found, looks, way = _other_zero(stand, start, late, off, between)
        return [Finding("trace_time", found, looks, way, bool((off & over).any()))]
    middle = _median(late)
    if np.isnan(start).all():
        found = "no rise of force_N stands out from its noise in the traces, so that t_s = 0 cannot"
        found += " be compared with the start of the force"
        found += f"; {_ends(middle)}" if abs(middle) > between else ""
        looks = "a sensor that is not connected or of the opposite sign, or a force that is there "
        looks += "from the first sample"
        return [Finding("trace_time", found, looks)]
    if abs(middle) > between > _median(abs(late - middle)) - 0.1 * abs(middle):
        looks = BEFORE_FORCE[stand.record.time_zero if middle < 0.0 else "unknown"]
        return [Finding("trace_time", _ends(middle), f"{looks}, or to another travel")]
    return []


def _rate(end: Ratios, took: Ratios, between: float) -> float | None:
    """Return the ratio of the traces' times to the table's, None where a constant parts them.

    ``end`` and ``took``, (traces,) in s; ``between`` is the least difference that is seen, s.
    """
    known = np.isfinite(end) & np.isfinite(took)
    end, took = end[known], took[known]
    ratio = _median(end / took)
    if abs(ratio - 1.0) * _median(took) <= between:
        return None
    late = end - took
    proportional, constant = abs(end - ratio * took), abs(late - _median(late))
    return ratio if _median(proportional) < CLOSER * _median(constant) else None


def _clock(stand: Stand, row: Row, trace: BenchTrace) -> tuple[float, float, float]:
    """Return start of the force and end of travel in a trace, and the least time that is seen, s.

    A start or an end that the trace does not show is not a number.
    """
    start = None if _begins_in_motion(trace) else find_force_start(trace, row.rise)
    travel = stand.clutch.shift_travel
    way = np.maximum.accumulate(smoothed(trace.displacement) - _rest(row, trace))
    end = float(np.interp(travel, way, trace.time)) if way[-1] >= travel else np.nan
    least = max(CLOCK, 3.0 * trace.step, 4.0 * (start.error if start else 0.0))
    return (start.time if start else np.nan), end, least


def _other_zero(
    stand: Stand, start: Ratios, late: Ratios, off: np.ndarray, least: float
) -> tuple[str, str, str | None]:
    """Describe traces with another time zero: what was found, probable cause, and correction.

    ``late`` is the end of travel in the traces less the time of their shifts, s.
    """
    low, high = (f"{one:.4f}" for one in (start[off].min(), start[off].max()))
    found = (
        f"the force of {off.sum()} of {off.size} traces does not begin at t_s = 0 but at "
        f"{low if low == high else f'{low} to {high}'} s"
    )
    looks, way = "the recorder's clock, or a record that begins before its trigger", "from_force"
    if np.isfinite(late[off]).any():
        found += f"; {_ends(_median(late[off]))}"
        if abs(_median(late[off])) <= least:
            looks = "a dead time or slow rise of the force, or a zero that table and traces share"
            looks = f"{looks}, which a diagnosis weighs"
            if stand.record.time_zero == "force":
                looks = BEFORE_FORCE["force"]
            return found, looks, None
        if abs(_median((late - start)[off])) > least:
            looks = "the recorder's clock, and shift times that count from another instant"
    if np.isnan(start).any():
        unseen = np.isnan(start).sum()
        return f"{found}; in {unseen} traces no rise of the force is seen at all", looks, None
    return found, looks, way


def _median(values: Ratios) -> float:
    """Return the median of the values that are numbers, zero where none is."""
    known = values[np.isfinite(values)]
    return float(np.median(known)) if known.size else 0.0


def _ends(late: float) -> str:
    size = f"{1e3 * abs(late):.1f} ms" if abs(late) < 1.0 else f"{abs(late):.4f} s"
    when = "after" if late > 0.0 else "before"
    return f"the travel of the traces ends {size} {when} shift_time_s of their rows (median)"


def displacement(stand: Stand, sheet: Sheet) -> list[Finding]:
    """Return a displacement that does not end near the travel of the sleeve."""
    travel = stand.clutch.dog.travel
    ratios = _ratios(
        sheet,
        lambda row, t: (
            (t.displacement.max() - _rest(row, t)) / travel
            if row.time and not ends_early(stand, row)
            else None
        ),
    )
    most = 1.8 if stand.record.displacement_at == "actuator" else 1.15
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
    start = find_force_start(trace, row.rise)
    try:
        profile = ForceProfile(row.force, row.rise)
    except InputError:
        return None
    nominal = profile.at(float(trace.time[-1]) - start.time) if start else 0.0
    return (
        (float(np.median(trace.force[-5:])) - start.force) / nominal if start and nominal else None
    )


def trace_rest(stand: Stand, sheet: Sheet) -> list[Finding]:
    """Return displacements and forces that are not zero before the force begins."""
    traced = [(row, row.trace) for row in sheet.rows if row.trace is not None]
    gap = stand.clutch.dog.axial_gap
    moving, way, force = 0, [], []
    for row, trace in traced:
        start = find_force_start(trace, row.rise)
        moving += _begins_in_motion(trace)
        least = max(REST_WAY * gap, CLEAR * scatter(trace.displacement) / np.sqrt(FIRST))
        if abs(rest := _rest(row, trace)) > least:
            way.append(rest / MM)
        least = max(REST_FORCE * row.force, CLEAR * scatter(trace.force) / np.sqrt(FIRST))
        if start and start.time >= trace.time[0] and abs(start.force) > least:
            force.append(start.force)
    if 2 * moving > max(1, len(traced)):
        found = f"the sleeve moves already at the first samples of {moving} of {len(traced)} traces"
        return [Finding("displacement", found, "records that begin after the force")]
    looks, when = "a sensor that is not set to zero", "(median) before the force begins"
    findings = []
    if way:
        found = f"displacement_mm of {len(way)} of {len(traced)} traces is {_middle(way)} mm {when}"
        findings.append(Finding("displacement", found, looks, "zeroed"))
    if 2 * len(force) > len(traced):
        found = f"force_N of {len(force)} of {len(traced)} traces is {_middle(force)} N {when}"
        findings.append(Finding("trace_force", found, looks, "zeroed"))
    return findings
