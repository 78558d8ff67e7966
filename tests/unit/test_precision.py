"""Expectation to a wanted precision, and the numerical error beside it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pytest

from dogshape.sim.shift.clutch import Clutch, OperatingPoint
from dogshape.sim.statistics.blocks import Block
from dogshape.sim.statistics.expectation import even_phases
from dogshape.sim.statistics.numerical_error import CHECKED, numerical_error, numerical_ratio
from dogshape.sim.statistics.shift_records import Record
from tests.conftest import Said

Point = Callable[[float, float], OperatingPoint]
Dogshape = Callable[..., Said]


def _row(time: float | None) -> Record:
    return {"outcome": "engaged" if time else "timed_out", "shift_time_s": time}


def test_numerical_error_is_mean_and_scatter_of_the_repeated_shifts(
    clutch: Clutch, point: Point
) -> None:
    """An eighth of 64 shifts; times off by 1 ms and by 3 ms in turn."""
    angles = tuple(0.001 * k for k in range(64))
    blocks = [Block(clutch, point(50, 469.0), angles)]
    rows = [[_row(0.1 + angle) for angle in angles]]
    asked: list[float] = []

    def fine(again: Sequence[Block]) -> list[list[Record]]:
        assert all(b.clutch.solver.accuracy < clutch.solver.accuracy / 20 for b in again)
        asked.extend(b.angles[0] for b in again)
        off = [1e-3 if k % 2 else 3e-3 for k in range(len(again))]
        return [[_row(0.1 + b.angles[0] + o)] for b, o in zip(again, off, strict=True)]

    error = numerical_error(blocks, rows, fine)
    assert len(set(asked)) == 64 // CHECKED
    assert error == pytest.approx(np.hypot(2e-3, 1e-3 / np.sqrt(7)))
    lost = numerical_error(blocks, rows, lambda again: [[_row(None)] for _ in again])
    assert lost > 0.7 * clutch.timeout
    alone = [Block(clutch, point(50, 469.0), (0.1,))]
    assert np.isnan(numerical_error(alone, [[_row(0.2)]], fine))


def test_numerics_in_spreads_keep_what_does_not_average_out(clutch: Clutch, point: Point) -> None:
    """A tolerance that adds 2 ms to every shift is 2 ms off, however many shifts there are."""
    blocks = [Block(clutch, point(50, 469.0), tuple(0.01 * k for k in range(16)))] * 4
    rows = [[_row(0.1 + angle) for angle in blocks[0].angles]] * 4
    spread = np.std([0.1 + angle for angle in blocks[0].angles], ddof=1)

    def fine(again: Sequence[Block]) -> list[list[Record]]:
        return [[_row(0.098 + b.angles[0])] for b in again]

    mean, scatter = numerical_ratio(blocks, rows, fine)
    assert mean == pytest.approx(0.002 / spread)
    assert scatter == pytest.approx(0.0, abs=1e-9)


def test_rounds_of_angles_hold_the_rounds_before() -> None:
    first = even_phases(6, seed=4, index=1)
    for factor in (2, 3, 5):
        more = even_phases(6 * factor, seed=4, index=1, base=6)
        assert np.diff(more) == pytest.approx(np.full(6 * factor - 1, 1 / (6 * factor)))
        assert all(np.abs(more - phase).min() < 1e-12 for phase in first)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--precision", 0.0), ("--precision is 0", "0.001")),
        (("--precision", "nan"), ("--precision is nan",)),
        (("--precision", 0.1, "--angles", 6), ("leave out --angles",)),
    ],
)
def test_bad_precision_is_a_sentence(
    dogshape: Dogshape, options: tuple[Any, ...], words: tuple[str, ...]
) -> None:
    said = dogshape("expect", "mq200_paper", *options)
    assert said.status == 2
    assert all(word in said.sentence for word in words)
