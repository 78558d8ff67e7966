r"""Slips of units and axes in bench data: recognised and asked about, never silently fitted.

Two kinds of rules find a slip. Physics: no shift ends before the sliding ring has flown freely
under the force, and no time exceeds the time-out. Redundancy: calibration, rise times and traces
repeat the table, and a ratio out of its range is another unit. Requested corrections are made
first; the rules see the corrected data. Data that cannot be true are refused, odd ones a warning.

Of times that a clock with the step :math:`s` takes, each single one has a rounding error with the
standard deviation :math:`s/\sqrt{12}`. A clock that rounds up makes all times late by :math:`s/2`
on average, one that rounds down early.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations
from math import gcd, log10

import numpy as np

from dogshape.diagnosis.bench.corrections import GIVEN, Correction, contradict, corrected
from dogshape.diagnosis.bench.stand_file import Stand, TimeZero
from dogshape.diagnosis.bench.table import NEAR, Row, Sheet, near_points
from dogshape.diagnosis.bench.traces import FIRST, BenchTrace, find_force_start, scatter, smoothed
from dogshape.diagnosis.terms import Array
from dogshape.sim.errors import DataError, InputError, number
from dogshape.sim.shift.actuation import ForceProfile
from dogshape.sim.units import MM, MS, RPM

SURE = 0.5  #: share of the free flight below which no force, mass or time zero off nominal reaches
ODD = 0.9  #: share below which a time is odd
CLOSE = 0.01  #: relative difference within which two values are the same one
SAME = 1.3  #: factor within which two readings of one quantity are taken as the same
MOST = 0.9  #: share of the traces that have to agree
SETTLED = 0.25  #: s after the rise from which any delay of the force is over
CLOSER = 0.5  #: share of the scatter about a constant below which that about a ratio explains more
CLOCK = 2e-3  #: s, least difference of two clocks that is said: the least margin of a diagnosis
REST = 0.02  #: of axial gap or nominal force, least reading at rest that is said
MOVED = 0.005  #: of the travel, least way of the first samples of a record that begins in motion
CLEAR = 5.0  #: scatters of a median that a value at rest exceeds, four times 1.25 standard errors
WRITTEN = 1e-3  #: s, resolution that times are written with where no clock is coarser
#: Least step in written resolutions: half of it is half the least margin of a diagnosis, 2 ms.
COARSE = 2
#: Decades of improbability from which common multiples are a clock: by chance once in 10^4.
DECADES = 4.0
OFF = 0.25  #: share of a stated step by which no rounded time misses a multiple
#: Columns whose size may show another unit: name, unit in words, correction, and the rule.
SCALED = {
    "time": ("shift_time_s", "milliseconds", "ms", "a shift that has a time ends after its free "
             "flight and before the time-out of {} s"),
    "rise": ("force_rise_s", "milliseconds", "ms", "so slow a force could not have ended shifts in "
             "their times"),
    "force": ("force_N", "kilonewtons", "kN", "so small a force could not have ended shifts in "
              "their times"),
}  # fmt: skip
#: Speeds of the traces over the table's: ratio, quantity, probable cause and correction.
OTHER_SPEEDS = (
    (1.0 / RPM, "mismatch", "mismatch_rpm in radians a second", "rad_s"),
    (RPM, "speeds", "the speeds of the traces in radians a second", "rad_s"),
    (-1.0, "mismatch", "a mismatch_rpm of sliding less output speed", "reversed"),
)
#: Explanations of times that begin before the force, by what the record says of their zero.
BEFORE_FORCE: dict[TimeZero, str] = {
    "unknown": "shift times that count from another instant than the force",
    "command": "a dead time between command and force",
    "force": "times that begin before the force, against record.time_zero = 'force'",
}


@dataclass(frozen=True)
class Finding:
    """Probable slip in bench data.

    ``found`` says what the data have and what speaks against it, ``looks_like`` what explains
    it. ``way`` is the correction of ``quantity`` that would make it right, None where there is
    none. A ``certain`` one cannot be true as it stands and is refused; ``arguable`` tells
    whether a user may say that it is right nevertheless. ``remedy`` is what to do where neither
    a correction nor the data set is.
    """

    quantity: str
    found: str
    looks_like: str
    way: str | None = None
    certain: bool = False
    arguable: bool = True
    remedy: str = ""

    @property
    def correction(self) -> str | None:
        """The correction as it is written, such as ``time=ms``."""
        return None if self.way is None else f"{self.quantity}={self.way}"

    @property
    def sentence(self) -> str:
        """Finding, probable cause and remedy in a sentence."""
        ways = [f"--correct {self.correction} takes it as that"] if self.way else []
        if self.arguable:
            ways.append(f"--correct {self.quantity}={GIVEN} takes it as it stands")
        return self.with_remedy(self.remedy or ", or ".join(["correct the data set", *ways]))

    def with_remedy(self, remedy: str) -> str:
        """Return finding, probable cause and a remedy in a sentence."""
        return f"{self.found}; this looks like {self.looks_like}; {remedy}"


Findings = Iterator[Finding]


def examine(stand: Stand, sheet: Sheet, asked: Sequence[Correction] = ()) -> tuple[Finding, ...]:
    """Find probable slips in a sheet whose corrections have been made.

    ``asked`` are these corrections; quantities that are to be taken as given, or that have
    been swapped already, are not questioned.
    """
    settled = [one for one in asked if one.way == GIVEN or one.quantity == "axes"]
    found: list[Finding] = []
    for check in CHECKS:
        for finding in list(check(stand, sheet)):
            taken = Correction(finding.quantity, finding.way or GIVEN)
            if taken in settled or any(contradict(taken, one) for one in settled):
                continue
            found.append(finding)
            if finding.certain:
                settled.append(taken)
                sheet = corrected(sheet, taken, stand.sensor) if finding.way else sheet
    return tuple(found)


def require_no_slip(where: str, findings: Sequence[Finding], remedy: str | None = None) -> None:
    """Raise DataError with all findings that are certain.

    ``where`` is the file, ``remedy`` what to do where nothing can be corrected on the way.
    """
    certain = [one.with_remedy(remedy) if remedy else one.sentence for one in findings
               if one.certain]  # fmt: skip
    if certain:
        raise DataError(f"{where}: " + ". Also: ".join(certain))


def impossible(stand: Stand, row: Row, asked: Sequence[Correction] = ()) -> str | None:
    """Give the rule that the time of a row breaks, None where it may be true."""
    limit = stand.clutch.timeout
    if row.time is not None and not 0.0 < row.time <= limit:
        return f"a time in s, above 0 and at most the time-out of {number(limit)} s"
    if not _too_early(stand, row) or Correction("time", GIVEN) in asked:
        return None
    return (
        f"a time in s not far below {number(_free_flight(stand, row))} s, which the free flight "
        "alone takes under this force (--correct time=given takes it as it stands)"
    )


def _free_flight(stand: Stand, row: Row) -> float:
    """Compute the time in s of the free flight over the shift's travel, inf without a force."""
    try:
        profile = ForceProfile(row.force, row.rise)
    except InputError:
        return np.inf
    return profile.free_flight_time(stand.clutch.shift_travel, stand.clutch.rings.mass)


def _too_early(stand: Stand, row: Row, share: float = SURE) -> bool:
    return row.time is not None and row.time < share * _free_flight(stand, row)


def _impossible_rows(stand: Stand, sheet: Sheet) -> int:
    """Count rows that no shift can have."""
    return sum(
        np.isinf(free := _free_flight(stand, row))
        or (row.time is not None and not max(0.0, SURE * free) <= row.time <= stand.clutch.timeout)
        for row in sheet.rows
    )


def _column(sheet: Sheet, name: str) -> Array:
    values = np.array([getattr(row, name) for row in sheet.rows], dtype=float)
    return np.sort(values[np.isfinite(values)])


def _span(values: Array) -> str:
    low, high = number(values[0]), number(values[-1])
    return f"is {low}" if values[0] == values[-1] else f"runs from {low} to {high}"


def _swapped(found: str) -> Finding:
    looks = "the columns mismatch_rpm and force_N swapped"
    return Finding("axes", found, looks, "swapped", certain=True)


def axes_by_rise(_: Stand, sheet: Sheet) -> Findings:
    """Find swapped axes where the rise time goes with the mismatch instead of the force."""
    rises: dict[str, dict[float, set[float]]] = {"force": {}, "mismatch": {}}
    for row in sheet.rows:
        for name, by in rises.items():
            by.setdefault(getattr(row, name), set()).add(row.rise)
    mixed, several = (sum(len(some) > 1 for some in by.values()) for by in rises.values())
    if mixed >= 2 and not several:
        yield _swapped(
            f"force_rise_s goes with mismatch_rpm: {mixed} of {len(rises['force'])} forces have "
            "several rise times, and each mismatch has one"
        )


def physical_ranges(stand: Stand, sheet: Sheet) -> Findings:
    """Find the fewest corrections that bring most rows within their physical bounds."""
    timed, limit = _column(sheet, "time").size, stand.clutch.timeout
    if 2 * _impossible_rows(stand, sheet) < max(1, timed):
        return  # single cells, which are refused one by one
    columns = {name: _column(sheet, name) for name in (*SCALED, "mismatch")}
    middle = {name: np.median(abs(known)) for name, known in columns.items() if known.size}
    offered = [name for name in SCALED if name in middle and
               (middle[name] < 100.0 if name == "force" else middle[name] > limit)]  # fmt: skip
    for chosen in (c for count in (1, 2, 3) for c in combinations(offered, count)):
        other = sheet
        for name in chosen:
            other = corrected(other, Correction(name, SCALED[name][2]), stand.sensor)
        if _impossible_rows(stand, other) <= 0.1 * len(sheet.rows):
            for name in chosen:
                column, unit, way, rule = SCALED[name]
                found = f"{column} {_span(columns[name])}, but {rule.format(number(limit))}"
                yield Finding(name, found, unit, way, certain=True, arguable=False)
            return
    turned = corrected(sheet, Correction("axes", "swapped"), stand.sensor)
    if middle["mismatch"] >= 2.0 * middle["force"] and not _impossible_rows(stand, turned):
        span = _span(columns["force"])
        yield _swapped(f"force_N {span}, which could not have ended shifts in their times")


def force_by_calibration(stand: Stand, sheet: Sheet) -> Findings:
    """Find forces that are the arm's of the calibration and not the sleeve's."""
    both = np.array([(c.arm_force, c.sleeve_force) for c in stand.calibration
                     if c.arm_force and c.sleeve_force])  # fmt: skip
    forces, factor = _column(sheet, "force"), stand.sensor.force_factor
    if not both.size:
        return

    def among(values: Array) -> list[bool]:
        apart = abs(values[:, None, None] / both - 1.0).min(axis=1)
        return list((apart < CLOSE).all(axis=0))

    if factor is not None and factor > 1.05 and among(forces / factor)[1]:
        times = f"{number(factor)} times sleeve_force_N of the table actuator_calibration"
        looks = "a force referred to the sleeve twice"
        yield Finding("force", f"force_N {_span(forces)}, {times}", looks, certain=True)
    elif among(forces) == [True, False]:
        found = (
            f"force_N {_span(forces)}, the values of arm_force_N in the table actuator_calibration "
            "and not those of sleeve_force_N"
        )
        yield _at_arm(stand, found, certain=True)


def _at_arm(stand: Stand, found: str, *, certain: bool) -> Finding:
    factor = stand.sensor.force_factor
    looks = "the force at the robot arm instead of that at the sleeve"
    looks += "" if factor is None else f", which is {number(factor)} times as large"
    return Finding("force", found, looks, None if factor is None else "arm", certain=certain)


def early_times(stand: Stand, sheet: Sheet) -> Findings:
    """Find times that are shorter than the free flight, though not impossibly so."""
    early = sum(_too_early(stand, row, ODD) for row in sheet.rows)
    timed, factor = _column(sheet, "time").size, stand.sensor.force_factor
    if early < max(1, 0.2 * timed):
        return
    found = f"{early} of {timed} times are shorter than the free flight under their force"
    if factor is not None and factor > 1.05:
        turned = corrected(sheet, Correction("force", "arm"), stand.sensor)
        if not any(_too_early(stand, row, ODD) for row in turned.rows):
            yield _at_arm(stand, found, certain=False)
            return
    looks = "a time that starts after the force, a larger force or a smaller mass than given"
    yield Finding("time", found, looks)


def repeated_rows(_: Stand, sheet: Sheet) -> Findings:
    """Find rows with a time that repeat earlier rows.

    Times of single shifts are rounded and may be equal by chance, so that of these half must be
    repeats; of means and of traces one is enough.
    """
    first: dict[object, int] = {}
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
    if copies:
        many = f"{len(copies)} rows repeat earlier ones"
        many = many if len(copies) > 1 else "a row is there twice"
        looks = (
            "a table that was copied below itself: copies make the data seem surer than they are"
        )
        said = f"{many}: row {copies[0][0]} is row {copies[0][1]} again"
        yield Finding("rows", said, looks, arguable=False)


def nearly_same_points(_: Stand, sheet: Sheet) -> Findings:
    """Find rows whose set values are nearly, but not just, those of others."""
    near = near_points(sheet.rows)
    if not near:
        return
    many = f"{len(near)} rows have" if len(near) > 1 else "a row has"
    one, other = (
        f"row {row.row} ({row.mismatch:.6g} 1/min, {row.force:.6g} N, {row.rise:.4g} s)"
        for row in (sheet.rows[place] for place in min(near.items()))
    )
    found = (
        f"{many} nearly the set values of others: {one} and {other} differ by at most {NEAR:.0%}"
    )
    looks = "measured in place of set values, each of which would be an operating point of its own"
    yield Finding("points", found, f"{looks}, with errors of its own", "joined", certain=True)


def found_step(sheet: Sheet) -> float:
    """Find the step in s of which the times of all single shifts are multiples, zero for none.

    Of n times written in 1 ms, all are multiples of k ms by chance with the probability k^-n.
    """
    times = [round(1e6 * row.time) for row in _single(sheet) if row.time is not None]
    many = gcd(*times) * 1e-6 / WRITTEN
    if many < COARSE or len(times) * log10(many) < DECADES:
        return 0.0
    return many * WRITTEN


def rows_off(sheet: Sheet, step: float) -> list[Row]:
    """List the single shifts whose time is no multiple of a step in s; none for a step of zero."""
    counts = [(row, (row.time or 0.0) / step if step else 0.0) for row in _single(sheet)]
    return [row for row, count in counts if abs(count - round(count)) > OFF]


def _single(sheet: Sheet) -> list[Row]:
    return [row for row in sheet.rows if row.n == 1 and row.time is not None]


def table_clock(stand: Stand, sheet: Sheet) -> Findings:
    """Find a step of the clock that nothing states, or a stated one that the times do not have."""
    single = _single(sheet)
    if stand.clock_step is None:
        if step := found_step(sheet):
            found = f"all {len(single)} times of single shifts are multiples of "
            looks = "the cycle of a controller, and counts as errors.clock_step_ms of bench.toml"
            remedy = "state that key, with 0 where the clock is finer"
            yield Finding("clock", f"{found}{number(step / MS)} ms", looks, remedy=remedy)
    elif off := rows_off(sheet, stand.clock_step):
        found = (
            f"errors.clock_step_ms is {number(stand.clock_step / MS)} ms, but {len(off)} of "
            f"{len(single)} times of single shifts are no multiples of it (row {off[0].row}: "
            f"{number(off[0].time or 0.0)} s)"
        )
        remedy = "state the step of the clock in milliseconds, 0 for none"
        looks = "another clock, or a step in another unit"
        yield Finding("clock", found, looks, certain=True, remedy=remedy)


def _traced(sheet: Sheet) -> list[tuple[Row, BenchTrace]]:
    return [(row, row.trace) for row in sheet.rows if row.trace is not None]


def _ratios(sheet: Sheet, ratio: Callable[[Row, BenchTrace], float | None]) -> Array:
    """Return a ratio for each trace that has one, (n,)."""
    values = [ratio(row, trace) for row, trace in _traced(sheet)]
    return np.array([value for value in values if value is not None], dtype=float)


def _share_near(ratios: Array, target: float, factor: float = SAME) -> float:
    """Return the share of ratios that lie within a factor of a target, of its sign."""
    apart = ratios / target
    return float(((apart > 1.0 / factor) & (apart < factor)).mean()) if ratios.size else 0.0


def _middle(ratios: Array | list[float]) -> str:
    return number(float(f"{np.median(ratios):.3g}"))


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
    flying = sum(one.displacement.max() < stand.clutch.dog.axial_gap for _, one in short)
    if flying:
        found += (
            f"; {flying} of {len(short)} end before the first touch and tell its beginning only, "
            "if they are of these shifts at all"
        )
    yield Finding("traces", found, "a recording that was stopped early", arguable=False)


def _ends_early(stand: Stand, row: Row, trace: BenchTrace) -> bool:
    """Test that a trace ends before its shift does, in time and in travel."""
    if row.time is None or trace.time[-1] >= row.time - 2.0 * trace.step:
        return False
    return bool(trace.displacement.max() < stand.clutch.shift_travel)


def trace_speeds(_: Stand, sheet: Sheet) -> Findings:
    """Find speeds in another unit, or of another sign, in table or traces."""

    def first(row: Row, trace: BenchTrace) -> float | None:
        samples = max(FIRST, trace.time.size // 32)
        speed = float(np.median(trace.relative_speed[:samples])) / RPM
        return speed / row.mismatch if row.mismatch else None

    ratios = _ratios(sheet, first)
    if not ratios.size or _share_near(ratios, 1.0) >= 0.5:
        return  # right but for a few odd shifts
    found = (
        f"the traces begin with {_middle(ratios)} times the mismatch_rpm of their rows "
        "(output_speed_rpm less sliding_speed_rpm)"
    )
    for target, quantity, looks, way in OTHER_SPEEDS:
        if _share_near(ratios, target) >= MOST:
            yield Finding(quantity, found, looks, way, certain=True)
            return
    yield Finding("mismatch", found, "another speed than the nominal one")


def trace_notes(_: Stand, sheet: Sheet) -> Findings:
    """Find traces with channels that were interpolated, cut, or have samples lost."""
    noted = [trace for _, trace in _traced(sheet) if trace.notes]
    if noted:
        more = f", and {len(noted) - 1} more traces alike" if len(noted) > 1 else ""
        found = f"{noted[0].path.name}: {'; '.join(noted[0].notes)}{more}"
        looks = "channels with start times or rates of their own, or with lost samples"
        yield Finding("traces", found, looks, arguable=False)


def trace_time(stand: Stand, sheet: Sheet) -> Findings:
    """Find traces whose travel takes a hundred times as long as the shift."""
    timeout = stand.clutch.timeout
    took = _ratios(sheet, _motion)
    ratios = _ratios(sheet, lambda row, t: _motion(row, t) / (row.time or timeout))
    if not ratios.size or np.median(ratios) < 100.0 or np.median(took) < timeout:
        return
    found = f"by t_s the travel of the traces takes {_middle(ratios)} times the time of the shift"
    looks, way = "milliseconds", "ms"
    if np.median(ratios) > 3e4:
        looks, way = "another unit than seconds or milliseconds", ""
    yield Finding("trace_time", found, looks, way or None, certain=True, arguable=False)


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


def trace_clock(stand: Stand, sheet: Sheet) -> Findings:
    """Find traces of another time zero or rate than the table has, or of another end."""
    traced = _traced(sheet)
    if not traced:
        return
    start, end, least = np.array([_clock(stand, row, trace) for row, trace in traced]).T
    took = np.array([row.time or np.nan for row, _ in traced])
    late = end - took
    # Times of the table, and the travel at which a stand ends a shift, scatter as well.
    between = CLOCK + float(np.median(least))
    over = (start >= np.where(np.isnan(took), stand.clutch.timeout, took)) | (end <= 0.0)
    if ratio := _rate(end, took, between):
        found = f"the travel of the traces ends at {ratio:.3g} times shift_time_s of their rows"
        looks = "a recorder whose sample rate is not that of t_s, or a table whose clock runs wrong"
        yield Finding("trace_time", f"{found} (median)", looks)
        return
    off = abs(start) > least
    # A single start that the travel does not confirm is scatter of the fit.
    off &= (2 * off.sum() >= off.size) | (abs(late) > between) | over
    middle = _median(late)
    if off.any():
        found, looks, way = _other_zero(stand, start, late, off, between)
        yield Finding("trace_time", found, looks, way, bool((off & over).any()))
    elif np.isnan(start).all():
        found = "no rise of force_N stands out from its noise in the traces, so that t_s = 0 cannot"
        found += " be compared with the start of the force"
        found += f"; {_ends(middle)}" if abs(middle) > between else ""
        looks = "a sensor that is not connected or of the opposite sign, or a force that is there "
        yield Finding("trace_time", found, looks + "from the first sample")
    elif abs(middle) > between > _median(abs(late - middle)) - 0.1 * abs(middle):
        looks = BEFORE_FORCE[stand.record.time_zero if middle < 0.0 else "unknown"]
        yield Finding("trace_time", _ends(middle), f"{looks}, or to another travel")


def _rate(end: Array, took: Array, between: float) -> float | None:
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
    stand: Stand, start: Array, late: Array, off: np.ndarray, least: float
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


def _ends(late: float) -> str:
    size = f"{1e3 * abs(late):.1f} ms" if abs(late) < 1.0 else f"{abs(late):.4f} s"
    when = "after" if late > 0.0 else "before"
    return f"the travel of the traces ends {size} {when} shift_time_s of their rows (median)"


def trace_displacement(stand: Stand, sheet: Sheet) -> Findings:
    """Find a displacement that does not end near the travel of the sleeve."""
    travel, ratio = stand.clutch.dog.travel, stand.sensor.linkage_ratio

    def share(row: Row, trace: BenchTrace) -> float | None:
        whole = row.time and not _ends_early(stand, row, trace)
        return (trace.displacement.max() - _rest(row, trace)) / travel if whole else None

    ratios = _ratios(sheet, share)
    most = 1.8 if stand.record.displacement_at == "actuator" else 1.15
    middle = float(np.median(ratios)) if ratios.size else 1.0
    if 0.9 <= middle <= most:
        return
    found = (
        f"displacement_mm of finished shifts ends at {_middle(ratios * travel / MM)}, but the "
        f"sleeve's travel is {number(travel / MM)} mm"
    )
    looks, way, certain = "a sensor with a wrong scale or a soft linkage", None, False
    if 0.5e-3 < middle < 2e-3:
        looks, way, certain = "metres", "m", True
    elif ratio is not None and 0.8 * ratio < middle < 1.8 * ratio:
        looks, way, certain = f"the robot arm's, {number(ratio)} times the sleeve's", "arm", True
    elif middle > 2.0 and ratio is None:
        looks = "that of an actuator (give linkage_ratio in the table [sensor])"
        certain = True
    elif not 0.5 < middle < 2.0:
        looks, certain = "another unit than millimetres", True
    yield Finding("displacement", found, looks, way, certain)


def trace_force(stand: Stand, sheet: Sheet) -> Findings:
    """Find a force in traces of another scale than that of the table."""
    ratios = _ratios(sheet, _last_force)
    settled = _ratios(
        sheet, lambda row, t: _last_force(row, t) if t.time[-1] > row.rise + SETTLED else None
    )
    if not ratios.size:
        return
    factor = stand.sensor.force_factor or 1.0
    found = f"force_N of the traces ends at {_middle(ratios)} of what force_N of the table makes it"
    if np.median(ratios) < 0.01:
        yield Finding("trace_force", found, "kilonewtons", "kN", certain=True)
    elif factor > 1.5 and _share_near(ratios, factor, 1.2) >= MOST:
        looks = "the force at the robot arm in the table"
        yield Finding("force", found, looks, "arm", certain=True)
    elif factor > 1.5 and _share_near(settled, 1.0 / factor, 1.2) >= MOST:
        yield Finding("trace_force", found, "the force at the robot arm in the traces", "arm")
    elif settled.size and not 0.5 < np.median(settled) < 1.5:
        yield Finding("trace_force", found, "a sensor with a wrong scale")


def _last_force(row: Row, trace: BenchTrace) -> float | None:
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


def trace_rest(stand: Stand, sheet: Sheet) -> Findings:
    """Find displacements and forces that are not zero before the force begins."""
    traced, gap = _traced(sheet), stand.clutch.dog.axial_gap
    moving, way, force = 0, [], []
    for row, trace in traced:
        start = find_force_start(trace, row.rise)
        moving += _begins_in_motion(trace)
        least = max(REST * gap, CLEAR * scatter(trace.displacement) / np.sqrt(FIRST))
        if abs(rest := _rest(row, trace)) > least:
            way.append(rest / MM)
        least = max(REST * row.force, CLEAR * scatter(trace.force) / np.sqrt(FIRST))
        if start and start.time >= trace.time[0] and abs(start.force) > least:
            force.append(start.force)
    if 2 * moving > max(1, len(traced)):
        found = f"the sleeve moves already at the first samples of {moving} of {len(traced)} traces"
        yield Finding("displacement", found, "records that begin after the force")
        return
    looks, when = "a sensor that is not set to zero", "(median) before the force begins"
    if way:
        found = f"displacement_mm of {len(way)} of {len(traced)} traces is {_middle(way)} mm {when}"
        yield Finding("displacement", found, looks, "zeroed")
    if 2 * len(force) > len(traced):
        found = f"force_N of {len(force)} of {len(traced)} traces is {_middle(force)} N {when}"
        yield Finding("trace_force", found, looks, "zeroed")


#: In this order: a check may rely on those before it.
CHECKS: tuple[Callable[[Stand, Sheet], Findings], ...] = (
    axes_by_rise, physical_ranges, force_by_calibration, early_times, trace_notes, trace_time,
    trace_clock, trace_displacement, trace_speeds, trace_force, trace_rest, repeated_rows,
    nearly_same_points, short_traces, table_clock,
)  # fmt: skip
