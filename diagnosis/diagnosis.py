"""Diagnosis of a data set: cause of the gap with its probability, and the next test."""

from __future__ import annotations

import itertools
import time
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from scipy.special import logsumexp

from dogshape.bench.bench_data import Bench
from dogshape.bench.stand_file import EmptyCells
from dogshape.diagnosis.comparison import PointGap
from dogshape.diagnosis.gap_map import describe_gaps
from dogshape.diagnosis.inference.fit import (
    Fit,
    HeldOut,
    Interval,
    fit,
    predict_held_out,
    root_mean_square,
)
from dogshape.diagnosis.inference.outcome import NextTest
from dogshape.diagnosis.inference.ranking import HypothesisSearch, Ranking, rank
from dogshape.diagnosis.inference.static_readings import (
    Fact,
    facts_of,
    log_density,
    log_unknown,
    measured_facts,
)
from dogshape.diagnosis.inference.verdict import (
    CauseVerdict,
    NoneEvidence,
    Probabilities,
    decide,
    excluded_share,
    fold_invisible,
    inclusion,
    invisible_shares,
    margin_probability,
)
from dogshape.diagnosis.likelihood.likelihood import Likelihood
from dogshape.diagnosis.likelihood.observed import Observations, observe
from dogshape.diagnosis.prediction.contacts import Contacts
from dogshape.diagnosis.prediction.flights import Flights, log_flights
from dogshape.diagnosis.prediction.flights import log_unknown as log_unknown_flights
from dogshape.diagnosis.prediction.model import Model
from dogshape.diagnosis.range_ends import RangeEnd, find_end
from dogshape.diagnosis.settings import USUAL, Settings
from dogshape.diagnosis.terms import (
    DELAY,
    NONE,
    REVERSED,
    UNKNOWN,
    Array,
    Hypothesis,
    strip_sense,
)
from dogshape.sim import effects as registry
from dogshape.sim.effect import Effect
from dogshape.sim.units import RPM

Record = dict[str, Any]  #: gap.json
MIN_FITTED_PROBABILITY = 1e-3  #: from which a hypothesis is fitted
MIN_LISTED_PROBABILITY = 0.05  #: of an effect whose size is compared with its range
STEP_DRAWS = 64  #: draws of the leading hypothesis from which the steps of the gap are predicted
LISTED_TESTS = 8  #: best tests in table and ``gap.json``
MIN_GAP_BEYOND_CHANCE_S = 1e-6  #: s, to divide by


@dataclass(frozen=True)
class RecordMeaning:
    """Answer if a key of the record has a value that nobody noted, and its probability."""

    key: str
    value: str
    prior: float  #: probability without the data
    probability: float
    verdict: CauseVerdict
    posterior: Mapping[Hypothesis, float]


class GapStep(NamedTuple):
    """Gap that is left with an effect of the leading hypothesis added to those before it."""

    effect: str
    rmse: float  #: root mean square over the operating points, s


def list_tests(tests: Sequence[NextTest], leading: Hypothesis) -> list[NextTest]:
    """List the best tests, and the direct tests of the effects of the leading hypothesis."""
    listed = [*tests[:LISTED_TESTS]]
    for test in tests[LISTED_TESTS:]:
        if test.kind == "direct" and {*leading}.intersection(test.effects):
            listed.append(test)
    return listed


@dataclass(frozen=True)
class Inference:
    """Result of a diagnosis, with its data set."""

    bench: Bench
    effects: Mapping[str, Effect]
    settings: Settings
    likelihood: Likelihood
    posterior: Mapping[Hypothesis, float]  #: the largest first, without invisible effects
    evidence: Mapping[Hypothesis, float]  #: the same with invisible effects
    fits: Mapping[Hypothesis, Fit]  #: of none, and of every plausible known hypothesis
    verdict: CauseVerdict
    within_margin: float  #: probability that the gap is below the margin
    held_out: HeldOut
    record_meanings: tuple[RecordMeaning, ...]  #: of keys of the record that nobody noted
    facts: tuple[Fact, ...]
    flights: Flights
    seconds: float  #: processor time
    tests: tuple[NextTest, ...] = ()

    @property
    def model(self) -> Model:
        """Predictions for the data set."""
        return self.likelihood.model

    @property
    def observed(self) -> Observations:
        """Observations that the likelihood counts."""
        return self.likelihood.observed

    @property
    def inclusion(self) -> dict[str, float]:
        """Probability of each effect to be part of the cause, the largest first."""
        return inclusion(self.posterior)

    @property
    def leading(self) -> Hypothesis:
        """The most probable known hypothesis."""
        return next(h for h in self.posterior if h in self.fits)

    @property
    def leading_error(self) -> float:
        """Standard error of the leading probability by the errors of all evidences."""
        return self._probability_error({self.leading}, self.posterior[self.leading])

    @property
    def inclusion_error(self) -> dict[str, float]:
        """Standard error of each effect's probability by the errors of all evidences."""
        return {
            name: self._probability_error({h for h in self.fits if name in h}, p)
            for name, p in self.inclusion.items()
        }

    def _probability_error(self, members: Collection[Hypothesis], probability: float) -> float:
        """Propagate independent errors of log evidences to the probability of some hypotheses."""
        errors = [
            self.posterior.get(h, 0.0) * ((h in members) - probability) * fitted.error
            for h, fitted in self.fits.items()
        ]
        return float(np.sqrt(np.square(errors).sum()))

    @property
    def margin_s(self) -> float:
        """Gap below which nothing needs doing, root mean square, s."""
        limit = self.bench.margin.of(self.baseline)[self.likelihood.measured_points]
        return float(np.sqrt((limit**2).mean()))

    @cached_property
    def baseline(self) -> Array:
        """Mean time of each operating point without any effect, late shifts too, s, (C,)."""
        return self.likelihood.mean_with_late(self.fits[NONE].predicted.select([0]))[0]

    @cached_property
    def gaps(self) -> tuple[PointGap, ...]:
        """Gap at each operating point without any effect, with the error of data and simulation."""
        p = self.fits[NONE].predicted.select([0])
        scatter = p.sd[0] ** 2 / np.maximum(1.0, self.observed.count)
        error = np.sqrt(scatter + self.likelihood.mean_variance(p)[0])
        points = zip(self.bench.cells, self.baseline.tolist(), error.tolist(), strict=True)
        return tuple(itertools.starmap(PointGap, points))

    @cached_property
    def where(self) -> str:
        """Sentence on the operating points at which the bench differs."""
        return describe_gaps(self.gaps)

    @cached_property
    def _size_draws(self) -> dict[str, Array]:
        """Draws of the parameters of each effect over all plausible hypotheses, (n, p) each."""
        all_draws: dict[str, Array] = {}
        for name, effect in self.effects.items():
            members = [h for h in self.posterior if name in h and h in self.fits]
            probability = sum(self.posterior[h] for h in members)
            if probability < MIN_FITTED_PROBABILITY:
                continue
            draws = []
            for h in members:
                fitted = self.fits[h]
                draw_count = len(fitted.shares)
                count = int(np.ceil(self.posterior[h] / probability * draw_count))
                rows = np.linspace(0, draw_count - 1, count).astype(int)
                columns = fitted.space.columns(name) if effect.parameters else slice(0)
                draws.append(fitted.values[rows][:, columns])
            all_draws[name] = np.vstack(draws)
        return all_draws

    @cached_property
    def sizes(self) -> dict[str, dict[str, Interval]]:
        """Sizes of each effect over all plausible hypotheses that have it."""
        sizes: dict[str, dict[str, Interval]] = {}
        for name, draws in self._size_draws.items():
            columns_of = zip(self.effects[name].parameters, draws.T, strict=True)
            sizes[name] = {parameter.name: Interval.of(column) for parameter, column in columns_of}
        return sizes

    @cached_property
    def range_ends(self) -> tuple[RangeEnd, ...]:
        """Sizes of plausible effects that lie at an end of the range of their parameter."""
        range_ends = []
        for name, draws in self._size_draws.items():
            if self.inclusion.get(name, 0.0) < MIN_LISTED_PROBABILITY:
                continue
            neutral = self.effects[name].neutral(self.model.setting)
            for parameter, column in zip(self.effects[name].parameters, draws.T, strict=True):
                end = find_end(parameter, column, neutral[parameter.name], self.settings)
                if end is not None:
                    value = parameter.low if end == "low" else parameter.high
                    range_ends.append(RangeEnd(name, parameter.name, end, value))
        return tuple(range_ends)

    @cached_property
    def contact(self) -> dict[str, Interval]:
        """Factors on the stated contact, by nuisance, under the leading hypothesis."""
        deviates = self.fits[self.leading].deviates
        factors = self.settings.nuisance
        return {
            name: Interval.of(factors[name] ** column)
            for name, column in zip(self.model.nuisances, deviates.T, strict=True)
        }

    @cached_property
    def odd_contact(self) -> tuple[str, ...]:
        """Names of the contact's properties that lie beyond what is known of them."""
        is_beyond = abs(self.fits[self.leading].deviates) > self.settings.odd_contact
        is_odd = is_beyond.mean(axis=0) > self.settings.part
        return tuple(itertools.compress(self.model.nuisances, is_odd))

    @cached_property
    def gap_steps(self) -> tuple[GapStep, ...]:
        """Gaps left by the effects of the leading hypothesis, one more each; the largest first."""
        steps = list[GapStep]()
        names = [*self.leading]
        while names:
            added = [step.effect for step in steps]
            candidates = [GapStep(name, self._partial_gap([*added, name])) for name in names]
            best = min(candidates, key=lambda step: step.rmse)
            steps.append(best)
            names.remove(best.effect)
        return tuple(steps)

    def _partial_gap(self, names: Sequence[str]) -> float:
        """Compute the root-mean-square gap that effects of the leading hypothesis leave, s."""
        fitted = self.fits[self.leading]
        hypothesis = tuple(sorted(names))
        rows = np.linspace(0, len(fitted.shares) - 1, STEP_DRAWS).astype(int)
        columns = [np.zeros((STEP_DRAWS, 0))]
        for name in strip_sense(hypothesis):
            columns.append(fitted.shares[rows][:, fitted.space.columns(name)])
        predicted = self.model.predict(hypothesis, np.hstack(columns))
        mean = self.likelihood.mean_with_late(predicted).mean(axis=0)
        times = np.array([cell.time for cell in self.bench.cells], dtype=float)
        return root_mean_square(times - mean)

    def to_dict(self) -> Record:
        """Write ``gap.json``."""
        amplitude = Interval.of(self.fits[self.leading].amplitude)
        return {
            "bench": self.bench.name,
            "engine": self.bench.clutch.solver.engine,
            "verdict": self.verdict.kind,
            "causes": list(self.verdict.causes),
            "noise": self.leading_error,
            "hypotheses": [self._hypothesis_record(h) for h in self.posterior],
            "confusable": self._confusable_names(),
            "inclusion": self.inclusion,
            "inclusion_error": self.inclusion_error,
            "sizes": {name: _interval_records(sizes) for name, sizes in self.sizes.items()},
            "at_range_end": [range_end.to_dict() for range_end in self.range_ends],
            "contact": {
                name: {"factor": asdict(factor), "odd": name in self.odd_contact}
                for name, factor in self.contact.items()
            },
            "gap": self._gap_record(),
            "margin_s": self.margin_s,
            "within_margin": self.within_margin,
            "discrepancy": {"amplitude": asdict(amplitude)},
            "where_sentence": self.where,
            "where": [
                {
                    "mismatch_rpm": gap.cell.point.mismatch / RPM,
                    "force_N": gap.cell.point.profile.force,
                    "gap_s": gap.gap,
                    "standard_error_s": None if gap.gap is None else gap.standard_error,
                    "z": gap.z,
                }
                for gap in self.gaps
            ],
            "record": self.bench.record.model_dump(),
            "readings": [
                {
                    "key": meaning.key,
                    "value": meaning.value,
                    "prior": meaning.prior,
                    "probability": meaning.probability,
                    "verdict": meaning.verdict.kind,
                    "causes": list(meaning.verdict.causes),
                }
                for meaning in self.record_meanings
            ],
            "next_test": self.tests[0].to_dict() if self.tests else None,
            "tests": [test.to_dict() for test in list_tests(self.tests, self.leading)],
            "facts": [fact.to_dict() for fact in self.facts],
            "drift": None if self.observed.drift is None else self.observed.drift.to_dict(),
            "credible_set": [list(h) for h in self.verdict.credible],
            "seconds": self.seconds,
            "settings": asdict(self.settings),
        }

    def _confusable_names(self) -> list[list[str]]:
        """List each credible effect with the effects that data of shifts cannot part from it."""
        credible = set(itertools.chain.from_iterable(self.verdict.credible))
        names = sorted(credible & self.effects.keys())
        groups = [[name, *self.effects[name].aliases] for name in names]
        return [group for group in groups if len(group) > 1]

    def _gap_record(self) -> Record:
        """Write the gap without effects and at held-out points."""
        gaps = self.held_out
        beyond_chance = max(gaps.baseline - gaps.chance, MIN_GAP_BEYOND_CHANCE_S)
        shrink = 1.0 - (gaps.held_out - gaps.chance) / beyond_chance
        return {
            "hypothesis": list(self.leading),
            "baseline_rmse_s": gaps.baseline,
            "heldout_rmse_s": gaps.held_out,
            "floor_rmse_s": gaps.chance,
            "shrink": float(np.clip(shrink, -1.0, 1.0)),
            "rival": None if gaps.rival is None else list(gaps.rival),
            "rival_heldout_rmse_s": gaps.rival_held_out,
            "steps": [{"effect": step.effect, "rmse_s": step.rmse} for step in self.gap_steps],
        }

    def _hypothesis_record(self, h: Hypothesis) -> Record:
        """Write a hypothesis with its probability, and its fit if it has one."""
        record = {
            "effects": list(h),
            "probability": self.posterior[h],
            "evidence_probability": self.evidence[h],
            "parameters": {},
        }
        if h in self.fits:
            fitted = self.fits[h]
            record |= {
                "parameters": _interval_records(fitted.intervals),
                "log_evidence": fitted.log_evidence,
                "log_evidence_error": fitted.error,
                "predictive_p": fitted.p,
                "checks": dict(fitted.checks),
            }
        return record


def _interval_records(intervals: Mapping[str, Interval]) -> Record:
    """Write intervals by the names of their parameters."""
    return {name: asdict(interval) for name, interval in intervals.items()}


def diagnose(bench: Bench, models: Mapping[str, Model], settings: Settings = USUAL) -> Inference:
    """Diagnose a data set by the models of each place where displacement may be read."""
    begin = time.process_time()
    has_empty_rows = any(cell.unknown for cell in bench.cells)
    meanings: tuple[EmptyCells, ...] = ("not_made", "failed") if has_empty_rows else ("unknown",)
    readings = [_Reading(place, empty) for place in models for empty in meanings]
    searches = [_search_of(bench, models[r.place], r, settings) for r in readings]
    answers_by_ranking = []
    for reading, ranking in zip(readings, rank(searches), strict=True):
        answers_by_ranking.append(_answers_of(bench, reading, ranking))
    all_answers = list(itertools.chain.from_iterable(answers_by_ranking))
    evidence = _mix_answers(all_answers, settings)
    fitted = [_fit_ranking(answers, evidence) for answers in answers_by_ranking]
    conclusion = _conclude(fitted, settings)
    likelihood = conclusion.best.likelihood
    fits = conclusion.best.fits
    leading, *runners_up = [h for h in conclusion.posterior if h in fits]
    rival = next((fits[h] for h in runners_up if h != NONE), None)
    baseline = likelihood.mean_with_late(fits[NONE].predicted.select([0]))[0]
    times = np.array([cell.time for cell in bench.cells], dtype=float)
    effects = dict(likelihood.model.effects)
    if likelihood.model.reversed_model is not None:
        effects[REVERSED] = registry.load()[REVERSED]
    return Inference(
        bench=bench,
        effects=dict(sorted(effects.items())),
        settings=settings,
        likelihood=likelihood,
        posterior=conclusion.posterior,
        evidence=evidence,
        fits=fits,
        verdict=conclusion.verdict,
        within_margin=conclusion.within_margin,
        held_out=predict_held_out(likelihood, fits[leading], rival, times - baseline),
        record_meanings=_record_meanings(fitted, conclusion, settings),
        facts=(
            *facts_of(bench, settings.static_error),
            *measured_facts(bench, likelihood.model.effects),
        ),
        flights=Flights(likelihood.model.effects, likelihood.model.settings, settings),
        seconds=time.process_time() - begin,
    )


@dataclass(frozen=True)
class _Answer:
    """Log of prior times evidence of each hypothesis, under one meaning of the record."""

    record: Mapping[str, str]
    ranking: Ranking
    log_priors: Mapping[Hypothesis, float]
    logs: Mapping[Hypothesis, float]
    log_total: float  #: of all hypotheses together


@dataclass(frozen=True)
class _FittedRanking:
    """Answers by one ranking and its fits."""

    answers: Sequence[_Answer]
    likelihood: Likelihood
    fits: Mapping[Hypothesis, Fit]
    invisible_shares: Mapping[Hypothesis, Probabilities]  #: of each that smaller ones predict
    margin_probabilities: Mapping[Hypothesis, float]  #: that the gap is below the margin


@dataclass(frozen=True)
class _Conclusion:
    """Answer over meanings of the record, with the ranking of the most probable one."""

    best: _FittedRanking
    log_total: float  #: of prior times evidence
    posterior: Probabilities
    within_margin: float
    verdict: CauseVerdict


def _fit_ranking(answers: Sequence[_Answer], evidence: Probabilities) -> _FittedRanking:
    """Fit none and all plausible hypotheses of a ranking."""
    ranking = answers[0].ranking
    likelihood = ranking.likelihood
    flights = Flights(likelihood.model.effects, likelihood.model.settings, likelihood.settings)
    hypotheses = [NONE]
    for h, probability in evidence.items():
        if probability > MIN_FITTED_PROBABILITY and h in ranking.samples and h != NONE:
            hypotheses.append(h)
    fits = {
        h: fit(likelihood, ranking.samples[h], flights, ranking.emulation_error[h])
        for h in hypotheses
    }
    return _FittedRanking(
        answers=answers,
        likelihood=likelihood,
        fits=fits,
        invisible_shares={
            h: invisible_shares(ranking, fitted, evidence)
            for h, fitted in fits.items()
            if strip_sense(h)
        },
        margin_probabilities={h: margin_probability(likelihood, f) for h, f in fits.items()},
    )


def _record_meanings(
    fitted: Sequence[_FittedRanking], conclusion: _Conclusion, settings: Settings
) -> tuple[RecordMeaning, ...]:
    """List the answers by each value that a key of the record may have."""
    answers = [answer for ranking in fitted for answer in ranking.answers]
    items = dict.fromkeys(item for answer in answers for item in answer.record.items())
    keys = [key for key, _ in items]
    log_priors = [float(logsumexp(list(answer.log_priors.values()))) for answer in answers]
    meanings = []
    for key, value in items:
        answer = _conclude(fitted, settings, (key, value))
        probability = float(np.exp(answer.log_total - conclusion.log_total))
        floor = settings.floor * (1.0 / keys.count(key))
        probability = (1.0 - settings.floor) * probability + floor
        members = [
            log_prior
            for log_prior, other in zip(log_priors, answers, strict=True)
            if (key, value) in other.record.items()
        ]
        meaning = RecordMeaning(
            key=key,
            value=value,
            prior=float(np.exp(logsumexp(members) - logsumexp(log_priors))),
            probability=probability,
            verdict=answer.verdict,
            posterior=answer.posterior,
        )
        meanings.append(meaning)
    return tuple(meanings)


def _conclude(
    fitted: Sequence[_FittedRanking], settings: Settings, item: tuple[str, str] | None = None
) -> _Conclusion:
    """Decide over all meanings of the record, or those with one item."""
    pairs = []
    for ranking in fitted:
        answers = ranking.answers
        if item is not None:
            answers = [answer for answer in answers if item in answer.record.items()]
        if answers:
            pairs.append((ranking, answers))
    logs = [logsumexp([answer.log_total for answer in answers]) for _, answers in pairs]
    log_total = float(logsumexp(logs))
    posterior = dict[Hypothesis, float]()
    within_margin = 0.0
    weights = np.exp(np.array(logs) - log_total).tolist()
    for (ranking, answers), weight in zip(pairs, weights, strict=True):
        evidence = _mix_answers(answers, settings)
        margins = ranking.margin_probabilities
        fitted_evidence = sum(evidence.get(h, 0.0) for h in (*margins, UNKNOWN))
        inside_evidence = sum(evidence.get(h, 0.0) * p for h, p in margins.items())
        within_margin += weight * inside_evidence / fitted_evidence
        for h, p in fold_invisible(ranking.invisible_shares, evidence).items():
            posterior[h] = posterior.get(h, 0.0) + weight * p
    posterior = dict(sorted(posterior.items(), key=lambda pair: -pair[1]))
    best, _ = max(pairs, key=lambda pair: max(answer.log_total for answer in pair[1]))
    all_answers = [answer for _, answers in pairs for answer in answers]
    exclusion = excluded_share(
        prior=_sum_weights([answer.log_priors for answer in all_answers]),
        evidence=_sum_weights([answer.logs for answer in all_answers]),
    )
    verdict = decide(posterior, best.fits, NoneEvidence(within_margin, exclusion), settings)
    return _Conclusion(best, log_total, posterior, within_margin, verdict)


def _sum_weights(logs: Sequence[Mapping[Hypothesis, float]]) -> dict[Hypothesis, float]:
    """Sum the weights of hypotheses over answers, relative to the largest."""
    largest = max(max(answer.values()) for answer in logs)
    weights: dict[Hypothesis, float] = {}
    for answer in logs:
        for h, log in answer.items():
            weights[h] = weights.get(h, 0.0) + float(np.exp(log - largest))
    return weights


class _Reading(NamedTuple):
    """Place of the sensor and meaning of empty rows, under which hypotheses are ranked."""

    place: str  #: where displacement is read
    empty: EmptyCells  #: meaning of rows without a time


def _search_of(
    bench: Bench, model: Model, reading: _Reading, settings: Settings
) -> HypothesisSearch:
    """Begin the ranking of hypotheses under one reading of the record."""
    bench = replace(bench, cells=tuple(cell.with_empty(reading.empty) for cell in bench.cells))
    observed = observe(bench, model)
    flights = Flights(model.effects, model.settings, settings)
    facts = measured_facts(bench, model.effects)
    contacts = None
    if observed.contacts is not None:
        contacts = Contacts(bench, observed.contacts, model.effects, model.settings, settings)

    def side_likelihood(hypothesis: Hypothesis, shares: Array) -> Array:
        """Compute the log likelihood of traces and direct tests, (n,)."""
        space = model.space(hypothesis)
        values = space.values(shares)
        log_contacts = contacts.log_density(hypothesis, values) if contacts else 0.0
        marks = log_flights(
            observed.flights, flights, space.hypothesis, values, log_contacts=log_contacts
        )
        return log_density(facts, space, values) + marks

    log_side_unknown = sum(log_unknown(fact, model.effects) for fact in facts)
    log_side_unknown += log_unknown_flights(observed.flights, flights)
    if contacts is not None:
        log_side_unknown += contacts.log_unknown()
    reversed_prior = settings.reversed_unknown
    if bench.record.sense == "known":
        reversed_prior = settings.reversed_known
    priors = _reading_priors(bench, reading, settings)
    log_meaning = sum(np.log(prior) for _, values in priors for prior in values.values())
    return HypothesisSearch(
        likelihood=Likelihood(bench, observed, model, settings),
        side_likelihood=side_likelihood,
        reversed_prior=reversed_prior,
        log_side_unknown=log_side_unknown,
        log_meaning=float(log_meaning),
    )


def _answers_of(bench: Bench, reading: _Reading, ranking: Ranking) -> list[_Answer]:
    """List the answers of a ranking under each meaning that the record may have."""
    priors = dict(_meaning_priors(bench, reading, ranking.likelihood))
    answers = []
    for values in itertools.product(*priors.values()):
        meaning = dict(zip(priors, values, strict=True))
        log_meaning = sum(np.log(priors[key][value]) for key, value in meaning.items())
        log_evidences = {h: sample.log_evidence for h, sample in ranking.samples.items()}
        log_evidences[UNKNOWN] = ranking.log_unknown
        log_priors = {}
        logs = {}
        for h, log_evidence in log_evidences.items():
            log_priors[h] = log_meaning + _log_weight(ranking, h, meaning, 0.0)
            logs[h] = log_meaning + _log_weight(ranking, h, meaning, log_evidence)
        log_total = float(logsumexp(list(logs.values())))
        answers.append(_Answer(meaning, ranking, log_priors, logs, log_total))
    return answers


def _reading_priors(
    bench: Bench, reading: _Reading, settings: Settings
) -> Iterator[tuple[str, dict[str, float]]]:
    """Yield each open key of the record that a reading answers, with the prior of its value."""
    if bench.record.displacement_at == "unknown":
        yield "displacement_at", {reading.place: 0.5}
    if reading.empty != "unknown":
        left_out = settings.left_out if reading.empty == "not_made" else 1.0
        yield "empty_cells", {reading.empty: left_out}


def _meaning_priors(
    bench: Bench, reading: _Reading, likelihood: Likelihood
) -> Iterator[tuple[str, dict[str, float]]]:
    """Yield each open key of the record, and its values with their prior probabilities."""
    record = bench.record
    settings = likelihood.settings
    yield from _reading_priors(bench, reading, settings)
    if record.time_zero == "unknown" and DELAY in likelihood.model.effects:
        at_force = settings.zero_at_force
        yield "time_zero", {"command": 1.0 - at_force, "force": at_force}
    if record.sense == "unknown" and likelihood.model.reversed_model is not None:
        reversed_prior = settings.reversed_unknown
        yield "sense", {"as_noted": 1.0 - reversed_prior, "reversed": reversed_prior}


def _log_weight(
    ranking: Ranking, h: Hypothesis, meaning: Mapping[str, str], log_evidence: float
) -> float:
    """Compute log of prior times evidence of a hypothesis under a meaning of the record."""
    log = ranking.log_prior[h]
    settings = ranking.likelihood.settings
    log += log_evidence
    if h == UNKNOWN:
        return log
    if meaning.get("time_zero") == "force":
        if DELAY in h:
            return float(-np.inf)
        # The sets without a dead time take the whole prior.
        log = log - np.log1p(-settings.prior(DELAY))
    if "sense" in meaning:
        if (REVERSED in h) != (meaning["sense"] == "reversed"):
            return float(-np.inf)
        log = log - np.log(settings.reversed_unknown)
    return float(log)


def _mix_answers(answers: Sequence[_Answer], settings: Settings) -> dict[Hypothesis, float]:
    """Mix the probabilities over meanings of the record; the prior keeps the floor."""
    log_total = logsumexp([answer.log_total for answer in answers])
    priors = answers[0].ranking.log_prior
    probabilities: dict[Hypothesis, float] = {}
    for answer in answers:
        for h, log in answer.logs.items():
            probabilities[h] = probabilities.get(h, 0.0) + float(np.exp(log - log_total))
    prior = {h: float(np.exp(priors.get(h, -np.inf))) for h in probabilities}
    floor = settings.floor / sum(prior.values())
    mixed = {}
    for h, probability in probabilities.items():
        mixed[h] = (1.0 - settings.floor) * probability + floor * prior[h]
    return dict(sorted(mixed.items(), key=lambda item: -item[1]))
