r"""Dog on dog: what a face and its edge bear at the hardest landing of the simulation.

The simulation's axial force spreads over the overlap of the faces of all dogs or, where
they hardly overlap, over the edge of each: line load :math:`w = F/(N b)` (``sim.loads``).
Where only the share :math:`K_s` of the dogs lands, both grow by :math:`1/\sqrt{K_s}`: with
fewer dogs the contact is softer, the peak of a blow goes with the root of its
stiffness, and what is left is shared by fewer.

The edge is rounded with the root radius :math:`\varrho`; on a plane of the same steel the
pressure of Hertz is :math:`p_H = \sqrt{w E^*/(\pi \varrho)}`, :math:`E^* = E/(2 (1 - \nu^2))`.

The rings are rigid behind the dogs, so both are upper bounds.
Sources: Hertz for the line contact; ISO 76 for its limit.
"""

from __future__ import annotations

import math
from collections.abc import Iterable

from sim.checks import Check, Rule
from sim.loads import Landing
from sim.strength import Limits
from sim.units import MPA

YOUNG, POISSON = 210e9, 0.3  #: steel, Pa


def hardest(landings: Iterable[Landing]) -> Landing:
    """Return the largest of either; zeros where there is none."""
    found = list(landings)
    return Landing(
        max((one.face_pressure for one in found), default=0.0),
        max((one.line_load for one in found), default=0.0),
    )


def edge_pressure(line_load: float, radius: float) -> float:
    """Return the pressure of Hertz in Pa of an edge rounded with ``radius`` (m) on a plane."""
    modulus = YOUNG / (2.0 * (1.0 - POISSON**2))
    return math.sqrt(line_load * modulus / (math.pi * radius))


FACE_RULE = Rule(
    "face_pressure_impact",
    "impact",
    "mean pressure on the overlap of the faces, hardest landing",
    "F/(N b L sqrt(K_s)), L overlap of the faces",
    "simulated peak; limit: proof stress over safety",
    "MPa",
    "material.proof_stress_MPa",
    True,
)
EDGE_RULE = Rule(
    "edge_pressure_impact",
    "impact",
    "pressure of Hertz under the rounded edge, hardest landing",
    "sqrt(w E*/(pi rho)), w = F/(N b sqrt(K_s))",
    "simulated peak; limit 4000 MPa HV/800 (ISO 76)",
    "MPa",
    "material.surface_hardness_HV",
    True,
)


def landing_checks(landing: Landing, limits: Limits) -> tuple[Check, ...]:
    """Return the checks of the hardest landing."""
    uneven = 1.0 / math.sqrt(limits.load.load_sharing)
    edge = edge_pressure(landing.line_load * uneven, limits.root_radius)
    return (
        Check(FACE_RULE, landing.face_pressure * uneven / MPA, limits.allowable_stress / MPA),
        Check(EDGE_RULE, edge / MPA, limits.material.edge_pressure / MPA),
    )
