"""Slips of units and axes in bench data: recognised and asked about, never silently fitted.

Two checks find a slip. Physics: no shift ends before the sliding ring has flown freely under the
force, and no time exceeds the time-out. Redundancy: calibration, rise times and traces repeat the
table. A finding is a correction that makes most of the impossible rows possible. Requested
corrections are made first; the checks see the corrected data.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from dogshape.diagnosis.bench.clock import clock_findings
from dogshape.diagnosis.bench.corrections import GIVEN, Correction, contradict, corrected
from dogshape.diagnosis.bench.finding import Finding
from dogshape.diagnosis.bench.stand_file import Stand
from dogshape.diagnosis.bench.table import Row, Sheet
from dogshape.diagnosis.bench.table_slips import (
    axes_by_rise,
    bounds,
    early_times,
    force_by_calibration,
    free_flight,
    nearly_same_points,
    repeated_rows,
    short_traces,
    too_early,
)
from dogshape.diagnosis.bench.trace_slips import (
    axes_by_speed,
    displacement,
    speeds,
    trace_clock,
    trace_force,
    trace_notes,
    trace_rest,
    trace_time,
)
from dogshape.sim.errors import DataError, number

__all__ = ["Finding", "examine", "impossible", "require_no_slip"]

Check = Callable[[Stand, Sheet], Sequence[Finding]]

#: In this order: a check may rely on those before it.
CHECKS: tuple[Check, ...] = (
    axes_by_rise, axes_by_speed, bounds, force_by_calibration, early_times, trace_notes, trace_time,
    trace_clock, displacement, speeds, trace_force, trace_rest, repeated_rows, nearly_same_points,
    short_traces, clock_findings,
)  # fmt: skip


def examine(stand: Stand, sheet: Sheet, asked: Sequence[Correction] = ()) -> tuple[Finding, ...]:
    """Find probable slips in a sheet whose corrections have been made.

    ``asked`` are these corrections; quantities that are to be taken as given, or that have
    been swapped already, are not questioned.
    """
    settled = [one for one in asked if one.way == GIVEN or one.quantity == "axes"]
    found: list[Finding] = []
    for check in CHECKS:
        for finding in check(stand, sheet):
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
    if not too_early(stand, row) or Correction("time", GIVEN) in asked:
        return None
    return (
        f"a time in s not far below {number(free_flight(stand, row))} s, which the free flight "
        "alone takes under this force (--correct time=given takes it as it stands)"
    )
