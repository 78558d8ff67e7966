"""Effects simulated together where several may be the cause.

A bank has each effect alone and few together: all pairs at many values would take hours. What is
combined from effects alone may be wrong by a third of a time, and by more than it says. So
hypotheses of several effects that are near the best are simulated at values that the data favour,
and scored again, until those that are near have been. Each round draws its levels from what the
posterior was before it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from dogshape.diagnosis.inference.evidence import scored_in_turn
from dogshape.diagnosis.likelihood.scores import Problem, Scored
from dogshape.diagnosis.prediction.hypotheses import log_odds
from dogshape.diagnosis.prediction.levels import Level, farthest
from dogshape.diagnosis.prediction.prediction import SimulatingEmulator
from dogshape.diagnosis.settings import Decision
from dogshape.diagnosis.terms import Hypothesis

DRAWS = 96  #: from which the levels of a round are chosen
GRID = 128  #: steps of a prior on which they lie


@dataclass(frozen=True)
class Refined:
    """Scores after effects were simulated together.

    Parameters
    ----------
    problem : with the emulator that has the joint levels.
    scored : all hypotheses.
    levels : that were simulated.
    """

    problem: Problem
    scored: dict[Hypothesis, Scored]
    levels: tuple[Level, ...]


def refined(
    problem: Problem, scored: Mapping[Hypothesis, Scored], new: Sequence[Hypothesis] | None = None
) -> Refined:
    """Simulate plausible effects together, and score their hypotheses again.

    ``new`` are the hypotheses that may be simulated, all by default.
    """
    found, limits = dict(scored), problem.settings.decision
    if not isinstance(problem.emulator, SimulatingEmulator):
        return Refined(problem, found, ())
    emulator = problem.emulator
    counts, every = dict[Hypothesis, int](), list[Level]()
    mine = [h for h in found if len(emulator.acting(h)) > 1 and (new is None or h in new)]
    for _ in range(limits.rounds):
        near = _near(problem, found, mine)
        asked: dict[Hypothesis, list[Level]] = {}
        for h in near:
            acting = emulator.acting(h)
            # What an answer before had simulated counts too, so that the next takes no longer.
            counts.setdefault(acting, emulator.joint_levels(acting) // limits.together)
            if counts[acting] < limits.rounds_each and acting not in asked:
                counts[acting] += 1
                asked[acting] = _levels(found[h], acting, limits.together)
            if len(asked) == limits.near_pairs:
                break
        levels = [level for some in asked.values() for level in some]
        if not levels:
            break
        every += levels
        emulator = emulator.with_levels(levels)
        problem = replace(problem, emulator=emulator)
        changed = [h for h in found if any(set(some) <= set(emulator.acting(h)) for some in asked)]
        best = max(_value(problem, one) for h, one in found.items() if h not in changed)
        found |= scored_in_turn(problem, [found[h].space for h in changed], best)
    return Refined(problem, found, tuple(every))


def _value(problem: Problem, one: Scored) -> float:
    return one.log_evidence + log_odds(one.hypothesis, problem.settings.priors)


def _near(
    problem: Problem, scored: Mapping[Hypothesis, Scored], mine: Sequence[Hypothesis]
) -> list[Hypothesis]:
    """List the hypotheses that lie near the best, the nearest first."""
    best = max(_value(problem, one) for one in scored.values())
    values = {h: _value(problem, scored[h]) for h in mine}
    near = (h for h in mine if values[h] > best - problem.settings.decision.within)
    open_to = (h for h in near if _unsure(h, scored, problem.settings.decision))
    return sorted(open_to, key=lambda h: -values[h])


def _unsure(hypothesis: Hypothesis, scored: Mapping[Hypothesis, Scored], limits: Decision) -> bool:
    """Test that effects together explain more than fewer of them, or would if better known.

    Where one of them hardly acts they do not, and their combination is known well.
    """
    fewer = [h for n in range(len(hypothesis)) for h in combinations(hypothesis, n) if h in scored]
    best = max(fewer, key=lambda h: scored[h].log_evidence)
    gain = scored[hypothesis].log_evidence - scored[best].log_evidence
    if abs(gain) < limits.more:
        return _error(scored[hypothesis]) > limits.doubt * _error(scored[best])
    return gain > 0.0


def _error(one: Scored) -> float:
    """Compute the posterior mean of a prediction's error over the mean time, rms over the cells."""
    rows = one.rows
    squares = (rows.predicted.error**2 + rows.joint**2) / rows.predicted.mean**2
    return float(one.weights() @ np.sqrt(np.nanmean(squares, axis=1)))


def _levels(one: Scored, acting: Hypothesis, count: int) -> list[Level]:
    """Choose values of the acting effects that the data favour, far from each other.

    The first is the likeliest, each next the draw of the posterior farthest from all before. They
    lie on a grid of the priors, so that the last digits of a posterior ask for no other shifts.
    """
    parameters = [p for name in acting for p in one.space.parameters_of(name)]
    places_of = [one.space.columns(name) for name in acting]
    columns = [k for some in places_of for k in range(some.start, some.stop)]
    best = int(one.weights().argmax())
    drawn = one.draw(DRAWS, np.random.default_rng(len(one.log_prior)))
    shares = np.round(GRID * one.rows.shares[[best, *drawn]]) / GRID
    places = shares[one.space.possible(one.space.values(shares))][:, columns]
    chosen = [0, *farthest(places, places[0], count - 1)] if len(places) else []
    return [
        Level(acting, tuple(p.at(float(s)) for p, s in zip(parameters, places[k], strict=True)))
        for k in chosen
    ]
