r"""Probability that a shift hangs, by operating point, and the time of its retries.

A shift that does not engage is tried again. Where :math:`k` of :math:`n` shifts of an operating
point hang, the probability :math:`q` has a prior of two parts, and so a posterior of two Beta
distributions with weights :math:`r` and :math:`1 - r` by their beta-binomial likelihoods:

.. math:: q \sim (1-\pi)\,B(s m, s (1-m)) + \pi\,B(1/2, 1/2).

The first part is of rare hangs, with rate :math:`m` and the weight of :math:`s` shifts. The second
one, Jeffreys', is of dogs that block there by their shape. The expected time of retries is
:math:`c\,\bar q/(1-\bar q)` with the cost :math:`c` of a failed attempt and the posterior mean
:math:`\bar q`, its standard error :math:`c\,\sigma_q/(1-\bar q)^2`; for many shifts both approach
those of the share :math:`k/n` and its binomial error.

Outside a study the prior is ``PriorSettings``. In a study rates and strength are fitted to all of
its designs (beta-binomial, empirical Bayes: Casella 1985, Am. Stat. 39, 83-87).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from dogshape.sim.elementwise import Array, Mask

JEFFREYS = 0.5  #: both parameters of the uninformative Beta prior (Jeffreys 1946)
TAILS = (0.025, 0.975)  #: of the interval of a probability


@dataclass(frozen=True)
class PriorSettings:
    """Assumptions on hangs before any shift was simulated; status: judged.

    Half a hang is Jeffreys' number for no observed one. Twenty shifts have a small weight in a
    quick look at a few shifts and none among the hundreds of an expectation.
    """

    hangs: float = 0.5  #: prior number of rare hangs, of all operating points together
    shifts: float = 20.0  #: prior number of shifts to these hangs
    blocked_share: float = 0.25  #: probability that some operating point blocks by the shape
    min_strength: float = 3.0  #: smallest weight of a fitted rate, shifts of a point
    max_strength: float = 1000.0  #: largest weight of a fitted rate


SETTINGS = PriorSettings()


@dataclass(frozen=True)
class HangPosterior:
    """Probability that a shift of an operating point hangs."""

    mean: float
    variance: float

    @property
    def interval(self) -> tuple[float, float]:
        """95 % interval of the probability."""
        return interval(self.mean, self.variance)


@dataclass(frozen=True)
class HangPrior:
    """Prior of the probability of a hang at one operating point."""

    rate: float  #: mean of rare hangs, share
    strength: float  #: number of shifts that the rate counts for
    blocked_share: float  #: probability that the shape blocks there

    def posterior(self, hangs: int, shifts: int) -> HangPosterior:
        """Update the prior by the number of ``hangs`` among ``shifts``."""
        return _posterior(self, hangs, shifts)


@lru_cache(maxsize=4096)  # most designs of a study have the same few counts
def _posterior(prior: HangPrior, hangs: int, shifts: int) -> HangPosterior:
    shares = np.array([1.0 - prior.blocked_share, prior.blocked_share])
    a = np.array([prior.strength * prior.rate, JEFFREYS])
    b = np.array([prior.strength * (1.0 - prior.rate), JEFFREYS])
    updated_a, updated_b = a + hangs, b + (shifts - hangs)
    logs = np.log(shares) + _log_beta(updated_a, updated_b) - _log_beta(a, b)
    weights = np.exp(logs - logs.max())
    weights /= weights.sum()
    total = updated_a + updated_b
    means = updated_a / total
    variances = means * (1.0 - means) / (total + 1.0)
    mean = float(weights @ means)
    return HangPosterior(mean, float(weights @ (variances + (means - mean) ** 2)))


def weak_priors(points: int, settings: PriorSettings = SETTINGS) -> tuple[HangPrior, ...]:
    """Return the prior of a hang for each of ``points`` operating points outside a study.

    The prior shifts are spread over the points: the posteriors of all points give the sum that a
    single point with all of the shifts would.
    """
    prior = HangPrior(
        rate=settings.hangs / settings.shifts,
        strength=settings.shifts / points,
        blocked_share=settings.blocked_share / points,
    )
    return (prior,) * points


def interval(mean: float, variance: float) -> tuple[float, float]:
    """Compute the central 95 % interval of a Beta distribution by ``mean`` and ``variance``."""
    from scipy.special import betaincinv  # noqa: PLC0415  slow to load

    total = mean * (1.0 - mean) / variance - 1.0
    low, high = (float(betaincinv(total * mean, total * (1.0 - mean), tail)) for tail in TAILS)
    return low, high


RATES = 60  #: rates of the grid for the fit of a study
STRENGTHS = 16  #: strengths of that grid
LOG_ODDS = (-14.0, 0.0)  #: natural logarithms of the odds of the smallest and the largest rate


def pool(counts: ArrayLike) -> tuple[HangPrior, ...]:
    """Fit the prior of each operating point to all designs of a study.

    ``counts`` are numbers of hangs and shifts, (designs, points, 2). The rate of a point is the
    posterior mean over a grid, from the prior of ``SETTINGS``. The strength, common to all points,
    is a harmonic mean over a grid of even logarithms, so that the prior keeps its mean variance:
    the smaller one by the scatter of designs at each point and by that of their sums over the
    points, as a design may hang more at all of them.
    """
    from scipy.special import expit, logsumexp  # noqa: PLC0415  slow to load

    hangs, shifts = np.moveaxis(np.array(counts, dtype=float), 2, 0)
    weak_prior = weak_priors(shifts.shape[1])[0]
    rates = expit(np.linspace(*LOG_ODDS, RATES))[:, None]
    log_strengths = np.linspace(
        math.log(SETTINGS.min_strength), math.log(SETTINGS.max_strength), STRENGTHS
    )
    strengths = np.exp(log_strengths)
    log_likelihoods = [
        _log_likelihoods(point_hangs, point_shifts, rates, strengths=strengths, prior=weak_prior)
        for point_hangs, point_shifts in zip(hangs.T, shifts.T, strict=True)
    ]
    # On a grid even in the odds a Beta prior has one power more at either end.
    rate = weak_prior.rate
    log_prior = weak_prior.strength * (rate * np.log(rates) + (1.0 - rate) * np.log1p(-rates))
    log_posterior = np.array(log_likelihoods) + log_prior  # (points, rates, strengths)
    log_evidence = logsumexp(log_posterior, axis=1)
    log_weights = log_evidence.sum(axis=0)
    weights = np.exp(log_weights - logsumexp(log_weights))
    point_strength = 1.0 / float(weights @ (1.0 / strengths))
    mean_rates = (np.exp(log_posterior - log_evidence[:, None, :]) * rates).sum(axis=1)
    means = mean_rates @ weights
    is_rare = _mark_rare(
        hangs, shifts, means, strength=point_strength, blocked_share=weak_prior.blocked_share
    )
    sum_strength = _sum_strength(hangs * is_rare, shifts * is_rare, means, strengths)
    strength = min(point_strength, sum_strength)
    return tuple(HangPrior(float(mean), strength, weak_prior.blocked_share) for mean in means)


def _mark_rare(
    hangs: Array, shifts: Array, means: Array, strength: float, blocked_share: float
) -> Mask:
    """Mark counts more probable as rare hangs than by a blocking shape, (designs, points)."""
    from scipy.special import betaln  # noqa: PLC0415  slow to load

    a = strength * means
    b = strength * (1.0 - means)
    engaged = shifts - hangs
    log_rare = betaln(a + hangs, b + engaged) - betaln(a, b) + math.log1p(-blocked_share)
    log_blocked = betaln(JEFFREYS + hangs, JEFFREYS + engaged) - betaln(JEFFREYS, JEFFREYS)
    return np.asarray(log_rare > log_blocked + math.log(blocked_share))


def _sum_strength(hangs: Array, shifts: Array, means: Array, strengths: Array) -> float:
    r"""Compute the harmonic mean of the strength by the sums of designs over the points.

    A design hangs :math:`\lambda` times as often as the rates :math:`m_i`; :math:`\lambda` is Gamma
    distributed with mean one and shape :math:`s \sum m_i`, so that the prior of a sum has the
    variance of independent points with strength :math:`s`: its hangs are negative binomial. The
    prior of ``strengths`` is uniform.
    """
    from scipy.special import gammaln, logsumexp  # noqa: PLC0415  slow to load

    hang_sums = hangs.sum(axis=1)[:, None]
    expected_sums = (shifts @ means)[:, None]
    shape = strengths * means.sum()
    log_likelihoods = gammaln(hang_sums + shape) - gammaln(shape) + shape * np.log(shape)
    log_likelihoods -= (hang_sums + shape) * np.log(shape + expected_sums)
    log_weights = log_likelihoods.sum(axis=0)
    return 1.0 / float(np.exp(log_weights - logsumexp(log_weights)) @ (1.0 / strengths))


def _log_likelihoods(
    hangs: Array, shifts: Array, rates: Array, strengths: Array, prior: HangPrior
) -> Array:
    """Sum log-likelihoods of the counts of all designs at one point, (rates, strengths)."""
    from scipy.special import betaln  # noqa: PLC0415  slow to load

    a = rates * strengths
    b = (1.0 - rates) * strengths
    counts, design_counts = np.unique(np.stack([hangs, shifts]), axis=1, return_counts=True)
    log_likelihoods = np.zeros(a.shape)
    for (k, n), design_count in zip(counts.T, design_counts, strict=True):
        log_rare = betaln(a + k, b + n - k) - betaln(a, b) + math.log1p(-prior.blocked_share)
        log_blocked = betaln(JEFFREYS + k, JEFFREYS + n - k) - betaln(JEFFREYS, JEFFREYS)
        log_blocked += math.log(prior.blocked_share)
        log_likelihoods += design_count * np.logaddexp(log_rare, log_blocked)
    return log_likelihoods


def _log_beta(a: Array, b: Array) -> Array:
    logs = [math.lgamma(x) + math.lgamma(y) - math.lgamma(x + y) for x, y in zip(a, b, strict=True)]
    return np.array(logs)
