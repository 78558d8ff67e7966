"""Slips of a bench that its traces reveal: they measure most of the table again.

A ratio of traces to table out of its range is another unit, which a correction brings back into the
range; times and readings at rest show another zero.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from dogshape.bench.corrections import Finding, Findings, corrected
from dogshape.bench.force_start import FIRST, ForceStart, displacement_at_rest, find_force_start
from dogshape.bench.samples import scatter, smoothed, step_of
from dogshape.bench.stand_file import Stand
from dogshape.bench.table import Row, Sheet
from dogshape.bench.traces import FORCE_CHANNEL, LEAD, BenchTrace
from dogshape.sim.elementwise import Array
from dogshape.sim.errors import InputError, number
from dogshape.sim.shift.actuation import ForceProfile
from dogshape.sim.units import MM, MS, RPM, from_si, short, unit_of

SAME = 1.3  #: factor within which two readings of one quantity are taken as the same
KILO = 0.01  #: ratio of forces below which those of traces are kilonewtons
SETTLED = 0.25  #: s after the rise from which any delay of the force is over
CLOCK = 2e-3  #: s, least difference of two clocks that is said: the least margin of a diagnosis
REST = 0.02  #: of axial gap or nominal force, least reading at rest that is said
MOVED = 0.005  #: of the travel, least way of the first samples of a record that begins in motion
CLEAR = 5.0  #: scatters of a median that a value at rest exceeds, four times 1.25 standard errors
FALLING = 0.5  #: of the fall, rise of a channel above which it does not only fall
LOW_LEVEL, HIGH_LEVEL = 0.5, 1.5  #: range of a logged channel's end over its set value
LEAST_LEVEL = 0.1  #: below which, or beyond whose inverse, it is another unit
MIN_SAMPLES_PER_SHIFT = 20  #: samples that marks of a flight need within a shift, judged
LOCKED = 0.05  #: share by which the last speeds of a shift differ from one unit to the other
MAX_SPEED = 1.5  #: times the speed from the work of the force: for a force of twice the nominal
ANOTHER = "shift times that count from another instant than the force"
DEAD = (
    "a dead time or slow rise of the force, or a zero that table and traces share, which a "
    "diagnosis weighs"
)


@dataclass(frozen=True)
class TracedRow:
    """Row of a table with its trace, and quantities derived from both."""

    stand: Stand
    row: Row
    trace: BenchTrace

    @cached_property
    def start(self) -> ForceStart | None:
        """Start of the force, None where none stands out."""
        return find_force_start(self.trace, self.row.rise)

    @cached_property
    def moving(self) -> bool:
        """Whether the record begins in motion; from rest the way grows as t^2."""
        way = smoothed(self.trace.displacement)
        first, second = way[FIRST - 1] - way[0], way[2 * FIRST - 1] - way[FIRST]
        seen = first > max(MOVED * np.ptp(way), CLEAR * scatter(self.trace.displacement))
        return bool(seen and first > 0.4 * second)  # from rest it is at most 0.3

    @cached_property
    def rest(self) -> float:
        """Displacement at rest, m; zero where the record begins after the force."""
        if self.moving or (self.start and self.start.time < self.trace.time[0]):
            return 0.0
        return displacement_at_rest(self.trace, self.row.rise)

    @property
    def profile(self) -> ForceProfile | None:
        """Nominal force of the row; None where its values make none."""
        try:
            return ForceProfile(self.row.force, self.row.rise)
        except InputError:
            return None

    @property
    def full_level(self) -> float:
        """Final value of the channel that rises first: N, or the SI unit of a logged channel."""
        logged = self.trace.logged
        return self.row.force if logged is None else logged.actuator.logged_level(self.row.force)

    @property
    def short(self) -> bool:
        """Whether the trace ends before its shift."""
        trace, time = self.trace, self.row.time
        early = time is not None and trace.time[-1] < time - 2.0 * step_of(trace.time)
        return bool(early and trace.displacement.max() < self.stand.clutch.shift_travel)


def traced(stand: Stand, sheet: Sheet) -> list[TracedRow]:
    """List the rows that have a trace."""
    return [TracedRow(stand, row, row.trace) for row in sheet.rows if row.trace is not None]


def speed_ratio(one: TracedRow) -> float:
    """Compute the ratio of the relative speed at the beginning to the mismatch of the row.

    It is negative for opposite senses; NaN without a mismatch.
    """
    slip = one.trace.output_speed - one.trace.sliding_speed
    first = float(np.median(slip[: max(FIRST, slip.size // 32)]))
    return first / RPM / (one.row.mismatch or np.nan)


def travel_ratio(one: TracedRow) -> float:
    """Compute the largest displacement of a whole shift over the travel of the sleeve.

    It counts from rest; NaN for a shift without a time and a trace that ends early.
    """
    most = one.trace.displacement.max() - one.rest
    return float(most / one.stand.clutch.dog.travel) if one.row.time and not one.short else np.nan


def time_ratio(one: TracedRow) -> float:
    """Compute the ratio of travel time to shift time, for travel times beyond the time-out."""
    way, timeout = one.trace.displacement - one.rest, one.stand.clutch.timeout
    end = one.trace.time[int(np.argmax(smoothed(way) >= 0.9 * way.max()))]
    took = float(end - (one.start.time if one.start else one.trace.time[0]))
    return took / (one.row.time or timeout) if took >= timeout else 1.0


def force_ratio(one: TracedRow) -> float:
    """Compute the last force over the nominal one at that time, once any delay is over.

    A ratio below ``KILO`` counts at any time: no delay makes it so small. NaN for an actuator,
    whose force follows the motion.
    """
    profile = one.profile
    if profile is None or one.stand.clutch.actuator is not None:
        return np.nan
    if not one.start or not (nominal := profile.at(float(one.trace.time[-1]) - one.start.time)):
        return np.nan
    ratio = (float(np.median(one.trace.force[-5:])) - one.start.force) / nominal
    return ratio if ratio < KILO or one.trace.time[-1] > one.row.rise + SETTLED else np.nan


def median(values: ArrayLike, without: float = 0.0) -> float:
    """Compute the median of the values that are no NaN; ``without`` any, that value."""
    known = np.asarray(values)[np.isfinite(values)]
    return float(np.median(known)) if known.size else without


def trace_notes(stand: Stand, sheet: Sheet) -> Findings:
    """Find traces with channels that were interpolated or cut, samples lost, or an early end."""
    noted = []
    for one in traced(stand, sheet):
        notes, trace = list(one.trace.notes), one.trace
        if one.short:
            early = short(((one.row.time or 0.0) - trace.time[-1]) / MS, 3)
            flying = trace.displacement.max() < stand.clutch.dog.axial_gap
            before = " and before the first touch, if it is of this shift at all" if flying else ""
            notes.append(f"ends {early} ms before the shift of row {one.row.row} is over{before}")
        noted += [f"{trace.path.name}: {'; '.join(notes)}"] if notes else []
    if noted:
        looks = (
            "a recording that was stopped early, samples that were lost, or channels with times of "
            "their own"
        )
        yield Finding("traces", _of_traces(noted), looks, arguable=False)


def recording_faults(stand: Stand, sheet: Sheet) -> Findings:
    """Find faults of a recording that reading a trace showed, a finding for each cause."""
    by_cause: dict[str, list[str]] = {}
    for traced_row in traced(stand, sheet):
        for text, cause in traced_row.trace.faults:
            by_cause.setdefault(cause, []).append(f"{traced_row.trace.path.name}: {text}")
    for cause, texts in by_cause.items():
        yield Finding("traces", _of_traces(texts), cause, arguable=False)


def _of_traces(texts: Sequence[str]) -> str:
    """Give the first of the sentences on traces, and the number of the others."""
    remainder = f", and {len(texts) - 1} more alike" if len(texts) > 1 else ""
    return f"{texts[0]}{remainder}"


def trace_signs(stand: Stand, sheet: Sheet) -> Findings:
    """Find forces and displacements that fall where a shift makes them rise."""
    rows = traced(stand, sheet)
    for quantity, name, unit, scale in (
        ("trace_force", "force", "N", 1.0),
        ("displacement", "displacement", "mm", MM),
    ):
        ends = [end for row in rows if (end := _fall(getattr(row.trace, name)))]
        if quantity == "trace_force" and stand.clutch.actuator is not None:
            continue  # a spring's falls, and a logged channel makes no negative one
        if 2 * len(ends) <= len(rows):
            continue
        first, last = (number(float(f"{value / scale:.3g}")) for value in ends[0])
        text = (
            f"{name}_{unit} falls in {len(ends)} of {len(rows)} traces, from {first} to {last} "
            f"{unit} in the first, but it rises in a shift"
        )
        cause = "a sensor of the opposite sign"
        yield Finding(quantity, text, cause, f"{quantity}=turned", certain=True)


def trace_level(stand: Stand, sheet: Sheet) -> Findings:
    """Find logged channels that end far from what the set value makes them.

    A ratio above ``HIGH_LEVEL`` counts at any time: no valve gives more than its supply.
    """
    ratios = []
    key = ""
    for row in traced(stand, sheet):
        logged = row.trace.logged
        if logged is None or not row.start:
            continue
        key = logged.key
        level = float(np.median(logged.values[-5:])) - row.start.force
        ratio = level / row.full_level
        if ratio > HIGH_LEVEL or row.trace.time[-1] > SETTLED + row.start.time:
            ratios.append(ratio)
    ratio = median(ratios, 1.0)
    if LOW_LEVEL <= ratio <= HIGH_LEVEL:
        return
    text = f"{key} of the traces ends at {short(ratio, 3)} times the value that the table sets"
    looks = "another unit, a sensor with a wrong scale, or a supply that the valve does not reach"
    certain = not LEAST_LEVEL < ratio < 1.0 / LEAST_LEVEL
    yield Finding("trace_force", text, looks, certain=certain)


def _fall(values: Array) -> tuple[float, float] | None:
    """Return first and lowest reading of a channel that falls further than it rises, or None."""
    smooth = smoothed(values)
    rest_level = float(np.median(values[:FIRST]))
    fall, rise = rest_level - float(smooth.min()), float(smooth.max()) - rest_level
    noise = CLEAR * scatter(values)
    falls = fall > noise and rise < max(noise, FALLING * fall)
    return (rest_level, rest_level - fall) if falls else None


def trace_lock(stand: Stand, sheet: Sheet) -> Findings:
    """Find speeds in two units: rings that are engaged turn at one speed.

    A record that ends before the flanks have met shows nothing.
    """
    ends = [
        (np.median(row.trace.sliding_speed[-FIRST:]), np.median(row.trace.output_speed[-FIRST:]))
        for row in traced(stand, sheet)
        if row.row.time is not None and not row.short
    ]
    ratio = median([sliding / output for sliding, output in ends if output], 1.0)
    for name, expected, correction in (
        ("sliding_speed_rpm", RPM, "speeds=sliding_rad_s"),
        ("output_speed_rpm", 1.0 / RPM, "speeds=output_rad_s"),
    ):
        if abs(ratio / expected - 1.0) > LOCKED:
            continue
        text = (
            f"sliding_speed_rpm of finished shifts ends at {short(ratio, 3)} times "
            "output_speed_rpm, but engaged rings turn at one speed"
        )
        cause = f"{name} in radians a second beside the other in 1/min"
        yield Finding("speeds", text, cause, correction, certain=True)


def trace_rate(stand: Stand, sheet: Sheet) -> Findings:
    """Find channels with too few samples in the time of their shift."""
    slow = []
    for row in traced(stand, sheet):
        if row.row.time is None:
            continue
        needed = row.row.time / MIN_SAMPLES_PER_SHIFT
        steps = {LEAD: step_of(row.trace.time), **row.trace.steps}
        slow += [
            f"{row.trace.path.name}: {name} is sampled every {short(step / MS, 3)} ms, but the "
            f"shift of {short(row.row.time / MS, 3)} ms needs a sample every "
            f"{short(needed / MS, 3)} ms or more often"
            for name, step in steps.items()
            if step > needed
        ]
    if slow:
        cause = "a recorder too slow for the marks of the flight"
        yield Finding("traces", _of_traces(slow), cause, arguable=False)


def trace_jumps(stand: Stand, sheet: Sheet) -> Findings:
    r"""Find displacements that jump further than the sleeve can go within a sample step.

    By the work of the force the sleeve has at most the speed :math:`\sqrt{2 F s/m}` after the way
    s, with the largest force F up to then, measured or nominal.
    """
    jumps = []
    for row in traced(stand, sheet):
        trace, mass = row.trace, stand.clutch.rings.mass
        profile = row.profile
        if profile is None:
            continue
        way, noise = smoothed(trace.displacement), CLEAR * scatter(trace.displacement)
        nominal = profile.at(trace.time)
        force = np.maximum.accumulate(np.maximum(smoothed(trace.force), nominal))
        work = np.maximum(force, 0.0) * (abs(np.maximum.accumulate(way) - way[0]) + noise)
        speed = np.sqrt(2.0 * work / mass)
        longest = MAX_SPEED * speed[1:] * np.diff(trace.time) + noise
        places = np.flatnonzero(abs(np.diff(way)) > longest)
        if places.size:
            start, end = way[places[0] : places[0] + 2] / MM
            jumps.append(
                f"{trace.path.name}: displacement_mm jumps from {short(start, 3)} to "
                f"{short(end, 3)} mm at {number(trace.time[places[0] + 1])} s, further than the "
                "force can move the sleeve in one sample step"
            )
    if jumps:
        cause = "lost counts, a loose contact or samples that are missing"
        yield Finding("displacement", _of_traces(jumps), cause)


def trace_clock(stand: Stand, sheet: Sheet) -> Findings:
    """Find traces of another time zero than the table has, or of another end."""
    if not (rows := traced(stand, sheet)):
        return
    start, end, visible = np.array([_clock(row) for row in rows]).T
    took = np.array([row.row.time or np.nan for row in rows])
    delay = end - took
    # Times of the table, and the travel at which a stand ends a shift, scatter as well.
    tolerance, middle = CLOCK + float(np.median(visible)), median(delay)
    is_late = (start >= np.where(np.isnan(took), stand.clutch.timeout, took)) | (end <= 0.0)
    off = abs(start) > visible
    # A single start that the travel does not confirm is scatter of the fit.
    off &= (2 * off.sum() >= off.size) | (abs(delay) > tolerance) | is_late
    if off.any():
        ends = sorted({f"{time:.4f}" for time in (start[off].min(), start[off].max())}, key=float)
        text = (
            f"the force of {off.sum()} of {off.size} traces does not begin at t_s = 0 but at "
            f"{' to '.join(ends)} s"
        )
        looks, correction = "the recorder's clock, or a record that begins before its trigger", None
        has_end = np.isfinite(delay[off]).any()
        text += f"; {_ends(median(delay[off]))}" if has_end else ""
        if has_end and abs(median(delay[off])) <= tolerance:
            looks = ANOTHER if stand.record.time_zero == "force" else DEAD
        elif np.isnan(start).any():
            text += f"; in {np.isnan(start).sum()} traces no rise of the force is seen at all"
        else:
            correction = "trace_time=from_force"
        yield Finding("trace_time", text, looks, correction, bool((off & is_late).any()))
    elif np.isnan(start).all():
        text = "no rise of force_N stands out from its noise in the traces: t_s = 0 is unchecked"
        text += f"; {_ends(middle)}" if abs(middle) > tolerance else ""
        looks = "a sensor not connected or of opposite sign, or a force from the first sample on"
        yield Finding("trace_time", text, looks)
    elif abs(middle) > tolerance > median(abs(delay - middle)) - 0.1 * abs(middle):
        dead = stand.record.time_zero == "command" and middle < 0.0
        looks = "a dead time between command and force" if dead else ANOTHER
        yield Finding("trace_time", _ends(middle), f"{looks}, or to another travel")


def _clock(traced_row: TracedRow) -> tuple[float, float, float]:
    """Give start of the force, end of travel, and least time that is seen, s; NaN for not shown."""
    start, travel = (
        None if traced_row.moving else traced_row.start,
        traced_row.stand.clutch.shift_travel,
    )
    way = np.maximum.accumulate(smoothed(traced_row.trace.displacement) - traced_row.rest)
    end = float(np.interp(travel, way, traced_row.trace.time)) if way[-1] >= travel else np.nan
    visible = max(
        CLOCK, 3.0 * step_of(traced_row.trace.time), 4.0 * (start.error if start else 0.0)
    )
    return (start.time if start else np.nan), end, visible


def _ends(delay: float) -> str:
    size = f"{1e3 * abs(delay):.1f} ms" if abs(delay) < 1.0 else f"{abs(delay):.4f} s"
    when = "after" if delay > 0.0 else "before"
    return f"the travel of the traces ends {size} {when} shift_time_s of their rows (median)"


def trace_rest(stand: Stand, sheet: Sheet) -> Findings:
    """Find displacements and forces that are not zero before the force begins."""
    rows, noise = traced(stand, sheet), CLEAR / np.sqrt(FIRST)
    moving = sum(row.moving for row in rows)
    if 2 * moving > max(1, len(rows)):
        text = f"the sleeve moves already at the first samples of {moving} of {len(rows)} traces"
        yield Finding("displacement", text, "records that begin after the force")
        return
    gap = REST * stand.clutch.dog.axial_gap
    way = [
        row.rest / MM
        for row in rows
        if abs(row.rest) > max(gap, noise * scatter(row.trace.displacement))
    ]
    force = []
    for row in rows:
        start = row.start
        if start is None or start.time < row.trace.time[0]:
            continue
        if abs(start.force) > max(REST * row.full_level, noise * scatter(row.trace.signal)):
            force.append(start.force)
    looks, when = "a sensor that is not set to zero", "(median) before the force begins"
    of_all = f"of {len(rows)} traces is"
    if way:
        text = f"displacement_mm of {len(way)} {of_all} {short(median(way), 3)} mm {when}"
        yield Finding("displacement", text, looks, "displacement=zeroed")
    if 2 * len(force) > len(rows):
        logged = rows[0].trace.logged
        key = FORCE_CHANNEL if logged is None else logged.key
        amount = f"{short(from_si(key, median(force)), 3)} {unit_of(key)}"
        text = f"{key} of {len(force)} {of_all} {amount} {when}"
        if key == "pressure_bar":
            looks = "an absolute pressure, or a sensor that is not set to zero"
        yield Finding("trace_force", text, looks, "trace_force=zeroed")


MIN_CURED = 0.5  #: share of the rows that the correction of a slip brings into the range


@dataclass(frozen=True)
class Range:
    """Range of a ratio of traces to their rows.

    ``found`` is a sentence with the ratio as {0}, travel and ratio in mm as {1} and {2}. Of
    ``ways`` (correction, unit in words) the one that brings most rows into the range is the slip,
    which is refused. Without one the cause is ``other``, which is refused beyond
    ``possible``. Of a sensor at the actuator the range ends at ``soft`` times ``high``.
    ``alternatives`` are corrections, with their cause, that may do so as one of ``ways`` does.
    """

    quantity: str
    ratio: Callable[[TracedRow], float]
    low: float
    high: float
    found: str
    ways: tuple[tuple[str, str], ...]
    other: str
    possible: tuple[float, float] = (-np.inf, np.inf)
    arguable: bool = True
    soft: float = 1.0
    alternatives: Mapping[str, tuple[tuple[str, str], ...]] = field(default_factory=dict)

    def _middle(self, stand: Stand, sheet: Sheet) -> float:
        return median([self.ratio(row) for row in traced(stand, sheet)], 1.0)

    def _cured_share(self, stand: Stand, sheet: Sheet, correction: str, high: float) -> float:
        """Compute the share of rows whose ratio a correction brings into the range."""
        try:
            corrected_sheet = corrected(sheet, correction, stand.sensor)
        except InputError:  # the stand does not say by how much
            return 0.0
        ratios = np.array([self.ratio(row) for row in traced(stand, corrected_sheet)])
        ratios = ratios[np.isfinite(ratios)]
        is_inside = (self.low <= ratios) & (ratios <= high)
        # A force of the right unit may be too early in its rise for a ratio.
        return float(is_inside.mean()) if is_inside.size else 1.0

    def __call__(self, stand: Stand, sheet: Sheet) -> Findings:
        """Find a ratio out of the range."""
        middle, travel = self._middle(stand, sheet), stand.clutch.dog.travel / MM
        high = self.high * (self.soft if stand.record.displacement_at == "actuator" else 1.0)
        if self.low <= middle <= high:
            return
        found = self.found.format(short(middle, 3), number(travel), short(middle * travel, 3))
        shares = {way: self._cured_share(stand, sheet, way, high) for way, _ in self.ways}
        correction, looks = max(self.ways, key=lambda way: shares[way[0]])
        if shares[correction] >= MIN_CURED:
            text = looks.format(number(stand.sensor.linkage_ratio or 0.0))
            alternatives = tuple(
                (way, cause)
                for way, cause in self.alternatives.get(correction, ())
                if self._cured_share(stand, sheet, way, high) >= MIN_CURED
            )
            yield Finding(
                correction.partition("=")[0],
                found,
                text,
                correction,
                certain=True,
                arguable=self.arguable,
                alternatives=alternatives,
            )
            return
        certain = not self.possible[0] < middle < self.possible[1]
        yield Finding(self.quantity, found, self.other, None, certain, self.arguable)


#: In this order: a check may rely on those before it.
TRACED: tuple[Callable[[Stand, Sheet], Findings], ...] = (
    Range("trace_time", time_ratio, 0.0, 100.0,
          "by t_s the travel of the traces takes {0} times the time of the shift",
          (("trace_time=ms", "milliseconds"),),
          "another unit than seconds or milliseconds", possible=(0.0, 100.0), arguable=False),
    trace_signs,
    trace_clock,
    # Behind a soft linkage a sensor at the actuator reads more way than the sleeve makes.
    Range("displacement", travel_ratio, 0.9, 1.15,
          "displacement_mm of finished shifts ends at {2}, but the sleeve's travel is {1} mm",
          (("displacement=m", "metres"),
           ("displacement=arm", "the robot arm's, {} times the sleeve's")),
          "a sensor with a wrong scale or a soft linkage, or an actuator's (give linkage_ratio in "
          "the table [sensor])", possible=(0.5, 2.0), soft=1.8 / 1.15),
    trace_lock,
    Range("mismatch", speed_ratio, 1.0 / SAME, SAME,
          "the traces begin with {0} times the mismatch_rpm of their rows "
          "(output_speed_rpm less sliding_speed_rpm)",
          (("mismatch=rad_s", "mismatch_rpm in radians a second"),
           ("speeds=rad_s", "the speeds of the traces in radians a second"),
           ("mismatch=reversed", "a mismatch_rpm of sliding less output speed"),
           ("speeds=sliding_rad_s", "sliding_speed_rpm alone in radians a second"),
           ("speeds=output_rad_s", "output_speed_rpm alone in radians a second")),
          "another speed than the nominal one",
          alternatives={"mismatch=reversed":
                        (("speeds=exchanged", "the traces' two speed columns exchanged"),),
                        "speeds=rad_s":
                        (("speeds=output_rad_s", "output_speed_rpm alone"),)}),
    Range("trace_force", force_ratio, 0.5, 1.5,
          "force_N of the traces ends at {0} of what force_N of the table makes it",
          (("trace_force=kN", "kilonewtons"),
           ("force=arm", "the force at the robot arm in the table"),
           ("trace_force=arm", "the force at the robot arm in the traces")),
          "a sensor with a wrong scale"),
    trace_level,
    trace_rest,
    trace_jumps,
)  # fmt: skip
