"""Predictive check of cells that are far off together: odd cells must not decide it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dogshape.diagnosis.bench.bench_data import setting_of
from dogshape.diagnosis.inference.evidence import evidence
from dogshape.diagnosis.inference.predictive_check import p_value
from dogshape.diagnosis.inference.refits import checked
from dogshape.diagnosis.likelihood.observations import observe
from dogshape.diagnosis.likelihood.replicates import replicate
from dogshape.diagnosis.likelihood.scores import Problem, Scored
from dogshape.diagnosis.prediction.hypotheses import NONE, spaces_for
from dogshape.diagnosis.settings import USUAL
from dogshape.diagnosis.terms import Array
from tests.declared import Declared, problem_of
from tests.toy import EFFECTS, bench_of, points_of

POINTS = points_of((235.2, 641.5))
TOY = Declared(POINTS)
SHIFTS = 10_000  #: so that a cell is off by several widths
OFF = 0.12  #: of the mean times


def _problem(signs: Array, odd_share: float) -> tuple[Problem, Scored]:
    """Return means that are off, up or down, with no effect fitted to them."""
    generator = np.random.default_rng(5)
    blank = bench_of({}, generator, points=POINTS, shifts=SHIFTS)
    (space,) = spaces_for((NONE,), EFFECTS, setting_of(blank))
    said = problem_of(TOY, blank).predictions(NONE, np.zeros((1, 0)))
    offsets = OFF * signs * said.mean[:, 0]
    bench = replace(blank, cells=replicate(said, blank.cells, offsets, generator))
    settings = replace(USUAL, likelihood=replace(USUAL.likelihood, odd_share=odd_share))
    problem = Problem(observe(bench), TOY, settings, bench=bench)
    return problem, evidence(problem, space)


def test_a_smooth_error_passes_with_and_without_odd_cells() -> None:
    """A mean that is off by five widths looks odd, and all of them do; together they are not."""
    signs = np.ones(len(POINTS))
    with_odd, without = (p_value(*_problem(signs, share)) for share in (0.005, 0.0))
    assert without > 0.1
    assert with_odd == pytest.approx(without, abs=0.05)


@pytest.mark.parametrize("odd_share", [0.005, 0.0])
def test_an_error_that_no_curve_has_fails(odd_share: float) -> None:
    """A large amplitude of the discrepancy may explain it, which replicates seldom have."""
    signs = np.random.default_rng(2).choice([1.0, -1.0], len(POINTS))
    problem, found = _problem(signs, odd_share)
    assert checked(problem, found) < 0.01
