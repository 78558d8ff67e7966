r"""Fatigue of the root under a load spectrum: damage summed after Miner.

A load that the root endures :math:`N(\sigma)` times uses up :math:`1/N` of its life. The classes of
a spectrum, :math:`n_i` cycles of the stress :math:`\sigma_i`, use up

.. math:: D = \sum_i n_i / N(\sigma_i), \qquad
   N = 3 \cdot 10^6\,(\sigma/\sigma_{3 \cdot 10^6})^{-1/x},

*x* being the slope of the life factor :math:`Y_{NT}` (``sim.strength.materials``). A stress beyond
the static strength is borne by none. Small loads damage on the flat slope that Y_NT has beyond 3e6
cycles, with no end to it (on the safe side). The margin is the factor on all loads at which *D* is
1.

Source: ISO 6336-6 (damage of a spectrum); one class alone is the check of ISO 6336-3.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from dogshape.sim.strength.materials import (
    ENDURANCE_CYCLES,
    LONG_CYCLES,
    LONG_FACTOR,
    STATIC_CYCLES,
    Material,
)


def cycles_endured(material: Material, strength: float) -> float:
    """Compute how many cycles leave sound a root of so much of the endurance at 3e6 cycles.

    ``strength`` is the stress over that endurance. 0 beyond the static strength.
    """
    if strength <= 0.0:
        return math.inf
    if strength > material.static_factor * (1.0 + 1e-12):  # the end of the slope belongs to it
        return 0.0
    low, end = ENDURANCE_CYCLES / STATIC_CYCLES, material.static_factor
    if strength <= 1.0:
        low, end = LONG_CYCLES / ENDURANCE_CYCLES, 1.0 / LONG_FACTOR
    slope = math.log(end) / math.log(low)
    exponent = -math.log(strength) / slope if slope > 0.0 else -math.inf
    return ENDURANCE_CYCLES * math.exp(min(exponent, 600.0))


def damage(material: Material, classes: Sequence[tuple[float, float]]) -> float:
    """Sum the damage of (stress over the endurance at 3e6 cycles, cycles)."""
    total = 0.0
    for strength, cycles in classes:
        endured = cycles_endured(material, strength)
        total += cycles / endured if endured > 0.0 else math.inf
    return total


def reserve(material: Material, cycles: Sequence[float], *strengths: float) -> float:
    """Find the factor on all stresses at which the damage is 1; inf where there is no load.

    ``strengths`` are the stresses of classes over the endurance at 3e6 cycles.
    """
    classes, peak = [*zip(strengths, cycles, strict=True)], max(strengths, default=0.0)
    if peak <= 0.0:
        return math.inf

    # Bisection: scipy.optimize takes half a second to load, which a quick check does not have.
    high = material.static_factor / peak
    low, bears = 0.0, _bears(material, classes, high)
    while not bears and high - low > 1e-12 * high:
        middle = 0.5 * (low + high)
        if _bears(material, classes, middle):
            low = middle
        else:
            high = middle
    return high


def _bears(material: Material, classes: Sequence[tuple[float, float]], factor: float) -> bool:
    return damage(material, [(factor * stress, cycles) for stress, cycles in classes]) <= 1.0
