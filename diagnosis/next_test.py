"""Next bench test: the menu of a stand with cost and worth, and its order.

Direct tests read the parameters of effects with the errors of their instruments, neutral where the
effect is absent. More shifts at an operating point give a mean time and a share that engages;
traces give the marks of the flight. *Unknown* predicts as well: a direct test finds nothing or
anything, half and half, and its offset of a mean comes again or, a slip of the record, does not.

Tests are ranked by their gain per hour (``inference.outcome``), equal ones by hours. Where the
cause is named, or no test earns its hours, the direct test of the least supported effect of the
answer leads: of that effect whose removal or replacement costs the least probability. Where
*unknown* leads, traces do.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from scipy.special import rel_entr
from scipy.stats import qmc

from dogshape.bench.bench_data import Bench
from dogshape.bench.flight_marks import FORCES, SIZE, WAYS, model_covariance
from dogshape.diagnosis.diagnosis import Inference, RecordMeaning
from dogshape.diagnosis.inference.fit import Fit
from dogshape.diagnosis.inference.outcome import (
    OUTCOME_DRAWS,
    SETUP_HOURS,
    SHIFT_HOURS,
    TRACING_HOURS,
    Densities,
    NextTest,
    PredictedOutcome,
    answer_gain,
    smooth_draws,
)
from dogshape.diagnosis.report.wording import amount, quantity
from dogshape.diagnosis.settings import Settings
from dogshape.diagnosis.terms import (
    NONE,
    UNKNOWN,
    Array,
    Hypothesis,
    hypothesis_name,
    join_words,
)
from dogshape.sim.effect import Effect, InstrumentError, Parameter
from dogshape.sim.errors import DataError, number, require_known
from dogshape.sim.setting import Setting
from dogshape.sim.shift.actuation import ForceProfile
from dogshape.sim.units import RPM

MIN_PROBABILITY = 5e-3  #: from which a hypothesis predicts a test
POSTERIOR_DRAWS = 64  #: of each hypothesis
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
UNKNOWN_VALUES = 32  #: of an effect's range, which a test may read of an unlisted cause
MAX_REFUTED = 0.05  #: probability of the answer after a word that refutes it
FINALISTS = 6  #: leading tests, that are ranked again
FINAL_DRAWS = 4 * OUTCOME_DRAWS  #: outcomes drawn of each of these
GAIN_STEP = 1e-3  #: per hour, to which gains are compared
SAMPLING_STEP_S = 1e-3  #: s, of a recording
OFFSET_SDS_S = (1e-3, 4e-3, 0.014, 0.053, 0.2)  #: s, offsets of marks by an unknown cause
OFFSET_CORRELATION = 0.9  #: of offsets between marks of displacement, and between those of force


class PlausibleFit(NamedTuple):
    """Fit of a hypothesis and the indices of some of its draws."""

    fit: Fit
    draws: np.ndarray


class ReadQuantity(NamedTuple):
    """Quantity that a direct test reads."""

    effect: Effect
    parameter: Parameter | None  #: None where presence is read, 1 or 0
    neutral: float  #: value without the effect
    error: InstrumentError


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


def rank_tests(diagnosis: Inference) -> tuple[NextTest, ...]:
    """Rank the tests of a diagnosis, the best first."""
    tests_by_name = {}
    for test in (*_direct_tests(diagnosis), *_questions(diagnosis)):
        tests_by_name[test.name] = test
    tests = [*tests_by_name.values(), *_further_tests(diagnosis), *_trace_tests(diagnosis)]
    tests = [replace(test, refutes=_refutation(diagnosis, test)) for test in tests]
    ranked = _order_tests(diagnosis, [_add_worth(diagnosis, test) for test in tests])
    # The best of many by drawn outcomes look better than they are: their worth is of other draws.
    finalists = [
        _add_worth(diagnosis, test, seed=2, draw_count=FINAL_DRAWS) for test in ranked[:FINALISTS]
    ]
    return (*_order_tests(diagnosis, finalists), *ranked[FINALISTS:])


def update_posterior(
    diagnosis: Inference, test: NextTest, outcome: Sequence[float] | str
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


def _add_worth(
    diagnosis: Inference, test: NextTest, seed: int = 1, draw_count: int = OUTCOME_DRAWS
) -> NextTest:
    """Add its worth to a test whose outcome is predicted."""
    if test.outcome is None:
        return test
    odds = imitator_odds(diagnosis.settings)
    prior = _prior(diagnosis, test.outcome)
    worth = test.outcome.worth(prior, odds, diagnosis.settings, seed, draw_count)
    return replace(test, **worth._asdict())


def _prior(diagnosis: Inference, outcome: PredictedOutcome) -> Array:
    """Compute the probabilities of an outcome's hypotheses before the test, all above 0."""
    posterior = diagnosis.posterior
    prior = np.array([max(1e-9, posterior.get(h, 0.0)) for h in outcome.hypotheses])
    return np.asarray(prior / prior.sum())


def _order_tests(diagnosis: Inference, tests: Sequence[NextTest]) -> list[NextTest]:
    """Order tests by gain per hour; the test that a decided or open answer needs leads."""
    settings = diagnosis.settings
    posterior = diagnosis.posterior
    top = _most_probable(posterior, posterior)
    ordered = sorted(tests, key=lambda t: (-round(t.gain_per_hour / GAIN_STEP), t.hours))
    is_decided = settings.names(top, posterior[top])
    candidates: list[NextTest] = []
    if top == UNKNOWN:
        candidates = [test for test in ordered if test.kind == "traces"]
    elif is_decided or max(test.gain_per_hour for test in tests) < settings.hour:
        for name in rank_support(posterior, top):
            candidates += [t for t in ordered if t.kind == "direct" and name in t.effects]
    first = candidates[0] if candidates else ordered[0]
    return sorted(ordered, key=lambda test: test is not first)


def rank_support(posterior: Mapping[Hypothesis, float], hypothesis: Hypothesis) -> list[str]:
    """Rank the effects of a hypothesis, the least supported first.

    The support of an effect is the ratio of the probabilities of the hypothesis and of the best one
    that lacks the effect, or has another one in its place.
    """
    rivals = {}
    for name in hypothesis:
        remaining = {*hypothesis} - {name}
        probabilities = [
            probability
            for rival, probability in posterior.items()
            if rival != UNKNOWN
            and name not in rival
            and remaining <= {*rival}
            and len(rival) <= len(hypothesis)
        ]
        rivals[name] = max(probabilities, default=0.0)
    return sorted(hypothesis, key=lambda name: -rivals[name])


def _most_probable(
    posterior: Mapping[Hypothesis, float], candidates: Iterable[Hypothesis]
) -> Hypothesis:
    """Find the most probable of some hypotheses."""
    return max(candidates, key=lambda h: posterior.get(h, 0.0))


def _plausible_fits(diagnosis: Inference) -> dict[Hypothesis, PlausibleFit]:
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


def _questions(diagnosis: Inference) -> list[NextTest]:
    """List the questions about the record whose answers have a probability, with their worth."""
    keys = dict.fromkeys(meaning.key for meaning in diagnosis.record_meanings)
    return [_question(diagnosis, key) for key in keys]


def _question(diagnosis: Inference, key: str) -> NextTest:
    """Build the question about a key of the record."""
    answers: list[RecordMeaning] = [m for m in diagnosis.record_meanings if m.key == key]
    chance = np.array([answer.probability for answer in answers])
    chance = chance / chance.sum()
    hypotheses = dict.fromkeys(
        itertools.chain.from_iterable(answer.posterior for answer in answers)
    )
    posterior = np.array([[a.posterior.get(h, 0.0) for h in hypotheses] for a in answers])
    before = chance @ posterior
    information = float((rel_entr(posterior, before) * chance[:, None]).sum())
    best = posterior.max(axis=1)
    is_decided = np.array([answer.verdict.kind != "ambiguous" for answer in answers])
    settles = float(chance @ (is_decided * best))
    misleads = float(chance @ (is_decided * (1.0 - best)))
    top = [*hypotheses][int(before.argmax())]
    if diagnosis.settings.names(top, float(before.max())):
        settles -= float(before.max())
        misleads -= 1.0 - float(before.max())
    name, how = RECORD_QUESTIONS[key]
    return NextTest(
        name=name,
        how=how,
        kind="record",
        hours=QUESTION_HOURS,
        effects=tuple(e.name for e in diagnosis.effects.values() if e.test.name == name),
        question=key,
        information=information,
        gain=answer_gain(before, posterior, chance),
        settles=settles,
        misleads=misleads,
    )


def _direct_tests(diagnosis: Inference) -> list[NextTest]:
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


def quantities_of(
    effects: Iterable[Effect], setting: Setting, presence_error: float
) -> list[ReadQuantity]:
    """List the parameters, or the presence, that a direct test of some effects reads.

    ``presence_error`` is the error of a presence, 1 or 0.
    """
    quantities = []
    for effect in effects:
        neutral = effect.neutral(setting)
        for parameter in effect.parameters:
            error = effect.instrument_error(parameter)
            quantities.append(ReadQuantity(effect, parameter, neutral[parameter.name], error))
        if not effect.parameters:
            source = "assumption: look at the stand"
            error = InstrumentError(effect.name, 0.0, presence_error, source)
            quantities.append(ReadQuantity(effect, None, 0.0, error))
    return quantities


def _reading_covariance(quantities: Sequence[ReadQuantity], values: Array) -> Array:
    """Compute the covariance of readings of values (k, d), (k, d, d)."""
    columns = zip(quantities, values.T, strict=True)
    sds = np.stack([read.error.at(column) for read, column in columns], axis=1)
    return np.asarray(sds[:, :, None] ** 2 * np.eye(len(quantities)))


def _predict_reading(diagnosis: Inference, effects: Sequence[Effect]) -> PredictedOutcome:
    """Predict the reading of a direct test, values of its d parameters.

    An effect without parameters reads 1 where it is present, else 0.
    """
    presence_error = diagnosis.settings.presence_error
    quantities = quantities_of(effects, diagnosis.model.setting, presence_error)
    absent = [read.neutral for read in quantities]
    columns: dict[str, list[int]] = {}
    for column, read in enumerate(quantities):
        columns.setdefault(read.effect.name, []).append(column)
    parts = {}
    for hypothesis, (fit, draws) in _plausible_fits(diagnosis).items():
        values = np.tile(absent, (draws.size, 1))
        for effect in fit.space.effects:
            if effect.name not in columns:
                continue
            values[:, columns[effect.name]] = 1.0
            if effect.parameters:
                sizes = fit.values[draws][:, fit.space.columns(effect.name)]
                values[:, columns[effect.name]] = sizes
        parts[hypothesis] = smooth_draws(values, _reading_covariance(quantities, values))
    # Unknown: nothing, or one of the effects with any value of its range.
    nothing = np.array([absent])
    unlisted = [Densities(np.ones(1), nothing, _reading_covariance(quantities, nothing))]
    for effect in effects:
        share = 0.5 / len(effects)
        count = UNKNOWN_VALUES
        if not effect.parameters:
            share = diagnosis.settings.prior(effect.name) / len(effects)
            count = 1
        values = np.tile(absent, (count, 1))
        values[:, columns[effect.name]] = _range_values(effect, count)
        densities = smooth_draws(values, _reading_covariance(quantities, values))
        unlisted[0] = unlisted[0]._replace(share=unlisted[0].share - share)
        unlisted.append(densities._replace(share=share * densities.share))
    parts[UNKNOWN] = Densities.concatenate(unlisted)
    return PredictedOutcome.of(parts, lambda h: bool(set(columns) & set(h)))


def _range_values(effect: Effect, count: int) -> Array:
    """List values that fill the ranges of an effect's parameters, (count, d); 1 without any."""
    if not effect.parameters:
        return np.ones((count, 1))
    shares = qmc.Sobol(len(effect.parameters), seed=1).random(count)
    columns = zip(effect.parameters, shares.T, strict=True)
    return np.stack([parameter.at(column) for parameter, column in columns], axis=1)


def _refutation(diagnosis: Inference, test: NextTest) -> str:
    """Write a sentence with the result of a test that refutes the most probable known hypothesis.

    The hypothesis gives such a result or a further one with the p-value that refutes it; after a
    word of the record it has 5 % at most.
    """
    answer = _most_probable(diagnosis.posterior, diagnosis.fits)
    words = _claim(diagnosis, answer)
    if test.kind == "record":
        meanings = [m for m in diagnosis.record_meanings if m.key == test.question]
        refuting = [m.value for m in meanings if m.posterior.get(answer, 0.0) <= MAX_REFUTED]
        quoted = join_words([f"'{value}'" for value in refuting], "or")
        return f"The answer {quoted} refutes {words}." if refuting else ""
    if test.outcome is None or answer not in test.outcome.hypotheses:
        return ""
    if test.kind == "direct":
        return _refuting_reading(diagnosis, test, answer)
    column = 0
    label = f"A mean time of the {test.shifts} shifts"
    if test.kind == "traces":
        column = _clearest_mark(test.outcome, answer)
        label = f"A mean time until {_mark_name(column)}"
    ends = test.outcome.interval(answer, column, diagnosis.settings.adequate)
    return f"{label} outside {amount('time_s', *ends, digits=3)} refutes {words}."


def _claim(diagnosis: Inference, hypothesis: Hypothesis) -> str:
    """Write a hypothesis in words, as the object of a sentence."""
    if hypothesis == NONE:
        return "that no effect acts"
    return hypothesis_name(hypothesis, diagnosis.effects)


def _refuting_reading(diagnosis: Inference, test: NextTest, answer: Hypothesis) -> str:
    """Write a sentence with the reading of a direct test that refutes a hypothesis.

    Of several parameters the one that the hypothesis moves furthest; without any, the first.
    """
    assert test.outcome is not None
    effects = [diagnosis.effects[name] for name in test.effects]
    words = _claim(diagnosis, answer)
    distances = []
    intervals = []
    presence_error = diagnosis.settings.presence_error
    quantities = quantities_of(effects, diagnosis.model.setting, presence_error)
    for column, read in enumerate(quantities):
        low, high = test.outcome.interval(answer, column, diagnosis.settings.adequate)
        distance = max(low - read.neutral, read.neutral - high) / (high - low)
        distances.append(distance if read.effect.name in answer else -np.inf)
        intervals.append((read, low, high))
    read, low, high = intervals[int(np.argmax(distances))]
    name = read.error.parameter
    if not {*test.effects} & {*answer}:
        if answer != NONE:
            words = f"{words} as the whole cause"
        if read.parameter is None:
            return f"The presence of {read.effect.plain} refutes {words}."
        if read.parameter.low >= read.neutral:
            return f"A reading of {quantity(name)} above {amount(name, high)} refutes {words}."
        return f"A reading of {quantity(name)} outside {amount(name, low, high)} refutes {words}."
    if read.parameter is None:
        return f"The absence of {read.effect.plain} refutes {words}."
    if max(distances) <= 0.0:
        return (
            f"No reading refutes {words} by itself: with the effect {quantity(name)} reads "
            f"{amount(name, low, high)}, without it {amount(name, read.neutral)}."
        )
    side, limit = ("below", low) if read.neutral < low else ("above", high)
    return f"A reading of {quantity(name)} {side} {amount(name, limit)} refutes {words}."


def _clearest_mark(outcome: PredictedOutcome, answer: Hypothesis) -> int:
    """Find the mark in which a hypothesis differs most from the others, an index."""
    is_answer = outcome.hypothesis_index == outcome.hypotheses.index(answer)
    means = outcome.share[is_answer] @ outcome.mean[is_answer]
    variances = np.diagonal(outcome.covariance[is_answer], axis1=1, axis2=2)
    variance = outcome.share[is_answer] @ (variances + (outcome.mean[is_answer] - means) ** 2)
    distance = abs(outcome.mean[~is_answer] - means) / np.sqrt(variance)
    return int(distance.mean(axis=0).argmax())


def _mark_name(column: int) -> str:
    """Write the event that a mark of the flight times."""
    if column < len(WAYS):
        return f"the displacement reaches {100.0 * WAYS[column]:.0f} % of the axial gap"
    return f"the force reaches {100.0 * FORCES[column - len(WAYS)]:.0f} % of its final value"


def _locate(bench: Bench, cell: int) -> tuple[tuple[float, float], str]:
    """Look up mismatch, rad/s, and force, N, of an operating point, and both in words."""
    point = bench.cells[cell].point
    words = f"{number(point.mismatch / RPM)} 1/min and {number(point.profile.force)} N"
    return (point.mismatch, point.profile.force), words


def _further_tests(diagnosis: Inference) -> list[NextTest]:
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
    diagnosis: Inference, plausible: PlausibleFit, cell: int, shifts: int, *, is_known: bool
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
    share_error = settings.engaged_error
    share = np.clip(engaged, share_error, 1.0 - share_error)
    share_variance = share * (1.0 - share) / shifts + share_error**2
    parts = []
    for option_mean, option_variance in options:
        mean_variance = option_variance + variance / np.maximum(1.0, shifts * share)
        diagonal = np.stack([mean_variance, share_variance], axis=1)
        covariance = diagonal[:, None, :] * np.eye(2)
        parts.append(smooth_draws(np.stack([option_mean, share], axis=1), covariance))
    densities = Densities.concatenate(parts)
    return densities._replace(share=densities.share / len(parts))


def _trace_tests(diagnosis: Inference) -> list[NextTest]:
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


def _predict_traces(diagnosis: Inference, profile: ForceProfile) -> PredictedOutcome:
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
