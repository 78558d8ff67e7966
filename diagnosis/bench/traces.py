r"""Time series of bench shifts: their files, the start of the force, readings at rest before it.

Noise, an offset of the sensor and the slow beginning of a cubic rise hide the first instant of the
force. So a curve is fitted to the samples up to a share of the rise: a level at rest,
:math:`F_0`, up to the start :math:`t_0`, and from there one of three shapes of :math:`t - t_0`,

- the nominal cubic step, :math:`k\,(\tau^2 - 2\tau^3/3T)` with the rise time *T* of the shift,
- a slower beginning, :math:`k_2\tau^2 + k_3\tau^3`, as a lag makes it,
- a ramp or a jump, :math:`k_1\tau + k_2\tau^2`.

Another shape than the nominal one is taken where the Bayesian information criterion prefers it
clearly. The scale of the force is free, so its unit does not matter.

*Files* are CSV, LabVIEW's TDMS and ASAM's MDF (``docs/bench.md``); time zero is the start of the
force. All channels are brought to the times of the displacement by linear interpolation where every
channel has samples. What was interpolated, cut or lost is said.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from importlib import import_module
from operator import attrgetter
from pathlib import Path
from typing import Any

import numpy as np
from scipy.ndimage import median_filter

from dogshape.diagnosis.bench.cell_values import unit_named
from dogshape.diagnosis.terms import Array
from dogshape.sim.errors import DataError, InputError, did_you_mean, number, number_rule
from dogshape.sim.texts import is_plain, read_table
from dogshape.sim.units import to_si


@dataclass(frozen=True, eq=False)
class BenchTrace:
    """Time series of one bench shift, each (n,), SI units, referred to the sleeve.

    ``notes`` say what was interpolated, cut or lost; ``start_error`` is the standard error of time
    zero where it was found from the force, s.
    """

    path: Path
    time: Array
    displacement: Array
    force: Array
    sliding_speed: Array
    output_speed: Array
    notes: tuple[str, ...] = field(default=(), kw_only=True)
    start_error: float = field(default=0.0, kw_only=True)


#: Force above rest that is seen as a rise, of the largest: above the hum and drift of load cells.
THRESHOLD = 0.05
CLEAR = 4.0  #: scatters, the same at least: by chance a median of three passes once in 10^8
RISEN = 0.8  #: of the largest force, up to which the rise is fitted: below plateau and corner
#: Advantage in the information criterion from which another shape is taken (Kass, Raftery 1995).
EVIDENCE = 10.0
Shape = Callable[[Array], list[Array]]  #: columns of a fit from times after the start

FREE, ARRIVED = 0.2, 0.9  #: shares of the displacement: nothing touches before, and end of travel
FIRST = 5  #: first samples, which are taken as being at rest where nothing else says it
SEARCHED = 4.0  #: how far before the threshold the start may be, in lengths of the fitted rise
RESTED = 10  #: how many samples at rest are fitted at most, in those of the fitted rise
FITTED = 4  #: least samples of a rise that is fitted; of a jump the middle of a step is taken
GRID, PASSES = 24, 4  #: starts that are tried at a time, each time closer to each other


@dataclass(frozen=True)
class ForceStart:
    """Start of the force, s, its standard error, and readings at rest, N and m."""

    time: float
    error: float
    force: float
    displacement: float


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


@lru_cache(maxsize=512)
def find_force_start(trace: BenchTrace, rise: float) -> ForceStart | None:
    """Find the start of the force in a trace; ``rise`` is its nominal rise time in s.

    Returns None where no rise stands out from the noise.
    """
    size = _undisturbed(trace)
    time, force = trace.time[:size], trace.force[:size]
    smooth, rest = smoothed(force), float(np.median(force[:FIRST]))
    top = float(smooth.max()) - rest
    least = max(THRESHOLD * top, CLEAR * scatter(force))
    # From the rise backwards: hum and bursts before it may pass the threshold too.
    end = int(np.argmax(smooth >= rest + RISEN * top)) + 1
    below = np.flatnonzero(smooth[:end] < rest + least)
    if top < 2.0 * least or not below.size:
        return None
    place = min(int(below[-1]) + 1, end - 1)
    begin = max(0, place - RESTED * (end - place))
    start, error, level = float(time[place]) - 0.5 * step_of(trace.time), 0.0, rest
    if end - place >= FITTED:
        start, error, level = _fit_start(time[begin:end], force[begin:end], place - begin, rise)
    still = trace.displacement[: max(FIRST, int(np.searchsorted(trace.time, start)))]
    # Between two samples a jump may be anywhere.
    error = float(np.hypot(error, step_of(trace.time) / np.sqrt(12.0)))
    return ForceStart(start, error, level, float(np.median(still)))


def _fit_start(time: Array, force: Array, place: int, rise: float) -> tuple[float, float, float]:
    span = float(time[-1] - time[place])
    # Times in lengths of the fitted rise keep the fit well conditioned.
    scaled, full = (time - time[place]) / span, max(rise / span, 1.0 / time.size)
    shapes: tuple[Shape, ...] = (
        lambda tau: [(1.0 - np.minimum(tau, full) / (1.5 * full)) * np.minimum(tau, full) ** 2],
        lambda tau: [tau**2, tau**3],
        lambda tau: [tau, tau**2],
    )
    # A record that begins after time zero may begin after the force, as the nominal rise tells.
    early = min(float(time[0]), max(0.0, float(time[0]) - rise))
    lows = ((early - float(time[place])) / span, float(scaled[0]), float(scaled[0]))
    fits = [_fit(scaled, force, shape, low) for shape, low in zip(shapes, lows, strict=True)]
    best = min(fits)
    _, start, error, level = best if best[0] < fits[0][0] - EVIDENCE else fits[0]
    return float(time[place]) + span * start, span * error, level


def _undisturbed(trace: BenchTrace) -> int:
    """Count the samples whose force no contact disturbs.

    Where the force falls, these are the samples before the first touch; before the end of travel,
    where it falls later (release, seating).
    """
    way, force = smoothed(trace.displacement), smoothed(trace.force)
    least = max(THRESHOLD * np.ptp(force), 2.0 * CLEAR * scatter(trace.force))
    fallen = np.maximum.accumulate(force) - force > least
    if not fallen.any():
        return way.size
    rest = float(np.median(way[:FIRST]))
    touched, arrived = (
        int(np.argmax(way >= rest + share * (way.max() - rest))) for share in (FREE, ARRIVED)
    )
    return max(2 * FIRST, touched if np.argmax(fallen) < arrived else arrived)


def _fit(time: Array, force: Array, shape: Shape, low: float) -> tuple[float, float, float, float]:
    """Fit a shape that starts after ``low``: information criterion, start and its standard error,
    and force at rest.
    """

    def columns(starts: Array) -> Array:
        tau = np.maximum(0.0, time - starts[:, None])
        return np.stack([np.ones_like(tau), *shape(tau)], axis=-1)

    def solved(matrix: Array) -> tuple[Array, Array]:
        turned = matrix.swapaxes(1, 2)
        found = np.linalg.pinv(turned @ matrix) @ (turned @ force)[..., None]
        return found, ((force - (matrix @ found)[..., 0]) ** 2).sum(axis=1)

    low, high = max(low, -SEARCHED), 0.0
    for _ in range(PASSES):
        starts = np.linspace(low, high, GRID)
        place = int(np.argmin(solved(columns(starts))[1]))
        low, high = float(starts[max(0, place - 1)]), float(starts[min(GRID - 1, place + 1)])
    start, near = float(starts[place]), 1e-4
    matrix = columns(np.array([start, start - near, start + near]))
    found, left = solved(matrix[:1])
    whole = np.column_stack([matrix[0], (matrix[2] - matrix[1]) @ found[0] / (2.0 * near)])
    squares, size = max(float(left[0]), 1e-300), time.size
    inverse = np.linalg.pinv(whole.T @ whole)[-1, -1]
    error = float(np.sqrt(squares / max(1, size - whole.shape[1]) * max(0.0, inverse)))
    score = size * np.log(squares / size) + whole.shape[1] * np.log(size)
    return float(score), start, error, float(found[0, 0, 0])


TIME = "t_s"
LEAD = "displacement_mm"  #: the channel whose times all others get
COLUMNS = (TIME, LEAD, "force_N", "sliding_speed_rpm", "output_speed_rpm")
LEAST = 10  #: samples that a trace must have
#: Share of the sample step within which times are equal: float32 masters differ by less.
ALIKE = 0.1
HOLE = 5.0  #: sample steps without a sample from which samples count as lost


@dataclass(frozen=True, eq=False)
class Channel:
    """Samples of a channel: times in s and values, each (n,), and their rows in the file."""

    time: Array
    values: Array
    rows: Sequence[int]


def read_trace(path: Path) -> BenchTrace:
    """Read a trace; every mistake raises DataError with file, row or channel, and remedy.

    InputError where the extra that reads the file is not installed.
    """
    if not path.is_file():
        raise DataError(f"there is no trace {path}; add the file, or leave the cell trace empty")
    channels = READERS.get(path.suffix.lower(), _read_csv)(path)
    for name, channel in channels.items():
        _require_samples(path, name, channel)
    lead = channels[LEAD]
    margin = ALIKE * step_of(lead.time)
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


def _notes(channels: Mapping[str, Channel], time: Array, margin: float) -> list[str]:
    """List what was interpolated, cut and lost, in sentences."""
    lead = channels[LEAD]
    apart = [
        f"{name} ({one.time.size} samples, every {number(1e3 * step_of(one.time))} ms)"
        for name, one in channels.items()
        if one.time.shape != lead.time.shape or abs(one.time - lead.time).max() > margin
    ]
    notes = [f"{', '.join(apart)} interpolated on the times of {LEAD} (every "
             f"{number(1e3 * step_of(lead.time))} ms)"] if apart else []  # fmt: skip
    if time.size < lead.time.size:
        notes.append(
            f"{lead.time.size - time.size} of {lead.time.size} samples of {LEAD} cut, as not all "
            f"channels have values before {number(time[0])} or after {number(time[-1])} s"
        )
    for name, one in channels.items():
        place = int(np.argmax(np.diff(one.time)))
        low, high = one.time[place : place + 2]
        own = name == LEAD or not np.array_equal(one.time, lead.time)
        if own and high - low > HOLE * step_of(one.time):
            notes.append(f"{name} without a sample from {number(low)} to {number(high)} s")
    return notes


def _require_samples(path: Path, name: str, channel: Channel) -> None:
    """Raise DataError for values that are not finite, few samples, and time that does not grow."""
    time, rows = channel.time, channel.rows
    clock = f"column {TIME}" if name == LEAD else f"the time of {name}"
    for what, values in ((f"column {name}", channel.values), (clock, time)):
        for place in np.flatnonzero(~np.isfinite(values)).tolist():
            raise bad_cell(path, rows[place], what, values[place], "a finite number")
    if time.size < (least := LEAST if name == LEAD else 2):
        raise DataError(
            f"{path} has {time.size} samples of {name}, but a trace needs at least {least}; export "
            "the whole shift"
        )
    for place in (np.flatnonzero(np.diff(time) <= 0.0) + 1).tolist():
        raise DataError(
            f"{path}, row {rows[place]}, {clock} is '{time[place]:.15g}' after "
            f"'{time[place - 1]:.15g}', but time must grow from sample to sample; sort the trace "
            "and leave doubled samples out"
        )


def bad_cell(path: Path, row: int, place: str, value: object, rule: str) -> DataError:
    """Return the error of one cell of a table: file, row, column, value, rule and remedy."""
    return DataError(
        f"{path}, row {row}, {place} is '{value}', but it must be {rule}; correct the cell"
    )


def _read_csv(path: Path) -> dict[str, Channel]:
    """Read the columns of a CSV trace; a row without a value is no sample of that channel."""
    table = read_table(path, COLUMNS, COLUMNS)
    table.require(COLUMNS)
    lines, columns = [row for row, _ in table.rows], {name: table.column(name) for name in COLUMNS}
    for name, cells in columns.items():
        for row, cell in zip(lines, cells, strict=True):
            if not is_plain(cell) and (cell or name == TIME):
                raise bad_cell(path, row, f"column {name}", cell, number_rule(cell))
    time, found = np.array(columns.pop(TIME), dtype=float), {}
    for name, cells in columns.items():
        places = [place for place, cell in enumerate(cells) if cell]
        values = np.array([cells[k] for k in places], dtype=float)
        found[name] = Channel(time[places], values, [lines[k] for k in places])
    return found


def _open(path: Path, library: str, reader: str, kind: str, extra: str) -> Any:
    try:
        read: Any = attrgetter(reader)(import_module(library.lower()))
    except ImportError as error:
        raise InputError(
            f"{library} cannot be loaded ({error}), but {kind} trace needs it; install it with: "
            f"pip install -c constraints.txt '.[{extra}]', or export the trace as CSV"
        ) from error
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


def _as_numbers(path: Path, name: str, samples: Any) -> Array:
    try:
        return np.asarray(samples, dtype=float)
    except (TypeError, ValueError) as error:
        raise DataError(
            f"{path}, channel {name} does not hold numbers ({error}); write it as numbers"
        ) from error


def _read_mdf(path: Path) -> dict[str, Channel]:
    found = {}
    with _open(path, "asammdf", "MDF", "an MDF", "mdf") as file:
        for name in COLUMNS[1:]:
            group, index = _only(path, name, file.channels_db.get(name, ()), file.channels_db)
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
    file = _open(path, "npTDMS", "TdmsFile.read", "a TDMS", "tdms")
    known = [channel.name for group in file.groups() for channel in group.channels()]
    found, lead = {}, None
    for name in COLUMNS[1:]:
        group = _only(path, name, [group for group in file.groups() if name in group], known)
        lead = lead or group  # that of the displacement, which comes first
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


def _waveform(path: Path, channel: Any, lead: Any) -> Array:
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


#: Readers of the files that are no CSV, by their suffixes.
READERS = {".tdms": _read_tdms, **dict.fromkeys((".mf4", ".mdf", ".dat"), _read_mdf)}
