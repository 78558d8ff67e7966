"""Along the shift: how long each phase takes on the bench and in the simulation.

A bench trace has a displacement and two speeds, no contact forces and no relative angle. The
phases therefore end at marks that displacement and speeds alone give, and the same rules find
them in a simulated trace that is sampled as the bench's:

before motion
    until a fiftieth of the travel is made;
travel
    until the axial gap is closed, where the crests meet;
face contact
    until the dogs are deeper than any face can touch a face, for good;
entry
    from there until the speeds change, since a flank has touched;
seating
    until the travel at which the shift counts as finished.

Face contact and entry by these marks hold a little of the free way before and after the touch
(``sim.shift.events`` knows the touch itself), but the same in both.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from dogshape.diagnosis.bench.bench_data import Bench
from dogshape.diagnosis.bench.traces import BenchTrace, smoothed
from dogshape.sim.engines import engage
from dogshape.sim.shift.clutch import Clutch
from dogshape.sim.shift.trace import Trace
from dogshape.sim.statistics.blocks import Block, even_blocks

Series = NDArray[np.float64]

PHASES = ("before motion", "travel", "face contact", "entry", "seating")
MOTION = 0.02  #: share of the travel that counts as motion
STEP = 0.2  #: share of the mismatch by which speeds change where a flank touches
ANGLES = 12  #: simulated shifts at each operating point

Tracer = Callable[[Sequence[Block]], list[list[Trace]]]  #: simulates blocks, traces out


@dataclass(frozen=True)
class PhaseGap:
    """One phase: mean duration on the bench and simulated, s, and the error of the gap."""

    name: str
    bench_mean: float
    simulated_mean: float
    standard_error: float

    @property
    def gap(self) -> float:
        """Bench less simulation, s."""
        return self.bench_mean - self.simulated_mean

    @property
    def z(self) -> float:
        """Gap in standard errors."""
        return self.gap / self.standard_error


def phase_gaps(
    bench: Bench, trace: Tracer | None = None, angles: int = ANGLES, seed: int = 1
) -> tuple[PhaseGap, ...]:
    """Measure the gap of each phase over all cells with traces of finished shifts, all alike.

    ``trace`` simulates; by default in this process, a tenth of a second and more a shift. The
    spread of single shifts is that of the simulation. Empty where there is no such cell.
    """
    measured = [(cell, _all_durations(bench.clutch, cell.traces)) for cell in bench.cells]
    having = [(cell, durations) for cell, durations in measured if len(durations)]
    blocks = even_blocks(bench.clutch, [cell.point for cell, _ in having], angles, seed)
    rows = []
    for (cell, real), traces in zip(having, (trace or simulate)(blocks), strict=True):
        step = float(np.median([one.step for one in cell.traces]))
        simulated = _all_durations(bench.clutch, [resampled(one, step) for one in traces])
        if len(simulated) > 1:
            # No spread is less than that of two rounded times.
            variance = simulated.var(axis=0, ddof=1) + step**2 / 6.0
            error = variance * (1.0 / len(real) + 1.0 / len(simulated))
            rows.append((real.mean(axis=0), simulated.mean(axis=0), error))
    if not rows:
        return ()
    means, simulated_means, squares = (np.array(part) for part in zip(*rows, strict=True))
    errors = np.sqrt(squares.sum(axis=0)) / len(rows)
    columns = means.mean(axis=0), simulated_means.mean(axis=0), errors
    numbers = np.array(columns).T.tolist()
    return tuple(PhaseGap(name, *one) for name, one in zip(PHASES, numbers, strict=True))


def simulate(blocks: Sequence[Block]) -> list[list[Trace]]:
    """Simulate blocks in this process, traces out."""
    return [
        [engage(block.clutch, block.point, angle).trace for angle in block.angles]
        for block in blocks
    ]


def resampled(trace: Trace, step: float) -> BenchTrace:
    """Return a simulated trace as a bench would have sampled it every ``step`` s.

    Past its end, where the simulation stops, displacement goes on at its last speed.
    """
    end = float(trace.time[-1])
    time = np.arange(0.0, end + 2.0 * step, step)
    beyond = np.maximum(0.0, time - end) * max(float(trace.axial_speed[-1]), 0.0)
    series = (trace.displacement, trace.shift_force, trace.sliding_speed, trace.output_speed)
    way, *rest = (np.interp(time, trace.time, one) for one in series)
    return BenchTrace(Path(), time, way + beyond, *rest)


def _all_durations(clutch: Clutch, traces: Sequence[BenchTrace]) -> Series:
    found = [durations(clutch, trace) for trace in traces]
    return np.array([one for one in found if one is not None]).reshape(-1, len(PHASES))


def durations(clutch: Clutch, trace: BenchTrace) -> Series | None:
    """Measure the phases of a shift, s, (5,); None for one that did not finish."""
    marks = marks_of(clutch, trace)
    return None if marks is None else np.diff(np.array([0.0, *marks]))


def marks_of(clutch: Clutch, trace: BenchTrace) -> tuple[float, ...] | None:
    """Find the end of each phase, s, (5,), none before the one before it."""
    way = smoothed(trace.displacement)
    end = _first(trace.time, way, clutch.shift_travel)
    if end is None:
        return None
    motion = _first(trace.time, way, MOTION * clutch.dog.travel)
    crests = _first(trace.time, way, clutch.dog.axial_gap)
    free = _last(trace.time, way, entry_depth(clutch), end)
    flank = _first_flank(trace, free, end)
    marks = [end if mark is None else min(mark, end) for mark in (motion, crests, free, flank)]
    return tuple(np.maximum.accumulate([*marks, end]).tolist())


def entry_depth(clutch: Clutch) -> float:
    """Return the displacement beyond which no face touches a face, m."""
    dog = clutch.dog
    return dog.axial_gap + 2.0 * dog.face_width * math.tan(dog.chamfer)


def _between(time: Series, way: Series, place: int, level: float) -> float:
    """Interpolate the time at which ``way`` passes ``level`` in the step to ``place``, s."""
    if place == 0:
        return float(time[0])
    low, high = way[place - 1], way[place]
    return float(time[place - 1] + (level - low) / (high - low) * (time[place] - time[place - 1]))


def _first(time: Series, way: Series, level: float) -> float | None:
    above = way >= level
    return _between(time, way, int(np.argmax(above)), level) if above.any() else None


def _last(time: Series, way: Series, level: float, end: float) -> float | None:
    """Find the last time before ``end`` at which ``way`` passes ``level`` upwards, s."""
    up = np.flatnonzero((way[1:] >= level) & (way[:-1] < level) & (time[:-1] <= end)) + 1
    return _between(time, way, int(up[-1]), level) if up.size else None


def _first_flank(trace: BenchTrace, start: float | None, end: float) -> float | None:
    """Find the first time at which the mismatch leaves that at ``start``, s, or None.

    By a fifth of the first mismatch, or four times the scatter of the speeds where that is more.
    """
    if start is None:
        return None
    speed = smoothed(trace.relative_speed)
    scatter = 1.5 * float(np.median(np.abs(np.diff(speed))))
    before = float(np.interp(start, trace.time, speed))
    least = max(STEP * abs(float(np.median(speed[:5]))), 4.0 * scatter)
    inside = (trace.time >= start) & (trace.time <= end) & (np.abs(speed - before) >= least)
    return float(trace.time[np.argmax(inside)]) if inside.any() else None
