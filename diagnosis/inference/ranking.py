"""Hypotheses ranked by a data set: evidence, visibility, and the predictive check.

None, each effect and all pairs are scored. If a pair leads that cannot have made the data, or only
with a large discrepancy, that pair and its nearest rivals are tried with each further effect. If
the sense of rotation is unknown, each sense is treated by itself.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from dogshape.diagnosis.bench.bench_data import Bench, setting_of
from dogshape.diagnosis.bench.sense import REVERSED, forward
from dogshape.diagnosis.inference.evidence import scored_in_turn
from dogshape.diagnosis.inference.joint_refinement import refined
from dogshape.diagnosis.inference.posterior import (
    Folding,
    Probabilities,
    folding,
    judged,
    probabilities,
)
from dogshape.diagnosis.inference.refits import checked
from dogshape.diagnosis.inference.static_readings import informed, log_unknown, measured_facts
from dogshape.diagnosis.inference.unknown import Unknown, unknown
from dogshape.diagnosis.likelihood.discrepancy import marginals
from dogshape.diagnosis.likelihood.scores import Problem, Scored
from dogshape.diagnosis.likelihood.signature import Metric, metric_of
from dogshape.diagnosis.prediction.hypotheses import (
    NONE,
    UNKNOWN,
    log_odds,
    spaces_for,
    spaces_of,
    with_third,
)
from dogshape.diagnosis.prediction.levels import Level
from dogshape.diagnosis.settings import Decision, Priors
from dogshape.diagnosis.terms import Hypothesis
from dogshape.sim.effect import Effect


@dataclass(frozen=True)
class Ranking:
    """Hypotheses with their scores and probabilities.

    Parameters
    ----------
    problem : with the emulator by which hypotheses were scored.
    scored : every hypothesis but unknown with its evidence.
    free : the hypothesis unknown.
    raw : probabilities by evidence.
    fold : which share of each belongs to simpler ones.
    folded : probabilities with weak effects counted as none, the largest first.
    fits : predictive p-values of plausible hypotheses.
    limits : from which a hypothesis fails, and others.
    together : levels at which effects were simulated together meanwhile.
    """

    problem: Problem
    scored: Mapping[Hypothesis, Scored]
    free: Unknown
    metric: Metric
    raw: Probabilities
    fold: Folding
    folded: Probabilities
    fits: Mapping[Hypothesis, float]
    limits: Decision
    together: tuple[Level, ...] = ()

    @property
    def posterior(self) -> Probabilities:
        """Probabilities after the predictive check."""
        return judged(self.folded, self.fits, self.limits.adequate)

    @property
    def leading(self) -> Hypothesis:
        """Most probable hypothesis of known effects."""
        return next(h for h in self.folded if h != UNKNOWN)

    @property
    def fails(self) -> bool:
        """Test that no plausible hypothesis can have made the data."""
        return not any(p >= self.limits.adequate for p in self.fits.values())


def rank(
    problem: Problem,
    bench: Bench,
    effects: Mapping[str, Effect],
    pairs: Sequence[Hypothesis] | None = None,
) -> Ranking:
    """Score all hypotheses on a data set; ``pairs`` are the plausible ones by default."""
    setting, free = setting_of(bench), unknown(problem, bench)
    priors = problem.settings.priors
    scored = scored_in_turn(problem, spaces_of(effects, setting, pairs, problem.sense, priors))
    found = refined(problem, scored)
    problem, scored = found.problem, found.scored
    facts = measured_facts(bench, effects)
    told = sum(log_unknown(fact, effects) for fact in facts)
    free = replace(free, told=told)
    first = replace(_ranked(problem, informed(scored, facts), free), together=found.levels)
    near = [three for pair in _unfitting(problem, first) for three in with_third(pair, effects)]
    # The flight with three effects at once is not tabulated.
    if not near or problem.flights:
        return first
    threes = spaces_for(list(dict.fromkeys(near)), effects, setting)
    best = max(one.log_evidence + log_odds(h, priors) for h, one in scored.items())
    every = {**scored, **scored_in_turn(problem, threes, best)}
    more = refined(problem, every, [space.hypothesis for space in threes])
    whole = _ranked(more.problem, informed(more.scored, facts), free, first)
    return replace(whole, together=(*found.levels, *more.levels))


def _unfitting(problem: Problem, first: Ranking) -> list[Hypothesis]:
    """Return the pairs to try with a third effect, for each sense that may be the true one.

    Either sense is looked into as deeply as if it were known.
    """
    open_to = problem.sense == "unknown" and any(REVERSED in h for h in first.raw)
    views = [within_sense(problem, first, s) for s in (False, True)] if open_to else [first]
    those = [view for view in views if len(forward(view.leading)) == 2 and _open(problem, view)]
    return [pair for view in those for pair in _near(view)]


def _open(problem: Problem, ranking: Ranking) -> bool:
    """Test that the leading hypothesis leaves more than a usual discrepancy, or fails."""
    usual = problem.settings.likelihood.discrepancy
    return ranking.fails or left_over(ranking.scored[ranking.leading]) > usual


def left_over(one: Scored) -> float:
    """Compute the posterior mean of the discrepancy's amplitude, as share of a mean time."""
    rows = one.rows
    if rows.discrepancy.absent:
        return 0.0
    members = marginals(rows.slopes, rows.discrepancy, rows.joint).weights
    sizes = np.tile(rows.discrepancy.amplitudes, len(rows.discrepancy.roots))
    return float(one.weights() @ (members @ sizes))


def sense_chances(raw: Probabilities, priors: Priors) -> dict[bool, float]:
    """Return the probability of the reversed sense (True) and of the other one, if unknown.

    What no known effect explains says nothing of the sense.
    """
    other = sum(p for h, p in raw.items() if REVERSED in h)
    other += priors.reversed_unknown * raw.get(UNKNOWN, 0.0)
    return {False: 1.0 - other, True: other}


def within_sense(problem: Problem, ranking: Ranking, other: bool) -> Ranking:
    """Return the ranking given that the unknown sense is reversed (``other``) or not."""
    before = problem.settings.priors.reversed_unknown
    share = before if other else 1.0 - before
    mine = {h: share if h == UNKNOWN else float((REVERSED in h) == other) for h in ranking.raw}
    whole = sum(p * mine[h] for h, p in ranking.raw.items())
    raw = {h: p * mine[h] / whole for h, p in ranking.raw.items()}
    fold = folding(problem, list(ranking.scored.values()), ranking.metric, raw, ranking.fold)
    folded = fold.fold(raw)
    fits = plausible_fits(problem, ranking.scored, folded, ranking)
    return replace(ranking, raw=raw, fold=fold, folded=folded, fits=fits)


def _near(first: Ranking) -> list[Hypothesis]:
    """Return the pairs of which a third effect may make the cause, the likeliest first.

    By evidence: which of them is nearest to the data by itself says little where none can be.
    """
    pairs = {h: p for h, p in first.raw.items() if len(forward(h)) == 2}
    least = first.limits.near * sum(pairs.values())
    found = sorted((h for h, p in pairs.items() if p >= least), key=lambda h: -pairs[h])
    return list(dict.fromkeys([first.leading, *found]))[: first.limits.tried]


def plausible_fits(
    problem: Problem,
    scored: Mapping[Hypothesis, Scored],
    folded: Probabilities,
    before: Ranking | None = None,
    fit: Callable[[Problem, Scored], float] = checked,
) -> dict[Hypothesis, float]:
    """Return predictive p-values of the hypotheses that are plausible, each by ``fit``.

    Those that ``before``, a ranking of the same problem, has for the same posterior are taken.
    """
    shown = {} if before is None else before.fits
    least = problem.settings.decision.plausible
    those = [h for h, p in folded.items() if h != UNKNOWN and p > least]
    return {
        h: shown[h]
        if before and h in shown and _alike(scored[h], before.scored[h])
        else fit(problem, scored[h])
        for h in those
    }


def _alike(one: Scored, other: Scored) -> bool:
    """Test that two scores have the same rows and weights, whatever the evidence."""
    return one.rows is other.rows and one.log_prior is other.log_prior


def _ranked(
    problem: Problem,
    scored: Mapping[Hypothesis, Scored],
    free: Unknown,
    before: Ranking | None = None,
) -> Ranking:
    """Rank scores; ``before`` is the ranking of some of them."""
    logs = {h: one.log_evidence for h, one in scored.items()}
    every, settings = {**logs, UNKNOWN: free.log_evidence}, problem.settings
    raw = probabilities(every, sense=problem.sense, before=settings.priors)
    metric = metric_of(problem.seen, scored[NONE].rows.predicted, problem.discrepancy)
    fold = folding(problem, list(scored.values()), metric, raw, before.fold if before else None)
    folded = fold.fold(raw)
    fits = plausible_fits(problem, scored, folded, before)
    return Ranking(problem, scored, free, metric, raw, fold, folded, fits, settings.decision)
