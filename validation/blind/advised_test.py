r"""Check of the advised test: does its outcome settle an ambiguous case.

The outcome *y* of the test comes from the case's truth, never from the diagnosis. A direct test
reads the true parameters as shares of their priors, with an error of a twentieth. More shifts are
made by the same engine with other draws, and their mean is read. The predictions of the hypotheses,
normal densities in the record of the diagnosis, then count by Bayes:

.. math:: p'(h) \propto p(h) \prod_k N(y_k; \mu_{hk}, \sigma_{hk}).

The case is *settled* if the truth, or a member of its class, then leads with more than 0.8, and
*wrongly settled* if any other hypothesis does. No hypothesis predicts traces, so traces settle
nothing here.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any
from zlib import crc32

import numpy as np

from dogshape.sim.errors import StorageError
from dogshape.sim.units import RPM
from dogshape.validation.blind.case_marks import Names, class_of, names_of
from dogshape.validation.blind.data import draws
from dogshape.validation.blind.intervals import share
from dogshape.validation.blind.mujoco_shift import Engine
from dogshape.validation.blind.stand import Point, Stand, Truth, read_stand
from dogshape.validation.blind.true_effects import FIELDS, RANGES, SWITCHES, truth_of

Record = dict[str, Any]

SURE = 0.8  #: probability above which a hypothesis counts as settled on
ERROR = 0.05  #: standard error of a direct test, as share of a parameter's prior
KINDS = ("direct", "shifts", "traces")
_RANGES = {one.name: one for ranges in RANGES.values() for one in ranges}


@dataclass(frozen=True)
class Stage:
    """Place of a test: the stand of the case, and operating points with their true rises."""

    stand: Stand
    points: tuple[Point, ...]


@dataclass(frozen=True)
class Advised:
    """Outcome of the advised test of one case.

    Parameters
    ----------
    test, kind : its name, and one of ``KINDS``.
    outcome : shares of the priors, or one mean time in s; empty where nothing came out.
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

    def as_dict(self) -> Record:
        """Return a row of the score."""
        best = max(self.chances, key=lambda h: self.chances[h], default=None)
        return {
            "test": self.test,
            "kind": self.kind,
            "outcome": list(self.outcome),
            "top": None if best is None else list(best),
            "probability": None if best is None else self.chances[best],
            "settled": self.settled,
            "settled_as_truth": self.exact,
            "wrongly_settled": self.wrong,
        }


def advised_tests(
    folder: Path,
    key: Record,
    results: Mapping[str, Record],
    advance: Callable[[int], None] | None = None,
) -> dict[str, Advised]:
    """Simulate the advised test of each ambiguous case whose record predicts one.

    Parameters
    ----------
    folder : of the set, for the stands of its cases.
    key, results : of the set; results by case.
    advance : counts shifts.

    Raises InputError where shifts are asked for without MuJoCo, StorageError where a record
    names an operating point that the set has not.
    """
    found = {}
    for name, test in _tests(results).items():
        case, result = key["cases"][name], results[name]["diagnosis"]
        found[name] = judged_by_test(name, case, result, partial(stage_of, folder, key, name))
        if advance is not None and "shifts" in test:
            advance(int(test["shifts"]))
    return found


def shifts_asked(results: Mapping[str, Record]) -> int:
    """Count the shifts of all advised tests of ambiguous cases."""
    return sum(int(test.get("shifts", 0)) for test in _tests(results).values())


def _tests(results: Mapping[str, Record]) -> dict[str, Record]:
    """Return the advised tests of the ambiguous cases."""
    every = {name: result.get("diagnosis", {}) for name, result in results.items()}
    return {
        name: one["next_test"]
        for name, one in every.items()
        if one.get("verdict") == "ambiguous" and "kind" in one.get("next_test", {})
    }


def stage_of(folder: Path, key: Record, name: str) -> Stage:
    """Read the stand and the operating points of a case of a set."""
    points = tuple(Point(*point) for point in key["points"])
    return Stage(read_stand(folder / "cases" / name), points)


def judged_by_test(name: str, case: Record, result: Record, stage: Callable[[], Stage]) -> Advised:
    """Simulate the advised test of a case, by its truth and its diagnosis.

    ``stage`` is asked where the test needs one; traces need none.
    """
    test = result["next_test"]
    outcome = () if test["kind"] == "traces" else outcome_of(name, case, test, stage())
    truth = names_of(case["causes"])
    chances = {names_of(h["effects"]): float(h["probability"]) for h in result["hypotheses"]}
    return Advised(
        test=test["name"],
        kind=test["kind"],
        outcome=outcome,
        truth=truth,
        group=class_of(truth, result),
        chances=updated(chances, test["foretold"], outcome) if outcome else {},
    )


def outcome_of(name: str, case: Record, test: Record, stage: Stage) -> tuple[float, ...]:
    """Return the outcome of a direct test or of more shifts; empty where no shift engaged.

    The same name and seed of a case give the same outcome.
    """
    generator = np.random.default_rng([crc32(name.encode()), int(case.get("seed", 0))])
    truth = truth_of(case["parameters"], case["outside"])
    if test["kind"] == "direct":
        exact = shares_of(truth, stage.stand, test["parameters"])
        return tuple(float(s) for s in generator.normal(exact, ERROR))
    seed = int(generator.integers(2**31))
    return more_shifts(truth, stage.stand, _point_of(test, stage), test["shifts"], seed)


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
    truth: Truth, stand: Stand, point: Point, count: int, seed: int
) -> tuple[float, ...]:
    """Return the mean time in s of those of ``count`` new shifts that engage, if any does."""
    engine = Engine(stand, truth)
    # They come after the series, when all that drifts away is gone.
    mine = [replace(d, fade=1.0 - truth.drift) for d in draws(truth, stand, 1, count, seed)[0]]
    times = [shift.time for shift in (engine.shift(point, draw) for draw in mine)]
    engaged = [time for time in times if time is not None]
    return (float(np.mean(engaged)),) if engaged else ()


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
    predictions : ``effects``, ``mean`` and ``sd`` of each plausible hypothesis.
    outcome : as many values as each mean has.
    """
    logs = {}
    for one in predictions:
        mean, sd = np.array(one["mean"]), np.array(one["sd"])
        score = (np.array(outcome) - mean) / sd
        prior = max(1e-300, chances.get(names_of(one["effects"]), 0.0))
        logs[names_of(one["effects"])] = float(np.log(prior) - np.sum(0.5 * score**2 + np.log(sd)))
    largest = max(logs.values(), default=0.0)
    raw = {h: float(np.exp(log - largest)) for h, log in logs.items()}
    return {h: weight / sum(raw.values()) for h, weight in raw.items()}


def settled_figures(ambiguous: int, tests: Sequence[Advised]) -> Record:
    """Compute the figures of some ambiguous cases, of which ``tests`` predict a test."""
    by_kind = {kind: [t for t in tests if t.kind == kind] for kind in KINDS}
    return {
        "ambiguous": ambiguous,
        "judged": len(tests),
        "settled": share(t.settled for t in tests),
        "settled_as_truth": share(t.exact for t in tests),
        "wrongly_settled": share(t.wrong for t in tests),
        "wrong": sum(t.wrong for t in tests),
        "by_kind": {kind: share(t.settled for t in part) for kind, part in by_kind.items()},
    }
