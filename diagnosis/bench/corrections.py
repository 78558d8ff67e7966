"""Corrections of units, axes and set values that a user confirms; none is made unasked.

A correction is written ``QUANTITY=WAY``, for instance ``time=ms``: the column is in
milliseconds. ``QUANTITY=given`` says that it is right as it stands, however odd it looks. A
unit and a zero of one quantity go together: ``trace_time=ms``, ``trace_time=from_force``.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from typing import Any

from dogshape.diagnosis.bench.stand_file import Sensor
from dogshape.diagnosis.bench.table import Row, Sheet, joined_values
from dogshape.diagnosis.bench.traces import BenchTrace, ForceStart, find_force_start
from dogshape.sim.errors import DataError, InputError, did_you_mean
from dogshape.sim.units import MM, MS, RPM

GIVEN = "given"
ZEROS = ("from_force", "zeroed")  #: ways that move a zero and change no unit

Change = Callable[[Sheet, Sensor], Sheet]
SPEEDS = ("sliding_speed", "output_speed")


@dataclass(frozen=True)
class Correction:
    """Correction of one quantity, and its way."""

    quantity: str
    way: str

    def __str__(self) -> str:
        """Write the correction as a user does."""
        return f"{self.quantity}={self.way}"


def _rows(change: Callable[[Row, Sensor], Row]) -> Change:
    return lambda sheet, sensor: sheet.with_rows(tuple(change(row, sensor) for row in sheet.rows))


def _traces(change: Callable[[BenchTrace, Row, Sensor], BenchTrace]) -> Change:
    """Return the change of the traces of rows that have one."""
    return _rows(
        lambda row, sensor: (
            row if row.trace is None else replace(row, trace=change(row.trace, row, sensor))
        )
    )


def _scaled(one: Any, by: float, *names: str) -> Any:
    """Multiply fields of a row or a trace, where they have a value."""
    values = {name: getattr(one, name) for name in names}
    return replace(one, **{name: v * by for name, v in values.items() if v is not None})


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


def _joined(sheet: Sheet, _: Sensor) -> Sheet:
    """Return a sheet in which rows with nearly the same set values have the same."""
    values = zip(sheet.rows, joined_values(sheet.rows), strict=True)
    return sheet.with_rows(
        tuple(replace(r, mismatch=n, force=force, rise=rise) for r, (n, force, rise) in values)
    )


#: What can be taken otherwise, in the order in which it is changed.
WAYS: dict[str, dict[str, Change]] = {
    "axes": {"swapped": _rows(lambda r, _: replace(r, mismatch=r.force, force=r.mismatch))},
    "time": {"ms": _rows(lambda r, _: _scaled(r, MS, "time", "sd"))},
    "rise": {"ms": _rows(lambda r, _: _scaled(r, MS, "rise"))},
    "force": {
        "kN": _rows(lambda r, _: _scaled(r, 1e3, "force")),
        "arm": _rows(lambda r, s: _scaled(r, _factor(s, "force"), "force")),
    },
    "mismatch": {
        "rad_s": _rows(lambda r, _: _scaled(r, 1.0 / RPM, "mismatch")),
        "reversed": _rows(lambda r, _: _scaled(r, -1.0, "mismatch")),
    },
    "displacement": {
        "m": _traces(lambda t, _, s: _scaled(t, 1.0 / MM, "displacement")),
        "arm": _traces(lambda t, _, s: _scaled(t, _factor(s, "displacement"), "displacement")),
        "zeroed": _traces(
            lambda t, r, _: replace(t, displacement=t.displacement - _start(t, r).displacement)
        ),
    },
    "trace_time": {
        "ms": _traces(lambda t, _, s: _scaled(t, MS, "time")),
        "from_force": _traces(
            lambda t, r, _: replace(
                t, time=t.time - (start := _start(t, r)).time, start_error=start.error
            )
        ),
    },
    "trace_force": {
        "kN": _traces(lambda t, _, s: _scaled(t, 1e3, "force")),
        "arm": _traces(lambda t, _, s: _scaled(t, _factor(s, "force"), "force")),
        "zeroed": _traces(lambda t, r, _: replace(t, force=t.force - _start(t, r).force)),
    },
    "speeds": {"rad_s": _traces(lambda t, _, s: _scaled(t, 1.0 / RPM, *SPEEDS))},
    "points": {"joined": _joined},
}


def contradict(one: Correction, other: Correction) -> bool:
    """Test that two corrections of one quantity cannot both be made."""
    if one.quantity != other.quantity or one.way == other.way:
        return False
    return GIVEN in (one.way, other.way) or (one.way in ZEROS) == (other.way in ZEROS)


def parse(texts: Iterable[str]) -> tuple[Correction, ...]:
    """Read corrections such as ``time=ms``; one that is wrong or contradicts raises InputError.

    They come in the order in which they are made.
    """
    found: list[Correction] = []
    for text in texts:
        quantity, _, way = text.partition("=")
        if quantity not in WAYS:
            hint = did_you_mean(quantity, WAYS)
            raise InputError(f"the correction '{text}' is of no known quantity; {hint}")
        if way != GIVEN and way not in WAYS[quantity]:
            valid = ", ".join(f"{quantity}={known}" for known in (*WAYS[quantity], GIVEN))
            raise InputError(f"the correction '{text}' is not known; valid are {valid}")
        one = Correction(quantity, way)
        for other in found:
            if contradict(one, other):
                raise InputError(
                    f"the corrections {other} and {one} contradict each other; give one"
                )
        if one not in found:
            found.append(one)
    every = [Correction(quantity, way) for quantity in WAYS for way in (*WAYS[quantity], GIVEN)]
    return tuple(sorted(found, key=every.index))


def corrected(sheet: Sheet, correction: Correction, sensor: Sensor) -> Sheet:
    """Make one correction in all rows of a sheet; ``given`` changes none."""
    change = WAYS[correction.quantity].get(correction.way)
    return sheet if change is None else change(sheet, sensor)


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
