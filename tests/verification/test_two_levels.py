"""The expected shift time in two levels against functions of the angle that can be worked out."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from dogshape.sim.shift.clutch import OperatingPoint
from dogshape.sim.shift.outcome import Outcome
from dogshape.sim.statistics.expectation import (
    ShiftResult,
    even_phases,
    expect_point,
    variance_of_mean,
)
from dogshape.sim.statistics.two_levels import TwoLevelPoint, common_spreads, two_level_point

Point = Callable[[float, float], OperatingPoint]
Time = Callable[[float], float | None]

TIMEOUT, RETRACTION = 1.0, 0.2
REPEATS = 400


def _shifts(time: Time, phases: np.ndarray) -> list[ShiftResult]:
    times = [time(float(phase) % 1.0) for phase in phases]
    return [ShiftResult(Outcome.TIMED_OUT if t is None else Outcome.ENGAGED, t) for t in times]


def _levels(
    point: OperatingPoint, cheap: Time, dear: Time, counts: tuple[int, int], seed: int
) -> TwoLevelPoint:
    fine, coarse = (even_phases(count, seed, 0, 3) for count in counts)
    places = [int(np.abs(fine - phase).argmin()) for phase in coarse]
    assert fine[places] == pytest.approx(coarse)
    shifts = _shifts(dear, coarse)
    alone = expect_point(point, shifts, TIMEOUT, RETRACTION)
    lost = TIMEOUT + RETRACTION
    found = two_level_point(alone, _shifts(cheap, fine), shifts, places, lost)
    assert found is not None
    return found


def _mean(time: Time) -> float:
    """Work out the expected time with its retries on a grid far finer than any jump is wide."""
    shifts = _shifts(time, (np.arange(20_000) + 0.5) / 20_000)
    times = np.array([s.shift_time for s in shifts if s.shift_time is not None])
    share = times.size / len(shifts)
    return float(times.mean() + (1.0 - share) / share * (TIMEOUT + RETRACTION))


def _cheap(phase: float) -> float:
    """A slope, a jump and a level."""
    return 0.05 + (0.1 * phase if phase < 0.6 else 0.02)


def _dear(phase: float) -> float:
    """The same, and beside it a scatter that is 5 ms in the mean."""
    return _cheap(phase) + 0.01 * ((1e5 * np.sin(1e5 * phase)) % 1.0)


def _other_slot(phase: float) -> float:
    """The same, and at one angle of fifty another slot."""
    return _dear(phase) + (0.1 if 0.70 < phase < 0.72 else 0.0)


@pytest.mark.parametrize("dear", [_dear, _other_slot])
def test_unbiased_however_rare_a_difference_is(point: Point, dear: Time) -> None:
    exact, here = _mean(dear), point(50, 469.0)
    assert exact - _mean(_cheap) > 0.004, "the cheap engine alone is wrong"
    means = [_levels(here, _cheap, dear, (48, 6), seed).mean for seed in range(REPEATS)]
    assert np.mean(means) == pytest.approx(exact, abs=4.0 * np.std(means) / REPEATS**0.5)


@pytest.mark.parametrize(("few", "many"), [(6, 48), (12, 48), (12, 96)])
def test_the_interval_holds_the_mean(point: Point, few: int, many: int) -> None:
    """Eight operating points share their spread of differences, as in a study."""
    exact, here = _mean(_dear), point(50, 469.0)
    means, errors = np.empty((REPEATS // 4, 8)), np.empty((REPEATS // 4, 8))
    for k in range(len(means)):
        found = [_levels(here, _cheap, _dear, (many, few), 8 * k + place) for place in range(8)]
        told = [p.expectation(s) for p, s in zip(found, common_spreads(found), strict=True)]
        means[k], errors[k] = [p.mean for p in told], [p.standard_error for p in told]
    assert 0.90 <= np.mean(np.abs(means - exact) <= 1.96 * errors) <= 0.99
    whole = np.sqrt(np.mean(errors**2, axis=1) / 8)
    assert 0.90 <= np.mean(np.abs(means.mean(axis=1) - exact) <= 1.96 * whole) <= 0.99
    assert 0.95 * means.std() <= np.sqrt(np.mean(errors**2)) <= 1.3 * means.std()


def test_both_levels_are_in_the_error(point: Point) -> None:
    """The variance falls to that of the differences where the cheap level has more and more."""
    errors = []
    for many in (12, 48, 768):
        found = _levels(point(50, 469.0), _cheap, _dear, (many, 12), 3)
        assert found.variance(found.spread) == pytest.approx(
            found.cheap_variance + found.spread / 12
        )
        errors.append(found.variance(found.spread))
    assert errors[0] > errors[1] > errors[2]
    assert errors[2] == pytest.approx(found.spread / 12, rel=0.05)


def test_engines_that_agree_leave_the_error_of_the_cheap_level_alone(point: Point) -> None:
    found = _levels(point(50, 469.0), _dear, _dear, (48, 3), 1)
    times = np.array([_dear(float(phase)) for phase in even_phases(48, 1, 0, 3)])
    told = found.expectation(found.spread)
    assert found.spread == pytest.approx(0.0, abs=1e-30)
    assert told.mean == pytest.approx(times.mean())
    assert told.standard_error == pytest.approx(variance_of_mean(times) ** 0.5)
    assert (told.n, told.n_planar) == (3, 48)


def test_as_many_angles_in_both_leave_nothing_of_the_cheap_engine(point: Point) -> None:
    """Whatever it says, lost shifts included."""

    def rubbish(phase: float) -> float | None:
        return None if phase < 0.3 else 3.0 * phase

    def hung(phase: float) -> float | None:
        return None if phase > 0.9 else _dear(phase)

    for dear in (_dear, hung):
        found = _levels(point(50, 469.0), rubbish, dear, (24, 24), 5)
        assert found.mean == pytest.approx(found.alone.mean)
        assert found.mean_engaged == pytest.approx(found.alone.mean_engaged)


def test_shifts_that_engage_in_one_engine_alone_count_as_they_should(point: Point) -> None:
    """Windows in which either engine hangs overlap in part: only Drake's share is in the mean."""

    def cheap(phase: float) -> float | None:
        return None if 0.20 < phase < 0.45 else _cheap(phase)

    def dear(phase: float) -> float | None:
        return None if 0.30 < phase < 0.50 else _dear(phase)

    exact = _mean(dear)
    assert exact == pytest.approx(_mean(_dear) + 0.25 * 1.2, rel=0.1)
    assert _mean(cheap) > exact + 0.05
    means = [_levels(point(50, 469.0), cheap, dear, (96, 24), k).mean for k in range(REPEATS)]
    # A ratio of means: its bias is of the order of the share's variance, 1/n2 for even angles.
    assert np.mean(means) == pytest.approx(exact, abs=4.0 * np.std(means) / REPEATS**0.5 + 1e-3)


def test_failed_integrations_of_drake_say_nothing(point: Point) -> None:
    """As in one level: a mean over those that are sound."""
    times = (0.05, 0.07, None, 0.06)
    dear = [ShiftResult(Outcome.ENGAGED if t else Outcome.DIVERGED, t) for t in times]
    alone = expect_point(point(50, 469.0), dear, TIMEOUT, RETRACTION)
    found = two_level_point(alone, dear, dear, range(4), 1.2)
    assert found is not None
    assert found.mean == pytest.approx(0.06)
    assert alone.n == 3


def test_no_mean_where_no_shift_of_drake_engages(point: Point) -> None:
    lost, engaged = ShiftResult(Outcome.BLOCKED, None), ShiftResult(Outcome.ENGAGED, 0.05)
    alone = expect_point(point(50, 469.0), [lost] * 3, TIMEOUT, RETRACTION)
    assert two_level_point(alone, [engaged] * 6, [lost] * 3, (0, 2, 4), 1.2) is None


def test_a_point_without_differences_borrows_its_neighbours_spread(point: Point) -> None:
    """Ten mismatches, one of which differs: the nearest eight look less exact for it."""

    points = [
        _levels(point(10.0 * k, 469.0), _cheap, _dear if k == 1 else _cheap, (48, 3), 1)
        for k in range(1, 11)
    ]
    common = common_spreads(points)
    assert points[0].spread > 0.0
    assert 0.0 < common[1] < common[0]
    assert common[0] == pytest.approx(0.5 * points[0].spread * (1 + 1 / 8))
    assert common[-1] == pytest.approx(0.0, abs=1e-30)
