"""Time series of bench shifts: their files, and one time axis for all channels.

A stand with an actuator may log its pressure or current in place of the force, which the static law
of the actuator then makes of it (``Actuator.logged_force``).

*Files* are CSV, LabVIEW's TDMS and ASAM's MDF (``docs/bench.md``); time zero is the start of the
force. All channels are brought to the times of the displacement by linear interpolation where every
channel has samples. Samples that are none (dropouts, invalid, repeated ones) are left out. What was
interpolated, cut or left out is said.
"""

from __future__ import annotations

import gc
import logging
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from importlib import import_module
from operator import attrgetter
from pathlib import Path
from typing import Any

import numpy as np

from dogshape.bench.cell_values import CURRENT, FORCE, LENGTH, PRESSURE, SPEED, unit_named
from dogshape.bench.cell_values import TIME as DURATION
from dogshape.bench.samples import (
    Channel,
    Fault,
    clock_fault,
    dropouts,
    frozen_runs,
    held_step,
    rounded_clock,
    scatter,
)
from dogshape.bench.texts import is_plain, read_table
from dogshape.sim.elementwise import Array
from dogshape.sim.errors import (
    DataError,
    DogshapeError,
    InputError,
    did_you_mean,
    number,
    number_rule,
)
from dogshape.sim.shift.actuators import LOGGED_KEYS, SECTION, Actuator, kinds_with
from dogshape.sim.units import MS, short, to_si


@dataclass(frozen=True, eq=False)
class LoggedChannel:
    """Pressure or current of an actuator over time, from which the force of a trace follows."""

    actuator: Actuator
    values: Array  #: Pa or A, (n,)

    @property
    def key(self) -> str:
        """Key of the channel."""
        return self.actuator.logged_key

    def force(self, displacement: Array) -> Array:
        """Compute the force at a displacement in m, N, (n,)."""
        return self.actuator.logged_force(self.values, displacement)


@dataclass(frozen=True, eq=False)
class BenchTrace:
    """Time series of one bench shift, each (n,), SI units, referred to the sleeve.

    ``notes`` say what was interpolated or cut, ``faults`` what is wrong with the recording and was
    left out; ``start_error`` is the standard error of time zero where it was found from the force,
    s; ``steps`` are the sample steps of channels that were interpolated, s. ``logged`` is the
    channel that made the force, None for a measured one.
    """

    path: Path
    time: Array
    displacement: Array
    force: Array
    sliding_speed: Array
    output_speed: Array
    notes: tuple[str, ...] = field(default=(), kw_only=True)
    faults: tuple[Fault, ...] = field(default=(), kw_only=True)
    steps: Mapping[str, float] = field(default_factory=dict, kw_only=True)
    start_error: float = field(default=0.0, kw_only=True)
    logged: LoggedChannel | None = field(default=None, kw_only=True)

    @property
    def signal(self) -> Array:
        """Channel that rises first in a shift: what is logged of an actuator, or the force."""
        return self.force if self.logged is None else self.logged.values

    def with_logged_force(self) -> BenchTrace:
        """Recompute the force from the logged channel; a measured force stays."""
        if self.logged is None:
            return self
        return replace(self, force=self.logged.force(self.displacement))


TIME = "t_s"
LEAD = "displacement_mm"  #: the channel whose times all others get
FORCE_CHANNEL = "force_N"
COLUMNS = (TIME, LEAD, FORCE_CHANNEL, "sliding_speed_rpm", "output_speed_rpm")
MIN_SAMPLES = 10  #: samples that a trace must have
MAX_DROPOUT = 1.0 / 3.0  #: share of a channel's samples at most that dropouts may take
#: Share of the sample step within which times are equal: float32 masters differ by less.
CLOCK_TOLERANCE = 0.1
HOLE = 5.0  #: sample steps without a sample from which samples count as lost
DIMENSIONS = {
    TIME: DURATION,
    LEAD: LENGTH,
    FORCE_CHANNEL: FORCE,
    COLUMNS[3]: SPEED,
    COLUMNS[4]: SPEED,
    "pressure_bar": PRESSURE,
    "current_A": CURRENT,
}
#: Units of the project's files.
OWN_UNITS = {
    DURATION: "s",
    LENGTH: "mm",
    FORCE: "N",
    SPEED: "1/min",
    PRESSURE: "bar",
    CURRENT: "A",
}
#: Properties of a TDMS channel that name its unit, in lower case.
UNIT_PROPERTIES = ("unit_string", "unit", "units", "ni_unitdescription", "unit_description")
TIME_MASTER = 1  #: kind of an MDF master that counts time; others count angle, distance or samples
Reader = Callable[[Path, Actuator | None], dict[str, Channel]]  #: of the channels of a file
MAGIC = {"TDMS": (b"TDSm",), "MDF": (b"MDF ", b"UnFinMF")}  #: first bytes of the files


def read_trace(path: Path, actuator: Actuator | None = None) -> BenchTrace:
    """Read a trace; every mistake raises DataError with file, row or channel, and remedy.

    ``actuator`` of the stand makes the force of a logged channel. InputError where the extra that
    reads the file is not installed.
    """
    if not path.is_file():
        raise DataError(f"there is no trace {path}; add the file, or leave the cell trace empty")
    read = READERS.get(path.suffix.lower(), _read_csv)(path, actuator)
    channels = {name: _examined(path, name, channel) for name, channel in read.items()}
    lead = channels[LEAD]
    margin = CLOCK_TOLERANCE * lead.step
    first = max(channel.time[0] for channel in channels.values()) - margin
    last = min(channel.time[-1] for channel in channels.values()) + margin
    time = lead.time[(lead.time >= first) & (lead.time <= last)]
    if time.size < MIN_SAMPLES:
        spans = ", ".join(
            f"{name} from {number(channel.time[0])} to {number(channel.time[-1])} s"
            for name, channel in channels.items()
        )
        raise DataError(
            f"{path}: the channels have {time.size} samples of {LEAD} in common ({spans}), but a "
            f"trace needs at least {MIN_SAMPLES}; correct start times or rates, or export the "
            "whole shift"
        )
    table = {
        name: np.interp(time, channel.time, channel.values) for name, channel in channels.items()
    }
    table[TIME] = time
    logged = None
    if actuator is not None and FORCE_CHANNEL not in table:
        key = actuator.logged_key
        logged = LoggedChannel(actuator, to_si(key, 1.0) * table[key])
        table[FORCE_CHANNEL] = logged.force(to_si(LEAD, 1.0) * table[LEAD])
    coarse = [name for name, channel in channels.items() if channel.step > lead.step + margin]
    return BenchTrace(
        path,
        *(to_si(name, 1.0) * table[name] for name in COLUMNS),
        notes=tuple(_notes(channels, time, margin)),
        faults=tuple(dict.fromkeys(f for channel in channels.values() for f in channel.faults)),
        steps={name: channels[name].step for name in coarse},
        logged=logged,
    )


def _columns_of(path: Path, names: Iterable[str], actuator: Actuator | None) -> tuple[str, ...]:
    """List the columns of a trace with these names, the logged one where the force is not there.

    Raises DataError for a logged channel of another actuator.
    """
    present = set(names)
    logged = [name for name in LOGGED_KEYS if name in present]
    if FORCE_CHANNEL in present or not logged:
        return COLUMNS
    if actuator is None or actuator.logged_key not in logged:
        stand = "has none" if actuator is None else f"has a {actuator.kind} one"
        raise DataError(
            f"{path} has {logged[0]} in place of {FORCE_CHANNEL}, whose force follows from an "
            f"actuator (kind = {kinds_with(logged[0])}), but the stand {stand}; state [{SECTION}] "
            f"of bench.toml, or give {FORCE_CHANNEL}"
        )
    return tuple(actuator.logged_key if name == FORCE_CHANNEL else name for name in COLUMNS)


def _notes(channels: Mapping[str, Channel], time: Array, margin: float) -> list[str]:
    """List sentences on interpolated, cut and lost samples."""
    lead = channels[LEAD]
    interpolated = [
        f"{name} ({channel.time.size} samples, every {number(channel.step / MS)} ms)"
        for name, channel in channels.items()
        if abs(channel.step - lead.step) > margin or _distance(time, channel.time) > margin
    ]
    notes = (
        [
            f"{', '.join(interpolated)} interpolated on the times of {LEAD} (every "
            f"{number(lead.step / MS)} ms)"
        ]
        if interpolated
        else []
    )
    if time.size < lead.time.size:
        notes.append(
            f"{lead.time.size - time.size} of {lead.time.size} samples of {LEAD} cut, as not all "
            f"channels have values before {number(time[0])} or after {number(time[-1])} s"
        )
    for name, channel in channels.items():
        place = int(np.argmax(np.diff(channel.time)))
        low, high = channel.time[place : place + 2]
        has_own_clock = name == LEAD or not np.array_equal(channel.time, lead.time)
        if has_own_clock and high - low > HOLE * channel.step:
            notes.append(f"{name} without a sample from {number(low)} to {number(high)} s")
    return notes


def _distance(time: Array, samples: Array) -> float:
    """Compute the largest distance from a time to its nearest sample, s."""
    places = np.clip(np.searchsorted(samples, time), 1, samples.size - 1)
    nearest = np.minimum(abs(samples[places] - time), abs(time - samples[places - 1]))
    return float(nearest.max())


def _clock_name(name: str) -> str:
    """Name the times of a channel in messages."""
    return f"column {TIME}" if name == LEAD else f"the time of {name}"


def _examined(path: Path, name: str, channel: Channel) -> Channel:
    """Leave out samples that are none, and name faults of the recording.

    Raises DataError for values that are not finite, few samples, and time that does not grow.
    """
    _require_samples(path, name, channel)
    time, values = channel.time, channel.values
    clock = _clock_name(name)
    is_still = np.append(False, np.diff(time) == 0.0)
    doubled = is_still & np.append(False, np.diff(values) == 0.0)
    if doubled.any() and (doubled == is_still).all() and (np.diff(time[~doubled]) > 0.0).all():
        row = channel.rows[int(doubled.argmax())]
        text = f"{doubled.sum()} of {time.size} samples are there twice (row {row}) and left out"
        channel = channel.selected(~doubled, Fault(text, "samples that were written twice"))
    if stop := clock_fault(channel):
        place, cause, remedy = stop
        raise DataError(
            f"{path}, row {channel.rows[place]}, {clock} is '{channel.time[place]:.15g}' after "
            f"'{channel.time[place - 1]:.15g}', but time must grow from sample to sample; {cause}; "
            f"{remedy}"
        )
    if name == LEAD and (rounded := rounded_clock(channel.time)):
        resolution, step = rounded
        text = (
            f"{TIME} is rounded to {number(resolution / MS)} ms, but the samples lie "
            f"{short(step / MS, 3)} ms apart, so that times err by up to "
            f"{number(0.5 * resolution / MS)} ms"
        )
        fault = Fault(text, "an export with too few digits")
        channel = replace(channel, faults=(*channel.faults, fault))
    return _without_faults(path, name, channel)


def _without_faults(path: Path, name: str, channel: Channel) -> Channel:
    """Leave out dropouts and repeated values, and name values that stand still."""
    time, values = channel.time, channel.values
    is_lost = dropouts(values)
    if is_lost.any():
        level = values[is_lost][abs(values[is_lost]).argmax()]
        level = level if abs(level) > abs(values[~is_lost]).max() else 0.0
        text = (
            f"{is_lost.sum()} of {time.size} samples of {name} lie at {number(level)} between "
            f"{number(time[is_lost][0])} and {number(time[is_lost][-1])} s, between values far "
            "from it"
        )
        if is_lost.sum() > MAX_DROPOUT * time.size:
            raise DataError(f"{path}: {text}; mend sensor or cable, and measure the shift again")
        fault = Fault(f"{text}, and are left out", "dropouts of the sensor or its cable")
        channel = channel.selected(~is_lost, fault)
    if (count := held_step(channel.values)) > 1:
        first = int(np.flatnonzero(np.diff(channel.values))[0] + 1) % count
        places = np.arange(first, channel.values.size, count)
        text = f"{name} repeats each value {count} times, of which the first is kept"
        channel = channel.selected(places, Fault(text, "a recorder faster than the sensor"))
    faults = []
    for first, end in frozen_runs(channel.values):
        value, low, high = channel.values[first], channel.time[first], channel.time[end - 1]
        extreme = {channel.values.max(): "largest", channel.values.min(): "smallest"}.get(value)
        is_extreme = f", its {extreme} value," if extreme else ""
        noise = short(scatter(np.delete(channel.values, slice(first, end))), 2)
        text = (
            f"{name} stands at {number(value)}{is_extreme} from {number(low)} to {number(high)} s "
            f"({end - first} samples), but scatters by {noise} elsewhere"
        )
        cause = "a sensor that hangs"
        if extreme:
            cause = "a sensor or amplifier at the end of its range"
        faults.append(Fault(text, cause))
    return replace(channel, faults=(*channel.faults, *faults))


def _require_samples(path: Path, name: str, channel: Channel) -> None:
    """Raise DataError for values that are not finite, and for few samples."""
    time = channel.time
    clock = _clock_name(name)
    for place_name, values in ((f"column {name}", channel.values), (clock, time)):
        for place in np.flatnonzero(~np.isfinite(values)).tolist():
            raise bad_cell(path, channel.rows[place], place_name, values[place], "a finite number")
    min_samples = MIN_SAMPLES if name == LEAD else 2
    if time.size < min_samples:
        spacing = f"they lie {number(channel.step / MS)} ms apart: " if time.size > 1 else ""
        raise DataError(
            f"{path} has {time.size} samples of {name}, but a trace needs at least {min_samples}; "
            f"{spacing}sample faster, or export the whole shift"
        )


def bad_cell(path: Path, row: int, place: str, value: object, rule: str) -> DataError:
    """Return the error of one cell of a table: file, row, column, value, rule and remedy."""
    return DataError(
        f"{path}, row {row}, {place} is '{value}', but it must be {rule}; correct the cell"
    )


def _read_csv(path: Path, actuator: Actuator | None) -> dict[str, Channel]:
    """Read the columns of a CSV trace; a row without a value is no sample of that channel."""
    known = (*COLUMNS, *LOGGED_KEYS)
    table = read_table(path, known, known)
    names = _columns_of(path, table.head, actuator)
    table.require(names)
    lines, columns = [row for row, _ in table.rows], {name: table.column(name) for name in names}
    for name, cells in columns.items():
        for row, cell in zip(lines, cells, strict=True):
            if not is_plain(cell) and (cell or name == TIME):
                raise bad_cell(path, row, f"column {name}", cell, number_rule(cell))
    time, channels = np.array(columns.pop(TIME), dtype=float), {}
    for name, cells in columns.items():
        places = [place for place, cell in enumerate(cells) if cell]
        values = np.array([cells[k] for k in places], dtype=float)
        channels[name] = Channel(time[places], values, [lines[k] for k in places])
    return channels


def _reader(library: str, name: str, kind: str, extra: str) -> Any:
    """Load the class or function that reads a kind of file; InputError without the library."""
    try:
        return attrgetter(name)(import_module(library.lower()))
    except ImportError as error:
        raise InputError(
            f"{library} cannot be loaded ({error}), but {kind} trace needs it; install it with: "
            f"pip install -c constraints.txt '.[{extra}]', or export the trace as CSV"
        ) from error


def _undamaged(path: Path, kind: str, read: Reader, actuator: Actuator | None) -> Any:
    """Read a file; raise DataError for any error of its library."""
    hook = sys.unraisablehook
    try:
        return read(path, actuator)
    except DogshapeError:
        raise
    except Exception as error:
        reason = str(error)
        # A reader that was never whole may fail once more as it is deleted, which is to be silent.
        sys.unraisablehook = lambda _: None
        error.__traceback__ = None
    gc.collect()
    sys.unraisablehook = hook
    article = "an" if kind == "MDF" else "a"
    fault = f"is not {article} {kind} file: {reason}; export the trace again"
    with path.open("rb") as file:
        if file.read(8).startswith(MAGIC[kind]):
            fault = f"is damaged or cut short ({reason}); copy or export the trace again"
    raise DataError(f"{path} {fault}")


def _only(path: Path, name: str, groups: Sequence[Any], channel_names: Iterable[str]) -> Any:
    """Give the only group that has a channel; else raise DataError."""
    if not groups:
        raise DataError(
            f"{path}: the channel '{name}' is missing; name the channels as in a CSV trace (in the "
            f"file: {did_you_mean(name, channel_names)})"
        )
    if len(groups) > 1:
        raise DataError(
            f"{path} has the channel {name} in {len(groups)} groups, but a trace is one shift; "
            "write a file for each shift"
        )
    return groups[0]


def _as_numbers(path: Path, name: str, samples: Any) -> Array:
    kind = np.asarray(samples).dtype.kind
    try:
        if kind in "Mm":
            raise TypeError("dates")
        return np.asarray(samples, dtype=float)
    except (TypeError, ValueError) as error:
        raise DataError(
            f"{path}, channel {name} does not hold numbers ({error}); write it as numbers"
        ) from error


def _require_unit(path: Path, name: str, text: str) -> None:
    """Raise DataError for a unit beside a channel that is not the one of its name."""
    if not (spelling := str(text).strip()):
        return
    unit, unit_of_name = unit_named(spelling), OWN_UNITS[DIMENSIONS[name]]
    if unit is not None and unit.dimension == DIMENSIONS[name] and unit.factor == 1.0:
        return
    fault = "but its name says another unit"
    if unit is None or unit.dimension != DIMENSIONS[name]:
        fault = f"which is no known unit of {DIMENSIONS[name]}"
    elif np.isnan(unit.factor):
        fault = "which may be revolutions or radians a second"
    raise DataError(
        f"{path}, channel {name} is in '{spelling}', {fault}; convert the channel to "
        f"{unit_of_name}, or export the trace as CSV with the unit in the name"
    )


def _read_mdf(path: Path, actuator: Actuator | None) -> dict[str, Channel]:
    """Read the channels of an MDF file with the times of their masters."""
    open_file = _reader("asammdf", "MDF", "an MDF", "mdf")
    channels = {}
    with open_file(str(path)) as file:
        for name in _columns_of(path, file.channels_db, actuator)[1:]:
            group, index = _only(path, name, file.channels_db.get(name, ()), file.channels_db)
            recorded = file.get(name, group=group, index=index, ignore_invalidation_bits=True)
            signal = file.get(name, group=group, index=index).validate()
            _require_unit(path, name, signal.unit or "")
            master, kind = signal.master_metadata or (TIME, TIME_MASTER)
            if kind > TIME_MASTER:
                raise DataError(
                    f"{path}, channel {name} is recorded over '{master}' and not over time; export "
                    "it with a time master"
                )
            count, total = len(signal.samples), len(recorded.samples)
            text = f"{total - count} of {total} samples of {name} are marked invalid and left out"
            faults = (Fault(text, "a sensor or bus without a signal"),) if count < total else ()
            if total > count == 0:
                raise DataError(
                    f"{path}: all {total} samples of {name} are marked invalid; "
                    "measure the shift again"
                )
            time = np.asarray(signal.timestamps, dtype=float)
            values = _as_numbers(path, name, signal.samples)
            channels[name] = Channel(time, values, range(time.size), faults)
    return channels


class _Warnings(logging.Handler):
    """Collect the warnings of a library instead of printing them."""

    def __init__(self) -> None:
        super().__init__(logging.WARNING)
        self.texts: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        self.texts.append(record.getMessage())


@contextmanager
def _collected_warnings(library: str) -> Iterator[list[str]]:
    """Collect the warnings that a library logs."""
    handler = _Warnings()
    names = [name for name in logging.root.manager.loggerDict if name.split(".")[0] == library]
    loggers = [logging.getLogger(name) for name in names]
    states = [(logger, logger.handlers, logger.propagate) for logger in loggers]
    for logger in loggers:
        logger.handlers, logger.propagate = [handler], False
    try:
        yield handler.texts
    finally:
        for logger, handlers, propagate in states:
            logger.handlers, logger.propagate = handlers, propagate


def _read_tdms(path: Path, actuator: Actuator | None) -> dict[str, Channel]:
    """Read the channels of a TDMS file with the times of their groups or waveforms."""
    read = _reader("npTDMS", "TdmsFile.read", "a TDMS", "tdms")
    with _collected_warnings("nptdms") as texts:
        file = read(str(path))
        channel_names = [channel.name for group in file.groups() for channel in group.channels()]
        if not channel_names:
            raise DataError(f"{path} has no channel: it is empty or cut short; copy the file again")
        groups = {
            name: _only(path, name, [g for g in file.groups() if name in g], channel_names)
            for name in _columns_of(path, channel_names, actuator)[1:]
        }
        sizes = {name: len(group[name]) for name, group in groups.items()}
        faults = _cut_short(path, sizes) if any("less data" in text for text in texts) else ()
        return {
            name: _tdms_channel(path, name, group, groups[LEAD], faults)
            for name, group in groups.items()
        }


def _cut_short(path: Path, sizes: Mapping[str, int]) -> tuple[Fault, ...]:
    """Give the fault of a file that is cut short; DataError where too little of it is there."""
    counts = ", ".join(f"{name} {size}" for name, size in sizes.items())
    if min(sizes.values()) < MIN_SAMPLES:
        raise DataError(
            f"{path} is cut short: of its samples there are {counts}; copy the file again"
        )
    text = f"the file is cut short, its last samples are lost (there are {counts})"
    return (Fault(text, "a copy or a recording that was interrupted"),)


def _require_units(path: Path, name: str, channel: Any) -> None:
    """Raise DataError for a unit property of a TDMS channel that contradicts its name."""
    for key, text in channel.properties.items():
        if key.lower() in UNIT_PROPERTIES:
            _require_unit(path, name, text)


def _tdms_channel(
    path: Path, name: str, group: Any, lead: Any, faults: tuple[Fault, ...]
) -> Channel:
    """Read a channel of a TDMS group with its times; ``lead`` is the displacement's group."""
    if (TIME in group) != (TIME in lead):
        raise DataError(
            f"{path} has a channel {TIME} in one of the groups '{lead.name}' and "
            f"'{group.name}' only, so that their clocks cannot be compared; write it in both"
        )
    channel = group[name]
    _require_units(path, name, channel)
    values = _as_numbers(path, name, channel[:])
    if TIME not in group:
        time = _waveform(path, channel, lead[LEAD])
    else:
        stamps, first = group[TIME][:], lead[TIME][:1]
        if getattr(stamps, "dtype", np.dtype(float)).kind == "M" and len(first):
            time = (stamps - first[0]) / np.timedelta64(1, "s")
            text = f"{TIME} holds dates, and its seconds count from the first, {first[0]}"
            faults = (*faults, Fault(text, "a clock that does not start with the force"))
        else:
            _require_units(path, TIME, group[TIME])
            time = _as_numbers(path, TIME, stamps)
    size = min(time.size, values.size)
    if time.size != values.size and not faults:
        raise DataError(
            f"{path}, channel {name} has {values.size} samples and its time {time.size}, but "
            "both need the same; write the waveform properties of each channel"
        )
    return Channel(time[:size], values[:size], range(size), faults)


def _waveform(path: Path, channel: Any, lead: Any) -> Array:
    """Return the times of a channel after the start time of the displacement, s, (n,)."""
    start, first = (waveform.properties.get("wf_start_time") for waveform in (channel, lead))
    if (start is None) != (first is None):
        raise DataError(
            f"{path} has wf_start_time on one of the channels {channel.name} and {LEAD} only, so "
            "that their times cannot be compared; write it on both"
        )
    try:
        delay = 0.0 if start is None else (start - first) / np.timedelta64(1, "s")
        return delay + np.asarray(channel.time_track(), dtype=float)
    except KeyError as error:
        raise DataError(
            f"{path} has neither a channel {TIME} nor the waveform properties wf_increment and "
            f"wf_start_offset on {channel.name}; write one of them"
        ) from error


#: Readers of the files that are no CSV, by their suffixes.
READERS: dict[str, Reader] = {
    ".tdms": lambda path, actuator: _undamaged(path, "TDMS", _read_tdms, actuator),
    **dict.fromkeys(
        (".mf4", ".mdf", ".dat"),
        lambda path, actuator: _undamaged(path, "MDF", _read_mdf, actuator),
    ),
}
