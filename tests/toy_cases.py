"""Random cases of the toy bench, their diagnosis, and how often it is right."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dogshape.diagnosis.diagnosis import Diagnosis, diagnose
from dogshape.diagnosis.likelihood.cell_predictions import CellPredictions
from dogshape.diagnosis.likelihood.scores import summary_of
from dogshape.diagnosis.likelihood.signature import VISIBLE
from dogshape.diagnosis.prediction.hypotheses import NONE, UNKNOWN, log_odds, pairs_of
from dogshape.diagnosis.settings import Rules
from dogshape.diagnosis.terms import Hypothesis
from dogshape.sim.shift.clutch import OperatingPoint
from tests.toy import EFFECTS, STRENGTHS, Toy, bench_of, points_of

#: Effects that the toy knows, and two that change nothing in it.
NAMES = (*sorted(STRENGTHS), "contact_stiffness", "drag_torque")
ALIASES = frozenset({"actuation_delay", "actuation_lag"})  #: the toy's lag is a delay
ENDS = (235.2, 641.5)  #: N, of which a case has all speeds
KINDS = {"none": 0.15, "single": 0.55, "pair": 0.15, "unknown": 0.15}


@dataclass(frozen=True)
class Case:
    """A truth and what was found."""

    truth: Hypothesis
    values: dict[str, float]
    found: Diagnosis
    points: tuple[OperatingPoint, ...]

    @property
    def top(self) -> Hypothesis:
        """The most probable hypothesis."""
        return next(iter(self.found.posterior))

    @property
    def seen(self) -> Hypothesis:
        """The truth without effects that are too weak for this data to show."""
        if self.truth in (NONE, UNKNOWN):
            return self.truth
        here = self._signature(self.truth)
        for simpler in [NONE, *((name,) for name in self.truth)][: 2 * len(self.truth) - 1]:
            if float(((here - self._signature(simpler)) ** 2).sum()) < VISIBLE:
                return simpler
        return self.truth

    def _signature(self, hypothesis: Hypothesis) -> np.ndarray:
        parameters = [p for name in hypothesis for p in EFFECTS[name].parameters]
        values = np.array([[self.values[p.name] for p in parameters]])
        toy = Toy(self.points)
        spreads = [toy.at(hypothesis, values, cell) for cell in range(len(toy.points))]
        return self.found.metric.of(summary_of(CellPredictions.of(spreads, Rules())))[0]

    @property
    def right(self) -> bool:
        """Whether that is the truth as far as it can be seen."""
        return self.top == self.seen

    @property
    def right_class(self) -> bool:
        """Whether the truth is in its class, the toy's aliases taken as one."""
        group = self.found.confusion.class_of(self.top)
        return _merged(self.seen) in {_merged(h) for h in (*group, self.top)}


def _merged(hypothesis: Hypothesis) -> frozenset[str]:
    return frozenset("late" if name in ALIASES else name for name in hypothesis)


def random_case(seed: int, *, single: bool = False, forces: Sequence[float] = ENDS) -> Case:
    """Return a case whose truth is drawn from the priors, and its diagnosis."""
    points = points_of(forces)
    generator = np.random.default_rng(seed)
    kind = generator.choice(list(KINDS), p=list(KINDS.values()))
    truth, values, extra = NONE, {}, None
    if kind == "unknown":
        truth, extra = UNKNOWN, _wave(generator, len(points))
    elif kind != "none":
        alone: Sequence[Hypothesis] = [(name,) for name in sorted(STRENGTHS)]
        known = alone if kind == "single" else pairs_of(list(STRENGTHS))
        odds = np.exp([log_odds(h) for h in known])
        truth = known[generator.choice(len(known), p=odds / odds.sum())]
        values = _values(truth, generator)
    bench = bench_of(values, generator, single=single, extra=extra, points=points)
    effects = {name: EFFECTS[name] for name in NAMES}
    return Case(truth, values, diagnose(bench, Toy(points), effects), points)


def _values(truth: Hypothesis, generator: np.random.Generator) -> dict[str, float]:
    parameters = [p for name in truth for p in EFFECTS[name].parameters]
    values = {p.name: p.at(float(generator.random())) for p in parameters}
    if values.get("dynamic_friction", 0.0) > values.get("static_friction", 1.0):
        return _values(truth, generator)
    return values


def _wave(generator: np.random.Generator, count: int) -> np.ndarray:
    """Return a gap that goes up and down over the operating points, s, (count,)."""
    size, pace, start = generator.uniform((0.02, 0.7, 0.0), (0.06, 2.0, 6.0))
    return size * np.sin(pace * np.arange(count) + start)


def _share(flags: Sequence[bool]) -> float:
    return sum(flags) / len(flags) if flags else float("nan")


def figures(cases: Sequence[Case]) -> dict[str, float]:
    """Return how good the diagnoses are."""
    named = [c for c in cases if c.found.verdict.kind == "effect"]
    none = [c for c in cases if c.seen == NONE]
    tops = np.array([c.found.posterior[c.top] for c in cases])
    right = np.array([c.right for c in cases])
    inside = [c.seen in c.found.verdict.credible for c in cases]
    truth = np.array([c.found.posterior.get(c.seen, 0.0) for c in cases])
    return {
        "cases": len(cases),
        "top_1": float(right.mean()),
        "top_class": float(np.mean([c.right_class for c in cases])),
        "named": len(named),
        "precision_when_named": _share([c.right for c in named]),
        "none_cases": len(none),
        "false_alarms": _share([c.found.verdict.kind == "effect" for c in none]),
        "coverage_of_90_set": float(np.mean(inside)),
        "size_of_90_set": float(np.mean([len(c.found.verdict.credible) for c in cases])),
        "mean_top_probability": float(tops.mean()),
        "mean_log_score": float(np.mean(np.log(np.maximum(truth, 1e-6)))),
    }
