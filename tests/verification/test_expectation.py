"""The expected shift time against cases that can be worked out."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from dogshape import expectation as results
from dogshape.pipeline.config.study_file import load_study
from dogshape.sim.shift.conclusion import Outcome
from dogshape.sim.statistics.expectation import (
    MixExpectation,
    ShiftResult,
    even_phases,
    expect,
    expect_point,
)
from dogshape.sim.statistics.hangs import weak_priors
from tests.conftest import Point


def _shifts(*times: float | None) -> list[ShiftResult]:
    return [ShiftResult(Outcome.ENGAGED if t else Outcome.BLOCKED, t) for t in times]


def test_retries_until_it_engages(point: Point) -> None:
    """p = 3/4: a third of a failed attempt on average, each 1.2 s; failed runs are left out."""
    failed = ShiftResult(Outcome.DIVERGED, None)
    shifts = [*_shifts(0.05, 0.06, None, 0.07) * 5000, failed]
    result = expect_point(point(50, 469.0), shifts, 1.0, 0.2)
    assert result.unaided_mean == pytest.approx(0.06)
    assert result.engaged_mean == pytest.approx(0.06)
    assert result.mean == pytest.approx(0.06 + 1.2 / 3, rel=1e-3)
    assert (result.engaged, result.n) == (0.75, 20000)


def test_hung_shifts_are_counted_and_the_mean_without_them_stands_beside(point: Point) -> None:
    """One hang in six angles of one of two points: its posterior odds, times the point's weight."""
    heavy = replace(point(5, 469.0), weight=3.0)
    both = expect(
        [
            expect_point(heavy, _shifts(*[0.09] * 5, None), 1.0, 0.2),
            expect_point(point(50, 469.0), _shifts(*[0.05] * 6), 1.0, 0.2),
        ]
    )
    assert (both.shifts, both.lost, both.blocked) == (12, 1, 1)
    assert both.unaided_mean == pytest.approx(0.75 * 0.09 + 0.25 * 0.05)
    assert both.engaged_mean == pytest.approx(both.unaided_mean)
    prior, _ = weak_priors(2)
    hung, none = (prior.posterior(hangs, 6).mean for hangs in (1, 0))
    retries = 1.2 * (0.75 * hung / (1.0 - hung) + 0.25 * none / (1.0 - none))
    assert both.mean == pytest.approx(both.engaged_mean + retries)
    assert both.hang_probability == pytest.approx(0.75 * hung + 0.25 * none)
    assert "1 of 12 shifts did not engage: 1 held dog on dog by friction" in _printed(both)
    assert "mean of engaged shifts 80.0 ms" in _printed(both)  # all alike: no error to state
    late = [ShiftResult(Outcome.TIMED_OUT, None), *_shifts(None, 0.05, 0.06, 0.07)]
    mixed = _printed(expect([expect_point(heavy, late, 1.0, 0.2)]))
    assert "2 of 5 shifts did not engage: 1 held" in mixed
    assert "friction, 1 short of full depth at the time-out" in mixed
    whole = expect([expect_point(heavy, _shifts(0.05, 0.06, 0.07), 1.0, 0.2)])
    assert whole.unaided_mean == pytest.approx(whole.engaged_mean) == pytest.approx(0.06)
    assert re.search(r"expected shift time \d+\.\d ms \(95 %: [5-6]\d\.\d ms to ", _printed(whole))
    assert "3 angles are too few to judge hangs" in _printed(whole)
    assert "none of 3 shifts hung" in _printed(whole)
    assert "those rarer than 1 in 3 cannot be seen in 3 shifts" in _printed(whole)
    times = [0.05 + 1e-5 * k for k in range(400)]
    many = _printed(expect([expect_point(heavy, _shifts(*times), 1.0, 0.2)]))
    assert re.search(r"expected shift time \d+\.\d\d ± \d+\.\d\d ms", many)
    assert "too few" not in many


def test_error_bars_of_few_angles_are_positive(point: Point) -> None:
    """Two points at three angles: the bars hold the mean and begin above zero."""
    places = [point(5, 469.0), point(50, 469.0)]
    mean = expect([expect_point(place, _shifts(0.05, 0.06, 0.07), 1.0, 0.2) for place in places])
    result = results.Expectation(load_study("mq200_paper"), mean)
    (marks,) = result.plot().data
    lows = np.array(marks.x) - marks.error_x.arrayminus
    assert (lows > 40.0).all()
    assert (np.array(marks.error_x.array) > np.array(marks.error_x.arrayminus)).all()
    record = result.to_dict()
    low, high = record["expected_shift_time_low_s"], record["expected_shift_time_high_s"]
    assert (low, high) == result.interval_s
    assert 0.04 < low < record["expected_shift_time_s"] < high
    assert record["judges_hangs"] is False


def _printed(result: MixExpectation) -> str:
    parts = results.Expectation(load_study("mq200_paper"), result).to_parts()
    return "\n".join(part for part in parts if isinstance(part, str))


def test_nothing_engaged_gives_no_time(point: Point) -> None:
    result = expect_point(point(50, 469.0), _shifts(None, None), 1.0, 0.2)
    assert result.unaided_mean is None
    assert result.mean == pytest.approx(1.0 + 2 * 1.2)  # for what learns from it
    assert result.engaged == 0.0
    assert result.time is None
    assert expect([result]).time is None


@pytest.mark.parametrize(("engaged", "timed"), [(1, False), (4, False), (5, True), (10, True)])
def test_times_need_half_the_shifts_at_each_point(engaged: int, timed: bool, point: Point) -> None:
    times = [0.05] * engaged + [None] * (10 - engaged)
    rare, sure = (
        expect_point(point(speed, 469.0), _shifts(*mine), 1.0, 0.2)
        for speed, mine in ((50, times), (100, [0.06] * 10))
    )
    both = expect([rare, sure])
    assert (rare.time is not None) == (both.time is not None) == timed
    assert sure.engaged_mean == pytest.approx(0.06)
    assert (both.shifts, both.lost) == (20, 10 - engaged)
    assert (f"engages in {10 + engaged} of 20 shifts" in _printed(both)) is not timed


def _errors(point: Point, time: Callable[[float], float], n: int) -> tuple[float, float, float]:
    """Draw 400 starts; return mean, scatter of the mean, root-mean-square standard error."""
    drawn = [
        expect_point(point(50, 469.0), _shifts(*[time(p) for p in even_phases(n, s, 0)]), 1.0, 0.2)
        for s in range(400)
    ]
    means = np.array([d.engaged_mean for d in drawn])
    return means.mean(), means.std(), float(np.sqrt(np.mean([d.engaged_error**2 for d in drawn])))


def test_standard_error_covers_slopes_with_jumps(point: Point) -> None:
    """A slope, a jump and a level: unbiased, the error at least the scatter, at most twice."""
    exact = 0.05 + 0.1 * 0.6**2 / 2 + 0.02 * 0.4
    for n in (6, 16):
        mean, scatter, error = _errors(point, lambda p: 0.05 + (0.1 * p if p < 0.6 else 0.02), n)
        assert mean == pytest.approx(exact, abs=4 * scatter / 20)
        assert scatter <= error <= 2.2 * scatter


def test_standard_error_of_a_saw_tooth_and_of_scatter(point: Point) -> None:
    """The two cases that the formula is made of, within their sampling error."""
    _, scatter, error = _errors(point, lambda p: 0.05 + 0.1 * p, 24)
    assert scatter == pytest.approx(0.1 / np.sqrt(12) / 24, rel=0.1)
    assert scatter <= error <= 1.3 * scatter
    rng = np.random.default_rng(7)
    _, scatter, error = _errors(point, lambda _: 0.05 + 0.1 * rng.random(), 24)
    assert error == pytest.approx(scatter, rel=0.2)
