r"""Marks of the flight in bench traces: when displacement and force pass given values.

Until the first touch the motion of the ring depends on no relative angle, so all traces of one
force profile show the same flight. A mark is the root of a parabola through the samples around the
value. With the scatter :math:`\sigma` of the samples, from their third differences or from what the
parabola leaves, its standard error is :math:`\sigma_{fit}/|\dot x|`. Values below four scatters
have no mark. Traces whose mark lies far from the others' are left out, the rest averaged.

All marks of a profile err together: by the start of each trace within its sampling step, or by the
error with which it was found from the force; by the gain of the sensor
(:math:`\delta t = g x/\dot x`); and by what the rigid flight leaves out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dogshape.bench.bench_data import Bench
from dogshape.bench.samples import scatter, smoothed, step_of
from dogshape.bench.traces import BenchTrace
from dogshape.sim.elementwise import Array
from dogshape.sim.shift.actuation import ForceProfile

WAYS = (0.02, 0.1, 0.3, 0.6, 0.9)  #: shares of the axial gap
FORCES = (0.1, 0.25, 0.5, 0.75)  #: shares of the final force
SIZE = len(WAYS) + len(FORCES)  #: marks of a flight, those of the displacement first
#: Shares of a mark's level between which samples are fitted to it.
TRAVEL_WINDOW = (0.5, 1.7)
FORCE_WINDOW = (0.75, 1.3)
SAMPLES = 6  #: the least number of them
CLEAR = 4.0  #: scatters above which a value is told from nothing
APART = 5.0  #: scatters of marks beyond which a trace is left out
FLOOR = 2e-4  #: s, model error of each mark, and again of all together
SHARE = 0.005  #: of its time, error of the flight that all marks have in common
TRAVEL_GAIN = 0.01  #: error of the displacement sensor's gain
FORCE_GAIN = 0.02  #: error of the force sensor's gain
FORCE_FLOOR = 5e-4  #: s, error of a mark of the force beside its gain
NO_MARK = np.full(3, np.nan)  #: of a value that a trace does not pass


@dataclass(frozen=True)
class SeenFlight:
    """Marks of the flight that a bench shows under one force profile."""

    profile: ForceProfile
    places: np.ndarray  #: which of the ``SIZE`` marks it has, (k,)
    times: Array  #: s, (k,)
    covariance: Array  #: s^2, (k, k)


def flights_of(bench: Bench) -> tuple[SeenFlight, ...]:
    """Gather the marks of the flight from the traces of a data set, by force profile."""
    traces_by_profile: dict[ForceProfile, list[BenchTrace]] = {}
    for cell in bench.cells:
        traces_by_profile.setdefault(cell.point.profile, []).extend(cell.traces)
    flights = []
    for profile, traces in traces_by_profile.items():
        marks = joined_marks(
            traces,
            profile,
            bench.clutch.dog.axial_gap,
            has_actuator=bench.clutch.actuator is not None,
        )
        places = np.flatnonzero(np.isfinite(marks[:, 0]))
        if not places.size:
            continue
        times, errors, reach = marks[places].T
        starts = [step_of(trace.time) ** 2 / 12.0 + trace.start_error**2 for trace in traces]
        start = float(np.mean(starts)) / len(traces)
        covariance = np.diag(errors**2) + model_covariance(places, times, reach)
        flights.append(SeenFlight(profile, places, times, covariance + start))
    return tuple(flights)


def model_covariance(places: np.ndarray, times: Array, reach: Array) -> Array:
    """Compute the covariance of flight and sensor errors beside scatter, s^2, (k, k)."""
    way = places < len(WAYS)
    floor = np.where(way, FLOOR, FORCE_FLOOR)
    gains = way * TRAVEL_GAIN * reach, ~way * FORCE_GAIN * reach
    parts = *gains, way * SHARE * times, way * FLOOR
    return np.diag(floor**2) + sum((np.outer(p, p) for p in parts), np.zeros(()))


def joined_marks(
    traces: Sequence[BenchTrace], profile: ForceProfile, gap: float, *, has_actuator: bool = False
) -> Array:
    """Join the marks of traces of one profile: time, error, value over slope, s, (SIZE, 3)."""
    marks = [trace_marks(trace, profile, gap, has_actuator=has_actuator) for trace in traces]
    table = np.array(marks).reshape(-1, SIZE, 3)
    return np.array([_joined(table[:, k]) for k in range(SIZE)])


def _joined(marks: Array) -> Array:
    valid_marks = marks[np.isfinite(marks[:, 0])]
    if 2 * len(valid_marks) < len(marks) or not len(valid_marks):
        return NO_MARK
    times, errors, reach = valid_marks.T
    separation = abs(times - np.median(times))
    # The nearer half always stays, and so do one mark or two.
    is_close = separation <= APART * max(
        1.48 * float(np.median(separation)), float(np.median(errors))
    )
    count = int(is_close.sum())
    variance = float((errors[is_close] ** 2).mean())
    if count > 1:
        variance = max(variance, float(times[is_close].var(ddof=1)))
    return np.array([times[is_close].mean(), np.sqrt(variance / count), np.median(reach)])


def trace_marks(
    trace: BenchTrace, profile: ForceProfile, gap: float, *, has_actuator: bool = False
) -> Array:
    """Find the marks of a trace: time, error, value over slope, s, (SIZE, 3); NaN for none.

    Of an actuator the marks of the force are those of its logged channel, which the motion changes
    little; a measured force, which follows the motion, has none.
    """
    closed = smoothed(trace.displacement) >= gap
    top = int(np.argmax(closed)) if closed.any() else len(trace.time)
    way = trace.time[:top], trace.displacement[:top]
    marks = [mark_of(*way, share * gap, TRAVEL_WINDOW) for share in WAYS]
    full_level = profile.force
    if trace.logged is not None:
        full_level = trace.logged.actuator.logged_level(profile.force)
    elif has_actuator:
        return np.array([*marks, *([NO_MARK] * len(FORCES))])
    force = trace.time, trace.signal
    levels = [share * full_level for share in FORCES]
    return np.array([*marks, *(mark_of(*force, level, FORCE_WINDOW) for level in levels)])


def mark_of(time: Array, values: Array, level: float, around: tuple[float, float]) -> Array:
    """Find when rising samples (n,) pass a level: time, error, value over slope, s; NaN for none.

    Samples between the parts ``around`` of the level are fitted.
    """
    noise = scatter(values)
    smooth = smoothed(values) if values.size else values
    is_above = smooth >= level
    if level < CLEAR * noise or not is_above.any() or is_above[0] or values.size < 3:
        return NO_MARK
    # Noise passes a level too early and too late alike: the middle is between first and last.
    first = last = int(np.argmax(is_above))
    near_places = np.flatnonzero(~is_above[first:] & (smooth[first:] > level - CLEAR * noise))
    if near_places.size and near_places[0] < SAMPLES:
        last = first + int(near_places[near_places < 2 * SAMPLES][-1]) + 1
    low_places = np.flatnonzero(smooth[:first] < around[0] * level)
    high_places = np.flatnonzero(smooth[last:] > around[1] * level)
    low = int(low_places[-1]) if low_places.size else 0
    high = last + int(high_places[0]) + 1 if high_places.size else smooth.size
    while high - low < SAMPLES and (low > 0 or high < smooth.size):
        low, high = max(0, low - 1), min(smooth.size, high + 1)
    return _fitted(time[low:high], values[low:high], level, noise)


def _fitted(time: Array, values: Array, level: float, noise: float) -> Array:
    degree = 2 if time.size >= 4 else 1
    centre, scale = float(time.mean()), float(np.ptp(time)) or 1.0
    scaled = (time - centre) / scale
    matrix = np.vander(scaled, degree + 1)
    coefficients = np.asarray(np.linalg.lstsq(matrix, values, rcond=None)[0], dtype=np.float64)
    residual = values - matrix @ coefficients
    sigma = max(noise, float(np.sqrt((residual**2).sum() / max(1, time.size - degree - 1))))
    roots, edge = (
        np.roots([*coefficients[:-1], coefficients[-1] - level]),
        0.5 / max(1, time.size - 1),
    )
    rising = (abs(roots.imag) < 1e-9) & (np.polyval(np.polyder(coefficients), roots.real) > 0.0)
    within = (roots.real >= scaled[0] - edge) & (roots.real <= scaled[-1] + edge)
    if not (rising & within).any():
        return NO_MARK
    place = min(roots.real[rising & within].tolist(), key=abs)
    row = place ** np.arange(degree, -1, -1.0)
    error = sigma * float(np.sqrt(row @ np.linalg.inv(matrix.T @ matrix) @ row))
    slope = float(np.polyval(np.polyder(coefficients), place)) / scale
    return np.array([centre + scale * place, error / slope, level / slope])
