"""Corrections of units, axes and set values that a user confirms; none is made unasked.

A correction is written ``QUANTITY=WAY``, for instance ``time=ms``: the column is in
milliseconds. ``QUANTITY=given`` says that it is right as it stands, however odd it looks. A
unit and a zero of one quantity go together: ``trace_time=ms``, ``trace_time=from_force``.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

from dogshape.diagnosis.bench.stand_file import Sensor
from dogshape.diagnosis.bench.table import Row, Sheet, joined_values
from dogshape.diagnosis.bench.traces import BenchTrace, ForceStart, find_force_start
from dogshape.sim.errors import DataError, InputError, did_you_mean
from dogshape.sim.units import MM, MS, RPM

GIVEN = "given"
ZEROS = ("from_force", "zeroed")  #: ways that move a zero and change no unit

Change = Callable[[Sheet, Sensor], Sheet]


@dataclass(frozen=True)
class Correction:
    """Correction of one quantity, and its way."""

    quantity: str
    way: str

    def __str__(self) -> str:
        """Write the correction as a user does."""
        return f"{self.quantity}={self.way}"


def _scaled(field: str, factor: float, *others: str) -> Change:
    """Return a change that multiplies fields of a row, where they have a value."""

    def change(row: Row, _: Sensor) -> Row:
        values = {name: getattr(row, name) for name in (field, *others)}
        known = {name: value * factor for name, value in values.items() if value is not None}
        return replace(row, **known) if known else row

    return _each(change)


def _each(change: Callable[[Row, Sensor], Row]) -> Change:
    """Return the change of all rows of a sheet by that of one."""
    return lambda sheet, sensor: sheet.with_rows(tuple(change(row, sensor) for row in sheet.rows))


def _in_trace(fields: tuple[str, ...], factor: Callable[[Sensor], float]) -> Change:
    """Return a change that multiplies series of a row's trace, where it has one."""

    def change(row: Row, sensor: Sensor) -> Row:
        trace = row.trace
        if trace is None:
            return row
        by = factor(sensor)
        return replace(row, trace=replace(trace, **{f: getattr(trace, f) * by for f in fields}))

    return _each(change)


def _from_start(change: Callable[[BenchTrace, ForceStart], BenchTrace]) -> Change:
    """Return a change of a row's trace, where it has one, by the start of its force."""

    def changed(row: Row, _: Sensor) -> Row:
        if row.trace is None:
            return row
        start = find_force_start(row.trace, row.rise)
        if start is None:
            raise DataError(
                f"{row.trace.path}: no rise of force_N stands out from its noise, so that neither "
                "time zero nor values at rest can be found from it; correct the file, or leave the "
                "cell trace empty"
            )
        return replace(row, trace=change(row.trace, start))

    return _each(changed)


def _at_sleeve(sensor: Sensor) -> float:
    if sensor.force_factor is None:
        raise _needs("force", "linkage_ratio and linkage_efficiency")
    return sensor.force_factor


def _ratio(sensor: Sensor) -> float:
    if sensor.linkage_ratio is None:
        raise _needs("displacement", "linkage_ratio")
    return sensor.linkage_ratio


def _needs(quantity: str, keys: str) -> InputError:
    return InputError(
        f"{quantity}=arm refers it from the robot arm to the sleeve, but bench.toml does not say "
        f"by how much; give {keys} in its table [sensor]"
    )


def _joined(sheet: Sheet, _: Sensor) -> Sheet:
    """Return a sheet in which rows with nearly the same set values have the same."""
    values = zip(sheet.rows, joined_values(sheet.rows), strict=True)
    return sheet.with_rows(
        tuple(replace(r, mismatch=n, force=force, rise=rise) for r, (n, force, rise) in values)
    )


SPEEDS = ("sliding_speed", "output_speed")

#: What can be taken otherwise, in the order in which it is changed.
WAYS: dict[str, dict[str, Change]] = {
    "axes": {
        "swapped": _each(lambda row, _: replace(row, mismatch=row.force, force=row.mismatch)),
    },
    "time": {"ms": _scaled("time", MS, "sd")},
    "rise": {"ms": _scaled("rise", MS)},
    "force": {
        "kN": _scaled("force", 1e3),
        "arm": _each(lambda row, sensor: replace(row, force=row.force * _at_sleeve(sensor))),
    },
    "mismatch": {"rad_s": _scaled("mismatch", 1.0 / RPM), "reversed": _scaled("mismatch", -1.0)},
    "displacement": {
        "m": _in_trace(("displacement",), lambda _: 1.0 / MM),
        "arm": _in_trace(("displacement",), lambda sensor: 1.0 / _ratio(sensor)),
        "zeroed": _from_start(
            lambda t, start: replace(t, displacement=t.displacement - start.displacement)
        ),
    },
    "trace_time": {
        "ms": _in_trace(("time",), lambda _: MS),
        "from_force": _from_start(
            lambda t, start: replace(t, time=t.time - start.time, start_error=start.error)
        ),
    },
    "trace_force": {
        "kN": _in_trace(("force",), lambda _: 1e3),
        "arm": _in_trace(("force",), _at_sleeve),
        "zeroed": _from_start(lambda t, start: replace(t, force=t.force - start.force)),
    },
    "speeds": {"rad_s": _in_trace(SPEEDS, lambda _: 1.0 / RPM)},
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
        one = _parse(text)
        for other in found:
            if contradict(one, other):
                raise InputError(
                    f"the corrections {other} and {one} contradict each other; give one"
                )
        if one not in found:
            found.append(one)
    every = [Correction(quantity, way) for quantity in WAYS for way in (*WAYS[quantity], GIVEN)]
    return tuple(sorted(found, key=every.index))


def _parse(text: str) -> Correction:
    quantity, _, way = text.partition("=")
    if quantity not in WAYS:
        hint = did_you_mean(quantity, WAYS)
        raise InputError(f"the correction '{text}' is of no known quantity; {hint}")
    if way != GIVEN and way not in WAYS[quantity]:
        valid = ", ".join(f"{quantity}={known}" for known in (*WAYS[quantity], GIVEN))
        raise InputError(f"the correction '{text}' is not known; valid are {valid}")
    return Correction(quantity, way)


def corrected(sheet: Sheet, correction: Correction, sensor: Sensor) -> Sheet:
    """Make one correction in all rows of a sheet; ``given`` changes none."""
    change = WAYS[correction.quantity].get(correction.way)
    return sheet if change is None else change(sheet, sensor)
