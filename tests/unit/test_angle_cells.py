"""Means of cells of the relative angle: exact at a step, unchanged where the time is smooth."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pytest

from dogshape.bench.bench_data import load_bench
from dogshape.diagnosis.prediction.angle_cells import BISECTIONS, STEP_SHARE, average_cells
from dogshape.diagnosis.prediction.simulations import settings_of
from dogshape.sim.statistics.blocks import Block, even_block
from dogshape.sim.statistics.shift_records import Record

COUNT = 48
LATE = np.array([0.5])  #: s, smallest delay of a late shift
SETTING = settings_of(load_bench("mq200_adams"), "sleeve")[0]
BLOCK = even_block(SETTING.clutch, SETTING.point, COUNT, (1, 0))
PITCH = BLOCK.clutch.dog.pitch_angle
TimeLaw = Callable[[float], float | None]  #: shift time, s, at a share of the pitch


def _times(law: TimeLaw, asked: list[int] | None = None) -> np.ndarray:
    """Average the times of a law over the cells of even angles, s, (COUNT,)."""

    def run(blocks: Sequence[Block]) -> list[list[Record]]:
        if asked is not None:
            asked.append(sum(len(block.angles) for block in blocks))
        rows = []
        for block in blocks:
            times = [law(angle / PITCH) for angle in block.angles]
            rows.append([{"outcome": "engaged", "shift_time_s": time} for time in times])
        return rows

    (rows,) = run([BLOCK])
    times = replace(SETTING, delay=0.0).times_of(rows)[None]
    if asked is not None:
        asked.clear()
    return average_cells([BLOCK], [SETTING], times, LATE, run)[0]


@pytest.mark.parametrize("place", [0.1234, 0.5, 0.71, 0.93])
def test_the_mean_over_a_step_is_that_of_the_law(place: float) -> None:
    """The time falls by 0.04 s over the pitch and rises by 0.06 s at the step."""

    def law(share: float) -> float:
        return 0.1 - 0.04 * share + 0.06 * (share % 1.0 >= place)

    exact = 0.1 - 0.02 + 0.06 * (1.0 - place)
    even = np.mean([law(angle / PITCH) for angle in BLOCK.angles])
    asked: list[int] = []
    mean = _times(law, asked).mean()
    # Two steps: that at ``place`` and that of one pitch to the next.
    largest = 0.5 * (0.06 + 0.1) / COUNT / 2**BISECTIONS
    assert abs(mean - exact) < largest
    assert abs(even - exact) < COUNT * largest
    assert asked == BISECTIONS * [2]


def test_a_smooth_law_keeps_its_times() -> None:
    asked: list[int] = []

    def law(share: float) -> float:
        return 0.1 + 0.03 * float(np.sin(2.0 * np.pi * share))

    times = _times(law, asked)
    assert asked == []
    assert times == pytest.approx([law(angle / PITCH) for angle in BLOCK.angles])
    assert 0.03 * 2.0 * np.pi / COUNT < STEP_SHARE * 0.1


def test_late_shifts_and_those_that_do_not_engage_keep_their_times() -> None:
    def law(share: float) -> float | None:
        if share < 0.3:
            return 0.1
        return 0.9 if share < 0.4 else None

    times = _times(law)
    assert set(times.tolist()) == {0.1, 0.9, np.inf}


def test_a_shift_that_fails_within_the_interval_leaves_both_ends() -> None:
    even = {angle / PITCH for angle in BLOCK.angles}

    def law(share: float) -> float | None:
        if share not in even:
            return None
        return 0.1 if share < 0.5 else 0.15

    assert set(_times(law).tolist()) == {0.1, 0.15}
