r"""Samples of a channel: noise, and faults of the recording that its values or times show.

The noise follows from third differences: they remove what bends slowly, and white noise of the
standard deviation :math:`\sigma` leaves :math:`\sqrt{20}\,\sigma`. With a resolution *q* two
neighbours have equal readings with the probability :math:`p = q/(2\sqrt{\pi}\,\sigma)`, so that
of *n* samples a run of *k* equal ones is chance with :math:`n\,p^{k-1}` (``frozen_runs``).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from dogshape.sim.elementwise import Array
from dogshape.sim.errors import number
from dogshape.sim.units import MS, short

Mask = NDArray[np.bool_]
MIN_DROPOUT = 3  #: samples, shortest dropout; the median of three removes shorter ones
DROPOUT_NOISE = 4.0  #: scatters around zero within which a sample of a dropout lies
JUMP_NOISE = 20.0  #: scatters that the value jumps by at both ends of a dropout, at least
JUMP_SHARE = 0.1  #: of the range of the channel, the same
JUMP_LEVELS = 5.0  #: resolutions, the same
BEYOND_RANGE = 0.5  #: of the range of all other samples, distance of a code such as -999
MIN_NOISE_STEPS = 0.5  #: resolutions, noise below which equal neighbours say nothing
ALTERNATION = 0.5  #: share of third differences of alternating sign above which they are noise
WRAP_STEPS = 10.0  #: sample steps that a clock falls by where it wraps, at least
CHANCE = 1e-6  #: probability below which a run of equal samples is no chance
MIN_CHANGES = 10  #: changes of a held signal from which its own step is found
HELD_SHARE = 0.95  #: of its changes that lie on this step
ROUNDED_SHARE = 0.2  #: resolution of times over their step, above which the step varies visibly
MIN_ROUNDING_S = 2e-4  #: s, least resolution of times that is said
SHARED_TIMES = 0.1  #: share of samples with the time of the one before: rounded, not doubled


class Fault(NamedTuple):
    """Fault of a recording: a sentence, and its probable cause."""

    text: str
    cause: str


@dataclass(frozen=True, eq=False)
class Channel:
    """Samples of a channel: times in s and values, each (n,), and their rows in the file.

    ``faults`` tell which samples were left out and why; ``step`` is the sample step, s.
    """

    time: Array
    values: Array
    rows: Sequence[int]
    faults: tuple[Fault, ...] = ()

    @property
    def step(self) -> float:
        """Median time from sample to sample, s."""
        return step_of(self.time)

    def selected(self, selection: Mask | NDArray[np.int_], *faults: Fault) -> Channel:
        """Select samples; ``faults`` are the reasons for the others' absence."""
        places = np.arange(self.time.size)[selection]
        rows = [self.rows[place] for place in places.tolist()]
        return Channel(self.time[places], self.values[places], rows, (*self.faults, *faults))


def step_of(time: Array) -> float:
    """Compute the median time from sample to sample, s, of times (n,)."""
    return float(np.median(np.diff(time)))


def smoothed(values: Array) -> Array:
    """Compute the median of three neighbours, (n,)."""
    return median_filter(values, 3, mode="nearest")


def scatter(values: Array) -> float:
    """Estimate the standard deviation of the noise of samples from their third differences."""
    if values.size < 8:
        return 0.0
    return 1.48 * float(np.median(abs(np.diff(values, 3)))) / float(np.sqrt(20.0))


def equal_runs(marks: NDArray[np.generic]) -> list[tuple[int, int]]:
    """List runs of equal neighbours as first place and place after the last."""
    bounds = np.flatnonzero(marks[1:] != marks[:-1]) + 1
    edges = [0, *bounds.tolist(), marks.size]
    return list(pairwise(edges))


class ClockFault(NamedTuple):
    """Fault of a clock: the place of a sample whose time does not grow, cause, and remedy."""

    place: int
    cause: str
    remedy: str


def clock_fault(channel: Channel) -> ClockFault | None:
    """Find a sample whose time does not grow, and why; None where all times grow."""
    steps = np.diff(channel.time)
    if (steps > 0.0).all():
        return None
    place = int(np.argmax(steps <= 0.0)) + 1
    if (steps < 0.0).all():
        return ClockFault(place, "the trace runs backwards", "sort the rows by time")
    if (steps <= 0.0).all():
        return ClockFault(place, "the clock stands still", "export the trace with its clock")
    if (steps >= 0.0).all():
        return _shared_times(channel.time, place)
    return _falling_clock(channel, int(np.argmax(steps < 0.0)) + 1)


def _shared_times(time: Array, place: int) -> ClockFault:
    """Give the fault of a clock with samples that share a time."""
    rising = np.diff(time)[np.diff(time) > 0.0]
    if time.size - 1 - rising.size < SHARED_TIMES * time.size:
        return ClockFault(place, "two samples have one time", "keep the right one of them")
    own_step = float(np.ptp(time)) / (time.size - 1)
    cause = (
        f"the times are rounded to {number(float(np.median(rising)) / MS)} ms, as {time.size} "
        f"samples have {rising.size + 1} times and lie {short(own_step / MS, 2)} ms apart"
    )
    return ClockFault(place, cause, "export the times with more digits")


def _falling_clock(channel: Channel, place: int) -> ClockFault:
    """Give the fault of a clock that falls at ``place``: copy, second record, wrap, or order."""
    time, values = channel.time, channel.values
    steps = np.diff(time)
    step = float(np.median(steps[steps > 0.0]))
    last_time, next_time = float(time[place - 1]), float(time[place])
    size = min(time.size - place, place)
    if size >= MIN_CHANGES and np.array_equal(values[place : place + size], values[:size]):
        cause = "the samples from there on repeat those from the first on"
        return ClockFault(place, cause, "delete the copy")
    if (steps < 0.0).sum() > 1 and np.unique(time).size == time.size:
        return ClockFault(place, "the rows are not in the order of time", "sort the rows by time")
    if abs(next_time - time[0]) <= 2.0 * step:
        cause = "the clock starts again, as where two records stand one below the other"
        return ClockFault(place, cause, "write a file for each shift")
    if last_time - next_time < WRAP_STEPS * step:
        return ClockFault(place, "the rows are not in the order of time", "sort the rows by time")
    cause = f"the clock starts again, as a counter does that wraps after {number(last_time)} s"
    period = number(last_time - next_time + step)
    remedy = f"add {period} s to the times from there on, or export a clock that runs on"
    return ClockFault(place, cause, remedy)


def rounded_clock(time: Array) -> tuple[float, float] | None:
    """Find the resolution of times that grow in uneven steps only by rounding, and their step, s.

    None where they are even, or no resolution explains the unevenness.
    """
    places = np.arange(time.size)
    slope, level = np.polyfit(places, time - time[0], 1)
    error = float(abs(time - time[0] - level - slope * places).max())
    for resolution in (0.1, 1e-2, 1e-3, 1e-4):
        multiples = (time - time[0]) / resolution
        tolerance = 1e-6 * max(1.0, float(abs(multiples).max()))
        if abs(multiples - np.round(multiples)).max() > tolerance:
            continue
        uneven = 0.25 * resolution < error <= 0.75 * resolution
        visible = resolution >= max(MIN_ROUNDING_S, ROUNDED_SHARE * slope)
        return (resolution, float(slope)) if uneven and visible else None
    return None


def dropouts(values: Array) -> Mask:
    """Mark samples at zero, or at a code far outside, between jumps from and to other values.

    A dropout may last to the end of the record; zeros at its beginning are a signal at rest.
    """
    marks = np.zeros(values.size, dtype=bool)
    if values.size < 2 * MIN_DROPOUT:
        return marks
    noise = scatter(values)
    resolution = float(np.diff(np.unique(values)).min(initial=np.inf))
    least_jump = max(
        JUMP_NOISE * noise, JUMP_SHARE * float(np.ptp(values)), JUMP_LEVELS * resolution
    )
    labels = np.where(abs(values) <= DROPOUT_NOISE * noise, 0.0, values)
    for first, end in equal_runs(labels):
        level = float(labels[first])
        jumps = values[[first - 1, min(end, values.size - 1)]] - level
        to_end = end == values.size
        if end - first < MIN_DROPOUT or first == 0 or (to_end and values[-1] != values[-2]):
            continue
        if abs(jumps[0]) < least_jump or (not to_end and jumps[0] * jumps[1] <= 0.0):
            continue
        if not to_end and abs(jumps[1]) < least_jump:
            continue
        remaining_values = np.delete(values, slice(first, end))
        margin = BEYOND_RANGE * float(np.ptp(remaining_values))
        is_outside = not remaining_values.min() - margin <= level <= remaining_values.max() + margin
        marks[first:end] = level == 0.0 or is_outside
    return marks


def frozen_runs(values: Array) -> list[tuple[int, int]]:
    """List runs of equal samples that noise elsewhere does not leave to chance.

    Zeros are none: counters of pulses read zero at standstill, without noise.
    """
    if values.size < 2 * MIN_CHANGES:
        return []
    levels = np.unique(values)
    runs = equal_runs(values)
    longest = max(runs, key=lambda run: run[1] - run[0])
    other_samples = np.delete(values, slice(*longest))
    noise = scatter(other_samples)
    if levels.size < MIN_CHANGES or other_samples.size < MIN_CHANGES or not noise:
        return []
    resolution = float(np.diff(levels).min())
    third = np.diff(other_samples, 3)
    alternating = float((third[1:] * third[:-1] < 0.0).mean())
    if alternating < ALTERNATION or noise < MIN_NOISE_STEPS * resolution:
        return []
    equal = min(0.6, max(resolution / (2.0 * np.sqrt(np.pi) * noise), 1e-3))
    length = 1.0 + np.log(CHANCE / values.size) / np.log(equal)
    return [(first, end) for first, end in runs if end - first >= length and values[first]]


def held_step(values: Array) -> int:
    """Find how many times a channel repeats each of its values, 1 for a channel that does not."""
    changes = np.flatnonzero(np.diff(values)) + 1
    if changes.size < MIN_CHANGES:
        return 1
    sizes = abs(np.diff(values)[changes - 1])
    count = int(np.median(np.diff(changes)))
    # A slow rise in steps of the resolution changes by this step alone.
    if count < 2 or np.median(sizes) < 1.5 * sizes.min():
        return 1
    phase = np.bincount(changes % count, minlength=count)
    return count if phase.max() >= HELD_SHARE * changes.size else 1
