"""Expectation to a wanted precision, and the numerical error beside it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from dogshape import expectation as results
from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.progress import WorkCounter
from dogshape.pipeline.reports.text import numerical_words
from dogshape.pipeline.simulate.evaluation import FIRST_ANGLES, MAX_ANGLES, expect_to_precision
from dogshape.sim.shift.clutch import Clutch
from dogshape.sim.statistics.blocks import REPEAT_INTERVAL, Block, numerical_error
from dogshape.sim.statistics.expectation import MixExpectation, even_phases
from dogshape.sim.statistics.shift_records import Record
from tests.conftest import Listener, Point

Time = Callable[[float], float | None]


def _run(study: Setup, time: Time, precision: float, said: list[str]) -> MixExpectation:
    """Expect a shift time that is a function of the share of the pitch."""

    def run(blocks: Sequence[Block]) -> list[list[Record]]:
        return [
            [{**_row(time(angle / block.clutch.dog.pitch_angle)), **given}
             for angle, given in zip(block.angles, block.inputs, strict=True)]
            for block in blocks
        ]  # fmt: skip

    made_up: Any = SimpleNamespace(run=run)
    with WorkCounter(Listener(said), 1) as progress:
        return expect_to_precision(study, study.points, precision, made_up, progress)[0]


def _row(time: float | None) -> Record:
    outcome = "engaged" if time else "timed_out"
    return {"outcome": outcome, "shift_time_s": time, "face_contacts": 1, "slots_skipped": 0}


def test_numerical_error_is_mean_and_scatter_of_repetitions(clutch: Clutch, point: Point) -> None:
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
    assert len(set(asked)) == 64 // REPEAT_INTERVAL
    assert error.difference == pytest.approx(-2e-3)
    assert error.standard_error == pytest.approx(1e-3 / np.sqrt(7))
    assert error.size == pytest.approx(np.hypot(2e-3, 1e-3 / np.sqrt(7)))
    assert error.is_bias
    assert error.flips == 0
    words = numerical_words(error, 3e-3).replace("\N{MINUS SIGN}", "-")
    assert "differ by -2.0 ± 0.4 ms in the mean, which ± leaves out: ± 3.6 ms with it" in words
    lost = numerical_error(blocks, rows, lambda again: [[_row(None)] for _ in again])
    assert lost.size > 0.7 * clutch.timeout
    assert lost.flips == 64 // REPEAT_INTERVAL

    def flip(again: Sequence[Block]) -> list[list[Record]]:
        return [[_row(0.1 + b.angles[0] + 0.05 * (k == 0))] for k, b in enumerate(again)]

    flipped = numerical_error(blocks, rows, flip)
    assert not flipped.is_bias
    assert flipped.flips == 1
    assert "1 of them takes another slot or outcome" in numerical_words(flipped, 3e-3)
    alone = [Block(clutch, point(50, 469.0), (0.1,))]
    assert np.isnan(numerical_error(alone, [[_row(0.2)]], fine).size)


def test_rounds_of_angles_hold_the_rounds_before() -> None:
    first = even_phases(6, seed=4, index=1)
    for factor in (2, 3, 5):
        more = even_phases(6 * factor, seed=4, index=1, base=6)
        assert np.diff(more) == pytest.approx(np.full(6 * factor - 1, 1 / (6 * factor)))
        assert all(np.abs(more - phase).min() < 1e-12 for phase in first)


def test_rounds_end_at_the_precision(study: Setup) -> None:
    said: list[str] = []

    def slope(phase: float) -> float:
        return 0.05 + 0.02 * (phase % 1.0)

    wide, fine = (_run(study, slope, goal, said) for goal in (0.01, 0.003))
    assert {p.n for p in wide.points} == {FIRST_ANGLES}
    assert {p.n for p in fine.points} == {2 * FIRST_ANGLES}
    assert len(said) == 1
    for found, goal in ((wide, 0.01), (fine, 0.003)):
        assert found.engaged_error <= goal * found.engaged_mean
        assert found.engaged_mean == pytest.approx(0.06, abs=3.0 * found.engaged_error)


def test_a_precision_out_of_reach_is_told(study: Setup) -> None:
    said: list[str] = []
    found = _run(study, lambda phase: 0.05 + 0.06 * ((1e4 * phase) % 1.0), 0.0001, said)
    assert {p.n for p in found.points} == {MAX_ANGLES}
    share = found.engaged_error / found.engaged_mean
    result = results.Expectation(study, found, 0.0001)
    (line,) = (part for part in result.to_parts() if str(part).startswith("warning: precision not"))
    assert (
        f"error {share:.3g}, wanted 0.0001 ({share - 0.0001:.3g} more), with {MAX_ANGLES}"
        in str(line)
    )
    assert result.to_dict()["precision"] == {"wanted": 0.0001, "reached": share}
    assert not results.Expectation(study, found, 0.1).shortfall
    assert not _run(study, lambda _: None, 0.01, said).engages
    assert said[-1] == "nothing engages at some operating point: no precision can be reached"
