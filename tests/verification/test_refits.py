"""Replicates that are fitted anew: a p-value that is uniform, and what it sees.

Of a hypothesis without parameters the check is that of Box (1980), whose p-value is uniform. With
parameters that are fitted it is a parametric bootstrap.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import binom, kstest

from dogshape.diagnosis.bench.bench_data import Bench, setting_of
from dogshape.diagnosis.inference import refits
from dogshape.diagnosis.inference.evidence import evidence
from dogshape.diagnosis.inference.predictive_check import p_value
from dogshape.diagnosis.inference.refits import Refits, calibrated_p
from dogshape.diagnosis.likelihood.replicates import offsets_of, replicate
from dogshape.diagnosis.prediction.hypotheses import NONE, Space, spaces_for
from dogshape.diagnosis.terms import Hypothesis
from tests.declared import Declared, problem_of
from tests.toy import EFFECTS, bench_of, points_of

POINTS = points_of((235.2, 641.5))[::2]
TOY = Declared(POINTS)
FRICTION = ("sleeve_friction",)


def _space(hypothesis: Hypothesis) -> Space:
    setting = setting_of(bench_of({}, np.random.default_rng(0), points=POINTS))
    return spaces_for((hypothesis,), EFFECTS, setting)[0]


def _made(space: Space, seed: int, *, single: bool, wave: float = 0.0) -> Bench:
    """Draw a set of a hypothesis, with further offsets of single cells, s."""
    generator = np.random.default_rng(seed)
    blank = bench_of({}, generator, points=POINTS, single=single)
    problem = problem_of(TOY, blank)
    values = space.values(generator.random((1, len(space.parameters))))
    said = problem.predictions(space.hypothesis, values)
    offsets = offsets_of(said, problem.discrepancy, generator)
    offsets = offsets + wave * generator.standard_normal(len(POINTS))
    return replace(blank, cells=replicate(said, blank.cells, offsets, generator))


def _p(space: Space, bench: Bench, most: int = refits.MOST) -> float:
    problem = problem_of(TOY, bench)
    return calibrated_p(problem, evidence(problem, space), most=most)


@pytest.mark.parametrize("single", [False, True], ids=["means", "singles"])
def test_the_p_value_of_no_effect_is_uniform(single: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(refits, "ENOUGH", 60)
    space = _space(NONE)
    found = [_p(space, _made(space, seed, single=single), most=60) for seed in range(50)]
    assert kstest(found, "uniform").pvalue > 1e-3


def test_the_p_value_of_a_fitted_effect_is_seldom_small_but_often_of_another_truth() -> None:
    space = _space(FRICTION)
    true = np.array([_p(space, _made(space, seed, single=True)) for seed in range(30)])
    assert (true < 0.05).sum() <= binom.ppf(0.999, len(true), 0.05)
    off = [_made(space, seed, single=True, wave=0.03) for seed in range(12)]
    assert np.median([_p(space, one) for one in off]) < 0.05


def test_it_stops_as_soon_as_enough_replicates_have_no_more_evidence() -> None:
    space = _space(NONE)
    problem = problem_of(TOY, _made(space, 3, single=False))
    found = calibrated_p(problem, evidence(problem, space))
    counted = refits.ENOUGH / found
    assert counted == pytest.approx(round(counted))
    assert counted < refits.MOST


def test_refits_by_reweighting_have_the_evidence_of_a_fit() -> None:
    space = _space(FRICTION)
    problem = problem_of(TOY, _made(space, 5, single=False))
    one = evidence(problem, space)
    few = Refits.of(problem, one, np.random.default_rng(2))
    assert few.log_evidence(problem.seen) == pytest.approx(one.log_evidence, abs=0.25)
    other = problem_of(TOY, _made(space, 5, single=False, wave=0.002))
    again = evidence(other, space)
    assert few.log_evidence(other.seen) == pytest.approx(again.log_evidence, abs=0.5)


def test_without_a_data_set_to_be_like_nothing_is_drawn() -> None:
    space = _space(NONE)
    problem = replace(problem_of(TOY, _made(space, 3, single=False)), bench=None)
    assert calibrated_p(problem, evidence(problem, space)) == 1.0
    assert p_value(problem, evidence(problem, space)) < 1.0
