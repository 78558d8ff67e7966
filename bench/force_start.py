r"""Start of the force in a trace, and readings at rest before it.

Of a trace that logs pressure or current of an actuator it is the start of that channel.

Noise, an offset of the sensor and the slow beginning of a cubic rise hide the first instant of the
force. So a curve is fitted to the samples up to a share of the rise: a level at rest,
:math:`F_0`, up to the start :math:`t_0`, and from there one of three shapes of :math:`t - t_0`,

- the nominal cubic step, :math:`k\,(\tau^2 - 2\tau^3/3T)` with the rise time *T* of the shift,
- a slower beginning, :math:`k_2\tau^2 + k_3\tau^3`, as a lag makes it,
- a ramp or a jump, :math:`k_1\tau + k_2\tau^2`.

Another shape than the nominal one is taken where the Bayesian information criterion prefers it
clearly. The scale of the force is free, so its unit does not matter.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from dogshape.bench.samples import scatter, smoothed, step_of
from dogshape.bench.traces import FORCE_CHANNEL, BenchTrace
from dogshape.sim.elementwise import Array

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
    """Start of the force, s, its standard error, and readings at rest.

    ``force`` is in N, or in the SI unit of a logged channel, ``displacement`` in m.
    """

    time: float
    error: float
    force: float
    displacement: float


@lru_cache(maxsize=512)
def find_force_start(trace: BenchTrace, rise: float) -> ForceStart | None:
    """Find the start of the force in a trace; ``rise`` is its nominal rise time in s.

    Returns None where no rise stands out from the noise.
    """
    size = _undisturbed(trace)
    time, force = trace.time[:size], trace.signal[:size]
    smooth, rest_force = smoothed(force), float(np.median(force[:FIRST]))
    top = float(smooth.max()) - rest_force
    threshold = max(THRESHOLD * top, CLEAR * scatter(force))
    # From the rise backwards: hum and bursts before it may pass the threshold too.
    end = int(np.argmax(smooth >= rest_force + RISEN * top)) + 1
    low_places = np.flatnonzero(smooth[:end] < rest_force + threshold)
    if top < 2.0 * threshold or not low_places.size:
        return None
    place = min(int(low_places[-1]) + 1, end - 1)
    begin = max(0, place - RESTED * (end - place))
    start, error, level = float(time[place]) - 0.5 * step_of(trace.time), 0.0, rest_force
    if end - place >= FITTED:
        start, error, level = _fit_start(time[begin:end], force[begin:end], place - begin, rise)
    displacement_before = trace.displacement[: max(FIRST, int(np.searchsorted(trace.time, start)))]
    # Between two samples a jump may be anywhere.
    channel = FORCE_CHANNEL if trace.logged is None else trace.logged.key
    step = trace.steps.get(channel, step_of(trace.time))
    error = float(np.hypot(error, step / np.sqrt(12.0)))
    return ForceStart(start, error, level, float(np.median(displacement_before)))


def displacement_at_rest(trace: BenchTrace, rise: float) -> float:
    """Read the displacement before the force, m; the first samples where no force starts."""
    start = find_force_start(trace, rise)
    return start.displacement if start else float(np.median(trace.displacement[:FIRST]))


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
    way, force = smoothed(trace.displacement), smoothed(trace.signal)
    min_fall = max(THRESHOLD * np.ptp(force), 2.0 * CLEAR * scatter(trace.signal))
    fallen = np.maximum.accumulate(force) - force > min_fall
    if not fallen.any():
        return way.size
    rest_displacement = float(np.median(way[:FIRST]))
    touched, arrived = (
        int(np.argmax(way >= rest_displacement + share * (way.max() - rest_displacement)))
        for share in (FREE, ARRIVED)
    )
    return max(2 * FIRST, touched if np.argmax(fallen) < arrived else arrived)


def _fit(time: Array, force: Array, shape: Shape, low: float) -> tuple[float, float, float, float]:
    """Fit a shape that starts after ``low`` to a force.

    Returns information criterion, start and its standard error, s, and force at rest, N.
    """

    def columns(starts: Array) -> Array:
        tau = np.maximum(0.0, time - starts[:, None])
        return np.stack([np.ones_like(tau), *shape(tau)], axis=-1)

    def solved(matrix: Array) -> tuple[Array, Array]:
        transposed = matrix.swapaxes(1, 2)
        solution = np.linalg.pinv(transposed @ matrix) @ (transposed @ force)[..., None]
        return solution, ((force - (matrix @ solution)[..., 0]) ** 2).sum(axis=1)

    low, high = max(low, -SEARCHED), 0.0
    for _ in range(PASSES):
        starts = np.linspace(low, high, GRID)
        place = int(np.argmin(solved(columns(starts))[1]))
        low, high = float(starts[max(0, place - 1)]), float(starts[min(GRID - 1, place + 1)])
    start, step = float(starts[place]), 1e-4
    matrix = columns(np.array([start, start - step, start + step]))
    solution, squares_left = solved(matrix[:1])
    jacobian = np.column_stack([matrix[0], (matrix[2] - matrix[1]) @ solution[0] / (2.0 * step)])
    squares, size = max(float(squares_left[0]), 1e-300), time.size
    inverse = np.linalg.pinv(jacobian.T @ jacobian)[-1, -1]
    error = float(np.sqrt(squares / max(1, size - jacobian.shape[1]) * max(0.0, inverse)))
    score = size * np.log(squares / size) + jacobian.shape[1] * np.log(size)
    return float(score), start, error, float(solution[0, 0, 0])
