"""Next bench test: the menu of a stand with cost and worth, and its order.

Direct tests read the parameters of effects as shares of their ranges, with the neutral value where
the effect is absent; effects that share a test share its outcome. More shifts at an operating point
give a mean time and a share that engages; an error of that point comes again as far as the data
show it. Traces give the marks of the flight, where the force is that which acts or the nominal one.
A question about the record has the probabilities of each answer. *Unknown* predicts as well: a
direct test finds nothing or anything, half and half, and an offset of its own size comes again.

The value of a test is its chance to settle, less four times its chance to mislead, less 0.04 for
each hour: a hypothesis is named from 0.8, so a wrong name costs as much as four right ones gain. Of
tests that settle about as surely the cheapest leads. Where no test is worth its cost, or the cause
is named, the information an hour decides, and the direct test of a named cause leads if it costs no
more than the first. Where *unknown* leads, traces show where along the shift the residual arises.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Literal, Protocol

import numpy as np
from scipy.special import rel_entr

from dogshape.diagnosis.bench.bench_data import Bench
from dogshape.diagnosis.bench.flight_marks import FORCES, SIZE, WAYS, model_covariance
from dogshape.diagnosis.inference.outcome import Densities, Outcome, smoothed
from dogshape.diagnosis.terms import NONE, UNKNOWN, Array, Hypothesis
from dogshape.sim.effect import Effect
from dogshape.sim.errors import DataError, did_you_mean, number
from dogshape.sim.shift.actuation import ForceProfile
from dogshape.sim.units import RPM

if TYPE_CHECKING:
    from dogshape.diagnosis.inference.fit import Fit
    from dogshape.diagnosis.likelihood.observed import Observed
    from dogshape.diagnosis.prediction.model import Model
    from dogshape.diagnosis.settings import Settings

LEAST = 5e-3  #: probability from which a hypothesis takes part
DRAWS = 64  #: of each posterior
ALIKE = 0.1  #: difference of chances to settle, within their error, below which the cost decides
MORE = (10, 40)  #: shifts that may be added at an operating point
TRACED = 10  #: shifts of which traces are recorded
SETUP, TRACING, SHIFT = 0.5, 1.5, 0.02  #: hours for an operating point, for traces, for a shift
#: Tests that are no effect's own, by the names of a data set, with their hours to set up.
GENERIC = {"more shifts": SETUP, "traces": TRACING}
DIRECT, ASKED = 3.0, 0.25  #: hours of another direct test, and of a question about the record
HOURS = {  #: of direct tests: sensors at hand cost less than a clutch taken apart
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
    "empty_cells": ("shifts without a time", "Look up whether they were tried and failed."),
}
EDGE = 0.02  #: least share of shifts that engage or fail, and its simulated error
STEP = 1e-3  #: s, sampling step of a recording
MARK_SIZES = (1e-3, 4e-3, 0.014, 0.053, 0.2)  #: s, offsets of marks by an unknown cause
MARK_ALIKE = 0.9  #: of their variance, which marks of displacement or force have in common

#: Marks of the flight of a hypothesis at values (m, p): times, error, creep, (m, SIZE), s.
Marks = Callable[[Hypothesis, Array, ForceProfile], Any]


@dataclass(frozen=True)
class NextTest:
    """Bench test with its cost in hours and its worth.

    Parameters
    ----------
    effects, parameters : that a direct test reads, in the order of its outcome.
    cell, point, shifts : place of the operating point, its mismatch in rad/s and force in N, and
        the number of shifts there.
    question : key of the record in question.
    information : nats; None where no hypothesis predicts the outcome.
    settles, misleads : chances.
    foreseen : mean and standard deviation of each hypothesis' outcome: shares of the ranges, mean
        time in s and share engaged, or marks in s.
    """

    name: str
    how: str
    kind: Literal["direct", "shifts", "traces", "record"]
    hours: float
    effects: tuple[str, ...] = ()
    parameters: tuple[str, ...] = ()
    cell: int | None = None
    point: tuple[float, float] | None = None
    shifts: int = 0
    question: str = ""
    information: float | None = None
    settles: float = 0.0
    misleads: float = 0.0
    foreseen: Mapping[Hypothesis, tuple[Array, Array]] | None = None

    @property
    def why(self) -> str:
        """Sentences of the test, its chance to settle the cause and its cost."""
        cost = f"({number(self.hours)} h of work)"
        if self.information is None:
            return f"{self.how} They show where along the shift the residual arises {cost}."
        return f"{self.how} Chance to settle the cause: {100.0 * self.settles:.0f} % {cost}."

    def to_dict(self) -> dict[str, Any]:
        """Give the record ``next_test``."""
        predicted = self.information is not None
        record: dict[str, Any] = {
            "name": self.name,
            "why": self.why,
            "kind": self.kind,
            "information_nats": self.information,
            "chance_to_settle": self.settles if predicted else None,
            "misleads": self.misleads if predicted else None,
            "hours": self.hours,
        }
        if self.kind == "direct":
            record["parameters"] = list(self.parameters)
        if self.point is not None:
            record["mismatch_rpm"], record["force_N"] = self.point[0] / RPM, self.point[1]
            record["shifts"] = self.shifts
        record["foreseen"] = [
            {"effects": list(h), "mean": mean.tolist(), "sd": sd.tolist()}
            for h, (mean, sd) in (self.foreseen or {}).items()
        ]
        return record


class Findings(Protocol):
    """Parts of a diagnosis that advice rests on, as ``diagnosis.diagnosis`` has them."""

    @property
    def bench(self) -> Bench: ...  # noqa: D102
    @property
    def effects(self) -> Mapping[str, Effect]: ...  # noqa: D102
    @property
    def settings(self) -> Settings: ...  # noqa: D102
    @property
    def posterior(self) -> Mapping[Hypothesis, float]: ...  # noqa: D102
    @property
    def fits(self) -> Mapping[Hypothesis, Fit]: ...  # noqa: D102
    @property
    def readings(self) -> Sequence[Any]: ...  # noqa: D102
    @property
    def model(self) -> Model: ...  # noqa: D102
    @property
    def seen(self) -> Observed: ...  # noqa: D102


def require_terms(bench: Bench, effects: Mapping[str, Effect]) -> None:
    """Raise DataError where a data set's terms are of no test, or leave none to advise."""
    menu = {*GENERIC, *(effect.test.name for effect in effects.values())}
    for terms in bench.tests:
        if terms.name not in menu:
            hint = did_you_mean(terms.name, menu)
            raise DataError(f"{bench.name}: '{terms.name}' in [[tests]] is no bench test; {hint}")
    if not any(possible(bench, name) for name in menu - {"traces"}):
        raise DataError(
            f"{bench.name}: [[tests]] leaves no bench test that is possible, but advice needs one; "
            "leave 'more shifts' or a direct test"
        )


def possible(bench: Bench, name: str) -> bool:
    """Decide whether a stand can do a test, by its data set."""
    return all(terms.possible for terms in bench.tests if terms.name == name)


def hours_of(bench: Bench, name: str) -> float:
    """Find the hours of a direct test, or to set up another, at a stand."""
    own = [t.hours for t in bench.tests if t.name == name and t.hours is not None]
    return own[-1] if own else GENERIC.get(name, HOURS.get(name, DIRECT))


def imitator_odds(settings: Settings) -> float:
    """Compute the prior odds of an imitator to its hypothesis."""
    return settings.unlisted * settings.imitated / (1.0 - settings.unlisted)


def choose(diagnosis: Findings, marks: Marks | None = None) -> tuple[NextTest, ...]:
    """Rank the tests of a diagnosis, the best first.

    ``marks`` predicts the marks of the flight. Without it no traces are on the menu, unless
    *unknown* leads.
    """
    top = max(diagnosis.posterior, key=lambda h: diagnosis.posterior[h])
    menu = {test.name: test for test in _direct_tests(diagnosis)}
    menu |= {test.name: test for test in _questions(diagnosis)}
    tests = [*menu.values(), *_further_tests(diagnosis), *_trace_tests(diagnosis, top, marks)]
    first, *others = _ranked([_judged(diagnosis, one, marks) for one in tests], diagnosis, top)
    # The best of many by drawn outcomes looks better than it is: its worth is of other draws.
    return (_judged(diagnosis, first, marks, seed=2), *others)


def _judged(diagnosis: Findings, test: NextTest, marks: Marks | None, seed: int = 1) -> NextTest:
    """Add worth and foreseen outcomes to a test."""
    outcome, settings = outcome_of(diagnosis, test, marks), diagnosis.settings
    if outcome is None:
        return test
    before, odds = _before(diagnosis, outcome), imitator_odds(settings)
    gain, settles, misleads = outcome.worth(before, odds, settings.named, seed)
    foreseen = {h: outcome.moments(k) for k, h in enumerate(outcome.hypotheses)}
    return replace(test, information=gain, settles=settles, misleads=misleads, foreseen=foreseen)


def settle(
    diagnosis: Findings,
    test: NextTest,
    outcome: Sequence[float] | str,
    marks: Marks | None = None,
) -> Mapping[Hypothesis, float]:
    """Update the probabilities by the outcome of a test.

    Parameters
    ----------
    outcome : shares of the ranges of ``test.parameters``; or mean time of timely shifts in s and
        share engaged; or marks in s; NaN, or less values, where one is not shown. The answer of a
        question as its word.

    Returns
    -------
    Probability of each hypothesis that predicts the outcome; the posterior where none does.
    """
    if isinstance(outcome, str):
        answers = [r for r in diagnosis.readings if (r.key, r.value) == (test.question, outcome)]
        return answers[0].posterior
    values = np.full(SIZE, np.nan)
    values[: len(outcome)] = outcome
    predicted = outcome_of(diagnosis, test, marks)
    if predicted is None or np.isnan(values).all():
        return diagnosis.posterior
    values = values[: predicted.mean.shape[1]]
    part = predicted.only(np.isfinite(values))
    log = part.log_density(values[None, np.isfinite(values)])
    after = part.after(_before(diagnosis, part), log, imitator_odds(diagnosis.settings))[0]
    return dict(zip(part.hypotheses, after.tolist(), strict=True))


def outcome_of(diagnosis: Findings, test: NextTest, marks: Marks | None) -> Outcome | None:
    """Predict the outcome of a test; None where no hypothesis does."""
    if test.kind == "direct":
        return _read(diagnosis, test)
    if test.kind == "shifts":
        parts = {h: _further(diagnosis, h, test) for h in (*_plausible(diagnosis), UNKNOWN)}
        return Outcome.of(parts, lambda _: False)
    return None if test.kind == "record" or marks is None else _flown(diagnosis, test, marks)


def _plausible(diagnosis: Findings) -> list[Hypothesis]:
    """List the known hypotheses that take part."""
    return [h for h, p in diagnosis.posterior.items() if p > LEAST and h in diagnosis.fits]


def _before(diagnosis: Findings, outcome: Outcome) -> Array:
    """Compute the probabilities of the hypotheses of an outcome; none of them is impossible."""
    found = np.array([max(1e-9, diagnosis.posterior.get(h, 0.0)) for h in outcome.hypotheses])
    return np.asarray(found / found.sum())


def _nearest(diagnosis: Findings) -> Hypothesis:
    """Find the most probable known hypothesis."""
    return max(diagnosis.fits, key=lambda h: diagnosis.posterior.get(h, 0.0))


def _rows(fit: Fit) -> np.ndarray:
    count = len(fit.shares)
    return np.linspace(0, count - 1, min(count, DRAWS)).astype(int)


def _ranked(
    tests: Sequence[NextTest], diagnosis: Findings, top: Hypothesis
) -> tuple[NextTest, ...]:
    """Order tests: those worth their cost by their value, all others by information an hour."""
    settings = diagnosis.settings
    decided = diagnosis.posterior[top] > settings.named
    wrong = settings.named / (1.0 - settings.named)

    def sure(test: NextTest) -> float:
        return test.settles - wrong * test.misleads

    def rank(test: NextTest) -> tuple[bool, float]:
        value = sure(test) - settings.hour * test.hours
        worth = not decided and value > 0.0
        return not worth, -value if worth else -(test.information or 0.0) / test.hours

    ranked = sorted(tests, key=rank)
    if top == UNKNOWN:
        near = [t for t in ranked if t.kind == "traces"]
    elif decided:
        near = [t for t in ranked if set(top) & set(t.effects) and t.hours <= ranked[0].hours]
    else:
        near = [t for t in ranked if not rank(t)[0] and sure(t) >= sure(ranked[0]) - ALIKE]
    first = min(near, key=lambda t: (t.hours, t.kind != "direct"), default=None)
    return tuple(sorted(ranked, key=lambda t: t is not first))


def _questions(diagnosis: Findings) -> list[NextTest]:
    """List the questions about the record whose answers are weighed, with their worth."""
    found = []
    for key in dict.fromkeys(one.key for one in diagnosis.readings):
        answers = [one for one in diagnosis.readings if one.key == key]
        chance = np.array([one.probability for one in answers])
        chance = chance / chance.sum()
        every = {h for one in answers for h in one.posterior}
        after = np.array([[one.posterior.get(h, 0.0) for h in every] for one in answers])
        gain = (rel_entr(after, chance @ after) * chance[:, None]).sum()
        best, named = after.max(axis=1), after.max(axis=1) > diagnosis.settings.named
        right, wrong = (float(chance @ (named * one)) for one in (best, 1.0 - best))
        name, how = RECORD[key]
        effects = tuple(e.name for e in diagnosis.effects.values() if e.test.name == name)
        test = NextTest(name, how, "record", ASKED, effects, question=key)
        worth = replace(test, information=float(gain), settles=right, misleads=wrong)
        found.append(worth)
    return found


def _direct_tests(diagnosis: Findings) -> list[NextTest]:
    """List the direct tests of the effects, but for those whose results are known."""
    bench, known = diagnosis.bench, {one.effect for one in diagnosis.bench.measured}
    grouped: dict[str, list[Effect]] = {}
    for effect in diagnosis.effects.values():
        grouped.setdefault(effect.test.name, []).append(effect)
    return [
        NextTest(
            name,
            those[0].test.how,
            "direct",
            hours_of(bench, name),
            tuple(effect.name for effect in those),
            tuple(p for e in those for p in [q.name for q in e.parameters] or [e.name]),
        )
        for name, those in grouped.items()
        if possible(bench, name) and not {effect.name for effect in those} <= known
    ]


def _read(diagnosis: Findings, test: NextTest) -> Outcome:
    """Predict a direct test; an effect without parameters reads 1 where it is there, else 0."""
    setting, settings = diagnosis.model.setting, diagnosis.settings
    effects = [diagnosis.effects[name] for name in test.effects]
    neutral = [[p.share(p.neutral_of(setting)) for p in e.parameters] or [0.0] for e in effects]
    absent = np.concatenate(neutral)
    ends = np.cumsum([0, *map(len, neutral)]).tolist()
    places = [(e, slice(*ends[k : k + 2])) for k, e in enumerate(effects)]
    errors = settings.test_error**2 * np.eye(absent.size)
    parts = {}
    for hypothesis in _plausible(diagnosis):
        fit, rows = diagnosis.fits[hypothesis], _rows(diagnosis.fits[hypothesis])
        mean = np.tile(absent, (rows.size, 1))
        there = {effect.name for effect in fit.space.effects}
        for effect, place in [one for one in places if one[0].name in there]:
            shares = fit.shares[rows][:, fit.space.columns(effect.name)]
            mean[:, place] = shares if effect.parameters else 1.0
        parts[hypothesis] = smoothed(mean, np.tile(errors, (rows.size, 1, 1)))
    # Unknown: nothing, or one of the effects with a normal density as wide as its range.
    mean = np.tile(absent, (1 + len(effects), 1))
    covariance, share = np.tile(errors, (len(mean), 1, 1)), np.zeros(len(mean))
    for k, (effect, place) in enumerate(places, start=1):
        mean[k, place] = 0.5 if effect.parameters else 1.0
        if effect.parameters:
            wide = np.arange(absent.size)[place]
            covariance[k, wide, wide] += 1.0 / 12.0
        share[k] = (0.5 if effect.parameters else settings.prior(effect.name)) / len(effects)
    share[0] = 1.0 - share.sum()
    every = parts | {UNKNOWN: (share, mean, covariance)}
    return Outcome.of(every, lambda h: bool(set(test.effects) & set(h)))


def _where(bench: Bench, cell: int) -> tuple[tuple[float, float], str]:
    mismatch, force = bench.cells[cell].point.mismatch, bench.cells[cell].point.profile.force
    return (mismatch, force), f"{number(mismatch / RPM)} 1/min and {number(force)} N"


def _further_tests(diagnosis: Findings) -> list[NextTest]:
    """List more shifts at each operating point at which shifts can engage."""
    bench, found = diagnosis.bench, []
    setup, mean = hours_of(bench, "more shifts"), diagnosis.fits[_nearest(diagnosis)].predicted.mean
    cells = np.flatnonzero(np.isfinite(mean).all(axis=0)).tolist()
    for cell, count in itertools.product(cells, MORE if possible(bench, "more shifts") else ()):
        point, words = _where(bench, cell)
        name, hours = f"{count} more shifts at {words}", setup + SHIFT * count
        how = f"Record {name}, each with its own time."
        found.append(NextTest(name, how, "shifts", hours, cell=cell, point=point, shifts=count))
    return found


def _further(diagnosis: Findings, hypothesis: Hypothesis, test: NextTest) -> Densities:
    """Predict mean time and share engaged of more shifts at an operating point."""
    seen, settings, known = diagnosis.seen, diagnosis.settings, hypothesis in diagnosis.fits
    fit = diagnosis.fits[hypothesis if known else _nearest(diagnosis)]
    rows, cell = _rows(fit), test.cell
    mean, sd, error, engaged = (
        getattr(fit.predicted, name)[rows, cell] for name in ("mean", "sd", "error", "engaged")
    )
    own = np.maximum(settings.model_error * mean, settings.least_error)
    error = np.hypot(error, own) if known else max(settings.unlisted_sizes) * mean
    # Of the residual an error of this point takes its share of the variance.
    precision = seen.count[cell] * error**2
    gain = precision / (precision + sd**2)
    mean = mean + fit.offset[rows, cell]
    mean = mean + gain * (seen.mean[cell] - mean)
    share = np.clip(engaged, EDGE, 1.0 - EDGE)
    variance = (1.0 - gain) * error**2 + sd**2 / np.maximum(1.0, test.shifts * share)
    both = np.stack([variance, share * (1.0 - share) / test.shifts + EDGE**2], axis=1)
    return smoothed(np.stack([mean, share], axis=1), both[:, None, :] * np.eye(2))


def _trace_tests(diagnosis: Findings, top: Hypothesis, marks: Marks | None) -> list[NextTest]:
    """List traces at the least force without any; at the largest residual where unknown leads."""
    bench, seen = diagnosis.bench, diagnosis.seen
    profiles = [cell.point.profile for cell in bench.cells]
    traced = {cell.point.profile for cell in bench.cells if cell.traces}
    cells = [k for k, profile in enumerate(profiles) if profile not in traced]
    if cells and top != UNKNOWN:
        least = min(profiles[k].force for k in cells)
        cells = [k for k in cells if profiles[k].force == least and marks is not None]
    if not cells or not possible(bench, "traces"):
        return []
    one = diagnosis.fits[_nearest(diagnosis)].predicted
    scatter = (one.error**2 + one.sd**2 / np.maximum(1, seen.count)).mean(axis=0)
    score = abs(seen.mean - one.mean.mean(axis=0)) / np.sqrt(one.mean.var(axis=0) + scatter)
    cell = max(cells, key=lambda k: float(np.nan_to_num(score[k] * (seen.count[k] > 0))))
    point, words = _where(bench, cell)
    name = f"traces of {TRACED} shifts at {words}"
    how = f"Record displacement, force and both speeds over time of {TRACED} shifts at {words}."
    hours = hours_of(bench, "more shifts") + hours_of(bench, "traces") + SHIFT * TRACED
    return [NextTest(name, how, "traces", hours, cell=cell, point=point, shifts=TRACED)]


def _flown(diagnosis: Findings, test: NextTest, marks: Marks) -> Outcome:
    """Predict the marks of the flight of some traces."""
    assert test.cell is not None, "traces are made at an operating point"
    profile, student = diagnosis.bench.cells[test.cell].point.profile, diagnosis.settings
    wider = student.flight_freedom / (student.flight_freedom - 2.0)
    still, way = marks(NONE, np.zeros((1, 0)), profile), np.arange(SIZE) < len(WAYS)
    parts = {}
    for hypothesis in _plausible(diagnosis):
        fit, rows = diagnosis.fits[hypothesis], _rows(diagnosis.fits[hypothesis])
        acting = tuple(effect.name for effect in fit.space.effects)
        found = marks(acting, fit.values[rows], profile)
        times, errors = np.broadcast_to(found.times, (rows.size, SIZE)), wider * _errors(found)
        nominal = np.where(way, times, still.times)
        both = [smoothed(one, errors) for one in (times, nominal)]
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
    slopes = [
        np.array(values) * np.gradient(part, values)
        for values, part in zip((WAYS, FORCES), np.split(times, [len(WAYS)]), strict=True)
    ]
    # A mark's value over its slope; marks that never come have the time-out in common.
    reach = np.maximum(0.0, np.concatenate(slopes))
    common = model_covariance(np.arange(SIZE), times, reach) + STEP**2 / 12.0 / TRACED
    creep = found.creep[:, :, None] * found.creep[:, None, :]
    return np.asarray(common + found.error[:, :, None] ** 2 * np.eye(SIZE) + creep)
