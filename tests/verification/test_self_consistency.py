"""Probabilities of diagnoses hold for data drawn from their own priors and likelihood."""

from __future__ import annotations

import numpy as np
from scipy.stats import kstest

from benchmarks.self_consistency import answer, cause_of, in_set
from tests.made_up import small_model

SETS = 100


def test_probabilities_hold_what_they_say() -> None:
    """Bounds are three standard errors of 100 sets."""
    bench, model = small_model()
    found = [answer(bench, model, seed) for seed in range(SETS)]
    held = np.mean([in_set(one) for one in found])
    assert abs(held - 0.9) < 3.0 * (0.9 * 0.1 / SETS) ** 0.5
    said = np.array([one.leads for one in found])
    right = np.array([tuple(one.leading) == cause_of(one) for one in found])
    assert abs((said - right).mean()) < 3.0 * np.sqrt((said * (1.0 - said)).sum()) / SETS
    ranks = [rank for one in found for rank in one.ranks]
    assert kstest(ranks, "uniform").pvalue > 0.003
    # The mean of p-values over a posterior is never too sure by more than a factor of two.
    low = np.mean([one.p < 0.01 for one in found if one.p is not None])
    assert low < 0.02 + 3.0 * (0.02 * 0.98 / SETS) ** 0.5
