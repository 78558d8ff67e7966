"""One time axis for the channels of a trace, whatever start times and rates they have.

All channels are brought to the times of the displacement by linear interpolation, as npTDMS and
asammdf export them, where every channel has samples. Nothing is extrapolated: samples of the
displacement outside are cut. What was interpolated, cut or lost is said.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from dogshape.sim.errors import DataError, number

Series = NDArray[np.float64]

TIME = "t_s"
LEAD = "displacement_mm"  #: the channel whose times all others get
LEAST = 10  #: samples that a trace must have
ALIKE = (
    0.1  #: share of the sample step within which times are equal: float32 masters differ by less
)
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


def join_channels(
    path: Path, channels: Mapping[str, Channel]
) -> tuple[dict[str, Series], tuple[str, ...]]:
    """Interpolate channels on the times of the displacement.

    Returns
    -------
    The values of each channel and of ``t_s``, (n,), and sentences on what was interpolated, cut or
    lost. Raises DataError with file, row and remedy.
    """
    lead = channels[LEAD]
    for name in (LEAD, *(name for name in channels if name != LEAD)):
        _require_samples(path, name, channels[name])
    margin = ALIKE * lead.step
    first = max(one.time[0] for one in channels.values()) - margin
    last = min(one.time[-1] for one in channels.values()) + margin
    kept = (lead.time >= first) & (lead.time <= last)
    time = lead.time[kept]
    if time.size < LEAST:
        spans = ", ".join(
            f"{name} from {number(one.time[0])} to {number(one.time[-1])} s"
            for name, one in channels.items()
        )
        raise DataError(
            f"{path}: the channels have {time.size} samples of {LEAD} in common ({spans}), but a "
            f"trace needs at least {LEAST}; correct start times or rates, or export the whole shift"
        )
    found = {name: np.interp(time, one.time, one.values) for name, one in channels.items()}
    return {**found, TIME: time}, tuple(_notes(channels, time, margin))


def _notes(channels: Mapping[str, Channel], time: Series, margin: float) -> list[str]:
    """List what was interpolated, cut and lost, in sentences."""
    lead = channels[LEAD]
    apart = [
        f"{name} ({one.time.size} samples, every {number(1e3 * one.step)} ms)"
        for name, one in channels.items()
        if one.time.shape != lead.time.shape or abs(one.time - lead.time).max() > margin
    ]
    notes = []
    if apart:
        notes.append(
            f"{', '.join(apart)} interpolated on the times of {LEAD} (every "
            f"{number(1e3 * lead.step)} ms)"
        )
    if time.size < lead.time.size:
        notes.append(
            f"{lead.time.size - time.size} of {lead.time.size} samples of {LEAD} cut, as not all "
            f"channels have values before {number(time[0])} or after {number(time[-1])} s"
        )
    for name, one in channels.items():
        if name != LEAD and np.array_equal(one.time, lead.time):
            continue
        steps = np.diff(one.time)
        place = int(np.argmax(steps))
        if steps[place] > HOLE * one.step:
            ends = f"{number(one.time[place])} to {number(one.time[place + 1])} s"
            notes.append(f"{name} without a sample from {ends}")
    return notes


def _require_samples(path: Path, name: str, channel: Channel) -> None:
    """Raise DataError for values that are not finite, few samples, and time that does not grow."""
    time, rows = channel.time, channel.rows
    clock = f"column {TIME}" if name == LEAD else f"the time of {name}"
    for what, values in ((f"column {name}", channel.values), (clock, time)):
        bad = ~np.isfinite(values)
        if bad.any():
            place = int(np.argmax(bad))
            raise DataError(
                f"{path}, row {rows[place]}, {what} is '{values[place]}', but it must be a finite "
                "number; correct the cell"
            )
    least = LEAST if name == LEAD else 2
    if time.size < least:
        raise DataError(
            f"{path} has {time.size} samples of {name}, but a trace needs at least {least}; export "
            "the whole shift"
        )
    back = np.diff(time) <= 0.0
    if back.any():
        place = int(np.argmax(back)) + 1
        raise DataError(
            f"{path}, row {rows[place]}, {clock} is '{time[place]:.15g}' after "
            f"'{time[place - 1]:.15g}', but time must grow from sample to sample; sort the trace "
            "and leave doubled samples out"
        )
