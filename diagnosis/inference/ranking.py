"""Probabilities of all hypotheses: none, one effect, two, three, and something unlisted.

Each effect is part of the cause or not by itself, with its own prior; at most three act at once.
Which sets are computed never changes a prior. All single effects and pairs are screened by prior
draws, sets of three around the draws of their pairs; the plausible ones are refined.
*Unknown* adds a gap of larger amplitude to what any single effect or leading pair predicts.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.special import logsumexp

from dogshape.diagnosis.inference.fit import (
    More,
    Sample,
    refined,
    repeated,
    screened,
    systematic,
    widened,
)
from dogshape.diagnosis.likelihood.likelihood import Likelihood
from dogshape.diagnosis.prediction.model import Model, Predicted
from dogshape.diagnosis.settings import Settings
from dogshape.diagnosis.terms import REVERSED, UNKNOWN, Array, Hypothesis, forward, turned

#: Steps of refinement: nats below the best, hypotheses at most, and rounds of each. Prior draws
#: miss narrow posteriors by many nats, so the first step takes many hypotheses.
STEPS = ((25.0, 72, 1), (14.0, 32, 2), (8.0, 24, 8))
SLACK = 0.05  #: of the predicted time, gap that errors of emulation may explain in the screening
ODD = 4.0  #: standard errors, by which a mean counts at most in the screening
FOR_THIRD, THIRDS = 8.0, 192  #: nats within which a pair promises a set of three, and how many
WITHIN = 6.0  #: halves of squared distance behind the least, of draws where it is simulated
KNOWN = 9.0  #: further nats, within which others are predicted again
OPEN = 256  #: draws of a hypothesis on which something unlisted is put
FLATTENED = 0.2  #: power of the likelihood by which these are drawn
STRETCHES = (1.0, 2.0)  #: of all spreads, where something unlisted acts
REDUNDANT = {"linkage_compliance", "moving_mass"}  #: the linkage's mass is part of its effect


@dataclass(frozen=True)
class Ranking:
    """Samples and log priors of hypotheses, and the log evidence of *unknown*."""

    likelihood: Likelihood
    more: More  #: log likelihood of what is known beside the shifts
    samples: Mapping[Hypothesis, Sample]
    log_prior: Mapping[Hypothesis, float]
    log_unknown: float


def log_prior(hypothesis: Hypothesis, model: Model, settings: Settings, reversed_: float) -> float:
    """Compute the log prior probability of a set of effects."""
    if hypothesis == UNKNOWN:
        return math.log(settings.unlisted)
    odds = {n: settings.prior(n) / (1.0 - settings.prior(n)) for n in model.effects}
    # Elementary symmetric sums: all sets of at most so many effects have probability 1 together.
    sums = np.eye(1, settings.most + 1)[0]
    for value in odds.values():
        sums[1:] = sums[1:] + value * sums[:-1]
    log = math.log1p(-settings.unlisted) - math.log(float(sums.sum()))
    log += sum(math.log(odds[name]) for name in forward(hypothesis))
    if model.turned is None:
        return log
    return log + math.log(reversed_ if REVERSED in hypothesis else 1.0 - reversed_)


def hypotheses_of(model: Model, size: int) -> list[Hypothesis]:
    """List the sets of so many effects, those of the reversed sense behind them."""
    names = sorted(model.effects)
    plain = [h for h in itertools.combinations(names, size) if not set(h) >= REDUNDANT]
    if model.turned is None:
        return plain
    return plain + [turned(h) for h in plain if set(h) <= set(model.turned.effects)]


@dataclass
class _Search:
    """Samples while hypotheses are ranked."""

    likelihood: Likelihood
    more: More
    reversed_: float
    samples: dict[Hypothesis, Sample] = field(default_factory=dict)
    priors: dict[Hypothesis, float] = field(default_factory=dict)

    def take(self, samples: Iterable[Sample]) -> None:
        """Keep samples, with their log prior probabilities."""
        for one in samples:
            self.samples[one.hypothesis] = one
            self.priors[one.hypothesis] = self.prior(one.hypothesis)

    def prior(self, h: Hypothesis) -> float:
        """Compute the log prior probability."""
        return log_prior(h, self.likelihood.model, self.likelihood.settings, self.reversed_)

    def distance(self, p: Predicted) -> Array:
        """Compute squared distances of means and engagement from the data, (m,).

        A mean counts by ``ODD`` at most; a gap within an error of emulation, or ``SLACK``, as none.
        """
        like, some, seen = self.likelihood, self.likelihood.having, self.likelihood.seen
        gap = seen.mean[some] - p.mean[:, some]
        simulated = np.maximum((p.mean - p.delay)[:, some], 1e-3)
        wide = np.minimum(np.hypot(p.common, p.emulated)[:, some], SLACK * simulated)
        own = p.sd[:, some] ** 2 / np.maximum(seen.count[some], 1.0)
        own = own + (like.settings.discrepancy * simulated) ** 2
        squares = (gap - np.clip(gap, -wide, wide)) ** 2 / own
        return np.asarray(np.minimum(squares, ODD**2).sum(axis=1) - 2.0 * like.log_engaged(p))

    def value(self, h: Hypothesis) -> float:
        return self.samples[h].log_evidence + self.priors[h]

    def promise(self, h: Hypothesis) -> float:
        """Estimate what evidence and prior may come to, by the best draw."""
        one = self.samples[h]
        return max(self.value(h), float(one.log.max()) - 1.5 * one.shares.shape[1] + self.priors[h])

    def refine(self, step: int, among: Sequence[Hypothesis] | None = None) -> None:
        """Refine the hypotheses near the best."""
        rate = self.promise if step == 0 else self.value
        score, (within, many, rounds) = {h: rate(h) for h in self.samples}, STEPS[step]
        least = max(score.values()) - within
        names = sorted(score if among is None else among, key=lambda h: -score[h])
        for h in [h for h in names if score[h] > least][:many]:
            self.samples[h] = refined(self.likelihood, self.samples[h], self.more, rounds)

    def simulate_plausible(self, candidates: Sequence[Hypothesis]) -> None:
        """Simulate plausible hypotheses until their likely draws are predicted well.

        Fewer effects come first, and each hypothesis once before any other one twice, even where
        the benches of a rival have put it behind. The first benches do not wait for an error: one
        that is just below the limit leaves the evidence wrong by nats.
        """
        settings = self.likelihood.settings
        remaining = dict[Hypothesis, int]()  # simulations that a hypothesis may still get
        for _ in range(settings.max_simulations):
            threshold = max(map(self.value, self.samples)) - settings.plausible_nats
            plausible = {h for h in candidates if self.value(h) > threshold}
            remaining = dict.fromkeys(sorted(plausible), settings.simulations_each) | remaining
            uncertain_draws = dict[Hypothesis, np.ndarray]()
            for h, count in remaining.items():
                untried = count == settings.simulations_each
                if untried or (count and h in plausible):
                    least_error = 0.0 if untried else settings.uncertain
                    if len(places := self.uncertain_draws(h, least_error)):
                        uncertain_draws[h] = places
            if not uncertain_draws:
                return
            hypothesis = max(
                uncertain_draws, key=lambda h: (-len(forward(h)), remaining[h], self.value(h))
            )
            shares = self.samples[hypothesis].shares[uncertain_draws[hypothesis]]
            model = self.likelihood.model.simulate(hypothesis, shares)
            remaining[hypothesis] = remaining[hypothesis] - 1 if model else 0
            if model:
                self._replace_model(model, hypothesis, threshold - KNOWN)

    def _replace_model(self, model: Model, simulated: Hypothesis, threshold: float) -> None:
        """Weigh the samples again whose predictions the benches of a hypothesis change."""
        changed = {*simulated} - model.readings
        self.likelihood = replace(self.likelihood, model=model)
        for h, sample in self.samples.items():
            if changed <= {*h} and self.promise(h) > threshold:
                self.samples[h] = repeated(self.likelihood, sample, self.more)
        self.samples[simulated] = refined(
            self.likelihood, self.samples[simulated], self.more, rounds=3
        )

    def uncertain_draws(self, h: Hypothesis, least_error: float) -> np.ndarray:
        """List likely draws that may be predicted wrong, between levels or by two effects.

        The best one first, the others by their errors, above ``least_error`` of the predicted mean.
        """
        one = self.samples[h]
        far = np.where(np.isfinite(one.log), self.distance(one.predicted), np.inf)
        best = one.log.argmax()
        rows = np.flatnonzero(far < far.min() + 2.0 * WITHIN)
        rows = np.append(best, rows[rows != best])
        p = one.predicted.only(rows)
        alone = len(set(forward(h)) - self.likelihood.model.readings) == 1
        error = (((p.emulated if alone else p.common) / p.mean) ** 2).mean(axis=1) ** 0.5
        order = np.append(0, 1 + (-error[1:]).argsort())
        return np.asarray(rows[order][error[order] > least_error])

    def widen(self) -> list[Hypothesis]:
        """Sample the sets of three effects that have a plausible pair within, and list them."""
        top = max(self.value(h) for h in self.samples)
        within = dict[Hypothesis, tuple[float, list[Sample]]]()
        for h in hypotheses_of(self.likelihood.model, 3):
            pairs = [tuple(n for n in h if n != name) for name in forward(h)]
            parts = [self.samples[p] for p in pairs if p in self.samples]
            parts = [one for one in parts if np.isfinite(one.log_evidence)]
            best = max((one.log_evidence for one in parts), default=-np.inf) + self.prior(h)
            if best > top - FOR_THIRD:
                within[h] = best, parts
        chosen = sorted(within, key=lambda h: -within[h][0])[:THIRDS]
        parts_of = {h: within[h][1] for h in chosen}
        self.take(widened(self.likelihood, parts_of, self.more))
        return chosen


def rank(likelihood: Likelihood, more: More, reversed_: float, beside: float) -> Ranking:
    """Rank all hypotheses on a data set; ``reversed_`` is the prior of the reversed sense.

    ``more`` is the log likelihood of what is known beside the shifts, ``beside`` the same if
    nothing listed is the cause.
    """
    search = _Search(likelihood, more, reversed_)
    for size in range(min(3, likelihood.settings.most + 1)):
        few = hypotheses_of(likelihood.model, size)
        search.take(screened(likelihood, few, more, search.distance))
    search.refine(0)
    search.refine(1)
    search.simulate_plausible([*search.samples])
    if likelihood.settings.most > 2:
        thirds = search.widen()
        search.refine(0, thirds)
        search.refine(1, thirds)
        search.simulate_plausible(thirds)
    search.refine(2)
    priors = {**search.priors, UNKNOWN: search.prior(UNKNOWN)}
    return Ranking(search.likelihood, more, search.samples, priors, _unlisted(search) + beside)


def _unlisted(search: _Search) -> float:
    """Compute the log evidence of a gap that no effect explains, on top of any of them."""
    like, settings = search.likelihood, search.likelihood.settings
    pairs = [h for h in search.samples if len(forward(h)) == 2]
    some = [h for h in search.samples if len(forward(h)) < 2]
    some += sorted(pairs, key=lambda h: -search.value(h))[:3]
    options = [*itertools.product(settings.unlisted_sizes, settings.unlisted_lengths, STRETCHES)]
    logs = []
    for h in some:
        one = search.samples[h]
        places, density = np.arange(len(one.log)), one.log_density
        if len(one.log) > OPEN:
            log = FLATTENED * one.log - one.log_density
            weights = np.exp(log - logsumexp(log))
            places = systematic(weights, OPEN)
            density = one.log_density[places] + np.log(OPEN * weights[places])
        p = one.predicted.only(places)
        for size, length, stretch in options:
            log = like.terms(replace(p, sd=stretch * p.sd), (size, length)).log
            log = np.where(np.isfinite(one.log[places]), log, -np.inf)
            logs.append(logsumexp(log - density) + search.priors[h])
    known = logsumexp([search.priors[h] for h in some])
    return float(logsumexp(logs) - math.log(len(options)) - known)
