r"""Check of the advised test: does its outcome settle an ambiguous case.

The outcome *y* of the test comes from the case's truth, never from the diagnosis. A direct test
reads the true parameters as shares of their priors, with an error of a twentieth. More shifts are
made by the same engine with other draws, and their mean is read; of traces the marks of the flight.
The predictions of the hypotheses, mixtures of normal densities in the record of the diagnosis, then
count by the update with which the test was chosen (``diagnosis.inference.outcome``):

.. math:: p'(h) \propto p(h) \sum_j w_{hj} N(y; \mu_{hj}, \Sigma_{hj}),

and what something that looks like *h* has beyond its odds goes to *unknown*.

The case is *settled* if the truth, or a member of its class, then leads with more than 0.8, and
*wrongly settled* if any other hypothesis does. Where nothing known fits no hypothesis predicts
traces, so that these settle nothing here.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any
from zlib import crc32

import numpy as np

from dogshape.diagnosis.bench.flight_marks import joined_marks
from dogshape.diagnosis.bench.traces import BenchTrace
from dogshape.diagnosis.inference.outcome import Outcome, probabilities_after
from dogshape.diagnosis.prediction.hypotheses import UNKNOWN
from dogshape.sim.errors import StorageError
from dogshape.sim.shift.actuation import ForceProfile
from dogshape.sim.units import MM, RPM
from dogshape.validation.blind.case_marks import Names, class_of, names_of
from dogshape.validation.blind.data import draws, measured_rows
from dogshape.validation.blind.intervals import share
from dogshape.validation.blind.mujoco_shift import Shift
from dogshape.validation.blind.stand import Point, Stand, Truth
from dogshape.validation.blind.true_effects import FIELDS, RANGES, SWITCHES, truth_of
from dogshape.validation.blind.truth_engines import engine_of

Record = dict[str, Any]  #: key and results of a set, as they are kept in JSON

SURE = 0.8  #: probability above which a hypothesis counts as settled on
ERROR = 0.05  #: standard error of a direct test, as share of a parameter's prior
KINDS = ("direct", "shifts", "traces")
_RANGES = {one.name: one for ranges in RANGES.values() for one in ranges}


@dataclass(frozen=True)
class Stage:
    """Place of a test: the stand of the case, its operating points with their true rises.

    ``engine`` is that of the case.
    """

    stand: Stand
    points: tuple[Point, ...]
    engine: str = "mujoco"


@dataclass(frozen=True)
class Advised:
    """Outcome of the advised test of one case.

    Parameters
    ----------
    test, kind : its name, and one of ``KINDS``.
    outcome : shares of the priors, one mean time or the marks of the flight in s, NaN for a mark
        that traces do not show; empty where nothing came out.
    truth, group : the true hypothesis, and all that stands in its class, itself too.
    chances : probabilities after the test; empty without an outcome.
    """

    test: str
    kind: str
    outcome: tuple[float, ...]
    truth: Names
    group: frozenset[Names]
    chances: dict[Names, float]

    @property
    def top(self) -> Names | None:
        """The most probable hypothesis after the test, if it has more than ``SURE``."""
        best = max(self.chances, key=lambda h: self.chances[h], default=None)
        return best if best is not None and self.chances[best] > SURE else None

    @property
    def judged(self) -> bool:
        """Test that the outcome was predicted and came out."""
        return bool(self.chances)

    @property
    def settled(self) -> bool:
        """Test that the truth or a member of its class is settled on."""
        return self.top in self.group

    @property
    def exact(self) -> bool:
        """Test that the truth itself is settled on."""
        return self.top == self.truth

    @property
    def wrong(self) -> bool:
        """Test that something else is settled on."""
        return self.top is not None and not self.settled

    @property
    def part(self) -> bool:
        """Test that a part of the truth is settled on, which is less than is asked for."""
        return bool(self.top) and self.wrong and set(self.top or ()) < set(self.truth)

    def as_dict(self) -> Record:
        """Return a row of the score."""
        best = max(self.chances, key=lambda h: self.chances[h], default=None)
        return {
            "test": self.test,
            "kind": self.kind,
            "outcome": [None if np.isnan(one) else one for one in self.outcome],
            "top": None if best is None else list(best),
            "probability": None if best is None else self.chances[best],
            "settled": self.settled,
            "settled_as_truth": self.exact,
            "wrongly_settled": self.wrong,
        }


def judged_by_test(
    name: str,
    case: Record,
    result: Record,
    stage: Callable[[], Stage],
    also: Iterable[Names] = (),
) -> Advised:
    """Simulate the advised test of a case, by its truth and its diagnosis.

    ``stage`` is asked where the record predicts the outcome. To settle on one of ``also``, or on a
    member of its class, is as right as on the truth.
    """
    test = result["next_test"]
    outcome = outcome_of(name, case, test, stage()) if "foretold" in test else ()
    truth = names_of(case["causes"])
    chances = {names_of(h["effects"]): float(h["probability"]) for h in result["hypotheses"]}
    return Advised(
        test=test["name"],
        kind=test["kind"],
        outcome=outcome,
        truth=truth,
        group=frozenset().union(*(class_of(one, result) for one in (truth, *also))),
        chances=updated(chances, test["foretold"], outcome) if outcome else {},
    )


def outcome_of(name: str, case: Record, test: Record, stage: Stage) -> tuple[float, ...]:
    """Return the outcome of a test; empty where no shift engaged.

    The same name and seed of a case give the same outcome.
    """
    generator = np.random.default_rng([crc32(name.encode()), int(case.get("seed", 0))])
    truth = truth_of(case["parameters"], case["outside"])
    if test["kind"] == "direct":
        exact = shares_of(truth, stage.stand, test["parameters"])
        return tuple(float(s) for s in generator.normal(exact, ERROR))
    seed = int(generator.integers(2**31))
    made = more_traces if test["kind"] == "traces" else more_shifts
    return made(truth, stage, _point_of(test, stage), test["shifts"], seed)


def shares_of(truth: Truth, stand: Stand, names: Sequence[str]) -> list[float]:
    """Compute the exact readings of direct tests, as shares of the parameters' priors.

    An effect without parameters is read by its own name: 1 where it is there, else 0.
    They read what acts, also where that is outside the list: a valve that sticks as its mean
    delay, drift as half of the force that it takes, and a dog that stands out as a smaller gap.
    """
    seen = replace(
        truth,
        delay=truth.delay + truth.sticking,
        force_factor=truth.force_factor * (1.0 - 0.5 * truth.drift),
        gap_offset=truth.gap_offset - truth.high_dog,
    )
    found = []
    for name in names:
        if name in SWITCHES:
            found.append(float(getattr(seen, SWITCHES[name])))
            continue
        field, factor = FIELDS[name]
        value = getattr(seen, field)
        # What the truth leaves as given is the stand's, under the same name.
        value = getattr(stand, field) if value is None else value
        found.append(_RANGES[name].share(value / factor))
    return found


def more_shifts(
    truth: Truth, stage: Stage, point: Point, count: int, seed: int
) -> tuple[float, ...]:
    """Return the mean time in s of those of ``count`` new shifts that engage, if any does."""
    times = [shift.time for shift in _new_shifts(truth, stage, point, count, seed)]
    engaged = [time for time in times if time is not None]
    return (float(np.mean(engaged)),) if engaged else ()


def more_traces(
    truth: Truth, stage: Stage, point: Point, count: int, seed: int
) -> tuple[float, ...]:
    """Return the marks of the flight in s of ``count`` new shifts, NaN for those not shown.

    Empty where no shift engages or no mark is shown.
    """
    generator = np.random.default_rng(seed)
    shifts = _new_shifts(truth, stage, point, count, seed, keep=True)
    fade = 1.0 - truth.drift
    tables = [measured_rows(truth, point, shift, fade, generator) for shift in shifts]
    units = (1.0, MM, 1.0, RPM, RPM)
    traces = [
        BenchTrace(Path("trace"), *(table * units).T) for table in tables if table is not None
    ]
    if not traces:
        return ()
    marks = joined_marks(traces, ForceProfile(point.force, point.rise), stage.stand.gap)
    found = tuple(np.nan if mark is None else mark.time for mark in marks)
    return () if np.isnan(found).all() else found


def _new_shifts(
    truth: Truth, stage: Stage, point: Point, count: int, seed: int, *, keep: bool = False
) -> list[Shift]:
    engine, stand = engine_of(stage.engine, stage.stand, truth), stage.stand
    # They come after the series, when all that drifts away is gone.
    mine = [replace(d, fade=1.0 - truth.drift) for d in draws(truth, stand, 1, count, seed)[0]]
    return [engine.shift(point, draw, keep) for draw in mine]


def _point_of(test: Record, stage: Stage) -> Point:
    for point in stage.points:
        here = (point.mismatch / RPM, point.force)
        if np.allclose(here, (test["mismatch_rpm"], test["force_N"]), rtol=1e-6):
            return point
    raise StorageError(
        f"a result advises shifts at {test['mismatch_rpm']:.6g} 1/min and {test['force_N']:.6g} N, "
        "but the set has no such operating point; remove the results and run again"
    )


def updated(
    chances: Mapping[Names, float], predictions: Iterable[Record], outcome: Sequence[float]
) -> dict[Names, float]:
    """Update probabilities by an outcome; hypotheses without a prediction get none.

    Parameters
    ----------
    chances : before, by hypothesis.
    predictions : densities of each plausible hypothesis, as the record has them.
    outcome : as many values as each mean has; NaN counts as not measured.
    """
    by_name: dict[Names, list[Record]] = {}
    for one in predictions:
        by_name.setdefault(names_of(one["effects"]), []).append(one)
    if not by_name:
        return {}
    names, known = list(by_name), np.isfinite(outcome)
    rows = [row for mine in by_name.values() for row in mine]
    whole = [row.get("covariance", np.diag(np.square(row["sd"]))) for row in rows]
    density = Outcome(
        owner=np.repeat(np.arange(len(names)), [len(mine) for mine in by_name.values()]),
        share=np.array([row.get("share", 1.0) for row in rows]),
        mean=np.array([row["mean"] for row in rows])[:, known],
        covariance=np.array(whole)[:, known][:, :, known],
        read=np.zeros(len(names), dtype=bool),
    )
    odds = np.array([float(mine[0].get("imitator_odds", 0.0)) for mine in by_name.values()])
    log = density.log_density(np.array([outcome])[:, known])
    # Without odds it does not matter where *unknown* stands.
    unknown = names.index(names_of(UNKNOWN)) if odds.any() else 0
    before = np.array([max(1e-300, chances.get(name, 0.0)) for name in names])
    after = probabilities_after(before / before.sum(), log, odds, unknown)[0]
    return dict(zip(names, after.tolist(), strict=True))


def settled_figures(ambiguous: int, tests: Sequence[Advised]) -> Record:
    """Compute the figures of some ambiguous cases, of which ``tests`` have a test.

    A test whose outcome nothing predicts is not judged, and counts as not settled.
    """
    by_kind = {kind: [t for t in tests if t.kind == kind] for kind in KINDS}
    return {
        "ambiguous": ambiguous,
        "judged": sum(t.judged for t in tests),
        "settled": share(t.settled for t in tests),
        "settled_as_truth": share(t.exact for t in tests),
        "wrongly_settled": share(t.wrong for t in tests),
        "wrong": sum(t.wrong for t in tests),
        "by_kind": {kind: share(t.settled for t in part) for kind, part in by_kind.items()},
    }
