"""Sizes at the end of their range: where they pile up, and the effects with that range wider.

A prior says what is held possible before the data. Where the sizes of the leading hypothesis pile
up at an end of it, the data ask for more: the range is widened there and the data are diagnosed
again. An end below which an effect only grows too weak to be seen is none.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal, TypeVar

import numpy as np

from dogshape.diagnosis.bench.sense import REVERSED
from dogshape.diagnosis.likelihood.scores import Scored
from dogshape.diagnosis.prediction.hypotheses import NONE, log_odds
from dogshape.diagnosis.settings import Decision, Settings
from dogshape.diagnosis.terms import Hypothesis
from dogshape.sim.effect import Effect, Parameter
from dogshape.sim.setting import Setting

#: A range was widened, has nothing physical beyond its end, or was widened as often as is allowed.
Remedy = Literal["widened", "bound", "left"]
TRIED = (1.0, 0.8, 0.6, 0.4, 0.2)  #: shares of a widening, until one gives a bench

Effects = Mapping[str, Effect]
Found = TypeVar("Found")  #: a diagnosis


@dataclass(frozen=True)
class RangeEnd:
    """Sizes of an effect at an end of their range, and what was done about it.

    Parameters
    ----------
    effect : by name.
    parameter : with the range at whose end the sizes lie.
    upper : whether that is the upper end.
    probability : that the size lies there.
    remedy : see ``Remedy``.
    moved : the end after widening; where it was not widened, the same.
    alone : whether they do so where the effect acts alone, and others lead.
    """

    effect: str
    parameter: Parameter
    upper: bool
    probability: float
    remedy: Remedy = "left"
    moved: float = float("nan")
    alone: bool = False

    @property
    def end(self) -> float:
        """The end at which the sizes lie, in the unit of the parameter."""
        return self.parameter.high if self.upper else self.parameter.low

    def as_dict(self) -> dict[str, Any]:
        """Write the row of the record."""
        return {
            "effect": self.effect,
            "parameter": self.parameter.name,
            "end": self.end,
            "upper": self.upper,
            "probability": self.probability,
            "remedy": self.remedy,
            "moved": self.moved if self.remedy == "widened" else self.end,
            "alone": self.alone,
        }


def range_ends(found: Scored, limits: Decision) -> tuple[RangeEnd, ...]:
    """List the ends of ranges at which the sizes of a hypothesis pile up."""
    weights, shares, ends = found.weights(), found.rows.shares, list[RangeEnd]()
    column = 0
    for effect in found.space.effects:
        for parameter in effect.parameters:
            within = parameter.neutral_of(found.space.setting) > parameter.low
            for upper in (False, True) if within else (True,):
                mine = shares[:, column]
                there = mine > 1.0 - limits.end_share if upper else mine < limits.end_share
                mass = float(weights[np.asarray(there)].sum())
                if mass > limits.end_mass:
                    ends.append(RangeEnd(effect.name, parameter, upper, mass))
            column += 1
    return tuple(ends)


def widened(
    effects: Effects, ends: tuple[RangeEnd, ...], setting: Setting, share: float
) -> tuple[dict[str, Effect], tuple[RangeEnd, ...]]:
    """Return the effects with wider ranges, and the ends with what was done about them.

    ``share`` of its measure is added to a range; less, where such values give no bench.
    """
    changed, told = dict(effects), list[RangeEnd]()
    for one in ends:
        effect = changed[one.effect]
        wider = _wider(effect, one, setting, share)
        if wider is None:
            told.append(replace(one, remedy="bound"))
            continue
        changed[one.effect] = effect.with_range(wider)
        moved = wider.high if one.upper else wider.low
        told.append(replace(one, remedy="widened", moved=moved))
    return changed, tuple(told)


def _wider(effect: Effect, one: RangeEnd, setting: Setting, share: float) -> Parameter | None:
    """Return the parameter with the widest range that gives a bench, None without one."""
    (now,) = [p for p in effect.parameters if p.name == one.parameter.name]
    for part in TRIED:
        wider = now.widened(part * share, upper=one.upper)
        end = wider.high if one.upper else wider.low
        if end != one.end and effect.possible(
            setting, {**effect.neutral(setting), wider.name: end}
        ):
            return wider
    return None


def diagnosed_wider(
    once: Callable[[Effects], Found],
    scored: Callable[[Found], tuple[Hypothesis, Mapping[Hypothesis, Scored]]],
    effects: Effects,
    settings: Settings,
) -> tuple[Found, tuple[RangeEnd, ...]]:
    """Diagnose, and again with wider ranges while sizes lie at an end of theirs.

    Parameters
    ----------
    once : diagnoses with some effects.
    scored : gives the leading hypothesis of that, and all with their evidence.
    effects : with the ranges to begin with.
    settings : of the decision ``end_share``, ``end_mass``, ``wider``, ``widenings``, ``shown``,
        ``simpler`` and ``plausible`` count; of the priors the probabilities of effects.
    """
    limits = settings.decision
    found, told, held = once(effects), list[RangeEnd](), set[str]()
    for _ in range(limits.widenings):
        leading, every = scored(found)
        setting = every[NONE].space.setting
        ends = () if leading == NONE else range_ends(every[leading], limits)
        wider, done = widened(effects, ends, setting, limits.wider)
        for one in _simpler(leading, every, limits):
            name = one[0].effect
            if name in held or name in {end.effect for end in done}:
                continue
            tried, those = widened(wider, one, setting, limits.wider)
            held.add(name)
            if _matches(once, scored, (name, tried), every[leading], settings):
                wider, done = tried, (*done, *those)
        told += done
        if all(one.remedy == "bound" for one in done):
            return found, tuple(told)
        effects, found = wider, once(wider)
    leading, every = scored(found)
    return found, (*told, *(range_ends(every[leading], limits) if leading else ()))


def _simpler(
    leading: Hypothesis, scored: Mapping[Hypothesis, Scored], limits: Decision
) -> list[tuple[RangeEnd, ...]]:
    """List the ends at which sizes of single effects lie where several lead.

    Those effects count that explain most, if they are shown beside none.
    """
    if len(leading) < 2:
        return []
    least = scored[NONE].log_evidence + limits.shown
    shown = [h for h in scored if len(h) == 1 and scored[h].log_evidence > least]
    best = sorted(shown, key=lambda h: -scored[h].log_evidence)
    beyond = [found for h in best if (found := range_ends(scored[h], limits))]
    return [tuple(replace(one, alone=True) for one in found) for found in beyond[: limits.simpler]]


def _matches(
    once: Callable[[Effects], Found],
    scored: Callable[[Found], tuple[Hypothesis, Mapping[Hypothesis, Scored]]],
    tried: tuple[str, Effects],
    leading: Scored,
    settings: Settings,
) -> bool:
    """Test that a single effect with its wider range is plausible beside the leading hypothesis.

    It is diagnosed alone, which takes a small part of the simulations of all effects together.
    """
    name, effects = tried
    every = scored(once({n: effects[n] for n in (name, REVERSED) if n in effects}))[1]
    priors = settings.priors
    best = max(one.log_evidence + log_odds(h, priors) for h, one in every.items() if name in h)
    mark = leading.log_evidence + log_odds(leading.space.hypothesis, priors)
    return best > mark + math.log(settings.decision.plausible)
