"""Traces in LabVIEW's TDMS files, by npTDMS (extra ``tdms``).

Channels are named as the columns of a CSV trace. The times of a channel are the channel ``t_s`` of
its group, or else its waveform properties ``wf_start_time``, ``wf_start_offset`` and
``wf_increment``; a channel without these has the times of the displacement.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from dogshape.diagnosis.bench.time_axis import LEAD, TIME, Channel, Series
from dogshape.sim.errors import DataError, InputError, did_you_mean


def read_tdms(path: Path, names: Sequence[str]) -> dict[str, Channel]:
    """Read the channels called ``names`` of a TDMS file, in its units.

    Raises InputError without the extra, DataError where file or channels are not as they must be.
    """
    try:
        library = import_module("nptdms")
    except ImportError as error:
        raise InputError(
            f"npTDMS cannot be loaded ({error}), but a TDMS trace needs it; install it with: "
            "pip install -c constraints.txt '.[tdms]', or export the trace as CSV."
        ) from error
    try:
        file = library.TdmsFile.read(str(path))
    except (ValueError, KeyError, IndexError, EOFError, OSError, struct.error) as error:
        raise DataError(f"{path} is not a TDMS file: {error}; export the trace again") from error
    group = _group(path, file)
    lead, found = group[LEAD], {}
    for name in names:
        own = _group_of(path, file, group, name)
        values = _values(path, own[name])
        time = _values(path, own[TIME]) if TIME in own else _waveform(path, own[name], lead)
        if time.size != values.size:
            raise DataError(
                f"{path}, channel {name} has {values.size} samples and its time {time.size}, but "
                "both need the same; write the waveform properties of each channel"
            )
        found[name] = Channel(time, values, range(time.size))
    return found


def _group(path: Path, file: Any) -> Any:
    having = [group for group in file.groups() if LEAD in group]
    if len(having) == 1:
        return having[0]
    if having:
        names = ", ".join(f"'{group.name}'" for group in having)
        raise DataError(
            f"{path} has the channel {LEAD} in the groups {names}, but a trace is one shift; "
            "write a file for each shift"
        )
    channels = [channel.name for group in file.groups() for channel in group.channels()]
    raise DataError(
        f"{path} has no channel {LEAD}; name the channels as in a CSV trace "
        f"(in the file: {did_you_mean(LEAD, channels)})"
    )


def _group_of(path: Path, file: Any, group: Any, name: str) -> Any:
    """Find the group of a channel: that of the displacement, or else the only other one."""
    having = [group] if name in group else [one for one in file.groups() if name in one]
    if len(having) != 1:
        channels = [channel.name for channel in group.channels()]
        what = f"is in {len(having)} other groups; keep one" if having else "is missing; add it"
        raise DataError(
            f"{path}, group '{group.name}': the channel '{name}' {what} "
            f"(in the file: {did_you_mean(name, channels)})"
        )
    if (TIME in having[0]) != (TIME in group):
        raise DataError(
            f"{path} has a channel {TIME} in one of the groups '{group.name}' and "
            f"'{having[0].name}' only, so that their clocks cannot be compared; write it in both"
        )
    return having[0]


def _values(path: Path, channel: Any) -> Series:
    try:
        return np.asarray(channel[:], dtype=float)
    except (TypeError, ValueError) as error:
        raise DataError(
            f"{path}, channel {channel.name} does not hold numbers ({error}); write it as numbers"
        ) from error


def _waveform(path: Path, channel: Any, lead: Any) -> Series:
    """Return the times of a channel after the start time of the displacement, s, (n,)."""
    own = channel if "wf_increment" in channel.properties else lead
    starts = [one.properties.get("wf_start_time") for one in (own, lead)]
    if (starts[0] is None) != (starts[1] is None):
        raise DataError(
            f"{path} has wf_start_time on one of the channels {own.name} and {LEAD} only, so that "
            "their times cannot be compared; write it on both"
        )
    try:
        late = 0.0 if starts[0] is None else (starts[0] - starts[1]) / np.timedelta64(1, "s")
        return late + np.asarray(own.time_track(), dtype=float)
    except KeyError as error:
        raise DataError(
            f"{path} has neither a channel {TIME} nor the waveform properties wf_increment and "
            f"wf_start_offset on {own.name}; write one of them"
        ) from error
