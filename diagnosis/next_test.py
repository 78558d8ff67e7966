"""Next bench test: the menu of a stand with cost and worth, and its order.

Direct tests read the parameters of effects as shares of their ranges, neutral where the effect is
absent. More shifts at an operating point give a mean time and a share that engages; traces give the
marks of the flight. *Unknown* predicts as well: a direct test finds nothing or anything, half and
half, and its offset of a mean comes again or, a slip of the record, does not.

The value of a test is its chance to settle, less four times its chance to mislead, less 0.04 for
each hour. Of tests that settle about as surely the cheapest leads. Where no test is worth its cost,
or the cause is named, the information an hour decides; the direct test of a named cause leads if it
costs no more than the first. Where *unknown* leads, traces do.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from scipy.special import rel_entr

from dogshape.bench.bench_data import Bench
from dogshape.bench.flight_marks import FORCES, SIZE, WAYS, model_covariance
from dogshape.diagnosis.diagnosis import Diagnosis, RecordMeaning
from dogshape.diagnosis.inference.fit import Fit
from dogshape.diagnosis.inference.outcome import (
    MIN_SHARE,
    SETUP_HOURS,
    SHIFT_HOURS,
    TRACING_HOURS,
    Densities,
    NextTest,
    PredictedOutcome,
    smooth_draws,
)
from dogshape.diagnosis.inference.verdict import is_nameable
from dogshape.diagnosis.settings import Settings
from dogshape.diagnosis.terms import NONE, UNKNOWN, Array, Hypothesis
from dogshape.sim.effect import Effect
from dogshape.sim.errors import DataError, number, require_known
from dogshape.sim.shift.actuation import ForceProfile
from dogshape.sim.units import RPM

MIN_PROBABILITY = 5e-3  #: from which a hypothesis predicts a test
POSTERIOR_DRAWS = 64  #: of each hypothesis
CHANCE_TOLERANCE = 0.1  #: of chances to settle, within which the cost decides
FURTHER_SHIFTS = (10, 40)  #: numbers that may be added at an operating point
TRACED_SHIFTS = 10  #: shifts of which traces are recorded
GENERIC = ("more shifts", "traces")  #: tests of no effect, by the names of a data set
DIRECT_HOURS = 3.0  #: h, of another direct test
QUESTION_HOURS = 0.25  #: h, of a question about the record
HOURS = {  #: to set up, or of direct tests: sensors cost less than a clutch in pieces
    "more shifts": SETUP_HOURS,
    "traces": TRACING_HOURS,
    "sense of rotation at the rig": 0.25,
    "hand test of the play": 0.5,
    "gap by feeler or travel": 0.5,
    "slow push of the free ring": 1.0,
    "static stiffness of the linkage": 1.0,
    "run-down of the sliding ring": 1.0,
    "force at the sleeve over time": 2.0,
    "static force at the sleeve": 2.0,
    "drop test of the ring": 6.0,
}
RECORD_QUESTIONS = {  #: name and instruction of the question about a key of the record
    "sense": ("sense of rotation at the rig", "Look which way the driven ring turns."),
    "time_zero": ("start of the clock", "Look up whether times start with command or force."),
    "displacement_at": (
        "place of the displacement sensor",
        "Look whether the displacement is measured at the sleeve or at the actuator.",
    ),
    "empty_cells": (
        "meaning of rows without a time",
        "Look up whether shifts without a time were not made, or failed.",
    ),
}
SAMPLING_STEP_S = 1e-3  #: s, of a recording
OFFSET_SDS_S = (1e-3, 4e-3, 0.014, 0.053, 0.2)  #: s, offsets of marks by an unknown cause
OFFSET_CORRELATION = 0.9  #: of offsets between marks of displacement, and between those of force


class PlausibleFit(NamedTuple):
    """Fit of a hypothesis and the indices of some of its draws."""

    fit: Fit
    draws: np.ndarray


class StandTerms(NamedTuple):
    """Terms of a stand for a test."""

    hours: float  #: of a direct test, or to set up another
    is_possible: bool


def require_terms(bench: Bench, effects: Mapping[str, Effect]) -> None:
    """Raise InputError where a data set's terms are of no test, DataError where none is left."""
    menu = {*GENERIC, *(effect.test.name for effect in effects.values())}
    for terms in bench.tests:
        require_known(f"{bench.name}: name in [[tests]]", terms.name, "a bench test", menu)
    if not any(terms_of(bench, name).is_possible for name in menu - {"traces"}):
        raise DataError(
            f"{bench.name}: [[tests]] leaves no bench test that is possible, but advice needs one; "
            "leave 'more shifts' or a direct test"
        )


def terms_of(bench: Bench, name: str) -> StandTerms:
    """Look up the terms of a test by its name."""
    hours = HOURS.get(name, DIRECT_HOURS)
    is_possible = True
    for terms in bench.tests:
        if terms.name == name:
            is_possible = is_possible and terms.possible
            if terms.hours is not None:
                hours = terms.hours
    return StandTerms(hours, is_possible)


def imitator_odds(settings: Settings) -> float:
    """Compute the prior odds of an imitator to its hypothesis."""
    return settings.unlisted * settings.imitated / (1.0 - settings.unlisted)


def rank_tests(diagnosis: Diagnosis) -> tuple[NextTest, ...]:
    """Rank the tests of a diagnosis, the best first."""
    tests_by_name = {}
    for test in (*_direct_tests(diagnosis), *_questions(diagnosis)):
        tests_by_name[test.name] = test
    tests = [*tests_by_name.values(), *_further_tests(diagnosis), *_trace_tests(diagnosis)]
    first, *further = _order_tests(diagnosis, [_add_worth(diagnosis, test) for test in tests])
    # The best of many by drawn outcomes looks better than it is: its worth is of other draws.
    return (_add_worth(diagnosis, first, seed=2), *further)


def update_posterior(
    diagnosis: Diagnosis, test: NextTest, outcome: Sequence[float] | str
) -> Mapping[Hypothesis, float]:
    """Update the probabilities by the outcome of a test; unchanged where nothing predicts it.

    ``outcome`` has the numbers of ``test.outcome``, NaN or less of them where one is not shown; of
    a question it is the answer's word.
    """
    if isinstance(outcome, str):
        answer = (test.question, outcome)
        meanings = [m for m in diagnosis.record_meanings if (m.key, m.value) == answer]
        return meanings[0].posterior
    if test.outcome is None or np.isnan(outcome).all():
        return diagnosis.posterior
    values = np.full(test.outcome.mean.shape[1], np.nan)
    values[: len(outcome)] = outcome
    is_shown = np.isfinite(values)
    predicted = test.outcome.select(is_shown)
    log = predicted.log_density(values[None, is_shown])
    odds = imitator_odds(diagnosis.settings)
    posterior = predicted.update(_prior(diagnosis, predicted), log, odds)[0]
    return dict(zip(predicted.hypotheses, posterior.tolist(), strict=True))


def _add_worth(diagnosis: Diagnosis, test: NextTest, seed: int = 1) -> NextTest:
    """Add its worth to a test whose outcome is predicted."""
    if test.outcome is None:
        return test
    odds = imitator_odds(diagnosis.settings)
    prior = _prior(diagnosis, test.outcome)
    worth = test.outcome.worth(prior, odds, diagnosis.settings, seed)
    return replace(test, **worth._asdict())


def _prior(diagnosis: Diagnosis, outcome: PredictedOutcome) -> Array:
    """Compute the probabilities of an outcome's hypotheses before the test, all above 0."""
    posterior = diagnosis.posterior
    prior = np.array([max(1e-9, posterior.get(h, 0.0)) for h in outcome.hypotheses])
    return np.asarray(prior / prior.sum())


@dataclass(frozen=True)
class _Decision:
    """Values of tests for the decision of a diagnosis."""

    settings: Settings
    is_decided: bool  #: whether the cause is named

    def chance(self, test: NextTest) -> float:
        """Compute the chance to settle less the weighted chance to mislead."""
        odds = self.settings.named / (1.0 - self.settings.named)
        return test.settles - odds * test.misleads

    def is_worthwhile(self, test: NextTest) -> bool:
        """Check that a test is worth its cost."""
        return not self.is_decided and self._value(test) > 0.0

    def _value(self, test: NextTest) -> float:
        return self.chance(test) - self.settings.hour * test.hours

    def rank(self, test: NextTest) -> tuple[bool, float]:
        """Compute a key by which the best test comes first."""
        if self.is_worthwhile(test):
            return False, -self._value(test)
        return True, -test.information / test.hours


def _order_tests(diagnosis: Diagnosis, tests: Sequence[NextTest]) -> list[NextTest]:
    """Order tests: those worth their cost by their value, all others by information an hour."""
    settings = diagnosis.settings
    top = _most_probable(diagnosis.posterior, diagnosis.posterior)
    is_decided = diagnosis.posterior[top] > settings.named and is_nameable(top, settings)
    decision = _Decision(settings, is_decided)
    ordered = sorted(tests, key=decision.rank)
    best = ordered[0]
    if top == UNKNOWN:
        candidates = [test for test in ordered if test.kind == "traces"]
    elif is_decided:
        candidates = [t for t in ordered if set(top) & set(t.effects) and t.hours <= best.hours]
    else:
        min_chance = decision.chance(best) - CHANCE_TOLERANCE
        candidates = [
            test
            for test in ordered
            if decision.is_worthwhile(test) and decision.chance(test) >= min_chance
        ]
    first = min(candidates, key=lambda t: (t.hours, t.kind != "direct"), default=None)
    return sorted(ordered, key=lambda test: test is not first)


def _most_probable(
    posterior: Mapping[Hypothesis, float], candidates: Iterable[Hypothesis]
) -> Hypothesis:
    """Find the most probable of some hypotheses."""
    return max(candidates, key=lambda h: posterior.get(h, 0.0))


def _plausible_fits(diagnosis: Diagnosis) -> dict[Hypothesis, PlausibleFit]:
    """List the plausible known hypotheses with their fits."""
    fits = {}
    for h, probability in diagnosis.posterior.items():
        if probability > MIN_PROBABILITY and h in diagnosis.fits:
            fits[h] = _select_draws(diagnosis.fits[h])
    return fits


def _select_draws(fit: Fit) -> PlausibleFit:
    """Select some draws of a fit."""
    count = len(fit.shares)
    draws = np.linspace(0, count - 1, min(count, POSTERIOR_DRAWS)).astype(int)
    return PlausibleFit(fit, draws)


def _questions(diagnosis: Diagnosis) -> list[NextTest]:
    """List the questions about the record whose answers have a probability, with their worth."""
    keys = dict.fromkeys(meaning.key for meaning in diagnosis.record_meanings)
    return [_question(diagnosis, key) for key in keys]


def _question(diagnosis: Diagnosis, key: str) -> NextTest:
    """Build the question about a key of the record."""
    answers: list[RecordMeaning] = [m for m in diagnosis.record_meanings if m.key == key]
    chance = np.array([answer.probability for answer in answers])
    chance = chance / chance.sum()
    hypotheses = dict.fromkeys(
        itertools.chain.from_iterable(answer.posterior for answer in answers)
    )
    posterior = np.array([[a.posterior.get(h, 0.0) for h in hypotheses] for a in answers])
    gain = float((rel_entr(posterior, chance @ posterior) * chance[:, None]).sum())
    best = posterior.max(axis=1)
    is_decided = np.array([answer.verdict.kind != "ambiguous" for answer in answers])
    name, how = RECORD_QUESTIONS[key]
    return NextTest(
        name=name,
        how=how,
        kind="record",
        hours=QUESTION_HOURS,
        effects=tuple(e.name for e in diagnosis.effects.values() if e.test.name == name),
        question=key,
        information=gain,
        settles=float(chance @ (is_decided * best)),
        misleads=float(chance @ (is_decided * (1.0 - best))),
    )


def _direct_tests(diagnosis: Diagnosis) -> list[NextTest]:
    """List the direct tests of the effects that are possible and have no result yet."""
    bench = diagnosis.bench
    measured = {result.effect for result in bench.measured}
    effects_by_test: dict[str, list[Effect]] = {}
    for effect in diagnosis.effects.values():
        effects_by_test.setdefault(effect.test.name, []).append(effect)
    tests = []
    for name, effects in effects_by_test.items():
        hours, is_possible = terms_of(bench, name)
        effect_names = tuple(effect.name for effect in effects)
        if not is_possible or set(effect_names) <= measured:
            continue
        parameters: list[str] = []
        for effect in effects:
            parameters += [p.name for p in effect.parameters] or [effect.name]
        test = NextTest(
            name=name,
            how=effects[0].test.how,
            kind="direct",
            hours=hours,
            effects=effect_names,
            parameters=tuple(parameters),
            outcome=_predict_reading(diagnosis, effects),
        )
        tests.append(test)
    return tests


def _predict_reading(diagnosis: Diagnosis, effects: Sequence[Effect]) -> PredictedOutcome:
    """Predict the reading of a direct test, shares of the ranges of its d parameters.

    An effect without parameters reads 1 where it is present, else 0.
    """
    setting = diagnosis.model.setting
    absent: list[float] = []
    columns: dict[str, slice] = {}
    for effect in effects:
        shares = [p.share(p.neutral_of(setting)) for p in effect.parameters] or [0.0]
        columns[effect.name] = slice(len(absent), len(absent) + len(shares))
        absent += shares
    covariance = diagnosis.settings.test_error**2 * np.eye(len(absent))
    parts = {}
    for hypothesis, (fit, draws) in _plausible_fits(diagnosis).items():
        mean = np.tile(absent, (draws.size, 1))
        for effect in fit.space.effects:
            if effect.name not in columns:
                continue
            values: Array | float = 1.0
            if effect.parameters:
                values = fit.shares[draws][:, fit.space.columns(effect.name)]
            mean[:, columns[effect.name]] = values
        parts[hypothesis] = smooth_draws(mean, np.tile(covariance, (draws.size, 1, 1)))
    # Unknown: nothing, or one of the effects with a normal density as wide as its range.
    count = 1 + len(effects)
    unknown = Densities(
        share=np.zeros(count),
        mean=np.tile(absent, (count, 1)),
        covariance=np.tile(covariance, (count, 1, 1)),
    )
    for k, effect in enumerate(effects, start=1):
        effect_columns = np.arange(len(absent))[columns[effect.name]]
        if effect.parameters:
            unknown.mean[k, effect_columns] = 0.5
            unknown.covariance[k, effect_columns, effect_columns] += 1.0 / 12.0
            unknown.share[k] = 0.5 / len(effects)
        else:
            unknown.mean[k, effect_columns] = 1.0
            unknown.share[k] = diagnosis.settings.prior(effect.name) / len(effects)
    unknown.share[0] = 1.0 - unknown.share.sum()
    return PredictedOutcome.of(parts | {UNKNOWN: unknown}, lambda h: bool(set(columns) & set(h)))


def _locate(bench: Bench, cell: int) -> tuple[tuple[float, float], str]:
    """Look up mismatch, rad/s, and force, N, of an operating point, and both in words."""
    point = bench.cells[cell].point
    words = f"{number(point.mismatch / RPM)} 1/min and {number(point.profile.force)} N"
    return (point.mismatch, point.profile.force), words


def _further_tests(diagnosis: Diagnosis) -> list[NextTest]:
    """List more shifts at each operating point at which shifts can engage."""
    bench = diagnosis.bench
    hours, is_possible = terms_of(bench, "more shifts")
    if not is_possible:
        return []
    plausible_fits = _plausible_fits(diagnosis)
    leading = _select_draws(diagnosis.fits[_most_probable(diagnosis.posterior, diagnosis.fits)])
    is_engaging = np.isfinite(leading.fit.predicted.mean).all(axis=0)
    tests = []
    for cell, count in itertools.product(np.flatnonzero(is_engaging).tolist(), FURTHER_SHIFTS):
        point, words = _locate(bench, cell)
        name = f"{count} more shifts at {words}"
        parts = {}
        for h, fit in plausible_fits.items():
            parts[h] = _predict_shifts(diagnosis, fit, cell, count, is_known=True)
        parts[UNKNOWN] = _predict_shifts(diagnosis, leading, cell, count, is_known=False)
        test = NextTest(
            name=name,
            how=f"Record {name}, each with its own time.",
            kind="shifts",
            hours=hours + SHIFT_HOURS * count,
            cell=cell,
            point=point,
            shifts=count,
            outcome=PredictedOutcome.of(parts, lambda _: False),
        )
        tests.append(test)
    return tests


def _predict_shifts(
    diagnosis: Diagnosis, plausible: PlausibleFit, cell: int, shifts: int, *, is_known: bool
) -> Densities:
    """Predict mean time, s, and share engaged of more shifts at an operating point.

    ``is_known`` is False for an unknown cause on top of the fit.
    """
    fit, draws = plausible
    settings = diagnosis.settings
    observed = diagnosis.observed
    mean = fit.predicted.mean[draws, cell]
    variance = fit.predicted.sd[draws, cell] ** 2
    engaged = fit.predicted.engaged_share[draws, cell]
    error = max(settings.unlisted_sizes) * mean
    if is_known:
        model_error = np.maximum(settings.model_error * mean, settings.least_error)
        error = np.hypot(fit.predicted.error[draws, cell], model_error)
    # Of the residual an error of this point takes its share of the variance.
    precision = observed.count[cell] * error**2
    gain = precision / (precision + variance)
    plain_mean = mean + fit.offset[draws, cell]
    residual = observed.mean[cell] - plain_mean
    options = [(plain_mean + gain * residual, (1.0 - gain) * error**2)]
    if not is_known:  # a slip of the record does not come again
        options.append((plain_mean, error**2))
    share = np.clip(engaged, MIN_SHARE, 1.0 - MIN_SHARE)
    share_variance = share * (1.0 - share) / shifts + MIN_SHARE**2
    parts = []
    for option_mean, option_variance in options:
        mean_variance = option_variance + variance / np.maximum(1.0, shifts * share)
        diagonal = np.stack([mean_variance, share_variance], axis=1)
        covariance = diagonal[:, None, :] * np.eye(2)
        parts.append(smooth_draws(np.stack([option_mean, share], axis=1), covariance))
    densities = Densities.concatenate(parts)
    return densities._replace(share=densities.share / len(parts))


def _trace_tests(diagnosis: Diagnosis) -> list[NextTest]:
    """List traces at the smallest force without any; where unknown leads, at any force.

    Of these points at the one of the largest residual.
    """
    bench = diagnosis.bench
    observed = diagnosis.observed
    profiles = [cell.point.profile for cell in bench.cells]
    traced = {cell.point.profile for cell in bench.cells if cell.traces}
    cells = [k for k, profile in enumerate(profiles) if profile not in traced]
    tracing = terms_of(bench, "traces")
    if not cells or not tracing.is_possible:
        return []
    if _most_probable(diagnosis.posterior, diagnosis.posterior) != UNKNOWN:
        min_force = min(profiles[k].force for k in cells)
        cells = [k for k in cells if profiles[k].force == min_force]
    predicted = diagnosis.fits[_most_probable(diagnosis.posterior, diagnosis.fits)].predicted
    scatter = predicted.error**2 + predicted.sd**2 / np.maximum(1, observed.count)
    variance = predicted.mean.var(axis=0) + scatter.mean(axis=0)
    score = abs(observed.mean - predicted.mean.mean(axis=0)) / np.sqrt(variance)
    score = np.nan_to_num(score * (observed.count > 0))
    cell = max(cells, key=lambda k: float(score[k]))
    point, words = _locate(bench, cell)
    setup = terms_of(bench, "more shifts")
    return [
        NextTest(
            name=f"traces of {TRACED_SHIFTS} shifts at {words}",
            how="Record displacement, force and both speeds over time.",
            kind="traces",
            hours=setup.hours + tracing.hours + SHIFT_HOURS * TRACED_SHIFTS,
            cell=cell,
            point=point,
            shifts=TRACED_SHIFTS,
            outcome=_predict_traces(diagnosis, profiles[cell]),
        )
    ]


def _predict_traces(diagnosis: Diagnosis, profile: ForceProfile) -> PredictedOutcome:
    """Predict the marks of the flight of some traces, s."""
    freedom = diagnosis.settings.flight_freedom
    student_factor = freedom / (freedom - 2.0)
    baseline = diagnosis.flights.marks(NONE, np.zeros((1, 0)), profile)
    is_way = np.arange(SIZE) < len(WAYS)
    parts = {}
    for hypothesis, (fit, draws) in _plausible_fits(diagnosis).items():
        marks = diagnosis.flights.marks(
            fit.space.hypothesis, fit.values[draws], profile, exact=True
        )
        acting = np.broadcast_to(marks.times, (draws.size, SIZE))
        nominal = np.where(is_way, acting, baseline.times)
        covariance = student_factor * _mark_covariance(marks)
        readings = [smooth_draws(times, covariance) for times in (acting, nominal)]
        densities = Densities.concatenate(readings)
        parts[hypothesis] = densities._replace(share=0.5 * densities.share)
    # Unknown: the baseline's marks, or those of displacement, or all, moved by offsets.
    correlation = OFFSET_CORRELATION * (is_way[:, None] == is_way)
    correlation = correlation + (1.0 - OFFSET_CORRELATION) * np.eye(SIZE)
    offsets = [0.0 * correlation]
    for sd in OFFSET_SDS_S:
        for is_offset in (is_way, np.ones_like(is_way)):
            offsets.append(sd**2 * correlation * np.outer(is_offset, is_offset))
    count = len(offsets) - 1
    unknown = Densities(
        share=np.array([0.5, *[0.5 / count] * count]),
        mean=np.tile(baseline.times[0], (1 + count, 1)),
        covariance=student_factor * _mark_covariance(baseline) + np.array(offsets),
    )
    return PredictedOutcome.of(parts | {UNKNOWN: unknown}, lambda _: True)


def _mark_covariance(marks: Any) -> Array:
    """Compute the covariance of marks read from some traces, s^2, (k, SIZE, SIZE)."""
    times = marks.times.mean(axis=0)
    slopes = []
    for values, level_times in zip((WAYS, FORCES), np.split(times, [len(WAYS)]), strict=True):
        slopes.append(np.array(values) * np.gradient(level_times, values))
    # A mark's value over its slope; marks that never come have the time-out in common.
    reach = np.maximum(0.0, np.concatenate(slopes))
    sampling_variance = SAMPLING_STEP_S**2 / 12.0 / TRACED_SHIFTS
    common = model_covariance(np.arange(SIZE), times, reach) + sampling_variance
    creep = marks.creep[:, :, None] * marks.creep[:, None, :]
    return np.asarray(common + marks.error[:, :, None] ** 2 * np.eye(SIZE) + creep)
