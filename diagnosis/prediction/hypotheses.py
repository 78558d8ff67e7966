"""Hypotheses on the cause of a gap: none, one effect, any pair, or unknown.

Each effect is part of the cause or not by itself, before the data are seen: most actuators have a
dead time and most rings rub on their shafts, linkages often give way, all else is rare
(``diagnosis.settings.Priors``). So a hypothesis is as probable as its effects being
there and all others not. *Unknown* has its own probability. All pairs are tried; if none can have
made the data but with a large discrepancy, the nearest are tried with each further effect.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from dogshape.diagnosis.bench.sense import REVERSED, Sense, both_senses, forward
from dogshape.diagnosis.prediction.levels import columns_of
from dogshape.diagnosis.settings import USUAL, Priors
from dogshape.diagnosis.terms import NONE, UNKNOWN, Array, Hypothesis
from dogshape.sim.effect import Effect, Parameter
from dogshape.sim.setting import Setting

PRIORS = USUAL.priors
TRIED = 7  #: values of each parameter that are tried for whether there are such benches


@dataclass(frozen=True)
class Space:
    """The parameters of a hypothesis as a unit cube of shares of their priors.

    ``parameters`` are those of its effects in alphabetical order, effect by effect.
    ``bounded`` are effects of which some values give no bench.
    """

    effects: tuple[Effect, ...]
    setting: Setting
    bounded: frozenset[str] = frozenset()

    @property
    def hypothesis(self) -> Hypothesis:
        """Names of the effects."""
        return tuple(effect.name for effect in self.effects)

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """All parameters."""
        return tuple(p for effect in self.effects for p in effect.parameters)

    def values(self, shares: Array) -> Array:
        """Return values (m, p) at shares (m, p) of the priors."""
        columns = [at_shares(p, shares[:, k]) for k, p in enumerate(self.parameters)]
        return np.stack(columns, axis=1) if columns else np.zeros((len(shares), 0))

    def columns(self, name: str) -> slice:
        """Find the columns of the parameters of an effect."""
        return columns_of(self.hypothesis, {effect.name: effect for effect in self.effects})[name]

    def parameters_of(self, name: str) -> tuple[Parameter, ...]:
        """Find the parameters of an effect."""
        return self.parameters[self.columns(name)]

    def possible(self, values: Array) -> np.ndarray:
        """Mark the values (m, p) that give a bench, (m,)."""
        result = np.ones(len(values), dtype=bool)
        for effect in self.effects:
            if effect.name in self.bounded:
                part = values[:, self.columns(effect.name)]
                result &= np.array([_possible(effect, self.setting, row) for row in part])
        return result


def at_shares(parameter: Parameter, shares: Array) -> Array:
    """Return the values of a parameter at shares (m,) of its prior."""
    low, high = parameter.low, parameter.high
    if parameter.scale == "uniform":
        return low + shares * (high - low)
    return low * (high / low) ** shares


def _possible(effect: Effect, setting: Setting, row: Sequence[float]) -> bool:
    names = [parameter.name for parameter in effect.parameters]
    return effect.possible(setting, dict(zip(names, map(float, row), strict=True)))


def _bounded(effect: Effect, setting: Setting) -> bool:
    """Test that some values within the priors give no bench."""
    ticks = np.linspace(0.0, 1.0, TRIED)
    grid = itertools.product(*([p.at(t) for t in ticks] for p in effect.parameters))
    return not all(_possible(effect, setting, row) for row in grid)


def pairs_of(effects: Sequence[str], priors: Priors = PRIORS) -> tuple[Hypothesis, ...]:
    """Return all pairs of effects, the likeliest before the data first."""
    those = sorted(name for name in effects if name != REVERSED)
    return tuple(sorted(itertools.combinations(those, 2), key=lambda pair: -log_odds(pair, priors)))


def log_odds(hypothesis: Hypothesis, priors: Priors = PRIORS) -> float:
    """Compute the logarithm of the prior probability of some effects over that of none."""
    chances = [priors.effect(name) for name in forward(hypothesis)]
    return sum(math.log(p / (1.0 - p)) for p in chances)


def spaces_of(
    effects: Mapping[str, Effect],
    setting: Setting,
    pairs: Sequence[Hypothesis] | None = None,
    sense: Sense = "known",
    priors: Priors = PRIORS,
) -> tuple[Space, ...]:
    """List the spaces of none, each effect, and the pairs (all by default).

    Behind them stand those with the reversed sense (``diagnosis.bench.sense``).
    """
    single = [(name,) for name in sorted(effects)]
    pairs = pairs_of(list(effects), priors) if pairs is None else pairs
    return spaces_for(both_senses([NONE, *single, *pairs], effects, sense), effects, setting)


def spaces_for(
    hypotheses: Sequence[Hypothesis], effects: Mapping[str, Effect], setting: Setting
) -> tuple[Space, ...]:
    """Return the spaces of some hypotheses."""
    bounded = frozenset(name for name, e in effects.items() if _bounded(e, setting))
    return tuple(Space(tuple(effects[name] for name in h), setting, bounded) for h in hypotheses)


def plain(hypothesis: Hypothesis, effects: Mapping[str, Effect]) -> str:
    """Return a hypothesis as people say it."""
    if hypothesis == UNKNOWN:
        return "something that no known effect explains"
    names = [effects[name].plain for name in hypothesis]
    if len(names) > 2:
        return f"{', '.join(names[:-1])} and {names[-1]} together"
    return " together with ".join(names) or "no effect"


def in_common(hypotheses: Sequence[Hypothesis]) -> Hypothesis:
    """Return the effects that all of some hypotheses have, in alphabetical order."""
    those = [set(h) for h in hypotheses if h != UNKNOWN]
    common = set.intersection(*those) if those and len(those) == len(hypotheses) else set()
    return tuple(sorted(common))


def without(hypothesis: Hypothesis, some: Hypothesis) -> Hypothesis:
    """Return a hypothesis less some of its effects."""
    return tuple(name for name in hypothesis if name not in some)


def priors_of(
    hypotheses: Sequence[Hypothesis], sense: Sense = "known", priors: Priors = PRIORS
) -> dict[Hypothesis, float]:
    """Return the prior probability of each hypothesis, which add to one.

    What is left of the plain sense's goes to the reversed one, hypothesis by hypothesis.
    """
    share = priors.reversed(sense) if any(REVERSED in h for h in hypotheses) else 0.0
    raw = {
        h: (share if REVERSED in h else 1.0 - share) * math.exp(log_odds(h, priors))
        for h in hypotheses
        if h != UNKNOWN
    }
    unlisted = priors.unlisted if UNKNOWN in hypotheses else 0.0
    whole = sum(raw.values())
    known = {h: (1.0 - unlisted) * weight / whole for h, weight in raw.items()}
    return known | ({UNKNOWN: unlisted} if unlisted else {})


def with_third(pair: Hypothesis, effects: Iterable[str]) -> tuple[Hypothesis, ...]:
    """Return a pair with each further effect, in alphabetical order."""
    return tuple(
        tuple(sorted((*pair, name))) for name in sorted(effects) if name not in (*pair, REVERSED)
    )
