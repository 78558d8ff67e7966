r"""Self-consistency of the diagnosis: data sets drawn from its own emulator and priors.

A cause is drawn from the prior probabilities of hypotheses, its parameters from their priors, the
data as the likelihood says (``diagnosis.likelihood.replicates``). Then probabilities have to hold
what they say, ranks of true values are uniform (Talts et al. 2018, simulation-based calibration),
and how often the cause is found is the ceiling for any data: no other engine does better.

**Noncentrality.** What can be told is the squared distance that is left after the best refit by
rivals,

.. math:: \lambda = \min_{h, \theta} (\mu - \mu_h(\theta))^T \Sigma^{-1} (\mu - \mu_h(\theta)),

of the expected data :math:`\mu` in the covariance of all errors, the discrepancy before the data
included. Rivals are all hypotheses that lack an effect of the cause. The expected log likelihood
ratio is half of it.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from dogshape.diagnosis.bench.bench_data import Bench, setting_of
from dogshape.diagnosis.bench.reading import Cell, Reading
from dogshape.diagnosis.bench.sense import REVERSED
from dogshape.diagnosis.diagnosis import diagnose
from dogshape.diagnosis.likelihood.observations import observe
from dogshape.diagnosis.likelihood.replicates import offsets_of, replicate
from dogshape.diagnosis.likelihood.scores import Problem, Scored
from dogshape.diagnosis.likelihood.signature import metric_of, squared
from dogshape.diagnosis.prediction.hypotheses import (
    UNKNOWN,
    Space,
    priors_of,
    spaces_of,
)
from dogshape.diagnosis.prediction.prediction import Emulator, Prediction
from dogshape.diagnosis.settings import USUAL, Settings
from dogshape.diagnosis.terms import Array, Hypothesis
from dogshape.sim.effect import Effect
from dogshape.sim.shift.clutch import OperatingPoint

COUNTS = {False: (3, 5, 10, 20, 50), True: (3, 5, 10, 20)}  #: shifts at a point: means, singles
POINTS = (6, 12)  #: operating points of a set, at least and at most
STRONG, WEAK = 38.0, 9.0  #: noncentralities from which a cause should be found, and seen at all


@dataclass(frozen=True)
class Some:
    """Emulator of some operating points of another one, by their places."""

    emulator: Emulator
    places: tuple[int, ...]

    def at(self, hypothesis: Hypothesis, values: Array, cell: int) -> Prediction:
        """Predict an operating point at ``values`` (m, p) of a hypothesis."""
        return self.emulator.at(hypothesis, values, self.places[cell])


@dataclass(frozen=True)
class World:
    """Source of sets: a bench with its operating points, its emulator, and effects."""

    bench: Bench
    emulator: Emulator
    effects: Mapping[str, Effect]
    settings: Settings = USUAL

    @cached_property
    def spaces(self) -> tuple[Space, ...]:
        """Hypotheses that a set is drawn from: none, each effect, and all pairs."""
        spaces = spaces_of(self.effects, setting_of(self.bench), priors=self.settings.priors)
        return tuple(s for s in spaces if REVERSED not in s.hypothesis)

    @cached_property
    def chances(self) -> dict[Hypothesis, float]:
        """Probabilities with which causes are drawn."""
        return priors_of([s.hypothesis for s in self.spaces], "known", self.settings.priors)


@dataclass(frozen=True)
class Drawn:
    """One set: its cause with values (p,) and shares (p,) of the priors, and the data."""

    cause: Hypothesis
    values: Array
    shares: Array
    bench: Bench
    emulator: Some


@dataclass(frozen=True)
class Answer:
    """Answer of a diagnosis to a set, beside the truth.

    Parameters
    ----------
    cause, noncentrality : truth, and what rivals leave of it.
    raw : probabilities by evidence, without those of unknown, which is never drawn.
    posterior, verdict, named, credible, group : of the diagnosis.
    ranks : share of the posterior below each true value, (p,).
    fit : predictive p-value of the cause, None where it is not plausible.
    """

    cause: Hypothesis
    noncentrality: float
    raw: Mapping[Hypothesis, float]
    posterior: Mapping[Hypothesis, float]
    verdict: str
    named: tuple[str, ...]
    credible: tuple[Hypothesis, ...]
    group: tuple[Hypothesis, ...]
    ranks: Array
    fit: float | None = None


def draw(world: World, generator: np.random.Generator) -> Drawn:
    """Draw a set from the priors: cause, parameters, operating points, shifts, and their times."""
    spaces = {s.hypothesis: s for s in world.spaces}
    cause = list(spaces)[int(generator.choice(len(spaces), p=list(world.chances.values())))]
    shares, values = _values(spaces[cause], generator)
    cells = len(world.bench.cells)
    number = int(generator.integers(POINTS[0], min(POINTS[1], cells) + 1))
    places = tuple(sorted(generator.choice(cells, number, replace=False).tolist()))
    emulator = Some(world.emulator, places)
    single = bool(generator.random() < 0.5)
    numbers = generator.choice(COUNTS[single], number).tolist()
    points = [world.bench.cells[k].point for k in places]
    blank = [blank_cell(p, n, single=single) for p, n in zip(points, numbers, strict=True)]
    bench = replace(world.bench, name="drawn", cells=tuple(blank))
    problem = Problem(observe(bench), emulator, world.settings)
    said = problem.predictions(cause, values[None])
    offsets = offsets_of(said, problem.discrepancy, generator)
    drawn = replicate(said, blank, offsets, generator)
    return Drawn(cause, values, shares, replace(bench, cells=drawn), emulator)


def blank_cell(point: OperatingPoint, number: int, *, single: bool) -> Cell:
    """Make a cell of so many shifts, whose times say nothing."""
    rows = (
        [Reading(0, point, 1, 1.0, True)] * number
        if single
        else [Reading(0, point, number, 1.0, True)]
    )
    return Cell(point, tuple(rows))


def _values(space: Space, generator: np.random.Generator) -> tuple[Array, Array]:
    """Draw shares and values of a hypothesis' parameters that give a bench."""
    while True:
        shares = generator.random((1, len(space.parameters)))
        values = space.values(shares)
        if space.possible(values)[0]:
            return shares[0], values[0]


def answer(world: World, one: Drawn) -> Answer:
    """Diagnose a set, and say what its rivals leave of its cause."""
    found = diagnose(one.bench, one.emulator, world.effects, settings=world.settings)
    problem = problem_of(world, one)
    known = {h: p for h, p in found.raw.items() if h != UNKNOWN and REVERSED not in h}
    mine = found.scored[one.cause]
    weights = mine.weights()
    below = mine.rows.shares < one.shares
    return Answer(
        cause=one.cause,
        noncentrality=noncentrality(problem, one, found.scored),
        raw={h: p / sum(known.values()) for h, p in known.items()},
        posterior=found.posterior,
        verdict=found.verdict.kind,
        named=found.verdict.causes,
        credible=found.verdict.credible,
        group=found.verdict.group,
        ranks=weights @ below if one.cause else np.zeros(0),
        fit=found.fits.get(one.cause),
    )


def problem_of(world: World, one: Drawn) -> Problem:
    """Pose the inference problem of a set."""
    return Problem(observe(one.bench), one.emulator, world.settings)


def noncentrality(problem: Problem, one: Drawn, scored: Mapping[Hypothesis, Scored]) -> float:
    """Compute what the best values of rivals leave of the expected data, squared errors.

    Rivals are the hypotheses that lack an effect of the cause; without any cause there is none,
    and the value is 0. ``scored`` has the values at which each was looked into.
    """
    if not one.cause:
        return 0.0
    truth = problem.summary(one.cause, one.values[None])
    metric = metric_of(problem.seen, truth, problem.discrepancy)
    place = metric.of(truth)
    rivals = [s.rows.predicted for h, s in scored.items() if is_rival(h, one.cause)]
    return min(float(squared(metric.of(rows), place).min()) for rows in rivals)


def stratified(
    found: Sequence[Answer], chances: Mapping[Hypothesis, float], figure: Callable[[Answer], float]
) -> tuple[float, float]:
    """Average a figure as if each number of effects had been drawn as often as its prior says.

    How many of the sets drawn have no effect is chance, and such a set is found far more often than
    a pair. Returns the mean and its standard error (Cochran 1977, ch. 5). Raises ValueError where
    fewer than two sets have a number that causes may have.
    """
    mean, square = 0.0, 0.0
    counts = Counter(len(a.cause) for a in found)
    for number in sorted({len(h) for h, p in chances.items() if p > 0.0}):
        if counts[number] < 2:
            raise ValueError(f"{counts[number]} sets have {number} effects, but two are needed")
        mine = np.array([figure(a) for a in found if len(a.cause) == number], dtype=float)
        weight = sum(p for h, p in chances.items() if len(h) == number)
        mean += weight * float(mine.mean())
        square += weight**2 * float(mine.var(ddof=1)) / mine.size
    return mean, float(np.sqrt(square))


def is_rival(hypothesis: Hypothesis, cause: Collection[str]) -> bool:
    """Test that a hypothesis of the known sense lacks an effect of the cause."""
    return REVERSED not in hypothesis and not set(cause) <= set(hypothesis)


def as_row(found: Answer) -> dict[str, Any]:
    """Write an answer for a line of JSON."""
    return {
        "cause": list(found.cause),
        "noncentrality": found.noncentrality,
        "raw": [[list(h), p] for h, p in found.raw.items()],
        "posterior": [[list(h), p] for h, p in found.posterior.items()],
        "verdict": found.verdict,
        "named": list(found.named),
        "credible": [list(h) for h in found.credible],
        "group": [list(h) for h in found.group],
        "ranks": found.ranks.tolist(),
        "fit": found.fit,
    }


def from_row(row: Mapping[str, Any]) -> Answer:
    """Read an answer from what ``as_row`` wrote."""
    return Answer(
        cause=tuple(row["cause"]),
        noncentrality=row["noncentrality"],
        raw={tuple(h): p for h, p in row["raw"]},
        posterior={tuple(h): p for h, p in row["posterior"]},
        verdict=row["verdict"],
        named=tuple(row["named"]),
        credible=tuple(map(tuple, row["credible"])),
        group=tuple(map(tuple, row["group"])),
        ranks=np.array(row["ranks"]),
        fit=row["fit"],
    )


def in_set(probabilities: Mapping[Hypothesis, float], cause: Hypothesis, share: float) -> bool:
    """Test that a cause is among the most probable hypotheses that have a share together."""
    more = sum(p for p in probabilities.values() if p > probabilities[cause])
    return more < share


def leading(found: Answer) -> Hypothesis:
    """Find the most probable hypothesis of an answer."""
    return max(found.posterior, key=lambda h: found.posterior[h])
