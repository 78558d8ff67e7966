"""Posterior uncertainty of effects as ``[uncertain]`` keys, where a study has one for them.

A study has factors of the contact's friction and dissipation. A factor differs from shift to shift,
while what a bench leaves open is one number that nobody knows; the mean over both is the same, so
an expected time is right and its scatter from shift to shift is too wide.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from dogshape.diagnosis.inference.parameter_intervals import quantiles
from dogshape.diagnosis.likelihood.scores import Scored

#: Parameter that a factor scales, by effect, and the factor.
FACTORS = {
    "contact_dissipation": ("dissipation_s_m", "dissipation_factor"),
    "contact_friction": ("dynamic_friction", "friction_factor"),
}
TAIL = 0.05  #: probability outside of an interval, either side
LEAST = 0.005  #: spread of a logarithm below which a factor is as good as certain


def uncertain_of(
    found: Scored, means: Mapping[str, Mapping[str, float]]
) -> tuple[dict[str, Any], list[str]]:
    """Return sections of ``[uncertain]`` by name, and sentences on what has none.

    A factor is lognormal with the posterior's median and spread of the logarithm, cut at its 90 %
    interval, over the mean that the study has.
    """
    sections: dict[str, Any] = {}
    certain = []
    for effect in found.space.effects:
        if effect.name not in FACTORS:
            certain += [effect.name] if effect.parameters else []
            continue
        parameter, factor = FACTORS[effect.name]
        place = [p.name for p in found.space.parameters].index(parameter)
        values, weights = found.space.values(found.rows.shares)[:, place], found.weights()
        section = _lognormal(values / means[effect.name][parameter], weights)
        if section is not None:
            sections[factor] = section
    told = []
    if certain:
        told = [
            f"no factor of [uncertain] says how unsure {', '.join(certain)} "
            f"{'is' if len(certain) == 1 else 'are'}: the file has the means, the draws the spread"
        ]
    return sections, told


def _lognormal(ratios: np.ndarray, weights: np.ndarray) -> dict[str, Any] | None:
    """Return a distribution of factors, None where they hardly spread."""
    low, median, high = quantiles(ratios, weights, (TAIL, 0.5, 1.0 - TAIL))
    logs = np.log(ratios)
    spread = math.sqrt(float(weights @ (logs - weights @ logs) ** 2))
    if spread < LEAST or not low < median < high:
        return None
    return {
        "distribution": "lognormal",
        **{
            name: float(f"{value:.4g}")
            for name, value in {
                "median": median,
                "factor": math.exp(spread),
                "low": low,
                "high": high,
            }.items()
        },
    }
