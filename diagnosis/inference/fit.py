"""A hypothesis fitted to a data set: equally weighted draws of its posterior.

Each operating point is predicted from all others too, against what chance alone leaves.

Evidence and posterior are by importance sampling over the ranges. Prior draws are a Sobol sequence
in the unit cube of shares. Those whose means lie nearest to the data get their likelihood; the
others are taken to have none. A wider hypothesis is drawn around the draws of its parts instead.
Rounds of proposals around the weighted draws follow, all draws weighted by the mixture of
everything they were drawn from.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from typing import Any
from zlib import crc32

import numpy as np
from scipy.spatial.distance import cdist
from scipy.special import gammaln, logsumexp
from scipy.stats import chi2, qmc

from dogshape.diagnosis.likelihood.likelihood import Likelihood, squared_distance
from dogshape.diagnosis.prediction.curve import Space
from dogshape.diagnosis.prediction.flights import Flights, flight_scores
from dogshape.diagnosis.prediction.model import Predicted
from dogshape.diagnosis.terms import Array, Hypothesis, forward

PRIOR = {0: 1, 1: 128, 2: 512, 3: 1024}  #: draws by the number of parameters
MANY = 2048  #: of more parameters
NEAR, SHARE = 64, 16  #: prior draws that get a likelihood: at least, and one in so many
BATCH = 12  #: hypotheses whose draws get their likelihood at once
ROUND = 192  #: draws of a round
FREEDOM = 5.0  #: of the Student distribution
WIDE = 1.5  #: of its covariance over that of the draws
CENTRES = 16  #: of a proposal
WIDENED, BESIDE = 2 * CENTRES, 8  #: draws around each part of a wider hypothesis, and of its prior
ENOUGH = 300.0  #: effective draws
FLAT = 60.0  #: effective draws below which weights are flattened for a proposal

More = Callable[[Hypothesis, Array], Array]  #: log likelihood of what is known beside the shifts


@dataclass(frozen=True)
class Proposal:
    """Mixture of Student distributions around draws (West 1993, J. R. Stat. Soc. B 55)."""

    centres: Array  #: (K, p)
    root: Array  #: Cholesky factor of the covariance of each, (p, p)
    columns: np.ndarray  #: those of the shares, (p,); the others are uniform
    count: int = ROUND  #: number of draws from it

    @classmethod
    def around(cls, sample: Sample) -> Proposal:
        """Place the centres at draws by their weights, flattened where few draws count."""
        log = sample.log_weights - sample.log_weights.max()
        weights = np.exp(min(1.0, max(0.15, sample.effective / FLAT)) * log)
        weights /= weights.sum()
        apart = sample.shares - weights @ sample.shares
        size = apart.shape[1]
        narrow = (4.0 / (CENTRES * (size + 2.0))) ** (2.0 / (size + 4.0))
        covariance = narrow * WIDE * (apart.T * weights) @ apart + 1e-6 * np.eye(size)
        centres = sample.shares[systematic(weights, CENTRES)]
        return cls(centres, np.linalg.cholesky(covariance), np.arange(size))

    def draw(self, size: int, generator: np.random.Generator) -> Array:
        """Draw shares of so many parameters, those within their ranges, (n, size)."""
        shares = generator.random((self.count, size))
        normal = generator.standard_normal((self.count, len(self.root)))
        scale = np.sqrt(generator.chisquare(FREEDOM, (self.count, 1)) / FREEDOM)
        around = self.centres[np.arange(self.count) % len(self.centres)]
        shares[:, self.columns] = around + (normal / scale) @ self.root.T
        return np.asarray(shares[((shares > 0.0) & (shares < 1.0)).all(axis=1)])

    def log_density(self, shares: Array) -> Array:
        """Compute the log of the density, (n,)."""
        size = len(self.root)
        inverse = np.linalg.inv(self.root).T
        squares = cdist(shares[:, self.columns] @ inverse, self.centres @ inverse, "sqeuclidean")
        constant = gammaln(0.5 * (FREEDOM + size)) - gammaln(0.5 * FREEDOM)
        constant -= 0.5 * size * np.log(FREEDOM * np.pi) + np.log(np.diag(self.root)).sum()
        tail = np.exp(-0.5 * (FREEDOM + size) * np.log1p(squares / FREEDOM))
        return np.asarray(constant + np.log(tail.mean(axis=1)))


@dataclass(frozen=True)
class Sample:
    """Weighted draws of a hypothesis."""

    hypothesis: Hypothesis
    shares: Array  #: of n draws, (n, p)
    predicted: Predicted  #: of these
    log: Array  #: log likelihood, (n,)
    drawn: int  #: number of prior draws
    proposals: tuple[Proposal, ...] = field(default=())  #: of the other draws

    @cached_property
    def log_density(self) -> Array:
        """Log of what the draws were drawn from, times their number, (n,)."""
        parts = [np.full(len(self.shares), np.log(self.drawn))]
        parts += [np.log(one.count) + one.log_density(self.shares) for one in self.proposals]
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


def systematic(weights: Array, count: int, offset: float = 0.5) -> np.ndarray:
    """Draw places by weights (n,) that sum to 1, at even steps, (count,)."""
    places = np.searchsorted(weights.cumsum(), (np.arange(count) + offset) / count)
    return np.minimum(places, len(weights) - 1)


def generator_of(seed: int, hypothesis: Hypothesis, drawn: int = 0) -> np.random.Generator:
    """Seed the draws of a hypothesis, of which so many are there, whatever was drawn of others."""
    return np.random.default_rng([seed, crc32(" ".join(hypothesis).encode()), drawn])


@lru_cache(maxsize=16)
def prior_shares(size: int, seed: int) -> Array:
    """Draw the shares of a prior, (n, size)."""
    if size == 0:
        return np.zeros((1, 0))
    return np.asarray(qmc.Sobol(size, seed=seed).random(PRIOR.get(size, MANY)))


Drawn = tuple[Hypothesis, Array, int, tuple[Proposal, ...]]  #: shares, prior draws, proposals


def _batched(
    likelihood: Likelihood,
    drawn: Iterable[Drawn],
    more: More,
    distance: Callable[[Predicted], Array] | None = None,
) -> Iterator[Sample]:
    """Sample hypotheses at shares, by a ``distance`` the nearest; -inf for no such bench."""
    every = iter(drawn)
    while some := list(itertools.islice(every, BATCH)):
        parts = []
        for h, given, whole, proposals in some:
            p, count = likelihood.model.predict(h, given), max(NEAR, whole // SHARE)
            near: Any = slice(None)
            if distance is not None and whole > count:
                near = np.argpartition(distance(p), count)[:count]
            parts.append((h, given[near], p.only(near), whole, proposals))
        log = likelihood.terms(Predicted.joined([p for _, _, p, _, _ in parts])).log
        ends = np.cumsum([len(shares) for _, shares, *_ in parts])[:-1]
        for (h, shares, p, whole, proposals), mine in zip(parts, np.split(log, ends), strict=True):
            possible = likelihood.model.possible(h, shares)
            beside = np.where(possible, mine + more(h, shares), -np.inf)
            yield Sample(h, shares, p, beside, whole, proposals)


def screened(
    likelihood: Likelihood,
    hypotheses: Sequence[Hypothesis],
    more: More,
    distance: Callable[[Predicted], Array],
) -> Iterator[Sample]:
    """Sample hypotheses by their prior draws nearest to the data."""
    model, seed = likelihood.model, likelihood.settings.seed
    draws = ((h, prior_shares(len(model.space(h).parameters), seed)) for h in hypotheses)
    return _batched(likelihood, ((h, s, len(s), ()) for h, s in draws), more, distance)


def widened(
    likelihood: Likelihood,
    within: Mapping[Hypothesis, Sequence[Sample]],
    more: More,
) -> Iterator[Sample]:
    """Sample hypotheses around the draws of parts of them, with a few draws of the prior."""
    around = {one.hypothesis: Proposal.around(one) for parts in within.values() for one in parts}

    def drawn() -> Iterator[Drawn]:
        for h, parts in within.items():
            space = likelihood.model.space(h)
            size, proposals = len(space.parameters), []
            for one in parts:
                columns = [space.columns(name) for name in forward(one.hypothesis)]
                mine = replace(around[one.hypothesis], columns=np.r_[*columns], count=WIDENED)
                proposals.append(mine)
            generator = generator_of(likelihood.settings.seed, h)
            near = [one.draw(size, generator) for one in proposals]
            yield h, np.vstack([generator.random((BESIDE, size)), *near]), BESIDE, tuple(proposals)

    return _batched(likelihood, drawn(), more)


def repeated(likelihood: Likelihood, sample: Sample, more: More) -> Sample:
    """Weigh the draws of a hypothesis again by another likelihood."""
    drawn = sample.hypothesis, sample.shares, sample.drawn, sample.proposals
    return next(_batched(likelihood, [drawn], more))


def refined(likelihood: Likelihood, sample: Sample, more: More, rounds: int) -> Sample:
    """Add rounds of draws around the weighted ones, until enough count."""
    size = sample.shares.shape[1]
    for _ in range(rounds if size else 0):
        if not np.isfinite(sample.log_evidence) or sample.effective > ENOUGH:
            break
        proposal = Proposal.around(sample)
        generator = generator_of(likelihood.settings.seed, sample.hypothesis, len(sample.log))
        shares = proposal.draw(size, generator)
        if not len(shares):
            break
        (new,) = _batched(likelihood, [(sample.hypothesis, shares, 0, ())], more)
        sample = replace(
            sample,
            shares=np.vstack([sample.shares, shares]),
            predicted=Predicted.joined([sample.predicted, new.predicted]),
            log=np.concatenate([sample.log, new.log]),
            proposals=(*sample.proposals, proposal),
        )
    return sample


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
    nuisance: Array  #: the part of ``offset`` by nuisances, s, (K, C)
    log_evidence: float  #: and its standard error
    error: float  #: by finite numbers of draws and of benches
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


GROUPS = 4  #: of benches, each left out in turn


def emulation_error(likelihood: Likelihood, sample: Sample, more: More) -> float:
    """Estimate the standard error of a log evidence that stems from the choice of benches.

    A delete-a-group jackknife (Kott 2001, J. Official Statistics 17) over the further benches of
    the hypothesis' effects. 0 where there are none.
    """
    model = likelihood.model
    if not model.has_further_benches(sample.hypothesis):
        return 0.0
    thinned = (model.thinned(sample.hypothesis, group, GROUPS) for group in range(GROUPS))
    logs = [repeated(replace(likelihood, model=one), sample, more).log_evidence for one in thinned]
    return float(np.sqrt((GROUPS - 1) * np.var(logs)))


def fit(likelihood: Likelihood, sample: Sample, flights: Flights, more: More) -> Fit:
    """Draw the posterior of a hypothesis."""
    generator = generator_of(likelihood.settings.seed, sample.hypothesis)
    places = systematic(sample.weights, DRAWN, float(generator.random()))
    predicted, shares = sample.predicted.only(places), sample.shares[places]
    amplitude, offset, nuisance = likelihood.drawn(predicted, generator)
    space = likelihood.model.space(sample.hypothesis)
    some = np.linspace(0, DRAWN - 1, CHECKED).astype(int)
    values = space.values(shares[some])
    marks = flight_scores(likelihood.seen.flights, flights, space.hypothesis, values)
    p = predictive_p(likelihood, predicted.only(some), amplitude[some], marks)
    error = float(np.hypot(sample.error, emulation_error(likelihood, sample, more)))
    h, log = sample.hypothesis, sample.log_evidence
    return Fit(h, space, shares, predicted, amplitude, offset, nuisance, log, error, p)


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
    own = found.variance[..., None] * np.eye(found.residual.shape[1])
    inverse = np.linalg.inv(columns @ columns.swapaxes(1, 2) + own)
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
