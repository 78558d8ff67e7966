"""What a pair's second effect leaves after a refit of the first, where it is known exactly."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from dogshape.diagnosis.bench.bench_data import load_bench
from dogshape.diagnosis.prediction.bank import settings_of
from dogshape.diagnosis.prediction.prediction import Prediction
from dogshape.diagnosis.settings import Rules
from dogshape.diagnosis.terms import Array, Hypothesis
from dogshape.sim.effects import load
from dogshape.validation.blind.pair_refit import Refit, Seen, errors_of, left_by, left_of

SETTINGS = settings_of(load_bench("mq200_adams"))[:6]
POINTS = [[s.point.mismatch, s.point.profile.force, 0.1] for s in SETTINGS]
EFFECTS = load(None)
BASE, SD, ERROR, SHIFTS = 0.3, 4e-3, 1e-3, 10
DELAY, FRICTION = "actuation_delay", "sleeve_friction"
PAIR = {DELAY: {"delay_s": 0.1}, FRICTION: {"friction_N": 50.0}}
CASE: dict[str, Any] = {"parameters": PAIR, "times_s": [[BASE] * SHIFTS] * len(POINTS)}
#: Without errors of the simulation, so that what the toy says is all there is.
BARE = Rules(model_error=0.0, least_error=0.0, discrepancy=0.0)
#: s of the mean time for 1 s of delay and 1 N of friction, at each operating point.
LATER = np.array([1.0, 1.0, 1.0, 1.0, 1.0, 1.0])
SLOWER = 1e-4 * np.array([3.0, -1.0, 2.0, 0.5, 1.0, 4.0])


class Linear:
    """Means that change along one direction for each effect, with the same scatter everywhere."""

    def __init__(self, directions: dict[str, Array]) -> None:
        self._directions = directions

    def at(self, hypothesis: Hypothesis, values: Array, cell: int) -> Prediction:
        along = np.array([self._directions[name][cell] for name in hypothesis])
        mean = BASE + (values @ along if len(along) else np.zeros(len(values)))
        times = mean[:, None] + SD * np.sqrt(0.5) * np.array([-1.0, 1.0])
        m = len(values)
        return Prediction.plain(times, np.ones(m), np.full(m, ERROR), np.full(m, 1e-3))


def _seen(rules: Rules, friction: Array = SLOWER) -> Seen:
    return Seen(Linear({DELAY: LATER, FRICTION: friction}), EFFECTS, SETTINGS, rules)


def _weighted(one: Array, other: Array, covariance: Array) -> float:
    return float(one @ np.linalg.solve(covariance, other))


@pytest.mark.parametrize("common", [0.0, 0.04], ids=["own errors", "common errors too"])
def test_what_is_left_is_what_the_partners_direction_does_not_have(common: float) -> None:
    """The residual of weighted least squares: a - (a.b/b.b) b, whose square is a.a - (a.b)^2/b.b.

    a is what friction adds and b the direction of the delay.
    """
    rules = Rules(model_error=0.0, least_error=0.0, discrepancy=common)
    added = 50.0 * SLOWER
    seen = _seen(rules)
    found = left_by(seen, CASE, POINTS, {FRICTION: added})[FRICTION]
    own = (SD**2 / SHIFTS + ERROR**2) * np.eye(len(POINTS))
    covariance = errors_of(seen, CASE, range(len(POINTS)), np.full(len(POINTS), float(SHIFTS)))
    if not common:
        np.testing.assert_allclose(covariance, own, rtol=1e-12)
    before = _weighted(added, added, covariance)
    taken = _weighted(added, LATER, covariance) ** 2 / _weighted(LATER, LATER, covariance)
    assert found.before == pytest.approx(math.sqrt(before), rel=1e-9)
    assert found.after == pytest.approx(math.sqrt(before - taken), rel=1e-4)
    assert found.after < found.before


def test_the_discrepancy_joins_the_covariance() -> None:
    """Of each point it adds some 4 % of the mean time, of neighbours nearly all of that."""
    rules = Rules(model_error=0.0, least_error=0.0, discrepancy=0.04)
    covariance = errors_of(_seen(rules), CASE, [0, 1], np.full(2, float(SHIFTS)))
    bare = errors_of(_seen(BARE), CASE, [0, 1], np.full(2, float(SHIFTS)))
    added = covariance - bare
    assert SETTINGS[0].point.mismatch == SETTINGS[1].point.mismatch
    assert np.sqrt(np.diag(added)) == pytest.approx(0.04 * BASE, rel=0.3)
    assert 0.0 < added[0, 1] < added[0, 0]


def test_a_partner_that_does_the_same_leaves_nothing() -> None:
    """A friction that makes all shifts later by 20 ms is another 20 ms of delay."""
    added = 50.0 * 4e-4 * LATER
    found = left_by(_seen(BARE, 4e-4 * LATER), CASE, POINTS, {FRICTION: added})[FRICTION]
    assert found.before > 20.0
    assert found.after < 1e-3 * found.before


def test_a_partner_that_can_do_none_of_it_leaves_all() -> None:
    across = 1e-4 * np.array([1.0, -1.0, 2.0, -2.0, 3.0, -3.0])
    added = 50.0 * across
    found = left_by(_seen(BARE, across), CASE, POINTS, {FRICTION: added})[FRICTION]
    assert found.after == pytest.approx(found.before, rel=1e-9)
    error = math.sqrt(SD**2 / SHIFTS + ERROR**2)
    assert found.before == pytest.approx(np.linalg.norm(added) / error, rel=1e-9)


def test_a_partner_takes_over_no_more_than_its_prior_allows() -> None:
    """0.1 s of delay and 0.35 s more: the prior ends at 0.4 s, so 0.05 s stay at each point."""
    found = left_by(_seen(BARE), CASE, POINTS, {FRICTION: 0.35 * LATER})[FRICTION]
    error = math.sqrt(SD**2 / SHIFTS + ERROR**2)
    assert found.after == pytest.approx(0.05 * math.sqrt(len(POINTS)) / error, rel=1e-6)


def test_a_partner_without_parameters_has_nothing_to_refit() -> None:
    """The reversed sense of rotation is there or not."""

    class Same:
        def at(self, hypothesis: Hypothesis, values: Array, cell: int) -> Prediction:
            m = len(values)
            times = np.tile(BASE + SD * np.array([-1.0, 1.0]), (m, 1))
            return Prediction.plain(times, np.ones(m), np.full(m, ERROR), np.full(m, 1e-3))

    seen = Seen(Same(), EFFECTS, SETTINGS, BARE)
    refit = Refit(seen, {"reversed_mismatch": {}}, range(len(SETTINGS)), np.eye(len(SETTINGS)))
    left = left_of(refit, SLOWER)
    assert left.after == left.before == pytest.approx(float(np.linalg.norm(SLOWER)))


def test_points_without_a_mean_of_both_tell_nothing() -> None:
    added = 50.0 * SLOWER
    covariance = np.diag(np.where(np.arange(6) == 5, np.inf, 1e-6))
    refit = Refit(_seen(BARE), {DELAY: PAIR[DELAY]}, range(6), covariance)
    some = left_of(refit, np.where(np.arange(6) == 4, np.nan, added))
    few = Refit(_seen(BARE), {DELAY: PAIR[DELAY]}, range(4), np.diag(np.full(4, 1e-6)))
    assert some == left_of(few, added[:4])
    assert left_of(refit, np.full(6, np.nan)).after == 0.0
