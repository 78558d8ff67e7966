"""Next bench test: the one with the most information about the cause for its cost.

A test has an outcome, a vector that each hypothesis predicts with a mean and a variance. Its
expected information is the mutual information of cause and outcome,

.. math:: I = H(p) - E_y H(p | y),

with the hypotheses' probabilities *p* and outcomes *y* drawn from their mixture.

If no hypothesis has more than 0.8, tests are ranked by the chance that the true one has it
afterwards, minus 4 % per hour of work: a cheap test that settles nothing would lead by nats an
hour. Otherwise tests are ranked by nats an hour; if nothing is left to learn, the direct test of
the named cause leads. If no known effect fits, no outcome can be predicted: the test is then
traces at the operating point with the largest residual.

Direct tests come from the effects. Their outcome is the effects' parameters, as shares of the
priors, to a twentieth. Effects that share a test share its outcome: a slow push shows friction and
detent. Generic tests are more shifts at an operating point.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from scipy.special import logsumexp

from dogshape.diagnosis.bench.bench_data import Bench, setting_of
from dogshape.diagnosis.bench.sense import REVERSED
from dogshape.diagnosis.inference.posterior import Probabilities
from dogshape.diagnosis.inference.unknown import Unknown
from dogshape.diagnosis.inference.verdict import NAMED
from dogshape.diagnosis.likelihood.observations import Observed
from dogshape.diagnosis.likelihood.scores import PredictionSummary, Scored
from dogshape.diagnosis.prediction.hypotheses import UNKNOWN, in_common, plain, without
from dogshape.diagnosis.terms import Array, Hypothesis
from dogshape.sim.effect import Effect
from dogshape.sim.errors import DataError, did_you_mean, number
from dogshape.sim.setting import Setting
from dogshape.sim.units import RPM

EXACT = 0.05  #: standard error of a direct test, as share of a parameter's prior
DRAWN = 400  #: outcomes drawn
HOUR = 0.04  #: chance to settle that an hour of work has to earn
LEAST = 1e-3  #: probability from which a hypothesis takes part
WORTH = 0.02  #: nats below which nothing is to be learnt
SETUP, SHIFT = 0.5, 0.02  #: hours to set an operating point, and for a shift
TRACING, TRACED = 1.5, 10  #: hours to set up the recording of traces, and shifts recorded
DIRECT = 3.0  #: hours of a direct test that is not in the table
#: Hours of direct tests, by name: what a stand has at hand costs less than taking it apart.
HOURS = {
    "force at the sleeve over time": 2.0,
    "static force at the sleeve": 2.0,
    "slow push of the free ring": 1.0,
    "hand test of the play": 0.5,
    "gap by feeler or travel": 0.5,
    "static stiffness of the linkage": 1.0,
    "run-down of the sliding ring": 1.0,
    "both speeds at the first touch": 2.0,
    "angle of each shift": 2.0,
    "chamfer by profile": 4.0,
    "sense of rotation at the rig": 0.25,
    "free flight at the sleeve": 4.0,
    "free flight at two forces": 4.0,
    "drop test of the ring": 6.0,
    "tilt test of the dogs": 4.0,
}
MORE = (10, 40)  #: shifts that may be added at an operating point
#: Tests that are no effect's own, by what a data set calls them, with their hours to set up.
GENERIC = {"more shifts": SETUP, "traces": TRACING}


@dataclass(frozen=True)
class Outcome:
    """Predicted outcome of a test: mean and variance, (hypotheses, d)."""

    mean: Array
    variance: Array


@dataclass(frozen=True)
class Asked:
    """Quantity that a test measures.

    Parameters
    ----------
    kind : ``direct`` for parameters of effects, ``shifts`` for the mean time of more of them,
        ``traces`` where no hypothesis predicts the outcome.
    parameters : that a direct test measures, in the order of its outcome.
    point : mismatch in rad/s and force in N of shifts or traces.
    shifts : that are made.
    """

    kind: Literal["direct", "shifts", "traces"]
    parameters: tuple[str, ...] = ()
    point: tuple[float, float] | None = None
    shifts: int = 0

    def as_dict(self) -> dict[str, Any]:
        """Write the record in the edge's units."""
        record: dict[str, Any] = {"kind": self.kind}
        if self.kind == "direct":
            record["parameters"] = list(self.parameters)
        if self.point is not None:
            record["mismatch_rpm"], record["force_N"] = self.point[0] / RPM, self.point[1]
            record["shifts"] = self.shifts
        return record


@dataclass(frozen=True)
class NextTest:
    """Test with its expected information, nats, and its cost in hours.

    ``settles`` is the chance that the true hypothesis has 0.8 afterwards. ``information`` is None
    where no hypothesis predicts it, as is ``outcome``; else ``outcome`` has a row for each of
    ``hypotheses``: shares of the priors for a direct test, s for more shifts.
    """

    name: str
    how: str
    information: float | None
    hours: float
    asked: Asked
    shows: tuple[str, ...] = ()
    hypotheses: tuple[Hypothesis, ...] = ()
    outcome: Outcome | None = None
    settles: float = 0.0

    @property
    def value(self) -> float:
        """Chance to settle, less what the work has to earn."""
        return self.settles - HOUR * self.hours

    @property
    def rate(self) -> float:
        """Information an hour, nats."""
        return (self.information or 0.0) / self.hours

    def as_dict(self) -> dict[str, Any]:
        """Write the measured quantity and the prediction of each hypothesis."""
        record = {"name": self.name, **self.asked.as_dict()}
        if self.outcome is not None:
            rows = zip(self.hypotheses, self.outcome.mean, self.outcome.variance, strict=True)
            record["foretold"] = [
                {"effects": list(h), "mean": _short(mean), "sd": _short(np.sqrt(variance))}
                for h, mean, variance in rows
            ]
        return record


def _short(values: Array) -> list[float]:
    """Return values to six digits, which records need no more of."""
    return [float(f"{value:.6g}") for value in values]


def expected_information(
    probabilities: Array, outcome: Outcome, seed: int = 1
) -> tuple[float, float]:
    """Compute the mutual information of hypothesis and outcome, nats, and the chance to settle."""
    generator = np.random.default_rng(seed)
    width = np.sqrt(outcome.variance)
    # As many draws of each hypothesis as its probability: less noise than drawing which.
    counts = np.maximum(1, np.round(DRAWN * probabilities)).astype(int)
    gain = settled = 0.0
    log_prior = np.log(probabilities)
    for place, count in enumerate(counts):
        drawn = outcome.mean[place] + width[place] * generator.standard_normal(
            (count, width.shape[1])
        )
        score = (drawn[:, None] - outcome.mean) / width
        log = (-0.5 * score**2 - np.log(width)).sum(axis=2)
        own = log[:, place] - logsumexp(log + log_prior, axis=1)
        gain += probabilities[place] * float(own.mean())
        after = own + log_prior[place]
        settled += probabilities[place] * float((after > np.log(NAMED)).mean())
    return max(0.0, gain), settled


@dataclass(frozen=True)
class Standing:
    """State of the diagnosis at the choice of the next test."""

    bench: Bench
    seen: Observed
    scored: Mapping[Hypothesis, Scored]
    unknown: Unknown
    posterior: Probabilities
    effects: Mapping[str, Effect]
    leading: Hypothesis

    @property
    def plausible(self) -> tuple[Hypothesis, ...]:
        """Hypotheses that take part."""
        return tuple(h for h, p in self.posterior.items() if p > LEAST)

    @property
    def setting(self) -> Setting:
        """A setting of the bench without effects."""
        return setting_of(self.bench)


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
    """Return the hours of a direct test, or to set up another, at this stand."""
    own = [t.hours for t in bench.tests if t.name == name and t.hours is not None]
    return own[-1] if own else GENERIC.get(name, HOURS.get(name, DIRECT))


def choose(standing: Standing) -> tuple[NextTest, ...]:
    """Rank the tests, the best first."""
    names = standing.plausible
    shares = np.array([standing.posterior[h] for h in names])
    shares = shares / shares.sum()
    tests = [_judged(shares, test) for test in (*_direct(standing), *_more(standing))]
    # Where nothing is in doubt the test that shows the cause directly confirms it.
    named = set(names[int(np.argmax(shares))])
    # So does the one that shows the sense, on which all sizes rest where it was not noted.
    named |= {REVERSED} if standing.bench.mismatch_sense == "unknown" else set()
    tests.sort(key=lambda t: (-max(t.rate, WORTH / 10.0), not named & set(t.shows), t.hours))
    if shares.max() <= NAMED:
        tests.sort(key=lambda t: -t.value)
    unknown = names[int(np.argmax(shares))] == UNKNOWN and possible(standing.bench, "traces")
    first = _look(standing) if unknown else []
    return (*first, *tests)


def _judged(shares: Array, test: NextTest) -> NextTest:
    """Add the expected information of a test and its chance to settle the cause."""
    assert test.outcome is not None
    nats, settles = expected_information(shares, test.outcome)
    return replace(test, information=nats, settles=settles)


def _look(standing: Standing) -> list[NextTest]:
    """Return the test that shows where along the shift an unknown gap arises, if there is any."""
    predicted, seen = mean_prediction(standing, standing.leading), standing.seen
    residual = seen.time - predicted.mean
    score = abs(residual) / np.sqrt(
        predicted.variance + predicted.single / np.maximum(1.0, seen.shifts)
    )
    if not np.isfinite(score).any():
        return []
    place = int(np.nanargmax(score))
    cell, where = standing.bench.cells[place], _where(standing.bench, place)
    before = " more" if cell.traces else ""
    name = f"traces of {TRACED}{before} shifts at {where}"
    how = (
        f"Record displacement, force and both speeds over time of {TRACED}{before} shifts at "
        f"{where}, where the nearest hypothesis misses the mean by {1e3 * residual[place]:+.0f} ms."
    )
    asked = Asked("traces", point=_point(standing.bench, place), shifts=TRACED)
    hours = hours_of(standing.bench, "more shifts") + hours_of(standing.bench, "traces")
    return [NextTest(name, how, None, hours + SHIFT * TRACED, asked)]


def _point(bench: Bench, place: int) -> tuple[float, float]:
    point = bench.cells[place].point
    return point.mismatch, point.profile.force


def _where(bench: Bench, place: int) -> str:
    mismatch, force = _point(bench, place)
    return f"{number(mismatch / RPM)} 1/min and {number(force)} N"


def _direct(standing: Standing) -> list[NextTest]:
    """List the direct tests of the effects."""
    grouped: dict[str, list[Effect]] = {}
    for effect in standing.effects.values():
        grouped.setdefault(effect.test.name, []).append(effect)
    return [
        NextTest(
            name,
            those[0].test.how,
            None,
            hours_of(standing.bench, name),
            Asked("direct", tuple(name for effect in those for name in _read(effect))),
            tuple(effect.name for effect in those),
            standing.plausible,
            _parameters(standing, those),
        )
        for name, those in grouped.items()
        if possible(standing.bench, name)
    ]


def _read(effect: Effect) -> tuple[str, ...]:
    """List the parameters that a direct test reads of an effect, or the effect's name."""
    return tuple(parameter.name for parameter in effect.parameters) or (effect.name,)


def _parameters(standing: Standing, effects: Sequence[Effect]) -> Outcome:
    """Predict a direct test of some effects, as shares of the priors of their parameters.

    An effect without parameters is there (1) or not (0).
    """
    setting = standing.setting
    neutral = [
        [p.share(p.neutral_of(setting)) for p in effect.parameters] or [0.0] for effect in effects
    ]
    absent = np.concatenate(neutral)
    means, variances = [], []
    for hypothesis in standing.plausible:
        mean, variance = absent.copy(), np.full(absent.size, EXACT**2)
        start = 0
        for effect in effects:
            place = slice(start, start + len(_read(effect)))
            start = place.stop
            if effect.name in hypothesis and not effect.parameters:
                mean[place] = 1.0
            elif effect.name in hypothesis:
                found = standing.scored[hypothesis]
                shares = found.rows.shares[:, found.space.columns(effect.name)]
                weights = found.weights()
                mean[place] = weights @ shares
                variance[place] += weights @ (shares - mean[place]) ** 2
        means.append(mean)
        variances.append(variance)
    return Outcome(np.array(means), np.array(variances))


def _more(standing: Standing) -> list[NextTest]:
    """List more shifts at each operating point of the data set as tests."""
    found: list[NextTest] = []
    if not possible(standing.bench, "more shifts"):
        return found
    setup = hours_of(standing.bench, "more shifts")
    predicted = [mean_prediction(standing, hypothesis) for hypothesis in standing.plausible]
    for place in range(len(standing.bench.cells)):
        where = _where(standing.bench, place)
        for count in MORE:
            mean = np.array([[one.mean[place]] for one in predicted])
            variance = np.array(
                [[one.variance[place] + one.single[place] / count] for one in predicted]
            )
            name = f"{count} more shifts at {where}"
            how = f"Record {count} more shifts at {where}, each with its own time."
            if np.isfinite(mean).all() and np.isfinite(variance).all():
                asked = Asked("shifts", point=_point(standing.bench, place), shifts=count)
                outcome = Outcome(mean, variance)
                hours = setup + SHIFT * count
                test = NextTest(name, how, None, hours, asked, (), standing.plausible, outcome)
                found.append(test)
    return found


@dataclass(frozen=True)
class MeanPrediction:
    """Mean times of the cells that a hypothesis predicts given all data, (cells,); s, s^2.

    ``variance`` is that of the mean (parameters, simulation), ``single`` that of single shifts.
    """

    mean: Array
    variance: Array
    single: Array


def mean_prediction(standing: Standing, hypothesis: Hypothesis) -> MeanPrediction:
    """Predict the mean time of each cell by a hypothesis."""
    if hypothesis == UNKNOWN:
        baseline = standing.scored[()].rows.predicted
        mean, variance = standing.unknown.predict(np.ones(standing.seen.cells, dtype=bool))
        return MeanPrediction(mean, variance + baseline.error[0] ** 2, baseline.sd[0] ** 2)
    found = standing.scored[hypothesis]
    whole = found.weights()
    # Values with which nothing engages have no mean; where they matter the cell is left out.
    counting = whole > 1e-6 * whole.max()
    predicted: PredictionSummary = found.rows.predicted.only(counting)
    weights = whole[counting] / whole[counting].sum()
    mean = weights @ predicted.mean
    # Errors of the simulation are common to all hypotheses and part none of them, but they limit
    # what any outcome can say.
    variance = weights @ ((predicted.mean - mean) ** 2 + predicted.error**2)
    return MeanPrediction(mean, variance, weights @ predicted.sd**2)


def why(test: NextTest, posterior: Probabilities, effects: Mapping[str, Effect]) -> str:
    """Explain the choice of a test in a sentence or two."""
    open_to = [h for h, p in posterior.items() if p > 0.05][:4]
    common = in_common(open_to)
    doubt = [plain(without(h, common), effects) for h in open_to]
    cost = f"about {number(test.hours)} h of work"
    if test.information is None:
        return f"{test.how} They show where along the shift the rest arises ({cost})."
    if test.information < WORTH or len(doubt) < 2:
        return f"{test.how} It would confirm the finding from outside ({cost})."
    those = f"{', '.join(doubt[:-1])} and {doubt[-1]}"
    if max(posterior.values()) > NAMED:
        return f"{test.how} It tells most for its cost, open are {those} ({cost})."
    return (
        f"{test.how} It settles the cause with a chance of {100.0 * test.settles:.0f} % ({cost}); "
        f"open are {those}."
    )
