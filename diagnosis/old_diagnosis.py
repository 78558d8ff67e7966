"""Diagnosis of a data set: cause of the gap with its probability, and the next test."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from dogshape.diagnosis.bench.bench_data import Bench
from dogshape.diagnosis.bench.comparison import PointGap
from dogshape.diagnosis.bench.input_errors import Propagated
from dogshape.diagnosis.inference.classes import (
    Confusion,
    confusable,
    confusion,
    invisible,
    structured,
)
from dogshape.diagnosis.inference.equivalence import Equivalence, equivalence
from dogshape.diagnosis.inference.further_shifts import MeanPrediction
from dogshape.diagnosis.inference.held_out import HeldOut, by_effects, held_out
from dogshape.diagnosis.inference.influence import Influence, influence
from dogshape.diagnosis.inference.next_test import (
    NextTest,
    Standing,
    choose,
    mean_prediction,
    why,
)
from dogshape.diagnosis.inference.parameter_intervals import Bound, Interval, bounds, intervals
from dogshape.diagnosis.inference.posterior import Probabilities, inclusion, noise
from dogshape.diagnosis.inference.predicted_means import PredictedMeans, predicted_means
from dogshape.diagnosis.inference.prior_sensitivity import readings
from dogshape.diagnosis.inference.range_ends import RangeEnd, diagnosed_wider
from dogshape.diagnosis.inference.ranking import Ranking, rank
from dogshape.diagnosis.inference.sense_posterior import SenseAnswer, sense_answers
from dogshape.diagnosis.inference.series_drift import SeriesDrift, series_drift
from dogshape.diagnosis.inference.static_readings import read_directly, readings_in_words
from dogshape.diagnosis.inference.verdict import Verdict, decide
from dogshape.diagnosis.likelihood.observations import observe
from dogshape.diagnosis.likelihood.scores import PredictionSummary, Problem, Scored
from dogshape.diagnosis.likelihood.signature import Metric
from dogshape.diagnosis.prediction.hypotheses import NONE, UNKNOWN, plain
from dogshape.diagnosis.prediction.levels import Level
from dogshape.diagnosis.prediction.prediction import Emulator
from dogshape.diagnosis.report.influence_words import influence_in_words
from dogshape.diagnosis.report.wording import Found, headline, in_words
from dogshape.diagnosis.settings import USUAL, Settings
from dogshape.diagnosis.terms import Hypothesis
from dogshape.sim.effect import Effect
from dogshape.sim.units import RPM

Record = dict[str, Any]  #: gap.json


@dataclass(frozen=True)
class Diagnosis:
    """Result of a diagnosis; carries the data set.

    Parameters
    ----------
    posterior : probability of each hypothesis, the largest first, weak effects counted as none and
        what cannot have made the data as unknown.
    raw : before that.
    scored : every hypothesis but unknown with its evidence.
    leading : the most probable of these; where nothing known fits, the nearest.
    fits : predictive p-values of plausible hypotheses.
    before_after, rival : held-out gaps of the leading hypothesis, and of the best other one.
    hidden : for each effect, the share of its prior that the data cannot tell from none.
    bounds : what each effect is at most.
    other : probabilities with priors half and twice as wide, and with unknown shifts failed.
    tests : the menu, best first.
    mean_prediction : mean times that the leading hypothesis predicts.
    noise : Monte Carlo standard error of the leading probability.
    senses : the answers given either sense of rotation, none where it is known.
    equivalence : the gap beside its margin; None where the baseline has no times.
    drift : trend over the series; None where the order of the shifts is not known.
    influence : what each operating point does to the answer; None for a single one.
    inputs : what errors of nominal force and mismatch make; None where the data set states none.
    ``foretold`` : means that the leading hypothesis, its best rival and none predict of each
        operating point from the others; none for a single one.
    settings : with which all this was decided.
    together : levels at which effects were simulated together for this diagnosis.
    range_ends : where sizes lay at an end of their range, and what was done about it.
    """

    bench: Bench
    verdict: Verdict
    posterior: Probabilities
    raw: Probabilities
    scored: Mapping[Hypothesis, Scored]
    leading: Hypothesis
    confusion: Confusion
    fits: Mapping[Hypothesis, float]
    before_after: HeldOut
    rival: tuple[Hypothesis, HeldOut] | None
    hidden: Mapping[str, float]
    bounds: Mapping[str, Bound]
    other: Mapping[str, Probabilities]
    tests: tuple[NextTest, ...]
    baseline: PredictionSummary
    metric: Metric
    effects: Mapping[str, Effect]
    mean_prediction: MeanPrediction
    noise: float
    senses: tuple[SenseAnswer, ...] = ()
    equivalence: Equivalence | None = None
    drift: SeriesDrift | None = None
    influence: Influence | None = None
    inputs: Propagated | None = None
    foretold: tuple[PredictedMeans, ...] = ()
    settings: Settings = USUAL
    together: tuple[Level, ...] = ()
    range_ends: tuple[RangeEnd, ...] = ()

    def as_dict(self) -> Record:
        """Write the record of the contract, with more."""
        from_rival = self.rival[1] if self.rival else None
        told = {"drift": self.drift, "nominal_errors": self.inputs}
        more = {key: part.as_dict() for key, part in told.items() if part is not None}
        aliases = {name: effect.aliases for name, effect in self.effects.items()}
        return {
            "bench": self.bench.name,
            "engine": self.bench.clutch.solver.engine,
            "verdict": self.verdict.kind,
            "causes": list(self.verdict.causes),
            "noise": self.noise,
            "headline": headline(self.found),
            "summary": in_words(self.found),
            "hypotheses": [self._hypothesis(h) for h in self.posterior],
            "confusable": confusable(self.confusion, aliases),
            "classes": structured(self.confusion),
            "gap": {
                "hypothesis": list(self.leading),
                "baseline_rmse_s": self.before_after.baseline,
                "heldout_rmse_s": self.before_after.held_out,
                "floor_rmse_s": self.before_after.floor,
                "leading_floor_rmse_s": self.chance,
                "shrink": self.before_after.shrink,
                "rival": list(self.rival[0]) if self.rival else None,
                "rival_heldout_rmse_s": from_rival.held_out if from_rival else None,
                "rival_shrink": from_rival.shrink if from_rival else None,
            },
            "margin_s": self.equivalence.margin_rms if self.equivalence else None,
            "discrepancy": self.equivalence.as_dict() if self.equivalence else None,
            **more,
            "where": [
                {
                    "mismatch_rpm": one.cell.point.mismatch / RPM,
                    "force_N": one.cell.point.profile.force,
                    "gap_s": one.gap,
                    "z": one.z,
                }
                for one in self.gaps
            ],
            "influence": self._influence(),
            "foretold": [one.as_dict(self._points) for one in self.foretold],
            "next_test": {
                **self.tests[0].as_dict(),
                "why": why(self.tests[0], self.posterior, self.effects),
            },
            "tests": [
                {
                    "name": t.name,
                    "information_nats": t.information,
                    "chance_to_settle": t.settles if t.information is not None else None,
                    "misleads": t.misleads if t.information is not None else None,
                    "hours": t.hours,
                }
                for t in self.tests[:8]
            ],
            "inclusion": inclusion(self.posterior),
            "senses": [one.as_dict(self.intervals) for one in self.senses],
            "credible_set": [list(h) for h in self.verdict.credible],
            "class_probability": self.verdict.group_probability,
            "no_information": [
                n for n, share in self.hidden.items() if share > self.settings.decision.blind
            ],
            "hidden_share": dict(self.hidden),
            "bounds": {name: bound.as_dict() for name, bound in self.bounds.items()},
            "facts": [
                {
                    "effect": fact.effect,
                    "parameter": fact.parameter,
                    "value": fact.value,
                    "low": fact.low,
                    "high": fact.high,
                    "sentence": sentence,
                }
                for fact, sentence in readings_in_words(self.bench, self.effects, self.scored)
            ],
            "sensitivity": {
                key: [
                    {"effects": list(h), "probability": p} for h, p in list(posterior.items())[:5]
                ]
                for key, posterior in self.other.items()
            },
            "together": [
                {"effects": list(h), "levels": sum(k.hypothesis == h for k in self.together)}
                for h in dict.fromkeys(level.hypothesis for level in self.together)
            ],
            "range_ends": [one.as_dict() for one in self.range_ends],
            "settings": self.settings.as_dict(),
        }

    @property
    def gaps(self) -> tuple[PointGap, ...]:
        """Gap at each operating point without any effect, with the error of the data."""
        means = [float(m) if np.isfinite(m) else None for m in self.baseline.mean[0]]
        errors = self.metric.mean.tolist()
        cells = zip(self.bench.cells, means, errors, strict=True)
        return tuple(PointGap(cell, mean, error) for cell, mean, error in cells)

    @property
    def chance(self) -> float | None:
        """Gap that scatter and errors alone would leave under the leading hypothesis, rms, s."""
        counts = np.array([cell.n for cell in self.bench.cells], dtype=float)
        having = np.array([cell.time is not None for cell in self.bench.cells])
        squares = self.mean_prediction.variance + self.mean_prediction.single / np.maximum(
            1.0, counts
        )
        those = squares[having & np.isfinite(squares)]
        return float(np.sqrt(those.mean())) if those.size else None

    @property
    def found(self) -> Found:
        """Facts for the sentences."""
        gaps, test = self.before_after, self.tests[0]
        return Found(
            self.verdict,
            self.posterior,
            self.intervals,
            gaps,
            test,
            self.effects,
            self.leading,
            self.chance,
            sees_nothing(self.hidden, self.settings.decision.blind),
            self.senses,
            self.equivalence,
            self.range_ends,
            self.drift,
            self.inputs,
        )

    @property
    def intervals(self) -> Mapping[Hypothesis, Mapping[str, Interval]]:
        """Parameters of each hypothesis with 90 % intervals."""
        return {h: intervals(one) for h, one in self.scored.items()}

    def _influence(self) -> Record | None:
        if self.influence is None:
            return None
        said = influence_in_words(self.influence, self._points, self.effects)
        return {"sentence": said, **self.influence.as_dict(self._points)}

    @property
    def _points(self) -> list[tuple[float, float]]:
        """Mismatch in 1/min and force in N of all cells."""
        return [(c.point.mismatch / RPM, c.point.profile.force) for c in self.bench.cells]

    def _hypothesis(self, hypothesis: Hypothesis) -> Record:
        found = self.scored.get(hypothesis)
        record: Record = {
            "effects": list(hypothesis),
            "title": plain(hypothesis, self.effects),
            "probability": self.posterior[hypothesis],
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


@dataclass(frozen=True)
class Ranked:
    """Hypotheses of a data set in their ranking, before anything is concluded from it.

    That is all that decides whether ranges are widened; what else an answer says takes a third of
    its time.
    """

    bench: Bench
    effects: Mapping[str, Effect]
    ranking: Ranking

    def concluded(self) -> Diagnosis:
        """Conclude from the ranking: verdict, next test, and what the answer rests on."""
        return _concluded(self.bench, self.effects, self.ranking)


def ranked(
    bench: Bench,
    emulator: Emulator,
    effects: Mapping[str, Effect],
    *,
    pairs: Sequence[Hypothesis] | None = None,
    settings: Settings = USUAL,
) -> Ranked:
    """Rank the hypotheses on a data set by an emulator; parameters are those of ``diagnose``."""
    seen = observe(bench, settings.likelihood)
    problem = Problem(seen, emulator, settings, bench.mismatch_sense, bench)
    return Ranked(bench, effects, rank(problem, bench, effects, pairs))


def diagnose(
    bench: Bench,
    emulator: Emulator,
    effects: Mapping[str, Effect],
    *,
    pairs: Sequence[Hypothesis] | None = None,
    settings: Settings = USUAL,
) -> Diagnosis:
    """Diagnose a data set by an emulator.

    Parameters
    ----------
    emulator : says what hypotheses predict at the data set's operating points.
    effects : that are considered, by name.
    pairs : of them, all by default.
    settings : probabilities before the data, errors of the simulation, and limits of the answer.
    """
    return ranked(bench, emulator, effects, pairs=pairs, settings=settings).concluded()


def _concluded(bench: Bench, effects: Mapping[str, Effect], ranking: Ranking) -> Diagnosis:
    """Conclude from a ranking."""
    problem, settings = ranking.problem, ranking.problem.settings
    posterior, scored, metric = ranking.posterior, ranking.scored, ranking.metric
    known = [scored[h] for h in ranking.folded if h != UNKNOWN]
    plain = scored[NONE].rows.predicted
    limits = settings.decision
    parts = confusion(known, metric, ranking.folded, plain, limits)
    standing = Standing(
        bench,
        problem.seen,
        scored,
        ranking.free,
        posterior,
        effects,
        ranking.leading,
        parts,
        problem.emulator,
        settings,
    )
    gaps = _gaps(standing, ranking)
    hidden = invisible(list(scored.values()), metric, limits.visible)
    same = equivalence(problem, scored, ranking.raw, posterior.get(UNKNOWN, 0.0), bench.margin)
    measured = read_directly(bench, effects)

    def settle(those: Probabilities, fits: Mapping[Hypothesis, float], within: float) -> Verdict:
        found = decide(those, parts, fits, within, measured, limits=limits)
        blind = found.kind == "none" and sees_nothing(hidden, limits.blind)
        return replace(found, kind="ambiguous") if blind else found

    verdict = settle(posterior, ranking.fits, same.probability if same else 0.0)
    swayed = influence(problem, ranking, settle, verdict, same)
    compared = (ranking.leading, swayed.rival, NONE) if swayed else ()
    return Diagnosis(
        bench=bench,
        verdict=verdict,
        posterior=posterior,
        raw=ranking.raw,
        scored=scored,
        leading=ranking.leading,
        confusion=parts,
        fits=ranking.fits,
        before_after=gaps[0][1],
        rival=gaps[1] if len(gaps) > 1 else None,
        hidden=hidden,
        bounds=bounds(list(scored.values()), metric, limits.visible),
        other=readings(problem, bench, ranking, effects),
        tests=choose(standing),
        baseline=plain,
        metric=metric,
        effects=effects,
        mean_prediction=mean_prediction(standing, ranking.leading),
        noise=noise(next(iter(posterior)), ranking.raw, ranking.fold, scored),
        senses=sense_answers(problem, ranking),
        equivalence=same,
        drift=series_drift(problem, ranking),
        inputs=problem.seen.inputs.propagated(problem.baseline) if problem.seen.inputs else None,
        influence=swayed,
        together=ranking.together,
        foretold=tuple(
            predicted_means(problem, scored[h]) for h in dict.fromkeys(compared) if h in scored
        ),
        settings=settings,
    )


def diagnose_wider(
    once: Callable[[Mapping[str, Effect]], Ranked],
    effects: Mapping[str, Effect],
    settings: Settings = USUAL,
) -> Diagnosis:
    """Rank by ``once``, again with wider ranges where sizes lie at the end of theirs, and conclude.

    ``once`` takes effects with the ranges of their priors; ``settings`` say how often and how
    far those are widened (``diagnosis.inference.range_ends``). Only the last ranking is concluded.
    """
    found, ends = diagnosed_wider(
        once, lambda one: (one.ranking.leading, one.ranking.scored), effects, settings
    )
    return replace(found.concluded(), range_ends=ends)


def sees_nothing(hidden: Mapping[str, float], least: float = USUAL.decision.blind) -> bool:
    """Test that data can show no effect, not even at the far end of its prior.

    ``hidden`` has the share of each prior that they cannot tell from none. That nothing is
    seen in such data is no evidence that nothing is there.
    """
    return all(share > least for share in hidden.values())


def _gaps(standing: Standing, ranking: Ranking) -> list[tuple[Hypothesis, HeldOut]]:
    """Return held-out gaps of the leading hypothesis and its best rival."""
    leading = ranking.leading
    rivals = [h for h in ranking.folded if h not in (leading, UNKNOWN, NONE)][:1]
    bench, seen, baseline = standing.bench, standing.seen, standing.scored[NONE].rows.predicted
    return [
        (h, held_out(bench, seen, baseline, ranking.metric, by_effects(standing.scored[h])))
        for h in [leading, *rivals]
    ]
