"""Traces in MDF files of measurement systems (ASAM MDF 3 and 4), by asammdf (extra ``mdf``).

Channels are named as the columns of a CSV trace, whatever groups they stand in; each has the times
of its master. A unit that a channel gives must be that of its name.
"""

from __future__ import annotations

from collections.abc import Sequence
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from dogshape.diagnosis.bench.measured_units import unit_named
from dogshape.diagnosis.bench.time_axis import Channel, Series
from dogshape.sim.errors import DataError, InputError, did_you_mean

SUFFIXES = (".mf4", ".mdf", ".dat")


def read_mdf(path: Path, names: Sequence[str]) -> dict[str, Channel]:
    """Read the channels called ``names`` of an MDF file, without samples that are marked invalid.

    Raises InputError without the extra, DataError where file or channels are not as they must be.
    """
    try:
        library = import_module("asammdf")
    except ImportError as error:
        raise InputError(
            f"asammdf cannot be loaded ({error}), but an MDF trace needs it; install it with: "
            "pip install -c constraints.txt '.[mdf]', or export the trace as CSV."
        ) from error
    try:
        file = library.MDF(str(path))
    except Exception as error:  # what it raises for foreign bytes depends on these bytes
        raise DataError(f"{path} is not an MDF file: {error}; export the trace again") from error
    with file:
        signals = {name: _signal(path, file, name) for name in names}
    found = {}
    for name, signal in signals.items():
        time = np.asarray(signal.timestamps, dtype=float)
        found[name] = Channel(time, _values(path, name, signal), range(time.size))
    return found


def _signal(path: Path, file: Any, name: str) -> Any:
    places = file.channels_db.get(name, ())
    if not places:
        hint = did_you_mean(name, file.channels_db)
        raise DataError(
            f"{path}: the channel '{name}' is missing; name the channels as in a CSV trace (in the "
            f"file: {hint})"
        )
    if len(places) > 1:
        raise DataError(
            f"{path} has the channel {name} in {len(places)} groups, but a trace is one shift; "
            "write a file for each shift"
        )
    group, index = places[0]
    return file.get(name, group=group, index=index).validate()


def _values(path: Path, name: str, signal: Any) -> Series:
    unit = unit_named(signal.unit or "")
    if unit is not None and unit.factor != 1.0:
        raise DataError(
            f"{path}, channel {name} is in '{signal.unit}', but its name says another unit; "
            "convert it or name it by its unit"
        )
    try:
        return np.asarray(signal.samples, dtype=float)
    except (TypeError, ValueError) as error:
        raise DataError(
            f"{path}, channel {name} does not hold numbers ({error}); write it as numbers"
        ) from error
