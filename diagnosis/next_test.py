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
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.special import rel_entr

from dogshape.diagnosis.bench.bench_data import Bench
from dogshape.diagnosis.bench.flight_marks import FORCES, SIZE, WAYS, model_covariance
from dogshape.diagnosis.diagnosis import Diagnosis
from dogshape.diagnosis.inference.fit import Fit
from dogshape.diagnosis.inference.outcome import (
    EDGE,
    SETUP,
    SHIFT,
    TRACING,
    Densities,
    NextTest,
    Outcome,
    smoothed,
)
from dogshape.diagnosis.inference.verdict import nameable
from dogshape.diagnosis.settings import Settings
from dogshape.diagnosis.terms import NONE, UNKNOWN, Array, Hypothesis
from dogshape.sim.effect import Effect
from dogshape.sim.errors import DataError, number, require_known
from dogshape.sim.shift.actuation import ForceProfile
from dogshape.sim.units import RPM

LEAST = 5e-3  #: probability from which a hypothesis takes part
DRAWS = 64  #: of each posterior
ALIKE = 0.1  #: difference of chances to settle, within their error, below which the cost decides
MORE = (10, 40)  #: shifts that may be added at an operating point
TRACED = 10  #: shifts of which traces are recorded
GENERIC = ("more shifts", "traces")  #: tests that are no effect's own, by the names of a data set
DIRECT, ASKED = 3.0, 0.25  #: hours of another direct test, and of a question about the record
HOURS = {  #: to set up, or of direct tests: sensors at hand cost less than a clutch taken apart
    "more shifts": SETUP,
    "traces": TRACING,
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
RECORD = {  #: questions about the record
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
STEP = 1e-3  #: s, sampling step of a recording
MARK_SIZES = (1e-3, 4e-3, 0.014, 0.053, 0.2)  #: s, offsets of marks by an unknown cause
MARK_ALIKE = 0.9  #: of their variance, which marks of displacement or force have in common


def require_terms(bench: Bench, effects: Mapping[str, Effect]) -> None:
    """Raise InputError where a data set's terms are of no test, DataError where none is left."""
    menu = {*GENERIC, *(effect.test.name for effect in effects.values())}
    for terms in bench.tests:
        require_known(f"{bench.name}: name in [[tests]]", terms.name, "a bench test", menu)
    if not any(terms_of(bench, name)[1] for name in menu - {"traces"}):
        raise DataError(
            f"{bench.name}: [[tests]] leaves no bench test that is possible, but advice needs one; "
            "leave 'more shifts' or a direct test"
        )


def terms_of(bench: Bench, name: str) -> tuple[float, bool]:
    """Find the hours of a direct test, or to set up another, and whether a stand can do it."""
    own = [terms for terms in bench.tests if terms.name == name]
    hours = [HOURS.get(name, DIRECT), *(one.hours for one in own if one.hours is not None)]
    return hours[-1], all(one.possible for one in own)


def imitator_odds(settings: Settings) -> float:
    """Compute the prior odds of an imitator to its hypothesis."""
    return settings.unlisted * settings.imitated / (1.0 - settings.unlisted)


def choose(diagnosis: Diagnosis) -> tuple[NextTest, ...]:
    """Rank the tests of a diagnosis, the best first."""
    menu = {test.name: test for test in (*_direct_tests(diagnosis), *_questions(diagnosis))}
    tests = [*menu.values(), *_further_tests(diagnosis), *_trace_tests(diagnosis)]
    first, *others = _ranked(diagnosis, [_judged(diagnosis, one) for one in tests])
    # The best of many by drawn outcomes looks better than it is: its worth is of other draws.
    return (_judged(diagnosis, first, seed=2), *others)


def settle(
    diagnosis: Diagnosis, test: NextTest, outcome: Sequence[float] | str
) -> Mapping[Hypothesis, float]:
    """Update the probabilities by the outcome of a test; unchanged where nothing predicts it.

    ``outcome`` has the numbers of ``test.outcome``, NaN or less of them where one is not shown; of
    a question it is the answer's word.
    """
    if isinstance(outcome, str):
        answers = [r for r in diagnosis.readings if (r.key, r.value) == (test.question, outcome)]
        return answers[0].posterior
    if test.outcome is None or np.isnan(outcome).all():
        return diagnosis.posterior
    values = np.full(test.outcome.mean.shape[1], np.nan)
    values[: len(outcome)] = outcome
    part = test.outcome.only(np.isfinite(values))
    log = part.log_density(values[None, np.isfinite(values)])
    after = part.after(_before(diagnosis, part), log, imitator_odds(diagnosis.settings))[0]
    return dict(zip(part.hypotheses, after.tolist(), strict=True))


def _judged(diagnosis: Diagnosis, test: NextTest, seed: int = 1) -> NextTest:
    """Add its worth to a test whose outcome is predicted."""
    if test.outcome is None:
        return test
    odds, before = imitator_odds(diagnosis.settings), _before(diagnosis, test.outcome)
    worth = test.outcome.worth(before, odds, diagnosis.settings, seed)
    return replace(test, information=worth[0], settles=worth[1], misleads=worth[2])


def _before(diagnosis: Diagnosis, outcome: Outcome) -> Array:
    """Compute the probabilities of the hypotheses of an outcome; none of them is impossible."""
    found = np.array([max(1e-9, diagnosis.posterior.get(h, 0.0)) for h in outcome.hypotheses])
    return np.asarray(found / found.sum())


def _ranked(diagnosis: Diagnosis, tests: Sequence[NextTest]) -> list[NextTest]:
    """Order tests: those worth their cost by their value, all others by information an hour."""
    settings, top = diagnosis.settings, _leading(diagnosis.posterior)
    decided = diagnosis.posterior[top] > settings.named and nameable(top, settings)
    wrong = settings.named / (1.0 - settings.named)

    def sure(test: NextTest) -> float:
        return test.settles - wrong * test.misleads

    def rank(test: NextTest) -> tuple[bool, float]:
        value = sure(test) - settings.hour * test.hours
        worth = not decided and value > 0.0
        return not worth, -value if worth else -test.information / test.hours

    ranked = sorted(tests, key=rank)
    if top == UNKNOWN:
        near = [t for t in ranked if t.kind == "traces"]
    elif decided:
        near = [t for t in ranked if set(top) & set(t.effects) and t.hours <= ranked[0].hours]
    else:
        near = [t for t in ranked if not rank(t)[0] and sure(t) >= sure(ranked[0]) - ALIKE]
    first = min(near, key=lambda t: (t.hours, t.kind != "direct"), default=None)
    return sorted(ranked, key=lambda t: t is not first)


def _leading(chances: Mapping[Hypothesis, float], among: Any = None) -> Hypothesis:
    """Find the most probable hypothesis, among some."""
    return max(chances if among is None else among, key=lambda h: chances.get(h, 0.0))


def _plausible(diagnosis: Diagnosis) -> dict[Hypothesis, tuple[Fit, np.ndarray]]:
    """List the known hypotheses that take part, each with its fit and some of its draws."""
    known = [h for h, p in diagnosis.posterior.items() if p > LEAST and h in diagnosis.fits]
    return {h: (diagnosis.fits[h], _rows(diagnosis.fits[h])) for h in known}


def _rows(fit: Fit) -> np.ndarray:
    count = len(fit.shares)
    return np.linspace(0, count - 1, min(count, DRAWS)).astype(int)


def _questions(diagnosis: Diagnosis) -> list[NextTest]:
    """List the questions about the record whose answers are weighed, with their worth."""
    found = []
    for key in dict.fromkeys(one.key for one in diagnosis.readings):
        answers = [one for one in diagnosis.readings if one.key == key]
        chance = np.array([one.probability for one in answers])
        chance = chance / chance.sum()
        every = dict.fromkeys(h for one in answers for h in one.posterior)
        after = np.array([[one.posterior.get(h, 0.0) for h in every] for one in answers])
        gain = float((rel_entr(after, chance @ after) * chance[:, None]).sum())
        best = after.max(axis=1)
        decided = np.array([one.verdict.kind != "ambiguous" for one in answers])
        right, wrong = (float(chance @ (decided * one)) for one in (best, 1.0 - best))
        name, how = RECORD[key]
        effects = tuple(e.name for e in diagnosis.effects.values() if e.test.name == name)
        found.append(NextTest(
            name, how, "record", ASKED, effects,
            question=key, information=gain, settles=right, misleads=wrong,
        ))  # fmt: skip
    return found


def _direct_tests(diagnosis: Diagnosis) -> list[NextTest]:
    """List the direct tests of the effects, but for those whose results are known."""
    bench, known = diagnosis.bench, {one.effect for one in diagnosis.bench.measured}
    grouped: dict[str, list[Effect]] = {}
    for effect in diagnosis.effects.values():
        grouped.setdefault(effect.test.name, []).append(effect)
    return [
        NextTest(
            name, those[0].test.how, "direct", hours, tuple(effect.name for effect in those),
            tuple(p for e in those for p in [q.name for q in e.parameters] or [e.name]),
            outcome=_read(diagnosis, those),
        )
        for name, those in grouped.items() for hours, possible in [terms_of(bench, name)]
        if possible and not {effect.name for effect in those} <= known
    ]  # fmt: skip


def _read(diagnosis: Diagnosis, effects: Sequence[Effect]) -> Outcome:
    """Predict a direct test; an effect without parameters reads 1 where it is there, else 0."""
    setting, settings = diagnosis.model.setting, diagnosis.settings
    neutral = [[p.share(p.neutral_of(setting)) for p in e.parameters] or [0.0] for e in effects]
    absent, ends = np.concatenate(neutral), np.cumsum([0, *map(len, neutral)]).tolist()
    places = {e.name: slice(*ends[k : k + 2]) for k, e in enumerate(effects)}
    errors = settings.test_error**2 * np.eye(absent.size)
    parts = {}
    for hypothesis, (fit, rows) in _plausible(diagnosis).items():
        mean = np.tile(absent, (rows.size, 1))
        for effect in fit.space.effects:
            if effect.name in places:
                shares = fit.shares[rows][:, fit.space.columns(effect.name)]
                mean[:, places[effect.name]] = shares if effect.parameters else 1.0
        parts[hypothesis] = smoothed(mean, np.tile(errors, (rows.size, 1, 1)))
    # Unknown: nothing, or one of the effects with a normal density as wide as its range.
    mean = np.tile(absent, (1 + len(effects), 1))
    covariance, share = np.tile(errors, (len(mean), 1, 1)), np.zeros(len(mean))
    for k, effect in enumerate(effects, start=1):
        place, sized = places[effect.name], bool(effect.parameters)
        mean[k, place] = 0.5 if sized else 1.0
        wide = np.arange(absent.size)[place]
        covariance[k, wide, wide] += sized / 12.0
        share[k] = (0.5 if sized else settings.prior(effect.name)) / len(effects)
    share[0] = 1.0 - share.sum()
    every = parts | {UNKNOWN: (share, mean, covariance)}
    return Outcome.of(every, lambda h: bool(set(places) & set(h)))


def _where(bench: Bench, cell: int) -> tuple[tuple[float, float], str]:
    mismatch, force = bench.cells[cell].point.mismatch, bench.cells[cell].point.profile.force
    return (mismatch, force), f"{number(mismatch / RPM)} 1/min and {number(force)} N"


def _further_tests(diagnosis: Diagnosis) -> list[NextTest]:
    """List more shifts at each operating point at which shifts can engage."""
    bench, found, known = diagnosis.bench, [], _plausible(diagnosis)
    hours, possible = terms_of(bench, "more shifts")
    if not possible:
        return []
    like = diagnosis.fits[_leading(diagnosis.posterior, diagnosis.fits)]
    engaging = np.flatnonzero(np.isfinite(like.predicted.mean).all(axis=0)).tolist()
    for cell, count in itertools.product(engaging, MORE):
        point, words = _where(bench, cell)
        name = f"{count} more shifts at {words}"
        parts = {h: _further(diagnosis, *known[h], cell, count, known=True) for h in known}
        parts[UNKNOWN] = _further(diagnosis, like, _rows(like), cell, count, known=False)
        found.append(NextTest(
            name, f"Record {name}, each with its own time.", "shifts", hours + SHIFT * count,
            cell=cell, point=point, shifts=count, outcome=Outcome.of(parts, lambda _: False),
        ))  # fmt: skip
    return found


def _further(
    diagnosis: Diagnosis, fit: Fit, rows: np.ndarray, cell: int, shifts: int, *, known: bool
) -> Densities:
    """Predict mean time and share engaged of more shifts at an operating point."""
    seen, settings = diagnosis.seen, diagnosis.settings
    mean, sd, error, engaged = (
        getattr(fit.predicted, name)[rows, cell] for name in ("mean", "sd", "error", "engaged")
    )
    own = np.maximum(settings.model_error * mean, settings.least_error)
    error = np.hypot(error, own) if known else max(settings.unlisted_sizes) * mean
    # Of the residual an error of this point takes its share of the variance.
    precision = seen.count[cell] * error**2
    gain, plain = precision / (precision + sd**2), mean + fit.offset[rows, cell]
    options = [(plain + gain * (seen.mean[cell] - plain), (1.0 - gain) * error**2)]
    options += [] if known else [(plain, error**2)]
    share = np.clip(engaged, EDGE, 1.0 - EDGE)
    spread = share * (1.0 - share) / shifts + EDGE**2
    parts = []
    for mean, variance in options:
        scatter = variance + sd**2 / np.maximum(1.0, shifts * share)
        both = np.stack([scatter, spread], axis=1)[:, None, :] * np.eye(2)
        parts.append(smoothed(np.stack([mean, share], axis=1), both))
    of, means, covariances = (np.concatenate(part) for part in zip(*parts, strict=True))
    return of / len(parts), means, covariances


def _trace_tests(diagnosis: Diagnosis) -> list[NextTest]:
    """List traces at the least force without any; at the largest residual where unknown leads."""
    bench, seen = diagnosis.bench, diagnosis.seen
    profiles = [cell.point.profile for cell in bench.cells]
    traced = {cell.point.profile for cell in bench.cells if cell.traces}
    cells = [k for k, profile in enumerate(profiles) if profile not in traced]
    (setup, _), (tracing, possible) = (terms_of(bench, name) for name in GENERIC)
    if not cells or not possible:
        return []
    if _leading(diagnosis.posterior) != UNKNOWN:
        least = min(profiles[k].force for k in cells)
        cells = [k for k in cells if profiles[k].force == least]
    one = diagnosis.fits[_leading(diagnosis.posterior, diagnosis.fits)].predicted
    scatter = (one.error**2 + one.sd**2 / np.maximum(1, seen.count)).mean(axis=0)
    score = abs(seen.mean - one.mean.mean(axis=0)) / np.sqrt(one.mean.var(axis=0) + scatter)
    cell = max(cells, key=lambda k: float(np.nan_to_num(score[k] * (seen.count[k] > 0))))
    point, words = _where(bench, cell)
    how = "Record displacement, force and both speeds over time."
    hours = setup + tracing + SHIFT * TRACED
    return [NextTest(
        f"traces of {TRACED} shifts at {words}", how, "traces", hours, cell=cell, point=point,
        shifts=TRACED, outcome=_flown(diagnosis, profiles[cell]),
    )]  # fmt: skip


def _flown(diagnosis: Diagnosis, profile: ForceProfile) -> Outcome:
    """Predict the marks of the flight of some traces."""
    freedom, marks = diagnosis.settings.flight_freedom, diagnosis.flights.marks
    wider = freedom / (freedom - 2.0)
    still, way = marks(NONE, np.zeros((1, 0)), profile), np.arange(SIZE) < len(WAYS)
    parts = {}
    for hypothesis, (fit, rows) in _plausible(diagnosis).items():
        found = marks(fit.space.hypothesis, fit.values[rows], profile, exact=True)
        times, errors = np.broadcast_to(found.times, (rows.size, SIZE)), wider * _errors(found)
        both = [smoothed(one, errors) for one in (times, np.where(way, times, still.times))]
        share, mean, whole = (np.concatenate(part) for part in zip(*both, strict=True))
        parts[hypothesis] = 0.5 * share, mean, whole
    # Unknown: the baseline's marks, or those of displacement, or all, moved by offsets.
    alike = MARK_ALIKE * (way[:, None] == way) + (1.0 - MARK_ALIKE) * np.eye(SIZE)
    kernels = [s**2 * alike * np.outer(w, w) for s in MARK_SIZES for w in (way, way | True)]
    covariance = wider * _errors(still) + np.array([0.0 * alike, *kernels])
    share = np.array([0.5, *[0.5 / len(kernels)] * len(kernels)])
    mean = np.tile(still.times[0], (share.size, 1))
    return Outcome.of(parts | {UNKNOWN: (share, mean, covariance)}, lambda _: True)


def _errors(found: Any) -> Array:
    """Compute the covariance of marks read from some traces, s^2, (k, SIZE, SIZE)."""
    times = found.times.mean(axis=0)
    parts = zip((WAYS, FORCES), np.split(times, [len(WAYS)]), strict=True)
    slopes = [np.array(values) * np.gradient(part, values) for values, part in parts]
    # A mark's value over its slope; marks that never come have the time-out in common.
    reach = np.maximum(0.0, np.concatenate(slopes))
    common = model_covariance(np.arange(SIZE), times, reach) + STEP**2 / 12.0 / TRACED
    creep = found.creep[:, :, None] * found.creep[:, None, :]
    return np.asarray(common + found.error[:, :, None] ** 2 * np.eye(SIZE) + creep)
