"""Files of bench traces: CSV, LabVIEW's TDMS and ASAM's MDF, brought to one time axis.

Time zero is the start of the force. Other columns or channels than those of ``COLUMNS`` are not
read. In TDMS the times of a channel are the channel ``t_s`` of its group, or else its waveform
properties ``wf_start_time``, ``wf_start_offset`` and ``wf_increment``. In MDF each channel has the
times of its master, and a unit that it gives must be that of its name.

All channels are brought to the times of the displacement by linear interpolation where every
channel has samples. What was interpolated, cut or lost is said.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from dogshape.diagnosis.bench.foreign_cells import unit_named
from dogshape.diagnosis.bench.traces import BenchTrace, Series
from dogshape.sim.errors import DataError, InputError, did_you_mean, number, number_rule
from dogshape.sim.texts import read_table
from dogshape.sim.units import to_si

TIME = "t_s"
LEAD = "displacement_mm"  #: the channel whose times all others get
COLUMNS = (TIME, LEAD, "force_N", "sliding_speed_rpm", "output_speed_rpm")
SUFFIXES = (".mf4", ".mdf", ".dat")  #: of MDF files
LEAST = 10  #: samples that a trace must have
#: Share of the sample step within which times are equal: float32 masters differ by less.
ALIKE = 0.1
HOLE = 5.0  #: sample steps without a sample from which samples count as lost


@dataclass(frozen=True, eq=False)
class Channel:
    """Samples of a channel: times in s and values, each (n,), and their rows in the file."""

    time: Series
    values: Series
    rows: Sequence[int]

    @property
    def step(self) -> float:
        """Median time from sample to sample, s."""
        return float(np.median(np.diff(self.time)))


def read_trace(path: Path) -> BenchTrace:
    """Read a trace; every mistake raises DataError with file, row or channel, and remedy.

    InputError where the extra that reads the file is not installed.
    """
    if not path.is_file():
        raise DataError(f"there is no trace {path}; add the file, or leave the cell trace empty")
    suffix = path.suffix.lower()
    read = _read_tdms if suffix == ".tdms" else _read_mdf if suffix in SUFFIXES else _read_csv
    channels = read(path)
    for name in (LEAD, *(name for name in channels if name != LEAD)):
        _require_samples(path, name, channels[name])
    lead = channels[LEAD]
    margin = ALIKE * lead.step
    first = max(one.time[0] for one in channels.values()) - margin
    last = min(one.time[-1] for one in channels.values()) + margin
    time = lead.time[(lead.time >= first) & (lead.time <= last)]
    if time.size < LEAST:
        spans = ", ".join(
            f"{name} from {number(one.time[0])} to {number(one.time[-1])} s"
            for name, one in channels.items()
        )
        raise DataError(
            f"{path}: the channels have {time.size} samples of {LEAD} in common ({spans}), but a "
            f"trace needs at least {LEAST}; correct start times or rates, or export the whole shift"
        )
    table = {name: np.interp(time, one.time, one.values) for name, one in channels.items()}
    table[TIME] = time
    notes = tuple(_notes(channels, time, margin))
    return BenchTrace(path, *(to_si(name, 1.0) * table[name] for name in COLUMNS), notes=notes)


def _notes(channels: Mapping[str, Channel], time: Series, margin: float) -> list[str]:
    """List what was interpolated, cut and lost, in sentences."""
    lead = channels[LEAD]
    apart = [
        f"{name} ({one.time.size} samples, every {number(1e3 * one.step)} ms)"
        for name, one in channels.items()
        if one.time.shape != lead.time.shape or abs(one.time - lead.time).max() > margin
    ]
    notes = [f"{', '.join(apart)} interpolated on the times of {LEAD} (every "
             f"{number(1e3 * lead.step)} ms)"] if apart else []  # fmt: skip
    if time.size < lead.time.size:
        notes.append(
            f"{lead.time.size - time.size} of {lead.time.size} samples of {LEAD} cut, as not all "
            f"channels have values before {number(time[0])} or after {number(time[-1])} s"
        )
    for name, one in channels.items():
        place = int(np.argmax(np.diff(one.time)))
        low, high = one.time[place : place + 2]
        own = name == LEAD or not np.array_equal(one.time, lead.time)
        if own and high - low > HOLE * one.step:
            notes.append(f"{name} without a sample from {number(low)} to {number(high)} s")
    return notes


def _require_samples(path: Path, name: str, channel: Channel) -> None:
    """Raise DataError for values that are not finite, few samples, and time that does not grow."""
    time, rows = channel.time, channel.rows
    clock = f"column {TIME}" if name == LEAD else f"the time of {name}"
    for what, values in ((f"column {name}", channel.values), (clock, time)):
        if (bad := ~np.isfinite(values)).any():
            place = int(np.argmax(bad))
            raise DataError(
                f"{path}, row {rows[place]}, {what} is '{values[place]}', but it must be a finite "
                "number; correct the cell"
            )
    if time.size < (least := LEAST if name == LEAD else 2):
        raise DataError(
            f"{path} has {time.size} samples of {name}, but a trace needs at least {least}; export "
            "the whole shift"
        )
    if (back := np.diff(time) <= 0.0).any():
        place = int(np.argmax(back)) + 1
        raise DataError(
            f"{path}, row {rows[place]}, {clock} is '{time[place]:.15g}' after "
            f"'{time[place - 1]:.15g}', but time must grow from sample to sample; sort the trace "
            "and leave doubled samples out"
        )


def is_plain(text: str) -> bool:
    """Test that a text is a number as programs write it."""
    try:
        float(text)
    except ValueError:
        return False
    return True


def _read_csv(path: Path) -> dict[str, Channel]:
    """Read the columns of a CSV trace; a row without a value is no sample of that channel."""
    table = read_table(path, COLUMNS, COLUMNS)
    table.require(COLUMNS)
    lines, columns = [row for row, _ in table.rows], {name: table.column(name) for name in COLUMNS}
    for name, cells in columns.items():
        for row, cell in zip(lines, cells, strict=True):
            if not is_plain(cell) and (cell or name == TIME):
                raise DataError(
                    f"{path}, row {row}, column {name} is '{cell}', but it must "
                    f"be {number_rule(cell)}; correct the cell"
                )
    time, found = np.array(columns.pop(TIME), dtype=float), {}
    for name, cells in columns.items():
        places = [place for place, cell in enumerate(cells) if cell]
        values = np.array([cells[k] for k in places], dtype=float)
        found[name] = Channel(time[places], values, [lines[k] for k in places])
    return found


def _open(path: Path, module: str, reader: str, kind: str) -> Any:
    library, extra = {"asammdf": ("asammdf", "mdf"), "nptdms": ("npTDMS", "tdms")}[module]
    try:
        read: Any = import_module(module)
    except ImportError as error:
        raise InputError(
            f"{library} cannot be loaded ({error}), but {kind} trace needs it; install it with: "
            f"pip install -c constraints.txt '.[{extra}]', or export the trace as CSV."
        ) from error
    for name in reader.split("."):
        read = getattr(read, name)
    try:
        return read(str(path))
    except Exception as error:  # what it raises for foreign bytes depends on these bytes
        raise DataError(f"{path} is not {kind} file: {error}; export the trace again") from error


def _only(path: Path, name: str, groups: Sequence[Any], known: Iterable[str]) -> Any:
    """Give the only group that has a channel; else raise DataError."""
    if not groups:
        raise DataError(
            f"{path}: the channel '{name}' is missing; name the channels as in a CSV trace (in the "
            f"file: {did_you_mean(name, known)})"
        )
    if len(groups) > 1:
        raise DataError(
            f"{path} has the channel {name} in {len(groups)} groups, but a trace is one shift; "
            "write a file for each shift"
        )
    return groups[0]


def _as_numbers(path: Path, name: str, samples: Any) -> Series:
    try:
        return np.asarray(samples, dtype=float)
    except (TypeError, ValueError) as error:
        raise DataError(
            f"{path}, channel {name} does not hold numbers ({error}); write it as numbers"
        ) from error


def _read_mdf(path: Path) -> dict[str, Channel]:
    found = {}
    with _open(path, "asammdf", "MDF", "an MDF") as file:
        for name in COLUMNS[1:]:
            places = file.channels_db.get(name, ())
            group, index = _only(path, name, places, file.channels_db)
            signal = file.get(name, group=group, index=index).validate()
            unit = unit_named(signal.unit or "")
            if unit is not None and unit.factor != 1.0:
                raise DataError(
                    f"{path}, channel {name} is in '{signal.unit}', but its name says another "
                    "unit; convert it or name it by its unit"
                )
            time = np.asarray(signal.timestamps, dtype=float)
            found[name] = Channel(time, _as_numbers(path, name, signal.samples), range(time.size))
    return found


def _read_tdms(path: Path) -> dict[str, Channel]:
    file = _open(path, "nptdms", "TdmsFile.read", "a TDMS")
    known = [channel.name for group in file.groups() for channel in group.channels()]
    groups = {
        name: _only(path, name, [group for group in file.groups() if name in group], known)
        for name in COLUMNS[1:]
    }
    found, lead = {}, groups[LEAD]
    for name, group in groups.items():
        if (TIME in group) != (TIME in lead):
            raise DataError(
                f"{path} has a channel {TIME} in one of the groups '{lead.name}' and "
                f"'{group.name}' only, so that their clocks cannot be compared; write it in both"
            )
        values = _as_numbers(path, name, group[name][:])
        time = _waveform(path, group[name], lead[LEAD]) if TIME not in group else _as_numbers(
            path, TIME, group[TIME][:])  # fmt: skip
        if time.size != values.size:
            raise DataError(
                f"{path}, channel {name} has {values.size} samples and its time {time.size}, but "
                "both need the same; write the waveform properties of each channel"
            )
        found[name] = Channel(time, values, range(time.size))
    return found


def _waveform(path: Path, channel: Any, lead: Any) -> Series:
    """Return the times of a channel after the start time of the displacement, s, (n,)."""
    start, first = (one.properties.get("wf_start_time") for one in (channel, lead))
    if (start is None) != (first is None):
        raise DataError(
            f"{path} has wf_start_time on one of the channels {channel.name} and {LEAD} only, so "
            "that their times cannot be compared; write it on both"
        )
    try:
        late = 0.0 if start is None else (start - first) / np.timedelta64(1, "s")
        return late + np.asarray(channel.time_track(), dtype=float)
    except KeyError as error:
        raise DataError(
            f"{path} has neither a channel {TIME} nor the waveform properties wf_increment and "
            f"wf_start_offset on {channel.name}; write one of them"
        ) from error
