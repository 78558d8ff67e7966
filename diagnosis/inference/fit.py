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
from typing import NamedTuple
from zlib import crc32

import numpy as np
from scipy.spatial.distance import cdist
from scipy.special import gammaln, logsumexp
from scipy.stats import qmc

from dogshape.diagnosis.inference.adequacy import check_parts, combine_parts
from dogshape.diagnosis.likelihood.likelihood import CommonErrors, Likelihood
from dogshape.diagnosis.prediction.curve import ParameterSpace
from dogshape.diagnosis.prediction.flights import Flights, flight_scores
from dogshape.diagnosis.prediction.model import Prediction
from dogshape.diagnosis.terms import Array, Hypothesis, strip_sense

PRIOR_DRAWS = {0: 1, 1: 128, 2: 512, 3: 1024}  #: by the number of parameters
MAX_PRIOR_DRAWS = 2048  #: of more parameters
MIN_LIKELIHOOD_DRAWS = 64  #: prior draws nearest to the data, that get a likelihood
DRAWS_PER_LIKELIHOOD = 16  #: prior draws for each that gets a likelihood
BATCH_SIZE = 12  #: hypotheses whose draws get their likelihood at once
PROPOSAL_DRAWS = 192  #: draws of a round
FREEDOM = 5.0  #: degrees of freedom of a proposal's Student distribution
COVARIANCE_FACTOR = 1.5  #: of a proposal's covariance over that of the draws
CENTRES = 16  #: of a proposal
SUBSET_DRAWS = 2 * CENTRES  #: draws around each subset of a wider hypothesis
WIDE_PRIOR_DRAWS = 8  #: draws of the prior of a wider hypothesis
ENOUGH_DRAWS = 300.0  #: effective draws, from which no round is added
FLATTENING_DRAWS = 60.0  #: effective draws below which weights are flattened for a proposal
MIN_POWER = 0.15  #: of flattened weights

#: Log likelihood (n,) of observations beside the shifts, at shares (n, p) of a hypothesis.
SideLikelihood = Callable[[Hypothesis, Array], Array]
Distance = Callable[[Prediction], Array]  #: squared distance of predictions from the data, (m,)


@dataclass(frozen=True)
class Proposal:
    """Mixture of Student distributions around draws (West 1993, J. R. Stat. Soc. B 55)."""

    centres: Array  #: (K, p)
    root: Array  #: Cholesky factor of the covariance of each, (p, p)
    columns: np.ndarray  #: those of the shares, (p,); the others are uniform
    count: int = PROPOSAL_DRAWS  #: number of draws from it

    @classmethod
    def from_sample(cls, sample: Sample) -> Proposal:
        """Place the centres at draws by their weights, flattened where few draws count."""
        log = sample.log_weights - sample.log_weights.max()
        power = min(1.0, max(MIN_POWER, sample.effective_count / FLATTENING_DRAWS))
        weights = np.exp(power * log)
        weights /= weights.sum()
        deviation = sample.shares - weights @ sample.shares
        size = deviation.shape[1]
        bandwidth = (4.0 / (CENTRES * (size + 2.0))) ** (2.0 / (size + 4.0))
        covariance = bandwidth * COVARIANCE_FACTOR * (deviation.T * weights) @ deviation
        covariance = covariance + 1e-6 * np.eye(size)
        centres = sample.shares[systematic_draws(weights, CENTRES)]
        return cls(centres, np.linalg.cholesky(covariance), np.arange(size))

    def draw(self, size: int, generator: np.random.Generator) -> Array:
        """Draw shares of ``size`` parameters; those within their ranges, (n, size)."""
        shares = generator.random((self.count, size))
        normal = generator.standard_normal((self.count, len(self.root)))
        scale = np.sqrt(generator.chisquare(FREEDOM, (self.count, 1)) / FREEDOM)
        centres = self.centres[np.arange(self.count) % len(self.centres)]
        shares[:, self.columns] = centres + (normal / scale) @ self.root.T
        return np.asarray(shares[((shares > 0.0) & (shares < 1.0)).all(axis=1)])

    def log_density(self, shares: Array) -> Array:
        """Compute the log density at shares (n, size), (n,)."""
        size = len(self.root)
        inverse = np.linalg.inv(self.root).T
        squares = cdist(shares[:, self.columns] @ inverse, self.centres @ inverse, "sqeuclidean")
        constant = gammaln(0.5 * (FREEDOM + size)) - gammaln(0.5 * FREEDOM)
        constant -= 0.5 * size * np.log(FREEDOM * np.pi) + np.log(np.diag(self.root)).sum()
        tail = np.exp(-0.5 * (FREEDOM + size) * np.log1p(squares / FREEDOM))
        return np.asarray(constant + np.log(tail.mean(axis=1)))


class Draws(NamedTuple):
    """Draws of a hypothesis that have no likelihood yet."""

    hypothesis: Hypothesis
    shares: Array  #: of n draws, (n, p)
    prior_count: int  #: number of prior draws
    proposals: tuple[Proposal, ...] = ()  #: of the other draws


@dataclass(frozen=True)
class Sample:
    """Weighted draws of a hypothesis."""

    hypothesis: Hypothesis
    shares: Array  #: of n draws, (n, p)
    predicted: Prediction  #: of these
    log_likelihood: Array  #: (n,)
    prior_count: int  #: number of prior draws
    proposals: tuple[Proposal, ...] = field(default=())  #: of the other draws

    @cached_property
    def log_density(self) -> Array:
        """Log density of prior and proposals together, times the number of draws, (n,)."""
        logs = [np.full(len(self.shares), np.log(self.prior_count))]
        for proposal in self.proposals:
            logs.append(np.log(proposal.count) + proposal.log_density(self.shares))
        return np.asarray(logsumexp(logs, axis=0))

    @cached_property
    def log_weights(self) -> Array:
        """Log likelihood over density, (n,): they sum to the evidence."""
        return self.log_likelihood - self.log_density

    @cached_property
    def log_evidence(self) -> float:
        """Logarithm of the evidence."""
        return float(logsumexp(self.log_weights))

    @cached_property
    def weights(self) -> Array:
        """Posterior weights, (n,)."""
        weights = np.exp(self.log_weights - self.log_evidence)
        return np.asarray(weights / weights.sum())

    @cached_property
    def effective_count(self) -> float:
        """Effective number of draws."""
        return float(1.0 / (self.weights**2).sum())

    @property
    def error(self) -> float:
        """Standard error of the logarithm of the evidence."""
        variance = 1.0 / self.effective_count - 1.0 / len(self.log_likelihood)
        return float(np.sqrt(max(0.0, variance)))


def systematic_draws(weights: Array, count: int, offset: float = 0.5) -> np.ndarray:
    """Draw indices by weights (n,) that sum to 1, at even steps, (count,)."""
    indices = np.searchsorted(weights.cumsum(), (np.arange(count) + offset) / count)
    return np.minimum(indices, len(weights) - 1)


def generator_of(seed: int, hypothesis: Hypothesis, draws: int = 0) -> np.random.Generator:
    """Build the random generator of a hypothesis that has ``draws`` draws.

    It does not depend on the draws of other hypotheses.
    """
    return np.random.default_rng([seed, crc32(" ".join(hypothesis).encode()), draws])


@lru_cache(maxsize=16)
def prior_shares(size: int, seed: int) -> Array:
    """Draw the shares of a prior, (n, size)."""
    if size == 0:
        return np.zeros((1, 0))
    return np.asarray(qmc.Sobol(size, seed=seed).random(PRIOR_DRAWS.get(size, MAX_PRIOR_DRAWS)))


def _sample(
    likelihood: Likelihood,
    draws: Iterable[Draws],
    side_likelihood: SideLikelihood,
    distance: Distance | None = None,
) -> Iterator[Sample]:
    """Yield the sample of each hypothesis' draws, only the nearest ones where a distance is given.

    The log likelihood is -inf where there is no such bench.
    """
    iterator = iter(draws)
    while batch := list(itertools.islice(iterator, BATCH_SIZE)):
        predictions = []
        for k, item in enumerate(batch):
            p = likelihood.model.predict(item.hypothesis, item.shares)
            count = max(MIN_LIKELIHOOD_DRAWS, item.prior_count // DRAWS_PER_LIKELIHOOD)
            if distance is not None and item.prior_count > count:
                nearest = np.argpartition(distance(p), count)[:count]
                batch[k] = item._replace(shares=item.shares[nearest])
                p = p.select(nearest)
            predictions.append(p)
        logs = likelihood.terms(Prediction.concatenate(predictions)).log_likelihood
        ends = np.cumsum([len(item.shares) for item in batch])[:-1]
        for item, p, log in zip(batch, predictions, np.split(logs, ends), strict=True):
            is_possible = likelihood.model.possible(item.hypothesis, item.shares)
            log_sum = log + side_likelihood(item.hypothesis, item.shares)
            yield Sample(
                hypothesis=item.hypothesis,
                shares=item.shares,
                predicted=p,
                log_likelihood=np.where(is_possible, log_sum, -np.inf),
                prior_count=item.prior_count,
                proposals=item.proposals,
            )


def screen(
    likelihood: Likelihood,
    hypotheses: Sequence[Hypothesis],
    side_likelihood: SideLikelihood,
    distance: Distance,
) -> Iterator[Sample]:
    """Sample hypotheses by their prior draws nearest to the data."""

    def draws() -> Iterator[Draws]:
        for h in hypotheses:
            size = len(likelihood.model.space(h).parameters)
            shares = prior_shares(size, likelihood.settings.seed)
            yield Draws(h, shares, prior_count=len(shares))

    return _sample(likelihood, draws(), side_likelihood, distance)


def widen(
    likelihood: Likelihood,
    subsets: Mapping[Hypothesis, Sequence[Sample]],
    side_likelihood: SideLikelihood,
) -> Iterator[Sample]:
    """Sample hypotheses around the draws of their subsets, with a few draws of the prior."""
    proposal_of = {
        sample.hypothesis: Proposal.from_sample(sample)
        for samples in subsets.values()
        for sample in samples
    }

    def draws() -> Iterator[Draws]:
        for h, samples in subsets.items():
            space = likelihood.model.space(h)
            size = len(space.parameters)
            proposals = []
            for sample in samples:
                columns = [space.columns(name) for name in strip_sense(sample.hypothesis)]
                proposal = proposal_of[sample.hypothesis]
                proposals.append(replace(proposal, columns=np.r_[*columns], count=SUBSET_DRAWS))
            generator = generator_of(likelihood.settings.seed, h)
            proposed_shares = [proposal.draw(size, generator) for proposal in proposals]
            uniform_shares = generator.random((WIDE_PRIOR_DRAWS, size))
            shares = np.vstack([uniform_shares, *proposed_shares])
            yield Draws(h, shares, WIDE_PRIOR_DRAWS, tuple(proposals))

    return _sample(likelihood, draws(), side_likelihood)


def reweight(likelihood: Likelihood, sample: Sample, side_likelihood: SideLikelihood) -> Sample:
    """Weigh the draws of a sample by another likelihood."""
    draws = Draws(sample.hypothesis, sample.shares, sample.prior_count, sample.proposals)
    return next(_sample(likelihood, [draws], side_likelihood))


def refine(
    likelihood: Likelihood,
    sample: Sample,
    side_likelihood: SideLikelihood,
    rounds: int,
    enough: float = ENOUGH_DRAWS,
) -> Sample:
    """Add rounds of draws around the weighted ones, until ``enough`` effective ones count."""
    size = sample.shares.shape[1]
    if size == 0:
        return sample
    for _ in range(rounds):
        if not np.isfinite(sample.log_evidence) or sample.effective_count > enough:
            break
        proposal = Proposal.from_sample(sample)
        seed = likelihood.settings.seed
        generator = generator_of(seed, sample.hypothesis, len(sample.log_likelihood))
        shares = proposal.draw(size, generator)
        if not len(shares):
            break
        draws = Draws(sample.hypothesis, shares, prior_count=0)
        (new_sample,) = _sample(likelihood, [draws], side_likelihood)
        sample = replace(
            sample,
            shares=np.vstack([sample.shares, shares]),
            predicted=Prediction.concatenate([sample.predicted, new_sample.predicted]),
            log_likelihood=np.concatenate([sample.log_likelihood, new_sample.log_likelihood]),
            proposals=(*sample.proposals, proposal),
        )
    return sample


POSTERIOR_DRAWS = 400
CHECK_DRAWS = 60  #: of these, for the check of adequacy
HELD_OUT_DRAWS = 100  #: of these, for predictions of held-out points


@dataclass(frozen=True)
class Interval:
    """Posterior mean, and the ends of 90 %."""

    mean: float
    low: float
    high: float

    @classmethod
    def of(cls, draws: Array) -> Interval:
        """Summarise draws (n,)."""
        low, high = np.quantile(draws, (0.05, 0.95))
        return cls(float(draws.mean()), float(low), float(high))


@dataclass(frozen=True)
class Fit:
    """A hypothesis fitted to a data set."""

    hypothesis: Hypothesis
    space: ParameterSpace  #: parameters of the hypothesis
    shares: Array  #: K equally weighted draws of the posterior, as shares of the ranges, (K, p)
    predicted: Prediction  #: of each draw, (K, C)
    amplitude: Array  #: of the discrepancy, as a share of the predicted time, (K,)
    offset: Array  #: errors in common, discrepancy among them, drawn with each, s, (K, C)
    nuisance: Array  #: the part of ``offset`` by nuisances, s, (K, C)
    deviates: Array  #: normal deviates of the nuisances, (K, nuisances)
    log_evidence: float
    error: float  #: standard error of ``log_evidence`` by numbers of draws and of benches
    checks: Mapping[str, float]  #: p-value of each part of the check of adequacy

    @cached_property
    def p(self) -> float:
        """P-value of all parts of the check together."""
        return combine_parts(self.checks.values())

    @cached_property
    def values(self) -> Array:
        """Values of the parameters, (K, p)."""
        return self.space.values(self.shares)

    @cached_property
    def intervals(self) -> dict[str, Interval]:
        """All parameters with their intervals."""
        columns = zip(self.space.parameters, self.values.T, strict=True)
        return {parameter.name: Interval.of(column) for parameter, column in columns}


def fit(likelihood: Likelihood, sample: Sample, flights: Flights, emulation_error: float) -> Fit:
    """Draw the posterior of a hypothesis from its weighted sample.

    ``emulation_error`` is the standard error of the log evidence by interpolated times.
    """
    generator = generator_of(likelihood.settings.seed, sample.hypothesis)
    draws = systematic_draws(sample.weights, POSTERIOR_DRAWS, float(generator.random()))
    predicted = sample.predicted.select(draws)
    shares = sample.shares[draws]
    errors = likelihood.draw_common_errors(predicted, generator)
    space = likelihood.model.space(sample.hypothesis)
    checked = np.linspace(0, POSTERIOR_DRAWS - 1, CHECK_DRAWS).astype(int)
    values = space.values(shares[checked])
    marks = flight_scores(likelihood.observed.flights, flights, space.hypothesis, values)
    checked_errors = CommonErrors(*(part[checked] for part in errors))
    checks = check_parts(likelihood, predicted.select(checked), checked_errors, marks)
    return Fit(
        hypothesis=sample.hypothesis,
        space=space,
        shares=shares,
        predicted=predicted,
        amplitude=errors.amplitude,
        offset=errors.offset,
        nuisance=errors.nuisance,
        deviates=errors.deviates,
        log_evidence=sample.log_evidence,
        error=float(np.hypot(sample.error, emulation_error)),
        checks=checks,
    )


@dataclass(frozen=True)
class HeldOut:
    """Gaps at operating points that the fit has not seen, root mean square, s."""

    baseline: float  #: without any effect
    held_out: float  #: at each point from all others, by the leading hypothesis
    chance: float  #: by scatter and errors alone
    rival: Hypothesis | None  #: the next hypothesis
    rival_held_out: float | None  #: at each point from all others, by the rival
    mean: Array  #: prediction at each point from all others, s, (C,)
    sd: Array  #: its standard error, s, (C,)


class CrossValidation(NamedTuple):
    """Predictions of c measured points, each from all others."""

    mean: Array  #: s, (c,)
    sd: Array  #: standard error of ``mean``, s, (c,)
    gap: Array  #: observed mean less ``mean``, s, (c,)
    chance: float  #: root mean square gap by scatter and errors alone, s


def predict_held_out(
    likelihood: Likelihood, leading: Fit, rival: Fit | None, baseline: Array
) -> HeldOut:
    """Predict each operating point from all others by the leading hypothesis and its rival.

    ``baseline`` are the gaps without any effect, s, (C,), NaN where there is no mean.
    """
    points = likelihood.measured_points
    validation = cross_validate(likelihood, leading)
    mean = np.full(likelihood.model.cell_count, np.nan)
    sd = mean.copy()
    mean[points] = validation.mean
    sd[points] = validation.sd
    rival_gap = None
    if rival is not None:
        rival_gap = root_mean_square(cross_validate(likelihood, rival).gap)
    return HeldOut(
        baseline=root_mean_square(baseline[points]),
        held_out=root_mean_square(validation.gap),
        chance=validation.chance,
        rival=None if rival is None else rival.hypothesis,
        rival_held_out=rival_gap,
        mean=mean,
        sd=sd,
    )


def cross_validate(likelihood: Likelihood, fitted: Fit) -> CrossValidation:
    """Predict each observed mean from all others.

    Draws count for a point by the inverse of the density that they give it, so as if the point had
    not been seen.
    """
    rows = np.linspace(0, len(fitted.shares) - 1, HELD_OUT_DRAWS).astype(int)
    p = fitted.predicted.select(rows)
    points = likelihood.measured_points
    terms = likelihood.terms(p)
    columns = likelihood.all_common_errors(p, fitted.amplitude[rows])[:, points]
    single = terms.variance[..., None] * np.eye(terms.residual.shape[1])
    inverse = np.linalg.inv(columns @ columns.swapaxes(1, 2) + single)
    diagonal = np.diagonal(inverse, axis1=1, axis2=2)
    gap = (inverse @ terms.residual[..., None])[..., 0] / diagonal
    log = 0.5 * gap**2 * diagonal - 0.5 * np.log(diagonal)
    weights = np.exp(np.minimum(log - log.mean(axis=0), 0.5 * np.log(len(rows))))
    weights /= weights.sum(axis=0)
    observed = likelihood.observed.mean[points]
    mean = (weights * (observed - gap)).sum(axis=0)
    variance = (weights * (1.0 / diagonal + (observed - gap - mean) ** 2)).sum(axis=0)
    scatter = (weights * terms.variance).sum(axis=0)
    return CrossValidation(
        mean=mean,
        sd=np.sqrt(variance),
        gap=observed - mean,
        chance=float(np.sqrt(scatter.mean())),
    )


def root_mean_square(values: Array) -> float:
    """Compute the root mean square of finite values, 0 for none."""
    finite = values[np.isfinite(values)]
    if finite.size == 0:
        return 0.0
    return float(np.sqrt((finite**2).mean()))
