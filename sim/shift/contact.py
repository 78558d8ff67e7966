"""Contact of the dogs: named parameter sets and how the solver reads them.

The contact is a compliant layer (pressure = stiffness x penetration, Drake's
hydroelastic model) with Hunt and Crossley's dissipation ``p (1 + d v)`` and
Coulomb friction regularised over a stiction velocity.

``adams2019``
    reproduces the published model (thesis tables 7 and 8: coefficients 0.30 and
    0.16, transitions 0.1 and 1 m/s; the solver's fall from one to the other is at
    ten stiction velocities, just there). Its stiction velocity lets a face creep
    that real steel would hold; use it for comparison only.
``lubricated_steel``
    for design: oiled hardened steel, coefficients 0.12 and 0.10, with a
    stiction velocity small against every sliding speed of a shift: at half of it
    mean times change by less than 0.2 % (``benchmarks/convergence.py``).

Stiffness of the design set. A pair of teeth of steel has a single stiffness
c' = 14 N/(mm um) per width (ISO 6336-1, method C). Over the height of a flank of
3.1 mm that is 14e9 / 3.1e-3 = 4.5e12 Pa/m; 5e12 is used, for all faces alike.
Dissipation 20 s/m leaves a restitution of 0.24 at 0.2 m/s and 0.10 at 0.5 m/s, as
oil between hardened faces does (an assumption; ``validation.impact`` has the law).

Stiffness and dissipation of the published set. IMPACT with its damper of 1e4 N s/m
stops a dog's share of the ring, 0.02 kg at 0.2 m/s, within 3.5 to 3.6 um, almost
whatever its K, whose unit is ambiguous, and throws next to nothing back. On a flank of
12.6 mm2 the law above does so with 5e11 Pa/m and 100 s/m: 3.3 um, restitution 0.05
(``tests/verification/test_impact.py``).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from dogshape.sim.errors import InputError, Within, did_you_mean, refusal, require_ranges


@dataclass(frozen=True)
class ContactSet:
    """Parameters of the dog contact.

    Parameters
    ----------
    name : of the set, for reports.
    static_friction, dynamic_friction : Coulomb coefficients.
    stiction_velocity : slip below which friction is regularised, m/s.
    stiffness : pressure per penetration, Pa/m.
    dissipation : Hunt and Crossley's coefficient, s/m.
    """

    name: str
    static_friction: Annotated[float, Within("static_friction", 0.0, 1.5)]
    dynamic_friction: Annotated[float, Within("dynamic_friction", 0.0, 1.5)]
    stiction_velocity: Annotated[float, Within("stiction_velocity_m_s", 1e-5, 1.0)]
    stiffness: Annotated[float, Within("stiffness_Pa_m", 1e10, 1e16)]
    dissipation: Annotated[float, Within("dissipation_s_m", 0.0, 1e4)]

    def __post_init__(self) -> None:
        require_ranges(self, "contact", "correct the contact set")
        if self.dynamic_friction > self.static_friction:
            rule = f"it must not exceed contact.static_friction = {self.static_friction:.6g}"
            remedy = "exchange or correct the two coefficients"
            message = refusal("contact.dynamic_friction", self.dynamic_friction, "", rule, remedy)
            raise InputError(message)


CONTACT_SETS: dict[str, ContactSet] = {
    "adams2019": ContactSet("adams2019", 0.30, 0.16, 0.1, 5e11, 100.0),
    "lubricated_steel": ContactSet("lubricated_steel", 0.12, 0.10, 2e-4, 5e12, 20.0),
}


def contact_set(name: str) -> ContactSet:
    """Return a named set; an unknown name raises InputError with the valid ones."""
    if name not in CONTACT_SETS:
        hint = did_you_mean(name, CONTACT_SETS)
        raise InputError(f"contact.set is '{name}', which is not a contact set; {hint}")
    return CONTACT_SETS[name]
