"""A hypothesis fitted to a data set: equally weighted draws of its posterior."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.stats import chi2

from dogshape.diagnosis.inference.sampling import Sample
from dogshape.diagnosis.likelihood.likelihood import Likelihood, squared_distance
from dogshape.diagnosis.likelihood.mark_density import flight_scores
from dogshape.diagnosis.prediction.flights import Flights
from dogshape.diagnosis.prediction.model import Predicted, Space
from dogshape.diagnosis.terms import Array, Hypothesis

DRAWN = 400  #: posterior draws
CHECKED = 60  #: of these, for the predictive check


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

    def as_dict(self) -> dict[str, float]:
        """Write the numbers by name."""
        return {"mean": self.mean, "low": self.low, "high": self.high}


@dataclass(frozen=True)
class Fit:
    """A hypothesis fitted to a data set.

    Parameters
    ----------
    space : parameters of the hypothesis.
    shares : K equally weighted draws of the posterior, in the unit cube of the ranges, (K, p).
    predicted : of each draw, (K, C).
    amplitude : of the discrepancy, as a share of the predicted time, (K,).
    offset : errors in common, discrepancy among them, drawn with each, s, (K, C).
    log_evidence : and its standard error.
    p : predictive p-value.
    """

    hypothesis: Hypothesis
    space: Space
    shares: Array
    predicted: Predicted
    amplitude: Array
    offset: Array
    log_evidence: float
    error: float
    p: float

    @cached_property
    def values(self) -> Array:
        """Values of the parameters, (K, p)."""
        return self.space.values(self.shares)

    def interval(self, parameter: str) -> Interval:
        """Summarise a parameter."""
        names = [one.name for one in self.space.parameters]
        return Interval.of(self.values[:, names.index(parameter)])

    @property
    def intervals(self) -> dict[str, Interval]:
        """All parameters with their intervals."""
        return {one.name: self.interval(one.name) for one in self.space.parameters}


def fit(likelihood: Likelihood, sample: Sample, flights: Flights) -> Fit:
    """Draw the posterior of a hypothesis."""
    generator = np.random.default_rng(1)
    places = sample.draw(DRAWN, generator)
    predicted, shares = sample.predicted.only(places), sample.shares[places]
    amplitude, offset = likelihood.drawn(predicted, generator)
    space = likelihood.model.space(sample.hypothesis)
    some = np.linspace(0, DRAWN - 1, CHECKED).astype(int)
    values = space.values(shares[some])
    marks = flight_scores(likelihood.seen.flights, flights, space.hypothesis, values)
    return Fit(
        sample.hypothesis,
        space,
        shares,
        predicted,
        amplitude,
        offset,
        sample.log_evidence,
        sample.error,
        predictive_p(likelihood, predicted.only(some), amplitude[some], marks),
    )


def predictive_p(likelihood: Likelihood, p: Predicted, amplitude: Array, marks: Array) -> float:
    """Compute the p-value of the squared distance of means, spreads and marks, mean over draws.

    The true values and a draw of their posterior have the same distribution together with the data,
    so the distance at a draw is chi-square with all observations as degrees of freedom (Johnson
    2004, A Bayesian chi-squared test for goodness-of-fit, Annals of Statistics 32). ``marks`` are
    normal deviates of the marks of each profile, (m, profiles).
    """
    found = likelihood.terms(p)
    simulated = (p.mean - p.delay)[..., None]
    smooth = amplitude[:, None, None] * simulated * likelihood.smooth
    columns = np.concatenate([smooth, likelihood.columns(p)], axis=2)[:, likelihood.having]
    distance = squared_distance(found.residual, found.variance, columns)
    spread = likelihood.spread_scores(p)
    distance = distance + np.nansum(spread**2, axis=1) + (marks**2).sum(axis=1)
    count = found.residual.shape[1] + np.isfinite(spread[0]).sum() + marks.shape[1]
    return float(chi2.sf(distance, count).mean())
