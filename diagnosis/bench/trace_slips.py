"""Slips that traces show beside the table of shifts: they say most of it again.

A ratio of traces to table out of its range is another unit, which a correction brings back into the
range; times and readings at rest show another zero.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from dogshape.diagnosis.bench.corrections import Finding, Findings, corrected
from dogshape.diagnosis.bench.stand_file import Stand
from dogshape.diagnosis.bench.table import Row, Sheet
from dogshape.diagnosis.bench.traces import FIRST, BenchTrace, find_force_start, scatter, smoothed
from dogshape.diagnosis.terms import Array
from dogshape.sim.errors import InputError, number
from dogshape.sim.shift.actuation import ForceProfile
from dogshape.sim.units import MM, MS, RPM

SAME = 1.3  #: factor within which two readings of one quantity are taken as the same
SETTLED = 0.25  #: s after the rise from which any delay of the force is over
CLOCK = 2e-3  #: s, least difference of two clocks that is said: the least margin of a diagnosis
REST = 0.02  #: of axial gap or nominal force, least reading at rest that is said
MOVED = 0.005  #: of the travel, least way of the first samples of a record that begins in motion
CLEAR = 5.0  #: scatters of a median that a value at rest exceeds, four times 1.25 standard errors
ANOTHER = "shift times that count from another instant than the force"
COMMAND = "a dead time between command and force"
DEAD = (
    "a dead time or slow rise of the force, or a zero that table and traces share, which a "
    "diagnosis weighs"
)


def _traced(sheet: Sheet) -> list[tuple[Row, BenchTrace]]:
    return [(row, row.trace) for row in sheet.rows if row.trace is not None]


def _short(values: float | list[float]) -> str:
    return number(float(f"{np.median(values):.3g}"))


def _median(values: Array) -> float:
    """Return the median of the values that are numbers, zero where none is."""
    known = values[np.isfinite(values)]
    return float(np.median(known)) if known.size else 0.0


def short_traces(stand: Stand, sheet: Sheet) -> Findings:
    """Find traces that end before their shift, and say how many end before the first touch."""
    short = [(row, trace) for row, trace in _traced(sheet) if _ends_early(stand, row, trace)]
    if not short:
        return
    row, trace = short[0]
    many = f"{len(short)} traces end" if len(short) > 1 else "a trace ends"
    found = (
        f"{many} before the shift is over: that of row {row.row} by "
        f"{((row.time or 0.0) - trace.time[-1]) / MS:.3g} ms, so that it is used up to there"
    )
    if flying := sum(one.displacement.max() < stand.clutch.dog.axial_gap for _, one in short):
        found += (
            f"; {flying} of {len(short)} end before the first touch and tell its beginning only, "
            "if they are of these shifts at all"
        )
    yield Finding("traces", found, "a recording that was stopped early", arguable=False)


def _ends_early(stand: Stand, row: Row, trace: BenchTrace) -> bool:
    if row.time is None or trace.time[-1] >= row.time - 2.0 * trace.step:
        return False
    return bool(trace.displacement.max() < stand.clutch.shift_travel)


def trace_notes(_: Stand, sheet: Sheet) -> Findings:
    """Find traces with channels that were interpolated, cut, or have samples lost."""
    if noted := [trace for _, trace in _traced(sheet) if trace.notes]:
        more = f", and {len(noted) - 1} more traces alike" if len(noted) > 1 else ""
        found = f"{noted[0].path.name}: {'; '.join(noted[0].notes)}{more}"
        looks = "channels with start times or rates of their own, or with lost samples"
        yield Finding("traces", found, looks, arguable=False)


def _begins_in_motion(trace: BenchTrace) -> bool:
    way = smoothed(trace.displacement)
    first, second = way[FIRST - 1] - way[0], way[2 * FIRST - 1] - way[FIRST]
    seen = first > max(MOVED * np.ptp(way), CLEAR * scatter(trace.displacement))
    return bool(seen and first > 0.4 * second)  # from rest it is at most 0.3: way grows as t^2


def _rest(row: Row, trace: BenchTrace) -> float:
    """Return the displacement at rest, m; zero where the record begins after the force."""
    start = find_force_start(trace, row.rise)
    if _begins_in_motion(trace) or (start and start.time < trace.time[0]):
        return 0.0
    return start.displacement if start else float(np.median(trace.displacement[:FIRST]))


def trace_clock(stand: Stand, sheet: Sheet) -> Findings:
    """Find traces of another time zero than the table has, or of another end."""
    traced = _traced(sheet)
    if not traced:
        return
    start, end, least = np.array([_clock(stand, row, trace) for row, trace in traced]).T
    took = np.array([row.time or np.nan for row, _ in traced])
    late = end - took
    # Times of the table, and the travel at which a stand ends a shift, scatter as well.
    between, middle = CLOCK + float(np.median(least)), _median(late)
    over = (start >= np.where(np.isnan(took), stand.clutch.timeout, took)) | (end <= 0.0)
    off = abs(start) > least
    # A single start that the travel does not confirm is scatter of the fit.
    off &= (2 * off.sum() >= off.size) | (abs(late) > between) | over
    if off.any():
        ends = sorted({f"{one:.4f}" for one in (start[off].min(), start[off].max())}, key=float)
        found = (
            f"the force of {off.sum()} of {off.size} traces does not begin at t_s = 0 but at "
            f"{' to '.join(ends)} s"
        )
        looks, way = "the recorder's clock, or a record that begins before its trigger", ""
        seen = np.isfinite(late[off]).any()
        found += f"; {_ends(_median(late[off]))}" if seen else ""
        if seen and abs(_median(late[off])) <= between:
            looks = ANOTHER if stand.record.time_zero == "force" else DEAD
        elif np.isnan(start).any():
            found += f"; in {np.isnan(start).sum()} traces no rise of the force is seen at all"
        else:
            way = "from_force"
        yield Finding("trace_time", found, looks, way or None, bool((off & over).any()))
    elif np.isnan(start).all():
        found = "no rise of force_N stands out from its noise in the traces, so that t_s = 0 cannot"
        found += " be compared with the start of the force"
        found += f"; {_ends(middle)}" if abs(middle) > between else ""
        looks = "a sensor that is not connected or of the opposite sign, or a force that is there "
        yield Finding("trace_time", found, looks + "from the first sample")
    elif abs(middle) > between > _median(abs(late - middle)) - 0.1 * abs(middle):
        looks = COMMAND if stand.record.time_zero == "command" and middle < 0.0 else ANOTHER
        yield Finding("trace_time", _ends(middle), f"{looks}, or to another travel")


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


def _ends(late: float) -> str:
    size = f"{1e3 * abs(late):.1f} ms" if abs(late) < 1.0 else f"{abs(late):.4f} s"
    when = "after" if late > 0.0 else "before"
    return f"the travel of the traces ends {size} {when} shift_time_s of their rows (median)"


def _speed(_: Stand, row: Row, trace: BenchTrace) -> float | None:
    speed = float(np.median(trace.relative_speed[: max(FIRST, trace.time.size // 32)])) / RPM
    return speed / row.mismatch if row.mismatch else None


def _travel(stand: Stand, row: Row, trace: BenchTrace) -> float | None:
    whole = row.time and not _ends_early(stand, row, trace)
    most = trace.displacement.max() - _rest(row, trace)
    return float(most / stand.clutch.dog.travel) if whole else None


def _duration(stand: Stand, row: Row, trace: BenchTrace) -> float:
    """Return nine tenths of the travel's time over the shift's, where it is beyond the time-out."""
    start, timeout = find_force_start(trace, row.rise), stand.clutch.timeout
    way = trace.displacement - _rest(row, trace)
    end = trace.time[int(np.argmax(smoothed(way) >= 0.9 * way.max()))]
    took = float(end - (trace.time[0] if start is None else start.time))
    return took / (row.time or timeout) if took >= timeout else 1.0


def _last_force(_: Stand, row: Row, trace: BenchTrace) -> float | None:
    """Return the last force of a trace over the nominal one at that time, None without one."""
    start = find_force_start(trace, row.rise)
    try:
        profile = ForceProfile(row.force, row.rise)
    except InputError:
        return None
    nominal = profile.at(float(trace.time[-1]) - start.time) if start else 0.0
    if not start or not nominal:
        return None
    return (float(np.median(trace.force[-5:])) - start.force) / nominal


def _settled_force(stand: Stand, row: Row, trace: BenchTrace) -> float | None:
    return _last_force(stand, row, trace) if trace.time[-1] > row.rise + SETTLED else None


@dataclass(frozen=True)
class Range:
    """Range of a ratio of traces to their rows.

    ``found`` is a sentence with the ratio as {0}, travel and ratio in mm as {1} and {2}. Of
    ``ways`` (quantity, correction, unit in words) the first that brings the median ratio into the
    range is the slip, which is refused. Without one the cause is ``other``, which is refused beyond
    ``possible``.
    """

    quantity: str
    measure: Callable[[Stand, Row, BenchTrace], float | None]
    low: float
    high: float
    found: str
    ways: tuple[tuple[str, str, str], ...]
    other: str
    possible: tuple[float, float] = (-np.inf, np.inf)
    arguable: bool = True

    def median(self, stand: Stand, sheet: Sheet) -> float:
        """Compute the median ratio of the traces that have one, 1 without any."""
        ratios = [self.measure(stand, row, trace) for row, trace in _traced(sheet)]
        known = [ratio for ratio in ratios if ratio is not None]
        return float(np.median(known)) if known else 1.0

    def check(self, stand: Stand, sheet: Sheet) -> Findings:
        """Find a ratio out of the range."""
        middle, travel = self.median(stand, sheet), stand.clutch.dog.travel / MM
        if self.low <= middle <= self.high:
            return
        found = self.found.format(_short(middle), number(travel), _short(middle * travel))
        for quantity, way, looks in self.ways:
            try:
                other = corrected(sheet, f"{quantity}={way}", stand.sensor)
            except InputError:  # the stand does not say by how much
                continue
            if self.low <= self.median(stand, other) <= self.high:
                text = looks.format(number(stand.sensor.linkage_ratio or 0.0))
                yield Finding(quantity, found, text, way, True, self.arguable)
                return
        certain = not self.possible[0] < middle < self.possible[1]
        yield Finding(self.quantity, found, self.other, None, certain, self.arguable)


DURATION = Range(
    "trace_time", _duration, 0.0, 100.0,
    "by t_s the travel of the traces takes {0} times the time of the shift",
    (("trace_time", "ms", "milliseconds"),),
    "another unit than seconds or milliseconds", possible=(0.0, 100.0), arguable=False,
)  # fmt: skip
#: Behind a soft linkage a sensor at the actuator reads more way than the sleeve makes.
TRAVEL = Range(
    "displacement", _travel, 0.9, 1.15,
    "displacement_mm of finished shifts ends at {2}, but the sleeve's travel is {1} mm",
    (("displacement", "m", "metres"),
     ("displacement", "arm", "the robot arm's, {} times the sleeve's")),
    "a sensor with a wrong scale or a soft linkage, or an actuator's (give linkage_ratio in the "
    "table [sensor])", possible=(0.5, 2.0),
)  # fmt: skip
SPEED = Range(
    "mismatch", _speed, 1.0 / SAME, SAME,
    "the traces begin with {0} times the mismatch_rpm of their rows "
    "(output_speed_rpm less sliding_speed_rpm)",
    (("mismatch", "rad_s", "mismatch_rpm in radians a second"),
     ("speeds", "rad_s", "the speeds of the traces in radians a second"),
     ("mismatch", "reversed", "a mismatch_rpm of sliding less output speed")),
    "another speed than the nominal one",
)  # fmt: skip
FORCE = Range(
    "trace_force", _last_force, 0.01, np.inf,
    "force_N of the traces ends at {0} of what force_N of the table makes it",
    (("trace_force", "kN", "kilonewtons"),), "a sensor with a wrong scale",
)  # fmt: skip
SETTLED_FORCE = replace(
    FORCE, measure=_settled_force, low=0.5, high=1.5,
    ways=(("force", "arm", "the force at the robot arm in the table"),
          ("trace_force", "arm", "the force at the robot arm in the traces")),
)  # fmt: skip


def trace_travel(stand: Stand, sheet: Sheet) -> Findings:
    """Find a displacement that does not end near the travel of the sleeve."""
    soft = stand.record.displacement_at == "actuator"
    return replace(TRAVEL, high=1.8 if soft else TRAVEL.high).check(stand, sheet)


def trace_rest(stand: Stand, sheet: Sheet) -> Findings:
    """Find displacements and forces that are not zero before the force begins."""
    traced, way, force = _traced(sheet), [], []
    for row, trace in traced:
        start, rest = find_force_start(trace, row.rise), _rest(row, trace)
        noise = CLEAR / np.sqrt(FIRST)
        if abs(rest) > max(REST * stand.clutch.dog.axial_gap, noise * scatter(trace.displacement)):
            way.append(rest / MM)
        if start and start.time >= trace.time[0]:
            least = max(REST * row.force, noise * scatter(trace.force))
            force += [start.force] if abs(start.force) > least else []
    moving = sum(_begins_in_motion(trace) for _, trace in traced)
    if 2 * moving > max(1, len(traced)):
        found = f"the sleeve moves already at the first samples of {moving} of {len(traced)} traces"
        yield Finding("displacement", found, "records that begin after the force")
        return
    looks, when = "a sensor that is not set to zero", "(median) before the force begins"
    if way:
        found = f"displacement_mm of {len(way)} of {len(traced)} traces is {_short(way)} mm {when}"
        yield Finding("displacement", found, looks, "zeroed")
    if 2 * len(force) > len(traced):
        found = f"force_N of {len(force)} of {len(traced)} traces is {_short(force)} N {when}"
        yield Finding("trace_force", found, looks, "zeroed")
