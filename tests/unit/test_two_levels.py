"""The choice of angles of both engines, with made-up shifts in place of simulated ones."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import pytest

from dogshape.pipeline.config.study_file import Setup, load_study
from dogshape.pipeline.forecast import Kind
from dogshape.pipeline.progress import WorkCounter
from dogshape.pipeline.simulate.block_cost import FINE
from dogshape.pipeline.simulate.precision import MOST, Precise
from dogshape.pipeline.simulate.two_levels import (
    FEW,
    MANY,
    SURE,
    expect_in_two_levels,
    first_angles,
)
from dogshape.sim.shift.clutch import OperatingPoint
from dogshape.sim.statistics.blocks import Block, even_block
from dogshape.sim.statistics.expectation import expect_point
from dogshape.sim.statistics.numerical_error import repeated
from dogshape.sim.statistics.shift_records import Record, result_of
from tests.conftest import Listener, Said

Dogshape = Callable[..., Said]
Time = Callable[[OperatingPoint, float], float | None]


@dataclass
class MadeUp:
    """An executor whose engines are functions of operating point and share of the pitch."""

    drake: Time
    planar: Time
    asked: list[str] = field(default_factory=list)

    def run(self, blocks: Sequence[Block]) -> list[list[Record]]:
        """Return the records of blocks."""
        return [[self._shift(block, angle) for angle in block.angles] for block in blocks]

    def _shift(self, block: Block, angle: float) -> Record:
        engine = block.clutch.solver.engine
        self.asked.append(engine)
        time = self.planar if engine == "planar" else self.drake
        found = time(block.point, angle / block.clutch.dog.pitch_angle)
        outcome = "timed_out" if found is None else "engaged"
        return {"outcome": outcome, "shift_time_s": found}


def _slope(point: OperatingPoint, phase: float) -> float:
    """A saw-tooth, higher at lower speeds."""
    return 0.05 + 0.5 / abs(point.mismatch) * (phase % 1.0)


def _noise(_: OperatingPoint, phase: float) -> float:
    """Another time at each angle, as of the bounces of an engine that has nothing to do with it."""
    return float(0.05 + 0.06 * ((1e4 * phase) % 1.0))


def _engaging(share: float) -> Time:
    return lambda point, phase: _slope(point, phase) if phase % 1.0 < share else None


@pytest.fixture(scope="module")
def default() -> Setup:
    return load_study("mq200_paper")


def _run(study: Setup, engines: MadeUp, precision: float, said: list[str] | None = None) -> Precise:
    with WorkCounter(Listener([] if said is None else said), 1) as progress:
        return expect_in_two_levels(study, study.points, precision, engines, progress)  # type: ignore[arg-type]


def test_equal_engines_need_few_of_drakes(default: Setup) -> None:
    found = _run(default, MadeUp(_slope, _slope), 0.01).expectation
    assert found.standard_error <= 0.01 * found.mean
    assert {(p.n, p.n_planar) for p in found.points} == {(FEW, MANY)}
    exact = [0.05 + 0.25 / abs(p.point.mismatch) for p in found.points]
    assert found.mean == pytest.approx(np.mean(exact), abs=3.0 * found.standard_error)


def test_it_stops_at_the_precision_and_not_at_the_next_doubling(default: Setup) -> None:
    """Some points get more angles, not all of them, and those that need them most."""
    said: list[str] = []
    found = _run(default, MadeUp(_slope, _slope), 0.0015, said).expectation
    assert 0.5 * 0.0015 < found.standard_error / found.mean <= 0.0015
    counts = [p.n_planar for p in found.points]
    assert min(counts) == MANY < max(counts)
    assert counts[0] == max(counts), "the slowest mismatch has the highest saw-tooth"
    assert any("compiled ones; more where they tell most" in line for line in said)


def test_an_engine_that_does_not_help_is_left(default: Setup) -> None:
    """Drake's own even angles are better than differences from noise."""
    found = _run(default, MadeUp(_slope, _noise), 0.01)
    assert all(p.n_planar == 0 and p.n >= SURE for p in found.expectation.points)
    assert found.expectation.standard_error <= 0.01 * found.expectation.mean
    for told, rows in zip(found.expectation.points, found.rows, strict=True):
        shifts = [result_of(row) for row in rows]
        assert told == expect_point(told.point, shifts, 1.0, 0.2)


def test_an_engine_that_helps_at_some_points_is_left_at_the_others(default: Setup) -> None:
    def planar(point: OperatingPoint, phase: float) -> float:
        return (_noise if point.mismatch > 20.0 else _slope)(point, phase)

    found = _run(default, MadeUp(_slope, planar), 0.002).expectation
    fast = [p for p in found.points if p.point.mismatch > 20.0]
    slow = [p for p in found.points if p.point.mismatch < 5.0]
    assert all(p.n_planar == 0 for p in fast)
    assert all(p.n_planar >= MANY for p in slow)


def test_a_tail_that_drakes_few_angles_miss_is_no_reason_to_leave(default: Setup) -> None:
    """One angle of fifty is late: 24 of Drake's that have none would look exact."""

    def late(_: OperatingPoint, phase: float) -> float:
        return 0.30 if phase % 1.0 < 0.02 else 0.06 + 0.001 * (phase % 1.0)

    found = _run(default, MadeUp(late, late), 0.001).expectation
    assert all(p.n_planar for p in found.points)
    exact = 0.98 * 0.06 + 0.02 * 0.30 + 0.001 * (0.5 - 0.5 * 0.02**2)
    assert found.mean == pytest.approx(exact, abs=3.0 * found.standard_error)


def test_what_engages_in_one_engine_alone_is_counted(default: Setup) -> None:
    """Drake hangs at a tenth of the angles, the compiled engine nowhere, and the other way."""
    for drake, planar in ((0.9, 1.0), (1.0, 0.9)):
        found = _run(default, MadeUp(_engaging(drake), _engaging(planar)), 0.02).expectation
        slopes = [0.05 + 0.25 * drake / abs(p.point.mismatch) for p in found.points]
        exact = np.mean(slopes) + (1.0 - drake) / drake * 1.2
        assert found.mean == pytest.approx(exact, abs=3.0 * found.standard_error)


def test_nothing_engages(default: Setup) -> None:
    said: list[str] = []
    engines = MadeUp(lambda *_: None, _slope)
    found = _run(default, engines, 0.01, said).expectation
    assert not found.engages
    assert said[-1] == "nothing engages at some operating point: no precision can be reached"
    assert max(p.n for p in found.points) in (2 * FEW, 4 * FEW)


def test_a_precision_out_of_reach_is_told(default: Setup) -> None:
    said: list[str] = []
    found = _run(default, MadeUp(_noise, _slope), 0.0001, said).expectation
    assert {p.n for p in found.points} == {MOST}
    assert f"is what {MOST} angles of Drake at each operating point give" in said[-1]


def test_the_same_question_has_the_same_answer(default: Setup) -> None:
    first, second = (_run(default, MadeUp(_slope, _noise), 0.01) for _ in range(2))
    assert first == second


def test_pairs_have_the_same_angles_and_factors() -> None:
    """Both engines simulate the same uncertain clutch, however many angles either has."""
    study = load_study("mq200_robust")
    few, middle, many = (
        even_block(study.clutch, study.points[1], n, (4, 1), FEW, uncertainty=study.uncertainty)
        for n in (FEW, 2 * FEW, MANY)
    )
    drawn = {round(angle, 12): v for angle, v in zip(many.angles, many.variants, strict=True)}
    assert len(drawn) == MANY
    for block in (few, middle):
        for angle, variant in zip(block.angles, block.variants, strict=True):
            assert drawn[round(angle, 12)] == variant


def test_first_angles_are_enough_to_believe_an_error() -> None:
    assert first_angles(28, 0.01).few == FEW
    assert first_angles(28, 0.005).few == 2 * FEW
    assert first_angles(1, 0.2).few == 24
    assert first_angles(1, 0.01).few == SURE
    assert first_angles(1, 0.01).many == MANY


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--precision", 0.1, "--levels", 3), ("--levels is 3", "1 or 2")),
        (("--levels", 1), ("--levels goes with --precision",)),
        (("--precision", 0.1, "--levels", 2, "--engine", "planar"), ("leave out --levels",)),
    ],
)
def test_bad_levels_are_a_sentence(
    dogshape: Dogshape, options: tuple[object, ...], words: tuple[str, ...]
) -> None:
    said = dogshape("expect", "mq200_paper", *options)
    assert said.status == 2
    assert all(word in said.sentence for word in words)


def test_time_left_is_never_nought_before_the_last_round(default: Setup) -> None:
    """The forecast of a round holds its shifts and those that are repeated after it."""
    expected: list[dict[Kind, float]] = []

    class Watched(WorkCounter):
        def expects(self, left: Mapping[Kind, float]) -> None:
            expected.append(dict(left))
            super().expects(left)

    engines = MadeUp(_slope, _slope)
    with Watched(Listener([]), 1) as progress:
        found = expect_in_two_levels(default, default.points, 0.0015, engines, progress)  # type: ignore[arg-type]
    first, last = expected[0], expected[-1]
    assert len(expected) > 2, "a round more than the first"
    assert first["shift"] > len(default.points) * FEW
    assert first["quick"] > len(default.points) * MANY
    assert all(left["shift"] > 0.0 for left in expected)
    assert last == pytest.approx({"shift": FINE * repeated(found.expectation.shifts)})
