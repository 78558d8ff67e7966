"""Yardstick of what can be told, where it is known exactly: effects along fixed directions."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.stats import norm

from dogshape.diagnosis.bench.bench_data import load_bench
from dogshape.diagnosis.likelihood.discrepancy import Discrepancy
from dogshape.diagnosis.likelihood.time_parts import sample_spread
from dogshape.diagnosis.prediction.bank import settings_of
from dogshape.diagnosis.prediction.hypotheses import NONE
from dogshape.diagnosis.prediction.prediction import Prediction
from dogshape.diagnosis.settings import Rules
from dogshape.diagnosis.terms import Array, Hypothesis
from dogshape.sim.effects import load
from dogshape.validation.blind.expected_means import Expected, moments
from dogshape.validation.blind.yardstick import (
    Asked,
    Seen,
    Series,
    Yardstick,
    asked_of,
    equivalence_power,
    rivals_of,
    seen_as,
)

SETTINGS = settings_of(load_bench("mq200_adams"))[:6]
EFFECTS = load(None)
BASE, SD, ERROR = 0.3, 4e-3, 1e-3
DELAY, SCALE, LAG = ("actuation_delay",), ("force_scale",), ("actuation_lag",)
#: s of the mean time for 1 s of delay, 1 of the force's factor, 1 s of lag.
ALONG: dict[str, Array] = {
    "actuation_delay": np.ones(6),
    "force_scale": 0.1 * np.array([3.0, -1.0, 2.0, 0.5, 1.0, 4.0]),
    "actuation_lag": np.array([1.0, 1.0, 1.0, 1.0, 1.0, 1.3]),
}
BARE = Rules(model_error=0.0, least_error=0.0, discrepancy=0.0, spread_share=0.2, spread_error=0.0)


class Linear:
    """Means that change along one direction for each effect; a lag stretches the spread."""

    def at(self, hypothesis: Hypothesis, values: Array, cell: int) -> Prediction:
        along = np.array([ALONG[name][cell] for name in hypothesis])
        neutral = np.array([1.0 if name == "force_scale" else 0.0 for name in hypothesis])
        mean = BASE + ((values - neutral) @ along if len(along) else np.zeros(len(values)))
        stretch = 1.0 + (values[:, 0] if hypothesis == LAG else np.zeros(len(values)))
        times = mean[:, None] + SD * np.sqrt(0.5) * stretch[:, None] * np.array([-1.0, 1.0])
        m = len(values)
        return Prediction.plain(times, np.ones(m), np.full(m, ERROR), np.full(m, 1e-3))


def _stick(rules: Rules = BARE) -> Yardstick:
    return Yardstick(Seen(Linear(), EFFECTS, SETTINGS, rules))


def _asked(added: Array, own: float = SD**2 / 10) -> Asked:
    """Means of ten shifts that are later by ``added``."""
    return Asked(range(6), added, np.zeros(6), own * np.eye(6), np.full(6, np.inf))


def test_what_is_left_is_the_residual_of_weighted_least_squares() -> None:
    """With d the change and b the rival's direction: d.d - (d.b)^2/b.b, each in its error."""
    change = 0.3 * ALONG["force_scale"]
    error = SD**2 / 10 + ERROR**2
    along = ALONG["actuation_delay"]
    exact = (change @ change - (change @ along) ** 2 / (along @ along)) / error
    found = _stick().left(_asked(change), [NONE, DELAY])
    assert found.rival == DELAY
    assert found.noncentrality == pytest.approx(exact, rel=1e-3)


def test_no_effect_leaves_all_of_it() -> None:
    change = 0.3 * ALONG["force_scale"]
    found = _stick().left(_asked(change), [NONE])
    assert found.noncentrality == pytest.approx(change @ change / (SD**2 / 10 + ERROR**2))


def test_the_truth_as_its_own_rival_leaves_nothing() -> None:
    asked = _asked(0.3 * ALONG["force_scale"])
    found = _stick().left(asked, [NONE, DELAY, SCALE])
    assert found.rival == SCALE
    assert found.noncentrality < 1e-5 * _stick().left(asked, [NONE]).noncentrality


def test_a_rival_goes_no_farther_than_its_prior() -> None:
    """A delay ends at 0.4 s, so of 0.5 s a tenth is left at each point."""
    end = EFFECTS["actuation_delay"].parameters[0].high
    found = _stick().left(_asked((end + 0.1) * np.ones(6)), [DELAY])
    exact = 6 * 0.1**2 / (SD**2 / 10 + ERROR**2)
    assert found.noncentrality == pytest.approx(exact, rel=1e-9)


def test_a_pair_refits_both() -> None:
    """A gap along both directions, of delay and of force, leaves nothing to the pair."""
    change = 0.05 * ALONG["actuation_delay"] + 0.3 * ALONG["force_scale"]
    alone = _stick().left(_asked(change), [DELAY, SCALE]).noncentrality
    pair = _stick().left(_asked(change), [(*DELAY, *SCALE)]).noncentrality
    assert alone > 100.0
    assert pair < 0.01 * alone


def test_spreads_of_single_shifts_count_once_for_each_point() -> None:
    """A spread that doubles, of ten shifts, by a rival that changes means alone."""
    stick = _stick()
    plain = Expected(np.full(6, BASE), np.full(6, SD))
    truth = Expected(np.full(6, BASE + 0.05), np.full(6, 2.0 * SD))
    series = Series(range(6), np.full(6, 10.0), True, np.zeros(6))
    found = stick.left(asked_of(stick, series, truth, plain), [DELAY])
    own = float(sample_spread(np.array([9.0]))[1][0]) + BARE.spread_share**2
    assert found.noncentrality == pytest.approx(6 * np.log(2.0) ** 2 / own, rel=1e-3)
    means = Series(range(6), np.full(6, 10.0), False, np.zeros(6))
    assert stick.left(asked_of(stick, means, truth, plain), [DELAY]).noncentrality < 1e-3


def test_the_errors_of_the_data_are_those_of_the_series() -> None:
    """Sampling of each point's own number, and what its nominal values are off by."""
    stick = _stick()
    plain = Expected(np.full(6, BASE), np.full(6, SD))
    counts, nominal = np.array([3.0, 5.0, 10.0, 20.0, 50.0, 0.0]), np.full(6, 1e-6)
    found = asked_of(stick, Series(range(6), counts, False, nominal), plain, plain)
    assert np.diag(found.covariance)[:5] == pytest.approx(SD**2 / counts[:5] + 1e-6)
    assert np.isnan(found.mean[5])
    wide = _stick(Rules(model_error=0.0, least_error=0.0, discrepancy=0.04))
    more = asked_of(wide, Series(range(6), counts, False, nominal), plain, plain).covariance
    assert np.sqrt((more - found.covariance).diagonal()) == pytest.approx(0.04 * BASE, rel=0.3)
    assert (more - found.covariance)[0, 1] > 0.0


def test_a_point_without_a_mean_tells_nothing() -> None:
    change = 0.3 * ALONG["force_scale"]
    part = _asked(np.where(np.arange(6) == 5, np.nan, change))
    found = _stick().left(part, [NONE])
    assert found.noncentrality == pytest.approx(change[:5] @ change[:5] / (SD**2 / 10 + ERROR**2))


def test_rivals_are_those_that_may_take_the_truths_place() -> None:
    names = ["a", "b", "c"]
    assert rivals_of("single", ["a"], names) == [(), ("b",), ("c",)]
    assert rivals_of("pair", ["b", "a"], names) == [
        (), ("a",), ("b",), ("c",), ("a", "c"), ("b", "c"),
    ]  # fmt: skip
    assert rivals_of("outside", ["unknown"], names)[4:] == [("a", "b"), ("a", "c"), ("b", "c")]
    assert ("a", "b") in rivals_of("three", names, [*names, "d"])


def test_the_truth_of_another_law_has_no_errors_of_its_own() -> None:
    stick = _stick()
    assert stick.at_truth({"force_scale": {"force_offset_N": 50.0}}) is None
    found = stick.at_truth({"force_scale": {"force_factor": 1.1}})
    assert found is not None
    assert found.mean[0] == pytest.approx(0.1 * ALONG["force_scale"])


def test_moments_leave_late_shifts_out() -> None:
    soon = np.linspace(0.1, 0.13, 10)
    times = np.array([[*soon, 0.9], [np.nan] * 11])
    found = moments(times, np.ones(11), 0.02)
    assert found.mean[0] == pytest.approx(0.115)
    assert found.sd[0] == pytest.approx(np.hypot(soon.std(), 0.02))
    assert np.isnan(found.mean[1])


def test_of_two_causes_only_those_are_seen_that_leave_something_without_them() -> None:
    """The second one's change is made as small and as large as the limit of 4 squared errors."""
    stick, error = _stick(), SD**2 / 10 + ERROR**2
    along, other = ALONG["actuation_delay"], ALONG["force_scale"]
    alone = other - along * (other @ along) / (along @ along)
    limit = 2.0 * np.sqrt(error / (alone @ alone))
    both = ("actuation_delay", "force_scale")
    for share, seen in ((0.9, [DELAY]), (1.1, [both])):
        asked = _asked(0.1 * along + share * limit * other)
        assert seen_as(stick, asked, both) == seen
    assert seen_as(stick, _asked(np.zeros(6)), both) == [NONE]
    assert seen_as(stick, _asked(0.3 * other), ("unknown",)) == [("unknown",)]


def test_parts_that_were_refitted_as_rivals_are_not_refitted_again(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    stick, both = _stick(), ("actuation_delay", "force_scale")
    for change in (0.0 * ALONG["force_scale"], 0.3 * ALONG["force_scale"]):
        asked = _asked(change)
        plain = seen_as(stick, asked, both)
        refitted = stick.left(asked, [NONE, DELAY, SCALE]).refitted
        with monkeypatch.context() as patch:
            patch.setattr(Yardstick, "left", lambda *_: pytest.fail("refitted again"))
            assert seen_as(stick, asked, both, known=refitted) == plain


def test_power_to_show_no_gap_at_one_point_is_that_of_a_normal_posterior() -> None:
    """One amplitude, one shape: with k = a^2/(a^2 + e^2) the gap is N(k y, k e^2) after y."""
    size, error, gap = 0.6, 0.4, 0.2
    prior = Discrepancy((np.array([[size]]),), np.ones(1), np.ones((1, 1)))
    shrink = size**2 / (size**2 + error**2)
    after = np.sqrt(shrink) * error

    def chance(read: float) -> float:
        middle = shrink * read
        return float(norm.cdf((1.0 - middle) / after) - norm.cdf((-1.0 - middle) / after))

    edge = brentq(lambda read: chance(read) - 0.8, 0.0, 3.0)
    exact = norm.cdf((edge - gap) / error) - norm.cdf((-edge - gap) / error)
    one, none = np.ones(1), np.zeros(1)
    found = equivalence_power(gap * one, error * one, none, prior, one)
    assert found == pytest.approx(exact, abs=0.07)
    sharp = 1e-3 * one
    assert equivalence_power(0.9 * one, sharp, none, prior, one) == 1.0
    assert equivalence_power(1.1 * one, sharp, none, prior, one) == 0.0
    wide = Discrepancy((np.array([[5.0]]),), np.ones(1), np.ones((1, 1)))
    assert equivalence_power(none, 3.0 * one, none, wide, one) == 0.0
    # Who reckons with an error of the simulation as well is less sure, unless the prior is.
    assert equivalence_power(none, 0.1 * one, none, wide, one) == 1.0
    assert equivalence_power(none, 0.1 * one, 3.0 * one, wide, one) == 0.0
