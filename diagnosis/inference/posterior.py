"""Probabilities of hypotheses, where an effect too weak to be seen counts as none.

An effect whose strength the data cannot show predicts the same as no effect. A pair with such a
partner predicts the same as its other effect. That share of the posterior moves to the simpler
hypothesis, so that invisible effects neither gain nor lose.

Whether it can be seen, the distance of signatures says (``diagnosis.likelihood.signature``), before
the data. The log Bayes factor of predictions at the distance *d* is about normal, with the mean
:math:`d^2/2` and the deviation *d* (``CONTRADICTED``). Where evidence prefers an effect by more
than that leaves, the data have seen it by what signatures have no coordinate for, such as more late
shifts, and nothing of it moves.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import logsumexp

from dogshape.diagnosis.bench.sense import Sense
from dogshape.diagnosis.inference.predictive_check import ADEQUATE
from dogshape.diagnosis.likelihood.scores import Problem, Scored
from dogshape.diagnosis.likelihood.signature import Metric, squared
from dogshape.diagnosis.prediction.hypotheses import NONE, PRIORS, UNKNOWN, priors_of
from dogshape.diagnosis.settings import Priors
from dogshape.diagnosis.terms import Array, Hypothesis

DRAWN = 2000  #: values drawn from the posterior of several effects
NEGLIGIBLE = 1e-4  #: probability below which several effects are not looked into
CONTRADICTED = 2.0  #: deviations of a log Bayes factor above what its distance leads to expect

Probabilities = dict[Hypothesis, float]


def probabilities(
    logs: Mapping[Hypothesis, float],
    like: Mapping[Hypothesis, Hypothesis] | None = None,
    sense: Sense = "known",
    before: Priors = PRIORS,
) -> Probabilities:
    """Return posterior probabilities from the logarithms of evidences.

    ``like`` says which hypotheses are, before the data, as probable as which others; ``sense``
    whether the sign of the mismatch is known, ``before`` what is probable before the data.
    """
    as_others = like or {}
    priors = priors_of([h for h in logs if h not in as_others], sense, before)
    log = np.array([logs[h] + np.log(priors[as_others.get(h, h)]) for h in logs])
    values = np.exp(log - logsumexp(log))
    return dict(zip(logs, values.tolist(), strict=True))


@dataclass(frozen=True)
class Folding:
    """Shares of each hypothesis' posterior that belong to simpler ones, and to itself."""

    shares: Mapping[Hypothesis, Mapping[Hypothesis, float]]

    def fold(self, raw: Probabilities) -> Probabilities:
        """Move the probability of effects that cannot be seen to simpler hypotheses."""
        folded = dict.fromkeys(raw, 0.0)
        for hypothesis, probability in raw.items():
            for target, share in self.shares.get(hypothesis, {hypothesis: 1.0}).items():
                folded[target] += probability * share
        return dict(sorted(folded.items(), key=lambda item: -item[1]))


def folding(
    problem: Problem,
    scored: Sequence[Scored],
    metric: Metric,
    raw: Probabilities,
    before: Folding | None = None,
) -> Folding:
    """Compute the share of each hypothesis that the data cannot tell from a simpler one.

    The shares depend on no probability; ``before`` has those of the same scores that are known.
    """
    shown = {} if before is None else before.shares
    every = {one.hypothesis: one for one in scored}
    nothing, visible = metric.of(every[NONE].rows.predicted), problem.settings.decision.visible
    found: dict[Hypothesis, Mapping[Hypothesis, float]] = {}
    for one in scored:
        if len(one.hypothesis) == 1:
            weak = squared(metric.of(one.rows.predicted), nothing)[:, 0] < visible
            share = min(1.0, float(one.weights()[weak].sum()))
            share *= not _seen_by_data(one, every[NONE], visible)
            found[one.hypothesis] = {NONE: share, one.hypothesis: 1.0 - share}
        elif len(one.hypothesis) > 1 and raw[one.hypothesis] > NEGLIGIBLE:
            mine = shown.get(one.hypothesis)
            found[one.hypothesis] = mine or _several(problem, one, every, metric, nothing)
    return Folding(found)


def _seen_by_data(one: Scored, simpler: Scored, visible: float) -> bool:
    """Test that the data prefer a hypothesis by more than its signature could."""
    limit = 0.5 * visible + CONTRADICTED * float(np.sqrt(visible))
    return one.log_evidence - simpler.log_evidence > limit


def _several(
    problem: Problem,
    whole: Scored,
    every: Mapping[Hypothesis, Scored],
    metric: Metric,
    nothing: Array,
) -> Mapping[Hypothesis, float]:
    """Return the shares of a posterior that are none, all effects but one, or all."""
    visible = problem.settings.decision.visible
    which, counts = np.unique(whole.draw(DRAWN, np.random.default_rng(1)), return_counts=True)
    drawn, weights = whole.rows.only(which), counts / DRAWN
    places = metric.of(drawn.predicted)
    targets: list[Hypothesis] = [NONE]
    # What the data have seen is near to nothing simpler.
    told = _seen_by_data(whole, every[NONE], visible)
    apart = [np.full(len(places), np.inf) if told else squared(places, nothing)[:, 0]]
    for part in itertools.combinations(whole.hypothesis, len(whole.hypothesis) - 1):
        if part in every and not _seen_by_data(whole, every[part], visible):
            space = every[part].space
            columns = [drawn.shares[:, whole.space.columns(e.name)] for e in space.effects]
            alone = problem.summary(part, space.values(np.hstack(columns)))
            apart.append(((places - metric.of(alone)) ** 2).sum(axis=1))
            targets.append(part)
    table = np.stack(apart)
    # The nearer part has it where either alone would do; none before either.
    table[0] = np.where(table[0] < visible, -1.0, table[0])
    nearest = np.argmin(table, axis=0)
    hidden = table.min(axis=0) < visible
    shares = {
        target: float(weights[hidden & (nearest == place)].sum())
        for place, target in enumerate(targets)
    }
    return {**shares, whole.hypothesis: float(weights[~hidden].sum())}


def noise(
    top: Hypothesis,
    raw: Probabilities,
    folding: Folding,
    scored: Mapping[Hypothesis, Scored],
) -> float:
    """Return the Monte Carlo standard error of a hypothesis' probability.

    Errors of the evidences count, and that the shares which fold into simpler hypotheses are those
    of finitely many values.
    """
    parts = {h: folding.shares.get(h, {h: 1.0}).get(top, 0.0) for h in raw}
    whole = sum(raw[h] * share for h, share in parts.items())
    variance = 0.0
    for hypothesis, one in scored.items():
        error = one.error if np.isfinite(one.error) else 0.0
        share = min(1.0, parts.get(hypothesis, 0.0))  # a sum of weights may be a digit above
        probability = raw.get(hypothesis, 0.0)
        variance += (probability * (share - whole) * error) ** 2
        several = len(hypothesis) > 1
        count = 1.0 / float((one.weights() ** 2).sum()) if 0.0 < share < 1.0 else np.inf
        count = min(count, float(DRAWN)) if several else count
        variance += probability**2 * share * (1.0 - share) / count
    return float(np.sqrt(variance))


def judged(
    folded: Probabilities, fits: Mapping[Hypothesis, float], limit: float = ADEQUATE
) -> Probabilities:
    """Move the probability of hypotheses that fail the predictive check to `unknown`.

    Evidence only ranks what was thought of; the best of them may still miss the data. A hypothesis
    keeps the share that its predictive p-value has of the ``limit`` below which it fails.
    """
    kept = {h: p * min(1.0, fits.get(h, limit) / limit) for h, p in folded.items()}
    kept[UNKNOWN] = kept.get(UNKNOWN, 0.0) + sum(folded.values()) - sum(kept.values())
    return dict(sorted(kept.items(), key=lambda item: -item[1]))


def inclusion(folded: Probabilities) -> dict[str, float]:
    """Compute for each effect the probability that it is part of the cause."""
    found: dict[str, float] = {}
    for hypothesis, probability in folded.items():
        for name in () if hypothesis == UNKNOWN else hypothesis:
            found[name] = found.get(name, 0.0) + probability
    return dict(sorted(found.items(), key=lambda item: -item[1]))
