"""Evidence and posterior of one hypothesis by importance sampling over its ranges.

Prior draws are a Sobol sequence in the unit cube of shares. Those whose means lie nearest to the
data get their likelihood; the others are taken to have none. Rounds of Student distributions around
the weighted draws follow, all draws weighted by the mixture of everything they were drawn from.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property, lru_cache

import numpy as np
from scipy.special import gammaln, logsumexp
from scipy.stats import qmc

from dogshape.diagnosis.likelihood.likelihood import Likelihood
from dogshape.diagnosis.prediction.model import Model, Predicted
from dogshape.diagnosis.terms import Array, Hypothesis

PRIOR = {0: 1, 1: 128, 2: 512, 3: 1024}  #: draws by the number of parameters
MANY = 2048  #: of more parameters
NEAR, SHARE = 64, 16  #: prior draws that get a likelihood: at least, and one in so many
BATCH = 12  #: hypotheses whose draws get their likelihood at once
ROUND = 192  #: draws of a round
FREEDOM = 5.0  #: of the Student distribution
WIDE = 1.5  #: of its covariance over that of the draws
ENOUGH = 150.0  #: effective draws
FLAT = 60.0  #: effective draws below which weights are flattened for a proposal

More = Callable[[Hypothesis, Array], Array]  #: log likelihood of what is known beside the shifts


@dataclass(frozen=True)
class Sample:
    """Weighted draws of a hypothesis.

    Parameters
    ----------
    shares, predicted : of n draws.
    log : log likelihood, (n,).
    drawn : number of prior draws, and proposals with their numbers.
    """

    hypothesis: Hypothesis
    shares: Array
    predicted: Predicted
    log: Array
    drawn: int
    proposals: tuple[tuple[Array, Array, int], ...] = field(default=())

    @cached_property
    def log_density(self) -> Array:
        """Log of what the draws were drawn from, times their number, (n,)."""
        size = self.shares.shape[1]
        parts = [np.full(len(self.shares), np.log(self.drawn))]
        for mean, root, count in self.proposals:
            scaled = np.linalg.solve(root, (self.shares - mean).T)
            constant = gammaln(0.5 * (FREEDOM + size)) - gammaln(0.5 * FREEDOM)
            constant -= 0.5 * size * np.log(FREEDOM * np.pi) + np.log(np.diag(root)).sum()
            tail = 0.5 * (FREEDOM + size) * np.log1p((scaled**2).sum(axis=0) / FREEDOM)
            parts.append(np.log(count) + constant - tail)
        return np.asarray(logsumexp(parts, axis=0))

    @cached_property
    def log_weights(self) -> Array:
        """Log likelihood over density, (n,): they sum to the evidence."""
        return self.log - self.log_density

    @cached_property
    def log_evidence(self) -> float:
        """Logarithm of the evidence."""
        return float(logsumexp(self.log_weights))

    @cached_property
    def weights(self) -> Array:
        """Posterior weights, (n,)."""
        found = np.exp(self.log_weights - self.log_evidence)
        return np.asarray(found / found.sum())

    @cached_property
    def effective(self) -> float:
        """Effective number of draws."""
        return float(1.0 / (self.weights**2).sum())

    @property
    def error(self) -> float:
        """Standard error of the logarithm of the evidence."""
        return float(np.sqrt(max(0.0, 1.0 / self.effective - 1.0 / len(self.log))))

    def draw(self, count: int, generator: np.random.Generator) -> np.ndarray:
        """Draw places of equally weighted draws, (count,), systematically."""
        steps = (np.arange(count) + generator.random()) / count
        places = np.searchsorted(self.weights.cumsum(), steps)
        return np.minimum(places, len(self.log) - 1)


@lru_cache(maxsize=16)
def prior_shares(size: int) -> Array:
    """Draw the shares of a prior, (n, size)."""
    if size == 0:
        return np.zeros((1, 0))
    return np.asarray(qmc.Sobol(size, seed=7).random(PRIOR.get(size, MANY)))


def log_likelihood(
    likelihood: Likelihood, hypothesis: Hypothesis, shares: Array, p: Predicted, more: More
) -> Array:
    """Compute the log likelihood of draws, -inf where there is no such bench, (m,)."""
    log = likelihood.terms(p).log + more(hypothesis, shares)
    return np.where(likelihood.model.possible(hypothesis, shares), log, -np.inf)


def screened(
    likelihood: Likelihood,
    hypotheses: Sequence[Hypothesis],
    more: More,
    distance: Callable[[Predicted], Array],
) -> Iterator[Sample]:
    """Sample hypotheses by their prior draws nearest to the data, some hypotheses at once."""
    for start in range(0, len(hypotheses), BATCH):
        some = hypotheses[start : start + BATCH]
        near = [_nearest(likelihood.model, h, distance) for h in some]
        log = likelihood.terms(Predicted.joined([p for _, p, _ in near])).log
        ends = np.cumsum([len(shares) for shares, _, _ in near])[:-1]
        for h, (shares, p, whole), mine in zip(some, near, np.split(log, ends), strict=True):
            beside = mine + more(h, shares)
            possible = likelihood.model.possible(h, shares)
            yield Sample(h, shares, p, np.where(possible, beside, -np.inf), whole)


def _nearest(
    model: Model, hypothesis: Hypothesis, distance: Callable[[Predicted], Array]
) -> tuple[Array, Predicted, int]:
    """Select the prior draws nearest to the data: shares, predictions, number of all draws."""
    shares = prior_shares(len(model.space(hypothesis).parameters))
    p = model.predict(hypothesis, shares)
    count = max(NEAR, len(shares) // SHARE)
    if len(shares) <= count:
        return shares, p, len(shares)
    near = np.argpartition(distance(p), count)[:count]
    return shares[near], p.only(near), len(shares)


def refined(
    likelihood: Likelihood, sample: Sample, more: More, rounds: int, generator: np.random.Generator
) -> Sample:
    """Add rounds of draws around the weighted ones, until enough count."""
    size = sample.shares.shape[1]
    for _ in range(rounds if size else 0):
        if sample.effective > ENOUGH or not np.isfinite(sample.log_evidence):
            break
        mean, root = _proposal(sample)
        normal = generator.standard_normal((ROUND, size))
        scale = np.sqrt(generator.chisquare(FREEDOM, (ROUND, 1)) / FREEDOM)
        drawn = mean + (normal / scale) @ root.T
        shares = drawn[((drawn > 0.0) & (drawn < 1.0)).all(axis=1)]
        if not len(shares):
            break
        p = likelihood.model.predict(sample.hypothesis, shares)
        log = log_likelihood(likelihood, sample.hypothesis, shares, p, more)
        sample = Sample(
            sample.hypothesis,
            np.vstack([sample.shares, shares]),
            Predicted.joined([sample.predicted, p]),
            np.concatenate([sample.log, log]),
            sample.drawn,
            (*sample.proposals, (mean, root, ROUND)),
        )
    return sample


def _proposal(sample: Sample) -> tuple[Array, Array]:
    """Compute place and root of the covariance of a round."""
    log = sample.log_weights - sample.log_weights.max()
    flat = min(1.0, max(0.15, sample.effective / FLAT))
    weights = np.exp(flat * log)
    weights /= weights.sum()
    mean = weights @ sample.shares
    apart = sample.shares - mean
    covariance = WIDE * (apart.T * weights) @ apart + 1e-6 * np.eye(len(mean))
    return mean, np.asarray(np.linalg.cholesky(covariance))
