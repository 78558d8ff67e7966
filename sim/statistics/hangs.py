r"""Probability that a shift hangs, by operating point, and what its retries cost.

A shift that does not engage is tried again. Where :math:`k` of :math:`n` shifts of an operating
point hang, the probability :math:`q` has a prior of two parts, and so a posterior of two Beta
distributions with weights :math:`r` and :math:`1 - r` by their beta-binomial likelihoods:

.. math:: q \sim (1-\pi)\,B(s m, s (1-m)) + \pi\,B(1/2, 1/2).

The first part is of rare hangs, with rate :math:`m` and the weight of :math:`s` shifts. The second
one, Jeffreys', is of dogs that block there by their shape. The expected time of retries is
:math:`c\,\bar q/(1-\bar q)` with the cost :math:`c` of a failed attempt and the posterior mean
:math:`\bar q`, its standard error :math:`c\,\sigma_q/(1-\bar q)^2`; both go over into the share
:math:`k/n` and its binomial error where shifts are many.

Outside a study the prior is ``PriorSettings``. In a study rates and strength are fitted to all of
its designs (beta-binomial, empirical Bayes: Casella 1985, Am. Stat. 39, 83-87).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dogshape.sim.elementwise import Array, Mask

JEFFREYS = 0.5  #: both parameters of the prior that favours no probability (Jeffreys 1946)
TAILS = (0.025, 0.975)  #: of the interval of a probability


@dataclass(frozen=True)
class PriorSettings:
    """Assumptions on hangs before any shift was simulated; status: judged.

    Half a hang is Jeffreys' number where none was seen. Twenty shifts keep it small beside the few
    shifts of a quick look and count for nothing in the hundreds of an expectation.
    """

    hangs: float = 0.5  #: prior number of rare hangs, of all operating points together
    shifts: float = 20.0  #: prior number of shifts that they are out of
    blocked_share: float = 0.25  #: probability that some operating point blocks by the shape
    min_strength: float = 3.0  #: shifts of a point that a fitted rate counts for, at least
    max_strength: float = 1000.0  #: and at most


SETTINGS = PriorSettings()


@dataclass(frozen=True)
class HangPosterior:
    """Probability that a shift of an operating point hangs."""

    mean: float
    variance: float


@dataclass(frozen=True)
class HangPrior:
    """Prior of the probability of a hang at one operating point."""

    rate: float  #: mean of rare hangs, share
    strength: float  #: number of shifts that the rate counts for
    blocked_share: float  #: probability that the shape blocks there

    def posterior(self, hangs: int, shifts: int) -> HangPosterior:
        """Update the prior by the number of ``hangs`` among ``shifts``."""
        shares = np.array([1.0 - self.blocked_share, self.blocked_share])
        a = np.array([self.strength * self.rate, JEFFREYS])
        b = np.array([self.strength * (1.0 - self.rate), JEFFREYS])
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
    """Return the prior of each of so many operating points outside a study.

    The prior shifts are spread over the points: posteriors of all points then say of the sum what
    a single point with all of the shifts would.
    """
    rate, strength = settings.hangs / settings.shifts, settings.shifts / points
    return (HangPrior(rate, strength, settings.blocked_share / points),) * points


def interval(mean: float, variance: float) -> tuple[float, float]:
    """Return the central 95 % interval of the Beta distribution with these moments."""
    from scipy.special import betaincinv  # noqa: PLC0415  slow to load

    total = mean * (1.0 - mean) / variance - 1.0
    low, high = (float(betaincinv(total * mean, total * (1.0 - mean), tail)) for tail in TAILS)
    return low, high


RATES = 60  #: rates of the grid for the fit of a study
STRENGTHS = 16  #: strengths of that grid
LOG_ODDS = (-14.0, 0.0)  #: natural logarithms of the odds of the least and the largest rate


def pooled_priors(
    hangs: Array, shifts: Array, settings: PriorSettings = SETTINGS
) -> tuple[HangPrior, ...]:
    """Fit the prior of each operating point to all designs of a study.

    ``hangs`` and ``shifts`` (designs, points) are counts. The rate of a point is the posterior mean
    over a grid, from the prior of ``settings``. The strength, common to all points, is a harmonic
    mean over a grid of even logarithms, so that the prior keeps its mean variance: the smaller one
    by the scatter of designs at each point and by that of their sums over the points, as a design
    may hang more at all of them.
    """
    from scipy.special import expit, logsumexp  # noqa: PLC0415  slow to load

    points = shifts.shape[1]
    weak = weak_priors(points, settings)[0]
    rates = expit(np.linspace(*LOG_ODDS, RATES))[:, None]
    ends = math.log(settings.min_strength), math.log(settings.max_strength)
    strengths = np.exp(np.linspace(*ends, STRENGTHS))
    columns = zip(hangs.T, shifts.T, strict=True)
    likelihoods = [_log_likelihoods(*column, rates, strengths, weak) for column in columns]
    # Even in the odds, a Beta prior has one power more at either end.
    prior = weak.strength * (weak.rate * np.log(rates) + (1.0 - weak.rate) * np.log1p(-rates))
    table = np.array(likelihoods) + prior
    by_strength = logsumexp(table, axis=1)
    total = by_strength.sum(axis=0)
    weights = np.exp(total - logsumexp(total))
    by_points = 1.0 / float(weights @ (1.0 / strengths))
    rates_given = (np.exp(table - by_strength[:, None, :]) * rates).sum(axis=1)
    means = rates_given @ weights
    rare = _rare(hangs, shifts, means, by_points, weak.blocked_share)
    by_sums = _sum_strength(hangs * rare, shifts * rare, means, strengths)
    strength = min(by_points, by_sums)
    return tuple(HangPrior(float(mean), strength, weak.blocked_share) for mean in means)


def pool(counts: Sequence[Sequence[tuple[int, int]]]) -> tuple[HangPrior, ...]:
    """Fit the priors of a study to the (hangs, shifts) of its designs by operating point."""
    numbers = np.array(counts, dtype=float)
    return pooled_priors(numbers[:, :, 0], numbers[:, :, 1])


def _rare(hangs: Array, shifts: Array, means: Array, strength: float, blocked_share: float) -> Mask:
    """Mark the counts that are rather rare hangs than of a shape that blocks, (designs, points)."""
    from scipy.special import betaln  # noqa: PLC0415  slow to load

    a, b, left = strength * means, strength * (1.0 - means), shifts - hangs
    rare = betaln(a + hangs, b + left) - betaln(a, b) + math.log1p(-blocked_share)
    blocked = betaln(JEFFREYS + hangs, JEFFREYS + left) - betaln(JEFFREYS, JEFFREYS)
    return np.asarray(rare > blocked + math.log(blocked_share))


def _sum_strength(hangs: Array, shifts: Array, means: Array, strengths: Array) -> float:
    r"""Return the harmonic mean of the strength by the sums of designs over the points.

    A design hangs :math:`\lambda` times as often as the rates :math:`m_i` say, :math:`\lambda`
    being Gamma distributed with mean one and shape :math:`s \sum m_i`, so that the prior of a sum
    has the variance of independent points with strength :math:`s`: its hangs are negative binomial.
    ``strengths`` have the same probability before.
    """
    from scipy.special import gammaln, logsumexp  # noqa: PLC0415  slow to load

    number, expected = hangs.sum(axis=1)[:, None], (shifts @ means)[:, None]
    shape = strengths * means.sum()
    likelihoods = gammaln(number + shape) - gammaln(shape) + shape * np.log(shape)
    likelihoods -= (number + shape) * np.log(shape + expected)
    total = likelihoods.sum(axis=0)
    return 1.0 / float(np.exp(total - logsumexp(total)) @ (1.0 / strengths))


def _log_likelihoods(
    hangs: Array, shifts: Array, rates: Array, strengths: Array, weak: HangPrior
) -> Array:
    """Return log-likelihoods of counts at one point (designs,), (rates, strengths)."""
    from scipy.special import betaln  # noqa: PLC0415  slow to load

    a, b = rates * strengths, (1.0 - rates) * strengths
    counts, numbers = np.unique(np.stack([hangs, shifts]), axis=1, return_counts=True)
    found = np.zeros(a.shape)
    for (k, n), number in zip(counts.T, numbers, strict=True):
        rare = betaln(a + k, b + n - k) - betaln(a, b) + math.log1p(-weak.blocked_share)
        blocked = betaln(JEFFREYS + k, JEFFREYS + n - k) - betaln(JEFFREYS, JEFFREYS)
        found += number * np.logaddexp(rare, blocked + math.log(weak.blocked_share))
    return found


def _log_beta(a: Array, b: Array) -> Array:
    logs = [math.lgamma(x) + math.lgamma(y) - math.lgamma(x + y) for x, y in zip(a, b, strict=True)]
    return np.array(logs)
