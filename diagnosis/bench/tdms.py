"""Traces in LabVIEW's TDMS files, by npTDMS (extra ``tdms``).

One group holds the channels, named as the columns of a CSV trace. Where it has no channel
``t_s``, the time comes from the waveform properties ``wf_increment`` and ``wf_start_offset``
of the displacement.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dogshape.sim.errors import DataError, InputError, did_you_mean

Series = NDArray[np.float64]

TIME = "t_s"
LEAD = "displacement_mm"  #: the channel that tells the group, and its time


def tdms_available() -> bool:
    """Test that npTDMS can be imported."""
    try:
        _nptdms()
    except InputError:
        return False
    return True


def _nptdms() -> Any:
    try:
        return import_module("nptdms")
    except ImportError as error:
        raise InputError(
            f"npTDMS cannot be loaded ({error}), but a TDMS trace needs it; install it with: "
            "pip install -c constraints.txt '.[tdms]', or export the trace as CSV."
        ) from error


def read_channels(path: Path, names: Sequence[str]) -> dict[str, Series]:
    """Return the channels called ``names`` of a TDMS file, each (n,), in its units.

    Raises InputError without the extra, DataError where file or channels are not as they
    must be.
    """
    library = _nptdms()
    try:
        file = library.TdmsFile.read(str(path))
    except (ValueError, KeyError, IndexError, EOFError, OSError, struct.error) as error:
        raise DataError(f"{path} is not a TDMS file: {error}; export the trace again") from error
    group = _group(path, file)
    found = {name: _channel(path, group, name) for name in names if name != TIME}
    found[TIME] = _time(path, group)
    size = found[LEAD].size
    for name, values in found.items():
        if values.size != size:
            raise DataError(
                f"{path}, channel {name} has {values.size} samples and {LEAD} {size}, but all "
                "need the same; record them at one rate, or resample them"
            )
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


def _channel(path: Path, group: Any, name: str) -> Series:
    if name not in group:
        channels = [channel.name for channel in group.channels()]
        raise DataError(
            f"{path}, group '{group.name}': the channel '{name}' is missing; add it "
            f"(in the file: {did_you_mean(name, channels)})"
        )
    try:
        return np.asarray(group[name][:], dtype=float)
    except (TypeError, ValueError) as error:
        raise DataError(
            f"{path}, channel {name} does not hold numbers ({error}); write it as numbers"
        ) from error


def _time(path: Path, group: Any) -> Series:
    if TIME in group:
        return _channel(path, group, TIME)
    try:
        return np.asarray(group[LEAD].time_track(), dtype=float)
    except KeyError as error:
        raise DataError(
            f"{path} has neither a channel {TIME} nor the waveform properties wf_increment and "
            f"wf_start_offset on {LEAD}; write one of them"
        ) from error
