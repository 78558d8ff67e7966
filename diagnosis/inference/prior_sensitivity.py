"""Sensitivity of the answer: with facts from static readings, other priors, other counts.

An effect that a static reading shows is there under every hypothesis. So the plausible hypotheses
are also scored with that effect, with the prior probability that they have without it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from dogshape.diagnosis.bench.bench_data import Bench, setting_of
from dogshape.diagnosis.bench.sense import predictable
from dogshape.diagnosis.inference.evidence import evidence, with_width
from dogshape.diagnosis.inference.posterior import Probabilities, judged, probabilities
from dogshape.diagnosis.inference.predictive_check import p_value
from dogshape.diagnosis.inference.ranking import Ranking, plausible_fits
from dogshape.diagnosis.inference.static_readings import (
    Fact,
    facts_of,
    given,
    informed,
    log_neutral,
    measured_facts,
)
from dogshape.diagnosis.likelihood.scores import Problem, Scored
from dogshape.diagnosis.prediction.hypotheses import UNKNOWN, spaces_for
from dogshape.diagnosis.terms import Hypothesis
from dogshape.sim.effect import Effect


def readings(
    problem: Problem, bench: Bench, ranking: Ranking, effects: Mapping[str, Effect]
) -> dict[str, Probabilities]:
    """Return the probabilities given each fact, under other priors, and with unknown as failed."""
    found, free = {}, ranking.free.log_evidence
    measured = measured_facts(bench, effects)
    for fact in facts_of(bench):
        more = _with_effect(problem, bench, ranking, fact, effects)
        told = informed({h: one for h, (one, _) in more.items()}, measured)
        more = {h: (told[h], bare) for h, (_, bare) in more.items()}
        every = {**ranking.scored, **{h: one for h, (one, _) in more.items()}}
        agreed = {h: given(one, fact) for h, one in every.items()}
        like = {h: bare for h, (_, bare) in more.items()}
        key = f"given_{fact.parameter}"
        found[key] = _read(problem, ranking, agreed, free + log_neutral(fact), like)
    for key, factor in (("priors_halved", 0.5), ("priors_doubled", 2.0)):
        changed = {h: with_width(one, factor) for h, one in ranking.scored.items()}
        found[key] = _read(problem, ranking, changed, free)
    if problem.seen.unknown.any():
        failed = {h: one.read_as_failed() for h, one in ranking.scored.items()}
        log, seen = ranking.free.log_evidence_as_failed, problem.seen
        seen = replace(seen, failed=seen.failed + seen.unknown, unknown=0.0 * seen.unknown)
        counted = replace(problem, seen=seen)
        found["unknown_as_failed"] = _read(counted, ranking, failed, log)
    return found


def _with_effect(
    problem: Problem,
    bench: Bench,
    ranking: Ranking,
    fact: Fact,
    effects: Mapping[str, Effect],
) -> dict[Hypothesis, tuple[Scored, Hypothesis]]:
    """Return plausible hypotheses with the effect that a fact shows, and what each is without."""
    known = float(fact.log_density(np.array([fact.value]))[0])
    hardly = known - log_neutral(fact) < problem.settings.decision.shown
    if fact.effect not in effects or hardly or problem.flights:
        return {}
    bare = [h for h in ranking.fits if fact.effect not in h]
    names: dict[Hypothesis, Hypothesis] = {tuple(sorted((*h, fact.effect))): h for h in bare}
    names = {more: h for more, h in names.items() if predictable(more, problem.sense)}
    spaces = spaces_for(list(names), effects, setting_of(bench))
    found = {space.hypothesis: evidence(problem, space) for space in spaces}
    return {h: (one, names[h]) for h, one in found.items()}


def _read(
    problem: Problem,
    ranking: Ranking,
    scored: Mapping[Hypothesis, Scored],
    free: float,
    like: Mapping[Hypothesis, Hypothesis] | None = None,
) -> Probabilities:
    logs = {h: one.log_evidence for h, one in scored.items()}
    settings, every = problem.settings, {**logs, UNKNOWN: free}
    folded = ranking.fold.fold(probabilities(every, like, problem.sense, settings.priors))
    fits = plausible_fits(problem, scored, folded, ranking, p_value)
    return judged(folded, fits, settings.decision.adequate)
