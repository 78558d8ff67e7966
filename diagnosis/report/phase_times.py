"""Along the shift: how long each phase takes on the bench and in the simulation.

A bench trace has displacement and speeds, no contact forces. Phases end at marks that these give;
the same rules find them in a simulated trace that is sampled as the bench's:

before motion : until a fiftieth of the travel is made;
travel : until the axial gap is closed, where the crests meet;
face contact : until the dogs are deeper than any face can touch a face, for good;
entry : from there until the speeds change, since a flank has touched;
seating : until the travel at which the shift counts as finished.
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
POINTS, ANGLES = 8, 8  #: operating points with traces, at most, and simulated shifts at each

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


def simulate(blocks: Sequence[Block]) -> list[list[Trace]]:
    """Simulate blocks in this process, traces out: a tenth of a second and more a shift."""
    return [
        [engage(block.clutch, block.point, angle).trace for angle in block.angles]
        for block in blocks
    ]


def phase_gaps(bench: Bench, trace: Tracer = simulate, seed: int = 1) -> tuple[PhaseGap, ...]:
    """Measure the gap of each phase over cells with traces of finished shifts, all alike.

    ``trace`` simulates. The spread of single shifts is that of the simulation. Empty where there is
    no such cell.
    """
    clutch = bench.clutch
    measured = [
        (cell.point, cell.traces, found)
        for cell in bench.cells
        if len(found := _durations(clutch, cell.traces))
    ]
    measured = measured[:: max(1, -(-len(measured) // POINTS))]
    blocks = even_blocks(clutch, [point for point, *_ in measured], ANGLES, seed)
    rows = []
    for (_, real, found), traces in zip(measured, trace(blocks), strict=True):
        step = float(np.median([one.step for one in real]))
        simulated = _durations(clutch, [resampled(one, step) for one in traces])
        if len(simulated) > 1:
            # No spread is less than that of two rounded times.
            variance = simulated.var(axis=0, ddof=1) + step**2 / 6.0
            error = variance * (1.0 / len(found) + 1.0 / len(simulated))
            rows.append((found.mean(axis=0), simulated.mean(axis=0), error))
    if not rows:
        return ()
    means, simulated_means, squares = np.array(rows).mean(axis=0)
    errors = np.sqrt(squares / len(rows))
    columns = zip(PHASES, *(one.tolist() for one in (means, simulated_means, errors)), strict=True)
    return tuple(PhaseGap(*one) for one in columns)


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


def _durations(clutch: Clutch, traces: Sequence[BenchTrace]) -> Series:
    found = [one for trace in traces if (one := durations(clutch, trace)) is not None]
    return np.array(found).reshape(-1, len(PHASES))


def durations(clutch: Clutch, trace: BenchTrace) -> Series | None:
    """Measure the phases of a shift, s, (5,); None for one that did not finish."""
    time, way = trace.time, smoothed(trace.displacement)

    def passed(level: float) -> Series:
        """Find all times at which the displacement passes a level upwards, s."""
        after = np.flatnonzero((way[1:] >= level) & (way[:-1] < level))
        share = (level - way[after]) / (way[after + 1] - way[after])
        return np.asarray(time[after] + share * (time[after + 1] - time[after]))

    ends = passed(clutch.shift_travel)
    if not ends.size:
        return None
    end, motion, crests = ends[0], passed(MOTION * clutch.dog.travel), passed(clutch.dog.axial_gap)
    free = passed(entry_depth(clutch))
    free = free[free <= end][-1:]
    flank = end
    if free.size:
        # A change of speed above a fifth of the mismatch, and above the scatter of the speeds.
        speed = smoothed(trace.relative_speed)
        scatter = 1.5 * float(np.median(np.abs(np.diff(speed))))
        least = max(STEP * abs(float(np.median(speed[:5]))), 4.0 * scatter)
        apart = np.abs(speed - np.interp(free[0], time, speed)) >= least
        flank = min([end, *time[apart & (time >= free[0])]])
    marks = [min([end, *one[:1]]) for one in (motion, crests, free)]
    return np.diff(np.maximum.accumulate([0.0, *marks, flank, end]))


def entry_depth(clutch: Clutch) -> float:
    """Return the displacement beyond which no face touches a face, m."""
    dog = clutch.dog
    return dog.axial_gap + 2.0 * dog.face_width * math.tan(dog.chamfer)
