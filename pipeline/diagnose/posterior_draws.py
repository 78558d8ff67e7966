"""Draws from the posterior of a diagnosis as keys of a study, and its factors of ``[uncertain]``.

All draws have the named effects. Beside them they have other effects by their probability.

A study has factors of the contact's friction and dissipation. A factor differs from shift to shift,
while the posterior is of one unknown number. The mean over both is the same; the scatter from shift
to shift is too wide.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from dogshape.diagnosis.bench.sense import REVERSED
from dogshape.diagnosis.diagnosis import Diagnosis
from dogshape.diagnosis.inference.fit import Fit
from dogshape.diagnosis.terms import Array, Hypothesis
from dogshape.pipeline.diagnose.bench_study import rounded
from dogshape.pipeline.diagnose.effect_keys import EffectKeys
from dogshape.sim.effect import Effect

DRAWS = 200  #: of the posterior
LEAST = 1e-9  #: probability of a set that was asked for, so that it can be drawn
RARE = 0.005  #: probability below which a hypothesis is not drawn
#: Parameter that a factor scales, by effect, and the factor.
FACTORS = {
    "contact_dissipation": ("dissipation_s_m", "dissipation_factor"),
    "contact_friction": ("dynamic_friction", "friction_factor"),
}
TAIL = 0.05  #: probability outside of an interval, either side
NARROW = 0.005  #: spread of a logarithm below which there is no factor

Values = Mapping[str, Mapping[str, float]]  #: of each parameter of each effect


def rivals_of(found: Diagnosis, chosen: Hypothesis, asked: Sequence[str] = ()) -> list[Hypothesis]:
    """List the other hypotheses that contain named and asked effects, with the chosen sense."""
    causes, turned = {*found.verdict.causes, *asked}, REVERSED in chosen
    return [
        h
        for h, p in found.posterior.items()
        if h in found.fits and h != chosen and causes <= set(h) and p >= RARE
        if (REVERSED in h) == turned
    ]


def by_effect(found: Diagnosis, hypothesis: Hypothesis, numbers: Array) -> Values:
    """Sort the numbers (p,) of a hypothesis by effect and parameter."""
    space = found.fits[hypothesis].space
    return {
        effect.name: {
            p.name: rounded(number)
            for p, number in zip(
                effect.parameters, numbers[space.columns(effect.name)].tolist(), strict=True
            )
        }
        for effect in space.effects
    }


def drawn_from(
    found: Diagnosis, those: Sequence[Hypothesis], count: int, seed: int
) -> list[tuple[Hypothesis, Values]]:
    """Draw hypotheses by their probabilities, each with values from its posterior."""
    generator = np.random.default_rng(seed)
    shares = np.array([max(found.posterior.get(h, 0.0), LEAST) for h in those])
    which = generator.choice(len(those), size=count, p=shares / shares.sum())
    fits = [(those[place], found.fits[those[place]].values) for place in which]
    return [(h, by_effect(found, h, rows[generator.integers(len(rows))])) for h, rows in fits]


def row_of(
    number: int,
    hypothesis: Hypothesis,
    values: Values,
    taken: Mapping[str, Effect],
    keys: EffectKeys,
) -> dict[str, Any]:
    """Return a draw as keys of the study; an effect that it lacks has its neutral values."""
    found: dict[str, Any] = {"draw": number, "hypothesis": " + ".join(hypothesis)}
    for name, effect in taken.items():
        found |= keys.settings(effect, values.get(name) or effect.neutral(keys.base))
    return found


def uncertain_of(fit: Fit, means: Values) -> tuple[dict[str, Any], list[str]]:
    """Return sections of ``[uncertain]`` by name, and a remark on effects without a factor.

    A factor is lognormal with the posterior's median and spread of the logarithm, cut at its 90 %
    interval, over the mean of the study.
    """
    sections = dict[str, Any]()
    for name in means.keys() & FACTORS.keys():
        parameter, factor = FACTORS[name]
        place = [p.name for p in fit.space.parameters].index(parameter)
        section = _lognormal(fit.values[:, place] / means[name][parameter])
        sections |= {factor: section} if section else {}
    rest = ", ".join(name for name in means if name not in FACTORS and means[name])
    return sections, [f"[uncertain] has no factor of {rest}: the draws have the spread"] * bool(
        rest
    )


def _lognormal(ratios: np.ndarray) -> dict[str, Any] | None:
    """Return a distribution of factors, None where they hardly spread."""
    low, median, high = np.quantile(ratios, (TAIL, 0.5, 1.0 - TAIL))
    spread = float(np.log(ratios).std())
    if spread < NARROW or not low < median < high:
        return None
    numbers = {"median": median, "factor": math.exp(spread), "low": low, "high": high}
    rounded_ones = {name: float(f"{value:.4g}") for name, value in numbers.items()}
    return {"distribution": "lognormal", **rounded_ones}
