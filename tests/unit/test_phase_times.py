"""Phases along a shift, on the bench and simulated."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from dogshape.diagnosis.bench.bench_data import Cell, Reading, load_bench
from dogshape.diagnosis.report.phase_times import (
    PHASES,
    durations,
    entry_depth,
    phase_gaps,
    resampled,
)
from dogshape.sim.shift.actuation import ForceProfile
from dogshape.sim.shift.clutch import Clutch, OperatingPoint
from dogshape.sim.shift.trace import Trace
from dogshape.sim.statistics.blocks import Block
from dogshape.sim.units import RPM
from tests.benches import good_set

CLUTCH = load_bench("mq200_adams").clutch
POINT = OperatingPoint(50 * RPM, ForceProfile(469.0, 0.1766))


def flight(clutch: Clutch, point: OperatingPoint, hold: float, flank: float) -> Trace:
    """A made-up shift: free flight, a hold at the crests, on to the end, a flank at ``flank``."""
    time = np.linspace(0.0, 0.12, 2401)
    mass, gap = clutch.rings.mass, clutch.dog.axial_gap
    met = point.profile.free_flight_time(gap, mass)
    free = point.profile.free_flight(np.minimum(time, met), mass)
    way = free + 0.2 * np.maximum(0.0, time - met - hold)
    keep = way <= clutch.shift_travel + 1e-6
    sliding = np.where(time < flank, 0.0, 0.5 * point.mismatch)
    zero = np.zeros_like(time)
    whole = (
        time,
        way,
        np.gradient(way, time),
        sliding,
        zero + point.mismatch,
        zero,
        zero,
        zero,
        zero,
        way,
        np.gradient(way, time),
    )
    return Trace(*(one[keep] for one in whole))


def test_phases_of_a_made_up_shift(clutch: Clutch) -> None:
    point = POINT
    mass, dog = clutch.rings.mass, clutch.dog
    met = point.profile.free_flight_time(dog.axial_gap, mass)
    moved = point.profile.free_flight_time(0.02 * dog.travel, mass)
    free = met + 0.03 + (entry_depth(clutch) - dog.axial_gap) / 0.2
    end = met + 0.03 + (clutch.shift_travel - dog.axial_gap) / 0.2
    flank = 0.5 * (free + end)
    made = resampled(flight(clutch, point, 0.03, flank), 1e-3)
    found = durations(clutch, made)
    assert found is not None
    # Samples 1 ms apart, linear in between; a change of speed is seen at the sample after it.
    known = np.diff([0.0, moved, met, free, flank, end])
    assert np.allclose(found, known, atol=1.0e-3)
    assert found.sum() == pytest.approx(end, abs=2e-4)
    half = replace(made, **{n: getattr(made, n)[:30] for n in ("time", "displacement")})
    assert durations(clutch, half) is None


def test_gap_along_the_shift_shows_where_it_is(tmp_path: Path) -> None:
    """A delay of 20 ms in the bench's traces is before motion, and nowhere else."""
    bench = load_bench(good_set(tmp_path))

    def same(blocks: Sequence[Block]) -> list[list[Trace]]:
        pairs = zip(blocks, bench.cells, strict=True)
        return [[one for _ in range(3) for one in as_simulated(cell)] for _, cell in pairs]

    still = phase_gaps(bench, same)
    assert [phase.name for phase in still] == list(PHASES)
    assert all(abs(phase.z) < 1.0 for phase in still)
    cells = tuple(
        replace(cell, readings=tuple(map(delayed, cell.readings))) for cell in bench.cells
    )
    before, *others = phase_gaps(replace(bench, cells=cells), same)
    assert before.gap == pytest.approx(0.02, abs=5e-4)
    assert before.z > 20.0
    assert all(abs(phase.z) < 1.0 for phase in others)


def as_simulated(cell: Cell) -> list[Trace]:
    found = []
    for t in cell.traces:
        zero = np.zeros_like(t.time)
        series = (t.sliding_speed, t.output_speed, zero, t.force, zero, zero)
        found.append(Trace(t.time, t.displacement, zero, *series, t.displacement, zero))
    return found


def delayed(reading: Reading) -> Reading:
    t = reading.trace
    return reading if t is None else replace(reading, trace=replace(t, time=t.time + 0.02))
