r"""Dog on dog: what a face and its edge bear at the hardest landing of the simulation.

The simulation gives the load per length :math:`w = F/(N b)` for each class of overlap *L* (its
lower end). A rounded crest takes *c* from either face. Where :math:`L - 2 c` is flat, the case
bears :math:`w/(L - 2 c)` up to its yield stress, the core :math:`w/(L - 2 c + 2 t)` up to its proof
stress; else two cylinders meet, :math:`p_H = \sqrt{w E^*/(\pi R)}`, :math:`R = \varrho/2`,
:math:`E^* = E/(2 (1 - \nu^2))`, up to the shakedown limit of a line contact, four times the yield
stress in shear or 0.77 HV (Johnson, *Contact Mechanics*, 1985). Where the share :math:`K_s` of the
dogs lands (``sim.strength.load_case``), loads grow by :math:`1/\sqrt{K_s}`.

Landings are those of rigid rings and no bound, and the hardest of a sample grows with it: with
``load.landing_share`` the checks take the load that this share of all shifts exceeds.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import astuple, dataclass

import numpy as np

from dogshape.sim.shift.geometry import LAND, Dog, tip_radius
from dogshape.sim.shift.loads import OVERLAPS, Landing
from dogshape.sim.strength.checks import RULES, Check, checks_of
from dogshape.sim.strength.dog_strength import Limits
from dogshape.sim.strength.materials import POISSON, YOUNG

MODULUS = YOUNG / (2.0 * (1.0 - POISSON**2))  #: Pa, of two like bodies


def edge_pressure(line_load: float, radius: float) -> float:
    """Compute the pressure of Hertz of two like edges, Pa; load in N/m, their radius in m."""
    return math.sqrt(line_load * MODULUS / (math.pi * 0.5 * radius))


def hardest(landings: Iterable[Landing]) -> Landing:
    """Return the largest load in each class of overlap; zeros where there is none."""
    columns = list(zip(*(one.line_loads for one in landings), strict=True))
    return Landing(tuple(max(column) for column in columns)) if columns else Landing()


LANDING_RULES = tuple(rule for rule in RULES.values() if rule.group == "impact")


@dataclass(frozen=True)
class Demand:
    """Load of a landing on faces, on the core below them and on edges, Pa."""

    face: float = 0.0
    core: float = 0.0
    edge: float = 0.0


def exceeded(demands: Sequence[Demand], weights: Sequence[float], share: float) -> Demand:
    """Compute what the ``share`` in (0, 1) of all shifts exceeds, of each pressure for itself.

    ``weights`` of the shifts need not add up to one. A value stands in the middle of its weight;
    between two the quantile runs straight, and beyond the largest nothing is known.
    """
    if not demands:
        return Demand()
    columns, mass = [], np.array(weights) / sum(weights)
    for column in np.array([astuple(one) for one in demands]).T:
        order = np.argsort(column, kind="stable")
        places = np.cumsum(mass[order]) - 0.5 * mass[order]
        columns.append(float(np.interp(1.0 - share, places, column[order])))
    return Demand(*columns)


def demand_of(dog: Dog, landing: Landing, limits: Limits) -> Demand:
    """Compute what a landing makes faces, core and edges bear."""
    radius = tip_radius(dog, limits.root_radius)
    lost = 2.0 * radius * dog.crest_cut
    spread = 2.0 * limits.material.case_depth
    classes = [
        (overlap - lost, w * (1.0 / math.sqrt(limits.load.landing(dog, w))))
        for overlap, w in zip(OVERLAPS, landing.line_loads, strict=True)
    ]
    flats = [(flat, load) for flat, load in classes if flat >= LAND]
    face = max((load / flat for flat, load in flats), default=0.0)
    core = max((load / (flat + spread) for flat, load in flats), default=0.0)
    edge = max((load for flat, load in classes if flat < LAND), default=0.0)
    return Demand(face, core, edge_pressure(edge, radius))


def demand_checks(demand: Demand, limits: Limits) -> tuple[Check, ...]:
    """Return the checks of a landing, or of what a share of landings exceeds."""
    material = limits.material
    bears = (material.case_yield / limits.load.safety, limits.allowable_stress)
    limiting = (*bears, material.edge_pressure)
    names = (rule.name for rule in LANDING_RULES)
    return checks_of(zip(names, astuple(demand), limiting, strict=True))
