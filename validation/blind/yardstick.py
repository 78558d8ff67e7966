r"""Yardstick of a case: the noncentrality of its data under the best refit by a rival.

The engine of a case computes without scatter how the truth changes mean times and spreads against
no effect. The same change of the diagnosis' prediction is the data, so that the error of its
simulation cancels. A rival hypothesis *h* leaves, within its ranges,

.. math:: \Lambda = \min_h \min_\theta \; r^T C^{-1} r + \sum_k s_k^2, \qquad
          r = \bar t - \mu_h(\theta),

with all errors of the likelihood in *C* and the normal deviates :math:`s_k` of known spreads; late
shifts, shares engaged and traces are left out.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.stats import qmc

from dogshape.diagnosis.likelihood.likelihood import Likelihood, squared_distance
from dogshape.diagnosis.prediction.model import Prediction
from dogshape.diagnosis.terms import REVERSED, Array, Hypothesis
from dogshape.validation.blind.data import Expected

NONE: Hypothesis = ()
GRID_SIZES = (1, 65, 256, 256, 384)  #: values of a hypothesis by its number of parameters
MAX_REFITS = 10  #: rivals of the smallest noncentrality that are refitted
REFIT_SIZE = 64  #: values of each round of a refit
REFIT_WIDTHS = (0.12, 0.05, 0.02, 0.008)  #: of the ranges, about the best value, by round
MIN_ENGAGED = 0.5  #: share at a point below which a rival has no times where the truth has
MIN_SD_S = 5e-4  #: of expected data
SERIES_COUNT = 100  #: test series of an observer
GAP_DRAWS = 100  #: of the gap for each test series


@dataclass(frozen=True)
class Yardstick:
    """Expected data of a case under the likelihood of its diagnosis."""

    likelihood: Likelihood
    truth: Expected  #: of the case's engine with its causes
    baseline: Expected  #: of the case's engine without causes

    @cached_property
    def base(self) -> Prediction:
        """Prediction without any effect."""
        return self.likelihood.model.predict(NONE, np.zeros((1, 0)))

    @cached_property
    def exact(self) -> Likelihood:
        """Likelihood of the expected data: no scatter, no late and no odd means."""
        seen = self.likelihood.observed
        base = self.base
        mean = base.mean[0] + self.truth.mean - self.baseline.mean
        with np.errstate(divide="ignore", invalid="ignore"):
            sd = base.sd[0] * self.truth.sd / self.baseline.sd
        measured = (seen.count > 0) & np.isfinite(mean) & np.isfinite(sd)
        exact = replace(
            seen,
            count=np.where(measured, seen.count, 0.0),
            mean=np.where(measured, mean, 0.0),
            variance=np.where(measured, np.maximum(sd, MIN_SD_S) ** 2, 1.0),
            freedom=np.where(measured, seen.freedom, 0.0),
            late_count=np.zeros(len(mean)),
            hides_late=np.zeros(len(mean), dtype=bool),
        )
        settings = replace(self.likelihood.settings, odd_share=1e-300, odd_spread=1e-300)
        return replace(self.likelihood, observed=exact, settings=settings)

    def squares(self, hypothesis: Hypothesis, shares: Array) -> Array:
        """Compute the noncentrality under values (m, p) of a hypothesis, (m,).

        Infinite for a value that no bench can have, or without engagement where the truth engages.
        """
        exact = self.exact
        points = exact.measured_points
        prediction = exact.model.predict(hypothesis, shares)
        terms = exact.terms(prediction)
        columns = exact.all_common_errors(prediction, exact.settings.discrepancy)[:, points]
        squares = squared_distance(terms.residual, terms.variance, columns)
        squares = squares + np.nansum(exact.spread_scores(prediction) ** 2, axis=1)
        possible = (prediction.engaged_share[:, points] >= MIN_ENGAGED).all(axis=1)
        possible &= exact.model.possible(hypothesis, shares)
        return np.where(possible & np.isfinite(squares), squares, np.inf)

    def noncentralities(self, rivals: Iterable[Hypothesis]) -> dict[Hypothesis, float]:
        """Compute the noncentrality under each rival, refitted for the ``MAX_REFITS`` best."""
        space = self.exact.model.space
        fits = {h: self._fit(h, unit_grid(len(space(h).parameters))) for h in rivals}
        noncentrality = {h: squares for h, (squares, _) in fits.items()}
        for h in sorted(fits, key=lambda h: fits[h][0])[:MAX_REFITS]:
            noncentrality[h] = self._refit(h, *fits[h])
        return noncentrality

    def _fit(self, hypothesis: Hypothesis, shares: Array) -> tuple[float, Array]:
        """Return the smallest noncentrality among values (m, p), and its value, (p,)."""
        squares = self.squares(hypothesis, shares)
        best = int(squares.argmin())
        return float(squares[best]), shares[best]

    def _refit(self, hypothesis: Hypothesis, noncentrality: float, value: Array) -> float:
        """Search about a value (p,) of a noncentrality; return the smallest noncentrality."""
        if not value.size:
            return noncentrality
        for width in REFIT_WIDTHS:
            values = value + width * (2.0 * _halton(value.size, REFIT_SIZE) - 1.0)
            squares, candidate = self._fit(hypothesis, np.clip(values, 0.0, 1.0))
            if squares < noncentrality:
                noncentrality = squares
                value = candidate
        return noncentrality


def unit_grid(size: int) -> Array:
    """Compute values that fill a unit cube of ``size`` dimensions evenly, (m, size)."""
    count = GRID_SIZES[min(size, len(GRID_SIZES) - 1)]
    if size == 0:
        return np.zeros((1, 0))
    if size == 1:
        return np.linspace(0.0, 1.0, count)[:, None]
    return _halton(size, count)


def _halton(size: int, count: int) -> Array:
    return np.asarray(qmc.Halton(size, scramble=False).random(count))


def rivals_of(kind: str, causes: Sequence[str], effects: Iterable[str]) -> list[Hypothesis]:
    """List the rivals of a truth: none, single effects and pairs.

    Pairs are rivals of two and more causes, if they have at least one of them, and of a cause
    outside the list. The reversed sense is a rival alone.
    """
    names = sorted({*effects} - {REVERSED})
    truth = tuple(sorted(causes))
    singles: list[Hypothesis] = [(name,) for name in (*names, REVERSED)]
    rivals = [NONE, *(single for single in singles if single != truth)]
    for pair in itertools.combinations(names, 2):
        similar = len(truth) >= 2 and pair != truth and set(pair) & set(truth)
        if kind == "outside" or similar:
            rivals.append(pair)
    return rivals


def visible_causes(
    yardstick: Yardstick, causes: Sequence[str], noncentrality: dict[Hypothesis, float]
) -> list[Hypothesis]:
    """List the smallest subsets of causes whose refit leaves no visible difference.

    ``noncentrality`` has that of hypotheses that were fitted before.
    """
    truth = tuple(sorted(causes))
    threshold = yardstick.likelihood.settings.visible
    for size in range(len(truth)):
        subsets = list(itertools.combinations(truth, size))
        unfitted = [subset for subset in subsets if subset not in noncentrality]
        fits = yardstick.noncentralities(unfitted) | noncentrality
        visible = [subset for subset in subsets if fits[subset] < threshold]
        if visible:
            return visible
    return [truth]


def power_of(yardstick: Yardstick, seed: int = 1) -> float:
    """Estimate the share of test series without effect that show a gap within its margin.

    Test series are drawn from the engine's means with scatter and errors of nominal values. The gap
    is within its margin where its root mean square over the points is below one margin; a series
    shows it where its probability reaches that at which the diagnosis names a cause.
    """
    generator = np.random.default_rng(seed)
    likelihood = yardstick.likelihood
    seen = likelihood.observed
    baseline = yardstick.baseline
    measured = (seen.count > 0) & np.isfinite(baseline.mean)
    count = np.where(measured, seen.count, 1.0)
    simulated = yardstick.base.mean[0]
    error = np.sqrt(baseline.sd**2 / count + likelihood.nominal_variance * simulated**2)
    margin = likelihood.bench.margin.of(simulated)[measured]
    predictions = yardstick.base.select(np.zeros(GAP_DRAWS, dtype=int))
    probabilities = []
    for _ in range(SERIES_COUNT):
        drawn_mean = baseline.mean + error * generator.standard_normal(len(error))
        mean = np.where(measured, drawn_mean, 0)
        series = replace(seen, count=np.where(measured, count, 0.0), mean=mean, freedom=0.0 * mean)
        errors = replace(likelihood, observed=series).draw_common_errors(predictions, generator)
        gaps = errors.offset - errors.nuisance
        in_margin = ((gaps[:, measured] / margin) ** 2).mean(axis=1) < 1.0
        probabilities.append(in_margin.mean())
    return float((np.array(probabilities) >= likelihood.settings.named).mean())
