"""A hypothesis fitted to a data set: equally weighted draws of its posterior.

Each operating point is predicted from all others too, against what chance alone leaves.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.stats import chi2

from dogshape.diagnosis.inference.sampling import Sample, systematic
from dogshape.diagnosis.likelihood.likelihood import Likelihood, squared_distance
from dogshape.diagnosis.likelihood.mark_density import flight_scores
from dogshape.diagnosis.prediction.flights import Flights
from dogshape.diagnosis.prediction.model import Predicted, Space
from dogshape.diagnosis.terms import Array, Hypothesis

DRAWN = 400  #: posterior draws
CHECKED = 60  #: of these, for the predictive check
ROWS = 100  #: of these, for predictions of held-out points


@dataclass(frozen=True)
class Interval:
    """Posterior mean, and the ends of 90 %."""

    mean: float
    low: float
    high: float

    @classmethod
    def of(cls, draws: Array) -> Interval:
        """Summarise draws."""
        low, high = np.quantile(draws, (0.05, 0.95))
        return cls(float(draws.mean()), float(low), float(high))


@dataclass(frozen=True)
class Fit:
    """A hypothesis fitted to a data set."""

    hypothesis: Hypothesis
    space: Space  #: parameters of the hypothesis
    shares: Array  #: K equally weighted draws of the posterior, as shares of the ranges, (K, p)
    predicted: Predicted  #: of each draw, (K, C)
    amplitude: Array  #: of the discrepancy, as a share of the predicted time, (K,)
    offset: Array  #: errors in common, discrepancy among them, drawn with each, s, (K, C)
    log_evidence: float  #: and its standard error
    error: float
    p: float  #: predictive p-value

    @cached_property
    def values(self) -> Array:
        """Values of the parameters, (K, p)."""
        return self.space.values(self.shares)

    @cached_property
    def intervals(self) -> dict[str, Interval]:
        """All parameters with their intervals."""
        columns = zip(self.space.parameters, self.values.T, strict=True)
        return {parameter.name: Interval.of(column) for parameter, column in columns}

    def interval(self, parameter: str) -> Interval:
        """Summarise a parameter."""
        return self.intervals[parameter]


def fit(likelihood: Likelihood, sample: Sample, flights: Flights) -> Fit:
    """Draw the posterior of a hypothesis."""
    generator = np.random.default_rng(1)
    places = systematic(sample.weights, DRAWN, float(generator.random()))
    predicted, shares = sample.predicted.only(places), sample.shares[places]
    amplitude, offset = likelihood.drawn(predicted, generator)
    space = likelihood.model.space(sample.hypothesis)
    some = np.linspace(0, DRAWN - 1, CHECKED).astype(int)
    values = space.values(shares[some])
    marks = flight_scores(likelihood.seen.flights, flights, space.hypothesis, values)
    p = predictive_p(likelihood, predicted.only(some), amplitude[some], marks)
    h, log, error = sample.hypothesis, sample.log_evidence, sample.error
    return Fit(h, space, shares, predicted, amplitude, offset, log, error, p)


def predictive_p(likelihood: Likelihood, p: Predicted, amplitude: Array, marks: Array) -> float:
    """Compute the p-value of the squared distance of means, spreads and marks, mean over draws.

    The distance at a posterior draw is chi-square with all observations as degrees of freedom
    (Johnson 2004, A Bayesian chi-squared test for goodness-of-fit, Annals of Statistics 32).
    ``marks`` are normal deviates of the marks of each profile, (m, profiles).
    """
    found = likelihood.terms(p)
    columns = likelihood.all_columns(p, amplitude)[:, likelihood.having]
    distance = squared_distance(found.residual, found.variance, columns)
    spread = likelihood.spread_scores(p)
    distance = distance + np.nansum(spread**2, axis=1) + (marks**2).sum(axis=1)
    count = found.residual.shape[1] + np.isfinite(spread[0]).sum() + marks.shape[1]
    return float(chi2.sf(distance, count).mean())


@dataclass(frozen=True)
class HeldOut:
    """Gaps at operating points that the fit has not seen, root mean square, s."""

    baseline: float  #: without any effect
    held_out: float  #: at each point from all others, by the leading hypothesis
    chance: float  #: what scatter and errors alone leave
    rival: Hypothesis | None  #: the best other hypothesis
    rival_held_out: float | None  #: what it leaves
    mean: Array  #: prediction at each point from all others, s, (C,)
    sd: Array  #: its standard error, s, (C,)


def held_out(likelihood: Likelihood, leading: Fit, rival: Fit | None, baseline: Array) -> HeldOut:
    """Predict each operating point from all others by the leading hypothesis and its rival.

    ``baseline`` are the gaps without any effect, s, (C,), NaN where there is no mean.
    """
    some = likelihood.having
    mean, sd, gaps, chance = left_out(likelihood, leading)
    means, sds = np.full((2, likelihood.model.cells), np.nan)
    means[some], sds[some] = mean, sd
    other, left = None, None
    if rival is not None:
        other, left = rival.hypothesis, _rms(left_out(likelihood, rival)[2])
    return HeldOut(_rms(baseline[some]), _rms(gaps), chance, other, left, means, sds)


def left_out(likelihood: Likelihood, one: Fit) -> tuple[Array, Array, Array, float]:
    """Predict each observed mean from all others: mean, sd, gap (c,), and the chance gap, s.

    Draws count for a point by the inverse of the density that they give it, so as if the point had
    not been seen.
    """
    rows = np.linspace(0, len(one.shares) - 1, ROWS).astype(int)
    p = one.predicted.only(rows)
    found = likelihood.terms(p)
    columns = likelihood.all_columns(p, one.amplitude[rows])[:, likelihood.having]
    size = found.residual.shape[1]
    covariance = columns @ columns.swapaxes(1, 2) + found.variance[..., None] * np.eye(size)
    inverse = np.linalg.inv(covariance)
    diagonal = np.diagonal(inverse, axis1=1, axis2=2)
    gap = (inverse @ found.residual[..., None])[..., 0] / diagonal
    log = 0.5 * gap**2 * diagonal - 0.5 * np.log(diagonal)
    weights = np.exp(np.minimum(log - log.mean(axis=0), 0.5 * np.log(len(rows))))
    weights /= weights.sum(axis=0)
    seen = likelihood.seen.mean[likelihood.having]
    mean = (weights * (seen - gap)).sum(axis=0)
    variance = (weights * (1.0 / diagonal + (seen - gap - mean) ** 2)).sum(axis=0)
    scatter = (weights * found.variance).sum(axis=0)
    return mean, np.sqrt(variance), seen - mean, float(np.sqrt(scatter.mean()))


def _rms(values: Array) -> float:
    known = values[np.isfinite(values)]
    return float(np.sqrt((known**2).mean())) if known.size else 0.0
