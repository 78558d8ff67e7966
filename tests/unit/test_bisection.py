"""Angles that lie closer where the time jumps: closed forms, and even angles as the second way."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from dogshape.sim.elementwise import Array
from dogshape.sim.statistics.expectation import (
    even_phases,
    mean_round_the_pitch,
    middles_of_jumps,
)

Time = Callable[[Array], Array]


def saw(phases: Array) -> Array:
    """A slope with one jump at 0.3; its mean is 0.15."""
    return np.asarray(0.1 + 0.1 * ((phases - 0.3) % 1.0))


def missed(phases: Array) -> Array:
    """A slope that turns, with two jumps, one of which cancels it."""
    fall = 0.15 - 0.12 * phases
    return np.asarray(np.where(phases < 0.62, fall, fall + 0.1) - 0.06 * (phases > 0.9))


def sampled(time: Time, start: int, rounds: tuple[int, ...] = (3, 3, 2)) -> tuple[Array, Array]:
    phases = even_phases(8, start, 0)
    for count in rounds:
        phases = np.append(phases, middles_of_jumps(phases, time(phases), count))
    return phases, time(phases)


def test_a_saw_tooth_has_an_eighth_of_the_error_that_its_even_angles_have() -> None:
    """Three halvings leave an eighth of the interval in which the jump is."""
    found = [mean_round_the_pitch(*sampled(saw, start, (1, 1, 1))) for start in range(400)]
    errors = np.array([mean for mean, _ in found]) - 0.15
    even = np.array([saw(even_phases(8, start, 0)).mean() for start in range(400)]) - 0.15
    assert errors.std() == pytest.approx(even.std() / 8.0, rel=0.1)
    assert abs(errors.mean()) < 3.0 * errors.std() / 20.0
    # The jump is anywhere in an interval of 1/64: the variance in closed form.
    known = (0.1 / 64.0) ** 2 / 12.0
    assert [variance for _, variance in found] == pytest.approx([known] * 400, rel=1e-6)
    assert errors.var() == pytest.approx(known, rel=0.2)


@pytest.mark.parametrize("time", [saw, missed])
def test_the_variance_is_that_of_the_error_and_the_mean_is_that_of_many_angles(time: Time) -> None:
    many = float(time((np.arange(100_000) + 0.5) / 100_000).mean())
    found = [mean_round_the_pitch(*sampled(time, start)) for start in range(300)]
    errors = np.array([mean for mean, _ in found]) - many
    expected = float(np.mean([variance for _, variance in found]))
    assert abs(errors.mean()) < 4.0 * errors.std() / 300**0.5
    assert 0.7 < (errors**2).mean() / expected < 1.4
    even = np.array([time(even_phases(16, start, 0)).mean() for start in range(300)]) - many
    assert (errors**2).mean() < 0.1 * (even**2).mean()


def test_a_jump_that_cancels_its_slope_is_found() -> None:
    """Between its angles the time falls by 0.015 and jumps by 0.015: no difference shows it."""
    phases = np.arange(8) / 8.0
    times = 0.15 - 0.12 * phases
    times[5:] += 0.015
    times[0] = times[7] - 0.015  # the end of the pitch falls like all of it
    assert times[5] == pytest.approx(times[4])
    assert 4.5 / 8.0 in middles_of_jumps(phases, times, 2)
