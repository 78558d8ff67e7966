"""Means of many shifts with late ones among them, and the likelihood of the plain fits."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import kstest, multivariate_normal, norm

from dogshape.diagnosis.likelihood.cell_predictions import CellPredictions
from dogshape.diagnosis.likelihood.mean_density import time_scores
from dogshape.diagnosis.likelihood.observations import Observed
from dogshape.diagnosis.prediction.prediction import Prediction
from dogshape.diagnosis.settings import Rules
from dogshape.validation.blind.baselines import deviance

LATE, BEHIND, WIDE, CELLS = 0.06, 0.1, 0.03, 4000


def _said() -> CellPredictions:
    times = 0.06 + 0.002 * norm.ppf((np.arange(200) + 0.5) / 200.0)[None]
    one = np.ones(1)
    plain = Prediction.plain(times, one, 0.0005 * one, 0.0 * one)
    late = replace(plain, outlier_share=LATE * one, behind=BEHIND * one, behind_sd=WIDE * one)
    return CellPredictions.of([late] * CELLS, Rules(odd_share=0.0))


def _seen(means: np.ndarray, n: int) -> Observed:
    nothing, count = np.zeros(CELLS), np.full(CELLS, float(n))
    empty = (np.zeros(0),) * CELLS
    wait = np.full(CELLS, 0.1)
    return Observed(
        empty,
        empty,
        means,
        count,
        nothing,
        nothing,
        nothing,
        count,
        nothing,
        nothing,
        wait,
        wait,
        wait,
        2.0,
    )


@pytest.mark.parametrize("n", [10, 24, 40, 100, 1000])
def test_means_with_late_shifts_are_scored_evenly(n: int) -> None:
    generator, said = np.random.default_rng(n), _said()
    late = generator.binomial(n, LATE, CELLS)
    variance = said.sd[:, 0] ** 2 / n + late * WIDE**2 / n**2 + said.error[:, 0] ** 2
    means = said.mean[:, 0] + late * BEHIND / n
    means += np.sqrt(variance) * generator.standard_normal(CELLS)
    scores = time_scores(_seen(means, n), said, np.zeros_like(said.mean))[0][:, 0]
    assert (scores**2).mean() == pytest.approx(1.0, abs=4.0 * np.sqrt(2.0 / CELLS))
    assert kstest(norm.cdf(scores), "uniform").pvalue > 0.001


def test_a_mean_of_a_million_shifts_is_cheap() -> None:
    said = _said()
    whole, _ = said.whole
    scores, *_ = time_scores(_seen(whole[:, 0], 1_000_000), said, np.zeros_like(said.mean))
    assert np.isfinite(scores).all()


def test_plain_fits_have_the_whole_likelihood() -> None:
    apart, variance = np.array([0.01, -0.03]), np.array([0.02**2, 0.05**2])
    exact = -2.0 * multivariate_normal.logpdf(apart, cov=np.diag(variance))
    assert deviance(apart, variance).sum() == pytest.approx(exact, rel=1e-12)
