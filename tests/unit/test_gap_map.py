"""The gap map: arithmetic by hand, and known noise that comes out as noise."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from diagnosis.along import PHASES, along, durations, entry_depth, overall, resampled
from diagnosis.bench import Bench, load_bench
from diagnosis.gap import CellGap, ErrorBudget, GapMap, cell_gap, gap_map, unseen_tail
from diagnosis.reading import Cell, Reading, gather
from diagnosis.records import map_record
from sim.actuation import ForceProfile
from sim.blocks import Block
from sim.clutch import Clutch, OperatingPoint
from sim.trace import Trace
from sim.units import RPM
from tests.benches import good_set

CLUTCH = load_bench("mq200_adams").clutch
POINT = OperatingPoint(50 * RPM, ForceProfile(469.0, 0.1766))


def rows(times: Sequence[float | None]) -> list[dict[str, Any]]:
    return [{"outcome": "timed_out" if t is None else "engaged", "shift_time_s": t} for t in times]


def cell(times: Sequence[float], point: OperatingPoint = POINT) -> Cell:
    return gather([Reading(k, point, 1, t, True) for k, t in enumerate(times, 2)])[0]


def test_one_cell_by_hand() -> None:
    one = cell_gap(
        cell([0.10, 0.12, 0.11, 0.11]), rows([0.06, 0.10, 0.06, 0.10]), CLUTCH, (0.01, 0.03)
    )
    assert one.gap == pytest.approx(0.11 - 0.08)
    # Spread of the simulation: squares 4 x 0.02^2 over 3. The next slot comes after 80 ms, as
    # long as the mean shift, 40 ms beyond the range; one in six may have to wait for it.
    spread, tail = 4 * 0.02**2 / 3, 5 / 36 * 0.04**2
    assert one.errors.bench == pytest.approx(math.sqrt((spread + tail) / 4))
    # Differences +-0.04: sum of squares 0.0064 over 12 n^2, scatter 0.0016 times 5/(6 n).
    sampled = 0.0064 / 192 + 5 * 0.0016 / 24 + tail / 4
    assert one.errors.simulation == pytest.approx(math.sqrt(sampled))
    numerics = spread * (0.01**2 + 0.03**2 / 4)
    assert one.errors.numerics == pytest.approx(math.sqrt(numerics))
    assert one.z == pytest.approx(0.03 / math.sqrt((spread + tail) / 4 + sampled + numerics))
    assert one.bench_sd == pytest.approx(math.sqrt(2 * 0.01**2 / 3))


def test_shares_engaged_by_the_beta_argument() -> None:
    """With 1 of 2 engaged the share is Beta(3/2, 3/2): none of one with probability a half."""
    tried = gather([Reading(2, POINT, 1, None, False)])[0]
    assert cell_gap(tried, rows([0.1, None]), CLUTCH).engaged_p == pytest.approx(1.0)
    # Beta(5/2, 1/2) has mean 5/6: a failure has probability 1/6, twice that two-sided.
    assert cell_gap(tried, rows([0.1, 0.1]), CLUTCH).engaged_p == pytest.approx(1 / 3)
    unknown = gather([Reading(2, POINT, 10, None, None)])[0]
    assert cell_gap(unknown, rows([0.1, 0.1]), CLUTCH).engaged_p is None
    failed = gather([Reading(2, POINT, 10, None, False)])[0]
    odd = cell_gap(failed, rows([0.1] * 16), CLUTCH).engaged_p
    assert odd is not None
    assert odd < 1e-6
    never = cell_gap(cell([0.1, 0.1]), rows([None, None]), CLUTCH)
    assert never.gap is None
    assert never.z is None


def test_a_tail_that_no_angle_met_is_reckoned_with() -> None:
    """The pitch passes in 40 ms at 100 1/min; where the range is wider no tail is unseen."""
    fast = OperatingPoint(100 * RPM, POINT.profile)
    narrow = unseen_tail(CLUTCH, fast, [0.070] * 14)
    assert narrow == pytest.approx(0.04 * math.sqrt(15 / 16 / 16))
    assert unseen_tail(CLUTCH, fast, [0.070] * 13 + [0.111]) == 0.0
    slow = OperatingPoint(10 * RPM, POINT.profile)
    assert unseen_tail(CLUTCH, slow, [0.070] * 14) == pytest.approx(narrow * 0.07 / 0.04)
    assert unseen_tail(CLUTCH, OperatingPoint(0.0, POINT.profile), [0.07] * 14) == 0.0


def test_ranks_of_single_times() -> None:
    """All of three above all of three: 2 of 20 orders are as odd. One long tail is no gap."""
    apart = cell_gap(cell([0.13, 0.14, 0.15]), rows([0.10, 0.11, 0.12]), CLUTCH)
    assert apart.times_p == pytest.approx(0.1)
    simulated = (0.050 + 0.001 * np.arange(16)).tolist()
    tail = cell_gap(cell([*(0.0505 + 0.002 * np.arange(8)), 0.27]), rows(simulated), CLUTCH)
    assert tail.z is not None
    assert tail.z > 4.0
    assert tail.times_p is not None
    assert tail.times_p > 0.5
    assert cell_gap(cell([0.1, 0.1]), rows([0.1] * 3), CLUTCH).times_p is None


def budget(gap: float, point: OperatingPoint, errors: ErrorBudget) -> CellGap:
    made = cell_gap(cell([0.1 + gap] * 2, point), rows([0.1] * 3), CLUTCH)
    return replace(made, errors=errors)


def test_sums_over_the_map_by_hand() -> None:
    slow, fast = OperatingPoint(5.0, POINT.profile), OperatingPoint(20.0, POINT.profile)
    cells = (
        budget(0.03, slow, ErrorBudget(0.01, 0.0, 0.002)),
        budget(-0.04, fast, ErrorBudget(0.01, 0.005, 0.002)),
    )
    found = GapMap(load_bench("mq200_adams"), cells)
    assert found.baseline_rmse == pytest.approx(math.sqrt(0.0025 / 2))
    assert found.floor_rmse == pytest.approx(math.sqrt((2e-4 + 2.5e-5 + 8e-6) / 2))
    shares = found.shares
    assert shares.bench == pytest.approx(2e-4 / 0.0025)
    assert shares.simulation == pytest.approx(2.5e-5 / 0.0025)
    assert shares.numerics == pytest.approx(8e-6 / 0.0025)
    assert shares.systematic == pytest.approx(1 - 0.08 - 0.01 - 0.0032)
    z = [0.03 / math.sqrt(1.04e-4), -0.04 / math.sqrt(1.29e-4)]
    assert found.chi_square == pytest.approx((z[0] ** 2 + z[1] ** 2) / 2)
    (force,) = found.by_force
    assert (force.value, force.cells) == (469.0, 2)
    assert force.gap == pytest.approx(-0.005)
    assert force.standard_error == pytest.approx(math.sqrt(2.25e-4 / 4 + 0.002**2))
    assert [m.value for m in found.by_mismatch] == [5.0, 20.0]
    assert [m.gap for m in found.by_mismatch] == pytest.approx([0.03, -0.04])


def made_up_bench(effect: float, seed: int, cells: int = 400) -> tuple[Bench, list[list[Any]]]:
    """Means of ten shifts and sixteen simulated ones of one saw-tooth, 60 ms wide, per cell."""
    draw = np.random.default_rng(seed)
    bench = load_bench("mq200_adams")
    readings, simulated = [], []
    for k in range(cells):
        point = OperatingPoint(0.1 + k, POINT.profile)
        mean = float((0.05 + 0.06 * draw.random(10)).mean()) + effect
        readings.append(Reading(k, point, 10, mean, True))
        simulated.append(rows((0.05 + 0.06 * (np.arange(16) + draw.random()) / 16).tolist()))
    return replace(bench, cells=gather(readings)), simulated


@pytest.mark.parametrize("effect", [0.0, 0.01])
def test_known_noise_comes_out_as_noise(effect: float) -> None:
    bench, simulated = made_up_bench(effect, seed=4)
    found = gap_map(bench, lambda _: simulated, checked=False)
    noise = 0.06**2 / 12 / 10 + 0.06**2 / 12 / 16**2
    share = found.shares.bench + found.shares.simulation
    # A mean square of 400 normal gaps is known to 7 %, of a constant and noise to less.
    assert share == pytest.approx(noise / (noise + effect**2), rel=0.2)
    if effect == 0.0:
        assert found.chi_square == pytest.approx(1.0, abs=0.2)
        assert found.shares.systematic < 0.15
    else:
        assert found.chi_square > 3.0
        assert found.shares.systematic == pytest.approx(1 - share)
    assert found.shares.numerics == 0.0


def test_numerics_are_found_by_repeating(clutch: Clutch) -> None:
    """A tolerance that adds 2 ms to every shift is an error of 2 ms, however many there are."""
    bench = replace(load_bench("mq200_adams"), clutch=clutch)

    def run(blocks: Sequence[Block]) -> list[list[dict[str, Any]]]:
        late = 0.002 if blocks[0].clutch.solver == clutch.solver else 0.0
        return [rows([0.08 + late + 0.01 * a for a in block.angles]) for block in blocks]

    found = gap_map(bench, run, angles=8)
    assert all(one.errors.numerics == pytest.approx(0.002) for one in found.cells)
    assert len(found.cells) == 28
    assert len(found.compared) == 25
    said = map_record(found)
    assert json.loads(json.dumps(said, allow_nan=False)) == said
    first, second = said["where"][:2]
    assert first["gap_s"] == pytest.approx(0.18384 - first["simulated_s"])
    assert first["z"] == pytest.approx(first["gap_s"] / first["standard_error_s"])
    assert second["gap_s"] is None
    assert second["bench_unknown"] == 10
    assert [one["cells"] for one in said["by_force"]] == [7, 6, 6, 6]


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

    still = overall(along(bench, same))
    assert [phase.name for phase in still] == list(PHASES)
    assert all(abs(phase.z) < 1.0 for phase in still)
    cells = tuple(
        replace(cell, readings=tuple(map(delayed, cell.readings))) for cell in bench.cells
    )
    before, *others = overall(along(replace(bench, cells=cells), same))
    assert before.gap == pytest.approx(0.02, abs=5e-4)
    assert before.z > 20.0
    assert all(abs(phase.z) < 1.0 for phase in others)
    assert before.bench == 8


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
