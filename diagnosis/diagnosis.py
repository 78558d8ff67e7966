"""Diagnosis of a data set: cause of the gap with its probability, and the next test."""

from __future__ import annotations

import itertools
import time
from collections.abc import Collection, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy.special import logsumexp

from dogshape.diagnosis.bench.bench_data import Bench
from dogshape.diagnosis.bench.comparison import PointGap
from dogshape.diagnosis.bench.stand_file import EmptyCells
from dogshape.diagnosis.inference.fit import Fit, HeldOut, Interval, fit, held_out
from dogshape.diagnosis.inference.outcome import NextTest
from dogshape.diagnosis.inference.ranking import Ranking, rank
from dogshape.diagnosis.inference.static_readings import (
    Fact,
    facts_of,
    log_density,
    log_unknown,
    measured_facts,
)
from dogshape.diagnosis.inference.verdict import (
    Probabilities,
    Verdict,
    Within,
    decide,
    inclusion,
    seen_apart,
    unseen,
    within_margin,
)
from dogshape.diagnosis.likelihood.likelihood import Likelihood
from dogshape.diagnosis.likelihood.observed import Observed, observe
from dogshape.diagnosis.prediction.flights import Flights, log_flights
from dogshape.diagnosis.prediction.flights import log_unknown as log_unknown_flights
from dogshape.diagnosis.prediction.model import Model
from dogshape.diagnosis.settings import USUAL, Settings
from dogshape.diagnosis.terms import DELAY, NONE, REVERSED, UNKNOWN, Array, Hypothesis, forward
from dogshape.sim import effects as registry
from dogshape.sim.effect import Effect
from dogshape.sim.units import RPM

Record = dict[str, Any]  #: gap.json
FITTED = 1e-3  #: probability from which a hypothesis is fitted


@dataclass(frozen=True)
class Reading:
    """Answer if a key of the record has a value that nobody noted, and its probability."""

    key: str
    value: str
    probability: float
    verdict: Verdict
    posterior: Mapping[Hypothesis, float]


@dataclass(frozen=True)
class Diagnosis:
    """Result of a diagnosis; carries the data set."""

    bench: Bench
    effects: Mapping[str, Effect]
    settings: Settings
    likelihood: Likelihood
    posterior: Mapping[Hypothesis, float]  #: the largest first; what data cannot show is absent
    evidence: Mapping[Hypothesis, float]  #: the same before that
    fits: Mapping[Hypothesis, Fit]  #: of none, and of every plausible known hypothesis
    verdict: Verdict
    within: float  #: probability that the gap is below the margin
    held_out: HeldOut
    readings: tuple[Reading, ...]  #: answers by what the record means, where nobody noted it
    facts: tuple[Fact, ...]
    flights: Flights
    seconds: float  #: processor time
    tests: tuple[NextTest, ...] = ()

    @property
    def model(self) -> Model:
        """Predictions for the data set."""
        return self.likelihood.model

    @property
    def seen(self) -> Observed:
        """Observations as the likelihood counts them."""
        return self.likelihood.seen

    @property
    def inclusion(self) -> dict[str, float]:
        """Probability of each effect to be part of the cause, the largest first."""
        return inclusion(self.posterior)

    @property
    def leading(self) -> Hypothesis:
        """The most probable known hypothesis."""
        return next(h for h in self.posterior if h in self.fits)

    @property
    def noise(self) -> float:
        """Standard error of the leading probability by the errors of all evidences."""
        share = self.posterior[self.leading]
        return self._probability_error({self.leading}, share)

    @property
    def inclusion_error(self) -> dict[str, float]:
        """Standard error of each effect's probability by the errors of all evidences."""
        return {
            name: self._probability_error({h for h in self.fits if name in h}, p)
            for name, p in self.inclusion.items()
        }

    def _probability_error(self, members: Collection[Hypothesis], probability: float) -> float:
        """Propagate independent errors of log evidences to the probability of some hypotheses."""
        parts = [
            self.posterior.get(h, 0.0) * ((h in members) - probability) * one.error
            for h, one in self.fits.items()
        ]
        return float(np.sqrt(np.square(parts).sum()))

    @property
    def margin_s(self) -> float:
        """Gap below which nothing needs doing, root mean square, s."""
        limit = self.bench.margin.of(self.baseline)[self.likelihood.having]
        return float(np.sqrt((limit**2).mean()))

    @cached_property
    def baseline(self) -> Array:
        """Mean time of each operating point without any effect, late shifts too, s, (C,)."""
        return self.likelihood.late_mean(self.fits[NONE].predicted.only([0]))[0]

    @cached_property
    def gaps(self) -> tuple[PointGap, ...]:
        """Gap at each operating point without any effect, with the error of data and simulation."""
        one = self.fits[NONE].predicted.only([0])
        own = self.likelihood.own_variance(one)[0]
        error = np.sqrt(one.sd[0] ** 2 / np.maximum(1.0, self.seen.count) + own)
        cells = zip(self.bench.cells, self.baseline.tolist(), error.tolist(), strict=True)
        return tuple(PointGap(*one) for one in cells)

    @cached_property
    def sizes(self) -> dict[str, dict[str, Interval]]:
        """Sizes of each effect over all plausible hypotheses that have it."""
        found: dict[str, dict[str, Interval]] = {}
        for name, effect in self.effects.items():
            mine = [(self.fits[h], p) for h, p in self.posterior.items()
                    if name in h and h in self.fits]  # fmt: skip
            whole = sum(p for _, p in mine)
            if whole < FITTED:
                continue
            parts = []
            for one, p in mine:
                count = len(one.shares)
                rows = np.linspace(0, count - 1, int(np.ceil(p / whole * count))).astype(int)
                columns = one.space.columns(name) if effect.parameters else slice(0)
                parts.append(one.values[rows][:, columns])
            drawn = zip(effect.parameters, np.vstack(parts).T, strict=True)
            found[name] = {parameter.name: Interval.of(column) for parameter, column in drawn}
        return found

    def to_dict(self) -> Record:
        """Write ``gap.json``."""
        gaps, amplitude = self.held_out, Interval.of(self.fits[self.leading].amplitude)
        shrink = 1.0 - (gaps.held_out - gaps.chance) / max(gaps.baseline - gaps.chance, 1e-6)
        # Sets of names that no data of shifts can part.
        named = sorted({n for h in self.verdict.credible for n in h if n in self.effects})
        alike = [[name, *self.effects[name].aliases] for name in named]
        return {
            "bench": self.bench.name,
            "engine": self.bench.clutch.solver.engine,
            "verdict": self.verdict.kind,
            "causes": list(self.verdict.causes),
            "noise": self.noise,
            "hypotheses": [self._hypothesis(h) for h in self.posterior],
            "confusable": [names for names in alike if len(names) > 1],
            "inclusion": self.inclusion,
            "inclusion_error": self.inclusion_error,
            "sizes": {n: {k: asdict(i) for k, i in one.items()} for n, one in self.sizes.items()},
            "gap": {
                "hypothesis": list(self.leading),
                "baseline_rmse_s": gaps.baseline,
                "heldout_rmse_s": gaps.held_out,
                "floor_rmse_s": gaps.chance,
                "shrink": float(np.clip(shrink, -1.0, 1.0)),
                "rival": list(gaps.rival) if gaps.rival is not None else None,
                "rival_heldout_rmse_s": gaps.rival_held_out,
            },
            "margin_s": self.margin_s,
            "within_margin": self.within,
            "discrepancy": {"amplitude": asdict(amplitude)},
            "where": [
                {"mismatch_rpm": one.cell.point.mismatch / RPM,
                 "force_N": one.cell.point.profile.force, "gap_s": one.gap, "z": one.z}
                for one in self.gaps
            ],
            "record": self.bench.record.model_dump(),
            "readings": [
                {"key": one.key, "value": one.value, "probability": one.probability,
                 "verdict": one.verdict.kind, "causes": list(one.verdict.causes)}
                for one in self.readings
            ],
            "next_test": self.tests[0].to_dict() if self.tests else None,
            "tests": [one.to_dict() for one in self.tests[:8]],
            "facts": [fact.to_dict() for fact in self.facts],
            "drift": None if self.seen.drift is None else self.seen.drift.to_dict(),
            "credible_set": [list(h) for h in self.verdict.credible],
            "seconds": self.seconds,
            "settings": asdict(self.settings),
        }  # fmt: skip

    def _hypothesis(self, h: Hypothesis) -> Record:
        record = {"effects": list(h), "probability": self.posterior[h],
                  "evidence_probability": self.evidence[h], "parameters": {}}  # fmt: skip
        if found := self.fits.get(h):
            record |= {
                "parameters": {name: asdict(one) for name, one in found.intervals.items()},
                "log_evidence": found.log_evidence,
                "log_evidence_error": found.error,
                "predictive_p": found.p,
            }
        return record


def diagnose(bench: Bench, models: Mapping[str, Model], settings: Settings = USUAL) -> Diagnosis:
    """Diagnose a data set by the models of each place where displacement may be read."""
    begin = time.process_time()
    unknown = any(cell.unknown for cell in bench.cells)
    meanings: tuple[EmptyCells, ...] = ("not_made", "failed") if unknown else ("unknown",)
    ranked = [_answers(bench, place, empty, model, settings)
              for place, model in models.items() for empty in meanings]  # fmt: skip
    every = [answer for answers in ranked for answer in answers]
    evidence = _mixed(every, settings)
    fitted = [_fitted(answers, evidence) for answers in ranked]
    whole, readings = _conclude(fitted, settings), []
    likelihood, fits = whole.best.likelihood, whole.best.fits
    model, known = likelihood.model, [h for h in whole.posterior if h in fits]
    rival = next((fits[h] for h in known[1:] if h != NONE), None)
    plain = likelihood.late_mean(fits[NONE].predicted.only([0]))[0]
    times = np.array([cell.time for cell in bench.cells], dtype=float)
    turned = {} if model.turned is None else {REVERSED: registry.load()[REVERSED]}
    keys = dict.fromkeys(item for one in every for item in one.record.items())
    for key, value in keys:
        mine = _conclude(fitted, settings, (key, value))
        prior = 1.0 / sum(k == key for k, _ in keys)
        probability = float(np.exp(mine.log - whole.log))
        probability = (1.0 - settings.floor) * probability + settings.floor * prior
        readings.append(Reading(key, value, probability, mine.verdict, mine.posterior))
    return Diagnosis(
        bench, dict(sorted({**model.effects, **turned}.items())), settings, likelihood,
        whole.posterior, evidence, fits, whole.verdict, whole.within,
        held_out(likelihood, fits[known[0]], rival, times - plain), tuple(readings),
        (*facts_of(bench), *measured_facts(bench, model.effects)),
        Flights(model.effects, model.settings), time.process_time() - begin,
    )  # fmt: skip


@dataclass(frozen=True)
class _Answer:
    """Log of prior times evidence of each hypothesis, under one meaning of the record."""

    record: Mapping[str, str]
    ranking: Ranking
    logs: Mapping[Hypothesis, float]
    log: float  #: of all hypotheses together


@dataclass(frozen=True)
class _Fitted:
    """Answers by one ranking, its fits, and the shares of each that smaller ones predict."""

    answers: Sequence[_Answer]
    likelihood: Likelihood
    fits: Mapping[Hypothesis, Fit]
    shares: Mapping[Hypothesis, Probabilities]
    within: Mapping[Hypothesis, float]  #: probability by each that the gap is below the margin


@dataclass(frozen=True)
class _Conclusion:
    """Answer over meanings of the record, with the ranking of the most probable one."""

    best: _Fitted
    log: float  #: of prior times evidence
    posterior: Probabilities
    within: float
    verdict: Verdict


def _fitted(answers: Sequence[_Answer], evidence: Probabilities) -> _Fitted:
    """Fit none and all plausible hypotheses of a ranking."""
    ranking = answers[0].ranking
    likelihood, model = ranking.likelihood, ranking.likelihood.model
    flights = Flights(model.effects, model.settings)
    plausible = [h for h, p in evidence.items() if p > FITTED and h in ranking.samples]
    names = dict.fromkeys((NONE, *plausible))
    fits = {h: fit(likelihood, ranking.samples[h], flights, ranking.more) for h in names}
    shares = {h: unseen(ranking, one, evidence) for h, one in fits.items() if forward(h)}
    within = {h: within_margin(likelihood, one) for h, one in fits.items()}
    return _Fitted(answers, likelihood, fits, shares, within)


def _conclude(
    fitted: Sequence[_Fitted], settings: Settings, item: tuple[str, str] | None = None
) -> _Conclusion:
    """Decide over all meanings of the record, or those with one item."""
    parts = [(one, [a for a in one.answers if item is None or item in a.record.items()])
             for one in fitted]  # fmt: skip
    parts = [(one, mine) for one, mine in parts if mine]
    logs = [logsumexp([a.log for a in mine]) for _, mine in parts]
    log, posterior, within = float(logsumexp(logs)), dict[Hypothesis, float](), 0.0
    for (one, mine), part in zip(parts, np.exp(np.array(logs) - log).tolist(), strict=True):
        evidence = _mixed(mine, settings)
        known = sum(evidence.get(h, 0.0) for h in (*one.within, UNKNOWN))
        within += part * sum(evidence.get(h, 0.0) * p for h, p in one.within.items()) / known
        for h, p in seen_apart(one.shares, evidence).items():
            posterior[h] = posterior.get(h, 0.0) + part * p
    posterior = dict(sorted(posterior.items(), key=lambda item: -item[1]))
    best = max(parts, key=lambda part: max(a.log for a in part[1]))[0]
    verdict = decide(posterior, best.fits, Within(within, best.within[NONE]), settings)
    return _Conclusion(best, log, posterior, within, verdict)


def _answers(
    bench: Bench, place: str, empty: EmptyCells, model: Model, settings: Settings
) -> list[_Answer]:
    """Rank the hypotheses under each meaning that the record may have."""
    bench = replace(bench, cells=tuple(cell.with_empty(empty) for cell in bench.cells))
    seen, record = observe(bench, model), bench.record
    likelihood = Likelihood(bench, seen, model, settings)
    flights = Flights(model.effects, model.settings)
    facts = measured_facts(bench, model.effects)

    def more(hypothesis: Hypothesis, shares: Array) -> Array:
        space = model.space(hypothesis)
        values = space.values(shares)
        marks = log_flights(seen.flights, flights, space.hypothesis, values)
        return log_density(facts, space, values) + marks

    beside = sum(log_unknown(fact, model.effects) for fact in facts)
    beside += log_unknown_flights(seen.flights, flights)
    turned = settings.reversed_known if record.sense == "known" else settings.reversed_unknown
    ranking = rank(likelihood, more, turned, beside)
    at_force = settings.zero_at_force
    grid: dict[str, dict[str, float]] = {}
    if record.displacement_at == "unknown":
        grid["displacement_at"] = {place: 0.5}
    if empty != "unknown":
        grid["empty_cells"] = {empty: settings.left_out if empty == "not_made" else 1.0}
    if record.time_zero == "unknown" and DELAY in model.effects:
        grid["time_zero"] = {"command": 1.0 - at_force, "force": at_force}
    if record.sense == "unknown" and model.turned is not None:
        grid["sense"] = {"as_noted": 1.0 - turned, "reversed": turned}
    found = []
    for values in itertools.product(*grid.values()):
        meant = dict(zip(grid, values, strict=True))
        prior = sum(np.log(grid[key][value]) for key, value in meant.items())
        logs = {h: prior + _log(ranking, h, meant) for h in (*ranking.samples, UNKNOWN)}
        found.append(_Answer(meant, ranking, logs, float(logsumexp(list(logs.values())))))
    return found


def _log(ranking: Ranking, h: Hypothesis, meant: Mapping[str, str]) -> float:
    """Compute log of prior times evidence where the record means something."""
    log, settings = ranking.log_prior[h], ranking.likelihood.settings
    if h == UNKNOWN:
        return log + ranking.log_unknown
    log += ranking.samples[h].log_evidence
    if meant.get("time_zero") == "force":
        # The sets without a dead time take the whole prior.
        log = -np.inf if DELAY in h else log - np.log1p(-settings.prior(DELAY))
    if "sense" in meant:
        mine = (REVERSED in h) == (meant["sense"] == "reversed")
        log = log - np.log(settings.reversed_unknown) if mine else -np.inf
    return float(log)


def _mixed(answers: Sequence[_Answer], settings: Settings) -> dict[Hypothesis, float]:
    """Mix the probabilities over meanings of the record; the prior keeps the floor."""
    whole, priors = logsumexp([one.log for one in answers]), answers[0].ranking.log_prior
    found = dict.fromkeys((h for one in answers for h in one.logs), 0.0)
    for h, log in (item for one in answers for item in one.logs.items()):
        found[h] += float(np.exp(log - whole))
    prior = {h: float(np.exp(priors.get(h, -np.inf))) for h in found}
    floor = settings.floor / sum(prior.values())
    mixed = {h: (1.0 - settings.floor) * p + floor * prior[h] for h, p in found.items()}
    return dict(sorted(mixed.items(), key=lambda item: -item[1]))
