"""Next bench test: the one with the most worth to the decision for its cost.

A test has an outcome that each hypothesis predicts, *unknown* and what only looks like a hypothesis
too (``diagnosis.inference.outcome``).

Unless the decision is settled, tests are ranked by the chance that it is afterwards, minus 4 % per
hour of work: a cheap test that settles nothing would lead by nats an hour. Otherwise tests are
ranked by nats an hour, behind the direct test of the named cause where that costs no more than the
first of them.
Either way a test that misleads in more than 5 % comes behind those that are worth their cost and do
not. If no known effect fits, the test is traces at the operating point with the largest residual.

Direct tests come from the effects. Their outcome is the effects' parameters, as shares of the
priors, to a twentieth. Effects that share a test share its outcome: a slow push shows friction and
detent. Generic tests are more shifts at an operating point, and traces of a force profile
(``diagnosis.inference.flight_outcome``).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from dogshape.diagnosis.bench.bench_data import Bench, setting_of
from dogshape.diagnosis.bench.sense import REVERSED, SHARES, forward
from dogshape.diagnosis.inference.classes import Confusion
from dogshape.diagnosis.inference.flight_outcome import flight_outcome, tabulated
from dogshape.diagnosis.inference.further_shifts import (
    MeanPrediction,
    further_means,
    further_unknown,
)
from dogshape.diagnosis.inference.outcome import Decision, Outcome
from dogshape.diagnosis.inference.posterior import Probabilities
from dogshape.diagnosis.inference.static_readings import read_directly
from dogshape.diagnosis.inference.unknown import Unknown
from dogshape.diagnosis.likelihood.observations import Observed
from dogshape.diagnosis.likelihood.scores import PredictionSummary, Scored
from dogshape.diagnosis.prediction.hypotheses import UNKNOWN, in_common, plain, without
from dogshape.diagnosis.prediction.prediction import Emulator, FlightEmulator
from dogshape.diagnosis.settings import USUAL, Settings
from dogshape.diagnosis.terms import Array, Hypothesis
from dogshape.sim.effect import Effect
from dogshape.sim.errors import DataError, did_you_mean, number
from dogshape.sim.setting import Setting
from dogshape.sim.units import RPM

EXACT = 0.05  #: standard error of a direct test, as share of a parameter's prior
HOUR = 0.04  #: chance to settle that an hour of work has to earn
LEAST = 1e-3  #: probability from which a hypothesis takes part
WORTH = 0.02  #: nats below which nothing is to be learnt
MISLED = 0.05  #: chance to mislead above which a test yields to others
ABSENT = 0.5  #: chance that a direct test finds nothing of an unknown cause
FLOWN = 10  #: most plausible hypotheses of which flights are predicted; of more none are
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
class Asked:
    """Quantity that a test measures.

    Parameters
    ----------
    kind : ``direct`` for parameters of effects, ``shifts`` for the mean time of more of them,
        ``traces`` for the marks of the flight in more of them.
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

    ``settles`` is the chance that the decision is settled afterwards, ``misleads`` that something
    wrong is named, ``decided`` whether it is settled before. ``information`` is None where no
    hypothesis predicts the outcome, as is ``outcome``; else ``hypotheses`` are those that do: in
    shares of the priors for a direct test, else in s. ``odds`` are of something that looks like a
    hypothesis to that hypothesis.
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
    misleads: float = 0.0
    decided: bool = False
    odds: tuple[float, ...] = ()

    @property
    def value(self) -> float:
        """Chance to settle, less what the work has to earn."""
        return self.settles - HOUR * self.hours

    @property
    def rate(self) -> float:
        """Information an hour, nats."""
        return (self.information or 0.0) / self.hours

    @property
    def sound(self) -> bool:
        """Test that it is worth its cost and hardly misleads."""
        worth = (self.information or 0.0) > WORTH if self.decided else self.value > 0.0
        return worth and self.misleads <= MISLED

    def as_dict(self) -> dict[str, Any]:
        """Write the measured quantity and the prediction of each hypothesis."""
        record = {"name": self.name, **self.asked.as_dict()}
        if self.outcome is not None:
            record["misleads"] = self.misleads
            record["foretold"] = [self._row(k) for k in range(self.outcome.owner.size)]
        return record

    def _row(self, place: int) -> dict[str, Any]:
        """Write one density of the predicted outcome."""
        assert self.outcome is not None
        whole, owner = self.outcome.covariance[place], int(self.outcome.owner[place])
        row: dict[str, Any] = {
            "effects": list(self.hypotheses[owner]),
            "mean": _short(self.outcome.mean[place]),
            "sd": _short(np.sqrt(np.diag(whole))),
        }
        if self.outcome.share[place] < 1.0:
            row["share"] = float(self.outcome.share[place])
        if self.asked.kind == "traces":
            row["covariance"] = [_short(line) for line in whole]
        if self.outcome.read[owner] and self.odds[owner] > 0.0:
            row["imitator_odds"] = self.odds[owner]
        return row


def _short(values: Array) -> list[float]:
    """Return values to six digits, which records need no more of."""
    return [float(f"{value:.6g}") for value in values]


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
    confusion: Confusion
    emulator: Emulator
    settings: Settings = USUAL

    @property
    def plausible(self) -> tuple[Hypothesis, ...]:
        """Hypotheses that take part, *unknown* among them."""
        return tuple(h for h, p in self.posterior.items() if p > LEAST or h == UNKNOWN)

    def decision(self, hypotheses: Sequence[Hypothesis]) -> Decision:
        """Return the decision between some hypotheses."""
        # Nothing is impossible before a test, least of all what nobody thought of.
        shares = np.array([max(self.posterior[h], 1e-9) for h in hypotheses])
        measured = read_directly(self.bench, self.effects)
        return Decision.of(hypotheses, shares, self.confusion, measured)

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
    decision = standing.decision(names)
    predicted = (*_direct(standing), *_more(standing), *_traces(standing))
    tests = [_judged(standing, test) for test in predicted]
    top = names[int(np.argmax(decision.probabilities))]
    if decision.settled():
        # What the sense rests on that nobody noted comes first: it costs least. Where nothing is in
        # doubt the test that shows the cause directly confirms it.
        blind = {REVERSED} if standing.bench.mismatch_sense == "unknown" else set()
        tests.sort(key=lambda t: (-max(t.rate, WORTH / 10.0), not set(top) & set(t.shows), t.hours))
        tests.sort(key=lambda t: (not blind & set(t.shows), not t.sound))
        direct = [t for t in tests if top and set(top) <= set(t.shows) and t.misleads <= MISLED]
        confirming = min(direct, key=lambda t: t.hours, default=tests[0])
        if confirming.hours <= tests[0].hours:
            tests.sort(key=lambda t: t is not confirming)
    else:
        tests.sort(key=lambda t: (not t.sound, -t.value))
    first = _look(standing) if top == UNKNOWN and possible(standing.bench, "traces") else []
    return (*first, *(test for test in tests if test.name not in {one.name for one in first}))


def _judged(standing: Standing, test: NextTest) -> NextTest:
    """Add the worth of a test: information, and chances to settle the decision or to mislead."""
    assert test.outcome is not None
    decision = standing.decision(test.hypotheses)
    worth = decision.worth(test.outcome, test.shows)
    return replace(
        test,
        information=worth.information,
        settles=worth.settles,
        misleads=worth.misleads,
        decided=decision.settled(),
        odds=tuple(decision.imitated.tolist()),
    )


def _look(standing: Standing) -> list[NextTest]:
    """Return the test that shows where along the shift an unknown gap arises, if there is any."""
    residual, score = _missed(standing)
    if not np.isfinite(score).any():
        return []
    place = int(np.nanargmax(score))
    where = _where(standing.bench, place)
    more = (
        f"at {where}, where the nearest hypothesis misses the mean by {1e3 * residual[place]:+.0f} "
        "ms."
    )
    return [_traced(standing, place, more)]


def _missed(standing: Standing) -> tuple[Array, Array]:
    """Compute the residuals of the leading hypothesis, in s and in standard errors."""
    predicted, seen = mean_prediction(standing, standing.leading), standing.seen
    residual = seen.time - predicted.mean
    shifts = np.maximum(1.0, seen.shifts)
    return residual, abs(residual) / np.sqrt(predicted.variance + predicted.single / shifts)


def _traced(standing: Standing, place: int, more: str) -> NextTest:
    """Return the test of traces at an operating point, of which nothing is predicted."""
    cell, where = standing.bench.cells[place], _where(standing.bench, place)
    before = " more" if cell.traces else ""
    name = f"traces of {TRACED}{before} shifts at {where}"
    how = f"Record displacement, force and both speeds over time of {TRACED}{before} shifts {more}"
    asked = Asked("traces", point=_point(standing.bench, place), shifts=TRACED)
    hours = hours_of(standing.bench, "more shifts") + hours_of(standing.bench, "traces")
    return NextTest(name, how, None, hours + SHIFT * TRACED, asked)


def _traces(standing: Standing) -> list[NextTest]:
    """List the traces whose marks of the flight can be predicted, at the least force.

    There flights take longest. More traces of a profile that has some tell little: what they err
    is common to all of them.
    """
    cells = standing.bench.cells
    traced = {cell.point.profile for cell in cells if cell.traces}
    places = [k for k, cell in enumerate(cells) if cell.point.profile not in traced]
    limits = standing.settings.decision
    known = tuple(h for h in standing.plausible if standing.posterior[h] > limits.plausible)
    those = tuple(dict.fromkeys((*known, UNKNOWN)))
    if (
        not isinstance(standing.emulator, FlightEmulator)
        or not possible(standing.bench, "traces")
        or not places
        or len(those) > FLOWN
        or sum(standing.posterior[h] for h in those) < limits.credible
        or not all(tabulated(h) for h in known)
    ):
        return []
    least = min(cells[k].point.profile.force for k in places)
    score = np.nan_to_num(_missed(standing)[1])
    near = [k for k in places if cells[k].point.profile.force == least]
    place = max(near, key=lambda k: float(score[k]))
    profile = cells[place].point.profile
    outcome = flight_outcome(standing.emulator, those, standing.scored, profile, TRACED)
    more = f"at {_where(standing.bench, place)}; causes differ in the flight up to the first touch."
    return [replace(_traced(standing, place, more), hypotheses=those, outcome=outcome)]


def _point(bench: Bench, place: int) -> tuple[float, float]:
    point = bench.cells[place].point
    return point.mismatch, point.profile.force


def _where(bench: Bench, place: int) -> str:
    mismatch, force = _point(bench, place)
    return f"{number(mismatch / RPM)} 1/min and {number(force)} N"


def _direct(standing: Standing) -> list[NextTest]:
    """List the direct tests of the effects, but for those whose results are known."""
    known = {one.effect for one in standing.bench.measured}
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
        if possible(standing.bench, name) and not {effect.name for effect in those} <= known
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
    rows: list[tuple[int, float, Array, Array]] = []
    for order, hypothesis in enumerate(standing.plausible):
        if hypothesis == UNKNOWN:
            rows += [(order, *row) for row in _anything(standing, effects, absent)]
            continue
        mean, variance = absent.copy(), np.full(absent.size, EXACT**2)
        for effect, place in _places(effects):
            if effect.name in hypothesis and not effect.parameters:
                mean[place] = 1.0
            elif effect.name in hypothesis:
                found = standing.scored[hypothesis]
                shares = found.rows.shares[:, found.space.columns(effect.name)]
                weights = found.weights()
                mean[place] = weights @ shares
                variance[place] += weights @ (shares - mean[place]) ** 2
        rows.append((order, 1.0, mean, variance))
    owner, share, mean, variance = (np.array([row[k] for row in rows]) for k in range(4))
    names = {effect.name for effect in effects}
    # The sense is read of a hypothesis that is nothing else; beside others those may be imitated.
    read = np.array([bool(names & set(forward(h) or h)) for h in standing.plausible])
    return Outcome(owner, share, mean, variance[:, None, :] * np.eye(absent.size), read)


def _places(effects: Sequence[Effect]) -> list[tuple[Effect, slice]]:
    """Return the places of each effect in the outcome of the test that effects share."""
    ends = np.cumsum([0, *(len(_read(effect)) for effect in effects)]).tolist()
    return [(effect, slice(*ends[k : k + 2])) for k, effect in enumerate(effects)]


def _anything(
    standing: Standing, effects: Sequence[Effect], absent: Array
) -> list[tuple[float, Array, Array]]:
    """List the densities of a direct test under an unknown cause: share, mean and variance.

    It shows nothing, or else looks like one of the effects, with any value within its prior. An
    unknown cause is none of the sense of rotation.
    """
    found = []
    for effect, place in _places(effects):
        mean, variance = absent.copy(), np.full(absent.size, EXACT**2)
        mean[place] = 0.5 if effect.parameters else 1.0
        # A normal density as wide as the prior.
        variance[place] += 1.0 / 12.0 if effect.parameters else 0.0
        share = (1.0 - ABSENT) / len(effects)
        if effect.name == REVERSED:
            share = SHARES[standing.bench.mismatch_sense] / len(effects)
        found.append((share, mean, variance))
    nothing = 1.0 - sum(share for share, _, _ in found)
    return [(nothing, absent, np.full(absent.size, EXACT**2)), *found]


def _more(standing: Standing) -> list[NextTest]:
    """List more shifts at each operating point of the data set as tests."""
    found: list[NextTest] = []
    if not possible(standing.bench, "more shifts"):
        return found
    setup = hours_of(standing.bench, "more shifts")
    predicted = [_further(standing, hypothesis) for hypothesis in standing.plausible]
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
                outcome = Outcome.normal(mean, variance)
                hours = setup + SHIFT * count
                test = NextTest(name, how, None, hours, asked, (), standing.plausible, outcome)
                found.append(test)
    return found


def _further(standing: Standing, hypothesis: Hypothesis) -> MeanPrediction:
    """Predict the mean time of more shifts at each cell, given those that were made there."""
    if hypothesis == UNKNOWN:
        baseline = standing.scored[()].rows.predicted
        return further_unknown(standing.unknown, standing.seen, baseline)
    return further_means(standing.scored[hypothesis], standing.seen)


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
    if test.decided:
        return f"{test.how} It tells most for its cost, open are {those} ({cost})."
    wrong = (
        f", and names a wrong one with {100.0 * test.misleads:.0f} %"
        if test.misleads > MISLED
        else ""
    )
    return (
        f"{test.how} It settles the cause with a chance of {100.0 * test.settles:.0f} % ({cost})"
        f"{wrong}; open are {those}."
    )
