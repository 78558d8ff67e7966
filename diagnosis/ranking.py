"""Hypotheses ranked by a data set: evidence, what cannot be seen, and what fits at all.

None, each effect and the plausible pairs are scored. Where none of them can have made the data and
a pair leads, that pair and its nearest rivals are tried with each further effect.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from diagnosis.belief import Folding, Probabilities, folding, judged, probabilities
from diagnosis.bench import Bench
from diagnosis.classes import PLAUSIBLE
from diagnosis.evidence import evidence
from diagnosis.fit import ADEQUATE, p_value
from diagnosis.hypotheses import NONE, UNKNOWN, Space, spaces_for, spaces_of, with_third
from diagnosis.next_test import setting_of
from diagnosis.scoring import Problem, Scored
from diagnosis.sense import forward
from diagnosis.signature import Metric, metric_of
from diagnosis.spread import Hypothesis
from diagnosis.unknown import Unknown, unknown
from sim.effect import Effect

NEAR = 0.03  #: probability of a pair beside that of all pairs, from which it is tried with a third
MOST = 5  #: such pairs


@dataclass(frozen=True)
class Ranking:
    """What the data say of each hypothesis.

    Parameters
    ----------
    scored : every hypothesis but unknown with its evidence.
    free : the hypothesis unknown.
    raw : probabilities by evidence.
    fold : which share of each belongs to simpler ones.
    folded : probabilities with weak effects counted as none, the largest first.
    fits : predictive p-values of plausible hypotheses.
    """

    scored: Mapping[Hypothesis, Scored]
    free: Unknown
    metric: Metric
    raw: Probabilities
    fold: Folding
    folded: Probabilities
    fits: Mapping[Hypothesis, float]

    @property
    def belief(self) -> Probabilities:
        """Probabilities in which what cannot have made the data counts as unknown."""
        return judged(self.folded, self.fits)

    @property
    def leading(self) -> Hypothesis:
        """The most probable hypothesis of those that say what is different."""
        return next(h for h in self.folded if h != UNKNOWN)

    @property
    def fails(self) -> bool:
        """Whether nothing that is plausible can have made the data."""
        return not any(p >= ADEQUATE for p in self.fits.values())


def rank(
    problem: Problem,
    bench: Bench,
    effects: Mapping[str, Effect],
    pairs: Sequence[Hypothesis] | None = None,
) -> Ranking:
    """Score all hypotheses on a data set; ``pairs`` are the plausible ones by default."""
    setting, free = setting_of(bench), unknown(problem, bench)
    scored = _scored(problem, spaces_of(effects, setting, pairs, problem.sense))
    first = _ranked(problem, scored, free)
    # The flight with three effects at once is not tabulated.
    if not first.fails or len(forward(first.leading)) != 2 or problem.flights:
        return first
    near = [three for pair in _near(first) for three in with_third(pair, list(effects))]
    threes = spaces_for(list(dict.fromkeys(near)), effects, setting)
    best = max(one.log_evidence for one in scored.values())
    return _ranked(problem, {**scored, **_scored(problem, threes, best)}, free)


def _near(first: Ranking) -> list[Hypothesis]:
    """Return the pairs of which a third effect may make the cause, the likeliest first.

    By evidence: which of them is nearest to the data by itself says little where none can be.
    """
    pairs = {h: p for h, p in first.raw.items() if len(forward(h)) == 2}
    least = NEAR * sum(pairs.values())
    found = sorted((h for h, p in pairs.items() if p >= least), key=lambda h: -pairs[h])
    return list(dict.fromkeys([first.leading, *found]))[:MOST]


def plausible_fits(
    problem: Problem, scored: Mapping[Hypothesis, Scored], folded: Probabilities
) -> dict[Hypothesis, float]:
    """Return predictive p-values of the hypotheses that are plausible."""
    those = [h for h, p in folded.items() if h != UNKNOWN and p > PLAUSIBLE]
    return {h: p_value(problem, scored[h]) for h in those}


def _scored(
    problem: Problem, spaces: Sequence[Space], best: float = -np.inf
) -> dict[Hypothesis, Scored]:
    """Return evidences in turn, so that what is hopeless beside the best is left early."""
    found: dict[Hypothesis, Scored] = {}
    for space in spaces:
        found[space.hypothesis] = evidence(problem, space, best)
        best = max(best, found[space.hypothesis].log_evidence)
    return found


def _ranked(problem: Problem, scored: Mapping[Hypothesis, Scored], free: Unknown) -> Ranking:
    logs = {h: one.log_evidence for h, one in scored.items()}
    raw = probabilities({**logs, UNKNOWN: free.log_evidence}, sense=problem.sense)
    metric = metric_of(problem.seen, scored[NONE].rows.predicted)
    fold = folding(problem, list(scored.values()), metric, raw)
    folded = fold.fold(raw)
    fits = plausible_fits(problem, scored, folded)
    return Ranking(scored, free, metric, raw, fold, folded, fits)
