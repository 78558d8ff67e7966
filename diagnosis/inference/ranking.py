"""Probabilities of all hypotheses: none, one effect, two, three, and something unlisted.

Each effect belongs to the cause independently of the others, with its own prior; at most three act
together. Priors do not depend on which sets are computed. All single effects and pairs are screened
by prior draws, sets of three around the draws of their pairs; the plausible ones are refined.
Benches are simulated where the error of an evidence, or the prospect of a better draw, moves a
probability. *Unknown* adds a discrepancy of larger amplitude to the prediction of each single
effect and leading pair.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from scipy.special import expit, logsumexp

from dogshape.diagnosis.inference.fit import (
    Sample,
    SideLikelihood,
    prior_shares,
    refine,
    reweight,
    screen,
    systematic_draws,
    widen,
)
from dogshape.diagnosis.likelihood.likelihood import Likelihood
from dogshape.diagnosis.prediction.model import Model, Prediction
from dogshape.diagnosis.settings import Settings
from dogshape.diagnosis.terms import (
    REVERSED,
    UNKNOWN,
    Array,
    Hypothesis,
    reverse_sense,
    strip_sense,
)


class RefinementStep(NamedTuple):
    """Hypotheses that a step of refinement takes."""

    nats: float  #: below the best
    max_hypotheses: int
    rounds: int  #: of draws for each


#: Prior draws miss narrow posteriors by many nats, so the first step takes many hypotheses.
STEPS = (
    RefinementStep(nats=25.0, max_hypotheses=72, rounds=1),
    RefinementStep(nats=14.0, max_hypotheses=32, rounds=2),
    RefinementStep(nats=8.0, max_hypotheses=24, rounds=8),
)
SIMULATION_ROUNDS = 8  #: of draws after a simulation, at most
SIMULATION_DRAWS = 150.0  #: effective draws, after which no further round is drawn
EMULATION_TOLERANCE = 0.05  #: of the predicted time, gap that screening ignores
MAX_DEVIATE = 4.0  #: standard errors, by which a mean counts at most in the screening
TRIPLE_NATS = 8.0  #: below the best, within which a pair is extended to sets of three
MAX_TRIPLES = 192  #: sets of three that are sampled
LIKELY_DISTANCE = 12.0  #: squared distance beyond the smallest, of draws that are simulated
OCCAM_NATS = 1.5  #: expected loss of evidence by a parameter, from the best draw
PROSPECT_DRAWS = 128  #: prior draws among which a prospect is sought
PROSPECT_LIKELIHOODS = 16  #: of these, that get a likelihood
MIN_TIME_SHARE = 0.1  #: least optimistic time, as a share of the predicted one
REPLACE_NATS = 14.0  #: below the best, within which predictions are replaced
STAKE_DIGITS = 4  #: decimals of a stake; the last digits differ between processors
CONVERGENCE_ROUNDS = 2  #: last rounds of simulations whose moves count as an error
UNLISTED_DRAWS = 256  #: draws of a hypothesis to which an unlisted gap is added
UNLISTED_POWER = 0.2  #: of the likelihood by which these are drawn
UNLISTED_PAIRS = 3  #: leading pairs to which an unlisted gap is added
REDUNDANT = {"linkage_compliance", "moving_mass"}  #: the linkage's mass is part of its effect


@dataclass(frozen=True)
class Ranking:
    """Samples and log priors of hypotheses, and the log evidence of *unknown*."""

    likelihood: Likelihood
    side_likelihood: SideLikelihood  #: log likelihood of observations beside the shifts
    samples: Mapping[Hypothesis, Sample]
    emulation_error: Mapping[Hypothesis, float]  #: of the log evidence, by interpolated times
    log_prior: Mapping[Hypothesis, float]
    log_unknown: float


def log_prior(
    hypothesis: Hypothesis, model: Model, settings: Settings, reversed_prior: float
) -> float:
    """Compute the log prior probability of a set of effects.

    ``reversed_prior`` is the probability of the reversed sense of rotation.
    """
    if hypothesis == UNKNOWN:
        return math.log(settings.unlisted)
    odds = {name: settings.prior(name) / (1.0 - settings.prior(name)) for name in model.effects}
    # All sets up to the largest size have probability 1 together.
    total = _sum_over_sets(tuple(odds.values()), settings.most)
    log = math.log1p(-settings.unlisted) - math.log(total)
    log += sum(math.log(odds[name]) for name in strip_sense(hypothesis))
    if model.reversed_model is None:
        return log
    sense_prior = reversed_prior if REVERSED in hypothesis else 1.0 - reversed_prior
    return log + math.log(sense_prior)


@lru_cache(maxsize=16)
def _sum_over_sets(odds: tuple[float, ...], max_size: int) -> float:
    """Sum the odds of all sets up to a size, by elementary symmetric sums."""
    sums = np.zeros(max_size + 1)  # sums[k] over the sets of k effects
    sums[0] = 1.0
    for value in odds:
        sums[1:] = sums[1:] + value * sums[:-1]
    return float(sums.sum())


def hypotheses_of(model: Model, size: int) -> list[Hypothesis]:
    """List the sets of ``size`` effects, then these with the reversed sense."""
    names = sorted(model.effects)
    hypotheses = [h for h in itertools.combinations(names, size) if not set(h) >= REDUNDANT]
    if model.reversed_model is None:
        return hypotheses
    reversible = set(model.reversed_model.effects)
    return hypotheses + [reverse_sense(h) for h in hypotheses if set(h) <= reversible]


class _Prospect(NamedTuple):
    """Gain that simulation may bring a hypothesis, and the draw that promises it."""

    gain: float  #: of the log evidence, nats
    shares: Array  #: of the ranges, (p,)


@dataclass
class HypothesisSearch:
    """Samples while the hypotheses are ranked on a data set, under one meaning of its record."""

    likelihood: Likelihood
    side_likelihood: SideLikelihood  #: log likelihood of observations beside the shifts
    reversed_prior: float  #: probability of the reversed sense of rotation
    log_side_unknown: float  #: the same of observations beside the shifts, with an unlisted cause
    log_meaning: float  #: log prior probability of this meaning of the record
    samples: dict[Hypothesis, Sample] = field(default_factory=dict)
    priors: dict[Hypothesis, float] = field(default_factory=dict)
    rounds: dict[Hypothesis, int] = field(default_factory=dict)  #: of simulated benches
    moves: dict[Hypothesis, list[float]] = field(default_factory=dict)  #: of log evidences, nats
    prospects: dict[Hypothesis, _Prospect] = field(default_factory=dict)
    exhausted: set[Hypothesis] = field(default_factory=set)  #: without a further bench to simulate

    def store(self, samples: Iterable[Sample]) -> None:
        """Store samples with their log prior probabilities."""
        for sample in samples:
            self.samples[sample.hypothesis] = sample
            self.priors[sample.hypothesis] = self.prior(sample.hypothesis)

    def prior(self, h: Hypothesis) -> float:
        """Compute the log prior probability."""
        model = self.likelihood.model
        return log_prior(h, model, self.likelihood.settings, self.reversed_prior)

    def distance(self, p: Prediction) -> Array:
        """Compute squared distances of means and engagement from the data, (m,).

        A mean counts by ``MAX_DEVIATE`` at most; a gap within the error of emulation, or
        ``EMULATION_TOLERANCE``, does not count.
        """
        likelihood = self.likelihood
        observed = likelihood.observed
        points = likelihood.measured_points
        gap = observed.mean[points] - p.mean[:, points]
        simulated = np.maximum((p.mean - p.delay)[:, points], 1e-3)
        emulation_error = np.hypot(p.common_error, p.emulation_error)[:, points]
        tolerance = np.minimum(emulation_error, EMULATION_TOLERANCE * simulated)
        variance = p.sd[:, points] ** 2 / np.maximum(observed.count[points], 1.0)
        variance = variance + (likelihood.settings.discrepancy * simulated) ** 2
        squares = (gap - np.clip(gap, -tolerance, tolerance)) ** 2 / variance
        mean_distance = np.minimum(squares, MAX_DEVIATE**2).sum(axis=1)
        return np.asarray(mean_distance - 2.0 * likelihood.log_engaged(p))

    def value(self, h: Hypothesis) -> float:
        """Compute log evidence plus log prior."""
        return self.samples[h].log_evidence + self.priors[h]

    def bound_value(self, h: Hypothesis) -> float:
        """Bound log evidence plus log prior from the best draw."""
        sample = self.samples[h]
        max_log = float(sample.log_likelihood.max())
        bound = max_log - OCCAM_NATS * sample.shares.shape[1] + self.priors[h]
        return max(self.value(h), bound)

    def refine(self, step: int, candidates: Sequence[Hypothesis] | None = None) -> None:
        """Refine the hypotheses near the best, among all or some candidates."""
        score_of = self.bound_value if step == 0 else self.value
        scores = {h: score_of(h) for h in self.samples}
        nats, max_hypotheses, rounds = STEPS[step]
        threshold = max(scores.values()) - nats
        if candidates is None:
            candidates = [*scores]
        order = sorted(candidates, key=lambda h: -scores[h])
        for h in [h for h in order if scores[h] > threshold][:max_hypotheses]:
            self.samples[h] = refine(self.likelihood, self.samples[h], self.side_likelihood, rounds)

    def screen(self) -> None:
        """Sample none, all single effects and all pairs by draws of their priors."""
        likelihood = self.likelihood
        for size in range(min(3, likelihood.settings.most + 1)):
            hypotheses = hypotheses_of(likelihood.model, size)
            self.store(screen(likelihood, hypotheses, self.side_likelihood, self.distance))
        self.refine(0)
        self.refine(1)
        self.find_prospects()

    def find_prospects(self) -> None:
        """Find the prospects of plausible hypotheses with two parameters or more of the shift.

        At the true sizes of two effects their interaction rule may cost ``rule_nats``, and levels
        of an effect with two parameters are sparse.
        """
        model = self.likelihood.model
        threshold = max(map(self.value, self.samples)) - self.likelihood.settings.rule_nats
        for h in self.samples:
            effects = [model.effects[name] for name in model.contact_effects(h)]
            parameter_count = sum(len(effect.parameters) for effect in effects)
            if parameter_count > 1 and h not in self.prospects and self.bound_value(h) > threshold:
                self.prospects[h] = self._prospect(h)

    def _prospect(self, h: Hypothesis) -> _Prospect:
        """Compute the gain that simulation may bring a hypothesis.

        The gain is that of the best draw with all means as near to the data as their stated errors
        allow.
        """
        likelihood = self.likelihood
        sample = self.samples[h]
        size = sample.shares.shape[1]
        prior_draws = prior_shares(size, likelihood.settings.seed)[:PROSPECT_DRAWS]
        shares = np.vstack([prior_draws, sample.shares])
        p = self._optimistic(likelihood.model.predict(h, shares))
        order = np.argsort(self.distance(p))[:PROSPECT_LIKELIHOODS]
        log = likelihood.terms(p.select(order)).log_likelihood
        log = log + self.side_likelihood(h, shares[order])
        log = np.where(likelihood.model.possible(h, shares[order]), log, -np.inf)
        best = int(log.round(2).argmax())
        optimistic_value = float(log[best]) - OCCAM_NATS * size + self.prior(h)
        gain = min(max(0.0, optimistic_value - self.value(h)), likelihood.settings.rule_nats)
        return _Prospect(gain=round(gain, 2), shares=shares[order[best]])

    def _optimistic(self, p: Prediction) -> Prediction:
        """Move predicted means towards the data as far as their errors by emulation allow."""
        prediction_error = np.hypot(p.common_error, p.emulation_error)
        max_move = self.likelihood.settings.prospect_reach * prediction_error
        gap = np.nan_to_num(self.likelihood.observed.mean - p.mean)
        error = np.sqrt(np.maximum(p.error**2 - p.common_error**2, (0.01 * p.mean) ** 2))
        shortest = p.delay + MIN_TIME_SHARE * (p.mean - p.delay)
        return replace(
            p,
            mean=np.maximum(p.mean + np.clip(gap, -max_move, max_move), shortest),
            error=error,
            common_error=np.zeros_like(p.common_error),
            emulation_error=np.zeros_like(p.emulation_error),
        )

    def simulate(self, hypothesis: Hypothesis) -> None:
        """Simulate benches at likely draws of a hypothesis, and weigh the samples again."""
        self.rounds[hypothesis] = self.rounds.get(hypothesis, 0) + 1
        shares = self.samples[hypothesis].shares[self.uncertain_draws(hypothesis)]
        tests_prospect = hypothesis in self.prospects and self.rounds[hypothesis] == 1
        if tests_prospect:  # its draw comes second, after the best one
            shares = np.insert(shares, 1, self.prospects[hypothesis].shares, axis=0)
        model = self.likelihood.model.simulate(hypothesis, shares, is_dense=not tests_prospect)
        if model is None:
            self.exhausted.add(hypothesis)
            return
        log_evidence = self.samples[hypothesis].log_evidence
        self._replace_model(model, hypothesis)
        move = self.samples[hypothesis].log_evidence - log_evidence
        self.moves.setdefault(hypothesis, []).append(abs(round(move, 2)))

    def is_open(self, h: Hypothesis) -> bool:
        """Check that further benches of a hypothesis may be simulated."""
        rounds = self.rounds.get(h, 0)
        return rounds < self.likelihood.settings.simulations_each and h not in self.exhausted

    def emulation_error(self, h: Hypothesis) -> float:
        """Estimate the standard error of a log evidence that interpolated times cause.

        At least the largest move by the last ``CONVERGENCE_ROUNDS``, and the spread between sets of
        benches. 0 if all effects change only the reading of a shift. A prospect counts until it is
        simulated: after that its move does.
        """
        settings = self.likelihood.settings
        if not self.likelihood.model.contact_effects(h):
            return 0.0
        nats = settings.emulated_nats
        rounds = self.rounds.get(h, 0)
        if h in self.prospects and rounds == 0:
            nats = max(nats, settings.prospect_share * self.prospects[h].gain)
        mean_error = nats * (1.0 + rounds) ** -settings.emulated_decay
        last_moves = self.moves.get(h, [])[-CONVERGENCE_ROUNDS:]
        return float(max([mean_error, settings.emulated_floor, *last_moves]))

    def reducible_error(self, h: Hypothesis) -> float:
        """Estimate the part of ``emulation_error`` that further benches would remove."""
        error = self.emulation_error(h)
        floor = self.likelihood.settings.emulated_floor
        return math.sqrt(max(0.0, error**2 - floor**2))

    def _replace_model(self, model: Model, simulated: Hypothesis) -> None:
        """Reweight the samples whose predictions new benches change."""
        changed_effects = model.new_effects(self.likelihood.model)
        self.likelihood = replace(self.likelihood, model=model)
        threshold = max(map(self.value, self.samples)) - REPLACE_NATS
        for h, sample in self.samples.items():
            if changed_effects <= {*h} and self.bound_value(h) > threshold:
                self.samples[h] = reweight(self.likelihood, sample, self.side_likelihood)
        self.samples[simulated] = refine(
            self.likelihood,
            self.samples[simulated],
            self.side_likelihood,
            rounds=SIMULATION_ROUNDS,
            enough=SIMULATION_DRAWS,
        )

    def uncertain_draws(self, h: Hypothesis) -> np.ndarray:
        """List the likely draws by index: the best one, then by decreasing prediction error.

        The error is that of interpolation for one effect, that in common for several.
        """
        sample = self.samples[h]
        is_possible = np.isfinite(sample.log_likelihood)
        distance = np.where(is_possible, self.distance(sample.predicted), np.inf)
        best = sample.log_likelihood.argmax()
        draws = np.flatnonzero(distance < distance.min() + LIKELY_DISTANCE)
        draws = np.append(best, draws[draws != best])
        p = sample.predicted.select(draws)
        is_single = len(self.likelihood.model.contact_effects(h)) == 1
        error = p.emulation_error if is_single else p.common_error
        relative_error = ((error / p.mean) ** 2).mean(axis=1) ** 0.5
        order = np.append(0, 1 + (-relative_error[1:]).argsort())
        return np.asarray(draws[order])

    def widen(self) -> list[Hypothesis]:
        """Sample the sets of three effects that include a plausible pair, and list them."""
        threshold = max(self.value(h) for h in self.samples) - TRIPLE_NATS
        values = dict[Hypothesis, float]()
        subsets = dict[Hypothesis, list[Sample]]()
        for h in hypotheses_of(self.likelihood.model, 3):
            # The reversed sense of a set stays with each of its pairs.
            pairs = [tuple(n for n in h if n != name) for name in strip_sense(h)]
            samples = [self.samples[pair] for pair in pairs if pair in self.samples]
            samples = [sample for sample in samples if np.isfinite(sample.log_evidence)]
            evidence = max((sample.log_evidence for sample in samples), default=-np.inf)
            value = evidence + self.prior(h)
            if value > threshold:
                values[h] = value
                subsets[h] = samples
        triples = sorted(values, key=lambda h: -values[h])[:MAX_TRIPLES]
        self.store(widen(self.likelihood, {h: subsets[h] for h in triples}, self.side_likelihood))
        return triples

    @property
    def log_unknown(self) -> float:
        """Log evidence of *unknown*, observations beside the shifts included."""
        return self.log_unlisted() + self.log_side_unknown

    @property
    def unknown_value(self) -> float:
        """Log evidence plus log prior of *unknown*."""
        return self.log_unknown + self.prior(UNKNOWN)

    def log_unlisted(self) -> float:
        """Compute the log evidence of a discrepancy that no effect explains.

        It is added to none, each single effect and the leading pairs.
        """
        settings = self.likelihood.settings
        pairs = [h for h in self.samples if len(strip_sense(h)) == 2]
        bases = [h for h in self.samples if len(strip_sense(h)) < 2]
        bases += sorted(pairs, key=lambda h: -self.value(h))[:UNLISTED_PAIRS]
        gaps = [*itertools.product(settings.unlisted_sizes, settings.unlisted_lengths)]
        option_count = len(gaps) * len(settings.unlisted_stretches)
        logs = []
        for h in bases:
            sample = self.samples[h]
            draws, log_density = _flattened_draws(sample)
            p = sample.predicted.select(draws)
            is_possible = np.isfinite(sample.log_likelihood[draws])
            for stretch in settings.unlisted_stretches:
                stretched = replace(p, sd=stretch * p.sd)
                for terms in self.likelihood.unlisted_terms(stretched, gaps):
                    log = np.where(is_possible, terms.log_likelihood, -np.inf)
                    logs.append(logsumexp(log - log_density) + self.priors[h])
        log_bases = logsumexp([self.priors[h] for h in bases])
        return float(logsumexp(logs) - math.log(option_count) - log_bases)


def _flattened_draws(sample: Sample) -> tuple[np.ndarray, Array]:
    """Draw by a power of the likelihood.

    Returns indices, and the log density of each draw times the number of draws, (k,) each.
    """
    if len(sample.log_likelihood) <= UNLISTED_DRAWS:
        return np.arange(len(sample.log_likelihood)), sample.log_density
    log = UNLISTED_POWER * sample.log_likelihood - sample.log_density
    weights = np.exp(log - logsumexp(log))
    draws = systematic_draws(weights, UNLISTED_DRAWS)
    return draws, sample.log_density[draws] + np.log(UNLISTED_DRAWS * weights[draws])


def rank(searches: Sequence[HypothesisSearch]) -> list[Ranking]:
    """Rank all hypotheses on a data set, under each meaning of its record."""
    for search in searches:
        search.screen()
    _simulate_plausible(searches)
    if searches[0].likelihood.settings.most > 2:
        for search in searches:
            triples = search.widen()
            search.refine(0, triples)
            search.refine(1, triples)
            search.find_prospects()
        _simulate_plausible(searches)
    for search in searches:
        search.refine(2)
    return [_ranking_of(search) for search in searches]


def _simulate_plausible(searches: Sequence[HypothesisSearch]) -> None:
    """Simulate hypotheses until no error of an evidence moves a probability.

    The hypothesis with the most at stake comes first. The probability of *unknown* counts as it was
    before the benches, and is computed again after them.
    """
    while stakes := _list_stakes(searches, log_unknown := _log_unknown(searches)):
        while stakes:
            stake = max(stakes, key=lambda stake: stake.change)
            stake.search.simulate(stake.hypothesis)
            stakes = _list_stakes(searches, log_unknown)


def _log_unknown(searches: Sequence[HypothesisSearch]) -> float:
    """Compute log evidence plus log prior of *unknown* under all meanings of the record."""
    return float(logsumexp([search.unknown_value + search.log_meaning for search in searches]))


class _Stake(NamedTuple):
    """Change of a probability by the error of its log evidence."""

    search: HypothesisSearch
    hypothesis: Hypothesis
    change: float


def _list_stakes(searches: Sequence[HypothesisSearch], log_unknown: float) -> list[_Stake]:
    """List hypotheses whose probability emulation errors move by more than ``converged``.

    None where the leading one is named whatever these errors are.
    """
    settings = searches[0].likelihood.settings
    pairs = [(search, h) for search in searches for h in search.samples]
    logs = np.array([search.value(h) + search.log_meaning for search, h in pairs])
    errors = np.array([search.reducible_error(h) for search, h in pairs])
    log_probability = np.minimum(logs - logsumexp([*logs, log_unknown]), -1e-9)
    log_odds = log_probability - np.log(-np.expm1(log_probability))
    probability = expit(log_odds)
    leading = int(probability.argmax())
    largest_errors = settings.decided * errors
    moves = expit(log_odds + largest_errors) - probability
    moves[leading] = probability[leading] - expit(log_odds[leading] - largest_errors[leading])
    lowest_probability = probability[leading] - math.hypot(*moves)
    if settings.names(pairs[leading][1], lowest_probability):
        return []
    rise = expit(log_odds + errors) - probability
    fall = probability - expit(log_odds - errors)
    change = np.maximum(rise, fall)
    stakes = []
    for (search, h), value in zip(pairs, change.round(STAKE_DIGITS).tolist(), strict=True):
        if value > settings.converged and search.is_open(h):
            stakes.append(_Stake(search, h, value))
    return stakes


def _ranking_of(search: HypothesisSearch) -> Ranking:
    """Build the ranking of a finished search."""
    return Ranking(
        likelihood=search.likelihood,
        side_likelihood=search.side_likelihood,
        samples=search.samples,
        emulation_error={h: search.emulation_error(h) for h in search.samples},
        log_prior={**search.priors, UNKNOWN: search.prior(UNKNOWN)},
        log_unknown=search.log_unknown,
    )
