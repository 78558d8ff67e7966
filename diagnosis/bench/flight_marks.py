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
from dataclasses import dataclass, field

import numpy as np

from dogshape.diagnosis.bench.bench_data import Bench
from dogshape.diagnosis.bench.traces import BenchTrace, scatter, smoothed
from dogshape.diagnosis.terms import Array
from dogshape.sim.shift.actuation import ForceProfile

WAYS = (0.02, 0.1, 0.3, 0.6, 0.9)  #: shares of the axial gap
FORCES = (0.1, 0.25, 0.5, 0.75)  #: shares of the final force
SIZE = len(WAYS) + len(FORCES)  #: marks of a flight, those of the displacement first
AROUND = {"way": (0.5, 1.7), "force": (0.75, 1.3)}  #: samples that a mark is fitted to
SAMPLES = 6  #: the least number of them
CLEAR = 4.0  #: scatters above which a value is told from nothing
APART = 5.0  #: scatters of marks beyond which a trace is left out
FLOOR = 2e-4  #: s, model error of each mark, and again of all together
SHARE = 0.005  #: of its time, error of the flight that all marks have in common
GAIN = {"way": 0.01, "force": 0.02}  #: error of the sensors' gain
FORCE_FLOOR = 5e-4  #: s, error of a mark of the force beside its gain


@dataclass(frozen=True)
class Mark:
    """When a trace passes a value, s, its standard error, and value over slope there, s."""

    time: float
    error: float
    reach: float


@dataclass(frozen=True)
class SeenFlight:
    """Marks of the flight that a bench shows under one force profile.

    ``cells`` are the places of its operating points with ``traces``, ``places`` which of the
    ``SIZE`` marks it has, (k,), ``times`` in s, (k,), ``covariance`` in s^2, (k, k).
    """

    profile: ForceProfile
    cells: tuple[int, ...]
    places: np.ndarray = field(repr=False)
    times: Array = field(repr=False)
    covariance: Array = field(repr=False)
    traces: int = 0


def flights_of(bench: Bench) -> tuple[SeenFlight, ...]:
    """Gather the marks of the flight from the traces of a data set, by force profile."""
    places: dict[ForceProfile, list[int]] = {}
    for place, cell in enumerate(bench.cells):
        if cell.traces:
            places.setdefault(cell.point.profile, []).append(place)
    found = []
    for profile, cells in places.items():
        traces = [trace for place in cells for trace in bench.cells[place].traces]
        joined = joined_marks(traces, profile, bench.clutch.dog.axial_gap)
        known = np.array([k for k, one in enumerate(joined) if one is not None], dtype=np.int64)
        if not known.size:
            continue
        marks = [one for one in joined if one is not None]
        times = np.array([one.time for one in marks])
        start = float(np.mean([trace.step**2 / 12.0 + trace.start_error**2 for trace in traces]))
        covariance = np.diag([one.error**2 for one in marks]) + model_covariance(
            known, times, np.array([one.reach for one in marks])
        )
        covariance = covariance + start / len(traces)
        found.append(SeenFlight(profile, tuple(cells), known, times, covariance, len(traces)))
    return tuple(found)


def model_covariance(places: np.ndarray, times: Array, reach: Array) -> Array:
    """Compute the covariance of flight and sensor errors beside scatter, s^2, (k, k)."""
    way = places < len(WAYS)
    own = np.where(way, FLOOR, FORCE_FLOOR)
    parts = [
        np.where(way, GAIN["way"] * reach, 0.0),
        np.where(way, 0.0, GAIN["force"] * reach),
        np.where(way, SHARE * times, 0.0),
        np.where(way, FLOOR, 0.0),
    ]
    return np.diag(own**2) + sum((np.outer(p, p) for p in parts), np.zeros(()))


def joined_marks(
    traces: Sequence[BenchTrace], profile: ForceProfile, gap: float
) -> list[Mark | None]:
    """Return all marks of some traces of one profile together; None where there is none."""
    table = [trace_marks(trace, profile, gap) for trace in traces]
    return [_joined([row[k] for row in table]) for k in range(SIZE)]


def _joined(marks: Sequence[Mark | None]) -> Mark | None:
    known = [mark for mark in marks if mark is not None]
    if 2 * len(known) < len(marks) or not known:
        return None
    times, errors = (np.array([getattr(m, name) for m in known]) for name in ("time", "error"))
    apart = abs(times - np.median(times))
    kept = apart <= APART * max(1.48 * float(np.median(apart)), float(np.median(errors)))
    if len(known) < 3 or not kept.any():
        kept = np.ones(len(known), dtype=bool)
    count = int(kept.sum())
    variance = float((errors[kept] ** 2).mean())
    if count > 1:
        variance = max(variance, float(times[kept].var(ddof=1)))
    reach = float(np.median([mark.reach for mark in known]))
    return Mark(float(times[kept].mean()), float(np.sqrt(variance / count)), reach)


def trace_marks(trace: BenchTrace, profile: ForceProfile, gap: float) -> list[Mark | None]:
    """Return all marks of one trace; None where there is none."""
    closed = smoothed(trace.displacement) >= gap
    top = int(np.argmax(closed)) if closed.any() else len(trace.time)
    ways = [
        mark_of(trace.time[:top], trace.displacement[:top], share * gap, AROUND["way"])
        for share in WAYS
    ]
    forces = [
        mark_of(trace.time, trace.force, share * profile.force, AROUND["force"]) for share in FORCES
    ]
    return [*ways, *forces]


def mark_of(time: Array, values: Array, level: float, around: tuple[float, float]) -> Mark | None:
    """Find the time at which rising samples (n,) pass a level.

    Samples between the parts ``around`` of the level are fitted.
    """
    noise = scatter(values)
    smooth = smoothed(values) if values.size else values
    above = smooth >= level
    if level < CLEAR * noise or not above.any() or above[0] or values.size < 3:
        return None
    # Noise passes a level too early and too late alike: the middle is between first and last.
    first = last = int(np.argmax(above))
    near = np.flatnonzero(~above[first:] & (smooth[first:] > level - CLEAR * noise))
    if near.size and near[0] < SAMPLES:
        last = first + int(near[near < 2 * SAMPLES][-1]) + 1
    below = np.flatnonzero(smooth[:first] < around[0] * level)
    over = np.flatnonzero(smooth[last:] > around[1] * level)
    low = int(below[-1]) if below.size else 0
    high = last + int(over[0]) + 1 if over.size else smooth.size
    while high - low < SAMPLES and (low > 0 or high < smooth.size):
        low, high = max(0, low - 1), min(smooth.size, high + 1)
    return _fitted(time[low:high], values[low:high], level, noise)


def _fitted(time: Array, values: Array, level: float, noise: float) -> Mark | None:
    degree = 2 if time.size >= 4 else 1
    centre, scale = float(time.mean()), float(np.ptp(time)) or 1.0
    matrix = np.vander((time - centre) / scale, degree + 1)
    found = np.asarray(np.linalg.lstsq(matrix, values, rcond=None)[0], dtype=np.float64)
    left = values - matrix @ found
    spare = max(1, time.size - degree - 1)
    sigma = max(noise, float(np.sqrt((left**2).sum() / spare)))
    place = _root(found, level, (time - centre) / scale)
    if place is None:
        return None
    row = place ** np.arange(degree, -1, -1.0)
    error = sigma * float(np.sqrt(row @ np.linalg.inv(matrix.T @ matrix) @ row))
    slope = float(np.polyval(np.polyder(found), place)) / scale
    return Mark(centre + scale * place, error / slope, level / slope)


def _root(found: Array, level: float, inside: Array) -> float | None:
    """Find the upward crossing of a level by a polynomial within samples, None without one."""
    shifted = found.copy()
    shifted[-1] -= level
    slope = np.polyder(found)
    edge = 0.5 / max(1, inside.size - 1)
    roots = [
        float(r.real)
        for r in np.roots(shifted)
        if abs(r.imag) < 1e-9
        and inside[0] - edge <= r.real <= inside[-1] + edge
        and np.polyval(slope, r.real) > 0.0
    ]
    return min(roots, key=abs) if roots else None
