r"""Step of the clock that took the shift times: the cycle of a controller, or of a recorder.

Of times that a clock with the step :math:`s` takes, each single one has a rounding error with the
standard deviation :math:`s/\sqrt{12}`. A clock that rounds up makes all times late by
:math:`s/2` on average, one that rounds down early.
"""

from __future__ import annotations

from math import gcd, log10

from dogshape.diagnosis.bench.finding import Finding
from dogshape.diagnosis.bench.stand_file import Stand
from dogshape.diagnosis.bench.table import Row, Sheet
from dogshape.sim.errors import number
from dogshape.sim.units import MS

WRITTEN = 1e-3  #: s, resolution that times are written with where no clock is coarser
#: Least step in written resolutions: half of it is half the least margin of a diagnosis, 2 ms.
COARSE = 2
#: Decades of improbability from which common multiples are a clock: by chance once in 10^4.
DECADES = 4.0
OFF = 0.25  #: share of a stated step by which no rounded time misses a multiple


def clock_step(stand: Stand, sheet: Sheet) -> float:
    """Find the step of the clock in s: the stated one, or that of which all times are multiples.

    Zero where there is none, or no single shift to show one.
    """
    return found_step(sheet) if stand.clock_step is None else stand.clock_step


def found_step(sheet: Sheet) -> float:
    """Find the step in s of which the times of all single shifts are multiples, zero for none.

    Of n times written in 1 ms, all are multiples of k ms by chance with the probability k^-n.
    """
    single = _single(sheet)
    times = [round(1e6 * row.time) for row in single if row.time is not None]
    many = gcd(*times) * 1e-6 / WRITTEN
    if many < COARSE or len(times) * log10(many) < DECADES:
        return 0.0
    return many * WRITTEN


def clock_findings(stand: Stand, sheet: Sheet) -> list[Finding]:
    """Return a step that nothing states, or a stated one that the times do not have."""
    single = _single(sheet)
    if stand.clock_step is None:
        step = found_step(sheet)
        if not step:
            return []
        found = f"all {len(single)} times of single shifts are multiples of {number(step / MS)} ms"
        looks = "the cycle of a controller, and counts as errors.clock_step_ms of bench.toml"
        remedy = "state that key, with 0 where the clock is finer"
        return [Finding("clock", found, looks, remedy=remedy)]
    off = rows_off(sheet, stand.clock_step)
    if not off:
        return []
    found = (
        f"errors.clock_step_ms is {number(stand.clock_step / MS)} ms, but {len(off)} of "
        f"{len(single)} times of single shifts are no multiples of it (row {off[0].row}: "
        f"{number(off[0].time or 0.0)} s)"
    )
    remedy = "state the step of the clock in milliseconds, 0 for none"
    looks = "another clock, or a step in another unit"
    return [Finding("clock", found, looks, certain=True, remedy=remedy)]


def _single(sheet: Sheet) -> list[Row]:
    return [row for row in sheet.rows if row.n == 1 and row.time is not None]


def rows_off(sheet: Sheet, step: float) -> list[Row]:
    """List the single shifts whose time is no multiple of a step in s; none for a step of zero."""
    counts = [(row, (row.time or 0.0) / step if step else 0.0) for row in _single(sheet)]
    return [row for row, count in counts if abs(count - round(count)) > OFF]
