"""Corrections of units, axes and set values that a user confirms; none is made unasked.

A correction is written ``QUANTITY=WAY``, for instance ``time=ms``: the column is in
milliseconds. ``QUANTITY=given`` says that it is right as it stands, however odd it looks. A
unit, a sign and a zero of one quantity go together: ``trace_time=ms``, ``trace_time=from_force``.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from typing import Any

from dogshape.bench.force_start import ForceStart, displacement_at_rest, find_force_start
from dogshape.bench.stand_file import Sensor
from dogshape.bench.table import Row, Sheet, joined_rows
from dogshape.bench.traces import BenchTrace
from dogshape.sim.errors import DataError, InputError, require_known
from dogshape.sim.interface import listed_argument
from dogshape.sim.units import MM, MS, RPM

GIVEN = "given"
#: Ways that change no unit, by what they change: those of different kinds go together.
KINDS = {"from_force": "zero", "zeroed": "zero", "turned": "sign", "exchanged": "columns"}


def _scaled(record: Any, factor: float, *names: str) -> Any:
    """Multiply fields of a row or a trace that have a value by a factor."""
    values = {name: getattr(record, name) for name in names}
    return replace(record, **{name: v * factor for name, v in values.items() if v is not None})


def _start(trace: BenchTrace, row: Row) -> ForceStart:
    start = find_force_start(trace, row.rise)
    if start is None:
        raise DataError(
            f"{trace.path}: no rise of force_N stands out from its noise, so that neither "
            "time zero nor values at rest can be found from it; correct the file, or leave the "
            "cell trace empty"
        )
    return start


def _factor(sensor: Sensor, quantity: str) -> float:
    """Return the factor from the robot arm to the sleeve; InputError where none is stated."""
    factor, keys = sensor.force_factor, "linkage_ratio and linkage_efficiency"
    if quantity == "displacement":
        factor, keys = sensor.linkage_ratio and 1.0 / sensor.linkage_ratio, "linkage_ratio"
    if factor is None:
        raise InputError(
            f"{quantity}=arm refers it from the robot arm to the sleeve, but bench.toml does not "
            f"say by how much; give {keys} in its table [sensor]"
        )
    return factor


def _from_force(trace: BenchTrace, row: Row, _: Sensor) -> BenchTrace:
    start = _start(trace, row)
    return replace(trace, time=trace.time - start.time, start_error=start.error)


def _turned_displacement(trace: BenchTrace, row: Row, _: Sensor) -> BenchTrace:
    """Replace the displacement by that from the reading at rest with the opposite sign."""
    rest_displacement = displacement_at_rest(trace, row.rise)
    return replace(trace, displacement=rest_displacement - trace.displacement)


def _zeroed_force(trace: BenchTrace, row: Row, _: Sensor) -> BenchTrace:
    """Count the force, or the logged channel that makes it, from its reading at rest."""
    rest = _start(trace, row).force
    if trace.logged is None:
        return replace(trace, force=trace.force - rest)
    return replace(trace, logged=replace(trace.logged, values=trace.logged.values - rest))


#: Corrections of rows and of their traces, in the order in which they are made.
OF_ROWS: dict[str, Callable[[Row, Sensor], Row]] = {
    "axes=swapped": lambda r, _: replace(r, mismatch=r.force, force=r.mismatch),
    "time=ms": lambda r, _: _scaled(r, MS, "time", "sd"),
    "rise=ms": lambda r, _: _scaled(r, MS, "rise"),
    "force=kN": lambda r, _: _scaled(r, 1e3, "force"),
    "force=arm": lambda r, s: _scaled(r, _factor(s, "force"), "force"),
    "mismatch=rad_s": lambda r, _: _scaled(r, 1.0 / RPM, "mismatch"),
    "mismatch=reversed": lambda r, _: _scaled(r, -1.0, "mismatch"),
}
OF_TRACES: dict[str, Callable[[BenchTrace, Row, Sensor], BenchTrace]] = {
    "trace_force=turned": lambda t, _, s: _scaled(t, -1.0, "force"),
    "displacement=turned": _turned_displacement,
    "displacement=m": lambda t, _, s: _scaled(t, 1.0 / MM, "displacement"),
    "displacement=arm": lambda t, _, s: _scaled(t, _factor(s, "displacement"), "displacement"),
    "displacement=zeroed": lambda t, r, _: replace(
        t, displacement=t.displacement - _start(t, r).displacement
    ),
    "trace_time=ms": lambda t, _, s: _scaled(t, MS, "time"),
    "trace_time=from_force": _from_force,
    "trace_force=kN": lambda t, _, s: _scaled(t, 1e3, "force"),
    "trace_force=arm": lambda t, _, s: _scaled(t, _factor(s, "force"), "force"),
    "trace_force=zeroed": _zeroed_force,
    "speeds=rad_s": lambda t, _, s: _scaled(t, 1.0 / RPM, "sliding_speed", "output_speed"),
    "speeds=sliding_rad_s": lambda t, _, s: _scaled(t, 1.0 / RPM, "sliding_speed"),
    "speeds=output_rad_s": lambda t, _, s: _scaled(t, 1.0 / RPM, "output_speed"),
    "speeds=exchanged": lambda t, _, s: replace(
        t, sliding_speed=t.output_speed, output_speed=t.sliding_speed
    ),
}
JOINED = "points=joined"  #: of all rows at once, last
WAYS = (*OF_ROWS, *OF_TRACES, JOINED)


def contradict(first: str, second: str) -> bool:
    """Test that two corrections of one quantity cannot both be made."""
    (quantity, _, way), (second_quantity, _, second_way) = (
        first.partition("="),
        second.partition("="),
    )
    if quantity != second_quantity or way == second_way:
        return False
    return GIVEN in (way, second_way) or KINDS.get(way) == KINDS.get(second_way)


def parse(texts: Iterable[str]) -> tuple[str, ...]:
    """Parse corrections, ``time=ms``; InputError for unknown or contradicting ones.

    They come once each, in the order in which they are made.
    """
    quantities = dict.fromkeys(key.partition("=")[0] for key in WAYS)
    valid_corrections = [*WAYS, *(f"{quantity}={GIVEN}" for quantity in quantities)]
    corrections: list[str] = []
    for text in texts:
        quantity = text.partition("=")[0]
        require_known(f"quantity of the correction '{text}'", quantity, "a known one", quantities)
        if text not in valid_corrections:
            valid = ", ".join(
                correction
                for correction in valid_corrections
                if correction.partition("=")[0] == quantity
            )
            raise InputError(f"the correction '{text}' is not known; valid are {valid}")
        for rival in (correction for correction in corrections if contradict(text, correction)):
            raise InputError(f"the corrections {rival} and {text} contradict each other; give one")
        corrections.append(text)
    return tuple(sorted(set(corrections), key=valid_corrections.index))


def corrected(sheet: Sheet, correction: str, sensor: Sensor) -> Sheet:
    """Make one correction in all rows of a sheet; ``given`` changes none."""
    rows = sheet.rows
    if correction == JOINED:
        rows = joined_rows(rows)
    elif change := OF_ROWS.get(correction):
        rows = tuple(change(row, sensor) for row in rows)
    elif of_trace := OF_TRACES.get(correction):
        rows = tuple(
            replace(row, trace=row.trace and of_trace(row.trace, row, sensor).with_logged_force())
            for row in rows
        )
    return replace(sheet, rows=rows)


@dataclass(frozen=True)
class Finding:
    """Probable slip in bench data.

    ``correction``, such as ``time=ms``, would make ``quantity`` right. A ``certain`` one cannot be
    true as it stands and is refused; ``arguable`` tells whether a user may say that it is right.
    ``alternatives`` are other corrections with the same effect on what was found. ``remedy`` is
    what to do where neither a correction nor the data set is.
    """

    quantity: str
    found: str
    looks_like: str
    correction: str | None = None
    certain: bool = False
    arguable: bool = True
    remedy: str = ""
    alternatives: tuple[tuple[str, str], ...] = ()

    @property
    def sentence(self) -> str:
        """Finding, probable cause and remedy in a sentence."""
        ways = []
        if self.correction:
            ways.append(f"{listed_argument('correct', self.correction)} applies this correction")
        for way, cause in self.alternatives:
            ways.append(f"{listed_argument('correct', way)} where it is {cause}")
        if self.arguable:
            answer = listed_argument("correct", f"{self.quantity}={GIVEN}")
            ways.append(f"{answer} keeps the values")
        return self.with_remedy(self.remedy or ", or ".join(["correct the data set", *ways]))

    def with_remedy(self, remedy: str) -> str:
        """Return finding, probable cause and a remedy in a sentence."""
        return f"{self.found}; this looks like {self.looks_like}; {remedy}"


Findings = Iterator[Finding]
