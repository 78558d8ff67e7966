"""Mean times of further shifts given those that were made, by draws and by limit cases."""

from __future__ import annotations

import numpy as np
import pytest

from dogshape.diagnosis.bench.bench_data import Bench, setting_of
from dogshape.diagnosis.diagnosis import diagnose
from dogshape.diagnosis.inference.evidence import evidence
from dogshape.diagnosis.inference.further_shifts import DRAWN, further_means, others_given
from dogshape.diagnosis.inference.next_test import WORTH
from dogshape.diagnosis.likelihood.observations import observe
from dogshape.diagnosis.likelihood.scores import Problem, Scored
from dogshape.diagnosis.prediction.hypotheses import NONE, spaces_for
from dogshape.diagnosis.settings import USUAL
from dogshape.diagnosis.terms import Hypothesis
from tests.toy import EFFECTS, Toy, bench_of, points_of

POINTS = points_of((235.2, 641.5))
EFFECT = {name: EFFECTS[name] for name in ("actuation_delay", "actuation_lag", "moving_mass")}


def _bench(values: dict[str, float], shifts: int) -> Bench:
    return bench_of(values, np.random.default_rng(3), shifts=shifts, points=POINTS)


def _fitted(bench: Bench, hypothesis: Hypothesis) -> tuple[Problem, Scored]:
    problem = Problem(observe(bench), Toy(POINTS), USUAL, bench.mismatch_sense)
    (space,) = spaces_for([hypothesis], EFFECT, setting_of(bench))
    return problem, evidence(problem, space)


def test_it_is_what_draws_of_all_errors_leave_once_the_data_are_seen() -> None:
    """At two points: discrepancy and own error drawn before the data, weighed by these."""
    problem, _ = _fitted(_bench({}, 6), NONE)
    two = problem.of(np.isin(np.arange(len(POINTS)), (1, 8)))
    (space,) = spaces_for([NONE], EFFECT, setting_of(_bench({}, 6)))
    one = evidence(two, space)
    rows, generator = one.rows, np.random.default_rng(0)
    error, count = rows.predicted.error[0], 200_000
    prior = rows.discrepancy
    members = generator.choice(prior.prior.size, size=count, p=prior.prior.ravel())
    shapes, sizes = np.unravel_index(members, prior.prior.shape)
    z = generator.standard_normal((count, prior.roots[0].shape[1]))
    drawn = np.array([z @ root.T for root in prior.roots])[shapes, np.arange(count)]
    offset = prior.amplitudes[sizes][:, None] * drawn + error * generator.standard_normal(
        (count, 2)
    )
    noise, left = rows.predicted.sd[0] ** 2 / 6, two.seen.mean - rows.predicted.mean[0]
    weight = np.exp(-0.5 * ((left - offset) ** 2 / noise).sum(axis=1))
    weight /= weight.sum()
    mean = weight @ offset
    variance = weight @ (offset - mean) ** 2
    found = further_means(one, two.seen)
    few = 4.0 * np.sqrt(variance / DRAWN)
    assert (abs(found.mean - rows.predicted.mean[0] - mean) < few).all()
    assert found.variance == pytest.approx(variance, rel=0.25)


def test_without_data_all_errors_are_as_before() -> None:
    columns, error = np.array([[1.0], [2.0]]), np.array([0.5, 1.0])
    mean, variance = others_given(np.full(2, np.nan), np.ones(2), columns, error)
    assert (mean == 0.0).all()
    assert variance == pytest.approx([1.25, 5.0])


def test_an_error_of_one_cell_is_shared_by_its_variances() -> None:
    """Of a residual an error takes its share of both variances, and keeps what is left of it."""
    none = np.zeros((1, 0))
    mean, variance = others_given(np.array([3.0]), np.array([1.0]), none, np.array([2.0]))
    assert mean == pytest.approx([3.0 * 4.0 / 5.0])
    assert variance == pytest.approx([4.0 / 5.0])


def test_after_many_shifts_every_hypothesis_predicts_what_was_seen() -> None:
    """More of them then tell nothing, whatever the simulation is off by."""
    bench = _bench({"delay_s": 0.006}, 200_000)
    for hypothesis in (NONE, ("actuation_delay",), ("moving_mass",)):
        problem, one = _fitted(bench, hypothesis)
        found = further_means(one, problem.seen)
        assert found.mean == pytest.approx(problem.seen.mean, abs=2e-4)
        assert (np.sqrt(found.variance) < 2e-4).all()


def test_more_shifts_are_worth_little_where_many_were_made() -> None:
    few, many = (
        diagnose(_bench({"delay_s": 0.01}, n), Toy(POINTS), EFFECT, pairs=[]) for n in (1, 1000)
    )
    worth = [
        max(t.information or 0.0 for t in found.tests if t.asked.kind == "shifts")
        for found in (few, many)
    ]
    assert worth[1] < WORTH < worth[0]
