"""Draws from the posterior of a diagnosis as keys of a study: other sizes, and other effects.

All of them have what the study's file says is part of the cause. Beside it they have what else may
be there, by its probability.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from dogshape.diagnosis.bench.sense import REVERSED
from dogshape.diagnosis.diagnosis import Diagnosis
from dogshape.diagnosis.terms import Hypothesis
from dogshape.pipeline.diagnose.bench_study import rounded
from dogshape.pipeline.diagnose.effect_keys import EffectKeys
from dogshape.sim.effect import Effect

DRAWS = 200  #: of the posterior
LEAST = 1e-9  #: probability of a set that was asked for, so that it can be drawn
RARE = 0.005  #: probability below which a hypothesis is not drawn


def rivals_of(found: Diagnosis, chosen: Hypothesis, asked: Sequence[str] = ()) -> list[Hypothesis]:
    """List the other hypotheses that hold the named effects and have the chosen sense.

    What was asked for belongs to all of them: draws without it would be of another machine.
    """
    causes, turned = {*found.verdict.causes, *asked}, REVERSED in chosen
    return [
        h
        for h, p in found.posterior.items()
        if h in found.scored and h != chosen and causes <= set(h) and p >= RARE
        if (REVERSED in h) == turned
    ]


def effects_beside(
    found: Diagnosis, rival: Hypothesis, chosen: Hypothesis, keys: EffectKeys
) -> dict[str, Effect]:
    """Return the effects of a rival that the chosen hypothesis lacks and a study takes."""
    names = [name for name in rival if name not in chosen]
    return {n: found.effects[n] for n in names if keys.takes(found.effects[n])}


def drawn_from(
    found: Diagnosis, those: Sequence[Hypothesis], count: int, seed: int
) -> list[tuple[Hypothesis, dict[str, float]]]:
    """Draw hypotheses by their probabilities, each with values from its posterior."""
    generator = np.random.default_rng(seed)
    shares = np.array([max(found.posterior.get(h, 0.0), LEAST) for h in those])
    which = generator.choice(len(those), size=count, p=shares / shares.sum())
    rows = []
    for place in which:
        one = found.scored[those[place]]
        values = one.space.values(one.rows.shares[one.draw(1, generator)])[0]
        names = [parameter.name for parameter in one.space.parameters]
        rows.append((those[place], dict(zip(names, map(rounded, values.tolist()), strict=True))))
    return rows


def row_of(
    number: int,
    hypothesis: Hypothesis,
    values: Mapping[str, float],
    taken: Mapping[str, Effect],
    keys: EffectKeys,
) -> dict[str, Any]:
    """Return a draw as keys of the study; an effect that it lacks has its neutral values."""
    found: dict[str, Any] = {"draw": number, "hypothesis": " + ".join(hypothesis)}
    for name, effect in taken.items():
        mine = {p.name: values[p.name] for p in effect.parameters} if name in hypothesis else None
        found |= keys.settings(effect, mine or effect.neutral(keys.base))
    return found
