"""The diagnosis of a data set: which effect makes the gap, how sure, and what to test next."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from diagnosis.belief import Folding, Probabilities, folding, inclusion, probabilities
from diagnosis.bench import Bench
from diagnosis.classes import PLAUSIBLE, Confusion, confusable, confusion, invisible
from diagnosis.evidence import evidence, with_width
from diagnosis.facts import against, facts_of, log_agreement
from diagnosis.fit import p_value
from diagnosis.heldout import HeldOut, by_effects, by_unknown, held_out
from diagnosis.hypotheses import NONE, UNKNOWN, spaces_of
from diagnosis.likelihood import Rules, observe
from diagnosis.next_test import Foretold, NextTest, Standing, choose, foretold, setting_of, why
from diagnosis.parameters import Bound, Interval, bounds, intervals
from diagnosis.scoring import Predicted, Problem, Scored
from diagnosis.signature import Metric, metric_of
from diagnosis.spread import Emulator, Hypothesis
from diagnosis.unknown import Unknown, unknown
from diagnosis.verdict import Verdict, decide
from diagnosis.words import Found, headline, in_words
from sim.effect import Effect
from sim.units import RPM

Record = dict[str, Any]


@dataclass(frozen=True)
class Diagnosis:
    """What is found; carries the data set.

    Parameters
    ----------
    belief : probability of each hypothesis, the largest first, weak effects counted as none.
    raw : before that.
    scored : every hypothesis but unknown with its evidence.
    fits : predictive p-values of plausible hypotheses.
    before_after, rival : held-out gaps of the leading hypothesis, and of the best other one.
    hidden : for each effect, the share of its prior that the data cannot tell from none.
    bounds : what each effect is at most.
    other : probabilities with priors half and twice as wide, and with unknown shifts failed.
    tests : the menu, best first.
    foretold : what the leading hypothesis says of each operating point.
    """

    bench: Bench
    verdict: Verdict
    belief: Probabilities
    raw: Probabilities
    scored: Mapping[Hypothesis, Scored]
    confusion: Confusion
    fits: Mapping[Hypothesis, float]
    before_after: HeldOut
    rival: tuple[Hypothesis, HeldOut] | None
    hidden: Mapping[str, float]
    bounds: Mapping[str, Bound]
    other: Mapping[str, Probabilities]
    tests: tuple[NextTest, ...]
    baseline: Predicted
    metric: Metric
    effects: Mapping[str, Effect]
    foretold: Foretold

    def as_dict(self) -> Record:
        """Return the record of the contract, with more."""
        from_rival = self.rival[1] if self.rival else None
        aliases = {name: effect.aliases for name, effect in self.effects.items()}
        return {
            "bench": self.bench.name,
            "verdict": self.verdict.kind,
            "causes": list(self.verdict.causes),
            "headline": headline(self.found),
            "summary": in_words(self.found),
            "hypotheses": [self._hypothesis(h) for h in self.belief],
            "confusable": confusable(self.confusion, aliases),
            "gap": {
                "baseline_rmse_s": self.before_after.baseline,
                "heldout_rmse_s": self.before_after.held_out,
                "floor_rmse_s": self.before_after.floor,
                "shrink": self.before_after.shrink,
                "rival": list(self.rival[0]) if self.rival else None,
                "rival_heldout_rmse_s": from_rival.held_out if from_rival else None,
                "rival_shrink": from_rival.shrink if from_rival else None,
            },
            "where": self._where(),
            "next_test": {
                "name": self.tests[0].name,
                "why": why(self.tests[0], self.belief, self.effects),
            },
            "tests": [
                {"name": t.name, "information_nats": t.information, "hours": t.hours}
                for t in self.tests[:8]
            ],
            "inclusion": inclusion(self.belief),
            "credible_set": [list(h) for h in self.verdict.credible],
            "class_probability": self.verdict.group_probability,
            "no_information": [n for n, share in self.hidden.items() if share > 0.999],
            "hidden_share": dict(self.hidden),
            "bounds": {name: bound.as_dict() for name, bound in self.bounds.items()},
            "facts": [
                {
                    "effect": fact.effect,
                    "parameter": fact.parameter,
                    "value": fact.value,
                    "low": fact.low,
                    "high": fact.high,
                    "sentence": against(fact, self.scored),
                }
                for fact in facts_of(self.bench)
            ],
            "sensitivity": {
                key: [{"effects": list(h), "probability": p} for h, p in list(belief.items())[:5]]
                for key, belief in self.other.items()
            },
        }

    @property
    def leading(self) -> Hypothesis:
        """The most probable hypothesis."""
        return next(iter(self.belief))

    @property
    def found(self) -> Found:
        """What is put into words."""
        gaps, test = self.before_after, self.tests[0]
        return Found(self.verdict, self.belief, self.intervals, gaps, test, self.effects)

    @property
    def intervals(self) -> Mapping[Hypothesis, Mapping[str, Interval]]:
        """Parameters of each hypothesis with 90 % intervals."""
        return {h: intervals(one) for h, one in self.scored.items()}

    def _hypothesis(self, hypothesis: Hypothesis) -> Record:
        found = self.scored.get(hypothesis)
        record: Record = {
            "effects": list(hypothesis),
            "probability": self.belief[hypothesis],
            "parameters": {},
            "evidence_probability": self.raw[hypothesis],
        }
        if found is not None:
            record["parameters"] = {n: i.as_dict() for n, i in intervals(found).items()}
            record["log_evidence"] = found.log_evidence
            # None where it was left before the error was known, since it is hopeless.
            record["log_evidence_error"] = found.error if np.isfinite(found.error) else None
        if hypothesis in self.fits:
            record["predictive_p"] = self.fits[hypothesis]
        return record

    def _where(self) -> list[Record]:
        found = []
        for place, cell in enumerate(self.bench.cells):
            gap = None if cell.time is None else cell.time - float(self.baseline.mean[0, place])
            gap = gap if gap is None or np.isfinite(gap) else None
            error = float(self.metric.mean[place])
            found.append(
                {
                    "mismatch_rpm": cell.point.mismatch / RPM,
                    "force_N": cell.point.profile.force,
                    "gap_s": gap,
                    "z": None if gap is None else gap / error,
                }
            )
        return found


def diagnose(
    bench: Bench,
    emulator: Emulator,
    effects: Mapping[str, Effect],
    *,
    pairs: Sequence[Hypothesis] | None = None,
    rules: Rules | None = None,
) -> Diagnosis:
    """Diagnose a data set.

    Parameters
    ----------
    emulator : says what hypotheses predict at the data set's operating points.
    effects : that are considered, by name.
    pairs : of them, the plausible ones by default.
    """
    problem = Problem(observe(bench), emulator, rules or Rules())
    scored = _all_scored(problem, bench, effects, pairs)
    free = unknown(problem, bench)
    raw = _beliefs(scored, free)
    baseline = scored[NONE].rows.predicted
    metric = metric_of(problem.seen, baseline)
    fold = folding(problem, list(scored.values()), metric, raw)
    belief = fold.fold(raw)
    parts = confusion([scored[h] for h in belief if h != UNKNOWN], metric, belief)
    fits = {
        h: p_value(problem, scored[h]) for h, p in belief.items() if h != UNKNOWN and p > PLAUSIBLE
    }
    verdict = decide(belief, parts, fits)
    standing = Standing(bench, problem.seen, scored, free, belief, effects)
    gaps = _gaps(standing, metric)
    return Diagnosis(
        bench=bench,
        verdict=verdict,
        belief=belief,
        raw=raw,
        scored=scored,
        confusion=parts,
        fits=fits,
        before_after=gaps[0][1],
        rival=gaps[1] if len(gaps) > 1 else None,
        hidden=invisible(list(scored.values()), metric),
        bounds=bounds(list(scored.values()), metric),
        other=_others(problem, bench, scored, free, fold),
        tests=choose(standing),
        baseline=baseline,
        metric=metric,
        effects=effects,
        foretold=foretold(standing, next(iter(belief))),
    )


def _all_scored(
    problem: Problem,
    bench: Bench,
    effects: Mapping[str, Effect],
    pairs: Sequence[Hypothesis] | None,
) -> dict[Hypothesis, Scored]:
    """Return evidences, single effects first, so that hopeless pairs are left early."""
    found: dict[Hypothesis, Scored] = {}
    best = -np.inf
    for space in spaces_of(effects, setting_of(bench), pairs):
        found[space.hypothesis] = evidence(problem, space, best)
        best = max(best, found[space.hypothesis].log_evidence)
    return found


def _beliefs(scored: Mapping[Hypothesis, Scored], free: Unknown) -> Probabilities:
    logs = {h: one.log_evidence for h, one in scored.items()}
    return probabilities({**logs, UNKNOWN: free.log_evidence})


def _others(
    problem: Problem,
    bench: Bench,
    scored: Mapping[Hypothesis, Scored],
    free: Unknown,
    fold: Folding,
) -> dict[str, Probabilities]:
    """Return the probabilities given each fact, under other priors, and with unknown as failed."""
    found = {}
    for fact in facts_of(bench):
        agreed = {h: one.log_evidence + log_agreement(one, fact) for h, one in scored.items()}
        nothing = float(fact.log_density(np.array([fact.neutral]))[0])
        agreed[UNKNOWN] = free.log_evidence + nothing
        found[f"given_{fact.parameter}"] = fold.fold(probabilities(agreed))
    for key, factor in (("priors_halved", 0.5), ("priors_doubled", 2.0)):
        changed = {h: with_width(one, factor) for h, one in scored.items()}
        found[key] = fold.fold(_beliefs(changed, free))
    if problem.seen.unknown.any():
        failed = {h: one.read_as_failed() for h, one in scored.items()}
        logs = {h: one.log_evidence for h, one in failed.items()}
        logs[UNKNOWN] = free.log_evidence_as_failed
        found["unknown_as_failed"] = fold.fold(probabilities(logs))
    return found


def _gaps(standing: Standing, metric: Metric) -> list[tuple[Hypothesis, HeldOut]]:
    """Return held-out gaps of the leading hypothesis and its best rival."""
    leading = next(iter(standing.belief))
    rivals = [h for h in standing.belief if h not in (leading, UNKNOWN, NONE)][:1]
    bench, seen, baseline = standing.bench, standing.seen, standing.scored[NONE].rows.predicted
    found = []
    for hypothesis in [leading, *rivals]:
        if hypothesis == UNKNOWN:
            predict = by_unknown(standing.unknown)
        else:
            predict = by_effects(standing.scored[hypothesis])
        found.append((hypothesis, held_out(bench, seen, baseline, metric, predict)))
    return found
