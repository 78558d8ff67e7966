"""Diagnoses of data drawn from the emulator itself: what they say holds, and what can be told."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import binom, chisquare, kstest

from dogshape.diagnosis.likelihood.observations import observe
from dogshape.diagnosis.likelihood.scores import Problem
from dogshape.diagnosis.prediction.hypotheses import priors_of
from dogshape.validation.self_consistency import (
    STRONG,
    Answer,
    World,
    answer,
    as_row,
    draw,
    from_row,
    in_set,
    is_rival,
    leading,
    stratified,
)
from tests.declared import Declared
from tests.toy import EFFECTS, bench_of, points_of

POINTS = points_of((235.2, 641.5))
NAMES = ("actuation_delay", "force_scale", "sleeve_friction")
WORLD = World(
    bench_of({}, np.random.default_rng(0), points=POINTS),
    Declared(POINTS),
    {name: EFFECTS[name] for name in NAMES},
)


def _answers(count: int) -> list[Answer]:
    return [answer(WORLD, draw(WORLD, np.random.default_rng(seed))) for seed in range(count)]


@pytest.mark.parametrize("count", [24, pytest.param(300, marks=pytest.mark.slow)])
def test_probabilities_and_intervals_hold_what_they_say(count: int) -> None:
    found = _answers(count)
    held = sum(in_set(one.raw, one.cause, 0.9) for one in found)
    # The set has at least nine tenths, so that it may hold more often.
    assert held >= binom.ppf(1e-3, count, 0.9)
    said = np.array([max(one.raw.values()) for one in found])
    hits = np.array([one.raw[one.cause] == max(one.raw.values()) for one in found])
    error = np.sqrt((said * (1.0 - said)).sum())
    assert abs(hits.sum() - said.sum()) < 3.3 * error + 1.0
    ranks = np.concatenate([one.ranks for one in found])
    assert kstest(ranks, "uniform").pvalue > 1e-3
    strong = [one for one in found if one.noncentrality >= STRONG]
    assert strong
    assert all(leading(one) == one.cause for one in strong)


def test_causes_come_as_often_as_their_priors_say() -> None:
    generator = np.random.default_rng(11)
    causes = [draw(WORLD, generator).cause for _ in range(300)]
    chances = priors_of([space.hypothesis for space in WORLD.spaces])
    counts = [causes.count(cause) for cause in chances]
    assert sum(counts) == len(causes)
    assert chisquare(counts, 300 * np.array(list(chances.values()))).pvalue > 1e-3


def test_noncentrality_is_the_distance_that_rivals_leave() -> None:
    """Of one effect among none other only *none* is a rival, whose distance is known."""
    lone = replace(WORLD, effects={"actuation_delay": EFFECTS["actuation_delay"]})
    one = next(
        made
        for made in (draw(lone, np.random.default_rng(seed)) for seed in range(40))
        if made.cause and not made.bench.cells[0].times.size
    )
    found = answer(lone, one)
    problem = Problem(observe(one.bench), one.emulator, lone.settings)
    said = problem.predictions(one.cause, one.values[None])
    seen = problem.seen
    own = said.sd[:, 0] ** 2 / seen.shifts + said.error[:, 0] ** 2
    gap = np.full(len(own), float(one.values[0]))
    whole = np.diag(own) + problem.discrepancy.covariance
    assert found.noncentrality == pytest.approx(float(gap @ np.linalg.solve(whole, gap)), rel=1e-6)


def test_rivals_lack_an_effect_of_the_cause() -> None:
    cause = ("actuation_delay", "moving_mass")
    assert is_rival(("actuation_delay",), cause)
    assert is_rival((), cause)
    assert not is_rival(("actuation_delay", "drag_torque", "moving_mass"), cause)
    assert not is_rival(("actuation_delay", "reversed_mismatch"), cause)


def test_an_answer_is_kept_as_a_line_of_json() -> None:
    (found,) = _answers(1)
    again = from_row(as_row(found))
    assert as_row(again) == as_row(found)
    assert again.ranks == pytest.approx(found.ranks)


def test_a_number_of_effects_counts_as_often_as_its_prior_says() -> None:
    """Three sets without an effect and two with one, of a prior that has both as often."""
    found = [_empty(()), _empty(()), _empty(()), _empty(("force_scale",)), _empty(("force_scale",))]
    values = iter([1.0, 0.0, 1.0, 0.0, 1.0])
    figures = {id(one): next(values) for one in found}
    chances = {(): 0.5, ("force_scale",): 0.3, ("sleeve_friction",): 0.2}
    mean, error = stratified(found, chances, lambda one: figures[id(one)])
    assert mean == pytest.approx(0.5 * 2.0 / 3.0 + 0.5 * 0.5)
    with pytest.raises(ValueError, match="1 sets have 1 effects"):
        stratified(found[:4], chances, lambda one: figures[id(one)])
    assert error == pytest.approx(np.sqrt(0.25 * (1.0 / 3.0) / 3.0 + 0.25 * 0.5 / 2.0))


def _empty(cause: tuple[str, ...]) -> Answer:
    return Answer(cause, 0.0, {}, {}, "none", (), (), (), np.zeros(0))
