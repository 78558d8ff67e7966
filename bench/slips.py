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

from collections import Counter
from collections.abc import Callable, Sequence
from math import gcd, log10

import numpy as np

from dogshape.bench.corrections import GIVEN, Finding, Findings, contradict, corrected
from dogshape.bench.stand_file import Stand
from dogshape.bench.table import FORCE, NEAR, Row, Sheet, near_groups
from dogshape.bench.trace_slips import TRACED, median, recording_faults, trace_notes, trace_rate
from dogshape.sim.elementwise import Array
from dogshape.sim.errors import DataError, InputError, number
from dogshape.sim.interface import listed_argument
from dogshape.sim.shift.actuation import ForceProfile
from dogshape.sim.units import MS

SURE = 0.5  #: share of the free flight below which no force, mass or time zero off nominal reaches
ODD = 0.9  #: share below which a time is odd
CLOSE = 0.01  #: relative difference within which two values are the same one
WRITTEN = 1e-3  #: s, resolution that times are written with where no clock is coarser
#: Least step in written resolutions: half of it is half the least margin of a diagnosis, 2 ms.
COARSE = 2
#: Decades of improbability from which common multiples are a clock: by chance once in 10^4.
DECADES = 4.0
OFF = 0.25  #: share of a stated step by which no rounded time misses a multiple
SWAPPED = "the columns mismatch_rpm and force_N swapped"
LEAST_FORCE = 100.0  #: N, median of forces below which they may be kilonewtons


def examine(stand: Stand, sheet: Sheet, corrections: Sequence[str]) -> tuple[Finding, ...]:
    """Find probable slips in a sheet whose corrections have been made.

    ``corrections`` are those made; quantities that are to be taken as given, or that have
    been swapped already, are not questioned.
    """
    settled = [way for way in corrections if way.endswith(GIVEN) or way.startswith("axes=")]
    findings: list[Finding] = []
    for check in CHECKS:
        for finding in list(check(stand, sheet)):
            correction = finding.correction or f"{finding.quantity}={GIVEN}"
            if correction in settled or any(contradict(correction, way) for way in settled):
                continue
            findings.append(finding)
            if finding.certain:
                settled.append(correction)
                sheet = corrected(sheet, correction, stand.sensor)
    return tuple(findings)


def require_no_slip(where: str, findings: Sequence[Finding], remedy: str | None = None) -> None:
    """Raise DataError with all findings that are certain.

    ``where`` is the file, ``remedy`` what to do where nothing can be corrected on the way.
    """
    certain = [
        finding.with_remedy(remedy) if remedy else finding.sentence
        for finding in findings
        if finding.certain
    ]
    if certain:
        raise DataError(f"{where}: " + ". Also: ".join(certain))


def impossible(stand: Stand, row: Row, corrections: Sequence[str] = ()) -> str | None:
    """Return the rule that the time of a row breaks, None for a possible time."""
    limit = stand.clutch.timeout
    if row.time is not None and not 0.0 < row.time <= limit:
        return f"a time in s, above 0 and at most the time-out of {number(limit)} s"
    if not _too_early(stand, row) or "time=given" in corrections:
        return None
    return (
        f"a time in s not far below {number(_free_flight(stand, row))} s, which the free flight "
        f"alone takes under this force ({listed_argument('correct', 'time=given')} takes it as it "
        "stands)"
    )


def _free_flight(stand: Stand, row: Row) -> float:
    try:
        profile = ForceProfile(row.force, row.rise)
    except InputError:
        return np.inf
    return profile.free_flight_time(stand.clutch.shift_travel, stand.clutch.rings.mass)


def _too_early(stand: Stand, row: Row, share: float = SURE) -> bool:
    return row.time is not None and row.time < share * _free_flight(stand, row)


def _share_impossible(stand: Stand, sheet: Sheet) -> float:
    """Compute the ratio of physically impossible rows to rows with a time."""
    wrong = [impossible(stand, row) or np.isinf(_free_flight(stand, row)) for row in sheet.rows]
    return sum(map(bool, wrong)) / max(1, _column(sheet, "time").size)


def _column(sheet: Sheet, name: str) -> Array:
    values = np.array([getattr(row, name) for row in sheet.rows], dtype=float)
    return np.sort(values[np.isfinite(values)])


def _middle(sheet: Sheet, name: str) -> float:
    return median(abs(_column(sheet, name)), np.nan)


def _span(values: Array) -> str:
    low, high = number(values[0]), number(values[-1])
    return f"is {low}" if values[0] == values[-1] else f"runs from {low} to {high}"


def axes_by_rise(_: Stand, sheet: Sheet) -> Findings:
    """Find swapped axes where the rise time goes with the mismatch instead of the force."""
    rises = [
        Counter(value for value, _ in {(getattr(row, name), row.rise) for row in sheet.rows})
        for name in ("force", "mismatch")
    ]
    mixed, several = (sum(n > 1 for n in by.values()) for by in rises)
    if mixed >= 2 and not several:
        text = (
            f"force_rise_s goes with mismatch_rpm: {mixed} of {len(rises[0])} forces have "
            "several rise times, and each mismatch has one"
        )
        yield Finding("axes", text, SWAPPED, "axes=swapped", certain=True)


#: Columns whose size may show a slip: name, correction, test, unit in words, and what is found.
SIZES: tuple[tuple[str, str, Callable[[Stand, Sheet], bool], str, str], ...] = (
    ("time", "time=ms", lambda s, t: _middle(t, "time") > s.clutch.timeout, "milliseconds",
     "shift_time_s {}, but a shift that has a time ends after its free flight and before the "
     "time-out of {} s"),
    ("rise", "rise=ms", lambda s, t: _middle(t, "rise") > s.clutch.timeout, "milliseconds",
     "force_rise_s {}, but so slow a force could not have ended shifts in their times"),
    ("force", "force=kN", lambda _, t: _middle(t, "force") < LEAST_FORCE, "kilonewtons",
     "force_N {}, but so small a force could not have ended shifts in their times"),
    ("force", "axes=swapped",
     lambda _, t: _middle(t, "mismatch") >= 2.0 * _middle(t, "force"), SWAPPED,
     "force_N {}, which could not have ended shifts in their times"),
)  # fmt: skip


def physical_ranges(stand: Stand, sheet: Sheet) -> Findings:
    """Find columns out of the range in which a shift has its free flight and ends in time.

    Half of the rows have to be impossible; single cells are refused one by one.
    """
    for name, correction, off, looks, template in SIZES:
        if name == "force" and sheet.set_key != FORCE:
            continue  # the actuator bounds a set value
        if off(stand, sheet) and _share_impossible(stand, sheet) >= 0.5:
            text = template.format(_span(_column(sheet, name)), number(stand.clutch.timeout))
            quantity = correction.partition("=")[0]
            yield Finding(quantity, text, looks, correction, True, arguable=quantity == "axes")
            sheet = corrected(sheet, correction, stand.sensor)


def force_by_calibration(stand: Stand, sheet: Sheet) -> Findings:
    """Find forces that are the arm's of the calibration and not the sleeve's."""
    force_pairs = np.array(
        [
            (c.arm_force_N, c.sleeve_force_N)
            for c in stand.calibration
            if c.arm_force_N and c.sleeve_force_N
        ]
    ).reshape(-1, 2)
    forces, factor = _column(sheet, "force"), stand.sensor.force_factor
    is_close = abs(forces[:, None, None] / force_pairs - 1.0) < CLOSE
    if is_close.any(axis=1).all(axis=0).tolist() == [True, False]:
        text = (
            f"force_N {_span(forces)}, the values of arm_force_N in the table actuator_calibration "
            "and not those of sleeve_force_N"
        )
        looks = "the force at the robot arm instead of that at the sleeve"
        looks += f", which is {number(factor)} times as large" if factor else ""
        yield Finding("force", text, looks, "force=arm" if factor else None, certain=True)


def early_times(stand: Stand, sheet: Sheet) -> Findings:
    """Find times that are shorter than the free flight, though not impossibly so."""
    early = sum(_too_early(stand, row, ODD) for row in sheet.rows)
    timed = _column(sheet, "time").size
    if early >= max(1, 0.2 * timed):
        text = f"{early} of {timed} times are shorter than the free flight under their force"
        looks = "a time that starts after the force, a larger force or a smaller mass than given"
        yield Finding("time", text, looks)


def repeated_rows(_: Stand, sheet: Sheet) -> Findings:
    """Find rows with a time that repeat earlier rows.

    Times of single shifts are rounded and may be equal by chance, so that of these half must be
    repeats; of means and of traces one is enough.
    """
    timed = [row for row in sheet.rows if row.time is not None]
    numbers = [(row.mismatch, row.force, row.rise, row.n, row.time) for row in timed]
    keys = [
        row.trace.path if row.trace else numbers_of_row
        for row, numbers_of_row in zip(timed, numbers, strict=True)
    ]
    first = {key: row.row for key, row in zip(keys[::-1], timed[::-1], strict=True)}
    copies = [
        (row, first[key]) for key, row in zip(keys, timed, strict=True) if first[key] != row.row
    ]
    lone = {row.row for row in timed if row.n == 1 and row.trace is None}
    if 2 * sum(row.row in lone for row, _ in copies) < max(4, len(lone)):
        copies = [copy for copy in copies if copy[0].row not in lone]
    if copies:
        subject = (
            f"{len(copies)} rows repeat earlier ones" if copies[1:] else "a row is there twice"
        )
        looks = "a table copied below itself: copies make the data seem surer than they are"
        text = f"{subject}: row {copies[0][0].row} is row {copies[0][1]} again"
        yield Finding("rows", text, looks, arguable=False)


def nearly_same_points(_: Stand, sheet: Sheet) -> Findings:
    """Find rows with nearly equal, but different set values."""
    values, groups = near_groups(sheet.rows)
    lead = np.unique(groups, return_index=True)[1][groups]
    near_rows = np.flatnonzero((values != values[lead]).any(axis=1))
    if near_rows.size:
        row_text, lead_text = (
            f"row {row.row} ({row.mismatch:.6g} 1/min, {row.force:.6g} N, {row.rise:.4g} s)"
            for row in (sheet.rows[near_rows[0]], sheet.rows[lead[near_rows[0]]])
        )
        subject = f"{near_rows.size} rows have" if near_rows.size > 1 else "a row has"
        text = f"{subject} nearly the set values of others: {row_text} and {lead_text} differ by "
        text += f"about {100 * NEAR:.0f} %"
        looks = "measured in place of set values, each an operating point with errors of its own"
        yield Finding("points", text, looks, "points=joined", certain=True)


def _single(sheet: Sheet) -> list[tuple[Row, float]]:
    return [(row, row.time) for row in sheet.rows if row.n == 1 and row.time is not None]


def found_step(sheet: Sheet) -> float:
    """Find the step in s of which the times of all single shifts are multiples, zero for none.

    Of n times written in 1 ms, all are multiples of k ms by chance with the probability k^-n.
    """
    times = [round(1e6 * time) for _, time in _single(sheet)]
    step_count = gcd(*times) * 1e-6 / WRITTEN
    return (
        step_count * WRITTEN
        if step_count >= COARSE and len(times) * log10(step_count) >= DECADES
        else 0.0
    )


def table_clock(stand: Stand, sheet: Sheet) -> Findings:
    """Find a step of the clock that nothing states, or a stated one that the times do not have."""
    single, step = _single(sheet), stand.clock_step
    if step is None and (step := found_step(sheet)):
        text = f"all {len(single)} times of single shifts are multiples of {number(step / MS)} ms"
        looks = "the cycle of a controller, and counts as errors.clock_step_ms of bench.toml"
        remedy = "state that key, with 0 where the clock is finer"
        yield Finding("clock", text, looks, remedy=remedy)
    elif step and (
        off := [timed for timed in single if abs(timed[1] / step % 1.0 - 0.5) < 0.5 - OFF]
    ):
        text = (
            f"errors.clock_step_ms is {number(step / MS)} ms, but {len(off)} of {len(single)} "
            f"times of single shifts are no multiples of it (row {off[0][0].row}: "
            f"{number(off[0][1])} s)"
        )
        remedy = "state the step of the clock in milliseconds, 0 for none"
        looks = "another clock, or a step in another unit"
        yield Finding("clock", text, looks, certain=True, remedy=remedy)


#: In this order: a check may rely on those before it.
CHECKS: tuple[Callable[[Stand, Sheet], Findings], ...] = (
    axes_by_rise, physical_ranges, force_by_calibration, early_times, *TRACED,
    repeated_rows, nearly_same_points, recording_faults, trace_notes, trace_rate,
    table_clock,
)  # fmt: skip
