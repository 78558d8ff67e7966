"""Diagnosis of a data set: cause of the gap with its probability, and the next test."""

from __future__ import annotations

import itertools
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy.special import logsumexp

from dogshape.diagnosis.bench.bench_data import Bench
from dogshape.diagnosis.bench.comparison import PointGap
from dogshape.diagnosis.inference.fit import Fit, Interval, fit
from dogshape.diagnosis.inference.held_out import HeldOut, held_out
from dogshape.diagnosis.inference.next_test import NextTest, choose
from dogshape.diagnosis.inference.ranking import Ranking, rank
from dogshape.diagnosis.inference.static_readings import (
    Fact,
    facts_of,
    log_density,
    log_unknown,
    measured_facts,
)
from dogshape.diagnosis.inference.verdict import Verdict, decide, inclusion, within_margin
from dogshape.diagnosis.inference.visible import Unseen, seen_apart, unseen
from dogshape.diagnosis.likelihood.likelihood import Likelihood
from dogshape.diagnosis.likelihood.mark_density import log_flights
from dogshape.diagnosis.likelihood.mark_density import log_unknown as log_unknown_flights
from dogshape.diagnosis.likelihood.observed import Observed, observe
from dogshape.diagnosis.prediction.flights import Flights
from dogshape.diagnosis.prediction.model import Model
from dogshape.diagnosis.settings import USUAL, Settings
from dogshape.diagnosis.terms import NONE, REVERSED, UNKNOWN, Array, Hypothesis
from dogshape.sim import effects as registry
from dogshape.sim.effect import Effect
from dogshape.sim.units import RPM

Record = dict[str, Any]  #: gap.json
DELAY = "actuation_delay"
FITTED = 1e-3  #: probability from which a hypothesis is fitted


@dataclass(frozen=True)
class Reading:
    """Answer if the record means one thing where nobody noted it.

    Parameters
    ----------
    key, value : such as ``time_zero`` and ``force``.
    probability : that it means this, given the data.
    verdict, posterior : in that case.
    """

    key: str
    value: str
    probability: float
    verdict: Verdict
    posterior: Mapping[Hypothesis, float]


@dataclass(frozen=True)
class Diagnosis:
    """Result of a diagnosis; carries the data set.

    Parameters
    ----------
    posterior : probability of each hypothesis, the largest first; what the data cannot show counts
        as absent.
    evidence : the same before that.
    fits : of none, and of every plausible known hypothesis.
    within : probability that the gap is below the margin.
    readings : answers by what the record means, where nobody noted it.
    seconds : processor time.
    """

    bench: Bench
    effects: Mapping[str, Effect]
    settings: Settings
    likelihood: Likelihood
    posterior: Mapping[Hypothesis, float]
    evidence: Mapping[Hypothesis, float]
    fits: Mapping[Hypothesis, Fit]
    verdict: Verdict
    within: float
    held_out: HeldOut
    readings: tuple[Reading, ...]
    facts: tuple[Fact, ...]
    flights: Flights
    seconds: float
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
    def rival(self) -> Hypothesis | None:
        """The most probable other known hypothesis with an effect."""
        others = (h for h in self.posterior if h in self.fits and h != NONE)
        return next((h for h in others if h != self.leading), None)

    @property
    def noise(self) -> float:
        """Monte Carlo standard error of the leading probability."""
        share = self.posterior[self.leading]
        return share * (1.0 - share) * self.fits[self.leading].error

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
            mine = [(h, p) for h, p in self.posterior.items() if name in h and h in self.fits]
            whole = sum(p for _, p in mine)
            if whole < FITTED:
                continue
            parts = [self._sizes_in(h, name, p / whole) for h, p in mine]
            values = np.vstack(parts)
            columns = zip(effect.parameters, values.T, strict=True)
            found[name] = {parameter.name: Interval.of(column) for parameter, column in columns}
        return found

    def _sizes_in(self, hypothesis: Hypothesis, name: str, share: float) -> Array:
        """Give as many draws of an effect's values as its hypothesis has of the probability."""
        one = self.fits[hypothesis]
        count = int(np.ceil(share * len(one.shares)))
        rows = np.linspace(0, len(one.shares) - 1, count).astype(int)
        if name == REVERSED:
            return np.zeros((count, 0))
        return one.values[rows][:, one.space.columns(name)]

    def to_dict(self) -> Record:
        """Write ``gap.json``."""
        gaps, top = self.held_out, self.fits[self.leading]
        missing = max(gaps.baseline - gaps.chance, 1e-6)
        amplitude = Interval.of(top.amplitude)
        record = self.bench.record
        return {
            "bench": self.bench.name,
            "engine": self.bench.clutch.solver.engine,
            "verdict": self.verdict.kind,
            "causes": list(self.verdict.causes),
            "noise": self.noise,
            "hypotheses": [self._hypothesis(h) for h in self.posterior],
            "confusable": self.confusable,
            "inclusion": self.inclusion,
            "sizes": {
                name: {key: one.as_dict() for key, one in sizes.items()}
                for name, sizes in self.sizes.items()
            },
            "gap": {
                "hypothesis": list(self.leading),
                "baseline_rmse_s": gaps.baseline,
                "heldout_rmse_s": gaps.held_out,
                "floor_rmse_s": gaps.chance,
                "shrink": float(np.clip(1.0 - (gaps.held_out - gaps.chance) / missing, -1.0, 1.0)),
                "rival": list(gaps.rival) if gaps.rival is not None else None,
                "rival_heldout_rmse_s": gaps.rival_held_out,
            },
            "margin_s": self.margin_s,
            "within_margin": self.within,
            "discrepancy": {"amplitude": amplitude.as_dict()},
            "where": [
                {
                    "mismatch_rpm": one.cell.point.mismatch / RPM,
                    "force_N": one.cell.point.profile.force,
                    "gap_s": one.gap,
                    "z": one.z,
                }
                for one in self.gaps
            ],
            "record": {
                "time_zero": record.time_zero,
                "displacement_at": record.displacement_at,
                "sense": record.sense,
                "empty_cells": record.empty_cells,
            },
            "readings": [
                {
                    "key": one.key,
                    "value": one.value,
                    "probability": one.probability,
                    "verdict": one.verdict.kind,
                    "causes": list(one.verdict.causes),
                }
                for one in self.readings
            ],
            "next_test": self.tests[0].to_dict() if self.tests else None,
            "tests": [one.to_dict() for one in self.tests[:8]],
            "facts": [
                {
                    "effect": fact.effect,
                    "parameter": fact.parameter,
                    "value": fact.value,
                    "low": fact.low,
                    "high": fact.high,
                    "sentence": fact.sentence,
                }
                for fact in self.facts
            ],
            "drift": self._drift(),
            "credible_set": [list(h) for h in self.verdict.credible],
            "seconds": self.seconds,
            "settings": self.settings.as_dict(),
        }

    @property
    def confusable(self) -> list[list[str]]:
        """Sets of names that no data of shifts can part."""
        named = {n for h in self.verdict.credible for n in h if n in self.effects}
        return [[n, *self.effects[n].aliases] for n in sorted(named) if self.effects[n].aliases]

    def _drift(self) -> Record | None:
        drift = self.seen.drift
        if drift is None:
            return None
        low, high = drift.mean - 1.645 * drift.sd, drift.mean + 1.645 * drift.sd
        return {"share": {"mean": drift.mean, "low": low, "high": high}, "informed": drift.informed}

    def _hypothesis(self, hypothesis: Hypothesis) -> Record:
        found = self.fits.get(hypothesis)
        record: Record = {
            "effects": list(hypothesis),
            "probability": self.posterior[hypothesis],
            "evidence_probability": self.evidence[hypothesis],
            "parameters": {},
        }
        if found is not None:
            record["parameters"] = {n: one.as_dict() for n, one in found.intervals.items()}
            record["log_evidence"], record["log_evidence_error"] = found.log_evidence, found.error
            record["predictive_p"] = found.p
        return record


def diagnose(
    bench: Bench, models: Mapping[str, Model], settings: Settings = USUAL, *, advise: bool = True
) -> Diagnosis:
    """Diagnose a data set.

    Parameters
    ----------
    models : by the place at which the displacement may be read: one where that is known.
    settings : errors of the simulation, priors, and limits of the answer.
    advise : whether to rank the tests.
    """
    begin = time.process_time()
    answers = [
        one for place, model in models.items() for one in _answers(bench, place, model, settings)
    ]
    whole = logsumexp([one.log for one in answers])
    answers = [replace(one, log=one.log - whole) for one in answers]
    evidence = _floored(_mixed(answers), answers[0].ranking, settings)
    best = max(answers, key=lambda one: one.log).ranking
    likelihood = best.likelihood
    plausible = [h for h, p in evidence.items() if p > FITTED and h in best.samples]
    flights = Flights(likelihood.model.effects, likelihood.model.settings)
    fits = {h: fit(likelihood, best.samples[h], flights) for h in dict.fromkeys((NONE, *plausible))}
    shares = unseen(likelihood, fits, evidence)
    posterior = seen_apart(shares, evidence)
    within = within_margin(likelihood, fits, evidence, bench.margin)
    verdict = decide(posterior, fits, within, settings)
    known = [h for h in posterior if h in fits]
    rival = next((h for h in known[1:] if h != NONE), None)
    plain = likelihood.late_mean(fits[NONE].predicted.only([0]))[0]
    times = np.array([np.nan if cell.time is None else cell.time for cell in bench.cells])
    effects = dict(likelihood.model.effects)
    if likelihood.model.turned is not None:
        effects[REVERSED] = registry.load()[REVERSED]
    found = Diagnosis(
        bench,
        dict(sorted(effects.items())),
        settings,
        likelihood,
        posterior,
        evidence,
        fits,
        verdict,
        within,
        held_out(likelihood, fits[known[0]], fits[rival] if rival else None, times - plain),
        _readings(answers, shares, fits, settings, within),
        (*facts_of(bench), *measured_facts(bench, likelihood.model.effects)),
        flights,
        0.0,
    )
    tests = choose(found, found.flights.marks) if advise else ()
    return replace(found, tests=tests, seconds=time.process_time() - begin)


@dataclass(frozen=True)
class _Answer:
    """Log of prior times evidence of each hypothesis, under one meaning of the record."""

    record: Mapping[str, str]
    ranking: Ranking
    log: float
    logs: Mapping[Hypothesis, float]


def _answers(bench: Bench, place: str, model: Model, settings: Settings) -> list[_Answer]:
    """Rank the hypotheses under each meaning that the record may have."""
    seen, record = observe(bench, model), bench.record
    likelihood = Likelihood(bench, seen, model, settings)
    flights = Flights(model.effects, model.settings)
    facts = measured_facts(bench, model.effects)

    def more(hypothesis: Hypothesis, shares: Array) -> Array:
        space = model.space(hypothesis)
        values = space.values(shares)
        found = log_density(facts, space, values)
        if seen.flights:
            found = found + log_flights(seen.flights, flights, space.hypothesis, values)
        return found

    beside = sum(log_unknown(fact, model.effects) for fact in facts)
    if seen.flights:
        beside += log_unknown_flights(seen.flights, flights)
    turned = settings.reversed_known if record.sense == "known" else settings.reversed_unknown
    ranking = rank(likelihood, more, turned, beside)
    grid: dict[str, dict[str, float]] = {}
    if record.displacement_at == "unknown":
        grid["displacement_at"] = {place: 0.5}
    if record.time_zero == "unknown" and DELAY in model.effects:
        share = settings.zero_at_force
        grid["time_zero"] = {"command": 1.0 - share, "force": share}
    if record.sense == "unknown" and model.turned is not None:
        grid["sense"] = {"as_noted": 1.0 - turned, "reversed": turned}
    if record.empty_cells == "unknown" and seen.untold.any():
        grid["empty_cells"] = {
            "not_made": 1.0 - settings.empty_failed,
            "failed": settings.empty_failed,
        }
    found = []
    for values in itertools.product(*grid.values()):
        meant = dict(zip(grid, values, strict=True))
        prior = sum(np.log(grid[key][value]) for key, value in meant.items())
        logs = _logs(ranking, meant)
        found.append(_Answer(meant, ranking, prior + float(logsumexp(list(logs.values()))), logs))
    return found


def _logs(ranking: Ranking, meant: Mapping[str, str]) -> dict[Hypothesis, float]:
    """Compute log of prior times evidence where the record means something."""
    odds, settings = 0.0, ranking.likelihood.settings
    if meant.get("time_zero") == "force":
        # The sets without a dead time take the whole prior.
        odds = -np.log1p(-settings.prior(DELAY))
    found = {}
    for h in (*ranking.samples, UNKNOWN):
        log = ranking.log_joint(h)
        if meant.get("time_zero") == "force" and h != UNKNOWN:
            log = -np.inf if DELAY in h else log + odds
        if "sense" in meant and h != UNKNOWN:
            mine = (REVERSED in h) == (meant["sense"] == "reversed")
            log = log - np.log(settings.reversed_unknown) if mine else -np.inf
        if meant.get("empty_cells") == "failed":
            log += ranking.log_failed(h)
        found[h] = float(log)
    return found


def _mixed(answers: Sequence[_Answer]) -> dict[Hypothesis, float]:
    """Mix the probabilities of hypotheses over what the record may mean."""
    found: dict[Hypothesis, float] = {}
    for one in answers:
        whole = logsumexp(list(one.logs.values()))
        for h, log in one.logs.items():
            found[h] = found.get(h, 0.0) + float(np.exp(one.log + log - whole))
    return found


def _floored(
    found: Mapping[Hypothesis, float], ranking: Ranking, settings: Settings
) -> dict[Hypothesis, float]:
    """Leave the prior its share: no answer is surer than the model of errors."""
    prior = {
        h: float(np.exp(ranking.log_prior[h])) if h in ranking.log_prior else 0.0 for h in found
    }
    whole = sum(prior.values())
    mixed = {
        h: (1.0 - settings.floor) * p + settings.floor * prior[h] / whole for h, p in found.items()
    }
    return dict(sorted(mixed.items(), key=lambda item: -item[1]))


def _readings(
    answers: Sequence[_Answer],
    shares: Unseen,
    fits: Mapping[Hypothesis, Fit],
    settings: Settings,
    within: float,
) -> tuple[Reading, ...]:
    """Give the answer under each meaning of the record that nobody noted."""
    found = []
    keys = dict.fromkeys((k, v) for one in answers for k, v in one.record.items())
    for key, value in keys:
        mine = [one for one in answers if one.record.get(key) == value]
        log = float(logsumexp([one.log for one in mine]))
        mine = [replace(one, log=one.log - log) for one in mine]
        posterior = seen_apart(shares, _floored(_mixed(mine), mine[0].ranking, settings))
        verdict = decide(posterior, fits, within, settings)
        prior = 1.0 / sum(k == key for k, _ in keys)
        probability = (1.0 - settings.floor) * float(np.exp(log)) + settings.floor * prior
        found.append(Reading(key, value, probability, verdict, posterior))
    return tuple(found)
