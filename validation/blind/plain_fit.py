"""Plain method beside the diagnosis: nested least squares with weights by AICc.

Each effect is fitted alone to the mean times of the operating points, then each pair with one of
the best. The bank of the diagnosis predicts them, without a bench of a pair. Weights are those of
Akaike's criterion for small samples (Burnham and Anderson, *Model Selection*, 2002, section 2.9);
sizes have the errors of a linear fit. Late shifts, spreads and traces are not used.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import least_squares
from scipy.stats import chi2, qmc
from threadpoolctl import threadpool_limits

from dogshape.bench.bench_data import load_bench
from dogshape.diagnosis.inference.verdict import credible_set, inclusion
from dogshape.diagnosis.prediction.model import Model
from dogshape.diagnosis.terms import NONE, Array, Hypothesis
from dogshape.validation.blind.advised_test import likelihood_of

MODEL_ERROR = 0.03  #: of each predicted mean, as a share
GRID_SIZE = 64  #: values of a hypothesis from the best of which it is fitted
BEST_SINGLES = 4  #: effects whose pairs are fitted
NAMED_WEIGHT = 0.8  #: above which a hypothesis is named
PART_WEIGHT = 0.95  #: above which an effect is a part of the cause
CREDIBLE_WEIGHT = 0.9  #: of the set of hypotheses
MIN_P = 0.01  #: of the best fit that explains the data
SIZE_DRAWS = 1000  #: from the normal distribution of a fit
SIZE_QUANTILES = (0.05, 0.95)


@dataclass(frozen=True)
class PlainFit:
    """Best fit of a hypothesis."""

    hypothesis: Hypothesis
    shares: Array  #: of the ranges of its parameters, (p,)
    covariance: Array  #: of these, (p, p)
    chi_square: float
    criterion: float  #: AICc


@dataclass(frozen=True)
class MeanTimes:
    """Mean times of n operating points beside the predictions of a model."""

    model: Model
    points: np.ndarray  #: indices of the points with times, (n,)
    mean: Array  #: s, (n,)
    count: Array  #: number of shifts, (n,)

    def residuals(self, hypothesis: Hypothesis, shares: Array) -> tuple[Array, Array]:
        """Compute residuals over their standard error, (m, n), at shares (m, p).

        Returns the logarithms of the variances too, summed over the points, (m,).
        """
        predicted = self.model.predict(hypothesis, shares).select((slice(None), self.points))
        variance = predicted.sd**2 / self.count + (MODEL_ERROR * predicted.mean) ** 2
        return (self.mean - predicted.mean) / np.sqrt(variance), np.log(variance).sum(axis=1)

    def fit(self, hypothesis: Hypothesis) -> PlainFit | None:
        """Fit a hypothesis from the best of evenly spread values; None where no bench exists."""
        size = len(self.model.space(hypothesis).parameters)
        grid = np.zeros((1, 0))
        if size:
            grid = np.asarray(qmc.Halton(size, scramble=False).random(GRID_SIZE))
        grid = grid[self.model.possible(hypothesis, grid)]
        if not len(grid):
            return None
        residuals, log_variances = self.residuals(hypothesis, grid)
        shares = grid[int(((residuals**2).sum(axis=1) + log_variances).argmin())]
        covariance = np.zeros((size, size))
        if size:
            solution = least_squares(
                lambda x: self.residuals(hypothesis, x[None])[0][0],
                np.clip(shares, 1e-3, 1.0 - 1e-3),
                bounds=(0.0, 1.0),
                diff_step=1e-3,
            )
            covariance = np.linalg.pinv(solution.jac.T @ solution.jac)
            if self.model.possible(hypothesis, solution.x[None])[0]:
                shares = solution.x
        residuals, log_variances = self.residuals(hypothesis, shares[None])
        chi_square = float((residuals**2).sum())
        freedom = max(1, len(self.points) - size - 1)
        penalty = 2.0 * size + 2.0 * size * (size + 1) / freedom
        criterion = chi_square + float(log_variances[0]) + penalty
        return PlainFit(hypothesis, shares, covariance, chi_square, criterion)

    def fit_all(self) -> list[PlainFit]:
        """Fit no effect, each effect, and each pair with one of the best; the best fit first."""
        names = sorted(self.model.effects)
        none = self._fit_each([NONE])
        singles = self._fit_each([(name,) for name in names])
        best = {fit.hypothesis[0] for fit in singles[:BEST_SINGLES]}
        pairs = [p for p in itertools.combinations(names, 2) if not best.isdisjoint(p)]
        return sorted([*none, *singles, *self._fit_each(pairs)], key=lambda fit: fit.criterion)

    def _fit_each(self, hypotheses: Sequence[Hypothesis]) -> list[PlainFit]:
        fits = [fit for h in hypotheses if (fit := self.fit(h)) is not None]
        return sorted(fits, key=lambda fit: fit.criterion)


def diagnose_by_fit(folder: Path) -> dict[str, Any]:
    """Diagnose the data set in a folder by its mean times; return verdict and hypotheses."""
    stated = load_bench(folder).record.displacement_at
    likelihood = likelihood_of(folder, "sleeve" if stated == "unknown" else stated)
    seen = likelihood.observed
    points = np.flatnonzero(seen.count > 0)
    means = MeanTimes(likelihood.model, points, seen.mean[points], seen.count[points])
    with threadpool_limits(limits=1, user_api="blas"):
        fits = means.fit_all()
    return conclude(fits, likelihood.model, len(points))


def conclude(fits: Sequence[PlainFit], model: Model, point_count: int) -> dict[str, Any]:
    """Weigh fits, the best first, and state a verdict in the form of ``gap.json``."""
    relative = np.exp(-0.5 * np.array([fit.criterion - fits[0].criterion for fit in fits]))
    weights = (relative / relative.sum()).tolist()
    weighted = list(zip(fits, weights, strict=True))
    posterior = {fit.hypothesis: weight for fit, weight in weighted}
    best = fits[0]
    freedom = max(1, point_count - best.shares.size)
    causes: tuple[str, ...] = ()
    if chi2.sf(best.chi_square, freedom) < MIN_P:
        verdict = "unknown"
    elif weights[0] > NAMED_WEIGHT:
        verdict = "effect" if best.hypothesis else "none"
        causes = best.hypothesis
    else:
        verdict = "ambiguous"
        parts = [name for name, weight in inclusion(posterior).items() if weight > PART_WEIGHT]
        causes = tuple(sorted(parts))
    hypotheses = []
    for fit, weight in weighted:
        sizes = sizes_of(fit, model) if fit is best else {}
        hypotheses.append(
            {"effects": list(fit.hypothesis), "probability": weight, "parameters": sizes}
        )
    return {
        "verdict": verdict,
        "causes": list(causes),
        "hypotheses": hypotheses,
        "credible_set": [list(h) for h in credible_set(posterior, CREDIBLE_WEIGHT)],
    }


def sizes_of(fit: PlainFit, model: Model) -> dict[str, dict[str, float]]:
    """Compute mean and 90 % interval of each parameter of a fit, by name."""
    space = model.space(fit.hypothesis)
    if not space.parameters:
        return {}
    generator = np.random.default_rng(0)
    shares = generator.multivariate_normal(fit.shares, fit.covariance, SIZE_DRAWS, method="svd")
    values = space.values(np.clip(shares, 0.0, 1.0))
    low, high = np.quantile(values, SIZE_QUANTILES, axis=0)
    sizes = {}
    for k, parameter in enumerate(space.parameters):
        mean = float(values[:, k].mean())
        sizes[parameter.name] = {"mean": mean, "low": float(low[k]), "high": float(high[k])}
    return sizes
