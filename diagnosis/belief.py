"""Probabilities of hypotheses, where an effect too weak to be seen counts as none.

An effect whose strength the data cannot show predicts what none predicts, and a pair with one
such partner what the other predicts. That share of a hypothesis' posterior goes to the simpler
one, so that effects which the data cannot see neither gain nor lose.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import logsumexp

from diagnosis.hypotheses import NONE, UNKNOWN, Space, priors_of
from diagnosis.scoring import Predicted, Problem, Scored
from diagnosis.signature import VISIBLE, Metric, squared
from diagnosis.spread import Array, Hypothesis

DRAWN = 48  #: values drawn from a pair's posterior
NEGLIGIBLE = 1e-4  #: probability below which a pair is not looked into

Probabilities = dict[Hypothesis, float]


def probabilities(logs: Mapping[Hypothesis, float]) -> Probabilities:
    """Return posterior probabilities from the logarithms of evidences."""
    priors = priors_of(list(logs))
    log = np.array([logs[h] + np.log(priors[h]) for h in logs])
    values = np.exp(log - logsumexp(log))
    return dict(zip(logs, values.tolist(), strict=True))


@dataclass(frozen=True)
class Folding:
    """For each hypothesis, the shares of its posterior that belong to simpler ones, and itself."""

    shares: Mapping[Hypothesis, Mapping[Hypothesis, float]]

    def fold(self, raw: Probabilities) -> Probabilities:
        """Return probabilities in which what cannot be seen counts as absent."""
        folded = dict.fromkeys(raw, 0.0)
        for hypothesis, probability in raw.items():
            for target, share in self.shares.get(hypothesis, {hypothesis: 1.0}).items():
                folded[target] += probability * share
        return dict(sorted(folded.items(), key=lambda item: -item[1]))


def folding(
    problem: Problem, scored: Sequence[Scored], metric: Metric, raw: Probabilities
) -> Folding:
    """Return which share of each hypothesis the data cannot tell from a simpler one."""
    spaces = {one.hypothesis: one.space for one in scored}
    baseline = next(one for one in scored if one.hypothesis == NONE).rows.predicted
    nothing = metric.of(baseline)
    found: dict[Hypothesis, Mapping[Hypothesis, float]] = {}
    for one in scored:
        if len(one.hypothesis) == 1:
            weak = squared(metric.of(one.rows.predicted), nothing)[:, 0] < VISIBLE
            share = float(one.weights()[weak].sum())
            found[one.hypothesis] = {NONE: share, one.hypothesis: 1.0 - share}
        elif len(one.hypothesis) == 2 and raw[one.hypothesis] > NEGLIGIBLE:
            found[one.hypothesis] = _pair(problem, one, spaces, metric, nothing)
    return Folding(found)


def _pair(
    problem: Problem,
    pair: Scored,
    spaces: Mapping[Hypothesis, Space],
    metric: Metric,
    nothing: Array,
) -> Mapping[Hypothesis, float]:
    """Return the shares of a pair's posterior that are none, one partner, or both."""
    drawn = pair.rows.only(pair.draw(DRAWN, np.random.default_rng(1)))
    whole = metric.of(drawn.predicted)
    targets: list[Hypothesis] = [NONE]
    apart = [squared(whole, nothing)[:, 0]]
    for name in pair.hypothesis:
        alone = _alone(problem, pair.space, spaces[(name,)], drawn.shares, name)
        apart.append(((whole - metric.of(alone)) ** 2).sum(axis=1))
        targets.append((name,))
    table = np.stack(apart)
    # The nearer partner has it where either alone would do; none before either.
    table[0] = np.where(table[0] < VISIBLE, -1.0, table[0])
    nearest = np.argmin(table, axis=0)
    hidden = table.min(axis=0) < VISIBLE
    shares = {
        target: float((hidden & (nearest == place)).mean()) for place, target in enumerate(targets)
    }
    return {**shares, pair.hypothesis: float(1.0 - hidden.mean())}


def _alone(problem: Problem, both: Space, one: Space, shares: Array, name: str) -> Predicted:
    part = one.values(shares[:, both.columns(name)])
    return problem.predicted((name,), part)


def inclusion(folded: Probabilities) -> dict[str, float]:
    """Return for each effect the probability that it is part of the cause."""
    found: dict[str, float] = {}
    for hypothesis, probability in folded.items():
        for name in () if hypothesis == UNKNOWN else hypothesis:
            found[name] = found.get(name, 0.0) + probability
    return dict(sorted(found.items(), key=lambda item: -item[1]))
